#include "tests/formats/gltf/reader.h"

namespace kiln {
namespace {

GltfScene scene() {
    GltfScene s;
    s.generator = "test";
    s.materials = {{.name = "red", .base_color = {1, 0, 0, 0.5f}, .emissive = {4, 2, 0}, .blend = true, .double_sided = true, .extras = ""}, {}};
    s.materials[1].name = "b\"q\\";
    GltfPrimitive p;
    p.positions = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}};
    p.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
    p.tangents = {{1, 0, 0, 1}, {1, 0, 0, 1}, {1, 0, 0, -1}};
    p.uv0 = {{0, 0}, {1, 0}, {0, 1}};
    p.indices = {0, 1, 2};
    GltfPrimitive q = p;
    q.material = 1, q.uv1 = p.uv0, q.extras = "{\"lightmap_page\":3}";
    s.meshes = {{"mesh", {p, q}}};
    s.lights = {{.name = "lamp", .kind = GltfLight::spot, .intensity = 5, .range = 3, .inner_rad = 0.1f, .outer_rad = 0.5f}, {.name = "sun", .kind = GltfLight::directional}};
    GltfNode root, child, lamp;
    root.name = "root", root.scale = 0.025, root.children = {1, 2};
    child.mesh = 0, child.translation = {1, 2, 3}, child.extras = "{\"a\":[1,2]}";
    lamp.light = 0;
    s.nodes = {root, child, lamp};
    s.roots = {0};
    return s;
}

TEST(Gltf, BothFormsKeepTheStandardAndSayTheSame) {
    const GltfScene s = scene();
    const test::GltfRead glb = test::read_glb(write_glb(s));
    glb.check();
    const GltfFiles files = write_gltf(s, "a b.bin");
    test::GltfRead gltf{nlohmann::json::parse(files.json), files.bin};
    gltf.check();
    EXPECT_EQ(gltf.json["buffers"][0]["uri"], "a%20b.bin");
    gltf.json["buffers"][0].erase("uri");
    EXPECT_EQ(gltf.json, glb.json);
    EXPECT_EQ(gltf.bin, glb.bin);
    EXPECT_EQ(write_glb(s), write_glb(s));
}

TEST(Gltf, NumbersComeBack) {
    const GltfScene s = scene();
    const test::GltfRead r = test::read_glb(write_glb(s));
    const auto& p = r.json["meshes"][0]["primitives"][1];
    EXPECT_EQ(p["extras"]["lightmap_page"], 3);
    EXPECT_EQ(r.floats(p["attributes"]["POSITION"])[2], (std::vector<float>{0, 2, 0}));
    EXPECT_EQ(r.floats(p["attributes"]["TANGENT"])[2], (std::vector<float>{1, 0, 0, -1}));
    EXPECT_EQ(r.floats(p["attributes"]["TEXCOORD_1"])[1], (std::vector<float>{1, 0}));
    EXPECT_EQ(r.indices(p["indices"]), (std::vector<std::uint32_t>{0, 1, 2}));
    EXPECT_FALSE(r.json["meshes"][0]["primitives"][0]["attributes"].contains("TEXCOORD_1"));
    // Emission above 1 is split into a factor within 0..1 and a strength.
    const auto& red = r.json["materials"][0];
    EXPECT_EQ(red["emissiveFactor"], (nlohmann::json{1.0, 0.5, 0.0}));
    EXPECT_EQ(red["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 4.0);
    EXPECT_EQ(red["alphaMode"], "BLEND");
    EXPECT_EQ(red["doubleSided"], true);
    EXPECT_EQ(r.json["materials"][1]["name"], "b\"q\\");
    EXPECT_EQ(r.json["nodes"][1]["extras"]["a"][1], 2);
    EXPECT_EQ(r.json["nodes"][2]["extensions"]["KHR_lights_punctual"]["light"], 0);
    EXPECT_FALSE(r.json["extensions"]["KHR_lights_punctual"]["lights"][1].contains("range"));
}

TEST(Gltf, AnEmptySceneHasNoEmptyTables) {
    GltfScene s;
    test::read_glb(write_glb(s)).check();
    EXPECT_TRUE(write_gltf(s, "x.bin").bin.empty());
}

TEST(Gltf, WhatDoesNotExistIsRefused) {
    const auto refused = [](auto&& change) {
        GltfScene s = scene();
        change(s);
        EXPECT_THROW(write_glb(s), std::invalid_argument);
    };
    refused([](GltfScene& s) { s.meshes[0].primitives[0].indices[1] = 3; });
    refused([](GltfScene& s) { s.meshes[0].primitives[0].material = 2; });
    refused([](GltfScene& s) { s.meshes[0].primitives[0].normals.pop_back(); });
    refused([](GltfScene& s) { s.meshes[0].primitives.clear(); });
    refused([](GltfScene& s) { s.meshes[0].primitives[0].positions[0].x = NAN; });
    refused([](GltfScene& s) { s.nodes[1].mesh = 1; });
    refused([](GltfScene& s) { s.nodes[2].light = 2; });
    refused([](GltfScene& s) { s.nodes[2].children = {1}; });
    refused([](GltfScene& s) { s.roots = {1}; });
    refused([](GltfScene& s) { s.lights[0].inner_rad = 1; });
}

} // namespace
} // namespace kiln

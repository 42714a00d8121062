// Files that a map names, as they lie on disk: Windows spellings on a case-sensitive file system.
#include "tests/support/program.h"
#include <cstring>

using namespace kiln::test;

namespace {

std::string solid(int x) { // a box, one unit wide at x
    const auto p = [](int a, int b, int c) { return "(" + std::to_string(a) + " " + std::to_string(b) + " " + std::to_string(c) + ")"; };
    const auto side = [&](const std::string& plane) { return "side { \"plane\" \"" + plane + "\" \"material\" \"wall\" }\n"; };
    return "solid {\n" + side(p(x, 0, 0) + p(x, 1, 0) + p(x, 0, 1)) + side(p(x + 1, 0, 0) + p(x + 1, 0, 1) + p(x + 1, 1, 0)) + side(p(0, 0, 0) + p(0, 0, 1) + p(1, 0, 0)) +
           side(p(0, 1, 0) + p(1, 1, 0) + p(0, 1, 1)) + side(p(0, 0, 0) + p(1, 0, 0) + p(0, 1, 0)) + side(p(0, 0, 1) + p(0, 1, 1) + p(1, 0, 1)) + "}\n";
}
std::string vmf(const std::string& solids, const std::vector<std::string>& instances = {}) {
    std::string text = "world {\n\"classname\" \"worldspawn\"\n" + solids + "}\n";
    for (const std::string& file : instances) text += "entity {\n\"classname\" \"func_instance\"\n\"file\" \"" + file + "\"\n}\n";
    return text;
}
std::string write(const Workplace& w, const std::string& name, const std::string& text) {
    std::filesystem::create_directories(std::filesystem::path(w.path(name)).parent_path());
    return w.write(name, text);
}
std::size_t brushes(const Outcome& o) {
    std::size_t n = 0;
    for (std::size_t at = o.out.find("brush "); at != std::string::npos; at = o.out.find("brush ", at + 1)) ++n;
    return n;
}
bool says(const Outcome& o, const std::string& what) { return o.said.find(what) != std::string::npos; }

} // namespace

TEST(Files, InstancesAreFoundWhereverEditorsPutThem) {
    const Workplace w;
    // Beside the map; in the `maps` folder above it; named by an instance beside that; with a wrong ending and case.
    const std::string map = write(w, "game/Maps/campaign/level.vmf", vmf(solid(0), {"parts/a", "Instances\\B.VMF", "./parts/A.vmf"}));
    write(w, "game/Maps/campaign/Parts/a.vmf", vmf(solid(10)));
    write(w, "game/Maps/instances/b.vmf", vmf(solid(20), {"c"}));
    write(w, "game/Maps/instances/C.vmf", vmf(solid(30)));
    const Outcome o = w.run({"dump", "document", map});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_FALSE(says(o, "instance-missing")) << o.said;
    EXPECT_EQ(brushes(o), 5u) << o.out;
}

TEST(Files, InstancePathsComeLast) {
    const Workplace w;
    const std::string map = write(w, "level.vmf", vmf(solid(0), {"part"}));
    write(w, "library/part.vmf", vmf(solid(1) + solid(2)));
    EXPECT_TRUE(says(w.run({"dump", "document", map}), "instance-missing"));
    EXPECT_EQ(brushes(w.run({"dump", "document", map, "--instance-path", w.path("library")})), 3u);
    write(w, "part.vmf", vmf(solid(1)));
    EXPECT_EQ(brushes(w.run({"dump", "document", map, "--instance-path", w.path("library")})), 2u);
}

TEST(Files, WhatIsMissingIsToldWithThePathsTried) {
    const Workplace w;
    const std::string map = write(w, "level.vmf", vmf(solid(0), {"no\\such", "folder", ""}));
    std::filesystem::create_directories(w.path("folder"));
    const Outcome o = w.run({"build", map, "--stop-after", "read"});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_TRUE(says(o, "level.vmf:14: warning")) << o.said;
    EXPECT_TRUE(says(o, w.path("no/such.vmf"))) << o.said;
    EXPECT_EQ(w.run({"build", map, "--stop-after", "read", "--werror"}).code, 6);
}

TEST(Files, PrefabsOfQuakeMapsAndManifests) {
    const Workplace w;
    write(w, "prefab.map", world(box(0, 0, 0, 8, 8, 8) + box(9, 0, 0, 10, 1, 1)));
    const std::string map = w.write("m.map", world(box(0, 0, 0, 1, 1, 1)) + entity("misc_external_map", 5, 0, 0, "\"_external_map\" \"PREFAB.map\"\n\"_external_map_classname\" \"func_detail\"\n"));
    const Outcome o = w.run({"dump", "document", map});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_EQ(brushes(o), 3u) << o.out;
    write(w, "a.vmf", vmf(solid(0)));
    write(w, "b.vmf", vmf(solid(5)));
    const Outcome m = w.run({"dump", "document", w.write("all.vmm", "\"Maps\"\n{\n\"VMF\"\n{\n\"File\" \"A.vmf\"\n}\n\"VMF\"\n{\n\"File\" \"b\"\n}\n}\n")});
    EXPECT_EQ(m.code, 0) << m.said;
    EXPECT_EQ(brushes(m), 2u) << m.out;
}

TEST(Files, CordonsAreAnOption) {
    const Workplace w;
    const std::string map = write(w, "level.vmf", vmf(solid(0)));
    EXPECT_TRUE(says(w.run({"build", map, "--stop-after", "read", "--cordon"}), "cordon-none"));
    EXPECT_FALSE(says(w.run({"build", map, "--stop-after", "read"}), "cordon"));
}

static std::size_t count_of(const std::string& text, const std::string& word) {
    std::size_t n = 0;
    for (std::size_t at = 0; (at = text.find(word, at)) != std::string::npos; ++at) ++n;
    return n;
}

// A sealed map cut by a cordon, with a displacement outside of it: sound, and bakes.
TEST(Files, ACordonedMapIsVerifiedAndBuilt) {
    const Workplace w;
    std::ifstream file(std::string(KILN_SOURCE_DIR) + "/maps/terrain/terrain.vmf", std::ios::binary);
    const std::string terrain((std::istreambuf_iterator<char>(file)), {});
    ASSERT_NE(terrain.find("dispinfo"), std::string::npos);
    const std::string around = write(w, "a.vmf", terrain + "cordon\n{\n\"mins\" \"(-96 -96 -4000)\"\n\"maxs\" \"(96 96 4000)\"\n\"active\" \"1\"\n}\n");
    Outcome o = w.run({"verify", around, "--cordon", "-q"});
    EXPECT_EQ(o.code, 0) << o.said << o.out;
    o = w.run({"build", around, "--cordon", "--draft", "-q", "-o", w.path("a.kiln")});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_EQ(w.run({"verify", w.path("a.kiln"), "-q"}).code, 0);
    const Outcome all = w.run({"dump", "displacements", around, "-q"}), cut = w.run({"dump", "displacements", around, "-q", "--cordon"});
    EXPECT_GT(count_of(all.out, "power"), count_of(cut.out, "power"));
    EXPECT_GT(count_of(cut.out, "power"), 0u);
}

TEST(Files, AnInstanceInTheLevelBringsItsOverlay) {
    // End to end: a room whose floor comes from an instance, with an overlay on it that names the floor's side.
    const Workplace w;
    const auto slab = [](int x0, int y0, int z0, int x1, int y1, int z1, int id) {
        const auto p = [](int a, int b, int c) { return "(" + std::to_string(a) + " " + std::to_string(b) + " " + std::to_string(c) + ")"; };
        const std::string planes[6] = {p(x0, y0, z0) + p(x0, y1, z0) + p(x0, y0, z1), p(x1, y0, z0) + p(x1, y0, z1) + p(x1, y1, z0), p(x0, y0, z0) + p(x0, y0, z1) + p(x1, y0, z0),
                                       p(x0, y1, z0) + p(x1, y1, z0) + p(x0, y1, z1), p(x0, y0, z0) + p(x1, y0, z0) + p(x0, y1, z0), p(x0, y0, z1) + p(x0, y1, z1) + p(x1, y0, z1)};
        std::string text = "solid {\n";
        for (int i = 0; i < 6; ++i)
            text += "side { \"id\" \"" + std::to_string(id + i) + "\" \"plane\" \"" + planes[i] + "\" \"material\" \"wall\" \"uaxis\" \"[1 0 0 0] 0.25\" \"vaxis\" \"[0 " + (i < 4 ? "0 -1" : "-1 0") + " 0] 0.25\" }\n";
        return text + "}\n";
    };
    const std::string walls = slab(-16, -16, 128, 144, 144, 144, 1) + slab(-16, -16, 0, 0, 144, 128, 11) + slab(128, -16, 0, 144, 144, 128, 21) + slab(0, -16, 0, 128, 0, 128, 31) + slab(0, 128, 0, 128, 144, 128, 41);
    write(w, "floor.vmf", "world {\n\"classname\" \"worldspawn\"\n" + slab(-16, -16, -16, 144, 144, 0, 1) +
                              "}\nentity {\n\"classname\" \"info_overlay\"\n\"material\" \"decals/crack\"\n\"sides\" \"6\"\n\"BasisOrigin\" \"64 64 0\"\n\"BasisU\" \"1 0 0\"\n\"BasisV\" \"0 1 0\"\n\"BasisNormal\" \"0 0 1\"\n"
                              "\"uv0\" \"-16 -8 0\"\n\"uv1\" \"-16 8 0\"\n\"uv2\" \"16 8 0\"\n\"uv3\" \"16 -8 0\"\n}\n");
    const std::string map = write(w, "room.vmf", "world {\n\"classname\" \"worldspawn\"\n" + walls +
                                                     "}\nentity {\n\"classname\" \"func_instance\"\n\"file\" \"floor\"\n\"angles\" \"0 90 0\"\n\"origin\" \"128 0 0\"\n}\n"
                                                     "entity {\n\"classname\" \"info_player_start\"\n\"origin\" \"64 64 32\"\n}\nentity {\n\"classname\" \"light\"\n\"origin\" \"64 64 100\"\n\"_light\" \"255 255 255 200\"\n}\n");
    const Outcome o = w.run({"dump", "overlays", map});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_NE(o.out.find("area 512"), std::string::npos) << o.out << o.said;
    const Outcome built = w.run({"build", map, "-o", w.path("room.kiln"), "--draft"});
    EXPECT_EQ(built.code, 0) << built.said;
    EXPECT_EQ(w.run({"info", w.path("room.kiln"), "--check"}).code, 0);
    const Outcome faces = w.run({"dump", "faces", w.path("room.kiln")}); // says of each face which file it is of
    EXPECT_EQ(faces.code, 0) << faces.said;
    EXPECT_NE(faces.out.find("floor.vmf"), std::string::npos) << faces.out;
    EXPECT_EQ(faces.out.find(w.path("floor.vmf")), std::string::npos) << faces.out;
    // So do the rows of the map, of whatever has a line: those of the instance name it, those of the map name nothing.
    for (const char* artefact : {"document", "world", "brushes", "sides", "fragments", "visible", "faces", "triangles", "overlays"}) {
        const Outcome rows = w.run({"dump", artefact, map, "-q"});
        EXPECT_EQ(rows.code, 0) << rows.said;
        EXPECT_NE(rows.out.find("file \"floor.vmf\""), std::string::npos) << artefact << "\n" << rows.out;
        EXPECT_EQ(rows.out.find(w.path("floor.vmf") + "\""), std::string::npos) << artefact;
        EXPECT_EQ(rows.out.find("file null") == std::string::npos, artefact == std::string("overlays")) << artefact; // the one overlay is of the instance
    }
    EXPECT_EQ(brushes(w.run({"dump", "brushes", map, "-q", "--filter", "file=floor.vmf"})), 1u);
}

namespace {

std::string little(std::uint64_t v, int size) {
    std::string s;
    for (int i = 0; i < size; ++i) s += static_cast<char>(v >> 8 * i & 255);
    return s;
}
std::string padded(std::string s, std::size_t size) {
    s.resize(size);
    return s;
}
// One texture of Quake, all texels of one colour.
std::string wad2(const std::string& name, int width, int height, char colour) {
    std::string texture = padded(name, 16) + little(static_cast<std::uint64_t>(width), 4) + little(static_cast<std::uint64_t>(height), 4);
    std::size_t next = 40;
    for (int m = 0; m < 4; ++m) texture += little(next, 4), next += static_cast<std::size_t>((width >> m) * (height >> m));
    texture.resize(next, colour);
    return "WAD2" + little(1, 4) + little(12 + texture.size(), 4) + texture + little(12, 4) + little(texture.size(), 4) + little(texture.size(), 4) + "D" + little(0, 3) + padded(name, 16);
}
} // namespace

TEST(Files, AManifestJoinsQuakeMaps) {
    const Workplace w;
    w.write("a.map", world(box(0, 0, 0, 1, 1, 1)) + entity("light", 1, 2, 3));
    w.write("b.map", world(box(9, 0, 0, 10, 1, 1)) + entity("info_player_start", 4, 5, 6));
    const Outcome o = w.run({"dump", "document", w.write("both.vmm", "\"Maps\"\n{\n\"VMF\"\n{\n\"File\" \"a.map\"\n}\n\"VMF\"\n{\n\"File\" \"b.map\"\n}\n}\n")});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_EQ(brushes(o), 2u) << o.out;
    EXPECT_TRUE(o.out.find("light") != std::string::npos && o.out.find("info_player_start") != std::string::npos) << o.out;
}

TEST(Files, WadsOfTheMapGiveSizesAndColours) {
    const Workplace w;
    write(w, "game/wads/Base.wad", wad2("WALL", 128, 32, 1));
    std::string palette = padded("", 768);
    palette[3] = palette[4] = palette[5] = static_cast<char>(255);
    const std::string map = w.write("m.map", world("\"wad\" \"C:\\quake\\base.wad;gone.wad\"\n" + box(0, 0, 0, 64, 64, 64)));
    const auto materials = [&](std::vector<std::string> more) {
        std::vector<std::string> words{"dump", "world", map};
        words.insert(words.end(), more.begin(), more.end());
        return w.run(words);
    };
    Outcome o = materials({});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_TRUE(says(o, "[wad-missing]")) << o.said;
    EXPECT_TRUE(says(o, "base.wad")) << o.said;
    o = materials({"--game-dir", w.path("game")});
    EXPECT_TRUE(says(o, "[wad-palette]")) << o.said;
    EXPECT_TRUE(says(o, "not found: gone.wad;")) << o.said;
    EXPECT_NE(o.out.find("128"), std::string::npos) << o.out;
    write(w, "game/GFX/palette.lmp", palette);
    o = materials({"--game-dir", w.path("game")});
    EXPECT_FALSE(says(o, "[wad-palette]")) << o.said;
    EXPECT_NE(o.out.find("[0.89999"), std::string::npos) << o.out; // white, as white as surfaces are
    o = materials({"--wad", w.path("none.wad")});
    EXPECT_EQ(o.code, 3) << o.said;
    o = materials({"--wad", w.write("bad.wad", "WAD3")});
    EXPECT_EQ(o.code, 3) << o.said;
    EXPECT_TRUE(says(o, "[texture-unreadable]")) << o.said;
}

TEST(Files, GlassAndGratesOfTexturesLetLightThrough) {
    const Workplace w;
    // VTF 7.2, RGBA, two by two: alpha 0, 64, 128, 255.
    std::string vtf = padded("VTF", 4) + little(7, 4) + little(2, 4) + little(80, 4) + little(2, 2) + little(2, 2) + little(0, 4) + little(1, 2);
    vtf = padded(vtf, 52) + little(0, 4) + little(1, 1) + little(0xFFFFFFFF, 4) + little(0, 2) + little(1, 2);
    vtf = padded(vtf, 80) + little(0x00FFFFFF, 4) + little(0x400000FF, 4) + little(0x80FFFFFF, 4) + little(0xFFFFFFFF, 4);
    write(w, "game/materials/a/pane.vtf", vtf);
    write(w, "game/materials/a/clear.vmt", "LightmappedGeneric { $basetexture a/pane $translucent 1 }");
    write(w, "game/materials/a/fence.vmt", "LightmappedGeneric { $basetexture a/pane $alphatest 1 $alphatestreference .4 }");
    write(w, "game/materials/a/glow.vmt", "LightmappedGeneric { $basetexture a/pane $additive 1 }");
    write(w, "game/materials/a/wall.vmt", "LightmappedGeneric { $basetexture a/pane }");
    std::string solids;
    for (const char* name : {"a/clear", "a/fence", "a/glow", "a/wall"}) {
        std::string text = solid(static_cast<int>(solids.size()));
        for (std::size_t at = 0; (at = text.find("\"wall\"", at)) != std::string::npos;) text.replace(at, 6, "\"" + std::string(name) + "\"");
        solids += text;
    }
    const std::string map = w.write("m.vmf", vmf(solids));
    const auto maps = [](const Outcome& o) { // materials with an opacity map
        std::size_t n = 0;
        for (std::size_t at = 0; (at = o.out.find("opacity_map [2,2]", at)) != std::string::npos; ++at) ++n;
        return n;
    };
    Outcome o = w.run({"dump", "world", map, "--game-dir", w.path("game")});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_EQ(maps(o), 2u) << o.out;
    // A picture beside a material file: a TGA of the same.
    std::string tga = padded(std::string("\0\0\2", 3), 12) + little(2, 2) + little(2, 2) + little(32, 1) + little(0x28, 1);
    tga += little(0x00FFFFFF, 4) + little(0x400000FF, 4) + little(0x80FFFFFF, 4) + little(0xFFFFFFFF, 4);
    w.write("holes.tga", tga);
    w.write("m.materials.json", R"({"materials": {"a/glow": {"translucent": true, "albedo_map": "holes.tga"}, "a/wall": {"opacity_map": "gone.png"}}})");
    o = w.run({"dump", "world", map, "--game-dir", w.path("game")});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_EQ(maps(o), 3u) << o.out;
    EXPECT_TRUE(says(o, "[texture-unreadable]") && says(o, "gone.png")) << o.said;
}

TEST(Files, MaterialsOfSourceSayWhatTheirSurfacesAre) {
    const Workplace w;
    const auto vtf = [](int width, int height, float grey) {
        std::string head = padded("VTF", 4) + little(7, 4) + little(2, 4) + little(80, 4) + little(static_cast<std::uint64_t>(width), 2) + little(static_cast<std::uint64_t>(height), 2) + padded("", 12);
        std::uint32_t bits = 0;
        std::memcpy(&bits, &grey, 4);
        return padded(head + little(bits, 4) + little(bits, 4) + little(bits, 4), 200);
    };
    write(w, "game/materials/Nature/Pond.vmt", "Water { $basetexture nature\\pond_surface %compilewater 1 }");
    write(w, "game/materials/nature/pond_surface.vtf", vtf(256, 1024, 0.25f));
    write(w, "game/materials/nature/fence.vmt", "patch { include \"materials/nature/base.vmt\" replace { $alphatest 1 } }");
    write(w, "game/materials/nature/base.vmt", "LightmappedGeneric { $basetexture nature/pond_surface $bumpmap nature/bump }");
    write(w, "game/materials/nature/broken.vmt", "}");
    std::string solids;
    for (const char* name : {"nature/pond", "NATURE/FENCE", "nature/broken"}) {
        std::string text = solid(static_cast<int>(solids.size()));
        for (std::size_t at = 0; (at = text.find("\"wall\"", at)) != std::string::npos;) text.replace(at, 6, "\"" + std::string(name) + "\"");
        solids += text;
    }
    const std::string map = w.write("m.vmf", vmf(solids));
    const Outcome m = w.run({"dump", "world", map, "--game-dir", w.path("game")});
    EXPECT_EQ(m.code, 0) << m.said;
    EXPECT_NE(m.out.find("1024"), std::string::npos) << m.out;
    EXPECT_NE(m.out.find("nature/bump.vtf"), std::string::npos) << m.out;
    EXPECT_NE(m.out.find("0.25"), std::string::npos) << m.out;
    EXPECT_TRUE(says(m, "broken.vmt:1: warning")) << m.said;
    const Outcome b = w.run({"dump", "brushes", map, "--game-dir", w.path("game")});
    EXPECT_NE(b.out.find("water"), std::string::npos) << b.out;
    EXPECT_NE(b.out.find("grate"), std::string::npos) << b.out;
}

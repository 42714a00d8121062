// verify, export, dump and info as a user runs them: on maps and on levels.
#include "formats/level/kiln_level.h"
#include "libs/image/image.h"
#include "tests/formats/gltf/reader.h"
#include "tests/support/program.h"
#include <map>
#include <memory>
#include <regex>
#include <set>

using namespace kiln;
using namespace kiln::test;

namespace {

std::string text_of(const std::string& path) {
    std::ifstream f(path, std::ios::binary);
    return std::string((std::istreambuf_iterator<char>(f)), {});
}
Bytes bytes_of(const std::string& path) {
    const std::string t = text_of(path);
    return Bytes(t.begin(), t.end());
}
// A room with a door that moves, a lamp and a glowing box.
std::string furnished() {
    return world(room(128, 96, 80) + box(20, 20, 0, 40, 40, 16, "glow")) + "{\n\"classname\" \"func_door\"\n\"targetname\" \"gate\"\n" + box(60, 40, 8, 64, 56, 60, "door") + "}\n" +
           entity("info_player_start", 100, 70, 24) + entity("light", 96, 64, 60, "\"light\" \"200\"\n");
}
// Two rooms with a door that parts them; what a level may hold in either: water, an occluder, a decal, a curve, a wedge.
std::string crowded() {
    std::string curve = "{\npatchDef2\n{\ncurve\n( 3 3 0 0 0 )\n(\n"; // flat but for its middle, 16 up
    for (int x = 0; x < 3; ++x) {
        curve += "( ";
        for (int y = 0; y < 3; ++y)
            curve += "( " + std::to_string(20 + 20 * x) + " " + std::to_string(20 + 20 * y) + (x == 1 && y == 1 ? " 56 " : " 40 ") + std::to_string(x * 0.5) + " " + std::to_string(y * 0.5) + " ) ";
        curve += ")\n";
    }
    curve += ")\n}\n}\n";
    const std::string wedge = "{\n( 150 20 0 ) ( 150 21 0 ) ( 150 20 1 ) wall 0 0 0 1 1\n( 150 20 0 ) ( 150 20 1 ) ( 151 20 0 ) wall 0 0 0 1 1\n( 180 40 30 ) ( 181 40 30 ) ( 180 40 31 ) wall 0 0 0 1 1\n"
                              "( 150 20 0 ) ( 151 20 0 ) ( 150 21 0 ) wall 0 0 0 1 1\n( 150 20 30 ) ( 150 21 30 ) ( 180 20 0 ) wall 0 0 0 1 1\n}\n";
    return world(room(256, 96, 80) + box(124, 0, 0, 132, 40, 80) + box(124, 56, 0, 132, 96, 80) + box(124, 40, 48, 132, 56, 80) + box(200, 0, 0, 256, 96, 24, "*water0") + curve + wedge) +
           "{\n\"classname\" \"func_areaportal\"\n" + box(126, 40, 0, 130, 56, 48) + "}\n{\n\"classname\" \"func_occluder\"\n" + box(60, 60, 20, 64, 90, 60) + "}\n" +
           entity("info_player_start", 32, 32, 24) + entity("light", 96, 64, 60, "\"light\" \"200\"\n") + entity("infodecal", 64, 1, 40, "\"texture\" \"spot\"\n");
}
std::string materials() { return "{\"materials\":{\"glow\":{\"emission\":[2,1,0.5],\"reflectance\":[0.25,0.5,0.75]}}}"; }
std::size_t lines(const std::string& text) { return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')); }

} // namespace

TEST(Inspect, VerifyPassesAMapAndTheLevelMadeOfIt) {
    const Workplace w;
    const std::string map = w.write("room.map", furnished());
    Outcome o = w.run({"verify", map, "--until", "visibility", "-q"});
    EXPECT_EQ(o.code, 0) << o.said << o.out;
    EXPECT_NE(o.out.find("points-contents"), std::string::npos);
    ASSERT_EQ(w.run({"build", map, "--draft", "-q", "-o", w.path("room.kiln")}).code, 0);
    o = w.run({"verify", w.path("room.kiln"), "--json"});
    EXPECT_EQ(o.code, 0) << o.said << o.out;
    const auto j = nlohmann::json::parse(o.out);
    EXPECT_EQ(j["failures"], 0);
    EXPECT_GT(j["checks"].size(), 10u);
}

TEST(Inspect, EveryCheckIsExplained) {
    const Workplace w;
    const std::string map = w.write("room.map", furnished());
    ASSERT_EQ(w.run({"build", map, "--draft", "-q", "-o", w.path("room.kiln")}).code, 0);
    const std::string known = "\n" + w.run({"explain"}).out;
    std::size_t n = 0;
    for (const auto& words : std::vector<std::vector<std::string>>{{"verify", map, "--until", "visibility", "--json", "-q"}, {"verify", w.path("room.kiln"), "--json"}}) {
        const auto j = nlohmann::json::parse(w.run(words).out);
        n += j["checks"].size();
        for (const auto& c : j["checks"]) EXPECT_NE(known.find("\n" + c["code"].get<std::string>() + ": verify: "), std::string::npos) << c["code"];
    }
    EXPECT_GT(n, 55u);
}

TEST(Inspect, VerifyNamesWhatIsWrongWithALevelAndExitsWith6) {
    const Workplace w;
    ASSERT_EQ(w.run({"build", w.write("room.map", furnished()), "--draft", "-q", "-o", w.path("room.kiln")}).code, 0);
    std::string level = text_of(w.path("room.kiln"));
    for (std::size_t i = level.size() - 80; i < level.size(); ++i) level[i] = static_cast<char>(level[i] ^ 0x40); // more than can lie between lumps
    const Outcome o = w.run({"verify", w.write("bad.kiln", level)});
    EXPECT_EQ(o.code, 6) << o.said;
    EXPECT_TRUE(std::regex_search(o.said, std::regex("bad\\.kiln: error: lump [A-Z]{4} .*\\[level-lumps\\]"))) << o.said;
    EXPECT_EQ(w.run({"verify", w.path("none.map")}).code, 3);
    EXPECT_EQ(w.run({"verify", w.write("empty.map", "")}).code, 3);
    // As JSON, too, for those who only read standard output.
    for (const std::string& file : {w.path("none.map"), w.path("empty.map"), w.write("torn.map", "{\n\"classname\" \"worldspawn\"\n{\n( 0 0\n")}) {
        const Outcome faulty = w.run({"verify", file, "--json"});
        EXPECT_EQ(faulty.code, 3);
        const auto j = nlohmann::json::parse(faulty.out);
        EXPECT_EQ(j["exit"], 3);
        ASSERT_FALSE(j["diagnostics"].empty()) << file;
        EXPECT_EQ(j["diagnostics"].back()["severity"], "error");
        EXPECT_TRUE(j["diagnostics"].back()["file"].get<std::string>().ends_with(file)) << faulty.out;
    }
}

TEST(Inspect, ALeakIsNoFailedCheck) {
    const Workplace w;
    std::string brushes = room(128, 96, 80);
    brushes = brushes.substr(brushes.find("}\n") + 2); // no floor
    const std::string map = w.write("leak.map", world(brushes) + entity("info_player_start", 32, 32, 24));
    const Outcome o = w.run({"verify", map, "--json"});
    EXPECT_EQ(o.code, 4) << o.said;
    const auto j = nlohmann::json::parse(o.out);
    EXPECT_EQ(j["failures"], 0);
    EXPECT_EQ(j["leak"], true);
    EXPECT_EQ(w.run({"verify", map, "--allow-leaks"}).code, 0);
    EXPECT_NE(w.run({"dump", "leak", map, "-q"}).out.find("hole ["), std::string::npos);
}

TEST(Inspect, GltfOfAMapAndOfItsLevel) {
    const Workplace w;
    const std::string map = w.write("room.map", furnished()), more = w.write("m.json", materials());
    ASSERT_EQ(w.run({"build", map, "--materials", more, "--draft", "-q", "-o", w.path("room.kiln")}).code, 0);
    Outcome o = w.run({"export", map, "--materials", more, "-q", "-o", w.path("map.glb")});
    ASSERT_EQ(o.code, 0) << o.said;
    o = w.run({"export", w.path("room.kiln"), "-o", w.path("level.gltf")});
    ASSERT_EQ(o.code, 0) << o.said;
    const GltfRead of_map = read_glb(bytes_of(w.path("map.glb")));
    const GltfRead of_level{nlohmann::json::parse(text_of(w.path("level.gltf"))), bytes_of(w.path("level.bin"))};
    for (const GltfRead* r : {&of_map, &of_level}) {
        r->check();
        // Metres, y up: the room is 128 x 96 x 80 units at 1/40 m.
        const auto& root = r->json["nodes"][r->json["scenes"][0]["nodes"][0].get<std::size_t>()];
        EXPECT_EQ(root["scale"][0], 0.025);
        EXPECT_NEAR(root["rotation"][0].get<double>(), -std::sqrt(0.5), 1e-12);
        EXPECT_NEAR(root["rotation"][3].get<double>(), std::sqrt(0.5), 1e-12);
        std::map<std::string, nlohmann::json> nodes;
        for (const auto& n : r->json["nodes"]) nodes[n["name"].get<std::string>()] = n;
        ASSERT_TRUE(nodes.contains("worldspawn") && nodes.contains("func_door gate") && nodes.contains("info_player_start") && nodes.contains("light_0"));
        EXPECT_EQ(nodes["info_player_start"]["translation"], (nlohmann::json{100.0, 70.0, 24.0}));
        EXPECT_EQ(nodes["func_door gate"]["extras"]["classname"], "func_door");
        EXPECT_EQ(nodes["func_door gate"]["extras"]["keys"][1], (nlohmann::json{"targetname", "gate"}));
        // The area drawn is that of the room's inside with the box on its floor, by hand; triangles face the air.
        double area = 0;
        std::array<double, 3> lo{1e9, 1e9, 1e9}, hi{-1e9, -1e9, -1e9};
        for (const auto& p : r->json["meshes"][nodes["worldspawn"]["mesh"].get<std::size_t>()]["primitives"]) {
            const auto x = r->floats(p["attributes"]["POSITION"]), n = r->floats(p["attributes"]["NORMAL"]), t = r->floats(p["attributes"]["TANGENT"]);
            const auto index = r->indices(p["indices"]);
            for (std::size_t k = 0; k < index.size(); k += 3) {
                const auto at = [&](std::size_t c) { return Vec3{x[index[k + c]][0], x[index[k + c]][1], x[index[k + c]][2]}; };
                const Vec3 twice = cross(at(1) - at(0), at(2) - at(0));
                const auto& m = n[index[k]];
                EXPECT_NEAR(dot(twice, Vec3{m[0], m[1], m[2]}), length(twice), 1e-3);
                EXPECT_NEAR(dot(Vec3{t[index[k]][0], t[index[k]][1], t[index[k]][2]}, Vec3{m[0], m[1], m[2]}), 0, 1e-5);
                area += length(twice) / 2;
                for (std::size_t c = 0; c < 3; ++c)
                    for (std::size_t a = 0; a < 3; ++a) lo[a] = std::min(lo[a], at(c)[a]), hi[a] = std::max(hi[a], at(c)[a]);
            }
        }
        EXPECT_NEAR(area, 2.0 * (128 * 96 + 128 * 80 + 96 * 80) + 4 * 20 * 16, 1e-3);
        EXPECT_EQ(lo, (std::array<double, 3>{0, 0, 0}));
        EXPECT_EQ(hi, (std::array<double, 3>{128, 96, 80}));
        bool glows = false;
        for (const auto& m : r->json["materials"])
            if (m["name"] == "glow") {
                glows = true;
                EXPECT_NEAR(m["pbrMetallicRoughness"]["baseColorFactor"][2].get<double>(), 0.75, 1e-3);
                EXPECT_NEAR(m["emissiveFactor"][1].get<double>(), 0.5, 1e-3);
                EXPECT_NEAR(m["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"].get<double>(), 2, 1e-3);
            }
        EXPECT_TRUE(glows);
    }
    // Of a level the lightmap pages stand beside it, and every lit corner lies within its page.
    const auto& pages = of_level.json["nodes"][0]["extras"]["kiln"]["lightmaps"];
    ASSERT_GE(pages.size(), 1u);
    for (const auto& p : pages) EXPECT_TRUE(w.has(p["file"].get<std::string>()));
    std::size_t lit = 0;
    for (const auto& m : of_level.json["meshes"])
        for (const auto& p : m["primitives"]) {
            if (!p["attributes"].contains("TEXCOORD_1")) continue;
            EXPECT_LT(p["extras"]["lightmap_page"].get<std::size_t>(), pages.size());
            const auto coordinates = of_level.floats(p["attributes"]["TEXCOORD_1"]);
            lit += coordinates.size();
            for (const auto& uv : coordinates) EXPECT_TRUE(uv[0] > 0 && uv[0] < 1 && uv[1] > 0 && uv[1] < 1);
        }
    EXPECT_GE(lit, 24u);
}

// The lightmap pages at the second texture coordinates show what the loader evaluates there.
TEST(Inspect, GltfLightmapsShowTheLightOfTheLevel) {
    const Workplace w;
    ASSERT_EQ(w.run({"build", w.write("room.map", furnished()), "--materials", w.write("m.json", materials()), "--draft", "-q", "-o", w.path("room.kiln")}).code, 0);
    ASSERT_EQ(w.run({"export", w.path("room.kiln"), "-o", w.path("room.glb")}).code, 0);
    const GltfRead r = read_glb(bytes_of(w.path("room.glb")));
    const Bytes bytes = bytes_of(w.path("room.kiln"));
    kiln_level* raw = nullptr;
    ASSERT_EQ(kiln_level_open_memory(bytes.data(), bytes.size(), &raw), KILN_OK);
    const std::unique_ptr<kiln_level, decltype(&kiln_level_close)> level(raw, kiln_level_close);
    // Faces by the middle of their triangles.
    std::map<std::array<long, 3>, std::uint32_t> face_at;
    const auto key = [](double x, double y, double z) { return std::array<long, 3>{std::lround(x * 16), std::lround(y * 16), std::lround(z * 16)}; };
    std::size_t faces = 0;
    const kiln_face* face = kiln_level_faces(raw, &faces);
    const float* x = kiln_level_positions(raw, nullptr);
    const std::uint32_t* t = kiln_level_triangles(raw, nullptr);
    for (std::uint32_t f = 0; f < faces; ++f)
        for (std::size_t k = face[f].first_triangle; k < std::size_t{face[f].first_triangle} + face[f].triangle_count; ++k) {
            double m[3] = {};
            for (std::size_t c = 0; c < 9; ++c) m[c % 3] += x[3 * t[3 * k + c / 3] + c % 3] / 3.0;
            face_at[key(m[0], m[1], m[2])] = f;
        }
    std::size_t compared = 0;
    for (const auto& mesh : r.json["meshes"]) {
        if (mesh["name"] != "worldspawn") continue; // others are relative to their origin
        for (const auto& p : mesh["primitives"]) {
            if (!p["attributes"].contains("TEXCOORD_1")) continue;
            const auto& page = r.json["nodes"][0]["extras"]["kiln"]["lightmaps"][p["extras"]["lightmap_page"].get<std::size_t>()];
            const auto image = read_exr(w.path(page["file"].get<std::string>()));
            ASSERT_TRUE(image);
            ASSERT_EQ(image->width, page["width"].get<int>());
            const auto position = r.floats(p["attributes"]["POSITION"]), uv = r.floats(p["attributes"]["TEXCOORD_1"]);
            const auto index = r.indices(p["indices"]);
            for (std::size_t k = 0; k < index.size(); k += 3) {
                double m[3] = {}, at[2] = {};
                for (std::size_t c = 0; c < 3; ++c) {
                    for (std::size_t a = 0; a < 3; ++a) m[a] += position[index[k + c]][a] / 3.0;
                    for (std::size_t a = 0; a < 2; ++a) at[a] += uv[index[k + c]][a] / 3.0;
                }
                ASSERT_TRUE(face_at.contains(key(m[0], m[1], m[2])));
                float expected[3];
                ASSERT_EQ(kiln_level_eval_flat(raw, face_at[key(m[0], m[1], m[2])], m, expected), KILN_OK);
                const double s = at[0] * image->width - 0.5, v = at[1] * image->height - 0.5;
                const int i = static_cast<int>(std::floor(s)), j = static_cast<int>(std::floor(v));
                // Held within the page, as a GPU does: beside a chart of one texel in its last row there is nothing.
                const auto texel = [&](int column, int row, int c) { return image->at(std::clamp(column, 0, image->width - 1), std::clamp(row, 0, image->height - 1), c); };
                const auto mix = [&](int c) {
                    const double a = s - i, b = v - j;
                    return (texel(i, j, c) * (1 - a) + texel(i + 1, j, c) * a) * (1 - b) + (texel(i, j + 1, c) * (1 - a) + texel(i + 1, j + 1, c) * a) * b;
                };
                for (int c = 0; c < 3; ++c) EXPECT_NEAR(mix(c), expected[c], 0.002 * expected[c] + 1e-5);
                ++compared;
            }
        }
    }
    EXPECT_GE(compared, 20u);
}

TEST(Inspect, ObjOfEveryStage) {
    const Workplace w;
    const std::string map = w.write("room.map", furnished());
    ASSERT_EQ(w.run({"build", map, "--draft", "-q", "-o", w.path("room.kiln")}).code, 0);
    for (const char* stage : {"brushes", "fragments", "leaves", "portals", "visible", "gaps", "overlays", "faces", "charts"}) {
        const Outcome o = w.run({"export", map, "--stage", stage, "-q", "-o", w.path("x.obj")});
        ASSERT_EQ(o.code, 0) << stage << o.said;
        EXPECT_TRUE(w.has("x.mtl"));
        std::istringstream in(text_of(w.path("x.obj")));
        std::size_t vertices = 0, faces = 0;
        for (std::string line; std::getline(in, line);) {
            if (line.starts_with("v ")) ++vertices;
            if (!line.starts_with("f ")) continue;
            ++faces;
            std::istringstream words(line.substr(2));
            std::size_t corners = 0;
            for (std::string c; words >> c; ++corners) EXPECT_TRUE(std::stoul(c) >= 1 && std::stoul(c) <= vertices) << line;
            EXPECT_GE(corners, 3u);
        }
        if (std::string(stage) == "brushes") {
            EXPECT_EQ(faces, 8u * 6); // six walls, the glowing box and the door
        }
        const bool none = std::set<std::string>{"gaps", "overlays"}.contains(stage); // a sealed room without pictures
        EXPECT_TRUE(std::string(stage) == "portals" || (faces > 5) == !none) << stage;
    }
    for (const char* stage : {"portals", "overlays", "faces", "charts"}) EXPECT_EQ(w.run({"export", w.path("room.kiln"), "--stage", stage, "-o", w.path("y.obj")}).code, 0) << stage;
    // Curves are among what is drawn, in the middle as high as they will be; decals where they lie.
    const std::string full = w.write("crowded.map", crowded());
    for (const auto& [flatness, cells] : {std::pair{"0.5", 64u}, std::pair{"8", 4u}}) {
        ASSERT_EQ(w.run({"export", full, "--stage", "brushes", "--curve-flatness", flatness, "-q", "-o", w.path("c.obj")}).code, 0);
        std::istringstream drawn(text_of(w.path("c.obj")));
        bool curve = false;
        std::size_t quads = 0, middle = 0;
        for (std::string line; std::getline(drawn, line);) {
            if (line.starts_with("g ")) curve = line == "g patch_10";
            quads += curve && line.starts_with("f ");
            middle += line == "v 40 40 44";
        }
        EXPECT_EQ(quads, cells) << flatness;
        EXPECT_GE(middle, 1u);
    }
    ASSERT_EQ(w.run({"export", full, "--stage", "overlays", "-q", "-o", w.path("c.obj")}).code, 0);
    std::istringstream lie(text_of(w.path("c.obj")));
    std::size_t corners = 0;
    for (std::string line; std::getline(lie, line);)
        if (line.starts_with("v ")) {
            double x = 0, y = 1, z = 0;
            ASSERT_EQ(std::sscanf(line.c_str(), "v %lf %lf %lf", &x, &y, &z), 3);
            EXPECT_EQ(y, 0); // on the wall
            ++corners;
        }
    EXPECT_GE(corners, 4u);
    Outcome o = w.run({"export", w.path("room.kiln"), "--stage", "brushes", "-o", w.path("y.obj")});
    EXPECT_EQ(o.code, 2) << o.said;
    EXPECT_EQ(w.run({"export", map, "-o", w.path("x.fbx")}).code, 2);
    EXPECT_EQ(w.run({"export", map, "-o", w.path("no/folder/x.obj"), "-q"}).code, 8);
}

// Of Quake's own sky and Source's in one map both are kept, and stand together.
TEST(Inspect, GltfKeepsEverySky) {
    const Workplace w;
    const std::string text = furnished() + entity("light_environment", 64, 48, 70, "\"_light\" \"255 255 255 100\"\n\"_ambient\" \"255 255 255 50\"\n");
    const auto sky_of = [&](const std::string& map) {
        const Outcome o = w.run({"export", w.write("sky.map", map), "-q", "-o", w.path("sky.glb")});
        EXPECT_EQ(o.code, 0) << o.said;
        return read_glb(bytes_of(w.path("sky.glb"))).json["nodes"][0]["extras"]["kiln"];
    };
    const auto one = sky_of(text);
    ASSERT_EQ(one["sky_lights"].size(), 1u);
    EXPECT_EQ(one["sky"], one["sky_lights"][0]["intensity"]);
    std::string with_both = text;
    with_both.replace(with_both.find("\"worldspawn\"\n"), 13, "\"worldspawn\"\n\"_sunlight2\" \"100\"\n");
    const auto both = sky_of(with_both);
    ASSERT_EQ(both["sky_lights"].size(), 2u);
    for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(both["sky"][c].get<double>(), one["sky"][c].get<double>() + 100 / 255.0 / 3.14159265358979, 1e-5);
        EXPECT_NEAR(both["sky"][c].get<double>(), both["sky_lights"][0]["intensity"][c].get<double>() + both["sky_lights"][1]["intensity"][c].get<double>(), 1e-6);
    }
    EXPECT_FALSE(sky_of(furnished()).contains("sky"));
}

// All that --help lists can be dumped, twice alike.
TEST(Inspect, EveryArtefactDumpsTheSameTwice) {
    const Workplace w;
    const std::string map = w.write("room.map", furnished());
    ASSERT_EQ(w.run({"build", map, "--draft", "-q", "-o", w.path("room.kiln")}).code, 0);
    const std::string help = w.run({"dump", "--help"}).out;
    std::size_t n = 0;
    for (const auto& [line, file] : std::vector<std::pair<std::string, std::string>>{{"of a map: ", map}, {"of a level: ", w.path("room.kiln")}}) {
        const std::size_t at = help.find(line);
        ASSERT_NE(at, std::string::npos) << help;
        std::string names = help.substr(at + line.size(), help.find('\n', at) - at - line.size());
        std::ranges::replace(names, ',', ' ');
        std::istringstream words(names);
        for (std::string name; words >> name; ++n) {
            const Outcome a = w.run({"dump", name, file, "--draft", "-q", "--threads", "1"}), b = w.run({"dump", name, file, "--draft", "-q", "--threads", "2"});
            EXPECT_EQ(a.code, 0) << name << a.said;
            EXPECT_EQ(a.out, b.out) << name;
            const Outcome j = w.run({"dump", name, file, "--draft", "-q", "--json"});
            EXPECT_EQ(nlohmann::json::parse(j.out).size(), lines(a.out)) << name;
        }
    }
    EXPECT_GT(n, 40u);
    EXPECT_EQ(w.run({"dump", "pages", map}).code, 2); // of a level only
    EXPECT_EQ(w.run({"dump", "fragments", w.path("room.kiln")}).code, 2);
    EXPECT_EQ(w.run({"dump", "no-such-thing", map}).code, 2);
}

TEST(Inspect, DumpsOfALevelShowAllThatItHolds) {
    const Workplace w;
    const std::string map = w.write("m.map", crowded());
    const Outcome built = w.run({"build", map, "--draft", "-q", "-o", w.path("m.kiln")});
    ASSERT_EQ(built.code, 0) << built.said;
    const auto rows = [&](const char* artefact, const char* level = "m.kiln") {
        const Outcome o = w.run({"dump", artefact, w.path(level), "--json", "-q"});
        EXPECT_EQ(o.code, 0) << o.said;
        return nlohmann::json::parse(o.out);
    };
    using J = nlohmann::json;
    J j = rows("bevels"); // the wedge alone is no box: without them a box would stop before its sharp edges
    ASSERT_EQ(j.size(), 2u) << j;
    EXPECT_EQ(j[0]["normal"], (J{1.0, 0.0, 0.0}));
    EXPECT_EQ(j[0]["distance"], 180.0);
    EXPECT_EQ(j[1]["normal"], (J{0.0, 0.0, 1.0}));
    EXPECT_EQ(j[1]["distance"], 30.0);
    j = rows("areas");
    std::map<int, J> areas;
    for (const J& a : j) areas[a["area"]] = a["area_portals_to"];
    EXPECT_EQ(areas[1], (J::array({{{"area", 2}, {"area_portal", 0}}})));
    EXPECT_EQ(areas[2], (J::array({{{"area", 1}, {"area_portal", 0}}})));
    j = rows("area_portals");
    ASSERT_EQ(j.size(), 1u);
    EXPECT_EQ(j[0]["areas"], (J{1, 2}));
    EXPECT_EQ(j[0]["winding"].size(), 4u);
    for (const J& p : j[0]["winding"]) EXPECT_EQ(p[0], 128.0); // midway in the door
    EXPECT_EQ(j[0]["entity"], 1);
    EXPECT_EQ(j[0]["brush"], 0); // of that entity, as the map has it
    EXPECT_GT(j[0]["line"], 10);
    j = rows("waters");
    ASSERT_EQ(j.size(), 1u);
    EXPECT_EQ(j[0]["contents"], "water");
    EXPECT_EQ(j[0]["surface_z"], 24.0);
    EXPECT_EQ(j[0]["min_z"], 0.0);
    EXPECT_EQ(j[0]["material"], "*water0");
    EXPECT_GE(j[0]["leaves"], 1);
    j = rows("occluders");
    ASSERT_EQ(j.size(), 1u);
    EXPECT_EQ(j[0]["entity"], 2);
    EXPECT_EQ(j[0]["polygons"].size(), 6u);
    j = rows("overlays");
    ASSERT_EQ(j.size(), 1u);
    EXPECT_EQ(j[0]["kind"], "decal");
    EXPECT_EQ(j[0]["material"], "spot");
    EXPECT_EQ(j[0]["entity"], 5);
    const std::size_t faces = rows("faces").size();
    ASSERT_FALSE(j[0]["fragments"].empty());
    for (const J& f : j[0]["fragments"]) {
        EXPECT_LT(f["face"], faces);
        for (const J& p : f["points"]) EXPECT_EQ(p["position"][1], 0.0); // on the wall
    }
    j = rows("patch_grids");
    ASSERT_EQ(j.size(), 1u);
    EXPECT_EQ(j[0]["material"], "curve");
    EXPECT_EQ(j[0]["entity"], 0);
    const std::size_t columns = j[0]["columns"], grid_rows = j[0]["rows"];
    ASSERT_EQ(j[0]["vertices"].size(), columns * grid_rows);
    EXPECT_EQ(j[0]["vertices"][0], (J{20.0, 20.0, 40.0, 0.0, 0.0}));
    EXPECT_EQ(j[0]["vertices"].back(), (J{60.0, 60.0, 40.0, 1.0, 1.0}));
    EXPECT_EQ(j[0]["vertices"][columns * grid_rows / 2], (J{40.0, 40.0, 44.0, 0.5, 0.5})); // a quarter of 16 up
    // A VMF with displacements and an overlay on the floor; stripped, nothing says where it comes from.
    std::string terrain = text_of(std::string(KILN_SOURCE_DIR) + "/maps/terrain/terrain.vmf");
    terrain += "entity\n{\n\"id\" \"900\"\n\"classname\" \"info_overlay\"\n\"material\" \"crack\"\n\"sides\" \"2\"\n\"BasisOrigin\" \"8 8 0\"\n\"BasisU\" \"1 0 0\"\n\"BasisV\" \"0 1 0\"\n"
               "\"BasisNormal\" \"0 0 1\"\n\"uv0\" \"-16 -8 0\"\n\"uv1\" \"-16 8 0\"\n\"uv2\" \"16 8 0\"\n\"uv3\" \"16 -8 0\"\n}\n";
    const std::string vmf = w.write("t.vmf", terrain);
    ASSERT_EQ(w.run({"build", vmf, "--draft", "-q", "-o", w.path("t.kiln")}).code, 0);
    ASSERT_EQ(w.run({"build", vmf, "--draft", "-q", "--strip", "-o", w.path("s.kiln")}).code, 0);
    j = rows("overlays", "t.kiln");
    ASSERT_EQ(j.size(), 1u);
    EXPECT_EQ(j[0]["kind"], "overlay");
    EXPECT_EQ(j[0]["entity"], 900); // its id in the map
    j = rows("displacements", "t.kiln");
    ASSERT_EQ(j.size(), 5u);
    const int powers[] = {4, 2, 3, 3, 2};
    for (std::size_t i = 0; i < 5; ++i) {
        EXPECT_EQ(j[i]["power"], powers[i]);
        const std::size_t side = (std::size_t{1} << powers[i]) + 1;
        EXPECT_EQ(j[i]["vertices"].size(), side * side);
        EXPECT_GT(j[i]["line"], 0);
        EXPECT_GT(j[i]["side"], 0);
    }
    j = rows("displacements", "s.kiln");
    ASSERT_EQ(j.size(), 5u);
    EXPECT_EQ(j[0]["side"], -1);
}

// An unrelated brush shifts every number; --for-diff shows that it changed nothing but what it is.
TEST(Inspect, DumpsForDiffShowAChangeWhereItIs) {
    const Workplace w;
    const std::string tail = entity("info_player_start", 32, 32, 24);
    const std::string before = w.write("a.map", world(room(256, 96, 80)) + tail);
    // In front in the file, so that all ids behind it shift; on the floor far from the other walls' middle.
    const std::string after = w.write("b.map", world(room(256, 96, 80) + box(200, 40, 20, 208, 48, 28)) + tail);
    const auto rows = [&](const std::string& map, const char* artefact) {
        std::multiset<std::string> set;
        std::istringstream in(w.run({"dump", artefact, map, "-q", "--for-diff"}).out);
        for (std::string line; std::getline(in, line);) set.insert(line);
        return set;
    };
    for (const char* artefact : {"faces", "brushes", "sides", "fragments"}) {
        const auto a = rows(before, artefact), b = rows(after, artefact);
        std::size_t lost = 0;
        for (const std::string& line : a) lost += !b.contains(line);
        EXPECT_EQ(lost, 0u) << artefact; // a floating box takes nothing away
        EXPECT_EQ(b.size() - a.size(), artefact == std::string("brushes") ? 1u : 6u) << artefact;
    }
}

TEST(Inspect, FiltersKeepRows) {
    const Workplace w;
    const std::string map = w.write("room.map", furnished());
    const Outcome all = w.run({"dump", "brushes", map, "-q"}), one = w.run({"dump", "brushes", map, "-q", "--filter", "brush=6"}),
                  solid = w.run({"dump", "brushes", map, "-q", "--filter", "contents=solid", "--filter", "entity=0"});
    EXPECT_EQ(lines(all.out), 8u);
    EXPECT_EQ(lines(one.out), 1u);
    EXPECT_EQ(lines(solid.out), 7u);
    EXPECT_EQ(w.run({"dump", "brushes", map, "--filter", "nonsense"}).code, 2);
}

// What help names as a map is one to each of them.
TEST(Inspect, AManifestIsAMapToEveryCommand) {
    const Workplace w;
    const std::string crate = box(40, 40, 0, 50, 50, 10);
    w.write("a.map", furnished()), w.write("b.map", world(crate));
    const std::string all = w.write("all.vmm", "\"Maps\"\n{\n\"VMF\"\n{\n\"File\" \"a.map\"\n}\n\"VMF\"\n{\n\"File\" \"b.map\"\n}\n}\n");
    Outcome o = w.run({"info", all, "--json"});
    ASSERT_EQ(o.code, 0) << o.said;
    EXPECT_EQ(nlohmann::json::parse(o.out)["counts"]["brushes"], 9);
    o = w.run({"dump", "brushes", all, "-q"});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_EQ(lines(o.out), 9u);
    o = w.run({"verify", all, "--until", "bsp", "-q"});
    EXPECT_EQ(o.code, 0) << o.said << o.out;
    o = w.run({"export", all, "-q", "-o", w.path("all.obj")});
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_TRUE(w.has("all.obj"));
    for (const char* command : {"info", "dump", "verify", "export", "build"}) EXPECT_NE(w.run({command, "--help"}).out.find(".vmm"), std::string::npos) << command;
}

TEST(Inspect, InfoOfALevelCountsWhatTheGameDoesWithSpace) {
    const Workplace w;
    w.write("prefab.map", world(box(0, 0, 0, 6, 6, 6)));
    const std::string map = w.write("room.map", crowded() + entity("misc_external_map", 30, 80, 0, "\"_external_map\" \"prefab.map\"\n\"_external_map_classname\" \"func_detail\"\n"));
    ASSERT_EQ(w.run({"build", map, "--draft", "-q", "-o", w.path("room.kiln")}).code, 0);
    const Outcome o = w.run({"info", w.path("room.kiln"), "--json"});
    ASSERT_EQ(o.code, 0) << o.said;
    const auto counts = nlohmann::json::parse(o.out)["counts"];
    for (const auto& [name, count] : std::map<std::string, int>{{"areas", 2}, {"area_portals", 1}, {"waters", 1}, {"occluders", 1}, {"overlays", 1}, {"displacements", 0}, {"curved_patches", 1}, {"included_files", 1}})
        EXPECT_EQ(counts.value(name, -1), count) << name;
    EXPECT_TRUE(std::regex_search(w.run({"info", w.path("room.kiln")}).out, std::regex("area_portals +1\n")));
}

TEST(Inspect, InfoOfAMapTakesItsCordon) {
    const Workplace w;
    const std::string vmf = text_of(std::string(KILN_SOURCE_DIR) + "/maps/terrain/terrain.vmf") +
                            "cordon\n{\n\"mins\" \"(-64 -64 -64)\"\n\"maxs\" \"(64 64 64)\"\n\"active\" \"1\"\n}\n";
    const std::string map = w.write("c.vmf", vmf);
    const auto brushes = [&](std::vector<std::string> more) {
        more.insert(more.begin(), {"info", map, "--json"});
        const Outcome o = w.run(more);
        EXPECT_EQ(o.code, 0) << o.said;
        return nlohmann::json::parse(o.out)["diagnostics"].dump();
    };
    EXPECT_EQ(brushes({}).find("note cordon"), std::string::npos);
    EXPECT_NE(brushes({"--cordon"}).find("cordon"), std::string::npos);
}

TEST(Inspect, InfoOfAMapCounts) {
    const Workplace w;
    const Outcome o = w.run({"info", w.write("room.map", furnished()), "--json"});
    ASSERT_EQ(o.code, 0) << o.said;
    const auto j = nlohmann::json::parse(o.out);
    EXPECT_EQ(j["format"], "quake standard");
    EXPECT_EQ(j["counts"]["brushes"], 8);
    EXPECT_EQ(j["counts"]["sides"], 48);
    EXPECT_EQ(j["counts"]["brush_models"], 1);
    EXPECT_EQ(j["brushes"]["solid"], 8);
    EXPECT_EQ(j["entities"]["light"], 1);
    EXPECT_EQ(j["geometry"]["bounds"], (nlohmann::json{{-16.0, -16.0, -16.0}, {144.0, 112.0, 96.0}}));
    EXPECT_EQ(j["geometry"]["off_grid_sides"], 0);
    EXPECT_EQ(w.run({"info", w.write("empty.map", "")}).code, 3);
    EXPECT_NE(w.run({"info", w.path("room.map")}).out.find("func_door"), std::string::npos);
}

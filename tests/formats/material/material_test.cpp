#include "formats/material/material.h"
#include "formats/material/rules.h"
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <iterator>
#include <random>

namespace kiln {
namespace {

std::size_t count(const Context& c, const std::string& code) {
    return static_cast<std::size_t>(std::ranges::count(c.diagnostics(), code, &Diagnostic::code));
}
MaterialDatabase database(const std::string& materials, Context& c) {
    MaterialDatabase db;
    const Result<bool> r = db.add_json("{\"materials\": {" + materials + "}}", "dir/m.json", c);
    EXPECT_TRUE(r) << (r ? "" : to_text(r.fault().diagnostic));
    return db;
}

TEST(Base64, ThereAndBack) {
    Bytes bytes;
    for (int n = 0; n < 70; ++n) {
        const auto back = bytes_of_base64(base64(bytes));
        ASSERT_TRUE(back) << n;
        EXPECT_EQ(*back, bytes);
        bytes.push_back(static_cast<std::uint8_t>(n * 37));
    }
    EXPECT_EQ(base64({'f', 'o', 'o', 'b'}), "Zm9vYg==");
    for (const char* bad : {"A", "AB", "ABC", "A===", "AB=C", "AB!C", "====", "ABCDE"}) EXPECT_FALSE(bytes_of_base64(bad)) << bad;
}

TEST(Opacity, MapsThresholdsAndTints) {
    Context c;
    MaterialDatabase db = database(R"(
        "glass": {"alpha": 0.5, "tint": [1, 0.5, 0.25], "opacity_map": {"size": [2, 1], "opacity": "AP8=", "tint": "AAECAwQF"}},
        "grate": {"alpha_test": 0.75, "opacity_map": {"size": [4, 1], "opacity": "AMC//w==", "tint": "AAAAAAAAAAAAAAAA"}},
        "leaf": {"alpha_tested": true, "opacity_map": {"size": [2, 1], "opacity": "f4A="}},
        "wall": {"opacity_map": {"size": [2, 1], "opacity": "AP8="}},
        "named": {"translucent": true, "opacity_map": "some.png"}
    )", c);
    EXPECT_TRUE(c.diagnostics().empty());
    const Material glass = db.find("glass", c), grate = db.find("grate", c), leaf = db.find("leaf", c);
    EXPECT_TRUE(glass.alpha_stated && glass.tint == (Rgb{1, 0.5f, 0.25f}) && (glass.flags & kTranslucent));
    EXPECT_EQ(glass.opacity_map.opacity, (Bytes{0, 255}));
    EXPECT_EQ(glass.opacity_map.tint, (Bytes{0, 1, 2, 3, 4, 5}));
    EXPECT_TRUE((grate.flags & kAlphaTested) && !grate.alpha_stated);
    EXPECT_EQ(grate.opacity_map.opacity, (Bytes{0, 255, 0, 255})); // 192 is there, 191 is not
    EXPECT_TRUE(grate.opacity_map.tint.empty());
    EXPECT_EQ(leaf.opacity_map.opacity, (Bytes{0, 255}));
    EXPECT_TRUE(db.find("wall", c).opacity_map.empty()); // gloss, for all that is known
    EXPECT_TRUE(db.find("named", c).opacity_map.empty());
    EXPECT_EQ(from_bytes<Material>(to_bytes(glass)).opacity_map, glass.opacity_map);
    // What is wrong is told and left out.
    for (const char* bad : {"3", "{}", R"({"size": [2, 1]})", R"({"size": [2, 1], "opacity": "AA=="})", R"({"size": [0, 1], "opacity": ""})", R"({"size": [2, 1], "opacity": "????"})",
                            R"({"size": [99999, 99999], "opacity": "AP8="})", R"({"size": [2, 1], "opacity": "AP8=", "tint": "AP8="})", R"({"size": [2.5, 1], "opacity": "AP8="})"}) {
        Context told;
        MaterialDatabase other = database(std::string(R"("glass": {"alpha": 0.5, "opacity_map": )") + bad + "}", told);
        EXPECT_TRUE(other.find("glass", told).opacity_map.empty()) << bad;
        EXPECT_EQ(count(told, "material-value-invalid"), 1u) << bad;
    }
}

TEST(Glob, Matches) {
    const struct {
        const char *pattern, *text;
        bool match;
    } cases[] = {
        {"tech*", "tech01_2", true},  {"tech*", "atech", false},
        {"*water*", "*water0", true}, {"*", "", true},
        {"a*b*c", "axxbyyc", true},   {"a*b*c", "axxbyy", false},
        {"a?c", "abc", true},         {"a?c", "ac", false},
        {"x[0-9]", "x7", true},       {"x[0-9]", "xa", false},
        {"x[!0-9]", "xa", true},      {"x[]]", "x]", true},
        {"dir/*", "dir/sub/x", true}, {"[*]lava", "*lava", true},
        {"[*]lava", "xlava", false},  {"a[b", "a[b", true},
        {"**a", "bba", true},         {"a*", "b", false},
        {"x[a-]", "x-", true},
    };
    for (const auto& k : cases) EXPECT_EQ(glob_match(k.pattern, k.text), k.match) << k.pattern << " " << k.text;
    // Many stars on a text that does not match stay fast (quadratic at worst).
    std::string stars, text(20000, 'a');
    for (int i = 0; i < 50; ++i) stars += "a*";
    EXPECT_FALSE(glob_match(stars + "b", text));
}

TEST(Material, ReadsEveryKey) {
    Context c;
    MaterialDatabase db =
        database(R"("m": {"reflectance": [0.1, 0.2, 0.3], "emission": 2, "alpha": 0.5, "env_map": true,
        "roughness": 0.25, "normal_map": "n.png", "albedo_map": "a.png", "normal_cone": 12, "size": [128, 32],
        "two_sided": true, "detail": true})",
                 c);
    const Material m = db.find("m", c);
    EXPECT_TRUE(c.diagnostics().empty());
    EXPECT_TRUE(m.known);
    EXPECT_EQ(m.reflectance, (Rgb{0.1f, 0.2f, 0.3f}));
    EXPECT_EQ(m.emission, (Rgb{2, 2, 2}));
    EXPECT_EQ(m.alpha, 0.5f);
    EXPECT_EQ(m.env_map, 1);
    EXPECT_EQ(m.roughness, 0.25f);
    EXPECT_EQ(m.normal_map, "n.png");
    EXPECT_EQ(m.albedo_map, "a.png");
    EXPECT_EQ(m.normal_cone_deg, 12);
    EXPECT_EQ(m.width, 128);
    EXPECT_EQ(m.height, 32);
    EXPECT_EQ(m.flags, kTwoSided | kDetail | kTranslucent);
    EXPECT_EQ(db.map_directory("m"), "dir/");
    EXPECT_EQ(db.map_directory("other"), "");
}

TEST(Material, StrongerRulesOverrideWhatTheyState) {
    Context c;
    MaterialDatabase db =
        database(R"("Wall1": {"reflectance": 0.3}, "wall*": {"reflectance": 0.1, "roughness": 0.9},
        "*1": {"reflectance": 0.2}, "WALL1": {"alpha": 1}, "*water0": {"reflectance": 0.7}, "x*": {"reflectance": 0.6})",
                 c);
    EXPECT_EQ(db.find("Wall1", c).reflectance.x, 0.3f); // exact spelling
    EXPECT_EQ(db.find("Wall1", c).roughness, 0.9f);     // not stated there: the glob's
    EXPECT_EQ(db.find("wall1", c).reflectance.x, 0.3f); // other case beats globs
    EXPECT_EQ(db.find("wall2", c).reflectance.x, 0.1f);
    EXPECT_EQ(db.find("wall21", c).reflectance.x, 0.2f); // the later glob
    EXPECT_EQ(db.find("*water0", c).reflectance.x, 0.7f);
    ASSERT_TRUE(db.add_json(R"({"materials": {"wall2": {"reflectance": 0.4}}})", "later.json", c));
    EXPECT_EQ(db.find("wall2", c).reflectance.x, 0.4f);
    EXPECT_EQ(count(c, "material-unknown"), 0u);
}

TEST(Material, WhatIsStatedWinsOverWhatTheNameImplies) {
    Context c;
    MaterialDatabase db = database(
        R"("SKY4": {"emission": [2, 2.2, 2.6]}, "sky5": {"reflectance": 0.1}, "sky6": {"emission": 1, "sky": true},
        "*lava1": {"emission": 3}, "clip": {"flags": []}, "skip": {"nodraw": false}, "plain": {"flags": ["sky", "no_light"]}, "*": {"reflectance": 0.2})",
        c);
    EXPECT_EQ(db.find("SKY4", c).flags, 0u);
    EXPECT_EQ(db.find("sky5", c).flags, kSky);
    EXPECT_EQ(db.find("sky6", c).flags, kSky);
    EXPECT_EQ(db.find("*lava1", c).flags, kWater | kLava | kNoLight);
    EXPECT_EQ(db.find("clip", c).flags, 0u);
    EXPECT_EQ(db.find("skip", c).flags, 0u);
    EXPECT_EQ(db.find("plain", c).flags, kSky | kNoLight);
    EXPECT_EQ(db.find("trigger", c).flags, kTrigger); // a glob for all keeps the tools
}

TEST(Material, KnowsTheNamesOfTheFamilies) {
    const struct {
        const char* name;
        std::uint32_t flags;
    } cases[] = {
        {"TOOLS/TOOLSNODRAW", kNoDraw},
        {"tools/toolsnodraw_portal", kNoDraw},
        {"tools/toolsskybox", kSky},
        {"tools/toolsskybox2d", kSky},
        {"tools/toolsskip", kSkip},
        {"tools/toolshint", kHint},
        {"tools/toolsclip", kClip},
        {"tools/toolsplayerclip", kClip | kStopsPlayers},
        {"tools/toolsnpcclip", kClip | kStopsNpcs},
        {"tools/toolstrigger", kTrigger},
        {"tools/toolsorigin", kOrigin},
        {"tools/toolsareaportal", kAreaPortal},
        {"tools/toolsblocklight", kLightBlocker},
        {"tools/toolsblocklight_opacity", kLightBlocker},
        {"tools/toolsinvisible", kInvisible},
        {"tools/toolsinvisibleladder", kInvisible},
        {"tools/toolsblack", kNoLight},
        {"tools/toolsblockbullets", kInvisible | kStopsPlayers | kStopsNpcs | kStopsBullets},
        {"tools/toolsblock_los", kClip | kStopsSight},
        {"tools/toolsoccluder", kTrigger},
        {"nature/water_canals_city", kWater | kNoLight},
        {"sky1", kSky},
        {"SKY4", kSky},
        {"*water0", kWater | kNoLight},
        {"*lava1", kWater | kLava | kNoLight},
        {"#slime0", kWater | kSlime | kNoLight},
        {"*teleport", kWater | kNoLight},
        {"*waterskip", kWater | kNoLight | kNoDraw},
        {"clip", kClip},
        {"skip", kNoDraw},
        {"hint", kHint},
        {"hintskip", kSkip},
        {"trigger", kTrigger},
        {"origin", kOrigin},
        {"!water1", kWater | kNoLight},
        {"AAATRIGGER", kTrigger},
        {"null", kNoDraw},
        {"bevel", kSkip},
        {"{rail1c", kAlphaTested},
        {"e1u1/clip", kClip},
        {"e1u1/sky1", kSky},
        {"e1u1/brlava", kWater | kLava | kNoLight},
        {"common/caulk", kNoDraw},
        {"common/clip", kClip},
        {"common/nodraw", kTrigger},
        {"textures/common/hint", kHint},
        {"skies/hellsky2bright", kSky},
        {"__TB_empty", 0},
    };
    Context c;
    MaterialDatabase db;
    for (const auto& k : cases) EXPECT_EQ(db.find(k.name, c).flags, k.flags) << k.name;
    EXPECT_TRUE(c.diagnostics().empty());
    EXPECT_EQ(db.find("tools/toolsblack", c).reflectance, Rgb{});
    for (const char* name :
         {"signs/waterlevel", "building/skylight01", "metal/clipboard", "brick", "concrete/skywalk"})
        EXPECT_EQ(db.find(name, c).flags, 0u) << name;
}

TEST(Material, UnknownNamesGetDefaultsAndOneWarningEach) {
    Context c;
    MaterialDatabase db;
    for (int i = 0; i < 3; ++i)
        for (const char* name : {"foo", "bar", "FOO", ""}) {
            const Material m = db.find(name, c);
            EXPECT_EQ(m.name, name);
            EXPECT_EQ(m.reflectance, (Rgb{0.5f, 0.5f, 0.5f}));
            EXPECT_EQ(m.width, 64);
        }
    EXPECT_EQ(count(c, "material-unknown"), 2u);
    EXPECT_FALSE(db.find("foo", c).known);
}

TEST(Material, FaultsOfTheFileAreTold) {
    for (const char* text : {"", "{", "[]", "{\"materials\": 3}", "{\"materials\": {\"a\": {\"emission\": 1e999}}}",
                             "\xFF\xFE", "nul"}) {
        Context c;
        MaterialDatabase db;
        const Result<bool> r = db.add_json(text, "m.json", c);
        ASSERT_FALSE(r) << text;
        EXPECT_EQ(r.fault().exit, Exit::input);
        EXPECT_EQ(r.fault().diagnostic.code, "material-file-unreadable");
        EXPECT_EQ(r.fault().diagnostic.where.file, "m.json");
    }
    Context c;
    MaterialDatabase db;
    EXPECT_EQ(db.add_json("{\n\"materials\": {\n oops }}", "m.json", c).fault().diagnostic.where.line, 3);

    db = database("\n\n\"a\": {\"reflectance\": [2, 0.5, -1], \"emissive\": 3, \"flags\": [\"sky\", \"nonsense\"], "
                  "\"size\": [0, 1],\n"
                  "\"alpha\": \"x\", \"sky\": 1}, \"b\": 7",
                  c);
    EXPECT_EQ(db.find("a", c).reflectance, (Rgb{0.99f, 0.5f, 0}));
    EXPECT_EQ(count(c, "material-value-clamped"), 3u);
    EXPECT_EQ(count(c, "material-key-unknown"), 1u);
    EXPECT_EQ(count(c, "material-flag-unknown"), 1u);
    EXPECT_EQ(count(c, "material-value-invalid"), 3u);
    for (const Diagnostic& x : c.diagnostics())
        if (x.where.file == "dir/m.json") {
            EXPECT_EQ(x.where.line, x.message.find("'b'") == std::string::npos ? 3 : 4) << to_text(x);
        }
}

TEST(Material, LightsRad) {
    Context c;
    MaterialDatabase db;
    db.add_lights_rad("// comment\r\nlamp 255 255 255 510\r\nLIGHTS/white 255 128 0\r\nhdr:both 255 255 255 "
                      "2550\nboth 255 255 255 255\n"
                      "ldr:low 255 0 0 255\nbroken x y\nnoshadow foo\nsingle 255 1275\n",
                      "lights.rad", c);
    EXPECT_EQ(db.find("lamp", c).emission, (Rgb{2, 2, 2}));
    EXPECT_NEAR(db.find("lights/WHITE", c).emission.y, std::pow(128.0 / 255, 2.2), 1e-6);
    EXPECT_EQ(db.find("both", c).emission.x, 10);
    EXPECT_EQ(db.find("low", c).emission, (Rgb{1, 0, 0}));
    EXPECT_EQ(db.find("single", c).emission, (Rgb{5, 5, 5}));
    EXPECT_EQ(count(c, "lights-rad-line"), 1u);
    EXPECT_EQ(count(c, "lights-rad-not-handled"), 1u);
    EXPECT_EQ(c.diagnostics()[0].where.line, 7);
}

TEST(Material, ContentFollowsTheRules) {
    Context c;
    MaterialDatabase a = database("\"m\": {\"alpha\": 0.5}", c), b = database("\"m\": {\"alpha\": 0.5}", c),
                     d = database("\"m\": {\"alpha\": 0.25}", c);
    a.find("m", c);
    EXPECT_EQ(a.content(), b.content());
    EXPECT_NE(a.content(), d.content());
}

TEST(Material, DamagedJsonNeverCrashes) {
    const std::string text =
        R"({"materials": {"a*": {"reflectance": [0.1, 0.2, 0.3], "flags": ["sky"], "size": [4, 4]}, "b": {"sky": true}}})";
    std::mt19937 random(5);
    for (int i = 0; i < 5000; ++i) {
        std::string t = text;
        for (int k = 0; k < 3; ++k) t[random() % t.size()] = static_cast<char>(random() % 256);
        Context c;
        MaterialDatabase db;
        if (!db.add_json(t, "m.json", c)) continue;
        db.find("a1", c);
    }
}

// The reference scenes' files as they are.
TEST(Material, ReferenceFiles) {
    const std::filesystem::path root = std::filesystem::path(KILN_SOURCE_DIR) / ".." / "shared" / "reference";
    if (!std::filesystem::exists(root)) GTEST_SKIP() << "no reference scenes at " << root;
    const auto load = [&](const char* name, Context& c) {
        std::ifstream f(root / name);
        MaterialDatabase db;
        EXPECT_TRUE(db.add_json(std::string(std::istreambuf_iterator<char>(f), {}), name, c));
        return db;
    };
    Context c;
    MaterialDatabase e1m1 = load("e1m1_world.materials.json", c), cornell = load("cornell.materials.json", c);
    EXPECT_EQ(e1m1.find("SKY4", c).emission, (Rgb{2, 2.2f, 2.6f}));
    EXPECT_EQ(e1m1.find("SKY4", c).flags, 0u);
    EXPECT_EQ(e1m1.find("+0slip", c).reflectance.x, 0.4f);
    EXPECT_EQ(e1m1.find("TLIGHT01_2", c).emission.x, 20);
    EXPECT_EQ(e1m1.find("TLIGHT11", c).emission.x, 0);
    EXPECT_EQ(cornell.find("ref/lamp", c).emission, (Rgb{17, 12, 4}));
    EXPECT_TRUE(c.diagnostics().empty());
}

} // namespace
} // namespace kiln

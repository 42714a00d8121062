#include "compiler/world/world.h"
#include "formats/quake_map/quake_map.h"
#include "formats/vmf/vmf.h"
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <iterator>
#include <map>
#include <numbers>

namespace kiln {
namespace {

std::size_t count(const Context& c, const std::string& code) {
    return static_cast<std::size_t>(std::ranges::count(c.diagnostics(), code, &Diagnostic::code));
}
const Diagnostic* first(const Context& c, const std::string& code) {
    const auto it = std::ranges::find(c.diagnostics(), code, &Diagnostic::code);
    return it == c.diagnostics().end() ? nullptr : &*it;
}

// A box lo..hi in .map rows, one texture a side (the last repeats), `tail` behind each row.
std::string box(std::vector<std::string> textures, std::array<int, 3> lo = {0, 0, 0},
                std::array<int, 3> hi = {64, 64, 64}, const std::string& tail = "") {
    const auto p = [](int x, int y, int z) {
        return "( " + std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + " ) ";
    };
    const int a = lo[0], b = lo[1], c = lo[2], d = hi[0], e = hi[1], f = hi[2];
    const std::string rows[6] = {
        p(a, b, c) + p(a, b + 1, c) + p(a, b, c + 1), p(a, b, c) + p(a, b, c + 1) + p(a + 1, b, c),
        p(a, b, c) + p(a + 1, b, c) + p(a, b + 1, c), p(d, e, f) + p(d, e + 1, f) + p(d + 1, e, f),
        p(d, e, f) + p(d + 1, e, f) + p(d, e, f + 1), p(d, e, f) + p(d, e, f + 1) + p(d, e + 1, f)};
    std::string out = "{\n";
    for (std::size_t i = 0; i < 6; ++i)
        out += rows[i] + textures[std::min(i, textures.size() - 1)] + " 0 0 0 1 1" + tail + "\n";
    return out + "}\n";
}
std::string entity(const std::string& classname, const std::string& inside = "") {
    return "{\n\"classname\" \"" + classname + "\"\n" + inside + "}\n";
}

Result<World> build(const std::string& map, Context& c, MaterialDatabase* db = nullptr) {
    MaterialDatabase own;
    const Result<Document> d =
        read_quake_map({reinterpret_cast<const std::uint8_t*>(map.data()), map.size()}, "t.map", c);
    if (!d) return d.fault();
    Result<World> w = build_world(*d, db ? *db : own, {}, c);
    if (w) validate(*w);
    return w;
}
// The only brush but the wall that makes the world valid.
WorldBrush brush_of(std::vector<std::string> textures, const std::string& tail = "") {
    Context c;
    const Result<World> w =
        build(entity("worldspawn", box({"wall"}) + box(std::move(textures), {0, 0, 0}, {64, 64, 64}, tail)), c);
    EXPECT_TRUE(w);
    EXPECT_EQ(w->brushes.size(), 2u);
    return w->brushes.back();
}

TEST(World, ContentsFollowTheSides) {
    const struct {
        std::vector<std::string> textures;
        Contents contents;
        bool draws, collides, shadow;
    } cases[] = {
        {{"wall"}, Contents::solid, true, true, true},
        {{"wall", "null"}, Contents::solid, true, true, true},
        {{"null"}, Contents::solid, true, true, true},
        {{"sky1"}, Contents::solid, true, true, true},
        {{"wall", "clip"}, Contents::solid, true, true, true},
        {{"*water1"}, Contents::water, true, false, false},
        {{"*slime1", "null"}, Contents::slime, true, false, false},
        {{"*lava1"}, Contents::lava, true, false, false},
        {{"{fence"}, Contents::grate, true, true, false},
        {{"{fence", "null"}, Contents::grate, true, true, false},
        {{"clip"}, Contents::clip, false, true, false},
        {{"trigger"}, Contents::trigger, false, false, false},
        {{"hint", "hintskip"}, Contents::hint, false, false, false},
        {{"tools/toolsblocklight"}, Contents::clip, false, false, true},
        {{"tools/toolsinvisible"}, Contents::clip, false, true, false},
        {{"tools/toolsskip"}, Contents::trigger, false, false, false},
    };
    for (const auto& k : cases) {
        const WorldBrush b = brush_of(k.textures);
        EXPECT_EQ(b.contents, k.contents) << k.textures[0];
        EXPECT_EQ(b.draws, k.draws) << k.textures[0];
        EXPECT_EQ(b.collides, k.collides) << k.textures[0];
        EXPECT_EQ(b.casts_light_shadow, k.shadow) << k.textures[0];
    }
    Context c;
    const Result<World> w = build(entity("worldspawn", box({"*water1", "wall"})), c);
    ASSERT_TRUE(w);
    EXPECT_EQ(w->brushes[0].contents, Contents::solid);
    EXPECT_EQ(count(c, "mixed-contents"), 1u);
}

TEST(World, RowsOfQuake2AddTheirFlags) {
    EXPECT_EQ(brush_of({"e1u1/x"}, " 134217729 0 0").contents, Contents::detail);
    EXPECT_EQ(brush_of({"e1u1/x"}, " 32 8 0").contents, Contents::water);
    EXPECT_EQ(brush_of({"e1u1/x"}, " 8 0 0").contents, Contents::lava);
    EXPECT_EQ(brush_of({"e1u1/water1"}, " 1 0 0").contents, Contents::solid);
    EXPECT_EQ(brush_of({"e1u1/x"}, " 2 16 0").contents, Contents::window);
    EXPECT_EQ(brush_of({"e1u1/x"}, " 65536 0 0").contents, Contents::clip);
    EXPECT_EQ(brush_of({"e1u1/x"}, " 0 256 0").contents, Contents::hint);
    EXPECT_EQ(brush_of({"e1u1/skip"}, " 1 640 0").contents, Contents::solid);
    EXPECT_EQ(brush_of({"common/caulk"}, " 0 4 0").contents, Contents::solid); // Quake 3: 4 is no sky here
    EXPECT_EQ(brush_of({"common/caulk"}, " 134217728 0 0").contents, Contents::detail);

    Context c;
    const Result<World> w =
        build(entity("worldspawn", box({"e1u1/lamp"}, {0, 0, 0}, {9, 9, 9}, " 1 1 800") + box({"e1u1/lamp"}) +
                                       box({"e1u1/s"}, {0, 0, 0}, {9, 9, 9}, " 1 4 0")),
              c);
    ASSERT_TRUE(w);
    ASSERT_EQ(w->materials.size(), 3u);
    EXPECT_NEAR(w->materials[0].emission.x, 800 / 255.0 / std::numbers::pi, 1e-6);
    EXPECT_EQ(w->materials[1].emission.x, 0);
    EXPECT_EQ(w->materials[2].flags, kSky);
}

TEST(World, EntitiesJoinTheWorldOrBecomeModels) {
    const std::string b = box({"wall"});
    Context c;
    const Result<World> w = build(
        entity("worldspawn", b) + entity("func_detail", b + box({"*water1"})) + entity("func_group", b) +
            entity("func_wall", b + b) + entity("info_player_start", "\"origin\" \"1 2 3\"\n") +
            entity("trigger_once", b) + entity("func_detail_fence", b) + entity("func_detail_illusionary", b) +
            entity("func_illusionary", b) + entity("func_areaportal", b) + entity("func_viscluster", b) +
            entity("func_door", "\"_shadow\" \"1\"\n" + b) + entity("func_group", "\"_detail\" \"1\"\n" + b),
        c);
    ASSERT_TRUE(w);
    ASSERT_EQ(w->entities.size(), 13u);
    const struct {
        int entity;
        Contents contents;
        int model;
        bool draws, collides, shadow;
    } expected[] = {
        {0, Contents::solid, 0, true, true, true},          {1, Contents::detail, 0, true, true, true},
        {1, Contents::water, 0, true, false, false},        {2, Contents::solid, 0, true, true, true},
        {3, Contents::solid, 1, true, true, false},         {3, Contents::solid, 1, true, true, false},
        {5, Contents::trigger, 2, false, false, false},     {6, Contents::window, 0, true, true, true},
        {7, Contents::window, 0, true, false, true},        {8, Contents::solid, 3, true, false, false},
        {9, Contents::area_portal, 0, false, false, false}, {10, Contents::vis_cluster, 0, false, false, false}, {11, Contents::solid, 4, true, true, true},
        {12, Contents::detail, 0, true, true, true},
    };
    ASSERT_EQ(w->brushes.size(), std::size(expected));
    for (std::size_t i = 0; i < std::size(expected); ++i) {
        const WorldBrush& got = w->brushes[i];
        EXPECT_EQ(got.entity.value, static_cast<std::uint32_t>(expected[i].entity)) << i;
        EXPECT_EQ(got.contents, expected[i].contents) << i;
        EXPECT_EQ(got.model.value, static_cast<std::uint32_t>(expected[i].model)) << i;
        EXPECT_EQ(got.draws, expected[i].draws) << i;
        EXPECT_EQ(got.collides, expected[i].collides) << i;
        EXPECT_EQ(got.casts_light_shadow, expected[i].shadow) << i;
    }
    EXPECT_EQ(w->model_count, 5u);
    EXPECT_FALSE(w->entities[1].model.valid());
    EXPECT_TRUE(w->entities[4].has_origin);
    EXPECT_EQ(w->entities[4].origin, (Vec3{1, 2, 3}));
}

TEST(World, OriginBrushesNameTheMiddleOfTheirBox) {
    Context c;
    const Result<World> w =
        build(entity("worldspawn", box({"wall"}) + box({"origin"})) +
                  entity("func_door", box({"wall"}) + box({"origin"}, {-10, 20, 30}, {30, 25, 50})),
              c);
    ASSERT_TRUE(w);
    EXPECT_EQ(w->brushes.size(), 2u);
    EXPECT_TRUE(w->entities[1].has_origin);
    EXPECT_NEAR(length(w->entities[1].origin - Vec3{10, 22.5, 40}), 0, 1e-9);
    EXPECT_EQ(w->entities[1].get("origin"), "10 22.5 40"); // what a game turns the model about
    EXPECT_EQ(count(c, "origin-brush-in-world"), 1u);
}

TEST(World, LuxelSizeComesFromTheNearestKey) {
    const std::string b = box({"wall"});
    Context c;
    const Result<World> w =
        build(entity("worldspawn", "\"_lightmap_scale\" \"8\"\n" + b) +
                  entity("func_wall", "\"_lightmap_scale\" \"4\"\n" + b) + entity("func_wall", b) +
                  entity("func_wall", "\"_lightmap_scale\" \"-1\"\n" + b) +
                  entity("func_wall", "\"_lightmap_scale\" \"1e-9\"\n" + b),
              c);
    ASSERT_TRUE(w);
    const double expected[] = {8, 4, 8, 16, 0.125};
    for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(w->sides[i * 6].lightmap_scale, expected[i]) << i;
    EXPECT_EQ(count(c, "lightmap-scale-invalid"), 1u);
    EXPECT_EQ(count(c, "lightmap-scale-clamped"), 1u);
}

TEST(World, WhatIsNotHandledIsToldOnceAKind) {
    std::string map = entity("worldspawn", box({"wall"}));
    for (int i = 0; i < 3; ++i) map += entity("misc_model") + entity("prop_detail");
    Context c;
    ASSERT_TRUE(build(map, c));
    EXPECT_EQ(count(c, "not-handled-prop-static"), 1u);
    EXPECT_EQ(count(c, "not-handled-prop-detail"), 1u);
    EXPECT_TRUE(first(c, "not-handled-prop-detail")->message.starts_with("3 prop_detail"));
    EXPECT_EQ(first(c, "not-handled-prop-detail")->where.entity, 2);
}

TEST(World, ADisplacedBrushFillsNothing) {
    const std::string row = "\"0 0 1 0 0 1 0 0 1 0 0 1 0 0 1\" ";
    const std::string side = "side { \"id\" \"1\" \"plane\" \"(0 0 0) (0 64 0) (64 0 0)\" \"material\" \"wall\" "
                             "\"lightmapscale\" \"32\" dispinfo { \"power\" \"2\" \"startposition\" \"[0 0 0]\" normals { \"row0\" " + row + "\"row1\" " + row +
                             "\"row2\" " + row + "\"row3\" " + row + "\"row4\" " + row + "} } }\n";
    const std::string flat = "side { \"id\" \"7\" \"plane\" \"(0 0 0) (0 64 0) (64 0 0)\" \"material\" \"wall\" }\n";
    const std::string map = "world { \"id\" \"1\" \"classname\" \"worldspawn\" solid { \"id\" \"2\" " + side + flat +
                            " } solid { \"id\" \"3\" " + flat + " } }\n"
                            "entity { \"id\" \"9\" \"classname\" \"prop_static\" \"origin\" \"nan 0 0\" }\n";
    Context c;
    Result<Document> d =
        read_vmf({reinterpret_cast<const std::uint8_t*>(map.data()), map.size()}, "t.vmf", c);
    ASSERT_TRUE(d);
    MaterialDatabase db;
    const Result<World> w = build_world(*d, db, {}, c);
    ASSERT_TRUE(w);
    validate(*w);
    EXPECT_EQ(w->brushes[0].contents, Contents::empty);
    EXPECT_TRUE(w->brushes[0].displaced);
    EXPECT_EQ(w->brushes[1].contents, Contents::solid);
    EXPECT_EQ(w->sides[0].lightmap_scale, 32);
    EXPECT_EQ(w->sides[0].displacement, 0);
    EXPECT_EQ(w->sides[1].displacement, -1);
    ASSERT_EQ(w->displacements.size(), 1u);
    EXPECT_EQ(w->displacements[0].side, SideId{0});
    EXPECT_EQ(count(c, "displacement-invalid"), 0u);
    EXPECT_EQ(count(c, "origin-invalid"), 1u);
    EXPECT_FALSE(w->entities[1].has_origin);

    // What cannot be displaced stays flat, and seals nothing.
    const auto spoilt = [&](auto spoil) {
        Document bad = *d;
        spoil(bad.displacements[0]);
        const std::size_t before = count(c, "displacement-invalid");
        const Result<World> v = build_world(bad, db, {}, c);
        ASSERT_TRUE(v);
        validate(*v);
        EXPECT_EQ(count(c, "displacement-invalid"), before + 1);
        EXPECT_EQ(v->brushes[0].contents, Contents::detail);
        EXPECT_EQ(v->sides[0].displacement, -1);
        EXPECT_TRUE(v->displacements.empty());
    };
    spoilt([](DocDisplacement& g) { g.power = 5; });
    spoilt([](DocDisplacement& g) { g.power = 1; });
    spoilt([](DocDisplacement& g) { g.distances.assign(24, 1.0); });
    spoilt([](DocDisplacement& g) { g.triangle_tags.assign(31, 0); });
    spoilt([](DocDisplacement& g) { g.normals[3].y = NAN; });
    spoilt([](DocDisplacement& g) { g.elevation = 1e9; });
    // Each number may stand, together they lead out of the world.
    spoilt([](DocDisplacement& g) { g.distances.assign(25, 0.0), g.distances[24] = 1000, g.normals[24] = {0, 0, 132}; });
    spoilt([](DocDisplacement& g) { g.offsets.assign(25, Vec3{}), g.offsets[7] = {0, 100000, 100000}; });
    spoilt([](DocDisplacement& g) { g.elevation = -131072, g.offsets.assign(25, Vec3{1, 0, 0}); });
    EXPECT_EQ(first(c, "displacement-invalid")->where.side, 1);
    EXPECT_EQ(first(c, "displacement-invalid")->where.brush, 2);
}

TEST(World, WhatCannotBeDisplacedStaysFlatAndSealsNothing) {
    const std::string side = "side { \"id\" \"1\" \"plane\" \"(0 0 0) (0 64 0) (64 0 0)\" \"material\" \"wall\" "
                             "\"lightmapscale\" \"32\" dispinfo { } }\n";
    const std::string map = "world { \"id\" \"1\" \"classname\" \"worldspawn\" solid { \"id\" \"2\" " + side +
                            side +
                            " } }\n"
                            "entity { \"id\" \"9\" \"classname\" \"prop_static\" \"origin\" \"nan 0 0\" }\n";
    Context c;
    const Result<Document> d =
        read_vmf({reinterpret_cast<const std::uint8_t*>(map.data()), map.size()}, "t.vmf", c);
    ASSERT_TRUE(d);
    MaterialDatabase db;
    const Result<World> w = build_world(*d, db, {}, c);
    ASSERT_TRUE(w);
    EXPECT_EQ(w->brushes[0].contents, Contents::detail);
    EXPECT_EQ(w->sides[0].lightmap_scale, 32);
    EXPECT_EQ(w->sides[0].displacement, -1);
    EXPECT_FALSE(w->brushes[0].displaced);
    EXPECT_TRUE(w->displacements.empty());
    EXPECT_EQ(count(c, "displacement-power-invalid"), 2u); // told once, by the reader
    EXPECT_EQ(count(c, "displacement-invalid"), 0u);
    EXPECT_EQ(first(c, "displacement-power-invalid")->where.side, 1);
    EXPECT_EQ(count(c, "origin-invalid"), 1u);
    EXPECT_FALSE(w->entities[1].has_origin);
}

// brushDef counts repeats of the texture: texels come of the material's size, and mean the same place on it.
TEST(World, RepeatsOfATextureBecomeTexels) {
    std::string rows;
    for (const char* plane : {"0 0 1", "0 0 -1", "0 1 0", "0 -1 0", "1 0 0", "-1 0 0"})
        rows += "( " + std::string(plane) + " -64 ) ( ( 0.25 0 0.5 ) ( 0 0.125 3 ) ) \"wide\" 0 0 0\n";
    const std::string map = entity("worldspawn", "{\nbrushDef3\n{\n" + rows + "}\n}\n");
    Context c;
    MaterialDatabase db;
    ASSERT_TRUE(db.add_json(R"({"materials": {"wide": {"size": [128, 32]}}})", "m.json", c));
    const Result<World> w = build(map, c, &db);
    ASSERT_TRUE(w) << to_text(w.fault().diagnostic);
    ASSERT_EQ(w->materials[0].width, 128);
    const DocTexture& t = w->sides[0].texture; // looks up: u along y, v along x
    EXPECT_FALSE(t.in_repeats);
    const Vec3 p{8, 4, 64};
    EXPECT_DOUBLE_EQ(dot(p, t.u_axis) / t.u_scale + t.u_shift, (0.25 * 4 + 0.5) * 128);
    EXPECT_DOUBLE_EQ(dot(p, t.v_axis) / t.v_scale + t.v_shift, (0.125 * 8 + 3) * 32);
}

TEST(World, PlacesLeadBackToTheMap) {
    Context c;
    const Result<World> w =
        build(entity("worldspawn", box({"wall"}) + box({"wall"})) + entity("func_wall", box({"wall"})), c);
    ASSERT_TRUE(w);
    EXPECT_EQ(w->location(id<SideId>(0)), (SourceLocation{"t.map", 4, 0, 0, 0}));
    EXPECT_EQ(w->location(id<SideId>(11)), (SourceLocation{"t.map", 17, 0, 1, 5}));
    EXPECT_EQ(w->location(id<BrushId>(2)), (SourceLocation{"t.map", 22, 1, 0, -1}));
    EXPECT_EQ(w->location(id<EntityId>(1)), (SourceLocation{"t.map", 20, 1, -1, -1}));
    EXPECT_EQ(w->location(SideId{}).file, "t.map");
}

TEST(World, NothingToCompileIsAFault) {
    for (const std::string& map : {entity("worldspawn"), entity("worldspawn", box({"clip"})),
                                   entity("worldspawn") + entity("func_wall", box({"wall"}))}) {
        Context c;
        const Result<World> w = build(map, c);
        ASSERT_FALSE(w);
        EXPECT_EQ(w.fault().exit, Exit::geometry);
        EXPECT_EQ(w.fault().diagnostic.code, "no-world-brushes");
        EXPECT_EQ(w.fault().diagnostic.where.line, 1);
    }
    Context c;
    MaterialDatabase db;
    const Result<World> w = build_world({}, db, {}, c);
    ASSERT_FALSE(w);
    EXPECT_EQ(w.fault().exit, Exit::input);
}

TEST(World, BytesComeBack) {
    Context c;
    const Result<World> w =
        build(entity("worldspawn", box({"wall", "sky1"})) + entity("func_door", box({"wall"})), c);
    ASSERT_TRUE(w);
    const Bytes bytes = to_bytes(*w);
    EXPECT_EQ(to_bytes(from_bytes<World>(bytes)), bytes);
}

std::string key(const std::string& k, const std::string& v) { return "\"" + k + "\" \"" + v + "\"\n"; }

// As TrenchBroom writes layers: the outermost group or a lone entity names its layer, what is in a group names the group.
TEST(World, LayersOmittedFromExportAreLeftOut) {
    const auto layer = [](const std::string& id, bool omit) {
        return entity("func_group", key("_tb_type", "_tb_layer") + key("_tb_id", id) +
                                        (omit ? key("_tb_layer_omit_from_export", "1") : "") + box({"wall"}));
    };
    const auto group = [](const std::string& id, const std::string& parent) {
        return entity("func_group", key("_tb_type", "_tb_group") + key("_tb_id", id) + parent + box({"wall"}));
    };
    const std::string rest = layer("3", true) + layer("4", false) + group("5", key("_tb_layer", "3")) + group("6", key("_tb_group", "5")) +
                             group("7", key("_tb_layer", "4")) + entity("light", key("_tb_group", "6")) +
                             entity("light", key("_tb_layer", "3")) + entity("info_null", key("_tb_layer", "4")) +
                             entity("info_null", key("_tb_group", "7")) + entity("info_player_start");
    const auto classes = [](const World& w) {
        std::map<std::string, int> n;
        for (const WorldEntity& e : w.entities) ++n[std::string(e.get("classname"))];
        return n;
    };
    Context c;
    const Result<World> w = build(entity("worldspawn", box({"wall"})) + rest, c);
    ASSERT_TRUE(w);
    EXPECT_EQ(classes(*w), (std::map<std::string, int>{{"worldspawn", 1}, {"func_group", 2}, {"info_null", 2}, {"info_player_start", 1}}));
    EXPECT_EQ(w->brushes.size(), 3u); // worldspawn's, layer 4's, group 7's
    ASSERT_EQ(count(c, "layer-omitted"), 1u);
    EXPECT_EQ(first(c, "layer-omitted")->severity, Severity::note);
    EXPECT_EQ(first(c, "layer-omitted")->message.substr(0, 26), "5 entities with 3 brushes ");

    // The default layer omitted: what names no layer goes, worldspawn stays as an entity.
    Context d;
    const Result<World> rest_only = build(entity("worldspawn", key("_tb_layer_omit_from_export", "1") + box({"wall"})) + rest, d);
    ASSERT_TRUE(rest_only);
    EXPECT_EQ(classes(*rest_only), (std::map<std::string, int>{{"worldspawn", 1}, {"func_group", 2}, {"info_null", 2}}));
    EXPECT_EQ(rest_only->brushes.size(), 2u);

    // Groups that name each other in a circle belong to nowhere.
    Context e;
    EXPECT_TRUE(build(entity("worldspawn", box({"wall"})) + layer("3", true) + group("5", key("_tb_group", "6")) + group("6", key("_tb_group", "5")), e));
}

TEST(World, RealMaps) {
    const std::filesystem::path root = std::filesystem::path(KILN_SOURCE_DIR) / ".." / "shared" / "maps";
    if (!std::filesystem::exists(root)) GTEST_SKIP() << "no real maps at " << root;
    int worlds = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
        const bool vmf = entry.path().extension() == ".vmf";
        if (!vmf && entry.path().extension() != ".map") continue;
        std::ifstream stream(entry.path(), std::ios::binary);
        const std::vector<std::uint8_t> bytes((std::istreambuf_iterator<char>(stream)), {});
        Context c;
        const Result<Document> d = vmf ? read_vmf(bytes, "m", c) : read_quake_map(bytes, "m", c);
        if (!d) continue;
        MaterialDatabase db;
        const Result<World> w = build_world(*d, db, {}, c);
        const std::string name = entry.path().filename();
        if (!w) {
            EXPECT_EQ(w.fault().diagnostic.code, "no-world-brushes") << name;
            continue;
        }
        ++worlds;
        validate(*w);
        if (name == "lambda_bunker_v2.vmf") {
            EXPECT_EQ(w->brushes.size(), 377u);
            EXPECT_EQ(w->sides.size(), 2335u);
            EXPECT_EQ(w->model_count, 30u); // as in the level its author's compiler made
        }
        if (name == "racetrak.vmf") {
            EXPECT_EQ(w->model_count, 5u);
        }
        if (name == "skybox.vmf" || name == "newmap.vmf") {
            EXPECT_EQ(w->model_count, 1u);
        }
    }
    EXPECT_GT(worlds, 100);
}

} // namespace
} // namespace kiln

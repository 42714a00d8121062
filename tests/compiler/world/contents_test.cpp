// What names, rows and classes mean: contents, what a brush stops, how entities join the world.
#include "compiler/world/world.h"
#include "formats/quake_map/quake_map.h"
#include "formats/vmf/vmf.h"
#include <algorithm>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace kiln {
namespace {

using Corner = std::array<int, 3>;

std::span<const std::uint8_t> bytes(const std::string& text) {
    return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}
// Plane points of a box, side by side, clockwise seen from outside.
std::array<std::array<Corner, 3>, 6> box_points(Corner lo, Corner hi) {
    const auto [a, b, c] = lo;
    const auto [d, e, f] = hi;
    return {{{{{a, b, c}, {a, b + 1, c}, {a, b, c + 1}}},
             {{{a, b, c}, {a, b, c + 1}, {a + 1, b, c}}},
             {{{a, b, c}, {a + 1, b, c}, {a, b + 1, c}}},
             {{{d, e, f}, {d, e + 1, f}, {d + 1, e, f}}},
             {{{d, e, f}, {d + 1, e, f}, {d, e, f + 1}}},
             {{{d, e, f}, {d, e, f + 1}, {d, e + 1, f}}}}};
}
// One texture a side, the last repeats; `tail` behind each row.
std::string box(const std::vector<std::string>& textures, Corner lo = {0, 0, 0}, Corner hi = {64, 64, 64}, const std::string& tail = "") {
    std::string out = "{\n";
    std::size_t i = 0;
    for (const auto& side : box_points(lo, hi)) {
        for (const Corner& p : side) out += fmt::format("( {} {} {} ) ", p[0], p[1], p[2]);
        out += textures[std::min(i++, textures.size() - 1)] + " 0 0 0 1 1" + tail + "\n";
    }
    return out + "}\n";
}
std::string entity(const std::string& classname, const std::string& inside = "") {
    return "{\n\"classname\" \"" + classname + "\"\n" + inside + "}\n";
}
std::string vmf_solid(const std::string& material, int id, Corner lo = {0, 0, 0}, Corner hi = {64, 64, 64}) {
    std::string out = fmt::format("solid {{ \"id\" \"{}\"\n", id);
    int side = 10 * id;
    for (const auto& p : box_points(lo, hi))
        out += fmt::format("side {{ \"id\" \"{}\" \"plane\" \"({} {} {}) ({} {} {}) ({} {} {})\" \"material\" \"{}\" }}\n", side++, p[0][0], p[0][1],
                           p[0][2], p[1][0], p[1][1], p[1][2], p[2][0], p[2][1], p[2][2], material);
    return out + "}\n";
}
std::string vmf(const std::string& solids, const std::string& entities = "") {
    return "world { \"id\" \"1\" \"classname\" \"worldspawn\"\n" + vmf_solid("wall", 2) + solids + "}\n" + entities;
}

World build(const Result<Document>& d, Context& c) {
    EXPECT_TRUE(d);
    MaterialDatabase database;
    Result<World> w = build_world(*d, database, {}, c);
    EXPECT_TRUE(w);
    validate(*w);
    return std::move(*w);
}
World of_map(const std::string& text, Context& c) { return build(read_quake_map(bytes(text), "t.map", c), c); }
World of_vmf(const std::string& text, Context& c) { return build(read_vmf(bytes(text), "t.vmf", c), c); }

WorldBrush map_brush(const std::vector<std::string>& textures, const std::string& tail = "") {
    Context c;
    return of_map(entity("worldspawn", box({"wall"}) + box(textures, {0, 0, 0}, {64, 64, 64}, tail)), c).brushes.at(1);
}
WorldBrush vmf_brush(const std::string& material) {
    Context c;
    return of_vmf(vmf(vmf_solid(material, 3)), c).brushes.at(1);
}
std::size_t count(const Context& c, const std::string& code) {
    return static_cast<std::size_t>(std::ranges::count(c.diagnostics(), code, &Diagnostic::code));
}

constexpr std::uint8_t kPN = kBlocksPlayers | kBlocksNpcs, kPNB = kPN | kBlocksBullets;

TEST(Contents, ToolTexturesOfSourceStopWhatTheirNamesSay) {
    const struct {
        const char* material;
        Contents contents;
        int blocks;
    } cases[] = {
        {"brick/wall1", Contents::solid, kBlocksAll},
        {"tools/toolsnodraw", Contents::solid, kBlocksAll},
        {"tools/toolsskybox", Contents::solid, kBlocksAll},
        {"TOOLS/TOOLSCLIP", Contents::clip, kPN},
        {"tools/toolsplayerclip", Contents::clip, kBlocksPlayers},
        {"tools/toolsnpcclip", Contents::clip, kBlocksNpcs},
        {"tools/toolsinvisible", Contents::clip, kPN},
        {"tools/toolsinvisibleladder", Contents::clip, kPN},
        {"tools/toolsblockbullets", Contents::clip, kPNB},
        {"tools/toolsblock_los", Contents::clip, kBlocksSight},
        {"tools/toolsblocklight", Contents::clip, kBlocksSight},
        {"tools/toolsgrenadeclip", Contents::trigger, 0},
        {"tools/toolstrigger", Contents::trigger, 0},
        {"tools/toolsskip", Contents::trigger, 0},
        {"tools/toolsareaportal", Contents::area_portal, 0},
        {"nature/water_canals_city", Contents::water, 0},
        {"nature/toxicslime001a", Contents::slime, 0},
        {"cs_havana/{fence3", Contents::grate, kPN},
    };
    for (const auto& k : cases) {
        const WorldBrush b = vmf_brush(k.material);
        EXPECT_EQ(b.contents, k.contents) << k.material;
        EXPECT_EQ(b.blocks, k.blocks) << k.material;
        EXPECT_EQ(b.collides, (k.blocks & kBlocksPlayers) != 0) << k.material;
    }
}

TEST(Contents, NamesOfQuakeAndItsHeirs) {
    const struct {
        const char* material;
        Contents contents;
        int blocks;
    } cases[] = {
        {"clip", Contents::clip, kPN},
        {"skip", Contents::solid, kBlocksAll},
        {"sky1", Contents::solid, kBlocksAll},
        {"*water0", Contents::water, 0},
        {"*04mwat1", Contents::water, 0},
        {"*teleport", Contents::water, 0},
        {"*slime", Contents::slime, 0},
        {"*lava1", Contents::lava, 0},
        {"#lava1", Contents::lava, 0},
        {"!water1", Contents::water, 0},
        {"!toxicslime", Contents::slime, 0},
        {"{grate", Contents::grate, kPNB},
        {"common/clip", Contents::clip, kPN},
        {"common/playerclip", Contents::clip, kBlocksPlayers},
        {"common/weapclip", Contents::clip, kPNB},
        {"common/botclip", Contents::clip, kBlocksNpcs},
        {"common/full_clip", Contents::clip, kPNB},
        {"common/missileclip", Contents::clip, kBlocksBullets},
        {"common/caulk", Contents::solid, kBlocksAll},
        {"common/nodrawnonsolid", Contents::trigger, 0},
        {"common/areaportal", Contents::area_portal, 0},
        {"common/hint", Contents::hint, 0},
        {"liquids/lavahell_1000", Contents::lava, 0},
        {"textures/liquids/slime7", Contents::slime, 0},
        {"skies/hellsky", Contents::solid, kBlocksAll},
        {"e1u1/clip", Contents::clip, kPN},
        {"e1u1/clip_mon", Contents::clip, kBlocksNpcs},
        {"e1u3/brwater", Contents::water, 0},
        {"e2u2/brlava", Contents::lava, 0},
    };
    for (const auto& k : cases) {
        const WorldBrush b = map_brush({k.material});
        EXPECT_EQ(b.contents, k.contents) << k.material;
        EXPECT_EQ(b.blocks, k.blocks) << k.material;
    }
    // Several kinds of clip on one brush stop all that any of them stops.
    EXPECT_EQ(map_brush({"common/playerclip", "common/missileclip"}).blocks, kBlocksPlayers | kBlocksBullets);
    // A window is stronger than a grate on one brush, and one such side is enough.
    EXPECT_EQ(map_brush({"wall", "{grate"}).contents, Contents::grate);
    EXPECT_EQ(map_brush({"{grate", "wall"}, " 0 16 0").contents, Contents::window);
    EXPECT_EQ(map_brush({"{grate", "sky1"}).contents, Contents::solid); // sky seals
}

TEST(Contents, EveryBitOfQuake2Rows) {
    const struct {
        std::int64_t contents, surface;
        Contents expected;
        int blocks;
    } cases[] = {
        {0, 0, Contents::solid, kBlocksAll},
        {1, 0, Contents::solid, kBlocksAll},
        {2, 0, Contents::window, kPNB},
        {4, 0, Contents::window, 0},               // aux
        {8, 0, Contents::lava, 0},
        {0x10, 0, Contents::slime, 0},
        {0x20, 0, Contents::water, 0},
        {0x40, 0, Contents::window, 0},            // mist
        {0x40, 0x10, Contents::window, 0},
        {0x4000, 0, Contents::clip, kBlocksBullets},
        {0x8000, 0x80, Contents::area_portal, 0},
        {0x10000, 0, Contents::clip, kBlocksPlayers},
        {0x20000, 0, Contents::clip, kBlocksNpcs},
        {0x30000, 0x80, Contents::clip, kPN},
        {0x10001, 0, Contents::solid, kBlocksAll}, // a wall that is clip besides
        {0xFC0020, 8, Contents::water, 0},         // currents
        {0x8000001, 0, Contents::detail, kBlocksAll},
        {0x8000002, 0x10, Contents::window, kPNB},
        {0x10000001, 0, Contents::solid, kBlocksAll},
        {0x20000001, 0, Contents::solid, kBlocksAll}, // ladder
        {3, 0, Contents::solid, kBlocksAll},
        {1, 0x10, Contents::window, kPNB},         // trans33
        {1, 0x20, Contents::window, kPNB},
        {0x20, 0x29, Contents::water, 0},          // a see-through liquid stays one
        {1, 0x2000000, Contents::grate, kPNB},
        {1, 4, Contents::solid, kBlocksAll},       // sky
        {1, 0x80, Contents::solid, kBlocksAll},    // nodraw
        {0, 0x100, Contents::hint, 0},
        {0, 0x200, Contents::trigger, 0},          // skip alone
        {1, 0x280, Contents::solid, kBlocksAll},
        {1, 0x43, Contents::solid, kBlocksAll},    // light, slick, flowing
    };
    for (const auto& k : cases) {
        const WorldBrush b = map_brush({"e1u1/x"}, fmt::format(" {} {} 0", k.contents, k.surface));
        EXPECT_EQ(b.contents, k.expected) << std::hex << k.contents << " " << k.surface;
        EXPECT_EQ(b.blocks, k.blocks) << std::hex << k.contents << " " << k.surface;
    }
}

TEST(Contents, ValuesOfQuake2RowsAreGroups) {
    Context c;
    const World w = of_map(entity("worldspawn", box({"e1u1/x"}, {0, 0, 0}, {64, 64, 64}, " 1 0 7") + box({"e1u1/x"}, {0, 0, 0}, {64, 64, 64}, " 1 1 900") +
                                                    box({"e1u1/x"}, {0, 0, 0}, {64, 64, 64}, " 1 0 -3")), c);
    EXPECT_EQ(w.sides.at(0).smoothing_groups, 7u);
    EXPECT_EQ(w.sides.at(6).smoothing_groups, 0u); // the brightness of a light
    EXPECT_EQ(w.sides.at(12).smoothing_groups, 0u);
    const World q3 = of_map(entity("worldspawn", box({"common/caulk"}, {0, 0, 0}, {64, 64, 64}, " 1 0 7")), c);
    EXPECT_EQ(q3.sides.at(0).smoothing_groups, 0u);
}

TEST(Contents, UnknownBitsOfQuake2RowsAreOneNote) {
    Context c;
    of_map(entity("worldspawn", box({"e1u1/x"}, {0, 0, 0}, {64, 64, 64}, " 1024 0 0") + box({"e1u1/x"}, {0, 0, 0}, {64, 64, 64}, " 1 2048 0")), c);
    ASSERT_EQ(count(c, "row-bits-unknown"), 1u);
    const Diagnostic& d = *std::ranges::find(c.diagnostics(), "row-bits-unknown", &Diagnostic::code);
    EXPECT_TRUE(d.message.starts_with("12 sides")) << d.message;
    EXPECT_NE(d.message.find("contents 0x400, surface 0x800"), std::string::npos) << d.message;
    EXPECT_EQ(d.where.brush, 0);
    Context q3; // there the bits mean nothing
    of_map(entity("worldspawn", box({"common/caulk"}, {0, 0, 0}, {64, 64, 64}, " 1024 0 0")), q3);
    EXPECT_EQ(count(q3, "row-bits-unknown"), 0u);
}

TEST(Contents, SourceLaddersJoinTheWorldAndKeepTheirBounds) {
    for (const char* name : {"func_ladder", "func_simpleladder"}) {
        Context c;
        const World w = of_vmf(vmf("", fmt::format("entity {{ \"id\" \"7\" \"classname\" \"{}\"\n{}{}}}\n", name,
                                                   vmf_solid("tools/toolsinvisibleladder", 8, {1, 2, 3}, {4, 5, 6}),
                                                   vmf_solid("wood/rungs", 9, {-10, 2, 3}, {4, 5, 60}))),
                               c);
        ASSERT_EQ(w.brushes.size(), 3u);
        EXPECT_EQ(w.brushes[1].contents, Contents::clip);
        EXPECT_EQ(w.brushes[1].model.value, 0u);
        EXPECT_EQ(w.brushes[2].contents, Contents::detail); // drawn, seals nothing
        const WorldEntity& e = w.entities.at(1);
        EXPECT_FALSE(e.model.valid());
        EXPECT_EQ(e.get("classname"), "info_ladder");
        EXPECT_EQ(e.vector("mins.x", {}).x, 0); // no vector: one number a key
        EXPECT_EQ(e.number("mins.x", 0), -10);
        EXPECT_EQ(e.number("mins.y", 0), 2);
        EXPECT_EQ(e.number("mins.z", 0), 3);
        EXPECT_EQ(e.number("maxs.x", 0), 4);
        EXPECT_EQ(e.number("maxs.z", 0), 60);
    }
}

TEST(Contents, OccludersClustersAndWaterEntities) {
    Context c;
    const World w = of_vmf(vmf("", "entity { \"id\" \"7\" \"classname\" \"func_occluder\"\n" + vmf_solid("tools/toolsoccluder", 8) + "}\n" +
                                       "entity { \"id\" \"17\" \"classname\" \"func_viscluster\"\n" + vmf_solid("tools/toolstrigger", 18) + "}\n" +
                                       "entity { \"id\" \"27\" \"classname\" \"func_water_analog\"\n" + vmf_solid("wall", 28) + "}\n"),
                           c);
    ASSERT_EQ(w.brushes.size(), 4u);
    EXPECT_EQ(w.brushes[1].contents, Contents::occluder);
    EXPECT_EQ(w.brushes[2].contents, Contents::vis_cluster);
    for (const std::size_t b : {1u, 2u}) {
        EXPECT_EQ(w.brushes[b].model.value, 0u);
        EXPECT_FALSE(w.brushes[b].draws);
        EXPECT_FALSE(w.brushes[b].casts_light_shadow);
        EXPECT_EQ(w.brushes[b].blocks, 0);
    }
    EXPECT_EQ(w.brushes[3].contents, Contents::water);
    EXPECT_EQ(w.brushes[3].model.value, 1u);
    EXPECT_TRUE(w.brushes[3].draws);
    EXPECT_EQ(w.brushes[3].blocks, 0);

    Context half_life;
    const World h = of_map(entity("worldspawn", box({"wall"})) + entity("func_water", box({"c2a3water"})) +
                               entity("func_water", "\"skin\" \"-4\"\n" + box({"!pool"})) + entity("func_water", "\"skin\" \"-5\"\n" + box({"x"})),
                           half_life);
    EXPECT_EQ(h.brushes.at(1).contents, Contents::water);
    EXPECT_EQ(h.brushes.at(2).contents, Contents::water); // its name says so
    EXPECT_EQ(h.brushes.at(3).contents, Contents::lava);
}

TEST(Contents, BrushesBehindAreaPortalWindowsAreSeenThrough) {
    Context c;
    const World w = of_vmf(vmf("", "entity { \"id\" \"7\" \"classname\" \"func_areaportalwindow\" \"target\" \"Glass\"\n" +
                                       vmf_solid("tools/toolsareaportal", 8) + "}\n" +
                                       "entity { \"id\" \"17\" \"classname\" \"func_brush\" \"targetname\" \"glass\"\n" + vmf_solid("wall", 18) + "}\n" +
                                       "entity { \"id\" \"27\" \"classname\" \"func_brush\" \"targetname\" \"other\"\n" + vmf_solid("wall", 28) + "}\n"),
                           c);
    EXPECT_EQ(w.brushes.at(1).contents, Contents::area_portal);
    EXPECT_EQ(w.brushes.at(2).contents, Contents::window);
    EXPECT_EQ(w.brushes.at(3).contents, Contents::solid);
}

TEST(Contents, SidesWithoutDynamicShadowAndMissingLightingOrigins) {
    Context c;
    const World w = of_vmf(vmf("", "entity { \"id\" \"7\" \"classname\" \"info_no_dynamic_shadow\" \"sides\" \"21 24 999\" }\n"
                                   "entity { \"id\" \"8\" \"classname\" \"info_lighting\" \"targetname\" \"Lamp\" \"origin\" \"1 2 3\" }\n"
                                   "entity { \"id\" \"9\" \"classname\" \"prop_static\" \"lightingorigin\" \"lamp\" }\n"
                                   "entity { \"id\" \"10\" \"classname\" \"prop_static\" \"lightingorigin\" \"\" }\n"
                                   "entity { \"id\" \"11\" \"classname\" \"prop_static\" \"lightingorigin\" \"gone\" }\n"),
                           c);
    for (std::size_t s = 0; s < 6; ++s) EXPECT_EQ(w.sides[s].no_dynamic_shadow, s == 1 || s == 4) << s; // ids 20..25
    EXPECT_EQ(count(c, "side-missing"), 1u);
    ASSERT_EQ(count(c, "lighting-origin-missing"), 1u);
    EXPECT_EQ(std::ranges::find(c.diagnostics(), "lighting-origin-missing", &Diagnostic::code)->where.entity, 11);
}

TEST(Contents, OnlyWhatTouchesARegionIsCompiled) {
    const std::string far = box({"wall"}, {1000, 0, 0}, {1064, 64, 64});
    const std::string map = entity("worldspawn", box({"wall"}) + far + box({"region"}, {-32, -32, -32}, {200, 100, 100})) +
                            entity("func_wall", far) + entity("func_wall", box({"wall"}, {100, 0, 0}, {120, 9, 9}) + far) +
                            entity("light", "\"origin\" \"50 50 80\"\n") + entity("light", "\"origin\" \"500 50 80\"\n");
    Context c;
    const World w = of_map(map, c);
    ASSERT_EQ(w.entities.size(), 3u); // worldspawn, a func_wall, a light
    EXPECT_EQ(w.entities[2].get("origin"), "50 50 80");
    ASSERT_EQ(w.brushes.size(), 8u); // the brush, six walls, the func_wall's
    for (std::size_t b = 1; b < 7; ++b) {
        EXPECT_EQ(w.brushes[b].contents, Contents::solid);
        EXPECT_TRUE(w.materials[w.sides[w.brushes[b].first_side].material.at()].flags & kNoDraw);
    }
    EXPECT_EQ(w.brushes[7].model.value, 1u);
    ASSERT_EQ(count(c, "outside-region"), 1u);
    EXPECT_EQ(std::ranges::find(c.diagnostics(), "outside-region", &Diagnostic::code)->message,
              "only what the region brushes allow is compiled: 2 entities and 2 brushes are left out");

    Context without;
    const World v = of_map(entity("worldspawn", box({"wall"}) + far + box({"antiregion"}, {-32, -32, -32}, {200, 100, 100})) +
                               entity("light", "\"origin\" \"50 50 80\"\n") + entity("light", "\"origin\" \"500 50 80\"\n"),
                           without);
    EXPECT_EQ(v.brushes.size(), 1u);
    ASSERT_EQ(v.entities.size(), 2u);
    EXPECT_EQ(v.entities[1].get("origin"), "500 50 80");
}

} // namespace
} // namespace kiln

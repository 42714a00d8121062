// Overlays and decals as the entities state them.
#include "compiler/world/world.h"
#include "formats/quake_map/quake_map.h"
#include "formats/vmf/vmf.h"
#include <algorithm>
#include <gtest/gtest.h>

namespace kiln {
namespace {

constexpr const char* kWorld = "world { \"classname\" \"worldspawn\" solid { \"id\" \"2\"\n"
                               "side { \"id\" \"5\" \"plane\" \"(0 0 0) (0 64 0) (64 0 0)\" \"material\" \"wall\" }\n"
                               "side { \"id\" \"6\" \"plane\" \"(0 0 8) (0 64 8) (64 0 8)\" \"material\" \"wall\" } } }\n";
using Keys = std::vector<std::pair<std::string, std::string>>;
const Keys kOverlay{{"classname", "info_overlay"}, {"material", "decals/crack"}, {"sides", "6 5"}, {"BasisOrigin", "1 2 3"}, {"BasisU", "0 2 0"}, {"BasisV", "-1 0 0"}, {"BasisNormal", "0 -0 1"},
                    {"uv0", "-8 -4 0"}, {"uv1", "-8 4 0"}, {"uv2", "8 4 0"}, {"uv3", "8 -4"}, {"StartU", "0.5"}, {"EndU", "1"}, {"StartV", "1"}, {"EndV", "0"}, {"RenderOrder", "3"},
                    {"fademindist", "100"}, {"fademaxdist", "200"}};

std::string entity(const Keys& keys) {
    std::string text = "entity {\n";
    for (const auto& [k, v] : keys) text += "\"" + k + "\" \"" + v + "\"\n";
    return text + "}\n";
}
Keys with(Keys keys, const std::string& name, const std::string& value) {
    for (auto& [k, v] : keys)
        if (k == name) v = value;
    return keys;
}
World world_of(const std::string& text, Context& context) {
    const Result<Document> d = read_vmf({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "t.vmf", context);
    MaterialDatabase materials;
    Result<World> w = build_world(*d, materials, {}, context);
    if (!w) throw std::runtime_error(to_text(w.fault().diagnostic));
    return *std::move(w);
}
std::size_t count(const Context& c, std::string_view code) { return static_cast<std::size_t>(std::ranges::count(c.diagnostics(), code, &Diagnostic::code)); }

TEST(Overlays, AllKeysAreRead) {
    Context c;
    const World w = world_of(kWorld + entity(kOverlay), c);
    ASSERT_EQ(w.overlays.size(), 1u);
    const WorldOverlay& o = w.overlays[0];
    EXPECT_EQ(o.kind, WorldOverlay::overlay);
    EXPECT_EQ(o.entity, EntityId{1});
    EXPECT_EQ(w.materials[o.material.at()].name, "decals/crack");
    EXPECT_EQ(o.origin, (Vec3{1, 2, 3}));
    EXPECT_EQ(o.u, (Vec3{0, 1, 0}));
    EXPECT_EQ(o.v, (Vec3{-1, 0, 0}));
    EXPECT_EQ(o.normal, (Vec3{0, 0, 1}));
    EXPECT_EQ(o.corners[0], (Vec2{-8, -4}));
    EXPECT_EQ(o.corners[3], (Vec2{8, -4}));
    EXPECT_EQ(o.uv_range, (std::array<double, 4>{0.5, 1, 1, 0}));
    EXPECT_EQ(o.render_order, 3);
    EXPECT_EQ(o.fade_min, 100);
    EXPECT_EQ(o.fade_max, 200);
    EXPECT_EQ(o.sides, (std::vector<SideId>{{0}, {1}}));
    EXPECT_EQ(count(c, "overlay-unreadable"), 0u);
}

TEST(Overlays, TheDefaultsOfTheEditorFadeNever) {
    Context c;
    const World w = world_of(kWorld + entity(with(with(kOverlay, "fademindist", "-1"), "fademaxdist", "0")), c);
    EXPECT_LT(w.overlays.at(0).fade_max, 0);
    // A missing side is the side list's to tell.
    const World x = world_of(kWorld + entity(with(kOverlay, "sides", "5 77")), c);
    EXPECT_EQ(x.overlays.at(0).sides, (std::vector<SideId>{{0}}));
    EXPECT_EQ(count(c, "side-missing"), 1u);
}

TEST(Overlays, WhatCannotBeReadIsLeftOutAndTold) {
    std::string text = kWorld;
    for (const auto& [key, value] : Keys{{"material", ""}, {"BasisOrigin", "1 2"}, {"BasisU", "x"}, {"BasisV", "0 1 0"}, {"uv2", "8"}, {"uv1", "1e9 0 0"}, {"BasisNormal", "0 1 0"}})
        text += entity(with(kOverlay, key, value));
    Context c;
    EXPECT_TRUE(world_of(text, c).overlays.empty());
    EXPECT_EQ(count(c, "overlay-unreadable"), 7u);
}

TEST(Overlays, DecalsTakeTheirSizeFromTheMaterial) {
    const Keys decal{{"classname", "infodecal"}, {"texture", "decals/blood"}, {"origin", "1 2 3"}};
    Context c;
    const World w = world_of(kWorld + entity(decal) + entity({{"classname", "infodecal"}, {"texture", "x"}}), c);
    ASSERT_EQ(w.overlays.size(), 1u);
    EXPECT_EQ(w.overlays[0].kind, WorldOverlay::decal);
    EXPECT_EQ(w.overlays[0].corners[2], (Vec2{8, 8})); // 64 texels at a quarter, in both directions from the middle
    EXPECT_EQ(count(c, "overlay-unreadable"), 1u);

    // GoldSrc: a texel a unit.
    const std::string map = "{\n\"classname\" \"worldspawn\"\n{\n( 0 0 0 ) ( 0 1 0 ) ( 1 0 0 ) a 0 0 0 1 1\n( 0 0 8 ) ( 0 1 8 ) ( 1 0 8 ) a 0 0 0 1 1\n}\n}\n"
                            "{\n\"classname\" \"infodecal\"\n\"texture\" \"{lambda06\"\n\"origin\" \"1 2 3\"\n}\n";
    const Result<Document> d = read_quake_map({reinterpret_cast<const std::uint8_t*>(map.data()), map.size()}, "t.map", c);
    ASSERT_TRUE(d);
    MaterialDatabase materials;
    const Result<World> q = build_world(*d, materials, {}, c);
    ASSERT_TRUE(q);
    EXPECT_EQ(q->overlays.at(0).corners[2], (Vec2{32, 32}));
}

} // namespace
} // namespace kiln

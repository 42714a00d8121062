#include "compiler/world/side_list.h"
#include "tests/support/world_builder.h"
#include <gtest/gtest.h>

namespace kiln {
namespace {

using Ids = std::vector<std::uint32_t>;
Ids numbers(const std::vector<SideId>& sides) {
    Ids out;
    for (const SideId s : sides) out.push_back(s.value);
    return out;
}

// Three boxes: sides 0..5 have ids 10..15, sides 6..11 ids 20..25; 12..17 are a copy with ids 10..15 again.
World three_boxes() {
    test::WorldBuilder b;
    for (int i = 0; i < 3; ++i) b.box({100.0 * i, 0, 0}, {100.0 * i + 64, 64, 64});
    for (std::size_t s = 0; s < 18; ++s) b.world.sides[s].id = static_cast<int>(10 * (1 + s / 6 % 2) + s % 6);
    return b.world;
}

TEST(SideList, NamesSidesByTheIdsOfTheirFile) {
    World w = three_boxes();
    Context c;
    EXPECT_EQ(numbers(resolve_side_list(w, "21", 0, {}, c)), (Ids{7}));
    EXPECT_EQ(numbers(resolve_side_list(w, " 25\t20,22;21 20 ", 0, {}, c)), (Ids{6, 7, 8, 11})); // ascending, each once
    EXPECT_EQ(numbers(resolve_side_list(w, "", 0, {}, c)), Ids{});
    EXPECT_EQ(numbers(resolve_side_list(w, "12 24", 0, {}, c)), (Ids{2, 10, 14})); // ids that stand twice: both are meant
    EXPECT_TRUE(c.diagnostics().empty());

    w.included = {"room.vmf"};
    w.brushes[2].file = 1;
    EXPECT_EQ(numbers(resolve_side_list(w, "12", 0, {}, c)), (Ids{2}));
    EXPECT_EQ(numbers(resolve_side_list(w, "12", 1, {}, c)), (Ids{14}));
    EXPECT_TRUE(c.diagnostics().empty());
}

TEST(SideList, MissingIdsAreNamedAtTheList) {
    const World w = three_boxes();
    Context c;
    EXPECT_EQ(numbers(resolve_side_list(w, "99 21 x7 99999999999", 0, {.file = "a.vmf", .line = 7, .entity = 3}, c)), (Ids{7}));
    ASSERT_EQ(c.diagnostics().size(), 1u);
    const Diagnostic& d = c.diagnostics()[0];
    EXPECT_EQ(d.code, "side-missing");
    EXPECT_EQ(d.severity, Severity::warning);
    EXPECT_EQ(d.where.line, 7);
    EXPECT_EQ(d.message, "3 of the 4 sides it names are not in the map: 99, x7, 99999999999");
}

TEST(SideList, TheKeyOfAnEntityAndMapsWithoutIds) {
    test::WorldBuilder b;
    b.box({0, 0, 0}, {64, 64, 64});
    const EntityId e = b.point_entity("info_no_dynamic_shadow", {0, 0, 0}, {{"Sides", "3 7"}});
    Context c;
    EXPECT_EQ(numbers(resolve_side_list(b.world, SideNames(b.world), e, "sides", c)), (Ids{3}));
    ASSERT_EQ(c.diagnostics().size(), 1u);
    EXPECT_EQ(c.diagnostics()[0].where.line, b.world.entities[e.at()].keys.back().line);
    EXPECT_TRUE(resolve_side_list(b.world, SideNames(b.world), e, "no such key", c).empty());
    EXPECT_EQ(c.diagnostics().size(), 1u);
    b.world.format = MapFormat::quake_valve220; // its sides have no ids, only ordinals
    EXPECT_TRUE(resolve_side_list(b.world, SideNames(b.world), e, "sides", c).empty());
}

} // namespace
} // namespace kiln

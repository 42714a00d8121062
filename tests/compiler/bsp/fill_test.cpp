// What lies outside, leaks and their paths, gaps too small to count.
#include "tests/compiler/bsp/support.h"
#include <algorithm>
#include <gmock/gmock.h>

namespace kiln {
namespace {

using test::Built;
using test::WorldBuilder;

double length_of(const std::vector<Vec3>& path) {
    double sum = 0;
    for (std::size_t i = 1; i < path.size(); ++i) sum += length(path[i] - path[i - 1]);
    return sum;
}

// No point of the path is inside a structural brush.
void expect_in_the_open(const Built& b, const std::vector<Vec3>& path) {
    for (std::size_t i = 1; i < path.size(); ++i)
        for (double t = 0; t <= 1; t += 1.0 / 64) {
            const Vec3 p = path[i - 1] + (path[i] - path[i - 1]) * t;
            for (std::size_t k = 0; k < b.csg.brushes.size(); ++k)
                if (b.world.brushes[k].model.value == 0 && b.world.brushes[k].contents == Contents::solid) {
                    ASSERT_GE(test::depth(b.csg, b.csg.brushes[k], p), -1e-3)
                        << "brush " << k << " at " << p.x << ' ' << p.y << ' ' << p.z;
                }
        }
}

// A room whose +x wall (thickness 16) has a square hole of side `hole` with its low corner at y, z.
WorldBuilder room_with_hole(double hole, double y, double z) {
    WorldBuilder w;
    auto walls = w.room({0, 0, 0}, {256, 256, 128});
    w.world.brushes[walls[1].at()].contents = Contents::trigger; // replaced by four pieces
    w.box({256, 0, 0}, {272, y, 128});
    w.box({256, y + hole, 0}, {272, 256, 128});
    w.box({256, y, 0}, {272, y + hole, z});
    w.box({256, y, z + hole}, {272, y + hole, 128});
    return w;
}

TEST(Leak, PathGoesThroughTheHole) {
    WorldBuilder w = room_with_hole(1, 100, 40);
    const EntityId far = w.point_entity("info_player_start", {20, 20, 20});
    const EntityId near = w.point_entity("light", {200, 100, 64});
    const Built b = test::build(w.world);
    ASSERT_TRUE(b.leak);
    EXPECT_NE(b.leak->entity, far);
    EXPECT_EQ(b.leak->entity, near);
    const Vec3 hole = b.leak->hole;
    EXPECT_GE(hole.x, 256);
    EXPECT_LE(hole.x, 272);
    EXPECT_DOUBLE_EQ(hole.y, 100.5);
    EXPECT_DOUBLE_EQ(hole.z, 40.5);
    const auto& path = b.leak->path;
    EXPECT_EQ(path.front(), (Vec3{200, 100, 64}));
    EXPECT_EQ(path.back().x, 288); // the world's box, 16 beyond the wall
    expect_in_the_open(b, path);
    // Straight to the hole and straight out, but for the walls' clearance.
    EXPECT_NEAR(length_of(path), length(Vec3{56, 0.5, 23.5}) + 32, 1.0);
    // The four pieces around the hole.
    ASSERT_GE(b.leak->near.size(), 4u);
    EXPECT_THAT((std::vector<BrushId>{b.leak->near.begin(), b.leak->near.begin() + 4}),
                testing::UnorderedElementsAre(BrushId{6}, BrushId{7}, BrushId{8}, BrushId{9}));
    ASSERT_EQ(b.count("leak"), 1u);
    EXPECT_EQ(b.diagnostics[0].severity, Severity::error);
    EXPECT_EQ(b.diagnostics[0].where.line, b.world.entities[near.at()].line);
    EXPECT_THAT(b.diagnostics[0].message, testing::HasSubstr("light"));
    EXPECT_THAT(b.diagnostics[0].message, testing::HasSubstr("100.5 40.5"));
    // Nothing is filled.
    EXPECT_EQ(b.leaves([](const BspLeaf& l) { return l.outside; }), 0u);
}

TEST(Leak, PathTurnsAroundCorners) {
    // A corridor bends around a wall: the shortest way hugs its end.
    WorldBuilder w = room_with_hole(32, 16, 16);
    w.box({120, 0, 0}, {136, 200, 128});
    w.point_entity("light", {40, 20, 32});
    const Built b = test::build(w.world);
    ASSERT_TRUE(b.leak);
    expect_in_the_open(b, b.leak->path);
    const double least = length(Vec3{80, 180, 0}) + 16 + length(Vec3{120, 152, 0}) + 32;
    EXPECT_GT(length_of(b.leak->path), least - 1);
    EXPECT_LT(length_of(b.leak->path), least * 1.02);
}

TEST(Leak, EachOpeningIsReported) {
    WorldBuilder w = room_with_hole(8, 100, 40);
    w.world.brushes[0].contents = Contents::trigger; // the -x wall too: one big opening
    w.box({-16, 0, 0}, {0, 128, 128});
    w.point_entity("light", {200, 100, 64});
    const Built b = test::build(w.world);
    EXPECT_EQ(b.count("leak"), 2u);
    ASSERT_TRUE(b.leak);
    EXPECT_GT(b.leak->hole.x, 250); // the nearer
    EXPECT_THAT(b.diagnostics[1].message, testing::HasSubstr("(0 192 64)"));
}

TEST(Leak, TheOpeningIsMeasured) {
    for (const double hole : {1., 8., 40.}) {
        WorldBuilder w = room_with_hole(hole, 100, 40);
        w.point_entity("light", {200, 100, 64});
        const Built b = test::build(w.world);
        ASSERT_EQ(b.leaks.size(), 1u);
        EXPECT_DOUBLE_EQ(b.leak->area, hole * hole);
        EXPECT_DOUBLE_EQ(b.leak->width, hole);
        EXPECT_DOUBLE_EQ(b.leak->length, length_of(b.leak->path));
        EXPECT_THAT(b.diagnostics[0].message, testing::HasSubstr(std::to_string(static_cast<int>(hole)) + " wide, " + std::to_string(static_cast<int>(hole * hole)) + " square units"));
    }
    // Of several portals in one plane: the whole hole counts. A hint divides it.
    WorldBuilder w = room_with_hole(40, 100, 40);
    w.box({250, 110, 0}, {280, 120, 128}, Contents::hint);
    w.point_entity("light", {200, 100, 64});
    const Built b = test::build(w.world);
    ASSERT_EQ(b.leaks.size(), 1u);
    EXPECT_NEAR(b.leak->area, 1600, 1e-9);
    EXPECT_NEAR(b.leak->width, 40, 1e-9);
}

// What the designer closed the hole with, if it does not seal, is named.
TEST(Leak, WhatDoesNotSealIsNamed) {
    struct Case {
        Contents contents;
        const char* classname; // nullptr: of the world
        bool into_world;       // merged into it, as func_detail is
        const char* said;
    };
    for (const Case& c : {Case{Contents::detail, "func_detail", true, "it passes through func_detail 10 (line "},
                          Case{Contents::detail, nullptr, true, "detail brush 10 (line "},
                          Case{Contents::solid, "func_door", false, "func_door 10 (line "},
                          Case{Contents::water, nullptr, true, "water brush 10 (line "},
                          Case{Contents::window, "func_breakable", false, "window of func_breakable 10 (line "},
                          Case{Contents::clip, nullptr, true, "clip brush 10 (line "},
                          Case{Contents::area_portal, "func_areaportal", true, "area portal of func_areaportal 10 (line "}}) {
        WorldBuilder w = room_with_hole(16, 100, 40);
        const ModelId model = c.classname ? w.model(c.classname) : ModelId{0};
        const BrushId plug = w.box({256, 96, 36}, {264, 120, 60}, c.contents, model);
        w.box({20, 20, 0}, {60, 60, 60}, Contents::detail); // not in the way
        w.box({190, 90, 0}, {210, 110, 128}, Contents::trigger);
        if (c.into_world) w.world.brushes[plug.at()].model = ModelId{0};
        w.point_entity("light", {200, 100, 64});
        const Built b = test::build(w.world);
        ASSERT_TRUE(b.leak) << c.said;
        EXPECT_THAT(b.leak->passes, testing::ElementsAre(plug)) << c.said;
        const auto leak = std::ranges::find(b.diagnostics, "leak", &Diagnostic::code); // others may be told before
        ASSERT_NE(leak, b.diagnostics.end());
        EXPECT_THAT(leak->message, testing::HasSubstr(c.said));
        EXPECT_THAT(leak->message, testing::HasSubstr("does not seal"));
        EXPECT_THAT(leak->message, testing::HasSubstr("line " + std::to_string(w.world.brushes[plug.at()].line)));
    }
    // A displacement: its brush would have sealed.
    WorldBuilder w = room_with_hole(16, 100, 40);
    const BrushId plug = w.box({256, 96, 36}, {264, 120, 60}, Contents::detail);
    w.world.brushes[plug.at()].displaced = true;
    w.point_entity("light", {200, 100, 64});
    const Built b = test::build(w.world);
    ASSERT_TRUE(b.leak);
    EXPECT_THAT(b.diagnostics[0].message, testing::HasSubstr("displacement"));
}

TEST(Leak, NearestToTheHoleIsNamedFirst) {
    WorldBuilder w = room_with_hole(16, 100, 40);
    const BrushId far = w.box({100, 0, 0}, {110, 256, 128}, Contents::detail), near = w.box({240, 0, 0}, {250, 256, 128}, Contents::detail);
    w.point_entity("light", {50, 100, 64});
    const Built b = test::build(w.world);
    ASSERT_TRUE(b.leak);
    EXPECT_THAT(b.leak->passes, testing::ElementsAre(near, far));
}

// More holes than anyone wants to read about: all are known.
TEST(Leak, AllOfManyOpeningsAreKnown) {
    WorldBuilder w;
    auto walls = w.room({0, 0, 0}, {1024, 256, 128});
    w.world.brushes[walls[5].at()].contents = Contents::trigger; // the ceiling: slats with slits between
    for (int i = 0; i < 32; ++i) w.box({i * 32.0, 0, 128}, {i * 32.0 + 28, 256, 144});
    w.point_entity("light", {512, 128, 64});
    const Built b = test::build(w.world);
    EXPECT_EQ(b.leaks.size(), 32u);
    for (std::size_t i = 0; i < b.leaks.size(); ++i) {
        EXPECT_NEAR(b.leaks[i].width, 4, 1e-9);
        EXPECT_NEAR(b.leaks[i].area, 4 * 256, 1e-9);
        EXPECT_GE(b.leaks[i].length, b.leaks[i ? i - 1 : 0].length);
    }
    ASSERT_EQ(b.count("leak"), 17u);
    EXPECT_THAT(b.diagnostics[16].message, testing::HasSubstr("and 16 more leaks"));
}

TEST(Leak, AllowedLeakIsAWarningAndSeesEverything) {
    WorldBuilder w = room_with_hole(8, 100, 40);
    w.point_entity("light", {200, 100, 64});
    const Built b = test::build(w.world, {.allow_leaks = true});
    ASSERT_TRUE(b.leak);
    EXPECT_EQ(b.count("leak"), 1u);
    EXPECT_EQ(b.diagnostics[0].severity, Severity::warning);
    EXPECT_EQ(b.leaves([](const BspLeaf& l) { return l.outside; }), 0u);
    EXPECT_GT(b.bsp.cluster_count, 6u);
}

TEST(Leak, EntityInTheVoid) {
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 256, 128});
    w.point_entity("light", {128, 128, 64});
    const EntityId lost = w.point_entity("light", {2000, 0, 0});
    const Built b = test::build(w.world);
    ASSERT_TRUE(b.leak);
    EXPECT_EQ(b.leak->entity, lost);
    EXPECT_THAT(b.diagnostics[0].message, testing::HasSubstr("stands in the void"));
}

TEST(Leak, EntityOnAnOuterFaceIsAWarning) {
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 256, 128});
    w.point_entity("light", {128, 128, 64});
    const EntityId on = w.point_entity("light", {-16, 100, 64});
    const Built b = test::build(w.world);
    EXPECT_FALSE(b.leak);
    ASSERT_EQ(b.count("entity-outside"), 1u);
    EXPECT_EQ(b.diagnostics[0].where.line, b.world.entities[on.at()].line);
    // But standing on the floor of an open room is no excuse.
    WorldBuilder open = room_with_hole(16, 100, 40);
    open.point_entity("info_player_start", {128, 128, 0});
    EXPECT_TRUE(test::build(open.world).leak);
}

TEST(Leak, DetailDoesNotSeal) {
    WorldBuilder w = room_with_hole(16, 100, 40);
    w.box({256, 90, 30}, {272, 130, 70}, Contents::detail);
    w.point_entity("light", {200, 100, 64});
    EXPECT_TRUE(test::build(w.world).leak);
}

TEST(Leak, MarksInTheVoidAreNoLeak) {
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 256, 128});
    w.point_entity("env_cubemap", {128, 128, 64}); // shows where inside is
    w.point_entity("info_overlay", {-17, 100, 64});
    const Built b = test::build(w.world);
    EXPECT_FALSE(b.leak);
    EXPECT_TRUE(b.diagnostics.empty());
    EXPECT_EQ(b.bsp.cluster_count, 1u);
}

TEST(Leak, BrushEntitiesAndMergedOnesAreNotPlaced) {
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 256, 128});
    w.point_entity("light", {128, 128, 64});
    const ModelId door = w.model("func_door");
    w.box({100, 100, 0}, {120, 120, 100}, Contents::solid, door);
    w.world.entities.back().origin = {2000, 0, 0}, w.world.entities.back().has_origin = true;
    w.point_entity("func_detail", {3000, 0, 0});
    EXPECT_FALSE(test::build(w.world).leak);
}

TEST(MicroGap, NarrowSlitsAreClosedAndReported) {
    // The wall's two halves do not quite meet. (Planes this far apart are not merged by the CSG.)
    for (const double gap : {0.0625, 0.25}) {
        WorldBuilder w;
        auto walls = w.room({0, 0, 0}, {256, 256, 128});
        w.world.brushes[walls[1].at()].contents = Contents::trigger;
        w.box({256, 0, 0}, {272, 100, 128});
        w.box({256, 100 + gap, 0}, {272, 256, 128});
        w.point_entity("light", {128, 128, 64});
        const Built b = test::build(w.world);
        EXPECT_EQ(b.leak.has_value(), gap > 0.2) << gap;
        ASSERT_EQ(b.count("micro-gap"), gap > 0.2 ? 0u : 1u) << gap;
        if (b.leak) continue;
        EXPECT_THAT(b.diagnostics[0].message, testing::HasSubstr("0.0625 units wide"));
        EXPECT_THAT(b.diagnostics[0].message, testing::HasSubstr("100.031 64)"));
        EXPECT_TRUE(b.bsp.leaves[leaf_at(b.bsp, {300, 300, 300}).at()].outside ||
                    b.bsp.leaves[leaf_at(b.bsp, {280, 100, 64}).at()].outside);
    }
    // With the option off it leaks.
    WorldBuilder w;
    auto walls = w.room({0, 0, 0}, {256, 256, 128});
    w.world.brushes[walls[1].at()].contents = Contents::trigger;
    w.box({256, 0, 0}, {272, 100, 128});
    w.box({256, 100.0625, 0}, {272, 256, 128});
    w.point_entity("light", {128, 128, 64});
    const Built b = test::build(w.world, {.micro_gap = 0});
    EXPECT_TRUE(b.leak);
}

// A sky lid whose edge is a hair askew to the wall's (as in a published level): between the two planes lies a leaf
// thinner than a micro gap that runs along the whole wall inside, and up beside the lid outside. All its portals are
// large; what is small is the way from the one to the other.
TEST(MicroGap, ThinLeavesAlongWallsAreNoWayOut) {
    WorldBuilder w;
    w.box({-16, -16, -16}, {528, 528, 0});
    w.box({-16, 0, 0}, {0, 512, 256});
    w.box({512, 0, 0}, {528, 512, 256});
    w.box({-16, -16, 0}, {528, 0, 256});
    w.box({-16, 512, 0}, {528, 528, 256});
    const std::vector<Vec2> lid{{0.08, -16}, {528, -16}, {528, 528}, {0, 528}}; // touches the wall's edge at one end
    w.prism(lid, 256, 272);
    w.point_entity("light", {256, 256, 128});
    const Built b = test::build(w.world);
    EXPECT_FALSE(b.leak);
    EXPECT_EQ(b.count("micro-gap"), 1u);
    // The wall beside the thin leaf is still seen, all of it.
    double wall = 0;
    for (const VisibleFragment& v : b.bsp.visible)
        if (b.csg.fragments[v.fragment].brush == BrushId{1} && b.bsp.planes.normal(v.polygon.support).x == 1)
            wall += test::polygon_area(points(b.bsp.planes, v.polygon));
    EXPECT_NEAR(wall, 512 * 256, 1e-6);
    // Without the option it is the leak it is.
    EXPECT_TRUE(test::build(w.world, {.micro_gap = 0}).leak);
}

// A crack along the end of a wall, open to the inside on one side of another wall that stands before it and to the outside on
// the other. Something thinner lies in it, and cuts it into leaves on top of one another with wide portals between: through
// these the way along the crack is no wider than it was.
TEST(MicroGap, WhatLiesInACrackDoesNotOpenIt) {
    const auto shell = [](double gap, const std::vector<std::array<double, 2>>& shims) {
        WorldBuilder w;
        w.box({-16, -16, -16}, {548, 272, 0});
        w.box({-16, -16, 256}, {548, 272, 272});
        w.box({-16, -16, 0}, {0, 272, 256});
        w.box({0, -16, 0}, {500, 0, 256});
        w.box({0, 256, 0}, {512, 272, 256});
        w.box({500, -16, 0}, {540, 100, 256});
        w.box({512, 100 + gap, 0}, {528, 272, 256});
        for (const auto& z : shims) w.box({500, 100, z[0]}, {540, 100 + gap / 2, z[1]});
        w.point_entity("light", {200, 200, 200});
        return test::build(w.world);
    };
    using Shims = std::vector<std::array<double, 2>>;
    for (const Shims& shims : {Shims{}, Shims{{100, 140}}, Shims{{0, 140}}, Shims{{0, 4}, {252, 256}}, Shims{{8, 16}, {32, 64}, {128, 192}}}) {
        EXPECT_FALSE(shell(0.125, shims).leak) << shims.size();
        EXPECT_EQ(shell(0.125, shims).count("micro-gap"), 1u) << shims.size();
        EXPECT_TRUE(shell(0.5, shims).leak) << shims.size(); // each half of it is thicker than a micro gap
    }
}

TEST(MicroGap, CracksThatLeadNowhereAreNotReported) {
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 256, 128});
    w.box({272, 0, 0}, {288, 100, 128});     // outside the wall, with a crack between
    w.box({272, 100.0625, 0}, {288, 256, 128});
    w.point_entity("light", {128, 128, 64});
    const Built b = test::build(w.world);
    EXPECT_FALSE(b.leak);
    EXPECT_EQ(b.count("micro-gap"), 0u);
    EXPECT_EQ(b.bsp.cluster_count, 1u); // the crack is outside
}

TEST(Fill, WithoutEntitiesTheSealedInsideStays) {
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 256, 128});
    const Built b = test::build(w.world);
    EXPECT_EQ(b.count("no-entity-inside"), 1u);
    EXPECT_FALSE(b.leak);
    EXPECT_EQ(b.bsp.cluster_count, 1u);
    EXPECT_EQ(b.bsp.leaves[leaf_at(b.bsp, {128, 128, 64}).at()].outside, false);
    EXPECT_EQ(b.bsp.leaves[leaf_at(b.bsp, {-20, 0, 0}).at()].outside, true);
}

TEST(Fill, SealedRoomsNobodyReachesStay) {
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 256, 128});
    w.room({1000, 0, 0}, {1256, 256, 128});
    w.point_entity("light", {128, 128, 64});
    EXPECT_EQ(test::build(w.world).bsp.cluster_count, 2u);
}

TEST(Fill, EntitiesInOrOnSurfaces) {
    // In the floor by less than a unit, exactly on a wall, in a ceiling: all inside. Deep in solid: does not count.
    for (const Vec3 at : {Vec3{128, 128, -0.5}, Vec3{0, 128, 64}, Vec3{128, 128, 128.5}, Vec3{0, 0, 0}}) {
        WorldBuilder w;
        w.room({0, 0, 0}, {256, 256, 128});
        w.point_entity("info_player_start", at);
        const Built b = test::build(w.world);
        EXPECT_TRUE(b.diagnostics.empty()) << at.x << ' ' << at.z;
        EXPECT_EQ(b.bsp.cluster_count, 1u);
    }
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 256, 128});
    w.point_entity("info_player_start", {128, 128, -8});
    EXPECT_EQ(test::build(w.world).count("no-entity-inside"), 1u);
}

} // namespace
} // namespace kiln

// Rooms whose faces, triangles and areas are known.
#include "libs/core/hash.h"
#include "tests/compiler/surfaces/build.h"

namespace kiln {
namespace {

using namespace test;

TEST(Surfaces, CubeRoomIsSixSquares) {
    WorldBuilder b;
    sealed_room(b, {-64, -64, -64}, {64, 64, 64});
    const Surfaces s = build(b.world).surfaces;
    ASSERT_EQ(s.faces.size(), 6u);
    EXPECT_EQ(s.triangles.size(), 12u);
    EXPECT_EQ(s.positions.size(), 8u);
    EXPECT_EQ(s.charts.size(), 6u);
    EXPECT_EQ(s.luxels.size(), 6u * 8 * 8);
    for (const Face& f : s.faces) {
        EXPECT_EQ(f.area, 128.0 * 128);
        EXPECT_TRUE(f.drawn && f.blocks_light && f.hull && !f.sky && !f.two_sided);
        EXPECT_LT(dot(f.normal, f.bounds.center()), 0); // to the air
        EXPECT_EQ(f.clusters.size(), 1u);
    }
    for (const Chart& c : s.charts) {
        EXPECT_EQ(c.width, 10u);
        EXPECT_EQ(c.height, 10u);
        EXPECT_FALSE(c.smooth);
    }
    for (const Luxel& l : s.luxels) {
        EXPECT_EQ(l.area, 1.0f);
        EXPECT_EQ(l.piece_count, 1u);
        EXPECT_EQ(points_of(s, s.pieces[l.first_piece]).size(), 4u);
    }
    EXPECT_EQ(unmatched_hull_edges(s), 0u);
}

// Three boxes on a floor, one on another, corners in the middle of other boxes' edges.
TEST(Surfaces, BoxesWithTJunctionsAreWatertight) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {512, 512, 256});
    b.box({64, 64, 0}, {256, 128, 64});
    b.box({100, 128, 0}, {160, 300, 64});  // flush with the first one's top, corners on its long edge
    b.box({120, 80, 64}, {200, 128, 100}); // stands on it, flush with one side
    const Surfaces s = build(b.world).surfaces;
    EXPECT_EQ(unmatched_hull_edges(s), 0u);
    // Room inside, minus footprints, plus box sides; flush parts vanish.
    const double room = 2 * (512. * 512 + 512. * 256 * 2), top_and_floor = 0; // tops replace what they cover
    const double sides = 2 * (192. + 64) * 64 + 2 * (60. + 172) * 64 - 2 * 60. * 64 + 2 * (80. + 48) * 36;
    EXPECT_NEAR(total_area(s), room + sides + top_and_floor, 1e-6);
}

// The test above must be able to fail: without one triangle its three edges are open.
TEST(Surfaces, UnmatchedEdgesAreCounted) {
    WorldBuilder b;
    sealed_room(b, {-64, -64, -64}, {64, 64, 64});
    Surfaces s = build(b.world).surfaces;
    s.triangles.pop_back(), s.triangle_face.pop_back();
    EXPECT_EQ(unmatched_hull_edges(s), 3u);
}

TEST(Surfaces, PillarLeavesOneFloorWithAHole) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {256, 256, 128});
    b.box({96, 96, 0}, {160, 160, 128});
    const Surfaces s = build(b.world).surfaces;
    const std::vector<FaceId> floor = faces_on(s, {0, 0, 1}, 0);
    ASSERT_EQ(floor.size(), 1u);
    const Face& f = s.faces[floor[0].at()];
    EXPECT_EQ(f.area, 256. * 256 - 64. * 64);
    EXPECT_EQ(f.triangle_count, 8u); // V + 2H - 2 triangles for V = 8 corners and one hole
    EXPECT_EQ(unmatched_hull_edges(s), 0u);
    for (std::uint32_t t = f.first_triangle; t < f.first_triangle + f.triangle_count; ++t) {
        const Vec3 c = (s.positions[s.triangles[t][0]] + s.positions[s.triangles[t][1]] + s.positions[s.triangles[t][2]]) / 3.0;
        EXPECT_FALSE(c.x > 96 && c.x < 160 && c.y > 96 && c.y < 160);
    }
}

// A wall across the floor: one side of one brush, two rooms, two faces.
TEST(Surfaces, PartsThatDoNotTouchAreFacesOfTheirOwn) {
    WorldBuilder b;
    b.room({0, 0, 0}, {256, 256, 128});
    b.point_entity("info_player_start", {64, 64, 64});
    b.point_entity("light", {200, 64, 64});
    b.box({120, 0, 0}, {136, 256, 128});
    const Surfaces s = build(b.world).surfaces;
    EXPECT_EQ(faces_on(s, {0, 0, 1}, 0).size(), 2u);
    EXPECT_EQ(s.faces.size(), 12u);
    EXPECT_EQ(unmatched_hull_edges(s), 0u);
}

// Detail does not split the tree but it covers and is covered.
TEST(Surfaces, DetailTakesPartInTheHull) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {256, 256, 128});
    b.box({32, 32, 0}, {96, 96, 40}, Contents::detail);
    b.box({96, 40, 0}, {128, 60, 40}, Contents::detail);
    const Surfaces s = build(b.world).surfaces;
    EXPECT_EQ(unmatched_hull_edges(s), 0u);
    EXPECT_NEAR(total_area(s), 2 * 256. * 256 + 4 * 256. * 128 + 40 * (4 * 64. + 2 * 32), 1e-6);
}

TEST(Surfaces, PlanesThatMeetInThirdsStayWatertight) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {256, 256, 128});
    b.tetrahedron({{{10, 10, 0}, {110, 20, 0}, {30, 107, 0}, {43, 51, 77}}});
    b.tetrahedron({{{20, 5, -8}, {120, 33, 10}, {60, 117, 5}, {70, 61, 91}}});
    const Surfaces s = build(b.world).surfaces;
    EXPECT_EQ(unmatched_hull_edges(s), 0u);
}

TEST(Surfaces, WhatIsNotDrawnStillBlocks) {
    WorldBuilder b;
    const MaterialId sky = b.material("sky", kSky), nodraw = b.material("nodraw", kNoDraw), unlit = b.material("lava", kNoLight),
                     ghost = b.material("invisible", kInvisible), blocker = b.material("blocklight", kLightBlocker);
    const std::vector<BrushId> walls = b.room({0, 0, 0}, {128, 128, 128});
    b.point_entity("info_player_start", {64, 64, 64});
    const auto paint = [&](BrushId brush, MaterialId m) {
        const WorldBrush& w = b.world.brushes[brush.at()];
        for (std::uint32_t i = 0; i < w.side_count; ++i) b.world.sides[w.first_side + i].material = m;
    };
    paint(walls[5], sky), paint(walls[0], nodraw), paint(walls[1], unlit), paint(walls[2], ghost);
    b.box({40, 40, 40}, {50, 50, 50}, Contents::clip, {0}, blocker);
    const Surfaces s = build(b.world).surfaces;
    EXPECT_EQ(unmatched_hull_edges(s), 0u);
    EXPECT_EQ(s.faces.size(), 6u + 6u);
    EXPECT_EQ(s.charts.size(), 2u); // -z floor and +y wall
    for (const Face& f : s.faces) {
        if (f.material == sky) { EXPECT_TRUE(f.sky && !f.drawn && f.blocks_light && !f.chart.valid()); }
        if (f.material == nodraw) { EXPECT_TRUE(!f.sky && !f.drawn && f.blocks_light && !f.chart.valid()); }
        if (f.material == unlit) { EXPECT_TRUE(f.drawn && f.blocks_light && !f.chart.valid()); }
        if (f.material == ghost) { EXPECT_TRUE(!f.drawn && !f.blocks_light); }
        if (f.material == blocker) { EXPECT_TRUE(!f.drawn && f.blocks_light && !f.hull); }
    }
}

TEST(Surfaces, WaterShowsFromBothSidesAndLetsLightThrough) {
    WorldBuilder b;
    const MaterialId water = b.material("water", kWater | kNoLight), glass = b.material("glass", kTranslucent);
    sealed_room(b, {0, 0, 0}, {256, 256, 128});
    b.box({0, 0, 0}, {256, 256, 32}, Contents::water, {0}, water);
    b.box({100, 100, 64}, {108, 164, 96}, Contents::window, {0}, glass);
    const Surfaces s = build(b.world).surfaces;
    const std::vector<FaceId> surface = faces_on(s, {0, 0, 1}, 32);
    ASSERT_EQ(surface.size(), 1u);
    const Face& w = s.faces[surface[0].at()];
    EXPECT_TRUE(w.drawn && w.two_sided && !w.blocks_light && !w.hull);
    EXPECT_EQ(w.area, 256. * 256);
    std::size_t panes = 0;
    for (const Face& f : s.faces)
        if (f.material == glass) {
            ++panes;
            EXPECT_TRUE(f.drawn && !f.two_sided && !f.blocks_light && f.chart.valid());
        }
    EXPECT_EQ(panes, 6u);
    // Walls are a face above the water line and one below, for fog and the like, lit as one.
    const std::vector<FaceId> wall = faces_on(s, {1, 0, 0}, 0);
    ASSERT_EQ(wall.size(), 2u);
    EXPECT_EQ(std::min(s.faces[wall[0].at()].area, s.faces[wall[1].at()].area), 256. * 32);
    EXPECT_EQ(std::max(s.faces[wall[0].at()].area, s.faces[wall[1].at()].area), 256. * 96);
    EXPECT_EQ(s.faces[wall[0].at()].chart, s.faces[wall[1].at()].chart);
    EXPECT_EQ(unmatched_hull_edges(s), 0u);
}

// A slit that counts as closed: what closes it is black, blocks, and leaves the walls as they are.
TEST(Surfaces, MicroGapsAreClosedByUndrawnFaces) {
    for (const bool detail_in_it : {false, true}) {
        WorldBuilder b;
        auto walls = b.room({0, 0, 0}, {256, 256, 128});
        b.world.brushes[walls[1].at()].contents = Contents::trigger;
        b.box({256, 0, 0}, {272, 100, 128});
        b.box({256, 100.0625, 0}, {272, 256, 128});
        if (detail_in_it) b.box({250, 90, 32}, {280, 110, 64}, Contents::detail); // through the wall
        b.point_entity("info_player_start", {128, 128, 64});
        const Built built = build(b.world);
        EXPECT_TRUE(built.reported("micro-gap"));
        const Surfaces& s = built.surfaces;
        EXPECT_EQ(unmatched_hull_edges(s), 0u) << detail_in_it;
        double closed = 0, drawn = 0;
        for (const Face& f : s.faces) {
            if (f.drawn) {
                if (f.normal == Vec3{-1, 0, 0} && f.distance == -256) drawn += f.area;
                continue;
            }
            closed += f.area; // at the wall's face, or behind it and at the slit's two ends
            EXPECT_TRUE(f.blocks_light && f.hull && !f.sky && !f.chart.valid() && f.side.valid() && f.material.valid());
            EXPECT_TRUE(f.normal.x == -1 || std::abs(f.normal.z) == 1);
            EXPECT_EQ(f.clusters.size(), 1u);
        }
        const double slit = 0.0625 * (detail_in_it ? 96 : 128);
        EXPECT_TRUE(std::abs(closed - slit) < 1e-9 || std::abs(closed - slit - 0.0625 * 2 * 16) < 1e-9) << closed;
        EXPECT_NEAR(drawn, 256 * 128 - 0.0625 * 128 - (detail_in_it ? 32 * (20 - 0.0625) : 0), 1e-6);
    }
}

// A lid a hair askew to the wall under it: the leaf between the two planes is inside, beside the wall and beyond it.
TEST(Surfaces, ThinLeavesOfTheInsideAreClosedWhereTheyLeaveIt) {
    WorldBuilder b;
    b.box({-16, -16, -16}, {528, 528, 0});
    b.box({-16, 0, 0}, {0, 512, 256});
    b.box({512, 0, 0}, {528, 512, 256});
    b.box({-16, -16, 0}, {528, 0, 256});
    b.box({-16, 512, 0}, {528, 528, 256});
    const std::vector<Vec2> lid{{0.08, -16}, {528, -16}, {528, 528}, {0, 528}};
    b.prism(lid, 256, 272);
    b.point_entity("light", {256, 256, 128});
    const Built built = build(b.world);
    EXPECT_FALSE(built.bsp.closed.empty());
    EXPECT_EQ(unmatched_hull_edges(built.surfaces), 0u);
}

TEST(Surfaces, BrushModelsKeepTheirOwnFaces) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {256, 256, 128});
    const ModelId door = b.model("func_door");
    const BrushId brush = b.box({100, 0, 0}, {110, 64, 128}, Contents::solid, door);
    b.world.brushes[brush.at()].casts_light_shadow = false;
    const Surfaces s = build(b.world).surfaces;
    EXPECT_EQ(faces_on(s, {0, 0, 1}, 0).size(), 1u);
    EXPECT_EQ(s.faces[faces_on(s, {0, 0, 1}, 0)[0].at()].area, 256. * 256); // a model covers nothing of the world
    std::size_t own = 0;
    for (const Face& f : s.faces)
        if (f.model == door) {
            ++own;
            EXPECT_TRUE(!f.blocks_light && f.drawn && f.clusters.empty());
        }
    EXPECT_EQ(own, 6u);
    EXPECT_EQ(unmatched_hull_edges(s, {0}), 0u);
    EXPECT_EQ(unmatched_hull_edges(s, door), 0u);
}

TEST(Surfaces, ThreadsAndArchiveChangeNothing) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {512, 512, 256});
    b.box({64, 64, 0}, {256, 128, 64});
    b.tetrahedron({{{10, 10, 0}, {110, 20, 0}, {30, 107, 0}, {43, 51, 77}}});
    const Bytes one = to_bytes(build(b.world, false, 1).surfaces), three = to_bytes(build(b.world, false, 3).surfaces);
    EXPECT_EQ(hash_bytes(one), hash_bytes(three));
    EXPECT_EQ(hash_of(from_bytes<Surfaces>(one)), hash_bytes(one));
}

} // namespace
} // namespace kiln

// Charts and exact luxel footprints.
#include "tests/compiler/surfaces/build.h"
#include <numbers>

namespace kiln {
namespace {

using namespace test;

const Luxel* luxel_at(const Surfaces& s, ChartId chart, Vec3 p) {
    const Chart& c = s.charts[chart.at()];
    const double x = dot(p - c.origin, c.s) / c.luxel_size, y = dot(p - c.origin, c.t) / c.luxel_size;
    for (const Luxel& l : s.luxels)
        if (l.chart == chart && l.x == std::floor(x) && l.y == std::floor(y)) return &l;
    return nullptr;
}

TEST(Luxels, AWallCoversPartOfATexel) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {256, 256, 128});
    b.box({104, 100, 0}, {200, 110, 128}); // 16 unit texels: covers y 100..110 of the row 96..112; too short to part the chart
    const Surfaces s = build(b.world).surfaces;
    const std::vector<FaceId> floor = faces_on(s, {0, 0, 1}, 0);
    ASSERT_EQ(floor.size(), 1u);
    const ChartId chart = s.faces[floor[0].at()].chart;
    EXPECT_NEAR(footprint_area(s, chart), 256. * 256 - 96. * 10, 1e-2);
    const Luxel* partly = luxel_at(s, chart, {120, 104, 0});
    ASSERT_NE(partly, nullptr);
    EXPECT_NEAR(partly->area, 6.0 / 16, 1e-7); // 4 units on one side, 2 on the other
    EXPECT_EQ(partly->piece_count, 2u);
    const Luxel* corner = luxel_at(s, chart, {196, 104, 0});
    ASSERT_NE(corner, nullptr);
    EXPECT_NEAR(corner->area, 1 - (8. * 10) / 256, 1e-7); // x 192..200
    const Luxel* open = luxel_at(s, chart, {232, 104, 0});
    ASSERT_NE(open, nullptr);
    EXPECT_EQ(open->area, 1.0f);
    EXPECT_EQ(open->piece_count, 1u); // whole, however the tree cut the floor
}

TEST(Luxels, ACoveredTexelIsNone) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {256, 256, 128});
    b.box({64, 64, 0}, {128, 128, 128});
    const Surfaces s = build(b.world).surfaces;
    const ChartId chart = s.faces[faces_on(s, {0, 0, 1}, 0)[0].at()].chart;
    EXPECT_EQ(luxel_at(s, chart, {100, 100, 0}), nullptr);
    EXPECT_EQ(std::ranges::count(s.luxels, chart, &Luxel::chart), 16 * 16 - 4 * 4);
}

// A floor turned by 30 degrees under a texture that is turned with it, and one that is not.
TEST(Luxels, RotatedFootprintsSumToTheArea) {
    for (const double turn : {0.0, 30.0, 77.0}) {
        WorldBuilder b;
        sealed_room(b, {0, 0, 0}, {200, 120, 100});
        const double a = turn * std::numbers::pi / 180;
        for (WorldSide& side : b.world.sides)
            if (side.texture.v_axis == Vec3{0, -1, 0})
                side.texture.u_axis = {std::cos(a), std::sin(a), 0}, side.texture.v_axis = {std::sin(a), -std::cos(a), 0};
        const Surfaces s = build(b.world).surfaces;
        for (std::size_t c = 0; c < s.charts.size(); ++c) {
            double area = 0;
            for (const FaceId f : s.charts[c].faces) area += s.faces[f.at()].area;
            EXPECT_NEAR(footprint_area(s, id<ChartId>(c)), area, 1e-6 * area);
        }
    }
}

TEST(Luxels, EachSideHasItsOwnSize) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {128, 128, 128});
    for (WorldSide& side : b.world.sides) side.lightmap_scale = side.texture.v_axis == Vec3{0, -1, 0} ? 4 : 32;
    const Surfaces s = build(b.world).surfaces;
    EXPECT_EQ(s.luxels.size(), 2u * 32 * 32 + 4u * 4 * 4);
}

// Two brushes side by side make one floor: one lattice, one chart, two faces.
TEST(Charts, CoplanarNeighboursShareAGrid) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {256, 256, 128});
    b.box({0, 0, 0}, {100, 256, 8});
    b.box({100, 0, 0}, {256, 256, 8});
    const Surfaces s = build(b.world).surfaces;
    const std::vector<FaceId> floor = faces_on(s, {0, 0, 1}, 8);
    ASSERT_EQ(floor.size(), 2u);
    EXPECT_EQ(s.faces[floor[0].at()].chart, s.faces[floor[1].at()].chart);
    const Luxel* shared = luxel_at(s, s.faces[floor[0].at()].chart, {100, 8, 8});
    ASSERT_NE(shared, nullptr);
    EXPECT_EQ(shared->area, 1.0f);
    EXPECT_EQ(shared->piece_count, 2u); // one of each face
    EXPECT_EQ(s.faces[shared->face.at()].bounds.lo.x, 100); // 96..100 against 100..112
}

// The same floor with different luxel sizes: two charts with a seam between.
TEST(Charts, CoplanarNeighboursOfOtherSizeMeetInASeam) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {256, 256, 128});
    b.box({0, 0, 0}, {100, 256, 8});
    const BrushId fine = b.box({100, 0, 0}, {256, 256, 8});
    for (std::uint32_t i = 0; i < 6; ++i) b.world.sides[b.world.brushes[fine.at()].first_side + i].lightmap_scale = 4;
    const Surfaces s = build(b.world).surfaces;
    ASSERT_EQ(s.seams.size(), 1u);
    EXPECT_EQ(s.positions[s.seams[0].from].x, 100);
    EXPECT_EQ(s.positions[s.seams[0].to].x, 100);
}

TEST(Charts, LatticesAreAnchoredToTheWorld) {
    WorldBuilder b;
    sealed_room(b, {-37, 5, 3}, {219, 250, 101});
    const Surfaces s = build(b.world).surfaces;
    for (const Chart& c : s.charts)
        for (const Vec3& axis : {c.s, c.t}) {
            const double lines = dot(c.origin, axis) / c.luxel_size;
            EXPECT_NEAR(lines, std::round(lines), 1e-9);
        }
}

TEST(Charts, TooLargeBecomesCoarser) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {4096, 256, 64});
    for (WorldSide& side : b.world.sides) side.lightmap_scale = 1;
    for (const WorldBrush& brush : b.world.brushes)
        for (std::uint32_t i = 0; i < 6; ++i) b.world.sides[brush.first_side + i].lightmap_scale = &brush == &b.world.brushes[4] ? 1 : 64;
    const Built built = build(b.world);
    EXPECT_TRUE(built.reported("chart-too-large"));
    const Chart& floor = built.surfaces.charts[built.surfaces.faces[faces_on(built.surfaces, {0, 0, 1}, 0)[0].at()].chart.at()];
    EXPECT_EQ(floor.luxel_size, 4);
    EXPECT_EQ(floor.width, 1026u);
}

} // namespace
} // namespace kiln

// Which contents hide which, and who owns shared faces.
#include "measure.h"

namespace kiln::test {
namespace {

double area(const Csg& csg, std::uint32_t brush, auto&& wanted) {
    Boundary b;
    for (const Fragment& f : csg.fragments)
        if (f.brush.value == brush && wanted(f)) add(b, csg.planes, f.polygon);
    return b.area;
}
double area(const Csg& csg, std::uint32_t brush) {
    return area(csg, brush, [](const Fragment&) { return true; });
}

TEST(CsgCoverage, OppositeFacesOfEqualsVanish) {
    WorldBuilder w;
    w.box({0, 0, 0}, {64, 64, 64});
    w.box({64, 16, 16}, {128, 48, 48});
    const Csg csg = compile(w.world);
    EXPECT_EQ(area(csg, 0), 6 * 64 * 64 - 32 * 32);
    EXPECT_EQ(area(csg, 1), 4 * 64 * 32 + 32 * 32);
}

TEST(CsgCoverage, OfEqualFacesTheEarlierBrushHasIt) {
    WorldBuilder w;
    w.box({0, 0, 0}, {64, 64, 64});
    w.box({32, 0, 0}, {96, 64, 64}); // four of its sides are in the planes of the first
    const Csg csg = compile(w.world);
    EXPECT_EQ(area(csg, 0), 64 * 64 + 4 * 64 * 64);
    EXPECT_EQ(area(csg, 1), 64 * 64 + 4 * 32 * 64);
    EXPECT_DOUBLE_EQ(boundary(csg).volume, 96 * 64 * 64);
}

TEST(CsgCoverage, StrongerHasTheSharedFaceWhateverTheOrder) {
    WorldBuilder w;
    w.box({0, 0, 0}, {64, 64, 64}, Contents::detail);
    w.box({32, 0, 0}, {96, 64, 64}, Contents::solid);
    const Csg csg = compile(w.world);
    EXPECT_EQ(area(csg, 1), 6 * 64 * 64);
    EXPECT_EQ(area(csg, 0), 64 * 64 + 4 * 32 * 64);
}

TEST(CsgCoverage, DetailCoversButDoesNotCutTheStructuralHull) {
    WorldBuilder w;
    w.box({0, 0, 0}, {128, 128, 16});
    w.box({32, 32, 16}, {64, 64, 48}, Contents::detail); // stands on it
    w.box({96, 96, 8}, {112, 112, 48}, Contents::detail); // reaches into it
    const Csg csg = compile(w.world);
    const Boundary hull = boundary(csg);
    EXPECT_LT(hull.closure(), 1e-15);
    EXPECT_DOUBLE_EQ(hull.volume, 128 * 128 * 16);
    EXPECT_EQ(area(csg, 0, [](const Fragment& f) { return f.covered; }), 32 * 32 + 16 * 16);
    EXPECT_EQ(area(csg, 1), 5 * 32 * 32);            // the face it stands on is gone
    EXPECT_EQ(area(csg, 2), 16 * 16 + 4 * 16 * 32);  // and so is what is inside the floor
    for (const Fragment& f : csg.fragments) EXPECT_EQ(f.covered, f.front == Contents::detail);
}

TEST(CsgCoverage, GlassHidesNothing) {
    WorldBuilder w;
    w.box({0, 0, 0}, {128, 128, 16});
    w.box({32, 32, 16}, {64, 64, 48}, Contents::window);
    const Csg csg = compile(w.world);
    EXPECT_EQ(area(csg, 0), 2 * 128 * 128 + 4 * 128 * 16);
    EXPECT_EQ(area(csg, 0, [](const Fragment& f) { return f.front == Contents::window; }), 32 * 32);
    EXPECT_EQ(area(csg, 1), 32 * 32 + 4 * 32 * 32); // its own face against the floor cannot be seen
}

TEST(CsgCoverage, WaterInABasin) {
    WorldBuilder w;
    w.room({0, 0, 0}, {128, 128, 64});
    w.box({-8, -8, -8}, {136, 136, 32}, Contents::water); // reaches into walls and floor
    const Csg csg = compile(w.world);
    const double wet = area(csg, 0, [](const Fragment& f) { return f.front == Contents::water; });
    EXPECT_EQ(wet, 128 * 32); // the lower half of the -x wall's inner side
    EXPECT_EQ(area(csg, 6), 128 * 128);
    for (const Fragment& f : csg.fragments)
        if (f.brush.value == 6) {
            EXPECT_TRUE(f.both_sides);
            EXPECT_EQ(f.front, Contents::empty);
            EXPECT_EQ(csg.planes.normal(f.polygon.support), (Vec3{0, 0, 1}));
        } else {
            EXPECT_FALSE(f.both_sides);
        }
}

TEST(CsgCoverage, OfTwoWeakerBrushesTheStrongerIsInFront) {
    WorldBuilder w;
    w.box({0, 0, 0}, {64, 64, 16});
    w.box({0, 0, 16}, {64, 64, 64}, Contents::water);
    w.box({0, 0, 16}, {32, 64, 64}, Contents::window);
    const Csg csg = compile(w.world);
    EXPECT_EQ(area(csg, 0, [](const Fragment& f) { return f.front == Contents::window; }), 32 * 64);
    EXPECT_EQ(area(csg, 0, [](const Fragment& f) { return f.front == Contents::water; }), 32 * 64);
    // Water against glass: the glass keeps the face.
    EXPECT_EQ(area(csg, 2, [](const Fragment& f) { return f.front == Contents::water; }), 64 * 48);
    EXPECT_EQ(area(csg, 1), 64 * 48 + 2 * 32 * 48 + 32 * 64);
}

TEST(CsgCoverage, ModelsDoNotCutEachOther) {
    WorldBuilder w;
    w.box({0, 0, 0}, {64, 64, 64});
    const ModelId door = w.model("func_door"), lift = w.model("func_plat");
    w.box({32, 0, 0}, {96, 64, 64}, Contents::solid, door);
    w.box({32, 0, 0}, {96, 64, 64}, Contents::solid, lift);
    w.box({96, 0, 0}, {128, 64, 64}, Contents::solid, door);
    const Csg csg = compile(w.world);
    EXPECT_EQ(area(csg, 0), 6 * 64 * 64);
    EXPECT_EQ(area(csg, 2), 6 * 64 * 64);
    EXPECT_EQ(area(csg, 1), 5 * 64 * 64);
    EXPECT_DOUBLE_EQ(boundary(csg, Contents::solid, door).volume, 96 * 64 * 64);
}

TEST(CsgCoverage, ToolBrushesCarveNothing) {
    WorldBuilder w;
    w.box({0, 0, 0}, {64, 64, 64});
    const MaterialId skip = w.material("skip", kSkip), hint = w.material("hint", kHint);
    w.box({32, 0, 0}, {96, 64, 64}, Contents::clip);
    w.box({32, 0, 0}, {96, 64, 64}, Contents::trigger);
    w.box({32, 0, 0}, {96, 64, 64}, Contents::area_portal);
    const BrushId b = w.box({32, 0, 0}, {96, 64, 64}, Contents::hint, {0}, skip);
    w.world.sides[w.world.brushes[b.at()].first_side + 1].material = hint;
    const Csg csg = compile(w.world);
    EXPECT_EQ(area(csg, 0), 6 * 64 * 64);
    EXPECT_EQ(area(csg, 1), 0);
    EXPECT_EQ(area(csg, 2), 0);
    EXPECT_EQ(area(csg, 3), 6 * 64 * 64);
    EXPECT_EQ(area(csg, 4), 64 * 64);
    EXPECT_EQ(csg.fragments.back().behind, Contents::hint);
    EXPECT_EQ(csg.planes.normal(csg.fragments.back().polygon.support), (Vec3{1, 0, 0}));
}

TEST(CsgCoverage, MixedContentsStillCloseTheHull) {
    std::mt19937_64 rng(21);
    for (int round = 0; round < 4; ++round) {
        WorldBuilder w, structural;
        std::mt19937_64 same = rng;
        for (int i = 0; i < 80; ++i) {
            const Contents kinds[] = {Contents::solid, Contents::detail, Contents::window, Contents::water};
            random_brush(w, rng, 90, 60, 1, kinds[i % 4]);
        }
        for (int i = 0; i < 80; ++i) {
            WorldBuilder dropped;
            random_brush(i % 4 == 0 ? structural : dropped, same, 90, 60, 1, Contents::solid);
        }
        const Csg csg = compile(w.world, {.plane_merge_distance = 0});
        const Boundary hull = boundary(csg), alone = boundary(compile(structural.world, {.plane_merge_distance = 0}));
        EXPECT_LT(hull.closure(), 1e-13);
        EXPECT_NEAR(hull.area, alone.area, 1e-11 * alone.area);
        EXPECT_NEAR(hull.volume, alone.volume, 1e-11 * alone.volume);
    }
}

} // namespace
} // namespace kiln::test

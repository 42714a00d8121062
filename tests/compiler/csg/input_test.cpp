// From text to planes: grids, rounding, merging, faults.
#include "measure.h"

namespace kiln::test {
namespace {

std::vector<std::string> codes(const World& world, bool expect_value = true) {
    Context context;
    const Result<Csg> csg = build_csg(world, {}, context);
    EXPECT_EQ(static_cast<bool>(csg), expect_value);
    if (csg) validate(*csg, world);
    std::vector<std::string> result;
    for (const Diagnostic& d : context.diagnostics()) {
        if (d.severity == Severity::error) {
            EXPECT_GT(d.where.line, 0) << d.message;
            EXPECT_GE(d.where.brush, 0) << d.message;
        }
        result.push_back(d.code);
    }
    if (!csg) result.push_back(csg.fault().diagnostic.code);
    return result;
}
using Codes = std::vector<std::string>;

TEST(CsgInput, GridIsTheCoarsestThatHoldsEveryPoint) {
    const auto bits = [](double x) {
        WorldBuilder w;
        w.box({0, 0, 0}, {64, 64, 64});
        w.box({0, 0, 64}, {64, 64, x});
        const Csg csg = compile(w.world);
        EXPECT_EQ(csg.report.grid_bits, csg.planes.grid_bits);
        return csg.report;
    };
    EXPECT_EQ(bits(128).grid_bits, 0);
    EXPECT_EQ(bits(128.5).grid_bits, 1);
    EXPECT_EQ(bits(128.375).grid_bits, 3);
    EXPECT_EQ(bits(128 + 0x1p-10).grid_bits, 10);
    EXPECT_EQ(bits(128 + 0x1p-10).rounded_sides, 0u);
    EXPECT_EQ(bits(128.1).grid_bits, 10);
    EXPECT_GT(bits(128.1).rounded_sides, 0u);
    EXPECT_LT(bits(128.1).largest_rounding, 0x1p-10);
}

TEST(CsgInput, BoxesThatMissEachOtherByAHairAbut) {
    for (const double gap : {1e-3, -1e-3, 0.015, -0.015}) {
        WorldBuilder w;
        w.box({0, 0, 0}, {64, 64, 64});
        w.box({64 + gap, 0, 0}, {128, 64, 64});
        const Csg csg = compile(w.world);
        EXPECT_EQ(csg.report.merged_planes, 1u) << gap;
        EXPECT_NEAR(csg.report.largest_move, std::fabs(gap), 1e-3);
        EXPECT_EQ(csg.report.largest_move_brush, BrushId{1});
        const Boundary b = boundary(csg);
        EXPECT_EQ(b.fragments, 10u); // the two faces between them are gone
        EXPECT_DOUBLE_EQ(b.volume, 128 * 64 * 64);
    }
    WorldBuilder w; // too far: a slit by design
    w.box({0, 0, 0}, {64, 64, 64});
    w.box({64.0625, 0, 0}, {128, 64, 64});
    EXPECT_EQ(compile(w.world).report.merged_planes, 0u);
}

// A floor tile whose three points are a unit apart and rounded to 3 decimals: over its 512 units the plane of the
// rounded points would be off by half a unit.
TEST(CsgInput, PlaneFromClosePointsIsNotTiltedByTheGrid) {
    WorldBuilder w;
    auto sides = WorldBuilder::box_sides({0, 0, 0}, {512, 512, 16});
    // The top: z = 16 + x / 1000, given by points one unit apart at the corner.
    sides[5] = {Vec3{0, 0, 16}, {0, 1, 16}, {1, 0, 16.001}};
    w.brush(sides);
    const Csg csg = compile(w.world);
    EXPECT_EQ(csg.report.rounded_sides, 1u);
    EXPECT_LT(csg.report.largest_rounding, 1e-3);
    EXPECT_NEAR(csg.brushes[0].bounds.hi.z, 16.512, 1e-3);
}

TEST(CsgInput, SimplerPlaneWins) {
    // A is tilted by 4 / 1024 over 256 units, B beside it is level: A's top becomes B's.
    for (const bool tilted_first : {true, false}) {
        WorldBuilder w;
        auto tilted = WorldBuilder::box_sides({0, 0, 0}, {256, 64, 16});
        tilted[5] = {Vec3{0, 0, 16}, {0, 64, 16}, {256, 0, 16 + 0x1p-8}};
        if (tilted_first) w.brush(tilted);
        w.box({256, 0, 0}, {320, 64, 16});
        if (!tilted_first) w.brush(tilted);
        const Csg csg = compile(w.world);
        EXPECT_EQ(csg.report.merged_planes, 1u);
        EXPECT_DOUBLE_EQ(csg.report.largest_move, 0x1p-8);
        for (const BrushPolytope& b : csg.brushes) EXPECT_EQ(b.bounds.hi.z, 16);
    }
}

TEST(CsgInput, AChainOfAlmostEqualPlanesDoesNotDrift) {
    WorldBuilder w; // each 0.01 higher than the one before: ten of them are 0.1 apart
    for (int i = 0; i < 10; ++i) w.box({i * 64.0, 0, 0}, {i * 64.0 + 64, 64, 64 + i * 0.01});
    const Csg csg = compile(w.world);
    EXPECT_GT(csg.report.merged_planes, 0u);
    EXPECT_LE(csg.report.largest_move, 1.0 / 32);
    for (int i = 0; i < 10; ++i) EXPECT_NEAR(csg.brushes[static_cast<std::size_t>(i)].bounds.hi.z, 64 + i * 0.01, 1.0 / 32 + 1e-3);
    EXPECT_LT(boundary(csg).closure(), 1e-14);
}

// Segments of a vault drawn on whole units; a tool's arithmetic has since moved each number a little, on its own.
void vault(WorldBuilder& w, const std::function<double()>& off) {
    const Vec2 outer[] = {{0, 160}, {64, 224}, {160, 256}, {256, 224}, {320, 160}}, inner[] = {{16, 160}, {72, 212}, {160, 240}, {248, 212}, {304, 160}};
    for (std::size_t i = 0; i + 1 < std::size(outer); ++i) {
        const Vec2 section[] = {outer[i], outer[i + 1], inner[i + 1], inner[i]}; // clockwise in x, z
        std::vector<SidePoints> sides;
        const auto at = [&](Vec2 p, double y) { return Vec3{p.x + off(), y, p.y + off()}; };
        for (std::size_t k = 0; k < 4; ++k) {
            const Vec2 p = section[k], q = section[(k + 1) % 4];
            sides.push_back({at(p, 4000), at(q, 4000), at(q, -416)});
        }
        sides.push_back({Vec3{0, 4000, 0}, {64, 4000, 0}, {0, 4000, 64}}), sides.push_back({Vec3{0, -416, 0}, {0, -416, 64}, {64, -416, 0}});
        w.brush(sides);
    }
}

TEST(CsgInput, SidesDrawnOnWholeUnitsReturnThere) {
    WorldBuilder clean;
    vault(clean, [] { return 0.0; });
    const Csg drawn = compile(clean.world);
    for (const double error : {0.001, 0.003, 0.006}) { // where planes meet at shallow angles corners move by several times that
        SCOPED_TRACE(error);
        std::mt19937_64 random(7);
        WorldBuilder spoiled;
        vault(spoiled, [&] { return (static_cast<int>(random() % 3) - 1) * error; });
        const Csg csg = compile(spoiled.world);
        EXPECT_GT(csg.report.merged_planes, 8u);
        EXPECT_LE(csg.report.largest_move, 1.0 / 32);
        ASSERT_EQ(csg.fragments.size(), drawn.fragments.size());
        for (std::size_t i = 0; i < csg.fragments.size(); ++i) {
            const PlaneId a = csg.fragments[i].polygon.support, b = drawn.fragments[i].polygon.support;
            EXPECT_EQ(csg.planes.normal(a), drawn.planes.normal(b));
            EXPECT_EQ(csg.planes.distance(a), drawn.planes.distance(b));
        }
    }
}

// The first panel alone would go to 64; the second, which it fits, is too far off for that. Both stay.
TEST(CsgInput, PanelsThatFitAreNotTornByWholeUnits) {
    WorldBuilder w;
    const auto panel = [&](double x0, double x1) {
        auto sides = WorldBuilder::box_sides({x0, 0, 0}, {x1, 64, 64});
        const auto top = [](double x) { return 64.0204 + (x - 64) * 0.0003; }; // 64.0012 over 0, 64.0396 over 128
        sides[5] = {Vec3{x0, 0, top(x0)}, {x0, 64, top(x0)}, {x1, 0, top(x1)}};
        w.brush(sides);
    };
    panel(0, 64), panel(64, 128);
    const Csg csg = compile(w.world);
    PlaneId top[2];
    for (std::size_t b = 0; b < 2; ++b)
        for (const PlanePolygon& f : csg.brushes[b].faces)
            if (csg.planes.normal(f.support).z > 0.9) top[b] = f.support;
    EXPECT_EQ(top[0], top[1]);
    EXPECT_NEAR(csg.brushes[1].bounds.hi.z, 64.0396, 2e-3);
}

TEST(CsgInput, BrushesThinnerThanTheToleranceStay) {
    WorldBuilder w;
    w.box({0, 0, 0}, {64, 64, 0.01}); // a decal-like sheet on a block
    w.box({0, 0, -64}, {64, 64, 0});
    w.box({64, 0, 0}, {128, 64, 0.005});
    const Csg csg = compile(w.world);
    for (const BrushPolytope& b : csg.brushes) {
        EXPECT_TRUE(b.valid);
        EXPECT_EQ(b.faces.size(), 6u);
    }
    EXPECT_EQ(csg.report.invalid_brushes, 0u);
}

TEST(CsgInput, FaultsAreLocatedAndTheBrushLeftOut) {
    const auto good_sides = WorldBuilder::box_sides({0, 0, 0}, {64, 64, 64});
    const auto with = [&](std::size_t side, SidePoints points) {
        auto sides = good_sides;
        sides[side] = points;
        return sides;
    };
    const auto check = [&](const std::vector<SidePoints>& bad, const Codes& expected) {
        WorldBuilder w;
        w.box({128, 0, 0}, {192, 64, 64});
        w.brush(bad);
        EXPECT_EQ(codes(w.world), expected);
        const Csg csg = compile(w.world);
        EXPECT_FALSE(csg.brushes[1].valid);
        EXPECT_TRUE(csg.brushes[0].valid);
        EXPECT_EQ(csg.fragments.size(), 6u);
        EXPECT_EQ(csg.report.invalid_brushes, 1u);
        WorldBuilder alone;
        alone.brush(bad);
        Codes and_fault = expected;
        and_fault.push_back("nothing-to-compile");
        EXPECT_EQ(codes(alone.world, false), and_fault);
    };
    check(with(2, {Vec3{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}), {"plane-collinear"});
    check(with(2, {Vec3{0, 0, 0}, {0, 0, 0}, {2, 2, 2}}), {"plane-collinear"});
    check(with(2, {Vec3{0.1, 0.1, 0.1}, {0.2, 0.2, 0.2}, {0.7, 0.7, 0.7}}), {"plane-collinear"});
    check(std::vector<SidePoints>(good_sides.begin(), good_sides.end() - 1), {"brush-unbounded"});
    check(std::vector<SidePoints>(good_sides.begin(), good_sides.begin() + 3), {"brush-unbounded"});
    check(with(5, {Vec3{0, 0, 0}, {0, 64, 0}, {64, 0, 0}}), {"brush-empty"});  // no thickness
    check(WorldBuilder::box_sides({0, 0, 0}, {64, 64, -16}), {"brush-empty"}); // sides swapped
    auto inside_out = good_sides;
    for (SidePoints& s : inside_out) std::swap(s[1], s[2]);
    check(inside_out, {"brush-empty"});
    check(with(0, {Vec3{-1e9, 0, 0}, {-1e9, 64, 0}, {-1e9, 0, 64}}), {"coordinate-range"});
}

TEST(CsgInput, RedundantAndDuplicateSidesAreHarmless) {
    WorldBuilder w;
    auto sides = WorldBuilder::box_sides({0, 0, 0}, {64, 64, 64});
    sides.push_back({Vec3{80, 0, 0}, {80, 0, 64}, {80, 64, 0}}); // beyond +x
    sides.push_back({Vec3{64, 64, 0}, {65, 63, 0}, {64, 64, 64}}); // touches an edge
    sides.push_back(sides[1]);
    w.brush(sides);
    EXPECT_EQ(codes(w.world), Codes{"plane-duplicate"});
    const Csg csg = compile(w.world);
    EXPECT_EQ(csg.brushes[0].faces.size(), 6u);
    EXPECT_EQ(csg.report.redundant_sides, 3u);
    EXPECT_DOUBLE_EQ(boundary(csg).volume, 64.0 * 64 * 64);
}

TEST(CsgInput, NoBrushesIsAFault) {
    EXPECT_EQ(codes(WorldBuilder().world, false), Codes{"nothing-to-compile"});
}

TEST(CsgInput, PlanesThatAreAlmostParallelMeetWhereTheyShould) {
    // Two tops 1e-7 from parallel on a wedge 2^17 long; their ridge lies at x = 2^16 exactly.
    const double l = 131072;
    WorldBuilder w;
    auto sides = WorldBuilder::box_sides({-l, -64, 0}, {l, 64, 64});
    const double h = 0x1p-6; // over 2^17: 1.2e-7
    sides[5] = {Vec3{-l, 0, 32}, {-l, 1, 32}, {l, 0, 32 + h}};
    sides.push_back({Vec3{-l, 0, 32 + h}, {-l, 1, 32 + h}, {l, 0, 32}});
    w.brush(sides);
    const Csg csg = compile(w.world);
    ASSERT_TRUE(csg.brushes[0].valid);
    EXPECT_EQ(csg.brushes[0].faces.size(), 7u);
    EXPECT_DOUBLE_EQ(csg.brushes[0].bounds.hi.z, 32 + h / 2);
    const Boundary b = boundary(csg);
    EXPECT_LT(b.closure(), 1e-15);
    EXPECT_NEAR(b.volume, 2 * l * 128 * (32 + h / 4), 1e-3);
}

TEST(CsgInput, ManySidedBrush) {
    WorldBuilder w;
    std::vector<Vec2> ring;
    for (int i = 0; i < 64; ++i) {
        const double a = 2 * 3.14159265358979323846 * (i + 0.3) / 64;
        ring.push_back({std::round(std::cos(a) * 1e6) / 1e3, std::round(std::sin(a) * 1e6) / 1e3});
    }
    w.prism(ring, 0, 256);
    double twice = 0;
    for (std::size_t i = 0; i < 64; ++i) twice += cross(ring[i], ring[(i + 1) % 64]);
    const Csg csg = compile(w.world);
    EXPECT_EQ(csg.brushes[0].faces.size(), 66u);
    const Boundary b = boundary(csg);
    EXPECT_LT(b.closure(), 1e-14);
    EXPECT_NEAR(b.volume, twice / 2 * 256, 1e-6 * b.volume);
}

// Planes at random, near each other, near one point, near parallel, on and off the grid: whatever comes of them is
// sound (compile() validates) and closed, and what is not a brush is reported.
TEST(CsgInput, RandomSidesMakeSoundBrushesOrNone) {
    std::mt19937_64 rng(77);
    int valid = 0, invalid = 0;
    for (int round = 0; round < 30; ++round) {
        WorldBuilder w;
        w.box({-8, -8, -8}, {8, 8, 8});
        const double scale = std::pow(10.0, uniform(rng, -1, 5)), decimals = std::pow(10.0, static_cast<double>(rng() % 8));
        for (int b = 0; b < 40; ++b) {
            std::vector<SidePoints> sides;
            const std::size_t count = 4 + rng() % 9;
            if (b % 2 == 0) sides = WorldBuilder::box_sides({-scale, -scale, -scale}, {scale, scale, scale});
            while (sides.size() < count) {
                SidePoints s;
                const Vec3 near = random_point(rng, scale, 3);
                const double spread = scale * std::pow(10.0, uniform(rng, -6, 0));
                for (Vec3& p : s) p = near + random_point(rng, spread, 10);
                if (rng() % 3 == 0 && !sides.empty()) { // all but another side of the brush
                    s = sides[rng() % sides.size()];
                    for (Vec3& p : s) p += random_point(rng, scale * 1e-4, 10);
                }
                for (Vec3& p : s)
                    for (std::size_t k = 0; k < 3; ++k) p[k] = std::round(p[k] * decimals) / decimals;
                // Towards the outside of most brushes: the origin behind.
                if (dot(cross(s[2] - s[0], s[1] - s[0]), s[0]) < 0) std::swap(s[1], s[2]);
                sides.push_back(s);
            }
            w.brush(sides);
        }
        const Csg csg = compile(w.world);
        EXPECT_LT(boundary(csg).closure(), 1e-12) << round;
        invalid += static_cast<int>(csg.report.invalid_brushes);
        for (const BrushPolytope& b : csg.brushes) valid += b.valid;
    }
    EXPECT_GT(valid, 300);
    EXPECT_GT(invalid, 50);
}

TEST(CsgInput, WorldsFarFromTheOriginAreTheSame) {
    const auto building = [](double at) {
        WorldBuilder w;
        std::mt19937_64 rng(3);
        for (int i = 0; i < 40; ++i) {
            const Vec3 lo = random_point(rng, 100, 2) + Vec3{at, at, -at};
            const Vec3 size = random_point(rng, 20, 2) + Vec3{24, 24, 24};
            w.box(lo, lo + size);
            w.tetrahedron({lo, lo + Vec3{size.x, 0, 0}, lo + Vec3{3, size.y, 0}, lo + Vec3{1, 2, -size.z}});
        }
        return boundary(compile(w.world, {.plane_merge_distance = 0}));
    };
    const Boundary here = building(0), there = building(130816);
    EXPECT_EQ(here.fragments, there.fragments);
    EXPECT_NEAR(here.area, there.area, 1e-9 * here.area);
    EXPECT_LT(there.closure(), 1e-10);
}

} // namespace
} // namespace kiln::test

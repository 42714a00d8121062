#include "measure.h"
#include "libs/core/hash.h"
#include <algorithm>

namespace kiln::test {
namespace {

WorldBuilder soup(std::uint64_t seed, int count, double range, double size, int bits) {
    std::mt19937_64 rng(seed);
    WorldBuilder w;
    for (int i = 0; i < count; ++i) random_brush(w, rng, range, size, bits);
    return w;
}

TEST(CsgLaws, ABoxIsItself) {
    WorldBuilder w;
    w.box({-8, 0, 16}, {24, 8, 32});
    const Boundary b = boundary(compile(w.world));
    EXPECT_EQ(b.fragments, 6u);
    EXPECT_EQ(b.area_vector, (Vec3{0, 0, 0}));
    EXPECT_EQ(b.area, 2 * (32 * 8 + 32 * 16 + 8 * 16));
    EXPECT_DOUBLE_EQ(b.volume, 32 * 8 * 16);
}

TEST(CsgLaws, BoundaryOfAUnionIsClosed) {
    for (const int bits : {0, 4, 10})
        for (std::uint64_t seed = 1; seed <= 6; ++seed) {
            const Boundary b = boundary(compile(soup(seed, 60, 100, 60, bits).world, {.plane_merge_distance = 0}));
            EXPECT_LT(b.closure(), 1e-13) << bits << ' ' << seed;
            EXPECT_GT(b.volume, 0);
        }
}

// vol(A u B) + vol(A n B) = vol A + vol B, where A n B is the brush of both brushes' sides.
TEST(CsgLaws, VolumesOfUnionAndIntersectionAddUp) {
    int meeting = 0;
    for (std::uint64_t seed = 1; seed <= 60; ++seed) {
        const World both = soup(seed, 2, 16, 48, 3).world;
        World a = both, b = both, intersection = both;
        a.brushes.pop_back();
        b.brushes.erase(b.brushes.begin());
        intersection.brushes.pop_back();
        intersection.brushes[0].side_count = static_cast<std::uint32_t>(both.sides.size());
        const CsgOptions exact{.plane_merge_distance = 0};
        const double va = boundary(compile(a, exact)).volume, vb = boundary(compile(b, exact)).volume;
        const double v_union = boundary(compile(both, exact)).volume;
        Context context;
        const Result<Csg> common = build_csg(intersection, exact, context);
        const double v_common = common ? boundary(*common).volume : 0;
        meeting += v_common > 0;
        EXPECT_NEAR(v_union + v_common, va + vb, 1e-10 * (va + vb)) << seed;
    }
    EXPECT_GT(meeting, 20);
}

TEST(CsgLaws, OrderOfBrushesDoesNotChangeTheUnion) {
    std::mt19937_64 rng(7);
    World world = soup(11, 50, 80, 60, 2).world;
    const Boundary first = boundary(compile(world));
    for (int i = 0; i < 5; ++i) {
        std::shuffle(world.brushes.begin(), world.brushes.end(), rng);
        Context context;
        const Result<Csg> csg = build_csg(world, {}, context);
        ASSERT_TRUE(csg);
        const Boundary b = boundary(*csg);
        EXPECT_NEAR(b.area, first.area, 1e-11 * first.area);
        EXPECT_NEAR(b.volume, first.volume, 1e-11 * first.volume);
    }
}

TEST(CsgLaws, ACopyOfABrushAddsNothing) {
    World world = soup(12, 20, 60, 60, 1).world;
    const Boundary once = boundary(compile(world));
    const std::size_t n = world.brushes.size();
    for (std::size_t i = 0; i < n; ++i) {
        WorldBrush copy = world.brushes[i];
        const auto first = static_cast<std::uint32_t>(world.sides.size());
        for (std::uint32_t s = 0; s < copy.side_count; ++s) world.sides.push_back(WorldSide(world.sides[copy.first_side + s]));
        copy.first_side = first;
        world.brushes.push_back(copy);
    }
    const Boundary twice = boundary(compile(world));
    EXPECT_EQ(twice.fragments, once.fragments);
    EXPECT_NEAR(twice.area, once.area, 1e-11 * once.area);
}

// A random point is inside the union exactly if it is inside some brush; a ray along +x from it crosses the
// boundary an odd number of times.
TEST(CsgLaws, PointsInsideTheBoundaryAreThoseInsideABrush) {
    std::mt19937_64 rng(8);
    const World world = soup(13, 40, 64, 50, 2).world;
    const Csg csg = compile(world);
    int inside_count = 0;
    for (int i = 0; i < 900; ++i) {
        const Vec3 x{uniform(rng, -80, 110), uniform(rng, -80, 110), uniform(rng, -80, 110)};
        bool inside = false;
        for (const BrushPolytope& b : csg.brushes) {
            bool in = true;
            for (const PlanePolygon& f : b.faces)
                in = in && dot(csg.planes.normal(f.support), x) < csg.planes.distance(f.support);
            inside = inside || in;
        }
        int crossings = 0;
        for (const Fragment& f : csg.fragments) {
            const Vec3 n = csg.planes.normal(f.polygon.support);
            if (n.x == 0) continue;
            const double t = (csg.planes.distance(f.polygon.support) - dot(n, x)) / n.x;
            if (t <= 0) continue;
            const Vec3 hit = x + Vec3{t, 0, 0};
            const auto p = points(csg.planes, f.polygon);
            bool in = true;
            for (std::size_t k = 0; k < p.size(); ++k)
                in = in && dot(cross(p[(k + 1) % p.size()] - p[k], hit - p[k]), n) > 0;
            crossings += in;
        }
        EXPECT_EQ(crossings % 2 == 1, inside);
        inside_count += inside;
    }
    EXPECT_GT(inside_count, 40);
}

// Everything turned by odd angles: nothing is axial, corners land on the finest grid, brushes that abutted do so no
// more. The volume changes by no more than the rounding of the surface.
TEST(CsgLaws, ATurnedBuildingKeepsItsVolume) {
    const auto building = [](bool turned) {
        WorldBuilder w;
        const double a = 0.3217, b = 1.1234;
        const auto turn = [&](Vec3 p) {
            if (!turned) return p;
            p = {std::cos(a) * p.x - std::sin(a) * p.y, std::sin(a) * p.x + std::cos(a) * p.y, p.z};
            p = {p.x, std::cos(b) * p.y - std::sin(b) * p.z, std::sin(b) * p.y + std::cos(b) * p.z};
            for (std::size_t k = 0; k < 3; ++k) p[k] = std::round(p[k] * 1e4) / 1e4;
            return p;
        };
        std::mt19937_64 rng(9);
        for (int x = 0; x < 4; ++x)
            for (int y = 0; y < 4; ++y)
                for (int z = 0; z < 2; ++z) {
                    if (rng() % 3 == 0) continue;
                    auto sides = WorldBuilder::box_sides({x * 64.0, y * 64.0, z * 64.0}, {x * 64.0 + 64, y * 64.0 + 64, z * 64.0 + 64});
                    for (auto& s : sides)
                        for (Vec3& p : s) p = turn(p);
                    w.brush(sides);
                }
        return w.world;
    };
    const Boundary straight = boundary(compile(building(false)));
    const Csg csg = compile(building(true));
    const Boundary turned = boundary(csg);
    EXPECT_LT(turned.closure(), 1e-13);
    EXPECT_NEAR(turned.volume, straight.volume, 0.01 * straight.area);
    EXPECT_NEAR(turned.area, straight.area, 1e-3 * straight.area);
    // What abutted before still does: as many planes as the straight one has.
    EXPECT_EQ(turned.fragments, straight.fragments);
    EXPECT_LT(csg.report.largest_rounding, 2e-3);
}

TEST(CsgLaws, SameBytesForAnyNumberOfThreads) {
    const World world = soup(14, 120, 200, 60, 10).world;
    const Hash one = hash_of(compile(world, {}, 1));
    EXPECT_EQ(hash_of(compile(world, {}, 2)), one);
    EXPECT_EQ(hash_of(compile(world, {}, 7)), one);
    Csg csg = compile(world);
    const Csg back = from_bytes<Csg>(to_bytes(csg));
    EXPECT_EQ(hash_of(back), one);
    validate(back, world);
}

} // namespace
} // namespace kiln::test

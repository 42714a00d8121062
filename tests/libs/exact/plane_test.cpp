#include "rational.h"
#include <gtest/gtest.h>

namespace kiln::test {
namespace {

// Grid steps. Small ones are settled in doubles, middle ones in 128 bits, the last
// (2^17 map units on the 2^-10 grid) and the limit in 512 bits.
const std::int64_t kRanges[] = {4, 64, 4096, 1 << 20, 1 << 27, kMaxGridCoordinate};

TEST(Plane, EqualPlanesHaveEqualIdsAndFlippedOnesDifferInTheLowestBit) {
    PlaneTable t;
    const auto p = t.add({0, 0, 5}, {0, 7, 5}, {3, 0, 5}); // clockwise seen from above
    ASSERT_TRUE(p);
    EXPECT_EQ(t.normal(*p), (Vec3{0, 0, 1}));
    EXPECT_EQ(t.distance(*p), 5);
    EXPECT_EQ(t.add({100, 100, 5}, {100, 200, 5}, {200, 100, 5}), p);
    EXPECT_EQ(t.add({0, 0, 5}, {3, 0, 5}, {0, 7, 5}), flipped(*p));
    EXPECT_EQ(t.add(ExactPlane{.d = 35, .c = 7}), *p);
    EXPECT_EQ(t.planes.size(), 2u);
    EXPECT_FALSE(t.add({0, 0, 0}, {1, 2, 3}, {-2, -4, -6}));
    EXPECT_FALSE(t.add({1, 1, 1}, {1, 1, 1}, {2, 4, 6}));
}

TEST(Plane, HoldsItsThreePointsAtEveryMagnitude) {
    std::mt19937_64 rng(1);
    for (const std::int64_t range : kRanges) {
        PlaneTable t;
        for (int i = 0; i < 200; ++i) {
            std::array<GridPoint, 3> p;
            for (auto& g : p)
                for (auto& x : g) x = static_cast<std::int64_t>(rng() % static_cast<std::uint64_t>(2 * range + 1)) - range;
            const auto id = t.add(p[0], p[1], p[2]);
            if (!id) continue;
            for (const auto& g : p) {
                EXPECT_EQ(t.side(g, *id), 0);
                EXPECT_EQ(side_of(t, {Rational(g[0]), Rational(g[1]), Rational(g[2])}, *id), 0);
            }
            const ExactPlane e = t.planes[id->at()];
            EXPECT_EQ(gcd(gcd(Integer(e.a), Integer(e.b)), gcd(Integer(e.c), integer(e.d))), 1);
        }
    }
}

TEST(Plane, PredicatesAgreeWithRationalArithmetic) {
    std::mt19937_64 rng(2);
    for (const std::int64_t range : kRanges) {
        PlaneTable t;
        std::vector<PlaneId> ids;
        for (int i = 0; i < 40; ++i) {
            PlaneId p = random_plane(t, rng, range);
            ids.push_back(p);
            if (i % 3 == 0) { // a companion tilted or moved by the least the integers allow
                ExactPlane e = t.planes[p.at()];
                if (i % 2) e.d += 1;
                else e.a += e.a > 0 ? -1 : 1;
                if (e.a || e.b || e.c) ids.push_back(t.add(e));
            }
        }
        int zeros = 0;
        for (int i = 0; i < 3000; ++i) {
            const auto pick = [&] { return PlaneId{ids[rng() % ids.size()].value ^ static_cast<std::uint32_t>(rng() & 1)}; };
            const PlaneId p = pick(), q = pick(), r = pick(), s = pick();
            const auto x = solve(t, p, q, r);
            EXPECT_EQ(t.orientation(p, q, r) == 0, !x) << range;
            if (!x) continue;
            const int expected = side_of(t, *x, s);
            zeros += expected == 0;
            ASSERT_EQ(t.side(p, q, r, s), expected) << range;
            ASSERT_EQ(t.side(q, r, flipped(p), s), expected);
            ASSERT_EQ(t.side(p, q, r, flipped(s)), -expected);
        }
        EXPECT_GT(zeros, 0);
    }
}

// Four planes through one point, none of them alike: the determinant is zero and no filter may guess otherwise.
TEST(Plane, PointOnAFourthPlaneIsOnIt) {
    std::mt19937_64 rng(3);
    for (const std::int64_t range : kRanges) {
        PlaneTable t;
        for (int i = 0; i < 300; ++i) {
            const auto random = [&] {
                GridPoint g;
                for (auto& x : g) x = static_cast<std::int64_t>(rng() % static_cast<std::uint64_t>(2 * range + 1)) - range;
                return g;
            };
            const GridPoint apex = random();
            std::vector<PlaneId> p;
            while (p.size() < 4)
                if (const auto id = t.add(apex, random(), random())) p.push_back(*id);
            if (t.orientation(p[0], p[1], p[2]) == 0) continue;
            EXPECT_EQ(t.side(p[0], p[1], p[2], p[3]), 0);
            const Vec3 x = t.point(p[0], p[1], p[2]);
            for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(x[k], static_cast<double>(apex[k]));
            if (t.orientation(p[3], p[1], p[2]) != 0) {
                EXPECT_EQ(t.point(p[3], p[1], p[2]), x);
            }
        }
    }
}

TEST(Plane, OrientationHasTheSignOfTheDeterminant) {
    PlaneTable t;
    const PlaneId x = t.add(ExactPlane{.d = 3, .a = 1}), y = t.add(ExactPlane{.d = 4, .b = 1}),
                  z = t.add(ExactPlane{.d = 5, .c = 1});
    EXPECT_EQ(t.orientation(x, y, z), 1);
    EXPECT_EQ(t.orientation(y, x, z), -1);
    EXPECT_EQ(t.orientation(flipped(x), y, z), -1);
    EXPECT_EQ(t.orientation(x, x, z), 0);
    EXPECT_EQ(t.point(x, y, z), (Vec3{3, 4, 5}));
}

TEST(Plane, ParallelIsExact) {
    PlaneTable t;
    const PlaneId p = t.add(ExactPlane{.d = 3, .a = 1, .b = 2, .c = -5}),
                  q = t.add(ExactPlane{.d = 7, .a = -2, .b = -4, .c = 10});
    EXPECT_EQ(t.parallel(p, q), -1);
    EXPECT_EQ(t.parallel(p, flipped(q)), 1);
    EXPECT_EQ(t.parallel(p, p), 1);
    EXPECT_EQ(t.parallel(p, flipped(p)), -1);
    constexpr std::int64_t big = (std::int64_t{1} << 60) + 1;
    EXPECT_EQ(t.parallel(t.add(ExactPlane{.d = 1, .a = big, .b = big - 1}), t.add(ExactPlane{.d = 5, .a = big, .b = big - 2})), 0);
}

// The rounded point is the double nearest to the exact one, also where planes are 1e-7 from parallel.
TEST(Plane, PointIsCorrectlyRounded) {
    std::mt19937_64 rng(4);
    for (const std::int64_t range : kRanges) {
        PlaneTable t;
        t.grid_bits = 10;
        for (int i = 0; i < 200; ++i) {
            const PlaneId p = random_plane(t, rng, range), r = random_plane(t, rng, range);
            PlaneId q = random_plane(t, rng, range);
            if (i % 2) {
                ExactPlane e = t.planes[p.at()];
                e.b += e.b > 0 ? -1 : 1;
                if (!e.a && !e.b && !e.c) continue;
                q = t.add(e);
            }
            const auto x = solve(t, p, q, r);
            if (!x) continue;
            const Vec3 got = t.point(p, q, r);
            const auto text = t.exact_point(p, q, r);
            for (std::size_t k = 0; k < 3; ++k) {
                const Rational exact = (*x)[k] / 1024;
                EXPECT_EQ(Rational(Integer(text[k]), Integer(text[3])), exact);
                const Rational error = abs(Rational(got[k]) - exact);
                const double up = std::nextafter(got[k], INFINITY), down = std::nextafter(got[k], -INFINITY);
                EXPECT_LE(error, abs(Rational(up) - exact));
                EXPECT_LE(error, abs(Rational(down) - exact));
                EXPECT_FALSE(got[k] == 0 && std::signbit(got[k]));
            }
        }
    }
}

TEST(Plane, SurvivesTheArchive) {
    std::mt19937_64 rng(5);
    PlaneTable t;
    t.grid_bits = 3;
    std::vector<PlaneId> ids;
    for (int i = 0; i < 20; ++i) ids.push_back(random_plane(t, rng, 1000));
    auto back = from_bytes<PlaneTable>(to_bytes(t));
    EXPECT_EQ(back.grid_bits, 3);
    EXPECT_EQ(back.planes, t.planes);
    for (const PlaneId p : ids) {
        EXPECT_EQ(back.add(t.planes[p.at()]), p);
        EXPECT_EQ(back.normal(p), t.normal(p));
    }
}

} // namespace
} // namespace kiln::test

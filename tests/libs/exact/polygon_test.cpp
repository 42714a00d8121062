#include "rational.h"
#include <gtest/gtest.h>

namespace kiln::test {
namespace {

RationalPoint exact(const PlaneTable& t, const PlanePolygon& p, std::size_t i) {
    return *solve(t, p.support, p.edges[(i + p.size() - 1) % p.size()], p.edges[i]);
}
// Twice the area vector, exactly.
RationalPoint area(const PlaneTable& t, const PlanePolygon& p) {
    RationalPoint sum{0, 0, 0};
    const RationalPoint o = exact(t, p, 0);
    for (std::size_t i = 1; i + 1 < p.size(); ++i) {
        RationalPoint u = exact(t, p, i), v = exact(t, p, i + 1);
        for (std::size_t k = 0; k < 3; ++k) u[k] -= o[k], v[k] -= o[k];
        for (std::size_t k = 0; k < 3; ++k)
            sum[k] += u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
    }
    return sum;
}
RationalPoint operator+(RationalPoint a, const RationalPoint& b) {
    for (std::size_t k = 0; k < 3; ++k) a[k] += b[k];
    return a;
}
int facing(const PlaneTable& t, const PlanePolygon& p) { // +1: counter-clockwise about the support's normal
    const auto n = rational(t.planes[p.support.at()]);
    const RationalPoint a = area(t, p);
    const Rational d = n[0] * a[0] + n[1] * a[1] + n[2] * a[2];
    return d.sign();
}
void expect_sound(const PlaneTable& t, const PlanePolygon& p) {
    ASSERT_GE(p.size(), 3u);
    EXPECT_EQ(facing(t, p), 1);
    for (std::size_t i = 0; i < p.size(); ++i) {
        const RationalPoint x = exact(t, p, i);
        for (std::size_t e = 0; e < p.size(); ++e) {
            const bool own = e == i || e == (i + p.size() - 1) % p.size();
            EXPECT_EQ(side_of(t, x, p.edges[e]), own ? 0 : -1);
        }
    }
}

struct Square {
    PlaneTable t;
    PlanePolygon polygon;
    explicit Square(std::int64_t half) {
        const PlaneId x0 = t.add(ExactPlane{.d = half, .a = -1}), x1 = t.add(ExactPlane{.d = half, .a = 1}),
                      y0 = t.add(ExactPlane{.d = half, .b = -1}), y1 = t.add(ExactPlane{.d = half, .b = 1}),
                      z = t.add(ExactPlane{.d = 0, .c = 1});
        polygon = {z, {y0, x1, y1, x0}};
    }
};

TEST(Polygon, VerticesComeInOrder) {
    const Square s(8);
    EXPECT_EQ(points(s.t, s.polygon), (std::vector<Vec3>{{-8, -8, 0}, {8, -8, 0}, {8, 8, 0}, {-8, 8, 0}}));
    expect_sound(s.t, s.polygon);
    EXPECT_EQ(facing(s.t, flipped(s.polygon)), 1);
    EXPECT_EQ(flipped(flipped(s.polygon)), s.polygon);
}

TEST(Polygon, SplitKeepsBothPartsAndTheirArea) {
    std::mt19937_64 rng(6);
    for (const std::int64_t range : {std::int64_t{3}, std::int64_t{1} << 10, std::int64_t{1} << 27}) {
        Square s(range);
        int both = 0;
        for (int i = 0; i < 60; ++i) {
            PlanePolygon p = s.polygon;
            for (int cuts = 0; cuts < 6; ++cuts) {
                const PlaneId q = random_plane(s.t, rng, range);
                const SplitPolygon parts = split(s.t, p, q);
                const PolygonSides sides = classify(s.t, p, q);
                EXPECT_EQ(sides.front, parts.front.has_value());
                EXPECT_EQ(sides.back, parts.back.has_value());
                PlanePolygon clipped = p;
                const bool left = clip_to_back(s.t, clipped, q);
                if (parts.on) {
                    EXPECT_EQ(q.value | 1, p.support.value | 1);
                    continue;
                }
                EXPECT_EQ(left, parts.back.has_value());
                if (parts.back) {
                    EXPECT_EQ(clipped, *parts.back);
                }
                RationalPoint sum{0, 0, 0};
                if (parts.front) expect_sound(s.t, *parts.front), sum = sum + area(s.t, *parts.front);
                if (parts.back) expect_sound(s.t, *parts.back), sum = sum + area(s.t, *parts.back);
                EXPECT_EQ(sum, area(s.t, p));
                both += parts.front && parts.back;
                p = parts.back && (rng() & 1 || !parts.front) ? *parts.back : *parts.front;
            }
        }
        EXPECT_GT(both, 50);
    }
}

TEST(Polygon, ThinPartsAreKept) {
    Square s(std::int64_t{1} << 27);
    // A cut less than 1e-8 grid steps from the edge x = 2^27 on one side and through the corner on the other.
    const std::int64_t h = std::int64_t{1} << 27;
    const auto q = s.t.add({h, h, 0}, {h, h, 1}, {h - 1, -h + 1, 0});
    ASSERT_TRUE(q);
    const SplitPolygon parts = split(s.t, s.polygon, *q);
    ASSERT_TRUE(parts.front && parts.back);
    expect_sound(s.t, *parts.front);
    expect_sound(s.t, *parts.back);
    EXPECT_EQ(parts.front->size() + parts.back->size(), 7u); // through one corner: a triangle and a quad
}

TEST(Polygon, PlanesThatTouchDoNotSplit) {
    Square s(8);
    const auto corner = s.t.add({8, 8, 0}, {9, 7, 0}, {8, 8, 1}), edge = s.t.add({8, 0, 0}, {8, 1, 0}, {9, 0, 1});
    for (const PlaneId q : {*corner, *edge}) {
        const SplitPolygon parts = split(s.t, s.polygon, q);
        EXPECT_NE(parts.front.has_value(), parts.back.has_value());
        EXPECT_EQ(parts.front ? *parts.front : *parts.back, s.polygon);
    }
    const SplitPolygon on = split(s.t, s.polygon, flipped(s.polygon.support));
    EXPECT_TRUE(on.on && !on.front && !on.back);
}

} // namespace
} // namespace kiln::test

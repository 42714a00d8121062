#include "libs/sampling/maps.h"
#include "libs/sampling/sobol.h"
#include <gtest/gtest.h>
#include <vector>

using namespace kiln;

// A (0,m,2)-net has one point in each of the 2^m boxes of every shape 2^-a x 2^-(m-a).
TEST(Sobol, EveryAlignedPowerOfTwoBlockIsANet) {
    for (const std::uint64_t seed : {0ull, 1ull, 77ull, 0xFFFFFFFFFFFFull}) {
        const Sobol points(seed);
        for (const std::uint32_t m : {2u, 4u, 7u, 10u})
            for (const std::uint32_t block : {0u, 3u})
                for (std::uint32_t a = 0; a <= m; ++a) {
                    std::vector<int> count(1u << m);
                    for (std::uint32_t i = 0; i < 1u << m; ++i) {
                        const Vec2 p = points.pair((block << m) + i, 0);
                        ASSERT_TRUE(p.x >= 0 && p.x < 1 && p.y >= 0 && p.y < 1);
                        const auto x = static_cast<std::uint32_t>(p.x * (1u << a));
                        const auto y = static_cast<std::uint32_t>(p.y * (1u << (m - a)));
                        ++count[(x << (m - a)) + y];
                    }
                    for (const int c : count) ASSERT_EQ(c, 1) << "seed " << seed << " m " << m << " a " << a;
                }
    }
}

TEST(Sobol, EveryDimensionIsStratified) {
    const Sobol points(5);
    for (int d = 0; d < kSobolDimensions; ++d) {
        std::vector<int> count(4096);
        for (std::uint32_t i = 0; i < 4096; ++i) ++count[static_cast<std::size_t>(points(i, d) * 4096)];
        for (const int c : count) ASSERT_EQ(c, 1) << d;
    }
}

// Scrambling makes each single point uniform: over many seeds, the mean and variance of point 0 and of the product
// of point 3's coordinates are those of independent uniform numbers.
TEST(Sobol, ManyAtOnceAreTheSame) {
    const Sobol points(77);
    for (int d = 0; d < kSobolDimensions; ++d)
        for (const std::size_t n : {0u, 1u, 63u, 64u, 300u, 70000u}) {
            std::vector<double> many(n);
            points.first(many, d);
            for (std::uint32_t i = 0; i < n; ++i) ASSERT_EQ(many[i], points(i, d)) << i << " of " << n;
        }
}

TEST(Sobol, OverSeedsEachPointIsUniform) {
    constexpr int n = 40000;
    double sum = 0, square = 0, product = 0, neighbours = 0;
    for (int s = 0; s < n; ++s) {
        const Sobol points(mix(static_cast<std::uint64_t>(s), 99));
        const double x = points(0, 0);
        sum += x, square += x * x;
        product += points(3, 0) * points(3, 1);
        neighbours += (points(0, 0) - 0.5) * (points(2, 0) - 0.5);
    }
    EXPECT_NEAR(sum / n, 0.5, 5 * std::sqrt(1 / 12.0 / n));
    EXPECT_NEAR(square / n, 1 / 3.0, 5 * std::sqrt(4 / 45.0 / n));
    EXPECT_NEAR(product / n, 0.25, 5 * std::sqrt((1 / 9.0 - 1 / 16.0) / n));
    // Points 0 and 2 of the first dimension fall in the same half: their covariance is +1/24 - ... = 1/48 or less.
    EXPECT_LT(std::abs(neighbours / n), 1 / 12.0);
}

// The integral of a smooth function converges faster than n^-1/2; at 1024 points it is 3x better than random at
// least.
TEST(Sobol, BeatsRandomNumbersOnASmoothIntegrand) {
    const auto f = [](Vec2 p) { return std::exp(p.x) * p.y * p.y; };
    const double exact = (std::exp(1.0) - 1) / 3;
    double qmc = 0, mc = 0;
    for (std::uint64_t s = 0; s < 64; ++s) {
        const Sobol points(mix(s, 7));
        Random random(s);
        double a = 0, b = 0;
        for (std::uint32_t i = 0; i < 1024; ++i) {
            a += f(points.pair(i, 0));
            const double x = random(), y = random();
            b += f({x, y});
        }
        qmc += (a / 1024 - exact) * (a / 1024 - exact), mc += (b / 1024 - exact) * (b / 1024 - exact);
    }
    EXPECT_LT(std::sqrt(qmc), std::sqrt(mc) / 20);
}

TEST(Maps, UpperHalfOfAtan2) {
    for (int i = 0; i <= 4096; ++i) {
        const double a = std::numbers::pi * i / 4096;
        for (const double r : {1e-200, 3e-7, 1.0, 1e150}) EXPECT_NEAR(atan2_upper(r * std::sin(a), r * std::cos(a)), std::atan2(r * std::sin(a), r * std::cos(a)), 1e-15) << i;
    }
    for (double y = 1; y > 1e-300; y /= 7) EXPECT_NEAR(atan2_upper(y, 1) / std::atan2(y, 1.0), 1, 5e-16) << y;
    EXPECT_EQ(atan2_upper(0, 1), 0);
    EXPECT_EQ(atan2_upper(0, 0), 0);
    EXPECT_EQ(atan2_upper(0, -2), std::numbers::pi);
}

TEST(Maps, SineAndCosine) {
    for (int i = -1000; i <= 1000; ++i) {
        const double t = i / 371.0;
        EXPECT_NEAR(sincos_turns(t).sin, std::sin(2 * std::numbers::pi * t), 4e-15);
        EXPECT_NEAR(sincos_turns(t).cos, std::cos(2 * std::numbers::pi * t), 4e-15);
    }
}

TEST(Maps, DiscsOfManyPointsAreTheSame) {
    std::vector<double> x{0.5, 0, 1, 0.5, 0.25, 0.75, 1}, y{0.5, 0, 1, 0.1, 0.25, 0.25, 0.5}; // the middle, corners, diagonals; an odd number
    for (std::uint32_t i = 0; i < 1000; ++i) x.push_back(Sobol(3)(i, 0)), y.push_back(Sobol(3)(i, 1));
    std::vector<double> across = x, down = y;
    concentric_discs(across, down);
    for (std::size_t i = 0; i < x.size(); ++i) {
        const Vec2 one = concentric_disc({x[i], y[i]});
        EXPECT_EQ(across[i], one.x) << x[i] << " " << y[i];
        EXPECT_EQ(down[i], one.y) << x[i] << " " << y[i];
    }
}

TEST(Maps, MomentsOfTheHemisphereAndSphere) {
    constexpr std::uint32_t n = 1u << 14;
    const Sobol points(3);
    Vec3 mean_h, mean_s;
    double cos2 = 0, xx = 0, zz = 0, cap = 0;
    for (std::uint32_t i = 0; i < n; ++i) {
        const Vec3 h = cosine_hemisphere(points.pair(i, 0)), s = uniform_sphere(points.pair(i, 0));
        ASSERT_NEAR(length(h), 1, 1e-12);
        ASSERT_NEAR(length(s), 1, 1e-12);
        ASSERT_GE(h.z, 0);
        mean_h += h, mean_s += s;
        cos2 += h.z * h.z, xx += h.x * h.x, zz += s.z * s.z;
        cap += uniform_cap(points.pair(i, 0), 0.9).z;
    }
    EXPECT_NEAR(mean_h.z / n, 2.0 / 3, 1e-4); // integral of cos^2 / pi
    EXPECT_NEAR(mean_h.x / n, 0, 1e-3);
    EXPECT_NEAR(cos2 / n, 0.5, 1e-4);
    EXPECT_NEAR(xx / n, 0.25, 1e-4);
    EXPECT_NEAR(length(mean_s) / n, 0, 1e-3);
    EXPECT_NEAR(zz / n, 1.0 / 3, 1e-4);
    EXPECT_NEAR(cap / n, 0.95, 1e-5);
}

TEST(Maps, TriangleIsUniform) {
    const Sobol points(11);
    double b = 0, c = 0, bb = 0;
    constexpr std::uint32_t n = 1u << 14;
    for (std::uint32_t i = 0; i < n; ++i) {
        const Vec2 w = uniform_triangle(points.pair(i, 0));
        ASSERT_TRUE(w.x >= 0 && w.y >= 0 && w.x + w.y <= 1 + 1e-12);
        b += w.x, c += w.y, bb += w.x * w.x;
    }
    EXPECT_NEAR(b / n, 1.0 / 3, 1e-4);
    EXPECT_NEAR(c / n, 1.0 / 3, 1e-4);
    EXPECT_NEAR(bb / n, 1.0 / 6, 1e-4);
}

// Directions lie in the triangle, and their mean is that of the triangle: half the sum over its edges of angle times normal (Lambert).
TEST(Maps, SphericalTriangleIsUniform) {
    const std::vector<std::array<Vec3, 3>> triangles{{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, {{{5, 0, 1}, {-3, 4, 1}, {-3, -4, 1}}}, {{{0, 0, 9}, {1, 0, 9}, {0, 1, 9}}}, {{{1, 2, 30}, {2, 2, 30}, {9, 2.2, 30}}}};
    for (const auto& [a, b, c] : triangles) {
        const SphericalTriangle triangle(a, b, c);
        const std::array<Vec3, 3> corner{normalize(a), normalize(b), normalize(c)};
        const Vec3 middle = corner[0] + corner[1] + corner[2];
        Vec3 exact;
        for (std::size_t i = 0; i < 3; ++i) {
            const Vec3 across = cross(corner[i], corner[(i + 1) % 3]);
            exact += across * (std::atan2(length(across), dot(corner[i], corner[(i + 1) % 3])) / (2 * length(across)));
        }
        if (dot(exact, middle) < 0) exact = -exact;
        const Sobol points(3);
        Vec3 sum;
        constexpr std::uint32_t n = 1u << 14;
        for (std::uint32_t k = 0; k < n; ++k) {
            const Vec3 d = triangle.direction(points.pair(k, 0));
            ASSERT_NEAR(length(d), 1, 1e-12);
            for (std::size_t i = 0; i < 3; ++i) {
                const Vec3 side = normalize(cross(corner[i], corner[(i + 1) % 3]));
                ASSERT_GE(dot(d, side) * (dot(side, middle) > 0 ? 1 : -1), -1e-9);
            }
            sum += d * (triangle.solid_angle() / n);
        }
        EXPECT_NEAR(length(sum - exact), 0, 2e-5 * length(exact));
    }
    EXPECT_NEAR(SphericalTriangle({1, 0, 0}, {0, 1, 0}, {0, 0, 1}).solid_angle(), std::numbers::pi / 2, 1e-14);
}

TEST(Maps, HammersleyCoversTheSquare) {
    std::vector<int> count(256);
    for (std::uint32_t i = 0; i < 256; ++i) {
        const Vec2 p = hammersley(i, 256);
        ++count[static_cast<std::size_t>(p.x * 16) * 16 + static_cast<std::size_t>(p.y * 16)];
    }
    for (const int c : count) EXPECT_EQ(c, 1);
}

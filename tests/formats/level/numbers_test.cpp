#include "formats/level/numbers.h"
#include <cfloat>
#include <gtest/gtest.h>
#include <random>

namespace kiln::level {

TEST(LevelNumbers, EveryFiniteHalfSurvives) {
    for (std::uint32_t h = 0; h < 65536; ++h) {
        if ((h >> 10 & 31) == 31) continue; // infinities and NaN are never written
        const float f = float_from_half(static_cast<std::uint16_t>(h));
        ASSERT_EQ(half_from_float(f), h) << f;
    }
}

TEST(LevelNumbers, HalfRoundsToTheNearest) {
    std::mt19937 random(1);
    for (int i = 0; i < 200000; ++i) {
        const float f = std::ldexp(static_cast<float>(random() >> 8) / 8388608.0f - 1.0f, static_cast<int>(random() % 42) - 26);
        const std::uint16_t h = half_from_float(f);
        const float error = std::abs(float_from_half(h) - f);
        for (const int step : {-1, 1}) {
            const auto other = static_cast<std::uint16_t>(h + step);
            if ((other >> 10 & 31) == 31 || (h & 0x7fff) == 0) continue;
            ASSERT_LE(error, std::abs(float_from_half(other) - f)) << f;
        }
    }
}

TEST(LevelNumbers, HalfSaturatesInsteadOfInfinity) {
    EXPECT_EQ(float_from_half(half_from_float(1e30f)), 65504.0f);
    EXPECT_EQ(float_from_half(half_from_float(-INFINITY)), -65504.0f);
    EXPECT_EQ(float_from_half(half_from_float(NAN)), 0.0f);
    EXPECT_EQ(half_from_float(65519.0f), half_from_float(65504.0f));
}

TEST(LevelNumbers, SharedExponentIsWithinHalfAStepOfTheLargestChannel) {
    std::mt19937 random(2);
    const auto real = [&] { return static_cast<float>(random()) / 4294967296.0f; };
    for (int i = 0; i < 200000; ++i) {
        const float level = std::ldexp(1.0f, static_cast<int>(random() % 24) - 10);
        const std::array<float, 3> in{real() * level, real() * level, real() * level};
        const float largest = std::max(in[0], std::max(in[1], in[2]));
        const auto out = float_from_rgb9e5(rgb9e5_from_float(in));
        for (std::size_t c = 0; c < 3; ++c) ASSERT_LE(std::abs(out[c] - in[c]), largest / 512 + 1e-7f);
    }
}

TEST(LevelNumbers, SharedExponentIsAFixedPointOfItself) {
    std::mt19937 random(3);
    for (int i = 0; i < 100000; ++i) {
        const auto once = float_from_rgb9e5(static_cast<std::uint32_t>(random()));
        ASSERT_EQ(float_from_rgb9e5(rgb9e5_from_float(once)), once);
    }
}

TEST(LevelNumbers, SharedExponentTakesWhatIsNotANumber) {
    const auto v = float_from_rgb9e5(rgb9e5_from_float({NAN, -3.0f, INFINITY}));
    EXPECT_EQ(v[0], 0.0f);
    EXPECT_EQ(v[1], 0.0f);
    EXPECT_EQ(v[2], kRgb9e5Max);
    EXPECT_EQ(rgb9e5_from_float({0, 0, 0}), rgb9e5_from_float({-1, NAN, 0}));
}

TEST(LevelNumbers, OctahedralNormalsTurnLessThanAFiftiethOfADegree) {
    std::mt19937 random(4);
    std::normal_distribution<double> normal;
    double worst = 0;
    for (int i = 0; i < 200000; ++i) {
        std::array<double, 3> v{normal(random), normal(random), normal(random)};
        const double l = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
        const std::array<float, 3> n{static_cast<float>(v[0] / l), static_cast<float>(v[1] / l), static_cast<float>(v[2] / l)};
        const auto q = oct_from_normal(n);
        const auto m = normal_from_oct(q[0], q[1]);
        double d = 0;
        for (std::size_t k = 0; k < 3; ++k) d += std::pow(static_cast<double>(m[k]) - n[k], 2);
        worst = std::max(worst, std::sqrt(d));
    }
    EXPECT_LT(worst, 3.5e-4 / 3);
    for (const std::array<float, 3> axis : {std::array<float, 3>{1, 0, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}) {
        const auto q = oct_from_normal(axis);
        EXPECT_EQ(normal_from_oct(q[0], q[1]), axis);
    }
}

TEST(LevelNumbers, ZigzagAndErrorCodesComeBack) {
    for (const std::int32_t v : {0, 1, -1, 77, INT32_MAX, INT32_MIN}) EXPECT_EQ(unzigzag(zigzag(v)), v);
    EXPECT_EQ(error_code(0), 0);
    EXPECT_EQ(error_code(NAN), 0);
    for (float e = 1e-5f; e < 10; e *= 1.07f) EXPECT_NEAR(error_from_code(error_code(e)) / e, 1, 0.031);
}

} // namespace kiln::level

#include "tests/compiler/light/scenes.h"
#include <gtest/gtest.h>
#include <numbers>

using namespace kiln;
using namespace kiln::test;

namespace {
constexpr double kPi = std::numbers::pi;

Rgbd irradiance(const LightField& field, Vec3 p, Vec3 n, std::uint32_t rays) {
    Rgbd e;
    field.arriving(p, n, rays, 1, [&](Vec3 d, Rgbd w) { e += w * std::max(0.0, dot(d, n)); });
    return e;
}
} // namespace

TEST(Bake, FurnaceIsPiEverywhere) {
    const auto b = bake(furnace());
    ASSERT_TRUE(b);
    EXPECT_EQ(b->lighting.escaped_rays, 0u);
    EXPECT_EQ(b->lighting.back_face_rays, 0u);
    for (std::size_t t = 0; t < b->lighting.flat.size(); ++t)
        for (std::size_t c = 0; c < 3 && b->lighting.valid[t]; ++c)
            EXPECT_NEAR(b->lighting.flat[t][c], kPi, 0.005 * kPi) << t;
    for (const Rgb& r : b->lighting.radiosity)
        for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(r[c], kPi, 0.005 * kPi);
    const Rgbd e = irradiance(*b->field, {40, 100, 0}, {0, 0, 1}, 1024);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(e[c], kPi, 0.005 * kPi);
    Rgbd sum;
    b->field->arriving({100, 100, 50}, {}, 1024, 3, [&](Vec3 d, Rgbd w) { sum += w * std::max(0.0, d.x); });
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], kPi, 0.005 * kPi);
}

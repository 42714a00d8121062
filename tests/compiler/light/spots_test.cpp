// What is small and bright from where it is seen: that it is found, and what guides make of it.
#include "compiler/light/bake.h"
#include "compiler/light/lambert.h"
#include "tests/compiler/light/scenes.h"
#include <gtest/gtest.h>
#include <numbers>

namespace kiln::test {
namespace {
constexpr double kPi = std::numbers::pi;

// A wall of 64-unit patches that faces the origin from afar, and one patch there that looks at it.
struct View {
    std::vector<Patch> patches{{}};
    std::vector<Vec3> normals{{1, 0, 0}};
    std::vector<double> radiance{0};
    std::vector<std::uint32_t> place{0};
    explicit View(double distance) {
        patches[0].area = 64 * 64;
        for (int y = -8; y < 8; ++y)
            for (int z = -8; z < 8; ++z) add({distance, 64 * (y + 0.5), 64 * (z + 0.5)}, {-1, 0, 0});
    }
    void add(Vec3 at, Vec3 normal) {
        Patch p;
        p.centroid = at, p.area = 64 * 64;
        patches.push_back(p), normals.push_back(normal), radiance.push_back(0.01), place.push_back(1);
    }
    std::vector<Spot> seen(double irradiance, std::span<const std::uint32_t> trees = std::array<std::uint32_t, 2>{0, 1}) const {
        SpotTrees all(patches, normals, place);
        all.shine(radiance);
        std::vector<std::uint32_t> may;
        std::vector<Spot> out;
        for (std::size_t g = 0; g < all.groups(); ++g) {
            if (std::ranges::find(all.group(g), 0u) == all.group(g).end()) continue;
            all.may_be_spots(g, trees, irradiance, may);
            all.find(may, patches[0].centroid, normals[0], irradiance, out);
        }
        return out;
    }
};
} // namespace

TEST(Spots, ABrightPatchFarOffIsFound) {
    View view(4000);
    constexpr std::uint32_t kBright = 100;
    view.radiance[kBright] = 10;
    const Vec3 to = view.patches[kBright].centroid;
    const double square = dot(to, to), expected = 10 * 64 * 64 * to.x * to.x / (square * square), irradiance = 2 * expected;
    const std::vector<Spot> found = view.seen(irradiance);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].patch, kBright);
    EXPECT_LE(length(found[0].center - to), found[0].radius);
    EXPECT_NEAR(std::log2(found[0].share), std::log2(0.5), 0.126); // steps of a quarter of an octave
    EXPECT_TRUE(view.seen(irradiance, std::array<std::uint32_t, 1>{0}).empty()) << "in a tree that is not asked";
    EXPECT_TRUE(view.seen(100).empty()) << "where it is bright itself";
    view.normals[0] = {-1, 0, 0};
    EXPECT_TRUE(view.seen(irradiance).empty()) << "behind the horizon";
    view.normals[0] = {1, 0, 0}, view.normals[kBright] = {1, 0, 0};
    EXPECT_TRUE(view.seen(irradiance).empty()) << "from behind";
}

TEST(Spots, WhatIsLargeOrEvenIsLeftToTheCellsOfGuides) {
    View near(200);
    near.radiance[100] = 1000;
    EXPECT_TRUE(near.seen(0.1).empty());
    View even(4000);
    for (double& r : even.radiance) r = 1;
    EXPECT_TRUE(even.seen(kPi / 2).empty());
}

// Whatever patch is a spot by itself lies in one that is found; looking for a group at once passes none over.
TEST(Spots, NoneIsPassedOver) {
    Random random(7);
    for (int round = 0; round < 20; ++round) {
        View view(6000); // patches around are a part of what is looked at with each
        for (int i = 0; i < 400; ++i) {
            const Vec3 at{3000 + 3000 * random(), 6000 * (random() - 0.5), 6000 * (random() - 0.5)};
            view.add(at, normalize(-at + Vec3{1000 * random(), 1000 * random(), 0}));
        }
        for (int i = 0; i < 60; ++i) { // others of the group
            view.add({0, 80 * random(), 80 * random()}, {1, 0, 0});
            view.place.back() = 0, view.radiance.back() = 0;
        }
        for (std::size_t i = 1; i < view.radiance.size(); ++i)
            if (view.place[i] == 1) view.radiance[i] = std::exp2(12 * random() - 6);
        const double irradiance = 0.005;
        const std::vector<Spot> found = view.seen(irradiance);
        std::size_t alone = 0;
        for (std::size_t i = 1; i < view.patches.size(); ++i) {
            const Vec3 to = view.patches[i].centroid;
            const double square = dot(to, to), there = -dot(view.normals[i], to) / std::sqrt(square), share = view.radiance[i] * 64 * 64 * there * to.x / (square * std::sqrt(square) * irradiance);
            if (view.place[i] != 1 || !(there > 0.1) || share * view.radiance[i] * kPi / irradiance < 0.26 || view.radiance[i] * kPi < 16.1 * irradiance) continue;
            ++alone;
            EXPECT_TRUE(std::ranges::any_of(found, [&](const Spot& s) { return length(s.center - to) < s.radius; })) << round << " patch " << i;
        }
        EXPECT_GT(alone, 20u);
    }
}

TEST(Spots, SquaresOfDirections) {
    Random random(3);
    for (const double a : {1.0, 0.6})
        for (int i = 0; i < 2000; ++i) {
            const HemisphereMap map{a};
            const Vec2 square{random(), random()};
            const Vec2 again = map.square(map.direction(square));
            EXPECT_NEAR(again.x, square.x, 1e-7) << a;
            EXPECT_NEAR(again.y, square.y, 1e-7) << a;
        }
    EXPECT_EQ(HemisphereMap{}.square({0, 0, 1}), (Vec2{0.5, 0.5}));
}

// Samples with spots have the density that they are told to have: counted in boxes that the rims of the spots and of the cells fall into any way.
TEST(Spots, DensityOfAGuide) {
    Guide guide;
    guide.clear();
    Random light(5);
    for (int c = 0; c < 256; ++c) guide.add(static_cast<std::uint8_t>(c), light());
    guide.build();
    guide.add_spot({0.1, 0.2}, {0.15, 0.3}, 0.3), guide.add_spot({0.12, 0.25}, {0.4, 0.33}, 0.2); // they overlap
    constexpr int kSide = 40, kSamples = 1 << 19;
    std::vector<double> area_of(kSide * kSide);
    const Sobol points(1);
    double area = 0;
    for (std::uint32_t i = 0; i < kSamples; ++i) {
        double density = 0;
        const Vec2 at = guide.sample(points.pair(i, 0), &density);
        ASSERT_GE(density, Guide::kUniformShare * 0.5);
        const auto box = [](double x) { return std::min(static_cast<int>(x * kSide), kSide - 1); };
        const auto b = static_cast<std::size_t>(box(at.x) * kSide + box(at.y));
        area_of[b] += 1 / density / kSamples, area += 1 / density / kSamples;
    }
    EXPECT_NEAR(area, 1, 1e-3);
    for (std::size_t b = 0; b < area_of.size(); ++b) EXPECT_NEAR(area_of[b], 1.0 / (kSide * kSide), 0.05 / (kSide * kSide)) << b; // each box by the samples that fell into it
}

// A black hall, and at its far end one lit square of 64 units: seen under less than a hundredth of a guide's cell. The far wall has a closed form.
TEST(Spots, ALitSquareAtTheFarEndOfAHall) {
    for (const std::uint64_t seed : {1u, 2u, 3u}) {
        const auto b = bake(lit_square_down_a_hall(), {.error_percent = 5, .error_floor = 1e-6, .seed = seed}, {lamp_of_the_hall(1e5f)});
        EXPECT_EQ(b->lighting.flat, bake(lit_square_down_a_hall(), {.error_percent = 5, .error_floor = 1e-6, .seed = seed}, {lamp_of_the_hall(1e5f)}, 3)->lighting.flat) << "by three threads";
        const Surfaces& s = b->scene.surfaces;
        double square = 0, count = 0;
        for (const Luxel& l : s.luxels) {
            const Vec3 at = center_of(s, l);
            if (at.x < kHallLength - 1) continue;
            double expected = 0;
            for (const Luxel& from : s.luxels) {
                const Chart& chart = s.charts[from.chart.at()];
                if (chart.luxel_size > 16) continue;
                const Vec3 y = center_of(s, from), u = chart.s * 8, v = chart.t * 8;
                const double factor = std::abs(triangle_form_factor(at, {-1, 0, 0}, {y - u - v, y + u - v, y + u + v})) + std::abs(triangle_form_factor(at, {-1, 0, 0}, {y - u - v, y + u + v, y - u + v}));
                expected += 0.5 * static_cast<double>(b->lighting.flat[texel_of(s, from)].x) * factor;
            }
            ASSERT_GT(expected, 0);
            square += std::pow(static_cast<double>(b->lighting.flat[texel_of(s, l)].x) / expected - 1, 2), ++count;
        }
        EXPECT_EQ(count, 32);
        EXPECT_LT(100 * std::sqrt(square / count), 5) << seed;
    }
}

} // namespace kiln::test

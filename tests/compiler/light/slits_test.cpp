// Light through slits: what few rays are likely to miss.
#include "compiler/light/lambert.h"
#include "tests/compiler/light/scenes.h"
#include <gtest/gtest.h>
#include <numbers>

using namespace kiln;
using namespace kiln::test;

namespace {
constexpr double kPi = std::numbers::pi;
} // namespace

// Every luxel of the floor sees a thirty-second of a lamp, through a slit. What a few rays to the lamp are not likely to tell of a patch, those to it from beside do.
TEST(Bake, ALampThroughASlit) {
    const Vec3 at{112, 112, 127};
    constexpr double kSide = 32, kPlate = 126, kSlit = 1, kRadiance = 50, kBeyond = 8; // how far the plate reaches beyond the lamp
    const double from = at.x + (kSide - kSlit) / 2;
    const auto scene = [&] {
        SurfacesBuilder s;
        const MaterialId black = s.material({});
        s.room({{0, 0, 0}, {256, 256, 128}}, all(black), {.luxel = 32});
        s.rect(at, {0, kSide, 0}, {kSide, 0, 0}, s.material({}, {kRadiance, kRadiance, kRadiance}), {.chart = false});
        for (const double x : {at.x - kBeyond, from + kSlit}) s.rect({x, at.y - kBeyond, kPlate}, {0, kSide + 2 * kBeyond, 0}, {from - at.x + kBeyond, 0, 0}, black, {.chart = false});
        return s;
    };
    for (const double percent : {20.0, 5.0})
        for (std::uint64_t seed = 1; seed <= 3; ++seed) {
            const auto b = bake(scene(), {.error_percent = percent, .seed = seed});
            ASSERT_TRUE(b);
            const Surfaces& s = b->scene.surfaces;
            double off = 0, count = 0;
            for (const Luxel& l : s.luxels) {
                const Vec3 x = center_of(s, l);
                if (x.z > 0) continue;
                const auto on_lamp = [&](double slit) { return x.x + (slit - x.x) * at.z / kPlate; };
                const double lo = on_lamp(from), hi = on_lamp(from + kSlit);
                const std::array<Vec3, 4> seen{Vec3{lo, at.y, at.z}, Vec3{lo, at.y + kSide, at.z}, Vec3{hi, at.y + kSide, at.z}, Vec3{hi, at.y, at.z}};
                const double e = kPi * kRadiance * lambert_form_factor(x, {0, 0, 1}, seen), got = b->lighting.flat[texel_of(s, l)].x;
                off += (got / e - 1) * (got / e - 1), ++count;
            }
            EXPECT_EQ(count, 64);
            EXPECT_LT(100 * std::sqrt(off / count), percent) << seed; // up to 44 and 31 where patches are lost
        }
}

// A sun through a slit a unit wide draws a streak on the floor that test rays of a patch are likely to miss: who finds it tells those beside it, and some luxels look for it.
TEST(Bake, AStreakOfSunThroughASlit) {
    constexpr double kLo = 127.5, kHi = 128.5, kFrom = 64, kTo = 192, kCeiling = 128;
    Light sun;
    sun.kind = LightKind::sun, sun.direction = normalize(Vec3{0.2, 0.1, -1}), sun.intensity = {3, 3, 3};
    constexpr int kSeeds = 8;
    for (const auto& [luxel, percent] : {std::pair{16.0, 20.0}, std::pair{16.0, 5.0}, std::pair{32.0, 5.0}}) {
        double mean = 0;
        for (int seed = 1; seed <= kSeeds; ++seed) {
            SurfacesBuilder scene;
            const MaterialId black = scene.material({});
            auto walls = all(black);
            walls[5] = MaterialId{};
            scene.room({{0, 0, 0}, {256, 256, kCeiling}}, walls, {.luxel = luxel});
            for (const Box3& part : {Box3{{0, 0, 0}, {kLo, 256, 0}}, Box3{{kHi, 0, 0}, {256, 256, 0}}, Box3{{kLo, 0, 0}, {kHi, kFrom, 0}}, Box3{{kLo, kTo, 0}, {kHi, 256, 0}}})
                scene.rect({part.lo.x, part.lo.y, kCeiling}, {0, part.hi.y - part.lo.y, 0}, {part.hi.x - part.lo.x, 0, 0}, black, {.chart = false});
            scene.rect({-512, -512, 140}, {0, 1280, 0}, {1280, 0, 0}, scene.material({}, {}, kSky), {.chart = false, .sky = true});
            const auto b = bake(std::move(scene), {.error_percent = percent, .seed = static_cast<std::uint64_t>(seed)}, {sun});
            ASSERT_TRUE(b);
            double light = 0;
            for (const Luxel& l : b->scene.surfaces.luxels)
                if (center_of(b->scene.surfaces, l).z <= 0) light += b->lighting.flat[texel_of(b->scene.surfaces, l)].x * luxel * luxel;
            const double truth = 3 * -sun.direction.z * (kHi - kLo) * (kTo - kFrom);
            mean += light / truth / kSeeds;
            EXPECT_LT(b->lighting.error.estimate, 100) << luxel << " " << percent << " " << seed; // a luxel whose light is lost is off by twice itself at most
        }
        EXPECT_NEAR(mean, 1, 0.1) << luxel << " " << percent;
    }
}

// A lamp of which a point sees a 32nd is in the mean as bright as that, though neither the rays of the point nor a few to the lamp are likely to meet it.
TEST(Field, ALampThroughASlit) {
    SurfacesBuilder scene;
    const MaterialId black = scene.material({});
    scene.room({{0, 0, 0}, {256, 256, 128}}, all(black));
    const Vec3 at{160, 112, 127};
    scene.rect(at, {0, 32, 0}, {32, 0, 0}, scene.material({}, {50, 50, 50}), {.chart = false});
    const Vec3 from{120, 120, 0}, up{0, 0, 1};
    const auto above = [&](double x) { return from.x + (x - from.x) * (126.0 / 127); }; // in the plane of the plate, before that x of the lamp
    scene.rect({above(at.x - 8), at.y - 8, 126}, {0, 48, 0}, {above(at.x + 31) - above(at.x - 8), 0, 0}, black, {.chart = false});
    const auto b = bake(std::move(scene), {.error_percent = 20});
    ASSERT_TRUE(b);
    const std::array<Vec3, 4> seen{at + Vec3{31, 0, 0}, at + Vec3{31, 32, 0}, at + Vec3{32, 32, 0}, at + Vec3{32, 0, 0}};
    const double truth = kPi * 50 * lambert_form_factor(from, up, seen);
    constexpr int kTimes = 4000;
    double sum = 0, square = 0;
    for (int seed = 0; seed < kTimes; ++seed) {
        const double e = irradiance(*b->field, from, up, 32, static_cast<std::uint64_t>(seed)).x;
        sum += e / kTimes, square += e * e / kTimes;
    }
    EXPECT_NEAR(sum, truth, 4 * std::sqrt((square - sum * sum) / kTimes));
    EXPECT_LT(4 * std::sqrt((square - sum * sum) / kTimes), 0.25 * truth);
}

#include "compiler/light/lambert.h"
#include "compiler/light/kernels.h"
#include "compiler/light/path_tracer.h"
#include "libs/sampling/sobol.h"
#include "tests/compiler/light/scenes.h"
#include <gtest/gtest.h>
#include <numbers>

using namespace kiln;
using namespace kiln::test;

namespace {
constexpr double kPi = std::numbers::pi;

// Under a sky, or lamps, of radiance 2.
std::unique_ptr<Baked> baked_under_a_hole(bool sky, FaceOptions above, float grey, double error_percent) {
    std::vector<Light> lights(sky);
    for (Light& dome : lights) dome.kind = LightKind::sky, dome.intensity = {2, 2, 2};
    above.sky = sky;
    return bake(room_under_a_hole([&](SurfacesBuilder& s) { return sky ? s.material({}, {}, kSky) : s.material({}, {2, 2, 2}); }, above, grey),
                {.error_percent = error_percent}, std::move(lights));
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

// Faces without luxels shine, reflect and are lit as others are: in a furnace, and below a lamp.
TEST(Bake, FacesWithoutLuxelsReflect) {
    const auto room = [](Rgb rho, Rgb emission, bool floor, std::vector<Light> lights) {
        SurfacesBuilder scene;
        const MaterialId m = scene.material(rho, emission);
        auto walls = all(m);
        walls[4] = MaterialId{};
        scene.room({{0, 0, 0}, {160, 128, 96}}, walls, {.luxel = 16});
        for (const double x : {0.0, 80.0}) scene.rect({x, 0, 0}, {80, 0, 0}, {0, 128, 0}, m, {.luxel = 16, .chart = floor});
        return bake(std::move(scene), {.error_percent = 2}, std::move(lights));
    };
    const auto furnace = room({0.6f, 0.4f, 0.2f}, {0.4f, 0.6f, 0.8f}, false, {});
    std::size_t luxels = 0;
    for (const Luxel& l : furnace->scene.surfaces.luxels) {
        const Rgb e = furnace->lighting.flat[texel_of(furnace->scene.surfaces, l)];
        for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(e[c], kPi, 0.005 * kPi);
        ++luxels;
    }
    EXPECT_GT(luxels, 100u);
    const auto ceiling = [&](bool floor) {
        const auto b = room({0.5f, 0.5f, 0.5f}, {}, floor, {point_light({60, 50, 70}, {1000, 1000, 1000})});
        double sum = 0, count = 0;
        for (const Luxel& l : b->scene.surfaces.luxels)
            if (center_of(b->scene.surfaces, l).z > 95) sum += b->lighting.flat[texel_of(b->scene.surfaces, l)].x, ++count;
        EXPECT_GT(count, 0);
        return sum / count;
    };
    EXPECT_NEAR(ceiling(false) / ceiling(true), 1, 0.02);
}

// E = I cos / r^2.
TEST(Bake, PointLightOnABlackFloor) {
    SurfacesBuilder scene;
    const MaterialId black = scene.material({});
    scene.rect({-128, -128, 0}, {256, 0, 0}, {0, 256, 0}, black, {.luxel = 4});
    const auto b =
        bake(std::move(scene), {.directional = Directional::all}, {point_light({0, 0, 64}, {4096, 8192, 0})});
    for (const Luxel& l : b->scene.surfaces.luxels) {
        const Vec3 d = Vec3{0, 0, 64} - center_of(b->scene.surfaces, l);
        const double e = 4096 * 64 / std::pow(length(d), 3);
        EXPECT_NEAR(b->lighting.flat[texel_of(b->scene.surfaces, l)].x, e, 5e-3 * e);
        EXPECT_NEAR(b->lighting.flat[texel_of(b->scene.surfaces, l)].y, 2 * e, 1e-2 * e);
        const auto& rnm = b->lighting.rnm[texel_of(b->scene.surfaces, l)];
        EXPECT_NEAR((rnm[0].x + rnm[1].x + rnm[2].x) / std::sqrt(3.0),
                    b->lighting.flat[texel_of(b->scene.surfaces, l)].x, 1e-5 * e);
    }
    // The table of the study: distance 1, offset 0, .5, 1, 2.
    const double offsets[][2] = {{0, 1}, {32, .71554175}, {64, .35355339}, {128, .08944272}};
    for (const auto& [x, e] : offsets)
        EXPECT_NEAR(irradiance(*b->field, {x == 128 ? 127.99 : x, 0, 0}, {0, 0, 1}, 64).x, e, 1e-3);
}

// The flux through a luxel is the source's intensity times the solid angle of the luxel, however close it is.
TEST(Bake, ALampNearerThanALuxelIsWide) {
    for (const double height : {4.0, 8.0, 16.0, 40.0}) {
        SurfacesBuilder scene;
        const MaterialId black = scene.material({});
        scene.rect({0, 0, 0}, {48, 0, 0}, {0, 48, 0}, black, {.luxel = 16});
        const Vec3 lamp{22, 25, height};
        const auto b = bake(std::move(scene), {.error_percent = 2}, {point_light(lamp, {1000, 1000, 1000})});
        for (const Luxel& l : b->scene.surfaces.luxels) {
            if (l.area < 0.99) continue;
            const Vec3 c = center_of(b->scene.surfaces, l), x{8, 0, 0}, y{0, 8, 0};
            const double solid = solid_angle(lamp, c - x - y, c + x - y, c + x + y) + solid_angle(lamp, c - x - y, c + x + y, c - x + y);
            const double exact = 1000 * solid / 256;
            EXPECT_NEAR(b->lighting.flat[texel_of(b->scene.surfaces, l)].x, exact, 0.02 * exact) << height << ": " << c.x << ' ' << c.y;
        }
    }
}

// Under a low lamp the light of a luxel varies steeply, and the luxel next to it in a corner sees mostly its rim.
TEST(Bake, CornersBesideSteepLight) {
    SurfacesBuilder scene;
    const MaterialId white = scene.material({0.7f, 0.7f, 0.7f}), black = scene.material({});
    scene.room({{0, 0, 0}, {128, 128, 64}}, {white, black, black, black, white, black}, {.luxel = 16});
    const Vec3 lamp{24, 64, 4}; // over the floor, before the wall at x = 0
    const auto b = bake(std::move(scene), {.error_percent = 2}, {point_light(lamp, {1000, 1000, 1000})});
    const Surfaces& s = b->scene.surfaces;
    std::size_t seen = 0;
    for (std::size_t i = 0; i < s.luxels.size(); ++i) {
        const Luxel& l = s.luxels[i];
        const Vec3 n = s.charts[l.chart.at()].n, c = center_of(s, l);
        if (n.x < 0.5 || c.z > 16 || std::abs(c.y - 64) > 16) continue; // the wall's lowest row
        Rgbd truth;
        constexpr std::uint32_t kPlaces = 256, kPaths = 64;
        const Sobol points(i);
        const Chart& chart = s.charts[l.chart.at()];
        for (std::uint32_t k = 0; k < kPlaces; ++k) {
            const Vec2 u = points.pair(k, 0);
            const Vec3 p = chart.origin + (chart.s * (l.x + u.x) + chart.t * (l.y + u.y)) * chart.luxel_size;
            reference_arriving(*b->field, p, n, kPaths, mix(i, k), [&](Vec3 d, Rgbd w) { truth += w * (std::max(0.0, dot(d, n)) / kPlaces); });
        }
        ++seen;
        EXPECT_NEAR(b->lighting.flat[texel_of(s, l)].x, truth.x, 0.04 * truth.x) << c.y << ' ' << c.z; // the path tracer's noise is 1 %
    }
    EXPECT_GE(seen, 2u);
}

// Parallel squares at distance 1: mean irradiance of the one is pi F.
TEST(Bake, ParallelSquares) {
    SurfacesBuilder scene;
    const MaterialId black = scene.material({}), lamp = scene.material({}, {1, 1, 1});
    scene.rect({0, 0, 0}, {64, 0, 0}, {0, 64, 0}, black, {.luxel = 4});
    scene.rect({0, 0, 64}, {0, 64, 0}, {64, 0, 0}, lamp, {.luxel = 64});
    const auto b = bake(std::move(scene));
    double sum = 0, area = 0;
    for (const Luxel& l : b->scene.surfaces.luxels)
        if (l.chart.value == 0) sum += b->lighting.flat[texel_of(b->scene.surfaces, l)].x * l.area, area += l.area;
    EXPECT_NEAR(sum / area, kPi * 0.1998248957, 2e-3 * kPi * 0.2);
}

// Half a lamp behind a half-plane: the exact penumbra, in the bake and in both ways of asking the field.
TEST(Bake, Penumbra) {
    SurfacesBuilder scene;
    const MaterialId black = scene.material({}), lamp = scene.material({}, {10, 10, 10});
    scene.rect({-100, -100, 0}, {200, 0, 0}, {0, 200, 0}, black, {.luxel = 4});
    scene.rect({-32, -32, 128}, {0, 64, 0}, {64, 0, 0}, lamp);
    scene.rect({0, -400, 64}, {400, 0, 0}, {0, 800, 0}, black,
               {.chart = false}); // x > 0 at half height, both sides
    scene.rect({0, -400, 64}, {0, 800, 0}, {400, 0, 0}, black, {.chart = false});
    const auto b = bake(std::move(scene), {.error_percent = 2});
    for (const double x : {-16.0, -8.0, 0.0, 8.0}) {
        // Seen from x the edge at half height cuts the lamp at -x (+ moves the lamp's own centre).
        const std::vector<Vec3> seen{{-32, -32, 128},
                                     {std::clamp(-x, -32.0, 32.0), -32, 128},
                                     {std::clamp(-x, -32.0, 32.0), 32, 128},
                                     {-32, 32, 128}};
        double factor = 0;
        { // Lambert by brute force, to depend on nothing of ours
            const int n = 200;
            const double w = seen[1].x + 32;
            for (int i = 0; i < n; ++i)
                for (int j = 0; j < n; ++j) {
                    const Vec3 d{-32 + w * (i + .5) / n - x, -32 + 64 * (j + .5) / n, 128};
                    factor += 128 * 128 / (kPi * dot(d, d) * dot(d, d)) * w * 64 / (n * n);
                }
        }
        const double expected = 10 * kPi * factor;
        // 64 points on the lamp, a part of which is seen: a single draw may be 10 % off; the mean of many may not.
        double sum = 0;
        constexpr int kSeeds = 256;
        for (std::uint64_t seed = 0; seed < kSeeds; ++seed) sum += irradiance(*b->field, {x, 0, 0}, {0, 0, 1}, 4096, seed).x / kSeeds;
        EXPECT_NEAR(sum, expected, 0.015 * expected) << x;
        Rgbd reference;
        reference_arriving(*b->field, {x, 0, 0}, {0, 0, 1}, 16384, 5,
                           [&](Vec3 d, Rgbd w) { reference += w * d.z; });
        EXPECT_NEAR(reference.x, expected, 0.04 * expected) << x;
    }
    for (const Luxel& l :
         b->scene.surfaces.luxels) // nothing beyond the shadow: the lamp's edge through the plane's
        if (center_of(b->scene.surfaces, l).z < 1 && center_of(b->scene.surfaces, l).x > 36) {
            EXPECT_LT(b->lighting.flat[texel_of(b->scene.surfaces, l)].x, 1e-6);
        }
}

// A uniform sky over a plane: pi L; at the floor of a trench as deep as half its width: the rest is black walls.
TEST(Bake, UniformSky) {
    SurfacesBuilder scene;
    const MaterialId black = scene.material({}), sky = scene.material({}, {}, kSky);
    std::array<MaterialId, 6> sides{sky, sky, sky, sky, black, sky};
    for (std::size_t i = 0; i < 6; ++i)
        if (i != 4) sides[i] = MaterialId{};
    scene.room({{-256, -256, 0}, {256, 256, 256}}, sides, {.luxel = 16});
    sides = {sky, sky, sky, sky, MaterialId{}, sky};
    scene.room({{-256, -256, 0}, {256, 256, 256}}, sides, {.sky = true});
    Light dome;
    dome.kind = LightKind::sky, dome.intensity = {2, 1, 0.5f};
    const auto b = bake(std::move(scene), {.directional = Directional::all}, {dome});
    for (const Luxel& l : b->scene.surfaces.luxels) {
        const Rgb e = b->lighting.flat[texel_of(b->scene.surfaces, l)];
        EXPECT_NEAR(e.x, 2 * kPi, 0.01 * kPi);
        EXPECT_NEAR(e.z, 0.5 * kPi, 0.005 * kPi);
    }
    EXPECT_EQ(b->lighting.escaped_rays, 0u);
    // Straight sun of irradiance 3 through the same sky: E = 3 sin(elevation).
    Light sun;
    sun.kind = LightKind::sun, sun.direction = normalize(Vec3{1, 0, -1}), sun.intensity = {3, 3, 3};
    Rgbd e;
    const auto c = bake(b->scene, {}, {sun});
    c->field->arriving_direct({0, 0, 0}, {0, 0, 1}, 1, [&](Vec3 d, Rgbd w) { e += w * d.z; });
    EXPECT_NEAR(e.x, 3 / std::sqrt(2.0), 1e-9);
}

// What lies above a hole has irradiance pi L times the form factor of what of the hole is seen, sky or lamp. Points on such faces cost thousands of rays a luxel.
TEST(Bake, SkyAndLampsAboveAHole) {
    for (const bool sky : {true, false}) {
        SCOPED_TRACE(sky ? "sky" : "lamps");
        const auto b = baked_under_a_hole(sky, {.chart = false}, 0, 5);
        const Surfaces& s = b->scene.surfaces;
        const double floor = error_floor(LightOptions{}.error_floor, mean_irradiance(s, b->lighting));
        double square = 0, area = 0;
        std::size_t below = 0;
        for (const Luxel& l : s.luxels) {
            const Vec3 at = center_of(s, l), n = s.charts[l.chart.at()].n;
            double factor = at.z > kCeiling ? 1 : 0;
            if (at.z < kCeiling) {
                // What is seen through both ends of the hole, in the plane of the lower.
                const double k = (kCeiling - at.z) / (kRoof - at.z);
                const auto through = [&](double place, double end) { return place + (end - place) * k; };
                const double x0 = std::max(kHole.x0, through(at.x, kHole.x0)), x1 = std::min(kHole.x1, through(at.x, kHole.x1));
                const double y0 = std::max(kHole.y0, through(at.y, kHole.y0)), y1 = std::min(kHole.y1, through(at.y, kHole.y1));
                const Vec3 p{x0, y0, kCeiling}, q{x1, y0, kCeiling}, r{x1, y1, kCeiling}, t{x0, y1, kCeiling};
                if (x0 < x1 && y0 < y1) factor = triangle_form_factor(at, n, {p, q, r}) + triangle_form_factor(at, n, {p, r, t});
                ++below;
            }
            const double expected = 2 * kPi * factor, found = static_cast<double>(b->lighting.flat[texel_of(s, l)].x), a = l.area * luxel_area(s, l.face);
            const double relative = (found - expected) / std::max(expected, floor);
            square += a * relative * relative, area += a;
        }
        EXPECT_EQ(below, 256u + 4 * 128);
        EXPECT_LT(100 * std::sqrt(square / area), b->lighting.error.high);
        EXPECT_LE(b->lighting.error.estimate, 5);
        EXPECT_LT(static_cast<double>(b->lighting.rays), 300.0 * static_cast<double>(s.luxels.size()));
    }
}

// A shaft as wide as two luxels beside a bright room: light falls off along it within a patch, which the solution knows nothing of. With patches alone its luxels
// are 21 % too bright in the root mean square, of which no seed is to blame.
TEST(Bake, AShaftBesideABrightRoom) {
    constexpr std::uint64_t kSeeds = 4;
    std::vector<std::unique_ptr<Baked>> bakes;
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) bakes.push_back(bake(shaft_beside_a_room(), {.seed = seed}, {point_light({20, 128, 20}, {4000, 4000, 4000})}));
    const Surfaces& s = bakes[0]->scene.surfaces;
    double square = 0, sum = 0, count = 0;
    for (std::size_t i = 0; i < s.luxels.size(); i += 6) {
        const Luxel& l = s.luxels[i];
        const Chart& chart = s.charts[l.chart.at()];
        const Vec3 at = center_of(s, l);
        if (at.z > 0) continue;
        double found = 0, reference = 0;
        for (const auto& b : bakes) found += static_cast<double>(b->lighting.flat[texel_of(s, l)].x) / kSeeds;
        constexpr int kSide = 4; // places
        for (int k = 0; k < kSide * kSide; ++k) {
            const Vec3 p = at + (chart.s * ((k % kSide + 0.5) / kSide - 0.5) + chart.t * ((k / kSide + 0.5) / kSide - 0.5)) * chart.luxel_size;
            reference_arriving(*bakes[0]->field, p, chart.n, 1024, mix(i, k), [&](Vec3 d, Rgbd w) { reference += w.x * std::max(0.0, dot(d, chart.n)) / (kSide * kSide); });
        }
        square += (found / reference - 1) * (found / reference - 1), sum += found / reference, ++count;
    }
    EXPECT_GT(count, 60);
    EXPECT_LT(100 * std::sqrt(square / count), 18);
    EXPECT_NEAR(sum / count, 1, 0.13);
}

// With walls that reflect, by luxel and by the field, against path tracing, which has points on the sky and on lamps.
TEST(Bake, SkyAndLampsAboveAHoleOfAGreyRoom) {
    for (const bool sky : {true, false}) {
        SCOPED_TRACE(sky ? "sky" : "lamps");
        const auto b = baked_under_a_hole(sky, {.luxel = 64}, 0.5f, 2);
        const Surfaces& s = b->scene.surfaces;
        const double floor = error_floor(LightOptions{}.error_floor, mean_irradiance(s, b->lighting));
        double luxels = 0, field = 0, count = 0, sum = 0, expected = 0, room = 0, all = 0;
        for (std::size_t i = 0; i < s.luxels.size(); ++i) {
            const Luxel& l = s.luxels[i];
            const Vec3 at = center_of(s, l), n = s.charts[l.chart.at()].n;
            const double area = l.area * luxel_area(s, l.face);
            all += area;
            if (at.z > kCeiling - 1) continue;
            room += area;
            if (i % 21) continue;
            Rgbd reference, asked;
            reference_arriving(*b->field, at, n, 16384, 5, [&](Vec3 d, Rgbd w) { reference += w * std::max(0.0, dot(d, n)); });
            for (std::uint64_t seed = 0; seed < 4; ++seed) asked += irradiance(*b->field, at, n, 4096, seed) * 0.25;
            const double found = static_cast<double>(b->lighting.flat[texel_of(s, l)].x), scale = std::max(reference.x, floor);
            luxels += (found - reference.x) * (found - reference.x) / (scale * scale), field += (asked.x - reference.x) * (asked.x - reference.x) / (scale * scale);
            sum += found, expected += reference.x, ++count;
        }
        EXPECT_GT(count, 30);
        EXPECT_LT(100 * std::sqrt(luxels / count * room / all), b->lighting.error.high); // what the room has of the error of the map
        EXPECT_NEAR(sum / expected, 1, 0.1);                                             // nothing counts twice or never
        if (sky) {
            EXPECT_LT(std::sqrt(field / count), 0.05); // a bundle has no guide: of lamps so far behind something it knows less
        }
    }
}

// Everything that is emitted is absorbed: sum A (1 - rho) H = sum A M.
TEST(Bake, EnergyBalance) {
    const auto b = bake(two_rooms(20));
    double emitted = 0, absorbed = 0;
    for (std::size_t p = 0; p < b->lighting.patches.size(); ++p) {
        const Patch& patch = b->lighting.patches[p];
        emitted += patch.area * patch.emission.x;
        if (patch.reflectance.x > 0) {
            const double h = (b->lighting.radiosity[p].x - patch.emission.x) / patch.reflectance.x;
            absorbed += patch.area * (1 - patch.reflectance.x) * h;
        }
    }
    EXPECT_NEAR(absorbed / emitted, 1, 0.02); // rows are sampled
}

// The bake against the path tracer on the two rooms of the study, in the lit room and the dark one, by luxel; and
// its own estimate must not promise much less than the error found.
TEST(Bake, TwoRoomsAgainstThePathTracer) {
    const auto b = bake(two_rooms(), {.error_percent = 5});
    const Surfaces& s = b->scene.surfaces;
    double square = 0, area = 0, mean_true = 0;
    std::vector<std::pair<double, double>> pairs;
    for (std::size_t i = 0; i < s.luxels.size(); i += 41) {
        const Luxel& l = s.luxels[i];
        const Vec3 n = s.charts[l.chart.at()].n;
        if (l.area < 0.99) continue;
        double truth = 0;
        const Sobol points(i);
        for (std::uint32_t k = 0; k < 256; ++k) {
            const Vec2 u = points.pair(k, 0);
            const Chart& c = s.charts[l.chart.at()];
            const Vec3 p = c.origin + (c.s * (l.x + u.x) + c.t * (l.y + u.y)) * c.luxel_size;
            reference_arriving(*b->field, p, n, 64, mix(i, k),
                               [&](Vec3 d, Rgbd w) { truth += w.x * std::max(0.0, dot(d, n)) / 256; });
        }
        pairs.emplace_back(b->lighting.flat[texel_of(s, l)].x, truth);
        mean_true += truth;
    }
    mean_true /= static_cast<double>(pairs.size());
    for (const auto& [got, truth] : pairs) {
        const double e = (got - truth) / std::max(truth, 0.02 * mean_true);
        square += e * e, area += 1;
    }
    const double error = 100 * std::sqrt(square / area); // the path tracer's own noise, about 2.4 %, is in it
    EXPECT_LT(error, std::hypot(5, 2.4));
    EXPECT_LT(b->lighting.error.estimate, 5);
    EXPECT_GT(b->lighting.error.estimate, 0.3 * std::sqrt(std::max(0.0, error * error - 2.4 * 2.4)));
    // Its parts are independent, and its bounds lie on both sides of it.
    const ErrorReport& e = b->lighting.error;
    const double parts = e.noise * e.noise + e.patch_bias * e.patch_bias + e.shortcuts * e.shortcuts + e.solution * e.solution + e.iteration * e.iteration;
    EXPECT_NEAR(e.estimate, std::sqrt(parts), 1e-9);
    EXPECT_LT(e.low, e.estimate);
    EXPECT_GT(e.high, 1.02 * e.estimate);
    EXPECT_LT(e.high, 3 * e.estimate); // were it patch bias alone, which may fall with h as it may with its square
    EXPECT_GT(e.solution, 0);
}

// A lamp far enough away to be one light for the normal, of which the horizon of a tilted one shows a sliver.
TEST(Bake, ALampAcrossTheHorizonOfABasisVector) {
    SurfacesBuilder scene;
    const MaterialId black = scene.material({}), lamp = scene.material({}, {1, 1, 1});
    scene.rect({0, 32, 48}, {0, 16, 0}, {0, 0, 16}, black, {.luxel = 16}); // towards +x
    const Vec3 corner{40, 48, 94};
    scene.rect(corner, {0, 32, 0}, {32, 0, 0}, lamp, {.luxel = 32}); // down
    for (const double error : {0.5, 2.0}) {
        const auto b = bake(scene, {.error_percent = error, .encoding = RnmEncoding::tilted, .directional = Directional::all});
        int seen = 0;
        for (const Luxel& l : b->scene.surfaces.luxels) {
            const Chart& chart = b->scene.surfaces.charts[l.chart.at()];
            const Vec3 middle = center_of(b->scene.surfaces, l);
            if (l.area < 0.99 || middle.x > 1) continue;
            ++seen;
            std::array<double, 4> exact{};
            constexpr int kPlaces = 16, kPoints = 64;
            for (int k = 0; k < kPlaces * kPlaces; ++k)
                for (int q = 0; q < kPoints * kPoints; ++q) {
                    const Vec3 x = middle + Vec3{0, ((k % kPlaces + 0.5) / kPlaces - 0.5) * 16, ((k / kPlaces + 0.5) / kPlaces - 0.5) * 16};
                    const Vec3 y = corner + Vec3{(q % kPoints + 0.5) / kPoints * 32, (q / kPoints + 0.5) / kPoints * 32, 0}, to = y - x;
                    const double r = length(to), weight = to.z / (r * r * r) / r * (32.0 / kPoints) * (32.0 / kPoints) / (kPlaces * kPlaces);
                    exact[0] += to.x * weight;
                    for (std::size_t i = 0; i < 3; ++i) exact[i + 1] += std::max(0.0, dot(to, chart.frame.world(kRnmBasis[i]))) * weight;
                }
            const std::size_t t = texel_of(b->scene.surfaces, l);
            EXPECT_NEAR(b->lighting.flat[t].x, exact[0], 0.01 * exact[0]);
            const double least = *std::ranges::min_element(exact);
            EXPECT_LT(least, 0.05 * exact[0]) << "the sliver";
            for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(b->lighting.rnm[t][i].x, exact[i + 1], 0.01 * exact[i + 1] + 1e-3 * exact[0]) << i << " at --error " << error << " of " << exact[0];
        }
        EXPECT_EQ(seen, 1);
    }
}

// A wall that shines down to the floor before it. Where the horizon of a tilted normal cuts it, that normal gets more than from the mean
// direction of what is above the floor: with parts as coarse as one point a place it was 5 to 7 % too dark.
TEST(Bake, WallOfLightNextToLuxelsAlongTiltedNormals) {
    SurfacesBuilder scene;
    const MaterialId black = scene.material({}), lamp = scene.material({}, {1, 1, 1});
    scene.rect({0, 0, 0}, {128, 0, 0}, {0, 128, 0}, black, {.luxel = 16});
    scene.rect({128, 0, 0}, {0, 0, 128}, {0, 128, 0}, lamp, {.luxel = 128}); // towards -x
    const auto b = bake(std::move(scene), {.error_percent = 2, .encoding = RnmEncoding::tilted, .directional = Directional::all});
    const Surfaces& s = b->scene.surfaces;
    double square = 0, count = 0, brightest = 0;
    for (const Luxel& l : s.luxels) {
        const Chart& c = s.charts[l.chart.at()];
        if (!(c.n.z > 0.5) || center_of(s, l).x < 112) continue;
        const std::size_t texel = texel_of(s, l);
        for (std::size_t k = 0; k < 3; ++k) {
            const Vec3 way = c.frame.world(kRnmBasis[k]);
            constexpr int kSide = 16;
            double exact = 0;
            for (int i = 0; i < kSide * kSide; ++i) {
                const Vec3 x = c.origin + (c.s * (l.x + (i % kSide + 0.5) / kSide) + c.t * (l.y + (i / kSide + 0.5) / kSide)) * c.luxel_size;
                exact += lambert_form_factor(x, way, std::array<Vec3, 4>{Vec3{128, 0, 0}, {128, 0, 128}, {128, 128, 128}, {128, 128, 0}}) * kPi / (kSide * kSide);
            }
            const double got = b->lighting.rnm[b->lighting.rnm_first[l.chart.at()] + texel - c.first_texel][k].x;
            brightest = std::max(brightest, exact);
            square += std::pow(got / std::max(exact, 0.1) - exact / std::max(exact, 0.1), 2), ++count;
        }
    }
    EXPECT_GT(brightest, 1);
    EXPECT_LT(std::sqrt(square / count), 0.02);
}

// Luxels learn from those beside them what they gathered: bakes with other random numbers then differ by less than the rays of a luxel alone would let
// them, as the error stored with each says, and by the wall that stands on the floor there is still a step.
TEST(Bake, NeighboursTakeNoiseNotSteps) {
    constexpr std::uint64_t kSeeds = 6;
    std::vector<std::unique_ptr<Baked>> bakes;
    for (std::uint64_t seed = 0; seed < kSeeds; ++seed) bakes.push_back(bake(two_rooms(5), {.error_percent = 10, .seed = seed}));
    const Surfaces& s = bakes[0]->scene.surfaces;
    double found = 0, told = 0, count = 0, lit = 0, dark = 0, lits = 0, darks = 0;
    for (const Luxel& l : s.luxels) {
        const Vec3 x = center_of(s, l), n = s.charts[l.chart.at()].n;
        const std::size_t t = texel_of(s, l);
        double mean = 0, square = 0;
        for (const auto& b : bakes) mean += b->lighting.flat[t].x / kSeeds;
        for (const auto& b : bakes) square += std::pow(b->lighting.flat[t].x / mean - 1, 2) / (kSeeds - 1);
        if (x.x > 195 && mean > 0) // only the doorway lights it: little of it is direct
            for (const auto& b : bakes) found += square / kSeeds, told += std::pow(static_cast<double>(b->lighting.texel_error[t]), 2) / kSeeds, count += 1.0 / kSeeds;
        if (n.z > 0.5 && x.z == 0 && x.y > 220) { // right before the partition, and right behind it
            if (x.x > 172 && x.x < 180) lit += mean, ++lits;
            if (x.x > 190 && x.x < 198) dark += mean, ++darks;
        }
    }
    found = std::sqrt(found / count), told = std::sqrt(told / count);
    EXPECT_LT(found, 1.1 * told);
    EXPECT_GT(found, 0.6 * told);
    EXPECT_LT(found, 0.1); // 0.116 by their own rays alone, and more of them
    EXPECT_GT(lit / lits, 15 * dark / darks); // 20.1
}

// A small bright spot that one ray of a luxel meets, and none of those around, leaves no speck, and no light is lost with it.
TEST(Bake, RareBrightRaysAreNoSpecks) {
    constexpr std::uint64_t kSeeds = 3;
    const auto truth = bake(two_rooms(5), {.error_percent = 2});
    const Surfaces& s = truth->scene.surfaces;
    std::size_t specks = 0;
    double sum = 0, right = 0;
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
        const auto draft = bake(two_rooms(5), {.error_percent = 40, .seed = seed});
        for (const Luxel& l : s.luxels) {
            const std::size_t t = texel_of(s, l);
            const double is = draft->lighting.flat[t].x, should = truth->lighting.flat[t].x;
            if (is > 1.5 * should) ++specks;
            sum += is * l.area, right += should * l.area;
        }
    }
    EXPECT_LT(specks, kSeeds * s.luxels.size() / 400); // 7 in a thousand luxels as they are gathered and smoothed, 1 in a thousand with spikes spread
    EXPECT_NEAR(sum / right, 1, 0.004);
}

// Close to a point paths ask one of the lights that the bake found on a patch: on the average nothing changes.
// Forty lamps at one end of a room, at the other end a plate that hides all or half of them from the wall behind.
TEST(Bake, OneOfManyLightsStandsForAll) {
    SurfacesBuilder scene;
    const MaterialId grey = scene.material({0.5f, 0.5f, 0.5f});
    scene.room({{0, 0, 0}, {256, 128, 96}}, all(grey));
    scene.rect({236, 52, 36}, {0, 0, 24}, {0, 24, 0}, grey);
    scene.rect({236, 52, 36}, {0, 24, 0}, {0, 0, 24}, grey);
    std::vector<Light> lamps;
    for (int i = 0; i < 40; ++i)
        lamps.push_back(point_light({12.0 + i % 5, 40 + (i * 37) % 48 * 1.0, 30 + (i * 23) % 36 * 1.0}, {300.0f + 40 * static_cast<float>(i % 7), 300, 300}));
    lamps.push_back(point_light({128, 64, 200}, {300, 300, 300})); // above the ceiling
    const auto b = bake(std::move(scene), {.error_percent = 20}, lamps);
    const LightField::Data& d = b->field->data();
    const PathTracer tracer{d};
    std::uint32_t dark = 0, lit = 0;
    for (double y = 4; y < 128; y += 5) {
        const auto hit = d.scene.closest({240, y, 50}, {1, 0, 0});
        ASSERT_TRUE(hit);
        const std::uint32_t piece = d.place_at(*hit);
        for (const LightBrings& light : d.entities_of(piece)) EXPECT_LT(light.light, 40u);
        const Vec3 n{-1, 0, 0}, x{255.9, y, 50};
        Random random(7);
        const double truth = tracer.entities(PathTracer::kNoPiece, x, n, random).x;
        ++(truth > 0 ? lit : dark);
        double sum = 0, square = 0;
        constexpr int kTimes = 4096;
        for (int i = 0; i < kTimes; ++i) {
            const double e = tracer.entities(piece, x, n, random).x;
            sum += e / kTimes, square += e * e / kTimes;
        }
        EXPECT_NEAR(sum, truth, 4.5 * std::sqrt((square - sum * sum) / kTimes) + 1e-9) << y;
    }
    EXPECT_GE(lit, 15u);
    EXPECT_GE(dark, 3u);
}

// What a memo of rays may depend on does not go by how patches are numbered: which there are follows from the light.
TEST(Bake, WhatRaysCloseByDependOnGoesByPieces) {
    const auto b = bake(two_rooms(20), {.error_percent = 20}, {point_light({60, 60, 60}, {400, 300, 200})});
    Lighting other = b->lighting;
    const auto n = static_cast<std::uint32_t>(other.patches.size());
    std::ranges::reverse(other.patches), std::ranges::reverse(other.radiosity);
    for (auto* of : {&other.patch_index, &other.piece_patch, &other.face_patch})
        for (std::uint32_t& p : *of)
            if (p < n) p = n - 1 - p;
    other.first_brought.assign(1, 0), other.brought.clear();
    for (std::uint32_t p = n; p-- > 0; other.first_brought.push_back(static_cast<std::uint32_t>(other.brought.size())))
        other.brought.insert(other.brought.end(), b->lighting.brought.begin() + b->lighting.first_brought[p], b->lighting.brought.begin() + b->lighting.first_brought[p + 1]);
    const LightField field(b->scene.world, b->bsp, b->planes, b->scene.surfaces, b->lights, other);
    EXPECT_EQ(field.part_states(), b->field->part_states());
    other.brought.front().irradiance *= 2;
    const LightField brighter(b->scene.world, b->bsp, b->planes, b->scene.surfaces, b->lights, other);
    EXPECT_NE(brighter.part_states(), b->field->part_states());
}

// A spot with a hard edge on luxels that are patches of their own: those that its rim cuts get their share, wherever it falls among their test rays.
TEST(Bake, RimOfASpotOnCoarseLuxels) {
    const auto flux = [](double luxel) {
        SurfacesBuilder scene;
        scene.rect({-512, -512, 0}, {1024, 0, 0}, {0, 1024, 0}, scene.material({}), {.luxel = luxel});
        Light spot = point_light({13, 7, 300}, {1e5, 1e5, 1e5});
        spot.kind = LightKind::spot, spot.direction = {0, 0, -1}, spot.cos_inner = spot.cos_outer = 0.8;
        const auto b = bake(std::move(scene), {.error_percent = 5}, {spot});
        double sum = 0, lit = 0;
        for (const Luxel& l : b->scene.surfaces.luxels)
            if (const double e = b->lighting.flat[texel_of(b->scene.surfaces, l)].x; e > 0) sum += e * luxel * luxel, ++lit;
        return std::pair(sum, lit);
    };
    const auto [fine, many] = flux(8);
    const auto [coarse, few] = flux(64);
    EXPECT_NEAR(coarse, fine, 0.02 * fine);
    // Squares that a circle of radius 225 about (13, 7) reaches into, each by an eighth of its area at least.
    int reached = 0;
    for (int y = -8; y < 8; ++y)
        for (int x = -8; x < 8; ++x) {
            int inside = 0;
            for (int k = 0; k < 1024; ++k) inside += std::hypot(64 * (x + (k % 32 + 0.5) / 32) - 13, 64 * (y + (k / 32 + 0.5) / 32) - 7) < 225;
            reached += inside >= 128;
        }
    EXPECT_GE(few, reached);
    EXPECT_GT(many, 0);
}

// Twice the light, twice the irradiance; two lights, the sum of both.
TEST(Bake, LinearInItsLights) {
    SurfacesBuilder scene;
    const MaterialId grey = scene.material({0.5f, 0.5f, 0.5f});
    scene.room({{0, 0, 0}, {128, 128, 96}}, all(grey));
    const Light a = point_light({30, 40, 60}, {900, 0, 0}), c = point_light({100, 90, 20}, {500, 0, 0});
    const auto one = bake(scene, {}, {a}), two = bake(scene, {}, {c}), both = bake(scene, {}, {a, c});
    double square = 0, count = 0, worst = 0;
    for (const Luxel& l : scene.surfaces.luxels) {
        const std::size_t t = texel_of(scene.surfaces, l);
        const double sum = one->lighting.flat[t].x + two->lighting.flat[t].x;
        const double e = both->lighting.flat[t].x / sum - 1;
        square += e * e, ++count, worst = std::max(worst, std::abs(e));
    }
    EXPECT_LT(std::sqrt(square / count), 0.04); // each of the three bakes has a noise of 3 %
    EXPECT_LT(worst, 0.2);
}

// Of a room that keeps nearly all light, what the rows are off by adds up over hundreds of bounces.
double noise_of_solution(float reflectance, double error_percent) {
    SurfacesBuilder scene = two_rooms(10);
    for (Material& m : scene.world.materials) m.reflectance = {reflectance, reflectance, reflectance};
    return bake(std::move(scene), {.error_percent = error_percent}, {point_light({60, 60, 80}, {3000, 3000, 3000})}, 2)->lighting.error.solution;
}
TEST(Bake, NoiseOfTheSolutionGrowsWithReflectance) {
    EXPECT_GT(noise_of_solution(0.97f, 10), noise_of_solution(0.8f, 10));
}
// Rows are as long as that takes: more rays of the gather would not help.
TEST(Bake, NoiseOfTheSolutionHasItsShareOfTheTarget) {
    for (const double target : {6.0, 4.0}) EXPECT_LE(noise_of_solution(0.97f, target), 0.4 * target) << target;
}

// A closed dark box inside a bright one, its walls thin and off every lattice: nothing gets in, whatever the
// offset.
TEST(Bake, ThinWallsDoNotLeak) {
    for (const double thickness : {4.0, 0.25}) {
        SurfacesBuilder scene;
        const MaterialId grey = scene.material({0.8f, 0.8f, 0.8f}),
                         lamp = scene.material({0.5f, 0.5f, 0.5f}, {5, 5, 5});
        const Box3 inside{{41.3, 37.7, 21.1}, {83.9, 90.2, 61.7}};
        Box3 outside = inside;
        outside.lo = outside.lo - Vec3{thickness, thickness, thickness},
        outside.hi = outside.hi + Vec3{thickness, thickness, thickness};
        scene.room({{0, 0, 0}, {128, 128, 96}}, all(lamp));
        const std::uint32_t first = static_cast<std::uint32_t>(scene.surfaces.charts.size());
        scene.room(inside, all(grey));
        const std::uint32_t last = static_cast<std::uint32_t>(scene.surfaces.charts.size());
        scene.block(outside, all(grey));
        const auto b = bake(std::move(scene));
        for (const Luxel& l : b->scene.surfaces.luxels) {
            const Rgb e = b->lighting.flat[texel_of(b->scene.surfaces, l)];
            if (l.chart.value >= first && l.chart.value < last)
                EXPECT_EQ(e.x, 0);
            else
                EXPECT_GT(e.x, 1);
        }
        EXPECT_EQ(b->lighting.back_face_rays, 0u);
        EXPECT_EQ(b->lighting.escaped_rays, 0u);
    }
}

TEST(Bake, SameBytesForAnyNumberOfThreads) {
    const std::vector<Light> lights{point_light({250, 60, 80}, {3000, 2000, 1000})};
    const LightOptions options{.error_percent = 10, .directional = Directional::all};
    const Bytes one = to_bytes(bake(two_rooms(20), options, lights, 1)->lighting);
    EXPECT_EQ(one, to_bytes(bake(two_rooms(20), options, lights, 2)->lighting));
    EXPECT_EQ(one, to_bytes(bake(two_rooms(20), options, lights, 7)->lighting));
}

// An empty world, a world without light, faces without charts: defined results.
TEST(Bake, NothingToDo) {
    const auto empty = bake(SurfacesBuilder{});
    ASSERT_TRUE(empty);
    EXPECT_TRUE(empty->lighting.patches.empty());
    SurfacesBuilder scene;
    scene.room({{0, 0, 0}, {64, 64, 64}}, all(scene.material({0.5f, 0.5f, 0.5f})), {.chart = false});
    const auto dark = bake(std::move(scene));
    EXPECT_EQ(dark->lighting.patches.size(), 6u);
    EXPECT_EQ(dark->lighting.error.estimate, 0);
}

// A smoothed normal bends the kernel, not the hemisphere: E = I max(0, n_s . w) where the face itself is lit, and 0
// where the light stands behind the face, however the normal is bent towards it.
TEST(Bake, SmoothedNormals) {
    SurfacesBuilder scene;
    scene.rect({-32, -32, 0}, {64, 0, 0}, {0, 64, 0}, scene.material({}), {.luxel = 8});
    const Vec3 bent = normalize(Vec3{1, 0, 0.4});
    for (auto& corners : scene.surfaces.corner_normals) corners.fill(static_cast<Vec3f>(bent));
    scene.surfaces.charts[0].smooth = true;
    const LightOptions options{.directional = Directional::all};
    const auto lit = bake(scene, options, {point_light({600, 0, 600}, {1e6f, 1e6f, 1e6f})});
    const auto steep = bake(scene, options, {point_light({-600, 0, 200}, {1e6f, 1e6f, 1e6f})});
    const auto behind = bake(scene, options, {point_light({600, 0, -50}, {1e6f, 1e6f, 1e6f})});
    for (const Luxel& l : scene.surfaces.luxels) {
        const std::size_t t = texel_of(scene.surfaces, l);
        const Vec3 d = Vec3{600, 0, 600} - center_of(scene.surfaces, l);
        const double e = 1e6 * dot(d, bent) / std::pow(length(d), 3);
        EXPECT_NEAR(lit->lighting.flat[t].x, e, 5e-3 * e);
        const auto& rnm = lit->lighting.rnm[t];
        EXPECT_NEAR((rnm[0].x + rnm[1].x + rnm[2].x) / std::sqrt(3.0), e, 5e-3 * e);
        EXPECT_EQ(steep->lighting.flat[t].x, 0); // above the face, below the bent normal's horizon
        EXPECT_EQ(behind->lighting.flat[t].x, 0);
    }
}

// The bound of the error holds where each luxel is measured: what the measure itself is off by stays. Errors are against the mean of many bakes.
TEST(Bake, BoundOfTheErrorOfFewLuxels) {
    SurfacesBuilder scene;
    const MaterialId m = scene.material({0.6f, 0.5f, 0.4f});
    scene.room({{0, 0, 0}, {256, 256, 128}}, all(m), {.luxel = 64});
    scene.rect({100, 100, 127}, {0, 32, 0}, {32, 0, 0}, scene.material({}, {50, 50, 50}), {.chart = false});
    for (const auto& [u, v] : {std::pair{Vec3{0, 72, 0}, Vec3{72, 0, 0}}, std::pair{Vec3{72, 0, 0}, Vec3{0, 72, 0}}}) scene.rect({80, 80, 60}, u, v, m, {.chart = false});
    constexpr int kBakes = 24;
    std::vector<std::uint32_t> texels;
    std::vector<Lighting> bakes;
    for (int i = 0; i < kBakes; ++i) {
        const auto b = bake(scene, {.error_percent = 20, .seed = static_cast<std::uint64_t>(i) + 1});
        ASSERT_TRUE(b);
        texels.clear();
        for (const Luxel& l : b->scene.surfaces.luxels) texels.push_back(texel_of(b->scene.surfaces, l));
        bakes.push_back(b->lighting);
    }
    ASSERT_EQ(texels.size(), 64u);
    std::vector<Rgbd> mean_of(texels.size());
    Rgbd level;
    const auto luxels = static_cast<double>(texels.size());
    for (std::size_t k = 0; k < texels.size(); ++k) {
        for (const Lighting& b : bakes) mean_of[k] += static_cast<Rgbd>(b.flat[texels[k]]) * (1.0 / kBakes);
        level += mean_of[k] / luxels;
    }
    int covered = 0;
    for (const Lighting& b : bakes) {
        double squares = 0;
        for (std::size_t k = 0; k < texels.size(); ++k)
            for (std::size_t c = 0; c < 3; ++c) {
                const double off = (static_cast<double>(b.flat[texels[k]][c]) - mean_of[k][c]) / std::max(mean_of[k][c], LightOptions{}.error_floor * level[c]);
                squares += off * off / (3 * luxels);
            }
        covered += 100 * std::sqrt(squares * kBakes / (kBakes - 1)) <= b.error.high;
    }
    EXPECT_GE(covered, kBakes - 2); // 16 if the bound is told as if the measure were exact
}

// Asked to stop, it stops with the fault that leads to exit 7.
TEST(Bake, Cancelled) {
    SurfacesBuilder scene = two_rooms(20);
    std::atomic<bool> stop = true;
    Context context;
    context.stop = &stop;
    const auto r = bake_light(scene.world, {}, {}, scene.surfaces, {}, {}, context);
    ASSERT_FALSE(r);
    EXPECT_EQ(r.fault().exit, Exit::cancelled);
}

// Sixty lamps, half of them behind a wall and of the others every second half hidden by a plate below it: a point that has 32 rays asks no more of them than that, and on the average nothing is lost. In black rooms, so that their light is all there is.
TEST(Field, ManyLampsWithinTheRaysOfAPoint) {
    SurfacesBuilder scene;
    const MaterialId black = scene.material({});
    scene.room({{0, 0, 0}, {512, 256, 128}}, all(black));
    scene.rect({256, 0, 0}, {0, 256, 0}, {0, 0, 128}, black);
    scene.rect({256, 0, 0}, {0, 0, 128}, {0, 256, 0}, black);
    struct Lamp {
        std::array<Vec3, 4> corner;
        double radiance;
    };
    const Vec3 from{120, 120, 0}, up{0, 0, 1};
    std::vector<Lamp> seen;
    for (int i = 0; i < 60; ++i) {
        const double x = 20 + (i % 10) * 50.0, y = 20 + (i / 10) * 42.0, radiance = 10 + 5 * (i % 3);
        const Vec3 at{x, y, 127};
        scene.rect(at, {0, 4, 0}, {4, 0, 0}, scene.material({}, {static_cast<float>(radiance), static_cast<float>(radiance), static_cast<float>(radiance)}), {.chart = false});
        double hidden = 0;
        if (i % 2) {
            scene.rect({x - 2, y - 2, 126.5}, {0, 8, 0}, {4, 0, 0}, black, {.chart = false});
            hidden = from.x + (x + 2 - from.x) * (127 / 126.5) - x;
        }
        if (x < 256) seen.push_back({{at + Vec3{hidden, 0, 0}, at + Vec3{hidden, 4, 0}, at + Vec3{4, 4, 0}, at + Vec3{4, 0, 0}}, radiance});
    }
    const auto b = bake(std::move(scene), {.error_percent = 20});
    ASSERT_TRUE(b);
    ASSERT_EQ(seen.size(), 30u);
    double truth = 0;
    for (const Lamp& lamp : seen) truth += kPi * lamp.radiance * lambert_form_factor(from, up, lamp.corner);
    constexpr std::uint32_t kRays = 32;
    constexpr int kTimes = 400;
    for (const bool free : {false, true}) { // from all around: the same light
        const Vec3 point = from + up * (free ? 1e-3 : 0), normal = free ? Vec3{} : up;
        double sum = 0, square = 0;
        for (int seed = 0; seed < kTimes; ++seed) {
            const auto s = static_cast<std::uint64_t>(seed);
            const FieldBundle bundle = b->field->bundle(point, normal, kRays, s);
            const std::vector<Rgbd> reflected = b->field->reflected(bundle);
            const FieldEmitters asked = b->field->emitters(bundle, b->field->level(bundle, reflected, normal, s), point, normal, s);
            EXPECT_LE(asked.arrivals.size(), kRays);
            EXPECT_TRUE(std::ranges::is_sorted(asked.listed));
            double e = 0;
            const auto add = [&](Vec3 d, Rgbd w) { e += w.x * std::max(0.0, d.z); };
            b->field->arriving(bundle, reflected, asked, normal, s, add, add);
            sum += e / kTimes, square += e * e / kTimes;
        }
        const double spread = std::sqrt(square - sum * sum);
        EXPECT_NEAR(sum, truth, 4 * spread / std::sqrt(kTimes)) << free;
        EXPECT_LT(spread, 0.25 * truth) << free; // some 25 of 32 rays, a third of which a plate stops; one ray by chance has 1
    }
}

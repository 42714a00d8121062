#include "tests/compiler/ambient/box_world.h"
#include "compiler/ambient/cube.h"
#include "compiler/ambient/separate.h"
#include <gtest/gtest.h>

namespace kiln::ambient {
namespace {

constexpr double kPi = std::numbers::pi;

Ambient build(const BoxWorld& world, AmbientOptions options = {}, int threads = 2) {
    Context context;
    context.threads = threads;
    Ambient out = build_lattice(air_of(world), options, context);
    validate(out);
    return out;
}

double largest_error(const std::array<Rgb, 6>& cube, double expected) {
    double worst = 0;
    for (const Rgb& c : cube)
        for (std::size_t i = 0; i < 3; ++i) worst = std::max(worst, std::abs(double(c[i]) - expected));
    return worst;
}

// Two rooms, one lit evenly with radiance 1, the other black, with a sealed wall between x = lo and x = hi.
BoxWorld two_rooms(double lo, double hi) {
    BoxWorld world;
    world.room = {{-384, -192, 0}, {384, 192, 192}};
    const Box3 wall{{lo, -192, 0}, {hi, 192, 192}};
    world.solids.push_back(wall);
    world.radiance = [lo](Vec3 p, Vec3) { return p.x <= lo + 1e-6 ? Rgbd{1, 1, 1} : Rgbd{}; };
    return world;
}

// Least squares over the sphere of sum n_a^2 c[a, sign] against max(0, n.w): its closed form at one direction.
TEST(AmbientKernel, MatchesLeastSquaresAtOneDirection) {
    Cube6 cube{};
    add(cube, {0.48, 0.6, 0.64}, {1, 1, 1});
    const double expected[6] = {.5017, -.0982, .6375, -.1125, .6858, -.1143};
    for (std::size_t f = 0; f < 6; ++f) EXPECT_NEAR(cube[f].x, expected[f], 6e-5) << f;
}

// A field 1 + a.w: the true irradiance is pi + (2 pi / 3) a.n. The cube returns its directional part 1.25 times
// along the axes, 0.72169 times in the corners, exactly on average.
TEST(AmbientKernel, LinearFieldHasItsClosedForm) {
    BoxWorld open;
    open.room = {{-1e6, -1e6, -1e6}, {1e6, 1e6, 1e6}};
    const Vec3 a{0.3, -0.2, 0.5};
    open.radiance = [a](Vec3, Vec3 d) { return Rgbd{1, 1, 1} * (1 + dot(a, d)); };
    Gathered g;
    gather(air_of(open), {1, 2, 3}, 128, 7, g);
    const Cube6 c = g.mean();
    for (std::size_t axis = 0; axis < 3; ++axis) {
        EXPECT_NEAR(c[2 * axis].x, kPi + 1.25 * (2 * kPi / 3) * a[axis], 1e-9);
        EXPECT_NEAR(c[2 * axis + 1].x, kPi - 1.25 * (2 * kPi / 3) * a[axis], 1e-9);
    }
    const double corner = (c[0].x + c[2].x + c[4].x) / 3, truth = 2 * kPi / 3 * (a.x + a.y + a.z) / std::sqrt(3.0);
    EXPECT_NEAR((corner - kPi) / truth, 0.72169, 1e-5);
    // Mean over all normals: each face counts a sixth of 2 pi / 3 * 3 / (4 pi)...: the mean of n_a^2 over a half is 1/6.
    double mean_level = 0;
    for (const Rgbd& e : c) mean_level += e.x / 6;
    EXPECT_NEAR(mean_level, kPi, 1e-9); // the mean irradiance over normals of any field is a quarter of its integral
}

// For any light the mean over normals of the cube is the mean irradiance, integral of L / 4.
TEST(AmbientKernel, MeanLevelIsExactForOneLight) {
    for (const Vec3 d : {Vec3{1, 0, 0}, Vec3{0.6, 0.8, 0}, normalize(Vec3{1, 1, 1}), normalize(Vec3{-3, 1, 2})}) {
        Cube6 cube{};
        add(cube, d, {4, 4, 4});
        double sum = 0;
        for (const Rgbd& e : cube) sum += e.x / 6;
        EXPECT_NEAR(sum, 1, 1e-12);
    }
}

TEST(Ambient, UniformLightGivesPiEverywhere) {
    BoxWorld world;
    world.room = {{-300, -200, -10}, {310, 222, 301}};
    const Box3 pillar{{-20, -20, -10}, {20, 20, 200}};
    world.solids.push_back(pillar);
    world.radiance = [](Vec3, Vec3) { return Rgbd{1, 1, 1}; };
    const Ambient ambient = build(world);
    ASSERT_FALSE(ambient.cubes.empty());
    for (const AmbientCube& cube : ambient.cubes) {
        EXPECT_LT(largest_error(cube.irradiance, kPi), 1e-6);
        EXPECT_TRUE(world.in_air(cube.position));
        EXPECT_EQ(cube.invalid_share, 0);
    }
    for (const Vec3& p : air_points(world, 3000, 5)) {
        const auto shown = ambient_at(ambient, p);
        ASSERT_TRUE(shown) << p.x << ' ' << p.y << ' ' << p.z;
        EXPECT_LT(largest_error(*shown, kPi), 2e-6);
    }
    EXPECT_LT(ambient.error_estimate, 1e-3);
}

// Pairs of points that a wall parts: the same however many were known before, in an air that answers one by one and in one that answers many at once.
TEST(Ambient, PairsThatAWallPartsAreKeptAsPointsJoin) {
    BoxWorld w;
    w.room = {{-100, -100, -100}, {100, 100, 100}};
    w.solids = {{{-4, -100, -100}, {4, 100, 40}}};
    w.radiance = [](Vec3, Vec3) { return Rgbd{1, 1, 1}; };
    Air air = air_of(w);
    std::vector<Vec3> points;
    for (int i = 0; i < 40; ++i) points.push_back({(i % 2 ? 1 : -1) * (10.0 + i), 7.0 * (i % 9) - 30, 11.0 * (i % 13) - 60});
    Blocked whole, grown, many;
    EXPECT_EQ(whole.grow(air, points), 40u * 39 / 2);
    std::uint64_t rays = 0;
    for (const std::size_t n : {1u, 2u, 17u, 17u, 40u}) rays += grown.grow(air, {points.begin(), points.begin() + static_cast<std::ptrdiff_t>(n)});
    EXPECT_EQ(rays, 40u * 39 / 2);
    air.hidden = [&](std::span<const Vec3> from, std::span<const Vec3> to, std::span<std::uint8_t> hidden) {
        for (std::size_t i = 0; i < from.size(); ++i) hidden[i] = !air.clear(from[i], to[i]);
    };
    many.grow(air, points);
    std::size_t parted = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
        for (std::size_t j = 0; j < points.size(); ++j) {
            if (i == j) continue;
            const bool blocked = !air.clear(points[i], points[j]);
            EXPECT_EQ(whole(i, j), blocked);
            EXPECT_EQ(grown(i, j), blocked);
            EXPECT_EQ(many(i, j), blocked);
            parted += blocked;
        }
    EXPECT_GT(parted, 100u);
}

// No light through a sealed wall and no darkening before it, wherever the lattice lies and however thin the wall.
TEST(Ambient, SealedWallNeitherLeaksNorDips) {
    for (const double thickness : {64.0, 16.0, 4.0, 0.125})
        for (const double offset : {0.0, 0.125, 0.25, 5.0 / 16, 0.5, 0.71, 0.999}) {
            const BoxWorld world = two_rooms(0, thickness);
            AmbientOptions options;
            options.lattice_offset = offset;
            const Ambient ambient = build(world, options);
            std::size_t missing = 0;
            double leak = 0, dip = 0;
            for (const Vec3& p : air_points(world, 1500, 11)) {
                const auto shown = ambient_at(ambient, p);
                if (!shown) ++missing;
                else if (p.x < 0) dip = std::max(dip, largest_error(*shown, kPi));
                else leak = std::max(leak, largest_error(*shown, 0));
            }
            // right at the wall too
            for (const Vec3& q : air_points(world, 300, 12)) {
                Vec3 p = q;
                p.x = thickness + 0.01;
                if (const auto shown = ambient_at(ambient, p)) leak = std::max(leak, largest_error(*shown, 0));
                else ++missing;
                p.x = -0.01;
                if (const auto shown = ambient_at(ambient, p)) dip = std::max(dip, largest_error(*shown, kPi));
                else ++missing;
            }
            EXPECT_EQ(missing, 0u) << thickness << ' ' << offset;
            EXPECT_EQ(leak, 0) << thickness << ' ' << offset;
            EXPECT_LT(dip, 2e-6) << thickness << ' ' << offset;
        }
}

// A closet in the middle of a bright hall, black inside.
TEST(Ambient, ClosetStaysDark) {
    BoxWorld world;
    world.room = {{-400, -400, 0}, {400, 400, 256}};
    const double a = 50, b = 54; // walls 4 units thick around a 100 unit closet
    const auto box = [&](Vec3 lo, Vec3 hi) { world.solids.push_back({lo, hi}); };
    box({-b, -b, 0}, {-a, b, 104}), box({a, -b, 0}, {b, b, 104});
    box({-a, -b, 0}, {a, -a, 104}), box({-a, a, 0}, {a, b, 104}), box({-a, -a, 100}, {a, a, 104});
    const auto in_closet = [&](Vec3 p, double e) { return std::abs(p.x) < a + e && std::abs(p.y) < a + e && p.z < 100 + e; };
    world.radiance = [&](Vec3 p, Vec3) { return in_closet(p, 1e-6) ? Rgbd{} : Rgbd{1, 1, 1}; };
    const Ambient ambient = build(world);
    std::size_t inside = 0;
    for (const Vec3& p : air_points(world, 12000, 3)) {
        const auto shown = ambient_at(ambient, p);
        ASSERT_TRUE(shown);
        const bool dark = in_closet(p, 0);
        inside += dark;
        EXPECT_LT(largest_error(*shown, dark ? 0 : kPi), dark ? 1e-30 : 2e-6) << p.x << ' ' << p.y << ' ' << p.z;
    }
    EXPECT_GT(inside, 50u);
}

// Two rooms joined by a door, light varying over the bright one: the stored estimate must tell the true error.
TEST(Ambient, EstimateTellsTheErrorAndTheTargetIsMet) {
    BoxWorld world = two_rooms(0, 16);
    const Box3 wall = world.solids[0];
    world.solids.clear();
    const auto box = [&](Vec3 lo, Vec3 hi) { world.solids.push_back({lo, hi}); };
    box(wall.lo, {16, -40, 192}), box({0, 40, 0}, wall.hi), box({0, -40, 112}, {16, 40, 192});
    world.radiance = [](Vec3 p, Vec3) {
        if (p.x > 8) return Rgbd{0.02, 0.02, 0.02};
        return Rgbd{1, 0.8, 0.6} * (p.z > 191 ? 2.0 : 0.3 + 0.2 * std::sin(p.y / 60));
    };
    AmbientOptions options;
    const Ambient ambient = build(world, options);
    double error = 0, reference_level = 0;
    const auto points = air_points(world, 3000, 21);
    std::vector<double> norm, diff;
    const Air air = air_of(world);
    for (const Vec3& p : points) {
        Gathered g;
        gather(air, p, 2048, 99, g);
        const auto shown = ambient_at(ambient, p);
        ASSERT_TRUE(shown);
        Cube6 s{};
        for (std::size_t f = 0; f < 6; ++f) s[f] = Rgbd((*shown)[f]);
        const Cube6 d = s - g.mean();
        norm.push_back(std::max(dot(g.mean(), g.mean()), dot(s, s))), diff.push_back(dot(d, d));
        reference_level += std::sqrt(norm.back()) / double(points.size());
    }
    for (std::size_t i = 0; i < diff.size(); ++i)
        error += diff[i] / (norm[i] + 4e-4 * reference_level * reference_level) / double(diff.size());
    error = 100 * std::sqrt(error);
    RecordProperty("true_percent", std::to_string(error));
    RecordProperty("estimate_percent", std::to_string(ambient.error_estimate));
    RecordProperty("cubes", static_cast<int>(ambient.cubes.size()));
    EXPECT_LT(error, 1.5 * options.error_percent);
    EXPECT_LT(error, 1.6 * ambient.error_estimate);
    EXPECT_GT(error, 0.4 * ambient.error_estimate);
    // Less error asked for takes more cubes, more allowed takes fewer.
    options.error_percent = 40;
    EXPECT_LT(build(world, options).cubes.size(), ambient.cubes.size());
}

// Each light counts once: in the cube or beside it. With every light local, cubes hold the rest alone and the lights'
// weights add up to one; with none local, the cube holds all.
TEST(Ambient, EveryLightIsInTheCubeOrBesideIt) {
    BoxWorld world;
    world.room = {{-256, -256, 0}, {256, 256, 256}};
    world.radiance = [](Vec3, Vec3) { return Rgbd{1, 1, 1}; };
    world.lamps = {{{100, 50, 200}, {5e4, 5e4, 5e4}}, {{-100, -90, 180}, {4e4, 2e4, 1e4}}, {{0, 100, 100}, {3e4, 3e4, 3e4}}};
    AmbientOptions all, none, two;
    all.local_lights = 3, none.local_lights = 0;
    const Ambient with_all = build(world, all), with_none = build(world, none), with_two = build(world, two);
    for (const Vec3& p : air_points(world, 200, 8)) {
        EXPECT_LT(largest_error(*ambient_at(with_all, p), kPi), 2e-6);
        const auto lights = ambient_lights_at(with_all, p);
        ASSERT_EQ(lights.size(), 3u);
        for (const auto& [light, weight] : lights) EXPECT_NEAR(weight, 1, 1e-12) << light;
        EXPECT_TRUE(ambient_lights_at(with_none, p).empty());
    }
    // At the cube's own place: cube + local lights = everything, and the strongest are the local ones.
    const Air air = air_of(world);
    for (const AmbientCube& cube : with_two.cubes) {
        ASSERT_EQ(cube.local_lights.size(), 2u);
        Cube6 sum{};
        double weakest_local = 1e30;
        for (std::size_t f = 0; f < 6; ++f) sum[f] = Rgbd(cube.irradiance[f]);
        for (const std::uint32_t l : cube.local_lights) {
            const auto direct = air.direct(l, cube.position);
            add(sum, direct->direction, direct->irradiance);
            weakest_local = std::min(weakest_local, mean(direct->irradiance));
        }
        Cube6 whole{};
        for (Rgbd& e : whole) e = {kPi, kPi, kPi};
        for (std::uint32_t l = 0; l < 3; ++l) {
            const auto direct = air.direct(l, cube.position);
            add(whole, direct->direction, direct->irradiance);
            const bool local = std::count(cube.local_lights.begin(), cube.local_lights.end(), l) > 0;
            if (!local) {
                EXPECT_LE(mean(direct->irradiance), weakest_local);
            }
        }
        for (std::size_t f = 0; f < 6; ++f) EXPECT_NEAR(sum[f].x, whole[f].x, 1e-5 * std::abs(whole[f].x) + 1e-5);
    }
}

// A light that a wall hides is neither listed nor counted.
TEST(Ambient, HiddenLightsDoNotCount) {
    BoxWorld world = two_rooms(0, 16);
    world.radiance = [](Vec3, Vec3) { return Rgbd{}; };
    world.lamps = {{{-100, 0, 100}, {1e6, 1e6, 1e6}}};
    const Ambient ambient = build(world);
    for (const AmbientCube& cube : ambient.cubes) EXPECT_EQ(cube.local_lights.size(), cube.position.x < 0 ? 1u : 0u);
    for (const Vec3& p : air_points(world, 500, 2)) EXPECT_EQ(ambient_lights_at(ambient, p).size(), p.x < 0 ? 1u : 0u);
}

TEST(Ambient, SameBytesForAnyThreadCount) {
    BoxWorld world = two_rooms(-5, 11);
    world.radiance = [](Vec3 p, Vec3) { return Rgbd{1, 0.5, 0.2} * (1.5 + std::sin(p.x / 40) * std::cos(p.z / 30)); };
    world.lamps = {{{-100, 0, 100}, {1e4, 1e4, 1e4}}, {{100, 0, 100}, {1e4, 1e4, 1e4}}};
    const Bytes one = to_bytes(build(world, {}, 1));
    EXPECT_EQ(one, to_bytes(build(world, {}, 2)));
    EXPECT_EQ(one, to_bytes(build(world, {}, 7)));
    const Ambient back = from_bytes<Ambient>(one);
    EXPECT_EQ(to_bytes(back), one);
}

TEST(Ambient, NoAirNoCubes) {
    BoxWorld nothing;
    Ambient ambient = build(nothing);
    EXPECT_TRUE(ambient.cubes.empty());
    EXPECT_FALSE(ambient_at(ambient, {0, 0, 0}));
    BoxWorld filled;
    filled.room = {{0, 0, 0}, {100, 100, 100}};
    filled.solids.push_back(filled.room);
    ambient = build(filled);
    EXPECT_TRUE(ambient.cubes.empty());
    EXPECT_FALSE(ambient_at(ambient, {50, 50, 50}));
}

TEST(Ambient, HugeWorldsKeepTheRootTableSmall) {
    BoxWorld world;
    world.room = {{-32768, -32768, -32768}, {32768, 32768, 32768}};
    world.radiance = [](Vec3, Vec3) { return Rgbd{1, 1, 1}; };
    const Ambient ambient = build(world);
    EXPECT_LE(std::size_t(ambient.root_count[0]) * ambient.root_count[1] * ambient.root_count[2], 32768u);
    EXPECT_TRUE(ambient_at(ambient, {123, -4567, 30000}));
}

} // namespace
} // namespace kiln::ambient

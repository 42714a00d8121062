#include "compiler/probes/probe_scene.h"
#include "libs/core/hash.h"
#include "tests/compiler/ambient/box_world.h"
#include <gtest/gtest.h>
#include <limits>

namespace kiln::probes {
namespace {

using ambient::BoxWorld;
constexpr double kPi = std::numbers::pi;

ProbeScene scene_of(const BoxWorld& world) {
    ProbeScene scene;
    scene.closest = [&world](Vec3 o, Vec3 d) -> std::optional<ProbeHit> {
        const auto hit = world.closest(o, d);
        if (!hit) return std::nullopt;
        return ProbeHit{hit->distance, hit->normal, false, hit->back};
    };
    scene.clear = [&world](Vec3 a, Vec3 b) { return world.clear(a, b); };
    scene.radiance = [&world](Vec3 o, std::span<const Vec3> ways, std::span<Rgb> out) {
        for (std::size_t i = 0; i < ways.size(); ++i) {
            const auto hit = world.closest(o, ways[i]);
            out[i] = Rgb(world.radiance(hit ? o + ways[i] * hit->distance : o, ways[i]));
        }
    };
    return scene;
}

CubeImage image_of(std::uint32_t size, const std::function<Rgb(Vec3)>& radiance) {
    CubeImage image;
    image.size = size;
    for (int f = 0; f < 6; ++f)
        for (std::uint32_t j = 0; j < size; ++j)
            for (std::uint32_t i = 0; i < size; ++i) image.texels.push_back(radiance(texel_direction(size, f, i, j)));
    return image;
}

double random_unit(std::uint64_t a, std::uint64_t b) { return double(mix(a, b) >> 11) * 0x1p-53; }

const auto kNoWay = [](std::uint32_t, std::uint32_t) { return std::numeric_limits<double>::infinity(); };

TEST(Cubemap, DirectionsFollowTheStatedTable) {
    const Vec3 middles[6] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    for (int f = 0; f < 6; ++f) EXPECT_EQ(cube_direction(f, 0, 0), middles[f]);
    EXPECT_EQ(cube_direction(0, 0.25, 0.5), (Vec3{1, -0.5, -0.25}));
    EXPECT_EQ(cube_direction(3, 0.25, 0.5), (Vec3{0.25, -1, -0.5}));
    EXPECT_EQ(cube_direction(4, 0.25, 0.5), (Vec3{0.25, -0.5, 1}));
    EXPECT_EQ(cube_direction(5, 0.25, 0.5), (Vec3{-0.25, -0.5, -1}));
}

TEST(Cubemap, TexelInvertsDirection) {
    for (std::uint64_t k = 0; k < 6000; ++k) {
        const int face = static_cast<int>(k % 6);
        const double u = 2 * random_unit(k, 1) - 1, v = 2 * random_unit(k, 2) - 1, scale = 0.1 + 10 * random_unit(k, 3);
        int back = -1;
        double bu = 0, bv = 0;
        cube_texel(cube_direction(face, u, v) * scale, &back, &bu, &bv);
        EXPECT_EQ(back, face);
        EXPECT_NEAR(bu, u, 1e-14);
        EXPECT_NEAR(bv, v, 1e-14);
    }
}

TEST(Cubemap, SolidAnglesOfAFaceSumToASixthOfTheSphere) {
    for (const std::uint32_t n : {1u, 2u, 7u, 64u}) {
        double sum = 0;
        for (std::uint32_t j = 0; j < n; ++j)
            for (std::uint32_t i = 0; i < n; ++i) sum += solid_angle(n, i, j);
        EXPECT_NEAR(sum, 4 * kPi / 6, 1e-12) << n;
    }
    double element = 0; // the element 1 / (1 + u^2 + v^2)^(3/2), midpoint rule
    const int n = 400;
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) {
            const double u = 2 * (i + 0.5) / n - 1, v = 2 * (j + 0.5) / n - 1;
            element += 4.0 / (n * n) * std::pow(1 + u * u + v * v, -1.5);
        }
    EXPECT_NEAR(element, 4 * kPi / 6, 1e-5);
}

TEST(Prefilter, UniformEnvironmentStaysConstant) {
    Context context;
    for (const std::uint32_t size : {1u, 2u, 4u, 8u, 32u, 64u}) {
        const auto texels = prefilter(image_of(size, [](Vec3) { return Rgb{3, 0.5f, 1e-3f}; }), 64, context);
        std::size_t expected = 0;
        for (std::uint32_t m = 0; m < mip_count(size); ++m) expected += 6 * (size >> m) * (size >> m);
        ASSERT_EQ(texels.size(), expected);
        for (const Rgb& t : texels) {
            EXPECT_NEAR(t.x, 3, 3e-6);
            EXPECT_NEAR(t.y, 0.5, 5e-7);
            EXPECT_NEAR(t.z, 1e-3, 1e-9);
        }
    }
}

// The filter is the same around every direction, so it keeps the mean over the sphere; alpha 0 is the copy.
TEST(Prefilter, KeepsTheMeanAndTheFirstMip) {
    Context context;
    const auto image = image_of(64, [](Vec3 d) {
        return Rgb(Vec3{1 + d.z, dot(d, normalize(Vec3{1, 2, 3})) > 0.95 ? 40.0 : 0.1, 1 + std::sin(5 * d.x) * d.y});
    });
    const auto texels = prefilter(image, 64, context);
    const Rgbd mean = mean_radiance(image);
    std::size_t at = 0;
    for (std::uint32_t m = 0; m < mip_count(64); ++m) {
        CubeImage mip;
        mip.size = 64 >> m;
        mip.texels.assign(texels.begin() + std::ptrdiff_t(at), texels.begin() + std::ptrdiff_t(at + 6 * mip.size * mip.size));
        at += mip.texels.size();
        if (m == 0) {
            EXPECT_EQ(mip.texels, image.texels);
        }
        const Rgbd got = mean_radiance(mip);
        for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(got[c] / mean[c], 1, 0.03) << "mip " << m << " channel " << c;
    }
}

// A linear environment a.d filtered by any lobe around n is s a.n; s falls with roughness.
TEST(Prefilter, LinearEnvironmentKeepsItsDirection) {
    Context context;
    const Vec3 a = normalize(Vec3{2, -1, 0.5});
    const auto texels = prefilter(image_of(64, [a](Vec3 d) { return Rgb(Vec3{1, 1, 1} * (2 + dot(a, d))); }), 256, context);
    std::size_t at = 6 * 64 * 64;
    double last = 1;
    for (std::uint32_t m = 1; m < mip_count(64); ++m) {
        const std::uint32_t n = 64 >> m;
        double num = 0, den = 0, worst = 0;
        for (int pass = 0; pass < 2; ++pass)
            for (std::uint32_t t = 0; t < 6 * n * n; ++t) {
                const double c = dot(a, texel_direction(n, int(t / (n * n)), t % n, t / n % n)), l = texels[at + t].x - 2;
                if (pass == 0) num += l * c, den += c * c;
                else worst = std::max(worst, std::abs(l - num / den * c));
            }
        at += 6 * n * n;
        EXPECT_LT(worst, 0.02) << m;
        EXPECT_LT(num / den, last + 1e-3) << m;
        last = num / den;
    }
    EXPECT_GT(last, 0.5); // GGX of alpha 1 weighted by n.l: a broad lobe, still about n
    EXPECT_LT(last, 0.8);
}

TEST(Cubemap, LookupsAreSeamless) {
    const SeamlessCube cube(image_of(16, [](Vec3 d) { return Rgb(Vec3{2 + d.x, 2 + d.y, 2 + d.z}); }));
    const auto shown = [&](Vec3 d) {
        int face = 0;
        double u = 0, v = 0;
        cube_texel(d, &face, &u, &v);
        return static_cast<Rgbd>(cube.bilinear(face, u, v));
    };
    for (std::uint64_t k = 0; k < 2000; ++k) { // linear radiance: within a texel's width everywhere, edges too
        const Vec3 d = normalize(Vec3{random_unit(k, 1) - 0.5, random_unit(k, 2) - 0.5, random_unit(k, 3) - 0.5});
        const Rgbd got = shown(d);
        for (std::size_t a = 0; a < 3; ++a) EXPECT_NEAR(got[a], 2 + d[a], 0.03);
    }
    const Vec3 edge = {1, 0.3, 1};
    EXPECT_LT(length(shown(edge + Vec3{1e-9, 0, 0}) - shown(edge + Vec3{0, 0, 1e-9})), 0.02);
}

TEST(Render, SeesWhatIsThereAndNotDependingOnThreads) {
    BoxWorld world;
    world.room = {{-100, -60, 0}, {140, 80, 90}};
    world.radiance = [](Vec3 p, Vec3) { return Rgbd{p.x + 200, p.y + 200, p.z + 200}; };
    Context one, many;
    many.threads = 5;
    const Vec3 at{10, 5, 30};
    const CubeImage image = render(scene_of(world), at, 16, 2, 3, one);
    EXPECT_EQ(image.texels, render(scene_of(world), at, 16, 2, 3, many).texels);
    for (int f = 0; f < 6; ++f) {
        const Vec3 d = texel_direction(16, f, 5, 9);
        const auto hit = world.closest(at, d);
        const Vec3 p = at + d * hit->distance;
        EXPECT_NEAR(image.at(f, 5, 9).x, p.x + 200, 15);
        EXPECT_NEAR(image.at(f, 5, 9).y, p.y + 200, 15);
        EXPECT_NEAR(image.at(f, 5, 9).z, p.z + 200, 15);
    }
}

TEST(Parallax, ExactInABoxRoomWhereverTheProbeStands) {
    BoxWorld world;
    world.room = {{-300, -60, 0}, {500, 80, 190}};
    for (const Vec3 at : {Vec3{0, 0, 64}, Vec3{-290, 70, 10}, Vec3{480, -55, 185}}) {
        const auto box = fit_box(scene_of(world), at);
        ASSERT_TRUE(box);
        EXPECT_LT(length(box->lo - world.room.lo) + length(box->hi - world.room.hi), 1e-9);
        Probe probe;
        probe.position = at, probe.boxed = true, probe.box = *box;
        for (std::uint64_t k = 0; k < 200; ++k) {
            Vec3 x, r;
            for (std::uint64_t a = 0; a < 3; ++a) {
                x[a] = world.room.lo[a] + world.room.size()[a] * (0.01 + 0.98 * random_unit(k, a));
                r[a] = random_unit(k, 10 + a) - 0.5;
            }
            r = normalize(r);
            const Vec3 hit = x + r * world.closest(x, r)->distance;
            EXPECT_LT(length(at + parallax_direction(probe, x, r) - hit), 1e-9);
        }
    }
}

TEST(Parallax, FurnitureDoesNotSpoilTheBoxButAnOpenSideDoes) {
    BoxWorld world;
    world.room = {{-200, -150, 0}, {200, 150, 160}};
    world.solids = {{{100, 40, 0}, {140, 80, 40}}, {{-160, -100, 0}, {-120, -60, 48}}};
    const auto box = fit_box(scene_of(world), {0, 0, 70});
    ASSERT_TRUE(box);
    EXPECT_LT(length(box->lo - world.room.lo) + length(box->hi - world.room.hi), 1e-9);
    ProbeScene open = scene_of(world);
    const auto closed = open.closest;
    open.closest = [closed](Vec3 o, Vec3 d) {
        auto hit = closed(o, d);
        if (hit && d.z > 0 && hit->normal.z < -0.5) hit->sky = true;
        return hit;
    };
    EXPECT_FALSE(fit_box(open, {0, 0, 70}));
    // Half a room filled by columns: most directions miss the box.
    BoxWorld columns;
    columns.room = {{-400, -400, 0}, {400, 400, 100}};
    for (int i = 0; i < 4; ++i) {
        const double x = 90 * std::cos(i * kPi / 2), y = 90 * std::sin(i * kPi / 2);
        columns.solids.push_back({{x - 45, y - 45, 0}, {x + 45, y + 45, 100}});
    }
    const auto fitted = fit_box(scene_of(columns), {0, 0, 50});
    if (fitted) { // the columns' faces may serve as walls: then it is their box, not the far walls'
        EXPECT_LT(fitted->size().x, 200);
    }
}

std::vector<Probe> probes_at(const ProbeScene& scene, std::initializer_list<Vec3> places) {
    std::vector<Probe> probes;
    for (const Vec3 p : places) {
        Probe& probe = probes.emplace_back();
        probe.position = p, probe.size = 1, probe.mips = 1, probe.texels.resize(6);
        if (const auto box = fit_box(scene, p)) probe.boxed = true, probe.box = *box;
    }
    return probes;
}

// Two rooms and a sealed wall; a probe close behind the wall is nearer than the one in the same room.
TEST(Assign, NeverAcrossASealedWall) {
    for (const double thickness : {32.0, 4.0, 0.125}) {
        BoxWorld world;
        world.room = {{-512, -128, 0}, {512, 128, 128}};
        world.solids = {{{0, -128, 0}, {thickness, 128, 128}}};
        const ProbeScene scene = scene_of(world);
        const auto probes = probes_at(scene, {{-480, 0, 64}, {thickness + 1, 0, 64}});
        for (const Vec3& p : ambient::air_points(world, 500, 4)) {
            Receiver leaf;
            leaf.points = {p};
            EXPECT_EQ(choose_probe(scene, probes, leaf, kNoWay), p.x < 0 ? 0u : 1u);
            Receiver wall; // the dark wall's own face
            wall.points = {{-0.5, p.y, p.z}}, wall.normal = {-1, 0, 0};
            EXPECT_EQ(choose_probe(scene, probes, wall, kNoWay), 0u);
        }
    }
}

TEST(Assign, OrderOfPreference) {
    BoxWorld world; // a corridor with a closet at its end
    world.room = {{0, 0, 0}, {600, 100, 100}};
    world.solids = {{{500, 0, 0}, {510, 100, 100}}};
    const ProbeScene scene = scene_of(world);
    const auto probes = probes_at(scene, {{50, 50, 50}, {400, 50, 50}});
    Receiver floor;
    floor.points = {{300, 50, 0.5}}, floor.normal = {0, 0, 1};
    EXPECT_EQ(choose_probe(scene, probes, floor, kNoWay), 1u); // nearest visible
    floor.explicit_probe = 0;
    EXPECT_EQ(choose_probe(scene, probes, floor, kNoWay), 0u); // what the entity says
    Receiver closet; // sees none: the shortest way, else the nearest
    closet.points = {{550, 50, 50}}, closet.leaf = 0;
    EXPECT_EQ(choose_probe(scene, probes, closet, kNoWay), 1u);
    EXPECT_EQ(choose_probe(scene, probes, closet, [](std::uint32_t k, std::uint32_t) { return k == 0 ? 5.0 : 9.0; }), 0u);
    EXPECT_EQ(choose_probe(scene, {}, closet, kNoWay), UINT32_MAX);
    // A mirror facing away from the nearer probe takes the one in front of it.
    Receiver mirror;
    mirror.points = {{390, 50, 50}}, mirror.normal = {-1, 0, 0};
    EXPECT_EQ(choose_probe(scene, probes, mirror, kNoWay), 0u);
    // The same room's probe before a nearer one of another room that is seen through a door.
    auto two = probes_at(scene, {{50, 50, 50}, {400, 50, 50}});
    two[0].boxed = true, two[0].box = {{0, 0, 0}, {320, 100, 100}};
    two[1].boxed = true, two[1].box = {{330, 0, 0}, {500, 100, 100}};
    EXPECT_EQ(choose_probe(scene, two, [] { Receiver r; r.points = {{300, 50, 50}}; return r; }(), kNoWay), 0u);
}

// Three leaves in a row, joined by two portals; a fourth alone.
TEST(Assign, WaysLeadThroughPortals) {
    Bsp bsp;
    bsp.leaves.resize(4);
    const auto portal = [&](std::uint32_t a, std::uint32_t b, double x) {
        BspPortal p;
        p.leaf_front = LeafId{a}, p.leaf_back = LeafId{b};
        p.winding = {{x, -1, -1}, {x, 1, -1}, {x, 1, 1}, {x, -1, 1}};
        bsp.portals.push_back(p);
    };
    portal(0, 1, 10), portal(1, 2, 30);
    const auto ways = ways_from(bsp, 0, {4, 0, 0});
    EXPECT_EQ(ways[0], 0);
    EXPECT_NEAR(ways[1], 6, 1e-12);
    EXPECT_NEAR(ways[2], 26, 1e-12);
    EXPECT_TRUE(std::isinf(ways[3]));
}

} // namespace
} // namespace kiln::probes

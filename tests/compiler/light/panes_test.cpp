// Light through glass and grates: closed forms, energy, and the path tracer.
#include "compiler/light/transmission.h"
#include "libs/sampling/sobol.h"
#include "tests/compiler/light/scenes.h"
#include <gtest/gtest.h>
#include <numbers>

using namespace kiln;
using namespace kiln::test;

namespace {
constexpr double kPi = std::numbers::pi;

Light sun(Vec3 way, Rgb intensity = {1, 1, 1}, double radius = 0) {
    Light l;
    l.kind = LightKind::sun, l.direction = normalize(way), l.intensity = intensity, l.angular_radius_rad = radius;
    return l;
}

// A black floor of 256 units under a lamp, and panes between. The lamp: a point, or a face.
enum class Lamp { point, face, sun };
std::unique_ptr<Baked> over_a_floor(Lamp lamp, const std::function<void(SurfacesBuilder&)>& put, double luxel = 16, std::uint64_t seed = 1, LightOptions options = {}) {
    SurfacesBuilder b;
    b.rect({-128, -128, 0}, {256, 0, 0}, {0, 256, 0}, b.material({}), {.luxel = luxel});
    std::vector<Light> lights;
    if (lamp == Lamp::face) b.rect({-16, -16, 128}, {0, 32, 0}, {32, 0, 0}, b.material({}, {100, 100, 100}), {.luxel = 16});
    if (lamp == Lamp::point) lights.push_back(point_light({8, 8, 128}, {4096, 4096, 4096}));
    if (lamp == Lamp::sun) lights.push_back(sun({0, 0, -1}));
    put(b);
    options.seed = seed;
    return bake(std::move(b), options, lights);
}
void put_nothing(SurfacesBuilder&) {}
// Luxels of the first face: the floor.
template <class Visit> void each_floor_luxel(const Baked& b, const Visit& visit) {
    for (const Luxel& l : b.scene.surfaces.luxels)
        if (l.face.value == 0) visit(b.lighting.flat[texel_of(b.scene.surfaces, l)], l);
}
std::vector<Rgb> floor_light(const Baked& b) {
    std::vector<Rgb> out;
    each_floor_luxel(b, [&](Rgb e, const Luxel&) { out.push_back(e); });
    return out;
}
} // namespace

TEST(TexelSums, AreTheMeansOfSquares) {
    constexpr int w = 5, h = 3;
    Bytes texels(w * h);
    for (std::size_t i = 0; i < texels.size(); ++i) texels[i] = static_cast<std::uint8_t>(mix(i, std::uint64_t{7}));
    const TexelSums sums(w, h, texels);
    const auto texel = [&](double x, double y) { // of the plane that the texture repeats over
        const auto wrap = [](double a, int n) { return static_cast<std::size_t>(static_cast<int>(std::floor(a)) % n + (std::floor(a) < 0 ? n : 0)) % static_cast<std::size_t>(n); };
        return texels[wrap(y, h) * w + wrap(x, w)] / 255.0;
    };
    Random random(3);
    for (int k = 0; k < 300; ++k) {
        const Vec2 middle{random() * 4 - 2, random() * 4 - 2}, size{random() * random() * 3, random() * random() * 3};
        // Overlap of the rectangle with each texel.
        const double x0 = (middle.x - size.x / 2) * w, x1 = x0 + size.x * w, y0 = (middle.y - size.y / 2) * h, y1 = y0 + size.y * h;
        double sum = 0;
        for (double y = std::floor(y0); y < y1; ++y)
            for (double x = std::floor(x0); x < x1; ++x)
                sum += texel(x, y) * (std::min(x + 1, x1) - std::max(x, x0)) * (std::min(y + 1, y1) - std::max(y, y0));
        const double area = (x1 - x0) * (y1 - y0);
        if (area > 1e-3) { EXPECT_NEAR(sums.mean(middle, size), sum / area, 1e-6) << k; }
        EXPECT_EQ(sums.mean(middle, {}), texel(middle.x * w, middle.y * h)) << k;
    }
    double all = 0;
    for (const std::uint8_t t : texels) all += t / 255.0 / (w * h);
    EXPECT_NEAR(sums.mean({0.3, 0.7}, {1, 1}), all, 1e-12);
    EXPECT_NEAR(sums.mean({0.3, 0.7}, {1e9, 1e9}), all, 1e-12);
}

// alpha 0.5 halves, two of them quarter, and a brush with two faces counts once.
TEST(Panes, HalveDirectLight) {
    for (const Lamp lamp : {Lamp::point, Lamp::face, Lamp::sun}) {
        const auto bare = floor_light(*over_a_floor(lamp, put_nothing));
        const auto compare = [&](double share, const std::function<void(SurfacesBuilder&)>& put) {
            const auto got = floor_light(*over_a_floor(lamp, put));
            ASSERT_EQ(got.size(), bare.size());
            for (std::size_t i = 0; i < got.size(); ++i)
                for (std::size_t c = 0; c < 3; ++c) ASSERT_FLOAT_EQ(got[i][c], static_cast<float>(share) * bare[i][c]) << static_cast<int>(lamp) << " " << share << " " << i;
        };
        const auto sheet = [](SurfacesBuilder& b, double z, float alpha, double thickness) { pane(b, {-512, -512, z}, {1024, 0, 0}, {0, 1024, 0}, glass(b, alpha), thickness, 64); };
        compare(0.5, [&](SurfacesBuilder& b) { sheet(b, 64, 0.5f, 0); });
        compare(0.5, [&](SurfacesBuilder& b) { sheet(b, 64, 0.5f, 4); });
        compare(0.25, [&](SurfacesBuilder& b) { sheet(b, 64, 0.5f, 0), sheet(b, 96, 0.5f, 2); });
        compare(0.75, [&](SurfacesBuilder& b) { sheet(b, 64, 0.25f, 2); });
        // Facing down, a sheet does the same.
        compare(0.5, [&](SurfacesBuilder& b) { pane(b, {-512, -512, 64}, {0, 1024, 0}, {1024, 0, 0}, glass(b, 0.5f), 0, 64); });
    }
}

// (1 - alpha) times the tint: what is stated, or the hue of the texture.
TEST(Panes, TintLight) {
    for (const Lamp lamp : {Lamp::point, Lamp::face}) {
        const auto bare = floor_light(*over_a_floor(lamp, put_nothing));
        const auto hue = floor_light(*over_a_floor(lamp, [](SurfacesBuilder& b) { pane(b, {-512, -512, 64}, {1024, 0, 0}, {0, 1024, 0}, glass(b, 0.5f, {0.8f, 0.4f, 0.2f}), 2, 64); }));
        const auto stated = floor_light(*over_a_floor(lamp, [](SurfacesBuilder& b) { pane(b, {-512, -512, 64}, {1024, 0, 0}, {0, 1024, 0}, glass(b, 0.25f, {0.8f, 0.4f, 0.2f}, Rgb{0.25f, 1, 0.5f}), 0, 64); }));
        for (std::size_t i = 0; i < bare.size(); ++i) {
            EXPECT_NEAR(hue[i].x, 0.5 * bare[i].x, 1e-5 * bare[i].x); EXPECT_NEAR(hue[i].y, 0.25 * bare[i].y, 1e-5 * bare[i].y); EXPECT_NEAR(hue[i].z, 0.125 * bare[i].z, 1e-5 * bare[i].z);
            EXPECT_NEAR(stated[i].x, 0.1875 * bare[i].x, 1e-5 * bare[i].x); EXPECT_NEAR(stated[i].y, 0.75 * bare[i].y, 1e-5 * bare[i].y); EXPECT_NEAR(stated[i].z, 0.375 * bare[i].z, 1e-5 * bare[i].z);
        }
    }
}

// Of holes of h units a luxel of w sees a share of a half, give or take what is over of a period: (h / w)^2 / 2 at most.
TEST(Panes, HolesSmallerThanLuxelsAreTheirShare) {
    const double h = 3, w = 32;
    std::vector<std::vector<Rgb>> seeds;
    for (const std::uint64_t seed : {1, 2, 3, 4})
        seeds.push_back(floor_light(*over_a_floor(Lamp::sun, [&](SurfacesBuilder& b) { pane(b, {-512, -512, 64}, {1024, 0, 0}, {0, 1024, 0}, checkers(b, 3), 0, 64); }, w, seed)));
    double most = 0;
    for (std::size_t i = 0; i < seeds[0].size(); ++i) {
        double mean = 0, variance = 0;
        for (const auto& s : seeds) mean += s[i].x / 4.0;
        for (const auto& s : seeds) variance += (s[i].x - mean) * (s[i].x - mean) / 3.0;
        EXPECT_NEAR(mean, 0.5, h * h / (w * w) / 2 + 1e-3) << i;
        most = std::max(most, std::sqrt(variance));
    }
    EXPECT_LT(most, 0.002); // one ray a sample would be off by 0.5 / sqrt(samples)
}

// The exact share of a luxel under a sun overhead, and the pattern itself where luxels are smaller than holes.
TEST(Panes, HolesLargerThanLuxelsCastTheirShape) {
    for (const auto& [h, w, close] : {std::tuple{48.0, 4.0, 0.02}, {24.0, 16.0, 0.1}}) {
        const auto b = over_a_floor(Lamp::sun, [&](SurfacesBuilder& s) { pane(s, {-512, -512, 64}, {1024, 0, 0}, {0, 1024, 0}, checkers(s, static_cast<int>(h)), 0, 64); }, w);
        const auto covered = [&](double lo, double hi, int parity) { // share of [lo, hi] in squares of that parity
            double sum = 0;
            for (double k = std::floor(lo / h); k * h < hi; ++k)
                if ((static_cast<long>(k) & 1) == parity) sum += std::min(hi, (k + 1) * h) - std::max(lo, k * h);
            return sum / (hi - lo);
        };
        double square = 0;
        int n = 0, whole_ones = 0;
        each_floor_luxel(*b, [&](Rgb e, const Luxel& l) {
            const Vec3 at = center_of(b->scene.surfaces, l);
            const double x = covered(at.x - w / 2, at.x + w / 2, 0), y = covered(-at.y - w / 2, -at.y + w / 2, 0); // v runs down
            const double dark = x * y + (1 - x) * (1 - y), light = 1 - dark;
            if (light == 0 || light == 1) {
                EXPECT_NEAR(e.x, light, 1e-6) << at.x << " " << at.y;
                ++whole_ones;
            }
            square += (e.x - light) * (e.x - light), ++n;
        });
        EXPECT_LT(std::sqrt(square / n), close);
        EXPECT_GT(whole_ones, n / 8);
    }
}

// The shadow of a grate under a lamp is as large as the lamp and the distances say; its mean is the coverage.
TEST(Panes, ALampFiltersAsWideAsItIs) {
    const auto bare = floor_light(*over_a_floor(Lamp::face, put_nothing));
    // 32 wide, half way: covers 16 units of the grate, of holes of 2: no pattern is left.
    const auto fine = floor_light(*over_a_floor(Lamp::face, [&](SurfacesBuilder& b) { pane(b, {-512, -512, 64}, {1024, 0, 0}, {0, 1024, 0}, checkers(b, 2), 0, 64); }, 4));
    const auto wide = floor_light(*over_a_floor(Lamp::face, put_nothing, 4));
    for (std::size_t i = 0; i < fine.size(); ++i) EXPECT_NEAR(fine[i].x, 0.5 * wide[i].x, 0.03 * wide[i].x) << i;
}

// A thick grate lets the same through from wherever it is looked at: a brush counts once.
TEST(Panes, AreAskedOnceABrush) {
    SurfacesBuilder b;
    pane(b, {-64, -64, 32}, {128, 0, 0}, {0, 128, 0}, glass(b, 0.5f), 8);
    const TraceScene scene(b.world, b.surfaces);
    ASSERT_TRUE(scene.has_panes());
    for (const Vec3 to : {Vec3{0, 0, 0}, Vec3{30, -20, 0}, Vec3{50, 50, 0}}) {
        EXPECT_EQ(scene.transmitted({{3, 5, 100}, to}).share.x, 0.5);
        EXPECT_EQ(scene.transmitted({to, {3, 5, 100}}).share.x, 0.5);
        EXPECT_FALSE(scene.occluded(to, {3, 5, 100}));
    }
    // Through the diagonal that the triangles of a face share, and past the pane.
    for (int k = 0; k < 60; ++k) EXPECT_EQ(scene.transmitted({{-60.0 + 2 * k, -60.0 + 2 * k, 100}, {-60.0 + 2 * k, -60.0 + 2 * k, 0}}).share.x, 0.5);
    EXPECT_EQ(scene.transmitted({{100, 0, 100}, {100, 0, 0}}).share.x, 1);
    const std::vector<LightRay> rays{{{3, 5, 100}, {0, 0, 0}}, {{100, 0, 100}, {100, 0, 0}}, {{30, -20, 0}, {3, 5, 100}}};
    std::vector<Transmitted> together;
    scene.transmitted(rays, together);
    EXPECT_EQ(together[0].share.x, 0.5);
    EXPECT_EQ(together[1].share.x, 1);
    EXPECT_EQ(together[2].share.x, 0.5);
    std::vector<PaneHit> hits;
    scene.panes({0, 0, 100}, {0, 0, -1}, 1e30, {}, hits);
    ASSERT_EQ(hits.size(), 1u);
    EXPECT_TRUE(hits[0].front && hits[0].opacity == 0.5 && hits[0].hit.distance == 68);
}

// What is seen of it, what comes through and what it keeps make up the whole.
TEST(Panes, InventNoLight) {
    Random random(11);
    for (int k = 0; k < 200; ++k) {
        Material m;
        const auto colour = [&] { return Rgb{static_cast<float>(random()), static_cast<float>(random()), static_cast<float>(random())}; };
        m.reflectance = colour() * 0.99f, m.flags = kTranslucent, m.alpha = static_cast<float>(random());
        m.opacity_map = {4, 2, {}, {}};
        for (int i = 0; i < 8; ++i) m.opacity_map.opacity.push_back(static_cast<std::uint8_t>(random() * 256));
        if (k % 2)
            for (int i = 0; i < 24; ++i) m.opacity_map.tint.push_back(static_cast<std::uint8_t>(random() * 256));
        if (k % 3 == 0) m.tint = colour();
        const PaneSkin skin(m, random());
        double opacity = 0;
        Rgbd through;
        skin.at({random() * 3, random() * 3}, {random(), random()}, &opacity, &through);
        for (std::size_t c = 0; c < 3; ++c) {
            EXPECT_GE(through[c], 0);
            EXPECT_LE(through[c] + opacity * m.reflectance[c], 1);
        }
    }
}

// In a furnace a pane that glows as its share of opacity is not to be seen.
TEST(Panes, FurnaceIsPiEverywhere) {
    const Rgb rho{0.6f, 0.4f, 0.2f}, emission{0.4f, 0.6f, 0.8f};
    SurfacesBuilder scene = furnace(rho, emission);
    pane(scene, {16, 80, 56}, {128, 0, 0}, {0, 40, 0}, glass(scene, 0.25f, rho, Rgb{1, 1, 1}, emission * 0.25f), 4);
    pane(scene, {100, 8, 8}, {0, 64, 0}, {0, 0, 80}, glass(scene, 0.5f, rho, Rgb{1, 1, 1}, emission * 0.5f), 2);
    const auto b = bake(std::move(scene));
    ASSERT_TRUE(b);
    for (std::size_t t = 0; t < b->lighting.flat.size(); ++t)
        for (std::size_t c = 0; c < 3 && b->lighting.valid[t]; ++c) EXPECT_NEAR(b->lighting.flat[t][c], kPi, 0.006 * kPi) << t;
    for (const Vec3 p : {Vec3{40, 100, 0}, Vec3{110, 40, 0}, Vec3{90, 90, 0}}) {
        Rgbd e, truth;
        b->field->arriving(p, {0, 0, 1}, 1024, 1, [&](Vec3 d, Rgbd w) { e += w * std::max(0.0, d.z); });
        reference_arriving(*b->field, p, {0, 0, 1}, 65536, 1, [&](Vec3 d, Rgbd w) { truth += w * std::max(0.0, d.z); });
        for (std::size_t c = 0; c < 3; ++c) {
            EXPECT_NEAR(e[c], kPi, 0.006 * kPi);
            EXPECT_NEAR(truth[c], kPi, 0.01 * kPi);
        }
    }
    for (const Vec3 d : {Vec3{0, 0, -1}, Vec3{0, 0.6, -0.8}, Vec3{-0.8, 0.6, 0}})
        for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(b->field->radiance({120, 90, 90}, d)[c], 1, 0.006);
}

namespace {

// The two rooms, a pane that fills the doorway.
SurfacesBuilder glazed_rooms(const std::function<MaterialId(SurfacesBuilder&)>& material, double luxel = 10, bool sill = false) {
    SurfacesBuilder b = two_rooms(luxel, sill);
    pane(b, {190, 120, 0}, {0, 60, 0}, {0, 0, 100}, material(b), 10, 10, {.u_axis = {0, 1, 0}, .v_axis = {0, 0, -1}});
    return b;
}
} // namespace

// Opaque, bit by bit, and not there, bit by bit.
TEST(Panes, AtTheEndsOfAlpha) {
    const auto with = [](float alpha, bool blocks, bool stated) {
        SurfacesBuilder b = glazed_rooms([&](SurfacesBuilder& s) {
            const MaterialId m = glass(s, alpha, {0.5f, 0.5f, 0.5f});
            s.world.materials[m.at()].alpha_stated = stated;
            return m;
        });
        for (Face& f : b.surfaces.faces)
            if (f.side.valid()) f.blocks_light = blocks;
        return to_bytes(bake(std::move(b), {.error_percent = 20})->lighting);
    };
    const Bytes opaque = with(1, true, false), none = with(1, false, false);
    EXPECT_NE(opaque, none);
    EXPECT_EQ(with(1, false, true), opaque);
    EXPECT_EQ(with(0, false, true), none);
    EXPECT_NE(with(0.5f, false, true), none);
}

TEST(Panes, SameBytesForAnyThreadCount) {
    const auto with = [](int threads) {
        SurfacesBuilder b = glazed_rooms([](SurfacesBuilder& s) { return checkers(s, 3, {0.4f, 0.4f, 0.4f}); });
        pane(b, {20, 20, 90}, {140, 0, 0}, {0, 140, 0}, glass(b, 0.5f, {0.2f, 0.5f, 0.6f}), 2, 10);
        return to_bytes(bake(std::move(b), {.error_percent = 20, .directional = Directional::all}, {}, threads)->lighting);
    };
    const Bytes one = with(1);
    EXPECT_EQ(with(2), one);
    EXPECT_EQ(with(7), one);
}

// The second room of two has no light but what comes through the pane, and what the first has back from it. Against path tracing.
TEST(Panes, AgreeWithPathTracing) {
    const std::pair<const char*, std::function<MaterialId(SurfacesBuilder&)>> materials[] = {
        {"none", [](SurfacesBuilder& s) { return glass(s, 0); }}, // what both differ by without panes
        {"clear", [](SurfacesBuilder& s) { return glass(s, 0.4f, {0.5f, 0.5f, 0.5f}); }},
        {"coloured", [](SurfacesBuilder& s) { return glass(s, 0.3f, {0.1f, 0.4f, 0.6f}); }},
        {"grate", [](SurfacesBuilder& s) { return checkers(s, 4, {0.6f, 0.6f, 0.6f}); }}};
    for (const auto& [name, material] : materials) {
        const auto b = bake(glazed_rooms(material), {.error_percent = 2});
        const Surfaces& s = b->scene.surfaces;
        double square = 0, weight = 0, field_square = 0, ratio = 0, field_ratio = 0;
        int n = 0;
        for (std::size_t i = 0; i < s.luxels.size(); ++i) {
            const Luxel& l = s.luxels[i];
            const Vec3 at = center_of(s, l), normal = s.charts[l.chart.at()].n;
            if (l.area < 0.99f || mix(i, std::uint64_t{5}) % 25 != 0 || at.x < 190) continue;
            Rgbd truth, field;
            reference_arriving(*b->field, at, normal, 8192, 1, [&](Vec3 d, Rgbd w) { truth += w * std::max(0.0, dot(d, normal)); });
            b->field->arriving(at, normal, 1024, 1, [&](Vec3 d, Rgbd w) { field += w * std::max(0.0, dot(d, normal)); });
            const Rgb baked = b->lighting.flat[texel_of(s, l)];
            for (std::size_t c = 0; c < 3; ++c) {
                const double scale = std::max(truth[c], 0.05);
                square += (baked[c] - truth[c]) * (baked[c] - truth[c]) / (scale * scale), field_square += (field[c] - truth[c]) * (field[c] - truth[c]) / (scale * scale);
                ratio += (baked[c] - truth[c]) / scale, field_ratio += (field[c] - truth[c]) / scale, weight += 1;
            }
            ++n;
        }
        ASSERT_GT(n, 20) << name;
        EXPECT_LT(std::sqrt(square / weight), 0.06) << name;       // with the path tracer's own noise, and luxels of 10 units against their middles
        EXPECT_LT(std::sqrt(field_square / weight), 0.06) << name;
        EXPECT_LT(std::abs(ratio / weight), 0.015) << name;        // no light too much, none too little
        std::printf("%s: %d luxels, bake %.3f, field %.3f, bias %+.4f %+.4f, estimate %.2f\n", name, n, std::sqrt(square / weight), std::sqrt(field_square / weight), ratio / weight, field_ratio / weight, b->lighting.error.estimate);
    }
}

// A small lamp in full view through glass: its middle, that of the box around it, lies off a lamp of three corners.
TEST(Panes, ATiltedTriangleShinesThroughGlass) {
    const auto floor_of = [](bool glazed) {
        SurfacesBuilder b;
        b.rect({-64, -64, 0}, {128, 0, 0}, {0, 128, 0}, b.material({}), {.luxel = 16});
        b.face({{{0, 0, 140}, {0, 16, 124}, {16, 0, 124}}}, b.material({}, {100, 100, 100}), {.luxel = 16}); // its plane is x + y + z = 140
        if (glazed) pane(b, {-96, -96, 80}, {192, 0, 0}, {0, 192, 0}, glass(b, 0.5f));
        return floor_light(*bake(std::move(b), {}));
    };
    const auto bare = floor_of(false), glazed = floor_of(true);
    ASSERT_EQ(bare.size(), glazed.size());
    ASSERT_GT(bare.size(), 40u);
    for (std::size_t k = 0; k < bare.size(); ++k) {
        EXPECT_GT(bare[k].x, 0.05) << k;
        EXPECT_NEAR(glazed[k].x / bare[k].x, 0.5, 0.005) << k;
    }
}

// Behind a pane that is opaque there is nothing at all, whatever the patches: faces are parted where it stands (surfaces/feet.h).
TEST(Panes, AnOpaqueOneSealsARoom) {
    for (const double luxel : {10.0, 5.0})
        for (std::uint64_t seed = 1; seed <= 4; ++seed) {
            const auto b = bake(glazed_rooms([](SurfacesBuilder& s) { return glass(s, 1, {0.5f, 0.5f, 0.5f}); }, luxel, true), {.error_percent = 20, .seed = seed});
            float most = 0, lit = 0;
            for (const Luxel& l : b->scene.surfaces.luxels) {
                const float light = max_component(b->lighting.flat[texel_of(b->scene.surfaces, l)]);
                float& side = center_of(b->scene.surfaces, l).x > 190 ? most : lit;
                side = std::max(side, light);
            }
            EXPECT_EQ(most, 0) << luxel << " " << seed;
            EXPECT_GT(lit, 1);
        }
}

// A face in something solid, which nobody sees, sends nothing on of what shines in there.
TEST(Panes, WhatLiesInSomethingSolidStaysDark) {
    SurfacesBuilder scene;
    const MaterialId grey = scene.material({0.5f, 0.5f, 0.5f});
    scene.room({{0, 0, 0}, {256, 256, 128}}, all(grey), {.luxel = 16});
    scene.block({{64, 64, 0}, {192, 192, 100}}, all(grey), {.luxel = 16});
    scene.rect({96, 96, 20}, {64, 0, 0}, {0, 64, 0}, grey, {.luxel = 16});
    pane(scene, {96, 96, 60}, {0, 64, 0}, {64, 0, 0}, glass(scene, 0.5f, {0.2f, 0.2f, 0.2f}, Rgb{1, 1, 1}, {2, 2, 2}));
    const auto b = bake(std::move(scene), {.error_percent = 20});
    int inside = 0;
    for (std::size_t p = 0; p < b->lighting.patches.size(); ++p)
        if (b->lighting.patches[p].centroid.z == 20) {
            ++inside;
            EXPECT_EQ(b->lighting.radiosity[p], Rgb{});
        }
    EXPECT_GT(inside, 0);
}

// Opacity that entities state, and whether they cast shadows at all.
TEST(PaneEntities, KeysOfTheGames) {
    struct Case {
        MapFormat format;
        std::vector<std::pair<const char*, const char*>> keys;
        double through; // 1: no pane, all passes; 0: it blocks
        float alpha = 1; // of the material; below 1 glass
        bool model = true;
    };
    const Case cases[] = {
        {MapFormat::quake_standard, {{"_shadow", "1"}, {"alpha", "0.25"}}, 0.75},
        {MapFormat::quake_standard, {{"_shadow", "1"}, {"_alpha", "0.25"}}, 0.75},
        {MapFormat::quake_standard, {{"_shadow", "1"}, {"alpha", "0"}}, 0}, // not set
        {MapFormat::quake_standard, {{"alpha", "0.25"}}, 1},                // a model without _shadow casts none
        {MapFormat::vmf, {{"vrad_brush_cast_shadows", "1"}, {"rendermode", "2"}, {"renderamt", "51"}}, 0.8},
        {MapFormat::vmf, {{"vrad_brush_cast_shadows", "1"}, {"rendermode", "0"}, {"renderamt", "51"}}, 0},
        {MapFormat::vmf, {{"vrad_brush_cast_shadows", "1"}, {"rendermode", "5"}}, 1},
        {MapFormat::vmf, {{"vrad_brush_cast_shadows", "1"}, {"alpha", "0.5"}}, 0}, // no key of Source
        {MapFormat::quake_standard, {{"_shadow", "1"}, {"alpha", "0.5"}}, 0.75, 0.5f},   // both
        {MapFormat::quake_standard, {}, 0.5, 0.5f, false},
        {MapFormat::quake_standard, {{"_shadow", "-1"}}, 1, 0.5f, false},
    };
    for (std::size_t i = 0; i < std::size(cases); ++i) {
        const Case& c = cases[i];
        SurfacesBuilder b;
        b.world.format = c.format;
        const MaterialId m = c.alpha < 1 ? glass(b, c.alpha) : b.material({0.5f, 0.5f, 0.5f});
        const FaceId face = pane(b, {-64, -64, 32}, {128, 0, 0}, {0, 128, 0}, m);
        WorldEntity entity;
        for (const auto& [key, value] : c.keys) entity.keys.push_back({key, value});
        b.world.entities.push_back(entity);
        WorldBrush& brush = b.world.brushes[0];
        brush.entity = EntityId{1}, brush.model = ModelId{c.model ? 1u : 0u};
        if (c.alpha == 1) brush.contents = Contents::solid;
        const bool casts = std::ranges::any_of(c.keys, [](const auto& k) { return std::string(k.second) == "1" && std::string(k.first) != "alpha"; });
        b.surfaces.faces[face.at()].blocks_light = c.alpha == 1 && casts; // as the surfaces stage has it
        const TraceScene scene(b.world, b.surfaces);
        EXPECT_NEAR(scene.transmitted({{0, 0, 64}, {0, 0, 0}}).share.x, c.through, 1e-7) << i;
    }
}

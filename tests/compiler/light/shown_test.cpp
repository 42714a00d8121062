// What bilinear filtering shows of luxels that are means: ramps to the rim, bends, walls, and what the encodings promise.
#include "compiler/light/shown.h"
#include "compiler/light/seams.h"
#include "tests/compiler/light/scenes.h"
#include <atomic>
#include <functional>
#include <gtest/gtest.h>

using namespace kiln;
using namespace kiln::test;

namespace {

// A baked scene in whose luxels something else is put: each the value of `field` in the middle of its footprint, which is the mean of a plane.
struct Painted {
    std::unique_ptr<Baked> baked;
    const Surfaces& s;
    explicit Painted(SurfacesBuilder scene, RnmEncoding encoding = RnmEncoding::tilted)
        : baked(bake(std::move(scene), {.error_percent = 50, .encoding = encoding, .directional = Directional::all})), s(baked->scene.surfaces) {}
    void paint(const std::function<double(Vec3)>& field) {
        Lighting& l = baked->lighting;
        std::ranges::fill(l.texel_error, 0.0f); // it is known exactly
        for (const Luxel& luxel : s.luxels) {
            const std::size_t t = texel_of(s, luxel);
            const auto v = static_cast<float>(field(center_of(s, luxel)));
            l.flat[t] = {v, 2 * v, v / 2};
            for (std::size_t k = 0; k < 3; ++k) l.rnm[rnm(luxel.chart, t)][k] = l.flat[t] * (0.5f + 0.1f * static_cast<float>(k));
        }
    }
    std::size_t rnm(ChartId chart, std::size_t texel) const { return baked->lighting.rnm_first[chart.at()] + (texel - s.charts[chart.at()].first_texel); }
    Lighting shown() {
        auto r = fit_shown(s, baked->lighting, baked->context);
        EXPECT_TRUE(r);
        return std::move(*r);
    }
};

SurfacesBuilder box(double luxel) {
    SurfacesBuilder b;
    b.room({{0, 0, 0}, {160, 128, 96}}, all(b.material({0.5f, 0.5f, 0.5f}, {1, 1, 1})), {.luxel = luxel});
    return b;
}

} // namespace

// Rims at the edge of a luxel, within the first half of one and within the second.
TEST(Shown, ARampGoesOnToTheRim) {
    for (const double luxel : {16.0, 12.0, 13.0, 18.0}) {
        Painted p(box(luxel));
        const auto field = [](Vec3 x) { return 10 + 0.02 * x.x - 0.03 * x.y + 0.01 * x.z; };
        p.paint(field);
        const Lighting shown = p.shown();
        std::size_t looked = 0, at_rims = 0;
        for (const Luxel& l : p.s.luxels) {
            const Chart& c = p.s.charts[l.chart.at()];
            for (std::uint32_t k = 0; k < l.piece_count; ++k)
                for (const Vec2 at : points_of(p.s, p.s.pieces[l.first_piece + k])) {
                    const Bilinear read = bilinear_at(c, at);
                    double flat = 0, leaning = 0;
                    bool rim = false, corner = false;
                    for (std::size_t q = 0; q < 4; ++q) {
                        if (!(read.weight[q] > 1e-9)) continue;
                        const std::uint32_t t = read.texel[q];
                        if (p.baked->lighting.valid[t] == 2) { // beyond a corner of the room no texel is beside one
                            const std::uint32_t x = (t - c.first_texel) % c.width, y = (t - c.first_texel) / c.width;
                            const auto baked = [&](std::uint32_t u, std::uint32_t v) { return u < c.width && v < c.height && p.baked->lighting.valid[c.texel(u, v)] == 1; };
                            corner |= !baked(x - 1, y) && !baked(x + 1, y) && !baked(x, y - 1) && !baked(x, y + 1), rim = true;
                        }
                        flat += read.weight[q] * static_cast<double>(shown.flat[t][0]), leaning += read.weight[q] * static_cast<double>(shown.rnm[p.rnm(l.chart, t)][2][1]);
                    }
                    if (corner) continue;
                    ++looked, at_rims += rim;
                    const double want = field(world_from_luxel(p.s, l.face, at));
                    EXPECT_NEAR(flat / want, 1, 1e-5) << luxel;
                    EXPECT_NEAR(leaning / want, 1.4, 1e-5) << luxel;
                }
        }
        EXPECT_GT(looked, 400u);
        if (luxel == 16) {
            EXPECT_GT(at_rims, 40u);
        }
    }
}

TEST(Shown, TheMeanOfWhatIsShownIsTheLuxel) {
    Painted p(box(8));
    p.paint([](Vec3 x) { return 10 + (x.x - 70) * (x.x - 70) / 25; });
    const Lighting shown = p.shown();
    std::size_t inside = 0;
    for (const Luxel& l : p.s.luxels) {
        const Chart& c = p.s.charts[l.chart.at()];
        const std::size_t t = texel_of(p.s, l);
        double mean = 0, before = 0;
        bool whole = std::abs(c.n.x) < 0.5;
        for (int dy = -1; dy <= 1 && whole; ++dy)
            for (int dx = -1; dx <= 1; ++dx) {
                for (const int far : {1, 2}) { // two rings
                    const std::int64_t u = l.x + far * dx, v = l.y + far * dy;
                    whole &= u >= 0 && v >= 0 && u < c.width && v < c.height && p.baked->lighting.valid[c.first_texel + static_cast<std::size_t>(v * c.width + u)] == 1;
                }
                if (!whole) break;
                const double w = (dx ? 0.125 : 0.75) * (dy ? 0.125 : 0.75);
                const auto at = static_cast<std::size_t>(static_cast<std::int64_t>(t) + dy * static_cast<std::int64_t>(c.width) + dx);
                mean += w * static_cast<double>(shown.flat[at][0]), before += w * static_cast<double>(p.baked->lighting.flat[at][0]);
            }
        const Vec3 middle = center_of(p.s, l);
        if (!whole || std::abs(middle.x - 70) < 40) continue; // the lowest luxels stay the lowest
        ++inside;
        EXPECT_NEAR(mean / static_cast<double>(p.baked->lighting.flat[t][0]), 1, 1e-5);
        EXPECT_GT(before / static_cast<double>(p.baked->lighting.flat[t][0]), 1.001);
    }
    EXPECT_GT(inside, 30u);
}

// A bright room, a dark one, a doorway, luxels that the wall between cuts: nothing dark gets light, and nothing bright a fringe.
TEST(Shown, StepsStaySteps) {
    for (const double luxel : {10.0, 16.0}) {
        Painted p(two_rooms(luxel));
        p.paint([](Vec3 x) { return x.x < 185 ? 1000.0 : 0.0; });
        const Lighting shown = p.shown();
        for (const Luxel& l : p.s.luxels) EXPECT_EQ(shown.flat[texel_of(p.s, l)], p.baked->lighting.flat[texel_of(p.s, l)]) << luxel;
    }
}

// A gentle bend is followed, and left alone where luxels are as noisy as it is deep.
TEST(Shown, NoiseIsNoBend) {
    Painted p(box(8));
    p.paint([](Vec3 x) { return 10 + x.x * x.x / 500; });
    const auto moved = [&](float noise) {
        std::ranges::fill(p.baked->lighting.texel_error, noise);
        const Lighting shown = p.shown();
        std::size_t n = 0;
        for (const Luxel& l : p.s.luxels) n += shown.flat[texel_of(p.s, l)] != p.baked->lighting.flat[texel_of(p.s, l)];
        return n;
    };
    EXPECT_GT(moved(0), 500u);
    EXPECT_GT(moved(1e-4f), 500u);
    EXPECT_EQ(moved(0.05f), 0u);
    // Irradiance along a leaning normal that smoothing drew below 0.
    for (auto& values : p.baked->lighting.rnm) values[1] = {-0.001f, -0.001f, -0.001f};
    EXPECT_EQ(moved(0.05f), 0u);
    const Lighting shown = p.shown();
    for (const Luxel& l : p.s.luxels) EXPECT_EQ(shown.rnm[p.rnm(l.chart, texel_of(p.s, l))][1].x, -0.001f);
}

TEST(Shown, FlatAndLeaningNormalsStayOne) {
    Painted p(two_rooms(), RnmEncoding::dot);
    const Lighting shown = p.shown();
    std::size_t changed = 0;
    for (const Luxel& l : p.s.luxels) {
        const std::size_t t = texel_of(p.s, l);
        if (shown.valid[t] != 1) continue;
        changed += shown.flat[t] != p.baked->lighting.flat[t];
        const auto& v = shown.rnm[p.rnm(l.chart, t)];
        for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR((v[0][c] + v[1][c] + v[2][c]) / std::sqrt(3.0f), shown.flat[t][c], 1e-4f * shown.flat[t][c] + 1e-6f);
    }
    EXPECT_GT(changed, 100u);
}

TEST(Shown, StopsWhenAsked) {
    Painted p(box(16));
    std::atomic<bool> stop{true};
    p.baked->context.stop = &stop;
    const auto r = fit_shown(p.s, p.baked->lighting, p.baked->context);
    ASSERT_FALSE(r);
    EXPECT_EQ(r.fault().exit, Exit::cancelled);
}

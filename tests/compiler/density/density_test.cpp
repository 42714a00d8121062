// Rooms through the real geometry stages, light by hand: what coarser grids show must be what the luxels show, seen through a level
// file and its loader.
#include "compiler/density/density.h"
#include "compiler/light/seams.h"
#include "compiler/pack/pack.h"
#include "formats/level/kiln_level.hpp"
#include "libs/core/archive.h"
#include "tests/support/curves.h"
#include "tests/support/world_builder.h"
#include <gtest/gtest.h>
#include <functional>
#include <random>
#include <set>

namespace kiln {
namespace {

using Field = std::function<Rgb(Vec3 at, Vec3 normal)>;

struct Room {
    test::WorldBuilder b;
    Csg csg;
    Bsp bsp;
    Surfaces surfaces;
    Lighting lighting;
    Context context;

    // A room of 512 x 320 x 128 with a pillar; luxels of `luxel`.
    explicit Room(double luxel = 16, bool terrain = false) {
        b.room({0, 0, terrain ? -64.0 : 0.0}, {512, terrain ? 512.0 : 320.0, 128});
        b.box({200, 100, terrain ? -64.0 : 0.0}, {232, 150, 128});
        b.point_entity("info_player_start", {100, 40, 60});
        for (WorldSide& s : b.world.sides) s.lightmap_scale = luxel;
        if (terrain) test::mixed_terrain(b, 0, [](double x, double y) { return test::hills(x, y); }, {0}, luxel);
        csg = *build_csg(b.world, {}, context);
        bsp = *build_bsp(b.world, csg, {}, context);
        surfaces = *build_surfaces(b.world, csg, bsp, {}, context);
    }
    Vec3 place(std::size_t chart, Vec2 luxel) const { return world_from_luxel(surfaces, surfaces.charts[chart].faces[0], luxel); }
    Vec3 normal(std::size_t chart) const { return surfaces.faces[surfaces.charts[chart].faces[0].at()].normal; }

    // Every texel, gutters included, as if baked. Directional charts: every `directional`th; their values lean by the field.
    void light(const Field& field, RnmEncoding encoding = RnmEncoding::dot, std::size_t directional = 0, double leaning = 0.3) {
        lighting = {};
        lighting.encoding = encoding;
        lighting.flat.resize(surfaces.texel_count), lighting.valid.assign(surfaces.texel_count, 1), lighting.texel_error.assign(surfaces.texel_count, 0);
        for (std::size_t c = 0; c < surfaces.charts.size(); ++c) {
            const Chart& chart = surfaces.charts[c];
            const bool wanted = directional && c % directional == 0;
            lighting.chart_directional.push_back(wanted);
            lighting.rnm_first.push_back(wanted ? static_cast<std::uint32_t>(lighting.rnm.size()) : UINT32_MAX);
            for (std::uint32_t y = 0; y < chart.height; ++y)
                for (std::uint32_t x = 0; x < chart.width; ++x) {
                    const Vec3 p = place(c, {x + 0.5, y + 0.5});
                    Rgb& flat = lighting.flat[chart.texel(x, y)];
                    flat = field(p, normal(c));
                    if (!wanted) continue;
                    const auto lean = static_cast<float>(leaning * std::sin(p.x / 90 + p.y / 70));
                    std::array<Rgb, 3> l{flat * (1 + lean), flat * (1 - 0.5f * lean), flat * (1 - 0.5f * lean)};
                    if (encoding == RnmEncoding::dot)
                        for (Rgb& v : l) v = v * (1 / std::sqrt(3.0f));
                    lighting.rnm.push_back(l);
                }
        }
    }
    Density coarse(double percent, int threads = 1) {
        context.threads = threads;
        Result<Density> d = coarsen(surfaces, lighting, {.error_percent = percent}, context);
        EXPECT_TRUE(d);
        validate(*d, surfaces, lighting);
        return *std::move(d);
    }
    Bytes level(const Density* density) {
        Visibility visibility;
        visibility.cluster_count = bsp.cluster_count;
        visibility.rows.assign(std::size_t{bsp.cluster_count} * ((bsp.cluster_count + 63) / 64), ~std::uint64_t{0});
        return pack({b.world, csg, bsp, visibility, surfaces, {}, lighting, {}, {}, "{}", "", "", density}, {.zstd_level = 1, .rgb9e5 = false}, context);
    }
    double floor() const {
        return 0.02 * mean_irradiance(surfaces, lighting);
    }
    // The chart of the floor: the largest that looks up.
    std::size_t floor_chart() const {
        std::size_t best = 0;
        for (std::size_t c = 0; c < surfaces.charts.size(); ++c)
            if (normal(c).z > 0.9 && surfaces.charts[c].width * surfaces.charts[c].height > (normal(best).z > 0.9 ? surfaces.charts[best].width * surfaces.charts[best].height : 0)) best = c;
        return best;
    }
};

// The largest change that is shown at random places of all faces of a chart, over the flat light there or the floor; flat, and for
// normals all over the hemisphere where light is directional.
double shown_change(const Room& room, const Bytes& full, const Bytes& coarse, int places) {
    const level::Level a(full), b(coarse);
    std::mt19937 random{7};
    const auto unit = [&] { return random() / 4294967296.0; };
    const double floor = room.floor();
    double most = 0;
    std::size_t n = 0;
    const kiln_face* faces = kiln_level_faces(a.get(), &n);
    const float* positions = kiln_level_positions(a.get(), nullptr);
    const std::uint32_t* corner = kiln_level_triangles(a.get(), nullptr);
    for (std::uint32_t f = 0; f < n; ++f) {
        if (faces[f].chart == KILN_NO_INDEX || faces[f].triangle_count == 0) continue;
        for (int k = 0; k < places; ++k) {
            const std::size_t t = faces[f].first_triangle + random() % faces[f].triangle_count;
            double u = unit(), v = unit();
            if (u + v > 1) u = 1 - u, v = 1 - v;
            double at[3] = {};
            for (std::size_t i = 0; i < 3; ++i) {
                const double share = i == 0 ? 1 - u - v : i == 1 ? u : v;
                for (std::size_t x = 0; x < 3; ++x) at[x] += share * static_cast<double>(positions[3 * std::size_t{corner[3 * t + i]} + x]);
            }
            float ea[3], eb[3], la[3], lb[3];
            if (kiln_level_eval_flat(a.get(), f, at, ea) != KILN_OK) continue; // between the triangles of a curve
            EXPECT_EQ(kiln_level_eval_flat(b.get(), f, at, eb), KILN_OK);
            float normal[3] = {static_cast<float>(unit() * 2 - 1), static_cast<float>(unit() * 2 - 1), static_cast<float>(unit())};
            const float length = std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
            for (float& x : normal) x /= length;
            EXPECT_EQ(kiln_level_eval_rnm_local(a.get(), f, at, normal, la), KILN_OK);
            EXPECT_EQ(kiln_level_eval_rnm_local(b.get(), f, at, normal, lb), KILN_OK);
            for (int c = 0; c < 3; ++c) {
                const double scale = std::max(static_cast<double>(ea[c]), floor);
                most = std::max(most, std::abs(ea[c] - eb[c]) / scale);
                most = std::max(most, std::abs(la[c] - lb[c]) / scale);
            }
        }
    }
    return most;
}
constexpr double kStored = 0.004; // what halfs may differ by, both sides together

TEST(Density, EvenLightIsOneTexelAndBlackToo) {
    for (const Rgb even : {Rgb{0.7f, 0.2f, 0.5f}, Rgb{}}) {
        Room room;
        room.light([&](Vec3, Vec3) { return even; }, RnmEncoding::dot, 2, 0);
        const Density d = room.coarse(1);
        for (const ChartGrid& g : d.grids) EXPECT_EQ(std::make_pair(g.width, g.height), std::make_pair(1u, 1u));
        for (const Rgb& e : d.flat)
            for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(e[c], even[c], 1e-6);
    }
}

// A straight line has two ends.
TEST(Density, RampAlongOneAxisIsTwoTexelsAndExact) {
    Room room;
    const auto ramp = [](Vec3 p, Vec3) { const auto v = static_cast<float>(1 + p.x / 256); return Rgb{v, 2 * v, 0.5f * v}; };
    room.light(ramp);
    const Density d = room.coarse(0.2);
    std::size_t ramps = 0;
    for (std::size_t c = 0; c < d.grids.size(); ++c) {
        const ChartGrid& g = d.grids[c];
        const Chart& chart = room.surfaces.charts[c];
        const bool along = std::abs(room.normal(c).x) < 0.5;
        EXPECT_EQ(std::max(g.width, g.height), along ? 2u : 1u);
        EXPECT_EQ(std::min(g.width, g.height), 1u);
        ramps += along;
        Chart grid;
        grid.width = g.width, grid.height = g.height, grid.first_texel = g.first_texel;
        for (std::uint32_t l = 0; l < room.surfaces.luxels.size(); ++l) {
            const Luxel& luxel = room.surfaces.luxels[l];
            if (luxel.chart.value != c) continue;
            const Vec2 at = centroid_of(room.surfaces, luxel);
            const Bilinear b = bilinear_at(grid, texel_from_luxel(g, at));
            double shown = 0;
            for (std::size_t k = 0; k < 4; ++k) shown += b.weight[k] * static_cast<double>(d.flat[b.texel[k]].x);
            EXPECT_NEAR(shown, static_cast<double>(ramp(room.place(c, at), {}).x), 2e-4) << chart.width << " x " << chart.height; // one texel: 1/1024 off its middle
        }
    }
    EXPECT_GT(ramps, 3u);
}

TEST(Density, HardShadowStaysFineAcrossIt) {
    Room room;
    room.light([](Vec3 p, Vec3) { return p.x < 310 ? Rgb{1, 1, 1} : Rgb{0.05f, 0.05f, 0.05f}; });
    const std::size_t floor = room.floor_chart();
    const Chart& chart = room.surfaces.charts[floor];
    const Density d = room.coarse(2);
    const bool x_along_s = std::abs(chart.s.x) > 0.5;
    EXPECT_GE(x_along_s ? d.grids[floor].width : d.grids[floor].height, 30u);
    EXPECT_EQ(x_along_s ? d.grids[floor].height : d.grids[floor].width, 1u);
    // Turned by 40 degrees it is fine along both.
    room.light([](Vec3 p, Vec3) { return p.x * 0.77 + p.y * 0.64 < 400 ? Rgb{1, 1, 1} : Rgb{0.05f, 0.05f, 0.05f}; });
    const ChartGrid g = room.coarse(2).grids[floor];
    EXPECT_EQ(g.width, chart.width);
    EXPECT_EQ(g.height, chart.height);
}

// Light that ends at a wall does not come through, be it as little as the bound.
TEST(Density, BlackStaysBlack) {
    Room room;
    room.light([](Vec3 p, Vec3) { const auto v = static_cast<float>(p.x > 250 ? 0 : 1 + 0.2 * std::sin(p.y / 40)); return Rgb{v, v, v}; }, RnmEncoding::dot, 2);
    const Density d = room.coarse(5);
    EXPECT_LT(3 * d.flat.size(), 2 * room.surfaces.texel_count);
    const Bytes full = room.level(nullptr), coarse = room.level(&d);
    const level::Level a(full), b(coarse);
    std::size_t black = 0;
    for (std::uint32_t f = 0; f < a.faces().size(); ++f)
        for (double x = 1; x < 512; x += 7.3)
            for (double y = 1; y < 320; y += 9.1) {
                const double at[3] = {x, y, y / 3};
                float ea[3], eb[3];
                if (kiln_level_eval_flat(a.get(), f, at, ea) != KILN_OK || ea[0] > 0) continue;
                ASSERT_EQ(kiln_level_eval_flat(b.get(), f, at, eb), KILN_OK);
                if (std::abs(a.faces()[f].normal[2]) < 0.9f) continue; // the point is not on a wall
                ASSERT_EQ(eb[0], 0.0f) << x << " " << y;
                ++black;
            }
    EXPECT_GT(black, 1000u);
}

Field waves(double length, std::uint32_t seed) {
    std::mt19937 random{seed};
    std::array<double, 9> k{};
    for (double& v : k) v = random() / 4294967296.0;
    return [=](Vec3 p, Vec3 n) {
        const double a = std::sin((p.x * (0.5 + k[0]) + p.y * (k[1] - 0.5)) / length + 6 * k[2]), b = std::sin((p.y + p.z * k[3]) / length + 6 * k[4] + n.x);
        const double v = std::max(0.0, 0.6 + k[5] + a * (0.4 + 0.6 * k[6]) + 0.3 * b); // black in places
        return Rgb{static_cast<float>(v), static_cast<float>(v * (0.4 + 0.3 * k[7])), static_cast<float>(v * v * k[8])};
    };
}

TEST(Density, NoPlaceShowsMoreChangeThanTheBound) {
    for (const RnmEncoding encoding : {RnmEncoding::dot, RnmEncoding::sq, RnmEncoding::tilted})
        for (std::uint32_t seed = 1; seed <= 3; ++seed)
            for (const double percent : {0.5, 3.0}) {
                Room room(seed == 2 ? 7 : 16, seed == 3);
                room.light(waves(seed == 1 ? 60 : 150, seed), encoding, 2);
                const Bytes full = room.level(nullptr);
                const Density d = room.coarse(percent);
                const Bytes coarse = room.level(&d);
                EXPECT_LT(d.flat.size(), room.surfaces.texel_count) << "nothing was tried";
                EXPECT_LT(shown_change(room, full, coarse, 200), percent / 100 + 2 * kStored) << "encoding " << static_cast<int>(encoding) << " seed " << seed;
            }
}

// Fits are made in floats, of squares: nothing may depend on how bright the scene is as a whole. By powers of two not a bit does.
TEST(Density, TheUnitOfLightChangesNothing) {
    for (const RnmEncoding encoding : {RnmEncoding::dot, RnmEncoding::tilted}) {
        Room room;
        const Field field = waves(90, 3);
        room.light(field, encoding, 2);
        const Density d = room.coarse(2);
        ASSERT_LT(d.flat.size(), room.surfaces.texel_count);
        for (const float unit : {0x1p-7f, 0x1p24f}) {
            room.light([&](Vec3 p, Vec3 n) { return field(p, n) * unit; }, encoding, 2);
            const Density other = room.coarse(2);
            ASSERT_EQ(other.flat.size(), d.flat.size());
            ASSERT_EQ(other.rnm.size(), d.rnm.size());
            for (std::size_t t = 0; t < d.flat.size(); ++t) ASSERT_EQ(other.flat[t], d.flat[t] * unit) << t;
            for (std::size_t t = 0; t < d.rnm.size(); ++t)
                for (std::size_t k = 0; k < 3; ++k) ASSERT_EQ(other.rnm[t][k], d.rnm[t][k] * unit) << t;
        }
    }
}

TEST(Density, TighterBoundsTakeMoreTexelsAndNoneLeavesAllAsItIs) {
    Room room(8);
    room.light(waves(120, 5), RnmEncoding::dot, 3);
    std::size_t last = SIZE_MAX;
    for (const double percent : {0.1, 1.0, 5.0, 20.0}) {
        const std::size_t n = room.coarse(percent).flat.size();
        EXPECT_LT(n, last);
        last = n;
    }
    const Density off = room.coarse(0);
    EXPECT_TRUE(off.grids.empty());
    EXPECT_EQ(room.level(&off), room.level(nullptr));
}

TEST(Density, SameBytesForAnyNumberOfThreads) {
    Room room(16, true);
    room.light(waves(100, 9), RnmEncoding::dot, 2);
    const Bytes one = to_bytes(room.coarse(2, 1));
    EXPECT_EQ(to_bytes(room.coarse(2, 2)), one);
    EXPECT_EQ(to_bytes(room.coarse(2, 7)), one);
}

// Charts that an earlier run has made are taken over, and only the others are fitted to what filtering shows.
TEST(Density, WhatWasKeptChangesNothing) {
    Room room(16, true);
    room.light(waves(100, 9), RnmEncoding::dot, 2);
    room.lighting.piece_patch.assign(room.surfaces.pieces.size(), 0), room.lighting.patch_index.assign(room.surfaces.texel_count, 0);
    const auto texels = [&](Memo* memo) {
        const auto made = level_texels(room.surfaces, room.lighting, {.error_percent = 2}, room.context, memo);
        EXPECT_TRUE(made);
        return to_bytes(*made);
    };
    Memo kept;
    EXPECT_EQ(texels(&kept), texels(nullptr));
    const std::size_t charts = kept.size();
    EXPECT_GT(charts, 4u);
    for (const bool change : {false, true}) {
        if (change) // one luxel of one chart
            room.lighting.flat[texel_of(room.surfaces, room.surfaces.luxels[room.surfaces.luxels.size() / 2])] = {9, 9, 9};
        kept = from_bytes<Memo>(to_bytes(kept));
        EXPECT_EQ(texels(&kept), texels(nullptr));
        EXPECT_EQ(kept.found(), charts - change);
    }
}

// Noise that the bake knows of is not kept; a step that it hides in single luxels, but not in many, is.
TEST(Density, NoiseIsNoDetail) {
    Room room;
    std::mt19937 random{3};
    std::normal_distribution<double> normal;
    const std::size_t floor = room.floor_chart();
    const auto noisy = [&](double step) {
        return [&, step](Vec3 p, Vec3) { const auto v = static_cast<float>((p.x < 256 ? 1 : 1 + step) * (1 + 0.03 * normal(random))); return Rgb{v, v, v}; };
    };
    const auto grid = [&](double step, float known) {
        room.light(noisy(step));
        room.lighting.texel_error.assign(room.surfaces.texel_count, known);
        return room.coarse(2).grids[floor];
    };
    const ChartGrid even = grid(0, 0.03f);
    EXPECT_EQ(even.width * even.height, 1u);
    const ChartGrid unknown = grid(0, 0);
    EXPECT_EQ(unknown.width * unknown.height, room.surfaces.charts[floor].width * room.surfaces.charts[floor].height);
    const ChartGrid step = grid(0.1, 0.03f);
    EXPECT_GT(step.width * step.height, 1u);
}

// Beside the faces the bake fills in copies of what is next to them; a ramp goes straight on there all the same.
TEST(Density, GuttersThatWereFilledDoNotBendARamp) {
    Room room;
    room.light([](Vec3 p, Vec3) { const auto v = static_cast<float>(1 + p.x / 512); return Rgb{v, v, v}; });
    std::vector<std::uint8_t> baked(room.surfaces.texel_count);
    for (const Luxel& l : room.surfaces.luxels) baked[texel_of(room.surfaces, l)] = 1;
    const std::size_t floor = room.floor_chart();
    const Chart& c = room.surfaces.charts[floor];
    for (std::uint32_t y = 0; y < c.height; ++y)
        for (std::uint32_t x = 0; x < c.width; ++x) {
            const std::uint32_t t = c.texel(x, y);
            if (baked[t]) continue;
            room.lighting.valid[t] = 2;
            for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
                const auto u = static_cast<std::int64_t>(x) + dx, v = static_cast<std::int64_t>(y) + dy;
                if (u < 0 || v < 0 || u >= c.width || v >= c.height || !baked[c.texel(static_cast<std::uint32_t>(u), static_cast<std::uint32_t>(v))]) continue;
                room.lighting.flat[t] = room.lighting.flat[c.texel(static_cast<std::uint32_t>(u), static_cast<std::uint32_t>(v))];
            }
        }
    const ChartGrid g = room.coarse(0.5).grids[floor];
    EXPECT_EQ(g.width * g.height, 2u);
}

// Charts of the same light lie on one place of the atlas.
TEST(Density, EqualChartsShareTheirTexels) {
    Room room;
    room.light([](Vec3, Vec3 n) { return n.z > 0.5 ? Rgb{1, 1, 1} : Rgb{0.25f, 0.5f, 0.75f}; });
    const Density d = room.coarse(1);
    const Bytes bytes = room.level(&d);
    const level::Level level(bytes);
    std::set<std::array<std::uint32_t, 3>> places;
    for (const kiln_chart& c : level.charts()) places.insert({c.page, c.page_x, c.page_y});
    EXPECT_EQ(places.size(), 2u);
    EXPECT_LT(shown_change(room, room.level(nullptr), bytes, 20), kStored);
    kiln_page page{};
    ASSERT_EQ(kiln_level_page_info(level.get(), 0, &page), KILN_OK);
    EXPECT_LE(page.width * page.height, 16u);
}

} // namespace
} // namespace kiln

// Traces against displacements and patches that went through the compiler: what is drawn is what stops.
#include "compiler/pack/pack.h"
#include "formats/level/kiln_level.hpp"
#include "tests/compiler/bsp/map_support.h"
#include "tests/compiler/surfaces/build.h"
#include "tests/support/curves.h"
#include <optional>
#include <random>

namespace kiln::test {
namespace {

constexpr double kRest = KILN_TRACE_DISTANCE;

struct Packed {
    std::vector<std::uint8_t> bytes;
    std::optional<level::Level> level;

    explicit Packed(const World& world) {
        const Built built = build(world);
        Context context;
        Visibility visibility;
        visibility.cluster_count = built.bsp.cluster_count;
        visibility.rows.assign(std::size_t{built.bsp.cluster_count} * ((built.bsp.cluster_count + 63) / 64), ~std::uint64_t{0});
        const std::vector<Light> lights;
        Lighting lighting; // dark
        const std::size_t texels = built.surfaces.texel_count;
        lighting.flat.assign(texels, {}), lighting.valid.assign(texels, 1), lighting.texel_error.assign(texels, 0);
        lighting.chart_directional.assign(built.surfaces.charts.size(), 0), lighting.rnm_first.assign(built.surfaces.charts.size(), UINT32_MAX);
        const Ambient ambient;
        const Probes probes;
        Result<Bytes> packed = pack({world, built.csg, built.bsp, visibility, built.surfaces, lights, lighting, ambient, probes, "{}", "", "test"}, {}, context);
        if (!packed) throw std::runtime_error(to_text(packed.fault().diagnostic)); // ends the test
        bytes = std::move(*packed);
        level.emplace(bytes);
    }
    kiln_trace trace(Vec3 start, Vec3 end, Vec3 half) const {
        kiln_trace t{};
        const Vec3 mins = -half;
        EXPECT_EQ(kiln_trace_box(level->get(), &start.x, &end.x, &mins.x, &half.x, KILN_MASK_PLAYERS, &t), KILN_OK);
        return t;
    }
    // Where a vertical line first meets what is drawn of curves, from above; the borders of triangles included.
    double drawn_height(double x, double y, double below) const {
        double best = -1e30;
        const auto positions = level->positions();
        for (const kiln_face& f : level->faces()) {
            if (!(f.flags & KILN_FACE_CURVED)) continue;
            for (std::uint32_t t = f.first_triangle; t < f.first_triangle + f.triangle_count; ++t) {
                Vec3 v[3];
                for (std::size_t c = 0; c < 3; ++c) {
                    const float* p = &positions[3 * std::size_t{level->triangles()[3 * std::size_t{t} + c]}];
                    v[c] = {p[0], p[1], p[2]};
                }
                const auto side = [&](Vec3 a, Vec3 b) { return (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x); };
                const double w[3] = {side(v[1], v[2]), side(v[2], v[0]), side(v[0], v[1])}, area = w[0] + w[1] + w[2];
                if (area == 0 || w[0] / area < -1e-9 || w[1] / area < -1e-9 || w[2] / area < -1e-9) continue;
                const double z = (w[0] * v[0].z + w[1] * v[1].z + w[2] * v[2].z) / area;
                if (z < below) best = std::max(best, z);
            }
        }
        return best;
    }
};

TEST(CompiledCurveTraces, SewnTerrainStopsWhereItIsDrawn) {
    WorldBuilder b;
    sealed_room(b, {0, 0, -128}, {512, 512, 256});
    mixed_terrain(b, 0, hills);
    const Packed p(b.world);
    std::mt19937_64 rng(1);
    const auto uniform = [&](double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(rng); };
    for (int i = 0; i < 3000; ++i) {
        // Half of them right on the borders between displacements, where powers differ.
        Vec3 at{uniform(1, 511), uniform(1, 511), 250};
        if (i % 4 == 0) at.y = 256;
        if (i % 4 == 1) at.x = at.y < 256 ? 256 : i % 8 == 1 ? 256 : 384;
        const kiln_trace t = p.trace(at, {at.x, at.y, -120}, {});
        ASSERT_LT(t.fraction, 1) << at.x << ' ' << at.y;
        ASSERT_NE(t.displacement, KILN_NO_INDEX) << at.x << ' ' << at.y;
        const double height = p.drawn_height(at.x, at.y, 250);
        ASSERT_NEAR(t.end[2], height + kRest / std::max(0.05, t.normal[2]), 0.05) << at.x << ' ' << at.y;
        const kiln_trace up = p.trace({at.x, at.y, -120}, at, {});
        ASSERT_NE(up.displacement, KILN_NO_INDEX) << at.x << ' ' << at.y;
        // A player's box ends above all of it that is under it.
        const Vec3 half{16, 16, 36}, middle{std::clamp(at.x, 17., 495.), std::clamp(at.y, 17., 495.), 200};
        const kiln_trace box = p.trace(middle, {middle.x, middle.y, -90}, half);
        ASSERT_LT(box.fraction, 1);
        for (int k = 0; k < 4; ++k) {
            const double x = middle.x + uniform(-16, 16), y = middle.y + uniform(-16, 16);
            ASSERT_LT(p.drawn_height(x, y, 250), box.end[2] - 36);
        }
    }
}

TEST(CompiledCurveTraces, MapsOfTerrainHoldWhatFalls) {
    Context context;
    const auto world = real_world(std::string(KILN_SOURCE_DIR "/maps/terrain/terrain.vmf"), context);
    ASSERT_TRUE(world);
    const Packed p(*world);
    Vec3 lo{1e9, 1e9, 0}, hi{-1e9, -1e9, 0};
    std::size_t n = 0;
    const kiln_displacement* d = kiln_level_displacements(p.level->get(), &n);
    ASSERT_GT(n, 3u);
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t c = 0; c < 4; ++c) {
            const double x = d[i].base[3 * c], y = d[i].base[3 * c + 1];
            lo.x = std::min(lo.x, x), lo.y = std::min(lo.y, y), hi.x = std::max(hi.x, x), hi.y = std::max(hi.y, y);
        }
    std::mt19937_64 rng(2);
    const auto uniform = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(rng); };
    int on_terrain = 0, rays = 0;
    for (int i = 0; i < 1500; ++i) {
        const Vec3 at{uniform(lo.x + 20, hi.x - 20), uniform(lo.y + 20, hi.y - 20), 200};
        const Vec3 half = i % 2 ? Vec3{12, 12, 24} : Vec3{};
        const kiln_trace t = p.trace(at, {at.x, at.y, -500}, half);
        if (t.start_solid) continue;
        ASSERT_LT(t.fraction, 1) << at.x << ' ' << at.y;
        on_terrain += t.displacement != KILN_NO_INDEX;
        if (i % 2) continue;
        ++rays;
        const double height = p.drawn_height(at.x, at.y, 200);
        if (t.displacement == KILN_NO_INDEX) {
            EXPECT_LT(height, t.end[2]);
        } else {
            ASSERT_NEAR(t.end[2], height + kRest / std::max(0.05, t.normal[2]), 0.05) << at.x << ' ' << at.y;
        }
    }
    EXPECT_GT(on_terrain, 300);
    EXPECT_GT(rays, 300);
}

// Half a pipe, as Quake 3 maps have them.
TEST(CompiledCurveTraces, PatchesStopBoxes) {
    WorldBuilder b;
    sealed_room(b, {-256, -256, -128}, {256, 256, 256});
    patch(b, 3, 3, [](std::uint32_t c, std::uint32_t r) { return Vec3{128.0 * (c - 1.0), 100.0 * (r - 1.0), c == 1 ? -64. : 64.}; });
    const Packed p(b.world);
    // The curve's bottom is half way between its ends and its control point: z = 0.
    const kiln_trace t = p.trace({0, 0, 200}, {0, 0, -100}, {});
    EXPECT_EQ(t.patch, 0u);
    EXPECT_NEAR(t.end[2], kRest, 1.5); // as flat as asked for
    const kiln_trace box = p.trace({0, 0, 200}, {0, 0, -100}, {32, 32, 8});
    EXPECT_EQ(box.patch, 0u);
    EXPECT_NEAR(box.end[2], 8 + kRest + 64 * (32. / 128) * (32. / 128), 1.5); // its edges stand on z = 64 (x / 128)^2
    EXPECT_EQ(p.trace({150, 0, 200}, {150, 0, -100}, {8, 8, 8}).patch, KILN_NO_INDEX);
}

} // namespace
} // namespace kiln::test

// Light on displacements and patches: through the real stages, against closed forms.
#include "compiler/light/field.h"
#include "tests/support/curves.h"
#include <gtest/gtest.h>
#include <numbers>

namespace kiln::test {
namespace {

constexpr double kPi = std::numbers::pi;

struct Baked {
    Csg csg;
    Bsp bsp;
    Surfaces surfaces;
    Lighting lighting;
};
Baked bake_world(const World& world, const std::vector<Light>& lights = {}, double error = 3, int threads = 1) {
    Context context;
    context.threads = threads;
    Baked b;
    b.csg = *build_csg(world, {}, context);
    b.bsp = *build_bsp(world, b.csg, {}, context);
    b.surfaces = *build_surfaces(world, b.csg, b.bsp, {}, context);
    validate(b.surfaces);
    b.lighting = *bake_light(world, b.bsp, b.bsp.planes, b.surfaces, lights, {.error_percent = error}, context);
    validate(b.lighting, b.surfaces);
    return b;
}

void furnished(WorldBuilder& b, double rho, double emission) {
    b.world.materials[0].reflectance = Rgb{1, 1, 1} * static_cast<float>(rho);
    b.world.materials[0].emission = Rgb{1, 1, 1} * static_cast<float>(emission);
    b.room({0, 0, -64}, {256, 256, 160}, 16);
    b.point_entity("info_player_start", {128, 128, 130});
}

} // namespace

// Where everything emits e and reflects rho, radiance is e / (1 - rho) everywhere: on a bumpy floor, under an arch of a
// curve, and at the walls they run into.
TEST(CurvedLight, FurnaceIsEvenOverATerrainAndACurve) {
    WorldBuilder b;
    furnished(b, 0.6, 0.4);
    b.world.materials[0].flags |= kTwoSided; // the back of a sheet is black otherwise, and the arch shows its own
    for (WorldSide& s : b.world.sides) s.lightmap_scale = 32;
    displaced_box(b, {0, 0, -16}, {128, 256, 0}, 3, hills, {0}, 16);
    displaced_box(b, {128, 0, -16}, {256, 256, 0}, 2, hills, {0}, 16);
    patch(b, 3, 3, [](std::uint32_t c, std::uint32_t r) { return Vec3{64 + 64.0 * c, 96 + 32.0 * r, c == 1 ? 150.0 : 60}; }, {0}, 16);
    const Baked baked = bake_world(b.world, {}, 2); // worst of 400 luxels of which each may have noise of 1.2 %
    EXPECT_EQ(baked.lighting.escaped_rays, 0u);
    std::size_t curved = 0;
    double worst = 0;
    for (const Luxel& l : baked.surfaces.luxels) {
        const Chart& c = baked.surfaces.charts[l.chart.at()];
        const std::size_t t = c.texel(l.x, l.y);
        if (!c.curved() || baked.lighting.valid[t] != 1) continue;
        ++curved;
        worst = std::max(worst, std::abs(baked.lighting.flat[t].x / kPi - 1));
    }
    EXPECT_GT(curved, 400u);
    EXPECT_LT(worst, 0.03);
    for (std::size_t p = 0; p < baked.lighting.patches.size(); ++p) {
        if (!baked.surfaces.faces[baked.lighting.patches[p].face.at()].curved() || baked.lighting.patches[p].area <= 16) continue;
        EXPECT_NEAR(baked.lighting.radiosity[p].x, kPi, 0.03 * kPi);
    }
}

// A lamp straight above a slope: E = I cos / r^2 for the slope's normal, in the middle of each luxel.
TEST(CurvedLight, ASlopeGetsTheCosineOfItsOwnNormal) {
    WorldBuilder b;
    furnished(b, 0, 0);
    displaced_box(b, {0, 0, -16}, {256, 256, 0}, 2, [](double x, double) { return x / 4 - 40; });
    Light lamp;
    lamp.position = {128, 128, 150}, lamp.intensity = {1000, 1000, 1000};
    lamp.constant = 0, lamp.linear = 0, lamp.quadratic = 1;
    const Baked baked = bake_world(b.world, {lamp});
    std::size_t checked = 0;
    for (const Luxel& l : baked.surfaces.luxels) {
        const Chart& c = baked.surfaces.charts[l.chart.at()];
        const std::size_t t = c.texel(l.x, l.y);
        if (!c.curved() || baked.lighting.valid[t] != 1 || l.area < 0.999f) continue;
        const Vec3 p = world_from_luxel(baked.surfaces, l.face, centroid_of(baked.surfaces, l)), d = lamp.position - p;
        const Vec3 n = baked.surfaces.faces[l.face.at()].normal;
        const double wanted = lamp.attenuation(length(d)) * 1000 * dot(normalize(d), n);
        EXPECT_NEAR(baked.lighting.flat[t].x, wanted, 0.02 * wanted + 1e-9);
        ++checked;
    }
    EXPECT_GT(checked, 200u);
}

// A ridge between a lamp and the far side of the room: what lies in its shadow is black.
TEST(CurvedLight, ARidgeBlocksLight) {
    WorldBuilder b;
    furnished(b, 0, 0);
    displaced_box(b, {0, 0, -16}, {256, 256, 0}, 4, [](double x, double) { return std::abs(x - 128) < 20 ? 156 : 0; });
    Light lamp;
    lamp.position = {32, 128, 60}, lamp.intensity = {1000, 1000, 1000};
    const Baked baked = bake_world(b.world, {lamp});
    std::size_t dark = 0, lit = 0;
    for (const Luxel& l : baked.surfaces.luxels) {
        const Chart& c = baked.surfaces.charts[l.chart.at()];
        const std::size_t t = c.texel(l.x, l.y);
        if (!c.curved() || baked.lighting.valid[t] != 1) continue;
        const Vec3 p = world_from_luxel(baked.surfaces, l.face, centroid_of(baked.surfaces, l));
        if (p.z > 1) continue;
        if (p.x > 150) {
            ++dark;
            EXPECT_EQ(baked.lighting.flat[t].x, 0.0f) << p.x << ' ' << p.y;
        } else if (p.x < 100) {
            lit += baked.lighting.flat[t].x > 0;
        }
    }
    EXPECT_GT(dark, 50u);
    EXPECT_GT(lit, 50u);
}

TEST(CurvedLight, TheSameForAnyNumberOfThreads) {
    WorldBuilder b;
    furnished(b, 0.5, 0.2);
    displaced_box(b, {0, 0, -16}, {256, 256, 0}, 2, hills, {0}, 32);
    for (WorldSide& s : b.world.sides) s.lightmap_scale = 32;
    const Baked one = bake_world(b.world, {}, 10, 1), three = bake_world(b.world, {}, 10, 3);
    EXPECT_EQ(one.lighting.flat, three.lighting.flat);
}

} // namespace kiln::test

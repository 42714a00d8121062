// What the visibility rows say is dark, is: no ray from there sees the light. On maps of this project, and of other people where they are at hand.
#include "compiler/light/sight.h"
#include "compiler/light/light.h"
#include "libs/core/file.h"
#include "libs/sampling/maps.h"
#include "compiler/visibility/visibility.h"
#include "tests/proof/geometry/pipeline.h"
#include "tests/support/world_builder.h"
#include <gtest/gtest.h>

using namespace kiln;
using namespace kiln::proof;

namespace {

struct Lit {
    Geometry g;
    Visibility seen;
    std::vector<Light> lights;
    explicit Lit(Geometry geometry) : g(std::move(geometry)) {
        Context context;
        context.threads = 2;
        auto v = compute_visibility(vis_portals(g.bsp), g.bsp.cluster_count, {}, context);
        if (v) seen = *std::move(v);
        else ADD_FAILURE() << v.fault().diagnostic.message;
        lights = read_lights(g.world, context);
    }
};

std::unique_ptr<Lit> of_map(const std::string& path) {
    const auto bytes = read_file(path);
    if (!bytes) return nullptr;
    return std::make_unique<Lit>(run_text({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, path, {.csg = {}, .bsp = {}, .last = "surfaces", .threads = 2}));
}

struct Counted {
    std::size_t dark = 0, pairs = 0, lit = 0; // pairs of a place and a light; of those, known to be dark; of those, seen by a ray
};
Counted count(const Lit& l, std::size_t places) {
    const Surfaces& s = l.g.surfaces;
    const TraceScene scene(l.g.world, s);
    const EmitterSet emitters(l.g.world, s, {1, 1, 1});
    const LightSight sight(l.g.world, s, l.g.bsp, &l.seen, scene, l.lights, emitters);
    const PatchTable table = build_patches(l.g.world, s, piece_adjacency(s), 64);
    Counted out;
    Random random(7);
    const auto ask = [&](Vec3 x, const Clusters& at) {
        for (std::uint32_t i = 0; i < l.lights.size(); ++i) {
            if (l.lights[i].kind == LightKind::sky) continue;
            ++out.pairs;
            if (sight.light_may(i, at)) continue;
            ++out.dark;
            if (!sees(scene, x, l.lights[i])) continue;
            ++out.lit;
            const Vec3 y = l.lights[i].position;
            ADD_FAILURE() << "light " << i << " at " << y.x << " " << y.y << " " << y.z << " shines at " << x.x << " " << x.y << " " << x.z;
        }
        for (std::uint32_t i = 0; i < emitters.emitters.size(); ++i) {
            ++out.pairs;
            if (sight.emitter_may(i, at)) continue;
            ++out.dark;
            const Emitter& e = emitters.emitters[i];
            const double u = random(), v = random();
            const Vec3 y = emitters.point_on(i, {u, v}) + e.normal * scene.push_off();
            if (dot(x - y, e.normal) <= 0 || scene.occluded(x, y)) continue;
            ++out.lit;
            ADD_FAILURE() << "face " << e.face.value << " shines from " << y.x << " " << y.y << " " << y.z << " at " << x.x << " " << x.y << " " << x.z;
        }
    };
    for (std::size_t k = 0; k < places && !s.luxels.empty(); ++k) {
        const Luxel& luxel = s.luxels[static_cast<std::size_t>(random() * static_cast<double>(s.luxels.size()))];
        const LuxelPiece& piece = s.pieces[luxel.first_piece];
        const PiecePoints points = points_of(s, piece);
        Vec2 middle;
        for (const Vec2& q : points) middle = middle + q * (1.0 / static_cast<double>(points.size()));
        const Vec2 corner = points[static_cast<std::size_t>(random() * static_cast<double>(points.size()))];
        const Vec2 at = middle + (corner - middle) * (0.98 * random());
        const Vec3 x = world_from_luxel(s, piece.face, at) + s.faces[piece.face.at()].normal * scene.push_off();
        ask(x, sight.of_patch(s, table, table.piece_patch[luxel.first_piece], scene.push_off()));
        // And in the air before it, at whole units too, where planes of the tree lie.
        const auto hit = scene.closest(x, s.faces[piece.face.at()].normal);
        const Vec3 air = x + s.faces[piece.face.at()].normal * (random() * (hit ? hit->distance : 64.0));
        ask(air, sight.at(air));
        const Vec3 whole{std::round(air.x), std::round(air.y), std::round(air.z)};
        if (leaf_at(l.g.bsp, whole).valid() && l.g.bsp.leaves[leaf_at(l.g.bsp, whole).at()].open()) ask(whole, sight.at(whole));
    }
    return out;
}

Lighting baked(const Lit& l, const Visibility* seen) {
    Context context;
    auto r = bake_light(l.g.world, l.g.bsp, l.g.bsp.planes, l.g.surfaces, l.lights, {.error_percent = 20}, context, nullptr, seen);
    EXPECT_TRUE(r);
    return *std::move(r);
}

class OfMap : public ::testing::TestWithParam<const char*> {};
TEST_P(OfMap, WhatIsDarkIsSeenByNoRay) {
    const std::string name = GetParam();
    const std::size_t slash = name.find('/');
    const auto path = slash == std::string::npos ? std::optional(std::string(KILN_SOURCE_DIR) + "/maps/" + name + "/" + name + (name == "quake_room" ? ".map" : ".vmf")) : shared_map(name);
    if (!path) GTEST_SKIP() << "the map collection is not at hand";
    const auto lit = of_map(*path);
    ASSERT_TRUE(lit);
    ASSERT_EQ(lit->g.stage, "surfaces");
    const Counted c = count(*lit, 2000);
    EXPECT_GT(c.pairs, 0u);
    EXPECT_EQ(c.lit, 0u);
    RecordProperty("dark_percent", static_cast<int>(100.0 * static_cast<double>(c.dark) / static_cast<double>(c.pairs)));
    if (slash != std::string::npos) { EXPECT_GT(c.dark, c.pairs / 10) << "the rows rule nothing out"; }
}
INSTANTIATE_TEST_SUITE_P(LightSight, OfMap,
                         ::testing::Values("corridor", "hall", "canyon", "sun_room", "detail_room", "brush_entity", "glass", "atrium", "quake_room",
                                           "id-quake-map-source/e1m1.map", "athwale-hammer/lambda_bunker_v2.vmf", "bagnaram-halflife-maps/dm_citystreet.vmf"));

// One patch on the faces of two brushes whose floors meet before a passage: the one borders on a room that sees less.
TEST(LightSight, APatchOfSeveralFacesLiesInTheClustersOfAll) {
    test::WorldBuilder w;
    const auto box = [&](Vec3 lo, Vec3 hi) { w.box(lo, hi); };
    box({-16, -16, -16}, {276, 272, 0}), box({276, 80, -16}, {616, 176, 0}), box({276, 176, -16}, {616, 716, 0}), box({-16, -16, 128}, {616, 716, 144});
    box({-16, -16, 0}, {0, 272, 128}), box({0, -16, 0}, {276, 0, 128}), box({0, 256, 0}, {276, 272, 128});
    box({276, -16, 0}, {616, 112, 128}), box({600, 112, 0}, {616, 160, 128});
    box({276, 160, 0}, {280, 716, 128}), box({296, 160, 0}, {616, 716, 128}), box({280, 700, 0}, {296, 716, 128}), box({280, 500, 96}, {296, 516, 128});
    w.point_entity("info_player_start", {64, 64, 32});
    w.point_entity("light", {64, 128, 96}, {{"light", "100"}});
    w.point_entity("light", {288, 640, 64}, {{"light", "60000"}, {"wait", "0.1"}});
    const Lit l(run(w.world));
    ASSERT_EQ(l.g.stage, "surfaces");
    const Counted c = count(l, 20000);
    EXPECT_EQ(c.lit, 0u);
    EXPECT_GT(c.dark, c.pairs / 10);
    const Lighting with = baked(l, &l.seen), without = baked(l, nullptr);
    for (std::size_t t = 0; t < with.flat.size(); ++t) ASSERT_NEAR(with.flat[t].x, without.flat[t].x, 0.05f * without.flat[t].x + 1e-3f) << t;
}

// A world that leaks, a lamp far above all brushes: the leaf that would hold it, were leaves without end, has no portals up there, and is seen from less.
TEST(LightSight, ALampOutsideTheWorldOfBrushesMayShineAnywhere) {
    test::WorldBuilder w;
    for (const auto& [lo, hi] : {std::pair<Vec3, Vec3>{{-16, -16, -16}, {272, 272, 0}}, {{-16, -16, 0}, {0, 272, 128}}, {{256, -16, 0}, {272, 272, 128}}, {{0, -16, 0}, {256, 0, 128}}, {{0, 256, 0}, {256, 272, 128}},
                                 {{-16, -16, 128}, {112, 272, 192}}, {{144, -16, 128}, {272, 272, 192}}, {{112, -16, 128}, {144, 112, 192}}, {{112, 144, 128}, {144, 272, 192}}, {{400, 0, -16}, {432, 256, 200}}, {{320, 100, -16}, {350, 150, 150}}})
        w.box(lo, hi);
    w.point_entity("info_player_start", {64, 64, 32});
    w.point_entity("light", {390, 128, 1000}, {{"light", "3000"}, {"wait", "0.1"}});
    const Lit l(run(w.world));
    ASSERT_EQ(l.g.stage, "surfaces");
    ASSERT_TRUE(l.g.leak);
    EXPECT_EQ(count(l, 5000).lit, 0u);
}

// A wall that seals and lets light through has no face of its own within detail that does so too.
TEST(LightSight, ASealingBrushWithoutFacesCounts) {
    test::WorldBuilder w;
    w.room({0, 0, 0}, {256, 128, 128});
    w.world.brushes[w.box({124, 0, 0}, {132, 128, 128}).at()].casts_light_shadow = false;
    w.world.brushes[w.box({120, 0, 0}, {136, 128, 128}, Contents::detail).at()].casts_light_shadow = false;
    w.point_entity("info_player_start", {32, 64, 32});
    w.point_entity("light", {64, 64, 96}, {{"light", "300"}});
    const Counted c = count(Lit(run(w.world)), 200);
    EXPECT_EQ(c.lit, 0u);
    EXPECT_EQ(c.dark, 0u);
}

// Two rooms, a lamp in each; between them a wall that casts a shadow or does not.
std::unique_ptr<Lit> rooms(bool casts) {
    test::WorldBuilder w;
    w.room({0, 0, 0}, {256, 128, 128});
    w.world.brushes[w.box({124, 0, 0}, {132, 128, 128}).at()].casts_light_shadow = casts;
    w.point_entity("info_player_start", {32, 64, 32});
    w.point_entity("light", {64, 64, 96}, {{"light", "300"}});
    w.point_entity("light", {200, 64, 96}, {{"light", "300"}});
    return std::make_unique<Lit>(run(w.world));
}

TEST(LightSight, WhereASealingBrushStopsNoLightNothingIsDark) {
    for (const bool casts : {true, false}) {
        const auto l = rooms(casts);
        ASSERT_EQ(l->lights.size(), 2u);
        const Counted c = count(*l, 100);
        EXPECT_EQ(c.lit, 0u);
        EXPECT_NEAR(static_cast<double>(c.dark), casts ? 0.5 * static_cast<double>(c.pairs) : 0, 0.05 * static_cast<double>(c.pairs));
        const Lighting with = baked(*l, &l->seen), without = baked(*l, nullptr);
        EXPECT_EQ(with.flat, without.flat);
        if (casts) { EXPECT_LT(with.rays, without.rays); }
    }
}

// In a map of several rooms all that differs is which lights, too faint to matter, are left out: `light_cutoff`, 0.5 % of what arrives.
TEST(LightSight, TheLightIsTheSame) {
    const auto l = of_map(std::string(KILN_SOURCE_DIR) + "/maps/glass/glass.vmf");
    ASSERT_TRUE(l);
    const Lighting with = baked(*l, &l->seen), without = baked(*l, nullptr);
    EXPECT_LT(with.rays, without.rays); // something is dark, or this says nothing
    ASSERT_EQ(with.flat.size(), without.flat.size());
    double off = 0, all = 0;
    for (std::size_t t = 0; t < with.flat.size(); ++t)
        for (std::size_t c = 0; c < 3; ++c) off += std::abs(with.flat[t][c] - without.flat[t][c]), all += without.flat[t][c];
    EXPECT_GT(all, 0);
    EXPECT_LE(off, 0.005 * all);
}
} // namespace

// The probes of worlds baked by the real stages.
#include "compiler/light/memo.h"
#include "compiler/probes/probes.h"
#include "libs/parallel/parallel.h"
#include "tests/compiler/ambient/baked_world.h"
#include <gtest/gtest.h>

namespace kiln {
namespace {

using test::bake;
using test::Baked;

Probes probes_of(Baked& b, const ProbesOptions& options = {}, int threads = 2, Memo* memo = nullptr) {
    b.context.threads = threads;
    auto probes = bake_probes(b.world, b.bsp, b.csg.planes, b.surfaces, *b.field, options, b.context, memo);
    EXPECT_TRUE(probes);
    validate(*probes);
    EXPECT_EQ(probes->face_probe.size(), b.surfaces.faces.size());
    EXPECT_EQ(probes->leaf_probe.size(), b.bsp.leaves.size());
    return std::move(*probes);
}

test::WorldBuilder furnace(bool reflective) {
    test::WorldBuilder w;
    const MaterialId m = w.material("furnace", 0, {0.5f, 0.5f, 0.5f}, {0.5f, 0.5f, 0.5f});
    if (reflective) w.world.materials[m.at()].env_map = 0.5f;
    w.room({0, 0, 0}, {320, 256, 128}, 16, m);
    w.point_entity("info_player_start", {40, 40, 40});
    return w;
}

TEST(ProbesBaked, NoneWhereNothingAsksForOne) {
    const auto baked = bake(furnace(false));
    const Probes probes = probes_of(*baked);
    EXPECT_TRUE(probes.probes.empty());
    for (const std::uint32_t p : probes.face_probe) EXPECT_EQ(p, UINT32_MAX);
}

// Radiance is 1 everywhere in a furnace, in every mip; the default probe stands in the middle, its box is the room.
TEST(ProbesBaked, DefaultProbeOfAFurnace) {
    const auto baked = bake(furnace(true));
    const Probes probes = probes_of(*baked);
    ASSERT_EQ(probes.probes.size(), 1u);
    const Probe& probe = probes.probes[0];
    EXPECT_FALSE(probe.entity.valid());
    EXPECT_EQ(probe.size, 64u);
    EXPECT_EQ(probe.mips, 5u);
    for (const Rgb& t : probe.texels) EXPECT_NEAR(t.x, 1, 0.005);
    EXPECT_LT(length(probe.position - Vec3{160, 128, 64}), 40);
    ASSERT_TRUE(probe.boxed);
    EXPECT_LT(length(probe.box.lo - Vec3{0, 0, 0}) + length(probe.box.hi - Vec3{320, 256, 128}), 1e-3);
    for (std::size_t f = 0; f < baked->surfaces.faces.size(); ++f)
        EXPECT_EQ(probes.face_probe[f], baked->surfaces.faces[f].drawn ? 0u : UINT32_MAX);
}

// Two sealed rooms: every face and leaf takes the probe of its own room, though the other one is nearer for many.
TEST(ProbesBaked, AssignmentStaysInTheRoom) {
    test::WorldBuilder w;
    w.room({0, 0, 0}, {528, 256, 128});
    w.box({256, 0, 0}, {264, 256, 128});
    w.point_entity("info_player_start", {40, 40, 40});
    w.point_entity("info_player_start", {400, 40, 40});
    w.point_entity("light", {100, 100, 90}, {{"_light", "255 255 255 300"}});
    w.point_entity("env_cubemap", {20, 128, 64}, {{"cubemapsize", "5"}});
    w.point_entity("env_cubemap", {270, 128, 64}, {{"cubemapsize", "nonsense"}});
    w.point_entity("env_cubemap", {260, 128, 64}); // in the wall
    const auto baked = bake(w);
    const Probes probes = probes_of(*baked);
    ASSERT_EQ(probes.probes.size(), 2u);
    EXPECT_EQ(probes.probes[0].size, 16u);
    EXPECT_EQ(probes.probes[1].size, 64u);
    std::size_t size_warnings = 0, solid_warnings = 0;
    for (const Diagnostic& d : baked->context.diagnostics()) {
        size_warnings += d.code == "cubemap-size" && d.where.entity >= 0;
        solid_warnings += d.code == "cubemap-in-solid" && d.where.entity >= 0;
    }
    EXPECT_EQ(size_warnings, 1u);
    EXPECT_EQ(solid_warnings, 1u);
    for (const Rgb& t : probes.probes[1].texels) EXPECT_EQ(mean(t), 0); // no light gets there
    EXPECT_GT(mean(probes.probes[0].texels[0]), 0);
    for (std::size_t f = 0; f < baked->surfaces.faces.size(); ++f) {
        const Face& face = baked->surfaces.faces[f];
        if (!face.drawn) continue;
        const double x = face.bounds.center().x;
        if (face.bounds.hi.x < 257) {
            EXPECT_EQ(probes.face_probe[f], 0u) << x;
        } else if (face.bounds.lo.x > 263) {
            EXPECT_EQ(probes.face_probe[f], 1u) << x;
        }
    }
    for (std::size_t l = 0; l < baked->bsp.leaves.size(); ++l) {
        const BspLeaf& leaf = baked->bsp.leaves[l];
        if (!leaf.cluster.valid()) {
            EXPECT_EQ(probes.leaf_probe[l], UINT32_MAX);
        } else {
            EXPECT_EQ(probes.leaf_probe[l], leaf.bounds.center().x < 260 ? 0u : 1u);
        }
    }
}

// Which probe each face and leaf takes is kept, of one geometry: light is no part of it, where probes stand is. Bytes are those without what was kept.
TEST(ProbesBaked, WhatWasKeptChangesNothing) {
    const auto world = [](const char* light, double probe) {
        test::WorldBuilder w;
        w.room({0, 0, 0}, {528, 256, 128});
        w.box({256, 0, 0}, {264, 128, 128});
        w.point_entity("info_player_start", {40, 40, 40});
        w.point_entity("light", {100, 100, 90}, {{"_light", light}});
        w.point_entity("env_cubemap", {probe, 128, 64}, {{"cubemapsize", "4"}});
        w.point_entity("env_cubemap", {400, 128, 64}, {{"cubemapsize", "4"}});
        return bake(w);
    };
    const auto first = world("255 255 255 300", 40);
    Memo kept;
    EXPECT_EQ(to_bytes(probes_of(*first, {}, 2, &kept)), to_bytes(probes_of(*first)));
    EXPECT_GT(kept.size(), 0u);
    kept = from_bytes<Memo>(to_bytes(kept));
    for (const auto& [light, probe] : {std::pair{"255 255 255 300", 40.0}, {"255 200 100 350", 40.0}, {"255 255 255 300", 230.0}}) {
        const auto edited = world(light, probe);
        Memo memo = kept;
        EXPECT_EQ(to_bytes(probes_of(*edited, {}, 2, &memo)), to_bytes(probes_of(*edited))) << light << " " << probe;
        EXPECT_EQ(memo.found() == memo.size(), probe == 40) << light << " " << probe;
    }
}

TEST(ProbesBaked, SidesOfTheEntityWinAndThreadsDoNotMatter) {
    test::WorldBuilder w;
    w.room({0, 0, 0}, {400, 256, 128});
    for (std::size_t s = 0; s < w.world.sides.size(); ++s) w.world.sides[s].id = static_cast<int>(1000 + s);
    w.point_entity("info_player_start", {40, 40, 40});
    w.point_entity("light", {100, 100, 90}, {{"_light", "255 255 255 300"}});
    w.point_entity("env_cubemap", {50, 128, 64}, {{"cubemapsize", "4"}});
    w.point_entity("env_cubemap", {350, 128, 64}, {{"cubemapsize", "4"}, {"sides", "1001 1003"}});
    auto baked = bake(w);
    const Probes probes = probes_of(*baked);
    std::size_t named = 0;
    for (std::size_t f = 0; f < baked->surfaces.faces.size(); ++f) {
        const int side = baked->world.sides[baked->surfaces.faces[f].side.at()].id;
        if (side != 1001 && side != 1003) continue;
        ++named;
        EXPECT_EQ(probes.face_probe[f], 1u);
    }
    EXPECT_GE(named, 1u);
    EXPECT_EQ(to_bytes(probes), to_bytes(probes_of(*baked, {}, 1)));
    EXPECT_EQ(to_bytes(probes), to_bytes(probes_of(*baked, {}, 7)));
}

} // namespace
} // namespace kiln

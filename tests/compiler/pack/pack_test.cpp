// Two rooms and a door through the real geometry stages, light by hand: what the loader says must be what the stages
// said. Everything goes through the file.
#include "compiler/pack/pack.h"
#include "compiler/pack/water_distance.h"
#include "formats/level/kiln_level.hpp"
#include "tests/support/world_builder.h"
#include <gtest/gtest.h>
#include <random>

namespace kiln {
namespace {

using test::WorldBuilder;

class PackedRooms : public testing::Test {
protected:
    WorldBuilder b;
    Csg csg;
    Bsp bsp;
    Visibility visibility;
    Surfaces surfaces;
    std::vector<Light> lights;
    Lighting lighting;
    Ambient ambient;
    Probes probes;
    Context context;
    std::mt19937 random{1};

    double real(double lo, double hi) { return lo + (hi - lo) * random() / 4294967296.0; }
    Vec3 somewhere() { return {real(-40, 552), real(-40, 296), real(-40, 168)}; }

    void SetUp() override {
        b.box({10, 10, 10}, {10, 20, 20}); // no thickness: left out, so that brush numbers move
        b.room({0, 0, 0}, {512, 256, 128});
        b.box({248, 0, 0}, {264, 96, 128}), b.box({248, 160, 0}, {264, 256, 128}), b.box({248, 96, 96}, {264, 160, 128});
        b.box({40, 40, 0}, {72, 72, 48}, Contents::detail);
        const MaterialId sky = b.material("sky", kSky);
        b.box({20, 20, 120}, {100, 100, 128}, Contents::solid, {0}, sky);
        const ModelId door = b.model("func_door");
        b.box({252, 96, 0}, {260, 160, 80}, Contents::solid, door);
        b.point_entity("info_player_start", {128, 128, 32});
        lights.resize(2);
        lights[1].entity = b.point_entity("light", {400, 128, 96}, {{"light", "200"}});
        lights[0].kind = LightKind::sky, lights[0].intensity = {1, 2, 3};
        lights[1].position = {400, 128, 96}, lights[1].intensity = {5, 6, 7};

        auto made_csg = build_csg(b.world, {}, context);
        ASSERT_TRUE(made_csg);
        csg = std::move(*made_csg);
        auto made_bsp = build_bsp(b.world, csg, {}, context);
        ASSERT_TRUE(made_bsp) << made_bsp.fault().diagnostic.message;
        bsp = std::move(*made_bsp);
        auto made_vis = compute_visibility(vis_portals(bsp), bsp.cluster_count, {}, context);
        ASSERT_TRUE(made_vis);
        visibility = std::move(*made_vis);
        auto made_surfaces = build_surfaces(b.world, csg, bsp, {}, context);
        ASSERT_TRUE(made_surfaces);
        surfaces = std::move(*made_surfaces);

        for (std::uint32_t i = 0; i < surfaces.texel_count; ++i) {
            lighting.flat.push_back({static_cast<float>(real(0, 2)), static_cast<float>(real(0, 2)), static_cast<float>(real(0, 2))});
            lighting.valid.push_back(1), lighting.texel_error.push_back(0.02f);
        }
        for (std::size_t c = 0; c < surfaces.charts.size(); ++c) {
            const bool directional = c % 2 == 0;
            lighting.chart_directional.push_back(directional);
            lighting.rnm_first.push_back(directional ? static_cast<std::uint32_t>(lighting.rnm.size()) : UINT32_MAX);
            const std::size_t texels = std::size_t{surfaces.charts[c].width} * surfaces.charts[c].height;
            for (std::size_t t = 0; directional && t < texels; ++t) {
                const Rgb e = lighting.flat[surfaces.charts[c].first_texel + t] * (1 / std::sqrt(3.0f));
                lighting.rnm.push_back({e, e, e});
            }
        }
        lighting.error.estimate = 4.25;

        // Two roots, the second divided; one cell has a wall through it.
        ambient.origin = {0, 0, 0}, ambient.root_size = 256, ambient.root_count = {2, 1, 1};
        ambient.tree = {-1, 2, -2, -3, -4, -5, INT32_MIN, -6, -7, -8};
        for (std::uint32_t i = 0; i < 16; ++i) {
            AmbientCube cube;
            cube.position = somewhere();
            for (Rgb& e : cube.irradiance) e = {static_cast<float>(real(0, 3)), static_cast<float>(real(0, 3)), 1};
            if (i % 3) cube.local_lights = {i % 2};
            ambient.cubes.push_back(cube);
        }
        const auto cell = [&](Vec3 lo, float size, std::uint8_t mask) {
            AmbientCell c;
            c.lo = lo, c.size = size, c.mask = mask;
            for (unsigned k = 0; k < 8; ++k) c.cubes[k] = mask >> k & 1 ? static_cast<std::uint32_t>(random() % 16) : UINT32_MAX;
            ambient.cells.push_back(c);
        };
        cell({0, 0, 0}, 256, 255);
        for (const unsigned k : {0u, 1u, 2u, 3u, 5u, 6u, 7u})
            cell({256.0 + (k & 1) * 128, (k >> 1 & 1) * 128.0, (k >> 2) * 128.0}, 128, static_cast<std::uint8_t>(random() % 255 + 1));
        cell({0, 0, 0}, 256, 0b1010);
        ambient.cells[0].plane_normal = normalize(Vec3{1, 1, 0}), ambient.cells[0].plane_distance = 150, ambient.cells[0].beyond = 8;
        validate(ambient);

        Probe probe;
        probe.position = {128, 128, 64}, probe.size = 4, probe.mips = 1, probe.boxed = true;
        probe.box.add(Vec3{0, 0, 0}), probe.box.add(Vec3{256, 256, 128});
        for (int face = 0; face < 6; ++face)
            for (int y = 0; y < 4; ++y)
                for (int x = 0; x < 4; ++x) {
                    const Vec3 d = normalize(cube_direction(face, (2 * x + 1) / 4.0 - 1, (2 * y + 1) / 4.0 - 1));
                    probe.texels.push_back({static_cast<float>(2 + d.x), static_cast<float>(2 + d.y), static_cast<float>(2 + d.z)});
                }
        probes.probes.push_back(probe);
        probes.face_probe.assign(surfaces.faces.size(), 0), probes.leaf_probe.assign(bsp.leaves.size(), 0);
    }
    PackInput input() const {
        return {b.world, csg, bsp, visibility, surfaces, lights, lighting, ambient, probes, "{\"x\":1}", "abc", "0.1"};
    }
};

} // namespace

// Three rooms in a row, a pool in the first; the third sees nothing of it.
TEST(PackedWater, DistancesAreToTheNearestSurfaceInSight) {
    WorldBuilder b;
    b.room({0, 0, 0}, {768, 256, 128});
    b.box({248, 0, 0}, {264, 224, 128}), b.box({504, 32, 0}, {520, 256, 128}); // narrow doorways at opposite sides
    b.box({0, 0, 0}, {64, 256, 32}, Contents::water);
    b.point_entity("info_player_start", {128, 128, 64});
    Context context;
    const Csg csg = *build_csg(b.world, {}, context);
    const Bsp bsp = *build_bsp(b.world, csg, {}, context);
    const Visibility seen = *compute_visibility(vis_portals(bsp), bsp.cluster_count, {}, context);
    Visibility blind = seen;
    std::ranges::fill(blind.rows, 0);
    for (std::uint32_t c = 0; c < bsp.cluster_count; ++c) blind.rows[c * blind.words_per_row() + c / 64] |= std::uint64_t{1} << c % 64;
    const std::vector<float> away = leaf_water_distances(bsp, seen), alone = leaf_water_distances(bsp, blind);
    ASSERT_EQ(away.size(), bsp.leaves.size());
    std::size_t in_sight = 0, without = 0;
    for (std::size_t l = 0; l < bsp.leaves.size(); ++l) {
        const BspLeaf& leaf = bsp.leaves[l];
        if (!leaf.cluster.valid()) {
            EXPECT_EQ(away[l], INFINITY);
            continue;
        }
        // The pool's boundary to the air: its top, and its side at x = 64 up to z = 32. All of it may be seen or none.
        const Box3& box = leaf.bounds;
        const double to_top = std::hypot(std::max(0.0, box.lo.x - 64), std::max(0.0, box.lo.z - 32));
        const bool wet = leaf.contents == Contents::water;
        if (std::isfinite(away[l])) {
            ++in_sight;
            EXPECT_NEAR(away[l], wet ? 0 : to_top, 1e-4) << l;
        } else {
            ++without;
            EXPECT_GE(box.lo.x, 264);
        }
        EXPECT_EQ(std::isfinite(alone[l]), wet) << l;
    }
    EXPECT_GT(in_sight, 2u);
    EXPECT_GT(without, 0u);
}

TEST_F(PackedRooms, NamesTheFilesOfInstances) {
    b.world.file = "/somewhere/maps/test.map";
    b.world.included = {"/somewhere/maps/parts/../parts/stairs.vmf", "/somewhere/prefabs/lamp.map"};
    b.world.brushes[3].file = 1, b.world.entities.back().file = 2;
    const Bytes bytes = pack(input(), {}, context);
    const level::Level level(bytes);
    std::size_t brushes = 0, faces = 0, entities = 0;
    const char* file = nullptr;
    for (std::uint32_t i = 0; i < level.brushes().size(); ++i) {
        ASSERT_EQ(kiln_level_brush_file(level.get(), i, &file), KILN_OK);
        kiln_source source{};
        kiln_level_brush_source(level.get(), i, &source);
        const bool from_there = source.line == b.world.brushes[3].line;
        EXPECT_STREQ(file, from_there ? "parts/stairs.vmf" : "");
        brushes += from_there;
    }
    EXPECT_EQ(brushes, 1u);
    for (std::uint32_t i = 0; i < level.faces().size(); ++i) {
        ASSERT_EQ(kiln_level_face_file(level.get(), i, &file), KILN_OK);
        faces += std::string(file) == "parts/stairs.vmf";
        EXPECT_EQ(*file != 0, b.world.brush_of(surfaces.faces[i].side) == id<BrushId>(3));
    }
    EXPECT_GT(faces, 0u);
    for (std::uint32_t i = 0; i < b.world.entities.size(); ++i) {
        ASSERT_EQ(kiln_level_entity_file(level.get(), i, &file), KILN_OK);
        entities += std::string(file) == "../prefabs/lamp.map";
    }
    EXPECT_EQ(entities, 1u);
    b.world.file = "elsewhere/test.map", b.world.included = {"elsewhere/parts/stairs.vmf", "prefabs/lamp.map"};
    EXPECT_EQ(pack(input(), {}, context), bytes); // not where on this machine
}

TEST_F(PackedRooms, SurvivesTheFile) {
    const Bytes bytes = pack(input(), {}, context);
    const level::Level level(bytes);
    const char* what = nullptr;
    ASSERT_EQ(kiln_level_check(level.get(), &what), KILN_OK) << what;
    EXPECT_EQ(bytes, pack(input(), {}, context));
    EXPECT_NE(level.meta_json().find("\"estimate\":4.25"), std::string_view::npos);
    EXPECT_NE(level.meta_json().find("\"source\":\"test.map\""), std::string_view::npos);

    // Tree and visibility.
    for (int i = 0; i < 3000; ++i) {
        const Vec3 p = somewhere();
        ASSERT_EQ(level.find_leaf({p.x, p.y, p.z}), leaf_at(bsp, csg.planes, p).value);
    }
    ASSERT_GE(bsp.cluster_count, 2u);
    for (std::uint32_t from = 0; from < bsp.cluster_count; ++from)
        for (std::uint32_t to = 0; to < bsp.cluster_count; ++to)
            EXPECT_EQ(kiln_level_cluster_visible(level.get(), static_cast<std::int32_t>(from), static_cast<std::int32_t>(to)), visibility.sees(from, to));
    EXPECT_EQ(level.portals().size(), bsp.portals.size());

    // Exact planes: a n . x = d in the table's own integers, for both faces.
    ASSERT_EQ(level.planes().size(), csg.planes.planes.size());
    for (std::size_t i = 0; i < csg.planes.planes.size(); ++i) {
        const kiln_plane& p = level.planes()[i];
        const ExactPlane& e = csg.planes.planes[i];
        EXPECT_EQ(p.exact_normal[0], e.a);
        EXPECT_EQ(p.exact_normal[2], e.c);
        EXPECT_TRUE((static_cast<__int128>(p.exact_d_high) << 64) + p.exact_d_low == e.d);
        EXPECT_NEAR(p.distance, csg.planes.distance(id<PlaneId>(i)), 1e-9);
    }

    // Faces keep their numbers; each is listed in the leaves it borders and in no solid one.
    ASSERT_EQ(level.faces().size(), surfaces.faces.size());
    std::vector<int> listed(surfaces.faces.size());
    for (const kiln_leaf& leaf : level.leaves()) {
        if (leaf.cluster < 0) {
            EXPECT_EQ(leaf.face_count, 0u);
        }
        for (std::uint32_t k = 0; k < leaf.face_count; ++k) ++listed[level.leaf_faces()[leaf.first_face + k]];
    }
    bool sky = false, model = false;
    for (std::uint32_t i = 0; i < surfaces.faces.size(); ++i) {
        const Face& f = surfaces.faces[i];
        const kiln_face& k = level.faces()[i];
        if (f.drawn || f.sky) {
            EXPECT_GE(listed[i], static_cast<int>(f.clusters.size()));
        }
        EXPECT_EQ(k.triangle_count, f.drawn || f.sky ? f.triangle_count : 0);
        EXPECT_EQ(k.chart, f.chart.value);
        EXPECT_EQ((k.flags & KILN_FACE_SKY) != 0, f.sky);
        sky |= f.sky, model |= k.model == 1;
        kiln_source s{};
        ASSERT_EQ(kiln_level_face_source(level.get(), i, &s), KILN_OK);
        EXPECT_EQ(s.line, b.world.location(f.side).line);
        EXPECT_EQ(s.brush, b.world.location(f.side).brush);
    }
    EXPECT_TRUE(sky);
    EXPECT_TRUE(model);

    // The brush without thickness is not there; leaves name the others by their new numbers.
    EXPECT_EQ(level.brushes().size(), b.world.brushes.size() - 1);
    for (std::size_t i = 0; i < bsp.leaves.size(); ++i) {
        ASSERT_EQ(level.leaves()[i].brush_count, bsp.leaves[i].brushes.size());
        for (std::size_t k = 0; k < bsp.leaves[i].brushes.size(); ++k)
            EXPECT_EQ(level.leaf_brushes()[level.leaves()[i].first_brush + k], bsp.leaves[i].brushes[k].value - 1);
    }
    kiln_source source{};
    ASSERT_EQ(kiln_level_brush_source(level.get(), 0, &source), KILN_OK);
    EXPECT_EQ(source.brush, 1);
    EXPECT_STREQ(kiln_level_entity_value(level.get(), 3, "light"), "200");
    EXPECT_EQ(kiln_level_entity_model(level.get(), 1), 1);
    ASSERT_EQ(kiln_level_light_source(level.get(), 1, &source), KILN_OK);
    EXPECT_EQ(source.entity, 3);
}

// At every luxel centre the stored lightmap says what the bake said, for both kinds of chart.
TEST_F(PackedRooms, LightAtLuxelsIsTheBakes) {
    const Bytes bytes = pack(input(), {}, context);
    const level::Level level(bytes);
    for (const Luxel& l : surfaces.luxels) {
        const Chart& c = surfaces.charts[l.chart.at()];
        const Vec3 p = c.origin + (c.s * (l.x + 0.5) + c.t * (l.y + 0.5)) * c.luxel_size;
        const Face& f = surfaces.faces[l.face.at()];
        const auto e = level.irradiance(l.face.value, {p.x, p.y, p.z}, {static_cast<float>(f.normal.x), static_cast<float>(f.normal.y), static_cast<float>(f.normal.z)});
        ASSERT_TRUE(e);
        const Rgb wanted = lighting.flat[c.texel(l.x, l.y)];
        for (std::size_t k = 0; k < 3; ++k) ASSERT_NEAR((*e)[k], wanted[k], max_component(wanted) * 2.5e-3);
    }
}

TEST_F(PackedRooms, AmbientIsWhatTheCompilerShows) {
    const Bytes bytes = pack(input(), {}, context);
    const level::Level level(bytes);
    int lit = 0;
    for (int i = 0; i < 3000; ++i) {
        const Vec3 p = somewhere();
        const double at[3] = {p.x, p.y, p.z};
        float cube[6][3];
        const auto wanted = ambient_at(ambient, p);
        const kiln_status status = kiln_level_ambient(level.get(), at, cube);
        ASSERT_EQ(status, wanted ? KILN_OK : KILN_NONE);
        if (!wanted) continue;
        ++lit;
        for (std::size_t f = 0; f < 6; ++f)
            for (std::size_t k = 0; k < 3; ++k) ASSERT_NEAR(cube[f][k], (*wanted)[f][k], 2e-3);
        kiln_light_weight weights[8];
        std::size_t n = 0;
        ASSERT_EQ(kiln_level_ambient_lights(level.get(), at, weights, 8, &n), KILN_OK);
        const auto shares = ambient_lights_at(ambient, p);
        ASSERT_EQ(n, shares.size());
        for (std::size_t k = 0; k < n; ++k) {
            EXPECT_EQ(weights[k].light, shares[k].first);
            EXPECT_NEAR(weights[k].weight, shares[k].second, 1e-6);
        }
    }
    EXPECT_GT(lit, 1000);
}

TEST_F(PackedRooms, CubemapsFaceTheWayTheyWereRendered) {
    const Bytes bytes = pack(input(), {}, context);
    const level::Level level(bytes);
    for (int face = 0; face < 6; ++face)
        for (int y = 0; y < 4; ++y)
            for (int x = 0; x < 4; ++x) {
                const Vec3 d = normalize(cube_direction(face, (2 * x + 1) / 4.0 - 1, (2 * y + 1) / 4.0 - 1));
                const float direction[3] = {static_cast<float>(d.x), static_cast<float>(d.y), static_cast<float>(d.z)};
                float rgb[3];
                ASSERT_EQ(kiln_level_sample_cubemap(level.get(), 0, direction, 0, rgb), KILN_OK);
                for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(rgb[k], 2 + d[k], 0.01);
            }
}

} // namespace kiln

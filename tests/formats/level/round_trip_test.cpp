#include "formats/level/kiln_level.hpp"
#include "formats/level/numbers.h"
#include "tests/formats/level/sample_level.h"
#include <cstring>
#include <functional>
#include <gtest/gtest.h>
#include <map>
#include <utility>

namespace kiln::level {
namespace {

using test::mixture;

template <class A, class B> void expect_same(const A* got, const B& wanted) {
    for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_EQ(got[i], wanted[i]);
}

class RoundTrip : public testing::TestWithParam<int> {
protected:
    LevelContent content = mixture(static_cast<std::uint64_t>(GetParam()) + 10, 20, static_cast<std::uint8_t>(GetParam()));
    std::vector<std::uint8_t> bytes = write_level(content);
    Level level{bytes};
};

TEST_P(RoundTrip, EveryLumpChecks) {
    const char* what = nullptr;
    EXPECT_EQ(kiln_level_check(level.get(), &what), KILN_OK) << what;
    const kiln_info info = level.info();
    EXPECT_EQ(info.rnm_encoding, content.rnm_encoding);
    EXPECT_EQ(info.plane_grid_bits, content.plane_grid_bits);
    EXPECT_EQ(info.texels, content.flat.size());
    EXPECT_EQ(info.models, 3u);
}

TEST_P(RoundTrip, TreeAndBrushes) {
    const auto planes = level.planes();
    ASSERT_EQ(planes.size(), content.planes.size());
    for (std::size_t i = 0; i < planes.size(); ++i) {
        expect_same(planes[i].normal, content.planes[i].normal), expect_same(planes[i].exact_normal, content.planes[i].exact);
        EXPECT_EQ(planes[i].distance, content.planes[i].distance);
        EXPECT_EQ(planes[i].exact_d_high, content.planes[i].exact_d_high);
        EXPECT_EQ(planes[i].exact_d_low, content.planes[i].exact_d_low);
    }
    const auto nodes = level.nodes();
    ASSERT_EQ(nodes.size(), content.nodes.size());
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        EXPECT_EQ(nodes[i].plane, content.nodes[i].plane);
        expect_same(nodes[i].child, content.nodes[i].child);
        expect_same(nodes[i].lo, content.nodes[i].lo), expect_same(nodes[i].hi, content.nodes[i].hi);
    }
    const auto leaves = level.leaves();
    ASSERT_EQ(leaves.size(), content.leaves.size());
    for (std::size_t i = 0; i < leaves.size(); ++i) {
        const Leaf& l = content.leaves[i];
        EXPECT_EQ(leaves[i].contents, l.contents);
        EXPECT_EQ(leaves[i].cluster, l.cluster);
        EXPECT_EQ(leaves[i].area, l.area);
        EXPECT_EQ(leaves[i].probe, l.probe);
        expect_same(leaves[i].lo, l.lo), expect_same(leaves[i].hi, l.hi);
        ASSERT_EQ(leaves[i].brush_count, l.brushes.size());
        ASSERT_EQ(leaves[i].face_count, l.faces.size());
        expect_same(level.leaf_brushes().data() + leaves[i].first_brush, l.brushes);
        expect_same(level.leaf_faces().data() + leaves[i].first_face, l.faces);
    }
    const auto portals = level.portals();
    ASSERT_EQ(portals.size(), content.portals.size());
    for (std::size_t i = 0; i < portals.size(); ++i) {
        expect_same(portals[i].leaf, content.portals[i].leaf);
        EXPECT_EQ(portals[i].plane, content.portals[i].plane);
        ASSERT_EQ(portals[i].point_count, content.portals[i].winding.size());
        for (std::size_t k = 0; k < portals[i].point_count; ++k)
            expect_same(level.portal_points().data() + 3 * (portals[i].first_point + k), content.portals[i].winding[k]);
    }
    const auto brushes = level.brushes();
    ASSERT_EQ(brushes.size(), content.brushes.size());
    for (std::uint32_t i = 0; i < brushes.size(); ++i) {
        const Brush& b = content.brushes[i];
        EXPECT_EQ(brushes[i].model, b.model);
        EXPECT_EQ(brushes[i].contents, b.contents);
        ASSERT_EQ(brushes[i].plane_count, b.planes.size());
        expect_same(level.brush_planes().data() + brushes[i].first_plane, b.planes);
        std::size_t bevels = 0;
        const kiln_bevel* bevel = kiln_level_brush_bevels(level.get(), i, &bevels);
        ASSERT_EQ(bevels, b.bevels.size());
        for (std::size_t k = 0; k < bevels; ++k) {
            expect_same(bevel[k].normal, b.bevels[k].normal);
            EXPECT_EQ(bevel[k].distance, b.bevels[k].distance);
        }
        kiln_source s{};
        ASSERT_EQ(kiln_level_brush_source(level.get(), i, &s), KILN_OK);
        EXPECT_EQ(s.entity, b.source_entity);
        EXPECT_EQ(s.brush, b.source_id);
        EXPECT_EQ(s.line, b.source_line);
        for (std::uint32_t k = 0; k < b.planes.size(); ++k) {
            std::int32_t side = 0;
            ASSERT_EQ(kiln_level_brush_side_source(level.get(), brushes[i].first_plane + k, &side), KILN_OK);
            EXPECT_EQ(side, b.source_sides[k]);
        }
    }
}

TEST_P(RoundTrip, VisibilityRows) {
    const std::size_t words = (content.cluster_count + 63) / 64;
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(content.cluster_count); ++c) {
        std::size_t n = 0;
        const std::uint64_t* row = kiln_level_pvs_row(level.get(), c, &n);
        ASSERT_EQ(n, words);
        std::vector<std::uint64_t> alone(words);
        ASSERT_EQ(kiln_level_read_pvs_row(level.get(), c, alone.data(), words), KILN_OK);
        for (std::size_t w = 0; w < words; ++w) {
            EXPECT_EQ(row[w], content.vis_rows[static_cast<std::size_t>(c) * words + w]);
            EXPECT_EQ(alone[w], row[w]);
        }
        for (std::int32_t to = 0; to < static_cast<std::int32_t>(content.cluster_count); ++to)
            EXPECT_EQ(kiln_level_cluster_visible(level.get(), c, to), static_cast<int>(row[to / 64] >> (to % 64) & 1));
    }
    std::vector<std::uint64_t> heard(words);
    for (std::uint32_t a = 0; a < content.cluster_count; ++a) {
        std::vector<std::uint64_t> wanted(words, 0); // the rows of all that a sees
        for (std::uint32_t b = 0; b < content.cluster_count; ++b)
            for (std::size_t w = 0; w < words; ++w)
                if (content.vis_rows[a * words + b / 64] >> (b % 64) & 1) wanted[w] |= content.vis_rows[b * words + w];
        ASSERT_EQ(kiln_level_read_pas_row(level.get(), static_cast<std::int32_t>(a), heard.data(), words), KILN_OK);
        EXPECT_EQ(heard, wanted) << a;
    }
    EXPECT_EQ(kiln_level_read_pas_row(level.get(), -1, heard.data(), words), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_level_read_pas_row(level.get(), 0, heard.data(), words - 1), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_level_read_pas_row(level.get(), 0, nullptr, words), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_level_pvs_row(level.get(), -1, nullptr), nullptr);
    EXPECT_EQ(kiln_level_pvs_row(level.get(), static_cast<std::int32_t>(content.cluster_count), nullptr), nullptr);
}

TEST_P(RoundTrip, MeshOnItsGrid) {
    const auto grid = level.grid_positions();
    const auto floats = level.positions();
    const auto triangles = level.triangles();
    const auto normals = level.corner_normals();
    const kiln_info info = level.info();
    ASSERT_EQ(info.degenerate_triangles, 0u);
    ASSERT_EQ(info.position_grid_bits, 8u);
    ASSERT_EQ(triangles.size(), 3 * content.triangles.size());
    ASSERT_EQ(normals.size(), 9 * content.triangles.size());
    EXPECT_EQ(info.vertices, content.positions.size()); // shared vertices stay shared
    std::vector<std::uint32_t> vertex_of(content.positions.size(), UINT32_MAX);
    for (std::size_t t = 0; t < content.triangles.size(); ++t)
        for (std::size_t c = 0; c < 3; ++c) {
            const std::uint32_t from = content.triangles[t][c], to = triangles[3 * t + c];
            if (vertex_of[from] == UINT32_MAX) vertex_of[from] = to;
            ASSERT_EQ(vertex_of[from], to);
            for (std::size_t k = 0; k < 3; ++k) {
                ASSERT_EQ(grid[3 * to + k], std::llround(content.positions[from][k] * 256));
                ASSERT_EQ(floats[3 * to + k], static_cast<float>(grid[3 * to + k]) / 256);
                ASSERT_NEAR(normals[9 * t + 3 * c + k], content.corner_normals[t][c][k], 1e-4);
            }
        }
}

TEST_P(RoundTrip, FacesMaterialsCharts) {
    const auto faces = level.faces();
    ASSERT_EQ(faces.size(), content.faces.size());
    for (std::uint32_t i = 0; i < faces.size(); ++i) {
        const FaceInfo& f = content.faces[i];
        const kiln_face& g = faces[i];
        EXPECT_EQ(g.material, f.material);
        EXPECT_EQ(g.model, f.model);
        EXPECT_EQ(g.plane, f.plane);
        EXPECT_EQ(g.chart, f.chart);
        EXPECT_EQ(g.probe, f.probe);
        EXPECT_EQ(g.first_triangle, f.first_triangle);
        EXPECT_EQ(g.triangle_count, f.triangle_count);
        EXPECT_EQ(g.flags, (f.drawn ? 1u : 0u) + (f.sky ? 2u : 0u) + (f.two_sided ? 4u : 0u) + (f.blocks_light ? 8u : 0u) + (f.curved ? 16u : 0u));
        expect_same(g.tangent, f.tangent), expect_same(g.bitangent, f.bitangent), expect_same(g.normal, f.normal);
        expect_same(g.u_axis, f.u_axis), expect_same(g.v_axis, f.v_axis);
        EXPECT_EQ(g.u_scale, f.u_scale);
        EXPECT_EQ(g.v_scale, f.v_scale);
        EXPECT_EQ(g.u_shift, f.u_shift);
        EXPECT_EQ(g.v_shift, f.v_shift);
        kiln_source s{};
        ASSERT_EQ(kiln_level_face_source(level.get(), i, &s), KILN_OK);
        EXPECT_EQ(s.entity, f.source_entity);
        EXPECT_EQ(s.brush, f.source_brush);
        EXPECT_EQ(s.side, f.source_side);
        EXPECT_EQ(s.line, f.source_line);
    }
    const auto materials = level.materials();
    ASSERT_EQ(materials.size(), content.materials.size());
    for (std::size_t i = 0; i < materials.size(); ++i) {
        const MaterialInfo& m = content.materials[i];
        EXPECT_EQ(materials[i].name, m.name);
        EXPECT_EQ(materials[i].albedo_map, m.albedo_map);
        EXPECT_EQ(materials[i].normal_map, m.normal_map);
        expect_same(materials[i].reflectance, m.reflectance), expect_same(materials[i].emission, m.emission);
        EXPECT_EQ(materials[i].alpha, m.alpha);
        EXPECT_EQ(materials[i].env_map, m.env_map);
        EXPECT_EQ(materials[i].roughness, m.roughness);
        EXPECT_EQ(materials[i].flags, m.flags);
        EXPECT_EQ(materials[i].width, m.width);
        EXPECT_EQ(materials[i].height, m.height);
    }
    const auto charts = level.charts();
    ASSERT_EQ(charts.size(), content.charts.size());
    for (std::size_t i = 0; i < charts.size(); ++i) {
        const ChartInfo& c = content.charts[i];
        const kiln_chart& k = charts[i];
        expect_same(k.origin, c.origin), expect_same(k.s, c.s), expect_same(k.t, c.t);
        expect_same(k.tangent, c.tangent), expect_same(k.bitangent, c.bitangent), expect_same(k.normal, c.normal);
        EXPECT_EQ(k.luxel_size, c.luxel_size);
        EXPECT_EQ(k.width, c.width);
        EXPECT_EQ(k.height, c.height);
        EXPECT_EQ(k.directional, c.directional);
        EXPECT_EQ(k.smooth, c.smooth);
        EXPECT_EQ(k.error, c.error);
    }
}

// Half: 2^-11 of the value. RGB9E5: 2^-9 of the largest channel.
TEST_P(RoundTrip, TexelsWithinTheirFormat) {
    const auto charts = level.charts();
    for (std::size_t i = 0; i < charts.size(); ++i) {
        const kiln_chart& k = charts[i];
        kiln_page page{};
        ASSERT_EQ(kiln_level_page(level.get(), k.page, &page), KILN_OK);
        ASSERT_EQ(page.layers, k.directional ? (content.rnm_encoding == 2 ? 4u : 3u) : 1u);
        std::vector<std::uint8_t> valid(std::size_t{page.width} * page.height);
        std::vector<float> error(valid.size());
        ASSERT_EQ(kiln_level_page_quality(level.get(), k.page, valid.data(), error.data()), KILN_OK);
        for (std::uint32_t y = 0; y < k.height; ++y)
            for (std::uint32_t x = 0; x < k.width; ++x) {
                const std::size_t texel = std::size_t{y} * k.width + x, all = content.chart_first_texel[i] + texel;
                for (std::uint32_t layer = 0; layer < page.layers; ++layer) {
                    const Float3 wanted = !k.directional || layer == 3 ? content.flat[all]
                                                                       : content.rnm[content.chart_first_rnm[i] + texel][layer];
                    float got[3];
                    ASSERT_EQ(kiln_level_page_texel(level.get(), k.page, layer, k.page_x + x, k.page_y + y, got), KILN_OK);
                    const float largest = std::max(std::abs(wanted[0]), std::max(std::abs(wanted[1]), std::abs(wanted[2])));
                    for (std::size_t c = 0; c < 3; ++c) {
                        const float within = page.format == KILN_TEXEL_RGB9E5 ? largest / 511 : std::abs(wanted[c]) / 2047 + 3e-8f;
                        ASSERT_NEAR(got[c], wanted[c], within);
                    }
                }
                const std::size_t at = std::size_t{k.page_y + y} * page.width + k.page_x + x;
                ASSERT_EQ(valid[at], content.valid[all]);
                ASSERT_NEAR(error[at], content.texel_error[all], content.texel_error[all] * 0.031 + 7e-6);
            }
    }
}

TEST_P(RoundTrip, LightsCubesProbesEntities) {
    const auto lights = level.lights();
    ASSERT_EQ(lights.size(), content.lights.size());
    for (std::uint32_t i = 0; i < lights.size(); ++i) {
        const LocalLight& l = content.lights[i];
        const kiln_light& k = lights[i];
        EXPECT_EQ(k.kind, l.kind);
        EXPECT_EQ(k.falloff, l.falloff);
        expect_same(k.position, l.position), expect_same(k.direction, l.direction), expect_same(k.intensity, l.intensity);
        for (const auto& [a, b] : {std::pair{k.constant_attn, l.constant}, {k.linear_attn, l.linear}, {k.quadratic_attn, l.quadratic},
                                   {k.range, l.range}, {k.fade_start, l.fade_start}, {k.fade_end, l.fade_end},
                                   {k.cos_inner, l.cos_inner}, {k.cos_outer, l.cos_outer}, {k.exponent, l.exponent},
                                   {k.angular_radius_rad, l.angular_radius_rad}, {k.angle_scale, l.angle_scale}})
            EXPECT_EQ(a, b);
        EXPECT_EQ(k.style, l.style);
        kiln_source s{};
        ASSERT_EQ(kiln_level_light_source(level.get(), i, &s), KILN_OK);
        EXPECT_EQ(s.entity, l.entity);
        EXPECT_EQ(s.line, l.line);
    }
    const auto cubes = level.cubes();
    ASSERT_EQ(cubes.size(), content.cubes.cubes.size());
    for (std::size_t i = 0; i < cubes.size(); ++i) {
        const Cube& c = content.cubes.cubes[i];
        expect_same(cubes[i].position, c.position);
        for (std::size_t f = 0; f < 6; ++f)
            for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(cubes[i].irradiance[f][k], c.irradiance[f][k], std::abs(c.irradiance[f][k]) / 2047);
        ASSERT_EQ(cubes[i].light_count, c.local_lights.size());
        expect_same(level.cube_lights().data() + cubes[i].first_light, c.local_lights);
    }
    const auto cells = level.cube_cells();
    ASSERT_EQ(cells.size(), 1u);
    EXPECT_EQ(cells[0].mask, 255u);
    expect_same(cells[0].cubes, content.cubes.cells[0].cubes);
    const auto probes = level.probes();
    ASSERT_EQ(probes.size(), content.probes.size());
    for (std::uint32_t i = 0; i < probes.size(); ++i) {
        const ProbeInfo& p = content.probes[i];
        expect_same(probes[i].position, p.position), expect_same(probes[i].box_lo, p.box_lo), expect_same(probes[i].box_hi, p.box_hi);
        EXPECT_EQ(probes[i].entity, p.entity);
        EXPECT_EQ(probes[i].boxed, 1u);
        std::size_t n = 0;
        float scale = 0;
        const std::uint32_t* texels = kiln_level_probe_texels(level.get(), i, &n, &scale);
        ASSERT_EQ(n, p.texels.size());
        ASSERT_EQ(scale, 1.0f);
        for (std::size_t t = 0; t < n; ++t) EXPECT_EQ(texels[t], rgb9e5_from_float(p.texels[t]));
    }
    ASSERT_EQ(level.info().entities, content.entities.size());
    for (std::uint32_t i = 0; i < content.entities.size(); ++i) {
        const EntityInfo& e = content.entities[i];
        EXPECT_EQ(kiln_level_entity_model(level.get(), i), e.model);
        ASSERT_EQ(kiln_level_entity_key_count(level.get(), i), e.keys.size());
        for (std::size_t k = 0; k < e.keys.size(); ++k) {
            const char *key = nullptr, *value = nullptr;
            ASSERT_EQ(kiln_level_entity_key(level.get(), i, k, &key, &value), KILN_OK);
            EXPECT_EQ(key, e.keys[k].first);
            EXPECT_EQ(value, e.keys[k].second);
        }
        kiln_source s{};
        ASSERT_EQ(kiln_level_entity_source(level.get(), i, &s), KILN_OK);
        EXPECT_EQ(s.entity, e.source_id);
        EXPECT_EQ(s.line, e.source_line);
    }
}

std::string encoding_name(const testing::TestParamInfo<int>& info) {
    constexpr const char* names[] = {"Dot", "Sq", "Tilted"};
    return names[info.param];
}
TEST_P(RoundTrip, Curves) {
    std::size_t n = 0;
    const kiln_displacement* d = kiln_level_displacements(level.get(), &n);
    ASSERT_EQ(n, content.displacements.size());
    for (std::size_t i = 0; i < n; ++i) {
        const Displacement& w = content.displacements[i];
        EXPECT_EQ(d[i].face, w.face);
        EXPECT_EQ(d[i].model, w.model);
        EXPECT_EQ(d[i].material, w.material);
        EXPECT_EQ(d[i].plane, w.plane);
        EXPECT_EQ(d[i].power, w.power);
        EXPECT_EQ(d[i].flags, w.flags);
        for (std::size_t k = 0; k < 12; ++k) EXPECT_EQ(d[i].base[k], w.base[k / 3][k % 3]);
        ASSERT_EQ(d[i].vertex_count, w.positions.size());
        ASSERT_EQ(d[i].blend_count, w.multiblend.size());
        ASSERT_EQ(d[i].tag_count, w.triangle_tags.size());
        for (std::size_t v = 0; v < w.positions.size(); ++v) {
            const float* at = kiln_level_displacement_vertices(level.get(), nullptr) + 4 * (d[i].first_vertex + v);
            expect_same(at, w.positions[v]);
            EXPECT_EQ(at[3], w.alphas[v]);
            if (!w.multiblend.empty()) expect_same(kiln_level_displacement_blends(level.get(), nullptr) + 4 * (d[i].first_blend + v), w.multiblend[v]);
        }
        for (std::size_t t = 0; t < w.triangle_tags.size(); ++t)
            EXPECT_EQ(kiln_level_displacement_tags(level.get(), nullptr)[d[i].first_tag + t], w.triangle_tags[t]);
        kiln_source source{};
        ASSERT_EQ(kiln_level_displacement_source(level.get(), static_cast<std::uint32_t>(i), &source), KILN_OK);
        EXPECT_EQ(source.line, w.source_line);
    }
    const kiln_curved_patch* p = kiln_level_curved_patches(level.get(), &n);
    ASSERT_EQ(n, content.patches.size());
    for (std::size_t i = 0; i < n; ++i) {
        const CurvedPatch& w = content.patches[i];
        EXPECT_EQ(p[i].face, w.face);
        EXPECT_EQ(p[i].columns, w.columns);
        EXPECT_EQ(p[i].rows, w.rows);
        ASSERT_EQ(p[i].vertex_count, w.positions.size());
        for (std::size_t v = 0; v < w.positions.size(); ++v) {
            const float* at = kiln_level_patch_vertices(level.get(), nullptr) + 5 * (p[i].first_vertex + v);
            expect_same(at, w.positions[v]), expect_same(at + 3, w.uv[v]);
        }
        kiln_source source{};
        ASSERT_EQ(kiln_level_patch_source(level.get(), static_cast<std::uint32_t>(i), &source), KILN_OK);
        EXPECT_EQ(source.brush, w.source_patch);
    }
    // Corners go with their triangles; in the middle of one everything is the mean of its corners.
    std::size_t next = 0;
    for (std::uint32_t f = 0; f < content.faces.size(); ++f) {
        const kiln_curve_corner* corners = kiln_level_curve_corners(level.get(), f, &n);
        const kiln_face& face = level.faces()[f];
        if (!content.faces[f].curved) {
            EXPECT_EQ(corners, nullptr);
            EXPECT_EQ(face.flags & KILN_FACE_CURVED, 0u);
            continue;
        }
        ASSERT_EQ(n, face.triangle_count);
        ASSERT_EQ(n, content.faces[f].triangle_count); // none lost its area
        for (std::size_t t = 0; t < n; ++t, ++next) {
            double middle[3] = {}, uv[2] = {}, st[2] = {}, wanted_uv[2] = {}, wanted_st[2] = {}, weights[3];
            for (std::size_t c = 0; c < 3; ++c) {
                const CurveCorner& w = content.curve_corners[next][c];
                const kiln_curve_corner& k = corners[3 * t + c];
                expect_same(k.luxel, w.luxel), expect_same(k.uv, w.uv);
                EXPECT_EQ(k.alpha, w.alpha);
                const std::uint32_t v = level.triangles()[3 * (face.first_triangle + t) + c];
                for (std::size_t a = 0; a < 3; ++a) middle[a] += level.positions()[3 * v + a] / 3.0;
                for (std::size_t a = 0; a < 2; ++a) wanted_uv[a] += w.uv[a] / 3.0, wanted_st[a] += w.luxel[a] / 3.0;
            }
            EXPECT_EQ(kiln_level_triangle_at(level.get(), f, middle, weights), face.first_triangle + t);
            for (const double w : weights) EXPECT_NEAR(w, 1.0 / 3, 1e-5);
            ASSERT_EQ(kiln_level_texture_uv(level.get(), f, middle, uv), KILN_OK);
            for (std::size_t a = 0; a < 2; ++a) EXPECT_NEAR(uv[a], wanted_uv[a], 1e-4);
            if (face.chart == KILN_NO_INDEX) continue;
            ASSERT_EQ(kiln_level_luxel_at(level.get(), f, middle, st), KILN_OK);
            for (std::size_t a = 0; a < 2; ++a) EXPECT_NEAR(st[a], wanted_st[a], 1e-3);
            float by_point[3], by_luxel[3];
            ASSERT_EQ(kiln_level_eval_flat(level.get(), f, middle, by_point), KILN_OK);
            ASSERT_EQ(kiln_level_eval_flat_luxel(level.get(), face.chart, st[0], st[1], by_luxel), KILN_OK);
            for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(by_point[k], by_luxel[k]);
        }
    }
    EXPECT_EQ(next, content.curve_corners.size());
}

TEST_P(RoundTrip, Overlays) {
    ASSERT_FALSE(content.overlays.empty());
    ASSERT_EQ(level.overlays().size(), content.overlays.size());
    std::size_t parts = 0, corners = 0;
    for (std::size_t i = 0; i < content.overlays.size(); ++i) {
        const OverlayInfo& o = content.overlays[i];
        const kiln_overlay& got = level.overlays()[i];
        EXPECT_EQ(got.kind, o.kind);
        EXPECT_EQ(got.material, o.material);
        EXPECT_EQ(got.entity, o.entity);
        EXPECT_EQ(got.render_order, o.render_order);
        EXPECT_EQ(got.fade_min, o.fade_min);
        EXPECT_EQ(got.fade_max, o.fade_max);
        ASSERT_EQ(got.fragment_count, o.pieces.size());
        EXPECT_EQ(got.first_fragment, parts);
        for (std::size_t k = 0; k < o.pieces.size(); ++k) {
            const kiln_overlay_fragment& f = level.overlay_fragments()[parts++];
            EXPECT_EQ(f.face, o.pieces[k].face);
            EXPECT_EQ(f.first_point, corners);
            ASSERT_EQ(f.point_count, o.pieces[k].points.size());
            for (std::size_t v = 0; v < f.point_count; ++v) {
                const kiln_overlay_point& p = level.overlay_points()[corners++];
                expect_same(p.position, o.pieces[k].points[v]);
                EXPECT_EQ(p.uv[0], o.pieces[k].uv[v][0]);
                EXPECT_EQ(p.uv[1], o.pieces[k].uv[v][1]);
            }
        }
    }
    EXPECT_EQ(level.overlay_fragments().size(), parts);
    EXPECT_EQ(level.overlay_points().size(), corners);
}

INSTANTIATE_TEST_SUITE_P(Encodings, RoundTrip, testing::Values(0, 1, 2), encoding_name);

} // namespace

// Lumps that are as they were in an earlier write are not packed again, and the file is the same.
TEST(LevelWriter, WhatIsKnownIsNotPackedAgain) {
    std::map<std::uint64_t, std::vector<std::uint8_t>> kept;
    std::size_t made = 0;
    WriteOptions options;
    options.known = [&](std::uint64_t key, const std::function<std::vector<std::uint8_t>()>& make) {
        const auto [at, fresh] = kept.try_emplace(key);
        if (fresh) at->second = make(), ++made;
        return at->second;
    };
    const LevelContent room = test::constant_room({1, 2, 3}, true), other = test::constant_room({2, 2, 3}, true);
    EXPECT_EQ(write_level(room, options), write_level(room));
    const std::size_t all = std::exchange(made, 0);
    EXPECT_EQ(write_level(room, options), write_level(room));
    EXPECT_EQ(made, 0u);
    EXPECT_EQ(write_level(other, options), write_level(other));
    EXPECT_GT(made, 0u);
    EXPECT_LT(made, all / 2);
    made = 0, options.zstd_level = 1;
    EXPECT_EQ(write_level(room, options), write_level(room, {.zstd_level = 1}));
    EXPECT_EQ(made, all);
}

TEST(LevelWriter, SameContentSameBytes) {
    EXPECT_EQ(write_level(mixture(5)), write_level(mixture(5)));
    EXPECT_NE(write_level(mixture(5)), write_level(mixture(6)));
}

TEST(LevelWriter, TheDirectoryIsAlignedAndComplete) {
    const auto bytes = write_level(mixture(7));
    const Level level(bytes);
    std::size_t seen = 0;
    for (std::size_t i = 0; i < kiln_level_lump_count(level.get()); ++i) {
        kiln_lump lump{};
        ASSERT_EQ(kiln_level_lump(level.get(), i, &lump), KILN_OK);
        EXPECT_EQ(lump.offset % 16, 0u);
        EXPECT_LE(lump.offset + lump.stored_size, bytes.size());
        EXPECT_LE(lump.stored_size, lump.raw_size) << lump.name;
        seen += std::strcmp(lump.name, "LMPG") == 0;
    }
    EXPECT_EQ(seen, level.info().pages);
}

TEST(LevelWriter, StrippingDropsProvenanceAndQuality) {
    const LevelContent content = mixture(8);
    const auto bytes = write_level(content, {.strip = true});
    EXPECT_LT(bytes.size(), write_level(content).size());
    const Level level(bytes);
    const char* what = nullptr;
    EXPECT_EQ(kiln_level_check(level.get(), &what), KILN_OK) << what;
    kiln_source s{};
    EXPECT_EQ(kiln_level_face_source(level.get(), 0, &s), KILN_MISSING);
    EXPECT_EQ(kiln_level_page_quality(level.get(), 0, nullptr, nullptr), KILN_MISSING);
    EXPECT_EQ(level.meta_json().find("mixture.vmf"), std::string_view::npos);
    EXPECT_EQ(level.planes()[5].normal[1], content.planes[5].normal[1]);
    EXPECT_EQ(level.planes()[5].exact_normal[1], 0);
}

TEST(LevelWriter, MetaIsJsonWhateverTheNameHolds) {
    LevelContent content = test::constant_room({1, 1, 1});
    content.source_name = "a\"b\\\n\xe4\xc3\xa4.map"; // quote, backslash, line end, Latin-1 and UTF-8
    const auto bytes = write_level(content);
    const Level level(bytes);
    EXPECT_EQ(level.meta_json(), "{\"format\":1,\"compiler\":\"test\",\"source\":\"a\\\"b\\\\\\u000a\xc3\xa4\xc3\xa4.map\","
                                 "\"input_hash\":\"0123\",\"options\":{\"a\":1},\"error\":{\"estimate\":1.5}}");
}

TEST(LevelWriter, CoordinatesOnACoarserGridCostFewerBits) {
    const auto bytes = write_level(test::constant_room({1, 1, 1}));
    EXPECT_EQ(Level(bytes).info().position_grid_bits, 0u);
}

TEST(LevelWriter, TrianglesWithoutAreaOnTheGridAreCountedNotKept) {
    LevelContent content = test::constant_room({1, 1, 1});
    const auto near = static_cast<std::uint32_t>(content.positions.size());
    content.positions.push_back(content.positions[content.triangles.back()[0]]);
    content.positions.back()[0] += 1e-4;
    content.triangles.push_back({content.triangles.back()[0], near, content.triangles.back()[1]});
    content.corner_normals.push_back(content.corner_normals.back());
    ++content.faces.back().triangle_count;
    const auto bytes = write_level(content);
    const Level level(bytes);
    EXPECT_EQ(level.info().degenerate_triangles, 1u);
    EXPECT_EQ(level.info().triangles, 12u);
    EXPECT_EQ(level.info().vertices, 8u);
    EXPECT_EQ(level.faces().back().triangle_count, 2u);
}

TEST(LevelWriter, ContradictionsAreRefused) {
    const auto refused = [](auto&& spoil) {
        LevelContent c = test::constant_room({1, 1, 1}, true);
        spoil(c);
        EXPECT_THROW(write_level(c), std::invalid_argument);
    };
    refused([](LevelContent& c) { c.faces[0].material = 9; });
    refused([](LevelContent& c) { c.nodes[2].plane = 99; });
    refused([](LevelContent& c) { c.nodes[2].child[0] = -99; });
    refused([](LevelContent& c) { c.leaves[0].faces.push_back(6); });
    refused([](LevelContent& c) { c.vis_rows.clear(); });
    refused([](LevelContent& c) { c.triangles[0][0] = 1000; });
    refused([](LevelContent& c) { c.positions[0][0] = NAN; });
    refused([](LevelContent& c) { c.flat.pop_back(); });
    refused([](LevelContent& c) { c.rnm.pop_back(); });
    refused([](LevelContent& c) { c.faces[1].first_triangle = 7; });
    refused([](LevelContent& c) { c.charts[0].width = 0; });
    refused([](LevelContent& c) { c.rnm_encoding = 3; });
}

TEST(LevelWriter, OverlaysThatContradictThemselvesAreRefused) {
    LevelContent c = test::mixture(3, 6, 0);
    const auto refused = [&](auto&& change) {
        LevelContent bad = c;
        OverlayInfo o;
        o.pieces.push_back({0, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 0}, {1, 0}, {0, 1}}});
        change(o);
        bad.overlays.push_back(o);
        EXPECT_THROW(write_level(bad), std::invalid_argument);
    };
    refused([](OverlayInfo& o) { o.material = 999; });
    refused([](OverlayInfo& o) { o.entity = 999; });
    refused([](OverlayInfo& o) { o.pieces[0].face = 999; });
    refused([](OverlayInfo& o) { o.pieces[0].uv.pop_back(); });
    refused([](OverlayInfo& o) { o.pieces[0].points.pop_back(), o.pieces[0].uv.pop_back(); });
    c.overlays.clear(); // no lump, no fault
    const auto bytes = write_level(c);
    const Level level(bytes);
    EXPECT_TRUE(level.overlays().empty());
}

TEST(LevelWriter, AnEmptyLevelIsALevel) {
    LevelContent c;
    const auto bytes = write_level(c);
    const Level level(bytes);
    EXPECT_EQ(kiln_level_check(level.get(), nullptr), KILN_OK);
    EXPECT_EQ(kiln_level_find_leaf(level.get(), std::array{0.0, 0.0, 0.0}.data()), KILN_NO_INDEX);
}

TEST(LevelWriter, ExtremeLightIsScaledNotClipped) {
    LevelContent c = test::room(0, true, [](std::size_t, std::uint32_t, std::uint32_t) {
        return std::array<Float3, 4>{Float3{2e6f, 1, 3}, Float3{1e6f, -1e6f, 3}, Float3{1, 2, 3}, Float3{4, 5, 6}};
    });
    const auto bytes = write_level(c);
    const Level level(bytes);
    const kiln_chart& k = level.charts()[0];
    float rgb[3];
    ASSERT_EQ(kiln_level_page_texel(level.get(), k.page, 0, k.page_x, k.page_y, rgb), KILN_OK);
    EXPECT_NEAR(rgb[0], 1e6f, 1e6f / 2047);
    EXPECT_NEAR(rgb[1], -1e6f, 1e6f / 2047);
}

} // namespace kiln::level

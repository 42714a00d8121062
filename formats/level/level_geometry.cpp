// SPDX-License-Identifier: MIT
// C interface: tables, tree, visibility, entities, provenance.
#include "formats/level/level_state.h"
#include <algorithm>
#include <cmath>

using namespace kiln::level;

namespace {

template <class T> const T* rows_or_null(const std::vector<T>* rows, size_t* count, std::size_t each = 1) {
    if (count) *count = rows ? rows->size() / each : 0;
    return rows && !rows->empty() ? rows->data() : nullptr;
}
template <class Table, class T> const std::vector<T>* member(const Table* table, std::vector<T> Table::*m) {
    return table ? &(table->*m) : nullptr;
}
double dot3(const auto* a, const auto* b) {
    return static_cast<double>(a[0]) * b[0] + static_cast<double>(a[1]) * b[1] + static_cast<double>(a[2]) * b[2];
}
void cross3(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1], out[1] = a[2] * b[0] - a[0] * b[2], out[2] = a[0] * b[1] - a[1] * b[0];
}
bool normalize3(double v[3]) {
    const double length = std::sqrt(dot3(v, v));
    if (!(length > 0) || !(length < 1e300)) return false;
    for (int i = 0; i < 3; ++i) v[i] /= length;
    return true;
}

// (t, b, n) with n the shading normal, t the tangent made orthogonal to it, b mirrored as asked.
void frame_around(const double normal[3], const double tangent[3], bool mirrored, const float shading_normal[3], float t[3], float b[3],
                  float n[3]) {
    double nn[3] = {shading_normal[0], shading_normal[1], shading_normal[2]};
    if (!normalize3(nn)) std::copy(normal, normal + 3, nn);
    double tt[3], bb[3];
    const double along = dot3(nn, tangent);
    for (int k = 0; k < 3; ++k) tt[k] = tangent[k] - along * nn[k];
    if (!normalize3(tt)) { // the tangent stands on the surface: any direction in it
        const double other[3] = {std::abs(nn[0]) < 0.5 ? 1.0 : 0.0, std::abs(nn[0]) < 0.5 ? 0.0 : 1.0, 0};
        cross3(other, nn, tt);
        normalize3(tt);
    }
    cross3(nn, tt, bb);
    for (int k = 0; k < 3; ++k) {
        t[k] = static_cast<float>(tt[k]);
        b[k] = static_cast<float>(mirrored ? -bb[k] : bb[k]);
        n[k] = static_cast<float>(nn[k]);
    }
}

double squared_distance(const double corner[3][3], const double point[3], const double w[3]) {
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        const double d = corner[0][k] * w[0] + corner[1][k] * w[1] + corner[2][k] * w[2] - point[k];
        sum += d * d;
    }
    return sum;
}
// Of a point whose foot is outside the triangle: weights of the nearest point of its border; the squared distance.
double nearest_weights(const double corner[3][3], const double point[3], double w[3]) {
    double best = 1e300;
    for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t d = (c + 1) % 3;
        double along = 0, length = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            const double e = corner[d][k] - corner[c][k];
            along += e * (point[k] - corner[c][k]), length += e * e;
        }
        const double t = length > 0 ? std::clamp(along / length, 0.0, 1.0) : 0;
        double at[3] = {};
        at[c] = 1 - t, at[d] = t;
        const double off = squared_distance(corner, point, at);
        if (off < best) best = off, std::copy(at, at + 3, w);
    }
    return best;
}

} // namespace

extern "C" {

#define KILN_ROWS(result, function, part, Table, list)                                                             \
    const result* kiln_level_##function(const kiln_level* level, size_t* count) {                                  \
        return rows_or_null(member(level ? level->get_##part() : nullptr, &Table::list), count);                   \
    }
KILN_ROWS(kiln_plane, planes, planes, Planes, rows)
KILN_ROWS(kiln_node, nodes, nodes, Nodes, rows)
KILN_ROWS(kiln_leaf, leaves, leaves, Leaves, rows)
KILN_ROWS(uint32_t, leaf_brushes, leaves, Leaves, brushes)
KILN_ROWS(uint32_t, leaf_faces, leaves, Leaves, faces)
KILN_ROWS(kiln_portal, portals, portals, Portals, rows)
KILN_ROWS(kiln_brush, brushes, brushes, Brushes, rows)
KILN_ROWS(uint32_t, brush_planes, brushes, Brushes, planes)
KILN_ROWS(kiln_material, materials, materials, Materials, rows)
KILN_ROWS(kiln_face, faces, faces, Faces, rows)
KILN_ROWS(kiln_chart, charts, charts, Charts, rows)
KILN_ROWS(kiln_light, lights, lights, Lights, rows)
KILN_ROWS(kiln_cube, cubes, cubes, Cubes, cubes)
KILN_ROWS(kiln_cube_cell, cube_cells, cubes, Cubes, cells)
KILN_ROWS(uint32_t, cube_lights, cubes, Cubes, lights)
KILN_ROWS(kiln_probe, probes, probes, ProbeTable, rows)
KILN_ROWS(kiln_area_portal, area_portals, area_portals, AreaPortals, rows)
KILN_ROWS(kiln_occluder, occluders, occluders, Occluders, rows)
KILN_ROWS(kiln_occluder_polygon, occluder_polygons, occluders, Occluders, polygons)
KILN_ROWS(kiln_water, waters, waters, Waters, rows)
KILN_ROWS(uint32_t, leaf_waters, waters, Waters, of_leaf)
KILN_ROWS(float, leaf_water_distances, water_distances, WaterDistances, of_leaf)
KILN_ROWS(uint8_t, brush_blocks, brush_blocks, BrushBlocks, bits)
KILN_ROWS(uint32_t, cube_behind, cube_behind, CubeBehind, cells)
KILN_ROWS(uint8_t, face_no_dynamic_shadow, face_shadows, FaceShadows, bits)
KILN_ROWS(kiln_displacement, displacements, displacements, Displacements, rows)
KILN_ROWS(uint16_t, displacement_tags, displacements, Displacements, tags)
KILN_ROWS(kiln_curved_patch, curved_patches, curved_patches, CurvedPatches, rows)
KILN_ROWS(kiln_overlay, overlays, overlays, Overlays, rows)
KILN_ROWS(kiln_overlay_fragment, overlay_fragments, overlays, Overlays, fragments)
KILN_ROWS(kiln_overlay_point, overlay_points, overlays, Overlays, points)
#undef KILN_ROWS

const float* kiln_level_area_portal_points(const kiln_level* level, size_t* count) {
    const auto* points = rows_or_null(member(level ? level->get_area_portals() : nullptr, &AreaPortals::points), count);
    return points ? points->xyz : nullptr;
}
const float* kiln_level_occluder_points(const kiln_level* level, size_t* count) {
    const auto* points = rows_or_null(member(level ? level->get_occluders() : nullptr, &Occluders::points), count);
    return points ? points->xyz : nullptr;
}

const float* kiln_level_portal_points(const kiln_level* level, size_t* count) {
    const auto* points = rows_or_null(member(level ? level->get_portals() : nullptr, &Portals::points), count);
    return points ? points->xyz : nullptr;
}
const float* kiln_level_displacement_vertices(const kiln_level* level, size_t* count) {
    const auto* rows = rows_or_null(member(level ? level->get_displacements() : nullptr, &Displacements::vertices), count);
    return rows ? rows->xyz_alpha : nullptr;
}
const float* kiln_level_displacement_blends(const kiln_level* level, size_t* count) {
    const auto* rows = rows_or_null(member(level ? level->get_displacements() : nullptr, &Displacements::blends), count);
    return rows ? rows->weight : nullptr;
}
const float* kiln_level_patch_vertices(const kiln_level* level, size_t* count) {
    const auto* rows = rows_or_null(member(level ? level->get_curved_patches() : nullptr, &CurvedPatches::vertices), count);
    return rows ? rows->xyz_uv : nullptr;
}
const kiln_curve_corner* kiln_level_curve_corners(const kiln_level* level, uint32_t face, size_t* triangle_count) {
    if (triangle_count) *triangle_count = 0;
    const Faces* faces = level && face < level->info.faces ? level->get_faces() : nullptr;
    if (!faces || !(faces->rows[face].flags & KILN_FACE_CURVED) || faces->rows[face].triangle_count == 0) return nullptr;
    const CurveCorners* corners = level->get_curve_corners();
    if (!corners) return nullptr;
    if (triangle_count) *triangle_count = faces->rows[face].triangle_count;
    return &corners->rows[corners->first[face]];
}
const int32_t* kiln_level_grid_positions(const kiln_level* level, size_t* count) {
    return rows_or_null(member(level ? level->get_mesh() : nullptr, &Mesh::grid), count, 3);
}
const float* kiln_level_positions(const kiln_level* level, size_t* count) {
    return rows_or_null(member(level ? level->get_mesh() : nullptr, &Mesh::positions), count, 3);
}
const uint32_t* kiln_level_triangles(const kiln_level* level, size_t* count) {
    return rows_or_null(member(level ? level->get_mesh() : nullptr, &Mesh::triangles), count, 3);
}
const float* kiln_level_corner_normals(const kiln_level* level, size_t* count) {
    return rows_or_null(level ? level->get_normals() : nullptr, count, 9);
}

uint32_t kiln_level_find_leaf(const kiln_level* level, const double point[3]) {
    if (!level || !point) return KILN_NO_INDEX;
    const Nodes* nodes = level->get_nodes();
    const Planes* planes = level->get_planes();
    if (!nodes || !planes) return KILN_NO_INDEX;
    if (nodes->rows.empty()) return level->info.leaves == 1 ? 0 : KILN_NO_INDEX;
    std::int32_t at = 0;
    // A tree visits no node twice; a damaged one may have a loop.
    for (std::size_t steps = 0; at >= 0; ++steps) {
        if (steps >= nodes->rows.size()) return KILN_NO_INDEX;
        const kiln_node& n = nodes->rows[static_cast<std::size_t>(at)];
        const kiln_plane& p = planes->rows[n.plane];
        at = n.child[dot3(p.normal, point) - p.distance >= 0 ? 0 : 1];
    }
    return static_cast<std::uint32_t>(-(at + 1));
}

const uint64_t* kiln_level_pvs_row(const kiln_level* level, int32_t cluster, size_t* words) {
    if (words) *words = 0;
    if (!level || cluster < 0 || static_cast<std::uint32_t>(cluster) >= level->info.clusters) return nullptr;
    const auto* rows = level->get_vis_rows();
    if (!rows) return nullptr;
    const Visibility& v = *level->get_visibility();
    if (words) *words = v.words;
    return rows->data() + v.row_of[static_cast<std::size_t>(cluster)] * v.words;
}

namespace {

kiln_status read_row(const Visibility& v, int32_t cluster, uint64_t* row, size_t words) {
    if (words < v.words) return KILN_BAD_ARGUMENT;
    try {
        const std::uint32_t r = v.row_of[static_cast<std::size_t>(cluster)], block = r / v.block_rows;
        const std::size_t n = std::min(v.block_rows, v.unique - block * v.block_rows) * v.words;
        const Blob raw = decompress(v.blocks[block], n * 8);
        std::memcpy(row, raw.data() + r % v.block_rows * v.words * 8, v.words * 8);
        return KILN_OK;
    } catch (const Failure& f) {
        return f.status;
    } catch (const std::bad_alloc&) {
        return KILN_NO_MEMORY;
    } catch (const std::exception&) {
        return KILN_DAMAGED;
    }
}

} // namespace

kiln_status kiln_level_read_pvs_row(const kiln_level* level, int32_t cluster, uint64_t* row, size_t words) {
    if (!level || !row || cluster < 0 || static_cast<std::uint32_t>(cluster) >= level->info.clusters)
        return KILN_BAD_ARGUMENT;
    const Visibility* v = level->get_visibility();
    return v ? read_row(*v, cluster, row, words) : level->fault_of(fourcc("VISR"));
}

kiln_status kiln_level_read_shut_row(const kiln_level* level, int32_t cluster, uint64_t* row, size_t words) {
    if (!level || !row || cluster < 0 || static_cast<std::uint32_t>(cluster) >= level->info.clusters)
        return KILN_BAD_ARGUMENT;
    if (const Visibility* v = level->get_shut_visibility()) return read_row(*v, cluster, row, words);
    const kiln_status fault = level->fault_of(fourcc("VISS"));
    return fault == KILN_MISSING ? kiln_level_read_pvs_row(level, cluster, row, words) : fault;
}

kiln_status kiln_level_read_door_row(const kiln_level* level, int32_t cluster, const uint8_t* open, uint64_t* row, size_t words) {
    if (!level) return KILN_BAD_ARGUMENT;
    const Leaves* leaves = level->get_leaves();
    if (!leaves) return level->fault_of(fourcc("LEAF"));
    size_t portal_count = 0;
    const kiln_area_portal* portals = kiln_level_area_portals(level, &portal_count);
    if (!portals && level->fault_of(fourcc("AREA")) != KILN_MISSING) return level->fault_of(fourcc("AREA"));
    if (portal_count && !open) return KILN_BAD_ARGUMENT;
    const auto parts = [](const kiln_area_portal& p) { return p.area[0] != 0 && p.area[0] != p.area[1]; };
    try {
        std::vector<std::uint32_t> reached; // areas
        bool everywhere = false;            // of a portal's own leaf: whatever is open, both its sides are there
        for (const kiln_leaf& l : leaves->rows)
            if (l.cluster == cluster) everywhere = everywhere || l.area == 0, reached.push_back(l.area);
        everywhere = everywhere || reached.empty();
        const auto is_reached = [&](std::uint32_t area) { return std::find(reached.begin(), reached.end(), area) != reached.end(); };
        const bool one = !everywhere && std::all_of(reached.begin(), reached.end(), [&](std::uint32_t a) { return a == reached[0]; });
        bool shut = one && portal_count;
        for (std::size_t p = 0; p < portal_count; ++p) shut = shut && !(open[p] && parts(portals[p]) && (is_reached(portals[p].area[0]) || is_reached(portals[p].area[1])));
        if (shut) return kiln_level_read_shut_row(level, cluster, row, words);
        if (const kiln_status s = kiln_level_read_pvs_row(level, cluster, row, words); s != KILN_OK || everywhere || !portal_count) return s;
        for (bool more = true; more;) {
            more = false;
            for (std::size_t p = 0; p < portal_count; ++p) {
                if (!open[p] || !parts(portals[p])) continue;
                const bool a = is_reached(portals[p].area[0]), b = is_reached(portals[p].area[1]);
                if (a != b) reached.push_back(portals[p].area[a]), more = true;
            }
        }
        std::vector<std::uint64_t> there((std::size_t{level->info.clusters} + 63) / 64, 0);
        for (const kiln_leaf& l : leaves->rows)
            if (l.cluster >= 0 && (l.area == 0 || is_reached(l.area))) there[static_cast<std::size_t>(l.cluster) / 64] |= std::uint64_t{1} << (l.cluster % 64);
        for (std::size_t w = 0; w < there.size(); ++w) row[w] &= there[w];
        return KILN_OK;
    } catch (const std::bad_alloc&) {
        return KILN_NO_MEMORY;
    }
}

kiln_status kiln_level_read_pas_row(const kiln_level* level, int32_t cluster, uint64_t* row, size_t words) {
    std::size_t n = 0;
    if (!level || !row || cluster < 0 || static_cast<std::uint32_t>(cluster) >= level->info.clusters) return KILN_BAD_ARGUMENT;
    const std::uint64_t* seen = kiln_level_pvs_row(level, cluster, &n);
    if (!seen) return level->fault_of(fourcc("VISR"));
    if (words < n) return KILN_BAD_ARGUMENT;
    std::fill_n(row, n, std::uint64_t{0});
    for (std::uint32_t c = 0; c < level->info.clusters; ++c)
        if (seen[c / 64] >> (c % 64) & 1) {
            const std::uint64_t* other = kiln_level_pvs_row(level, static_cast<std::int32_t>(c), nullptr);
            for (std::size_t w = 0; w < n; ++w) row[w] |= other[w];
        }
    return KILN_OK;
}

int kiln_level_cluster_visible(const kiln_level* level, int32_t from, int32_t to) {
    size_t words = 0;
    const std::uint64_t* row = kiln_level_pvs_row(level, from, &words);
    if (!row || to < 0 || static_cast<std::uint32_t>(to) >= level->info.clusters) return 0;
    return static_cast<int>(row[to / 64] >> (to % 64) & 1);
}

kiln_status kiln_level_texture_uv(const kiln_level* level, uint32_t face, const double point[3], double uv[2]) {
    if (!level || !point || !uv || face >= level->info.faces) return KILN_BAD_ARGUMENT;
    const Faces* faces = level->get_faces();
    if (!faces) return level->fault_of(fourcc("FACE"));
    const Materials* materials = level->get_materials();
    if (!materials) return level->fault_of(fourcc("MATL"));
    const kiln_face& f = faces->rows[face];
    const kiln_material& m = materials->rows[f.material];
    if (f.flags & KILN_FACE_CURVED) {
        double w[3];
        const std::uint32_t triangle = kiln_level_triangle_at(level, face, point, w);
        if (triangle == KILN_NO_INDEX) return level->get_mesh() ? KILN_NONE : level->fault_of(fourcc("MESH"));
        const kiln_curve_corner* corners = kiln_level_curve_corners(level, face, nullptr);
        if (!corners) return level->fault_of(fourcc("CRNR"));
        corners += std::size_t{3} * (triangle - f.first_triangle);
        for (int k = 0; k < 2; ++k) uv[k] = w[0] * corners[0].uv[k] + w[1] * corners[1].uv[k] + w[2] * corners[2].uv[k];
        return KILN_OK;
    }
    const auto coordinate = [&](const double* axis, double scale, double shift, std::uint32_t size) {
        return (dot3(point, axis) / (scale != 0 ? scale : 1) + shift) / (size ? size : 1);
    };
    uv[0] = coordinate(f.u_axis, f.u_scale, f.u_shift, m.width);
    uv[1] = coordinate(f.v_axis, f.v_scale, f.v_shift, m.height);
    return KILN_OK;
}

uint32_t kiln_level_triangle_at(const kiln_level* level, uint32_t face, const double point[3], double weights[3]) {
    if (!level || !point || !weights || face >= level->info.faces) return KILN_NO_INDEX;
    const Faces* faces = level->get_faces();
    const Mesh* mesh = level->get_mesh();
    if (!faces || !mesh) return KILN_NO_INDEX;
    const kiln_face& f = faces->rows[face];
    const bool curved = (f.flags & KILN_FACE_CURVED) != 0;
    double best = 1e300; // flat: how far outside in weights; curved: squared distance
    std::uint32_t triangle = KILN_NO_INDEX;
    for (std::uint32_t i = 0; i < f.triangle_count; ++i) {
        const std::size_t t = std::size_t{f.first_triangle} + i;
        double corner[3][3], edge[2][3], n[3];
        for (std::size_t c = 0; c < 3; ++c)
            for (std::size_t k = 0; k < 3; ++k)
                corner[c][k] = mesh->positions[mesh->triangles[3 * t + c] * std::size_t{3} + k];
        for (std::size_t k = 0; k < 3; ++k)
            edge[0][k] = corner[1][k] - corner[0][k], edge[1][k] = corner[2][k] - corner[0][k];
        cross3(edge[0], edge[1], n);
        const double area = dot3(n, n);
        if (!(area > 0)) continue;
        double w[3];
        for (std::size_t c = 0; c < 3; ++c) {
            double a[3], b[3], x[3];
            for (std::size_t k = 0; k < 3; ++k)
                a[k] = corner[(c + 1) % 3][k] - point[k], b[k] = corner[(c + 2) % 3][k] - point[k];
            cross3(a, b, x);
            w[c] = dot3(x, n) / area;
        }
        double off = -std::min(w[0], std::min(w[1], w[2]));
        if (curved && off > 0) off = nearest_weights(corner, point, w);
        else if (curved) off = squared_distance(corner, point, w);
        if (off < best) best = off, triangle = static_cast<std::uint32_t>(t), std::copy(w, w + 3, weights);
    }
    return triangle;
}

kiln_status kiln_level_shading_normal(const kiln_level* level, uint32_t face, const double point[3], float normal[3]) {
    if (!level || !point || !normal || face >= level->info.faces) return KILN_BAD_ARGUMENT;
    const Faces* faces = level->get_faces();
    if (!faces) return level->fault_of(fourcc("FACE"));
    if (!level->get_mesh()) return level->fault_of(fourcc("MESH"));
    const std::vector<float>* normals = level->get_normals();
    if (!normals) return level->fault_of(fourcc("NRML"));
    const kiln_face& f = faces->rows[face];
    double weight[3] = {1, 0, 0};
    const std::uint32_t triangle = kiln_level_triangle_at(level, face, point, weight);
    double n[3] = {f.normal[0], f.normal[1], f.normal[2]};
    if (triangle != KILN_NO_INDEX) {
        double sum[3] = {};
        for (std::size_t c = 0; c < 3; ++c)
            for (std::size_t k = 0; k < 3; ++k)
                sum[k] += std::max(0.0, weight[c]) * (*normals)[std::size_t{9} * triangle + 3 * c + k];
        if (normalize3(sum)) std::copy(sum, sum + 3, n);
    }
    for (int k = 0; k < 3; ++k) normal[k] = static_cast<float>(n[k]);
    return KILN_OK;
}

kiln_status kiln_level_tangent_frame(const kiln_level* level, uint32_t face, const float shading_normal[3], float t[3],
                                     float b[3], float n[3]) {
    if (!level || !shading_normal || !t || !b || !n || face >= level->info.faces) return KILN_BAD_ARGUMENT;
    const Faces* faces = level->get_faces();
    if (!faces) return level->fault_of(fourcc("FACE"));
    const kiln_face& f = faces->rows[face];
    const double ft[3] = {f.tangent[0], f.tangent[1], f.tangent[2]}, fn[3] = {f.normal[0], f.normal[1], f.normal[2]};
    double hand[3];
    cross3(fn, ft, hand);
    frame_around(fn, ft, dot3(hand, f.bitangent) < 0, shading_normal, t, b, n);
    return KILN_OK;
}

kiln_status kiln_level_tangent_frame_at(const kiln_level* level, uint32_t face, const double point[3], const float shading_normal[3],
                                        float t[3], float b[3], float n[3]) {
    if (!level || !point || face >= level->info.faces) return KILN_BAD_ARGUMENT;
    const kiln_status status = kiln_level_tangent_frame(level, face, shading_normal, t, b, n);
    if (status != KILN_OK || !(level->get_faces()->rows[face].flags & KILN_FACE_CURVED)) return status;
    double w[3];
    const std::uint32_t triangle = kiln_level_triangle_at(level, face, point, w);
    std::size_t count = 0;
    const kiln_curve_corner* corners = kiln_level_curve_corners(level, face, &count);
    const Mesh* mesh = level->get_mesh();
    if (!mesh) return level->fault_of(fourcc("MESH"));
    if (!corners) return level->fault_of(fourcc("CRNR"));
    if (triangle == KILN_NO_INDEX) return status;
    const kiln_curve_corner* c = corners + std::size_t{3} * (triangle - level->get_faces()->rows[face].first_triangle);
    // Directions in which the texture coordinates grow: of the two edges' dual vectors.
    double e[2][3], up[3], along[2][3];
    for (std::size_t i = 0; i < 2; ++i)
        for (std::size_t k = 0; k < 3; ++k)
            e[i][k] = mesh->positions[mesh->triangles[std::size_t{3} * triangle + i + 1] * std::size_t{3} + k] -
                      mesh->positions[mesh->triangles[std::size_t{3} * triangle] * std::size_t{3} + k];
    cross3(e[0], e[1], up);
    double d0[3], d1[3];
    cross3(e[1], up, d0), cross3(up, e[0], d1);
    for (std::size_t j = 0; j < 2; ++j) {
        const double a = c[1].uv[j] - c[0].uv[j], z = c[2].uv[j] - c[0].uv[j];
        for (std::size_t k = 0; k < 3; ++k) along[j][k] = d0[k] * a + d1[k] * z;
    }
    double turn[3];
    cross3(along[0], along[1], turn);
    const double handed = dot3(turn, up);
    if (!normalize3(up) || !normalize3(along[0]) || handed == 0) return status; // the picture has no extent there
    frame_around(up, along[0], handed < 0, shading_normal, t, b, n);
    return KILN_OK;
}

// ---- Entities, provenance

size_t kiln_level_entity_key_count(const kiln_level* level, uint32_t entity) {
    const Entities* table = level && entity < level->info.entities ? level->get_entities() : nullptr;
    return table ? table->rows[entity].key_count : 0;
}
kiln_status kiln_level_entity_key(const kiln_level* level, uint32_t entity, size_t i, const char** key,
                                  const char** value) {
    if (!level || entity >= level->info.entities) return KILN_BAD_ARGUMENT;
    const Entities* table = level->get_entities();
    if (!table) return level->fault_of(fourcc("ENTS"));
    const EntityRow& row = table->rows[entity];
    if (i >= row.key_count) return KILN_BAD_ARGUMENT;
    if (key) *key = table->keys[row.first_key + i].c_str();
    if (value) *value = table->values[row.first_key + i].c_str();
    return KILN_OK;
}
const char* kiln_level_entity_value(const kiln_level* level, uint32_t entity, const char* key) {
    const Entities* table = level && key && entity < level->info.entities ? level->get_entities() : nullptr;
    if (!table) return nullptr;
    const EntityRow& row = table->rows[entity];
    for (std::size_t i = row.first_key; i < std::size_t{row.first_key} + row.key_count; ++i)
        if (table->keys[i] == key) return table->values[i].c_str();
    return nullptr;
}
int32_t kiln_level_entity_model(const kiln_level* level, uint32_t entity) {
    const Entities* table = level && entity < level->info.entities ? level->get_entities() : nullptr;
    return table ? table->rows[entity].model : -1;
}

#define KILN_SOURCE(function, list)                                                                                \
    kiln_status kiln_level_##function##_source(const kiln_level* level, uint32_t i, kiln_source* source) {         \
        if (!level || !source) return KILN_BAD_ARGUMENT;                                                           \
        const Provenance* table = level->get_provenance();                                                         \
        if (!table) return level->fault_of(fourcc("PROV"));                                                        \
        if (i >= table->list.size()) return KILN_BAD_ARGUMENT;                                                     \
        *source = table->list[i];                                                                                  \
        return KILN_OK;                                                                                            \
    }
KILN_SOURCE(face, faces)
KILN_SOURCE(brush, brushes)
KILN_SOURCE(entity, entities)
KILN_SOURCE(light, lights)
#undef KILN_SOURCE

#define KILN_CURVE_SOURCE(function, list)                                                                          \
    kiln_status kiln_level_##function##_source(const kiln_level* level, uint32_t i, kiln_source* source) {         \
        if (!level || !source) return KILN_BAD_ARGUMENT;                                                           \
        const CurveSources* table = level->get_curve_sources();                                                    \
        if (!table) return level->fault_of(fourcc("PRVC"));                                                        \
        if (i >= table->list.size()) return KILN_BAD_ARGUMENT;                                                     \
        *source = table->list[i];                                                                                  \
        return KILN_OK;                                                                                            \
    }
KILN_CURVE_SOURCE(displacement, displacements)
KILN_CURVE_SOURCE(patch, patches)
#undef KILN_CURVE_SOURCE

// Levels whose things are all of the map itself have no list of files.
#define KILN_FILE(function, list)                                                                                  \
    kiln_status kiln_level_##function##_file(const kiln_level* level, uint32_t i, const char** file) {             \
        if (!level || !file) return KILN_BAD_ARGUMENT;                                                             \
        kiln_source source;                                                                                        \
        if (const kiln_status s = kiln_level_##function##_source(level, i, &source); s != KILN_OK) return s;       \
        *file = "";                                                                                                \
        if (level->find(fourcc("FILE")) == level->entries.size()) return KILN_OK;                                  \
        const SourceFiles* table = level->get_source_files();                                                      \
        if (!table) return level->fault_of(fourcc("FILE"));                                                        \
        if (i >= table->list.size()) return KILN_DAMAGED;                                                          \
        if (const uint32_t f = table->list[i]; f > 0) *file = table->names[f - 1].c_str();                         \
        return KILN_OK;                                                                                            \
    }
KILN_FILE(face, faces)
KILN_FILE(brush, brushes)
KILN_FILE(entity, entities)
KILN_FILE(light, lights)
KILN_FILE(displacement, displacements)
KILN_FILE(patch, patches)
#undef KILN_FILE

kiln_status kiln_level_brush_side_source(const kiln_level* level, uint32_t i, int32_t* side) {
    if (!level || !side) return KILN_BAD_ARGUMENT;
    const Provenance* table = level->get_provenance();
    if (!table) return level->fault_of(fourcc("PROV"));
    if (i >= table->brush_sides.size()) return KILN_BAD_ARGUMENT;
    *side = table->brush_sides[i];
    return KILN_OK;
}

} // extern "C"

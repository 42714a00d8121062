// SPDX-License-Identifier: MIT
// C interface: what the stored light says at a place. These are the formulas a shader uses; FORMAT.md in words.
#include "formats/level/level_state.h"
#include "formats/level/numbers.h"
#include <algorithm>
#include <cmath>

using namespace kiln::level;

namespace {

using Rgb = std::array<float, 3>;

constexpr float kSqrt23 = 0.816496580927726f, kSqrt16 = 0.408248290463863f, kSqrt12 = 0.707106781186548f,
                kSqrt13 = 0.577350269189626f;
constexpr float kBasis[3][3] = {
    {kSqrt23, 0, kSqrt13}, {-kSqrt16, kSqrt12, kSqrt13}, {-kSqrt16, -kSqrt12, kSqrt13}};

double dot3(const auto* a, const auto* b) {
    return static_cast<double>(a[0]) * b[0] + static_cast<double>(a[1]) * b[1] + static_cast<double>(a[2]) * b[2];
}

Rgb texel(const Blob& texels, const PageInfo& page, std::size_t layer, std::size_t x, std::size_t y) {
    const std::size_t i = (layer * page.height + y) * page.width + x;
    Rgb rgb{};
    if (page.format == KILN_TEXEL_RGB9E5) {
        std::uint32_t packed = 0;
        std::memcpy(&packed, texels.data() + 4 * i, 4);
        rgb = float_from_rgb9e5(packed);
    } else {
        for (std::size_t c = 0; c < 3; ++c) {
            std::uint16_t h = 0;
            std::memcpy(&h, texels.data() + 6 * i + 2 * c, 2);
            rgb[c] = float_from_half(h);
        }
    }
    for (float& v : rgb) v *= page.scale;
    return rgb;
}

// The layers of a chart at luxel coordinates, bilinear between texel centres, never outside the chart.
struct Stored {
    std::uint32_t layers = 0;
    float value[4][3] = {};
};
kiln_status stored_at(const kiln_level& level, std::uint32_t chart, double s, double t, Stored* out) {
    const Charts* charts = level.get_charts();
    if (!charts) return level.fault_of(fourcc("CHRT"));
    if (chart >= charts->rows.size()) return KILN_BAD_ARGUMENT;
    const kiln_chart& c = charts->rows[chart];
    const PageInfo& page = charts->pages[c.page];
    const Blob* texels = level.get_page(c.page);
    if (!texels) return level.fault_of(fourcc("LMPG"), c.page);
    const auto axis = [](double v, std::uint32_t size, std::size_t at[2], float w[2]) {
        v -= 0.5;
        if (!(v > 0)) v = 0; // NaN too
        v = std::min(v, static_cast<double>(size - 1));
        at[0] = static_cast<std::size_t>(v);
        at[1] = std::min<std::size_t>(at[0] + 1, size - 1);
        w[1] = static_cast<float>(v - static_cast<double>(at[0])), w[0] = 1 - w[1];
    };
    std::size_t x[2], y[2];
    float wx[2], wy[2];
    axis(s, c.width, x, wx), axis(t, c.height, y, wy);
    out->layers = page.layers;
    for (std::uint32_t layer = 0; layer < page.layers; ++layer)
        for (int j = 0; j < 2; ++j)
            for (int i = 0; i < 2; ++i) {
                const Rgb v = texel(*texels, page, layer, c.page_x + x[i], c.page_y + y[j]);
                for (std::size_t k = 0; k < 3; ++k) out->value[layer][k] += wx[i] * wy[j] * v[k];
            }
    return KILN_OK;
}

kiln_status luxel_of(const kiln_level& level, std::uint32_t face, const double point[3], std::uint32_t* chart,
                     double* s, double* t) {
    if (face >= level.info.faces) return KILN_BAD_ARGUMENT;
    const Faces* faces = level.get_faces();
    if (!faces) return level.fault_of(fourcc("FACE"));
    const Charts* charts = level.get_charts();
    if (!charts) return level.fault_of(fourcc("CHRT"));
    *chart = faces->rows[face].chart;
    if (*chart == KILN_NO_INDEX) return KILN_NONE;
    const kiln_chart& c = charts->rows[*chart];
    if (const kiln_face& f = faces->rows[face]; f.flags & KILN_FACE_CURVED) {
        double w[3];
        const std::uint32_t triangle = kiln_level_triangle_at(&level, face, point, w);
        if (triangle == KILN_NO_INDEX) return level.get_mesh() ? KILN_NONE : level.fault_of(fourcc("MESH"));
        const kiln_curve_corner* corners = kiln_level_curve_corners(&level, face, nullptr);
        if (!corners) return level.fault_of(fourcc("CRNR"));
        corners += std::size_t{3} * (triangle - f.first_triangle);
        *s = w[0] * corners[0].luxel[0] + w[1] * corners[1].luxel[0] + w[2] * corners[2].luxel[0];
        *t = w[0] * corners[0].luxel[1] + w[1] * corners[1].luxel[1] + w[2] * corners[2].luxel[1];
        return KILN_OK;
    }
    const double from[3] = {point[0] - c.origin[0], point[1] - c.origin[1], point[2] - c.origin[2]};
    *s = dot3(from, c.s) / c.luxel_size, *t = dot3(from, c.t) / c.luxel_size;
    return KILN_OK;
}

void flat_of(std::uint32_t encoding, const Stored& stored, float rgb[3]) {
    for (int k = 0; k < 3; ++k) {
        const float sum = stored.value[0][k] + stored.value[1][k] + stored.value[2][k];
        rgb[k] = stored.layers == 1   ? stored.value[0][k]
                 : stored.layers == 4 ? stored.value[3][k]
                                      : std::max(0.0f, encoding == KILN_RNM_SQ ? sum / 3 : sum * kSqrt13);
    }
}

kiln_status eval_luxel(const kiln_level& level, std::uint32_t chart, double s, double t, const float local[3],
                       float rgb[3]) {
    Stored stored;
    if (const kiln_status status = stored_at(level, chart, s, t, &stored); status != KILN_OK) return status;
    if (stored.layers == 1)
        flat_of(level.info.rnm_encoding, stored, rgb);
    else
        kiln_rnm_formula(static_cast<kiln_rnm_encoding>(level.info.rnm_encoding), stored.value, local, rgb);
    return KILN_OK;
}

// ---- Ambient

struct CornerWeights {
    const kiln_cube_cell* cell = nullptr;
    double weight[8] = {};
};
// Null where the level has none.
kiln_status behind_of(const kiln_level& level, const CubeBehind** behind) {
    *behind = level.get_cube_behind();
    return *behind || level.find(fourcc("CUBB")) == level.entries.size() ? KILN_OK : level.fault_of(fourcc("CUBB"));
}
// The cell of a point and the weights of its usable corners; false where there is no air.
bool corners_at(const Cubes& table, const CubeBehind* behind, const double point[3], CornerWeights* out) {
    const kiln_cube_tree& tree = table.tree;
    if (table.nodes.empty() || !(tree.root_size > 0)) return false;
    std::size_t root[3];
    double lo[3];
    for (int a = 0; a < 3; ++a) {
        const double f = std::floor((point[a] - tree.origin[a]) / static_cast<double>(tree.root_size));
        if (!(f >= 0) || f >= tree.root_count[a]) return false; // NaN too
        root[a] = static_cast<std::size_t>(f);
        lo[a] = tree.origin[a] + f * static_cast<double>(tree.root_size);
    }
    double size = tree.root_size;
    std::int32_t node = table.nodes[root[0] + tree.root_count[0] * (root[1] + tree.root_count[1] * root[2])];
    for (int depth = 0; node >= 0; ++depth) {
        if (depth > 40) return false; // only a damaged tree is so deep
        size /= 2;
        std::size_t child = 0;
        for (int a = 0; a < 3; ++a)
            if (point[a] >= lo[a] + size) lo[a] += size, child |= std::size_t{1} << a;
        node = table.nodes[static_cast<std::size_t>(node) + child];
    }
    if (node == INT32_MIN) return false;
    const kiln_cube_cell* cell = &table.cells[static_cast<std::size_t>(-(node + 1))];
    while (cell->beyond != KILN_NO_INDEX) {
        std::uint32_t next = cell->beyond; // always a later one
        if (!(dot3(cell->plane_normal, point) > cell->plane_distance))
            next = behind ? behind->cells[static_cast<std::size_t>(cell - table.cells.data())] : KILN_NO_INDEX;
        if (next == KILN_NO_INDEX) break;
        cell = &table.cells[next];
    }
    constexpr double kEdge = 1.0 / 1024; // keeps weights above zero where only the far corners may be used
    double f[3], sum = 0;
    for (int a = 0; a < 3; ++a) {
        f[a] = (point[a] - cell->lo[a]) / cell->size;
        f[a] = f[a] > kEdge ? std::min(f[a], 1 - kEdge) : kEdge;
    }
    for (unsigned c = 0; c < 8; ++c) {
        if (!(cell->mask >> c & 1)) continue;
        out->weight[c] = (c & 1 ? f[0] : 1 - f[0]) * (c & 2 ? f[1] : 1 - f[1]) * (c & 4 ? f[2] : 1 - f[2]);
        sum += out->weight[c];
    }
    if (!(sum > 0)) return false;
    for (double& w : out->weight) w /= sum;
    out->cell = cell;
    return true;
}

// ---- Cubemaps

// Face and coordinates in [-1,1] of a direction; inverse of kiln_cube_direction.
int cube_face(const double d[3], double* u, double* v) {
    const double a[3] = {std::abs(d[0]), std::abs(d[1]), std::abs(d[2])};
    if (a[0] >= a[1] && a[0] >= a[2]) {
        *u = (d[0] > 0 ? -d[2] : d[2]) / a[0], *v = -d[1] / a[0];
        return d[0] > 0 ? 0 : 1;
    }
    if (a[1] >= a[2]) {
        *u = d[0] / a[1], *v = (d[1] > 0 ? d[2] : -d[2]) / a[1];
        return d[1] > 0 ? 2 : 3;
    }
    *u = (d[2] > 0 ? d[0] : -d[0]) / a[2], *v = -d[1] / a[2];
    return d[2] > 0 ? 4 : 5;
}

struct Mip {
    const std::uint8_t* texels;
    std::int64_t size;
    Rgb at(int face, std::int64_t x, std::int64_t y) const {
        std::uint32_t packed = 0;
        std::memcpy(&packed, texels + 4 * ((face * size + y) * size + x), 4);
        return float_from_rgb9e5(packed);
    }
    // A texel that may lie one step over an edge: its neighbour on the next face.
    Rgb near(int face, std::int64_t x, std::int64_t y) const {
        if (x >= 0 && y >= 0 && x < size && y < size) return at(face, x, y);
        const auto centre = [&](std::int64_t i) { return (2 * static_cast<double>(i) + 1) / static_cast<double>(size) - 1; };
        float f[3];
        kiln_cube_direction(face, static_cast<float>(centre(x)), static_cast<float>(centre(y)), f);
        const double d[3] = {f[0], f[1], f[2]};
        double u = 0, v = 0;
        const int other = cube_face(d, &u, &v);
        const auto index = [&](double c) {
            return std::clamp<std::int64_t>(static_cast<std::int64_t>(std::floor((c + 1) / 2 * static_cast<double>(size))), 0,
                                            size - 1);
        };
        return at(other, index(u), index(v));
    }
    Rgb bilinear(int face, double u, double v) const {
        const double x = (u + 1) / 2 * static_cast<double>(size) - 0.5, y = (v + 1) / 2 * static_cast<double>(size) - 0.5;
        const double fx = std::floor(x), fy = std::floor(y);
        Rgb sum{};
        for (int j = 0; j < 2; ++j)
            for (int i = 0; i < 2; ++i) {
                const double w = (i ? x - fx : 1 - (x - fx)) * (j ? y - fy : 1 - (y - fy));
                if (w <= 0) continue;
                const Rgb t = near(face, static_cast<std::int64_t>(fx) + i, static_cast<std::int64_t>(fy) + j);
                for (std::size_t k = 0; k < 3; ++k) sum[k] += static_cast<float>(w) * t[k];
            }
        return sum;
    }
};

} // namespace

extern "C" {

void kiln_rnm_formula(kiln_rnm_encoding encoding, const float stored[3][3], const float local_normal[3], float rgb[3]) {
    float along[3], sum = 0;
    for (int i = 0; i < 3; ++i) {
        along[i] = static_cast<float>(dot3(kBasis[i], local_normal));
        if (encoding == KILN_RNM_SQ) along[i] = along[i] > 0 ? along[i] * along[i] : 0.0f;
        sum += along[i];
    }
    const float scale = encoding != KILN_RNM_SQ ? 1.0f : sum > 0 ? 1 / sum : 0.0f;
    for (int k = 0; k < 3; ++k)
        rgb[k] = std::max(0.0f, scale * (along[0] * stored[0][k] + along[1] * stored[1][k] + along[2] * stored[2][k]));
}

kiln_status kiln_level_page_info(const kiln_level* level, uint32_t page, kiln_page* info) {
    if (!level || !info || page >= level->info.pages) return KILN_BAD_ARGUMENT;
    const Charts* charts = level->get_charts();
    if (!charts) return level->fault_of(fourcc("CHRT"));
    const PageInfo& p = charts->pages[page];
    *info = {p.width, p.height, p.layers, p.format, p.scale, nullptr, static_cast<size_t>(page_size(p))};
    return KILN_OK;
}
kiln_status kiln_level_page(const kiln_level* level, uint32_t page, kiln_page* out) {
    if (const kiln_status status = kiln_level_page_info(level, page, out); status != KILN_OK) return status;
    const Blob* texels = level->get_page(page);
    if (!texels) return level->fault_of(fourcc("LMPG"), page);
    out->texels = texels->data();
    return KILN_OK;
}
kiln_status kiln_level_page_texel(const kiln_level* level, uint32_t page, uint32_t layer, uint32_t x, uint32_t y,
                                  float rgb[3]) {
    kiln_page info;
    if (!rgb) return KILN_BAD_ARGUMENT;
    if (const kiln_status status = kiln_level_page(level, page, &info); status != KILN_OK) return status;
    if (layer >= info.layers || x >= info.width || y >= info.height) return KILN_BAD_ARGUMENT;
    const Rgb v = texel(*level->get_page(page), level->get_charts()->pages[page], layer, x, y);
    std::copy(v.begin(), v.end(), rgb);
    return KILN_OK;
}
kiln_status kiln_level_page_quality(const kiln_level* level, uint32_t page, uint8_t* valid, float* error) {
    if (!level || page >= level->info.pages) return KILN_BAD_ARGUMENT;
    const Charts* charts = level->get_charts();
    if (!charts) return level->fault_of(fourcc("CHRT"));
    const Blob* quality = level->get_quality(page);
    if (!quality) return level->fault_of(fourcc("LMQA"), page);
    const std::size_t n = quality->size() / 2;
    if (valid) std::copy_n(quality->begin(), n, valid);
    if (error)
        for (std::size_t i = 0; i < n; ++i) error[i] = error_from_code((*quality)[n + i]);
    return KILN_OK;
}

kiln_status kiln_level_eval_flat(const kiln_level* level, uint32_t face, const double point[3], float rgb[3]) {
    if (!level || !point || !rgb) return KILN_BAD_ARGUMENT;
    std::uint32_t chart = 0;
    double s = 0, t = 0;
    if (const kiln_status status = luxel_of(*level, face, point, &chart, &s, &t); status != KILN_OK) return status;
    return kiln_level_eval_flat_luxel(level, chart, s, t, rgb);
}
kiln_status kiln_level_eval_flat_luxel(const kiln_level* level, uint32_t chart, double s, double t, float rgb[3]) {
    if (!level || !rgb) return KILN_BAD_ARGUMENT;
    Stored stored;
    if (const kiln_status status = stored_at(*level, chart, s, t, &stored); status != KILN_OK) return status;
    flat_of(level->info.rnm_encoding, stored, rgb);
    return KILN_OK;
}
kiln_status kiln_level_luxel_at(const kiln_level* level, uint32_t face, const double point[3], double st[2]) {
    if (!level || !point || !st) return KILN_BAD_ARGUMENT;
    std::uint32_t chart = 0;
    return luxel_of(*level, face, point, &chart, &st[0], &st[1]);
}
kiln_status kiln_level_eval_rnm_luxel(const kiln_level* level, uint32_t chart, double s, double t,
                                      const float local_normal[3], float rgb[3]) {
    if (!level || !local_normal || !rgb) return KILN_BAD_ARGUMENT;
    return eval_luxel(*level, chart, s, t, local_normal, rgb);
}
kiln_status kiln_level_eval_rnm_local(const kiln_level* level, uint32_t face, const double point[3],
                                      const float local_normal[3], float rgb[3]) {
    if (!level || !point || !local_normal || !rgb) return KILN_BAD_ARGUMENT;
    std::uint32_t chart = 0;
    double s = 0, t = 0;
    if (const kiln_status status = luxel_of(*level, face, point, &chart, &s, &t); status != KILN_OK) return status;
    return eval_luxel(*level, chart, s, t, local_normal, rgb);
}
kiln_status kiln_level_eval_rnm(const kiln_level* level, uint32_t face, const double point[3],
                                const float world_normal[3], float rgb[3]) {
    if (!level || !point || !world_normal || !rgb) return KILN_BAD_ARGUMENT;
    std::uint32_t chart = 0;
    double s = 0, t = 0;
    if (const kiln_status status = luxel_of(*level, face, point, &chart, &s, &t); status != KILN_OK) return status;
    const kiln_chart& c = level->get_charts()->rows[chart];
    float frame[3][3];
    std::copy_n(c.tangent, 3, frame[0]), std::copy_n(c.bitangent, 3, frame[1]), std::copy_n(c.normal, 3, frame[2]);
    if (c.directional && c.smooth) {
        float shading[3];
        if (const kiln_status status = kiln_level_shading_normal(level, face, point, shading); status != KILN_OK)
            return status;
        kiln_level_tangent_frame_at(level, face, point, shading, frame[0], frame[1], frame[2]);
    }
    float local[3];
    for (int i = 0; i < 3; ++i) local[i] = static_cast<float>(dot3(world_normal, frame[i]));
    return eval_luxel(*level, chart, s, t, local, rgb);
}

kiln_status kiln_level_cube_tree(const kiln_level* level, kiln_cube_tree* tree) {
    if (!level || !tree) return KILN_BAD_ARGUMENT;
    const Cubes* table = level->get_cubes();
    if (!table) return level->fault_of(fourcc("CUBE"));
    *tree = table->tree;
    return KILN_OK;
}
kiln_status kiln_level_ambient(const kiln_level* level, const double point[3], float rgb[6][3]) {
    if (!level || !point || !rgb) return KILN_BAD_ARGUMENT;
    const Cubes* table = level->get_cubes();
    if (!table) return level->fault_of(fourcc("CUBE"));
    const CubeBehind* behind = nullptr;
    if (const kiln_status status = behind_of(*level, &behind); status != KILN_OK) return status;
    CornerWeights corners;
    if (!corners_at(*table, behind, point, &corners)) return KILN_NONE;
    for (std::size_t i = 0; i < 18; ++i) {
        double sum = 0;
        for (std::size_t c = 0; c < 8; ++c)
            if (corners.weight[c] > 0)
                sum += corners.weight[c] * table->cubes[corners.cell->cubes[c]].irradiance[i / 3][i % 3];
        rgb[i / 3][i % 3] = static_cast<float>(sum);
    }
    return KILN_OK;
}
kiln_status kiln_level_ambient_eval(const kiln_level* level, const double point[3], const float normal[3],
                                    float rgb[3]) {
    if (!normal || !rgb) return KILN_BAD_ARGUMENT;
    float cube[6][3];
    if (const kiln_status status = kiln_level_ambient(level, point, cube); status != KILN_OK) return status;
    for (int k = 0; k < 3; ++k) {
        rgb[k] = 0;
        for (int a = 0; a < 3; ++a) rgb[k] += normal[a] * normal[a] * cube[2 * a + (normal[a] < 0 ? 1 : 0)][k];
        if (rgb[k] < 0) rgb[k] = 0; // a cube beside one strong lamp is negative on the far side
    }
    return KILN_OK;
}
kiln_status kiln_level_ambient_lights(const kiln_level* level, const double point[3], kiln_light_weight* out,
                                      size_t capacity, size_t* count) {
    if (!level || !point || !count || (capacity && !out)) return KILN_BAD_ARGUMENT;
    *count = 0;
    const Cubes* table = level->get_cubes();
    if (!table) return level->fault_of(fourcc("CUBE"));
    const CubeBehind* behind = nullptr;
    if (const kiln_status status = behind_of(*level, &behind); status != KILN_OK) return status;
    CornerWeights corners;
    if (!corners_at(*table, behind, point, &corners)) return KILN_NONE;
    try {
        std::map<std::uint32_t, double> shares;
        for (std::size_t c = 0; c < 8; ++c) {
            if (!(corners.weight[c] > 0)) continue;
            const kiln_cube& cube = table->cubes[corners.cell->cubes[c]];
            for (std::uint32_t i = 0; i < cube.light_count; ++i)
                shares[table->lights[std::size_t{cube.first_light} + i]] += corners.weight[c];
        }
        for (const auto& [light, share] : shares) {
            if (*count < capacity) out[*count] = {light, static_cast<float>(share)};
            ++*count;
        }
    } catch (const std::bad_alloc&) {
        return KILN_NO_MEMORY;
    }
    return KILN_OK;
}

void kiln_cube_direction(int face, float u, float v, float d[3]) {
    switch (face) {
    case 0: d[0] = 1, d[1] = -v, d[2] = -u; break;
    case 1: d[0] = -1, d[1] = -v, d[2] = u; break;
    case 2: d[0] = u, d[1] = 1, d[2] = v; break;
    case 3: d[0] = u, d[1] = -1, d[2] = -v; break;
    case 4: d[0] = u, d[1] = -v, d[2] = 1; break;
    default: d[0] = -u, d[1] = -v, d[2] = -1; break;
    }
}

const uint32_t* kiln_level_probe_texels(const kiln_level* level, uint32_t probe, size_t* count, float* scale) {
    if (count) *count = 0;
    const Blob* texels = level ? level->get_probe(probe) : nullptr;
    if (!texels) return nullptr;
    if (count) *count = texels->size() / 4;
    if (scale) *scale = level->get_probes()->scales[probe];
    return reinterpret_cast<const uint32_t*>(texels->data()); // from operator new: aligned
}

uint32_t kiln_level_nearest_cubemap(const kiln_level* level, const double point[3]) {
    const ProbeTable* table = level && point ? level->get_probes() : nullptr;
    if (!table) return KILN_NO_INDEX;
    const std::uint32_t leaf = kiln_level_find_leaf(level, point);
    const Leaves* leaves = level->get_leaves();
    if (leaves && leaf < leaves->rows.size() && leaves->rows[leaf].probe != KILN_NO_INDEX)
        return leaves->rows[leaf].probe;
    std::uint32_t best = KILN_NO_INDEX;
    double best_distance = 1e300;
    for (std::uint32_t i = 0; i < table->rows.size(); ++i) {
        double distance = 0;
        for (int k = 0; k < 3; ++k) {
            const double d = point[k] - table->rows[i].position[k];
            distance += d * d;
        }
        if (distance < best_distance) best = i, best_distance = distance;
    }
    return best;
}

kiln_status kiln_level_sample_cubemap(const kiln_level* level, uint32_t probe, const float direction[3],
                                      float roughness, float rgb[3]) {
    if (!level || !direction || !rgb || probe >= level->info.probes) return KILN_BAD_ARGUMENT;
    const ProbeTable* table = level->get_probes();
    if (!table) return level->fault_of(fourcc("PROB"));
    const Blob* texels = level->get_probe(probe);
    if (!texels) return level->fault_of(fourcc("PRBT"), probe);
    const kiln_probe& p = table->rows[probe];
    double d[3] = {direction[0], direction[1], direction[2]};
    const double largest = std::max(std::abs(d[0]), std::max(std::abs(d[1]), std::abs(d[2])));
    if (!(largest > 0) || !(largest < 1e30)) return KILN_BAD_ARGUMENT;
    if (d[0] != d[0] || d[1] != d[1] || d[2] != d[2]) return KILN_BAD_ARGUMENT;
    double u = 0, v = 0;
    const int face = cube_face(d, &u, &v);
    float level_of_detail = roughness > 0 ? std::min(roughness, 1.0f) * static_cast<float>(p.mips - 1) : 0.0f;
    const auto first = static_cast<std::uint32_t>(level_of_detail);
    const float blend = level_of_detail - static_cast<float>(first);
    const std::uint8_t* at = texels->data();
    std::fill(rgb, rgb + 3, 0.0f);
    for (std::uint32_t m = 0; m < p.mips; ++m) {
        const std::int64_t size = p.size >> m;
        const float weight = m == first ? 1 - blend : m == first + 1 ? blend : 0.0f;
        if (weight > 0) {
            const Rgb c = Mip{at, size}.bilinear(face, u, v);
            for (std::size_t k = 0; k < 3; ++k) rgb[k] += weight * c[k] * table->scales[probe];
        }
        at += 4 * 6 * size * size;
    }
    return KILN_OK;
}

// Source: S. Lagarde, "Image-based lighting approaches and parallax-corrected cubemap", 2012.
kiln_status kiln_level_parallax_direction(const kiln_level* level, uint32_t probe, const double point[3],
                                          const float direction[3], float corrected[3]) {
    if (!level || !point || !direction || !corrected || probe >= level->info.probes) return KILN_BAD_ARGUMENT;
    const ProbeTable* table = level->get_probes();
    if (!table) return level->fault_of(fourcc("PROB"));
    const kiln_probe& p = table->rows[probe];
    std::copy_n(direction, 3, corrected);
    if (!p.boxed) return KILN_OK;
    double distance = 1e300;
    for (int k = 0; k < 3; ++k) {
        if (direction[k] == 0) continue;
        const double wall = direction[k] > 0 ? p.box_hi[k] : p.box_lo[k];
        distance = std::min(distance, (wall - point[k]) / direction[k]);
    }
    if (!(distance > 0) || !(distance < 1e30)) return KILN_OK; // outside the box: as if infinitely far
    for (int k = 0; k < 3; ++k)
        corrected[k] = static_cast<float>(point[k] + distance * direction[k] - p.position[k]);
    return KILN_OK;
}

} // extern "C"

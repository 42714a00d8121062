// The run-time side, as the engine's code does it: find the cell, follow its wall planes, blend its corners.
#include "compiler/ambient/ambient.h"
#include "compiler/ambient/cell_weights.h"
#include "libs/core/check.h"

namespace kiln {

namespace {

const AmbientCell* cell_at(const Ambient& ambient, Vec3 point) {
    if (ambient.tree.empty()) return nullptr;
    const Vec3 in_roots = (point - ambient.origin) / static_cast<double>(ambient.root_size);
    std::array<std::size_t, 3> root{};
    for (std::size_t a = 0; a < 3; ++a) {
        const double f = std::floor(in_roots[a]);
        if (!(f >= 0) || f >= ambient.root_count[a]) return nullptr; // NaN too
        root[a] = static_cast<std::size_t>(f);
    }
    Vec3 lo = ambient.origin + Vec3{double(root[0]), double(root[1]), double(root[2])} * double(ambient.root_size);
    double size = ambient.root_size;
    std::int32_t node =
        ambient.tree[root[0] + ambient.root_count[0] * (root[1] + ambient.root_count[1] * root[2])];
    while (node >= 0) {
        size /= 2;
        std::int32_t child = 0;
        for (std::size_t a = 0; a < 3; ++a)
            if (point[a] >= lo[a] + size) lo[a] += size, child |= 1 << a;
        node = ambient.tree[static_cast<std::size_t>(node + child)];
    }
    if (node == INT32_MIN) return nullptr;
    const AmbientCell* cell = &ambient.cells[static_cast<std::size_t>(-(node + 1))];
    while (cell->beyond != UINT32_MAX) {
        const std::uint32_t next = dot(cell->plane_normal, point) > cell->plane_distance ? cell->beyond : cell->behind;
        if (next == UINT32_MAX) break;
        cell = &ambient.cells[next];
    }
    return cell;
}

} // namespace

std::optional<std::array<Rgb, 6>> ambient_at(const Ambient& ambient, Vec3 point) {
    const AmbientCell* cell = cell_at(ambient, point);
    if (!cell || !cell->mask) return std::nullopt;
    const auto weights = ambient::cell_weights(cell->lo, cell->size, cell->mask, point);
    std::array<Rgbd, 6> sum{};
    for (unsigned c = 0; c < 8; ++c)
        if (weights[c] > 0)
            for (std::size_t f = 0; f < 6; ++f)
                sum[f] += Rgbd(ambient.cubes[cell->cubes[c]].irradiance[f]) * weights[c];
    std::array<Rgb, 6> out{};
    for (std::size_t f = 0; f < 6; ++f) out[f] = Rgb(sum[f]);
    return out;
}

std::vector<std::pair<std::uint32_t, double>> ambient_lights_at(const Ambient& ambient, Vec3 point) {
    std::vector<std::pair<std::uint32_t, double>> lights;
    const AmbientCell* cell = cell_at(ambient, point);
    if (!cell || !cell->mask) return lights;
    const auto weights = ambient::cell_weights(cell->lo, cell->size, cell->mask, point);
    for (unsigned c = 0; c < 8; ++c) {
        if (!(weights[c] > 0)) continue;
        for (const std::uint32_t light : ambient.cubes[cell->cubes[c]].local_lights) {
            const auto at = std::find_if(lights.begin(), lights.end(), [&](const auto& l) { return l.first == light; });
            if (at == lights.end()) lights.emplace_back(light, weights[c]);
            else at->second += weights[c];
        }
    }
    std::sort(lights.begin(), lights.end());
    return lights;
}

void validate(const Ambient& ambient) {
    const std::size_t roots = std::size_t(ambient.root_count[0]) * ambient.root_count[1] * ambient.root_count[2];
    KILN_CHECK(ambient.tree.size() >= roots && (ambient.tree.size() - roots) % 8 == 0);
    std::vector<char> named(ambient.cells.size(), 0);
    for (std::size_t i = 0; i < ambient.tree.size(); ++i) {
        const std::int32_t node = ambient.tree[i];
        if (node == INT32_MIN) continue;
        if (node >= 0) {
            KILN_CHECK(static_cast<std::size_t>(node) >= roots && static_cast<std::size_t>(node) > i); // no cycles
            KILN_CHECK(static_cast<std::size_t>(node) + 8 <= ambient.tree.size());
        } else {
            const auto cell = static_cast<std::size_t>(-(node + 1));
            KILN_CHECK_OP(cell, <, ambient.cells.size());
            KILN_CHECK(!named[cell]++);
        }
    }
    for (std::size_t c = 0; c < ambient.cells.size(); ++c) {
        const AmbientCell& cell = ambient.cells[c];
        KILN_CHECK(cell.mask != 0 && cell.size > 0);
        for (unsigned i = 0; i < 8; ++i)
            KILN_CHECK(cell.mask >> i & 1 ? cell.cubes[i] < ambient.cubes.size() : cell.cubes[i] == UINT32_MAX);
        KILN_CHECK(cell.beyond != UINT32_MAX || cell.behind == UINT32_MAX);
        if (cell.beyond == UINT32_MAX) continue;
        if (cell.behind != UINT32_MAX) {
            KILN_CHECK(cell.behind > c && cell.behind < ambient.cells.size());
            KILN_CHECK(!named[cell.behind]++);
        }
        KILN_CHECK(cell.beyond > c && cell.beyond < ambient.cells.size());
        KILN_CHECK(!named[cell.beyond]++);
        KILN_CHECK(std::abs(dot(cell.plane_normal, cell.plane_normal) - 1) < 1e-6);
    }
    for (const char n : named) KILN_CHECK(n == 1); // every cell is reached, once
    for (const AmbientCube& cube : ambient.cubes)
        for (const Rgb& e : cube.irradiance) KILN_CHECK(std::isfinite(e.x) && std::isfinite(e.y) && std::isfinite(e.z));
    KILN_CHECK(std::isfinite(ambient.error_estimate));
}

} // namespace kiln

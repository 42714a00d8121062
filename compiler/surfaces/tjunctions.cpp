#include "compiler/surfaces/tjunctions.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

namespace kiln {
namespace {

// Candidates come from rounded coordinates (error below 2^-30 units in a world of 2^20), the exact test decides.
constexpr double kNear = 1e-5; // map units
constexpr double kCell = 64;   // map units: about the spacing of corners in real maps

using Cell = std::array<std::int32_t, 3>;
struct HashCell {
    std::size_t operator()(const Cell& c) const noexcept {
        std::uint64_t h = 0;
        for (const std::int32_t x : c) h = (h ^ static_cast<std::uint32_t>(x)) * 0x9E3779B97F4A7C15ull, h ^= h >> 29;
        return h;
    }
};
std::int32_t cell_of(double x) { return static_cast<std::int32_t>(std::floor(x / kCell)); }

struct Corners {
    std::unordered_map<Cell, std::vector<VertexId>, HashCell> cells;
    void add(VertexId v, Vec3 p) { cells[{cell_of(p.x), cell_of(p.y), cell_of(p.z)}].push_back(v); }

    // Calls visit(v) for all vertices in cells that the segment passes, slab by slab along its longest axis.
    template <class Visit> void along(Vec3 a, Vec3 b, const Visit& visit) const {
        const Vec3 d = b - a;
        std::size_t axis = 0;
        for (std::size_t i = 1; i < 3; ++i)
            if (std::abs(d[i]) > std::abs(d[axis])) axis = i;
        const std::int32_t first = cell_of(std::min(a[axis], b[axis]) - kNear), last = cell_of(std::max(a[axis], b[axis]) + kNear);
        const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
        for (std::int32_t k = first; k <= last; ++k) {
            const auto at = [&](double x) { return d[axis] == 0 ? 0.0 : std::clamp((x - a[axis]) / d[axis], 0.0, 1.0); };
            const double t0 = at(k * kCell - kNear), t1 = at((k + 1) * kCell + kNear);
            const auto range = [&](std::size_t i) {
                const double x0 = a[i] + d[i] * t0, x1 = a[i] + d[i] * t1;
                return std::array<std::int32_t, 2>{cell_of(std::min(x0, x1) - kNear), cell_of(std::max(x0, x1) + kNear)};
            };
            const auto [u0, u1] = range(u);
            const auto [v0, v1] = range(v);
            for (std::int32_t i = u0; i <= u1; ++i)
                for (std::int32_t j = v0; j <= v1; ++j) {
                    Cell c{};
                    c[axis] = k, c[u] = i, c[v] = j;
                    if (const auto it = cells.find(c); it != cells.end())
                        for (const VertexId id : it->second) visit(id);
                }
        }
    }
};

// Vertices strictly on the segment, from a to b, both on the two planes.
std::vector<VertexId> on_segment(const VertexTable& vertices, const Corners& corners, VertexId a, VertexId b, PlaneId p, PlaneId q) {
    const Vec3 pa = vertices.position(a), pb = vertices.position(b), d = pb - pa;
    const double dd = dot(d, d);
    struct Found {
        double t;
        VertexId v;
    };
    std::vector<Found> found;
    corners.along(pa, pb, [&](VertexId v) {
        if (v == a || v == b) return;
        const Vec3 at = vertices.position(v) - pa;
        const double t = dd > 0 ? dot(at, d) / dd : 0;
        const Vec3 off = at - d * t;
        if (t < -kNear || t > 1 + kNear || dot(off, off) > kNear * kNear) return;
        if (vertices.between(a, b, v, p, q)) found.push_back({t, v});
    });
    std::ranges::sort(found, [&](const Found& x, const Found& y) { return x.v != y.v && vertices.within(a, y.v, x.v); });
    std::vector<VertexId> out;
    for (const Found& f : found)
        if (out.empty() || out.back() != f.v) out.push_back(f.v);
    return out;
}

} // namespace

void insert_tjunctions(const VertexTable& vertices, std::span<const FaceOutlines> faces, Context& context) {
    Corners corners;
    std::vector<VertexId> unique;
    for (const FaceOutlines& face : faces)
        for (const Outline& loop : *face.loops) unique.insert(unique.end(), loop.vertices.begin(), loop.vertices.end());
    std::ranges::sort(unique);
    unique.erase(std::unique(unique.begin(), unique.end()), unique.end());
    for (const VertexId v : unique) corners.add(v, vertices.position(v));

    parallel_for(context, faces.size(), [&](std::size_t f) {
        for (Outline& loop : *faces[f].loops) {
            const std::size_t n = loop.vertices.size();
            Outline out;
            for (std::size_t k = 0; k < n; ++k) {
                const VertexId a = loop.vertices[k], b = loop.vertices[k + 1 == n ? 0 : k + 1];
                const std::vector<VertexId> on = on_segment(vertices, corners, a, b, faces[f].plane, loop.lines[k]);
                out.vertices.push_back(a);
                out.vertices.insert(out.vertices.end(), on.begin(), on.end());
                out.lines.insert(out.lines.end(), on.size() + 1, loop.lines[k]);
            }
            loop = std::move(out);
        }
    });
}

} // namespace kiln

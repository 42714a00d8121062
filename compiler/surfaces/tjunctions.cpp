#include "compiler/surfaces/tjunctions.h"
#include "compiler/surfaces/corner_cells.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <cmath>

namespace kiln {
namespace {

// Candidates come from rounded coordinates (error below 2^-30 units in a world of 2^20), the exact test decides.
constexpr double kNear = 1e-5; // map units

using Corners = CornerCells<VertexId>;

// Vertices strictly on the segment, from a to b, both on the two planes.
std::vector<VertexId> on_segment(const VertexTable& vertices, const Corners& corners, VertexId a, VertexId b, PlaneId p, PlaneId q) {
    const Vec3 pa = vertices.position(a), pb = vertices.position(b), d = pb - pa;
    const double dd = dot(d, d);
    struct Found {
        double t;
        VertexId v;
    };
    std::vector<Found> found;
    corners.along(pa, pb, kNear, [&](VertexId v) {
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

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

struct Found {
    std::size_t edge; // of the loop
    VertexId v;
};

// Vertices strictly on edge `edge` from a to b, both on the two planes, in the order from a.
void find_on_edge(const VertexTable& vertices, const Corners& corners, std::size_t edge, VertexId a, VertexId b, PlaneId p, PlaneId q, std::vector<Found>& found) {
    const Vec3 pa = vertices.position(a), pb = vertices.position(b), d = pb - pa;
    const double dd = dot(d, d);
    const std::size_t before = found.size();
    corners.along(pa, pb, kNear, [&](VertexId v, Vec3 position) {
        if (v == a || v == b) return;
        const Vec3 at = position - pa;
        const double t = dd > 0 ? dot(at, d) / dd : 0;
        const Vec3 off = at - d * t;
        if (t < -kNear || t > 1 + kNear || dot(off, off) > kNear * kNear) return;
        if (vertices.between(a, b, v, p, q)) found.push_back({edge, v});
    });
    std::sort(found.begin() + static_cast<std::ptrdiff_t>(before), found.end(),
              [&](const Found& x, const Found& y) { return x.v != y.v && vertices.within(a, y.v, x.v); });
}

} // namespace

void insert_tjunctions(const VertexTable& vertices, std::span<const FaceOutlines> faces, Context& context) {
    std::vector<bool> met(vertices.size(), false);
    std::vector<VertexId> unique;
    for (const FaceOutlines& face : faces)
        for (const Outline& loop : *face.loops)
            for (const VertexId v : loop.vertices)
                if (!met[v.at()]) met[v.at()] = true, unique.push_back(v);
    const Corners corners(unique, [&](VertexId v) { return vertices.position(v); });

    constexpr std::size_t kChunk = 64; // faces that share their scratch
    parallel_chunks(context, faces.size(), kChunk, [&](std::size_t begin, std::size_t end) {
        std::vector<Found> found;
        for (std::size_t f = begin; f < end; ++f)
            for (Outline& loop : *faces[f].loops) {
                const std::size_t n = loop.vertices.size();
                found.clear();
                for (std::size_t k = 0; k < n; ++k)
                    find_on_edge(vertices, corners, k, loop.vertices[k], loop.vertices[k + 1 == n ? 0 : k + 1], faces[f].plane, loop.lines[k], found);
                if (found.empty()) continue;
                // From the last to the first: each goes to its final place.
                loop.vertices.resize(n + found.size()), loop.lines.resize(n + found.size());
                std::size_t to = loop.vertices.size(), next = found.size();
                for (std::size_t k = n; k-- > 0;) {
                    const PlaneId line = loop.lines[k];
                    for (; next > 0 && found[next - 1].edge == k; --next) --to, loop.vertices[to] = found[next - 1].v, loop.lines[to] = line;
                    --to, loop.vertices[to] = loop.vertices[k], loop.lines[to] = line;
                }
            }
    });
}

} // namespace kiln

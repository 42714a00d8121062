#include "compiler/surfaces/adjacency.h"
#include "libs/core/check.h"
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <tuple>

namespace kiln {
namespace {

struct Edge {
    std::uint32_t shell, lo, hi; // vertices; shell: faces of one model that may be neighbours
    bool backward;               // runs from hi to lo
    std::uint32_t triangle, corner;
};

// How far one turns from face f through its air until face g is met; 2 pi where they lie on each other.
double air_angle(const Surfaces& s, std::uint32_t f, std::uint32_t g, Vec3 direction_f) {
    const Vec3 nf = s.faces[s.triangle_face[f].at()].normal, ng = s.faces[s.triangle_face[g].at()].normal;
    const Vec3 mf = cross(nf, direction_f), mg = cross(ng, -direction_f); // into the faces, across the edge
    double angle = std::atan2(dot(mg, nf), dot(mg, mf));
    if (angle < 1e-9) angle += 2 * std::numbers::pi;
    return angle;
}

class UnionFind {
public:
    explicit UnionFind(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0u); }
    std::uint32_t find(std::uint32_t x) {
        while (parent_[x] != x) x = parent_[x] = parent_[parent_[x]];
        return x;
    }
    void join(std::uint32_t a, std::uint32_t b) {
        a = find(a), b = find(b);
        if (a != b) parent_[std::max(a, b)] = std::min(a, b); // the root is the smallest
    }

private:
    std::vector<std::uint32_t> parent_;
};

std::vector<std::array<std::uint32_t, 3>> pair_edges(const Surfaces& s) {
    std::vector<Edge> edges;
    edges.reserve(s.triangles.size() * 3);
    for (std::uint32_t t = 0; t < s.triangles.size(); ++t) {
        const Face& face = s.faces[s.triangle_face[t].at()];
        const std::uint32_t shell = face.model.value * 2 + (face.hull ? 0 : 1);
        for (std::uint32_t c = 0; c < 3; ++c) {
            const std::uint32_t a = s.triangles[t][c], b = s.triangles[t][(c + 1) % 3];
            edges.push_back({shell, std::min(a, b), std::max(a, b), b < a, t, c});
        }
    }
    std::ranges::sort(edges, {}, [](const Edge& e) { return std::tuple(e.shell, e.lo, e.hi, e.backward, e.triangle, e.corner); });

    std::vector<std::array<std::uint32_t, 3>> across(s.triangles.size(), {Adjacency::kNone, Adjacency::kNone, Adjacency::kNone});
    const auto join = [&](const Edge& f, const Edge& g) {
        across[f.triangle][f.corner] = g.triangle;
        across[g.triangle][g.corner] = f.triangle;
    };
    for (std::size_t first = 0, last; first < edges.size(); first = last) {
        const auto key = [&](std::size_t i) { return std::tuple(edges[i].shell, edges[i].lo, edges[i].hi); };
        std::size_t middle = first;
        for (last = first; last < edges.size() && key(last) == key(first); ++last)
            if (!edges[last].backward) middle = last + 1;
        const std::size_t forward = middle - first, backward = last - middle;
        if (forward == 1 && backward == 1) {
            join(edges[first], edges[middle]);
            continue;
        }
        const Vec3 direction = normalize(s.positions[edges[first].hi] - s.positions[edges[first].lo]);
        std::vector<std::tuple<double, std::size_t, std::size_t>> choices;
        for (std::size_t f = first; f < middle; ++f)
            for (std::size_t g = middle; g < last; ++g)
                choices.emplace_back(air_angle(s, edges[f].triangle, edges[g].triangle, direction), f, g);
        std::ranges::sort(choices);
        for (const auto& [angle, f, g] : choices)
            if (across[edges[f].triangle][edges[f].corner] == Adjacency::kNone &&
                across[edges[g].triangle][edges[g].corner] == Adjacency::kNone)
                join(edges[f], edges[g]);
    }
    return across;
}

// A vertex of the half-edge mesh is a fan: the corners of one position that are joined edge by edge, so that the mesh
// is a manifold by construction (solids that touch in a vertex or an edge give several vertices of one position).
// Returns the fan of each corner, named by its smallest corner. Triangles that would still give an edge a third face
// are set apart: their pairs are removed.
std::vector<std::uint32_t> find_fans(const Surfaces& s, std::vector<std::array<std::uint32_t, 3>>& pairs) {
    const auto count = static_cast<std::uint32_t>(s.triangles.size());
    for (;;) {
        UnionFind corners(std::size_t{count} * 3);
        for (std::uint32_t t = 0; t < count; ++t)
            for (std::uint32_t c = 0; c < 3; ++c) {
                const std::uint32_t u = pairs[t][c];
                if (u == Adjacency::kNone || u < t) continue;
                for (const std::uint32_t end : {c, (c + 1) % 3})
                    for (std::uint32_t k = 0; k < 3; ++k)
                        if (s.triangles[u][k] == s.triangles[t][end]) corners.join(t * 3 + end, u * 3 + k);
            }
        std::vector<std::uint32_t> fan(std::size_t{count} * 3);
        for (std::uint32_t i = 0; i < fan.size(); ++i) fan[i] = corners.find(i);

        std::vector<std::array<std::uint32_t, 3>> edges; // from, to, triangle
        for (std::uint32_t i = 0; i < fan.size(); ++i) edges.push_back({fan[i], fan[i - i % 3 + (i + 1) % 3], i / 3});
        std::ranges::sort(edges);
        bool manifold = true;
        for (std::size_t i = 1; i < edges.size(); ++i) {
            if (edges[i][0] != edges[i - 1][0] || edges[i][1] != edges[i - 1][1]) continue;
            const std::uint32_t t = edges[i][2];
            manifold = false;
            for (std::uint32_t& u : pairs[t]) {
                if (u == Adjacency::kNone) continue;
                for (std::uint32_t& back : pairs[u])
                    if (back == t) back = Adjacency::kNone;
                u = Adjacency::kNone;
            }
        }
        if (manifold) return fan;
    }
}

} // namespace

Adjacency find_adjacency(const Surfaces& s) {
    const std::size_t count = s.triangles.size();
    std::vector<std::array<std::uint32_t, 3>> pairs = pair_edges(s);

    const std::vector<std::uint32_t> fan_of = find_fans(s, pairs);

    OpenMesh::TriMesh_ArrayKernelT<> mesh;
    using Vertex = OpenMesh::VertexHandle;
    std::vector<Vertex> vertex_of(count * 3);
    mesh.reserve(count, count * 3 / 2, count);
    std::vector<std::array<Vertex, 3>> mesh_corners(count);
    for (std::uint32_t t = 0; t < count; ++t) {
        std::array<Vertex, 3>& v = mesh_corners[t];
        for (std::uint32_t c = 0; c < 3; ++c) {
            Vertex& shared = vertex_of[fan_of[t * 3 + c]];
            if (!shared.is_valid()) shared = mesh.new_vertex(); // its position is of no interest here
            v[c] = shared;
        }
        OpenMesh::FaceHandle f = mesh.add_face(v[0], v[1], v[2]);
        if (!f.is_valid()) { // the library refuses what is no manifold; the triangle then stands by itself
            for (Vertex& own : v) own = mesh.new_vertex();
            f = mesh.add_face(v[0], v[1], v[2]);
        }
        KILN_CHECK(f.is_valid() && f.idx() == static_cast<int>(t));
    }

    Adjacency a;
    a.across.assign(count, {Adjacency::kNone, Adjacency::kNone, Adjacency::kNone});
    a.fan.resize(count);
    a.fan_first.push_back(0);
    for (const auto v : mesh.vertices()) {
        std::vector<std::uint32_t> around;
        for (const auto f : v.faces()) around.push_back(static_cast<std::uint32_t>(f.idx()));
        std::ranges::sort(around);
        a.fan_triangles.insert(a.fan_triangles.end(), around.begin(), around.end());
        a.fan_first.push_back(static_cast<std::uint32_t>(a.fan_triangles.size()));
    }
    for (const auto f : mesh.faces()) {
        const auto t = static_cast<std::uint32_t>(f.idx());
        for (const auto h : f.halfedges())
            for (std::size_t c = 0; c < 3; ++c) {
                if (mesh_corners[t][c] != h.from()) continue;
                a.fan[t][c] = static_cast<std::uint32_t>(h.from().idx());
                if (const auto g = h.opp().face(); g.is_valid()) a.across[t][c] = static_cast<std::uint32_t>(g.idx());
            }
    }
    return a;
}

} // namespace kiln

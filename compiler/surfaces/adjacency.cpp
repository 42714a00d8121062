#include "compiler/surfaces/adjacency.h"
#include "libs/core/check.h"
#include "libs/core/union_find.h"
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <tuple>

namespace kiln {
namespace {

using Corners = std::vector<std::array<std::uint32_t, 3>>; // something for each corner or edge of each triangle

// How far one turns from face f through its air until face g is met; 2 pi where they lie on each other.
double air_angle(const Surfaces& s, std::uint32_t f, std::uint32_t g, Vec3 direction_f) {
    const Vec3 nf = s.faces[s.triangle_face[f].at()].normal, ng = s.faces[s.triangle_face[g].at()].normal;
    const Vec3 mf = cross(nf, direction_f), mg = cross(ng, -direction_f); // into the faces, across the edge
    double angle = std::atan2(dot(mg, nf), dot(mg, mf));
    if (angle < 1e-9) angle += 2 * std::numbers::pi;
    return angle;
}

struct Edge { // between a vertex and a greater one
    std::uint32_t hi;
    std::uint32_t at; // 6 * triangle + 2 * corner + 1 where it runs from hi
    std::uint32_t triangle() const { return at / 6; }
    std::uint32_t corner() const { return at % 6 / 2; }
    bool backward() const { return at & 1; }
};

// Pairs edges by their ends. `crowded`: the edges of those groups that are more than one or two that answer each other.
Corners pair_edges(const Surfaces& s, std::vector<std::uint32_t>& crowded) {
    const auto count = static_cast<std::uint32_t>(s.triangles.size());
    KILN_CHECK_OP(s.triangles.size(), <, std::size_t{UINT32_MAX} / 6);
    // Edges side by side by their lesser vertex: some six each, so that little is left to sort.
    std::vector<std::uint32_t> first(s.positions.size() + 1, 0);
    for (const auto& t : s.triangles)
        for (std::size_t c = 0; c < 3; ++c) ++first[std::min(t[c], t[(c + 1) % 3]) + 1];
    std::partial_sum(first.begin(), first.end(), first.begin());
    std::vector<Edge> edges(std::size_t{count} * 3);
    {
        std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
        for (std::uint32_t t = 0; t < count; ++t)
            for (std::uint32_t c = 0; c < 3; ++c) {
                const std::uint32_t a = s.triangles[t][c], b = s.triangles[t][(c + 1) % 3];
                edges[next[std::min(a, b)]++] = {std::max(a, b), t * 6 + c * 2 + (b < a ? 1u : 0u)};
            }
    }
    // Faces of one shell may be neighbours.
    const auto shell_of = [&](const Edge& e) {
        const Face& face = s.faces[s.triangle_face[e.triangle()].at()];
        return face.model.value * 2 + (face.hull ? 0 : 1);
    };
    Corners across(count, {Adjacency::kNone, Adjacency::kNone, Adjacency::kNone});
    const auto join = [&](const Edge& f, const Edge& g) {
        across[f.triangle()][f.corner()] = g.triangle();
        across[g.triangle()][g.corner()] = f.triangle();
    };
    std::vector<std::tuple<double, std::uint32_t, std::uint32_t>> choices;
    for (std::uint32_t lo = 0; lo < s.positions.size(); ++lo) {
        const std::span around(edges.data() + first[lo], first[lo + 1] - first[lo]);
        std::ranges::sort(around, {}, [](const Edge& e) { return std::tuple(e.hi, e.at); });
        for (std::size_t begin = 0, end; begin < around.size(); begin = end) {
            for (end = begin + 1; end < around.size() && around[end].hi == around[begin].hi; ++end) {}
            if (end - begin == 1) continue;
            if (end - begin == 2 && around[begin].backward() != around[begin + 1].backward()) {
                if (shell_of(around[begin]) == shell_of(around[begin + 1])) join(around[begin], around[begin + 1]);
                continue;
            }
            const std::span all = around.subspan(begin, end - begin);
            for (const Edge& e : all) crowded.push_back(e.at / 2);
            std::ranges::sort(all, {}, [&](const Edge& e) { return std::tuple(shell_of(e), e.backward(), e.at); });
            const Vec3 direction = normalize(s.positions[all[0].hi] - s.positions[lo]);
            for (std::size_t from = 0, to; from < all.size(); from = to) { // of one shell
                std::size_t middle = from;
                for (to = from; to < all.size() && shell_of(all[to]) == shell_of(all[from]); ++to)
                    if (!all[to].backward()) middle = to + 1;
                if (middle - from == 1 && to - middle == 1) {
                    join(all[from], all[middle]);
                    continue;
                }
                choices.clear();
                for (std::size_t f = from; f < middle; ++f)
                    for (std::size_t g = middle; g < to; ++g)
                        choices.emplace_back(air_angle(s, all[f].triangle(), all[g].triangle(), direction), static_cast<std::uint32_t>(f), static_cast<std::uint32_t>(g));
                std::ranges::sort(choices);
                for (const auto& [angle, f, g] : choices)
                    if (across[all[f].triangle()][all[f].corner()] == Adjacency::kNone && across[all[g].triangle()][all[g].corner()] == Adjacency::kNone)
                        join(all[f], all[g]);
            }
        }
    }
    return across;
}

// Some triangles, ascending, and the fans of their corners: corners of one position that are joined edge by edge. A fan
// is named by its smallest corner.
struct Fans {
    std::vector<std::uint32_t> triangles;
    Corners fan; // parallel to triangles: 3 * index in triangles + corner
};

Fans find_fans(const Surfaces& s, const Corners& pairs, std::vector<std::uint32_t> triangles) {
    Fans out;
    out.triangles = std::move(triangles);
    const auto count = static_cast<std::uint32_t>(out.triangles.size());
    std::vector<std::uint32_t> index_of;
    if (count < s.triangles.size()) {
        index_of.assign(s.triangles.size(), Adjacency::kNone);
        for (std::uint32_t i = 0; i < count; ++i) index_of[out.triangles[i]] = i;
    }
    UnionFind corners(std::size_t{count} * 3);
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::uint32_t t = out.triangles[i];
        for (std::uint32_t c = 0; c < 3; ++c) {
            const std::uint32_t u = pairs[t][c];
            if (u == Adjacency::kNone || u < t) continue;
            const std::uint32_t j = index_of.empty() ? u : index_of[u];
            if (j == Adjacency::kNone) continue;
            for (const std::uint32_t end : {c, (c + 1) % 3})
                for (std::uint32_t k = 0; k < 3; ++k)
                    if (s.triangles[u][k] == s.triangles[t][end]) corners.join(i * 3 + end, j * 3 + k);
        }
    }
    out.fan.resize(count);
    for (std::uint32_t i = 0; i < count; ++i)
        for (std::uint32_t c = 0; c < 3; ++c) out.fan[i][c] = corners.find(i * 3 + c);
    return out;
}

// The triangles with a corner where `wanted` says so.
std::vector<std::uint32_t> triangles_at(const Surfaces& s, const std::vector<bool>& wanted) {
    std::vector<std::uint32_t> triangles;
    for (std::uint32_t t = 0; t < s.triangles.size(); ++t)
        if (std::ranges::any_of(s.triangles[t], [&](std::uint32_t p) { return wanted[p]; })) triangles.push_back(t);
    return triangles;
}

// Makes a manifold of what meets in crowded edges: a vertex of it is a fan (solids that touch in a vertex or an edge give
// several vertices of one position). Triangles that would still give an edge a third face are set apart: their pairs are
// removed. Edges without a pair whose fans answer each other become one. Nothing of this can happen elsewhere.
void make_manifold(const Surfaces& s, const std::vector<std::uint32_t>& crowded, Corners& pairs) {
    if (crowded.empty()) return;
    std::vector<bool> wanted(s.positions.size(), false), is_crowded(s.triangles.size() * 3, false);
    for (const std::uint32_t e : crowded) {
        is_crowded[e] = true;
        for (const std::uint32_t end : {e % 3, (e + 1) % 3}) wanted[s.triangles[e / 3][end]] = true;
    }
    const std::vector<std::uint32_t> triangles = triangles_at(s, wanted);
    for (bool manifold = false; !manifold;) {
        manifold = true;
        const Fans fans = find_fans(s, pairs, triangles);
        std::vector<std::array<std::uint32_t, 4>> edges; // from, to, triangle, corner
        for (std::size_t i = 0; i < triangles.size(); ++i)
            for (std::uint32_t c = 0; c < 3; ++c)
                if (is_crowded[triangles[i] * 3 + c]) edges.push_back({fans.fan[i][c], fans.fan[i][(c + 1) % 3], triangles[i], c});
        std::ranges::sort(edges);
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
        for (const auto& [from, to, t, c] : edges) {
            if (!manifold) break;
            const auto answer = std::ranges::lower_bound(edges, std::array<std::uint32_t, 4>{to, from, 0, 0});
            if (answer != edges.end() && (*answer)[0] == to && (*answer)[1] == from) pairs[t][c] = (*answer)[2];
        }
    }
}

// Around each vertex of a half-edge mesh.
void find_fans_of(const Surfaces& s, const std::vector<bool>& fans_of, Adjacency& a) {
    std::vector<bool> wanted(s.positions.size(), false);
    for (std::size_t t = 0; t < s.triangles.size(); ++t)
        if (fans_of[s.triangle_face[t].at()])
            for (const std::uint32_t p : s.triangles[t]) wanted[p] = true;
    const Fans fans = find_fans(s, a.across, triangles_at(s, wanted));
    const std::size_t count = fans.triangles.size();
    a.fan_first.push_back(0);
    if (count == 0) return;

    OpenMesh::TriMesh_ArrayKernelT<> mesh;
    using Vertex = OpenMesh::VertexHandle;
    std::vector<Vertex> vertex_of(count * 3);
    mesh.reserve(count, count * 3 / 2, count);
    a.fan.assign(s.triangles.size(), {Adjacency::kNone, Adjacency::kNone, Adjacency::kNone});
    for (std::uint32_t i = 0; i < count; ++i) {
        std::array<Vertex, 3> v;
        for (std::uint32_t c = 0; c < 3; ++c) {
            Vertex& shared = vertex_of[fans.fan[i][c]];
            if (!shared.is_valid()) shared = mesh.new_vertex(); // its position is of no interest here
            v[c] = shared;
        }
        OpenMesh::FaceHandle f = mesh.add_face(v[0], v[1], v[2]);
        if (!f.is_valid()) { // the library refuses what is no manifold; the triangle then stands by itself
            for (Vertex& own : v) own = mesh.new_vertex();
            f = mesh.add_face(v[0], v[1], v[2]);
        }
        KILN_CHECK(f.is_valid() && f.idx() == static_cast<int>(i));
        for (std::size_t c = 0; c < 3; ++c) a.fan[fans.triangles[i]][c] = static_cast<std::uint32_t>(v[c].idx());
    }
    std::vector<std::uint32_t> around;
    for (const auto v : mesh.vertices()) {
        around.clear();
        for (const auto f : v.faces()) around.push_back(fans.triangles[static_cast<std::size_t>(f.idx())]);
        std::ranges::sort(around);
        a.fan_triangles.insert(a.fan_triangles.end(), around.begin(), around.end());
        a.fan_first.push_back(static_cast<std::uint32_t>(a.fan_triangles.size()));
    }
}

} // namespace

Adjacency find_adjacency(const Surfaces& s, const std::vector<bool>& fans_of) {
    Adjacency a;
    std::vector<std::uint32_t> crowded;
    a.across = pair_edges(s, crowded);
    make_manifold(s, crowded, a.across);
    find_fans_of(s, fans_of, a);
    return a;
}

} // namespace kiln

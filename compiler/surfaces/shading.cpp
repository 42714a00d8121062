#include "compiler/surfaces/shading.h"
#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

namespace kiln {
namespace {

// Displacements that meet are one terrain, whatever the angle. Patches may be meant to have an edge where they meet.
bool curves_smooth_together(const Surfaces& s, const Face& f, const Face& g) {
    if (!f.curved() || !g.curved()) return false;
    constexpr double kPatchEdge = 0.70710678; // cosine of 45 degrees
    if (s.curves[f.curve].kind != s.curves[g.curve].kind) return false;
    return f.curve == g.curve || s.curves[f.curve].kind == Curve::displacement || dot(f.normal, g.normal) > kPatchEdge;
}


// Common bits of these groups make an edge hard, whatever other groups the faces share.
constexpr std::uint32_t kHardEdgeGroups = 0xFF000000;

// Whether two faces round a vertex meet in a groove: there each lies in front of the other's plane. Triangles that share an edge
// tell; where none do, all of both faces round the vertex. The sum makes it one answer for both faces.
bool in_groove(const Surfaces& s, std::span<const std::uint32_t> fan, FaceId f, FaceId g, std::uint32_t vertex) {
    double at_edges = 0, anywhere = 0;
    bool edge = false;
    const Vec3 v = s.positions[vertex];
    const auto middle = [&](std::uint32_t t) { return (s.positions[s.triangles[t][0]] + s.positions[s.triangles[t][1]] + s.positions[s.triangles[t][2]]) / 3.0; };
    for (const std::uint32_t t : fan)
        for (const std::uint32_t u : fan) {
            if (s.triangle_face[t] != f || s.triangle_face[u] != g) continue;
            std::size_t shared = 0;
            for (const std::uint32_t p : s.triangles[t]) shared += static_cast<std::size_t>(std::ranges::count(s.triangles[u], p));
            const double height = dot(s.faces[f.at()].normal, normalize(middle(u) - v)) + dot(s.faces[g.at()].normal, normalize(middle(t) - v));
            anywhere += height;
            if (shared >= 2) edge = true, at_edges += height;
        }
    return (edge ? at_edges : anywhere) > 0;
}

template <class Groove> bool smooth_together(const Surfaces& s, const FaceDraft& f, const FaceDraft& g, Groove&& groove) {
    if (f.face.curved() || g.face.curved()) return curves_smooth_together(s, f.face, g.face); // drawn or buried
    if (!f.face.drawn || !g.face.drawn) return false;
    const std::uint32_t common = f.smoothing_groups & g.smoothing_groups;
    if (f.smoothing_groups || g.smoothing_groups) return common != 0 && (common & kHardEdgeGroups) == 0;
    if (f.phong_group != g.phong_group) return false;
    double limit = std::min(f.phong_angle_deg, g.phong_angle_deg);
    if (!(limit > 0)) return false;
    if ((f.phong_concave_deg > 0 || g.phong_concave_deg > 0) && groove()) {
        const auto angle = [](const FaceDraft& d) { return d.phong_concave_deg > 0 ? d.phong_concave_deg : d.phong_angle_deg; };
        limit = std::min(angle(f), angle(g));
    }
    constexpr double kSlack = 1e-9; // an edge of exactly the limit is smooth
    return dot(f.face.normal, g.face.normal) >= std::cos(limit * std::numbers::pi / 180) - kSlack;
}

// Angle of triangle t at the corner that has the vertex; 0 where rounding left no triangle.
double angle_at(const Surfaces& s, std::uint32_t t, std::uint32_t vertex) {
    const auto& tri = s.triangles[t];
    std::size_t c = 0;
    while (c < 2 && tri[c] != vertex) ++c;
    const Vec3 a = s.positions[tri[(c + 1) % 3]] - s.positions[tri[c]], b = s.positions[tri[(c + 2) % 3]] - s.positions[tri[c]];
    return std::atan2(length(cross(a, b)), dot(a, b));
}

} // namespace

bool may_smooth(const FaceDraft& d) {
    return d.face.curved() || (d.face.drawn && (d.smoothing_groups != 0 || d.phong_angle_deg > 0));
}

void shade_corners(Surfaces& s, const std::vector<FaceDraft>& drafts, const Adjacency& adjacency) {
    s.corner_normals.resize(s.triangles.size());
    for (std::uint32_t t = 0; t < s.triangles.size(); ++t) {
        const FaceDraft& own = drafts[s.triangle_face[t].at()];
        s.corner_normals[t].fill(Vec3f(own.face.normal));
        if (!may_smooth(own)) continue;
        for (std::size_t c = 0; c < 3; ++c) {
            const std::uint32_t fan = adjacency.fan[t][c];
            const std::span around(adjacency.fan_triangles.data() + adjacency.fan_first[fan], adjacency.fan_first[fan + 1] - adjacency.fan_first[fan]);
            Vec3 sum;
            bool bent = false;
            for (const std::uint32_t u : around) {
                const FaceDraft& other = drafts[s.triangle_face[u].at()];
                const bool same = s.triangle_face[u] == s.triangle_face[t];
                const auto groove = [&] { return in_groove(s, around, s.triangle_face[t], s.triangle_face[u], s.triangles[t][c]); };
                if (!same && !smooth_together(s, own, other, groove)) continue;
                bent = bent || other.face.plane != own.face.plane || (own.face.curved() && other.face.normal != own.face.normal);
                sum += other.face.normal * angle_at(s, u, s.triangles[t][c]);
            }
            constexpr double kCancelled = 1e-6; // normals that cancel out leave no direction to shade by
            if (bent && length(sum) > kCancelled) s.corner_normals[t][c] = Vec3f(normalize(sum));
        }
    }
}

} // namespace kiln

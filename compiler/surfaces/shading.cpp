#include "compiler/surfaces/shading.h"
#include <algorithm>
#include <cmath>
#include <numbers>

namespace kiln {
namespace {

bool may_smooth(const FaceDraft& d) {
    return d.face.curved() || (d.face.drawn && (d.smoothing_groups != 0 || d.phong_angle_deg > 0));
}

// Displacements that meet are one terrain, whatever the angle. Patches may be meant to have an edge where they meet.
bool curves_smooth_together(const Surfaces& s, const Face& f, const Face& g) {
    if (!f.curved() || !g.curved()) return false;
    constexpr double kPatchEdge = 0.70710678; // cosine of 45 degrees
    if (s.curves[f.curve].kind != s.curves[g.curve].kind) return false;
    return f.curve == g.curve || s.curves[f.curve].kind == Curve::displacement || dot(f.normal, g.normal) > kPatchEdge;
}

bool smooth_together(const Surfaces& s, const FaceDraft& f, const FaceDraft& g) {
    if (f.face.curved() || g.face.curved()) return curves_smooth_together(s, f.face, g.face); // drawn or buried
    if (!f.face.drawn || !g.face.drawn) return false;
    if (f.smoothing_groups || g.smoothing_groups) return (f.smoothing_groups & g.smoothing_groups) != 0;
    const double limit = std::min(f.phong_angle_deg, g.phong_angle_deg);
    if (!(limit > 0)) return false;
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

void shade_corners(Surfaces& s, const std::vector<FaceDraft>& drafts, const Adjacency& adjacency) {
    s.corner_normals.resize(s.triangles.size());
    for (std::uint32_t t = 0; t < s.triangles.size(); ++t) {
        const FaceDraft& own = drafts[s.triangle_face[t].at()];
        s.corner_normals[t].fill(Vec3f(own.face.normal));
        if (!may_smooth(own)) continue;
        for (std::size_t c = 0; c < 3; ++c) {
            const std::uint32_t fan = adjacency.fan[t][c];
            Vec3 sum;
            bool bent = false;
            for (std::uint32_t i = adjacency.fan_first[fan]; i < adjacency.fan_first[fan + 1]; ++i) {
                const std::uint32_t u = adjacency.fan_triangles[i];
                const FaceDraft& other = drafts[s.triangle_face[u].at()];
                const bool same = s.triangle_face[u] == s.triangle_face[t];
                if (!same && !smooth_together(s, own, other)) continue;
                bent = bent || other.face.plane != own.face.plane || (own.face.curved() && other.face.normal != own.face.normal);
                sum += other.face.normal * angle_at(s, u, s.triangles[t][c]);
            }
            constexpr double kCancelled = 1e-6; // normals that cancel out leave no direction to shade by
            if (bent && length(sum) > kCancelled) s.corner_normals[t][c] = Vec3f(normalize(sum));
        }
    }
}

} // namespace kiln

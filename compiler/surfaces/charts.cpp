#include "compiler/surfaces/charts.h"
#include "libs/core/check.h"
#include "libs/core/union_find.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <tuple>

namespace kiln {
namespace {

struct Extent {
    double lo[2] = {1e300, 1e300}, hi[2] = {-1e300, -1e300};
};

// First and last lattice lines around an extent; a border within rounding of a line is on it.
constexpr double kOnLine = 1e-7; // luxels
double line_below(double x, double size) { return std::floor(x / size + kOnLine); }
double line_above(double x, double size) { return std::ceil(x / size - kOnLine); }

// Both triangles shade the edge alike.
bool shaded_alike(const Surfaces& s, std::uint32_t t, std::size_t edge, std::uint32_t u) {
    for (const std::size_t end : {edge, (edge + 1) % 3})
        for (std::size_t k = 0; k < 3; ++k)
            if (s.triangles[u][k] == s.triangles[t][end] && s.corner_normals[u][k] != s.corner_normals[t][end]) return false;
    return true;
}

// One chart, but the edge lies at two places of it: a curve that closes upon itself.
bool is_parted(const Surfaces& s, std::uint32_t t, std::size_t edge, std::uint32_t u) {
    constexpr double kSamePlace = 1e-6; // luxels
    for (std::size_t k = 0; k < 3; ++k)
        if (s.triangles[u][k] == s.triangles[t][edge]) {
            const Vec2 d = s.corners_of(u)[k].luxel - s.corners_of(t)[edge].luxel;
            return std::max(std::abs(d.x), std::abs(d.y)) > kSamePlace;
        }
    return false;
}

std::vector<Seam> find_seams(const Surfaces& s, const std::vector<FaceDraft>& drafts, const Adjacency& adjacency) {
    std::vector<Seam> seams;
    for (std::uint32_t t = 0; t < s.triangles.size(); ++t)
        for (std::size_t c = 0; c < 3; ++c) {
            const std::uint32_t u = adjacency.across[t][c];
            if (u == Adjacency::kNone || u < t) continue;
            const Face &f = s.faces[s.triangle_face[t].at()], &g = s.faces[s.triangle_face[u].at()];
            // Light ends at the foot of what stands there.
            if (drafts[s.triangle_face[t].at()].under != drafts[s.triangle_face[u].at()].under) continue;
            if (!f.chart.valid() || !g.chart.valid() || (f.chart == g.chart && !(f.curved() && is_parted(s, t, c, u)))) continue;
            if ((f.plane != g.plane || f.curved()) && !shaded_alike(s, t, c, u)) continue;
            seams.push_back({std::min(f.chart, g.chart), std::max(f.chart, g.chart), s.triangles[t][c], s.triangles[t][(c + 1) % 3]});
        }
    std::ranges::sort(seams, {}, [](const Seam& e) { return std::tuple(e.chart_a, e.chart_b, e.from, e.to); });
    return seams;
}

} // namespace

std::uint64_t make_charts(Surfaces& s, const std::vector<FaceDraft>& drafts, std::vector<Chart> curve_charts,
                          const Adjacency& adjacency, const World& world, Context& context) {
    UnionFind together(s.faces.size());
    for (std::size_t t = 0; t < s.triangles.size(); ++t)
        for (const std::uint32_t u : adjacency.across[t]) {
            if (u == Adjacency::kNone) continue;
            const std::uint32_t f = s.triangle_face[t].value, g = s.triangle_face[u].value;
            if (f >= g || !share_chart(drafts[f], drafts[g])) continue;
            together.join(f, g);
        }

    std::vector<Extent> extents;
    for (std::uint32_t f = 0; f < s.faces.size(); ++f) { // ascending: a root comes before its members
        if (!drafts[f].lit || drafts[f].face.curved()) continue;
        Face& face = s.faces[f];
        if (together.find(f) == f) {
            Chart chart;
            chart.n = face.normal;
            chart.frame = face.tangent;
            chart.s = face.tangent.t;
            chart.t = cross(chart.n, chart.s);
            chart.luxel_size = drafts[f].luxel_size;
            face.chart = id<ChartId>(s.charts.size());
            s.charts.push_back(std::move(chart));
            extents.emplace_back();
        }
        face.chart = s.faces[together.find(f)].chart;
        Chart& chart = s.charts[face.chart.at()];
        chart.faces.push_back({f});
        Extent& e = extents[face.chart.at()];
        for (std::uint32_t t = face.first_triangle; t < face.first_triangle + face.triangle_count; ++t)
            for (std::size_t c = 0; c < 3; ++c) {
                const Vec3 p = s.positions[s.triangles[t][c]];
                const double x[2] = {dot(p, chart.s), dot(p, chart.t)};
                for (int i = 0; i < 2; ++i) e.lo[i] = std::min(e.lo[i], x[i]), e.hi[i] = std::max(e.hi[i], x[i]);
                chart.smooth = chart.smooth || s.corner_normals[t][c] != Vec3f(face.normal);
            }
    }

    const Vec3 corner = least_corner(s);
    std::uint64_t texels = 0;
    for (std::size_t c = 0; c < s.charts.size(); ++c) {
        Chart& chart = s.charts[c];
        const Extent& e = extents[c];
        const double wanted = chart.luxel_size;
        double first[2], count[2], anchor[2];
        for (;; chart.luxel_size *= 2) {
            // Lines along the axes of the world lie on its grid; slanted ones are counted from a point of it by the map's corner, so that all move with the map.
            Vec3 grid;
            for (std::size_t k = 0; k < 3; ++k) grid[k] = line_below(corner[k], chart.luxel_size) * chart.luxel_size;
            anchor[0] = dot(grid, chart.s), anchor[1] = dot(grid, chart.t);
            for (int i = 0; i < 2; ++i) {
                first[i] = line_below(e.lo[i] - anchor[i], chart.luxel_size);
                count[i] = std::max(1.0, line_above(e.hi[i] - anchor[i], chart.luxel_size) - first[i]) + 2; // and the gutter
            }
            if (count[0] <= kMaxChartTexels && count[1] <= kMaxChartTexels) break;
        }
        if (chart.luxel_size != wanted)
            context.report(Severity::warning, "chart-too-large",
                           fmt::format("the surface needs more than {} luxels of {} units; they became {} units", kMaxChartTexels,
                                       wanted, chart.luxel_size),
                           world.location(s.faces[chart.faces.front().at()].side));
        chart.origin = chart.s * (anchor[0] + (first[0] - 1) * chart.luxel_size) + chart.t * (anchor[1] + (first[1] - 1) * chart.luxel_size) +
                       chart.n * s.faces[chart.faces.front().at()].distance;
        chart.width = static_cast<std::uint32_t>(count[0]);
        chart.height = static_cast<std::uint32_t>(count[1]);
        chart.first_texel = static_cast<std::uint32_t>(texels);
        texels += std::uint64_t{chart.width} * chart.height;
    }
    for (std::size_t c = 0; c < s.curves.size(); ++c) { // their lattice stands
        const Curve& curve = s.curves[c];
        Chart& chart = curve_charts[c];
        for (std::uint32_t f = curve.first_face; f < curve.first_face + curve.face_count; ++f)
            if (drafts[f].lit) chart.faces.push_back({f}), s.faces[f].chart = id<ChartId>(s.charts.size());
        if (chart.faces.empty()) continue;
        for (const FaceId f : chart.faces)
            for (std::uint32_t t = s.faces[f.at()].first_triangle; t < s.faces[f.at()].first_triangle + s.faces[f.at()].triangle_count; ++t)
                for (const Vec3f& n : s.corner_normals[t]) chart.smooth = chart.smooth || n != Vec3f(s.faces[f.at()].normal);
        chart.first_texel = static_cast<std::uint32_t>(texels);
        texels += std::uint64_t{chart.width} * chart.height;
        s.charts.push_back(std::move(chart));
    }
    s.texel_count = static_cast<std::uint32_t>(texels);
    s.seams = find_seams(s, drafts, adjacency);
    return texels;
}

} // namespace kiln

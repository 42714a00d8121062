#include "compiler/collision/collision.h"
#include "libs/core/check.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <cmath>
#include <limits>

namespace kiln {
namespace {

using Wide = __int128; // sums of two products of plane coefficients: below 2^123
using WideNormal = std::array<Wide, 3>;

WideNormal normal_of(const ExactPlane& p) { return {p.a, p.b, p.c}; }

// Which way an axial normal looks, as a slot -x +x -y +y -z +z; nothing for others.
template <class T> std::optional<std::size_t> slot_of(const std::array<T, 3>& n) {
    std::optional<std::size_t> slot;
    for (std::size_t k = 0; k < 3; ++k) {
        if (n[k] == 0) continue;
        if (slot) return std::nullopt;
        slot = 2 * k + (n[k] > 0 ? 1 : 0);
    }
    return slot;
}

struct Corner {
    std::array<PlaneId, 3> planes;
    Vec3 point; // rounded
};
std::vector<Corner> corners_of(const PlaneTable& planes, const BrushPolytope& brush) {
    std::vector<Corner> corners;
    for (const PlanePolygon& f : brush.faces) {
        PlaneId before = f.edges.back();
        for (const PlaneId after : f.edges) {
            corners.push_back({{f.support, before, after}, planes.point(f.support, before, after)});
            before = after;
        }
    }
    return corners;
}

// Pairs of faces (i < j) that meet in an edge, ascending.
std::vector<std::array<std::size_t, 2>> edges_of(const PlaneTable& planes, const BrushPolytope& brush) {
    std::vector<std::array<std::size_t, 2>> edges;
    for (std::size_t i = 0; i < brush.faces.size(); ++i) {
        const PlanePolygon& f = brush.faces[i];
        for (std::size_t e = 0; e < f.size(); ++e) {
            const PlaneId before = f.edges[(e + f.size() - 1) % f.size()], here = f.edges[e], after = f.edges[(e + 1) % f.size()];
            std::size_t j = 0;
            while (j < brush.faces.size() && brush.faces[j].support != here) ++j;
            // A redundant side that only touches the brush along this edge may have given it its name; the face
            // beyond is then the other one that the edge lies in.
            if (j == brush.faces.size())
                for (j = 0; j < brush.faces.size(); ++j)
                    if (j != i && planes.side(f.support, before, here, brush.faces[j].support) == 0 &&
                        planes.side(f.support, here, after, brush.faces[j].support) == 0)
                        break;
            KILN_CHECK_OP(j, <, brush.faces.size());
            edges.push_back({std::min(i, j), std::max(i, j)});
        }
    }
    std::ranges::sort(edges);
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    return edges;
}

// Does the corner lie beyond the plane `axis` = at (below it for sign -1)? `at` is a grid coordinate in map units.
bool is_beyond(const PlaneTable& planes, const Corner& corner, std::size_t axis, int sign, double at) {
    PlaneTable few;
    few.grid_bits = planes.grid_bits;
    std::array<PlaneId, 3> own;
    for (std::size_t i = 0; i < 3; ++i) own[i] = few.add(planes.planes[corner.planes[i].at()]);
    ExactPlane wall;
    (axis == 0 ? wall.a : axis == 1 ? wall.b : wall.c) = sign;
    wall.d = sign * static_cast<__int128>(std::ldexp(at, planes.grid_bits));
    return few.side(own[0], own[1], own[2], few.add(wall)) > 0;
}

// The brush's extent that way. Coordinates on the grid, which is almost all there are, come out exactly.
Bevel axial_bevel(const PlaneTable& planes, const std::vector<Corner>& corners, std::size_t slot) {
    const std::size_t axis = slot / 2;
    const int sign = slot % 2 ? 1 : -1;
    Bevel bevel{{}, -std::numeric_limits<double>::infinity()};
    bevel.normal[axis] = sign;
    for (const Corner& c : corners) bevel.distance = std::max(bevel.distance, sign * c.point[axis]);
    const double on_grid = std::ldexp(bevel.distance, planes.grid_bits);
    bool outwards = on_grid != std::floor(on_grid);
    for (const Corner& c : corners)
        if (!outwards && sign * c.point[axis] == bevel.distance)
            outwards = is_beyond(planes, c, axis, sign, sign * bevel.distance);
    bevel.distance += 0.0; // no -0
    if (outwards) bevel.distance = std::nextafter(bevel.distance, std::numeric_limits<double>::infinity());
    return bevel;
}

// A supporting plane whatever the rounding of its normal: the distance is that of the farthest corner.
Bevel edge_bevel(const std::vector<Corner>& corners, const WideNormal& n) {
    std::array<long double, 3> f{};
    long double square = 0;
    for (std::size_t k = 0; k < 3; ++k) f[k] = static_cast<long double>(n[k]), square += f[k] * f[k];
    Bevel bevel{{}, -std::numeric_limits<double>::infinity()};
    for (std::size_t k = 0; k < 3; ++k) bevel.normal[k] = static_cast<double>(f[k] / std::sqrt(square));
    for (const Corner& c : corners) {
        // A coordinate is off by half a unit in the last place, three products and two sums by as much of their size each:
        // together less than 5 * 2^-53 of the sum of magnitudes.
        double magnitude = 0;
        for (std::size_t k = 0; k < 3; ++k) magnitude += std::fabs(bevel.normal[k] * c.point[k]);
        bevel.distance = std::max(bevel.distance, dot(bevel.normal, c.point) + 0x1p-50 * magnitude);
    }
    return bevel;
}

std::vector<Bevel> bevels_of(const PlaneTable& planes, const BrushPolytope& brush) {
    std::vector<Bevel> bevels;
    if (!brush.valid) return bevels;
    const std::vector<Corner> corners = corners_of(planes, brush);
    std::array<bool, 6> own{};
    for (const PlanePolygon& f : brush.faces)
        if (const auto slot = slot_of(normal_of(planes.planes[f.support.at()]))) own[*slot] = true;
    for (std::size_t slot = 0; slot < 6; ++slot)
        if (!own[slot]) bevels.push_back(axial_bevel(planes, corners, slot));
    // The normals of planes that touch the brush along an edge alone are the arc between the normals of its two faces;
    // those that touch the box along an edge parallel to `axis` alone are an open quarter of the great circle
    // n[axis] = 0. The sum has a face where the two cross: where n[axis] changes sign along the arc. Where the arc only
    // touches the circle, it ends there in the normal of a face, which is a plane of the sum already; where
    // it crosses between two quarters, the crossing is axial. Arcs of different edges do not cross, so nothing comes twice.
    for (const auto& [i, j] : edges_of(planes, brush)) {
        const WideNormal p = normal_of(planes.planes[brush.faces[i].support.at()]);
        const WideNormal q = normal_of(planes.planes[brush.faces[j].support.at()]);
        for (std::size_t axis = 0; axis < 3; ++axis) {
            if (p[axis] == 0 || q[axis] == 0 || (p[axis] > 0) == (q[axis] > 0)) continue;
            const Wide wp = q[axis] < 0 ? -q[axis] : q[axis], wq = p[axis] < 0 ? -p[axis] : p[axis];
            WideNormal n;
            for (std::size_t k = 0; k < 3; ++k) n[k] = wp * p[k] + wq * q[k];
            if (!slot_of(n)) bevels.push_back(edge_bevel(corners, n));
        }
    }
    return bevels;
}

} // namespace

CollisionBrushes build_collision(const Csg& csg, Context& context) {
    std::vector<std::vector<Bevel>> found(csg.brushes.size());
    parallel_for(context, csg.brushes.size(), [&](std::size_t b) { found[b] = bevels_of(csg.planes, csg.brushes[b]); });
    CollisionBrushes out;
    out.first_bevel.push_back(0);
    for (const std::vector<Bevel>& bevels : found) {
        out.bevels.insert(out.bevels.end(), bevels.begin(), bevels.end());
        out.first_bevel.push_back(static_cast<std::uint32_t>(out.bevels.size()));
    }
    return out;
}

void validate(const CollisionBrushes& collision, const Csg& csg) {
    KILN_CHECK_OP(collision.first_bevel.size(), ==, csg.brushes.size() + 1);
    KILN_CHECK_OP(collision.first_bevel.back(), ==, collision.bevels.size());
    for (std::size_t b = 0; b < csg.brushes.size(); ++b) {
        const BrushPolytope& brush = csg.brushes[b];
        KILN_CHECK_OP(collision.first_bevel[b], <=, collision.first_bevel[b + 1]);
        KILN_CHECK(brush.valid || collision.first_bevel[b] == collision.first_bevel[b + 1]);
        // Six axial planes with the brush's own, in order of their slots, before all others.
        std::array<int, 6> axial{};
        for (const PlanePolygon& f : brush.faces)
            if (const auto slot = slot_of(normal_of(csg.planes.planes[f.support.at()]))) ++axial[*slot];
        std::size_t last = 0;
        for (std::uint32_t i = collision.first_bevel[b]; i < collision.first_bevel[b + 1]; ++i) {
            const Bevel& bevel = collision.bevels[i];
            KILN_CHECK(std::fabs(dot(bevel.normal, bevel.normal) - 1) < 1e-15 && std::isfinite(bevel.distance));
            const auto slot = slot_of(std::array{bevel.normal.x, bevel.normal.y, bevel.normal.z});
            if (slot) KILN_CHECK_OP(*slot + 1, >, last);
            if (slot) ++axial[*slot];
            last = slot ? *slot + 1 : 6;
            for (const PlanePolygon& f : brush.faces)
                for (const Vec3& p : points(csg.planes, f)) KILN_CHECK_OP(dot(bevel.normal, p), <=, bevel.distance);
        }
        if (brush.valid) KILN_CHECK(std::ranges::all_of(axial, [](int n) { return n == 1; }));
    }
}

} // namespace kiln

#include "compiler/bsp/polytope.h"
#include "libs/core/check.h"
#include <algorithm>
#include <cmath>

namespace kiln::bsp {

// Rounded vertices are off by less than |x| 2^-40, unit normals and distances by a few 2^-53: 2^-34 of the
// world's size is more than ten times their sum.
Space::Space(const PlaneTable& table, const Box3& world) : planes(table), margin(1e-5) {
    double extent = 0;
    for (std::size_t i = 0; i < 3; ++i) extent = std::max({extent, std::abs(world.lo[i]), std::abs(world.hi[i])});
    margin += extent * 0x1p-34;
}

Poly make_poly(const PlaneTable& table, PlanePolygon polygon) {
    Poly p;
    p.polygon = std::move(polygon);
    p.points = points(table, p.polygon);
    for (const Vec3& v : p.points) p.box.add(v);
    return p;
}

unsigned box_side(const Space& space, const Box3& box, const Splitter& q) {
    const Vec3 c = box.center(), h = box.size() * 0.5;
    const double at = dot(q.normal, c) - q.distance;
    const double reach = std::abs(q.normal.x) * h.x + std::abs(q.normal.y) * h.y + std::abs(q.normal.z) * h.z;
    if (at - reach > space.margin) return kFront;
    if (at + reach < -space.margin) return kBack;
    return kBoth;
}

namespace {

int side_of_vertex(const Space& space, const Poly& poly, std::size_t i, const Splitter& q) {
    const double d = dot(q.normal, poly.points[i]) - q.distance;
    if (d > space.margin) return 1;
    if (d < -space.margin) return -1;
    const auto& edges = poly.polygon.edges;
    return space.planes.side(poly.polygon.support, edges[i == 0 ? edges.size() - 1 : i - 1], edges[i], q.plane);
}

// The part of `poly` where keep * side > 0, with the plane that closes it. The points it keeps are those it has: rounding
// depends on the point alone, not on the planes that give it. fresh[k]: the points where q meets edge `crossed[k]`.
Poly part(const Poly& poly, const std::int8_t* side, int keep, PlaneId closing, const std::array<std::size_t, 2>& crossed,
          const std::array<Vec3, 2>& fresh) {
    const std::size_t n = poly.points.size();
    const auto& edges = poly.polygon.edges;
    Poly out;
    out.polygon.support = poly.polygon.support;
    out.polygon.edges.reserve(n + 1);
    out.points.reserve(n + 1);
    const auto add = [&](PlaneId edge, const Vec3& from) {
        out.polygon.edges.push_back(edge);
        out.points.push_back(from);
        out.box.add(from);
    };
    const auto met = [&](std::size_t edge) { return fresh[crossed[0] == edge ? 0 : 1]; };
    for (std::size_t i = 0; i < n; ++i) {
        const std::size_t next = i + 1 == n ? 0 : i + 1;
        const int here = keep * side[i], there = keep * side[next];
        if (here <= 0 && there <= 0) continue;
        add(edges[i], here < 0 ? met(i) : poly.points[i]);
        if (there <= 0) add(closing, there < 0 ? met(i) : poly.points[next]);
    }
    return out;
}

} // namespace

unsigned sides(const Space& space, const Poly& poly, const Splitter& q) {
    if (same_plane(poly.polygon.support, q.plane)) return 0;
    if (const unsigned s = box_side(space, poly.box, q); s != kBoth) return s;
    unsigned found = 0;
    for (std::size_t i = 0; i < poly.points.size() && found != kBoth; ++i) {
        const int s = side_of_vertex(space, poly, i, q);
        found |= s > 0 ? kFront : s < 0 ? kBack : 0;
    }
    KILN_CHECK(found != 0); // planes are interned: a polygon lies in q only if q is its support
    return found;
}

unsigned divide(const Space& space, Poly& poly, const Splitter& q, Poly& back) {
    if (same_plane(poly.polygon.support, q.plane)) return 0;
    if (const unsigned s = box_side(space, poly.box, q); s != kBoth) return s;
    constexpr std::size_t kSmall = 64;
    std::array<std::int8_t, kSmall> small;
    std::vector<std::int8_t> large;
    const std::size_t n = poly.points.size();
    std::int8_t* side = small.data();
    if (n > kSmall) large.resize(n), side = large.data();
    unsigned found = 0;
    for (std::size_t i = 0; i < n; ++i) {
        side[i] = static_cast<std::int8_t>(side_of_vertex(space, poly, i, q));
        found |= side[i] > 0 ? kFront : side[i] < 0 ? kBack : 0;
    }
    KILN_CHECK(found != 0);
    if (found != kBoth) return found;
    std::array<std::size_t, 2> crossed{n, n};
    std::array<Vec3, 2> fresh{};
    std::size_t count = 0;
    for (std::size_t i = 0; i < n; ++i)
        if (side[i] * side[i + 1 == n ? 0 : i + 1] < 0) {
            KILN_CHECK_OP(count, <, std::size_t{2}); // convex
            crossed[count] = i;
            fresh[count++] = space.planes.point(poly.polygon.support, poly.polygon.edges[i], q.plane);
        }
    back = part(poly, side, -1, q.plane, crossed, fresh);
    poly = part(poly, side, +1, flipped(q.plane), crossed, fresh);
    return kBoth;
}

Halves cut(const Space& space, Poly&& poly, const Splitter& q) {
    Halves halves;
    Poly back;
    switch (divide(space, poly, q, back)) {
    case kFront: halves.front = std::move(poly); break;
    case kBack: halves.back = std::move(poly); break;
    case kBoth: halves.front = std::move(poly), halves.back = std::move(back); break;
    default: break;
    }
    return halves;
}

PlanePolygon plane_quad(const PlaneTable& table, const std::array<PlaneId, 6>& box, PlaneId q) {
    const Vec3 n = table.normal(q);
    std::size_t axis = 0;
    for (std::size_t i = 1; i < 3; ++i)
        if (std::abs(n[i]) > std::abs(n[axis])) axis = i;
    // Seen from +axis, u is to the right and v up: bottom, right, top, left is counter-clockwise.
    const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    PlanePolygon quad{q, {box[2 * v + 1], box[2 * u], box[2 * v], box[2 * u + 1]}};
    if (n[axis] < 0) std::reverse(quad.edges.begin(), quad.edges.end());
    return quad;
}

std::optional<PlanePolygon> clip_behind(const PlaneTable& table, PlanePolygon polygon, std::span<const Poly> faces) {
    for (const Poly& f : faces)
        if (!clip_to_back(table, polygon, f.polygon.support)) return std::nullopt;
    return polygon;
}

std::vector<Poly> box_faces(const PlaneTable& table, const std::array<PlaneId, 6>& box) {
    std::vector<Poly> faces;
    for (const PlaneId p : box) faces.push_back(make_poly(table, plane_quad(table, box, p)));
    return faces;
}

void refresh_box(Polytope& polytope) {
    polytope.box = {};
    for (const Poly& f : polytope.faces) polytope.box.add(f.box);
}

unsigned sides(const Space& space, const Polytope& polytope, const Splitter& q) {
    if (const unsigned s = box_side(space, polytope.box, q); s != kBoth) return s;
    unsigned found = 0;
    for (const Poly& f : polytope.faces) {
        // A face in q settles it: a convex body lies behind each of its faces.
        if (f.polygon.support == q.plane) return kBack;
        if (same_plane(f.polygon.support, q.plane)) return kFront;
        if (found != kBoth) found |= sides(space, f, q);
    }
    return found;
}

void cut(const Space& space, Polytope&& polytope, const Splitter& q, const PlanePolygon& cap, Polytope& front,
         Polytope& back) {
    front.faces.reserve(polytope.faces.size() + 1);
    back.faces.reserve(polytope.faces.size() + 1);
    for (Poly& f : polytope.faces) {
        Poly behind;
        const unsigned s = divide(space, f, q, behind);
        if (s & kFront) front.faces.push_back(std::move(f));
        if (s == kBack) back.faces.push_back(std::move(f));
        if (s == kBoth) back.faces.push_back(std::move(behind));
    }
    back.faces.push_back(make_poly(space.planes, cap));
    Poly other = back.faces.back();
    other.polygon = flipped(cap);
    // Vertex i of the flipped polygon is vertex n - i of the other.
    std::reverse(other.points.begin(), other.points.end());
    if (!other.points.empty()) std::rotate(other.points.begin(), other.points.end() - 1, other.points.end());
    front.faces.push_back(std::move(other));
    refresh_box(front);
    refresh_box(back);
}

double area(std::span<const Vec3> winding) {
    Vec3 sum{};
    for (std::size_t i = 2; i < winding.size(); ++i)
        sum += cross(winding[i - 1] - winding[0], winding[i] - winding[0]);
    return length(sum) / 2;
}

Vec3 centroid(std::span<const Vec3> winding) {
    Vec3 sum{}, mean{};
    double total = 0;
    for (const Vec3& p : winding) mean += p / static_cast<double>(winding.size());
    for (std::size_t i = 0; i < winding.size(); ++i) {
        const Vec3 a = winding[i], b = winding[(i + 1) % winding.size()];
        const double w = length(cross(a - mean, b - mean));
        sum += (a + b + mean) * (w / 3), total += w;
    }
    return total > 0 ? sum / total : mean;
}

// A convex polygon is narrowest with one side flat against an edge.
double width(std::span<const Vec3> winding) {
    double least = 1e30;
    for (std::size_t i = 0; i < winding.size(); ++i) {
        const Vec3 a = winding[i], e = normalize(winding[(i + 1) % winding.size()] - a);
        if (length(e) == 0) continue; // vertices that round to one point
        double reach = 0;
        for (const Vec3& p : winding) reach = std::max(reach, length(cross(p - a, e)));
        least = std::min(least, reach);
    }
    return least == 1e30 ? 0 : least;
}

} // namespace kiln::bsp

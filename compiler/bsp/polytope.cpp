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
    splitters.reserve(table.planes.size() / 2);
    for (std::size_t i = 0; i < table.planes.size(); i += 2) splitters.emplace_back(table, id<PlaneId>(i));
}

PlanePolygon polygon(const Poly& poly) {
    PlanePolygon p{poly.support, {}};
    p.edges.reserve(poly.count);
    for (const Corner& c : poly.corners()) p.edges.push_back(c.edge);
    return p;
}

std::vector<Vec3> winding(const Poly& poly) {
    std::vector<Vec3> points;
    points.reserve(poly.count);
    for (const Corner& c : poly.corners()) points.push_back(c.point);
    return points;
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

Poly Cutter::make(const PlanePolygon& polygon) {
    return make(polygon, [&](PlaneId before, PlaneId edge) { return space_.planes.point(polygon.support, before, edge); });
}

template <class PointOf> Poly Cutter::make(const PlanePolygon& polygon, const PointOf& point_of) {
    Poly p;
    p.support = polygon.support;
    p.count = static_cast<std::uint32_t>(polygon.size());
    p.first = pool_.take<Corner>(p.count);
    PlaneId before = polygon.edges.back();
    for (std::size_t i = 0; i < p.count; ++i) {
        const PlaneId edge = polygon.edges[i];
        p.first[i] = {point_of(before, edge), edge};
        p.box.add(p.first[i].point);
        before = edge;
    }
    return p;
}

Poly Cutter::copy(const Poly& poly) {
    Poly p = poly;
    p.first = pool_.take<Corner>(p.count);
    std::copy_n(poly.first, p.count, p.first);
    return p;
}

Polytope Cutter::make(std::span<const PlanePolygon> faces) {
    Polytope body;
    body.room = static_cast<std::uint32_t>(faces.size());
    body.first = pool_.take<Poly>(body.room);
    for (const PlanePolygon& f : faces) {
        body.first[body.count++] = make(f);
        body.box.add(body.first[body.count - 1].box);
    }
    return body;
}

Polytope Cutter::copy(const Polytope& body) {
    Polytope p = body;
    p.room = p.count;
    p.first = pool_.take<Poly>(p.room);
    for (std::size_t i = 0; i < p.count; ++i) p.first[i] = copy(body.first[i]);
    return p;
}

Polytope Cutter::make_box(const std::array<PlaneId, 6>& box) {
    std::vector<PlanePolygon> faces;
    for (const PlaneId p : box) faces.push_back(plane_quad(space_.planes, box, p));
    return make(faces);
}

void Cutter::drop(const Polytope& body) {
    for (const Poly& f : body.faces()) drop(f);
    pool_.give(body.first, body.room);
}

std::int8_t* Cutter::sides_of(std::size_t corners) {
    if (side_.size() < corners) side_.resize(corners);
    return side_.data();
}

unsigned Cutter::classify(const Poly& poly, const Splitter& q, std::int8_t* side) const {
    unsigned found = 0;
    for (std::size_t i = 0; i < poly.count; ++i) {
        const double d = dot(q.normal, poly.first[i].point) - q.distance;
        const int s = d > space_.margin    ? 1
                      : d < -space_.margin ? -1
                                           : space_.planes.side(poly.support, poly.first[i == 0 ? poly.count - 1 : i - 1].edge, poly.first[i].edge, q.plane);
        side[i] = static_cast<std::int8_t>(s);
        found |= s > 0 ? kFront : s < 0 ? kBack : 0;
    }
    KILN_CHECK(found != 0); // planes are interned: a polygon lies in q only if q is its support
    return found;
}

// The part of `poly` where keep * side > 0, with the plane that closes it. The points it keeps are those it has: rounding
// depends on the point alone, not on the planes that give it. `in`: the edge whose crossing is points.in_point.
Poly Cutter::part(const Poly& poly, const std::int8_t* side, int keep, PlaneId closing, std::size_t in, const Crossed& points) {
    const std::size_t n = poly.count;
    std::uint32_t count = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const int here = keep * side[i], there = keep * side[i + 1 == n ? 0 : i + 1];
        if (here > 0 || there > 0) count += there <= 0 ? 2 : 1;
    }
    Poly out;
    out.support = poly.support;
    out.first = pool_.take<Corner>(count);
    const auto add = [&](PlaneId edge, const Vec3& from) {
        out.first[out.count++] = {from, edge};
        out.box.add(from);
    };
    const auto met = [&](std::size_t edge) { return edge == in ? points.in_point : points.out_point; };
    for (std::size_t i = 0; i < n; ++i) {
        const std::size_t next = i + 1 == n ? 0 : i + 1;
        const int here = keep * side[i], there = keep * side[next];
        if (here <= 0 && there <= 0) continue;
        add(poly.first[i].edge, here < 0 ? met(i) : poly.first[i].point);
        if (there <= 0) add(closing, there < 0 ? met(i) : poly.first[next].point);
    }
    return out;
}

// `crossed`: filled but for points found among those of other faces.
void Cutter::split(const Poly& poly, const Splitter& q, const std::int8_t* side, Crossed& crossed, Poly& front, Poly& back) {
    const std::size_t n = poly.count;
    std::size_t in = n;
    crossed.face = poly.support;
    for (std::size_t i = 0; i < n; ++i) {
        const int here = side[i], there = side[i + 1 == n ? 0 : i + 1];
        if (here == 0) crossed.clean = false;
        if (here * there >= 0) continue;
        const PlaneId edge = poly.first[i].edge;
        const Vec3* known = find_crossing(edge, poly.support);
        const Vec3 point = known ? *known : space_.planes.point(poly.support, edge, q.plane);
        if (here > 0) {
            KILN_CHECK(!crossed.in.valid()); // convex
            crossed.in = edge, crossed.in_point = point, in = i;
        } else {
            KILN_CHECK(!crossed.out.valid());
            crossed.out = edge, crossed.out_point = point;
        }
    }
    back = part(poly, side, -1, q.plane, in, crossed);
    front = part(poly, side, +1, flipped(q.plane), in, crossed);
    drop(poly);
}

unsigned Cutter::divide(Poly& poly, const Splitter& q, Poly& back) {
    if (same_plane(poly.support, q.plane)) return 0;
    if (const unsigned s = box_side(space_, poly.box, q); s != kBoth) return s;
    std::int8_t* const side = sides_of(poly.count);
    if (const unsigned s = classify(poly, q, side); s != kBoth) return s;
    crossed_.clear();
    Crossed crossed;
    const Poly whole = poly;
    split(whole, q, side, crossed, poly, back);
    return kBoth;
}

unsigned Cutter::classify(const Polytope& body, const Splitter& q) {
    if (const unsigned s = box_side(space_, body.box, q); s != kBoth) return s;
    std::size_t corners = 0;
    for (const Poly& f : body.faces()) {
        // A face in q settles it: a convex body lies behind each of its faces.
        if (f.support == q.plane) return kBack;
        if (same_plane(f.support, q.plane)) return kFront;
        corners += f.count;
    }
    std::int8_t* side = sides_of(corners);
    face_side_.resize(body.count);
    faces_.clear();
    unsigned found = 0;
    for (std::size_t i = 0; i < body.count; ++i) {
        const Poly& f = body.first[i];
        unsigned s = box_side(space_, f.box, q);
        if (s == kBoth) s = classify(f, q, side);
        face_side_[i] = static_cast<std::uint8_t>(s);
        faces_.push_back(f.support);
        found |= s;
        side += f.count;
    }
    return found;
}

const Vec3* Cutter::find_crossing(PlaneId face, PlaneId edge) const {
    for (const Crossed& c : crossed_)
        if (c.face == face) return c.in == edge ? &c.in_point : c.out == edge ? &c.out_point : nullptr;
    return nullptr;
}

// The faces as classify left their sides. Each point where q meets an edge is rounded once, though two faces and the
// section share it.
void Cutter::split_faces(Polytope& body, const Splitter& q, Polytope& front, Polytope& back) {
    front = back = {};
    front.room = back.room = body.count + 1;
    front.first = pool_.take<Poly>(front.room), back.first = pool_.take<Poly>(back.room);
    crossed_.clear();
    const std::int8_t* side = side_.data();
    for (std::size_t i = 0; i < body.count; ++i) {
        const Poly& f = body.first[i];
        if (face_side_[i] == kFront) front.first[front.count++] = f;
        else if (face_side_[i] == kBack) back.first[back.count++] = f;
        else {
            Crossed crossed;
            split(f, q, side, crossed, front.first[front.count++], back.first[back.count++]);
            crossed_.push_back(crossed);
        }
        side += body.first[i].count;
    }
    pool_.give(body.first, body.room);
    body = {};
}

// q within the polytope, from crossed face to crossed face. Not where q meets a corner: which faces it goes through there
// is a choice.
bool Cutter::walk_section(const Splitter& q, Poly& section) {
    if (crossed_.size() < 3 || !std::ranges::all_of(crossed_, &Crossed::clean)) return false;
    section = {};
    section.support = q.plane;
    section.first = pool_.take<Corner>(crossed_.size());
    const Crossed* at = crossed_.data();
    do {
        if (section.count == crossed_.size()) break;
        section.first[section.count++] = {at->in_point, at->face};
        section.box.add(at->in_point);
        const auto next = std::ranges::find(crossed_, at->out, &Crossed::face);
        if (next == crossed_.end() || next->in != at->face) break;
        at = &*next;
    } while (at != crossed_.data());
    if (at == crossed_.data() && section.count == crossed_.size()) return true;
    pool_.give(section.first, crossed_.size());
    return false;
}

// What of outline_ is behind all of faces_.
Poly Cutter::clip_section(const Splitter& q) {
    outline_.support = q.plane;
    for (const PlaneId f : faces_) KILN_CHECK(clip_to_back(space_.planes, outline_, f)); // q has area in the polytope
    return make(outline_, [&](PlaneId before, PlaneId edge) {
        const Vec3* known = find_crossing(before, edge);
        return known ? *known : space_.planes.point(q.plane, before, edge);
    });
}

void Cutter::close(const Poly& section, Polytope& front, Polytope& back) {
    back.first[back.count++] = section;
    Poly other = section; // facing the other way: its corner i is corner n - i of the section
    other.support = flipped(section.support);
    other.first = pool_.take<Corner>(other.count);
    for (std::size_t i = 0, n = other.count; i < n; ++i)
        other.first[i] = {section.first[i == 0 ? 0 : n - i].point, section.first[n - 1 - i].edge};
    front.first[front.count++] = other;
    for (Polytope* p : {&front, &back})
        for (const Poly& f : p->faces()) p->box.add(f.box);
}

unsigned Cutter::divide(Polytope& body, const Splitter& q, std::span<const PlaneId> around, Polytope& front, Polytope& back) {
    const unsigned s = classify(body, q);
    if (s != kBoth) return s;
    split_faces(body, q, front, back);
    Poly section;
    if (!walk_section(q, section)) {
        outline_.edges.assign(around.begin(), around.end());
        section = clip_section(q);
    }
    close(section, front, back);
    return kBoth;
}

Poly Cutter::cut(Polytope& body, const Splitter& q, const std::array<PlaneId, 6>& box, Polytope& front, Polytope& back) {
    KILN_CHECK_OP(classify(body, q), ==, kBoth);
    split_faces(body, q, front, back);
    outline_ = plane_quad(space_.planes, box, q.plane); // clipped, not walked: where its border starts does not depend on the order of faces
    const Poly section = clip_section(q);
    close(section, front, back);
    return section;
}

double area(const Poly& poly) {
    Vec3 sum{};
    const Corner* c = poly.first;
    for (std::size_t i = 2; i < poly.count; ++i) sum += cross(c[i - 1].point - c[0].point, c[i].point - c[0].point);
    return length(sum) / 2;
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

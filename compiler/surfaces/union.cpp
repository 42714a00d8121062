// Merging by CGAL's Boolean set operations on rational numbers: takes whatever it is given, and a thousand times as long.
#include "compiler/surfaces/regions.h"
#include <CGAL/Boolean_set_operations_2.h>
#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Polygon_set_2.h>
#include <algorithm>
#include <map>
#include <stdexcept>

namespace kiln {
namespace {

using Exact = CGAL::Exact_predicates_exact_constructions_kernel;
using Rational = Exact::Exact_kernel::FT;
using Polygon = CGAL::Polygon_2<Exact>;
using PolygonWithHoles = CGAL::Polygon_with_holes_2<Exact>;
using PolygonSet = CGAL::Polygon_set_2<Exact>;

// A decimal big integer, without relying on which number type CGAL was built with.
Rational parse_integer(const std::string& text) {
    const bool negative = !text.empty() && text[0] == '-';
    Rational value = 0;
    constexpr std::size_t kDigits = 15; // a chunk stays exact in double
    for (std::size_t i = negative ? 1 : 0; i < text.size(); i += kDigits) {
        const std::string chunk = text.substr(i, kDigits);
        double scale = 1;
        for (std::size_t k = 0; k < chunk.size(); ++k) scale *= 10;
        value = value * Rational(scale) + Rational(std::stod(chunk));
    }
    return negative ? Rational(-value) : value;
}

Exact::Point_2 exact_point(const VertexTable& vertices, VertexId v, Projection axes) {
    const PlaneTriple& t = vertices.meeting(v);
    const std::array<std::string, 4> text = vertices.planes().exact_point(t[0], t[1], t[2]);
    const Rational w = parse_integer(text[3]);
    return {Exact::FT(Rational(parse_integer(text[axes.u]) / w)), Exact::FT(Rational(parse_integer(text[axes.v]) / w))};
}

struct LessPoint {
    bool operator()(const Exact::Point_2& a, const Exact::Point_2& b) const { return CGAL::compare_xy(a, b) == CGAL::SMALLER; }
};

struct Ring {
    Outline loop;
    Polygon polygon;
};

// A plane through an edge of the union: that of some polygon's edge along it.
PlaneId line_through(const VertexTable& vertices, PlaneId plane, PolygonSpan polygons, VertexId a, VertexId b) {
    for (const PlaneId line : polygons.lines())
        if (vertices.on_line(a, plane, line) && vertices.on_line(b, plane, line)) return line;
    throw std::runtime_error("union made an edge");
}

std::vector<Region> merge(const VertexTable& vertices, PlaneId plane, PolygonSpan polygons) {
    const Projection axes = project_along(vertices.planes(), plane);
    std::map<VertexId, Exact::Point_2> points;
    std::map<Exact::Point_2, VertexId, LessPoint> ids;
    std::vector<Polygon> parts;
    parts.reserve(polygons.size());
    for (std::size_t i = 0; i < polygons.size(); ++i) {
        Polygon part;
        for (const VertexId v : polygons[i]) {
            auto it = points.find(v);
            if (it == points.end()) {
                it = points.emplace(v, exact_point(vertices, v, axes)).first;
                ids.emplace(it->second, v);
            }
            part.push_back(it->second);
        }
        parts.push_back(std::move(part));
    }
    PolygonSet set;
    set.join(parts.begin(), parts.end());
    std::vector<PolygonWithHoles> merged;
    set.polygons_with_holes(std::back_inserter(merged));

    // The library may join what only touches in a vertex to one boundary: taken apart there, every loop is simple and
    // says by its turn whether it is outer or a hole.
    std::vector<Ring> outer, holes;
    const auto take = [&](const Polygon& boundary) {
        Outline walk;
        // Polygons that nowhere overlap meet in no new points, so every vertex is one that went in.
        for (auto p = boundary.vertices_begin(); p != boundary.vertices_end(); ++p) {
            const auto it = ids.find(*p);
            if (it == ids.end()) throw std::runtime_error("union made a vertex");
            walk.vertices.push_back(it->second);
        }
        for (std::size_t i = 0; i < walk.vertices.size(); ++i)
            walk.lines.push_back(line_through(vertices, plane, polygons, walk.vertices[i], walk.vertices[(i + 1) % walk.vertices.size()]));
        for (Outline& simple : split_at_repeats(walk)) {
            Ring ring;
            for (const VertexId v : simple.vertices) ring.polygon.push_back(points.at(v));
            ring.loop = std::move(simple);
            (ring.polygon.orientation() == CGAL::COUNTERCLOCKWISE ? outer : holes).push_back(std::move(ring));
        }
    };
    for (const PolygonWithHoles& p : merged) {
        take(p.outer_boundary());
        for (auto h = p.holes_begin(); h != p.holes_end(); ++h) take(*h);
    }
    // The innermost outer loop around a point that lies on none of them.
    const auto home = [&](const Exact::Point_2& point) {
        if (outer.size() == 1) return std::size_t{0};
        std::size_t best = outer.size();
        for (std::size_t i = 0; i < outer.size(); ++i)
            if (outer[i].polygon.bounded_side(point) == CGAL::ON_BOUNDED_SIDE &&
                (best == outer.size() || outer[i].polygon.area() < outer[best].polygon.area()))
                best = i;
        if (best == outer.size()) throw std::runtime_error("union lost a polygon");
        return best;
    };
    std::vector<Region> regions(outer.size());
    for (std::size_t i = 0; i < outer.size(); ++i) regions[i].loops.push_back(simplify(vertices, plane, outer[i].loop));
    for (const Ring& h : holes)
        regions[home(CGAL::midpoint(h.polygon[0], h.polygon[1]))].loops.push_back(simplify(vertices, plane, h.loop));
    for (Region& r : regions) std::sort(r.loops.begin() + 1, r.loops.end());
    for (std::size_t i = 0; i < parts.size(); ++i)
        regions[home(CGAL::centroid(parts[i][0], parts[i][1], parts[i][2]))].members.push_back(static_cast<std::uint32_t>(i));
    for (const Region& r : regions)
        if (r.members.empty()) throw std::runtime_error("union made a region of nothing");
    std::ranges::sort(regions, {}, [](const Region& r) { return r.members.front(); });
    return regions;
}

} // namespace

std::optional<std::vector<Region>> merge_by_union(const VertexTable& vertices, PlaneId plane, PolygonSpan polygons) {
    try {
        return merge(vertices, plane, polygons);
    } catch (const std::exception&) { // the library's refusal, or one of the above
        return std::nullopt;
    }
}

} // namespace kiln

#include "compiler/surfaces/regions.h"
#include "libs/core/check.h"
#include <CGAL/Boolean_set_operations_2.h>
#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_set_2.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>
#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <unordered_map>

namespace kiln {
namespace {

using Exact = CGAL::Exact_predicates_exact_constructions_kernel;
using Fast = CGAL::Exact_predicates_inexact_constructions_kernel;
using Rational = Exact::Exact_kernel::FT;
using Rational3 = std::array<Rational, 3>;

// Most vertices of most maps are dyadic: their rounded coordinates are the exact ones. kFineBits more bits than the
// input grid; |coordinate| <= 2^kScaledBits keeps every product below within 127 bits.
constexpr int kFineBits = 10;
constexpr int kScaledBits = 46;

struct Triple {
    std::uint32_t p0, p1, p2;
    friend bool operator==(const Triple&, const Triple&) = default;
};
struct HashTriple {
    std::size_t operator()(const Triple& t) const noexcept {
        return (t.p0 * 0x9E3779B97F4A7C15ull) ^ (t.p1 * 0xC2B2AE3D27D4EB4Full) ^ (t.p2 * 0x165667B19E3779F9ull);
    }
};
struct HashPoint {
    std::size_t operator()(const Vec3& p) const noexcept {
        const auto h = [](double x) { return std::bit_cast<std::uint64_t>(x + 0.0); }; // -0 as 0
        return (h(p.x) * 0x9E3779B97F4A7C15ull) ^ ((h(p.y) * 0xC2B2AE3D27D4EB4Full) >> 7) ^ (h(p.z) * 0x165667B19E3779F9ull >> 13);
    }
};

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

} // namespace

struct VertexTable::Data {
    const PlaneTable& planes;
    std::vector<Triple> triples;
    std::vector<Vec3> positions;
    std::vector<std::array<std::int64_t, 3>> scaled;    // exact coordinates times 2^(grid_bits + kFineBits) ...
    std::vector<std::uint8_t> dyadic;                   // ... where this is 1
    std::unordered_map<std::uint32_t, Rational3> rational; // of the others
    std::unordered_map<Triple, std::uint32_t, HashTriple> by_triple;
    std::unordered_multimap<Vec3, std::uint32_t, HashPoint> by_position;

    explicit Data(const PlaneTable& table) : planes(table) {}

    bool same_point(const Triple& a, const Triple& b) const {
        for (const std::uint32_t q : {b.p0, b.p1, b.p2})
            if (planes.side({a.p0}, {a.p1}, {a.p2}, {q}) != 0) return false;
        return true;
    }
    bool scale_exactly(const Triple& t, Vec3 p, std::array<std::int64_t, 3>& out) const {
        for (std::size_t i = 0; i < 3; ++i) {
            const double x = std::ldexp(p[i], planes.grid_bits + kFineBits);
            if (std::abs(x) > std::ldexp(1.0, kScaledBits) || x != std::floor(x)) return false;
            out[i] = static_cast<std::int64_t>(x);
        }
        for (const std::uint32_t q : {t.p0, t.p1, t.p2}) {
            const ExactPlane& e = planes.planes[q];
            const __int128 at = static_cast<__int128>(e.a) * out[0] + static_cast<__int128>(e.b) * out[1] +
                                static_cast<__int128>(e.c) * out[2];
            if (at != e.d * (__int128{1} << kFineBits)) return false;
        }
        return true;
    }
    Rational3 exact(std::uint32_t v) const {
        if (dyadic[v]) {
            const Vec3 p = positions[v];
            return {Rational(p.x), Rational(p.y), Rational(p.z)};
        }
        return rational.at(v);
    }
    Exact::FT coordinate(std::uint32_t v, int axis) const {
        const auto i = static_cast<std::size_t>(axis);
        return dyadic[v] ? Exact::FT(positions[v][i]) : Exact::FT(rational.at(v)[i]);
    }
};

VertexTable::VertexTable(const PlaneTable& planes) : data_(std::make_unique<Data>(planes)) {}
VertexTable::~VertexTable() = default;
std::size_t VertexTable::size() const { return data_->positions.size(); }
const PlaneTable& VertexTable::planes() const { return data_->planes; }
Vec3 VertexTable::position(VertexId v) const { return data_->positions[v.at()]; }

VertexId VertexTable::add(PlaneId p0, PlaneId p1, PlaneId p2) {
    Data& d = *data_;
    std::array<std::uint32_t, 3> ids{p0.value & ~1u, p1.value & ~1u, p2.value & ~1u}; // a point has no facing
    std::ranges::sort(ids);
    const Triple triple{ids[0], ids[1], ids[2]};
    if (const auto it = d.by_triple.find(triple); it != d.by_triple.end()) return {it->second};
    Vec3 p = d.planes.point({ids[0]}, {ids[1]}, {ids[2]});
    p = p + Vec3{}; // -0 becomes 0
    const auto [first, last] = d.by_position.equal_range(p);
    for (auto it = first; it != last; ++it)
        if (d.same_point(d.triples[it->second], triple)) {
            d.by_triple.emplace(triple, it->second);
            return {it->second};
        }
    const auto v = static_cast<std::uint32_t>(d.positions.size());
    d.triples.push_back(triple);
    d.positions.push_back(p);
    d.scaled.emplace_back();
    d.dyadic.push_back(d.scale_exactly(triple, p, d.scaled.back()) ? 1 : 0);
    if (!d.dyadic.back()) {
        const std::array<std::string, 4> text = d.planes.exact_point({ids[0]}, {ids[1]}, {ids[2]});
        const Rational w = parse_integer(text[3]);
        d.rational.emplace(v, Rational3{Rational(parse_integer(text[0]) / w), Rational(parse_integer(text[1]) / w),
                                        Rational(parse_integer(text[2]) / w)});
    }
    d.by_triple.emplace(triple, v);
    d.by_position.emplace(p, v);
    return {v};
}

Loop VertexTable::add(const PlanePolygon& polygon) {
    Loop loop;
    const std::size_t n = polygon.size();
    for (std::size_t i = 0; i < n; ++i) {
        const VertexId v = add(polygon.support, polygon.edges[(i + n - 1) % n], polygon.edges[i]);
        if (loop.empty() || loop.back() != v) loop.push_back(v);
    }
    while (loop.size() > 1 && loop.front() == loop.back()) loop.pop_back();
    return loop;
}

bool VertexTable::between(VertexId a, VertexId b, VertexId v) const {
    const Data& d = *data_;
    const auto test = [](const auto& pa, const auto& pb, const auto& pv) {
        using T = std::decay_t<decltype(pa[0])>;
        const std::array<T, 3> ab{T(pb[0] - pa[0]), T(pb[1] - pa[1]), T(pb[2] - pa[2])};
        const std::array<T, 3> av{T(pv[0] - pa[0]), T(pv[1] - pa[1]), T(pv[2] - pa[2])};
        if (ab[1] * av[2] != ab[2] * av[1] || ab[2] * av[0] != ab[0] * av[2] || ab[0] * av[1] != ab[1] * av[0]) return false;
        const T zero = 0;
        for (std::size_t i = 0; i < 3; ++i) {
            if (ab[i] == zero) continue;
            return ab[i] > zero ? av[i] > zero && av[i] < ab[i] : av[i] < zero && av[i] > ab[i];
        }
        return false;
    };
    if (d.dyadic[a.at()] && d.dyadic[b.at()] && d.dyadic[v.at()]) {
        const auto wide = [&](VertexId id) {
            const auto& s = d.scaled[id.at()];
            return std::array<__int128, 3>{s[0], s[1], s[2]};
        };
        return test(wide(a), wide(b), wide(v));
    }
    return test(d.exact(a.value), d.exact(b.value), d.exact(v.value));
}

namespace {

// The plane seen from its front, its dominant axis dropped: (u, v) right-handed, exact.
struct Projection {
    int u = 0, v = 1;
};
Projection project_along(const PlaneTable& planes, PlaneId plane) {
    const ExactPlane& p = planes.planes[plane.at()];
    const std::array<std::int64_t, 3> n{p.a, p.b, p.c};
    std::size_t axis = 2;
    for (const std::size_t i : {std::size_t{1}, std::size_t{0}})
        if (std::abs(n[i]) > std::abs(n[axis])) axis = i;
    Projection r{static_cast<int>((axis + 1) % 3), static_cast<int>((axis + 2) % 3)};
    if (n[axis] < 0) std::swap(r.u, r.v);
    return r;
}

using Polygon = CGAL::Polygon_2<Exact>;
using PolygonWithHoles = CGAL::Polygon_with_holes_2<Exact>;
using PolygonSet = CGAL::Polygon_set_2<Exact>;

struct LessPoint {
    bool operator()(const Exact::Point_2& a, const Exact::Point_2& b) const { return CGAL::compare_xy(a, b) == CGAL::SMALLER; }
};

// Vertices straight between their neighbours go; the loop starts at its smallest id.
Loop simplify(const VertexTable& vertices, Loop loop) {
    for (bool changed = true; changed && loop.size() > 3;) {
        changed = false;
        for (std::size_t i = 0; i < loop.size() && loop.size() > 3;) {
            const std::size_t n = loop.size();
            if (vertices.between(loop[(i + n - 1) % n], loop[(i + 1) % n], loop[i])) {
                loop.erase(loop.begin() + static_cast<std::ptrdiff_t>(i));
                changed = true;
            } else {
                ++i;
            }
        }
    }
    std::ranges::rotate(loop, std::ranges::min_element(loop));
    return loop;
}

std::vector<Region> keep_apart(const VertexTable& vertices, std::span<const Loop> polygons) {
    std::vector<Region> regions;
    for (std::size_t i = 0; i < polygons.size(); ++i)
        regions.push_back({{simplify(vertices, polygons[i])}, {static_cast<std::uint32_t>(i)}});
    return regions;
}

// A closed walk that passes some vertices several times, as simple loops.
std::vector<Loop> split_at_repeats(const Loop& walk) {
    std::vector<Loop> loops;
    Loop open;
    for (const VertexId v : walk) {
        if (const auto it = std::ranges::find(open, v); it != open.end()) {
            loops.emplace_back(it, open.end());
            open.erase(it, open.end());
        }
        open.push_back(v);
    }
    loops.push_back(std::move(open));
    return loops;
}

struct Ring {
    Loop loop;
    Polygon polygon;
};

std::vector<Region> merge_with_cgal(const VertexTable& vertices, PlaneId plane, std::span<const Loop> polygons) {
    const Projection axes = project_along(vertices.planes(), plane);
    const VertexTable::Data& data = vertices.data();
    std::map<std::uint32_t, Exact::Point_2> points;
    std::map<Exact::Point_2, VertexId, LessPoint> ids;
    std::vector<Polygon> parts;
    parts.reserve(polygons.size());
    for (const Loop& loop : polygons) {
        Polygon part;
        for (const VertexId v : loop) {
            auto it = points.find(v.value);
            if (it == points.end()) {
                it = points.emplace(v.value, Exact::Point_2(data.coordinate(v.value, axes.u), data.coordinate(v.value, axes.v))).first;
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
        Loop loop;
        // Polygons that nowhere overlap meet in no new points, so every vertex is one that went in.
        for (auto p = boundary.vertices_begin(); p != boundary.vertices_end(); ++p) {
            const auto it = ids.find(*p);
            if (it == ids.end()) throw std::runtime_error("union made a vertex");
            loop.push_back(it->second);
        }
        for (Loop& simple : split_at_repeats(loop)) {
            Ring ring;
            for (const VertexId v : simple) ring.polygon.push_back(points.at(v.value));
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
    for (std::size_t i = 0; i < outer.size(); ++i) regions[i].loops.push_back(simplify(vertices, outer[i].loop));
    for (const Ring& h : holes)
        regions[home(CGAL::midpoint(h.polygon[0], h.polygon[1]))].loops.push_back(simplify(vertices, h.loop));
    for (Region& r : regions) std::sort(r.loops.begin() + 1, r.loops.end());
    for (std::size_t i = 0; i < parts.size(); ++i)
        regions[home(CGAL::centroid(parts[i][0], parts[i][1], parts[i][2]))].members.push_back(static_cast<std::uint32_t>(i));
    for (const Region& r : regions)
        if (r.members.empty()) throw std::runtime_error("union made a region of nothing");
    std::ranges::sort(regions, {}, [](const Region& r) { return r.members.front(); });
    return regions;
}

} // namespace

std::vector<Region> merge_polygons(const VertexTable& vertices, PlaneId plane, std::span<const Loop> polygons, bool& merged) {
    merged = true;
    if (polygons.size() == 1) return keep_apart(vertices, polygons);
    try {
        return merge_with_cgal(vertices, plane, polygons);
    } catch (const std::exception&) { // the library's refusal: unmerged is correct, only more faces
    }
    merged = false;
    return keep_apart(vertices, polygons);
}

namespace {

template <class Kernel, class PointOf>
std::vector<std::array<VertexId, 3>> triangulate_with(const std::vector<Loop>& loops, const PointOf& point_of) {
    using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<std::uint32_t, Kernel>;
    using FaceBase = CGAL::Triangulation_face_base_with_info_2<int, Kernel, CGAL::Constrained_triangulation_face_base_2<Kernel>>;
    using Structure = CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>;
    using Triangulation = CGAL::Constrained_Delaunay_triangulation_2<Kernel, Structure, CGAL::No_constraint_intersection_tag>;
    Triangulation cdt;
    for (const Loop& loop : loops) {
        std::vector<typename Triangulation::Vertex_handle> handles;
        typename Triangulation::Face_handle hint;
        for (const VertexId v : loop) {
            const auto h = cdt.insert(point_of(v), hint);
            h->info() = v.value;
            hint = h->face();
            handles.push_back(h);
        }
        for (std::size_t i = 0; i < handles.size(); ++i) cdt.insert_constraint(handles[i], handles[(i + 1) % handles.size()]);
    }
    // Inside: an odd number of constraints away from infinity.
    for (auto f = cdt.all_faces_begin(); f != cdt.all_faces_end(); ++f) f->info() = -1;
    std::vector<typename Triangulation::Face_handle> todo{cdt.infinite_face()};
    cdt.infinite_face()->info() = 0;
    while (!todo.empty()) {
        const auto f = todo.back();
        todo.pop_back();
        for (int i = 0; i < 3; ++i) {
            const auto g = f->neighbor(i);
            if (g->info() >= 0) continue;
            g->info() = f->info() ^ (f->is_constrained(i) ? 1 : 0);
            todo.push_back(g);
        }
    }
    std::vector<std::array<VertexId, 3>> triangles;
    for (auto f = cdt.finite_faces_begin(); f != cdt.finite_faces_end(); ++f)
        if (f->info() == 1) triangles.push_back({VertexId{f->vertex(0)->info()}, VertexId{f->vertex(1)->info()}, VertexId{f->vertex(2)->info()}});
    return triangles;
}

} // namespace

std::vector<std::array<VertexId, 3>> triangulate(const VertexTable& vertices, PlaneId plane, const std::vector<Loop>& loops) {
    if (loops.size() == 1 && loops[0].size() == 3) return {{loops[0][0], loops[0][1], loops[0][2]}};
    const Projection axes = project_along(vertices.planes(), plane);
    const VertexTable::Data& data = vertices.data();
    bool dyadic = true;
    for (const Loop& loop : loops)
        for (const VertexId v : loop) dyadic = dyadic && data.dyadic[v.at()];
    try {
        if (dyadic)
            return triangulate_with<Fast>(loops, [&](VertexId v) {
                const Vec3 p = data.positions[v.at()];
                return Fast::Point_2(p[static_cast<std::size_t>(axes.u)], p[static_cast<std::size_t>(axes.v)]);
            });
        return triangulate_with<Exact>(loops, [&](VertexId v) {
            return Exact::Point_2(data.coordinate(v.value, axes.u), data.coordinate(v.value, axes.v));
        });
    } catch (const std::exception&) {
        return {};
    }
}

} // namespace kiln

#include "tests/proof/geometry/oracle.h"
#include "compiler/csg/box_tree.h"
#include <CGAL/Boolean_set_operations_2.h>
#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Polygon_set_2.h>
#include <algorithm>
#include <fmt/format.h>

namespace kiln::proof {
namespace {

using K = CGAL::Exact_predicates_exact_constructions_kernel;
using FT = K::FT;
using Point = K::Point_2;
using Polygon = CGAL::Polygon_2<K>;
using Region = CGAL::Polygon_set_2<K>;

FT exact(__int128 v) { // by pieces that doubles hold exactly
    const bool negative = v < 0;
    unsigned __int128 m = negative ? -static_cast<unsigned __int128>(v) : static_cast<unsigned __int128>(v);
    FT result(0), unit(1);
    for (; m; m >>= 32, unit = unit * FT(4294967296.0)) result += unit * FT(static_cast<double>(static_cast<std::uint32_t>(m)));
    return negative ? FT(-result) : result;
}
FT exact(const Decimal& d) {
    FT value = exact(static_cast<__int128>(d.mantissa));
    for (int e = d.exponent; e < 0; ++e) value /= FT(10);
    for (int e = d.exponent; e > 0; --e) value *= FT(10);
    value = FT(value.exact());
    return value;
}

struct Plane { // n . x <= d inside; FT() has no value
    std::array<FT, 3> n{FT(0), FT(0), FT(0)};
    FT d{0};
};
Plane from_text(const WorldSide& side) {
    std::array<std::array<FT, 3>, 3> p;
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k) p[i][k] = exact(side.points[i][k]);
    Plane plane;
    std::array<FT, 3> u, v;
    for (std::size_t k = 0; k < 3; ++k) u[k] = p[2][k] - p[0][k], v[k] = p[1][k] - p[0][k];
    for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t i = (k + 1) % 3, j = (k + 2) % 3;
        plane.n[k] = u[i] * v[j] - u[j] * v[i];
        plane.d += plane.n[k] * p[0][k];
    }
    return plane;
}
Plane from_table(const PlaneTable& planes, PlaneId id) {
    const ExactPlane& p = planes.planes[id.at()];
    return {{exact(p.a), exact(p.b), exact(p.c)}, exact(p.d) / exact(static_cast<__int128>(1) << planes.grid_bits)};
}

// A plane seen along the axis of its normal's largest part.
struct View {
    Plane plane;
    std::size_t u, v, w;
    explicit View(const Plane& p) : plane(p) {
        std::size_t k = 0;
        for (std::size_t i = 1; i < 3; ++i)
            if (CGAL::abs(p.n[i]) > CGAL::abs(p.n[k])) k = i;
        w = k, u = (k + 1) % 3, v = (k + 2) % 3;
    }
    struct Line { // a x + b y <= c
        FT a, b, c;
    };
    Line trace(const Plane& q) const {
        const FT f = q.n[w] / plane.n[w];
        return {q.n[u] - f * plane.n[u], q.n[v] - f * plane.n[v], q.d - f * plane.d};
    }
};

using Corners = std::vector<Point>; // convex, counter-clockwise
Corners clip(const Corners& in, const View::Line& l) {
    Corners out;
    std::vector<FT> at;
    for (const Point& p : in) at.push_back(l.a * p.x() + l.b * p.y() - l.c);
    for (std::size_t i = 0; i < in.size(); ++i) {
        const std::size_t j = (i + 1) % in.size();
        const auto si = CGAL::sign(at[i]), sj = CGAL::sign(at[j]);
        if (si <= 0) out.push_back(in[i]);
        if (si * sj < 0) {
            const FT t = at[i] / (at[i] - at[j]);
            out.emplace_back(in[i].x() + t * (in[j].x() - in[i].x()), in[i].y() + t * (in[j].y() - in[i].y()));
        }
    }
    FT twice(0);
    for (std::size_t i = 1; i + 1 < out.size(); ++i)
        twice += (out[i].x() - out[0].x()) * (out[i + 1].y() - out[0].y()) - (out[i].y() - out[0].y()) * (out[i + 1].x() - out[0].x());
    if (out.size() < 3 || CGAL::is_zero(twice)) out.clear();
    return out;
}
FT area(const Polygon& p) {
    FT twice(0);
    for (std::size_t i = 0; i < p.size(); ++i) {
        const Point &a = p[i], &b = p[(i + 1) % p.size()];
        twice += a.x() * b.y() - a.y() * b.x();
    }
    return twice / 2;
}
FT area(const Region& region) {
    std::vector<CGAL::Polygon_with_holes_2<K>> parts;
    region.polygons_with_holes(std::back_inserter(parts));
    FT sum(0);
    for (const auto& p : parts) {
        sum += area(p.outer_boundary());
        for (auto h = p.holes_begin(); h != p.holes_end(); ++h) sum += area(*h); // clockwise: negative
    }
    return sum;
}
Polygon polygon(const Corners& c) { return {c.begin(), c.end()}; }

} // namespace

Findings compare_fragments(const World& world, const Csg& csg, OraclePlanes from, std::size_t stride) {
    Findings out;
    std::vector<Plane> side_plane(world.sides.size());
    std::vector<std::vector<std::uint32_t>> brush_sides(csg.brushes.size());
    for (std::size_t b = 0; b < csg.brushes.size(); ++b) {
        if (!csg.brushes[b].valid) continue;
        const auto take = [&](std::uint32_t s, const Plane& p) {
            side_plane[s] = p;
            brush_sides[b].push_back(s);
        };
        if (from == OraclePlanes::text)
            for (std::uint32_t s = world.brushes[b].first_side; s < world.brushes[b].first_side + world.brushes[b].side_count; ++s)
                take(s, from_text(world.sides[s]));
        else
            for (std::size_t f = 0; f < csg.brushes[b].faces.size(); ++f)
                take(csg.brushes[b].sides[f].value, from_table(csg.planes, csg.brushes[b].faces[f].support));
    }
    std::vector<Box3> boxes;
    for (const BrushPolytope& b : csg.brushes) boxes.push_back(b.bounds);
    const csg_detail::BoxTree tree(boxes);
    std::vector<std::vector<std::size_t>> fragments_of(world.sides.size());
    for (std::size_t f = 0; f < csg.fragments.size(); ++f) fragments_of[csg.fragments[f].side.at()].push_back(f);

    std::size_t face_count = 0;
    std::vector<std::uint32_t> near;
    for (std::size_t b = 0; b < csg.brushes.size(); ++b) {
        const std::optional<int> own = strength(world.brushes[b].contents);
        if (!csg.brushes[b].valid || !own) continue;
        for (const std::uint32_t s : brush_sides[b]) {
            if (face_count++ % stride) continue;
            const View view(side_plane[s]);
            const bool up = view.plane.n[view.w] > 0;
            const FT far(4194304.0);
            Corners face{{-far, -far}, {far, -far}, {far, far}, {-far, far}};
            for (const std::uint32_t t : brush_sides[b])
                if (t != s && !face.empty()) {
                    const View::Line l = view.trace(side_plane[t]);
                    if (!CGAL::is_zero(l.a) || !CGAL::is_zero(l.b)) face = clip(face, l);
                    else if (l.c < 0) face.clear();
                }
            // What of the face each other brush has right in front of it.
            struct Taker {
                int theirs;
                Contents contents;
                bool removes;
                Corners part;
            };
            std::vector<Taker> takers;
            tree.query(csg.brushes[b].bounds, near);
            for (const std::uint32_t o : near) {
                const std::optional<int> theirs = strength(world.brushes[o].contents);
                if (o == b || !theirs || world.brushes[o].model != world.brushes[b].model) continue;
                Corners part = face;
                bool same_face = false;
                for (const std::uint32_t t : brush_sides[o]) {
                    if (part.empty()) break;
                    const View::Line l = view.trace(side_plane[t]);
                    if (!CGAL::is_zero(l.a) || !CGAL::is_zero(l.b)) {
                        part = clip(part, l);
                        continue;
                    }
                    // Parallel. In one plane: the brush is behind it as ours is, or right in front.
                    const bool same_way = (side_plane[t].n[view.w] > 0) == up;
                    if (CGAL::is_zero(l.c)) same_face = same_face || same_way;
                    else if (l.c < 0) part.clear();
                }
                if (part.empty()) continue;
                const bool removes = same_face ? *theirs < *own || (*theirs == *own && o < b) : *theirs <= *own;
                if (removes || !same_face) takers.push_back({*theirs, world.brushes[o].contents, removes, std::move(part)});
            }
            std::ranges::stable_sort(takers, [](const Taker& x, const Taker& y) {
                return std::pair(!x.removes, x.theirs) < std::pair(!y.removes, y.theirs);
            });
            std::map<Contents, Region> expected;
            Region left;
            if (!face.empty()) left.insert(polygon(face));
            for (const Taker& t : takers) {
                Region part(polygon(t.part));
                if (!t.removes) {
                    Region seen = left;
                    seen.intersection(part);
                    expected[t.contents].join(seen);
                }
                left.difference(part);
            }
            expected[Contents::empty] = left;

            struct Found {
                FT sum{0};
                std::vector<Polygon> list;
            };
            std::map<Contents, Found> got;
            for (const std::size_t f : fragments_of[s]) {
                const PlanePolygon& p = csg.fragments[f].polygon;
                Corners corners;
                PlaneId before = p.edges.back();
                const Plane support = from_table(csg.planes, p.support);
                for (const PlaneId after : p.edges) { // Cramer, in CGAL's numbers
                    const View::Line l = view.trace(from_table(csg.planes, before)), m = view.trace(from_table(csg.planes, after));
                    const FT w = l.a * m.b - l.b * m.a;
                    corners.emplace_back((l.c * m.b - l.b * m.c) / w, (l.a * m.c - l.c * m.a) / w);
                    before = after;
                }
                if (!up) std::ranges::reverse(corners);
                auto& [sum, list] = got[csg.fragments[f].front];
                list.push_back(polygon(corners));
                sum += area(list.back());
            }
            ++out.checked;
            std::vector<Contents> classes;
            for (const auto& [c, r] : expected) classes.push_back(c);
            for (const auto& [c, r] : got)
                if (!expected.contains(c)) classes.push_back(c);
            for (const Contents c : classes) {
                const FT wanted = area(expected[c]);
                auto& [sum, list] = got[c];
                const auto where = fmt::format("brush {}, side {}, in front {}", b, s, static_cast<int>(c));
                if (sum != wanted) {
                    out.add(fmt::format("{}: area {} instead of {}", where, CGAL::to_double(sum), CGAL::to_double(wanted)));
                    continue;
                }
                // Equal areas, and no fragment reaches beyond the region: they cover it without overlap.
                for (const Polygon& p : list) {
                    Region rest(p);
                    rest.difference(expected[c]);
                    if (!rest.is_empty()) out.add(where + ": a fragment reaches beyond the region");
                }
            }
        }
    }
    return out;
}

} // namespace kiln::proof

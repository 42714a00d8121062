// Brushes as closed convex polytopes, fragments as the closed boundary of their union.
#include "compiler/verify/oracle.h"
#include "compiler/verify/verify.h"
#include <fmt/format.h>
#include <map>

namespace kiln {
namespace {

using namespace verify;

constexpr double kUlp = 0x1p-52;

void polytopes(const World& world, const Csg& csg, Checker& checker) {
    Check &convex = checker.add("polytope-convex"), &closed = checker.add("polytope-closed");
    for (std::size_t b = 0; b < csg.brushes.size(); ++b) {
        const BrushPolytope& brush = csg.brushes[b];
        using Point = std::array<double, 3>;
        std::map<std::pair<Point, Point>, int> edges; // correctly rounded corners: equal ones are equal
        Box3 bounds;
        for (std::size_t f = 0; f < brush.faces.size(); ++f) {
            const PlanePolygon& face = brush.faces[f];
            bool behind = true;
            for (std::size_t i = 0; i < face.size() && behind; ++i)
                for (const PlanePolygon& other : brush.faces)
                    behind = behind && csg.planes.side(face.support, face.edges[i == 0 ? face.size() - 1 : i - 1], face.edges[i], other.support) <= 0;
            convex.expect(behind, [&] { return Finding{world.location(brush.sides[f]), "a corner of the brush lies in front of one of its sides"}; });
            const std::vector<Vec3> p = points(csg.planes, face);
            for (std::size_t i = 0; i < p.size(); ++i) {
                bounds.add(p[i]);
                const Vec3 a = p[i], c = p[(i + 1) % p.size()];
                if (a == c) continue; // an edge shorter than rounding
                const Point from{a.x, a.y, a.z}, to{c.x, c.y, c.z};
                if (from < to) ++edges[{from, to}];
                else --edges[{to, from}];
            }
        }
        if (!brush.valid) continue;
        for (const auto& [edge, balance] : edges)
            closed.expect(balance == 0, [&] {
                return Finding{world.location(id<BrushId>(b)), fmt::format("the edge at {} does not have two faces", at({edge.first[0], edge.first[1], edge.first[2]}))};
            });
        closed.expect(bounds == brush.bounds, [&] { return Finding{world.location(id<BrushId>(b)), "the bounds are not those of its corners"}; });
    }
}

void fragments(const World& world, const Csg& csg, Checker& checker) {
    Check &within = checker.add("fragments-in-brush"), &apart = checker.add("fragments-uncovered"), &closed = checker.add("fragments-closed");
    const Brushes brushes(world, csg);
    RandomPoints random(7);
    // Per model: the area vectors of a closed surface add up to zero, and so do their moments. The bounds are what
    // rounding of corners can do.
    struct Sum {
        Vec3 area, moment;
        double area_bound = 0, moment_bound = 0;
    };
    std::vector<Sum> sums(world.model_count);
    for (const Fragment& f : csg.fragments) {
        const SourceLocation where = world.location(f.side);
        bool inside = true;
        for (std::size_t i = 0; i < f.polygon.size() && inside; ++i)
            for (const PlanePolygon& face : csg.brushes[f.brush.at()].faces)
                inside = inside && csg.planes.side(f.polygon.support, f.polygon.edges[i == 0 ? f.polygon.size() - 1 : i - 1], f.polygon.edges[i], face.support) <= 0;
        within.expect(inside, [&] { return Finding{where, "a fragment reaches out of its brush"}; });
        const std::vector<Vec3> p = points(csg.planes, f.polygon);
        if (const std::optional<int> own = strength(f.behind)) {
            // A point of the middle that a brush at least as strong holds well inside is covered.
            constexpr double kInside = 1e-3; // map units
            const Vec3 x = random.in(p);
            std::optional<std::uint32_t> by;
            brushes.near(x, [&](std::uint32_t b) {
                const std::optional<int> other = strength(world.brushes[b].contents);
                if (world.brushes[b].model == f.model && other && *other <= *own && brushes.depth(b, x) < -kInside) by = b;
            });
            apart.expect(!by, [&] { return Finding{where, fmt::format("at {} the brush in line {} covers it", at(x), world.brushes[*by].line)}; });
        }
        if (f.behind != Contents::solid) continue;
        Sum& s = sums[f.model.at()];
        double reach = 0, perimeter = 0;
        for (std::size_t i = 0; i < p.size(); ++i) {
            for (std::size_t k = 0; k < 3; ++k) reach = std::max(reach, std::abs(p[i][k]));
            perimeter += length(p[(i + 1) % p.size()] - p[i]);
        }
        for (std::size_t i = 1; i + 1 < p.size(); ++i) {
            const Vec3 a = cross(p[i] - p[0], p[i + 1] - p[0]) * 0.5;
            s.area += a;
            s.moment += cross((p[0] + p[i] + p[i + 1]) / 3, a);
            s.area_bound += kUlp * length(s.area), s.moment_bound += kUlp * length(s.moment); // of the sums themselves
        }
        s.area_bound += 4 * kUlp * reach * perimeter;
        s.moment_bound += 8 * kUlp * reach * (reach * perimeter + area(p));
    }
    for (std::size_t m = 0; m < sums.size(); ++m) {
        std::size_t entity = 0;
        for (std::size_t e = 0; e < world.entities.size(); ++e)
            if (m > 0 && world.entities[e].model.value == m) entity = e;
        closed.expect(length(sums[m].area) <= sums[m].area_bound && length(sums[m].moment) <= sums[m].moment_bound, [&] {
            return Finding{world.location(id<EntityId>(entity)), fmt::format("the structural surface of model {} is not closed: its area vectors add up to {}, rounding explains {:.3g}", m, at(sums[m].area), sums[m].area_bound)};
        });
    }
}

} // namespace

void verify_csg(const World& world, const Csg& csg, const VerifyOptions&, Checker& checker) {
    const std::uint64_t before = checker.failures();
    check_invariants(csg, world, checker);
    if (checker.failures() != before) return;
    polytopes(world, csg, checker);
    fragments(world, csg, checker);
}

} // namespace kiln

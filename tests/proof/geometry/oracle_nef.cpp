#include "tests/proof/geometry/oracle.h"
#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Nef_polyhedron_3.h>
#include <CGAL/Polyhedron_3.h>
#include <CGAL/boost/graph/convert_nef_polyhedron_to_polygon_mesh.h>
#include <CGAL/convex_hull_3.h>
#include <fmt/format.h>

namespace kiln::proof {
namespace {

using K = CGAL::Exact_predicates_exact_constructions_kernel;
using FT = K::FT;
using Nef = CGAL::Nef_polyhedron_3<K>;

FT exact(const std::string& digits) {
    FT value(0);
    for (const char c : digits)
        if (c != '-') value = value * FT(10) + FT(c - '0');
    value = FT(value.exact());
    return digits[0] == '-' ? FT(-value) : value;
}
K::Point_3 exact_point(const PlaneTable& planes, PlaneId p, PlaneId q, PlaneId r) {
    const auto t = planes.exact_point(p, q, r);
    const FT w = exact(t[3]);
    return {exact(t[0]) / w, exact(t[1]) / w, exact(t[2]) / w};
}
std::vector<K::Point_3> corners(const PlaneTable& planes, const PlanePolygon& polygon) {
    std::vector<K::Point_3> result;
    PlaneId before = polygon.edges.back();
    for (const PlaneId after : polygon.edges) result.push_back(exact_point(planes, polygon.support, before, after)), before = after;
    return result;
}

// Twice the area, as a vector, by the plane it lies in (normal and distance divided by the largest part of the normal),
// and six times the volume.
struct Sums {
    std::map<std::array<FT, 5>, K::Vector_3> over;
    FT volume{0};
    void add(const std::vector<K::Point_3>& p) {
        K::Vector_3 twice(0, 0, 0);
        for (std::size_t i = 1; i + 1 < p.size(); ++i) twice = twice + CGAL::cross_product(p[i] - p[0], p[i + 1] - p[0]);
        if (twice == CGAL::NULL_VECTOR) return;
        FT d = twice * (p[0] - CGAL::ORIGIN);
        volume += d;
        int k = 0;
        for (int i = 1; i < 3; ++i)
            if (CGAL::abs(twice[i]) > CGAL::abs(twice[k])) k = i;
        const FT scale = CGAL::abs(twice[k]);
        std::array<FT, 5> key{FT((twice[0] / scale).exact()), FT((twice[1] / scale).exact()), FT((twice[2] / scale).exact()),
                              FT((d / scale).exact()), FT(0)};
        const auto [at, fresh] = over.emplace(key, twice);
        if (!fresh) at->second = at->second + twice;
    }
};

} // namespace

Findings compare_union(const World& world, const Csg& csg) {
    Findings out;
    Sums ours, theirs;
    for (const Fragment& f : csg.fragments)
        if (f.behind == Contents::solid && f.model.value == 0) ours.add(corners(csg.planes, f.polygon));
    Nef all;
    for (std::size_t b = 0; b < csg.brushes.size(); ++b) {
        if (!csg.brushes[b].valid || world.brushes[b].model.value != 0 || world.brushes[b].contents != Contents::solid) continue;
        std::vector<K::Point_3> points;
        for (const PlanePolygon& f : csg.brushes[b].faces)
            for (const K::Point_3& p : corners(csg.planes, f)) points.push_back(p);
        CGAL::Polyhedron_3<K> hull;
        CGAL::convex_hull_3(points.begin(), points.end(), hull);
        all += Nef(hull);
        ++out.checked;
    }
    all = all.regularization();
    std::vector<K::Point_3> vertices;
    std::vector<std::vector<std::size_t>> faces;
    CGAL::convert_nef_polyhedron_to_polygon_soup(all, vertices, faces, true);
    for (const auto& f : faces) {
        std::vector<K::Point_3> p;
        for (const std::size_t v : f) p.push_back(vertices[v]);
        theirs.add(p);
    }
    if (ours.volume != theirs.volume)
        out.add(fmt::format("volume {} instead of {}", CGAL::to_double(ours.volume) / 6, CGAL::to_double(theirs.volume) / 6));
    if (ours.over != theirs.over) out.add(fmt::format("areas over {} planes differ from those over {}", ours.over.size(), theirs.over.size()));
    return out;
}

} // namespace kiln::proof

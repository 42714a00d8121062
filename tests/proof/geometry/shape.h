// How thin things are: widths of polygons and of leaves.
#pragma once
#include "compiler/bsp/bsp.h"
#include <algorithm>

namespace kiln::proof {

inline double polygon_area(const std::vector<Vec3>& p) {
    Vec3 twice{};
    for (std::size_t i = 1; i + 1 < p.size(); ++i) twice += cross(p[i] - p[0], p[i + 1] - p[0]);
    return length(twice) / 2;
}
// Least extent within its plane: of a convex polygon it is taken across some edge.
inline double polygon_width(const std::vector<Vec3>& p, Vec3 normal) {
    double least = 1e30;
    for (std::size_t i = 0; i < p.size(); ++i) {
        const Vec3 edge = p[(i + 1) % p.size()] - p[i];
        if (length(edge) < 1e-9) continue;
        const Vec3 across = normalize(cross(normal, edge));
        double reach = 0;
        for (const Vec3& q : p) reach = std::max(reach, dot(across, q - p[i]));
        least = std::min(least, reach);
    }
    return least;
}

struct Slivers {
    std::size_t count = 0; // fragments narrower than the limit
    double area = 0;       // of them, map units squared
};
inline Slivers slivers(const Csg& csg, double limit) {
    Slivers s;
    for (const Fragment& f : csg.fragments) {
        const std::vector<Vec3> p = points(csg.planes, f.polygon);
        if (polygon_width(p, csg.planes.normal(f.polygon.support)) >= limit) continue;
        ++s.count, s.area += polygon_area(p);
    }
    return s;
}

// Least extent of each open leaf across one of its faces.
inline double thinnest_leaf(const Bsp& bsp, Vec3* where = nullptr) {
    double thinnest = 1e30;
    const auto polytopes = leaf_polytopes(bsp);
    for (std::size_t l = 0; l < polytopes.size(); ++l) {
        if (!bsp.leaves[l].open()) continue;
        for (const PlanePolygon& f : polytopes[l]) {
            const Vec3 n = bsp.planes.normal(f.support);
            const Vec3 on = points(bsp.planes, f).front();
            double reach = 0;
            for (const PlanePolygon& g : polytopes[l])
                for (const Vec3& p : points(bsp.planes, g)) reach = std::max(reach, dot(n, on - p));
            if (reach < thinnest) {
                thinnest = reach;
                if (where) *where = on;
            }
        }
    }
    return thinnest;
}

} // namespace kiln::proof

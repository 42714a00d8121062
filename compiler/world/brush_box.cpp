#include "compiler/world/brush_box.h"
#include <cmath>

namespace kiln {

Box3 box_of(const DocBrush& brush) {
    struct Plane {
        Vec3 n;
        double d;
    };
    std::vector<Plane> planes;
    for (const DocSide& s : brush.sides) {
        std::array<Vec3, 3> p;
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t k = 0; k < 3; ++k) p[i][k] = s.points[i][k].to_double();
        const Vec3 n = normalize(cross(p[2] - p[0], p[1] - p[0])); // outward: points run clockwise
        planes.push_back({n, dot(n, p[0])});
    }
    constexpr std::size_t kMostSides = 64; // corners are found by trying all triples
    constexpr double kOutside = 0.01;      // map units
    Box3 box;
    if (planes.size() > kMostSides) { // plane points lie on the faces as editors write them
        for (const DocSide& s : brush.sides)
            for (const auto& p : s.points) box.add(Vec3{p[0].to_double(), p[1].to_double(), p[2].to_double()});
        return box;
    }
    for (std::size_t i = 0; i < planes.size(); ++i)
        for (std::size_t j = i + 1; j < planes.size(); ++j)
            for (std::size_t k = j + 1; k < planes.size(); ++k) {
                const Vec3 jk = cross(planes[j].n, planes[k].n);
                const double det = dot(planes[i].n, jk);
                if (std::abs(det) < 1e-9) continue;
                const Vec3 x = (jk * planes[i].d + cross(planes[k].n, planes[i].n) * planes[j].d +
                                cross(planes[i].n, planes[j].n) * planes[k].d) /
                               det;
                bool inside = true;
                for (const Plane& q : planes) inside = inside && dot(q.n, x) <= q.d + kOutside;
                if (inside) box.add(x);
            }
    return box;
}

} // namespace kiln

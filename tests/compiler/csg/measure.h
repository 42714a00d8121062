// Integrals over fragments for the laws of CSG, and a compile that must succeed.
#pragma once
#include "compiler/csg/csg.h"
#include "tests/support/world_builder.h"
#include <gtest/gtest.h>
#include <random>
#include <stdexcept>

namespace kiln::test {

struct Boundary {
    Vec3 area_vector{}; // zero for a closed surface
    double area = 0;
    double volume = 0;  // by Gauss: a third of the integral of x . n
    std::size_t fragments = 0;
    double closure() const { return length(area_vector) / area; }
};

inline void add(Boundary& b, const PlaneTable& planes, const PlanePolygon& polygon) {
    const std::vector<Vec3> p = points(planes, polygon);
    Vec3 twice{};
    for (std::size_t i = 1; i + 1 < p.size(); ++i) twice += cross(p[i] - p[0], p[i + 1] - p[0]);
    b.area_vector += twice * 0.5;
    b.area += dot(twice, planes.normal(polygon.support)) / 2;
    b.volume += dot(twice, p[0]) / 6;
    ++b.fragments;
}

// Of the structural solids of a model, covered parts included; or of another kind of contents.
inline Boundary boundary(const Csg& csg, Contents behind = Contents::solid, ModelId model = {0}) {
    Boundary b;
    for (const Fragment& f : csg.fragments)
        if (f.behind == behind && f.model == model) add(b, csg.planes, f.polygon);
    return b;
}

inline Csg compile(const World& world, CsgOptions options = {}, int threads = 1) {
    Context context;
    context.threads = threads;
    Result<Csg> csg = build_csg(world, options, context);
    if (!csg) throw std::runtime_error(to_text(csg.fault().diagnostic)); // ends the test
    validate(*csg, world);
    return std::move(*csg);
}

inline double uniform(std::mt19937_64& rng, double lo, double hi) {
    return lo + (hi - lo) * (static_cast<double>(rng() >> 11) * 0x1p-53);
}
// On the 2^-bits grid.
inline double on_grid(double x, int bits) { return std::ldexp(std::round(std::ldexp(x, bits)), -bits); }
inline Vec3 random_point(std::mt19937_64& rng, double range, int bits = 0) {
    return {on_grid(uniform(rng, -range, range), bits), on_grid(uniform(rng, -range, range), bits),
            on_grid(uniform(rng, -range, range), bits)};
}
// Boxes and tetrahedra, about as many of one as of the other.
inline void random_brush(WorldBuilder& w, std::mt19937_64& rng, double range, double size, int bits = 0,
                         Contents contents = Contents::solid) {
    const Vec3 at = random_point(rng, range, bits);
    if (rng() & 1) {
        const Vec3 s{on_grid(uniform(rng, 1, size), bits), on_grid(uniform(rng, 1, size), bits),
                     on_grid(uniform(rng, 1, size), bits)};
        w.box(at, at + s, contents);
        return;
    }
    for (;;) {
        std::array<Vec3, 4> p;
        for (Vec3& v : p) v = at + random_point(rng, size, bits);
        if (std::fabs(dot(cross(p[1] - p[0], p[2] - p[0]), p[3] - p[0])) < 1) continue;
        w.tetrahedron(p, contents);
        return;
    }
}

} // namespace kiln::test

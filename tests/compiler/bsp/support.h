// What the tests of the BSP share: building, brute-force contents, volumes.
#pragma once
#include "compiler/bsp/bsp.h"
#include "tests/support/world_builder.h"
#include <gtest/gtest.h>

namespace kiln::test {

struct Built {
    World world;
    Csg csg;
    Bsp bsp;
    std::optional<Leak> leak;
    std::vector<Leak> leaks;
    std::vector<Diagnostic> diagnostics;

    std::size_t count(std::string_view code) const {
        std::size_t n = 0;
        for (const Diagnostic& d : diagnostics) n += d.code == code;
        return n;
    }
    std::size_t leaves(auto&& which) const {
        std::size_t n = 0;
        for (const BspLeaf& l : bsp.leaves) n += which(l);
        return n;
    }
};

inline Built build(World world, const BspOptions& options = {}) {
    Built b;
    b.world = std::move(world);
    Context context;
    auto csg = build_csg(b.world, {}, context);
    if (!csg) {
        ADD_FAILURE() << to_text(csg.fault().diagnostic);
        return b;
    }
    b.csg = std::move(*csg);
    auto bsp = build_bsp(b.world, b.csg, options, context);
    if (!bsp) {
        ADD_FAILURE() << to_text(bsp.fault().diagnostic);
        return b;
    }
    b.bsp = std::move(*bsp);
    auto leaks = find_leaks(b.world, b.csg, b.bsp, options, context);
    if (!leaks) {
        ADD_FAILURE() << to_text(leaks.fault().diagnostic);
        return b;
    }
    b.leak = std::move(leaks->leak), b.leaks = std::move(leaks->leaks);
    if (b.leak) { // as the whole compiler does it where leaks are allowed
        BspOptions open = options;
        open.fill = false;
        b.bsp = *build_bsp(b.world, b.csg, open, context);
        EXPECT_TRUE(b.bsp.closed.empty());
    }
    b.diagnostics = context.take_diagnostics();
    validate(b.bsp, b.csg);
    return b;
}

// Signed distance to a convex brush's faces: negative inside. A lower bound of the distance outside.
inline double depth(const Csg& csg, const BrushPolytope& brush, Vec3 p) {
    double d = -1e30;
    for (const PlanePolygon& f : brush.faces)
        d = std::max(d, dot(csg.planes.normal(f.support), p) - csg.planes.distance(f.support));
    return d;
}

// The strongest contents of the world at a point by looking at every brush; nothing if too near to some face.
inline std::optional<Contents> contents_at(const Built& b, Vec3 p, double clearance) {
    Contents strongest = Contents::empty;
    for (std::size_t i = 0; i < b.csg.brushes.size(); ++i) {
        const WorldBrush& w = b.world.brushes[i];
        if (!b.csg.brushes[i].valid || w.model.value != 0) continue;
        if (w.contents == Contents::detail || w.contents == Contents::clip || w.contents == Contents::trigger ||
            w.contents == Contents::hint)
            continue;
        const double d = depth(b.csg, b.csg.brushes[i], p);
        if (std::abs(d) < clearance) return std::nullopt;
        if (d < 0 && (strongest == Contents::empty || w.contents < strongest)) strongest = w.contents;
    }
    return strongest;
}

inline double volume(const PlaneTable& planes, const std::vector<PlanePolygon>& polytope) {
    double six = 0;
    for (const PlanePolygon& f : polytope) {
        const std::vector<Vec3> p = points(planes, f);
        for (std::size_t i = 2; i < p.size(); ++i) six += dot(p[0], cross(p[i - 1], p[i]));
    }
    return six / 6;
}

inline double polygon_area(const std::vector<Vec3>& p) {
    Vec3 sum{};
    for (std::size_t i = 2; i < p.size(); ++i) sum += cross(p[i - 1] - p[0], p[i] - p[0]);
    return length(sum) / 2;
}

inline Vec3 middle(const std::vector<Vec3>& p) {
    Vec3 sum{};
    for (const Vec3& v : p) sum += v / static_cast<double>(p.size());
    return sum;
}

} // namespace kiln::test

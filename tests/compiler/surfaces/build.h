// From a world made by hand to its surfaces, every stage validated.
#pragma once
#include "compiler/surfaces/surfaces.h"
#include "tests/support/world_builder.h"
#include <gtest/gtest.h>

namespace kiln::test {

struct Built {
    Csg csg;
    Bsp bsp;
    Surfaces surfaces;
    std::vector<Diagnostic> diagnostics;
    bool reported(std::string_view code) const {
        return std::ranges::any_of(diagnostics, [&](const Diagnostic& d) { return d.code == code; });
    }
};

inline Built build(const World& world, bool allow_leaks = false, int threads = 1, const SurfacesOptions& options = {}) {
    Context context;
    context.threads = threads;
    Built built;
    Result<Csg> csg = build_csg(world, {}, context);
    if (!csg) throw std::runtime_error(to_text(csg.fault().diagnostic));
    built.csg = *std::move(csg);
    BspOptions bsp_options;
    bsp_options.fill = !allow_leaks;
    Result<Bsp> bsp = build_bsp(world, built.csg, bsp_options, context);
    if (!bsp) throw std::runtime_error(to_text(bsp.fault().diagnostic));
    built.bsp = *std::move(bsp);
    Result<Surfaces> surfaces = build_surfaces(world, built.csg, built.bsp, options, context);
    if (!surfaces) throw std::runtime_error(to_text(surfaces.fault().diagnostic));
    built.surfaces = *std::move(surfaces);
    validate(built.surfaces);
    built.diagnostics = context.take_diagnostics();
    return built;
}

// The inside of a sealed room with an entity in it, so that the outside is filled.
inline void sealed_room(WorldBuilder& b, Vec3 lo, Vec3 hi, MaterialId m = {0}) {
    b.room(lo, hi, 16, m);
    b.point_entity("info_player_start", (lo + hi) * 0.5);
}

// Faces whose plane has this normal and distance.
inline std::vector<FaceId> faces_on(const Surfaces& s, Vec3 normal, double distance) {
    std::vector<FaceId> found;
    for (std::size_t f = 0; f < s.faces.size(); ++f)
        if (length(s.faces[f].normal - normal) < 1e-9 && std::abs(s.faces[f].distance - distance) < 1e-9) found.push_back(id<FaceId>(f));
    return found;
}

inline double total_area(const Surfaces& s) {
    double sum = 0;
    for (const Face& f : s.faces) sum += f.area;
    return sum;
}

inline double footprint_area(const Surfaces& s, ChartId chart) { // map units squared
    double sum = 0;
    for (const Luxel& l : s.luxels)
        if (l.chart == chart) sum += l.area;
    return sum * s.charts[chart.at()].luxel_size * s.charts[chart.at()].luxel_size;
}

} // namespace kiln::test

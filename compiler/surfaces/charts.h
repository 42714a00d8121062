// Charts: coplanar, edge-connected faces of one tangent frame and luxel size share a luxel grid.
#pragma once
#include "compiler/surfaces/adjacency.h"
#include "compiler/surfaces/faces.h"

namespace kiln {

constexpr std::uint32_t kMaxChartTexels = 2046; // a side, gutter included: fits an atlas page of 2048 with its border

// Fills surfaces.charts, texel_count, seams and the faces' chart.
std::uint64_t make_charts(Surfaces& surfaces, const std::vector<FaceDraft>& drafts, const Adjacency& adjacency, const World& world,
                 Context& context);

inline Vec2 luxel_coordinate(const Chart& chart, Vec3 x) {
    const Vec3 d = x - chart.origin;
    return {dot(d, chart.s) / chart.luxel_size, dot(d, chart.t) / chart.luxel_size};
}

} // namespace kiln

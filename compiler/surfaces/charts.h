// Charts: coplanar, edge-connected faces of one tangent frame and luxel size share a luxel grid, but not across thin walls.
#pragma once
#include "compiler/surfaces/adjacency.h"
#include "compiler/surfaces/faces.h"

namespace kiln {

constexpr std::uint32_t kMaxChartTexels = 2046; // a side, gutter included: fits an atlas page of 2048 with its border

// Fills surfaces.charts, texel_count, seams and the faces' chart. `curve_charts`: of curves, in their order; added for
// those that have lit faces.
std::uint64_t make_charts(Surfaces& surfaces, const std::vector<FaceDraft>& drafts, std::vector<Chart> curve_charts,
                          const Adjacency& adjacency, const World& world, Context& context);

} // namespace kiln

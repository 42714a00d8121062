// Luxel footprints: each texel's square cut with the visible faces of its chart, in convex pieces.
#pragma once
#include "compiler/surfaces/charts.h"

namespace kiln {

// Fills surfaces.luxels, pieces, piece_points and centroids.
void make_luxels(Surfaces& surfaces, const std::vector<FaceDraft>& drafts, const VertexTable& vertices, Context& context);

} // namespace kiln

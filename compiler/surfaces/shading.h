// Shading normals: flat, or angle-weighted over the faces of a smoothing group around each vertex.
#pragma once
#include "compiler/surfaces/adjacency.h"
#include "compiler/surfaces/faces.h"

namespace kiln {

// May corners of the face be smoothed? For these shade_corners needs fans.
bool may_smooth(const FaceDraft& draft);

// Fills surfaces.corner_normals. `drafts` is parallel to surfaces.faces.
void shade_corners(Surfaces& surfaces, const std::vector<FaceDraft>& drafts, const Adjacency& adjacency);

} // namespace kiln

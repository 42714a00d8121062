// Overlays and decals cut to the triangles they lie on.
#pragma once
#include "compiler/surfaces/surfaces.h"

namespace kiln {

// In       s: faces and triangles complete
// Out      s.overlay_fragments, s.overlay_points
// Errors   overlay-nowhere (warning): an overlay or decal that meets no drawn face
//
// An overlay is a prism: its quad swept along its normal, both ways, without end. Of the faces of its sides those that
// look towards its front are cut by it, triangle by triangle, so curved faces need nothing special; where there are none,
// those that look away. A quad that is no parallelogram is two triangles, each with its own linear texture coordinates.
// A decal is a box of limited depth in front of the nearest face; it is cut out of all faces of that model that look
// roughly its way.
// Points on an edge that two triangles share are the same to the last bit.
void add_overlays(Surfaces& s, const World& world, Context& context);

} // namespace kiln

// Overlays and decals: what the entities say. Private to the folder.
#pragma once
#include "compiler/world/world.h"

namespace kiln {

// Fills world.overlays from info_overlay, infodecal and _decal, in entity order; materials they use join the world's.
// Errors   overlay-unreadable (warning): a key that is no vector, a basis without volume or no material; the overlay is
//          left out. side-missing: of its side list
void read_overlays(World& world, MaterialDatabase& materials, Context& context);

} // namespace kiln

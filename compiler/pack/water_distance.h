// How far each leaf is from the liquid that can be seen from it. Private to pack.
#pragma once
#include "compiler/visibility/visibility.h"

namespace kiln {

// Per leaf, map units: from its box to that of the nearest piece of a liquid's surface, of liquid that may be seen from the
// leaf's cluster; never more than the true distance. 0 in liquid; infinite: sees none, or has no cluster. A surface
// is a portal between a liquid and something else; a liquid without any, filling its room, is its leaves.
std::vector<float> leaf_water_distances(const Bsp& bsp, const Visibility& visibility);

} // namespace kiln

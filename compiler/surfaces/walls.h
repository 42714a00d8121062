// Where a wall thinner than two luxels stands on a lit surface, bilinear filtering would read luxels of its other side.
// The rooms on both sides often are one chart all the same, joined through a door or round the end of the wall.
#pragma once
#include "libs/math/vec.h"
#include <cstdint>
#include <vector>

namespace kiln {

// Convex polygons of one plane, luxel coordinates, counter-clockwise, which overlap nowhere. For each of them the number
// of the chart it belongs to: equal numbers share a luxel grid where they are joined by edges. 0 for all where nothing
// has to be parted. Parted are polygons that read the centre of one texel from both sides of a wall; polygons that are
// joined close by, round a pillar or the end of a wall, are not.
std::vector<std::uint32_t> part_at_walls(const std::vector<std::vector<Vec2>>& polygons);

} // namespace kiln

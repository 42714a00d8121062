// Exact questions about points that are given as the meeting of three planes: order along an axis, turn in a plane.
// For what rounded coordinates cannot settle; no filter stands before the wide integers here.
#pragma once
#include "libs/exact/plane.h"

namespace kiln {

using PlaneTriple = std::array<PlaneId, 3>; // planes that meet in one point

// Sign of a - b along an axis.
int compare_along(const PlaneTable& table, const PlaneTriple& a, const PlaneTriple& b, std::size_t axis);
// Sign of cross(b - a, c - a) in the coordinates (u, v): +1 where a, b, c turn left with u to the right and v up.
int turn(const PlaneTable& table, const PlaneTriple& a, const PlaneTriple& b, const PlaneTriple& c, std::size_t u, std::size_t v);

} // namespace kiln

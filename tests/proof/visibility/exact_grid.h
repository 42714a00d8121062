// Visibility of square cells exactly, by trying every way a line can take: no rounding, no sampling.
#pragma once
#include "tests/compiler/visibility/grid_map.h"

namespace kiln::proof {

// Row-major cluster_count^2: is there a line from the inside of one cell to the inside of the other that passes the inside
// of every edge it crosses? One cell must be one cluster. A line that goes right and down, say, crosses edges with one
// end on its left and one on its right; there is one through given edges exactly if a line parts their left ends from
// their right ones, and points of the plane are parted exactly if every four of them are (P. Kirchberger 1903).
std::vector<char> exact_pairs(const test::GridMap& map);

} // namespace kiln::proof

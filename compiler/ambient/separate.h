// What the air of one cell sees: which corners from where, and, where a wall crosses the cell, planes inside the wall
// that part its sides.
#pragma once
#include "compiler/ambient/air.h"

namespace kiln::ambient {

struct Side {                              // of a cell's air; a decision list: the first side whose plane has p behind
    std::vector<std::uint32_t> samples;    // indices, ascending
    std::uint8_t common = 0, any = 0;      // corners seen from all, from some of them
    bool has_plane = false;                // the last side has none
    Vec3 normal{};
    double distance = 0;                   // behind: dot(normal, p) <= distance
};
struct Sides {
    std::vector<Side> sides;
    std::uint64_t rays = 0;
    bool single_valued() const;            // every side sees its corners as one, and some corner at all
};

// `sees[i]`: corners (bits) that points[i] sees. At most `most` sides.
Sides separate(const Air& air, const std::vector<Vec3>& points, const std::vector<std::uint8_t>& sees, std::size_t most);

} // namespace kiln::ambient

// Which triangles meet at edges and around vertices, from a half-edge mesh of the faces.
#pragma once
#include "compiler/surfaces/surfaces.h"

namespace kiln {

struct Adjacency {
    static constexpr std::uint32_t kNone = UINT32_MAX;
    // Triangle across edge e (from corner e to corner e + 1) of triangle t at [t][e]; kNone: open.
    std::vector<std::array<std::uint32_t, 3>> across;
    // Triangles around a corner that are joined to it edge by edge, itself included, ascending:
    // fan_triangles[fan_first[f] .. fan_first[f + 1]) for f = fan[t][corner].
    std::vector<std::array<std::uint32_t, 3>> fan;
    std::vector<std::uint32_t> fan_first, fan_triangles;
};

// Of the tables positions, triangles, triangle_face and faces. Where more than two faces meet in an edge, those are
// neighbours that bound the same wedge of air.
Adjacency find_adjacency(const Surfaces& surfaces);

} // namespace kiln

// Which triangles meet at edges and around vertices; the latter from a half-edge mesh of the faces that ask.
#pragma once
#include "compiler/surfaces/surfaces.h"

namespace kiln {

struct Adjacency {
    static constexpr std::uint32_t kNone = UINT32_MAX;
    // Triangle across edge e (from corner e to corner e + 1) of triangle t at [t][e]; kNone: open.
    std::vector<std::array<std::uint32_t, 3>> across;
    // Triangles around a corner that are joined to it edge by edge, itself included, ascending:
    // fan_triangles[fan_first[f] .. fan_first[f + 1]) for f = fan[t][corner]. Of the faces asked for; elsewhere kNone, or a part.
    std::vector<std::array<std::uint32_t, 3>> fan;
    std::vector<std::uint32_t> fan_first, fan_triangles;
};

// Of the tables positions, triangles, triangle_face and faces. Where more than two faces meet in an edge, those are
// neighbours that bound the same wedge of air. `fans_of`: the faces whose corners get their fans, one entry a face.
Adjacency find_adjacency(const Surfaces& surfaces, const std::vector<bool>& fans_of);

} // namespace kiln

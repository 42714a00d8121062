// The fragments a second time, by CGAL with exact numbers and none of our own geometry: each face as a polygon of its
// plane, what other brushes take of it by Boolean set operations. Slow, and right for another reason.
#pragma once
#include "compiler/csg/csg.h"
#include "tests/proof/geometry/laws.h"

namespace kiln::proof {

// Planes the oracle starts from.
enum class OraclePlanes {
    text,  // the three points of each side, as the file gives them: for worlds on the grid, without merging
    csg,   // those the canonicalisation settled on
};
// Compares the fragments of every `stride`-th face, class by class (what lies in front): they must cover the oracle's
// regions exactly.
Findings compare_fragments(const World& world, const Csg& csg, OraclePlanes planes, std::size_t stride);

// Nef polyhedra: the union of all structural brushes of the world at once. Volume and the area over each plane must be
// equal as rational numbers. For a few brushes only.
Findings compare_union(const World& world, const Csg& csg);

} // namespace kiln::proof

// Falsification of visibility: random lines through the tree's open leaves. Each that meets nothing solid proves that all
// clusters along it see each other; one such pair outside the rows refutes them.
#pragma once
#include "compiler/visibility/visibility.h"
#include <string>

namespace kiln::proof {

struct Miss {
    std::uint32_t from = 0, to = 0; // clusters the rows say do not see each other
    Vec3 a, b;                      // ends of a segment between them that passes open leaves alone
};
struct Sightlines {
    std::uint64_t rays = 0, pairs_checked = 0; // lines tried; pairs of clusters along them
    std::uint64_t seen = 0, proven = 0;        // pairs (a, b) in the rows, and of these proven, a = b included
    std::uint64_t missing = 0;                 // pairs checked that are not in the rows
    std::vector<Miss> misses;                  // the first few of these
    double excess() const { return proven ? static_cast<double>(seen) / static_cast<double>(proven) : 0; }
};

// The lines, by turns: through a random point of the open space in a random direction; through a random point of a random
// portal; and from near an edge of a portal to near an edge of another whose clusters see each other, down to 1e-4 map
// units from it, where what is seen ends. They read the tree alone, no portal decides what blocks. A line ends where it
// leaves the box of all open leaves, and where it would run along a plane, within 1e-7 map units of it, or pass a leaf over less than 1e-6 map units: rounding decides there which leaf it is in.
Sightlines find_sightlines(const Bsp& bsp, std::span<const VisPortal> portals, const Visibility& visibility, std::uint64_t rays, std::uint64_t seed, Context& context);

} // namespace kiln::proof

// Private: planes that coincide but for the rounding of their text become one.
#pragma once
#include "compiler/csg/csg.h"
#include "compiler/csg/polytope.h"
#include <vector>

namespace kiln::csg_detail {

// Map units: faces this near each other may end in one plane. More than touching, so that the wall on both sides of a
// doorway is one plane: an e1m1 turned by odd angles keeps 1630 planes instead of 1920 (of 850 before turning).
constexpr double kMergeReach = 64;

struct MergedSide {
    PlaneId plane;   // the side's plane from now on
    double move = 0; // map units, largest over the face; 0: not moved
};

// The plane of a side off the grid whose corners all lie within the tolerance of whole map units, if those are in one
// plane: it was drawn there, and a tool's arithmetic has since spoiled its numbers. Entered in the table. Parallel to
// world.sides, `none` for all others. `rounded`: parallel too, some plane point is off the grid.
std::vector<PlaneId> planes_on_whole_units(PlaneTable& planes, const std::vector<BrushPolytope>& brushes,
                                           const std::vector<char>& rounded, double tolerance, Context& context);

// `integral`: parallel to world.sides, the side's own plane points are whole map units; `whole`: of planes_on_whole_units.
// Returns one entry per world side; sides without a face keep `none`. Only planes already in the table are chosen. `near`:
// for each brush, the brushes whose boxes come within kMergeReach of its own (itself included or not).
std::vector<MergedSide> merge_planes(const PlaneTable& planes, const std::vector<BrushPolytope>& brushes,
                                     const std::vector<std::vector<std::uint32_t>>& near, const std::vector<char>& integral,
                                     const std::vector<PlaneId>& whole, double tolerance, Context& context);

} // namespace kiln::csg_detail

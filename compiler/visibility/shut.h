// What is seen while area portals are shut: for each area the rows of its clusters when nothing passes the portals around it.
//
// In       the tree, with its areas and area portals; the rows with all portals open
// Out      rows like those, each held in the open one. Of a cluster in one area: clusters of that area, and the leaves of the portals
//          around it, which things may stand in; no line that leaves through one portal and comes back through another. Of a cluster in no
//          area (a portal's own leaf), or in several: its open row
// Method   the flow again, each area for itself, its portals' leaves blind alleys; where no way leads back in through another portal, the open row, cut
#pragma once
#include "compiler/csg/csg.h"
#include "compiler/visibility/visibility.h"

namespace kiln {

// Of each leaf: is it in an area portal that parts two areas, and in none that does not (which engines take as open)? Empty: none is.
std::vector<std::uint8_t> shut_leaves(const Csg& csg, const Bsp& bsp);

// `flow`: false where there is no time; the open rows are then only cut.
Result<std::vector<std::uint64_t>> shut_rows(const Bsp& bsp, std::span<const std::uint8_t> shut, const Visibility& open, bool flow,
                                             const VisibilityOptions& options, Context& context, const VisibilityRun& run = {});

} // namespace kiln

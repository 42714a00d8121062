// The flow through one portal: what lines of sight that pass it can reach, chain of portals by chain of portals.
// Private to compiler/visibility.
#pragma once
#include "compiler/visibility/directed.h"

namespace kiln::vis {

// Keeps the part of a convex winding in front of the plane, and the strip of `open` behind it. False, and `out`
// undefined, where no point lies in front by more than rounding.
bool clip(const std::vector<Vec3>& in, const Plane& plane, double open, std::vector<Vec3>& out);

// Planes with all of `source` behind and all of `pass` in front: whoever looks from source through pass sees only
// what lies in front of each.
void separators(const std::vector<Vec3>& source, const std::vector<Vec3>& pass, std::vector<Plane>& out);

struct FlowInput {
    std::span<const Directed> portals;
    const Exits* exits;
    const BitRows* reach;               // per portal: final where `done`, else an upper bound
    double epsilon;                     // map units every clip leaves standing behind its plane
    std::uint64_t step_budget;          // 0: none
};

// Writes the portals seen through p to `seen` (a row of zeros). False: the budget ran out, `seen` is unusable.
bool flow(const FlowInput& input, std::uint32_t p, std::uint64_t* seen, std::uint64_t* steps);

} // namespace kiln::vis

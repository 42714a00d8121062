// Private: brush sides less what other brushes cover of them.
#pragma once
#include "compiler/csg/csg.h"
#include <vector>

namespace kiln::csg_detail {

// `near`: for each brush, at least the brushes whose boxes touch its own, ascending.
std::vector<Fragment> cut_fragments(const World& world, const PlaneTable& planes,
                                    const std::vector<BrushPolytope>& brushes,
                                    const std::vector<std::vector<std::uint32_t>>& near, Context& context);

} // namespace kiln::csg_detail

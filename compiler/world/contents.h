// What fills a brush, from what its sides are. Private to the folder.
#pragma once
#include "compiler/world/world.h"
#include <span>

namespace kiln {

struct BrushKind {
    Contents contents = Contents::solid;
    bool draws = true, collides = true, blocks_light = true;
    bool origin = false; // it only marks the origin of its entity
    bool mixed = false;  // liquid sides beside solid ones: taken as solid
};
// `flags`: MaterialFlag of each side.
BrushKind kind_of_brush(std::span<const std::uint32_t> flags);

} // namespace kiln

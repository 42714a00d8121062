// What fills a brush, from what its sides are. Private to the folder.
#pragma once
#include "compiler/world/world.h"
#include <span>

namespace kiln {

struct BrushKind {
    Contents contents = Contents::solid;
    bool draws = true, blocks_light = true;
    std::uint8_t blocks = kBlocksAll; // BlocksBit
    bool origin = false; // it only marks the origin of its entity
    bool mixed = false;  // liquid sides beside solid ones: taken as solid
};
// `flags`: MaterialFlag of each side.
BrushKind kind_of_brush(std::span<const std::uint32_t> flags, MapFormat format);
// What a drawn or solid brush of such contents stops; 0 for what only marks a place.
std::uint8_t blocks_of(Contents contents, MapFormat format);

} // namespace kiln

// The three integers of Quake 2 and 3 rows. Private to the folder.
#pragma once
#include "formats/document/document.h"
#include "formats/material/material.h"

namespace kiln {

// Quake 3 keeps the layout of Quake 2 but means only the detail bit: all else comes from its shaders. The two
// can only be told apart by the map: Quake 3 has patches and its tool textures lie in "common/".
bool means_quake3(const Document& document);

// `material` as this row wants it.
Material with_row_flags(Material material, const DocSide& side, MapFormat format, bool quake3);

// Quake 2: `value` of a side that is no light is the number of the group it is smoothed with (WorldSide::smoothing_groups of a
// .map is that number, not a set of bits); 0: none.
std::uint32_t phong_group_of_row(const DocSide& side);

// Bits of a Quake 2 row that the format does not define.
struct UnknownBits {
    std::int64_t contents = 0, surface = 0;
};
UnknownBits unknown_row_bits(const DocSide& side, MapFormat format, bool quake3);

} // namespace kiln

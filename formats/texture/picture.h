// The texels of a texture, for those of which light has to know the holes and the colours.
#pragma once
#include "libs/core/archive.h"
#include "libs/core/result.h"
#include <span>
#include <string>

namespace kiln {

struct TexelPicture {
    int width = 0, height = 0;
    Bytes rgba; // 8 bits, sRGB and linear alpha, row by row from the top left
    bool empty() const { return rgba.empty(); }
};
// The largest size and first frame of a Valve texture. Empty: it is a kind that has no opacity (a cube map, floats, several slices).
// Errors   texture-unreadable: cut short, or no VTF
Result<TexelPicture> read_vtf_picture(std::span<const std::uint8_t> bytes, const std::string& file);

} // namespace kiln

// Texture archives of Quake (WAD2) and Half-Life (WAD3): names, sizes, mean colours.
//
// In       bytes of the archive; for WAD2 those of the palette (768), which is the game's and not in the archive
// Out      its textures that are wanted, in the order of its directory; other entries are passed over
// Errors   texture-unreadable: no archive, or a directory that is not all there (a fault); a texture that is not (a warning,
//          and it is left out). No length is believed before it is checked against the file. Format: FORMAT.md
#pragma once
#include "formats/texture/picture.h"
#include "libs/core/context.h"
#include "libs/core/result.h"
#include "libs/math/vec.h"
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace kiln {

struct WadTexture {
    std::string name;         // as stored: with the `*`, `{`, `+` it begins with
    int width = 0, height = 0;
    std::optional<Rgbd> mean; // linear colour, of the opaque texels; none: no palette, or none is opaque
    TexelPicture holed;            // of a texture with holes, whose name begins with `{`; empty: others
};
struct Wad {
    bool own_palettes = false; // WAD3
    std::vector<WadTexture> textures;
};
// `wanted`: whether a texture of that name, as stored, is asked for; of others nothing is read.
using WantedTexture = std::function<bool(const std::string& name)>;
Result<Wad> read_wad(std::span<const std::uint8_t> bytes, std::span<const std::uint8_t> palette, const std::string& file, const WantedTexture& wanted, Context& context);

} // namespace kiln

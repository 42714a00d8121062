// What textures and material files of games say about materials: size, the mean colour as diffuse reflectance, flags.
#pragma once
#include "compiler/compile.h"

namespace kiln {
// A material file (JSON) made of the PNG and VMT files below `folder` whose names occur in the map text.
Result<TextFile> materials_of_textures(const std::string& folder, const Bytes& map, Context& context);
// The same of a WAD. Quake's palette, which those of Quake go without, is gfx/palette.lmp of the game folder, or lies beside the
// archive or in the gfx/ beside it or its folder; without one only sizes are known (note: wad-palette).
Result<TextFile> materials_of_wad(const std::string& wad, const std::string& game_dir, const Bytes& map, Context& context);
// Of a material file: the opacity maps that its rules name (`opacity_map`, or the alpha of `albedo_map` where something can be seen through), as rules that
// add them; nothing: there are none. What cannot be read: warning texture-unreadable.
std::optional<TextFile> opacity_maps_of(const TextFile& materials, Context& context);
// The archives that worldspawn's `wad` (or `_wad`) names: as spelled, else beside the map or in the game folder, there and in their wads/,
// by path, then by name alone. One that is nowhere: note wad-missing.
std::vector<std::string> wads_of_map(const Document& document, const std::string& game_dir, Context& context);
}

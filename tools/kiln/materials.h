// What texture images say about materials: size, and the mean colour as diffuse reflectance.
#pragma once
#include "compiler/compile.h"

namespace kiln {
// A material file (JSON) made of the PNG files below `folder` whose names occur in the map text.
Result<TextFile> materials_of_textures(const std::string& folder, const Bytes& map, Context& context);
}

// Private to world: what TrenchBroom leaves out when it exports a map for the compiler.
#pragma once
#include "formats/document/document.h"

namespace kiln {

// Per entity: is it, or is something it is grouped under, in a layer that is marked to be omitted from export? Such a
// mark on worldspawn means the default layer: its own brushes, and all that is in no other layer.
std::vector<std::uint8_t> omitted_by_layer(const Document& document);

} // namespace kiln

// Do displacements and patches make sense? Readers look after the text, this after the meaning. Private to the folder.
#pragma once
#include "formats/document/document.h"
#include <optional>
#include <string>

namespace kiln {

// What is wrong with it, as a clause for a message; nothing: it can be built.
std::optional<std::string> flaw_of(const DocDisplacement& displacement);
std::optional<std::string> flaw_of(const DocPatch& patch);

} // namespace kiln

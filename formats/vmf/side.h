// The keys of one VMF side. Private to the reader.
#pragma once
#include "formats/document/document.h"
#include "libs/core/context.h"

namespace kiln::vmf {

// Stores one key of a side; false: the side cannot be used (reported).
bool set_side_key(DocSide& side, std::string_view key, std::string_view value, const SourceLocation& where,
                  Context& context);

} // namespace kiln::vmf

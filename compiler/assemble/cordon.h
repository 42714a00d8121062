// Private: cordons, the boxes to which an editor limits a build.
#pragma once
#include "formats/document/document.h"
#include "libs/core/context.h"

namespace kiln::assemble_detail {

// Leaves out brushes that touch no active box and entities that stand outside of all, counted in the note `cordon`, and
// closes the union of the boxes with brushes of the sky material, as Hammer does. Without an active box: a warning, and
// nothing changes.
void cut_to_cordons(Document& document, Context& context);

} // namespace kiln::assemble_detail

// Private to world: the box of a brush as it is read.
#pragma once
#include "formats/document/document.h"

namespace kiln {

// Rounded arithmetic: for origin brushes, bounds of ladders and what lies in a region, none of which is geometry.
// Empty where the sides enclose nothing.
Box3 box_of(const DocBrush& brush);

} // namespace kiln

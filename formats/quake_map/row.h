// One row of a brush: three points, a texture name, a projection. Private to the reader.
#pragma once
#include "formats/document/document.h"
#include "formats/quake_map/scanner.h"
#include "libs/core/context.h"

namespace kiln::quake {

enum class RowFormat { standard, valve220 };

// Reads a row whose first '(' comes next. False: the row cannot be used (reported; the scanner stands behind it
// or at its line's end).
bool read_row(Scanner& scanner, DocSide& side, RowFormat& format, const SourceLocation& where, Context& context);

// Axes of the classic projection: the texture is laid along the axis plane nearest to the side's plane, then
// turned by `rotation_deg` in it.
void project_standard(DocTexture& texture, Vec3 normal, double rotation_deg);

} // namespace kiln::quake

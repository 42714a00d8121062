// One row of a brush: its plane, a texture name, a projection. Private to the reader.
#pragma once
#include "formats/document/document.h"
#include "formats/quake_map/projection.h"
#include "formats/quake_map/scanner.h"
#include "libs/core/context.h"

namespace kiln::quake {

enum class RowFormat { standard, valve220 };

// Reads a row whose first '(' comes next. False: the row cannot be used (reported; the scanner stands behind it
// or at its line's end).
bool read_row(Scanner& scanner, DocSide& side, RowFormat& format, const SourceLocation& where, Context& context);

// A row of brushDef (three points) or brushDef3 (`by_equation`: four numbers, relative to `origin`).
bool read_primitive_row(Scanner& scanner, DocSide& side, bool by_equation, Vec3 origin, const SourceLocation& where, Context& context);

// After the opening brace of patchDef2 or patchDef3 (`fixed`: with numbers of subdivisions), up to what follows the
// points. False: it cannot be used (reported); the scanner stands somewhere inside.
bool read_patch(Scanner& scanner, DocPatch& patch, bool fixed, const SourceLocation& where, Context& context);

} // namespace kiln::quake

// Reader of Quake-family map text (.map): standard and Valve 220 rows, decided row by row, with or without the
// three integers (contents, flags, value) of Quake 2/3; QuArK's texture comments; brushDef, brushDef2, brushDef3,
// patchDef2 and patchDef3. Other primitives are skipped with a located note or warning each kind. Grammar and
// decisions: FORMAT.md.
#pragma once
#include "formats/document/document.h"
#include "libs/core/context.h"
#include <span>

namespace kiln {
Result<Document> read_quake_map(std::span<const std::uint8_t> bytes, const std::string& file, Context& context);
}

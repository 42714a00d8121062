// Reader of Quake-family map text (.map): standard and Valve 220 rows, decided row by row, with or without the
// three integers (contents, flags, value) of Quake 2/3. patchDef2, brushDef and brushDef3 primitives are
// skipped with a located note each (and one warning of them all from the world stage). Grammar and decisions:
// FORMAT.md.
#pragma once
#include "formats/document/document.h"
#include "libs/core/context.h"
#include <span>

namespace kiln {
Result<Document> read_quake_map(std::span<const std::uint8_t> bytes, const std::string& file, Context& context);
}

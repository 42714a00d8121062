// Reader of Valve map format text (.vmf): nested blocks of "key" "value".
// `hidden{}` blocks are skipped with all they hold; unknown blocks are tolerated; any bytes are allowed in
// values (Latin-1, 0x1B between output fields); CRLF or LF. Grammar and decisions: FORMAT.md.
// Errors: unbalanced braces, a string without end, a plane that is not nine numbers, NaN/inf: located
// diagnostics in the context; the first fatal one is the fault. A faulty side makes its whole solid be left out.
#pragma once
#include "formats/document/document.h"
#include "libs/core/context.h"
#include <span>

namespace kiln {
Result<Document> read_vmf(std::span<const std::uint8_t> bytes, const std::string& file, Context& context);
}

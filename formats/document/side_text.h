// What both map readers share: the faults of numbers in a side, told the same way with the same codes.
#pragma once
#include "formats/document/document.h"
#include "libs/core/context.h"
#include <span>
#include <string>
#include <string_view>

namespace kiln {

// Reads one coordinate of a plane point. On a fault (no number, not finite, beyond kLargestCoordinate) reports
// an error at `where` and returns false.
bool read_coordinate(std::string_view text, Decimal& out, const SourceLocation& where, Context& context);

// Numbers of texture projections beyond this would not fit the floats they end as; nor would the inverse of a scale below
// its inverse.
constexpr double kLargestTextureNumber = 1e30;

// A texture scale of (next to) zero cannot be divided by: 1 with a warning, as the original compilers do silently.
void mend_texture_scale(DocTexture& texture, const SourceLocation& where, Context& context);

// A side without a material can still be built: a warning.
void check_material(const DocSide& side, const SourceLocation& where, Context& context);

// Text from an unknown file, fit to be shown: at most 40 bytes, control characters and bytes above 126 as '?'.
std::string shown(std::string_view text);

// Words between white space and brackets, "(1 2)[3]" being three: fills `words` as far as they go and returns how many
// there are, but at most one more than there is room for.
std::size_t split_words(std::string_view text, std::span<std::string_view> words);
// As many finite numbers as `out` holds, separated as above and nothing else; false: out is half written.
bool read_numbers(std::string_view text, std::span<double> out);
// A whole number, the fraction of another dropped; nothing for none.
std::optional<std::int64_t> read_integer(std::string_view text);

// Text whose only line breaks are carriage returns (of old Macs): `storage` gets it with line feeds and `text` shows it.
void unify_line_breaks(std::string_view& text, std::string& storage);

// Bytes that cannot be map text (empty, zero bytes, UTF-16): the fault that says so; nothing for text.
// `text` loses a UTF-8 byte order mark and zero bytes at its end.
std::optional<Fault> reject_non_text(std::string_view& text, const std::string& file);

} // namespace kiln

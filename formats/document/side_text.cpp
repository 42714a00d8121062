#include "formats/document/side_text.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace kiln {

bool read_coordinate(std::string_view text, Decimal& out, const SourceLocation& where, Context& context) {
    const std::optional<Decimal> value = parse_decimal(text);
    if (!value) {
        context.report(
            Severity::error, "coordinate-not-a-number",
            fmt::format("the coordinate '{}' is not a finite number; the brush is left out", shown(text)), where);
        return false;
    }
    if (!(std::abs(value->to_double()) <= kLargestCoordinate)) {
        context.report(Severity::error, "coordinate-out-of-range",
                       fmt::format("the coordinate {} lies beyond {} map units; the brush is left out", shown(text),
                                   kLargestCoordinate),
                       where);
        return false;
    }
    out = *value;
    return true;
}

void mend_texture_scale(DocTexture& texture, const SourceLocation& where, Context& context) {
    if (texture.u_scale != 0 && texture.v_scale != 0) return;
    context.report(Severity::warning, "texture-scale-zero", "a texture scale is zero; 1 is used", where);
    if (texture.u_scale == 0) texture.u_scale = 1;
    if (texture.v_scale == 0) texture.v_scale = 1;
}

std::string shown(std::string_view text) {
    constexpr std::size_t kLongest = 40;
    std::string out;
    for (const char c : text.substr(0, kLongest)) out += c >= 32 && c < 127 ? c : '?';
    if (text.size() > kLongest) out += "...";
    return out;
}

std::optional<Fault> reject_non_text(std::string_view& text, const std::string& file) {
    while (!text.empty() && text.back() == '\0') text.remove_suffix(1);
    if (text.empty()) return fault(Exit::input, "empty-file", "the file is empty", {file, 1});
    if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF"))
        return fault(Exit::input, "not-text", "the file is UTF-16; save it as plain text", {file, 1});
    const std::size_t zero = text.find('\0');
    if (zero != std::string_view::npos) {
        const int line =
            1 + static_cast<int>(std::count(text.begin(), text.begin() + static_cast<long>(zero), '\n'));
        return fault(Exit::input, "not-text", "the file holds zero bytes: it is not map text", {file, line});
    }
    return std::nullopt;
}

} // namespace kiln

#include "formats/document/side_text.h"
#include <algorithm>
#include <array>
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
    constexpr auto kLargest = static_cast<std::int64_t>(kLargestCoordinate);
    const bool small = value->exponent <= 0 && value->mantissa >= -kLargest && value->mantissa <= kLargest; // most are
    if (!small && !(std::abs(value->to_double()) <= kLargestCoordinate)) {
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
    const auto good = [](double scale) { return std::abs(scale) >= 1 / kLargestTextureNumber; };
    if (good(texture.u_scale) && good(texture.v_scale)) return;
    context.report(Severity::warning, "texture-scale-zero", "a texture scale is zero; 1 is used", where);
    if (!good(texture.u_scale)) texture.u_scale = 1;
    if (!good(texture.v_scale)) texture.v_scale = 1;
}

void check_material(const DocSide& side, const SourceLocation& where, Context& context) {
    if (side.material.empty()) context.report(Severity::warning, "material-missing", "a side names no material; it is built without", where);
}

std::size_t split_words(std::string_view text, std::span<std::string_view> words) {
    const auto separates = [](char c) {
        return c == ' ' || (c >= '\t' && c <= '\r') || c == '(' || c == ')' || c == '[' || c == ']';
    };
    std::size_t count = 0;
    for (std::size_t at = 0;;) {
        while (at < text.size() && separates(text[at])) ++at;
        if (at == text.size()) return count;
        if (count == words.size()) return count + 1;
        const std::size_t first = at;
        while (at < text.size() && !separates(text[at])) ++at;
        words[count++] = text.substr(first, at - first);
    }
}

bool read_numbers(std::string_view text, std::span<double> out) {
    std::size_t used = 0;
    while (used < out.size()) { // in steps, so that long rows need no array of their words
        std::array<std::string_view, 1> word;
        if (split_words(text, word) == 0) return false;
        const std::optional<double> number = parse_number(word[0]);
        if (!number) return false;
        out[used++] = *number;
        text.remove_prefix(static_cast<std::size_t>(word[0].data() - text.data()) + word[0].size());
    }
    return split_words(text, {}) == 0;
}

std::optional<std::int64_t> read_integer(std::string_view text) {
    constexpr double kLargestExact = 9e15; // about 2^53
    const std::optional<double> number = parse_number(text);
    if (!number || std::abs(*number) > kLargestExact) return std::nullopt;
    return static_cast<std::int64_t>(*number);
}

void unify_line_breaks(std::string_view& text, std::string& storage) {
    if (text.find('\r') == std::string_view::npos || text.find('\n') != std::string_view::npos) return;
    storage = text;
    std::ranges::replace(storage, '\r', '\n');
    text = storage;
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

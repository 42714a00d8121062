#include "formats/vmf/displacement.h"
#include "formats/document/side_text.h"
#include <charconv>
#include <cmath>
#include <fmt/format.h>

namespace kiln::vmf {
namespace {

using Text = DisplacementText;

constexpr std::array<const char*, Text::other> kNames = {
    "normals",    "distances",  "offsets",            "offset_normals",     "alphas",             "triangle_tags",
    "multiblend", "alphablend", "multiblend_color_0", "multiblend_color_1", "multiblend_color_2", "multiblend_color_3",
    "allowed_verts"};
constexpr std::size_t kAllowedWords = 10; // 289 bits, for the 17 x 17 vertices of power 4

// "row12" -> 12; -1: no such name.
int row_number(std::string_view name) {
    int row = -1;
    if (!equal_ignoring_case(name.substr(0, 3), "row")) return -1;
    const auto [stop, error] = std::from_chars(name.data() + 3, name.data() + name.size(), row);
    return error == std::errc{} && stop == name.data() + name.size() ? row : -1;
}

std::string listed(const std::vector<int>& rows) {
    return fmt::format("row{} {}", rows.size() == 1 ? "" : "s", fmt::join(rows, ", "));
}

struct Reader {
    const Text& text;
    const SourceLocation& where;
    Context& context;

    SourceLocation at(int line) const {
        SourceLocation place = where;
        place.line = line;
        return place;
    }
    void warn(const char* code, std::string message, int line) { context.report(Severity::warning, code, std::move(message), at(line)); }

    // All numbers of an array, row by row, zeros where the file has none; empty where it has no row of it.
    std::vector<double> numbers(Text::Array array, int row_count, std::size_t row_size) {
        std::vector<double> all;
        std::vector<std::uint8_t> seen(static_cast<std::size_t>(row_count));
        std::vector<int> broken, missing;
        int first_line = 0, broken_line = 0;
        for (const Text::Row& row : text.rows) {
            if (row.array != array) continue;
            if (all.empty()) all.resize(static_cast<std::size_t>(row_count) * row_size), first_line = row.value.line;
            const int r = row_number(row.name);
            if (r < 0 || r >= row_count || seen[static_cast<std::size_t>(r)]) {
                warn("displacement-row-extra",
                     fmt::format("'{}' of {} stands twice or is no row 0 to {} of this power; it is ignored", shown(row.name), kNames[array], row_count - 1),
                     row.value.line);
                continue;
            }
            seen[static_cast<std::size_t>(r)] = 1;
            const std::span<double> out = std::span(all).subspan(static_cast<std::size_t>(r) * row_size, row_size);
            if (read_numbers(row.value.text, out) && usable(array, out)) continue;
            std::ranges::fill(out, 0.0);
            if (broken.empty()) broken_line = row.value.line;
            broken.push_back(r);
        }
        if (all.empty()) return all;
        for (int r = 0; r < row_count; ++r)
            if (!seen[static_cast<std::size_t>(r)]) missing.push_back(r);
        if (!missing.empty())
            warn("displacement-row-missing", fmt::format("{} of {} {} missing; zeros are used", listed(missing), kNames[array], missing.size() == 1 ? "is" : "are"), first_line);
        if (!broken.empty())
            warn("displacement-row-invalid",
                 fmt::format("{} of {}: not {} numbers that can be used; zeros are used", listed(broken), kNames[array], row_size), broken_line);
        return all;
    }
    static bool usable(Text::Array array, std::span<const double> values) {
        return std::ranges::all_of(values, [&](double x) {
            return array == Text::triangle_tags ? x >= 0 && x <= 65535 && x == std::floor(x) : std::abs(x) <= kLargestCoordinate;
        });
    }
    std::vector<Vec3> vectors(Text::Array array, int side) {
        const std::vector<double> n = numbers(array, side, static_cast<std::size_t>(side) * 3);
        std::vector<Vec3> out(n.size() / 3);
        for (std::size_t i = 0; i < out.size(); ++i) out[i] = {n[3 * i], n[3 * i + 1], n[3 * i + 2]};
        return out;
    }
    std::vector<std::array<double, 4>> fours(Text::Array array, int side) {
        const std::vector<double> n = numbers(array, side, static_cast<std::size_t>(side) * 4);
        std::vector<std::array<double, 4>> out(n.size() / 4);
        for (std::size_t i = 0; i < out.size(); ++i) out[i] = {n[4 * i], n[4 * i + 1], n[4 * i + 2], n[4 * i + 3]};
        return out;
    }
    double number(const Text::Value& value, const char* name) {
        if (value.line == 0) return 0;
        const std::optional<double> n = parse_number(value.text);
        if (n && std::abs(*n) <= kLargestCoordinate) return *n;
        warn("displacement-number-invalid", fmt::format("the {} '{}' of a displacement is no number that can be used; 0 is used", name, shown(value.text)), value.line);
        return 0;
    }
};

} // namespace

void DisplacementText::begin(int at_line) {
    line = at_line;
    power = start = elevation = flags = {};
    open_array = other;
    rows.clear();
}
void DisplacementText::open(std::string_view block) {
    std::size_t i = 0;
    while (i < kNames.size() && !equal_ignoring_case(block, kNames[i])) ++i;
    open_array = static_cast<Array>(i);
}
void DisplacementText::key(std::string_view name, std::string_view value, int at_line) {
    const auto is = [&](std::string_view n) { return equal_ignoring_case(name, n); };
    if (is("power")) power = {value, at_line};
    if (is("startposition")) start = {value, at_line};
    if (is("elevation")) elevation = {value, at_line};
    if (is("flags")) flags = {value, at_line};
    // "subdiv" tells how the editor drew it.
}
void DisplacementText::row(std::string_view name, std::string_view value, int at_line) {
    if (open_array != other) rows.push_back({open_array, name, {value, at_line}});
}

std::optional<DocDisplacement> read_displacement(const DisplacementText& text, const SourceLocation& where, Context& context) {
    Reader r{text, where, context};
    const auto refuse = [&](const char* code, std::string message, int line) {
        context.report(Severity::error, code, message + "; the face stays flat", r.at(line));
        return std::nullopt;
    };
    DocDisplacement d;
    d.line = text.line;
    const std::optional<double> power = parse_number(text.power.text);
    if (!power || (*power != 2 && *power != 3 && *power != 4))
        return refuse("displacement-power-invalid",
                      text.power.line ? fmt::format("the power '{}' of a displacement is not 2, 3 or 4", shown(text.power.text))
                                      : "a displacement states no power",
                      text.power.line ? text.power.line : text.line);
    d.power = static_cast<int>(*power);
    std::array<double, 3> start{};
    if (!read_numbers(text.start.text, start) || !Reader::usable(Text::offsets, start))
        return refuse("displacement-start-invalid",
                      text.start.line ? fmt::format("the start position '{}' of a displacement is not three numbers that can be used", shown(text.start.text))
                                      : "a displacement states no start position",
                      text.start.line ? text.start.line : text.line);
    d.start = {start[0], start[1], start[2]};
    const int side = (1 << d.power) + 1;
    d.normals = r.vectors(Text::normals, side);
    if (d.normals.empty()) return refuse("displacement-without-normals", "a displacement has no normals", text.line);
    d.elevation = r.number(text.elevation, "elevation");
    d.flags = static_cast<std::uint32_t>(static_cast<std::int64_t>(r.number(text.flags, "flags word")));
    d.distances = r.numbers(Text::distances, side, static_cast<std::size_t>(side));
    d.offsets = r.vectors(Text::offsets, side);
    d.offset_normals = r.vectors(Text::offset_normals, side);
    d.alphas = r.numbers(Text::alphas, side, static_cast<std::size_t>(side));
    for (const double tag : r.numbers(Text::triangle_tags, side - 1, std::size_t{2} << d.power)) d.triangle_tags.push_back(static_cast<std::uint16_t>(tag));
    d.multiblend = r.fours(Text::multiblend, side);
    d.alphablend = r.fours(Text::alphablend, side);
    for (std::size_t k = 0; k < 4; ++k) {
        const std::vector<Vec3> color = r.vectors(static_cast<Text::Array>(Text::color_0 + k), side);
        if (color.empty()) continue;
        // A layer whose colours the file does not state leaves its texture as it is: white.
        if (d.multiblend_colors.empty()) d.multiblend_colors.resize(color.size(), {Vec3{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}});
        for (std::size_t i = 0; i < color.size(); ++i) d.multiblend_colors[i][k] = color[i];
    }
    for (const DisplacementText::Row& row : text.rows) {
        if (row.array != Text::allowed_verts) continue; // its only key is the number of words, "10"
        std::array<double, kAllowedWords> words{};
        if (!read_numbers(row.value.text, words)) {
            r.warn("displacement-row-invalid", fmt::format("allowed_verts is not {} numbers; it is ignored", words.size()), row.value.line);
            continue;
        }
        d.allowed_vertices.clear();
        for (const double word : words) d.allowed_vertices.push_back(static_cast<std::int64_t>(std::clamp(word, -2147483648.0, 4294967295.0)));
    }
    return d;
}

} // namespace kiln::vmf

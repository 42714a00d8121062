#include "formats/vmf/side.h"
#include "formats/document/side_text.h"
#include <cmath>
#include <fmt/format.h>

namespace kiln::vmf {
namespace {

// Words of "(x y z) (x y z) (x y z)" or "[x y z shift] scale": brackets separate as white space does, so that
// ")(" and "]1" are read too.
std::vector<std::string_view> words(std::string_view text) {
    const auto separates = [](char c) {
        return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '(' || c == ')' || c == '[' || c == ']';
    };
    std::vector<std::string_view> out;
    out.reserve(9);
    for (std::size_t at = 0; at < text.size();) {
        if (separates(text[at])) {
            ++at;
            continue;
        }
        std::size_t end = at;
        while (end < text.size() && !separates(text[end])) ++end;
        out.push_back(text.substr(at, end - at));
        at = end;
    }
    return out;
}

bool set_plane(DocSide& side, std::string_view value, const SourceLocation& where, Context& context) {
    const std::vector<std::string_view> w = words(value);
    if (w.size() != 9) {
        context.report(
            Severity::error, "plane-unreadable",
            fmt::format("the plane '{}' is not three points of three numbers; the brush is left out", shown(value)),
            where);
        return false;
    }
    for (std::size_t i = 0; i < 9; ++i)
        if (!read_coordinate(w[i], side.points[i / 3][i % 3], where, context)) return false;
    return true;
}

void set_axis(Vec3& axis, double& shift, double& scale, std::string_view value, const SourceLocation& where,
              Context& context) {
    const std::vector<std::string_view> w = words(value);
    std::array<double, 5> n{};
    bool good = w.size() == 5;
    for (std::size_t i = 0; good && i < 5; ++i) {
        const std::optional<double> number = parse_number(w[i]);
        good = number.has_value();
        n[i] = number.value_or(0);
    }
    if (!good) {
        context.report(
            Severity::warning, "texture-axis-unreadable",
            fmt::format("the texture axis '{}' is not [x y z shift] scale; the default axis is used", shown(value)),
            where);
        return;
    }
    axis = {n[0], n[1], n[2]}, shift = n[3], scale = n[4];
}

std::int64_t integer(std::string_view value) {
    const double n = parse_number(value).value_or(0);
    return std::abs(n) < 9e15 ? static_cast<std::int64_t>(n) : 0;
}

} // namespace

bool set_side_key(DocSide& side, std::string_view key, std::string_view value, const SourceLocation& where,
                  Context& context) {
    const auto is = [&](std::string_view name) { return equal_ignoring_case(key, name); };
    if (is("plane")) return set_plane(side, value, where, context);
    if (is("material")) {
        side.material = value;
    } else if (is("uaxis")) {
        set_axis(side.texture.u_axis, side.texture.u_shift, side.texture.u_scale, value, where, context);
    } else if (is("vaxis")) {
        set_axis(side.texture.v_axis, side.texture.v_shift, side.texture.v_scale, value, where, context);
    } else if (is("lightmapscale")) {
        const std::optional<double> scale = parse_number(value);
        side.lightmap_scale = scale && *scale > 0 ? *scale : 16;
        if (!scale || !(*scale > 0))
            context.report(Severity::warning, "lightmap-scale-invalid",
                           fmt::format("the lightmap scale '{}' is no positive number; 16 is used", shown(value)),
                           where);
    } else if (is("smoothing_groups")) {
        side.smoothing_groups = static_cast<std::uint32_t>(integer(value));
    } else if (is("contents")) {
        side.contents = integer(value), side.has_content_flags = true;
    } else if (is("flags")) {
        side.surface_flags = integer(value), side.has_content_flags = true;
    } else if (!is("rotation")) { // the editor's own; the axes say it already
        side.extra.push_back({std::string(key), std::string(value), where.line});
    }
    return true;
}

} // namespace kiln::vmf

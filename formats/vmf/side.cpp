#include "formats/vmf/side.h"
#include "formats/document/side_text.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace kiln::vmf {
namespace {

bool set_plane(DocSide& side, std::string_view value, const SourceLocation& where, Context& context) {
    std::array<std::string_view, 9> w;
    if (split_words(value, w) != w.size()) {
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
    std::array<double, 5> n{};
    const auto usable = [](double x) { return std::abs(x) <= kLargestTextureNumber; };
    if (!read_numbers(value, n) || !std::ranges::all_of(n, usable)) {
        context.report(
            Severity::warning, "texture-axis-unreadable",
            fmt::format("the texture axis '{}' is not [x y z shift] scale; the default axis is used", shown(value)),
            where);
        return;
    }
    axis = {n[0], n[1], n[2]}, shift = n[3], scale = n[4];
}

std::int64_t integer(std::string_view value) {
    return read_integer(value).value_or(0);
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

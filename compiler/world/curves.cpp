#include "compiler/world/curves.h"
#include <cmath>
#include <fmt/format.h>
#include <string_view>

namespace kiln {
namespace {

bool usable(double x) { return std::abs(x) <= kLargestCoordinate; } // false for what is no number, too
bool usable(Vec2 v) { return usable(v.x) && usable(v.y); }
bool usable(Vec3 v) { return usable(v.x) && usable(v.y) && usable(v.z); }
bool usable(const std::array<double, 4>& v) {
    for (const double x : v)
        if (!usable(x)) return false;
    return true;
}

} // namespace

std::optional<std::string> flaw_of(const DocDisplacement& d) {
    if (d.power < 2 || d.power > 4) return fmt::format("its power is {}, not 2, 3 or 4", d.power);
    const std::size_t side = (std::size_t{1} << d.power) + 1, vertices = side * side, triangles = 2 * (side - 1) * (side - 1);
    std::optional<std::string> flaw;
    const auto look = [&](const auto& values, std::string_view name, std::size_t wanted) {
        if (flaw || values.empty()) return;
        if (values.size() != wanted) flaw = fmt::format("it has {} {}, power {} needs {}", values.size(), name, d.power, wanted);
        else if constexpr (requires { usable(values[0]); })
            for (const auto& v : values)
                if (!flaw && !usable(v)) flaw = fmt::format("one of its {} is no number within {}", name, kLargestCoordinate);
    };
    look(d.normals, "normals", vertices);
    look(d.distances, "distances", vertices);
    look(d.offsets, "offsets", vertices);
    look(d.offset_normals, "offset normals", vertices);
    look(d.alphas, "alphas", vertices);
    look(d.multiblend, "multiblend weights", vertices);
    look(d.alphablend, "alphablend weights", vertices);
    if (!flaw && !d.triangle_tags.empty() && d.triangle_tags.size() != triangles)
        flaw = fmt::format("it has {} triangle tags, power {} needs {}", d.triangle_tags.size(), d.power, triangles);
    if (!flaw && !(usable(d.start) && usable(d.elevation))) flaw = "its start position or elevation is no usable number";
    // Each number may be usable and their product lie where nothing can be built. The elevation goes along the side's
    // normal, whichever way that is.
    for (std::size_t v = 0; v < vertices && !flaw; ++v) {
        Vec3 move;
        if (!d.normals.empty() && !d.distances.empty()) move += d.normals[v] * d.distances[v];
        if (!d.offsets.empty()) move += d.offsets[v];
        if (!(length(move) + std::abs(d.elevation) <= kLargestCoordinate))
            flaw = fmt::format("vertex {} in row {} is moved by {:.6g} map units, beyond {}", v % side, v / side, length(move) + std::abs(d.elevation), kLargestCoordinate);
    }
    return flaw;
}

std::optional<std::string> flaw_of(const DocPatch& p) {
    constexpr std::uint32_t kMostPoints = 1024; // a side; editors stop at 31
    if (p.columns < 3 || p.rows < 3 || p.columns % 2 == 0 || p.rows % 2 == 0)
        return fmt::format("its control points are {} x {}: both numbers have to be odd and 3 at least", p.columns, p.rows);
    if (p.columns > kMostPoints || p.rows > kMostPoints)
        return fmt::format("its control points are {} x {}, at most {} a side are taken", p.columns, p.rows, kMostPoints);
    const std::size_t wanted = std::size_t{p.columns} * p.rows;
    if (p.points.size() != wanted || p.uv.size() != wanted)
        return fmt::format("it has {} control points and {} texture coordinates where {} x {} need {}", p.points.size(), p.uv.size(),
                           p.columns, p.rows, wanted);
    for (std::size_t i = 0; i < wanted; ++i)
        if (!usable(p.points[i]) || !usable(p.uv[i])) return fmt::format("a control point is no number within {}", kLargestCoordinate);
    return std::nullopt;
}

} // namespace kiln

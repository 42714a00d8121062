#include "compiler/light/lambert.h"
#include "libs/sampling/maps.h"
#include <array>
#include <numbers>
#include <vector>

namespace kiln {

Vec3 lambert_edge(Vec3 x, Vec3 a, Vec3 b) {
    const Vec3 u = a - x, v = b - x, w = cross(u, v);
    const double s = length(w);
    if (!(s > 0)) return {};
    return w * (atan2_upper(s, dot(u, v)) / s);
}

double lambert_form_factor(Vec3 x, Vec3 n, std::span<const Vec3> convex) {
    std::array<Vec3, 24> fixed;
    std::vector<Vec3> many;
    std::span<Vec3> out = fixed;
    if (2 * convex.size() > fixed.size()) many.resize(2 * convex.size()), out = many;
    std::size_t count = 0;
    clip_to_horizon(x, n, convex, [&](Vec3 p) { out[count++] = p; });
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i) sum += dot(n, lambert_edge(x, out[i], out[i + 1 == count ? 0 : i + 1]));
    return std::abs(sum) / (2 * std::numbers::pi);
}

double solid_angle(Vec3 x, Vec3 a, Vec3 b, Vec3 c) {
    const Vec3 u = a - x, v = b - x, w = c - x;
    const double lu = length(u), lv = length(v), lw = length(w);
    const double above = std::abs(dot(u, cross(v, w)));
    const double below = lu * lv * lw + dot(u, v) * lw + dot(v, w) * lu + dot(w, u) * lv;
    return 2 * atan2_upper(above, below);
}

} // namespace kiln

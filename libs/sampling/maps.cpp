#include "libs/sampling/maps.h"

namespace kiln {
SinCos sincos_turns(double turns) {
    const double t = turns - std::floor(turns);     // [0, 1)
    const double quarter = std::floor(t * 4 + 0.5); // nearest quarter turn
    const double x = (t - quarter * 0.25) * (2 * std::numbers::pi);
    const double s = detail::sin_small(x), c = detail::cos_small(x);
    switch (static_cast<int>(quarter) & 3) {
    case 0:
        return {s, c};
    case 1:
        return {c, -s};
    case 2:
        return {-s, -c};
    default:
        return {-c, s};
    }
}

void concentric_discs(std::span<double> xs, std::span<double> ys) {
    double *x = xs.data(), *y = ys.data();
    for (std::size_t i = 0; i < xs.size(); ++i) {
        const double a = 2 * x[i] - 1, b = 2 * y[i] - 1;
        const bool wide = std::abs(a) > std::abs(b);
        const double r = wide ? a : b, beside = wide ? b : a, turn = std::numbers::pi / 4 * (beside / (r != 0 ? r : 1));
        const double along = r * detail::cos_small(turn), across = r * detail::sin_small(turn);
        x[i] = wide ? along : across, y[i] = wide ? across : along;
    }
}

SphericalTriangle::SphericalTriangle(Vec3 a, Vec3 b, Vec3 c) : a_(normalize(a)), b_(normalize(b)) {
    const Vec3 to_c = normalize(c);
    cos_ab_ = dot(a_, b_);
    const double triple = std::abs(dot(a_, cross(b_, to_c)));
    solid_angle_ = 2 * atan2_upper(triple, 1 + cos_ab_ + dot(b_, to_c) + dot(to_c, a_));
    const Vec3 ab = cross(a_, b_), ac = cross(a_, to_c);
    const double lengths = length(ab) * length(ac);
    if (!(lengths > 0)) return;
    cos_alpha_ = dot(ab, ac) / lengths, sin_alpha_ = triple / lengths;
    towards_c_ = normalize(to_c - a_ * dot(to_c, a_));
}

Vec3 SphericalTriangle::direction(Vec2 u) const {
    const SinCos part = sincos_turns(u.x * solid_angle_ / (2 * std::numbers::pi)); // of the triangle a, b and a point on a to c
    const double s = part.sin * cos_alpha_ - part.cos * sin_alpha_, t = part.cos * cos_alpha_ + part.sin * sin_alpha_;
    const double x = t - cos_alpha_, y = s + sin_alpha_ * cos_ab_;
    const double below = (y * s + x * t) * sin_alpha_;
    const double q = below != 0 ? std::clamp(((y * t - x * s) * cos_alpha_ - y) / below, -1.0, 1.0) : 1;
    const Vec3 c = a_ * q + towards_c_ * std::sqrt(std::max(0.0, 1 - q * q));
    const double cos_bc = dot(c, b_), z = 1 - u.y * (1 - cos_bc);
    const Vec3 towards = c - b_ * cos_bc;
    const double l = length(towards);
    return l > 0 ? b_ * z + towards * (std::sqrt(std::max(0.0, 1 - z * z)) / l) : b_;
}

} // namespace kiln

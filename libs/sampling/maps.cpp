#include "libs/sampling/maps.h"

namespace kiln {
namespace {
// |x| <= pi/4
double sin_small(double x) {
    const double z = x * x;
    double p = -1.0 / 1307674368000.0;
    p = p * z + 1.0 / 6227020800.0;
    p = p * z - 1.0 / 39916800.0;
    p = p * z + 1.0 / 362880.0;
    p = p * z - 1.0 / 5040.0;
    p = p * z + 1.0 / 120.0;
    p = p * z - 1.0 / 6.0;
    return x + x * z * p;
}
double cos_small(double x) {
    const double z = x * x;
    double p = 1.0 / 20922789888000.0;
    p = p * z - 1.0 / 87178291200.0;
    p = p * z + 1.0 / 479001600.0;
    p = p * z - 1.0 / 3628800.0;
    p = p * z + 1.0 / 40320.0;
    p = p * z - 1.0 / 720.0;
    p = p * z + 1.0 / 24.0;
    p = p * z - 0.5;
    return 1 + z * p;
}
} // namespace

SinCos sincos_turns(double turns) {
    const double t = turns - std::floor(turns);     // [0, 1)
    const double quarter = std::floor(t * 4 + 0.5); // nearest quarter turn
    const double x = (t - quarter * 0.25) * (2 * std::numbers::pi);
    const double s = sin_small(x), c = cos_small(x);
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

Vec2 concentric_disc(Vec2 u) {
    const double x = 2 * u.x - 1, y = 2 * u.y - 1;
    if (x == 0 && y == 0) return {};
    constexpr double q = std::numbers::pi / 4;
    if (std::abs(x) > std::abs(y)) {
        const double a = q * (y / x);
        return {x * cos_small(a), x * sin_small(a)};
    }
    const double a = q * (x / y);
    return {y * sin_small(a), y * cos_small(a)};
}

SphericalTriangle::SphericalTriangle(Vec3 a, Vec3 b, Vec3 c) : a_(normalize(a)), b_(normalize(b)) {
    const Vec3 to_c = normalize(c);
    cos_ab_ = dot(a_, b_);
    const double triple = std::abs(dot(a_, cross(b_, to_c)));
    solid_angle_ = 2 * std::atan2(triple, 1 + cos_ab_ + dot(b_, to_c) + dot(to_c, a_));
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

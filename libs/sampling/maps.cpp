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

} // namespace kiln

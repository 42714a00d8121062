// Maps from the unit square to discs, hemispheres, spheres and triangles, all area preserving.
#pragma once
#include "libs/math/vec.h"
#include <numbers>
#include <span>

namespace kiln {

namespace detail {
// |x| <= pi/4
inline double sin_small(double x) {
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
inline double cos_small(double x) {
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
} // namespace detail

struct SinCos {
    double sin = 0, cos = 1;
};
// Sine and cosine of 2 pi turns, of any finite turns: reduction to an eighth and Taylor polynomials, error < 1e-15.
// Our own, so that results do not depend on the version of the system's library.
SinCos sincos_turns(double turns);

// std::atan2 for y >= 0, 0..pi: the same bits with any C library, and no branches. Within 1e-15 of it, of small angles a share of that.
// atan(u) / u is a polynomial in u^2, interpolated at Chebyshev nodes for u up to tan(pi / 8).
inline double atan2_upper(double y, double x) {
    const double across = std::abs(x), most = std::max(across, y), least = std::min(across, y);
    if (!(most > 0)) return 0;
    const bool steep = least > 0.41421356237309503 * most;
    const double u = (steep ? most - least : least) / (steep ? most + least : most), z = u * u;
    double p = -0.017805397205419446;
    for (const double c : {0.03796525745386593, -0.05035102456601552, 0.05846878297330872, -0.06662951813629191, 0.07692045330902225, -0.09090896809064027,
                           0.11111110744919658, -0.14285714279250245, 0.19999999999940893, -0.3333333333333312, 1.0})
        p = p * z + c;
    double a = u * p;
    a = steep ? std::numbers::pi / 4 - a : a;
    a = y > across ? std::numbers::pi / 2 - a : a;
    return x < 0 ? std::numbers::pi - a : a;
}

// Low-distortion map of the square to the unit disc (P. Shirley and K. Chiu 1997).
inline Vec2 concentric_disc(Vec2 u) {
    const double x = 2 * u.x - 1, y = 2 * u.y - 1;
    if (x == 0 && y == 0) return {};
    // Which of the two is larger is as good as random: no branch.
    const bool wide = std::abs(x) > std::abs(y);
    const double r = wide ? x : y, a = std::numbers::pi / 4 * ((wide ? y : x) / r);
    const double along = r * detail::cos_small(a), across = r * detail::sin_small(a);
    return {wide ? along : across, wide ? across : along};
}

// The same of many, in place; all of one length. A loop without a branch, which processors work on two at a time.
void concentric_discs(std::span<double> x, std::span<double> y);

// Direction around +z with density cos/pi; the disc above lifted to the sphere.
inline Vec3 cosine_hemisphere(Vec2 u) {
    const Vec2 d = concentric_disc(u);
    return {d.x, d.y, std::sqrt(std::max(0.0, 1 - d.x * d.x - d.y * d.y))};
}

// Direction with density 1/(4 pi).
inline Vec3 uniform_sphere(Vec2 u) {
    const double z = 1 - 2 * u.x, r = std::sqrt(std::max(0.0, 1 - z * z));
    const SinCos a = sincos_turns(u.y);
    return {r * a.cos, r * a.sin, z};
}

// Direction within `cos_angle` of +z, uniform in solid angle.
inline Vec3 uniform_cap(Vec2 u, double cos_angle) {
    const double z = 1 - u.x * (1 - cos_angle), r = std::sqrt(std::max(0.0, 1 - z * z));
    const SinCos a = sincos_turns(u.y);
    return {r * a.cos, r * a.sin, z};
}

// Barycentric weights of the second and third corner, uniform over a triangle.
inline Vec2 uniform_triangle(Vec2 u) {
    const double r = std::sqrt(u.x);
    return {r * (1 - u.y), r * u.y};
}

// Directions into a triangle seen from the origin, uniform in solid angle (J. Arvo 1995). Of one that is seen under less than 1e-4 rounding shows.
class SphericalTriangle {
public:
    SphericalTriangle(Vec3 a, Vec3 b, Vec3 c);
    double solid_angle() const { return solid_angle_; }
    Vec3 direction(Vec2 u) const; // unit

private:
    Vec3 a_, b_, towards_c_; // unit; the last from a, at right angles to it
    double cos_alpha_ = 1, sin_alpha_ = 0, cos_ab_ = 1, solid_angle_ = 0;
};

} // namespace kiln

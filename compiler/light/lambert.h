// Lambert's formula: the share of a diffuse receiver's hemisphere that a polygon fills, cosine weighted.
#pragma once
#include "libs/math/vec.h"
#include <span>

namespace kiln {

// put(corner) for the corners of the part of a convex polygon above the horizon of x; none, or three and more.
template <class Put> void clip_to_horizon(Vec3 x, Vec3 n, std::span<const Vec3> convex, Put&& put) {
    for (std::size_t i = 0; i < convex.size(); ++i) {
        const Vec3 a = convex[i], b = convex[i + 1 == convex.size() ? 0 : i + 1];
        const double da = dot(a - x, n), db = dot(b - x, n);
        if (da >= 0) put(a);
        if ((da > 0 && db < 0) || (da < 0 && db > 0)) put(a + (b - a) * (da / (da - db)));
    }
}

// Form factor from a point x with unit normal n to a convex polygon, clipped at the horizon of x; whichever way the
// polygon faces. Edge angles by atan2, which stays right beyond 90 degrees where asin folds back.
double lambert_form_factor(Vec3 x, Vec3 n, std::span<const Vec3> convex);

// The part of one directed edge (a to b) in Lambert's sum: its angle at x times the unit normal of the triangle x a b.
// Over the boundary of a planar region these add up, but for the sign, to twice its flux at x: the integral of the unit
// direction over its solid angle. Wholly above the horizon of n, dot(n, flux) is pi times the form factor.
Vec3 lambert_edge(Vec3 x, Vec3 a, Vec3 b);

// Solid angle of a triangle (A. van Oosterom and J. Strackee 1983).
double solid_angle(Vec3 x, Vec3 a, Vec3 b, Vec3 c);

} // namespace kiln

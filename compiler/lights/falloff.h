// Falloff by two distances. Private to the folder.
#pragma once

namespace kiln {

struct Quadratic {
    double constant = 1, linear = 0, quadratic = 0;
    double at(double x) const { return constant + x * (linear + x * quadratic); }
};
// 1 / f with f(0), f(half), f(zero) = 1, 2, 256, made monotone and then scaled so that f(half) = 2 again, as
// Source does it: see NOTES.md. 0 < half < zero.
Quadratic falloff_by_distances(double half, double zero);

} // namespace kiln

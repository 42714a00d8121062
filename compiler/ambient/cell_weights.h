// Corner weights of a cell at a point: what both the builder and the run time use.
#pragma once
#include "libs/math/vec.h"
#include <cstdint>

namespace kiln::ambient {

constexpr double kEdge = 1.0 / 1024; // keeps weights above zero where only the opposite corners may be used

inline std::array<double, 8> cell_weights(Vec3 lo, double size, std::uint8_t mask, Vec3 p) {
    std::array<double, 8> weights{};
    Vec3 f = (p - lo) / size;
    for (std::size_t a = 0; a < 3; ++a) f[a] = std::clamp(f[a], kEdge, 1 - kEdge);
    double sum = 0;
    for (unsigned c = 0; c < 8; ++c) {
        if (!(mask >> c & 1)) continue;
        weights[c] = (c & 1 ? f.x : 1 - f.x) * (c & 2 ? f.y : 1 - f.y) * (c & 4 ? f.z : 1 - f.z);
        sum += weights[c];
    }
    if (sum > 0)
        for (double& w : weights) w /= sum;
    return weights;
}

} // namespace kiln::ambient

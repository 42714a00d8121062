// Binary trees over things that lie somewhere and face some way. Private to this folder.
#pragma once
#include "libs/math/vec.h"
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace kiln {

// Both halves of them, along the longest extent of place and normal together. `coordinate(i, k)`: of each, three of its place and three of its normal, in one scale.
std::array<std::span<std::uint32_t>, 2> halved(std::span<std::uint32_t> part, const auto& coordinate) {
    std::array<double, 6> lo, hi;
    lo.fill(1e300), hi.fill(-1e300);
    for (const std::uint32_t i : part)
        for (std::size_t k = 0; k < 6; ++k) lo[k] = std::min(lo[k], coordinate(i, k)), hi[k] = std::max(hi[k], coordinate(i, k));
    std::size_t axis = 0;
    for (std::size_t k = 1; k < 6; ++k)
        if (hi[k] - lo[k] > hi[axis] - lo[axis]) axis = k;
    const std::size_t half = part.size() / 2;
    std::nth_element(part.begin(), part.begin() + static_cast<std::ptrdiff_t>(half), part.end(), [&](std::uint32_t a, std::uint32_t b) {
        const double x = coordinate(a, axis), y = coordinate(b, axis);
        return x < y || (x == y && a < b);
    });
    return {part.first(half), part.subspan(half)};
}
// Of that scale: opposite normals are as good as a quarter of all apart.
inline double normal_scale(const Box3& all) {
    return length(all.size()) / 8;
}

} // namespace kiln

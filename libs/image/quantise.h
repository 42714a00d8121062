// Floats to integers of a file and back, shared by the integer formats. Private to libs/image.
#pragma once
#include "libs/image/image.h"
#include <cmath>
#include <vector>

namespace kiln::detail {

inline bool is_alpha(int channel, int channels) { return channels % 2 == 0 && channel == channels - 1; }

inline unsigned quantise(float v, bool srgb, unsigned top) {
    if (!(v > 0)) return 0; // NaN too
    if (v >= 1) return top;
    return static_cast<unsigned>(std::lround((srgb ? srgb_from_linear(v) : v) * static_cast<float>(top)));
}

// value -> float for each of the top + 1 integers
inline std::vector<float> value_table(bool srgb, unsigned top) {
    std::vector<float> table(top + 1);
    for (unsigned i = 0; i <= top; ++i) {
        const float v = static_cast<float>(i) / static_cast<float>(top);
        table[i] = srgb ? linear_from_srgb(v) : v;
    }
    return table;
}

} // namespace kiln::detail

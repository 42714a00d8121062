// False colours: a gradient for amounts, a hash for names.
#pragma once
#include "formats/level/kiln_level.h"
#include "libs/core/hash.h"
#include "libs/math/vec.h"
#include <array>

namespace kiln {

// 0..1 from dark blue over green to yellow, even in lightness (control points after matplotlib's viridis).
inline Rgb gradient_colour(double share) {
    constexpr std::array<Rgb, 5> stops = {Rgb{0.058f, 0.0005f, 0.089f}, Rgb{0.043f, 0.084f, 0.258f},
                                          Rgb{0.015f, 0.281f, 0.264f}, Rgb{0.114f, 0.588f, 0.124f},
                                          Rgb{0.983f, 0.799f, 0.019f}};
    const double x = std::clamp(share, 0.0, 1.0) * 4;
    const auto i = std::min<std::size_t>(3, static_cast<std::size_t>(x));
    const auto f = static_cast<float>(x - static_cast<double>(i));
    return stops[i] * (1 - f) + stops[i + 1] * f;
}
inline Rgb name_colour(std::uint64_t name) { // bright, distinct for neighbours
    const std::uint64_t h = mix(name + 1);
    const auto channel = [&](int shift) { return 0.12f + 0.75f * static_cast<float>(h >> shift & 255) / 255.0f; };
    return {channel(0), channel(20), channel(40)};
}
// Relative error 0.1 % .. 100 % on a logarithmic scale; 0: unknown, grey.
inline Rgb error_colour(float error) {
    return error > 0 ? gradient_colour((std::log10(error) + 3) / 3) : Rgb{0.2f, 0.2f, 0.2f};
}
inline Rgb validity_colour(int valid) {
    return valid == 1 ? Rgb{0.1f, 0.6f, 0.15f} : valid == 2 ? Rgb{0.1f, 0.2f, 0.7f} : Rgb{0.5f, 0.05f, 0.05f};
}
// Luxels from 1 to 128 map units: dense is bright.
inline double texel_size(const kiln_chart& c) { // of a square one as large
    const auto length = [](const double* v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); };
    return static_cast<double>(c.luxel_size) / std::sqrt(std::max(1e-30, length(c.s) * length(c.t)));
}
inline Rgb luxel_colour(double luxel_size) { return gradient_colour(1 - std::log2(std::max(1e-3, luxel_size)) / 7); }

} // namespace kiln

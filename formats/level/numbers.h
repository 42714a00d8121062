// SPDX-License-Identifier: MIT
// Small number formats: IEEE half, RGB9E5 (shared exponent), octahedral normals, zigzag.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

namespace kiln::level {

// Round to nearest even; beyond the largest half: the largest half (a lightmap has no use for infinity); NaN: 0.
inline std::uint16_t half_from_float(float value) {
    if (!(value == value)) return 0;
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(value);
    const std::uint32_t sign = bits >> 16 & 0x8000u;
    const float magnitude = std::bit_cast<float>(bits & 0x7fffffffu);
    if (magnitude >= 65504.0f) return static_cast<std::uint16_t>(sign | 0x7bffu);
    if (magnitude < 6.103515625e-05f) // below 2^-14: subnormal halves are multiples of 2^-24
        return static_cast<std::uint16_t>(sign | static_cast<std::uint32_t>(std::nearbyint(magnitude * 16777216.0f)));
    const std::uint32_t m = bits & 0x7fffffffu;
    const std::uint32_t rounded = m + 0xfffu + (m >> 13 & 1u);
    return static_cast<std::uint16_t>(sign | ((rounded - (112u << 23)) >> 13));
}
inline float float_from_half(std::uint16_t half) {
    const std::uint32_t sign = static_cast<std::uint32_t>(half & 0x8000u) << 16;
    const std::uint32_t exponent = half >> 10 & 31u, mantissa = half & 1023u;
    if (exponent == 0) {
        const float f = static_cast<float>(mantissa) * 5.9604644775390625e-08f;
        return sign ? -f : f;
    }
    if (exponent == 31) // never written; read as the largest number, so that no infinity enters the arithmetic
        return sign ? -65504.0f : 65504.0f;
    return std::bit_cast<float>(sign | (exponent + 112u) << 23 | mantissa << 13);
}

// Three 9-bit mantissas over one 5-bit exponent (bias 15), rounded to nearest; negative and NaN: 0.
// Source: the OpenGL extension EXT_texture_shared_exponent.
constexpr float kRgb9e5Max = 65408.0f;
inline std::uint32_t rgb9e5_from_float(const std::array<float, 3>& rgb) {
    std::array<float, 3> c{};
    float largest = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        c[i] = rgb[i] > 0 ? std::min(rgb[i], kRgb9e5Max) : 0.0f;
        largest = std::max(largest, c[i]);
    }
    int exponent = -16; // of the largest: 2^exponent <= largest < 2^(exponent+1)
    if (largest > 0) exponent = std::max(exponent, std::ilogb(largest));
    exponent += 1;
    float step = std::ldexp(1.0f, exponent - 9);
    if (std::floor(largest / step + 0.5f) == 512.0f) step *= 2, ++exponent;
    std::uint32_t packed = static_cast<std::uint32_t>(exponent + 15) << 27;
    for (std::size_t i = 0; i < 3; ++i)
        packed |= static_cast<std::uint32_t>(std::floor(c[i] / step + 0.5f)) << (9 * i);
    return packed;
}
inline std::array<float, 3> float_from_rgb9e5(std::uint32_t packed) {
    const float step = std::ldexp(1.0f, static_cast<int>(packed >> 27) - 15 - 9);
    return {static_cast<float>(packed & 511u) * step, static_cast<float>(packed >> 9 & 511u) * step,
            static_cast<float>(packed >> 18 & 511u) * step};
}

// Unit vectors on the octahedron unfolded to a square, 16 bits a coordinate.
// Source: Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 2014.
inline std::array<std::int16_t, 2> oct_from_normal(const std::array<float, 3>& n) {
    const float sum = std::abs(n[0]) + std::abs(n[1]) + std::abs(n[2]);
    if (!(sum > 0)) return {0, 0};
    float x = n[0] / sum, y = n[1] / sum;
    if (n[2] < 0) {
        const float fx = (1 - std::abs(y)) * (x >= 0 ? 1.0f : -1.0f);
        y = (1 - std::abs(x)) * (y >= 0 ? 1.0f : -1.0f);
        x = fx;
    }
    const auto quantise = [](float v) {
        return static_cast<std::int16_t>(std::nearbyint(std::clamp(v, -1.0f, 1.0f) * 32767.0f));
    };
    return {quantise(x), quantise(y)};
}
inline std::array<float, 3> normal_from_oct(std::int16_t qx, std::int16_t qy) {
    float x = static_cast<float>(qx) / 32767.0f, y = static_cast<float>(qy) / 32767.0f;
    const float z = 1 - std::abs(x) - std::abs(y);
    if (z < 0) {
        const float fx = (1 - std::abs(y)) * (x >= 0 ? 1.0f : -1.0f);
        y = (1 - std::abs(x)) * (y >= 0 ? 1.0f : -1.0f);
        x = fx;
    }
    const float length = std::sqrt(x * x + y * y + z * z);
    return {x / length, y / length, z / length};
}

constexpr std::uint32_t zigzag(std::int32_t v) {
    return (static_cast<std::uint32_t>(v) << 1) ^ static_cast<std::uint32_t>(v >> 31);
}
constexpr std::int32_t unzigzag(std::uint32_t v) { return static_cast<std::int32_t>(v >> 1 ^ (0u - (v & 1u))); }

// A relative error in one byte, 6 % steps: 0 unknown, else 2^((q - 208) / 12), from 7e-6 to 15.
inline std::uint8_t error_code(float error) {
    if (!(error > 0)) return 0;
    return static_cast<std::uint8_t>(std::clamp(std::nearbyint(std::log2(error) * 12.0f + 208.0f), 1.0f, 255.0f));
}
inline float error_from_code(std::uint8_t code) {
    return code == 0 ? 0.0f : std::exp2((static_cast<float>(code) - 208.0f) / 12.0f);
}

} // namespace kiln::level

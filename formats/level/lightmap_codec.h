// SPDX-License-Identifier: MIT
// Texels as bytes. Halfs: for each layer and channel, differences to the left neighbour (16-bit, wrapping), low bytes
// then high bytes. RGB9E5: for each layer four planes: the low 8 bits of r, g and b, then exponent and top bits.
#pragma once
#include "formats/level/tables.h"

namespace kiln::level {

// Texels in run-time order: layer, row, column; three halfs or one word each.
inline Blob encode_texels(const std::uint8_t* texels, std::uint64_t width, std::uint64_t rows, std::uint32_t format) {
    const std::size_t n = width * rows;
    Blob out(n * texel_size(format));
    if (format == KILN_TEXEL_RGB9E5) {
        for (std::size_t i = 0; i < n; ++i) {
            std::uint32_t p = 0;
            std::memcpy(&p, texels + 4 * i, 4);
            out[i] = static_cast<std::uint8_t>(p);
            out[n + i] = static_cast<std::uint8_t>(p >> 9);
            out[2 * n + i] = static_cast<std::uint8_t>(p >> 18);
            out[3 * n + i] = static_cast<std::uint8_t>(p >> 27 << 3 | (p >> 8 & 1) | (p >> 17 & 1) << 1 | (p >> 26 & 1) << 2);
        }
        return out;
    }
    for (std::size_t c = 0; c < 3; ++c) {
        std::uint16_t before = 0;
        for (std::size_t i = 0; i < n; ++i) {
            std::uint16_t v = 0;
            std::memcpy(&v, texels + 6 * i + 2 * c, 2);
            const auto d = static_cast<std::uint16_t>(v - before);
            before = v;
            out[2 * c * n + i] = static_cast<std::uint8_t>(d);
            out[(2 * c + 1) * n + i] = static_cast<std::uint8_t>(d >> 8);
        }
    }
    return out;
}

inline Blob decode_texels(const std::uint8_t* bytes, std::uint64_t width, std::uint64_t rows, std::uint32_t format) {
    const std::size_t n = width * rows;
    Blob out(n * texel_size(format));
    if (format == KILN_TEXEL_RGB9E5) {
        for (std::size_t i = 0; i < n; ++i) {
            const std::uint32_t top = bytes[3 * n + i];
            const std::uint32_t p = bytes[i] | (top & 1) << 8 | static_cast<std::uint32_t>(bytes[n + i]) << 9 |
                                    (top >> 1 & 1) << 17 | static_cast<std::uint32_t>(bytes[2 * n + i]) << 18 |
                                    (top >> 2 & 1) << 26 | top >> 3 << 27;
            std::memcpy(out.data() + 4 * i, &p, 4);
        }
        return out;
    }
    for (std::size_t c = 0; c < 3; ++c) {
        std::uint16_t v = 0;
        for (std::size_t i = 0; i < n; ++i) {
            v = static_cast<std::uint16_t>(v + (bytes[2 * c * n + i] | bytes[(2 * c + 1) * n + i] << 8));
            std::memcpy(out.data() + 6 * i + 2 * c, &v, 2);
        }
    }
    return out;
}

} // namespace kiln::level

#include "formats/texture/little_endian.h"
#include "formats/texture/picture.h"
#include "formats/texture/vtf.h"
#include <algorithm>
#include <array>
#include <fmt/format.h>

namespace kiln {
namespace {

using namespace texture;
using Texel = std::array<std::uint8_t, 4>;

enum class Format : std::uint32_t {
    rgba = 0, abgr = 1, rgb = 2, bgr = 3, grey_alpha = 6, alpha = 8, argb = 11, bgra = 12, dxt1 = 13, dxt3 = 14, dxt5 = 15, bgrx = 16, bgra4444 = 19, dxt1_alpha = 20, bgra5551 = 21
};
std::size_t bits_of(Format f) { // a texel; 0: not read here
    switch (f) {
    case Format::dxt1: case Format::dxt1_alpha: return 4;
    case Format::dxt3: case Format::dxt5: case Format::alpha: return 8;
    case Format::grey_alpha: case Format::bgra4444: case Format::bgra5551: return 16;
    case Format::rgb: case Format::bgr: return 24;
    case Format::rgba: case Format::abgr: case Format::argb: case Format::bgra: case Format::bgrx: return 32;
    }
    return 0;
}
bool in_blocks(Format f) { return f == Format::dxt1 || f == Format::dxt1_alpha || f == Format::dxt3 || f == Format::dxt5; }
std::size_t size_of(Format f, std::size_t w, std::size_t h) {
    if (in_blocks(f)) return (w + 3) / 4 * ((h + 3) / 4) * bits_of(f) * 2;
    return w * h * bits_of(f) / 8;
}

Texel of_565(std::uint32_t c) {
    const std::uint32_t r = c >> 11, g = c >> 5 & 63, b = c & 31;
    return {static_cast<std::uint8_t>(r << 3 | r >> 2), static_cast<std::uint8_t>(g << 2 | g >> 4), static_cast<std::uint8_t>(b << 3 | b >> 2), 255};
}
std::uint8_t blend(std::uint8_t a, std::uint8_t b, std::uint32_t of_a, std::uint32_t of_b) { return static_cast<std::uint8_t>((a * of_a + b * of_b) / (of_a + of_b)); }

// 16 texels of a block.
std::array<Texel, 16> block(std::span<const std::uint8_t> b, Format f) {
    std::array<Texel, 16> out{};
    const std::size_t colours = f == Format::dxt3 || f == Format::dxt5 ? 8 : 0;
    const std::uint32_t c0 = u16(b, colours), c1 = u16(b, colours + 2), codes = u32(b, colours + 4);
    std::array<Texel, 4> table{of_565(c0), of_565(c1), {}, {}};
    const bool four = colours || c0 > c1;
    for (std::size_t k = 0; k < 3; ++k) {
        table[2][k] = four ? blend(table[0][k], table[1][k], 2, 1) : blend(table[0][k], table[1][k], 1, 1);
        table[3][k] = four ? blend(table[0][k], table[1][k], 1, 2) : 0;
    }
    table[2][3] = 255, table[3][3] = four ? 255 : 0;
    for (std::size_t i = 0; i < 16; ++i) out[i] = table[codes >> (2 * i) & 3];
    if (f == Format::dxt3)
        for (std::size_t i = 0; i < 16; ++i) out[i][3] = static_cast<std::uint8_t>((b[i / 2] >> (i % 2 * 4) & 15) * 17);
    if (f == Format::dxt5) {
        std::array<std::uint8_t, 8> alpha{b[0], b[1]};
        for (std::uint32_t k = 2; k < 8; ++k) alpha[k] = b[0] > b[1] ? blend(b[0], b[1], 8 - k, k - 1) : k < 6 ? blend(b[0], b[1], 6 - k, k - 1) : k == 6 ? 0 : 255;
        std::uint64_t bits = 0;
        for (std::size_t k = 0; k < 6; ++k) bits |= std::uint64_t{b[2 + k]} << (8 * k);
        for (std::size_t i = 0; i < 16; ++i) out[i][3] = alpha[bits >> (3 * i) & 7];
    }
    return out;
}
Texel texel(std::span<const std::uint8_t> b, Format f) {
    const auto wide = [](std::uint32_t v, std::uint32_t most) { return static_cast<std::uint8_t>(v * 255 / most); };
    switch (f) {
    case Format::rgba: return {b[0], b[1], b[2], b[3]};
    case Format::abgr: return {b[3], b[2], b[1], b[0]};
    case Format::argb: return {b[1], b[2], b[3], b[0]};
    case Format::bgra: return {b[2], b[1], b[0], b[3]};
    case Format::bgrx: case Format::bgr: return {b[2], b[1], b[0], 255};
    case Format::rgb: return {b[0], b[1], b[2], 255};
    case Format::grey_alpha: return {b[0], b[0], b[0], b[1]};
    case Format::alpha: return {255, 255, 255, b[0]};
    case Format::bgra4444: return {wide(b[1] & 15, 15), wide(b[0] >> 4, 15), wide(b[0] & 15, 15), wide(b[1] >> 4, 15)};
    case Format::bgra5551: {
        const std::uint32_t v = u16(b, 0);
        return {wide(v >> 10 & 31, 31), wide(v >> 5 & 31, 31), wide(v & 31, 31), static_cast<std::uint8_t>(v >> 15 ? 255 : 0)};
    }
    default: return {};
    }
}

} // namespace

Result<TexelPicture> read_vtf_picture(std::span<const std::uint8_t> bytes, const std::string& file) {
    const auto no = [&](std::string message) { return fault(Exit::input, "texture-unreadable", std::move(message), {.file = file}); };
    const auto head = read_vtf_head(bytes.first(std::min(bytes.size(), kVtfHeadBytes)), file);
    if (!head) return head.fault();
    constexpr std::uint32_t kCubeMap = 0x4000, kNone = 0xFFFFFFFF;
    const std::uint32_t minor = u32(bytes, 8), head_size = u32(bytes, 12), flags = u32(bytes, 20), frames = std::max(1u, u16(bytes, 24)), mips = std::max<std::uint32_t>(1, bytes[56]);
    const auto format = static_cast<Format>(u32(bytes, 52));
    constexpr std::uint32_t kMostMips = 17;
    if (bits_of(format) == 0 || (flags & kCubeMap)) return TexelPicture{};
    if (mips > kMostMips) return no(fmt::format("it has {} sizes", mips));
    std::size_t at = head_size;
    if (minor >= 3) {
        constexpr std::size_t kResources = 80;
        if (bytes.size() < kResources) return no("it is cut short");
        const std::uint32_t count = u32(bytes, 68);
        if (count > (bytes.size() - kResources) / 8) return no("its list of parts is cut short");
        bool found = false;
        for (std::size_t i = 0; i < count && !found; ++i)
            if (const std::size_t entry = kResources + 8 * i; bytes[entry] == 0x30 && bytes[entry + 1] == 0 && bytes[entry + 2] == 0) at = u32(bytes, entry + 4), found = true;
        if (!found) return TexelPicture{};
    } else {
        const std::uint32_t low = static_cast<std::uint32_t>(bytes[57]) | std::uint32_t{bytes[58]} << 8 | std::uint32_t{bytes[59]} << 16 | std::uint32_t{bytes[60]} << 24;
        if (low != kNone) at += size_of(Format::dxt1, bytes[61], bytes[62]);
    }
    if (minor >= 2 && bytes.size() > 65 && u16(bytes, 63) > 1) return TexelPicture{};
    const auto w = static_cast<std::size_t>(head->width), h = static_cast<std::size_t>(head->height);
    for (std::uint32_t m = 1; m < mips; ++m) at += size_of(format, std::max<std::size_t>(1, w >> m), std::max<std::size_t>(1, h >> m)) * frames;
    const std::size_t size = size_of(format, w, h);
    if (at > bytes.size() || size > bytes.size() - at) return no("it is cut short");
    const std::span<const std::uint8_t> data = bytes.subspan(at, size);
    TexelPicture out{head->width, head->height, Bytes(4 * w * h)};
    const auto put = [&](std::size_t x, std::size_t y, const Texel& t) { std::ranges::copy(t, out.rgba.begin() + static_cast<std::ptrdiff_t>(4 * (y * w + x))); };
    if (in_blocks(format)) {
        const std::size_t stride = bits_of(format) * 2, across = (w + 3) / 4;
        for (std::size_t b = 0; b < data.size() / stride; ++b) {
            const auto texels = block(data.subspan(b * stride, stride), format);
            for (std::size_t i = 0; i < 16; ++i)
                if (const std::size_t x = b % across * 4 + i % 4, y = b / across * 4 + i / 4; x < w && y < h) put(x, y, texels[i]);
        }
    } else {
        const std::size_t stride = bits_of(format) / 8;
        for (std::size_t i = 0; i < w * h; ++i) put(i % w, i / w, texel(data.subspan(i * stride, stride), format));
    }
    return out;
}

} // namespace kiln

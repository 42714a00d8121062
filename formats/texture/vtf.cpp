#include "formats/texture/vtf.h"
#include "formats/texture/little_endian.h"
#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>

namespace kiln {

Result<VtfHead> read_vtf_head(std::span<const std::uint8_t> bytes, const std::string& file) {
    const auto no = [&](std::string message) { return fault(Exit::input, "texture-unreadable", std::move(message), {.file = file}); };
    using namespace texture;
    if (bytes.size() < kVtfHeadBytes || std::memcmp(bytes.data(), "VTF\0", 4) != 0) return no("this is no VTF texture, or not all of one");
    if (u32(bytes, 4) != 7 || u32(bytes, 8) > 6) return no(fmt::format("a VTF of version {}.{} is not known", u32(bytes, 4), u32(bytes, 8)));
    VtfHead out{static_cast<int>(u16(bytes, 16)), static_cast<int>(u16(bytes, 18)), {}};
    if (out.width == 0 || out.height == 0) return no("it has no size");
    double* const channels[] = {&out.reflectivity.x, &out.reflectivity.y, &out.reflectivity.z};
    for (std::size_t c = 0; c < 3; ++c) {
        const std::uint32_t bits = u32(bytes, 32 + 4 * c);
        float v = 0;
        std::memcpy(&v, &bits, 4);
        *channels[c] = v >= 0 ? std::min(1.0, static_cast<double>(v)) : 0; // not a number: 0
    }
    return out;
}

} // namespace kiln

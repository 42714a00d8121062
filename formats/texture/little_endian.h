// Numbers in the files of games. Private to this folder; the bytes are there.
#pragma once
#include <cstdint>
#include <span>

namespace kiln::texture {

inline std::uint32_t u16(std::span<const std::uint8_t> b, std::size_t at) { return std::uint32_t{b[at]} | std::uint32_t{b[at + 1]} << 8; }
inline std::uint32_t u32(std::span<const std::uint8_t> b, std::size_t at) { return u16(b, at) | u16(b, at + 2) << 16; }

} // namespace kiln::texture

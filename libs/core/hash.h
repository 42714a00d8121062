// Content hashes (XXH3, 128 bit): keys of the stage cache, checksums of lumps, seeds of random streams.
#pragma once
#include "libs/core/archive.h"
#include <compare>
#include <span>
#include <string>

namespace kiln {

struct Hash {
    static constexpr bool kRawBytes = true;
    std::uint64_t low = 0, high = 0;
    friend constexpr auto operator<=>(const Hash&, const Hash&) = default;
};
Hash hash_bytes(std::span<const std::uint8_t> bytes);
std::string to_hex(Hash hash); // 32 lower-case digits
template <class T> Hash hash_of(const T& value) { return hash_bytes(to_bytes(value)); }

// A well-mixed 64-bit value of small keys, for seeds: mix(face, luxel, pass).
constexpr std::uint64_t mix(std::uint64_t x) {
    x ^= x >> 30, x *= 0xBF58476D1CE4E5B9ull;
    x ^= x >> 27, x *= 0x94D049BB133111EBull;
    return x ^ (x >> 31);
}
template <class... Rest> constexpr std::uint64_t mix(std::uint64_t first, Rest... rest) {
    return mix(first * 0x9E3779B97F4A7C15ull + mix(static_cast<std::uint64_t>(rest)...));
}

} // namespace kiln

// Owen-scrambled Sobol points: every power-of-two prefix of a scrambled sequence is again well stratified, so a
// bundle may be cut or doubled without wasting a ray, and two seeds give independent unbiased replicates.
//
// Source   I. Sobol 1967 with the direction numbers of S. Joe and F. Kuo 2008; scrambling by a hash in which each
//          bit is changed only by the bits above it (A. Owen 1995; S. Laine and T. Karras 2011; B. Burley,
//          "Practical Hash-based Owen Scrambling", JCGT 2020)
#pragma once
#include "libs/core/hash.h"
#include "libs/math/vec.h"
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>

namespace kiln {

// A seed for what lies at a place of the world, 1/64 map unit: the same wherever in a list it stands.
template <class... Keys> std::uint64_t mix_place(Vec3 p, Keys... keys) {
    const auto q = [](double x) { return static_cast<std::uint64_t>(std::llround(x * 64)); };
    return mix(keys..., q(p.x), q(p.y), q(p.z));
}

constexpr int kSobolDimensions = 6;

namespace detail {

constexpr std::uint32_t reverse_bits(std::uint32_t x) {
    x = (x >> 16) | (x << 16);
    x = ((x & 0x00FF00FFu) << 8) | ((x & 0xFF00FF00u) >> 8);
    x = ((x & 0x0F0F0F0Fu) << 4) | ((x & 0xF0F0F0F0u) >> 4);
    x = ((x & 0x33333333u) << 2) | ((x & 0xCCCCCCCCu) >> 2);
    return ((x & 0x55555555u) << 1) | ((x & 0xAAAAAAAAu) >> 1);
}

// Direction numbers of one dimension, bit reversed (the form the scrambling wants).
constexpr std::array<std::uint32_t, 32> sobol_directions(int dimension) {
    struct Row {
        int s;
        std::uint32_t a;
        std::array<std::uint32_t, 5> m;
    };
    constexpr std::array<Row, 6> rows{
        {{0, 0, {}}, {1, 0, {1}}, {2, 1, {1, 3}}, {3, 1, {1, 3, 1}}, {3, 2, {1, 1, 1}}, {4, 1, {1, 1, 3, 3}}}};
    const Row row = rows[static_cast<std::size_t>(dimension)];
    std::array<std::uint32_t, 32> v{};
    for (int k = 0; k < 32; ++k) {
        const auto i = static_cast<std::size_t>(k);
        if (row.s == 0)
            v[i] = 1u << (31 - k);
        else if (k < row.s)
            v[i] = row.m[i] << (31 - k);
        else {
            const auto s = static_cast<std::size_t>(row.s);
            v[i] = v[i - s] ^ (v[i - s] >> s);
            for (std::size_t j = 1; j < s; ++j)
                if ((row.a >> (s - 1 - j)) & 1u) v[i] ^= v[i - j];
        }
    }
    for (auto& x : v) x = reverse_bits(x);
    return v;
}

// The xor of the direction numbers of 8 index bits at a time.
using SobolTable = std::array<std::array<std::array<std::uint32_t, 256>, 3>, kSobolDimensions>;
constexpr SobolTable make_sobol_table() {
    SobolTable table{};
    for (int d = 0; d < kSobolDimensions; ++d) {
        const auto v = sobol_directions(d);
        for (std::size_t byte = 0; byte < 3; ++byte)
            for (std::uint32_t i = 1; i < 256; ++i) {
                const auto low = static_cast<std::size_t>(std::countr_zero(i));
                auto& t = table[static_cast<std::size_t>(d)][byte];
                t[i] = t[i & (i - 1)] ^ v[byte * 8 + low];
            }
    }
    return table;
}
inline constexpr SobolTable kSobolTable = make_sobol_table();

// Each output bit depends on the input bits at and below it (reversed order), so this permutes the binary tree of
// intervals and nothing else. Additions flip, odd factors make the flips of a bit depend on those below it; every
// step has its own random word: with words shared between steps single points come out visibly non-uniform.
struct Scramble {
    std::array<std::uint32_t, 4> word{};
    constexpr Scramble() = default;
    constexpr explicit Scramble(std::uint64_t seed) {
        const std::uint64_t a = mix(seed + 0x9E3779B97F4A7C15ull), b = mix(a + 0x9E3779B97F4A7C15ull);
        word = {static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(a >> 32) | 1u,
                static_cast<std::uint32_t>(b), static_cast<std::uint32_t>(b >> 32) | 1u};
    }
    constexpr std::uint32_t operator()(std::uint32_t x) const {
        x += word[0];
        x ^= x * 0x6C50B47Cu;
        x *= word[1];
        x ^= x * 0xB82F1E52u;
        x += word[2];
        x ^= x * 0xC7AFE638u;
        x *= word[3];
        x ^= x * 0x8D22F6E6u;
        return x;
    }
};

} // namespace detail

// The point set of one seed.
class Sobol {
public:
    explicit constexpr Sobol(std::uint64_t seed) {
        for (std::size_t d = 0; d < kSobolDimensions; ++d) scramble_[d] = detail::Scramble(mix(seed, d + 1));
    }
    // In [0, 1), index < 2^24.
    constexpr double operator()(std::uint32_t index, int dimension) const {
        const auto d = static_cast<std::size_t>(dimension);
        const auto& t = detail::kSobolTable[d];
        const std::uint32_t raw = t[0][index & 255] ^ t[1][(index >> 8) & 255] ^ t[2][(index >> 16) & 255];
        return detail::reverse_bits(scramble_[d](raw)) * 0x1p-32;
    }
    // The first points, in one dimension: the same, a step at a time for all of them.
    void first(std::span<double> out, int dimension) const {
        const auto d = static_cast<std::size_t>(dimension);
        const auto& t = detail::kSobolTable[d];
        const detail::Scramble& scramble = scramble_[d];
        std::array<std::uint32_t, 64> x;
        for (std::size_t from = 0; from < out.size(); from += x.size()) {
            const std::size_t n = std::min(x.size(), out.size() - from);
            for (std::size_t i = 0; i < n; ++i) x[i] = t[0][(from + i) & 255] ^ t[1][((from + i) >> 8) & 255] ^ t[2][((from + i) >> 16) & 255];
            for (std::size_t i = 0; i < n; ++i) x[i] = detail::reverse_bits(scramble(x[i]));
            // Halves, which fit what processors turn into doubles.
            for (std::size_t i = 0; i < n; ++i) out[from + i] = static_cast<std::int32_t>(x[i] >> 16) * 0x1p-16 + static_cast<std::int32_t>(x[i] & 0xFFFFu) * 0x1p-32;
        }
    }
    // Dimensions (0,1) of any 2^k points starting at a multiple of 2^k are a (0,k,2)-net.
    constexpr Vec2 pair(std::uint32_t index, int first_dimension) const {
        return {(*this)(index, first_dimension), (*this)(index, first_dimension + 1)};
    }

private:
    std::array<detail::Scramble, kSobolDimensions> scramble_{};
};

// Independent uniform numbers where stratification is of no use (roulette, long paths).
class Random {
public:
    explicit constexpr Random(std::uint64_t seed) : state_(mix(seed ^ 0x632BE59BD9B4E019ull)) {}
    constexpr double operator()() {
        state_ += 0x9E3779B97F4A7C15ull;
        return static_cast<double>(mix(state_) >> 11) * 0x1p-53;
    }

private:
    std::uint64_t state_;
};

// Point i of n of the Hammersley set.
constexpr Vec2 hammersley(std::uint32_t i, std::uint32_t n) {
    return {(i + 0.5) / n, detail::reverse_bits(i) * 0x1p-32};
}

} // namespace kiln

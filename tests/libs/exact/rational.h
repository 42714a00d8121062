// The oracle: planes and points in arbitrary rationals, by elimination rather than by determinants.
#pragma once
#include "libs/exact/plane.h"
#include <boost/multiprecision/cpp_int.hpp>
#include <random>
#include <utility>

namespace kiln::test {

using Rational = boost::multiprecision::cpp_rational;
using Integer = boost::multiprecision::cpp_int;
using RationalPoint = std::array<Rational, 3>;

inline Integer integer(__int128 v) {
    const bool negative = v < 0;
    const auto m = negative ? -static_cast<unsigned __int128>(v) : static_cast<unsigned __int128>(v);
    Integer r = static_cast<std::uint64_t>(m >> 64);
    r = (r << 64) + static_cast<std::uint64_t>(m);
    return negative ? Integer(-r) : r;
}
inline std::array<Rational, 4> rational(const ExactPlane& p) {
    return {Rational(p.a), Rational(p.b), Rational(p.c), Rational(integer(p.d))};
}

// Gauss-Jordan; grid units. Nothing: singular.
inline std::optional<RationalPoint> solve(const PlaneTable& t, PlaneId p, PlaneId q, PlaneId r) {
    std::array<std::array<Rational, 4>, 3> m{rational(t.planes[p.at()]), rational(t.planes[q.at()]),
                                             rational(t.planes[r.at()])};
    for (std::size_t col = 0; col < 3; ++col) {
        std::size_t pivot = col;
        while (pivot < 3 && m[pivot][col] == 0) ++pivot;
        if (pivot == 3) return std::nullopt;
        std::swap(m[pivot], m[col]);
        for (std::size_t row = 0; row < 3; ++row) {
            if (row == col || m[row][col] == 0) continue;
            const Rational f = m[row][col] / m[col][col];
            for (std::size_t k = col; k < 4; ++k) m[row][k] -= f * m[col][k];
        }
    }
    return RationalPoint{m[0][3] / m[0][0], m[1][3] / m[1][1], m[2][3] / m[2][2]};
}
inline int side_of(const PlaneTable& t, const RationalPoint& x, PlaneId q) {
    const auto p = rational(t.planes[q.at()]);
    const Rational s = p[0] * x[0] + p[1] * x[1] + p[2] * x[2] - p[3];
    return s.sign();
}

// A plane through three random grid points within +-range.
inline PlaneId random_plane(PlaneTable& t, std::mt19937_64& rng, std::int64_t range) {
    for (;;) {
        std::array<GridPoint, 3> p;
        for (auto& g : p)
            for (auto& x : g) x = static_cast<std::int64_t>(rng() % static_cast<std::uint64_t>(2 * range + 1)) - range;
        if (const auto id = t.add(p[0], p[1], p[2])) return *id;
    }
}

} // namespace kiln::test

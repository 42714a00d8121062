// Exact identities between rational numbers without big rationals: coordinates of exact points in the field of
// 2^61 - 1 elements. Sums of areas and volumes are rational functions of the planes' integers; two that are equal are
// equal there, and two that are not agree by chance once in 2^61.
#pragma once
#include "libs/exact/plane.h"
#include <array>
#include <compare>
#include <cstdint>
#include <stdexcept>

namespace kiln::proof {

struct F {
    static constexpr std::uint64_t kP = (std::uint64_t{1} << 61) - 1;
    std::uint64_t v = 0;

    constexpr F() = default;
    constexpr F(std::int64_t x) : v(of(x).v) {}
    static constexpr F of(__int128 x) {
        __int128 r = x % static_cast<__int128>(kP);
        if (r < 0) r += kP;
        F f;
        f.v = static_cast<std::uint64_t>(r);
        return f;
    }
    friend constexpr F operator+(F a, F b) { return raw(a.v + b.v); }
    friend constexpr F operator-(F a, F b) { return raw(a.v + kP - b.v); }
    constexpr F operator-() const { return raw(kP - v); }
    friend constexpr F operator*(F a, F b) {
        const unsigned __int128 m = static_cast<unsigned __int128>(a.v) * b.v;
        return raw((static_cast<std::uint64_t>(m) & kP) + static_cast<std::uint64_t>(m >> 61));
    }
    constexpr F& operator+=(F b) { return *this = *this + b; }
    F inverse() const {
        if (v == 0) throw std::runtime_error("no inverse of 0 modulo 2^61 - 1");
        F result(1), base = *this;
        for (std::uint64_t e = kP - 2; e; e >>= 1, base = base * base)
            if (e & 1) result = result * base;
        return result;
    }
    friend constexpr auto operator<=>(F, F) = default;

private:
    static constexpr F raw(std::uint64_t x) { // x < 2^62
        F f;
        x = (x & kP) + (x >> 61);
        f.v = x >= kP ? x - kP : x;
        return f;
    }
};

using F3 = std::array<F, 3>;
inline F3 operator+(const F3& a, const F3& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
inline F3 operator-(const F3& a, const F3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline F3 operator*(const F3& a, F s) { return {a[0] * s, a[1] * s, a[2] * s}; }
inline F dot(const F3& a, const F3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline F3 cross(const F3& a, const F3& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

struct FPlane {
    F3 n;
    F d;
};
inline FPlane in_field(const ExactPlane& p) { return {{F(p.a), F(p.b), F(p.c)}, F::of(p.d)}; }

// Where three planes meet, map units (grid units divided by 2^grid_bits).
inline F3 meet(const PlaneTable& planes, PlaneId p, PlaneId q, PlaneId r) {
    const FPlane a = in_field(planes.planes[p.at()]), b = in_field(planes.planes[q.at()]), c = in_field(planes.planes[r.at()]);
    const F3 bc = cross(b.n, c.n);
    const F w = dot(a.n, bc) * F(std::int64_t{1} << planes.grid_bits);
    return (bc * a.d + cross(c.n, a.n) * b.d + cross(a.n, b.n) * c.d) * w.inverse();
}
inline std::vector<F3> points_in_field(const PlaneTable& planes, const PlanePolygon& polygon) {
    std::vector<F3> result;
    PlaneId before = polygon.edges.back();
    for (const PlaneId after : polygon.edges) result.push_back(meet(planes, polygon.support, before, after)), before = after;
    return result;
}

// Twice the area as a vector along the normal, and six times the volume of the cone from the origin.
struct Integral {
    F3 twice_area{};
    F six_volume;
    void add(const PlaneTable& planes, const PlanePolygon& polygon) {
        const std::vector<F3> p = points_in_field(planes, polygon);
        F3 sum{};
        for (std::size_t i = 1; i + 1 < p.size(); ++i) sum = sum + cross(p[i] - p[0], p[i + 1] - p[0]);
        twice_area = twice_area + sum;
        six_volume += dot(sum, p[0]);
    }
    friend bool operator==(const Integral&, const Integral&) = default;
};

} // namespace kiln::proof

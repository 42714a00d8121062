// Private: the wide integers behind the last predicate tier, and the minors of planes in any number type.
#pragma once
#include "libs/exact/plane.h"
#include <boost/multiprecision/cpp_int.hpp>

namespace kiln::exact_detail {

using Int128 = __int128;
using UInt128 = unsigned __int128;
using Int512 = boost::multiprecision::number<boost::multiprecision::cpp_int_backend<
    512, 512, boost::multiprecision::signed_magnitude, boost::multiprecision::unchecked, void>>;

inline Int512 widen(Int128 v) {
    const bool negative = v < 0;
    const UInt128 m = negative ? UInt128(0) - static_cast<UInt128>(v) : static_cast<UInt128>(v);
    Int512 r = static_cast<std::uint64_t>(m >> 64);
    r <<= 64;
    r += static_cast<std::uint64_t>(m);
    return negative ? Int512(-r) : r;
}

template <class T> struct Plane4 { T a, b, c, d; };
template <class T> struct Homogeneous { T x, y, z, w; };

inline Plane4<Int128> in128(const ExactPlane& p) { return {p.a, p.b, p.c, p.d}; }
inline Plane4<Int512> in512(const ExactPlane& p) { return {Int512(p.a), Int512(p.b), Int512(p.c), widen(p.d)}; }

// Cramer: the meeting point is (x, y, z) / w, grid units. w may be negative.
template <class T> inline __attribute__((always_inline)) Homogeneous<T> meet(const Plane4<T>& p, const Plane4<T>& q, const Plane4<T>& r) {
    const T qr_x = q.b * r.c - q.c * r.b, qr_y = q.c * r.a - q.a * r.c, qr_z = q.a * r.b - q.b * r.a;
    const T rp_x = r.b * p.c - r.c * p.b, rp_y = r.c * p.a - r.a * p.c, rp_z = r.a * p.b - r.b * p.a;
    const T pq_x = p.b * q.c - p.c * q.b, pq_y = p.c * q.a - p.a * q.c, pq_z = p.a * q.b - p.b * q.a;
    return {T(p.d * qr_x + q.d * rp_x + r.d * pq_x), T(p.d * qr_y + q.d * rp_y + r.d * pq_y),
            T(p.d * qr_z + q.d * rp_z + r.d * pq_z), T(p.a * qr_x + p.b * qr_y + p.c * qr_z)};
}

template <class T> int sign_of(const T& v) { return v > 0 ? 1 : v < 0 ? -1 : 0; }

} // namespace kiln::exact_detail

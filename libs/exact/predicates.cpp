// Signs of determinants of planes, and the rounding of their meeting points. Every tier gives the exact sign;
// they differ only in the sizes they can take.
#include "libs/core/check.h"
#include "libs/exact/wide.h"
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>

namespace kiln {
using namespace exact_detail;
namespace {

// A sum of products whose magnitudes add up to at most this has no rounding at all in doubles: every partial
// result is an integer below 2^53.
constexpr double kExactInDouble = 9007199254740992.0; // 2^53
// Relative to the same sum: no more than 12 roundings (two of them from coefficients that are not doubles) lie
// between the inputs and the result, each 2^-53.
constexpr double kFilter = 16 * 0x1p-52;
// The sum in __int128; the bound itself is computed in doubles, so a bit is kept in hand.
constexpr double kFits128 = 0x1p125;

// n / d from n and d cut to 64 bits: errors of 2^-63, 2^-63 and 2^-64 make less than 2^-61, so unless the quotient comes that near to the middle
// between two doubles, its nearest double is that of the exact quotient. Nothing: too near, one in a hundred.
std::optional<double> quick_ratio(long double n, long double d) {
    if constexpr (std::numeric_limits<long double>::digits >= 64) {
        const long double q = n / d, error = std::fabs(q) * 0x1p-61L;
        const auto low = static_cast<double>(q - error), high = static_cast<double>(q + error);
        if (low == high) return low;
    }
    return std::nullopt;
}

long double leading(const Int512& v) { // relative error below 2^-63, towards zero
    if (v == 0) return 0;
    const Int512 m = abs(v);
    const int below = std::max(static_cast<int>(msb(m)) - 63, 0);
    const auto top = static_cast<std::uint64_t>(Int512(m >> below));
    const long double r = std::ldexp(static_cast<long double>(top), below);
    return v < 0 ? -r : r;
}

// n * 2^-shift / d rounded to nearest even by long division.
double round_ratio(Int128 n, Int128 d, int shift) {
    if (n == 0) return 0;
    if (const auto quick = quick_ratio(static_cast<long double>(n), static_cast<long double>(d)))
        return std::ldexp(*quick, -shift);
    const bool negative = (n < 0) != (d < 0);
    UInt128 un = n < 0 ? -static_cast<UInt128>(n) : static_cast<UInt128>(n);
    const UInt128 ud = d < 0 ? -static_cast<UInt128>(d) : static_cast<UInt128>(d);
    UInt128 quotient = un / ud, rest = un % ud;
    int exponent = 0;
    if (quotient >> 62) { // does not happen within the world, but costs nothing
        while (quotient >> 62) rest |= quotient & 1, quotient >>= 1, ++exponent;
    } else {
        while (rest != 0 && !(quotient >> 55)) {
            rest <<= 1, quotient <<= 1, --exponent;
            if (rest >= ud) rest -= ud, quotient |= 1;
        }
    }
    auto q = static_cast<std::uint64_t>(quotient);
    if (rest != 0) q |= 1; // sticky: at least two bits lie below the last one kept
    const double r = std::ldexp(static_cast<double>(q), exponent - shift);
    return negative && q ? -r : r;
}

double round_ratio(Int512 n, Int512 d, int shift) {
    if (n == 0) return 0;
    if (const auto quick = quick_ratio(leading(n), leading(d))) return std::ldexp(*quick, -shift);
    bool negative = false;
    if (n < 0) n = -n, negative = !negative;
    if (d < 0) d = -d, negative = !negative;
    const int up = 56 - (static_cast<int>(msb(n)) - static_cast<int>(msb(d)));
    if (up > 0) n <<= up;
    else d <<= -up;
    Int512 quotient, rest;
    divide_qr(n, d, quotient, rest);
    auto q = static_cast<std::uint64_t>(quotient); // 56 or 57 bits
    if (rest != 0) q |= 1;
    const double r = std::ldexp(static_cast<double>(q), -up - shift);
    return negative ? -r : r;
}

template <class T> int side_sign(const Homogeneous<T>& v, const Plane4<T>& q) {
    const T s = q.a * v.x + q.b * v.y + q.c * v.z - q.d * v.w;
    return sign_of(s) * sign_of(v.w);
}

} // namespace

int PlaneTable::side(PlaneId p0, PlaneId p1, PlaneId p2, PlaneId q) const {
    const std::uint32_t even = q.value & ~1u;
    if (even == (p0.value & ~1u) || even == (p1.value & ~1u) || even == (p2.value & ~1u)) return 0;
    const Approximate &p = approximate_[p0.at()], &r = approximate_[p1.at()], &s = approximate_[p2.at()],
                      &t = approximate_[q.at()];
    // |minor of two normals| <= 2 m m, and three such products a row: 6 in all for each distance.
    const double m01 = p.m * r.m, m2q = s.m * t.m;
    const double bound = 6 * (m2q * (std::fabs(p.d) * r.m + std::fabs(r.d) * p.m) +
                              m01 * (std::fabs(s.d) * t.m + std::fabs(t.d) * s.m));
    const double bound_w = 6 * m01 * s.m;
    const Homogeneous<double> v =
        meet(Plane4<double>{p.a, p.b, p.c, p.d}, {r.a, r.b, r.c, r.d}, {s.a, s.b, s.c, s.d});
    const double value = t.a * v.x + t.b * v.y + t.c * v.z - t.d * v.w;
    if ((bound < kExactInDouble && bound_w < kExactInDouble) ||
        (std::fabs(value) > kFilter * bound && std::fabs(v.w) > kFilter * bound_w)) {
        const int sign = value > 0 ? 1 : value < 0 ? -1 : 0;
        return v.w < 0 ? -sign : sign;
    }
    return side_exact(p0, p1, p2, q, std::max(bound, bound_w));
}

int PlaneTable::side_exact(PlaneId p0, PlaneId p1, PlaneId p2, PlaneId q, double bound) const {
    const ExactPlane &p = planes[p0.at()], &r = planes[p1.at()], &s = planes[p2.at()], &t = planes[q.at()];
    if (bound < kFits128) return side_sign(meet(in128(p), in128(r), in128(s)), in128(t));
    return side_sign(meet(in512(p), in512(r), in512(s)), in512(t));
}

int PlaneTable::side(const GridPoint& point, PlaneId q) const { // |.| < 2^92 + 2^93: fits
    const ExactPlane& t = planes[q.at()];
    const Int128 s = Int128(t.a) * point[0] + Int128(t.b) * point[1] + Int128(t.c) * point[2] - t.d;
    return sign_of(s);
}

int PlaneTable::orientation(PlaneId p0, PlaneId p1, PlaneId p2) const {
    const std::uint32_t e0 = p0.value >> 1, e1 = p1.value >> 1, e2 = p2.value >> 1;
    if (e0 == e1 || e1 == e2 || e0 == e2) return 0;
    const Approximate &p = approximate_[p0.at()], &r = approximate_[p1.at()], &s = approximate_[p2.at()];
    const double bound = 6 * p.m * r.m * s.m;
    const double w = p.a * (r.b * s.c - r.c * s.b) + p.b * (r.c * s.a - r.a * s.c) + p.c * (r.a * s.b - r.b * s.a);
    if (bound < kExactInDouble || std::fabs(w) > kFilter * bound) return w > 0 ? 1 : w < 0 ? -1 : 0;
    const auto determinant = [](const auto& u, const auto& v, const auto& x) {
        using T = std::decay_t<decltype(u.a)>;
        return sign_of(
            T(u.a * (v.b * x.c - v.c * x.b) + u.b * (v.c * x.a - v.a * x.c) + u.c * (v.a * x.b - v.b * x.a)));
    };
    const ExactPlane &a = planes[p0.at()], &b = planes[p1.at()], &c = planes[p2.at()];
    return bound < kFits128 ? determinant(in128(a), in128(b), in128(c))
                            : determinant(in512(a), in512(b), in512(c));
}

int PlaneTable::parallel(PlaneId p0, PlaneId q0) const {
    if (p0 == q0) return 1;
    if (p0 == flipped(q0)) return -1;
    const ExactPlane &p = planes[p0.at()], &q = planes[q0.at()]; // |normal| <= 2^61: products fit
    if (Int128(p.a) * q.b != Int128(p.b) * q.a || Int128(p.b) * q.c != Int128(p.c) * q.b ||
        Int128(p.a) * q.c != Int128(p.c) * q.a)
        return 0;
    if (p.a != 0) return (p.a > 0) == (q.a > 0) ? 1 : -1;
    if (p.b != 0) return (p.b > 0) == (q.b > 0) ? 1 : -1;
    return (p.c > 0) == (q.c > 0) ? 1 : -1;
}

Vec3 PlaneTable::point(PlaneId p0, PlaneId p1, PlaneId p2) const {
    const Approximate &p = approximate_[p0.at()], &r = approximate_[p1.at()], &s = approximate_[p2.at()];
    const double bound_w = 6 * p.m * r.m * s.m;
    const double bound_x =
        2 * (std::fabs(p.d) * r.m * s.m + std::fabs(r.d) * s.m * p.m + std::fabs(s.d) * p.m * r.m);
    const double bound = std::max(bound_w, bound_x);
    if (bound < kExactInDouble) { // exact numerators and denominator: the quotient is correctly rounded
        const Homogeneous<double> v =
            meet(Plane4<double>{p.a, p.b, p.c, p.d}, {r.a, r.b, r.c, r.d}, {s.a, s.b, s.c, s.d});
        KILN_CHECK(v.w != 0);
        const double scale = std::bit_cast<double>(static_cast<std::uint64_t>(1023 - grid_bits) << 52); // 2^-grid_bits
        return {v.x / v.w * scale + 0.0, v.y / v.w * scale + 0.0, v.z / v.w * scale + 0.0}; // + 0: no -0
    }
    const ExactPlane &a = planes[p0.at()], &b = planes[p1.at()], &c = planes[p2.at()];
    if (bound < kFits128) {
        const Homogeneous<Int128> v = meet(in128(a), in128(b), in128(c));
        KILN_CHECK(v.w != 0);
        return {round_ratio(v.x, v.w, grid_bits), round_ratio(v.y, v.w, grid_bits), round_ratio(v.z, v.w, grid_bits)};
    }
    const Homogeneous<Int512> v = meet(in512(a), in512(b), in512(c));
    KILN_CHECK(v.w != 0);
    return {round_ratio(v.x, v.w, grid_bits), round_ratio(v.y, v.w, grid_bits), round_ratio(v.z, v.w, grid_bits)};
}

std::array<std::string, 4> PlaneTable::exact_point(PlaneId p0, PlaneId p1, PlaneId p2) const {
    Homogeneous<Int512> v = meet(in512(planes[p0.at()]), in512(planes[p1.at()]), in512(planes[p2.at()]));
    KILN_CHECK(v.w != 0);
    v.w <<= grid_bits;
    if (v.w < 0) v = {-v.x, -v.y, -v.z, -v.w};
    const Int512 g = gcd(gcd(gcd(v.x, v.y), v.z), v.w);
    return {Int512(v.x / g).str(), Int512(v.y / g).str(), Int512(v.z / g).str(), Int512(v.w / g).str()};
}

} // namespace kiln

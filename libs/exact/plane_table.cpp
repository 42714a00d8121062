#include "libs/exact/plane.h"
#include "libs/core/check.h"
#include "libs/core/hash.h"
#include <cmath>

namespace kiln {
namespace {

using UInt128 = unsigned __int128;

UInt128 magnitude(__int128 v) { return v < 0 ? UInt128(0) - static_cast<UInt128>(v) : static_cast<UInt128>(v); }

int trailing_zeros(UInt128 v) {
    const auto low = static_cast<std::uint64_t>(v);
    return low ? __builtin_ctzll(low) : 64 + __builtin_ctzll(static_cast<std::uint64_t>(v >> 64));
}

UInt128 gcd(UInt128 u, UInt128 v) { // binary: 128-bit division is slow
    if (u == 0) return v;
    if (v == 0) return u;
    const int shift = trailing_zeros(u | v);
    u >>= trailing_zeros(u);
    while (v != 0) {
        v >>= trailing_zeros(v);
        if (u > v) std::swap(u, v);
        v -= u;
    }
    return u << shift;
}

constexpr __int128 kMaxNormal = __int128{1} << 61, kMaxDistance = __int128{1} << 93;

ExactPlane reduced(__int128 a, __int128 b, __int128 c, __int128 d) {
    UInt128 g = gcd(gcd(magnitude(a), magnitude(b)), magnitude(c));
    if (g != 1) g = gcd(g, magnitude(d));
    if (g != 1) {
        const auto divisor = static_cast<__int128>(g);
        a /= divisor, b /= divisor, c /= divisor, d /= divisor;
    }
    for (const __int128 n : {a, b, c}) KILN_CHECK(-kMaxNormal <= n && n <= kMaxNormal);
    KILN_CHECK(-kMaxDistance < d && d < kMaxDistance);
    return {d, static_cast<std::int64_t>(a), static_cast<std::int64_t>(b), static_cast<std::int64_t>(c), 0};
}

ExactPlane negated(const ExactPlane& p) { return {-p.d, -p.a, -p.b, -p.c, 0}; }

} // namespace

std::size_t PlaneTable::HashPlane::operator()(const ExactPlane& p) const {
    return mix(static_cast<std::uint64_t>(p.a), static_cast<std::uint64_t>(p.b), static_cast<std::uint64_t>(p.c),
               static_cast<std::uint64_t>(p.d), static_cast<std::uint64_t>(static_cast<UInt128>(p.d) >> 64));
}

void PlaneTable::append(const ExactPlane& p) {
    const Approximate q{static_cast<double>(p.a), static_cast<double>(p.b), static_cast<double>(p.c),
                        static_cast<double>(p.d),
                        std::max({std::fabs(static_cast<double>(p.a)), std::fabs(static_cast<double>(p.b)),
                                  std::fabs(static_cast<double>(p.c))})};
    approximate_.push_back(q);
}

void PlaneTable::reindex() {
    index_.clear();
    index_.reserve(planes.size());
    approximate_.clear();
    approximate_.reserve(planes.size());
    for (std::size_t i = 0; i < planes.size(); ++i) {
        index_.emplace(planes[i], static_cast<std::uint32_t>(i));
        append(planes[i]);
    }
}

std::optional<PlaneId> PlaneTable::find(const ExactPlane& plane) const {
    const auto it = index_.find(plane);
    if (it == index_.end()) return std::nullopt;
    return PlaneId{it->second};
}

PlaneId PlaneTable::add(const ExactPlane& plane) {
    KILN_CHECK(plane.a != 0 || plane.b != 0 || plane.c != 0);
    const ExactPlane p = reduced(plane.a, plane.b, plane.c, plane.d);
    const auto next = static_cast<std::uint32_t>(planes.size());
    const auto [it, fresh] = index_.try_emplace(p, next);
    if (fresh) {
        const ExactPlane n = negated(p);
        index_.emplace(n, next + 1);
        planes.push_back(p), planes.push_back(n);
        append(p), append(n);
    }
    return PlaneId{it->second};
}

std::optional<ExactPlane> plane_through(const GridPoint& p0, const GridPoint& p1, const GridPoint& p2) {
    for (const GridPoint& p : {p0, p1, p2})
        for (const std::int64_t x : p) KILN_CHECK(-kMaxGridCoordinate <= x && x <= kMaxGridCoordinate);
    __int128 u[3], v[3];
    for (std::size_t i = 0; i < 3; ++i) u[i] = p2[i] - p0[i], v[i] = p1[i] - p0[i];
    const __int128 a = u[1] * v[2] - u[2] * v[1], b = u[2] * v[0] - u[0] * v[2], c = u[0] * v[1] - u[1] * v[0];
    if (a == 0 && b == 0 && c == 0) return std::nullopt;
    return reduced(a, b, c, a * p0[0] + b * p0[1] + c * p0[2]);
}

std::optional<PlaneId> PlaneTable::add(const GridPoint& p0, const GridPoint& p1, const GridPoint& p2) {
    const std::optional<ExactPlane> plane = plane_through(p0, p1, p2);
    if (!plane) return std::nullopt;
    return add(*plane);
}

Vec3 PlaneTable::normal(PlaneId p) const {
    const Approximate& q = approximate_[p.at()];
    const Vec3 n{q.a / q.m, q.b / q.m, q.c / q.m}; // scaled first: no overflow, and axial normals are exact
    return n / length(n);
}

double PlaneTable::distance(PlaneId p) const {
    const Approximate& q = approximate_[p.at()];
    const Vec3 n{q.a / q.m, q.b / q.m, q.c / q.m};
    return std::ldexp(q.d / q.m / length(n), -grid_bits) + 0.0;
}

} // namespace kiln

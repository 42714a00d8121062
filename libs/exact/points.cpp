#include "libs/exact/points.h"
#include "libs/exact/wide.h"

namespace kiln {
using namespace exact_detail;
namespace {

// Coordinates of a meeting point take up to 219 bits, the common denominator 186 (plane.h has the range), the determinant
// of three points 219 + 219 + 186 and the sum of six.
using Int1024 = boost::multiprecision::number<boost::multiprecision::cpp_int_backend<
    1024, 1024, boost::multiprecision::signed_magnitude, boost::multiprecision::unchecked, void>>;

struct WidePoint {
    Int1024 x[3], w;
};
Plane4<Int1024> wide_plane(const ExactPlane& p) {
    Int1024 d = static_cast<std::int64_t>(p.d >> 64); // rounds down, so the rest is positive
    d <<= 64;
    d += static_cast<std::uint64_t>(p.d);
    return {Int1024(p.a), Int1024(p.b), Int1024(p.c), d};
}
WidePoint wide_point(const PlaneTable& table, const PlaneTriple& t) {
    const Homogeneous<Int1024> h = meet(wide_plane(table.planes[t[0].at()]), wide_plane(table.planes[t[1].at()]), wide_plane(table.planes[t[2].at()]));
    return {{h.x, h.y, h.z}, h.w};
}

} // namespace

int compare_along(const PlaneTable& table, const PlaneTriple& a, const PlaneTriple& b, std::size_t axis) {
    const WidePoint p = wide_point(table, a), q = wide_point(table, b);
    return sign_of(Int1024(p.x[axis] * q.w - q.x[axis] * p.w)) * sign_of(p.w) * sign_of(q.w);
}

int turn(const PlaneTable& table, const PlaneTriple& a, const PlaneTriple& b, const PlaneTriple& c, std::size_t u, std::size_t v) {
    const WidePoint p = wide_point(table, a), q = wide_point(table, b), r = wide_point(table, c);
    const Int1024 determinant = p.w * (q.x[u] * r.x[v] - q.x[v] * r.x[u]) + q.w * (r.x[u] * p.x[v] - r.x[v] * p.x[u]) +
                                r.w * (p.x[u] * q.x[v] - p.x[v] * q.x[u]);
    return sign_of(determinant) * sign_of(p.w) * sign_of(q.w) * sign_of(r.w);
}

} // namespace kiln

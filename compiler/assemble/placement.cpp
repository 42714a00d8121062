#include "compiler/assemble/placement.h"
#include <cmath>
#include <numbers>

namespace kiln::assemble_detail {
namespace {

// Editors keep angles as floats, whose step at 360 is 3e-5: what is that close to a quarter turn was meant as one.
constexpr double kQuarterSlack_deg = 1e-4;

struct SinCos {
    double sin, cos;
};
SinCos sin_cos(double degrees) {
    constexpr double kTable[4] = {0, 1, 0, -1};
    const double quarters = std::fmod(degrees, 360.0) / 90;
    const double nearest = std::round(quarters);
    if (std::fabs(quarters - nearest) * 90 <= kQuarterSlack_deg) {
        const std::size_t q = static_cast<std::size_t>(static_cast<int>(nearest) & 3);
        return {kTable[q], kTable[(q + 1) & 3]};
    }
    const double radians = degrees * std::numbers::pi / 180;
    return {std::sin(radians), std::cos(radians)};
}

} // namespace

Vec3 operator*(const Matrix& m, Vec3 v) { return {dot(m[0], v), dot(m[1], v), dot(m[2], v)}; }

Matrix transposed(const Matrix& m) {
    Matrix t;
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k) t[i][k] = m[k][i];
    return t;
}

Matrix product(const Matrix& a, const Matrix& b) {
    const Matrix columns = transposed(b);
    Matrix c;
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k) c[i][k] = dot(a[i], columns[k]);
    return c;
}

Matrix matrix_of_angles(Vec3 angles) {
    const SinCos p = sin_cos(angles.x), y = sin_cos(angles.y), r = sin_cos(angles.z);
    const Matrix yaw{Vec3{y.cos, -y.sin, 0}, {y.sin, y.cos, 0}, {0, 0, 1}};
    const Matrix pitch{Vec3{p.cos, 0, p.sin}, {0, 1, 0}, {-p.sin, 0, p.cos}};
    const Matrix roll{Vec3{1, 0, 0}, {0, r.cos, -r.sin}, {0, r.sin, r.cos}};
    return product(product(yaw, pitch), roll);
}

Vec3 angles_of_matrix(const Matrix& m) {
    const Vec3 forward{m[0].x, m[1].x, m[2].x}, left{m[0].y, m[1].y, m[2].y};
    const double flat = std::hypot(forward.x, forward.y);
    constexpr double kVertical = 1e-6; // below, yaw and roll turn about one axis: all of it goes into yaw
    constexpr double kDegrees = 180 / std::numbers::pi;
    const double pitch = std::atan2(-forward.z, flat) * kDegrees;
    if (flat < kVertical) return {pitch, std::atan2(-left.x, left.y) * kDegrees, 0};
    return {pitch, std::atan2(forward.y, forward.x) * kDegrees, std::atan2(left.z, m[2].z) * kDegrees};
}

bool Placement::quarter_turns() const {
    for (const Vec3& row : rotation)
        for (std::size_t k = 0; k < 3; ++k)
            if (row[k] != 0 && row[k] != 1 && row[k] != -1) return false;
    return true;
}

bool Placement::turned() const {
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k)
            if (rotation[i][k] != (i == k ? 1 : 0)) return true;
    return false;
}

DecimalPoint Placement::point(const DecimalPoint& p) const {
    DecimalPoint out;
    if (!quarter_turns()) {
        const Vec3 q = point(to_vec(p));
        for (std::size_t i = 0; i < 3; ++i) out[i] = rounded_decimal(q[i]);
        return out;
    }
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k) {
            if (rotation[i][k] == 0) continue;
            const bool unscaled = scale[k].mantissa == 1 && scale[k].exponent == 0;
            const Decimal x = unscaled ? p[k] : assemble_detail::product(p[k], scale[k]);
            out[i] = sum(rotation[i][k] < 0 ? negated(x) : x, origin[i]);
        }
    return out;
}

Vec3 Placement::point(Vec3 p) const { return offset(p) + to_vec(origin); }
Vec3 Placement::offset(Vec3 v) const { return rotation * (v * to_vec(scale)); }
Vec3 Placement::direction(Vec3 v) const { return rotation * v; }

void place(DocSide& side, const Placement& placement) {
    for (auto& p : side.points) p = placement.point(p);
    // dot(p, axis) / scale + shift stays what it was at every point that moves along: the texture is locked.
    const Vec3 origin = to_vec(placement.origin), s = to_vec(placement.scale);
    const auto lock = [&](Vec3& axis, double& shift, double scale) {
        axis = placement.direction({axis.x / s.x, axis.y / s.y, axis.z / s.z});
        shift -= dot(origin, axis) / scale;
    };
    lock(side.texture.u_axis, side.texture.u_shift, side.texture.u_scale);
    lock(side.texture.v_axis, side.texture.v_shift, side.texture.v_scale);
    for (Vec3& v : side.vertices) v = placement.point(v);
}

void place(DocDisplacement& d, const Placement& placement) {
    d.start = placement.point(d.start);
    // A vertex moves along its normal by its distance; where the placement scales, both change.
    for (std::size_t i = 0; i < d.normals.size(); ++i) {
        const Vec3 n = placement.offset(d.normals[i]);
        const double before = length(d.normals[i]), after = length(n);
        if (after == 0) continue;
        d.normals[i] = n * (before / after);
        if (i < d.distances.size()) d.distances[i] *= after / before;
    }
    for (Vec3& v : d.offsets) v = placement.offset(v);
    for (Vec3& v : d.offset_normals) v = placement.direction(v);
    const Vec3 s = to_vec(placement.scale);
    d.elevation *= std::cbrt(s.x * s.y * s.z); // the same for all axes, or there is no one factor
}

void place(DocPatch& patch, const Placement& placement) {
    for (Vec3& p : patch.points) p = placement.point(p);
}

} // namespace kiln::assemble_detail

#include "formats/quake_map/projection.h"
#include <cmath>
#include <numbers>

namespace kiln::quake {
namespace {

// Texels or repeats a unit beyond which, and beyond whose inverse, no texture is meant; sizes of materials are yet to be
// multiplied in.
constexpr double kMost = 1e25;

Vec3 rounded(const std::array<Decimal, 3>& p) {
    return {p[0].to_double(), p[1].to_double(), p[2].to_double()};
}

// The one Decimal of a value, as parse_decimal gives it.
Decimal reduced(std::int64_t mantissa, std::int32_t exponent) {
    if (mantissa == 0) return {};
    while (mantissa % 10 == 0) mantissa /= 10, ++exponent;
    return {mantissa, exponent, true};
}

// The linear map as a unit axis, and map units a texel (or a repeat).
void set_axis(Vec3& axis, double& scale, Vec3 texels_per_unit) {
    const double size = length(texels_per_unit);
    axis = texels_per_unit / size;
    scale = 1 / size;
}

// Radiant turns the x axis to the normal, first about y, then about z; u is where the y axis comes to lie, v the z axis
// reversed. Normals within 1e-6 of axial count as axial, for texture alone.
void axis_base(Vec3 normal, Vec3& u, Vec3& v) {
    constexpr double kAxial = 1e-6;
    for (std::size_t i = 0; i < 3; ++i)
        if (std::abs(normal[i]) < kAxial) normal[i] = 0;
    const double flat = std::hypot(normal.x, normal.y);
    const double turn_cos = flat > 0 ? normal.x / flat : 1, turn_sin = flat > 0 ? normal.y / flat : 0;
    const double size = std::hypot(flat, normal.z);
    const double tilt_cos = flat / size, tilt_sin = -normal.z / size;
    u = {-turn_sin, turn_cos, 0};
    v = {-tilt_sin * turn_cos, -tilt_sin * turn_sin, -tilt_cos};
}

} // namespace

Vec3 normal_of(const PlanePoints& points) {
    const Vec3 p0 = rounded(points[0]);
    return cross(rounded(points[2]) - p0, rounded(points[1]) - p0);
}

void project_standard(DocTexture& texture, Vec3 normal, double rotation_deg) {
    // Nearest axis by the largest component; at equal ones z goes before x before y, as in the table of the
    // original. The normal comes unnormalised from exact points, so that 45 degrees are a tie exactly; the
    // tolerance is for points that an editor has rounded.
    constexpr double kTie = 1 + 1e-9;
    const double x = std::abs(normal.x), y = std::abs(normal.y), z = std::abs(normal.z);
    const int axis = z * kTie >= x && z * kTie >= y ? 2 : x * kTie >= y ? 0 : 1;
    const std::size_t u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2; // the two axes the texture lies along
    double s = 0, c = 1;
    if (rotation_deg != 0) {
        const double turn = std::fmod(rotation_deg, 360.0);
        const double quarters = turn / 90;
        if (quarters == std::floor(quarters)) { // quarter turns stay axis-parallel to the last bit
            constexpr std::array<double, 4> kSin = {0, 1, 0, -1};
            const std::size_t q = static_cast<std::size_t>(static_cast<int>(quarters) & 3);
            s = kSin[q], c = kSin[(q + 1) & 3];
        } else {
            s = std::sin(turn * std::numbers::pi / 180), c = std::cos(turn * std::numbers::pi / 180);
        }
    }
    // Unrotated: u along +u, v along -v. Both turn by the same angle.
    texture.u_axis = texture.v_axis = {};
    texture.u_axis[u] = c, texture.u_axis[v] = s;
    texture.v_axis[u] = s, texture.v_axis[v] = -c;
}

void project_quark(DocTexture& texture, const PlanePoints& points, bool up_first) {
    constexpr double kTexels = 128;
    const Vec3 origin = rounded(points[0]);
    const Vec3 along = rounded(points[up_first ? 2 : 1]) - origin, up = rounded(points[up_first ? 1 : 2]) - origin;
    // The texel coordinates are linear in the plane: u grows by 128 along `along` and not along `up`; v falls by 128 along `up`.
    const double aa = dot(along, along), au = dot(along, up), uu = dot(up, up);
    const double det = aa * uu - au * au;
    if (!(det > 0) || !std::isfinite(det)) return;
    const Vec3 u = (along * uu - up * au) * (kTexels / det), v = (along * au - up * aa) * (kTexels / det);
    if (!(length(u) > 1 / kMost) || !(length(v) > 1 / kMost)) return;
    set_axis(texture.u_axis, texture.u_scale, u);
    set_axis(texture.v_axis, texture.v_scale, v);
    texture.u_shift = -dot(origin, u), texture.v_shift = -dot(origin, v);
}

bool project_primitive(DocTexture& texture, Vec3 normal, const TextureMatrix& m) {
    Vec3 base_u, base_v;
    axis_base(length(normal) > 0 ? normalize(normal) : Vec3{0, 0, 1}, base_u, base_v);
    const double det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    const Vec3 u = base_u * m[0][0] + base_v * m[0][1], v = base_u * m[1][0] + base_v * m[1][1];
    texture.in_repeats = true;
    const auto usable = [](double x) { return x > 1 / kMost && x < kMost; };
    if (det == 0 || !usable(length(u)) || !usable(length(v)) || std::abs(m[0][2]) > kMost || std::abs(m[1][2]) > kMost) {
        texture.u_axis = base_u, texture.v_axis = base_v;
        texture.u_scale = texture.v_scale = 64;
        return false;
    }
    set_axis(texture.u_axis, texture.u_scale, u);
    set_axis(texture.v_axis, texture.v_scale, v);
    texture.u_shift = m[0][2], texture.v_shift = m[1][2];
    return true;
}

std::optional<PlanePoints> points_of_plane(const std::array<Decimal, 4>& plane, Vec3 shift) {
    // In long double (64 bits of mantissa): coordinates up to 131072 come out right to the twelfth decimal, and what
    // the text states with up to twelve comes out as it is.
    using Real = long double;
    constexpr Real kDecimals = 1e12L;
    constexpr Real kApart = 4096;
    const auto real = [](const Decimal& x) {
        if (x.exponent < -27 || x.exponent > 0) return static_cast<Real>(x.to_double());
        Real power = 1; // exact: 10^27 < 2^90 has but 63 odd bits
        for (int i = 0; i < -x.exponent; ++i) power *= 10;
        return static_cast<Real>(x.mantissa) / power;
    };
    std::array<Real, 4> e{};
    for (std::size_t i = 0; i < 4; ++i) {
        e[i] = real(plane[i]);
        if (!std::isfinite(e[i])) return std::nullopt;
    }
    const std::size_t k = std::abs(e[2]) >= std::abs(e[0]) && std::abs(e[2]) >= std::abs(e[1]) ? 2 : std::abs(e[0]) >= std::abs(e[1]) ? 0 : 1;
    const std::size_t i = (k + 1) % 3, j = (k + 2) % 3;
    // Divided by the largest component: slopes of at most one, and an axial plane has its coordinate.
    const Real a = e[i] / e[k], b = e[j] / e[k];
    const Real d = e[3] / e[k] - a * static_cast<Real>(shift[i]) - b * static_cast<Real>(shift[j]) - static_cast<Real>(shift[k]);
    if (!std::isfinite(a) || !std::isfinite(b) || !std::isfinite(d) || std::abs(d) > 4 * static_cast<Real>(kLargestCoordinate)) return std::nullopt;
    // The first point is that nearest to the origin, to whole units in i and j; the others lie towards the axes.
    const Real nearest = -d / (1 + a * a + b * b);
    const Real x0 = std::round(nearest * a), y0 = std::round(nearest * b);
    const Real x1 = x0 > 0 ? x0 - kApart : x0 + kApart, y1 = y0 > 0 ? y0 - kApart : y0 + kApart;
    PlanePoints points{};
    const std::array<std::array<Real, 2>, 3> at = {{{x0, y0}, {x1, y0}, {x0, y1}}};
    for (std::size_t p = 0; p < 3; ++p) {
        const Real z = -(d + a * at[p][0] + b * at[p][1]);
        for (const Real x : {at[p][0], at[p][1], z})
            if (std::abs(x) > static_cast<Real>(kLargestCoordinate)) return std::nullopt;
        points[p][i] = reduced(std::llround(at[p][0]), 0);
        points[p][j] = reduced(std::llround(at[p][1]), 0);
        points[p][k] = reduced(std::llround(z * kDecimals), -12);
    }
    const Vec3 outward{static_cast<double>(e[0] / std::abs(e[k])), static_cast<double>(e[1] / std::abs(e[k])), static_cast<double>(e[2] / std::abs(e[k]))};
    if (dot(normal_of(points), outward) < 0) std::swap(points[1], points[2]);
    return points;
}

} // namespace kiln::quake

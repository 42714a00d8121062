#include "compiler/csg/input_planes.h"
#include "compiler/csg/polytope.h"
#include "libs/parallel/parallel.h"
#include <cmath>
#include <span>

namespace kiln::csg_detail {
namespace {

// Plane points further out than this are a fault of the map: far beyond the editors' limits (2^14 to 2^17 map
// units), yet within what the integers of PlaneTable take on the finest grid.
constexpr double kMaxCoordinate = kWorldHalfSize / 2;
// sin of the angle at which three points off the grid count as collinear: their text has 6 digits at best.
constexpr double kCollinear = 1e-9;

Vec3 to_point(const std::array<Decimal, 3>& p) { return {p[0].to_double(), p[1].to_double(), p[2].to_double()}; }

bool in_range(const GridPoint& g) {
    for (const std::int64_t x : g)
        if (x < -kMaxGridCoordinate || x > kMaxGridCoordinate) return false;
    return true;
}

} // namespace

GridPoint snap(Vec3 p, int bits) {
    GridPoint g;
    for (std::size_t k = 0; k < 3; ++k) g[k] = std::llround(std::ldexp(p[k], bits));
    return g;
}

__int128 height_over(const ExactPlane& plane, const GridPoint& p) {
    return static_cast<__int128>(plane.a) * p[0] + static_cast<__int128>(plane.b) * p[1] + static_cast<__int128>(plane.c) * p[2] - plane.d;
}

std::optional<ExactPlane> plane_facing(std::array<Vec3, 3> points, Vec3 normal, int bits) {
    if (dot(cross(points[2] - points[0], points[1] - points[0]), normal) < 0) std::swap(points[1], points[2]);
    const GridPoint p = snap(points[0], bits), q = snap(points[1], bits), r = snap(points[2], bits);
    if (!in_range(p) || !in_range(q) || !in_range(r)) return std::nullopt;
    return plane_through(p, q, r);
}

std::array<std::size_t, 3> far_apart(std::span<const Vec3> face) {
    std::size_t a = 0, b = 0, c = 0;
    double best = -1;
    for (std::size_t i = 0; i < face.size(); ++i)
        for (std::size_t j = i + 1; j < face.size(); ++j)
            if (const Vec3 e = face[j] - face[i]; dot(e, e) > best) best = dot(e, e), a = i, b = j;
    best = -1;
    for (std::size_t i = 0; i < face.size(); ++i)
        if (const Vec3 x = cross(face[b] - face[a], face[i] - face[a]); dot(x, x) > best) best = dot(x, x), c = i;
    return {a, b, c};
}

namespace {

// Largest distance of the points from the plane, map units; grid units inside.
double distance_over(const ExactPlane& plane, std::span<const Vec3> face, int bits) {
    // About a point of the face itself: the plane's distance from the origin is too coarse a number in doubles.
    const Vec3 n{static_cast<double>(plane.a), static_cast<double>(plane.b), static_cast<double>(plane.c)};
    const GridPoint o = snap(face[0], bits);
    const __int128 at_o = height_over(plane, o);
    const double l = length(n);
    double largest = 0;
    for (const Vec3& p : face) {
        Vec3 r;
        for (std::size_t k = 0; k < 3; ++k) r[k] = std::ldexp(p[k], bits) - static_cast<double>(o[k]);
        largest = std::max(largest, std::fabs((dot(n, r) + static_cast<double>(at_o)) / l));
    }
    return std::ldexp(largest, -bits);
}

// The plane through three far apart corners of a face, each put on the grid.
std::optional<ExactPlane> through_corners(std::span<const Vec3> face, Vec3 normal, int bits) {
    const auto [a, b, c] = far_apart(face);
    return plane_facing({face[a], face[b], face[c]}, normal, bits);
}

// A plane through three grid points far outside the face, each the best of a few dozen near the true plane: as true to
// it as doubles are, and true far beyond the face, so that faces of one plane stay within the merge distance of each
// other across a whole building.
std::optional<ExactPlane> through_far_points(std::span<const Vec3> face, Vec3 normal, int bits) {
    constexpr double kReach = 4096; // map units
    constexpr int kTries = 7;       // per direction: of 49 roundings the best is some 1/50 grid step off
    const Frame f = frame_around(normal);
    Vec3 center{};
    for (const Vec3& p : face) center += p;
    center = center / static_cast<double>(face.size());
    const double step = std::ldexp(1.0, -bits);
    std::array<GridPoint, 3> corner{};
    constexpr double kHeight = 0.86602540378443865; // of an equilateral triangle
    const Vec2 direction[3] = {{1, 0}, {-0.5, -kHeight}, {-0.5, kHeight}}; // clockwise seen from outside
    for (std::size_t c = 0; c < 3; ++c) {
        double best = 1e30;
        for (int i = 0; i < kTries; ++i)
            for (int j = 0; j < kTries; ++j) {
                const Vec3 p = center + f.t * (kReach * direction[c].x + i * step) + f.b * (kReach * direction[c].y + j * step);
                const GridPoint g = snap(p, bits);
                Vec3 off;
                for (std::size_t k = 0; k < 3; ++k) off[k] = static_cast<double>(g[k]) * step - p[k];
                const double distance = std::fabs(dot(off, normal));
                if (distance < best) best = distance, corner[c] = g;
            }
        if (!in_range(corner[c])) return std::nullopt;
    }
    return plane_through(corner[0], corner[1], corner[2]);
}

// The axial plane nearest to a face, where the normal points along an axis but for rounding.
std::optional<ExactPlane> axial(std::span<const Vec3> face, Vec3 normal, int bits) {
    for (std::size_t k = 0; k < 3; ++k) {
        if (std::fabs(normal[k]) < 0.999) continue;
        double lo = face[0][k], hi = lo;
        for (const Vec3& p : face) lo = std::min(lo, p[k]), hi = std::max(hi, p[k]);
        const std::int64_t s = normal[k] > 0 ? 1 : -1;
        ExactPlane plane;
        (k == 0 ? plane.a : k == 1 ? plane.b : plane.c) = s;
        plane.d = s * std::llround(std::ldexp((lo + hi) / 2, bits));
        return plane;
    }
    return std::nullopt;
}

// A brush with points off the grid. Rounding three close-together points would tilt a long face by far more than
// the grid, so the planes are chosen by how far they move over the brush's own faces.
void read_off_grid(const World& world, const WorldBrush& brush, int bits, std::span<InputSide> sides) {
    const Vec3 origin = to_point(world.sides[brush.first_side].points[0]); // near the brush: keeps doubles precise
    std::vector<PlaneD> planes(brush.side_count);
    for (std::size_t i = 0; i < planes.size(); ++i) {
        const auto& points = world.sides[brush.first_side + i].points;
        const Vec3 p = to_point(points[0]), u = to_point(points[2]) - p, v = to_point(points[1]) - p;
        const Vec3 n = cross(u, v);
        if (length(n) <= kCollinear * length(u) * length(v)) {
            sides[i].collinear = true;
            return;
        }
        planes[i] = {normalize(n), dot(normalize(n), p - origin)};
    }
    std::vector<std::vector<Vec3>> faces = approximate_faces(planes);
    std::size_t with_face = 0;
    for (auto& face : faces) {
        bool far = false;
        for (Vec3& p : face) {
            p += origin;
            for (std::size_t k = 0; k < 3; ++k) far = far || std::fabs(p[k]) > kMaxCoordinate;
        }
        if (far) face.clear(); // unbounded, most likely; the exact polytope will tell
        with_face += !face.empty();
    }
    const double step = std::ldexp(1.0, -bits);
    for (std::size_t i = 0; i < planes.size(); ++i) {
        InputSide& side = sides[i];
        if (!side.rounded) continue;
        const auto& points = world.sides[brush.first_side + i].points;
        const std::optional<ExactPlane> naive = plane_through(snap(to_point(points[0]), bits),
                                                              snap(to_point(points[1]), bits), snap(to_point(points[2]), bits));
        const auto& face = faces[i];
        if (face.empty()) {
            // No part in the boundary before rounding, so none after it. But if the brush is not closed, leave it to
            // the exact polytope to say so.
            if (with_face >= 4) side.redundant = true, side.plane.reset();
            else side.plane = naive, side.collinear = !naive;
            continue;
        }
        side.plane.reset();
        side.rounding = 1e30;
        const auto consider = [&](const auto& make) {
            if (side.rounding <= step) return; // in this order; the first good one
            const std::optional<ExactPlane> plane = make(face, planes[i].normal, bits);
            if (!plane) return;
            const double moved = distance_over(*plane, face, bits);
            const Vec3 n{static_cast<double>(plane->a), static_cast<double>(plane->b), static_cast<double>(plane->c)};
            if (moved < side.rounding && dot(n, planes[i].normal) > 0) side.rounding = moved, side.plane = plane;
        };
        // Corners on the grid stay the corners of the neighbours too, however many faces meet there.
        consider(axial);
        consider(through_corners);
        consider(through_far_points);
        consider([&](auto&&...) { return naive; });
        if (!side.plane) side.collinear = true;
    }
}

} // namespace

int choose_grid_bits(const World& world, int finest) {
    int bits = 0;
    for (const WorldSide& side : world.sides)
        for (const auto& point : side.points)
            for (const Decimal& x : point)
                while (!x.on_grid(bits))
                    if (++bits >= finest) return finest;
    return bits;
}

std::vector<InputSide> read_planes(const World& world, int bits, Context& context) {
    std::vector<InputSide> result(world.sides.size());
    parallel_for(context, world.brushes.size(), [&](std::size_t b) {
        const WorldBrush& brush = world.brushes[b];
        const std::span<InputSide> sides(result.data() + brush.first_side, brush.side_count);
        bool off_grid = false, bad = false;
        for (std::size_t i = 0; i < sides.size(); ++i) {
            InputSide& side = sides[i];
            std::array<GridPoint, 3> grid{};
            side.integral = true;
            for (std::size_t p = 0; p < 3; ++p)
                for (std::size_t k = 0; k < 3; ++k) {
                    const Decimal& x = world.sides[brush.first_side + i].points[p][k];
                    const auto g = x.to_grid(bits);
                    if (!g || !(std::fabs(x.to_double()) <= kMaxCoordinate) || *g < -kMaxGridCoordinate ||
                        *g > kMaxGridCoordinate) {
                        side.out_of_range = true;
                        continue;
                    }
                    grid[p][k] = *g;
                    side.rounded = side.rounded || !x.on_grid(bits);
                    side.integral = side.integral && (*g & ((std::int64_t{1} << bits) - 1)) == 0;
                }
            side.integral = side.integral && !side.rounded && !side.out_of_range;
            bad = bad || side.out_of_range;
            off_grid = off_grid || side.rounded;
            if (side.out_of_range || side.rounded) continue;
            side.plane = plane_through(grid[0], grid[1], grid[2]);
            side.collinear = !side.plane;
            bad = bad || side.collinear;
        }
        if (off_grid && !bad) read_off_grid(world, brush, bits, sides);
    });
    return result;
}

} // namespace kiln::csg_detail

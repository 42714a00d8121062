// Ambient cubes: six irradiances at places in the air, on an adaptive lattice offset from walls, interpolated only
// where visible.
//
// In       bsp, surfaces, lights, light field
// Out      cubes c[axis]: +x -x +y -y +z -z, irradiance units; run time E(n) ~ sum n_a^2 c[a, n_a < 0];
//          kernel K(c) = (3 + 20 c + 15 c^2) / 32 over the sphere. The strongest entity lights that a cube sees stay
//          out of it and are listed with it.
// Errors   none; a world without air gives no cubes
//
// Run time, at a point p:
//   1. root cell floor((p - origin) / root_size), then down `tree` by halves to a cell (INT32_MIN: no answer);
//   2. while cell.beyond names a cell: where dot(plane_normal, p) > plane_distance go to that cell, else, where
//      cell.behind names one, to that; where it names none this is the cell. The planes lie inside walls that cross the
//      cell: each side has corners of its own;
//   3. f = (p - cell.lo) / cell.size, clamped per axis to [1/1024, 1023/1024] so that some weight is always left;
//      weight of corner i = product of f or 1 - f if bit i of the mask is set, else 0; divided by their sum;
//   4. cube = sum of weight * irradiance; a local light counts with the sum of the weights of the corners that list
//      it, and is evaluated at p itself. Any light is so either in the cube or beside it, never both.
#pragma once
#include "compiler/light/field.h"

namespace kiln {

struct AmbientOptions {
    double error_percent = 10;     // of the interpolated cube
    double coarsest = 256, finest = 64; // map units, cell size; coarser only where there would be > 32768 root cells
    std::uint32_t local_lights = 2;   // strongest direct lights of a place that stay out of the cube
    std::uint64_t seed = 1;
    std::uint32_t rays = 128;      // of a cube, power of two; up to 8 times as many where two halves disagree
    // Of the lattice against the map's origin, in finest cells. A quarter keeps corners off walls; the sixteenth more
    // keeps them off those drawn on a grid of a quarter cell (16 units).
    double lattice_offset = 5.0 / 16;
    template <class A> void fields(A& a) {
        a(error_percent, coarsest, finest, local_lights, seed, rays, lattice_offset);
    }
};
struct AmbientCube {
    Vec3 position;
    std::array<Rgb, 6> irradiance{};
    std::vector<std::uint32_t> local_lights; // indices into the light list, strongest first
    float invalid_share = 0;                 // back-face share of its rays
    template <class A> void fields(A& a) { a(position, irradiance, local_lights, invalid_share); }
};
struct AmbientCell {                 // cubic, side = root size / 2^level
    Vec3 lo;
    float size = 0;
    std::array<std::uint32_t, 8> cubes{}; // corner x + 2y + 4z; UINT32_MAX: none there
    std::uint8_t mask = 0;           // corners that its air may use; never 0
    Vec3 plane_normal{};             // unit; with plane_distance (map units) valid where `beyond` is
    double plane_distance = 0;
    std::uint32_t beyond = UINT32_MAX; // cell for dot(plane_normal, p) > plane_distance; UINT32_MAX: this one is all
    // With `beyond`: cell for all else; UINT32_MAX: this one. Where it names one, the corners here are those of some part
    // behind the plane, for who does not know of it.
    std::uint32_t behind = UINT32_MAX;
    template <class A> void fields(A& a) { a(lo, size, cubes, mask, plane_normal, plane_distance, beyond, behind); }
};
class Memo; // of an earlier lattice in the same geometry (light/memo.h): taken over where it holds, and replaced by this one's

struct Ambient {
    Vec3 origin;                     // of the root lattice (offset applied)
    float root_size = 0;
    std::array<std::uint32_t, 3> root_count{};
    std::vector<std::int32_t> tree;  // root cells first, x fastest; >= 0: first of 8 children (x + 2y + 4z);
                                     // < 0: -(cell + 1); INT32_MIN: no air
    std::vector<AmbientCell> cells;  // each `beyond` and `behind` after the cell that names it
    std::vector<AmbientCube> cubes;
    double error_estimate = 0;       // percent, interpolated against evaluated at random points in the air
    std::uint64_t rays = 0;
    template <class A> void fields(A& a) { a(origin, root_size, root_count, tree, cells, cubes, error_estimate, rays); }
};
Result<Ambient> place_ambient(const Bsp& bsp, const PlaneTable& planes, const Surfaces& surfaces,
                              const std::vector<Light>& lights, const LightField& field, const AmbientOptions& options,
                              Context& context, Memo* memo = nullptr);
void validate(const Ambient& ambient);
// What a run time shows at a point: mask times trilinear; nothing where there is no cell.
std::optional<std::array<Rgb, 6>> ambient_at(const Ambient& ambient, Vec3 point);
// The lights that stay out of it there and their weights (0..1], sorted by light.
std::vector<std::pair<std::uint32_t, double>> ambient_lights_at(const Ambient& ambient, Vec3 point);
constexpr double cube_kernel(double c) { return (3 + 20 * c + 15 * c * c) / 32; }

} // namespace kiln

// Private: from decimal plane points to integer planes.
#pragma once
#include "compiler/csg/csg.h"
#include <array>
#include <span>
#include <vector>

namespace kiln::csg_detail {

// The coarsest grid 2^-k, k <= finest, on which all plane points lie; `finest` if there is none.
int choose_grid_bits(const World& world, int finest);

struct InputSide {
    std::optional<ExactPlane> plane; // nothing: collinear, out of range, or redundant
    bool collinear = false, out_of_range = false;
    bool redundant = false;          // of a brush off the grid: contributes nothing in doubles
    bool integral = false;           // all points in whole map units
    bool rounded = false;            // some point is off the grid
    double rounding = 0;             // map units, largest over the face
};
// Parallel to world.sides.
std::vector<InputSide> read_planes(const World& world, int grid_bits, Context& context);

GridPoint snap(Vec3 point, int bits);
// dot(normal, p) - d of the plane: 0 on it.
__int128 height_over(const ExactPlane& plane, const GridPoint& p);
// The plane through three points put on the grid that faces as `normal` does. Nothing: collinear, or out of range.
std::optional<ExactPlane> plane_facing(std::array<Vec3, 3> points, Vec3 normal, int bits);
// The two corners of a face furthest from each other, and the one furthest from their line.
std::array<std::size_t, 3> far_apart(std::span<const Vec3> face);

} // namespace kiln::csg_detail

// Private: convex polytopes from planes, exactly; and, for input off the grid, in doubles.
#pragma once
#include "compiler/csg/csg.h"
#include <span>

namespace kiln::csg_detail {

struct SidePlane {
    PlaneId plane;
    SideId side;
};
enum class Flaw : std::uint8_t { none, unbounded, empty };

// Faces of the intersection of the half-spaces behind `sides`, whose planes differ from each other. A side that
// has no part in the boundary has no face.
struct PolytopeResult {
    Flaw flaw = Flaw::none;
    BrushPolytope polytope;
};
PolytopeResult build_polytope(const PlaneTable& planes, const std::array<PlaneId, 6>& cube,
                              std::span<const SidePlane> sides);

Box3 box_of(const PlaneTable& planes, const PlanePolygon& polygon);

// dot(normal, x) <= distance, |normal| = 1; clips in doubles. Face i belongs to plane i; empty where it has none.
struct PlaneD {
    Vec3 normal;
    double distance = 0;
};
std::vector<std::vector<Vec3>> approximate_faces(std::span<const PlaneD> planes);

} // namespace kiln::csg_detail

// CSG: brushes made exact, and the parts of their sides that border something else than their own kind.
//
// In       world
// Out      planes, one convex polytope per brush, fragments of sides with coverage removed
// Errors   unbounded, empty (zero-thickness) or plane-collinear brushes: one located error diagnostic each,
//          the brush is left out whole (valid = false); fault `nothing-to-compile` if no brush is left
// Source   canonicalisation and its measured reasons: NOTES.md; polygons by planes: G. Bernstein & D. Fussell,
//          "Fast, exact, linear Booleans", SGP 2009
#pragma once
#include "compiler/world/world.h"
#include "libs/exact/plane.h"
#include "libs/math/vec.h"

namespace kiln {

struct CsgOptions {
    double plane_merge_distance = 1.0 / 32; // map units: planes that close over the moved face's extents become one
    int grid_bits = 10;                     // finest input grid 2^-bits; coarser where the map allows
    template <class A> void fields(A& a) { a(plane_merge_distance, grid_bits); }
};

struct BrushPolytope {
    bool valid = false;
    Box3 bounds;                      // map units, of the correctly rounded corners
    std::vector<PlanePolygon> faces;  // one per contributing side; support = the side's plane, facing out
    std::vector<SideId> sides;        // parallel to faces
    template <class A> void fields(A& a) { a(valid, bounds, faces, sides); }
};

// A convex part of a brush side not covered by any other brush of the same model and equal or stronger contents.
// It faces from its brush (behind the support plane) to `front`.
//   behind = solid        all of them together, `covered` ones included, are the closed boundary of the union of the
//                         structural brushes: what a BSP needs. Skip `covered` ones for what can be seen.
//   behind = hint         whole hint-textured sides, nothing carved away; splitters only
//   behind = area_portal  whole sides, nothing carved away; splitters only
//   behind = occluder     the boundary of the union of the occluder brushes of one entity, less nodraw sides: polygons for
//                         the run time, not to be drawn
// Clip and trigger brushes have none.
struct Fragment {
    PlanePolygon polygon;
    SideId side;
    BrushId brush;
    ModelId model;
    Contents behind = Contents::solid; // contents of `brush`
    Contents front = Contents::empty;  // what lies right in front: empty, or the strongest weaker brush there
    bool covered = false;              // a structural face with detail right in front: not to be drawn or lit
    bool both_sides = false;           // surface of a liquid against air or a weaker liquid: also seen from behind
    template <class A> void fields(A& a) { a(polygon, side, brush, model, behind, front, covered, both_sides); }
};

struct CsgReport {
    int grid_bits = 0;                 // chosen: all plane points are multiples of 2^-bits map units …
    std::uint32_t rounded_sides = 0;   // … but for those of these sides
    double largest_rounding = 0;       // map units over the face, of those
    SideId largest_rounding_side;
    std::uint32_t merged_planes = 0;   // sides whose plane became another one
    double largest_move = 0;           // map units over the face
    BrushId largest_move_brush;
    std::uint32_t kept_brushes = 0;    // brushes whose planes stayed because moving them would have lost a side
    std::uint32_t redundant_sides = 0; // of valid brushes: contribute no face
    std::uint32_t invalid_brushes = 0;
    std::uint32_t editor_sides = 0;    // whose corners as the editor saw them are in the file, compared with the exact ones …
    std::uint32_t editor_mismatches = 0; // … of these, those that differ by more than kEditorMismatch
    double largest_editor_mismatch = 0;  // map units, of all compared
    SideId largest_editor_mismatch_side;
    template <class A> void fields(A& a) {
        a(grid_bits, rounded_sides, largest_rounding, largest_rounding_side, merged_planes, largest_move,
          largest_move_brush, kept_brushes, redundant_sides, invalid_brushes, editor_sides, editor_mismatches,
          largest_editor_mismatch, largest_editor_mismatch_side);
    }
};

// Map units: where a side's corners lie farther than this from where the editor saw them, its plane was misread.
constexpr double kEditorMismatch = 1.0 / 8;

// Half the side of the cube that stands for all space, map units. Plane points lie within half of it.
constexpr double kWorldHalfSize = 1 << 20;

struct Csg {
    PlaneTable planes;
    // The cube's planes -x +x -y +y -z +z, facing out: ids 0, 2, 4, 6, 8, 10.
    std::array<PlaneId, 6> world_cube{};
    std::vector<BrushPolytope> brushes; // parallel to world.brushes
    std::vector<Fragment> fragments;    // sorted by (model, side), then as they were cut
    CsgReport report;
    template <class A> void fields(A& a) { a(planes, world_cube, brushes, fragments, report); }
};
Result<Csg> build_csg(const World& world, const CsgOptions& options, Context& context);
void validate(const Csg& csg, const World& world);
void check_invariants(const Csg& csg, const World& world, Checker& checker); // the same, for all who want to know more than the first that fails

// The part of a plane that lies in the cube, or a little more: a quad counter-clockwise seen from the front.
PlanePolygon world_polygon(const PlaneTable& planes, const std::array<PlaneId, 6>& world_cube, PlaneId plane);
// Where contents compete for space, the lower number wins; none for those that fill nothing (empty, area_portal,
// hint, clip, trigger).
std::optional<int> strength(Contents contents);

} // namespace kiln

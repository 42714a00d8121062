// BSP: the structural world as a tree of half-spaces, the portals between its open leaves, what lies outside,
// and which parts of the fragments can be seen at all.
//
// In       world, csg
// Out      tree, leaves, clusters, portals (convex, counter-clockwise seen from `leaf_front`, map units)
// Errors   micro-gap (warning): an opening narrower than options.micro_gap that would have leaked, or joined two areas
//          areaportal-leak, -one-side, -closed, -areas (warnings): a func_areaportal that does not part two areas
//          occluder-areas, occluder-without-face, viscluster-empty, sky-camera-area, sky-camera-in-solid (warnings)
//
// Whether entities are sealed in is a question of its own (find_leaks), so that moving one redoes no geometry.
//
// Source   the tree of H. Fuchs, Z. Kedem, B. Naylor, "On Visible Surface Generation by A Priori Tree Structures",
//          SIGGRAPH 1980, over exact plane polygons; openings as a minimum cut: NOTES.md
#pragma once
#include "compiler/csg/csg.h"
#include <span>

namespace kiln {

using NodeId = Index<struct NodeTag>;
using LeafId = Index<struct LeafTag>;
using ClusterId = Index<struct ClusterTag>;
using PortalId = Index<struct PortalTag>;

struct BspOptions {
    bool allow_leaks = false;      // find_leaks: a leak is a warning. The tree does not depend on it
    // Map units: openings narrower than this do not leak, and are reported. 0.2 is what the compilers these maps were
    // made with have always dropped: a level whose door stops 0.14 short of its frame counts as sealed.
    double micro_gap = 0.2;
    bool fill = true;              // false: nothing is outside, everything visible (a world that leaks)
    template <class A> void fields(A& a) { a(allow_leaks, micro_gap, fill); }
};

// Child >= 0: node; < 0: leaf -(child + 1).
struct BspNode {
    PlaneId plane;               // child[0] in front, child[1] behind
    std::array<std::int32_t, 2> child{};
    Box3 bounds;                 // map units, clipped to the world's box
    Vec3 normal{};               // of the plane, unit, rounded: for point queries in doubles
    double distance = 0;         // dot(normal, x) = distance
    template <class A> void fields(A& a) { a(plane, child, bounds, normal, distance); }
};

struct BspLeaf {
    Contents contents = Contents::empty; // solid, empty, window, liquids, area_portal (detail does not show here)
    ClusterId cluster;                   // none: solid or outside. Leaves of a func_viscluster or a 3D sky share theirs
    bool outside = false;                // reached from the void and filled
    std::uint32_t area = 0;              // flood region between area portals, from 1; 0: none, or an area portal's leaf
    Box3 bounds;                         // map units, clipped to the world's box
    std::vector<BrushId> brushes;        // solid, detail, window, liquid and clip brushes with volume in it, sorted
    template <class A> void fields(A& a) { a(contents, cluster, outside, area, bounds, brushes); }
    bool open() const { return contents != Contents::solid; }
};

struct BspPortal {
    LeafId leaf_front, leaf_back; // open leaves on the two sides
    PlaneId plane;                // front side looks to leaf_front; = polygon.support
    PlanePolygon polygon;         // the same exactly, planes of Bsp::planes
    std::vector<Vec3> winding;    // map units
    bool hint = false;
    template <class A> void fields(A& a) { a(leaf_front, leaf_back, plane, polygon, winding, hint); }
};

// A part of a fragment in front of which one open, inside leaf lies.
struct VisibleFragment {
    std::uint32_t fragment = 0; // index into csg.fragments
    PlanePolygon polygon;       // planes of Bsp::planes
    LeafId leaf;                // in front of it
    template <class A> void fields(A& a) { a(fragment, polygon, leaf); }
};

// Where inside meets outside through an opening that was taken as closed (micro gaps). Together with the visible
// structural and detail fragments these close the boundary of the inside.
struct ClosedGap {
    PlanePolygon polygon; // faces `leaf`; planes of Bsp::planes
    LeafId leaf;          // inside
    SideId side;          // of a structural brush beside it, for a name; one that does not shine where there is one
    template <class A> void fields(A& a) { a(polygon, leaf, side); }
};

struct Leak {
    EntityId entity;             // the one the path starts at
    std::vector<Vec3> path;      // from the entity to the void; shortest by length
    std::vector<BrushId> near;   // structural brushes around the hole, nearest first
    Vec3 hole{};                 // middle of the opening the path goes through: of all ways to part the entities from
                                 // the void by closing portals, the one of least area
    double length = 0;           // of the path, map units
    double area = 0, width = 0;  // of the opening, square map units, and its least extent; 0: the entity stands in the void
    std::vector<BrushId> passes; // brushes that do not seal and the path goes through, nearest to the hole first
    template <class A> void fields(A& a) { a(entity, path, near, hole, length, area, width, passes); }
};
double path_length(std::span<const Vec3> path); // map units
// What a brush that does not seal is to the designer: "func_detail", "displacement", "water of func_water_analog", ...
std::string name_of_unsealing(const World& world, BrushId brush);

// One func_areaportal brush: a door that the game can shut.
struct AreaPortal {
    BrushId brush;
    std::array<std::uint32_t, 2> areas{}; // on its two sides, ascending; equal or 0: it parts no two areas (reported)
    PlanePolygon polygon;                 // cut of the brush with the plane midway between the sides; counter-clockwise
    std::vector<Vec3> winding;            // seen from areas[0]; planes of Bsp::planes; map units
    std::vector<Vec3> leak;               // where both sides are one area: a way around, from one side to the other
    template <class A> void fields(A& a) { a(brush, areas, polygon, winding, leak); }
};

// Liquid that hangs together under one surface.
struct WaterVolume {
    Contents contents = Contents::water;
    double surface_z = 0, min_z = 0; // map units
    bool has_surface = false;        // false: it fills its room, surface_z is its highest point
    MaterialId material;             // of most of its surface; without one, of its brush's top
    template <class A> void fields(A& a) { a(contents, surface_z, min_z, has_surface, material); }
};

// The polygons of one func_occluder.
struct Occluder {
    EntityId entity;
    std::uint32_t area = 0;               // that holds it; 0: none, or several (reported)
    std::vector<std::uint32_t> fragments; // into csg.fragments, behind = occluder
    template <class A> void fields(A& a) { a(entity, area, fragments); }
};

struct Bsp {
    PlaneTable planes;             // those of csg (same ids), then the world's box, then those of area portals
    std::array<PlaneId, 6> box{};  // +x -x +y -y +z -z, facing out, beyond every brush
    std::vector<BspNode> nodes;    // 0: root; empty: one leaf. Preorder, front first, as are the leaves
    std::vector<BspLeaf> leaves;
    std::uint32_t cluster_count = 0;
    std::uint32_t area_count = 0;   // areas are 1..area_count
    std::vector<BspPortal> portals; // between open leaves inside (after fill)
    std::vector<VisibleFragment> visible; // sorted by fragment; brush models: whole, leaf none
    std::vector<ClosedGap> closed;        // none without fill
    Box3 bounds;                   // of the world's solid brushes
    std::vector<AreaPortal> area_portals; // in the order of their brushes
    std::vector<WaterVolume> waters;
    std::vector<std::uint32_t> leaf_water; // parallel to leaves: into waters; UINT32_MAX: not liquid, or outside
    std::vector<Occluder> occluders;       // in the order of their entities
    template <class A> void fields(A& a) {
        a(planes, box, nodes, leaves, cluster_count, area_count, portals, visible, closed, bounds, area_portals, waters,
          leaf_water, occluders);
    }
};
Result<Bsp> build_bsp(const World& world, const Csg& csg, const BspOptions& options, Context& context);
void validate(const Bsp& bsp, const Csg& csg);
// The same, for all who want to know more than the first that fails; `world`: for the places, may be null.
void check_invariants(const Bsp& bsp, const Csg& csg, const World* world, Checker& checker);

// Do the point entities stand inside? `bsp`: filled, built with the same micro_gap. Cheap where they do.
// Errors   leak: not a fault. One diagnostic per opening, errors, or warnings with allow_leaks; the caller writes
//          the trail and decides on exit 4
//          no-entity-inside (warning): what the void does not reach counts as inside
//          entity-outside (warning): it lies on an outer face or in a filled crack, while the others are sealed in
struct LeakTest {
    std::optional<Leak> leak; // the one with the shortest path
    std::vector<Leak> leaks;  // all, that one first; entities that stand in the void last. At most 256
};
Result<LeakTest> find_leaks(const World& world, const Csg& csg, const Bsp& bsp, const BspOptions& options, Context& context);

// The leaf that holds a point (on a plane: the front child).
LeafId leaf_at(const Bsp& bsp, Vec3 point);
inline LeafId leaf_at(const Bsp& bsp, const PlaneTable&, Vec3 point) { return leaf_at(bsp, point); }
// All leaves within `tolerance` map units of the hull of some points, measured to the node planes; ascending. Below 0: those that it reaches into
// by more than that; of two that it lies between, closer to both, both.
std::vector<LeafId> leaves_at(const Bsp& bsp, std::span<const Vec3> hull, double tolerance);
inline std::vector<LeafId> leaves_at(const Bsp& bsp, Vec3 point, double tolerance) {
    return leaves_at(bsp, std::span(&point, 1), tolerance);
}
// Each leaf as the convex polytope it is: faces looking out, clipped to the world's box. For dumps and tests.
std::vector<std::vector<PlanePolygon>> leaf_polytopes(const Bsp& bsp);

} // namespace kiln

// Private to bsp: the steps of build_bsp and what they hand to each other.
#pragma once
#include "compiler/bsp/bsp.h"
#include "compiler/bsp/polytope.h"
#include "libs/core/context.h"
#include <deque>
#include <functional>

namespace kiln::bsp {

Box3 world_box(const World& world, const Csg& csg); // around every brush of the world

struct TreeLeaf {
    Contents contents = Contents::empty;
    std::vector<BrushId> area_portals; // with volume in it, sorted
    Box3 bounds;
    double thickness = 0;         // least extent, map units; solid ones have none
    Vec3 thin_way{};              // unit, the way it is least
    double thin_end = 0;          // how far it reaches along thin_way
    std::vector<BrushId> brushes; // sorted
};
struct VoidFace { // where a leaf is open to the world's box
    std::uint32_t leaf;
    std::vector<Vec3> winding;
    PlanePolygon polygon; // the same, facing out
};

struct Tree {
    std::vector<BspNode> nodes; // preorder, front first
    std::vector<Poly> caps;           // parallel: the node's plane within the node's region, facing as the plane; the cutter's
    std::vector<bool> hint;           // parallel: its splitter was a hint
    std::vector<TreeLeaf> leaves;     // preorder, front first
    std::vector<VoidFace> void_faces; // by leaf
    std::size_t splits = 0;           // boundary polygons cut
};
Tree build_tree(const World& world, const Csg& csg, Cutter& cutter, const std::array<PlaneId, 6>& box, Context& context);

struct SplitterItem {
    enum Kind : std::uint8_t { structural, translucent, area_portal, hint };
    Poly poly;
    double area = 0; // of poly, rounded
    Kind kind = structural;
};
// Chooses the item whose plane divides a node best. Holds memory that it uses again from node to node.
class SplitterChooser {
public:
    explicit SplitterChooser(const Space& space);
    std::size_t choose(std::span<const SplitterItem> items, const Box3& region);

private:
    struct Candidate { // a plane that some items lie in
        PlaneId plane; // even id
        std::uint32_t item = 0, count = 0;
        double area = 0; // of these items
        SplitterItem::Kind kind = SplitterItem::structural;
    };
    struct Score {
        double value = HUGE_VAL; // less is better
        bool cuts_hint = false;
    };
    const Space& space_;
    std::vector<std::uint32_t> candidate_of_; // per pair of planes; UINT32_MAX: none, in between two calls all are
    std::vector<Candidate> all_;
    std::vector<double> lo_[3], hi_[3], sum_[3], size_[3]; // of the items' boxes; sums and sizes where a plane slopes
    std::vector<std::uint32_t> hints_;  // items

    void find_candidates(std::span<const SplitterItem> items, const Box3& region);
    Score score(std::span<const SplitterItem> items, const Candidate& c, double least) const;
};

// Numbers in groups, each in the order in which they came.
struct Groups {
    std::vector<std::uint32_t> first, members; // group g: members [first[g], first[g + 1])
    std::span<const std::uint32_t> operator[](std::size_t g) const { return std::span(members).subspan(first[g], first[g + 1] - first[g]); }
    std::size_t size() const { return first.size() - 1; }
};
// Numbers 0..count - 1; each is in groups_of(number)[0] and [1].
Groups group(std::size_t groups, std::size_t count, auto&& groups_of) {
    Groups g;
    g.first.assign(groups + 2, 0); // one ahead while filling
    for (std::size_t i = 0; i < count; ++i)
        for (const std::uint32_t in : groups_of(i)) ++g.first[in + 2];
    for (std::size_t i = 2; i < g.first.size(); ++i) g.first[i] += g.first[i - 1];
    g.members.resize(g.first.back());
    for (std::size_t i = 0; i < count; ++i)
        for (const std::uint32_t in : groups_of(i)) g.members[g.first[in + 1]++] = static_cast<std::uint32_t>(i);
    g.first.pop_back();
    return g;
}
using Pair = std::array<std::uint32_t, 2>;

// Between any two open leaves; winding and hint filled.
std::vector<BspPortal> build_portals(Cutter& cutter, const Tree& tree);

std::int32_t leaf_of_child(std::int32_t child); // child < 0
std::vector<LeafId> leaves_at(const std::vector<BspNode>& nodes, std::span<const Vec3> hull, double tolerance);
inline std::vector<LeafId> leaves_at(const std::vector<BspNode>& nodes, Vec3 point, double tolerance) {
    return leaves_at(nodes, std::span(&point, 1), tolerance);
}

// Leaves and portals as rooms and doors, for all that asks how to get from one place to another.
//
// A room is a leaf; but one thinner than the micro gap has a room at each of its portals, joined only where one can
// pass straight through from portal to portal. Thin leaves are common: where two planes are almost one, the leaf
// between them may run along a wall from the inside of the level, past the crack beside that wall's edge, to the
// outside, through portals that are all as large as can be.
struct Door {
    std::array<std::uint32_t, 2> rooms{};
    std::span<const Vec3> winding; // of the portals, or of the flow
};
struct Flow { // valid as long as the tree and the portals
    double micro_gap = 0;
    std::vector<std::uint32_t> room_leaf; // per room; room l is leaf l where that is not thin
    Groups doors_of;                      // per room, ascending
    std::vector<Door> doors;              // first those of the portals, in their order
    Groups portals_of;                    // per leaf, ascending
    std::vector<std::pair<std::uint32_t, std::span<const Vec3>>> shore; // rooms open to the world's box, and where
    std::deque<std::vector<Vec3>> ways;                                 // windings of doors through thin leaves
    bool open(std::uint32_t door) const { return width(doors[door].winding) >= micro_gap; } // most doors are never asked
};
Flow make_flow(const Tree& tree, const std::vector<BspPortal>& portals, double micro_gap);
// Rooms of the leaf from which one can be at the point.
std::vector<std::uint32_t> rooms_at(const Tree& tree, const Flow& flow, LeafId leaf, Vec3 point);

std::vector<std::uint8_t> rooms_of_the_void(const Flow& flow); // per room: the void reaches it
// Per leaf: what the void reaches, and cracks that lead nowhere.
std::vector<std::uint8_t> fill_outside(const Tree& tree, const std::vector<BspPortal>& portals, const Flow& flow);
// Areas of the inside: what hangs together without passing a leaf of an area portal, nor a micro gap between two places that
// have an area portal before them.
struct Areas {
    std::vector<std::uint32_t> of_leaf; // from 1; 0: outside, solid, an area portal's
    std::vector<std::uint32_t> of_room; // the same; 0 too where nothing but micro gaps leads to an area
    std::uint32_t count = 0;
};
// Between inside and outside, and between areas.
void report_gaps(const World& world, const Csg& csg, const Tree& tree, const std::vector<BspPortal>& portals,
                 const Flow& flow, const std::vector<std::uint8_t>& outside, const Areas& areas, Context& context);
// Where inside meets outside or the world's box (a thin leaf may run through it all), what no detail brush closes.
std::vector<ClosedGap> closed_gaps(const World& world, const Csg& csg, const Space& space, const Tree& tree,
                                   const std::vector<BspPortal>& portals, const std::vector<std::uint8_t>& outside);

// A room to stand in: a leaf of the finished tree, or a room of the flow.
struct EntityPlace {
    EntityId entity;
    Vec3 origin;
    std::vector<std::uint32_t> rooms; // it touches
    bool on_solid = false;            // it touches solid too
};
struct Ground {
    const std::vector<BspNode>& nodes;
    std::function<std::vector<std::uint32_t>(LeafId, Vec3)> rooms; // none: solid
    std::function<bool(std::uint32_t)> lost;                       // the void reaches the room
};
struct Settlers {
    std::vector<EntityPlace> entities;  // those in the open
    std::vector<std::uint32_t> leaking; // into entities: those the void reaches
    bool inhabited = false;             // someone stands where it does not
};
Settlers place_entities(const World& world, const Ground& ground);

// Structural brushes of the world about an opening, nearest first, at most `count`.
std::vector<BrushId> brushes_near(const World& world, const Csg& csg, std::span<const Vec3> opening, std::size_t count);
std::string name_brushes(const World& world, std::span<const BrushId> brushes); // "12 (line 80), 14 (line 95)"
std::string name_place(Vec3 p);                                                 // "(1 2.5 -3)"
Box3 box_of(std::span<const Vec3> points, double margin);
// Numbers boxes in order of appearance so that those which touch share a number.
std::vector<std::uint32_t> touching(std::span<const Box3> boxes);

// All openings that have to be closed, the one with the shortest path first. Entities that stand in the void
// themselves come last, without an opening.
std::vector<Leak> trace_leaks(const World& world, const Csg& csg, const Flow& flow, const Settlers& placed);
void report_leaks(const World& world, const std::vector<Leak>& leaks, const BspOptions& options, Context& context);

Vec3 closest_point(std::span<const Vec3> convex_winding, Vec3 to);

Areas find_areas(const Tree& tree, const std::vector<BspPortal>& portals, const Flow& flow, const std::vector<std::uint8_t>& outside);
void find_area_portals(const World& world, const Csg& csg, const Tree& tree, const std::vector<BspPortal>& portals, const Flow& flow,
                       const Areas& areas, Bsp& bsp, bool report, Context& context);
void find_waters(const World& world, const Csg& csg, Bsp& bsp);
void find_occluders(const World& world, const Csg& csg, const Space& space, Bsp& bsp, Context& context);
// Clusters of the inside leaves, numbered in the order of leaves. Areas must be known.
void number_clusters(const World& world, const Csg& csg, const Space& space, Bsp& bsp, Context& context);

std::vector<VisibleFragment> visible_fragments(const Csg& csg, Cutter& cutter, const Bsp& bsp);

} // namespace kiln::bsp

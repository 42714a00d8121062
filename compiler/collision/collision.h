// Collision: the planes a brush lacks when boxes are to be swept against it.
//
// A box that moves without turning hits a brush where its centre enters the Minkowski sum of the two. Pushing the
// brush's own planes out by the box's reach gives too large a hull: it has spikes at the edges, and boxes snag on them.
// The sum's further faces are parallel to the faces of the box (six axial planes), and to an edge of the brush and an
// edge of the box each. Pushed out likewise, own planes and bevels together are the sum, for every size of box.
//
// In       csg: exact polytopes
// Out      per brush, parallel to csg.brushes: its bevels, none of them parallel to an own plane; invalid brushes have none
// Errors   none
// Source   which pairs of edges give a face: overlay of the two Gauss maps, exact: NOTES.md
#pragma once
#include "compiler/csg/csg.h"

namespace kiln {

struct Bevel {       // dot(normal, x) <= distance on all of the brush, nearly touching it
    Vec3 normal;     // unit, rounded
    double distance; // map units, rounded outwards by at most 2^-32 in the largest world
    template <class A> void fields(A& a) { a(normal, distance); }
};

struct CollisionBrushes {
    std::vector<std::uint32_t> first_bevel; // brushes + 1
    std::vector<Bevel> bevels;              // of a brush: axial ones, in the order -x +x -y +y -z +z, then those of edges
    template <class A> void fields(A& a) { a(first_bevel, bevels); }
};
CollisionBrushes build_collision(const Csg& csg, Context& context);
void validate(const CollisionBrushes& collision, const Csg& csg);

} // namespace kiln

// Openings between inside and outside that are taken as closed: what closes them.
#include "compiler/bsp/build.h"

namespace kiln::bsp {
namespace {

// Appends the parts of `poly` that are not in the closed brush.
void subtract(Cutter& cutter, Poly poly, const BrushPolytope& brush, std::vector<Poly>& out) {
    for (const PlanePolygon& face : brush.faces) { // in the plane of a face: the other faces decide
        Poly behind;
        const unsigned s = cutter.divide(poly, Splitter(cutter.space().planes, face.support), behind);
        if (s & kFront) out.push_back(poly);
        if (s == kFront) return;
        if (s == kBoth) poly = behind;
    }
    cutter.drop(poly);
}

SideId side_beside(const World& world, const Csg& csg, std::span<const Vec3> winding) {
    constexpr std::size_t kLook = 4;
    const auto shines = [&](SideId s) {
        return max_component(world.materials[world.sides[s.at()].material.at()].emission) > 0;
    };
    for (const BrushId b : brushes_near(world, csg, winding, kLook))
        for (const SideId s : csg.brushes[b.at()].sides)
            if (!shines(s)) return s;
    for (std::size_t s = 0; s < world.sides.size(); ++s)
        if (!shines(id<SideId>(s))) return id<SideId>(s);
    return id<SideId>(0);
}

} // namespace

std::vector<ClosedGap> closed_gaps(const World& world, const Csg& csg, const Space& space, const Tree& tree,
                                   const std::vector<BspPortal>& portals, const std::vector<std::uint8_t>& outside) {
    std::vector<ClosedGap> gaps;
    Cutter cutter(space);
    // Detail in the opening closes that part of it itself: with its own visible faces.
    const auto close = [&](const PlanePolygon& facing_in, LeafId inside, std::initializer_list<LeafId> around) {
        std::vector<Poly> parts{cutter.make(facing_in)}, next;
        const SideId side = side_beside(world, csg, winding(parts.front()));
        for (const LeafId l : around)
            for (const BrushId b : tree.leaves[l.at()].brushes) {
                if (world.brushes[b.at()].contents != Contents::detail) continue;
                next.clear();
                for (const Poly& part : parts) subtract(cutter, part, csg.brushes[b.at()], next);
                parts.swap(next);
            }
        for (const Poly& part : parts) gaps.push_back({polygon(part), inside, side});
    };
    for (const BspPortal& p : portals) {
        const bool front_out = outside[p.leaf_front.at()] != 0, back_out = outside[p.leaf_back.at()] != 0;
        if (front_out == back_out) continue;
        close(front_out ? flipped(p.polygon) : p.polygon, front_out ? p.leaf_back : p.leaf_front, {p.leaf_front, p.leaf_back});
    }
    for (const VoidFace& f : tree.void_faces)
        if (!outside[f.leaf]) close(flipped(f.polygon), id<LeafId>(f.leaf), {id<LeafId>(f.leaf)});
    return gaps;
}

} // namespace kiln::bsp

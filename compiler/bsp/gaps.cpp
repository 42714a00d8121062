// Openings between inside and outside that are taken as closed: what closes them.
#include "compiler/bsp/build.h"

namespace kiln::bsp {
namespace {

// Appends the parts of `poly` that are not in the closed brush.
void subtract(const Space& space, Poly poly, const BrushPolytope& brush, std::vector<Poly>& out) {
    for (const PlanePolygon& face : brush.faces) {
        if (same_plane(face.support, poly.polygon.support)) continue; // in the plane of a face: the other faces decide
        Halves halves = cut(space, std::move(poly), Splitter(space.planes, face.support));
        if (halves.front) out.push_back(std::move(*halves.front));
        if (!halves.back) return;
        poly = std::move(*halves.back);
    }
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
                                   const std::vector<BspPortal>& portals, const std::vector<std::uint8_t>& outside,
                                   std::span<const LeafId> new_leaf) {
    std::vector<ClosedGap> gaps;
    // Detail in the opening closes that part of it itself: with its own visible faces.
    const auto close = [&](const PlanePolygon& facing_in, LeafId inside, std::initializer_list<LeafId> around) {
        std::vector<Poly> parts{make_poly(space.planes, facing_in)}, next;
        const SideId side = side_beside(world, csg, parts.front().points);
        for (const LeafId l : around)
            for (const BrushId b : tree.leaves[l.at()].brushes) {
                if (world.brushes[b.at()].contents != Contents::detail) continue;
                next.clear();
                for (Poly& part : parts) subtract(space, std::move(part), csg.brushes[b.at()], next);
                parts.swap(next);
            }
        for (Poly& part : parts) gaps.push_back({std::move(part.polygon), new_leaf[inside.at()], side});
    };
    for (const BspPortal& p : portals) {
        const bool front_out = outside[p.leaf_front.at()] != 0, back_out = outside[p.leaf_back.at()] != 0;
        if (front_out == back_out) continue;
        close(front_out ? flipped(p.polygon) : p.polygon, front_out ? p.leaf_back : p.leaf_front, {p.leaf_front, p.leaf_back});
    }
    for (std::size_t l = 0; l < tree.leaves.size(); ++l)
        if (!outside[l])
            for (const PlanePolygon& f : tree.leaves[l].void_polygons) close(flipped(f), id<LeafId>(l), {id<LeafId>(l)});
    return gaps;
}

} // namespace kiln::bsp

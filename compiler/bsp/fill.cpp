// What lies outside: the open leaves that the void reaches.
#include "compiler/bsp/build.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace kiln::bsp {
namespace {

constexpr std::size_t kMostGapReports = 64;

// Over rooms, through doors that are no micro gaps.
std::vector<std::uint8_t> walk(const Flow& flow, std::vector<std::uint32_t> from) {
    std::vector<std::uint8_t> reached(flow.room_leaf.size());
    for (const std::uint32_t r : from) reached[r] = 1;
    while (!from.empty()) {
        const std::uint32_t room = from.back();
        from.pop_back();
        for (const std::uint32_t d : flow.doors_of[room]) {
            const Door& door = flow.doors[d];
            const std::uint32_t next = door.rooms[door.rooms[0] == room ? 1 : 0];
            if (reached[next] || !flow.open(d)) continue;
            reached[next] = 1;
            from.push_back(next);
        }
    }
    return reached;
}

// Over leaves, through every portal however thin.
std::vector<std::uint8_t> seep(const std::vector<BspPortal>& portals, const Flow& flow, std::vector<std::uint32_t> from,
                               const auto& may_enter) {
    std::vector<std::uint8_t> reached(flow.portals_of.size());
    std::erase_if(from, [&](std::uint32_t l) { return !may_enter(l); });
    for (const std::uint32_t l : from) reached[l] = 1;
    while (!from.empty()) {
        const std::uint32_t leaf = from.back();
        from.pop_back();
        for (const std::uint32_t p : flow.portals_of[leaf]) {
            const BspPortal& portal = portals[p];
            const std::uint32_t next = portal.leaf_front.value == leaf ? portal.leaf_back.value : portal.leaf_front.value;
            if (reached[next] || !may_enter(next)) continue;
            reached[next] = 1;
            from.push_back(next);
        }
    }
    return reached;
}

// At least how far the brush is from the convex winding; where both are axis-aligned, exactly so.
double distance_to(const Csg& csg, const BrushPolytope& brush, std::span<const Vec3> w) {
    double most = 0;
    for (const PlanePolygon& f : brush.faces) {
        double least = HUGE_VAL;
        for (const Vec3& p : w) least = std::min(least, dot(csg.planes.normal(f.support), p) - csg.planes.distance(f.support));
        most = std::max(most, least);
    }
    return most;
}

} // namespace

std::vector<std::uint8_t> rooms_of_the_void(const Flow& flow) {
    std::vector<std::uint32_t> shore;
    for (const auto& [room, face] : flow.shore) shore.push_back(room);
    return walk(flow, std::move(shore));
}

std::vector<std::uint8_t> fill_outside(const Tree& tree, const std::vector<BspPortal>& portals, const Flow& flow) {
    const std::vector<std::uint8_t> from_void = rooms_of_the_void(flow);
    std::vector<std::uint32_t> sealed; // rooms to be in: what is not thin and the void does not reach
    for (std::uint32_t r = 0; r < tree.leaves.size(); ++r)
        if (tree.leaves[r].contents != Contents::solid && tree.leaves[r].thickness >= flow.micro_gap && !from_void[r])
            sealed.push_back(r);
    // A thin leaf that both sides reach is inside: the walls of the level may be in it. Cracks in the outer walls
    // that only micro gaps join to the void are of no interest to those inside, and go.
    const std::vector<std::uint8_t> from_inside = walk(flow, sealed);
    std::vector<std::uint8_t> inside(tree.leaves.size()), lost(tree.leaves.size());
    for (std::size_t r = 0; r < from_inside.size(); ++r) inside[flow.room_leaf[r]] |= from_inside[r];
    for (std::size_t r = 0; r < from_void.size(); ++r) lost[flow.room_leaf[r]] |= from_void[r];
    std::vector<std::uint32_t> inside_leaves, lost_leaves;
    for (std::uint32_t l = 0; l < tree.leaves.size(); ++l) {
        if (inside[l]) inside_leaves.push_back(l);
        else if (lost[l]) lost_leaves.push_back(l);
    }
    const std::vector<std::uint8_t> lived_in =
        seep(portals, flow, inside_leaves, [&](std::uint32_t l) { return inside[l] || !lost[l]; });
    return seep(portals, flow, lost_leaves, [&](std::uint32_t l) { return !lived_in[l]; });
}

void report_gaps(const World& world, const Csg& csg, const Tree& tree, const std::vector<BspPortal>& portals,
                 const Flow& flow, const std::vector<std::uint8_t>& outside, const Areas& areas, Context& context) {
    std::vector<std::uint32_t> thin;
    std::vector<Box3> boxes;
    const auto areas_of = [&](const BspPortal& p) {
        return std::pair(areas.of_leaf[p.leaf_front.at()], areas.of_leaf[p.leaf_back.at()]);
    };
    const auto parts_areas = [&](const BspPortal& p) {
        const auto [a, b] = areas_of(p);
        return a && b && a != b;
    };
    for (std::uint32_t p = 0; p < portals.size(); ++p)
        if (outside[portals[p].leaf_front.at()] != outside[portals[p].leaf_back.at()] || parts_areas(portals[p])) {
            thin.push_back(p);
            boxes.push_back(box_of(portals[p].winding, 0.5));
        }
    const std::vector<std::uint32_t> gap_of = touching(boxes);
    std::size_t gaps = 0;
    for (std::size_t i = 0; i < thin.size(); ++i) {
        if (gap_of[i] != gaps) continue; // its gap has been reported
        if (++gaps > kMostGapReports) continue;
        const BspPortal& p = portals[thin[i]];
        const double wide = std::min({width(flow.doors[thin[i]].winding), tree.leaves[p.leaf_front.at()].thickness,
                                      tree.leaves[p.leaf_back.at()].thickness});
        std::vector<BrushId> near = brushes_near(world, csg, p.winding, 4);
        // The area portal that stops short: the one brush to move, where there is one.
        const auto beside = [&](std::size_t b) {
            if (!csg.brushes[b].valid || world.brushes[b].model.value != 0 || world.brushes[b].contents != Contents::area_portal) return false;
            for (std::size_t k = i; k < thin.size(); ++k)
                if (gap_of[k] == gap_of[i] && parts_areas(portals[thin[k]]) && distance_to(csg, csg.brushes[b], portals[thin[k]].winding) <= flow.micro_gap) return true;
            return false;
        };
        std::string portal;
        for (std::size_t b = 0; parts_areas(p) && portal.empty() && b < world.brushes.size(); ++b)
            if (beside(b)) portal = " beside the " + name_of_unsealing(world, id<BrushId>(b)), near.insert(near.begin(), id<BrushId>(b));
        constexpr double kDrawn = 1.0 / 64; // map units: planes that miss each other by less are a rounding of the editor, nothing to mend
        context.report(wide < kDrawn ? Severity::note : Severity::warning, "micro-gap",
                       fmt::format("a gap {:.4g} units wide at {}{}{} is taken as closed; brushes around it: {}", wide,
                                   name_place(centroid(p.winding)), portal,
                                   parts_areas(p) ? fmt::format(" between areas {} and {}", areas_of(p).first, areas_of(p).second) : "",
                                   name_brushes(world, near)),
                       near.empty() ? SourceLocation{.file = world.file} : world.location(near.front()));
    }
    if (gaps > kMostGapReports)
        context.report(Severity::warning, "micro-gap",
                       fmt::format("and {} more such gaps", gaps - kMostGapReports), {.file = world.file});
}

} // namespace kiln::bsp

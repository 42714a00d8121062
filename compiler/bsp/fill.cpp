// What lies outside: the open leaves that the void reaches.
#include "compiler/bsp/build.h"
#include <algorithm>
#include <fmt/format.h>

namespace kiln::bsp {
namespace {

// An entity this near to a node's plane touches the leaves on both sides of it. Map units; far below anything a
// designer places by, far above the rounding of what he typed.
constexpr double kTouch = 1e-3;
constexpr std::size_t kMostGapReports = 64;

bool starts_with(std::string_view name, std::string_view prefix) {
    return name.size() >= prefix.size() && equal_ignoring_case(name.substr(0, prefix.size()), prefix);
}

// Entities that are somewhere. Brush entities are where their brushes are, and what is merged into the world or
// stands for another file (func_instance) is nowhere in particular.
bool is_placed(const WorldEntity& e) {
    return e.has_origin && !e.model.valid() && !starts_with(e.get("classname"), "func_");
}
// Marks for the compiler rather than things in the level: inside they show that there is an inside, but one left
// lying in the void is no leak. (Other compilers take them out before they look for leaks.)
bool is_mark(const WorldEntity& e) {
    for (const std::string_view name : {"info_overlay", "infodecal", "env_cubemap", "info_lighting",
                                        "info_no_dynamic_shadow"})
        if (starts_with(e.get("classname"), name)) return true;
    return false;
}

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

void report_gaps(const World& world, const Csg& csg, const Tree& tree, const std::vector<BspPortal>& portals,
                 const Flow& flow, const std::vector<std::uint8_t>& outside, Context& context) {
    std::vector<std::uint32_t> thin;
    std::vector<Box3> boxes;
    for (std::uint32_t p = 0; p < portals.size(); ++p)
        if (outside[portals[p].leaf_front.at()] != outside[portals[p].leaf_back.at()]) {
            thin.push_back(p);
            boxes.push_back(box_of(portals[p].winding, 0.5));
        }
    const std::vector<std::uint32_t> gap_of = touching(boxes);
    std::size_t gaps = 0;
    for (std::size_t i = 0; i < thin.size(); ++i) {
        if (gap_of[i] != gaps) continue; // its gap has been reported
        if (++gaps > kMostGapReports) continue;
        const BspPortal& p = portals[thin[i]];
        const double wide = std::min({flow.doors[thin[i]].width, tree.leaves[p.leaf_front.at()].thickness,
                                      tree.leaves[p.leaf_back.at()].thickness});
        const std::vector<BrushId> near = brushes_near(world, csg, p.winding, 4);
        context.report(Severity::warning, "micro-gap",
                       fmt::format("a gap {:.4g} units wide at {} is taken as closed; brushes around it: {}", wide,
                                   name_place(centroid(p.winding)), name_brushes(world, near)),
                       near.empty() ? SourceLocation{.file = world.file} : world.location(near.front()));
    }
    if (gaps > kMostGapReports)
        context.report(Severity::warning, "micro-gap",
                       fmt::format("and {} more such gaps", gaps - kMostGapReports), {.file = world.file});
}

} // namespace

Fill fill_outside(const World& world, const Csg& csg, const Tree& tree, const std::vector<BspPortal>& portals,
                  const Flow& flow, Context& context) {
    std::vector<std::uint32_t> shore;
    for (const auto& [room, face] : flow.shore) shore.push_back(room);
    const std::vector<std::uint8_t> from_void = walk(flow, shore);

    Fill fill;
    std::vector<std::uint32_t> inhabited;
    std::size_t leaking_on_solid = 0; // of fill.leaking
    for (std::size_t e = 1; e < world.entities.size(); ++e) {
        if (!is_placed(world.entities[e])) continue;
        EntityPlace place{id<EntityId>(e), {}, {}};
        bool on_solid = false;
        // An origin in solid may lie in a floor it stands on, or in a ceiling it hangs from.
        for (const double dz : {0.0, 1.0, -1.0}) {
            place.origin = world.entities[e].origin + Vec3{0, 0, dz};
            for (const LeafId l : leaves_at(tree.nodes, place.origin, kTouch)) {
                if (tree.leaves[l.at()].contents != Contents::solid)
                    for (const std::uint32_t r : rooms_at(tree, flow, l, place.origin)) place.rooms.push_back(r);
                else on_solid = true;
            }
            // A shift downwards may prove that it is inside; it proves no leak.
            if (dz < 0 || is_mark(world.entities[e]))
                std::erase_if(place.rooms, [&](std::uint32_t r) { return from_void[r] != 0; });
            if (!place.rooms.empty()) break;
        }
        if (place.rooms.empty()) continue;
        bool leaks = true;
        for (const std::uint32_t r : place.rooms)
            if (!from_void[r]) leaks = false, inhabited.push_back(r);
        if (leaks) {
            fill.leaking.push_back(static_cast<std::uint32_t>(fill.entities.size()));
            if (on_solid) ++leaking_on_solid;
        }
        fill.entities.push_back(std::move(place));
    }
    // An origin on a wall's outer face is in the wall as much as in the void. Where all that leaks is such and the
    // others are sealed in, there is no leak. (In an open room, what stands on the floor leaks with the rest.)
    if (!inhabited.empty() && leaking_on_solid == fill.leaking.size()) {
        for (const std::uint32_t e : fill.leaking) {
            const WorldEntity& entity = world.entities[fill.entities[e].entity.at()];
            context.report(Severity::warning, "entity-outside",
                           fmt::format("{} at {} lies on the outside of the level and is taken as sealed",
                                       entity.get("classname", "entity"), name_place(entity.origin)),
                           world.location(fill.entities[e].entity));
        }
        fill.leaking.clear();
    }
    if (!fill.leaking.empty()) {
        fill.outside.assign(tree.leaves.size(), 0);
        return fill;
    }
    if (fill.entities.empty()) {
        context.report(Severity::warning, "no-entity-inside",
                       "no point entity stands in the open: whatever the void does not reach is taken as inside; "
                       "leaks cannot be told",
                       {.file = world.file});
        for (std::uint32_t r = 0; r < tree.leaves.size(); ++r) // what is not thin
            if (tree.leaves[r].contents != Contents::solid && tree.leaves[r].thickness >= flow.micro_gap && !from_void[r])
                inhabited.push_back(r);
    }
    // A thin leaf that both sides reach is inside: the walls of the level may be in it. Cracks in the outer walls
    // that only micro gaps join to the void are of no interest to those inside, and go.
    const std::vector<std::uint8_t> from_inside = walk(flow, inhabited);
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
    fill.outside = seep(portals, flow, lost_leaves, [&](std::uint32_t l) { return !lived_in[l]; });
    report_gaps(world, csg, tree, portals, flow, fill.outside, context);
    return fill;
}

} // namespace kiln::bsp

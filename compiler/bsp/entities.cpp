// Who stands where: point entities against the tree, and what follows where the void reaches them.
#include "compiler/bsp/build.h"
#include <algorithm>
#include <fmt/format.h>

namespace kiln {
namespace bsp {
namespace {

// An entity this near to a node's plane touches the leaves on both sides of it. Map units; far below anything a
// designer places by, far above the rounding of what he typed.
constexpr double kTouch = 1e-3;

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

} // namespace

Settlers place_entities(const World& world, const Ground& ground) {
    Settlers placed;
    for (std::size_t e = 1; e < world.entities.size(); ++e) {
        if (!is_placed(world.entities[e])) continue;
        EntityPlace place{id<EntityId>(e), {}, {}};
        // An origin in solid may lie in a floor it stands on, or in a ceiling it hangs from.
        for (const double dz : {0.0, 1.0, -1.0}) {
            place.origin = world.entities[e].origin + Vec3{0, 0, dz};
            for (const LeafId l : leaves_at(ground.nodes, place.origin, kTouch)) {
                const std::vector<std::uint32_t> rooms = ground.rooms(l, place.origin);
                place.rooms.insert(place.rooms.end(), rooms.begin(), rooms.end());
                place.on_solid = place.on_solid || rooms.empty();
            }
            // A shift downwards may prove that it is inside; it proves no leak.
            if (dz < 0 || is_mark(world.entities[e])) std::erase_if(place.rooms, ground.lost);
            if (!place.rooms.empty()) break;
        }
        if (place.rooms.empty()) continue;
        if (std::ranges::all_of(place.rooms, ground.lost))
            placed.leaking.push_back(static_cast<std::uint32_t>(placed.entities.size()));
        else
            placed.inhabited = true;
        placed.entities.push_back(std::move(place));
    }
    return placed;
}

} // namespace bsp

Result<LeakTest> find_leaks(const World& world, const Csg& csg, const Bsp& bsp, const BspOptions& options, Context& context) {
    const bsp::Settlers placed = bsp::place_entities(
        world, {bsp.nodes,
                [&](LeafId l, Vec3) { return bsp.leaves[l.at()].open() ? std::vector{l.value} : std::vector<std::uint32_t>{}; },
                [&](std::uint32_t l) { return bsp.leaves[l].outside; }});
    LeakTest test;
    if (placed.entities.empty()) {
        context.report(Severity::warning, "no-entity-inside",
                       "no point entity stands in the open: whatever the void does not reach is taken as inside; "
                       "leaks cannot be told",
                       {.file = world.file});
        return test;
    }
    if (placed.leaking.empty()) return test;
    // An origin on a wall's outer face is in the wall as much as in the void. Where all that leaks is such and the
    // others are sealed in, there is no leak. (In an open room, what stands on the floor leaks with the rest.)
    const bool excused = placed.inhabited && std::ranges::all_of(placed.leaking, [&](std::uint32_t e) { return placed.entities[e].on_solid; });
    if (!excused) {
        // The finished tree keeps nothing of the outside; the way out is found in the whole one.
        const bsp::Space space(bsp.planes, bsp::world_box(world, csg));
        bsp::Cutter cutter(space);
        const bsp::Tree tree = bsp::build_tree(world, csg, cutter, bsp.box, context);
        const std::vector<BspPortal> portals = bsp::build_portals(cutter, tree);
        const bsp::Flow flow = bsp::make_flow(tree, portals, options.micro_gap);
        const std::vector<std::uint8_t> from_void = bsp::rooms_of_the_void(flow);
        const auto rooms = [&](LeafId l, Vec3 at) {
            return tree.leaves[l.at()].contents == Contents::solid ? std::vector<std::uint32_t>{} : bsp::rooms_at(tree, flow, l, at);
        };
        const bsp::Settlers again =
            bsp::place_entities(world, {tree.nodes, rooms, [&](std::uint32_t r) { return from_void[r] != 0; }});
        std::vector<Leak> leaks = bsp::trace_leaks(world, csg, flow, again);
        if (!leaks.empty()) {
            bsp::report_leaks(world, leaks, options, context);
            test.leak = leaks.front();
            test.leaks = std::move(leaks);
            return test;
        }
    }
    for (const std::uint32_t e : placed.leaking) {
        const WorldEntity& entity = world.entities[placed.entities[e].entity.at()];
        context.report(Severity::warning, "entity-outside",
                       fmt::format("{} at {} lies on the outside of the level and is taken as sealed",
                                   entity.get("classname", "entity"), bsp::name_place(entity.origin)),
                       world.location(placed.entities[e].entity));
    }
    return test;
}

} // namespace kiln

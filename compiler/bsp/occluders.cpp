// Occluders: the polygons that the CSG made of each func_occluder, and the area they lie in.
#include "compiler/bsp/build.h"
#include <algorithm>
#include <fmt/format.h>
#include <map>
#include <set>

namespace kiln::bsp {
namespace {

// Areas of the open leaves that the polygon passes through or lies against.
void collect_areas(const Space& space, const Bsp& bsp, const PlanePolygon& polygon, std::set<std::uint32_t>& areas) {
    std::vector<std::pair<std::int32_t, Poly>> stack;
    Cutter cutter(space);
    stack.emplace_back(bsp.nodes.empty() ? -1 : 0, cutter.make(polygon));
    while (!stack.empty()) {
        auto [at, poly] = stack.back();
        stack.pop_back();
        if (at < 0) {
            if (const std::uint32_t area = bsp.leaves[static_cast<std::size_t>(leaf_of_child(at))].area) areas.insert(area);
            continue;
        }
        const BspNode& node = bsp.nodes[static_cast<std::size_t>(at)];
        if (same_plane(poly.support, node.plane)) {
            stack.emplace_back(node.child[0], cutter.copy(poly));
            stack.emplace_back(node.child[1], poly);
            continue;
        }
        Poly behind;
        const unsigned side = cutter.divide(poly, Splitter(node.plane, node.normal, node.distance), behind);
        if (side & kBack) stack.emplace_back(node.child[1], side == kBoth ? behind : poly);
        if (side & kFront) stack.emplace_back(node.child[0], poly);
    }
}

} // namespace

void find_occluders(const World& world, const Csg& csg, const Space& space, Bsp& bsp, Context& context) {
    std::map<EntityId, Occluder> found;
    for (std::size_t b = 0; b < world.brushes.size(); ++b)
        if (world.brushes[b].contents == Contents::occluder && csg.brushes[b].valid)
            found[world.brushes[b].entity].entity = world.brushes[b].entity;
    if (found.empty()) return;
    for (std::uint32_t f = 0; f < csg.fragments.size(); ++f)
        if (csg.fragments[f].behind == Contents::occluder)
            found[world.brushes[csg.fragments[f].brush.at()].entity].fragments.push_back(f);
    for (auto& [entity, occluder] : found) {
        if (occluder.fragments.empty()) {
            context.report(Severity::warning, "occluder-without-face", "all sides of the occluder are nodraw: it hides nothing", world.location(entity));
            continue;
        }
        std::set<std::uint32_t> areas;
        for (const std::uint32_t f : occluder.fragments) collect_areas(space, bsp, csg.fragments[f].polygon, areas);
        if (areas.size() == 1) occluder.area = *areas.begin();
        if (areas.size() > 1) {
            std::string all;
            for (const std::uint32_t a : areas) all += fmt::format("{}{}", all.empty() ? "" : ", ", a);
            context.report(Severity::warning, "occluder-areas",
                           fmt::format("the occluder reaches into areas {}: it is kept without an area; one in each area works better", all),
                           world.location(entity));
        }
        bsp.occluders.push_back(std::move(occluder));
    }
}

} // namespace kiln::bsp

#include "compiler/bsp/build.h"
#include <algorithm>
#include <cmath>
#include <map>

namespace kiln::bsp {
namespace {

// The part of convex `subject` that lies over convex `mask`, both looked at along unit `way`; in subject's plane.
std::vector<Vec3> overlap_along(std::span<const Vec3> subject, std::span<const Vec3> mask, Vec3 way) {
    std::vector<Vec3> part(subject.begin(), subject.end()), next;
    Vec3 turn{};
    for (std::size_t i = 2; i < mask.size(); ++i) turn += cross(mask[i - 1] - mask[0], mask[i] - mask[0]);
    const double sign = dot(turn, way) >= 0 ? 1 : -1;
    for (std::size_t i = 0; i < mask.size() && !part.empty(); ++i) {
        const Vec3 a = mask[i], inward = cross(way, mask[(i + 1) % mask.size()] - a) * sign;
        next.clear();
        for (std::size_t k = 0; k < part.size(); ++k) {
            const Vec3 p = part[k], q = part[(k + 1) % part.size()];
            const double dp = dot(inward, p - a), dq = dot(inward, q - a);
            if (dp >= 0) next.push_back(p);
            if ((dp > 0 && dq < 0) || (dp < 0 && dq > 0)) next.push_back(p + (q - p) * (dp / (dp - dq)));
        }
        part.swap(next);
    }
    return part.size() < 3 ? std::vector<Vec3>{} : part;
}

struct Opening { // of a thin leaf
    std::uint32_t room;
    std::span<const Vec3> winding;
    std::uint32_t beyond = UINT32_MAX; // leaf
    bool in_stack = false;             // to the next leaf of its stack
};
using Openings = std::map<std::uint32_t, std::vector<Opening>>; // per thin leaf

bool is_wide(std::span<const Vec3> winding, Vec3 way, double micro_gap) {
    const std::vector<Vec3> seen = overlap_along(winding, winding, way);
    return !seen.empty() && width(seen) >= micro_gap;
}

// Thin leaves that lie on one another, with wide portals between, are cut from one crack by something within it. While all of
// them together are thin, they may only be crossed straight, as one leaf may; what is thicker is a way, however it was cut.
void mark_stacks(const Tree& tree, double micro_gap, Openings& openings) {
    std::map<std::uint32_t, bool> seen;
    for (const auto& [first, unused] : openings) {
        if (seen[first]) continue;
        const Vec3 way = tree.leaves[first].thin_way;
        double low = 1e30, high = -1e30;
        std::vector<std::uint32_t> stack{first};
        seen[first] = true;
        const auto lies_along = [&](std::uint32_t l) { return std::abs(dot(tree.leaves[l].thin_way, way)) > 1 - 1e-9; };
        const auto joins = [&](const Opening& o) { return openings.contains(o.beyond) && lies_along(o.beyond) && is_wide(o.winding, way, micro_gap); };
        for (std::size_t i = 0; i < stack.size(); ++i) {
            const TreeLeaf& leaf = tree.leaves[stack[i]];
            const double end = dot(leaf.thin_way, way) > 0 ? leaf.thin_end : leaf.thickness - leaf.thin_end;
            low = std::min(low, end - leaf.thickness), high = std::max(high, end);
            for (const Opening& o : openings.at(stack[i]))
                if (joins(o) && !seen[o.beyond]) seen[o.beyond] = true, stack.push_back(o.beyond);
        }
        if (stack.size() == 1 || high - low >= micro_gap) continue;
        for (const std::uint32_t l : stack)
            for (Opening& o : openings.at(l)) o.in_stack = joins(o);
    }
}

} // namespace

Flow make_flow(const Tree& tree, const std::vector<BspPortal>& portals, double micro_gap) {
    Flow flow;
    flow.micro_gap = micro_gap;
    for (std::uint32_t l = 0; l < tree.leaves.size(); ++l) flow.room_leaf.push_back(l);
    const auto add_room = [&](std::uint32_t leaf) {
        flow.room_leaf.push_back(leaf);
        return static_cast<std::uint32_t>(flow.room_leaf.size() - 1);
    };
    const auto is_thin = [&](std::uint32_t l) { return tree.leaves[l].thickness < micro_gap; };
    Openings openings;
    flow.doors.reserve(portals.size());
    for (const BspPortal& p : portals) {
        Pair rooms{p.leaf_front.value, p.leaf_back.value};
        for (std::size_t side = 0; side < 2; ++side) {
            const std::uint32_t leaf = side ? p.leaf_back.value : p.leaf_front.value;
            if (!is_thin(leaf)) continue;
            rooms[side] = add_room(leaf);
            openings[leaf].push_back({rooms[side], p.winding, side ? p.leaf_front.value : p.leaf_back.value});
        }
        flow.doors.push_back({rooms, p.winding});
    }
    for (const VoidFace& f : tree.void_faces) {
        const std::uint32_t room = is_thin(f.leaf) ? add_room(f.leaf) : f.leaf;
        if (is_thin(f.leaf)) openings[f.leaf].push_back({room, f.winding});
        flow.shore.emplace_back(room, f.winding);
    }
    mark_stacks(tree, micro_gap, openings);
    const auto add_door = [&](std::uint32_t a, std::uint32_t b, std::vector<Vec3> way) {
        flow.ways.push_back(std::move(way));
        flow.doors.push_back({{a, b}, flow.ways.back()});
    };
    std::vector<std::uint32_t> path; // leaves of a stack
    // From an opening through `leaf` over what `footprint` of it leads there.
    const auto cross_from = [&](const auto& self, const Opening& from, std::uint32_t leaf, std::span<const Vec3> footprint) -> void {
        path.push_back(leaf);
        for (const Opening& to : openings.at(leaf)) {
            if (to.room == from.room || (to.in_stack ? std::ranges::find(path, to.beyond) != path.end() : to.room < from.room)) continue;
            std::vector<Vec3> way = overlap_along(footprint, to.winding, tree.leaves[leaf].thin_way);
            if (way.empty() || width(way) < micro_gap) continue;
            if (!to.in_stack) {
                add_door(from.room, to.room, std::move(way));
                continue;
            }
            add_door(from.room, add_room(to.beyond), way); // a room of its own: it is reached, but leads nowhere else
            self(self, from, to.beyond, way);
        }
        path.pop_back();
    };
    for (const auto& [leaf, all] : openings)
        for (const Opening& o : all)
            if (!o.in_stack) cross_from(cross_from, o, leaf, o.winding);
    flow.portals_of = group(tree.leaves.size(), portals.size(),
                            [&](std::size_t p) { return Pair{portals[p].leaf_front.value, portals[p].leaf_back.value}; });
    flow.doors_of = group(flow.room_leaf.size(), flow.doors.size(), [&](std::size_t d) { return flow.doors[d].rooms; });
    return flow;
}

std::vector<std::uint32_t> rooms_at(const Tree& tree, const Flow& flow, LeafId leaf, Vec3 point) {
    if (tree.leaves[leaf.at()].thickness >= flow.micro_gap) return {leaf.value};
    std::vector<std::uint32_t> rooms;
    for (const std::uint32_t p : flow.portals_of[leaf.at()])
        for (const std::uint32_t r : flow.doors[p].rooms)
            if (flow.room_leaf[r] == leaf.value &&
                length(closest_point(flow.doors[p].winding, point) - point) <= 2 * flow.micro_gap)
                rooms.push_back(r);
    return rooms;
}

} // namespace kiln::bsp

#include "compiler/bsp/build.h"
#include <algorithm>
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
    struct Opening {
        std::uint32_t room;
        std::span<const Vec3> winding;
    };
    std::map<std::uint32_t, std::vector<Opening>> openings; // of thin leaves
    flow.doors.reserve(portals.size());
    for (const BspPortal& p : portals) {
        Pair rooms{p.leaf_front.value, p.leaf_back.value};
        for (std::uint32_t& r : rooms) {
            const std::uint32_t leaf = r;
            if (!is_thin(leaf)) continue;
            r = add_room(leaf);
            openings[leaf].push_back({r, p.winding});
        }
        flow.doors.push_back({rooms, p.winding});
    }
    for (const VoidFace& f : tree.void_faces) {
        const std::uint32_t room = is_thin(f.leaf) ? add_room(f.leaf) : f.leaf;
        if (is_thin(f.leaf)) openings[f.leaf].push_back({room, f.winding});
        flow.shore.emplace_back(room, f.winding);
    }
    for (const auto& [leaf, all] : openings)
        for (std::size_t i = 0; i < all.size(); ++i)
            for (std::size_t k = i + 1; k < all.size(); ++k) {
                std::vector<Vec3> way = overlap_along(all[i].winding, all[k].winding, tree.leaves[leaf].thin_way);
                if (way.empty() || width(way) < micro_gap) continue;
                flow.ways.push_back(std::move(way));
                flow.doors.push_back({{all[i].room, all[k].room}, flow.ways.back()});
            }
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

#include "compiler/bsp/build.h"
#include <algorithm>

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

void add_door(Flow& flow, std::uint32_t a, std::uint32_t b, std::vector<Vec3> winding) {
    Door door{{a, b}, std::move(winding), 0, 0};
    door.width = width(door.winding), door.area = area(door.winding);
    for (const std::uint32_t r : door.rooms) flow.doors_of[r].push_back(static_cast<std::uint32_t>(flow.doors.size()));
    flow.doors.push_back(std::move(door));
}

std::uint32_t add_room(Flow& flow, std::uint32_t leaf) {
    flow.room_leaf.push_back(leaf);
    flow.doors_of.emplace_back();
    return static_cast<std::uint32_t>(flow.room_leaf.size() - 1);
}

} // namespace

Flow make_flow(const Tree& tree, const std::vector<BspPortal>& portals, double micro_gap) {
    Flow flow;
    flow.micro_gap = micro_gap;
    flow.portals_of.resize(tree.leaves.size());
    for (std::uint32_t l = 0; l < tree.leaves.size(); ++l) add_room(flow, l);
    const auto is_thin = [&](std::uint32_t l) { return tree.leaves[l].thickness < micro_gap; };
    struct Opening {
        std::uint32_t room;
        std::vector<Vec3> winding;
    };
    std::vector<std::vector<Opening>> openings(tree.leaves.size()); // of thin leaves
    for (std::uint32_t p = 0; p < portals.size(); ++p) {
        std::array<std::uint32_t, 2> rooms{portals[p].leaf_front.value, portals[p].leaf_back.value};
        for (std::uint32_t& r : rooms) {
            const std::uint32_t leaf = r;
            flow.portals_of[leaf].push_back(p);
            if (!is_thin(leaf)) continue;
            r = add_room(flow, leaf);
            openings[leaf].push_back({r, portals[p].winding});
        }
        add_door(flow, rooms[0], rooms[1], portals[p].winding);
    }
    for (std::uint32_t l = 0; l < tree.leaves.size(); ++l)
        for (const std::vector<Vec3>& face : tree.leaves[l].void_faces) {
            const std::uint32_t room = is_thin(l) ? add_room(flow, l) : l;
            if (is_thin(l)) openings[l].push_back({room, face});
            flow.shore.emplace_back(room, face);
        }
    for (std::uint32_t l = 0; l < tree.leaves.size(); ++l)
        for (std::size_t i = 0; i < openings[l].size(); ++i)
            for (std::size_t k = i + 1; k < openings[l].size(); ++k) {
                std::vector<Vec3> way =
                    overlap_along(openings[l][i].winding, openings[l][k].winding, tree.leaves[l].thin_way);
                if (!way.empty() && width(way) >= micro_gap)
                    add_door(flow, openings[l][i].room, openings[l][k].room, std::move(way));
            }
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

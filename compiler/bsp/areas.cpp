// Areas, and the brushes between them.
#include "compiler/bsp/build.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <queue>
#include <set>

namespace kiln::bsp {
namespace {

// Where an area portal's leaves border a leaf of an area.
struct Contact {
    std::uint32_t portal = 0, area = 0;
    PlaneId facing; // the portal's plane, looking to it
    double size = 0;
};

struct Sides { // of an area portal: how much of each area lies before each of the brush's planes
    std::map<std::pair<PlaneId, std::uint32_t>, double> size;
    std::map<std::uint32_t, double> areas;
    // The plane with most of the area before it, of those that look against `against`; 0: any area or any plane.
    std::optional<PlaneId> largest(const PlaneTable& planes, std::uint32_t area, std::optional<PlaneId> against) const {
        std::map<PlaneId, double> sum;
        for (const auto& [key, value] : size)
            if (area == 0 || key.second == area) sum[key.first] += value;
        std::optional<PlaneId> best;
        double most = 0;
        for (const auto& [plane, value] : sum) {
            if (against && !(dot(planes.normal(plane), planes.normal(*against)) < 0)) continue;
            if (value > most) most = value, best = plane;
        }
        return best;
    }
};

// The plane midway between two planes of a brush that look apart, facing as `a` does.
PlaneId midway(PlaneTable& planes, PlaneId a, PlaneId b, Vec3 on_a, Vec3 on_b) {
    constexpr std::int64_t kLargest = std::int64_t{1} << 60; // twice that is still a plane of the table
    const ExactPlane p = planes.planes[a.at()], q = planes.planes[b.at()];
    const auto small = [](std::int64_t v) { return v < kLargest && v > -kLargest; };
    if (p.a == -q.a && p.b == -q.b && p.c == -q.c && small(p.a) && small(p.b) && small(p.c)) {
        ExactPlane middle;
        middle.a = 2 * p.a, middle.b = 2 * p.b, middle.c = 2 * p.c, middle.d = p.d - q.d;
        return planes.add(middle);
    }
    // Not parallel: any plane between them will do.
    constexpr double kSteps = 1024;
    const Vec3 n = normalize(planes.normal(a) - planes.normal(b));
    ExactPlane middle;
    middle.a = std::llround(n.x * kSteps), middle.b = std::llround(n.y * kSteps), middle.c = std::llround(n.z * kSteps);
    const Vec3 through = (on_a + on_b) * 0.5;
    const Vec3 normal{static_cast<double>(middle.a), static_cast<double>(middle.b), static_cast<double>(middle.c)};
    middle.d = static_cast<__int128>(std::llround(dot(normal, through) * std::ldexp(1.0, planes.grid_bits)));
    return planes.add(middle);
}

// From the middle of one portal to that of another, within the rooms of one area: Dijkstra over doors.
std::vector<Vec3> way_around(const Flow& flow, const Areas& areas, const Contact& from, const Contact& to) {
    struct Step {
        double distance;
        std::uint32_t door;
        auto operator<=>(const Step&) const = default;
    };
    constexpr std::uint32_t kNone = UINT32_MAX;
    std::vector<double> distance(flow.doors.size(), HUGE_VAL);
    std::vector<std::uint32_t> before(flow.doors.size(), kNone);
    std::vector<std::uint8_t> settled(flow.doors.size());
    std::priority_queue<Step, std::vector<Step>, std::greater<>> queue;
    distance[from.portal] = 0;
    queue.push({0, from.portal});
    while (!queue.empty()) {
        const Step step = queue.top();
        queue.pop();
        if (settled[step.door]) continue;
        settled[step.door] = 1;
        if (step.door == to.portal) break;
        const Vec3 at = centroid(flow.doors[step.door].winding);
        for (const std::uint32_t room : flow.doors[step.door].rooms) {
            if (areas.of_room[room] != from.area) continue;
            for (const std::uint32_t d : flow.doors_of[room]) {
                if (settled[d] || !flow.open(d)) continue;
                const double way = step.distance + length(centroid(flow.doors[d].winding) - at);
                if (way >= distance[d]) continue;
                distance[d] = way, before[d] = step.door;
                queue.push({way, d});
            }
        }
    }
    std::vector<Vec3> way;
    for (std::uint32_t d = to.portal; d != kNone; d = before[d]) way.push_back(centroid(flow.doors[d].winding));
    std::ranges::reverse(way);
    return way;
}

} // namespace

Areas find_areas(const Tree& tree, const std::vector<BspPortal>& portals, const Flow& flow, const std::vector<std::uint8_t>& outside) {
    const std::size_t leaves = tree.leaves.size(), rooms = flow.room_leaf.size();
    const auto has_area = [&](std::size_t l) {
        return tree.leaves[l].contents != Contents::solid && !outside[l] && tree.leaves[l].area_portals.empty();
    };
    const auto other = [](const auto& pair, std::uint32_t one) { return pair[pair[0] == one ? 1 : 0]; };
    // Regions: rooms that hang together through doors that are no micro gaps. One that has an area portal before it is an area of
    // its own; but not the slit beside an area portal, which is no place to be in.
    Areas areas;
    areas.of_room.assign(rooms, 0), areas.of_leaf.assign(leaves, 0);
    std::vector<std::uint8_t> met(rooms);
    std::vector<std::uint32_t> region;
    std::uint32_t labels = 0;
    for (std::uint32_t start = 0; start < rooms; ++start) {
        if (met[start] || !has_area(flow.room_leaf[start])) continue;
        bool at_portal = false;
        region.assign(1, start), met[start] = 1;
        for (std::size_t i = 0; i < region.size(); ++i) {
            const std::uint32_t room = region[i];
            for (const std::uint32_t d : flow.doors_of[room]) {
                const std::uint32_t next = other(flow.doors[d].rooms, room), leaf = flow.room_leaf[next];
                const bool portal = !tree.leaves[leaf].area_portals.empty() && !outside[leaf];
                if ((portal && at_portal) || (!portal && (met[next] || !has_area(leaf))) || !flow.open(d)) continue;
                if (portal) at_portal = true;
                else met[next] = 1, region.push_back(next);
            }
        }
        const bool slit = region.size() == 1 && tree.leaves[flow.room_leaf[start]].thickness < flow.micro_gap;
        if (!at_portal || slit) continue;
        ++labels;
        for (const std::uint32_t room : region) areas.of_room[room] = labels;
    }
    // A leaf has the area of its room; a thin one that several reach, of that which is largest on it.
    std::vector<std::uint32_t> queue;
    for (std::uint32_t l = 0; l < leaves; ++l) {
        if (!has_area(l)) continue;
        if (tree.leaves[l].thickness >= flow.micro_gap) {
            areas.of_leaf[l] = areas.of_room[l];
        } else {
            std::map<std::uint32_t, double> size;
            for (const std::uint32_t p : flow.portals_of[l])
                for (const std::uint32_t r : flow.doors[p].rooms)
                    if (flow.room_leaf[r] == l && areas.of_room[r]) size[areas.of_room[r]] += area(flow.doors[p].winding);
            double most = -1;
            for (const auto& [label, sum] : size)
                if (sum > most) most = sum, areas.of_leaf[l] = label;
        }
        if (areas.of_leaf[l]) queue.push_back(l);
    }
    // All others belong to what they hang on, however thin the way; where that is none, they are areas of their own.
    const auto spread = [&] {
        for (std::size_t i = 0; i < queue.size(); ++i)
            for (const std::uint32_t p : flow.portals_of[queue[i]]) {
                const std::uint32_t next = other(std::array{portals[p].leaf_front.value, portals[p].leaf_back.value}, queue[i]);
                if (areas.of_leaf[next] || !has_area(next)) continue;
                areas.of_leaf[next] = areas.of_leaf[queue[i]];
                queue.push_back(next);
            }
        queue.clear();
    };
    spread();
    for (std::uint32_t l = 0; l < leaves; ++l)
        if (has_area(l) && !areas.of_leaf[l]) areas.of_leaf[l] = ++labels, queue.push_back(l), spread();
    // Numbers in the order of leaves.
    std::vector<std::uint32_t> number(labels + std::size_t{1});
    for (std::uint32_t& a : areas.of_leaf)
        if (a) a = number[a] ? number[a] : number[a] = ++areas.count;
    for (std::uint32_t& a : areas.of_room) a = number[a];
    return areas;
}

void find_area_portals(const World& world, const Csg& csg, const Tree& tree, const std::vector<BspPortal>& portals, const Flow& flow,
                       const Areas& areas, Bsp& bsp, bool report, Context& context) {
    std::vector<BrushId> brushes;
    for (std::size_t b = 0; b < world.brushes.size(); ++b)
        if (csg.brushes[b].valid && world.brushes[b].model.value == 0 && world.brushes[b].contents == Contents::area_portal)
            brushes.push_back(id<BrushId>(b));
    if (brushes.empty()) return;
    std::map<BrushId, std::vector<Contact>> contacts_of;
    for (std::uint32_t p = 0; p < portals.size(); ++p)
        for (const bool back : {false, true}) {
            const std::uint32_t in = flow.room_leaf[flow.doors[p].rooms[back]], room = flow.doors[p].rooms[!back];
            if (tree.leaves[in].area_portals.empty() || !areas.of_room[room] || !flow.open(p)) continue;
            for (const BrushId b : tree.leaves[in].area_portals)
                contacts_of[b].push_back({p, areas.of_room[room], back ? portals[p].plane : flipped(portals[p].plane), area(portals[p].winding)});
        }
    // Other area portals against the side of `b` that looks away from `facing` (or any side): their names.
    const auto portals_behind = [&](BrushId b, std::optional<PlaneId> facing) {
        const auto has = [b](const auto& list) { return std::ranges::find(list, b) != list.end(); };
        std::set<BrushId> found;
        for (const BspPortal& p : portals)
            for (const bool back : {false, true}) {
                const auto& mine = tree.leaves[(back ? p.leaf_back : p.leaf_front).at()].area_portals;
                const auto& others = tree.leaves[(back ? p.leaf_front : p.leaf_back).at()].area_portals;
                if (!has(mine) || has(others)) continue;
                if (facing && !(dot(bsp.planes.normal(back ? p.plane : flipped(p.plane)), bsp.planes.normal(*facing)) < 0)) continue;
                found.insert(others.begin(), others.end());
            }
        std::string names;
        for (const BrushId other : found) names += (names.empty() ? "" : ", ") + name_of_unsealing(world, other);
        return names;
    };
    std::size_t trails = 0;
    for (const BrushId b : brushes) {
        const BrushPolytope& brush = csg.brushes[b.at()];
        const std::vector<Contact>& contacts = contacts_of[b];
        AreaPortal out;
        out.brush = b;
        Sides sides;
        for (const Contact& c : contacts) sides.size[{c.facing, c.area}] += c.size, sides.areas[c.area] += c.size;
        std::vector<std::pair<double, std::uint32_t>> by_size;
        for (const auto& [area, size] : sides.areas) by_size.emplace_back(-size, area);
        std::ranges::sort(by_size);

        const WorldEntity& entity = world.entities[world.brushes[b.at()].entity.at()];
        const std::string name = entity.get("targetname").empty() ? std::string(entity.get("classname", "the area portal"))
                                                                  : fmt::format("{} '{}'", entity.get("classname"), entity.get("targetname"));
        const auto tell = [&](const char* code, const std::string& message) {
            if (report) context.report(Severity::warning, code, fmt::format("{} {}", name, message), world.location(b));
        };
        std::optional<PlaneId> first, second;
        if (by_size.size() >= 2) {
            out.areas = {std::min(by_size[0].second, by_size[1].second), std::max(by_size[0].second, by_size[1].second)};
            first = sides.largest(bsp.planes, out.areas[0], std::nullopt);
            second = sides.largest(bsp.planes, out.areas[1], first);
            if (by_size.size() > 2) {
                std::string all;
                for (const auto& [size, area] : by_size) all += fmt::format("{}{}", all.empty() ? "" : ", ", area);
                tell("areaportal-areas", fmt::format("touches {} areas ({}); it can part only two, and takes {} and {}", by_size.size(), all,
                                                     out.areas[0], out.areas[1]));
            }
        } else if (by_size.size() == 1) {
            first = sides.largest(bsp.planes, 0, std::nullopt);
            second = sides.largest(bsp.planes, 0, first);
            const std::uint32_t area = by_size[0].second;
            out.areas = {second ? area : 0, area};
            const auto at = [&](PlaneId plane) {
                const Contact* best = nullptr;
                for (const Contact& c : contacts)
                    if (c.facing == plane && (!best || c.size > best->size)) best = &c;
                return *best;
            };
            if (second) {
                const Contact from = at(*first), to = at(*second);
                const Vec3 a = centroid(portals[from.portal].winding), z = centroid(portals[to.portal].winding);
                if (report) out.leak = way_around(flow, areas, from, to);
                Vec3 far = a;
                for (const Vec3& p : out.leak)
                    if (length(p - brush.bounds.center()) > length(far - brush.bounds.center())) far = p;
                tell("areaportal-leak", fmt::format("does not part the level: both its sides, at {} and {}, are area {}; a way of {:.0f} units leads "
                                                    "around it through {} (trail areaportal{})",
                                                    name_place(a), name_place(z), area, path_length(out.leak), name_place(far), ++trails));
            } else {
                const std::string behind = portals_behind(b, first);
                tell("areaportal-one-side", fmt::format("is open to one side only, to area {} at {}: behind it is {}", area,
                                                        name_place(centroid(portals[at(*first).portal].winding)),
                                                        behind.empty() ? "solid or the outside" : behind + "; make them one brush"));
            }
        } else {
            const std::string beside = portals_behind(b, std::nullopt);
            tell("areaportal-closed", beside.empty() ? "touches no open space of the level: it lies in solid or outside"
                                                     : "touches no open space of the level, only " + beside + "; make them one brush");
        }
        if (first && !second) { // the brush's own face that looks the other way most
            double least = 0;
            for (const PlanePolygon& f : brush.faces)
                if (const double d = dot(bsp.planes.normal(f.support), bsp.planes.normal(*first)); d < least) least = d, second = f.support;
        }
        if (first && second) {
            const auto on = [&](PlaneId plane) {
                for (const PlanePolygon& f : brush.faces)
                    if (f.support == plane) return centroid(points(bsp.planes, f));
                return brush.bounds.center();
            };
            const Vec3 on_first = on(*first), on_second = on(*second);
            PlanePolygon polygon = plane_quad(bsp.planes, bsp.box, midway(bsp.planes, *first, *second, on_first, on_second));
            bool left = true;
            for (const PlanePolygon& f : brush.faces) left = left && clip_to_back(bsp.planes, polygon, f.support);
            if (left) out.polygon = std::move(polygon), out.winding = points(bsp.planes, out.polygon);
        }
        bsp.area_portals.push_back(std::move(out));
    }
}

} // namespace kiln::bsp

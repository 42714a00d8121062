// Areas, and the brushes between them.
#include "compiler/bsp/build.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <queue>

namespace kiln::bsp {
namespace {

bool inside(const BspLeaf& l) { return l.open() && !l.outside; }

// Where an area portal's leaves border a leaf of an area.
struct Contact {
    std::uint32_t portal = 0, area = 0;
    LeafId beyond;  // the leaf of the area
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

// From the middle of one portal to that of another, within the leaves of one area: Dijkstra over portals.
std::vector<Vec3> way_around(const Bsp& bsp, const std::vector<std::vector<std::uint32_t>>& portals_of, const Contact& from, const Contact& to) {
    struct Step {
        double distance;
        std::uint32_t portal;
        auto operator<=>(const Step&) const = default;
    };
    constexpr std::uint32_t kNone = UINT32_MAX;
    std::vector<double> distance(bsp.portals.size(), HUGE_VAL);
    std::vector<std::uint32_t> before(bsp.portals.size(), kNone);
    std::vector<std::uint8_t> settled(bsp.portals.size());
    std::priority_queue<Step, std::vector<Step>, std::greater<>> queue;
    distance[from.portal] = 0;
    queue.push({0, from.portal});
    while (!queue.empty()) {
        const Step step = queue.top();
        queue.pop();
        if (settled[step.portal]) continue;
        settled[step.portal] = 1;
        if (step.portal == to.portal) break;
        const Vec3 at = centroid(bsp.portals[step.portal].winding);
        for (const LeafId l : {bsp.portals[step.portal].leaf_front, bsp.portals[step.portal].leaf_back}) {
            if (bsp.leaves[l.at()].area != from.area) continue;
            for (const std::uint32_t p : portals_of[l.at()]) {
                const double d = step.distance + length(centroid(bsp.portals[p].winding) - at);
                if (settled[p] || d >= distance[p]) continue;
                distance[p] = d, before[p] = step.portal;
                queue.push({d, p});
            }
        }
    }
    std::vector<Vec3> way;
    for (std::uint32_t p = to.portal; p != kNone; p = before[p]) way.push_back(centroid(bsp.portals[p].winding));
    std::ranges::reverse(way);
    return way;
}

double length_of_way(const std::vector<Vec3>& way) {
    double sum = 0;
    for (std::size_t i = 1; i < way.size(); ++i) sum += length(way[i] - way[i - 1]);
    return sum;
}

} // namespace

void number_areas(Bsp& bsp, const std::vector<std::vector<BrushId>>& portals_in) {
    std::vector<std::vector<std::uint32_t>> neighbours(bsp.leaves.size());
    for (const BspPortal& p : bsp.portals) {
        neighbours[p.leaf_front.at()].push_back(p.leaf_back.value);
        neighbours[p.leaf_back.at()].push_back(p.leaf_front.value);
    }
    for (std::uint32_t l = 0; l < bsp.leaves.size(); ++l) {
        if (!inside(bsp.leaves[l]) || bsp.leaves[l].area || !portals_in[l].empty()) continue;
        bsp.leaves[l].area = ++bsp.area_count;
        std::vector<std::uint32_t> stack{l};
        while (!stack.empty()) {
            const std::uint32_t at = stack.back();
            stack.pop_back();
            for (const std::uint32_t n : neighbours[at])
                if (!bsp.leaves[n].area && portals_in[n].empty()) bsp.leaves[n].area = bsp.area_count, stack.push_back(n);
        }
    }
}

void find_area_portals(const World& world, const Csg& csg, const std::vector<std::vector<BrushId>>& portals_in, Bsp& bsp,
                       bool report, Context& context) {
    std::vector<BrushId> brushes;
    for (std::size_t b = 0; b < world.brushes.size(); ++b)
        if (csg.brushes[b].valid && world.brushes[b].model.value == 0 && world.brushes[b].contents == Contents::area_portal)
            brushes.push_back(id<BrushId>(b));
    if (brushes.empty()) return;
    const auto holds = [&](LeafId l, BrushId b) { return std::ranges::binary_search(portals_in[l.at()], b); };
    std::vector<std::vector<std::uint32_t>> portals_of(bsp.leaves.size());
    std::map<BrushId, std::vector<Contact>> contacts_of;
    for (std::uint32_t p = 0; p < bsp.portals.size(); ++p) {
        const BspPortal& portal = bsp.portals[p];
        for (const bool back : {false, true}) {
            const LeafId in = back ? portal.leaf_back : portal.leaf_front, out = back ? portal.leaf_front : portal.leaf_back;
            portals_of[in.at()].push_back(p);
            if (bsp.leaves[out.at()].area == 0) continue;
            for (const BrushId b : portals_in[in.at()])
                if (!holds(out, b))
                    contacts_of[b].push_back({p, bsp.leaves[out.at()].area, out, back ? portal.plane : flipped(portal.plane), area(portal.winding)});
        }
    }
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
                const Vec3 a = centroid(bsp.portals[from.portal].winding), z = centroid(bsp.portals[to.portal].winding);
                if (report) out.leak = way_around(bsp, portals_of, from, to);
                Vec3 far = a;
                for (const Vec3& p : out.leak)
                    if (length(p - brush.bounds.center()) > length(far - brush.bounds.center())) far = p;
                tell("areaportal-leak", fmt::format("does not part the level: both its sides, at {} and {}, are area {}; a way of {:.0f} units leads "
                                                    "around it through {}",
                                                    name_place(a), name_place(z), area, length_of_way(out.leak), name_place(far)));
            } else {
                tell("areaportal-one-side", fmt::format("is open to one side only, to area {} at {}: behind it is solid or the outside", area,
                                                        name_place(centroid(bsp.portals[at(*first).portal].winding))));
            }
        } else {
            tell("areaportal-closed", "touches no open space of the level: it lies in solid or outside");
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

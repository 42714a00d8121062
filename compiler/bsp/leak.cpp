// Leaks: the openings that part the entities from the void at least total area (a minimum cut of the portals),
// and the shortest way out through each of them.
#include "compiler/bsp/build.h"
#include "compiler/bsp/min_cut.h"
#include "compiler/bsp/trail.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numeric>

namespace kiln::bsp {
namespace {

constexpr std::size_t kNearBrushes = 8;
constexpr std::size_t kMostLeakReports = 16, kMostLeaks = 256;
constexpr std::size_t kMostPassesNamed = 4;
// Steps of the cut: about a second. Levels of usual size with a hole or ten take thousands; what takes more is open
// to the void all over, and then the narrowest door of the shortest way out says as much.
constexpr std::uint64_t kCutSteps = 100'000'000;

// Least extent of points in the plane across `n`: across one of the winding edges that they came from, or nearly.
double width_of(std::span<const std::vector<Vec3>> windings, Vec3 n) {
    double least = 1e300;
    for (const std::vector<Vec3>& w : windings)
        for (std::size_t i = 0; i < w.size(); ++i) {
            const Vec3 across = cross(n, w[(i + 1) % w.size()] - w[i]);
            const double l = length(across);
            if (!(l > 0)) continue;
            double lo = 1e300, hi = -1e300;
            for (const std::vector<Vec3>& other : windings)
                for (const Vec3& p : other) lo = std::min(lo, dot(across, p) / l), hi = std::max(hi, dot(across, p) / l);
            least = std::min(least, hi - lo);
        }
    return least < 1e300 ? least : 0;
}

// What a designer may have thought to seal. Triggers, hints and their like nobody does.
bool may_seem_sealing(const WorldBrush& b) {
    switch (b.contents) {
    case Contents::solid: return b.model.value != 0;
    case Contents::detail: case Contents::window: case Contents::grate: case Contents::water: case Contents::slime: case Contents::lava:
    case Contents::area_portal: case Contents::clip: return true;
    default: return false;
    }
}

// Brushes that the path goes through without being stopped, by their distance from the hole.
std::vector<BrushId> passes_of(const World& world, const Csg& csg, std::span<const Vec3> path, Vec3 hole) {
    constexpr double kThrough = 1e-3; // map units of the path inside; less is touching
    std::vector<std::pair<std::int64_t, BrushId>> found;
    for (std::size_t b = 0; b < csg.brushes.size(); ++b) {
        const BrushPolytope& brush = csg.brushes[b];
        if (!brush.valid || !may_seem_sealing(world.brushes[b])) continue;
        double least = 1e300;
        for (std::size_t i = 1; i < path.size(); ++i) {
            const Vec3 p = path[i - 1], q = path[i];
            Box3 way;
            way.add(p), way.add(q);
            if (!overlap(way, brush.bounds)) continue;
            double from = 0, to = 1;
            for (const PlanePolygon& f : brush.faces) {
                const Vec3 n = csg.planes.normal(f.support);
                const double d = csg.planes.distance(f.support), s = dot(n, p) - d, e = dot(n, q) - d;
                if (s > 0 && e > 0) from = 1, to = 0;
                else if (s > 0) from = std::max(from, s / (s - e));
                else if (e > 0) to = std::min(to, s / (s - e));
            }
            const double l = length(q - p);
            if ((to - from) * l < kThrough) continue;
            const double t = std::clamp(dot(hole - p, q - p) / (l * l), from, to);
            least = std::min(least, length(p + (q - p) * t - hole));
        }
        if (least < 1e300) found.emplace_back(std::llround(least * 64), id<BrushId>(b)); // rounding does not decide the order
    }
    std::ranges::sort(found);
    std::vector<BrushId> passes;
    for (const auto& [distance, b] : found) passes.push_back(b);
    return passes;
}

} // namespace

Box3 box_of(std::span<const Vec3> points, double margin) {
    Box3 b;
    for (const Vec3& p : points) b.add(p);
    b.lo = b.lo - Vec3{margin, margin, margin}, b.hi = b.hi + Vec3{margin, margin, margin};
    return b;
}

std::string name_place(Vec3 p) {
    const auto number = [](double x) {
        const double r = std::round(x * 1000) / 1000;
        return fmt::format("{}", r == 0 ? 0.0 : r); // no "-0"
    };
    return fmt::format("({} {} {})", number(p.x), number(p.y), number(p.z));
}

std::string name_brushes(const World& world, std::span<const BrushId> brushes) {
    std::string text;
    for (const BrushId b : brushes) {
        const SourceLocation at = world.location(b);
        if (!text.empty()) text += ", ";
        text += at.entity > 0 ? fmt::format("{} of entity {} (line {})", at.brush, at.entity, at.line)
                              : fmt::format("{} (line {})", at.brush, at.line);
    }
    return text.empty() ? "none" : text;
}

std::vector<BrushId> brushes_near(const World& world, const Csg& csg, std::span<const Vec3> opening,
                                  std::size_t count) {
    const Box3 about = box_of(opening, 64);
    std::vector<std::pair<std::int64_t, BrushId>> found;
    for (std::size_t b = 0; b < csg.brushes.size(); ++b) {
        const BrushPolytope& brush = csg.brushes[b];
        if (!brush.valid || world.brushes[b].model.value != 0 || world.brushes[b].contents != Contents::solid) continue;
        if (!overlap(brush.bounds, about)) continue;
        // Its farthest face plane is a lower bound of a point's distance and zero where the opening touches it.
        double least = 1e30;
        for (const Vec3& p : opening) {
            double d = 0;
            for (const PlanePolygon& f : brush.faces)
                d = std::max(d, dot(csg.planes.normal(f.support), p) - csg.planes.distance(f.support));
            least = std::min(least, d);
        }
        found.emplace_back(std::llround(least * 64), id<BrushId>(b)); // rounding does not decide the order
    }
    std::ranges::sort(found);
    std::vector<BrushId> near;
    for (std::size_t i = 0; i < std::min(count, found.size()); ++i) near.push_back(found[i].second);
    return near;
}

std::vector<std::uint32_t> touching(std::span<const Box3> boxes) {
    std::vector<std::uint32_t> root(boxes.size());
    std::iota(root.begin(), root.end(), 0u);
    const auto find = [&](std::uint32_t i) {
        while (root[i] != i) i = root[i] = root[root[i]];
        return i;
    };
    std::vector<std::uint32_t> by_x(root);
    std::ranges::stable_sort(by_x, [&](auto a, auto b) { return boxes[a].lo.x < boxes[b].lo.x; });
    for (std::size_t i = 0; i < by_x.size(); ++i)
        for (std::size_t j = i + 1; j < by_x.size() && boxes[by_x[j]].lo.x <= boxes[by_x[i]].hi.x; ++j)
            if (overlap(boxes[by_x[i]], boxes[by_x[j]])) {
                const std::uint32_t a = find(by_x[i]), b = find(by_x[j]);
                root[std::max(a, b)] = std::min(a, b);
            }
    std::vector<std::uint32_t> number(boxes.size()), result;
    std::uint32_t next = 0;
    for (std::uint32_t i = 0; i < boxes.size(); ++i) {
        if (find(i) == i) number[i] = next++;
        result.push_back(number[find(i)]);
    }
    return result;
}

std::vector<Leak> trace_leaks(const World& world, const Csg& csg, const Flow& flow, const Settlers& placed) {
    std::vector<std::uint8_t> on_shore(flow.room_leaf.size());
    for (const auto& [room, face] : flow.shore) on_shore[room] = 1;
    std::vector<std::uint32_t> starts, exposed; // into placed.entities
    for (const std::uint32_t e : placed.leaking) {
        const bool in_void = std::ranges::any_of(placed.entities[e].rooms, [&](std::uint32_t r) { return on_shore[r]; });
        (in_void ? exposed : starts).push_back(e);
    }
    std::vector<std::uint8_t> closed(flow.doors.size());
    for (std::uint32_t d = 0; d < flow.doors.size(); ++d) closed[d] = !flow.open(d);

    std::vector<Leak> leaks;
    const auto add = [&](const Trail& trail, std::span<const Vec3> about, Vec3 hole, double opening, double wide) {
        Leak leak;
        leak.area = opening, leak.width = wide;
        leak.entity = placed.entities[trail.start].entity;
        leak.path = trail.points;
        leak.hole = hole;
        leak.near = brushes_near(world, csg, about, kNearBrushes);
        leak.length = path_length(trail.points);
        if (opening > 0) leak.passes = passes_of(world, csg, trail.points, hole);
        leaks.push_back(std::move(leak));
    };
    if (!starts.empty()) {
        MinCut cut(flow.room_leaf.size());
        for (std::uint32_t d = 0; d < flow.doors.size(); ++d)
            if (!closed[d]) cut.connect(flow.doors[d].rooms[0], flow.doors[d].rooms[1], area(flow.doors[d].winding), d);
        for (const std::uint32_t e : starts)
            for (const std::uint32_t r : placed.entities[e].rooms) cut.source(r);
        for (std::uint32_t r = 0; r < on_shore.size(); ++r)
            if (on_shore[r]) cut.sink(r);
        std::vector<std::uint32_t> cuts;
        if (auto least = cut.run(kCutSteps)) {
            cuts = std::move(*least);
        } else if (const auto trail = shortest_trail(flow, placed.entities, starts, closed); trail && !trail->doors.empty()) {
            cuts = {*std::ranges::min_element(trail->doors, {}, [&](std::uint32_t d) { return area(flow.doors[d].winding); })};
        }
        std::vector<Box3> boxes;
        for (const std::uint32_t d : cuts) boxes.push_back(box_of(flow.doors[d].winding, 0.5));
        const std::vector<std::uint32_t> hole_of = touching(boxes);
        const std::uint32_t count = cuts.empty() ? 0 : 1 + *std::ranges::max_element(hole_of);
        for (std::uint32_t h = 0; h < count && leaks.size() < kMostLeaks; ++h) {
            std::vector<std::uint8_t> shut = closed;
            std::vector<Vec3> about;
            std::vector<std::vector<Vec3>> windings;
            Vec3 middle{}, facing{};
            double total = 0, largest = -1;
            for (std::size_t i = 0; i < cuts.size(); ++i) {
                const Door& door = flow.doors[cuts[i]];
                if (hole_of[i] != h) {
                    shut[cuts[i]] = 1;
                    continue;
                }
                const double size = area(door.winding);
                about.insert(about.end(), door.winding.begin(), door.winding.end());
                windings.emplace_back(door.winding.begin(), door.winding.end());
                if (size > largest) largest = size, facing = normalize(cross(door.winding[1] - door.winding[0], door.winding[2] - door.winding[0]));
                middle += centroid(door.winding) * size, total += size;
            }
            const std::optional<Trail> trail = shortest_trail(flow, placed.entities, starts, shut);
            if (!trail) continue;
            middle = total > 0 ? middle / total : about.front();
            Vec3 hole = about.front(); // the middle of an opening around a corner is not in it
            for (std::size_t i = 0; i < cuts.size(); ++i)
                if (hole_of[i] == h)
                    if (const Vec3 c = closest_point(flow.doors[cuts[i]].winding, middle);
                        length(c - middle) < length(hole - middle))
                        hole = c;
            add(*trail, about, hole, total, width_of(windings, facing));
        }
    }
    std::ranges::stable_sort(leaks, {}, &Leak::length);
    for (const std::uint32_t e : exposed) {
        if (leaks.size() >= kMostLeaks) break;
        const std::vector<std::uint32_t> one{e};
        const std::optional<Trail> trail = shortest_trail(flow, placed.entities, one, closed);
        if (!trail) continue;
        const Vec3 at = placed.entities[e].origin;
        add(*trail, std::span(&at, 1), at, 0, 0);
    }
    return leaks;
}

void report_leaks(const World& world, const std::vector<Leak>& leaks, const BspOptions& options, Context& context) {
    const Severity severity = options.allow_leaks ? Severity::warning : Severity::error;
    const auto number = [](double x) { return fmt::format("{}", std::round(x * 1000) / 1000); };
    for (std::size_t i = 0; i < leaks.size() && i < kMostLeakReports; ++i) {
        const Leak& leak = leaks[i];
        const WorldEntity& e = world.entities[leak.entity.at()];
        std::string text = fmt::format("leak: entity {} at {} ", e.get("classname", "(no classname)"), name_place(e.origin));
        if (leak.area > 0)
            text += fmt::format("reaches the void through the opening at {}, {} wide, {} square units; ", name_place(leak.hole), number(leak.width), number(leak.area));
        else text += "stands in the void; ";
        text += fmt::format("path of {:.0f} units; ", leak.length);
        for (std::size_t k = 0; k < std::min(leak.passes.size(), kMostPassesNamed); ++k)
            text += fmt::format("{}{}", k == 0 ? "it passes through " : ", ", name_of_unsealing(world, leak.passes[k]));
        if (leak.passes.size() > kMostPassesNamed) text += fmt::format(" and {} more", leak.passes.size() - kMostPassesNamed);
        if (!leak.passes.empty()) text += leak.passes.size() == 1 ? ", which does not seal; " : ", which do not seal; ";
        context.report(severity, "leak", text + "nearest brushes: " + name_brushes(world, leak.near), world.location(leak.entity));
    }
    if (leaks.size() > kMostLeakReports)
        context.report(severity, "leak",
                       fmt::format("and {}{} more leaks; --report lists them", leaks.size() < kMostLeaks ? "" : "at least ", leaks.size() - kMostLeakReports),
                       {.file = world.file});
}

} // namespace kiln::bsp

namespace kiln {

std::string name_of_unsealing(const World& world, BrushId brush) {
    const WorldBrush& b = world.brushes[brush.at()];
    const WorldEntity& e = world.entities[b.entity.at()];
    const SourceLocation at = world.location(brush);
    const auto kind = [&]() -> std::string {
        if (b.displaced) return "displacement";
        switch (b.contents) {
        case Contents::window: return "window";
        case Contents::grate: return "grate";
        case Contents::water: return "water";
        case Contents::slime: return "slime";
        case Contents::lava: return "lava";
        case Contents::clip: return "clip";
        case Contents::area_portal: return "area portal";
        default: return "detail";
        }
    };
    const std::string line = world.file == at.file ? fmt::format("line {}", at.line) : fmt::format("{}:{}", at.file, at.line);
    // An entity names itself; what it holds is told where its name does not.
    if (b.entity.value == 0) return fmt::format("{} brush {} ({})", kind(), at.brush, line);
    const std::string_view name = e.get("classname", "entity");
    const bool told = opaque(b.contents);
    return fmt::format("{}{} {} ({})", told && !b.displaced ? "" : kind() + " of ", name, at.brush, line);
}

} // namespace kiln

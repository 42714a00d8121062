#include "compiler/bsp/trail.h"
#include <algorithm>
#include <cmath>
#include <queue>

namespace kiln {

double path_length(std::span<const Vec3> path) {
    double sum = 0;
    for (std::size_t i = 1; i < path.size(); ++i) sum += length(path[i] - path[i - 1]);
    return sum;
}

} // namespace kiln

namespace kiln::bsp {
namespace {

constexpr double kInset = 1;     // map units the trail keeps off the walls, where the opening is wide enough
constexpr int kSweeps = 100;     // of pulling the string tight; more changed no trail by 0.1 unit

Vec3 normal_of(std::span<const Vec3> w) {
    Vec3 sum{};
    for (std::size_t i = 2; i < w.size(); ++i) sum += cross(w[i - 1] - w[0], w[i] - w[0]);
    return normalize(sum);
}

bool inside(std::span<const Vec3> w, Vec3 n, Vec3 p) { // p in w's plane, n its counter-clockwise normal
    for (std::size_t i = 0; i < w.size(); ++i)
        if (dot(cross(w[(i + 1) % w.size()] - w[i], p - w[i]), n) < 0) return false;
    return true;
}

// A smaller copy about its middle, so that a trail drawn through it does not run inside the wall.
std::vector<Vec3> inset(std::span<const Vec3> w) {
    const Vec3 c = centroid(w);
    const double k = 1 - std::min(0.25, kInset / std::max(width(w) / 2, 1e-9));
    std::vector<Vec3> smaller;
    for (const Vec3& p : w) smaller.push_back(c + (p - c) * k);
    return smaller;
}

// The point x of w that makes |a - x| + |x - b| least.
Vec3 shortest_crossing(std::span<const Vec3> w, Vec3 a, Vec3 b) {
    const Vec3 n = normal_of(w);
    const double da = dot(n, a - w[0]), db = dot(n, b - w[0]);
    if ((da <= 0) != (db <= 0)) {
        const Vec3 x = a + (b - a) * (da / (da - db));
        if (inside(w, n, x)) return x;
    }
    // Else on its rim. On a line the best place is found by turning both points into one plane with it.
    Vec3 best = w[0];
    double least = 1e300;
    for (std::size_t i = 0; i < w.size(); ++i) {
        const Vec3 p = w[i], edge = w[(i + 1) % w.size()] - p;
        const double l = length(edge);
        if (l == 0) continue;
        const Vec3 e = edge / l;
        const double ta = dot(a - p, e), tb = dot(b - p, e);
        const double ha = length(a - p - e * ta), hb = length(b - p - e * tb);
        const double t = ha + hb > 0 ? (ta * hb + tb * ha) / (ha + hb) : std::clamp(0.0, std::min(ta, tb), std::max(ta, tb));
        const Vec3 x = p + e * std::clamp(t, 0.0, l);
        if (const double d = length(a - x) + length(x - b); d < least) least = d, best = x;
    }
    return best;
}

void pull_tight(std::vector<Vec3>& points, const std::vector<std::vector<Vec3>>& gates) { // gate i bounds point i + 1
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
        double moved = 0;
        for (std::size_t i = 1; i < points.size(); ++i) {
            const Vec3 x = i + 1 < points.size() ? shortest_crossing(gates[i - 1], points[i - 1], points[i + 1])
                                                 : closest_point(gates[i - 1], points[i - 1]);
            moved = std::max(moved, length(x - points[i]));
            points[i] = x;
        }
        if (moved < 1e-3) break;
    }
}

void drop_straight(std::vector<Vec3>& points) {
    std::vector<Vec3> kept;
    for (const Vec3& p : points) {
        if (!kept.empty() && length(p - kept.back()) < 1e-3) continue;
        while (kept.size() >= 2) {
            const Vec3 a = kept[kept.size() - 2], b = kept.back();
            if (length(cross(normalize(p - a), b - a)) > 1e-3 || dot(p - b, b - a) < 0) break;
            kept.pop_back();
        }
        kept.push_back(p);
    }
    points = std::move(kept);
}

} // namespace

Vec3 closest_point(std::span<const Vec3> w, Vec3 to) {
    const Vec3 n = normal_of(w), in_plane = to - n * dot(n, to - w[0]);
    if (inside(w, n, in_plane)) return in_plane;
    Vec3 best = w[0];
    double least = 1e300;
    for (std::size_t i = 0; i < w.size(); ++i) {
        const Vec3 e = w[(i + 1) % w.size()] - w[i];
        const double l2 = dot(e, e);
        const Vec3 x = l2 > 0 ? w[i] + e * std::clamp(dot(to - w[i], e) / l2, 0.0, 1.0) : w[i];
        if (const double d = length(x - to); d < least) least = d, best = x;
    }
    return best;
}

// Dijkstra over doors; a door is stood for by its point nearest to where one came from.
std::optional<Trail> shortest_trail(const Flow& flow, const std::vector<EntityPlace>& entities,
                                    std::span<const std::uint32_t> starts, const std::vector<std::uint8_t>& shut) {
    constexpr std::uint32_t kNone = UINT32_MAX;
    struct State {
        double distance = 1e300;
        Vec3 at{};
        std::uint32_t from = kNone, start = kNone; // door before it; entity
        bool settled = false;
    };
    struct Step {
        double distance;
        std::uint32_t door;
        auto operator<=>(const Step&) const = default;
    };
    std::vector<std::vector<std::uint32_t>> shore_of(flow.room_leaf.size());
    for (std::uint32_t s = 0; s < flow.shore.size(); ++s) shore_of[flow.shore[s].first].push_back(s);
    std::vector<State> states(flow.doors.size());
    std::priority_queue<Step, std::vector<Step>, std::greater<>> queue;
    struct Exit {
        double distance = 1e300;
        std::uint32_t from = kNone, start = kNone, shore = kNone;
    } exit;
    const auto enter = [&](std::uint32_t room, Vec3 at, double distance, std::uint32_t from, std::uint32_t start) {
        for (const std::uint32_t s : shore_of[room])
            if (const double d = distance + length(closest_point(flow.shore[s].second, at) - at); d < exit.distance)
                exit = {d, from, start, s};
        for (const std::uint32_t p : flow.doors_of[room]) {
            if (shut[p] || states[p].settled) continue;
            const Vec3 x = closest_point(flow.doors[p].winding, at);
            if (const double d = distance + length(x - at); d < states[p].distance) {
                states[p] = {d, x, from, start, false};
                queue.push({d, p});
            }
        }
    };
    for (const std::uint32_t e : starts)
        for (const std::uint32_t r : entities[e].rooms) enter(r, entities[e].origin, 0, kNone, e);
    while (!queue.empty() && queue.top().distance < exit.distance) {
        const Step step = queue.top();
        queue.pop();
        State& s = states[step.door];
        if (s.settled || step.distance > s.distance) continue;
        s.settled = true;
        for (const std::uint32_t r : flow.doors[step.door].rooms) enter(r, s.at, s.distance, step.door, s.start);
    }
    if (exit.shore == kNone) return std::nullopt;

    std::vector<std::vector<Vec3>> gates{inset(flow.shore[exit.shore].second)};
    for (std::uint32_t d = exit.from; d != kNone; d = states[d].from) gates.push_back(inset(flow.doors[d].winding));
    std::ranges::reverse(gates);
    Trail trail{exit.start, {}, {entities[exit.start].origin}};
    for (std::uint32_t d = exit.from; d != kNone; d = states[d].from) trail.doors.push_back(d);
    std::ranges::reverse(trail.doors);
    for (const auto& g : gates) trail.points.push_back(closest_point(g, trail.points.back()));
    pull_tight(trail.points, gates);
    drop_straight(trail.points);
    return trail;
}

} // namespace kiln::bsp

// The parallax box: per axis the median distance to walls that face the probe across that axis.
#include "compiler/probes/probe_scene.h"

namespace kiln::probes {

namespace {

constexpr std::uint32_t kRays = 16;      // per face and edge
constexpr double kTolerance = 0.10;      // of the distance to the box
constexpr double kAccepted = 0.70;       // share of directions that must lie on the box

double distance_to_box(const Box3& box, Vec3 p, Vec3 d) {
    double t = 1e30;
    for (std::size_t a = 0; a < 3; ++a)
        if (d[a] != 0) t = std::min(t, std::max((box.hi[a] - p[a]) / d[a], (box.lo[a] - p[a]) / d[a]));
    return t;
}

double weighted_median(std::vector<std::pair<double, double>>& values) {
    std::sort(values.begin(), values.end());
    double total = 0, below = 0;
    for (const auto& [value, weight] : values) total += weight;
    for (const auto& [value, weight] : values)
        if ((below += weight) >= total / 2) return value;
    return 0;
}

} // namespace

std::optional<Box3> fit_box(const ProbeScene& scene, Vec3 position) {
    struct Seen {
        Vec3 direction;
        double distance, weight;
    };
    std::vector<Seen> seen;
    // Of walls, those that face the probe across an axis; of anything else (a room without axial walls), what lies in
    // the axial cone. In a box room this is exact wherever the probe stands, a plain cone would see side walls.
    std::array<std::vector<std::pair<double, double>>, 6> walls, cone;
    for (int face = 0; face < 6; ++face)
        for (std::uint32_t j = 0; j < kRays; ++j)
            for (std::uint32_t i = 0; i < kRays; ++i) {
                const Vec3 d = texel_direction(kRays, face, i, j);
                const double weight = solid_angle(kRays, i, j) / 12.566370614359172;
                const auto hit = scene.closest(position, d);
                const bool wall = hit && !hit->sky && !hit->back;
                seen.push_back({d, wall ? hit->distance : -1, weight});
                if (!wall) continue;
                for (std::size_t a = 0; a < 3; ++a) {
                    const std::size_t side = 2 * a + (d[a] < 0);
                    const double along = std::abs(d[a]) * hit->distance;
                    if (hit->normal[a] * (d[a] < 0 ? 1 : -1) > 0.95)
                        walls[side].emplace_back(along, weight);
                    if (std::abs(d[a]) > 0.9) cone[side].emplace_back(along, weight);
                }
            }
    Box3 box;
    for (std::size_t side = 0; side < 6; ++side) {
        auto& values = walls[side].empty() ? cone[side] : walls[side];
        if (values.empty()) return std::nullopt; // open on this side
        const double distance = weighted_median(values);
        (side % 2 ? box.lo : box.hi)[side / 2] = position[side / 2] + (side % 2 ? -distance : distance);
    }
    double on_box = 0;
    for (const Seen& s : seen) {
        const double expected = distance_to_box(box, position, s.direction);
        if (s.distance >= 0 && std::abs(s.distance - expected) <= kTolerance * expected) on_box += s.weight;
    }
    if (on_box < kAccepted) return std::nullopt;
    return box;
}

} // namespace kiln::probes

namespace kiln {

Vec3 parallax_direction(const Probe& probe, Vec3 point, Vec3 unit_direction) {
    if (!probe.boxed) return unit_direction;
    const double t = probes::distance_to_box(probe.box, point, unit_direction);
    return point + unit_direction * t - probe.position;
}

} // namespace kiln

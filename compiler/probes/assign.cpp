// Which probe a face or a leaf takes: named by an entity > visible and in the same room's box > visible > shortest way
// through portals > nearest. Visible always wins over what a closed wall hides.
#include "compiler/probes/probe_scene.h"
#include <limits>
#include <queue>

namespace kiln::probes {

std::uint32_t choose_probe(const ProbeScene& scene, const std::vector<Probe>& probes, const Receiver& receiver,
                           const std::function<double(std::uint32_t, std::uint32_t)>& way) {
    if (probes.empty()) return UINT32_MAX;
    if (receiver.explicit_probe != UINT32_MAX) return receiver.explicit_probe;
    Vec3 middle{};
    for (const Vec3& p : receiver.points) middle += p / double(receiver.points.size());
    std::vector<std::pair<double, std::uint32_t>> order;
    for (std::uint32_t k = 0; k < probes.size(); ++k) {
        const Vec3 d = probes[k].position - middle;
        order.emplace_back(dot(d, d), k);
    }
    std::sort(order.begin(), order.end());
    const auto visible = [&](const Probe& probe) {
        for (const Vec3& p : receiver.points)
            if (dot(receiver.normal, probe.position - p) >= 0 && scene.clear(p, probe.position)) return true;
        return false;
    };
    const auto in_box = [&](const Probe& probe) {
        if (!probe.boxed) return false;
        for (std::size_t a = 0; a < 3; ++a) {
            const double margin = 0.05 * probe.box.size()[a];
            if (middle[a] < probe.box.lo[a] - margin || middle[a] > probe.box.hi[a] + margin) return false;
        }
        return true;
    };
    for (const auto& [d2, k] : order)
        if (in_box(probes[k]) && visible(probes[k])) return k;
    for (const auto& [d2, k] : order)
        if (!in_box(probes[k]) && visible(probes[k])) return k;
    double shortest = std::numeric_limits<double>::infinity();
    std::uint32_t best = order.front().second;
    if (receiver.leaf != UINT32_MAX)
        for (const auto& [d2, k] : order)
            if (const double length = way(k, receiver.leaf); length < shortest) shortest = length, best = k;
    return best;
}

std::vector<double> ways_from(const Bsp& bsp, std::uint32_t leaf, Vec3 position) {
    // Dijkstra over portals; a way leads from portal centre to portal centre.
    std::vector<double> to_leaf(bsp.leaves.size(), std::numeric_limits<double>::infinity());
    if (leaf >= bsp.leaves.size()) return to_leaf;
    std::vector<Vec3> centre(bsp.portals.size());
    std::vector<std::vector<std::uint32_t>> of_leaf(bsp.leaves.size());
    for (std::uint32_t p = 0; p < bsp.portals.size(); ++p) {
        for (const Vec3& v : bsp.portals[p].winding) centre[p] += v / double(bsp.portals[p].winding.size());
        of_leaf[bsp.portals[p].leaf_front.at()].push_back(p);
        of_leaf[bsp.portals[p].leaf_back.at()].push_back(p);
    }
    std::vector<double> to_portal(bsp.portals.size(), std::numeric_limits<double>::infinity());
    using Entry = std::pair<double, std::uint32_t>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
    const auto spread = [&](std::uint32_t at, Vec3 from, double so_far) {
        to_leaf[at] = std::min(to_leaf[at], so_far);
        for (const std::uint32_t p : of_leaf[at])
            if (const double d = so_far + length(centre[p] - from); d < to_portal[p]) to_portal[p] = d, open.emplace(d, p);
    };
    spread(leaf, position, 0);
    while (!open.empty()) {
        const auto [d, p] = open.top();
        open.pop();
        if (d > to_portal[p]) continue;
        spread(bsp.portals[p].leaf_front.value, centre[p], d);
        spread(bsp.portals[p].leaf_back.value, centre[p], d);
    }
    return to_leaf;
}

} // namespace kiln::probes

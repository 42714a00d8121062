#include "compiler/pack/water_distance.h"
#include <algorithm>
#include <cmath>

namespace kiln {
namespace {

double distance(const Box3& a, const Box3& b) {
    Vec3 apart{};
    for (std::size_t k = 0; k < 3; ++k) apart[k] = std::max({0.0, b.lo[k] - a.hi[k], a.lo[k] - b.hi[k]});
    return length(apart);
}

} // namespace

std::vector<float> leaf_water_distances(const Bsp& bsp, const Visibility& visibility) {
    std::vector<std::vector<Box3>> at_cluster(bsp.cluster_count); // surfaces, by the clusters of the liquid: who sees one, sees into it
    const auto wet = [&](LeafId l) { return bsp.leaf_water[l.at()] != UINT32_MAX; };
    for (const BspPortal& p : bsp.portals) {
        const BspLeaf &front = bsp.leaves[p.leaf_front.at()], &back = bsp.leaves[p.leaf_back.at()];
        if ((!wet(p.leaf_front) && !wet(p.leaf_back)) || front.contents == back.contents) continue;
        Box3 box;
        for (const Vec3& v : p.winding) box.add(v);
        for (const LeafId l : {p.leaf_front, p.leaf_back})
            if (wet(l)) at_cluster[bsp.leaves[l.at()].cluster.at()].push_back(box);
    }
    for (std::size_t l = 0; l < bsp.leaves.size(); ++l)
        if (bsp.leaf_water[l] != UINT32_MAX && !bsp.waters[bsp.leaf_water[l]].has_surface)
            at_cluster[bsp.leaves[l].cluster.at()].push_back(bsp.leaves[l].bounds);
    std::vector<std::uint32_t> with; // clusters that have any
    for (std::uint32_t c = 0; c < bsp.cluster_count; ++c)
        if (!at_cluster[c].empty()) with.push_back(c);

    std::vector<float> out(bsp.leaves.size(), INFINITY);
    for (std::size_t l = 0; l < bsp.leaves.size(); ++l) {
        const BspLeaf& leaf = bsp.leaves[l];
        if (!leaf.cluster.valid()) continue;
        double least = wet(id<LeafId>(l)) ? 0 : HUGE_VAL;
        for (std::size_t i = 0; i < with.size() && least > 0; ++i) {
            if (!visibility.sees(leaf.cluster.value, with[i])) continue;
            for (const Box3& box : at_cluster[with[i]]) least = std::min(least, distance(leaf.bounds, box));
        }
        // Rounded down: it must not be more than the distance is.
        out[l] = static_cast<float>(least);
        if (out[l] > least) out[l] = std::nextafter(out[l], 0.0f);
    }
    return out;
}

} // namespace kiln

// Clusters of many leaves (func_viscluster, 3D sky): visibility stays conservative, though they are neither convex nor connected.
#include "compiler/visibility/visibility.h"
#include "tests/support/world_builder.h"
#include <gtest/gtest.h>
#include <algorithm>
#include <random>

namespace kiln::test {
namespace {

double uniform(std::mt19937_64& rng, double lo, double hi) { return lo + (hi - lo) * (static_cast<double>(rng() >> 11) * 0x1p-53); }

// Does the open segment miss the box?
bool misses(const Box3& box, Vec3 a, Vec3 b) {
    double enter = 0, leave = 1;
    for (std::size_t k = 0; k < 3; ++k) {
        const double d = b[k] - a[k];
        if (std::abs(d) < 1e-12) {
            if (a[k] <= box.lo[k] || a[k] >= box.hi[k]) return true;
            continue;
        }
        double s = (box.lo[k] - a[k]) / d, t = (box.hi[k] - a[k]) / d;
        if (s > t) std::swap(s, t);
        enter = std::max(enter, s), leave = std::min(leave, t);
    }
    return enter >= leave;
}

TEST(VisibilityMergedClusters, AClearSegmentIsAlwaysSeen) {
    std::size_t clear = 0, hidden = 0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        std::mt19937_64 rng(seed);
        WorldBuilder w;
        w.room({0, 0, 0}, {512, 512, 96});
        for (int i = 0; i < 14; ++i) {
            const double x = std::floor(uniform(rng, 0, 28)) * 16, y = std::floor(uniform(rng, 0, 28)) * 16;
            const bool along = rng() & 1;
            w.box({x, y, 0}, {x + (along ? 160 : 16), y + (along ? 16 : 160), 96});
        }
        w.point_entity("info_player_start", {8, 8, 8});
        // An L, and two volumes far apart that share a cluster.
        const auto volume = [&](Vec3 lo, Vec3 hi, EntityId e) { w.world.brushes[w.box(lo, hi, Contents::vis_cluster).at()].entity = e; };
        const EntityId one = w.point_entity("func_viscluster", {}), two = w.point_entity("func_viscluster", {});
        for (const EntityId e : {one, two}) w.world.entities[e.at()].has_origin = false;
        volume({-8, -8, -8}, {200, 520, 104}, one);
        volume({-8, -8, -8}, {520, 120, 104}, one);
        volume({300, 200, -8}, {400, 330, 104}, two);
        volume({400, 400, -8}, {520, 520, 104}, two);

        Context context;
        const Csg csg = std::move(*build_csg(w.world, {}, context));
        const Bsp bsp = std::move(*build_bsp(w.world, csg, {}, context));
        validate(bsp, csg);
        std::size_t inside = 0;
        for (const BspLeaf& l : bsp.leaves) inside += l.cluster.valid();
        ASSERT_LT(bsp.cluster_count, inside); // something was merged
        const std::vector<VisPortal> portals = vis_portals(bsp);
        for (const VisPortal& p : portals) EXPECT_NE(p.cluster_front, p.cluster_back);
        const Visibility v = std::move(*compute_visibility(portals, bsp.cluster_count, {}, context));
        validate(v);
        std::vector<Box3> walls;
        for (std::size_t b = 0; b < csg.brushes.size(); ++b)
            if (w.world.brushes[b].contents == Contents::solid) walls.push_back(csg.brushes[b].bounds);
        for (int i = 0; i < 20000; ++i) {
            const Vec3 a{uniform(rng, 0, 512), uniform(rng, 0, 512), uniform(rng, 0, 96)}, b{uniform(rng, 0, 512), uniform(rng, 0, 512), uniform(rng, 0, 96)};
            const ClusterId from = bsp.leaves[leaf_at(bsp, a).at()].cluster, to = bsp.leaves[leaf_at(bsp, b).at()].cluster;
            if (!from.valid() || !to.valid()) continue;
            if (!std::ranges::all_of(walls, [&](const Box3& box) { return misses(box, a, b); })) {
                hidden += !v.sees(from.value, to.value);
                continue;
            }
            ++clear;
            ASSERT_TRUE(v.sees(from.value, to.value)) << "seed " << seed << ": " << a.x << " " << a.y << " " << a.z << " to " << b.x << " " << b.y << " " << b.z;
        }
    }
    EXPECT_GT(clear, 5000u);
    EXPECT_GT(hidden, 100u); // and it is not that everything sees everything
}

} // namespace
} // namespace kiln::test

// Clusters of many leaves (func_viscluster, 3D sky): visibility stays conservative, though they are neither convex nor connected.
// And clusters joined afterwards (--vis-merge): nothing is lost, and what is seen more stays within what was allowed.
#include "compiler/visibility/merge.h"
#include "tests/compiler/visibility/grid_map.h"
#include "tests/support/world_builder.h"
#include <gtest/gtest.h>
#include <algorithm>
#include <map>
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

std::uint64_t leaves_seen(const Visibility& v, std::uint32_t from, std::span<const std::uint32_t> leaves) {
    std::uint64_t sum = 0;
    for (std::uint32_t c = 0; c < v.cluster_count; ++c) sum += v.sees(from, c) ? leaves[c] : 0;
    return sum;
}

TEST(VisibilityMergedClusters, JoinedOnesSeeNoMoreThanAllowed) {
    std::size_t joined = 0, grown = 0;
    for (unsigned seed = 0; seed < 8; ++seed) {
        std::mt19937 random(seed);
        const GridMap map = grid_map(rooms(random, 3, 2), false, seed & 1);
        Context context;
        const Visibility before = std::move(*compute_visibility(map.portals, map.cluster_count, {}, context));
        std::vector<std::uint32_t> leaves(map.cluster_count);
        for (std::uint32_t& l : leaves) l = seed < 4 ? 1 : 1 + random() % 5;
        std::vector<std::array<std::uint32_t, 2>> neighbours, apart;
        for (const VisPortal& p : map.portals) (random() % 8 ? neighbours : apart).push_back({p.cluster_front, p.cluster_back});
        for (const double percent : {0.0, 5.0, 25.0, 1000.0}) {
            const MergedClusters merged = merge_clusters(before, leaves, neighbours, apart, percent, context);
            const Visibility& after = merged.visibility;
            validate(after);
            std::vector<std::uint32_t> now(after.cluster_count, 0); // leaves
            for (std::uint32_t c = 0; c < map.cluster_count; ++c) now.at(merged.of[c]) += leaves[c];
            double saw = 0, sees = 0, all = 0;
            for (std::uint32_t a = 0; a < map.cluster_count; ++a) {
                const std::uint64_t was = leaves_seen(before, a, leaves), is = leaves_seen(after, merged.of[a], now);
                EXPECT_LE(static_cast<double>(is), static_cast<double>(was) * (1 + percent / 100)) << seed << " " << percent;
                EXPECT_GE(is, was);
                grown += is > was;
                saw += static_cast<double>(was * leaves[a]), sees += static_cast<double>(is * leaves[a]), all += leaves[a];
                for (std::uint32_t b = 0; b < map.cluster_count; ++b) EXPECT_TRUE(!before.sees(a, b) || after.sees(merged.of[a], merged.of[b]));
            }
            // No pair is marked for nothing: some member of the one saw some member of the other.
            std::vector<char> any(std::size_t{after.cluster_count} * after.cluster_count, 0);
            for (std::uint32_t a = 0; a < map.cluster_count; ++a)
                for (std::uint32_t b = 0; b < map.cluster_count; ++b)
                    if (before.sees(a, b)) any[std::size_t{merged.of[a]} * after.cluster_count + merged.of[b]] = 1;
            for (std::uint32_t a = 0; a < after.cluster_count; ++a)
                for (std::uint32_t b = 0; b < after.cluster_count; ++b) EXPECT_EQ(after.sees(a, b), any[std::size_t{a} * after.cluster_count + b] != 0);
            EXPECT_NEAR(merged.mean_before, saw / all, 1e-9);
            EXPECT_NEAR(merged.mean_after, sees / all, 1e-9);
            for (const auto& [a, b] : apart) EXPECT_NE(merged.of[a], merged.of[b]);
            joined += map.cluster_count - after.cluster_count;
        }
    }
    EXPECT_GT(joined, 1000u);
    EXPECT_GT(grown, 1000u); // the bound had something to bound
}

// Cells of a row all see each other: one cluster for nothing, but for the border that stays. And of two rooms with a wall between, those
// behind the same wall: what the doorway sees is more, and costs.
TEST(VisibilityMergedClusters, WhatCostsNothingIsJoinedAtZero) {
    Context context;
    const auto merged = [&](const GridMap& map, std::span<const std::array<std::uint32_t, 2>> apart, double percent) {
        const Visibility v = std::move(*compute_visibility(map.portals, map.cluster_count, {}, context));
        std::vector<std::array<std::uint32_t, 2>> neighbours;
        for (const VisPortal& p : map.portals) neighbours.push_back({p.cluster_front, p.cluster_back});
        return merge_clusters(v, std::vector<std::uint32_t>(map.cluster_count, 1), neighbours, apart, percent, context);
    };
    const std::array<std::uint32_t, 2> border[] = {{4, 5}};
    const MergedClusters row = merged(grid_map({"............"}), border, 0);
    EXPECT_EQ(row.visibility.cluster_count, 2u);
    for (std::uint32_t c = 0; c < 12; ++c) EXPECT_EQ(row.of[c], c > 4 ? 1u : 0u);
    const GridMap bend = grid_map({"......", ".#####", ".#####", ".#####"});
    const MergedClusters corner = merged(bend, {}, 0);
    EXPECT_GE(corner.visibility.cluster_count, 3u); // the two legs and the corner between them
    EXPECT_LT(corner.visibility.cluster_count, bend.cluster_count);
    EXPECT_EQ(corner.mean_after, corner.mean_before);
    EXPECT_EQ(merged(bend, {}, 1000).visibility.cluster_count, 1u);
    EXPECT_EQ(merged(grid_map({"."}), {}, 10).visibility.cluster_count, 1u);
}

// In a tree: hints part what they part, and leaves of a func_viscluster keep it to themselves.
TEST(VisibilityMergedClusters, HintsAndVisClustersStay) {
    WorldBuilder w;
    w.room({0, 0, 0}, {768, 256, 128});
    for (const double x : {64.0, 128.0, 256.0, 512.0, 640.0, 704.0}) w.box({x, 96, 0}, {x + 16, 160, 64});
    const MaterialId hint = w.material("tools/toolshint", kHint), skip = w.material("tools/toolsskip", kSkip);
    const BrushId wall = w.box({384, 0, 0}, {392, 256, 128}, Contents::hint, {0}, skip);
    w.world.sides[w.world.brushes[wall.at()].first_side].material = hint; // -x
    const EntityId e = w.point_entity("func_viscluster", {});
    w.world.entities[e.at()].has_origin = false;
    w.world.brushes[w.box({500, -8, -8}, {776, 264, 136}, Contents::vis_cluster).at()].entity = e;
    w.point_entity("info_player_start", {8, 8, 8});
    Context context;
    const Csg csg = std::move(*build_csg(w.world, {}, context));
    const Bsp bsp = std::move(*build_bsp(w.world, csg, {}, context));
    const Visibility v = std::move(*compute_visibility(vis_portals(bsp), bsp.cluster_count, {}, context));
    const MergedClusters merged = merge_clusters(v, bsp, 1000, context);
    EXPECT_LT(merged.visibility.cluster_count, bsp.cluster_count);
    std::size_t hints = 0;
    for (const BspPortal& p : bsp.portals)
        if (p.hint) {
            EXPECT_NE(merged.of[bsp.leaves[p.leaf_front.at()].cluster.at()], merged.of[bsp.leaves[p.leaf_back.at()].cluster.at()]);
            ++hints;
        }
    EXPECT_GT(hints, 0u);
    std::map<std::uint32_t, std::size_t> leaves;
    for (const BspLeaf& l : bsp.leaves)
        if (l.cluster.valid()) ++leaves[l.cluster.value];
    bool any = false;
    for (const auto& [cluster, count] : leaves)
        if (count > 1) {
            any = true;
            for (std::uint32_t c = 0; c < bsp.cluster_count; ++c) EXPECT_EQ(merged.of[c] == merged.of[cluster], c == cluster);
        }
    EXPECT_TRUE(any);
}

} // namespace
} // namespace kiln::test

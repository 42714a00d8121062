// What is seen while area portals are shut: held in what is seen when they are open, and nothing that a line reaches without them is missing.
#include "compiler/visibility/merge.h"
#include "compiler/visibility/shut.h"
#include "tests/compiler/visibility/grid_map.h"
#include "tests/support/world_builder.h"
#include <cmath>
#include <gtest/gtest.h>

namespace kiln::test {
namespace {

// Cells as leaves: '#' solid, 'D' an area portal, 'L' one that parts nothing, '.' open; areas by flood.
struct Doors {
    GridMap map;
    Bsp bsp;
    std::vector<std::uint8_t> shut;
    std::vector<std::string> rows;
    char at(int x, int y) const { return y < 0 || x < 0 || y >= map.height || x >= map.width ? '#' : rows[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)]; }
    std::uint32_t area(int cell) const { return bsp.leaves[static_cast<std::size_t>(cell)].area; }
};

Doors with_doors(std::vector<std::string> rows, bool turn) {
    Doors d;
    d.map = grid_map(rows, false, turn), d.rows = std::move(rows);
    d.bsp.cluster_count = d.map.cluster_count;
    d.bsp.leaves.resize(d.map.cluster_count);
    for (std::uint32_t c = 0; c < d.map.cluster_count; ++c) d.bsp.leaves[c].cluster = ClusterId{c};
    for (const VisPortal& p : d.map.portals) {
        BspPortal portal;
        portal.leaf_front = LeafId{p.cluster_front}, portal.leaf_back = LeafId{p.cluster_back}, portal.winding = p.winding;
        d.bsp.portals.push_back(portal);
    }
    const auto is_door = [&](int x, int y) { return d.at(x, y) == 'D' || d.at(x, y) == 'L'; };
    constexpr int kNext[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    for (int y = 0; y < d.map.height; ++y)
        for (int x = 0; x < d.map.width; ++x) {
            if (d.map.at(x, y) < 0 || is_door(x, y) || d.area(d.map.at(x, y))) continue;
            ++d.bsp.area_count;
            std::vector<std::pair<int, int>> queue{{x, y}};
            d.bsp.leaves[static_cast<std::size_t>(d.map.at(x, y))].area = d.bsp.area_count;
            while (!queue.empty()) {
                const auto [i, j] = queue.back();
                queue.pop_back();
                for (const auto& step : kNext) {
                    const int a = i + step[0], b = j + step[1], cell = d.map.at(a, b);
                    if (cell < 0 || is_door(a, b) || d.area(cell)) continue;
                    d.bsp.leaves[static_cast<std::size_t>(cell)].area = d.bsp.area_count, queue.emplace_back(a, b);
                }
            }
        }
    d.shut.assign(d.map.cluster_count, 0);
    for (int y = 0; y < d.map.height; ++y)
        for (int x = 0; x < d.map.width; ++x) {
            if (!is_door(x, y)) continue;
            d.shut[static_cast<std::size_t>(d.map.at(x, y))] = d.at(x, y) == 'D';
            std::vector<std::uint32_t> areas;
            for (const auto& step : kNext)
                if (const int cell = d.map.at(x + step[0], y + step[1]); cell >= 0 && d.area(cell)) areas.push_back(d.area(cell));
            if (areas.size() < 2 || d.at(x, y) == 'L') continue;
            AreaPortal portal;
            portal.areas = {std::min(areas[0], areas[1]), std::max(areas[0], areas[1])};
            d.bsp.area_portals.push_back(portal);
        }
    return d;
}

// Cells in one area with a segment between them that passes no door; and doors that are the last cell of such a one.
std::vector<char> proven_shut(const Doors& d, std::mt19937& random, int rays) {
    const std::size_t n = d.map.cluster_count;
    std::vector<char> seen(n * n, 0);
    std::uniform_real_distribution<double> unit(0, 1);
    for (int i = 0; i < rays; ++i) {
        const double x = unit(random) * d.map.width, y = unit(random) * d.map.height, angle = unit(random) * 6.283185307179586, dx = std::cos(angle), dy = std::sin(angle);
        int cx = static_cast<int>(x), cy = static_cast<int>(y);
        if (d.map.at(cx, cy) < 0 || d.at(cx, cy) == 'D' || d.at(cx, cy) == 'L') continue;
        std::vector<std::size_t> chain;
        double tx = dx > 0 ? (cx + 1 - x) / dx : (cx - x) / dx, ty = dy > 0 ? (cy + 1 - y) / dy : (cy - y) / dy;
        while (d.map.at(cx, cy) >= 0) {
            chain.push_back(static_cast<std::size_t>(d.map.at(cx, cy)));
            if (d.at(cx, cy) == 'D' || std::abs(tx - ty) < 1e-9) break;
            if (tx < ty) cx += dx > 0 ? 1 : -1, tx += 1 / std::abs(dx);
            else cy += dy > 0 ? 1 : -1, ty += 1 / std::abs(dy);
        }
        for (const std::size_t a : chain)
            for (const std::size_t b : chain)
                if (d.bsp.leaves[a].area) seen[a * n + b] = 1;
    }
    return seen;
}

void check(const Doors& d, std::mt19937& random, std::size_t& marked, std::size_t& proven, std::size_t& hidden) {
    Context context;
    const Visibility open = std::move(*compute_visibility(d.map.portals, d.map.cluster_count, {}, context));
    Visibility v = open;
    v.shut = std::move(*shut_rows(d.bsp, d.shut, open, true, {}, context));
    validate(v); // held in the open rows, and each sees itself
    for (const int threads : {2, 8}) {
        Context other;
        other.threads = threads;
        EXPECT_EQ(v.shut, *shut_rows(d.bsp, d.shut, open, true, {}, other));
    }
    Visibility cut = open; // without time for the flow: looser, and as valid
    cut.shut = std::move(*shut_rows(d.bsp, d.shut, open, false, {}, context));
    const std::vector<char> lines = proven_shut(d, random, 40000);
    for (std::uint32_t a = 0; a < v.cluster_count; ++a)
        for (std::uint32_t b = 0; b < v.cluster_count; ++b) {
            const std::uint32_t from = d.bsp.leaves[a].area, to = d.bsp.leaves[b].area;
            if (lines[std::size_t{a} * v.cluster_count + b]) {
                EXPECT_TRUE(v.sees_shut(a, b)) << a << " " << b;
                ++proven;
            }
            EXPECT_TRUE(!v.sees_shut(a, b) || cut.sees_shut(a, b));
            if (!from) {
                EXPECT_EQ(v.sees_shut(a, b), open.sees(a, b));
                continue;
            }
            EXPECT_TRUE(!v.sees_shut(a, b) || to == from || to == 0) << a << " " << b; // a closed room keeps to itself
            EXPECT_TRUE(!to || v.sees_shut(a, b) == v.sees_shut(b, a));
            marked += v.sees_shut(a, b), hidden += cut.sees_shut(a, b) && !v.sees_shut(a, b);
        }
}

TEST(VisibilityShut, GridsOfRoomsWithDoors) {
    std::size_t marked = 0, proven = 0, hidden = 0;
    for (unsigned seed = 0; seed < 12; ++seed) {
        std::mt19937 random(seed);
        std::vector<std::string> rows = rooms(random, 3, 2);
        for (std::size_t y = 0; y < rows.size(); ++y)
            for (std::size_t x = 0; x < rows[y].size(); ++x)
                if ((y % 6 == 0 || x % 6 == 0) && rows[y][x] == '.' && random() % 5) rows[y][x] = 'D'; // some stay open: areas of several rooms
        check(with_doors(rows, seed & 1), random, marked, proven, hidden);
    }
    EXPECT_GT(proven, 2000u);
    EXPECT_LT(static_cast<double>(marked), 1.1 * static_cast<double>(proven));
}

// Out through one portal and back in through another: seen while they are open, not while they are shut. A door that parts nothing stays open.
TEST(VisibilityShut, NoLineLeavesAndComesBack) {
    std::mt19937 random(1);
    std::size_t marked = 0, proven = 0, hidden = 0;
    const Doors d = with_doors({"###.....###", //
                                "###.....###", //
                                "#..D...D..#", // straight through the room in the middle
                                "#.#.....#.#", //
                                "#.#.....#.#", //
                                "#.#######.#", //
                                "#.........#", //
                                "###########"},
                               false);
    ASSERT_EQ(d.bsp.area_count, 2u);
    check(d, random, marked, proven, hidden);
    EXPECT_GT(hidden, 0u);
    Context context;
    const Visibility open = std::move(*compute_visibility(d.map.portals, d.map.cluster_count, {}, context));
    Visibility v = open;
    v.shut = std::move(*shut_rows(d.bsp, d.shut, open, true, {}, context));
    const auto left = static_cast<std::uint32_t>(d.map.at(1, 2)), right = static_cast<std::uint32_t>(d.map.at(9, 2)), door = static_cast<std::uint32_t>(d.map.at(3, 2)), middle = static_cast<std::uint32_t>(d.map.at(5, 2));
    EXPECT_TRUE(v.sees(left, right));
    EXPECT_FALSE(v.sees_shut(left, right));
    EXPECT_TRUE(v.sees_shut(left, door)); // what stands in it is seen
    EXPECT_FALSE(v.sees_shut(left, middle));
    EXPECT_TRUE(v.sees_shut(door, middle)); // nobody stands in a shut door: its own row is the open one
    marked = proven = hidden = 0;
    const Doors loose = with_doors({"##########", //
                                    "#..L.....#", // a way leads around it
                                    "#.###....#", //
                                    "#........#", //
                                    "#.####D###", //
                                    "#.#....#.#", //
                                    "#.D....D.#", //
                                    "##########"},
                                   true);
    ASSERT_EQ(loose.bsp.area_count, 3u);
    check(loose, random, marked, proven, hidden);
    Visibility w = std::move(*compute_visibility(loose.map.portals, loose.map.cluster_count, {}, context));
    w.shut = std::move(*shut_rows(loose.bsp, loose.shut, w, true, {}, context));
    EXPECT_TRUE(w.sees_shut(static_cast<std::uint32_t>(loose.map.at(1, 1)), static_cast<std::uint32_t>(loose.map.at(5, 1))));
}

// In a tree: the leaves of portals that part areas, and not those of one that a way leads around.
TEST(VisibilityShut, LeavesOfPortalsThatPart) {
    WorldBuilder w;
    w.room({0, 0, 0}, {512, 128, 96});
    w.box({128, 0, 0}, {144, 48, 96}), w.box({128, 80, 0}, {144, 128, 96});
    w.box({320, 0, 0}, {336, 48, 96}), w.box({320, 80, 0}, {336, 128, 48}); // open above
    const auto portal = [&](Vec3 lo, Vec3 hi) { w.world.brushes[w.box(lo, hi, Contents::area_portal).at()].entity = w.point_entity("func_areaportal", {}); };
    portal({132, 48, 0}, {140, 80, 96}), portal({324, 48, 0}, {332, 80, 48});
    for (WorldEntity& e : w.world.entities) e.has_origin = false;
    w.point_entity("info_player_start", {16, 16, 16});
    Context context;
    const Csg csg = std::move(*build_csg(w.world, {}, context));
    const Bsp bsp = std::move(*build_bsp(w.world, csg, {}, context));
    ASSERT_EQ(bsp.area_count, 2u);
    const std::vector<std::uint8_t> shut = shut_leaves(csg, bsp);
    ASSERT_EQ(shut.size(), bsp.leaves.size());
    const LeafId first = leaf_at(bsp, {136, 64, 40}), second = leaf_at(bsp, {328, 64, 24});
    std::size_t count = 0;
    for (std::size_t l = 0; l < shut.size(); ++l)
        if (shut[l]) {
            ++count;
            EXPECT_TRUE(bsp.leaves[l].bounds.lo.x >= 132 && bsp.leaves[l].bounds.hi.x <= 140);
        }
    EXPECT_GT(count, 0u);
    EXPECT_TRUE(shut[first.at()]);
    EXPECT_EQ(bsp.leaves[second.at()].area, 0u);
    EXPECT_FALSE(shut[second.at()]);
    Visibility v = std::move(*compute_visibility(vis_portals(bsp), bsp.cluster_count, {}, context));
    v.shut = std::move(*shut_rows(bsp, shut, v, true, {}, context));
    validate(v);
    const auto cluster = [&](Vec3 p) { return bsp.leaves[leaf_at(bsp, p).at()].cluster.value; };
    EXPECT_TRUE(v.sees(cluster({16, 64, 40}), cluster({300, 64, 40})));
    EXPECT_FALSE(v.sees_shut(cluster({16, 64, 40}), cluster({300, 64, 40})));
    EXPECT_TRUE(v.sees_shut(cluster({300, 64, 24}), cluster({400, 64, 24}))); // through the one that parts nothing
    // Joined clusters: the rows of the joined ones hold those of their members.
    const MergedClusters merged = merge_clusters(v, bsp, 50, context);
    validate(merged.visibility);
    ASSERT_FALSE(merged.visibility.shut.empty());
    for (std::uint32_t a = 0; a < v.cluster_count; ++a)
        for (std::uint32_t b = 0; b < v.cluster_count; ++b) EXPECT_TRUE(!v.sees_shut(a, b) || merged.visibility.sees_shut(merged.of[a], merged.of[b]));
    EXPECT_FALSE(merged.visibility.sees_shut(merged.of[cluster({16, 64, 40})], merged.of[cluster({300, 64, 40})]));
    EXPECT_TRUE(shut_leaves(csg, Bsp{}).empty());
}

} // namespace
} // namespace kiln::test

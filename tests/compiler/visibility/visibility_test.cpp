#include "tests/compiler/visibility/grid_map.h"
#include <cmath>
#include <gtest/gtest.h>
#include <limits>

namespace kiln {
namespace {

using test::grid_map;
using test::GridMap;

Visibility compute(const GridMap& map, const VisibilityOptions& options = {}, int threads = 1) {
    Context context;
    context.threads = threads;
    Result<Visibility> v = compute_visibility(map.portals, map.cluster_count, options, context);
    EXPECT_TRUE(v);
    validate(*v);
    return std::move(*v);
}

std::size_t pairs(const Visibility& v) {
    std::size_t n = 0;
    for (std::uint32_t a = 0; a < v.cluster_count; ++a)
        for (std::uint32_t b = 0; b < v.cluster_count; ++b) n += v.sees(a, b);
    return n;
}
void expect_subset(const Visibility& small, const Visibility& large) {
    ASSERT_EQ(small.rows.size(), large.rows.size());
    for (std::size_t w = 0; w < small.rows.size(); ++w) EXPECT_EQ(small.rows[w] & ~large.rows[w], 0u);
}

TEST(visibility, without_portals_a_cluster_sees_itself_alone) {
    GridMap map;
    map.cluster_count = 70;
    EXPECT_EQ(pairs(compute(map)), 70u);
    map.cluster_count = 0;
    EXPECT_EQ(pairs(compute(map)), 0u);
}

// Two rooms joined through a door in a thick wall: everything in a row sees everything.
TEST(visibility, rooms_in_a_row_all_see_each_other) {
    const GridMap map = grid_map({"##.##", ".....", "##.##"}, true);
    // top, row, bottom: one straight line through the row
    const Visibility v = compute(map);
    EXPECT_EQ(pairs(v), 9u);
}

// A corridor of unit cells that bends at right angles. From (0,0) a line must stay below y = 1 up to x = 2, so its slope is
// below 1, and then cannot climb past y = 2 before x = 3; from (1,0) it can. The blocked line only touches the corners.
TEST(visibility, bent_corridor_matches_the_closed_form) {
    for (const bool turn : {false, true}) {
        const GridMap map = grid_map({"...", "##.", "##.", "##.", "##."}, false, turn);
        const Visibility v = compute(map); // clusters 0 1 2 along x; 3 4 5 6 downwards
        for (const std::uint32_t to : {0u, 1u, 2u, 3u}) EXPECT_TRUE(v.sees(0, to)) << turn << " " << to;
        for (const std::uint32_t to : {4u, 5u, 6u}) EXPECT_FALSE(v.sees(0, to)) << turn << " " << to;
        for (const std::uint32_t to : {2u, 3u, 4u, 5u, 6u}) EXPECT_TRUE(v.sees(1, to)) << turn << " " << to;
        for (const std::uint32_t to : {3u, 4u, 5u, 6u}) EXPECT_TRUE(v.sees(2, to));
    }
}

// Doors in the same wall of a corridor: the rooms behind them cannot see each other.
TEST(visibility, doors_in_one_wall_do_not_see_each_other) {
    for (const bool turn : {false, true}) {
        const GridMap map = grid_map({"###########", "#.#.#.#.#.#", "..........."}, true, turn);
        const Visibility v = compute(map);
        ASSERT_EQ(map.cluster_count, 6u);
        for (std::uint32_t a = 0; a < 5; ++a)
            for (std::uint32_t b = 0; b < 6; ++b) EXPECT_EQ(v.sees(a, b), a == b || b == 5) << a << b;
    }
}

// A slit of a hundredth of a unit is still a slit: nothing may close because it is thin.
TEST(visibility, thin_portals_stay_open) {
    for (const double slit : {1e-2, 1e-4, 1e-5}) {
        std::vector<VisPortal> portals;
        for (std::uint32_t i = 0; i < 4; ++i) { // walls at x = 0, 64, 128, 192, each with the same slit
            const double x = 64 * i;
            portals.push_back({i, i + 1, {{x, 0, 0}, {x, 0, 64}, {x, slit, 64}, {x, slit, 0}}});
        }
        Context context;
        const Result<Visibility> v = compute_visibility(portals, 5, {}, context);
        ASSERT_TRUE(v);
        for (std::uint32_t a = 0; a < 5; ++a)
            for (std::uint32_t b = 0; b < 5; ++b) EXPECT_TRUE(v->sees(a, b)) << slit;
    }
}

// The falsification test: whatever a ray proves visible is in the rows, on maps that are axial and on maps that are not.
TEST(visibility, no_ray_finds_a_pair_outside_the_rows) {
    std::size_t proven = 0, marked = 0, tight = 0, flooded = 0;
    for (unsigned seed = 0; seed < 24; ++seed) {
        std::mt19937 random(seed);
        const bool runs = seed & 1, turn = seed & 2;
        const auto rows = seed % 3 == 0 ? test::rooms(random, 2, 2) : test::random_rows(random, 10, 9, 0.2 + 0.05 * (seed % 5));
        const GridMap map = grid_map(rows, runs, turn);
        const Visibility v = compute(map);
        const std::vector<char> seen = test::proven_pairs(map, random, 150000);
        for (std::uint32_t a = 0; a < map.cluster_count; ++a)
            for (std::uint32_t b = 0; b < map.cluster_count; ++b) {
                const bool is_seen = seen[std::size_t{a} * map.cluster_count + b];
                ASSERT_TRUE(!is_seen || v.sees(a, b)) << "seed " << seed << ": " << a << " sees " << b;
                proven += is_seen;
            }
        const Visibility fast = compute(map, {.fast = true});
        expect_subset(v, fast);
        marked += pairs(v), flooded += pairs(fast), tight += pairs(compute(map, {.epsilon = 1e-9}));
    }
    // Cells on a grid graze each other wherever three corners line up; what the clips leave standing opens those pairs.
    EXPECT_LT(static_cast<double>(marked), 1.05 * static_cast<double>(proven));
    EXPECT_LT(static_cast<double>(tight), 1.01 * static_cast<double>(proven)); // and without that strip they are shut
    EXPECT_GT(flooded, marked);
}

TEST(visibility, threads_do_not_change_a_bit) {
    std::mt19937 random(5);
    const GridMap map = grid_map(test::rooms(random, 3, 3), false, true);
    const Visibility one = compute(map);
    for (const int threads : {2, 7}) EXPECT_EQ(one.rows, compute(map, {}, threads).rows);
}

// Solid where there was air: no pair may appear that was not there before.
TEST(visibility, a_new_wall_never_adds_visibility) {
    for (unsigned seed = 0; seed < 12; ++seed) {
        std::mt19937 random(seed);
        const auto rows = test::random_rows(random, 8, 8, 0.2);
        const GridMap before = grid_map(rows);
        GridMap after = before; // the same clusters, one of them walled in
        const std::uint32_t walled = static_cast<std::uint32_t>(random() % before.cluster_count);
        std::erase_if(after.portals, [&](const VisPortal& p) { return p.cluster_front == walled || p.cluster_back == walled; });
        expect_subset(compute(after, {.fast = true}), compute(before, {.fast = true}));
        expect_subset(compute(after), compute(before));
    }
}

// Out of steps a portal keeps its loose set: still conservative, and counted.
TEST(visibility, an_exhausted_budget_is_loose_and_counted) {
    std::mt19937 random(9);
    const GridMap map = grid_map(test::rooms(random, 2, 2));
    const Visibility full = compute(map), fast = compute(map, {.fast = true});
    EXPECT_EQ(full.portals_over_budget, 0u);
    const Visibility cut = compute(map, {.step_budget = 20});
    EXPECT_GT(cut.portals_over_budget, 0u);
    expect_subset(full, cut);
    expect_subset(cut, fast);
}

TEST(visibility, unusable_portals_are_faults) {
    Context context;
    const std::vector<Vec3> square = {{0, 0, 0}, {0, 64, 0}, {0, 64, 64}, {0, 0, 64}};
    const std::vector<VisPortal> missing = {{0, 2, square}};
    Result<Visibility> v = compute_visibility(missing, 2, {}, context);
    ASSERT_FALSE(v);
    EXPECT_EQ(v.fault().diagnostic.code, "portal-cluster");
    std::vector<VisPortal> broken = {{0, 1, square}};
    broken[0].winding[1].x = std::numeric_limits<double>::quiet_NaN();
    v = compute_visibility(broken, 2, {}, context);
    ASSERT_FALSE(v);
    EXPECT_EQ(v.fault().diagnostic.code, "portal-winding");
    // No area: nothing may be concluded from its plane.
    const std::vector<VisPortal> line = {{0, 1, {{64, 0, 0}, {64, 64, 0}, {64, 128, 0}}}, {1, 2, square}};
    v = compute_visibility(line, 3, {}, context);
    ASSERT_TRUE(v);
    EXPECT_TRUE(v->sees(0, 2));
}

} // namespace
} // namespace kiln

#include "libs/core/process.h"
#include "tests/compiler/visibility/grid_map.h"
#include <algorithm>
#include <atomic>
#include <bit>
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

TEST(Visibility, without_portals_a_cluster_sees_itself_alone) {
    GridMap map;
    map.cluster_count = 70;
    EXPECT_EQ(pairs(compute(map)), 70u);
    map.cluster_count = 0;
    EXPECT_EQ(pairs(compute(map)), 0u);
}

// Two rooms joined through a door in a thick wall: everything in a row sees everything.
TEST(Visibility, rooms_in_a_row_all_see_each_other) {
    const GridMap map = grid_map({"##.##", ".....", "##.##"}, true);
    // top, row, bottom: one straight line through the row
    const Visibility v = compute(map);
    EXPECT_EQ(pairs(v), 9u);
}

// A corridor of unit cells that bends at right angles. From (0,0) a line must stay below y = 1 up to x = 2, so its slope is
// below 1, and then cannot climb past y = 2 before x = 3; from (1,0) it can. The blocked line only touches the corners.
TEST(Visibility, bent_corridor_matches_the_closed_form) {
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
TEST(Visibility, doors_in_one_wall_do_not_see_each_other) {
    for (const bool turn : {false, true}) {
        const GridMap map = grid_map({"###########", "#.#.#.#.#.#", "..........."}, true, turn);
        const Visibility v = compute(map);
        ASSERT_EQ(map.cluster_count, 6u);
        for (std::uint32_t a = 0; a < 5; ++a)
            for (std::uint32_t b = 0; b < 6; ++b) EXPECT_EQ(v.sees(a, b), a == b || b == 5) << a << b;
    }
}

// A slit of a hundredth of a unit is still a slit: nothing may close because it is thin.
TEST(Visibility, thin_portals_stay_open) {
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
TEST(Visibility, no_ray_finds_a_pair_outside_the_rows) {
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

// Twenty runs on each number of threads: all of what comes out, steps included, and of a budget that runs out as well.
TEST(Visibility, threads_do_not_change_a_bit) {
    std::mt19937 random(5);
    const GridMap map = grid_map(test::rooms(random, 3, 2), false, true);
    for (const std::uint64_t budget : {0, 700}) {
        const std::vector<std::uint8_t> one = to_bytes(compute(map, {.total_budget = budget}));
        for (const int threads : {1, 2, 8})
            for (int run = 0; run < 20; ++run) ASSERT_EQ(one, to_bytes(compute(map, {.total_budget = budget}, threads))) << threads;
    }
}

// Solid where there was air: no pair appears that was not there before, in the flood or in the flow, on grids whose corners line up
// by threes and on turned ones; and what lines prove of the smaller map is seen in both.
TEST(Visibility, a_new_wall_never_adds_visibility) {
    std::size_t fewer = 0;
    for (unsigned seed = 0; seed < 160; ++seed) {
        std::mt19937 random(seed);
        const auto rows = seed % 4 == 0 ? test::rooms(random, 2, 1) : test::random_rows(random, 6 + static_cast<int>(seed % 4), 7, 0.1 + 0.05 * (seed % 5));
        const GridMap before = grid_map(rows, seed % 8 == 1, seed & 2);
        GridMap after = before; // the same clusters, one of them walled in, or one way shut
        const std::uint32_t walled = static_cast<std::uint32_t>(random() % before.cluster_count);
        if (seed % 3) std::erase_if(after.portals, [&](const VisPortal& p) { return p.cluster_front == walled || p.cluster_back == walled; });
        else if (!after.portals.empty()) after.portals.erase(after.portals.begin() + static_cast<std::ptrdiff_t>(random() % after.portals.size()));
        expect_subset(compute(after, {.fast = true}), compute(before, {.fast = true}));
        for (const double epsilon : {1e-3, 1e-9}) {
            const Visibility was = compute(before, {.epsilon = epsilon}), is = compute(after, {.epsilon = epsilon, .rays = seed % 5 ? 128u : 0u});
            expect_subset(is, was);
            fewer += pairs(was) - pairs(is);
            if (seed % 3 == 0 || seed % 8 == 1 || epsilon < 1e-6) continue;
            GridMap walled_in = before;
            std::ranges::replace(walled_in.cluster, static_cast<int>(walled), -1);
            const std::vector<char> sure = test::proven_pairs(walled_in, random, 5000);
            for (std::uint32_t a = 0; a < before.cluster_count; ++a)
                for (std::uint32_t b = 0; b < before.cluster_count; ++b)
                    if (sure[std::size_t{a} * before.cluster_count + b]) {
                        EXPECT_TRUE(was.sees(a, b) && is.sees(a, b));
                    }
        }
    }
    EXPECT_GT(fewer, 1000u);
}

// Out of steps a portal keeps its loose set: still conservative, and counted.
TEST(Visibility, an_exhausted_budget_is_loose_and_counted) {
    std::mt19937 random(9);
    const GridMap map = grid_map(test::rooms(random, 2, 2));
    const Visibility full = compute(map), fast = compute(map, {.fast = true});
    EXPECT_TRUE(full.loose.empty());
    const Visibility cut = compute(map, {.step_budget = 3});
    EXPECT_FALSE(cut.loose.empty());
    expect_subset(full, cut);
    expect_subset(cut, fast);
}

TEST(Visibility, unusable_portals_are_faults) {
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

// Pairs that lines prove beforehand spare the flow work and change no bit of what it finds.
TEST(Visibility, proven_pairs_save_steps_and_change_nothing) {
    std::uint64_t without = 0, with = 0;
    for (unsigned seed = 0; seed < 16; ++seed) {
        std::mt19937 random(seed);
        const auto rows = seed % 2 ? test::rooms(random, 3, 2) : test::random_rows(random, 10, 10, 0.1 + 0.03 * (seed % 8));
        const GridMap map = grid_map(rows, seed & 4, seed & 8);
        const Visibility none = compute(map, {.rays = 0});
        for (const std::uint32_t rays : {1u, 16u, 300u}) {
            const Visibility some = compute(map, {.rays = rays}, 1 + static_cast<int>(seed % 3));
            ASSERT_EQ(some.rows, none.rows) << seed << " " << rays;
            if (rays == 300) with += some.steps;
        }
        without += none.steps;
    }
    EXPECT_LT(with, without * 9 / 10);
}

// A budget for all together: the same rows every time and for any number of threads, between those of the flow and of the
// flood; large enough, it changes nothing.
TEST(Visibility, a_total_budget_is_reproducible) {
    std::mt19937 random(11);
    const GridMap map = grid_map(test::rooms(random, 3, 3), false, true);
    const Visibility full = compute(map), fast = compute(map, {.fast = true});
    ASSERT_GT(full.steps, 500u);
    const std::vector<char> sure = test::proven_pairs(map, random, 100000);
    for (const std::uint64_t part : {1, 20, 60}) {
        const VisibilityOptions options{.total_budget = std::max<std::uint64_t>(1, full.steps * part / 100)};
        const Visibility cut = compute(map, options);
        for (std::uint32_t a = 0; a < map.cluster_count; ++a)
            for (std::uint32_t b = 0; b < map.cluster_count; ++b) ASSERT_TRUE(cut.sees(a, b) || !sure[std::size_t{a} * map.cluster_count + b]) << a << " " << b;
        expect_subset(cut, fast);
        EXPECT_FALSE(cut.loose.empty()) << part;
        EXPECT_LE(cut.steps, options.total_budget * 5 / 4 + map.portals.size() * 2) << part;
        for (const int threads : {2, 8}) {
            const Visibility again = compute(map, options, threads);
            EXPECT_EQ(again.rows, cut.rows) << part;
            EXPECT_EQ(again.loose, cut.loose) << part;
        }
    }
    const Visibility ample = compute(map, {.total_budget = full.steps * 1000});
    EXPECT_EQ(ample.rows, full.rows);
    EXPECT_TRUE(ample.loose.empty());
}

// Cancelled and taken up again, as often as it takes: what comes out in the end is what one run gives.
TEST(Visibility, goes_on_where_it_was_cancelled) {
    std::mt19937 random(12);
    const GridMap map = grid_map(test::rooms(random, 4, 3), false, true);
    const Visibility whole = compute(map);
    for (const std::uint64_t budget : {std::uint64_t{0}, whole.steps / 3}) {
        const VisibilityOptions options{.total_budget = budget};
        const Visibility once = compute(map, options);
        VisibilityProgress progress;
        int cancelled = 0;
        for (;; ++cancelled) {
            ASSERT_LT(cancelled, 1000);
            std::atomic<bool> stop{false};
            int waves = 0;
            Context context;
            context.stop = &stop;
            context.progress = [&](const std::string&, double) { stop = ++waves == 2; };
            progress = from_bytes<VisibilityProgress>(to_bytes(progress)); // as through a cache
            try {
                const auto v = compute_visibility(map.portals, map.cluster_count, options, context, {.progress = &progress});
                ASSERT_TRUE(v);
                EXPECT_EQ(v->rows, once.rows);
                EXPECT_EQ(v->loose, once.loose);
                EXPECT_EQ(v->steps, once.steps);
                break;
            } catch (const Cancelled&) {
            }
        }
        EXPECT_GT(cancelled, 2);
    }
}

// Out of time at once, before the flood is through: every portal loose, said so, and nothing closed.
TEST(Visibility, out_of_time_is_loose_and_valid) {
    std::mt19937 random(9);
    const GridMap map = grid_map(test::rooms(random, 2, 2));
    Context context;
    bool stopped = false;
    const auto v = compute_visibility(map.portals, map.cluster_count, {}, context, {.seconds = 1e-9, .stopped = &stopped});
    ASSERT_TRUE(v);
    EXPECT_TRUE(stopped);
    EXPECT_EQ(v->loose.size(), map.portals.size());
    expect_subset(compute(map, {.fast = true}), *v);
    const auto ample = compute_visibility(map.portals, map.cluster_count, {}, context, {.seconds = 1e6, .stopped = &stopped});
    EXPECT_FALSE(stopped);
    EXPECT_TRUE(ample->loose.empty());
}

// Cells of 64 in a row: from the far side of one to the near side of the n-th after it are 64 (n - 1).
TEST(Visibility, nothing_is_seen_beyond_the_radius) {
    for (const bool turn : {false, true}) {
        const GridMap map = grid_map({"............"}, false, turn);
        for (const double radius : {1.0, 100.0, 300.0, 1e6}) {
            const Visibility v = compute(map, {.radius = radius});
            for (int a = 0; a < 12; ++a)
                for (int b = 0; b < 12; ++b)
                    if (const double gap = 64.0 * (std::abs(a - b) - 1); !turn || gap <= radius) { // turned, the boxes are larger: it may see more
                        EXPECT_EQ(v.sees(static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b)), gap <= radius) << radius << " " << a << " " << b;
                    }
        }
        EXPECT_EQ(compute(map, {.radius = 0}).rows, compute(map).rows);
    }
}

// Chains and lines: there is one exactly where the rows say so, a chain leads from cluster to cluster, and a line goes
// forward through the middle of every portal of its chain.
TEST(Visibility, why_clusters_see_each_other) {
    std::size_t lines = 0, chains = 0;
    for (unsigned seed = 0; seed < 4; ++seed) {
        std::mt19937 random(seed);
        const GridMap map = grid_map(test::random_rows(random, 7, 6, 0.25), false, seed & 1);
        const Visibility v = compute(map);
        Context context;
        for (std::uint32_t a = 0; a < map.cluster_count; a += 3)
            for (std::uint32_t b = 0; b < map.cluster_count; b += 2) {
                const auto sight = find_sight(map.portals, map.cluster_count, a, b, {}, context);
                if (!sight) {
                    EXPECT_FALSE(v.sees(a, b)) << seed << ": " << a << " " << b;
                    continue;
                }
                std::uint32_t at = a;
                for (const std::uint32_t p : sight->portals) {
                    const VisPortal& portal = map.portals[p / 2];
                    EXPECT_EQ(p % 2 ? portal.cluster_back : portal.cluster_front, at);
                    at = p % 2 ? portal.cluster_front : portal.cluster_back;
                }
                EXPECT_EQ(at, b);
                chains += a != b, lines += !sight->line.empty();
                if (sight->line.empty()) continue;
                ASSERT_EQ(sight->line.size(), 2u);
                EXPECT_TRUE(v.sees(a, b));
                for (const std::uint32_t p : sight->portals) {
                    const std::vector<Vec3>& w = map.portals[p / 2].winding;
                    const Vec3 n = normalize(cross(w[1] - w[0], w[2] - w[0])), from = sight->line[0], way = sight->line[1] - from;
                    EXPECT_GT(dot(n, way) * (p % 2 ? 1 : -1), 0);
                    const Vec3 x = from + way * (dot(n, w[0] - from) / dot(n, way));
                    for (std::size_t i = 0; i < w.size(); ++i) EXPECT_GT(dot(cross(n, w[(i + 1) % w.size()] - w[i]), x - w[i]), 0);
                }
            }
        EXPECT_FALSE(find_sight(map.portals, map.cluster_count, 0, map.cluster_count, {}, context));
    }
    EXPECT_GT(lines, chains * 9 / 10);
}

// An open grid: everything sees everything along very many chains. What is known prunes them.
TEST(Visibility, an_open_grid_ends) {
    const GridMap map = grid_map(std::vector<std::string>(24, std::string(24, '.')));
    const Visibility v = compute(map, {}, 2);
    EXPECT_EQ(pairs(v), 576u * 576u);
    EXPECT_TRUE(v.loose.empty());
    EXPECT_LT(v.steps, 1000000u);
}

// 4096 cells with pillars among them, where chains are without number: time is up wherever it is up, in the flood, in the passages, in the
// lines or in the flow, and what is left is valid.
TEST(Visibility, a_large_grid_ends_in_time) {
    std::vector<std::string> rows(64, std::string(64, '.'));
    for (std::size_t y = 5; y < 64; y += 9)
        for (std::size_t x = 3 + y % 5; x < 64; x += 7) rows[y][x] = '#';
    const GridMap map = grid_map(rows);
    std::mt19937 random(2);
    const std::vector<char> sure = test::proven_pairs(map, random, 20000);
    for (const double seconds : {0.02, 0.3, 1.5}) {
        Context context;
        context.threads = 2;
        bool stopped = false;
        const double begin = cpu_seconds(); // a busy machine takes longer, but no more of that
        const auto v = compute_visibility(map.portals, map.cluster_count, {}, context, {.seconds = seconds, .stopped = &stopped});
        const double took = cpu_seconds() - begin;
        ASSERT_TRUE(v);
        validate(*v);
        EXPECT_TRUE(stopped);
        EXPECT_FALSE(v->loose.empty());
        EXPECT_LT(took, 2 * seconds + 4) << seconds; // two threads, and the rows and the plane tests that are under way
        for (std::uint32_t a = 0; a < map.cluster_count; ++a)
            for (std::uint32_t b = 0; b < map.cluster_count; ++b) ASSERT_TRUE(v->sees(a, b) || !sure[std::size_t{a} * map.cluster_count + b]) << seconds;
    }
}

} // namespace
} // namespace kiln

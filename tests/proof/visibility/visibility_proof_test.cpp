// Short forms of the proofs of visibility: exact pairs of small grids, random lines through maps.
#include "libs/core/file.h"
#include "tests/proof/geometry/pipeline.h"
#include "tests/proof/visibility/exact_grid.h"
#include "tests/proof/visibility/sightlines.h"
#include "tests/support/world_builder.h"
#include <gtest/gtest.h>

namespace kiln::proof {
namespace {

using test::WorldBuilder;

// The exact pairs themselves: those of a bent corridor (its closed form stands in the tests of the stage), and on random
// grids what rays prove is among them, and nearly all of them are proven.
TEST(ExactGrid, AgreesWithClosedFormAndRays) {
    const test::GridMap bent = test::grid_map({"...", "##.", "##.", "##.", "##."});
    const std::vector<char> seen = exact_pairs(bent);
    for (std::size_t to = 0; to < 7; ++to) {
        EXPECT_EQ(seen[to] != 0, to < 4) << to;
        EXPECT_EQ(seen[7 + to] != 0, true) << to;
    }
    std::size_t exact = 0, proven = 0;
    for (unsigned seed = 0; seed < 6; ++seed) {
        std::mt19937 random(seed);
        const test::GridMap map = test::grid_map(test::random_rows(random, 8, 8, 0.3));
        const std::vector<char> pairs = exact_pairs(map), rays = test::proven_pairs(map, random, 200000);
        for (std::size_t i = 0; i < pairs.size(); ++i) {
            EXPECT_TRUE(pairs[i] || !rays[i]);
            EXPECT_EQ(pairs[i], pairs[i % map.cluster_count * map.cluster_count + i / map.cluster_count]);
            exact += pairs[i] != 0, proven += rays[i] != 0;
        }
    }
    EXPECT_GT(static_cast<double>(proven), 0.99 * static_cast<double>(exact));
}

// The flow is never below the exact pairs, and hardly above them.
TEST(VisibilityProof, NeverBelowTheExactPairsOfAGrid) {
    std::size_t exact = 0, marked = 0;
    for (unsigned seed = 0; seed < 60; ++seed) {
        std::mt19937 random(seed);
        const auto rows = seed % 4 == 0 ? test::rooms(random, 2, 1) : test::random_rows(random, 5 + static_cast<int>(seed % 5), 5 + static_cast<int>(seed % 4), 0.15 + 0.05 * (seed % 6));
        const test::GridMap map = test::grid_map(rows, false, seed & 2);
        const std::vector<char> pairs = exact_pairs(map);
        Context context;
        const auto v = compute_visibility(map.portals, map.cluster_count, {}, context);
        ASSERT_TRUE(v);
        for (std::uint32_t a = 0; a < map.cluster_count; ++a)
            for (std::uint32_t b = 0; b < map.cluster_count; ++b) {
                const bool is = pairs[std::size_t{a} * map.cluster_count + b];
                ASSERT_TRUE(v->sees(a, b) || !is) << "seed " << seed << ": " << a << " sees " << b;
                exact += is, marked += v->sees(a, b);
            }
    }
    EXPECT_LT(static_cast<double>(marked), 1.06 * static_cast<double>(exact));
}

Visibility of(const Geometry& g) {
    Context context;
    auto v = compute_visibility(vis_portals(g.bsp), g.bsp.cluster_count, {}, context);
    EXPECT_TRUE(v);
    return *std::move(v);
}

// What the lines are worth: a pair struck from true rows is found.
TEST(VisibilityProof, ALineFindsAPairThatWasStruck) {
    const auto bytes = read_file(std::string(KILN_SOURCE_DIR) + "/maps/two_rooms/two_rooms.vmf");
    ASSERT_TRUE(bytes);
    const Geometry g = run_text({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, "two_rooms.vmf", {.csg = {}, .bsp = {}, .last = "bsp", .threads = 1});
    ASSERT_EQ(g.stage, "bsp");
    Visibility v = of(g);
    Context context;
    const auto portals = vis_portals(g.bsp);
    ASSERT_FALSE(portals.empty());
    const Sightlines good = find_sightlines(g.bsp, portals, v, 20000, 1, context);
    EXPECT_EQ(good.missing, 0u);
    EXPECT_GT(good.pairs_checked, 10000u);
    EXPECT_LT(good.excess(), 1.2);
    const std::uint32_t a = portals[0].cluster_front, b = portals[0].cluster_back;
    for (const auto& [x, y] : {std::pair{a, b}, std::pair{b, a}}) v.rows[x * v.words_per_row() + y / 64] &= ~(std::uint64_t{1} << (y % 64));
    const Sightlines bad = find_sightlines(g.bsp, portals, v, 20000, 1, context);
    EXPECT_GT(bad.missing, 0u);
    ASSERT_FALSE(bad.misses.empty());
    EXPECT_EQ(std::minmax(bad.misses[0].from, bad.misses[0].to), std::minmax(a, b));
}

class OnMaps : public ::testing::TestWithParam<const char*> {};
TEST_P(OnMaps, NoLineFindsAPairOutsideTheRows) {
    const auto path = shared_map(GetParam());
    if (!path) GTEST_SKIP() << "the map collection is not at hand";
    const auto bytes = read_file(*path);
    ASSERT_TRUE(bytes);
    const Geometry g = run_text({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, *path, {.csg = {}, .bsp = {}, .last = "bsp", .threads = 2});
    ASSERT_EQ(g.stage, "bsp");
    const Visibility v = of(g);
    Context context;
    context.threads = 2;
    const Sightlines s = find_sightlines(g.bsp, vis_portals(g.bsp), v, 200000, 7, context);
    EXPECT_EQ(s.missing, 0u);
    EXPECT_GT(s.proven, v.cluster_count);
    for (const Miss& m : s.misses) ADD_FAILURE() << m.from << " sees " << m.to << ": " << m.a.x << " " << m.a.y << " " << m.a.z << " to " << m.b.x << " " << m.b.y << " " << m.b.z;
}
INSTANTIATE_TEST_SUITE_P(VisibilityProof, OnMaps, ::testing::Values("athwale-hammer/lambda_bunker_v2.vmf", "id-quake-map-source/start.map"));

// Where the classic compilers lose things: wedges between leaves, portals nearly in one plane, slits, blocks of a city.
// Random lines find nothing that is missing, whatever the parameter.
// Nothing is merged or closed for being thin.
const RunOptions kExactly{.csg = {.plane_merge_distance = 0}, .bsp = {.micro_gap = 0}, .last = "bsp", .threads = 1};
void expect_no_misses(WorldBuilder& w, const std::string& what) {
    w.point_entity("info_player_start", {8, 8, 8});
    const Geometry g = run(w.world, kExactly);
    ASSERT_EQ(g.stage, "bsp") << what;
    const Visibility v = of(g);
    validate(v);
    Context context;
    const Sightlines s = find_sightlines(g.bsp, vis_portals(g.bsp), v, 60000, 3, context);
    EXPECT_EQ(s.missing, 0u) << what;
    EXPECT_GT(s.pairs_checked, 1000u) << what;
    for (const Miss& m : s.misses) ADD_FAILURE() << what << ": " << m.from << " sees " << m.to << ": " << m.a.x << " " << m.a.y << " " << m.a.z << " to " << m.b.x << " " << m.b.y << " " << m.b.z;
}

// A wall with a door whose faces are turned against each other by a slope of 1/2 to 2^-34: leaves between are wedges.
TEST(VisibilityStability, WedgeLeaves) {
    for (const double slope : {0.5, 1.0 / 16, 1.0 / 256, 1.0 / 4096, 1.0 / 65536, 0x1p-24, 0x1p-34}) {
        WorldBuilder w;
        w.room({0, 0, 0}, {512, 512, 128});
        for (int i = 0; i < 4; ++i) {
            const double x = 96 + 96 * i, lo = 64 + 32 * (i % 3), d = slope * 64;
            const auto slab = [&](double y0, double y1) { // its right side leans
                const std::vector<Vec2> base = {{x, y0}, {x + 16, y0}, {x + 16 + d, y1}, {x, y1}};
                w.prism(base, 0, 128);
            };
            slab(0, lo), slab(lo + 64, 512);
        }
        expect_no_misses(w, "slope " + std::to_string(slope));
    }
}

// Walls that step back by a hair from one to the next: their faces cut leaves by planes that nearly coincide.
TEST(VisibilityStability, NearlyCoplanarPortals) {
    for (const double step : {1.0, 1.0 / 32, 1.0 / 1024, 1.0 / 65536}) {
        WorldBuilder w;
        w.room({0, 0, 0}, {512, 256, 128});
        for (int i = 0; i < 6; ++i) {
            const double x = 48 + 72 * i;
            w.box({x, 0, 0}, {x + 40, 96 + step * i, 128});
            w.box({x, 160 - step * (i % 3), 0}, {x + 40, 256, 128});
        }
        expect_no_misses(w, "step " + std::to_string(step));
    }
}

TEST(VisibilityStability, Slits) {
    for (const double slit : {4.0, 1.0 / 8, 1.0 / 128, 1.0 / 1024}) {
        WorldBuilder w;
        w.room({0, 0, 0}, {320, 128, 64});
        for (const double x : {64.0, 144.0, 224.0}) {
            w.box({x, 0, 0}, {x + 16, 64, 64});
            w.box({x, 64 + slit, 0}, {x + 16, 128, 64});
        }
        expect_no_misses(w, "slit " + std::to_string(slit));
        // One line sees through all slits: the rooms at the ends see each other.
        const Geometry g = run(w.world, kExactly);
        const Visibility v = of(g);
        const auto at = [&](Vec3 p) { return g.bsp.leaves[leaf_at(g.bsp, p).at()].cluster.value; };
        EXPECT_TRUE(v.sees(at({8, 64 + slit / 2, 32}), at({312, 64 + slit / 2, 32}))) << slit;
    }
}

// Blocks whose tops are flush, and a wall of doors: dozens of portals that lie in one plane, and planes that run along all of them.
TEST(VisibilityStability, PortalsInAPlane) {
    for (const double rise : {0.0, 1.0 / 1024}) { // flush, and nearly so
        WorldBuilder w;
        w.room({0, 0, 0}, {640, 512, 192});
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < 4; ++j) w.box({40.0 + 72 * i, 40.0 + 112 * j, 0}, {80.0 + 72 * i, 104.0 + 112 * j, 64 + rise * ((i + 2 * j) % 3)});
        for (int j = 0; j < 5; ++j) w.box({400, 100.0 * j, 0}, {416, 100.0 * j + 64, 192}); // doors of 36 between, the last at the wall
        for (int j = 0; j < 5; ++j) w.box({416, 100.0 * j + 24, 0}, {640, 100.0 * j + 40, 192});
        expect_no_misses(w, "rise " + std::to_string(rise));
    }
}

TEST(VisibilityStability, CityGrid) {
    WorldBuilder w;
    w.room({0, 0, 0}, {704, 704, 256});
    std::mt19937 random(1);
    for (int i = 0; i < 5; ++i)
        for (int j = 0; j < 5; ++j) w.box({64.0 + 128 * i, 64.0 + 128 * j, 0}, {128.0 + 128 * i, 128.0 + 128 * j, 64.0 + 16 * (random() % 10)});
    expect_no_misses(w, "city");
}

} // namespace
} // namespace kiln::proof

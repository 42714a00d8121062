// Another implementation with exact numbers finds the same fragments.
#include "tests/proof/geometry/oracle.h"
#include "tests/proof/geometry/pipeline.h"
#include "tests/proof/geometry/scenes.h"
#include <gtest/gtest.h>

namespace kiln::proof {
namespace {

Csg cut(const World& world, const CsgOptions& options) {
    RunOptions run_options;
    run_options.csg = options;
    run_options.last = "csg";
    Geometry g = run(world, run_options);
    if (g.fault) throw std::runtime_error(to_text(g.fault->diagnostic));
    return std::move(g.csg);
}

TEST(Oracle, RandomBrushesFromTheText) {
    const SoupOptions kinds[] = {{.bits = 0, .range = 24, .size = 16}, {.bits = 0, .range = 30, .size = 24, .mixed = true},
                                 {.bits = 5, .mixed = true}, {.bits = 10, .range = 60}};
    for (const SoupOptions& o : kinds) {
        const World world = soup(1, 60, o);
        const Csg csg = cut(world, {.plane_merge_distance = 0});
        const Findings f = compare_fragments(world, csg, OraclePlanes::text, 5);
        EXPECT_TRUE(f.ok()) << "bits " << o.bits << ": " << f;
        EXPECT_GT(f.checked, 40u);
    }
}

TEST(Oracle, ASoupOfHundreds) {
    const World world = soup(7, 600, {.bits = 3, .range = 150, .size = 60, .mixed = true});
    const Findings f = compare_fragments(world, cut(world, {.plane_merge_distance = 0}), OraclePlanes::text, 60);
    EXPECT_TRUE(f.ok()) << f;
}

// What CGAL makes of the planes after canonicalisation, on a map turned by odd angles and saved coarsely.
TEST(Oracle, TurnedMaps) {
    for (const char* name : {"id-quake-map-source/e1m1.map", "id-quake-map-source/start.map"})
        for (const double step : {1.0 / 16, 1.0 / 1024}) {
            const auto path = shared_map(name);
            if (!path) GTEST_SKIP() << name << " is not here";
            Context context;
            const World world = turned(*load_world(*path, context), step);
            const Findings f = compare_fragments(world, cut(world, {}), OraclePlanes::csg, 251);
            EXPECT_TRUE(f.ok()) << name << ": " << f;
            EXPECT_GT(f.checked, 20u);
        }
}

TEST(Oracle, NefUnionsOfAFew) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        const World world = soup(seed, 10, {.bits = static_cast<int>(seed % 3) * 2, .range = 20, .size = 24});
        const Findings f = compare_union(world, cut(world, {.plane_merge_distance = 0}));
        EXPECT_TRUE(f.ok()) << "seed " << seed << ": " << f;
    }
}

// The oracle is no rubber stamp: a missing fragment, a wrong front and a fragment too large are found.
TEST(Oracle, FindsWhatIsWrong) {
    const World world = soup(3, 12, {.range = 12, .size = 16, .mixed = true});
    const Csg right = cut(world, {.plane_merge_distance = 0});
    ASSERT_TRUE(compare_fragments(world, right, OraclePlanes::text, 1).ok());
    Csg wrong = right;
    wrong.fragments.pop_back();
    EXPECT_FALSE(compare_fragments(world, wrong, OraclePlanes::text, 1).ok());
    wrong = right;
    wrong.fragments.front().front = Contents::slime;
    EXPECT_FALSE(compare_fragments(world, wrong, OraclePlanes::text, 1).ok());
    wrong = right;
    for (Fragment& f : wrong.fragments)
        for (std::size_t b = 0; b < right.brushes.size(); ++b)
            for (std::size_t i = 0; i < right.brushes[b].faces.size(); ++i)
                if (right.brushes[b].sides[i] == f.side) f.polygon = right.brushes[b].faces[i];
    EXPECT_FALSE(compare_fragments(world, wrong, OraclePlanes::text, 1).ok());
}

} // namespace
} // namespace kiln::proof

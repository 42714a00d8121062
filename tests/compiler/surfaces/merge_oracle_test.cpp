// Merging by edges against the Boolean set operations of CGAL, on all visible parts of real maps: the same regions, to
// the vertex.
#include "compiler/surfaces/regions.h"
#include "compiler/surfaces/surfaces.h"
#include "tests/compiler/bsp/map_support.h"
#include <cstdlib>
#include <filesystem>
#include <gtest/gtest.h>
#include <map>
#include <tuple>

namespace kiln {
namespace {

// Maps to try, relative to the map collection; KILN_ALL_MAPS in the environment: every one there is.
std::vector<std::string> map_paths() {
    const std::filesystem::path root = std::filesystem::path(KILN_SOURCE_DIR) / "../shared/maps";
    if (!std::getenv("KILN_ALL_MAPS"))
        return {(root / "id-quake-map-source/e1m1.map").string(), (root / "librequake/lqdm1.map").string(), (root / "athwale-hammer/lambda_bunker_v2.vmf").string()};
    std::vector<std::string> paths;
    if (!std::filesystem::exists(root)) return paths;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root))
        if (const auto e = entry.path().extension(); e == ".map" || e == ".vmf") paths.push_back(entry.path().string());
    std::ranges::sort(paths);
    return paths;
}

struct Sum {
    std::size_t groups = 0, polygons = 0, regions = 0, holes = 0, refused = 0;
};

void compare(const World& world, Sum& sum) {
    Context context;
    const Result<Csg> csg = build_csg(world, {}, context);
    if (!csg) return;
    Result<Bsp> bsp = build_bsp(world, *csg, {}, context);
    ASSERT_TRUE(bsp);
    if (bsp->visible.size() < csg->fragments.size() / 4) { // not sealed
        bsp = build_bsp(world, *csg, {.fill = false}, context);
        ASSERT_TRUE(bsp);
    }
    VertexTable vertices(bsp->planes);
    std::map<std::tuple<ModelId, SideId, PlaneId>, Polygons> groups;
    for (const VisibleFragment& v : bsp->visible) {
        const Fragment& f = csg->fragments[v.fragment];
        vertices.add(v.polygon, groups[{f.model, f.side, v.polygon.support}]);
    }
    for (const auto& [key, polygons] : groups) {
        if (polygons.size() == 1) continue;
        const PlaneId plane = std::get<2>(key);
        const auto by_edges = merge_by_edges(vertices, plane, polygons);
        ++sum.groups, sum.polygons += polygons.size();
        if (!by_edges) {
            ++sum.refused;
            continue;
        }
        const auto by_union = merge_by_union(vertices, plane, polygons);
        ASSERT_TRUE(by_union);
        const std::string where = world.file + ", line " + std::to_string(world.location(std::get<1>(key)).line);
        ASSERT_EQ(by_edges->size(), by_union->size()) << where;
        for (std::size_t i = 0; i < by_edges->size(); ++i) {
            const Region &a = (*by_edges)[i], &b = (*by_union)[i];
            ASSERT_EQ(a.members, b.members) << where;
            ASSERT_EQ(a.loops.size(), b.loops.size()) << where;
            for (std::size_t k = 0; k < a.loops.size(); ++k) ASSERT_EQ(a.loops[k].vertices, b.loops[k].vertices) << where << ", loop " << k;
            ++sum.regions, sum.holes += a.loops.size() - 1;
        }
    }
}

TEST(MergeOracle, EdgesAndUnionGiveTheSameRegions) {
    std::size_t maps = 0;
    Sum all;
    for (const std::string& path : map_paths()) {
        if (!std::filesystem::exists(path)) continue;
        Context context;
        const std::optional<World> world = test::real_world(path, context);
        if (!world) continue;
        ++maps;
        Sum sum;
        compare(*world, sum);
        if (sum.groups > 0) printf("%s: %zu groups of %zu parts, %zu regions, %zu holes, %zu left to the union\n", std::filesystem::path(path).filename().c_str(), sum.groups, sum.polygons, sum.regions, sum.holes, sum.refused);
        all.groups += sum.groups, all.regions += sum.regions, all.holes += sum.holes, all.refused += sum.refused;
    }
    if (maps == 0) GTEST_SKIP() << "map collection not here";
    EXPECT_GT(all.groups, 500u);
    EXPECT_GT(all.holes, 20u);
    EXPECT_LE(all.refused * 1000, all.groups) << "the fast way is taken too rarely";
}

} // namespace
} // namespace kiln

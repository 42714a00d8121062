// Merging by edges against the Boolean set operations of CGAL, on all visible parts of real maps: the same regions, to
// the vertex. But for one thing: three parts that touch only in their corners, round a hole, are one region to the union
// (its boundary is one loop) and three by edges, which is what a region is meant to be.
#include "compiler/surfaces/regions.h"
#include "compiler/surfaces/surfaces.h"
#include "compiler/surfaces/tjunctions.h"
#include "tests/compiler/bsp/map_support.h"
#include <cstdlib>
#include <filesystem>
#include <gtest/gtest.h>
#include <map>
#include <set>
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
    std::size_t groups = 0, polygons = 0, regions = 0, holes = 0, refused = 0, corners_only = 0;
};

double area(const VertexTable& vertices, PlaneId plane, const std::vector<Region>& regions) {
    double sum = 0;
    for (const Region& r : regions)
        for (const auto& t : triangulate(vertices, plane, r.loops))
            sum += 0.5 * dot(vertices.planes().normal(plane), cross(vertices.position(t[1]) - vertices.position(t[0]), vertices.position(t[2]) - vertices.position(t[0])));
    return sum;
}

// `fine` divides the regions of `coarse`, and no two of its regions share any part of an edge.
void divides(const VertexTable& vertices, PlaneId plane, std::vector<Region> fine, std::vector<Region> coarse, const std::string& where) {
    EXPECT_GT(fine.size(), coarse.size()) << where;
    Context context;
    for (std::vector<Region>* regions : {&fine, &coarse}) {
        std::vector<FaceOutlines> all;
        for (Region& r : *regions) all.push_back({plane, &r.loops});
        insert_tjunctions(vertices, all, context);
    }
    EXPECT_NEAR(area(vertices, plane, fine), area(vertices, plane, coarse), 1e-9 * area(vertices, plane, fine)) << where;
    for (const Region& f : fine)
        EXPECT_TRUE(std::ranges::any_of(coarse, [&](const Region& c) { return std::ranges::includes(c.members, f.members); })) << where;
    std::set<std::pair<VertexId, VertexId>> edges;
    for (const Region& r : fine)
        for (const Outline& l : r.loops)
            for (std::size_t i = 0; i < l.vertices.size(); ++i) {
                const VertexId a = l.vertices[i], b = l.vertices[(i + 1) % l.vertices.size()];
                EXPECT_TRUE(edges.emplace(a, b).second) << where;
                EXPECT_FALSE(edges.contains({b, a})) << where;
            }
}

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
        if (by_edges->size() != by_union->size()) {
            ++sum.corners_only;
            divides(vertices, plane, *by_edges, *by_union, where);
            continue;
        }
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
        if (sum.groups > 0) printf("%s: %zu groups of %zu parts, %zu regions, %zu holes, %zu left to the union, %zu joined at corners by it\n", std::filesystem::path(path).filename().c_str(), sum.groups, sum.polygons, sum.regions, sum.holes, sum.refused, sum.corners_only);
        all.groups += sum.groups, all.regions += sum.regions, all.holes += sum.holes, all.refused += sum.refused;
    }
    if (maps == 0) GTEST_SKIP() << "map collection not here";
    EXPECT_GT(all.groups, 500u);
    EXPECT_GT(all.holes, 20u);
    EXPECT_LE(all.refused * 1000, all.groups) << "the fast way is taken too rarely";
}

} // namespace
} // namespace kiln

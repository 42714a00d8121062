// What the tree must do for the designer: hints, leaks, and other people's small maps whose names say what they test.
#include "tests/proof/geometry/laws.h"
#include "tests/proof/geometry/pipeline.h"
#include "tests/proof/geometry/scenes.h"
#include "tests/proof/geometry/shape.h"
#include <gmock/gmock.h>
#include <set>

namespace kiln::proof {
namespace {

RunOptions to_tree() {
    RunOptions options;
    options.last = "bsp";
    return options;
}

bool coplanar(PlaneId a, PlaneId b) { return (a.value | 1u) == (b.value | 1u); }

// A hint polygon is reached whole: no plane above it but another hint's cuts it, and in the end it runs through no leaf.
Findings hints(const Csg& csg, const Bsp& bsp) {
    Findings out;
    std::set<std::uint32_t> hint_planes;
    for (const Fragment& f : csg.fragments)
        if (f.behind == Contents::hint) hint_planes.insert(f.polygon.support.value | 1u);
    for (const Fragment& f : csg.fragments) {
        if (f.behind != Contents::hint) continue;
        ++out.checked;
        std::vector<std::pair<std::int32_t, PlanePolygon>> stack{{bsp.nodes.empty() ? -1 : 0, f.polygon}};
        while (!stack.empty()) {
            auto [at, polygon] = std::move(stack.back());
            stack.pop_back();
            if (at < 0) {
                if (bsp.leaves[static_cast<std::size_t>(-1 - at)].open()) out.add("a hint runs through an open leaf");
                continue;
            }
            const BspNode& node = bsp.nodes[static_cast<std::size_t>(at)];
            if (coplanar(node.plane, polygon.support)) continue;
            SplitPolygon parts = split(bsp.planes, polygon, node.plane);
            if (parts.front && parts.back && !hint_planes.contains(node.plane.value | 1u)) out.add("a hint is cut by a plane of no hint");
            if (parts.front) stack.emplace_back(node.child[0], std::move(*parts.front));
            if (parts.back) stack.emplace_back(node.child[1], std::move(*parts.back));
        }
    }
    return out;
}

// Every node's plane is that of a brush side: no grid of blocks cuts the world.
Findings planes_of_brushes(const Csg& csg, const Bsp& bsp) {
    Findings out;
    std::set<std::uint32_t> known;
    for (const BrushPolytope& b : csg.brushes)
        for (const PlanePolygon& f : b.faces) known.insert(f.support.value | 1u);
    for (const BspNode& n : bsp.nodes) {
        ++out.checked;
        if (!known.contains(n.plane.value | 1u)) out.add("a node's plane is no brush's");
    }
    return out;
}

TEST(Tree, HintsAreCutByHintsAlone) {
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
        Dice dice(seed);
        WorldBuilder w;
        w.room({-256, -256, 0}, {256, 256, 256});
        const MaterialId hint = w.material("hint", kHint), skip = w.material("skip", kSkip);
        for (int i = 0; i < 14; ++i) {
            const Vec3 p{dice.on_grid(-240, 200, 0), dice.on_grid(-240, 200, 0), 0};
            w.box(p, p + Vec3{dice.on_grid(8, 60, 0), dice.on_grid(8, 60, 0), dice.on_grid(16, 256, 0)});
        }
        for (int i = 0; i < 4; ++i) {
            const double x = dice.on_grid(-200, 200, 0), y = dice.on_grid(-200, 100, 0);
            const BrushId b = i % 2 ? w.box({x, y, 0}, {x + 8, y + 150, 256}, Contents::hint, {0}, skip)
                                    : w.prism(std::vector<Vec2>{{x, y}, {x + 90, y + 40}, {x + 80, y + 48}}, 0, 256, Contents::hint, {0}, skip);
            w.world.sides[w.world.brushes[b.at()].first_side + (i % 2 ? 0 : 2)].material = hint;
        }
        w.point_entity("light", {0, 0, 250});
        const Geometry g = run(w.world, to_tree());
        ASSERT_FALSE(g.fault);
        RunOptions open;
        open.bsp.fill = false, open.last = "bsp";
        const Geometry unfilled = run(w.world, open); // nothing is merged away
        for (const Findings& f : {hints(unfilled.csg, unfilled.bsp), planes_of_brushes(g.csg, g.bsp)}) {
            EXPECT_TRUE(f.ok()) << "seed " << seed << ": " << f;
            EXPECT_GE(f.checked, 4u);
        }
    }
}

TEST(Tree, NoBlocksCutRealMaps) {
    // For one no more than the compilers it was made with: theirs 1,167 clusters and 3,062 portals.
    struct Real {
        const char* map;
        std::size_t most_clusters, most_portals;
    };
    std::size_t seen = 0;
    for (const Real& real : {Real{"id-quake-map-source/e1m1.map", 1167, 3062}, Real{"id-quake-map-source/start.map", SIZE_MAX, SIZE_MAX},
                             Real{"athwale-hammer/lambda_bunker_v2.vmf", SIZE_MAX, SIZE_MAX}}) {
        const auto path = shared_map(real.map);
        if (!path) continue;
        SCOPED_TRACE(real.map);
        ++seen;
        Context context;
        const Geometry g = run(*load_world(*path, context), to_tree());
        const Findings planes = planes_of_brushes(g.csg, g.bsp);
        EXPECT_TRUE(planes.ok()) << planes;
        EXPECT_GT(planes.checked, 100u);
        EXPECT_LE(g.bsp.cluster_count, real.most_clusters);
        EXPECT_LE(g.bsp.portals.size(), real.most_portals);
    }
    if (seen == 0) GTEST_SKIP() << "the real maps are not here";
}

// Rooms joined by doorways, k holes to the outside of all sizes: k leaks, each at its hole, whatever else there is.
TEST(Leaks, EveryHoleIsReported) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
        Dice dice(seed);
        WorldBuilder w;
        const int rooms = 3;
        std::vector<Vec3> holes;
        for (int r = 0; r < rooms; ++r) {
            const double x = r * 272.0;
            w.box({x - 16, -16, -16}, {x + 272, 272, 0});
            w.box({x - 16, -16, 128}, {x + 272, 272, 144});
            // Walls -y and +y: closed, or with one hole.
            for (const double y : {-16.0, 256.0}) {
                const double size = std::exp2(static_cast<double>(dice.below(5))); // 1 to 16
                if (dice.below(2)) {
                    w.box({x, y, 0}, {x + 256, y + 16, 128});
                    continue;
                }
                const double hx = x + dice.on_grid(20, 220, 0), hz = dice.on_grid(20, 90, 0);
                w.box({x, y, 0}, {hx, y + 16, 128}), w.box({hx + size, y, 0}, {x + 256, y + 16, 128});
                w.box({hx, y, 0}, {hx + size, y + 16, hz}), w.box({hx, y, hz + size}, {hx + size, y + 16, 128});
                holes.push_back({hx + size / 2, y + 8, hz + size / 2});
            }
            // The wall to the next room has a door; the outermost are closed.
            w.box({x - 16, -16, 0}, {x, 100, 128}), w.box({x - 16, 164, 0}, {x, 272, 128});
            if (r == 0) w.box({x - 16, 100, 0}, {x, 164, 128});
            else w.box({x - 16, 100, 96}, {x, 164, 128});
            w.point_entity("light", {x + dice.on_grid(16, 240, 0), dice.on_grid(16, 240, 0), dice.on_grid(16, 112, 0)});
        }
        w.box({rooms * 272.0 - 16, -16, 0}, {rooms * 272.0, 272, 128});
        const Geometry g = run(w.world, to_tree());
        ASSERT_FALSE(g.fault);
        EXPECT_EQ(g.leak.has_value(), !holes.empty());
        EXPECT_EQ(g.count("leak"), holes.size()) << "seed " << seed;
        for (const Vec3& h : holes) {
            std::size_t named = 0;
            for (const Diagnostic& d : g.diagnostics) {
                double x = 0, y = 0, z = 0;
                const auto at = d.message.find("the opening at (");
                if (d.code != "leak" || at == std::string::npos || std::sscanf(d.message.c_str() + at + 16, "%lf %lf %lf", &x, &y, &z) != 3) continue;
                named += std::abs(x - h.x) < 0.01 && std::abs(z - h.z) < 0.01 && std::abs(y - h.y) <= 8;
            }
            EXPECT_EQ(named, 1u) << "seed " << seed << ", the hole at " << h.x << ' ' << h.y << ' ' << h.z;
        }
    }
}

// One room, one square hole: the shortest path goes to the nearest point of the hole and straight out, 16 through the
// wall and 16 to the world's box.
TEST(Leaks, ThePathIsTheShortest) {
    Dice dice(3);
    for (int round = 0; round < 25; ++round) {
        WorldBuilder w;
        auto walls = w.room({0, 0, 0}, {256, 256, 128});
        w.world.brushes[walls[1].at()].contents = Contents::trigger;
        const double size = dice.on_grid(1, 40, 0), y = dice.on_grid(8, 200, 0), z = dice.on_grid(8, 80, 0);
        w.box({256, 0, 0}, {272, y, 128}), w.box({256, y + size, 0}, {272, 256, 128});
        w.box({256, y, 0}, {272, y + size, z}), w.box({256, y, z + size}, {272, y + size, 128});
        const Vec3 p{dice.on_grid(8, 248, 0), dice.on_grid(8, 248, 0), dice.on_grid(8, 120, 0)};
        w.point_entity("light", p);
        const Geometry g = run(w.world, to_tree());
        ASSERT_TRUE(g.leak);
        const Vec3 nearest{256, std::clamp(p.y, y, y + size), std::clamp(p.z, z, z + size)};
        double found = 0;
        for (std::size_t i = 1; i < g.leak->path.size(); ++i) found += length(g.leak->path[i] - g.leak->path[i - 1]);
        const double least = length(nearest - p) + 32; // the path found keeps a little off the corners
        EXPECT_GE(found, least - 1e-6) << round;
        EXPECT_LE(found, least * 1.01 + 1) << round;
        EXPECT_EQ(g.leak->path.front(), p);
    }
}

// ---- small maps of another compiler's suite: the names say what they test ----

// Does the void reach an entity? By flooding cells of `cell` units, with none of the tree: right where walls and openings
// are thicker than that. Nothing for worlds of too many cells.
std::optional<bool> leaks_by_cells(const Geometry& g, double cell, double most_cells) {
    Box3 box;
    for (const BrushPolytope& b : g.csg.brushes)
        if (b.valid) box.add(b.bounds);
    for (const WorldEntity& e : g.world.entities)
        if (e.has_origin) box.add(e.origin);
    std::array<std::size_t, 3> n{};
    for (std::size_t k = 0; k < 3; ++k) {
        box.lo[k] = std::floor(box.lo[k] / cell) * cell - 2 * cell;
        n[k] = static_cast<std::size_t>(std::ceil((box.hi[k] - box.lo[k]) / cell)) + 2;
    }
    if (static_cast<double>(n[0]) * static_cast<double>(n[1]) * static_cast<double>(n[2]) > most_cells) return std::nullopt;
    const auto at = [&](std::size_t x, std::size_t y, std::size_t z) { return (z * n[1] + y) * n[0] + x; };
    std::vector<std::uint8_t> state(n[0] * n[1] * n[2]); // 1: solid, 2: the void
    for (std::size_t b = 0; b < g.csg.brushes.size(); ++b) {
        const BrushPolytope& brush = g.csg.brushes[b];
        if (!brush.valid || g.world.brushes[b].model.value != 0 || g.world.brushes[b].contents != Contents::solid) continue;
        std::array<std::size_t, 3> lo{}, hi{};
        for (std::size_t k = 0; k < 3; ++k)
            lo[k] = static_cast<std::size_t>((brush.bounds.lo[k] - box.lo[k]) / cell), hi[k] = static_cast<std::size_t>((brush.bounds.hi[k] - box.lo[k]) / cell);
        for (std::size_t z = lo[2]; z <= hi[2]; ++z)
            for (std::size_t y = lo[1]; y <= hi[1]; ++y)
                for (std::size_t x = lo[0]; x <= hi[0]; ++x) {
                    const Vec3 c = box.lo + Vec3{x + 0.5, y + 0.5, z + 0.5} * cell;
                    bool in = true;
                    for (const PlanePolygon& f : brush.faces)
                        in = in && dot(g.csg.planes.normal(f.support), c) < g.csg.planes.distance(f.support);
                    if (in) state[at(x, y, z)] = 1;
                }
    }
    std::vector<std::array<std::size_t, 3>> stack{{0, 0, 0}};
    state[0] = 2;
    while (!stack.empty()) {
        const auto c = stack.back();
        stack.pop_back();
        for (std::size_t k = 0; k < 3; ++k)
            for (const bool up : {false, true}) {
                auto d = c;
                if (up ? d[k] + 1 == n[k] : d[k] == 0) continue;
                d[k] += up ? 1 : std::size_t(-1);
                if (auto& s = state[at(d[0], d[1], d[2])]; s == 0) s = 2, stack.push_back(d);
            }
    }
    for (const WorldEntity& e : g.world.entities) {
        const std::string_view name = e.get("classname");
        if (!e.has_origin || e.model.valid() || name.starts_with("func_")) continue;
        std::array<std::size_t, 3> c{};
        for (std::size_t k = 0; k < 3; ++k) c[k] = static_cast<std::size_t>((e.origin[k] - box.lo[k]) / cell);
        if (state[at(c[0], c[1], c[2])] == 2) return true;
    }
    return false;
}

Geometry small_map(const std::string& name) {
    const auto path = shared_map("ericw-tools-testmaps/" + name + ".map");
    if (!path) return {};
    Context context;
    const auto world = load_world(*path, context);
    return world ? run(with_large_luxels(*world)) : Geometry{};
}

// All of them: nothing invalid, a closed hull, and sealed exactly where a flood of cells says so.
TEST(SmallMaps, AreSealedWhereTheyAreSealed) {
    std::size_t seen = 0, leaking = 0, compared = 0;
    for (const std::string& path : shared_maps()) {
        if (path.find("ericw-tools-testmaps") == std::string::npos) continue;
        SCOPED_TRACE(path);
        Context context;
        const auto world = load_world(path, context);
        if (!world) { // liquids alone, or a map that only includes another
            EXPECT_THAT(path, testing::AnyOf(testing::HasSubstr("q2_csg_liquid_combinations"), testing::HasSubstr("q1_external_map_base")));
            continue;
        }
        const Geometry g = run(with_large_luxels(*world));
        ASSERT_FALSE(g.fault);
        ++seen;
        EXPECT_EQ(g.csg.report.invalid_brushes, 0u);
        if (path.find("offgrid") == std::string::npos) { // there walls meet in tips thinner than a cell
            std::optional<bool> leaks = leaks_by_cells(g, 4, 4e6);
            if (leaks && *leaks && !g.leak) leaks = leaks_by_cells(g, 1, 1e8); // through walls thinner than a cell?
            compared += leaks.has_value();
            EXPECT_EQ(g.leak.has_value(), leaks.value_or(g.leak.has_value()));
        }
        leaking += g.leak.has_value();
        for (std::uint32_t m = 0; m < g.world.model_count; ++m) EXPECT_EQ(unmatched_hull_edges(g.surfaces, {m}), 0u) << "model " << m;
        EXPECT_TRUE(closure(g.world, g.csg).ok());
        EXPECT_TRUE(volumes(g.csg, g.bsp).ok());
    }
    if (!seen) GTEST_SKIP() << "ericw-tools-testmaps are not here";
    EXPECT_GE(seen, 52u);
    EXPECT_GE(compared, 25u);
    EXPECT_GT(leaking, 8u);
}

TEST(SmallMaps, KeepWhatTheirNamesSay) {
    if (!shared_map("ericw-tools-testmaps")) GTEST_SKIP() << "ericw-tools-testmaps are not here";
    for (const char* sealed : {"qbsp_simple_sealed", "qbsp_simple_sealed2", "qbsp_simple_sealed_rotated", "q1_simple_sealed_no_entities",
                               "qbsp_sealing_point_entity_on_outside", "q1_sealing", "hl_basic"})
        EXPECT_FALSE(small_map(sealed).leak) << sealed;
    for (const char* leaked : {"q2_leaked", "qbsp_simple", "q1_cube"}) EXPECT_TRUE(small_map(leaked).leak) << leaked;
    EXPECT_EQ(small_map("qbsp_simple_sealed").bsp.cluster_count, 1u);
    EXPECT_EQ(small_map("qbsp_simple_sealed_rotated").bsp.cluster_count, 1u); // turned: still one room, six faces
    EXPECT_EQ(small_map("qbsp_simple_sealed_rotated").surfaces.faces.size(), 6u);
    EXPECT_EQ(small_map("qbsp_simple_sealed2").bsp.cluster_count, 2u);
    EXPECT_EQ(small_map("qbsp_sealing_point_entity_on_outside").count("entity-outside"), 1u);
    EXPECT_EQ(small_map("q1_simple_sealed_no_entities").count("no-entity-inside"), 1u);
    // Water within a solid block: nothing of it is left.
    const Geometry eaten = small_map("q1_csg_solid_eats_water");
    for (const Fragment& f : eaten.csg.fragments) EXPECT_EQ(f.behind, Contents::solid);
    EXPECT_EQ(eaten.csg.fragments.size(), 6u);
    // Of two solids in one place one has the face: every point of the union's boundary is drawn once.
    const Geometry twice = small_map("q1_solid_solid_zfighting");
    double once = 0;
    for (const Fragment& f : twice.csg.fragments) once += polygon_area(points(twice.csg.planes, f.polygon));
    double hull = 0;
    for (const Face& f : twice.surfaces.faces) hull += f.area;
    EXPECT_NEAR(once, hull, 1e-6);
    EXPECT_TRUE(closure(twice.world, twice.csg).ok());
    // 360 flanks and two lids, each lid one face.
    const Geometry many = small_map("qbsp_many_sided_face");
    EXPECT_EQ(many.csg.fragments.size(), 362u);
    EXPECT_EQ(many.csg.brushes[0].faces.size(), 362u);
    // Faces an eighth of a unit wide are there.
    const Geometry eighth = small_map("q1_0125unit_faces");
    EXPECT_GT(slivers(eighth.csg, 0.126).count, 0u);
    EXPECT_EQ(unmatched_hull_edges(eighth.surfaces), 0u);
    // Area portals divide: one area more than there are doors between.
    EXPECT_EQ(small_map("q2_areaportal").bsp.area_count, 2u);
    EXPECT_EQ(small_map("q2_areaportal_with_detail").bsp.area_count, 2u);
    EXPECT_GE(small_map("q2_areaportals").bsp.area_count, 3u);
    // T-junctions: the mesh of every model is matched edge by edge.
    for (const char* t : {"q1_tjunc_matrix", "q1_tjunc_angled_face", "qbsp_tjunc_many_sided_sky", "test_tjunc01"}) {
        const Geometry g = small_map(t);
        for (std::uint32_t m = 0; m < g.world.model_count; ++m) EXPECT_EQ(unmatched_hull_edges(g.surfaces, {m}), 0u) << t;
        EXPECT_GT(g.surfaces.faces.size(), 6u) << t;
    }
    // Walls and what stands at them, before and after turning by small angles: the gaps that turning made are small.
    const Geometry before = small_map("offgrid_before"), after = small_map("offgrid_after");
    EXPECT_EQ(before.count("micro-gap"), 0u);
    EXPECT_FALSE(after.leak);
}

} // namespace
} // namespace kiln::proof

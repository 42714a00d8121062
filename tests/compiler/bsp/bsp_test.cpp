#include "tests/compiler/bsp/support.h"
#include <gmock/gmock.h>
#include <numbers>
#include <random>
#include <set>

namespace kiln {
namespace {

using test::Built;
using test::WorldBuilder;

bool is_inside(const BspLeaf& l) { return l.cluster.valid(); }

Vec3 random_point(std::mt19937_64& random, const Box3& box) {
    Vec3 p;
    for (std::size_t k = 0; k < 3; ++k)
        p[k] = std::uniform_real_distribution<double>(box.lo[k], box.hi[k])(random);
    return p;
}

// Boxes, slanted prisms and tetrahedra, most on a coarse grid so that faces and edges coincide often.
WorldBuilder soup(unsigned seed, int count) {
    std::mt19937_64 random(seed);
    WorldBuilder w;
    const auto coarse = [&] { return 8.0 * std::uniform_int_distribution<int>(-16, 16)(random); };
    for (int i = 0; i < count; ++i) {
        const auto kind = random() % 10;
        const Contents contents = random() % 4 == 0   ? Contents::detail
                                  : random() % 8 == 0 ? Contents::water
                                  : random() % 8 == 0 ? Contents::window
                                                      : Contents::solid;
        const Vec3 a{coarse(), coarse(), coarse()};
        if (kind < 6) {
            const auto size = [&] { return 8.0 * std::uniform_int_distribution<int>(1, 8)(random); };
            w.box(a, a + Vec3{size(), size(), size()}, contents);
        } else if (kind < 8) {
            std::vector<Vec2> base;
            const double r = 8.0 * std::uniform_int_distribution<int>(2, 6)(random);
            const int n = std::uniform_int_distribution<int>(3, 7)(random);
            for (int k = 0; k < n; ++k) {
                const double t = 2 * std::numbers::pi * k / n;
                base.push_back({a.x + std::round(r * std::cos(t)), a.y + std::round(r * std::sin(t))});
            }
            w.prism(base, a.z, a.z + 40, contents);
        } else {
            w.tetrahedron({a, a + Vec3{48, 8, 0}, a + Vec3{-8, 40, 16}, a + Vec3{8, 8, 56}}, contents);
        }
    }
    return w;
}

// A random point is in exactly one leaf's polytope, that of leaf_at, and the leaf's contents are those of the
// strongest brush that holds the point.
TEST(BspLaws, LeavesTileSpaceAndKnowTheirContents) {
    for (unsigned seed = 1; seed <= 12; ++seed) {
        const Built b = test::build(soup(seed, 8 + 6 * static_cast<int>(seed)).world);
        const auto polytopes = leaf_polytopes(b.bsp);
        Box3 world;
        double sum = 0;
        for (std::size_t l = 0; l < polytopes.size(); ++l) {
            world.add(b.bsp.leaves[l].bounds);
            const double v = test::volume(b.bsp.planes, polytopes[l]);
            EXPECT_GT(v, 0);
            sum += v;
        }
        const Vec3 size = world.size();
        EXPECT_NEAR(sum, size.x * size.y * size.z, 1e-9 * sum) << "seed " << seed;

        std::mt19937_64 random(seed);
        int compared = 0;
        for (int i = 0; i < 4000; ++i) {
            const Vec3 p = random_point(random, world);
            const auto expected = test::contents_at(b, p, 1e-6);
            if (!expected) continue;
            ++compared;
            const BspLeaf& leaf = b.bsp.leaves[leaf_at(b.bsp, p).at()];
            ASSERT_EQ(static_cast<int>(leaf.contents), static_cast<int>(*expected))
                << "seed " << seed << " at " << p.x << ' ' << p.y << ' ' << p.z;
            for (std::size_t k = 0; k < b.csg.brushes.size(); ++k) {
                if (b.world.brushes[k].model.value != 0 || !b.csg.brushes[k].valid) continue;
                if (test::depth(b.csg, b.csg.brushes[k], p) < -1e-6) {
                    ASSERT_TRUE(std::ranges::binary_search(leaf.brushes, id<BrushId>(k))) << "seed " << seed;
                }
            }
            if (i % 40 == 0) { // exactly one
                std::size_t holders = 0;
                for (std::size_t l = 0; l < polytopes.size(); ++l) {
                    bool in = true;
                    for (const PlanePolygon& f : polytopes[l])
                        in = in && dot(b.bsp.planes.normal(f.support), p) <= b.bsp.planes.distance(f.support);
                    if (!in) continue;
                    ++holders;
                    EXPECT_EQ(leaf_at(b.bsp, p).at(), l);
                }
                EXPECT_EQ(holders, 1u);
            }
        }
        EXPECT_GT(compared, 3000);
    }
}

// Both sides of a portal, a hair from its middle, are the two leaves it names; and where a step across a face of an
// open leaf leads to another open leaf, a portal is there: the areas add up.
TEST(BspLaws, PortalsLieBetweenTheirLeavesAndLeaveNoHoles) {
    for (unsigned seed = 1; seed <= 6; ++seed) {
        WorldBuilder w = soup(seed, 40);
        w.point_entity("light", {-1000, 0, 0}); // in the void: it leaks, so nothing is filled
        const Built b = test::build(w.world, {.allow_leaks = true});
        std::vector<Vec3> outflow(b.bsp.leaves.size());
        std::vector<double> area(b.bsp.leaves.size());
        for (const BspPortal& p : b.bsp.portals) {
            const Vec3 n = b.bsp.planes.normal(p.plane), c = test::middle(p.winding);
            const double a = test::polygon_area(p.winding);
            ASSERT_GT(a, 0);
            EXPECT_GT(dot(cross(p.winding[1] - p.winding[0], p.winding[2] - p.winding[0]), n), 0)
                << "counter-clockwise from the front";
            area[p.leaf_front.at()] += a, area[p.leaf_back.at()] += a;
            if (a < 0.1) continue;
            EXPECT_EQ(leaf_at(b.bsp, c + n * 1e-5), p.leaf_front);
            EXPECT_EQ(leaf_at(b.bsp, c - n * 1e-5), p.leaf_back);
        }
        // Surface of an open leaf = its portals + solid faces + world's box. Solid faces are the visible structural
        // fragments in it, so no part of its surface is left over.
        for (const VisibleFragment& v : b.bsp.visible)
            if (b.csg.fragments[v.fragment].behind == Contents::solid)
                area[v.leaf.at()] += test::polygon_area(points(b.bsp.planes, v.polygon));
        // Those covered by detail are not visible but bound the leaf all the same: leaves with detail are left out.
        const auto polytopes = leaf_polytopes(b.bsp);
        int compared = 0;
        for (std::size_t l = 0; l < polytopes.size(); ++l) {
            const BspLeaf& leaf = b.bsp.leaves[l];
            const bool detail = std::ranges::any_of(
                leaf.brushes, [&](BrushId k) { return b.world.brushes[k.at()].contents == Contents::detail; });
            if (!leaf.cluster.valid() || detail) continue;
            double surface = 0;
            for (const PlanePolygon& f : polytopes[l])
                if (std::ranges::find(b.bsp.box, f.support) == b.bsp.box.end())
                    surface += test::polygon_area(points(b.bsp.planes, f));
            EXPECT_NEAR(area[l], surface, 1e-7 * surface) << "seed " << seed << " leaf " << l;
            ++compared;
        }
        EXPECT_GT(compared, 20);
    }
}

TEST(Bsp, SealedRoomIsOneCluster) {
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 192, 128});
    w.point_entity("light", {128, 96, 64});
    const Built b = test::build(w.world);
    EXPECT_EQ(b.bsp.cluster_count, 1u);
    EXPECT_TRUE(b.bsp.portals.empty());
    EXPECT_FALSE(b.leak);
    EXPECT_EQ(b.bsp.area_count, 1u);
    EXPECT_TRUE(b.diagnostics.empty());
    double area = 0;
    for (const VisibleFragment& v : b.bsp.visible) area += test::polygon_area(points(b.bsp.planes, v.polygon));
    EXPECT_DOUBLE_EQ(area, 2 * (256 * 192 + 256 * 128 + 192 * 128)); // the inner walls and nothing else
    const LeafId leaf = leaf_at(b.bsp, {1, 1, 1});
    EXPECT_EQ(b.bsp.leaves[leaf.at()].bounds, (Box3{{0, 0, 0}, {256, 192, 128}}));
}

// Two rooms joined by a door in the wall between them.
WorldBuilder two_rooms(Vec3 at = {}, Contents door = Contents::empty) {
    WorldBuilder w;
    const auto box = [&](Vec3 lo, Vec3 hi, Contents c = Contents::solid) { w.box(lo + at, hi + at, c); };
    box({-16, -16, -16}, {528, 272, 0});
    box({-16, -16, 128}, {528, 272, 144});
    box({-16, -16, 0}, {0, 272, 128});
    box({512, -16, 0}, {528, 272, 128});
    box({0, -16, 0}, {512, 0, 128});
    box({0, 256, 0}, {512, 272, 128});
    box({248, 0, 0}, {264, 96, 128});
    box({248, 160, 0}, {264, 256, 128});
    box({248, 96, 96}, {264, 160, 128});
    if (door != Contents::empty) box({252, 96, 0}, {260, 160, 96}, door);
    w.point_entity("light", Vec3{64, 64, 64} + at);
    return w;
}

TEST(Bsp, TwoRoomsAndADoor) {
    const Built b = test::build(two_rooms().world);
    EXPECT_EQ(b.bsp.cluster_count, 3u); // room, doorway, room
    ASSERT_EQ(b.bsp.portals.size(), 2u);
    for (const BspPortal& p : b.bsp.portals) EXPECT_DOUBLE_EQ(test::polygon_area(p.winding), 64 * 96);
    EXPECT_EQ(b.bsp.area_count, 1u);
}

TEST(Bsp, AreaPortalDividesAreas) {
    const Built b = test::build(two_rooms({}, Contents::area_portal).world);
    EXPECT_EQ(b.bsp.area_count, 2u);
    const BspLeaf& west = b.bsp.leaves[leaf_at(b.bsp, {100, 100, 50}).at()];
    const BspLeaf& east = b.bsp.leaves[leaf_at(b.bsp, {400, 100, 50}).at()];
    const BspLeaf& door = b.bsp.leaves[leaf_at(b.bsp, {256, 128, 50}).at()];
    EXPECT_NE(west.area, east.area);
    EXPECT_EQ(door.area, 0u);
    EXPECT_EQ(door.contents, Contents::area_portal);
    EXPECT_TRUE(door.cluster.valid());
    for (const VisibleFragment& v : b.bsp.visible)
        EXPECT_EQ(b.csg.fragments[v.fragment].behind, Contents::solid); // the portal itself is not drawn
}

TEST(Bsp, CountsDoNotDependOnWhereTheMapIs) {
    const Built a = test::build(two_rooms().world), b = test::build(two_rooms({4096, -1024, 512}).world);
    EXPECT_EQ(a.bsp.nodes.size(), b.bsp.nodes.size());
    EXPECT_EQ(a.bsp.leaves.size(), b.bsp.leaves.size());
    EXPECT_EQ(a.bsp.portals.size(), b.bsp.portals.size());
    EXPECT_EQ(a.bsp.visible.size(), b.bsp.visible.size());
}

TEST(Bsp, PillarLeavesTheRoomsVolume) {
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 256, 128});
    w.box({96, 96, 0}, {160, 160, 128});
    w.point_entity("light", {32, 32, 32});
    const Built b = test::build(w.world);
    double open = 0;
    const auto polytopes = leaf_polytopes(b.bsp);
    for (std::size_t l = 0; l < polytopes.size(); ++l)
        if (is_inside(b.bsp.leaves[l])) open += test::volume(b.bsp.planes, polytopes[l]);
    EXPECT_DOUBLE_EQ(open, (256.0 * 256 - 64 * 64) * 128);
    EXPECT_EQ(b.bsp.cluster_count, 4u);
    EXPECT_EQ(b.bsp.portals.size(), 4u); // a ring
}

TEST(Bsp, DetailDoesNotDivideButIsListedAndDrawn) {
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 256, 128});
    const BrushId pillar = w.box({96, 96, 0}, {160, 160, 128}, Contents::detail);
    w.point_entity("light", {32, 32, 32});
    const Built b = test::build(w.world);
    EXPECT_EQ(b.bsp.cluster_count, 1u);
    const BspLeaf& room = b.bsp.leaves[leaf_at(b.bsp, {1, 1, 1}).at()];
    EXPECT_TRUE(std::ranges::binary_search(room.brushes, pillar));
    double pillar_area = 0, floor_area = 0;
    for (const VisibleFragment& v : b.bsp.visible) {
        const double a = test::polygon_area(points(b.bsp.planes, v.polygon));
        if (b.csg.fragments[v.fragment].brush == pillar) pillar_area += a;
        else if (b.bsp.planes.normal(v.polygon.support).z == 1) floor_area += a;
    }
    EXPECT_DOUBLE_EQ(pillar_area, 4 * 64 * 128);
    EXPECT_DOUBLE_EQ(floor_area, 256 * 256 - 64 * 64);
}

TEST(Bsp, HintDividesWhereNothingElseWould) {
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 256, 128});
    w.point_entity("light", {32, 32, 32});
    const MaterialId hint = w.material("tools/toolshint", kHint), skip = w.material("tools/toolsskip", kSkip);
    const BrushId brush = w.box({128, 0, 0}, {136, 256, 128}, Contents::hint, {0}, skip);
    w.world.sides[w.world.brushes[brush.at()].first_side].material = hint; // -x
    const Built b = test::build(w.world);
    EXPECT_EQ(b.bsp.cluster_count, 2u);
    ASSERT_EQ(b.bsp.portals.size(), 1u);
    EXPECT_TRUE(b.bsp.portals[0].hint);
    EXPECT_DOUBLE_EQ(b.bsp.portals[0].winding[0].x, 128);
}

TEST(Bsp, WaterHasItsOwnLeavesEvenWhereDetailCoversItsSurface) {
    for (const bool covered : {false, true}) {
        WorldBuilder w;
        w.room({0, 0, 0}, {256, 256, 128});
        w.box({0, 0, 0}, {256, 256, 32}, Contents::water);
        if (covered) w.box({0, 0, 16}, {256, 256, 64}, Contents::detail);
        w.point_entity("light", {32, 32, 100});
        const Built b = test::build(w.world);
        EXPECT_EQ(b.bsp.cluster_count, 2u);
        EXPECT_EQ(b.bsp.leaves[leaf_at(b.bsp, {100, 100, 31}).at()].contents, Contents::water);
        EXPECT_EQ(b.bsp.leaves[leaf_at(b.bsp, {100, 100, 33}).at()].contents, Contents::empty);
        EXPECT_EQ(b.bsp.portals.size(), 1u); // sight passes
    }
}

TEST(Bsp, BrushModelsStayWholeAndSealNothing) {
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 256, 128});
    w.point_entity("light", {32, 32, 32});
    const ModelId door = w.model("func_door");
    w.box({100, 100, 0}, {120, 300, 100}, Contents::solid, door); // also through the wall
    const Built b = test::build(w.world);
    EXPECT_EQ(b.bsp.cluster_count, 1u);
    std::size_t of_model = 0;
    for (const VisibleFragment& v : b.bsp.visible)
        if (b.csg.fragments[v.fragment].model == door) {
            ++of_model;
            EXPECT_FALSE(v.leaf.valid());
            EXPECT_EQ(v.polygon, b.csg.fragments[v.fragment].polygon);
        }
    EXPECT_EQ(of_model, 6u);
}

// Visible parts of one fragment are disjoint and lie in it: their areas never exceed it, and in a sealed map those
// of an inner wall make it up.
TEST(BspLaws, VisiblePartsPartitionTheirFragment) {
    const Built b = test::build(two_rooms().world);
    std::vector<double> seen(b.csg.fragments.size());
    for (const VisibleFragment& v : b.bsp.visible) seen[v.fragment] += test::polygon_area(points(b.bsp.planes, v.polygon));
    double total = 0;
    for (std::size_t f = 0; f < seen.size(); ++f) {
        EXPECT_LE(seen[f], test::polygon_area(points(b.csg.planes, b.csg.fragments[f].polygon)) * (1 + 1e-12));
        total += seen[f];
    }
    // Two rooms 248 x 256 x 128, a doorway 16 long, 64 wide, 96 high.
    EXPECT_NEAR(total, 2 * (2 * 248 * 256 + 2 * 248 * 128 + 2 * 256 * 128 - 64 * 96) + 16 * (2 * 64 + 2 * 96), 1e-6);
}

TEST(Bsp, SameBytesEachTime) {
    const World world = soup(3, 60).world;
    const Bytes a = to_bytes(test::build(world).bsp), b = to_bytes(test::build(world).bsp);
    EXPECT_EQ(a, b);
    const Bsp back = from_bytes<Bsp>(a);
    EXPECT_EQ(to_bytes(back), a);
}

// Depth: a convex body of many sides makes a tree as deep as it has sides.
TEST(Bsp, ManySidedPillar) {
    WorldBuilder w;
    std::vector<Vec2> base;
    for (int i = 0; i < 300; ++i) {
        const double t = 2 * std::numbers::pi * i / 300;
        base.push_back({std::round(128000 * std::cos(t)) / 64, std::round(128000 * std::sin(t)) / 64});
    }
    w.room({-3000, -3000, 0}, {3000, 3000, 512});
    w.prism(base, 0, 512);
    w.point_entity("light", {2900, 2900, 32});
    const Built b = test::build(w.world);
    EXPECT_FALSE(b.leak);
    EXPECT_EQ(b.leaves([](const BspLeaf& l) { return l.contents == Contents::solid; }) > 0, true);
    double open = 0, disc = 0;
    const auto polytopes = leaf_polytopes(b.bsp);
    for (std::size_t l = 0; l < polytopes.size(); ++l)
        if (is_inside(b.bsp.leaves[l])) open += test::volume(b.bsp.planes, polytopes[l]);
    for (std::size_t i = 0; i < base.size(); ++i) disc += cross(base[i], base[(i + 1) % base.size()]) / 2;
    EXPECT_NEAR(open, (6000.0 * 6000 - disc) * 512, 1e-9 * open);
    EXPECT_TRUE(b.csg.brushes.back().valid);
}

} // namespace
} // namespace kiln

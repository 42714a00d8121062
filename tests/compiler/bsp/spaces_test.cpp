// What the game does with space: areas and their portals, shared clusters, water, occluders; and the contents of leaves.
#include "support.h"
#include "tests/compiler/csg/pairs.h"
#include <algorithm>
#include <numeric>
#include <set>

namespace kiln::test {
namespace {

EntityId own_entity(WorldBuilder& w, BrushId brush, const char* classname, const char* targetname = "") {
    const EntityId e = w.point_entity(classname, {}, {{"targetname", targetname}});
    w.world.entities[e.at()].has_origin = false;
    w.world.brushes[brush.at()].entity = e;
    return e;
}
BrushId area_portal(WorldBuilder& w, Vec3 lo, Vec3 hi, const char* name = "") {
    const BrushId b = w.box(lo, hi, Contents::area_portal);
    own_entity(w, b, "func_areaportal", name);
    return b;
}
// Two rooms along x, 128 each, a wall of 16 between with a doorway y 48..80, z 0..96.
WorldBuilder two_rooms() {
    WorldBuilder w;
    w.room({0, 0, 0}, {272, 128, 128});
    w.box({128, 0, 0}, {144, 48, 128});
    w.box({128, 80, 0}, {144, 128, 128});
    w.box({128, 48, 96}, {144, 80, 128});
    w.point_entity("info_player_start", {64, 64, 32});
    return w;
}
std::uint32_t area_at(const Built& b, Vec3 p) { return b.bsp.leaves[leaf_at(b.bsp, p).at()].area; }
const Diagnostic* first(const Built& b, std::string_view code) {
    const auto it = std::ranges::find(b.diagnostics, code, &Diagnostic::code);
    return it == b.diagnostics.end() ? nullptr : &*it;
}

// ---- Contents of leaves, pair by pair

TEST(BspPrecedence, LeavesHoldTheStrongestContents) {
    for (const PairKind& first_kind : kPairKinds)
        for (const PairKind& second_kind : kPairKinds)
            for (const Position position : kPositions) {
                SCOPED_TRACE(std::string(first_kind.name) + " with " + second_kind.name + ", position " + std::to_string(static_cast<int>(position)));
                const Vec3 shift{100, 100, 100}; // free of the room's walls
                WorldBuilder room;
                room.room({0, 0, 0}, {400, 300, 300});
                room.point_entity("info_player_start", {20, 20, 20});
                const Built b = build(pair_world(first_kind, second_kind, position, false, shift, nullptr, room));
                auto [one, two] = boxes_of(position);
                const PairKind* kinds[2] = {&first_kind, &second_kind};
                const Box3* boxes[2] = {&one, &two};
                for (double x = -4; x < 140; x += 8)
                    for (double y = -4; y < 72; y += 8)
                        for (double z = -4; z < 72; z += 8) {
                            const Vec3 p{x, y, z};
                            // Solid, then what is seen through or swum in, by strength; an area portal where none of these is.
                            int best = INT_MAX;
                            Contents expected = Contents::empty;
                            for (int i = 0; i < 2; ++i) {
                                const PairKind& k = *kinds[i];
                                if (!holds(*boxes[i], p) || k.contents == Contents::detail) continue;
                                const int rank = k.rank >= 0 ? k.rank : k.contents == Contents::area_portal ? 100 : INT_MAX;
                                if (rank < best) best = rank, expected = k.contents;
                            }
                            const BspLeaf& leaf = b.bsp.leaves[leaf_at(b.bsp, p + shift).at()];
                            ASSERT_EQ(leaf.contents, expected) << x << " " << y << " " << z;
                            for (int i = 0; i < 2; ++i) { // and know the brushes in them
                                const PairKind& k = *kinds[i];
                                if (!holds(*boxes[i], p) || k.contents == Contents::area_portal || k.contents == Contents::hint) continue;
                                const BrushId id_of = id<BrushId>(6 + static_cast<std::size_t>(i));
                                ASSERT_TRUE(std::ranges::binary_search(leaf.brushes, id_of)) << x << " " << y << " " << z;
                            }
                        }
            }
}

TEST(BspHints, NothingButAHintCutsAHint) {
    // A hint across a hall with a pillar whose sides' planes would cut it.
    WorldBuilder w;
    w.room({0, 0, 0}, {512, 512, 128});
    w.box({96, 200, 0}, {160, 264, 128});
    const MaterialId hint = w.material("hint", kHint), skip = w.material("hintskip", kSkip);
    const BrushId b = w.box({300, 0, 0}, {316, 512, 128}, Contents::hint, {0}, skip);
    w.world.sides[w.world.brushes[b.at()].first_side].material = hint; // its -x side
    w.point_entity("info_player_start", {32, 32, 32});
    const Built built = build(w.world);
    std::size_t hints = 0;
    double area = 0;
    for (const BspPortal& p : built.bsp.portals)
        if (p.hint) ++hints, area += polygon_area(p.winding);
    EXPECT_DOUBLE_EQ(area, 512 * 128); // a portal in the hint's plane and nowhere else
    EXPECT_GE(hints, 1u);
    for (const BspNode& n : built.bsp.nodes) EXPECT_FALSE(std::abs(n.normal.x) == 1 && std::abs(n.distance) == 316) << "a skip side divided the tree";
}

// ---- Areas

TEST(BspAreas, APortalJoinsTheTwoAreasOfItsSides) {
    WorldBuilder w = two_rooms();
    const BrushId brush = area_portal(w, {132, 48, 0}, {140, 80, 96}, "door");
    const Built b = build(w.world);
    EXPECT_EQ(b.bsp.area_count, 2u);
    ASSERT_EQ(b.bsp.area_portals.size(), 1u);
    const AreaPortal& p = b.bsp.area_portals[0];
    EXPECT_EQ(p.brush, brush);
    EXPECT_EQ(p.areas, (std::array<std::uint32_t, 2>{1, 2}));
    EXPECT_NE(area_at(b, {64, 64, 32}), area_at(b, {200, 64, 32}));
    ASSERT_EQ(p.winding.size(), 4u);
    for (const Vec3& v : p.winding) EXPECT_EQ(v.x, 136); // midway, exactly
    EXPECT_DOUBLE_EQ(polygon_area(p.winding), 32 * 96);
    const double towards = area_at(b, {64, 64, 32}) == 1 ? -1 : 1; // counter-clockwise seen from areas[0]
    EXPECT_EQ(b.bsp.planes.normal(p.polygon.support).x, towards);
    EXPECT_TRUE(p.leak.empty());
    for (const char* code : {"areaportal-leak", "areaportal-one-side", "areaportal-closed", "areaportal-areas"}) EXPECT_EQ(b.count(code), 0u) << code;
}

TEST(BspAreas, AWayAroundAPortalIsShown) {
    WorldBuilder w = two_rooms();
    // A second door, which nobody shuts: the upper right wall piece is shortened.
    w.world.brushes.clear(), w.world.sides.clear();
    w.room({0, 0, 0}, {272, 128, 128});
    w.box({128, 0, 0}, {144, 48, 128});
    w.box({128, 80, 0}, {144, 112, 128});
    w.box({128, 48, 96}, {144, 80, 128});
    area_portal(w, {132, 48, 0}, {140, 80, 96}, "door");
    const Built b = build(w.world);
    EXPECT_EQ(b.bsp.area_count, 1u);
    ASSERT_EQ(b.count("areaportal-leak"), 1u);
    const Diagnostic& d = *first(b, "areaportal-leak");
    EXPECT_EQ(d.severity, Severity::warning);
    EXPECT_NE(d.message.find("'door'"), std::string::npos) << d.message;
    EXPECT_EQ(d.where.line, b.world.brushes[b.bsp.area_portals[0].brush.at()].line);
    const std::vector<Vec3>& way = b.bsp.area_portals[0].leak;
    ASSERT_GE(way.size(), 3u);
    EXPECT_TRUE(std::ranges::any_of(way, [](Vec3 v) { return v.y >= 112; })); // through the second door
    EXPECT_EQ(std::min(way.front().x, way.back().x), 132);
    EXPECT_EQ(std::max(way.front().x, way.back().x), 140);
    EXPECT_NE(d.message.find("(trail areaportal1)"), std::string::npos) << d.message;
}

TEST(BspAreas, PortalsThatPartNothingAreReported) {
    WorldBuilder w = two_rooms();
    area_portal(w, {132, 48, 0}, {140, 80, 96});
    area_portal(w, {264, 32, 32}, {280, 64, 64}); // half in the outer wall
    area_portal(w, {-12, 32, 32}, {-4, 64, 64});  // in the wall
    const Built b = build(w.world);
    EXPECT_EQ(b.bsp.area_count, 2u);
    EXPECT_EQ(b.count("areaportal-closed"), 1u);
    EXPECT_EQ(b.count("areaportal-leak") + b.count("areaportal-one-side"), 1u);
    ASSERT_EQ(b.bsp.area_portals.size(), 3u);
    EXPECT_EQ(b.bsp.area_portals[2].areas, (std::array<std::uint32_t, 2>{0, 0}));
}

TEST(BspAreas, PortalsThatTouchNameEachOther) {
    WorldBuilder w = two_rooms();
    const BrushId one = area_portal(w, {130, 48, 0}, {136, 80, 96}), two = area_portal(w, {136, 48, 0}, {142, 80, 96});
    const Built b = build(w.world);
    ASSERT_EQ(b.count("areaportal-one-side"), 2u);
    std::vector<BrushId> left{one, two};
    for (const Diagnostic& d : b.diagnostics) {
        if (d.code != "areaportal-one-side") continue;
        const bool of_one = d.where.line == b.world.brushes[one.at()].line;
        EXPECT_NE(d.message.find("behind it is " + name_of_unsealing(b.world, of_one ? two : one)), std::string::npos) << d.message;
        EXPECT_NE(d.message.find("make them one brush"), std::string::npos) << d.message;
        std::erase(left, of_one ? one : two);
    }
    EXPECT_TRUE(left.empty());
    // Of three the one in the middle touches no open space.
    w = two_rooms();
    area_portal(w, {130, 48, 0}, {134, 80, 96}), area_portal(w, {134, 48, 0}, {138, 80, 96}), area_portal(w, {138, 48, 0}, {142, 80, 96});
    const Built three = build(w.world);
    ASSERT_EQ(three.count("areaportal-closed"), 1u);
    EXPECT_NE(first(three, "areaportal-closed")->message.find("only area portal of"), std::string::npos) << first(three, "areaportal-closed")->message;
    // In a wall there is none to name.
    w = two_rooms();
    area_portal(w, {120, 0, 32}, {140, 32, 64});
    const Built wall = build(w.world);
    ASSERT_EQ(wall.count("areaportal-one-side") + wall.count("areaportal-leak"), 1u);
    if (const Diagnostic* d = first(wall, "areaportal-one-side")) EXPECT_NE(d->message.find("solid or the outside"), std::string::npos) << d->message;
}

TEST(BspAreas, AThirdAreaIsReported) {
    // A crossing whose one portal brush fills the middle: three corridors end in it.
    WorldBuilder w;
    w.room({0, 0, 0}, {320, 192, 64});
    w.box({0, 128, 0}, {128, 192, 64});
    w.box({192, 128, 0}, {320, 192, 64});
    w.box({0, 0, 0}, {320, 64, 64});
    area_portal(w, {128, 64, 0}, {192, 128, 64});
    w.point_entity("info_player_start", {32, 96, 32});
    const Built b = build(w.world);
    EXPECT_EQ(b.bsp.area_count, 3u);
    EXPECT_EQ(b.count("areaportal-areas"), 1u);
    EXPECT_NE(b.bsp.area_portals[0].areas[0], b.bsp.area_portals[0].areas[1]);
}

TEST(BspAreas, SlopingPortalsHaveAPolygonToo) {
    WorldBuilder w = two_rooms();
    // A wedge: its sides are not parallel.
    const std::vector<Vec2> base{{130, 48}, {142, 48}, {137, 80}, {135, 80}};
    const BrushId brush = w.prism(base, 0, 96, Contents::area_portal);
    own_entity(w, brush, "func_areaportal");
    const Built b = build(w.world);
    ASSERT_EQ(b.bsp.area_count, 2u);
    const AreaPortal& p = b.bsp.area_portals.at(0);
    ASSERT_GE(p.winding.size(), 4u);
    EXPECT_NEAR(polygon_area(p.winding), 32 * 96, 1);
    for (const Vec3& v : p.winding) EXPECT_LE(depth(b.csg, b.csg.brushes[brush.at()], v), 1e-9);
}

// The portal stops short of the lintel, or the wall of the ceiling: below a micro gap that is closed, above it is the way around.
TEST(BspAreas, MicroGapsJoinNoAreas) {
    for (const double gap : {0.0625, 0.125, 0.25, 1.0})
        for (const bool in_wall : {false, true}) {
            SCOPED_TRACE(std::to_string(gap) + (in_wall ? " in the wall" : " at the portal"));
            WorldBuilder w;
            w.room({0, 0, 0}, {272, 128, 128});
            w.box({128, 0, 0}, {144, 48, 128});
            w.box({128, 80, 0}, {144, 128, in_wall ? 128 - gap : 128});
            w.box({128, 48, 96}, {144, 80, 128});
            w.point_entity("info_player_start", {64, 64, 32});
            area_portal(w, {132, 48, 0}, {140, 80, in_wall ? 96 : 96 - gap}, "door");
            const Built b = build(w.world);
            const bool closed = gap < 0.2;
            EXPECT_EQ(b.bsp.area_count, closed ? 2u : 1u);
            EXPECT_EQ(b.count("areaportal-leak"), closed ? 0u : 1u);
            EXPECT_EQ(b.count("micro-gap"), closed ? 1u : 0u);
            EXPECT_EQ(area_at(b, {64, 64, 32}) == area_at(b, {200, 64, 32}), !closed);
            if (closed) {
                const Diagnostic& d = *first(b, "micro-gap");
                EXPECT_NE(d.message.find("between areas"), std::string::npos) << d.message;
                // Where the area portal stops short it is named first, and is the place; not where it has nothing to do with it.
                const int line = b.world.brushes[b.bsp.area_portals.at(0).brush.at()].line;
                EXPECT_EQ(d.message.find("beside the area portal of func_areaportal") != std::string::npos, !in_wall) << d.message;
                EXPECT_EQ(d.where.line == line, !in_wall) << d.message;
            }
            else EXPECT_GE(b.bsp.area_portals.at(0).leak.size(), 2u);
            for (const char* code : {"areaportal-one-side", "areaportal-closed", "areaportal-areas"}) EXPECT_EQ(b.count(code), 0u) << code;
            for (const BspLeaf& l : b.bsp.leaves) // the slit itself belongs somewhere
                EXPECT_EQ(l.area != 0, l.cluster.valid() && l.contents != Contents::area_portal);
            EXPECT_EQ(build(w.world, {.micro_gap = 0}).bsp.area_count, 1u); // taken literally it is a way
        }
}

TEST(BspAreas, WhatOnlyMicroGapsPartIsOneAreaWithoutAnAreaPortal) {
    WorldBuilder w;
    w.room({0, 0, 0}, {272, 128, 128});
    w.box({128, 0, 0}, {144, 128, 127.875}); // two rooms, and no area portal
    w.point_entity("info_player_start", {64, 64, 32});
    const Built b = build(w.world);
    EXPECT_EQ(b.bsp.area_count, 1u);
    EXPECT_EQ(b.count("micro-gap"), 0u);
}

TEST(BspAreas, AThinSheetBetweenTwoPortalsIsAnArea) {
    WorldBuilder w = two_rooms();
    area_portal(w, {130, 48, 0}, {136, 80, 96});
    area_portal(w, {136.125, 48, 0}, {142, 80, 96});
    const Built b = build(w.world);
    EXPECT_EQ(b.bsp.area_count, 3u);
    for (const AreaPortal& p : b.bsp.area_portals) EXPECT_NE(p.areas[0], p.areas[1]);
    for (const char* code : {"areaportal-leak", "areaportal-one-side", "areaportal-closed", "areaportal-areas", "micro-gap"}) EXPECT_EQ(b.count(code), 0u) << code;
}

// ---- Clusters

TEST(BspClusters, LeavesOfAVisClusterShareOne) {
    WorldBuilder w;
    w.room({0, 0, 0}, {512, 512, 128});
    for (int i = 0; i < 4; ++i) // pillars make leaves
        w.box({64.0 + 100 * i, 64, 0}, {96.0 + 100 * i, 96, 128}), w.box({64.0 + 100 * i, 400, 0}, {96.0 + 100 * i, 432, 128});
    w.point_entity("info_player_start", {20, 20, 20});
    const Built plain = build(w.world);
    ASSERT_EQ(plain.bsp.cluster_count, plain.leaves([](const BspLeaf& l) { return l.cluster.valid(); }));

    const BrushId left = w.box({-8, -8, -8}, {520, 240, 136}, Contents::vis_cluster); // the half of low y, in two brushes that overlap
    const BrushId more = w.box({100, -8, -8}, {520, 256, 136}, Contents::vis_cluster);
    const EntityId e = own_entity(w, left, "func_viscluster");
    w.world.brushes[more.at()].entity = e;
    const BrushId nothing = w.box({20, 480, 2}, {22, 482, 4}, Contents::vis_cluster);
    own_entity(w, nothing, "func_viscluster");
    const Built b = build(w.world);
    EXPECT_EQ(b.bsp.leaves.size(), plain.bsp.leaves.size()); // it does not divide the tree
    const auto polytopes = leaf_polytopes(b.bsp);
    ClusterId shared;
    std::size_t joined = 0;
    std::set<std::uint32_t> others;
    for (std::size_t l = 0; l < b.bsp.leaves.size(); ++l) {
        const BspLeaf& leaf = b.bsp.leaves[l];
        if (!leaf.cluster.valid()) continue;
        // Leaves here are boxes: the share below y = 256 (240 left of x = 100) by hand.
        const Vec3 lo = leaf.bounds.lo, hi = leaf.bounds.hi, size = hi - lo;
        const auto part = [](double a, double z, double below) { return std::clamp(below - a, 0.0, z - a) / (z - a); };
        const double left_share = part(lo.x, hi.x, 100);
        const double inside = left_share * part(lo.y, hi.y, 240) + (1 - left_share) * part(lo.y, hi.y, 256);
        EXPECT_NEAR(volume(b.bsp.planes, polytopes[l]), size.x * size.y * size.z, 1e-6);
        if (inside > 0.5) {
            if (!shared.valid()) shared = leaf.cluster;
            EXPECT_EQ(leaf.cluster, shared) << l;
            ++joined;
        } else {
            EXPECT_TRUE(others.insert(leaf.cluster.value).second) << l; // each alone
            EXPECT_NE(leaf.cluster, shared);
        }
    }
    EXPECT_GT(joined, 2u);
    EXPECT_EQ(b.bsp.cluster_count, others.size() + 1);
    EXPECT_EQ(b.count("viscluster-empty"), 1u);
    EXPECT_EQ(b.count("viscluster"), 1u);
}

TEST(BspClusters, ASkyRoomIsOneCluster) {
    const auto map = [](bool open) {
        WorldBuilder w;
        w.room({0, 0, 0}, {256, 256, 128});
        w.box({100, 100, 0}, {132, 132, 128});
        w.room({1000, 0, 0}, {1256, 256, 128});
        w.box({1100, 100, 0}, {1132, 132, 64});
        w.point_entity("info_player_start", open ? Vec3{1040, 20, 20} : Vec3{20, 20, 20});
        w.point_entity("sky_camera", {1020, 20, 20});
        return build(w.world);
    };
    const Built b = map(false);
    std::set<std::uint32_t> sky, level;
    for (const BspLeaf& l : b.bsp.leaves)
        if (l.cluster.valid()) (l.bounds.lo.x > 500 ? sky : level).insert(l.cluster.value);
    EXPECT_EQ(sky.size(), 1u);
    EXPECT_GT(level.size(), 1u);
    EXPECT_TRUE(std::ranges::none_of(level, [&](std::uint32_t c) { return sky.contains(c); }));
    EXPECT_EQ(b.count("sky-camera-area"), 0u);

    const Built open = map(true);
    EXPECT_EQ(open.count("sky-camera-area"), 1u);
    EXPECT_EQ(open.bsp.cluster_count, open.leaves([](const BspLeaf& l) { return l.cluster.valid(); }));
}

// ---- Water

TEST(BspWater, PoolsHaveTheirOwnSurface) {
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 256, 128});
    const MaterialId blue = w.material("blue", kWater), green = w.material("green", kWater);
    w.box({0, 0, 0}, {64, 256, 32}, Contents::water, {0}, blue);
    w.box({128, 0, 0}, {256, 256, 64}, Contents::water, {0}, green); // apart from the first
    w.box({64, 0, 0}, {128, 256, 96});                               // a wall between
    w.point_entity("info_player_start", {20, 20, 100});
    const Built b = build(w.world);
    ASSERT_EQ(b.bsp.waters.size(), 2u);
    const auto water_at = [&](Vec3 p) { return b.bsp.leaf_water[leaf_at(b.bsp, p).at()]; };
    const WaterVolume &low = b.bsp.waters.at(water_at({32, 128, 16})), &high = b.bsp.waters.at(water_at({200, 128, 16}));
    EXPECT_EQ(low.surface_z, 32);
    EXPECT_EQ(high.surface_z, 64);
    EXPECT_EQ(low.min_z, 0);
    EXPECT_EQ(high.min_z, 0);
    EXPECT_TRUE(low.has_surface && high.has_surface);
    EXPECT_EQ(low.material, blue);
    EXPECT_EQ(high.material, green);
    EXPECT_EQ(water_at({32, 128, 40}), UINT32_MAX);
}

TEST(BspWater, APipeDoesNotMakeTwoPoolsOne) {
    WorldBuilder w;
    w.room({0, 0, 0}, {256, 64, 128});
    w.box({96, 0, 16}, {128, 64, 128}); // dam with a gap below
    w.box({0, 0, 0}, {96, 64, 32}, Contents::water);
    w.box({96, 0, 0}, {128, 64, 16}, Contents::water); // the pipe
    w.box({128, 0, 0}, {256, 64, 80}, Contents::water);
    w.box({200, 0, 0}, {256, 64, 24}, Contents::slime); // weaker? no: slime displaces water
    w.point_entity("info_player_start", {20, 20, 100});
    const Built b = build(w.world);
    const auto at = [&](Vec3 p) { return b.bsp.waters.at(b.bsp.leaf_water[leaf_at(b.bsp, p).at()]); };
    EXPECT_EQ(at({32, 32, 24}).surface_z, 32);
    EXPECT_EQ(at({150, 32, 60}).surface_z, 80);
    EXPECT_EQ(at({150, 32, 60}).contents, Contents::water);
    EXPECT_EQ(at({230, 32, 10}).contents, Contents::slime);
    EXPECT_EQ(at({230, 32, 10}).surface_z, 24); // under water, but a surface
    EXPECT_EQ(at({110, 32, 8}).min_z, 0);
}

TEST(BspWater, AFilledRoomHasNoSurface) {
    WorldBuilder w;
    w.room({0, 0, 0}, {64, 64, 64});
    w.box({-4, -4, -4}, {68, 68, 68}, Contents::lava);
    w.point_entity("info_player_start", {20, 20, 20});
    const Built b = build(w.world);
    ASSERT_EQ(b.bsp.waters.size(), 1u);
    EXPECT_FALSE(b.bsp.waters[0].has_surface);
    EXPECT_EQ(b.bsp.waters[0].surface_z, 64);
    EXPECT_EQ(b.bsp.waters[0].contents, Contents::lava);
}

// ---- Occluders

TEST(BspOccluders, KnowTheirArea) {
    WorldBuilder w = two_rooms();
    area_portal(w, {132, 48, 0}, {140, 80, 96});
    const EntityId here = own_entity(w, w.box({20, 20, 0}, {24, 100, 64}, Contents::occluder), "func_occluder");
    const EntityId across = own_entity(w, w.box({120, 50, 8}, {160, 54, 64}, Contents::occluder), "func_occluder");
    const MaterialId nodraw = w.material("nodraw", kNoDraw);
    const EntityId blank = own_entity(w, w.box({20, 20, 70}, {24, 100, 80}, Contents::occluder, {0}, nodraw), "func_occluder");
    const Built b = build(w.world);
    ASSERT_EQ(b.bsp.occluders.size(), 2u);
    EXPECT_EQ(b.bsp.occluders[0].entity, here);
    EXPECT_EQ(b.bsp.occluders[0].area, area_at(b, {64, 64, 32}));
    EXPECT_EQ(b.bsp.occluders[0].fragments.size(), 6u);
    EXPECT_EQ(b.bsp.occluders[1].entity, across);
    EXPECT_EQ(b.bsp.occluders[1].area, 0u);
    ASSERT_EQ(b.count("occluder-areas"), 1u);
    ASSERT_EQ(b.count("occluder-without-face"), 1u);
    EXPECT_EQ(first(b, "occluder-without-face")->where.line, b.world.entities[blank.at()].line);
    for (const VisibleFragment& v : b.bsp.visible) EXPECT_NE(b.csg.fragments[v.fragment].behind, Contents::occluder); // not drawn
}

} // namespace
} // namespace kiln::test

// What stands on a face and casts shadows parts its charts: doors, light blockers, terrain, patches.
#include "tests/compiler/surfaces/build.h"
#include "tests/support/curves.h"
#include <numbers>

namespace kiln {
namespace {

using namespace test;

constexpr double kFloorX = 256, kFloorY = 128, kHeight = 96;

// A room parted by a wall with a doorway, from y 40 to 88, 72 high; what fills it is the caller's.
WorldBuilder doorway(double x0, double x1) {
    WorldBuilder b;
    b.room({0, 0, 0}, {kFloorX, kFloorY, kHeight});
    b.box({x0, 0, 0}, {x1, 40, kHeight}), b.box({x0, 88, 0}, {x1, kFloorY, kHeight}), b.box({x0, 40, 72}, {x1, 88, kHeight});
    b.point_entity("info_player_start", {16, 64, 48}), b.point_entity("info_player_start", {240, 64, 48});
    return b;
}

// On which sides of x lie the footprints of a chart, in bits: 1 below, 2 above.
std::vector<unsigned> sides_of(const Surfaces& s, const std::vector<FaceId>& faces, double below, double above) {
    std::vector<unsigned> sides(s.charts.size(), 0);
    for (const Luxel& l : s.luxels)
        for (std::uint32_t k = 0; k < l.piece_count; ++k) {
            const LuxelPiece& piece = s.pieces[l.first_piece + k];
            if (std::ranges::find(faces, piece.face) == faces.end()) continue;
            for (const Vec2 p : points_of(s, piece)) {
                const double x = world_from_luxel(s, piece.face, p).x;
                if (x < below - 1e-6) sides[l.chart.at()] |= 1;
                if (x > above + 1e-6) sides[l.chart.at()] |= 2;
            }
        }
    return sides;
}
double area_of(const Surfaces& s, const std::vector<FaceId>& faces) {
    double sum = 0;
    for (const FaceId f : faces) sum += s.faces[f.at()].area;
    return sum;
}
bool apart(const Surfaces& s, const std::vector<FaceId>& faces, double below, double above) {
    return std::ranges::count(sides_of(s, faces, below, above), 3u) == 0;
}

TEST(Feet, ADoorPartsTheChartsOfWhatItStandsIn) {
    for (const double thickness : {16.0, 2.0, 0.0625}) {
        WorldBuilder b = doorway(100, 116);
        const double x0 = 108 - thickness / 2, x1 = 108 + thickness / 2;
        b.box({x0, 40, 0}, {x1, 88, 72}, Contents::solid, b.model("func_door"));
        const Surfaces s = build(b.world).surfaces;
        const auto floor = faces_on(s, {0, 0, 1}, 0), soffit = faces_on(s, {0, 0, -1}, 72), jamb = faces_on(s, {0, 1, 0}, 40), other = faces_on(s, {0, -1, 0}, -88);
        EXPECT_EQ(floor.size(), 3u); // both sides and below the door
        for (const auto& faces : {floor, soffit, jamb, other}) {
            EXPECT_TRUE(apart(s, faces, x0, x1)) << thickness;
            EXPECT_TRUE(apart(s, faces, x0, x0)) << thickness; // not with what is under the door either
            EXPECT_TRUE(apart(s, faces, x1, x1)) << thickness;
        }
        EXPECT_NEAR(area_of(s, floor), kFloorX * kFloorY - 16 * 80, 1e-6); // nothing is lost
        double luxels = 0;
        for (std::size_t c = 0; c < s.charts.size(); ++c)
            if (s.charts[c].n == Vec3{0, 0, 1} && s.faces[s.charts[c].faces[0].at()].distance == 0 && s.faces[s.charts[c].faces[0].at()].model.value == 0) luxels += footprint_area(s, id<ChartId>(c));
        EXPECT_NEAR(luxels, area_of(s, floor), 0.1);
        EXPECT_EQ(unmatched_hull_edges(s), 0u);
        for (const Seam& seam : s.seams) { // light need not look even across the foot
            const auto on_floor = [&](ChartId c) { return std::ranges::find(floor, s.charts[c.at()].faces[0]) != floor.end(); };
            EXPECT_FALSE(on_floor(seam.chart_a) && on_floor(seam.chart_b));
        }
    }
}

TEST(Feet, ADoorWithoutShadowPartsNothing) {
    WorldBuilder b = doorway(100, 116);
    const BrushId door = b.box({104, 40, 0}, {112, 88, 72}, Contents::solid, b.model("func_door"));
    b.world.brushes[door.at()].casts_light_shadow = false;
    const Surfaces s = build(b.world).surfaces;
    EXPECT_EQ(faces_on(s, {0, 0, 1}, 0).size(), 1u);
}

// One that is sunk into floor and walls, of two leaves, each of two brushes: leaves part each other's faces as well.
TEST(Feet, ADoorThatIsSunkInAndOneThatIsTurned) {
    WorldBuilder b = doorway(100, 116);
    for (const bool high : {false, true}) {
        const ModelId leaf = b.model("func_door");
        for (const bool top : {false, true})
            b.box({106, high ? 64. : 32., top ? 30. : -8.}, {110, high ? 96. : 64., top ? 80. : 30.}, Contents::solid, leaf);
    }
    const Surfaces s = build(b.world).surfaces;
    EXPECT_TRUE(apart(s, faces_on(s, {0, 0, 1}, 0), 106, 110));
    EXPECT_TRUE(apart(s, faces_on(s, {0, 1, 0}, 40), 106, 110));
    EXPECT_NEAR(area_of(s, faces_on(s, {0, 0, 1}, 0)), kFloorX * kFloorY - 16 * 80, 1e-6);
    EXPECT_EQ(unmatched_hull_edges(s), 0u);

    WorldBuilder turned = doorway(100, 116);
    const std::vector<Vec2> base{{90, 30}, {93, 29}, {127, 98}, {124, 99}};
    turned.prism(base, 0, 72, Contents::solid, turned.model("func_door_rotating"));
    const Surfaces t = build(turned.world).surfaces;
    EXPECT_EQ(unmatched_hull_edges(t), 0u);
    EXPECT_NEAR(area_of(t, faces_on(t, {0, 0, 1}, 0)), kFloorX * kFloorY - 16 * 80, 1e-6);
}

// A pillar amid the floor: around it the light is one, beneath it there is another chart.
TEST(Feet, AroundAPillarOneChart) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {256, 256, 128});
    b.box({100, 100, 0}, {120, 120, 64}, Contents::solid, b.model("func_wall"));
    const Surfaces s = build(b.world).surfaces;
    const auto floor = faces_on(s, {0, 0, 1}, 0);
    ASSERT_EQ(floor.size(), 2u);
    EXPECT_NE(s.faces[floor[0].at()].chart, s.faces[floor[1].at()].chart);
    const std::size_t small = s.faces[floor[0].at()].area < s.faces[floor[1].at()].area ? 0 : 1;
    EXPECT_NEAR(s.faces[floor[small].at()].area, 400, 1e-9);
    EXPECT_NEAR(footprint_area(s, s.faces[floor[1 - small].at()].chart), 65536 - 400, 1e-2);
    EXPECT_EQ(unmatched_hull_edges(s), 0u);
}

TEST(Feet, SomethingOnAWallOrInTheAirPartsNothing) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {256, 256, 128});
    b.box({100, 100, 1}, {120, 120, 64}, Contents::solid, b.model("func_wall")); // a unit above the floor
    b.box({200, 200, -16}, {220, 220, 0}, Contents::solid, b.model("func_wall")); // flush with it, from below
    const Surfaces s = build(b.world).surfaces;
    std::size_t world_faces = 0;
    for (const FaceId f : faces_on(s, {0, 0, 1}, 0)) world_faces += s.faces[f.at()].model.value == 0;
    EXPECT_EQ(world_faces, 1u);
}

TEST(Feet, ABlockerOfLightInADoorway) {
    WorldBuilder b = doorway(100, 116);
    const MaterialId blocker = b.material("blocklight", kLightBlocker | kNoDraw);
    b.box({106, 40, 0}, {110, 88, 72}, Contents::clip, {0}, blocker);
    const Surfaces s = build(b.world).surfaces;
    EXPECT_TRUE(apart(s, faces_on(s, {0, 0, 1}, 0), 106, 110));
    EXPECT_EQ(unmatched_hull_edges(s), 0u);
}

// What is drawn thin stands on faces as what is solid does if nothing comes through it; else light goes on.
TEST(Feet, AGrateInADoorway) {
    struct Case {
        const char* what;
        Contents contents;
        std::uint32_t flags;
        float alpha;
        bool stated, parts;
        const char* key = nullptr;
        const char* value = nullptr;
        Bytes texels = {};
    };
    const Case cases[] = {
        {"opaque glass", Contents::window, kTranslucent, 1, true, true},
        {"glass", Contents::window, kTranslucent, 0.9f, true, false},
        {"glass of which nothing is known", Contents::window, kTranslucent, 1, false, false},
        {"a grate without a hole", Contents::grate, kAlphaTested, 1, false, true, nullptr, nullptr, Bytes(4, 255)},
        {"a grate", Contents::grate, kAlphaTested, 1, false, false, nullptr, nullptr, Bytes{255, 255, 254, 255}},
        {"a grate without a shadow", Contents::grate, kAlphaTested, 1, true, false, "_shadow", "-1"},
        {"a grate faded by its entity", Contents::grate, kAlphaTested, 1, true, false, "_alpha", "0.5"},
    };
    for (const Case& c : cases) {
        WorldBuilder b = doorway(100, 116);
        b.world.format = MapFormat::quake_standard;
        const MaterialId m = b.material("pane", c.flags);
        Material& pane = b.world.materials[m.at()];
        pane.alpha = c.alpha, pane.alpha_stated = c.stated;
        if (!c.texels.empty()) pane.opacity_map.width = pane.opacity_map.height = 2, pane.opacity_map.opacity = c.texels;
        const BrushId brush = b.box({106, 40, 0}, {110, 88, 72}, c.contents, {0}, m);
        if (c.key) {
            b.world.brushes[brush.at()].entity = id<EntityId>(b.world.entities.size());
            WorldEntity& e = b.world.entities.emplace_back();
            e.keys = {{"classname", "func_group"}, {c.key, c.value}};
        }
        const Surfaces s = build(b.world).surfaces;
        EXPECT_EQ(apart(s, faces_on(s, {0, 0, 1}, 0), 106, 110), c.parts) << c.what;
        EXPECT_EQ(unmatched_hull_edges(s), 0u) << c.what;
    }
}

// Terrain on end, its bumps along x, through floor, walls and ceiling.
TEST(Feet, TerrainPartsFaces) {
    for (const double bump : {0.0, 6.0}) {
        WorldBuilder b;
        b.room({0, 0, 0}, {kFloorX, kFloorY, kHeight});
        b.point_entity("info_player_start", {16, 64, 48}), b.point_entity("info_player_start", {240, 64, 48});
        const Vec3 lo{100, -8, -8}, hi{104, kFloorY + 8, kHeight + 8};
        const BrushId brush = b.box(lo, hi);
        WorldBrush& w = b.world.brushes[brush.at()];
        w.displaced = true, w.contents = Contents::empty;
        WorldDisplacement d;
        d.side = SideId{w.first_side + 1};
        d.grid.power = 4, d.grid.start = {hi.x, lo.y, lo.z}, d.grid.line = b.world.sides[d.side.at()].line;
        for (int r = 0; r <= 16; ++r)
            for (int c = 0; c <= 16; ++c) {
                d.grid.normals.push_back({1, 0, 0});
                d.grid.distances.push_back(bump * std::sin((lo.y + (hi.y - lo.y) * c / 16) / 17) * std::cos((lo.z + (hi.z - lo.z) * r / 16) / 13));
                d.grid.alphas.push_back(0);
            }
        b.world.sides[d.side.at()].displacement = 0;
        b.world.displacements.push_back(d);
        const Built built = build(b.world);
        const Surfaces& s = built.surfaces;
        for (const auto& faces : {faces_on(s, {0, 0, 1}, 0), faces_on(s, {0, 1, 0}, 0), faces_on(s, {0, -1, 0}, -kFloorY), faces_on(s, {0, 0, -1}, -kHeight)}) {
            EXPECT_EQ(faces.size(), 3u) << bump; // before it, behind it, and a strip right behind it
            EXPECT_TRUE(apart(s, faces, 104 - bump - 0.126, 104 + bump)) << bump;
            std::vector<double> areas;
            for (const FaceId f : faces) areas.push_back(s.faces[f.at()].area);
            std::ranges::sort(areas);
            EXPECT_LT(areas[0], 0.3 * kFloorY); // the strip
        }
        EXPECT_NEAR(area_of(s, faces_on(s, {0, 0, 1}, 0)), kFloorX * kFloorY, 1e-6);
        EXPECT_EQ(unmatched_hull_edges(s), 0u);
    }
}

// A cliff of terrain: one of its strips stands exactly upright on its base, and its ends lie in two walls.
TEST(Feet, TerrainUprightOnItsBasePartsWalls) {
    WorldBuilder b;
    b.room({0, 0, 0}, {kFloorX, kFloorY, kHeight});
    b.point_entity("info_player_start", {16, 64, 48});
    const SideId side = displaced_box(b, {0, 0, -8}, {kFloorX, kFloorY, 16}, 2, [](double, double) { return 0.0; });
    DocDisplacement& grid = b.world.displacements[0].grid;
    ASSERT_EQ(b.world.sides[side.at()].displacement, 0);
    for (std::size_t row = 0; row < 5; ++row) // the columns at 0 and 64 stay, that at 128 goes above the one at 64, those behind it go up
        for (std::size_t column = 2; column < 5; ++column) {
            const Vec3 by{column == 2 ? -64. : 0., 0, 48};
            grid.normals[row * 5 + column] = normalize(by), grid.distances[row * 5 + column] = length(by);
        }
    const Built built = build(b.world);
    const Surfaces& s = built.surfaces;
    for (const auto& faces : {faces_on(s, {0, 1, 0}, 0), faces_on(s, {0, -1, 0}, -kFloorY)}) {
        ASSERT_EQ(faces.size(), 4u); // above, below, and strips right behind it, which touch in a point where it turns up
        std::vector<double> areas;
        for (const FaceId f : faces) areas.push_back(s.faces[f.at()].area);
        std::ranges::sort(areas);
        const double strips = areas[0] + areas[1], below = 64 * 16 + (kFloorX - 64) * 64;
        EXPECT_NEAR(strips, (kFloorX + 48) / 8, 1);
        EXPECT_NEAR(areas[3], below - strips, 1);
        EXPECT_NEAR(areas[2], kFloorX * kHeight - below, 1);
    }
    EXPECT_EQ(unmatched_hull_edges(s), 0u);
}

// A sheet of patches across a room that meets two walls at an angle, seen from either side; of what lets light through or not.
TEST(Feet, APatchPartsFaces) {
    struct Case {
        const char* what;
        std::uint32_t flags;
        float alpha;
        bool stated, parts;
    };
    const Case cases[] = {
        {"stone", 0, 1, false, true},
        {"glass of which nothing is known", kTranslucent, 1, false, false},
        {"glass", kTranslucent, 0.9f, true, false},
        {"opaque glass", kTranslucent, 1, true, true},
        {"a grate of half its area", kAlphaTested, 0.5f, true, false},
        {"a grate without a hole", kAlphaTested, 1, true, true},
    };
    for (const Case& c : cases)
        for (const bool turned : {false, true}) {
            WorldBuilder b;
            b.room({0, 0, 0}, {kFloorX, kFloorY, kHeight});
            b.point_entity("info_player_start", {16, 64, 48}), b.point_entity("info_player_start", {240, 64, 48});
            const MaterialId material = b.material("curve", c.flags);
            b.world.materials[material.at()].alpha = c.alpha, b.world.materials[material.at()].alpha_stated = c.stated;
            patch(b, 3, 3, [&](std::uint32_t column, std::uint32_t row) {
                const double y = kFloorY * (turned ? 2 - column : column) / 2;
                return Vec3{90 + y / 2, y, kHeight * row / 2};
            }, material);
            const Surfaces s = build(b.world).surfaces;
            for (const auto& faces : {faces_on(s, {0, 0, 1}, 0), faces_on(s, {0, 0, -1}, -kHeight), faces_on(s, {0, 1, 0}, 0), faces_on(s, {0, -1, 0}, -kFloorY)}) {
                ASSERT_EQ(faces.size(), c.parts ? 3u : 1u) << c.what << turned;
                if (!c.parts) continue;
                std::vector<double> areas;
                std::vector<ChartId> charts;
                for (const FaceId f : faces) areas.push_back(s.faces[f.at()].area), charts.push_back(s.faces[f.at()].chart);
                std::ranges::sort(areas), std::ranges::sort(charts);
                EXPECT_LT(areas[0], 0.4 * kFloorY) << turned; // the strip
                EXPECT_GT(areas[1], 90 * kHeight - 64) << turned;
                EXPECT_TRUE(charts[0] != charts[1] && charts[1] != charts[2]) << turned;
            }
            EXPECT_NEAR(area_of(s, faces_on(s, {0, 0, 1}, 0)), kFloorX * kFloorY, 1e-6);
            EXPECT_EQ(unmatched_hull_edges(s), 0u);
        }
}

// Round a column of eight pieces the light is one; beneath it there is nothing else, as it has no inside.
TEST(Feet, ARoundColumnOfPatches) {
    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {256, 256, 128});
    patch(b, 9, 3, [&](std::uint32_t column, std::uint32_t row) { return Vec3{110 + 24 * kRing[column].x, 120 + 24 * kRing[column].y, 64. * row / 2}; });
    const Surfaces s = build(b.world).surfaces;
    const auto floor = faces_on(s, {0, 0, 1}, 0);
    ASSERT_EQ(floor.size(), 3u); // around it, within it, and a ring right behind it
    std::vector<double> areas;
    for (const FaceId f : floor) areas.push_back(s.faces[f.at()].area);
    std::ranges::sort(areas);
    EXPECT_NEAR(areas[0], 2 * std::numbers::pi * 24 / 8, 2);       // the ring
    EXPECT_NEAR(areas[0] + areas[1], 10. / 3 * 24 * 24, 20); // four parabolas, in chords
    EXPECT_NEAR(areas[0] + areas[1] + areas[2], 65536, 1e-6);
    EXPECT_EQ(unmatched_hull_edges(s), 0u);
}

} // namespace
} // namespace kiln

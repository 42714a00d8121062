// Which polygons of a plane share a luxel grid where thin walls stand on it.
#include "compiler/surfaces/walls.h"
#include "tests/compiler/surfaces/build.h"
#include <cmath>
#include <gtest/gtest.h>
#include <map>
#include <set>

namespace kiln {
namespace {

using Polygon = std::vector<Vec2>;

Polygon rectangle(double x0, double y0, double x1, double y1) { return {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}}; }

// Two rooms of 20 x 20 luxels left and right of a wall from x = 20, and the floor of a door in it, which is `door` wide.
std::vector<Polygon> two_rooms(double thick, double door) {
    return {rectangle(0, 0, 20, 20), rectangle(20 + thick, 0, 40 + thick, 20), rectangle(20, 20 - door, 20 + thick, 20)};
}

TEST(PartAtWalls, RoomsJoinedThroughADoorArePartedWhereTheWallIsThin) {
    for (const double thick : {1.0 / 256, 0.3, 1.0, 1.4}) {
        const std::vector<std::uint32_t> part = part_at_walls(two_rooms(thick, 4));
        EXPECT_NE(part[0], part[1]) << thick;
        EXPECT_TRUE(part[2] == part[0] || part[2] == part[1]) << thick; // two charts, not three
    }
    for (const double thick : {2.0, 2.5, 8.0}) // no texel is read from both sides
        EXPECT_EQ(part_at_walls(two_rooms(thick, 4)), std::vector<std::uint32_t>(3, 0)) << thick;
}

// Between one and two luxels it is the lattice that decides.
TEST(PartAtWalls, AWallUnderWhichNoTexelIsReadFromBothSidesPartsNothing) {
    for (const double at : {0.0, 0.3, 0.5, 0.75}) {
        std::vector<Polygon> floor = two_rooms(1.6, 4);
        for (Polygon& p : floor)
            for (Vec2& x : p) x.x += at;
        // Read from the left up to x = 21 + at, from the right from x = 20.6 + at: a centre strictly between?
        const double centre = std::floor(20.6 + at - 0.5) + 1.5;
        EXPECT_EQ(part_at_walls(floor)[0] != part_at_walls(floor)[1], centre < 21 + at - 1e-3) << at;
    }
}

TEST(PartAtWalls, RoomsThatNothingJoinsArePartedAlready) {
    EXPECT_EQ(part_at_walls({rectangle(0, 0, 20, 20), rectangle(20.5, 0, 40, 20)}), (std::vector<std::uint32_t>{0, 0}));
    EXPECT_EQ(part_at_walls({rectangle(0, 0, 20, 20), rectangle(20, 20, 40, 40)}), (std::vector<std::uint32_t>{0, 0})); // a corner joins nothing
    EXPECT_EQ(part_at_walls({}), std::vector<std::uint32_t>());
    EXPECT_EQ(part_at_walls({rectangle(0, 0, 1, 1)}), std::vector<std::uint32_t>{0});
}

// A floor of 40 x 40 around what stands on x0..x1, y0..y1.
std::vector<Polygon> around(double x0, double y0, double x1, double y1) {
    return {rectangle(0, 0, 40, y0), rectangle(0, y1, 40, 40), rectangle(0, y0, x0, y1), rectangle(x1, y0, 40, y1)};
}

TEST(PartAtWalls, APillarOrAShortWallPartsNothing) {
    EXPECT_EQ(part_at_walls(around(20, 20, 21, 21)), std::vector<std::uint32_t>(4, 0));
    EXPECT_EQ(part_at_walls(around(17, 20, 23, 20.25)), std::vector<std::uint32_t>(4, 0));
    const std::vector<std::uint32_t> part = part_at_walls(around(10, 20, 30, 20.25));
    EXPECT_NE(part[0], part[1]);
    EXPECT_EQ(std::set<std::uint32_t>(part.begin(), part.end()).size(), 2u);
}

// The same floor turned by any angle, and cut up further: what is read from both sides of the wall stays apart, and the number of charts small.
TEST(PartAtWalls, HoweverTheFloorIsTurnedAndCut) {
    for (const double degrees : {0.0, 7.0, 30.0, 45.0, 90.0}) {
        const double c = std::cos(degrees * 3.14159265358979 / 180), s = std::sin(degrees * 3.14159265358979 / 180);
        std::vector<Polygon> floor;
        std::vector<int> room; // -1: of the door
        const auto add = [&](Polygon p, int which) {
            for (Vec2& x : p) x = {c * x.x - s * x.y, s * x.x + c * x.y};
            floor.push_back(std::move(p)), room.push_back(which);
        };
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < 5; ++j) // rows of the second room are set off: T-junctions
                add(rectangle(5 * i, 4 * j, 5 * i + 5, 4 * j + 4), 0), add(rectangle(20.5 + 5 * i, 4 * j, 25.5 + 5 * i, j == 4 ? 20 : 4 * j + 4), 1);
        add(rectangle(20, 16, 20.5, 20), -1);
        const std::vector<std::uint32_t> part = part_at_walls(floor);
        for (std::size_t i = 0; i < floor.size(); ++i)
            for (std::size_t j = 0; j < floor.size(); ++j) {
                if (room[i] != 0 || room[j] != 1) continue;
                // At the wall, in rows farther from the door than light goes round for.
                const auto at_wall = [&](std::size_t k) { return k / 2 % 5 < 2 && (room[k] == 0 ? k / 10 == 3 : k / 10 == 0); };
                if (!at_wall(i) || !at_wall(j) || i / 2 % 5 != j / 2 % 5) continue;
                EXPECT_NE(part[i], part[j]) << degrees << ": " << i << ' ' << j;
            }
        EXPECT_LE(std::set<std::uint32_t>(part.begin(), part.end()).size(), 2u) << degrees;
    }
}

// Two rooms of a map with a door between them have two charts of their floor, of their ceiling; they meet in seams along
// the cut, and nothing of the floor is lost.
TEST(PartAtWalls, FloorsOfAMap) {
    const auto built = [](double thick) {
        test::WorldBuilder w;
        w.room({0, 0, 0}, {512, 256, 128});
        w.box({256, 0, 0}, {256 + thick, 192, 128}); // and a way past it at y > 192
        w.point_entity("info_player_start", {40, 40, 40});
        return test::build(w.world);
    };
    for (const double thick : {4.0, 64.0}) {
        const auto b = built(thick);
        const Surfaces& s = b.surfaces;
        std::map<ChartId, double> floors;
        for (const Face& f : s.faces)
            if (f.normal.z == 1 && f.distance == 0 && f.chart.valid()) floors[f.chart] += f.area;
        ASSERT_EQ(floors.size(), thick < 32 ? 2u : 1u);
        double area = 0;
        for (const auto& [chart, a] : floors) area += a;
        EXPECT_DOUBLE_EQ(area, 512 * 256 - thick * 192);
        double cut = 0;
        for (const Seam& e : s.seams)
            if (floors.contains(e.chart_a) && floors.contains(e.chart_b)) cut += length(s.positions[e.to] - s.positions[e.from]);
        EXPECT_DOUBLE_EQ(cut, thick < 32 ? 64 : 0);
        validate(s);
    }
}

} // namespace
} // namespace kiln

// A selection of the leak maps, each at one luxel size; all of them at all sizes: tools/prove leaks.
#include "tests/proof/light/leaks.h"
#include <gtest/gtest.h>

using namespace kiln::proof;

namespace {
constexpr double kMost = 1e-6; // of the brightest luxel of the bright room
constexpr double kSizes[] = {4, 64, 8, 32, 16};

// Every map whose name begins so, at luxel sizes in turn.
std::size_t expect_dark(const std::string& begin) {
    std::size_t count = 0;
    for (const LeakMap& m : leak_maps()) {
        if (!m.name.starts_with(begin)) continue;
        const double size = kSizes[count++ % 5];
        const LeakFound f = find_leaks(m, size, 20);
        EXPECT_TRUE(f.compiled) << m.name;
        EXPECT_GT(f.looked, 0u) << m.name;
        EXPECT_LE(f.shown, kMost) << m.name << ", luxels of " << size << ": " << f.where;
        EXPECT_LE(f.luxel, kMost) << m.name << ", luxels of " << size;
        EXPECT_LE(f.patch, kMost) << m.name << ", luxels of " << size;
        EXPECT_LE(f.cube, kMost) << m.name << ", luxels of " << size << ": " << f.cube_where;
    }
    return count;
}
} // namespace

TEST(LeaksOfLight, SolidWallsUprightAndTurned) { EXPECT_EQ(expect_dark("solid wall"), 15u); }
TEST(LeaksOfLight, Closets) { EXPECT_EQ(expect_dark("closet"), 5u); }
TEST(LeaksOfLight, CornersWithinALuxel) { EXPECT_EQ(expect_dark("corner"), 3u); }
TEST(LeaksOfLight, AboveAndBelowASlab) { EXPECT_EQ(expect_dark("dark "), 6u); }
TEST(LeaksOfLight, DetailWalls) { EXPECT_EQ(expect_dark("detail wall"), 12u); }
TEST(LeaksOfLight, FansOfWalls) { EXPECT_EQ(expect_dark("fan"), 3u); }
TEST(LeaksOfLight, Terrain) { EXPECT_EQ(expect_dark("terrain"), 4u); }
TEST(LeaksOfLight, Patches) { EXPECT_EQ(expect_dark("patches"), 6u); }
TEST(LeaksOfLight, GratesWithoutAHole) { EXPECT_EQ(expect_dark("grate"), 4u); }
TEST(LeaksOfLight, Doors) { EXPECT_EQ(expect_dark("door"), 4u); }

// The suite sees what does leak: a doorway whose door casts no shadow.
TEST(LeaksOfLight, AHoleIsFound) {
    LeakMap m = leak_maps().back(); // a door in its doorway; now without the door
    for (kiln::WorldBrush& b : m.builder.world.brushes)
        if (b.model.value != 0) b.casts_light_shadow = false;
    const LeakFound f = find_leaks(m, 16, 20);
    EXPECT_GT(f.luxel, 1e-3);
    EXPECT_GT(f.shown, 1e-3);
    EXPECT_GT(f.patch, 1e-3);
    EXPECT_GT(f.cube, 1e-3);
}

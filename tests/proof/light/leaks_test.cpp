// A few of the maps of `prove_light leaks`: where nothing may show, nothing does.
#include "tests/proof/light/leaks.h"
#include <gtest/gtest.h>

namespace kiln::proof {
namespace {

std::vector<LeakMap> named(const std::string& part) {
    std::vector<LeakMap> found;
    for (LeakMap& m : leak_maps())
        if (m.name.starts_with(part)) found.push_back(std::move(m));
    return found;
}

class Leaks : public testing::TestWithParam<const char*> {};

TEST_P(Leaks, NoLightInTheDark) {
    const std::vector<LeakMap> maps = named(GetParam());
    ASSERT_FALSE(maps.empty());
    for (const LeakMap& m : maps)
        for (const double size : {8.0, 32.0}) {
            const LeakFound f = find_leaks(m, size, 20);
            ASSERT_TRUE(f.compiled) << m.name;
            EXPECT_GT(f.looked, 100u) << m.name;
            EXPECT_LE(std::max({f.shown, f.luxel, f.patch}), 1e-6) << m.name << ", luxels of " << size << ", " << f.where;
            // Cubes beside walls of detail are open (compiler/light/NOTES.md).
            if (!m.name.starts_with("detail")) EXPECT_LE(f.cube, 1e-6) << m.name << ", luxels of " << size;
        }
}
INSTANTIATE_TEST_SUITE_P(Few, Leaks, testing::Values("solid wall of 4 ", "solid wall of 0.0625 at 98", "solid wall of 0.5 at 90.3125 turned by 45", "detail wall of 0.0625 ",
                                                     "detail wall of 2 ", "closet with walls of 0.0625 at 61", "corner of 0.0625", "dark above a slab of 0.0625", "dark below a slab of 4"));

} // namespace
} // namespace kiln::proof

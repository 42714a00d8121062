#include "tests/formats/level/sample_level.h"
#include <gtest/gtest.h>

extern "C" int kiln_c_api_test(const void* bytes, size_t size);

TEST(LevelC, TheInterfaceIsC) {
    const auto bytes = kiln::level::write_level(kiln::level::test::constant_room({1, 2, 3}, true));
    EXPECT_EQ(kiln_c_api_test(bytes.data(), bytes.size()), 0) << "line of c_api_test.c";
}

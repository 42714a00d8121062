// Inputs that fuzzing once found to break a reader, and extremes made by hand, through the checks of the fuzz targets:
// NAME.vmf and NAME.map in crashers/.
#include "tests/fuzz/map_bytes.h"
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <iterator>

namespace kiln {
namespace {

TEST(Crashers, BreakNothingAnyMore) {
    int files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(KILN_SOURCE_DIR) / "tests" / "fuzz" / "crashers")) {
        const bool vmf = entry.path().extension() == ".vmf";
        if (!vmf && entry.path().extension() != ".map") continue;
        ++files;
        SCOPED_TRACE(entry.path());
        std::ifstream stream(entry.path(), std::ios::binary);
        const std::string text((std::istreambuf_iterator<char>(stream)), {});
        EXPECT_NO_THROW(fuzz::run(vmf ? read_vmf : read_quake_map, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}));
    }
    EXPECT_GT(files, 0);
}

} // namespace
} // namespace kiln

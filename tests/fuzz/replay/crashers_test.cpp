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

// The seeds hold one of everything, and nothing that is amiss: else the fuzzer would begin where the readers give up.
TEST(Crashers, SeedsAreReadToTheirEnd) {
    const std::filesystem::path folder = std::filesystem::path(KILN_SOURCE_DIR) / "tests" / "fuzz" / "seeds";
    const auto read = [&](const char* name, fuzz::ReadMap reader, Context& context) {
        std::ifstream stream(folder / name, std::ios::binary);
        const std::string text((std::istreambuf_iterator<char>(stream)), {});
        return reader({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, name, context);
    };
    Context c;
    const Result<Document> map = read("every_layout.map", read_quake_map, c), vmf = read("every_block.vmf", read_vmf, c);
    ASSERT_TRUE(map) << to_text(map.fault().diagnostic);
    ASSERT_TRUE(vmf) << to_text(vmf.fault().diagnostic);
    EXPECT_EQ(map->format, MapFormat::quake_mixed);
    EXPECT_EQ(map->entities[0].brushes.size(), 3u);
    EXPECT_EQ(map->entities[0].patches.size(), 2u);
    EXPECT_EQ(map->entities[1].brushes.size(), 1u);
    EXPECT_EQ(vmf->displacements.size(), 1u);
    EXPECT_EQ(vmf->cordons.size(), 2u);
    for (const Diagnostic& d : c.diagnostics())
        EXPECT_TRUE(d.code == "primitive-not-handled" || d.code == "key-unquoted" || d.code == "hidden-skipped") << to_text(d);
}

} // namespace
} // namespace kiln

// Level files of past versions stay readable. KILN_UPDATE_GOLDEN=1 writes the present version's anew (only before it is
// released: afterwards a change of layout is a new version with a file of its own).
#include "formats/level/kiln_level.hpp"
#include "tests/formats/level/sample_level.h"
#include <cstdlib>
#include <fstream>
#include <gtest/gtest.h>
#include <iterator>

namespace kiln::level {

TEST(LevelGolden, Version1) {
    const std::string path = std::string(KILN_SOURCE_DIR) + "/tests/golden/level_v1.kiln";
    const LevelContent wanted = test::mixture(99, 4);
    if (std::getenv("KILN_UPDATE_GOLDEN")) {
        const auto bytes = write_level(wanted);
        std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    }
    std::ifstream file(path, std::ios::binary);
    ASSERT_TRUE(file) << path;
    const std::vector<std::uint8_t> bytes((std::istreambuf_iterator<char>(file)), {});
    const Level level(bytes);
    const char* what = nullptr;
    ASSERT_EQ(kiln_level_check(level.get(), &what), KILN_OK) << what;
    ASSERT_EQ(level.planes().size(), wanted.planes.size());
    EXPECT_EQ(level.planes()[7].distance, wanted.planes[7].distance);
    EXPECT_EQ(level.nodes()[3].child[1], wanted.nodes[3].child[1]);
    ASSERT_EQ(level.faces().size(), wanted.faces.size());
    EXPECT_EQ(level.faces()[9].v_shift, wanted.faces[9].v_shift);
    EXPECT_EQ(level.info().triangles, wanted.triangles.size());
    EXPECT_EQ(level.info().vertices, wanted.positions.size());
    const auto& corner = wanted.positions[wanted.triangles[5][1]];
    const std::uint32_t vertex = level.triangles()[16];
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(level.positions()[3 * vertex + k], corner[k], 1.0 / 512);
    EXPECT_EQ(std::string(kiln_level_entity_value(level.get(), 1, "key0") ? kiln_level_entity_value(level.get(), 1, "key0") : ""),
              [&] {
                  for (const auto& [key, value] : wanted.entities[1].keys)
                      if (key == "key0") return value;
                  return std::string();
              }());
    const kiln_chart& chart = level.charts()[2];
    float rgb[3];
    ASSERT_EQ(kiln_level_page_texel(level.get(), chart.page, 0, chart.page_x + 1, chart.page_y + 1, rgb), KILN_OK);
    const std::size_t texel = chart.width + 1;
    const Float3 stored = chart.directional ? wanted.rnm[wanted.chart_first_rnm[2] + texel][0] : wanted.flat[wanted.chart_first_texel[2] + texel];
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(rgb[k], stored[k], 0.6);
    std::size_t words = 0;
    EXPECT_EQ(kiln_level_pvs_row(level.get(), 3, &words)[0], wanted.vis_rows[3]);
    std::size_t bevels = 0; // of a later day
    EXPECT_EQ(kiln_level_brush_bevels(level.get(), 1, &bevels), nullptr);
}

} // namespace kiln::level

#include "formats/level/kiln_level.hpp"
#include "tests/formats/level/sample_level.h"
#include <gtest/gtest.h>
#include <limits>
#include <set>
#include <tuple>

namespace kiln::level {
namespace {

// Charts whose texels are stored as the same bytes lie on one place; of what is known of them the best validity and the worst error.
TEST(SharedTexels, EqualChartsLieOnOnePlace) {
    for (const bool directional : {false, true}) {
        // Charts 0, 2 and 5 are alike; 3 differs from them in one texel; the others are all different.
        LevelContent c = test::room(0, directional, [](std::size_t chart, std::uint32_t x, std::uint32_t y) {
            const float v = chart == 0 || chart == 2 || chart == 3 || chart == 5 ? 1.0f + 0.25f * static_cast<float>((x + 2 * y) % 5) : 2.0f + static_cast<float>(chart);
            const float w = chart == 3 && x == 4 && y == 7 ? v * (1 + 1.0f / 128) : v;
            return std::array<Float3, 4>{Float3{w, w, w}, Float3{w, 0, w}, Float3{w, w, 0}, Float3{-w, w, w}};
        });
        const std::size_t n = std::size_t{c.charts[0].width} * c.charts[0].height;
        c.valid[c.chart_first_texel[0] + 20] = 0, c.valid[c.chart_first_texel[2] + 20] = 2, c.valid[c.chart_first_texel[5] + 20] = 1;
        c.valid[c.chart_first_texel[0] + 21] = 2, c.valid[c.chart_first_texel[2] + 21] = 0, c.valid[c.chart_first_texel[5] + 21] = 0;
        c.texel_error[c.chart_first_texel[2] + 22] = 0.3f;
        const auto bytes = write_level(c), apart = write_level(c, {.share_texels = false});
        const Level level(bytes), other(apart);
        const auto charts = level.charts();
        using Place = std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>;
        const auto place = [](const kiln_chart& k) { return Place{k.page, k.page_x, k.page_y}; };
        std::set<Place> places, all;
        for (std::size_t i = 0; i < 6; ++i) places.insert(place(charts[i])), all.insert(place(other.charts()[i]));
        EXPECT_EQ(places.size(), 4u);
        EXPECT_EQ(all.size(), 6u);
        EXPECT_EQ(place(charts[0]), place(charts[2]));
        EXPECT_EQ(place(charts[0]), place(charts[5]));
        kiln_page page{};
        ASSERT_EQ(kiln_level_page_info(level.get(), charts[0].page, &page), KILN_OK);
        std::vector<std::uint8_t> valid(std::size_t{page.width} * page.height);
        std::vector<float> error(valid.size());
        ASSERT_EQ(kiln_level_page_quality(level.get(), charts[0].page, valid.data(), error.data()), KILN_OK);
        const auto at = [&](std::size_t texel) { return (charts[0].page_y + texel / charts[0].width) * page.width + charts[0].page_x + texel % charts[0].width; };
        EXPECT_EQ(valid[at(20)], 1);
        EXPECT_EQ(valid[at(21)], 2);
        EXPECT_NEAR(error[at(22)], 0.3f, 0.02f);
        // What is shown is the same either way.
        for (std::uint32_t chart = 0; chart < 6; ++chart)
            for (std::size_t t = 0; t < n; ++t) {
                float a[3], b[3];
                const double s = 0.5 + static_cast<double>(t % charts[0].width), u = 0.25 + static_cast<double>(t / charts[0].width);
                const float normal[3] = {0.6f, 0, 0.8f};
                ASSERT_EQ(kiln_level_eval_rnm_luxel(level.get(), chart, s, u, normal, a), KILN_OK);
                ASSERT_EQ(kiln_level_eval_rnm_luxel(other.get(), chart, s, u, normal, b), KILN_OK);
                for (int k = 0; k < 3; ++k) ASSERT_EQ(a[k], b[k]);
            }
    }
}

// Axes of a chart are of any length, and come from a file: whatever they are, a texel of the chart is shown.
TEST(SharedTexels, AxesOfAnyLengthStayWithinTheChart) {
    for (const double length : {1.0, 1.0 / 3, 1e-9, 0.0, 1e300, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
        LevelContent c = test::room(0, false, [](std::size_t, std::uint32_t x, std::uint32_t y) {
            const Float3 v{1.0f + static_cast<float>(x), 1.0f + static_cast<float>(y), 1};
            return std::array<Float3, 4>{v, v, v, v};
        });
        for (ChartInfo& chart : c.charts)
            for (double& v : chart.s) v *= length;
        const auto bytes = write_level(c);
        const Level level(bytes);
        for (std::uint32_t f = 0; f < 6; ++f)
            for (const double p : {-128.0, -5.0, 0.0, 77.0, 1e30, -1e300}) {
                const double point[3] = {p, p / 2, p / 3};
                float rgb[3];
                ASSERT_EQ(kiln_level_eval_flat(level.get(), f, point, rgb), KILN_OK);
                for (const float v : rgb) ASSERT_TRUE(v >= 0.99f && v <= 1.01f * static_cast<float>(std::max(c.charts[0].width, c.charts[0].height))) << length;
            }
    }
}

} // namespace
} // namespace kiln::level

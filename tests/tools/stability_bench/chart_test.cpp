// The charts of all benches: what is drawn is where it should be.
#include "tools/chart/chart.h"
#include <cmath>
#include <gtest/gtest.h>

using namespace kiln::bench;

TEST(Chart, FitsPowers) {
    const std::vector<double> x{1, 10, 100}, y{3, 3 * std::pow(10, 1.5), 3e3};
    EXPECT_NEAR(fit_power(x, y).exponent, 1.5, 1e-12);
    EXPECT_NEAR(fit_power(x, y).scale, 3, 1e-12);
}

TEST(Chart, TicksAreOneTwoFive) {
    EXPECT_EQ(log_ticks(1, 10), (std::vector<double>{1, 2, 5, 10}));
    EXPECT_EQ(log_ticks(1, 1e4), (std::vector<double>{1, 10, 100, 1000, 1e4})); // too many otherwise
}

TEST(Chart, EachLookHasItsOwnMarkAndColour) {
    for (std::size_t a = 0; a < kLooks; ++a) {
        for (std::size_t b = 0; b < a; ++b) {
            EXPECT_NE(mark(a, 10, 10), mark(b, 10, 10));
            EXPECT_STRNE(colour_of(a), colour_of(b));
        }
        EXPECT_EQ(mark(a, 1, 2), mark(a + kLooks, 1, 2));
    }
    EXPECT_NE(mark(0, 1, 2, {.title = "a < b"}).find("<title>a &lt; b</title></circle>"), std::string::npos);
}

// A logarithmic axis with a least value shows zeros at its rim, hollow; one without leaves them out.
TEST(Chart, ZerosOnLogarithmicAxes) {
    Panel p{"p", {{"a", {1, 10}, {0, 1}, 0}}, {"x"}, {"y"}, {}};
    const auto count = [](const std::string& text, const std::string& part) {
        std::size_t n = 0;
        for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
        return n;
    };
    EXPECT_EQ(count(draw_svg("t", {p}), "<circle"), 2u); // one value, and the legend
    p.y.least = 1e-3;
    const std::string svg = draw_svg("t", {p});
    EXPECT_EQ(count(svg, "<circle"), 3u);
    EXPECT_EQ(count(svg, "fill='white' stroke="), 1u);
    EXPECT_EQ(svg.find("nan"), std::string::npos);
    EXPECT_EQ(svg.find("inf"), std::string::npos);
}

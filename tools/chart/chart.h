// Pictures of measurements as SVG: the marks and colours all benches share, and panels of curves.
#pragma once
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace kiln::bench {

// A colour and a mark go together: told apart by those who see colours otherwise, and in grey by the mark.
inline constexpr std::size_t kLooks = 7;
const char* colour_of(std::size_t look);
struct MarkStyle {
    bool hollow = false;
    double opacity = 1;
    std::string title = {}; // shown under the pointer; may be empty
};
std::string mark(std::size_t look, double x, double y, const MarkStyle& style = {});
std::string escaped(std::string_view text); // for XML and HTML
// 1, 2, 5 in every decade; only tenfold ones where there are many.
std::vector<double> log_ticks(double lo, double hi);

// y = scale * x^exponent, by least squares of the logarithms.
struct Fit {
    double scale = 0, exponent = 0;
};
Fit fit_power(std::span<const double> x, std::span<const double> y);

enum class Join { line, fit, none }; // of the points of a series; fit: a power, whose exponent the legend tells
struct Series {
    std::string name;
    std::vector<double> x, y;   // in the order in which they are joined
    std::size_t look = SIZE_MAX; // by its place in the panel
    Join join = Join::line;
};
struct Axis {
    std::string label;
    bool log = true;
    // Logarithmic axes: what is not larger is drawn at the rim, hollow, 0 too. 0: there is no such value.
    double least = 0;
    double most = 0; // what is larger is drawn at the rim, hollow; 0: there is none
};
struct Limit { // a horizontal line
    double y = 0;
    std::string name;
};
struct Panel {
    std::string title;
    std::vector<Series> series;
    Axis x, y;
    std::vector<Limit> limits = {};
};
// Panels side by side, two a row; `common`: with the scale of all of them.
std::string draw_svg(const std::string& title, const std::vector<Panel>& panels, bool common = false);

} // namespace kiln::bench

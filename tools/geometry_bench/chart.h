// The measurements as a picture: time against brush count, both axes logarithmic.
#pragma once
#include <span>
#include <string>
#include <vector>

namespace kiln::bench {

// time = scale * brushes^exponent, by least squares of the logarithms.
struct Fit {
    double scale = 0, exponent = 0;
};
Fit fit_power(std::span<const double> x, std::span<const double> y);

struct Series {
    std::string name;
    std::vector<double> x, y; // > 0, x ascending
};
struct Panel {
    std::string title;
    std::vector<Series> series;
};
// Panels side by side, two a row, with a common scale.
std::string draw_svg(const std::string& title, const std::vector<Panel>& panels);

} // namespace kiln::bench

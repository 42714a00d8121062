#include "tools/geometry_bench/chart.h"
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <iterator>

namespace kiln::bench {

Fit fit_power(std::span<const double> x, std::span<const double> y) {
    double mx = 0, my = 0, sxx = 0, sxy = 0;
    const auto n = static_cast<double>(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) mx += std::log(x[i]) / n, my += std::log(y[i]) / n;
    for (std::size_t i = 0; i < x.size(); ++i) {
        const double dx = std::log(x[i]) - mx;
        sxx += dx * dx, sxy += dx * (std::log(y[i]) - my);
    }
    Fit fit;
    fit.exponent = sxx > 0 ? sxy / sxx : 0;
    fit.scale = std::exp(my - fit.exponent * mx);
    return fit;
}

namespace {

// Told apart by those who see colours otherwise, and in grey by their marks (Okabe and Ito's palette).
constexpr const char* kColours[] = {"#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#000000", "#56B4E9"};
constexpr double kWidth = 520, kHeight = 430, kLeft = 62, kRight = 16, kTop = 40, kBottom = 48; // of a panel, pixels

std::string mark(std::size_t kind, double x, double y, const char* colour) {
    switch (kind % 4) {
    case 0: return fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='3.4' fill='{}'/>", x, y, colour);
    case 1: return fmt::format("<rect x='{:.1f}' y='{:.1f}' width='6.4' height='6.4' fill='{}'/>", x - 3.2, y - 3.2, colour);
    case 2: return fmt::format("<path d='M{:.1f} {:.1f}l4 7h-8z' fill='{}'/>", x, y - 4.4, colour);
    default: return fmt::format("<path d='M{:.1f} {:.1f}l4.4 4.4l-4.4 4.4l-4.4-4.4z' fill='{}'/>", x, y - 4.4, colour);
    }
}
std::string power_of_ten(int e) { return e >= 0 && e < 6 ? fmt::format("{}", std::lround(std::pow(10, e))) : e < 0 && e > -4 ? fmt::format("{:g}", std::pow(10, e)) : fmt::format("1e{}", e); }

} // namespace

std::string draw_svg(const std::string& title, const std::vector<Panel>& panels) {
    double x_lo = 1e300, x_hi = 0, y_lo = 1e300, y_hi = 0;
    for (const Panel& p : panels)
        for (const Series& s : p.series)
            for (std::size_t i = 0; i < s.x.size(); ++i)
                x_lo = std::min(x_lo, s.x[i]), x_hi = std::max(x_hi, s.x[i]), y_lo = std::min(y_lo, s.y[i]), y_hi = std::max(y_hi, s.y[i]);
    const double e0 = std::log10(x_lo) - 0.1, e1 = std::log10(x_hi) + 0.1; // air beside the outermost marks
    const int f0 = static_cast<int>(std::floor(std::log10(y_lo))), f1 = static_cast<int>(std::ceil(std::log10(y_hi)));

    const std::size_t columns = std::min<std::size_t>(2, panels.size()), rows = (panels.size() + 1) / 2;
    std::string svg;
    const auto put = [&]<class... T>(fmt::format_string<T...> f, T&&... values) { fmt::format_to(std::back_inserter(svg), f, std::forward<T>(values)...); };
    const double width = kWidth * static_cast<double>(columns), height = kHeight * static_cast<double>(rows) + 34;
    put("<svg xmlns='http://www.w3.org/2000/svg' width='{0:g}' height='{1:g}' viewBox='0 0 {0:g} {1:g}' font-family='sans-serif' font-size='12'>\n", width, height);
    put("<rect width='100%' height='100%' fill='white'/>\n<text x='{:g}' y='24' font-size='16' text-anchor='middle'>{}</text>\n", width / 2, title);
    for (std::size_t p = 0; p < panels.size(); ++p) {
        const double ox = kWidth * static_cast<double>(p % 2) + kLeft, oy = kHeight * static_cast<double>(p / 2) + 34 + kTop;
        const double w = kWidth - kLeft - kRight, h = kHeight - kTop - kBottom;
        const auto at_x = [&](double x) { return ox + w * (std::log10(x) - e0) / (e1 - e0); };
        const auto at_y = [&](double y) { return oy + h * (1 - (std::log10(y) - f0) / (f1 - f0)); };
        put("<text x='{:.1f}' y='{:.1f}' font-size='14' text-anchor='middle'>{}</text>\n", ox + w / 2, oy - 12, panels[p].title);
        for (int e = static_cast<int>(std::ceil(e0)); e <= e1; ++e) {
            const double x = at_x(std::pow(10, e));
            put("<path d='M{0:.1f} {1:.1f}V{2:.1f}' stroke='#ddd'/><text x='{0:.1f}' y='{3:.1f}' text-anchor='middle'>{4}</text>\n", x, oy, oy + h, oy + h + 16, power_of_ten(e));
        }
        for (int f = f0; f <= f1; ++f) {
            const double y = at_y(std::pow(10, f));
            put("<path d='M{0:.1f} {1:.1f}H{2:.1f}' stroke='#ddd'/><text x='{3:.1f}' y='{4:.1f}' text-anchor='end'>{5}</text>\n", ox, y, ox + w, ox - 6, y + 4, power_of_ten(f));
        }
        put("<rect x='{:.1f}' y='{:.1f}' width='{:.1f}' height='{:.1f}' fill='none' stroke='#888'/>\n", ox, oy, w, h);
        put("<text x='{:.1f}' y='{:.1f}' text-anchor='middle'>brushes</text>\n", ox + w / 2, oy + h + 36);
        put("<text transform='translate({:.1f} {:.1f}) rotate(-90)' text-anchor='middle'>CPU seconds, one thread</text>\n", ox - 46, oy + h / 2);
        for (std::size_t s = 0; s < panels[p].series.size(); ++s) {
            const Series& series = panels[p].series[s];
            const char* colour = kColours[s % std::size(kColours)];
            const Fit fit = fit_power(series.x, series.y);
            if (series.x.size() > 1) {
                const auto line = [&](double x) { return std::clamp(fit.scale * std::pow(x, fit.exponent), std::pow(10, f0), std::pow(10, f1)); };
                put("<path d='M{:.1f} {:.1f}L{:.1f} {:.1f}' stroke='{}' stroke-width='1.3' fill='none'/>\n", at_x(series.x.front()), at_y(line(series.x.front())),
                    at_x(series.x.back()), at_y(line(series.x.back())), colour);
            }
            for (std::size_t i = 0; i < series.x.size(); ++i) svg += mark(s, at_x(series.x[i]), at_y(series.y[i]), colour);
            const double ly = oy + 18 + 18 * static_cast<double>(s);
            svg += mark(s, ox + 16, ly - 4, colour);
            put("<text x='{:.1f}' y='{:.1f}'>{}{}</text>\n", ox + 28, ly, series.name,
                series.x.size() > 1 ? fmt::format(": brushes^{:.2f}", fit.exponent) : std::string());
        }
    }
    return svg + "</svg>\n";
}

} // namespace kiln::bench

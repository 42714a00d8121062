#include "tools/chart/chart.h"
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <iterator>

namespace kiln::bench {

const char* colour_of(std::size_t look) { // Okabe and Ito's palette
    static constexpr const char* kColours[kLooks] = {"#D55E00", "#000000", "#E69F00", "#56B4E9", "#0072B2", "#009E73", "#CC79A7"};
    return kColours[look % kLooks];
}

std::string mark(std::size_t look, double x, double y, const MarkStyle& s) {
    const char* colour = colour_of(look);
    const std::string style = s.hollow ? fmt::format("fill='white' stroke='{}' stroke-width='1.4'", colour) : fmt::format("fill='{}' fill-opacity='{:g}'", colour, s.opacity);
    const char* element = look % kLooks == 0 ? "circle" : look % kLooks == 1 ? "rect" : "path";
    std::string shape;
    switch (look % kLooks) {
    case 0: shape = fmt::format("cx='{:.1f}' cy='{:.1f}' r='4.4'", x, y); break;
    case 1: shape = fmt::format("x='{:.1f}' y='{:.1f}' width='7' height='7'", x - 3.5, y - 3.5); break;
    case 2: shape = fmt::format("d='M{:.1f} {:.1f}l4.4 7.4h-8.8z'", x, y - 4.9); break;
    case 3: shape = fmt::format("d='M{:.1f} {:.1f}l4.4 -7.4h-8.8z'", x, y + 4.9); break;
    case 4: shape = fmt::format("d='M{:.1f} {:.1f}l4.8 4.8l-4.8 4.8l-4.8-4.8z'", x, y - 4.8); break;
    case 5: shape = fmt::format("d='M{:.1f} {:.1f}h3v3.2h3.2v3h-3.2v3.2h-3v-3.2h-3.2v-3h3.2z'", x - 1.5, y - 4.7); break;
    default: shape = fmt::format("d='M{:.1f} {:.1f}l4.6 3.4l-1.8 5.4h-5.6l-1.8-5.4z'", x, y - 4.6); break;
    }
    if (s.title.empty()) return fmt::format("<{} {} {}/>\n", element, shape, style);
    return fmt::format("<{0} {1} {2}><title>{3}</title></{0}>\n", element, shape, style, escaped(s.title));
}

std::string escaped(std::string_view text) {
    std::string out;
    for (const char c : text) {
        switch (c) {
        case '<': out += "&lt;"; break;
        case '>': out += "&gt;"; break;
        case '&': out += "&amp;"; break;
        case '\'': out += "&#39;"; break;
        default: out += c;
        }
    }
    return out;
}

std::vector<double> log_ticks(double lo, double hi) {
    std::vector<double> out;
    const bool many = hi / lo > 3000;
    for (int e = static_cast<int>(std::floor(std::log10(lo))); e <= std::log10(hi); ++e)
        for (const double k : {1.0, 2.0, 5.0})
            if (const double x = k * std::pow(10, e); x >= lo * 0.999 && x <= hi * 1.001 && (k == 1 || !many)) out.push_back(x);
    return out;
}

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

constexpr double kWidth = 740, kHeight = 430, kLeft = 62, kRight = 270, kTop = 40, kBottom = 48; // of a panel, pixels

// One axis of one panel: from values to 0..1.
class Scale {
public:
    explicit Scale(const Axis& axis) : axis_(axis) {}
    void add(double v) {
        if (!std::isfinite(v) || (axis_.log && !(v > 0) && !(axis_.least > 0))) return;
        v = drawn(v), lo_ = std::min(lo_, v), hi_ = std::max(hi_, v);
    }
    void add(const Scale& other) { lo_ = std::min(lo_, other.lo_), hi_ = std::max(hi_, other.hi_); }
    void settle() { // some air beside the outermost values
        if (lo_ > hi_) lo_ = axis_.log ? 1 : 0, hi_ = axis_.log ? 10 : 1;
        if (axis_.log) {
            if (hi_ / lo_ < 4) lo_ /= 2, hi_ *= 2;
            const double air = std::pow(hi_ / lo_, 0.04);
            lo_ /= air, hi_ *= air;
        } else {
            const double air = hi_ > lo_ ? 0.04 * (hi_ - lo_) : 1;
            lo_ -= air, hi_ += air;
        }
    }
    double drawn(double v) const {
        if (axis_.log && axis_.least > 0) v = std::max(v, axis_.least);
        return axis_.most > 0 ? std::min(v, axis_.most) : v;
    }
    bool at_rim(double v) const { return drawn(v) != v || (axis_.log && axis_.least > 0 && v <= axis_.least); }
    bool can_show(double v) const { return !std::isnan(v) && (!axis_.log || v > 0 || axis_.least > 0); }
    double at(double v) const {
        v = std::clamp(drawn(v), lo_, hi_);
        return axis_.log ? std::log(v / lo_) / std::log(hi_ / lo_) : (v - lo_) / (hi_ - lo_);
    }
    std::vector<double> ticks() const {
        if (axis_.log) {
            std::vector<double> t = log_ticks(lo_, hi_);
            if (t.size() > 9) std::erase_if(t, [every = hi_ / lo_ > 1e9 ? 3 : 2](double v) { return std::lround(std::log10(v)) % every != 0; });
            return t;
        }
        const double step = std::pow(10, std::floor(std::log10(hi_ - lo_))), k = (hi_ - lo_) / step;
        const double width = step * (k > 5 ? 1 : k > 2 ? 0.5 : 0.2);
        std::vector<double> t;
        for (double i = std::ceil(lo_ / width); i * width <= hi_; ++i) t.push_back(i * width);
        return t;
    }
    std::string label(double v) const {
        if (!axis_.log && std::abs(v) < 1e-9 * (hi_ - lo_)) v = 0;
        return fmt::format("{:.6g}", v);
    }

private:
    Axis axis_;
    double lo_ = 1e300, hi_ = -1e300;
};

} // namespace

std::string draw_svg(const std::string& title, const std::vector<Panel>& panels, bool common) {
    std::vector<Scale> xs, ys;
    for (const Panel& p : panels) {
        xs.emplace_back(p.x), ys.emplace_back(p.y);
        for (const Series& s : p.series)
            for (std::size_t i = 0; i < s.x.size(); ++i) xs.back().add(s.x[i]), ys.back().add(s.y[i]);
        for (const Limit& l : p.limits) ys.back().add(l.y);
    }
    if (common)
        for (std::size_t p = 1; p < panels.size(); ++p) xs[0].add(xs[p]), ys[0].add(ys[p]);
    for (std::size_t p = 0; p < panels.size(); ++p) {
        if (common && p) xs[p].add(xs[0]), ys[p].add(ys[0]);
        if (!common) xs[p].settle(), ys[p].settle();
    }
    if (common)
        for (std::size_t p = 0; p < panels.size(); ++p) xs[p].settle(), ys[p].settle();

    const std::size_t columns = std::min<std::size_t>(2, panels.size()), rows = (panels.size() + 1) / 2;
    std::string svg;
    const auto put = [&]<class... T>(fmt::format_string<T...> f, T&&... values) { fmt::format_to(std::back_inserter(svg), f, std::forward<T>(values)...); };
    const double width = kWidth * static_cast<double>(columns), height = kHeight * static_cast<double>(rows) + 34;
    put("<svg xmlns='http://www.w3.org/2000/svg' width='{0:g}' height='{1:g}' viewBox='0 0 {0:g} {1:g}' font-family='sans-serif' font-size='12'>\n", width, height);
    put("<rect width='100%' height='100%' fill='white'/>\n<text x='{:g}' y='24' font-size='16' text-anchor='middle'>{}</text>\n", width / 2, escaped(title));
    for (std::size_t p = 0; p < panels.size(); ++p) {
        const Panel& panel = panels[p];
        const double ox = kWidth * static_cast<double>(p % 2) + kLeft, oy = kHeight * static_cast<double>(p / 2) + 34 + kTop;
        const double w = kWidth - kLeft - kRight, h = kHeight - kTop - kBottom;
        const auto at_x = [&](double x) { return ox + w * xs[p].at(x); };
        const auto at_y = [&](double y) { return oy + h * (1 - ys[p].at(y)); };
        put("<text x='{:.1f}' y='{:.1f}' font-size='14' text-anchor='middle'>{}</text>\n", ox + w / 2, oy - 12, escaped(panel.title));
        for (const double v : xs[p].ticks())
            put("<path d='M{0:.1f} {1:.1f}V{2:.1f}' stroke='#ddd'/><text x='{0:.1f}' y='{3:.1f}' text-anchor='middle'>{4}</text>\n", at_x(v), oy, oy + h, oy + h + 16, xs[p].label(v));
        for (const double v : ys[p].ticks())
            put("<path d='M{0:.1f} {1:.1f}H{2:.1f}' stroke='#ddd'/><text x='{3:.1f}' y='{4:.1f}' text-anchor='end'>{5}</text>\n", ox, at_y(v), ox + w, ox - 6, at_y(v) + 4, ys[p].label(v));
        put("<rect x='{:.1f}' y='{:.1f}' width='{:.1f}' height='{:.1f}' fill='none' stroke='#888'/>\n", ox, oy, w, h);
        put("<text x='{:.1f}' y='{:.1f}' text-anchor='middle'>{}</text>\n", ox + w / 2, oy + h + 36, escaped(panel.x.label));
        put("<text transform='translate({:.1f} {:.1f}) rotate(-90)' text-anchor='middle'>{}</text>\n", ox - 48, oy + h / 2, escaped(panel.y.label));
        for (const Limit& l : panel.limits)
            put("<path d='M{:.1f} {:.1f}H{:.1f}' stroke='#555' stroke-dasharray='6 4'/><text x='{:.1f}' y='{:.1f}' text-anchor='end' font-size='11' fill='#555'>{}</text>\n", ox, at_y(l.y), ox + w,
                ox + w - 4, at_y(l.y) - 4, escaped(l.name));
        // From the last on: the first, ours, lies on top.
        for (std::size_t k = panel.series.size(); k-- > 0;) {
            const Series& s = panel.series[k];
            const std::size_t look = s.look == SIZE_MAX ? k : s.look;
            if (s.join == Join::fit && s.x.size() > 1) {
                const Fit fit = fit_power(s.x, s.y);
                put("<path d='M{:.1f} {:.1f}L{:.1f} {:.1f}' stroke='{}' stroke-width='1.3' fill='none'/>\n", at_x(s.x.front()), at_y(fit.scale * std::pow(s.x.front(), fit.exponent)), at_x(s.x.back()),
                    at_y(fit.scale * std::pow(s.x.back(), fit.exponent)), colour_of(look));
            }
            std::string path;
            for (std::size_t i = 0; i < s.x.size() && s.join == Join::line; ++i)
                if (xs[p].can_show(s.x[i]) && ys[p].can_show(s.y[i])) path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", at_x(s.x[i]), at_y(s.y[i]));
            if (!path.empty()) put("<path d='{}' stroke='{}' stroke-width='1.3' stroke-opacity='0.8' fill='none'/>\n", path, colour_of(look));
            for (std::size_t i = 0; i < s.x.size(); ++i)
                if (xs[p].can_show(s.x[i]) && ys[p].can_show(s.y[i]))
                    svg += mark(look, at_x(s.x[i]), at_y(s.y[i]), {.hollow = xs[p].at_rim(s.x[i]) || ys[p].at_rim(s.y[i]), .title = fmt::format("{}: {:.4g}, {:.4g}", s.name, s.x[i], s.y[i])});
        }
        for (std::size_t k = 0; k < panel.series.size(); ++k) {
            const Series& s = panel.series[k];
            const double ly = oy + 18 + 16 * static_cast<double>(k);
            const std::string name = s.join == Join::fit && s.x.size() > 1 ? fmt::format("{}: exponent {:.2f}", s.name, fit_power(s.x, s.y).exponent) : s.name;
            svg += mark(s.look == SIZE_MAX ? k : s.look, ox + w + 14, ly - 4);
            put("<text x='{:.1f}' y='{:.1f}' font-size='11'>{}</text>\n", ox + w + 26, ly, escaped(name));
        }
    }
    return svg + "</svg>\n";
}

} // namespace kiln::bench

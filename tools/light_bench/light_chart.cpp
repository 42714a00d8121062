#include "tools/light_bench/light_chart.h"
#include "tools/chart/chart.h"
#include "tools/light_bench/sweep.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <iterator>
#include <map>

namespace kiln::bench {
namespace {

constexpr double kWidth = 980, kHeight = 560, kLeft = 64, kRight = 300, kTop = 48, kBottom = 52;
constexpr double kMostError = 300; // percent; worse is drawn at the rim

std::string count(double x) { return x >= 1e9 ? fmt::format("{:.1f} G", x * 1e-9) : x >= 1e7 ? fmt::format("{:.0f} M", x * 1e-6) : fmt::format("{:.2g} M", x * 1e-6); }
std::string range(double lo, double hi, const std::string& a, const std::string& b) { return lo == hi || a == b ? a : a + " to " + b; }

// Those measured, in a fixed order.
std::vector<std::string> methods_of(std::span<const Measurement> all) {
    std::vector<std::string> names;
    for (const std::string& name : method_names())
        if (std::ranges::find(all, name, &Measurement::method) != all.end()) names.push_back(name);
    for (const Measurement& m : all)
        if (std::ranges::find(names, m.method) == names.end()) names.push_back(m.method);
    return names;
}

} // namespace

std::string light_csv(std::span<const Measurement> measurements) {
    std::string out = "scene,method,setting,cpu_s,calibration_rays_per_s,cost_million_rays,rays,traced,peak_mb,luxels,luxels_lit,rrmse_percent,truth_noise_percent,rrmse_n,rrmse_b1,rrmse_b2,rrmse_b3,"
                      "bias_n,p95_n,estimate_percent,estimate_low,estimate_high,at_noise,skipped\n";
    for (const Measurement& m : measurements) {
        const Errors& e = m.errors;
        if (!m.skipped.empty()) {
            std::string why = m.skipped;
            std::ranges::replace(why, ',', ';');
            out += fmt::format("{},{},{},,,,,,,{},,,,,,,,,,,,,,{}\n", m.scene, m.method, m.setting, m.luxels, why);
            continue;
        }
        out += fmt::format("{},{},{},{:.4g},{:.4g},{:.4g},{:.0f},{:.0f},{:.1f},{},{},{:.4g},{:.3f},{:.4g},{:.4g},{:.4g},{:.4g},{:+.4g},{:.4g},", m.scene, m.method, m.setting, m.cpu_s, m.calibration, m.cost(),
                           m.rays, m.traced, m.peak_mb, m.luxels, m.lit, e.worst, e.worst_noise, e.rrmse[0], e.rrmse[1], e.rrmse[2], e.rrmse[3], e.bias[0], e.p95);
        out += m.estimate > 0 ? fmt::format("{:.3f},{:.3f},{:.3f}", m.estimate, m.low, m.high) : ",,";
        out += fmt::format(",{},\n", e.at_noise() ? 1 : 0);
    }
    return out;
}

std::string light_svg(const std::string& scene, std::span<const Measurement> all) {
    std::vector<Measurement> shown;
    for (const Measurement& m : all)
        if (m.scene == scene && m.skipped.empty() && m.cpu_s > 0) shown.push_back(m);
    double x_lo = 1e300, x_hi = 0, y_lo = 1e300, y_hi = 0, noise = 0;
    const auto clamped = [](double y) { return std::clamp(y, 0.01, kMostError); };
    for (const Measurement& m : shown) {
        x_lo = std::min(x_lo, m.cpu_s), x_hi = std::max(x_hi, m.cpu_s);
        for (const double y : {m.errors.worst, m.estimate})
            if (y > 0) y_lo = std::min(y_lo, clamped(y)), y_hi = std::max(y_hi, clamped(y));
        noise = std::max(noise, std::ranges::max(m.errors.noise));
    }
    if (shown.empty() || !(y_hi > 0)) x_lo = y_lo = 1, x_hi = y_hi = 10;
    x_lo /= 1.3, x_hi *= 1.3, y_lo /= 1.3, y_hi *= 1.3;
    const double w = kWidth - kLeft - kRight, h = kHeight - kTop - kBottom;
    const auto at_x = [&](double x) { return kLeft + w * std::log(x / x_lo) / std::log(x_hi / x_lo); };
    const auto at_y = [&](double y) { return kTop + h * (1 - std::log(y / y_lo) / std::log(y_hi / y_lo)); };

    std::string svg;
    const auto put = [&]<class... T>(fmt::format_string<T...> f, T&&... values) { fmt::format_to(std::back_inserter(svg), f, std::forward<T>(values)...); };
    put("<svg xmlns='http://www.w3.org/2000/svg' width='{0:g}' height='{1:g}' viewBox='0 0 {0:g} {1:g}' font-family='sans-serif' font-size='12'>\n", kWidth, kHeight);
    put("<rect width='100%' height='100%' fill='white'/>\n<clipPath id='plot-{}'><rect x='{:g}' y='{:g}' width='{:g}' height='{:g}'/></clipPath>\n", escaped(scene), kLeft, kTop, w, h);
    put("<text x='{:g}' y='20' font-size='16'>{}</text>\n", kLeft, escaped(scene));
    if (!shown.empty())
        put("<text x='{:g}' y='38' fill='#555'>{} luxels, flat and three directions; truth: {:.2g} % noise in its worst direction</text>\n", kLeft, shown.front().luxels, noise);
    for (const double x : log_ticks(x_lo, x_hi))
        put("<path d='M{0:.1f} {1:.1f}V{2:.1f}' stroke='#e4e4e4'/><text x='{0:.1f}' y='{3:.1f}' text-anchor='middle'>{4:g}</text>\n", at_x(x), kTop, kTop + h, kTop + h + 16, x);
    for (const double y : log_ticks(y_lo, y_hi))
        put("<path d='M{0:.1f} {1:.1f}H{2:.1f}' stroke='#e4e4e4'/><text x='{3:.1f}' y='{4:.1f}' text-anchor='end'>{5:g} %</text>\n", kLeft, at_y(y), kLeft + w, kLeft - 6, at_y(y) + 4, y);
    // Slope -1/2: error times the root of time stays the same.
    put("<g clip-path='url(#plot-{})'>\n", escaped(scene));
    const double least = y_lo * std::sqrt(x_lo), most = y_hi * std::sqrt(x_hi);
    for (double k = std::pow(10, std::floor(std::log10(least) * 2) / 2); k < most; k *= std::sqrt(10.0))
        put("<path d='M{:.1f} {:.1f}L{:.1f} {:.1f}' stroke='#bbb' stroke-dasharray='5 5'/>\n", at_x(x_lo), at_y(k / std::sqrt(x_lo)), at_x(x_hi), at_y(k / std::sqrt(x_hi)));
    put("</g>\n<rect x='{:g}' y='{:g}' width='{:g}' height='{:g}' fill='none' stroke='#888'/>\n", kLeft, kTop, w, h);
    put("<text x='{:.1f}' y='{:.1f}' text-anchor='middle'>CPU seconds for all luxels</text>\n", kLeft + w / 2, kTop + h + 38);
    put("<text transform='translate({:.1f} {:.1f}) rotate(-90)' text-anchor='middle'>rRMSE of irradiance, worst direction</text>\n", kLeft - 48, kTop + h / 2);

    const std::vector<std::string> methods = methods_of(all), known = method_names();
    // A method looks the same in every picture, whatever stands beside it.
    const auto look = [&](std::size_t k) { return static_cast<std::size_t>(std::ranges::find(known, methods[k]) - known.begin()); };
    double legend = kTop + 8;
    const double column = kLeft + w + 22;
    for (std::size_t k = methods.size(); k-- > 0;) {
        std::vector<const Measurement*> line;
        for (const Measurement& m : shown)
            if (m.method == methods[k]) line.push_back(&m);
        const char* colour = colour_of(look(k));
        std::string path;
        for (const Measurement* m : line) path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", at_x(m->cpu_s), at_y(clamped(m->errors.worst)));
        if (line.size() > 1) put("<path d='{}' stroke='{}' stroke-width='{}' stroke-opacity='0.8' fill='none'/>\n", path, colour, look(k) ? "1.1" : "2");
        for (const Measurement* m : line) {
            const double x = at_x(m->cpu_s), y = at_y(clamped(m->errors.worst));
            if (m->estimate > 0) {
                const double e = at_y(clamped(m->estimate));
                put("<path d='M{0:.1f} {1:.1f}V{2:.1f}' stroke='{3}' stroke-width='0.8'/>", x, y, e, colour);
                svg += mark(look(k), x, e, {.hollow = true, .title = fmt::format("own estimate {:.2f} %", m->estimate)});
            }
            svg += mark(look(k), x, y,
                        {.opacity = m->errors.at_noise() ? 0.35 : 1,
                         .title = fmt::format("{} {}: {:.3g} CPU s, {:.3g} %, {} rays, {:.0f} MB", m->method, m->setting, m->cpu_s, m->errors.worst, count(m->rays), m->peak_mb)});
        }
    }
    for (std::size_t k = 0; k < methods.size(); ++k) {
        double rays_lo = 1e300, rays_hi = 0, mb_lo = 1e300, mb_hi = 0;
        std::size_t points = 0;
        for (const Measurement& m : shown)
            if (m.method == methods[k]) rays_lo = std::min(rays_lo, m.rays), rays_hi = std::max(rays_hi, m.rays), mb_lo = std::min(mb_lo, m.peak_mb), mb_hi = std::max(mb_hi, m.peak_mb), ++points;
        svg += mark(look(k), column, legend - 4);
        put("<text x='{:.1f}' y='{:.1f}' font-weight='{}'>{}</text>\n", column + 14, legend, look(k) ? "normal" : "bold", escaped(methods[k]));
        if (points)
            put("<text x='{:.1f}' y='{:.1f}' font-size='11' fill='#555'>{} rays, {} MB</text>\n", column + 14, legend + 15, range(rays_lo, rays_hi, count(rays_lo), count(rays_hi)),
                range(mb_lo, mb_hi, fmt::format("{:.0f}", mb_lo), fmt::format("{:.0f}", mb_hi)));
        else
            put("<text x='{:.1f}' y='{:.1f}' font-size='11' fill='#555'>not measured</text>\n", column + 14, legend + 15);
        legend += 40;
    }
    legend += 8;
    for (const char* note : {"hollow: what the bake says of its own error", "faint: within twice the noise of the truth", "dashed: slope -1/2, plain Monte Carlo"}) {
        put("<text x='{:.1f}' y='{:.1f}' font-size='11' fill='#555'>{}</text>\n", column - 6, legend, note);
        legend += 16;
    }
    return svg + "</svg>\n";
}

std::string light_html(std::span<const std::string> scenes, std::span<const Measurement> all, const std::string& remark) {
    std::string out = "<!doctype html>\n<html lang='en'><meta charset='utf-8'><title>Light: error against time</title>\n"
                      "<style>body{font-family:sans-serif;max-width:1000px;margin:2em auto;padding:0 1em}svg{max-width:100%;height:auto}table{border-collapse:collapse;font-size:12px;margin:1em 0}"
                      "td,th{padding:2px 8px;text-align:right;border-bottom:1px solid #ddd}td:nth-child(-n+2),th:nth-child(-n+2){text-align:left}summary{cursor:pointer}</style>\n<h1>Light: error against time</h1>\n";
    out += fmt::format("<p>{}</p>\n", escaped(remark));
    for (const std::string& scene : scenes) {
        out += fmt::format("<h2 id='{0}'>{0}</h2>\n{1}<details><summary>numbers</summary><table><tr><th>method<th>setting<th>CPU s<th>rRMSE %<th>n<th>b1<th>b2<th>b3<th>bias n %<th>own estimate %<th>rays<th>MB</tr>\n", escaped(scene),
                           light_svg(scene, all));
        for (const Measurement& m : all) {
            if (m.scene != scene) continue;
            if (!m.skipped.empty()) {
                out += fmt::format("<tr><td>{}<td>{}<td colspan='10' style='text-align:left'>{}</tr>\n", escaped(m.method), escaped(m.setting), escaped(m.skipped));
                continue;
            }
            const Errors& e = m.errors;
            out += fmt::format("<tr><td>{}<td>{}<td>{:.3g}<td>{}{:.3g}<td>{:.3g}<td>{:.3g}<td>{:.3g}<td>{:.3g}<td>{:+.2g}<td>{}<td>{}<td>{:.0f}</tr>\n", escaped(m.method), escaped(m.setting), m.cpu_s,
                               e.at_noise() ? "~" : "", e.worst, e.rrmse[0], e.rrmse[1], e.rrmse[2], e.rrmse[3], e.bias[0], m.estimate > 0 ? fmt::format("{:.2f}", m.estimate) : "", count(m.rays), m.peak_mb);
        }
        out += "</table></details>\n";
    }
    return out + "</html>\n";
}

} // namespace kiln::bench

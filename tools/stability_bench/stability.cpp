#include "tools/stability_bench/stability.h"
#include "tools/stability_bench/sweeps.h"
#include <algorithm>
#include <fmt/format.h>

namespace kiln::bench {
namespace {

struct Entry {
    SweepName name;
    const char* range;
    void (*run)(SweepReport&, const SweepSettings&, Context&);
};
const std::vector<Entry>& entries() {
    static const std::vector<Entry> kEntries = {
        {{"F1", "faces that touch"}, "error within the target up to the edge, falling with it; no bright line", sweep_touching_faces},
        {{"F2", "furnaces in random maps"}, "|E (1 - albedo) / pi - 1| within the target; no ray escapes", sweep_furnaces},
        {{"F3", "walls from 64 to 1/16 unit across a floor"}, "no light behind a sealed wall, wherever luxels and patches lie", sweep_wall_thickness},
        {{"F4", "a sealed dark box in a bright world, far from the origin"}, "exactly 0 inside", sweep_dark_box},
        {{"F5", "fans of T-junctions"}, "no ray gets through", sweep_fans},
        {{"F6", "needles, slivers and duplicates"}, "finite, energy kept within the target, at most twice the time", sweep_needles},
        {{"F7", "a lamp that shrinks at constant power"}, "error within the target, time flat", sweep_small_lamp},
        {{"F8", "sun and lamps at the horizon"}, "sun: E follows the sine to 1e-4, and is 0 below; lamps: Lambert's clipped value", sweep_horizon},
        {{"F9", "smoothing over folds"}, "no negative light, none from behind", sweep_smoothing},
        {{"F10", "maps moved, turned and scaled"}, "the same light within the target; the same bits after a move by whole luxels", sweep_placing},
        {{"F11", "a corridor of 100 diameters, albedo up to 0.99"}, "decay within the target over four decades", sweep_corridor},
        {{"F12", "targets, seeds and threads"}, "the same bytes for any number of threads; the estimate covers the true error in 95 % of runs", sweep_settings},
        {{"F13", "the lattice of ambient cubes against walls"}, "no dip before a wall, no light behind it, at any offset", sweep_ambient_lattice},
        {{"F14", "probes about closets and forks"}, "no face takes a probe from behind a wall", sweep_probes},
        {{"F16", "degenerate maps"}, "defined results", sweep_degenerate},
    };
    return kEntries;
}

} // namespace

const std::vector<SweepName>& stability_sweeps() {
    static const std::vector<SweepName> kNames = [] {
        std::vector<SweepName> names;
        for (const Entry& e : entries()) names.push_back(e.name);
        return names;
    }();
    return kNames;
}

std::optional<SweepReport> run_sweep(const std::string& id, const SweepSettings& settings, Context& context) {
    for (const Entry& e : entries()) {
        if (e.name.id != id) continue;
        SweepReport report{e.name.id, e.name.title, e.range, {}, {}};
        e.run(report, settings, context);
        return report;
    }
    return std::nullopt;
}

void add_point(Panel& panel, const std::string& name, std::size_t look, double x, double y) {
    auto at = std::ranges::find(panel.series, name, &Series::name);
    if (at == panel.series.end()) at = panel.series.insert(at, Series{.name = name, .x = {}, .y = {}, .look = look});
    at->x.push_back(x), at->y.push_back(y);
}
std::vector<double> values_of(const SweepSettings& settings, std::vector<double> all, std::vector<double> few) { return settings.quick ? few : all; }

const Series* series_of(const Panel& panel, const std::string& name) {
    const auto at = std::ranges::find(panel.series, name, &Series::name);
    return at == panel.series.end() ? nullptr : &*at;
}

std::string stability_csv(const SweepReport& report) {
    std::string out = "sweep,panel,method,x,y\n";
    const auto plain = [](std::string text) {
        std::ranges::replace(text, ',', ';');
        return text;
    };
    for (const Panel& p : report.panels)
        for (const Series& s : p.series)
            for (std::size_t i = 0; i < s.x.size(); ++i) out += fmt::format("{},{},{},{:.8g},{:.8g}\n", report.id, plain(p.title), plain(s.name), s.x[i], s.y[i]);
    return out;
}
std::string stability_svg(const SweepReport& report) { return draw_svg(fmt::format("{}: {}", report.id, report.title), report.panels); }

std::string stability_html(const std::vector<SweepReport>& reports) {
    std::string out = "<!doctype html>\n<html lang='en'><meta charset='utf-8'><title>Light: where methods fail</title>\n"
                      "<style>body{font-family:sans-serif;max-width:1080px;margin:2em auto;padding:0 1em}svg{max-width:100%;height:auto}</style>\n<h1>Light: where methods fail</h1>\n<p>";
    for (const SweepReport& r : reports) out += fmt::format("<a href='#{0}'>{0} {1}</a><br>\n", escaped(r.id), escaped(r.title));
    out += "</p>\n";
    for (const SweepReport& r : reports) {
        out += fmt::format("<h2 id='{0}'>{0}: {1}</h2>\n<p>Asked of the bake: {2}. <a href='stability_{0}.csv'>Numbers</a></p>\n{3}", escaped(r.id), escaped(r.title), escaped(r.range), stability_svg(r));
        for (const std::string& note : r.notes) out += fmt::format("<p>{}</p>\n", escaped(note));
    }
    return out + "</html>\n";
}

} // namespace kiln::bench

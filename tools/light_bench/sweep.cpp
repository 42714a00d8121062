#include "tools/light_bench/sweep.h"
#include "libs/core/process.h"
#include <algorithm>
#include <charconv>
#include <fmt/format.h>

namespace kiln::bench {
namespace {

using rivals::MatrixRule;

struct Setting {
    std::string text;
    MakeMethod make;
};
struct Family {
    std::string name;
    std::vector<Setting> settings; // cheapest first
};

double luxel_size(const Surfaces& s) { // of most luxels
    std::vector<double> sizes;
    for (const Luxel& l : s.luxels) sizes.push_back(s.charts[l.chart.at()].luxel_size);
    if (sizes.empty()) return 16;
    std::ranges::nth_element(sizes, sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2));
    return sizes[sizes.size() / 2];
}

std::vector<Family> families(double luxel) {
    std::vector<Family> out;
    Family paths{"paths", {}};
    for (const std::uint32_t n : {16u, 64u, 256u, 1024u, 4096u})
        paths.settings.push_back({fmt::format("{} paths", n), [=](const rivals::Scene& s, Context&) { return path_tracing(s, {.paths = n}); }});
    out.push_back(paths);
    const std::pair<const char*, MatrixRule> rules[] = {{"matrix-centre", MatrixRule::centre}, {"matrix-vrad", MatrixRule::vrad}, {"matrix-corrected", MatrixRule::corrected}};
    for (const auto& [name, rule] : rules) {
        Family family{name, {}};
        for (const double k : {16.0, 8.0, 4.0, 2.0, 1.0})
            family.settings.push_back({fmt::format("h {:g}", k * luxel), [=, r = rule](const rivals::Scene& s, Context& c) { return matrix_radiosity(s, {.patch_size = k * luxel, .rule = r}, c); }});
        out.push_back(family);
    }
    Family hemicube{"hemicube", {}};
    for (const auto& [k, r] : {std::pair{4.0, 8u}, std::pair{4.0, 16u}, std::pair{2.0, 32u}, std::pair{2.0, 64u}})
        hemicube.settings.push_back({fmt::format("h {:g} {}x{}", k * luxel, r, r), [=, h = k * luxel, p = r](const rivals::Scene& s, Context& c) { return hemicube_radiosity(s, {.patch_size = h, .resolution = p}, c); }});
    out.push_back(hemicube);
    Family cut{"light-cut", {}};
    for (const auto& [n, e] : {std::pair{1024u, 0.05}, std::pair{4096u, 0.02}, std::pair{16384u, 0.01}, std::pair{65536u, 0.005}, std::pair{262144u, 0.003}})
        cut.settings.push_back({fmt::format("{} lights {:g} %", n, 100 * e), [=, lights = n, error = e](const rivals::Scene& s, Context& c) { return many_light_cut(s, {.lights = lights, .error = error}, c); }});
    out.push_back(cut);
    return out;
}

} // namespace

std::vector<std::string> method_names() {
    std::vector<std::string> names{"kiln", kFlatMethod};
    for (const Family& f : families(16)) names.push_back(f.name);
    return names;
}

void sweep(const LightScene& scene, const Truth& truth, const SweepOptions& options, Context& context, const std::function<void(const Measurement&)>& done) {
    const auto wanted = [&](const std::string& name) { return options.methods.empty() || std::ranges::find(options.methods, name) != options.methods.end(); };
    // What it would take, by how it grew from the one before last to the last.
    const auto too_long = [&](const std::vector<double>& took) {
        if (took.empty()) return false;
        const double growth = took.size() > 1 ? std::clamp(took.back() / std::max(took[took.size() - 2], 1e-3), 1.0, 16.0) : 1;
        return took.back() * growth > options.most_cpu_s;
    };
    for (const std::string name : {"kiln", kFlatMethod}) {
        const bool flat = name == kFlatMethod; // only when asked for: a chart has the four directions of all
        if (!wanted(name) || (flat && options.methods.empty())) continue;
        std::vector<double> took;
        for (const double target : options.targets) {
            if (too_long(took)) {
                Measurement m;
                m.scene = scene.name, m.method = name, m.setting = fmt::format("--error {:g}", target), m.skipped = fmt::format("would take over {:g} CPU s", options.most_cpu_s);
                done(m);
                continue;
            }
            const double start = cpu_seconds();
            for (std::uint64_t seed = 1; seed <= options.seeds; ++seed) done(measure_bake(scene, truth, target, context, seed, flat));
            took.push_back((cpu_seconds() - start) / options.seeds);
        }
    }
    if (!options.rivals) return;
    std::vector<std::uint32_t> lit; // the same for all
    for (const Family& family : families(luxel_size(scene.surfaces))) {
        if (!wanted(family.name)) continue;
        if (lit.empty()) lit = lit_luxels(scene, truth, options.most_lit, context);
        std::vector<double> took;
        for (const Setting& s : family.settings) {
            Measurement m;
            if (too_long(took)) {
                m.scene = scene.name, m.method = family.name, m.setting = s.text, m.skipped = fmt::format("would take over {:g} CPU s", options.most_cpu_s);
            } else {
                const double start = cpu_seconds();
                m = measure_rival(scene, truth, family.name, s.text, s.make, lit, context);
                took.push_back(cpu_seconds() - start);
            }
            done(m);
        }
    }
}

std::vector<FrontPoint> pareto(std::span<const FrontPoint> points) {
    std::vector<FrontPoint> front;
    for (const FrontPoint& p : points)
        if (std::ranges::none_of(points, [&](const FrontPoint& q) {
                return q.scene == p.scene && q.error <= p.error && q.cost <= p.cost && (q.error < p.error || q.cost < p.cost);
            }))
            front.push_back(p);
    return front;
}

std::string write_front(std::span<const FrontPoint> front) {
    std::string out = "scene,target_percent,error_percent,cost_million_rays\n";
    for (const FrontPoint& p : front) out += fmt::format("{},{:g},{:.4g},{:.4g}\n", p.scene, p.target, p.error, p.cost);
    return out;
}

Result<std::vector<FrontPoint>> read_front(std::string_view text, const std::string& file) {
    std::vector<FrontPoint> front;
    int number = 0;
    while (!text.empty()) {
        const std::size_t end = std::min(text.find('\n'), text.size());
        std::string_view line = text.substr(0, end);
        text.remove_prefix(std::min(end + 1, text.size()));
        ++number;
        if (line.ends_with('\r')) line.remove_suffix(1);
        if (number == 1 || line.empty()) continue; // the header
        FrontPoint p;
        std::size_t at = line.find(',');
        p.scene = line.substr(0, at);
        bool good = at != line.npos && !p.scene.empty();
        for (double* value : {&p.target, &p.error, &p.cost}) {
            if (!good) break;
            line.remove_prefix(at + 1);
            at = std::min(line.find(','), line.size());
            const auto [stop, error] = std::from_chars(line.data(), line.data() + at, *value);
            good = error == std::errc() && stop == line.data() + at && *value > 0 && (value == &p.cost) == (at == line.size());
        }
        if (!good) return fault(Exit::input, "front-row", "a row is a scene, a target, an error and a cost, all above 0", {.file = file, .line = number});
        front.push_back(p);
    }
    return front;
}

std::optional<double> cost_ratio(const FrontPoint& stored, std::span<const FrontPoint> now) {
    std::optional<double> best;
    for (const FrontPoint& p : now) {
        const double worse = std::max(1.0, p.error / stored.error);
        if (p.scene != stored.scene || worse > 2) continue;
        const double ratio = p.cost * worse * worse / stored.cost;
        if (!best || ratio < *best) best = ratio;
    }
    return best;
}

} // namespace kiln::bench

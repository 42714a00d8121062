// bench light: scenes x methods x settings as CSV, charts and a page; or a short run against the stored front.
#include "libs/core/file.h"
#include "tools/kiln/commands.h"
#include "tools/light_bench/light_chart.h"
#include "tools/light_bench/sweep.h"
#include <filesystem>
#include <fmt/format.h>

namespace kiln {
namespace {

using namespace bench;
namespace fs = std::filesystem;

struct LightBenchOptions {
    std::vector<std::string> scenes, methods;
    std::vector<double> targets;
    std::string root = ".", output = "build/bench_light", cache, front;
    TruthSettings truth;
    SweepOptions sweep;
    double most_cost = 1.1; // of what the stored front says
    std::size_t worst = 0;  // luxels to list
    int threads = 1;
    bool quick = false, update = false;
};

const std::vector<std::string> kScenes = {"furnace", "cornell", "two_rooms", "tube", "maze", "hall", "canyon", "e1m1", "lambda_bunker_v2"};
const std::vector<std::string> kShortScenes = {"cornell", "two_rooms", "canyon"};
// One measurement is uncertain by some 8 %, by what else runs on the machine. What is stored is the median of a few; what is
// compared is the cheapest of two, and where that is too dear, of up to eight.
constexpr int kStoredRepeats = 5, kRepeats = 2, kMoreRepeats = 6;
constexpr double kLeastError = 0.01; // percent: less is not told apart, and nothing costs so and so much at none

// A name of the list, or a map file.
std::string map_of(const std::string& scene, const std::string& root) {
    if (scene == "e1m1") return root + "/../shared/maps/id-quake-map-source/e1m1.map";
    if (scene == "lambda_bunker_v2") return root + "/../shared/maps/athwale-hammer/lambda_bunker_v2.vmf";
    if (std::ranges::find(kScenes, scene) != kScenes.end()) return fmt::format("{0}/maps/{1}/{1}.vmf", root, scene);
    return scene;
}

std::string row(const Measurement& m) {
    if (!m.skipped.empty()) return fmt::format("{:<17} {:<17} {:<20} {}", m.scene, m.method, m.setting, m.skipped);
    return fmt::format("{:<17} {:<17} {:<20} {:>9.3f} {:>8.4g} {:>8.2f} {:>9} {:>9.2f} {:>10} {:>8.0f}", m.scene, m.method, m.setting, m.cpu_s, m.errors.worst, m.errors.worst_noise,
                       m.estimate > 0 ? fmt::format("{:.2f}", m.estimate) : "", m.rays * 1e-6, m.traced > 0 ? fmt::format("{:.0f}", m.tracing()) : "", m.peak_mb);
}
const char* kHeader = "scene             method            setting                  CPU s  rRMSE %  noise %  estimate     Mrays  tracing %       MB";

// One target with several seeds; adds its counts to `all`.
std::string seeds_row(const Truth& truth, const std::vector<Measurement>& runs, Seeds* all) {
    const Seeds s = compare_seeds(truth, runs);
    all->runs += s.runs, all->within_estimate += s.within_estimate, all->within_high += s.within_high, all->likely_over += s.likely_over;
    all->over_estimate = std::max(all->over_estimate, s.over_estimate), all->over_high = std::max(all->over_high, s.over_high);
    return fmt::format("  {} seeds, {}, {}: error {:.2f} % ({:.2f} to {:.2f} by the luxels drawn), estimate {:.2f} to {:.2f} %; covered {} and {} times, under by {:.2f} and {:.2f}; between seeds {:.2f} % (own {:.2f}), common {:.2f} % (own {:.2f}), sums {:+.2f} %; {:.2f} Mrays, {:.2f} CPU s\n", s.runs,
                       runs[0].scene, runs[0].setting, s.error, s.least, s.most, s.estimate, s.high, s.within_estimate, s.within_high, s.over_estimate, s.over_high, s.noise, s.own_noise, s.common, s.own_bias, fmt::join(s.bias, " "), s.rays * 1e-6, s.cpu_s);
}

std::string worst_rows(const LightScene& scene, const Truth& truth, const std::vector<Measurement>& runs, std::size_t most) {
    std::string out;
    for (const WorstLuxel& w : worst_luxels(truth, runs, most)) {
        const Luxel& l = scene.surfaces.luxels[truth.luxels[w.at]];
        const Face& face = scene.surfaces.faces[l.face.at()];
        const Vec3 p = world_from_luxel(scene.surfaces, l.face, centroid_of(scene.surfaces, l));
        const SourceLocation where = face.side.valid() ? scene.world.location(face.side) : SourceLocation{};
        const std::string source = where.line > 0 ? fmt::format(", {}:{}", where.file, where.line) : "";
        out += fmt::format("    {:+.1f} % along {}, mean {:+.1f} % (truth {:.3g} +- {:.1f} %), {:.1f} % of the square, at {:.1f} {:.1f} {:.1f}, face {} ({:.2f} {:.2f} {:.2f}), chart {} luxel {} {} of area {:.2f}{}\n",
                           std::copysign(w.error, w.mean), kDirectionNames[w.direction], w.mean, mean(truth.value[w.at][w.direction]), w.noise, 100 * w.share, p.x, p.y, p.z, l.face.value, face.normal.x, face.normal.y, face.normal.z,
                           l.chart.value, l.x, l.y, l.area, source);
    }
    return out;
}

struct Loaded {
    Compiled compiled;
    std::vector<Light> lights;
};
int load(const std::string& map, const LightBenchOptions& o, Console& console, Context& context, Loaded& out) {
    BakeOptions options;
    options.map = map, options.quiet = true, options.threads = o.threads;
    options.compile.bsp.allow_leaks = true; // real maps leak; light is as defined there as elsewhere
    // Faces as they are: over smoothed edges light is made continuous for looks (seams), of which truth knows nothing. In the tube of
    // eight sides that is up to 200 % of what a facet gets along normals that its own plane hides.
    options.compile.surfaces.smoothing_angle_deg = 0;
    options.settle(console);
    const auto input = read_input(options, context);
    if (!input) return console.fail(input.fault());
    const auto done = compile(*input, options.compile, {.store = nullptr, .last = Stage::surfaces, .stage_done = {}}, context, out.compiled);
    (void)context.take_diagnostics(); // `kiln build` is for those
    if (!done) return console.fail(done.fault());
    out.lights = read_lights(out.compiled.world, context);
    (void)context.take_diagnostics();
    return 0;
}

// `median`: of the repeats; else the cheapest.
std::vector<FrontPoint> front_of(const LightScene& scene, const Truth& truth, const SweepOptions& sweep_options, int repeats, bool median, Context& context) {
    std::vector<FrontPoint> points;
    std::vector<std::vector<double>> costs;
    for (int k = 0; k < repeats; ++k)
        sweep(scene, truth, sweep_options, context, [&](const Measurement& m) {
            if (!m.skipped.empty()) return;
            const auto at = static_cast<std::size_t>(std::ranges::find(points, m.target, &FrontPoint::target) - points.begin());
            if (at == points.size()) points.push_back({m.scene, m.target, std::max(m.errors.worst, kLeastError), 0}), costs.emplace_back();
            costs[at].push_back(m.cost());
        });
    for (std::size_t i = 0; i < points.size(); ++i) {
        std::ranges::sort(costs[i]);
        points[i].cost = costs[i][median ? costs[i].size() / 2 : 0];
    }
    return points;
}

int compare_front(const LightBenchOptions& o, Console& console, Context& context) {
    std::vector<FrontPoint> stored, now;
    if (!o.update) {
        const auto bytes = read_file(o.front);
        if (!bytes) return console.fail(bytes.fault());
        const auto front = read_front({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, o.front);
        if (!front) return console.fail(front.fault());
        stored = *front;
    }
    bool dearer = false;
    std::string table = fmt::format("{:<17} {:>8} {:>9} {:>12} {:>12} {:>7}\n", "scene", "target %", "rRMSE %", "stored Mrays", "now Mrays", "ratio");
    for (const std::string& given : o.scenes) {
        const std::string map = map_of(given, o.root), name = fs::path(map).stem().string();
        Loaded loaded;
        if (const int code = load(map, o, console, context, loaded); code != 0) return code;
        const LightScene scene{name, loaded.compiled.world, loaded.compiled.bsp, loaded.compiled.surfaces, loaded.lights};
        const auto truth = find_truth(scene, o.truth, context);
        if (!truth) return console.fail(truth.fault());
        std::vector<FrontPoint> points = front_of(scene, *truth, o.sweep, o.update ? kStoredRepeats : kRepeats, o.update, context);
        const auto worst = [&] {
            double most = 0;
            for (const FrontPoint& p : stored)
                if (p.scene == name) most = std::max(most, cost_ratio(p, points).value_or(1e9));
            return most;
        };
        for (int k = 0; k < kMoreRepeats && worst() > o.most_cost; ++k)
            for (const FrontPoint& again : front_of(scene, *truth, o.sweep, 1, false, context)) {
                FrontPoint& p = *std::ranges::find(points, again.target, &FrontPoint::target);
                p.cost = std::min(p.cost, again.cost);
            }
        for (const FrontPoint& p : points) {
            const auto s = std::ranges::find_if(stored, [&](const FrontPoint& q) { return q.scene == p.scene && q.target == p.target; });
            const std::optional<double> ratio = s == stored.end() ? std::nullopt : cost_ratio(*s, points);
            table += fmt::format("{:<17} {:>8g} {:>9.2f} {:>12} {:>12.3f} {:>7}\n", p.scene, p.target, p.error, s == stored.end() ? "-" : fmt::format("{:.3f}", s->cost), p.cost,
                                 ratio ? fmt::format("{:.2f}", *ratio) : "-");
        }
        dearer |= worst() > o.most_cost;
        now.insert(now.end(), points.begin(), points.end());
    }
    if (const int code = print_output(table); code != 0) return code;
    if (o.update) {
        const auto written = write_file(o.front, write_front(pareto(now)));
        return written ? 0 : console.fail(written.fault());
    }
    if (dearer)
        return console.fail(fault(Exit::quality, "dearer-light", fmt::format("light costs over {:.0f} % of what the stored front says at equal error; where that is meant: --update-front", 100 * o.most_cost), {.file = o.front}));
    return 0;
}

int run(LightBenchOptions& o) {
    Console console;
    console.quiet = true;
    Context context = console.make_context(std::max(1, o.threads));
    if (o.cache.empty()) o.cache = o.output + "/truth";
    o.truth.cache = o.cache;
    if (o.front.empty()) o.front = o.root + "/tools/light_bench/front.csv";
    if (o.scenes.empty()) o.scenes = o.quick || o.update ? kShortScenes : kScenes;
    if (!o.targets.empty()) o.sweep.targets = o.targets;
    o.sweep.methods = o.methods;
    for (const std::string& method : o.methods)
        if (const auto names = method_names(); std::ranges::find(names, method) == names.end())
            return console.fail(fault(Exit::usage, "usage", fmt::format("no method is called {}; there are {}", method, fmt::join(names, " "))));
    if (o.truth.shown) {
        if (std::ranges::any_of(o.methods, [](const std::string& m) { return m != "kiln" && m != kFlatMethod; }))
            return console.fail(fault(Exit::usage, "usage", "--shown: other methods have no texels; leave --methods out, or give kiln or kiln-flat"));
        o.sweep.rivals = false;
    }
    if (o.quick || o.update) {
        if (o.truth.shown) return console.fail(fault(Exit::usage, "usage", "--shown: the stored front is one of luxels"));
        if (o.targets.empty()) o.sweep.targets = {20, 10, 5};
        o.sweep.rivals = false, o.sweep.methods.clear();
        o.truth.points = 100, o.truth.most_rounds = 1, o.truth.paths = 1024;
        return compare_front(o, console, context);
    }
    std::error_code failed;
    fs::create_directories(o.output, failed);
    if (failed) return console.fail(fault(Exit::io, "cannot-write", failed.message(), {.file = o.output}));
    std::vector<Measurement> all;
    std::vector<std::string> done;
    Seeds known; // over all scenes and targets
    if (const int code = print_output(std::string(kHeader) + "\n"); code != 0) return code;
    for (const std::string& given : o.scenes) {
        const std::string map = map_of(given, o.root), name = fs::path(map).stem().string();
        if (std::error_code ignored; !fs::exists(map, ignored) && given != map) {
            print_error(fmt::format("kiln: note: {} is left out: there is no {}\n", name, map));
            continue;
        }
        Loaded loaded;
        if (const int code = load(map, o, console, context, loaded); code != 0) return code;
        const LightScene scene{name, loaded.compiled.world, loaded.compiled.bsp, loaded.compiled.surfaces, loaded.lights};
        const auto truth = find_truth(scene, o.truth, context);
        if (!truth) return console.fail(truth.fault());
        if (truth->luxels.empty()) {
            print_error(fmt::format("kiln: note: {} is left out: no luxel of it shows light\n", name));
            continue;
        }
        std::vector<Measurement> seeds;
        sweep(scene, *truth, o.sweep, context, [&](const Measurement& m) {
            all.push_back(m);
            print_output(row(m) + "\n");
            if (m.method == "kiln" && m.skipped.empty()) seeds.push_back(m);
            if (seeds.size() == o.sweep.seeds) {
                if (seeds.size() > 1) print_output(seeds_row(*truth, seeds, &known));
                print_output(worst_rows(scene, *truth, seeds, o.worst));
                seeds.clear();
            }
            std::fflush(stdout);
        });
        done.push_back(name);
        // After every scene: a run that is broken off leaves what it has.
        const std::string remark = fmt::format("CPU seconds of the whole process, {} thread{}, for all luxels, flat and three directions. Error: root mean square of (value - truth) / max(truth, 2 % of the mean), worst of the four directions.", o.threads,
                                               o.threads == 1 ? "" : "s");
        for (const auto& [file, text] : {std::pair{std::string("light.csv"), light_csv(all)}, std::pair{"light_" + name + ".svg", light_svg(name, all)}, std::pair{std::string("light.html"), light_html(done, all, remark)}})
            if (auto written = write_file(o.output + "/" + file, text); !written) return console.fail(written.fault());
    }
    if (known.runs > 0)
        print_output(fmt::format("the estimate covers the true error in {} of {} bakes, its upper bound in {}, never under by more than {:.2f} and {:.2f} times; by the luxels drawn {} bounds are too low with 95 %\n", known.within_estimate, known.runs, known.within_high,
                                 std::max(1.0, known.over_estimate), std::max(1.0, known.over_high), known.likely_over));
    return print_output(fmt::format("charts of {} scenes: {}/light.html\n", done.size(), o.output));
}

} // namespace

Command bench_command(CLI::App& app) {
    app.require_subcommand(1);
    app.footer("examples:\n  kiln bench light cornell two_rooms -o build/bench_light\n  kiln bench stability F1 F8 -o build/bench_stability");
    CLI::App* light = app.add_subcommand("light", "Light: error against CPU time, the bake beside other methods");
    light->get_formatter()->column_width(34);
    auto o = std::make_shared<LightBenchOptions>();
    light->add_option("scenes", o->scenes, fmt::format("Scenes ({}) or map files; default: all, those whose map is not at hand left out", fmt::join(kScenes, ", ")));
    light->add_option("-o,--output", o->output, "Folder for light.csv, light_SCENE.svg and light.html (default build/bench_light)")->type_name("DIR");
    light->add_option("--root", o->root, "The folder that holds maps/ and tools/ (default .)")->type_name("DIR");
    light->add_option("--cache", o->cache, "Where truths are kept (default OUTPUT/truth)")->type_name("DIR");
    light->add_option("--targets", o->targets, "Error targets of the bake, percent (default 20,10,5,3,2,1,0.5; --short: 20,10,5)")->delimiter(',')->allow_extra_args(false)->check(CLI::Range(0.1, 100.0))->type_name("PERCENT,...");
    light->add_option("--seeds", o->sweep.seeds, "Bakes a target, each with other random numbers: how often the estimate covers the true error, and how much of it differs between them (default 1)")->check(CLI::Range(1, 1000))->type_name("N");
    light->add_option("--worst", o->worst, "List so many luxels that the bake errs most at, with place, face and chart, after each target")->type_name("N");
    light->add_option("--methods", o->methods, fmt::format("Only these: {} (default: all but kiln-flat, the bake of irradiance along the normal alone)", fmt::join(method_names(), ", ")))->delimiter(',')->allow_extra_args(false)->type_name("NAME,...");
    light->add_option("--points", o->truth.points, "Luxels where truth is known, drawn by area (default 300)")->check(CLI::Range(10, 100000))->type_name("N");
    light->add_flag("--shown", o->truth.shown, "The error of what a level shows at a place in each luxel (texels fitted, coarser grids, bilinear filtering), instead of that of luxels; of the bake alone");
    light->add_option("--truth-noise", o->truth.noise_percent, "Noise of the truth at which it is good enough, percent, worst direction (default 1)")->check(CLI::Range(0.01, 100.0))->type_name("PERCENT");
    light->add_option("--truth-rounds", o->truth.most_rounds, "At most so many rounds of 8 x 4096 paths a luxel for it (default 8)")->check(CLI::Range(1, 4096))->type_name("N");
    light->add_option("--max-cpu", o->sweep.most_cpu_s, "Settings that would take longer are left out, CPU seconds (default 60)")->check(CLI::Range(0.1, 1e6))->type_name("SECONDS");
    light->add_option("--lit", o->sweep.most_lit, "Luxels at which rivals answer; the part of their time that grows with luxels is scaled up to all (default 1500)")->check(CLI::Range(1u, 1u << 30))->type_name("N");
    light->add_option("--threads", o->threads, "Worker threads (default 1); values do not depend on it")->check(CLI::Range(1, 1024))->type_name("N");
    light->add_flag("--short", o->quick, "Only the bake on small scenes, against the stored front: exit 6 where a point costs more at equal error than --most-cost allows, counted in rays of the tracer measured in the same run on the same scene");
    light->add_option("--most-cost", o->most_cost, "Of --short: cost against the stored front at which it fails (default 1.1; a machine shared with other work is not that steady)")->check(CLI::Range(1.0, 100.0))->type_name("FACTOR");
    light->add_option("--front", o->front, "The stored front (default ROOT/tools/light_bench/front.csv)")->type_name("FILE");
    light->add_flag("--update-front", o->update, "Measure as --short does and store the front");
    light->footer("Error is the rRMSE of tools that compare irradiance: the root mean square over luxels and colour channels of\n"
                  "(value - truth) / max(truth, 2 % of the mean of truth), for the normal and the three basis vectors, the worst of the four.\n"
                  "tracing %: what the tracer would take by itself for all rays of the bake, those of its estimate too, of the time of the bake (one thread).\n"
                  "The noise of the path-traced truth is taken out in quadrature. What the other methods are: compiler/light/rivals/NOTES.md\n"
                  "examples:\n  kiln bench light --root . -o build/bench_light\n  kiln bench light two_rooms --methods kiln,hemicube\n  kiln bench light --short");
    const Command stability = bench_stability_command(app);
    return [o, light, stability]() -> int { return light->parsed() ? run(*o) : stability(); };
}

} // namespace kiln

// bench stability: the sweeps of tools/stability_bench as CSV, charts and a page.
#include "libs/core/file.h"
#include "libs/core/process.h"
#include "tools/kiln/commands.h"
#include "tools/stability_bench/stability.h"
#include <algorithm>
#include <filesystem>
#include <fmt/format.h>

namespace kiln {
namespace {

using namespace bench;

struct StabilityBenchOptions {
    std::vector<std::string> sweeps;
    std::string output = "build/bench_stability";
    SweepSettings settings;
    bool bake_only = false;
    int threads = 1;
};

std::vector<std::string> known_ids() {
    std::vector<std::string> ids;
    for (const SweepName& n : stability_sweeps()) ids.push_back(n.id);
    return ids;
}

int run(StabilityBenchOptions& o) {
    Console console;
    console.quiet = true;
    Context context = console.make_context(std::max(1, o.threads));
    o.settings.rivals = !o.bake_only;
    if (o.sweeps.empty()) o.sweeps = known_ids();
    for (const std::string& id : o.sweeps)
        if (const auto ids = known_ids(); std::ranges::find(ids, id) == ids.end())
            return console.fail(fault(Exit::usage, "usage", fmt::format("no sweep is called {}; there are {}", id, fmt::join(ids, " "))));
    std::error_code failed;
    std::filesystem::create_directories(o.output, failed);
    if (failed) return console.fail(fault(Exit::io, "cannot-write", failed.message(), {.file = o.output}));
    std::vector<SweepReport> done;
    for (const std::string& id : o.sweeps) {
        const double start = cpu_seconds();
        const auto report = run_sweep(id, o.settings, context);
        done.push_back(*report);
        std::string text = fmt::format("{}: {} ({:.1f} CPU s)\n", report->id, report->title, cpu_seconds() - start);
        for (const Panel& p : report->panels) {
            text += fmt::format("  {} [{} by {}]\n", p.title, p.y.label, p.x.label);
            for (const Series& s : p.series) {
                if (s.x.size() > 24) continue; // a curve to look at
                text += fmt::format("    {:<28}", s.name);
                for (std::size_t i = 0; i < s.x.size(); ++i) text += fmt::format(" {:.4g}:{:.3g}", s.x[i], s.y[i]);
                text += '\n';
            }
        }
        for (const std::string& note : report->notes) text += fmt::format("  {}\n", note);
        if (const int code = print_output(text); code != 0) return code;
        std::fflush(stdout);
        // After every sweep: a run that is broken off leaves what it has.
        for (const auto& [file, content] : {std::pair{fmt::format("stability_{}.csv", id), stability_csv(*report)}, std::pair{fmt::format("stability_{}.svg", id), stability_svg(*report)},
                                            std::pair{std::string("stability.html"), stability_html(done)}})
            if (const auto written = write_file(o.output + "/" + file, content); !written) return console.fail(written.fault());
    }
    return print_output(fmt::format("charts of {} sweeps: {}/stability.html\n", done.size(), o.output));
}

} // namespace

Command bench_stability_command(CLI::App& bench) {
    CLI::App* app = bench.add_subcommand("stability", "Sweeps of one parameter each until methods break, the bake beside the others");
    app->get_formatter()->column_width(34);
    auto o = std::make_shared<StabilityBenchOptions>();
    std::string list;
    for (const SweepName& n : stability_sweeps()) list += fmt::format("  {:<4} {}\n", n.id, n.title);
    app->add_option("sweeps", o->sweeps, fmt::format("Sweeps ({}); default: all", fmt::join(known_ids(), ", ")));
    app->add_option("-o,--output", o->output, "Folder for stability_ID.csv, stability_ID.svg and stability.html (default build/bench_stability)")->type_name("DIR");
    app->add_flag("--short", o->settings.quick, "A few points of each sweep");
    app->add_flag("--bake-only", o->bake_only, "Without the other methods");
    app->add_option("--threads", o->threads, "Worker threads (default 1); values do not depend on it")->check(CLI::Range(1, 1024))->type_name("N");
    app->footer("Scenes are made in code; where a closed form exists, errors are against it. What came out, and why each method breaks\n"
                "where it does: compiler/light/STABILITY.md\nsweeps:\n" +
                list + "examples:\n  kiln bench stability -o build/bench_stability\n  kiln bench stability F1 F8 --short");
    return [o, app]() -> int { return app->parsed() ? run(*o) : -1; };
}

} // namespace kiln

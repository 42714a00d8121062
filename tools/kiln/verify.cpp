// verify: every invariant of a map on its way to a level, or of a level file, each check with its count.
#include "compiler/verify/verify.h"
#include "libs/core/file.h"
#include "tools/kiln/commands.h"
#include "tools/kiln/level_file.h"
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace kiln {
namespace {

struct VerifyCommand {
    BakeOptions bake;
    VerifyOptions verify;
    std::string until = "surfaces";
    std::size_t most = 10;
    bool json = false;
};

// What was made, whether it belongs together or not; the stages in the order of the way.
void verify_map(const Compiled& c, const VerifyCommand& o, Checker& checker) {
    const auto made = [&](Stage stage) {
        return std::ranges::any_of(c.stages, [&](const StageReport& s) { return s.name == kStageNames[static_cast<std::size_t>(stage)]; });
    };
    verify_document(c.document, checker);
    if (c.world.entities.empty()) return; // a fault before
    verify_world(c.world, checker);
    if (checker.failures() || c.csg.brushes.empty()) return; // what follows reads the tables before
    verify_csg(c.world, c.csg, o.verify, checker);
    if (checker.failures() || c.bsp.leaves.empty()) return;
    verify_bsp(c.world, c.csg, c.bsp, !c.leak, o.verify, checker);
    if (made(Stage::surfaces) && !checker.failures()) verify_surfaces(c.world, c.csg, c.bsp, c.surfaces, o.verify, checker);
    if (made(Stage::visibility) && !checker.failures()) verify_visibility(c.world, c.bsp, c.visibility, o.verify, checker);
}

std::string table(const Checker& checker) {
    std::string text = fmt::format("{:<24} {:>10} {:>9}\n", "check", "checked", "failed");
    std::uint64_t checked = 0;
    for (const Check& c : checker.checks()) {
        text += fmt::format("{:<24} {:>10} {:>9}\n", c.code, c.checked, c.failed);
        checked += c.checked;
    }
    return text + fmt::format("{:<24} {:>10} {:>9}\n", "all", checked, checker.failures());
}

// `told`: before the findings of the checks.
nlohmann::ordered_json to_json(const VerifyCommand& o, const Checker& checker, const Compiled& c, std::span<const Diagnostic> told, int code) {
    nlohmann::ordered_json j = {{"file", o.bake.map}, {"exit", code}, {"failures", checker.failures()}, {"leak", c.leak.has_value()}};
    j["checks"] = nlohmann::json::array();
    for (const Check& check : checker.checks()) {
        nlohmann::ordered_json row = {{"code", check.code}, {"checked", check.checked}, {"failed", check.failed}, {"findings", nlohmann::json::array()}};
        for (const Finding& f : check.findings)
            row["findings"].push_back({{"file", f.where.file}, {"line", f.where.line}, {"entity", f.where.entity}, {"brush", f.where.brush}, {"side", f.where.side}, {"message", f.message}});
        j["checks"].push_back(std::move(row));
    }
    j["diagnostics"] = nlohmann::json::array();
    for (const Diagnostic& d : told) j["diagnostics"].push_back(to_json(d));
    if (c.stages.empty()) return j; // a level, or nothing could be read
    const auto degenerate = static_cast<std::size_t>(std::ranges::count_if(c.surfaces.triangles, [&](const auto& t) {
        const Vec3 a = c.surfaces.positions[t[0]], b = c.surfaces.positions[t[1]], d = c.surfaces.positions[t[2]];
        return length(cross(b - a, d - a)) == 0;
    }));
    const CsgReport& r = c.csg.report;
    j["counts"] = {{"entities", c.world.entities.size()}, {"brushes", c.world.brushes.size()}, {"sides", c.world.sides.size()}, {"invalid_brushes", r.invalid_brushes},
                   {"grid_bits", r.grid_bits}, {"off_grid_sides", r.rounded_sides}, {"moved_sides", r.merged_planes}, {"largest_move", std::max(r.largest_move, r.largest_rounding)},
                   {"nodes", c.bsp.nodes.size()}, {"leaves", c.bsp.leaves.size()}, {"clusters", c.bsp.cluster_count}, {"portals", c.portals.size()}, {"areas", c.bsp.area_count},
                   {"closed_gaps", c.bsp.closed.size()}, {"faces", c.surfaces.faces.size()}, {"triangles", c.surfaces.triangles.size()},
                   {"degenerate_triangles", degenerate}, {"charts", c.surfaces.charts.size()}, {"luxels", c.surfaces.luxels.size()}};
    j["stages"] = nlohmann::json::array();
    for (const StageReport& s : c.stages) j["stages"].push_back({{"name", s.name}, {"cpu_s", s.cpu_s}, {"peak_rss_mb", s.peak_rss_mb}});
    return j;
}

} // namespace

Command verify_command(CLI::App& app) {
    auto o = std::make_shared<VerifyCommand>();
    o->bake.add_to(app);
    app.get_option("map")->description("The map (.vmf, .vmm, .map), or a level file");
    app.add_option("--until", o->until, "Of a map: run and check the stages up to this (default surfaces)")->check(CLI::IsMember({"read", "world", "csg", "bsp", "surfaces", "visibility"}))->type_name("STAGE");
    app.add_option("--points", o->verify.points, "Random points for each check that draws some (default 20000)")->check(CLI::Range(std::size_t{0}, std::size_t{1} << 32))->type_name("N");
    app.add_option("--seed", o->verify.seed, "Of the random points (default 1)")->type_name("N");
    app.add_option("--most", o->most, "Findings shown of each check; all are counted (default 10)")->type_name("N");
    app.add_flag("--json", o->json, "The table, the findings and what was made as JSON on standard output");
    app.footer("examples:\n  kiln verify maps/atrium/atrium.vmf\n  kiln verify atrium.kiln\n  kiln verify e1m1.map --until visibility --points 1000000\n"
               "Exit codes: 0 all holds, 6 something does not; 4 the world leaks, though all else holds; else as for build.\n"
               "`kiln explain CODE` tells what a check is about.");
    return [o]() -> int {
        Console console;
        o->bake.settle(console);
        o->verify.micro_gap = o->bake.compile.bsp.micro_gap;
        Context context = console.make_context(o->bake.thread_count());
        Checker checker = Checker::collecting(o->most);
        Compiled c;
        int code = 0;
        std::size_t told = 0;
        const auto print = [&] {
            const std::string text = o->json ? to_json(*o, checker, c, std::span(console.told()).first(told), code).dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n" : table(checker);
            const int printed = print_output(text);
            return printed != 0 ? printed : code;
        };
        const auto bytes = read_file(o->bake.map);
        if (!bytes) {
            code = console.fail(bytes.fault()), told = console.told().size();
            return o->json ? print() : code;
        }
        if (is_level(*bytes)) {
            verify_level(*bytes, o->bake.map, o->verify, checker);
        } else {
            const Stage last = stage_named(o->until).value_or(Stage::surfaces);
            const bool leaks_allowed = std::exchange(o->bake.compile.bsp.allow_leaks, true); // what leaks is checked too
            code = compile_map(o->bake, console, context, last, c), told = console.told().size();
            if (code == static_cast<int>(Exit::input)) return o->json ? print() : code; // there is nothing to look at
            verify_map(c, *o, checker);
            if (code == 0 && c.leak && !leaks_allowed) code = static_cast<int>(Exit::geometry);
        }
        for (const Check& check : checker.checks()) {
            for (const Finding& f : check.findings) console.print({Severity::error, check.code, f.where, f.message});
            if (check.failed > check.findings.size()) console.say(fmt::format("... and {} more of {}", check.failed - check.findings.size(), check.code));
        }
        if (checker.failures()) code = static_cast<int>(Exit::quality);
        if (code == 0) code = console.verdict(context);
        return print();
    };
}

} // namespace kiln

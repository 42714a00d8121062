#include "formats/portal_file/portal_file.h"
#include "libs/core/file.h"
#include "tools/kiln/commands.h"
#include <filesystem>
#include <fmt/format.h>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <unistd.h>

namespace kiln {
namespace {

nlohmann::ordered_json to_json(Vec3 p) { return {p.x, p.y, p.z}; }
nlohmann::ordered_json to_json(const World& world, BrushId b) {
    const SourceLocation at = world.location(b);
    return {{"file", at.file}, {"line", at.line}, {"entity", at.entity}, {"brush", at.brush}};
}
nlohmann::ordered_json to_json(const World& world, const Leak& leak) {
    const WorldEntity& e = world.entities[leak.entity.at()];
    const SourceLocation at = world.location(leak.entity);
    nlohmann::ordered_json j = {{"classname", e.get("classname")}, {"file", at.file}, {"line", at.line}, {"entity", at.entity}, {"origin", to_json(e.origin)},
                                {"in_void", leak.area == 0}, {"hole", to_json(leak.hole)}, {"area", leak.area}, {"width", leak.width}, {"length", leak.length}};
    for (const char* list : {"passes", "near", "path"}) j[list] = nlohmann::json::array();
    for (const BrushId b : leak.passes) {
        j["passes"].push_back(to_json(world, b));
        j["passes"].back()["what"] = name_of_unsealing(world, b);
    }
    for (const BrushId b : leak.near) j["near"].push_back(to_json(world, b));
    for (const Vec3 p : leak.path) j["path"].push_back(to_json(p));
    return j;
}

std::string report_json(const Compiled& c, const Console& console) {
    nlohmann::ordered_json j;
    j["stages"] = nlohmann::json::array();
    for (const StageReport& s : c.stages)
        j["stages"].push_back({{"name", s.name}, {"wall_s", s.wall_s}, {"cpu_s", s.cpu_s}, {"peak_rss_mb", s.peak_rss_mb}, {"cached", s.cached}});
    j["counts"] = {{"brushes", c.world.brushes.size()}, {"planes", c.csg.planes.planes.size()}, {"nodes", c.bsp.nodes.size()},
                   {"leaves", c.bsp.leaves.size()}, {"clusters", c.bsp.cluster_count}, {"portals", c.portals.size()},
                   {"faces", c.surfaces.faces.size()}, {"luxels", c.surfaces.luxels.size()}, {"patches", c.lighting.patches.size()},
                   {"lights", c.lights.size()}, {"cubes", c.ambient.cubes.size()}, {"probes", c.probes.probes.size()},
                   {"rays", c.lighting.rays + c.ambient.rays},
                   {"texels_baked", c.surfaces.texel_count}, {"texels", c.density.grids.empty() ? c.surfaces.texel_count : c.density.flat.size()}};
    const ErrorReport& e = c.lighting.error;
    const auto done = [&](const char* stage) { return std::ranges::any_of(c.stages, [&](const StageReport& s) { return s.name == stage; }); };
    const auto shown = [&](double value) { return c.density.shown.places > 0 ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr); };
    if (!done("light")) j["error"] = nullptr; // not known, which is not 0
    else j["error"] = {{"target", e.target}, {"estimate", e.estimate}, {"low", e.low}, {"high", e.high}, {"noise", e.noise},
                  {"patch_bias", e.patch_bias}, {"iteration", e.iteration}, {"shortcuts", e.shortcuts}, {"solution", e.solution}, {"representation", e.representation},
                  {"shown", shown(c.density.shown.percent)}, {"shown_high", shown(c.density.shown.high)}, {"shown_p95", shown(c.density.shown.p95)}, {"ambient", c.ambient.error_estimate}};
    j["light"] = {{"iterations", c.lighting.iterations}, {"escaped_rays", c.lighting.escaped_rays}, {"back_face_rays", c.lighting.back_face_rays}};
    j["visibility"] = {{"steps", c.visibility.steps}, {"loose_portals", c.visibility.loose}, {"stopped", c.visibility_stopped}};
    j["leaks"] = nlohmann::json::array();
    for (const Leak& l : c.leaks) j["leaks"].push_back(to_json(c.world, l));
    j["level_bytes"] = c.level.size();
    j["diagnostics"] = nlohmann::json::array();
    for (const Diagnostic& d : console.told()) j["diagnostics"].push_back(to_json(d));
    return j.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

// What editors load (formats/portal_file/FORMAT.md), by what follows the stem of the level's name: of the first leak nothing,
// of further ones ".leak2" and so on, of area portals that part nothing ".areaportal1" and so on, numbered as in their warnings.
std::map<std::string, std::span<const Vec3>> trails_of(const Compiled& c) {
    std::map<std::string, std::span<const Vec3>> trails;
    for (std::size_t i = 0; i < c.leaks.size(); ++i) trails[i == 0 ? "" : fmt::format(".leak{}", i + 1)] = c.leaks[i].path;
    std::size_t portals = 0;
    for (const AreaPortal& p : c.bsp.area_portals)
        if (!p.leak.empty()) trails[fmt::format(".areaportal{}", ++portals)] = p.leak;
    return trails;
}

// Files beside the level that an earlier build left as trails of it. A map of its own called NAME.leak2 has its own.
std::vector<std::filesystem::path> old_trails(const std::filesystem::path& stem) {
    std::vector<std::filesystem::path> found;
    const std::regex ours(R"((\.(leak|areaportal)\d+)?\.(pts|lin))");
    const std::string name = stem.filename().string();
    std::error_code failed;
    std::filesystem::directory_iterator it(stem.has_parent_path() ? stem.parent_path() : ".", failed), end;
    for (; !failed && it != end; it.increment(failed)) {
        const std::filesystem::path file = it->path();
        const std::string other = file.filename().string();
        if (!other.starts_with(name) || !std::regex_match(other.substr(name.size()), ours)) continue;
        std::error_code ignored;
        const auto of_a_map = [&](const char* ending) { return file.stem() != stem.filename() && std::filesystem::exists(std::filesystem::path(file).replace_extension(ending), ignored); };
        if (it->is_regular_file(ignored) && !of_a_map(".vmf") && !of_a_map(".map")) found.push_back(file);
    }
    return found;
}

// What an earlier build left and does not hold any more.
Result<bool> remove_stale(const std::filesystem::path& file) {
    std::error_code ignored, failed;
    if (!std::filesystem::is_regular_file(file, ignored)) return true;
    std::filesystem::remove(file, failed);
    if (failed) return fault(Exit::io, "cannot-write", fmt::format("this is of an earlier build and cannot be removed: {}", failed.message()), {.file = file.string()});
    return true;
}

// The trails that hold now, an empty .pts of a sealed world, and none that do not hold any more.
Result<bool> write_trails(const std::string& stem, const Compiled& c) {
    std::map<std::filesystem::path, std::string> files;
    for (const auto& [name, path] : trails_of(c)) files[stem + name + ".pts"] = write_pts(path), files[stem + name + ".lin"] = write_lin(path);
    if (c.leaks.empty()) files[stem + ".pts"];
    Result<bool> done = true; // what fails first is told, the rest is done all the same
    const auto note = [&done](const Result<bool>& r) {
        if (done && !r) done = r.fault();
    };
    for (const auto& [file, text] : files) note(write_file(file.string(), text));
    for (const std::filesystem::path& file : old_trails(stem))
        if (std::ranges::none_of(files, [&](const auto& f) { return f.first.filename() == file.filename(); })) note(remove_stale(file));
    return done;
}

} // namespace

Command build_command(CLI::App& app) {
    struct Options {
        BakeOptions bake;
        std::string output, report, stop_after;
        double require_error = 0;
    };
    auto o = std::make_shared<Options>();
    o->bake.add_to(app);
    app.add_option("-o,--output", o->output, "The level file (default: the map's name with .kiln); beside it are written a portal file (.prt) and leak trails (.pts, .lin; .leak2.pts and so on for further leaks, .areaportal1.pts and so on for area portals that part nothing, as their warnings number them; an empty .pts where the world is sealed)")->type_name("FILE");
    app.add_option("--report", o->report, "Write stages, counts, error, leaks and diagnostics as JSON")->type_name("FILE");
    app.add_option("--stop-after", o->stop_after, "Stop after this stage; no level is written")
        ->check(CLI::IsMember(std::vector<std::string>(kStageNames.begin(), kStageNames.end())))->type_name("STAGE");
    app.add_flag_function("--leak-test", [o](std::int64_t) { o->stop_after = "bsp"; }, "Only tell whether the world is sealed (as --stop-after bsp): exit 4 where it leaks");
    app.add_flag_function("--strip", [o](std::int64_t) { o->bake.compile.strip = true; }, "Leave out provenance and error maps");
    app.add_option("--require-error", o->require_error, "Exit 6 where the error of the light may exceed this, percent: where it cannot be told with 95 % confidence that it does not; the level is written all the same")->check(CLI::Range(0.0, 1000.0))->type_name("PERCENT");
    app.footer("examples:\n  kiln build maps/atrium/atrium.vmf\n  kiln build e1m1.map -o e1m1.kiln --error 2 --cache ~/.cache/kiln\n"
               "  kiln build m.vmf --stop-after bsp --report m.json\n"
               "Words of vbsp, vvis, vrad, qbsp, vis and light (-fast, -final, -threads N, -game DIR ...) that have an equivalent become it; of others is said\n"
               "why they are ignored or refused: kiln explain words\n"
               "Exit codes: kiln explain");
    return [o]() -> int {
        Console console;
        o->bake.settle(console);
        Context context = console.make_context(o->bake.thread_count());
        const std::string output = o->output.empty() ? stem_of(o->bake.map) + ".kiln" : o->output;
        const std::string stem = stem_of(output);
        for (const std::string& written : {output, o->report})
            if (same_file(written, o->bake.map)) return console.fail(fault(Exit::usage, "usage", "the output is the map itself; give another with -o", {.file = written}));
        // Find out that nothing can be written before minutes are spent, not after.
        for (const std::string& written : {output, o->report}) {
            if (written.empty()) continue;
            const std::filesystem::path path = std::filesystem::absolute(written);
            std::error_code ignored;
            if (::access(path.parent_path().c_str(), W_OK) != 0 || std::filesystem::is_directory(path, ignored))
                return console.fail(fault(Exit::io, "cannot-write", "the folder is missing or not writable, or this is a folder", {.file = written}));
        }

        const Stage last = stage_named(o->stop_after).value_or(Stage::pack);
        Compiled c;
        int code = compile_map(o->bake, console, context, last, c);

        const auto write = [&](const Result<bool>& written) { // what failed before decides the code
            if (written) return;
            const int failed = console.fail(written.fault());
            if (code == 0) code = failed;
        };
        if (last >= Stage::bsp && (code == 0 || c.leak)) {
            write(write_trails(stem, c));
            if (!c.portals.empty() && code == 0) {
                PortalFile prt;
                prt.cluster_count = c.bsp.cluster_count;
                for (const VisPortal& p : c.portals) prt.portals.push_back({p.cluster_front, p.cluster_back, p.winding, false});
                write(write_file(stem + ".prt", write_portal_file(prt)));
            } else {
                write(remove_stale(stem + ".prt"));
            }
        }
        const Result<bool> reported = o->report.empty() ? Result<bool>(true) : write_file(o->report, report_json(c, console));
        if (code != 0) return code;
        if (last == Stage::pack) {
            if (const auto written = write_file(output, c.level); !written) return console.fail(written.fault());
            const ErrorReport& e = c.lighting.error;
            console.say(fmt::format("{}: {:.2f} MB, light error about {:.1f} %, at most {:.1f} % (asked for {:g} %), ambient {:.0f} %", output,
                                    static_cast<double>(c.level.size()) / 1e6, e.estimate, e.high, e.target, c.ambient.error_estimate));
            const ShownError& shown = c.density.shown; // the likeliest is 0 where noise hides what there is
            console.say(fmt::format("{} luxels shown by {} texels; with filtering off by {} {:.1f} %, on 95 % of the area by less than {:.1f} %", c.surfaces.texel_count,
                                    c.density.grids.empty() ? c.surfaces.texel_count : c.density.flat.size(), shown.percent > 0 ? "about" : "at most", shown.percent > 0 ? shown.percent : shown.high, shown.p95));
            if (o->require_error > 0 && e.high > o->require_error)
                return console.fail(fault(Exit::quality, "error-above-gate",
                                          fmt::format("the error of the light is at most {:.2f} % (about {:.2f} %), allowed are {:g} %", e.high, e.estimate, o->require_error),
                                          {.file = o->bake.map}));
        }
        if (!reported) return console.fail(reported.fault());
        return console.verdict(context);
    };
}

} // namespace kiln

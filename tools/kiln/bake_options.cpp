#include "tools/kiln/bake_options.h"
#include "libs/core/file.h"
#include "tools/kiln/map_files.h"
#include "tools/kiln/materials.h"
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fmt/format.h>
#include <thread>

namespace kiln {

void BakeOptions::add_to(CLI::App& command) {
    command.add_option("map", map, "The map: Valve .vmf, a manifest .vmm of several, or Quake-family .map")->required();
    auto* quality = command.add_option_group("Quality");
    quality->add_option_function<double>("--error", [this](double p) { compile.light.error_percent = p, error_given = true; },
                                         "Target error of the light, percent rRMSE (default 5)")
        ->check(CLI::Range(0.1, 100.0))->type_name("PERCENT");
    quality->add_option_function<double>("--error-floor", [this](double p) { compile.light.error_floor = p / 100; },
                                         "Light darker than this, percent of the mean of the map, is measured against that much (default 2): less for maps in which the dark counts. Of lightmaps, not of ambient cubes")
        ->check(CLI::Range(1e-4, 100.0))->type_name("PERCENT");
    quality->add_flag("--draft", draft, "The same as --error 20");
    quality->add_flag("--final", final, "The same as --error 1");
    quality->add_option("--directional", directional, "Directional lightmaps: needed (where a material has a normal map), all, none")
        ->check(CLI::IsMember({"needed", "all", "none"}));
    quality->add_option("--encoding", encoding, "What three directional values mean: dot, sq (Source's weights), tilted (irradiance along the basis)")
        ->check(CLI::IsMember({"dot", "sq", "tilted"}));
    quality->add_option("--luxel", compile.world.lightmap_scale, "Luxel size where the map says nothing, map units (default 16)")
        ->check(CLI::Range(0.5, 1024.0))->type_name("UNITS");
    quality->add_option("--luxel-error", luxel_error, "Most that coarser luxels may change of the light shown, percent; 0: luxels as they are baked, none coarser or fitted to what filtering shows (default: half of --error)")
        ->check(CLI::Range(0.0, 100.0))->type_name("PERCENT");
    quality->add_option("--max-texels", compile.surfaces.most_texels, "Lightmap texels beyond which the build stops with exit 5 (default 67 million)")
        ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{UINT32_MAX}))->type_name("N");
    quality->add_option("--ambient-error", ambient_error, "Target error of interpolated ambient cubes, percent (default: twice --error, at least 10)")
        ->check(CLI::Range(1.0, 200.0))->type_name("PERCENT");
    quality->add_option("--cubemap-size", compile.probes.default_size, "Edge of cubemap faces without a size of their own, texels (default 64)")
        ->check(CLI::Range(4, 1024))->type_name("TEXELS");
    quality->add_flag("--fast-vis", compile.visibility.fast, "Visibility by flooding alone: valid, looser, quicker");
    quality->add_option("--vis-budget", vis_budget, "Seconds after which visibility ends: portals not done keep a loose, valid set, and with --cache the next run goes on from there (default: none)")
        ->check(CLI::Range(0.001, 1e9))->type_name("SECONDS");
    quality->add_option("--vis-steps", compile.visibility.total_budget, "The same counted in steps of the portal flow: equal results every time (default: none)")
        ->check(CLI::Range(std::uint64_t{1}, UINT64_MAX))->type_name("N");
    quality->add_option("--vis-radius", compile.visibility.radius, "Nothing is seen farther away, map units; 0: no limit (default: the farz of env_fog_controller, where each has one)")
        ->check(CLI::Range(0.0, 1e9))->type_name("UNITS");
    quality->add_option("--vis-merge", compile.vis_merge, "Join neighbouring clusters, for smaller tables, as long as no leaf sees so much more leaves than it did; 0: where nothing more is seen (default: none are joined)")
        ->check(CLI::Range(0.0, 1000.0))->type_name("PERCENT");
    auto* geometry = command.add_option_group("Geometry");
    geometry->add_flag("--allow-leaks", compile.bsp.allow_leaks, "Go on where the world leaks (no outside is removed)");
    geometry->add_option("--micro-gap", compile.bsp.micro_gap, "Openings narrower than this do not leak, map units (default 0.2)")
        ->check(CLI::Range(0.0, 16.0))->type_name("UNITS");
    geometry->add_option("--smooth", compile.surfaces.smoothing_angle_deg, "Edges up to this angle are smooth where no smoothing groups are stated (default 45 in a VMF, else 0)")
        ->check(CLI::Range(0.0, 180.0))->type_name("DEGREES");
    geometry->add_option("--plane-merge", compile.csg.plane_merge_distance, "Planes that coincide this closely over both faces become one, map units (default 1/32)")
        ->check(CLI::Range(0.0, 1.0))->type_name("UNITS");
    geometry->add_option("--curve-flatness", compile.surfaces.curve_flatness, "Patches are divided until their triangles lie this close to the curve, map units (default 0.5)")
        ->check(CLI::Range(0.001, 1024.0))->type_name("UNITS");
    auto* input = command.add_option_group("Input");
    input->add_option("--materials", materials, "Material files (JSON), later ones win; NAME.materials.json beside the map is read by itself")->type_name("FILE");
    input->add_option("--textures", textures, "Folders of textures named like the materials: PNG (size and mean colour), VMT (with VTF: what Source says of a surface)")->type_name("DIR");
    input->add_option("--game-dir", game_dir, "A game folder: its textures/, materials/ (PNG, VMT with VTF), lights.rad and gfx/palette.lmp are read")->type_name("DIR");
    input->add_option("--wad", wads, "Texture archives (WAD2, WAD3), besides those that worldspawn's \"wad\" names: sizes and mean colours are read")->type_name("FILE");
    input->add_option("--instance-path", instance_paths, "Folders where instances and prefabs are looked for, after those of the map that names them")->type_name("DIR");
    input->add_flag("--cordon", compile.assemble.cordon, "Build only what lies in the active cordons of a VMF, walled in with sky");
    input->add_option("--lights", lights_rad, "lights.rad files: emission by material name")->type_name("FILE");
    auto* running = command.add_option_group("Running");
    running->add_option("--threads", threads, "Worker threads (default: all); the result does not depend on it")->check(CLI::Range(0, 1024))->type_name("N");
    running->add_option("--cache", cache, "Keep stage results here; an unchanged stage is not run again")->type_name("DIR");
    running->add_option("--log-format", log_format, "text, or json: one object a line on standard error")->check(CLI::IsMember({"text", "json"}));
    running->add_flag("-q,--quiet", quiet, "Only warnings and errors");
    running->add_flag("--werror", werror, "Exit 6 where there was any warning");
}

void BakeOptions::settle(Console& console) {
    if (!error_given && draft) compile.light.error_percent = 20;
    if (!error_given && final) compile.light.error_percent = 1;
    compile.ambient.error_percent = ambient_error > 0 ? ambient_error : std::max(10.0, 2 * compile.light.error_percent);
    compile.density.error_percent = luxel_error >= 0 ? luxel_error : compile.light.error_percent / 2;
    compile.density.error_floor = compile.light.error_floor;
    compile.light.encoding = encoding == "sq" ? RnmEncoding::sq : encoding == "tilted" ? RnmEncoding::tilted : RnmEncoding::dot;
    compile.light.directional = directional == "all" ? Directional::all : directional == "none" ? Directional::none : Directional::needed;
    console.format = log_format == "json" ? LogFormat::json : LogFormat::text;
    console.quiet = quiet;
    console.warnings_are_errors = werror;
}

int BakeOptions::thread_count() const {
    return threads > 0 ? threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

std::string stem_of(const std::string& path) {
    std::filesystem::path p(path);
    return p.replace_extension().string();
}

Result<CompileInput> read_input(const BakeOptions& options, Context& context) {
    CompileInput input;
    auto map = read_file(options.map);
    if (!map) return map.fault();
    input.map = {options.map, *std::move(map)};

    namespace fs = std::filesystem;
    std::vector<std::string> texture_folders = options.textures;
    std::vector<std::string> rads = options.lights_rad;
    const auto add_if_there = [](std::vector<std::string>& list, const std::string& path) {
        std::error_code ignored;
        if (fs::exists(path, ignored)) list.insert(list.begin(), path);
    };
    if (!options.game_dir.empty()) {
        std::error_code ignored;
        if (!fs::is_directory(options.game_dir, ignored))
            return fault(Exit::input, "cannot-read", "the game folder is not a folder", {.file = options.game_dir});
        add_if_there(texture_folders, options.game_dir + "/materials");
        add_if_there(texture_folders, options.game_dir + "/textures");
    }
    add_if_there(rads, stem_of(options.map) + ".rad");
    if (!options.game_dir.empty()) add_if_there(rads, options.game_dir + "/lights.rad");

    input.open = map_opener(options.map, options.instance_paths);
    Bytes texts = input.map.bytes; // of all files, for the textures they name
    const std::string_view map_text(reinterpret_cast<const char*>(texts.data()), texts.size());
    std::vector<std::string> wads = options.wads;
    if (!texture_folders.empty() || !wads.empty() || map_text.find("wad\"") != std::string_view::npos) {
        Context silent; // the build itself tells what is wrong with them
        const auto document = assemble(input.map, [&](const std::string& wanted, const std::string& from) {
            Result<TextFile> file = input.open(wanted, from);
            if (file) texts.insert(texts.end(), file->bytes.begin(), file->bytes.end());
            return file;
        }, {}, silent);
        if (document && document->format != MapFormat::vmf) {
            const std::vector<std::string> named = wads_of_map(*document, options.game_dir, context);
            wads.insert(wads.begin(), named.begin(), named.end());
        }
    }
    for (const std::string& wad : wads) { // loose files below know better
        auto found = materials_of_wad(wad, options.game_dir, texts, context);
        if (!found) return found.fault();
        input.materials.push_back(*std::move(found));
    }
    for (const std::string& folder : texture_folders) {
        auto found = materials_of_textures(folder, texts, context);
        if (!found) return found.fault();
        input.materials.push_back(*std::move(found));
    }
    std::vector<std::string> files = options.materials;
    add_if_there(files, stem_of(options.map) + ".materials.json");
    for (const std::string& file : files) {
        auto bytes = read_file(file);
        if (!bytes) return bytes.fault();
        input.materials.push_back({file, *std::move(bytes)});
        if (auto maps = opacity_maps_of(input.materials.back(), context)) input.materials.push_back(*std::move(maps));
    }
    for (const std::string& file : rads) {
        auto bytes = read_file(file);
        if (!bytes) return bytes.fault();
        input.lights_rad.push_back({file, *std::move(bytes)});
    }
    return input;
}

int compile_map(const BakeOptions& options, Console& console, Context& context, Stage last, Compiled& out) {
    const auto input = read_input(options, context);
    if (!input) return console.fail(input.fault());
    const ContentStore store(options.cache);
    CompileRun run{.store = &store, .last = last, .visibility_seconds = options.vis_budget, .stage_done = [&](const StageReport& s) {
                       console.print_new(context);
                       console.stage(s);
                   }};
    const auto done = compile(*input, options.compile, run, context, out);
    console.print_new(context);
    return done ? 0 : console.fail(done.fault());
}

} // namespace kiln

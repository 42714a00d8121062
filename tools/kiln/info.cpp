#include "formats/level/kiln_level.h"
#include "libs/core/file.h"
#include "tools/kiln/commands.h"
#include "tools/kiln/dump_rows.h"
#include "tools/kiln/level_file.h"
#include <filesystem>
#include <fmt/format.h>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

namespace kiln {
namespace {

// Instances and prefabs that something in the level comes from.
std::size_t included_files(const kiln_level* level, const kiln_info& i, std::size_t displacements, std::size_t patches) {
    std::set<std::string> files;
    const auto add = [&](std::size_t count, auto file_of) {
        const char* file = nullptr;
        for (std::uint32_t k = 0; k < count; ++k)
            if (file_of(level, k, &file) == KILN_OK && *file) files.insert(file);
    };
    add(i.faces, kiln_level_face_file), add(i.brushes, kiln_level_brush_file), add(i.entities, kiln_level_entity_file), add(i.lights, kiln_level_light_file);
    add(displacements, kiln_level_displacement_file), add(patches, kiln_level_patch_file);
    return files.size();
}

nlohmann::ordered_json describe(const kiln_level* level, std::size_t file_size) {
    nlohmann::ordered_json j;
    std::size_t meta_size = 0;
    const char* meta = kiln_level_meta_json(level, &meta_size);
    j["meta"] = meta ? nlohmann::ordered_json::parse(std::string_view(meta, meta_size), nullptr, false) : nlohmann::ordered_json();
    kiln_info i{};
    if (kiln_level_info(level, &i) == KILN_OK) {
        static constexpr const char* kEncodings[] = {"dot", "sq", "tilted"};
        j["encoding"] = kEncodings[i.rnm_encoding % 3];
        j["counts"] = {{"planes", i.planes}, {"nodes", i.nodes}, {"leaves", i.leaves}, {"clusters", i.clusters}, {"portals", i.portals},
                       {"brushes", i.brushes}, {"materials", i.materials}, {"models", i.models}, {"vertices", i.vertices},
                       {"triangles", i.triangles}, {"faces", i.faces}, {"charts", i.charts}, {"pages", i.pages}, {"texels", i.texels},
                       {"lights", i.lights}, {"cubes", i.cubes}, {"cube_cells", i.cube_cells}, {"probes", i.probes}, {"entities", i.entities},
                       {"degenerate_triangles", i.degenerate_triangles}};
        std::size_t leaves = 0, area_portals = 0, waters = 0, overlays = 0, displacements = 0, patches = 0, occluders = 0;
        const kiln_leaf* leaf = kiln_level_leaves(level, &leaves);
        std::uint32_t areas = 0;
        for (std::size_t k = 0; k < leaves; ++k) areas = std::max(areas, leaf[k].area);
        kiln_level_area_portals(level, &area_portals), kiln_level_waters(level, &waters), kiln_level_overlays(level, &overlays);
        kiln_level_displacements(level, &displacements), kiln_level_curved_patches(level, &patches), kiln_level_occluders(level, &occluders);
        j["counts"].update({{"areas", areas}, {"area_portals", area_portals}, {"waters", waters}, {"occluders", occluders}, {"overlays", overlays},
                            {"displacements", displacements}, {"curved_patches", patches}});
        if (!i.stripped) j["counts"]["included_files"] = included_files(level, i, displacements, patches); // a stripped one does not know
        j["stripped"] = i.stripped != 0;
    }
    j["bytes"] = file_size;
    j["lumps"] = nlohmann::json::array();
    for (std::size_t k = 0; k < kiln_level_lump_count(level); ++k) {
        kiln_lump lump{};
        if (kiln_level_lump(level, k, &lump) == KILN_OK)
            j["lumps"].push_back({{"name", lump.name}, {"index", lump.index}, {"version", lump.version}, {"stored", lump.stored_size}, {"raw", lump.raw_size}});
    }
    return j;
}

std::string as_text(const nlohmann::ordered_json& j) {
    std::string out;
    const auto& meta = j["meta"];
    const auto flat = [](const nlohmann::ordered_json& v) { return v.is_string() ? v.get<std::string>() : v.dump(); };
    if (meta.is_object())
        for (const auto& [key, value] : meta.items())
            if (!value.is_object()) out += fmt::format("{:<18} {}\n", key, flat(value));
    for (const char* part : {"error", "options"})
        if (meta.is_object() && meta.contains(part) && meta[part].is_object()) {
            out += fmt::format("{}\n", part);
            for (const auto& [key, value] : meta[part].items()) out += fmt::format("  {:<16} {}\n", key, flat(value));
        }
    out += fmt::format("encoding           {}\n", j.value("encoding", "?"));
    out += fmt::format("counts\n");
    if (j.contains("counts"))
        for (const auto& [key, value] : j["counts"].items()) out += fmt::format("  {:<20} {:>10}\n", key, value.get<std::uint64_t>());
    out += fmt::format("lumps                      stored        raw\n");
    for (const auto& l : j["lumps"])
        out += fmt::format("  {} {:<6} v{} {:>14} {:>10}\n", l["name"].get<std::string>(), l["index"].get<int>(), l["version"].get<int>(), l["stored"].get<std::uint64_t>(), l["raw"].get<std::uint64_t>());
    out += fmt::format("  file             {:>14}\n", j["bytes"].get<std::uint64_t>());
    return out;
}

// ---- of a map: counts up to exact brushes, without a word about the way ---------------------------------------

nlohmann::ordered_json describe_map(const Compiled& c, const Context& context) {
    static constexpr const char* kFormats[] = {"vmf", "quake standard", "quake valve220", "quake mixed"};
    nlohmann::ordered_json j = {{"format", kFormats[static_cast<int>(c.document.format) % 4]}, {"file", c.document.file}};
    std::map<std::string, std::size_t> classes, contents, models;
    std::size_t patches = 0, included = c.document.included.size(), skipped = 0;
    for (const DocEntity& e : c.document.entities) {
        ++classes[std::string(e.get("classname", "(none)"))];
        patches += e.patches.size(), skipped += e.skipped_primitives;
    }
    for (const WorldBrush& b : c.world.brushes) {
        ++contents[name(b.contents)];
        if (b.model.value) ++models[std::to_string(b.model.value)];
    }
    Box3 bounds;
    for (const BrushPolytope& b : c.csg.brushes)
        if (b.valid) bounds.add(b.bounds);
    const CsgReport& r = c.csg.report;
    const std::size_t sides = c.world.sides.size();
    j["counts"] = {{"entities", c.document.entities.size()}, {"brushes", c.world.brushes.size()}, {"sides", sides}, {"materials", c.world.materials.size()}, {"brush_models", models.size()},
                   {"displacements", c.document.displacements.size()}, {"patches", patches}, {"overlays", c.world.overlays.size()}, {"included_files", included},
                   {"cordons", c.document.cordons.size()}, {"primitives_not_read", skipped}};
    j["geometry"] = {{"invalid_brushes", r.invalid_brushes}, {"grid", std::ldexp(1.0, -r.grid_bits)}, {"off_grid_sides", r.rounded_sides},
                     {"off_grid_percent", sides ? std::round(1000.0 * r.rounded_sides / static_cast<double>(sides)) / 10 : 0.0}, {"largest_rounding", r.largest_rounding}, {"moved_sides", r.merged_planes},
                     {"largest_move", r.largest_move}, {"redundant_sides", r.redundant_sides}};
    if (!bounds.empty()) j["geometry"]["bounds"] = {{bounds.lo.x, bounds.lo.y, bounds.lo.z}, {bounds.hi.x, bounds.hi.y, bounds.hi.z}};
    j["brushes"] = contents;
    j["entities"] = classes;
    std::map<std::string, std::size_t> codes;
    for (const Diagnostic& d : context.diagnostics()) ++codes[std::string(to_text(d.severity)) + " " + d.code];
    j["diagnostics"] = codes;
    return j;
}
std::string map_text(const nlohmann::ordered_json& j) {
    std::string out = fmt::format("format               {}\n", j["format"].get<std::string>());
    for (const char* part : {"counts", "geometry", "brushes", "entities", "diagnostics"}) {
        if (j[part].empty()) continue;
        out += fmt::format("{}\n", part);
        for (const auto& [key, value] : j[part].items()) out += fmt::format("  {:<32} {:>10}\n", key, value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
    }
    return out;
}

int info_of_map(const std::string& path, bool json, bool cordon) {
    Console console;
    console.quiet = true;
    Context context = console.make_context(1);
    BakeOptions options;
    options.map = path;
    options.compile.assemble.cordon = cordon;
    const auto input = read_input(options, context);
    if (!input) return console.fail(input.fault());
    Compiled c;
    const auto done = compile(*input, options.compile, {.store = nullptr, .last = Stage::csg, .stage_done = {}}, context, c);
    if (!done && done.fault().exit == Exit::input) return console.fail(done.fault());
    const auto j = describe_map(c, context);
    if (const int code = print_output(json ? j.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n" : map_text(j)); code != 0) return code;
    return done ? 0 : console.fail(done.fault());
}

} // namespace

Command info_command(CLI::App& app) {
    struct Options { std::string level; bool json = false, check = false, cordon = false; };
    auto o = std::make_shared<Options>();
    app.add_option("level", o->level, "A level file, or a map (.vmf, .vmm, .map)")->required();
    app.add_flag("--json", o->json, "As JSON");
    app.add_flag("--cordon", o->cordon, "Of a VMF: count what lies in its active cordons, as build --cordon would");
    app.add_flag("--check", o->check, "Of a level: verify and decode every lump; exit 3 at the first that is damaged");
    app.footer("examples:\n  kiln info atrium.kiln\n  kiln info e1m1.map --json");
    return [o]() -> int {
        Console console;
        // What begins like a level is one, however damaged; what is named like a map is taken as one.
        const auto bytes = read_file(o->level);
        const std::string ending = lower_case(std::filesystem::path(o->level).extension().string());
        if (bytes && !is_level(*bytes) && (ending == ".vmf" || ending == ".vmm" || ending == ".map")) return info_of_map(o->level, o->json, o->cordon);
        const auto file = open_level(o->level);
        if (!file) return console.fail(file.fault());
        const auto& level = file->level;
        if (o->check) {
            const char* what = "";
            if (const kiln_status s = kiln_level_check(level.get(), &what); s != KILN_OK)
                return console.fail(fault(Exit::input, "level-damaged", fmt::format("{}: {}", kiln_status_text(s), what), {.file = o->level}));
        }
        const auto j = describe(level.get(), file->bytes.size());
        return print_output(o->json ? j.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n" : as_text(j));
    };
}

} // namespace kiln

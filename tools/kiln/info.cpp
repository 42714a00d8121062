#include "formats/level/kiln_level.h"
#include "libs/core/file.h"
#include "tools/kiln/commands.h"
#include "tools/kiln/level_file.h"
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace kiln {
namespace {

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

} // namespace

Command info_command(CLI::App& app) {
    struct Options { std::string level; bool json = false, check = false; };
    auto o = std::make_shared<Options>();
    app.add_option("level", o->level, "The level file")->required();
    app.add_flag("--json", o->json, "As JSON");
    app.add_flag("--check", o->check, "Verify and decode every lump; exit 3 at the first that is damaged");
    app.footer("example: kiln info atrium.kiln");
    return [o]() -> int {
        Console console;
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

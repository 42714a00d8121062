// export: OBJ of any stage, glTF of the render mesh; of a map or of a level.
#include "tools/kiln/export.h"
#include "libs/core/file.h"
#include "libs/image/image.h"
#include "tools/kiln/commands.h"
#include "tools/kiln/level_file.h"
#include "tools/render/render.h"
#include <filesystem>
#include <fmt/format.h>

namespace kiln {
namespace {

struct ExportOptions {
    BakeOptions bake;
    std::string output, stage = "faces";
    double scale = 1.0 / 40;
};

std::string file_name(const std::string& path) { return std::filesystem::path(path).filename().string(); }

Result<bool> write_obj_files(const ExportOptions& o, const ObjExport& made) {
    const std::string library = stem_of(o.output) + ".mtl";
    if (auto r = write_file(library, write_mtl(made.materials)); !r) return r;
    return write_file(o.output, write_obj(made.polygons, file_name(library), fmt::format("{} of {}; map units, +z up", o.stage, file_name(o.bake.map))));
}
Result<bool> write_gltf_files(const ExportOptions& o, const GltfScene& scene) {
    if (o.output.ends_with(".glb")) return write_file(o.output, write_glb(scene));
    const std::string bin = stem_of(o.output) + ".bin";
    const GltfFiles files = write_gltf(scene, file_name(bin));
    if (!files.bin.empty())
        if (auto r = write_file(bin, files.bin); !r) return r;
    return write_file(o.output, files.json);
}

Result<bool> export_level(const ExportOptions& o, const ObjStage& stage, bool obj) {
    const auto file = open_level(o.bake.map);
    if (!file) return file.fault();
    const kiln_level* level = file->level.get();
    const char* what = "";
    if (const kiln_status s = kiln_level_check(level, &what); s != KILN_OK)
        return fault(Exit::input, "level-damaged", fmt::format("{}: {}", kiln_status_text(s), what), {.file = o.bake.map});
    if (obj) {
        if (!stage.of_level) return fault(Exit::usage, "usage", fmt::format("a level has no {}; of a map they can be exported", o.stage), {.file = o.bake.map});
        return write_obj_files(o, stage.of_level(level));
    }
    GltfOptions options{.metres_per_unit = o.scale, .name = file_name(stem_of(o.bake.map)), .lightmaps = {}};
    kiln_info info{};
    kiln_level_info(level, &info);
    for (std::uint32_t p = 0; p < info.pages; ++p) {
        const std::string page = fmt::format("{}.lightmap{}.exr", stem_of(o.output), p);
        options.lightmaps.push_back(file_name(page));
        const auto image = render_atlas_page(level, p, -1);
        if (!image) return image.fault();
        if (auto r = write_exr(page, *image); !r) return r;
    }
    return write_gltf_files(o, gltf_of_level(level, options));
}

} // namespace

Command export_command(CLI::App& app) {
    auto o = std::make_shared<ExportOptions>();
    o->bake.add_to(app);
    app.get_option("map")->description("The map (.vmf, .vmm, .map), or a level file");
    app.add_option("-o,--output", o->output, "FILE.obj (and .mtl), FILE.gltf (and .bin) or FILE.glb; lightmaps of a level as FILE.lightmapN.exr beside a glTF")->required()->type_name("FILE");
    std::vector<std::string> names;
    for (const ObjStage& s : obj_stages()) names.emplace_back(s.name);
    app.add_option("--stage", o->stage, "What an OBJ shows (default faces)")->check(CLI::IsMember(names));
    app.add_option("--scale", o->scale, "Of glTF: metres a map unit (default 0.025)")->check(CLI::Range(1e-6, 1e6))->type_name("METRES");
    app.footer("examples:\n  kiln export maps/atrium/atrium.vmf -o atrium.glb\n  kiln export atrium.kiln -o atrium.gltf\n  kiln export e1m1.map --stage portals -o portals.obj\n"
               "What stands where: formats/gltf/FORMAT.md, formats/mesh/FORMAT.md.");
    return [o]() -> int {
        Console console;
        o->bake.settle(console);
        const std::string ending = lower_case(std::filesystem::path(o->output).extension().string());
        const bool obj = ending == ".obj";
        if (!obj && ending != ".gltf" && ending != ".glb") return console.fail(fault(Exit::usage, "usage", "the output ends in .obj, .gltf or .glb", {.file = o->output}));
        if (same_file(o->output, o->bake.map)) return console.fail(fault(Exit::usage, "usage", "the output is the input itself", {.file = o->output}));
        const ObjStage* stage = &*std::ranges::find(obj_stages(), o->stage, [](const ObjStage& s) { return std::string(s.name); });
        Context context = console.make_context(o->bake.thread_count());
        const auto bytes = read_file(o->bake.map);
        if (!bytes) return console.fail(bytes.fault());
        if (is_level(*bytes)) {
            const auto written = export_level(*o, *stage, obj);
            return written ? 0 : console.fail(written.fault());
        }
        Compiled c;
        if (const int code = compile_map(o->bake, console, context, obj ? stage->needs : Stage::surfaces, c); code != 0) return code;
        const auto written = obj ? write_obj_files(*o, stage->of_map(c, o->bake.compile.surfaces))
                                 : write_gltf_files(*o, gltf_of_map(c, read_lights(c.world, context), {.metres_per_unit = o->scale, .name = file_name(stem_of(o->bake.map)), .lightmaps = {}}));
        if (!written) return console.fail(written.fault());
        return console.verdict(context);
    };
}

} // namespace kiln

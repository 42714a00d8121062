#include "tests/proof/geometry/pipeline.h"
#include "formats/quake_map/quake_map.h"
#include "formats/vmf/vmf.h"
#include "libs/core/file.h"
#include <algorithm>
#include <cctype>
#include <filesystem>

namespace kiln::proof {
namespace {

const std::filesystem::path kShared = std::filesystem::path(KILN_SOURCE_DIR) / "../shared/maps";

bool looks_like_vmf(std::string_view text) {
    for (const char c : text)
        if (!std::isspace(static_cast<unsigned char>(c))) return std::isalpha(static_cast<unsigned char>(c)) != 0;
    return false;
}

Result<World> read_world(std::string_view text, const std::string& name, std::string& stage, Context& context) {
    const std::span<const std::uint8_t> bytes(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    Result<Document> document = looks_like_vmf(text) ? read_vmf(bytes, name, context) : read_quake_map(bytes, name, context);
    if (!document) return document.fault();
    stage = "read";
    MaterialDatabase materials;
    return build_world(*document, materials, {}, context);
}

void continue_run(Geometry& r, const RunOptions& options, Context& context) {
    r.stage = "world";
    auto csg = build_csg(r.world, options.csg, context);
    if (!csg) return void(r.fault = csg.fault());
    r.csg = std::move(*csg), r.stage = "csg";
    validate(r.csg, r.world);
    if (options.last == "csg") return;
    auto bsp = build_bsp(r.world, r.csg, options.bsp, context);
    if (!bsp) return void(r.fault = bsp.fault());
    r.bsp = std::move(*bsp);
    validate(r.bsp, r.csg);
    if (options.bsp.fill) {
        auto leaks = find_leaks(r.world, r.csg, r.bsp, options.bsp, context);
        if (!leaks) return void(r.fault = leaks.fault());
        r.leak = std::move(leaks->leak);
        if (r.leak) {
            BspOptions open = options.bsp;
            open.fill = false;
            r.bsp = *build_bsp(r.world, r.csg, open, context);
            validate(r.bsp, r.csg);
        }
    }
    r.stage = "bsp";
    if (options.last == "bsp") return;
    auto surfaces = build_surfaces(r.world, r.csg, r.bsp, {}, context);
    if (!surfaces) return void(r.fault = surfaces.fault());
    r.surfaces = std::move(*surfaces);
    validate(r.surfaces);
    r.stage = "surfaces";
}

} // namespace

std::size_t Geometry::count(std::string_view code) const {
    return static_cast<std::size_t>(std::ranges::count_if(diagnostics, [&](const Diagnostic& d) { return d.code == code; }));
}
const Diagnostic* Geometry::first(std::string_view code) const {
    const auto at = std::ranges::find_if(diagnostics, [&](const Diagnostic& d) { return d.code == code; });
    return at == diagnostics.end() ? nullptr : &*at;
}

Geometry run(World world, const RunOptions& options) {
    Geometry r;
    Context context;
    context.threads = options.threads;
    r.world = std::move(world);
    continue_run(r, options, context);
    r.diagnostics = context.take_diagnostics();
    return r;
}

Geometry run_text(std::string_view text, const std::string& name, const RunOptions& options) {
    Geometry r;
    Context context;
    context.threads = options.threads;
    if (Result<World> world = read_world(text, name, r.stage, context); !world) {
        r.fault = world.fault();
    } else {
        r.world = std::move(*world);
        continue_run(r, options, context);
    }
    r.diagnostics = context.take_diagnostics();
    return r;
}

std::optional<World> load_world(const std::string& path, Context& context) {
    const auto bytes = read_file(path);
    if (!bytes) return std::nullopt;
    std::string stage;
    Result<World> world =
        read_world({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, path, stage, context);
    if (!world) return std::nullopt;
    return std::move(*world);
}

std::optional<std::string> shared_map(const std::string& name) {
    const std::filesystem::path path = kShared / name;
    if (!std::filesystem::exists(path)) return std::nullopt;
    return path.string();
}

std::vector<std::string> shared_maps() {
    std::vector<std::string> maps;
    if (!std::filesystem::exists(kShared)) return maps;
    for (const auto& e : std::filesystem::recursive_directory_iterator(kShared))
        if (e.path().extension() == ".map" || e.path().extension() == ".vmf") maps.push_back(e.path().string());
    std::ranges::sort(maps);
    return maps;
}

} // namespace kiln::proof

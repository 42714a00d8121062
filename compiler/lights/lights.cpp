#include "compiler/lights/lights.h"
#include "compiler/lights/keys.h"
#include "formats/document/document.h"
#include <algorithm>
#include <fmt/format.h>

namespace kiln {
namespace {

// Does a .map light speak Half-Life ("r g b brightness")? Only there `_light` has four numbers and `light` is
// absent.
bool is_half_life(const WorldEntity& e) {
    return !find_key(e.keys, "light") && parse_numbers(e.get("_light")).size() == 4;
}

} // namespace

std::vector<Light> read_lights(const World& world, Context& context) {
    LightReader reader{world, context};
    const bool source = world.format == MapFormat::vmf;
    // Quake 3 and Quake 2 share the row layout; the tool textures of the first lie in "common/".
    const bool quake3 = !source && std::ranges::any_of(world.materials, [](const Material& m) {
        return equal_ignoring_case(std::string_view(m.name).substr(0, 7), "common/");
    });
    bool has_environment = false;
    if (!source && !world.entities.empty()) read_quake_worldspawn(reader);
    for (std::size_t i = 1; i < world.entities.size(); ++i) {
        const WorldEntity& e = world.entities[i];
        const std::string name = lower_case(e.get("classname"));
        if (!name.starts_with("light") || name.starts_with("lightning") || e.model.valid()) continue;
        if (name == "light_surface") {
            reader.count(reader.templates, reader.templates_first, e);
            continue;
        }
        if (source || name == "light_environment" || is_half_life(e))
            read_source_light(reader, e, id<EntityId>(i), has_environment);
        else
            read_quake_light(reader, e, id<EntityId>(i), quake3);
    }

    const auto tell = [&](std::uint32_t n, const SourceLocation& first, Severity severity, const char* code,
                          const char* text) {
        if (n > 0) context.report(severity, code, fmt::format(fmt::runtime(text), n), first);
    };
    tell(reader.dark, reader.dark_first, Severity::warning, "light-starts-dark",
         "{} switchable lights start dark; they are not baked");
    tell(reader.animated, reader.animated_first, Severity::note, "light-style-steady",
         "{} lights have an animated style; they are baked at their steady level");
    tell(reader.local_min, reader.local_min_first, Severity::warning, "not-handled-local-minimum",
         "{} lights state a local minimum (delay 4), which is no light; they are left out");
    tell(reader.templates, reader.templates_first, Severity::warning, "not-handled-surface-light",
         "{} lights are templates for surfaces; give the material `emission` instead");
    tell(reader.negative, reader.negative_first, Severity::warning, "light-negative",
         "{} lights are negative; they are left out");
    if (!reader.ignored_keys.empty()) {
        std::string list;
        for (const auto& [what, n] : reader.ignored_keys)
            list += fmt::format("{}{} ({})", list.empty() ? "" : ", ", what, n);
        context.report(Severity::warning, "not-handled-light-key", fmt::format("not handled yet: {}", list),
                       {world.file});
    }
    return std::move(reader.lights);
}

} // namespace kiln

#include "compiler/world/panes.h"
#include <algorithm>

namespace kiln {
namespace {

// As the games have it: `alpha` and `_alpha` of Quake and its heirs, `rendermode` with `renderamt` of Half-Life and Source.
double entity_opacity(const WorldEntity& e, MapFormat format) {
    switch (static_cast<int>(e.number("rendermode", 0))) {
    case 1: case 2: return std::clamp(e.number("renderamt", 255) / 255, 0.0, 1.0);
    case 5: case 10: return 0; // adds its light to what is behind; is not drawn
    default: break;
    }
    if (format == MapFormat::vmf) return 1;
    const double alpha = e.number("alpha", 0); // 0: the key is not set
    if (alpha > 0) return std::min(alpha, 1.0);
    return e.get("_alpha").empty() ? 1 : std::clamp(e.number("_alpha", 1), 0.0, 1.0);
}
bool thin(const Material& m) { return (m.flags & (kTranslucent | kAlphaTested)) || m.alpha < 1; }
// Of glass of which nothing but that is known, all light passes.
bool stated(const Material& m) { return m.alpha_stated || m.alpha < 1 || !m.opacity_map.empty(); }

} // namespace

bool never_drawn(const Material& m) {
    return m.flags & (kSky | kNoDraw | kSkip | kHint | kClip | kTrigger | kOrigin | kAreaPortal | kLightBlocker | kInvisible);
}

std::optional<double> pane_opacity(const World& world, const Material& m, EntityId entity, bool model, bool wall) {
    const WorldEntity* e = entity.valid() ? &world.entities[entity.at()] : nullptr;
    const double of_entity = e && !wall && entity.value != 0 ? entity_opacity(*e, world.format) : 1;
    if (!(thin(m) && stated(m)) && of_entity >= 1) return {};
    if (e && !casts_shadow(*e, model)) return {};
    return of_entity;
}

std::optional<double> pane_opacity(const World& world, const Material& m, const WorldBrush& brush) {
    const bool model = brush.model.value != 0;
    return pane_opacity(world, m, brush.entity, model, !model && opaque(brush.contents));
}

std::optional<double> pane_opacity(const World& world, const Material& m, const WorldPatch& patch) {
    return pane_opacity(world, m, patch.entity, patch.model.value != 0, false);
}

bool opaque_pane(const Material& m, double opacity) {
    return m.alpha * opacity >= 1 && std::ranges::all_of(m.opacity_map.opacity, [](std::uint8_t texel) { return texel == 255; });
}

} // namespace kiln

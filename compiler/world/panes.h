// What is drawn thin: glass, grates, what an entity fades. Light asks what comes through (light/transmission.h), surfaces whether nothing does.
#pragma once
#include "compiler/world/world.h"
#include <optional>

namespace kiln {

// Sides of such materials are not drawn, whatever their brush is.
bool never_drawn(const Material& material);

// Does what an entity (of a document or of a world) is made of cast shadows? Of a brush entity, `model`, only by key.
template <class Entity> bool casts_shadow(const Entity& e, bool model) {
    const double asked = e.number("_shadow", 0);
    return model ? asked == 1 || e.number("vrad_brush_cast_shadows", 0) == 1 : asked != -1;
}

// A side's or patch's material is a pane if it is translucent or alpha-tested and says how much it hides, or if its entity fades it, and it casts shadows.
// The opacity that its entity gives it, 0..1; none: not a pane. `model`: of a brush entity; `wall`: of what hides the world behind it, which no entity fades.
std::optional<double> pane_opacity(const World& world, const Material& material, EntityId entity, bool model, bool wall);
// The same of the sides of a brush, and of a patch.
std::optional<double> pane_opacity(const World& world, const Material& material, const WorldBrush& brush);
std::optional<double> pane_opacity(const World& world, const Material& material, const WorldPatch& patch);

// No light comes through a pane of this material, nowhere on it.
bool opaque_pane(const Material& material, double opacity);

} // namespace kiln

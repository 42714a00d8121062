// What the class of an entity means for its brushes. Private to the folder.
#pragma once
#include "compiler/world/world.h"
#include <span>

namespace kiln {

enum class BrushUse : std::uint8_t {
    model,        // a brush model of its own
    hidden_model, // a brush model no face of which is drawn (triggers, volumes)
    structural,   // joins the world as it is
    detail,       // joins the world; solid becomes detail
    fence,        // joins the world; drawn from all sides, hides nothing
    illusion,     // the same, and players pass
    area_portal,  // joins the world as area portal
    occluder,     // joins the world as occluder
    vis_cluster,  // joins the world as visibility cluster
    ladder,       // joins the world; never seals; its entity gets the bounds as keys, as in Source
    water,        // a brush model that is liquid whatever it is painted with
};
BrushUse brush_use(const DocEntity& entity, bool is_world, MapFormat format);
// Brushes of a model that players pass although they are drawn.
bool passable_model(const DocEntity& entity);
// The liquid of a func_water.
Contents liquid_of(const DocEntity& entity);

// Things that are not compiled yet (or not at all): the diagnostic for all of one class together.
struct NotHandled {
    std::string_view classname;
    Severity severity;
    std::string_view code, message; // "{}" stands for the count
};
std::span<const NotHandled> not_handled_classes();

} // namespace kiln

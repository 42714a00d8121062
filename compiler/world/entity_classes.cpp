#include "compiler/world/entity_classes.h"
#include <algorithm>
#include <span>

namespace kiln {
namespace {

// Volumes for the game only. Source paints them with tool textures; others do not always.
constexpr std::string_view kHiddenVolumes[] = {
    "env_bubbles",
    "fog_volume",
    "func_bomb_target",
    "func_buyzone",
    "func_capturezone",
    "func_clip_vphysics",
    "func_combine_ball_spawner",
    "func_dustcloud",
    "func_dustmotes",
    "func_escapezone",
    "func_friction",
    "func_hostage_rescue",
    "func_ladder",
    "func_monsterclip",
    "func_mortar_field",
    "func_nav_avoid",
    "func_nav_blocker",
    "func_nav_prefer",
    "func_nobuild",
    "func_nogrenades",
    "func_occluder",
    "func_precipitation",
    "func_proprrespawnzone",
    "func_regenerate",
    "func_respawnroom",
    "func_smokevolume",
    "func_tankcontrols",
    "func_useableladder",
    "func_vehicleclip",
    "func_viscluster",
    "func_weight_button",
    "info_ladder",
    "light_surface",
};

constexpr NotHandled kNotHandled[] = {
    {"prop_static", Severity::warning, "not-handled-prop-static",
     "{} prop_static entities neither show nor cast shadows yet"},
    {"misc_model", Severity::warning, "not-handled-prop-static",
     "{} misc_model entities neither show nor cast shadows yet"},
    {"prop_detail", Severity::warning, "not-handled-prop-detail", "{} prop_detail entities are not compiled yet"},
    {"prop_detail_sprite", Severity::warning, "not-handled-prop-detail",
     "{} prop_detail_sprite entities are not compiled yet"},
    {"sky_camera", Severity::warning, "not-handled-sky-camera",
     "{} sky_camera: the 3D skybox is compiled like the rest of the map, and does not shade it"},
    {"func_viscluster", Severity::note, "not-handled-viscluster",
     "{} func_viscluster: their volumes have no effect on visibility yet"},
    {"func_occluder", Severity::note, "not-handled-occluder", "{} func_occluder stay entities without polygons"},
    {"func_ladder", Severity::note, "ladder-merged", "{} func_ladder: their brushes are kept for collision alone"},
    {"water_lod_control", Severity::note, "not-handled-water-lod",
     "{} water_lod_control stay entities without effect here"},
};

} // namespace

std::span<const NotHandled> not_handled_classes() {
    return kNotHandled;
}

BrushUse brush_use(const DocEntity& entity, bool is_world, MapFormat format) {
    if (is_world) return BrushUse::structural;
    const std::string name = lower_case(entity.get("classname"));
    if (name == "func_detail" || name == "func_detail_wall") return BrushUse::detail;
    if (name == "func_detail_fence") return BrushUse::fence;
    if (name == "func_detail_illusionary") return BrushUse::illusion;
    if (name == "func_group") return entity.number("_detail", 0) != 0 ? BrushUse::detail : BrushUse::structural;
    if (name == "func_areaportal" || name == "func_areaportalwindow") return BrushUse::area_portal;
    if (name == "func_viscluster" || name == "func_occluder") return BrushUse::dropped;
    // Source moves ladders into the world; their brushes carry a tool texture.
    if (name == "func_ladder" && format == MapFormat::vmf) return BrushUse::structural;
    if (name.starts_with("trigger_")) return BrushUse::hidden_model;
    if (std::ranges::find(kHiddenVolumes, name) != std::end(kHiddenVolumes)) return BrushUse::hidden_model;
    return entity.number("_detail", 0) != 0 ? BrushUse::detail : BrushUse::model;
}

bool passable_model(const DocEntity& entity) {
    const std::string_view name = entity.get("classname");
    if (equal_ignoring_case(name, "func_illusionary") || equal_ignoring_case(name, "func_illusionary_visblocker"))
        return true;
    return equal_ignoring_case(name, "func_brush") && entity.number("Solidity", 0) == 1; // 1: never solid
}

} // namespace kiln

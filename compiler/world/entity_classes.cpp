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
    "func_precipitation",
    "func_proprrespawnzone",
    "func_regenerate",
    "func_respawnroom",
    "func_smokevolume",
    "func_tankcontrols",
    "func_useableladder",
    "func_vehicleclip",
    "func_weight_button",
    "info_ladder",
    "light_surface",
};

constexpr NotHandled kNotHandled[] = {
    {"func_instance", Severity::warning, "not-handled-instance",
     "{} func_instance entities are left out: instances are not read yet"},
    {"misc_external_map", Severity::warning, "not-handled-instance",
     "{} misc_external_map entities are left out: other maps are not read yet"},
    {"prop_static", Severity::warning, "not-handled-prop-static",
     "{} prop_static entities neither show nor cast shadows yet"},
    {"misc_model", Severity::warning, "not-handled-prop-static",
     "{} misc_model entities neither show nor cast shadows yet"},
    {"prop_detail", Severity::warning, "not-handled-prop-detail", "{} prop_detail entities are not compiled yet"},
    {"prop_detail_sprite", Severity::warning, "not-handled-prop-detail",
     "{} prop_detail_sprite entities are not compiled yet"},
    {"info_overlay", Severity::warning, "not-handled-overlay", "{} overlays are not compiled yet"},
    {"infodecal", Severity::warning, "not-handled-decal", "{} decals are not compiled yet"},
    {"_decal", Severity::warning, "not-handled-decal", "{} decals are not compiled yet"},
    {"sky_camera", Severity::warning, "not-handled-sky-camera",
     "{} sky_camera: the 3D skybox does not shade the map"},
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
    if (name == "func_viscluster") return BrushUse::vis_cluster;
    if (name == "func_occluder") return BrushUse::occluder;
    // Source moves ladders into the world; their brushes mostly carry a tool texture.
    if ((name == "func_ladder" || name == "func_simpleladder") && format == MapFormat::vmf) return BrushUse::ladder;
    if (name == "func_water" || name == "func_water_analog") return BrushUse::water;
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

Contents liquid_of(const DocEntity& entity) {
    const double skin = entity.number("skin", -3); // Half-Life: -3 water, -4 slime, -5 lava
    return skin == -5 ? Contents::lava : skin == -4 ? Contents::slime : Contents::water;
}

} // namespace kiln

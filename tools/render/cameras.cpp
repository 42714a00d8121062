#include "tools/render/parts.h"
#include "tools/render/render.h"
#include <cstdlib>
#include <cstring>
#include <numbers>

namespace kiln {
namespace {

bool numbers_of(const char* text, double* out, int count) {
    for (int i = 0; i < count && text; ++i) {
        char* end = nullptr;
        out[i] = std::strtod(text, &end);
        if (end == text || !std::isfinite(out[i])) return false;
        text = end;
    }
    return text != nullptr;
}

// The roomiest open leaf.
Vec3 largest_room(const kiln_level* level) {
    Vec3 best{};
    double best_size = -1;
    for (const kiln_leaf& leaf : part(level, kiln_level_leaves)) {
        if (leaf.cluster < 0) continue;
        double size = 1;
        for (int a = 0; a < 3; ++a) size *= static_cast<double>(leaf.hi[a]) - static_cast<double>(leaf.lo[a]);
        if (size > best_size && size < 1e30) {
            best_size = size;
            best = {(leaf.lo[0] + leaf.hi[0]) / 2.0, (leaf.lo[1] + leaf.hi[1]) / 2.0, (leaf.lo[2] + leaf.hi[2]) / 2.0};
        }
    }
    return best;
}

} // namespace

Camera default_camera(const kiln_level* level) {
    struct Kind { const char* name; double eye_height; }; // above the entity's origin, map units
    constexpr Kind kinds[] = {{"point_viewcontrol", 0},      {"point_camera", 0},
                              {"info_player_start", 64},     {"info_player_deathmatch", 64},
                              {"info_player_counterterrorist", 64}, {"info_player_teamspawn", 64},
                              {"info_player_coop", 64}};
    kiln_info info{};
    kiln_level_info(level, &info);
    for (const Kind& kind : kinds)
        for (std::uint32_t e = 0; e < info.entities; ++e) {
            const char* name = kiln_level_entity_value(level, e, "classname");
            if (!name || std::strcmp(name, kind.name) != 0) continue;
            double at[3], angles[3] = {};
            if (!numbers_of(kiln_level_entity_value(level, e, "origin"), at, 3)) continue;
            Camera camera;
            camera.eye = {at[0], at[1], at[2] + kind.eye_height};
            // Players of Quake maps stand 24 above the floor: the eye must not end up in a ceiling.
            double eye[3] = {at[0], at[1], camera.eye.z};
            const auto leaves = part(level, kiln_level_leaves);
            const std::uint32_t leaf = kiln_level_find_leaf(level, eye);
            if (leaf < leaves.size() && leaves[leaf].cluster < 0) camera.eye.z = at[2] + kind.eye_height / 3;
            if (numbers_of(kiln_level_entity_value(level, e, "angles"), angles, 3)) {
                camera.pitch_deg = angles[0], camera.yaw_deg = angles[1];
            } else if (numbers_of(kiln_level_entity_value(level, e, "angle"), angles, 1)) {
                camera.yaw_deg = angles[0];
            }
            double fov = 0;
            if (numbers_of(kiln_level_entity_value(level, e, "fov"), &fov, 1) && fov > 1 && fov < 170) camera.fov_deg = fov;
            return camera;
        }
    Camera camera;
    camera.eye = largest_room(level);
    return camera;
}

Camera camera_looking_at(Vec3 eye, Vec3 target, double fov_deg) {
    const Vec3 d = normalize(target - eye);
    Camera camera;
    camera.eye = eye, camera.fov_deg = fov_deg;
    camera.yaw_deg = std::atan2(d.y, d.x) * 180 / std::numbers::pi;
    camera.pitch_deg = -std::asin(std::clamp(d.z, -1.0, 1.0)) * 180 / std::numbers::pi;
    return camera;
}

double default_plan_height(const kiln_level* level) { return default_camera(level).eye.z; }

} // namespace kiln

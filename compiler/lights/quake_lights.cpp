#include "compiler/lights/keys.h"
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace kiln {
namespace {

constexpr double kDefaultLight = 300; // of a light without the key
constexpr double kUnit = 128;         // distance at which the inverse falloffs give the light's own value

double cos_deg(double degrees) {
    return std::cos(degrees * std::numbers::pi / 180);
}

double first_number(LightReader& r, const WorldEntity& e, std::initializer_list<const char*> keys,
                    double otherwise) {
    for (const char* key : keys)
        if (find_key(e.keys, key)) return r.number(e, key, otherwise);
    return otherwise;
}

struct Brightness {
    double value;
    Rgbd color{1, 1, 1};
};
// `light` or `_light`: "value", or "r g b" of which the largest is the value; colour by `_color` or `color`.
Brightness brightness(LightReader& r, const WorldEntity& e) {
    Brightness b{kDefaultLight};
    for (const char* key : {"light", "_light"}) {
        const DocKey* found = find_key(e.keys, key);
        if (!found || found->value.empty()) continue;
        bool complete = false;
        const std::vector<double> n = parse_numbers(found->value, &complete);
        if (complete && n.size() == 1) {
            b.value = n[0];
        } else if (complete && n.size() == 3) {
            b.value = std::max({n[0], n[1], n[2]});
            if (b.value > 0)
                for (std::size_t i = 0; i < 3; ++i) b.color[i] = std::max(n[i], 0.0) / b.value;
        } else {
            r.context.report(
                Severity::warning, "light-key-invalid",
                fmt::format("the key {} is neither one number nor three; {} is used", key, kDefaultLight),
                r.where(e, key));
        }
        break;
    }
    for (const char* key : {"_color", "color"})
        if (const std::optional<Rgbd> hue = r.hue(e, key)) {
            b.color = *hue;
            break;
        }
    return b;
}

// yaw pitch roll; pitch up is positive.
Vec3 mangle_direction(LightReader& r, const WorldEntity& e, const char* key, Vec3 otherwise) {
    const Vec3 m = r.vector(e, key, otherwise);
    return direction_of(m.x, m.y);
}

bool aim(LightReader& r, const WorldEntity& e, Light& light) {
    const std::string_view name = e.get("target");
    if (const WorldEntity* target = r.named(name); target && target->has_origin) {
        const Vec3 to = target->origin - e.origin;
        if (length(to) > 0) {
            light.direction = normalize(to);
            return true;
        }
    }
    for (const char* key : {"mangle", "_mangle"})
        if (find_key(e.keys, key)) {
            light.direction = mangle_direction(r, e, key, {0, -90, 0});
            return true;
        }
    return false;
}

// Keys of other compilers that would change the picture and have no effect here.
constexpr std::string_view kIgnored[] = {"_deviance",           "_bouncescale",     "_dirt",
                                         "_falloff_curve",      "_project_texture", "_shadow_channel_mask",
                                         "_light_channel_mask", "_nostaticlight"};

} // namespace

void read_quake_light(LightReader& r, const WorldEntity& e, EntityId id, bool quake3) {
    if (!e.get("_surface").empty()) {
        r.count(r.templates, r.templates_first, e);
        return;
    }
    const Brightness b = brightness(r, e);
    const Rgbd color = b.color * (b.value / 255);
    for (const std::string_view key : kIgnored)
        if (find_key(e.keys, key)) ++r.ignored_keys["key " + std::string(key)];

    Light light;
    light.entity = id;
    light.position = e.origin;
    if (e.number("_sun", 0) != 0) {
        light.kind = LightKind::sun;
        light.falloff = Falloff::none;
        if (!aim(r, e, light)) light.direction = {0, 0, -1};
        light.angular_radius_rad =
            std::clamp(first_number(r, e, {"_penumbra", "_sunlight_penumbra"}, 0), 0.0, 90.0) / 2 *
            std::numbers::pi / 180;
        r.keep(light, e, color);
        return;
    }
    if (!e.has_origin) {
        r.context.report(Severity::warning, "light-without-origin", "a light has no origin; it is left out",
                         r.where(e));
        return;
    }

    double factor = 1;
    const double wait = r.number(e, "wait", 1);
    const double per_unit = (wait > 0 ? wait : 1) / kUnit;
    if (quake3) { // inverse square with a brightness of 7500 at one unit, linear by spawnflag
        if (std::fmod(std::max(0.0, e.number("spawnflags", 0)), 2) >= 1) {
            constexpr double kLinearShare = 7500.0 / 8000;
            const double fade = r.number(e, "fade", 1);
            light.falloff = Falloff::quake_linear;
            light.range = b.value * kLinearShare / (fade > 0 ? fade : 1);
            factor = kLinearShare;
        } else {
            light.constant = light.linear = 0, light.quadratic = 1;
            factor = 7500;
        }
    } else {
        const double delay = first_number(r, e, {"delay", "_falloff"}, 0);
        light.constant = light.linear = light.quadratic = 0;
        if (delay == 1) {
            light.linear = per_unit;
        } else if (delay == 2) {
            light.quadratic = per_unit * per_unit;
        } else if (delay == 3) {
            light.falloff = Falloff::none;
        } else if (delay == 4) {
            r.count(r.local_min, r.local_min_first, e);
            return;
        } else if (delay == 5) {
            light.constant = 1, light.linear = 2 * per_unit, light.quadratic = per_unit * per_unit;
        } else {
            if (delay != 0)
                r.context.report(Severity::warning, "light-key-invalid",
                                 fmt::format("there is no falloff {}; 0 (linear) is used", delay),
                                 r.where(e, "delay"));
            light.falloff = Falloff::quake_linear;
            light.range = std::abs(b.value) / (wait > 0 ? wait : 1);
        }
    }
    light.angle_scale =
        std::clamp(first_number(r, e, {"_anglescale", "_anglesense"},
                                first_number(r, r.world.entities[0], {"_anglescale", "_anglesense"}, 1)),
                   0.0, 1.0);

    if (aim(r, e, light)) {
        light.kind = LightKind::spot;
        light.cone_cosine = false;
        light.exponent = 1;
        // `angle`: the whole angle of the cone; `_cone` (Quake 2): half of it. `_softangle`: where it begins to
        // fade.
        constexpr double kDefaultAngle = 40;
        const double cone = find_key(e.keys, "_cone") ? 2 * r.number(e, "_cone", kDefaultAngle / 2)
                                                      : r.number(e, "angle", kDefaultAngle);
        const double outer = std::clamp(cone > 0 ? cone : kDefaultAngle, 1.0, 360.0);
        const double soft = std::clamp(r.number(e, "_softangle", 0), 0.0, outer);
        light.cos_outer = cos_deg(outer / 2);
        light.cos_inner = soft > 0 ? cos_deg(soft / 2) : light.cos_outer;
        if (quake3) { // the cone that is `radius` wide where the target stands
            const WorldEntity* target = r.named(e.get("target"));
            const double radius = r.number(e, "radius", 64);
            if (target && target->has_origin && radius > 0)
                light.cos_outer = light.cos_inner = std::cos(std::atan(radius / length(target->origin - e.origin)));
        }
    }
    r.keep(light, e, color * factor);
}

void read_quake_worldspawn(LightReader& r) {
    const WorldEntity& e = r.world.entities[0];
    // Names of several compilers for the same thing.
    const double sun = first_number(r, e, {"_sunlight", "_sun_light"}, 0);
    if (sun != 0) {
        Light light;
        light.kind = LightKind::sun;
        light.falloff = Falloff::none;
        light.entity = id<EntityId>(0);
        light.direction = {0, 0, -1};
        for (const char* key : {"_sunlight_mangle", "_sun_mangle", "_sun_angle"})
            if (find_key(e.keys, key)) {
                light.direction = mangle_direction(r, e, key, {0, -90, 0});
                break;
            }
        light.angular_radius_rad =
            std::clamp(r.number(e, "_sunlight_penumbra", 0), 0.0, 90.0) / 2 * std::numbers::pi / 180;
        Rgbd color{1, 1, 1};
        for (const char* key : {"_sunlight_color", "_sun_color"})
            if (const std::optional<Rgbd> hue = r.hue(e, key)) {
                color = *hue;
                break;
            }
        r.keep(light, e, color * (sun / 255));
    }
    const double upper = r.number(e, "_sunlight2", 0), lower = r.number(e, "_sunlight3", 0);
    if (upper != 0) {
        Light sky;
        sky.kind = LightKind::sky;
        sky.falloff = Falloff::none;
        sky.entity = id<EntityId>(0);
        const Rgbd color = r.hue(e, "_sunlight2_color").value_or(Rgbd{1, 1, 1});
        r.keep(sky, e, color * (upper / 255 / std::numbers::pi));
    }
    if (lower != 0) ++r.ignored_keys["key _sunlight3"];
    for (const char* key : {"_minlight", "_sun_ambient", "_sun_diffuse"})
        if (find_key(e.keys, key)) ++r.ignored_keys["key " + std::string(key)];
}

} // namespace kiln

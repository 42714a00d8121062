#include "compiler/lights/falloff.h"
#include "compiler/lights/keys.h"
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace kiln {
namespace {

double cos_deg(double degrees) {
    return std::cos(degrees * std::numbers::pi / 180);
}

// The `HDR` key where it is set (all three not negative), scaled by its own factor; else the plain one.
std::optional<Rgbd> hdr_or(LightReader& r, const WorldEntity& e, const char* key, const char* hdr,
                           const char* scale) {
    const Vec3 probe = [&] { // "-1 -1 -1 1" and the like mean: not set
        const std::vector<double> n = parse_numbers(e.get(hdr));
        return n.size() >= 3 ? Vec3{n[0], n[1], n[2]} : Vec3{-1, -1, -1};
    }();
    if (probe.x >= 0 && probe.y >= 0 && probe.z >= 0)
        if (const std::optional<Rgbd> c = r.source_color(e, hdr)) return *c * r.number(e, scale, 1);
    return r.source_color(e, key);
}

// `pitch` wins over the first of `angles`, `angle` over the second, unless they are zero. Unlike all other angles
// of the engine the pitch of lights is negated: up is positive.
Vec3 light_direction(LightReader& r, const WorldEntity& e) {
    const Vec3 angles = r.vector(e, "angles", {});
    double yaw = r.number(e, "angle", 0), pitch = r.number(e, "pitch", 0);
    if (pitch == 0) pitch = angles.x;
    if (yaw == -1 || yaw == -2) return {0, 0, yaw == -1 ? 1.0 : -1.0};
    if (yaw == 0) yaw = angles.y;
    return direction_of(yaw, pitch);
}

// Sets the falloff; returns what the intensity is multiplied by.
double set_falloff(LightReader& r, const WorldEntity& e, Light& light) {
    const double half = r.number(e, "_fifty_percent_distance", 0);
    if (half > 0) {
        double zero = r.number(e, "_zero_percent_distance", 0);
        if (zero <= half) {
            // Zero means "not set" to mappers; a positive one that is too near is a mistake.
            if (zero > 0)
                r.context.report(
                    Severity::warning, "light-distances",
                    fmt::format(
                        "_zero_percent_distance {} does not lie beyond _fifty_percent_distance {}; {} is used",
                        zero, half, 2 * half),
                    r.where(e, "_zero_percent_distance"));
            zero = 2 * half;
        }
        const Quadratic f = falloff_by_distances(half, zero);
        light.constant = f.constant, light.linear = f.linear, light.quadratic = f.quadratic;
        if (r.number(e, "_hardfalloff", 0) != 0)
            light.fade_start = 0.75 * zero + 0.25 * half, light.fade_end = zero;
        return 1;
    }
    constexpr double kNothing = 0.001; // coefficients below count as zero
    const auto coefficient = [&](const char* key) {
        const double v = r.number(e, key, 0);
        return v < kNothing ? 0 : v;
    };
    light.constant = coefficient("_constant_attn");
    light.linear = coefficient("_linear_attn");
    light.quadratic = coefficient("_quadratic_attn");
    if (light.constant == 0 && light.linear == 0 && light.quadratic == 0) light.constant = 1;
    // The key's brightness is that at 100 units.
    return light.constant + 100 * light.linear + 100 * 100 * light.quadratic;
}

void read_environment(LightReader& r, const WorldEntity& e, EntityId id, bool with_sky) {
    const std::optional<Rgbd> sun = hdr_or(r, e, "_light", "_lightHDR", "_lightscaleHDR");
    Light light;
    light.kind = LightKind::sun;
    light.falloff = Falloff::none;
    light.entity = id;
    light.direction = light_direction(r, e);
    light.angular_radius_rad = std::clamp(r.number(e, "SunSpreadAngle", 0), 0.0, 90.0) * std::numbers::pi / 180;
    r.keep(light, e, sun.value_or(Rgbd{}));
    if (!with_sky) return;
    // Without the key half the sun, as in the original. It is the irradiance under an open sky: pi times its
    // radiance.
    std::optional<Rgbd> ambient = hdr_or(r, e, "_ambient", "_ambientHDR", "_AmbientScaleHDR");
    if (!ambient && r.world.format != MapFormat::vmf) ambient = r.source_color(e, "_diffuse_light"); // Half-Life
    if (!ambient) ambient = sun.value_or(Rgbd{}) * 0.5;
    Light sky;
    sky.kind = LightKind::sky;
    sky.falloff = Falloff::none;
    sky.entity = id;
    r.keep(sky, e, *ambient / std::numbers::pi);
}

} // namespace

void read_source_light(LightReader& r, const WorldEntity& e, EntityId id, bool& has_environment) {
    const std::string_view name = e.get("classname");
    const bool environment = equal_ignoring_case(name, "light_environment");
    if (environment || equal_ignoring_case(name, "light_directional")) {
        if (environment && has_environment)
            r.context.report(Severity::warning, "second-environment",
                             "only the first light_environment lights the map", r.where(e));
        else
            read_environment(r, e, id, environment);
        has_environment = has_environment || environment;
        return;
    }
    const bool spot = equal_ignoring_case(name, "light_spot") || equal_ignoring_case(name, "light_glspot");
    if (!spot && !equal_ignoring_case(name, "light")) {
        ++r.ignored_keys["class " + std::string(name)];
        return;
    }
    if (!e.has_origin) {
        r.context.report(Severity::warning, "light-without-origin", "a light has no origin; it is left out",
                         r.where(e));
        return;
    }
    constexpr Rgbd kDefault{200.0 / 255, 200.0 / 255, 200.0 / 255}; // "255 255 255 200", the editor's
    const Rgbd color = hdr_or(r, e, "_light", "_lightHDR", "_lightscaleHDR").value_or(kDefault);
    Light light;
    light.entity = id;
    light.position = e.origin;
    double factor = 1;
    if (r.world.format == MapFormat::vmf) {
        factor = set_falloff(r, e, light);
    } else { // Half-Life: inverse square, as bright at 100 units as here; `_fade` makes it fall faster
        const double fade = r.number(e, "_fade", 1);
        light.quadratic = fade > 0 ? fade : 1;
        factor = 100 * 100;
    }
    if (spot) {
        // Half-Life calls the inner angle `_cone` and the outer `_cone2`; Source `_inner_cone` and `_cone`.
        const bool half_life = find_key(e.keys, "_cone2") != nullptr;
        double inner = r.number(e, half_life ? "_cone" : "_inner_cone", 0);
        double outer = r.number(e, half_life ? "_cone2" : "_cone", 0);
        if (inner <= 0) inner = 10;
        outer = std::max(outer, inner);
        if (!(inner == 180 && outer == 180)) { // 180 180: a point light after all
            light.kind = LightKind::spot;
            light.cos_inner = cos_deg(std::min(inner, 90.0));
            light.cos_outer = cos_deg(std::min(outer, 90.0));
            light.exponent = r.number(e, "_exponent", 1);
            const WorldEntity* target = r.named(e.get("target"));
            if (target && target->has_origin && length(target->origin - e.origin) > 0)
                light.direction = normalize(target->origin - e.origin);
            else
                light.direction = light_direction(r, e);
        }
    }
    r.keep(light, e, color * factor);
}

} // namespace kiln

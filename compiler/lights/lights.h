// Light entities, read once into physical terms. Every formula stands in NOTES.md.
// An intensity of 1 is what 255 in a key means: an irradiance of 1 (a light's E below is in the unit of
// radiance * steradian, the same as `emission` of a material times pi for a full hemisphere of it).
// `_light`-like colours are gamma 2.2 in, linear out.
//
// In       world
// Out      lights in entity order, all to be baked: those that shine when the level starts, at their steady level
// Errors   malformed keys: located warnings, the documented default is used; what is not handled: one warning a
// kind
#pragma once
#include "compiler/world/world.h"

namespace kiln {

enum class LightKind : std::uint8_t { point, spot, sun, sky };
inline constexpr std::array<const char*, 4> kLightKindNames = {"point", "spot", "sun", "sky"};
enum class Falloff : std::uint8_t {
    polynomial,   // 1 / (constant + linear d + quadratic d^2), d clamped to >= 1 map unit
    quake_linear, // max(0, 1 - d / range), Quake `delay 0`
    none,         // constant
};

struct Light {
    LightKind kind = LightKind::point;
    Falloff falloff = Falloff::polynomial;
    Vec3 position{};
    Vec3 direction{0, 0, -1}; // spot and sun: the way the light travels, unit
    // point/spot: E = intensity * falloff(d) * cone * max(0, cos); sun: E = intensity * cos (perpendicular
    // irradiance); sky: radiance of the sky dome (constant).
    Rgb intensity{};
    double constant = 0, linear = 0, quadratic = 1;
    double range = 0;                                  // quake_linear: E is zero from here on; otherwise 0: none
    double fade_start = 0, fade_end = 0;               // hard falloff (quintic) between, 0: none
    double cos_inner = 1, cos_outer = 1, exponent = 1; // spot
    bool cone_cosine = true;       // spot of Source: the cosine off the axis is a factor; of Quake: it is not
    double angular_radius_rad = 0; // sun: of its disc; 0: a point
    // Quake `_anglescale`, where the map states it: cos -> 1 - scale + scale * cos. Otherwise 1.
    double angle_scale = 1;
    std::uint32_t style = 0; // 0: always on; 1..31 animated; from 32 on switchable by name
    EntityId entity;
    template <class A> void fields(A& a) {
        a(kind, falloff, position, direction, intensity, constant, linear, quadratic, range, fade_start, fade_end,
          cos_inner, cos_outer, exponent, cone_cosine, angular_radius_rad, angle_scale, style, entity);
    }
    double attenuation(double distance) const; // falloff(d) alone
    double cone(Vec3 unit_from_light) const;   // 0..1; 1 for what is no spot
};

std::vector<Light> read_lights(const World& world, Context& context);

} // namespace kiln

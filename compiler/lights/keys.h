// Keys of light entities. Private to the folder.
#pragma once
#include "compiler/lights/lights.h"
#include <map>
#include <optional>

namespace kiln {

struct LightReader {
    const World& world;
    Context& context;
    std::vector<Light> lights = {};

    // Counted over the map and told once.
    std::uint32_t dark = 0, animated = 0, local_min = 0, templates = 0, negative = 0;
    SourceLocation dark_first = {}, animated_first = {}, local_min_first = {}, templates_first = {},
                   negative_first = {};
    std::map<std::string, std::uint32_t> ignored_keys = {};

    SourceLocation where(const WorldEntity& e, std::string_view key = {}) const;
    void count(std::uint32_t& counter, SourceLocation& first, const WorldEntity& e);
    // A number; where the key is there and no number: a warning and `otherwise`.
    double number(const WorldEntity& e, std::string_view key, double otherwise);
    Vec3 vector(const WorldEntity& e, std::string_view key, Vec3 otherwise);
    // "r g b [brightness]" or "brightness" of Source: gamma 2.2, 255 -> 1. Nothing: absent, malformed (warned) or
    // negative (means "not set").
    std::optional<Rgbd> source_color(const WorldEntity& e, std::string_view key);
    // Hue of 0..1 or 0..255 components: gamma 2.2, the largest 1 stays 1.
    std::optional<Rgbd> hue(const WorldEntity& e, std::string_view key);
    // Keeps the light unless it starts dark or gives nothing.
    void keep(Light light, const WorldEntity& e, Rgbd intensity);
    // The entity that has this targetname.
    const WorldEntity* named(std::string_view name) const;
};

// Yaw and pitch in degrees: pitch up is positive.
Vec3 direction_of(double yaw_deg, double pitch_deg);

void read_source_light(LightReader& reader, const WorldEntity& entity, EntityId id, bool& has_environment);
void read_quake_light(LightReader& reader, const WorldEntity& entity, EntityId id, bool quake3);
void read_quake_worldspawn(LightReader& reader);

} // namespace kiln

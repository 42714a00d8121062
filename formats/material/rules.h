// What one rule of a material file states. Private to the folder.
#pragma once
#include "formats/material/material.h"
#include <optional>

namespace kiln {

struct MaterialRule {
    std::string pattern;   // as written
    std::string lower;     // lower case
    bool glob = false;     // has *, ? or [
    std::string directory; // of the file
    std::optional<Rgb> reflectance, emission, tint;
    std::optional<float> alpha, env_map, roughness, alpha_test;
    std::optional<OpacityMap> opacity_map;
    std::optional<double> normal_cone_deg;
    std::optional<std::string> normal_map, albedo_map;
    std::optional<std::array<int, 2>> size;
    std::uint32_t flags_set = 0, flags_cleared = 0;
    bool flags_listed = false; // a "flags" list: flags_set is all there is
    template <class A> void fields(A& a) {
        a(pattern, glob, reflectance, emission, alpha, env_map, roughness, normal_cone_deg, normal_map, albedo_map,
          size, flags_set, flags_cleared, flags_listed, tint, alpha_test, opacity_map);
    }
};

// What a name alone implies; nothing: an ordinary name.
struct ImpliedMaterial {
    std::uint32_t flags = 0;
    std::optional<Rgb> reflectance;
};
std::optional<ImpliedMaterial> implied_by_name(std::string_view name);

// `*` any run (slashes too), `?` any one byte, `[a-z]`, `[!a-z]` one of a set; all else itself.
bool glob_match(std::string_view pattern, std::string_view text);
bool is_glob(std::string_view pattern);

// The bit of a flag name in JSON; 0: no such flag.
std::uint32_t flag_named(std::string_view name);

} // namespace kiln

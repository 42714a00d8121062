#include "formats/material/rules_json.h"
#include "formats/document/document.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace kiln {
namespace {

using Json = nlohmann::ordered_json; // rules keep the order of the file: the later wins

struct FlagName {
    std::string_view name;
    std::uint32_t bit;
};
constexpr FlagName kFlags[] = {
    {"sky", kSky},
    {"nodraw", kNoDraw},
    {"skip", kSkip},
    {"hint", kHint},
    {"clip", kClip},
    {"trigger", kTrigger},
    {"origin", kOrigin},
    {"areaportal", kAreaPortal},
    {"water", kWater},
    {"lava", kWater | kLava},
    {"slime", kWater | kSlime},
    {"translucent", kTranslucent},
    {"detail", kDetail},
    {"light_blocker", kLightBlocker},
    {"invisible", kInvisible},
    {"no_light", kNoLight},
    {"nolight", kNoLight},
    {"non_solid", kNonSolid},
    {"nonsolid", kNonSolid},
    {"two_sided", kTwoSided},
    {"area_portal", kAreaPortal},
    {"no_draw", kNoDraw},
    {"alpha_tested", kAlphaTested},
    {"alpha_test", kAlphaTested},
    {"stops_players", kClip | kStopsPlayers},
    {"stops_npcs", kClip | kStopsNpcs},
    {"stops_bullets", kClip | kStopsBullets},
    {"stops_sight", kClip | kStopsSight},
};

int line_of_byte(std::string_view text, std::size_t byte) {
    return 1 + static_cast<int>(
                   std::count(text.begin(), text.begin() + static_cast<long>(std::min(byte, text.size())), '\n'));
}

struct Reader {
    std::string_view text;
    const std::string& file;
    Context& context;

    // JSON values carry no place; the first mention of the name is near enough to go to.
    SourceLocation where(const std::string& name) const {
        const std::size_t at = text.find('"' + name + '"');
        return {file, at == std::string_view::npos ? 0 : line_of_byte(text, at)};
    }
    void warn(const char* code, const std::string& name, const std::string& message) {
        context.report(Severity::warning, code, fmt::format("material '{}': {}", name, message), where(name));
    }
    std::optional<double> number(const Json& v, double low, double high, const std::string& name, const char* key) {
        if (!v.is_number()) {
            warn("material-value-invalid", name, fmt::format("'{}' should be a number; it is ignored", key));
            return std::nullopt;
        }
        const double x = v.get<double>();
        const double kept = std::clamp(x, low, high);
        if (kept != x)
            warn("material-value-clamped", name,
                 fmt::format("'{}' {} lies outside {}..{}; {} is used", key, x, low, high, kept));
        return kept;
    }
    std::optional<Rgb> color(const Json& v, double high, const std::string& name, const char* key) {
        std::array<double, 3> c{};
        if (v.is_array() && v.size() == 3) {
            for (std::size_t i = 0; i < 3; ++i) {
                const std::optional<double> x = number(v[i], 0, high, name, key);
                if (!x) return std::nullopt;
                c[i] = *x;
            }
        } else if (v.is_number()) {
            c.fill(*number(v, 0, high, name, key));
        } else {
            warn("material-value-invalid", name,
                 fmt::format("'{}' should be a number or [r, g, b]; it is ignored", key));
            return std::nullopt;
        }
        return Rgb{static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2])};
    }
    std::optional<std::string> string(const Json& v, const std::string& name, const char* key) {
        if (v.is_string()) return v.get<std::string>();
        warn("material-value-invalid", name, fmt::format("'{}' should be text; it is ignored", key));
        return std::nullopt;
    }
    std::optional<float> share(const Json& v, const std::string& name, const char* key) {
        if (v.is_boolean()) return v.get<bool>() ? 1.0f : 0.0f;
        const std::optional<double> x = number(v, 0, 1, name, key);
        return x ? std::optional<float>(static_cast<float>(*x)) : std::nullopt;
    }

    std::optional<OpacityMap> opacity_map(const Json& v, const std::string& name) {
        const auto no = [&](const char* why) {
            warn("material-value-invalid", name, fmt::format("'opacity_map' {}; it is ignored", why));
            return std::nullopt;
        };
        if (!v.is_object() || !v.contains("size") || !v["size"].is_array() || v["size"].size() != 2 || !v.contains("opacity") || !v["opacity"].is_string())
            return no("should be a file name, or \"size\" and \"opacity\"");
        OpacityMap map;
        for (const auto& [edge, at] : {std::pair{&map.width, 0}, {&map.height, 1}}) {
            const Json& n = v["size"][static_cast<std::size_t>(at)];
            if (!n.is_number_integer() || n.get<std::int64_t>() < 1 || n.get<std::int64_t>() > kMostOpacitySize) return no("has an impossible size");
            *edge = n.get<int>();
        }
        const std::size_t texels = static_cast<std::size_t>(map.width) * static_cast<std::size_t>(map.height);
        auto opacity = bytes_of_base64(v["opacity"].get_ref<const std::string&>());
        if (!opacity || opacity->size() != texels) return no("has not a byte for each texel");
        map.opacity = *std::move(opacity);
        if (v.contains("tint")) {
            auto tint = v["tint"].is_string() ? bytes_of_base64(v["tint"].get_ref<const std::string&>()) : std::nullopt;
            if (!tint || tint->size() != 3 * texels) return no("has not three bytes of tint for each texel");
            map.tint = *std::move(tint);
        }
        return map;
    }

    void list_flags(MaterialRule& rule, const Json& v, const std::string& name) {
        if (!v.is_array()) {
            warn("material-value-invalid", name, "'flags' should be a list of names; it is ignored");
            return;
        }
        rule.flags_listed = true;
        for (const Json& e : v) {
            const std::uint32_t bit = e.is_string() ? flag_named(e.get<std::string>()) : 0;
            if (bit == 0)
                warn("material-flag-unknown", name,
                     fmt::format("there is no flag {}", e.dump(-1, ' ', true, Json::error_handler_t::replace)));
            rule.flags_set |= bit;
        }
    }

    void read_key(MaterialRule& rule, const std::string& key, const Json& v) {
        // Reflectance 1 would never let light die; 0.99 is the documented end of the range.
        constexpr double kMostReflectance = 0.99, kMostEmission = 1e9, kMostSize = 16384;
        const std::string& name = rule.pattern;
        if (key == "reflectance") {
            rule.reflectance = color(v, kMostReflectance, name, "reflectance");
        } else if (key == "emission") {
            rule.emission = color(v, kMostEmission, name, "emission");
        } else if (key == "alpha") {
            rule.alpha = share(v, name, "alpha");
        } else if (key == "env_map") {
            rule.env_map = share(v, name, "env_map");
        } else if (key == "roughness") {
            rule.roughness = share(v, name, "roughness");
        } else if (key == "alpha_test") {
            rule.alpha_test = share(v, name, "alpha_test");
            if (rule.alpha_test) rule.flags_set |= kAlphaTested, rule.flags_cleared &= ~std::uint32_t{kAlphaTested};
        } else if (key == "tint") {
            rule.tint = color(v, 1, name, "tint");
        } else if (key == "opacity_map") {
            if (!v.is_string()) rule.opacity_map = opacity_map(v, name); // a file's name: whoever read this file reads that one too
        } else if (key == "normal_map") {
            rule.normal_map = string(v, name, "normal_map");
        } else if (key == "albedo_map") {
            rule.albedo_map = string(v, name, "albedo_map");
        } else if (key == "normal_cone" || key == "normal_cone_deg") {
            rule.normal_cone_deg = number(v, 0, 90, name, "normal_cone");
        } else if (key == "size") {
            if (!v.is_array() || v.size() != 2) {
                warn("material-value-invalid", name, "'size' should be [width, height]; it is ignored");
                return;
            }
            const std::optional<double> w = number(v[0], 1, kMostSize, name, "size"),
                                        h = number(v[1], 1, kMostSize, name, "size");
            if (w && h) rule.size = {static_cast<int>(*w), static_cast<int>(*h)};
        } else if (key == "flags") {
            list_flags(rule, v, name);
        } else if (const std::uint32_t bit = flag_named(key)) {
            if (!v.is_boolean())
                warn("material-value-invalid", name,
                     fmt::format("'{}' should be true or false; it is ignored", key));
            else if (v.get<bool>())
                rule.flags_set |= bit, rule.flags_cleared &= ~bit;
            else
                rule.flags_cleared |= bit, rule.flags_set &= ~bit;
        } else if (key != "comment" && !key.starts_with("//")) {
            warn("material-key-unknown", name, fmt::format("the key '{}' is not known; it is ignored", key));
        }
    }
};

} // namespace

std::uint32_t flag_named(std::string_view name) {
    for (const FlagName& f : kFlags)
        if (equal_ignoring_case(f.name, name)) return f.bit;
    return 0;
}

Result<std::vector<MaterialRule>> rules_of_json(std::string_view text, const std::string& file, Context& context) {
    const auto no = [&](std::string message, int line) {
        return fault(Exit::input, "material-file-unreadable", std::move(message), {file, line});
    };
    Json json;
    try {
        json = Json::parse(text.begin(), text.end(), nullptr, true, /*ignore_comments=*/true);
    } catch (const Json::parse_error& e) {
        return no(fmt::format("this is no valid JSON: {}", e.what()), line_of_byte(text, e.byte));
    } catch (const Json::exception& e) {
        return no(fmt::format("this is no valid JSON: {}", e.what()), 1);
    }
    if (!json.is_object() || !json.contains("materials") || !json["materials"].is_object())
        return no("a material file is an object with a member \"materials\" that is an object", 1);

    Reader reader{text, file, context};
    const std::size_t slash = file.rfind('/');
    std::vector<MaterialRule> rules;
    for (const auto& [key, value] : json.items())
        if (key != "materials" && key != "comment" && !key.starts_with("//"))
            context.report(Severity::warning, "material-key-unknown",
                           fmt::format("the key '{}' is not known; it is ignored", key), reader.where(key));
    for (const auto& [name, value] : json["materials"].items()) {
        MaterialRule rule;
        rule.pattern = name;
        rule.lower = lower_case(name);
        rule.glob = is_glob(name);
        rule.directory = slash == std::string::npos ? "" : file.substr(0, slash + 1);
        if (!value.is_object()) {
            reader.warn("material-value-invalid", name, "should be an object; it is ignored");
            continue;
        }
        for (const auto& [key, v] : value.items()) reader.read_key(rule, key, v);
        rules.push_back(std::move(rule));
    }
    return rules;
}

} // namespace kiln

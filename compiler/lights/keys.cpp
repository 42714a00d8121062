#include "compiler/lights/keys.h"
#include "formats/document/document.h"
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace kiln {
namespace {

constexpr double kGamma = 2.2;
double linear_of(double encoded) {
    return std::pow(std::max(encoded, 0.0), kGamma);
}

} // namespace

SourceLocation LightReader::where(const WorldEntity& e, std::string_view key) const {
    const DocKey* found = key.empty() ? nullptr : find_key(e.keys, key);
    return {world.file, found ? found->line : e.line, e.id};
}

void LightReader::count(std::uint32_t& counter, SourceLocation& first, const WorldEntity& e) {
    if (counter++ == 0) first = where(e);
}

double LightReader::number(const WorldEntity& e, std::string_view key, double otherwise) {
    const DocKey* found = find_key(e.keys, key);
    if (!found) return otherwise;
    const std::optional<double> value = parse_number(found->value);
    if (!value && !found->value.empty())
        context.report(Severity::warning, "light-key-invalid",
                       fmt::format("the key {} is no number; {} is used", key, otherwise), where(e, key));
    return value.value_or(otherwise);
}

Vec3 LightReader::vector(const WorldEntity& e, std::string_view key, Vec3 otherwise) {
    const DocKey* found = find_key(e.keys, key);
    if (!found) return otherwise;
    bool complete = false;
    const std::vector<double> n = parse_numbers(found->value, &complete);
    if (!complete || n.size() < 2 || n.size() > 3) {
        if (!found->value.empty())
            context.report(Severity::warning, "light-key-invalid",
                           fmt::format("the key {} is not two or three numbers; its default is used", key),
                           where(e, key));
        return otherwise;
    }
    return {n[0], n[1], n.size() > 2 ? n[2] : 0};
}

std::optional<Rgbd> LightReader::source_color(const WorldEntity& e, std::string_view key) {
    const DocKey* found = find_key(e.keys, key);
    if (!found || found->value.empty()) return std::nullopt;
    bool complete = false;
    const std::vector<double> n = parse_numbers(found->value, &complete);
    // Eight numbers: the same twice, for low and for high dynamic range.
    const std::size_t size = n.size();
    if (!complete || (size != 1 && size != 3 && size != 4 && size != 8)) {
        context.report(Severity::warning, "light-key-invalid",
                       fmt::format("the key {} should be: red green blue brightness; its default is used", key),
                       where(e, key));
        return std::nullopt;
    }
    const std::size_t at = size == 8 && n[4] >= 0 && n[5] >= 0 && n[6] >= 0 ? 4 : 0;
    const auto channel = [&](std::size_t i) { return size == 1 ? n[0] : n[at + i]; };
    if (channel(0) < 0 || channel(1) < 0 || channel(2) < 0) return std::nullopt;
    const double brightness = size >= 4 ? n[at + 3] / 255 : 1;
    return Rgbd{linear_of(channel(0) / 255), linear_of(channel(1) / 255), linear_of(channel(2) / 255)} * brightness;
}

std::optional<Rgbd> LightReader::hue(const WorldEntity& e, std::string_view key) {
    const DocKey* found = find_key(e.keys, key);
    if (!found || found->value.empty()) return std::nullopt;
    bool complete = false;
    const std::vector<double> n = parse_numbers(found->value, &complete);
    if (!complete || n.size() != 3) {
        context.report(Severity::warning, "light-key-invalid",
                       fmt::format("the key {} should be: red green blue; white is used", key), where(e, key));
        return std::nullopt;
    }
    const double unit = std::max({n[0], n[1], n[2]}) > 1 ? 255 : 1; // both conventions are in use
    return Rgbd{linear_of(n[0] / unit), linear_of(n[1] / unit), linear_of(n[2] / unit)};
}

void LightReader::keep(Light light, const WorldEntity& e, Rgbd intensity) {
    if (intensity.x < 0 || intensity.y < 0 || intensity.z < 0) {
        count(negative, negative_first, e);
        return;
    }
    constexpr double kLargest = 1e15; // still finite after squares in float
    for (std::size_t i = 0; i < 3; ++i) light.intensity[i] = static_cast<float>(std::min(intensity[i], kLargest));
    if (light.intensity == Rgb{}) return;
    if (light.kind == LightKind::point || light.kind == LightKind::spot) {
        const double style = e.number("style", 0);
        light.style = style > 0 && style < 1e6 ? static_cast<std::uint32_t>(style) : 0;
        const bool switchable = !e.get("targetname").empty();
        constexpr std::uint32_t kFirstSwitchable = 32;
        if (switchable && light.style < kFirstSwitchable) light.style = kFirstSwitchable;
        const double flags = e.number("spawnflags", 0);
        if (switchable && flags >= 1 && std::fmod(flags, 2) >= 1) { // 1: starts dark, in both families
            count(dark, dark_first, e);
            return;
        }
        if (light.style > 0 && light.style < kFirstSwitchable) count(animated, animated_first, e);
    }
    lights.push_back(light);
}

const WorldEntity* LightReader::named(std::string_view name) const {
    if (name.empty()) return nullptr;
    for (const WorldEntity& e : world.entities)
        if (equal_ignoring_case(e.get("targetname"), name)) return &e;
    return nullptr;
}

Vec3 direction_of(double yaw_deg, double pitch_deg) {
    const double yaw = yaw_deg * std::numbers::pi / 180, pitch = pitch_deg * std::numbers::pi / 180;
    // Straight up and down come out exactly, as editors write them.
    const double flat = std::abs(pitch_deg) == 90 ? 0 : std::cos(pitch);
    return normalize(Vec3{std::cos(yaw) * flat, std::sin(yaw) * flat, std::sin(pitch)});
}

} // namespace kiln

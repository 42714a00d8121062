#include "compiler/assemble/entity_keys.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <span>

namespace kiln::assemble_detail {
namespace {

constexpr std::string_view kPoints[] = {
    "origin", "basisorigin", "attachpoint", "point0", "point1", "point2", "position2", "springaxis", "endpos", "farpoint", "targetpos",
};
// "x y z, x y z": a line through two points.
constexpr std::string_view kAxes[] = {"axis", "hingeaxis", "slideaxis"};
constexpr std::string_view kDirections[] = {"basisu", "basisv", "basisnormal", "fogdir", "_sun_vector", "sunvector", "winddir", "gravitydir"};
// Angles that tell a direction in the world, whoever has them.
constexpr std::string_view kAngles[] = {"movedir", "pushdir", "gibdir", "gibangles", "launchdirection", "exitangles", "spawnangles", "lightdirection"};
// Boxes about the entity's origin, and their other corner.
constexpr std::pair<std::string_view, std::string_view> kBoxes[] = {
    {"mins", "maxs"}, {"bbmins", "bbmaxs"}, {"box_mins", "box_maxs"}, {"m_vecmins", "m_vecmaxs"}, {"extentmin", "extentmax"},
};
// Here an `angles` pitch counts upwards, as `pitch` does, and directions are always meant.
constexpr std::string_view kLightsWithDirection[] = {"light_spot", "light_environment", "light_directional", "light_glspot", "env_cascade_light", "env_sun"};

constexpr std::string_view kSideLists[] = {"sides", "sides2", "side", "sidelist", "brushfaces"};
constexpr std::string_view kNodes[] = {"nodeid", "targetnode", "startnode", "endnode", "nodeoverride"};

constexpr std::string_view kNames[] = {
    "actor", "altpath", "area_cap_point", "associated_team_entity", "associatedmodel", "attach1", "attach2", "attachtoentity", "backgroundbmodel",
    "beneficiary", "bottomtrack", "cameraname", "cappoint", "constraintsystem", "controlpoint", "damagefilter", "damagetarget",
    "destination", "directionentityname", "directiontarget", "doorname", "doortoopenname", "enemyfiltername", "entity", "entityname",
    "entitytemplate", "filterammo", "filtername", "followtarget", "goal", "goalent", "impulsetarget", "interactionpartner",
    "interactwith", "killtarget", "landmark", "laserentity", "lasertarget", "launchtarget", "leader", "lightingorigin", "lightingoriginhack",
    "lightningend", "lightningstart", "linkedpathtrack", "linked_cp", "lookatname", "lookatposition", "m_iszentity", "m_iszentry_target",
    "m_isznewtarget", "m_sztargetname", "master", "measurereference", "measureretarget", "measuretarget", "moveto", "movetarget",
    "nextkey", "nextpath", "nextspawn", "nexttarget", "newtarget", "npctarget", "npctemplate", "oppositedoor", "parentname", "partner",
    "passenger", "pathcorner", "path_track", "physobject", "portaltarget", "propname", "rallypoint", "recipient", "referencename", "respawnroomname",
    "ropematerialtarget", "scriptentity", "skytarget", "slavename", "soundent", "sourceentity", "sourceentityname", "sourcename", "spawnname",
    "spawner", "speaker", "speakername", "standoffgoal", "startpath", "startpathtrack", "startcontroller", "subject", "target", "targetattachment",
    "targetent", "targetentity", "targetentityname", "targetname", "targetreference", "targettrack", "team_model", "templatename", "thruster",
    "toptrack", "trackname", "train", "turretname", "vehicle", "vehiclename", "visibletarget", "volname", "watcher", "weapontarget",
};
// The same with a number behind: target1, cpoint7, template03, position0 of env_soundscape.
constexpr std::string_view kNumberedNames[] = {"target", "targetname", "cpoint", "template", "position", "entity", "filter", "subject", "actor", "spawnpoint"};

template <std::size_t N> bool is_one_of(const std::string_view (&list)[N], std::string_view key) {
    return std::ranges::any_of(list, [&](std::string_view k) { return equal_ignoring_case(k, key); });
}

std::string text_of(Vec3 v) { return number_text(v.x) + " " + number_text(v.y) + " " + number_text(v.z); }

std::optional<Vec3> vector_of(std::string_view text) {
    bool complete = false;
    const std::vector<double> n = parse_numbers(text, &complete);
    if (!complete || n.size() != 3) return std::nullopt;
    return Vec3{n[0], n[1], n[2]};
}

std::vector<std::string_view> words_of(std::string_view text) {
    std::vector<std::string_view> words;
    for (std::size_t i = 0; i < text.size();) {
        const std::size_t end = std::min(text.find_first_of(" \t,", i), text.size());
        if (end > i) words.push_back(text.substr(i, end - i));
        i = end + 1;
    }
    return words;
}

// Decimals all the way, so that whole numbers stay whole under quarter turns. Unreadable text stays as it is.
std::string placed_point(const std::string& text, const Placement& placement) {
    const std::vector<std::string_view> words = words_of(text);
    if (words.size() != 3) return text;
    DecimalPoint p;
    for (std::size_t i = 0; i < 3; ++i) {
        const std::optional<Decimal> x = parse_decimal(words[i]);
        if (!x || std::fabs(x->to_double()) > 1e9) return text;
        p[i] = *x;
    }
    const DecimalPoint q = placement.point(p);
    if (!placement.quarter_turns()) return text_of(to_vec(q));
    return to_text(q[0]) + " " + to_text(q[1]) + " " + to_text(q[2]);
}

std::string placed_axis(const std::string& text, const Placement& placement) {
    const std::vector<std::string_view> words = words_of(text);
    if (words.size() != 6) return placed_point(text, placement);
    const auto joined = [&](std::size_t first) {
        return fmt::format("{} {} {}", words[first], words[first + 1], words[first + 2]);
    };
    return placed_point(joined(0), placement) + ", " + placed_point(joined(3), placement);
}

std::string placed_angles(const std::string& text, const Placement& placement) {
    const std::optional<Vec3> angles = vector_of(text);
    if (!angles) return text;
    return text_of(angles_of_matrix(product(placement.rotation, matrix_of_angles(*angles))));
}

DocKey* key_of(DocEntity& e, std::string_view name) { return const_cast<DocKey*>(e.find(name)); }

void set_key(DocEntity& e, std::string_view name, std::string value) {
    if (DocKey* key = key_of(e, name)) key->value = std::move(value);
    else e.keys.push_back({std::string(name), std::move(value), e.line, false});
}

// `pitch` wins over the first of `angles`, `angle` over the second, unless they are zero; -1 and -2 are up and down.
void place_light_direction(DocEntity& e, const Placement& placement) {
    const Vec3 angles = e.vector("angles", {});
    double pitch = e.number("pitch", 0), yaw = e.number("angle", 0);
    if (pitch == 0) pitch = angles.x;
    if (yaw == -1 || yaw == -2) pitch = yaw == -1 ? 90 : -90, yaw = 0;
    else if (yaw == 0) yaw = angles.y;
    const Vec3 turned = angles_of_matrix(product(placement.rotation, matrix_of_angles({-pitch, yaw, 0})));
    set_key(e, "angles", text_of({-turned.x, turned.y, 0}));
    if (e.find("pitch")) set_key(e, "pitch", number_text(-turned.x));
    std::erase_if(e.keys, [](const DocKey& k) { return !k.output && equal_ignoring_case(k.key, "angle"); });
}

// The one angle of the Quake family: a yaw, or -1 and -2 for up and down.
void place_angle(DocEntity& e, DocKey& key, const Placement& placement) {
    const std::optional<double> angle = parse_number(key.value);
    if (!angle) return;
    const bool vertical = *angle == -1 || *angle == -2;
    const Vec3 before = vertical ? Vec3{*angle == -1 ? -90.0 : 90.0, 0, 0} : Vec3{0, *angle, 0};
    const Vec3 after = angles_of_matrix(product(placement.rotation, matrix_of_angles(before)));
    constexpr double kLevel = 1e-6; // degrees
    if (std::fabs(after.x) > 90 - kLevel) key.value = after.x < 0 ? "-1" : "-2";
    else if (std::fabs(after.x) < kLevel && (vertical || std::fabs(after.z) < kLevel))
        key.value = number_text(after.y < 0 ? after.y + 360 : after.y); // -1 and -2 mean something else
    else if (!e.find("angles")) key.key = "angles", key.value = text_of(after);
}

// Movers that turn about an axis told by two spawn flags: neither is z.
struct TurningClass {
    std::string_view name;
    int x_flag, y_flag, reverse_flag; // 0: none
};
constexpr TurningClass kTurning[] = {
    {"func_rotating", 4, 8, 2},
    {"func_door_rotating", 64, 128, 2},
    {"func_rot_button", 64, 128, 2},
    {"momentary_rot_button", 64, 128, 0},
};
void place_turning_axis(DocEntity& e, const Placement& placement, const SourceLocation& where, Context& context) {
    const std::string_view name = e.get("classname");
    for (const TurningClass& c : kTurning) {
        if (!equal_ignoring_case(c.name, name)) continue;
        int flags = static_cast<int>(e.number("spawnflags", 0));
        const Vec3 before = (flags & c.x_flag) ? Vec3{1, 0, 0} : (flags & c.y_flag) ? Vec3{0, 1, 0} : Vec3{0, 0, 1};
        const Vec3 after = placement.direction(before);
        std::size_t axis = 3;
        constexpr double kAlong = 1 - 1e-9;
        for (std::size_t k = 0; k < 3; ++k)
            if (std::fabs(after[k]) >= kAlong) axis = k;
        const bool reverse = axis < 3 && after[axis] < 0;
        if (axis == 3 || (reverse && c.reverse_flag == 0)) {
            context.report(Severity::note, "instance-turned-axis",
                           fmt::format("{} turns about an axis that its flags cannot tell once the instance is rotated; it stays as it was", name), where);
            return;
        }
        if (after == before) return;
        flags &= ~(c.x_flag | c.y_flag);
        if (axis == 0) flags |= c.x_flag;
        if (axis == 1) flags |= c.y_flag;
        if (reverse) flags ^= c.reverse_flag;
        set_key(e, "spawnflags", std::to_string(flags));
    }
}

} // namespace

std::string number_text(double x) {
    constexpr double kScale = 1e6;
    const double rounded = std::round(x * kScale) / kScale;
    if (!std::isfinite(rounded) || rounded == 0) return "0";
    std::string text = fmt::format("{:.6f}", rounded);
    text.erase(text.find_last_not_of('0') + 1);
    if (text.ends_with('.')) text.pop_back();
    return text;
}

void place_keys(DocEntity& e, const Placement& placement, const SourceLocation& where, Context& context) {
    for (DocKey& k : e.keys) {
        if (k.output) continue;
        if (is_one_of(kPoints, k.key)) k.value = placed_point(k.value, placement);
        else if (is_one_of(kAxes, k.key)) k.value = placed_axis(k.value, placement);
    }
    if (!placement.turned()) return;
    for (DocKey& k : e.keys) {
        if (k.output) continue;
        if (is_one_of(kAngles, k.key)) {
            k.value = placed_angles(k.value, placement);
        } else if (is_one_of(kDirections, k.key)) {
            if (const std::optional<Vec3> v = vector_of(k.value)) k.value = text_of(placement.direction(*v));
        }
    }
    for (const auto& [low, high] : kBoxes) {
        DocKey* a = key_of(e, low);
        DocKey* b = key_of(e, high);
        if (!a || !b) continue;
        const std::optional<Vec3> lo = vector_of(a->value), hi = vector_of(b->value);
        if (!lo || !hi) continue;
        Box3 box;
        for (int corner = 0; corner < 8; ++corner)
            box.add(placement.direction({corner & 1 ? hi->x : lo->x, corner & 2 ? hi->y : lo->y, corner & 4 ? hi->z : lo->z}));
        a->value = text_of(box.lo), b->value = text_of(box.hi);
    }
    place_turning_axis(e, placement, where, context);

    const std::string_view name = e.get("classname");
    if (is_one_of(kLightsWithDirection, name) || e.find("pitch")) {
        place_light_direction(e, placement);
        return;
    }
    if (DocKey* angles = key_of(e, "angles")) {
        if (e.brushes.empty()) {
            angles->value = placed_angles(angles->value, placement);
        } else if (const std::optional<Vec3> a = vector_of(angles->value)) {
            // The run time turns the model, drawn where it stands, by these about its origin. The model has been turned
            // already: R * A * R^-1 is what then has to follow.
            const Matrix& r = placement.rotation;
            angles->value = text_of(angles_of_matrix(product(product(r, matrix_of_angles(*a)), transposed(r))));
        }
    }
    if (DocKey* angle = key_of(e, "angle")) place_angle(e, *angle, placement);
}

void renumber_sides(DocEntity& e, IdMap& ids) {
    for (DocKey& k : e.keys) {
        if (k.output || !is_one_of(kSideLists, k.key)) continue;
        std::string text;
        for (const std::string_view word : words_of(k.value)) {
            const std::optional<double> id = parse_number(word);
            const bool whole = id && *id >= 0 && *id == std::floor(*id) && *id < 2147483647.0;
            text += (text.empty() ? "" : " ") + (whole ? std::to_string(ids(static_cast<int>(*id))) : std::string(word));
        }
        k.value = std::move(text);
    }
}

void renumber_nodes(DocEntity& e, IdMap& ids) {
    if (!lower_case(e.get("classname")).starts_with("info_")) return;
    for (DocKey& k : e.keys) {
        if (k.output || !is_one_of(kNodes, k.key)) continue;
        const std::optional<double> id = parse_number(k.value);
        if (id && *id > 0 && *id == std::floor(*id) && *id < 2147483647.0) k.value = std::to_string(ids(static_cast<int>(*id)));
    }
}

bool holds_entity_name(std::string_view key) {
    if (is_one_of(kNames, key)) return true;
    const std::size_t end = key.find_last_not_of("0123456789") + 1;
    return end > 0 && end < key.size() && is_one_of(kNumberedNames, key.substr(0, end));
}

Output Output::parse(std::string_view value) {
    Output out;
    out.separator = value.find('\x1B') != std::string_view::npos ? '\x1B' : ',';
    for (std::size_t at = 0;;) {
        const std::size_t end = value.find(out.separator, at);
        out.fields.emplace_back(value.substr(at, end == std::string_view::npos ? end : end - at));
        if (end == std::string_view::npos) return out;
        at = end + 1;
    }
}

std::string Output::text() const {
    std::string text;
    for (std::size_t i = 0; i < fields.size(); ++i) {
        if (i > 0) text += separator;
        text += fields[i];
    }
    return text;
}

std::string NameFixup::operator()(std::string_view name) const {
    if (style == FixupStyle::none || name.empty() || name[0] == '@' || name[0] == '!') return std::string(name);
    if (style == FixupStyle::prefix) return fmt::format("{}-{}", instance, name);
    return fmt::format("{}-{}", name, instance);
}

void fix_names(DocEntity& e, const NameFixup& fix) {
    if (fix.style == FixupStyle::none) return;
    // A trailing star of an output's target stands for any ending.
    const auto is_named = [&](std::string_view name) {
        std::string low = lower_case(name);
        if (!low.ends_with('*')) return fix.names.contains(low);
        low.pop_back();
        const auto it = fix.names.lower_bound(low);
        return it != fix.names.end() && it->starts_with(low);
    };
    // Targets may be classes; those that no entity is called by stay classes.
    const auto target = [&](const std::string& name) {
        const std::string low = lower_case(name);
        const bool is_class = fix.classes.contains(low) || low == "player" || low == "worldspawn";
        return is_class && !is_named(name) ? name : fix(name);
    };
    for (DocKey& k : e.keys) {
        if (!k.output) {
            if (!holds_entity_name(k.key)) continue;
            // "name,attachment"
            const std::size_t comma = k.value.find(',');
            const std::string tail = comma == std::string::npos ? "" : k.value.substr(comma);
            const std::string name = k.value.substr(0, comma);
            if (equal_ignoring_case(k.key, "targetname")) k.value = fix(name) + tail;
            else if (!parse_number(name)) k.value = target(name) + tail;
            continue;
        }
        Output output = Output::parse(k.value);
        output.fields[0] = target(output.fields[0]);
        if (output.fields.size() > 2) {
            std::string& parameter = output.fields[2];
            if (equal_ignoring_case(output.fields[1], "AddOutput")) {
                // "key value" or "OnEvent target:input:parameter:delay:times"
                const std::size_t space = parameter.find(' ');
                if (space != std::string::npos) {
                    const std::string key = parameter.substr(0, space), value = parameter.substr(space + 1);
                    const std::size_t colon = value.find(':');
                    if (colon != std::string::npos) parameter = key + " " + target(value.substr(0, colon)) + value.substr(colon);
                    else if (holds_entity_name(key)) parameter = key + " " + target(value);
                }
            } else if (!parse_number(parameter) && is_named(parameter)) {
                parameter = fix(parameter);
            }
        }
        k.value = output.text();
    }
}

std::optional<std::string> replaced(std::string_view text, const Replacements& replacements) {
    std::string out;
    for (std::size_t at = 0; at < text.size();) {
        const std::pair<std::string, std::string>* longest = nullptr;
        for (const auto& pair : replacements)
            if ((!longest || pair.first.size() > longest->first.size()) && equal_ignoring_case(text.substr(at, pair.first.size()), pair.first)) longest = &pair;
        if (longest) out += longest->second, at += longest->first.size();
        else out += text[at++];
        if (out.size() > std::max(kMostReplaced, text.size())) return std::nullopt;
    }
    return out;
}

} // namespace kiln::assemble_detail

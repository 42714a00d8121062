#include "formats/material/material.h"
#include "formats/document/document.h"
#include "formats/material/lights_rad.h"
#include "formats/material/rules.h"
#include "formats/material/rules_json.h"
#include <algorithm>
#include <fmt/format.h>
#include <map>
#include <set>

namespace kiln {

struct MaterialDatabase::Rules {
    std::vector<MaterialRule> rules; // in order of adding
    std::map<std::string, Material, std::less<>> found;
    std::set<std::string> warned; // lower case: names differ by case without meaning to

    // Rules that match, weakest first: globs, then names that differ by case, then the exact spelling; in order
    // of adding within each. Each later one overrides what it states and leaves the rest.
    std::vector<const MaterialRule*> matching(std::string_view name) const {
        const std::string lower = lower_case(name);
        std::array<std::vector<const MaterialRule*>, 3> ranks;
        for (const MaterialRule& r : rules) {
            if (r.pattern == name)
                ranks[2].push_back(&r); // "*water0" is a name too
            else if (r.lower == lower)
                ranks[1].push_back(&r);
            else if (r.glob && glob_match(r.lower, lower))
                ranks[0].push_back(&r);
        }
        std::vector<const MaterialRule*> all;
        for (const auto& rank : ranks) all.insert(all.end(), rank.begin(), rank.end());
        return all;
    }
};

namespace {

void apply(Material& m, const MaterialRule& r) {
    const auto set = [](auto& field, const auto& stated) {
        if (stated) field = *stated;
    };
    set(m.reflectance, r.reflectance);
    set(m.emission, r.emission);
    set(m.alpha, r.alpha);
    m.alpha_stated |= r.alpha.has_value();
    set(m.alpha_test, r.alpha_test);
    set(m.opacity_map, r.opacity_map);
    if (r.tint) m.tint = r.tint;
    set(m.env_map, r.env_map);
    set(m.roughness, r.roughness);
    set(m.normal_map, r.normal_map);
    set(m.albedo_map, r.albedo_map);
    set(m.normal_cone_deg, r.normal_cone_deg);
    if (r.size) m.width = (*r.size)[0], m.height = (*r.size)[1];
    // A name that says sky while its rule says it emits: what is stated wins. Light of a sky comes from light
    // entities, so `emission` can only mean an ordinary emitter.
    if (r.emission && max_component(*r.emission) > 0) m.flags &= ~std::uint32_t{kSky};
    if (r.alpha) m.flags = *r.alpha < 1 ? m.flags | kTranslucent : m.flags & ~std::uint32_t{kTranslucent};
    if (r.flags_listed) m.flags = 0;
    m.flags = (m.flags & ~r.flags_cleared) | r.flags_set;
}

} // namespace

MaterialDatabase::MaterialDatabase() : rules_(std::make_unique<Rules>()) {}
MaterialDatabase::~MaterialDatabase() = default;
MaterialDatabase::MaterialDatabase(MaterialDatabase&&) noexcept = default;
MaterialDatabase& MaterialDatabase::operator=(MaterialDatabase&&) noexcept = default;

Result<bool> MaterialDatabase::add_json(std::string_view text, const std::string& file, Context& context) {
    Result<std::vector<MaterialRule>> added = rules_of_json(text, file, context);
    if (!added) return added.fault();
    for (MaterialRule& rule : *added) rules_->rules.push_back(std::move(rule));
    rules_->found.clear();
    return true;
}

void MaterialDatabase::add_lights_rad(std::string_view text, const std::string& file, Context& context) {
    for (MaterialRule& rule : rules_of_lights_rad(text, file, context)) rules_->rules.push_back(std::move(rule));
    rules_->found.clear();
}

Material MaterialDatabase::find(std::string_view name, Context& context, const SourceLocation& where) {
    if (const auto it = rules_->found.find(name); it != rules_->found.end()) return it->second;
    Material m;
    m.name = name;
    if (const std::optional<ImpliedMaterial> implied = implied_by_name(name)) {
        m.flags = implied->flags;
        if (implied->reflectance) m.reflectance = *implied->reflectance;
        m.known = true;
    }
    for (const MaterialRule* rule : rules_->matching(name)) {
        apply(m, *rule);
        m.known = true;
    }
    if (!m.known && rules_->warned.insert(lower_case(name)).second)
        context.report(Severity::warning, "material-unknown",
                       fmt::format("nothing is known of the material '{}': reflectance 0.5 and size {}x{} are used",
                                   m.name, m.width, m.height),
                       where);
    // The alpha of other textures means other things (gloss, glow).
    if (!(m.flags & (kTranslucent | kAlphaTested))) m.opacity_map = {};
    if ((m.flags & kAlphaTested) && !(m.flags & kTranslucent)) {
        for (std::uint8_t& t : m.opacity_map.opacity) t = static_cast<float>(t) >= 255 * m.alpha_test ? 255 : 0;
        m.opacity_map.tint.clear(); // a hole has no colour
    }
    rules_->found.emplace(m.name, m);
    return m;
}

std::string MaterialDatabase::map_directory(std::string_view name) const {
    std::string directory;
    for (const MaterialRule* rule : rules_->matching(name))
        if (rule->normal_map || rule->albedo_map) directory = rule->directory;
    return directory;
}

Bytes MaterialDatabase::content() const {
    return to_bytes(rules_->rules);
}

} // namespace kiln

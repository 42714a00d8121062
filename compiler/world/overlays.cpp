#include "compiler/world/overlays.h"
#include "compiler/world/side_list.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>

namespace kiln {
namespace {

// Texels to map units of a decal. Source's engine asks the material ($decalscale, 1 where it is silent), which nearly all
// materials made for decals answer with 1/4; GoldSrc draws a texel a unit.
constexpr double kSourceDecalScale = 0.25, kGoldSrcDecalScale = 1;

// Largest size or coordinate that makes sense, map units; far beyond any level, far from trouble with doubles.
constexpr double kLargest = 1e6;

class OverlayReader {
public:
    OverlayReader(World& world, MaterialDatabase& materials, Context& context) : world_(world), materials_(materials), context_(context) {
        for (std::size_t i = 0; i < world.materials.size(); ++i) material_ids_.try_emplace(world.materials[i].name, id<MaterialId>(i));
    }

    void run() {
        std::optional<SideNames> names; // built when the first overlay asks
        for (std::size_t i = 0; i < world_.entities.size(); ++i) {
            const WorldEntity& e = world_.entities[i];
            const std::string_view name = e.get("classname");
            const bool decal = equal_ignoring_case(name, "infodecal") || equal_ignoring_case(name, "_decal");
            if (!decal && !equal_ignoring_case(name, "info_overlay")) continue;
            WorldOverlay overlay;
            overlay.entity = id<EntityId>(i);
            overlay.kind = decal ? WorldOverlay::decal : WorldOverlay::overlay;
            const bool good = decal ? read_decal(e, overlay) : read_overlay(e, overlay);
            if (!good) continue;
            if (!decal) {
                if (!names) names.emplace(world_);
                overlay.sides = resolve_side_list(world_, *names, overlay.entity, "sides", context_);
            }
            world_.overlays.push_back(std::move(overlay));
        }
    }

private:
    World& world_;
    MaterialDatabase& materials_;
    Context& context_;
    std::map<std::string, MaterialId, std::less<>> material_ids_; // the first of a name

    SourceLocation where(const WorldEntity& e, const DocKey* key) const { return {world_.name_of(e.file), key ? key->line : e.line, e.id}; }
    bool unreadable(const WorldEntity& e, const DocKey* key, std::string message) {
        context_.report(Severity::warning, "overlay-unreadable", std::move(message) + "; it is left out", where(e, key));
        return false;
    }

    bool read_material(const WorldEntity& e, std::string_view name, WorldOverlay& out) {
        const DocKey* key = find_key(e.keys, name);
        if (!key || key->value.empty()) return unreadable(e, key, fmt::format("the {} has no {}", e.get("classname"), name));
        Material m = materials_.find(key->value, context_, where(e, key));
        const auto [it, added] = material_ids_.try_emplace(m.name, id<MaterialId>(world_.materials.size()));
        out.material = it->second;
        if (added) world_.materials.push_back(std::move(m));
        return true;
    }

    bool vector(const WorldEntity& e, std::string_view name, std::size_t least, Vec3& out) {
        const DocKey* key = find_key(e.keys, name);
        bool complete = false;
        const std::vector<double> n = key ? parse_numbers(key->value, &complete) : std::vector<double>{};
        bool good = complete && n.size() >= least && n.size() <= 3;
        for (const double x : n) good = good && std::fabs(x) <= kLargest;
        if (!good) return unreadable(e, key, fmt::format("the key {} of an overlay is not {} numbers", name, least == 3 ? "three" : "two or three"));
        out = {n[0], n[1], n.size() > 2 ? n[2] : 0};
        return true;
    }

    bool read_overlay(const WorldEntity& e, WorldOverlay& out) {
        if (!read_material(e, "material", out)) return false;
        if (!vector(e, find_key(e.keys, "BasisOrigin") ? "BasisOrigin" : "origin", 3, out.origin)) return false;
        if (!vector(e, "BasisU", 3, out.u) || !vector(e, "BasisV", 3, out.v) || !vector(e, "BasisNormal", 3, out.normal)) return false;
        out.u = normalize(out.u), out.v = normalize(out.v), out.normal = normalize(out.normal);
        constexpr double kFlat = 1e-3; // of the unit cube's volume: text of three digits spans more
        if (std::fabs(dot(cross(out.u, out.v), out.normal)) < kFlat)
            return unreadable(e, find_key(e.keys, "BasisNormal"), "the basis of an overlay lies in one plane");
        for (std::size_t i = 0; i < 4; ++i) {
            Vec3 corner;
            if (!vector(e, "uv" + std::to_string(i), 2, corner)) return false;
            out.corners[i] = {corner.x, corner.y};
        }
        const auto number = [&](const char* key, double otherwise) { return std::clamp(e.number(key, otherwise), -kLargest, kLargest); };
        out.uv_range = {number("StartU", 0), number("EndU", 1), number("StartV", 0), number("EndV", 1)};
        out.render_order = static_cast<int>(number("RenderOrder", 0));
        read_fade(e, out);
        return true;
    }

    void read_fade(const WorldEntity& e, WorldOverlay& out) {
        const double least = e.number("fademindist", -1), most = e.number("fademaxdist", 0);
        if (most > 0) out.fade_min = std::max(0.0, std::min(least, most)), out.fade_max = most;
    }

    bool read_decal(const WorldEntity& e, WorldOverlay& out) {
        const DocKey* key = find_key(e.keys, "texture");
        if (!read_material(e, "texture", out)) return false;
        if (!e.has_origin) return unreadable(e, key, fmt::format("the {} has no origin", e.get("classname")));
        out.origin = e.origin;
        const Material& m = world_.materials[out.material.at()];
        const double scale = world_.format == MapFormat::vmf ? kSourceDecalScale : kGoldSrcDecalScale;
        const double u = m.width * scale / 2, v = m.height * scale / 2;
        out.corners = {Vec2{-u, -v}, {-u, v}, {u, v}, {u, -v}};
        read_fade(e, out);
        return true;
    }
};

} // namespace

void read_overlays(World& world, MaterialDatabase& materials, Context& context) { OverlayReader(world, materials, context).run(); }

} // namespace kiln

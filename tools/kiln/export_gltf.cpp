#include "formats/document/document.h"
#include "formats/level/kiln_level.hpp"
#include "tools/kiln/export.h"
#include <cstring>
#include <fmt/format.h>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <unordered_map>

namespace kiln {
namespace {

using Json = nlohmann::ordered_json;

std::string text_of(const Json& j) { return j.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace); }
// Bytes of maps may be of any encoding; glTF is UTF-8.
std::string utf8(const std::string& s) { return Json::parse(text_of(Json(s))).get<std::string>(); }

struct Vertex {
    Vec3f position, normal;
    std::array<float, 4> tangent{};
    std::array<float, 2> uv0{}, uv1{};
};
static_assert(sizeof(Vertex) == 14 * sizeof(float), "no padding: vertices are told apart by their bytes");
struct Part { // of a primitive: three vertices a triangle, map units in the world
    std::uint32_t material = 0, model = 0, page = UINT32_MAX;
    bool two_sided = false;
    std::vector<Vertex> corners;
    std::vector<Vec3> positions; // parallel: before they are made relative to the model's origin
};
struct Entity {
    std::vector<std::pair<std::string, std::string>> keys;
    std::int32_t model = -1;
    Vec3 origin{};
    std::string_view get(std::string_view key) const {
        for (const auto& [k, v] : keys)
            if (equal_ignoring_case(k, key)) return v;
        return {};
    }
};
struct Content {
    std::vector<Material> materials;
    std::vector<Part> parts; // in the order of faces
    std::vector<Entity> entities;
    std::vector<Light> lights;
    Json lightmaps = Json::array();
};

Vertex vertex(Vec3f normal, Frame frame, Vec2 uv) {
    Vertex v;
    v.normal = normal;
    // The standard's bitangent, cross(normal, tangent) * w, points up in the image; ours down.
    const double w = dot(cross(frame.n, frame.t), frame.b) > 0 ? -1 : 1;
    v.tangent = {static_cast<float>(frame.t.x), static_cast<float>(frame.t.y), static_cast<float>(frame.t.z), static_cast<float>(w)};
    v.uv0 = {static_cast<float>(uv.x), static_cast<float>(uv.y)};
    return v;
}

GltfPrimitive primitive(const std::vector<const Part*>& parts, Vec3 origin) {
    struct Bytes56 {
        std::array<std::uint32_t, 14> words;
        bool operator==(const Bytes56&) const = default;
    };
    struct HashBytes {
        std::size_t operator()(const Bytes56& b) const {
            std::uint64_t h = 0;
            for (const std::uint32_t w : b.words) h = (h ^ w) * 0x9E3779B97F4A7C15ull, h ^= h >> 29;
            return h;
        }
    };
    GltfPrimitive p;
    std::unordered_map<Bytes56, std::uint32_t, HashBytes> index;
    const bool lit = parts[0]->page != UINT32_MAX;
    for (const Part* part : parts)
        for (std::size_t i = 0; i < part->corners.size(); ++i) {
            Vertex v = part->corners[i];
            v.position = Vec3f(part->positions[i] - origin);
            Bytes56 key{};
            std::memcpy(key.words.data(), &v, sizeof v);
            const auto [it, fresh] = index.emplace(key, static_cast<std::uint32_t>(p.positions.size()));
            if (fresh) {
                p.positions.push_back(v.position), p.normals.push_back(v.normal), p.tangents.push_back(v.tangent), p.uv0.push_back(v.uv0);
                if (lit) p.uv1.push_back(v.uv1);
            }
            p.indices.push_back(it->second);
        }
    if (lit) p.extras = text_of({{"lightmap_page", parts[0]->page}});
    return p;
}

std::array<double, 4> turn_to(Vec3 direction) { // that takes -z to the direction
    const Vec3 from{0, 0, -1}, axis = cross(from, direction);
    const double w = 1 + dot(from, direction);
    if (w < 1e-12) return {1, 0, 0, 0}; // straight back: half a turn about x
    const double n = std::sqrt(dot(axis, axis) + w * w);
    return {axis.x / n, axis.y / n, axis.z / n, w / n};
}

std::optional<GltfLight> punctual(const Light& l, const std::string& name, double scale) {
    if (l.kind == LightKind::sky) return std::nullopt; // it has no counterpart
    GltfLight g;
    g.name = name;
    g.kind = l.kind == LightKind::sun ? GltfLight::directional : l.kind == LightKind::spot ? GltfLight::spot : GltfLight::point;
    const double most = max_component(l.intensity);
    g.color = most > 0 ? l.intensity / static_cast<float>(most) : Vec3f{1, 1, 1};
    if (l.kind == LightKind::sun) {
        g.intensity = static_cast<float>(most);
        return g;
    }
    // Candela: irradiance times the square of the distance. Where that changes with distance, that at 128 units holds.
    constexpr double kAgree = 128;
    const bool inverse_square = l.falloff == Falloff::polynomial && l.constant == 0 && l.linear == 0 && l.quadratic > 0;
    const double candela = inverse_square ? most / l.quadratic : most * l.attenuation(kAgree) * kAgree * kAgree;
    g.intensity = static_cast<float>(candela * scale * scale);
    const double end = l.falloff == Falloff::quake_linear ? l.range : l.fade_end;
    if (end > 0) g.range = static_cast<float>(end * scale);
    if (g.kind == GltfLight::spot) {
        const auto angle = [](double cosine) { return static_cast<float>(std::acos(std::clamp(cosine, -1.0, 1.0))); };
        g.outer_rad = std::clamp(angle(l.cos_outer), 1e-3f, 1.5707f); // the standard knows no wider ones
        g.inner_rad = std::clamp(angle(l.cos_inner), 0.0f, g.outer_rad * 0.999f);
    }
    return g;
}
Json light_extras(const Light& l) {
    static constexpr const char* kFalloffs[] = {"polynomial", "linear", "none"};
    return {{"light", {{"kind", kLightKindNames[static_cast<std::size_t>(l.kind)]}, {"intensity", {l.intensity.x, l.intensity.y, l.intensity.z}}, {"falloff", kFalloffs[static_cast<int>(l.falloff)]},
                       {"constant", l.constant}, {"linear", l.linear}, {"quadratic", l.quadratic}, {"range", l.range}, {"fade", {l.fade_start, l.fade_end}},
                       {"cos_inner", l.cos_inner}, {"cos_outer", l.cos_outer}, {"exponent", l.exponent}, {"angular_radius_rad", l.angular_radius_rad}, {"style", l.style}}}};
}

GltfScene scene_of(const Content& c, const GltfOptions& options) {
    GltfScene s;
    s.generator = kVersion;
    Rgb sky;
    Json skies = Json::array();
    std::map<std::pair<std::uint32_t, bool>, std::uint32_t> material_of;
    const auto material = [&](std::uint32_t m, bool two_sided) {
        const auto [it, fresh] = material_of.emplace(std::pair(m, two_sided), static_cast<std::uint32_t>(s.materials.size()));
        if (!fresh) return it->second;
        const Material& from = c.materials[m];
        GltfMaterial g;
        g.name = utf8(from.name);
        g.base_color = {from.reflectance.x, from.reflectance.y, from.reflectance.z, from.alpha};
        g.emissive = from.emission, g.blend = from.alpha < 1, g.double_sided = two_sided;
        Json extras = {{"size", {from.width, from.height}}, {"flags", from.flags}};
        if (!from.albedo_map.empty()) extras["albedo_map"] = from.albedo_map;
        if (!from.normal_map.empty()) extras["normal_map"] = from.normal_map;
        g.extras = text_of(extras);
        s.materials.push_back(std::move(g));
        return it->second;
    };

    GltfNode root;
    root.name = utf8(options.name);
    root.rotation = {-std::numbers::sqrt2 / 2, 0, 0, std::numbers::sqrt2 / 2}; // -90 degrees about x: +z becomes +y
    root.scale = options.metres_per_unit;
    s.nodes.push_back(root);
    s.roots = {0};
    const auto add = [&](GltfNode node) {
        s.nodes[0].children.push_back(static_cast<std::uint32_t>(s.nodes.size()));
        s.nodes.push_back(std::move(node));
    };

    std::map<std::uint32_t, std::map<std::tuple<std::uint32_t, bool, std::uint32_t>, std::vector<const Part*>>> models;
    for (const Part& p : c.parts)
        if (!p.corners.empty()) models[p.model][{p.material, p.two_sided, p.page}].push_back(&p);
    std::vector<char> placed(models.empty() ? 1 : models.rbegin()->first + 1);
    const auto mesh_of = [&](std::uint32_t model, Vec3 origin, const std::string& name) -> std::optional<std::uint32_t> {
        const auto it = models.find(model);
        if (it == models.end()) return std::nullopt;
        placed[model] = 1;
        GltfMesh mesh;
        mesh.name = name;
        for (const auto& [key, parts] : it->second) {
            mesh.primitives.push_back(primitive(parts, origin));
            mesh.primitives.back().material = material(std::get<0>(key), std::get<1>(key));
        }
        s.meshes.push_back(std::move(mesh));
        return static_cast<std::uint32_t>(s.meshes.size() - 1);
    };
    for (std::size_t e = 0; e < c.entities.size(); ++e) {
        const Entity& from = c.entities[e];
        GltfNode node;
        const std::string classname(from.get("classname")), target(from.get("targetname"));
        node.name = utf8(e == 0 ? "worldspawn" : target.empty() ? classname : classname + " " + target);
        const std::int32_t model = e == 0 ? 0 : from.model;
        node.translation = e == 0 ? Vec3{} : from.origin;
        if (model >= 0) node.mesh = mesh_of(static_cast<std::uint32_t>(model), node.translation, node.name);
        Json keys = Json::array();
        for (const auto& [k, v] : from.keys) keys.push_back({k, v});
        Json extras = {{"classname", classname}, {"keys", keys}};
        if (model >= 0) extras["model"] = model;
        node.extras = text_of(extras);
        add(std::move(node));
    }
    for (const auto& [model, parts] : models) // no entity says that it has it: a level without entities
        if (!placed[model]) {
            GltfNode node;
            node.name = fmt::format("model {}", model);
            node.mesh = mesh_of(model, {}, node.name);
            add(std::move(node));
        }
    for (std::size_t i = 0; i < c.lights.size(); ++i) {
        const Light& l = c.lights[i];
        const std::string name = fmt::format("light_{}", i);
        const auto light = punctual(l, name, options.metres_per_unit);
        if (!light) {
            sky += l.intensity, skies.push_back(light_extras(l)["light"]); // uniform domes add up
            continue;
        }
        GltfNode node;
        node.name = name;
        node.translation = l.kind == LightKind::sun ? Vec3{} : l.position;
        if (l.kind != LightKind::point) node.rotation = turn_to(l.direction);
        node.light = static_cast<std::uint32_t>(s.lights.size());
        node.extras = text_of(light_extras(l));
        s.lights.push_back(*light);
        add(std::move(node));
    }
    Json kiln = {{"version", 1}, {"units_per_metre", 1 / options.metres_per_unit}};
    if (!c.lightmaps.empty()) kiln["lightmaps"] = c.lightmaps;
    if (!skies.empty()) kiln["sky"] = {sky.x, sky.y, sky.z}, kiln["sky_lights"] = skies;
    s.nodes[0].extras = text_of({{"kiln", kiln}});
    return s;
}

} // namespace

GltfScene gltf_of_map(const Compiled& c, const std::vector<Light>& lights, const GltfOptions& options) {
    Content content;
    content.materials = c.world.materials, content.lights = lights;
    const Surfaces& s = c.surfaces;
    for (const Face& f : s.faces) {
        if (!f.drawn || f.sky) continue;
        Part part{f.material.value, f.model.value, UINT32_MAX, f.two_sided, {}, {}};
        for (std::uint32_t k = f.first_triangle; k < f.first_triangle + f.triangle_count; ++k)
            for (std::size_t corner = 0; corner < 3; ++corner) {
                const Vec3 x = s.positions[s.triangles[k][corner]], n(s.corner_normals[k][corner]);
                Frame frame = f.tangent;
                const bool mirrored = dot(cross(frame.n, frame.t), frame.b) < 0;
                frame.n = n, frame.t = normalize(frame.t - n * dot(frame.t, n)), frame.b = cross(n, frame.t) * (mirrored ? -1.0 : 1.0);
                const Vec2 uv = f.curved() ? s.corners_of(k)[corner].uv : texture_uv(c.world.sides[f.side.at()].texture, c.world.materials[f.material.at()], x);
                part.corners.push_back(vertex(s.corner_normals[k][corner], frame, uv));
                part.positions.push_back(x);
            }
        content.parts.push_back(std::move(part));
    }
    for (const WorldEntity& e : c.world.entities) {
        Entity entity;
        for (const DocKey& k : e.keys) entity.keys.emplace_back(k.key, k.value);
        entity.model = e.model.valid() ? static_cast<std::int32_t>(e.model.value) : -1;
        entity.origin = e.has_origin ? e.origin : Vec3{};
        content.entities.push_back(std::move(entity));
    }
    return scene_of(content, options);
}

GltfScene gltf_of_level(const kiln_level* l, const GltfOptions& options) {
    Content content;
    kiln_info info{};
    kiln_level_info(l, &info);
    std::size_t n = 0;
    const kiln_material* materials = kiln_level_materials(l, &n);
    for (std::size_t i = 0; i < n; ++i) {
        const kiln_material& m = materials[i];
        Material out;
        out.name = m.name, out.albedo_map = m.albedo_map, out.normal_map = m.normal_map, out.flags = m.flags, out.alpha = m.alpha;
        out.width = static_cast<int>(m.width), out.height = static_cast<int>(m.height);
        for (std::size_t k = 0; k < 3; ++k) out.reflectance[k] = m.reflectance[k], out.emission[k] = m.emission[k];
        content.materials.push_back(out);
    }
    std::vector<kiln_page> pages(info.pages);
    for (std::uint32_t p = 0; p < info.pages; ++p) {
        kiln_level_page_info(l, p, &pages[p]);
        content.lightmaps.push_back({{"file", options.lightmaps.at(p)}, {"width", pages[p].width}, {"height", pages[p].height}, {"encoding", "linear irradiance"}});
    }
    const LevelMesh mesh(l);
    for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) {
        const kiln_face& face = mesh.faces[f];
        if (!(face.flags & KILN_FACE_DRAWN) || (face.flags & KILN_FACE_SKY)) continue;
        Part part{face.material, face.model, UINT32_MAX, (face.flags & KILN_FACE_TWO_SIDED) != 0, {}, {}};
        const kiln_chart* chart = face.chart == KILN_NO_INDEX ? nullptr : &mesh.charts[face.chart];
        if (chart) part.page = chart->page;
        for (std::uint32_t triangle = 0; triangle < face.triangle_count; ++triangle)
            for (const LevelMesh::Corner& c : mesh.corners(f, triangle)) {
                const double at[3] = {c.position.x, c.position.y, c.position.z};
                const float normal[3] = {c.normal.x, c.normal.y, c.normal.z};
                float t[3], b[3], m[3];
                kiln_level_tangent_frame_at(l, f, at, normal, t, b, m);
                Vertex v = vertex(c.normal, {{t[0], t[1], t[2]}, {b[0], b[1], b[2]}, {m[0], m[1], m[2]}}, c.uv);
                if (chart)
                    v.uv1 = {static_cast<float>((chart->page_x + c.luxel.x) / pages[chart->page].width), static_cast<float>((chart->page_y + c.luxel.y) / pages[chart->page].height)};
                part.corners.push_back(v), part.positions.push_back(c.position);
            }
        content.parts.push_back(std::move(part));
    }
    for (std::uint32_t e = 0; e < info.entities; ++e) {
        Entity entity;
        for (std::size_t k = 0; k < kiln_level_entity_key_count(l, e); ++k) {
            const char *key = "", *value = "";
            if (kiln_level_entity_key(l, e, k, &key, &value) == KILN_OK) entity.keys.emplace_back(key, value);
        }
        entity.model = kiln_level_entity_model(l, e);
        if (const std::vector<double> o = parse_numbers(entity.get("origin")); o.size() == 3) entity.origin = {o[0], o[1], o[2]};
        content.entities.push_back(std::move(entity));
    }
    const kiln_light* lights = kiln_level_lights(l, &n);
    for (std::size_t i = 0; i < n; ++i) {
        const kiln_light& from = lights[i];
        Light to;
        to.kind = static_cast<LightKind>(from.kind % 4), to.falloff = static_cast<Falloff>(from.falloff % 3);
        for (std::size_t k = 0; k < 3; ++k) to.position[k] = from.position[k], to.direction[k] = from.direction[k], to.intensity[k] = from.intensity[k];
        to.constant = from.constant_attn, to.linear = from.linear_attn, to.quadratic = from.quadratic_attn, to.range = from.range;
        to.fade_start = from.fade_start, to.fade_end = from.fade_end, to.cos_inner = from.cos_inner, to.cos_outer = from.cos_outer;
        to.exponent = from.exponent, to.angular_radius_rad = from.angular_radius_rad, to.angle_scale = from.angle_scale, to.style = from.style;
        content.lights.push_back(to);
    }
    return scene_of(content, options);
}

} // namespace kiln

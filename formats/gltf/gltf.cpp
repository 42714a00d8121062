#include "formats/gltf/gltf.h"
#include <bit>
#include <cstring>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

static_assert(std::endian::native == std::endian::little, "buffers are little-endian");

namespace kiln {
namespace {

using Json = nlohmann::ordered_json;

enum ComponentType { kUint = 5125, kFloat = 5126 };
enum Target { kArray = 34962, kElements = 34963 };

void demand(bool holds, const std::string& what) {
    if (!holds) throw std::invalid_argument("glTF scene: " + what);
}

class Writer {
public:
    explicit Writer(const GltfScene& scene) : scene_(scene) {}

    Json json;
    Bytes bin;

    void write() {
        json["asset"] = {{"version", "2.0"}};
        if (!scene_.generator.empty()) json["asset"]["generator"] = scene_.generator;
        if (!scene_.extras.empty()) json["extras"] = Json::parse(scene_.extras);
        // What the standard lets no file have empty is left out.
        if (!scene_.roots.empty()) json["scene"] = 0, json["scenes"] = Json::array({{{"nodes", scene_.roots}}});
        nodes(), materials(), meshes(), lights();
        if (!views_.empty()) json["bufferViews"] = std::move(views_), json["accessors"] = std::move(accessors_);
        if (!extensions_.empty()) json["extensionsUsed"] = extensions_;
    }

private:
    const GltfScene& scene_;
    Json views_ = Json::array(), accessors_ = Json::array();
    std::set<std::string> extensions_;

    static void add_extras(Json& j, const std::string& extras) {
        if (!extras.empty()) j["extras"] = Json::parse(extras);
    }

    template <class T> std::size_t view(const std::vector<T>& values, Target target) {
        while (bin.size() % 4) bin.push_back(0);
        const std::size_t offset = bin.size(), size = values.size() * sizeof(T);
        bin.resize(offset + size);
        std::memcpy(bin.data() + offset, values.data(), size);
        views_.push_back({{"buffer", 0}, {"byteOffset", offset}, {"byteLength", size}, {"target", static_cast<int>(target)}});
        return views_.size() - 1;
    }
    template <class T> std::size_t accessor(const std::vector<T>& values, ComponentType component, const char* type, Target target) {
        accessors_.push_back({{"bufferView", view(values, target)}, {"componentType", static_cast<int>(component)}, {"count", values.size()}, {"type", type}});
        return accessors_.size() - 1;
    }

    void nodes() {
        std::vector<int> parents(scene_.nodes.size());
        for (const GltfNode& n : scene_.nodes) {
            Json j;
            if (!n.name.empty()) j["name"] = n.name;
            if (n.mesh) demand(*n.mesh < scene_.meshes.size(), "a node names a mesh that does not exist"), j["mesh"] = *n.mesh;
            if (!(n.translation == Vec3{})) j["translation"] = {n.translation.x, n.translation.y, n.translation.z};
            if (n.rotation != std::array<double, 4>{0, 0, 0, 1}) j["rotation"] = n.rotation;
            if (n.scale != 1) j["scale"] = {n.scale, n.scale, n.scale};
            for (const std::uint32_t c : n.children) demand(c < scene_.nodes.size() && ++parents[c] == 1, "a node is no child, or twice");
            if (!n.children.empty()) j["children"] = n.children;
            if (n.light) {
                demand(*n.light < scene_.lights.size(), "a node names a light that does not exist");
                j["extensions"] = {{"KHR_lights_punctual", {{"light", *n.light}}}};
            }
            add_extras(j, n.extras);
            if (j.is_null()) j = Json::object();
            json["nodes"].push_back(std::move(j));
        }
        for (const std::uint32_t r : scene_.roots) demand(r < scene_.nodes.size() && parents[r] == 0, "a root is no node, or a child");
    }
    void materials() {
        for (const GltfMaterial& m : scene_.materials) {
            Json j = {{"name", m.name}, {"pbrMetallicRoughness", {{"baseColorFactor", m.base_color}, {"metallicFactor", m.metallic}, {"roughnessFactor", m.roughness}}}};
            if (const float most = max_component(m.emissive); most > 0) {
                const float over = std::max(1.0f, most);
                j["emissiveFactor"] = {m.emissive.x / over, m.emissive.y / over, m.emissive.z / over};
                if (over > 1) j["extensions"] = {{"KHR_materials_emissive_strength", {{"emissiveStrength", over}}}}, extensions_.insert("KHR_materials_emissive_strength");
            }
            if (m.blend) j["alphaMode"] = "BLEND";
            if (m.double_sided) j["doubleSided"] = true;
            add_extras(j, m.extras);
            json["materials"].push_back(std::move(j));
        }
    }
    void meshes() {
        for (const GltfMesh& m : scene_.meshes) {
            Json j = {{"name", m.name}, {"primitives", Json::array()}};
            demand(!m.primitives.empty(), "a mesh without primitives");
            for (const GltfPrimitive& p : m.primitives) j["primitives"].push_back(primitive(p));
            json["meshes"].push_back(std::move(j));
        }
    }
    Json primitive(const GltfPrimitive& p) {
        demand(p.material < scene_.materials.size(), "a primitive names a material that does not exist");
        demand(!p.positions.empty() && !p.indices.empty() && p.indices.size() % 3 == 0, "a primitive without triangles");
        const auto fits = [&](const auto& stream) { demand(stream.empty() || stream.size() == p.positions.size(), "a vertex stream of another length"); };
        fits(p.normals), fits(p.tangents), fits(p.uv0), fits(p.uv1);
        for (const std::uint32_t i : p.indices) demand(i < p.positions.size(), "an index beyond the vertices");
        Json j;
        j["attributes"]["POSITION"] = accessor(p.positions, kFloat, "VEC3", kArray);
        Vec3f lo = p.positions[0], hi = lo;
        for (const Vec3f& v : p.positions)
            for (std::size_t k = 0; k < 3; ++k) demand(std::isfinite(v[k]), "a position that is no number"), lo[k] = std::min(lo[k], v[k]), hi[k] = std::max(hi[k], v[k]);
        accessors_.back()["min"] = {lo.x, lo.y, lo.z}, accessors_.back()["max"] = {hi.x, hi.y, hi.z};
        if (!p.normals.empty()) j["attributes"]["NORMAL"] = accessor(p.normals, kFloat, "VEC3", kArray);
        if (!p.tangents.empty()) j["attributes"]["TANGENT"] = accessor(p.tangents, kFloat, "VEC4", kArray);
        if (!p.uv0.empty()) j["attributes"]["TEXCOORD_0"] = accessor(p.uv0, kFloat, "VEC2", kArray);
        if (!p.uv1.empty()) j["attributes"]["TEXCOORD_1"] = accessor(p.uv1, kFloat, "VEC2", kArray);
        j["indices"] = accessor(p.indices, kUint, "SCALAR", kElements);
        j["material"] = p.material;
        add_extras(j, p.extras);
        return j;
    }
    void lights() {
        if (scene_.lights.empty()) return;
        static constexpr const char* kKinds[] = {"point", "spot", "directional"};
        extensions_.insert("KHR_lights_punctual");
        Json list = Json::array();
        for (const GltfLight& l : scene_.lights) {
            Json j = {{"name", l.name}, {"type", kKinds[l.kind]}, {"color", {l.color.x, l.color.y, l.color.z}}, {"intensity", l.intensity}};
            if (l.range > 0 && l.kind != GltfLight::directional) j["range"] = l.range;
            if (l.kind == GltfLight::spot) {
                demand(l.inner_rad >= 0 && l.inner_rad < l.outer_rad && l.outer_rad <= 1.5708f, "a spot's cone angles");
                j["spot"] = {{"innerConeAngle", l.inner_rad}, {"outerConeAngle", l.outer_rad}};
            }
            list.push_back(std::move(j));
        }
        json["extensions"]["KHR_lights_punctual"]["lights"] = std::move(list);
    }
};

std::string text_of(const Json& j) { return j.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace); }

} // namespace

GltfFiles write_gltf(const GltfScene& scene, const std::string& bin_name) {
    Writer w(scene);
    w.write();
    if (!w.bin.empty()) {
        std::string uri; // a URI: what is not plain is escaped
        for (const char c : bin_name)
            if (std::isalnum(static_cast<unsigned char>(c)) || std::strchr("-._~", c)) uri += c;
            else uri += fmt::format("%{:02X}", static_cast<unsigned char>(c));
        w.json["buffers"] = Json::array({{{"uri", uri}, {"byteLength", w.bin.size()}}});
    }
    return {w.json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n", std::move(w.bin)};
}

Bytes write_glb(const GltfScene& scene) {
    Writer w(scene);
    w.write();
    if (!w.bin.empty()) w.json["buffers"] = Json::array({{{"byteLength", w.bin.size()}}});
    std::string text = text_of(w.json);
    while (text.size() % 4) text += ' ';
    while (w.bin.size() % 4) w.bin.push_back(0);
    Bytes out;
    const auto word = [&](std::uint32_t v) {
        for (int k = 0; k < 4; ++k) out.push_back(static_cast<std::uint8_t>(v >> (8 * k)));
    };
    const std::size_t total = 12 + 8 + text.size() + (w.bin.empty() ? 0 : 8 + w.bin.size());
    demand(total <= UINT32_MAX, "more than 4 GiB do not fit into a .glb");
    word(0x46546C67), word(2), word(static_cast<std::uint32_t>(total));
    word(static_cast<std::uint32_t>(text.size())), word(0x4E4F534A);
    out.insert(out.end(), text.begin(), text.end());
    if (!w.bin.empty()) {
        word(static_cast<std::uint32_t>(w.bin.size())), word(0x004E4942);
        out.insert(out.end(), w.bin.begin(), w.bin.end());
    }
    return out;
}

} // namespace kiln

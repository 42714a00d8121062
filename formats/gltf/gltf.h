// glTF 2.0, written: a value that says what is in the scene, to .glb bytes or .gltf text with its .bin. FORMAT.md says
// which parts of the standard are used and what stands in `extras`.
//
// In       tables below; indices into them are checked (std::invalid_argument names the first that does not exist)
// Out      bytes that are a function of the value alone
// Space    that of the value: the writer turns and scales nothing
#pragma once
#include "libs/core/archive.h"
#include "libs/math/vec.h"
#include <optional>
#include <string>
#include <vector>

namespace kiln {

// Vertex streams are empty (not there) or as long as `positions`.
struct GltfPrimitive {
    std::uint32_t material = 0;
    std::vector<Vec3f> positions, normals;
    std::vector<std::array<float, 4>> tangents; // w: sign of the bitangent cross(normal, tangent)
    std::vector<std::array<float, 2>> uv0, uv1; // v down
    std::vector<std::uint32_t> indices;         // triangles, counter-clockwise from the front
    std::string extras;                         // JSON text; empty: none
};
struct GltfMesh {
    std::string name;
    std::vector<GltfPrimitive> primitives;
};
struct GltfMaterial {
    std::string name;
    std::array<float, 4> base_color{1, 1, 1, 1}; // linear
    Vec3f emissive{};                            // radiance; above 1: KHR_materials_emissive_strength
    float metallic = 0, roughness = 1;
    bool blend = false, double_sided = false;
    std::string extras;
};
struct GltfLight { // KHR_lights_punctual; shines along -z of its node
    enum Kind : std::uint8_t { point, spot, directional };
    std::string name;
    Kind kind = point;
    Vec3f color{1, 1, 1};
    float intensity = 1;                // candela; directional: lux
    float range = 0;                    // 0: none
    float inner_rad = 0, outer_rad = 0; // spot
};
struct GltfNode {
    std::string name;
    std::optional<std::uint32_t> mesh, light;
    Vec3 translation{};
    std::array<double, 4> rotation{0, 0, 0, 1}; // quaternion x y z w
    double scale = 1;
    std::vector<std::uint32_t> children;
    std::string extras;
};
struct GltfScene {
    std::string generator, extras;
    std::vector<GltfMaterial> materials;
    std::vector<GltfMesh> meshes;
    std::vector<GltfLight> lights;
    std::vector<GltfNode> nodes; // each at most once a child
    std::vector<std::uint32_t> roots;
};

Bytes write_glb(const GltfScene& scene);
struct GltfFiles {
    std::string json;
    Bytes bin; // empty: there is no geometry, and `json` names no buffer
};
GltfFiles write_gltf(const GltfScene& scene, const std::string& bin_name); // as `json` names it, beside itself

} // namespace kiln

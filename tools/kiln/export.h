// What `kiln export` hands on: polygons of a stage for OBJ, the lit scene for glTF; from a map or from a level alike.
#pragma once
#include "compiler/compile.h"
#include "formats/gltf/gltf.h"
#include "formats/level/kiln_level.h"
#include "formats/mesh/obj.h"

namespace kiln {

struct ObjExport {
    std::vector<ObjPolygon> polygons;
    std::vector<ObjMaterial> materials;
};
struct ObjStage {
    const char* name;
    Stage needs;                            // of a map
    ObjExport (*of_map)(const Compiled&, const SurfacesOptions&);
    ObjExport (*of_level)(const kiln_level*); // null: a level has no such thing
};
std::span<const ObjStage> obj_stages();

// The triangles of a level, with what both formats ask of their corners.
class LevelMesh {
public:
    struct Corner {
        Vec3 position; // map units
        Vec3f normal;
        Vec2 uv, luxel; // repeats, v down; of a face with a chart
    };
    explicit LevelMesh(const kiln_level* level); // checked
    std::array<Corner, 3> corners(std::uint32_t face, std::uint32_t triangle) const; // the face's triangle of that number
    std::span<const kiln_face> faces;
    const kiln_chart* charts = nullptr;

private:
    const kiln_level* level_;
    double step_ = 1;
    const std::int32_t* grid_ = nullptr;
    const std::uint32_t* triangles_ = nullptr;
    const float* normals_ = nullptr;
};

struct GltfOptions {
    double metres_per_unit = 1.0 / 40;
    std::string name;                       // of the root
    std::vector<std::string> lightmaps;     // file name of each page of a level
};
GltfScene gltf_of_map(const Compiled& compiled, const std::vector<Light>& lights, const GltfOptions& options);
GltfScene gltf_of_level(const kiln_level* level, const GltfOptions& options);

} // namespace kiln

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
    ObjExport (*of_map)(const Compiled&);
    ObjExport (*of_level)(const kiln_level*); // null: a level has no such thing
};
std::span<const ObjStage> obj_stages();

struct GltfOptions {
    double metres_per_unit = 1.0 / 40;
    std::string name;                       // of the root
    std::vector<std::string> lightmaps;     // file name of each page of a level
};
GltfScene gltf_of_map(const Compiled& compiled, const std::vector<Light>& lights, const GltfOptions& options);
GltfScene gltf_of_level(const kiln_level* level, const GltfOptions& options);

} // namespace kiln

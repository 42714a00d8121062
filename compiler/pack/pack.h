// Pack: everything a level holds, in one file's bytes. A pure function: no times, no paths, no thread counts.
//
// In       what the stages made
// Out      level_content: the same facts as flat tables; indices stay those of the compiler for planes, nodes, leaves,
//          clusters, materials, faces, charts, lights, cubes, probes and entities. Brushes that were left out as
//          invalid are not in the level, so brush indices move up.
// Errors   none of its own; tables that contradict each other are a broken invariant (InternalError)
#pragma once
#include "compiler/ambient/ambient.h"
#include "compiler/density/density.h"
#include "compiler/light/light.h"
#include "compiler/probes/probes.h"
#include "compiler/visibility/merge.h"
#include "formats/level/level_writer.h"

namespace kiln {

struct PackInput {
    const World& world;
    const Csg& csg;
    const Bsp& bsp;
    const Visibility& visibility;
    const Surfaces& surfaces;
    const std::vector<Light>& lights;
    const Lighting& lighting;
    const Ambient& ambient;
    const Probes& probes;
    std::string options_json, input_hash, version;
    const Density* density = nullptr; // none, or without grids: all charts at full density
    const MergedClusters* merged = nullptr; // none: leaves keep their clusters
};
// What a level calls a file that the map brings in: where it lies beside the map, not where on this machine.
std::string name_beside(const std::string& map, const std::string& file);
level::LevelContent level_content(const PackInput& input, Context& context);
Bytes pack(const PackInput& input, const level::WriteOptions& options, Context& context);

} // namespace kiln

// Finds the files that a map names: instances and prefabs, spelled as on Windows more often than not.
#pragma once
#include "compiler/assemble/assemble.h"

namespace kiln {

// The file as it is spelled on disk, where letter case may differ; nothing where there is none.
std::optional<std::string> file_on_disk(const std::string& path);

// Where "instances/arc" of a map is looked for, in this order: relative to the folder of the file that names it, the folder of
// the main map, each folder called `maps` or `mapsrc` above it, and `instance_paths`; as spelled, then with .vmf and .map.
// Backslashes separate folders; where the exact spelling is not there, letter case does not matter. An absolute name is
// taken as it is.
OpenMap map_opener(const std::string& main_map, const std::vector<std::string>& instance_paths);

} // namespace kiln

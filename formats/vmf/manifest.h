// .vmm: a manifest, Hammer's list of the VMF files that together are one map.
#pragma once
#include "libs/core/context.h"
#include "libs/core/result.h"
#include <span>
#include <string>
#include <vector>

namespace kiln {

struct ManifestMap {
    std::string name, file; // as the manifest spells them
    bool primary = false;
    int line = 0;
};

// By its words, not by its name: a block `maps` at the top, or in a block `manifest`, and no block `world`.
bool is_manifest(std::span<const std::uint8_t> bytes);
// The maps in file order. A manifest without maps is a fault.
Result<std::vector<ManifestMap>> read_manifest(std::span<const std::uint8_t> bytes, const std::string& file, Context& context);

} // namespace kiln

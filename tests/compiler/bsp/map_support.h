// Real maps for tests: from the folder of test data beside the checkout, where there is one.
#pragma once
#include "compiler/world/world.h"
#include "formats/quake_map/quake_map.h"
#include "formats/vmf/vmf.h"
#include "libs/core/file.h"
#include <optional>
#include <string>

namespace kiln::test {

// Nothing where the file is not there or holds no world.
inline std::optional<World> real_world(const std::string& path, Context& context) {
    const auto bytes = read_file(path);
    if (!bytes) return std::nullopt;
    const bool vmf = path.ends_with(".vmf");
    const auto document = vmf ? read_vmf(*bytes, path, context) : read_quake_map(*bytes, path, context);
    if (!document) return std::nullopt;
    MaterialDatabase materials;
    auto world = build_world(*document, materials, {}, context);
    if (!world) return std::nullopt;
    return std::move(*world);
}

} // namespace kiln::test

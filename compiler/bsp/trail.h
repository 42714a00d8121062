// Private to bsp: the shortest way from an entity through portals to the void.
#pragma once
#include "compiler/bsp/build.h"

namespace kiln::bsp {

struct Trail {
    std::uint32_t start = 0;  // into entities
    std::vector<std::uint32_t> doors; // it goes through, in order
    std::vector<Vec3> points; // from the entity's origin to the world's box
};
// From whichever of `starts` (into entities) is nearest; `shut` per door. Nothing: no way.
std::optional<Trail> shortest_trail(const Flow& flow, const std::vector<EntityPlace>& entities,
                                    std::span<const std::uint32_t> starts, const std::vector<std::uint8_t>& shut);

} // namespace kiln::bsp

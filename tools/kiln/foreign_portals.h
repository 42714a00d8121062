// Portal files of other compilers, as the commands take them in the place of a map.
#pragma once
#include "compiler/visibility/merge.h"
#include "compiler/visibility/summary.h"
#include "libs/core/context.h"

namespace kiln {

bool is_portal_file(std::span<const std::uint8_t> bytes);
struct ForeignPortals {
    FilePortals given;
    std::uint32_t cluster_count = 0;
    std::vector<std::uint32_t> leaf_cluster; // of leaves that are in one
};
// Reports what is odd about them.
Result<ForeignPortals> read_foreign_portals(std::span<const std::uint8_t> bytes, const std::string& name, Context& context);
// Nothing where percent < 0. Never across a hint.
std::optional<MergedClusters> merge_foreign(const Visibility& visibility, const ForeignPortals& of, double percent, Context& context);

} // namespace kiln

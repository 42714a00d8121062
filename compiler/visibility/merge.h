// Which clusters may be one, at a stated cost in what is seen: smaller tables for engines that want them small.
//
// In       rows of the whole flow; how many leaves each cluster has; pairs of neighbours that may become one, and pairs that may never
// Out      the clusters numbered anew, and their rows: what any of its members sees. Nothing that was seen is lost
// Bound    no leaf sees more than `percent` more leaves than before: counted from the rows, not estimated. 0: only what costs nothing
// Method   greedy: of all joins the one that adds the fewest pairs of leaves, as long as there is one within the bound
#pragma once
#include "compiler/visibility/visibility.h"
#include <array>

namespace kiln {

struct MergedClusters {
    std::vector<std::uint32_t> of; // of each cluster: what it is part of now
    Visibility visibility;         // of those; `loose` still numbers the portals it was computed from
    double mean_before = 0, mean_after = 0; // leaves that a leaf sees
};
MergedClusters merge_clusters(const Visibility& visibility, std::span<const std::uint32_t> leaves, std::span<const std::array<std::uint32_t, 2>> neighbours,
                              std::span<const std::array<std::uint32_t, 2>> apart, double percent, Context& context);

// In a tree: never across a hint, an area portal or a liquid's surface, and what leaves share a cluster already (func_viscluster, 3D sky) stays as it is.
MergedClusters merge_clusters(const Visibility& visibility, const Bsp& bsp, double percent, Context& context);

} // namespace kiln

// What a visibility table comes to, in numbers; and portals of a file as portals of the stage.
#pragma once
#include "compiler/visibility/visibility.h"
#include "formats/portal_file/portal_file.h"

namespace kiln {

// Of the portals of a file. Its first cluster is to be the one the winding faces: a file in which more of the other portals
// of the first cluster lie behind their portal than in front has it the other way round throughout, which would make
// visible pairs invisible; it is turned, and `turned` says so.
struct FilePortals {
    std::vector<VisPortal> portals;
    std::vector<std::uint8_t> hint; // of each
    bool turned = false;
    double flatness = 0;           // map units: farthest that a point lies from the plane of its portal
    std::uint32_t without_area = 0; // portals that no plane can be told of
    std::uint32_t not_convex = 0, first_not_convex = 0; // portals whose windings dent by more than epsilon, or go around more than once
};
FilePortals vis_portals(const PortalFile& file);

struct VisibilitySummary {
    std::uint32_t clusters = 0, leaves = 0;
    std::uint64_t pairs = 0;              // (a, b) that see each other, a = b included
    std::uint32_t least = 0, most = 0;    // clusters that a cluster sees, itself included
    double mean = 0;                      // over clusters
    double mean_leaves = 0;               // leaves that a leaf sees, over leaves
    template <class A> void fields(A& a) { a(clusters, leaves, pairs, least, most, mean, mean_leaves); }
};
// `leaf_cluster`: per leaf; UINT32_MAX: in none. Empty: a leaf is a cluster.
VisibilitySummary summary(const Visibility& visibility, std::span<const std::uint32_t> leaf_cluster = {});

} // namespace kiln

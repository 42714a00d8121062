#include "compiler/visibility/summary.h"
#include "compiler/visibility/directed.h"
#include <algorithm>
#include <cmath>
#include <numbers>

namespace kiln {

namespace {

// A corner that turns the other way counts where it goes back by more than `dent`; corners of decimals waver on straight edges.
bool convex(const std::vector<Vec3>& w, Vec3 normal, double dent) {
    double turned = 0;
    for (std::size_t i = 0; i < w.size(); ++i) {
        const Vec3 in = w[(i + 1) % w.size()] - w[i], on = w[(i + 2) % w.size()] - w[(i + 1) % w.size()];
        const double sine = dot(cross(in, on), normal), cosine = dot(in, on);
        if (sine < -dent * std::max(length(in), length(on))) return false;
        turned += std::abs(std::atan2(sine, cosine));
    }
    return turned < 3 * std::numbers::pi; // once around: two of them
}

} // namespace

FilePortals vis_portals(const PortalFile& file) {
    FilePortals out;
    out.portals.reserve(file.portals.size());
    for (const FilePortal& p : file.portals) out.portals.push_back({p.front, p.back, p.winding}), out.hint.push_back(p.hint);

    const vis::DirectedPortals all = vis::directed_portals(out.portals);
    const std::span<const vis::Directed> directed = all.ways;
    std::vector<std::vector<std::uint32_t>> of_cluster(file.cluster_count);
    for (std::uint32_t i = 0; i < out.portals.size(); ++i) {
        of_cluster[out.portals[i].cluster_front].push_back(i);
        of_cluster[out.portals[i].cluster_back].push_back(i);
        const vis::Directed& d = directed[std::size_t{i} * 2];
        if (!d.has_plane) ++out.without_area;
        else
            for (const Vec3& v : out.portals[i].winding) out.flatness = std::max(out.flatness, std::abs(d.plane.at(v)));
        // 2i looks away from the side from which the winding is counter-clockwise.
        if (d.has_plane && !convex(out.portals[i].winding, -d.plane.normal, VisibilityOptions{}.epsilon) && out.not_convex++ == 0) out.first_not_convex = i;
    }
    std::uint64_t right = 0, wrong = 0;
    for (std::uint32_t i = 0; i < out.portals.size(); ++i)
        for (std::size_t side = 0; side < 2; ++side) { // directed 2i looks away from the front cluster
            const vis::Directed& d = directed[std::size_t{i} * 2 + side];
            if (!d.has_plane) continue;
            for (const std::uint32_t q : of_cluster[d.from]) {
                const double at = q == i ? 0 : d.plane.at(directed[std::size_t{q} * 2].center);
                if (at < -vis::kNoise) ++right;
                else if (at > vis::kNoise) ++wrong;
            }
        }
    out.turned = wrong > right;
    if (out.turned)
        for (VisPortal& p : out.portals) std::ranges::reverse(p.winding);
    return out;
}

VisibilitySummary summary(const Visibility& v, std::span<const std::uint32_t> leaf_cluster) {
    VisibilitySummary s;
    s.clusters = v.cluster_count;
    std::vector<std::uint64_t> weight(v.cluster_count, leaf_cluster.empty() ? 1 : 0); // leaves of each
    for (const std::uint32_t c : leaf_cluster)
        if (c < v.cluster_count) ++weight[c];
    std::uint64_t leaf_pairs = 0;
    const std::size_t words = v.words_per_row();
    for (std::uint32_t a = 0; a < v.cluster_count; ++a) {
        const std::uint64_t* row = v.rows.data() + a * words;
        const auto count = static_cast<std::uint32_t>(vis::count_bits(row, words));
        s.pairs += count;
        s.least = a == 0 ? count : std::min(s.least, count);
        s.most = std::max(s.most, count);
        s.leaves += static_cast<std::uint32_t>(weight[a]);
        std::uint64_t seen = 0;
        for (std::size_t w = 0; w < words; ++w) vis::each_bit(w, row[w], [&](std::uint32_t c) { seen += weight[c]; });
        leaf_pairs += seen * weight[a];
    }
    if (s.clusters) s.mean = static_cast<double>(s.pairs) / s.clusters;
    if (s.leaves) s.mean_leaves = static_cast<double>(leaf_pairs) / s.leaves;
    return s;
}

} // namespace kiln

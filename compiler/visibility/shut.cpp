#include "compiler/visibility/shut.h"
#include "compiler/visibility/directed.h"
#include "libs/core/union_find.h"
#include <algorithm>

namespace kiln {

using namespace vis;

namespace {

bool parts(const AreaPortal& p) { return p.areas[0] != 0 && p.areas[0] != p.areas[1]; }
// Areas with two portals whose other sides hang together without the area: only there a line may leave and come back.
std::vector<std::uint8_t> areas_with_ways_back(const Bsp& bsp) {
    std::vector<std::uint8_t> out(bsp.area_count + 1, 0);
    for (std::uint32_t a = 1; a <= bsp.area_count; ++a) {
        UnionFind beyond(bsp.area_count + 1);
        for (const AreaPortal& p : bsp.area_portals)
            if (parts(p) && p.areas[0] != a && p.areas[1] != a) beyond.join(p.areas[0], p.areas[1]);
        std::vector<std::uint8_t> led(bsp.area_count + 1, 0);
        for (const AreaPortal& p : bsp.area_portals) {
            if (!parts(p) || (p.areas[0] != a && p.areas[1] != a)) continue;
            const std::uint32_t other = beyond.find(p.areas[p.areas[0] == a]);
            if (led[other]++) out[a] = 1;
        }
    }
    return out;
}
bool in_portal(const BspLeaf& l) { return l.cluster.valid() && l.area == 0; }

} // namespace

std::vector<std::uint8_t> shut_leaves(const Csg& csg, const Bsp& bsp) {
    if (std::ranges::none_of(bsp.area_portals, parts)) return {};
    std::vector<std::uint8_t> out;
    for (const BspLeaf& l : bsp.leaves) out.push_back(in_portal(l));
    if (std::ranges::all_of(bsp.area_portals, parts)) return out;
    // A leaf of theirs lies wholly in the brush or wholly outside: a point within it tells.
    const std::vector<std::vector<PlanePolygon>> polytopes = leaf_polytopes(bsp);
    for (std::size_t l = 0; l < out.size(); ++l) {
        if (!out[l]) continue;
        Vec3 sum{};
        double n = 0;
        for (const PlanePolygon& face : polytopes[l])
            for (const Vec3& p : points(bsp.planes, face)) sum += p, ++n;
        for (const AreaPortal& p : bsp.area_portals)
            if (!parts(p) && std::ranges::all_of(csg.brushes[p.brush.at()].faces, [&](const PlanePolygon& f) { return dot(csg.planes.normal(f.support), sum / n) <= csg.planes.distance(f.support) + kNoise; })) out[l] = 0;
    }
    return out;
}

Result<std::vector<std::uint64_t>> shut_rows(const Bsp& bsp, std::span<const std::uint8_t> shut, const Visibility& open, bool flow, const VisibilityOptions& options, Context& context,
                                             const VisibilityRun& run) {
    const std::uint32_t n = bsp.cluster_count;
    const auto leaf_count = static_cast<std::uint32_t>(bsp.leaves.size());
    // Portals' leaves that hang together are looked into as one.
    UnionFind alleys(leaf_count);
    for (const BspPortal& p : bsp.portals)
        if (in_portal(bsp.leaves[p.leaf_front.at()]) && in_portal(bsp.leaves[p.leaf_back.at()])) alleys.join(p.leaf_front.value, p.leaf_back.value);
    std::vector<std::vector<std::uint32_t>> in_alley(leaf_count); // clusters, by the leaf that stands for the alley
    for (std::uint32_t l = 0; l < leaf_count; ++l)
        if (in_portal(bsp.leaves[l])) in_alley[alleys.find(l)].push_back(bsp.leaves[l].cluster.value);

    BitRows allowed(bsp.area_count + 1, n); // of each area: its clusters, and what hangs on it
    constexpr std::uint32_t kSeveral = UINT32_MAX, kNone = UINT32_MAX - 1;
    std::vector<std::uint32_t> area(n, kNone); // of each cluster
    for (const BspLeaf& l : bsp.leaves) {
        if (!l.cluster.valid()) continue;
        set_bit(allowed.row(l.area), l.cluster.value);
        std::uint32_t& a = area[l.cluster.at()];
        a = a == kNone || a == l.area ? l.area : kSeveral;
    }
    for (const BspPortal& p : bsp.portals)
        for (const auto& [one, other] : {std::pair{p.leaf_front, p.leaf_back}, std::pair{p.leaf_back, p.leaf_front}})
            if (!in_portal(bsp.leaves[one.at()]) && in_portal(bsp.leaves[other.at()]))
                for (const std::uint32_t c : in_alley[alleys.find(other.value)]) set_bit(allowed.row(bsp.leaves[one.at()].area), c);

    const std::vector<std::uint8_t> returns = areas_with_ways_back(bsp);
    const auto wanted = [&](const BspLeaf& l) { return l.area == 0 || returns[l.area]; };
    std::vector<VisPortal> portals;
    std::vector<std::uint32_t> alley; // of clusters beyond n: each such portal ends in one of its own
    for (const BspPortal& p : bsp.portals) {
        const BspLeaf &front = bsp.leaves[p.leaf_front.at()], &back = bsp.leaves[p.leaf_back.at()];
        if (front.cluster == back.cluster || (shut[p.leaf_front.at()] && shut[p.leaf_back.at()])) continue;
        const bool ends_front = shut[p.leaf_front.at()], ends_back = shut[p.leaf_back.at()];
        if ((!ends_front && !wanted(front)) || (!ends_back && !wanted(back))) continue;
        VisPortal q{front.cluster.value, back.cluster.value, p.winding};
        if (ends_front || ends_back) {
            (ends_front ? q.cluster_front : q.cluster_back) = n + static_cast<std::uint32_t>(alley.size());
            alley.push_back(alleys.find((ends_front ? p.leaf_front : p.leaf_back).value));
        }
        portals.push_back(std::move(q));
    }

    Visibility seen;
    flow = flow && std::ranges::any_of(returns, [](std::uint8_t r) { return r != 0; });
    if (flow) {
        auto found = compute_visibility(portals, n + static_cast<std::uint32_t>(alley.size()), options, context, run);
        if (!found) return found.fault();
        seen = *std::move(found);
    }
    std::vector<std::uint64_t> out = open.rows;
    const std::size_t words = open.words_per_row();
    for (std::uint32_t c = 0; c < n; ++c) {
        if (area[c] == 0 || area[c] >= kNone) continue;
        std::uint64_t* row = out.data() + c * words;
        std::vector<std::uint64_t> limit(allowed.row(area[c]), allowed.row(area[c]) + words);
        if (flow && returns[area[c]]) {
            std::vector<std::uint64_t> by_flow(words, 0);
            for (std::uint32_t x = 0; x < seen.cluster_count; ++x) {
                if (!seen.sees(c, x)) continue;
                if (x < n) set_bit(by_flow.data(), x);
                else
                    for (const std::uint32_t d : in_alley[alley[x - n]]) set_bit(by_flow.data(), d);
            }
            for (std::size_t w = 0; w < words; ++w) limit[w] &= by_flow[w];
        }
        for (std::size_t w = 0; w < words; ++w) row[w] &= limit[w];
    }
    return out;
}

} // namespace kiln

// Where the only probe of a map stands, if its author gave none: in the region that holds a player start (else the
// largest), at a leaf's middle that is far from walls and near the middle of the region.
#include "compiler/probes/probe_scene.h"
#include "libs/core/union_find.h"

namespace kiln::probes {

namespace {

double volume(const Box3& b) {
    return b.empty() ? 0 : b.size().x * b.size().y * b.size().z;
}

// Leaves that portals join, numbered by their first leaf.
std::vector<std::uint32_t> regions(const Bsp& bsp) {
    UnionFind joined(bsp.leaves.size());
    for (const BspPortal& p : bsp.portals) joined.join(p.leaf_front.value, p.leaf_back.value);
    std::vector<std::uint32_t> out(bsp.leaves.size());
    for (std::uint32_t l = 0; l < out.size(); ++l) out[l] = joined.find(l);
    return out;
}

double free_distance(const ProbeScene& scene, Vec3 p, double most) {
    double least = most;
    for (int x = -1; x <= 1; ++x)
        for (int y = -1; y <= 1; ++y)
            for (int z = -1; z <= 1; ++z) {
                if (!x && !y && !z) continue;
                const auto hit = scene.closest(p, normalize(Vec3{double(x), double(y), double(z)}));
                if (hit && hit->back) return 0; // within a detail brush
                if (hit) least = std::min(least, hit->distance);
            }
    return least;
}

} // namespace

std::optional<Vec3> default_place(const World& world, const Bsp& bsp, const PlaneTable& planes, const ProbeScene& scene) {
    const std::vector<std::uint32_t> region = regions(bsp);
    std::vector<double> size(bsp.leaves.size(), 0);
    bool any = false;
    for (std::uint32_t l = 0; l < bsp.leaves.size(); ++l)
        if (is_open(bsp.leaves[l])) size[region[l]] += volume(bsp.leaves[l].bounds), any = true;
    if (!any) return std::nullopt;
    std::uint32_t chosen = UINT32_MAX;
    for (const WorldEntity& e : world.entities) {
        if (!e.has_origin || !e.get("classname").starts_with("info_player")) continue;
        const LeafId leaf = leaf_at(bsp, planes, e.origin);
        if (leaf.valid() && is_open(bsp.leaves[leaf.at()])) {
            chosen = region[leaf.at()];
            break;
        }
    }
    if (chosen == UINT32_MAX) chosen = static_cast<std::uint32_t>(std::max_element(size.begin(), size.end()) - size.begin());
    Vec3 middle{};
    double weight = 0;
    for (std::uint32_t l = 0; l < bsp.leaves.size(); ++l) {
        if (region[l] != chosen || !is_open(bsp.leaves[l]) || bsp.leaves[l].bounds.empty()) continue;
        const double v = volume(bsp.leaves[l].bounds);
        middle += bsp.leaves[l].bounds.center() * v, weight += v;
    }
    if (weight > 0) middle = middle / weight;
    constexpr double kMost = 512;     // map units: more room than this is no better
    constexpr double kPull = 0.25;    // units of room given up for a unit nearer to the middle
    std::optional<Vec3> best;
    double best_score = -1e300;
    const auto consider = [&](Vec3 p) {
        const LeafId leaf = leaf_at(bsp, planes, p);
        if (!leaf.valid() || region[leaf.at()] != chosen || !is_open(bsp.leaves[leaf.at()])) return;
        const double score_at_most = kMost - kPull * length(p - middle);
        if (score_at_most <= best_score) return;
        const double room = free_distance(scene, p, kMost);
        const double score = (room > 0 ? room : -kMost) - kPull * length(p - middle);
        if (score > best_score) best_score = score, best = p;
    };
    consider(middle);
    for (const BspLeaf& leaf : bsp.leaves)
        if (is_open(leaf) && !leaf.bounds.empty()) consider(leaf.bounds.center());
    for (double step = 64; best && step >= 8; step /= 2) // climb
        for (int round = 0; round < 4; ++round) {
            const Vec3 at = *best;
            for (std::size_t a = 0; a < 6; ++a) {
                Vec3 p = at;
                p[a / 2] += a % 2 ? -step : step;
                consider(p);
            }
            if (*best == at) break;
        }
    return best;
}

} // namespace kiln::probes

#include "compiler/light/spots.h"
#include "compiler/light/bake.h"
#include "compiler/light/halving.h"
#include "libs/parallel/parallel.h"
#include <numbers>
#include <numeric>

namespace kiln {
namespace {
constexpr double kStandsOut = 16; // times the mean radiance that a place sees
// Share of the irradiance times how far it stands out: the relative variance that it would give one ray that knows nothing of it.
constexpr double kLeast = 0.25;
constexpr double kSmall = 0.04; // radius over distance: half of a guide's cell
constexpr double kSteps = 4;    // of shares, an octave: a little more light changes nothing
constexpr std::uint32_t kGroup = 32;

double half_diagonal(const Patch& patch) { // of a square
    return std::sqrt(patch.area / 2);
}
} // namespace

struct SpotTrees::View {
    Vec3 point;
    double reach = 0; // all places within that
    Vec3 normal;
    double height = 0; // places lie lower than that above the point, along the normal
    double irradiance = 0;
};

// small(node): is it to be looked into?
void SpotTrees::walk(std::span<const std::uint32_t> from, const View& view, const auto& small) const {
    const double stands_out = kStandsOut * view.irradiance / std::numbers::pi, least = kLeast * view.irradiance * view.irradiance / std::numbers::pi;
    thread_local std::vector<std::uint32_t> todo;
    todo.assign(from.begin(), from.end());
    while (!todo.empty()) {
        const std::uint32_t id = todo.back();
        todo.pop_back();
        const Node& node = nodes_[id];
        const Sum& light = sums_[id];
        if (!(static_cast<double>(light.most) >= stands_out)) continue;
        const Vec3 to = static_cast<Vec3>(node.center) - view.point;
        const double distance = length(to), radius = node.radius, near = distance - radius - view.reach;
        if (dot(to, view.normal) + radius + view.height <= 0) continue;
        if (near > 0 && static_cast<double>(light.flux) * static_cast<double>(light.most) < least * near * near) continue;
        if (radius < kSmall * (distance + view.reach) && !small(id)) continue;
        if (node.second) todo.push_back(id + 1), todo.push_back(node.second);
    }
}

SpotTrees::SpotTrees(std::span<const Patch> patches, std::span<const Vec3> normals, std::span<const std::uint32_t> place) {
    order_.resize(patches.size());
    std::iota(order_.begin(), order_.end(), 0u);
    std::ranges::stable_sort(order_, {}, [&](std::uint32_t p) { return place[p]; });
    Box3 all;
    for (std::size_t p = 0; p < patches.size(); ++p) all.add(patches[p].centroid), facing_.push_back(static_cast<Vec3f>(normals[p] * static_cast<double>(patches[p].area)));
    nodes_.reserve(2 * patches.size()), area_.reserve(2 * patches.size());
    for (std::size_t begin = 0, end = 0; begin < order_.size(); begin = end) {
        while (end < order_.size() && place[order_[end]] == place[order_[begin]]) ++end;
        roots_.push_back(build(std::span(order_).subspan(begin, end - begin), patches, normals, normal_scale(all)));
    }
}

std::uint32_t SpotTrees::build(std::span<std::uint32_t> part, std::span<const Patch> patches, std::span<const Vec3> normals, double scale) {
    const auto id = static_cast<std::uint32_t>(nodes_.size());
    const auto first = static_cast<std::uint32_t>(part.data() - order_.data());
    Box3 box;
    for (const std::uint32_t i : part) box.add(patches[i].centroid);
    double area = 0, radius = 0;
    for (const std::uint32_t i : part) {
        area += patches[i].area, radius = std::max(radius, length(patches[i].centroid - box.center()) + half_diagonal(patches[i]));
    }
    const Node node{static_cast<Vec3f>(box.center()), static_cast<float>(radius), first, static_cast<std::uint32_t>(part.size())};
    const bool in_group = !groups_.empty() && nodes_[groups_.back()].first + nodes_[groups_.back()].count > first;
    nodes_.push_back(node), area_.push_back(static_cast<float>(area));
    if (!in_group && node.count <= kGroup) groups_.push_back(id);
    if (part.size() == 1) return id;
    const auto halves = halved(part, [&](std::uint32_t i, std::size_t k) { return k < 3 ? patches[i].centroid[k] : normals[i][k - 3] * scale; });
    build(halves[0], patches, normals, scale);
    const std::uint32_t second = build(halves[1], patches, normals, scale);
    nodes_[id].second = second;
    return id;
}

void SpotTrees::shine(std::span<const double> radiance) {
    sums_.resize(nodes_.size());
    for (std::size_t id = nodes_.size(); id-- > 0;) { // children before their node
        const Node& node = nodes_[id];
        if (!node.second) {
            const std::uint32_t p = order_[node.first];
            const auto r = static_cast<float>(radiance[p]);
            sums_[id] = {facing_[p] * r, area_[id] * r, r, p};
            continue;
        }
        const Sum &a = sums_[id + 1], &b = sums_[node.second];
        sums_[id] = {a.along + b.along, a.flux + b.flux, std::max(a.most, b.most), a.most >= b.most ? a.brightest : b.brightest};
    }
}

void SpotTrees::may_be_spots(std::size_t g, std::span<const std::uint32_t> trees, double least_irradiance, std::vector<std::uint32_t>& out) const {
    out.clear();
    const Node& group = nodes_[groups_[g]];
    const auto whole = [&](std::uint32_t id) {
        out.push_back(id);
        return false;
    };
    thread_local std::vector<std::uint32_t> roots;
    roots.clear();
    for (const std::uint32_t t : trees) roots.push_back(roots_[t]);
    walk(roots, {.point = static_cast<Vec3>(group.center), .reach = group.radius, .normal = {}, .height = group.radius, .irradiance = least_irradiance}, whole);
}

void SpotTrees::find(std::span<const std::uint32_t> may, Vec3 point, Vec3 normal, double irradiance, std::vector<Spot>& out) const {
    out.clear();
    const auto look = [&](std::uint32_t id) {
        const Node& node = nodes_[id];
        const Sum& light = sums_[id];
        const Vec3 center = static_cast<Vec3>(node.center), to = center - point;
        const double height = dot(to, normal), there = -dot(static_cast<Vec3>(light.along), to), square = dot(to, to);
        const double share = there * height / (square * square * irradiance);
        const double stands_out = static_cast<double>(light.flux) * std::numbers::pi / (static_cast<double>(area_[id]) * irradiance);
        if (!(height > 0) || !(there > 0) || !(stands_out >= kStandsOut) || !(share * stands_out >= kLeast)) return true; // parts of it may
        out.push_back({center, node.radius, std::exp2(std::round(kSteps * std::log2(share)) / kSteps), light.brightest});
        return false;
    };
    walk(may, {.point = point, .normal = normal, .irradiance = irradiance}, look);
    std::ranges::sort(out, [](const Spot& a, const Spot& b) { return a.share > b.share || (a.share == b.share && a.patch < b.patch); });
}

Clusters Bake::clusters_of(std::span<const std::uint32_t> patches) const {
    Together all;
    for (const std::uint32_t p : patches) all.add(clusters_[p]);
    return all.clusters();
}

void Bake::plant_spot_trees() {
    std::vector<Vec3> normals;
    std::vector<std::uint32_t> place;
    for (std::size_t p = 0; p < patches_.patches.size(); ++p) normals.push_back(surfaces_.faces[patches_.patches[p].face.at()].normal), place.push_back(clusters_[p].empty() ? UINT32_MAX : clusters_[p][0]);
    spot_trees_ = SpotTrees(patches_.patches, normals, place);
    std::vector<Clusters> from;
    for (std::size_t t = 0; t < spot_trees_.trees(); ++t) from.push_back(clusters_of(spot_trees_.tree(t)));
    spot_sources_ = sight_.sources(from);
}

// What is small and bright from the middle of each patch.
void Bake::find_spots() {
    constexpr std::size_t kMost = 16;  // of a patch: each costs every ray of it a little
    constexpr std::size_t kAsked = 64; // the strongest
    struct Seen {
        std::uint32_t patch;
        Spot spot;
    };
    spot_trees_.shine(bright_);
    const auto irradiance = [&](std::uint32_t p) { return std::max(mean(rest_[p] + solved_direct_[p]), floor_); };
    // On a curve the guide is of many planes.
    const auto looks = [&](std::uint32_t p) { return !covered_[p] && !luxels_of(p).empty() && irradiance(p) > 0 && !surfaces_.charts[surfaces_.faces[patches_.patches[p].face.at()].chart.at()].curved(); };
    const auto normal = [&](std::uint32_t p) { return surfaces_.faces[patches_.patches[p].face.at()].normal; };
    const auto before = [&](std::uint32_t p) { return patches_.patches[p].centroid + normal(p) * scene_.push_off(); };
    constexpr std::size_t kGroups = 16;
    std::vector<std::vector<Seen>> slots(slots_of(spot_trees_.groups(), kGroups));
    parallel_chunks(context_, spot_trees_.groups(), kGroups, [&](std::size_t begin, std::size_t end) {
        std::vector<std::uint32_t> trees, may;
        std::vector<Spot> spots;
        for (std::size_t g = begin; g < end; ++g) {
            double least = 1e300;
            for (const std::uint32_t p : spot_trees_.group(g))
                if (looks(p)) least = std::min(least, irradiance(p));
            if (least == 1e300) continue;
            trees.clear();
            sight_.each(spot_sources_, clusters_of(spot_trees_.group(g)), [&](std::uint32_t t) { trees.push_back(t); });
            spot_trees_.may_be_spots(g, trees, least, may);
            for (const std::uint32_t p : spot_trees_.group(g)) {
                if (may.empty() || !looks(p)) continue;
                const Vec3 from = before(p);
                spot_trees_.find(may, from, normal(p), irradiance(p), spots);
                std::size_t seen = 0, asked = 0;
                for (; asked < std::min(spots.size(), kAsked) && seen < kMost; ++asked)
                    if (!scene_.occluded(from, before(spots[asked].patch))) slots[begin / kGroups].push_back({p, spots[asked]}), ++seen;
                shadow_rays_ += asked;
            }
        }
    });
    const std::vector<Seen> found = joined(slots);
    spots_.clear();
    for (const Seen& f : found) spots_.push_back(f.spot);
    patch_spots_ = Grouped(patches_.patches.size(), [&](const auto& add) {
        for (std::uint32_t i = 0; i < found.size(); ++i) add(found[i].patch, i);
    });
}

// As anything on the patch sees them.
void Bake::add_spots(std::uint32_t p, Guide* guide) const {
    if (patch_spots_[p].empty()) return;
    const Patch& patch = patches_.patches[p];
    const Face& face = surfaces_.faces[patch.face.at()];
    const HemisphereMap map = map_of(face.chart);
    const Frame frame = frame_around(surfaces_.charts[face.chart.at()].n);
    double all = 0;
    for (const std::uint32_t i : patch_spots_[p]) all += spots_[i].share;
    for (const std::uint32_t i : patch_spots_[p]) {
        const Spot& s = spots_[i];
        const Vec3 to = s.center - patch.centroid;
        const Frame around = frame_around(normalize(to));
        const double radius = s.radius + half_diagonal(patch);
        constexpr int kRim = 8;
        Vec2 lo{1, 1}, hi{0, 0};
        for (int k = 0; k < kRim; ++k) {
            const SinCos turn = sincos_turns(static_cast<double>(k) / kRim);
            const Vec2 at = map.square(frame.local(normalize(to + (around.t * turn.cos + around.b * turn.sin) * radius)));
            lo = {std::min(lo.x, at.x), std::min(lo.y, at.y)}, hi = {std::max(hi.x, at.x), std::max(hi.y, at.y)};
        }
        if (hi.x > lo.x && hi.y > lo.y) guide->add_spot(lo, hi, (1 - Guide::kUniformShare) * s.share / std::max(1.0, all));
    }
}

} // namespace kiln

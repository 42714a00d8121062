// Which plane divides a node best. Only the choice is made in doubles: whatever it is, the tree is right.
#include "compiler/bsp/build.h"
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <tuple>

namespace kiln::bsp {
namespace {

// Every plane of small nodes is tried; of large ones those with most area in them and, on each axis, those nearest
// to the middle: the first are what levels are laid out along, the others keep the depth logarithmic.
constexpr std::size_t kTryAll = 48;
constexpr std::size_t kByArea = 24, kNearMiddle = 8;

// A cut polygon costs most, then planes that settle few polygons; evenness matters least. Of the weights tried on seven
// levels (NOTES.md) these gave the fewest portals; the classic 5 : 1 : 5 gives 15 to 20 % more.
constexpr double kCutCost = 20, kUnevenCost = 0.5, kInPlaneGain = 5, kAxialGain = 5;
constexpr double kTranslucentCost = 500; // after what hides

constexpr double kFlat = 0.01; // map units: a box this little across a plane is not counted as cut by it

constexpr std::size_t kSloping = 3;
std::size_t axis_of(Vec3 n) { return std::abs(n.x) == 1 ? 0 : std::abs(n.y) == 1 ? 1 : std::abs(n.z) == 1 ? 2 : kSloping; }

// Two at a time: the loop over all items of a node for each of its planes is most of the choice.
using Real = double __attribute__((vector_size(16)));
using Whole = std::int64_t __attribute__((vector_size(16)));
Real load(const double* at) {
    Real r;
    std::memcpy(&r, at, sizeof r);
    return r;
}

} // namespace

SplitterChooser::SplitterChooser(const Space& space) : space_(space), candidate_of_(space.planes.planes.size() / 2, UINT32_MAX) {}

// Gives up on a plane that is certain to come to `least` or more.
SplitterChooser::Score SplitterChooser::score(std::span<const SplitterItem> items, const Candidate& c, double least) const {
    const Splitter& q = space_.splitter(c.plane);
    const Vec3 n = q.normal;
    const double d = q.distance;
    const Vec3 m{std::abs(n.x), std::abs(n.y), std::abs(n.z)};
    const std::size_t k = axis_of(n);
    const bool axial = k != kSloping;
    double fixed = -kInPlaneGain * static_cast<double>(c.count);
    if (axial) fixed -= kAxialGain;
    if (c.kind == SplitterItem::translucent) fixed += kTranslucentCost;
    const std::size_t count = items.size();
    Score s;
    Whole fronts{}, backs{}, cuts{};
    std::size_t i = 0;
    if (axial) {
        const double above = n[k] * d + kFlat, below = n[k] * d - kFlat;
        const double *lo = lo_[k].data(), *hi = hi_[k].data();
        for (; i + 2 <= count; i += 2) { // what lies in the plane is neither
            const Whole o = load(hi + i) > above, u = load(lo + i) < below; // -1: true
            fronts -= o, backs -= u, cuts -= o & u;
            if ((i & 254) == 254 && kCutCost * static_cast<double>(cuts[0] + cuts[1]) + fixed >= least) return {};
        }
        for (; i < count; ++i) {
            const bool o = hi[i] > above, u = lo[i] < below;
            fronts[0] += o, backs[0] += u, cuts[0] += o && u;
        }
        for (const std::uint32_t h : hints_) s.cuts_hint = s.cuts_hint || (hi[h] > above && lo[h] < below);
    } else {
        const auto look_closer = [&](std::size_t at) { // where the box, which is only a bound here, is on both sides
            if (same_plane(items[at].poly.support, c.plane)) return;
            bool before = false, behind = false;
            for (const Corner& corner : items[at].poly.corners()) {
                const double e = dot(n, corner.point) - d;
                before = before || e > kFlat, behind = behind || e < -kFlat;
            }
            fronts[0] += before, backs[0] += behind, cuts[0] += before && behind;
            if (before && behind && items[at].kind == SplitterItem::hint) s.cuts_hint = true;
        };
        const auto at_of = [&](auto x, auto y, auto z) { return (n.x * x + n.y * y + n.z * z) * 0.5 - d; };
        const auto reach_of = [&](auto x, auto y, auto z) { return (m.x * x + m.y * y + m.z * z) * 0.5 - kFlat; };
        for (; i + 2 <= count; i += 2) {
            const Real at = at_of(load(&sum_[0][i]), load(&sum_[1][i]), load(&sum_[2][i]));
            const Real reach = reach_of(load(&size_[0][i]), load(&size_[1][i]), load(&size_[2][i]));
            const Whole before = at + reach > 0, behind = at - reach < 0, both = before & behind;
            fronts -= before & ~both, backs -= behind & ~both;
            if ((both[0] | both[1]) == 0) continue;
            if (both[0]) look_closer(i);
            if (both[1]) look_closer(i + 1);
            if (kCutCost * static_cast<double>(cuts[0]) + fixed >= least) return {};
        }
        for (; i < count; ++i) {
            const double at = at_of(sum_[0][i], sum_[1][i], sum_[2][i]), reach = reach_of(size_[0][i], size_[1][i], size_[2][i]);
            const bool before = at + reach > 0, behind = at - reach < 0;
            if (before && behind) look_closer(i);
            else fronts[0] += before, backs[0] += behind;
        }
    }
    const auto cut = static_cast<double>(cuts[0] + cuts[1]), front = static_cast<double>(fronts[0] + fronts[1]), back = static_cast<double>(backs[0] + backs[1]);
    s.value = kCutCost * cut + kUnevenCost * std::abs(front - back) + fixed;
    return s;
}

// Into all_; of many planes those to be tried.
void SplitterChooser::find_candidates(std::span<const SplitterItem> items, const Box3& region) {
    all_.clear();
    for (std::uint32_t i = 0; i < items.size(); ++i) {
        const SplitterItem& item = items[i];
        const PlaneId plane{item.poly.support.value & ~1u};
        std::uint32_t& slot = candidate_of_[plane.value / 2];
        if (slot == UINT32_MAX) {
            slot = static_cast<std::uint32_t>(all_.size());
            all_.push_back({plane, i, 0, 0, item.kind});
        }
        Candidate& c = all_[slot];
        // A plane is what the first of its hints is, or else the first of its strongest kind.
        const auto rank = [](SplitterItem::Kind kind) { return std::tuple(kind != SplitterItem::hint, kind); };
        if (rank(item.kind) < rank(c.kind)) c.item = i, c.kind = item.kind;
        ++c.count, c.area += item.area;
    }
    for (const Candidate& c : all_) candidate_of_[c.plane.value / 2] = UINT32_MAX;
    std::ranges::sort(all_, {}, &Candidate::plane);
    if (all_.size() <= kTryAll) return;

    std::vector<Candidate> few;
    std::vector<bool> taken(all_.size());
    const auto take = [&](std::size_t i) {
        if (!taken[i]) taken[i] = true, few.push_back(all_[i]);
    };
    std::vector<std::size_t> order(all_.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
        order[i] = i;
        if (all_[i].kind == SplitterItem::hint) take(i);
    }
    std::partial_sort(order.begin(), order.begin() + kByArea, order.end(),
                      [&](auto a, auto b) { return all_[a].area != all_[b].area ? all_[a].area > all_[b].area : a < b; });
    for (std::size_t i = 0; i < kByArea; ++i) take(order[i]);
    std::vector<std::pair<double, std::size_t>> along[3];
    for (std::size_t i = 0; i < all_.size(); ++i) {
        const Splitter& q = space_.splitter(all_[i].plane);
        const std::size_t axis = axis_of(q.normal);
        if (axis == kSloping) continue;
        along[axis].emplace_back(std::abs(q.distance * q.normal[axis] - region.center()[axis]), i);
    }
    for (auto& one : along) {
        const std::size_t count = std::min(kNearMiddle, one.size());
        std::partial_sort(one.begin(), one.begin() + static_cast<std::ptrdiff_t>(count), one.end());
        for (std::size_t i = 0; i < count; ++i) take(one[i].second);
    }
    all_.swap(few);
}

std::size_t SplitterChooser::choose(std::span<const SplitterItem> items, const Box3& region) {
    find_candidates(items, region);
    if (all_.size() == 1) return all_[0].item;
    hints_.clear();
    for (std::size_t k = 0; k < 3; ++k)
        for (auto* of : {&lo_[k], &hi_[k], &sum_[k], &size_[k]})
            if (of->size() < items.size()) of->resize(items.size());
    const bool sloping = std::ranges::any_of(all_, [&](const Candidate& c) { return axis_of(space_.splitter(c.plane).normal) == kSloping; });
    for (std::uint32_t i = 0; i < items.size(); ++i) {
        const Box3& box = items[i].poly.box;
        for (std::size_t k = 0; k < 3; ++k) lo_[k][i] = box.lo[k], hi_[k][i] = box.hi[k];
        if (sloping)
            for (std::size_t k = 0; k < 3; ++k) sum_[k][i] = box.lo[k] + box.hi[k], size_[k][i] = box.hi[k] - box.lo[k];
        if (items[i].kind == SplitterItem::hint) hints_.push_back(i);
    }
    std::size_t best = 0;
    std::pair<bool, double> least{true, std::numeric_limits<double>::infinity()};
    for (const Candidate& c : all_) {
        const Score s = score(items, c, least.first ? std::numeric_limits<double>::infinity() : least.second);
        // A hint polygon is cut by nothing but another hint: it says where a level is to be divided.
        const std::pair<bool, double> now{s.cuts_hint && c.kind != SplitterItem::hint, s.value};
        if (now < least) least = now, best = c.item;
    }
    return best;
}

} // namespace kiln::bsp

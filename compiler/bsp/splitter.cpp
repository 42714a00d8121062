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

// Two at a time: the loop over all items of a node for each of its planes is most of the choice.
using Real = double __attribute__((vector_size(16)));
using Whole = std::int64_t __attribute__((vector_size(16)));

} // namespace

SplitterChooser::SplitterChooser(const Space& space) : space_(space), candidate_of_(space.planes.planes.size() / 2, UINT32_MAX) {}

SplitterChooser::Score SplitterChooser::score(std::span<const SplitterItem> items, const Candidate& c) const {
    const Splitter& q = space_.splitter(c.plane);
    const Vec3 n = q.normal;
    const double d = q.distance;
    const Vec3 m{std::abs(n.x), std::abs(n.y), std::abs(n.z)};
    const bool axial = m.x == 1 || m.y == 1 || m.z == 1;
    Score s;
    std::size_t front = 0, back = 0, cut = 0;
    if (axial) {
        const std::size_t k = m.x == 1 ? 0 : m.y == 1 ? 1 : 2;
        const double above = n[k] * d + kFlat, below = n[k] * d - kFlat;
        const double *lo = lo_[k].data(), *hi = hi_[k].data();
        std::size_t i = 0;
        const std::size_t count = items.size();
        Whole overs{}, unders{}, acrosses{}; // what lies in the plane is neither
        for (; i + 2 <= count; i += 2) {
            Real l, h;
            std::memcpy(&l, lo + i, sizeof l), std::memcpy(&h, hi + i, sizeof h);
            const Whole o = h > above, u = l < below; // -1: true
            overs -= o, unders -= u, acrosses -= o & u;
        }
        for (; i < count; ++i) {
            const bool o = hi[i] > above, u = lo[i] < below;
            overs[0] += o, unders[0] += u, acrosses[0] += o && u;
        }
        front = static_cast<std::size_t>(overs[0] + overs[1]), back = static_cast<std::size_t>(unders[0] + unders[1]);
        cut = static_cast<std::size_t>(acrosses[0] + acrosses[1]);
        for (const std::uint32_t h : hints_) s.cuts_hint = s.cuts_hint || (hi[h] > above && lo[h] < below);
    } else {
        for (std::size_t i = 0; i < items.size(); ++i) {
            const double at = 0.5 * (n.x * (lo_[0][i] + hi_[0][i]) + n.y * (lo_[1][i] + hi_[1][i]) + n.z * (lo_[2][i] + hi_[2][i])) - d;
            const double reach = 0.5 * (m.x * (hi_[0][i] - lo_[0][i]) + m.y * (hi_[1][i] - lo_[1][i]) + m.z * (hi_[2][i] - lo_[2][i])) - kFlat;
            bool before = at + reach > 0, behind = at - reach < 0;
            if (before && behind) { // the box is only a bound here
                if (same_plane(items[i].poly.support, c.plane)) continue;
                before = behind = false;
                for (const Corner& corner : items[i].poly.corners()) {
                    const double e = dot(n, corner.point) - d;
                    before = before || e > kFlat, behind = behind || e < -kFlat;
                }
            }
            front += before, back += behind;
            if (before && behind) {
                ++cut;
                if (items[i].kind == SplitterItem::hint) s.cuts_hint = true;
            }
        }
    }
    const double unbalanced = std::abs(static_cast<double>(front) - static_cast<double>(back));
    s.value = kCutCost * static_cast<double>(cut) + kUnevenCost * unbalanced - kInPlaneGain * static_cast<double>(c.count);
    if (axial) s.value -= kAxialGain;
    if (c.kind == SplitterItem::translucent) s.value += kTranslucentCost;
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
        const std::size_t axis = std::abs(q.normal.x) == 1 ? 0 : std::abs(q.normal.y) == 1 ? 1 : std::abs(q.normal.z) == 1 ? 2 : 3;
        if (axis == 3) continue;
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
    for (std::size_t k = 0; k < 3; ++k) lo_[k].resize(items.size()), hi_[k].resize(items.size());
    for (std::uint32_t i = 0; i < items.size(); ++i) {
        const Box3& box = items[i].poly.box;
        lo_[0][i] = box.lo.x, lo_[1][i] = box.lo.y, lo_[2][i] = box.lo.z;
        hi_[0][i] = box.hi.x, hi_[1][i] = box.hi.y, hi_[2][i] = box.hi.z;
        if (items[i].kind == SplitterItem::hint) hints_.push_back(i);
    }
    std::size_t best = 0;
    std::pair<bool, double> least{true, std::numeric_limits<double>::infinity()};
    for (const Candidate& c : all_) {
        const Score s = score(items, c);
        // A hint polygon is cut by nothing but another hint: it says where a level is to be divided.
        const std::pair<bool, double> now{s.cuts_hint && c.kind != SplitterItem::hint, s.value};
        if (now < least) least = now, best = c.item;
    }
    return best;
}

} // namespace kiln::bsp

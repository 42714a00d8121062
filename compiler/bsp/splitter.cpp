// Which plane divides a node best. Only the choice is made in doubles: whatever it is, the tree is right.
#include "compiler/bsp/build.h"
#include <algorithm>
#include <cmath>
#include <limits>

namespace kiln::bsp {
namespace {

struct Candidate {
    PlaneId plane; // even id
    std::uint32_t item = 0;
    double area = 0;      // of the items that lie in it
    SplitterItem::Kind kind = SplitterItem::structural;
};

// Every plane of small nodes is tried; of large ones those with most area in them and, on each axis, those nearest
// to the middle: the first are what levels are laid out along, the others keep the depth logarithmic.
constexpr std::size_t kTryAll = 48;
constexpr std::size_t kByArea = 24, kNearMiddle = 8;

// A cut polygon costs most, then planes that settle few polygons; evenness matters least. Of the weights tried on seven
// levels (NOTES.md) these gave the fewest portals; the classic 5 : 1 : 5 gives 15 to 20 % more.
constexpr double kCutCost = 20, kUnevenCost = 0.5, kInPlaneGain = 5, kAxialGain = 5;
constexpr double kTranslucentCost = 500; // after what hides

constexpr double kFlat = 0.01; // map units: a box this little across a plane is not counted as cut by it

struct Score {
    double value = std::numeric_limits<double>::infinity(); // less is better
    bool cuts_hint = false;
};

Score score(const std::vector<SplitterItem>& items, const Candidate& c, const PlaneTable& planes) {
    const Vec3 n = planes.normal(c.plane);
    const double d = planes.distance(c.plane);
    const Vec3 m{std::abs(n.x), std::abs(n.y), std::abs(n.z)};
    const bool axial = m.x == 1 || m.y == 1 || m.z == 1;
    std::size_t front = 0, back = 0, cut = 0, in = 0;
    Score s;
    for (const SplitterItem& item : items) {
        if (same_plane(item.poly.polygon.support, c.plane)) {
            ++in;
            continue;
        }
        const double at = dot(n, item.poly.box.center()) - d;
        const double reach = dot(m, item.poly.box.size()) * 0.5 - kFlat;
        bool before = at + reach > 0, behind = at - reach < 0;
        if (before && behind && !axial) { // the box is only a bound here
            before = behind = false;
            for (const Vec3& p : item.poly.points) {
                const double e = dot(n, p) - d;
                before = before || e > kFlat, behind = behind || e < -kFlat;
            }
        }
        front += before, back += behind;
        if (before && behind) {
            ++cut;
            if (item.kind == SplitterItem::hint) s.cuts_hint = true;
        }
    }
    const double unbalanced = std::abs(static_cast<double>(front) - static_cast<double>(back));
    s.value = kCutCost * static_cast<double>(cut) + kUnevenCost * unbalanced - kInPlaneGain * static_cast<double>(in);
    if (axial) s.value -= kAxialGain;
    if (c.kind == SplitterItem::translucent) s.value += kTranslucentCost;
    return s;
}

std::vector<Candidate> candidates(const std::vector<SplitterItem>& items, const PlaneTable& planes, const Box3& region) {
    std::vector<Candidate> all(items.size());
    for (std::size_t i = 0; i < items.size(); ++i)
        all[i] = {PlaneId{items[i].poly.polygon.support.value & ~1u}, static_cast<std::uint32_t>(i),
                  area(items[i].poly.points), items[i].kind};
    std::ranges::sort(all, [](const Candidate& a, const Candidate& b) {
        return std::tuple(a.plane, a.kind != SplitterItem::hint, a.kind, a.item) <
               std::tuple(b.plane, b.kind != SplitterItem::hint, b.kind, b.item);
    });
    std::vector<Candidate> planes_once;
    for (const Candidate& c : all) {
        if (!planes_once.empty() && planes_once.back().plane == c.plane) planes_once.back().area += c.area;
        else planes_once.push_back(c);
    }
    if (planes_once.size() <= kTryAll) return planes_once;
    std::vector<Candidate> few;
    std::vector<bool> taken(planes_once.size());
    const auto take = [&](std::size_t i) {
        if (!taken[i]) taken[i] = true, few.push_back(planes_once[i]);
    };
    std::vector<std::size_t> order(planes_once.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
        order[i] = i;
        if (planes_once[i].kind == SplitterItem::hint) take(i);
    }
    std::ranges::stable_sort(order, [&](auto a, auto b) { return planes_once[a].area > planes_once[b].area; });
    for (std::size_t i = 0; i < kByArea; ++i) take(order[i]);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        std::vector<std::pair<double, std::size_t>> along;
        for (std::size_t i = 0; i < planes_once.size(); ++i)
            if (const Vec3 n = planes.normal(planes_once[i].plane); std::abs(n[axis]) == 1)
                along.emplace_back(std::abs(planes.distance(planes_once[i].plane) * n[axis] - region.center()[axis]), i);
        const std::size_t count = std::min(kNearMiddle, along.size());
        std::partial_sort(along.begin(), along.begin() + static_cast<std::ptrdiff_t>(count), along.end());
        for (std::size_t i = 0; i < count; ++i) take(along[i].second);
    }
    return few;
}

} // namespace

std::size_t choose_splitter(const PlaneTable& planes, const std::vector<SplitterItem>& items, const Box3& region) {
    std::size_t best = 0;
    std::pair<bool, double> least{true, std::numeric_limits<double>::infinity()};
    for (const Candidate& c : candidates(items, planes, region)) {
        const Score s = score(items, c, planes);
        // A hint polygon is cut by nothing but another hint: it says where a level is to be divided.
        const std::pair<bool, double> now{s.cuts_hint && c.kind != SplitterItem::hint, s.value};
        if (now < least) least = now, best = c.item;
    }
    return best;
}

} // namespace kiln::bsp

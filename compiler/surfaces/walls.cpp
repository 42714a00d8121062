#include "compiler/surfaces/walls.h"
#include "compiler/csg/box_tree.h"
#include "compiler/surfaces/charts.h"
#include "libs/core/union_find.h"
#include <algorithm>
#include <cmath>
#include <set>
#include <span>
#include <tuple>

namespace kiln {
namespace {

constexpr double kSame = 1e-6; // luxels: what rounding may set two edges of one line apart by
constexpr double kReads = 1;   // texels from its centre up to which one is read
constexpr double kRound = 4;   // texels from its centre within which a way from side to side makes them one

struct Window { // an open square
    Vec2 middle;
    double half;
};
double at(Vec2 p, int axis) { return axis == 0 ? p.x : p.y; }

// The part of a segment in an open square is longer than nothing.
bool enters(Vec2 a, Vec2 b, const Window& w) {
    double from = 0, to = 1;
    for (int k = 0; k < 2; ++k) {
        const double lo = at(w.middle, k) - w.half, hi = at(w.middle, k) + w.half, p = at(a, k), d = at(b, k) - p;
        if (std::abs(d) < kSame) {
            if (p <= lo + kSame || p >= hi - kSame) return false;
            continue;
        }
        from = std::max(from, ((d > 0 ? lo : hi) - p) / d), to = std::min(to, ((d > 0 ? hi : lo) - p) / d);
    }
    return from < to;
}

// A convex polygon and an open square have area in common: no edge of either parts them.
bool overlaps(const std::vector<Vec2>& polygon, const Window& w) {
    Vec2 lo{1e300, 1e300}, hi{-1e300, -1e300};
    for (const Vec2 p : polygon) lo = {std::min(lo.x, p.x), std::min(lo.y, p.y)}, hi = {std::max(hi.x, p.x), std::max(hi.y, p.y)};
    if (lo.x >= w.middle.x + w.half - kSame || hi.x <= w.middle.x - w.half + kSame || lo.y >= w.middle.y + w.half - kSame ||
        hi.y <= w.middle.y - w.half + kSame)
        return false;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
        const Vec2 a = polygon[i], d = polygon[(i + 1) % polygon.size()] - a;
        const double size = std::hypot(d.x, d.y);
        if (!(size > 0)) continue;
        const Vec2 m = w.middle - a; // how far the corner farthest inside is inside
        if (cross(d, m) + w.half * (std::abs(d.x) + std::abs(d.y)) <= kSame * size) return false;
    }
    return true;
}

struct Contact { // two polygons share this part of an edge
    std::uint32_t a, b;
    Vec2 from, to;
    double length;
};

class Parting {
public:
    explicit Parting(const std::vector<std::vector<Vec2>>& polygons) : polygons_(polygons), tree_(boxes_of(polygons)), joined_(polygons.size()) {}

    std::vector<std::uint32_t> run() {
        find_contacts();
        find_conflicts();
        return number();
    }

private:
    const std::vector<std::vector<Vec2>>& polygons_;
    csg_detail::BoxTree tree_;
    UnionFind joined_;                                     // by contacts, however far apart
    std::vector<Contact> contacts_;
    std::vector<std::vector<std::uint32_t>> of_polygon_;   // its contacts
    std::vector<std::pair<Vec2, Vec2>> border_;            // parts of edges with nothing beyond …
    std::vector<std::uint32_t> border_of_;                 // … and whose they are
    std::set<std::pair<std::uint32_t, std::uint32_t>> conflicts_;
    std::vector<std::uint32_t> near_;

    static std::vector<Box3> boxes_of(const std::vector<std::vector<Vec2>>& polygons) {
        std::vector<Box3> boxes(polygons.size());
        for (std::size_t i = 0; i < polygons.size(); ++i)
            for (const Vec2 p : polygons[i]) boxes[i].add(Vec3{p.x, p.y, 0});
        return boxes;
    }
    void query(Vec2 lo, Vec2 hi) {
        Box3 box;
        box.add(Vec3{lo.x, lo.y, 0}), box.add(Vec3{hi.x, hi.y, 0});
        tree_.query(box, near_);
    }
    void query(const Window& w) { query(w.middle - Vec2{w.half, w.half}, w.middle + Vec2{w.half, w.half}); }

    void find_contacts() {
        of_polygon_.resize(polygons_.size());
        std::vector<std::pair<double, double>> shared;
        for (std::uint32_t i = 0; i < polygons_.size(); ++i) {
            const std::vector<Vec2>& p = polygons_[i];
            for (std::size_t k = 0; k < p.size(); ++k) {
                const Vec2 a = p[k], b = p[(k + 1) % p.size()], d = b - a;
                const double size = std::hypot(d.x, d.y);
                if (!(size > kSame)) continue;
                const Vec2 along{d.x / size, d.y / size}, rim{kSame, kSame};
                query({std::min(a.x, b.x) - rim.x, std::min(a.y, b.y) - rim.y}, {std::max(a.x, b.x) + rim.x, std::max(a.y, b.y) + rim.y});
                shared.clear();
                for (const std::uint32_t j : near_) {
                    if (j == i) continue;
                    const std::vector<Vec2>& q = polygons_[j];
                    for (std::size_t m = 0; m < q.size(); ++m) {
                        const Vec2 u = q[m] - a, v = q[(m + 1) % q.size()] - a;
                        if (std::abs(cross(along, u)) > kSame || std::abs(cross(along, v)) > kSame) continue;
                        const double to = std::min(size, dot(along, u)), from = std::max(0.0, dot(along, v));
                        if (to - from <= kSame) continue; // runs the same way or lies elsewhere
                        shared.emplace_back(from, to);
                        if (i > j) continue;
                        of_polygon_[i].push_back(static_cast<std::uint32_t>(contacts_.size()));
                        of_polygon_[j].push_back(static_cast<std::uint32_t>(contacts_.size()));
                        contacts_.push_back({i, j, a + along * from, a + along * to, to - from});
                        joined_.join(i, j);
                    }
                }
                std::ranges::sort(shared);
                double covered = 0;
                const auto rest = [&](double until) {
                    if (until - covered > kSame) border_.emplace_back(a + along * covered, a + along * until), border_of_.push_back(i);
                };
                for (const auto& [from, to] : shared) rest(from), covered = std::max(covered, to);
                rest(size);
            }
        }
    }

    // Sets of `among`, joined by contacts that enter the window.
    UnionFind joined_in(const std::vector<std::uint32_t>& among, const Window& window) const {
        UnionFind sets(among.size());
        for (std::uint32_t i = 0; i < among.size(); ++i)
            for (const std::uint32_t c : of_polygon_[among[i]]) {
                const Contact& contact = contacts_[c];
                if (contact.a != among[i] || !enters(contact.from, contact.to, window)) continue;
                const auto other = std::ranges::lower_bound(among, contact.b);
                if (other != among.end() && *other == contact.b) sets.join(i, static_cast<std::uint32_t>(other - among.begin()));
            }
        return sets;
    }
    // What is joined to `root` and has area in the window, ascending.
    std::vector<std::uint32_t> in(const Window& window, std::uint32_t root) {
        query(window);
        std::vector<std::uint32_t> out;
        for (const std::uint32_t i : near_)
            if (joined_.find(i) == root && overlaps(polygons_[i], window)) out.push_back(i);
        return out;
    }

    // How many luxels a side of a texel has for what is joined to a root: as in a chart that would have too many.
    std::vector<double> texel_sizes() {
        std::vector<Box3> extent(polygons_.size());
        for (std::uint32_t i = 0; i < polygons_.size(); ++i)
            for (const Vec2 p : polygons_[i]) extent[joined_.find(i)].add(Vec3{p.x, p.y, 0});
        std::vector<double> sizes(polygons_.size(), 1);
        for (std::uint32_t i = 0; i < polygons_.size(); ++i)
            if (const Vec3 d = extent[i].hi - extent[i].lo; joined_.find(i) == i)
                while (std::max(d.x, d.y) / sizes[i] + 4 > kMaxChartTexels) sizes[i] *= 2;
        return sizes;
    }

    // Only texels that are read at the borders of several polygons that are joined somewhere.
    void find_conflicts() {
        struct Read {
            std::uint32_t root;
            std::int64_t y, x;
            std::uint32_t border;
            auto operator<=>(const Read&) const = default;
        };
        const std::vector<double> sizes = texel_sizes();
        std::vector<Read> reads;
        for (std::uint32_t e = 0; e < border_.size(); ++e) {
            const std::uint32_t polygon = border_of_[e], root = joined_.find(polygon);
            if (of_polygon_[polygon].empty()) continue; // joined to none, so none is on the other side
            const double size = sizes[root];
            const Vec2 a = border_[e].first * (1 / size), b = border_[e].second * (1 / size);
            for (double y = std::floor(std::min(a.y, b.y) - kReads - 0.5); y <= std::max(a.y, b.y) + kReads; ++y) {
                // The piece of the edge that this row of centres is read at.
                double lo = std::min(a.x, b.x), hi = std::max(a.x, b.x);
                if (std::abs(b.y - a.y) > kSame) {
                    const double s = (b.x - a.x) / (b.y - a.y), p = a.x + s * (y + 0.5 - kReads - a.y), q = a.x + s * (y + 0.5 + kReads - a.y);
                    lo = std::max(lo, std::min(p, q)), hi = std::min(hi, std::max(p, q));
                }
                for (double x = std::floor(lo - kReads - 0.5); x <= hi + kReads; ++x)
                    if (enters(a, b, {{x + 0.5, y + 0.5}, kReads})) reads.push_back({root, static_cast<std::int64_t>(y), static_cast<std::int64_t>(x), e});
            }
        }
        std::ranges::sort(reads);
        // What stands between two polygons ends both, on sides that look away from each other. Along one side, and in the corners of a room, there is nothing to ask.
        const auto face_away = [&](std::span<const Read> of) {
            constexpr double kAway = -0.1; // cosine
            const auto along = [&](const Read& r) {
                const Vec2 d = border_[r.border].second - border_[r.border].first;
                return d * (1 / std::hypot(d.x, d.y));
            };
            for (std::size_t k = 0; k < of.size(); ++k)
                for (std::size_t l = k + 1; l < of.size(); ++l)
                    if (border_of_[of[k].border] != border_of_[of[l].border] && dot(along(of[k]), along(of[l])) < kAway) return true;
            return false;
        };
        for (std::size_t i = 0, next = 0; i < reads.size(); i = next) {
            const Read& r = reads[i];
            for (next = i; next < reads.size() && std::tie(reads[next].root, reads[next].y, reads[next].x) == std::tie(r.root, r.y, r.x);) ++next;
            if (next - i < 2 || !face_away(std::span(reads).subspan(i, next - i))) continue;
            const double size = sizes[r.root];
            const Vec2 centre = Vec2{static_cast<double>(r.x) + 0.5, static_cast<double>(r.y) + 0.5} * size;
            const std::vector<std::uint32_t> readers = in({centre, kReads * size}, r.root);
            UnionFind close = joined_in(readers, {centre, kReads * size});
            bool one = true;
            for (std::uint32_t k = 0; k < readers.size(); ++k) one = one && close.find(k) == close.find(0);
            if (one) continue;
            std::vector<std::pair<std::uint32_t, std::uint32_t>> apart;
            for (std::uint32_t k = 0; k < readers.size(); ++k)
                for (std::uint32_t l = k + 1; l < readers.size(); ++l)
                    if (close.find(k) != close.find(l) && !conflicts_.contains({readers[k], readers[l]})) apart.emplace_back(readers[k], readers[l]);
            if (apart.empty()) continue;
            const std::vector<std::uint32_t> around = in({centre, kRound * size}, r.root);
            UnionFind round = joined_in(around, {centre, kRound * size});
            const auto set_of = [&](std::uint32_t p) { return round.find(static_cast<std::uint32_t>(std::ranges::lower_bound(around, p) - around.begin())); };
            for (const auto& [f, g] : apart)
                if (set_of(f) != set_of(g)) conflicts_.insert({f, g});
        }
    }

    // Joined again along the longest contacts first, as far as no conflict forbids: few charts, short cuts.
    std::vector<std::uint32_t> number() {
        std::vector<std::uint32_t> number(polygons_.size(), 0);
        if (conflicts_.empty()) return number;
        std::vector<std::set<std::uint32_t>> against(polygons_.size()); // of a root: roots it must not join
        for (const auto& [f, g] : conflicts_) against[f].insert(g), against[g].insert(f);
        std::ranges::sort(contacts_, {}, [](const Contact& c) { return std::tuple(-c.length, c.a, c.b); });
        UnionFind charts(polygons_.size());
        for (const Contact& c : contacts_) {
            const std::uint32_t a = charts.find(c.a), b = charts.find(c.b);
            if (a == b || against[a].contains(b)) continue;
            charts.join(a, b);
            const std::uint32_t kept = charts.find(a), gone = kept == a ? b : a;
            for (const std::uint32_t other : against[gone]) against[other].erase(gone), against[other].insert(kept), against[kept].insert(other);
            against[gone].clear();
        }
        // Within what is joined, charts count from 0: what is parted nowhere keeps its number.
        std::vector<std::uint32_t> charts_of(polygons_.size(), 0);
        for (std::uint32_t i = 0; i < polygons_.size(); ++i) {
            const std::uint32_t root = charts.find(i);
            number[i] = root == i ? charts_of[joined_.find(i)]++ : number[root];
        }
        return number;
    }
};

} // namespace

std::vector<std::uint32_t> part_at_walls(const std::vector<std::vector<Vec2>>& polygons) {
    if (polygons.size() < 2) return std::vector<std::uint32_t>(polygons.size(), 0);
    return Parting(polygons).run();
}

} // namespace kiln

// Merging by edges: where two polygons share an edge, one has it forward and one backward, and both go. What is left are
// the boundaries. Nothing but vertex ids is compared once every vertex that lies on an edge is one of that edge.
#include "compiler/surfaces/regions.h"
#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace kiln {
namespace {

// Candidates to lie on an edge come from rounded coordinates (error below 2^-30 units in a world of 2^20).
constexpr double kNear = 1e-5; // map units

struct Edge {
    VertexId from, to;
    PlaneId line;
    std::uint32_t polygon;
};

class Merger {
public:
    explicit Merger(const VertexTable& vertices) : vertices_(vertices) {}

    std::optional<std::vector<Region>> run(PlaneId plane, PolygonSpan polygons) {
        plane_ = plane, axes_ = project_along(vertices_.planes(), plane);
        count_ = static_cast<std::uint32_t>(polygons.size()), outers_ = 0;
        root_.resize(count_);
        std::iota(root_.begin(), root_.end(), 0u);
        edges_.clear();
        edges_.reserve(polygons.corners());
        for (std::uint32_t i = 0; i < count_; ++i) {
            const auto loop = polygons[i];
            const auto lines = polygons.lines(i);
            for (std::size_t k = 0; k < loop.size(); ++k) edges_.push_back({loop[k], loop[k + 1 == loop.size() ? 0 : k + 1], lines[k], i});
        }
        if (!cancel()) return std::nullopt;
        // A vertex inside an edge is the end of an edge that found no other: where polygons fan round it, the fan
        // ends on that edge's line or at the border of them all.
        if (cut_at_vertices() && !cancel()) return std::nullopt;
        return trace();
    }

private:
    const VertexTable& vertices_;
    PlaneId plane_;
    std::uint32_t count_ = 0; // polygons
    Projection axes_;
    std::vector<Edge> edges_; // without an opposite so far
    std::vector<std::uint32_t> root_;
    std::size_t outers_ = 0;

    std::uint32_t find(std::uint32_t x) {
        while (root_[x] != x) x = root_[x] = root_[root_[x]];
        return x;
    }

    // Removes pairs of opposite edges, joining their polygons. False: an edge comes twice, so polygons overlap.
    bool cancel() {
        const auto key = [](const Edge& e) { return std::tuple(std::min(e.from, e.to), std::max(e.from, e.to)); };
        std::ranges::sort(edges_, {}, [&](const Edge& e) { return std::tuple_cat(key(e), std::tuple(e.from, e.polygon)); });
        std::size_t kept = 0;
        for (std::size_t i = 0; i < edges_.size(); ++i) {
            if (i + 1 < edges_.size() && key(edges_[i]) == key(edges_[i + 1])) {
                if (edges_[i].from == edges_[i + 1].from) return false;
                if (i + 2 < edges_.size() && key(edges_[i]) == key(edges_[i + 2])) return false;
                const std::uint32_t a = find(edges_[i].polygon), b = find(edges_[i + 1].polygon);
                root_[std::max(a, b)] = std::min(a, b); // the root is the smallest
                ++i;
                continue;
            }
            edges_[kept++] = edges_[i];
        }
        edges_.resize(kept);
        return true;
    }

    struct Corner {
        double x[2];
        VertexId v;
    };
    // Puts every end of an edge that lies strictly inside another one into that. False: there is none.
    bool cut_at_vertices() {
        std::vector<Corner>(&along)[2] = along_;
        Loop& ends = ends_;
        ends.clear();
        ends.reserve(edges_.size() * 2);
        for (const Edge& e : edges_) ends.push_back(e.from), ends.push_back(e.to);
        std::ranges::sort(ends);
        ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
        along[0].clear();
        along[0].reserve(ends.size());
        for (const VertexId v : ends) along[0].push_back(corner(v));
        along[1] = along[0];
        for (const std::size_t k : {std::size_t{0}, std::size_t{1}})
            std::ranges::sort(along[k], {}, [k](const Corner& c) { return std::tuple(c.x[k], c.v); });

        std::vector<Edge>& cut = cut_;
        std::vector<std::pair<double, VertexId>>& on = on_;
        cut.clear();
        cut.reserve(edges_.size());
        bool any = false;
        for (const Edge& e : edges_) {
            const Corner a = corner(e.from), b = corner(e.to);
            const double d[2] = {b.x[0] - a.x[0], b.x[1] - a.x[1]}, dd = d[0] * d[0] + d[1] * d[1];
            // Searched along the axis on which the edge is shorter: fewer lie beside it there.
            const std::size_t k = std::abs(d[0]) < std::abs(d[1]) ? 0 : 1;
            const double lo = std::min(a.x[k], b.x[k]) - kNear, hi = std::max(a.x[k], b.x[k]) + kNear;
            const double far_lo = std::min(a.x[1 - k], b.x[1 - k]) - kNear, far_hi = std::max(a.x[1 - k], b.x[1 - k]) + kNear;
            on.clear();
            for (auto c = std::ranges::lower_bound(along[k], lo, {}, [k](const Corner& at) { return at.x[k]; }); c != along[k].end() && c->x[k] <= hi; ++c) {
                if (c->x[1 - k] < far_lo || c->x[1 - k] > far_hi || c->v == e.from || c->v == e.to) continue;
                const double q[2] = {c->x[0] - a.x[0], c->x[1] - a.x[1]}, off = d[0] * q[1] - d[1] * q[0];
                if (off * off > kNear * kNear * dd) continue;
                if (vertices_.between(e.from, e.to, c->v, plane_, e.line)) on.emplace_back(d[0] * q[0] + d[1] * q[1], c->v);
            }
            if (on.empty()) {
                cut.push_back(e);
                continue;
            }
            any = true;
            std::ranges::sort(on, [&](const auto& x, const auto& y) { return x.second != y.second && vertices_.within(e.from, y.second, x.second); });
            Edge part = e;
            for (const auto& [at, v] : on) {
                part.to = v;
                cut.push_back(part);
                part.from = v;
            }
            part.to = e.to;
            cut.push_back(part);
        }
        std::swap(edges_, cut);
        return any;
    }
    std::vector<Corner> along_[2]; // by u, by v
    Loop ends_;
    std::vector<Edge> cut_;
    std::vector<std::pair<double, VertexId>> on_;
    Corner corner(VertexId v) const {
        const Vec3 p = vertices_.position(v);
        return {{p[axes_.u], p[axes_.v]}, v};
    }

    // Twice the signed area in (u, v), and what it may be off by.
    std::pair<double, double> area(const Outline& loop) const {
        const Corner p0 = corner(loop.vertices[0]);
        double sum = 0, terms = 0, reach = 0;
        for (std::size_t i = 1; i + 1 < loop.vertices.size(); ++i) {
            const Corner p = corner(loop.vertices[i]), q = corner(loop.vertices[i + 1]);
            const double x = (p.x[0] - p0.x[0]) * (q.x[1] - p0.x[1]), y = (p.x[1] - p0.x[1]) * (q.x[0] - p0.x[0]);
            sum += x - y;
            terms += std::abs(x) + std::abs(y);
            reach += std::abs(p.x[0] - p0.x[0]) + std::abs(p.x[1] - p0.x[1]) + std::abs(q.x[0] - p0.x[0]) + std::abs(q.x[1] - p0.x[1]);
        }
        const double off = 4 * vertices_.rounding(), count = static_cast<double>(loop.vertices.size());
        return {sum, 2 * off * (reach + count * off) + terms * (count + 4) * 0x1p-52};
    }

    std::optional<std::vector<Region>> trace() {
        std::vector<std::uint32_t>& region_of = region_of_;
        region_of.resize(count_);
        std::vector<Region> regions;
        for (std::uint32_t i = 0; i < count_; ++i) { // ascending: a root comes before its members
            const std::uint32_t root = find(i);
            if (root == i) region_of[i] = static_cast<std::uint32_t>(regions.size()), regions.emplace_back();
            region_of[i] = region_of[root];
            regions[region_of[i]].members.push_back(i);
        }
        for (Edge& e : edges_) e.polygon = region_of[e.polygon];
        std::ranges::sort(edges_, {}, [](const Edge& e) { return std::tuple(e.polygon, e.from, e.to); });
        std::vector<std::uint8_t>& used = used_;
        used.assign(edges_.size(), 0);
        Outline& walk = walk_;
        for (std::size_t begin = 0, end; begin < edges_.size(); begin = end) { // the edges of one region
            bool simple = true;
            for (end = begin + 1; end < edges_.size() && edges_[end].polygon == edges_[begin].polygon; ++end)
                simple = simple && edges_[end].from != edges_[end - 1].from;
            std::vector<Outline> loops;
            const std::span<const Edge> of(edges_.data() + begin, end - begin);
            for (std::size_t i = 0; i < of.size(); ++i) {
                if (used[begin + i]) continue;
                walk.vertices.clear(), walk.lines.clear();
                std::size_t at = i;
                for (;;) {
                    used[begin + at] = 1;
                    walk.vertices.push_back(of[at].from), walk.lines.push_back(of[at].line);
                    // Any edge that goes on will do: which of several are taken does not matter once the walk is
                    // taken apart at vertices it passes twice, for loops of one region never meet in two of them.
                    std::size_t next = static_cast<std::size_t>(std::ranges::lower_bound(of, of[at].to, {}, &Edge::from) - of.begin());
                    while (next < of.size() && of[next].from == of[at].to && used[begin + next]) ++next;
                    if (next == of.size() || of[next].from != of[at].to) break;
                    at = next;
                }
                if (of[at].to != of[i].from) return std::nullopt;
                if (simple) loops.push_back(simplify(vertices_, plane_, walk));
                else
                    for (const Outline& loop : split_at_repeats(walk)) loops.push_back(simplify(vertices_, plane_, loop));
            }
            Region& region = regions[edges_[begin].polygon];
            for (Outline& loop : loops) {
                if (loop.vertices.size() < 3) return std::nullopt;
                bool outer = loops.size() == 1;
                if (!outer) {
                    const auto [twice, off] = area(loop);
                    if (std::abs(twice) <= off) return std::nullopt;
                    outer = twice > 0;
                }
                region.loops.push_back(std::move(loop));
                if (outer) std::swap(region.loops.front(), region.loops.back());
                outers_ += outer;
            }
            std::sort(region.loops.begin() + 1, region.loops.end());
        }
        if (outers_ != regions.size()) return std::nullopt; // one each
        for (const Region& r : regions)
            if (r.loops.empty() || (r.loops.size() > 1 && area(r.loops[0]).first < 0)) return std::nullopt;
        return regions;
    }
    std::vector<std::uint32_t> region_of_;
    std::vector<std::uint8_t> used_;
    Outline walk_;
};

std::vector<Region> keep_apart(PolygonSpan polygons) {
    std::vector<Region> regions;
    for (std::uint32_t i = 0; i < polygons.size(); ++i) {
        const auto loop = polygons[i];
        Outline outline{{loop.begin(), loop.end()}, {}};
        const auto lines = polygons.lines(i);
        outline.lines.assign(lines.begin(), lines.end());
        const auto smallest = std::ranges::min_element(outline.vertices) - outline.vertices.begin();
        std::ranges::rotate(outline.vertices, outline.vertices.begin() + smallest);
        std::ranges::rotate(outline.lines, outline.lines.begin() + smallest);
        regions.push_back({{std::move(outline)}, {i}});
    }
    return regions;
}

} // namespace

Outline simplify(const VertexTable& vertices, PlaneId plane, const Outline& loop) {
    const std::size_t n = loop.vertices.size();
    Outline out;
    out.vertices.reserve(n), out.lines.reserve(n);
    std::size_t smallest = 0;
    for (std::size_t i = 0; i < n; ++i) {
        // Straight where the next vertex is on the line of the edge that came here: a boundary never turns back on itself.
        const PlaneId before = loop.lines[i == 0 ? n - 1 : i - 1], after = loop.lines[i];
        if ((before.value | 1u) == (after.value | 1u) || vertices.on_line(loop.vertices[i + 1 == n ? 0 : i + 1], plane, before)) continue;
        out.vertices.push_back(loop.vertices[i]), out.lines.push_back(after);
        if (out.vertices.back() < out.vertices[smallest]) smallest = out.vertices.size() - 1;
    }
    const auto first = static_cast<std::ptrdiff_t>(smallest);
    if (first > 0) {
        std::ranges::rotate(out.vertices, out.vertices.begin() + first);
        std::ranges::rotate(out.lines, out.lines.begin() + first);
    }
    return out;
}

std::vector<Outline> split_at_repeats(const Outline& walk) {
    std::vector<Outline> loops;
    Outline open;
    // Where in `open` a vertex is, of those that come more than once; they are few.
    Loop sorted = walk.vertices;
    std::ranges::sort(sorted);
    Loop repeated;
    for (std::size_t i = 1; i < sorted.size(); ++i)
        if (sorted[i] == sorted[i - 1] && (repeated.empty() || repeated.back() != sorted[i])) repeated.push_back(sorted[i]);
    for (std::size_t i = 0; i < walk.vertices.size(); ++i) {
        const VertexId v = walk.vertices[i];
        if (std::ranges::binary_search(repeated, v))
            if (const auto it = std::ranges::find(open.vertices, v); it != open.vertices.end()) {
                const auto lines = open.lines.begin() + (it - open.vertices.begin());
                loops.push_back({{it, open.vertices.end()}, {lines, open.lines.end()}});
                open.lines.erase(lines, open.lines.end());
                open.vertices.erase(it, open.vertices.end());
            }
        open.vertices.push_back(v), open.lines.push_back(walk.lines[i]);
    }
    loops.push_back(std::move(open));
    return loops;
}

struct RegionMerger::Work {
    const VertexTable& vertices;
    Merger merger;
};
RegionMerger::RegionMerger(const VertexTable& vertices) : work_(std::make_unique<Work>(Work{vertices, Merger(vertices)})) {}
RegionMerger::~RegionMerger() = default;

std::vector<Region> RegionMerger::merge(PlaneId plane, PolygonSpan polygons, bool& merged) {
    merged = true;
    if (polygons.size() == 1) return keep_apart(polygons);
    if (auto regions = work_->merger.run(plane, polygons)) return *std::move(regions);
    if (auto regions = merge_by_union(work_->vertices, plane, polygons)) return *std::move(regions);
    merged = false; // unmerged is correct, only more faces
    return keep_apart(polygons);
}

std::vector<Region> merge_polygons(const VertexTable& vertices, PlaneId plane, PolygonSpan polygons, bool& merged) {
    return RegionMerger(vertices).merge(plane, polygons, merged);
}

std::optional<std::vector<Region>> merge_by_edges(const VertexTable& vertices, PlaneId plane, PolygonSpan polygons) {
    return Merger(vertices).run(plane, polygons);
}

} // namespace kiln

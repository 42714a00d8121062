// SPDX-License-Identifier: MIT
// C interface: boxes swept through brushes and curved surfaces, and what lies at a point.
//
// Against one brush: every plane, own or bevel, is moved outwards by the box's reach against it, which makes the box a
// point; the stretch of the way behind all planes is the stretch inside. Three distances keep rounding out of it:
//
//   kRest      where a box that was stopped stays, so that the next trace starts outside, whatever rounding does
//   kContact   how near it may pass without being stopped. Less than kRest: a box that rests and slides along its
//              plane drifts by rounding alone, which takes longer than any game to eat up the difference
//   kTouch     how deep a box may start and still count as touching: what it touches and does not move closer to is
//              a plane between the two for the whole way, so it cannot be in the way; not even its neighbours' sides,
//              seams of a floor, are
//
// The brush whose contact comes first counts, of several at once the lowest: by contact, not by where the box would rest,
// since of brushes that abut in one plane the one ahead would show its side as well. All brushes near the way are looked
// at, so neither the tree nor the order of its leaves shows in the result.
//
// A triangle of a displacement or patch is a convex body as well, one without thickness. Its planes, which bound the sum
// with any box: its own both ways, the six axial ones, and those along each edge and axis. All touch it, so each is
// true; that is more than the sum needs, and what is too much costs time only. Triangles of one surface meet at edges
// that must not stop what slides over them, so they are not grown in all directions: by kContact along their normal,
// and by kTouch beyond their border, where rounding might leave cracks. Thus no triangle reaches out of the skin of a
// neighbour that it bends away from (NOTES.md).
#include "formats/level/level_state.h"
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

namespace kiln::level {

namespace {

constexpr double kRest = KILN_TRACE_DISTANCE, kContact = kRest / 2, kTouch = 1.0 / 1024;
constexpr double kSupports = 1e-6; // map units: a plane nearer than this to a corner of a brush touches it
constexpr double kInfinity = std::numeric_limits<double>::infinity();

double dot3(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// What brushes stop, of levels that say no more than their contents.
std::uint32_t stops_of_contents(std::uint32_t contents) {
    constexpr std::uint32_t kAll = KILN_FOR_PLAYERS | KILN_FOR_NPCS | KILN_FOR_BULLETS | KILN_FOR_SIGHT;
    if (contents & (KILN_CONTENTS_SOLID | KILN_CONTENTS_DETAIL)) return kAll;
    if (contents & KILN_CONTENTS_WINDOW) return kAll & ~static_cast<std::uint32_t>(KILN_FOR_SIGHT);
    if (contents & (KILN_CONTENTS_GRATE | KILN_CONTENTS_CLIP)) return KILN_FOR_PLAYERS | KILN_FOR_NPCS;
    return 0;
}

// Depth of the tree; throws where a node is reached twice.
std::size_t depth_of(const std::vector<kiln_node>& nodes) {
    struct Visit {
        std::int32_t node;
        std::size_t depth;
    };
    std::vector<std::uint8_t> seen(nodes.size());
    std::vector<Visit> stack;
    if (!nodes.empty()) stack.push_back({0, 1});
    std::size_t depth = 0;
    while (!stack.empty()) {
        const Visit v = stack.back();
        stack.pop_back();
        const auto n = static_cast<std::size_t>(v.node);
        require(!seen[n], "the tree has a loop");
        seen[n] = 1;
        depth = std::max(depth, v.depth);
        for (const std::int32_t c : nodes[n].child)
            if (c >= 0) stack.push_back({c, v.depth + 1});
    }
    return depth;
}

static_assert(KILN_FOR_PLAYERS == KILN_BLOCKS_PLAYERS << 24 && KILN_FOR_SIGHT == KILN_BLOCKS_SIGHT << 24, "the same bits, moved");

template <class T> const T& part(const kiln_level& level, const T* value, std::uint32_t id) {
    if (!value) {
        const kiln_status status = level.fault_of(id);
        throw Failure{status, kiln_status_text(status)};
    }
    return *value;
}

// Which brushes were tried lately; one that is forgotten is tried again, which changes nothing.
class Tried {
public:
    Tried() { slots_.fill(KILN_NO_INDEX); }
    bool again(std::uint32_t brush) {
        std::uint32_t& slot = slots_[brush % slots_.size()];
        if (slot == brush) return true;
        slot = brush;
        return false;
    }

private:
    std::array<std::uint32_t, 256> slots_;
};

// A walk down the tree needs a place for each level of it; few trees are deeper than this.
template <class Frame> class Stack {
public:
    explicit Stack(std::size_t depth) {
        if (depth + 1 > few_.size()) many_.resize(depth + 1), at_ = many_.data();
    }
    void push(const Frame& f) { at_[size_++] = f; }
    bool pop(Frame& f) {
        if (size_ == 0) return false;
        f = at_[--size_];
        return true;
    }

private:
    std::array<Frame, 96> few_;
    std::vector<Frame> many_;
    Frame* at_ = few_.data();
    std::size_t size_ = 0;
};

// Edges and corners of a brush, from its own planes: each line of two of them as far as it is behind the others.
struct Shape {
    std::vector<std::array<double, 3>> corners;
    struct Edge {
        double way[3];       // unit
        const double* end;   // one of its ends
    };
    std::vector<Edge> edges;
};
Shape shape_of(const Collision::Plane* first, const Collision::Plane* last) {
    Shape out;
    std::vector<const Collision::Plane*> own;
    for (; first != last; ++first) own.push_back(first);
    std::vector<std::array<double, 3>> ways;
    for (std::size_t i = 0; i < own.size(); ++i)
        for (std::size_t k = i + 1; k < own.size(); ++k) {
            const double *m = own[i]->normal, *n = own[k]->normal;
            double d[3] = {m[1] * n[2] - m[2] * n[1], m[2] * n[0] - m[0] * n[2], m[0] * n[1] - m[1] * n[0]};
            const double square = dot3(d, d);
            if (!(square > 1e-18)) continue; // as good as parallel: no edge that could be placed
            // The point of the line nearest to the middle of nothing: p = (dm (n x d) + dn (d x m)) / d^2.
            double at[3];
            for (std::size_t x = 0; x < 3; ++x) {
                const std::size_t y = (x + 1) % 3, z = (x + 2) % 3;
                at[x] = (own[i]->distance * (n[y] * d[z] - n[z] * d[y]) + own[k]->distance * (d[y] * m[z] - d[z] * m[y])) / square;
            }
            const double length = std::sqrt(square);
            for (double& x : d) x /= length;
            double from = -kInfinity, to = kInfinity;
            for (std::size_t o = 0; o < own.size() && from < to; ++o) {
                if (o == i || o == k) continue;
                const double slope = dot3(own[o]->normal, d), off = dot3(own[o]->normal, at) - own[o]->distance;
                if (std::fabs(slope) < 1e-12) {
                    if (off > 1e-6) to = from; // beside the brush
                } else if (slope > 0) {
                    to = std::min(to, -off / slope);
                } else {
                    from = std::max(from, -off / slope);
                }
            }
            if (!(from < to) || from == -kInfinity || to == kInfinity) continue;
            ways.push_back({d[0], d[1], d[2]});
            for (const double t : {from, to}) out.corners.push_back({at[0] + t * d[0], at[1] + t * d[1], at[2] + t * d[2]});
        }
    for (std::size_t i = 0; i < ways.size(); ++i) out.edges.push_back({{ways[i][0], ways[i][1], ways[i][2]}, out.corners[2 * i].data()});
    return out;
}

// A box that is turned against what it is swept through: half its size along its own axes, about its middle.
struct Turned {
    double axis[3][3], half[3];
};

class Sweep {
public:
    // `start`, `end`: of the box's middle.
    Sweep(const Collision& c, const double start[3], const double end[3], const Turned& box, std::uint32_t mask)
        : Sweep(c, start, end, reach_of(box, -1).data(), reach_of(box, 1).data(), mask) {
        turned_ = &box;
        for (std::size_t k = 0; k < 3; ++k) std::copy(box.axis[k], box.axis[k] + 3, axis_[k]);
    }
    Sweep(const Collision& c, const double start[3], const double end[3], const double mins[3], const double maxs[3], std::uint32_t mask)
        : c_(c), contents_(mask & 0xffffffu), who_(mask & ~0xffffffu) {
        double largest = 1;
        for (std::size_t k = 0; k < 3; ++k) {
            start_[k] = start[k], end_[k] = end[k], mins_[k] = mins[k], maxs_[k] = maxs[k];
            largest = std::max({largest, std::fabs(start[k]), std::fabs(end[k]), std::fabs(mins[k]), std::fabs(maxs[k])});
        }
        // A distance to a plane is three products and as many sums of numbers no larger than a few times this.
        rounding_ = largest * 0x1p-47;
        bound();
    }

    void take(std::uint32_t brush) {
        const Collision::Brush& b = c_.brushes[brush];
        if (!(b.contents & contents_) || (who_ && !(b.stops & who_))) return;
        for (std::size_t k = 0; k < 3; ++k)
            if (b.lo[k] > hi_[k] || b.hi[k] < lo_[k]) return;
        if (turned_) clip_turned(brush, b);
        else clip(brush, b);
    }

    // Triangles of the model's curves that the box comes by.
    void walk(const Curves& curves, std::uint32_t model) {
        Way way{};
        bool is_ray = true;
        for (std::size_t k = 0; k < 3; ++k) {
            way.start[k] = start_[k], way.way[k] = end_[k] - start_[k];
            way.lo[k] = mins_[k] - kRest, way.hi[k] = maxs_[k] + kRest;
            is_ray = is_ray && mins_[k] == maxs_[k];
        }
        const auto last = [&] { return std::max(0.0, contact_); };
        walk_curves(curves, model, way, last, [&](const Curves::Curve& c, std::uint32_t quad) {
            if (!(c.contents & contents_) || (who_ && !(c.stops & who_)) || !(is_ray ? c.for_rays : c.for_boxes)) return;
            for (const std::uint32_t k : {0u, 1u}) {
                const Curves::Triangle t = curves.triangle(c, quad, k);
                float lo[3], hi[3];
                for (std::size_t i = 0; i < 3; ++i)
                    lo[i] = std::min({t.corner[0][i], t.corner[1][i], t.corner[2][i]}), hi[i] = std::max({t.corner[0][i], t.corner[1][i], t.corner[2][i]});
                if (double from = 0; way.meets(lo, hi, last(), from)) clip(kFirstTriangle + 2 * (std::uint64_t{c.first_quad} + quad) + k, t);
            }
        });
    }

    // All brushes of the leaves that the box comes by, near leaves first, as far as it still may be stopped earlier.
    void walk(const Nodes& nodes, const Planes& planes, const Leaves& leaves) {
        struct Frame {
            std::int32_t child;
            double from, to; // the stretch of the way in which the box touches this part
        };
        Stack<Frame> stack(c_.depth);
        Tried tried;
        stack.push({nodes.rows.empty() ? -1 : 0, 0, 1});
        Frame f{};
        while (stack.pop(f)) {
            if (f.from > std::max(0.0, contact_)) continue;
            if (f.child < 0) {
                if (leaves.rows.empty()) continue;
                const kiln_leaf& leaf = leaves.rows[static_cast<std::size_t>(-(f.child + 1))];
                for (std::uint32_t i = leaf.first_brush; i < leaf.first_brush + leaf.brush_count; ++i)
                    if (const std::uint32_t b = leaves.brushes[i]; !tried.again(b)) take(b);
                continue;
            }
            const kiln_node& n = nodes.rows[static_cast<std::size_t>(f.child)];
            const kiln_plane& p = planes.rows[n.plane];
            double below = 0, above = 0; // how far the box, grown by kRest, reaches along the normal
            for (std::size_t k = 0; k < 3; ++k) {
                const double a = p.normal[k] * (mins_[k] - kRest), b = p.normal[k] * (maxs_[k] + kRest);
                below += std::min(a, b), above += std::max(a, b);
            }
            const double slack = kTouch + rounding_;
            const double s = dot3(p.normal, start_) - p.distance, e = dot3(p.normal, end_) - p.distance;
            Frame front{n.child[0], f.from, f.to}, back{n.child[1], f.from, f.to};
            const bool in_front = cut(s + above + slack, e + above + slack, front.from, front.to);
            const bool in_back = cut(-(s + below - slack), -(e + below - slack), back.from, back.to);
            const bool front_first = s >= e; // what it leaves is nearer
            if (front_first && in_back) stack.push(back);
            if (in_front) stack.push(front);
            if (!front_first && in_back) stack.push(back);
        }
    }

    void finish(const kiln_level& level, const double from[3], const double to[3], kiln_trace& out) const {
        out = {};
        const bool stopped = fraction_ < 1;
        out.fraction = fraction_;
        for (std::size_t k = 0; k < 3; ++k)
            out.end[k] = !stopped ? to[k] : fraction_ > 0 ? from[k] + fraction_ * (to[k] - from[k]) : from[k];
        out.brush = out.side = out.displacement = out.patch = out.triangle = KILN_NO_INDEX;
        name(level, stopped ? met_ : start_met_, out);
        if (stopped && has_plane_) {
            std::copy(plane_.normal, plane_.normal + 3, out.normal);
            out.distance = plane_.distance, out.side = plane_.side;
        }
        out.start_solid = start_met_ != kNothing, out.all_solid = all_solid_;
    }

private:
    const Collision& c_;
    std::uint32_t contents_, who_;
    double start_[3], end_[3], mins_[3], maxs_[3];
    double lo_[3], hi_[3]; // of the way to the first contact so far, and kRest around
    const Turned* turned_ = nullptr; // else the box is upright
    double axis_[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}; // of the box
    double rounding_ = 0;
    double contact_ = 1, fraction_ = 1; // of the way to the first contact; of the way to where the box rests then
    // Brushes by their numbers, then triangles of displacements, then those of patches.
    static constexpr std::uint64_t kFirstTriangle = std::uint64_t{1} << 32, kNothing = UINT64_MAX;
    std::uint64_t met_ = kNothing, start_met_ = kNothing;
    Collision::Plane plane_{}; // that it was stopped by
    bool has_plane_ = false, all_solid_ = false;

    // The part of [from, to] in which s + t (e - s) >= 0; false: none.
    static bool cut(double s, double e, double& from, double& to) {
        if (s >= 0 && e >= 0) return true;
        if (s < 0 && e < 0) return false;
        const double t = s / (s - e);
        if (s < 0) from = std::max(from, t);
        else to = std::min(to, t);
        return from <= to;
    }

    void name(const kiln_level& level, std::uint64_t met, kiln_trace& out) const {
        if (met == kNothing) return;
        if (met < kFirstTriangle) {
            out.brush = static_cast<std::uint32_t>(met);
            out.contents = c_.brushes[met].contents;
            return;
        }
        const std::uint64_t quad = (met - kFirstTriangle) / 2;
        const auto after = std::ranges::upper_bound(c_.curves.curves, quad, {}, &Curves::Curve::first_quad);
        const Curves::Curve& curve = *std::prev(after);
        out.displacement = curve.displacement, out.patch = curve.patch, out.contents = curve.contents;
        out.triangle = static_cast<std::uint32_t>(met - kFirstTriangle - 2 * std::uint64_t{curve.first_quad});
        if (curve.displacement == KILN_NO_INDEX) return;
        const Displacements& table = *level.get_displacements();
        if (const kiln_displacement& d = table.rows[curve.displacement]; d.tag_count > 0) out.tag = table.tags[std::size_t{d.first_tag} + out.triangle];
    }

    void stop(double contact, double fraction, std::uint64_t met, const Collision::Plane* plane) {
        if (contact > contact_ || (contact == contact_ && met >= met_)) return;
        contact_ = contact, fraction_ = fraction, met_ = met, has_plane_ = plane != nullptr;
        if (plane) plane_ = *plane;
        bound();
    }
    void bound() {
        for (std::size_t k = 0; k < 3; ++k) {
            const double last = contact_ >= 1 ? end_[k] : start_[k] + std::max(0.0, contact_) * (end_[k] - start_[k]);
            lo_[k] = std::min(start_[k], last) + mins_[k] - kRest, hi_[k] = std::max(start_[k], last) + maxs_[k] + kRest;
        }
    }

    struct Passage { // through a convex body grown by kContact
        double enter = -kInfinity, leave = kInfinity;
        double rest = 0; // where the box comes to rest before the plane it enters by
        const Collision::Plane* hit = nullptr;
        bool starts_in = true, ends_in = true;
    };
    struct Ends {
        double s, e; // of the way: how far the box is from the plane
    };
    Ends ends(const Collision::Plane& p) const {
        double at = p.distance; // where the box's own origin stands when the box touches the plane
        if (turned_)
            for (std::size_t k = 0; k < 3; ++k) at += std::fabs(dot3(p.normal, turned_->axis[k])) * turned_->half[k];
        else
            for (std::size_t k = 0; k < 3; ++k) at -= p.normal[k] * (p.normal[k] < 0 ? maxs_[k] : mins_[k]);
        return {dot3(p.normal, start_) - at, dot3(p.normal, end_) - at};
    }
    // One more plane of the body; false: the box stays before it.
    bool cross(const Collision::Plane& p, Passage& way) const {
        const auto [s, e] = ends(p);
        if (e >= -kTouch) way.ends_in = false;
        if (s < -kTouch) {
            if (e > s) way.leave = std::min(way.leave, (kContact - s) / (e - s));
            return true;
        }
        way.starts_in = false;
        if (e >= std::min(s, kContact) - rounding_) return false;
        if (const double t = (s - kContact) / (s - e); t > way.enter) way.enter = t, way.hit = &p, way.rest = std::max(0.0, (s - kRest) / (s - e));
        return true;
    }

    // The same of a plane along the border of a triangle, moved out by `grow`. What is nearer than that is inside, unless
    // it moves closer: between two triangles that share an edge there is no way through, however exactly a ray keeps to it.
    bool cross_border(const Collision::Plane& p, double grow, Passage& way) const {
        const auto [s, e] = ends(p);
        if (s >= -kTouch) way.starts_in = false;
        if (s >= grow) {
            if (e >= grow - rounding_) return false;
        } else if (s < -kTouch || e >= s - rounding_) {
            if (e > s) way.leave = std::min(way.leave, (grow - s) / (e - s));
            return true;
        }
        if (const double t = (s - grow) / (s - e); t > way.enter) way.enter = t, way.hit = &p, way.rest = std::max(0.0, (s - kRest) / (s - e));
        return true;
    }

    void clip(std::uint32_t brush, const Collision::Brush& b) {
        Passage way;
        const Collision::Plane* end = c_.planes.data() + b.first_plane + b.plane_count;
        for (const Collision::Plane* p = c_.planes.data() + b.first_plane; p != end; ++p)
            if (!cross(*p, way)) return;
        pass(brush, way);
    }
    void pass(std::uint32_t brush, const Passage& way) {
        if (way.starts_in) {
            start_met_ = std::min(start_met_, std::uint64_t{brush});
            if (way.ends_in) all_solid_ = true, stop(-kInfinity, 0, brush, nullptr);
            return;
        }
        if (way.hit && way.enter < way.leave) stop(way.enter, way.rest, brush, way.hit);
    }

    static std::array<double, 3> reach_of(const Turned& box, double sign) {
        std::array<double, 3> reach{};
        for (std::size_t k = 0; k < 3; ++k)
            for (std::size_t a = 0; a < 3; ++a) reach[k] += sign * std::fabs(box.axis[a][k]) * box.half[a];
        return reach;
    }

    // The same for a turned box. The stored bevels are for upright ones; those for this one: its own faces' planes, and along
    // each edge of the brush and each of the box where that plane supports the brush.
    void clip_turned(std::uint32_t brush, const Collision::Brush& b) {
        Passage way;
        const Collision::Plane *first = c_.planes.data() + b.first_plane, *last = first;
        for (; last != first + b.plane_count && last->side != KILN_NO_INDEX; ++last) // its own planes come first
            if (!cross(*last, way)) return;
        const Shape shape = shape_of(first, last);
        if (shape.corners.empty()) return; // no volume
        std::vector<Collision::Plane> planes;
        planes.reserve(6 + 6 * shape.edges.size()); // `Passage::hit` points into it
        // Through the corner farthest along a direction; false: the box stays before it. `on`: a point it has to touch, or null.
        const auto stays_before = [&](double x, double y, double z, const double* on) {
            const double length = std::sqrt(x * x + y * y + z * z);
            if (!(length > 1e-9)) return false;
            const double n[3] = {x / length, y / length, z / length};
            double most = -kInfinity;
            for (const auto& v : shape.corners) most = std::max(most, dot3(n, v.data()));
            if (on && dot3(n, on) < most - kSupports) return false;
            for (const Collision::Plane* p = first; p != last; ++p) // one of its own sides, which has a name
                if (dot3(n, p->normal) > 1 - 1e-12 && std::fabs(most - p->distance) < kSupports) return false;
            planes.push_back({{n[0], n[1], n[2]}, most, KILN_NO_INDEX});
            return !cross(planes.back(), way);
        };
        for (const auto& a : axis_)
            if (stays_before(a[0], a[1], a[2], nullptr) || stays_before(-a[0], -a[1], -a[2], nullptr)) return;
        for (const auto& a : axis_)
            for (const Shape::Edge& e : shape.edges) {
                const double *w = e.way, x = a[1] * w[2] - a[2] * w[1], y = a[2] * w[0] - a[0] * w[2], z = a[0] * w[1] - a[1] * w[0];
                if (stays_before(x, y, z, e.end) || stays_before(-x, -y, -z, e.end)) return;
            }
        pass(brush, way);
    }

    void clip(std::uint64_t number, const Curves::Triangle& t) {
        double corner[3][3], edge[3][3];
        for (std::size_t c = 0; c < 3; ++c) std::copy(t.corner[c], t.corner[c] + 3, corner[c]);
        for (std::size_t c = 0; c < 3; ++c)
            for (std::size_t k = 0; k < 3; ++k) edge[c][k] = corner[(c + 1) % 3][k] - corner[c][k];
        std::array<Collision::Plane, 26> planes;
        std::size_t count = 0;
        Passage way;
        const auto add_both = [&](double x, double y, double z) { // the planes that touch the triangle from both sides
            const double length = std::sqrt(x * x + y * y + z * z);
            if (!(length > 0)) return false;
            const double n[3] = {x / length, y / length, z / length};
            double least = kInfinity, most = -kInfinity;
            for (const auto& v : corner) {
                const double at = dot3(n, v);
                least = std::min(least, at), most = std::max(most, at);
            }
            planes[count++] = {{n[0], n[1], n[2]}, most, KILN_NO_INDEX};
            planes[count++] = {{-n[0], -n[1], -n[2]}, -least, KILN_NO_INDEX};
            return true;
        };
        const auto cross_borders = [&](double x, double y, double z) {
            if (!add_both(x, y, z)) return true;
            const double grow = kTouch + kContact * std::fabs(dot3(planes[count - 1].normal, planes[0].normal));
            return cross_border(planes[count - 2], grow, way) && cross_border(planes[count - 1], grow, way);
        };
        if (!add_both(edge[0][1] * edge[1][2] - edge[0][2] * edge[1][1], edge[0][2] * edge[1][0] - edge[0][0] * edge[1][2],
                      edge[0][0] * edge[1][1] - edge[0][1] * edge[1][0]))
            return; // no area: its neighbours have its edges
        if (!cross(planes[0], way) || !cross(planes[1], way)) return;
        for (const auto& a : axis_)
            if (!cross_borders(a[0], a[1], a[2])) return;
        for (const auto& e : edge)
            for (const auto& a : axis_)
                if (!cross_borders(a[1] * e[2] - a[2] * e[1], a[2] * e[0] - a[0] * e[2], a[0] * e[1] - a[1] * e[0])) return;
        if (way.starts_in) return start_across(number, planes[0]);
        if (!way.hit || way.enter >= way.leave) return;
        // While the box is before the triangle's own plane, that is what parts them. Of a floor in many triangles, the one
        // ahead may lie higher by rounding and be entered by its border a moment before the one below is.
        for (const Collision::Plane& own : {std::cref(planes[0]), std::cref(planes[1])}) {
            const auto [s, e] = ends(own);
            if (way.hit == &own || s < 0 || e >= s || s + way.enter * (e - s) < 0) continue;
            way.hit = &own, way.rest = std::max(way.rest, (s - kRest) / (s - e));
            break;
        }
        stop(way.enter, way.rest, number, way.hit);
    }

    // The box starts cut by a triangle. There is no inside to be let out of: to leave is to move its centre away from the
    // sheet, or along it. Were it let through, what sinks in a little would fall out of the world.
    void start_across(std::uint64_t number, const Collision::Plane& front) {
        start_met_ = std::min(start_met_, number);
        double off = -front.distance, along = 0;
        bool moves = false;
        for (std::size_t k = 0; k < 3; ++k) {
            off += front.normal[k] * (start_[k] + (mins_[k] + maxs_[k]) / 2), along += front.normal[k] * (end_[k] - start_[k]);
            moves = moves || start_[k] != end_[k];
        }
        if (!moves) all_solid_ = true, stop(-kInfinity, 0, number, nullptr);
        if (std::fabs(off) <= kTouch || (off > 0 ? along >= -rounding_ : along <= rounding_)) return;
        Collision::Plane side = front;
        if (off < 0) side = {{-front.normal[0], -front.normal[1], -front.normal[2]}, -front.distance, KILN_NO_INDEX};
        stop(-kInfinity, 0, number, &side);
    }
};

bool usable(const double v[3]) {
    for (int k = 0; k < 3; ++k)
        if (!(std::fabs(v[k]) <= kMostCoordinate)) return false;
    return true;
}
bool usable_box(const double mins[3], const double maxs[3]) {
    if (!usable(mins) || !usable(maxs)) return false;
    return mins[0] <= maxs[0] && mins[1] <= maxs[1] && mins[2] <= maxs[2];
}
bool is_ray(const double mins[3], const double maxs[3]) {
    return mins[0] == maxs[0] && mins[1] == maxs[1] && mins[2] == maxs[2];
}

kiln_status check(const Collision& c, const double start[3], const double end[3], const double mins[3], const double maxs[3]) {
    if (!usable(start) || !usable(end) || !usable_box(mins, maxs)) return KILN_BAD_ARGUMENT;
    return c.has_bevels || is_ray(mins, maxs) ? KILN_OK : KILN_MISSING;
}

bool holds(const Collision& c, std::uint32_t brush, const double point[3]) {
    const Collision::Brush& b = c.brushes[brush];
    for (std::size_t k = 0; k < 3; ++k)
        if (point[k] < b.lo[k] || point[k] > b.hi[k]) return false;
    for (std::uint32_t i = b.first_plane; i < b.first_plane + b.plane_count; ++i)
        if (dot3(c.planes[i].normal, point) > c.planes[i].distance) return false;
    return true;
}

auto brushes_of(const Collision& c, std::uint32_t model) {
    return std::ranges::equal_range(c.of_model, model, {}, [&](std::uint32_t b) { return c.brushes[b].model; });
}

// Why there are no tables to trace in.
kiln_status fault(const kiln_level& level) { return level.collision.status() == KILN_OK ? KILN_DAMAGED : level.collision.status(); }

bool is_rotation(const double turn[3][3]) {
    constexpr double kSlack = 1e-6;
    for (int i = 0; i < 3; ++i)
        for (int k = i; k < 3; ++k)
            if (!(std::fabs(dot3(turn[i], turn[k]) - (i == k)) <= kSlack)) return false;
    const double third[3] = {turn[0][1] * turn[1][2] - turn[0][2] * turn[1][1], turn[0][2] * turn[1][0] - turn[0][0] * turn[1][2], turn[0][0] * turn[1][1] - turn[0][1] * turn[1][0]};
    return dot3(third, turn[2]) > 0;
}
// The place in the drawn model of a point of the world.
void to_model(const kiln_pose& pose, const double world[3], double model[3]) {
    double from_pivot[3];
    for (int k = 0; k < 3; ++k) from_pivot[k] = world[k] - pose.origin[k] - pose.pivot[k];
    for (int k = 0; k < 3; ++k) model[k] = pose.pivot[k] + dot3(pose.turn[k], from_pivot);
}

// No exception may cross the C interface; a deep tree's stack is all that is allocated.
template <class Body> kiln_status guarded(const Body& body) {
    try {
        return body();
    } catch (const std::bad_alloc&) {
        return KILN_NO_MEMORY;
    }
}

} // namespace

Collision make_collision(const kiln_level& level) {
    const Planes& planes = part(level, level.get_planes(), fourcc("PLNS"));
    const Brushes& brushes = part(level, level.get_brushes(), fourcc("BRSH"));
    const Nodes& nodes = part(level, level.get_nodes(), fourcc("NODE"));
    const Leaves& leaves = part(level, level.get_leaves(), fourcc("LEAF"));
    const Bevels* bevels = level.get_bevels();
    if (!bevels && level.find(fourcc("BEVL")) != level.entries.size()) part(level, bevels, fourcc("BEVL")); // damaged
    const BrushBlocks* blocks = level.get_brush_blocks();
    if (!blocks && level.find(fourcc("BBLK")) != level.entries.size()) part(level, blocks, fourcc("BBLK")); // damaged
    Collision out;
    out.has_bevels = bevels != nullptr;
    out.depth = depth_of(nodes.rows);
    for (std::size_t i = 0; i < brushes.rows.size(); ++i) {
        const kiln_brush& from = brushes.rows[i];
        Collision::Brush b{};
        for (std::size_t k = 0; k < 3; ++k) b.lo[k] = -kInfinity, b.hi[k] = kInfinity;
        b.model = from.model;
        b.contents = from.contents < 24 ? 1u << from.contents : 0;
        b.stops = blocks ? std::uint32_t{blocks->bits[i]} << 24 : stops_of_contents(b.contents);
        b.first_plane = static_cast<std::uint32_t>(out.planes.size());
        const auto add = [&](const double* normal, double distance, std::uint32_t side) {
            require(std::fabs(normal[0]) <= 1.001 && std::fabs(normal[1]) <= 1.001 && std::fabs(normal[2]) <= 1.001 &&
                        std::fabs(distance) <= 1e12,
                    "a brush has a side that is no plane");
            Collision::Plane p{{normal[0], normal[1], normal[2]}, distance, side};
            out.planes.push_back(p);
            for (std::size_t k = 0; k < 3; ++k) {
                if (normal[(k + 1) % 3] != 0 || normal[(k + 2) % 3] != 0) continue;
                if (normal[k] > 0) b.hi[k] = std::min(b.hi[k], distance);
                if (normal[k] < 0) b.lo[k] = std::max(b.lo[k], -distance);
            }
        };
        for (std::uint32_t s = from.first_plane; s < from.first_plane + from.plane_count; ++s) {
            const kiln_plane& p = planes.rows[brushes.planes[s]];
            add(p.normal, p.distance, s);
        }
        if (bevels)
            for (std::uint32_t k = 0; k < bevels->rows[i].count; ++k) {
                const kiln_bevel& bevel = bevels->bevels[std::size_t{bevels->rows[i].first} + k];
                add(bevel.normal, bevel.distance, KILN_NO_INDEX);
            }
        require(out.planes.size() < UINT32_MAX, "more planes of brushes than an index can name");
        b.plane_count = static_cast<std::uint32_t>(out.planes.size()) - b.first_plane;
        out.brushes.push_back(b);
    }
    out.of_model.resize(brushes.rows.size());
    std::iota(out.of_model.begin(), out.of_model.end(), 0u);
    std::ranges::stable_sort(out.of_model, {}, [&](std::uint32_t i) { return out.brushes[i].model; });
    std::vector<std::uint8_t> listed(brushes.rows.size());
    for (const std::uint32_t b : leaves.brushes) listed[b] = 1;
    for (std::uint32_t i = 0; i < brushes.rows.size(); ++i)
        if (brushes.rows[i].model == 0 && !listed[i]) out.unlisted.push_back(i);
    out.curves = make_curves(level);
    return out;
}

} // namespace kiln::level

using namespace kiln::level;

extern "C" {

const kiln_bevel* kiln_level_brush_bevels(const kiln_level* level, uint32_t brush, size_t* count) {
    if (count) *count = 0;
    const Bevels* table = level && brush < level->info.brushes ? level->get_bevels() : nullptr;
    if (!table || table->rows[brush].count == 0) return nullptr;
    if (count) *count = table->rows[brush].count;
    return table->bevels.data() + table->rows[brush].first;
}

kiln_status kiln_trace_box(const kiln_level* level, const double start[3], const double end[3], const double mins[3],
                           const double maxs[3], uint32_t mask, kiln_trace* trace) {
    if (!level || !start || !end || !mins || !maxs || !trace) return KILN_BAD_ARGUMENT;
    return guarded([&] {
        const Collision* c = level->get_collision();
        if (!c) return fault(*level);
        if (const kiln_status status = check(*c, start, end, mins, maxs); status != KILN_OK) return status;
        Sweep sweep(*c, start, end, mins, maxs, mask);
        sweep.walk(*level->get_nodes(), *level->get_planes(), *level->get_leaves());
        for (const std::uint32_t b : c->unlisted) sweep.take(b);
        sweep.walk(c->curves, 0);
        sweep.finish(*level, start, end, *trace);
        return KILN_OK;
    });
}

kiln_status kiln_trace_model(const kiln_level* level, uint32_t model, const double origin[3], const double start[3],
                             const double end[3], const double mins[3], const double maxs[3], uint32_t mask,
                             kiln_trace* trace) {
    if (!level || !origin || !start || !end || !mins || !maxs || !trace || model >= level->info.models) return KILN_BAD_ARGUMENT;
    const Collision* c = level->get_collision();
    if (!c) return fault(*level);
    if (!usable(origin)) return KILN_BAD_ARGUMENT;
    double s[3], e[3];
    for (int k = 0; k < 3; ++k) s[k] = start[k] - origin[k], e[k] = end[k] - origin[k];
    if (const kiln_status status = check(*c, s, e, mins, maxs); status != KILN_OK) return status;
    Sweep sweep(*c, s, e, mins, maxs, mask);
    for (const std::uint32_t b : brushes_of(*c, model)) sweep.take(b);
    sweep.walk(c->curves, model);
    sweep.finish(*level, start, end, *trace);
    for (int k = 0; k < 3; ++k) trace->distance += trace->normal[k] * origin[k];
    return KILN_OK;
}

void kiln_turn_from_angles(const double angles[3], double turn[3][3]) {
    double s[3], c[3]; // of pitch, yaw, roll
    for (int k = 0; k < 3; ++k) {
        const double quarter = angles[k] / 90; // right angles are exact
        const double radians = angles[k] * 0.017453292519943295;
        const int q = quarter == std::floor(quarter) && std::fabs(quarter) < 1e9 ? static_cast<int>(std::fmod(std::fmod(quarter, 4) + 4, 4)) : -1;
        constexpr double kSine[4] = {0, 1, 0, -1};
        s[k] = q >= 0 ? kSine[q] : std::sin(radians), c[k] = q >= 0 ? kSine[(q + 1) % 4] : std::cos(radians);
    }
    const double rows[3][3] = {{c[0] * c[1], c[0] * s[1], -s[0]},
                               {s[2] * s[0] * c[1] - c[2] * s[1], s[2] * s[0] * s[1] + c[2] * c[1], s[2] * c[0]},
                               {c[2] * s[0] * c[1] + s[2] * s[1], c[2] * s[0] * s[1] - s[2] * c[1], c[2] * c[0]}};
    for (int i = 0; i < 3; ++i) std::copy(rows[i], rows[i] + 3, turn[i]);
}

kiln_status kiln_trace_posed_model(const kiln_level* level, uint32_t model, const kiln_pose* pose, const double start[3],
                                   const double end[3], const double mins[3], const double maxs[3], uint32_t mask,
                                   kiln_trace* trace) {
    if (!level || !pose || !start || !end || !mins || !maxs || !trace || model >= level->info.models) return KILN_BAD_ARGUMENT;
    return guarded([&] {
        const Collision* c = level->get_collision();
        if (!c) return fault(*level);
        if (!usable(pose->pivot) || !usable(pose->origin) || !is_rotation(pose->turn)) return KILN_BAD_ARGUMENT;
        if (!usable(start) || !usable(end) || !usable_box(mins, maxs)) return KILN_BAD_ARGUMENT;
        Turned box{};
        double middle[2][3], s[3], e[3];
        for (std::size_t k = 0; k < 3; ++k) {
            box.half[k] = (maxs[k] - mins[k]) / 2;
            middle[0][k] = start[k] + (mins[k] + maxs[k]) / 2, middle[1][k] = end[k] + (mins[k] + maxs[k]) / 2;
            for (std::size_t a = 0; a < 3; ++a) box.axis[k][a] = pose->turn[a][k];
        }
        to_model(*pose, middle[0], s), to_model(*pose, middle[1], e);
        if (!usable(s) || !usable(e)) return KILN_BAD_ARGUMENT;
        Sweep sweep(*c, s, e, box, mask);
        for (const std::uint32_t b : brushes_of(*c, model)) sweep.take(b);
        sweep.walk(c->curves, model);
        sweep.finish(*level, start, end, *trace);
        double normal[3] = {};
        trace->distance -= dot3(trace->normal, pose->pivot);
        for (std::size_t k = 0; k < 3; ++k)
            for (std::size_t a = 0; a < 3; ++a) normal[k] += trace->normal[a] * pose->turn[a][k];
        for (std::size_t k = 0; k < 3; ++k) trace->distance += normal[k] * (pose->pivot[k] + pose->origin[k]), trace->normal[k] = normal[k];
        return KILN_OK;
    });
}

kiln_status kiln_posed_model_point_contents(const kiln_level* level, uint32_t model, const kiln_pose* pose,
                                            const double point[3], uint32_t* contents) {
    constexpr double kNowhere[3] = {0, 0, 0};
    if (!pose || !point || !contents || !usable(point) || !usable(pose->pivot) || !usable(pose->origin) || !is_rotation(pose->turn)) return KILN_BAD_ARGUMENT;
    double p[3];
    to_model(*pose, point, p);
    return kiln_model_point_contents(level, model, kNowhere, p, contents);
}

kiln_status kiln_point_contents(const kiln_level* level, const double point[3], uint32_t* contents) {
    if (!level || !point || !contents || !usable(point)) return KILN_BAD_ARGUMENT;
    *contents = 0;
    return guarded([&] {
        const Collision* c = level->get_collision();
        if (!c) return fault(*level);
        // Both sides of a plane that the point lies in: a brush may end there.
        const Nodes& nodes = *level->get_nodes();
        const Planes& planes = *level->get_planes();
        const Leaves& leaves = *level->get_leaves();
        Stack<std::int32_t> stack(c->depth);
        stack.push(nodes.rows.empty() ? -1 : 0);
        for (std::int32_t at = 0; stack.pop(at);) {
            if (at < 0) {
                if (leaves.rows.empty()) continue;
                const kiln_leaf& leaf = leaves.rows[static_cast<std::size_t>(-(at + 1))];
                for (std::uint32_t i = leaf.first_brush; i < leaf.first_brush + leaf.brush_count; ++i)
                    if (holds(*c, leaves.brushes[i], point)) *contents |= c->brushes[leaves.brushes[i]].contents;
                continue;
            }
            const kiln_node& n = nodes.rows[static_cast<std::size_t>(at)];
            const double d = dot3(planes.rows[n.plane].normal, point) - planes.rows[n.plane].distance;
            if (d <= kTouch) stack.push(n.child[1]);
            if (d >= -kTouch) stack.push(n.child[0]);
        }
        for (const std::uint32_t b : c->unlisted)
            if (holds(*c, b, point)) *contents |= c->brushes[b].contents;
        return KILN_OK;
    });
}

kiln_status kiln_model_point_contents(const kiln_level* level, uint32_t model, const double origin[3],
                                      const double point[3], uint32_t* contents) {
    if (!level || !origin || !point || !contents || !usable(origin) || !usable(point) || model >= level->info.models) return KILN_BAD_ARGUMENT;
    *contents = 0;
    const Collision* c = level->get_collision();
    if (!c) return fault(*level);
    const double p[3] = {point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]};
    for (const std::uint32_t b : brushes_of(*c, model))
        if (holds(*c, b, p)) *contents |= c->brushes[b].contents;
    return KILN_OK;
}

} // extern "C"

#include "compiler/surfaces/vertices.h"
#include <algorithm>
#include <bit>
#include <cmath>

namespace kiln {
namespace {

// Most vertices of most maps are dyadic: their rounded coordinates are the exact ones. kFineBits more bits than the
// input grid; |coordinate| <= 2^kScaledBits keeps every product of differences within 127 bits.
constexpr int kFineBits = 10;
constexpr int kScaledBits = 46;

std::size_t hash_of(const PlaneTriple& t) {
    std::uint64_t h = (t[0].value * 0x9E3779B97F4A7C15ull) ^ (t[1].value * 0xC2B2AE3D27D4EB4Full) ^ (t[2].value * 0x165667B19E3779F9ull);
    h ^= h >> 32;
    return (h * 0x9E3779B97F4A7C15ull) >> 20;
}
std::size_t hash_of(const Vec3& p) {
    std::uint64_t h = 0;
    for (const double x : {p.x, p.y, p.z}) h = (h ^ std::bit_cast<std::uint64_t>(x)) * 0x9E3779B97F4A7C15ull, h ^= h >> 32;
    return (h * 0xC2B2AE3D27D4EB4Full) >> 20;
}

} // namespace

Projection project_along(const PlaneTable& planes, PlaneId plane) {
    const ExactPlane& p = planes.planes[plane.at()];
    const std::array<std::int64_t, 3> n{p.a, p.b, p.c};
    std::size_t axis = 2;
    for (const std::size_t i : {std::size_t{1}, std::size_t{0}})
        if (std::abs(n[i]) > std::abs(n[axis])) axis = i;
    Projection r{(axis + 1) % 3, (axis + 2) % 3};
    if (n[axis] < 0) std::swap(r.u, r.v);
    return r;
}

VertexTable::VertexTable(const PlaneTable& planes) : planes_(planes), scale_(std::ldexp(1.0, planes.grid_bits + kFineBits)) {}

bool VertexTable::is_dyadic(const PlaneTriple& t, Vec3 p) const {
    for (std::size_t i = 0; i < 3; ++i) {
        const double x = p[i] * scale_;
        if (!(std::abs(x) <= static_cast<double>(std::int64_t{1} << kScaledBits)) || x != std::floor(x)) return false;
    }
    return std::ranges::all_of(t, [&, s = scaled(p)](PlaneId q) { return meets(s, q); });
}
std::array<std::int64_t, 3> VertexTable::scaled(Vec3 p) const {
    return {static_cast<std::int64_t>(p.x * scale_), static_cast<std::int64_t>(p.y * scale_), static_cast<std::int64_t>(p.z * scale_)};
}
bool VertexTable::meets(const std::array<std::int64_t, 3>& s, PlaneId q) const { // |.| < 2^109
    const ExactPlane& e = planes_.planes[q.at()];
    const __int128 at = static_cast<__int128>(e.a) * s[0] + static_cast<__int128>(e.b) * s[1] + static_cast<__int128>(e.c) * s[2];
    return at == e.d * (__int128{1} << kFineBits);
}

void VertexTable::grow_triples() {
    const std::vector<Known> old = std::move(by_triple_);
    by_triple_.assign(std::max<std::size_t>(64, old.size() * 2), {});
    const std::size_t mask = by_triple_.size() - 1;
    for (const Known& k : old) {
        if (!k.vertex.valid()) continue;
        std::size_t slot = hash_of(k.triple) & mask;
        while (by_triple_[slot].vertex.valid()) slot = (slot + 1) & mask;
        by_triple_[slot] = k;
    }
}
void VertexTable::grow_positions() {
    by_position_.assign(std::max<std::size_t>(64, by_position_.size() * 2), kFree);
    const std::size_t mask = by_position_.size() - 1;
    for (std::uint32_t i = 0; i < positions_.size(); ++i) {
        std::size_t slot = hash_of(positions_[i]) & mask;
        while (by_position_[slot] != kFree) slot = (slot + 1) & mask;
        by_position_[slot] = i;
    }
}

VertexId VertexTable::add(PlaneId p0, PlaneId p1, PlaneId p2) {
    PlaneTriple triple{PlaneId{p0.value & ~1u}, PlaneId{p1.value & ~1u}, PlaneId{p2.value & ~1u}}; // a point has no facing
    if (triple[1] < triple[0]) std::swap(triple[0], triple[1]);
    if (triple[2] < triple[1]) std::swap(triple[1], triple[2]);
    if (triple[1] < triple[0]) std::swap(triple[0], triple[1]);
    if (known_ * 2 >= by_triple_.size()) grow_triples();
    const std::size_t mask = by_triple_.size() - 1;
    std::size_t slot = hash_of(triple) & mask;
    for (; by_triple_[slot].vertex.valid(); slot = (slot + 1) & mask)
        if (by_triple_[slot].triple == triple) return by_triple_[slot].vertex;

    // Positions are correctly rounded: equal points have equal ones, whatever planes they come from.
    const Vec3 p = planes_.point(triple[0], triple[1], triple[2]) + Vec3{}; // no -0: it hashes otherwise
    if (positions_.size() * 2 >= by_position_.size()) grow_positions();
    const std::size_t position_mask = by_position_.size() - 1;
    std::size_t place = hash_of(p) & position_mask;
    VertexId v;
    for (; by_position_[place] != kFree && !v.valid(); place = (place + 1) & position_mask) {
        const VertexId other{by_position_[place]};
        if (positions_[other.at()] == p && std::ranges::all_of(triple, [&](PlaneId q) { return on(other, q); })) v = other;
    }
    if (!v.valid()) {
        v = id<VertexId>(positions_.size());
        by_position_[place] = v.value;
        triples_.push_back(triple);
        positions_.push_back(p);
        dyadic_.push_back(is_dyadic(triple, p) ? 1 : 0);
        for (const double x : {p.x, p.y, p.z}) extent_ = std::max(extent_, std::abs(x));
    }
    by_triple_[slot] = {triple, v};
    ++known_;
    return v;
}

void VertexTable::add(const PlanePolygon& polygon, Polygons& to) {
    const std::size_t from = to.vertices.size();
    to.vertices.resize(from + polygon.size()), to.lines.resize(from + polygon.size());
    add(polygon, to.vertices.data() + from, to.lines.data() + from);
    to.first.push_back(static_cast<std::uint32_t>(to.vertices.size()));
}

void VertexTable::add(const PlanePolygon& polygon, VertexId* vertices, PlaneId* lines) {
    PlaneId before = polygon.edges.back();
    for (const PlaneId after : polygon.edges) { // strictly convex: no vertex comes twice
        *vertices++ = add(polygon.support, before, after);
        *lines++ = before = after;
    }
}

int VertexTable::compare(VertexId a, VertexId b, std::size_t axis) const {
    const double x = positions_[a.at()][axis], y = positions_[b.at()][axis];
    if (x != y) return x < y ? -1 : 1; // rounding is monotonic
    if (a == b || (dyadic_[a.at()] && dyadic_[b.at()])) return 0;
    return compare_along(planes_, triples_[a.at()], triples_[b.at()], axis);
}

int VertexTable::turn(VertexId a, VertexId b, VertexId c, Projection axes) const {
    const Vec3 &pa = positions_[a.at()], &pb = positions_[b.at()], &pc = positions_[c.at()];
    const double bu = pb[axes.u] - pa[axes.u], bv = pb[axes.v] - pa[axes.v], cu = pc[axes.u] - pa[axes.u], cv = pc[axes.v] - pa[axes.v];
    const double left = bu * cv, right = bv * cu, value = left - right;
    // Each difference is off by less than 4 roundings of the largest coordinate, each product by one of its own.
    const double off = 4 * rounding();
    const double bound = 2 * off * (std::abs(bu) + std::abs(bv) + std::abs(cu) + std::abs(cv) + off) + 0x1p-50 * (std::abs(left) + std::abs(right));
    if (std::abs(value) > bound) return value > 0 ? 1 : -1;
    if (a == b || b == c || a == c) return 0;
    if (dyadic_[a.at()] && dyadic_[b.at()] && dyadic_[c.at()]) {
        const auto sa = scaled(pa), sb = scaled(pb), sc = scaled(pc);
        const __int128 s = static_cast<__int128>(sb[axes.u] - sa[axes.u]) * (sc[axes.v] - sa[axes.v]) -
                           static_cast<__int128>(sb[axes.v] - sa[axes.v]) * (sc[axes.u] - sa[axes.u]);
        return s > 0 ? 1 : s < 0 ? -1 : 0;
    }
    return kiln::turn(planes_, triples_[a.at()], triples_[b.at()], triples_[c.at()], axes.u, axes.v);
}

bool VertexTable::within(VertexId a, VertexId b, VertexId v) const {
    if (v == a || v == b) return false;
    const Vec3 pa = positions_[a.at()], pb = positions_[b.at()], pv = positions_[v.at()];
    std::size_t axis = 0;
    for (std::size_t i = 1; i < 3; ++i)
        if (std::abs(pb[i] - pa[i]) > std::abs(pb[axis] - pa[axis])) axis = i;
    const double lo = std::min(pa[axis], pb[axis]), hi = std::max(pa[axis], pb[axis]), x = pv[axis];
    if (lo < x && x < hi) return true;
    if (x < lo || hi < x) return false;
    for (std::size_t i = 0; i < 3; ++i) // rounding made one of two
        if (const int way = compare(a, b, i); way != 0) return compare(a, v, i) == way && compare(v, b, i) == way;
    return false;
}

} // namespace kiln

// Exact vertices: points where three planes meet, welded by exact equality, and the questions asked of them. Rounded
// coordinates answer where their error cannot matter, planes in common next, wide integers last.
#pragma once
#include "libs/exact/points.h"
#include <span>
#include <vector>

namespace kiln {

using VertexId = Index<struct VertexTag>; // two ids are equal exactly where the exact points are
using Loop = std::vector<VertexId>;

// A closed walk in some plane; lines[i] is another plane through the edge from vertices[i] to the one after it.
struct Outline {
    Loop vertices;
    std::vector<PlaneId> lines;
    friend auto operator<=>(const Outline&, const Outline&) = default;
};

// Polygons of one plane, end to end.
struct Polygons {
    Loop vertices;
    std::vector<PlaneId> lines;          // parallel, as in Outline
    std::vector<std::uint32_t> first{0}; // polygons + 1
    std::size_t size() const { return first.size() - 1; }
};
// Some of them that follow each other.
class PolygonSpan {
public:
    PolygonSpan(const Polygons& of) : PolygonSpan(of, 0, of.size()) {}
    PolygonSpan(const Polygons& of, std::size_t from, std::size_t count)
        : vertices_(of.vertices), lines_(of.lines), first_(std::span(of.first).subspan(from, count + 1)) {}
    std::size_t size() const { return first_.size() - 1; }
    std::size_t corners() const { return first_.back() - first_.front(); } // of all
    std::span<const VertexId> operator[](std::size_t i) const { return vertices_.subspan(first_[i], first_[i + 1] - first_[i]); }
    std::span<const PlaneId> lines(std::size_t i) const { return lines_.subspan(first_[i], first_[i + 1] - first_[i]); }
    std::span<const PlaneId> lines() const { return lines_.subspan(first_.front(), corners()); }

private:
    std::span<const VertexId> vertices_;
    std::span<const PlaneId> lines_;
    std::span<const std::uint32_t> first_;
};

// A plane seen from its front, its dominant axis dropped: (u, v) right-handed.
struct Projection {
    std::size_t u = 0, v = 1;
};
Projection project_along(const PlaneTable& planes, PlaneId plane);

class VertexTable {
public:
    explicit VertexTable(const PlaneTable& planes);
    VertexTable(const VertexTable&) = delete;
    VertexTable& operator=(const VertexTable&) = delete;

    VertexId add(PlaneId p0, PlaneId p1, PlaneId p2);
    // Appends the polygon.
    void add(const PlanePolygon& polygon, Polygons& to);
    // The same to a place with room for its corners.
    void add(const PlanePolygon& polygon, VertexId* vertices, PlaneId* lines);

    std::size_t size() const { return positions_.size(); }
    const PlaneTable& planes() const { return planes_; }
    Vec3 position(VertexId v) const { return positions_[v.at()]; } // rounded, map units
    const PlaneTriple& meeting(VertexId v) const { return triples_[v.at()]; }

    // Exact, all of them.
    int compare(VertexId a, VertexId b, std::size_t axis) const;
    // +1: a, b, c turn left in (u, v), -1: right, 0: they lie in one line there.
    int turn(VertexId a, VertexId b, VertexId c, Projection axes) const;
    bool on_line(VertexId v, PlaneId p, PlaneId q) const { return on(v, p) && on(v, q); }
    // Does v lie strictly between a and b, which lie on both planes?
    bool between(VertexId a, VertexId b, VertexId v, PlaneId p, PlaneId q) const { return on_line(v, p, q) && within(a, b, v); }
    // The same with all three known to be on one line.
    bool within(VertexId a, VertexId b, VertexId v) const;
    // What rounding may move a coordinate by, at most: map units.
    double rounding() const { return extent_ * 0x1p-53; }

private:
    const PlaneTable& planes_;
    std::vector<PlaneTriple> triples_; // even ids, ascending; of several that meet here the first met
    std::vector<Vec3> positions_;
    std::vector<std::uint8_t> dyadic_; // the rounded coordinates are the exact ones
    double extent_ = 0;                // largest coordinate
    double scale_ = 1;                 // of scaled()

    // Open addressing. Most vertices are met many times by the same planes, so what is asked for lies in the table itself.
    static constexpr std::uint32_t kFree = UINT32_MAX;
    struct Known {
        PlaneTriple triple;
        VertexId vertex; // none: free
    };
    std::vector<Known> by_triple_;
    std::size_t known_ = 0;                  // entries of by_triple_
    std::vector<std::uint32_t> by_position_; // vertices, or kFree

    bool on(VertexId v, PlaneId q) const {
        const PlaneTriple& t = triples_[v.at()];
        if (const std::uint32_t even = q.value & ~1u; even == t[0].value || even == t[1].value || even == t[2].value) return true;
        if (dyadic_[v.at()]) return meets(scaled(positions_[v.at()]), q);
        return planes_.side(t[0], t[1], t[2], q) == 0;
    }
    bool is_dyadic(const PlaneTriple& t, Vec3 p) const;
    std::array<std::int64_t, 3> scaled(Vec3 dyadic) const;
    bool meets(const std::array<std::int64_t, 3>& scaled, PlaneId q) const;
    void grow_triples();
    void grow_positions();
};

} // namespace kiln

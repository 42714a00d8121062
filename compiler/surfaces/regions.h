// Exact vertices, and what needs their exact coordinates: merging convex polygons of one plane into regions with
// holes, and triangulating those. CGAL stays behind this header (regions.cpp is the one unit that includes it).
#pragma once
#include "libs/exact/plane.h"
#include <memory>
#include <span>
#include <vector>

namespace kiln {

using VertexId = Index<struct VertexTag>; // two ids are equal exactly where the exact points are
using Loop = std::vector<VertexId>;

// Points where three planes meet, welded by exact equality.
class VertexTable {
public:
    explicit VertexTable(const PlaneTable& planes);
    ~VertexTable();
    VertexTable(const VertexTable&) = delete;
    VertexTable& operator=(const VertexTable&) = delete;

    VertexId add(PlaneId p0, PlaneId p1, PlaneId p2);
    Loop add(const PlanePolygon& polygon); // its vertices in order; equal neighbours once
    std::size_t size() const;
    const PlaneTable& planes() const;
    Vec3 position(VertexId v) const;       // rounded, map units
    // Does v lie strictly between a and b on the straight line through them? Exact.
    bool between(VertexId a, VertexId b, VertexId v) const;

    struct Data;
    const Data& data() const { return *data_; }

private:
    std::unique_ptr<Data> data_;
};

// A maximal edge-connected region: loops[0] outer, counter-clockwise seen from the front; the others holes, clockwise.
// No vertex lies straight between its neighbours. Loops are simple; two may touch at a vertex.
struct Region {
    std::vector<Loop> loops;
    std::vector<std::uint32_t> members; // indices of the polygons it was merged from, ascending
};

// Convex, counter-clockwise polygons of one plane that overlap nowhere, merged. The regions are ordered by their
// first member. `merged` becomes false where the library refused and every polygon stays a region of its own.
std::vector<Region> merge_polygons(const VertexTable& vertices, PlaneId plane, std::span<const Loop> polygons,
                                   bool& merged);

// Constrained Delaunay triangulation in exact coordinates, counter-clockwise seen from the front. The loops may hold
// vertices straight between their neighbours (T-junctions). Empty where the library refused.
std::vector<std::array<VertexId, 3>> triangulate(const VertexTable& vertices, PlaneId plane, const std::vector<Loop>& loops);

} // namespace kiln

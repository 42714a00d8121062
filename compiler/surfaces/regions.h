// Merging convex polygons of one plane into regions with holes, and triangulating those.
#pragma once
#include "compiler/surfaces/vertices.h"
#include <memory>
#include <optional>

namespace kiln {

// A maximal edge-connected region: loops[0] outer, counter-clockwise seen from the front; the others holes, clockwise.
// No vertex lies straight between its neighbours. Loops are simple; two may touch at a vertex.
struct Region {
    std::vector<Outline> loops;
    std::vector<std::uint32_t> members; // indices of the polygons it was merged from, ascending
};

// Convex, counter-clockwise polygons of one plane that overlap nowhere, merged. The regions are ordered by their
// first member. `merged` becomes false where nothing could merge them and every polygon stays a region of its own.
std::vector<Region> merge_polygons(const VertexTable& vertices, PlaneId plane, PolygonSpan polygons, bool& merged);
// The same for many groups one after another, which share their scratch memory.
class RegionMerger {
public:
    explicit RegionMerger(const VertexTable& vertices);
    ~RegionMerger();
    std::vector<Region> merge(PlaneId plane, PolygonSpan polygons, bool& merged);

private:
    struct Work;
    std::unique_ptr<Work> work_;
};

// The two ways behind merge_polygons; nothing: refused. Edge against opposite edge first; it refuses what overlaps and
// what rounded areas cannot tell. Then the Boolean set operations of CGAL on rational numbers.
std::optional<std::vector<Region>> merge_by_edges(const VertexTable& vertices, PlaneId plane, PolygonSpan polygons);
std::optional<std::vector<Region>> merge_by_union(const VertexTable& vertices, PlaneId plane, PolygonSpan polygons);

// A closed walk that passes some vertices several times, as simple loops.
std::vector<Outline> split_at_repeats(const Outline& walk);
// Vertices straight between their neighbours go; the loop starts at its smallest id.
Outline simplify(const VertexTable& vertices, PlaneId plane, const Outline& loop);

// Constrained Delaunay triangulation in exact coordinates, counter-clockwise seen from the front. The loops may hold
// vertices straight between their neighbours (T-junctions). Empty where the library refused.
std::vector<std::array<VertexId, 3>> triangulate(const VertexTable& vertices, PlaneId plane, const std::vector<Outline>& loops);

} // namespace kiln

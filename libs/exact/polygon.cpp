#include "libs/exact/plane.h"
#include "libs/core/check.h"
#include <algorithm>

namespace kiln {
namespace {

// Sides of all vertices with respect to q, each computed once. On the stack for polygons of ordinary size.
class VertexSides {
public:
    VertexSides(const PlaneTable& table, const PlanePolygon& polygon, PlaneId q) {
        const std::size_t n = polygon.size();
        if (n > kSmall) large_.resize(n), sides_ = large_.data();
        PlaneId before = polygon.edges.back();
        for (std::size_t i = 0; i < n; ++i) {
            const PlaneId after = polygon.edges[i];
            const int s = table.side(polygon.support, before, after, q);
            sides_[i] = static_cast<std::int8_t>(s);
            front = front || s > 0;
            back = back || s < 0;
            before = after;
        }
    }
    VertexSides(const VertexSides&) = delete;
    VertexSides& operator=(const VertexSides&) = delete;
    int operator[](std::size_t i) const { return sides_[i]; }
    bool front = false, back = false;

private:
    static constexpr std::size_t kSmall = 64;
    std::array<std::int8_t, kSmall> small_;
    std::vector<std::int8_t> large_;
    std::int8_t* sides_ = small_.data();
};

bool in_plane(const PlanePolygon& polygon, PlaneId q) { return (polygon.support.value ^ q.value) <= 1; }

// The part where `keep` * side > 0; `cut` closes it, its outside being the other part. Edge i runs from vertex i to
// vertex i + 1 and stays if it has a point in the part; where the boundary leaves the part, the cut begins.
PlanePolygon part(const PlanePolygon& polygon, const VertexSides& sides, int keep, PlaneId cut) {
    const std::size_t n = polygon.size();
    PlanePolygon result{polygon.support, {}};
    result.edges.reserve(n + 1);
    for (std::size_t i = 0; i < n; ++i) {
        const int here = keep * sides[i], there = keep * sides[i + 1 == n ? 0 : i + 1];
        if (here <= 0 && there <= 0) continue;
        result.edges.push_back(polygon.edges[i]);
        if (there <= 0) result.edges.push_back(cut);
    }
    return result;
}

} // namespace

SplitPolygon split(const PlaneTable& table, const PlanePolygon& polygon, PlaneId q) {
    if (in_plane(polygon, q)) return {.front = {}, .back = {}, .on = true};
    const VertexSides sides(table, polygon, q);
    KILN_CHECK(sides.front || sides.back); // else the polygon has no area
    SplitPolygon result;
    if (!sides.back) result.front = polygon;
    else if (!sides.front) result.back = polygon;
    else {
        result.front = part(polygon, sides, +1, flipped(q));
        result.back = part(polygon, sides, -1, q);
    }
    return result;
}

PolygonSides classify(const PlaneTable& table, const PlanePolygon& polygon, PlaneId q) {
    if (in_plane(polygon, q)) return {};
    const VertexSides sides(table, polygon, q);
    return {sides.front, sides.back};
}

bool clip_to_back(const PlaneTable& table, PlanePolygon& polygon, PlaneId q) {
    if (in_plane(polygon, q)) return true;
    const VertexSides sides(table, polygon, q);
    if (!sides.front) return sides.back;
    if (!sides.back) return false;
    // As part() does, in place: an edge is read before its place is written but where the cut comes in; that one waits.
    std::vector<PlaneId>& edges = polygon.edges;
    const std::size_t n = edges.size();
    std::size_t kept = 0, cut = 0; // the cut goes before edge `cut` of the kept
    for (std::size_t i = 0; i < n; ++i) {
        const int here = sides[i], there = sides[i + 1 == n ? 0 : i + 1];
        if (here >= 0 && there >= 0) continue;
        edges[kept++] = edges[i];
        if (there >= 0) cut = kept;
    }
    edges.resize(kept);
    edges.insert(edges.begin() + static_cast<std::ptrdiff_t>(cut), q);
    return true;
}

PlanePolygon flipped(const PlanePolygon& polygon) {
    PlanePolygon result{flipped(polygon.support), polygon.edges};
    std::reverse(result.edges.begin(), result.edges.end());
    return result;
}

std::vector<Vec3> points(const PlaneTable& table, const PlanePolygon& polygon) {
    std::vector<Vec3> result;
    result.reserve(polygon.size());
    for (std::size_t i = 0; i < polygon.size(); ++i)
        result.push_back(
            table.point(polygon.support, polygon.edges[i == 0 ? polygon.size() - 1 : i - 1], polygon.edges[i]));
    return result;
}

} // namespace kiln

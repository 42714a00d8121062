// Exact planes and the predicates over them. A plane is a*x + b*y + c*z = d with integers, (a,b,c,d) divided by
// their gcd, x in map units times 2^grid_bits; interned so that equal planes have equal ids, and
// id ^ 1 is the same plane facing the other way. A vertex is the meeting of three planes.
// No predicate uses an epsilon: tiers are plane identity, doubles whose magnitude bound makes them exact,
// filtered doubles, __int128, 512-bit integers. Source: the measured study in NOTES.md.
//
// Range    |grid coordinate| <= 2^29 for any three points (2^19 map units on the finest grid, 2^-10): then
//          |a|,|b|,|c| <= 2^61, |d| < 2^93 and every determinant below fits 512 bits
#pragma once
#include "libs/core/archive.h"
#include "libs/core/index.h"
#include "libs/math/vec.h"
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

namespace kiln {

using PlaneId = Index<struct PlaneTag>;
constexpr PlaneId flipped(PlaneId p) { return {p.value ^ 1u}; }

struct ExactPlane {
    static constexpr bool kRawBytes = true; // no padding: 3*8 + pad is avoided by the order below
    __int128 d = 0;
    std::int64_t a = 0, b = 0, c = 0, reserved = 0;
    friend bool operator==(const ExactPlane&, const ExactPlane&) = default;
};

using GridPoint = std::array<std::int64_t, 3>; // map units * 2^grid_bits, |.| <= 2^29
constexpr std::int64_t kMaxGridCoordinate = std::int64_t{1} << 29;

// Plane through three points, not interned, reduced by gcd; normal = (p2-p0) x (p1-p0). Nothing: collinear.
std::optional<ExactPlane> plane_through(const GridPoint& p0, const GridPoint& p1, const GridPoint& p2);

class PlaneTable {
public:
    int grid_bits = 0; // coordinates are multiples of 2^-grid_bits map units
    std::vector<ExactPlane> planes; // even id: as first met; odd: flipped
    template <class A> void fields(A& a) {
        a(grid_bits, planes);
        if constexpr (std::is_same_v<A, ByteReader>) reindex();
    }
    void reindex(); // rebuilds the hash index and the double copies from `planes`

    // Plane through three points, normal = (p2-p0) x (p1-p0): outward for points clockwise seen from outside.
    // Nothing where they are collinear.
    std::optional<PlaneId> add(const GridPoint& p0, const GridPoint& p1, const GridPoint& p2);
    PlaneId add(const ExactPlane& plane); // reduces by gcd, interns
    std::optional<PlaneId> find(const ExactPlane& plane) const; // `plane` must be reduced

    Vec3 normal(PlaneId p) const;     // unit, map space
    double distance(PlaneId p) const; // map units: dot(normal, x) = distance
    // -1: behind, 0: on, +1: in front of q lies the point where planes p0, p1, p2 meet (they must meet in one).
    int side(PlaneId p0, PlaneId p1, PlaneId p2, PlaneId q) const;
    int side(const GridPoint& point, PlaneId q) const;
    // Sign of dot(cross(n0, n1), n2); 0: the three do not meet in one point.
    int orientation(PlaneId p0, PlaneId p1, PlaneId p2) const;
    // Do p and q have parallel normals (0 no, +1 same way, -1 opposite)?
    int parallel(PlaneId p, PlaneId q) const;
    // Nearest double coordinates (map units) of the meeting point: the one place where exact becomes rounded.
    // Each coordinate is the exact one correctly rounded (half to even), whatever the angles; so equal points
    // give equal doubles, from whichever planes they come.
    Vec3 point(PlaneId p0, PlaneId p1, PlaneId p2) const;
    // The meeting point exactly: numerators x, y, z and positive denominator w as reduced decimal-free
    // big integers in text (for exact welding and for CGAL), coordinates in map units.
    std::array<std::string, 4> exact_point(PlaneId p0, PlaneId p1, PlaneId p2) const;

private:
    struct HashPlane { std::size_t operator()(const ExactPlane& p) const; };
    std::unordered_map<ExactPlane, std::uint32_t, HashPlane> index_;
    // The same planes as doubles (nearest), with bounds: m >= |a|,|b|,|c|.
    struct Approximate { double a, b, c, d, m; };
    std::vector<Approximate> approximate_;
    void append(const ExactPlane& plane);
    int side_exact(PlaneId p0, PlaneId p1, PlaneId p2, PlaneId q, double bound) const;
};

// A convex polygon as planes: lies on `support`, bounded by `edges` in counter-clockwise order seen from the
// front of `support`; the inside is behind every edge plane. Vertex i = support ^ edges[i-1] ^ edges[i].
struct PlanePolygon {
    PlaneId support;
    std::vector<PlaneId> edges;
    template <class A> void fields(A& a) { a(support, edges); }
    std::size_t size() const { return edges.size(); }
    friend bool operator==(const PlanePolygon&, const PlanePolygon&) = default;
};
// The same area facing the other way.
PlanePolygon flipped(const PlanePolygon& polygon);

struct SplitPolygon {
    std::optional<PlanePolygon> front, back; // both empty: the polygon lies in the plane
    bool on = false;
};
// Exact split of `polygon` by plane q. Parts are never dropped, however thin.
SplitPolygon split(const PlaneTable& table, const PlanePolygon& polygon, PlaneId q);

// On which sides of q the polygon has area (both false: it lies in the plane). Allocates nothing for up to 64 edges.
struct PolygonSides {
    bool front = false, back = false;
};
PolygonSides classify(const PlaneTable& table, const PlanePolygon& polygon, PlaneId q);
// Cuts away what is in front of q; false: nothing (with area) is left and `polygon` is unspecified. A polygon that
// lies in q is left alone (true). Cheaper than split().
bool clip_to_back(const PlaneTable& table, PlanePolygon& polygon, PlaneId q);

// Rounded vertices, map units, in the polygon's order.
std::vector<Vec3> points(const PlaneTable& table, const PlanePolygon& polygon);

} // namespace kiln

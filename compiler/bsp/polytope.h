// Private to bsp: plane polygons with their rounded points at hand, and convex polytopes made of them.
// Whether something lies before, behind or in a plane is always decided exactly; the rounded points only
// answer where the distance exceeds every rounding error by far.
#pragma once
#include "libs/exact/plane.h"
#include <optional>
#include <span>
#include <vector>

namespace kiln::bsp {

// The plane table with the distance beyond which rounded coordinates are to be believed.
struct Space {
    const PlaneTable& planes;
    double margin; // map units
    Space(const PlaneTable& table, const Box3& world);
};

struct Splitter {
    PlaneId plane;
    Vec3 normal;
    double distance = 0;
    Splitter(PlaneId p, Vec3 n, double d) : plane(p), normal(n), distance(d) {}
    Splitter(const PlaneTable& table, PlaneId p) : plane(p), normal(table.normal(p)), distance(table.distance(p)) {}
};

struct Poly {
    PlanePolygon polygon;
    std::vector<Vec3> points; // rounded
    Box3 box;
};
Poly make_poly(const PlaneTable& table, PlanePolygon polygon);

constexpr unsigned kFront = 1, kBack = 2, kBoth = 3;
inline bool same_plane(PlaneId a, PlaneId b) { return (a.value | 1u) == (b.value | 1u); }

// kFront or kBack where the whole box certainly lies there, else kBoth.
unsigned box_side(const Space& space, const Box3& box, const Splitter& q);
// Where the polygon has points off the plane; 0: it lies in it.
unsigned sides(const Space& space, const Poly& poly, const Splitter& q);
// Cuts in place: kFront, kBack: the whole polygon is there; 0: it lies in q; in these `poly` stays. kBoth: `poly` is now the
// part in front, `back` the other.
unsigned divide(const Space& space, Poly& poly, const Splitter& q, Poly& back);
struct Halves {
    std::optional<Poly> front, back;
};
Halves cut(const Space& space, Poly&& poly, const Splitter& q);

// q's whole plane within the world's box (four box planes as edges; the two of q's main axis are not among them).
PlanePolygon plane_quad(const PlaneTable& table, const std::array<PlaneId, 6>& box, PlaneId q);
// What of `polygon` is behind every support of `faces`; nothing where that has no area.
std::optional<PlanePolygon> clip_behind(const PlaneTable& table, PlanePolygon polygon, std::span<const Poly> faces);
// The six faces of the world's box.
std::vector<Poly> box_faces(const PlaneTable& table, const std::array<PlaneId, 6>& box);

struct Polytope {
    std::vector<Poly> faces; // facing out
    Box3 box;
};
void refresh_box(Polytope& polytope);
// Where the polytope has volume. Never 0.
unsigned sides(const Space& space, const Polytope& polytope, const Splitter& q);
// Cuts a polytope that q crosses; `cap` is q within the polytope, facing as q.
void cut(const Space& space, Polytope&& polytope, const Splitter& q, const PlanePolygon& cap, Polytope& front,
         Polytope& back);

double area(std::span<const Vec3> winding);
Vec3 centroid(std::span<const Vec3> winding);
double width(std::span<const Vec3> winding); // least extent in its plane

} // namespace kiln::bsp

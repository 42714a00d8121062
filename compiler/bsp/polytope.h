// Private to bsp: plane polygons with their rounded points at hand, and convex polytopes made of them.
// Whether something lies before, behind or in a plane is always decided exactly; the rounded points only
// answer where the distance exceeds every rounding error by far.
//
// A large level has millions of polygons and each lives for a few cuts: a polygon or polytope is a plain value whose
// corners or faces lie in a pool, copied with the value alone, given back when it is cut or dropped.
#pragma once
#include "compiler/bsp/pool.h"
#include "libs/exact/plane.h"
#include <cmath>
#include <span>
#include <vector>

namespace kiln::bsp {

struct Splitter {
    PlaneId plane;
    Vec3 normal;
    double distance = 0;
    Splitter(PlaneId p, Vec3 n, double d) : plane(p), normal(n), distance(d) {}
    Splitter(const PlaneTable& table, PlaneId p) : plane(p), normal(table.normal(p)), distance(table.distance(p)) {}
};

// The plane table with the distance beyond which rounded coordinates are to be believed.
struct Space {
    const PlaneTable& planes;
    double margin; // map units
    Space(const PlaneTable& table, const Box3& world);
    const Splitter& splitter(PlaneId even) const { return splitters[even.at() / 2]; }

    std::vector<Splitter> splitters; // per pair of planes: normals take roots and divisions, and each plane is asked for often
};

struct Corner {
    Vec3 point;   // rounded
    PlaneId edge; // of the edge from here to the next corner, as in PlanePolygon
};
struct Poly { // one cache line; memory: a Cutter's
    Box3 box;
    Corner* first = nullptr;
    std::uint32_t count = 0;
    PlaneId support;
    std::span<const Corner> corners() const { return {first, count}; }
};
PlanePolygon polygon(const Poly& poly);
std::vector<Vec3> winding(const Poly& poly);
double area(const Poly& poly);

struct Polytope { // memory: a Cutter's
    Box3 box;
    Poly* first = nullptr; // facing out
    std::uint32_t count = 0, room = 0;
    std::span<const Poly> faces() const { return {first, count}; }
};

constexpr unsigned kFront = 1, kBack = 2, kBoth = 3;
inline bool same_plane(PlaneId a, PlaneId b) { return (a.value | 1u) == (b.value | 1u); }

// kFront or kBack where the whole box certainly lies there, else kBoth.
inline unsigned box_side(const Space& space, const Box3& box, const Splitter& q) {
    const Vec3 c = box.center(), h = box.size() * 0.5;
    const double at = dot(q.normal, c) - q.distance;
    const double reach = std::abs(q.normal.x) * h.x + std::abs(q.normal.y) * h.y + std::abs(q.normal.z) * h.z;
    if (at - reach > space.margin) return kFront;
    if (at + reach < -space.margin) return kBack;
    return kBoth;
}

// q's whole plane within the world's box (four box planes as edges; the two of q's main axis are not among them).
PlanePolygon plane_quad(const PlaneTable& table, const std::array<PlaneId, 6>& box, PlaneId q);

// Makes and cuts polygons and polytopes, and owns their memory.
class Cutter {
public:
    explicit Cutter(const Space& space) : space_(space) {}
    const Space& space() const { return space_; }
    void clear() { pool_.clear(); } // all that was made is gone

    Poly make(const PlanePolygon& polygon);
    Poly copy(const Poly& poly);
    Polytope make(std::span<const PlanePolygon> faces);
    Polytope copy(const Polytope& body);
    Polytope make_box(const std::array<PlaneId, 6>& box);
    void drop(const Poly& poly) { pool_.give(poly.first, poly.count); }
    void drop(const Polytope& body);

    // Cuts in place: kFront, kBack: the whole polygon is there; 0: it lies in q; in these `poly` stays. kBoth: `poly` is
    // now the part in front, `back` the other.
    unsigned divide(Poly& poly, const Splitter& q, Poly& back);

    // Where the polytope has volume; never 0. kBoth: `body` is gone, `front` and `back` are its parts.
    // `around`: edges of a polygon in q, facing as q, that has all of q within the body in it.
    unsigned divide(Polytope& body, const Splitter& q, std::span<const PlaneId> around, Polytope& front, Polytope& back);
    // Cuts a polytope of the world within the box that q must cross. Gives q within it, facing as q (a copy is in `back`).
    Poly cut(Polytope& body, const Splitter& q, const std::array<PlaneId, 6>& box, Polytope& front, Polytope& back);

private:
    const Space& space_;
    Pool pool_;
    // Of what is being cut, kept for its memory. Sides of corners, +1 in front; of a polytope those of its faces, one
    // after the other, set where the face is crossed.
    std::vector<std::int8_t> side_;
    std::vector<PlaneId> faces_;
    std::vector<std::uint8_t> face_side_; // parallel: kFront, kBack, kBoth
    struct Crossed {                      // a face of the polytope that q crosses
        PlaneId face, in, out;            // planes of the edges where its border goes to the back and to the front of q; none: at a corner
        Vec3 in_point, out_point;
        bool clean = true;                // no corner lies in q
    };
    std::vector<Crossed> crossed_;
    PlanePolygon outline_;

    template <class PointOf> Poly make(const PlanePolygon& polygon, const PointOf& point_of); // point_of(edge before, edge)
    std::int8_t* sides_of(std::size_t corners);
    unsigned classify(const Poly& poly, const Splitter& q, std::int8_t* side) const;
    unsigned classify(const Polytope& body, const Splitter& q);
    const Vec3* find_crossing(PlaneId face, PlaneId edge) const;
    Poly part(const Poly& poly, const std::int8_t* side, int keep, PlaneId closing, std::size_t in, const Crossed& points);
    void split(const Poly& poly, const Splitter& q, const std::int8_t* side, Crossed& crossed, Poly& front, Poly& back);
    void split_faces(Polytope& body, const Splitter& q, Polytope& front, Polytope& back);
    bool walk_section(const Splitter& q, Poly& section);
    Poly clip_section(const Splitter& q);
    void close(const Poly& section, Polytope& front, Polytope& back);
};

double area(std::span<const Vec3> winding);
Vec3 centroid(std::span<const Vec3> winding);
double width(std::span<const Vec3> winding); // least extent in its plane

} // namespace kiln::bsp

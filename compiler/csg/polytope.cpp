#include "compiler/csg/polytope.h"
#include <cmath>

namespace kiln {

PlanePolygon world_polygon(const PlaneTable& planes, const std::array<PlaneId, 6>& cube, PlaneId plane) {
    const ExactPlane& p = planes.planes[plane.at()];
    const auto magnitude = [](std::int64_t v) { return v < 0 ? -v : v; };
    const std::int64_t a = magnitude(p.a), b = magnitude(p.b), c = magnitude(p.c);
    // Seen along the largest component of the normal the plane is at most 1 : 1 steep, so four planes of the cube
    // always bound it.
    const std::size_t axis = a >= b && a >= c ? 0 : b >= c ? 1 : 2;
    const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    const std::int64_t facing = axis == 0 ? p.a : axis == 1 ? p.b : p.c;
    const PlaneId lo_u = cube[2 * u], hi_u = cube[2 * u + 1], lo_v = cube[2 * v], hi_v = cube[2 * v + 1];
    if (facing > 0) return {plane, {lo_v, hi_u, hi_v, lo_u}};
    return {plane, {lo_v, lo_u, hi_v, hi_u}};
}

namespace csg_detail {

Box3 box_of(const PlaneTable& planes, const PlanePolygon& polygon) {
    Box3 box;
    PlaneId before = polygon.edges.back();
    for (const PlaneId after : polygon.edges) {
        box.add(planes.point(polygon.support, before, after));
        before = after;
    }
    return box;
}

PolytopeResult build_polytope(const PlaneTable& planes, const std::array<PlaneId, 6>& cube,
                              std::span<const SidePlane> sides) {
    PolytopeResult result;
    BrushPolytope& polytope = result.polytope;
    for (const SidePlane& s : sides) {
        for (const SidePlane& t : sides) {
            // The only way to a flat but not empty intersection: two half-spaces that share just their plane.
            if (t.plane == flipped(s.plane)) return {Flaw::empty, {}};
        }
        PlanePolygon face = world_polygon(planes, cube, s.plane);
        bool left = true;
        for (const SidePlane& t : sides)
            if (t.plane != s.plane && !(left = clip_to_back(planes, face, t.plane))) break;
        if (!left) continue;
        for (const PlaneId e : face.edges)
            for (const PlaneId w : cube)
                if (e == w) return {Flaw::unbounded, {}};
        polytope.bounds.add(box_of(planes, face));
        polytope.faces.push_back(std::move(face));
        polytope.sides.push_back(s.side);
    }
    // No face has area: the intersection has no inside (or it is all space, without sides).
    if (polytope.faces.empty()) return {sides.empty() ? Flaw::unbounded : Flaw::empty, {}};
    polytope.valid = true;
    return result;
}

std::vector<std::vector<Vec3>> approximate_faces(std::span<const PlaneD> planes) {
    std::vector<std::vector<Vec3>> faces(planes.size());
    for (std::size_t i = 0; i < planes.size(); ++i) {
        const Frame f = frame_around(planes[i].normal);
        const Vec3 center = planes[i].normal * planes[i].distance;
        const double r = 2 * kWorldHalfSize;
        std::vector<Vec3> face{center - f.t * r - f.b * r, center + f.t * r - f.b * r, center + f.t * r + f.b * r,
                               center - f.t * r + f.b * r},
            next;
        for (std::size_t j = 0; j < planes.size() && !face.empty(); ++j) {
            if (j == i) continue;
            next.clear();
            for (std::size_t k = 0; k < face.size(); ++k) {
                const Vec3 p = face[k], q = face[(k + 1) % face.size()];
                const double dp = dot(planes[j].normal, p) - planes[j].distance,
                             dq = dot(planes[j].normal, q) - planes[j].distance;
                if (dp <= 0) next.push_back(p);
                if ((dp < 0 && dq > 0) || (dp > 0 && dq < 0)) next.push_back(p + (q - p) * (dp / (dp - dq)));
            }
            face.swap(next);
        }
        if (face.size() >= 3) faces[i] = std::move(face);
    }
    return faces;
}

} // namespace csg_detail
} // namespace kiln

// Surfaces: what is drawn and lit. Visible fragments merged into maximal regions with holes, triangulated without
// T-junctions over shared vertices, smoothed, given tangent frames, charts and luxels. Displacements and patches as
// grids of flat faces that share a chart.
//
// In       world, csg, bsp
// Out      tables below; positions are rounded once (PlaneTable::point) and welded by exact equality
// Errors   a displacement whose base is no quad, a patch without area: reported, left out; a side whose texture axes
//          lie in one line gets a frame of its plane and a warning
#pragma once
#include "compiler/bsp/bsp.h"

namespace kiln {

using FaceId = Index<struct FaceTag>;
using ChartId = Index<struct ChartTag>;

struct Face { // a maximal connected region of one brush side
    SideId side;                    // none: of a patch
    MaterialId material;
    ModelId model;
    PlaneId plane;                  // none: of a curve, whose faces have no exact plane
    ChartId chart;                  // none: sky, nolight and light blockers that are not drawn
    Vec3 normal;                    // unit, of the plane: points to the air
    double distance = 0;            // dot(normal, x) = distance
    Frame tangent;                  // t along increasing u, b = +-cross(n, t) along increasing v (down in the image)
    std::uint32_t first_triangle = 0, triangle_count = 0;
    double area = 0;                // map units squared
    Box3 bounds;
    std::vector<ClusterId> clusters; // it borders, sorted; empty for brush models
    bool drawn = true;              // false: in the ray scene only (nodraw, light blockers, sky)
    bool blocks_light = true;       // false: clip-like invisibles, non-shadowing brush models
    bool sky = false;
    bool two_sided = false;         // drawn from behind too (water against air, two-sided materials)
    bool hull = false;              // part of the closed boundary of what is solid (structural or detail)
    std::uint32_t curve = UINT32_MAX; // index into Surfaces::curves; none: of a brush, whose faces come before those of curves
    bool curved() const { return curve != UINT32_MAX; }
    template <class A> void fields(A& a) {
        a(side, material, model, plane, chart, normal, distance, tangent, first_triangle, triangle_count, area, bounds,
          clusters, drawn, blocks_light, sky, two_sided, hull, curve);
    }
};

// A displacement or a patch: a grid of vertices, row by row, cross(along a row, from row to row) to the front. Each
// quad is two triangles; its diagonal joins the corners whose row + column is even. Each triangle is a face, but for
// those beside it that lie in its plane and have their luxels on the same lattice: they are one with it. Where a finer
// neighbour has vertices on a border edge, the triangle at that edge is several.
struct Curve {
    enum Kind : std::uint8_t { displacement, patch };
    Kind kind = displacement;
    std::uint32_t source = 0;       // index into World::displacements or World::patches
    std::uint32_t first_face = 0, face_count = 0;
    std::uint32_t columns = 0, rows = 0;
    std::vector<std::uint32_t> grid; // positions, [row * columns + column]
    std::vector<Vec2> uv;            // parallel to grid: repeats of the texture, v down
    std::array<Vec3, 4> base{};      // displacements: corners of the base face, from that of vertex 0 on, counter-clockwise
    PlaneId base_plane;              // displacements: of the base face
    template <class A> void fields(A& a) { a(kind, source, first_face, face_count, columns, rows, grid, uv, base, base_plane); }
};
struct CurveCorner { // of a triangle of a curve
    static constexpr bool kRawBytes = true;
    Vec2 luxel, uv;                 // luxel coordinates in the chart; repeats of the texture, v down
    double alpha = 0;               // 0..1; displacements
};

// Luxel coordinates of a plane: of x  (dot(x - origin, s), dot(x - origin, t)),  back  origin + i * luxel.x + j * luxel.y
struct LuxelMap {
    static constexpr bool kRawBytes = true;
    Vec3 origin, s, t, i, j;        // s, t: luxels a unit, in the plane; i, j: units a luxel
};

// One luxel grid over coplanar, edge-connected faces of equal tangent frame and luxel size. Texel (i,j) covers
// the square [i,i+1)x[j,j+1) of luxel coordinates; its centre is (i+.5, j+.5). The outermost ring is gutter.
//   luxel coordinate of x = (dot(x - origin, s), dot(x - origin, t)) / luxel_size
// The lattice of an s or t along an axis is the world's: dot(origin, s) and dot(origin, t) are multiples of luxel_size. A slanted one is counted from the map's corner.
// The chart of a curve has the luxels of all its faces, along its rows (x) and columns (y), each face with a LuxelMap of
// its own; origin, s, t and n are then those of the plane nearest to it. No luxel edge is longer than luxel_size.
struct Chart {
    Vec3 origin, s, t, n;           // s, t unit, in the plane; s along the tangent; n = face normal; t = cross(n, s)
    Frame frame;                    // RNM frame of the chart: its faces' tangent frame
    double luxel_size = 16;         // map units
    std::uint32_t width = 0, height = 0; // texels, gutter included
    std::uint32_t first_texel = 0;  // into arrays over all texels of all charts
    std::vector<FaceId> faces;
    bool smooth = false;            // some corner normal differs from n
    std::uint32_t curve = UINT32_MAX; // index into Surfaces::curves; none: of brush faces
    bool curved() const { return curve != UINT32_MAX; }
    std::uint32_t texel(std::uint32_t x, std::uint32_t y) const { return first_texel + y * width + x; } // into those arrays
    template <class A> void fields(A& a) {
        a(origin, s, t, n, frame, luxel_size, width, height, first_texel, faces, smooth, curve);
    }
};

// A texel with a part of its square on a visible face: the exact footprint in convex pieces.
struct Luxel {
    static constexpr bool kRawBytes = true;
    ChartId chart;
    std::uint16_t x = 0, y = 0;
    FaceId face;                    // that owns most of it
    float area = 0;                 // of the footprint, luxel units squared (1: whole)
    std::uint32_t first_piece = 0, piece_count = 0;
    std::uint32_t centroid = UINT32_MAX; // of the footprint, in Surfaces::centroids; none: the middle of the square
};
// Convex, counter-clockwise (seen from the front), luxel coordinates: points_of. Nearly all are whole squares, which
// have no points of their own: there point_count is 0, and first_point is x + 65536 y. Of a rectangle along the lattice
// the first point and the one across are kept: there point_count is 2.
struct LuxelPiece {
    static constexpr bool kRawBytes = true;
    FaceId face;
    std::uint32_t first_point = 0, point_count = 0; // in Surfaces::piece_points
    bool square() const { return point_count == 0; }
};
inline LuxelPiece square_piece(FaceId face, std::uint32_t x, std::uint32_t y) { return {face, x | y << 16, 0}; }
// The points of a piece; as long as the table they are in stands.
class PiecePoints {
public:
    PiecePoints(const LuxelPiece& piece, const std::vector<Vec2>& points) {
        if (piece.square()) {
            const double x = piece.first_point & 0xFFFF, y = piece.first_point >> 16;
            own_ = {{{x, y}, {x + 1, y}, {x + 1, y + 1}, {x, y + 1}}};
        } else if (piece.point_count == 2) {
            const Vec2 p = points[piece.first_point], q = points[piece.first_point + 1];
            const bool x_first = (p.x < q.x) == (p.y < q.y); // counter-clockwise
            own_ = {{p, x_first ? Vec2{q.x, p.y} : Vec2{p.x, q.y}, q, x_first ? Vec2{p.x, q.y} : Vec2{q.x, p.y}}};
        } else {
            points_ = points.data() + piece.first_point, size_ = piece.point_count;
        }
    }
    const Vec2* begin() const { return points_ ? points_ : own_.data(); }
    const Vec2* end() const { return begin() + size_; }
    std::size_t size() const { return size_; }
    const Vec2& operator[](std::size_t i) const { return begin()[i]; }

private:
    std::array<Vec2, 4> own_;
    const Vec2* points_ = nullptr;
    std::size_t size_ = 4;
};

// A common edge of two charts across which light should look continuous: they lie in one plane, or the shading
// normals of both sides agree along it.
struct Seam {
    static constexpr bool kRawBytes = true;
    ChartId chart_a, chart_b;       // a < b; a = b: of a curve that closes upon itself
    std::uint32_t from = 0, to = 0; // positions
};

// A convex part of an overlay or decal on one triangle of a face, in the plane of the triangle: whoever draws it offsets it.
struct OverlayFragment {
    static constexpr bool kRawBytes = true;
    std::uint32_t overlay = 0;      // index into World::overlays
    FaceId face;
    std::uint32_t first_point = 0, point_count = 0; // in Surfaces::overlay_points; counter-clockwise seen from the front
};
struct OverlayPoint {
    static constexpr bool kRawBytes = true;
    Vec3 position;                  // map units
    Vec2 uv;                        // of the overlay's picture: 0..1 is once the whole of it, v down
};

struct Surfaces {
    std::vector<Vec3> positions;                             // map units
    std::vector<std::array<std::uint32_t, 3>> triangles;     // counter-clockwise seen from the front
    std::vector<FaceId> triangle_face;                       // parallel to triangles; grouped by face
    std::vector<std::array<Vec3f, 3>> corner_normals;        // parallel to triangles; shading normals, unit
    std::vector<Face> faces;
    std::vector<Chart> charts;
    std::vector<Luxel> luxels;                               // sorted by (chart, y, x)
    std::vector<LuxelPiece> pieces;                          // grouped by luxel
    std::vector<Vec2> piece_points;                          // grouped by piece
    std::vector<Vec2> centroids;                             // luxel coordinates, in the order of luxels that have one
    std::vector<Seam> seams;                                 // sorted
    std::uint32_t texel_count = 0;                           // sum of width*height
    std::vector<Curve> curves;                               // displacements, then patches
    std::uint32_t first_curved_face = UINT32_MAX;            // faces from here on are of curves
    std::vector<LuxelMap> luxel_maps;                        // of those faces
    std::vector<std::array<CurveCorner, 3>> curve_corners;   // of their triangles
    std::vector<OverlayFragment> overlay_fragments;          // sorted by (overlay, face, triangle)
    std::vector<OverlayPoint> overlay_points;                // grouped by fragment
    // Blockers that no face shows (light_blocker brushes), as extra faces with drawn = false, are in the same tables.
    template <class A> void fields(A& a) {
        a(positions, triangles, triangle_face, corner_normals, faces, charts, luxels, pieces, piece_points, centroids,
          seams, texel_count, curves, first_curved_face, luxel_maps, curve_corners, overlay_fragments, overlay_points);
    }

    const std::array<CurveCorner, 3>& corners_of(std::size_t curved_triangle) const { return curve_corners[curved_triangle - faces[first_curved_face].first_triangle]; }
    const LuxelMap& luxel_map(FaceId curved_face) const { return luxel_maps[curved_face.value - first_curved_face]; }
};

inline PiecePoints points_of(const Surfaces& s, const LuxelPiece& piece) { return {piece, s.piece_points}; }
inline std::uint32_t texel_of(const Surfaces& s, const Luxel& l) { return s.charts[l.chart.at()].texel(l.x, l.y); }
inline Vec2 centroid_of(const Surfaces& s, const Luxel& l) { return l.centroid == UINT32_MAX ? Vec2{l.x + 0.5, l.y + 0.5} : s.centroids[l.centroid]; }

// From the world to luxel coordinates and back, on the plane of a face with a chart.
inline Vec2 luxel_from_world(const Surfaces& s, FaceId face, Vec3 point) {
    const Face& f = s.faces[face.at()];
    if (f.curved()) {
        const LuxelMap& m = s.luxel_map(face);
        return {dot(point - m.origin, m.s), dot(point - m.origin, m.t)};
    }
    const Chart& c = s.charts[f.chart.at()];
    const Vec3 d = point - c.origin;
    return {dot(d, c.s) / c.luxel_size, dot(d, c.t) / c.luxel_size};
}
inline Vec3 world_from_luxel(const Surfaces& s, FaceId face, Vec2 luxel) {
    const Face& f = s.faces[face.at()];
    if (f.curved()) {
        const LuxelMap& m = s.luxel_map(face);
        return m.origin + m.i * luxel.x + m.j * luxel.y;
    }
    const Chart& c = s.charts[f.chart.at()];
    const Vec3 p = c.origin + (c.s * luxel.x + c.t * luxel.y) * c.luxel_size;
    return p + f.normal * (f.distance - dot(f.normal, p));
}
// Of the box around all of it. What is drawn by chance goes by places from here: it moves with the map.
inline Vec3 least_corner(const Surfaces& s) {
    Vec3 least = s.positions.empty() ? Vec3{} : s.positions[0];
    for (const Vec3& p : s.positions)
        for (std::size_t c = 0; c < 3; ++c) least[c] = std::min(least[c], p[c]);
    return least;
}
inline double luxel_area(const Surfaces& s, FaceId face) { // map units squared of a whole luxel there
    const Face& f = s.faces[face.at()];
    if (f.curved()) return length(cross(s.luxel_map(face).i, s.luxel_map(face).j));
    const double size = s.charts[f.chart.at()].luxel_size;
    return size * size;
}
// Material flags under which a curve is not drawn. Nodraw hides patches; displacements are drawn all the same.
constexpr std::uint32_t undrawn_flags(Curve::Kind kind) {
    return kSkip | kHint | kClip | kTrigger | kOrigin | kAreaPortal | kLightBlocker | kInvisible | (kind == Curve::patch ? kNoDraw : 0u);
}
// Of which of the map's files a face is: index for World::name_of.
inline std::uint16_t file_of(const World& world, const Surfaces& s, FaceId face) {
    const Face& f = s.faces[face.at()];
    return f.side.valid() || !f.curved() ? world.brushes[world.brush_of(f.side).at()].file : world.patches[s.curves[f.curve].source].file;
}
// Where in the map file a face comes from.
inline SourceLocation location_of(const World& world, const Surfaces& s, FaceId face) {
    const Face& f = s.faces[face.at()];
    return f.side.valid() || !f.curved() ? world.location(f.side) : world.location(world.patches[s.curves[f.curve].source]);
}

struct SurfacesOptions {
    // Edges up to this angle are smooth where neither face states smoothing groups; `_phong` keys may allow more. Below 0:
    // 45 in a VMF, as its compilers do, else 0.
    double smoothing_angle_deg = -1;
    // More texels than this are a fault (Exit::limit): a slip in a lightmap scale, not a level. Light takes some 150
    // bytes a texel.
    std::uint64_t most_texels = std::uint64_t{1} << 26;
    double curve_flatness = 0.5; // map units: patches are divided until they lie within this of their triangles
    template <class A> void fields(A& a) { a(smoothing_angle_deg, most_texels, curve_flatness); }
};
Result<Surfaces> build_surfaces(const World& world, const Csg& csg, const Bsp& bsp, const SurfacesOptions& options,
                                Context& context);
void validate(const Surfaces& surfaces);
// The same, for all who want to know more than the first that fails; `world`: for the places, may be null.
void check_invariants(const Surfaces& surfaces, const World* world, Checker& checker);

// Directed edges of the triangles of curves of one model that no opposite edge answers: their outer border.
std::size_t unmatched_curve_edges(const Surfaces& surfaces, ModelId model, Curve::Kind kind);

// Directed edges of the hull triangles of one model that no opposite edge answers: 0 for a sealed solid.
std::size_t unmatched_hull_edges(const Surfaces& surfaces, ModelId model = {0});

} // namespace kiln

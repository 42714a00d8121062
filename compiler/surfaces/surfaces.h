// Surfaces: what is drawn and lit. Visible fragments merged into maximal regions with holes, triangulated without
// T-junctions over shared vertices, smoothed, given tangent frames, charts and luxels.
//
// In       world, csg, bsp
// Out      tables below; positions are rounded once (PlaneTable::point) and welded by exact equality
// Errors   none of its own; a side whose texture axes lie in one line gets a frame of its plane and a warning
#pragma once
#include "compiler/bsp/bsp.h"

namespace kiln {

using FaceId = Index<struct FaceTag>;
using ChartId = Index<struct ChartTag>;

struct Face { // a maximal connected region of one brush side
    SideId side;
    MaterialId material;
    ModelId model;
    PlaneId plane;
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
    template <class A> void fields(A& a) {
        a(side, material, model, plane, chart, normal, distance, tangent, first_triangle, triangle_count, area, bounds,
          clusters, drawn, blocks_light, sky, two_sided, hull);
    }
};

// One luxel grid over coplanar, edge-connected faces of equal tangent frame and luxel size. Texel (i,j) covers
// the square [i,i+1)x[j,j+1) of luxel coordinates; its centre is (i+.5, j+.5). The outermost ring is gutter.
//   luxel coordinate of x = (dot(x - origin, s), dot(x - origin, t)) / luxel_size
// The lattice is anchored to the world: dot(origin, s) and dot(origin, t) are multiples of luxel_size.
struct Chart {
    Vec3 origin, s, t, n;           // s, t unit, in the plane; s along the tangent; n = face normal; t = cross(n, s)
    Frame frame;                    // RNM frame of the chart: its faces' tangent frame
    double luxel_size = 16;         // map units
    std::uint32_t width = 0, height = 0; // texels, gutter included
    std::uint32_t first_texel = 0;  // into arrays over all texels of all charts
    std::vector<FaceId> faces;
    bool smooth = false;            // some corner normal differs from n
    template <class A> void fields(A& a) {
        a(origin, s, t, n, frame, luxel_size, width, height, first_texel, faces, smooth);
    }
};

// A texel with a part of its square on a visible face: the exact footprint in convex pieces.
struct Luxel {
    static constexpr bool kRawBytes = true;
    ChartId chart;
    std::uint16_t x = 0, y = 0;
    FaceId face;                    // that owns most of it
    float area = 0;                 // of the footprint, luxel units squared (1: whole)
    Vec2 centroid;                  // of the footprint, luxel coordinates
    std::uint32_t first_piece = 0, piece_count = 0; // a whole texel of one face: one piece of four points, the square
};
struct LuxelPiece {                 // convex, counter-clockwise (seen from the front), luxel coordinates
    static constexpr bool kRawBytes = true;
    FaceId face;
    std::uint32_t first_point = 0, point_count = 0; // in Surfaces::piece_points
};

// A common edge of two charts across which light should look continuous: they lie in one plane, or the shading
// normals of both sides agree along it.
struct Seam {
    static constexpr bool kRawBytes = true;
    ChartId chart_a, chart_b;       // a < b
    std::uint32_t from = 0, to = 0; // positions
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
    std::vector<Seam> seams;                                 // sorted
    std::uint32_t texel_count = 0;                           // sum of width*height
    // Blockers that no face shows (light_blocker brushes), as extra faces with drawn = false, are in the same tables.
    template <class A> void fields(A& a) {
        a(positions, triangles, triangle_face, corner_normals, faces, charts, luxels, pieces, piece_points, seams,
          texel_count);
    }
};

struct SurfacesOptions {
    // Faces are flat unless smoothing groups (VMF) or `_phong` keys say otherwise. Above 0: edges up to this angle
    // are smooth too where neither face states groups.
    double smoothing_angle_deg = 0;
    // More texels than this are a fault (Exit::limit): a slip in a lightmap scale, not a level. Light takes some 150
    // bytes a texel.
    std::uint64_t most_texels = std::uint64_t{1} << 26;
    template <class A> void fields(A& a) { a(smoothing_angle_deg, most_texels); }
};
Result<Surfaces> build_surfaces(const World& world, const Csg& csg, const Bsp& bsp, const SurfacesOptions& options,
                                Context& context);
void validate(const Surfaces& surfaces);
// The same, for all who want to know more than the first that fails; `world`: for the places, may be null.
void check_invariants(const Surfaces& surfaces, const World* world, Checker& checker);

// Directed edges of the hull triangles of one model that no opposite edge answers: 0 for a sealed solid.
std::size_t unmatched_hull_edges(const Surfaces& surfaces, ModelId model = {0});

} // namespace kiln

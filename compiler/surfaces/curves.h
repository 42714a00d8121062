// Displacements and patches: from World's tables to grids of vertices, and from those to faces and charts.
#pragma once
#include "compiler/surfaces/faces.h"
#include <map>

namespace kiln {

// A grid of vertices, row by row; cross(along a row, from row to row) points to the front. Ids are of CurveGrids::positions.
struct CurveGrid {
    Curve::Kind kind = Curve::displacement;
    std::uint32_t source = 0; // World::displacements, World::patches
    SideId side;              // none: a patch
    MaterialId material;
    ModelId model;
    double luxel_size = 16;
    std::uint32_t columns = 0, rows = 0;
    std::vector<std::uint32_t> vertices;
    std::vector<Vec2> uv;      // repeats
    std::vector<double> alpha; // 0..1
    std::array<Vec3, 4> base{}; // displacements
    PlaneId base_plane;
    // Vertices of finer neighbours on border edges: by the edge's two places in the grid (in the order in which the
    // border runs, counter-clockwise seen from the front), where on it and which.
    struct Guest {
        double at = 0; // 0..1
        std::uint32_t vertex = 0;
    };
    std::map<std::array<std::uint32_t, 2>, std::vector<Guest>> guests;
    std::uint32_t at(std::uint32_t row, std::uint32_t column) const { return row * columns + column; }
};

struct CurveGrids {
    std::vector<CurveGrid> grids;
    std::vector<Vec3> positions; // of all grids; those that touch share vertices
};

// displacements.cpp. Neighbours sewn: see NOTES.md.
void add_displacements(const World& world, const Csg& csg, CurveGrids& out, Context& context);
// bezier.cpp. `flatness`: map units.
void add_patches(const World& world, double flatness, CurveGrids& out, Context& context);
// touching.cpp. Vertices of one grid that lie on the border of another of the same model and kind become guests there.
void add_touching(CurveGrids& grids);

// Into how many equal parts a biquadratic piece has to be divided each way so that two triangles a part lie within
// `flatness` of it: {along, across}, powers of two.
struct BezierPiece {
    std::array<std::array<Vec3, 3>, 3> point; // [across][along]
};
std::array<std::uint32_t, 2> bezier_divisions(const BezierPiece& piece, double flatness);
Vec3 bezier_point(const BezierPiece& piece, double along, double along_rest, double across, double across_rest);

// curve_faces.cpp. The triangles of a grid, vertices of finer neighbours on its border included; counter-clockwise seen
// from the front.
std::vector<std::array<std::uint32_t, 3>> curve_triangles(const CurveGrid& grid);
bool curve_blocks_light(const World& world, const CurveGrid& grid);

// curve_faces.cpp. Curves, faces, triangles and corners of the grids; drafts stay parallel to surfaces.faces. Returned:
// a chart per curve, without its faces and place in the texel tables.
std::vector<Chart> add_curve_faces(Surfaces& surfaces, std::vector<FaceDraft>& drafts, const CurveGrids& grids, const World& world,
                                   const Csg& csg, const Bsp& bsp, Context& context);

} // namespace kiln

// From visible fragments to faces: which fragments show or block, merged into regions per brush side.
#pragma once
#include "compiler/surfaces/regions.h"
#include "compiler/surfaces/surfaces.h"
#include "libs/core/context.h"

namespace kiln {

class Feet;

struct FaceDraft {
    Face face;                       // all but triangles and chart
    std::vector<Outline> loops;      // as in Region; T-junctions inserted later
    std::vector<Loop> convex;        // the same region as convex polygons that overlap nowhere
    double luxel_size = 16;          // map units
    bool lit = false;                // gets luxels
    std::uint32_t smoothing_groups = 0;
    double phong_angle_deg = 0;      // 0: not by angle
    // Faces of curves have no loops: what is seen of them, in convex polygons that overlap nowhere, luxel coordinates.
    std::vector<std::vector<Vec2>> seen;
    double phong_concave_deg = 0;    // where faces meet in a groove; 0: the same angle
    int phong_group = 0;             // smoothed by angle with faces of the same group only
    std::uint32_t under = 0;         // what stands on it, as in Feet::Part
    std::uint32_t part = 0;          // parted from others by a thin wall, as in part_at_walls
};

// Two faces are on one luxel grid where they are joined edge to edge.
bool share_chart(const FaceDraft& f, const FaceDraft& g);

std::vector<FaceDraft> make_face_drafts(const World& world, const Csg& csg, const Bsp& bsp,
                                        const SurfacesOptions& options, Feet& feet, VertexTable& vertices, Context& context);

// The frame of a side's texture axes on a plane; false where they do not span it (the frame is then any one).
bool tangent_frame(const DocTexture& texture, Vec3 normal, Frame& frame);

} // namespace kiln

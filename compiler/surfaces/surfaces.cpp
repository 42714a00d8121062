#include "compiler/surfaces/surfaces.h"
#include "compiler/surfaces/charts.h"
#include "compiler/surfaces/curves.h"
#include "compiler/surfaces/faces.h"
#include "compiler/surfaces/feet.h"
#include "compiler/surfaces/luxels.h"
#include "compiler/surfaces/overlays.h"
#include "compiler/surfaces/shading.h"
#include "compiler/surfaces/tjunctions.h"
#include "libs/core/check.h"
#include <algorithm>
#include <fmt/format.h>

namespace kiln {
namespace {

// Faces of one model share vertices; models move against each other, so they do not.
void resolve_tjunctions(std::vector<FaceDraft>& drafts, const VertexTable& vertices, std::uint32_t model_count, Context& context) {
    std::vector<std::vector<FaceOutlines>> of_model(model_count);
    for (FaceDraft& d : drafts) of_model[d.face.model.at()].push_back({d.face.plane, &d.loops});
    for (const std::vector<FaceOutlines>& faces : of_model) insert_tjunctions(vertices, faces, context);
}

// Where the library refuses: the convex pieces as fans. Right in area, but with T-junctions.
std::vector<std::array<VertexId, 3>> fans(const FaceDraft& draft) {
    std::vector<std::array<VertexId, 3>> triangles;
    for (const Loop& loop : draft.convex)
        for (std::size_t i = 1; i + 1 < loop.size(); ++i) triangles.push_back({loop[0], loop[i], loop[i + 1]});
    return triangles;
}

void add_triangles(Surfaces& s, std::vector<FaceDraft>& drafts, const VertexTable& vertices, const World& world, Context& context) {
    std::vector<std::uint32_t> position_of(vertices.size(), UINT32_MAX); // only vertices in use get a position
    for (std::size_t f = 0; f < drafts.size(); ++f) {
        FaceDraft& draft = drafts[f];
        std::vector<std::array<VertexId, 3>> triangles = triangulate(vertices, draft.face.plane, draft.loops);
        if (triangles.empty()) {
            triangles = fans(draft);
            context.report(Severity::warning, "face-not-triangulated",
                           fmt::format("a face of {} square units got a mesh that does not meet its neighbours", draft.face.area),
                           world.location(draft.face.side));
        }
        draft.loops = {}; // nobody asks for them any more, and luxels will want the memory
        draft.face.first_triangle = static_cast<std::uint32_t>(s.triangles.size());
        draft.face.triangle_count = static_cast<std::uint32_t>(triangles.size());
        for (const auto& triangle : triangles) {
            std::array<std::uint32_t, 3> out{};
            for (std::size_t c = 0; c < 3; ++c) {
                std::uint32_t& p = position_of[triangle[c].at()];
                if (p == UINT32_MAX) {
                    p = static_cast<std::uint32_t>(s.positions.size());
                    s.positions.push_back(vertices.position(triangle[c]));
                }
                out[c] = p;
            }
            s.triangles.push_back(out);
            s.triangle_face.push_back(id<FaceId>(f));
        }
        s.faces.push_back(draft.face);
    }
}

} // namespace

Result<Surfaces> build_surfaces(const World& world, const Csg& csg, const Bsp& bsp, const SurfacesOptions& options,
                                Context& context) {
    Surfaces s;
    context.say("surfaces", 0);
    CurveGrids grids;
    add_displacements(world, csg, grids, context);
    add_patches(world, options.curve_flatness, grids, context);
    add_touching(grids);
    std::optional<PlaneTable> own; // where curves stand on faces they bring planes of their own
    if (!grids.grids.empty()) own = bsp.planes;
    const PlaneTable& planes = own ? *own : bsp.planes; // those of csg and more
    Feet feet(world, csg, grids, planes, own ? &*own : nullptr);
    VertexTable vertices(planes);
    std::vector<FaceDraft> drafts = make_face_drafts(world, csg, bsp, options, feet, vertices, context);
    context.say("surfaces", 0.3);
    resolve_tjunctions(drafts, vertices, world.model_count, context);
    context.check_cancelled();
    add_triangles(s, drafts, vertices, world, context);
    std::vector<Chart> curve_charts = add_curve_faces(s, drafts, grids, world, csg, bsp, context);
    context.say("surfaces", 0.6);
    std::vector<bool> smooth(drafts.size());
    for (std::size_t f = 0; f < drafts.size(); ++f) smooth[f] = may_smooth(drafts[f]);
    const Adjacency adjacency = find_adjacency(s, smooth);
    shade_corners(s, drafts, adjacency);
    const std::uint64_t texels = make_charts(s, drafts, std::move(curve_charts), adjacency, world, context);
    if (const std::uint64_t most = std::min<std::uint64_t>(options.most_texels, UINT32_MAX); texels > most)
        return fault(Exit::limit, "too-many-luxels",
                     fmt::format("the surfaces need {} million lightmap texels, allowed are {}: see the lightmap scales of the map, --luxel and --max-texels",
                                 texels / 1000000, most / 1000000),
                     {.file = world.file});
    context.check_cancelled();
    make_luxels(s, drafts, vertices, context);
    add_overlays(s, world, context);
    context.say("surfaces", 1);
    return s;
}

} // namespace kiln

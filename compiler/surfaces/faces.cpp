#include "compiler/surfaces/faces.h"
#include "libs/core/check.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <tuple>

namespace kiln {
namespace {

bool opaque(Contents c) { return c == Contents::solid || c == Contents::detail; }
bool liquid(Contents c) { return c == Contents::water || c == Contents::slime || c == Contents::lava; }
bool fills(Contents c) { return opaque(c) || liquid(c) || c == Contents::window || c == Contents::grate; }

struct Visibility { // of one brush side to the eye and to light
    bool keep = false, drawn = false, blocks = false, sky = false, two_sided = false, hull = false, lit = false;
};

Visibility side_visibility(const World& world, const WorldSide& side, const WorldBrush& brush, Contents behind) {
    const Material& material = world.materials[side.material.at()];
    const std::uint32_t f = material.flags;
    Visibility v;
    v.hull = opaque(behind);
    v.sky = (f & kSky) != 0;
    const bool tool = f & (kNoDraw | kSkip | kHint | kClip | kTrigger | kOrigin | kAreaPortal | kLightBlocker | kInvisible);
    v.drawn = brush.draws && !tool && !v.sky;
    // Light is not filtered yet: what can be seen through lets all of it pass.
    const bool clear = (f & (kInvisible | kTranslucent | kAlphaTested)) || material.alpha < 1;
    v.blocks = (f & kLightBlocker) || (v.hull && !clear && brush.casts_light_shadow);
    v.two_sided = v.drawn && (liquid(behind) || (f & kTwoSided));
    v.lit = v.drawn && !(f & kNoLight);
    v.keep = v.hull || v.drawn || v.blocks;
    return v;
}

// Area vector of a loop: direction along the normal where counter-clockwise, length the area.
Vec3 area_vector(const VertexTable& vertices, const Loop& loop) {
    Vec3 sum;
    const Vec3 p0 = vertices.position(loop[0]);
    for (std::size_t i = 1; i + 1 < loop.size(); ++i)
        sum += cross(vertices.position(loop[i]) - p0, vertices.position(loop[i + 1]) - p0);
    return sum * 0.5;
}

// Turns left at every vertex, once around. Rounded coordinates: a wrong "no" costs a few pieces, a wrong "yes" cannot
// come from a vertex that turns right by more than rounding.
bool convex(const VertexTable& vertices, const Loop& loop, Vec3 n) {
    double turn = 0;
    for (std::size_t i = 0; i < loop.size(); ++i) {
        const Vec3 a = vertices.position(loop[i]), b = vertices.position(loop[(i + 1) % loop.size()]),
                   c = vertices.position(loop[(i + 2) % loop.size()]);
        const Vec3 d = b - a, e = c - b;
        const double left = dot(cross(d, e), n);
        if (!(left > 0)) return false;
        turn += std::atan2(left, dot(d, e));
    }
    return turn < 7; // 2 pi; a star that goes round twice is not convex
}

struct Group {
    SideId side;
    ModelId model;
    PlaneId plane;
    Contents behind = Contents::solid;
    BrushId brush;
    Contents wet = Contents::empty; // the liquid in front, if one: what is under water is a face of its own
    bool gap = false; // closes an opening too narrow to count
    Polygons polygons;
    std::vector<ClusterId> clusters; // parallel to polygons
};

double phong_angle(const World& world, const WorldBrush& brush) {
    if (!brush.entity.valid()) return 0;
    const WorldEntity& entity = world.entities[brush.entity.at()];
    constexpr double kUsual = 89; // what the Quake tools take where `_phong 1` comes alone
    if (const double angle = entity.number("_phong_angle", 0); angle > 0) return angle;
    return entity.number("_phong", 0) > 0 ? kUsual : 0;
}

BrushId brush_of(const World& world, SideId side) {
    const auto after = std::ranges::upper_bound(world.brushes, side.value, {}, &WorldBrush::first_side);
    return id<BrushId>(static_cast<std::size_t>(after - world.brushes.begin()) - 1);
}

std::vector<Group> collect(const World& world, const Csg& csg, const Bsp& bsp, VertexTable& vertices) {
    std::vector<Group> groups;
    std::map<std::tuple<ModelId, SideId, PlaneId, bool, Contents, bool>, std::size_t> index;
    const auto add = [&](ModelId model, SideId side, BrushId brush, Contents behind, const PlanePolygon& polygon, ClusterId cluster,
                         Contents front = Contents::empty, bool gap = false) {
        const Contents wet = liquid(front) ? front : Contents::empty;
        const auto [it, fresh] = index.try_emplace({model, side, polygon.support, opaque(behind), wet, gap}, groups.size());
        if (fresh) groups.push_back({side, model, polygon.support, behind, brush, wet, gap, {}, {}});
        vertices.add(polygon, groups[it->second].polygons);
        groups[it->second].clusters.push_back(cluster);
    };
    for (const VisibleFragment& v : bsp.visible) {
        const Fragment& f = csg.fragments[v.fragment];
        if (f.covered || !fills(f.behind) || opaque(f.front)) continue;
        if (!side_visibility(world, world.sides[f.side.at()], world.brushes[f.brush.at()], f.behind).keep) continue;
        add(f.model, f.side, f.brush, f.behind, v.polygon, v.leaf.valid() ? bsp.leaves[v.leaf.at()].cluster : ClusterId{}, f.front);
    }
    for (const ClosedGap& g : bsp.closed)
        add({0}, g.side, brush_of(world, g.side), Contents::solid, g.polygon, bsp.leaves[g.leaf.at()].cluster, Contents::empty, true);
    // Light blockers without contents of their own never became fragments: their whole sides block.
    for (std::size_t b = 0; b < csg.brushes.size(); ++b) {
        const WorldBrush& brush = world.brushes[b];
        const BrushPolytope& polytope = csg.brushes[b];
        if (!polytope.valid || brush.displaced || fills(brush.contents)) continue;
        for (std::size_t i = 0; i < polytope.faces.size(); ++i)
            if (world.materials[world.sides[polytope.sides[i].at()].material.at()].flags & kLightBlocker)
                add(brush.model, polytope.sides[i], id<BrushId>(b), brush.contents, polytope.faces[i], {});
    }
    std::ranges::sort(groups, {}, [](const Group& g) { return std::tuple(g.model, g.side, g.plane, g.behind, g.wet, g.gap); });
    return groups;
}

} // namespace

bool tangent_frame(const DocTexture& texture, Vec3 normal, Frame& frame) {
    const auto along = [&](Vec3 axis, double scale) {
        const double size = length(axis);
        if (!(size > 0) || !std::isfinite(size)) return Vec3{};
        const Vec3 unit = axis / (scale < 0 ? -size : size); // the direction in which the texel coordinate grows
        return unit - normal * dot(unit, normal);
    };
    const Vec3 u = along(texture.u_axis, texture.u_scale), v = along(texture.v_axis, texture.v_scale);
    constexpr double kSpan = 1e-6; // sine below which the axes do not span the plane
    const double turn = dot(cross(u, v), normal);
    if (length(u) < kSpan || length(v) < kSpan || !(std::abs(turn) > kSpan * length(u) * length(v))) {
        frame = frame_around(normal);
        return false;
    }
    const Vec3 t = normalize(u), b = cross(normal, t);
    frame = {t, turn > 0 ? b : -b, normal};
    return true;
}

std::vector<FaceDraft> make_face_drafts(const World& world, const Csg& csg, const Bsp& bsp,
                                        const SurfacesOptions& options, VertexTable& vertices, Context& context) {
    const std::vector<Group> groups = collect(world, csg, bsp, vertices);
    std::vector<FaceDraft> drafts;
    for (const Group& group : groups) {
        context.check_cancelled();
        const WorldSide& side = world.sides[group.side.at()];
        const WorldBrush& brush = world.brushes[group.brush.at()];
        // What closes a gap is black: it keeps light in, shows nothing and sends nothing back.
        const Visibility visibility = group.gap ? Visibility{.keep = true, .blocks = true, .hull = true}
                                                : side_visibility(world, side, brush, group.behind);
        FaceDraft draft;
        Face& face = draft.face;
        face.side = group.side;
        face.material = side.material;
        face.model = group.model;
        face.plane = group.plane;
        face.normal = vertices.planes().normal(group.plane);
        face.distance = vertices.planes().distance(group.plane);
        face.drawn = visibility.drawn;
        face.blocks_light = visibility.blocks;
        face.sky = visibility.sky;
        face.two_sided = visibility.two_sided;
        face.hull = visibility.hull;
        draft.lit = visibility.lit;
        draft.luxel_size = side.lightmap_scale > 0 && std::isfinite(side.lightmap_scale) ? side.lightmap_scale : 16;
        draft.smoothing_groups = group.gap ? 0 : side.smoothing_groups;
        draft.phong_angle_deg = group.gap ? 0 : std::max(phong_angle(world, brush), side.smoothing_groups ? 0.0 : options.smoothing_angle_deg);
        if (!tangent_frame(side.texture, face.normal, face.tangent) && face.drawn)
            context.report(Severity::warning, "texture-axes-degenerate",
                           fmt::format("the texture axes of '{}' do not span the face: its tangent frame is arbitrary",
                                       world.materials[side.material.at()].name),
                           world.location(group.side));
        bool merged = true;
        const std::vector<Region> regions = merge_polygons(vertices, group.plane, group.polygons, merged);
        if (!merged)
            context.report(Severity::note, "face-not-merged",
                           fmt::format("{} parts of this face could not be merged and stay separate", group.polygons.size()),
                           world.location(group.side));
        for (const Region& region : regions) {
            FaceDraft d = draft;
            d.loops = region.loops;
            Vec3 area;
            for (const Outline& loop : region.loops) area += area_vector(vertices, loop.vertices);
            d.face.area = std::max(0.0, dot(area, d.face.normal));
            for (const VertexId v : region.loops[0].vertices) d.face.bounds.add(vertices.position(v));
            for (const std::uint32_t m : region.members)
                if (group.clusters[m].valid()) d.face.clusters.push_back(group.clusters[m]);
            std::ranges::sort(d.face.clusters);
            d.face.clusters.erase(std::unique(d.face.clusters.begin(), d.face.clusters.end()), d.face.clusters.end());
            if (region.loops.size() == 1 && convex(vertices, region.loops[0].vertices, d.face.normal))
                d.convex = {region.loops[0].vertices};
            else
                for (const std::uint32_t m : region.members) d.convex.emplace_back(group.polygons[m].begin(), group.polygons[m].end());
            drafts.push_back(std::move(d));
        }
    }
    return drafts;
}

} // namespace kiln

#include "compiler/surfaces/faces.h"
#include "compiler/surfaces/feet.h"
#include "compiler/surfaces/walls.h"
#include "compiler/world/panes.h"
#include "libs/core/check.h"
#include <algorithm>
#include <cmath>
#include <deque>
#include <fmt/format.h>
#include <map>
#include <numeric>
#include <tuple>

namespace kiln {
namespace {

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
    v.drawn = brush.draws && !never_drawn(material);
    // What can be seen through takes its share of light as the light stage says.
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
    std::uint32_t under = 0; // what stands on it
    bool lit = false;
    std::uint32_t first = 0, count = 0; // polygons
};
struct Groups {
    std::vector<Group> groups;
    Polygons polygons;               // group by group
    std::vector<ClusterId> clusters; // parallel to polygons
};

constexpr double kUsualPhong_deg = 89;   // what the Quake tools take where `_phong 1` comes alone
constexpr double kSourceSmooth_deg = 45; // vrad's -smooth where nothing else is said

void read_smoothing(const World& world, const WorldSide& side, const WorldBrush& brush, const SurfacesOptions& options, FaceDraft& draft) {
    const bool bits = world.format == MapFormat::vmf; // of a .map: the number of a group (Quake 2)
    if (bits) draft.smoothing_groups = side.smoothing_groups;
    if (brush.entity.valid()) {
        const WorldEntity& entity = world.entities[brush.entity.at()];
        const double angle = entity.number("_phong_angle", 0);
        draft.phong_angle_deg = angle > 0 ? std::min(angle, 180.0) : entity.number("_phong", 0) > 0 ? kUsualPhong_deg : 0;
        draft.phong_concave_deg = std::clamp(entity.number("_phong_angle_concave", 0), 0.0, 180.0);
        draft.phong_group = static_cast<int>(std::clamp(entity.number("_phong_group", 0), -1e9, 1e9));
    }
    if (!bits && side.smoothing_groups) {
        if (draft.phong_group == 0) draft.phong_group = static_cast<int>(side.smoothing_groups);
        if (!(draft.phong_angle_deg > 0)) draft.phong_angle_deg = kUsualPhong_deg;
    }
    const double usual = options.smoothing_angle_deg >= 0 ? options.smoothing_angle_deg : world.format == MapFormat::vmf ? kSourceSmooth_deg : 0;
    if (!draft.smoothing_groups) draft.phong_angle_deg = std::max(draft.phong_angle_deg, usual);
}

Groups collect(const World& world, const Csg& csg, const Bsp& bsp, Feet& feet, VertexTable& vertices) {
    Groups out;
    std::vector<Group>& groups = out.groups;
    struct Item {
        const PlanePolygon* polygon;
        std::uint32_t group;
        ClusterId cluster;
    };
    std::vector<Item> items;
    items.reserve(bsp.visible.size() + bsp.closed.size());
    std::map<std::tuple<ModelId, SideId, PlaneId, bool, Contents, bool, std::uint32_t>, std::uint32_t> index;
    std::deque<PlanePolygon> cut;
    const auto group = [&](const Group& g) {
        const auto [it, fresh] = index.try_emplace({g.model, g.side, g.plane, opaque(g.behind), g.wet, g.gap, g.under}, static_cast<std::uint32_t>(groups.size()));
        if (fresh) groups.push_back(g);
        return it->second;
    };
    // Where something stands on a lit face, the parts under it and around it become faces of their own.
    const auto put = [&](const PlanePolygon& polygon, std::uint32_t to, ClusterId cluster) {
        std::vector<Feet::Part> parts;
        if (feet.any() && groups[to].lit) parts = feet.cut(groups[to].model, polygon);
        if (parts.empty()) items.push_back({&polygon, to, cluster});
        for (Feet::Part& part : parts) {
            Group g = groups[to];
            g.under = part.under;
            items.push_back({&cut.emplace_back(std::move(part.polygon)), group(g), cluster});
        }
    };
    const auto add = [&](ModelId model, SideId side, BrushId brush, Contents behind, const PlanePolygon& polygon, ClusterId cluster,
                         Contents front = Contents::empty, bool gap = false) {
        const Contents wet = liquid(front) ? front : Contents::empty;
        const bool lit = !gap && feet.any() && side_visibility(world, world.sides[side.at()], world.brushes[brush.at()], behind).lit;
        const std::uint32_t to = group({side, model, polygon.support, behind, brush, wet, gap, 0, lit});
        put(polygon, to, cluster);
        return to;
    };
    constexpr std::uint32_t kNone = UINT32_MAX;
    std::vector<std::uint32_t> group_of(csg.fragments.size(), kNone); // that its first part went to
    for (const VisibleFragment& v : bsp.visible) {
        const ClusterId cluster = v.leaf.valid() ? bsp.leaves[v.leaf.at()].cluster : ClusterId{};
        if (const std::uint32_t g = group_of[v.fragment]; g != kNone && groups[g].plane == v.polygon.support) {
            put(v.polygon, g, cluster);
            continue;
        }
        const Fragment& f = csg.fragments[v.fragment];
        if (f.covered || !fills(f.behind) || opaque(f.front)) continue;
        if (!side_visibility(world, world.sides[f.side.at()], world.brushes[f.brush.at()], f.behind).keep) continue;
        group_of[v.fragment] = add(f.model, f.side, f.brush, f.behind, v.polygon, cluster, f.front);
    }
    for (const ClosedGap& g : bsp.closed)
        add({0}, g.side, world.brush_of(g.side), Contents::solid, g.polygon, bsp.leaves[g.leaf.at()].cluster, Contents::empty, true);
    // Light blockers without contents of their own never became fragments: their whole sides block.
    for (std::size_t b = 0; b < csg.brushes.size(); ++b) {
        const WorldBrush& brush = world.brushes[b];
        const BrushPolytope& polytope = csg.brushes[b];
        if (!polytope.valid || brush.displaced || fills(brush.contents)) continue;
        for (std::size_t i = 0; i < polytope.faces.size(); ++i)
            if (world.materials[world.sides[polytope.sides[i].at()].material.at()].flags & kLightBlocker)
                add(brush.model, polytope.sides[i], id<BrushId>(b), brush.contents, polytope.faces[i], {});
    }
    // Where in the tables each goes: its group's place, within it by the order of items.
    for (const Item& i : items) ++groups[i.group].count;
    std::vector<std::uint32_t> order(groups.size());
    std::iota(order.begin(), order.end(), 0u);
    std::ranges::sort(order, {}, [&](std::uint32_t i) {
        const Group& g = groups[i];
        return std::tuple(g.model, g.side, g.plane, g.behind, g.wet, g.gap, g.under);
    });
    std::uint32_t sum = 0;
    for (const std::uint32_t g : order) groups[g].first = sum, sum += groups[g].count;
    std::vector<std::uint32_t> next(groups.size()), place(items.size());
    for (std::size_t g = 0; g < groups.size(); ++g) next[g] = groups[g].first;
    out.polygons.first.assign(items.size() + 1, 0);
    out.clusters.resize(items.size());
    for (std::size_t i = 0; i < items.size(); ++i) {
        place[i] = next[items[i].group]++;
        out.polygons.first[place[i] + 1] = static_cast<std::uint32_t>(items[i].polygon->size());
        out.clusters[place[i]] = items[i].cluster;
    }
    std::partial_sum(out.polygons.first.begin(), out.polygons.first.end(), out.polygons.first.begin());
    out.polygons.vertices.resize(out.polygons.first.back()), out.polygons.lines.resize(out.polygons.first.back());
    // In the order of the tree, where neighbours share vertices and cache lines.
    for (std::size_t i = 0; i < items.size(); ++i) {
        const std::uint32_t at = out.polygons.first[place[i]];
        vertices.add(*items[i].polygon, out.polygons.vertices.data() + at, out.polygons.lines.data() + at);
    }
    std::vector<Group> sorted;
    sorted.reserve(groups.size());
    for (const std::uint32_t g : order) sorted.push_back(groups[g]);
    groups = std::move(sorted);
    return out;
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

bool share_chart(const FaceDraft& f, const FaceDraft& g) {
    constexpr double kSameDirection = 1e-6; // radians; over 16,384 units a drift of a sixtieth
    return f.lit && g.lit && f.under == g.under && f.part == g.part && !f.face.curved() && f.face.plane == g.face.plane && f.face.model == g.face.model &&
           f.luxel_size == g.luxel_size && length(f.face.tangent.t - g.face.tangent.t) < kSameDirection &&
           length(f.face.tangent.b - g.face.tangent.b) < kSameDirection;
}

namespace {

// What all faces of a group have in common.
FaceDraft draft_of(const Group& group, const World& world, const SurfacesOptions& options, const PlaneTable& planes, Context& context) {
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
    face.normal = planes.normal(group.plane);
    face.distance = planes.distance(group.plane);
    face.drawn = visibility.drawn;
    face.blocks_light = visibility.blocks;
    face.sky = visibility.sky;
    face.two_sided = visibility.two_sided;
    face.hull = visibility.hull;
    draft.lit = visibility.lit;
    draft.under = group.under;
    draft.luxel_size = side.lightmap_scale > 0 && std::isfinite(side.lightmap_scale) ? side.lightmap_scale : 16;
    if (!group.gap) read_smoothing(world, side, brush, options, draft);
    if (!tangent_frame(side.texture, face.normal, face.tangent) && face.drawn)
        context.report(Severity::warning, "texture-axes-degenerate",
                       fmt::format("the texture axes of '{}' do not span the face: its tangent frame is arbitrary",
                                   world.materials[side.material.at()].name),
                       world.location(group.side));
    return draft;
}

// The charts that walls part: a number for each polygon, as in FaceDraft::part.
std::vector<std::uint32_t> part_groups(const Groups& groups, const std::vector<FaceDraft>& drafts, const VertexTable& vertices, Context& context) {
    std::vector<std::uint32_t> part(groups.polygons.size(), 0);
    std::map<std::tuple<ModelId, PlaneId, std::uint32_t>, std::vector<std::uint32_t>> of_plane; // lit groups
    for (std::uint32_t g = 0; g < drafts.size(); ++g)
        if (const Group& group = groups.groups[g]; drafts[g].lit) of_plane[{group.model, group.plane, group.under}].push_back(g);
    for (auto& [key, waiting] : of_plane)
        while (!waiting.empty()) { // those that may share a chart
            context.check_cancelled();
            const FaceDraft& first = drafts[waiting.front()];
            std::vector<std::uint32_t> left, members;
            std::vector<std::vector<Vec2>> polygons;
            const Vec3 s = first.face.tangent.t, t = cross(first.face.normal, s);
            for (const std::uint32_t g : waiting) {
                if (g != waiting.front() && !share_chart(first, drafts[g])) {
                    left.push_back(g);
                    continue;
                }
                for (std::uint32_t i = groups.groups[g].first; i < groups.groups[g].first + groups.groups[g].count; ++i) {
                    members.push_back(i);
                    std::vector<Vec2>& polygon = polygons.emplace_back();
                    for (const VertexId v : PolygonSpan(groups.polygons, i, 1)[0]) {
                        const Vec3 x = vertices.position(v);
                        polygon.push_back({dot(x, s) / first.luxel_size, dot(x, t) / first.luxel_size});
                    }
                }
            }
            const std::vector<std::uint32_t> numbers = part_at_walls(polygons);
            for (std::size_t i = 0; i < members.size(); ++i) part[members[i]] = numbers[i];
            waiting = std::move(left);
        }
    return part;
}

} // namespace

std::vector<FaceDraft> make_face_drafts(const World& world, const Csg& csg, const Bsp& bsp,
                                        const SurfacesOptions& options, Feet& feet, VertexTable& vertices, Context& context) {
    const Groups groups = collect(world, csg, bsp, feet, vertices);
    std::vector<FaceDraft> of_group;
    for (const Group& group : groups.groups) of_group.push_back(draft_of(group, world, options, vertices.planes(), context));
    const std::vector<std::uint32_t> part = part_groups(groups, of_group, vertices, context);
    RegionMerger merger(vertices);
    std::vector<FaceDraft> drafts;
    // One part of a group after the other; `of`: which of the group's polygons these are, in the order of the span.
    const auto add = [&](FaceDraft& draft, const PolygonSpan polygons, std::span<const std::uint32_t> of) {
        bool merged = true;
        std::vector<Region> regions = merger.merge(draft.face.plane, polygons, merged);
        if (!merged)
            context.report(Severity::note, "face-not-merged",
                           fmt::format("{} parts of this face could not be merged and stay separate", polygons.size()),
                           world.location(draft.face.side));
        for (Region& region : regions) {
            FaceDraft& d = drafts.emplace_back(draft);
            Vec3 area;
            for (const Outline& loop : region.loops) area += area_vector(vertices, loop.vertices);
            d.face.area = std::max(0.0, dot(area, d.face.normal));
            for (const VertexId v : region.loops[0].vertices) d.face.bounds.add(vertices.position(v));
            for (const std::uint32_t m : region.members)
                if (const ClusterId c = groups.clusters[of[m]]; c.valid()) d.face.clusters.push_back(c);
            std::ranges::sort(d.face.clusters);
            d.face.clusters.erase(std::unique(d.face.clusters.begin(), d.face.clusters.end()), d.face.clusters.end());
            if (region.loops.size() == 1 && convex(vertices, region.loops[0].vertices, d.face.normal))
                d.convex = {region.loops[0].vertices};
            else
                for (const std::uint32_t m : region.members) d.convex.emplace_back(polygons[m].begin(), polygons[m].end());
            d.loops = std::move(region.loops);
        }
    };
    std::vector<std::uint32_t> all(groups.polygons.size());
    std::iota(all.begin(), all.end(), 0u);
    for (std::size_t g = 0; g < groups.groups.size(); ++g) {
        context.check_cancelled();
        const Group& group = groups.groups[g];
        if (group.count == 0) continue; // all of it went to the groups of what stands on it
        FaceDraft& draft = of_group[g];
        const std::span<std::uint32_t> of = std::span(all).subspan(group.first, group.count);
        std::ranges::stable_sort(of, {}, [&](std::uint32_t i) { return part[i]; });
        if (part[of.front()] == part[of.back()]) {
            draft.part = part[of.front()];
            add(draft, PolygonSpan(groups.polygons, group.first, group.count), of);
            continue;
        }
        for (std::size_t from = 0, to = 0; from < of.size(); from = to) {
            Polygons some;
            for (draft.part = part[of[from]]; to < of.size() && part[of[to]] == draft.part; ++to) {
                const PolygonSpan one(groups.polygons, of[to], 1);
                some.vertices.insert(some.vertices.end(), one[0].begin(), one[0].end());
                some.lines.insert(some.lines.end(), one.lines().begin(), one.lines().end());
                some.first.push_back(static_cast<std::uint32_t>(some.vertices.size()));
            }
            add(draft, some, of.subspan(from, to - from));
        }
    }
    return drafts;
}

} // namespace kiln

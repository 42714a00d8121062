// Clusters: a leaf each, but for those that share one: the leaves of a func_viscluster, and of a 3D sky.
#include "compiler/bsp/build.h"
#include "libs/core/check.h"
#include <algorithm>
#include <fmt/format.h>
#include <map>
#include <set>

namespace kiln::bsp {
namespace {

// More than this share of a leaf's volume has to lie in a func_viscluster. (The original takes a tenth and then the first
// such volume, not the largest: a hall's leaves joined a closet's cluster. Half is where "in it" ends to be true.)
constexpr double kMostly = 0.5;
constexpr std::uint32_t kAlone = UINT32_MAX;

double volume(const Polytope& body) {
    const Vec3 at = body.box.center();
    double six = 0;
    for (const Poly& f : body.faces())
        for (std::size_t i = 2; i < f.count; ++i)
            six += dot(f.first[0].point - at, cross(f.first[i - 1].point - at, f.first[i].point - at));
    return six / 6;
}

// Volume of the part of `body` in the union of the brushes. Cut exactly; measured with the rounded corners.
double volume_in(Cutter& cutter, const std::array<PlaneId, 6>& box, const Polytope& body, const Csg& csg, std::span<const BrushId> brushes) {
    std::vector<Polytope> rest{cutter.copy(body)}, next;
    double sum = 0;
    for (const BrushId b : brushes) {
        next.clear();
        for (Polytope& part : rest) {
            bool gone = false;
            for (const PlanePolygon& face : csg.brushes[b.at()].faces) {
                const PlanePolygon quad = plane_quad(cutter.space().planes, box, face.support);
                Polytope front, back;
                const unsigned s = cutter.divide(part, Splitter(cutter.space().planes, face.support), quad.edges, front, back);
                if (s == kBack) continue;
                next.push_back(s == kBoth ? front : part);
                if (s == kFront) {
                    gone = true;
                    break;
                }
                part = back;
            }
            if (gone) continue;
            sum += volume(part);
            cutter.drop(part);
        }
        rest.swap(next);
    }
    for (const Polytope& part : rest) cutter.drop(part);
    return sum;
}

void join_vis_clusters(const World& world, const Csg& csg, const Space& space, const Bsp& bsp, std::vector<std::uint32_t>& group,
                       std::uint32_t& groups, Context& context) {
    std::map<EntityId, std::vector<BrushId>> volumes;
    for (std::size_t b = 0; b < world.brushes.size(); ++b)
        if (csg.brushes[b].valid && world.brushes[b].contents == Contents::vis_cluster) volumes[world.brushes[b].entity].push_back(id<BrushId>(b));
    if (volumes.empty()) return;
    const std::vector<std::vector<PlanePolygon>> polytopes = leaf_polytopes(bsp);
    Cutter cutter(space);
    std::vector<double> largest(bsp.leaves.size(), kMostly);
    std::vector<EntityId> of_leaf(bsp.leaves.size());
    for (const auto& [entity, brushes] : volumes) {
        Box3 around;
        for (const BrushId b : brushes) around.add(csg.brushes[b.at()].bounds);
        for (std::size_t l = 0; l < bsp.leaves.size(); ++l) {
            if (!bsp.leaves[l].open() || bsp.leaves[l].outside || !overlap(around, bsp.leaves[l].bounds)) continue;
            const Polytope body = cutter.make(polytopes[l]);
            const double whole = volume(body);
            if (const double share = volume_in(cutter, bsp.box, body, csg, brushes) / whole; share > largest[l])
                largest[l] = share, of_leaf[l] = entity;
            cutter.drop(body);
        }
    }
    std::uint32_t joined = 0;
    for (const auto& [entity, brushes] : volumes) {
        std::uint32_t count = 0;
        for (std::size_t l = 0; l < of_leaf.size(); ++l)
            if (of_leaf[l] == entity) group[l] = groups, ++count;
        joined += count;
        if (count == 0)
            context.report(Severity::warning, "viscluster-empty", "no leaf of the level lies mostly in this func_viscluster: it does nothing",
                           world.location(entity));
        else ++groups;
    }
    if (joined > 0)
        context.report(Severity::note, "viscluster", fmt::format("{} leaves share the clusters of {} func_viscluster", joined, groups), {.file = world.file});
}

void join_skies(const World& world, const Bsp& bsp, std::vector<std::uint32_t>& group, std::uint32_t& groups, Context& context) {
    const auto area_at = [&](Vec3 p) { return bsp.leaves[leaf_at(bsp, p).at()].area; };
    std::set<std::uint32_t> with_players, done;
    for (const WorldEntity& e : world.entities)
        if (e.has_origin && lower_case(e.get("classname")).starts_with("info_player")) with_players.insert(area_at(e.origin));
    for (std::size_t e = 0; e < world.entities.size(); ++e) {
        const WorldEntity& camera = world.entities[e];
        if (!camera.has_origin || !equal_ignoring_case(camera.get("classname"), "sky_camera")) continue;
        const BspLeaf& leaf = bsp.leaves[leaf_at(bsp, camera.origin).at()];
        if (!leaf.open() || leaf.outside) {
            context.report(Severity::warning, "sky-camera-in-solid", "the sky_camera stands in solid or outside: the 3D sky has no area", world.location(id<EntityId>(e)));
            continue;
        }
        if (leaf.area == 0 || done.contains(leaf.area)) continue;
        if (with_players.contains(leaf.area)) {
            context.report(Severity::warning, "sky-camera-area",
                           "the sky_camera stands in the area in which players start: the 3D sky is not a room of its own, and its leaves keep their clusters",
                           world.location(id<EntityId>(e)));
            continue;
        }
        done.insert(leaf.area);
        for (std::size_t l = 0; l < bsp.leaves.size(); ++l)
            if (bsp.leaves[l].area == leaf.area) group[l] = groups;
        ++groups;
    }
}

} // namespace

void number_clusters(const World& world, const Csg& csg, const Space& space, Bsp& bsp, Context& context) {
    std::vector<std::uint32_t> group(bsp.leaves.size(), kAlone);
    std::uint32_t groups = 0;
    join_vis_clusters(world, csg, space, bsp, group, groups, context);
    join_skies(world, bsp, group, groups, context);
    std::vector<ClusterId> of_group(groups);
    for (std::size_t l = 0; l < bsp.leaves.size(); ++l) {
        BspLeaf& leaf = bsp.leaves[l];
        if (!leaf.open() || leaf.outside) continue;
        if (group[l] != kAlone && of_group[group[l]].valid()) {
            leaf.cluster = of_group[group[l]];
            continue;
        }
        leaf.cluster = ClusterId{bsp.cluster_count++};
        if (group[l] != kAlone) of_group[group[l]] = leaf.cluster;
    }
}

} // namespace kiln::bsp

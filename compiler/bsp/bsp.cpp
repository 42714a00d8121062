#include "compiler/bsp/bsp.h"
#include "compiler/bsp/build.h"
#include "libs/core/check.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace kiln {
namespace bsp {
namespace {

constexpr double kVoidAround = 16; // map units between the outermost brush and the world's box

Box3 bounds_of(const World& world, const Csg& csg, auto&& counts) {
    Box3 box;
    for (std::size_t b = 0; b < csg.brushes.size(); ++b)
        if (csg.brushes[b].valid && counts(world.brushes[b])) box.add(csg.brushes[b].bounds);
    return box;
}

std::array<PlaneId, 6> add_box(PlaneTable& planes, const Box3& around) {
    std::array<PlaneId, 6> box;
    for (std::size_t axis = 0; axis < 3; ++axis)
        for (const bool low : {false, true}) {
            const double at = low ? -(std::floor(around.lo[axis]) - kVoidAround) : std::ceil(around.hi[axis]) + kVoidAround;
            ExactPlane p;
            p.d = static_cast<__int128>(at) * (std::int64_t{1} << planes.grid_bits);
            (axis == 0 ? p.a : axis == 1 ? p.b : p.c) = low ? -1 : 1;
            box[2 * axis + low] = planes.add(p);
        }
    return box;
}

// Two leaves that no one inside tells apart become one, and their node goes.
class Pruner {
public:
    Pruner(Tree&& tree, const std::vector<std::uint8_t>& outside, Bsp& bsp, std::vector<LeafId>& new_leaf)
        : bsp_(bsp), new_leaf_(new_leaf) {
        leaves_.reserve(tree.leaves.size());
        for (TreeLeaf& l : tree.leaves)
            leaves_.push_back({.contents = l.contents, .cluster = {}, .outside = outside[leaves_.size()] != 0,
                               .bounds = l.bounds, .brushes = std::move(l.brushes)});
        std::vector<BspNode> nodes = std::move(tree.nodes);
        std::vector<std::int32_t> stands_for(nodes.size()); // the node itself, or the leaf it became
        for (std::size_t n = nodes.size(); n-- > 0;) {      // children come after their node
            for (std::int32_t& c : nodes[n].child)
                if (c >= 0) c = stands_for[static_cast<std::size_t>(c)];
            const auto [a, b] = nodes[n].child;
            stands_for[n] = static_cast<std::int32_t>(n);
            if (a < 0 && b < 0 && merge(leaf_of_child(a), leaf_of_child(b))) stands_for[n] = a;
        }
        new_leaf_.assign(leaves_.size(), LeafId{});
        bsp_.leaves.reserve(leaves_.size()), bsp_.nodes.reserve(nodes.size());
        number(nodes, nodes.empty() ? -1 : stands_for[0]);
    }

private:
    Bsp& bsp_;
    std::vector<LeafId>& new_leaf_;
    std::vector<BspLeaf> leaves_;

    bool merge(std::int32_t into, std::int32_t from) {
        BspLeaf &a = leaves_[static_cast<std::size_t>(into)], &b = leaves_[static_cast<std::size_t>(from)];
        if (a.contents != b.contents || a.outside != b.outside) return false;
        if (a.open() && !a.outside) return false;
        a.bounds.add(b.bounds);
        if (a.brushes == b.brushes || b.brushes.empty()) return true;
        std::vector<BrushId> all;
        std::ranges::set_union(a.brushes, b.brushes, std::back_inserter(all));
        a.brushes = std::move(all);
        return true;
    }
    void number(const std::vector<BspNode>& nodes, std::int32_t root) {
        struct Visit {
            std::int32_t child, parent;
            std::size_t which;
        };
        std::vector<Visit> stack{{root, -1, 0}};
        while (!stack.empty()) {
            const Visit v = stack.back();
            stack.pop_back();
            std::int32_t now = 0;
            if (v.child < 0) {
                const auto old = static_cast<std::size_t>(leaf_of_child(v.child));
                now = -1 - static_cast<std::int32_t>(bsp_.leaves.size());
                new_leaf_[old] = id<LeafId>(bsp_.leaves.size());
                bsp_.leaves.push_back(std::move(leaves_[old]));
            } else {
                now = static_cast<std::int32_t>(bsp_.nodes.size());
                const BspNode& n = nodes[static_cast<std::size_t>(v.child)];
                bsp_.nodes.push_back(n);
                stack.push_back({n.child[1], now, 1});
                stack.push_back({n.child[0], now, 0});
            }
            if (v.parent >= 0) bsp_.nodes[static_cast<std::size_t>(v.parent)].child[v.which] = now;
        }
    }
};

} // namespace

std::vector<LeafId> leaves_at(const std::vector<BspNode>& nodes, std::span<const Vec3> hull, double tolerance) {
    std::vector<LeafId> leaves;
    std::vector<std::int32_t> stack{nodes.empty() ? -1 : 0};
    while (!stack.empty()) {
        const std::int32_t at = stack.back();
        stack.pop_back();
        if (at < 0) {
            leaves.push_back(id<LeafId>(static_cast<std::size_t>(leaf_of_child(at))));
            continue;
        }
        const BspNode& n = nodes[static_cast<std::size_t>(at)];
        double least = std::numeric_limits<double>::infinity(), most = -least;
        for (const Vec3& p : hull) {
            const double d = dot(n.normal, p) - n.distance;
            least = std::min(least, d), most = std::max(most, d);
        }
        const bool behind = least <= tolerance, in_front = most >= -tolerance, neither = !behind && !in_front;
        if (behind || neither) stack.push_back(n.child[1]);
        if (in_front || neither) stack.push_back(n.child[0]);
    }
    std::ranges::sort(leaves);
    return leaves;
}

} // namespace bsp

Box3 bsp::world_box(const World& world, const Csg& csg) {
    Box3 box = bounds_of(world, csg, [](const WorldBrush& b) { return b.model.value == 0; });
    if (box.empty()) box = bounds_of(world, csg, [](const WorldBrush&) { return true; });
    if (box.empty()) box.add(Vec3{});
    return box;
}

Result<Bsp> build_bsp(const World& world, const Csg& csg, const BspOptions& options, Context& context) {
    Bsp out;
    out.planes = csg.planes;
    const Box3 world_box = bsp::world_box(world, csg);
    out.bounds = bsp::bounds_of(
        world, csg, [](const WorldBrush& b) { return b.model.value == 0 && b.contents == Contents::solid; });
    if (out.bounds.empty()) out.bounds = world_box;
    out.box = bsp::add_box(out.planes, world_box);
    const bsp::Space space(out.planes, world_box);

    context.say("bsp", 0);
    bsp::Cutter cutter(space);
    bsp::Tree tree = bsp::build_tree(world, csg, cutter, out.box, context);
    context.say("bsp", 0.5);
    context.check_cancelled();
    std::vector<BspPortal> portals = bsp::build_portals(cutter, tree);
    tree.caps = {};
    cutter.clear();
    context.say("bsp", 0.7);
    std::vector<std::uint8_t> outside(tree.leaves.size());
    const bsp::Flow flow = bsp::make_flow(tree, portals, options.micro_gap);
    if (options.fill) outside = bsp::fill_outside(tree, portals, flow);
    const bsp::Areas areas = bsp::find_areas(tree, portals, flow, outside);
    out.area_count = areas.count;
    if (options.fill) {
        bsp::report_gaps(world, csg, tree, portals, flow, outside, areas, context);
        out.closed = bsp::closed_gaps(world, csg, space, tree, portals, outside);
    }
    bsp::find_area_portals(world, csg, tree, portals, flow, areas, out, options.fill, context);
    context.check_cancelled();

    std::vector<LeafId> new_leaf;
    bsp::Pruner(std::move(tree), outside, out, new_leaf);
    out.leaf_water.assign(out.leaves.size(), UINT32_MAX);
    for (ClosedGap& g : out.closed) g.leaf = new_leaf[g.leaf.at()];
    for (std::size_t l = 0; l < new_leaf.size(); ++l)
        if (areas.of_leaf[l]) out.leaves[new_leaf[l].at()].area = areas.of_leaf[l];
    std::erase_if(portals, [&](const BspPortal& p) { return outside[p.leaf_front.at()] || outside[p.leaf_back.at()]; });
    for (BspPortal& p : portals) p.leaf_front = new_leaf[p.leaf_front.at()], p.leaf_back = new_leaf[p.leaf_back.at()];
    out.portals = std::move(portals);
    bsp::number_clusters(world, csg, space, out, context);
    bsp::find_waters(world, csg, out);
    bsp::find_occluders(world, csg, space, out, context);
    context.say("bsp", 0.8);
    out.visible = bsp::visible_fragments(csg, cutter, out);
    context.say("bsp", 1);
    return out;
}

LeafId leaf_at(const Bsp& bsp, Vec3 point) {
    std::int32_t at = bsp.nodes.empty() ? -1 : 0;
    while (at >= 0) {
        const BspNode& n = bsp.nodes[static_cast<std::size_t>(at)];
        at = n.child[dot(n.normal, point) - n.distance >= 0 ? 0 : 1];
    }
    return id<LeafId>(static_cast<std::size_t>(bsp::leaf_of_child(at)));
}

std::vector<LeafId> leaves_at(const Bsp& bsp, std::span<const Vec3> hull, double tolerance) {
    return bsp::leaves_at(bsp.nodes, hull, tolerance);
}

std::vector<std::vector<PlanePolygon>> leaf_polytopes(const Bsp& bsp) {
    Box3 box;
    for (const BspLeaf& l : bsp.leaves) box.add(l.bounds);
    const bsp::Space space(bsp.planes, box);
    std::vector<std::vector<PlanePolygon>> leaves(bsp.leaves.size());
    bsp::Cutter cutter(space);
    std::vector<std::pair<std::int32_t, bsp::Polytope>> stack;
    stack.emplace_back(bsp.nodes.empty() ? -1 : 0, cutter.make_box(bsp.box));
    while (!stack.empty()) {
        auto [at, region] = stack.back();
        stack.pop_back();
        if (at < 0) {
            auto& faces = leaves[static_cast<std::size_t>(bsp::leaf_of_child(at))];
            for (const bsp::Poly& f : region.faces()) faces.push_back(polygon(f));
            cutter.drop(region);
            continue;
        }
        const BspNode& n = bsp.nodes[static_cast<std::size_t>(at)];
        bsp::Polytope front, back;
        cutter.cut(region, bsp::Splitter(n.plane, n.normal, n.distance), bsp.box, front, back);
        stack.emplace_back(n.child[1], back);
        stack.emplace_back(n.child[0], front);
    }
    return leaves;
}

void check_invariants(const Bsp& bsp, const Csg& csg, const World* world, Checker& checker) {
    Check &tree = checker.add("tree"), &leaves = checker.add("leaves"), &portals = checker.add("portals"), &visible = checker.add("visible-fragments"),
          &gaps = checker.add("closed-gaps");
    const SourceLocation map{world ? world->file : ""};
    const auto place = [](const Box3& b) { return b.empty() ? std::string("nowhere") : bsp::name_place(b.center()); };
    const auto side = [&](SideId s) { return world ? world->location(s) : map; };

    bool same = bsp.planes.planes.size() >= csg.planes.planes.size();
    for (std::size_t i = 0; same && i < csg.planes.planes.size(); ++i) same = bsp.planes.planes[i] == csg.planes.planes[i];
    tree.expect(same, [&] { return Finding{map, "the planes are not those of the brushes and more"}; });
    // A binary tree in which every node and leaf is reached once.
    tree.expect(bsp.leaves.size() == bsp.nodes.size() + 1, [&] { return Finding{map, fmt::format("{} nodes part {} leaves", bsp.nodes.size(), bsp.leaves.size())}; });
    std::vector<int> node_seen(bsp.nodes.size()), leaf_seen(bsp.leaves.size());
    if (!bsp.nodes.empty()) ++node_seen[0];
    else if (!bsp.leaves.empty()) ++leaf_seen[0];
    for (std::size_t n = 0; n < bsp.nodes.size(); ++n) {
        tree.expect(bsp.nodes[n].plane.at() < bsp.planes.planes.size(), [&] { return Finding{map, fmt::format("node {} names plane {} of {}", n, bsp.nodes[n].plane.value, bsp.planes.planes.size())}; });
        for (const std::int32_t c : bsp.nodes[n].child) {
            const auto child = static_cast<std::size_t>(c >= 0 ? c : bsp::leaf_of_child(c));
            if (!tree.expect(c >= 0 ? child > n && child < bsp.nodes.size() : child < bsp.leaves.size(), [&] { return Finding{map, fmt::format("node {} has no child {}", n, c)}; }))
                continue;
            ++(c >= 0 ? node_seen : leaf_seen)[child];
        }
    }
    for (std::size_t n = 0; n < node_seen.size(); ++n) tree.expect(node_seen[n] == 1, [&] { return Finding{map, fmt::format("node {} is reached {} times", n, node_seen[n])}; });
    for (std::size_t l = 0; l < leaf_seen.size(); ++l) tree.expect(leaf_seen[l] == 1, [&] { return Finding{map, fmt::format("leaf {} is reached {} times", l, leaf_seen[l])}; });

    std::uint32_t clusters = 0;
    for (std::size_t i = 0; i < bsp.leaves.size(); ++i) {
        const BspLeaf& l = bsp.leaves[i];
        const auto tell = [&](std::string what) { return [&, what] { return Finding{map, fmt::format("leaf {} at {}: {}", i, place(l.bounds), what)}; }; };
        leaves.expect(!l.bounds.empty(), tell("its bounds are empty"));
        leaves.expect(l.cluster.valid() == (l.open() && !l.outside), tell("open leaves inside have a cluster, no others"));
        leaves.expect(!(l.outside && l.contents == Contents::solid), tell("solid is not outside"));
        if (l.cluster.valid()) { // numbers in the order in which they are met
            leaves.expect(l.cluster.value <= clusters, tell(fmt::format("its cluster is {}, in order it would be {}", l.cluster.value, clusters)));
            clusters += l.cluster.value == clusters;
        }
        leaves.expect(l.cluster.valid() || l.area == 0, tell("it has an area without a cluster"));
        leaves.expect(l.area <= bsp.area_count, tell(fmt::format("area {} of {}", l.area, bsp.area_count)));
        leaves.expect(std::ranges::is_sorted(l.brushes), tell("its brushes are not sorted"));
        leaves.expect(l.brushes.empty() || l.brushes.back().at() < csg.brushes.size(), tell("it lists a brush that does not exist"));
    }
    leaves.expect(clusters == bsp.cluster_count, [&] { return Finding{map, fmt::format("{} leaves have clusters, {} are stated", clusters, bsp.cluster_count)}; });

    Check &waters = checker.add("waters"), &area_portals = checker.add("area-portals"), &occluders = checker.add("occluders");
    if (waters.expect(bsp.leaf_water.size() == bsp.leaves.size(), [&] { return Finding{map, "the leaves' waters are not as many as leaves"}; }))
        for (std::size_t l = 0; l < bsp.leaves.size(); ++l) {
            const BspLeaf& leaf = bsp.leaves[l];
            const auto tell = [&](const char* what) { return [&, what] { return Finding{map, fmt::format("leaf {} at {}: {}", l, place(leaf.bounds), what)}; }; };
            const bool liquid = leaf.contents == Contents::water || leaf.contents == Contents::slime || leaf.contents == Contents::lava;
            const bool has = bsp.leaf_water[l] != UINT32_MAX;
            waters.expect(has == (liquid && leaf.cluster.valid()), tell("liquid leaves inside have a water volume, no others"));
            if (!has || !waters.expect(bsp.leaf_water[l] < bsp.waters.size(), tell("its water volume does not exist"))) continue;
            const WaterVolume& water = bsp.waters[bsp.leaf_water[l]];
            waters.expect(water.contents == leaf.contents && water.min_z <= leaf.bounds.lo.z, tell("its water volume is of another liquid, or ends above it"));
        }
    for (const AreaPortal& p : bsp.area_portals)
        area_portals.expect(p.areas[0] <= p.areas[1] && p.areas[1] <= bsp.area_count && p.winding.size() == p.polygon.size(), [&] {
            return Finding{world && p.brush.at() < world->brushes.size() ? world->location(p.brush) : map, fmt::format("an area portal between areas {} and {} of {}, or its winding is not that of its polygon", p.areas[0], p.areas[1], bsp.area_count)};
        });
    for (const Occluder& o : bsp.occluders)
        occluders.expect(!o.fragments.empty() && o.area <= bsp.area_count &&
                             std::ranges::all_of(o.fragments, [&](std::uint32_t f) { return f < csg.fragments.size() && csg.fragments[f].behind == Contents::occluder; }),
                         [&] { return Finding{world && o.entity.at() < world->entities.size() ? world->location(o.entity) : map, "an occluder without polygons, or with such of something else"}; });

    const auto reaches = [&](const Vec3& v, LeafId l) { // rounding is monotone, so this holds exactly
        Box3 at;
        at.add(v);
        return overlap(at, bsp.leaves[l.at()].bounds);
    };
    const auto inside = [&](LeafId l) { return l.at() < bsp.leaves.size() && bsp.leaves[l.at()].cluster.valid(); };
    for (std::size_t i = 0; i < bsp.portals.size(); ++i) {
        const BspPortal& p = bsp.portals[i];
        const auto tell = [&](const char* what) {
            return [&, what] { return Finding{map, fmt::format("portal {} at {}: {}", i, p.winding.empty() ? "nowhere" : bsp::name_place(p.winding[0]), what)}; };
        };
        portals.expect(p.leaf_front != p.leaf_back, tell("it joins a leaf with itself"));
        portals.expect(p.plane == p.polygon.support, tell("its plane is not its polygon's"));
        portals.expect(p.winding.size() >= 3 && p.winding.size() == p.polygon.size(), tell("its winding is not that of its polygon"));
        for (const LeafId l : {p.leaf_front, p.leaf_back}) {
            if (!portals.expect(inside(l), tell("it leads to a leaf that is not an open one inside"))) continue;
            portals.expect(std::ranges::all_of(p.winding, [&](const Vec3& v) { return reaches(v, l); }), tell("it lies beyond the bounds of its leaf"));
        }
    }
    for (std::size_t i = 0; i < bsp.visible.size(); ++i) {
        const VisibleFragment& v = bsp.visible[i];
        if (!visible.expect(v.fragment < csg.fragments.size(), [&] { return Finding{map, fmt::format("visible part {} is of no fragment", i)}; })) continue;
        const Fragment& f = csg.fragments[v.fragment];
        const auto tell = [&](const char* what) { return [&, what] { return Finding{side(f.side), what}; }; };
        if (i) visible.expect(bsp.visible[i - 1].fragment <= v.fragment, tell("visible parts are not sorted"));
        visible.expect(v.polygon.support == f.polygon.support, tell("a visible part lies in another plane than its fragment"));
        visible.expect(v.leaf.valid() == (f.model.value == 0), tell("parts of the world have a leaf in front, those of brush models none"));
        if (v.leaf.valid()) visible.expect(inside(v.leaf), tell("a visible part is seen from a leaf that is not an open one inside"));
    }
    for (const ClosedGap& g : bsp.closed) {
        const auto tell = [&](const char* what) { return [&, what] { return Finding{side(g.side), what}; }; };
        if (!gaps.expect(g.side.valid() && inside(g.leaf), tell("a closed gap has no side, or no open leaf inside"))) continue;
        gaps.expect(std::ranges::all_of(points(bsp.planes, g.polygon), [&](const Vec3& v) { return reaches(v, g.leaf); }), tell("a closed gap lies beyond the bounds of its leaf"));
    }
}

void validate(const Bsp& bsp, const Csg& csg) {
    Checker checker;
    check_invariants(bsp, csg, nullptr, checker);
}

} // namespace kiln

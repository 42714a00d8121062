#include "compiler/bsp/bsp.h"
#include "compiler/bsp/build.h"
#include "libs/core/check.h"
#include <algorithm>
#include <cmath>

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
    Pruner(const Tree& tree, const std::vector<std::uint8_t>& outside, Bsp& bsp, std::vector<LeafId>& new_leaf)
        : tree_(tree), bsp_(bsp), new_leaf_(new_leaf) {
        for (const TreeLeaf& l : tree.leaves)
            leaves_.push_back({.contents = l.contents, .cluster = {}, .outside = outside[leaves_.size()] != 0,
                               .bounds = l.bounds, .brushes = l.brushes});
        std::vector<BspNode> nodes = tree.nodes;
        std::vector<std::int32_t> stands_for(nodes.size()); // the node itself, or the leaf it became
        for (std::size_t n = nodes.size(); n-- > 0;) {      // children come after their node
            for (std::int32_t& c : nodes[n].child)
                if (c >= 0) c = stands_for[static_cast<std::size_t>(c)];
            const auto [a, b] = nodes[n].child;
            stands_for[n] = static_cast<std::int32_t>(n);
            if (a < 0 && b < 0 && merge(leaf_of_child(a), leaf_of_child(b))) stands_for[n] = a;
        }
        new_leaf_.assign(tree.leaves.size(), LeafId{});
        number(nodes, nodes.empty() ? -1 : stands_for[0]);
    }

private:
    const Tree& tree_;
    Bsp& bsp_;
    std::vector<LeafId>& new_leaf_;
    std::vector<BspLeaf> leaves_;

    bool merge(std::int32_t into, std::int32_t from) {
        BspLeaf &a = leaves_[static_cast<std::size_t>(into)], &b = leaves_[static_cast<std::size_t>(from)];
        if (a.contents != b.contents || a.outside != b.outside) return false;
        if (a.open() && !a.outside) return false;
        a.bounds.add(b.bounds);
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

std::vector<LeafId> leaves_at(const std::vector<BspNode>& nodes, Vec3 point, double tolerance) {
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
        const double d = dot(n.normal, point) - n.distance;
        if (d <= tolerance) stack.push_back(n.child[1]);
        if (d >= -tolerance) stack.push_back(n.child[0]);
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
    const bsp::Tree tree = bsp::build_tree(world, csg, space, out.box, context);
    context.say("bsp", 0.5);
    context.check_cancelled();
    std::vector<BspPortal> portals = bsp::build_portals(space, tree);
    context.say("bsp", 0.7);
    std::vector<std::uint8_t> outside(tree.leaves.size());
    if (options.fill) {
        const bsp::Flow flow = bsp::make_flow(tree, portals, options.micro_gap);
        outside = bsp::fill_outside(tree, portals, flow);
        bsp::report_gaps(world, csg, tree, portals, flow, outside, context);
    }
    context.check_cancelled();

    std::vector<LeafId> new_leaf;
    bsp::Pruner(tree, outside, out, new_leaf);
    out.leaf_water.assign(out.leaves.size(), UINT32_MAX);
    if (options.fill) out.closed = bsp::closed_gaps(world, csg, space, tree, portals, outside, new_leaf);
    for (BspPortal& p : portals) {
        if (outside[p.leaf_front.at()] || outside[p.leaf_back.at()]) continue;
        p.leaf_front = new_leaf[p.leaf_front.at()], p.leaf_back = new_leaf[p.leaf_back.at()];
        out.portals.push_back(std::move(p));
    }
    std::vector<std::vector<BrushId>> portals_in(out.leaves.size());
    for (std::size_t l = 0; l < tree.leaves.size(); ++l)
        if (!tree.leaves[l].area_portals.empty() && new_leaf[l].valid()) portals_in[new_leaf[l].at()] = tree.leaves[l].area_portals;
    bsp::number_areas(out, portals_in);
    bsp::number_clusters(world, csg, space, out, context);
    bsp::find_area_portals(world, csg, portals_in, out, options.fill, context);
    bsp::find_waters(world, csg, out);
    bsp::find_occluders(world, csg, space, out, context);
    context.say("bsp", 0.8);
    out.visible = bsp::visible_fragments(csg, space, out);
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

std::vector<LeafId> leaves_at(const Bsp& bsp, Vec3 point, double tolerance) {
    return bsp::leaves_at(bsp.nodes, point, tolerance);
}

std::vector<std::vector<PlanePolygon>> leaf_polytopes(const Bsp& bsp) {
    Box3 box;
    for (const BspLeaf& l : bsp.leaves) box.add(l.bounds);
    const bsp::Space space(bsp.planes, box);
    std::vector<std::vector<PlanePolygon>> leaves(bsp.leaves.size());
    std::vector<std::pair<std::int32_t, bsp::Polytope>> stack;
    stack.emplace_back(bsp.nodes.empty() ? -1 : 0, bsp::Polytope{bsp::box_faces(bsp.planes, bsp.box), {}});
    while (!stack.empty()) {
        auto [at, region] = std::move(stack.back());
        stack.pop_back();
        if (at < 0) {
            auto& faces = leaves[static_cast<std::size_t>(bsp::leaf_of_child(at))];
            for (bsp::Poly& f : region.faces) faces.push_back(std::move(f.polygon));
            continue;
        }
        const BspNode& n = bsp.nodes[static_cast<std::size_t>(at)];
        const auto cap =
            bsp::clip_behind(bsp.planes, bsp::plane_quad(bsp.planes, bsp.box, n.plane), region.faces);
        KILN_CHECK(cap.has_value());
        bsp::Polytope front, back;
        bsp::cut(space, std::move(region), bsp::Splitter(n.plane, n.normal, n.distance), *cap, front, back);
        stack.emplace_back(n.child[1], std::move(back));
        stack.emplace_back(n.child[0], std::move(front));
    }
    return leaves;
}

void validate(const Bsp& bsp, const Csg& csg) {
    KILN_CHECK_OP(bsp.planes.planes.size(), >=, csg.planes.planes.size());
    for (std::size_t i = 0; i < csg.planes.planes.size(); ++i)
        KILN_CHECK(bsp.planes.planes[i] == csg.planes.planes[i]);
    // A binary tree in which every node and leaf is reached once.
    KILN_CHECK_OP(bsp.leaves.size(), ==, bsp.nodes.size() + 1);
    std::vector<int> node_seen(bsp.nodes.size()), leaf_seen(bsp.leaves.size());
    if (!bsp.nodes.empty()) ++node_seen[0];
    else ++leaf_seen[0];
    for (std::size_t n = 0; n < bsp.nodes.size(); ++n)
        for (const std::int32_t c : bsp.nodes[n].child) {
            if (c >= 0) {
                KILN_CHECK_OP(static_cast<std::size_t>(c), >, n);
                KILN_CHECK_OP(static_cast<std::size_t>(c), <, bsp.nodes.size());
                ++node_seen[static_cast<std::size_t>(c)];
            } else {
                KILN_CHECK_OP(static_cast<std::size_t>(bsp::leaf_of_child(c)), <, bsp.leaves.size());
                ++leaf_seen[static_cast<std::size_t>(bsp::leaf_of_child(c))];
            }
        }
    for (const int s : node_seen) KILN_CHECK_OP(s, ==, 1);
    for (const int s : leaf_seen) KILN_CHECK_OP(s, ==, 1);
    std::uint32_t clusters = 0;
    for (const BspLeaf& l : bsp.leaves) {
        KILN_CHECK(!l.bounds.empty());
        KILN_CHECK(l.cluster.valid() == (l.open() && !l.outside));
        KILN_CHECK(!(l.outside && l.contents == Contents::solid));
        if (l.cluster.valid()) { // numbers in the order in which they are met
            KILN_CHECK_OP(l.cluster.value, <=, clusters);
            clusters += l.cluster.value == clusters;
        }
        KILN_CHECK(l.cluster.valid() || l.area == 0);
        KILN_CHECK_OP(l.area, <=, bsp.area_count);
        KILN_CHECK(std::ranges::is_sorted(l.brushes));
    }
    KILN_CHECK_OP(clusters, ==, bsp.cluster_count);
    KILN_CHECK_OP(bsp.leaf_water.size(), ==, bsp.leaves.size());
    for (std::size_t l = 0; l < bsp.leaves.size(); ++l) {
        const BspLeaf& leaf = bsp.leaves[l];
        const bool liquid = leaf.contents == Contents::water || leaf.contents == Contents::slime || leaf.contents == Contents::lava;
        KILN_CHECK((bsp.leaf_water[l] != UINT32_MAX) == (liquid && leaf.cluster.valid()));
        if (bsp.leaf_water[l] == UINT32_MAX) continue;
        KILN_CHECK_OP(bsp.leaf_water[l], <, bsp.waters.size());
        const WaterVolume& water = bsp.waters[bsp.leaf_water[l]];
        KILN_CHECK(water.contents == leaf.contents);
        KILN_CHECK_OP(water.min_z, <=, leaf.bounds.lo.z);
    }
    for (const AreaPortal& p : bsp.area_portals) {
        KILN_CHECK_OP(p.areas[0], <=, p.areas[1]);
        KILN_CHECK_OP(p.areas[1], <=, bsp.area_count);
        KILN_CHECK_OP(p.winding.size(), ==, p.polygon.size());
    }
    for (const Occluder& o : bsp.occluders) {
        KILN_CHECK(!o.fragments.empty() && o.area <= bsp.area_count);
        for (const std::uint32_t f : o.fragments) KILN_CHECK(csg.fragments[f].behind == Contents::occluder);
    }
    for (const BspPortal& p : bsp.portals) {
        KILN_CHECK(p.leaf_front != p.leaf_back);
        KILN_CHECK(p.plane == p.polygon.support);
        KILN_CHECK_OP(p.winding.size(), >=, 3u);
        KILN_CHECK_OP(p.winding.size(), ==, p.polygon.size());
        for (const LeafId l : {p.leaf_front, p.leaf_back}) {
            KILN_CHECK_OP(l.at(), <, bsp.leaves.size());
            KILN_CHECK(bsp.leaves[l.at()].cluster.valid());
            for (const Vec3& v : p.winding) { // rounding is monotone, so this holds exactly
                Box3 at;
                at.add(v);
                KILN_CHECK(overlap(at, bsp.leaves[l.at()].bounds));
            }
        }
    }
    for (std::size_t i = 0; i < bsp.visible.size(); ++i) {
        const VisibleFragment& v = bsp.visible[i];
        KILN_CHECK_OP(v.fragment, <, csg.fragments.size());
        if (i) KILN_CHECK_OP(bsp.visible[i - 1].fragment, <=, v.fragment);
        KILN_CHECK(v.polygon.support == csg.fragments[v.fragment].polygon.support);
        KILN_CHECK(v.leaf.valid() == (csg.fragments[v.fragment].model.value == 0));
        if (v.leaf.valid()) KILN_CHECK(bsp.leaves[v.leaf.at()].cluster.valid());
    }
    for (const ClosedGap& g : bsp.closed) {
        KILN_CHECK(g.side.valid() && g.leaf.valid());
        KILN_CHECK(bsp.leaves[g.leaf.at()].cluster.valid());
        for (const Vec3& v : points(bsp.planes, g.polygon)) {
            Box3 at;
            at.add(v);
            KILN_CHECK(overlap(at, bsp.leaves[g.leaf.at()].bounds));
        }
    }
}

} // namespace kiln

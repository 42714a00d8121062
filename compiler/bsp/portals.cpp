// Portals: each node's plane within the node's region, cut up by both subtrees.
#include "compiler/bsp/build.h"
#include "libs/core/check.h"

namespace kiln::bsp {

std::int32_t leaf_of_child(std::int32_t child) { return -1 - child; }

namespace {

struct Placed {
    Poly poly;
    std::int32_t leaf;
};

// The parts of `poly`, which lies in the boundary of `child`'s region, by open leaf. Depth first, front first.
void push(const Space& space, const Tree& tree, std::int32_t child, Poly&& poly, std::vector<Placed>& out) {
    std::vector<std::pair<std::int32_t, Poly>> stack;
    stack.emplace_back(child, std::move(poly));
    while (!stack.empty()) {
        auto [at, p] = std::move(stack.back());
        stack.pop_back();
        if (at < 0) {
            const std::int32_t leaf = leaf_of_child(at);
            if (tree.leaves[static_cast<std::size_t>(leaf)].contents != Contents::solid)
                out.push_back({std::move(p), leaf});
            continue;
        }
        const BspNode& node = tree.nodes[static_cast<std::size_t>(at)];
        Poly behind;
        const unsigned s = divide(space, p, Splitter(node.plane, node.normal, node.distance), behind);
        KILN_CHECK(s != 0); // a node below crosses the region, so it is another plane
        if (s & kBack) stack.emplace_back(node.child[1], std::move(s == kBoth ? behind : p));
        if (s & kFront) stack.emplace_back(node.child[0], std::move(p));
    }
}

} // namespace

std::vector<BspPortal> build_portals(const Space& space, const Tree& tree) {
    std::vector<BspPortal> portals;
    std::vector<Placed> front, both;
    for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
        front.clear();
        push(space, tree, tree.nodes[n].child[0], make_poly(space.planes, tree.caps[n]), front);
        for (Placed& f : front) {
            both.clear();
            push(space, tree, tree.nodes[n].child[1], std::move(f.poly), both);
            for (Placed& b : both) {
                BspPortal p;
                p.leaf_front = id<LeafId>(static_cast<std::size_t>(f.leaf));
                p.leaf_back = id<LeafId>(static_cast<std::size_t>(b.leaf));
                p.plane = tree.nodes[n].plane;
                p.polygon = std::move(b.poly.polygon);
                p.winding = std::move(b.poly.points);
                p.hint = tree.hint[n];
                portals.push_back(std::move(p));
            }
        }
    }
    return portals;
}

} // namespace kiln::bsp

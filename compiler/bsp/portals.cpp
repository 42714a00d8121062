// Portals: each node's plane within the node's region, cut up by both subtrees.
#include "compiler/bsp/build.h"
#include "libs/core/check.h"

namespace kiln::bsp {

std::int32_t leaf_of_child(std::int32_t child) { return -1 - child; }

namespace {

struct Placed {
    Poly poly;
    std::int32_t at; // child, or leaf
};

// Hands polygons down the tree. Keeps its memory from polygon to polygon.
class Sorter {
public:
    Sorter(Cutter& cutter, const Tree& tree) : tree_(tree), cutter_(cutter), open_below_(tree.nodes.size()) {
        for (std::size_t n = tree.nodes.size(); n-- > 0;)
            for (const std::int32_t c : tree.nodes[n].child) open_below_[n] = open_below_[n] || any_open(c);
    }
    bool any_open(std::int32_t child) const {
        if (child >= 0) return open_below_[static_cast<std::size_t>(child)] != 0;
        return tree_.leaves[static_cast<std::size_t>(leaf_of_child(child))].contents != Contents::solid;
    }
    // The parts of `poly`, which lies in the boundary of `child`'s region, by open leaf. Depth first, front first.
    void push(std::int32_t child, Poly poly, std::vector<Placed>& out) {
        stack_.push_back({poly, child});
        while (!stack_.empty()) {
            auto [p, at] = stack_.back();
            stack_.pop_back();
            if (!any_open(at)) {
                cutter_.drop(p);
                continue;
            }
            if (at < 0) {
                out.push_back({p, leaf_of_child(at)});
                continue;
            }
            const BspNode& node = tree_.nodes[static_cast<std::size_t>(at)];
            Poly behind;
            const unsigned s = cutter_.divide(p, Splitter(node.plane, node.normal, node.distance), behind);
            KILN_CHECK(s != 0); // a node below crosses the region, so it is another plane
            if (s & kBack) stack_.push_back({s == kBoth ? behind : p, node.child[1]});
            if (s & kFront) stack_.push_back({p, node.child[0]});
        }
    }

private:
    const Tree& tree_;
    Cutter& cutter_;
    std::vector<std::uint8_t> open_below_; // per node: an open leaf
    std::vector<Placed> stack_;
};

} // namespace

std::vector<BspPortal> build_portals(Cutter& cutter, const Tree& tree) {
    std::vector<BspPortal> portals;
    portals.reserve(4 * tree.nodes.size()); // levels have one to four a node; what is not touched costs nothing
    std::vector<Placed> front, both;
    Sorter sorter(cutter, tree);
    for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
        const auto [ahead, behind] = tree.nodes[n].child;
        if (!sorter.any_open(ahead) || !sorter.any_open(behind)) continue;
        front.clear();
        sorter.push(ahead, cutter.copy(tree.caps[n]), front);
        for (const Placed& f : front) {
            both.clear();
            sorter.push(behind, f.poly, both);
            for (const Placed& b : both) {
                BspPortal p;
                p.leaf_front = id<LeafId>(static_cast<std::size_t>(f.at));
                p.leaf_back = id<LeafId>(static_cast<std::size_t>(b.at));
                p.plane = tree.nodes[n].plane;
                p.polygon = polygon(b.poly);
                p.winding = winding(b.poly);
                p.hint = tree.hint[n];
                portals.push_back(std::move(p));
                cutter.drop(b.poly);
            }
        }
    }
    return portals;
}

} // namespace kiln::bsp

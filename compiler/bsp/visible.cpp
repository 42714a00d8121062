// Which parts of the fragments border open leaves inside: each is handed down the tree, exactly cut at the nodes.
#include "compiler/bsp/build.h"

namespace kiln::bsp {

std::vector<VisibleFragment> visible_fragments(const Csg& csg, const Space& space, const Bsp& bsp) {
    std::vector<VisibleFragment> visible;
    std::vector<std::pair<std::int32_t, Poly>> stack;
    Cutter cutter(space);
    for (std::uint32_t f = 0; f < csg.fragments.size(); ++f) {
        const Fragment& fragment = csg.fragments[f];
        if (fragment.covered || fragment.behind == Contents::hint || fragment.behind == Contents::area_portal ||
            fragment.behind == Contents::occluder)
            continue;
        if (fragment.model.value != 0) {
            visible.push_back({f, fragment.polygon, {}});
            continue;
        }
        stack.emplace_back(bsp.nodes.empty() ? -1 : 0, cutter.make(fragment.polygon));
        while (!stack.empty()) {
            auto [at, poly] = stack.back();
            stack.pop_back();
            if (at < 0) {
                const LeafId leaf = id<LeafId>(static_cast<std::size_t>(leaf_of_child(at)));
                if (bsp.leaves[leaf.at()].open() && !bsp.leaves[leaf.at()].outside)
                    visible.push_back({f, polygon(poly), leaf});
                cutter.drop(poly);
                continue;
            }
            const BspNode& node = bsp.nodes[static_cast<std::size_t>(at)];
            if (same_plane(poly.support, node.plane)) { // down the side it faces
                stack.emplace_back(node.child[poly.support == node.plane ? 0 : 1], poly);
                continue;
            }
            Poly behind;
            const unsigned s = cutter.divide(poly, Splitter(node.plane, node.normal, node.distance), behind);
            if (s & kBack) stack.emplace_back(node.child[1], s == kBoth ? behind : poly);
            if (s & kFront) stack.emplace_back(node.child[0], poly);
        }
    }
    return visible;
}

} // namespace kiln::bsp

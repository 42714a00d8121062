// Which parts of the fragments border open leaves inside: each is handed down the tree, exactly cut at the nodes.
#include "compiler/bsp/build.h"

namespace kiln::bsp {

std::vector<VisibleFragment> visible_fragments(const Csg& csg, const Space& space, const Bsp& bsp) {
    std::vector<VisibleFragment> visible;
    std::vector<std::pair<std::int32_t, Poly>> stack;
    for (std::uint32_t f = 0; f < csg.fragments.size(); ++f) {
        const Fragment& fragment = csg.fragments[f];
        if (fragment.covered || fragment.behind == Contents::hint || fragment.behind == Contents::area_portal ||
            fragment.behind == Contents::occluder)
            continue;
        if (fragment.model.value != 0) {
            visible.push_back({f, fragment.polygon, {}});
            continue;
        }
        stack.emplace_back(bsp.nodes.empty() ? -1 : 0, make_poly(space.planes, fragment.polygon));
        while (!stack.empty()) {
            auto [at, poly] = std::move(stack.back());
            stack.pop_back();
            if (at < 0) {
                const LeafId leaf = id<LeafId>(static_cast<std::size_t>(leaf_of_child(at)));
                if (bsp.leaves[leaf.at()].open() && !bsp.leaves[leaf.at()].outside)
                    visible.push_back({f, std::move(poly.polygon), leaf});
                continue;
            }
            const BspNode& node = bsp.nodes[static_cast<std::size_t>(at)];
            if (same_plane(poly.polygon.support, node.plane)) { // down the side it faces
                stack.emplace_back(node.child[poly.polygon.support == node.plane ? 0 : 1], std::move(poly));
                continue;
            }
            Poly behind;
            const unsigned s = divide(space, poly, Splitter(node.plane, node.normal, node.distance), behind);
            if (s & kBack) stack.emplace_back(node.child[1], std::move(s == kBoth ? behind : poly));
            if (s & kFront) stack.emplace_back(node.child[0], std::move(poly));
        }
    }
    return visible;
}

} // namespace kiln::bsp

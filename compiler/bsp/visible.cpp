// Which parts of the fragments border open leaves inside: all are handed down the tree together, exactly cut at the nodes.
#include "compiler/bsp/build.h"

namespace kiln::bsp {
namespace {

bool is_visible(const Fragment& f) {
    return !f.covered && f.behind != Contents::hint && f.behind != Contents::area_portal && f.behind != Contents::occluder;
}

struct Part {
    Poly poly;
    std::uint32_t fragment;
    LeafId leaf; // in the end
};

// Parts of the world's fragments that reach open inside leaves: by leaf, those of one by fragment. Node after node, not
// fragment after fragment: the tree of a large level is larger than the processor's caches.
std::vector<Part> sort_down(const Csg& csg, const Bsp& bsp, Cutter& cutter) {
    std::vector<Part> parts, front, done; // parts: of all nodes that wait, the top's last
    parts.reserve(csg.fragments.size() + csg.fragments.size() / 4), done.reserve(3 * csg.fragments.size()); // about as many as come; what is not touched costs nothing
    for (std::uint32_t f = 0; f < csg.fragments.size(); ++f) {
        const Fragment& fragment = csg.fragments[f];
        if (is_visible(fragment) && fragment.model.value == 0) parts.push_back({cutter.make(fragment.polygon), f, {}});
    }
    struct Visit {
        std::int32_t at;
        std::size_t first;
    };
    std::vector<Visit> stack{{bsp.nodes.empty() ? -1 : 0, 0}};
    while (!stack.empty()) {
        const auto [at, first] = stack.back();
        stack.pop_back();
        if (at < 0 || first == parts.size()) {
            const LeafId leaf = at < 0 ? id<LeafId>(static_cast<std::size_t>(leaf_of_child(at))) : LeafId{};
            const bool kept = at < 0 && bsp.leaves[leaf.at()].open() && !bsp.leaves[leaf.at()].outside;
            for (std::size_t i = first; i < parts.size(); ++i)
                if (kept) done.push_back({parts[i].poly, parts[i].fragment, leaf});
                else cutter.drop(parts[i].poly);
            parts.resize(first);
            continue;
        }
        const BspNode& node = bsp.nodes[static_cast<std::size_t>(at)];
        const Splitter q(node.plane, node.normal, node.distance);
        front.clear();
        std::size_t kept = first; // those behind, in place
        for (std::size_t i = first; i < parts.size(); ++i) {
            Part part = parts[i];
            Poly behind;
            unsigned s = cutter.divide(part.poly, q, behind);
            if (s == 0) s = part.poly.support == node.plane ? kFront : kBack; // down the side it faces
            if (s & kFront) front.push_back(part);
            if (s == kBoth) part.poly = behind;
            if (s & kBack) parts[kept++] = part;
        }
        parts.resize(kept);
        parts.insert(parts.end(), front.begin(), front.end());
        stack.push_back({node.child[1], first});
        stack.push_back({node.child[0], kept});
    }
    return done;
}

} // namespace

std::vector<VisibleFragment> visible_fragments(const Csg& csg, Cutter& cutter, const Bsp& bsp) {
    const std::vector<Part> parts = sort_down(csg, bsp, cutter);
    const Groups of_fragment = group(csg.fragments.size(), parts.size(), [&](std::size_t i) { return std::array{parts[i].fragment}; });
    std::vector<VisibleFragment> visible;
    visible.reserve(parts.size());
    for (std::uint32_t f = 0; f < csg.fragments.size(); ++f) {
        if (csg.fragments[f].model.value != 0 && is_visible(csg.fragments[f])) visible.push_back({f, csg.fragments[f].polygon, {}});
        for (const std::uint32_t i : of_fragment[f]) visible.push_back({f, polygon(parts[i].poly), parts[i].leaf});
    }
    return visible;
}

} // namespace kiln::bsp

// The tree. A node's region is carried down as a convex polytope, as are the pieces of all brushes that reach into
// it; the boundary polygons that are still inside divide it. Where no boundary is left, one kind of contents
// fills the region: any structural piece with volume in it makes it solid.
#include "compiler/bsp/build.h"
#include "libs/core/check.h"
#include <algorithm>
#include <climits>

namespace kiln::bsp {
namespace {

struct Piece {
    Polytope body;
    BrushId brush;
    Contents contents = Contents::solid;
};

struct Work { // a node to be; its items and pieces are the last of the builder's
    Polytope region;
    std::int32_t parent = -1;
    int which = 0;
    std::size_t first_item = 0, first_piece = 0;
};

bool is_liquid(Contents c) { return c == Contents::water || c == Contents::slime || c == Contents::lava; }
// Brushes that leaves know of. Triggers and hints are nothing; area portals only mark their leaf.
bool is_carried(Contents c) {
    return c == Contents::solid || c == Contents::detail || c == Contents::window || c == Contents::grate || is_liquid(c) ||
           c == Contents::clip || c == Contents::area_portal;
}
bool is_listed(Contents c) { return is_carried(c) && c != Contents::area_portal; }

// What a boundary of such contents is to the tree; nothing: it does not divide it.
std::optional<SplitterItem::Kind> kind_of(Contents behind) {
    if (behind == Contents::solid) return SplitterItem::structural;
    if (behind == Contents::window || behind == Contents::grate || is_liquid(behind)) return SplitterItem::translucent;
    if (behind == Contents::area_portal) return SplitterItem::area_portal;
    if (behind == Contents::hint) return SplitterItem::hint;
    return std::nullopt;
}

class Builder {
public:
    Builder(const World& world, const Csg& csg, Cutter& cutter, const std::array<PlaneId, 6>& box, Context& context)
        : world_(world), csg_(csg), space_(cutter.space()), cutter_(cutter), box_(box), context_(context), chooser_(space_) {}

    Tree run() {
        std::vector<Work> stack;
        stack.push_back(root());
        while (!stack.empty()) {
            const Work work = stack.back();
            stack.pop_back();
            if ((++steps_ & 255) == 0) context_.check_cancelled();
            settle(work);
            if (items_.size() == work.first_item) {
                link(work, -1 - static_cast<std::int32_t>(tree_.leaves.size()));
                add_leaf(work);
                continue;
            }
            link(work, static_cast<std::int32_t>(tree_.nodes.size()));
            auto [front, back] = divide(work);
            stack.push_back(back);
            stack.push_back(front);
        }
        return std::move(tree_);
    }

private:
    const World& world_;
    const Csg& csg_;
    const Space& space_;
    Cutter& cutter_;
    const std::array<PlaneId, 6>& box_;
    Context& context_;
    Tree tree_;
    std::size_t steps_ = 0;
    SplitterChooser chooser_;
    // Of all that waits on the stack, the top last: a node's are replaced by those behind its plane, then those in front.
    std::vector<SplitterItem> items_;
    std::vector<Piece> pieces_;
    std::vector<SplitterItem> front_items_; // while dividing
    std::vector<Piece> front_pieces_;
    std::vector<PlaneId> cap_edges_;

    std::span<SplitterItem> items(const Work& work) { return std::span(items_).subspan(work.first_item); }
    std::span<Piece> pieces(const Work& work) { return std::span(pieces_).subspan(work.first_piece); }
    static SplitterItem item(const Poly& poly, SplitterItem::Kind kind) { return {poly, area(poly), kind}; }

    Work root() {
        items_.reserve(csg_.fragments.size() + csg_.fragments.size() / 4); // where it grows it is copied whole
        for (const Fragment& f : csg_.fragments)
            if (const auto kind = f.model.value == 0 ? kind_of(f.behind) : std::nullopt)
                items_.push_back(item(cutter_.make(f.polygon), *kind));
        for (std::size_t b = 0; b < csg_.brushes.size(); ++b) {
            const BrushPolytope& brush = csg_.brushes[b];
            const WorldBrush& source = world_.brushes[b];
            if (brush.valid && source.model.value == 0 && is_carried(source.contents))
                pieces_.push_back({cutter_.make(brush.faces), id<BrushId>(b), source.contents});
        }
        return {.region = cutter_.make_box(box_)};
    }
    void link(const Work& work, std::int32_t child) {
        if (work.parent >= 0) tree_.nodes[static_cast<std::size_t>(work.parent)].child[static_cast<std::size_t>(work.which)] = child;
    }

    // Drops what need not divide a solid region, and adds what still has to divide an open one.
    void settle(const Work& work) {
        if (std::ranges::any_of(items(work), [](const auto& i) { return i.kind == SplitterItem::structural; })) return;
        const auto has = [&](Contents c) { return std::ranges::any_of(pieces(work), [&](const Piece& p) { return p.contents == c; }); };
        if (has(Contents::solid)) {
            for (const SplitterItem& i : items(work)) cutter_.drop(i.poly);
            items_.resize(work.first_item);
            return;
        }
        if (items_.size() > work.first_item || !has(Contents::detail)) return;
        // Where detail covers the surface of a liquid or window, there is no boundary polygon of it; its own
        // faces tell then. A face lies in the region's boundary exactly if its plane is one of the region's.
        for (const Piece& p : pieces(work)) {
            if (p.contents != Contents::window && p.contents != Contents::grate && !is_liquid(p.contents)) continue;
            for (const Poly& f : p.body.faces())
                if (!std::ranges::any_of(work.region.faces(), [&](const Poly& r) { return same_plane(r.support, f.support); }))
                    items_.push_back(item(cutter_.copy(f), SplitterItem::translucent));
        }
    }

    void add_leaf(const Work& work) {
        TreeLeaf& leaf = tree_.leaves.emplace_back();
        leaf.bounds = work.region.box;
        for (const Piece& p : pieces(work)) {
            if (is_listed(p.contents)) leaf.brushes.push_back(p.brush);
            if (p.contents == Contents::area_portal) leaf.area_portals.push_back(p.brush);
            cutter_.drop(p.body);
            if (p.contents == Contents::detail || p.contents == Contents::clip) continue;
            const auto rank = [](Contents c) { return strength(c).value_or(c == Contents::empty ? INT_MAX : INT_MAX - 1); };
            if (rank(p.contents) < rank(leaf.contents)) leaf.contents = p.contents; // the strongest fills it
        }
        pieces_.resize(work.first_piece);
        std::ranges::sort(leaf.brushes);
        std::ranges::sort(leaf.area_portals);
        if (leaf.contents != Contents::solid) measure(work.region, leaf);
        cutter_.drop(work.region);
    }
    // What only open leaves need.
    void measure(const Polytope& region, TreeLeaf& leaf) {
        leaf.thickness = 1e30;
        for (const Poly& f : region.faces()) {
            const Splitter q(space_.planes, f.support);
            double reach = 0;
            for (const Poly& other : region.faces())
                for (const Corner& c : other.corners()) reach = std::max(reach, q.distance - dot(q.normal, c.point));
            if (reach < leaf.thickness) leaf.thickness = reach, leaf.thin_way = q.normal, leaf.thin_end = q.distance;
            if (std::ranges::find(box_, f.support) != box_.end())
                tree_.void_faces.push_back({static_cast<std::uint32_t>(tree_.leaves.size() - 1), winding(f), polygon(f)});
        }
    }

    std::pair<Work, Work> divide(Work work) {
        const std::span<SplitterItem> items = this->items(work);
        const std::size_t chosen = chooser_.choose(items, work.region.box);
        const bool hint = items[chosen].kind == SplitterItem::hint;
        const Splitter& q = space_.splitter(PlaneId{items[chosen].poly.support.value & ~1u});
        tree_.nodes.push_back({.plane = q.plane, .child = {}, .bounds = work.region.box, .normal = q.normal,
                               .distance = q.distance});
        tree_.hint.push_back(hint);

        std::pair<Work, Work> parts;
        parts.first.parent = parts.second.parent = static_cast<std::int32_t>(tree_.nodes.size() - 1);
        parts.second.which = 1;
        // A polygon with area inside the region lies in q, so q crosses it.
        const Poly cap = cutter_.cut(work.region, q, box_, parts.first.region, parts.second.region);
        tree_.caps.push_back(cutter_.copy(cap));
        cap_edges_.clear();
        for (const Corner& c : cap.corners()) cap_edges_.push_back(c.edge);

        front_items_.clear();
        std::size_t kept = work.first_item; // those behind, in place
        for (std::size_t i = work.first_item; i < items_.size(); ++i) {
            SplitterItem& whole = items_[i];
            Poly behind;
            const unsigned s = cutter_.divide(whole.poly, q, behind);
            if (s == kBoth) {
                ++tree_.splits;
                const SplitterItem::Kind kind = whole.kind;
                front_items_.push_back(item(whole.poly, kind));
                items_[kept++] = item(behind, kind);
            } else if (s == kFront) {
                front_items_.push_back(whole);
            } else if (s == kBack) {
                items_[kept++] = whole;
            } else {
                cutter_.drop(whole.poly); // absorbed
            }
        }
        items_.resize(kept);
        items_.insert(items_.end(), front_items_.begin(), front_items_.end());
        parts.second.first_item = work.first_item, parts.first.first_item = kept;

        front_pieces_.clear();
        kept = work.first_piece;
        for (std::size_t i = work.first_piece; i < pieces_.size(); ++i) {
            Piece whole = pieces_[i];
            Polytope front, back;
            const unsigned s = cutter_.divide(whole.body, q, cap_edges_, front, back);
            if (s & kFront) front_pieces_.push_back({s == kBoth ? front : whole.body, whole.brush, whole.contents});
            if (s & kBack) pieces_[kept++] = {s == kBoth ? back : whole.body, whole.brush, whole.contents};
        }
        pieces_.resize(kept);
        pieces_.insert(pieces_.end(), front_pieces_.begin(), front_pieces_.end());
        parts.second.first_piece = work.first_piece, parts.first.first_piece = kept;
        return parts;
    }
};

} // namespace

Tree build_tree(const World& world, const Csg& csg, Cutter& cutter, const std::array<PlaneId, 6>& box, Context& context) {
    return Builder(world, csg, cutter, box, context).run();
}

} // namespace kiln::bsp

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
    BrushId brush;
    Contents contents = Contents::solid;
    Polytope body;
};

struct Work {
    std::int32_t parent = -1;
    int which = 0;
    std::vector<SplitterItem> items;
    std::vector<Piece> pieces;
    Polytope region;
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
    Builder(const World& world, const Csg& csg, const Space& space, const std::array<PlaneId, 6>& box, Context& context)
        : world_(world), csg_(csg), space_(space), box_(box), context_(context), chooser_(space.planes) {}

    Tree run() {
        std::vector<Work> stack;
        stack.push_back(root());
        while (!stack.empty()) {
            Work work = std::move(stack.back());
            stack.pop_back();
            if ((++steps_ & 255) == 0) context_.check_cancelled();
            settle(work);
            if (work.items.empty()) {
                link(work, -1 - static_cast<std::int32_t>(tree_.leaves.size()));
                tree_.leaves.push_back(leaf(work));
                continue;
            }
            link(work, static_cast<std::int32_t>(tree_.nodes.size()));
            auto [front, back] = divide(std::move(work));
            stack.push_back(std::move(back));
            stack.push_back(std::move(front));
        }
        return std::move(tree_);
    }

private:
    const World& world_;
    const Csg& csg_;
    const Space& space_;
    const std::array<PlaneId, 6>& box_;
    Context& context_;
    Tree tree_;
    std::size_t steps_ = 0;
    SplitterChooser chooser_;

    static SplitterItem item(Poly poly, SplitterItem::Kind kind) {
        const double size = area(poly.points);
        return {std::move(poly), size, kind};
    }

    Work root() {
        Work work;
        for (const Fragment& f : csg_.fragments)
            if (const auto kind = f.model.value == 0 ? kind_of(f.behind) : std::nullopt)
                work.items.push_back(item(make_poly(space_.planes, f.polygon), *kind));
        for (std::size_t b = 0; b < csg_.brushes.size(); ++b) {
            const BrushPolytope& brush = csg_.brushes[b];
            const WorldBrush& source = world_.brushes[b];
            if (!brush.valid || source.model.value != 0) continue;
            if (!is_carried(source.contents)) continue;
            Piece piece{id<BrushId>(b), source.contents, {}};
            for (const PlanePolygon& f : brush.faces) piece.body.faces.push_back(make_poly(space_.planes, f));
            refresh_box(piece.body);
            work.pieces.push_back(std::move(piece));
        }
        work.region.faces = box_faces(space_.planes, box_);
        refresh_box(work.region);
        return work;
    }
    void link(const Work& work, std::int32_t child) {
        if (work.parent >= 0) tree_.nodes[static_cast<std::size_t>(work.parent)].child[static_cast<std::size_t>(work.which)] = child;
    }

    // Drops what need not divide a solid region, and adds what still has to divide an open one.
    void settle(Work& work) {
        const bool hull_inside =
            std::ranges::any_of(work.items, [](const auto& i) { return i.kind == SplitterItem::structural; });
        if (hull_inside) return;
        const auto has = [&](Contents c) {
            return std::ranges::any_of(work.pieces, [&](const Piece& p) { return p.contents == c; });
        };
        if (has(Contents::solid)) {
            work.items.clear();
            return;
        }
        if (!work.items.empty() || !has(Contents::detail)) return;
        // Where detail covers the surface of a liquid or window, there is no boundary polygon of it; its own
        // faces tell then. A face lies in the region's boundary exactly if its plane is one of the region's.
        for (const Piece& p : work.pieces) {
            if (p.contents != Contents::window && p.contents != Contents::grate && !is_liquid(p.contents)) continue;
            for (const Poly& f : p.body.faces)
                if (!std::ranges::any_of(work.region.faces, [&](const Poly& r) {
                        return same_plane(r.polygon.support, f.polygon.support);
                    }))
                    work.items.push_back(item(f, SplitterItem::translucent));
        }
    }

    TreeLeaf leaf(const Work& work) const {
        TreeLeaf leaf;
        leaf.bounds = work.region.box;
        for (const Piece& p : work.pieces) {
            if (is_listed(p.contents)) leaf.brushes.push_back(p.brush);
            if (p.contents == Contents::area_portal) leaf.area_portals.push_back(p.brush);
            if (p.contents == Contents::detail || p.contents == Contents::clip) continue;
            const auto rank = [](Contents c) { return strength(c).value_or(c == Contents::empty ? INT_MAX : INT_MAX - 1); };
            if (rank(p.contents) < rank(leaf.contents)) leaf.contents = p.contents; // the strongest fills it
        }
        std::ranges::sort(leaf.brushes);
        std::ranges::sort(leaf.area_portals);
        leaf.thickness = 1e30;
        for (const Poly& f : work.region.faces) {
            const Vec3 n = space_.planes.normal(f.polygon.support);
            const double d = space_.planes.distance(f.polygon.support);
            double reach = 0;
            for (const Poly& other : work.region.faces)
                for (const Vec3& p : other.points) reach = std::max(reach, d - dot(n, p));
            if (reach < leaf.thickness) leaf.thickness = reach, leaf.thin_way = n;
        }
        if (leaf.contents != Contents::solid)
            for (const Poly& f : work.region.faces)
                if (std::ranges::find(box_, f.polygon.support) != box_.end())
                    leaf.void_faces.push_back(f.points), leaf.void_polygons.push_back(f.polygon);
        return leaf;
    }

    std::pair<Work, Work> divide(Work&& work) {
        const std::size_t chosen = chooser_.choose(work.items, work.region.box);
        const bool hint = work.items[chosen].kind == SplitterItem::hint;
        const Splitter q(space_.planes, PlaneId{work.items[chosen].poly.polygon.support.value & ~1u});
        const std::int32_t node = static_cast<std::int32_t>(tree_.nodes.size());
        std::pair<Work, Work> parts;
        parts.first.parent = parts.second.parent = node;
        parts.second.which = 1;

        std::optional<PlanePolygon> cap =
            clip_behind(space_.planes, plane_quad(space_.planes, box_, q.plane), work.region.faces);
        KILN_CHECK(cap.has_value()); // a polygon with area inside the region lies in q
        tree_.nodes.push_back({.plane = q.plane, .child = {}, .bounds = work.region.box, .normal = q.normal,
                               .distance = q.distance});
        tree_.hint.push_back(hint);

        for (SplitterItem& whole : work.items) {
            Poly behind;
            const unsigned s = bsp::divide(space_, whole.poly, q, behind); // those in q are neither: absorbed
            if (s == kBoth) {
                ++tree_.splits;
                parts.first.items.push_back(item(std::move(whole.poly), whole.kind));
                parts.second.items.push_back(item(std::move(behind), whole.kind));
            } else if (s != 0) {
                (s == kFront ? parts.first : parts.second).items.push_back(std::move(whole));
            }
        }
        for (Piece& piece : work.pieces) {
            const unsigned s = sides(space_, piece.body, q);
            if (s == kFront) {
                parts.first.pieces.push_back(std::move(piece));
            } else if (s == kBack) {
                parts.second.pieces.push_back(std::move(piece));
            } else {
                const std::optional<PlanePolygon> own = clip_behind(space_.planes, *cap, piece.body.faces);
                KILN_CHECK(own.has_value());
                Piece front{piece.brush, piece.contents, {}}, back = front;
                cut(space_, std::move(piece.body), q, *own, front.body, back.body);
                parts.first.pieces.push_back(std::move(front));
                parts.second.pieces.push_back(std::move(back));
            }
        }
        cut(space_, std::move(work.region), q, *cap, parts.first.region, parts.second.region);
        tree_.caps.push_back(std::move(*cap));
        return parts;
    }
};

} // namespace

Tree build_tree(const World& world, const Csg& csg, const Space& space, const std::array<PlaneId, 6>& box,
                Context& context) {
    return Builder(world, csg, space, box, context).run();
}

} // namespace kiln::bsp

#include "tests/proof/geometry/laws.h"
#include "compiler/csg/box_tree.h"
#include "compiler/csg/polytope.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numeric>
#include <ostream>
#include <random>

namespace kiln::proof {
namespace {

bool coplanar(PlaneId a, PlaneId b) { return (a.value | 1u) == (b.value | 1u); }
bool is_box(const Bsp& bsp, PlaneId p) { return std::ranges::find(bsp.box, p) != bsp.box.end(); }

Integral integral(const PlaneTable& planes, const std::vector<PlanePolygon>& faces) {
    Integral i;
    for (const PlanePolygon& f : faces) i.add(planes, f);
    return i;
}

bool has_contents(Contents c) { // of brushes that leaves list
    return strength(c).has_value() || c == Contents::clip;
}

// Points 2^10 times finer than the map's grid are hardly ever on a plane.
constexpr int kFiner = 10;
int side_of(const PlaneTable& planes, const GridPoint& fine, PlaneId plane) {
    const ExactPlane& p = planes.planes[plane.at()]; // 2^61 * 2^40 and 2^93 * 2^10 fit
    const __int128 at = static_cast<__int128>(p.a) * fine[0] + static_cast<__int128>(p.b) * fine[1] +
                        static_cast<__int128>(p.c) * fine[2] - p.d * (1 << kFiner);
    return at > 0 ? 1 : at < 0 ? -1 : 0;
}

// Strictly inside: -1; outside: +1; on the boundary: 0.
int where(const PlaneTable& planes, const std::vector<PlanePolygon>& polytope, const GridPoint& fine) {
    int result = -1;
    for (const PlanePolygon& f : polytope) {
        const int s = side_of(planes, fine, f.support);
        if (s > 0) return 1;
        if (s == 0) result = 0;
    }
    return result;
}

Box3 box_of_points(const std::vector<Vec3>& points) {
    Box3 box;
    for (const Vec3& p : points) box.add(p);
    return box;
}

Box3 around(const Box3& b, double margin) {
    const Vec3 m{margin, margin, margin};
    return {b.lo - m, b.hi + m};
}

std::vector<Box3> leaf_boxes(const Bsp& bsp, const std::vector<std::vector<PlanePolygon>>& polytopes) {
    std::vector<Box3> boxes(polytopes.size());
    for (std::size_t l = 0; l < polytopes.size(); ++l)
        for (const PlanePolygon& f : polytopes[l]) boxes[l].add(box_of_points(points(bsp.planes, f)));
    return boxes;
}

} // namespace

std::ostream& operator<<(std::ostream& out, const Findings& f) {
    out << f.count << " wrong of " << f.checked << " checked";
    for (const std::string& w : f.wrong) out << "\n  " << w;
    return out;
}

Findings closure(const World& world, const Csg& csg) {
    Findings out;
    std::vector<Integral> models(world.model_count);
    for (const Fragment& f : csg.fragments)
        if (f.behind == Contents::solid) models[f.model.at()].add(csg.planes, f.polygon);
    for (std::size_t m = 0; m < models.size(); ++m) {
        ++out.checked;
        if (models[m].twice_area != F3{}) out.add(fmt::format("the solids of model {} are not closed", m));
    }
    for (std::size_t b = 0; b < csg.brushes.size(); ++b) {
        ++out.checked;
        if (integral(csg.planes, csg.brushes[b].faces).twice_area != F3{}) out.add(fmt::format("brush {} is not closed", b));
    }
    return out;
}

Findings volumes(const Csg& csg, const Bsp& bsp) {
    Findings out;
    Integral hull, box, leaves, solid;
    for (const Fragment& f : csg.fragments)
        if (f.behind == Contents::solid && f.model.value == 0) hull.add(csg.planes, f.polygon);
    const auto polytopes = leaf_polytopes(bsp);
    for (std::size_t l = 0; l < polytopes.size(); ++l) {
        const Integral one = integral(bsp.planes, polytopes[l]);
        if (one.twice_area != F3{}) out.add(fmt::format("leaf {} is not closed", l));
        if (one.six_volume == F{}) out.add(fmt::format("leaf {} has no volume", l));
        leaves.six_volume += one.six_volume;
        if (!bsp.leaves[l].open()) solid.six_volume += one.six_volume;
        ++out.checked;
    }
    std::array<F, 3> size;
    for (std::size_t k = 0; k < 3; ++k) // planes +k, -k: d = hi and -lo in grid units
        size[k] = (F::of(bsp.planes.planes[bsp.box[2 * k].at()].d) + F::of(bsp.planes.planes[bsp.box[2 * k + 1].at()].d)) *
                  F(std::int64_t{1} << bsp.planes.grid_bits).inverse();
    if (leaves.six_volume != F(6) * size[0] * size[1] * size[2]) out.add("the leaves do not tile the world's box");
    if (solid.six_volume != hull.six_volume) out.add("the solid leaves are not the union of the structural brushes");
    return out;
}

Findings points_in_leaves(const World& world, const Csg& csg, const Bsp& bsp, std::size_t count, std::uint64_t seed) {
    Findings out;
    const auto polytopes = leaf_polytopes(bsp);
    const csg_detail::BoxTree leaves(leaf_boxes(bsp, polytopes));
    std::vector<Box3> brush_boxes(csg.brushes.size());
    for (std::size_t b = 0; b < csg.brushes.size(); ++b)
        if (csg.brushes[b].valid && world.brushes[b].model.value == 0) brush_boxes[b] = csg.brushes[b].bounds;
    const csg_detail::BoxTree brushes(brush_boxes);

    Box3 box;
    for (const BspLeaf& l : bsp.leaves) box.add(l.bounds);
    const int bits = bsp.planes.grid_bits + kFiner;
    std::mt19937_64 random(seed);
    const auto uniform = [&](double lo, double hi) { return lo + (hi - lo) * (static_cast<double>(random() >> 11) * 0x1p-53); };
    std::vector<std::uint32_t> near;
    for (std::size_t i = 0; i < count; ++i) {
        Vec3 x;
        Box3 from = box;
        if (i % 2 && !csg.brushes.empty()) { // about a brush, where things are
            const BrushPolytope& b = csg.brushes[random() % csg.brushes.size()];
            if (b.valid) from = around(b.bounds, 8);
        }
        GridPoint g;
        for (std::size_t k = 0; k < 3; ++k) {
            x[k] = std::clamp(uniform(from.lo[k], from.hi[k]), box.lo[k] + 1, box.hi[k] - 1);
            g[k] = std::llround(std::ldexp(x[k], bits));
            x[k] = std::ldexp(static_cast<double>(g[k]), -bits);
        }
        Box3 at;
        at.add(x);
        leaves.query(at, near);
        std::size_t holders = 0, holder = 0;
        bool on_boundary = false;
        for (const std::uint32_t l : near) {
            const int w = where(bsp.planes, polytopes[l], g);
            on_boundary = on_boundary || w == 0;
            if (w < 0) ++holders, holder = l;
        }
        const std::string place = fmt::format("({} {} {})", x.x, x.y, x.z);
        if (on_boundary) {
            if (holders) out.add(place + " is inside one leaf and on the boundary of another");
            continue;
        }
        ++out.checked;
        if (holders != 1) {
            out.add(fmt::format("{} lies in {} leaves", place, holders));
            continue;
        }
        std::int32_t walk = bsp.nodes.empty() ? -1 : 0;
        while (walk >= 0) {
            const BspNode& n = bsp.nodes[static_cast<std::size_t>(walk)];
            walk = n.child[side_of(bsp.planes, g, n.plane) > 0 ? 0 : 1];
        }
        if (static_cast<std::size_t>(-1 - walk) != holder) out.add(place + ": the tree leads to another leaf");
        const std::vector<LeafId> about = leaves_at(bsp, x, 1e-6);
        if (std::ranges::find(about, id<LeafId>(holder)) == about.end())
            out.add(place + ": leaves_at does not name the leaf");
        const BspLeaf& leaf = bsp.leaves[holder];
        Contents strongest = Contents::empty;
        bool portal = false;
        brushes.query(at, near);
        for (const std::uint32_t b : near) {
            const Contents c = world.brushes[b].contents;
            if (!has_contents(c) && c != Contents::area_portal) continue;
            const int w = where(csg.planes, csg.brushes[b].faces, g);
            on_boundary = on_boundary || w == 0; // of a brush within a leaf that detail does not divide
            if (w >= 0) continue;
            if (c == Contents::area_portal) {
                portal = true;
                continue;
            }
            if (!std::ranges::binary_search(leaf.brushes, id<BrushId>(b)))
                out.add(fmt::format("{}: leaf {} does not list brush {}", place, holder, b));
            if (c == Contents::detail || c == Contents::clip) continue;
            if (strongest == Contents::empty || *strength(c) < *strength(strongest)) strongest = c;
        }
        if (strongest == Contents::empty && portal) strongest = Contents::area_portal;
        if (leaf.contents != strongest && !on_boundary)
            out.add(fmt::format("{}: contents {} where the brushes say {}", place, static_cast<int>(leaf.contents),
                                static_cast<int>(strongest)));
    }
    return out;
}

Findings portals(const Csg& csg, const Bsp& bsp) {
    Findings out;
    const PlaneTable& planes = bsp.planes;
    const auto polytopes = leaf_polytopes(bsp);
    std::vector<std::map<std::uint32_t, F3>> left(polytopes.size()); // per leaf, per face's plane: area not yet made up
    for (std::size_t l = 0; l < polytopes.size(); ++l) {
        if (!bsp.leaves[l].open()) continue;
        for (const PlanePolygon& f : polytopes[l]) {
            if (is_box(bsp, f.support)) continue;
            Integral i;
            i.add(planes, f);
            left[l][f.support.value] = i.twice_area;
        }
    }
    const auto take = [&](std::size_t leaf, PlaneId facing_out, const PlanePolygon& polygon, const char* what) {
        const auto face = left[leaf].find(facing_out.value);
        if (face == left[leaf].end()) return out.add(fmt::format("a {} of leaf {} lies in none of its faces", what, leaf));
        Integral i;
        i.add(planes, polygon.support == facing_out ? polygon : flipped(polygon));
        face->second = face->second - i.twice_area;
    };
    for (const BspPortal& p : bsp.portals) {
        ++out.checked;
        take(p.leaf_front.at(), flipped(p.plane), p.polygon, "portal");
        take(p.leaf_back.at(), p.plane, p.polygon, "portal");
        for (const LeafId l : {p.leaf_front, p.leaf_back}) {
            bool within = true;
            for (const PlanePolygon& f : polytopes[l.at()])
                for (std::size_t i = 0; i < p.polygon.size(); ++i)
                    within = within && (coplanar(f.support, p.polygon.support) ||
                                        planes.side(p.polygon.support, p.polygon.edges[i == 0 ? p.polygon.size() - 1 : i - 1],
                                                    p.polygon.edges[i], f.support) <= 0);
            if (!within) out.add(fmt::format("a portal reaches beyond leaf {}", l.value));
        }
    }
    const csg_detail::BoxTree tree(leaf_boxes(bsp, polytopes));
    std::vector<std::uint32_t> near;
    for (const Fragment& f : csg.fragments) {
        if (f.behind != Contents::solid || f.model.value != 0) continue;
        tree.query(around(box_of_points(points(planes, f.polygon)), 1e-3), near);
        for (const std::uint32_t l : near) {
            const PlaneId facing_out = flipped(f.polygon.support);
            if (!bsp.leaves[l].open() || !left[l].contains(facing_out.value)) continue;
            PlanePolygon part = f.polygon;
            bool some = true;
            for (const PlanePolygon& g : polytopes[l])
                if (some && !coplanar(g.support, part.support)) some = clip_to_back(planes, part, g.support);
            if (some) take(l, facing_out, part, "wall");
        }
    }
    for (std::size_t l = 0; l < left.size(); ++l)
        for (const auto& [plane, area] : left[l]) {
            ++out.checked;
            if (area != F3{}) out.add(fmt::format("a face of leaf {} is not made up of portals and walls", l));
        }
    return out;
}

Findings inside_is_closed(const World&, const Csg& csg, const Bsp& bsp) {
    Findings out;
    // The boundary of the inside leaves as the leaves have it (portals between two of them cancel) …
    Integral shore;
    const auto polytopes = leaf_polytopes(bsp);
    std::vector<std::size_t> inside;
    std::vector<Box3> boxes = leaf_boxes(bsp, polytopes);
    Integral volume;
    for (std::size_t l = 0; l < polytopes.size(); ++l)
        if (bsp.leaves[l].cluster.valid()) {
            volume.six_volume += integral(bsp.planes, polytopes[l]).six_volume;
            inside.push_back(l), ++out.checked;
        } else {
            boxes[l] = {};
        }
    // … and by what closes it: walls that face it (covered by detail or not) and closed gaps, all facing in. Gaps are cut
    // away where detail stands in them, which then closes them itself: only without any can the sum be told.
    const csg_detail::BoxTree tree(boxes);
    std::vector<std::uint32_t> near;
    for (const Fragment& f : csg.fragments) {
        if (f.behind != Contents::solid || f.model.value != 0) continue;
        tree.query(around(box_of_points(points(bsp.planes, f.polygon)), 1e-3), near);
        for (const std::uint32_t l : near) {
            PlanePolygon part = f.polygon;
            bool some = false;
            for (const PlanePolygon& g : polytopes[l]) some = some || g.support == flipped(part.support);
            for (const PlanePolygon& g : polytopes[l])
                if (some && !coplanar(g.support, part.support)) some = clip_to_back(bsp.planes, part, g.support);
            if (some) shore.add(bsp.planes, part);
        }
    }
    for (const ClosedGap& g : bsp.closed) shore.add(bsp.planes, g.polygon);
    if (shore.twice_area != F3{}) out.add("what closes the inside does not sum to zero");
    if (shore.six_volume != -volume.six_volume) out.add("what closes the inside does not hold its volume");
    return out;
}

Findings brush_lists(const World& world, const Csg& csg, const Bsp& bsp) {
    Findings out;
    const auto polytopes = leaf_polytopes(bsp);
    std::vector<Box3> boxes(csg.brushes.size());
    for (std::size_t b = 0; b < boxes.size(); ++b)
        if (csg.brushes[b].valid && world.brushes[b].model.value == 0 && has_contents(world.brushes[b].contents))
            boxes[b] = csg.brushes[b].bounds;
    const csg_detail::BoxTree tree(boxes);
    const std::vector<Box3> leaves = leaf_boxes(bsp, polytopes);
    std::vector<std::uint32_t> near;
    for (std::size_t l = 0; l < polytopes.size(); ++l) {
        tree.query(leaves[l], near);
        std::vector<BrushId> expected;
        for (const std::uint32_t b : near) {
            std::vector<csg_detail::SidePlane> sides;
            const auto add = [&](PlaneId p) {
                if (std::ranges::find(sides, p, &csg_detail::SidePlane::plane) == sides.end()) sides.push_back({p, SideId{0}});
            };
            for (const PlanePolygon& f : polytopes[l]) add(f.support);
            for (const PlanePolygon& f : csg.brushes[b].faces) add(f.support);
            ++out.checked;
            if (csg_detail::build_polytope(bsp.planes, csg.world_cube, sides).flaw == csg_detail::Flaw::none)
                expected.push_back(id<BrushId>(b));
        }
        if (expected != bsp.leaves[l].brushes) out.add(fmt::format("leaf {} lists {} brushes, {} have volume in it", l,
                                                                   bsp.leaves[l].brushes.size(), expected.size()));
    }
    return out;
}

bool Motion::mirrors() const {
    int turn = sign[0] * sign[1] * sign[2];
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = i + 1; j < 3; ++j)
            if (axis[i] > axis[j]) turn = -turn;
    return turn < 0;
}

World moved(const World& world, const Motion& motion) {
    World result = world;
    // 12 digits after the point stay: the sum has no room for more.
    const auto add = [](Decimal d, std::int64_t whole) {
        for (; d.exponent > 0; --d.exponent) d.mantissa *= 10;
        for (; d.exponent < -12; ++d.exponent) d.mantissa = (d.mantissa + (d.mantissa < 0 ? -5 : 5)) / 10;
        std::int64_t unit = 1;
        for (int e = d.exponent; e < 0; ++e) unit *= 10;
        d.mantissa += whole * unit;
        return d;
    };
    for (WorldSide& s : result.sides) {
        for (auto& p : s.points) {
            const auto from = p;
            for (std::size_t k = 0; k < 3; ++k) {
                Decimal d = from[motion.axis[k]];
                if (motion.sign[k] < 0) d.mantissa = -d.mantissa;
                p[k] = motion.shift[k] ? add(d, motion.shift[k]) : d;
            }
        }
        if (motion.mirrors()) std::swap(s.points[1], s.points[2]);
        s.editor_vertices.clear();
    }
    for (WorldEntity& e : result.entities) {
        const Vec3 from = e.origin;
        for (std::size_t k = 0; k < 3; ++k)
            e.origin[k] = motion.sign[k] * from[motion.axis[k]] + static_cast<double>(motion.shift[k]);
    }
    return result;
}

World shuffled(const World& world, std::uint64_t seed) {
    World result = world;
    std::vector<std::size_t> order(world.brushes.size());
    std::iota(order.begin(), order.end(), 0);
    std::mt19937_64 random(seed);
    std::shuffle(order.begin(), order.end(), random);
    result.brushes.clear(), result.sides.clear();
    for (const std::size_t b : order) {
        WorldBrush brush = world.brushes[b];
        const std::uint32_t first = brush.first_side;
        brush.first_side = static_cast<std::uint32_t>(result.sides.size());
        for (std::uint32_t s = 0; s < brush.side_count; ++s) result.sides.push_back(world.sides[first + s]);
        result.brushes.push_back(brush);
    }
    return result;
}

namespace {

class FormBuilder {
public:
    FormBuilder(const PlaneTable& planes, const Motion& motion) : planes_(planes), motion_(motion) {}

    void add(const PlanePolygon& polygon, std::uint64_t key) {
        const ExactPlane support = move(planes_.planes[polygon.support.at()]);
        Corner corner;
        corner.key = key;
        // Divided by the first part of the normal that is not 0: the same for all integers that mean this plane, whatever
        // the grid. Its sign tells the two sides of the plane apart.
        const std::int64_t first = support.a ? support.a : support.b ? support.b : support.c;
        const F scale = F(first).inverse();
        corner.normal = {F(support.a) * scale, F(support.b) * scale, F(support.c) * scale};
        corner.d = F::of(support.d) * scale * F(std::int64_t{1} << planes_.grid_bits).inverse();
        corner.facing = first > 0 ? 1 : -1;
        std::vector<F3> p = points_in_field(planes_, polygon);
        for (F3& v : p) {
            const F3 from = v;
            for (std::size_t k = 0; k < 3; ++k) v[k] = from[motion_.axis[k]] * F(motion_.sign[k]) + F(motion_.shift[k]);
        }
        if (motion_.mirrors()) std::ranges::reverse(p);
        for (std::size_t i = 0; i < p.size(); ++i) {
            const F3 &a = p[i], &b = p[(i + 1) % p.size()];
            const F3 way = b - a, moment = cross(a, b);
            std::array<F, 6> line{way[0], way[1], way[2], moment[0], moment[1], moment[2]};
            const F one = std::ranges::find_if(line, [](F x) { return x != F{}; })->inverse();
            for (F& x : line) x = x * one;
            corner.line = line;
            corner.point = a, corner.jumps = -1;
            form_.push_back(corner);
            corner.point = b, corner.jumps = 1;
            form_.push_back(corner);
        }
    }
    Form take() {
        const auto place = [](const Corner& c) { return std::tie(c.key, c.normal, c.d, c.facing, c.line, c.point); };
        std::ranges::sort(form_, {}, place);
        Form out;
        for (const Corner& c : form_) {
            if (!out.empty() && place(out.back()) == place(c)) out.back().jumps += c.jumps;
            else {
                if (!out.empty() && out.back().jumps == 0) out.pop_back();
                out.push_back(c);
            }
        }
        if (!out.empty() && out.back().jumps == 0) out.pop_back();
        return out;
    }

private:
    const PlaneTable& planes_;
    const Motion& motion_;
    Form form_;

    ExactPlane move(const ExactPlane& p) const {
        const std::array<std::int64_t, 3> from{p.a, p.b, p.c};
        ExactPlane q;
        std::array<std::int64_t, 3> n{};
        q.d = p.d;
        for (std::size_t k = 0; k < 3; ++k) {
            n[k] = motion_.sign[k] * from[motion_.axis[k]];
            q.d += static_cast<__int128>(n[k]) * motion_.shift[k] * (std::int64_t{1} << planes_.grid_bits);
        }
        q.a = n[0], q.b = n[1], q.c = n[2];
        return q;
    }
};

} // namespace

Form form_of(const Csg& csg, const Motion& motion, const std::function<std::optional<std::uint64_t>(const Fragment&)>& key) {
    FormBuilder builder(csg.planes, motion);
    for (const Fragment& f : csg.fragments)
        if (const auto k = key(f)) builder.add(f.polygon, *k);
    return builder.take();
}

Form form_of(const Csg& csg, const Bsp& bsp, const Motion& motion,
             const std::function<std::optional<std::uint64_t>(const Fragment&)>& key) {
    FormBuilder builder(bsp.planes, motion);
    for (const VisibleFragment& v : bsp.visible)
        if (const auto k = key(csg.fragments[v.fragment])) builder.add(v.polygon, *k);
    return builder.take();
}

std::map<int, F> inside_volumes(const Bsp& bsp) {
    std::map<int, F> volumes;
    const auto polytopes = leaf_polytopes(bsp);
    for (std::size_t l = 0; l < polytopes.size(); ++l)
        if (bsp.leaves[l].cluster.valid())
            volumes[static_cast<int>(bsp.leaves[l].contents)] += integral(bsp.planes, polytopes[l]).six_volume;
    return volumes;
}

} // namespace kiln::proof

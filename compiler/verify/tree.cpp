// The tree against brute force: leaves as exact polytopes, random points, portals, what is outside, what is visible.
#include "compiler/verify/oracle.h"
#include "compiler/verify/verify.h"
#include "libs/core/check.h"
#include <fmt/format.h>
#include <map>

namespace kiln {
namespace {

using namespace verify;

constexpr double kClear = 1e-3;    // map units: nearer to a face than this, a point has no one answer
constexpr double kTouching = 1e-6; // and this near it touches

bool is_liquid(Contents c) { return c == Contents::water || c == Contents::slime || c == Contents::lava; }

class Tree {
public:
    Tree(const World& world, const Csg& csg, const Bsp& bsp, bool filled, const VerifyOptions& options, Checker& checker)
        : world_(world), csg_(csg), bsp_(bsp), filled_(filled), options_(options), checker_(checker), brushes_(world, csg), map_{world.file} {}

    void check() {
        Check& made = checker_.add("leaf-polytopes");
        try {
            polytopes_ = leaf_polytopes(bsp_);
        } catch (const InternalError& e) { // a node's plane that does not cross its region
            made.expect(false, [&] { return Finding{map_, e.what()}; });
            return;
        }
        half_spaces(made);
        if (!made.ok()) return;
        sample_points();
        check_portals();
        check_borders();
        check_areas();
        check_visible();
    }

private:
    struct HalfSpace {
        PlaneId plane;
        Vec3 normal;
        double distance;
    };
    const World& world_;
    const Csg& csg_;
    const Bsp& bsp_;
    bool filled_;
    const VerifyOptions& options_;
    Checker& checker_;
    Brushes brushes_;
    SourceLocation map_;
    std::vector<std::vector<PlanePolygon>> polytopes_;
    std::vector<std::vector<HalfSpace>> leaf_faces_;

    void half_spaces(Check& made) {
        leaf_faces_.resize(bsp_.leaves.size());
        for (std::size_t l = 0; l < polytopes_.size(); ++l) {
            made.expect(polytopes_[l].size() >= 4, [&] { return Finding{map_, fmt::format("leaf {} is not closed", l)}; });
            Box3 bounds;
            for (const PlanePolygon& f : polytopes_[l]) {
                leaf_faces_[l].push_back({f.support, bsp_.planes.normal(f.support), bsp_.planes.distance(f.support)});
                for (const Vec3& p : points(bsp_.planes, f)) bounds.add(p);
            }
            made.expect(bounds == bsp_.leaves[l].bounds, [&] { return Finding{map_, fmt::format("leaf {}: its bounds are not those of the space its nodes leave it", l)}; });
        }
    }
    double depth(std::size_t leaf, Vec3 p) const {
        double d = -1e30;
        for (const HalfSpace& f : leaf_faces_[leaf]) d = std::max(d, dot(f.normal, p) - f.distance);
        return d;
    }
    bool has_cluster(LeafId l) const { return bsp_.leaves[l.at()].cluster.valid(); }
    std::string leaf_at_text(LeafId l) const { return fmt::format("leaf {} at {}", l.value, at(bsp_.leaves[l.at()].bounds.center())); }

    // A point is in one leaf; the leaf has the contents of the strongest brush there, and lists all brushes there.
    void sample_points() {
        Check &one = checker_.add("points-in-one-leaf"), &contents = checker_.add("points-contents"), &listed = checker_.add("points-brushes");
        std::vector<Box3> boxes;
        Box3 all;
        for (const BspLeaf& l : bsp_.leaves) boxes.push_back(l.bounds), all.add(l.bounds);
        const BoxGrid leaves(std::move(boxes));
        std::vector<std::uint32_t> corners; // of brushes of the world
        for (std::uint32_t b = 0; b < csg_.brushes.size(); ++b)
            if (csg_.brushes[b].valid && world_.brushes[b].model.value == 0) corners.push_back(b);
        RandomPoints random(options_.seed);
        constexpr double kAround = 8; // map units: half of the points lie so near to a corner of a brush
        for (std::size_t i = 0; i < options_.points; ++i) {
            Vec3 p = random.in(all);
            if (i % 2 && !corners.empty()) {
                const auto& faces = csg_.brushes[corners[random.below(corners.size())]].faces;
                const std::vector<Vec3> face = points(csg_.planes, faces[random.below(faces.size())]);
                const Vec3 c = face[random.below(face.size())], r{kAround, kAround, kAround};
                p = random.in({c - r, c + r});
            }
            bool inside = true;
            for (std::size_t k = 0; k < 3; ++k) inside = inside && p[k] > all.lo[k] && p[k] < all.hi[k];
            if (!inside) continue;
            const LeafId found = leaf_at(bsp_, p);
            std::size_t holders = 0;
            bool near = false;
            leaves.at(p, 0, [&](std::uint32_t l) {
                const double d = depth(l, p);
                near = near || std::abs(d) < kTouching;
                holders += d < 0;
            });
            if (!near)
                one.expect(holders == 1 && depth(found.at(), p) < 0, [&] { return Finding{map_, fmt::format("the point {} lies in {} leaves; the tree says leaf {}", at(p), holders, found.value)}; });

            Contents strongest = Contents::empty;
            bool portal = false, doubtful = false;
            std::vector<std::uint32_t> around;
            brushes_.near(p, [&](std::uint32_t b) {
                const WorldBrush& w = world_.brushes[b];
                if (w.model.value != 0) return;
                const double d = brushes_.depth(b, p);
                doubtful = doubtful || std::abs(d) < kClear;
                if (d >= 0) return;
                if (strength(w.contents) || w.contents == Contents::clip) around.push_back(b);
                portal = portal || w.contents == Contents::area_portal;
                if (!strength(w.contents) || w.contents == Contents::detail) return; // detail does not show in leaves
                if (strongest == Contents::empty || *strength(w.contents) < *strength(strongest)) strongest = w.contents;
            });
            if (doubtful) continue;
            if (strongest == Contents::empty && portal) strongest = Contents::area_portal;
            const BspLeaf& leaf = bsp_.leaves[found.at()];
            contents.expect(leaf.contents == strongest, [&] {
                return Finding{around.empty() ? map_ : world_.location(id<BrushId>(around[0])),
                               fmt::format("at {} the brushes say contents {}, leaf {} says {}", at(p), static_cast<int>(strongest), found.value, static_cast<int>(leaf.contents))};
            });
            for (const std::uint32_t b : around)
                listed.expect(std::ranges::binary_search(leaf.brushes, id<BrushId>(b)),
                              [&] { return Finding{world_.location(id<BrushId>(b)), fmt::format("the brush holds {}, but leaf {} there does not list it", at(p), found.value)}; });
        }
    }

    void check_portals() {
        Check &shape = checker_.add("portal-shape"), &between = checker_.add("portal-between-leaves");
        for (std::size_t i = 0; i < bsp_.portals.size(); ++i) {
            const BspPortal& p = bsp_.portals[i];
            const auto tell = [&](std::string what) { return [&, what] { return Finding{map_, fmt::format("portal {} at {}: {}", i, at(p.winding[0]), what)}; }; };
            const auto corner = [&](std::size_t k) { return p.polygon.edges[k == 0 ? p.polygon.size() - 1 : k - 1]; };
            bool convex = true;
            for (std::size_t k = 0; k < p.polygon.size(); ++k) convex = convex && bsp_.planes.orientation(p.polygon.support, corner(k), p.polygon.edges[k]) > 0;
            shape.expect(convex, tell("it is not convex"));
            shape.expect(points(bsp_.planes, p.polygon) == p.winding, tell("its winding is not that of its polygon"));
            for (const auto& [leaf, out] : {std::pair{p.leaf_front, flipped(p.plane)}, std::pair{p.leaf_back, p.plane}}) {
                bool face = false, within = true;
                for (const HalfSpace& f : leaf_faces_[leaf.at()]) {
                    face = face || f.plane == out;
                    for (std::size_t k = 0; k < p.polygon.size() && within; ++k)
                        within = bsp_.planes.side(p.polygon.support, corner(k), p.polygon.edges[k], f.plane) <= 0;
                }
                between.expect(face, tell("its plane does not bound " + leaf_at_text(leaf)));
                between.expect(within, tell("it reaches out of " + leaf_at_text(leaf)));
            }
        }
    }

    // What lies beyond a point of a leaf's face: another open leaf through a portal, solid, or an opening that was closed.
    void check_borders() {
        Check &complete = checker_.add("portals-complete"), &sealed = checker_.add("inside-closed");
        std::map<std::pair<LeafId, LeafId>, std::vector<std::size_t>> between;
        for (std::size_t i = 0; i < bsp_.portals.size(); ++i) between[std::minmax(bsp_.portals[i].leaf_front, bsp_.portals[i].leaf_back)].push_back(i);
        std::map<LeafId, std::vector<const ClosedGap*>> gaps;
        for (const ClosedGap& g : bsp_.closed) gaps[g.leaf].push_back(&g);
        RandomPoints random(options_.seed + 1);
        for (std::size_t l = 0; l < bsp_.leaves.size(); ++l) {
            if (!bsp_.leaves[l].cluster.valid()) continue;
            for (const PlanePolygon& face : polytopes_[l]) {
                const Vec3 p = random.in(points(bsp_.planes, face));
                const std::vector<LeafId> touching = leaves_at(bsp_, p, kTouching);
                const bool edge_of_space = std::ranges::find(bsp_.box, face.support) != bsp_.box.end();
                // At an edge, or in a leaf as thin as rounding, more than two leaves meet: no one answer.
                if (touching.size() != (edge_of_space ? 1u : 2u) || std::ranges::find(touching, id<LeafId>(l)) == touching.end()) continue;
                const LeafId other = edge_of_space ? LeafId{} : touching[touching[0] == id<LeafId>(l) ? 1 : 0];
                if (other.valid() && has_cluster(other)) {
                    bool found = false;
                    if (const auto it = between.find(std::minmax(id<LeafId>(l), other)); it != between.end())
                        for (const std::size_t i : it->second) found = found || holds(bsp_.portals[i].polygon, p);
                    complete.expect(found, [&] { return Finding{map_, fmt::format("leaves {} and {} meet at {}, but no portal is there", l, other.value, at(p))}; });
                } else if (filled_ && (!other.valid() || bsp_.leaves[other.at()].outside)) {
                    bool closed = false;
                    for (const ClosedGap* g : gaps[id<LeafId>(l)]) closed = closed || (std::abs(distance(g->polygon.support, p)) < kTouching && holds(g->polygon, p));
                    brushes_.near(p, [&](std::uint32_t b) { // detail may close it
                        closed = closed || (world_.brushes[b].model.value == 0 && world_.brushes[b].contents == Contents::detail && brushes_.depth(b, p) < kTouching);
                    });
                    sealed.expect(closed, [&] { return Finding{map_, fmt::format("leaf {} is inside, yet open to the outside at {}", l, at(p))}; });
                }
            }
        }
    }
    double distance(PlaneId plane, Vec3 p) const { return dot(bsp_.planes.normal(plane), p) - bsp_.planes.distance(plane); }
    bool holds(const PlanePolygon& polygon, Vec3 p) const { // of a point in its plane
        return std::ranges::all_of(polygon.edges, [&](PlaneId e) { return distance(e, p) < kTouching; });
    }

    double thickness(LeafId leaf) const { // least extent, as the faces look
        double least = HUGE_VAL;
        for (const HalfSpace& h : leaf_faces_[leaf.at()]) {
            double reach = 0;
            for (const PlanePolygon& f : polytopes_[leaf.at()])
                for (const Vec3& p : points(bsp_.planes, f)) reach = std::max(reach, h.distance - dot(h.normal, p));
            least = std::min(least, reach);
        }
        return least;
    }
    static double width(std::span<const Vec3> winding) { // least extent, as the edges look
        double least = HUGE_VAL;
        for (std::size_t i = 0; i < winding.size(); ++i) {
            const Vec3 along = winding[(i + 1) % winding.size()] - winding[i];
            if (!(length(along) > 0)) continue;
            double reach = 0;
            for (const Vec3& p : winding) reach = std::max(reach, length(cross(p - winding[i], along)) / length(along));
            least = std::min(least, reach);
        }
        return least;
    }

    void check_areas() {
        Check& areas = checker_.add("areas");
        const double small = options_.micro_gap + kTouching;
        for (const BspPortal& p : bsp_.portals) {
            const std::uint32_t a = bsp_.leaves[p.leaf_front.at()].area, b = bsp_.leaves[p.leaf_back.at()].area;
            if (a && b) areas.expect(a == b || width(p.winding) < small || thickness(p.leaf_front) < small || thickness(p.leaf_back) < small, [&] { return Finding{map_, fmt::format("a portal joins areas {} and {} at {}", a, b, at(p.winding[0]))}; });
        }
        for (std::size_t l = 0; l < bsp_.leaves.size(); ++l) {
            const BspLeaf& leaf = bsp_.leaves[l];
            if (!leaf.cluster.valid() || leaf.area) continue;
            // Only an area portal's leaf has none; a liquid or window in it has the say over its contents.
            bool portal = leaf.contents == Contents::area_portal;
            if (is_liquid(leaf.contents) || leaf.contents == Contents::window || leaf.contents == Contents::grate)
                for (std::size_t b = 0; b < csg_.brushes.size() && !portal; ++b)
                    portal = world_.brushes[b].contents == Contents::area_portal && csg_.brushes[b].valid && overlap(csg_.brushes[b].bounds, leaf.bounds);
            areas.expect(portal, [&] { return Finding{map_, fmt::format("{} has no area", leaf_at_text(id<LeafId>(l)))}; });
        }
    }

    // Each visible part lies in its fragment and in its leaf; a point of a fragment is in a part exactly if an open
    // leaf inside is in front of it.
    void check_visible() {
        Check &within = checker_.add("visible-in-leaf"), &complete = checker_.add("visible-complete");
        std::vector<std::vector<std::size_t>> parts(csg_.fragments.size());
        for (std::size_t i = 0; i < bsp_.visible.size(); ++i) {
            const VisibleFragment& v = bsp_.visible[i];
            parts[v.fragment].push_back(i);
            const Fragment& f = csg_.fragments[v.fragment];
            const auto tell = [&](const char* what) { return [&, what] { return Finding{world_.location(f.side), what}; }; };
            bool in_fragment = true, in_leaf = true;
            for (std::size_t k = 0; k < v.polygon.size(); ++k) {
                const PlaneId before = v.polygon.edges[k == 0 ? v.polygon.size() - 1 : k - 1];
                for (const PlaneId e : f.polygon.edges) in_fragment = in_fragment && bsp_.planes.side(v.polygon.support, before, v.polygon.edges[k], e) <= 0;
                if (v.leaf.valid())
                    for (const HalfSpace& h : leaf_faces_[v.leaf.at()]) in_leaf = in_leaf && bsp_.planes.side(v.polygon.support, before, v.polygon.edges[k], h.plane) <= 0;
            }
            within.expect(in_fragment, tell("a visible part reaches out of its fragment"));
            within.expect(in_leaf, tell("a visible part reaches out of the leaf in front of it"));
        }
        RandomPoints random(options_.seed + 2);
        for (std::size_t i = 0; i < csg_.fragments.size(); ++i) {
            const Fragment& f = csg_.fragments[i];
            if (f.covered || !strength(f.behind)) continue;
            const Vec3 p = random.in(points(csg_.planes, f.polygon));
            bool expected = true;
            if (f.model.value == 0) {
                std::vector<LeafId> in_front = leaves_at(bsp_, p, kTouching);
                if (in_front.size() > 1) // those that lie in front of the plane and have it as a face
                    std::erase_if(in_front, [&](LeafId l) {
                        return std::ranges::find(leaf_faces_[l.at()], flipped(f.polygon.support), &HalfSpace::plane) == leaf_faces_[l.at()].end();
                    });
                if (in_front.size() != 1) continue; // an edge: no one answer
                expected = has_cluster(in_front[0]);
            }
            const bool found = std::ranges::any_of(parts[i], [&](std::size_t v) { return holds(bsp_.visible[v].polygon, p); });
            complete.expect(found == expected, [&] {
                return Finding{world_.location(f.side), fmt::format("at {} the side {}, but {} a visible part there", at(p), expected ? "can be seen" : "cannot be seen", found ? "has" : "has not")};
            });
        }
    }
};

} // namespace

void verify_bsp(const World& world, const Csg& csg, const Bsp& bsp, bool filled, const VerifyOptions& options, Checker& checker) {
    const std::uint64_t before = checker.failures();
    check_invariants(bsp, csg, &world, checker);
    if (checker.failures() != before) return;
    Tree(world, csg, bsp, filled, options, checker).check();
}

void verify_visibility(const World& world, const Bsp& bsp, const Visibility& v, const VerifyOptions& options, Checker& checker) {
    const std::uint64_t before = checker.failures();
    Check &near = checker.add("vis-neighbours"), &rays = checker.add("vis-clear-segments");
    if (!near.expect(v.cluster_count == bsp.cluster_count, [&] { return Finding{{world.file}, "the table is not for these clusters"}; })) return;
    check_invariants(v, checker);
    if (checker.failures() != before) return;
    const auto cluster = [&](LeafId l) { return bsp.leaves[l.at()].cluster.value; };
    for (const BspPortal& p : bsp.portals)
        near.expect(v.sees(cluster(p.leaf_front), cluster(p.leaf_back)),
                    [&] { return Finding{{world.file}, fmt::format("the portal at {} joins clusters {} and {}, which do not see each other", at(p.winding[0]), cluster(p.leaf_front), cluster(p.leaf_back))}; });

    std::vector<LeafId> open;
    for (std::size_t l = 0; l < bsp.leaves.size(); ++l)
        if (bsp.leaves[l].cluster.valid()) open.push_back(id<LeafId>(l));
    if (open.empty()) return;
    // Does the segment pass open leaves inside alone?
    const auto clear = [&](Vec3 a, Vec3 b) {
        struct Part {
            std::int32_t node;
            Vec3 from, to;
        };
        std::vector<Part> stack{{bsp.nodes.empty() ? -1 : 0, a, b}};
        while (!stack.empty()) {
            const Part p = stack.back();
            stack.pop_back();
            if (p.node < 0) {
                if (!bsp.leaves[static_cast<std::size_t>(-(p.node + 1))].cluster.valid()) return false;
                continue;
            }
            const BspNode& n = bsp.nodes[static_cast<std::size_t>(p.node)];
            const double d0 = dot(n.normal, p.from) - n.distance, d1 = dot(n.normal, p.to) - n.distance;
            if (std::min(d0, d1) >= 0) stack.push_back({n.child[0], p.from, p.to});
            else if (std::max(d0, d1) <= 0) stack.push_back({n.child[1], p.from, p.to});
            else {
                const Vec3 x = p.from + (p.to - p.from) * (d0 / (d0 - d1));
                stack.push_back({n.child[d0 < 0 ? 1 : 0], p.from, x});
                stack.push_back({n.child[d0 < 0 ? 0 : 1], x, p.to});
            }
        }
        return true;
    };
    RandomPoints random(options.seed + 3);
    for (std::size_t i = 0; i < options.points; ++i) {
        const Vec3 a = random.in(bsp.leaves[open[random.below(open.size())].at()].bounds), b = random.in(bsp.leaves[open[random.below(open.size())].at()].bounds);
        const LeafId from = leaf_at(bsp, a), to = leaf_at(bsp, b);
        if (!bsp.leaves[from.at()].cluster.valid() || !bsp.leaves[to.at()].cluster.valid() || !clear(a, b)) continue;
        rays.expect(v.sees(cluster(from), cluster(to)), [&] { return Finding{{world.file}, fmt::format("nothing stands between {} and {}, but cluster {} does not see {}", at(a), at(b), cluster(from), cluster(to))}; });
    }
}

} // namespace kiln

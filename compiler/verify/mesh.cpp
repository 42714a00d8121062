// The render mesh: closed hulls, no T-junctions, nothing lost between fragments and faces, luxels on their faces.
#include "compiler/verify/oracle.h"
#include "compiler/verify/verify.h"
#include <fmt/format.h>
#include <map>
#include <tuple>
#include <unordered_map>

namespace kiln {
namespace {

using namespace verify;


class Mesh {
public:
    Mesh(const World& world, const Csg& csg, const Bsp& bsp, const Surfaces& surfaces, const VerifyOptions& options, Checker& checker)
        : world_(world), csg_(csg), bsp_(bsp), s(surfaces), options_(options), checker_(checker) {}

    void check() {
        sources();
        hull_edges();
        tjunctions();
        areas();
        luxels_on_faces();
        curves_seen();
    }

private:
    const World& world_;
    const Csg& csg_;
    const Bsp& bsp_;
    const Surfaces& s;
    const VerifyOptions& options_;
    Checker& checker_;

    SourceLocation side_of(std::size_t face) const { return location_of(world_, s, id<FaceId>(face)); }
    // Brushes, displacements and patches of a model have corners of their own.
    std::uint32_t group(std::size_t triangle) const {
        const Face& f = s.faces[s.triangle_face[triangle].at()];
        return 3 * f.model.value + (f.curved() ? 1u + s.curves[f.curve].kind : 0u);
    }

    void sources() {
        Check &sources = checker_.add("face-sources"), &welded = checker_.add("positions-welded");
        for (std::size_t f = 0; f < s.faces.size(); ++f) {
            const Face& face = s.faces[f];
            const auto tell = [&](const char* what) { return [&, what] { return Finding{side_of(f), fmt::format("face {}: {}", f, what)}; }; };
            const bool of_patch = face.curved() && s.curves[face.curve].kind == Curve::patch;
            if (!sources.expect((of_patch || face.side.at() < world_.sides.size()) && face.material.at() < world_.materials.size(), tell("its side or material does not exist"))) continue;
            sources.expect(of_patch || face.material == world_.sides[face.side.at()].material || !face.drawn, tell("its material is not that of its side"));
            if (!face.curved()) sources.expect(face.plane.at() < bsp_.planes.planes.size() && bsp_.planes.normal(face.plane) == face.normal && bsp_.planes.distance(face.plane) == face.distance,
                           tell("its normal and distance are not those of its plane"));
            sources.expect(face.clusters.empty() || face.clusters.back().value < bsp_.cluster_count, tell("it borders a cluster that does not exist"));
            // Only what came from the tree has a place in it: brush models and light blockers have none.
            if (face.model.value == 0 && face.drawn && !face.curved()) sources.expect(!face.clusters.empty(), tell("it is drawn, but borders no cluster"));
        }
        // Faces of one group share vertices: equal positions are one.
        std::vector<std::uint32_t> model(s.positions.size(), UINT32_MAX);
        for (std::size_t t = 0; t < s.triangles.size(); ++t)
            for (const std::uint32_t p : s.triangles[t]) model[p] = group(t);
        std::map<std::tuple<std::uint32_t, double, double, double>, std::uint32_t> seen;
        for (std::uint32_t p = 0; p < s.positions.size(); ++p) {
            if (model[p] == UINT32_MAX) continue;
            const auto [it, fresh] = seen.emplace(std::tuple(model[p], s.positions[p].x, s.positions[p].y, s.positions[p].z), p);
            welded.expect(fresh, [&] { return Finding{{world_.file}, fmt::format("positions {} and {} are both {}", it->second, p, at(s.positions[p]))}; });
        }
    }

    // Each directed edge of the hull of a model is answered by one the other way.
    void hull_edges() {
        Check& closed = checker_.add("hull-edges");
        struct Edge {
            std::uint32_t model, low, high;
            bool operator==(const Edge&) const = default;
        };
        struct HashEdge {
            std::size_t operator()(const Edge& e) const { return ((e.low * 0x9E3779B97F4A7C15ull) ^ e.high) * 0xC2B2AE3D27D4EB4Full + e.model; }
        };
        struct Use {
            int balance = 0;
            std::uint32_t face = 0;
        };
        std::unordered_map<Edge, Use, HashEdge> uses;
        std::vector<Edge> order;
        for (std::size_t t = 0; t < s.triangles.size(); ++t) {
            const std::uint32_t f = s.triangle_face[t].value;
            if (!s.faces[f].hull) continue;
            for (std::size_t c = 0; c < 3; ++c) {
                const std::uint32_t a = s.triangles[t][c], b = s.triangles[t][(c + 1) % 3];
                const auto [it, fresh] = uses.try_emplace({s.faces[f].model.value, std::min(a, b), std::max(a, b)}, Use{0, f});
                if (fresh) order.push_back(it->first);
                it->second.balance += a < b ? 1 : -1;
            }
        }
        for (const Edge& e : order) {
            const Use& u = uses[e];
            closed.expect(u.balance == 0, [&] {
                return Finding{side_of(u.face), fmt::format("the hull of model {} is open at the edge from {} to {}", e.model, at(s.positions[e.low]), at(s.positions[e.high]))};
            });
        }
    }

    // No corner of a model lies within an edge of its faces; where it lies within an edge between two triangles of a face
    // or of one curve, it touches the inside, which is no crack. Positions are correctly rounded, so a corner that lies
    // in an edge is within a few units of the last place of it; nothing else comes so near.
    void tjunctions() {
        Check& junctions = checker_.add("t-junctions");
        constexpr double kCell = 64; // map units
        using Cell = std::tuple<std::uint32_t, std::int64_t, std::int64_t, std::int64_t>;
        std::map<Cell, std::vector<std::uint32_t>> cells;
        std::vector<std::uint8_t> listed(s.positions.size());
        const auto cell = [](double x) { return static_cast<std::int64_t>(std::floor(x / kCell)); };
        for (std::size_t t = 0; t < s.triangles.size(); ++t)
            for (const std::uint32_t p : s.triangles[t])
                if (!std::exchange(listed[p], std::uint8_t{1})) cells[{group(t), cell(s.positions[p].x), cell(s.positions[p].y), cell(s.positions[p].z)}].push_back(p);
        const auto key = [](std::uint32_t a, std::uint32_t b) { return std::uint64_t{std::min(a, b)} << 32 | std::max(a, b); };
        std::unordered_map<std::uint64_t, char> done, inner; // inner: triangles at an edge of the face or curve at hand
        std::size_t end = 0; // of the triangles of the face or curve at hand
        for (std::size_t t = 0; t < s.triangles.size(); ++t)
            for (std::size_t c = 0; c < 3; ++c) {
                if (t >= end) {
                    const Face* last_face = &s.faces[s.triangle_face[t].at()];
                    if (last_face->curved()) last_face = &s.faces[s.curves[last_face->curve].first_face + s.curves[last_face->curve].face_count - 1];
                    end = std::size_t{last_face->first_triangle} + last_face->triangle_count;
                    inner.clear();
                    for (std::size_t u = t; u < end; ++u)
                        for (std::size_t k = 0; k < 3; ++k) ++inner[key(s.triangles[u][k], s.triangles[u][(k + 1) % 3])];
                }
                const std::uint32_t ia = s.triangles[t][c], ib = s.triangles[t][(c + 1) % 3];
                if (inner[key(ia, ib)] > 1 || !done.emplace(key(ia, ib), 0).second) continue;
                const Vec3 a = s.positions[ia], b = s.positions[ib], d = b - a;
                const double size = length(d);
                std::optional<std::uint32_t> within;
                // Cells along the edge, in steps of half a cell, each with its neighbours.
                const int steps = static_cast<int>(size / (kCell / 2)) + 1;
                Cell last{UINT32_MAX, 0, 0, 0};
                for (int k = 0; k <= steps && !within; ++k) {
                    const Vec3 p = a + d * (static_cast<double>(k) / steps);
                    const Cell here{group(t), cell(p.x), cell(p.y), cell(p.z)};
                    if (here == last) continue;
                    last = here;
                    for (std::int64_t dz = -1; dz <= 1; ++dz)
                        for (std::int64_t dy = -1; dy <= 1; ++dy)
                            for (std::int64_t dx = -1; dx <= 1; ++dx) {
                                const auto it = cells.find({std::get<0>(here), std::get<1>(here) + dx, std::get<2>(here) + dy, std::get<3>(here) + dz});
                                if (it == cells.end()) continue;
                                for (const std::uint32_t v : it->second) {
                                    if (v == ia || v == ib) continue;
                                    const Vec3 x = s.positions[v] - a;
                                    const double along = dot(x, d);
                                    if (along <= 0 || along >= size * size) continue;
                                    double reach = 0;
                                    for (std::size_t i = 0; i < 3; ++i) reach = std::max({reach, std::abs(a[i]), std::abs(b[i])});
                                    if (length(cross(d, x)) <= 4 * 0x1p-53 * reach * size) within = v;
                                }
                            }
                }
                junctions.expect(!within, [&] { return Finding{side_of(s.triangle_face[t].at()), fmt::format("the corner {} lies within the edge from {} to {}", at(s.positions[*within]), at(a), at(b))}; });
            }
    }

    // What of a side can be seen is what its hull faces cover.
    void areas() {
        Check& areas = checker_.add("face-areas");
        std::map<SideId, std::pair<double, double>> of_side; // visible, faces
        const auto add = [&](SideId side, const PlanePolygon& polygon) { of_side[side].first += area(points(bsp_.planes, polygon)); };
        for (const VisibleFragment& v : bsp_.visible) {
            const Fragment& f = csg_.fragments[v.fragment];
            if (!f.covered && opaque(f.behind) && !opaque(f.front)) add(f.side, v.polygon);
        }
        for (const ClosedGap& g : bsp_.closed) add(g.side, g.polygon);
        for (const Face& f : s.faces)
            if (f.hull) of_side[f.side].second += f.area;
        for (const auto& [side, sums] : of_side)
            areas.expect(std::abs(sums.first - sums.second) <= 1e-6 * (1 + sums.first), [&] {
                return Finding{world_.location(side), fmt::format("{:.9g} square units of the side can be seen, its faces have {:.9g}", sums.first, sums.second)};
            });
    }

    // Where open space inside lies right before a curve, with no detail brush in it, its face is drawn.
    void curves_seen() {
        Check& seen = checker_.add("curves-seen");
        constexpr double kBefore = 0.99 / 128; // map units: what is within 1/128 of a plane counts as in it, what is deeper as buried
        std::vector<std::uint32_t> covers;   // brushes that hide what stands in them but fill no leaf
        for (std::uint32_t b = 0; b < csg_.brushes.size(); ++b)
            if (csg_.brushes[b].valid && world_.brushes[b].model.value == 0 && world_.brushes[b].contents == Contents::detail) covers.push_back(b);
        const auto is_open = [&](Vec3 p) {
            const BspLeaf& leaf = bsp_.leaves[leaf_at(bsp_, p).at()];
            if (!leaf.cluster.valid()) return false;
            return std::ranges::none_of(leaf.brushes, [&](BrushId b) {
                if (!std::ranges::binary_search(covers, b.value)) return false;
                return std::ranges::all_of(csg_.brushes[b.at()].faces, [&](const PlanePolygon& f) { return dot(csg_.planes.normal(f.support), p) <= csg_.planes.distance(f.support); });
            });
        };
        for (std::size_t f = s.first_curved_face; f < s.faces.size(); ++f) {
            const Face& face = s.faces[f];
            if (face.model.value != 0 || (world_.materials[face.material.at()].flags & undrawn_flags(s.curves[face.curve].kind))) continue;
            for (std::uint32_t t = face.first_triangle; t < face.first_triangle + face.triangle_count; ++t) {
                const Vec3 a = s.positions[s.triangles[t][0]], b = s.positions[s.triangles[t][1]], c = s.positions[s.triangles[t][2]];
                const Vec3 middle = (a + b + c) / 3.0;
                bool all = length(cross(b - a, c - a)) > 1; // square map units: the corners of less are hardly apart
                for (const Vec3 corner : {middle, a, b, c}) all = all && is_open(middle + (corner - middle) * 0.999 + face.normal * kBefore);
                if (all) seen.expect(face.drawn || face.sky, [&] { return Finding{side_of(f), fmt::format("face {} is not drawn, though open space lies before it at {}", f, at(middle))}; });
            }
        }
    }

    void luxels_on_faces() {
        Check& on = checker_.add("luxels-on-faces");
        constexpr double kLattice = 2e-7; // luxels: twice as far from a lattice line as what the luxels take to be on it
        const std::size_t step = std::max<std::size_t>(1, s.luxels.size() / std::max<std::size_t>(1, options_.points));
        for (std::size_t i = 0; i < s.luxels.size(); i += step) {
            const Luxel& l = s.luxels[i];
            const Chart& c = s.charts[l.chart.at()];
            const LuxelPiece& piece = s.pieces[l.first_piece];
            Vec2 middle;
            const PiecePoints points = points_of(s, piece);
            for (const Vec2 v : points) middle = middle + v * (1.0 / static_cast<double>(points.size()));
            const Vec3 p = world_from_luxel(s, piece.face, middle);
            const Face& f = s.faces[piece.face.at()];
            bool found = false;
            for (std::uint32_t t = f.first_triangle; t < f.first_triangle + f.triangle_count && !found; ++t) {
                found = true;
                for (std::size_t k = 0; k < 3; ++k) {
                    const Vec3 a = s.positions[s.triangles[t][k]], b = s.positions[s.triangles[t][(k + 1) % 3]];
                    found = found && dot(cross(b - a, p - a), f.normal) >= -(kLattice * c.luxel_size + 1e-6) * std::max(1.0, length(b - a));
                }
            }
            on.expect(found, [&] { return Finding{side_of(piece.face.at()), fmt::format("luxel {} {} of chart {} has a piece at {}, where its face is not", l.x, l.y, l.chart.value, at(p))}; });
        }
    }
};

} // namespace

void verify_surfaces(const World& world, const Csg& csg, const Bsp& bsp, const Surfaces& surfaces, const VerifyOptions& options, Checker& checker) {
    const std::uint64_t before = checker.failures();
    check_invariants(surfaces, &world, checker);
    if (checker.failures() != before) return;
    Mesh(world, csg, bsp, surfaces, options, checker).check();
}

} // namespace kiln

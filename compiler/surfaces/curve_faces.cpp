// Grids of curves to triangles, faces, luxel lattices and what of them is seen.
#include "compiler/csg/box_tree.h"
#include "compiler/surfaces/charts.h"
#include "compiler/surfaces/curves.h"
#include "compiler/world/panes.h"
#include "libs/core/check.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace kiln {
namespace {

constexpr double kSamePlace = 1e-9;    // map units, repeats: what an affine map says and a corner says are the same
constexpr double kNoArea = 1e-12;      // map units squared: such triangles only close the mesh
constexpr double kInPlane = 1.0 / 128; // map units: so near to a plane of the tree or of a brush a face lies in it

// ---- Lattice

struct Lattice {
    double luxel_size = 16;
    std::vector<double> x, y;            // luxel coordinate of each column and row
    std::uint32_t width = 0, height = 0; // texels, gutter included
};

// A column of quads gets the width of its widest edge, a row of quads the height of its highest, so that no luxel is
// stretched along either; then all are shrunk together to fill whole luxels.
std::vector<double> spacing(const CurveGrid& g, const std::vector<Vec3>& positions, bool columns) {
    const std::uint32_t count = (columns ? g.columns : g.rows) - 1, lines = columns ? g.rows : g.columns;
    std::vector<double> widest(count, 0.0);
    for (std::uint32_t i = 0; i < count; ++i)
        for (std::uint32_t k = 0; k < lines; ++k) {
            const std::uint32_t a = columns ? g.at(k, i) : g.at(i, k), b = columns ? g.at(k, i + 1) : g.at(i + 1, k);
            const Vec3 from = positions[g.vertices[a]], to = positions[g.vertices[b]];
            widest[i] = std::max(widest[i], length(to - from));
            for (const auto& edge : {std::array{a, b}, std::array{b, a}}) {
                const auto found = g.guests.find(edge);
                if (found == g.guests.end()) continue;
                double before = 0;
                Vec3 last = positions[g.vertices[edge[0]]];
                for (const CurveGrid::Guest& guest : found->second) {
                    if (guest.at > before) widest[i] = std::max(widest[i], length(positions[guest.vertex] - last) / (guest.at - before));
                    before = guest.at, last = positions[guest.vertex];
                }
            }
        }
    return widest;
}

Lattice lattice_of(const CurveGrid& g, const std::vector<Vec3>& positions) {
    Lattice l;
    l.luxel_size = g.luxel_size;
    const std::vector<double> across = spacing(g, positions, true), along = spacing(g, positions, false);
    const auto lay_out = [&](const std::vector<double>& widths, std::vector<double>& at, std::uint32_t& texels) {
        double sum = 0;
        for (const double w : widths) sum += w;
        constexpr double kWhole = 1e-7; // luxels: a length within rounding of a whole number is one
        const double count = std::max(1.0, std::ceil(sum / l.luxel_size - kWhole));
        if (count + 2 > kMaxChartTexels) return false;
        texels = static_cast<std::uint32_t>(count) + 2;
        at.assign(1, 1.0);
        double before = 0;
        for (const double w : widths) before += w, at.push_back(sum > 0 ? 1 + count * (before / sum) : 1);
        return true;
    };
    while (!lay_out(across, l.x, l.width) || !lay_out(along, l.y, l.height)) l.luxel_size *= 2;
    return l;
}

// ---- Triangles

struct Corner {
    std::uint32_t vertex = 0;
    CurveCorner data;
};
using Triangle = std::array<Corner, 3>;

std::vector<Triangle> triangles_of(const CurveGrid& g, const Lattice& lattice) {
    const auto corner = [&](std::uint32_t place) {
        Corner c;
        c.vertex = g.vertices[place];
        c.data.luxel = {lattice.x[place % g.columns], lattice.y[place / g.columns]};
        c.data.uv = g.uv[place], c.data.alpha = g.alpha[place];
        return c;
    };
    std::vector<Triangle> out;
    const auto put = [&](const Corner& a, const Corner& b, const Corner& c) {
        if (a.vertex != b.vertex && b.vertex != c.vertex && c.vertex != a.vertex) out.push_back({a, b, c});
    };
    // Guests of the edges of a triangle cut it, one edge after another: the last parts have the edges that are left.
    using Guests = const std::vector<CurveGrid::Guest>*;
    const auto split = [&](const auto& self, std::array<Corner, 3> t, std::array<Guests, 3> on) -> void {
        for (std::size_t e = 0; e < 3; ++e) {
            if (!on[e]) continue;
            const Corner a = t[e], b = t[(e + 1) % 3], tip = t[(e + 2) % 3];
            const Guests after = on[(e + 1) % 3], before = on[(e + 2) % 3];
            Corner last = a;
            for (std::size_t k = 0; k <= on[e]->size(); ++k) {
                Corner c = b;
                const bool end = k == on[e]->size();
                if (!end) {
                    const CurveGrid::Guest& guest = (*on[e])[k];
                    c.vertex = guest.vertex;
                    c.data.luxel = a.data.luxel + (b.data.luxel - a.data.luxel) * guest.at;
                    c.data.uv = a.data.uv + (b.data.uv - a.data.uv) * guest.at;
                    c.data.alpha = a.data.alpha + (b.data.alpha - a.data.alpha) * guest.at;
                }
                self(self, {last, c, tip}, {nullptr, end ? after : nullptr, k == 0 ? before : nullptr});
                last = c;
            }
            return;
        }
        put(t[0], t[1], t[2]);
    };
    const auto add = [&](std::array<std::uint32_t, 3> place) {
        std::array<Guests, 3> on{};
        for (std::size_t e = 0; e < 3; ++e)
            if (const auto found = g.guests.find({place[e], place[(e + 1) % 3]}); found != g.guests.end()) on[e] = &found->second;
        split(split, {corner(place[0]), corner(place[1]), corner(place[2])}, on);
    };
    for (std::uint32_t r = 0; r + 1 < g.rows; ++r)
        for (std::uint32_t c = 0; c + 1 < g.columns; ++c) {
            const std::uint32_t a = g.at(r, c), b = g.at(r, c + 1), d = g.at(r + 1, c + 1), e = g.at(r + 1, c);
            if ((r + c) % 2 == 0) add({a, b, d}), add({a, d, e});
            else add({a, b, e}), add({b, d, e});
        }
    return out;
}

// u, v with dot(u, a) = dot(v, b) = 1, dot(u, b) = dot(v, a) = 0 in the plane of a and b.
std::array<Vec3, 2> dual(Vec3 a, Vec3 b) {
    const double aa = dot(a, a), ab = dot(a, b), bb = dot(b, b), det = aa * bb - ab * ab;
    if (!(det > 0)) return {};
    return {(a * bb - b * ab) / det, (b * aa - a * ab) / det};
}

struct Flat { // of a face: what its corners have in common
    Vec3 normal;
    double distance = 0;
    LuxelMap map;
    Vec2 uv0;
    Vec3 p0, u_axis, v_axis; // repeats at x: uv0 + (dot(x - p0, u_axis), dot(x - p0, v_axis))
};

// Nothing: no area.
std::optional<Flat> flat_of(const Triangle& t, const std::vector<Vec3>& positions) {
    const Vec3 p = positions[t[0].vertex], e = positions[t[1].vertex] - p, f = positions[t[2].vertex] - p;
    const Vec3 n = cross(e, f);
    const Vec2 l = t[0].data.luxel, d = t[1].data.luxel - l, h = t[2].data.luxel - l;
    const double det = cross(d, h);
    if (!(length(n) > 2 * kNoArea) || !(det > 0)) return std::nullopt;
    Flat flat;
    flat.normal = normalize(n);
    flat.distance = dot(flat.normal, p);
    flat.map.i = (e * h.y - f * d.y) / det, flat.map.j = (f * d.x - e * h.x) / det;
    flat.map.origin = p - flat.map.i * l.x - flat.map.j * l.y;
    const std::array<Vec3, 2> st = dual(flat.map.i, flat.map.j), of_edges = dual(e, f);
    flat.map.s = st[0], flat.map.t = st[1];
    if (st[0] == Vec3{} || of_edges[0] == Vec3{}) return std::nullopt;
    const Vec2 uv = t[0].data.uv, du = t[1].data.uv - uv, dv = t[2].data.uv - uv;
    flat.uv0 = uv, flat.p0 = p;
    flat.u_axis = of_edges[0] * du.x + of_edges[1] * dv.x, flat.v_axis = of_edges[0] * du.y + of_edges[1] * dv.y;
    return flat;
}
bool lies_in(const Flat& f, const Corner& c, Vec3 p) {
    const Vec3 at = f.map.origin + f.map.i * c.data.luxel.x + f.map.j * c.data.luxel.y;
    const Vec2 uv = f.uv0 + Vec2{dot(p - f.p0, f.u_axis), dot(p - f.p0, f.v_axis)};
    const Vec2 off = uv - c.data.uv;
    return length(at - p) < kSamePlace && std::abs(off.x) < kSamePlace && std::abs(off.y) < kSamePlace;
}

// Groups of triangles that hang together along edges and lie in the plane and lattice of their first one.
std::vector<std::vector<std::uint32_t>> faces_of(const std::vector<Triangle>& triangles, const std::vector<std::optional<Flat>>& flats,
                                                 const std::vector<Vec3>& positions) {
    std::map<std::array<std::uint32_t, 2>, std::uint32_t> across; // directed edge -> triangle
    for (std::uint32_t t = 0; t < triangles.size(); ++t)
        for (std::size_t c = 0; c < 3; ++c) across[{triangles[t][c].vertex, triangles[t][(c + 1) % 3].vertex}] = t;
    std::vector<std::vector<std::uint32_t>> faces;
    std::vector<std::uint8_t> taken(triangles.size(), 0);
    for (std::uint32_t first = 0; first < triangles.size(); ++first) {
        if (taken[first]) continue;
        taken[first] = 1;
        std::vector<std::uint32_t> face{first};
        for (std::size_t k = 0; k < face.size() && flats[first]; ++k)
            for (std::size_t c = 0; c < 3; ++c) {
                const Triangle& t = triangles[face[k]];
                const auto next = across.find({t[(c + 1) % 3].vertex, t[c].vertex});
                if (next == across.end() || taken[next->second] || !flats[next->second]) continue;
                const Triangle& u = triangles[next->second];
                if (std::ranges::all_of(u, [&](const Corner& x) { return lies_in(*flats[first], x, positions[x.vertex]); }))
                    taken[next->second] = 1, face.push_back(next->second);
            }
        std::ranges::sort(face);
        faces.push_back(std::move(face));
    }
    return faces;
}

// ---- What is seen

using Polygon = std::vector<Vec3>;

double area_of(const Polygon& p) {
    Vec3 sum;
    for (std::size_t i = 1; i + 1 < p.size(); ++i) sum += cross(p[i] - p[0], p[i + 1] - p[0]);
    return length(sum) / 2;
}

// The part where sign * (dot(normal, x) - distance) >= 0.
Polygon clipped(const Polygon& in, Vec3 normal, double distance, double sign) {
    Polygon out;
    for (std::size_t i = 0; i < in.size(); ++i) {
        const Vec3 a = in[i], b = in[(i + 1) % in.size()];
        const double da = (dot(normal, a) - distance) * sign, db = (dot(normal, b) - distance) * sign;
        if (da >= 0) out.push_back(a);
        if ((da > 0 && db < 0) || (da < 0 && db > 0)) out.push_back(a + (b - a) * (da / (da - db)));
    }
    return out;
}

struct Extent {
    double lo = 1e300, hi = -1e300;
};
Extent extent(const Polygon& p, Vec3 normal, double distance) {
    Extent e;
    for (const Vec3 v : p) {
        const double d = dot(normal, v) - distance;
        e.lo = std::min(e.lo, d), e.hi = std::max(e.hi, d);
    }
    return e;
}

class Seer {
public:
    Seer(const World& world, const Csg& csg, const Bsp& bsp) : csg_(csg), bsp_(bsp) {
        std::vector<Box3> boxes(csg.brushes.size());
        for (std::size_t b = 0; b < boxes.size(); ++b)
            if (csg.brushes[b].valid && world.brushes[b].contents == Contents::detail && world.brushes[b].model.value == 0)
                boxes[b] = csg.brushes[b].bounds;
        covers_ = std::make_unique<csg_detail::BoxTree>(boxes);
    }

    // Appends to `seen` the parts in front of which open leaves inside lie and no detail brush, to `clusters` theirs.
    void look(const Polygon& whole, Vec3 normal, bool two_sided, std::vector<Polygon>& seen, std::vector<ClusterId>& clusters) const {
        std::vector<Polygon> parts;
        struct Visit {
            std::int32_t at;
            Polygon polygon;
            bool shown; // false: seen from behind only, for the clusters
        };
        std::vector<Visit> stack{{bsp_.nodes.empty() ? -1 : 0, whole, true}};
        while (!stack.empty()) {
            Visit v = std::move(stack.back());
            stack.pop_back();
            if (v.at < 0) {
                const BspLeaf& leaf = bsp_.leaves[static_cast<std::size_t>(-(v.at + 1))];
                if (!leaf.cluster.valid()) continue;
                clusters.push_back(leaf.cluster);
                if (v.shown) parts.push_back(std::move(v.polygon));
                continue;
            }
            const BspNode& n = bsp_.nodes[static_cast<std::size_t>(v.at)];
            const Extent e = extent(v.polygon, n.normal, n.distance);
            const auto down = [&](std::size_t child, Polygon polygon, bool shown) {
                stack.push_back({n.child[child], std::move(polygon), shown});
            };
            if (e.lo >= -kInPlane && e.hi <= kInPlane) {
                const std::size_t facing = dot(normal, n.normal) >= 0 ? 0 : 1;
                if (two_sided) down(1 - facing, v.polygon, false);
                down(facing, std::move(v.polygon), v.shown);
            } else if (e.lo >= -kInPlane) {
                down(0, std::move(v.polygon), v.shown);
            } else if (e.hi <= kInPlane) {
                down(1, std::move(v.polygon), v.shown);
            } else {
                Polygon front = clipped(v.polygon, n.normal, n.distance, 1), back = clipped(v.polygon, n.normal, n.distance, -1);
                if (back.size() >= 3) down(1, std::move(back), v.shown);
                if (front.size() >= 3) down(0, std::move(front), v.shown);
            }
        }
        Box3 box;
        for (const Vec3 p : whole) box.add(p);
        std::vector<std::uint32_t> near;
        covers_->query(box, near);
        for (const std::uint32_t b : near) {
            std::vector<Polygon> rest;
            for (Polygon& p : parts) subtract(std::move(p), normal, csg_.brushes[b], rest);
            parts.swap(rest);
        }
        for (Polygon& p : parts) seen.push_back(std::move(p));
    }

private:
    const Csg& csg_;
    const Bsp& bsp_;
    std::unique_ptr<csg_detail::BoxTree> covers_;

    void subtract(Polygon p, Vec3 normal, const BrushPolytope& brush, std::vector<Polygon>& out) const {
        struct Side {
            Vec3 normal;
            double distance;
        };
        std::vector<Side> cuts;
        Polygon inside = p;
        for (const PlanePolygon& face : brush.faces) {
            const Side s{csg_.planes.normal(face.support), csg_.planes.distance(face.support)};
            const Extent e = extent(inside, s.normal, s.distance);
            const bool in_plane = e.lo >= -kInPlane && e.hi <= kInPlane;
            if (in_plane ? dot(normal, s.normal) > 0 : e.lo >= -kInPlane) return out.push_back(std::move(p)); // the brush is behind, or apart
            if (in_plane || e.hi <= kInPlane) continue;
            cuts.push_back(s);
            inside = clipped(inside, s.normal, s.distance, -1);
            if (inside.size() < 3) return out.push_back(std::move(p));
        }
        for (const Side& s : cuts) {
            Polygon front = clipped(p, s.normal, s.distance, 1);
            if (front.size() >= 3 && area_of(front) > kNoArea) out.push_back(std::move(front));
            p = clipped(p, s.normal, s.distance, -1);
        }
    }
};

// ---- Faces

struct Look {
    bool drawn = true, blocks = true, sky = false, two_sided = false, lit = true;
};

Look look_of(const World& world, const CurveGrid& g, Context& context) {
    const std::uint32_t f = world.materials[g.material.at()].flags;
    if (g.kind == Curve::displacement && (f & kNoDraw))
        context.report(Severity::warning, "displacement-nodraw",
                       fmt::format("'{}' on a displacement: it is drawn all the same, as in the original tools",
                                   world.materials[g.material.at()].name),
                       world.location(g.side));
    Look look;
    look.sky = (f & kSky) != 0;
    look.drawn = !(f & undrawn_flags(g.kind)) && !look.sky;
    look.blocks = curve_blocks_light(world, g);
    look.two_sided = look.drawn && (f & kTwoSided);
    look.lit = look.drawn && !(f & kNoLight);
    return look;
}

struct Built { // one curve
    Lattice lattice;
    std::vector<FaceDraft> drafts;
    std::vector<LuxelMap> maps;                      // parallel to drafts
    std::vector<std::vector<Triangle>> triangles;    // parallel to drafts
    std::size_t hidden = 0;                          // faces
    Vec3 normal, tangent;                            // on the whole
    bool mirrored = false;
};

Built build(const CurveGrid& g, const std::vector<Vec3>& positions, const Look& look, const Seer& seer) {
    Built out;
    out.lattice = lattice_of(g, positions);
    const std::vector<Triangle> triangles = triangles_of(g, out.lattice);
    std::vector<std::optional<Flat>> flats;
    Vec3 sum, u_sum;
    double turn = 0;
    for (const Triangle& t : triangles) {
        flats.push_back(flat_of(t, positions));
        if (!flats.back()) continue;
        const Flat& f = *flats.back();
        const Vec3 a = positions[t[0].vertex], area = cross(positions[t[1].vertex] - a, positions[t[2].vertex] - a);
        sum += area;
        if (length(f.u_axis) > 0) u_sum += normalize(f.u_axis) * length(area);
        turn += dot(cross(f.u_axis, f.v_axis), area);
    }
    out.normal = length(sum) > 0 ? normalize(sum) : Vec3{0, 0, 1};
    out.tangent = u_sum, out.mirrored = turn < 0;
    if (!(length(sum) > kNoArea))
        for (const auto& f : flats)
            if (f) out.normal = f->normal; // a closed surface faces all ways
    for (const std::vector<std::uint32_t>& members : faces_of(triangles, flats, positions)) {
        FaceDraft draft;
        Face& face = draft.face;
        const std::optional<Flat>& flat = flats[members[0]];
        face.side = g.side, face.material = g.material, face.model = g.model;
        face.blocks_light = look.blocks, face.two_sided = look.two_sided;
        face.drawn = look.drawn, face.sky = look.sky;
        draft.luxel_size = out.lattice.luxel_size;
        draft.lit = look.lit && flat;
        const Vec3 p0 = positions[triangles[members[0]][0].vertex];
        face.normal = flat ? flat->normal : out.normal;
        face.distance = dot(face.normal, p0);
        LuxelMap map;
        if (flat) map = flat->map;
        else map.origin = p0;
        DocTexture texture; // its axes along growing u and v
        if (flat) texture.u_axis = flat->u_axis, texture.v_axis = flat->v_axis;
        tangent_frame(texture, face.normal, face.tangent);
        std::vector<Triangle> own;
        bool any_seen = g.model.value != 0;
        for (const std::uint32_t t : members) {
            const Triangle& triangle = triangles[t];
            own.push_back(triangle);
            Polygon polygon;
            for (const Corner& c : triangle) polygon.push_back(positions[c.vertex]), face.bounds.add(positions[c.vertex]);
            const double area = std::max(0.0, dot(cross(polygon[1] - polygon[0], polygon[2] - polygon[0]), face.normal) / 2);
            face.area += area;
            const std::vector<Vec2> whole{triangle[0].data.luxel, triangle[1].data.luxel, triangle[2].data.luxel};
            if (g.model.value != 0) { // nothing is in the way of what may move
                draft.seen.push_back(whole);
                continue;
            }
            std::vector<Polygon> seen;
            seer.look(polygon, face.normal, look.two_sided, seen, face.clusters);
            double sum_seen = 0;
            for (const Polygon& p : seen) sum_seen += area_of(p);
            any_seen = any_seen || sum_seen > kNoArea || (!flat && !face.clusters.empty());
            constexpr double kAll = 1 - 1e-9;
            if (sum_seen >= kAll * area) {
                draft.seen.push_back(whole);
                continue;
            }
            for (const Polygon& p : seen) {
                std::vector<Vec2> luxels;
                for (const Vec3 v : p) luxels.push_back({dot(v - map.origin, map.s), dot(v - map.origin, map.t)});
                draft.seen.push_back(std::move(luxels));
            }
        }
        std::ranges::sort(face.clusters);
        face.clusters.erase(std::unique(face.clusters.begin(), face.clusters.end()), face.clusters.end());
        if (!any_seen && (face.drawn || face.sky)) {
            if (flat) ++out.hidden;
            face.drawn = face.sky = face.two_sided = draft.lit = false;
        }
        if (!draft.lit) draft.seen.clear();
        out.drafts.push_back(std::move(draft));
        out.maps.push_back(map);
        out.triangles.push_back(std::move(own));
    }
    return out;
}

Chart chart_of(const CurveGrid& g, const Built& b, const std::vector<Vec3>& positions) {
    Chart chart;
    chart.n = b.normal;
    const Vec3 along = b.tangent - b.normal * dot(b.tangent, b.normal);
    constexpr double kSome = 1e-9;
    chart.s = length(along) > kSome ? normalize(along) : frame_around(b.normal).t;
    chart.t = cross(chart.n, chart.s);
    chart.frame = {chart.s, b.mirrored ? -chart.t : chart.t, chart.n};
    chart.luxel_size = b.lattice.luxel_size;
    chart.width = b.lattice.width, chart.height = b.lattice.height;
    double s = 1e300, t = 1e300, n = 0;
    for (const std::uint32_t v : g.vertices) {
        s = std::min(s, dot(positions[v], chart.s)), t = std::min(t, dot(positions[v], chart.t));
        n += dot(positions[v], chart.n) / static_cast<double>(g.vertices.size());
    }
    chart.origin = chart.s * (s - chart.luxel_size) + chart.t * (t - chart.luxel_size) + chart.n * n;
    return chart;
}

} // namespace

std::vector<std::array<std::uint32_t, 3>> curve_triangles(const CurveGrid& grid) {
    Lattice none;
    none.x.resize(grid.columns), none.y.resize(grid.rows);
    std::vector<std::array<std::uint32_t, 3>> out;
    for (const Triangle& t : triangles_of(grid, none)) out.push_back({t[0].vertex, t[1].vertex, t[2].vertex});
    return out;
}

bool curve_blocks_light(const World& world, const CurveGrid& g) {
    const std::uint32_t f = world.materials[g.material.at()].flags;
    const bool clear = (f & (kInvisible | kTranslucent)) || world.materials[g.material.at()].alpha < 1;
    bool shadow = true;
    if (g.kind == Curve::displacement) {
        shadow = world.brushes[world.brush_of(g.side).at()].casts_light_shadow;
    } else {
        shadow = casts_shadow(world.entities[world.patches[g.source].entity.at()], g.model.value != 0);
    }
    return (f & kLightBlocker) || (!clear && shadow);
}

std::vector<Chart> add_curve_faces(Surfaces& s, std::vector<FaceDraft>& drafts, const CurveGrids& grids, const World& world, const Csg& csg,
                                   const Bsp& bsp, Context& context) {
    std::vector<Chart> charts;
    if (grids.grids.empty()) return charts;
    const auto place = [&](const CurveGrid& g) { return g.side.valid() ? world.location(g.side) : world.location(world.patches[g.source]); };
    std::vector<Look> looks;
    for (const CurveGrid& g : grids.grids) looks.push_back(look_of(world, g, context));
    const Seer seer(world, csg, bsp);
    std::vector<Built> built(grids.grids.size());
    parallel_for(context, built.size(), [&](std::size_t i) { built[i] = build(grids.grids[i], grids.positions, looks[i], seer); });

    s.first_curved_face = static_cast<std::uint32_t>(s.faces.size());
    std::vector<std::uint32_t> position(grids.positions.size(), UINT32_MAX);
    const auto position_of = [&](std::uint32_t v) {
        if (position[v] == UINT32_MAX) position[v] = static_cast<std::uint32_t>(s.positions.size()), s.positions.push_back(grids.positions[v]);
        return position[v];
    };
    std::size_t hidden = 0;
    SourceLocation first_hidden;
    for (std::size_t i = 0; i < built.size(); ++i) {
        const CurveGrid& g = grids.grids[i];
        Built& b = built[i];
        if (std::ranges::none_of(b.drafts, [](const FaceDraft& d) { return d.face.area > kNoArea; })) {
            context.report(Severity::warning, g.kind == Curve::patch ? "patch-degenerate" : "displacement-degenerate",
                           "its vertices span no area; it is left out", place(g));
            continue;
        }
        if (b.lattice.luxel_size != g.luxel_size)
            context.report(Severity::warning, "chart-too-large",
                           fmt::format("the surface needs more than {} luxels of {} units; they became {} units", kMaxChartTexels, g.luxel_size,
                                       b.lattice.luxel_size),
                           place(g));
        if (b.hidden > 0 && hidden == 0) first_hidden = place(g);
        hidden += b.hidden;
        Curve curve;
        curve.kind = g.kind, curve.source = g.source;
        curve.columns = g.columns, curve.rows = g.rows;
        curve.uv = g.uv, curve.base = g.base, curve.base_plane = g.base_plane;
        curve.first_face = static_cast<std::uint32_t>(s.faces.size());
        curve.face_count = static_cast<std::uint32_t>(b.drafts.size());
        for (const std::uint32_t v : g.vertices) curve.grid.push_back(position_of(v));
        for (std::size_t f = 0; f < b.drafts.size(); ++f) {
            Face& face = b.drafts[f].face;
            face.curve = static_cast<std::uint32_t>(s.curves.size());
            face.first_triangle = static_cast<std::uint32_t>(s.triangles.size());
            face.triangle_count = static_cast<std::uint32_t>(b.triangles[f].size());
            for (const Triangle& t : b.triangles[f]) {
                s.triangles.push_back({position_of(t[0].vertex), position_of(t[1].vertex), position_of(t[2].vertex)});
                s.triangle_face.push_back(id<FaceId>(s.faces.size()));
                s.curve_corners.push_back({t[0].data, t[1].data, t[2].data});
            }
            s.luxel_maps.push_back(b.maps[f]);
            s.faces.push_back(face);
            drafts.push_back(std::move(b.drafts[f]));
        }
        charts.push_back(chart_of(g, b, grids.positions));
        charts.back().curve = static_cast<std::uint32_t>(s.curves.size());
        s.curves.push_back(std::move(curve));
    }
    if (hidden > 0)
        context.report(Severity::note, "curve-faces-hidden",
                       fmt::format("{} faces of displacements and patches lie wholly inside brushes or outside of the level and are not drawn", hidden),
                       first_hidden);
    return charts;
}

} // namespace kiln

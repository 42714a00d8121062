// Displacements: vertices over the corners of their base face, neighbours sewn together.
#include "compiler/csg/box_tree.h"
#include "compiler/surfaces/curves.h"
#include "libs/core/check.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numeric>

namespace kiln {
namespace {

// Corners of a base face that lie this close to the line between their neighbours are none: planes through rounded
// points seldom meet four in a point. Map units.
constexpr double kFlatCorner = 0.25;
// Border lines of base faces that lie this close to each other are one. Map units; planes move by less when they merge.
constexpr double kSameLine = 0.1;
// Vertices at the same place of a shared border are one where they lie this close: what the editor sewed differs by
// the rounding of its text (measured: NOTES.md). Map units.
constexpr double kSewn = 0.25;

double distance_to_segment(Vec3 p, Vec3 a, Vec3 b) {
    const Vec3 d = b - a;
    const double l2 = dot(d, d), t = l2 > 0 ? std::clamp(dot(p - a, d) / l2, 0.0, 1.0) : 0;
    return length(p - (a + d * t));
}

// The corners of a polygon that has four, but for flat ones.
std::vector<Vec3> quad_of(std::vector<Vec3> p) {
    while (p.size() > 4) {
        std::size_t flattest = 0;
        double least = 1e300;
        for (std::size_t i = 0; i < p.size(); ++i) {
            const double d = distance_to_segment(p[i], p[(i + p.size() - 1) % p.size()], p[(i + 1) % p.size()]);
            if (d < least) least = d, flattest = i;
        }
        if (least > kFlatCorner) break;
        p.erase(p.begin() + static_cast<std::ptrdiff_t>(flattest));
    }
    return p;
}

struct Base { // of one displacement
    std::array<Vec3, 4> corner; // counter-clockwise seen from the front, from the start on
    Vec3 normal;
    PlaneId plane;
};

std::optional<Base> base_of(const World& world, const Csg& csg, BrushId brush, SideId side, Vec3 start, Context& context) {
    const BrushPolytope& polytope = csg.brushes[brush.at()];
    if (!polytope.valid) return std::nullopt; // reported with its brush
    const auto found = std::ranges::find(polytope.sides, side);
    if (found == polytope.sides.end()) {
        context.report(Severity::error, "displacement-base",
                       "the side of a displacement has no part in the surface of its brush; the displacement is left out",
                       world.location(side));
        return std::nullopt;
    }
    const PlanePolygon& face = polytope.faces[static_cast<std::size_t>(found - polytope.sides.begin())];
    const std::vector<Vec3> corners = quad_of(points(csg.planes, face));
    if (corners.size() != 4) {
        context.report(Severity::error, "displacement-base",
                       fmt::format("a displacement needs a side with four corners, this one has {}; the displacement is left out",
                                   corners.size()),
                       world.location(side));
        return std::nullopt;
    }
    Base base;
    base.plane = face.support;
    base.normal = csg.planes.normal(face.support);
    std::size_t first = 0;
    double shortest = 1e300;
    for (std::size_t i = 0; i < 4; ++i) {
        if (length(corners[i] - start) < length(corners[first] - start)) first = i;
        shortest = std::min(shortest, length(corners[(i + 1) % 4] - corners[i]));
    }
    for (std::size_t i = 0; i < 4; ++i) base.corner[i] = corners[(first + i) % 4];
    if (length(base.corner[0] - start) > shortest / 2)
        context.report(Severity::warning, "displacement-start",
                       fmt::format("the start position of a displacement, ({} {} {}), is near no corner of its side; the nearest is taken",
                                   start.x, start.y, start.z),
                       world.location(side));
    return base;
}

Vec3 bilinear(const std::array<Vec3, 4>& q, double along, double across) {
    const Vec3 a = q[0] * (1 - across) + q[3] * across, b = q[1] * (1 - across) + q[2] * across;
    return a * (1 - along) + b * along;
}

// ---- Sewing

struct Border { // one side of a base face
    std::uint32_t grid = 0;
    Vec3 from, to; // map units
    double length = 0;
    std::vector<std::uint32_t> places; // of the grid, from `from` to `to`
};

std::array<Border, 4> borders_of(const CurveGrid& g, std::uint32_t index, const std::array<Vec3, 4>& corner) {
    std::array<Border, 4> borders;
    const std::uint32_t last = g.columns - 1;
    for (std::uint32_t k = 0; k < 4; ++k) {
        Border& b = borders[k];
        b.grid = index, b.from = corner[k], b.to = corner[(k + 1) % 4], b.length = length(b.to - b.from);
        for (std::uint32_t i = 0; i <= last; ++i)
            b.places.push_back(k == 0 ? g.at(0, i) : k == 1 ? g.at(i, last) : k == 2 ? g.at(last, last - i) : g.at(last - i, 0));
    }
    return borders;
}

// A vertex of a finer neighbour between two that both sides of a border share.
struct GuestPlace {
    std::uint32_t border = 0, segment = 0; // of the coarser side
    double at = 0;                         // 0..1
    std::uint32_t vertex = 0;
    double segment_length = 0;
};

class Sewing {
public:
    Sewing(CurveGrids& out, std::vector<Border> borders, std::size_t first_vertex)
        : out_(out), borders_(std::move(borders)), first_(first_vertex), parent_(out.positions.size() - first_vertex) {
        std::iota(parent_.begin(), parent_.end(), 0u);
        for (const CurveGrid& g : out.grids) first_of_grid_.push_back(g.vertices[0]);
    }

    std::size_t moved = 0, apart = 0;
    double largest_move = 0, widest = 0;
    std::uint32_t moved_grid = UINT32_MAX, apart_grid = UINT32_MAX;

    void run() {
        std::vector<Box3> boxes;
        for (const Border& b : borders_) {
            Box3 box;
            box.add(b.from), box.add(b.to);
            const Vec3 m{kSameLine, kSameLine, kSameLine};
            boxes.push_back({box.lo - m, box.hi + m});
        }
        const csg_detail::BoxTree tree(boxes);
        std::vector<std::uint32_t> near;
        for (std::uint32_t i = 0; i < borders_.size(); ++i) {
            tree.query(boxes[i], near);
            for (const std::uint32_t j : near)
                if (j > i && borders_[j].grid != borders_[i].grid) meet(i, j);
        }
        // Shared vertices are where the first of them is; then those of finer sides go onto the coarser ones, long
        // segments first, so that the ends of a segment stay where they are once something was put on it.
        for (std::size_t v = 0; v < parent_.size(); ++v) move(v, out_.positions[first_ + find(v)]);
        std::ranges::stable_sort(guests_, std::greater<>(), &GuestPlace::segment_length);
        for (const GuestPlace& g : guests_) {
            const Border& b = borders_[g.border];
            CurveGrid& grid = out_.grids[b.grid];
            const std::uint32_t a = b.places[g.segment], c = b.places[g.segment + 1];
            const std::size_t from = root_of(grid, a), to = root_of(grid, c), guest = find(g.vertex - first_);
            if (guest == from || guest == to) continue;
            const Vec3 p = out_.positions[first_ + from], q = out_.positions[first_ + to];
            move(guest, p + (q - p) * g.at);
            std::vector<CurveGrid::Guest>& list = grid.guests[{a, c}];
            const auto id = static_cast<std::uint32_t>(first_ + guest);
            if (std::ranges::find(list, id, &CurveGrid::Guest::vertex) == list.end()) list.push_back({g.at, id});
        }
        for (CurveGrid& grid : out_.grids) {
            for (std::uint32_t& v : grid.vertices)
                if (v >= first_) v = static_cast<std::uint32_t>(first_ + find(v - first_));
            for (auto& [edge, list] : grid.guests) std::ranges::sort(list, {}, &CurveGrid::Guest::at);
        }
    }

private:
    CurveGrids& out_;
    std::vector<Border> borders_;
    std::size_t first_;
    std::vector<std::uint32_t> parent_; // of vertices, from first_ on; roots are the smallest
    std::vector<GuestPlace> guests_;
    std::vector<std::uint32_t> first_of_grid_; // vertex; before any was shared

    std::size_t find(std::size_t v) {
        while (parent_[v] != v) v = parent_[v] = parent_[parent_[v]];
        return v;
    }
    std::size_t root_of(const CurveGrid& grid, std::uint32_t place) { return find(grid.vertices[place] - first_); }
    void move(std::size_t v, Vec3 to) {
        Vec3& p = out_.positions[first_ + v];
        const double way = length(to - p);
        if (!(way > 0)) return;
        ++moved;
        p = to;
        if (way <= largest_move) return;
        largest_move = way;
        const auto after = std::ranges::upper_bound(first_of_grid_, static_cast<std::uint32_t>(first_ + v));
        moved_grid = static_cast<std::uint32_t>(after - first_of_grid_.begin()) - 1;
    }

    struct Stop { // a vertex of a border, by how far along the line of the pair's first border it lies
        double x = 0;
        std::uint32_t index = 0; // in Border::places
        std::uint32_t vertex = 0;
    };

    void meet(std::uint32_t i, std::uint32_t j) {
        const Border &a = borders_[i], &b = borders_[j];
        if (out_.grids[a.grid].model != out_.grids[b.grid].model || !(a.length > 0) || !(b.length > 0)) return;
        const Vec3 u = (a.to - a.from) / a.length, w = (b.to - b.from) / b.length;
        const auto off = [](Vec3 p, Vec3 origin, Vec3 unit) { return length((p - origin) - unit * dot(p - origin, unit)); };
        if (off(b.from, a.from, u) > kSameLine || off(b.to, a.from, u) > kSameLine || off(a.from, b.from, w) > kSameLine ||
            off(a.to, b.from, w) > kSameLine)
            return;
        const double from = dot(b.from - a.from, u), to = dot(b.to - a.from, u);
        const double least_step = std::min(a.length / static_cast<double>(a.places.size() - 1), b.length / static_cast<double>(b.places.size() - 1));
        const double same = std::min(kSameLine, least_step / 4);
        const double lo = std::max(0.0, std::min(from, to)) - same, hi = std::min(a.length, std::max(from, to)) + same;
        if (hi - lo < least_step) return; // they meet in a corner at most
        const auto stops = [&](const Border& border, double first, double last) {
            std::vector<Stop> list;
            const auto n = static_cast<double>(border.places.size() - 1);
            for (std::uint32_t k = 0; k < border.places.size(); ++k) {
                const double x = first + (last - first) * (k / n);
                if (x >= lo && x <= hi) list.push_back({x, k, out_.grids[border.grid].vertices[border.places[k]]});
            }
            if (first > last) std::ranges::reverse(list);
            return list;
        };
        const std::vector<Stop> sa = stops(a, 0, a.length), sb = stops(b, from, to);
        // Vertices of both at one place; `joined` where they are one.
        std::vector<std::array<std::size_t, 2>> joined;
        for (std::size_t p = 0, q = 0; p < sa.size() && q < sb.size();) {
            if (sa[p].x < sb[q].x - same) ++p;
            else if (sb[q].x < sa[p].x - same) ++q;
            else {
                const double gap = length(out_.positions[sa[p].vertex] - out_.positions[sb[q].vertex]);
                if (gap <= kSewn) {
                    join(sa[p].vertex - first_, sb[q].vertex - first_);
                    joined.push_back({p, q});
                } else {
                    ++apart;
                    if (gap > widest) widest = gap, apart_grid = a.grid;
                }
                ++p, ++q;
            }
        }
        for (std::size_t k = 0; k + 1 < joined.size(); ++k) {
            const auto [p0, q0] = joined[k];
            const auto [p1, q1] = joined[k + 1];
            if (p1 == p0 + 1) add_guests(i, sa[p0], sa[p1], sb, q0, q1);
            else if (q1 == q0 + 1) add_guests(j, sb[q0], sb[q1], sa, p0, p1);
        }
    }
    // Vertices first + 1 .. last - 1 of the finer side onto the segment between s and t of border `coarse`.
    void add_guests(std::uint32_t coarse, const Stop& s, const Stop& t, const std::vector<Stop>& fine, std::size_t first, std::size_t last) {
        const bool forward = s.index < t.index;
        for (std::size_t k = first + 1; k < last; ++k) {
            const double at = (fine[k].x - s.x) / (t.x - s.x);
            guests_.push_back({coarse, std::min(s.index, t.index), forward ? at : 1 - at, fine[k].vertex, t.x - s.x});
        }
    }
    void join(std::size_t a, std::size_t b) {
        a = find(a), b = find(b);
        if (a != b) parent_[std::max(a, b)] = static_cast<std::uint32_t>(std::min(a, b));
    }
};

} // namespace

void add_displacements(const World& world, const Csg& csg, CurveGrids& out, Context& context) {
    const std::size_t first_vertex = out.positions.size();
    std::vector<Border> borders;
    for (std::size_t d = 0; d < world.displacements.size(); ++d) {
        context.check_cancelled();
        const WorldDisplacement& source = world.displacements[d];
        const WorldSide& side = world.sides[source.side.at()];
        const BrushId brush = world.brush_of(source.side);
        const std::optional<Base> base = base_of(world, csg, brush, source.side, source.grid.start, context);
        if (!base) continue;
        const Material& material = world.materials[side.material.at()];
        CurveGrid g;
        g.kind = Curve::displacement, g.source = static_cast<std::uint32_t>(d), g.side = source.side;
        g.material = side.material, g.model = world.brushes[brush.at()].model;
        g.luxel_size = side.lightmap_scale > 0 && std::isfinite(side.lightmap_scale) ? side.lightmap_scale : 16;
        const DocDisplacement& grid = source.grid;
        const std::uint32_t n = 1u << grid.power;
        g.columns = g.rows = n + 1;
        g.base = base->corner, g.base_plane = base->plane;
        for (std::uint32_t r = 0; r <= n; ++r)
            for (std::uint32_t c = 0; c <= n; ++c) {
                const std::size_t v = g.at(r, c);
                const Vec3 flat = bilinear(base->corner, static_cast<double>(c) / n, static_cast<double>(r) / n);
                Vec3 p = flat + base->normal * grid.elevation;
                if (!grid.normals.empty() && !grid.distances.empty()) p += grid.normals[v] * grid.distances[v];
                if (!grid.offsets.empty()) p += grid.offsets[v];
                g.vertices.push_back(static_cast<std::uint32_t>(out.positions.size()));
                out.positions.push_back(p + Vec3{0, 0, 0}); // no negative zeros: positions are compared by their bits
                g.uv.push_back(texture_uv(side.texture, material, flat)); // of the flat face: displacing stretches the picture
                g.alpha.push_back(grid.alphas.empty() ? 0 : std::clamp(grid.alphas[v] / 255, 0.0, 1.0));
            }
        for (Border& b : borders_of(g, static_cast<std::uint32_t>(out.grids.size()), base->corner)) borders.push_back(std::move(b));
        out.grids.push_back(std::move(g));
    }
    if (borders.empty()) return;
    Sewing sewing(out, std::move(borders), first_vertex);
    sewing.run();
    const auto place = [&](std::uint32_t grid) {
        return grid == UINT32_MAX ? SourceLocation{.file = world.file} : world.location(out.grids[grid].side);
    };
    if (sewing.moved > 0)
        context.report(Severity::note, "displacements-sewn",
                       fmt::format("{} border vertices of displacements were put onto those of their neighbours; the largest move is {:.3g} map units",
                                   sewing.moved, sewing.largest_move),
                       place(sewing.moved_grid));
    if (sewing.apart > 0)
        context.report(Severity::note, "displacements-apart",
                       fmt::format("{} border vertices of displacements on common edges do not meet, by up to {:.3g} map units: the map leaves gaps there",
                                   sewing.apart, sewing.widest),
                       place(sewing.apart_grid));
}

} // namespace kiln

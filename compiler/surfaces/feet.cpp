#include "compiler/surfaces/feet.h"
#include "compiler/world/panes.h"
#include "libs/core/check.h"
#include <algorithm>
#include <cmath>

namespace kiln {
namespace {

// A curve has no inside. Each of its triangles stands for a prism of this height behind it, in map units: less than anything thick, and wider than
// what rounds its corners. Prisms of terrain point along the normal of its base, so that those of neighbours have a side in common; but where it stands
// upright on that (cosine below kUpright), and in patches, which have no base, each along its own. The line along which the triangles meet a face has
// no hole for either: prisms of neighbours hold their common edge exactly. With its own normal a triangle whose border lies in a face may lean so that
// nothing of its prism does; so what ends there goes on by as much as it is thick.
constexpr double kBehind = 1.0 / 8;
constexpr double kUpright = 0.1;
constexpr int kFineBits = 10; // corners of curves lie on multiples of 2^-10 map units here, as finely as any plane point


// In front of a sky, water or glass nothing is shadowed by them: only what is solid or meant to block, and panes that nothing comes through.
bool casts(const World& world, const WorldBrush& brush) {
    const auto side_casts = [&](const WorldSide& side) {
        const Material& m = world.materials[side.material.at()];
        const bool clear = (m.flags & (kInvisible | kTranslucent | kAlphaTested)) || m.alpha < 1;
        if ((m.flags & kLightBlocker) || (opaque(brush.contents) && !clear && brush.casts_light_shadow)) return true;
        if (!clear || !brush.draws || never_drawn(m)) return false;
        const auto opacity = pane_opacity(world, m, brush);
        return opacity && opaque_pane(m, *opacity);
    };
    return std::ranges::any_of(std::span(world.sides).subspan(brush.first_side, brush.side_count), side_casts);
}

bool casts(const World& world, const CurveGrid& grid) {
    const Material& m = world.materials[grid.material.at()];
    const auto opacity = grid.kind == Curve::displacement ? pane_opacity(world, m, world.brushes[world.brush_of(grid.side).at()]) : pane_opacity(world, m, world.patches[grid.source]);
    return opacity && !never_drawn(m) ? opaque_pane(m, *opacity) : curve_blocks_light(world, grid);
}

GridPoint fine(Vec3 p) {
    GridPoint out{};
    for (std::size_t k = 0; k < 3; ++k) out[k] = std::llround(std::ldexp(p[k], kFineBits));
    return out;
}
GridPoint moved(const GridPoint& p, const std::array<std::int64_t, 3>& by) { return {p[0] + by[0], p[1] + by[1], p[2] + by[2]}; }

bool in_range(const GridPoint& p) {
    return std::ranges::all_of(p, [](std::int64_t x) { return std::abs(x) <= kMaxGridCoordinate; });
}

__int128 height(const ExactPlane& plane, const GridPoint& p) {
    return static_cast<__int128>(plane.a) * p[0] + static_cast<__int128>(plane.b) * p[1] + static_cast<__int128>(plane.c) * p[2] - plane.d;
}

} // namespace

Feet::Feet(const World& world, const Csg& csg, const CurveGrids& grids, const PlaneTable& planes, PlaneTable* own)
    : planes_(planes), own_(own), sets_(1) {
    number_of_[{}] = 0;
    for (std::size_t b = 0; b < csg.brushes.size(); ++b) {
        const WorldBrush& brush = world.brushes[b];
        const BrushPolytope& polytope = csg.brushes[b];
        if (!polytope.valid || brush.displaced) continue;
        // The world's solid brushes cut its faces; what they cut of those of models stands in solid and gets no light.
        const bool solid = opaque(brush.contents);
        if ((solid && brush.model.value == 0) || !casts(world, brush)) continue;
        Blocker& blocker = blockers_.emplace_back();
        blocker.owner = brush.model.value;
        if (solid) blocker.model = brush.model;
        for (const PlanePolygon& face : polytope.faces) blocker.planes.push_back(face.support);
        blocker.box = polytope.bounds;
        const Vec3 rounding{1e-6, 1e-6, 1e-6}; // of its corners, and of those of what it stands on
        blocker.box.add(polytope.bounds.lo - rounding), blocker.box.add(polytope.bounds.hi + rounding);
    }
    std::vector<std::vector<std::array<std::uint32_t, 3>>> triangles(grids.grids.size()); // of what casts shadows
    std::vector<std::array<std::uint32_t, 2>> edges;                                      // of those, once a triangle
    const auto edge_of = [](const std::array<std::uint32_t, 3>& t, std::size_t k) { return std::array{std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])}; };
    for (std::size_t g = 0; g < grids.grids.size(); ++g) {
        if (!casts(world, grids.grids[g])) continue;
        triangles[g] = curve_triangles(grids.grids[g]);
        for (const std::array<std::uint32_t, 3>& t : triangles[g])
            for (std::size_t k = 0; k < 3; ++k) edges.push_back(edge_of(t, k));
    }
    std::ranges::sort(edges);
    const auto add = [&](std::uint32_t owner, const std::array<Vec3, 3>& corner, Vec3 front) {
        Blocker blocker;
        blocker.owner = owner, blocker.curve = true, blocker.corner = corner;
        for (std::size_t k = 0; k < 3; ++k) {
            blocker.down[k] = -std::llround(std::ldexp(front[k] * kBehind, kFineBits));
            blocker.box.add(corner[k] - front * (2 * kBehind)), blocker.box.add(corner[k] + front * (2 * kBehind));
        }
        blockers_.push_back(std::move(blocker));
    };
    for (std::uint32_t g = 0; g < grids.grids.size(); ++g) {
        const CurveGrid& grid = grids.grids[g];
        for (const std::array<std::uint32_t, 3>& t : triangles[g]) {
            const std::array<Vec3, 3> corner{grids.positions[t[0]], grids.positions[t[1]], grids.positions[t[2]]};
            const Vec3 across = cross(corner[1] - corner[0], corner[2] - corner[0]);
            if (!(length(across) > 0)) continue;
            const Vec3 front = normalize(across), base = grid.kind == Curve::displacement ? csg.planes.normal(grid.base_plane) : Vec3{};
            const std::uint32_t owner = world.model_count + g;
            if (dot(front, base) > kUpright) {
                add(owner, corner, base);
                continue;
            }
            add(owner, corner, front);
            for (std::size_t k = 0; k < 3; ++k) {
                if (std::ranges::equal_range(edges, edge_of(t, k)).size() > 1) continue;
                const Vec3 a = corner[k], b = corner[(k + 1) % 3], on = normalize(cross(b - a, front)) * kBehind;
                add(owner, {b, a, a + on}, front), add(owner, {b, a + on, b + on}, front);
            }
        }
    }
    std::vector<Box3> boxes;
    for (const Blocker& b : blockers_) boxes.push_back(b.box);
    tree_ = std::make_unique<csg_detail::BoxTree>(boxes);
}

// The planes of the prism behind a triangle. None where it has no area on the fine grid, or is so large (over 2^14 units) that its planes would not fit
// the table.
void Feet::ask(Blocker& b) {
    b.asked = true;
    std::array<GridPoint, 3> top, bottom;
    for (std::size_t k = 0; k < 3; ++k) {
        top[k] = fine(b.corner[k]), bottom[k] = moved(top[k], b.down);
        if (!in_range(top[k]) || !in_range(bottom[k])) return;
    }
    const int shift = kFineBits - planes_.grid_bits;
    KILN_CHECK_OP(shift, >=, 0);
    std::vector<PlaneId> out;
    // The plane through three points, `inside` behind it.
    const auto add = [&](const GridPoint& p, const GridPoint& q, const GridPoint& r, const GridPoint& inside) {
        std::optional<ExactPlane> plane = plane_through(p, q, r);
        if (!plane) return false;
        const __int128 h = height(*plane, inside);
        if (h == 0) return false;
        if (h > 0) plane->a = -plane->a, plane->b = -plane->b, plane->c = -plane->c, plane->d = -plane->d;
        constexpr std::int64_t kMost = std::int64_t{1} << 50;
        if (std::abs(plane->a) > kMost || std::abs(plane->b) > kMost || std::abs(plane->c) > kMost) return false;
        const std::int64_t by = std::int64_t{1} << shift; // coordinates of the table are that much coarser
        plane->a *= by, plane->b *= by, plane->c *= by;
        out.push_back(own_->add(*plane));
        return true;
    };
    if (!add(top[0], top[1], top[2], bottom[0]) || !add(bottom[0], bottom[1], bottom[2], top[0])) return;
    for (std::size_t k = 0; k < 3; ++k)
        if (!add(top[k], top[(k + 1) % 3], bottom[k], top[(k + 2) % 3])) return;
    b.planes = std::move(out);
}

std::uint32_t Feet::with(std::uint32_t under, std::uint32_t owner) {
    std::vector<std::uint32_t> set = sets_[under];
    const auto at = std::ranges::lower_bound(set, owner);
    if (at != set.end() && *at == owner) return under;
    set.insert(at, owner);
    const auto [found, fresh] = number_of_.try_emplace(set, static_cast<std::uint32_t>(sets_.size()));
    if (fresh) sets_.push_back(std::move(set));
    return found->second;
}

std::vector<Feet::Part> Feet::cut(ModelId model, const PlanePolygon& polygon) {
    const auto box_of = [&](const PlanePolygon& p) {
        Box3 box;
        for (const Vec3& v : points(planes_, p)) box.add(v);
        return box;
    };
    const Box3 whole = box_of(polygon);
    tree_->query(whole, near_);
    const Vec3 n = planes_.normal(polygon.support);
    const double d = planes_.distance(polygon.support);
    std::vector<Part> parts;
    std::vector<Box3> boxes; // of the parts
    std::vector<PlanePolygon> outside;
    for (const std::uint32_t i : near_) {
        Blocker& b = blockers_[i];
        if (b.model.valid() && b.model == model) continue;
        if (b.curve && !b.asked) {
            double lo = 1e300, hi = -1e300;
            for (const Vec3& p : b.corner) lo = std::min(lo, dot(n, p) - d), hi = std::max(hi, dot(n, p) - d);
            if (lo > 2 * kBehind || hi < -2 * kBehind) continue; // surely apart
            ask(b);
        }
        if (b.planes.empty()) continue;
        if (std::ranges::find(b.planes, polygon.support) != b.planes.end()) continue; // it looks away from the face, as the face does
        for (std::size_t p = 0, count = std::max<std::size_t>(parts.size(), 1); p < count; ++p) {
            if (!overlap(parts.empty() ? whole : boxes[p], b.box)) continue;
            PlanePolygon inside = parts.empty() ? polygon : parts[p].polygon;
            outside.clear();
            bool stands = true;
            for (const PlaneId q : b.planes) {
                if (q == flipped(polygon.support)) continue; // it stands on the face
                SplitPolygon halves = split(planes_, inside, q);
                if (halves.on || !halves.back) {
                    stands = false;
                    break;
                }
                if (halves.front) outside.push_back(std::move(*halves.front));
                inside = std::move(*halves.back);
            }
            if (!stands) continue;
            if (parts.empty()) parts.push_back({polygon, 0}), boxes.push_back(whole);
            const std::uint32_t under = parts[p].under;
            boxes[p] = box_of(inside), parts[p] = {std::move(inside), with(under, b.owner)};
            for (PlanePolygon& o : outside) boxes.push_back(box_of(o)), parts.push_back({std::move(o), under});
        }
    }
    return parts;
}

} // namespace kiln

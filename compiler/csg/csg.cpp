#include "compiler/csg/csg.h"
#include "compiler/csg/box_tree.h"
#include "compiler/csg/coverage.h"
#include "compiler/csg/editor_check.h"
#include "compiler/csg/input_planes.h"
#include "compiler/csg/merge_planes.h"
#include "compiler/csg/polytope.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace kiln {
namespace {

using namespace csg_detail;

// Moving a plane by the tolerance moves corners by more where planes meet at small angles. A brush whose box changes
// by more than this many tolerances keeps its own planes.
constexpr double kMaxCornerTolerances = 16;

// Finer grids would leave too small a world: 2^29 grid steps are 2^13 map units then.
constexpr int kMaxGridBits = 16;

std::array<PlaneId, 6> add_cube(PlaneTable& planes) {
    const auto half = static_cast<std::int64_t>(std::ldexp(kWorldHalfSize, planes.grid_bits));
    std::array<PlaneId, 6> cube;
    for (std::size_t k = 0; k < 3; ++k)
        for (const int sign : {-1, 1}) {
            ExactPlane p;
            (k == 0 ? p.a : k == 1 ? p.b : p.c) = sign;
            p.d = half;
            cube[2 * k + (sign > 0)] = planes.add(p);
        }
    return cube;
}

// The brush's sides with planes, each plane once. Faults are reported; false: the brush is to be left out.
bool collect_sides(const World& world, std::size_t b, const std::vector<InputSide>& input, PlaneTable& planes,
                   std::vector<SidePlane>& sides, Context& context) {
    const WorldBrush& brush = world.brushes[b];
    sides.clear();
    for (std::uint32_t s = brush.first_side; s < brush.first_side + brush.side_count; ++s) {
        if (input[s].out_of_range) {
            context.report(Severity::error, "coordinate-range",
                           fmt::format("a plane point lies beyond {} map units; the brush is left out", kWorldHalfSize / 2),
                           world.location(id<SideId>(s)));
            return false;
        }
        if (input[s].collinear) {
            context.report(Severity::error, "plane-collinear",
                           "the three plane points lie in one line; the brush is left out", world.location(id<SideId>(s)));
            return false;
        }
    }
    for (std::uint32_t s = brush.first_side; s < brush.first_side + brush.side_count; ++s) {
        if (!input[s].plane) continue; // redundant, found so before rounding
        const PlaneId plane = planes.add(*input[s].plane);
        bool twice = false;
        for (const SidePlane& other : sides) twice = twice || other.plane == plane;
        if (twice)
            context.report(Severity::note, "plane-duplicate", "another side of this brush has the same plane; this one is ignored",
                           world.location(id<SideId>(s)));
        else sides.push_back({plane, id<SideId>(s)});
    }
    if (brush.side_count < 4) {
        context.report(Severity::error, "brush-unbounded",
                       fmt::format("a brush of {} sides cannot be closed; it is left out", brush.side_count),
                       world.location(id<BrushId>(b)));
        return false;
    }
    return true;
}

void report_flaw(const World& world, std::size_t b, Flaw flaw, Context& context) {
    if (flaw == Flaw::unbounded)
        context.report(Severity::error, "brush-unbounded", "the sides do not enclose a volume: the brush is open; it is left out",
                       world.location(id<BrushId>(b)));
    else
        context.report(Severity::error, "brush-empty", "the sides enclose no volume (zero thickness, or facing inwards); the brush is left out",
                       world.location(id<BrushId>(b)));
}

// Gives moved sides their new planes and rebuilds their brushes; a brush that would lose a side keeps its own.
void apply_merge(Csg& csg, const std::vector<MergedSide>& merged, double tolerance, Context& context) {
    std::vector<char> kept(csg.brushes.size(), 0);
    parallel_for(context, csg.brushes.size(), [&](std::size_t b) {
        BrushPolytope& brush = csg.brushes[b];
        std::vector<SidePlane> sides;
        bool moved = false;
        for (std::size_t f = 0; f < brush.faces.size(); ++f) {
            const PlaneId plane = merged[brush.sides[f].at()].plane;
            moved = moved || plane != brush.faces[f].support;
            sides.push_back({plane, brush.sides[f]});
        }
        if (!moved) return;
        PolytopeResult rebuilt = build_polytope(csg.planes, csg.world_cube, sides);
        bool good = rebuilt.flaw == Flaw::none && rebuilt.polytope.faces.size() == brush.faces.size();
        for (std::size_t k = 0; good && k < 3; ++k)
            good = std::fabs(rebuilt.polytope.bounds.lo[k] - brush.bounds.lo[k]) <= kMaxCornerTolerances * tolerance &&
                   std::fabs(rebuilt.polytope.bounds.hi[k] - brush.bounds.hi[k]) <= kMaxCornerTolerances * tolerance;
        if (good) brush = std::move(rebuilt.polytope);
        else kept[b] = 1;
    });
    for (std::size_t b = 0; b < csg.brushes.size(); ++b) {
        csg.report.kept_brushes += kept[b];
        for (std::size_t f = 0; f < csg.brushes[b].faces.size(); ++f) {
            const MergedSide& m = merged[csg.brushes[b].sides[f].at()];
            if (kept[b] || m.move == 0) continue;
            ++csg.report.merged_planes;
            if (m.move > csg.report.largest_move) csg.report.largest_move = m.move, csg.report.largest_move_brush = id<BrushId>(b);
        }
    }
}

// For each brush those whose boxes come near its own: near enough for planes to merge, and to touch after that.
std::vector<std::vector<std::uint32_t>> find_near(const std::vector<BrushPolytope>& brushes, double tolerance,
                                                  Context& context) {
    std::vector<Box3> boxes(brushes.size());
    for (std::size_t b = 0; b < brushes.size(); ++b) boxes[b] = brushes[b].bounds; // invalid: empty
    const BoxTree tree(boxes);
    const double m = std::max(tolerance > 0 ? kMergeReach : 0, (2 * kMaxCornerTolerances + 1) * tolerance);
    std::vector<std::vector<std::uint32_t>> near(brushes.size());
    parallel_for(context, brushes.size(), [&](std::size_t b) {
        if (brushes[b].valid) tree.query({boxes[b].lo - Vec3{m, m, m}, boxes[b].hi + Vec3{m, m, m}}, near[b]);
    });
    return near;
}

void report_moves(const World& world, const CsgReport& r, Context& context) {
    if (r.rounded_sides)
        context.report(Severity::note, "off-grid",
                       fmt::format("{} sides have points off the 2^-{} grid; their planes were rounded, by at most {:.3g} map units over a face",
                                   r.rounded_sides, r.grid_bits, r.largest_rounding),
                       world.location(r.largest_rounding_side));
    if (r.merged_planes)
        context.report(Severity::note, "planes-merged",
                       fmt::format("{} sides were moved onto planes of others they all but lay in, or of whole map units, by at most {:.3g} map units over a "
                                   "face; {} brushes were left as they are lest they lose a side",
                                   r.merged_planes, r.largest_move, r.kept_brushes),
                       world.location(r.largest_move_brush));
}

} // namespace

Result<Csg> build_csg(const World& world, const CsgOptions& options, Context& context) {
    Csg csg;
    csg.planes.grid_bits = choose_grid_bits(world, std::clamp(options.grid_bits, 0, kMaxGridBits));
    csg.report.grid_bits = csg.planes.grid_bits;
    csg.world_cube = add_cube(csg.planes);

    const std::vector<InputSide> input = read_planes(world, csg.planes.grid_bits, context);
    std::vector<std::vector<SidePlane>> sides(world.brushes.size());
    for (std::size_t b = 0; b < world.brushes.size(); ++b)
        if (!collect_sides(world, b, input, csg.planes, sides[b], context)) sides[b].clear(), ++csg.report.invalid_brushes;

    csg.brushes.resize(world.brushes.size());
    std::vector<Flaw> flaws(world.brushes.size(), Flaw::none);
    parallel_for(context, world.brushes.size(), [&](std::size_t b) {
        if (sides[b].empty()) return;
        PolytopeResult r = build_polytope(csg.planes, csg.world_cube, sides[b]);
        flaws[b] = r.flaw, csg.brushes[b] = std::move(r.polytope);
    });
    std::size_t valid = 0;
    for (std::size_t b = 0; b < world.brushes.size(); ++b) {
        if (flaws[b] != Flaw::none) report_flaw(world, b, flaws[b], context), ++csg.report.invalid_brushes;
        if (!csg.brushes[b].valid) continue;
        ++valid;
        csg.report.redundant_sides += world.brushes[b].side_count - static_cast<std::uint32_t>(csg.brushes[b].faces.size());
        for (const SideId s : csg.brushes[b].sides) {
            const InputSide& in = input[s.at()];
            csg.report.rounded_sides += in.rounded;
            if (in.rounding > csg.report.largest_rounding || (in.rounded && !csg.report.largest_rounding_side.valid()))
                csg.report.largest_rounding = in.rounding, csg.report.largest_rounding_side = s;
        }
    }
    if (valid == 0)
        return fault(Exit::geometry, "nothing-to-compile",
                     world.brushes.empty() ? "the map has no brushes" : "none of the map's brushes encloses a volume",
                     {world.file});

    compare_with_editor(world, csg, context); // before planes are merged: that moves corners on purpose

    std::vector<char> integral(world.sides.size()), rounded(world.sides.size());
    for (std::size_t s = 0; s < integral.size(); ++s) integral[s] = input[s].integral, rounded[s] = input[s].rounded;
    const double tolerance = options.plane_merge_distance;
    const auto near = find_near(csg.brushes, tolerance, context);
    const std::vector<PlaneId> whole = planes_on_whole_units(csg.planes, csg.brushes, rounded, tolerance, context);
    apply_merge(csg, merge_planes(csg.planes, csg.brushes, near, integral, whole, tolerance, context), tolerance, context);
    report_moves(world, csg.report, context);

    csg.fragments = cut_fragments(world, csg.planes, csg.brushes, near, context);
    return csg;
}

void check_invariants(const Csg& csg, const World& world, Checker& checker) {
    Check &tables = checker.add("csg-tables"), &polygons = checker.add("polygons");
    tables.expect(csg.planes.planes.size() % 2 == 0, [&] { return Finding{{world.file}, "the plane table has no pairs"}; });
    if (!tables.expect(csg.brushes.size() == world.brushes.size(),
                       [&] { return Finding{{world.file}, fmt::format("{} polytopes stand for {} brushes", csg.brushes.size(), world.brushes.size())}; }))
        return;
    const auto sound = [&](const PlanePolygon& p, const SourceLocation& where) {
        const auto tell = [&](const char* what) { return [&, what] { return Finding{where, what}; }; };
        bool known = p.support.at() < csg.planes.planes.size();
        for (const PlaneId e : p.edges) known = known && e.at() < csg.planes.planes.size();
        if (!polygons.expect(known, tell("a polygon names a plane that does not exist")) || !polygons.expect(p.size() >= 3, tell("a polygon has fewer than three edges"))) return;
        for (std::size_t i = 0; i < p.size(); ++i) {
            const PlaneId before = p.edges[i == 0 ? p.size() - 1 : i - 1], after = p.edges[i];
            if (!polygons.expect(csg.planes.orientation(p.support, before, after) > 0, tell("a polygon does not turn left at a corner"))) return;
            for (const PlaneId e : p.edges)
                if (e != before && e != after && !polygons.expect(csg.planes.side(p.support, before, after, e) < 0, tell("a corner of a polygon is not behind all its edges")))
                    return;
        }
    };
    for (std::size_t b = 0; b < csg.brushes.size(); ++b) {
        const BrushPolytope& brush = csg.brushes[b];
        const auto tell = [&](const char* what) { return [&, what] { return Finding{world.location(id<BrushId>(b)), what}; }; };
        if (!tables.expect(brush.faces.size() == brush.sides.size(), tell("a polytope's faces do not match its sides"))) continue;
        tables.expect(brush.valid == !brush.faces.empty(), tell("a polytope is valid without faces, or has faces but is not"));
        if (brush.valid) tables.expect(brush.faces.size() >= 4, tell("a polytope has fewer than four faces"));
        for (std::size_t f = 0; f < brush.faces.size(); ++f) {
            tables.expect(brush.sides[f].value - world.brushes[b].first_side < world.brushes[b].side_count, tell("a face comes from a side of another brush"));
            sound(brush.faces[f], world.location(brush.sides[f]));
        }
    }
    for (std::size_t i = 0; i < csg.fragments.size(); ++i) {
        const Fragment& f = csg.fragments[i];
        if (!tables.expect(f.brush.at() < csg.brushes.size() && f.side.at() < world.sides.size(), [&] { return Finding{{world.file}, fmt::format("fragment {} names a brush or side that does not exist", i)}; }))
            continue;
        const SourceLocation where = world.location(f.side);
        const auto tell = [&](const char* what) { return [&, what] { return Finding{where, what}; }; };
        sound(f.polygon, where);
        tables.expect(csg.brushes[f.brush.at()].valid, tell("a fragment belongs to a brush that was left out"));
        tables.expect(f.model == world.brushes[f.brush.at()].model && f.behind == world.brushes[f.brush.at()].contents, tell("a fragment's model or contents are not its brush's"));
        if (f.covered) tables.expect(f.behind == Contents::solid && f.front == Contents::detail, tell("a fragment is covered, but not by detail"));
        if (i > 0) {
            const Fragment& e = csg.fragments[i - 1];
            tables.expect(e.model < f.model || (e.model == f.model && e.side <= f.side), tell("fragments are not sorted by model and side"));
        }
    }
}

void validate(const Csg& csg, const World& world) {
    Checker checker;
    check_invariants(csg, world, checker);
}

} // namespace kiln

#include "compiler/csg/editor_check.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace kiln::csg_detail {
namespace {

double distance_to_segment(Vec3 p, Vec3 a, Vec3 b) {
    const Vec3 e = b - a;
    const double size = dot(e, e);
    return length(p - (size > 0 ? a + e * std::clamp(dot(p - a, e) / size, 0.0, 1.0) : a));
}
// From corners to the outline they should lie on: an editor may keep corners on straight edges, or drop them.
double farthest(const std::vector<Vec3>& corners, const std::vector<Vec3>& outline, Vec3& at) {
    double most = 0;
    for (const Vec3& p : corners) {
        double least = HUGE_VAL;
        for (std::size_t i = 0; i < outline.size(); ++i)
            least = std::min(least, distance_to_segment(p, outline[i], outline[(i + 1) % outline.size()]));
        if (least > most) most = least, at = p;
    }
    return most;
}
double area_of(const std::vector<Vec3>& w) {
    Vec3 sum{};
    for (std::size_t i = 2; i < w.size(); ++i) sum += cross(w[i - 1] - w[0], w[i] - w[0]);
    return length(sum) / 2;
}

} // namespace

void compare_with_editor(const World& world, Csg& csg, Context& context) {
    struct Difference {
        double distance = -1; // not compared
        Vec3 at{};
    };
    std::vector<Difference> differences(world.sides.size());
    parallel_for(context, csg.brushes.size(), [&](std::size_t b) {
        const BrushPolytope& brush = csg.brushes[b];
        if (!brush.valid) return;
        const WorldBrush& source = world.brushes[b];
        for (std::uint32_t s = source.first_side; s < source.first_side + source.side_count; ++s) {
            const std::vector<Vec3>& seen = world.sides[s].editor_vertices;
            // What the editor saw as a line or a point need not be a face.
            if (seen.size() < 3 || area_of(seen) < kEditorMismatch) continue;
            Difference& d = differences[s];
            const auto face = std::ranges::find(brush.sides, id<SideId>(s));
            if (face == brush.sides.end()) { // no face at all: as far off as the seen one is large
                d = {std::sqrt(area_of(seen)), seen[0]};
                continue;
            }
            const std::vector<Vec3> exact = points(csg.planes, brush.faces[static_cast<std::size_t>(face - brush.sides.begin())]);
            Vec3 there{};
            d.distance = farthest(seen, exact, d.at);
            if (const double back = farthest(exact, seen, there); back > d.distance) d = {back, there};
        }
    });
    CsgReport& r = csg.report;
    Vec3 worst{};
    for (std::size_t s = 0; s < differences.size(); ++s) {
        const Difference& d = differences[s];
        if (d.distance < 0) continue;
        ++r.editor_sides;
        r.editor_mismatches += d.distance > kEditorMismatch;
        if (d.distance > r.largest_editor_mismatch)
            r.largest_editor_mismatch = d.distance, r.largest_editor_mismatch_side = id<SideId>(s), worst = d.at;
    }
    if (r.editor_mismatches > 0)
        context.report(Severity::note, "editor-vertices-differ",
                       fmt::format("{} of {} sides lie elsewhere than the corners the editor wrote beside their planes; the most, by {:.3g} map units, at ({:.6g} {:.6g} {:.6g})",
                                   r.editor_mismatches, r.editor_sides, r.largest_editor_mismatch, worst.x, worst.y, worst.z),
                       world.location(r.largest_editor_mismatch_side));
}

} // namespace kiln::csg_detail

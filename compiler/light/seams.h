// Seams: where two charts meet without an edge that is to be seen, both show the same light along it.
//
// A run time filters each chart by itself, so on a common edge two charts show what each makes of its own luxels and of the gutter
// around them. Here the texels that such an edge reads are fitted, as little as possible, until both sides show the same: flat
// light, and directional light for the same normals in the world.
//
// Source   M. Iwanicki, "Lighting Technology of The Last of Us", SIGGRAPH 2013 talks, for fitting texels to points along edges;
//          what is fitted, weighed and left alone is ours: NOTES.md
#pragma once
#include "compiler/light/field.h"
#include <array>
#include <cmath>

namespace kiln {

class Memo;

// Four texels (indices over all charts) and their weights: what a bilinear lookup reads, never outside the chart.
struct Bilinear {
    std::array<std::uint32_t, 4> texel{};
    std::array<double, 4> weight{};
};
Bilinear bilinear_at(std::uint32_t width, std::uint32_t height, Vec2 at); // of a grid of its own
Bilinear bilinear_at(const Chart& chart, Vec2 luxel);

struct SeamLine { // of an edge, in luxels
    Vec2 from, to;
};
// Per chart, its edges at which another one goes on, or the same one elsewhere.
std::vector<std::vector<SeamLine>> seam_lines(const Surfaces& surfaces);
// Places along a line, a sixteenth of a luxel apart at most, its ends with them.
template <class Visit> void walk(const SeamLine& line, const Visit& visit) {
    constexpr double kStep = 1.0 / 16; // luxels
    const Vec2 along = line.to - line.from;
    const auto steps = static_cast<int>(std::ceil(std::hypot(along.x, along.y) / kStep)) + 1;
    for (int k = 0; k <= steps; ++k) visit(line.from + along * (static_cast<double>(k) / steps));
}

// Fits the texels of `lighting` that seams read. `floor_share`: of the mean light, below which differences are not relative (error_floor).
// `memo` (begun): of an earlier bake of the same geometry.
void match_seams(const Surfaces& surfaces, const TraceScene& scene, double floor_share, Lighting* lighting, Context& context, Memo* memo = nullptr);

} // namespace kiln

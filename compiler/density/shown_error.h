// How far off is what a level shows? Luxels are means; between their middles filtering shows something else, on a coarser grid all the more. At
// random places of what is lit the light is asked for anew and held against what filtering shows there.
//
// In       surfaces, lighting as baked, the texels of the level; the field that other stages ask for light
// Out      percent, as an error of light (ErrorReport): root mean square over area, of the worst of the shading normal and, where light is
//          directional, three leaning ones; the likeliest, and what it lies below with 95 %. The encoding's own share is left out, and what the bounces and patches
//          are off by: whoever asks the field gets that too
// Errors   cancelled
// Method   three answers a place, each noisy by itself: the product of what the texels are away from two of them has none of their noise, and it is measured against the third
#pragma once
#include "compiler/density/density.h"
#include "compiler/light/field.h"
#include "compiler/light/memo.h"
#include <span>

namespace kiln {

// What bilinear filtering of a level's texels (of `lighting` itself, where `texels` has no grids) makes of flat light, and of the values stored for directional
// light where the chart has any, at a point of a face with a chart.
struct ShownTexels {
    Rgbd flat;
    std::array<Rgbd, 3> rnm{};
};
ShownTexels filtered_at(const Surfaces& surfaces, const Lighting& lighting, const Density& texels, FaceId face, Vec3 point);

struct ShownErrorOptions {
    std::uint32_t places = 4096;
    std::uint32_t rays = 32;   // of an answer; a power of two
    double error_floor = 0.02; // of the mean light: what is darker is measured against that much
    std::uint64_t seed = 0;
};
// What the mean of the squares lies below with 95 %, where they are told by products of noisy answers: one rare stroke in an answer makes a product far below nothing.
double most_mean_square(std::span<const double> square);

// `memo`: of an earlier run with the same surfaces: what rays met is taken over.
Result<ShownError> shown_error(const World& world, const Surfaces& surfaces, const Lighting& lighting, const Density& texels, const LightField& field,
                               const ShownErrorOptions& options, Context& context, Memo* memo = nullptr);

} // namespace kiln

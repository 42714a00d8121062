// Density: the light of each chart on the coarsest grid of texels that shows the same.
//
// The size of luxels that a map asks for is the finest there is. Where light varies less, fewer texels say the same: each
// chart gets the grid with the fewest texels found, chosen along both axes by itself, whose bilinear reconstruction differs from that of
// all its luxels by no more than a bound, wherever a face is. A face in even light gets one texel.
//
// In       surfaces, lighting: at full density, which both keep; of it the texels (light/shown.h)
// Out      the grids and their texels; a chart that no coarser grid fits keeps its luxels, gutter included
// Errors   none of its own
// Method   least squares of what is shown, checked at every place: NOTES.md
#pragma once
#include "compiler/light/light.h"
#include "compiler/light/memo.h"

namespace kiln {

struct DensityOptions {
    double error_percent = 2.5;  // most that what is shown may change by; 0: every chart keeps its luxels
    double error_floor = 0.02;   // of the scene mean: what is darker may change by as much as that much light
    template <class A> void fields(A& a) { a(error_percent, error_floor); }
};

// A grid of texels for a chart: texel coordinate = luxel coordinate * scale + shift, along each axis; texel (i,j) is centred at
// (i + .5, j + .5). Faces lie where bilinear filtering reads no texel but the grid's. An axis of one texel has a scale that
// brings all of the chart to the middle of it.
struct ChartGrid {
    static constexpr bool kRawBytes = true;
    Vec2 scale{1, 1}, shift;
    std::uint32_t width = 0, height = 0;
    std::uint32_t first_texel = 0; // into the arrays below
    std::uint32_t first_rnm = UINT32_MAX;
    bool operator==(const ChartGrid&) const = default;
};

inline Vec2 texel_from_luxel(const ChartGrid& g, Vec2 luxel) { return {luxel.x * g.scale.x + g.shift.x, luxel.y * g.scale.y + g.shift.y}; }

// How far off is what a level shows (shown_error.h)?
struct ShownError {
    double percent = 0, high = 0; // root mean square: the likeliest, and what it lies below with 95 %
    double p95 = 0;               // percent: flat light is off by less on 95 % of the area, the noise of three answers taken for error too. Few places are off by many times
                                  // their light and make the mean square
    std::uint32_t places = 0;     // looked at; 0: not known
    template <class A> void fields(A& a) { a(percent, high, p95, places); }
};

struct Density {
    std::vector<ChartGrid> grids; // per chart
    std::vector<Rgb> flat;        // per texel, as in Lighting
    std::vector<std::uint8_t> valid;
    std::vector<float> texel_error;
    std::vector<std::array<Rgb, 3>> rnm;
    double mean_change = 0; // percent: root mean square, over the area, of the change of what is shown, relative as the bound
    ShownError shown;
    template <class A> void fields(A& a) { a(grids, flat, valid, texel_error, rnm, mean_change, shown); }
};
// `memo`: of an earlier run with the same surfaces (light/memo.h): charts in the same light are taken over.
Result<Density> coarsen(const Surfaces& surfaces, const Lighting& lighting, const DensityOptions& options, Context& context, Memo* memo = nullptr);
// What a level holds: texels fitted to what filtering shows (light/shown.h), on such grids. With a bound of 0, none: luxels as they are baked.
Result<Density> level_texels(const Surfaces& surfaces, const Lighting& lighting, const DensityOptions& options, Context& context, Memo* memo = nullptr);
void validate(const Density& density, const Surfaces& surfaces, const Lighting& lighting);

} // namespace kiln

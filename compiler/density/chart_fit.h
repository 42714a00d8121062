// One chart: what its luxels show, and the coarsest grid found that shows the same. Private to the stage.
#pragma once
#include "compiler/density/density.h"
#include <optional>

namespace kiln {

// How a chart's light is shown: what may differ is the length of the difference of the stored values (dot: so that it holds for every
// normal, as the basis is orthonormal), or each by itself (sq, whose weights add up to 1; flat light alone).
enum class ShownBy : std::uint8_t { length, each };

// A chart's light between the centres of its luxels, sampled at half luxels, where it is bilinear in between. Row by row; vertex
// (i,j) is at luxel coordinates (i/2, j/2), quad (i,j) is between vertex (i,j) and (i+1,j+1).
struct ChartLight {
    std::uint32_t width = 0, height = 0;   // luxels
    std::size_t channels = 0;              // of a texel: flat r g b, or l0 r g b, l1 …, l2 …, and flat under the tilted encoding
    ShownBy shown_by = ShownBy::each;
    bool signed_values = false;            // dot
    std::vector<float> texels;             // [texel * channels + channel], those of no face filled
    std::vector<std::uint8_t> covered;     // per quad: 1 a face is there
    // Per vertex, r g b. What is shown may be off by all three together; over many luxels noise cancels, and with it what it allows.
    std::vector<float> allowed;            // what the light was bounded to
    std::vector<float> noise;              // four times the spread of what is noise in the luxels
    std::vector<float> guess;              // how far apart two guesses are of what no luxel was baked for
    std::vector<float> scale;              // what changes are measured against: flat light, or the floor
    Vec2 from, to;                         // luxel coordinates of all faces
    std::uint32_t vertices_x() const { return 2 * width + 1; }
    std::uint32_t vertices_y() const { return 2 * height + 1; }
};

struct ChartFit {
    std::uint32_t width = 0, height = 0;
    Vec2 scale, shift;
    std::vector<float> texels; // [texel * channels + channel]
    std::vector<std::uint8_t> read; // per texel: some face reads it
    double square = 0, weight = 0;  // sum of squares of the change over the scale, and of what it was summed over
};
// None: nothing with fewer texels than width * height was found.
std::optional<ChartFit> coarsest_fit(const ChartLight& light);

} // namespace kiln

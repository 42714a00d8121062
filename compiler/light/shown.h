// What is shown: texels whose bilinear filtering comes closest to the light, in place of the means that luxels are baked as.
//
// A luxel is the mean of the light over its footprint. Filtering takes it for the light at the middle of its square, and flattens what curves and
// what goes on to the rim of a face. Here texels are moved so that the mean of what is shown over a footprint is the luxel again.
//
// In       surfaces, lighting as baked: seams matched, gutters filled
// Out      lighting with other texels: encoding, flat, valid, texel_error, chart_directional, rnm_first, rnm; the rest is left out
// Errors   cancelled
// Source   least squares of what bilinear filtering shows, by one step of P. van Cittert, "Zum Einfluss der Spaltbreite auf die Intensitätsverteilung in
//          Spektrallinien II", Zeitschrift für Physik 69 (1931); why one, and how it is held: NOTES.md
#pragma once
#include "compiler/light/light.h"
#include <memory>

namespace kiln {

// What seams read stays as it was matched, what is dark all around stays dark, and what luxels differ by no more than their noise (`texel_error`) moves nothing. Flat light gets no
// brighter or darker than the luxels around it that go on from it; at rims by no more than half.
Result<Lighting> fit_shown(const Surfaces& surfaces, const Lighting& lighting, Context& context);

// The same chart by chart: a chart's texels depend on its own light, on where it was baked, and on which patches its pieces belong to.
class ShownFit {
public:
    ShownFit(const Surfaces& surfaces, const Lighting& lighting);
    ~ShownFit();
    static Lighting begun(const Lighting& lighting); // no chart is fitted yet
    void fit(std::size_t chart, Lighting& out) const; // any number of charts at once

private:
    class Fitting;
    std::unique_ptr<const Fitting> fitting_;
};

} // namespace kiln

// H = direct + F rho H by sweeps in double, in fixed order: the same for any number of threads. Private to light and
// its rivals.
//
// Source   Jacobi sweeps, each drawn out by what the one before has changed (Chebyshev's semi-iteration): G. Golub and R. Varga, "Chebyshev semi-iterative
//          methods, successive overrelaxation iterative methods, and second order Richardson iterative methods", Numerische Mathematik 3, 1961. As if the
//          spectrum ended at the mean reflectance, not at the largest: what little lies beyond fades hardly slower than by plain sweeps, all else much faster
#pragma once
#include "libs/core/context.h"
#include "libs/math/quick.h"
#include "libs/parallel/parallel.h"
#include <limits>
#include <vector>

namespace kiln {

constexpr double kQuickShare = 1e-6; // bound on the error, times 1 - the largest reflectance, from which on rows may be added up as QuickLight: that much bounces may make of their rounding

struct Bounces {
    std::vector<Rgbd> irradiance;
    std::uint32_t sweeps = 0; // before the last, which is a plain one
    double residual = 0;      // bound on the error of the result, residual / (1 - rho_max), as a share of its mean value
};
// Eight sweeps at a time, so that a lamp more or less hardly ever changes their number and with it the last digits everywhere, until that bound is at most `share`, or values pass `give_up`: rows may sum to more than 1 / rho and never settle.
// add_row(p, b, sum): adds the factors of row p times b, one a row, to `sum`, as T.
template <class T = Rgbd, class AddRow>
Bounces solve_bounces(const std::vector<Rgbd>& direct, const std::vector<Rgbd>& rho, double share, Context& context, const AddRow& add_row,
                      double give_up = std::numeric_limits<double>::infinity()) {
    constexpr std::uint32_t kMostSweeps = 5000, kAtOnce = 8;
    constexpr std::size_t kChunk = 256;
    const std::size_t n = direct.size(), chunks = (n + kChunk - 1) / kChunk;
    double rho_max = 0, rho_mean = 0;
    for (const Rgbd& r : rho) rho_max = std::max(rho_max, max_component(r)), rho_mean += max_component(r) / static_cast<double>(n);
    Bounces out;
    std::vector<Rgbd>& h = out.irradiance;
    h = direct;
    std::vector<Rgbd> next(n), before(n);
    std::vector<T> b(n);
    std::vector<double> change(chunks), total(chunks);
    double drawn_out = 1, last = std::numeric_limits<double>::infinity();
    bool settles = true; // where rows are so uneven that it does not, plain sweeps go on
    for (; out.sweeps < kMostSweeps; ++out.sweeps) {
        for (std::size_t p = 0; p < n; ++p) b[p] = T(rho[p] * h[p]);
        parallel_for(context, chunks, [&](std::size_t chunk) {
            change[chunk] = total[chunk] = 0;
            for (std::size_t p = chunk * kChunk; p < std::min(n, (chunk + 1) * kChunk); ++p) {
                T row{};
                add_row(p, b, row);
                const Rgbd sum = direct[p] + static_cast<Rgbd>(row), d = sum - h[p];
                change[chunk] = std::max({change[chunk], std::abs(d.x), std::abs(d.y), std::abs(d.z)});
                total[chunk] += max_component(sum);
                next[p] = sum;
            }
        });
        double r = 0, top = 0;
        for (std::size_t c = 0; c < chunks; ++c) r = std::max(r, change[c]), top += total[c] / static_cast<double>(n);
        out.residual = top > 0 ? r * rho_max / (1 - rho_max) / top : 0;
        const bool looked_at = out.sweeps % kAtOnce == kAtOnce - 1;
        if ((looked_at && out.residual <= share) || !(top < give_up) || out.sweeps + 1 == kMostSweeps) {
            for (std::size_t p = 0; p < n; ++p) // what was drawn out may come out below
                for (std::size_t c = 0; c < 3; ++c) h[p][c] = std::max(0.0, next[p][c]);
            break;
        }
        if (looked_at) settles = settles && r < last, last = r;
        if (out.sweeps > 0) drawn_out = 1 / (1 - rho_mean * rho_mean * (out.sweeps > 1 ? drawn_out / 4 : 0.5));
        if (settles && out.sweeps > 0)
            for (std::size_t p = 0; p < n; ++p) next[p] = before[p] + (next[p] - before[p]) * drawn_out;
        std::swap(before, h), std::swap(h, next);
    }
    return out;
}

} // namespace kiln

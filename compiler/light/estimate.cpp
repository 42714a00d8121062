// What the bake says of its own error.
//
// Source   upper bounds of skewed means: P. Hall, "Inverting an Edgeworth expansion", Annals of Statistics 11 (1983); of sums of
//          variances: F. A. Graybill and C.-M. Wang, "Confidence intervals on nonnegative linear combinations of variances",
//          J. American Statistical Association 75 (1980). What is measured, and what is not seen by it: NOTES.md
#include "compiler/light/bake.h"
#include "libs/parallel/parallel.h"
#include "libs/sampling/maps.h"
#include <mutex>
#include <numbers>
#include <numeric>

namespace kiln {
namespace {

constexpr std::size_t kWays = kQuarters - 1;
using Four = float __attribute__((vector_size(16))); // floats: they tell of noise, and most of the time here is reading them
struct Leaves { // of each colour what two quarters say against two, in each of the three ways there are: as noisy as the mean of all four. Or what all four say
    std::array<Four, 3> of{};
    Leaves& operator+=(const Leaves& o) {
        for (std::size_t c = 0; c < 3; ++c) of[c] += o.of[c];
        return *this;
    }
    Leaves operator*(float by) const { return {{of[0] * by, of[1] * by, of[2] * by}}; }
    Leaves operator*(Rgb by) const { return {{of[0] * by.x, of[1] * by.y, of[2] * by.z}}; }
};
static_assert(kQuarters == 4);
// The difference between patches of h and 2 h is 2^order - 1 times the error that those of h make. Where light is smooth the order is 2, where it jumps 1; between
// 2 h and 4 h it was found to grow 2 to 4 times: the estimate goes by 2, the upper bound by 1.
constexpr double kOrderTwo = 3, kOrderOne = 1; // 2^order - 1
// Three contrasts of quarters: an upper bound of a variance is 3 / (0.05 quantile of chi square with 3 degrees) times what they say.
constexpr double kUpperOfThree = 3 / 0.3518;
// A square of which the mean of replicates is taken, less what their noise adds to it, itself has this variance (normal noise): of twice its root times that mean's noise, of the square of
// that, and of what the spread of the replicates takes off.
double variance_of_measure(double square, double spread) {
    constexpr double n = kReplicates;
    return 4 * std::max(0.0, square) * spread / n + 2 * spread * spread / (n * n) + 2 * spread * spread / ((n - 1) * n * n);
}

} // namespace

// Squares of errors are skewed: a sample hardly ever has its share of the rare large ones, so their skewness moves the bounds (Hall), up most of all.
Bounds bounds_of_mean(std::span<const double> value, std::span<const double> weight, double sampled, double quantile, std::span<const double> measured) {
    const auto n = static_cast<double>(value.size());
    if (n < 2) return {};
    double all = 0, mean = 0, square = 0, cube = 0, measure = 0;
    for (std::size_t i = 0; i < value.size(); ++i) all += weight[i], mean += weight[i] * value[i];
    mean /= all;
    for (std::size_t i = 0; i < value.size(); ++i) {
        const double r = weight[i] * n / all * (value[i] - mean);
        square += r * r, cube += r * r * r;
        if (!measured.empty()) measure += weight[i] * n / all * (weight[i] * n / all) * measured[i] / n;
    }
    square /= n - 1, cube /= n;
    if (!(square > 0)) return {};
    const double skew = cube / (square * std::sqrt(square)), root = std::sqrt(n);
    const double se = std::sqrt((square * std::max(0.0, 1 - sampled) + std::min(square, measure) * sampled) / n);
    const double shift = skew * (2 * quantile * quantile + 1) / (6 * root);
    return {se * std::max(0.0, quantile + shift), se * std::max(0.0, quantile - shift)};
}

namespace {

// Normals that lean by the typical tilt, all around that of a luxel.
std::array<LuxelKernel, 6> tilted_kernels(const LuxelKernel& kernel) {
    std::array<LuxelKernel, 6> out;
    for (std::size_t k = 0; k < out.size(); ++k) {
        const SinCos turn = sincos_turns((static_cast<double>(k) + 0.5) / static_cast<double>(out.size()));
        out[k].frame = frame_around(kernel.frame.world({kTypicalTilt * turn.cos, kTypicalTilt * turn.sin, std::sqrt(1 - kTypicalTilt * kTypicalTilt)}));
    }
    return out;
}

} // namespace

// `encoding`: for what its encoding makes of other normals, too.
PilotGather Bake::pilot_gather(std::uint32_t l, const ReflectedLight& coarse, const ReflectedLight& close, bool rough, bool encoding, Looked* looked) const {
    Guide guide;
    const Luxel& luxel = surfaces_.luxels[l];
    const HemisphereMap map = map_of(luxel.chart);
    patch_guide(luxel_patch_[l], &guide);
    const LuxelKernel kernel = kernel_of(l);
    PilotGather out;
    for (std::uint32_t r = 0; r < kReplicates; ++r) {
        std::array<Other, 2> others{{{&coarse, {}}, {&close, {}}}};
        out.fine[r] = StoredSum(gather(l, kernel, guide, map, rays_[luxel_patch_[l]], mix(seed_at(luxel_centroid(luxel), 6), r), nullptr, std::span(others).first(rough ? 1 : 2), looked).sum);
        out.coarse[r] = StoredSum(others[0].sum), out.close[r] = StoredSum(others[1].sum);
    }
    if (!kernel.cone || surfaces_.charts[luxel.chart.at()].smooth || !encoding) return out;
    const auto along = [&](const LuxelKernel& k) { out.tilted.emplace_back(gather(l, k, guide, map, 64, seed_at(luxel_centroid(luxel), 8), nullptr, {}, looked).sum); };
    along(kernel);
    for (const LuxelKernel& k : tilted_kernels(kernel)) along(k);
    return out;
}

// One luxel of the pilot, with direct light.
PilotLuxel Bake::pilot_luxel(std::uint32_t l, const PilotGather& gathered, bool rough) const {
    const Luxel& luxel = surfaces_.luxels[l];
    const std::uint32_t p = luxel_patch_[l];
    const Footprint footprint = footprint_of_luxel(l);
    const LuxelKernel kernel = kernel_of(l);
    std::uint64_t shadow = 0;
    PilotLuxel result;
    result.shown = kernel.shown_count();
    KernelSum sum, rest; // rest: without direct light
    std::array<KernelSum, kReplicates> directs;
    for (std::uint32_t r = 0; r < kReplicates; ++r) {
        const std::uint64_t seed = mix(seed_at(luxel_centroid(luxel), 6), r);
        const KernelSum direct = directs[r] = direct_at(p, l, footprint, kernel, mix(seed, 1), &shadow);
        KernelSum fine = gathered.fine[r].sum(), coarse = gathered.coarse[r].sum(), close = gathered.close[r].sum();
        rest += fine;
        result.value[r] = kernel.displayed(kernel.shown(fine += direct));
        const auto away = [&](const KernelSum& other, std::array<Rgbd, 4>& by) {
            const std::array<Rgbd, 4> there = kernel.displayed(kernel.shown(other));
            for (std::size_t k = 0; k < 4; ++k) by[k] = there[k] - result.value[r][k];
        };
        away(coarse += direct, result.to_coarse[r]);
        if (!rough) away(close += direct_at(p, l, footprint, kernel, mix(seed, 2), &shadow, true), result.to_close[r]);
        sum += fine;
    }
    sum *= 1.0 / kReplicates, rest *= 1.0 / kReplicates;
    for (std::uint32_t r = 0; r < kReplicates; ++r) result.direct[r] = kernel.displayed(kernel.shown(KernelSum(rest) += directs[r])); // its spread is that of direct light
    result.mean_value = kernel.displayed(kernel.shown(sum));
    for (std::size_t k = 0; k < 4; ++k) // of both looks together: what only a close one sees is twice that at most
        for (const auto& away : result.to_close) result.mean_value[k] += away[k] * (0.5 / kReplicates);
    result.area = luxel.area * luxel_area(surfaces_, luxel.face);
    if (gathered.tilted.empty()) return result;
    // What the encoding makes of normals off the flat one, against the same rays summed for those normals.
    const auto light = [&](const LuxelKernel& k, const StoredSum& arriving) { return arriving.sum() += direct_at(p, l, footprint, k, seed_at(luxel_centroid(luxel), 9), &shadow); };
    const std::array<Rgb, 3> stored = kernel.finish(light(kernel, gathered.tilted[0]));
    const std::array<LuxelKernel, 6> tilted = tilted_kernels(kernel);
    for (std::size_t k = 0; k < tilted.size(); ++k) {
        const double truth = mean(light(tilted[k], gathered.tilted[k + 1]).flat), shown = mean(rnm_evaluate(kernel.encoding, stored, kernel.frame.local(tilted[k].frame.n)));
        const double scale = std::max(truth, floor_);
        if (scale > 0) result.representation += (shown - truth) * (shown - truth) / (scale * scale * static_cast<double>(tilted.size()));
    }
    return result;
}

// Is a patch there a single luxel?
bool Bake::of_luxels(const Luxel& luxel) const {
    return quality_.patch_size < 2 * surfaces_.charts[luxel.chart.at()].luxel_size;
}

// The coarse solution with direct light, too, as luxels of twice the size would show it: what smaller luxels would still change. Those of one patch are put together.
ReflectedLight Bake::coarse_luxels() const {
    ReflectedLight out = coarse_;
    parallel_chunks(context_, larger_.parts.size(), 256, [&](std::size_t first, std::size_t last) {
        std::vector<std::pair<std::array<std::uint32_t, 2>, std::uint32_t>> blocks; // of a coarse patch: column and row; luxel
        for (std::size_t c = first; c < last; ++c) {
            blocks.clear();
            for (const std::uint32_t p : larger_.parts[c])
                for (const std::uint32_t l : luxels_of(p)) {
                    const Luxel& luxel = surfaces_.luxels[l];
                    const std::uint32_t side = of_luxels(luxel) ? 1u << 16 : 2; // the coarse patch itself is no larger than two luxels
                    blocks.push_back({{luxel.x / side, luxel.y / side}, l});
                }
            std::ranges::sort(blocks);
            for (std::size_t i = 0, end = 0; i < blocks.size(); i = end) {
                while (end < blocks.size() && blocks[end].first == blocks[i].first) ++end;
                Rgbd sum;
                double area = 0;
                const auto texel = [&](std::size_t k) { return texel_of(surfaces_, surfaces_.luxels[blocks[k].second]); };
                for (std::size_t k = i; k < end; ++k) {
                    const Luxel& luxel = surfaces_.luxels[blocks[k].second];
                    const double a = luxel.area * luxel_area(surfaces_, luxel.face);
                    sum += static_cast<Rgbd>(out.direct[texel(k)]) * a, area += a;
                }
                if (!(area > 0)) continue;
                for (std::size_t k = i; k < end; ++k) {
                    const std::size_t t = texel(k);
                    out.texel[t] = static_cast<Rgb>(static_cast<Rgbd>(out.texel[t]) - static_cast<Rgbd>(out.direct[t]) + sum / area);
                    out.direct[t] = static_cast<Rgb>(sum / area);
                }
            }
        }
    });
    return out;
}

std::uint32_t Bake::pilot_share() const {
    const std::size_t luxels = surfaces_.luxels.size();
    return static_cast<std::uint32_t>(std::max<std::size_t>(1, luxels / std::clamp<std::size_t>(luxels / 25, 400, 1500)));
}

std::vector<std::uint32_t> Bake::drawn_luxels(std::uint32_t one_in, std::uint32_t which, std::size_t* all) const {
    std::vector<std::uint32_t> drawn;
    for (std::uint32_t l = 0; l < surfaces_.luxels.size(); ++l) {
        if (luxel_patch_[l] == kNoPatch || covered_[luxel_patch_[l]]) continue;
        if (all) ++*all;
        if (luxel_draw_[l] % one_in == which % one_in) drawn.push_back(l);
    }
    return drawn;
}

// Four independently scrambled replicates at a sample of luxels: their spread is the noise of one, with no
// reference needed; the same rays looked up in patches of twice the size show how much the patches still matter.
Bake::PilotResult Bake::pilot(std::uint32_t one_in, bool rough) {
    std::size_t all = 0;
    const std::vector<std::uint32_t> chosen = drawn_luxels(one_in, 0, &all);
    // Light of walls close by as if it changed much everywhere: asked for at the very place.
    std::optional<ReflectedLight> close; // where it is asked for
    std::once_flag once;
    const auto closely = [&]() -> const ReflectedLight& {
        std::call_once(once, [&] {
            close.emplace();
            if (!rough) *close = reflected_, std::ranges::fill(close->steep, std::uint8_t{1});
        });
        return *close;
    };
    if (memo_) note_states();
    std::vector<PilotLuxel> results(chosen.size());
    constexpr std::size_t kChunk = 8;
    parallel_chunks(context_, "light: pilot", chosen.size(), kChunk, [&](std::size_t begin, std::size_t end) {
        thread_local Looked looked;
        for (std::size_t i = begin; i < end; ++i) {
            const std::uint32_t l = chosen[i], p = luxel_patch_[l];
            const bool encoding = i % 4 == 0;
            const std::uint64_t key = memo_ ? key_of(p, mix(gather_key(p), l, pilots_, static_cast<std::uint64_t>(rough) | std::uint64_t{encoding} << 1)) : 0;
            PilotGather gathered;
            if (const auto kept = memo_ ? memo_->pilot.find(key, states_coarse_) : std::nullopt) {
                read_whole(*kept, gathered);
            } else {
                looked.begin(part_count());
                gathered = pilot_gather(l, rough ? coarse_ : coarse_luxels_, closely(), rough, encoding, memo_ ? &looked : nullptr);
                if (memo_) memo_->pilot.keep(key, states_coarse_, looked.parts(), to_bytes(gathered));
            }
            results[i] = pilot_luxel(l, gathered, rough);
        }
    });
    ++pilots_;
    PilotResult out;
    const auto spread = [](const auto& values, std::size_t normal, std::size_t c) {
        double m = 0, s = 0;
        for (const auto& v : values) m += v[normal][c] / kReplicates;
        for (const auto& v : values) s += (v[normal][c] - m) * (v[normal][c] - m) / (kReplicates - 1);
        return s;
    };
    // The square of a mean over replicates, without what their noise adds to it.
    const auto shift_of = [&](const auto& values, std::size_t normal, std::size_t c) {
        double m = 0;
        for (const auto& v : values) m += v[normal][c] / kReplicates;
        return m * m - spread(values, normal, c) / kReplicates;
    };
    std::vector<std::array<Rgbd, 4>> as_baked(rough ? 0 : chosen.size());
    for (std::size_t i = 0; i < as_baked.size(); ++i)
        if (gathered_there_[chosen[i]]) as_baked[i] = LuxelKernel::displayed(kernel_of(chosen[i]).shown(light_of(chosen[i])));
    double worst = -1;
    std::vector<double> squares, weights, measured; // measured: the variance of each as a measure
    for (std::size_t k = 0; k < 4; ++k) { // along each normal
        double area = 0;
        Rgbd mean_value;
        for (const PilotLuxel& r : results)
            if (k < r.shown) mean_value += r.mean_value[k] * r.area, area += r.area;
        if (!(area > 0)) continue;
        mean_value = mean_value / area;
        double noise = 0, bias = 0, shortcut = 0, direct = 0;
        squares.clear(), weights.clear(), measured.clear();
        for (std::size_t i = 0; i < results.size(); ++i) {
            const PilotLuxel& r = results[i];
            if (k >= r.shown) continue;
            const std::uint32_t l = chosen[i];
            const bool baked = !rough && gathered_there_[l];
            Rgbd apart;
            if (baked) {
                apart = as_baked[i][k];
                for (const auto& v : r.value) apart -= v[k] / static_cast<double>(kReplicates);
            }
            double variance = 0, shift = 0, short_by = 0, measure = 0; // measure: standard deviations of the channels, which go together
            for (std::size_t c = 0; c < 3; ++c) {
                const double scale = std::max(r.mean_value[k][c], options_.error_floor * mean_value[c]);
                if (!(scale > 0)) continue;
                const double per = 1 / (3 * scale * scale);
                // What the bake itself is off by, without the noise of what it is held against.
                const double scatter = spread(r.value, k, c), off = apart[c] * apart[c] - scatter / kReplicates;
                variance += per * (baked ? off : scatter);
                if (baked) measure += per * std::sqrt(variance_of_measure(off, scatter) + variance_of_measure(shift_of(r.to_close, k, c), spread(r.to_close, k, c)));
                direct += per * r.area * spread(r.direct, k, c);
                shift += per * shift_of(r.to_coarse, k, c) / (kOrderTwo * kOrderTwo);
                short_by += per * shift_of(r.to_close, k, c);
            }
            noise += variance * r.area, bias += shift * r.area, shortcut += short_by * r.area;
            squares.push_back(variance + shift + short_by), weights.push_back(r.area), measured.push_back(measure * measure);
        }
        noise = std::max(0.0, noise / area), bias = std::max(0.0, bias / area), shortcut = std::max(0.0, shortcut / area), direct /= area;
        const double most_bias = bias * (kOrderTwo * kOrderTwo / (kOrderOne * kOrderOne));
        const double square = noise + bias + shortcut;
        // Of 99 %: bounds of 95 % by the luxels drawn, which is no more than one of the things that may be off, cover in hardly 95 of 100 bakes.
        const Bounds b = bounds_of_mean(squares, weights, static_cast<double>(squares.size()) / static_cast<double>(std::max<std::size_t>(all, 1)), k99Percent, measured);
        out.above = std::max(out.above, square + b.above + most_bias - bias); // absolute until the worst is known
        if (square <= worst) continue;
        worst = square;
        out.square = square, out.below = std::min(square, b.below);
        out.noise = std::sqrt(noise), out.bias = std::sqrt(bias), out.shortcut = std::sqrt(shortcut);
        out.direct = std::sqrt(direct), out.gather = std::sqrt(std::max(0.0, noise - direct));
    }
    out.above = std::max(0.0, out.above - out.square);
    double shown = 0;
    for (const PilotLuxel& r : results)
        out.representation += r.representation * r.area, shown += r.representation > 0 ? r.area : 0;
    if (shown > 0) out.representation = std::sqrt(out.representation / shown);
    return out;
}

// By quarters of the rays of each row. A solution by one differs from the whole by what its rays tell of the light as it is, carried on over all bounces; that
// it would carry on by its own rows is second order.
double Bake::solution_noise() const {
    constexpr int kMostSweeps = 256;
    constexpr double kLeft = 0.1; // of the whole: what may be left of later bounces
    constexpr std::size_t kMostAsked = 4096; // patches, at the end
    const std::uint32_t m = quality_.row_rays, part = m / kQuarters;
    const std::size_t n = patches_.patches.size();
    std::vector<Rgb> rho, reflected;
    for (std::size_t p = 0; p < n; ++p) rho.push_back(patches_.patches[p].reflectance), reflected.push_back(rho[p] * static_cast<Rgb>(rest_[p] + solved_direct_[p]));
    constexpr std::size_t kChunk = 256;
    const std::size_t chunks = slots_of(n, kChunk);
    const auto each_patch = [&](const auto& body) {
        parallel_chunks(context_, n, kChunk, [&](std::size_t begin, std::size_t end) {
            for (auto p = static_cast<std::uint32_t>(begin); p < end; ++p) body(p, begin / kChunk);
        });
    };
    std::vector<Leaves> told(n);
    each_patch([&](std::uint32_t p, std::size_t) {
        Leaves arriving; // times the rays of a quarter
        for_met(p, [&](std::uint32_t code, const Quarters& met) {
            Rgb light = is_patch(code) ? reflected[code] : code == kHitEscaped ? static_cast<Rgb>(sky_ * std::numbers::pi) : Rgb{};
            if (const std::uint32_t emitter = emitter_of(code); emitter != UINT32_MAX && !listed(p, emitter)) light += static_cast<Rgb>(emitters_.emitters[emitter].radiance * std::numbers::pi);
            const Four rays{static_cast<float>(met.rays[0]), static_cast<float>(met.rays[1]), static_cast<float>(met.rays[2]), static_cast<float>(met.rays[3])};
            arriving += Leaves{{rays, rays, rays}} * light;
        });
        for_pane_rays(p, [&](std::uint64_t ray) {
            Rgb light = static_cast<Rgb>(emission_through_panes(ray, p, true) * std::numbers::pi);
            for (const PaneRays::Met& met : pane_rays_.of(ray))
                if (is_patch(met.code)) light += reflected[met.code] * met.reflected;
            for (std::size_t c = 0; c < 3; ++c) arriving.of[c][(ray - std::uint64_t{p} * m) / part] += light[c];
        });
        const float share = 0.25f / static_cast<float>(part);
        for (std::size_t c = 0; c < 3; ++c)
            for (std::size_t k = 0; k < kWays; ++k)
                for (std::size_t q = 0; q < kQuarters; ++q) told[p].of[c][k] += arriving.of[c][q] * (q == 0 || q == k + 1 ? share : -share);
    });
    // Most of such noise averages out at the first bounces; what all of a bright room has in common does not, and larger patches tell of that as well.
    const std::size_t larger = larger_.parts.size();
    std::vector<Leaves> all_told(larger), sum(larger), next(larger), leaving(larger);
    std::vector<Rgb> larger_rho(larger);
    for (std::size_t c = 0; c < larger; ++c)
        for (const std::uint32_t p : larger_.parts[c])
            if (larger_.area[c] > 0) {
                const auto share = static_cast<float>(patches_.patches[p].area / larger_.area[c]);
                all_told[c] += told[p] * share, larger_rho[c] += rho[p] * share;
            }
    double rho_max = 0;
    for (const Rgb& r : larger_rho) rho_max = std::max(rho_max, static_cast<double>(max_component(r)));
    const std::size_t larger_chunks = slots_of(larger, kChunk);
    std::vector<double> change(larger_chunks), all(larger_chunks);
    sum = all_told;
    for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
        for (std::size_t c = 0; c < larger; ++c) leaving[c] = sum[c] * larger_rho[c];
        change.assign(larger_chunks, 0), all.assign(larger_chunks, 0);
        parallel_chunks(context_, larger, kChunk, [&](std::size_t begin, std::size_t end) {
            for (std::size_t c = begin; c < end; ++c) {
                next[c] = all_told[c];
                for_row(larger_.rows, c, [&](std::uint32_t from, auto factor) {
                    if constexpr (std::is_same_v<decltype(factor), double>) next[c] += leaving[from] * static_cast<float>(factor);
                    else next[c] += leaving[from] * static_cast<Rgb>(factor);
                });
                for (std::size_t k = 0; k < 3; ++k) {
                    const Four now = next[c].of[k], d = now - sum[c].of[k];
                    for (std::size_t w = 0; w < kWays; ++w) change[begin / kChunk] += static_cast<double>(d[w]) * static_cast<double>(d[w]), all[begin / kChunk] += static_cast<double>(now[w]) * static_cast<double>(now[w]);
                }
            }
        });
        std::swap(sum, next);
        const double left = std::sqrt(std::accumulate(change.begin(), change.end(), 0.0)) * rho_max;
        if (left <= kLeft * (1 - rho_max) * std::sqrt(std::accumulate(all.begin(), all.end(), 0.0))) break;
    }
    // Of each patch what it leaves: its own noise, and what the bounces have made of that of all.
    for (std::size_t p = 0; p < n; ++p) {
        const std::uint32_t c = larger_.of[p];
        for (std::size_t k = 0; k < 3; ++k) told[p].of[k] += sum[c].of[k] - all_told[c].of[k];
        told[p] = told[p] * rho[p];
    }
    // What such a difference is in gathered light. By both halves of a row: their product has no share of the row's own noise.
    Rgbd level;
    double area = 0;
    for (std::uint32_t p = 0; p < n; ++p) {
        const double a = luxel_area_[p];
        level += (rest_[p] + solved_direct_[p]) * a, area += a;
    }
    if (!(area > 0)) return 0;
    level = level / area;
    // A part of many patches tells of all.
    const std::uint32_t one_in = static_cast<std::uint32_t>(std::clamp<std::size_t>(n / kMostAsked, 1, 16));
    std::vector<double> noise(chunks), asked(chunks);
    each_patch([&](std::uint32_t p, std::size_t chunk) {
        if (p % one_in) return;
        const double a = luxel_area_[p];
        if (!(a > 0)) return;
        asked[chunk] += a;
        if (covered_[p]) return;
        std::array<Leaves, 2> half{};
        for (std::uint64_t k = rows_.first[p]; k < rows_.first[p + 1]; ++k) {
            const auto& rays = met_[k].rays;
            for (std::size_t h = 0; h < 2; ++h)
                if (const auto count = static_cast<float>(rays[2 * h] + rays[2 * h + 1]); count > 0) half[h] += told[rows_.patch[k]] * count;
        }
        for_pane_rays(p, [&](std::uint64_t ray) {
            for (const PaneRays::Met& met : pane_rays_.of(ray))
                if (is_patch(met.code)) half[(ray - std::uint64_t{p} * m) * 2 / m] += told[met.code] * met.reflected;
        });
        const Rgbd now = rest_[p] + solved_direct_[p];
        for (std::size_t c = 0; c < 3; ++c) {
            const double scale = std::max(now[c], options_.error_floor * level[c]) * m / 2;
            for (std::size_t k = 0; k < kWays && scale > 0; ++k) noise[chunk] += a * static_cast<double>(half[0].of[c][k]) * static_cast<double>(half[1].of[c][k]) / (scale * scale) / (3.0 * kWays);
        }
    });
    const double of = std::accumulate(asked.begin(), asked.end(), 0.0);
    return of > 0 ? std::sqrt(std::max(0.0, std::accumulate(noise.begin(), noise.end(), 0.0) / of)) : 0;
}

ErrorReport Bake::error_report(const PilotResult& check, double solution) const {
    ErrorReport e;
    e.target = options_.error_percent;
    e.noise = 100 * check.noise, e.patch_bias = 100 * check.bias, e.iteration = 100 * residual_;
    e.shortcuts = 100 * check.shortcut, e.solution = 100 * solution;
    e.representation = 100 * check.representation;
    const double square = check.square + solution * solution + residual_ * residual_;
    // Of a sum of independent parts: bounds add as squares of what they are away (Graybill and Wang).
    const double above = std::hypot(check.above, (kUpperOfThree - 1) * solution * solution);
    e.estimate = 100 * std::sqrt(square);
    e.low = 100 * std::sqrt(std::max(0.0, square - check.below)), e.high = 100 * std::sqrt(square + above);
    return e;
}

} // namespace kiln

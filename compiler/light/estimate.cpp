// What the bake says of its own error.
#include "compiler/light/bake.h"
#include "libs/parallel/parallel.h"
#include "libs/sampling/maps.h"

namespace kiln {

// Four independently scrambled replicates at a sample of luxels: their spread is the noise of one, with no
// reference needed; the same rays looked up in patches of twice the size show how much the patches still matter.
Bake::PilotResult Bake::pilot(std::uint32_t one_in) {
    constexpr std::uint32_t kReplicates = 4;
    constexpr int kNormals = 6;
    std::vector<std::uint32_t> chosen;
    for (std::uint32_t l = 0; l < surfaces_.luxels.size(); ++l)
        if (luxel_patch_[l] != kNoPatch && !covered_[luxel_patch_[l]] &&
            seed_at(luxel_centroid(surfaces_.luxels[l]), 5) % one_in == 0)
            chosen.push_back(l);
    struct Result {
        // Along the normals of LuxelKernel::shown, direct light included.
        std::array<std::array<Rgbd, 4>, kReplicates> value{}, direct{}, to_coarse{};
        std::array<Rgbd, 4> mean_value{};
        std::size_t shown = 1;
        double area = 0, representation = 0;
    };
    std::vector<Result> results(chosen.size());
    constexpr std::size_t kChunk = 8;
    parallel_for(context_, "light: pilot", (chosen.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
        Guide guide;
        for (std::size_t i = chunk * kChunk; i < std::min(chosen.size(), (chunk + 1) * kChunk); ++i) {
            const std::uint32_t l = chosen[i];
            const Luxel& luxel = surfaces_.luxels[l];
            const Chart& chart = surfaces_.charts[luxel.chart.at()];
            const HemisphereMap map = map_of(l);
            patch_guide(luxel_patch_[l], map, &guide);
            const Footprint footprint = footprint_of_luxel(l);
            const LuxelKernel kernel = kernel_of(l);
            Result& result = results[i];
            result.shown = kernel.shown_count();
            KernelSum sum;
            for (std::uint32_t r = 0; r < kReplicates; ++r) {
                const std::uint64_t seed = mix(seed_at(luxel_centroid(luxel), 6), r);
                KernelSum coarse, direct;
                KernelSum fine = gather(l, kernel, guide, map, rays_[luxel_patch_[l]], seed, nullptr, &coarse_, &coarse).sum;
                std::uint64_t shadow = 0;
                direct_at(footprint, luxel_patch_[l], mix(seed, 1), kernel, &direct, &shadow, nullptr, nullptr);
                fine += direct, coarse += direct;
                result.value[r] = kernel.shown(fine), result.direct[r] = kernel.shown(direct);
                const std::array<Rgbd, 4> other = kernel.shown(coarse);
                for (std::size_t k = 0; k < 4; ++k) result.to_coarse[r][k] = other[k] - result.value[r][k];
                sum += fine;
            }
            sum *= 1.0 / kReplicates;
            result.mean_value = kernel.shown(sum);
            results[i].area = luxel.area * luxel_area(surfaces_, luxel.face);
            if (!kernel.cone || chart.smooth || i % 4 != 0) continue;
            // What the encoding makes of normals off the flat one, against the same rays summed for those normals.
            const auto light = [&](const LuxelKernel& k) {
                KernelSum arriving = gather(l, k, guide, map, 64, seed_at(luxel_centroid(luxel), 8), nullptr).sum;
                std::uint64_t shadow = 0;
                direct_at(footprint, luxel_patch_[l], seed_at(luxel_centroid(luxel), 9), k, &arriving, &shadow, nullptr, nullptr);
                return arriving;
            };
            const KernelSum base = light(kernel);
            const std::array<Rgb, 3> stored = kernel.finish(base);
            for (int k = 0; k < kNormals; ++k) {
                const SinCos turn = sincos_turns((k + 0.5) / kNormals);
                const Vec3 n{kTypicalTilt * turn.cos, kTypicalTilt * turn.sin, std::sqrt(1 - kTypicalTilt * kTypicalTilt)};
                const Vec3 world = kernel.frame.world(n);
                LuxelKernel tilted;
                tilted.frame = frame_around(world);
                const double truth = mean(light(tilted).flat),
                             shown = mean(rnm_evaluate(kernel.encoding, stored, n));
                const double scale = std::max(truth, floor_);
                if (scale > 0)
                    results[i].representation += (shown - truth) * (shown - truth) / (scale * scale * kNormals);
            }
        }
    });
    PilotResult out;
    const auto spread = [](const auto& values, std::size_t normal, std::size_t c) {
        double m = 0, s = 0;
        for (const auto& v : values) m += v[normal][c] / kReplicates;
        for (const auto& v : values) s += (v[normal][c] - m) * (v[normal][c] - m) / (kReplicates - 1);
        return s;
    };
    double worst = -1;
    for (std::size_t k = 0; k < 4; ++k) { // along each normal
        double area = 0;
        Rgbd mean_value;
        for (const Result& r : results)
            if (k < r.shown) mean_value += r.mean_value[k] * r.area, area += r.area;
        if (!(area > 0)) continue;
        mean_value = mean_value / area;
        double noise = 0, noise2 = 0, bias = 0, bias2 = 0, direct = 0, n = 0;
        for (const Result& r : results) {
            if (k >= r.shown) continue;
            double variance = 0, shift = 0;
            for (std::size_t c = 0; c < 3; ++c) {
                const double scale = std::max(r.mean_value[k][c], options_.error_floor * mean_value[c]);
                if (!(scale > 0)) continue;
                variance += spread(r.value, k, c) / (scale * scale) / 3;
                direct += r.area * spread(r.direct, k, c) / (scale * scale) / 3;
                // Error falls with the square of the patch size: the difference to twice the size is three times it. The
                // noise of the difference makes its square too large by that of the mean.
                double d = 0;
                for (const auto& v : r.to_coarse) d += v[k][c] / kReplicates;
                shift += (d * d - spread(r.to_coarse, k, c) / kReplicates) / (9 * scale * scale) / 3;
            }
            noise += variance * r.area, noise2 += variance * variance * r.area;
            bias += shift * r.area, bias2 += shift * shift * r.area;
            ++n;
        }
        noise /= area, bias = std::max(0.0, bias / area), direct /= area;
        if (noise + bias <= worst) continue;
        worst = noise + bias;
        out.noise = std::sqrt(noise), out.bias = std::sqrt(bias);
        out.direct = std::sqrt(direct), out.gather = std::sqrt(std::max(0.0, noise - direct));
        out.noise_se = std::sqrt(std::max(0.0, noise2 / area - noise * noise) / n);
        out.bias_se = std::sqrt(std::max(0.0, bias2 / area - bias * bias) / n);
    }
    double shown = 0;
    for (const Result& r : results)
        out.representation += r.representation * r.area, shown += r.representation > 0 ? r.area : 0;
    if (shown > 0) out.representation = std::sqrt(out.representation / shown);
    return out;
}

} // namespace kiln

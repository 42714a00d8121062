#include "tools/light_bench/measure.h"
#include "compiler/density/shown_error.h"
#include "compiler/light/bake.h"
#include "compiler/light/seams.h"
#include "libs/core/file.h"
#include "libs/core/process.h"
#include "libs/parallel/parallel.h"
#include "libs/sampling/maps.h"
#include <algorithm>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <malloc.h>
#include <numbers>
#include <numeric>
#include <optional>

namespace kiln::bench {
namespace {

using rivals::Irradiance;
constexpr std::uint32_t kTruthVersion = 1; // raise it when what is kept means something else

// `count` luxels drawn by the area of their footprints.
std::vector<std::uint32_t> draw_luxels(std::span<const std::uint32_t> shown, std::span<const rivals::Receiver> receivers, std::uint32_t count) {
    std::vector<double> cumulative;
    double area = 0;
    for (const rivals::Receiver& r : receivers) cumulative.push_back(area += r.footprint.area());
    std::vector<std::uint32_t> out;
    Random random(5);
    for (std::uint32_t i = 0; i < count && area > 0; ++i) { // one in each of equal strata
        const auto at = std::ranges::lower_bound(cumulative.begin(), cumulative.end() - 1, area * (i + random()) / count) - cumulative.begin();
        out.push_back(shown[static_cast<std::size_t>(at)]);
    }
    return out;
}

// A place in each, drawn by area.
std::vector<Vec3> places_in(std::span<const rivals::Receiver> receivers) {
    std::vector<Vec3> out;
    for (const rivals::Receiver& r : receivers) {
        Random random(mix(std::uint64_t{77}, out.size()));
        const double u = random(), v = random();
        out.push_back(r.footprint.sample({u, v}).position);
    }
    return out;
}

// Peak memory since the last reset, kB; 0 where the system does not tell.
double status_kb(const char* key) {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.starts_with(key)) return std::stod(line.substr(std::string(key).size()));
    return 0;
}
void reset_peak() {
    malloc_trim(0);
    std::ofstream("/proc/self/clear_refs") << "5";
}

// Rays by the cosine from points on lit surfaces, in bundles as the bake shoots them.
double calibrate(const rivals::Scene& scene, std::span<const rivals::Receiver> receivers) {
    if (receivers.empty()) return 0;
    constexpr std::uint32_t kBundle = 256, kBundles = 1200;
    std::vector<Vec3> origins, ways;
    for (std::uint32_t b = 0; b < kBundles; ++b) {
        const rivals::Receiver& r = receivers[b % receivers.size()];
        const Sobol points(b);
        const Frame frame = frame_around(r.normal);
        for (std::uint32_t i = 0; i < kBundle; ++i) {
            origins.push_back(r.point + r.normal * scene.trace().push_off());
            ways.push_back(frame.world(cosine_hemisphere(points.pair(i, 0))));
        }
    }
    std::vector<std::optional<SceneHit>> hits(kBundle);
    const double start = cpu_seconds();
    for (int repeat = 0; repeat < 3; ++repeat)
        for (std::size_t b = 0; b < kBundles; ++b) scene.trace().closest(std::span(origins).subspan(b * kBundle, kBundle), std::span(ways).subspan(b * kBundle, kBundle), hits);
    return 3.0 * kBundle * kBundles / (cpu_seconds() - start);
}

// Of per(luxel, direction, channel) / floor, per luxel: its square, the mean of the channels.
template <class Per> std::vector<double> squares_of(const Truth& truth, std::size_t d, const Per& per) {
    const std::size_t n = truth.value.size();
    std::vector<double> out(n);
    for (std::size_t c = 0; c < 3; ++c) {
        double level = 0;
        for (const Irradiance& e : truth.value) level += e[d][c] / static_cast<double>(n);
        if (!(level > 0)) continue; // no light of this colour
        for (std::size_t i = 0; i < n; ++i) out[i] += std::pow(per(i, d, c) / std::max(truth.value[i][d][c], 0.02 * level), 2) / 3;
    }
    return out;
}
double percent_of(std::span<const double> squares) {
    return squares.empty() ? 0 : 100 * std::sqrt(std::accumulate(squares.begin(), squares.end(), 0.0) / static_cast<double>(squares.size()));
}
template <class Per> std::array<double, 4> root_mean_square(const Truth& truth, const Per& per) {
    std::array<double, 4> out{};
    for (std::size_t d = 0; d < 4; ++d) out[d] = percent_of(squares_of(truth, d, per));
    return out;
}
std::array<double, 4> noise_of(const Truth& truth) {
    return root_mean_square(truth, [&](std::size_t i, std::size_t d, std::size_t c) { return truth.error[i][d][c]; });
}

// Where every surface of a closed scene sends the same radiance, E / (1 - albedo), that is what arrives from everywhere: no paths know it as well.
std::optional<Rgbd> radiance_everywhere(const LightScene& in, const rivals::Scene& scene) {
    const bool closed = std::ranges::any_of(in.bsp.leaves, &BspLeaf::outside);
    if (!closed || !in.lights.empty() || scene.trace().has_panes()) return std::nullopt;
    std::optional<Rgbd> all;
    for (const Face& face : in.surfaces.faces) {
        if (!face.drawn || face.sky) return std::nullopt; // takes light away
        const Material& m = in.world.materials[face.material.at()];
        Rgbd sent;
        for (std::size_t c = 0; c < 3; ++c) sent[c] = static_cast<double>(m.emission[c]) / (1 - static_cast<double>(m.reflectance[c]));
        if (!all) all = sent;
        for (std::size_t c = 0; c < 3; ++c)
            if (!(std::abs(sent[c] - (*all)[c]) <= 1e-6 * (*all)[c])) return std::nullopt; // as exact as what files state
    }
    return all;
}

// What bilinear filtering of a level's texels shows at the places of truth.
std::vector<Irradiance> shown_at(const Surfaces& surfaces, const Lighting& lighting, const Truth& truth, const Density& texels) {
    std::vector<Irradiance> out;
    for (std::size_t i = 0; i < truth.luxels.size(); ++i) {
        const ShownTexels read = filtered_at(surfaces, lighting, texels, surfaces.luxels[truth.luxels[i]].face, truth.places[i]);
        out.push_back({read.flat, read.rnm[0], read.rnm[1], read.rnm[2]}); // `tilted`: irradiance along the basis
    }
    return out;
}

} // namespace

Result<Truth> find_truth(const LightScene& in, const TruthSettings& settings, Context& context) {
    ByteWriter key;
    key(kTruthVersion, hash_of(in.surfaces), hash_of(in.world.materials), hash_of(in.lights), settings.points, settings.paths, settings.replicates, settings.most_rounds,
        settings.noise_percent);
    if (settings.shown) key(settings.shown);
    const std::string file = settings.cache.empty() ? "" : fmt::format("{}/{}.{}.truth", settings.cache, in.name, to_hex(hash_bytes(key.bytes)));
    const rivals::Scene scene(in.world, in.surfaces, in.lights);
    const std::optional<Rgbd> everywhere = radiance_everywhere(in, scene);
    if (std::error_code ignored; !everywhere && !file.empty() && std::filesystem::exists(file, ignored)) {
        if (const auto bytes = read_file(file)) {
            try {
                Truth kept = from_bytes<Truth>(*bytes);
                if (settings.shown) kept.places = places_in(rivals::receivers_of(scene, kept.luxels));
                return kept;
            } catch (const ArchiveError&) { // cut short: as good as absent
            }
        }
    }
    const std::vector<std::uint32_t> shown = rivals::shown_luxels(scene, context);
    Truth truth;
    truth.shown = static_cast<std::uint32_t>(shown.size());
    truth.luxels = draw_luxels(shown, rivals::receivers_of(scene, shown), settings.points);
    std::vector<rivals::Receiver> receivers = rivals::receivers_of(scene, truth.luxels);
    if (settings.shown) {
        truth.places = places_in(receivers);
        for (std::size_t i = 0; i < receivers.size(); ++i) receivers[i].point = truth.places[i], receivers[i].footprint = Footprint();
    }
    const std::size_t n = receivers.size();
    truth.value.resize(n), truth.error.resize(n);
    if (everywhere) {
        for (std::size_t i = 0; i < n; ++i)
            for (std::size_t d = 0; d < 4; ++d) truth.value[i][d] = *everywhere * (std::numbers::pi * (1 + dot(receivers[i].directions[d], receivers[i].normal)) / 2);
        return truth;
    }
    std::vector<Irradiance> sum(n), square(n);
    double count = 0;
    for (std::uint32_t round = 0; round < settings.most_rounds; ++round) {
        for (std::uint32_t k = 0; k < settings.replicates; ++k) {
            const auto method = rivals::path_tracing(scene, {.paths = settings.paths, .seed = 1000 + round * settings.replicates + k});
            const std::vector<Irradiance> got = method->light(receivers, context);
            for (std::size_t i = 0; i < n; ++i)
                for (std::size_t d = 0; d < 4; ++d) sum[i][d] += got[i][d], square[i][d] += got[i][d] * got[i][d];
            ++count;
        }
        truth.paths += std::uint64_t{settings.replicates} * settings.paths;
        for (std::size_t i = 0; i < n; ++i)
            for (std::size_t d = 0; d < 4; ++d) {
                truth.value[i][d] = sum[i][d] / count;
                for (std::size_t c = 0; c < 3; ++c)
                    truth.error[i][d][c] = std::sqrt(std::max(0.0, square[i][d][c] / count - std::pow(truth.value[i][d][c], 2)) / (count - 1));
            }
        if (std::ranges::max(noise_of(truth)) <= settings.noise_percent) break;
    }
    if (!file.empty()) {
        std::error_code ignored;
        std::filesystem::create_directories(settings.cache, ignored);
        if (auto written = write_file(file, to_bytes(truth)); !written) return written.fault();
    }
    return truth;
}

Errors compare(const Truth& truth, std::span<const Irradiance> values, std::size_t directions) {
    Errors e;
    e.noise = noise_of(truth);
    const auto off = [&](std::size_t i, std::size_t d, std::size_t c) { return values[i][d][c] - truth.value[i][d][c]; };
    e.rrmse = root_mean_square(truth, off);
    std::size_t worst = 0;
    for (std::size_t d = 0; d < directions; ++d) {
        double got = 0, want = 0;
        for (std::size_t i = 0; i < truth.value.size(); ++i) got += mean(values[i][d]), want += mean(truth.value[i][d]);
        e.bias[d] = want > 0 ? 100 * (got / want - 1) : 0;
        e.rrmse[d] = std::sqrt(std::max(0.0, e.rrmse[d] * e.rrmse[d] - e.noise[d] * e.noise[d]));
        if (e.rrmse[d] >= e.worst) e.worst = e.rrmse[d], e.worst_noise = e.noise[d], worst = d;
    }
    const std::size_t n = truth.value.size();
    const Bounds b = bounds_of_mean(squares_of(truth, worst, off), std::vector<double>(n, 1.0), static_cast<double>(n) / static_cast<double>(std::max<std::size_t>(truth.shown, n)));
    e.least = std::sqrt(std::max(0.0, e.worst * e.worst - 1e4 * b.below)), e.most = std::sqrt(e.worst * e.worst + 1e4 * b.above);
    double level = 0;
    for (const Irradiance& v : truth.value) level += mean(v[0]) / static_cast<double>(truth.value.size());
    std::vector<double> relative;
    for (std::size_t i = 0; i < truth.value.size(); ++i)
        relative.push_back(100 * std::abs(mean(values[i][0]) - mean(truth.value[i][0])) / std::max({mean(truth.value[i][0]), 0.02 * level, 1e-300}));
    std::ranges::sort(relative);
    if (!relative.empty()) e.p95 = relative[relative.size() * 95 / 100];
    return e;
}

Measurement measure_bake(const LightScene& in, const Truth& truth, double target, Context& context, std::uint64_t seed, bool flat) {
    Measurement m;
    m.scene = in.name, m.method = flat ? kFlatMethod : "kiln", m.setting = fmt::format("--error {:g}", target), m.target = target;
    m.luxels = m.lit = truth.shown;
    // Before and after: what else runs on the machine slows both alike.
    const auto calibrated = [&] {
        const rivals::Scene scene(in.world, in.surfaces, in.lights);
        return calibrate(scene, rivals::receivers_of(scene, truth.luxels));
    };
    m.calibration = calibrated();
    // Irradiance along the basis vectors is what can be compared; all luxels directional is the dearest there is.
    LightOptions options;
    options.error_percent = target, options.encoding = RnmEncoding::tilted, options.directional = flat ? Directional::none : Directional::all, options.seed = seed;
    options.match_seams = !truth.places.empty(); // a texel fitted for what is shown is not the mean of its luxel, which truth is
    reset_peak();
    const double before = status_kb("VmRSS:"), start = cpu_seconds();
    const std::uint64_t traced = TraceScene::traced();
    const Result<Lighting> baked = bake_light(in.world, in.bsp, in.bsp.planes, in.surfaces, in.lights, options, context);
    m.cpu_s = cpu_seconds() - start;
    m.peak_mb = std::max(0.0, status_kb("VmHWM:") - before) / 1024;
    if (!baked) {
        m.skipped = baked.fault().diagnostic.message;
        return m;
    }
    m.calibration = (m.calibration + calibrated()) / 2;
    m.rays = static_cast<double>(baked->rays);
    if (context.threads == 1) m.traced = static_cast<double>(TraceScene::traced() - traced);
    m.estimate = baked->error.estimate, m.low = baked->error.low, m.high = baked->error.high;
    m.own_noise = std::hypot(baked->error.noise, baked->error.solution), m.own_bias = std::hypot(baked->error.patch_bias, baked->error.shortcuts);
    if (truth.places.empty()) {
        for (const std::uint32_t l : truth.luxels) {
            const Luxel& luxel = in.surfaces.luxels[l];
            const Chart& chart = in.surfaces.charts[luxel.chart.at()];
            const std::uint32_t in_chart = luxel.y * chart.width + luxel.x;
            Irradiance e{static_cast<Rgbd>(baked->flat[chart.first_texel + in_chart])};
            for (std::size_t k = 0; !flat && k < 3; ++k) e[k + 1] = static_cast<Rgbd>(baked->rnm[baked->rnm_first[luxel.chart.at()] + in_chart][k]);
            m.values.push_back(e);
        }
    } else {
        const Result<Density> texels = level_texels(in.surfaces, *baked, {.error_percent = target / 2}, context); // the bound that a build has
        if (!texels) {
            m.skipped = texels.fault().diagnostic.message;
            return m;
        }
        m.values = shown_at(in.surfaces, *baked, truth, *texels);
        const LightField field(in.world, in.bsp, in.bsp.planes, in.surfaces, in.lights, *baked);
        const Result<ShownError> own = shown_error(in.world, in.surfaces, *baked, *texels, field, {.seed = seed}, context);
        if (!own) {
            m.skipped = own.fault().diagnostic.message;
            return m;
        }
        m.estimate = own->percent, m.high = own->high, m.low = 0;
    }
    m.errors = compare(truth, m.values, flat ? 1 : 4);
    return m;
}

Seeds compare_seeds(const Truth& truth, std::span<const Measurement> runs) {
    Seeds out;
    const auto n = static_cast<double>(runs.size());
    for (const Measurement& m : runs) {
        ++out.runs;
        out.likely_over += m.errors.least > m.high;
        out.least += m.errors.least * m.errors.least / n, out.most += m.errors.most * m.errors.most / n;
        out.within_estimate += m.errors.worst <= m.estimate, out.within_high += m.errors.worst <= m.high, out.within_target += m.errors.worst <= m.target;
        out.error += m.errors.worst * m.errors.worst / n, out.estimate += m.estimate * m.estimate / n, out.high += m.high * m.high / n;
        out.own_noise += m.own_noise * m.own_noise / n, out.own_bias += m.own_bias * m.own_bias / n;
        const auto over = [&](double told) { return told > 0 ? m.errors.worst / told : m.errors.worst > 0 ? std::numeric_limits<double>::infinity() : 0.0; };
        out.over_estimate = std::max(out.over_estimate, over(m.estimate)), out.over_high = std::max(out.over_high, over(m.high));
        out.cpu_s += m.cpu_s / n, out.rays += m.rays / n;
        for (std::size_t d = 0; d < 4; ++d) out.bias[d] += m.errors.bias[d] / n;
    }
    for (double* square : {&out.error, &out.least, &out.most, &out.estimate, &out.high, &out.own_noise, &out.own_bias}) *square = std::sqrt(*square);
    if (runs.size() < 2) return out;
    // The spread of the runs about their mean is noise; the mean is off by what all have, by its own noise and by that of the truth.
    const auto mean_of = [&](std::size_t i, std::size_t d, std::size_t c) {
        double sum = 0;
        for (const Measurement& m : runs) sum += m.values[i][d][c];
        return sum / n;
    };
    const auto noise = root_mean_square(truth, [&](std::size_t i, std::size_t d, std::size_t c) {
        double sum = 0;
        for (const Measurement& m : runs) sum += std::pow(m.values[i][d][c] - mean_of(i, d, c), 2);
        return std::sqrt(sum / (n - 1));
    });
    const auto off = root_mean_square(truth, [&](std::size_t i, std::size_t d, std::size_t c) { return mean_of(i, d, c) - truth.value[i][d][c]; });
    const auto unsure = noise_of(truth);
    double worst = -1;
    for (std::size_t d = 0; d < 4; ++d) {
        const double common = std::max(0.0, off[d] * off[d] - noise[d] * noise[d] / n - unsure[d] * unsure[d]);
        if (common + noise[d] * noise[d] <= worst) continue;
        worst = common + noise[d] * noise[d], out.noise = noise[d], out.common = std::sqrt(common);
    }
    return out;
}

std::vector<WorstLuxel> worst_luxels(const Truth& truth, std::span<const Measurement> runs, std::size_t most) {
    const std::size_t n = truth.value.size();
    std::vector<WorstLuxel> out(n);
    if (runs.empty()) return {};
    for (std::size_t d = 0; d < 4; ++d) {
        double level = 0, sum = 0;
        for (const Irradiance& v : truth.value) level += mean(v[d]) / static_cast<double>(n);
        std::vector<WorstLuxel> along(n);
        for (std::size_t i = 0; i < n; ++i) {
            WorstLuxel& w = along[i];
            const double t = mean(truth.value[i][d]), scale = std::max({t, 0.02 * level, 1e-300});
            for (const Measurement& m : runs) {
                const double e = 100 * (mean(m.values[i][d]) - t) / scale;
                w.error += e * e / static_cast<double>(runs.size()), w.mean += e / static_cast<double>(runs.size());
            }
            sum += w.error;
            w.at = i, w.direction = d, w.noise = 100 * mean(truth.error[i][d]) / scale;
        }
        for (std::size_t i = 0; i < n; ++i) {
            along[i].share = sum > 0 ? along[i].error / sum : 0;
            along[i].error = std::sqrt(along[i].error);
            if (d == 0 || along[i].error > out[i].error) out[i] = along[i];
        }
    }
    std::ranges::stable_sort(out, std::greater<>(), &WorstLuxel::error);
    out.resize(std::min(most, n));
    return out;
}

std::vector<std::uint32_t> lit_luxels(const LightScene& in, const Truth& truth, std::uint32_t most, Context& context) {
    std::vector<std::uint32_t> lit = truth.luxels;
    const std::vector<std::uint32_t> shown = rivals::shown_luxels(rivals::Scene(in.world, in.surfaces, in.lights), context);
    const std::size_t more = std::min<std::size_t>(std::max<std::size_t>(most, lit.size()) - lit.size(), shown.size());
    for (std::size_t i = 0; i < more; ++i) lit.push_back(shown[i * shown.size() / more]);
    return lit;
}

Measurement measure_rival(const LightScene& in, const Truth& truth, std::string method, std::string setting, const MakeMethod& make, std::span<const std::uint32_t> lit, Context& context) {
    Measurement m;
    m.scene = in.name, m.method = std::move(method), m.setting = std::move(setting);
    m.luxels = truth.shown;
    std::vector<rivals::Receiver> receivers;
    {
        const rivals::Scene scene(in.world, in.surfaces, in.lights);
        receivers = rivals::receivers_of(scene, lit);
        m.calibration = calibrate(scene, {receivers.data(), truth.luxels.size()});
    }
    m.lit = receivers.size();
    reset_peak();
    const double before = status_kb("VmRSS:"), start = cpu_seconds();
    const rivals::Scene scene(in.world, in.surfaces, in.lights);
    const auto rival = make(scene, context);
    const double prepared = cpu_seconds();
    const double rays = static_cast<double>(rival->cost().rays);
    if (m.skipped = rival->refused(); !m.skipped.empty()) return m;
    const std::vector<Irradiance> values = rival->light(receivers, context);
    const double scale = static_cast<double>(m.luxels) / static_cast<double>(std::max<std::uint64_t>(m.lit, 1));
    m.cpu_s = prepared - start + (cpu_seconds() - prepared) * scale;
    m.rays = rays + (static_cast<double>(rival->cost().rays) - rays) * scale;
    m.peak_mb = std::max(0.0, status_kb("VmHWM:") - before) / 1024;
    m.errors = compare(truth, {values.data(), truth.luxels.size()});
    return m;
}

} // namespace kiln::bench

// Error and cost of one way to bake one scene.
//
// Truth    irradiance along four directions at luxels drawn by area among those that show light, path-traced in
//          independent rounds until their noise is low; kept on disk under a hash of all it depends on. In closed form
//          where all surfaces of a closed scene send the same radiance (furnace).
//          `shown`: at a place in each of these luxels, for what a level shows there: texels fitted, coarser grids, bilinear filtering
// Error    rRMSE: root of the mean square of (value - truth) / max(truth, 2 % of the mean of truth), over luxels and
//          colour channels, for each of the four directions; "the" error is that of the worst direction. The truth's own
//          noise is taken out in quadrature and told beside.
// Cost     CPU seconds of the process for the whole method, tables and tracer included, for all luxels. Rivals answer at
//          a sample of them: the part of their time that grows with luxels is scaled up.
#pragma once
#include "compiler/light/rivals/rivals.h"
#include <functional>
#include <string>

namespace kiln::bench {

constexpr const char* kFlatMethod = "kiln-flat"; // the bake where no light is directional

struct LightScene {
    std::string name;
    const World& world;
    const Bsp& bsp;
    const Surfaces& surfaces;
    const std::vector<Light>& lights;
};

struct TruthSettings {
    std::uint32_t points = 300;
    std::uint32_t paths = 4096;     // of a replicate
    std::uint32_t replicates = 8;   // a round
    std::uint32_t most_rounds = 8;
    double noise_percent = 1;       // stop where the worst direction has less
    std::string cache;              // folder; empty: none
    bool shown = false;             // at a place in each luxel instead of its mean
};
struct Truth {
    std::vector<std::uint32_t> luxels;            // luxels of the scene, ascending; one may stand twice
    std::vector<rivals::Irradiance> value, error; // error: standard
    std::uint32_t shown = 0;                      // luxels of the scene that show light
    std::uint64_t paths = 0;                      // a luxel
    std::vector<Vec3> places;                     // not of the luxels, but of a place in each; not kept on disk, drawn anew. None: of luxels
    template <class A> void fields(A& a) { a(luxels, value, error, shown, paths); }
};
Result<Truth> find_truth(const LightScene& scene, const TruthSettings& settings, Context& context);

inline constexpr std::array<const char*, 4> kDirectionNames = {"n", "b1", "b2", "b3"};
struct Errors {                       // percent
    std::array<double, 4> rrmse{};    // noise taken out
    std::array<double, 4> noise{};    // of the truth
    std::array<double, 4> bias{};     // of the sum, signed
    double worst = 0, worst_noise = 0; // of the direction with the largest error
    double least = 0, most = 0;       // truth knows a sample of the luxels: the error of all in that direction is above and below these, each with 95 %
    double p95 = 0;                   // 95th percentile of the relative error along n
    bool at_noise() const { return worst < 2 * worst_noise; } // too close to the truth's noise to tell
};
// `directions`: of the four, those that count.
Errors compare(const Truth& truth, std::span<const rivals::Irradiance> values, std::size_t directions = 4);

struct Measurement {
    std::string scene, method, setting;
    double target = 0;                           // percent; 0: the method has none
    double cpu_s = 0;                            // for all luxels
    double calibration = 0;                      // rays a CPU second by the tracer alone, on this scene, at that time
    double estimate = 0, low = 0, high = 0;      // percent: what the method says of its own error; 0: nothing
    double own_noise = 0, own_bias = 0;          // percent: the parts of it that differ from seed to seed, and that do not
    std::uint64_t luxels = 0, lit = 0;           // of the scene; at which it was measured
    double rays = 0;                             // for all luxels
    double traced = 0;                           // all rays of the bake by the tracer's own count, those of its estimate too; 0: of more threads than one, not known
    double peak_mb = 0;                          // by which the process grew at most
    Errors errors;
    std::vector<rivals::Irradiance> values;      // of the bake, at the luxels of truth
    std::string skipped;                         // why there are no numbers
    double cost() const { return cpu_s * calibration * 1e-6; } // in million rays of the tracer
    double tracing() const { return 100 * traced / (calibration * cpu_s); } // percent: of the time what the tracer would have taken by itself
};

// The bake itself, to an error target; `flat`: irradiance along the normal alone is baked and compared.
Measurement measure_bake(const LightScene& scene, const Truth& truth, double target_percent, Context& context, std::uint64_t seed = 1, bool flat = false);

// What bakes of one scene to one target with several seeds have in common and what not, and whether each knew its error.
struct Seeds {
    std::size_t runs = 0, within_estimate = 0, within_high = 0, within_target = 0;
    double error = 0, estimate = 0, high = 0;         // percent, root mean square over the runs
    double over_estimate = 0, over_high = 0;          // the largest true error over each; infinite: told to be none, and there is some
    std::size_t likely_over = 0;                      // runs whose bound lies below `least`: with 95 % it is too low
    double least = 0, most = 0;                       // percent, root mean square over the runs: of Errors
    double noise = 0, common = 0;                     // percent, worst direction: found in the values of the runs
    double own_noise = 0, own_bias = 0;               // what the bake says of those
    std::array<double, 4> bias{};                     // percent: of the sum over all luxels, mean over the runs
    double cpu_s = 0, rays = 0;                       // mean
};
Seeds compare_seeds(const Truth& truth, std::span<const Measurement> runs);

// The luxels of truth that make most of the error of those runs, each with its worst direction.
struct WorstLuxel {
    std::size_t at = 0;       // index into Truth::luxels
    std::size_t direction = 0;
    double error = 0;         // percent: root mean square over the runs
    double mean = 0;          // percent: of their mean, signed
    double noise = 0;         // percent: of the truth there
    double share = 0;         // of the mean square error in that direction over all luxels, 0 to 1
};
std::vector<WorstLuxel> worst_luxels(const Truth& truth, std::span<const Measurement> runs, std::size_t most);
// Where rivals answer: the luxels of truth, then more of those that show light, spread evenly, up to `most`: enough for
// time to be measured.
std::vector<std::uint32_t> lit_luxels(const LightScene& scene, const Truth& truth, std::uint32_t most, Context& context);
// A rival; `make` builds it from the scene, which is built anew, as that is a cost too. `lit`: of lit_luxels.
using MakeMethod = std::function<std::unique_ptr<rivals::Method>(const rivals::Scene&, Context&)>;
Measurement measure_rival(const LightScene& scene, const Truth& truth, std::string method, std::string setting, const MakeMethod& make,
                          std::span<const std::uint32_t> lit, Context& context);

} // namespace kiln::bench

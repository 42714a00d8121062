// What all sweeps do with a made map: build it, bake it, ask rivals at the same luxels.
#pragma once
#include "compiler/light/rivals/rivals.h"
#include "tools/stability_bench/map_text.h"
#include <functional>
#include <memory>

namespace kiln::bench {

// Up to its surfaces. Throws what a stage says is at fault: a made map has none.
std::unique_ptr<Compiled> built(const MapText& map, Context& context, bool allow_leaks = false, double smoothing_angle_deg = -1); // of SurfaceOptions

Light sun_along(Vec3 way, double irradiance); // perpendicular to it
Light lamp_at(Vec3 position, double intensity); // E = intensity / d^2

struct Spot { // a luxel as sweeps see it
    std::uint32_t luxel = 0;
    FaceId face;
    Vec3 point, normal; // middle of its footprint; geometric
    double area = 0;    // map units squared
};
std::vector<Spot> spots_of(const Surfaces& surfaces, const std::function<bool(const Spot&)>& wanted = {});
// Mean of f over the footprint of a luxel, by n x n midpoints of its whole square: for luxels that nothing cuts.
double mean_over(const Surfaces& surfaces, const Spot& spot, int n, const std::function<double(Vec3)>& f);

Lighting baked(const Compiled& c, const std::vector<Light>& lights, const LightOptions& options, Context& context);
// Along the normal, channels' mean.
double irradiance_at(const Surfaces& s, const Lighting& l, const Spot& spot);
bool shown_at(const Surfaces& s, const Lighting& l, const Spot& spot); // baked, not filled
std::vector<double> irradiance_of(const Surfaces& s, const Lighting& l, std::span<const Spot> spots);

// The other methods, at one setting each; they look as in `kiln bench light`.
struct Rival {
    std::string name;
    std::size_t look = 0;
    std::function<std::unique_ptr<rivals::Method>(const rivals::Scene&, Context&)> make;
};
inline constexpr std::size_t kPathsLook = 1, kCentreLook = 2, kVradLook = 3, kCorrectedLook = 4, kHemicubeLook = 5, kCutLook = 6;
// `h`: patch size, map units.
std::vector<Rival> matrix_rivals(double h);
std::vector<Rival> all_rivals(double h, std::uint32_t pixels = 32, std::uint32_t lights = 4096, std::uint32_t paths = 256); // paths last
// Along the normal, channels' mean, at luxels; empty: refused. `rays`: what it traced.
std::vector<double> irradiance_of(const Rival& rival, const Compiled& c, const std::vector<Light>& lights, std::span<const Spot> spots, Context& context, double* rays = nullptr);
// At points of a plane.
std::vector<double> irradiance_of(const Rival& rival, const Compiled& c, const std::vector<Light>& lights, std::span<const Vec3> points, Vec3 normal, Vec3 tangent, Context& context);

// Relative root mean square error, percent; floor 2 % of the mean of truth; by area.
double rrmse(std::span<const double> got, std::span<const double> truth, std::span<const Spot> spots);
double worst_relative(std::span<const double> got, std::span<const double> truth, double floor_share = 0.02); // percent, unsigned

double uniform(std::uint64_t a, std::uint64_t b, std::uint64_t c = 0); // 0..1, from its arguments alone

} // namespace kiln::bench

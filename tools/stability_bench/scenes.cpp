#include "tools/stability_bench/scenes.h"
#include "libs/core/hash.h"
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace kiln::bench {

std::unique_ptr<Compiled> built(const MapText& map, Context& context, bool allow_leaks, double smoothing_angle_deg) {
    auto c = std::make_unique<Compiled>();
    CompileOptions options;
    options.bsp.allow_leaks = allow_leaks;
    options.surfaces.smoothing_angle_deg = smoothing_angle_deg;
    const auto done = compile(map.input(), options, {.store = nullptr, .last = Stage::surfaces, .stage_done = {}}, context, *c);
    const std::vector<Diagnostic> said = context.take_diagnostics();
    if (!done) {
        std::string why = done.fault().diagnostic.message;
        if (const auto first = std::ranges::find(said, Severity::error, &Diagnostic::severity); first != said.end()) why += "; " + first->message;
        throw std::runtime_error(why);
    }
    return c;
}

Light sun_along(Vec3 way, double e) {
    Light l;
    l.kind = LightKind::sun, l.direction = normalize(way);
    l.intensity = Rgb{1, 1, 1} * static_cast<float>(e);
    return l;
}
Light lamp_at(Vec3 position, double intensity) {
    Light l;
    l.position = position, l.intensity = Rgb{1, 1, 1} * static_cast<float>(intensity);
    return l;
}

std::vector<Spot> spots_of(const Surfaces& s, const std::function<bool(const Spot&)>& wanted) {
    std::vector<Spot> out;
    for (std::uint32_t i = 0; i < s.luxels.size(); ++i) {
        const Luxel& l = s.luxels[i];
        const Spot spot{i, l.face, world_from_luxel(s, l.face, centroid_of(s, l)), s.faces[l.face.at()].normal, static_cast<double>(l.area) * luxel_area(s, l.face)};
        if (!wanted || wanted(spot)) out.push_back(spot);
    }
    return out;
}
double mean_over(const Surfaces& s, const Spot& spot, int n, const std::function<double(Vec3)>& f) {
    const Luxel& l = s.luxels[spot.luxel];
    double sum = 0;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) sum += f(world_from_luxel(s, spot.face, {l.x + (i + 0.5) / n, l.y + (j + 0.5) / n}));
    return sum / (n * n);
}

Lighting baked(const Compiled& c, const std::vector<Light>& lights, const LightOptions& options, Context& context) {
    auto l = bake_light(c.world, c.bsp, c.bsp.planes, c.surfaces, lights, options, context);
    (void)context.take_diagnostics();
    if (!l) throw std::runtime_error(l.fault().diagnostic.message);
    validate(*l, c.surfaces);
    return std::move(*l);
}
namespace {
std::size_t texel_of(const Surfaces& s, const Spot& spot) { return kiln::texel_of(s, s.luxels[spot.luxel]); }
} // namespace
double irradiance_at(const Surfaces& s, const Lighting& l, const Spot& spot) { return static_cast<double>(mean(l.flat[texel_of(s, spot)])); }
bool shown_at(const Surfaces& s, const Lighting& l, const Spot& spot) { return l.valid[texel_of(s, spot)] == 1; }
std::vector<double> irradiance_of(const Surfaces& s, const Lighting& l, std::span<const Spot> spots) {
    std::vector<double> out;
    for (const Spot& spot : spots) out.push_back(irradiance_at(s, l, spot));
    return out;
}

std::vector<Rival> matrix_rivals(double h) {
    using rivals::MatrixRule;
    const auto matrix = [h](MatrixRule rule) { return [=](const rivals::Scene& s, Context& c) { return matrix_radiosity(s, {.patch_size = h, .rule = rule}, c); }; };
    return {{"matrix-centre", kCentreLook, matrix(MatrixRule::centre)}, {"matrix-vrad", kVradLook, matrix(MatrixRule::vrad)}, {"matrix-corrected", kCorrectedLook, matrix(MatrixRule::corrected)}};
}
std::vector<Rival> all_rivals(double h, std::uint32_t pixels, std::uint32_t lights, std::uint32_t paths) {
    std::vector<Rival> out = matrix_rivals(h);
    out.push_back({"hemicube", kHemicubeLook, [=](const rivals::Scene& s, Context& c) { return hemicube_radiosity(s, {.patch_size = h, .resolution = pixels}, c); }});
    out.push_back({"light-cut", kCutLook, [=](const rivals::Scene& s, Context& c) { return many_light_cut(s, {.lights = lights}, c); }});
    if (paths) out.push_back({"paths", kPathsLook, [=](const rivals::Scene& s, Context&) { return path_tracing(s, {.paths = paths}); }});
    return out;
}

namespace {
std::vector<double> ask(const Rival& rival, const rivals::Scene& scene, std::span<const rivals::Receiver> receivers, Context& context, double* rays) {
    const auto method = rival.make(scene, context);
    std::vector<double> out;
    if (!method->refused().empty()) return out;
    for (const rivals::Irradiance& e : method->light(receivers, context)) out.push_back(mean(e[0]));
    if (rays) *rays = static_cast<double>(method->cost().rays);
    return out;
}
} // namespace
std::vector<double> irradiance_of(const Rival& rival, const Compiled& c, const std::vector<Light>& lights, std::span<const Spot> spots, Context& context, double* rays) {
    const rivals::Scene scene(c.world, c.surfaces, lights);
    std::vector<std::uint32_t> luxels;
    for (const Spot& s : spots) luxels.push_back(s.luxel);
    return ask(rival, scene, receivers_of(scene, luxels), context, rays);
}
std::vector<double> irradiance_of(const Rival& rival, const Compiled& c, const std::vector<Light>& lights, std::span<const Vec3> points, Vec3 normal, Vec3 tangent, Context& context) {
    const rivals::Scene scene(c.world, c.surfaces, lights);
    std::vector<rivals::Receiver> receivers;
    for (const Vec3 p : points) receivers.push_back(rivals::receiver_at(p, normal, tangent));
    return ask(rival, scene, receivers, context, nullptr);
}

double rrmse(std::span<const double> got, std::span<const double> truth, std::span<const Spot> spots) {
    double level = 0, area = 0, sum = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) level += truth[i] * spots[i].area, area += spots[i].area;
    if (!(level > 0)) return 0;
    level /= area;
    for (std::size_t i = 0; i < truth.size(); ++i) sum += spots[i].area * std::pow((got[i] - truth[i]) / std::max(truth[i], 0.02 * level), 2);
    return 100 * std::sqrt(sum / area);
}
double worst_relative(std::span<const double> got, std::span<const double> truth, double floor_share) {
    double level = 0, worst = 0;
    for (const double t : truth) level += t / static_cast<double>(truth.size());
    for (std::size_t i = 0; i < truth.size(); ++i) worst = std::max(worst, 100 * std::abs(got[i] - truth[i]) / std::max(truth[i], floor_share * level));
    return worst;
}

double uniform(std::uint64_t a, std::uint64_t b, std::uint64_t c) { return static_cast<double>(mix(mix(a, b), c) >> 11) * 0x1p-53; }

} // namespace kiln::bench

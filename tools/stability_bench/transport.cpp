// Bounces: furnaces, small lamps, corridors; and how the bake's settings bear on it.
#include "libs/core/process.h"
#include "tools/light_bench/measure.h"
#include "tools/stability_bench/sweeps.h"
#include "compiler/light/bake.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <numbers>
#include <stdexcept>

namespace kiln::bench {
namespace {

constexpr double kPi = std::numbers::pi;
const std::vector<Light> kNoLights; // scenes keep a reference

// A room with convex solids in it, turned anyhow, that run into each other and into the walls.
MapText random_map(std::uint64_t seed, double albedo, double emission) {
    MapText map;
    map.luxel = 32;
    const std::string m = map.material("even", albedo, emission);
    map.room({0, 0, 0}, {256, 192, 160}, m);
    map.entity("info_player_start", {16, 16, 144});
    const auto coordinate = [](double x) { return std::round(x * 16) / 16; };
    for (std::uint64_t k = 0; k < 6; ++k) {
        const std::size_t corners = 4 + 2 * (k % 2); // tetrahedra and octahedra of a kind
        const Vec3 middle{60 + 180 * uniform(seed, k, 1), 50 + 130 * uniform(seed, k, 2), 100 * uniform(seed, k, 3)};
        std::vector<Vec3> points;
        for (std::size_t i = 0; i < corners; ++i) {
            Vec3 way;
            for (std::size_t a = 0; a < 3; ++a) way[a] = uniform(seed, 100 * k + i, 10 + a) - 0.5;
            if (corners == 6) way = Vec3{i / 2 == 0 ? 1.0 : 0, i / 2 == 1 ? 1.0 : 0, i / 2 == 2 ? 1.0 : 0} * (i % 2 ? -1.0 : 1.0) + way * 0.6;
            const Vec3 p = middle + normalize(way) * (24 + 30 * uniform(seed, 100 * k + i, 20));
            points.push_back({coordinate(p.x), coordinate(p.y), coordinate(p.z)});
        }
        map.hull(points, m);
    }
    return map;
}

} // namespace

// All surfaces emit 1 and reflect alike: radiance is 1 / (1 - albedo) everywhere, whatever the shape. Along a shading normal that leans
// off its face by t the face's own plane hides (1 - cos t) / 2 of it, from every method: so faces are flat, and once smoothed beside.
void sweep_furnaces(SweepReport& r, const SweepSettings& s, Context& context) {
    Panel worst{"worst luxel of all maps", {}, {"1 - albedo"}, {"|E (1 - albedo) / pi - 1|, percent", true, 1e-4, 1000}, {{5, "--error 5"}}};
    Panel level{"mean over all maps", {}, {"1 - albedo"}, {"|mean - exact|, percent", true, 1e-4, 1000}, {}};
    Panel lost{"rays that leave the map or meet a back", {}, {"1 - albedo"}, {"share of rays", true, 1e-9}, {}};
    const std::uint64_t maps = s.quick ? 3 : 30;
    constexpr double kFlat = 0, kSmooth = 45; // degrees
    for (const double albedo : values_of(s, {0.5, 0.8, 0.9, 0.95}, {0.5, 0.95})) {
        const double exact = kPi / (1 - albedo);
        for (const double angle : {kFlat, kSmooth}) {
            if (angle == kSmooth && albedo != 0.5) continue; // the same at any albedo
            double most = 0, hidden = 0, sum = 0, count = 0, escaped = 0, rays = 0;
            for (std::uint64_t k = 0; k < maps; ++k) {
                const auto c = built(random_map(k + 1, albedo, 1), context, false, angle);
                const Lighting l = baked(*c, {}, {}, context);
                rays += static_cast<double>(l.rays), escaped += static_cast<double>(l.escaped_rays + l.back_face_rays);
                for (const Spot& p : spots_of(c->surfaces)) {
                    if (!shown_at(c->surfaces, l, p)) continue;
                    const double e = irradiance_at(c->surfaces, l, p) / exact - 1;
                    most = std::max(most, std::abs(e)), sum += e, ++count;
                    if (angle == kSmooth) hidden = std::max(hidden, (1 - dot(shading_normal(c->surfaces, p.face, p.point), p.normal)) / 2);
                }
            }
            const std::string name = angle == kSmooth ? "kiln, smoothed" : "kiln";
            const std::size_t look = angle == kSmooth ? 1 : 0;
            add_point(worst, name, look, 1 - albedo, 100 * most);
            if (angle == kSmooth) add_point(worst, "hidden by the luxel's own plane", 2, 1 - albedo, 100 * hidden);
            add_point(level, name, look, 1 - albedo, 100 * std::abs(sum / count));
            add_point(lost, name, look, 1 - albedo, escaped / rays);
        }
        if (!s.rivals) continue;
        for (const Rival& rival : all_rivals(32, 32, 4096, 256)) {
            double rival_most = 0, rival_sum = 0, rival_count = 0;
            for (std::uint64_t k = 0; k < std::min<std::uint64_t>(maps, 6); ++k) {
                const auto c = built(random_map(k + 1, albedo, 1), context, false, kFlat);
                const rivals::Scene scene(c->world, c->surfaces, kNoLights);
                auto spots = spots_of(c->surfaces);
                const auto shown = shown_luxels(scene, context);
                std::erase_if(spots, [&](const Spot& p) { return !std::ranges::binary_search(shown, p.luxel); });
                for (const double e : irradiance_of(rival, *c, {}, spots, context)) rival_most = std::max(rival_most, std::abs(e / exact - 1)), rival_sum += e / exact - 1, ++rival_count;
            }
            if (!(rival_count > 0)) continue;
            const auto shown_value = [](double v) { return std::isfinite(v) ? std::abs(v) : 1e30; };
            add_point(worst, rival.name, rival.look, 1 - albedo, 100 * shown_value(rival_most));
            add_point(level, rival.name, rival.look, 1 - albedo, 100 * shown_value(rival_sum / rival_count));
        }
    }
    r.notes.push_back(fmt::format("{} random maps; rivals on 6 of them.", maps));
    r.panels = {worst, level, lost};
}

// A lamp in the ceiling of a grey room, smaller and smaller at the same power.
void sweep_small_lamp(SweepReport& r, const SweepSettings& s, Context& context) {
    Panel error{"error against path tracing", {}, {"form factor of the lamp from the floor below it"}, {"rRMSE, percent", true, 1e-2, 1000}, {{5, "--error 5"}}};
    Panel cost{"rays", {}, {"form factor of the lamp from the floor below it"}, {"rays for all luxels"}, {}};
    Panel time{"time", {}, {"form factor of the lamp from the floor below it"}, {"CPU seconds for all luxels"}, {}};
    for (const double factor : values_of(s, {1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6}, {1e-1, 1e-3, 1e-6})) {
        // On the axis of a small square of side a at height 96: about a^2 / (pi h^2).
        const double side = std::max(1.0 / 16, std::round(16 * 96 * std::sqrt(kPi * factor)) / 16);
        MapText map;
        const std::string grey = map.material("grey", 0.5), dark = map.material("dark", 0.5), lit = map.material("lamp", 0, 1e4 / (side * side));
        map.room({0, 0, 0}, {128, 128, 96}, grey);
        const Vec3 m{64, 64, 96};
        map.box(m - Vec3{side / 2, side / 2, 1.0 / 16}, m + Vec3{side / 2, side / 2, 0}, {dark, dark, dark, dark, lit, dark});
        map.entity("info_player_start", {32, 32, 32});
        const auto c = built(map, context);
        auto spots = spots_of(c->surfaces, [&](const Spot& p) { return p.area > 128 && p.point.z < 95; });
        const auto every = [&](std::size_t n) {
            std::vector<Spot> some;
            for (std::size_t i = 0; i < spots.size(); i += n) some.push_back(spots[i]);
            return some;
        };
        const std::vector<Spot> some = every(s.quick ? 17 : 5);
        const std::vector<double> truth = irradiance_of(all_rivals(16, 32, 1, s.quick ? 4096 : 32768).back(), *c, {}, some, context);
        const double start = cpu_seconds();
        const Lighting l = baked(*c, {}, {}, context);
        add_point(time, "kiln", 0, factor, cpu_seconds() - start);
        add_point(error, "kiln", 0, factor, rrmse(irradiance_of(c->surfaces, l, some), truth, some));
        add_point(cost, "kiln", 0, factor, static_cast<double>(l.rays));
        if (!s.rivals) continue;
        for (const Rival& rival : all_rivals(16, 32, 4096, 256)) {
            double rays = 0;
            const double before = cpu_seconds();
            const auto got = irradiance_of(rival, *c, {}, spots, context, &rays);
            if (got.empty()) continue;
            add_point(time, rival.name, rival.look, factor, cpu_seconds() - before);
            std::vector<double> at;
            for (std::size_t i = 0; i < spots.size(); i += s.quick ? 17 : 5) at.push_back(got[i]);
            add_point(error, rival.name, rival.look, factor, rrmse(at, truth, some));
            add_point(cost, rival.name, rival.look, factor, rays);
        }
    }
    r.panels = {error, cost, time};
}

namespace {

// Irradiance along the wall of a circular tube of diameter 1, its end x = 0 a disc of exitance 1, the other black, by
// quadrature of its integral equation: H(x) = F(x) + albedo * integral of H(y) K(|x - y|) dy. The kernel bends at y = x:
// its integral over a cell is taken exactly, H is linear in it.
class Tube {
public:
    Tube(double length, double albedo, double step) : step_(step), n_(static_cast<std::size_t>(std::lround(length / step)) + 1), h_(n_) {
        const auto tail = [](double u) { return (u * u + 0.5) / std::sqrt(u * u + 1) - u; }; // F: the integral of K from u on
        // g'' = K, even: its second differences are the integrals of K times a hat.
        const auto g = [](double u) { return std::abs(u) / 2 - std::abs(u) * std::sqrt(u * u + 1) / 2 + u * u / 2; };
        std::vector<double> weight(n_); // of a node so many cells away
        for (std::size_t k = 0; k < n_; ++k) {
            const double u = static_cast<double>(k) * step;
            weight[k] = (g(u - step) - 2 * g(u) + g(u + step)) / step;
        }
        std::vector<double> f(n_), next(n_);
        for (std::size_t i = 0; i < n_; ++i) h_[i] = f[i] = tail(static_cast<double>(i) * step);
        // The nodes at both ends have half a hat.
        const auto end_weight = [&](std::size_t k) {
            const double u = static_cast<double>(k) * step;
            return k == 0 ? weight[0] / 2 : 0.5 - tail(u) + (g(u - step) - g(u)) / step;
        };
        std::vector<double> ends(n_);
        for (std::size_t k = 0; k < n_; ++k) ends[k] = end_weight(k);
        for (int sweep = 0; sweep < 4000; ++sweep) {
            double change = 0;
            for (std::size_t i = 0; i < n_; ++i) {
                double sum = h_[0] * ends[i] + h_[n_ - 1] * ends[n_ - 1 - i];
                for (std::size_t j = 1; j + 1 < n_; ++j) sum += h_[j] * weight[i > j ? i - j : j - i];
                next[i] = f[i] + albedo * sum;
                change = std::max(change, std::abs(next[i] - h_[i]) / std::max(next[i], 1e-30));
            }
            h_.swap(next);
            if (change < 1e-7) break;
        }
    }
    double at(double x) const {
        const double u = std::clamp(x / step_, 0.0, static_cast<double>(n_ - 1) - 1e-9);
        const auto i = static_cast<std::size_t>(u);
        const double t = u - static_cast<double>(i);
        return h_[i] * (1 - t) + h_[i + 1] * t;
    }

private:
    double step_;
    std::size_t n_;
    std::vector<double> h_;
};

} // namespace

std::vector<double> tube_irradiance(double length, double albedo, std::span<const double> x) {
    const Tube tube(length, albedo, 1.0 / 64);
    std::vector<double> out;
    for (const double at : x) out.push_back(tube.at(at));
    return out;
}

void sweep_corridor(SweepReport& r, const SweepSettings& s, Context& context) {
    constexpr double kDiameter = 64, kLongest = 100;
    constexpr int kSides = 32;
    // A prism of 32 sides of the circle's area over its circumference: the mean of chords is the same.
    const double radius = kDiameter / 2 / std::cos(kPi / kSides);
    for (const double length : s.quick ? std::vector<double>{10} : std::vector<double>{10, kLongest}) {
        Panel curve{fmt::format("{:g} diameters: light along the wall", length), {}, {"diameters from the lit end", false}, {"irradiance / exitance of the end", true, 1e-12}, {}};
        Panel error{fmt::format("{:g} diameters: error by distance, albedo 0.8 for rivals", length), {}, {"diameters from the lit end", false}, {"|error|, percent", true, 1e-2, 300}, {{5, "--error 5"}}};
        std::size_t look = 0;
        const std::vector<double> albedos = length > 10 ? std::vector<double>{0.8, 0.99} : values_of(s, {0, 0.5, 0.8, 0.95, 0.99}, {0.5, 0.95});
        for (const double albedo : albedos) {
            MapText map;
            map.luxel = 16;
            const std::string grey = map.material("grey", albedo), black = map.material("black", 0), lit = map.material("lamp", 0, 1 / kPi);
            const double end = length * kDiameter;
            map.box({-16, -64, -64}, {0, 64, 64}, {black, lit, black, black, black, black});
            map.box({end, -64, -64}, {end + 16, 64, 64}, black);
            std::vector<Vec2> rim;
            for (int i = 0; i < kSides; ++i) {
                const double a = 2 * kPi * (i + 0.5) / kSides;
                rim.push_back({radius * std::cos(a), radius * std::sin(a)});
            }
            for (std::size_t i = 0; i < kSides; ++i) { // a wedge a side: from the facet outwards
                const Vec2 p = rim[i], q = rim[(i + 1) % kSides], p2 = p * 1.6, q2 = q * 1.6;
                const auto at = [](double x, Vec2 v) { return Vec3{x, v.x, v.y}; };
                const Vec3 centre = at(end / 2, (p + q + p2 + q2) * 0.25);
                std::vector<MapSide> sides;
                const auto side = [&](std::array<Vec3, 3> t) {
                    if (dot(cross(t[2] - t[0], t[1] - t[0]), t[0] - centre) < 0) std::swap(t[1], t[2]);
                    sides.push_back({t, grey});
                };
                side({at(0, p), at(0, q), at(end, p)}), side({at(0, p2), at(0, q2), at(end, p2)});
                side({at(0, p), at(0, p2), at(end, p)}), side({at(0, q), at(0, q2), at(end, q)});
                side({at(0, p), at(0, q), at(0, p2)}), side({at(end, p), at(end, q), at(end, p2)});
                map.brush(sides);
            }
            map.entity("info_player_start", {end / 2, 0, 0});
            const auto c = built(map, context);
            const Tube exact(length, albedo, length > 20 ? 1.0 / 16 : 1.0 / 64);
            // Rings of luxels.
            const auto wall = spots_of(c->surfaces, [&](const Spot& p) { return std::abs(p.normal.x) < 0.5 && p.point.x > 0 && p.point.x < end && std::hypot(p.point.y, p.point.z) < 40; });
            const auto ring_of = [&](const std::vector<Spot>& at, const std::vector<double>& got, const std::function<void(double, double, double)>& ring) { // x, mean, exact
                std::map<int, std::array<double, 4>> rings;
                for (std::size_t i = 0; i < at.size(); ++i) {
                    auto& a = rings[static_cast<int>(at[i].point.x / 16)];
                    const double x0 = std::floor(at[i].point.x / 16) * 16 / kDiameter;
                    a[0] += got[i] * at[i].area, a[1] += at[i].area, a[2] = x0 + 0.125;
                    a[3] = 0;
                    for (int k = 0; k < 8; ++k) a[3] += exact.at(x0 + 0.25 * (k + 0.5) / 8) / 8;
                }
                for (const auto& [k, a] : rings) {
                    const double x = a[2];
                    // Every one near the lit end, some of those beyond; the other end's own light is not the tube's.
                    const bool kept = x < 2 ? true : x < 10 ? k % 4 == 0 : k % 20 == 0;
                    if (kept && x < length - 0.5) ring(x, a[0] / a[1], a[3]);
                }
            };
            const auto got = irradiance_of(c->surfaces, baked(*c, {}, {.error_floor = 1e-6}, context), wall); // what counts is how dark it gets: no floor
            const std::string name = fmt::format("kiln, albedo {:g}", albedo);
            ring_of(wall, got, [&](double x, double e, double truth) {
                add_point(curve, name, look, x, e);
                add_point(error, name, look, x, 100 * std::abs(e / truth - 1));
            });
            for (int k = 0; k <= 100; ++k) add_point(curve, fmt::format("exact, albedo {:g}", albedo), look, length * k / 100, exact.at(length * k / 100));
            curve.series.back().join = Join::line;
            ++look;
            if (!s.rivals || albedo != 0.8) continue;
            // On some of the facets; the long corridor in patches of its diameter, or their pairs take minutes.
            std::vector<Spot> some;
            for (std::size_t i = 0; i < wall.size(); ++i)
                if (wall[i].face.value % 4 == 0) some.push_back(wall[i]);
            for (const Rival& rival : all_rivals(length > 10 ? kDiameter : 16, 16, 16384, 1024)) {
                const auto other = irradiance_of(rival, *c, {}, some, context);
                if (!other.empty()) ring_of(some, other, [&](double x, double e, double truth) { add_point(error, rival.name, rival.look, x, 100 * std::abs(e / truth - 1)); });
            }
        }
        r.panels.push_back(curve), r.panels.push_back(error);
    }
}

// Targets and seeds against a path-traced truth; threads against each other.
void sweep_settings(SweepReport& r, const SweepSettings& s, Context& context) {
    MapText map;
    map.luxel = 16;
    const std::string grey = map.material("grey", 0.6), lit = map.material("lamp", 0, 20);
    map.room({0, 0, 0}, {256, 128, 96}, grey);
    map.box({120, 0, 0}, {136, 40, 96}, grey), map.box({120, 88, 0}, {136, 128, 96}, grey); // a doorway without lintel
    map.box({40, 48, 94}, {72, 80, 96}, {grey, grey, grey, grey, lit, grey});
    map.entity("info_player_start", {32, 32, 32});
    const auto c = built(map, context);
    const std::vector<Light> none;
    const LightScene lit_scene{"two rooms", c->world, c->bsp, c->surfaces, none};
    const auto truth = find_truth(lit_scene, {.points = s.quick ? 60u : 300u, .paths = s.quick ? 1024u : 4096u, .replicates = 8, .most_rounds = s.quick ? 1u : 8u, .noise_percent = 0.3, .cache = {}}, context);
    if (!truth) throw std::runtime_error(truth.fault().diagnostic.message);
    Panel cover{"true error and the bake's own estimate", {}, {"--error, percent"}, {"rRMSE along the normal, percent"}, {}};
    Panel ratio{"true error over the estimate and over its upper bound", {}, {"--error, percent"}, {"true / own"}, {{1, "covered below"}, {1.5, "never above"}}};
    double covered = 0, runs = 0, most = 0, in_interval = 0, most_of_high = 0;
    for (const double target : values_of(s, {20, 10, 5, 2, 1}, {10, 5})) {
        for (std::uint64_t seed = 1; seed <= (s.quick ? 2u : 8u); ++seed) {
            const Lighting l = baked(*c, {}, {.error_percent = target, .directional = Directional::none, .seed = seed}, context);
            std::vector<rivals::Irradiance> values;
            for (const std::uint32_t i : truth->luxels) {
                const Luxel& luxel = c->surfaces.luxels[i];
                const Chart& chart = c->surfaces.charts[luxel.chart.at()];
                values.push_back({static_cast<Rgbd>(l.flat[chart.texel(luxel.x, luxel.y)])});
            }
            const double found = compare(*truth, values).rrmse[0];
            add_point(cover, "true error", 0, target, found);
            add_point(cover, "own estimate", 1, target, l.error.estimate);
            add_point(ratio, "over the estimate", 1, target, found / l.error.estimate), add_point(ratio, "over its upper bound", 0, target, found / l.error.high);
            covered += found <= l.error.estimate, ++runs, most = std::max(most, found / l.error.estimate);
            in_interval += found <= l.error.high, most_of_high = std::max(most_of_high, found / l.error.high);
        }
    }
    for (Panel* p : {&cover, &ratio})
        for (Series& series : p->series) series.join = Join::none;
    r.notes.push_back(fmt::format("The estimate covers the true error in {:.0f} of {:.0f} runs, its upper bound in {:.0f}; the worst is {:.2f} times the estimate, {:.2f} times that bound.", covered, runs, in_interval, most, most_of_high));
    Panel same{"bytes that differ from those of one thread", {}, {"threads"}, {"texels that differ", true, 0.5}, {}};
    const int threads = context.threads;
    context.threads = 1;
    const Lighting one = baked(*c, {}, {.error_percent = 10, .directional = Directional::all}, context);
    for (const int n : {1, 2, 7}) {
        context.threads = n;
        const Lighting some = baked(*c, {}, {.error_percent = 10, .directional = Directional::all}, context);
        double differ = 0;
        for (std::size_t t = 0; t < one.flat.size(); ++t) differ += one.flat[t] != some.flat[t];
        add_point(same, "kiln", 0, n, differ == 0 && to_bytes(one) != to_bytes(some) ? 1 : differ);
    }
    context.threads = threads;
    r.panels = {cover, ratio, same};
}

} // namespace kiln::bench

// Shapes that break arithmetic, coordinates that should not matter, and maps with next to nothing in them.
#include "libs/core/process.h"
#include "tools/stability_bench/sweeps.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>
#include <stdexcept>

namespace kiln::bench {
namespace {

constexpr double kPi = std::numbers::pi;

double not_finite(const Lighting& l) { // or negative
    double n = 0;
    for (const Rgb& e : l.flat)
        for (std::size_t c = 0; c < 3; ++c) n += !(std::isfinite(e[c]) && e[c] >= 0);
    for (const Rgb& e : l.radiosity)
        for (std::size_t c = 0; c < 3; ++c) n += !(std::isfinite(e[c]) && e[c] >= 0);
    return n;
}

} // namespace

// Plates as thin as they are long over the aspect, some twice in the same place, some beside each other by their own thickness:
// their rims, and what they leave of each other, are needles. What is emitted must be absorbed.
void sweep_needles(SweepReport& r, const SweepSettings& s, Context& context) {
    constexpr double kAlbedo = 0.5, kEmission = 20, kLamp = 40;
    Panel energy{"absorbed against emitted", {}, {"length over thickness"}, {"|absorbed / emitted - 1|, percent", true, 1e-3, 1000}, {{5, "--error 5"}}};
    Panel bad{"texels and patches that are no number or negative", {}, {"length over thickness"}, {"count", true, 0.5}, {}};
    Panel cost{"cost against that of plates as thick as a tenth of their length", {}, {"length over thickness"}, {"times"}, {{2, "twice"}}};
    double base_cpu = 0, base_rays = 0, least_area = 1e300;
    for (const double aspect : values_of(s, {10, 100, 1e3, 1e4, 1e5}, {10, 1e5})) {
        MapText map;
        const std::string grey = map.material("grey", kAlbedo), lit = map.material("lamp", 0, kEmission);
        map.room({0, 0, 0}, {192, 192, 96}, grey);
        map.box({76, 76, 94}, {76 + kLamp, 76 + kLamp, 96}, {grey, grey, grey, grey, lit, grey});
        map.entity("info_player_start", {8, 8, 48});
        constexpr double kLength = 64;
        for (int k = 0; k < 6; ++k) {
            map.placing = turned_about({0, 0, 1}, 0.35 + k * 0.5);
            map.placing.offset = {36 + 58.0 * (k % 3), 50 + 90.0 * (k / 3), 0};
            const double t = kLength / aspect;
            map.box({-kLength / 2, 0, 0}, {kLength / 2, t, 20}, grey);
            if (k % 3 == 0) map.box({-kLength / 2, 0, 0}, {kLength / 2, t, 20}, grey);                 // the same again
            if (k % 3 == 1) map.box({-kLength / 2 + 1, t / 2, 0}, {kLength / 2 + 1, 1.5 * t, 20 + t}, grey); // slivers of each other
            if (k % 3 == 2) map.box({-kLength / 2, t, 0}, {kLength / 2, 2 * t, t}, grey);               // a kerb as high as it is wide
        }
        const double start = cpu_seconds();
        const auto c = built(map, context);
        const Lighting l = baked(*c, {}, {}, context);
        const double cpu = cpu_seconds() - start;
        if (base_cpu == 0) base_cpu = cpu, base_rays = static_cast<double>(l.rays);
        add_point(cost, "kiln, CPU time with geometry", 0, aspect, cpu / base_cpu);
        add_point(cost, "kiln, rays", 1, aspect, static_cast<double>(l.rays) / base_rays);
        add_point(bad, "kiln", 0, aspect, not_finite(l));
        for (const Face& f : c->surfaces.faces) least_area = std::min(least_area, f.area);
        const auto spots = spots_of(c->surfaces);
        const double emitted = kPi * kEmission * kLamp * kLamp;
        const auto put = [&](const std::string& name, std::size_t look, const std::vector<double>& got) {
            double absorbed = 0;
            for (std::size_t i = 0; i < got.size(); ++i) {
                const double reflectance = mean(c->world.materials[c->surfaces.faces[spots[i].face.at()].material.at()].reflectance);
                if (std::isfinite(got[i])) absorbed += spots[i].area * (1 - reflectance) * got[i];
            }
            if (!got.empty()) add_point(energy, name, look, aspect, 100 * std::abs(absorbed / emitted - 1));
        };
        put("kiln", 0, irradiance_of(c->surfaces, l, spots));
        for (const Rival& rival : s.rivals ? all_rivals(16, 16, 4096, 64) : std::vector<Rival>{}) put(rival.name, rival.look, irradiance_of(rival, *c, {}, spots, context));
    }
    r.notes.push_back(fmt::format("The smallest face has {:.3g} square units.", least_area));
    r.panels = {energy, bad, cost};
}

void sweep_placing(SweepReport& r, const SweepSettings& s, Context& context) {
    constexpr double kTarget = 5;
    const auto scene = [](const Placing& placing) {
        MapText map;
        map.placing = placing;
        const std::string grey = map.material("grey", 0.6), red = map.material("bright", 0.8), lit = map.material("lamp", 0, 12);
        map.room({0, 0, 0}, {128, 128, 96}, {grey, red, grey, grey, red, grey});
        map.box({48, 48, 94}, {80, 80, 96}, {grey, grey, grey, grey, lit, grey});
        map.box({80, 16, 0}, {112, 48, 40}, grey);
        map.entity("info_player_start", {16, 16, 48});
        return map;
    };
    struct Answer {
        std::unique_ptr<Compiled> built;
        Lighting lighting;
        std::vector<Spot> spots;
        double error = 0;
    };
    const auto answer = [&](const Placing& placing) {
        Answer a;
        a.built = built(scene(placing), context);
        a.lighting = baked(*a.built, {}, {.error_percent = kTarget}, context);
        const double scale2 = placing.scale * placing.scale;
        const auto all = spots_of(a.built->surfaces, [&](const Spot& p) { return p.area > 64 * scale2 && shown_at(a.built->surfaces, a.lighting, p) && placing.back(p.point).z < 95; });
        for (std::size_t i = 0; i < all.size(); i += 4) a.spots.push_back(all[i]); // of every 16th a rare one decided: 3 to 5.5 % from seed to seed
        // Its own noise: 2 % of paths so many, 1 % of those of a full run.
        const auto truth = irradiance_of(all_rivals(16, 16, 1, s.quick ? 4096 : 32768).back(), *a.built, {}, a.spots, context);
        a.error = rrmse(irradiance_of(a.built->surfaces, a.lighting, a.spots), truth, a.spots);
        return a;
    };
    const Limit limit{kTarget, "--error 5"};
    Panel moved{"moved", {}, {"map units", true, 1}, {"rRMSE, percent", true, 0.1, 300}, {limit}};
    Panel bits{"texels that differ after a move", {}, {"map units", true, 1}, {"share of texels", true, 1e-4}, {}};
    const Answer base = answer({});
    for (const double by : values_of(s, {0, 16, 48, 256, 4096, 65536}, {0, 16, 4096})) {
        Placing p;
        p.offset = {by, -by, by};
        const Answer a = answer(p);
        add_point(moved, "kiln, by whole luxels", 0, by, a.error);
        double differ = 0;
        for (std::size_t t = 0; t < base.lighting.flat.size(); ++t) differ += t >= a.lighting.flat.size() || base.lighting.flat[t] != a.lighting.flat[t];
        add_point(bits, "kiln, by whole luxels", 0, by, differ / static_cast<double>(base.lighting.flat.size()));
        if (by > 0) {
            p.offset = {by + 3.3125, -by + 7.6875, by - 5.1875};
            add_point(moved, "kiln, off the lattice", 1, by, answer(p).error);
        }
    }
    Panel turned{"turned", {}, {"degrees", false}, {"rRMSE, percent", true, 0.1, 300}, {limit}};
    for (const double degrees : values_of(s, {0, 10, 20, 30, 45, 60, 75, 90, 180}, {30})) add_point(turned, "kiln, about z", 0, degrees, answer(turned_about({0, 0, 1}, degrees * kPi / 180)).error);
    for (const double degrees : values_of(s, {0, 15, 30, 60, 90, 120}, {120})) // 120: the axes change places
        add_point(turned, "kiln, about (1, 1, 1)", 1, degrees, answer(turned_about(normalize(Vec3{1, 1, 1}), degrees * kPi / 180)).error);
    Panel scaled{"scaled", {}, {"times"}, {"rRMSE, percent", true, 0.1, 300}, {limit}};
    for (const double scale : values_of(s, {0.125, 0.5, 1, 4, 32, 900}, {0.125, 900})) {
        Placing p;
        p.scale = scale;
        add_point(scaled, "kiln", 0, scale, answer(p).error);
    }
    r.panels = {moved, bits, turned, scaled};
}

void sweep_degenerate(SweepReport& r, const SweepSettings& s, Context& context) {
    // One floor of 512 units from one luxel to 65,536, a lamp over it: E = I cos / r^2, by mean over the luxel.
    Panel error{"a floor in ever more luxels", {}, {"luxels of the floor"}, {"rRMSE, percent", true, 1e-4, 300}, {{5, "--error 5"}}};
    Panel time{"time", {}, {"luxels of the floor"}, {"CPU microseconds a luxel"}, {}};
    for (const double side : values_of(s, {1, 2, 4, 8, 16, 32, 64, 128, 256}, {1, 16, 32})) {
        MapText map;
        map.luxel = 512 / side;
        const std::string black = map.material("black", 0);
        map.room({0, 0, 0}, {512, 512, 512}, black);
        map.entity("info_player_start", {16, 16, 16});
        const auto c = built(map, context);
        const Vec3 lamp{250, 270, 200};
        const double start = cpu_seconds();
        const Lighting l = baked(*c, {lamp_at(lamp, 1e4)}, {}, context);
        const double cpu = cpu_seconds() - start;
        const auto floor = spots_of(c->surfaces, [](const Spot& p) { return p.normal.z > 0.5; });
        std::vector<double> truth;
        for (const Spot& p : floor)
            truth.push_back(mean_over(c->surfaces, p, static_cast<int>(std::max(4.0, 256 / side)), [&](Vec3 x) {
                const Vec3 d = lamp - x;
                return 1e4 * d.z / std::pow(length(d), 3);
            }));
        add_point(error, "kiln", 0, side * side, rrmse(irradiance_of(c->surfaces, l, floor), truth, floor));
        add_point(time, "kiln", 0, side * side, 1e6 * cpu / static_cast<double>(spots_of(c->surfaces).size()));
    }
    // Maps with something missing or too much of it.
    Panel bad{"texels and patches that are no number or negative, case by case", {}, {"case (below)", false}, {"count", true, 0.5}, {}};
    struct Case {
        const char* name;
        std::function<void(MapText&)> make;
        std::vector<Light> lights = {};
        bool sealed = true;
    };
    const auto room = [](MapText& m, double albedo, double emission = 0) {
        m.room({0, 0, 0}, {128, 128, 96}, m.material("m", albedo, emission));
        m.entity("info_player_start", {16, 16, 16});
    };
    const std::vector<Case> cases = {
        {"nothing at all", [](MapText&) {}},
        {"an entity and no brush", [](MapText& m) { m.entity("info_player_start", {}); }},
        {"no light", [&](MapText& m) { room(m, 0.5); }},
        {"a room that is black", [&](MapText& m) { room(m, 0); }, {lamp_at({64, 64, 48}, 1000)}},
        {"a room of albedo 1", [&](MapText& m) { room(m, 1); }, {lamp_at({64, 64, 48}, 1000)}},
        {"a furnace of albedo 0.999", [&](MapText& m) { room(m, 0.999, 1); }},
        {"a lamp inside a wall", [&](MapText& m) { room(m, 0.5); }, {lamp_at({-8, 64, 48}, 1000)}},
        {"a lamp on a wall", [&](MapText& m) { room(m, 0.5); }, {lamp_at({0, 64, 48}, 1000)}},
        {"a lamp without power", [&](MapText& m) { room(m, 0.5); }, {lamp_at({64, 64, 48}, 0)}},
        {"a lamp of power 1e30", [&](MapText& m) { room(m, 0.5); }, {lamp_at({64, 64, 48}, 1e30)}},
        {"a sun and no sky", [&](MapText& m) { room(m, 0.5); }, {sun_along({0, 0, -1}, 1)}},
        {"a room of one unit", [](MapText& m) { m.room({0, 0, 0}, {1, 1, 1}, m.material("m", 0.5, 1)), m.entity("info_player_start", {0.5, 0.5, 0.5}); }},
        {"all sky", [](MapText& m) { m.room({0, 0, 0}, {128, 128, 96}, kSkyMaterial), m.entity("info_player_start", {16, 16, 16}); }, {sun_along({0, 0, -1}, 1)}},
        {"a wall is missing", [](MapText& m) {
             const std::string grey = m.material("m", 0.5, 1);
             m.box({-16, -16, -16}, {144, 144, 0}, grey), m.box({-16, -16, 96}, {144, 144, 112}, grey), m.box({-16, 0, 0}, {0, 128, 96}, grey);
             m.entity("info_player_start", {16, 16, 16});
         }, {}, false},
    };
    int index = 0;
    for (const Case& one : cases) {
        ++index;
        MapText map;
        one.make(map);
        try {
            const auto c = built(map, context, !one.sealed);
            const Lighting l = baked(*c, one.lights, {}, context);
            double most = 0;
            for (const Rgb& e : l.flat) most = std::max(most, static_cast<double>(max_component(e)));
            add_point(bad, "kiln", 0, index, not_finite(l));
            r.notes.push_back(fmt::format("Case {}, {}: {} luxels, brightest {:.4g}, estimate {:.3g} %, {} of {} rays escaped.", index, one.name, c->surfaces.luxels.size(), most, l.error.estimate, l.escaped_rays, l.rays));
        } catch (const std::runtime_error& e) {
            add_point(bad, "a fault that says so", 1, index, 0);
            r.notes.push_back(fmt::format("Case {}, {}: {}.", index, one.name, e.what()));
        }
    }
    for (Series& series : bad.series) series.join = Join::none;
    r.panels = {error, time, bad};
}

} // namespace kiln::bench

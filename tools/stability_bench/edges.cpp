// Near edges, at the horizon, over folds: all with closed forms.
#include "compiler/light/lambert.h"
#include "tools/stability_bench/sweeps.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace kiln::bench {
namespace {

constexpr double kPi = std::numbers::pi;

// From a point of a floor to a wall on it: x before the wall, which runs from y0 to y1 beside the point, height h.
double floor_to_wall(double x, double y0, double y1, double h) {
    const double d = std::hypot(x, h);
    const auto half = [&](double a) { return (std::atan2(a, x) - x / d * std::atan(a / d)) / (2 * kPi); };
    return half(y1) - half(y0);
}

double field_irradiance(const LightField& field, Vec3 p, Vec3 n, std::uint32_t rays) {
    Rgbd e;
    field.arriving(p, n, rays, 1, [&](Vec3 d, Rgbd w) { e += w * std::max(0.0, dot(d, n)); });
    return mean(e);
}

} // namespace

// A sun square on a wall of albedo 1/2; it grazes the black floor before it. All light on the floor has come from the wall,
// evenly bright: E = E_sun F / 2.
void sweep_touching_faces(SweepReport& r, const SweepSettings& s, Context& context) {
    constexpr double kSide = 64, kAlbedo = 0.5;
    const std::vector<Light> sun{sun_along({-1, 0, 0}, 1)};
    const auto scene = [&](double luxel) {
        MapText map;
        map.luxel = luxel;
        const std::string black = map.material("black", 0), grey = map.material("grey", kAlbedo);
        map.room({0, 0, 0}, {kSide, kSide, kSide}, {grey, kSkyMaterial, black, black, black, black});
        map.entity("info_player_start", {32, 32, 32});
        return built(map, context);
    };
    const auto exact_at = [&](Vec3 p) { return kAlbedo * floor_to_wall(p.x, -p.y, kSide - p.y, kSide); };

    Panel near{"towards the edge, patches of 8", {}, {"distance from the edge / size of the faces"}, {"|error|, percent", true, 1e-3, 300}, {}};
    {
        const auto map = scene(8);
        const std::vector<double> distances = values_of(s, {0.5, 0.25, 0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4}, {0.5, 0.05, 1e-3, 1e-4});
        std::vector<Vec3> points;
        for (const double d : distances) points.push_back({d * kSide, 0.45 * kSide, 0});
        for (const double target : {5.0, 1.0}) {
            const Lighting l = baked(*map, sun, {.error_percent = target}, context);
            const LightField field(map->world, map->bsp, map->bsp.planes, map->surfaces, sun, l);
            for (std::size_t i = 0; i < points.size(); ++i)
                add_point(near, target == 5 ? "kiln" : "kiln --error 1", target == 5 ? 0 : 1, distances[i], 100 * std::abs(field_irradiance(field, points[i], {0, 0, 1}, target == 5 ? 1024 : 8192) / exact_at(points[i]) - 1));
        }
        for (const Rival& rival : s.rivals ? all_rivals(8, 32, 4096, 0) : std::vector<Rival>{}) {
            const auto got = irradiance_of(rival, *map, sun, points, {0, 0, 1}, {1, 0, 0}, context);
            for (std::size_t i = 0; i < got.size(); ++i) add_point(near, rival.name, rival.look, distances[i], 100 * std::abs(got[i] / exact_at(points[i]) - 1));
        }
    }
    Panel halved{"the line of luxels along the edge, patches halved", {}, {"patch and luxel, map units"}, {"|mean error|, percent", true, 1e-2, 300}, {{5, "--error 5"}}};
    Panel all{"the whole floor", {}, {"patch and luxel, map units"}, {"rRMSE, percent", true, 1e-2, 300}, {{5, "--error 5"}}};
    for (const double h : values_of(s, {64, 32, 16, 8, 4, 2}, {32, 8})) {
        const auto map = scene(h);
        const auto floor = spots_of(map->surfaces, [](const Spot& p) { return p.normal.z > 0.5; });
        std::vector<double> truth;
        for (const Spot& p : floor) truth.push_back(mean_over(map->surfaces, p, 16, exact_at));
        const auto put = [&](const std::string& name, std::size_t look, const std::vector<double>& got) {
            if (got.empty()) return;
            double sum = 0, exact = 0;
            for (std::size_t i = 0; i < floor.size(); ++i)
                if (floor[i].point.x < h) sum += got[i], exact += truth[i];
            add_point(halved, name, look, h, 100 * std::abs(sum / exact - 1));
            add_point(all, name, look, h, rrmse(got, truth, floor));
        };
        put("kiln", 0, irradiance_of(map->surfaces, baked(*map, sun, {.error_percent = 5}, context), floor));
        put("kiln --error 1", 1, irradiance_of(map->surfaces, baked(*map, sun, {.error_percent = 1}, context), floor));
        // A pair of patches each: below 4 the matrices take minutes.
        for (const Rival& rival : s.rivals ? all_rivals(h, 32, 4096, 0) : std::vector<Rival>{})
            if (h >= 4 || rival.look == kHemicubeLook || rival.look == kCutLook) put(rival.name, rival.look, irradiance_of(rival, *map, sun, floor, context));
    }
    r.panels = {near, halved, all};
}

void sweep_horizon(SweepReport& r, const SweepSettings& s, Context& context) {
    // A floor under an open sky, the sun at all heights.
    Panel sun{"sun over a floor, from the zenith to the horizon", {}, {"elevation, degrees"}, {"worst |E / (E_sun sin) - 1|", true, 1e-8}, {{1e-4, "1e-4"}}};
    Panel below{"sun below the horizon", {}, {"elevation, degrees", false}, {"most E / E_sun", true, 1e-12}, {}};
    {
        MapText map;
        const std::string black = map.material("black", 0);
        map.room({-128, -128, 0}, {128, 128, 256}, {kSkyMaterial, kSkyMaterial, kSkyMaterial, kSkyMaterial, black, kSkyMaterial});
        map.entity("info_player_start", {0, 0, 64});
        const auto c = built(map, context);
        const auto floor = spots_of(c->surfaces, [](const Spot& p) { return p.normal.z > 0.5; });
        const auto measure = [&](double elevation, bool up) {
            const double a = elevation * kPi / 180;
            const std::vector<Light> lights{sun_along({-std::cos(a) * 0.8, -std::cos(a) * 0.6, -std::sin(a)}, 1)};
            const auto put = [&](const std::string& name, std::size_t look, const std::vector<double>& got) {
                double worst = 0;
                for (const double e : got) worst = std::max(worst, up ? std::abs(e / std::sin(a) - 1) : e);
                if (!got.empty()) add_point(up ? sun : below, name, look, elevation, worst);
            };
            put("kiln", 0, irradiance_of(c->surfaces, baked(*c, lights, {}, context), floor));
            for (const Rival& rival : s.rivals ? all_rivals(64, 16, 256, 16) : std::vector<Rival>{}) put(rival.name, rival.look, irradiance_of(rival, *c, lights, floor, context));
        };
        for (const double e : values_of(s, {90, 60, 45, 30, 20, 10, 5, 2, 1, 0.5, 0.2, 0.1}, {90, 30, 1, 0.1})) measure(e, true);
        for (const double e : values_of(s, {0, -0.1, -1, -10, -45, -90}, {0, -0.1, -45})) measure(e, false);
    }
    // A lamp beside a pedestal, turned about its own middle, which stands 16 above the pedestal's top: from 30 degrees on a
    // part of it is below the horizon of the top, from 90 on it turns its face up and away.
    Panel lamp{"a lamp turned through the horizon", {}, {"tilt, degrees", false}, {"rRMSE, percent", true, 1e-3, 300}, {{5, "--error 5"}}};
    for (const double tilt : values_of(s, {0, 15, 30, 45, 60, 75, 90, 105, 120, 135}, {15, 60, 90})) {
        MapText map;
        map.luxel = 8;
        const std::string black = map.material("black", 0), lit = map.material("lamp", 0, 1);
        map.room({-192, -128, 0}, {128, 128, 192}, black);
        map.box({-64, -64, 0}, {0, 64, 64}, black);
        const double a = tilt * kPi / 180;
        const Vec3 middle{40, 0, 80}, face{-std::sin(a), 0, -std::cos(a)}, along{-std::cos(a), 0, std::sin(a)};
        std::array<Vec3, 4> polygon; // of the face that shines
        std::array<Vec3, 8> corners;
        for (std::size_t i = 0; i < 4; ++i) {
            const double p = i == 0 || i == 3 ? -32 : 32, q = i < 2 ? -32 : 32;
            polygon[i] = corners[i] = middle + along * p + Vec3{0, q, 0};
            corners[i + 4] = corners[i] - face * 2;
        }
        std::vector<MapSide> sides;
        const auto side = [&](std::array<Vec3, 3> p, const std::string& material) { // turned to the outside
            const Vec3 centre = middle - face;
            if (dot(cross(p[2] - p[0], p[1] - p[0]), p[0] - centre) < 0) std::swap(p[1], p[2]);
            sides.push_back({p, material});
        };
        side({corners[0], corners[1], corners[2]}, lit);
        side({corners[4], corners[5], corners[6]}, black);
        for (std::size_t i = 0; i < 4; ++i) side({corners[i], corners[(i + 1) % 4], corners[i + 4]}, black);
        map.brush(sides);
        map.entity("info_player_start", {-128, 0, 64});
        const auto c = built(map, context);
        const auto top = spots_of(c->surfaces, [](const Spot& p) { return p.normal.z > 0.5 && std::abs(p.point.z - 64) < 1e-6 && p.point.x < 0; });
        std::vector<double> truth;
        for (const Spot& p : top)
            truth.push_back(mean_over(c->surfaces, p, 8, [&](Vec3 x) { return dot(face, x - middle) > 0 ? kPi * lambert_form_factor(x, {0, 0, 1}, polygon) : 0.0; }));
        const auto put = [&](const std::string& name, std::size_t look, const std::vector<double>& got) {
            if (!got.empty()) add_point(lamp, name, look, tilt, rrmse(got, truth, top));
        };
        put("kiln", 0, irradiance_of(c->surfaces, baked(*c, {}, {}, context), top));
        for (const Rival& rival : s.rivals ? all_rivals(32, 32, 4096, 256) : std::vector<Rival>{}) put(rival.name, rival.look, irradiance_of(rival, *c, {}, top, context));
    }
    r.panels = {sun, below, lamp};
}

// A ridge of two slopes smoothed as one, under suns from all sides; nothing reflects. Where the face itself looks at the sun,
// E = E_sun max(0, n_shading . w); elsewhere 0. One ridge throws no shadow on its own lit side.
void sweep_smoothing(SweepReport& r, const SweepSettings& s, Context& context) {
    Panel behind{"light on faces that look away from the sun, but for the luxels along the ridge", {}, {"angle between the smoothed faces, degrees", false}, {"most E / E_sun", true, 1e-12}, {}};
    Panel form{"light against the shading normal's cosine", {}, {"angle between the smoothed faces, degrees", false}, {"worst |E - exact| / E_sun, percent", true, 1e-4}, {{5, "--error 5"}}};
    double least = 0;
    for (const double fold : values_of(s, {0, 15, 30, 45, 60, 75, 90, 105, 120}, {30, 120})) {
        MapText map;
        map.luxel = 8;
        const std::string black = map.material("black", 0);
        map.room({-128, -128, 0}, {128, 128, 256}, {kSkyMaterial, kSkyMaterial, kSkyMaterial, kSkyMaterial, black, kSkyMaterial});
        map.entity("info_player_start", {-100, 0, 200});
        // Slopes fall from the ridge by half the fold's angle on each side.
        const double t = std::tan(fold / 2 * kPi / 180), w = 48, top = std::max(64.0, 16 + w * t), foot = top - w * t;
        const Vec3 a{0, -64, top}, b{0, 64, top}, c0{-w, -64, foot}, c1{-w, 64, foot}, d0{w, -64, foot}, d1{w, 64, foot};
        std::vector<MapSide> sides;
        const auto side = [&](std::array<Vec3, 3> p, std::uint32_t smoothing) {
            const Vec3 centre{0, 0, foot / 2};
            if (dot(cross(p[2] - p[0], p[1] - p[0]), p[0] - centre) < 0) std::swap(p[1], p[2]);
            sides.push_back({p, black, smoothing});
        };
        if (fold > 0) side({a, b, c0}, 1), side({a, b, d0}, 1);
        else side({c0, c1, d0}, 1);
        side({c0, c1, {-w, 0, 0}}, 0), side({d0, d1, {w, 0, 0}}, 0);
        side({Vec3{-w, -64, 0}, {w, -64, 0}, a}, 0), side({Vec3{-w, 64, 0}, {w, 64, 0}, b}, 0), side({Vec3{-w, -64, 0}, {w, -64, 0}, {0, 64, 0}}, 0);
        map.brush(sides);
        const auto c = built(map, context);
        const auto slopes = spots_of(c->surfaces, [&](const Spot& p) { return p.normal.z > 0.1 && std::abs(p.point.x) < w && std::abs(p.point.y) < 64 && p.point.z > 1; });
        double most_behind = 0, worst = 0;
        for (const double elevation : values_of(s, {-20, 5, 15, 30, 45, 60, 75, 90, 105, 120, 135, 150, 165, 175}, {-20, 15, 60, 120, 165})) {
            const double e = elevation * kPi / 180;
            const Vec3 to_sun{std::cos(e), 0, std::sin(e)};
            const std::vector<Light> lights{sun_along(to_sun * -1.0, 1)};
            const Lighting l = baked(*c, lights, {.directional = Directional::all}, context);
            for (const Spot& p : slopes) {
                if (!shown_at(c->surfaces, l, p)) continue;
                const double got = irradiance_at(c->surfaces, l, p);
                least = std::min(least, got);
                const double facing = dot(p.normal, to_sun);
                if (facing <= 0) {
                    // Along the ridge both slopes show the same light: their luxels there are matched, half lit as filtering has it.
                    if (fold > 0 && std::abs(p.point.x) < map.luxel) continue;
                    most_behind = std::max(most_behind, got);
                } else if (elevation > 0) {
                    // The shading normal, bent along the slope, from its two ends: over the ridge halfway, at the foot the face's own.
                    const Luxel& luxel = c->surfaces.luxels[p.luxel];
                    if (luxel.area < 0.999f) continue;
                    const double across = std::abs(p.point.x) / w;
                    const Vec3 up{0, 0, 1}, n = normalize(fold > 0 ? up * (1 - across) + p.normal * across : up);
                    worst = std::max(worst, 100 * std::abs(got - std::max(0.0, dot(n, to_sun))));
                }
            }
        }
        add_point(behind, "kiln", 0, fold, most_behind);
        add_point(form, "kiln", 0, fold, worst);
    }
    r.notes.push_back(fmt::format("Least light anywhere: {:g}.", least));
    Panel negative{"least light anywhere", {}, {"angle between the smoothed faces, degrees", false}, {"least E / E_sun", false}, {}};
    add_point(negative, "kiln", 0, 0, least);
    r.panels = {behind, form, negative};
}

} // namespace kiln::bench

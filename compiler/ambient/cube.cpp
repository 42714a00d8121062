#include "compiler/ambient/cube.h"
#include "libs/core/hash.h"
#include <algorithm>
#include <bit>
#include <numbers>

namespace kiln::ambient {

Cube6 operator+(const Cube6& a, const Cube6& b) {
    Cube6 c{};
    for (std::size_t f = 0; f < 6; ++f) c[f] = a[f] + b[f];
    return c;
}
Cube6 operator-(const Cube6& a, const Cube6& b) {
    Cube6 c{};
    for (std::size_t f = 0; f < 6; ++f) c[f] = a[f] - b[f];
    return c;
}
Cube6 operator*(const Cube6& a, double s) {
    Cube6 c{};
    for (std::size_t f = 0; f < 6; ++f) c[f] = a[f] * s;
    return c;
}
double dot(const Cube6& a, const Cube6& b) {
    double sum = 0;
    for (std::size_t f = 0; f < 6; ++f) sum += kiln::dot(a[f], b[f]);
    return sum;
}

void add(Cube6& cube, Vec3 direction, Rgbd weight) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
        cube[2 * axis] += weight * cube_kernel(direction[axis]);
        cube[2 * axis + 1] += weight * cube_kernel(-direction[axis]);
    }
}

void gather(const Air& air, Vec3 point, std::uint32_t rays, std::uint64_t seed, Gathered& into) {
    const double old_share = double(into.rays) / double(into.rays + rays);
    std::uint64_t half = 0;
    for (Cube6* side : {&into.a, &into.b}) {
        const Cube6 sum = air.rest(point, rays / 2, mix(seed, std::uint64_t(into.rays), half++));
        *side = *side * old_share + sum * (1 - old_share);
    }
    into.rays += rays;
}

namespace {
constexpr std::uint64_t kReaches = 3; // what a key is for; others of the same memo in light/kept_rest.cpp
struct Reach { // whether the light of an entity comes to a point
    static constexpr bool kRawBytes = true;
    std::uint64_t from = 0, clear = 0;
    Rgbd through{1, 1, 1};
};
} // namespace

std::vector<LitBy> reaching_lights(const Air& air, Vec3 point, std::uint64_t seed, double gathered_irradiance, std::uint64_t& rays) {
    std::vector<LitBy> lights;
    double left = 0;
    air.each_light(point, [&](std::uint32_t i) {
        const auto direct = air.direct(i, point);
        if (!direct || !(max_component(direct->irradiance) > 0)) return;
        lights.push_back({i, *direct});
        left += mean(direct->irradiance);
    });
    std::sort(lights.begin(), lights.end(), [](const LitBy& a, const LitBy& b) {
        const double ea = mean(a.direct.irradiance), eb = mean(b.direct.irradiance);
        return ea != eb ? ea > eb : a.light < b.light;
    });
    constexpr double kFaint = 0.002;
    // What rays say is kept: lights that have not moved are not asked again.
    std::vector<Reach> kept, now;
    const std::uint64_t key = air.memo ? key_in(air.bounds, point, mix(kReaches, seed, std::bit_cast<std::uint64_t>(point.x), std::bit_cast<std::uint64_t>(point.y), std::bit_cast<std::uint64_t>(point.z))) : 0;
    if (const auto before = air.memo ? air.memo->find(key, {}) : std::nullopt) read_whole(*before, kept);
    bool all_kept = true;
    const auto ask = [&](std::uint32_t l) {
        Reach reach{air.memo ? air.comes_from(l) : 0};
        if (const auto at = std::ranges::find(kept, reach.from, &Reach::from); at != kept.end()) return *at;
        all_kept = false;
        reach.clear = air.light_clear(l, point);
        if (reach.clear && air.light_through) reach.through = air.light_through(l, point);
        return reach;
    };
    std::vector<LitBy> reaching;
    double arrived = gathered_irradiance;
    for (LitBy& light : lights) {
        if (left <= kFaint * arrived) break;
        const double e = mean(light.direct.irradiance);
        left -= e, ++rays;
        const Reach reach = ask(light.light);
        if (air.memo) now.push_back(reach);
        if (!reach.clear) continue;
        if (reach.through != Rgbd{1, 1, 1}) light.direct.irradiance = light.direct.irradiance * reach.through, light.filtered = true;
        arrived += mean(light.direct.irradiance);
        reaching.push_back(light);
    }
    if (air.memo && !all_kept) air.memo->keep(key, {}, {}, to_bytes(now));
    std::ranges::stable_partition(reaching, [](const LitBy& light) { return !light.filtered; });
    return reaching;
}

std::vector<Vec3> spread_directions(std::size_t n) {
    std::vector<Vec3> directions(n);
    const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
    for (std::size_t i = 0; i < n; ++i) {
        const double z = 1 - (2 * double(i) + 1) / double(n), r = std::sqrt(1 - z * z), phi = golden * double(i);
        directions[i] = {r * std::cos(phi), r * std::sin(phi), z};
    }
    return directions;
}

} // namespace kiln::ambient

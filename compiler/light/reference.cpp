// Path-traced truth. Every vertex samples one emitter by its possible contribution and continues by the cosine;
// both find emitters, and the balance heuristic (E. Veach 1997) counts each radiance once. Nothing of the bake is
// used but the tracer and the list of emitters.
#include "compiler/light/path_tracer.h"

namespace kiln {
namespace {
constexpr double kPi = std::numbers::pi;
constexpr HemisphereMap kFirstMap{0.6};
constexpr int kRouletteFrom = 3, kMostBounces = 4096;
} // namespace

NearLights::NearLights(const LightField::Data& d, Vec3 x) {
    for (std::uint32_t i = 0; i < d.lights.size(); ++i) {
        const Light& light = d.lights[i]; // of a sky the bound is nothing, of a sun it is the same everywhere
        const double bound = light_bound(light, x, std::min(d.near_reach, length(light.position - x) - 1));
        if (!(bound > 0)) continue;
        if (sees(d.scene, x, light)) seen.push_back(i);
        else others.push_back(i), choice.add(bound);
    }
}

Rgbd PathTracer::reflected(SceneHit hit, Vec3 came, Random& random, bool cached) const {
    Rgbd sum, throughput{1, 1, 1};
    Choice choice;
    for (int bounce = 0; bounce < kMostBounces; ++bounce) {
        const Face& face = d.surfaces.faces[hit.face.at()];
        if (!face.drawn || face.sky) break;
        if (cached && (bounce >= kNearBounces || !d.is_near(hit))) {
            sum += throughput * d.reflected(hit, looked);
            break;
        }
        Rgbd rho = static_cast<Rgbd>(d.world.materials[face.material.at()].reflectance);
        for (std::size_t c = 0; c < 3; ++c) rho[c] = std::clamp(rho[c], 0.0, 0.99);
        throughput = throughput * rho;
        if (bounce >= kRouletteFrom && !cached) {
            const double survive = std::min(0.95, max_component(throughput));
            if (!(random() < survive)) break;
            throughput *= 1 / survive;
        }
        if (!(max_component(throughput) > 0)) break;
        Vec3 n = face.normal;
        if (dot(n, came) > 0) n = -n; // the back of a two-sided face
        const Vec3 x = hit.position + n * d.scene.push_off();
        sum += throughput * entities(x, n, random) * (1 / kPi);
        choice.build(d.emitters, x, n, cached ? 1.5 * mean(d.reflected(hit, looked)) / std::max(mean(rho), 1e-3) : 0);
        Vec3 way;
        Rgbd weight;
        const double pick = random(), u = random(), v = random();
        if (emitter_sample(
                choice, x, n, pick, {u, v}, [&](Vec3 w) { return dot(w, n) / kPi; }, &way, &weight))
            sum += throughput * weight * (dot(way, n) / kPi);
        const double a = random(), b = random();
        const Vec3 next = frame_around(n).world(cosine_hemisphere({a, b}));
        count();
        const std::optional<SceneHit> found = d.scene.closest(x, next);
        if (!found) {
            sum += throughput * d.sky;
            break;
        }
        if (found->back) break;
        const std::uint32_t e = d.emitter(*found, next);
        if (e != UINT32_MAX) {
            const double p = density_of(choice, e, found->position - x, -dot(next, d.emitters.emitters[e].normal));
            const double q = dot(next, n) / kPi;
            sum += throughput * d.emitters.emitters[e].radiance * (q / (p + q));
        }
        hit = *found, came = next;
    }
    return sum;
}

Rgbd PathTracer::met(const Choice& choice, Vec3 x, Vec3 way, double density, Random& random) const {
    count();
    const std::optional<SceneHit> hit = d.scene.closest(x, way);
    if (!hit) return d.sky;
    if (hit->back) return {};
    Rgbd radiance = reflected(*hit, way, random, false);
    const std::uint32_t e = d.emitter(*hit, way);
    if (e != UINT32_MAX) {
        const double other = density_of(choice, e, hit->position - x, -dot(way, d.emitters.emitters[e].normal));
        radiance += d.emitters.emitters[e].radiance * (density / (other + density));
    }
    return radiance;
}

void reference_arriving(const LightField& field, Vec3 point, Vec3 normal, std::uint32_t paths, std::uint64_t seed,
                        const Arrival& arrival) {
    const LightField::Data& d = field.data();
    const PathTracer tracer{d};
    field.arriving_direct(point, normal, seed, arrival);
    const bool free = normal == Vec3{};
    const Vec3 x = d.origin_at(point, normal);
    const Frame frame = free ? Frame{} : frame_around(normal);
    Choice choice;
    choice.build(d.emitters, x, normal);
    const auto density = [&](Vec3 w) {
        return free ? 1 / (4 * kPi) : dot(w, normal) > 0 ? kFirstMap.density(dot(w, normal)) : 0.0;
    };
    const Sobol points(mix(seed, std::uint64_t{31}));
    const double share = 1.0 / paths;
    for (std::uint32_t i = 0; i < paths; ++i) {
        Random random(mix(seed, i, std::uint64_t{32}));
        Vec3 way;
        Rgbd weight;
        if (tracer.emitter_sample(choice, x, normal, points(i, 4), points.pair(i, 2), density, &way, &weight))
            arrival(way, weight * share);
        const Vec2 u = points.pair(i, 0);
        const Vec3 direction = free ? uniform_sphere(u) : frame.world(kFirstMap.direction(u));
        const double q = density(direction);
        if (!(q > 0)) continue;
        const Rgbd radiance = tracer.met(choice, x, direction, q, random);
        if (max_component(radiance) > 0) arrival(direction, radiance * (share / q));
    }
}

} // namespace kiln

// Path-traced truth. Every vertex samples one emitter by its possible contribution and continues by the cosine; both
// find emitters, and the balance heuristic (E. Veach 1997) counts each radiance once. Nothing of the bake is used
// but the tracer and the list of emitters.
#include "compiler/light/field_data.h"
#include "libs/sampling/maps.h"
#include <numbers>

namespace kiln {
namespace {
constexpr double kPi = std::numbers::pi;
constexpr HemisphereMap kFirstMap{0.6};
constexpr int kRouletteFrom = 3, kMostBounces = 4096;

// Choice of an emitter at one point.
struct Choice {
    std::vector<double> cumulative;
    double total() const { return cumulative.empty() ? 0 : cumulative.back(); }
    void build(const EmitterSet& set, Vec3 x, Vec3 n) {
        cumulative.clear();
        double sum = 0;
        for (std::uint32_t i = 0; i < set.emitters.size(); ++i)
            cumulative.push_back(sum += mean(set.emitters[i].radiance) * set.bound(i, x, n));
    }
    double probability(std::uint32_t i) const {
        return (cumulative[i] - (i ? cumulative[i - 1] : 0)) / total();
    }
    std::uint32_t pick(double u) const {
        const auto at = std::upper_bound(cumulative.begin(), cumulative.end(), u * total());
        return static_cast<std::uint32_t>(std::min<std::ptrdiff_t>(at - cumulative.begin(),
                                                                    static_cast<std::ptrdiff_t>(cumulative.size()) - 1));
    }
};

struct Tracer {
    const LightField::Data& d;

    double density_of(const Choice& choice, std::uint32_t e, Vec3 d_to, double cosine) const { // solid angle
        const double p = choice.total() > 0 ? choice.probability(e) : 0;
        return p * dot(d_to, d_to) / (d.emitters.emitters[e].area * cosine);
    }
    // One explicit sample of an emitter: direction and radiance over density, weighted against `other` (density of the
    // bundle in that direction).
    template <class Other>
    bool emitter_sample(const Choice& choice, Vec3 x, Vec3 n, double pick, Vec2 u, const Other& other, Vec3* way, Rgbd* weight) const {
        if (!(choice.total() > 0)) return false;
        const std::uint32_t e = choice.pick(pick);
        const Emitter& emitter = d.emitters.emitters[e];
        const Vec3 y = d.emitters.point_on(e, u), to = y - x;
        const double r = length(to);
        if (!(r > 0)) return false;
        *way = to / r;
        const double cosine = -dot(*way, emitter.normal);
        if (cosine <= 1e-12 || (!(n == Vec3{}) && dot(*way, n) <= 0)) return false;
        if (d.scene.occluded(x, y + emitter.normal * d.scene.push_off())) return false;
        const double p = density_of(choice, e, to, cosine);
        *weight = emitter.radiance / (p + other(*way));
        return true;
    }
    // Irradiance from entities at a surface vertex.
    Rgbd entities(Vec3 x, Vec3 n, Random& random) const {
        Rgbd e;
        for (const Light& light : d.lights) {
            LightSample s;
            const double a = random(), b = random();
            if (!sample_light(light, x, n, {a, b}, &s)) continue;
            if (!(s.distant ? d.scene.reaches_sky(x, s.direction) : !d.scene.occluded(x, s.position))) continue;
            e += s.weight * dot(s.direction, n) + s.ambient;
        }
        return e;
    }
    // Radiance reflected at `hit` towards where the ray came from.
    Rgbd reflected(SceneHit hit, Vec3 came, Random& random) const {
        Rgbd sum, throughput{1, 1, 1};
        Choice choice;
        for (int bounce = 0; bounce < kMostBounces; ++bounce) {
            const Face& face = d.surfaces.faces[hit.face.at()];
            if (!face.drawn || face.sky) break;
            Rgbd rho = static_cast<Rgbd>(d.world.materials[face.material.at()].reflectance);
            for (std::size_t c = 0; c < 3; ++c) rho[c] = std::clamp(rho[c], 0.0, 0.99);
            throughput = throughput * rho;
            if (bounce >= kRouletteFrom) {
                const double survive = std::min(0.95, max_component(throughput));
                if (!(random() < survive)) break;
                throughput *= 1 / survive;
            }
            if (!(max_component(throughput) > 0)) break;
            Vec3 n = face.normal;
            if (dot(n, came) > 0) n = -n; // the back of a two-sided face
            const Vec3 x = hit.position + n * d.scene.push_off();
            sum += throughput * entities(x, n, random) * (1 / kPi);
            choice.build(d.emitters, x, n);
            Vec3 way;
            Rgbd weight;
            const double pick = random(), u = random(), v = random();
            if (emitter_sample(choice, x, n, pick, {u, v}, [&](Vec3 w) { return dot(w, n) / kPi; }, &way, &weight))
                sum += throughput * weight * (dot(way, n) / kPi);
            const double a = random(), b = random();
            const Vec3 next = frame_around(n).world(cosine_hemisphere({a, b}));
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
};
} // namespace

void reference_arriving(const LightField& field, Vec3 point, Vec3 normal, std::uint32_t paths, std::uint64_t seed,
                        const Arrival& arrival) {
    const LightField::Data& d = field.data();
    const Tracer tracer{d};
    field.arriving_direct(point, normal, seed, arrival);
    const bool free = normal == Vec3{};
    const Vec3 x = d.origin_at(point, normal);
    const Frame frame = free ? Frame{} : frame_around(normal);
    Choice choice;
    choice.build(d.emitters, x, normal);
    const auto density = [&](Vec3 w) { return free ? 1 / (4 * kPi) : dot(w, normal) > 0 ? kFirstMap.density(dot(w, normal)) : 0.0; };
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
        const std::optional<SceneHit> hit = d.scene.closest(x, direction);
        Rgbd radiance;
        if (!hit) {
            radiance = d.sky;
        } else if (!hit->back) {
            radiance = tracer.reflected(*hit, direction, random);
            const std::uint32_t e = d.emitter(*hit, direction);
            if (e != UINT32_MAX) {
                const double p = tracer.density_of(choice, e, hit->position - x, -dot(direction, d.emitters.emitters[e].normal));
                radiance += d.emitters.emitters[e].radiance * (q / (p + q));
            }
        }
        if (max_component(radiance) > 0) arrival(direction, radiance * (share / q));
    }
}

} // namespace kiln

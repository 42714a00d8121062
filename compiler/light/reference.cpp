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

// With what lights the patch of a piece: one of them. Those that bring its luxels nothing bring nothing close by.
Rgbd PathTracer::entities(std::uint32_t piece, Vec3 x, Vec3 n, Random& random) const {
    Rgbd e;
    if (piece == kNoPiece || d.lighting.first_brought.empty()) {
        for (const Light& light : d.lights) e += entity(light, x, n, random);
        return e;
    }
    if (looked) looked->at(d.entities_part(piece));
    const std::span<const LightBrings> list = d.entities_of(piece);
    thread_local Choice choice;
    thread_local std::vector<double> could, brought;
    could.clear(), brought.clear();
    for (const LightBrings& b : list) could.push_back(light_bound(d.lights[b.light], x, 0)), brought.push_back(static_cast<double>(b.irradiance));
    choose_by_light(brought, could, &choice);
    if (!(choice.total() > 0)) return e;
    const std::uint32_t at = choice.pick(random());
    return entity(d.lights[list[at].light], x, n, random) * (choice.total() / choice.weight(at));
}

Rgbd PathTracer::reflected(SceneHit hit, Vec3 came, Random& random, End* end) const {
    Rgbd sum, throughput{1, 1, 1};
    Choice choice;
    for (int bounce = 0; bounce < kMostBounces; ++bounce) {
        const Face& face = d.surfaces.faces[hit.face.at()];
        if (!face.drawn || face.sky) break;
        const std::uint32_t place = end ? d.place_at(hit) : FieldBundle::kBlack;
        if (end && (bounce >= kNearBounces || !d.is_near(hit, came, looked))) {
            *end = {place, throughput};
            break;
        }
        Rgbd rho = static_cast<Rgbd>(d.world.materials[face.material.at()].reflectance);
        for (std::size_t c = 0; c < 3; ++c) rho[c] = std::clamp(rho[c], 0.0, 0.99);
        throughput = throughput * rho;
        if (bounce >= kRouletteFrom && !end) {
            const double survive = std::min(0.95, max_component(throughput));
            if (!(random() < survive)) break;
            throughput *= 1 / survive;
        }
        if (!(max_component(throughput) > 0)) break;
        Vec3 n = face.normal;
        if (dot(n, came) > 0) n = -n; // the back of a two-sided face
        const Vec3 x = hit.position + n * d.scene.push_off();
        sum += throughput * entities(end ? place : kNoPiece, x, n, random) * (1 / kPi);
        if (looked && end && !d.emitters.emitters.empty()) looked->at(place);
        // Close by, what does not stand out makes no noise, nor does the sky: it is left to the path.
        const double least = end ? 1.5 * mean(d.reflected(place)) / std::max(mean(rho), 1e-3) : 0;
        choice.build(d.emitters, x, n, [&](const Emitter& e) { return !end || (!e.sky && mean(e.radiance) > least); });
        Vec3 way;
        Rgbd weight;
        const double pick = random(), u = random(), v = random();
        if (emitter_sample(
                choice, x, n, pick, {u, v}, [&](Vec3 w) { return dot(w, n) / kPi; }, &way, &weight))
            sum += throughput * weight * (dot(way, n) / kPi);
        const double a = random(), b = random();
        const Vec3 next = frame_around(n).world(cosine_hemisphere({a, b}));
        count();
        std::optional<SceneHit> found = d.scene.closest(x, next);
        if (d.scene.has_panes()) { // the path goes on from one of them or through all, drawn by what each makes of the light
            const double q = dot(next, n) / kPi;
            std::vector<PaneHit> panes;
            d.scene.panes(x, next, found ? found->distance : 1e30, {}, panes);
            bool turned = false;
            for (const PaneHit& pane : panes) {
                if (const std::uint32_t e = d.emitter(pane.hit, next); e != UINT32_MAX)
                    sum += throughput * d.emitters.emitters[e].radiance * (q / (q + density_of(choice, e, pane.hit.position - x, -dot(next, d.emitters.emitters[e].normal))));
                const double passes = mean(pane.through), all = passes + pane.opacity;
                if (!(all > 0)) throughput = {};
                if (pane.opacity > 0 && random() * all < pane.opacity) {
                    throughput *= all; // opacity / (opacity / all)
                    found = pane.hit, turned = true;
                    break;
                }
                if (all > 0) throughput = throughput * pane.through * (all / std::max(passes, 1e-30));
            }
            if (!(max_component(throughput) > 0)) break;
            if (turned) {
                hit = *found, came = next;
                continue;
            }
        }
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
    const auto emitted = [&](const SceneHit& at) {
        const std::uint32_t e = d.emitter(at, way);
        if (e == UINT32_MAX) return Rgbd{};
        const double other = density_of(choice, e, at.position - x, -dot(way, d.emitters.emitters[e].normal));
        return d.emitters.emitters[e].radiance * (density / (other + density));
    };
    Rgbd sum, through{1, 1, 1};
    if (d.scene.has_panes()) {
        std::vector<PaneHit> panes;
        d.scene.panes(x, way, hit ? hit->distance : 1e30, {}, panes);
        for (const PaneHit& pane : panes) {
            sum += through * emitted(pane.hit);
            if (pane.opacity > 0) sum += through * reflected(pane.hit, way, random) * pane.opacity;
            through = through * pane.through;
        }
        if (!(max_component(through) > 0)) return sum;
    }
    if (!hit) return sum + through * d.sky;
    if (hit->back) return sum;
    const Rgbd radiance = reflected(*hit, way, random);
    return sum + through * (radiance + emitted(*hit));
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

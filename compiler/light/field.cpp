// The baked scene asked for incoming light at any point.
#include "compiler/light/path_tracer.h"
#include <numbers>

namespace kiln {
namespace {
constexpr double kPi = std::numbers::pi;
// Directions for kernels that need not fall with the cosine: see HemisphereMap.
constexpr HemisphereMap kFieldMap{0.6};
constexpr std::uint32_t kTestRays = 16; // towards an emitter, before the bundle is trusted with it

// visit(texel, weight) for the up to four texels between whose centres a point of the chart lies.
template <class Visit> void for_each_bilinear(const Surfaces& surfaces, FaceId face, Vec3 point, const Visit& visit) {
    const Chart& chart = surfaces.charts[surfaces.faces[face.at()].chart.at()];
    const Vec2 p = luxel_from_world(surfaces, face, point);
    const double x = p.x - 0.5, y = p.y - 0.5;
    const double x0 = std::floor(x), y0 = std::floor(y);
    for (int j = 0; j < 2; ++j)
        for (int i = 0; i < 2; ++i) {
            const double u = x0 + i, v = y0 + j;
            if (u < 0 || v < 0 || u >= chart.width || v >= chart.height) continue;
            visit(chart.first_texel + static_cast<std::size_t>(v) * chart.width + static_cast<std::size_t>(u),
                  (i ? x - x0 : 1 - x + x0) * (j ? y - y0 : 1 - y + y0));
        }
}
} // namespace

Rgbd LightField::Data::reflected(const SceneHit& hit, Looked* looked) const {
    const Face& face = surfaces.faces[hit.face.at()];
    std::uint32_t patch = lighting.face_patch[hit.face.at()];
    if (face.chart.valid()) {
        const std::uint32_t texel = index.texel_at(hit.face, hit.position);
        const bool whole = lighting.patch_index[texel] < kMixedPatch;
        if (looked && whole) looked->at(lighting.patch_index[texel]); // whether it is valid, too
        if (whole && lighting.valid[texel] == 1) {
            // Bilinear between luxels that were baked and belong to one patch.
            Rgbd sum;
            double weight = 0;
            for_each_bilinear(surfaces, hit.face, hit.position, [&](std::size_t t, double w) {
                if (lighting.patch_index[t] >= kMixedPatch) return;
                if (looked) looked->at(lighting.patch_index[t]);
                if (lighting.valid[t] != 1) return;
                sum += static_cast<Rgbd>(texel_reflected[t]) * w, weight += w;
            });
            if (weight > 0) return sum / weight;
        }
        const std::uint32_t piece = index.piece_at(hit.face, hit.position);
        patch = piece == UINT32_MAX ? kNoPatch : lighting.piece_patch[piece];
    }
    if (patch == kNoPatch) return {};
    if (looked) looked->at(patch);
    return static_cast<Rgbd>(patch_reflected[patch]);
}

std::uint32_t LightField::Data::lights_part(Vec3 x) const {
    std::uint32_t at = 0;
    for (std::size_t a = 0; a < 3; ++a) {
        const double share = (x[a] - bounds.lo[a]) / std::max(bounds.hi[a] - bounds.lo[a], 1e-9);
        at = at * kBoxes + static_cast<std::uint32_t>(std::clamp(share * kBoxes, 0.0, kBoxes - 1.0));
    }
    return static_cast<std::uint32_t>(lighting.patches.size()) + at;
}

std::vector<std::uint64_t> LightField::part_states() const {
    const Data& d = *data_;
    const Lighting& l = d.lighting;
    std::vector<std::uint64_t> states;
    states.reserve(d.part_count());
    for (std::size_t p = 0; p < l.patches.size(); ++p) states.push_back(hash_of(std::make_pair(l.patches[p], d.patch_reflected[p])).low);
    const auto bits = [](float x) { return std::bit_cast<std::uint32_t>(x); };
    for (std::size_t t = 0; t < l.flat.size(); ++t)
        if (l.valid[t] == 1 && l.patch_index[t] < kMixedPatch) {
            const Rgb r = d.texel_reflected[t];
            std::uint64_t& state = states[l.patch_index[t]];
            state = mix(state, t, bits(r.x) | std::uint64_t{bits(r.y)} << 32, bits(r.z));
        }
    // Lights that can bring anything to where paths from points of the box may come.
    std::vector<std::uint64_t> ids;
    for (const Light& light : d.lights) ids.push_back(light_id(light));
    const Vec3 size = d.bounds.size() / Data::kBoxes;
    for (std::uint32_t i = 0; i < Data::kBoxes * Data::kBoxes * Data::kBoxes; ++i) {
        const Vec3 at{double(i / (Data::kBoxes * Data::kBoxes)), double(i / Data::kBoxes % Data::kBoxes), double(i % Data::kBoxes)};
        const Vec3 center = d.bounds.lo + size * 0.5 + Vec3{size.x * at.x, size.y * at.y, size.z * at.z};
        std::uint64_t state = 0;
        for (std::size_t k = 0; k < d.lights.size(); ++k)
            if (light_bound(d.lights[k], center, length(size) / 2 + d.near_reach) > 0) state = mix(state, ids[k]);
        states.push_back(state);
    }
    return states;
}

std::uint64_t LightField::state() const {
    const Data& d = *data_;
    ByteWriter w;
    w(d.sky, d.emitters.of_face);
    for (const Emitter& e : d.emitters.emitters) w(e.radiance);
    return hash_bytes(w.bytes).low;
}

bool LightField::Data::is_near(const SceneHit& hit) const {
    const ChartId chart = surfaces.faces[hit.face.at()].chart;
    return chart.valid() && hit.distance < kNearLuxels * surfaces.charts[chart.at()].luxel_size;
}

std::uint32_t LightField::Data::emitter(const SceneHit& hit, Vec3 direction) const {
    if (dot(surfaces.faces[hit.face.at()].normal, direction) >= 0) return UINT32_MAX;
    return emitters.of_face[hit.face.at()];
}

Vec3 LightField::Data::origin_at(Vec3 point, Vec3 normal) const {
    if (normal == Vec3{}) return point;
    constexpr double kReach = 0.25; // map units: how far off its face a given point may be
    const Vec3 above = point + normal * kReach;
    const std::optional<SceneHit> hit = scene.closest(above, -normal, 2 * kReach);
    if (hit && !hit->back && dot(surfaces.faces[hit->face.at()].normal, normal) > 0.5)
        return hit->position + normal * scene.push_off();
    return point + normal * scene.push_off();
}

LightField::LightField(const World& world, const Bsp&, const PlaneTable&, const Surfaces& surfaces,
                       const std::vector<Light>& lights, const Lighting& lighting)
    : data_(new Data{world,
                     surfaces,
                     lights,
                     lighting,
                     TraceScene(world, surfaces),
                     LuxelIndex(surfaces),
                     EmitterSet(world, surfaces, sky_radiance(lights)),
                     sky_radiance(lights),
                     {},
                     {}}) {
    Data& d = *data_;
    for (const Chart& c : surfaces.charts) d.near_reach = std::max(d.near_reach, (kNearBounces + 1) * kNearLuxels * c.luxel_size);
    for (const Vec3& p : surfaces.positions) // whatever is near a surface lies in there
        for (const double side : {-d.near_reach, d.near_reach}) d.bounds.add(p + Vec3{side, side, side});
    constexpr double inv_pi = 1 / kPi;
    d.patch_reflected.resize(lighting.patches.size());
    for (std::size_t p = 0; p < lighting.patches.size(); ++p)
        d.patch_reflected[p] = (lighting.radiosity[p] - lighting.patches[p].emission) * static_cast<float>(inv_pi);
    d.texel_reflected.resize(lighting.flat.size());
    for (const Luxel& l : surfaces.luxels) {
        const Chart& c = surfaces.charts[l.chart.at()];
        const std::size_t texel = c.first_texel + l.y * c.width + l.x;
        const std::uint32_t patch = lighting.patch_index[texel];
        if (patch < kMixedPatch)
            d.texel_reflected[texel] = static_cast<Rgb>(static_cast<Rgbd>(lighting.patches[patch].reflectance) *
                                                        static_cast<Rgbd>(lighting.flat[texel]) * inv_pi);
    }
}
LightField::~LightField() = default;

const TraceScene& LightField::scene() const {
    return data_->scene;
}
const LightField::Data& LightField::data() const {
    return *data_;
}

void LightField::arriving(Vec3 point, Vec3 normal, std::uint32_t rays, std::uint64_t seed,
                          const Arrival& arrival) const {
    arriving_direct(point, normal, seed, arrival);
    arriving_rest(point, normal, rays, seed, arrival);
}

void LightField::arriving_direct(Vec3 point, Vec3 normal, std::uint64_t seed, const Arrival& arrival) const {
    const Data& d = *data_;
    const Vec3 x = d.origin_at(point, normal);
    for (std::size_t i = 0; i < d.lights.size(); ++i) {
        const Light& light = d.lights[i];
        const bool disc = light.kind == LightKind::sun && light.angular_radius_rad > 0;
        const std::uint32_t samples = disc ? 64 : 1;
        const Sobol points(mix(seed, i, std::uint64_t{21}));
        for (std::uint32_t k = 0; k < samples; ++k) {
            LightSample s;
            if (!sample_light(light, x, normal, points.pair(k, 0), &s)) continue;
            const Rgbd through = kiln::arriving(d.scene, x, s, 0, {}, part_of_disc(light, samples));
            if (!(max_component(through) > 0)) continue;
            arrival(s.direction, through * (s.weight * (1.0 / samples)));
            if (light.angle_scale < 1)
                arrival(normal == Vec3{} ? s.direction : normal, through * (s.ambient * (1.0 / samples)));
        }
    }
}

void LightField::arriving_rest(Vec3 point, Vec3 normal, std::uint32_t rays, std::uint64_t seed,
                               const Arrival& arrival, Looked* looked, std::vector<Vec3>* bundle) const {
    const Data& d = *data_;
    const bool free = normal == Vec3{};
    const Vec3 x = d.origin_at(point, normal);
    std::optional<NearLights> lights_near; // of x, where a hit asks for them
    PathTracer tracer{d};
    tracer.looked = looked;
    if (looked) looked->begin(d.part_count());
    const auto look_near = [&] {
        if (lights_near) return;
        lights_near.emplace(d, x), tracer.near = &*lights_near;
        if (looked) looked->at(d.lights_part(x));
    };
    rays = std::max(rays, 4u);
    const Sobol points(mix(seed, std::uint64_t{22}));
    const Frame frame = free ? Frame{} : frame_around(normal);
    std::vector<Vec3> origins(rays, x), directions(rays);
    std::vector<double> solid(rays);
    for (std::uint32_t i = 0; i < rays; ++i) {
        const Vec2 u = points.pair(i, 0);
        if (free) {
            directions[i] = uniform_sphere(u);
            solid[i] = 4 * kPi / rays;
        } else {
            const Vec3 local = kFieldMap.direction(u);
            directions[i] = frame.world(local);
            solid[i] = 1 / (kFieldMap.density(local.z) * rays);
        }
    }
    std::vector<std::optional<SceneHit>> hits(rays);
    d.scene.closest(origins, directions, hits);
    std::vector<Rgbd> radiance(rays);
    std::vector<std::uint32_t> emitter(rays, UINT32_MAX);
    struct PaneLight { // of a pane that shines
        std::uint32_t ray, emitter;
        Rgbd through;
    };
    std::vector<PaneLight> pane_lights;
    std::vector<Rgbd> through(d.scene.has_panes() ? rays : 0, Rgbd{1, 1, 1}); // of a ray, to the end of it
    std::vector<PaneHit> panes;
    Rgbd total;
    for (std::uint32_t i = 0; i < rays; ++i) {
        const double k = free ? 0.25 : dot(directions[i], normal); // mean of max(0, cos) over axes
        Rgbd of_panes;
        if (!through.empty()) {
            d.scene.panes(x, directions[i], hits[i] ? hits[i]->distance : 1e30, {.end = std::sqrt(solid[i])}, panes);
            Random random(mix(seed, i, std::uint64_t{26}));
            for (const PaneHit& pane : panes) {
                if (pane.opacity > 0) {
                    const bool is_near = d.is_near(pane.hit);
                    if (is_near) look_near();
                    of_panes += through[i] * (is_near ? tracer.reflected(pane.hit, directions[i], random, true) : d.reflected(pane.hit, looked)) * pane.opacity;
                }
                if (const std::uint32_t e = d.emitter(pane.hit, directions[i]); e != UINT32_MAX) {
                    pane_lights.push_back({i, e, through[i]});
                    total += through[i] * d.emitters.emitters[e].radiance * (solid[i] * k);
                }
                through[i] = through[i] * pane.through;
            }
        }
        if (!hits[i]) {
            radiance[i] = d.sky;
        } else if (!hits[i]->back) {
            emitter[i] = d.emitter(*hits[i], directions[i]);
            Random random(mix(seed, i, std::uint64_t{25}));
            const bool is_near = d.is_near(*hits[i]);
            if (is_near) look_near();
            radiance[i] = is_near ? tracer.reflected(*hits[i], directions[i], random, true) : d.reflected(*hits[i], looked);
            if (emitter[i] != UINT32_MAX) total += (through.empty() ? Rgbd{1, 1, 1} : through[i]) * (d.emitters.emitters[emitter[i]].radiance * (solid[i] * k));
        }
        if (!through.empty()) radiance[i] = of_panes + through[i] * radiance[i];
        total += radiance[i] * (solid[i] * k);
    }
    // Emitters whose light would be noisy in the bundle get rays of their own, if the bundle or a few test rays see
    // them at all.
    const double e = mean(total), background = e / kPi;
    std::vector<std::uint8_t> listed(d.emitters.emitters.size()), met(listed.size());
    for (const std::uint32_t i : emitter)
        if (i != UINT32_MAX) met[i] = 1;
    for (const PaneLight& p : pane_lights) met[p.emitter] = 1;
    const std::uint32_t samples = std::clamp(rays / 32, 4u, 64u);
    for (std::uint32_t i = 0; i < listed.size(); ++i) {
        const Emitter& emitter_i = d.emitters.emitters[i];
        const double contrast = mean(emitter_i.radiance) - background;
        if (contrast <= 0) continue;
        const double least =
            0.003 * e * std::sqrt(static_cast<double>(rays)) / (0.5 * kPi * contrast); // of sqrt(F)
        if (d.emitters.bound(i, x, normal) <= std::min(0.5, least * least)) continue;
        const double factor = d.emitters.form_factor(i, x, normal);
        if (factor <= std::min(0.5, least * least)) continue;
        const Vec3 off = emitter_i.normal * d.scene.push_off();
        const Sobol test(mix(seed, i, std::uint64_t{23})), light(mix(seed, i, std::uint64_t{24}));
        listed[i] = met[i];
        for (std::uint32_t k = 0; k < kTestRays && !listed[i]; ++k) {
            const Vec3 y = d.emitters.point_on(i, test.pair(k, 0)) + off;
            if (!free && dot(y - x, normal) <= 0) continue;
            listed[i] = !d.scene.occluded(x, y);
        }
        if (!listed[i]) continue;
        d.emitters.sample(i, x, normal, 0, samples, light, 1e-4, EmitterSet::Arrival::each, EmitterSet::Share::cosine, [&](Vec3 y, Vec3 flux) {
            const Rgbd arrives = d.scene.transmitted(x, y + off, {.end = std::sqrt(emitter_i.area / samples), .end_normal = emitter_i.normal});
            if (!(max_component(arrives) > 0)) return;
            const double share = length(flux);
            arrival(flux / share, arrives * (emitter_i.radiance * share));
        });
    }
    for (const PaneLight& p : pane_lights)
        if (!listed[p.emitter]) radiance[p.ray] += p.through * d.emitters.emitters[p.emitter].radiance;
    for (std::uint32_t i = 0; i < rays; ++i) {
        if (emitter[i] != UINT32_MAX && !listed[emitter[i]])
            radiance[i] += (through.empty() ? Rgbd{1, 1, 1} : through[i]) * d.emitters.emitters[emitter[i]].radiance;
        if (max_component(radiance[i]) > 0) arrival(directions[i], radiance[i] * solid[i]);
    }
    if (bundle) *bundle = std::move(directions);
}

// Radiance of one face as an engine shows it.
Rgbd LightField::Data::shown(const SceneHit& hit, Vec3 direction) const {
    Rgbd emitted;
    const std::uint32_t e = emitter(hit, direction);
    if (e != UINT32_MAX) emitted = emitters.emitters[e].radiance;
    return emitted + lit(hit);
}

Rgbd LightField::Data::lit(const SceneHit& hit) const {
    const Face& face = surfaces.faces[hit.face.at()];
    if (!face.chart.valid()) return reflected(hit);
    // Four texels, bilinear; texels of no face left out.
    Rgbd sum;
    double weight = 0;
    for_each_bilinear(surfaces, hit.face, hit.position, [&](std::size_t t, double w) {
        if (!lighting.valid[t]) return;
        sum += static_cast<Rgbd>(lighting.flat[t]) * w, weight += w;
    });
    if (!(weight > 0)) return reflected(hit);
    const Rgbd rho = face.drawn ? static_cast<Rgbd>(world.materials[face.material.at()].reflectance) : Rgbd{};
    return rho * sum * (1 / (weight * kPi));
}

Rgb LightField::radiance(Vec3 origin, Vec3 unit_direction, SceneHit* out, double width) const {
    const Data& d = *data_;
    const std::optional<SceneHit> hit = d.scene.closest(origin, unit_direction);
    Rgbd sum, through{1, 1, 1};
    if (d.scene.has_panes()) {
        std::vector<PaneHit> panes;
        d.scene.panes(origin, unit_direction, hit ? hit->distance : 1e30, {.end = width}, panes);
        for (const PaneHit& pane : panes) {
            const std::uint32_t e = d.emitter(pane.hit, unit_direction);
            if (e != UINT32_MAX) sum += through * d.emitters.emitters[e].radiance;
            if (pane.opacity > 0) sum += through * d.lit(pane.hit) * pane.opacity;
            through = through * pane.through;
        }
    }
    if (!hit) return static_cast<Rgb>(sum + through * d.sky);
    if (out) *out = *hit;
    if (hit->back) return static_cast<Rgb>(sum);
    return static_cast<Rgb>(sum + through * d.shown(*hit, unit_direction));
}

} // namespace kiln

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
            visit(chart.texel(static_cast<std::uint32_t>(u), static_cast<std::uint32_t>(v)),
                  (i ? x - x0 : 1 - x + x0) * (j ? y - y0 : 1 - y + y0));
        }
}
} // namespace

std::uint32_t LightField::Data::place_at(const SceneHit& hit) const {
    const std::uint32_t texel = index.texel_at(hit.face, hit.position);
    if (texel == UINT32_MAX) return static_cast<std::uint32_t>(surfaces.pieces.size()) + hit.face.value;
    if (const std::uint32_t place = texel_place[texel]; place != FieldBundle::kBlack) return place;
    const std::uint32_t piece = index.piece_at(hit.face, hit.position);
    return piece == UINT32_MAX ? FieldBundle::kBlack : piece;
}

Rgbd LightField::Data::reflected(std::uint32_t place) const {
    if (place == FieldBundle::kBlack) return {};
    return place == FieldBundle::kSky ? sky : static_cast<Rgbd>(place_reflected[place]);
}

void LightField::Data::tell_states() {
    const Data& d = *this;
    states.reserve(d.part_count());
    const auto bits = [](float x) { return std::uint64_t{std::bit_cast<std::uint32_t>(x)}; };
    for (const Rgb& r : d.place_reflected) states.push_back(mix(chained(0, r)));
    ByteWriter w;
    w(d.sky);
    for (const Emitter& e : d.emitters.emitters) w(e.radiance);
    for (const Material& m : d.world.materials) w(m.reflectance);
    states.push_back(hash_bytes(w.bytes).low);
    states.insert(states.end(), d.place_even.begin(), d.place_even.end());
    std::vector<std::uint64_t> ids;
    for (const Light& light : d.lights) ids.push_back(light_id(light));
    std::vector<std::uint64_t> of_patch;
    for (std::size_t p = 0; p + 1 < d.lighting.first_brought.size(); ++p) {
        std::uint64_t state = 0;
        for (const LightBrings& b : d.entities_of_patch(p)) state = chained(state, chained(ids[b.light], bits(b.irradiance)));
        of_patch.push_back(mix(state));
    }
    for (const std::uint32_t patch : d.lighting.piece_patch) states.push_back(of_patch.empty() ? 0 : of_patch[patch]);
}

const std::vector<std::uint64_t>& LightField::part_states() const {
    std::call_once(data_->states_told, [&] { data_->tell_states(); });
    return data_->states;
}

std::size_t LightField::light_parts() const {
    return data_->emitters_part() + std::size_t{1};
}

std::uint64_t LightField::shining_faces() const {
    return data_->emitters.emitters.empty() ? 0 : hash_of(data_->emitters.of_face).low | 1;
}

bool LightField::Data::is_near(const SceneHit& hit, Vec3 direction, Looked* looked) const {
    const Face& face = surfaces.faces[hit.face.at()];
    if (!face.chart.valid() || dot(face.normal, direction) > 0) return false;
    const double luxel = surfaces.charts[face.chart.at()].luxel_size;
    if (hit.distance >= kNearLuxels * luxel) return false;
    const std::uint32_t place = place_at(hit);
    if (place >= place_even.size()) return false;
    if (hit.distance < kCrevice * luxel) return true;
    if (looked) looked->at(even_part(place));
    return !place_even[place];
}

// What a luxel and those around it agree on holds within it, too. Where none lies beside it along one of the axes, or one is of several pieces, nobody tells.
void LightField::Data::tell_even_places(double floor) {
    const double most = kEven * lighting.error.target / 100;
    const auto own = [&](std::uint32_t t) { return texel_place[t] != FieldBundle::kBlack && lighting.patch_index[t] < kMixedPatch; };
    for (const Luxel& l : surfaces.luxels) {
        const Chart& c = surfaces.charts[l.chart.at()];
        const std::uint32_t texel = texel_of(surfaces, l);
        if (lighting.valid[texel] != 1 || !own(texel)) continue;
        const Rgbd at = static_cast<Rgbd>(lighting.flat[texel]);
        const double may = most * std::max(max_component(at), floor);
        bool told = true, even = true;
        std::array<bool, 2> beside{};
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx) {
                const int x = l.x + dx, y = l.y + dy;
                if (x < 0 || y < 0 || x >= static_cast<int>(c.width) || y >= static_cast<int>(c.height)) continue;
                const std::uint32_t t = c.texel(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y));
                if (lighting.valid[t] != 1) continue;
                told = told && own(t);
                if (dx == 0 && dy != 0) beside[1] = true;
                if (dy == 0 && dx != 0) beside[0] = true;
                const Rgbd by = static_cast<Rgbd>(lighting.flat[t]) - at;
                for (std::size_t a = 0; a < 3; ++a) even = even && std::abs(by[a]) <= may;
            }
        place_even[l.first_piece] = told && even && beside[0] && beside[1];
    }
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

LightField::Data::Data(const World& w, const Bsp& bsp, const Surfaces& s, const std::vector<Light>& l, const Lighting& baked, const Visibility* seen)
    : world(w), surfaces(s), lights(l), lighting(baked), scene(w, s), index(s), emitters(w, s, sky_radiance(l)), sight(w, s, bsp, seen, scene, l, emitters), sky(sky_radiance(l)) {}

LightField::LightField(const World& world, const Bsp& bsp, const PlaneTable&, const Surfaces& surfaces,
                       const std::vector<Light>& lights, const Lighting& lighting, const Visibility* seen)
    : data_(std::make_unique<Data>(world, bsp, surfaces, lights, lighting, seen)) {
    Data& d = *data_;
    // Of a luxel that was baked and belongs to one patch its own light, else that of its patch.
    const auto of_patch = [&](std::uint32_t p) {
        return p == kNoPatch ? Rgb{} : (lighting.radiosity[p] - lighting.patches[p].emission) * static_cast<float>(1 / kPi);
    };
    for (const std::uint32_t p : lighting.piece_patch) d.place_reflected.push_back(of_patch(p));
    for (const std::uint32_t p : lighting.face_patch) d.place_reflected.push_back(of_patch(p));
    d.texel_place.assign(surfaces.texel_count, FieldBundle::kBlack);
    for (const Luxel& l : surfaces.luxels) {
        const std::size_t texel = texel_of(surfaces, l);
        if (l.piece_count == 1) d.texel_place[texel] = l.first_piece;
        const std::uint32_t patch = lighting.patch_index[texel];
        if (patch >= kMixedPatch || lighting.valid[texel] != 1) continue;
        const Rgbd light = static_cast<Rgbd>(lighting.patches[patch].reflectance) * static_cast<Rgbd>(lighting.flat[texel]) * (1 / kPi);
        for (std::uint32_t k = 0; k < l.piece_count; ++k) d.place_reflected[l.first_piece + k] = static_cast<Rgb>(light);
    }
    d.place_even.assign(surfaces.pieces.size(), 0);
    if (lighting.flat.empty()) return; // nothing is baked
    const double floor = error_floor(LightOptions{}.error_floor, mean_irradiance(surfaces, lighting)), step = read_step_of(lighting.error.target);
    d.tell_even_places(floor);
    for (std::uint32_t place = 0; place < d.place_reflected.size(); ++place)
        d.place_reflected[place] = static_cast<Rgb>(rounded_as_read(static_cast<Rgbd>(d.place_reflected[place]), step, floor / kPi, Random(mix(std::uint64_t{place}, std::uint64_t{27}))()));
}
LightField::~LightField() = default;

const TraceScene& LightField::scene() const {
    return data_->scene;
}
void LightField::each_light(Vec3 point, const std::function<void(std::uint32_t)>& visit) const {
    data_->sight.each_light(data_->sight.at(point), point, 0, visit);
}
const LightField::Data& LightField::data() const {
    return *data_;
}

void LightField::arriving(Vec3 point, Vec3 normal, std::uint32_t rays, std::uint64_t seed,
                          const Arrival& arrival) const {
    arriving_direct(point, normal, seed, arrival);
    const FieldBundle met = bundle(point, normal, rays, seed);
    const std::vector<Rgbd> radiance = reflected(met);
    arriving(met, radiance, emitters(met, level(met, radiance, normal, seed), point, normal, seed), normal, seed, arrival, [&](Vec3 way, Rgbd weight) {
        if (max_component(weight) > 0) arrival(way, weight);
    });
}

void LightField::arriving_direct(Vec3 point, Vec3 normal, std::uint64_t seed, const Arrival& arrival) const {
    const Data& d = *data_;
    const Vec3 x = d.origin_at(point, normal);
    d.sight.each_light(d.sight.at(x), x, 0, [&](std::uint32_t i) {
        const Light& light = d.lights[i];
        const bool disc = light.kind == LightKind::sun && light.angular_radius_rad > 0;
        const std::uint32_t samples = disc ? 64 : 1;
        const Sobol points(mix(seed, std::uint64_t{i}, std::uint64_t{21}));
        for (std::uint32_t k = 0; k < samples; ++k) {
            LightSample s;
            if (!sample_light(light, x, normal, points.pair(k, 0), &s)) continue;
            const Rgbd through = d.scene.transmitted(ray_to(s, x, 0, {}, part_of_disc(light, samples))).share;
            if (!(max_component(through) > 0)) continue;
            arrival(s.direction, through * (s.weight * (1.0 / samples)));
            if (light.angle_scale < 1)
                arrival(normal == Vec3{} ? s.direction : normal, through * (s.ambient * (1.0 / samples)));
        }
    });
}

namespace {
struct Ways { // of a bundle
    std::vector<Vec3> direction;
    std::vector<double> solid; // angle that each stands for
    Ways(Vec3 normal, std::uint32_t rays, std::uint64_t seed) : direction(rays), solid(rays, 4 * kPi / rays) {
        const Sobol points(mix(seed, std::uint64_t{22}));
        const bool free = normal == Vec3{};
        const Frame frame = free ? Frame{} : frame_around(normal);
        for (std::uint32_t i = 0; i < rays; ++i) {
            const Vec2 u = points.pair(i, 0);
            if (free) {
                direction[i] = uniform_sphere(u);
                continue;
            }
            const Vec3 local = kFieldMap.direction(u);
            direction[i] = frame.world(local);
            solid[i] = 1 / (kFieldMap.density(local.z) * rays);
        }
    }
};
} // namespace

FieldBundle LightField::bundle(Vec3 point, Vec3 normal, std::uint32_t rays, std::uint64_t seed, Looked* looked) const {
    const Data& d = *data_;
    const Vec3 x = d.origin_at(point, normal);
    PathTracer tracer{d};
    tracer.looked = looked;
    if (looked) looked->begin(d.part_count());
    rays = std::max(rays, 4u);
    const Ways ways(normal, rays, seed);
    const std::vector<Vec3> origins(rays, x);
    std::vector<std::optional<SceneHit>> hits(rays);
    d.scene.closest(origins, ways.direction, hits);
    FieldBundle out;
    out.place.resize(rays);
    std::vector<PaneHit> panes;
    for (std::uint32_t i = 0; i < rays; ++i) {
        const Vec3 way = ways.direction[i];
        Rgbd sum, through{1, 1, 1};
        bool plain = true;
        const auto meet = [&](const SceneHit& hit, Rgbd share, Random& random) {
            if (!d.is_near(hit, way, looked)) {
                out.terms.push_back({d.place_at(hit), static_cast<Rgb>(share)});
                return;
            }
            if (looked) looked->at(d.emitters_part());
            PathTracer::End end;
            sum += share * tracer.reflected(hit, way, random, &end);
            if (end.place != FieldBundle::kBlack) out.terms.push_back({end.place, static_cast<Rgb>(share * end.share)});
            plain = false;
        };
        if (d.scene.has_panes()) {
            d.scene.panes(x, way, hits[i] ? hits[i]->distance : 1e30, {.end = std::sqrt(ways.solid[i])}, panes);
            Random random(mix(seed, i, std::uint64_t{26}));
            for (const PaneHit& pane : panes) {
                if (pane.opacity > 0) meet(pane.hit, through * pane.opacity, random);
                if (const std::uint32_t e = d.emitter(pane.hit, way); e != UINT32_MAX) out.shining.push_back({i, e, static_cast<Rgb>(through)});
                through = through * pane.through;
                plain = false;
            }
        }
        if (!hits[i]) {
            out.terms.push_back({FieldBundle::kSky, static_cast<Rgb>(through)});
        } else if (!hits[i]->back) {
            if (const std::uint32_t e = d.emitter(*hits[i], way); e != UINT32_MAX) out.shining.push_back({i, e, static_cast<Rgb>(through)});
            Random random(mix(seed, i, std::uint64_t{25}));
            meet(*hits[i], through, random);
        }
        const std::size_t before = out.several.empty() ? 0 : out.several.back().end;
        if (plain) { // one term or none
            out.place[i] = out.terms.size() > before ? out.terms.back().place : FieldBundle::kBlack;
            out.terms.resize(before);
        } else {
            out.place[i] = FieldBundle::kSeveral;
            out.several.push_back({static_cast<Rgb>(sum), static_cast<std::uint32_t>(out.terms.size())});
        }
    }
    return out;
}

std::vector<Rgbd> LightField::reflected(const FieldBundle& bundle) const {
    const Data& d = *data_;
    std::vector<Rgbd> radiance;
    radiance.reserve(bundle.place.size());
    std::size_t term = 0;
    auto several = bundle.several.begin();
    for (const std::uint32_t place : bundle.place) {
        if (place != FieldBundle::kSeveral) {
            radiance.push_back(d.reflected(place));
            continue;
        }
        Rgbd sum = static_cast<Rgbd>(several->sum);
        for (; term < several->end; ++term) sum += static_cast<Rgbd>(bundle.terms[term].share) * d.reflected(bundle.terms[term].place);
        radiance.push_back(sum), ++several;
    }
    return radiance;
}

double LightField::level(const FieldBundle& bundle, std::span<const Rgbd> reflected, Vec3 normal, std::uint64_t seed) const {
    const std::vector<Emitter>& all = data_->emitters.emitters;
    if (all.empty()) return 0;
    const Ways ways(normal, static_cast<std::uint32_t>(bundle.place.size()), seed);
    const auto k = [&](std::uint32_t i) { return ways.solid[i] * (normal == Vec3{} ? 0.25 : dot(ways.direction[i], normal)); }; // mean of max(0, cos) over axes
    Rgbd total;
    for (std::uint32_t i = 0; i < reflected.size(); ++i) total += reflected[i] * k(i);
    for (const FieldBundle::Shining& s : bundle.shining) total += static_cast<Rgbd>(s.share) * all[s.emitter].radiance * k(s.ray);
    const double e = mean(total);
    return e > 0 ? std::exp2(std::ceil(std::log2(e))) : 0;
}

// Emitters but the sky whose light would be noisy in the bundle get rays of their own, together no more than the bundle has (a near one in full has one a part at least). Where there are more emitters than that,
// which of them is asked is drawn by what they would bring, of those that a few test rays and the bundle missed a smaller part.
FieldEmitters LightField::emitters(const FieldBundle& bundle, double level, Vec3 point, Vec3 normal, std::uint64_t seed) const {
    const Data& d = *data_;
    FieldEmitters out;
    const std::vector<Emitter>& all = d.emitters.emitters;
    if (all.empty()) return out;
    const bool free = normal == Vec3{};
    const Vec3 x = d.origin_at(point, normal);
    const auto rays = static_cast<std::uint32_t>(bundle.place.size());
    struct Candidate {
        std::uint32_t emitter = 0;
        double brings = 0; // mean irradiance, were nothing between, over pi; then by how much it is worth to be asked
    };
    constexpr double kMiddle = 1 / std::numbers::sqrt2; // of the octave below the level
    thread_local std::vector<Candidate> candidates;
    candidates.clear();
    d.sight.each_emitter(d.sight.at(x), [&](std::uint32_t i) {
        const Emitter& emitter = all[i];
        if (emitter.sky) return; // see Bake::threshold
        const double contrast = mean(emitter.radiance) - level / kPi; // in a furnace none has any, so it stays exact
        if (contrast <= 0) return;
        const double least = 0.003 * kMiddle * level * std::sqrt(static_cast<double>(rays)) / (0.5 * kPi * contrast); // of sqrt(F)
        if (d.emitters.bound(i, x, normal) <= std::min(0.5, least * least)) return;
        const double factor = d.emitters.form_factor(i, x, normal);
        if (factor > std::min(0.5, least * least)) candidates.push_back({i, factor * mean(emitter.radiance)});
    });
    if (candidates.empty()) return out;
    thread_local std::vector<std::uint32_t> met;
    met.clear();
    for (const FieldBundle::Shining& s : bundle.shining) met.push_back(s.emitter);
    std::ranges::sort(met);
    const auto off = [&](std::uint32_t i) { return all[i].normal * d.scene.push_off(); };
    const std::uint32_t tests = std::clamp(rays / static_cast<std::uint32_t>(candidates.size()), 1u, kTestRays);
    for (Candidate& c : candidates) {
        const Sobol test(mix(seed, c.emitter, std::uint64_t{23}));
        bool seen = std::ranges::binary_search(met, c.emitter);
        std::uint32_t missed = 0;
        for (std::uint32_t n = 0; n < tests && !seen; ++n) {
            const Vec3 y = d.emitters.point_on(c.emitter, test.pair(n, 0)) + off(c.emitter);
            if (!free && dot(y - x, normal) <= 0) continue; // says nothing about what stands between
            seen = !d.scene.occluded(x, y), ++missed;
        }
        if (!seen) c.brings /= std::sqrt(missed + 2); // rays at least cost: by the root of the part that is seen, of which so many that miss tell 1 / (missed + 2)
        out.listed.push_back(c.emitter); // were those left to the bundle that neither it nor a test ray has met, their light would be lost
    }
    const auto ask = [&](const Candidate& c, std::uint32_t samples, double due, bool in_full) {
        const Emitter& emitter = all[c.emitter];
        const auto visit = [&](Vec3 y, Vec3 flux) {
            const Rgbd arrives = d.scene.transmitted({.from = x, .to = y + off(c.emitter), .widths = {.end = std::sqrt(emitter.area / samples), .end_normal = emitter.normal}}).share;
            if (!(max_component(arrives) > 0)) return;
            const double share = length(flux);
            out.arrivals.push_back({flux / share, arrives * (emitter.radiance * (share * samples / due))});
        };
        const Sobol light(mix(seed, c.emitter, std::uint64_t{24}));
        if (in_full) d.emitters.sample(c.emitter, x, normal, 0, samples, light, 1e-4, EmitterSet::Arrival::each, EmitterSet::Share::cosine, visit);
        else d.emitters.sample_few(c.emitter, x, normal, 0, samples, Random(mix(seed, c.emitter, std::uint64_t{28}))(), light, 1e-4, EmitterSet::Share::cosine, visit);
    };
    const std::uint32_t samples = std::clamp(rays / 32, 4u, 64u);
    if (candidates.size() * samples <= rays) {
        for (const Candidate& c : candidates) ask(c, samples, samples, true);
        return out;
    }
    double sum = 0;
    for (const Candidate& c : candidates) sum += c.brings;
    double before = Random(mix(seed, std::uint64_t{29}))();
    for (const Candidate& c : candidates) {
        const double due = rays * c.brings / sum, after = before + due;
        if (const auto n = static_cast<std::uint32_t>(std::floor(after) - std::floor(before)); n > 0) ask(c, n, due, false);
        before = after;
    }
    return out;
}

void LightField::arriving(const FieldBundle& bundle, std::vector<Rgbd> reflected, const FieldEmitters& emitters, Vec3 normal, std::uint64_t seed,
                          const Arrival& of_emitters, const Arrival& of_rays) const {
    for (const FieldEmitters::Arriving& a : emitters.arrivals) of_emitters(a.direction, a.weight);
    for (const FieldBundle::Shining& s : bundle.shining)
        if (!std::ranges::binary_search(emitters.listed, s.emitter)) reflected[s.ray] += static_cast<Rgbd>(s.share) * data_->emitters.emitters[s.emitter].radiance;
    const Ways ways(normal, static_cast<std::uint32_t>(bundle.place.size()), seed);
    for (std::size_t i = 0; i < reflected.size(); ++i) of_rays(ways.direction[i], reflected[i] * ways.solid[i]);
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
    if (!face.chart.valid()) return reflected(place_at(hit));
    // Four texels, bilinear; texels of no face left out.
    Rgbd sum;
    double weight = 0;
    for_each_bilinear(surfaces, hit.face, hit.position, [&](std::size_t t, double w) {
        if (!lighting.valid[t]) return;
        sum += static_cast<Rgbd>(lighting.flat[t]) * w, weight += w;
    });
    if (!(weight > 0)) return reflected(place_at(hit));
    const Rgbd rho = face.drawn ? static_cast<Rgbd>(world.materials[face.material.at()].reflectance) : Rgbd{};
    return rho * sum * (1 / (weight * kPi));
}

Rgb LightField::radiance(Vec3 origin, Vec3 unit_direction, SceneHit* out, double width) const {
    const std::optional<SceneHit> hit = data_->scene.closest(origin, unit_direction);
    if (hit && out) *out = *hit;
    return leaving(origin, unit_direction, hit, width);
}

void LightField::radiance(Vec3 origin, std::span<const Vec3> unit_directions, std::span<Rgb> out, double width) const {
    const std::vector<Vec3> origins(unit_directions.size(), origin);
    std::vector<std::optional<SceneHit>> hits(unit_directions.size());
    data_->scene.closest(origins, unit_directions, hits);
    for (std::size_t i = 0; i < hits.size(); ++i) out[i] = leaving(origin, unit_directions[i], hits[i], width);
}

Rgb LightField::leaving(Vec3 origin, Vec3 unit_direction, const std::optional<SceneHit>& hit, double width) const {
    const Data& d = *data_;
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
    if (hit->back) return static_cast<Rgb>(sum);
    return static_cast<Rgb>(sum + through * d.shown(*hit, unit_direction));
}

} // namespace kiln

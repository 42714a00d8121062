// Direct light: which lights are worth explicit rays for which patch, and those rays at the luxels.
#include "compiler/light/bake.h"
#include "libs/core/each_once.h"
#include "libs/parallel/parallel.h"
#include <bit>
#include <numbers>
#include <numeric>

namespace kiln {
namespace {
constexpr double kPi = std::numbers::pi;
constexpr double kNever = 1e30; // a form factor that nothing has
constexpr double kLarge = 1.0 / 16; // form factor of an emitter in full view (solid angle over pi where a patch looks many ways) from which on gathered rays find it
constexpr double kHidden = 0.5;     // share of that which is hidden, from which on points on it are wasted
constexpr std::uint32_t kLeastTests = 4; // rays that have to say so
constexpr double kStrong = 0.1; // share of the light of a place from which on a lamp is tested thoroughly
constexpr std::uint32_t kFullView = 32; // points on an emitter in full view, at most: arithmetic, no rays
constexpr double kAlike = 0.35;         // error targets by which what panes let through may differ over a luxel without a closer look
constexpr std::uint32_t kMostSide = 16; // of the grid of places from which a light in full view is evaluated
constexpr std::uint32_t kLooks = 4; // for lights that test rays missed
double square(double x) {
    return x * x;
}
// What test rays from a patch to an entity of intensity 1 tell.
struct EntityTest {
    static constexpr bool kRawBytes = true;
    std::uint64_t of = 0; // all that they depend on, but for the patch
    float brought = 0;
    std::uint16_t seen = 0, tested = 0;
    std::uint32_t filtered = 0, edge = 0; // some came through a pane; places lie beyond its reach
};
// What a memo keeps of the lights of a patch, as Bake::choose_lights finds them.
struct PatchLights {
    std::uint64_t of = 0; // what its emitters were chosen by
    std::vector<LightRef> emitters;
    std::vector<std::uint32_t> behind;
    std::uint64_t rays = 0; // to emitters
    std::vector<EntityTest> tests;
    template <class A> void fields(A& a) { a(of, emitters, behind, rays, tests); }
};
// What a memo keeps of the luxels of a patch, light by light, of brightness 1; of a light that no luxel has anything of: nothing.
struct LuxelDirect {
    static constexpr bool kRawBytes = true;
    StoredSum sum;
    float variance = 0;
};
struct PlaceDirect { // the same of one place, of one light
    static constexpr bool kRawBytes = true;
    std::uint64_t of = 0, rays = 0;
    StoredSum sum;
};
struct PatchDirect {
    std::vector<std::uint64_t> refs;
    std::vector<std::uint32_t> first; // per light, in `luxels`, and one more
    std::vector<LuxelDirect> luxels;
    std::vector<std::uint8_t> divided;
    std::vector<std::uint64_t> rays;
    std::span<const LuxelDirect> of(std::size_t light) const { return std::span(luxels).subspan(first[light], first[light + 1] - first[light]); }
    template <class A> void fields(A& a) { a(refs, first, luxels, divided, rays); }
};
} // namespace

bool Bake::listed(std::uint32_t patch, std::uint32_t emitter) const {
    const auto& list = lists_[patch];
    const auto at = std::lower_bound(list.begin(), list.end(), emitter, [](const LightRef& r, std::uint32_t e) {
        return r.is_emitter && r.light < e;
    });
    return at != list.end() && at->is_emitter && at->light == emitter;
}

bool Bake::receives(std::uint32_t p) const {
    const Patch& patch = patches_.patches[p];
    if (covered_[p]) return false;
    return max_component(patch.reflectance) > 0 || surfaces_.faces[patch.face.at()].chart.valid();
}

// Noise of N gathered rays that hit with probability F: contrast pi sqrt(F / N), halved by stratification. Only
// what stands out against the rest makes noise: in a furnace nothing does.
double Bake::threshold(std::uint32_t p, std::uint32_t i) const {
    // What is large and lies behind an opening is seen from few of its points, and the guides of gathered rays know where. The sky is so nearly everywhere; where it
    // is not, many of its faces shine alike and make little noise together.
    if (emitters_.emitters[i].sky || std::ranges::binary_search(behind_[p], i)) return kNever;
    const double contrast = mean(emitters_.emitters[i].radiance) - estimate_[p] / kPi;
    if (contrast <= 0) return kNever;
    const double noise_per_root = 0.5 * kPi * contrast / std::sqrt(static_cast<double>(quality_.first_rays));
    const double root = quality_.promotion * std::max(estimate_[p], floor_) / noise_per_root;
    return root * root;
}

// A bent patch, and one with directional luxels: a lamp low over the horizon of its plane stands high over that of
// another normal.
bool Bake::looks_many_ways(std::uint32_t p) const {
    const Face& face = surfaces_.faces[patches_.patches[p].face.at()];
    return face.curved() || (face.chart.valid() && cones_[face.chart.at()]);
}

// Nearly an upper bound of the form factor from anywhere on the patch, of the solid angle over pi where it looks many ways.
double Bake::form_factor_bound(std::uint32_t p, std::uint32_t i) const {
    const Patch& patch = patches_.patches[p];
    const Emitter& emitter = emitters_.emitters[i];
    const Face& face = surfaces_.faces[patch.face.at()];
    const double radius = std::sqrt(patch.area);
    Vec3 x = patch.centroid + face.normal * (scene_.push_off() + 0.25 * radius);
    const Vec3 normal = looks_many_ways(p) ? Vec3{} : face.normal;
    const double ahead = emitter.distance - dot(emitter.normal, x);
    if (ahead > 0) x += emitter.normal * std::min(ahead + 1e-3, radius); // a part may be in front of it
    return 4 * emitters_.bound(i, x, normal);
}

// The k-th of `tests` rays that ask whether the patch sees the emitter; none where it would leave or arrive from behind, which says nothing about what stands between.
std::optional<LightRay> Bake::test_ray(std::uint32_t p, std::uint32_t i, const Footprint& footprint, const Sobol& points, std::uint32_t k, std::uint32_t tests) const {
    const Emitter& emitter = emitters_.emitters[i];
    const Footprint::Point at = footprint.sample(points.pair(k, 0));
    const Vec3 x = at.position + at.normal * scene_.push_off();
    const Vec3 y = emitters_.point_on(i, points.pair(k, 2)) + emitter.normal * scene_.push_off();
    if (dot(at.normal, y - x) <= 0 || dot(emitter.normal, y - x) >= 0) return std::nullopt;
    return LightRay{x, y, false, {.start = std::sqrt(patches_.patches[p].area / tests), .end = std::sqrt(emitter.area / tests), .start_normal = at.normal, .end_normal = emitter.normal}};
}

// Visibility samples for a light that would bring `share` of the irradiance if it were in full view. The share goes
// far beyond 1 where a sliver of sun falls into a dark room.
std::uint16_t Bake::penumbra_samples(double share) const {
    const double wanted = quality_.direct_samples * (share < 1 ? std::min(1.0, 3 * share) : std::min(share, 8.0));
    std::uint32_t n = 2;
    while (n < wanted) n *= 2;
    return static_cast<std::uint16_t>(n);
}

// For every patch: emitters that it or a neighbour sees and whose light, left to the gathered rays, would be too
// noisy, but for those of which points would do worse (threshold); and every light entity that could matter. What is not listed stays with the gathered rays: nothing is
// lost.
void Bake::choose_lights(const std::vector<Rgbd>& irradiance) {
    const std::size_t n = patches_.patches.size();
    double area = 0, sum = 0;
    estimate_.resize(n);
    for (std::size_t p = 0; p < n; ++p) {
        estimate_[p] = mean(irradiance[p]);
        area += patches_.patches[p].area, sum += patches_.patches[p].area * estimate_[p];
    }
    floor_ = area > 0 ? error_floor(options_.error_floor, sum / area) : 0;
    // What is worth rays is decided in coarse steps: what changes elsewhere a little must not change it here.
    for (double& e : estimate_)
        if (e > 0) e = std::exp2(std::round(8 * std::log2(e)) / 8);
    behind_.assign(n, {});
    std::vector<std::vector<LightRef>> emitters(n), entities(n);
    clusters_ = known_or<std::vector<Clusters>>(mix(table_.low, KeyOf::clusters), [&] {
        std::vector<Clusters> out(n);
        parallel_chunks(context_, n, 64, [&](std::size_t begin, std::size_t end) {
            for (auto p = static_cast<std::uint32_t>(begin); p < end; ++p) out[p] = sight_.of_patch(surfaces_, patches_, p, scene_.push_off());
        });
        return out;
    });
    std::uint64_t radiances = 0; // of all emitters
    for (const Emitter& e : emitters_.emitters) radiances = mix(radiances, hash_of(e.radiance).low);
    const auto test_entity = [&](Light light, const Footprint& footprint, const Sobol& points, double radius, std::uint32_t tests, bool closely) {
        // Places that it does not reach (beyond its cone, say) cost no ray; where it reaches some and some not, its edge runs through.
        light.intensity = {1, 1, 1};
        EntityTest test;
        const std::uint32_t places = std::max(tests, quality_.visibility_rays);
        double brought = 0;
        for (std::uint32_t k = 0; k < places && test.tested < tests; ++k) {
            if (k == 4 && test.tested == 4 && test.seen == 0 && !closely) break;
            const Footprint::Point at = footprint.sample(points.pair(k, 0));
            const Vec3 x = at.position + at.normal * scene_.push_off();
            LightSample s;
            if (!sample_light(light, x, at.normal, points.pair(k, 2), &s)) {
                test.edge = 1;
                continue;
            }
            ++test.tested;
            const Transmitted through = scene_.transmitted(ray_to(s, x, radius / std::sqrt(1.0 * tests), at.normal, part_of_disc(light, tests)));
            if (through.blocked) continue;
            if (through.share != Rgbd{1, 1, 1}) test.filtered = 1;
            ++test.seen;
            brought += mean(through.share) * (mean(s.weight) * dot(s.direction, at.normal) + mean(s.ambient));
        }
        test.brought = static_cast<float>(brought);
        return test;
    };
    constexpr std::size_t kChunk = 32;
    parallel_chunks(context_, "light: visible lights", n, kChunk, [&](std::size_t begin, std::size_t end) {
        std::uint64_t rays = 0;
        std::vector<std::uint8_t> met(emitters_.emitters.size());
        for (auto p = static_cast<std::uint32_t>(begin); p < end; ++p) {
            const Patch& patch = patches_.patches[p];
            if (!receives(p)) continue;
            const double radius = std::sqrt(patch.area), e = std::max(estimate_[p], floor_);
            const bool many_ways = looks_many_ways(p);
            // Entities, strongest first.
            std::vector<std::pair<double, std::uint32_t>> strong;
            double left = 0;
            sight_.each_light(clusters_[p], patch.centroid, radius, [&](std::uint32_t i) {
                const double bright = light_bound(lights_[i], patch.centroid, radius);
                if (bright > 0) strong.emplace_back(bright, i), left += bright;
            });
            std::ranges::sort(strong, [](const auto& x, const auto& y) {
                return x.first != y.first ? x.first > y.first : x.second < y.second;
            });
            const std::uint64_t key = memo_ ? key_of(p, mix(base_, table_.low, p, KeyOf::tests)) : 0;
            thread_local PatchLights kept;
            kept.of = kept.rays = 0, kept.emitters.clear(), kept.behind.clear(), kept.tests.clear();
            PatchLights now{mix(radiances, std::bit_cast<std::uint64_t>(estimate_[p]), std::bit_cast<std::uint64_t>(floor_)), {}, {}, 0, {}};
            std::optional<Footprint> made; // when it is asked for
            const auto footprint = [&]() -> const Footprint& { return made ? *made : made.emplace(footprint_of_patch(p)); };
            if (const auto bytes = memo_ ? memo_->lights.find(key, {}) : std::nullopt) read_whole(*bytes, kept);
            else if (footprint().empty()) continue;
            const Sobol points(seed_at(patch.centroid, 2));
            // Test rays: two for each luxel where much is at stake, so that no thin shadow falls between. For an entity where little is, no closer
            // together on a patch of few luxels than on others.
            const auto luxels = static_cast<std::uint32_t>(luxels_of(p).size());
            const auto thorough = [&](std::uint32_t least) { return std::clamp(2 * luxels, least, 4 * quality_.visibility_rays); };
            const std::uint32_t few = luxels ? std::clamp(std::bit_ceil(2 * luxels), 4u, quality_.visibility_rays) : quality_.visibility_rays;
            if (kept.of == now.of) {
                now.emitters = kept.emitters, now.behind = kept.behind, now.rays = kept.rays;
            } else {
                // What the bundle of the row has met is visible.
                std::fill(met.begin(), met.end(), 0);
                for (std::uint32_t i = 0; i < quality_.row_rays; ++i) {
                    const std::uint32_t hit = hits_[static_cast<std::size_t>(p) * quality_.row_rays + i];
                    if (hit == kHitPanes) {
                        for (const PaneRays::Met& m : pane_rays_.of(static_cast<std::size_t>(p) * quality_.row_rays + i))
                            if (const std::uint32_t k = emitter_of(m.code); k != UINT32_MAX) met[k] = 1;
                        continue;
                    }
                    if (const std::uint32_t k = emitter_of(hit); k != UINT32_MAX) met[k] = 1;
                }
                sight_.each_emitter(clusters_[p], [&](std::uint32_t i) {
                    const Emitter& emitter = emitters_.emitters[i];
                    const double least = threshold(p, i), most = least < kNever ? form_factor_bound(p, i) : 0;
                    if (most < least) return;
                    std::uint32_t seen = 0, tested = 0, tried = 0;
                    bool filtered = false;
                    double factor = 0, in_full_view = 0, in_view = 0;
                    const std::uint32_t tests = most > 400 * least ? thorough(quality_.visibility_rays) : quality_.visibility_rays;
                    const std::uint32_t early = most > 400 * least || most >= 4 * kLarge ? tests : 4;
                    for (std::uint32_t k = 0; k < tests; ++k) {
                        if (k >= early && seen == 0) break;
                        ++tried;
                        const std::optional<LightRay> ray = test_ray(p, i, footprint(), points, k, tests);
                        if (!ray) continue;
                        ++tested, ++now.rays;
                        const Vec3 d = ray->to - ray->from;
                        const double r2 = dot(d, d), cy = -dot(emitter.normal, d);
                        const double part = std::min(1.0, (many_ways ? std::sqrt(r2) : dot(ray->widths.start_normal, d)) * cy * emitter.area / (kPi * r2 * r2));
                        in_full_view += part;
                        const Transmitted through = scene_.transmitted(*ray);
                        if (through.blocked) continue;
                        filtered |= through.share != Rgbd{1, 1, 1};
                        ++seen;
                        in_view += part, factor += mean(through.share) * part;
                    }
                    if (tested >= kLeastTests && in_full_view >= kLarge * tried && in_view <= (1 - kHidden) * in_full_view) {
                        now.behind.push_back(i);
                        return;
                    }
                    if (!seen && !met[i]) return;
                    if (seen && !met[i] && factor / tested < least) return;
                    const double share = kPi * mean(emitter.radiance) * most / 4 / e;
                    now.emitters.push_back({i, true, seen != tested, false, penumbra_samples(share), filtered});
                });
            }
            emitters[p] = now.emitters, behind_[p] = now.behind, rays += now.rays;
            // Entities, until all that are left together cannot matter beside what has been found.
            double found = std::max(estimate_[p], floor_);
            bool all_kept = kept.of == now.of;
            std::size_t hint = 0; // in `kept`
            for (const auto& [bright, i] : strong) {
                if (left <= quality_.light_cutoff * found) break;
                left -= bright;
                const bool closely = bright > kStrong * found;
                const std::uint64_t of = memo_ ? mix(light_shapes_[i], static_cast<std::uint64_t>(closely)) : 0;
                std::size_t at = 0;
                while (at < kept.tests.size() && kept.tests[(hint + at) % kept.tests.size()].of != of) ++at;
                if (at < kept.tests.size()) {
                    hint += at;
                    now.tests.push_back(kept.tests[hint++ % kept.tests.size()]);
                } else {
                    all_kept = false;
                    now.tests.push_back(test_entity(lights_[i], footprint(), points, radius, closely ? thorough(std::max(few, 8u)) : few, closely));
                    now.tests.back().of = of;
                }
                const EntityTest& test = now.tests.back();
                rays += test.tested;
                if (!test.tested) continue;
                found += mean(static_cast<Rgbd>(lights_[i].intensity)) * static_cast<double>(test.brought) / test.tested;
                entities[p].push_back(
                    {i, false, (test.edge || test.seen != test.tested) && test.seen > 0, test.seen == 0, penumbra_samples(bright / found), test.filtered != 0});
            }
            if (memo_ && !all_kept) memo_->lights.keep(key, {}, {}, to_bytes(now));
            std::ranges::sort(entities[p], {}, &LightRef::light);
        }
        shadow_rays_ += rays;
    });
    // A shaft of light may fall between the test rays of a patch, hardly between those of its neighbours as well;
    // and where a neighbour sees less of a light, the edge of its shadow may reach over. So only patches among
    // their like go without a closer look.
    lists_ = emitters;
    std::vector<Handed> handed;
    const auto offer = [&](std::uint32_t to, std::uint32_t from) {
        if (!receives(to) || !receives(from)) return;
        for (const LightRef& r : emitters[from]) {
            const auto at = std::ranges::find(lists_[to], r.light, &LightRef::light);
            if (at != lists_[to].end()) at->penumbra |= r.penumbra, at->filtered |= r.filtered;
            else if (list_emitter(to, r.light, false)) handed.push_back({to, r.light});
        }
        for (LightRef& r : lists_[to])
            if (std::ranges::find(emitters[from], r.light, &LightRef::light) == emitters[from].end())
                r.penumbra = true;
    };
    std::vector<std::vector<LightRef>> spread = entities;
    const auto offer_entities = [&](std::uint32_t to, std::uint32_t from) {
        for (LightRef& r : spread[to]) {
            const auto at = std::ranges::find(entities[from], r.light, &LightRef::light);
            if (at != entities[from].end() ? at->hidden != r.hidden || at->penumbra : !r.hidden && receives(from) && !sight_.light_may(r.light, clusters_[from])) r.penumbra = true;
            if (at != entities[from].end()) r.filtered |= at->filtered;
        }
    };
    for (const auto& [p, q] : touching_) offer(p, q), offer(q, p), offer_entities(p, q), offer_entities(q, p);
    hand_on(std::move(handed));
    for (std::size_t p = 0; p < n; ++p) lists_[p].insert(lists_[p].end(), spread[p].begin(), spread[p].end());
}

// Lists an emitter that the patch has `met`, or that is seen from beside it and worth rays here too; whether it does so now.
bool Bake::list_emitter(std::uint32_t p, std::uint32_t i, bool met) {
    if (!receives(p) || listed(p, i) || (!met && !sight_.emitter_may(i, clusters_[p]))) return false;
    const double most = form_factor_bound(p, i);
    if (!met && most < threshold(p, i)) return false;
    const LightRef ref{i, true, true, false, penumbra_samples(kPi * mean(emitters_.emitters[i].radiance) * most / 4 / std::max(estimate_[p], floor_))};
    lists_[p].insert(std::ranges::find_if(lists_[p], [&](const LightRef& r) { return !r.is_emitter || r.light > i; }), ref);
    return true;
}

// Of emitters that patches have from those beside them: as long as a patch sees as much of them as may be worth it, those beside it have them too. The bound is some four times the
// form factor in full view: of a part that is just worth being listed there are eight hits in the mean, and two or three are asked for.
std::vector<std::uint32_t> Bake::hand_on(std::vector<Handed> handed) {
    constexpr double kMost = 64; // rays
    constexpr std::size_t kChunk = 64;
    std::vector<std::uint32_t> changed;
    while (!handed.empty()) {
        std::ranges::sort(handed);
        for (const Handed& h : handed) changed.push_back(h.patch);
        std::vector<std::uint64_t> rays(slots_of(handed.size(), kChunk));
        std::vector<std::uint8_t> seen(handed.size());
        parallel_chunks(context_, handed.size(), kChunk, [&](std::size_t begin, std::size_t end) {
            Footprint footprint;
            for (std::size_t k = begin; k < end; ++k) {
                const auto [p, i] = handed[k];
                if (k == begin || handed[k - 1].patch != p) footprint = footprint_of_patch(p);
                if (footprint.empty()) continue;
                const double bound = form_factor_bound(p, i), least = threshold(p, i);
                const auto tests = static_cast<std::uint32_t>(std::min(kMost, std::ceil(2 * bound / least)));
                const double enough = tests * least / bound; // hits
                const Sobol points(seed_at(patches_.patches[p].centroid, kHanded));
                std::uint32_t hits = 0;
                for (std::uint32_t t = 0; t < tests && !seen[k]; ++t) {
                    const std::optional<LightRay> ray = test_ray(p, i, footprint, points, t, tests);
                    if (!ray) continue;
                    ++rays[begin / kChunk];
                    if (!scene_.transmitted(*ray).blocked) ++hits;
                    seen[k] = hits > 0 && hits >= enough;
                }
            }
        });
        shadow_rays_ += std::accumulate(rays.begin(), rays.end(), std::uint64_t{0});
        std::vector<Handed> next;
        for (std::size_t k = 0; k < handed.size(); ++k)
            if (seen[k])
                for (const std::uint32_t q : neighbours_[handed[k].patch])
                    if (list_emitter(q, handed[k].emitter, false)) next.push_back({q, handed[k].emitter});
        handed = std::move(next);
    }
    return each_once(std::move(changed));
}

std::vector<std::uint32_t> Bake::add_emitters(const std::vector<Found>& found) {
    std::vector<Handed> handed;
    for (const auto& [p, emitters] : found)
        for (const std::uint32_t i : emitters) {
            if (list_emitter(p, i, true)) handed.push_back({p, i});
            for (const std::uint32_t q : neighbours_[p])
                if (list_emitter(q, i, false)) handed.push_back({q, i});
        }
    return hand_on(std::move(handed));
}

// From a place to the nearest of a light.
double Bake::distance_to(const LightRef& ref, Vec3 x) const {
    if (ref.is_emitter) {
        const Emitter& e = emitters_.emitters[ref.light];
        return std::max(length(e.center - x) - e.radius, std::abs(dot(e.normal, x) - e.distance));
    }
    const Light& light = lights_[ref.light];
    return light.kind == LightKind::sun ? 1e30 : length(light.position - x);
}

// Random numbers are a light's own, wherever it stands in the map's file: with one more or less the others keep theirs.
std::uint64_t Bake::stream_of(const LightRef& ref) const {
    if (ref.is_emitter) return mix(ref.light, std::uint64_t{1});
    const Light& light = lights_[ref.light];
    return mix_place(light.direction + (light.kind == LightKind::sun ? Vec3{} : light.position - corner_), static_cast<std::uint64_t>(light.kind));
}

// Explicit light of brightness 1 averaged over footprints. Places and points on the light share one sequence. Of all footprints rays are traced together.
bool Bake::direct_from(const LightRef& ref, std::uint32_t patch, std::span<Receiver> receivers, bool closely, std::uint64_t* rays) const {
    using Point = Footprint::Point;
    Light light;
    if (!ref.is_emitter) light = lights_[ref.light], light.intensity = {1, 1, 1};
    const auto share = looks_many_ways(patch) ? EmitterSet::Share::solid : EmitterSet::Share::cosine;
    const auto lifted = [&](Point p) { return Point{p.position + p.normal * scene_.push_off(), p.normal}; };
    struct At { // a receiver
        std::optional<Sobol> points; // where they are asked for: most lights are points, seen from the middle
        Point middle;
    };
    thread_local std::vector<At> at;
    at.clear();
    const auto points_of = [&](std::size_t r) -> const Sobol& { return at[r].points ? *at[r].points : at[r].points.emplace(mix(receivers[r].seed, stream_of(ref))); };
    const auto place = [&](std::size_t r, std::uint32_t index) { return lifted(receivers[r].footprint->sample(points_of(r).pair(index, 0))); };
    for (std::size_t r = 0; r < receivers.size(); ++r) {
        const Footprint& footprint = *receivers[r].footprint;
        at.emplace_back();
        at[r].middle = footprint.bent() ? place(r, 0) : lifted({footprint.centroid(), footprint.normal()});
    }
    // Rays from one place to `each` points of an emitter at least: a `few`, or so many that none has to be traced. visit(ray, way, weight, ambient): what it brings,
    // along its way and along the normal. `width` of a part of the footprint, `discs`: parts of a sun's disc.
    const auto shine = [&](std::size_t r, const Point& from, std::uint32_t index, std::uint32_t each, bool few, double width, std::uint32_t discs, const auto& visit) {
        const Vec3 x = from.position, normal = from.normal;
        if (ref.is_emitter) {
            const Emitter& e = emitters_.emitters[ref.light];
            const Sobol& points = points_of(r);
            const Vec3 off = e.normal * scene_.push_off();
            const auto bring = [&](Vec3 y, Vec3 flux) {
                const double solid = length(flux);
                visit(LightRay{x, y + off, false, {.start = width, .end = std::sqrt(e.area / each), .start_normal = normal, .end_normal = e.normal}}, flux / solid, Rgbd{solid, solid, solid}, Rgbd{});
            };
            if (few) emitters_.sample_few(ref.light, x, normal, index * each, each, points(index, 4), points, 2e-4, share, bring);
            else emitters_.sample(ref.light, x, normal, index * each, each, points, 2e-4, EmitterSet::Arrival::whole, share, bring);
            return;
        }
        // Of a sun in full view many points of its disc: where it grazes a surface one of them says little.
        const bool disc = light.kind == LightKind::sun && light.angular_radius_rad > 0;
        const std::uint32_t many = !few && disc ? each : 1;
        for (std::uint32_t k = 0; k < many; ++k) {
            LightSample s;
            if (sample_light(light, x, normal, disc ? points_of(r).pair(index * many + k, 2) : Vec2{}, &s))
                visit(ray_to(s, x, width, normal, part_of_disc(light, few ? discs : many)), s.direction, s.weight * (1.0 / many), s.ambient * (1.0 / many));
        }
    };
    const auto add = [&](const LuxelKernel& kernel, KernelSum& sum, Vec3 way, Rgbd weight, Vec3 normal, Rgbd ambient) {
        kernel.add(sum, way, weight);
        if (ambient != Rgbd{}) kernel.add(sum, normal, ambient);
    };
    thread_local std::vector<LightRay> queue;
    thread_local std::vector<Transmitted> told;
    thread_local std::vector<std::size_t> edges, first; // receivers of which rays decide; of each, in the queue
    edges.clear(), first.clear(), queue.clear();
    if (ref.penumbra || closely) {
        edges.resize(receivers.size());
        std::iota(edges.begin(), edges.end(), std::size_t{0});
    } else {
        // In full view of the patch, or not seen at all: a few rays to make sure, more for a strong light.
        // Where they agree there is no noise: the light is evaluated in the middle, its gradient cancels over
        // the luxel. What does not is about (size / distance)^2, shared by the places where it is evaluated.
        const std::uint32_t checks = ref.samples <= 2 && !ref.filtered ? 1 : 4;
        for (std::size_t r = 0; r < receivers.size(); ++r) {
            first.push_back(queue.size());
            for (std::uint32_t k = 0; k < checks; ++k)
                shine(r, checks == 1 && !ref.hidden ? at[r].middle : place(r, k), k, 1, true, std::sqrt(receivers[r].footprint->area()), 1,
                      [](const LightRay& ray, Vec3, Rgbd, Rgbd) { queue.push_back(ray); });
        }
        first.push_back(queue.size());
        scene_.transmitted(queue, told);
        *rays += queue.size();
        for (std::size_t r = 0; r < receivers.size(); ++r) {
            std::size_t seen = 0;
            double least_through = 1, most_through = 0;
            for (std::size_t k = first[r]; k < first[r + 1]; ++k) {
                if (told[k].blocked) continue;
                const double arrives = mean(told[k].share);
                ++seen, least_through = std::min(least_through, arrives), most_through = std::max(most_through, arrives);
            }
            if (seen != (ref.hidden ? 0 : first[r + 1] - first[r])) {
                edges.push_back(r);
                continue;
            }
            if (ref.hidden) continue;
            const Footprint& footprint = *receivers[r].footprint;
            const LuxelKernel& kernel = *receivers[r].kernel;
            const Point& middle = at[r].middle;
            const bool filter = ref.filtered || least_through < 1;
            // A grid where there can be one: its gradients cancel as that of the middle does.
            const double wanted = footprint.area() / (square(distance_to(ref, middle.position)) * 0.01 * options_.error_percent);
            const bool grid = footprint.whole_square();
            std::uint32_t side = grid ? 1 : 2;
            while (side < kMostSide && side * side < wanted) side = grid && side < 4 ? side + 1 : 2 * side;
            // What panes let through differs over the luxel: within the squares of a grid their textures are averaged exactly, their rims are not.
            if (most_through - least_through > kAlike * 0.01 * options_.error_percent * most_through) side = std::max(side, options_.error_percent > 6 ? 4u : 8u);
            const std::uint32_t places = side * side;
            // A part that the horizon of a tilted normal cuts brings more than its mean direction does: next to a wall of light
            // with parts as coarse as one point a place allows floors were 5 to 7 % too dark along such normals.
            const auto across = [&](const Emitter& e) { return kernel.bends_over(e.center - middle.position, e.radius + std::sqrt(footprint.area())); };
            const bool cut = ref.is_emitter && share == EmitterSet::Share::solid && (!emitters_.is_far(ref.light, middle.position, middle.normal) || across(emitters_.emitters[ref.light]));
            // Else points tell kernels that are not linear how wide it is, to second order of its size: the small need one.
            std::uint32_t each = cut ? kFullView : std::max(1u, std::bit_floor(kFullView / places));
            if (ref.is_emitter && !cut) {
                const double needed = emitters_.emitters[ref.light].area / (square(distance_to(ref, middle.position)) * 0.01 * options_.error_percent);
                each = std::bit_ceil(static_cast<std::uint32_t>(std::clamp(std::ceil(needed), 1.0, 1.0 * each)));
            }
            KernelSum part;
            for (std::uint32_t k = 0; k < places; ++k) {
                const Vec2 in{(k % side + 0.5) / side, (k / side + 0.5) / side};
                const Point from = !grid ? place(r, k) : side == 1 ? middle : lifted(footprint.sample(in));
                shine(r, from, k, each, false, std::sqrt(footprint.area()) / side, 1, [&](const LightRay& ray, Vec3 way, Rgbd weight, Rgbd ambient) {
                    const Transmitted arrives = filter ? scene_.transmitted(ray) : Transmitted{{1, 1, 1}};
                    if (!arrives.blocked) add(kernel, part, way, arrives.share * weight, from.normal, arrives.share * ambient);
                });
            }
            part *= 1.0 / places;
            receivers[r].sum += part;
        }
        if (edges.empty()) return false;
    }
    // A shadow edge. The number of rays follows from the patch's test rays, never from these: were it made by
    // these, edges would lose the light of luxels hardly lit. A large or near emitter is many lights: fewer
    // places, more points on it from each.
    struct Brought { // by a ray of the queue
        Vec3 way, normal;
        Rgbd weight, ambient;
        std::uint32_t place;
    };
    thread_local std::vector<Brought> brought;
    struct Part { // of the queue
        std::size_t receiver, first;
        std::uint32_t places;
    };
    thread_local std::vector<Part> parts;
    const std::uint32_t samples = std::uint32_t{ref.samples} * effort_[patch];
    const auto flush = [&] {
        scene_.transmitted(queue, told);
        *rays += queue.size();
        for (std::size_t i = 0; i < parts.size(); ++i) {
            Receiver& receiver = receivers[parts[i].receiver];
            const std::size_t end = i + 1 < parts.size() ? parts[i + 1].first : queue.size();
            const std::uint32_t places = parts[i].places;
            KernelSum part;
            double squares = 0;
            for (std::size_t k = parts[i].first; k < end;) {
                KernelSum one;
                for (const std::uint32_t from = brought[k].place; k < end && brought[k].place == from; ++k)
                    if (!told[k].blocked) add(*receiver.kernel, one, brought[k].way, told[k].share * brought[k].weight, brought[k].normal, told[k].share * brought[k].ambient);
                squares += square(mean(one.flat));
                part += one;
            }
            part *= 1.0 / places;
            receiver.variance += std::max(0.0, squares / places - square(mean(part.flat))) / (places - 1);
            receiver.sum += part;
        }
        queue.clear(), brought.clear(), parts.clear();
    };
    constexpr std::size_t kTogether = 256; // rays
    queue.clear(), brought.clear(), parts.clear();
    for (const std::size_t r : edges) {
        const bool near = ref.is_emitter && !emitters_.is_far(ref.light, at[r].middle.position, at[r].middle.normal);
        const std::uint32_t places = near ? std::max<std::uint32_t>(samples / 8, samples < 8 ? 2 : 4) : samples;
        const std::uint32_t each = near ? 2 * samples / places : 1;
        parts.push_back({r, queue.size(), places});
        for (std::uint32_t k = 0; k < places; ++k) {
            const Point from = place(r, k);
            shine(r, from, k, each, true, std::sqrt(receivers[r].footprint->area() / places), places,
                  [&](const LightRay& ray, Vec3 way, Rgbd weight, Rgbd ambient) { queue.push_back(ray), brought.push_back({way, from.normal, weight, ambient, k}); });
        }
        if (queue.size() >= kTogether) flush();
    }
    flush();
    return !ref.penumbra && !closely;
}

// visit(light, what it brings) for those of the patch that are `wanted`, places in its list, at a luxel of it or at places all over it: its footprint.
void Bake::each_direct_at(std::uint32_t patch, std::uint32_t luxel, const Footprint& footprint, const LuxelKernel& kernel, std::uint64_t seed, std::uint64_t* rays, bool closely,
                          const std::function<bool(const LightRef&)>& wanted, const std::function<void(std::size_t, const KernelSum&)>& visit) const {
    std::vector<PlaceDirect> kept, now;
    std::uint64_t key = 0;
    if (memo_) {
        key = key_of(patch, mix(base_, table_.low, KeyOf::place, luxel, seed, effort_[patch], static_cast<std::uint64_t>(closely), hash_of(kernel).low));
        if (const auto bytes = memo_->direct.find(key, {})) read_whole(*bytes, kept);
    }
    bool all_kept = true;
    for (std::size_t r = 0; r < lists_[patch].size(); ++r) {
        const LightRef& ref = lists_[patch][r];
        if (!wanted(ref)) continue;
        PlaceDirect part{memo_ ? hash_of_ref(ref, false) : 0, 0, {}};
        if (const auto at = std::ranges::find(kept, part.of, &PlaceDirect::of); at != kept.end()) {
            part = *at;
        } else {
            Receiver at_place{&footprint, &kernel, seed};
            direct_from(ref, patch, {&at_place, 1}, closely, &part.rays);
            part.sum = StoredSum(at_place.sum), all_kept = false;
        }
        *rays += part.rays;
        if (memo_) now.push_back(part);
        KernelSum sum = part.sum.sum();
        visit(r, sum *= brightness(ref));
    }
    if (memo_ && !all_kept) memo_->direct.keep(key, {}, {}, to_bytes(now));
}

KernelSum Bake::direct_at(std::uint32_t patch, std::uint32_t luxel, const Footprint& footprint, const LuxelKernel& kernel, std::uint64_t seed, std::uint64_t* rays, bool closely) const {
    KernelSum all;
    each_direct_at(patch, luxel, footprint, kernel, seed, rays, closely, [](const LightRef&) { return true; }, [&](std::size_t, const KernelSum& sum) { all += sum; });
    return all;
}

// A light's part in a luxel depends on no other light: the memo has them one by one.
void Bake::luxel_direct_of(std::uint32_t p, std::uint64_t pass, std::vector<std::uint32_t>* divided, std::uint64_t* rays) {
    const std::span<const std::uint32_t> luxels = luxels_of(p);
    const std::vector<LightRef>& list = lists_[p];
    thread_local std::vector<double> variances;
    variances.assign(luxels.size(), 0);
    for (const std::uint32_t l : luxels) direct_[l] = {};
    brought_[p].assign(list.size(), 0);
    const std::uint64_t key = memo_ ? key_of(p, mix(base_, table_.low, p, effort_[p], pass)) : 0;
    thread_local PatchDirect kept, now;
    kept.refs.clear(), now.refs.clear(), now.luxels.clear(), now.first.assign(1, 0);
    if (const auto bytes = memo_ && !luxels.empty() ? memo_->direct.find(key, {}) : std::nullopt) read_whole(*bytes, kept);
    const auto take = [&](std::size_t r, std::span<const LuxelDirect> part, std::uint8_t is_divided, std::uint64_t traced) {
        const Rgbd bright = brightness(list[r]);
        double brought = 0;
        for (std::size_t i = 0; i < part.size(); ++i) {
            KernelSum sum = part[i].sum.sum();
            direct_[luxels[i]] += sum *= bright;
            variances[i] += static_cast<double>(part[i].variance) * square(mean(bright)), brought += mean(sum.flat);
        }
        if (!luxels.empty()) brought_[p][r] = static_cast<float>(brought / static_cast<double>(luxels.size()));
        if (is_divided) divided->push_back(static_cast<std::uint32_t>(r));
        *rays += traced;
    };
    const auto tell_variances = [&] {
        for (std::size_t i = 0; i < luxels.size(); ++i) direct_variance_[luxels[i]] = static_cast<float>(variances[i]);
    };
    for (std::size_t r = 0; memo_ && r < list.size(); ++r) now.refs.push_back(hash_of_ref(list[r], false));
    if (memo_ && !luxels.empty() && kept.refs == now.refs) {
        for (std::size_t r = 0; r < list.size(); ++r) take(r, kept.of(r), kept.divided[r], kept.rays[r]);
        return tell_variances();
    }
    std::vector<std::size_t> found(list.size(), SIZE_MAX); // in `kept`
    for (std::size_t r = 0; r < now.refs.size(); ++r)
        if (const auto at = std::ranges::find(kept.refs, now.refs[r]); at != kept.refs.end()) found[r] = static_cast<std::size_t>(at - kept.refs.begin());
    std::vector<Footprint> footprints; // made when they are asked for
    std::vector<LuxelKernel> kernels;
    std::vector<Receiver> receivers;
    const std::size_t n = luxels.size();
    now.divided.assign(list.size(), 0), now.rays.assign(list.size(), 0);
    std::vector<LuxelDirect> part;
    for (std::size_t r = 0; r < list.size(); ++r) {
        if (found[r] != SIZE_MAX) {
            const auto before = kept.of(found[r]); // not moved: of two equal lights at one place both come from there
            part.assign(before.begin(), before.end());
            now.divided[r] = kept.divided[found[r]], now.rays[r] = kept.rays[found[r]];
        } else {
            for (std::size_t i = footprints.size(); i < n; ++i) footprints.push_back(footprint_of_luxel(luxels[i])), kernels.push_back(kernel_of(luxels[i]));
            receivers.clear();
            for (std::size_t i = 0; i < n; ++i)
                if (!footprints[i].empty()) receivers.push_back({&footprints[i], &kernels[i], seed_at(luxel_centroid(surfaces_.luxels[luxels[i]]), pass)});
            now.divided[r] = direct_from(list[r], p, receivers, false, &now.rays[r]);
            part.assign(n, {});
            bool dark = true;
            for (std::size_t i = 0, k = 0; i < n; ++i) {
                if (footprints[i].empty()) continue;
                part[i] = {StoredSum(receivers[k].sum), static_cast<float>(receivers[k].variance)}, ++k;
                dark = dark && part[i].sum.flat == Rgb{} && part[i].sum.rnm == std::array<Rgb, 3>{} && part[i].variance == 0;
            }
            if (dark) part.clear();
        }
        take(r, part, now.divided[r], now.rays[r]);
        now.luxels.insert(now.luxels.end(), part.begin(), part.end()), now.first.push_back(static_cast<std::uint32_t>(now.luxels.size()));
    }
    tell_variances();
    if (memo_ && n) memo_->direct.keep(key, {}, {}, to_bytes(now));
}

// Which lights were found to be in full view of some luxels of a patch only, though its test rays had agreed: places in its list.
std::vector<Bake::Found> Bake::luxel_direct(std::span<const std::uint32_t> patches) {
    direct_.resize(surfaces_.luxels.size());
    direct_variance_.resize(surfaces_.luxels.size());
    brought_.resize(patches_.patches.size()), near_lights_.resize(patches_.patches.size()), untold_.resize(patches_.patches.size());
    constexpr std::size_t kChunk = 16;
    std::vector<std::vector<Found>> divided(slots_of(patches.size(), kChunk));
    parallel_chunks(context_, "light: direct", patches.size(), kChunk, [&](std::size_t begin, std::size_t end) {
        std::uint64_t rays = 0;
        for (const std::uint32_t p : patches.subspan(begin, end - begin)) {
            Found of{p, {}};
            // Other points each time: that a place was found noisy must not be part of its value. Counted by patch: what goes on elsewhere changes nothing here.
            luxel_direct_of(p, 1024 + std::uint64_t{direct_draws_[p]++}, &of.emitters, &rays);
            near_lights_[p] = near_lights_of(p);
            untold_[p] = 1;
            if (!of.emitters.empty()) divided[begin / kChunk].push_back(std::move(of));
        }
        shadow_rays_ += rays;
    });
    return joined(divided);
}

// Where one luxel of a patch finds that its test rays were wrong about a light, others may have missed what it found: the patch and those
// next to it look at that light closely from then on, and are done again; and so on along a streak of light, as long as there is some where test rays had seen none.
void Bake::luxel_direct_all() {
    std::vector<std::uint32_t> patches(patches_.patches.size());
    std::iota(patches.begin(), patches.end(), 0u);
    for (std::uint32_t look = 0; !patches.empty(); ++look) {
        while (!patches.empty()) patches = mark_beside(patches, luxel_direct(patches));
        if (look < kLooks) patches = look_closely(look);
    }
}

// By what was found of lights in `patches`, which have just been done: those that look at one closely from now on.
std::vector<std::uint32_t> Bake::mark_beside(std::span<const std::uint32_t> patches, const std::vector<Found>& divided) {
    std::vector<std::uint32_t> marked;
    const auto mark = [&](std::uint32_t q, const LightRef& found) {
        for (LightRef& ref : lists_[q])
            if (ref.light == found.light && ref.is_emitter == found.is_emitter && !ref.penumbra) ref.penumbra = true, marked.push_back(q);
    };
    const auto mark_around = [&](std::uint32_t p, const LightRef& found) {
        for (const std::uint32_t q : neighbours_[p]) mark(q, found);
    };
    for (const auto& [p, places] : divided)
        for (const std::uint32_t r : places) {
            const LightRef found = lists_[p][r];
            mark(p, found), mark_around(p, found);
        }
    for (const std::uint32_t p : patches)
        for (std::size_t r = 0; r < lists_[p].size(); ++r)
            if (const LightRef found = lists_[p][r]; found.hidden && found.penumbra && matters(p, static_cast<double>(brought_[p][r]))) mark_around(p, found);
    return each_once(std::move(marked));
}

// Is it worth being found, in irradiance of a patch?
bool Bake::matters(std::uint32_t p, double light) const {
    return light > quality_.light_cutoff * std::max(estimate_[p], floor_);
}

// Lights that test rays saw nothing of, looked for closely at some of the luxels: where one is found, the patch looks closely from then on. Which patches.
std::vector<std::uint32_t> Bake::look_closely(std::uint32_t look) {
    const std::vector<std::uint32_t> chosen = drawn_luxels(pilot_share(), look + 1);
    constexpr std::size_t kChunk = 16;
    std::vector<std::vector<std::pair<std::uint32_t, std::size_t>>> found(slots_of(chosen.size(), kChunk)); // patch, place in its list
    parallel_chunks(context_, chosen.size(), kChunk, [&](std::size_t begin, std::size_t end) {
        std::uint64_t rays = 0;
        for (const std::uint32_t l : std::span(chosen).subspan(begin, end - begin)) {
            const std::uint32_t p = luxel_patch_[l];
            const auto unseen = [](const LightRef& r) { return r.hidden && !r.penumbra; };
            if (std::ranges::none_of(lists_[p], unseen)) continue;
            const Footprint footprint = footprint_of_luxel(l);
            if (footprint.empty()) continue;
            each_direct_at(p, l, footprint, kernel_of(l), mix(seed_at(luxel_centroid(surfaces_.luxels[l]), kLook), look), &rays, true, unseen, [&](std::size_t r, const KernelSum& sum) {
                if (matters(p, mean(sum.flat))) found[begin / kChunk].push_back({p, r});
            });
        }
        shadow_rays_ += rays;
    });
    std::vector<std::uint32_t> patches;
    for (const auto& [p, r] : joined(found)) lists_[p][r].penumbra = true, patches.push_back(p);
    return each_once(std::move(patches));
}

// Samples of direct light where they are worth it: such that its noise, `measured` as things are, becomes `wanted` at the
// least cost. The spread between the places of a luxel says where it is, not how large: places are spread evenly. Which patches changed.
std::vector<std::uint32_t> Bake::share_direct(double measured, double wanted) {
    constexpr std::uint16_t kMostEffort = 64;
    const std::size_t n = patches_.patches.size();
    std::vector<double> variance(n);
    double all = 0, seen = 0;
    for (std::uint32_t p = 0; p < n; ++p) {
        const double area = luxel_area_[p];
        for (const std::uint32_t l : luxels_of(p)) {
            const Luxel& luxel = surfaces_.luxels[l];
            const double scale = std::max(mean(direct_[l].flat) + mean(rest_[p]), floor_);
            if (scale > 0) variance[p] += luxel.area * luxel_area(surfaces_, luxel.face) * direct_variance_[l] / (scale * scale);
        }
        all += area, seen += variance[p];
        if (area > 0) variance[p] /= area;
    }
    if (!(seen > 0)) return {};
    for (double& v : variance) v *= measured * measured * all / seen;
    const std::vector<double> more = least_cost(single_noise(variance), wanted);
    std::vector<std::uint32_t> changed;
    for (std::uint32_t p = 0; p < more.size(); ++p) {
        std::uint32_t by = 1;
        while (effort_[p] * by < kMostEffort && by * 1.41 < more[p]) by *= 2;
        if (by > 1) effort_[p] = static_cast<std::uint16_t>(effort_[p] * by), changed.push_back(p);
    }
    return changed;
}

// Direct irradiance of patches: the mean of their luxels; patches without any are sampled for themselves.
std::vector<Rgbd> Bake::patch_direct() {
    std::vector<Rgbd> out(patches_.patches.size());
    for (std::uint32_t p = 0; p < out.size(); ++p) {
        double area = 0;
        for (const std::uint32_t l : luxels_of(p)) {
            const Luxel& luxel = surfaces_.luxels[l];
            double a = std::max(1e-6, static_cast<double>(luxel.area));
            if (surfaces_.charts[luxel.chart.at()].curved()) a *= luxel_area(surfaces_, luxel.face); // not all alike
            out[p] += direct_[l].flat * a, area += a;
        }
        if (area > 0) {
            out[p] *= 1 / area;
            continue;
        }
        const Patch& patch = patches_.patches[p];
        const Footprint footprint = footprint_of_patch(p);
        if (footprint.empty() || lists_[p].empty()) continue;
        LuxelKernel kernel;
        const Vec3 normal = surfaces_.faces[patch.face.at()].normal;
        kernel.frame = frame_around(normal);
        constexpr int kTimes = 4; // a whole face: several places
        std::uint64_t rays = 0;
        for (std::uint64_t t = 0; t < kTimes; ++t) {
            out[p] += direct_at(p, UINT32_MAX, footprint, kernel, seed_at(patch.centroid, 16 + t), &rays).flat * (1.0 / kTimes);
        }
        shadow_rays_ += rays;
    }
    return out;
}

} // namespace kiln

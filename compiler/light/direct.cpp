// Direct light: which lights are worth explicit rays for which patch, and those rays at the luxels.
#include "compiler/light/bake.h"
#include "libs/parallel/parallel.h"
#include <numbers>

namespace kiln {
namespace {
constexpr double kPi = std::numbers::pi;
}

bool Bake::listed(std::uint32_t patch, std::uint32_t emitter) const {
    const auto first = lists_.begin() + static_cast<std::ptrdiff_t>(list_first_[patch]);
    auto last = lists_.begin() + static_cast<std::ptrdiff_t>(list_first_[patch + 1]);
    // Emitters come first, in ascending order.
    const auto at = std::lower_bound(first, last, emitter, [](const LightRef& r, std::uint32_t e) {
        return r.is_emitter && r.light < e;
    });
    return at != last && at->is_emitter && at->light == emitter;
}

// For every patch: emitters that it or a neighbour sees and whose light, left to the gathered rays, would be too noisy;
// and every light entity that could matter. What is not listed stays with the gathered rays: nothing is lost.
void Bake::choose_lights(const std::vector<Rgbd>& irradiance) {
    const std::size_t n = patches_.patches.size();
    double area = 0, sum = 0;
    for (std::size_t p = 0; p < n; ++p) area += patches_.patches[p].area, sum += patches_.patches[p].area * mean(irradiance[p]);
    const double floor = area > 0 ? options_.error_floor * sum / area : 0;
    const auto receives = [&](std::size_t p) {
        const Patch& patch = patches_.patches[p];
        return max_component(patch.reflectance) > 0 || surfaces_.faces[patch.face.at()].chart.valid();
    };
    // The form factor above which emitter i is worth rays of its own at patch p. Noise of N gathered rays that hit with
    // probability F: contrast pi sqrt(F / N), halved by stratification. Only what stands out against the rest makes
    // noise: in a furnace nothing does.
    const auto threshold = [&](std::size_t p, std::uint32_t i) {
        const double contrast = mean(emitters_.emitters[i].radiance) - mean(irradiance[p]) / kPi;
        if (contrast <= 0) return 1e30;
        const double noise_per_root = 0.5 * kPi * contrast / std::sqrt(static_cast<double>(quality_.pilot_rays));
        const double root = quality_.promotion * std::max(mean(irradiance[p]), floor) / noise_per_root;
        return root * root;
    };
    // An upper bound of the form factor from anywhere on the patch, nearly.
    const auto bound = [&](std::size_t p, std::uint32_t i) {
        const Patch& patch = patches_.patches[p];
        const Emitter& emitter = emitters_.emitters[i];
        const Vec3 normal = surfaces_.faces[patch.face.at()].normal;
        const double radius = std::sqrt(patch.area);
        Vec3 x = patch.centroid + normal * (scene_.push_off() + 0.25 * radius);
        const double ahead = emitter.distance - dot(emitter.normal, x);
        if (ahead > 0) x += emitter.normal * std::min(ahead + 1e-3, radius); // a part may be in front of it
        return 4 * emitters_.bound(i, x, normal);
    };
    std::vector<std::vector<LightRef>> emitters(n), entities(n);
    constexpr std::size_t kChunk = 32;
    parallel_for(context_, "light: visible lights", (n + kChunk - 1) / kChunk, [&](std::size_t chunk) {
        std::uint64_t rays = 0;
        std::vector<std::uint8_t> met(emitters_.emitters.size());
        for (std::size_t p = chunk * kChunk; p < std::min(n, (chunk + 1) * kChunk); ++p) {
            const Patch& patch = patches_.patches[p];
            const Face& face = surfaces_.faces[patch.face.at()];
            if (!receives(p)) continue;
            const Footprint footprint = footprint_of_patch(static_cast<std::uint32_t>(p));
            if (footprint.empty()) continue;
            const Vec3 lift = face.normal * scene_.push_off();
            const double radius = std::sqrt(patch.area);
            const Sobol points(seed_at(patch.centroid, 2));
            // What the bundle of the row has met is visible.
            std::fill(met.begin(), met.end(), 0);
            for (std::uint32_t i = 0; i < quality_.row_rays; ++i) {
                const std::uint32_t hit = hits_[p * quality_.row_rays + i];
                const std::uint32_t e = is_patch(hit) ? patch_emitter_[hit] : hit < kHitBlack ? hit & ~kHitEmitter : UINT32_MAX;
                if (e != UINT32_MAX) met[e] = 1;
            }
            for (std::uint32_t i = 0; i < emitters_.emitters.size(); ++i) {
                const Emitter& emitter = emitters_.emitters[i];
                const double least = threshold(p, i), most = least < 1e30 ? bound(p, i) : 0;
                if (most < least) continue;
                std::uint32_t seen = 0, tested = 0;
                double factor = 0;
                // Few test rays for what matters little, all of them for what would stand out if it were missed.
                const std::uint32_t early = most > 400 * least ? quality_.visibility_rays : 4;
                for (std::uint32_t k = 0; k < quality_.visibility_rays; ++k) {
                    if (k >= early && seen == 0) break;
                    const Vec3 x = footprint.sample(points.pair(k, 0)) + lift;
                    const Vec3 y = emitters_.point_on(i, points.pair(k, 2)) + emitter.normal * scene_.push_off();
                    const Vec3 d = y - x;
                    const double cx = dot(face.normal, d), cy = -dot(emitter.normal, d), r2 = dot(d, d);
                    ++tested;
                    if (cx <= 0 || cy <= 0) continue;
                    ++rays;
                    if (scene_.occluded(x, y)) continue;
                    ++seen;
                    factor += std::min(1.0, cx * cy * emitter.area / (kPi * r2 * r2));
                }
                if (!seen && !met[i]) continue;
                if (seen && !met[i] && factor / tested < least) continue;
                emitters[p].push_back({i, true, seen == tested ? kClear : kPenumbra});
            }
            for (std::uint32_t i = 0; i < lights_.size(); ++i) {
                const Light& light = lights_[i];
                if (light.kind == LightKind::sky) continue;
                // The light of entities is not in the estimate yet: E of the patch is what the emitters bring, or this.
                if (light_bound(light, patch.centroid, radius) <= quality_.light_cutoff * std::max(mean(irradiance[p]), floor)) continue;
                std::uint32_t seen = 0, tested = 0;
                for (std::uint32_t k = 0; k < quality_.visibility_rays; ++k) {
                    if (k == 4 && seen == 0) break;
                    const Vec3 x = footprint.sample(points.pair(k, 0)) + lift;
                    LightSample s;
                    if (!sample_light(light, x, face.normal, points.pair(k, 2), &s)) continue;
                    ++tested, ++rays;
                    const bool visible = s.distant ? scene_.reaches_sky(x, s.direction) : !scene_.occluded(x, s.position);
                    seen += visible;
                }
                if (!tested) continue;
                entities[p].push_back({i, false, seen == tested ? kClear : seen ? kPenumbra : kUnlikely});
            }
        }
        shadow_rays_ += rays;
    });
    // A shaft of light may fall between the test rays of a patch, hardly between those of its neighbours as well; and
    // where a neighbour sees less of a light, the edge of its shadow may reach over. So only patches among their like
    // go without a closer look.
    std::vector<std::vector<LightRef>> spread = emitters, spread_entities = entities;
    const auto offer = [&](std::uint32_t to, std::uint32_t from) {
        if (!receives(to)) return;
        for (const LightRef& r : emitters[from]) {
            const auto at = std::ranges::find(spread[to], r.light, &LightRef::light);
            if (at == spread[to].end()) {
                if (bound(to, r.light) >= threshold(to, r.light)) spread[to].push_back({r.light, true, kPenumbra});
            } else if (r.samples != kClear) {
                at->samples = kPenumbra;
            }
        }
        for (LightRef& r : spread[to]) // the neighbour does not see it at all
            if (receives(from) && std::ranges::find(emitters[from], r.light, &LightRef::light) == emitters[from].end())
                r.samples = kPenumbra;
        for (const LightRef& r : entities[from]) {
            const auto at = std::ranges::find(spread_entities[to], r.light, &LightRef::light);
            if (at != spread_entities[to].end() && at->samples != r.samples) at->samples = kPenumbra;
        }
    };
    for (const auto& [a, b] : edges_) {
        const std::uint32_t p = patches_.piece_patch[a], q = patches_.piece_patch[b];
        if (p != q) offer(p, q), offer(q, p);
    }
    list_first_.assign(1, 0);
    lists_.clear();
    for (std::size_t p = 0; p < n; ++p) {
        std::ranges::sort(spread[p], {}, &LightRef::light);
        lists_.insert(lists_.end(), spread[p].begin(), spread[p].end());
        lists_.insert(lists_.end(), spread_entities[p].begin(), spread_entities[p].end());
        list_first_.push_back(lists_.size());
    }
}

// Explicit light averaged over a footprint. Places and points on the light share one sequence, so that a light seen
// from everywhere needs one ray and a penumbra gets up to `direct_samples`.
void Bake::direct_at(const Footprint& footprint, Vec3 normal, std::uint32_t patch, std::uint64_t seed,
                     const LuxelKernel& kernel, KernelSum* sum, std::uint64_t* rays) const {
    const Vec3 lift = normal * scene_.push_off();
    for (std::uint64_t k = list_first_[patch]; k < list_first_[patch + 1]; ++k) {
        const LightRef& ref = lists_[k];
        const Sobol points(mix(seed, ref.light, static_cast<std::uint64_t>(ref.is_emitter)));
        // One sample of a light that is in full view stands in the middle: the light varies little, its gradient less.
        const bool middle = ref.samples == 1 && footprint.whole_square();
        std::uint32_t wanted = ref.samples, done = 0, seen = 0, tested = 0;
        if (wanted == 1 && !middle) wanted = 2;
        if (wanted == kPenumbra) wanted = quality_.direct_samples / 4;
        KernelSum part;
        while (done < wanted) {
            for (; done < wanted; ++done) {
                const Vec3 x = (middle && wanted == 1 ? footprint.centroid() : footprint.sample(points.pair(done, 0))) + lift;
                if (ref.is_emitter) {
                    const Emitter& e = emitters_.emitters[ref.light];
                    const Vec3 off = e.normal * scene_.push_off();
                    emitters_.sample(ref.light, x, normal, done, 1, points, 2e-4, [&](Vec3 y, Vec3 way, double omega) {
                        ++tested;
                        if (scene_.occluded(x, y + off)) return;
                        ++seen;
                        kernel.add(part, way, e.radiance * omega);
                    });
                } else {
                    const Light& light = lights_[ref.light];
                    LightSample s;
                    if (!sample_light(light, x, normal, points.pair(done, 2), &s)) continue;
                    ++tested;
                    if (!(s.distant ? scene_.reaches_sky(x, s.direction) : !scene_.occluded(x, s.position))) continue;
                    ++seen;
                    kernel.add(part, s.direction, s.weight);
                    if (light.angle_scale < 1) kernel.add(part, normal, s.ambient);
                }
            }
            // Some rays blocked and some not: an edge of shadow, go on. The rest of the choice was made by the patch, from
            // other rays: were it made by these, shadow edges would lose the light of luxels hardly lit.
            if (wanted < quality_.direct_samples && seen > 0 && (seen < tested || ref.samples == kUnlikely))
                wanted = quality_.direct_samples;
        }
        part *= 1.0 / done;
        *sum += part;
        *rays += tested;
    }
}

void Bake::luxel_direct() {
    const std::size_t n = surfaces_.luxels.size();
    direct_.assign(n, {});
    constexpr std::size_t kChunk = 64;
    parallel_for(context_, "light: direct", (n + kChunk - 1) / kChunk, [&](std::size_t chunk) {
        std::uint64_t rays = 0;
        for (std::size_t i = chunk * kChunk; i < std::min(n, (chunk + 1) * kChunk); ++i) {
            const auto l = static_cast<std::uint32_t>(i);
            const Luxel& luxel = surfaces_.luxels[i];
            if (luxel_patch_[i] == kNoPatch) continue;
            const Footprint footprint = footprint_of_luxel(l);
            if (footprint.empty()) continue;
            direct_at(footprint, surfaces_.charts[luxel.chart.at()].n, luxel_patch_[i], seed_at(luxel_centroid(luxel), 3),
                      kernel_of(l), &direct_[i], &rays);
        }
        shadow_rays_ += rays;
    });
}

// Direct irradiance of patches: the mean of their luxels; patches without any are sampled for themselves.
std::vector<Rgbd> Bake::patch_direct() {
    std::vector<Rgbd> out(patches_.patches.size());
    for (std::uint32_t p = 0; p < out.size(); ++p) {
        double area = 0;
        for (std::uint32_t k = patch_luxel_first_[p]; k < patch_luxel_first_[p + 1]; ++k) {
            const std::uint32_t l = patch_luxels_[k];
            const double a = std::max(1e-6, static_cast<double>(surfaces_.luxels[l].area));
            out[p] += direct_[l].flat * a, area += a;
        }
        if (area > 0) {
            out[p] *= 1 / area;
            continue;
        }
        const Patch& patch = patches_.patches[p];
        const Footprint footprint = footprint_of_patch(p);
        if (footprint.empty() || list_first_[p] == list_first_[p + 1]) continue;
        LuxelKernel kernel;
        const Vec3 normal = surfaces_.faces[patch.face.at()].normal;
        kernel.frame = frame_around(normal);
        constexpr int kTimes = 4; // a whole face: several places
        std::uint64_t rays = 0;
        for (std::uint64_t t = 0; t < kTimes; ++t) {
            KernelSum sum;
            direct_at(footprint, normal, p, seed_at(patch.centroid, 16 + t), kernel, &sum, &rays);
            out[p] += sum.flat * (1.0 / kTimes);
        }
        shadow_rays_ += rays;
    }
    return out;
}

} // namespace kiln

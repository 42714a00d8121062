// The final gather: a guided bundle from every luxel, all kernels at once.
#include "compiler/light/bake.h"
#include "libs/core/each_once.h"
#include "libs/parallel/parallel.h"
#include "libs/sampling/maps.h"
#include <numbers>
#include <numeric>

namespace kiln {
namespace {
constexpr double kPi = std::numbers::pi;
double luminance(Rgbd c) {
    return mean(c);
}
struct StoredGather {
    static constexpr bool kRawBytes = true;
    StoredSum sum;
    std::array<float, 4> variance{};
    std::uint32_t rays = 0, escaped = 0, back = 0;
    StoredGather() = default;
    explicit StoredGather(const LuxelGather& g)
        : sum(g.sum), rays(static_cast<std::uint32_t>(g.hits.rays)), escaped(static_cast<std::uint32_t>(g.hits.escaped)), back(static_cast<std::uint32_t>(g.hits.back)) {
        for (std::size_t j = 0; j < 4; ++j) variance[j] = static_cast<float>(g.variance[j]);
    }
};
struct PatchGather { // what a memo keeps of the luxels of a patch
    std::vector<StoredGather> luxels;
    std::vector<std::uint32_t> met;
    template <class A> void fields(A& a) { a(luxels, met); }
};
constexpr double kLeastDetermination = 0.75;     // coefficient of determination from which the control of a bundle counts, in full at 1
constexpr double kNoiseRate = 0.65;     // noise of these bundles falls as N to the minus this
} // namespace

Vec2 HemisphereMap::square(Vec3 way) const {
    const double z = std::max(0.0, way.z), across = std::sqrt(way.x * way.x + way.y * way.y);
    if (!(across > 0)) return {0.5, 0.5};
    const double r = std::sqrt(std::max(0.0, 1 - (a * z + 1 - a) * z));
    // Shirley and Chiu's map, from the disc to the square.
    const bool wide = std::abs(way.x) > std::abs(way.y);
    const double along = std::abs(wide ? way.x : way.y), beside = std::abs(wide ? way.y : way.x), turn = atan2_upper(beside, along) * (4 / kPi);
    const double x = std::copysign(wide ? r : r * turn, way.x), y = std::copysign(wide ? r * turn : r, way.y);
    return {(x + 1) / 2, (y + 1) / 2};
}

void Guide::clear() {
    cell_.fill(0);
    spots_.clear(), spot_share_ = 0;
}

void Guide::add_spot(Vec2 lo, Vec2 hi, double share) {
    spots_.push_back({lo, hi, share}), spot_share_ += share;
}

void Guide::build() {
    // Each cell 2, those beside it 1, along one side and then the other; of what there is.
    std::array<double, kSide * kSide> across, blurred;
    const auto blur = [](const std::array<double, kSide * kSide>& from, std::size_t line, std::size_t step, std::array<double, kSide * kSide>& to) {
        const double* f = &from[line];
        double* t = &to[line];
        t[0] = (2 * f[0] + f[step]) / 3;
        for (std::size_t i = 1; i + 1 < kSide; ++i) t[i * step] = (f[(i - 1) * step] + 2 * f[i * step] + f[(i + 1) * step]) / 4;
        t[(kSide - 1) * step] = (f[(kSide - 2) * step] + 2 * f[(kSide - 1) * step]) / 3;
    };
    for (std::size_t x = 0; x < kSide; ++x) blur(cell_, x * kSide, 1, across);
    for (std::size_t y = 0; y < kSide; ++y) blur(across, y, kSide, blurred);
    const double sum = std::accumulate(blurred.begin(), blurred.end(), 0.0);
    uniform_ = !(sum > 0);
    if (uniform_) return;
    marginal_[0] = 0;
    for (std::size_t x = 0; x < kSide; ++x) {
        row_[x][0] = 0;
        for (std::size_t y = 0; y < kSide; ++y) {
            const double p = (kUniformShare / (kSide * kSide)) + (1 - kUniformShare) * blurred[x * kSide + y] / sum;
            row_[x][y + 1] = row_[x][y] + p;
        }
        marginal_[x + 1] = marginal_[x] + row_[x][kSide];
    }
}

Vec2 Guide::sample(Vec2 u, double* density) const {
    if (spots_.empty()) return sample_cells(u, density);
    Vec2 out;
    if (u.x < spot_share_) {
        std::size_t k = 0;
        for (; k + 1 < spots_.size() && u.x >= spots_[k].share; ++k) u.x -= spots_[k].share;
        const Rectangle& r = spots_[k];
        out = {r.lo.x + (r.hi.x - r.lo.x) * std::min(u.x / r.share, 1.0), r.lo.y + (r.hi.y - r.lo.y) * u.y};
        const std::size_t at = cell(out);
        *density = density_of_cell(at / kSide, at % kSide);
    } else {
        out = sample_cells({(u.x - spot_share_) / (1 - spot_share_), u.y}, density);
    }
    *density *= 1 - spot_share_;
    for (const Rectangle& r : spots_)
        if (out.x >= r.lo.x && out.x <= r.hi.x && out.y >= r.lo.y && out.y <= r.hi.y) *density += r.share / ((r.hi.x - r.lo.x) * (r.hi.y - r.lo.y));
    return out;
}

Vec2 Guide::sample_cells(Vec2 u, double* density) const {
    *density = 1;
    if (uniform_) return u;
    const auto invert = [](const std::array<double, kSide + 1>& cdf, double v, std::size_t* cell) {
        const double wanted = v * cdf[kSide];
        // Counted, not searched: no step waits for another. The first is 0, and always below.
        using Pair [[gnu::vector_size(16)]] = double;
        using Count [[gnu::vector_size(16)]] = std::int64_t;
        Count below{1, 0}; // less 1 for each
        for (std::size_t k = 0; k < kSide; k += 2) below += Pair{cdf[k], cdf[k + 1]} <= Pair{wanted, wanted};
        const auto lo = static_cast<std::size_t>(-(below[0] + below[1]));
        *cell = lo;
        return (static_cast<double>(lo) + std::clamp((wanted - cdf[lo]) / (cdf[lo + 1] - cdf[lo]), 0.0, 1.0)) /
               kSide;
    };
    std::size_t x = 0, y = 0;
    const double sx = invert(marginal_, u.x, &x);
    const double sy = invert(row_[x], u.y, &y);
    *density = density_of_cell(x, y);
    return {sx, sy};
}

// From the bundles of the row and of the patches next to it in the same plane, whose directions mean the same: a
// spot that the patch's own rays missed is rarely missed by all of them.
void Bake::patch_guide(std::uint32_t p, Guide* guide) const {
    guide->clear();
    const std::uint32_t m = quality_.row_rays;
    const auto add = [&](std::uint32_t from, double weight) {
        const std::size_t first = static_cast<std::size_t>(from) * m;
        for (std::size_t i = first; i < first + m; ++i) {
            const std::uint32_t hit = hits_[i];
            double light = hit == kHitPanes ? light_through_panes(i, p) : is_patch(hit) ? bright_[hit] : 0;
            const std::uint32_t emitter = emitter_of(hit);
            if (emitter != UINT32_MAX && !listed(p, emitter))
                light += luminance(emitters_.emitters[emitter].radiance);
            guide->add(hit_cells_[i], weight * light);
        }
    };
    add(p, 1);
    for (const std::uint32_t q : neighbours_[p])
        if (receives(q)) add(q, 0.5);
    guide->build();
    add_spots(p, guide);
}

// By what each brings to the luxels of the patch, in part by what it could bring to it; in a small part evenly, for what only a rim of it sees.
Choice Bake::near_lights_of(std::uint32_t p) const {
    constexpr double kHiddenShare = 1.0 / 16; // no test ray of the patch saw it
    constexpr double kEvenShare = 1.0 / 16;
    const std::vector<LightRef>& list = lists_[p];
    const Patch& patch = patches_.patches[p];
    thread_local std::vector<double> could, brought;
    could.clear();
    for (const LightRef& r : list) {
        const double most = r.is_emitter ? kPi * mean(emitters_.emitters[r.light].radiance) * form_factor_bound(p, r.light) / 4 : light_bound(lights_[r.light], patch.centroid, std::sqrt(patch.area));
        could.push_back(most * (r.hidden ? kHiddenShare : 1));
    }
    const double all = std::accumulate(could.begin(), could.end(), 0.0), even = kEvenShare * (all > 0 ? all : 1) / static_cast<double>(list.size());
    for (double& c : could) c += even;
    brought.assign(brought_[p].begin(), brought_[p].end());
    Choice out;
    choose_by_light(brought, could, &out);
    return out;
}

// Irradiance that the listed lights of a patch bring to a place near it, from one of them.
Rgbd Bake::one_light_at(std::uint32_t patch, Vec3 x, Vec3 normal, Random& random) const {
    const std::vector<LightRef>& list = lists_[patch];
    const Choice& choice = near_lights_[patch];
    if (!(choice.total() > 0)) return {};
    const std::uint32_t at = choice.pick(random());
    const double scale = choice.total() / choice.weight(at);
    Rgbd light;
    if (list[at].is_emitter) {
        const Emitter& e = emitters_.emitters[list[at].light];
        const Sobol points(static_cast<std::uint64_t>(random() * 0x1p52));
        const double part = random();
        emitters_.sample_few(list[at].light, x, normal, 0, 1, part, points, 2e-4, EmitterSet::Share::cosine, [&](Vec3 y, Vec3 flux) {
            light = scene_.transmitted({.from = x, .to = y + e.normal * scene_.push_off()}).share * (e.radiance * std::max(0.0, dot(flux, normal)));
        });
    } else {
        LightSample s;
        const double u = random(), v = random();
        if (sample_light(lights_[list[at].light], x, normal, {u, v}, &s)) light = scene_.transmitted(ray_to(s, x)).share * (s.weight * dot(s.direction, normal) + s.ambient);
    }
    return light * scale;
}

// Radiance reflected at a hit. One close by lies where light may vary within a luxel and much within a patch (the
// other wall of a corner, a crevice): there the direct light of the luxel is kept, if it is much the same around it and
// else asked for at the very place, and the rest taken one bounce further on.
Rgbd Bake::reflected_at(const SceneHit& hit, std::uint32_t texel, Vec3 came, Random& random, const ReflectedLight& light, Looked* looked,
                        int depth) const {
    constexpr double kNearLuxels = 1.5;
    if (depth < kNearBounces && texel != UINT32_MAX) {
        if (hit.distance < kNearLuxels * index_.luxel_size(hit.face)) {
            const std::uint32_t patch = patches_.texel_patch[texel];
            if (patch < kMixedPatch) {
                const Face& face = surfaces_.faces[hit.face.at()];
                const auto all = static_cast<std::uint32_t>(patches_.patches.size());
                if (looked) looked->at(patch), looked->at(all + patch);
                if (looked && light.steep[texel]) looked->at(2 * all + patch);
                const bool front = dot(face.normal, came) < 0;
                const Vec3 n = front ? face.normal : -face.normal, from = hit.position + n * scene_.push_off();
                const double u = random(), v = random();
                const Vec3 way = frame_around(n).world(cosine_hemisphere({u, v}));
                const std::optional<SceneHit> next = scene_.closest(from, way);
                std::vector<PaneHit> panes;
                if (scene_.has_panes()) scene_.panes(from, way, next ? next->distance : 1e30, {}, panes);
                Rgbd radiance;
                if (!next) {
                    radiance = sky_;
                } else if (!next->back && front && panes.empty() && light.far[patch].x >= 0 && is_far(light, patch, code_at(*next))) {
                    radiance = static_cast<Rgbd>(light.far[patch]);
                } else if (!next->back) {
                    radiance = reflected_at(*next, way, random, light, looked, depth + 1);
                    const std::uint32_t e = emitters_.of_face[next->face.at()];
                    if (looked && e != UINT32_MAX) looked->at(emitter_part(e));
                    if (e != UINT32_MAX && !listed(patch, e)) radiance += emitters_.emitters[e].radiance;
                }
                if (!panes.empty()) radiance = through_panes(panes, way, patch, {}, random, light, looked, depth + 1, radiance);
                const Rgbd reflectance = static_cast<Rgbd>(patches_.patches[patch].reflectance);
                const Rgbd direct = light.steep[texel] ? reflectance * one_light_at(patch, from, n, random) * (1 / kPi)
                                                       : static_cast<Rgbd>(light.direct[texel]);
                return direct + reflectance * radiance;
            }
        }
    }
    return reflected_radiance(index_, patches_, light, hit, texel, looked);
}

LuxelGather Bake::gather(std::uint32_t l, const LuxelKernel& kernel, const Guide& guide, const HemisphereMap& map,
                         std::uint32_t rays, std::uint64_t seed, std::vector<std::uint32_t>* met, std::span<Other> others, Looked* looked) const {
    LuxelGather out;
    const Luxel& luxel = surfaces_.luxels[l];
    const Footprint footprint = footprint_of_luxel(l);
    if (footprint.empty()) return out;
    const std::uint32_t patch = luxel_patch_[l];
    const Chart& chart = surfaces_.charts[luxel.chart.at()];
    const Vec3 normal = chart.curved() ? footprint.normal() : chart.n;
    const Frame plain = frame_around(normal);
    const Sobol points(seed);
    thread_local std::vector<Vec3> origins, directions;
    thread_local std::vector<double> weights;
    thread_local std::vector<std::optional<SceneHit>> found;
    thread_local std::vector<std::uint32_t> texels; // of what was found
    thread_local std::array<std::vector<double>, 4> numbers; // two for where to, two for where from
    origins.resize(rays), directions.resize(rays), weights.resize(rays), found.resize(rays), texels.resize(rays);
    // Each in a loop of its own: what one ray waits for, the next works on meanwhile.
    for (std::size_t d = 0; d < 4; ++d) numbers[d].resize(rays), points.first(numbers[d], static_cast<int>(d));
    for (std::uint32_t i = 0; i < rays; ++i) {
        const Vec2 to = guide.sample({numbers[0][i], numbers[1][i]}, &weights[i]);
        numbers[0][i] = to.x, numbers[1][i] = to.y;
    }
    concentric_discs(numbers[0], numbers[1]);
    for (std::uint32_t i = 0; i < rays; ++i) directions[i] = map.lifted({numbers[0][i], numbers[1][i]});
    for (std::uint32_t i = 0; i < rays; ++i) {
        const Vec3 local = directions[i];
        const Footprint::Point at = footprint.sample({numbers[2][i], numbers[3][i]});
        const Frame frame = footprint.bent() ? frame_around(at.normal) : plain;
        directions[i] = frame.world(local);
        weights[i] = 1 / (weights[i] * map.density(local.z)); // solid angle times rays
        // The hemisphere over a face stands for the one over the curve it is a part of. Over the shading normal the
        // kernel would lose what the face hides of it: a share of (1 - cos) / 2.
        if (chart.curved()) weights[i] *= 2 / (1 + std::max(0.0, dot(at.normal, kernel.frame.n)));
        origins[i] = at.position + at.normal * scene_.push_off();
    }
    scene_.closest(origins, directions, found);
    out.hits.rays = rays;
    // Emitters without rays of their own that the bundle met more of than it should have.
    thread_local std::vector<std::uint32_t> unlisted, heavy;
    unlisted.clear(), heavy.clear();
    for (std::uint32_t i = 0; i < rays; ++i) {
        texels[i] = found[i] && !found[i]->back ? index_.texel_at(found[i]->face, found[i]->position) : UINT32_MAX;
        if (texels[i] != UINT32_MAX) __builtin_prefetch(&patches_.texel_patch[texels[i]]), __builtin_prefetch(&reflected_.texel[texels[i]]);
    }
    for (const auto& hit : found) {
        if (!hit || hit->back) continue;
        const std::uint32_t e = emitters_.of_face[hit->face.at()];
        if (looked && e != UINT32_MAX) looked->at(emitter_part(e));
        if (e != UINT32_MAX && !listed(patch, e)) unlisted.push_back(e);
    }
    if (met && !unlisted.empty()) {
        std::ranges::sort(unlisted);
        for (std::size_t i = 0, k = 0; i < unlisted.size(); i = k) {
            while (k < unlisted.size() && unlisted[k] == unlisted[i]) ++k;
            if (static_cast<double>(k - i) / rays >= threshold(patch, unlisted[i])) heavy.push_back(unlisted[i]);
        }
        met->insert(met->end(), heavy.begin(), heavy.end());
    }
    // Besides the sums, what a regression on the known integral of the kernels needs (unit radiance as control).
    struct Quarter {
        std::array<KernelValues, 3> light{}; // per colour
        KernelValues unit;
    };
    std::array<Quarter, 4> in_quarter{};
    Rgbd cross_sum;
    double unit_square = 0, own_square = 0;
    std::vector<PaneHit> panes; // of a ray
    const auto seen = [&](std::uint32_t i, Random& random, const ReflectedLight& light, Rgbd behind) {
        return panes.empty() ? behind : through_panes(panes, directions[i], patch, heavy, random, light, looked, 0, behind);
    };
    const bool has_panes = scene_.has_panes();
    for (std::uint32_t i = 0, q = 0; i < rays; ++i) {
        if (has_panes)
            scene_.panes(origins[i], directions[i], found[i] ? found[i]->distance : 1e30,
                         {.start = std::sqrt(footprint.area() / rays), .end = std::sqrt(weights[i] / rays), .start_normal = normal}, panes);
        const KernelValues k = kernel.values(directions[i]);
        Rgbd radiance, emitted;
        Random random(mix(seed, i));
        if (!found[i]) {
            radiance = sky_;
            ++out.hits.escaped;
        } else if (found[i]->back) {
            ++out.hits.back;
        } else {
            radiance = reflected_at(*found[i], texels[i], directions[i], random, reflected_, looked, 0);
            const std::uint32_t emitter = emitters_.of_face[found[i]->face.at()];
            if (emitter != UINT32_MAX && !listed(patch, emitter) && !std::ranges::binary_search(heavy, emitter))
                emitted = emitters_.emitters[emitter].radiance;
            radiance += emitted;
        }
        radiance = seen(i, random, reflected_, radiance);
        for (Other& o : others) {
            Random same(mix(seed, i));
            Rgbd there = found[i] ? Rgbd{} : sky_;
            if (found[i] && !found[i]->back) there = reflected_at(*found[i], texels[i], directions[i], same, *o.light, looked, 0) + emitted;
            kernel.add(o.sum, k, seen(i, same, *o.light, there) * (weights[i] / rays));
        }
        const double w = weights[i], square = w * k[0] * w * k[0];
        while (std::uint64_t{q + 1} * rays <= std::uint64_t{4} * i) ++q;
        Quarter& in = in_quarter[q];
        for (std::size_t c = 0; c < 3; ++c) in.light[c].add(k, radiance[c] * w);
        in.unit.add(k, w);
        unit_square += square;
        cross_sum += radiance * square;
        own_square += mean(radiance) * w * k[0] * mean(radiance) * w * k[0];
    }
    const double n = rays;
    std::array<double, 4> unit{};
    std::array<KernelSum, 4> quarter{};
    std::array<std::array<double, 4>, 4> unit_quarter{};
    for (std::size_t q = 0; q < 4; ++q) {
        for (std::size_t c = 0; c < 3; ++c) {
            quarter[q].flat[c] = in_quarter[q].light[c][0];
            for (std::size_t j = 0; kernel.cone && j < 3; ++j) quarter[q].rnm[j][c] = in_quarter[q].light[c][j + 1];
        }
        out.sum += quarter[q], quarter[q] *= 4 / n;
        for (std::size_t j = 0; j < 4; ++j) unit[j] += in_quarter[q].unit[j] / n, unit_quarter[q][j] = in_quarter[q].unit[j] * (4 / n);
    }
    out.sum *= 1 / n;
    // Control variate: E = mean(L w) - beta (mean(w) - pi), beta by regression, as far as the two go together: where all radiance is alike the result is exact,
    // below a correlation that tells three quarters of the spread nothing is taken off. The slope of a few rays is noise too, the same in all quarters: none tells of it.
    const double spread = unit_square / n - unit[0] * unit[0], lean = dot(kernel.frame.n, normal);
    const double covariance = mean(cross_sum) / n - mean(out.sum.flat) * unit[0], own = own_square / n - mean(out.sum.flat) * mean(out.sum.flat);
    const double determination = own * spread > 0 ? std::min(1.0, covariance * covariance / (own * spread)) : 1;
    if (spread > 1e-9 && lean > 0 && determination > kLeastDetermination) {
        const Rgbd beta = (cross_sum / n - out.sum.flat * unit[0]) * ((determination - kLeastDetermination) / (determination * (1 - kLeastDetermination)) / spread);
        const std::array<double, 4> exact = kernel.integrals();
        // Of the shading normal's hemisphere the face hides a part; that of directional kernels then has no closed form: they take their share of the
        // flat one's.
        const bool level = lean > 1 - 1e-9 && !footprint.bent();
        const double flat = level ? exact[0] : chart.curved() ? kPi : kPi * (1 + lean) / 2;
        const auto correct = [&](KernelSum& sum, const std::array<double, 4>& of) {
            sum.flat -= beta * (of[0] - flat);
            if (!kernel.cone) return;
            for (std::size_t j = 0; j < 3; ++j) sum.rnm[j] -= beta * (level ? of[j + 1] - exact[j + 1] : (of[0] - flat) * exact[j + 1] / exact[0]);
        };
        correct(out.sum, unit);
        for (Other& o : others) correct(o.sum, unit);
        for (std::size_t q = 0; q < 4; ++q) correct(quarter[q], unit_quarter[q]);
        for (std::size_t c = 0; c < 3; ++c) out.sum.flat[c] = std::max(0.0, out.sum.flat[c]);
    }
    std::array<double, 4> m{}, square{};
    for (const KernelSum& q : quarter) {
        const std::array<Rgbd, 4> shown = kernel.shown(q);
        for (std::size_t j = 0; j < kernel.shown_count(); ++j) {
            const double v = mean(shown[j]);
            m[j] += v / 4, square[j] += v * v / 4;
        }
    }
    for (std::size_t j = 0; j < kernel.shown_count(); ++j) out.variance[j] = std::max(0.0, square[j] - m[j] * m[j]) / 3;
    return out;
}

// Standard deviation of a single sample of each patch, from its variance as samples showed it. Noise comes in rare large strokes, so a patch is no quieter
// than its neighbours on the average.
std::vector<double> Bake::single_noise(const std::vector<double>& variance) const {
    std::vector<double> out(variance.size());
    for (std::uint32_t p = 0; p < variance.size(); ++p) {
        double around = variance[p];
        for (const std::uint32_t q : neighbours_[p]) around += variance[q];
        out[p] = std::sqrt(std::max(variance[p], around / static_cast<double>(1 + neighbours_[p].size())));
    }
    return out;
}

// Samples per patch such that the rRMSE of noise is `wanted` at the least cost, given the noise of a single one. With noise falling as N^-0.65, N goes
// with the 0.87th power of the noise of a single one (Lagrange). Empty: there is no noise.
std::vector<double> Bake::least_cost(std::vector<double> single, double wanted) const {
    const double power = 2 / (1 + 2 * kNoiseRate);
    double area = 0, sum = 0;
    for (std::uint32_t p = 0; p < single.size(); ++p) {
        const double a = luxel_area_[p];
        area += a, sum += a * std::pow(single[p], 2 - 2 * kNoiseRate * power);
    }
    if (!(area > 0) || !(sum > 0)) return {};
    // sum a s^2 (c s^power)^(-2 rate) = area wanted^2
    const double c = std::pow(sum / (area * wanted * wanted), 1 / (2 * kNoiseRate));
    for (double& s : single) s = c * std::pow(s, power);
    return single;
}

// What neighbours leave of a single ray's noise, per patch.
std::vector<double> Bake::ray_noise() const {
    std::vector<double> left = noise_;
    for (std::size_t p = 0; p < left.size(); ++p) {
        double sum = 0;
        const std::span<const std::uint32_t> luxels = luxels_of(p);
        for (const std::uint32_t l : luxels) sum += static_cast<double>(left_[l]);
        if (sum > 0) left[p] *= sum / static_cast<double>(luxels.size());
    }
    return single_noise(left);
}

// rRMSE of the noise with the rays that patches have, by the same account as share_rays goes by.
double Bake::expected_noise() const {
    const std::vector<double> single = ray_noise();
    double area = 0, sum = 0;
    for (std::uint32_t p = 0; p < single.size(); ++p) {
        const double a = luxel_area_[p], noise = single[p] * std::pow(rays_[p], -kNoiseRate);
        area += a, sum += a * noise * noise;
    }
    return area > 0 ? std::sqrt(sum / area) : 0;
}

// Never fewer than before.
void Bake::share_rays(double wanted) {
    const std::vector<double> n = least_cost(ray_noise(), wanted);
    for (std::size_t p = 0; p < n.size(); ++p)
        while (rays_[p] < quality_.most_rays && rays_[p] * 1.41 < n[p]) rays_[p] *= 2;
}

// All luxels of the patches. Emitters met by surprise are returned, per patch, and left out of the result, which
// then is to be done again for those patches; not in the last pass. Passes with more rays use others than those
// before: what decided that a place is noisy must not be part of its value.
std::vector<Bake::Found> Bake::gather_patches(std::span<const std::uint32_t> patches, Pass pass) {
    constexpr std::size_t kChunk = 16; // patches: their luxels share a guide
    std::vector<HitCounts> counts(slots_of(patches.size(), kChunk));
    std::vector<std::vector<Found>> found(slots_of(patches.size(), kChunk));
    if (memo_) note_states();
    for (const std::uint32_t p : patches) new_[p] = 1;
    parallel_chunks(context_, "light: gather", patches.size(), kChunk, [&](std::size_t begin, std::size_t end) {
        thread_local Looked looked;
        thread_local PatchGather gathered;
        for (const std::uint32_t p : patches.subspan(begin, end - begin)) {
            const std::span<const std::uint32_t> luxels = luxels_of(p);
            if (covered_[p] || luxels.empty()) continue;
            const std::uint64_t stream = pass == Pass::first ? 4 : 16 + rays_[p] + (own_round_ << 32);
            const std::uint64_t key = memo_ ? key_of(p, mix(gather_key(p), stream, static_cast<std::uint64_t>(pass == Pass::last))) : 0;
            gathered.luxels.clear(), gathered.met.clear();
            if (const auto kept = memo_ ? memo_->gather.find(key, states_) : std::nullopt) {
                read_whole(*kept, gathered);
            } else {
                Guide guide;
                patch_guide(p, &guide);
                looked.begin(part_count());
                for (const std::uint32_t l : luxels) {
                    const Luxel& luxel = surfaces_.luxels[l];
                    gathered.luxels.emplace_back(gather(l, kernel_of(l), guide, map_of(luxel.chart), rays_[p], seed_at(luxel_centroid(luxel), stream),
                                                     pass == Pass::last ? nullptr : &gathered.met, {}, memo_ ? &looked : nullptr));
                }
                gathered.met = each_once(std::move(gathered.met));
                if (memo_) memo_->gather.keep(key, states_, looked.parts(), to_bytes(gathered));
            }
            double variance = 0;
            if (memo_) gathered_hash_[p] = hash_bytes(raw_bytes(gathered.luxels)).low;
            for (std::size_t k = 0; k < luxels.size(); ++k) {
                const std::uint32_t l = luxels[k];
                const StoredGather& g = gathered.luxels[k];
                // Inside something that the exact geometry does not know to be solid (a brush model in a wall):
                // filled from the neighbours.
                gathered_there_[l] = g.rays > 0 && 2 * (g.back + (sealed_ ? g.escaped : 0)) <= g.rays;
                if (!gathered_there_[l]) continue;
                counts[begin / kChunk] += HitCounts{g.rays, g.escaped, g.back};
                gathered_[l] = g.sum;
                KernelSum sum = direct_[l];
                sum += g.sum.sum();
                // The worst of the normals that the light is shown along.
                const LuxelKernel kernel = kernel_of(l);
                const std::array<Rgbd, 4> shown = kernel.shown(sum);
                double relative = 0;
                for (std::size_t j = 0; j < kernel.shown_count(); ++j) {
                    const double scale = std::max(mean(shown[j]), floor_);
                    if (scale > 0) relative = std::max(relative, static_cast<double>(g.variance[j]) / (scale * scale));
                    gathered_variance_[l][j] = static_cast<double>(g.variance[j]) / (kQuarterSpread * kQuarterSpread);
                }
                variance += relative / static_cast<double>(luxels.size());
            }
            variance *= std::pow(rays_[p], 2 * kNoiseRate) / (kQuarterSpread * kQuarterSpread);
            noise_[p] = (noise_[p] * noise_weight_[p] + variance * rays_[p]) / (noise_weight_[p] + rays_[p]);
            noise_weight_[p] += rays_[p];
            if (!gathered.met.empty()) found[begin / kChunk].push_back({p, gathered.met});
        }
    });
    for (const HitCounts& c : counts) counts_ += c;
    return joined(found);
}

} // namespace kiln

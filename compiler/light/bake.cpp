// The order of the steps, the tables they share, and what is handed on.
#include "compiler/light/bake.h"
#include "compiler/light/seams.h"
#include "libs/core/check.h"
#include "libs/parallel/parallel.h"
#include <numbers>
#include <numeric>

namespace kiln {

constexpr int kPatchRefinements = 3;
constexpr double kPatchShare = 0.6;                        // of the target, for patches; the noise has as much
constexpr double kDirectShare = 0.35;                      // for the noise of direct light
constexpr double kSolutionShare = 0.4;                     // for what the solution has of the noise of rows
constexpr std::uint32_t kMostRowRays = 4096;
static_assert(kMostRowRays / kQuarters <= UINT16_MAX); // Quarters::rays
constexpr double kSteep = 5;                               // targets by which direct light of luxels side by side may differ
constexpr double kReadStep = 0.5;                          // of the target: to what share of itself light is rounded where rays read it
constexpr double kFarPatches = 3;                          // sizes of a patch from which on light close by is not followed further
constexpr std::size_t kChunk = 1024;                       // patches or luxels, of a few instructions each
constexpr std::size_t kMostRowHits = std::size_t{1} << 28; // 1 GB

double read_step_of(double error_percent) {
    return std::exp2(std::floor(std::log2(kReadStep * error_percent / 100)));
}

Quality Quality::of(const LightOptions& options) {
    Quality q;
    const double e = std::clamp(options.error_percent, 0.1, 50.0);
    q.patch_size = 63 * std::sqrt(e / 5);
    q.promotion = 0.001 * e;
    q.light_cutoff = 0.001 * e;
    q.direct_samples = e <= 1.5 ? 32 : e <= 2.5 ? 16 : e <= 6 ? 8 : e <= 12 ? 4 : 2;
    q.row_rays = e <= 1 ? 1024 : e <= 2.5 ? 512 : e < 4 ? 256 : 128; // they are the guides of the gather as well
    q.read_step = read_step_of(options.error_percent);
    q.iteration = std::min(1e-3, e * 1e-4) * std::clamp(options.error_floor / LightOptions{}.error_floor, 1e-9, 1.0); // of the mean light, for what is as dark as the floor
    q.first_rays = e >= 15 ? 8 : e >= 4 ? 16 : 32;
    return q;
}

Rgbd sky_radiance(const std::vector<Light>& lights) {
    Rgbd sky;
    for (const Light& l : lights)
        if (l.kind == LightKind::sky) sky += static_cast<Rgbd>(l.intensity);
    return sky;
}

Frame shading_frame(const Frame& chart, Vec3 normal) {
    Frame f;
    f.n = normal;
    const Vec3 t = chart.t - normal * dot(chart.t, normal);
    const double l = length(t);
    f.t = l > 1e-6 ? t / l : frame_around(normal).t;
    f.b = cross(normal, f.t) * (dot(cross(chart.n, chart.t), chart.b) < 0 ? -1.0 : 1.0);
    return f;
}

Vec3 shading_normal(const Surfaces& s, FaceId id, Vec3 point) {
    const Face& face = s.faces[id.at()];
    double best = -1e30;
    Vec3 normal = face.normal;
    for (std::uint32_t t = face.first_triangle; t < face.first_triangle + face.triangle_count; ++t) {
        const auto& v = s.triangles[t];
        const Vec3 a = s.positions[v[0]], b = s.positions[v[1]], c = s.positions[v[2]];
        const double all = dot(cross(b - a, c - a), face.normal);
        if (!(all > 0)) continue;
        std::array<double, 3> w{dot(cross(b - point, c - point), face.normal) / all,
                                dot(cross(c - point, a - point), face.normal) / all, 0};
        w[2] = 1 - w[0] - w[1];
        const double inside = std::min({w[0], w[1], w[2]});
        if (inside <= best) continue;
        best = inside;
        Vec3 n;
        for (std::size_t i = 0; i < 3; ++i)
            n += static_cast<Vec3>(s.corner_normals[t][i]) * std::clamp(w[i], 0.0, 1.0);
        normal = length(n) > 1e-6 ? normalize(n) : face.normal;
        if (inside >= 0) break;
    }
    return normal;
}

Frame light_frame(const Chart& chart, const Face& face, Vec3 normal) {
    return chart.smooth ? shading_frame(chart.curved() ? face.tangent : chart.frame, normal) : chart.frame;
}

Frame light_frame(const Surfaces& s, FaceId id, Vec3 point) {
    const Face& face = s.faces[id.at()];
    const Chart& chart = s.charts[face.chart.at()];
    return light_frame(chart, face, chart.smooth ? shading_normal(s, id, point) : chart.n);
}

Rgbd reflected_radiance(const LuxelIndex& index, const PatchTable& patches,
                        const ReflectedLight& light, const SceneHit& hit, std::uint32_t texel, Looked* looked) {
    std::uint32_t patch;
    if (texel != UINT32_MAX) {
        if (patches.texel_patch[texel] < kMixedPatch) {
            if (looked) looked->at(patches.texel_patch[texel]);
            return static_cast<Rgbd>(light.texel[texel]);
        }
        const std::uint32_t piece = index.piece_at(hit.face, hit.position);
        patch = piece == UINT32_MAX ? kNoPatch : patches.piece_patch[piece];
    } else {
        patch = patches.face_patch[hit.face.at()];
    }
    if (patch == kNoPatch) return {};
    if (looked) looked->at(patch);
    return static_cast<Rgbd>(light.patch[patch]);
}

// A filled world lets nothing out; one compiled with its leaks does.
Bake::Bake(const World& world, const Bsp& bsp, const Surfaces& surfaces, const std::vector<Light>& lights,
           const LightOptions& options, LightMemo* memo, const Visibility* seen, Context& context)
    : world_(world), surfaces_(surfaces), lights_(lights), options_(options), sealed_(std::ranges::any_of(bsp.leaves, &BspLeaf::outside)), memo_(memo), context_(context),
      quality_(Quality::of(options)), corner_(least_corner(surfaces)), scene_(world, surfaces), index_(surfaces),
      sky_(sky_radiance(lights)), emitters_(world, surfaces, sky_), sight_(world, surfaces, bsp, seen, scene_, lights, emitters_) {}

std::uint64_t Bake::seed_at(Vec3 p, std::uint64_t pass) const {
    return mix_place(p - corner_, options_.seed, pass);
}

Vec3 Bake::luxel_centroid(const Luxel& l) const {
    return world_from_luxel(surfaces_, l.face, centroid_of(surfaces_, l));
}

Footprint Bake::footprint_of_patch(std::uint32_t p) const {
    Footprint f(kBakeMargin * scene_.push_off());
    const Patch& patch = patches_.patches[p];
    const Face& face = surfaces_.faces[patch.face.at()];
    if (!face.chart.valid()) {
        for (std::uint32_t t = 0; t < face.triangle_count; ++t) {
            const auto& v = surfaces_.triangles[face.first_triangle + t];
            f.add_triangle(surfaces_.positions[v[0]], surfaces_.positions[v[1]], surfaces_.positions[v[2]], face.normal);
        }
        return f;
    }
    for (std::uint32_t k = patches_.first_piece[p]; k < patches_.first_piece[p + 1]; ++k)
        f.add_piece(surfaces_, surfaces_.pieces[patches_.pieces[k]]);
    return f;
}

// Of a luxel cut in two by a wall, only the larger side.
Footprint Bake::footprint_of_luxel(std::uint32_t l) const {
    Footprint f(kBakeMargin * scene_.push_off());
    const Luxel& luxel = surfaces_.luxels[l];
    for (std::uint32_t k = 0; k < luxel.piece_count; ++k)
        if (patches_.piece_patch[luxel.first_piece + k] == luxel_patch_[l])
            f.add_piece(surfaces_, surfaces_.pieces[luxel.first_piece + k]);
    return f;
}

LuxelKernel Bake::kernel_of(std::uint32_t l) const {
    const Luxel& luxel = surfaces_.luxels[l];
    LuxelKernel k;
    k.encoding = options_.encoding;
    k.cone = cones_[luxel.chart.at()].get();
    const Chart& chart = surfaces_.charts[luxel.chart.at()];
    k.frame = chart.smooth ? light_frame(surfaces_, luxel.face, luxel_centroid(luxel)) : chart.frame;
    return k;
}

HemisphereMap Bake::map_of(ChartId chart) const {
    return {cones_[chart.at()] || surfaces_.charts[chart.at()].smooth ? 0.6 : 1.0};
}

// Reflected radiance at hits, rounded: direct light of the very luxel, the rest by patch. `same_direct`: made from the same direct light.
ReflectedLight Bake::reflected_light(const std::vector<Rgbd>& rest_of_luxel, const std::vector<Rgbd>& total, const ReflectedLight* same_direct) const {
    ReflectedLight out;
    constexpr double inv_pi = 1 / std::numbers::pi;
    out.patch.resize(patches_.patches.size());
    parallel_chunks(context_, out.patch.size(), kChunk, [&](std::size_t begin, std::size_t end) {
        for (std::size_t p = begin; p < end; ++p)
            out.patch[p] = static_cast<Rgb>(static_cast<Rgbd>(patches_.patches[p].reflectance) * rounded(total[p], patch_rounding_[p]) * inv_pi);
    });
    out.texel.resize(surfaces_.texel_count);
    if (same_direct) out.direct = same_direct->direct;
    else out.direct.resize(surfaces_.texel_count);
    std::vector<std::uint8_t> lit(surfaces_.texel_count);
    parallel_chunks(context_, surfaces_.luxels.size(), kChunk, [&](std::size_t begin, std::size_t end) {
        for (std::size_t l = begin; l < end; ++l) {
            const Luxel& luxel = surfaces_.luxels[l];
            const std::uint32_t p = luxel_patch_[l];
            if (p == kNoPatch) continue;
            const std::size_t texel = texel_of(surfaces_, luxel);
            const Rgbd rho = static_cast<Rgbd>(patches_.patches[p].reflectance) * inv_pi;
            if (!same_direct) out.direct[texel] = static_cast<Rgb>(rho * rounded(direct_[l].flat, luxel_rounding_[l]));
            out.texel[texel] = static_cast<Rgb>(rho * rounded(direct_[l].flat + rest_of_luxel[l], luxel_rounding_[l]));
            lit[texel] = 1;
        }
    });
    // In a corner a luxel gets up to half of its light from the next one on the other wall, most of it from that one's rim.
    const double steep = kSteep * options_.error_percent / 100;
    out.steep.resize(surfaces_.texel_count);
    parallel_chunks(context_, surfaces_.charts.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (const Chart& c : std::span(surfaces_.charts).subspan(begin, end - begin))
            for (std::uint32_t y = 0; y < c.height; ++y)
                for (std::uint32_t x = 0; x < c.width; ++x) {
                    const std::size_t a = c.texel(x, y);
                    const auto compare = [&](std::size_t b) {
                        if (!lit[a] || !lit[b]) return;
                        const double change = std::abs(mean(out.direct[a]) - mean(out.direct[b]));
                        if (change > steep * mean(out.texel[a])) out.steep[a] = 1;
                        if (change > steep * mean(out.texel[b])) out.steep[b] = 1;
                    };
                    if (x + 1 < c.width) compare(a + 1);
                    if (y + 1 < c.height) compare(a + c.width);
                }
    });
    return out;
}

// What luxels have gathered knows more of how light lies within a patch than the solution does: in a narrow shaft it falls off by half from one luxel to the next. Where the
// two differ by more than noise makes them, rays read what the luxels have from now on, drawn towards it as far as the difference is not noise (as in smooth.cpp). `stale`: of each patch, by
// what share of its light it has changed since it was gathered.
std::vector<std::uint32_t> Bake::own_light(std::vector<double>& stale) {
    constexpr double kCertain = 2;  // standard deviations of the square of a difference that is but noise, were that normal and each luxel's its own
    constexpr double kMatters = 0.25; // targets by which the light of a patch changes by it from which on it is gathered again
    constexpr double kGolden = 0.618, inv_pi = 1 / std::numbers::pi;
    const double target = options_.error_percent / 100;
    const std::size_t n = patches_.patches.size();
    std::vector<double> moved(n); // per patch: radiance, mean over its luxels
    parallel_chunks(context_, n, 64, [&](std::size_t begin, std::size_t end) {
        std::vector<Rgbd> own, told;
        for (auto p = static_cast<std::uint32_t>(begin); p < end; ++p) {
            const Rgbd rho = static_cast<Rgbd>(patches_.patches[p].reflectance) * inv_pi;
            if (!(mean(rho) > 0) || !stirred_[p]) continue; // the others have been drawn as far as they go
            const std::span<const std::uint32_t> luxels = luxels_of(p);
            own.assign(luxels.size(), {}), told.assign(luxels.size(), {});
            double apart = 0, noise = 0, level = 0, count = 0;
            for (std::size_t k = 0; k < luxels.size(); ++k) {
                const std::uint32_t l = luxels[k];
                if (!gathered_there_[l]) continue;
                told[k] = static_cast<Rgbd>(reflected_.texel[texel_of(surfaces_, surfaces_.luxels[l])]);
                own[k] = rho * (direct_[l].flat + static_cast<Rgbd>(smoothed_[l].flat));
                const double by = mean(own[k]) - mean(told[k]);
                apart += by * by, noise += mean(rho) * mean(rho) * gathered_variance_[l][0] * static_cast<double>(left_[l]), level += mean(told[k]), ++count;
            }
            if (!(count > 0)) continue;
            apart /= count, noise /= count, level /= count;
            const double by_noise = noise * (1 + kCertain * std::sqrt(2 / count)) + target * target * level * level;
            if (!(apart > by_noise)) continue;
            const double share = 1 - by_noise / apart;
            for (std::size_t k = 0; k < luxels.size(); ++k) {
                const std::uint32_t l = luxels[k];
                if (!gathered_there_[l]) continue;
                const Rgbd read = told[k] + (own[k] - told[k]) * share;
                moved[p] += std::abs(mean(read) - mean(told[k])) / count;
                Rgbd light;
                for (std::size_t c = 0; c < 3; ++c) light[c] = rho[c] > 0 ? read[c] / rho[c] : 0;
                const std::size_t texel = texel_of(surfaces_, surfaces_.luxels[l]);
                // Up or down otherwise than what was told: rounded twice alike it would be drawn back.
                const Rgbd now = rho * rounded(light, std::fmod(luxel_rounding_[l] + kGolden * static_cast<double>(own_round_), 1.0));
                reflected_.texel[texel] = static_cast<Rgb>(now);
                // What patches of twice the size would change is asked of the patches: of what luxels have put right there it would be made of both. (It may fall below 0: a difference.)
                coarse_luxels_.texel[texel] = static_cast<Rgb>(static_cast<Rgbd>(coarse_luxels_.texel[texel]) + now - told[k]);
            }
            if (memo_) note_reflected(p);
        }
    });
    std::vector<std::uint32_t> out;
    std::vector<std::uint64_t> has_moved(n / 64 + 1); // bits: less to read than how far
    for (std::size_t p = 0; p < n; ++p) has_moved[p / 64] |= std::uint64_t{moved[p] > 0} << (p % 64);
    if (std::ranges::none_of(has_moved, [](std::uint64_t bits) { return bits; })) return out;
    parallel_chunks(context_, n, kChunk, [&](std::size_t begin, std::size_t end) {
        for (auto p = static_cast<std::uint32_t>(begin); p < end; ++p) {
            const double level = std::max(mean(rest_[p] + solved_direct_[p]), floor_);
            if (covered_[p] || luxels_of(p).empty() || !(level > 0)) continue;
            for_row(rows_, p, [&](std::uint32_t patch, auto factor) {
                if (has_moved[patch / 64] >> (patch % 64) & 1) stale[p] += moved[patch] * mean(Rgbd{1, 1, 1} * factor) * std::numbers::pi / level;
            });
        }
    });
    for (std::uint32_t p = 0; p < n; ++p)
        if (stale[p] > kMatters * target) out.push_back(p), stale[p] = 0;
    return out;
}

// Of a table of patches of that size, its rows, and which patches each of them is made of.
void Bake::far_light(const Rows& rows, const PatchTable& table, const Grouped& parts, Hash name, double size, ReflectedLight* light) const {
    const std::size_t n = patches_.patches.size(), m = parts.size();
    light->place.resize(n), light->reach.assign(n, 0), light->far_from.resize(n), light->far.resize(n);
    parallel_chunks(context_, m, kChunk, [&](std::size_t begin, std::size_t end) {
        for (std::size_t c = begin; c < end; ++c) {
            const Vec3 place = table.patches[c].centroid;
            for (const std::uint32_t p : parts[c]) {
                light->place[p] = place;
                const Face& face = surfaces_.faces[patches_.patches[p].face.at()];
                if (face.chart.valid()) { // patches are luxels at least
                    light->far_from[p] = kFarPatches * std::max(size, surfaces_.charts[face.chart.at()].luxel_size);
                    continue;
                }
                for (std::uint32_t t = face.first_triangle; t < face.first_triangle + face.triangle_count; ++t)
                    for (const std::uint32_t v : surfaces_.triangles[t]) light->reach[p] = std::max(light->reach[p], length(surfaces_.positions[v] - place));
                light->far_from[p] = kFarPatches * size + light->reach[p];
            }
        }
    });
    // Which of all that rows met are far off: of each, patches, then what its parts met that is none.
    std::vector<std::size_t> first(m + 1);
    for (std::size_t c = 0; c < m; ++c) {
        first[c + 1] = first[c] + (rows.first[c + 1] - rows.first[c]);
        for (const std::uint32_t p : parts[c]) first[c + 1] += lone_first_[p + 1] - lone_first_[p];
    }
    const auto far_off = known_or<std::vector<std::uint8_t>>(mix(name.low, KeyOf::far, std::bit_cast<std::uint64_t>(size)), [&] {
        std::vector<std::uint8_t> out(first[m]);
        parallel_chunks(context_, m, kChunk, [&](std::size_t begin, std::size_t end) {
            for (std::size_t c = begin; c < end; ++c) {
                std::size_t at = first[c];
                for (std::uint64_t k = rows.first[c]; k < rows.first[c + 1]; ++k) out[at++] = is_far(*light, parts[c][0], parts[rows.patch[k]][0]);
                for (const std::uint32_t p : parts[c]) for_lone(p, [&](std::uint32_t code, const Quarters&) { out[at++] = is_far(*light, p, code); });
            }
        });
        return out;
    });
    std::vector<double> areas(m); // where there is none, 1
    std::vector<Rgb> reflected(m);
    parallel_chunks(context_, m, kChunk, [&](std::size_t begin, std::size_t end) {
        for (std::size_t c = begin; c < end; ++c) {
            Rgbd sum;
            for (const std::uint32_t p : parts[c]) sum += static_cast<Rgbd>(light->patch[p]) * patches_.patches[p].area, areas[c] += patches_.patches[p].area;
            if (!(areas[c] > 0)) areas[c] = 1;
            reflected[c] = static_cast<Rgb>(sum / areas[c]);
        }
    });
    const bool of_patches = patches_shine();
    parallel_chunks(context_, m, kChunk, [&](std::size_t begin, std::size_t end) {
        for (std::size_t c = begin; c < end; ++c) {
            const double area = areas[c];
            double count = 0; // share of the row, all parts together
            Rgbd met;
            const auto shines = [&](std::uint32_t p, std::uint32_t code, double share) {
                if (const std::uint32_t e = emitter_of(code); e != UINT32_MAX && !listed(p, e)) met += emitters_.emitters[e].radiance * share;
            };
            std::size_t at = first[c];
            for (std::uint64_t k = rows.first[c]; k < rows.first[c + 1]; ++k) {
                if (!far_off[at++]) continue;
                const auto share = static_cast<double>(rows.weight[k]);
                count += share, met += static_cast<Rgbd>(reflected[rows.patch[k]]) * share;
                for (std::size_t i = 0; of_patches && i < parts[c].size(); ++i) shines(parts[c][i], parts[rows.patch[k]][0], share * patches_.patches[parts[c][i]].area / area);
            }
            for (const std::uint32_t p : parts[c])
                for_lone(p, [&](std::uint32_t code, const Quarters& rays) {
                    if (!far_off[at++]) return;
                    const double share = rays.all() * (1.0 / quality_.row_rays) * (patches_.patches[p].area / area);
                    count += share, shines(p, code, share);
                });
            const Rgb mean = static_cast<Rgb>(count > 0 ? rounded(met / count, Random(seed_at(table.patches[c].centroid, kRounding))()) : Rgbd{-1, -1, -1});
            for (const std::uint32_t p : parts[c]) light->far[p] = mean;
        }
    });
}

void Bake::make_larger() {
    const std::size_t n = patches_.patches.size();
    larger_ = {};
    larger_.table = patches_of(2 * quality_.patch_size);
    const std::size_t m = larger_.table.patches.size();
    larger_.neighbours = neighbours_of(touching(larger_.table, larger_table_), m);
    larger_.of.resize(n), larger_.area.resize(m);
    for (std::uint32_t p = 0; p < n; ++p) {
        const bool pieces = patches_.first_piece[p] < patches_.first_piece[p + 1];
        const std::uint32_t c = larger_.of[p] = pieces ? larger_.table.piece_patch[patches_.pieces[patches_.first_piece[p]]] : larger_.table.face_patch[patches_.patches[p].face.at()];
        larger_.area[c] += patches_.patches[p].area;
    }
    larger_.parts = Grouped(m, [&](const auto& add) {
        for (std::uint32_t p = 0; p < n; ++p) add(larger_.of[p], p);
    });
    larger_.luxels = Grouped(m, [&](const auto& add) {
        for (std::uint32_t l = 0; l < luxel_patch_.size(); ++l)
            if (luxel_patch_[l] != kNoPatch) add(larger_.of[luxel_patch_[l]], l);
    });
}

// The solution on patches of twice the size.
ReflectedLight Bake::coarse_light(const std::vector<Rgbd>& direct, const std::vector<Rgbd>& first) {
    const std::size_t n = patches_.patches.size(), m = larger_.parts.size();
    const std::vector<std::uint32_t>& parent = larger_.of;
    std::vector<Rgbd> coarse_direct(m), coarse_first(m), coarse_rho(m);
    for (std::uint32_t c = 0; c < m; ++c) {
        for (const std::uint32_t p : larger_.parts[c]) {
            const double a = patches_.patches[p].area;
            coarse_direct[c] += direct[p] * a, coarse_first[c] += first[p] * a;
            coarse_rho[c] += static_cast<Rgbd>(patches_.patches[p].reflectance) * a;
        }
        if (const double area = larger_.area[c]; area > 0) coarse_direct[c] = coarse_direct[c] / area, coarse_first[c] = coarse_first[c] / area, coarse_rho[c] = coarse_rho[c] / area;
    }
    std::uint32_t iterations = 0;
    double residual = 0;
    const std::vector<Rgbd> solved = solve(larger_.rows, coarse_first, coarse_rho, &iterations, &residual);
    std::vector<Rgbd> coarse_rest(m), rest(n), total(n);
    for (std::size_t c = 0; c < m; ++c) coarse_rest[c] = solved[c] - coarse_direct[c];
    for (std::size_t p = 0; p < n; ++p) rest[p] = coarse_rest[parent[p]], total[p] = coarse_direct[parent[p]] + rest[p];
    ReflectedLight out = reflected_light(values_at_luxels(surfaces_, larger_.neighbours, larger_.luxels, coarse_rest, context_), total, &reflected_);
    far_light(larger_.rows, larger_.table, larger_.parts, larger_table_, 2 * quality_.patch_size, &out);
    return out;
}

// Patches of quality_.patch_size, their form factors, and the lights of each.
void Bake::make_patches() {
    const std::size_t luxels = surfaces_.luxels.size();
    patches_ = patches_of(quality_.patch_size);
    quality_.row_rays = least_row_rays_;
    const auto rays_per_patch = [&] { return quality_.first_rays * static_cast<double>(luxels) / static_cast<double>(std::max<std::size_t>(patches_.patches.size(), 1)); };
    // Many luxels a patch: smaller ones cost as little beside the gather, and their bias falls with the square of their size.
    while (rays_per_patch() >= 4.0 * quality_.row_rays) {
        PatchTable finer = patches_of(quality_.patch_size / 2);
        if (finer.patches.size() <= patches_.patches.size()) break;
        quality_.patch_size /= 2, patches_ = std::move(finer);
    }
    const std::size_t n = patches_.patches.size();
    // Few patches: all the more rays each, for the same share of the work.
    const double per_patch = rays_per_patch();
    while (quality_.row_rays < 2048 && quality_.row_rays * 2 <= per_patch) quality_.row_rays *= 2;
    patch_emitter_.clear();
    for (const Patch& p : patches_.patches) patch_emitter_.push_back(emitters_.of_face[p.face.at()]);
    luxel_patch_ = patches_of_luxels(surfaces_, patches_.piece_patch);
    patch_luxels_ = Grouped(n, [&](const auto& add) {
        for (std::uint32_t l = 0; l < luxels; ++l)
            if (luxel_patch_[l] != kNoPatch) add(luxel_patch_[l], l);
    });
    luxel_area_.assign(n, 0), patch_rounding_.resize(n);
    parallel_chunks(context_, n, kChunk, [&](std::size_t begin, std::size_t end) {
        for (std::size_t p = begin; p < end; ++p) {
            patch_rounding_[p] = Random(seed_at(patches_.patches[p].centroid, kRounding))();
            for (const std::uint32_t l : luxels_of(p)) luxel_area_[p] += surfaces_.luxels[l].area * luxel_area(surfaces_, surfaces_.luxels[l].face);
        }
    });

    if (memo_) name_table();
    touching_ = touching(patches_, table_);
    neighbours_ = neighbours_of(touching_, n);
    make_larger();
    make_rows();
    std::vector<Rgbd> rho;
    for (const Patch& p : patches_.patches) rho.push_back(static_cast<Rgbd>(p.reflectance));
    // First everything gathered, to know what is bright and what is dark; then the lights that deserve their own
    // rays.
    choose_lights(solve_gathered(rho));
    plant_spot_trees();
    effort_.assign(n, 1), direct_draws_.assign(n, 0);
    luxel_direct_all();
    rays_.assign(n, quality_.first_rays);
}

Rgbd rounded_as_read(Rgbd light, double step_share, double floor, double up) {
    for (std::size_t c = 0; c < 3; ++c) { // each by itself, as errors are measured
        const double scale = std::max(light[c], floor);
        if (!(scale > 0)) continue;
        const double power = std::bit_cast<double>(std::bit_cast<std::uint64_t>(scale) & 0x7FF0000000000000u); // of two, the greatest in it
        const double step = power * step_share;
        if (!(step > 0)) continue; // next to nothing
        light[c] = std::floor(light[c] / step + up) * step;
    }
    return light;
}

// All bounces from the direct light of the luxels: total irradiance of the patches.
std::vector<Rgbd> Bake::solve_patches() {
    const std::size_t n = patches_.patches.size();
    std::vector<Rgbd> rho;
    for (const Patch& p : patches_.patches) rho.push_back(static_cast<Rgbd>(p.reflectance));
    const std::vector<Rgbd> direct = patch_direct();
    std::vector<Rgbd> first = gathered_emission(true);
    for (std::size_t p = 0; p < n; ++p) first[p] += direct[p];
    std::vector<Rgbd> total = solve(rows_, first, rho, &out_.iterations, &residual_);
    solved_direct_ = direct;
    double area = 0, sum = 0;
    for (std::size_t p = 0; p < n; ++p)
        area += patches_.patches[p].area, sum += patches_.patches[p].area * mean(total[p]);
    floor_ = area > 0 ? error_floor(options_.error_floor, sum / area) : 0;
    rest_.resize(n);
    for (std::size_t p = 0; p < n; ++p) rest_[p] = total[p] - direct[p];
    reflected_ = reflected_light(values_at_luxels(surfaces_, neighbours_, patch_luxels_, rest_, context_), total);
    const Grouped alone(n, [&](const auto& add) {
        for (std::uint32_t p = 0; p < n; ++p) add(p, p);
    });
    far_light(rows_, patches_, alone, table_, quality_.patch_size, &reflected_);
    bright_.clear();
    for (const Rgb& patch : reflected_.patch) bright_.push_back(mean(static_cast<Rgbd>(patch)));
    find_spots();
    coarse_ = coarse_light(direct, first);
    coarse_luxels_ = coarse_luxels();
    if (memo_) note_solution();
    return total;
}

Lighting Bake::run() {
    const std::size_t luxels = surfaces_.luxels.size();
    out_.encoding = options_.encoding;
    // Which charts get directional light, and the table of their cone.
    cones_ = cone_tables(world_, surfaces_, options_.directional, options_.encoding);
    out_.chart_directional.resize(surfaces_.charts.size());
    out_.rnm_first.assign(surfaces_.charts.size(), UINT32_MAX);
    std::size_t rnm = 0;
    for (std::size_t c = 0; c < surfaces_.charts.size(); ++c) {
        if (!cones_[c]) continue;
        out_.chart_directional[c] = 1;
        out_.rnm_first[c] = static_cast<std::uint32_t>(rnm);
        rnm += static_cast<std::size_t>(surfaces_.charts[c].width) * surfaces_.charts[c].height;
    }
    out_.flat.resize(surfaces_.texel_count);
    out_.valid.resize(surfaces_.texel_count);
    out_.texel_error.resize(surfaces_.texel_count);
    out_.rnm.resize(rnm);

    if (memo_) open_memo();
    luxel_draw_ = luxel_seeds(kDraw);
    for (const std::uint64_t seed : luxel_seeds(kRounding)) luxel_rounding_.push_back(Random(seed)());
    make_patches();
    std::vector<Rgbd> total = solve_patches();
    const double target = options_.error_percent / 100;
    const std::uint32_t one_in = pilot_share();
    // Patches as small as the target asks for: where a few luxels say that they matter more than they may, half as large.
    PilotResult first = pilot(4 * one_in, true);
    for (int k = 0; k < kPatchRefinements && first.bias > kPatchShare * target; ++k) {
        const std::size_t before = patches_.patches.size();
        if (4 * before * quality_.row_rays > kMostRowHits) break;
        quality_.patch_size /= 2;
        make_patches();
        total = solve_patches();
        first = pilot(4 * one_in, true);
        if (patches_.patches.size() <= before) break; // they are luxels already
    }
    // Rows as long as it asks for: down a bright corridor each bounce adds its noise to that of all before.
    double solution = solution_noise();
    while (solution > kSolutionShare * target && least_row_rays_ < kMostRowRays) {
        std::uint32_t longer = quality_.row_rays; // noise falls with their square root
        while (longer < kMostRowRays && 2 * longer * patches_.patches.size() <= kMostRowHits && longer * std::pow(kSolutionShare * target / solution, 2) < quality_.row_rays) longer *= 2;
        if (longer == quality_.row_rays) break;
        least_row_rays_ = longer;
        make_patches();
        total = solve_patches();
        solution = solution_noise();
    }
    // And direct light as exact as it asks for, where it is not.
    if (first.direct > kDirectShare * target) {
        luxel_direct(share_direct(first.direct, kDirectShare * target));
        total = solve_patches();
        solution = solution_noise();
    }
    const std::size_t n = patches_.patches.size();
    std::vector<std::uint32_t> all(n);
    std::iota(all.begin(), all.end(), 0u);

    // A first pass shows where the noise is; the noise share of the target says how many rays it is worth. What the
    // bundles met by surprise (a lamp seen through a slit) gets its own rays, there and next to it.
    noise_.assign(n, 0), noise_weight_.assign(n, 0);
    new_.assign(n, 0), gathered_hash_.assign(n, 0);
    gathered_.assign(luxels, {}), gathered_variance_.assign(luxels, {}), gathered_there_.assign(luxels, 0);
    const auto until_all_is_met = [&](std::vector<std::uint32_t> patches) {
        constexpr int kRounds = 4; // more rays meet more lamps; what the last round meets stays with its rays
        for (int round = 1; round <= kRounds && !patches.empty(); ++round) {
            patches = add_emitters(gather_patches(patches, round < kRounds ? Pass::again : Pass::last));
            luxel_direct(patches);
        }
    };
    beside_ = known_or<std::vector<std::uint8_t>>(mix(table_.low, KeyOf::beside), [&] { return luxels_beside(surfaces_, edges(), patches_.piece_patch, luxel_patch_); });
    const std::vector<std::uint32_t> met = add_emitters(gather_patches(all, Pass::first));
    luxel_direct(met);
    until_all_is_met(met);
    smooth();
    // Then luxels know better than patches what they reflect; each round makes that right over a bounce more.
    constexpr std::uint64_t kOwnRounds = 3;
    std::vector<double> stale(n);
    for (own_round_ = 1; own_round_ <= kOwnRounds; ++own_round_) {
        const std::vector<std::uint32_t> changed = own_light(stale);
        if (changed.empty()) break;
        until_all_is_met(changed);
        smooth();
    }
    own_round_ = 0;
    double wanted = 0.6 * target;
    const auto gather = [&] {
        const std::vector<std::uint32_t> before = rays_;
        share_rays(wanted);
        std::vector<std::uint32_t> more;
        for (std::uint32_t p = 0; p < n; ++p)
            if (rays_[p] > before[p]) more.push_back(p);
        until_all_is_met(std::move(more));
        smooth();
        return pilot(one_in);
    };
    PilotResult check = gather();
    // The estimate has the last word: noise comes in rare large strokes, which a first pass may miss. Mostly it agrees after one or none.
    constexpr int kTopUps = 8;
    const auto other = [&] { return check.bias * check.bias + check.shortcut * check.shortcut + solution * solution; }; // than noise
    for (int top_up = 0; top_up < kTopUps && check.noise * check.noise + other() > target * target; ++top_up) {
        const bool direct = check.direct > 1.3 * kDirectShare * target;
        if (direct) {
            luxel_direct(share_direct(check.direct, kDirectShare * target));
            check.direct = kDirectShare * target;
        }
        const double room = target * target - check.direct * check.direct - other();
        if (room < 0.04 * target * target) break; // more rays would not help
        // By what the rays that there are were to leave, and did: what a share goes by is known better after each.
        wanted = expected_noise() * std::min(0.8, 0.9 * std::sqrt(room) / check.gather);
        const std::vector<std::uint32_t> before = rays_;
        check = gather();
        if (!direct && rays_ == before) break; // there are as many as may be, or there is nothing to be had from them
    }
    store_luxels();
    fill();
    if (options_.match_seams) match_seams(surfaces_, scene_, options_.error_floor, &out_, context_, memo_ ? &memo_->lights : nullptr);
    if (memo_)
        for (Memo* memo : memo_->all()) memo->end();

    out_.error = error_report(check, solution);

    out_.radiosity.resize(n);
    for (std::size_t p = 0; p < n; ++p)
        out_.radiosity[p] = patches_.patches[p].emission +
                            static_cast<Rgb>(static_cast<Rgbd>(patches_.patches[p].reflectance) * total[p]);
    out_.patches = patches_.patches;
    out_.patch_index = patches_.texel_patch;
    out_.piece_patch = patches_.piece_patch;
    out_.face_patch = patches_.face_patch;
    out_.first_brought.assign(1, 0);
    for (std::size_t p = 0; p < n; ++p) {
        for (std::size_t k = 0; k < lists_[p].size(); ++k)
            if (!lists_[p][k].is_emitter && (brought_[p][k] > 0 || luxels_of(static_cast<std::uint32_t>(p)).empty())) out_.brought.push_back({lists_[p][k].light, brought_[p][k]});
        out_.first_brought.push_back(static_cast<std::uint32_t>(out_.brought.size()));
    }
    double gathered = 0;
    for (std::size_t l = 0; l < luxels; ++l)
        if (luxel_patch_[l] != kNoPatch) gathered += rays_[luxel_patch_[l]];
    out_.gather_rays =
        static_cast<std::uint32_t>(std::lround(gathered / static_cast<double>(std::max<std::size_t>(luxels, 1))));
    out_.rays = counts_.rays + shadow_rays_;
    out_.escaped_rays = counts_.escaped;
    out_.back_face_rays = counts_.back;
    return std::move(out_);
}

// Texels that no face covers but bilinear filtering may read, two rings deep: from what was baked beside them; only where nothing was, from what lies across a corner, which may be
// the other side of a wall. Between two sides of a wall one texel serves both: what is least off of either, relative to its own light, so that the dark one does not glow.
void Bake::fill() {
    for (std::size_t c = 0; c < surfaces_.charts.size(); ++c) {
        const Chart& chart = surfaces_.charts[c];
        const int w = static_cast<int>(chart.width), h = static_cast<int>(chart.height);
        for (int pass = 0; pass < 2; ++pass) {
            std::vector<std::uint32_t> filled;
            for (int y = 0; y < h; ++y)
                for (int x = 0; x < w; ++x) {
                    const std::uint32_t texel = chart.first_texel + static_cast<std::uint32_t>(y * w + x);
                    if (out_.valid[texel]) continue;
                    Rgbd flat;
                    std::array<Rgbd, 3> rnm{};
                    double weight = 0;
                    for (const bool across : {false, true}) {
                        if (weight > 0) break;
                        for (int dy = -1; dy <= 1; ++dy)
                            for (int dx = -1; dx <= 1; ++dx) {
                                const int u = x + dx, v = y + dy;
                                if (across != (dx && dy) || u < 0 || v < 0 || u >= w || v >= h) continue;
                                const std::uint32_t q = chart.first_texel + static_cast<std::uint32_t>(v * w + u);
                                if (!out_.valid[q]) continue;
                                const double level = std::max({mean(static_cast<Rgbd>(out_.flat[q])), floor_, 1e-30}), k = 1 / (level * level);
                                weight += k;
                                flat += static_cast<Rgbd>(out_.flat[q]) * k;
                                if (cones_[c])
                                    for (std::size_t i = 0; i < 3; ++i)
                                        rnm[i] += static_cast<Rgbd>(
                                                      out_.rnm[out_.rnm_first[c] + (q - chart.first_texel)][i]) *
                                                  k;
                            }
                    }
                    if (!(weight > 0)) continue;
                    out_.flat[texel] = static_cast<Rgb>(flat / weight);
                    if (cones_[c])
                        for (std::size_t i = 0; i < 3; ++i)
                            out_.rnm[out_.rnm_first[c] + (texel - chart.first_texel)][i] =
                                static_cast<Rgb>(rnm[i] / weight);
                    filled.push_back(texel);
                }
            for (const std::uint32_t t : filled) out_.valid[t] = 2;
        }
    }
}

Result<Lighting> bake_light(const World& world, const Bsp& bsp, const PlaneTable&, const Surfaces& surfaces,
                            const std::vector<Light>& lights, const LightOptions& options, Context& context, LightMemo* memo, const Visibility* seen) {
    try {
        Bake bake(world, bsp, surfaces, lights, options, memo, seen, context);
        return bake.run();
    } catch (const Cancelled&) {
        return fault(Exit::cancelled, "cancelled", "stopped while baking light");
    }
}

double mean_irradiance(const Surfaces& s, const Lighting& light) {
    double sum = 0, area = 0;
    for (const Luxel& l : s.luxels) {
        const double a = l.area * luxel_area(s, l.face);
        sum += a * mean(light.flat[texel_of(s, l)]), area += a;
    }
    return area > 0 ? sum / area : 0;
}

void validate(const Lighting& l, const Surfaces& s) {
    KILN_CHECK_OP(l.flat.size(), ==, s.texel_count);
    KILN_CHECK_OP(l.valid.size(), ==, s.texel_count);
    KILN_CHECK_OP(l.patch_index.size(), ==, s.texel_count);
    KILN_CHECK_OP(l.piece_patch.size(), ==, s.pieces.size());
    KILN_CHECK_OP(l.face_patch.size(), ==, s.faces.size());
    KILN_CHECK_OP(l.radiosity.size(), ==, l.patches.size());
    KILN_CHECK(l.first_brought.empty() || l.first_brought.size() == l.patches.size() + 1);
    for (std::size_t p = 1; p < l.first_brought.size(); ++p) KILN_CHECK_OP(l.first_brought[p - 1], <=, l.first_brought[p]);
    if (!l.first_brought.empty()) KILN_CHECK_OP(l.first_brought.back(), ==, l.brought.size());
    for (const LightBrings& b : l.brought) KILN_CHECK(std::isfinite(b.irradiance) && b.irradiance >= 0);
    KILN_CHECK_OP(l.chart_directional.size(), ==, s.charts.size());
    for (const std::uint32_t p : l.piece_patch) KILN_CHECK_OP(p, <, l.patches.size());
    for (const Rgb& e : l.flat)
        for (std::size_t c = 0; c < 3; ++c) KILN_CHECK(std::isfinite(e[c]) && e[c] >= 0);
    for (const auto& v : l.rnm)
        for (const Rgb& e : v)
            for (std::size_t c = 0; c < 3; ++c) KILN_CHECK(std::isfinite(e[c]));
    for (const Rgb& b : l.radiosity)
        for (std::size_t c = 0; c < 3; ++c) KILN_CHECK(std::isfinite(b[c]) && b[c] >= 0);
}

} // namespace kiln

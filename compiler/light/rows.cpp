// Form-factor rows by rays, and the solution of all bounces over them.
//
// A patch shoots a stratified, cosine-weighted bundle; the hit list is its row. Row sums plus what escaped or met a
// back face are 1 by construction, and no pair of patches is ever joined by a point rule, which fails where they
// touch.
#include "compiler/light/bake.h"
#include "compiler/light/jacobi.h"
#include "libs/parallel/parallel.h"
#include "libs/sampling/maps.h"
#include <numbers>
#include <tuple>

namespace kiln {

std::uint32_t Bake::code_at(const SceneHit& hit) const {
    const std::uint32_t code = patch_at(index_, patches_.texel_patch, patches_.piece_patch, patches_.face_patch, hit.face, hit.position);
    if (code != kNoPatch) return code;
    const std::uint32_t emitter = emitters_.of_face[hit.face.at()];
    return emitter != UINT32_MAX ? kHitEmitter | emitter : kHitBlack;
}

std::uint32_t Bake::emitter_of(std::uint32_t code) const {
    return is_patch(code) ? patch_emitter_[code] : code < kHitPanes ? code & ~kHitEmitter : UINT32_MAX;
}

HitCounts Bake::trace_rows() {
    const std::uint32_t m = quality_.row_rays;
    const std::size_t n = patches_.patches.size();
    std::vector<std::uint32_t> hits(n * m, kHitBlack);
    std::vector<std::uint8_t> cells(n * m);
    covered_.assign(n, 0);
    constexpr std::size_t kChunk = 16;
    std::vector<HitCounts> counts(slots_of(n, kChunk));
    std::vector<PaneRays> through(scene_.has_panes() ? counts.size() : 0);
    parallel_chunks(context_, "light: form factors", n, kChunk, [&](std::size_t begin, std::size_t end) {
        std::vector<Vec3> origins(m), directions(m);
        std::array<std::vector<double>, 4> numbers; // two for where to, two for where from
        for (std::vector<double>& of : numbers) of.resize(m);
        std::vector<std::optional<SceneHit>> found(m);
        for (std::size_t p = begin; p < end; ++p) {
            const Patch& patch = patches_.patches[p];
            // A patch that reflects nothing is never asked for its irradiance, unless luxels lean on it.
            const Face& face = surfaces_.faces[patch.face.at()];
            if (max_component(patch.reflectance) == 0 && !face.chart.valid()) continue;
            const Footprint footprint = footprint_of_patch(static_cast<std::uint32_t>(p));
            if (footprint.empty()) continue;
            const Frame flat = frame_around(footprint.normal());
            const Sobol points(seed_at(patch.centroid, 1));
            const HemisphereMap map = face.chart.valid() ? map_of(face.chart) : HemisphereMap{};
            // Each in a loop of its own: what one ray waits for, the next works on meanwhile.
            for (std::size_t d = 0; d < 4; ++d) points.first(numbers[d], static_cast<int>(d));
            for (std::uint32_t i = 0; i < m; ++i) cells[p * m + i] = Guide::cell(map.from_cosine({numbers[0][i], numbers[1][i]}));
            concentric_discs(numbers[0], numbers[1]);
            for (std::uint32_t i = 0; i < m; ++i) {
                const Footprint::Point at = footprint.sample({numbers[2][i], numbers[3][i]});
                const Frame frame = footprint.bent() ? frame_around(at.normal) : flat;
                origins[i] = at.position + at.normal * scene_.push_off();
                directions[i] = frame.world(HemisphereMap{}.lifted({numbers[0][i], numbers[1][i]}));
            }
            scene_.closest(origins, directions, found);
            HitCounts c{.rays = m};
            for (std::uint32_t i = 0; i < m; ++i) {
                std::uint32_t& code = hits[p * m + i];
                if (!found[i]) {
                    code = kHitEscaped, ++c.escaped;
                } else if (found[i]->back) {
                    code = kHitBack, ++c.back;
                } else {
                    code = code_at(*found[i]);
                }
                if (!through.empty())
                    note_panes(p * m + i, origins[i], directions[i], found[i] ? found[i]->distance : 1e30,
                               {.start = std::sqrt(patch.area / m), .end = std::sqrt(std::numbers::pi / m), .start_normal = face.normal}, code, through[begin / kChunk]);
            }
            // A face of a brush model that stands in the world's solid, say: no light, and no leak either.
            if (2 * (c.back + (sealed_ ? c.escaped : 0)) > m) {
                covered_[p] = 1;
                std::fill_n(hits.begin() + static_cast<std::ptrdiff_t>(p * m), m, kHitBlack);
                c = {.rays = m};
            }
            counts[begin / kChunk] += c;
        }
    });
    pane_rays_ = joined(through);
    hits_ = std::move(hits), hit_cells_ = std::move(cells);
    HitCounts all;
    for (const HitCounts& c : counts) all += c;
    return all;
}

namespace {

// Tables of many rows that are made in parts.
template <class... T> struct Parts {
    struct Part {
        std::vector<std::uint64_t> first;
        std::tuple<std::vector<T>...> entries;
    };
    std::vector<Part> parts;
    explicit Parts(std::size_t count) : parts(count) {}
    // body(first, entries...) with all of them
    void join(Context& context, const auto& body) const {
        std::vector<std::size_t> row{1}, entry{0}; // of each part, where its begin
        for (const Part& p : parts) row.push_back(row.back() + p.first.size()), entry.push_back(entry.back() + std::get<0>(p.entries).size());
        std::vector<std::uint64_t> first(row.back());
        std::tuple<std::vector<T>...> all;
        [&]<std::size_t... k>(std::index_sequence<k...>) {
            (std::get<k>(all).resize(entry.back()), ...);
            parallel_for(context, parts.size(), [&](std::size_t i) {
                for (std::size_t r = 0; r < parts[i].first.size(); ++r) first[row[i] + r] = entry[i] + parts[i].first[r];
                (std::ranges::copy(std::get<k>(parts[i].entries), std::get<k>(all).begin() + static_cast<std::ptrdiff_t>(entry[i])), ...);
            });
            body(std::move(first), std::move(std::get<k>(all))...);
        }(std::index_sequence_for<T...>());
    }
};
constexpr std::size_t kRowsAtOnce = 256;

} // namespace

// What each row met, in the order of the patches: those side by side mostly lie so in memory, too.
void Bake::merge_hits() {
    const std::uint32_t m = quality_.row_rays;
    const std::size_t n = patches_.patches.size();
    Parts<std::uint32_t, Quarters> patches(slots_of(n, kRowsAtOnce)), lone(patches.parts.size());
    parallel_chunks(context_, n, kRowsAtOnce, [&](std::size_t begin, std::size_t end) {
        thread_local std::vector<std::uint32_t> place; // of a patch in the row; UINT32_MAX in between
        place.resize(std::max(place.size(), n), UINT32_MAX);
        std::vector<std::pair<std::uint32_t, Quarters>> sorted;
        auto& [met_first, met] = patches.parts[begin / kRowsAtOnce];
        auto& [alone_first, alone] = lone.parts[begin / kRowsAtOnce];
        for (std::size_t row = begin; row < end; ++row) {
            auto& [codes, rays] = met;
            auto& [others, other_rays] = alone;
            const std::size_t first = codes.size(), first_other = others.size();
            for (std::uint32_t i = 0; i < m; ++i) {
                const std::uint32_t code = hits_[row * m + i], quarter = i * kQuarters / m;
                if (is_patch(code)) {
                    if (place[code] == UINT32_MAX) place[code] = static_cast<std::uint32_t>(codes.size()), codes.push_back(code), rays.emplace_back();
                    ++rays[place[code]].rays[quarter];
                } else if (code == kHitEscaped || code < kHitPanes) { // few kinds in a row
                    const auto at = std::find(others.begin() + static_cast<std::ptrdiff_t>(first_other), others.end(), code) - others.begin();
                    if (static_cast<std::size_t>(at) == others.size()) others.push_back(code), other_rays.emplace_back();
                    ++other_rays[static_cast<std::size_t>(at)].rays[quarter];
                }
            }
            for (std::size_t k = first; k < codes.size(); ++k) sorted.emplace_back(codes[k], rays[k]), place[codes[k]] = UINT32_MAX;
            std::ranges::sort(sorted, {}, [](const auto& s) { return s.first; });
            for (std::size_t k = first; k < codes.size(); ++k) std::tie(codes[k], rays[k]) = sorted[k - first];
            sorted.clear();
            met_first.push_back(codes.size()), alone_first.push_back(others.size());
        }
    });
    patches.join(context_, [&](std::vector<std::uint64_t> first, std::vector<std::uint32_t> codes, std::vector<Quarters> rays) { rows_ = {std::move(first), std::move(codes), {}, {}, {}, {}}, met_ = std::move(rays); });
    lone.join(context_, [&](std::vector<std::uint64_t> first, std::vector<std::uint32_t> codes, std::vector<Quarters> rays) { lone_first_ = std::move(first), lone_ = std::move(codes), lone_met_ = std::move(rays); });
}

void Bake::weigh_rows() {
    std::vector<float> weight(met_.size());
    parallel_chunks(context_, weight.size(), std::size_t{1} << 16, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) weight[k] = static_cast<float>(met_[k].all() * (1.0 / quality_.row_rays));
    });
    rows_.weight = std::move(weight);
}

// Rows of the larger patches, from those of their parts.
void Bake::merge_larger() {
    Parts<std::uint32_t, float> merged(slots_of(larger_.parts.size(), kRowsAtOnce));
    parallel_chunks(context_, larger_.parts.size(), kRowsAtOnce, [&](std::size_t begin, std::size_t end) {
        thread_local std::vector<double> sum; // all 0 in between
        sum.resize(std::max(sum.size(), larger_.parts.size()));
        auto& [ends, entries] = merged.parts[begin / kRowsAtOnce];
        auto& [patch, weight] = entries;
        for (std::size_t row = begin; row < end; ++row) {
            const std::size_t first = patch.size();
            for (const std::uint32_t p : larger_.parts[row])
                for (std::uint64_t k = rows_.first[p]; k < rows_.first[p + 1]; ++k) {
                    const std::uint32_t to = larger_.of[rows_.patch[k]];
                    if (sum[to] == 0) patch.push_back(to);
                    sum[to] += static_cast<double>(rows_.weight[k]) * patches_.patches[p].area / larger_.area[row];
                }
            std::ranges::sort(std::span(patch).subspan(first));
            for (std::size_t k = first; k < patch.size(); ++k) weight.push_back(static_cast<float>(sum[patch[k]])), sum[patch[k]] = 0;
            ends.push_back(patch.size());
        }
    });
    merged.join(context_, [&](std::vector<std::uint64_t> first, std::vector<std::uint32_t> patch, std::vector<float> weight) { larger_.rows = {std::move(first), std::move(patch), std::move(weight), {}, {}, {}}; });
}

// All that rays of rows tell, from an earlier bake where they are known.
void Bake::make_rows() {
    if (!load_rows()) {
        const HitCounts counts = trace_rows();
        counts_ += counts;
        merge_hits(), weigh_rows();
        save_rows({counts.rays, counts.escaped, counts.back});
    }
    if (!load_larger_rows()) merge_larger(), save_larger_rows();
    if (scene_.has_panes()) merge_filtered(rows_), merge_filtered_larger();
}

// Irradiance from emission that the bundle met: all of it, or what is not sampled explicitly for the patch.
std::vector<Rgbd> Bake::gathered_emission(bool only_unlisted) const {
    std::vector<Rgbd> out(patches_.patches.size());
    const bool of_patches = patches_shine();
    parallel_chunks(context_, out.size(), 256, [&](std::size_t begin, std::size_t end) {
        for (auto p = static_cast<std::uint32_t>(begin); p < end; ++p) {
            const auto add = [&](std::uint32_t code, const Quarters& met) {
                if (code == kHitEscaped) {
                    out[p] += sky_ * met.all();
                    return;
                }
                const std::uint32_t emitter = emitter_of(code);
                if (emitter == UINT32_MAX || (only_unlisted && listed(p, emitter))) return;
                out[p] += emitters_.emitters[emitter].radiance * met.all();
            };
            if (of_patches) for_met(p, add);
            else for_lone(p, add);
            for_pane_rays(p, [&](std::uint64_t ray) { out[p] += emission_through_panes(ray, p, only_unlisted); });
            out[p] *= std::numbers::pi / quality_.row_rays;
        }
    });
    return out;
}

// The light of all that shines, each source met by rays: no lamp has a part in it, and an earlier bake may have it.
std::vector<Rgbd> Bake::solve_gathered(const std::vector<Rgbd>& rho) {
    const std::vector<Rgbd> emission = gathered_emission(false);
    return known_or<std::vector<Rgbd>>(memo_ ? mix(base_, table_.low, hash_of(emission).low, hash_of(rho).low) : 0, [&] { return solve(rows_, emission, rho, &out_.iterations, &residual_); });
}

// Until the bound on the error is below the share `iteration` of the mean.
std::vector<Rgbd> Bake::solve(const Rows& rows, const std::vector<Rgbd>& direct, const std::vector<Rgbd>& rho,
                              std::uint32_t* iterations, double* residual) {
    const auto add_row = [&](std::size_t p, const auto& b, auto& sum) {
        for_row(rows, p, [&](std::uint32_t patch, auto factor) { sum += b[patch] * factor; });
    };
    double rho_max = 0;
    for (const Rgbd& r : rho) rho_max = std::max(rho_max, max_component(r));
    Bounces solved = quality_.iteration * (1 - rho_max) >= kQuickShare ? solve_bounces<QuickLight>(direct, rho, quality_.iteration, context_, add_row) : solve_bounces(direct, rho, quality_.iteration, context_, add_row);
    *iterations = solved.sweeps, *residual = solved.residual;
    return std::move(solved.irradiance);
}

} // namespace kiln

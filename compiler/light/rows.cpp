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

namespace kiln {

std::uint32_t Bake::code_at(const SceneHit& hit) const {
    const std::uint32_t code = patch_at(surfaces_, index_, patches_.texel_patch, patches_.piece_patch, patches_.face_patch, hit.face, hit.position);
    if (code != kNoPatch) return code;
    const std::uint32_t emitter = emitters_.of_face[hit.face.at()];
    return emitter != UINT32_MAX ? kHitEmitter | emitter : kHitBlack;
}

std::uint32_t Bake::emitter_of(std::uint32_t code) const {
    return is_patch(code) ? patch_emitter_[code] : code < kHitPanes ? code & ~kHitEmitter : UINT32_MAX;
}

void Bake::trace_rows() {
    const std::uint32_t m = quality_.row_rays;
    const std::size_t n = patches_.patches.size();
    if (load_rows()) return;
    hits_.assign(n * m, kHitBlack);
    hit_cells_.assign(n * m, 0);
    covered_.assign(n, 0);
    constexpr std::size_t kChunk = 16;
    std::vector<HitCounts> counts(slots_of(n, kChunk));
    std::vector<PaneRays> through(scene_.has_panes() ? counts.size() : 0);
    parallel_chunks(context_, "light: form factors", n, kChunk, [&](std::size_t begin, std::size_t end) {
        std::vector<Vec3> origins(m), directions(m);
        std::vector<Vec2> squares(m);
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
            for (std::uint32_t i = 0; i < m; ++i) squares[i] = points.pair(i, 0);
            for (std::uint32_t i = 0; i < m; ++i) hit_cells_[p * m + i] = Guide::cell(map.from_cosine(squares[i]));
            for (std::uint32_t i = 0; i < m; ++i) {
                const Footprint::Point at = footprint.sample(points.pair(i, 2));
                const Frame frame = footprint.bent() ? frame_around(at.normal) : flat;
                origins[i] = at.position + at.normal * scene_.push_off();
                directions[i] = frame.world(cosine_hemisphere(squares[i]));
            }
            scene_.closest(origins, directions, found);
            HitCounts c{.rays = m};
            for (std::uint32_t i = 0; i < m; ++i) {
                std::uint32_t& code = hits_[p * m + i];
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
                std::fill_n(hits_.begin() + static_cast<std::ptrdiff_t>(p * m), m, kHitBlack);
                c = {.rays = m};
            }
            counts[begin / kChunk] += c;
        }
    });
    pane_rays_ = joined(through);
    HitCounts all;
    for (const HitCounts& c : counts) all += c;
    counts_ += all;
    if (memo_ && memo_->save_rows) {
        ByteWriter w; // a RowsMemo, without a copy of all the hits
        w(hits_, hit_cells_, covered_, pane_rays_, std::array{all.rays, all.escaped, all.back});
        memo_->save_rows(table_, std::move(w.bytes));
    }
}

// `count` rows of what `of(row, add)` adds up, each in the order in which patches were met first.
template <class Of> Bake::Rows Bake::built(std::size_t count, const Of& of) const {
    constexpr std::size_t kChunk = 256;
    std::vector<Rows> parts(slots_of(count, kChunk));
    parallel_chunks(context_, count, kChunk, [&](std::size_t begin, std::size_t end) {
        thread_local std::vector<double> sum; // all 0 in between
        sum.resize(std::max(sum.size(), patches_.patches.size()));
        Rows& rows = parts[begin / kChunk];
        for (std::size_t row = begin; row < end; ++row) {
            const std::size_t first = rows.patch.size();
            rows.first.push_back(first);
            of(row, [&](std::uint32_t patch, double weight) {
                if (sum[patch] == 0) rows.patch.push_back(patch);
                sum[patch] += weight;
            });
            for (std::size_t k = first; k < rows.patch.size(); ++k) rows.weight.push_back(static_cast<float>(sum[rows.patch[k]])), sum[rows.patch[k]] = 0;
        }
    });
    std::vector<std::uint64_t> at{0}; // of each part, among all
    for (const Rows& part : parts) at.push_back(at.back() + part.patch.size());
    Rows all;
    all.first.resize(count + 1, at.back()), all.patch.resize(at.back()), all.weight.resize(at.back());
    parallel_chunks(context_, count, kChunk, [&](std::size_t begin, std::size_t) {
        const Rows& part = parts[begin / kChunk];
        const auto to = static_cast<std::ptrdiff_t>(at[begin / kChunk]);
        for (std::size_t k = 0; k < part.first.size(); ++k) all.first[begin + k] = static_cast<std::uint64_t>(to) + part.first[k];
        std::ranges::copy(part.patch, all.patch.begin() + to), std::ranges::copy(part.weight, all.weight.begin() + to);
    });
    return all;
}

Bake::Rows Bake::merge_rows() const {
    const std::uint32_t m = quality_.row_rays;
    Rows all = built(patches_.patches.size(), [&](std::size_t p, const auto& add) {
        for (std::size_t i = p * m; i < (p + 1) * m; ++i)
            if (is_patch(hits_[i])) add(hits_[i], 1.0 / m);
    });
    if (scene_.has_panes()) merge_filtered(all);
    return all;
}

// Of patches that are several each: `area` together.
Bake::Rows Bake::merge_rows(const Rows& fine, const std::vector<std::uint32_t>& parent, const std::vector<std::vector<std::uint32_t>>& children, const std::vector<double>& area) const {
    Rows all = built(children.size(), [&](std::size_t c, const auto& add) {
        for (const std::uint32_t p : children[c])
            for (std::uint64_t k = fine.first[p]; k < fine.first[p + 1]; ++k) add(parent[fine.patch[k]], fine.weight[k] * patches_.patches[p].area / area[c]);
    });
    if (!fine.filtered_first.empty()) merge_filtered(fine, parent, children, area, all);
    return all;
}

// Irradiance from emission that the bundle met: all of it, or what is not sampled explicitly for the patch.
std::vector<Rgbd> Bake::gathered_emission(bool only_unlisted) const {
    const std::uint32_t m = quality_.row_rays;
    std::vector<Rgbd> out(patches_.patches.size());
    parallel_chunks(context_, out.size(), 256, [&](std::size_t begin, std::size_t end) {
        for (std::size_t p = begin; p < end; ++p) {
            for (std::uint32_t i = 0; i < m; ++i) {
                const std::uint32_t hit = hits_[p * m + i];
                if (hit == kHitEscaped) {
                    out[p] += sky_;
                    continue;
                }
                if (hit == kHitPanes) {
                    out[p] += emission_through_panes(p * m + i, static_cast<std::uint32_t>(p), only_unlisted);
                    continue;
                }
                const std::uint32_t emitter = emitter_of(hit);
                if (emitter == UINT32_MAX) continue;
                if (only_unlisted && listed(static_cast<std::uint32_t>(p), emitter)) continue;
                out[p] += emitters_.emitters[emitter].radiance;
            }
            out[p] *= std::numbers::pi / m;
        }
    });
    return out;
}

// Until the bound on the error is below the share `iteration` of the mean.
std::vector<Rgbd> Bake::solve(const Rows& rows, const std::vector<Rgbd>& direct, const std::vector<Rgbd>& rho,
                              std::uint32_t* iterations, double* residual) {
    Bounces solved = solve_bounces(direct, rho, quality_.iteration, context_, [&](std::size_t p, const std::vector<Rgbd>& b, Rgbd& sum) {
        for_row(rows, p, [&](std::uint32_t patch, auto factor) { sum += b[patch] * factor; });
    });
    *iterations = solved.sweeps, *residual = solved.residual;
    return std::move(solved.irradiance);
}

} // namespace kiln

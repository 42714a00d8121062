// Panes in the rows of patches and in gathered light. A ray that crosses panes meets each of them and what stands behind: it does not branch, since what
// a pane reflects is looked up, so however many stand in a row nothing is cut off.
#include "compiler/light/bake.h"
#include <map>
#include <numbers>

namespace kiln {

// The hit `code` of a ray becomes kHitPanes if it crosses any, and is kept with them.
void Bake::note_panes(std::uint64_t ray, Vec3 origin, Vec3 way, double far, const Widths& widths, std::uint32_t& code, PaneRays& out) const {
    thread_local std::vector<PaneHit> panes;
    scene_.panes(origin, way, far, widths, panes);
    if (panes.empty()) return;
    out.ray.push_back(ray), out.first.push_back(out.met.size());
    Rgbd through{1, 1, 1};
    for (const PaneHit& pane : panes) {
        if (pane.front) out.met.push_back({code_at(pane.hit), static_cast<Rgb>(through * pane.opacity), static_cast<Rgb>(through)});
        through = through * pane.through;
    }
    const Rgb rest = static_cast<Rgb>(through);
    out.met.push_back({code, rest, rest});
    code = kHitPanes;
}

PaneRays joined(std::vector<PaneRays>& parts) {
    PaneRays out;
    for (PaneRays& part : parts) {
        for (std::uint64_t& f : part.first) f += out.met.size();
        out.ray.insert(out.ray.end(), part.ray.begin(), part.ray.end());
        out.first.insert(out.first.end(), part.first.begin(), part.first.end());
        out.met.insert(out.met.end(), part.met.begin(), part.met.end());
        part = {};
    }
    out.first.push_back(out.met.size());
    return out;
}

void Bake::merge_filtered(Rows& rows) const {
    const std::uint32_t m = quality_.row_rays;
    const double share = 1.0 / m;
    std::size_t r = 0;
    std::map<std::uint32_t, Rgbd> row;
    rows.filtered_first.push_back(0);
    for (std::size_t p = 0; p < patches_.patches.size(); ++p) {
        row.clear();
        for (; r < pane_rays_.ray.size() && pane_rays_.ray[r] < (p + 1) * m; ++r) {
            if (covered_[p]) continue;
            for (std::uint64_t k = pane_rays_.first[r]; k < pane_rays_.first[r + 1]; ++k) {
                const PaneRays::Met& met = pane_rays_.met[k];
                if (is_patch(met.code) && max_component(patches_.patches[met.code].reflectance) > 0 && max_component(met.reflected) > 0)
                    row[met.code] += static_cast<Rgbd>(met.reflected) * share;
            }
        }
        for (const auto& [patch, weight] : row) rows.filtered_patch.push_back(patch), rows.filtered_weight.push_back(static_cast<Rgb>(weight));
        rows.filtered_first.push_back(rows.filtered_patch.size());
    }
}

// On larger patches, as merge_larger merges the others.
void Bake::merge_filtered_larger() {
    std::map<std::uint32_t, Rgbd> row;
    Rows& rows = larger_.rows;
    rows.filtered_first.assign(1, 0);
    for (std::size_t c = 0; c < larger_.parts.size(); ++c) {
        row.clear();
        for (const std::uint32_t p : larger_.parts[c])
            for (std::uint64_t k = rows_.filtered_first[p]; k < rows_.filtered_first[p + 1]; ++k)
                row[larger_.of[rows_.filtered_patch[k]]] += static_cast<Rgbd>(rows_.filtered_weight[k]) * (patches_.patches[p].area / larger_.area[c]);
        for (const auto& [patch, weight] : row) rows.filtered_patch.push_back(patch), rows.filtered_weight.push_back(static_cast<Rgb>(weight));
        rows.filtered_first.push_back(rows.filtered_patch.size());
    }
}

Rgbd Bake::emission_through_panes(std::uint64_t ray, std::uint32_t patch, bool only_unlisted) const {
    Rgbd sum;
    for (const PaneRays::Met& met : pane_rays_.of(ray)) {
        if (met.code == kHitEscaped) {
            sum += static_cast<Rgbd>(met.emitted) * sky_;
            continue;
        }
        const std::uint32_t emitter = emitter_of(met.code);
        if (emitter == UINT32_MAX || (only_unlisted && listed(patch, emitter))) continue;
        sum += static_cast<Rgbd>(met.emitted) * emitters_.emitters[emitter].radiance;
    }
    return sum;
}

// For the guide of `patch`.
double Bake::light_through_panes(std::uint64_t ray, std::uint32_t patch) const {
    double sum = 0;
    for (const PaneRays::Met& met : pane_rays_.of(ray)) {
        if (is_patch(met.code)) sum += mean(static_cast<Rgbd>(met.reflected)) * bright_[met.code];
        const std::uint32_t emitter = emitter_of(met.code);
        if (emitter != UINT32_MAX && !listed(patch, emitter)) sum += mean(static_cast<Rgbd>(met.emitted) * emitters_.emitters[emitter].radiance);
    }
    return sum;
}

Rgbd Bake::through_panes(std::span<const PaneHit> panes, Vec3 way, std::uint32_t patch, std::span<const std::uint32_t> heavy, Random& random,
                         const ReflectedLight& light, Looked* looked, int depth, Rgbd behind) const {
    Rgbd sum, through{1, 1, 1};
    // Only the first is looked at closely: were all, rays in a stack of them would multiply with each bounce.
    for (const PaneHit& pane : panes) {
        if (pane.opacity > 0) sum += through * reflected_at(pane.hit, way, random, light, looked, std::exchange(depth, kNearBounces)) * pane.opacity;
        const std::uint32_t emitter = pane.front ? emitters_.of_face[pane.hit.face.at()] : UINT32_MAX;
        if (looked && emitter != UINT32_MAX) looked->at(emitter_part(emitter));
        if (emitter != UINT32_MAX && !listed(patch, emitter) && !std::ranges::binary_search(heavy, emitter)) sum += through * emitters_.emitters[emitter].radiance;
        through = through * pane.through;
    }
    return sum + through * behind;
}

} // namespace kiln

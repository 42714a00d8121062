// What a bake keeps for the next one of the same geometry, and what it takes over: memo.h.
//
// A step is done patch by patch: the direct light of its luxels, what they gather, the luxels of the pilot. What it comes to is a function
// of the geometry, of its key (options, the lights of the patch, samples), and of the patches that rays met. Patches have a state, a
// hash of all that a ray may read there; equal key and equal states, equal light.
#include "compiler/light/bake.h"
#include "libs/parallel/parallel.h"

namespace kiln {
namespace {
// Not the entity's number in the file, which lights nothing.
std::uint64_t light_id(Light light) {
    light.entity = {};
    return hash64(light);
}
} // namespace

// Before the rows of new patches: those that an earlier bake had, if it had them.
void Bake::open_memo() {
    stow_rows();
    if (base_ == 0) { // the first
        known_ = std::move(memo_->tables);
        memo_->tables.clear();
        for (const Light& l : lights_) light_ids_.push_back(light_id(l));
        ByteWriter w;
        w(options_, sealed_, scene_.instruction_set(), emitters_.of_face);
        for (std::size_t c = 0; c < cones_.size(); ++c) w(cones_[c] ? cone_deg_[c] : -1.0);
        geometry_ = hash_bytes(w.bytes).low;
        w(sky_radiance(lights_));
        base_ = hash_bytes(w.bytes).low | 1;
    }
    ByteWriter w;
    w(quality_.row_rays, geometry_);
    for (const Patch& p : patches_.patches) w(p.face, p.centroid, p.area, max_component(p.reflectance) > 0);
    const Hash table = hash_bytes(w.bytes);
    PatchMemo memo;
    for (PatchMemo& k : known_)
        if (k.table == table) memo = std::move(k), k.table = {};
    memo.table = table;
    const std::size_t n = patches_.patches.size();
    if (memo.hits.size() != n * quality_.row_rays || memo.cells.size() != memo.hits.size() || memo.covered.size() != n) memo.traced = false;
    memo.lights.begin(n), memo.direct.begin(n), memo.gather.begin(n), memo.pilot.begin(surfaces_.luxels.size());
    memo_->tables.push_back(std::move(memo));
    kept_ = &memo_->tables.back();
}

// Rows lie with the memo while they are not in use: they are most of it.
void Bake::stow_rows() {
    if (!kept_) return;
    kept_->hits = std::move(hits_), kept_->cells = std::move(hit_cells_), kept_->covered = std::move(covered_);
    kept_->lights.end(), kept_->direct.end(), kept_->gather.end(), kept_->pilot.end();
    kept_ = nullptr;
}

// After a solution: of all that a ray may read at a patch, and of what the guides of others have from it.
void Bake::note_solution() {
    const std::size_t n = patches_.patches.size();
    reflects_.resize(n), reflects_coarse_.resize(n), guides_.resize(n);
    std::vector<std::uint64_t> seen(n);
    const auto read = [&](ByteWriter& w, const ReflectedLight& light, std::uint32_t p) {
        w(light.patch[p]);
        for (std::uint32_t k = patch_luxel_first_[p]; k < patch_luxel_first_[p + 1]; ++k) {
            const Luxel& luxel = surfaces_.luxels[patch_luxels_[k]];
            const Chart& chart = surfaces_.charts[luxel.chart.at()];
            const std::size_t texel = chart.first_texel + luxel.y * chart.width + luxel.x;
            w(light.texel[texel], light.direct[texel], light.steep[texel]);
        }
    };
    constexpr std::size_t kChunk = 256;
    const std::size_t chunks = (n + kChunk - 1) / kChunk;
    parallel_for(context_, chunks, [&](std::size_t chunk) {
        ByteWriter w;
        for (auto p = static_cast<std::uint32_t>(chunk * kChunk); p < std::min(n, (chunk + 1) * kChunk); ++p) {
            const Rgbd emitted = patch_emitter_[p] == UINT32_MAX ? Rgbd{} : emitters_.emitters[patch_emitter_[p]].radiance;
            w.bytes.clear();
            w(bright_[p], emitted);
            seen[p] = hash_bytes(w.bytes).low;
            w(patches_.patches[p].reflectance);
            read(w, reflected_, p);
            reflects_[p] = hash_bytes(w.bytes).low;
            w.bytes.clear();
            read(w, coarse_, p);
            reflects_coarse_[p] = hash_bytes(w.bytes).low;
        }
    });
    parallel_for(context_, chunks, [&](std::size_t chunk) {
        for (std::size_t p = chunk * kChunk; p < std::min(n, (chunk + 1) * kChunk); ++p) {
            std::uint64_t sum = 0;
            for (std::uint64_t k = rows_.first[p]; k < rows_.first[p + 1]; ++k) sum = mix(sum, seen[rows_.patch[k]]);
            guides_[p] = sum;
        }
    });
}

// Before a step: lists change between them.
void Bake::note_lists() {
    const std::size_t n = patches_.patches.size();
    lists_hash_.resize(n);
    for (std::uint32_t p = 0; p < n; ++p) {
        std::uint64_t h = lists_[p].size();
        for (const LightRef& r : lists_[p]) {
            const std::uint64_t what = r.is_emitter ? mix(r.light, std::bit_cast<std::uint64_t>(emitters_.emitters[r.light].radiance.x), std::bit_cast<std::uint64_t>(emitters_.emitters[r.light].radiance.y), std::bit_cast<std::uint64_t>(emitters_.emitters[r.light].radiance.z))
                                                    : light_ids_[r.light];
            h = mix(h, what, static_cast<std::uint64_t>(r.is_emitter) | r.penumbra << 1 | r.hidden << 2 | std::uint64_t{r.samples} << 8);
        }
        lists_hash_[p] = h;
    }
}

void Bake::note_states() {
    note_lists();
    const std::size_t n = patches_.patches.size();
    states_.resize(n), states_coarse_.resize(n);
    for (std::size_t p = 0; p < n; ++p) {
        states_[p] = mix(reflects_[p], lists_hash_[p]);
        states_coarse_[p] = mix(states_[p], reflects_coarse_[p]);
    }
}

std::uint64_t Bake::direct_key(std::uint32_t p, std::uint64_t pass) const {
    return mix(base_, lists_hash_[p], effort_[p], pass);
}

// What decides where rays go: their number, the guide of the patch, which emitters have rays of their own, and what is worth some.
std::uint64_t Bake::gather_key(std::uint32_t p) const {
    std::uint64_t guide = guides_[p];
    for (const std::uint32_t q : neighbours_[p]) guide = mix(guide, guides_[q]);
    return mix(base_, lists_hash_[p], rays_[p], guide, std::bit_cast<std::uint64_t>(estimate_[p]), std::bit_cast<std::uint64_t>(floor_));
}

} // namespace kiln

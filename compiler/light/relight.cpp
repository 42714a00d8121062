// What a bake keeps for the next one of the same geometry, and what it takes over: memo.h.
//
// A step is done patch by patch: the direct light of its luxels, what they gather, the luxels of the pilot. What it comes to is a function
// of the geometry (with what its panes let through), of its key (options, the lights of the patch, samples), and of the patches and emitters
// that rays met. These have a state, a hash of all that a ray may read there; equal key and equal states, equal light.
#include "compiler/light/bake.h"
#include "libs/parallel/parallel.h"

namespace kiln {
namespace {
std::uint64_t with_reflected(std::uint64_t sum, const ReflectedLight& light, const Surfaces& surfaces, std::uint32_t p, std::span<const std::uint32_t> luxels) {
    sum = chained(sum, light.patch[p]);
    for (const std::uint32_t l : luxels) {
        const std::size_t texel = texel_of(surfaces, surfaces.luxels[l]);
        sum = chained(chained(chained(sum, light.texel[texel]), light.direct[texel]), std::uint64_t{light.steep[texel]});
    }
    return sum;
}
} // namespace

std::uint64_t light_id(Light light) {
    light.entity = {};
    return hash_of(light).low;
}

void Bake::open_memo() {
    for (Memo* memo : memo_->all()) memo->begin();
    for (Light l : lights_) {
        light_ids_.push_back(light_id(l));
        l.intensity = {1, 1, 1};
        light_shapes_.push_back(light_id(l));
    }
    ByteWriter w;
    w(options_, sealed_, scene_.instruction_set(), emitters_.of_face, hash_bytes(raw_bytes(surfaces_.pieces)), hash_bytes(raw_bytes(surfaces_.luxels)));
    for (const auto& cone : cones_) w(cone ? cone->cone_deg() : -1.0);
    geometry_ = hash_bytes(w.bytes).low;
    w(sky_);
    for (const Emitter& e : emitters_.emitters) // those of faces that may have no patch to show what they shine
        if (!surfaces_.faces[e.face.at()].chart.valid()) w(e.radiance);
    base_ = hash_bytes(w.bytes).low | 1;
}

// Before the rows of new patches.
void Bake::name_table() {
    ByteWriter w;
    w(quality_.row_rays, geometry_);
    for (const Patch& p : patches_.patches) w(p.face, p.centroid, p.area, max_component(p.reflectance) > 0);
    table_ = hash_bytes(w.bytes);
    larger_table_ = hash_of(std::pair(table_, quality_.patch_size)); // they go by the size asked for
}

const PieceEdges& Bake::edges() const {
    if (!edges_) edges_ = piece_adjacency(surfaces_);
    return *edges_;
}

// Of the luxels, by their places.
std::vector<std::uint64_t> Bake::luxel_seeds(std::uint64_t pass) const {
    return known_or<std::vector<std::uint64_t>>(mix(geometry_, KeyOf::seeds, pass), [&] {
        std::vector<std::uint64_t> out(surfaces_.luxels.size());
        parallel_chunks(context_, out.size(), 1024, [&](std::size_t begin, std::size_t end) {
            for (std::size_t l = begin; l < end; ++l) out[l] = seed_at(luxel_centroid(surfaces_.luxels[l]), pass);
        });
        return out;
    });
}

PatchTable Bake::patches_of(double h) const {
    ByteWriter w;
    for (const Material& m : world_.materials) w(m.reflectance, m.emission);
    return known_or<PatchTable>(mix(geometry_, KeyOf::patches, hash_bytes(w.bytes).low, std::bit_cast<std::uint64_t>(h)), [&] { return build_patches(world_, surfaces_, edges(), h); });
}

TouchingPatches Bake::touching(const PatchTable& table, Hash name) const {
    return known_or<TouchingPatches>(mix(name.low, KeyOf::neighbours), [&] { return touching_patches(edges(), table); });
}

namespace {
// Tables are used where they lie in a file: the widest first, so that all are aligned.
template <class... T> void read_held(ByteReader& r, const std::shared_ptr<const Buffer>& file, Held<T>&... to) {
    ((to = {r.view<T>(), file}), ...);
}
bool fits(const Held<std::uint64_t>& first, std::size_t count, std::size_t entries) {
    return first.size() == count + 1 && first[count] == entries;
}
// body(reader, file); false where nothing is there, or it is not what was saved.
bool read_table(const LightMemo* memo, Hash table, const auto& body) {
    std::optional<Buffer> bytes = memo && memo->load_rows ? memo->load_rows(table) : std::nullopt;
    if (!bytes) return false;
    const auto file = std::make_shared<const Buffer>(*std::move(bytes));
    try {
        ByteReader r(file->bytes());
        return body(r, file);
    } catch (const ArchiveError&) {
        return false;
    }
}
template <class... T> void save_table(const LightMemo* memo, Hash table, const T&... values) {
    if (!memo || !memo->save_rows) return;
    ByteWriter w;
    w.bytes.reserve(ByteWriter::count(values...));
    w(values...);
    memo->save_rows(table, std::move(w.bytes));
}
} // namespace

bool Bake::load_rows() {
    return read_table(memo_, table_, [&](ByteReader& r, const std::shared_ptr<const Buffer>& file) {
        const std::size_t n = patches_.patches.size();
        Rows rows;
        Held<std::uint64_t> lone_first;
        Held<std::uint32_t> hits, lone;
        Held<Quarters> met, lone_met;
        Held<std::uint8_t> cells;
        PaneRays panes;
        std::array<std::uint64_t, 3> counts{};
        std::vector<std::uint8_t> covered;
        read_held(r, file, rows.first, lone_first), read_held(r, file, met, lone_met), read_held(r, file, hits, rows.patch, lone), read_held(r, file, rows.weight), read_held(r, file, cells);
        r(panes, counts, covered);
        if (hits.size() != n * quality_.row_rays || cells.size() != hits.size() || covered.size() != n || met.size() != rows.patch.size() || rows.weight.size() != rows.patch.size() || lone_met.size() != lone.size() ||
            !fits(rows.first, n, met.size()) || !fits(lone_first, n, lone.size()))
            return false;
        hits_ = std::move(hits), hit_cells_ = std::move(cells), covered_ = std::move(covered), pane_rays_ = std::move(panes);
        rows_ = std::move(rows), met_ = std::move(met), lone_first_ = std::move(lone_first), lone_ = std::move(lone), lone_met_ = std::move(lone_met);
        counts_ += HitCounts{counts[0], counts[1], counts[2]};
        return true;
    });
}

void Bake::save_rows(const std::array<std::uint64_t, 3>& counts) {
    save_table(memo_, table_, rows_.first, lone_first_, met_, lone_met_, hits_, rows_.patch, lone_, rows_.weight, hit_cells_, pane_rays_, counts, covered_);
}

bool Bake::load_larger_rows() {
    return read_table(memo_, larger_table_, [&](ByteReader& r, const std::shared_ptr<const Buffer>& file) {
        Rows rows;
        read_held(r, file, rows.first), read_held(r, file, rows.patch), read_held(r, file, rows.weight);
        if (rows.weight.size() != rows.patch.size() || !fits(rows.first, larger_.parts.size(), rows.patch.size())) return false;
        larger_.rows = std::move(rows);
        return true;
    });
}

void Bake::save_larger_rows() {
    save_table(memo_, larger_table_, larger_.rows.first, larger_.rows.patch, larger_.rows.weight);
}

// All that a ray may read at a patch.
void Bake::note_reflected(std::uint32_t p) {
    const std::span<const std::uint32_t> luxels = luxels_of(p);
    reflects_[p] = mix(with_reflected(chained(light_seen(p), patches_.patches[p].reflectance), reflected_, surfaces_, p, luxels));
    reflects_coarse_[p] = mix(with_reflected(with_reflected(0, coarse_, surfaces_, p, luxels), coarse_luxels_, surfaces_, p, luxels));
    untold_[p] = 1;
}

// What the guide of a patch that sees it has from it.
std::uint64_t Bake::light_seen(std::uint32_t p) const {
    const Rgbd emitted = emitted_by(p);
    std::uint64_t sum = 0;
    for (const double x : {bright_[p], emitted.x, emitted.y, emitted.z}) sum = chained(sum, std::bit_cast<std::uint64_t>(x));
    return mix(sum);
}

// After a solution: that, and what the guides of others have from it.
void Bake::note_solution() {
    const std::size_t n = patches_.patches.size();
    reflects_.resize(n), reflects_coarse_.resize(n), guides_.resize(n), untold_.resize(n);
    std::vector<std::uint64_t> seen(n);
    constexpr std::size_t kChunk = 256;
    parallel_chunks(context_, n, kChunk, [&](std::size_t begin, std::size_t end) {
        for (auto p = static_cast<std::uint32_t>(begin); p < end; ++p) note_reflected(p), seen[p] = light_seen(p);
    });
    parallel_chunks(context_, n, kChunk, [&](std::size_t begin, std::size_t end) {
        for (std::size_t p = begin; p < end; ++p) {
            std::uint64_t sum = 0;
            for (std::uint64_t k = rows_.first[p]; k < rows_.first[p + 1]; ++k) sum = chained(sum, seen[rows_.patch[k]]);
            for_pane_rays(p, [&](std::uint64_t ray) {
                for (const PaneRays::Met& met : pane_rays_.of(ray))
                    if (is_patch(met.code)) sum = chained(sum, seen[met.code]);
            });
            guides_[p] = mix(sum);
        }
    });
}

std::uint64_t Bake::hash_of_ref(const LightRef& r, bool bright) const {
    const auto bits = [](double x) { return std::bit_cast<std::uint64_t>(x); };
    const std::uint64_t flags = static_cast<std::uint64_t>(r.is_emitter) | std::uint64_t{r.penumbra} << 1 | std::uint64_t{r.hidden} << 2 | std::uint64_t{r.filtered} << 3 | std::uint64_t{r.samples} << 8;
    if (!r.is_emitter) return mix(flags, (bright ? light_ids_ : light_shapes_)[r.light]);
    const Rgbd radiance = bright ? emitters_.emitters[r.light].radiance : Rgbd{};
    return mix(flags, r.light, bits(radiance.x), bits(radiance.y), bits(radiance.z));
}

// Before a step: lists and what is reflected change between them.
void Bake::note_states() {
    const std::size_t n = patches_.patches.size();
    emitters_hash_.resize(n), states_.resize(part_count()), states_coarse_.resize(part_count());
    for (std::uint32_t e = 0; e < emitters_.emitters.size(); ++e) states_[emitter_part(e)] = states_coarse_[emitter_part(e)] = hash_of(emitters_.emitters[e].radiance).low;
    parallel_chunks(context_, n, 256, [&](std::size_t begin, std::size_t end) {
        for (std::size_t p = begin; p < end; ++p) {
            if (!std::exchange(untold_[p], std::uint8_t{0})) continue;
            std::uint64_t all = 0, emitters = 0;
            for (std::size_t k = 0; k < lists_[p].size(); ++k) {
                const std::uint64_t h = hash_of_ref(lists_[p][k]);
                all = mix(all, h, std::bit_cast<std::uint32_t>(brought_[p][k])); // a light close by is drawn by what each brings
                if (lists_[p][k].is_emitter) emitters = mix(emitters, h);
            }
            emitters_hash_[p] = emitters;
            states_[p] = reflects_[p], states_coarse_[p] = mix(reflects_[p], reflects_coarse_[p]);
            states_[n + p] = mix(chained(emitters, reflected_.far[p])), states_coarse_[n + p] = mix(chained(chained(emitters, reflected_.far[p]), coarse_.far[p]));
            states_[2 * n + p] = states_coarse_[2 * n + p] = all;
        }
    });
}

// What decides where rays go: their number, the guide of the patch, which emitters have rays of their own, and what is worth some.
std::uint64_t Bake::gather_key(std::uint32_t p) const {
    const std::uint64_t worth = emitters_.emitters.empty() ? 0 : mix(std::bit_cast<std::uint64_t>(estimate_[p]), std::bit_cast<std::uint64_t>(std::max(estimate_[p], floor_)));
    std::uint64_t guide = guides_[p];
    for (const std::uint32_t q : neighbours_[p]) guide = mix(guide, guides_[q]);
    for (const std::uint32_t e : behind_[p]) guide = mix(guide, e + 1);
    for (const std::uint32_t i : patch_spots_[p]) guide = mix(guide, hash_of(spots_[i]).low);
    return mix(base_, table_.low, p, emitters_hash_[p], rays_[p], guide, worth, std::bit_cast<std::uint64_t>(quality_.patch_size));
}

} // namespace kiln

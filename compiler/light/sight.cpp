#include "compiler/light/sight.h"
#include "libs/core/each_once.h"

namespace kiln {
namespace {
// Does all that seals stop light? Else light goes where nothing is seen.
bool opaque(const World& world, const Surfaces& surfaces, const TraceScene& scene) {
    if (std::ranges::any_of(world.brushes, [](const WorldBrush& b) { return b.contents == Contents::solid && b.model.value == 0 && !b.casts_light_shadow; })) return false;
    for (std::uint32_t f = 0; f < surfaces.faces.size(); ++f) {
        const Face& face = surfaces.faces[f];
        if (!face.hull || face.curved() || !face.side.valid() || face.model.value != 0) continue;
        if (world.brushes[world.brush_of(face.side).at()].contents == Contents::solid && !scene.stops({f})) return false;
    }
    return true;
}
} // namespace

Clusters Together::clusters() {
    return known_ ? each_once(std::move(all_)) : Clusters{};
}

LightSight::LightSight(const World& world, const Surfaces& surfaces, const Bsp& bsp, const Visibility* seen, const TraceScene& scene, const std::vector<Light>& lights, const EmitterSet& emitters)
    : bsp_(bsp) {
    constexpr double kRounding = 1e-6; // map units
    for (const Light& light : lights) {
        Reach& reach = reaches_.emplace_back(light.position);
        if (light.kind != LightKind::point && light.kind != LightKind::spot) continue;
        if (light.falloff == Falloff::quake_linear) reach.far = std::max(light.range, 0.0) + kRounding;
        if (light.fade_end > 0) reach.far = std::min(reach.far, light.fade_end + kRounding);
    }
    lights_.count = static_cast<std::uint32_t>(lights.size()), emitters_.count = static_cast<std::uint32_t>(emitters.emitters.size());
    if (!seen || seen->cluster_count == 0 || !opaque(world, surfaces, scene)) return;
    seen_ = seen;
    for (const BspLeaf& leaf : bsp.leaves)
        if (!leaf.bounds.empty()) box_.add(leaf.bounds);
    std::vector<Clusters> from;
    // Suns shine through faces of the sky, and in a world that is not sealed through anything.
    Together sky_faces;
    if (std::ranges::any_of(bsp.leaves, &BspLeaf::outside))
        for (std::uint32_t f = 0; f < surfaces.faces.size(); ++f)
            if (surfaces.faces[f].sky) sky_faces.add(of_face(surfaces, {f}));
    const Clusters sky = sky_faces.clusters();
    for (const Light& light : lights) from.push_back(light.kind == LightKind::point || light.kind == LightKind::spot ? at(light.position) : sky);
    lights_ = sources(from);
    from.clear();
    for (const Emitter& e : emitters.emitters) from.push_back(of_face(surfaces, e.face));
    emitters_ = sources(from);
}

LightSight::Sources LightSight::sources(std::span<const Clusters> from) const {
    Sources out;
    out.count = static_cast<std::uint32_t>(from.size());
    if (!seen_) return out;
    out.words = (from.size() + 63) / 64;
    out.bits.resize(seen_->cluster_count * out.words);
    const std::size_t words = seen_->words_per_row();
    std::vector<std::uint64_t> seen(words);
    for (std::size_t i = 0; i < from.size(); ++i) {
        std::ranges::fill(seen, from[i].empty() ? ~std::uint64_t{0} : 0);
        for (const std::uint32_t s : from[i])
            for (std::size_t w = 0; w < words; ++w) seen[w] |= seen_->rows[s * words + w]; // rows are symmetric
        for (std::uint32_t c = 0; c < seen_->cluster_count; ++c)
            if (seen[c / 64] >> (c % 64) & 1) out.bits[c * out.words + i / 64] |= std::uint64_t{1} << (i % 64);
    }
    return out;
}

// Leaves inside something solid hold nothing that light comes to.
Clusters LightSight::at(std::span<const Vec3> points, double reach) const {
    if (!seen_) return {};
    for (const Vec3& p : points)
        for (std::size_t a = 0; a < 3; ++a)
            if (p[a] - reach < box_.lo[a] || p[a] + reach > box_.hi[a]) return {};
    Clusters out;
    for (const LeafId l : leaves_at(bsp_, points, reach)) {
        const BspLeaf& leaf = bsp_.leaves[l.at()];
        if (!leaf.open()) continue;
        if (!leaf.cluster.valid()) return {};
        out.push_back(leaf.cluster.value);
    }
    return each_once(std::move(out));
}

Clusters LightSight::on(const Surfaces& surfaces, FaceId id, Vec2 lo, Vec2 hi, double off) const {
    const Face& face = surfaces.faces[id.at()];
    if (!face.curved() && face.clusters.size() == 1) return {face.clusters[0].value};
    std::array<Vec3, 4> corners;
    for (std::size_t i = 0; i < 4; ++i) corners[i] = world_from_luxel(surfaces, id, {i % 2 ? hi.x : lo.x, i / 2 ? hi.y : lo.y}) + face.normal * off;
    return at(corners, face.curved() ? 2 * off : -kHair); // rays from what is bent start along other normals
}

Clusters LightSight::of_patch(const Surfaces& surfaces, const PatchTable& table, std::uint32_t patch, double off) const {
    if (!seen_) return {};
    if (table.first_piece[patch] == table.first_piece[patch + 1]) return of_face(surfaces, table.patches[patch].face);
    struct OnFace {
        FaceId face;
        Vec2 lo{1e30, 1e30}, hi{-1e30, -1e30};
    };
    std::vector<OnFace> parts;
    for (std::uint32_t k = table.first_piece[patch]; k < table.first_piece[patch + 1]; ++k) {
        const LuxelPiece& piece = surfaces.pieces[table.pieces[k]];
        auto part = std::ranges::find(parts, piece.face, &OnFace::face);
        if (part == parts.end()) part = parts.insert(part, OnFace{piece.face});
        for (const Vec2& q : points_of(surfaces, piece)) part->lo = {std::min(part->lo.x, q.x), std::min(part->lo.y, q.y)}, part->hi = {std::max(part->hi.x, q.x), std::max(part->hi.y, q.y)};
    }
    Together all;
    for (const OnFace& part : parts) all.add(on(surfaces, part.face, part.lo, part.hi, off));
    return all.clusters();
}

Clusters LightSight::of_face(const Surfaces& surfaces, FaceId id) const {
    const Face& face = surfaces.faces[id.at()];
    if (!face.curved() && !face.clusters.empty()) {
        Clusters out;
        for (const ClusterId c : face.clusters) out.push_back(c.value);
        return out;
    }
    Together all;
    for (std::uint32_t t = face.first_triangle; t < face.first_triangle + face.triangle_count; ++t) {
        std::array<Vec3, 3> corner;
        for (std::size_t i = 0; i < 3; ++i) corner[i] = surfaces.positions[surfaces.triangles[t][i]];
        all.add(at(corner, kHair));
    }
    return all.clusters();
}

} // namespace kiln

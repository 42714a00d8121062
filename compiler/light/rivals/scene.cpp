// The scene without anything baked, and the places where light is asked for.
#include "compiler/light/bake.h"
#include "compiler/light/rivals/parts.h"
#include "libs/parallel/parallel.h"
#include "libs/sampling/maps.h"

namespace kiln::rivals {
namespace {
constexpr double kMargin = 10;           // of footprints, in push-offs; as the bake's
constexpr std::uint32_t kTestRays = 64;  // that tell whether a luxel looks into something solid

std::array<Vec3, 4> directions_of(const Frame& f) {
    return {f.n, f.world(kRnmBasis[0]), f.world(kRnmBasis[1]), f.world(kRnmBasis[2])};
}
Footprint footprint_of(const Scene& scene, const PatchTable& single, std::uint32_t luxel) {
    Footprint f(kMargin * scene.trace().push_off());
    const Luxel& l = scene.surfaces.luxels[luxel];
    // Of a luxel cut in two by a wall, the larger side: as the bake does.
    std::uint32_t best = kNoPatch;
    double most = -1;
    for (std::uint32_t k = 0; k < l.piece_count; ++k) {
        const std::uint32_t patch = single.piece_patch[l.first_piece + k];
        double area = 0;
        for (std::uint32_t i = 0; i < l.piece_count; ++i)
            if (single.piece_patch[l.first_piece + i] == patch) area += polygon_area(points_of(scene.surfaces, scene.surfaces.pieces[l.first_piece + i]));
        if (area > most) most = area, best = patch;
    }
    for (std::uint32_t k = 0; k < l.piece_count; ++k)
        if (single.piece_patch[l.first_piece + k] == best) f.add_piece(scene.surfaces, scene.surfaces.pieces[l.first_piece + k]);
    return f;
}
// Pieces of one luxel that hang together, whatever the patches of a method are.
PatchTable single_luxels(const Scene& scene) { return build_patches(scene.world, scene.surfaces, scene.edges(), 1e-3); }
} // namespace

Scene::Scene(const World& w, const Surfaces& s, const std::vector<Light>& l) : world(w), surfaces(s), lights(l) {
    nothing_baked_.patch_index.assign(s.texel_count, kNoPatch);
    field_ = std::make_unique<LightField>(world, bsp_, planes_, surfaces, lights, nothing_baked_);
    edges_ = piece_adjacency(s);
}

Receiver receiver_at(Vec3 point, Vec3 normal, Vec3 tangent) {
    return {point, normal, directions_of({tangent, cross(normal, tangent), normal}), UINT32_MAX, Footprint()};
}

std::array<Vec3, 4> directions_at(const Scene& scene, FaceId id, Vec3 point) {
    const Face& face = scene.surfaces.faces[id.at()];
    return directions_of(face.chart.valid() ? light_frame(scene.surfaces, id, point) : face.tangent);
}

std::vector<Receiver> receivers_of(const Scene& scene, std::span<const std::uint32_t> luxels) {
    const PatchTable single = single_luxels(scene);
    std::vector<Receiver> out;
    out.reserve(luxels.size());
    for (const std::uint32_t i : luxels) {
        const Luxel& l = scene.surfaces.luxels[i];
        Receiver r;
        r.luxel = i;
        r.footprint = footprint_of(scene, single, i);
        r.normal = scene.surfaces.faces[l.face.at()].normal;
        r.point = r.footprint.empty() ? world_from_luxel(scene.surfaces, l.face, centroid_of(scene.surfaces, l)) : r.footprint.centroid();
        r.directions = directions_at(scene, l.face, r.point);
        out.push_back(std::move(r));
    }
    return out;
}

std::vector<std::uint32_t> shown_luxels(const Scene& scene, Context& context) {
    const Surfaces& s = scene.surfaces;
    std::vector<std::uint32_t> candidates;
    for (std::uint32_t i = 0; i < s.luxels.size(); ++i) {
        const Face& face = s.faces[s.luxels[i].face.at()];
        if (!face.curved() && face.drawn && !face.sky && max_component(scene.world.materials[face.material.at()].reflectance) > 0) candidates.push_back(i);
    }
    const std::vector<Receiver> receivers = receivers_of(scene, candidates);
    std::vector<std::uint8_t> shown(candidates.size());
    parallel_for(context, candidates.size(), [&](std::size_t i) {
        const Receiver& r = receivers[i];
        if (r.footprint.empty()) return;
        const Sobol points(seed_at(r.point, 91));
        const Frame frame = frame_around(r.normal);
        std::uint32_t back = 0;
        for (std::uint32_t k = 0; k < kTestRays; ++k) {
            const Vec3 from = r.footprint.sample(points.pair(k, 2)).position + r.normal * scene.trace().push_off();
            const auto hit = scene.trace().closest(from, frame.world(cosine_hemisphere(points.pair(k, 0))));
            back += hit && hit->back;
        }
        shown[i] = 8 * back < kTestRays;
    });
    std::vector<std::uint32_t> out;
    for (std::size_t i = 0; i < candidates.size(); ++i)
        if (shown[i]) out.push_back(candidates[i]);
    return out;
}

} // namespace kiln::rivals

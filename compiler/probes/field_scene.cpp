// The scene of a baked map: rays of the light's scene, radiance of its field.
#include "compiler/probes/probe_scene.h"

namespace kiln::probes {

ProbeScene scene_of(const Surfaces& surfaces, const LightField& field) {
    ProbeScene scene;
    const TraceScene& trace = field.scene();
    constexpr double kWidth = 2.0 / 256; // of a ray, a unit of way: two a side in the texels of a face of 128
    scene.radiance = [&field](Vec3 origin, std::span<const Vec3> directions, std::span<Rgb> out) { field.radiance(origin, directions, out, kWidth); };
    scene.closest = [&surfaces, &trace](Vec3 origin, Vec3 direction) -> std::optional<ProbeHit> {
        const auto hit = trace.closest(origin, direction);
        if (!hit) return std::nullopt;
        ProbeHit out{hit->distance, -direction, hit->sky, hit->back};
        if (hit->face.valid()) {
            const Vec3 n = surfaces.faces[hit->face.at()].normal;
            out.normal = dot(n, direction) > 0 ? -n : n;
        }
        return out;
    };
    scene.clear = [&trace](Vec3 from, Vec3 to) { return !trace.occluded(from, to); };
    return scene;
}

bool is_open(const BspLeaf& leaf) { return leaf.cluster.valid() && !leaf.outside && leaf.contents != Contents::solid; }

} // namespace kiln::probes

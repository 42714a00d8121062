// What a LightField holds; shared with the path tracer of this folder.
#pragma once
#include "compiler/light/bake.h"

namespace kiln {

constexpr double kNearLuxels = 1.5; // of the lightmap: nearer surfaces are looked at in more detail than it has
constexpr int kNearBounces = 6;     // in a crevice; then the lightmap will do

struct LightField::Data {
    const World& world;
    const Surfaces& surfaces;
    const std::vector<Light>& lights;
    const Lighting& lighting;
    TraceScene scene;
    LuxelIndex index;
    EmitterSet emitters;
    Rgbd sky;
    std::vector<Rgb> texel_reflected, patch_reflected; // radiance
    // Parts to look at: the patches, then boxes of the world for the lights that reach them.
    static constexpr std::uint32_t kBoxes = 8; // along each axis
    Box3 bounds{};
    std::size_t part_count() const { return lighting.patches.size() + kBoxes * kBoxes * kBoxes; }
    std::uint32_t lights_part(Vec3 x) const;
    double near_reach = 0; // map units: no path leaves a point further than this before the bake answers for it

    // Radiance reflected at a hit: the luxel's, or the patch's where a texel is shared by several.
    Rgbd reflected(const SceneHit& hit, Looked* looked = nullptr) const;
    // The same from the lightmap as it is displayed; with what the face emits.
    Rgbd lit(const SceneHit& hit) const;
    Rgbd shown(const SceneHit& hit, Vec3 direction) const;
    // Is a hit so close to where its ray began that the light of its luxel is no good answer?
    bool is_near(const SceneHit& hit) const;
    // The emitter that shines from a hit, seen from its front; UINT32_MAX: none.
    std::uint32_t emitter(const SceneHit& hit, Vec3 direction) const;
    // Where rays from a point on a surface start: pushed off the face it lies on, wherever the given point was
    // rounded to.
    Vec3 origin_at(Vec3 point, Vec3 normal) const;
};

} // namespace kiln

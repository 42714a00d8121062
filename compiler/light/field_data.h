// What a LightField holds; shared with the path tracer of this folder.
#pragma once
#include "compiler/light/bake.h"
#include <mutex>

namespace kiln {

constexpr double kNearLuxels = 1.5; // of the lightmap: nearer surfaces are looked at in more detail than it has
constexpr int kNearBounces = 6;     // in a crevice; then the lightmap will do
constexpr int kNearSteps = 3;       // of kNearLuxels, from the point: further off it will do, too. What a path may meet decides which lamps it depends on

struct LightField::Data {
    Data(const World& world, const Bsp& bsp, const Surfaces& surfaces, const std::vector<Light>& lights, const Lighting& lighting, const Visibility* seen);
    const World& world;
    const Surfaces& surfaces;
    const std::vector<Light>& lights;
    const Lighting& lighting;
    TraceScene scene;
    LuxelIndex index;
    EmitterSet emitters;
    LightSight sight;
    Rgbd sky;
    std::vector<std::uint32_t> texel_place; // of luxels of one piece; else kBlack
    std::vector<Rgb> place_reflected; // radiance, by places: pieces of luxels, then faces (which answer where there is no chart)
    // Parts to look at: places, then boxes of the world for the lights that reach them, then all that shines or reflects.
    static constexpr std::uint32_t kBoxes = 16; // along each axis
    Box3 bounds{};
    std::once_flag states_told;
    std::vector<std::uint64_t> states; // of the parts, when they are asked for
    void tell_states();
    std::size_t part_count() const { return emitters_part() + std::size_t{1}; }
    std::uint32_t lights_part(Vec3 x) const;
    std::uint32_t emitters_part() const { return static_cast<std::uint32_t>(place_reflected.size()) + kBoxes * kBoxes * kBoxes; }
    double near_reach = 0; // map units: further off than this from a point the bake answers for what its paths meet

    // Where a hit lies; of a place radiance reflected there.
    std::uint32_t place_at(const SceneHit& hit) const;
    Rgbd reflected(std::uint32_t place) const;
    // Of a hit, from the lightmap as it is displayed; with what the face emits.
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

// What a LightField holds; shared with the path tracer of this folder.
#pragma once
#include "compiler/light/bake.h"
#include <mutex>

namespace kiln {

constexpr double kNearLuxels = 1.5; // of the lightmap: nearer surfaces are looked at in more detail than it has
constexpr double kCrevice = 0.25;   // luxels: nearer than that even light says nothing, for what lies in a crevice may be a small part of its luxel
constexpr double kEven = 2;         // targets by which luxels side by side may differ where their light will do close by, too
constexpr int kNearBounces = 6;     // in a crevice; then the lightmap will do

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
    std::vector<std::uint8_t> place_even; // by pieces: is light even there, as luxels around tell?
    void tell_even_places(double floor);
    std::vector<Rgb> place_reflected; // radiance, by places: pieces of luxels, then faces (which answer where there is no chart)
    // Parts to look at: places; all that shines or reflects; of each piece whether light is even there; of each piece the entities that light its patch. How pieces make
    // patches depends on light, too: nothing here goes by the number of a patch.
    std::once_flag states_told;
    std::vector<std::uint64_t> states; // of the parts, when they are asked for
    void tell_states();
    std::uint32_t emitters_part() const { return static_cast<std::uint32_t>(place_reflected.size()); }
    std::uint32_t even_part(std::uint32_t piece) const { return emitters_part() + 1 + piece; }
    std::uint32_t entities_part(std::uint32_t piece) const { return even_part(piece) + static_cast<std::uint32_t>(surfaces.pieces.size()); }
    std::size_t part_count() const { return entities_part(static_cast<std::uint32_t>(surfaces.pieces.size())); }
    std::span<const LightBrings> entities_of_patch(std::size_t patch) const {
        const std::uint32_t first = lighting.first_brought[patch];
        return std::span(lighting.brought).subspan(first, lighting.first_brought[patch + 1] - first);
    }
    std::span<const LightBrings> entities_of(std::uint32_t piece) const { return entities_of_patch(lighting.piece_patch[piece]); }

    // Where a hit lies; of a place radiance reflected there.
    std::uint32_t place_at(const SceneHit& hit) const;
    Rgbd reflected(std::uint32_t place) const;
    // Of a hit, from the lightmap as it is displayed; with what the face emits.
    Rgbd lit(const SceneHit& hit) const;
    Rgbd shown(const SceneHit& hit, Vec3 direction) const;
    // Is a hit so close to where its ray began, and the light there so uneven, that its luxel is no good answer? What shows its back has no other: all that is known of it is its front.
    bool is_near(const SceneHit& hit, Vec3 direction, Looked* looked) const;
    // The emitter that shines from a hit, seen from its front; UINT32_MAX: none.
    std::uint32_t emitter(const SceneHit& hit, Vec3 direction) const;
    // Where rays from a point on a surface start: pushed off the face it lies on, wherever the given point was
    // rounded to.
    Vec3 origin_at(Vec3 point, Vec3 normal) const;
};

} // namespace kiln

// What probes ask of the world, so that each part can be tried in worlds with closed-form answers.
#pragma once
#include "compiler/probes/cubemap.h"
#include <functional>
#include <span>

namespace kiln::probes {

struct ProbeHit {
    double distance = 0; // map units
    Vec3 normal;         // unit, towards where the ray came from
    bool sky = false, back = false;
};
struct ProbeScene {
    std::function<void(Vec3 origin, std::span<const Vec3> unit_directions, std::span<Rgb> out)> radiance;
    std::function<std::optional<ProbeHit>(Vec3 origin, Vec3 unit_direction)> closest;
    std::function<bool(Vec3 from, Vec3 to)> clear;
};

CubeImage render(const ProbeScene& scene, Vec3 position, std::uint32_t size, std::uint32_t supersample,
                 std::uint64_t seed, Context& context);
// The box of walls around a place, if most of what it sees lies on one.
std::optional<Box3> fit_box(const ProbeScene& scene, Vec3 position);

// Where assignment looks from: some points just in front of a face, or in a leaf.
struct Receiver {
    std::vector<Vec3> points;
    Vec3 normal{};                        // of the face; zero: a leaf, which faces every way
    std::uint32_t leaf = UINT32_MAX;      // that holds its first point
    std::uint32_t explicit_probe = UINT32_MAX; // named by an entity
};
// way(probe, leaf): length of the shortest way through portals, infinite where there is none.
std::uint32_t choose_probe(const ProbeScene& scene, const std::vector<Probe>& probes, const Receiver& receiver,
                           const std::function<double(std::uint32_t probe, std::uint32_t leaf)>& way);
// Lengths of the ways through portals from a leaf to all others; infinity: none.
std::vector<double> ways_from(const Bsp& bsp, std::uint32_t leaf, Vec3 position);
// A good place for the only probe: far from everything near the middle of where players are.
std::optional<Vec3> default_place(const World& world, const Bsp& bsp, const PlaneTable& planes, const ProbeScene& scene);
ProbeScene scene_of(const Surfaces& surfaces, const LightField& field);
bool is_open(const BspLeaf& leaf);

} // namespace kiln::probes

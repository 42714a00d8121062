// What the lattice asks of the world, so that it can be tried in worlds with closed-form answers: where air is, what
// sees what, and which light arrives. air_of() answers from the BSP and the baked light.
#pragma once
#include "compiler/ambient/ambient.h"
#include "compiler/light/memo.h"
#include <array>
#include <functional>
#include <span>
#include <vector>

namespace kiln::ambient {

using Cube6 = std::array<Rgbd, 6>; // irradiance on planes that face x, -x, y, -y, z, -z
Cube6 operator+(const Cube6& a, const Cube6& b);
Cube6 operator-(const Cube6& a, const Cube6& b);
Cube6 operator*(const Cube6& a, double s);
double dot(const Cube6& a, const Cube6& b);
void add(Cube6& cube, Vec3 direction, Rgbd weight); // weight: radiance times solid angle

constexpr std::uint32_t kNoLeaf = UINT32_MAX;
struct AirPart {           // an open leaf that may reach into a box
    std::uint32_t leaf = kNoLeaf;
    Box3 bounds;           // of the leaf, clipped to the box
};
struct AirHit {
    double distance = 0;   // map units
    Vec3 normal;           // unit, of the face hit
    bool back = false;     // met from behind: the ray started in something solid
};
struct HalfSpace {         // dot(normal, p) <= distance
    Vec3 normal;           // unit
    double distance = 0;   // map units
};
struct DirectLight {
    Vec3 direction;        // unit, towards the light
    Rgbd irradiance;       // on a plane facing it, were it not occluded
};

struct Air {
    Box3 bounds;                                                      // all air lies in it; may be empty
    std::function<std::vector<AirPart>(const Box3&)> parts;           // sorted by leaf
    std::function<std::uint32_t(Vec3)> leaf_of;                       // kNoLeaf: not air
    // Just in front of what blocks light in the box and the half-spaces, and behind it where that is air too: one in the
    // middle of each triangle's part and one in each of its corners. May be empty: nothing to be found so.
    std::function<std::vector<Vec3>(const Box3&, const std::vector<HalfSpace>&)> beside_faces;
    std::function<std::optional<AirHit>(Vec3 origin, Vec3 unit_direction)> closest;
    std::function<bool(Vec3 from, Vec3 to)> clear;                    // symmetric
    // The same of many at once; may be empty. `closest_each` and `clear_each` ask either.
    std::function<void(Vec3 origin, std::span<const Vec3> unit_directions, std::span<std::optional<AirHit>> hits)> closest_of_many;
    std::function<void(std::span<const Vec3> from, std::span<const Vec3> to, std::span<std::uint8_t> hidden)> hidden;
    void closest_each(Vec3 origin, std::span<const Vec3> unit_directions, std::span<std::optional<AirHit>> hits) const {
        if (closest_of_many) return closest_of_many(origin, unit_directions, hits);
        for (std::size_t i = 0; i < hits.size(); ++i) hits[i] = closest(origin, unit_directions[i]);
    }
    void clear_each(std::span<const Vec3> from, std::span<const Vec3> to, std::vector<std::uint8_t>& is_clear) const {
        is_clear.resize(from.size());
        if (hidden) hidden(from, to, is_clear);
        for (std::size_t i = 0; i < from.size(); ++i) is_clear[i] = hidden ? !is_clear[i] : clear(from[i], to[i]);
    }
    std::function<Cube6(Vec3 point, std::uint32_t rays, std::uint64_t seed)> rest; // all but entity lights
    Memo* memo = nullptr; // of an earlier lattice in the same geometry; none: nothing is kept
    std::function<std::uint64_t(std::uint32_t light)> comes_from; // with a memo: a hash of where its light comes from
    std::uint32_t light_count = 0;
    std::function<void(Vec3 point, const std::function<void(std::uint32_t light)>&)> each_light; // that may reach it, ascending
    std::function<std::optional<DirectLight>(std::uint32_t light, Vec3 point)> direct;
    std::function<bool(std::uint32_t light, Vec3 point)> light_clear; // does the light reach the point?
    std::function<Rgbd(std::uint32_t light, Vec3 point)> light_through; // what panes on the way leave of one that does; empty: all
};

// With a memo: what rays met in it is taken over, too.
Air air_of(const Bsp& bsp, const PlaneTable& planes, const Surfaces& surfaces, const std::vector<Light>& lights,
           const LightField& field, Memo* memo = nullptr);
// The lattice over that air. `place_ambient` is build_lattice(air_of(...)).
Ambient build_lattice(const Air& air, const AmbientOptions& options, Context& context);

} // namespace kiln::ambient

// A world of axis-aligned boxes in one big room, with light as a function of the place hit: visibility and radiance
// in closed form, for the laws of ambient cubes.
#pragma once
#include "compiler/ambient/air.h"
#include "libs/core/hash.h"
#include <numbers>

namespace kiln::ambient {

struct BoxWorld {
    Box3 room;
    std::vector<Box3> solids;
    std::function<Rgbd(Vec3 position, Vec3 direction)> radiance; // of what a ray meets
    struct Lamp {
        Vec3 position;
        Rgbd intensity;
    };
    std::vector<Lamp> lamps; // E = intensity / d^2

    static bool inside(const Box3& b, Vec3 p) {
        for (std::size_t a = 0; a < 3; ++a)
            if (p[a] <= b.lo[a] || p[a] >= b.hi[a]) return false;
        return true;
    }
    bool in_air(Vec3 p) const {
        if (!inside(room, p)) return false;
        return std::none_of(solids.begin(), solids.end(), [&](const Box3& b) {
            for (std::size_t a = 0; a < 3; ++a)
                if (p[a] < b.lo[a] || p[a] > b.hi[a]) return false;
            return true;
        });
    }
    std::optional<AirHit> closest(Vec3 o, Vec3 d) const {
        AirHit best;
        best.distance = 1e30;
        const auto meet = [&](const Box3& b, bool hollow) {
            double enter = -1e30, leave = 1e30;
            std::size_t enter_axis = 0, leave_axis = 0;
            for (std::size_t a = 0; a < 3; ++a) {
                if (d[a] == 0) {
                    if (o[a] <= b.lo[a] || o[a] >= b.hi[a]) return;
                    continue;
                }
                double t0 = (b.lo[a] - o[a]) / d[a], t1 = (b.hi[a] - o[a]) / d[a];
                if (t0 > t1) std::swap(t0, t1);
                if (t0 > enter) enter = t0, enter_axis = a;
                if (t1 < leave) leave = t1, leave_axis = a;
            }
            if (enter >= leave) return;
            const bool from_inside = enter < 0;
            const double t = from_inside ? leave : enter;
            if (t <= 0 || t >= best.distance) return;
            const std::size_t axis = from_inside ? leave_axis : enter_axis;
            best.distance = t, best.back = from_inside != hollow, best.normal = {};
            best.normal[axis] = d[axis] > 0 ? -1 : 1; // towards the viewer
        };
        meet(room, true);
        for (const Box3& b : solids) meet(b, false);
        if (best.distance > 1e29) return std::nullopt;
        return best;
    }
    bool clear(Vec3 from, Vec3 to) const {
        const double far = length(to - from);
        if (!(far > 0)) return true;
        const auto hit = closest(from, (to - from) / far);
        return !hit || hit->distance >= far * (1 - 1e-12);
    }
};

// Equal-weight directions that integrate polynomials of degree two (and odd ones without xyz) exactly: orbits of
// random directions under the rotations of the tetrahedron.
inline std::vector<Vec3> exact_directions(std::size_t orbits, std::uint64_t seed) {
    std::vector<Vec3> out;
    for (std::size_t i = 0; i < orbits; ++i) {
        const double phase = double(mix(seed, std::uint64_t(1)) >> 11) * 0x1p-53;
        const double shift = double(mix(seed, std::uint64_t(2)) >> 11) * 0x1p-53;
        const double z = 1 - 2 * (double(i) + shift) / double(orbits);
        const double u = std::fmod(phase + 0.6180339887498949 * double(i), 1.0);
        const double r = std::sqrt(std::max(0.0, 1 - z * z)), phi = 2 * std::numbers::pi * u;
        Vec3 d{r * std::cos(phi), r * std::sin(phi), z};
        for (int cycle = 0; cycle < 3; ++cycle, d = {d.y, d.z, d.x})
            for (const Vec3 s : {Vec3{1, 1, 1}, Vec3{1, -1, -1}, Vec3{-1, 1, -1}, Vec3{-1, -1, 1}}) out.push_back(d * s);
    }
    return out;
}

inline Air air_of(const BoxWorld& world) {
    Air air;
    air.bounds = world.room;
    air.parts = [&world](const Box3& box) {
        AirPart part{0, box};
        for (std::size_t a = 0; a < 3; ++a) {
            part.bounds.lo[a] = std::max(part.bounds.lo[a], world.room.lo[a]);
            part.bounds.hi[a] = std::min(part.bounds.hi[a], world.room.hi[a]);
            if (part.bounds.lo[a] >= part.bounds.hi[a]) return std::vector<AirPart>{};
        }
        return std::vector<AirPart>{part};
    };
    air.leaf_of = [&world](Vec3 p) { return world.in_air(p) ? 0u : kNoLeaf; };
    air.closest = [&world](Vec3 o, Vec3 d) { return world.closest(o, d); };
    air.clear = [&world](Vec3 a, Vec3 b) { return world.clear(a, b); };
    air.rest = [&world](Vec3 p, std::uint32_t rays, std::uint64_t seed) {
        Cube6 sum{};
        const auto directions = exact_directions((rays + 11) / 12, seed);
        const double weight = 4 * std::numbers::pi / double(directions.size());
        for (const Vec3& d : directions) {
            const auto hit = world.closest(p, d);
            const Rgbd l = world.radiance(hit ? p + d * hit->distance : p, d);
            add(sum, d, l * weight);
        }
        return sum;
    };
    air.light_count = static_cast<std::uint32_t>(world.lamps.size());
    air.each_light = [&world](Vec3, const std::function<void(std::uint32_t)>& visit) {
        for (std::uint32_t l = 0; l < world.lamps.size(); ++l) visit(l);
    };
    air.direct = [&world](std::uint32_t l, Vec3 p) -> std::optional<DirectLight> {
        const Vec3 to = world.lamps[l].position - p;
        const double d2 = dot(to, to);
        if (!(d2 > 0)) return std::nullopt;
        return DirectLight{to / std::sqrt(d2), world.lamps[l].intensity / std::max(d2, 1.0)};
    };
    air.light_clear = [&world](std::uint32_t l, Vec3 p) { return world.clear(p, world.lamps[l].position); };
    return air;
}

// Reproducible points of the air.
inline std::vector<Vec3> air_points(const BoxWorld& world, std::size_t n, std::uint64_t seed) {
    std::vector<Vec3> points;
    for (std::uint64_t i = 0; points.size() < n; ++i) {
        Vec3 p;
        for (std::size_t a = 0; a < 3; ++a)
            p[a] = world.room.lo[a] + world.room.size()[a] * double(mix(seed, i, std::uint64_t(a)) >> 11) * 0x1p-53;
        if (world.in_air(p)) points.push_back(p);
    }
    return points;
}

} // namespace kiln::ambient

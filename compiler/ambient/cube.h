// One cube at one place: gathered light in two independent halves (their difference tells the noise) and the entity
// lights that reach it.
#pragma once
#include "compiler/ambient/air.h"

namespace kiln::ambient {

struct Gathered {
    Cube6 a{}, b{};            // each an estimate by itself
    std::uint32_t rays = 0;    // of both together
    Cube6 mean() const { return (a + b) * 0.5; }
    double noise2() const { const Cube6 d = a - b; return dot(d, d) / 4; } // variance of the mean, all faces and channels
};
// Adds `rays` more (two bundles of half as many).
void gather(const Air& air, Vec3 point, std::uint32_t rays, std::uint64_t seed, Gathered& into);

struct LitBy {
    std::uint32_t light = 0;
    DirectLight direct;
    bool filtered = false; // by panes, which is in `direct`: the run time does not know of them
};
// Entity lights that reach the point, those that panes filter last, strongest first (ties: first in the list). The faint end, together below
// 0.2 % of what arrives, is left out untested.
// `seed`: of this point alone.
std::vector<LitBy> reaching_lights(const Air& air, Vec3 point, std::uint64_t seed, double gathered_irradiance, std::uint64_t& rays);

// n directions spread evenly (Fibonacci spiral).
std::vector<Vec3> spread_directions(std::size_t n);

} // namespace kiln::ambient

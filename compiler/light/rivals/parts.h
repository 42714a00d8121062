// What the methods share. Private to this folder.
#pragma once
#include "compiler/light/field_data.h"
#include "compiler/light/rivals/rivals.h"
#include <atomic>

namespace kiln::rivals {

using Polygon = std::vector<Vec3>; // convex, counter-clockwise seen from its front

Vec3 moment_of(const Polygon& polygon, double* area); // integral of the place over it

// A flat piece that sends light: a patch, or part of an emitter.
struct Element {
    Vec3 point, normal; // its middle, on the surface
    double area = 0;
    std::vector<Polygon> parts;
};

// Uniform patches with a point to stand for each, and the emitters cut to the same size.
struct PatchSet {
    PatchTable table;
    std::vector<Element> elements;              // per patch
    std::vector<std::array<Vec3, 4>> directions; // per patch
    std::vector<Rgbd> reflectance;              // per patch
    struct Lamp {
        Element element;
        Rgbd radiance;
    };
    std::vector<Lamp> lamps;
    std::vector<std::uint32_t> luxel_patch; // per luxel
    std::uint64_t bytes() const;
};
PatchSet uniform_patches(const Scene& scene, double size);

// Rows of form factors.
struct Row {
    std::vector<std::uint32_t> patch;
    std::vector<float> factor;
};
// H = direct + F rho H, Jacobi in fixed order until the bound on the error is 1e-4 of the largest.
std::vector<Rgbd> solve_rows(const std::vector<Row>& rows, const std::vector<Rgbd>& direct, const std::vector<Rgbd>& reflectance, Context& context);

// The four directions at a point of a face.
std::array<Vec3, 4> directions_at(const Scene& scene, FaceId face, Vec3 point);
// Light entities at a point, and the number of rays it took.
Irradiance entities_at(const Scene& scene, Vec3 point, Vec3 normal, const std::array<Vec3, 4>& directions, std::uint64_t seed, std::atomic<std::uint64_t>& rays);
inline void add(Irradiance& sum, const std::array<Vec3, 4>& directions, Vec3 way, Rgbd weight) { // weight: radiance times solid angle
    for (std::size_t k = 0; k < 4; ++k) sum[k] += weight * std::max(0.0, dot(way, directions[k]));
}
inline std::uint64_t seed_at(Vec3 point, std::uint64_t seed) { return mix_place(point, seed); }

} // namespace kiln::rivals

// Cube maps as arrays: texels, solid angles, mips, seamless lookups, and the GGX prefilter.
#pragma once
#include "compiler/probes/probes.h"

namespace kiln::probes {

struct CubeImage { // one level: 6 faces of size^2 texels, face-major, rows
    std::uint32_t size = 0;
    std::vector<Rgb> texels;
    const Rgb& at(int face, std::uint32_t i, std::uint32_t j) const { return texels[(std::size_t(face) * size + j) * size + i]; }
    Rgb& at(int face, std::uint32_t i, std::uint32_t j) { return texels[(std::size_t(face) * size + j) * size + i]; }
};

double solid_angle(std::uint32_t size, std::uint32_t i, std::uint32_t j); // of a texel, exact: a face sums to 4 pi / 6
Vec3 texel_direction(std::uint32_t size, int face, std::uint32_t i, std::uint32_t j); // unit, of its centre
Rgbd bilinear(const CubeImage& image, Vec3 direction);   // across the edges of faces too
CubeImage half_size(const CubeImage& image);             // means weighted by solid angle
Rgbd mean_radiance(const CubeImage& image);              // over the sphere

std::uint32_t mip_count(std::uint32_t size);
// All mips of a rendered cube, mip-major: what Probe::texels holds.
std::vector<Rgb> prefilter(const CubeImage& rendered, std::uint32_t samples, Context& context);

} // namespace kiln::probes

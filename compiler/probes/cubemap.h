// Cube maps as arrays: texels, solid angles, mips, seamless lookups, and the GGX prefilter.
#pragma once
#include "compiler/probes/probes.h"
#include "libs/math/quick.h"

namespace kiln::probes {

struct CubeImage { // one level: 6 faces of size^2 texels, face-major, rows
    std::uint32_t size = 0;
    std::vector<Rgb> texels;
    const Rgb& at(int face, std::uint32_t i, std::uint32_t j) const { return texels[(std::size_t(face) * size + j) * size + i]; }
    Rgb& at(int face, std::uint32_t i, std::uint32_t j) { return texels[(std::size_t(face) * size + j) * size + i]; }
};

double solid_angle(std::uint32_t size, std::uint32_t i, std::uint32_t j); // of a texel, exact: a face sums to 4 pi / 6
Vec3 texel_direction(std::uint32_t size, int face, std::uint32_t i, std::uint32_t j); // unit, of its centre
class SeamlessCube { // of texels with those beside each face around it
public:
    explicit SeamlessCube(const CubeImage& image);
    QuickLight bilinear(int face, double u, double v) const { // across the edges of faces too
        const double x = (u + 1) / 2 * size_ + 0.5, y = (v + 1) / 2 * size_ + 0.5; // in texels of the face with its rim
        const auto i = static_cast<std::uint32_t>(x), j = static_cast<std::uint32_t>(y);
        const double tx = x - i, ty = y - j;
        const QuickLight* t = &texels_[at(face, i, j)];
        const QuickLight* below = t + size_ + 2;
        return t[0] * ((1 - tx) * (1 - ty)) + t[1] * (tx * (1 - ty)) + below[0] * ((1 - tx) * ty) + below[1] * (tx * ty);
    }

private:
    std::size_t at(int face, std::uint32_t x, std::uint32_t y) const { return (std::size_t(face) * (size_ + 2) + y) * (size_ + 2) + x; }
    std::uint32_t size_;
    std::vector<QuickLight> texels_;
};
CubeImage half_size(const CubeImage& image);             // means weighted by solid angle
Rgbd mean_radiance(const CubeImage& image);              // over the sphere

std::uint32_t mip_count(std::uint32_t size);
// All mips of a rendered cube, mip-major: what Probe::texels holds.
std::vector<Rgb> prefilter(const CubeImage& rendered, std::uint32_t samples, Context& context);

} // namespace kiln::probes

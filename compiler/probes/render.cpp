#include "compiler/probes/probe_scene.h"
#include "libs/core/hash.h"
#include "libs/parallel/parallel.h"

namespace kiln::probes {

// Stratified rays over each texel, weighted by the solid angle element 1 / (1 + u^2 + v^2)^(3/2).
CubeImage render(const ProbeScene& scene, Vec3 position, std::uint32_t size, std::uint32_t supersample,
                 std::uint64_t seed, Context& context) {
    CubeImage image;
    image.size = size;
    image.texels.resize(std::size_t(6) * size * size);
    const std::uint32_t k = std::clamp(supersample, 1u, 16u);
    parallel_for(context, "probes", std::size_t(6) * size, [&](std::size_t row) {
        const int face = static_cast<int>(row / size);
        const auto j = static_cast<std::uint32_t>(row % size);
        // All rays of a row of texels together: they lie close to each other.
        std::vector<Vec3> directions;
        std::vector<double> weights;
        for (std::uint32_t i = 0; i < size; ++i)
            for (std::uint32_t s = 0; s < k * k; ++s) {
                const std::uint64_t h = mix(seed, std::uint64_t(row), std::uint64_t(i), std::uint64_t(s));
                const double jx = double(h >> 40) * 0x1p-24, jy = double(h & 0xFFFFFF) * 0x1p-24;
                const double u = 2 * (i + (s % k + jx) / k) / size - 1, v = 2 * (j + (s / k + jy) / k) / size - 1;
                const double r2 = 1 + u * u + v * v;
                directions.push_back(normalize(cube_direction(face, u, v))), weights.push_back(1 / (r2 * std::sqrt(r2)));
            }
        std::vector<Rgb> radiance(directions.size());
        scene.radiance(position, directions, radiance);
        for (std::uint32_t i = 0; i < size; ++i) {
            Rgbd sum{};
            double weight = 0;
            for (std::size_t r = i * k * k; r < (i + 1) * k * k; ++r) sum += Rgbd(radiance[r]) * weights[r], weight += weights[r];
            image.at(face, i, j) = Rgb(sum / weight);
        }
    });
    return image;
}

} // namespace kiln::probes

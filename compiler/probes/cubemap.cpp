#include "compiler/probes/cubemap.h"
#include "libs/parallel/parallel.h"
#include <numbers>

namespace kiln {

Vec3 cube_direction(int face, double u, double v) {
    switch (face) {
    case 0: return {1, -v, -u};
    case 1: return {-1, -v, u};
    case 2: return {u, 1, v};
    case 3: return {u, -1, -v};
    case 4: return {u, -v, 1};
    default: return {-u, -v, -1};
    }
}

void cube_texel(Vec3 direction, int* face, double* u, double* v) {
    const double ax = std::abs(direction.x), ay = std::abs(direction.y), az = std::abs(direction.z);
    if (ax >= ay && ax >= az) {
        *face = direction.x < 0;
        *u = (direction.x < 0 ? direction.z : -direction.z) / ax, *v = -direction.y / ax;
    } else if (ay >= az) {
        *face = 2 + (direction.y < 0);
        *u = direction.x / ay, *v = (direction.y < 0 ? -direction.z : direction.z) / ay;
    } else {
        *face = 4 + (direction.z < 0);
        *u = (direction.z < 0 ? -direction.x : direction.x) / az, *v = -direction.y / az;
    }
}

namespace probes {

constexpr double kPi = std::numbers::pi;

double solid_angle(std::uint32_t size, std::uint32_t i, std::uint32_t j) {
    const auto corner = [](double x, double y) { return std::atan2(x * y, std::sqrt(x * x + y * y + 1)); };
    const double step = 2.0 / size, x0 = step * i - 1, y0 = step * j - 1, x1 = step * (i + 1) - 1, y1 = step * (j + 1) - 1;
    return corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0);
}

Vec3 texel_direction(std::uint32_t size, int face, std::uint32_t i, std::uint32_t j) {
    return normalize(cube_direction(face, 2 * (i + 0.5) / size - 1, 2 * (j + 0.5) / size - 1));
}

SeamlessCube::SeamlessCube(const CubeImage& image) : size_(image.size), texels_(6 * std::size_t{image.size + 2} * (image.size + 2)) {
    const double n = size_;
    const auto index = [n](double c) { return static_cast<std::uint32_t>(std::clamp(std::floor((c + 1) / 2 * n), 0.0, n - 1)); };
    for (int face = 0; face < 6; ++face)
        for (std::uint32_t y = 0; y < size_ + 2; ++y)
            for (std::uint32_t x = 0; x < size_ + 2; ++x) {
                const bool inside = x > 0 && y > 0 && x <= size_ && y <= size_;
                int from = face;
                double u = 0, v = 0; // past the edge: the texel of the neighbouring face in that direction
                if (!inside) cube_texel(cube_direction(face, 2 * (x - 0.5) / n - 1, 2 * (y - 0.5) / n - 1), &from, &u, &v);
                texels_[at(face, x, y)] = QuickLight(Rgbd(inside ? image.at(face, x - 1, y - 1) : image.at(from, index(u), index(v))));
            }
}

CubeImage half_size(const CubeImage& image) {
    CubeImage out;
    out.size = image.size / 2;
    out.texels.resize(std::size_t(6) * out.size * out.size);
    for (int face = 0; face < 6; ++face)
        for (std::uint32_t j = 0; j < out.size; ++j)
            for (std::uint32_t i = 0; i < out.size; ++i) {
                Rgbd sum{};
                double weight = 0;
                for (std::uint32_t k = 0; k < 4; ++k) {
                    const std::uint32_t x = 2 * i + (k & 1), y = 2 * j + (k >> 1);
                    const double w = solid_angle(image.size, x, y);
                    sum += Rgbd(image.at(face, x, y)) * w, weight += w;
                }
                out.at(face, i, j) = Rgb(sum / weight);
            }
    return out;
}

Rgbd mean_radiance(const CubeImage& image) {
    Rgbd sum{};
    for (int face = 0; face < 6; ++face)
        for (std::uint32_t j = 0; j < image.size; ++j)
            for (std::uint32_t i = 0; i < image.size; ++i)
                sum += Rgbd(image.at(face, i, j)) * solid_angle(image.size, i, j);
    return sum / (4 * kPi);
}

std::uint32_t mip_count(std::uint32_t size) {
    std::uint32_t mips = 1;
    while (size >> mips >= 4) ++mips;
    return mips;
}

namespace {

struct LobeSample {
    Vec3 direction; // around +z
    double weight = 0, lod = 0;
};

// GGX lobe around n = v = r: half vectors by their distribution (Hammersley points), light l = reflect(v, h) weighted
// by n.l; each sample reads the mip whose texels are as large as the share of the lobe it stands for.
std::vector<LobeSample> lobe(double alpha, std::uint32_t samples, std::uint32_t size) {
    std::vector<LobeSample> out;
    const double a2 = alpha * alpha, texel = 4 * kPi / (6.0 * size * size);
    for (std::uint32_t k = 0; k < samples; ++k) {
        const double x = (k + 0.5) / samples;
        std::uint32_t bits = k;
        bits = (bits << 16) | (bits >> 16);
        bits = ((bits & 0x55555555u) << 1) | ((bits & 0xAAAAAAAAu) >> 1);
        bits = ((bits & 0x33333333u) << 2) | ((bits & 0xCCCCCCCCu) >> 2);
        bits = ((bits & 0x0F0F0F0Fu) << 4) | ((bits & 0xF0F0F0F0u) >> 4);
        bits = ((bits & 0x00FF00FFu) << 8) | ((bits & 0xFF00FF00u) >> 8);
        const double phi = 2 * kPi * bits * 0x1p-32;
        const double cos2 = (1 - x) / (1 + (a2 - 1) * x), cos_h = std::sqrt(cos2), sin_h = std::sqrt(1 - cos2);
        const Vec3 h{sin_h * std::cos(phi), sin_h * std::sin(phi), cos_h};
        const Vec3 l = h * (2 * cos_h) - Vec3{0, 0, 1};
        if (l.z <= 0) continue;
        const double d = a2 / (kPi * (cos2 * (a2 - 1) + 1) * (cos2 * (a2 - 1) + 1)); // n.h = v.h: pdf(l) = D / 4
        const double share = 1 / (samples * d / 4);
        out.push_back({l, l.z, std::max(0.0, 0.5 * std::log2(share / texel))});
    }
    return out;
}

} // namespace

std::vector<Rgb> prefilter(const CubeImage& rendered, std::uint32_t samples, Context& context) {
    const std::uint32_t mips = mip_count(rendered.size);
    std::vector<Rgb> out = rendered.texels;
    std::vector<CubeImage> chain{rendered}; // plain means, down to one texel
    while (chain.back().size > 1) chain.push_back(half_size(chain.back()));
    const std::vector<SeamlessCube> levels(chain.begin(), chain.end());
    for (std::uint32_t m = 1; m < mips; ++m) {
        const double roughness = double(m) / (mips - 1);
        const auto samples_of = lobe(roughness * roughness, std::max(samples, 1u), rendered.size);
        double weight = 0;
        for (const LobeSample& s : samples_of) weight += s.weight;
        CubeImage mip;
        mip.size = rendered.size >> m;
        mip.texels.resize(std::size_t(6) * mip.size * mip.size);
        parallel_for(context, std::size_t(6) * mip.size, [&](std::size_t row) {
            const int face = static_cast<int>(row / mip.size);
            const auto j = static_cast<std::uint32_t>(row % mip.size);
            for (std::uint32_t i = 0; i < mip.size; ++i) {
                const Frame frame = frame_around(texel_direction(mip.size, face, i, j));
                QuickLight sum;
                for (const LobeSample& s : samples_of) {
                    int at = 0;
                    double u = 0, v = 0;
                    cube_texel(frame.world(s.direction), &at, &u, &v);
                    const double lod = std::min(s.lod, double(levels.size() - 1));
                    const auto fine = static_cast<std::size_t>(lod);
                    const double t = lod - double(fine);
                    sum += levels[fine].bilinear(at, u, v) * (s.weight * (1 - t));
                    if (t > 0) sum += levels[fine + 1].bilinear(at, u, v) * (s.weight * t);
                }
                mip.at(face, i, j) = Rgb(static_cast<Rgbd>(sum) / weight);
            }
        });
        out.insert(out.end(), mip.texels.begin(), mip.texels.end());
    }
    return out;
}

} // namespace probes
} // namespace kiln

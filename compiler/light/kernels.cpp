#include "compiler/light/kernels.h"
#include <map>
#include <numbers>

namespace kiln {
namespace {

struct ConeNormal {
    Vec3 n;
    double p = 0;
};

// Midpoint rule, uniform in solid angle; 48 x 96 normals put g within 1e-4 of its limit.
std::vector<ConeNormal> cone_normals(double cone_deg) {
    constexpr int kMu = 48, kPhi = 96;
    const double c = std::cos(cone_deg * std::numbers::pi / 180);
    std::vector<ConeNormal> out;
    for (int i = 0; i < kMu; ++i)
        for (int j = 0; j < kPhi; ++j) {
            const double mu = c + (1 - c) * (i + 0.5) / kMu, phi = 2 * std::numbers::pi * (j + 0.5) / kPhi;
            const double s = std::sqrt(1 - mu * mu);
            out.push_back({{s * std::cos(phi), s * std::sin(phi), mu}, 1.0 / (kMu * kPhi)});
        }
    return out;
}
std::array<double, 3> sq_weights(Vec3 n) {
    std::array<double, 3> w{};
    double sum = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        const double c = std::max(0.0, dot(kRnmBasis[i], n));
        sum += w[i] = c * c;
    }
    for (double& x : w) x /= sum > 0 ? sum : 1;
    return w;
}

} // namespace

ConeTable::ConeTable(RnmEncoding encoding, double cone_deg) : cone_deg_(cone_deg) {
    const std::vector<ConeNormal> normals = cone_normals(std::clamp(cone_deg, 1.0, 80.0));
    double xx = 0;
    for (const ConeNormal& c : normals) xx += c.p * c.n.x * c.n.x;
    tangential_.resize(kNodes + 1);
    for (int i = 0; i <= kNodes; ++i) {
        const double cosine = -1 + 2.0 * i / kNodes, sine = std::sqrt(std::max(1e-9, 1 - cosine * cosine));
        double sum = 0;
        for (const ConeNormal& c : normals)
            sum += c.p * c.n.x * (std::max(0.0, c.n.x * sine + c.n.z * cosine) - c.n.z * std::max(0.0, cosine));
        tangential_[static_cast<std::size_t>(i)] = sum / (xx * sine);
    }
    if (encoding != RnmEncoding::sq) return;
    double a = 0, b = 0;
    std::vector<std::array<double, 3>> weights;
    for (const ConeNormal& c : normals) {
        weights.push_back(sq_weights(c.n));
        const auto& w = weights.back();
        a += c.p * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) / 3;
        b += c.p * (w[0] * w[1] + w[1] * w[2] + w[2] * w[0]) / 3;
    }
    gram_scale_ = a - b;
    moment_.resize((kRows + 1) * kColumns);
    for (int i = 0; i <= kRows; ++i)
        for (int j = 0; j < kColumns; ++j) {
            const double z = -1 + 2.0 * i / kRows, s = std::sqrt(std::max(0.0, 1 - z * z));
            const double phi = 2 * std::numbers::pi * j / kColumns;
            const Vec3 w{s * std::cos(phi), s * std::sin(phi), z};
            double sum = 0;
            for (std::size_t k = 0; k < normals.size(); ++k)
                sum += normals[k].p * weights[k][0] * std::max(0.0, dot(normals[k].n, w));
            moment_[static_cast<std::size_t>(i * kColumns + j)] = static_cast<float>(sum);
        }
    // Over the upper half, trapezoidal in z, exact in azimuth for the interpolated table.
    for (int i = kRows / 2; i <= kRows; ++i)
        for (int j = 0; j < kColumns; ++j)
            uniform_moment_ += moment_[static_cast<std::size_t>(i * kColumns + j)] *
                               (i == kRows / 2 || i == kRows ? 0.5 : 1) * (2.0 / kRows) *
                               (2 * std::numbers::pi / kColumns);
}

double ConeTable::moment(double cos_theta, double azimuth_turns) const {
    const double x = std::clamp((cos_theta + 1) * 0.5 * kRows, 0.0, static_cast<double>(kRows));
    const double y = (azimuth_turns - std::floor(azimuth_turns)) * kColumns;
    const int i = std::min(static_cast<int>(x), kRows - 1), j = static_cast<int>(y) % kColumns,
              k = (j + 1) % kColumns;
    const double f = x - i, g = y - std::floor(y);
    const auto at = [&](int r, int c) {
        return static_cast<double>(moment_[static_cast<std::size_t>(r * kColumns + c)]);
    };
    return (1 - f) * ((1 - g) * at(i, j) + g * at(i, k)) + f * ((1 - g) * at(i + 1, j) + g * at(i + 1, k));
}

void LuxelKernel::fields(ByteWriter& w) const {
    w(frame, encoding, cone ? cone->cone_deg() : -1.0);
}

std::array<double, 4> LuxelKernel::integrals() const {
    constexpr double pi = std::numbers::pi;
    if (!cone) return {pi, 0, 0, 0};
    const double k = encoding == RnmEncoding::dot      ? pi * kInvSqrt3
                     : encoding == RnmEncoding::tilted ? pi * (1 + kInvSqrt3) / 2
                                                       : cone->uniform_moment();
    return {pi, k, k, k};
}

std::array<Rgb, 3> LuxelKernel::finish(const KernelSum& sum) const {
    std::array<Rgb, 3> out{};
    if (encoding != RnmEncoding::sq) {
        for (std::size_t i = 0; i < 3; ++i) out[i] = static_cast<Rgb>(sum.rnm[i]);
        return out;
    }
    // Minimise l'Gl/2 - m'l with mean(l) = E(z), l >= 0. By symmetry G = (a-b) I + b 11', and 1'l is fixed, so this
    // is the projection of m/(a-b) on the simplex {l >= 0, sum = 3 E(z)}.
    for (std::size_t c = 0; c < 3; ++c) {
        std::array<double, 3> v{};
        for (std::size_t i = 0; i < 3; ++i) v[i] = sum.rnm[i][c] / cone->gram_scale();
        std::array<double, 3> sorted = v;
        std::sort(sorted.begin(), sorted.end(), std::greater<>());
        const double total = 3 * std::max(0.0, sum.flat[c]);
        double partial = 0, shift = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            partial += sorted[k];
            const double s = (total - partial) / static_cast<double>(k + 1);
            if (sorted[k] + s > 0 || k == 0) shift = s;
        }
        for (std::size_t i = 0; i < 3; ++i) out[i][c] = static_cast<float>(std::max(0.0, v[i] + shift));
    }
    return out;
}

std::array<Rgbd, 4> LuxelKernel::shown(const KernelSum& sum) const {
    std::array<Rgbd, 3> stored = sum.rnm;
    if (cone && encoding == RnmEncoding::sq) {
        const std::array<Rgb, 3> finished = finish(sum);
        for (std::size_t i = 0; i < 3; ++i) stored[i] = static_cast<Rgbd>(finished[i]);
    }
    return shown(sum.flat, stored);
}

std::array<Rgbd, 4> LuxelKernel::shown(Rgbd flat_light, const std::array<Rgbd, 3>& stored) const {
    std::array<Rgbd, 4> out{flat_light};
    for (std::size_t i = 0; cone && i < 3; ++i) {
        if (encoding == RnmEncoding::tilted) {
            out[i + 1] = stored[i];
            continue;
        }
        const Vec3 flat{kRnmBasis[i].x, kRnmBasis[i].y, 0};
        const Vec3 n = flat * (kTypicalTilt / length(flat)) + Vec3{0, 0, std::sqrt(1 - kTypicalTilt * kTypicalTilt)};
        std::array<double, 3> w{};
        if (encoding == RnmEncoding::sq) w = sq_weights(n);
        for (std::size_t k = 0; k < 3; ++k) out[i + 1] += stored[k] * (encoding == RnmEncoding::sq ? w[k] : dot(kRnmBasis[k], n));
    }
    return out;
}

void follow_flat(RnmEncoding encoding, Rgbd flat, std::array<Rgbd, 3>& rnm) {
    if (encoding == RnmEncoding::tilted) return;
    const bool sq = encoding == RnmEncoding::sq;
    for (std::size_t c = 0; c < 3; ++c) {
        std::array<double, 3> v{rnm[0][c], rnm[1][c], rnm[2][c]}, sorted = v;
        const double total = (sq ? 3.0 : std::sqrt(3.0)) * flat[c];
        double shift = (total - v[0] - v[1] - v[2]) / 3;
        if (sq) { // the nearest without a negative one, as LuxelKernel::finish
            std::sort(sorted.begin(), sorted.end(), std::greater<>());
            double partial = 0;
            for (std::size_t k = 0; k < 3; ++k) {
                partial += sorted[k];
                const double by = (total - partial) / static_cast<double>(k + 1);
                if (k == 0 || sorted[k] + by > 0) shift = by;
            }
        }
        for (std::size_t i = 0; i < 3; ++i) rnm[i][c] = sq ? std::max(0.0, v[i] + shift) : v[i] + shift;
    }
}

Rgbd rnm_evaluate(RnmEncoding encoding, const std::array<Rgb, 3>& stored, Vec3 n) {
    Rgbd e;
    if (encoding == RnmEncoding::sq) {
        const auto w = sq_weights(n);
        for (std::size_t i = 0; i < 3; ++i) e += static_cast<Rgbd>(stored[i]) * w[i];
        return e;
    }
    for (std::size_t i = 0; i < 3; ++i) e += static_cast<Rgbd>(stored[i]) * dot(kRnmBasis[i], n);
    return {std::max(0.0, e.x), std::max(0.0, e.y), std::max(0.0, e.z)};
}

std::vector<std::shared_ptr<const ConeTable>> cone_tables(const World& world, const Surfaces& surfaces, Directional directional, RnmEncoding encoding) {
    constexpr double kUsual_deg = 30;
    std::map<double, std::shared_ptr<const ConeTable>> tables;
    std::vector<std::shared_ptr<const ConeTable>> out(surfaces.charts.size());
    for (std::size_t c = 0; c < surfaces.charts.size(); ++c) {
        bool wanted = directional == Directional::all;
        double cone = 0;
        for (const FaceId f : surfaces.charts[c].faces) {
            const Material& m = world.materials[surfaces.faces[f.at()].material.at()];
            if (m.normal_map.empty()) continue;
            wanted |= directional == Directional::needed;
            cone = std::max(cone, m.normal_cone_deg);
        }
        if (!wanted) continue;
        if (!(cone > 0)) cone = kUsual_deg;
        auto& table = tables[cone];
        if (!table) table = std::make_shared<ConeTable>(encoding, cone);
        out[c] = table;
    }
    return out;
}

} // namespace kiln

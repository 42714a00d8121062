// The encodings as laws: what they do to light that is known.
#include "compiler/light/kernels.h"
#include "libs/sampling/maps.h"
#include "libs/sampling/sobol.h"
#include <gtest/gtest.h>
#include <numbers>

using namespace kiln;

namespace {
constexpr double kPi = std::numbers::pi;
Vec3 at(double theta_deg, double phi_deg) {
    const double t = theta_deg * kPi / 180, p = phi_deg * kPi / 180;
    return {std::sin(t) * std::cos(p), std::sin(t) * std::sin(p), std::cos(t)};
}
struct Incoming {
    Vec3 direction;
    double weight;
};
// One lamp, two lamps, a half sky, a whole sky.
std::vector<std::vector<Incoming>> lightings() {
    std::vector<std::vector<Incoming>> out;
    for (const double theta : {0.0, 20.0, 45.0, 60.0, 75.0, 85.0, 89.9}) out.push_back({{at(theta, 33), 1.5}});
    out.push_back({{at(60, 10), 1}, {at(60, 200), 2}});
    std::vector<Incoming> half, full;
    const Sobol points(1);
    for (std::uint32_t i = 0; i < 4096; ++i) {
        const Vec2 u = points.pair(i, 0);
        const SinCos a = sincos_turns(u.y);
        const double s = std::sqrt(1 - u.x * u.x);
        const Vec3 d{s * a.cos, s * a.sin, u.x}; // uniform over the hemisphere
        full.push_back({d, 2 * kPi / 4096});
        if (d.x > 0.2) half.push_back(full.back());
    }
    out.push_back(half), out.push_back(full);
    return out;
}
} // namespace

// g of the design table: tangential response of the fit for normals within 30, 45, 60 degrees.
TEST(Kernels, TangentialTable) {
    const double rows[][11] = {{30, 45, 50, 55, 60, 65, 70, 75, 80, 85, 90},
                               {.5, .7071, .7660, .8192, .8660, .8956, .8858, .8341, .7462, .6310, .5000},
                               {.5, .7071, .7616, .7961, .8083, .7982, .7678, .7195, .6564, .5820, .5000},
                               {.5, .6732, .7023, .7170, .7179, .7059, .6823, .6483, .6055, .5555, .5000}};
    const double cones[] = {30, 45, 60};
    for (std::size_t k = 0; k < 3; ++k) {
        const ConeTable table(RnmEncoding::dot, cones[k]);
        for (std::size_t i = 0; i < 11; ++i) {
            const double theta = rows[0][i] * kPi / 180;
            EXPECT_NEAR(table.tangential(std::cos(theta)) * std::sin(theta), rows[k + 1][i], 2e-3)
                << cones[k] << " " << rows[0][i];
        }
    }
}

// The flat normal under the dot formula is the classic lightmap, whatever the light; so is the mean of the sq
// values, and they are not negative.
TEST(Kernels, FlatNormalIsExact) {
    for (const double cone : {15.0, 30.0, 60.0})
        for (const RnmEncoding encoding : {RnmEncoding::dot, RnmEncoding::sq}) {
            const ConeTable table(encoding, cone);
            const LuxelKernel kernel{Frame{}, encoding, &table};
            for (const auto& light : lightings()) {
                KernelSum sum;
                double flat = 0;
                for (const Incoming& i : light) {
                    kernel.add(sum, i.direction, Rgbd{1, 2, 3} * i.weight);
                    flat += i.weight * i.direction.z;
                }
                const auto stored = kernel.finish(sum);
                const Rgbd shown = rnm_evaluate(encoding, stored, {0, 0, 1});
                EXPECT_NEAR(sum.flat.x, flat, 1e-12);
                for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(shown[c], sum.flat[c], 1e-5 * (1 + sum.flat[c]));
                for (std::size_t i = 0; i < 3 && encoding == RnmEncoding::sq; ++i) EXPECT_GE(stored[i].x, 0);
            }
        }
}

// Light that every normal of the cone sees is reproduced exactly for all of them by the dot form.
TEST(Kernels, DotIsExactForLightAllNormalsSee) {
    const ConeTable table(RnmEncoding::dot, 30);
    const LuxelKernel kernel{Frame{}, RnmEncoding::dot, &table};
    for (const double theta : {0.0, 25.0, 55.0}) {
        KernelSum sum;
        kernel.add(sum, at(theta, 70), {1, 1, 1});
        const auto stored = kernel.finish(sum);
        for (const double tilt : {10.0, 30.0})
            for (double phi = 0; phi < 360; phi += 45) {
                const Vec3 n = at(tilt, phi);
                EXPECT_NEAR(rnm_evaluate(RnmEncoding::dot, stored, n).x, dot(n, at(theta, 70)), 2e-3);
            }
    }
}

// What errors are measured by is what a run time makes of the stored values: never below 0, where the formula of `dot` goes for light that grazes.
TEST(Kernels, ErrorsAreMeasuredByWhatIsDisplayed) {
    for (const RnmEncoding encoding : {RnmEncoding::dot, RnmEncoding::sq, RnmEncoding::tilted}) {
        const ConeTable cone(encoding, 30);
        const LuxelKernel kernel{frame_around({0, 0, 1}), encoding, &cone};
        bool black = false;
        for (const double height : {0.01, 0.1, 0.5, 0.9})
            for (int i = 0; i < 6; ++i) {
                const double turn = 1.1 * i, side = std::sqrt(1 - height * height);
                KernelSum sum;
                kernel.add(sum, Vec3{side * std::cos(turn), side * std::sin(turn), height}, Rgbd{1, 2, 3});
                const std::array<Rgb, 3> stored = kernel.finish(sum);
                const std::array<Rgbd, 4> displayed = LuxelKernel::displayed(kernel.shown(sum));
                for (std::size_t k = 0; k < 3; ++k) {
                    const Vec3 flat{kRnmBasis[k].x, kRnmBasis[k].y, 0};
                    const Vec3 n = encoding == RnmEncoding::tilted ? kRnmBasis[k] : flat * (kTypicalTilt / length(flat)) + Vec3{0, 0, std::sqrt(1 - kTypicalTilt * kTypicalTilt)};
                    const Rgbd run_time = encoding == RnmEncoding::tilted ? static_cast<Rgbd>(stored[k]) : rnm_evaluate(encoding, stored, n);
                    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(displayed[k + 1][c], run_time[c], 1e-6);
                    black = black || kernel.shown(sum)[k + 1].x < -0.01;
                }
                for (const Rgbd& e : displayed) EXPECT_GE(e.x, 0);
            }
        EXPECT_EQ(black, encoding == RnmEncoding::dot);
    }
}

// Under a uniform sky E(b_i) = pi (1 + 1/sqrt 3) / 2, and the literal reading of the dot formula is 36.6 % too
// bright.
TEST(Kernels, TiltedIsWhatItIs) {
    const ConeTable table(RnmEncoding::tilted, 30);
    const LuxelKernel kernel{Frame{}, RnmEncoding::tilted, &table};
    KernelSum sum;
    const auto uniform_sky = lightings().back();
    for (const Incoming& i : uniform_sky) kernel.add(sum, i.direction, Rgbd{1, 1, 1} * i.weight);
    const auto stored = kernel.finish(sum);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(stored[i].x, 0.788675 * kPi, 2e-3);
    EXPECT_NEAR(rnm_evaluate(RnmEncoding::dot, stored, {0, 0, 1}).x, 1.366 * kPi, 5e-3);
}

// The integrals that the control variate of the gather relies on.
TEST(Kernels, IntegralsOverTheHemisphere) {
    for (const RnmEncoding encoding : {RnmEncoding::dot, RnmEncoding::sq, RnmEncoding::tilted}) {
        const ConeTable table(encoding, 30);
        const LuxelKernel kernel{Frame{}, encoding, &table};
        std::array<double, 4> sum{};
        const auto uniform_sky = lightings().back();
        for (const Incoming& i : uniform_sky) {
            const auto k = kernel.values(i.direction);
            for (std::size_t j = 0; j < 4; ++j) sum[j] += k[j] * i.weight;
        }
        const auto exact = kernel.integrals();
        for (std::size_t j = 0; j < 4; ++j)
            EXPECT_NEAR(sum[j], exact[j], 5e-3) << static_cast<int>(encoding) << " " << j;
    }
}

// A rotated tangent frame changes the stored numbers and not what they show.
TEST(Kernels, DotDoesNotCareForTheFrame) {
    const ConeTable table(RnmEncoding::dot, 30);
    for (const double turn : {10.0, 77.0, 200.0}) {
        const Frame turned{at(90, turn), at(90, turn + 90), {0, 0, 1}};
        const LuxelKernel a{Frame{}, RnmEncoding::dot, &table}, b{turned, RnmEncoding::dot, &table};
        KernelSum sa, sb;
        for (const Vec3 d : {at(70, 5), at(40, 140)}) a.add(sa, d, {1, 1, 1}), b.add(sb, d, {1, 1, 1});
        const Vec3 n = at(25, 60);
        EXPECT_NEAR(rnm_evaluate(RnmEncoding::dot, a.finish(sa), n).x,
                    rnm_evaluate(RnmEncoding::dot, b.finish(sb), turned.local(n)).x, 1e-6);
    }
}

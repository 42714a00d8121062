// All bounces of a solution, against closed forms and plain sweeps.
#include "compiler/light/jacobi.h"
#include "libs/core/hash.h"
#include <gtest/gtest.h>

using namespace kiln;

// A row of equal patches, each of which sees the next on either side, and one that is lit: B decays by a closed form. The bound holds, few sweeps do.
TEST(Bounces, ComeToTheClosedFormOfALine) {
    constexpr std::size_t n = 401, lit = 200;
    Context context;
    for (const double rho : {0.2, 0.5, 0.9, 0.99}) {
        std::vector<Rgbd> direct(n);
        direct[lit] = {1, 1, 1};
        const double share = 1e-4;
        const Bounces got = solve_bounces(direct, std::vector<Rgbd>(n, {rho, rho, rho}), share, context, [&](std::size_t p, const std::vector<Rgbd>& b, Rgbd& sum) {
            if (p > 0) sum += b[p - 1] * 0.5;
            if (p + 1 < n) sum += b[p + 1] * 0.5;
        });
        const double root = std::sqrt(1 - rho * rho), step = (1 - root) / rho; // of an endless line
        double mean_light = 0, most = 0;
        for (const Rgbd& h : got.irradiance) mean_light += h.x / n;
        for (std::size_t p = 0; p < n; ++p) most = std::max(most, std::abs(got.irradiance[p].x - std::pow(step, std::abs(static_cast<double>(p) - static_cast<double>(lit))) / root));
        EXPECT_LE(got.residual, share) << rho;
        EXPECT_LE(most, got.residual * mean_light * 1.01 + 1e-9) << rho;
        for (const Rgbd& h : got.irradiance) EXPECT_GE(h.x, 0) << rho;
        const double plain = std::log(share * (1 - rho) / n) / std::log(rho); // sweeps of the plain kind, at most
        EXPECT_LT(got.sweeps, 0.6 * plain + 8) << rho;
    }
}

// Added up in floats rows tell the same, within the bound that was asked for and colours apart.
TEST(Bounces, FloatsWillDo) {
    constexpr std::size_t n = 301;
    Context context;
    std::vector<Rgbd> direct(n), rho(n);
    for (std::uint64_t p = 0; p < n; ++p) direct[p] = {1e-3 + static_cast<double>(mix(p) % 100), 1, p == 7 ? 1e4 : 0}, rho[p] = {0.8, 0.5, static_cast<double>(mix(p, p) % 90) / 100};
    const auto row = [&](std::size_t p, const auto& b, auto& sum) {
        for (std::uint64_t k = 0; k < 20; ++k) sum += b[mix(p, k) % n] * (0.03 + 0.001 * static_cast<double>(k));
        sum += b[(p + 1) % n] * Rgbd{0.1, 0.05, 0.2};
    };
    const double share = 10 * kQuickShare; // reflectances are at most 0.9
    const Bounces exact = solve_bounces(direct, rho, share, context, row), quick = solve_bounces<QuickLight>(direct, rho, share, context, row);
    EXPECT_EQ(quick.sweeps, exact.sweeps);
    for (std::size_t p = 0; p < n; ++p)
        for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(quick.irradiance[p][c], exact.irradiance[p][c], share * exact.irradiance[p][c] + 1e-9) << p;
}

// A bright closet beside rooms of which it sees little makes sweeps no less worth than plain ones.
TEST(Bounces, OneBrightClosetCostsNothing) {
    constexpr std::size_t n = 202;
    Context context;
    std::vector<Rgbd> rho(n, {0.5, 0.5, 0.5}), direct(n);
    rho[n - 2] = rho[n - 1] = {0.95, 0.95, 0.95}, direct[0] = {100, 100, 100};
    const auto row = [&](std::size_t p, const std::vector<Rgbd>& b, Rgbd& sum) {
        if (p + 2 >= n) { // it sees itself, and the room a little
            sum += b[2 * n - 3 - p] * 0.9 + b[0] * 0.1;
            return;
        }
        if (p > 0) sum += b[p - 1] * 0.5;
        if (p + 1 < n) sum += b[p + 1] * 0.5;
    };
    const Bounces got = solve_bounces(direct, rho, 1e-4, context, row);
    std::vector<Rgbd> exact = direct, next(n), b(n);
    std::uint32_t plain = 0; // sweeps that as small a change takes
    for (std::uint32_t sweep = 0; sweep < 2000; ++sweep) {
        double change = 0, sum = 0;
        for (std::size_t p = 0; p < n; ++p) b[p] = rho[p] * exact[p];
        for (std::size_t p = 0; p < n; ++p) row(p, b, next[p] = direct[p]), change = std::max(change, next[p].x - exact[p].x), sum += next[p].x / n;
        exact = next;
        if (!plain && change * 0.95 / 0.05 <= 1e-4 * sum) plain = sweep;
    }
    double most = 0, mean_light = 0;
    for (std::size_t p = 0; p < n; ++p) most = std::max(most, std::abs(got.irradiance[p].x - exact[p].x)), mean_light += exact[p].x / n;
    EXPECT_LE(most, got.residual * mean_light * 1.01);
    EXPECT_LE(got.sweeps, plain + 8); // they are looked at eight at a time
}

// Rows of no scene, along which light goes round and never back: sweeps that are drawn out do not settle there, plain ones do.
TEST(Bounces, SettleWhereLightNeverComesBack) {
    constexpr std::size_t n = 64;
    Context context;
    for (const double rho : {0.5, 0.9, 0.99}) {
        std::vector<Rgbd> direct(n);
        direct[0] = {1, 2, 4};
        const Bounces got = solve_bounces(direct, std::vector<Rgbd>(n, {rho, rho, rho}), 1e-6, context, [&](std::size_t p, const std::vector<Rgbd>& b, Rgbd& sum) { sum += b[(p + n - 1) % n]; });
        for (std::size_t p = 0; p < n; ++p) EXPECT_NEAR(got.irradiance[p].y, 2 * std::pow(rho, p) / (1 - std::pow(rho, n)), 2e-4) << rho;
    }
}

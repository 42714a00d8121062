// The other ways to bake on scenes whose light is known: where they should be right they are held to it, where they are
// known to be wrong the range is asserted. Why: compiler/light/rivals/NOTES.md.
#include "compiler/light/lambert.h"
#include "compiler/light/rivals/rivals.h"
#include "tests/compiler/light/scenes.h"
#include <cstring>
#include <functional>
#include <gtest/gtest.h>
#include <numbers>

using namespace kiln;
using namespace kiln::rivals;
using namespace kiln::test;

namespace {
constexpr double kPi = std::numbers::pi;
const double kTilted = kPi * (1 + 1 / std::sqrt(3.0)) / 2; // E(b) under radiance 1

using Make = std::function<std::unique_ptr<Method>(const rivals::Scene&, Context&)>;
Make paths(std::uint32_t n) {
    return [=](const rivals::Scene& s, Context&) { return path_tracing(s, {.paths = n}); };
}
Make matrix(MatrixRule rule, double h) {
    return [=](const rivals::Scene& s, Context& c) { return matrix_radiosity(s, {.patch_size = h, .rule = rule}, c); };
}
Make hemicube(double h, std::uint32_t resolution) {
    return [=](const rivals::Scene& s, Context& c) { return hemicube_radiosity(s, {.patch_size = h, .resolution = resolution}, c); };
}
Make cut(std::uint32_t lights, double error) {
    return [=](const rivals::Scene& s, Context& c) { return many_light_cut(s, {.lights = lights, .error = error}, c); };
}

struct Bench {
    SurfacesBuilder builder;
    std::vector<Light> lights;
    Context context;
    std::unique_ptr<rivals::Scene> scene;
    std::vector<Receiver> receivers;
    explicit Bench(SurfacesBuilder b, std::vector<Light> l = {}, std::size_t every = 1) : builder(std::move(b)), lights(std::move(l)) {
        scene = std::make_unique<rivals::Scene>(builder.world, builder.surfaces, lights);
        std::vector<std::uint32_t> luxels = shown_luxels(*scene, context), some;
        for (std::size_t i = 0; i < luxels.size(); i += every) some.push_back(luxels[i]);
        receivers = receivers_of(*scene, some);
    }
    std::vector<Irradiance> light(const Make& make) { return make(*scene, context)->light(receivers, context); }
    std::vector<Irradiance> light(const Make& make, const std::vector<Receiver>& at) { return make(*scene, context)->light(at, context); }
};

// Relative root mean square of direction `d` against the truth, percent; floor 2 % of the mean.
double rrmse(const std::vector<Irradiance>& got, const std::vector<Irradiance>& truth, std::size_t d) {
    double level = 0, sum = 0;
    for (const Irradiance& e : truth) level += mean(e[d]) / static_cast<double>(truth.size());
    for (std::size_t i = 0; i < got.size(); ++i) sum += std::pow((mean(got[i][d]) - mean(truth[i][d])) / std::max(mean(truth[i][d]), 0.02 * level), 2);
    return 100 * std::sqrt(sum / static_cast<double>(got.size()));
}
double average(const std::vector<Irradiance>& e, std::size_t d) {
    double sum = 0;
    for (const Irradiance& v : e) sum += mean(v[d]);
    return sum / static_cast<double>(e.size());
}
double furnace_error(const std::vector<Irradiance>& got, std::size_t d) { // rms of E / exact - 1, percent
    const double exact = d ? kTilted : kPi;
    double sum = 0;
    for (const Irradiance& e : got) sum += std::pow(mean(e[d]) / exact - 1, 2);
    return 100 * std::sqrt(sum / static_cast<double>(got.size()));
}

// A black lamp facing down over the origin, nothing else.
Bench lamp_over_origin(double half) {
    SurfacesBuilder b;
    const MaterialId lamp = b.material({0, 0, 0}, {2, 2, 2});
    b.rect({-half, -half, 64}, {0, 2 * half, 0}, {2 * half, 0, 0}, lamp, {.luxel = 4});
    return Bench(std::move(b));
}
} // namespace

// Emission + reflectance = 1: radiance 1 everywhere, whatever the shape.
TEST(Rivals, FurnaceIsEven) {
    Bench f(furnace(), {}, 3);
    struct Case { const char* name; Make make; double flat, tilted; };
    for (const Case& c : {Case{"paths", paths(4096), 0.6, 0.9}, Case{"hemicube", hemicube(16, 32), 0.15, 0.8}, Case{"corrected", matrix(MatrixRule::corrected, 16), 1.5, 1.7},
                          Case{"cut", cut(16384, 0.01), 4, 6}}) {
        const auto got = f.light(c.make);
        EXPECT_LT(furnace_error(got, 0), c.flat) << c.name;
        for (const std::size_t d : {1u, 2u, 3u}) EXPECT_LT(furnace_error(got, d), c.tilted) << c.name << d;
    }
    // A hemicube's sum is exact; what is left comes from tilted cubes cut at the horizon by whole pixels.
    EXPECT_GT(furnace_error(f.light(hemicube(16, 8)), 1), furnace_error(f.light(hemicube(16, 64)), 1));
}

// Rows of middles sum to more than 1 where patches touch, and every bounce makes it worse; scaling such rows down, as vrad
// does, only hides it from the bounces, not from the wrong shares within a row.
TEST(Rivals, FurnaceIsTooBrightByMiddles) {
    Bench f(furnace(), {}, 3);
    const auto excess = [&](MatrixRule rule, double h) { return 100 * (average(f.light(matrix(rule, h)), 0) / kPi - 1); };
    const double coarse = excess(MatrixRule::centre, 32), fine = excess(MatrixRule::centre, 16);
    EXPECT_GT(coarse, 18);
    EXPECT_LT(coarse, 32);
    EXPECT_GT(fine, 10);
    EXPECT_LT(fine, 20);
    EXPECT_GT(excess(MatrixRule::vrad, 16), 4);
    EXPECT_LT(excess(MatrixRule::vrad, 16), 10);
}

// Albedo 0: direct light alone, which Lambert's formula gives exactly.
TEST(Rivals, LampMatchesLambert) {
    const std::array<Receiver, 3> at{receiver_at({0, 0, 0}, {0, 0, 1}, {1, 0, 0}), receiver_at({40, 0, 0}, {0, 0, 1}, {1, 0, 0}), receiver_at({0, -56, 8}, {0, 1, 0}, {1, 0, 0})};
    const auto worst = [&](double half, const Make& make) {
        Bench l = lamp_over_origin(half);
        const auto got = l.light(make, {at.begin(), at.end()});
        const std::array<Vec3, 4> lamp{Vec3{-half, -half, 64}, {-half, half, 64}, {half, half, 64}, {half, -half, 64}};
        double most = 0;
        for (std::size_t i = 0; i < at.size(); ++i)
            most = std::max(most, std::abs(100 * (got[i][0].x / (2 * kPi * lambert_form_factor(at[i].point, at[i].normal, lamp)) - 1)));
        return most;
    };
    for (const double half : {8.0, 32.0}) {
        EXPECT_LT(worst(half, paths(16384)), 0.3) << half;
        EXPECT_LT(worst(half, matrix(MatrixRule::corrected, 8)), 1.5) << half;
        EXPECT_LT(worst(half, cut(16384, 0)), 0.2) << half;
        EXPECT_LT(worst(half, cut(16384, 0.02)), 1) << half;
    }
    EXPECT_LT(worst(32, hemicube(16, 64)), 6);
    // A lamp of a few pixels is seen by all or none of them: aliasing, which only resolution helps.
    EXPECT_GT(worst(8, hemicube(16, 8)), 80);
    // One point for a whole lamp, however near. Refining helps.
    EXPECT_GT(worst(32, matrix(MatrixRule::vrad, 64)), 4);
    EXPECT_LT(worst(32, matrix(MatrixRule::vrad, 8)), 1.5);
}

// What is emitted is absorbed: sum A (1 - rho) H = sum A M in a closed box.
TEST(Rivals, EnergyIsKept) {
    SurfacesBuilder b;
    const MaterialId grey = b.material({0.6f, 0.6f, 0.6f}), lit = b.material({0.6f, 0.6f, 0.6f}, {3, 3, 3});
    b.room({{0, 0, 0}, {128, 96, 64}}, {grey, grey, grey, grey, grey, lit}, {.luxel = 16});
    Bench box(std::move(b));
    const auto absorbed = [&](const Make& make) {
        const auto got = box.light(make);
        double sum = 0;
        for (std::size_t i = 0; i < got.size(); ++i) sum += box.receivers[i].footprint.area() * 0.4 * mean(got[i][0]);
        return sum / (kPi * 3 * 128 * 96) - 1;
    };
    EXPECT_NEAR(absorbed(paths(1024)), 0, 0.003);
    EXPECT_NEAR(absorbed(hemicube(16, 32)), 0, 0.01);
    EXPECT_NEAR(absorbed(matrix(MatrixRule::corrected, 16)), 0, 0.03);
    EXPECT_NEAR(absorbed(cut(8192, 0.01)), 0, 0.03);
    EXPECT_GT(absorbed(matrix(MatrixRule::centre, 16)), 0.05); // made up at the edges
}

// Light through a door, against paths: each knob buys accuracy, and nothing settles at another answer.
TEST(Rivals, RefiningConverges) {
    Bench r(two_rooms(), {}, 40);
    const auto truth = r.light(paths(8192));
    const auto error = [&](const Make& make) { return rrmse(r.light(make), truth, 0); };
    const double c40 = error(matrix(MatrixRule::corrected, 40)), c20 = error(matrix(MatrixRule::corrected, 20)), c10 = error(matrix(MatrixRule::corrected, 10));
    EXPECT_GT(c40, c20);
    EXPECT_GT(c20, c10);
    EXPECT_LT(c10, 6);
    const double h8 = error(hemicube(20, 8)), h64 = error(hemicube(20, 64));
    EXPECT_GT(h8, 2 * h64);
    EXPECT_LT(h64, 8);
    const double p64 = error(paths(64)), p1024 = error(paths(1024));
    EXPECT_GT(p64, 2 * p1024);
    EXPECT_LT(p1024, 16);
    const double l1 = error(cut(1024, 0.02)), l16 = error(cut(16384, 0.01));
    EXPECT_GT(l1, l16);
    EXPECT_LT(l16, 16);
}

// Every light of its own and a cut that must not miss by more than a share agree far below that share.
TEST(Rivals, CutsKeepTheirBound) {
    Bench r(two_rooms(), {}, 80);
    const auto all = r.light(cut(2048, 0));
    double last = 0;
    for (const double e : {0.005, 0.02, 0.08}) {
        const double difference = rrmse(r.light(cut(2048, e)), all, 0);
        EXPECT_LT(difference, 100 * e);
        EXPECT_GE(difference, last);
        last = difference;
    }
}

TEST(Rivals, ThreadsDoNotMatter) {
    SurfacesBuilder b = two_rooms(20);
    Light lamp; // an entity too
    lamp.position = {250, 100, 100}, lamp.intensity = {9000, 9000, 9000};
    Bench r(std::move(b), {lamp}, 5);
    for (const Make& make : {paths(64), matrix(MatrixRule::vrad, 40), matrix(MatrixRule::corrected, 40), hemicube(40, 8), cut(512, 0.02)}) {
        r.context.threads = 1;
        const auto one = r.light(make);
        for (const int threads : {2, 7}) {
            r.context.threads = threads;
            const auto some = r.light(make);
            EXPECT_EQ(std::memcmp(one.data(), some.data(), one.size() * sizeof one[0]), 0) << threads;
        }
    }
}

// A matrix that does not fit says so.
TEST(Rivals, MatrixRefusesWhatDoesNotFit) {
    Bench r(two_rooms(), {}, 50);
    const auto m = matrix_radiosity(*r.scene, {.patch_size = 10, .most_bytes = 1 << 20}, r.context);
    EXPECT_NE(m->refused(), "");
    for (const Irradiance& e : m->light(r.receivers, r.context)) EXPECT_EQ(e[0], Rgbd{});
}

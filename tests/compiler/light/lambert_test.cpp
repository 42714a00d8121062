// Closed forms of form factors (Howell's catalogue, Lambert's formula).
#include "compiler/light/emitters.h"
#include "compiler/light/kernels.h"
#include "compiler/light/lambert.h"
#include "tests/compiler/light/scenes.h"
#include <gtest/gtest.h>
#include <numbers>

using namespace kiln;
using namespace kiln::test;

namespace {
using Polygon = std::vector<Vec3>;
double factor(const Polygon& p, Vec3 x = {}, Vec3 n = {0, 0, 1}) {
    return lambert_form_factor(x, n, p);
}
} // namespace

TEST(Lambert, RectangleOverItsCornerAndItsCentre) {
    EXPECT_NEAR(factor({{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}), 0.1385316060, 1e-9);
    EXPECT_NEAR(factor({{-1, -1, 1}, {1, -1, 1}, {1, 1, 1}, {-1, 1, 1}}), 0.5541264240, 1e-9);
    EXPECT_NEAR(factor({{-.5, -.5, 1}, {.5, -.5, 1}, {.5, .5, 1}, {-.5, .5, 1}}), 0.2394564705, 1e-9);
}

TEST(Lambert, PerpendicularRectangle) {
    EXPECT_NEAR(factor({{1, 0, 0}, {1, 1, 0}, {1, 1, 1}, {1, 0, 1}}), 0.0557341970, 1e-9);
}

// Edges seen under more than 90 degrees: where asin in place of atan2 loses up to nine tenths.
TEST(Lambert, LongStripsSeenFromNearby) {
    EXPECT_NEAR(factor({{-1.5, -.5, 1}, {1.5, -.5, 1}, {1.5, .5, 1}, {-1.5, .5, 1}}), 0.408164, 1e-6);
    EXPECT_NEAR(factor({{-4, -.5, 1}, {4, -.5, 1}, {4, .5, 1}, {-4, .5, 1}}), 0.444149, 1e-6);
    EXPECT_NEAR(factor({{.1, -.5, 0}, {.1, .5, 0}, {.1, .5, 1}, {.1, -.5, 1}}), 0.422545, 1e-6);
    EXPECT_NEAR(factor({{.1, -2, 0}, {.1, 2, 0}, {.1, 2, 1}, {.1, -2, 1}}), 0.449094, 1e-6);
}

TEST(Lambert, TrianglesAndTheHorizon) {
    EXPECT_NEAR(factor({{1, -1, .5}, {1.5, 1, .2}, {.2, .3, 2}}), 0.1819806689, 1e-9);
    EXPECT_NEAR(factor({{1, -1, -.5}, {1.5, 1, .2}, {.2, .3, 2}}), 0.1782415068, 1e-9);
    EXPECT_NEAR(factor({{1, -.5, -.5}, {1, .5, -.5}, {1, .5, .5}, {1, -.5, .5}}), 0.0278553824, 1e-9);
    EXPECT_EQ(factor({{1, -1, -1}, {1.5, 1, -.2}, {.2, .3, -2}}), 0);
}

// 2 x 2 light at height 4, an occluding half-plane x > e at height 2: what is left of the light is a rectangle.
TEST(Lambert, PenumbraTable) {
    const double expected[][2] = {{.5, .0734776307}, {.25, .0556557}, {0, .0367388}, {-.25, .0178219}};
    for (const auto& [e, f] : expected)
        EXPECT_NEAR(factor({{-1, -1, 4}, {2 * e, -1, 4}, {2 * e, 1, 4}, {-1, 1, 4}}), f, 1e-6) << e;
}

TEST(Lambert, SolidAngleOfAnOctantAndOfACubeFace) {
    constexpr double pi = std::numbers::pi;
    EXPECT_NEAR(solid_angle({}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}), pi / 2, 1e-12);
    EXPECT_NEAR(solid_angle({}, {1, -1, -1}, {1, 1, -1}, {1, 1, 1}) * 2, 4 * pi / 6, 1e-12);
}

// Sampling an emitter: the fluxes it hands out make the exact form factor wherever the point stands: far, close, in the
// middle of it, behind its horizon; no share of it is lost there. For another normal, whose horizon may cut the part
// that the first one sees, they make it to half a per cent, close to the lamp to a few.
TEST(Emitters, SamplesAddUpToTheFormFactor) {
    SurfacesBuilder b;
    const MaterialId lamp = b.material({}, {1, 1, 1});
    b.rect({0, 0, 100}, {0, 64, 0}, {96, 0, 0}, lamp, {}, {Rect{16, 16, 32, 48}});
    const EmitterSet set(b.world, b.surfaces, {});
    ASSERT_EQ(set.emitters.size(), 1u);
    EXPECT_NEAR(set.emitters[0].area, 96 * 64 - 16 * 32, 1e-6);
    const Sobol points(4);
    for (const Vec3 x :
         {Vec3{40, 30, -900}, Vec3{40, 30, 0}, Vec3{10, 20, 98}, Vec3{300, 20, 60}, Vec3{48, 32, 90}})
        for (const Vec3 n : {Vec3{0, 0, 1}, normalize(Vec3{1, 0, 0.2}), normalize(Vec3{-1, 2, 0.1}), Vec3{0, 1, 0},
                             Vec3{0, 0, -1}}) {
            const Vec3 other = frame_around(n).world(kRnmBasis[0]);
            double sum = 0, shown = 0, tilted = 0;
            for (std::uint32_t k = 0; k < 4; ++k)
                set.sample(0, x, n, 64 * k, 64, points, 1e-5, EmitterSet::Arrival::whole, EmitterSet::Share::cosine, [&](Vec3 y, Vec3 flux) {
                    EXPECT_NEAR(y.z, 100, 1e-9);
                    sum += dot(flux, n) / 4, shown += std::max(0.0, dot(flux, n)) / 4, tilted += std::max(0.0, dot(flux, other)) / 4;
                });
            const double expected = set.form_factor(0, x, n) * std::numbers::pi;
            EXPECT_NEAR(sum, expected, 1e-9 + 1e-6 * expected)
                << x.x << " " << x.z << " n " << n.x << " " << n.y << " " << n.z;
            EXPECT_NEAR(shown, expected, 1e-9 + 1e-3 * expected); // a flux may be shifted below the horizon
            double along = 0; // what lies above both horizons
            for (const EmitterTriangle& t : set.triangles) {
                std::vector<Vec3> above;
                clip_to_horizon(x, n, std::array<Vec3, 3>{t.a, t.b, t.c}, [&](Vec3 p) { above.push_back(p); });
                if (x.z < 100 && above.size() > 2) along += lambert_form_factor(x, other, above) * std::numbers::pi;
            }
            const bool close = x.z < 100 && 100 - x.z < 48; // less than half the size of the lamp
            EXPECT_NEAR(tilted, along, 1e-9 + (close ? 0.05 : 0.005) * along) << x.x << " " << x.z << " n " << n.x << " " << n.y << " " << n.z;
            EXPECT_GE(set.bound(0, x, n) + 1e-12, set.form_factor(0, x, n));
        }
}

// Points drawn one by one bring what the polygon does, and what its visible half does, on the average over seeds: however few of them, by
// whichever share parts are chosen.
TEST(Emitters, PointsOneByOneAreRightOnTheAverage) {
    struct Case {
        Vec3 corner, u, v; // faces down or towards -x
    };
    for (const Case& c : {Case{{-8, -8, 20}, {0, 16, 0}, {16, 0, 0}}, Case{{-8, -8, 4}, {0, 16, 0}, {16, 0, 0}}, Case{{-1, -60, 5}, {0, 120, 0}, {60, 0, 0}}, Case{{3, -20, -10}, {0, 0, 30}, {0, 40, 0}}}) {
        SurfacesBuilder b;
        b.rect(c.corner, c.u, c.v, b.material({}, {1, 1, 1}));
        const EmitterSet set(b.world, b.surfaces, {});
        ASSERT_EQ(set.emitters.size(), 1u);
        const Vec3 x{}, n{0, 0, 1}, half = c.corner + c.u * 0.5;
        const double exact = set.form_factor(0, x, n);
        const double exact_half = lambert_form_factor(x, n, Polygon{c.corner, half, half + c.v, c.corner + c.v});
        ASSERT_GT(exact, 0);
        for (const auto share : {EmitterSet::Share::cosine, EmitterSet::Share::solid})
            for (const auto& [samples, just_so_many] : {std::pair{1u, false}, {8u, false}, {1u, true}, {8u, true}}) {
                double sum = 0, sum_half = 0, square = 0, square_half = 0;
                std::uint32_t least = UINT32_MAX, most = 0;
                constexpr int kSeeds = 5000;
                for (int seed = 0; seed < kSeeds; ++seed) {
                    const Sobol points(mix(static_cast<std::uint64_t>(seed)));
                    double one = 0, one_half = 0;
                    std::uint32_t visited = 0;
                    const auto visit = [&](Vec3 y, Vec3 flux) {
                        ++visited;
                        const double arrives = std::max(0.0, dot(flux, n)) / std::numbers::pi;
                        one += arrives;
                        if (dot(y - c.corner, c.u) < 0.5 * dot(c.u, c.u)) one_half += arrives;
                    };
                    if (just_so_many) set.sample_few(0, x, n, 0, samples, points(0, 4), points, 2e-4, share, visit);
                    else set.sample(0, x, n, 0, samples, points, 2e-4, EmitterSet::Arrival::each, share, visit);
                    least = std::min(least, visited), most = std::max(most, visited);
                    sum += one / kSeeds, square += one * one / kSeeds;
                    sum_half += one_half / kSeeds, square_half += one_half * one_half / kSeeds;
                }
                const double noise = std::sqrt(std::max(0.0, square - sum * sum) / kSeeds), noise_half = std::sqrt(std::max(0.0, square_half - sum_half * sum_half) / kSeeds);
                EXPECT_NEAR(sum, exact, 5 * noise + 1e-3 * exact) << c.corner.z << " " << samples;
                EXPECT_NEAR(sum_half, exact_half, 5 * noise_half + 1e-3 * exact) << c.corner.z << " " << samples;
                if (just_so_many) {
                    EXPECT_EQ(most, samples);
                    EXPECT_EQ(least, samples);
                }
            }
    }
}

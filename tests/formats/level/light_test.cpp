// What the loader says about light, against the definitions of the encodings.
#include "formats/level/kiln_level.hpp"
#include "tests/formats/level/sample_level.h"
#include <gtest/gtest.h>
#include <random>
#include <thread>

namespace kiln::level {
namespace {

using test::kPi;
using Point = std::array<double, 3>;

const double kBasis[3][3] = {{std::sqrt(2.0 / 3), 0, 1 / std::sqrt(3.0)},
                             {-1 / std::sqrt(6.0), 1 / std::sqrt(2.0), 1 / std::sqrt(3.0)},
                             {-1 / std::sqrt(6.0), -1 / std::sqrt(2.0), 1 / std::sqrt(3.0)}};

std::array<float, 3> unit(double x, double y, double z) {
    const double l = std::sqrt(x * x + y * y + z * z);
    return {static_cast<float>(x / l), static_cast<float>(y / l), static_cast<float>(z / l)};
}
// A point of the floor of the room (face 5: z = -128), from luxel coordinates of its chart.
Point on_face(const Level& level, std::uint32_t face, double s, double t) {
    const kiln_chart& c = level.charts()[level.faces()[face].chart];
    Point p{};
    for (std::size_t k = 0; k < 3; ++k) p[k] = c.origin[k] + 16 * (s * c.s[k] + t * c.t[k]);
    return p;
}

} // namespace

// The constant part of `dot`: a flat normal must give back the classic lightmap (to the storage's precision, 1e-3).
TEST(LevelRnm, DotWithAFlatNormalIsTheFlatLightmap) {
    std::mt19937 random(1);
    const auto real = [&] { return static_cast<float>(random()) / 4294967296.0f; };
    const LevelContent c = test::room(0, true, [&](std::size_t, std::uint32_t, std::uint32_t) {
        std::array<Float3, 4> v;
        for (std::size_t k = 0; k < 3; ++k) { // any vector whose flat value is positive
            const float e = 0.2f + real(), x = 0.4f * (real() - 0.5f), y = 0.4f * (real() - 0.5f);
            v[0][k] = e;
            for (std::size_t i = 0; i < 3; ++i)
                v[i + 1][k] = static_cast<float>(kBasis[i][0] * x + kBasis[i][1] * y + kBasis[i][2] * e);
        }
        return v;
    });
    const auto bytes = write_level(c);
    const Level level(bytes);
    for (std::uint32_t face = 0; face < 6; ++face)
        for (std::uint32_t y = 1; y < 17; ++y)
            for (std::uint32_t x = 1; x < 17; ++x) {
                const Point p = on_face(level, face, x + 0.5, y + 0.5);
                const auto& n = level.faces()[face].normal;
                const auto e = level.irradiance(face, p, {n[0], n[1], n[2]});
                float flat[3];
                ASSERT_EQ(kiln_level_eval_flat(level.get(), face, p.data(), flat), KILN_OK);
                const Float3& wanted = c.flat[c.chart_first_texel[face] + 18 * y + x];
                for (std::size_t k = 0; k < 3; ++k) {
                    ASSERT_NEAR((*e)[k] / wanted[k], 1, 1e-3);
                    ASSERT_NEAR(flat[k] / wanted[k], 1, 1e-3);
                }
            }
}

TEST(LevelRnm, DotIsTheScalarProductWithTheStoredVectorClampedAtZero) {
    const double u[3] = {0.3, -0.2, 0.9};
    float l[3][3];
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k) l[i][k] = static_cast<float>((k + 1) * (kBasis[i][0] * u[0] + kBasis[i][1] * u[1] + kBasis[i][2] * u[2]));
    std::mt19937 random(2);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 1000; ++i) {
        const auto n = unit(normal(random), normal(random), normal(random));
        float rgb[3];
        kiln_rnm_formula(KILN_RNM_DOT, l, n.data(), rgb);
        for (int k = 0; k < 3; ++k) EXPECT_NEAR(rgb[k], std::max(0.0, (k + 1) * (u[0] * n[0] + u[1] * n[1] + u[2] * n[2])), 3e-6);
    }
}

TEST(LevelRnm, SqIsAMeanOfWhatIsStoredAndTheMeanForAFlatNormal) {
    const float l[3][3] = {{1, 0, 5}, {2, 0, 5}, {6, 3, 5}};
    const float flat[3] = {0, 0, 1};
    float rgb[3];
    kiln_rnm_formula(KILN_RNM_SQ, l, flat, rgb);
    EXPECT_NEAR(rgb[0], 3, 1e-5);
    EXPECT_NEAR(rgb[1], 1, 1e-5);
    EXPECT_NEAR(rgb[2], 5, 1e-5);
    for (std::size_t i = 0; i < 3; ++i) { // along a basis vector: that one alone
        const auto n = unit(kBasis[i][0], kBasis[i][1], kBasis[i][2]);
        kiln_rnm_formula(KILN_RNM_SQ, l, n.data(), rgb);
        EXPECT_NEAR(rgb[0], l[i][0], 1e-5);
    }
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 1000; ++i) {
        const auto n = unit(normal(random), normal(random), std::abs(normal(random)));
        kiln_rnm_formula(KILN_RNM_SQ, l, n.data(), rgb);
        EXPECT_GE(rgb[0], 1 - 1e-5);
        EXPECT_LE(rgb[0], 6 + 1e-5);
        EXPECT_NEAR(rgb[2], 5, 1e-5);
    }
    const float down[3] = {0, 0, -1}; // below the surface: nothing, not a division by zero
    kiln_rnm_formula(KILN_RNM_SQ, l, down, rgb);
    EXPECT_EQ(rgb[0], 0);
}

TEST(LevelRnm, FlatOfSqIsTheMeanAndOfTiltedItsOwnLayer) {
    const auto value = [](std::size_t, std::uint32_t, std::uint32_t) {
        return std::array<Float3, 4>{Float3{7, 7, 7}, Float3{1, 1, 1}, Float3{2, 2, 2}, Float3{6, 6, 6}};
    };
    for (const auto& [encoding, wanted] : {std::pair{1, 3.0}, {2, 7.0}, {0, 9 / std::sqrt(3.0)}}) {
        const auto bytes = write_level(test::room(static_cast<std::uint8_t>(encoding), true, value));
        const Level level(bytes);
        float rgb[3];
        ASSERT_EQ(kiln_level_eval_flat(level.get(), 2, on_face(level, 2, 5, 5).data(), rgb), KILN_OK);
        EXPECT_NEAR(rgb[0], wanted, wanted * 1e-3);
    }
}

// Bilinear filtering gives back what is linear over the chart, on every face, whatever its orientation.
TEST(LevelRnm, BilinearFilteringIsExactForLinearLight) {
    const LevelContent c = test::room(0, false, [](std::size_t face, std::uint32_t x, std::uint32_t y) {
        const auto e = static_cast<float>(8 + 0.25 * x + 0.125 * y + static_cast<double>(face)); // exact in 9 bits
        return std::array<Float3, 4>{Float3{e, e, e}, {}, {}, {}};
    });
    const auto bytes = write_level(c, {.rgb9e5 = false});
    const Level level(bytes);
    std::mt19937 random(4);
    for (std::uint32_t face = 0; face < 6; ++face)
        for (int i = 0; i < 200; ++i) {
            const double s = 0.5 + 17.0 * (random() % 10000) / 10000, t = 0.5 + 17.0 * (random() % 10000) / 10000;
            float rgb[3];
            ASSERT_EQ(kiln_level_eval_flat(level.get(), face, on_face(level, face, s, t).data(), rgb), KILN_OK);
            EXPECT_NEAR(rgb[1], 8 + 0.25 * (s - 0.5) + 0.125 * (t - 0.5) + face, 1e-4);
        }
}

TEST(LevelRnm, AFaceWithoutAChartHasNothing) {
    LevelContent c = test::constant_room({1, 1, 1});
    c.faces[3].chart = UINT32_MAX;
    const auto bytes = write_level(c);
    const Level level(bytes);
    float rgb[3];
    const Point p{};
    EXPECT_EQ(kiln_level_eval_flat(level.get(), 3, p.data(), rgb), KILN_NONE);
    EXPECT_EQ(kiln_level_eval_flat(level.get(), 6, p.data(), rgb), KILN_BAD_ARGUMENT);
    EXPECT_FALSE(level.irradiance(3, p, {0, 0, 1}));
}

// A smooth chart: the frame follows the shading normal, so that this normal reads as flat.
TEST(LevelRnm, OnASmoothFaceTheShadingNormalIsFlat) {
    LevelContent c = test::room(0, true, [](std::size_t, std::uint32_t, std::uint32_t) {
        return std::array<Float3, 4>{Float3{1, 1, 1}, Float3{2, 2, 2}, Float3{0.5f, 0.5f, 0.5f}, Float3{0.2f, 0.2f, 0.2f}};
    });
    const auto tilted = unit(0.3, 0.4, 1);
    for (std::size_t t = 10; t < 12; ++t) c.corner_normals[t] = {tilted, tilted, tilted}; // the floor, face 5
    c.charts[5].smooth = true;
    const auto bytes = write_level(c);
    const Level level(bytes);
    const Point p = on_face(level, 5, 7.3, 4.2);
    float n[3];
    ASSERT_EQ(kiln_level_shading_normal(level.get(), 5, p.data(), n), KILN_OK);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(n[k], tilted[k], 1e-4);
    const auto e = level.irradiance(5, p, tilted);
    EXPECT_NEAR((*e)[0], 2.7 / std::sqrt(3.0), 2e-3);
    float t[3], b[3], m[3];
    ASSERT_EQ(kiln_level_tangent_frame(level.get(), 5, tilted.data(), t, b, m), KILN_OK);
    EXPECT_NEAR(t[0] * m[0] + t[1] * m[1] + t[2] * m[2], 0, 1e-6);
    EXPECT_NEAR(t[0] * b[0] + t[1] * b[1] + t[2] * b[2], 0, 1e-6);
    const kiln_face& f = level.faces()[5];
    EXPECT_GT(t[0] * f.tangent[0] + t[1] * f.tangent[1] + t[2] * f.tangent[2], 0.9);
    EXPECT_GT(b[0] * f.bitangent[0] + b[1] * f.bitangent[1] + b[2] * f.bitangent[2], 0.9);
}

// ---- Tree

TEST(LevelTree, PointsAreInTheLeafTheyAreIn) {
    const auto bytes = write_level(test::constant_room({1, 1, 1}));
    const Level level(bytes);
    std::mt19937 random(5);
    for (int i = 0; i < 2000; ++i) {
        const Point p{random() % 400 - 200.0, random() % 400 - 200.0, random() % 400 - 200.0};
        const bool inside = std::max({std::abs(p[0]), std::abs(p[1]), std::abs(p[2])}) <= 128; // on a plane: in front
        const std::uint32_t leaf = level.find_leaf(p);
        ASSERT_LT(leaf, 7u);
        EXPECT_EQ(leaf == 0, inside) << p[0] << " " << p[1] << " " << p[2];
    }
}

// ---- Ambient

namespace {
std::array<std::array<Float3, 6>, 8> random_corners() {
    std::mt19937 random(6);
    std::array<std::array<Float3, 6>, 8> corners{};
    for (auto& c : corners)
        for (auto& f : c)
            for (float& v : f) v = static_cast<float>(random() % 1000) / 256;
    return corners;
}
} // namespace

TEST(LevelAmbient, AtACornerItIsThatCube) {
    LevelContent c = test::constant_room({1, 1, 1});
    const auto corners = random_corners();
    test::add_air(c, corners, 0b00000001); // only corner 0 may be used: it is what the whole cell shows
    const auto bytes = write_level(c);
    const Level level(bytes);
    for (const Point p : {Point{-128, -128, -128}, Point{127, 127, 127}, Point{0, 50, -30}}) {
        float cube[6][3];
        ASSERT_EQ(kiln_level_ambient(level.get(), p.data(), cube), KILN_OK);
        for (std::size_t f = 0; f < 6; ++f)
            for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(cube[f][k], corners[0][f][k], 2e-3);
    }
    float cube[6][3];
    EXPECT_EQ(kiln_level_ambient(level.get(), Point{200, 0, 0}.data(), cube), KILN_NONE);
    EXPECT_EQ(kiln_level_ambient(level.get(), Point{NAN, 0, 0}.data(), cube), KILN_NONE);
}

TEST(LevelAmbient, BetweenCornersItIsTrilinear) {
    LevelContent c = test::constant_room({1, 1, 1});
    const auto corners = random_corners();
    test::add_air(c, corners);
    const auto bytes = write_level(c);
    const Level level(bytes);
    std::mt19937 random(7);
    for (int i = 0; i < 200; ++i) {
        double f[3];
        Point p{};
        for (std::size_t a = 0; a < 3; ++a) f[a] = 0.01 + 0.98 * (random() % 1000) / 1000, p[a] = -128 + 256 * f[a];
        float cube[6][3];
        ASSERT_EQ(kiln_level_ambient(level.get(), p.data(), cube), KILN_OK);
        double wanted = 0;
        for (unsigned k = 0; k < 8; ++k)
            wanted += (k & 1 ? f[0] : 1 - f[0]) * (k & 2 ? f[1] : 1 - f[1]) * (k & 4 ? f[2] : 1 - f[2]) * corners[k][3][1];
        EXPECT_NEAR(cube[3][1], wanted, 2e-3);
        const auto n = unit(0.3, -0.5, 0.8);
        float rgb[3];
        ASSERT_EQ(kiln_level_ambient_eval(level.get(), p.data(), n.data(), rgb), KILN_OK);
        EXPECT_NEAR(rgb[2], n[0] * n[0] * cube[0][2] + n[1] * n[1] * cube[3][2] + n[2] * n[2] * cube[4][2], 1e-5);
    }
}

TEST(LevelAmbient, LightsLeftOutCarryTheSharesOfTheirCorners) {
    LevelContent c = test::constant_room({1, 1, 1});
    test::add_air(c, random_corners());
    c.lights.resize(2);
    for (std::size_t i = 0; i < 8; ++i) c.cubes.cubes[i].local_lights = i & 1 ? std::vector<std::uint32_t>{1, 0} : std::vector<std::uint32_t>{0};
    const auto bytes = write_level(c);
    const Level level(bytes);
    kiln_light_weight out[4];
    std::size_t n = 0;
    ASSERT_EQ(kiln_level_ambient_lights(level.get(), Point{64, 0, 0}.data(), out, 4, &n), KILN_OK);
    ASSERT_EQ(n, 2u);
    EXPECT_NEAR(out[0].weight, 1, 1e-6);
    EXPECT_NEAR(out[1].weight, 0.75, 1e-6);
    ASSERT_EQ(kiln_level_ambient_lights(level.get(), Point{64, 0, 0}.data(), out, 1, &n), KILN_OK);
    EXPECT_EQ(n, 2u);
}

TEST(LevelAmbient, AWallThroughACellChoosesThePart) {
    LevelContent c = test::constant_room({1, 1, 1});
    const auto corners = random_corners();
    test::add_air(c, corners);
    CubeCell second = c.cubes.cells[0];
    for (std::size_t i = 1; i < 8; ++i) second.cubes[i] = UINT32_MAX;
    second.mask = 1; // beyond x = 10 only corner 0
    c.cubes.cells.push_back(second);
    c.cubes.cells[0].plane_normal = {1, 0, 0}, c.cubes.cells[0].plane_distance = 10, c.cubes.cells[0].beyond = 1;
    const auto bytes = write_level(c);
    const Level level(bytes);
    float cube[6][3];
    ASSERT_EQ(kiln_level_ambient(level.get(), Point{11, 0, 0}.data(), cube), KILN_OK);
    EXPECT_NEAR(cube[2][0], corners[0][2][0], 2e-3);
    ASSERT_EQ(kiln_level_ambient(level.get(), Point{9, 0, 0}.data(), cube), KILN_OK);
    EXPECT_GT(std::abs(cube[2][0] - corners[0][2][0]), 1e-2);
}

// Two planes part a cell into four: x < 10 and x > 10, each at y = -5; each part has one corner.
TEST(LevelAmbient, PartsBehindAWallMayBePartedAgain) {
    LevelContent c = test::constant_room({1, 1, 1});
    const auto corners = random_corners();
    test::add_air(c, corners);
    const CubeCell whole = c.cubes.cells[0];
    c.cubes.cells.clear();
    const auto add = [&](unsigned corner, Float3 normal, double distance, std::uint32_t beyond, std::uint32_t behind) {
        CubeCell cell = whole;
        cell.cubes.fill(UINT32_MAX);
        cell.cubes[corner] = whole.cubes[corner], cell.mask = static_cast<std::uint8_t>(1u << corner);
        cell.plane_normal = normal, cell.plane_distance = distance, cell.beyond = beyond, cell.behind = behind;
        c.cubes.cells.push_back(cell);
    };
    constexpr std::uint32_t kNone = UINT32_MAX;
    add(0, {1, 0, 0}, 10, 3, 1);       // its own corner is that of cell 1
    add(0, {0, 1, 0}, -5, 2, kNone);   // x < 10
    add(2, {}, 0, kNone, kNone);
    add(1, {0, 1, 0}, -5, 4, kNone);   // x > 10
    add(3, {}, 0, kNone, kNone);
    const auto shows = [&](const std::vector<std::uint8_t>& bytes, const Point& p, unsigned corner) {
        const Level level(bytes);
        float cube[6][3];
        ASSERT_EQ(kiln_level_ambient(level.get(), p.data(), cube), KILN_OK);
        for (std::size_t f = 0; f < 6; ++f) EXPECT_NEAR(cube[f][1], corners[corner][f][1], 2e-3) << p[0] << ' ' << p[1];
    };
    const auto bytes = write_level(c);
    shows(bytes, {9, -6, 0}, 0), shows(bytes, {9, -4, 0}, 2), shows(bytes, {11, -6, 0}, 1), shows(bytes, {11, -4, 0}, 3);
    {
        const Level level(bytes);
        ASSERT_EQ(level.cube_behind().size(), 5u);
        EXPECT_EQ(level.cube_behind()[0], 1u);
        EXPECT_EQ(level.cube_behind()[1], KILN_NO_INDEX);
        EXPECT_EQ(kiln_level_check(level.get(), nullptr), KILN_OK);
    }
    // Without the lump every cell is what is behind its wall.
    for (CubeCell& cell : c.cubes.cells) cell.behind = kNone;
    const auto without = write_level(c);
    shows(without, {9, -4, 0}, 0), shows(without, {11, -4, 0}, 3);
    const Level level(without);
    size_t count = 7;
    EXPECT_EQ(kiln_level_cube_behind(level.get(), &count), nullptr);
    EXPECT_EQ(count, 0u);
    // A part must come later, or a walk would never end.
    for (const std::uint32_t to : {0u, 1u, 5u}) {
        c.cubes.cells[1].behind = to;
        EXPECT_THROW(write_level(c), std::invalid_argument) << to;
    }
}

// ---- Cubemaps

TEST(LevelCubemap, TheDirectionThatATexelLooksToReadsThatTexel) {
    LevelContent c = test::constant_room({1, 1, 1});
    constexpr std::uint32_t size = 8;
    test::add_probe(c, size, 1, [](std::uint32_t, int face, double u, double v) {
        return Float3{static_cast<float>(face + 1) * 8, static_cast<float>(std::lround((u + 1) * 16)) , static_cast<float>(std::lround((v + 1) * 16))};
    });
    const auto bytes = write_level(c);
    const Level level(bytes);
    for (int face = 0; face < 6; ++face)
        for (int y = 0; y < 8; ++y)
            for (int x = 0; x < 8; ++x) {
                float d[3], rgb[3];
                kiln_cube_direction(face, (2 * x + 1) / 8.0f - 1, (2 * y + 1) / 8.0f - 1, d);
                for (float& v : d) v *= 3.7f; // need not be unit
                ASSERT_EQ(kiln_level_sample_cubemap(level.get(), 0, d, 0, rgb), KILN_OK);
                EXPECT_NEAR(rgb[0], (face + 1) * 8, 1e-2);
                EXPECT_NEAR(rgb[1], (2 * x + 1) * 2, 0.07);
                EXPECT_NEAR(rgb[2], (2 * y + 1) * 2, 0.07);
            }
}

// A radiance that is linear in the direction has no seam between faces.
TEST(LevelCubemap, NoSeamsAndMipsBlend) {
    LevelContent c = test::constant_room({1, 1, 1});
    test::add_probe(c, 64, 7, [](std::uint32_t m, int face, double u, double v) {
        float d[3];
        kiln_cube_direction(face, static_cast<float>(u), static_cast<float>(v), d);
        const auto n = unit(d[0], d[1], d[2]);
        return Float3{2 + n[0], 2 + n[1], static_cast<float>(m)};
    });
    const auto bytes = write_level(c);
    const Level level(bytes);
    std::mt19937 random(8);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 2000; ++i) {
        auto n = unit(normal(random), normal(random), normal(random));
        if (i % 2) n = unit(1, std::copysign(1 + 1e-3 * normal(random), normal(random)), normal(random) * 0.5); // along an edge
        float rgb[3];
        ASSERT_EQ(kiln_level_sample_cubemap(level.get(), 0, n.data(), 0, rgb), KILN_OK);
        EXPECT_NEAR(rgb[0], 2 + n[0], 0.03);
        EXPECT_NEAR(rgb[1], 2 + n[1], 0.03);
        ASSERT_EQ(kiln_level_sample_cubemap(level.get(), 0, n.data(), 0.375f, rgb), KILN_OK);
        EXPECT_NEAR(rgb[2], 0.375 * 6, 1e-4);
    }
}

TEST(LevelCubemap, ParallaxIsExactInABox) {
    LevelContent c = test::constant_room({1, 1, 1});
    test::add_probe(c, 1, 1, [](std::uint32_t, int, double, double) { return Float3{1, 1, 1}; });
    c.probes[0].position = {10, -20, 30}, c.probes[0].boxed = true;
    c.probes[0].box_lo = {-128, -128, -128}, c.probes[0].box_hi = {128, 128, 128};
    const auto bytes = write_level(c);
    const Level level(bytes);
    const Point p{64, 64, -100};
    const auto d = unit(-1, 0.2, 0.1); // meets x = -128
    float out[3];
    ASSERT_EQ(kiln_level_parallax_direction(level.get(), 0, p.data(), d.data(), out), KILN_OK);
    const double t = (-128 - p[0]) / d[0];
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(out[k], p[k] + t * d[k] - c.probes[0].position[k], 1e-3);
    EXPECT_EQ(kiln_level_nearest_cubemap(level.get(), p.data()), 0u);
}

// ---- Threads: first use of every part from several threads at a time.
TEST(LevelThreads, FirstUseMayBeAnywhere) {
    const auto bytes = write_level(test::mixture(4, 12));
    const Level level(bytes);
    std::vector<std::thread> threads;
    std::array<float, 4> seen{};
    for (std::size_t i = 0; i < 4; ++i)
        threads.emplace_back([&, i] {
            float rgb[3] = {};
            const Point p{20, 20, 5};
            for (std::uint32_t f = 0; f < 60; ++f) {
                const float n[3] = {0, 0, 1};
                if (kiln_level_eval_rnm(level.get(), f, p.data(), n, rgb) == KILN_OK) seen[i] += rgb[0];
            }
        });
    for (std::thread& t : threads) t.join();
    for (const float s : seen) EXPECT_EQ(s, seen[0]);
    EXPECT_GT(seen[0], 0);
}

} // namespace kiln::level

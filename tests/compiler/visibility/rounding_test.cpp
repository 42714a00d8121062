// What rounding may do to the planes and clips of the flow: open, never close. Numbers that are exact are of 113 bits here.
#include "compiler/visibility/flow.h"
#include <algorithm>
#include <cmath>
#include <cstring>
#include <gtest/gtest.h>
#include <random>

namespace kiln {
namespace {

using namespace vis;
using Exact = __float128;

struct Chance {
    std::mt19937_64 generator;
    double operator()(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(generator); }
    Vec3 direction() {
        Vec3 v;
        do v = {(*this)(-1, 1), (*this)(-1, 1), (*this)(-1, 1)};
        while (!(length(v) > 0.1 && length(v) < 1));
        return normalize(v);
    }
};

Exact exact_dot(Vec3 n, Vec3 x) { return Exact(n.x) * x.x + Exact(n.y) * x.y + Exact(n.z) * x.z; }

// The bound itself: planes through points far out, evaluated at others, near them and not.
TEST(VisibilityRounding, EvaluationStaysWithinItsBound) {
    Chance chance{std::mt19937_64(1)};
    for (const double reach : {1.0, 4096.0, 131072.0, 16777216.0}) {
        double worst = 0;
        for (int i = 0; i < 200000; ++i) {
            const Vec3 n = chance.direction();
            const auto far = [&] { return Vec3{std::copysign(reach, chance(-1, 1)), chance(-reach, reach), chance(-reach, reach)}; };
            const double d = dot(n, far());
            Vec3 x = far();
            if (i % 2) x = x - n * (dot(n, x) - d); // in the plane, but for rounding
            if (std::max({std::abs(x.x), std::abs(x.y), std::abs(x.z)}) > reach) continue;
            worst = std::max(worst, std::abs(static_cast<double>(exact_dot(n, x) - d - Exact(Plane{n, d}.at(x)))));
        }
        EXPECT_LE(worst, evaluation_error(reach));
        EXPECT_GE(worst, evaluation_error(reach) / 50); // a bound, not a guess far away
    }
}

// A convex polygon round a point of a line, in a plane at some angle to it, the point at least `margin` within; down to slits.
std::vector<Vec3> around(Chance& chance, Vec3 at, Vec3 way, double margin) {
    Vec3 n;
    const double grazing = chance(0, 1) < 0.3 ? 0.01 : 0.3;
    do n = chance.direction();
    while (dot(n, way) < grazing);
    const Vec3 u = normalize(cross(n, std::abs(n.x) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0})), v = cross(n, u);
    const auto side = [&] { return margin + (chance(0, 1) < 0.4 ? chance(0, 1e-5) : std::exp(chance(-10, 6))); };
    const double left = side(), right = side(), down = side(), up = side();
    std::vector<Vec3> w = {at - u * left - v * down, at + u * right - v * down, at + u * right + v * up, at - u * left + v * up};
    if (chance(0, 1) < 0.3) w.insert(w.begin() + 2, at + u * (right + chance(0, 1) * right)); // a fifth corner
    return w;
}

// Lines that pass every portal a little more than kInside within, at coordinates about 2^17 and less, through slits of some 1e-5 and at
// grazing angles: no plane that separates two portals of the chain has the crossing with a later one behind it or as near as the
// noise, so no clip loses it, and the flow marks all pairs.
TEST(VisibilityRounding, NoLineOfSightIsLost) {
    Chance chance{std::mt19937_64(2)};
    std::size_t planes = 0, closest = 0;
    for (int round = 0; round < 400; ++round) {
        const double offset = round % 4 == 0 ? 0 : round % 4 == 1 ? 4096 : 130000;
        const Vec3 way = round % 8 < 4 ? chance.direction() : Vec3{1, 0, 0};
        Vec3 at = Vec3{chance(-1, 1), chance(-1, 1), chance(-1, 1)} * offset;
        std::vector<VisPortal> portals;
        std::vector<Vec3> crossing;
        for (std::uint32_t i = 0; i < 6; ++i) {
            // Counter-clockwise seen from the front cluster: the normal looks against the way.
            std::vector<Vec3> w = around(chance, at, way, 1.5 * kInside);
            std::ranges::reverse(w);
            portals.push_back({i, i + 1, w});
            crossing.push_back(at);
            at = at + way * std::exp(chance(-2, 5));
        }
        const DirectedPortals directed = directed_portals(portals);
        const Rounding& rounding = directed.rounding;
        ASSERT_EQ(rounding.noise, kNoise);
        Planes found;
        for (std::size_t s = 0; s < 5; ++s)
            for (std::size_t p = s + 1; p < 6; ++p)
                for (const bool back : {false, true}) {
                    const Directed &source = directed.ways[2 * (back ? p : s) + back], &pass = directed.ways[2 * (back ? s : p) + back];
                    found.separate(source.shape, source, pass.shape, pass, rounding);
                    const PlanesView v = found.view();
                    for (std::uint32_t k = 0; k < v.n; ++k)
                        for (std::size_t t = 0; t < 6; ++t) {
                            if (back ? t > s : t < p) continue;
                            ++planes;
                            const Exact ahead = exact_dot({v.x[k], v.y[k], v.z[k]}, crossing[t]) - v.d[k];
                            EXPECT_GT(static_cast<double>(ahead), rounding.noise) << round << ": " << s << " " << p << " " << t;
                            closest += ahead < 1e-5;
                        }
                }
        Context context;
        for (const std::uint32_t rays : {0u, 128u}) {
            const auto v = compute_visibility(portals, 7, {.rays = rays}, context);
            ASSERT_TRUE(v);
            for (std::uint32_t a = 0; a < 7; ++a)
                for (std::uint32_t b = 0; b < 7; ++b) EXPECT_TRUE(v->sees(a, b)) << round << ": " << a << " " << b << " " << rays;
        }
    }
    EXPECT_GT(planes, 20000u);
    EXPECT_GT(closest, 500u); // it was a near thing
}

// Slits of 1e-5 in walls far out: open, and doors side by side in one wall still shut to each other.
TEST(VisibilityRounding, SlitsAndDoorsFarOut) {
    for (const double far : {0.0, 32768.0, 131072.0}) {
        std::vector<VisPortal> portals;
        for (std::uint32_t i = 0; i < 4; ++i) {
            const double x = far + 64 * i, y = -far, z = far;
            portals.push_back({i, i + 1, {{x, y, z}, {x, y, z + 64}, {x, y + 1e-5, z + 64}, {x, y + 1e-5, z}}});
        }
        for (std::uint32_t i = 0; i < 3; ++i) { // three rooms behind doors in one wall of the first
            const double x = far - 64, y = -far + 128 * i + 16, z = far;
            portals.push_back({0, 5 + i, {{x, y + 32, z}, {x, y + 32, z + 64}, {x, y, z + 64}, {x, y, z}}});
        }
        Context context;
        const auto v = compute_visibility(portals, 8, {}, context);
        ASSERT_TRUE(v);
        for (std::uint32_t a = 0; a < 5; ++a)
            for (std::uint32_t b = 0; b < 5; ++b) EXPECT_TRUE(v->sees(a, b)) << far;
        for (std::uint32_t a = 5; a < 8; ++a)
            for (std::uint32_t b = 5; b < 8; ++b) EXPECT_EQ(v->sees(a, b), a == b) << far << " " << a << " " << b;
    }
}

// The kernels of all processors give the same bits.
TEST(VisibilityRounding, KernelsAgree) {
#if defined(__x86_64__)
    if (!__builtin_cpu_supports("avx2")) GTEST_SKIP() << "this processor has no second set of kernels";
    Chance chance{std::mt19937_64(3)};
    const Kernels *const plain = &plain_kernels(), *const wide = &avx2_kernels();
    std::size_t cuts = 0, planes = 0;
    for (int round = 0; round < 3000; ++round) {
        const Vec3 way = chance.direction(), at = Vec3{chance(-1, 1), chance(-1, 1), chance(-1, 1)} * 4096;
        const std::vector<VisPortal> portals = {{0, 1, around(chance, at, -way, 1e-5)}, {1, 2, around(chance, at + way * chance(0.1, 90), -way, 1e-5)}, {2, 3, around(chance, at + way * 100, -way, 1e-5)}};
        const DirectedPortals d = directed_portals(portals);
        const Directed &s = d.ways[0], &p = d.ways[2], &t = d.ways[4];
        const double normals[6] = {s.plane.normal.x, s.plane.normal.y, s.plane.normal.z, p.plane.normal.x, p.plane.normal.y, p.plane.normal.z};
        std::vector<double> row[2], cut[2];
        bool hidden[2];
        Clip ends[2];
        std::uint64_t front[2], back[2];
        for (int k = 0; k < 2; ++k) {
            const Kernels& kernels = k ? *wide : *plain;
            row[k].assign(64, 0), cut[k].assign(6 * 64, 0);
            PlanesOut out{row[k].data(), row[k].data() + 16, row[k].data() + 32, row[k].data() + 48, 0};
            kernels.separators(s.shape, p.shape, normals, round % 2, kNoise, 1e-11, kInside, out);
            const PlanesView view{out.x, out.y, out.z, out.d, out.n};
            planes += out.n;
            hidden[k] = kernels.hidden(t.shape, t.sphere, view, kNoise);
            PointsOut a{cut[k].data(), cut[k].data() + 64, cut[k].data() + 128, 64, 0}, b{cut[k].data() + 192, cut[k].data() + 256, cut[k].data() + 320, 64, 0};
            ends[k] = kernels.clip(t.shape, view, t.sphere, 1e-3, kNoise, a, b);
            cuts += ends[k] == Clip::cut;
            const double plane[4] = {p.plane.normal.x, p.plane.normal.y, p.plane.normal.z, p.plane.distance};
            std::vector<double> spheres(16);
            const double* sphere[4] = {spheres.data(), spheres.data() + 4, spheres.data() + 8, spheres.data() + 12};
            const PointsView shapes[3] = {s.shape, p.shape, t.shape};
            for (std::size_t i = 0; i < 3; ++i)
                for (std::size_t c = 0; c < 4; ++c) spheres[4 * c + i] = d.ways[2 * i].sphere[c];
            const double everywhere[4] = {0, 0, 0, HUGE_VAL};
            const double* group[4] = {everywhere, everywhere + 1, everywhere + 2, everywhere + 3};
            kernels.sides(plane, group, sphere, shapes, 3, kNoise, &front[k], &back[k]);
        }
        ASSERT_EQ(std::memcmp(row[0].data(), row[1].data(), 64 * sizeof(double)), 0) << round;
        ASSERT_EQ(std::memcmp(cut[0].data(), cut[1].data(), cut[0].size() * sizeof(double)), 0) << round;
        ASSERT_EQ(hidden[0], hidden[1]);
        ASSERT_EQ(ends[0], ends[1]);
        ASSERT_EQ(front[0], front[1]);
        ASSERT_EQ(back[0], back[1]);
    }
    EXPECT_GT(cuts, 100u);
    EXPECT_GT(planes, 5000u);
#else
    GTEST_SKIP() << "there is one set of kernels";
#endif
}

// Sixty-four portals that lie together on one side of a plane are told so at once, and as one by one.
TEST(VisibilityRounding, PortalsTogetherAreOnTheSideOfEach) {
    Chance chance{std::mt19937_64(4)};
    std::size_t at_once = 0;
    for (int round = 0; round < 500; ++round) {
        const Vec3 middle = Vec3{chance(-1, 1), chance(-1, 1), chance(-1, 1)} * 4096, way = chance.direction();
        const double size = chance(1, 100), gap = round % 3 == 0 ? chance(-3 * kNoise, 3 * kNoise) : chance(-2, 2) * size;
        std::vector<VisPortal> portals;
        for (int i = 0; i < 64; ++i) portals.push_back({0, 1, around(chance, middle + Vec3{chance(-1, 1), chance(-1, 1), chance(-1, 1)} * size, chance.direction(), 1e-5)});
        const DirectedPortals d = directed_portals(portals);
        std::vector<double> spheres(4 * 64);
        std::vector<PointsView> shapes;
        double around_all[4] = {middle.x, middle.y, middle.z, 0}, plane[4] = {way.x, way.y, way.z, 0};
        for (std::size_t i = 0; i < 64; ++i) {
            const Directed& way_in = d.ways[2 * i];
            shapes.push_back(way_in.shape);
            for (std::size_t c = 0; c < 4; ++c) spheres[64 * c + i] = way_in.sphere[c];
            around_all[3] = std::max(around_all[3], length(way_in.center - middle) + way_in.radius);
        }
        plane[3] = dot(way, middle) + (gap < 0 ? -around_all[3] : around_all[3]) + gap;
        const double everywhere[4] = {0, 0, 0, HUGE_VAL};
        const double* sphere[4] = {spheres.data(), spheres.data() + 64, spheres.data() + 128, spheres.data() + 192};
        std::uint64_t front[2], back[2];
        for (int k = 0; k < 2; ++k) {
            const double* from = k ? around_all : everywhere;
            const double* group[4] = {from, from + 1, from + 2, from + 3};
            plain_kernels().sides(plane, group, sphere, shapes.data(), 64, kNoise, &front[k], &back[k]);
        }
        EXPECT_EQ(front[0], front[1]) << round;
        EXPECT_EQ(back[0], back[1]) << round;
        at_once += (front[1] == 0) != (back[1] == 0);
    }
    EXPECT_GT(at_once, 100u);
}

// Rows keep the blocks of words that have anything, and read as empty everywhere else.
TEST(SparseRows, HoldWhatDenseRowsHold) {
    Chance chance{std::mt19937_64(5)};
    const std::size_t n = 3000;
    BitRows dense(40, n);
    for (std::size_t r = 1; r < 40; ++r)
        for (int k = 0; k < 30; ++k) set_bit(dense.row(r), static_cast<std::size_t>(chance(0, r % 2 ? 0.2 : 1) * n));
    SparseRows sparse(dense);
    ASSERT_EQ(sparse.layout()->rows(), 40u);
    for (std::size_t r = 0; r < 40; ++r) {
        for (std::size_t i = 0; i < n; ++i) EXPECT_EQ(std::as_const(sparse).row(r).has(i), get_bit(dense.row(r), i));
        std::size_t bits = 0, words = 0;
        sparse.each_word(r, [&](std::size_t w, std::uint64_t word) {
            ++words;
            if (word) {
                EXPECT_EQ(word, dense.row(r)[w]);
            }
            each_bit(w, word, [&](std::uint32_t i) { bits += get_bit(dense.row(r), i); });
        });
        EXPECT_EQ(bits, count_bits(dense.row(r), dense.words()));
        EXPECT_EQ(words + kBlockWords, sparse.kept(r).size());
        if (r % 2) {
            EXPECT_LE(words, 2 * kBlockWords); // 600 of 3,000 bits
        }
    }
    EXPECT_EQ(sparse.row(0).place(7), nullptr);
    // Others of the same layout, in another order.
    SparseRows like(sparse.layout(), 2, [](std::size_t r) { return 5 - r; });
    *like.row(1).place(3) |= 8;
    EXPECT_TRUE(std::as_const(like).row(1).has(3));
    EXPECT_EQ(like.kept(0).size(), sparse.kept(5).size());
    EXPECT_EQ(like.kept(1).size(), sparse.kept(4).size());
}

} // namespace
} // namespace kiln

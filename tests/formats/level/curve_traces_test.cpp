// Boxes and rays swept against displacements and curved patches, through the file and the C interface.
#include "formats/level/kiln_level.hpp"
#include "formats/level/level_state.h"
#include "tests/formats/level/sample_level.h"
#include <algorithm>
#include <functional>
#include <gtest/gtest.h>
#include <optional>
#include <thread>

namespace kiln::level {
namespace {

constexpr double kRest = KILN_TRACE_DISTANCE, kContact = kRest / 2, kTouch = 1.0 / 1024;

struct V {
    double x = 0, y = 0, z = 0;
    double& operator[](std::size_t k) { return (&x)[k]; }
    double operator[](std::size_t k) const { return (&x)[k]; }
    friend V operator+(V a, V b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
    friend V operator-(V a, V b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    friend V operator*(V a, double s) { return {a.x * s, a.y * s, a.z * s}; }
    V operator-() const { return {-x, -y, -z}; }
    friend bool operator==(const V&, const V&) = default;
};
double dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
V crossed(V a, V b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
double length(V a) { return std::sqrt(dot(a, a)); }
V unit(V a) { return a * (1 / length(a)); }
V vec(const double (&v)[3]) { return {v[0], v[1], v[2]}; }
double reach(V n, V half) { return std::fabs(n.x) * half.x + std::fabs(n.y) * half.y + std::fabs(n.z) * half.z; }

using Height = std::function<double(double, double)>;

Displacement displacement(double x0, double y0, double x1, double y1, std::uint32_t power, const Height& height) {
    Displacement d;
    d.power = power;
    d.base = {Double3{x0, y0, 0}, {x1, y0, 0}, {x1, y1, 0}, {x0, y1, 0}};
    const int n = 1 << power;
    for (int r = 0; r <= n; ++r)
        for (int c = 0; c <= n; ++c) {
            const double x = x0 + (x1 - x0) * c / n, y = y0 + (y1 - y0) * r / n;
            d.positions.push_back(test::f3({x, y, height(x, y)})), d.alphas.push_back(0);
        }
    return d;
}
// 4 x 4 squares of 128 units around the origin, of one power or of all; borders as the compiler sews them: a finer vertex lies
// on the coarser edge. Heights of a plane need none of that.
std::vector<Displacement> terrain(const Height& height, bool mixed, std::mt19937_64& rng) {
    std::uint32_t power[4][4];
    for (auto& row : power)
        for (std::uint32_t& p : row) p = mixed ? 2 + static_cast<std::uint32_t>(rng() % 3) : 3;
    std::vector<Displacement> out;
    for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i) {
            const double x0 = 128.0 * (i - 2), y0 = 128.0 * (j - 2);
            const auto of = [&](int a, int b) { return power[std::clamp(b, 0, 3)][std::clamp(a, 0, 3)]; };
            // Along a border: linear between the vertices of the coarser side.
            const auto along = [&](double from, double at, std::uint32_t p, const auto& h) {
                const double step = 128.0 / (1 << p), lo = from + std::floor((at - from) / step) * step, t = (at - lo) / step;
                return t == 0 ? h(at) : (1 - t) * h(lo) + t * h(lo + step);
            };
            out.push_back(displacement(x0, y0, x0 + 128, y0 + 128, power[j][i], [&](double x, double y) {
                const bool on_x = x == x0 || x == x0 + 128, on_y = y == y0 || y == y0 + 128;
                if (on_x && !on_y) return along(y0, y, std::min(of(i, j), of(x == x0 ? i - 1 : i + 1, j)), [&](double v) { return height(x, v); });
                if (on_y && !on_x) return along(x0, x, std::min(of(i, j), of(i, y == y0 ? j - 1 : j + 1)), [&](double v) { return height(v, y); });
                return height(x, y);
            }));
        }
    return out;
}
double hills(double x, double y) { return 30 * std::sin(x / 60) * std::cos(y / 45) + 20 * std::sin((x + y) / 37); }

CurvedPatch sphere(double radius, std::uint32_t columns, std::uint32_t rows) {
    CurvedPatch p;
    p.columns = columns, p.rows = rows;
    for (std::uint32_t r = 0; r < rows; ++r)
        for (std::uint32_t c = 0; c < columns; ++c) {
            const double a = 2 * test::kPi * c / (columns - 1), b = test::kPi * (r / (rows - 1.0) - 0.5);
            p.positions.push_back(test::f3({radius * std::cos(a) * std::cos(b), radius * std::sin(a) * std::cos(b), radius * std::sin(b)}));
            p.uv.push_back({0, 0});
        }
    return p;
}

struct Tri {
    V corner[3];
    std::uint32_t displacement, patch, number;
};

// A room without brushes that holds curves; and all their triangles, cut as FORMAT.md says, for looking at every one.
struct Arena {
    std::vector<std::uint8_t> bytes;
    std::optional<Level> level;
    std::vector<Tri> all;

    Arena(std::vector<Displacement> displacements, std::vector<CurvedPatch> patches, const std::function<void(LevelContent&)>& more = {}) {
        LevelContent c = test::constant_room({1, 1, 1});
        c.displacements = std::move(displacements), c.patches = std::move(patches);
        if (more) more(c);
        bytes = write_level(c);
        level.emplace(bytes);
        EXPECT_EQ(kiln_level_check(level->get(), nullptr), KILN_OK);
        std::size_t n = 0;
        const kiln_displacement* d = kiln_level_displacements(level->get(), &n);
        for (std::uint32_t i = 0; i < n; ++i)
            add(i, KILN_NO_INDEX, (1u << d[i].power) + 1, (1u << d[i].power) + 1, kiln_level_displacement_vertices(level->get(), nullptr) + 4 * std::size_t{d[i].first_vertex}, 4);
        const kiln_curved_patch* p = kiln_level_curved_patches(level->get(), &n);
        for (std::uint32_t i = 0; i < n; ++i)
            add(KILN_NO_INDEX, i, p[i].columns, p[i].rows, kiln_level_patch_vertices(level->get(), nullptr) + 5 * std::size_t{p[i].first_vertex}, 5);
    }
    void add(std::uint32_t displacement, std::uint32_t patch, std::uint32_t columns, std::uint32_t rows, const float* vertices, std::size_t stride) {
        for (std::uint32_t r = 0; r + 1 < rows; ++r)
            for (std::uint32_t c = 0; c + 1 < columns; ++c) {
                const auto at = [&](std::uint32_t y, std::uint32_t x) {
                    const float* v = vertices + stride * ((r + y) * columns + c + x);
                    return V{v[0], v[1], v[2]};
                };
                const std::uint32_t q = 2 * (r * (columns - 1) + c);
                if ((r + c) % 2 == 0) {
                    all.push_back({{at(0, 0), at(1, 1), at(1, 0)}, displacement, patch, q});
                    all.push_back({{at(0, 0), at(0, 1), at(1, 1)}, displacement, patch, q + 1});
                } else {
                    all.push_back({{at(0, 0), at(0, 1), at(1, 0)}, displacement, patch, q});
                    all.push_back({{at(0, 1), at(1, 1), at(1, 0)}, displacement, patch, q + 1});
                }
            }
    }
    const Tri& met(const kiln_trace& t) const {
        for (const Tri& tri : all)
            if (tri.displacement == t.displacement && tri.patch == t.patch && tri.number == t.triangle) return tri;
        throw std::out_of_range("a trace names a triangle that is not there"); // ends the test
    }
    kiln_trace trace(V start, V end, V mins, V maxs, std::uint32_t mask = KILN_MASK_PLAYERS) const {
        kiln_trace t{};
        EXPECT_EQ(kiln_trace_box(level->get(), &start.x, &end.x, &mins.x, &maxs.x, mask, &t), KILN_OK);
        return t;
    }
    kiln_trace trace(V start, V end, V half, std::uint32_t mask = KILN_MASK_PLAYERS) const { return trace(start, end, -half, half, mask); }
};

// Part of the triangle that is in the box: cut by its six sides. No separating axes in it.
bool overlaps(const Tri& t, V lo, V hi) {
    std::vector<V> part(t.corner, t.corner + 3);
    for (std::size_t k = 0; k < 3; ++k)
        for (const int sign : {1, -1}) {
            std::vector<V> kept;
            const auto inside = [&](V p) { return sign > 0 ? hi[k] - p[k] : p[k] - lo[k]; };
            for (std::size_t i = 0; i < part.size(); ++i) {
                const V a = part[i], b = part[(i + 1) % part.size()];
                const double s = inside(a), e = inside(b);
                if (s >= 0) kept.push_back(a);
                if ((s < 0) != (e < 0)) kept.push_back(a + (b - a) * (s / (s - e)));
            }
            part = std::move(kept);
        }
    return !part.empty();
}
bool near_way(const Tri& t, V from, V to, V mins, V maxs, double grow) {
    for (std::size_t k = 0; k < 3; ++k) {
        const auto [least, most] = std::minmax({t.corner[0][k], t.corner[1][k], t.corner[2][k]});
        if (least > std::max(from[k], to[k]) + maxs[k] + grow || most < std::min(from[k], to[k]) + mins[k] - grow) return false;
    }
    return true;
}
// The first place on the way, 0..1, where the box grown by `grow` meets a triangle; 2: none. Least t of all points
// a + u e + v f of the triangle within the box at t: a linear program of three unknowns, every vertex of it tried.
double first_meeting(const Tri& tri, V from, V to, V mins, V maxs, double grow) {
    struct Row {
        double u, v, t, most; // u U + v V + t T <= most
    };
    std::array<Row, 11> rows{{{-1, 0, 0, 0}, {0, -1, 0, 0}, {1, 1, 0, 1}, {0, 0, -1, 0}, {0, 0, 1, 1}}};
    const V e = tri.corner[1] - tri.corner[0], f = tri.corner[2] - tri.corner[0], w = to - from;
    for (std::size_t k = 0; k < 3; ++k) {
        const double off = from[k] - tri.corner[0][k];
        rows[5 + 2 * k] = {e[k], f[k], -w[k], off + maxs[k] + grow};
        rows[6 + 2 * k] = {-e[k], -f[k], w[k], -(off + mins[k] - grow)};
    }
    double best = 2;
    for (std::size_t a = 0; a < rows.size(); ++a)
        for (std::size_t b = a + 1; b < rows.size(); ++b)
            for (std::size_t c = b + 1; c < rows.size(); ++c) {
                const V x{rows[a].u, rows[b].u, rows[c].u}, y{rows[a].v, rows[b].v, rows[c].v}, z{rows[a].t, rows[b].t, rows[c].t};
                const V m{rows[a].most, rows[b].most, rows[c].most};
                const double det = dot(x, crossed(y, z));
                if (std::fabs(det) < 1e-12 * length(x) * length(y) * length(z)) continue;
                const double u = dot(m, crossed(y, z)) / det, v = dot(x, crossed(m, z)) / det, t = dot(x, crossed(y, m)) / det;
                if (t >= best) continue;
                bool holds = true;
                for (const Row& r : rows) holds = holds && r.u * u + r.v * v + r.t * t <= r.most + 1e-9 * (1 + std::fabs(r.t));
                if (holds) best = t;
            }
    return best;
}
double toward(const kiln_trace& t, V from, V to) { return -dot(vec(t.normal), to - from); }

double uniform(std::mt19937_64& rng, double a, double b) { return std::uniform_real_distribution<double>(a, b)(rng); }
V random_vector(std::mt19937_64& rng, double r) { return {uniform(rng, -r, r), uniform(rng, -r, r), uniform(rng, -r, r)}; }

TEST(CurveTraces, ABoxFallsOnAFlatDisplacement) {
    Displacement flat = displacement(-128, -128, 128, 128, 2, [](double, double) { return 10; });
    for (std::uint16_t i = 0; i < 32; ++i) flat.triangle_tags.push_back(static_cast<std::uint16_t>(100 + i));
    const Arena a({flat}, {});
    const V half{16, 16, 36};
    const kiln_trace fall = a.trace({5, 7, 200}, {5, 7, -200}, half);
    EXPECT_NEAR(fall.end[2], 10 + 36 + kRest, 1e-12);
    EXPECT_EQ(vec(fall.normal), (V{0, 0, 1}));
    EXPECT_EQ(fall.distance, 10);
    EXPECT_EQ(fall.contents, static_cast<std::uint32_t>(KILN_CONTENTS_SOLID));
    EXPECT_EQ(fall.brush, KILN_NO_INDEX);
    EXPECT_EQ(fall.side, KILN_NO_INDEX);
    EXPECT_EQ(fall.displacement, 0u);
    EXPECT_EQ(fall.patch, KILN_NO_INDEX);
    EXPECT_FALSE(fall.start_solid || fall.all_solid);
    const kiln_trace rise = a.trace({5, 7, -200}, {5, 7, 200}, half);
    EXPECT_NEAR(rise.end[2], 10 - 36 - kRest, 1e-12);
    EXPECT_EQ(vec(rise.normal), (V{0, 0, -1}));
    EXPECT_EQ(rise.distance, -10);
    // At rest it slides as far as it likes, over edges and off the border.
    const kiln_trace along = a.trace(vec(fall.end), vec(fall.end) + V{300, 200, 0}, half);
    EXPECT_EQ(along.fraction, 1);
    EXPECT_EQ(along.displacement, KILN_NO_INDEX);
    EXPECT_EQ(along.triangle, KILN_NO_INDEX);
    // Past the border; and onto it from the side, where the sheet is as thin as it is.
    EXPECT_EQ(a.trace({145, 0, 200}, {145, 0, -200}, half).fraction, 1);
    const kiln_trace edge = a.trace({300, 0, 10}, {0, 0, 10}, half);
    EXPECT_NEAR(edge.end[0], 128 + 16 + kRest, 1e-12);
    EXPECT_EQ(vec(edge.normal), (V{1, 0, 0}));
    // Rays name the triangle they hit, and its tag.
    for (std::uint32_t r = 0; r < 4; ++r)
        for (std::uint32_t c = 0; c < 4; ++c)
            for (std::uint32_t k = 0; k < 2; ++k) {
                const V p{-128 + 64.0 * c + (k ? 50 : 14), -128 + 64.0 * r + 32, 50};
                const kiln_trace ray = a.trace(p, p + V{0, 0, -100}, {});
                EXPECT_NEAR(ray.end[2], 10 + kRest, 1e-12);
                EXPECT_EQ(ray.triangle, 2 * (4 * r + c) + k);
                EXPECT_EQ(ray.tag, 100 + ray.triangle);
            }
}

TEST(CurveTraces, ASlopeStopsByTheReachOfTheBox) {
    std::mt19937_64 rng(2);
    for (int i = 0; i < 200; ++i) {
        const double p = uniform(rng, -2, 2), q = uniform(rng, -2, 2);
        const Arena a({displacement(-128, -128, 128, 128, 2 + i % 3, [&](double x, double y) { return p * x + q * y + 3; })}, {});
        const V n = unit({-p, -q, 1}), half{uniform(rng, 0, 24), uniform(rng, 0, 24), uniform(rng, 0, 40)};
        const V start{uniform(rng, -20, 20), uniform(rng, -20, 20), 300}, end = start + V{uniform(rng, -60, 60), uniform(rng, -60, 60), -900};
        for (const double side : {1., -1.}) {
            const V from = side > 0 ? start : end, to = side > 0 ? end : start;
            const kiln_trace t = a.trace(from, to, half);
            // The first place on the way where dot(n, x) is that of the sheet and the reach before it: is it over the sheet?
            const double wanted = side * (n.z * 3) + reach(n, half) + kRest;
            const double f = (wanted - side * dot(n, from)) / (side * dot(n, to - from));
            const V at = from + (to - from) * f;
            if (std::fabs(at.x) > 80 || std::fabs(at.y) > 80) continue;
            EXPECT_NEAR(t.fraction, f, 1e-7); // vertices are floats
            EXPECT_LT(length(vec(t.normal) - n * side), 1e-5);
        }
    }
}

TEST(CurveTraces, ASphereStopsWithinItsFlatness) {
    const double radius = 100;
    const Arena a({}, {sphere(radius, 65, 33)});
    const double sagitta = radius * (1 - std::pow(std::cos(test::kPi / 64), 2));
    std::mt19937_64 rng(3);
    for (int i = 0; i < 2000; ++i) {
        const V half = i % 4 ? V{uniform(rng, 0, 24), uniform(rng, 0, 24), uniform(rng, 0, 40)} : V{};
        const V from = unit(random_vector(rng, 1)) * 400, to = random_vector(rng, 30);
        const kiln_trace t = a.trace(from, to, half);
        ASSERT_LT(t.fraction, 1);
        EXPECT_EQ(t.patch, 0u);
        EXPECT_EQ(t.displacement, KILN_NO_INDEX);
        const auto distance = [&](V at) { // from the middle
            V nearest;
            for (std::size_t k = 0; k < 3; ++k) nearest[k] = std::max(0.0, std::fabs(at[k]) - half[k]);
            return length(nearest);
        };
        ASSERT_GT(distance(vec(t.end)), radius - sagitta);
        ASSERT_GT(toward(t, from, to), 0);
        ASSERT_LT(distance(from + (to - from) * (t.fraction + kRest / toward(t, from, to))), radius + kContact + kTouch);
        // From inside as well, unless it starts across.
        const kiln_trace out = a.trace(V{}, from, half);
        if (length(half) > radius - sagitta - kTouch) continue;
        ASSERT_FALSE(out.start_solid);
        V nearest;
        for (std::size_t k = 0; k < 3; ++k) nearest[k] = std::fabs(out.end[k]) + half[k];
        ASSERT_LT(length(nearest), radius);
        ASSERT_GT(length(nearest), radius - sagitta - 8); // at most that much is left: the farthest corner need not be what meets
    }
}

// Against all triangles, by another method: no sweep passes through one, none is stopped farther off than the distances say.
TEST(CurveTraces, SweepsAgreeWithAllTriangles) {
    std::mt19937_64 rng(4);
    std::vector<Displacement> sheets = terrain(hills, true, rng);
    for (Displacement& d : sheets) // overhangs, slivers, triangles without area
        for (Float3& p : d.positions)
            if (rng() % 6 == 0) p = test::f3({p[0] + uniform(rng, -40, 40), p[1] + uniform(rng, -40, 40), p[2] + uniform(rng, -40, 40)});
            else if (rng() % 6 == 0) p = d.positions[0];
    CurvedPatch ball = sphere(60, 17, 9);
    for (Float3& p : ball.positions) p[2] += 90;
    const Arena a(std::move(sheets), {ball});
    int stopped = 0, free = 0, across = 0, rays = 0;
    double nearest = 1;
    for (int i = 0; i < 3000; ++i) {
        const V mins = i % 4 == 0 ? V{} : -V{uniform(rng, 0, 20), uniform(rng, 0, 20), uniform(rng, 0, 36)};
        const V maxs = i % 4 == 0 ? V{} : i % 4 == 1 ? -mins : V{uniform(rng, 0, 20), 0, uniform(rng, 0, 36)};
        const V from{uniform(rng, -300, 300), uniform(rng, -300, 300), uniform(rng, -80, 200)};
        V to = from + random_vector(rng, i % 3 ? 60 : 400);
        if (i % 5 == 0) to[rng() % 3] = from[rng() % 3];
        const kiln_trace t = a.trace(from, to, mins, maxs);
        ASSERT_TRUE(t.fraction >= 0 && t.fraction <= 1);
        double touch = 2, reach = 2; // the first meeting of the box, and of the box grown by what its contacts may reach
        bool in = false, near = false;
        const double grow = kContact + 2 * kTouch;
        for (const Tri& tri : a.all) {
            if (!near_way(tri, from, to, mins, maxs, 0.1)) continue;
            if (length(crossed(tri.corner[1] - tri.corner[0], tri.corner[2] - tri.corner[0])) == 0) continue; // a line is no surface
            touch = std::min(touch, first_meeting(tri, from, to, mins, maxs, 0)), reach = std::min(reach, first_meeting(tri, from, to, mins, maxs, grow));
            near = near || overlaps(tri, from + mins - V{.01, .01, .01}, from + maxs + V{.01, .01, .01});
            in = in || overlaps(tri, from + mins + V{.01, .01, .01}, from + maxs - V{.01, .01, .01});
        }
        if (in) {
            across += i % 4 != 0;
            EXPECT_TRUE(t.start_solid || i % 4 == 0);
        }
        if (near) continue;
        EXPECT_FALSE(t.start_solid);
        rays += i % 4 == 0;
        ASSERT_LE(t.fraction, touch) << i;
        if (t.fraction == 1) {
            ++free;
            continue;
        }
        ++stopped;
        const double way = length(to - from);
        ASSERT_GT(toward(t, from, to), 0);
        ASSERT_LE(reach, 1) << i;
        ASSERT_GE(t.fraction, reach - kRest / toward(t, from, to) - 1e-9) << i;
        EXPECT_LT(t.fraction, touch);
        nearest = std::min(nearest, (touch - t.fraction) * way);
        // Its plane touches the triangle it names, which lies behind it.
        double most = -1e30;
        for (const V& c : a.met(t).corner) most = std::max(most, dot(vec(t.normal), c));
        EXPECT_NEAR(most, t.distance, 1e-9);
    }
    EXPECT_GT(nearest, kContact);
    EXPECT_GT(stopped, 400);
    EXPECT_GT(free, 400);
    EXPECT_GT(across, 80);
    EXPECT_GT(rays, 400);
}

struct Slid {
    V at;
    std::vector<V> normals;
};
Slid slide(const Arena& a, V at, V move, V half) { // as a game does
    Slid w{at, {}};
    for (int bump = 0; bump < 4; ++bump) {
        const kiln_trace t = a.trace(w.at, w.at + move, half);
        EXPECT_FALSE(t.start_solid);
        w.at = vec(t.end);
        if (t.fraction == 1) return w;
        move = move * (1 - t.fraction);
        w.normals.push_back(vec(t.normal));
        const V before = move;
        std::size_t i = 0;
        for (; i < w.normals.size(); ++i) {
            const V v = before - w.normals[i] * dot(before, w.normals[i]);
            if (!std::ranges::all_of(w.normals, [&](V n) { return dot(v, n) >= -1e-9; })) continue;
            move = v;
            break;
        }
        if (i < w.normals.size()) continue;
        if (w.normals.size() != 2) return w;
        const V crease = crossed(w.normals[0], w.normals[1]);
        if (!(length(crease) > 1e-9)) return w;
        move = unit(crease) * dot(unit(crease), before);
    }
    return w;
}

// A plane made of triangles of all sizes is one floor: its edges stop nothing, whatever their vertices were rounded to.
TEST(CurveTraces, APlaneOfTrianglesIsSmooth) {
    std::mt19937_64 rng(5);
    for (int round = 0; round < 20; ++round) {
        const double p = round ? uniform(rng, -0.9, 0.9) : 0, q = round ? uniform(rng, -0.9, 0.9) : 0;
        const V n = unit({-p, -q, 1});
        const Arena a(terrain([&](double x, double y) { return p * x + q * y; }, true, rng), {});
        for (int walk = 0; walk < 10; ++walk) {
            const V half{uniform(rng, 0, 20), uniform(rng, 0, 20), uniform(rng, 0, 36)};
            const double direction = uniform(rng, 0, 6.283);
            V at = vec(a.trace(V{0, 0, 400}, V{0, 0, -400}, half).end);
            const V from = at, wish = V{std::cos(direction), std::sin(direction), 0} * 4;
            const V step = wish - n * dot(n, wish) - n * 0.5; // along the floor, and pressed on it
            for (int k = 0; k < 50; ++k) {
                const Slid s = slide(a, at, step, half);
                at = s.at;
                for (const V& m : s.normals) ASSERT_LT(length(m - n), 1e-4) << "stopped by an edge at step " << k << " round " << round << " m " << m.x << ' ' << m.y << ' ' << m.z << " n " << n.x << ' ' << n.y << ' ' << n.z << " at " << at.x << ' ' << at.y << " half " << half.x << ' ' << half.y << ' ' << half.z << " off " << dot(n, at) - reach(n, half);
            }
            EXPECT_NEAR(dot(at - from, unit(wish - n * dot(n, wish))), 50 * length(wish - n * dot(n, wish)), 0.01);
            EXPECT_GT(dot(n, at) - reach(n, half), kContact - 1e-3);
        }
    }
}

// Over what bends away everywhere no edge is a step, whichever way it runs and however sharp it is: all that stops a box is what
// lies under it.
TEST(CurveTraces, RidgesAreNoSteps) {
    std::mt19937_64 rng(11);
    for (int round = 0; round < 12; ++round) {
        const double bend = uniform(rng, 0, 1e-3), p = uniform(rng, 0.2, 0.7), q = uniform(rng, -0.5, 0.5), turn = uniform(rng, 0, 3.1416);
        const Arena a(terrain([&](double x, double y) {
            const double u = std::cos(turn) * x + std::sin(turn) * y;
            return -bend * (x * x + y * y) - p * std::fabs(round % 2 ? x : u) + q * y;
        }, false, rng), {});
        for (int walk = 0; walk < 12; ++walk) {
            const V half = walk % 6 ? V{uniform(rng, 0, 20), uniform(rng, 0, 20), uniform(rng, 0, 36)} : V{};
            const double direction = uniform(rng, 0, 6.283);
            const V along{std::cos(direction), std::sin(direction), 0};
            V at = vec(a.trace(along * -200 + V{0, 0, 500}, along * -200 + V{0, 0, -900}, half).end);
            for (int k = 0; k < 100; ++k) {
                const V before = at;
                const Slid s = slide(a, at, along * 4 + V{0, 0, k % 2 ? -6. : -0.5}, half);
                at = s.at;
                if (std::max(std::fabs(at.x), std::fabs(at.y)) > 220) break;
                for (const V& m : s.normals) ASSERT_GT(m.z, 0.5) << m.x << ' ' << m.y << ' ' << m.z << " round " << round << " walk " << walk << " step " << k;
                if (k % 2 == 0) {
                    ASSERT_GT(dot(at - before, along), 0.5);
                }
            }
        }
    }
}

// Up and down over hills: always on, never in or through what lies there, and moving unless a wall of it is in the way.
TEST(CurveTraces, WalksOverHillsStayAboveThem) {
    std::mt19937_64 rng(6);
    const Arena a(terrain([](double x, double y) { return 0.8 * hills(x, y); }, true, rng), {});
    int stops = 0, idle = 0, steps = 0;
    for (int walk = 0; walk < 60; ++walk) {
        const V half{uniform(rng, 1, 20), uniform(rng, 1, 20), uniform(rng, 4, 36)};
        V at = vec(a.trace(V{uniform(rng, -150, 150), uniform(rng, -150, 150), 300}, V{0, 0, -400}, half).end);
        double direction = uniform(rng, 0, 6.283);
        for (int k = 0; k < 100; ++k) {
            const V wish{8 * std::cos(direction), 8 * std::sin(direction), -4};
            const Slid s = slide(a, at, wish, half);
            const V moved = s.at - at;
            at = s.at;
            ++steps, stops += static_cast<int>(s.normals.size()), idle += length({moved.x, moved.y, 0}) < 0.5;
            for (const Tri& t : a.all)
                if (near_way(t, at, at, -half, half, 0)) {
                    ASSERT_FALSE(overlaps(t, at - half, at + half));
                }
            if (std::max(std::fabs(at.x), std::fabs(at.y)) > 220 || k % 30 == 29) direction = std::atan2(-at.y, -at.x) + uniform(rng, -1, 1);
            // A ray from its middle to above meets nothing: it is on the upper side.
            if (std::max(std::fabs(at.x), std::fabs(at.y)) < 256) {
                ASSERT_EQ(a.trace(at, at + V{0, 0, 1000}, {}).fraction, 1);
            }
        }
    }
    EXPECT_GT(stops, steps / 2);
    EXPECT_LT(idle, steps / 10);

}

// Where powers differ, the finer vertices lie on the coarser edge up to their rounding: nothing thin falls in between.
TEST(CurveTraces, BordersOfUnequalPowersAreTight) {
    std::mt19937_64 rng(7);
    const Arena a(terrain(hills, true, rng), {});
    for (int i = 0; i < 20000; ++i) {
        V at{uniform(rng, -250, 250), uniform(rng, -250, 250), 0};
        at[rng() % 2] = 128.0 * static_cast<double>(rng() % 3) - 128 + (i % 3 ? 0 : uniform(rng, -1e-4, 1e-4));
        V way{0, 0, 200};
        if (i % 2) way.x = uniform(rng, -60, 60), way.y = uniform(rng, -60, 60);
        const V half = i % 4 == 0 ? V{1e-3, 0, 0} : i % 4 == 1 ? V{0, 0, 1} : V{};
        const bool down = rng() % 2;
        const V from = at + (down ? way : -way), to = at - (down ? way : -way);
        if (std::max(std::fabs(from.x), std::fabs(to.x)) > 250 || std::max(std::fabs(from.y), std::fabs(to.y)) > 250) continue;
        const kiln_trace t = a.trace(from, to, half);
        ASSERT_LT(t.fraction, 1) << at.x << ' ' << at.y;
        ASSERT_GT(t.fraction, 0);
    }
}

TEST(CurveTraces, ABoxAcrossASheetGetsOutAndNeverThrough) {
    const Arena a({displacement(-128, -128, 128, 128, 3, [](double, double) { return 0; })}, {});
    const V half{8, 8, 16};
    const V sunk{4, 4, 12}; // four units deep
    const kiln_trace stay = a.trace(sunk, sunk, half);
    EXPECT_TRUE(stay.start_solid && stay.all_solid);
    EXPECT_EQ(stay.fraction, 0);
    EXPECT_NE(stay.displacement, KILN_NO_INDEX);
    EXPECT_EQ(stay.contents, static_cast<std::uint32_t>(KILN_CONTENTS_SOLID));
    const kiln_trace up = a.trace(sunk, sunk + V{3, 1, 30}, half);
    EXPECT_TRUE(up.start_solid);
    EXPECT_EQ(up.fraction, 1);
    for (const V way : {V{0, 0, -1}, V{0, 0, -200}, V{5, 1, -0.25}}) {
        const kiln_trace down = a.trace(sunk, sunk + way, half);
        EXPECT_TRUE(down.start_solid);
        EXPECT_FALSE(down.all_solid);
        EXPECT_EQ(down.fraction, 0);
        EXPECT_EQ(vec(down.normal), (V{0, 0, 1}));
    }
    EXPECT_EQ(a.trace(-sunk, -sunk + V{0, 0, 200}, half).fraction, 0);
    EXPECT_EQ(a.trace(-sunk, -sunk - V{0, 0, 200}, half).fraction, 1);
    // Touching is not across: put down by hand it walks, leaves, and does not sink.
    for (const double lift : {0.0, 1e-9, -1e-9, 0.01, -0.0009}) {
        const V at{-40, 3, 16 + lift};
        EXPECT_EQ(a.trace(at, at + V{80, 0, 0}, half).fraction, 1) << lift;
        EXPECT_EQ(a.trace(at, at + V{0, 0, 5}, half).fraction, 1) << lift;
        const kiln_trace down = a.trace(at, at + V{80, 0, -1}, half);
        EXPECT_FALSE(down.start_solid) << lift;
        EXPECT_EQ(down.fraction, 0) << lift;
        EXPECT_EQ(vec(down.normal), (V{0, 0, 1})) << lift;
    }
    // A ray is never across.
    EXPECT_FALSE(a.trace({1, 2, 0}, {1, 2, 40}, {}).start_solid);
}

TEST(CurveTraces, MaterialsAndFlagsSayWhomTheyStop) {
    // One sheet over the other, each of its own material; what stops nothing is not there.
    enum { ordinary, detail, water, trigger, nodraw, nonsolid, window, grate, players_clip, npc_clip, invisible, blocker, hint, skip, sky, count };
    constexpr std::uint32_t flags[count] = {0,       1u << 10, 1u << 8,              1u << 5,              1u << 1,  1u << 14, 1u << 9, 1u << 18,
                                            1u << 4 | 1u << 19, 1u << 4 | 1u << 20, 1u << 12, 1u << 11, 1u << 3, 1u << 2, 1u};
    const auto stops = [&](std::uint32_t material, std::uint32_t mask, bool patch = false) {
        Displacement d = displacement(-64, -64, 64, 64, 2, [](double, double) { return 0; });
        CurvedPatch p;
        p.columns = p.rows = 3;
        for (int i = 0; i < 9; ++i) p.positions.push_back({64.f * static_cast<float>(i % 3 - 1), 64.f * static_cast<float>(i / 3 - 1), 0}), p.uv.push_back({0, 0});
        d.material = p.material = material + 1;
        std::vector<Displacement> ds;
        std::vector<CurvedPatch> ps;
        patch ? ps.push_back(p) : ds.push_back(d);
        const Arena a(ds, ps, [&](LevelContent& c) {
            for (const std::uint32_t f : flags) c.materials.push_back({.name = "m" + std::to_string(f), .albedo_map = "", .normal_map = "", .flags = f});
        });
        const kiln_trace t = a.trace({3, 5, 90}, {3, 5, -90}, V{8, 8, 8}, mask);
        EXPECT_EQ(t.fraction < 1, t.contents != 0);
        return t.fraction < 1 ? t.contents : 0;
    };
    constexpr std::uint32_t all = 0xffffff;
    for (const std::uint32_t m : {ordinary, nodraw, sky}) EXPECT_EQ(stops(m, KILN_MASK_SIGHT), static_cast<std::uint32_t>(KILN_CONTENTS_SOLID));
    EXPECT_EQ(stops(detail, KILN_MASK_PLAYERS), static_cast<std::uint32_t>(KILN_CONTENTS_DETAIL));
    EXPECT_EQ(stops(detail, KILN_CONTENTS_SOLID), 0u);
    for (const std::uint32_t m : {water, trigger, hint, skip}) EXPECT_EQ(stops(m, all), 0u) << m;
    EXPECT_EQ(stops(nonsolid, KILN_MASK_PLAYERS), 0u);
    EXPECT_EQ(stops(nonsolid, KILN_MASK_HARD), static_cast<std::uint32_t>(KILN_CONTENTS_WINDOW)); // as its brushes
    EXPECT_EQ(stops(window, KILN_MASK_BULLETS), static_cast<std::uint32_t>(KILN_CONTENTS_WINDOW));
    EXPECT_EQ(stops(window, KILN_MASK_SIGHT), 0u);
    EXPECT_EQ(stops(grate, KILN_MASK_PLAYERS), static_cast<std::uint32_t>(KILN_CONTENTS_GRATE));
    EXPECT_EQ(stops(grate, KILN_MASK_BULLETS), 0u);
    EXPECT_EQ(stops(grate, KILN_MASK_BULLETS, true), static_cast<std::uint32_t>(KILN_CONTENTS_GRATE));
    EXPECT_EQ(stops(players_clip, KILN_MASK_PLAYERS), static_cast<std::uint32_t>(KILN_CONTENTS_CLIP));
    EXPECT_EQ(stops(players_clip, KILN_MASK_NPCS), 0u);
    EXPECT_EQ(stops(npc_clip, KILN_MASK_PLAYERS), 0u);
    EXPECT_EQ(stops(invisible, KILN_MASK_NPCS), static_cast<std::uint32_t>(KILN_CONTENTS_CLIP));
    EXPECT_EQ(stops(blocker, KILN_MASK_SIGHT), static_cast<std::uint32_t>(KILN_CONTENTS_CLIP));
    EXPECT_EQ(stops(blocker, KILN_MASK_PLAYERS), 0u);
    EXPECT_EQ(stops(water, KILN_MASK_LIQUID, true), 0u);

    for (const std::uint32_t f : {0u, 2u, 4u, 8u, 14u}) {
        Displacement d = displacement(-64, -64, 64, 64, 2, [](double, double) { return 0; });
        d.flags = f;
        const Arena a({d}, {});
        EXPECT_EQ(a.trace({3, 5, 90}, {3, 5, -90}, V{8, 8, 8}).fraction == 1, (f & 4) != 0);
        EXPECT_EQ(a.trace({3, 5, 90}, {3, 5, -90}, V{}).fraction == 1, (f & 8) != 0);
    }
}

TEST(CurveTraces, ModelsHaveTheirOwnAndBrushesGoFirst) {
    Displacement world = displacement(-64, -64, 64, 64, 2, [](double, double) { return 16; });
    CurvedPatch lift = sphere(20, 9, 9);
    lift.model = 1;
    const Arena a({world}, {lift}, [](LevelContent& c) { c.model_count = 2, test::add_brush(c); }); // the brush's top is at 16 as well
    const kiln_trace t = a.trace({0, 0, 90}, {0, 0, -90}, V{8, 8, 8});
    EXPECT_EQ(t.brush, 0u);
    EXPECT_EQ(t.displacement, KILN_NO_INDEX);
    EXPECT_EQ(a.trace({40, 0, 90}, {40, 0, -90}, V{8, 8, 8}).displacement, 0u);
    const V start{103, 2, 300}, end{103, 2, 100}, half{4, 4, 4}, mins = -half, origin{100, 0, 200}, zero{};
    kiln_trace m{}, n{};
    ASSERT_EQ(kiln_trace_model(a.level->get(), 1, &origin.x, &start.x, &end.x, &mins.x, &half.x, KILN_MASK_PLAYERS, &m), KILN_OK);
    EXPECT_EQ(m.patch, 0u);
    EXPECT_NEAR(m.end[2], 200 + 20 + 4 + kRest, 1.0);
    const V from = start - origin, to = end - origin;
    ASSERT_EQ(kiln_trace_model(a.level->get(), 1, &zero.x, &from.x, &to.x, &mins.x, &half.x, KILN_MASK_PLAYERS, &n), KILN_OK);
    EXPECT_NEAR(n.end[2] + 200, m.end[2], 1e-9);
    EXPECT_NEAR(m.distance, n.distance + dot(vec(n.normal), origin), 1e-9);
    EXPECT_EQ(a.trace(start, end, half).fraction, 1); // the world's traces do not see models
}

TEST(CurveTraces, FewTrianglesAreLookedAt) {
    std::mt19937_64 rng(8);
    std::vector<Displacement> sheets;
    for (int j = 0; j < 8; ++j)
        for (int i = 0; i < 8; ++i) sheets.push_back(displacement(256.0 * i - 1024, 256.0 * j - 1024, 256.0 * i - 768, 256.0 * j - 768, 4, hills));
    const Arena a(std::move(sheets), {});
    const Collision& c = *a.level->get()->get_collision();
    ASSERT_EQ(a.all.size(), 64u * 512);
    std::size_t most = 0, most_ray = 0, sum = 0;
    constexpr int rounds = 2000;
    for (int i = 0; i < rounds; ++i) {
        const V at{uniform(rng, -1000, 1000), uniform(rng, -1000, 1000), uniform(rng, -60, 80)}, way = i % 2 ? random_vector(rng, 16) : random_vector(rng, 1000);
        const double h = i % 2 ? 16 : 0;
        const Way w{{at.x, at.y, at.z}, {way.x, way.y, way.z}, {-h - kRest, -h - kRest, -h - kRest}, {h + kRest, h + kRest, h + kRest}};
        std::size_t triangles = 0;
        const double fraction = a.trace(at, at + way, V{h, h, h}).fraction;
        walk_curves(c.curves, 0, w, [&] { return std::min(1.0, fraction + 0.01); }, [&](const Curves::Curve&, std::uint32_t) { triangles += 2; });
        (i % 2 ? most : most_ray) = std::max(i % 2 ? most : most_ray, triangles);
        sum += triangles;
    }
    EXPECT_LE(most, 96u);     // a box of two quads' width, in two by two quads at most 6 x 6 of them
    EXPECT_LE(most_ray, 200u); // long ones along the ground
    EXPECT_LT(sum / rounds, 40u);
    std::printf("of %zu triangles at most %zu by a box of 32 units, %zu by a long ray; %.1f on average\n", a.all.size(), most, most_ray, static_cast<double>(sum) / rounds);
}

TEST(CurveTraces, ThreadsShareTheTree) {
    std::mt19937_64 rng(9);
    const Arena a(terrain(hills, true, rng), {sphere(50, 33, 17)});
    std::array<std::vector<double>, 4> found;
    {
        std::vector<std::jthread> threads;
        for (std::vector<double>& f : found)
            threads.emplace_back([&a, &f] {
                std::mt19937_64 own(10);
                for (int i = 0; i < 300; ++i) f.push_back(a.trace(random_vector(own, 250), random_vector(own, 250), V{4, 4, 4}).fraction);
            });
    }
    for (const auto& f : found) EXPECT_EQ(f, found[0]);
}

} // namespace
} // namespace kiln::level

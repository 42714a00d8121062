// Own planes and bevels, pushed out by the box's reach, are the Minkowski sum of brush and box: no less (nothing gets
// in) and no more (nothing snags). The oracle decides by separating axes, all pairs of edges, in rationals.
#include "brushes.h"
#include "compiler/collision/collision.h"
#include <fmt/format.h>
#include "tests/libs/exact/rational.h"

namespace kiln::test {
namespace {

using Exact3 = std::array<Rational, 3>;

Rational dot_exact(const Exact3& a, const Exact3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Exact3 cross_exact(const Exact3& a, const Exact3& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Exact3 exactly(Vec3 v) { return {Rational(v.x), Rational(v.y), Rational(v.z)}; }

// A brush in rationals, map units.
struct Oracle {
    struct Axis {
        Exact3 n;
        Rational lo, hi; // of the brush along it
    };
    std::vector<Exact3> corners;
    std::vector<Axis> axes;
    std::vector<Exact3> own_normals;
    std::vector<Rational> own_distances;

    Oracle(const PlaneTable& planes, const BrushPolytope& brush) {
        const Rational unit(Integer(1), Integer(1) << planes.grid_bits);
        std::vector<Exact3> normals;
        for (const PlanePolygon& f : brush.faces) {
            const auto p = rational(planes.planes[f.support.at()]);
            normals.push_back({p[0], p[1], p[2]});
            own_distances.push_back(p[3] * unit);
            PlaneId before = f.edges.back();
            for (const PlaneId after : f.edges) {
                Exact3 c = *solve(planes, f.support, before, after);
                for (Rational& x : c) x *= unit;
                if (std::ranges::find(corners, c) == corners.end()) corners.push_back(c);
                before = after;
            }
        }
        own_normals = normals;
        const Exact3 e[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
        std::vector<Exact3> all = normals;
        for (const Exact3& k : e) all.push_back(k);
        // Every edge is parallel to the cross product of two face normals; more axes than needed do no harm.
        for (std::size_t i = 0; i < normals.size(); ++i)
            for (std::size_t j = i + 1; j < normals.size(); ++j)
                for (const Exact3& k : e) all.push_back(cross_exact(cross_exact(normals[i], normals[j]), k));
        for (const Exact3& n : all) {
            if (n[0] == 0 && n[1] == 0 && n[2] == 0) continue;
            Axis a{n, dot_exact(n, corners[0]), 0};
            a.hi = a.lo;
            for (const Exact3& c : corners) {
                const Rational d = dot_exact(n, c);
                if (d < a.lo) a.lo = d;
                if (d > a.hi) a.hi = d;
            }
            axes.push_back(a);
        }
    }
    // Does the closed box of half size h at x meet the closed brush?
    bool meets(const Exact3& x, const Exact3& h) const {
        for (const Axis& a : axes) {
            const Rational at = dot_exact(a.n, x), reach = abs(a.n[0]) * h[0] + abs(a.n[1]) * h[1] + abs(a.n[2]) * h[2];
            if (at - reach > a.hi || at + reach < a.lo) return false;
        }
        return true;
    }
    bool behind_own(const Exact3& x, const Exact3& h) const {
        for (std::size_t i = 0; i < own_normals.size(); ++i) {
            const Exact3& n = own_normals[i];
            if (dot_exact(n, x) > own_distances[i] + abs(n[0]) * h[0] + abs(n[1]) * h[1] + abs(n[2]) * h[2]) return false;
        }
        return true;
    }
};
bool behind(const Bevel& b, const Exact3& x, const Exact3& h) {
    const Exact3 n = exactly(b.normal);
    return dot_exact(n, x) <= Rational(b.distance) + abs(n[0]) * h[0] + abs(n[1]) * h[1] + abs(n[2]) * h[2];
}
bool is_axial(const Bevel& b) { return (b.normal.x == 0) + (b.normal.y == 0) + (b.normal.z == 0) == 2; }

std::span<const Bevel> bevels(const CollisionBrushes& c, std::size_t b) {
    return std::span(c.bevels).subspan(c.first_bevel[b], c.first_bevel[b + 1] - c.first_bevel[b]);
}

struct Compiled {
    Csg csg;
    CollisionBrushes collision;
};
Compiled collide(const World& world, int threads = 1) {
    Compiled c{compile(world, {.plane_merge_distance = 0}, threads), {}};
    Context context;
    context.threads = threads;
    c.collision = build_collision(c.csg, context);
    validate(c.collision, c.csg);
    return c;
}

World hulls(std::uint64_t seed, int count, int bits = 3) {
    std::mt19937_64 rng(seed);
    WorldBuilder w;
    for (int i = 0; i < count; ++i) {
        const Vec3 at = random_point(rng, 3000, bits);
        if (i % 4 == 3) random_brush(w, rng, 100, 60, bits);
        else random_hull(w, rng, at, uniform(rng, 20, 200), bits);
    }
    return w.world;
}

struct Tally {
    int meeting = 0, apart = 0;
    int spikes = 0; // the sum says apart, the brush's own and axial planes say it touches
};
Tally compare(const Compiled& c, std::uint64_t seed, int points_each) {
    std::mt19937_64 rng(seed);
    Tally tally;
    for (std::size_t b = 0; b < c.csg.brushes.size(); ++b) {
        if (!c.csg.brushes[b].valid) continue;
        const Oracle oracle(c.csg.planes, c.csg.brushes[b]);
        for (int i = 0; i < points_each; ++i) {
            Vec3 h{uniform(rng, 0, 40), uniform(rng, 0, 40), uniform(rng, 0, 80)};
            if (i % 5 == 0) h = {16, 16, 36};
            if (i % 7 == 0) h[rng() % 3] = 0;
            // A box whose side, edge or corner lies about on the brush's edge or corner.
            const auto& p = oracle.corners[rng() % oracle.corners.size()];
            const auto& q = oracle.corners[rng() % oracle.corners.size()];
            const double t = rng() % 2 ? uniform(rng, 0, 1) : 0, jitter = std::ldexp(1, -static_cast<int>(rng() % 12));
            Vec3 x;
            for (std::size_t k = 0; k < 3; ++k) {
                x[k] = static_cast<double>(p[k]) * (1 - t) + static_cast<double>(q[k]) * t + uniform(rng, -jitter, jitter);
                x[k] += rng() % 3 == 0 ? uniform(rng, -h[k], h[k]) : rng() % 2 ? h[k] : -h[k];
            }
            const Exact3 at = exactly(x), half = exactly(h);
            const bool meets = oracle.meets(at, half), own = oracle.behind_own(at, half);
            bool all = own, axial = own;
            for (const Bevel& bevel : bevels(c.collision, b)) {
                const bool in = behind(bevel, at, half);
                all = all && in;
                if (is_axial(bevel)) axial = axial && in;
            }
            EXPECT_TRUE(!meets || all) << "a box gets into brush " << b;
            // Distances are rounded outwards, by far less than this.
            constexpr double kRounding = 0x1p-30;
            EXPECT_TRUE(!all || meets || oracle.meets(at, exactly(h + Vec3{kRounding, kRounding, kRounding}))) << "a box snags on brush " << b;
            tally.meeting += meets, tally.apart += !meets, tally.spikes += axial && !meets;
        }
    }
    return tally;
}

TEST(Bevels, OwnPlanesAndBevelsAreTheSumOfBrushAndBox) {
    const Tally tally = compare(collide(hulls(1, 40)), 2, 80);
    EXPECT_GT(tally.meeting, 700);
    EXPECT_GT(tally.apart, 700);
    EXPECT_GT(tally.spikes, 30) << "without bevels of edges boxes would not have snagged: this proves nothing";
}

TEST(Bevels, OffTheGridAndFarOutAsWell) {
    std::mt19937_64 rng(3);
    WorldBuilder w;
    for (int i = 0; i < 12; ++i) random_hull(w, rng, random_point(rng, 120000, 10), uniform(rng, 2, 400), 10);
    const Tally tally = compare(collide(w.world), 4, 60);
    EXPECT_GT(tally.meeting, 100);
    EXPECT_GT(tally.apart, 100);
}

// Each bevel carries a face of the sum: just before the middle of that face is a place which all other planes let in.
TEST(Bevels, NoneIsRedundant) {
    const Compiled c = collide(hulls(5, 40));
    std::size_t edges = 0;
    for (std::size_t b = 0; b < c.csg.brushes.size(); ++b) {
        const Oracle oracle(c.csg.planes, c.csg.brushes[b]);
        const auto list = bevels(c.collision, b);
        const Vec3 h{16, 24, 36};
        for (const Bevel& bevel : list) {
            if (is_axial(bevel)) continue;
            ++edges;
            Vec3 middle{};
            double touching = 0;
            for (const Exact3& corner : oracle.corners) {
                const Vec3 p{static_cast<double>(corner[0]), static_cast<double>(corner[1]), static_cast<double>(corner[2])};
                if (dot(bevel.normal, p) < bevel.distance - 1e-8) continue;
                middle += p, ++touching;
            }
            ASSERT_EQ(touching, 2) << "a bevel of an edge touches that edge";
            middle = middle / touching;
            for (std::size_t k = 0; k < 3; ++k) middle[k] += bevel.normal[k] > 0 ? h[k] : bevel.normal[k] < 0 ? -h[k] : 0;
            const Exact3 x = exactly(middle + bevel.normal * 1e-6), half = exactly(h);
            EXPECT_FALSE(oracle.meets(x, half));
            EXPECT_TRUE(oracle.behind_own(x, half));
            for (const Bevel& other : list) EXPECT_EQ(behind(other, x, half), &other != &bevel);
        }
    }
    EXPECT_GT(edges, 200u);
}

std::string text_of(std::span<const Bevel> list) {
    std::string text;
    for (const Bevel& b : list) text += fmt::format("({:.4g} {:.4g} {:.4g}) {:.6g}; ", b.normal.x, b.normal.y, b.normal.z, b.distance);
    return text;
}

TEST(Bevels, KnownShapes) {
    WorldBuilder w;
    w.box({-8, 0, 16}, {24, 8, 32});
    w.prism(std::vector<Vec2>{{0, -64}, {64, 0}, {0, 64}, {-64, 0}}, 0, 96); // a box turned by 45 degrees
    // A ramp: its slope meets the floor and the back wall; across its edges nothing changes sign but what is axial.
    w.brush(std::vector<SidePoints>{{Vec3{0, 0, 0}, {64, 0, 0}, {0, 64, 0}},
                                    {Vec3{64, 0, 0}, {64, 0, 64}, {64, 64, 0}},
                                    {Vec3{0, 0, 0}, {0, 0, 64}, {64, 0, 0}},
                                    {Vec3{0, 64, 0}, {64, 64, 0}, {0, 64, 64}},
                                    {Vec3{0, 0, 0}, {0, 64, 0}, {64, 0, 64}}});
    // An octahedron: each of its twelve edges lies in an axial plane, the bevel of which would be axial or is none.
    std::vector<SidePoints> octahedron;
    for (const double x : {-1., 1.})
        for (const double y : {-1., 1.})
            for (const double z : {-1., 1.}) {
                SidePoints s{Vec3{64 * x, 0, 0}, {0, 64 * y, 0}, {0, 0, 64 * z}};
                if (dot(cross(s[2] - s[0], s[1] - s[0]), {x, y, z}) < 0) std::swap(s[1], s[2]);
                octahedron.push_back(s);
            }
    w.brush(octahedron);
    // The tetrahedron that no axis favours: every edge has its bevels.
    w.tetrahedron({Vec3{0, 0, 0}, {64, 24, 8}, {8, 64, 24}, {24, 8, 64}});
    const Compiled c = collide(w.world);
    EXPECT_EQ(text_of(bevels(c.collision, 0)), "");
    EXPECT_EQ(text_of(bevels(c.collision, 1)), "(-1 0 0) 64; (1 0 0) 64; (0 -1 0) 64; (0 1 0) 64; ");
    EXPECT_EQ(text_of(bevels(c.collision, 2)), "(-1 0 0) 0; (0 0 1) 64; ");
    // 1/sqrt 2 = 0.7071; distances 64/sqrt 2 = 45.2548.
    EXPECT_EQ(bevels(c.collision, 3).size(), 6u + 12u) << text_of(bevels(c.collision, 3));
    EXPECT_EQ(bevels(c.collision, 3)[5].distance, 64);
    EXPECT_NEAR(bevels(c.collision, 3)[6].distance, 45.2548, 1e-4);
    EXPECT_GT(bevels(c.collision, 4).size(), 10u);
}

// A side that only touches the brush along an edge, written first, gives the edge its name; nothing else changes.
TEST(Bevels, RedundantSidesChangeNothing) {
    const std::array<Vec3, 4> p{Vec3{0, 0, 0}, {64, 24, 8}, {8, 64, 24}, {24, 8, 64}};
    WorldBuilder plain, extra;
    plain.tetrahedron(p), extra.tetrahedron(p);
    const Compiled a = collide(plain.world);
    // Through the edge p0 p1 and a point so that the whole brush is behind: between the planes of its two faces.
    const Vec3 n2 = normalize(cross(p[1] - p[0], p[2] - p[0])), n3 = normalize(cross(p[1] - p[0], p[3] - p[0]));
    const double s2 = dot(n2, p[3]) > 0 ? -1 : 1, s3 = dot(n3, p[2]) > 0 ? -1 : 1;
    const Vec3 n = n2 * s2 + n3 * s3, aside = cross(n, p[1] - p[0]);
    Vec3 third = p[0] + aside * (32 / length(aside));
    for (std::size_t k = 0; k < 3; ++k) third[k] = std::round(third[k]);
    SidePoints side{p[0], p[1], third};
    if (dot(cross(side[2] - side[0], side[1] - side[0]), n) < 0) std::swap(side[0], side[1]);
    WorldSide s = extra.world.sides[0];
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k) s.points[i][k] = decimal(side[i][k]);
    extra.world.sides.insert(extra.world.sides.begin(), s);
    ++extra.world.brushes[0].side_count;
    const Compiled b = collide(extra.world);
    EXPECT_EQ(b.csg.report.redundant_sides, 1u);
    EXPECT_EQ(text_of(bevels(a.collision, 0)), text_of(bevels(b.collision, 0)));
}

TEST(Bevels, SameForAnyNumberOfThreads) {
    const World world = hulls(9, 50);
    ByteWriter one, seven;
    one(collide(world, 1).collision), seven(collide(world, 7).collision);
    EXPECT_EQ(one.bytes, seven.bytes);
}

TEST(Bevels, InvalidBrushesHaveNone) {
    WorldBuilder w;
    w.box({10, 10, 10}, {10, 20, 20}), w.tetrahedron({Vec3{0, 0, 0}, {64, 24, 8}, {8, 64, 24}, {24, 8, 64}});
    const Compiled c = collide(w.world);
    EXPECT_EQ(bevels(c.collision, 0).size(), 0u);
    EXPECT_GT(bevels(c.collision, 1).size(), 0u);
}

} // namespace
} // namespace kiln::test

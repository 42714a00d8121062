// Laws of the whole way from brushes to leaves, exact wherever geometry is: on random brushes of all kinds, on brushes
// far out and on fine grids, and on maps of other people.
#include "tests/proof/geometry/laws.h"
#include "tests/proof/geometry/pipeline.h"
#include "tests/proof/geometry/scenes.h"
#include <gtest/gtest.h>

namespace kiln::proof {
namespace {

const CsgOptions kExact{.plane_merge_distance = 0};

// Not filled: nothing is outside, every leaf counts.
Geometry open_run(const World& world, const CsgOptions& csg = kExact) {
    RunOptions options;
    options.csg = csg, options.bsp.fill = false, options.last = "bsp";
    return run(world, options);
}
Geometry filled_run(const World& world, const CsgOptions& csg = {}) {
    RunOptions options;
    options.csg = csg, options.last = "bsp";
    return run(world, options);
}

F volume(const Csg& csg) {
    Integral i;
    for (const Fragment& f : csg.fragments)
        if (f.behind == Contents::solid) i.add(csg.planes, f.polygon);
    return i.six_volume * F(6).inverse();
}

TEST(Field, KnowsRationals) {
    const F third = F(3).inverse(), seventh = F(7).inverse();
    EXPECT_EQ(third + seventh, F(10) * F(21).inverse());
    EXPECT_EQ(F(-5) + F(5), F());
    EXPECT_EQ(F::of(-(static_cast<__int128>(1) << 100)) + F::of(static_cast<__int128>(1) << 100), F());
    WorldBuilder w;
    w.tetrahedron({Vec3{0, 0, 0}, {3, 0, 0}, {0, 5, 0}, {0, 0, 7}});
    EXPECT_EQ(volume(open_run(w.world).csg), F(3 * 5 * 7) * F(6).inverse());
}

class Soups : public testing::TestWithParam<SoupOptions> {};

TEST_P(Soups, KeepEveryLawExactly) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
        const World world = soup(seed, 60, GetParam());
        const Geometry r = open_run(world);
        ASSERT_FALSE(r.fault);
        for (const Findings& f : {closure(r.world, r.csg), volumes(r.csg, r.bsp), points_in_leaves(r.world, r.csg, r.bsp, 2000, seed),
                                  portals(r.csg, r.bsp), brush_lists(r.world, r.csg, r.bsp)}) {
            EXPECT_TRUE(f.ok()) << "seed " << seed << ": " << f;
            EXPECT_GT(f.checked, 0u);
        }
        const Geometry filled = filled_run(world, kExact);
        const Findings f = volumes(filled.csg, filled.bsp);
        EXPECT_TRUE(f.ok()) << f;
    }
}

INSTANTIATE_TEST_SUITE_P(Random, Soups,
                         testing::Values(SoupOptions{.bits = 0, .range = 24, .size = 16}, // much coincides
                                         SoupOptions{.bits = 0, .range = 24, .size = 16, .mixed = true},
                                         SoupOptions{.bits = 4, .mixed = true}, SoupOptions{.bits = 10},
                                         SoupOptions{.bits = 10, .range = 131072 - 256, .size = 200}));

// vol(A u B) + vol(A n B) = vol A + vol B: as rational numbers, without a tolerance.
TEST(Laws, VolumesOfUnionAndIntersectionAddUp) {
    int meeting = 0;
    for (std::uint64_t seed = 1; seed <= 80; ++seed) {
        const World both = soup(seed, 2, {.bits = static_cast<int>(seed % 11), .range = 16, .size = 48});
        World a = both, b = both, intersection = both;
        a.brushes.pop_back();
        b.brushes.erase(b.brushes.begin());
        intersection.brushes.pop_back();
        intersection.brushes[0].side_count = static_cast<std::uint32_t>(both.sides.size());
        const F va = volume(open_run(a).csg), vb = volume(open_run(b).csg), v_union = volume(open_run(both).csg);
        const Geometry common = open_run(intersection);
        const F v_common = common.fault ? F() : volume(common.csg);
        meeting += !common.fault;
        EXPECT_EQ(v_union + v_common, va + vb) << seed;
    }
    EXPECT_GT(meeting, 20);
}

// The same of many brushes at once, by inclusion and exclusion over all subsets.
TEST(Laws, InclusionAndExclusionOfFiveBrushes) {
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        const World all = soup(seed, 5, {.bits = 2, .range = 12, .size = 40});
        F sum;
        for (unsigned subset = 1; subset < 32; ++subset) {
            World common = all;
            common.sides.clear();
            int members = 0;
            for (unsigned b = 0; b < 5; ++b) {
                if (!(subset >> b & 1)) continue;
                ++members;
                for (std::uint32_t s = 0; s < all.brushes[b].side_count; ++s) common.sides.push_back(all.sides[all.brushes[b].first_side + s]);
            }
            common.brushes.resize(1);
            common.brushes[0].first_side = 0, common.brushes[0].side_count = static_cast<std::uint32_t>(common.sides.size());
            const Geometry r = open_run(common);
            if (!r.fault) sum = members % 2 ? sum + volume(r.csg) : sum - volume(r.csg);
        }
        EXPECT_EQ(volume(open_run(all).csg), sum) << seed;
    }
}

// What a fragment is, apart from who owns it: of coplanar faces of equal contents the earlier brush in the file has it.
std::optional<std::uint64_t> kind(const Fragment& f) {
    return static_cast<std::uint64_t>(f.behind) | static_cast<std::uint64_t>(f.front) << 8 | std::uint64_t{f.covered} << 16 |
           std::uint64_t{f.both_sides} << 17 | std::uint64_t{f.model.value} << 32;
}
std::optional<std::uint64_t> kind_and_side(const Fragment& f) { return *kind(f) | std::uint64_t{f.side.value} << 36; }

const Motion kMotions[] = {
    {.shift = {64, -128, 1024}},
    {.shift = {3, 5, -7}},
    {.axis = {1, 2, 0}},
    {.axis = {1, 0, 2}},
    {.sign = {-1, 1, 1}},
    {.axis = {2, 1, 0}, .sign = {-1, 1, -1}, .shift = {-17, 4096, 33}},
};

struct Measure {
    double hull_area = 0, inside_area = 0; // map units squared: of the union of structural brushes; visible
};
double area(const PlaneTable& planes, const PlanePolygon& polygon) {
    const std::vector<Vec3> p = points(planes, polygon);
    Vec3 twice{};
    for (std::size_t i = 1; i + 1 < p.size(); ++i) twice += cross(p[i] - p[0], p[i + 1] - p[0]);
    return length(twice) / 2;
}
Measure measure(const Geometry& g) {
    Measure m;
    for (const Fragment& f : g.csg.fragments)
        if (f.behind == Contents::solid && f.model.value == 0) m.hull_area += area(g.csg.planes, f.polygon);
    for (const VisibleFragment& v : g.bsp.visible)
        if (v.leaf.valid()) m.inside_area += area(g.bsp.planes, v.polygon);
    return m;
}

// Moved by whole units, turned by right angles or mirrored: every face of every side is the same region, by exact
// corners; what is inside has the same volume. (How regions are cut into fragments and leaves may differ.)
void expect_same_when_moved(const World& world, const CsgOptions& csg, std::span<const Motion> motions) {
    const Geometry here = filled_run(world, csg);
    ASSERT_FALSE(here.fault);
    const auto volumes_here = inside_volumes(here.bsp);
    const Measure measure_here = measure(here);
    for (const Motion& motion : motions) {
        const Geometry there = filled_run(moved(world, motion), csg);
        ASSERT_FALSE(there.fault);
        if (here.csg.report.rounded_sides) { // the planes of sides off the grid are those nearest in doubles
            const Measure measure_there = measure(there);
            EXPECT_NEAR(measure_here.hull_area, measure_there.hull_area, 1e-6 * measure_here.hull_area);
            EXPECT_NEAR(measure_here.inside_area, measure_there.inside_area, 1e-4 * measure_here.inside_area);
            EXPECT_EQ(here.count("micro-gap"), there.count("micro-gap"));
        } else {
            EXPECT_TRUE(form_of(here.csg, motion, kind_and_side) == form_of(there.csg, {}, kind_and_side));
            EXPECT_TRUE(form_of(here.csg, here.bsp, motion, kind_and_side) == form_of(there.csg, there.bsp, {}, kind_and_side));
            EXPECT_EQ(volumes_here, inside_volumes(there.bsp));
        }
        EXPECT_EQ(here.bsp.area_count, there.bsp.area_count);
        EXPECT_EQ(here.leak.has_value(), there.leak.has_value());
    }
}

// In another order: the same regions by contents; the sides that own shared faces may be others.
void expect_same_when_shuffled(const World& world, const CsgOptions& csg, int rounds) {
    const Geometry first = filled_run(world, csg);
    ASSERT_FALSE(first.fault);
    const Form fragments = form_of(first.csg, {}, kind), visible = form_of(first.csg, first.bsp, {}, kind);
    for (int i = 1; i <= rounds; ++i) {
        const Geometry other = filled_run(shuffled(world, static_cast<std::uint64_t>(i)), csg);
        ASSERT_FALSE(other.fault);
        EXPECT_TRUE(fragments == form_of(other.csg, {}, kind)) << i;
        EXPECT_TRUE(visible == form_of(other.csg, other.bsp, {}, kind)) << i;
        EXPECT_EQ(inside_volumes(first.bsp), inside_volumes(other.bsp)) << i;
        EXPECT_EQ(first.bsp.area_count, other.bsp.area_count);
        EXPECT_EQ(first.leak.has_value(), other.leak.has_value());
    }
}

TEST(Laws, MovingChangesNothing) {
    expect_same_when_moved(soup(1, 60, {.range = 24, .size = 20, .mixed = true}), kExact, kMotions);
    expect_same_when_moved(soup(2, 60, {.bits = 5, .mixed = true}), kExact, kMotions);
    expect_same_when_moved(soup(3, 40, {.bits = 10}), {}, kMotions);
}

TEST(Laws, OrderOfBrushesChangesNothing) {
    expect_same_when_shuffled(soup(4, 60, {.range = 24, .size = 20, .mixed = true}), kExact, 4);
    expect_same_when_shuffled(soup(5, 60, {.bits = 10, .mixed = true}), {}, 4);
}

// The form tells apart what is not the same: a wall a hair higher, a face that lost a part.
TEST(Laws, FormsSeeDifferences) {
    WorldBuilder a, b;
    a.box({0, 0, 0}, {64, 64, 64});
    b.box({0, 0, 0}, {64, 64, 64 + 0x1p-10});
    const Geometry ra = open_run(a.world), rb = open_run(b.world);
    EXPECT_FALSE(form_of(ra.csg, {}, kind) == form_of(rb.csg, {}, kind));
    Csg less = ra.csg;
    less.fragments.pop_back();
    EXPECT_FALSE(form_of(ra.csg, {}, kind) == form_of(less, {}, kind));
}

class Maps : public testing::TestWithParam<const char*> {
protected:
    World world;
    void SetUp() override {
        const auto path = shared_map(GetParam());
        if (!path) GTEST_SKIP() << GetParam() << " is not here";
        Context context;
        world = *load_world(*path, context);
    }
};

TEST_P(Maps, KeepEveryLawExactly) {
    const Geometry filled = filled_run(world), open = open_run(world, {});
    for (const Findings& f :
         {closure(filled.world, filled.csg), volumes(open.csg, open.bsp), volumes(filled.csg, filled.bsp),
          points_in_leaves(filled.world, filled.csg, filled.bsp, 10000, 1), portals(open.csg, open.bsp),
          brush_lists(filled.world, filled.csg, filled.bsp), inside_is_closed(filled.world, filled.csg, filled.bsp)})
        EXPECT_TRUE(f.ok()) << f;
}

TEST_P(Maps, AreTheSameMovedMirroredAndShuffled) {
    expect_same_when_moved(world, {}, std::span(kMotions).last(2));
    expect_same_when_shuffled(world, {}, 1);
}

INSTANTIATE_TEST_SUITE_P(OfOthers, Maps,
                         testing::Values("id-quake-map-source/e1m1.map", "laurirasanen-mapsrc/box13.vmf",
                                         "librequake/lqdm1.map", "bagnaram-halflife-maps/racetrak.vmf",
                                         "ericw-tools-testmaps/q1_mountain.map"),
                         [](const auto& map) {
                             std::string name = map.param;
                             name = name.substr(name.find('/') + 1);
                             return name.substr(0, name.find('.'));
                         });

} // namespace
} // namespace kiln::proof

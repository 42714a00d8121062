// A few of the maps of `prove_light seams`, through a level file and its loader.
#include "compiler/light/seams.h"
#include "tests/proof/light/seams.h"
#include <gtest/gtest.h>

namespace kiln::proof {
namespace {

class Seams : public testing::TestWithParam<const char*> {};

TEST_P(Seams, BothSidesOfAnEdgeShowTheSame) {
    bool any = false;
    for (const SeamMap& m : seam_maps()) {
        if (!m.name.starts_with(GetParam())) continue;
        any = true;
        const SeamsFound f = find_seams_shown(m, 5);
        ASSERT_TRUE(f.compiled) << m.name;
        EXPECT_TRUE(f.points > 40 || m.dark) << m.name;
        EXPECT_LT(f.flat_p99, 0.005) << m.name << ", " << f.where;
        EXPECT_LT(f.flat_most, 0.02) << m.name << ", " << f.where;
        EXPECT_LT(f.leaning_p99, 0.005) << m.name;
        EXPECT_LT(f.leaning_most, 0.02) << m.name;
        EXPECT_LE(f.dark, 1e-6) << m.name;
    }
    EXPECT_TRUE(any);
}
INSTANTIATE_TEST_SUITE_P(Few, Seams, testing::Values("floor, luxels 16|16, turned 30", "floor, luxels 32|4", "ridge of 60", "terrain of five, hills of 20", "two patches, luxels 8|12", "tube", "door of", "wall of 1"));

// The other encodings have formulas of their own. That of `sq` is not the same in turned frames but for the flat normal.
TEST(Seams, EveryEncoding) {
    for (const RnmEncoding encoding : {RnmEncoding::sq, RnmEncoding::tilted}) {
        std::vector<SeamMap> maps = seam_maps();
        const SeamsFound f = find_seams_shown(maps.at(1), 5, encoding);
        ASSERT_TRUE(f.compiled);
        EXPECT_LT(f.flat_p99, 0.005);
        EXPECT_LT(f.flat_most, 0.02);
        if (encoding == RnmEncoding::sq) continue;
        EXPECT_LT(f.leaning_p99, 0.005);
        EXPECT_LT(f.leaning_most, 0.02);
    }
}

// Without it a bake keeps the means of luxels; they are what is fitted.
TEST(Seams, LeftToTheCaller) {
    SeamMap m = seam_maps().at(1);
    Context context;
    const auto csg = build_csg(m.builder.world, {}, context);
    ASSERT_TRUE(csg);
    const auto bsp = build_bsp(m.builder.world, *csg, {}, context);
    ASSERT_TRUE(bsp);
    const auto surfaces = build_surfaces(m.builder.world, *csg, *bsp, m.surfaces, context);
    ASSERT_TRUE(surfaces);
    const auto baked = [&](bool match) {
        auto light = bake_light(m.builder.world, *bsp, bsp->planes, *surfaces, m.lights, {.error_percent = 20, .directional = Directional::all, .match_seams = match}, context);
        EXPECT_TRUE(light);
        return *std::move(light);
    };
    const Lighting fitted = baked(true);
    Lighting means = baked(false);
    EXPECT_NE(means.flat, fitted.flat);
    match_seams(*surfaces, TraceScene(m.builder.world, *surfaces), LightOptions{}.error_floor, &means, context);
    EXPECT_EQ(means.flat, fitted.flat);
    EXPECT_EQ(means.rnm, fitted.rnm);
}

} // namespace
} // namespace kiln::proof

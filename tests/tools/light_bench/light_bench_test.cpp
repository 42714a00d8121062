// What the chart says about errors and costs, on values that are known.
#include "tests/compiler/light/scenes.h"
#include "tools/light_bench/light_chart.h"
#include "tools/light_bench/sweep.h"
#include <cstring>
#include <filesystem>
#include <gtest/gtest.h>
#include <numbers>
#include <unistd.h>

using namespace kiln;
using namespace kiln::bench;
using namespace kiln::test;

namespace {
Truth truth_of(std::initializer_list<double> values, double error = 0) {
    Truth t;
    for (const double v : values) {
        rivals::Irradiance e{}, s{};
        for (Rgbd& c : e) c = {v, v, v};
        for (Rgbd& c : s) c = {error, error, error};
        t.value.push_back(e), t.error.push_back(s);
        t.luxels.push_back(static_cast<std::uint32_t>(t.luxels.size()));
    }
    t.shown = static_cast<std::uint32_t>(t.luxels.size());
    return t;
}
std::vector<rivals::Irradiance> scaled(const Truth& t, double flat, double tilted) {
    auto v = t.value;
    for (auto& e : v)
        for (std::size_t d = 0; d < 4; ++d) e[d] *= d ? tilted : flat;
    return v;
}
} // namespace

TEST(LightBench, ErrorIsRelativeWithAFloor) {
    const Truth t = truth_of({1, 2, 3});
    const Errors e = compare(t, scaled(t, 1.1, 0.8));
    EXPECT_NEAR(e.rrmse[0], 10, 1e-9);
    EXPECT_NEAR(e.rrmse[3], 20, 1e-9);
    EXPECT_NEAR(e.worst, 20, 1e-9);
    EXPECT_NEAR(e.bias[0], 10, 1e-9);
    EXPECT_NEAR(e.p95, 10, 1e-9);
    // A dark luxel counts against 2 % of the mean.
    const Truth dark = truth_of({0, 2});
    auto v = dark.value;
    for (Rgbd& c : v[0]) c = {0.01, 0.01, 0.01};
    EXPECT_NEAR(compare(dark, v).worst, 100 * 0.5 / std::sqrt(2.0), 1e-9);
    // Nothing lit: no error to speak of, and no quotient of zeros.
    const Truth black = truth_of({0, 0});
    EXPECT_EQ(compare(black, black.value).worst, 0);
}

TEST(LightBench, SeedsPartIntoWhatTheyShareAndWhatNot) {
    const Truth t = truth_of({1, 2, 4});
    std::vector<Measurement> runs(4);
    const double off[4] = {1.06, 1.02, 1.06, 1.02}; // 4 % in common, 2 % either way: of two degrees of freedom, 4 / 3 of the square
    for (std::size_t k = 0; k < runs.size(); ++k) {
        runs[k].values = scaled(t, off[k], 1);
        runs[k].errors = compare(t, runs[k].values);
        runs[k].target = 5, runs[k].estimate = 4, runs[k].high = 5;
    }
    const Seeds s = compare_seeds(t, runs);
    EXPECT_EQ(s.runs, 4u);
    EXPECT_EQ(s.within_estimate, 2u);
    EXPECT_EQ(s.within_high, 2u);
    EXPECT_NEAR(s.over_high, 6.0 / 5, 1e-9);
    EXPECT_NEAR(s.noise, 2 * std::sqrt(4.0 / 3), 1e-9);
    EXPECT_NEAR(s.common, std::sqrt(16 - 4.0 / 3), 1e-9); // the mean of four has a quarter of their noise
    EXPECT_NEAR(s.bias[0], 4, 1e-9);
    const std::vector<WorstLuxel> worst = worst_luxels(t, runs, 2);
    ASSERT_EQ(worst.size(), 2u);
    EXPECT_EQ(worst[0].direction, 0u);
    EXPECT_NEAR(worst[0].mean, 4, 1e-9);
    EXPECT_NEAR(worst[0].error, std::sqrt((36.0 + 4) / 2), 1e-9);
    EXPECT_NEAR(worst[0].share, 1.0 / 3, 1e-9);
}

// Of a quarter of the luxels an eighth is off: the square of the error of all has a standard error of sqrt(1/8 * 7/8 / (n - 1) * 3/4) of that of one that is off.
TEST(LightBench, ASampleOfLuxelsLeavesTheErrorOfAllOpen) {
    constexpr std::size_t kCount = 256;
    Truth t = truth_of({1});
    t.luxels.resize(kCount), t.value.resize(kCount, t.value[0]), t.error.resize(kCount, t.error[0]);
    std::vector<rivals::Irradiance> v = t.value;
    for (std::size_t i = 0; i < kCount; i += 8) v[i][2] *= 1.4;
    t.shown = kCount; // all there are: nothing is open
    Measurement run;
    run.errors = compare(t, v), run.values = v;
    EXPECT_NEAR(run.errors.worst, 40 / std::sqrt(8.0), 1e-9);
    EXPECT_NEAR(run.errors.least, run.errors.worst, 1e-9);
    EXPECT_NEAR(run.errors.most, run.errors.worst, 1e-9);
    t.shown = 4 * kCount;
    run.errors = compare(t, v);
    const double error = 1600 * std::sqrt(1.0 / 8 * 7 / 8 / (kCount - 1) * 3 / 4), square = 1600.0 / 8;
    const double below = square - run.errors.least * run.errors.least, above = run.errors.most * run.errors.most - square;
    EXPECT_NEAR((below + above) / 2, 1.6449 * error, 1e-3 * error); // skewness moves both ends up
    EXPECT_GT(above, below);
    EXPECT_GT(below, error);
    run.high = run.errors.worst - 0.01;
    EXPECT_EQ(compare_seeds(t, {{run}}).within_high, 0u);
    EXPECT_EQ(compare_seeds(t, {{run}}).likely_over, 0u);
    run.high = run.errors.least - 0.01;
    EXPECT_EQ(compare_seeds(t, {{run}}).likely_over, 1u);
}

TEST(LightBench, AnErrorToldToBeNoneIsNotCovered) {
    const Truth t = truth_of({1, 2, 4});
    Measurement run;
    run.values = scaled(t, 1.02, 1), run.errors = compare(t, run.values);
    EXPECT_TRUE(std::isinf(compare_seeds(t, {{run}}).over_high));
    run.values = t.value, run.errors = compare(t, run.values);
    EXPECT_EQ(compare_seeds(t, {{run}}).over_high, 0);
}

TEST(LightBench, NoiseOfTheTruthIsTakenOut) {
    const Truth t = truth_of({1, 1, 1, 1}, 0.03);
    const Errors e = compare(t, scaled(t, 1.05, 1.05));
    EXPECT_NEAR(e.noise[0], 3, 1e-9);
    EXPECT_NEAR(e.worst, 4, 1e-9); // 5^2 = 3^2 + 4^2
    EXPECT_TRUE(e.at_noise());
    EXPECT_FALSE(compare(t, scaled(t, 1.2, 1.2)).at_noise());
    EXPECT_EQ(compare(t, t.value).worst, 0);
}

// A furnace: truth has a closed form and hardly any noise, the bake is exact there, and what a rival costs is scaled to all
// luxels.
TEST(LightBench, MeasuresAFurnace) {
    const SurfacesBuilder b = furnace();
    const std::vector<Light> lights;
    const Bsp bsp;
    const LightScene scene{"furnace", b.world, bsp, b.surfaces, lights};
    Context context;
    const auto cache = std::filesystem::temp_directory_path() / ("kiln_truth_" + std::to_string(::getpid()));
    const TruthSettings settings{.points = 60, .paths = 512, .most_rounds = 1, .cache = cache.string()};
    const auto truth = find_truth(scene, settings, context);
    ASSERT_TRUE(truth);
    EXPECT_EQ(truth->luxels.size(), 60u);
    for (std::size_t i = 0; i < 60; ++i) EXPECT_NEAR(mean(truth->value[i][0]), std::numbers::pi, 6 * mean(truth->error[i][0]) + 1e-3);
    // From the folder: the same bytes. Cut short, it is found again.
    const auto again = find_truth(scene, settings, context);
    ASSERT_TRUE(again);
    EXPECT_EQ(to_bytes(*again), to_bytes(*truth));
    for (const auto& file : std::filesystem::directory_iterator(cache)) std::filesystem::resize_file(file.path(), 100);
    const auto remade = find_truth(scene, settings, context);
    ASSERT_TRUE(remade);
    EXPECT_EQ(to_bytes(*remade), to_bytes(*truth));
    std::filesystem::remove_all(cache);

    const Measurement own = measure_bake(scene, *truth, 5, context);
    EXPECT_LT(own.errors.worst, 1);
    EXPECT_GT(own.cpu_s, 0);
    EXPECT_GT(own.calibration, 1e5);
    const auto rival = [&](std::uint32_t lit) {
        return measure_rival(scene, *truth, "hemicube", "", [](const rivals::Scene& s, Context& c) { return rivals::hemicube_radiosity(s, {.patch_size = 32, .resolution = 16}, c); }, lit_luxels(scene, *truth, lit, context), context);
    };
    const Measurement some = rival(1), all = rival(100000);
    EXPECT_EQ(some.lit, 60u);
    EXPECT_EQ(all.lit, 60u + truth->shown);
    EXPECT_LT(some.errors.worst, 2);
    EXPECT_NEAR(some.rays / all.rays, 1, 0.05);
    EXPECT_EQ(some.errors.worst, all.errors.worst);
}

// The same scene known to be closed: no paths, the value itself; with a lamp more there is no such form.
TEST(LightBench, TruthOfAClosedFurnaceIsExact) {
    const SurfacesBuilder b = furnace();
    Bsp closed;
    closed.leaves.resize(1);
    closed.leaves[0].outside = true;
    Context context;
    TruthSettings settings;
    settings.points = 20, settings.paths = 16, settings.replicates = 2, settings.most_rounds = 1;
    std::vector<Light> lights;
    const auto truth = find_truth({"furnace", b.world, closed, b.surfaces, lights}, settings, context);
    ASSERT_TRUE(truth);
    ASSERT_EQ(truth->value.size(), 20u);
    EXPECT_EQ(truth->paths, 0u);
    for (std::size_t i = 0; i < 20; ++i)
        for (std::size_t c = 0; c < 3; ++c) {
            EXPECT_NEAR(truth->value[i][0][c], std::numbers::pi, 1e-6); // albedos are floats
            for (std::size_t d = 1; d < 4; ++d) EXPECT_NEAR(truth->value[i][d][c], std::numbers::pi * (1 + 1 / std::numbers::sqrt3) / 2, 1e-6);
            EXPECT_EQ(truth->error[i][1][c], 0);
        }
    // At places: what a level shows there, too.
    settings.shown = true;
    const auto places = find_truth({"furnace", b.world, closed, b.surfaces, lights}, settings, context);
    ASSERT_TRUE(places);
    EXPECT_EQ(places->places.size(), 20u);
    const Measurement shown = measure_bake({"furnace", b.world, closed, b.surfaces, lights}, *places, 5, context);
    EXPECT_EQ(shown.values.size(), 20u);
    EXPECT_LT(shown.errors.worst, 1);
    settings.shown = false;
    lights.push_back(point_light(center_of(b.surfaces, b.surfaces.luxels[0]), {1, 1, 1}));
    const auto lit = find_truth({"furnace", b.world, closed, b.surfaces, lights}, settings, context);
    ASSERT_TRUE(lit);
    EXPECT_GT(lit->paths, 0u);
}

TEST(LightBench, FrontComparesCostAtEqualError) {
    const FrontPoint stored{"a", 5, 4, 100};
    const auto ratio = [&](std::vector<FrontPoint> now) { return cost_ratio(stored, now); };
    EXPECT_DOUBLE_EQ(*ratio({{"a", 5, 4, 120}}), 1.2);
    EXPECT_DOUBLE_EQ(*ratio({{"a", 5, 3, 90}}), 0.9);                    // better and cheaper
    EXPECT_DOUBLE_EQ(*ratio({{"a", 5, 8, 25}}), 1);                      // twice the error is worth a quarter
    EXPECT_DOUBLE_EQ(*ratio({{"a", 5, 4.4, 100}}), 1.21);                // 10 % more error
    EXPECT_DOUBLE_EQ(*ratio({{"a", 5, 4, 120}, {"a", 3, 2, 80}}), 0.8);  // the next finer point is cheaper still
    EXPECT_FALSE(ratio({{"b", 5, 4, 100}, {"a", 20, 9, 1}}));
}

TEST(LightBench, FrontHasNoBeatenPoints) {
    const std::vector<FrontPoint> points{{"a", 20, 12, 3}, {"a", 10, 9, 2}, {"a", 5, 4, 5}, {"b", 20, 12, 9}};
    EXPECT_EQ(write_front(pareto(points)), write_front(std::vector<FrontPoint>{points[1], points[2], points[3]}));
    EXPECT_EQ(pareto(std::vector{points[0], points[0]}).size(), 2u); // equal ones do not beat each other
}

TEST(LightBench, FrontIsReadBack) {
    const std::vector<FrontPoint> front{{"a", 20, 12.5, 1.25}, {"b", 5, 4, 100}};
    const std::string text = write_front(front);
    const auto read = read_front(text, "f");
    ASSERT_TRUE(read);
    ASSERT_EQ(read->size(), 2u);
    EXPECT_EQ(write_front(*read), text);
    for (const char* bad : {"h\na,1,2\n", "h\na,1,2,3,4\n", "h\na,1,x,3\n", "h\n,1,2,3\n", "h\na,1,0,3\n", "h\na\n", "h\na,1,2,nan\n"}) {
        const auto r = read_front(bad, "f");
        ASSERT_FALSE(r) << bad;
        EXPECT_EQ(r.fault().diagnostic.where.line, 2);
    }
    EXPECT_TRUE(read_front("", "f"));
}

// Hollow marks for what has an estimate, rows for what was left out, no marks outside of the picture.
TEST(LightBench, ChartAndTable) {
    std::vector<Measurement> all;
    for (const double target : {20.0, 5.0}) {
        Measurement m;
        m.scene = "a<b", m.method = "kiln", m.setting = "--error", m.cpu_s = 10 / target, m.estimate = 0.9 * target, m.calibration = 5e6, m.rays = 1e6;
        m.errors.worst = target, m.errors.worst_noise = 0.5;
        all.push_back(m);
    }
    Measurement wild = all[0], none = all[0];
    wild.method = "paths", wild.errors.worst = 5000, wild.estimate = 0;
    none.method = "matrix", none.skipped = "too big, by far";
    all.push_back(wild), all.push_back(none);
    const std::string svg = light_svg("a<b", all);
    std::size_t hollow = 0;
    for (std::size_t at = svg.find("own estimate"); at != svg.npos; at = svg.find("own estimate", at + 1)) ++hollow;
    EXPECT_EQ(hollow, 2u);
    EXPECT_NE(svg.find("a&lt;b"), svg.npos);
    EXPECT_NE(svg.find("not measured"), svg.npos);
    EXPECT_EQ(svg.find("nan"), svg.npos);
    EXPECT_EQ(svg.find("='-"), svg.npos);
    const std::string csv = light_csv(all);
    std::vector<std::size_t> columns;
    for (std::size_t at = 0; at < csv.size();) {
        const std::size_t end = csv.find('\n', at);
        columns.push_back(static_cast<std::size_t>(std::count(csv.begin() + static_cast<std::ptrdiff_t>(at), csv.begin() + static_cast<std::ptrdiff_t>(end), ',')));
        at = end + 1;
    }
    ASSERT_EQ(columns.size(), 5u);
    for (const std::size_t c : columns) EXPECT_EQ(c, columns[0]);
    const std::vector<std::string> scenes{"a<b"};
    EXPECT_NE(light_html(scenes, all, "").find("too big, by far"), std::string::npos);
    EXPECT_NE(light_svg("nothing", {}).find("</svg>"), std::string::npos);
}

// What is said of how far off a level shows light, where that is known.
#include "compiler/density/shown_error.h"
#include "tests/compiler/ambient/baked_world.h"
#include <cmath>

namespace kiln {
namespace {

using test::Baked;

// A closed room whose walls send the same radiance everywhere: irradiance is emission pi / (1 - albedo) along every normal that sees nothing but walls.
std::unique_ptr<Baked> furnace() {
    test::WorldBuilder w;
    const MaterialId glow = w.material("glow", 0, {0.5f, 0.5f, 0.5f}, {1, 1, 1});
    w.room({0, 0, 0}, {192, 160, 128}, 16, glow);
    w.point_entity("info_player_start", {40, 40, 40});
    return test::bake(w);
}
// Flat light alone, on luxels of the map, as `make` says of each of a chart.
template <class Make> Density texels_of(const Baked& b, const Make& make) {
    Density d;
    for (const Chart& c : b.surfaces.charts) {
        d.grids.push_back({{1, 1}, {}, c.width, c.height, static_cast<std::uint32_t>(d.flat.size())});
        for (std::uint32_t y = 0; y < c.height; ++y)
            for (std::uint32_t x = 0; x < c.width; ++x) {
                const auto e = static_cast<float>(make(x, y));
                d.flat.push_back({e, e, e}), d.valid.push_back(1);
            }
    }
    return d;
}
ShownError error_of(const Baked& b, const Density& d, std::uint64_t seed = 0, int threads = 2) {
    Context context;
    context.threads = threads;
    const Result<ShownError> e = shown_error(b.world, b.surfaces, b.lighting, d, *b.field, {.seed = seed}, context);
    if (!e) ADD_FAILURE() << e.fault().diagnostic.message;
    return *e;
}

TEST(ShownError, IsWhatIsKnownInAFurnace) {
    const auto b = furnace();
    const double level = 2 * 3.14159265358979;
    const ShownError right = error_of(*b, texels_of(*b, [&](auto, auto) { return level; }));
    EXPECT_GT(right.places, 400u);
    EXPECT_LT(right.percent, 0.5); // answers of 32 rays are off by 2 %: the mean of 448 products of such by 1e-5, whose root that is
    for (const double off : {0.02, 0.3}) {
        const ShownError all = error_of(*b, texels_of(*b, [&](auto, auto) { return level * (1 + off); }));
        EXPECT_NEAR(all.percent, 100 * off, 0.1 + 0.5 * off);
        EXPECT_GE(all.high, all.percent);
        // Up and down from texel to texel: between their middles it is off by less, off * (1 - 2 u)(1 - 2 v), whose mean square is off^2 / 9.
        const ShownError board = error_of(*b, texels_of(*b, [&](std::uint32_t x, std::uint32_t y) { return level * ((x + y) % 2 ? 1 + off : 1 - off); }));
        EXPECT_NEAR(board.percent, 100 * off / 3, 0.1 + 2 * off);
        EXPECT_GE(board.high, 100 * off / 3);
    }
}

// A room with a lamp. On grids of one texel a chart the level is as far off as luxels are from the mean of their chart.
TEST(ShownError, SeesThatAGridIsTooCoarse) {
    test::WorldBuilder w;
    w.room({0, 0, 0}, {256, 192, 128}, 16, w.material("grey", 0, {0.5f, 0.5f, 0.5f}));
    w.point_entity("info_player_start", {40, 40, 40});
    w.point_entity("light", {60, 60, 40}, {{"_light", "255 255 255 300"}});
    const auto b = test::bake(w);
    const ShownError luxels = error_of(*b, {}); // as they are
    EXPECT_LT(luxels.percent, 12);
    const Surfaces& s = b->surfaces;
    Density one;
    std::vector<Rgbd> sum(s.charts.size());
    std::vector<double> area(s.charts.size());
    Rgbd level;
    double all = 0, square = 0;
    const auto light = [&](const Luxel& l) { return static_cast<Rgbd>(b->lighting.flat[texel_of(s, l)]); };
    for (const Luxel& l : s.luxels) sum[l.chart.at()] += light(l) * l.area, area[l.chart.at()] += l.area, level += light(l) * l.area, all += l.area;
    for (std::size_t c = 0; c < s.charts.size(); ++c) {
        one.grids.push_back({{1e-6, 1e-6}, {0.5, 0.5}, 1, 1, static_cast<std::uint32_t>(c)});
        one.flat.push_back(static_cast<Rgb>(sum[c] / area[c]));
    }
    for (const Luxel& l : s.luxels)
        for (std::size_t k = 0; k < 3; ++k) square += l.area / all / 3 * std::pow((static_cast<double>(one.flat[l.chart.at()][k]) - light(l)[k]) / std::max(light(l)[k], 0.02 * level[k] / all), 2);
    const ShownError coarse = error_of(*b, one);
    EXPECT_GT(coarse.percent, 2 * luxels.high);
    EXPECT_NEAR(coarse.percent, 100 * std::sqrt(square), 10 * std::sqrt(square));
    // The same of any number of threads; of other places about the same.
    EXPECT_EQ(error_of(*b, one, 0, 1).percent, coarse.percent);
    const ShownError others = error_of(*b, one, 1);
    EXPECT_NE(others.percent, coarse.percent);
    EXPECT_NEAR(others.percent, coarse.percent, 0.15 * coarse.percent);
}

// One ray in many meets a bright spot: products of answers then fall far below nothing, and that tells as little against an error as for one.
TEST(ShownError, ARareStrokeDoesNotHideWhatItMayBe) {
    std::vector<double> square(1000, 0.04);
    EXPECT_NEAR(most_mean_square(square), 0.04, 1e-9);
    square[17] = -100; // the mean is below 0
    EXPECT_GT(most_mean_square(square), 0.04);
    square[17] = 100; // the same stroke the other way: as far above, and more, as what is skewed so is
    EXPECT_GT(most_mean_square(square), 0.14 + 1.64 * 0.1);
}

} // namespace
} // namespace kiln

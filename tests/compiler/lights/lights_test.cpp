#include "compiler/lights/falloff.h"
#include "compiler/lights/lights.h"
#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

namespace kiln {
namespace {

using Keys = std::vector<std::pair<std::string, std::string>>;

World world_of(MapFormat format, const std::vector<Keys>& entities, const Keys& worldspawn = {}) {
    World w;
    w.file = "t";
    w.format = format;
    const auto add = [&](const Keys& keys) {
        WorldEntity e;
        e.id = e.line = static_cast<int>(w.entities.size());
        for (const auto& [k, v] : keys) e.keys.push_back({k, v, e.line});
        e.has_origin = find_key(e.keys, "origin") != nullptr;
        e.origin = key_vector(e.keys, "origin", {});
        w.entities.push_back(std::move(e));
    };
    Keys first = worldspawn;
    first.emplace_back("classname", "worldspawn");
    add(first);
    for (const Keys& e : entities) add(e);
    return w;
}
std::vector<Light> read(MapFormat format, const std::vector<Keys>& entities, Context& c,
                        const Keys& worldspawn = {}) {
    return read_lights(world_of(format, entities, worldspawn), c);
}
Light source_light(Keys keys, std::string classname = "light") {
    keys.emplace_back("classname", classname);
    keys.emplace_back("origin", "0 0 0");
    Context c;
    const std::vector<Light> l = read(MapFormat::vmf, {keys}, c);
    EXPECT_EQ(l.size(), 1u);
    return l.empty() ? Light{} : l[0];
}
Light quake_light(Keys keys, const Keys& worldspawn = {}) {
    keys.emplace_back("classname", "light_torch");
    keys.emplace_back("origin", "0 0 0");
    Context c;
    const std::vector<Light> l = read(MapFormat::quake_standard, {keys}, c, worldspawn);
    EXPECT_EQ(l.size(), 1u);
    return l.empty() ? Light{} : l[0];
}
std::size_t count(const Context& c, const std::string& code) {
    return static_cast<std::size_t>(std::ranges::count(c.diagnostics(), code, &Diagnostic::code));
}
double brightness(const Light& l, double d) {
    return l.intensity.x * l.attenuation(d);
}

// The published table of the original's 50 % / 0 % falloff, to its printed digits (six, so 5e-6 of the value).
TEST(Lights, FalloffByDistancesMatchesTheTable) {
    const struct {
        double half, zero, q, l, c, f0, f_zero;
    } rows[] = {
        {100, 200, 1.9387e-4, 3.06513e-4, .0306513, 32.625, .127441},
        {100, 300, 1.73885e-4, 1.97452e-3, .0636943, 15.700, .061328},
        {100, 500, 1.66667e-4, 1.66667e-3, .166667, 6.000, .023438},
        {100, 1000, 1.10112e-4, 4.49438e-3, .449438, 2.225, .008691},
        {100, 1600, 9.95833e-5, 4.16667e-5, 1, 1.000, .003906},
        {256, 1024, 2.70668e-5, 4.41696e-4, .113074, 8.844, .034546},
    };
    for (const auto& r : rows) {
        const Quadratic f = falloff_by_distances(r.half, r.zero);
        EXPECT_NEAR(f.quadratic / r.q, 1, 5e-6) << r.half << " " << r.zero;
        EXPECT_NEAR(f.linear / r.l, 1, 5e-6) << r.half << " " << r.zero;
        EXPECT_NEAR(f.constant / r.c, 1, 5e-6) << r.half << " " << r.zero;
        EXPECT_NEAR(1 / f.at(0), r.f0, 6e-4);
        EXPECT_NEAR(1 / f.at(r.zero), r.f_zero, 6e-7);
    }
}

// Laws of it, whatever the distances: one half at d50, never brighter further away.
TEST(Lights, FalloffByDistancesIsMonotone) {
    for (double half = 1; half < 3000; half *= 1.7)
        for (double ratio = 1.01; ratio < 2000; ratio *= 1.4) {
            Light l;
            const Quadratic f = falloff_by_distances(half, half * ratio);
            l.constant = f.constant, l.linear = f.linear, l.quadratic = f.quadratic;
            EXPECT_NEAR(l.attenuation(std::max(half, 1.0)), 0.5, 1e-9) << half << " " << ratio;
            double last = l.attenuation(0);
            for (double d = 1; d < half * ratio * 4; d *= 1.2) {
                const double a = l.attenuation(d);
                ASSERT_GT(a, 0) << half << " " << ratio << " " << d;
                ASSERT_LE(a, last * (1 + 1e-12)) << half << " " << ratio << " " << d;
                last = a;
            }
        }
}

TEST(Lights, SourceBrightnessIsThatAt100Units) {
    for (const char* key : {"_constant_attn", "_linear_attn", "_quadratic_attn"}) {
        const Light l = source_light({{"_light", "255 255 255 510"}, {key, "1"}});
        EXPECT_EQ(l.kind, LightKind::point);
        EXPECT_NEAR(brightness(l, 100), 2, 1e-6) << key;
    }
    const Light inverse_square =
        source_light({{"_light", "255 255 255 255"}, {"_quadratic_attn", "1"}, {"_constant_attn", "0"}});
    EXPECT_NEAR(brightness(inverse_square, 200), 0.25, 1e-6);
    EXPECT_NEAR(brightness(inverse_square, 50), 4, 1e-6);
    EXPECT_EQ(inverse_square.attenuation(0.001), inverse_square.attenuation(1)); // d is at least 1
    const Light mixed = source_light(
        {{"_light", "255 255 255 255"}, {"_quadratic_attn", "1"}, {"_linear_attn", "50"}, {"_constant_attn", "7"}});
    EXPECT_NEAR(brightness(mixed, 100), 1, 1e-6);
    EXPECT_NEAR(brightness(mixed, 300), (7 + 5000 + 10000) / (7 + 15000 + 90000.0), 1e-6);
    const Light constant = source_light({{"_light", "255 255 255 255"}}); // no coefficient at all
    EXPECT_NEAR(brightness(constant, 5000), 1, 1e-6);
}

TEST(Lights, SourceColoursAreGammaCoded) {
    EXPECT_NEAR(source_light({{"_light", "128 64 0 510"}}).intensity.y, 2 * std::pow(64 / 255.0, 2.2), 1e-6);
    EXPECT_EQ(source_light({{"_light", "255 255 255"}}).intensity.x, 1);
    EXPECT_NEAR(source_light({{"_light", "128"}}).intensity.z, std::pow(128 / 255.0, 2.2), 1e-6);
    EXPECT_EQ(source_light({{"_light", "255 255 255 255"}, {"_lightHDR", "-1 -1 -1 1"}, {"_lightscaleHDR", "3"}})
                  .intensity.x,
              1);
    EXPECT_EQ(
        source_light({{"_light", "255 255 255 255"}, {"_lightHDR", "255 255 255 510"}, {"_lightscaleHDR", "3"}})
            .intensity.x,
        6);
    EXPECT_EQ(source_light({{"_light", "255 255 255 255 255 255 255 510"}}).intensity.x, 2);
    EXPECT_NEAR(source_light({}).intensity.x, 200 / 255.0, 1e-6);
    Context c;
    EXPECT_NEAR(read(MapFormat::vmf, {{{"classname", "light"}, {"origin", "0 0 0"}, {"_light", "bright"}}}, c)
                    .at(0)
                    .intensity.x,
                200 / 255.0, 1e-6);
    EXPECT_EQ(count(c, "light-key-invalid"), 1u);
    EXPECT_EQ(c.diagnostics()[0].where.entity, 1);
}

TEST(Lights, HardFalloffFadesToNothing) {
    const Light l = source_light({{"_light", "255 255 255 255"},
                                  {"_fifty_percent_distance", "100"},
                                  {"_zero_percent_distance", "500"},
                                  {"_hardfalloff", "1"}});
    EXPECT_EQ(l.fade_start, 400);
    EXPECT_EQ(l.fade_end, 500);
    EXPECT_NEAR(brightness(l, 100), 0.5, 1e-6);
    Light soft = l;
    soft.fade_start = soft.fade_end = 0;
    EXPECT_EQ(l.attenuation(400), soft.attenuation(400));
    EXPECT_NEAR(l.attenuation(450), soft.attenuation(450) / 2, 1e-12); // the quintic is odd about its middle
    EXPECT_EQ(l.attenuation(500), 0);
    EXPECT_EQ(l.attenuation(900), 0);
    const Light swapped =
        source_light({{"_fifty_percent_distance", "100"}, {"_zero_percent_distance", "50"}, {"_hardfalloff", "1"}});
    EXPECT_EQ(swapped.fade_end, 200);
}

TEST(Lights, SourceSpotsHaveConesAndNegatedPitch) {
    const auto spot = [](Keys k) { return source_light(std::move(k), "light_spot"); };
    const auto near = [](Vec3 a, Vec3 b) { return length(a - b) < 1e-9; };
    EXPECT_TRUE(near(spot({{"pitch", "-90"}, {"angles", "0 0 0"}}).direction, {0, 0, -1}));
    EXPECT_TRUE(near(spot({{"pitch", "90"}}).direction, {0, 0, 1}));
    EXPECT_TRUE(near(spot({{"angles", "-90 0 0"}}).direction, {0, 0, -1}));
    EXPECT_TRUE(near(spot({{"angles", "0 90 0"}}).direction, {0, 1, 0}));
    const double h = std::sqrt(0.5);
    EXPECT_TRUE(near(spot({{"angles", "30 180 0"}, {"pitch", "-45"}}).direction, {-h, 0, -h}));

    const Light l = spot({{"pitch", "-90"}, {"_inner_cone", "30"}, {"_cone", "60"}, {"_exponent", "2"}});
    ASSERT_EQ(l.kind, LightKind::spot);
    const auto at = [&](double degrees) {
        const double a = degrees * std::numbers::pi / 180;
        return l.cone({std::sin(a), 0, -std::cos(a)});
    };
    EXPECT_NEAR(at(0), 1, 1e-12);
    EXPECT_NEAR(at(29), std::cos(29 * std::numbers::pi / 180), 1e-12);
    const double c45 = std::cos(std::numbers::pi / 4), c30 = std::sqrt(3) / 2;
    EXPECT_NEAR(at(45), c45 * std::pow((c45 - 0.5) / (c30 - 0.5), 2), 1e-12);
    EXPECT_EQ(at(60.001), 0);
    EXPECT_EQ(at(120), 0);
    EXPECT_EQ(spot({{"_inner_cone", "180"}, {"_cone", "180"}}).kind, LightKind::point);
    EXPECT_NEAR(spot({{"_inner_cone", "50"}, {"_cone", "20"}}).cos_outer, std::cos(50 * std::numbers::pi / 180),
                1e-12);
    EXPECT_NEAR(spot({{"_cone", "170"}}).cos_outer, 0, 1e-12); // at most 90 degrees

    Context c;
    const std::vector<Light> aimed =
        read(MapFormat::vmf,
             {{{"classname", "light_spot"}, {"origin", "0 0 100"}, {"target", "T"}},
              {{"classname", "info_target"}, {"targetname", "t"}, {"origin", "50 0 100"}}},
             c);
    EXPECT_TRUE(near(aimed.at(0).direction, {1, 0, 0}));
}

TEST(Lights, EnvironmentGivesSunAndSky) {
    Context c;
    const Keys env = {{"classname", "light_environment"},
                      {"_light", "255 255 255 510"},
                      {"_ambient", "255 255 255 255"},
                      {"pitch", "-90"},
                      {"SunSpreadAngle", "5"},
                      {"_lightHDR", "-1 -1 -1 1"},
                      {"_ambientHDR", "-1 -1 -1 1"}};
    const std::vector<Light> l = read(MapFormat::vmf, {env, env}, c);
    ASSERT_EQ(l.size(), 2u);
    EXPECT_EQ(count(c, "second-environment"), 1u);
    EXPECT_EQ(l[0].kind, LightKind::sun);
    EXPECT_EQ(l[0].intensity.x, 2);
    EXPECT_EQ(l[0].direction, (Vec3{0, 0, -1}));
    EXPECT_NEAR(l[0].angular_radius_rad, 5 * std::numbers::pi / 180, 1e-12);
    EXPECT_EQ(l[0].attenuation(1e5), 1);
    EXPECT_EQ(l[0].cone({0, 0, 1}), 1);
    EXPECT_EQ(l[1].kind, LightKind::sky);
    EXPECT_NEAR(l[1].intensity.x * std::numbers::pi, 1, 1e-6); // irradiance under an open sky
    Context c2;
    EXPECT_NEAR(read(MapFormat::vmf, {{{"classname", "light_environment"}, {"_light", "255 255 255 510"}}}, c2)
                        .at(1)
                        .intensity.x *
                    std::numbers::pi,
                1, 1e-6);
}

TEST(Lights, QuakeFalloffs) {
    const struct {
        Keys keys;
        double d, value;
    } cases[] = {
        {{}, 0, 300},
        {{}, 100, 200},
        {{}, 400, 0},
        {{{"light", "200"}, {"wait", "0.5"}}, 100, 150},
        {{{"_light", "200"}, {"wait", "2"}}, 60, 80},
        {{{"light", "200"}, {"delay", "1"}}, 256, 100},
        {{{"light", "200"}, {"delay", "1"}, {"wait", "2"}}, 256, 50},
        {{{"light", "200"}, {"delay", "2"}}, 256, 50},
        {{{"light", "200"}, {"delay", "2"}, {"wait", "0.5"}}, 256, 200},
        {{{"light", "200"}, {"delay", "3"}}, 5000, 200},
        {{{"light", "200"}, {"delay", "5"}}, 128, 50},
        {{{"light", "200"}, {"_falloff", "2"}}, 128, 200},
    };
    for (const auto& k : cases)
        EXPECT_NEAR(brightness(quake_light(k.keys), k.d) * 255, k.value, 1e-4) << k.d << " " << k.value;
}

TEST(Lights, QuakeColours) {
    EXPECT_NEAR(quake_light({{"_color", "1 0.5 0"}}).intensity.y, 300 / 255.0 * std::pow(0.5, 2.2), 1e-6);
    EXPECT_NEAR(quake_light({{"_color", "255 127.5 0"}}).intensity.y, 300 / 255.0 * std::pow(0.5, 2.2), 1e-6);
    const Light triple = quake_light({{"_light", "255 100 0"}});
    EXPECT_NEAR(triple.intensity.x, 1, 1e-6);
    EXPECT_NEAR(triple.intensity.y, 100 / 255.0, 1e-6);
    EXPECT_NEAR(triple.range, 255, 1e-9);
}

TEST(Lights, QuakeSpotsAndSuns) {
    Context c;
    const std::vector<Light> l = read(
        MapFormat::quake_standard,
        {{{"classname", "light"}, {"origin", "0 0 100"}, {"target", "a"}, {"angle", "60"}, {"_softangle", "20"}},
         {{"classname", "info_null"}, {"targetname", "a"}, {"origin", "0 0 0"}},
         {{"classname", "light"}, {"origin", "0 0 0"}, {"mangle", "90 -45 0"}},
         {{"classname", "light"}, {"origin", "0 0 0"}, {"_sun", "1"}, {"mangle", "0 -90 0"}, {"light", "510"}}},
        c,
        {{"_sunlight", "255"},
         {"_sun_mangle", "180 -45 0"},
         {"_sunlight2", "255"},
         {"_sunlight_penumbra", "4"},
         {"_anglescale", "0.5"}});
    ASSERT_EQ(l.size(), 5u);
    const double h = std::sqrt(0.5);
    EXPECT_EQ(l[0].kind, LightKind::sun);
    EXPECT_NEAR(length(l[0].direction - Vec3{-h, 0, -h}), 0, 1e-12);
    EXPECT_EQ(l[0].intensity.x, 1);
    EXPECT_NEAR(l[0].angular_radius_rad, 2 * std::numbers::pi / 180, 1e-12);
    EXPECT_EQ(l[1].kind, LightKind::sky);
    EXPECT_NEAR(l[1].intensity.x * std::numbers::pi, 1, 1e-6);
    EXPECT_EQ(l[2].kind, LightKind::spot);
    EXPECT_EQ(l[2].direction, (Vec3{0, 0, -1}));
    EXPECT_EQ(l[2].angle_scale, 0.5);
    EXPECT_EQ(l[2].cone({0, 0, -1}), 1);
    EXPECT_EQ(l[2].cone(normalize(Vec3{0.1, 0, -1})), 1); // inside 10 degrees: no cosine factor
    EXPECT_EQ(l[2].cone(normalize(Vec3{0.6, 0, -1})), 0); // beyond 30 degrees
    EXPECT_NEAR(length(l[3].direction - Vec3{0, h, -h}), 0, 1e-12);
    EXPECT_EQ(l[4].kind, LightKind::sun);
    EXPECT_EQ(l[4].intensity.x, 2);
    EXPECT_EQ(quake_light({}).angle_scale, 1);
}

TEST(Lights, StylesDecideWhatIsBaked) {
    const Keys plain = {{"classname", "light"}, {"origin", "0 0 0"}};
    const auto with = [&](Keys more) {
        more.insert(more.end(), plain.begin(), plain.end());
        return more;
    };
    for (const MapFormat format : {MapFormat::vmf, MapFormat::quake_standard}) {
        Context c;
        const std::vector<Light> l = read(format,
                                          {plain, with({{"style", "3"}}), with({{"targetname", "a"}}),
                                           with({{"targetname", "b"}, {"spawnflags", "1"}}),
                                           with({{"targetname", "c"}, {"style", "33"}, {"spawnflags", "1"}})},
                                          c);
        ASSERT_EQ(l.size(), 3u);
        EXPECT_EQ(l[0].style, 0u);
        EXPECT_EQ(l[1].style, 3u);
        EXPECT_GE(l[2].style, 32u);
        EXPECT_EQ(count(c, "light-starts-dark"), 1u);
        EXPECT_EQ(count(c, "light-style-steady"), 1u);
    }
}

TEST(Lights, OddKeysAreToldAndNeverSpread) {
    Context c;
    const std::vector<Light> l =
        read(MapFormat::quake_standard,
             {{{"classname", "light"}}, // no origin
              {{"classname", "light"}, {"origin", "0 0 0"}, {"light", "-100"}},
              {{"classname", "light"}, {"origin", "0 0 0"}, {"light", "nan"}, {"wait", "inf"}, {"delay", "77"}},
              {{"classname", "light"}, {"origin", "0 0 0"}, {"light", "0"}},
              {{"classname", "light"}, {"origin", "0 0 0"}, {"delay", "4"}},
              {{"classname", "light"}, {"origin", "0 0 0"}, {"_surface", "x"}},
              {{"classname", "light"},
               {"origin", "0 0 0"},
               {"_color", "1 1"},
               {"_deviance", "5"},
               {"light", "1e300"},
               {"delay", "3"}}},
             c, {{"_minlight", "10"}});
    ASSERT_EQ(l.size(), 2u);
    for (const Light& x : l)
        for (std::size_t i = 0; i < 3; ++i)
            EXPECT_TRUE(std::isfinite(x.intensity[i]) && std::isfinite(x.attenuation(10)));
    EXPECT_NEAR(brightness(l[0], 0) * 255, 300, 1e-4);
    for (const char* code : {"light-without-origin", "light-negative", "not-handled-local-minimum",
                             "not-handled-surface-light", "not-handled-light-key"})
        EXPECT_EQ(count(c, code), 1u) << code;
    EXPECT_EQ(count(c, "light-key-invalid"), 4u);
}

TEST(Lights, HalfLifeSpeaksSource) {
    Context c;
    const std::vector<Light> l =
        read(MapFormat::quake_valve220,
             {{{"classname", "light"}, {"origin", "0 0 0"}, {"_light", "255 255 255 255"}},
              {{"classname", "light_spot"},
               {"origin", "0 0 0"},
               {"_light", "255 255 255 255"},
               {"_cone", "20"},
               {"_cone2", "40"},
               {"pitch", "-90"}},
              {{"classname", "light_environment"}, {"_light", "255 255 255 255"}, {"pitch", "-60"}}},
             c);
    ASSERT_EQ(l.size(), 4u);
    EXPECT_NEAR(brightness(l[0], 100), 1, 1e-6);
    EXPECT_NEAR(brightness(l[0], 200), 0.25, 1e-6);
    EXPECT_NEAR(l[1].cos_inner, std::cos(20 * std::numbers::pi / 180), 1e-12);
    EXPECT_NEAR(l[1].cos_outer, std::cos(40 * std::numbers::pi / 180), 1e-12);
    EXPECT_EQ(l[2].kind, LightKind::sun);
}

} // namespace
} // namespace kiln

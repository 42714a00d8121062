// Pictures of a room whose light is known in closed form.
#include "tools/render/render.h"
#include "formats/level/kiln_level.hpp"
#include "tests/formats/level/sample_level.h"
#include <filesystem>
#include <gtest/gtest.h>

namespace kiln {
namespace {

using level::Float3;
using level::LevelContent;
using level::test::kPi;

struct Opened {
    std::vector<std::uint8_t> bytes;
    level::Level level;
    explicit Opened(const LevelContent& c) : bytes(level::write_level(c)), level(bytes) {}
    operator const kiln_level*() const { return level.get(); }
};
Image picture(const kiln_level* level, CameraOptions options, Camera camera = {.eye = {10, -20, 30}, .yaw_deg = 37, .pitch_deg = 12}) {
    Context context;
    if (options.width == 1280) options.width = 64, options.height = 48;
    Result<Image> image = render_camera(level, camera, options, context);
    EXPECT_TRUE(image);
    return *image;
}
void expect_constant(const Image& image, Rgb wanted, double relative) {
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            for (int c = 0; c < 3; ++c)
                ASSERT_NEAR(image.at(x, y, c), wanted[static_cast<std::size_t>(c)], relative * std::max(1e-3f, wanted[static_cast<std::size_t>(c)]));
}

} // namespace

TEST(Render, ARoomUnderConstantIrradianceIsAlbedoTimesEOverPi) {
    for (const bool directional : {false, true}) {
        const Opened level(level::test::constant_room({2, 1, 0.5f}, directional));
        const Rgb e{2, 1, 0.5f}, albedo{0.5f, 0.25f, 0.75f};
        const auto per_pi = static_cast<float>(1 / kPi);
        for (const int samples : {1, 4, 16}) expect_constant(picture(level, {.samples = samples}), albedo * e * per_pi, 2e-3);
        expect_constant(picture(level, {.show = Show::irradiance}), e * per_pi, 2e-3);
        expect_constant(picture(level, {.show = Show::flat}), e * per_pi, 2e-3);
        expect_constant(picture(level, {.show = Show::albedo}), albedo, 1e-6);
        expect_constant(picture(level, {.show = Show::reflection}), {}, 0);
    }
}

// A sphere of constant radiance reflected with F0 = 1: env_map times that radiance, at any angle and roughness.
TEST(Render, ReflectionOfAConstantEnvironment) {
    LevelContent c = level::test::constant_room({1, 1, 1});
    c.materials[0].env_map = 0.5f;
    level::test::add_probe(c, 8, 4, [](std::uint32_t, int, double, double) { return Float3{4, 2, 1}; });
    for (const bool boxed : {false, true}) {
        c.probes[0].boxed = boxed, c.probes[0].box_lo = {-128, -128, -128}, c.probes[0].box_hi = {128, 128, 128};
        const Opened level(c);
        expect_constant(picture(level, {.show = Show::reflection, .fresnel_at_normal = 1}), {2, 1, 0.5f}, 4e-3);
    }
}

TEST(Render, EmissionIsAddedAndFacesBehindAreCulled) {
    LevelContent c = level::test::constant_room({0, 0, 0});
    c.materials[0].emission = {3, 2, 1};
    const Opened level(c);
    expect_constant(picture(level, {}), {3, 2, 1}, 1e-6);
    // From outside, the near walls show their backs: not drawn, the far walls' fronts are.
    expect_constant(picture(level, {}, camera_looking_at({400, 10, 20}, {0, 0, 0}, 20)), {3, 2, 1}, 1e-6);
}

TEST(Render, SkyFacesShowTheSkyOfTheLevel) {
    LevelContent c = level::test::constant_room({1, 1, 1});
    for (level::FaceInfo& f : c.faces) f.sky = true, f.drawn = false;
    expect_constant(picture(Opened(c), {.sky = {0.5f, 0.25f, 2}}), {0.5f, 0.25f, 2}, 1e-6);
    c.lights.resize(1);
    c.lights[0].kind = 3, c.lights[0].intensity = {1, 2, 3};
    expect_constant(picture(Opened(c), {}), {1, 2, 3}, 1e-6);
    expect_constant(picture(Opened(c), {.own_sky = false, .sky = {0.5f, 0.25f, 2}}), {0.5f, 0.25f, 2}, 1e-6);
}

TEST(Render, GlassLetsThroughWhatItDoesNotShow) {
    LevelContent c = level::test::constant_room({0, 0, 0});
    c.materials[0].emission = {1, 1, 1};
    level::MaterialInfo pane = c.materials[0];
    pane.name = "pane", pane.alpha = 0.25f, pane.emission = {9, 0, 1};
    c.materials.push_back(pane);
    level::FaceInfo f = c.faces[0];
    f.material = 1, f.chart = UINT32_MAX, f.two_sided = true, f.normal = {-1, 0, 0};
    f.first_triangle = static_cast<std::uint32_t>(c.triangles.size());
    c.materials[1].reflectance = {0, 0, 0};
    const auto n = static_cast<std::uint32_t>(c.positions.size());
    for (const level::Double3 p : {level::Double3{64, -128, -128}, {64, 128, -128}, {64, 128, 128}, {64, -128, 128}}) c.positions.push_back(p);
    c.triangles.push_back({n, n + 2, n + 1}), c.triangles.push_back({n, n + 3, n + 2});
    for (int k = 0; k < 2; ++k) c.corner_normals.push_back({f.normal, f.normal, f.normal});
    c.faces.push_back(f);
    const Opened level(c);
    expect_constant(picture(level, {.width = 8, .height = 8}, {.eye = {0, 0, 0}, .fov_deg = 60}), {0.25f * 9 + 0.75f, 0.75f, 1}, 1e-5);
    expect_constant(picture(level, {.width = 8, .height = 8}, {.eye = {0, 0, 0}, .yaw_deg = 180, .fov_deg = 60}), {1, 1, 1}, 1e-5);
}

// A normal map that leans along the texture's u: E of a `dot` vector along the tangent shows it, and only with the map.
TEST(Render, NormalMapsLeanAlongTheTextureAxes) {
    namespace fs = std::filesystem;
    const fs::path directory = fs::path(KILN_BINARY_DIR) / "render_test_textures";
    fs::create_directories(directory);
    Image map(4, 4, 3), albedo(4, 4, 3);
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 4; ++x) {
            const float n[3] = {0.6f, 0, 0.8f}; // towards +u
            for (int c = 0; c < 3; ++c) map.at(x, y, c) = 0.5f + 0.5f * n[c];
            albedo.at(x, y, 0) = 1, albedo.at(x, y, 1) = 0.5f, albedo.at(x, y, 2) = 0;
        }
    ASSERT_TRUE(write_png((directory / "lean.png").string(), map, Transfer::linear, 16));
    ASSERT_TRUE(write_png((directory / "orange.png").string(), albedo, Transfer::srgb, 16));
    // U = (0.5, 0, 1): E = 0.5 n_x + n_z.
    LevelContent c = level::test::room(0, true, [](std::size_t, std::uint32_t, std::uint32_t) {
        const auto l = [](double x, double y) {
            const auto v = static_cast<float>(x * 0.5 + y * 1.0);
            return Float3{v, v, v};
        };
        const double a = std::sqrt(2.0 / 3), b = 1 / std::sqrt(6.0), z = 1 / std::sqrt(3.0);
        return std::array<Float3, 4>{Float3{1, 1, 1}, l(a, z), l(-b, z), l(-b, z)};
    });
    c.materials[0].normal_map = "sub/lean.png", c.materials[0].albedo_map = "orange"; // found by the last part, and with .png
    CameraOptions options{.texture_directories = {"/nonexistent", directory.string()}};
    const Opened level(c);
    const auto per_pi = static_cast<float>(1 / kPi);
    expect_constant(picture(level, options), Rgb{1, 0.5f, 0} * ((0.5f * 0.6f + 0.8f) * per_pi), 2e-3);
    options.normal_maps = false;
    expect_constant(picture(level, options), Rgb{1, 0.5f, 0} * per_pi, 2e-3);
    options.normal_maps = true;
    for (level::FaceInfo& f : c.faces) f.u_scale = -1; // the image runs the other way, and so does the lean
    expect_constant(picture(Opened(c), options), Rgb{1, 0.5f, 0} * ((-0.5f * 0.6f + 0.8f) * per_pi), 2e-3);
}

TEST(Render, MissingTexturesAreReportedOnceAndReflectanceIsShown) {
    LevelContent c = level::test::constant_room({1, 1, 1});
    c.materials[0].albedo_map = "nowhere.png";
    const Opened level(c);
    Context context;
    const auto image = render_camera(level, {}, {.width = 4, .height = 4, .texture_directories = {"/nonexistent"}}, context);
    ASSERT_TRUE(image);
    ASSERT_EQ(context.diagnostics().size(), 1u);
    EXPECT_EQ(context.diagnostics()[0].code, "texture-not-found");
    expect_constant(*image, Rgb{0.5f, 0.25f, 0.75f} * static_cast<float>(1 / kPi), 3e-3);
}

TEST(Render, ThreadsDoNotMatter) {
    const Opened level(level::test::mixture(2, 10));
    std::vector<Image> images;
    for (const int threads : {1, 2, 7}) {
        Context context;
        context.threads = threads;
        auto image = render_camera(level, camera_looking_at({80, 80, 300}, {80, 90, 0}), {.width = 60, .height = 50}, context);
        ASSERT_TRUE(image);
        images.push_back(*image);
    }
    EXPECT_EQ(images[0].pixels, images[1].pixels);
    EXPECT_EQ(images[0].pixels, images[2].pixels);
}

TEST(Render, TheCameraLooksWhereItsAnglesSay) {
    // Face 0 is x = +128, face 1 x = -128, 2, 3 the same in y, 4, 5 in z.
    LevelContent c = level::test::room(0, false, [](std::size_t face, std::uint32_t, std::uint32_t) {
        const auto e = static_cast<float>(face + 1);
        return std::array<Float3, 4>{Float3{e, e, e}, {}, {}, {}};
    });
    const Opened level(c);
    const struct { double yaw, pitch; int face; } looks[] = {{0, 0, 0}, {180, 0, 1}, {90, 0, 2}, {-90, 0, 3}, {20, -89, 4}, {20, 89, 5}};
    for (const auto& look : looks) {
        const Image i = picture(level, {.width = 3, .height = 3, .show = Show::irradiance}, {.yaw_deg = look.yaw, .pitch_deg = look.pitch, .fov_deg = 20});
        EXPECT_NEAR(i.at(1, 1, 0) * kPi, look.face + 1, 0.02);
    }
    // Left of +x is +y; above is +z.
    const Image wide = picture(level, {.width = 31, .height = 31, .show = Show::irradiance}, {.fov_deg = 150});
    EXPECT_NEAR(wide.at(1, 15, 0) * kPi, 3, 0.02);
    EXPECT_NEAR(wide.at(29, 15, 0) * kPi, 4, 0.02);
    EXPECT_NEAR(wide.at(15, 1, 0) * kPi, 5, 0.03);
    EXPECT_NEAR(wide.at(15, 29, 0) * kPi, 6, 0.03);
    const Camera c2 = camera_looking_at({0, 0, 0}, {0, 10, -10});
    EXPECT_NEAR(c2.yaw_deg, 90, 1e-9);
    EXPECT_NEAR(c2.pitch_deg, 45, 1e-9);
}

TEST(Render, TheDefaultCameraIsThePlayers) {
    LevelContent c = level::test::constant_room({1, 1, 1});
    EXPECT_EQ(default_camera(Opened(c)).eye, (Vec3{0, 0, 0})); // the middle of the room
    c.entities.push_back({.keys = {{"classname", "info_player_start"}, {"origin", "10 20 -100"}, {"angles", "5 90 0"}}});
    const Camera camera = default_camera(Opened(c));
    EXPECT_EQ(camera.eye, (Vec3{10, 20, -36}));
    EXPECT_EQ(camera.yaw_deg, 90);
    EXPECT_EQ(camera.pitch_deg, 5);
    c.entities.push_back({.keys = {{"classname", "point_viewcontrol"}, {"origin", "1 2 3"}, {"fov", "70"}}});
    EXPECT_EQ(default_camera(Opened(c)).eye, (Vec3{1, 2, 3}));
    EXPECT_EQ(default_camera(Opened(c)).fov_deg, 70);
}

TEST(Render, AtlasPagesShowTheirLayers) {
    const Opened level(level::test::room(0, true, [](std::size_t, std::uint32_t, std::uint32_t) {
        return std::array<Float3, 4>{Float3{9, 9, 9}, Float3{1, 0, 0}, Float3{0, 2, 0}, Float3{0, 0, -4}};
    }));
    const kiln_chart& chart = level.level.charts()[3];
    const Rgb wanted[3] = {{1, 0, 0}, {0, 2, 0}, {0, 0, -4}};
    for (int layer = 0; layer < 3; ++layer) {
        const auto image = render_atlas(level, layer);
        ASSERT_TRUE(image);
        for (int c = 0; c < 3; ++c)
            EXPECT_EQ(image->at(static_cast<int>(chart.page_x), static_cast<int>(chart.page_y), c), wanted[layer][static_cast<std::size_t>(c)]);
    }
    const auto flat = render_atlas(level, -1);
    ASSERT_TRUE(flat);
    EXPECT_NEAR(flat->at(static_cast<int>(chart.page_x), static_cast<int>(chart.page_y), 1), 2 / std::sqrt(3.0), 1e-6);
    EXPECT_FALSE(render_atlas(level, 3));
    EXPECT_FALSE(render_atlas_page(level, 99, 0));
    for (const FalseColour kind : {FalseColour::luxel_density, FalseColour::error, FalseColour::validity}) EXPECT_TRUE(render_false_colour(level, kind));
}

TEST(Render, QualityOfAStrippedLevelIsAFault) {
    const auto bytes = level::write_level(level::test::constant_room({1, 1, 1}), {.strip = true});
    const level::Level level(bytes);
    EXPECT_FALSE(render_false_colour(level.get(), FalseColour::error));
    EXPECT_TRUE(render_false_colour(level.get(), FalseColour::luxel_density));
}

// The room is a square of its cluster's colour in the middle; around it is solid.
TEST(Render, ThePlanShowsTheRoom) {
    const Opened level(level::test::constant_room({1, 1, 1}));
    const auto plan = render_plan(level, 10, {.width = 201});
    ASSERT_TRUE(plan);
    const auto at = [&](int x, int y) { return Rgb{plan->at(x, y, 0), plan->at(x, y, 1), plan->at(x, y, 2)}; };
    const Rgb room = at(100, plan->height / 2);
    int inside = 0, all = plan->width * plan->height;
    for (int y = 0; y < plan->height; ++y)
        for (int x = 0; x < plan->width; ++x) inside += at(x, y) == room;
    const double side = 256 / (256 + 2 * (256 * 0.04 + 8)); // of the picture
    EXPECT_NEAR(static_cast<double>(inside) / all, side * side, 0.03);
    EXPECT_NE(at(1, 1), room);
    const auto above = render_plan(level, 500, {.width = 201});
    ASSERT_TRUE(above);
    EXPECT_NE((Rgb{above->at(100, 100, 0), above->at(100, 100, 1), above->at(100, 100, 2)}), room);
}

TEST(Render, ToneMappingIsMonotonousAndInRange) {
    Image ramp(256, 1, 3);
    for (int x = 0; x < 256; ++x)
        for (int c = 0; c < 3; ++c) ramp.at(x, 0, c) = static_cast<float>(std::exp2(x / 16.0 - 8));
    const Image out = tone_mapped(ramp);
    for (int x = 1; x < 256; ++x) {
        EXPECT_GE(out.at(x, 0, 0), out.at(x - 1, 0, 0));
        EXPECT_LE(out.at(x, 0, 0), 1);
    }
    EXPECT_GT(auto_exposure(ramp), 0);
    Image twice = ramp;
    for (float& v : twice.pixels) v *= 2;
    EXPECT_NEAR(auto_exposure(twice) / auto_exposure(ramp), 0.5, 1e-6);
}

TEST(Render, ADamagedLevelIsAFaultNotAPicture) {
    auto bytes = level::write_level(level::test::constant_room({1, 1, 1}));
    const level::Level good(bytes);
    for (std::size_t i = 0; i < kiln_level_lump_count(good.get()); ++i) {
        kiln_lump lump{};
        kiln_level_lump(good.get(), i, &lump);
        if (std::string(lump.name) != "MESH") continue;
        bytes[lump.offset + 1] ^= 1;
    }
    const level::Level level(bytes);
    Context context;
    const auto image = render_camera(level.get(), {}, {.width = 4, .height = 4}, context);
    ASSERT_FALSE(image);
    EXPECT_EQ(image.fault().diagnostic.code, "level-damaged");
    EXPECT_EQ(image.fault().exit, Exit::input);
}

} // namespace kiln

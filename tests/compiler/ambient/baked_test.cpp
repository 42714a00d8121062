// The cubes of worlds baked by the real stages.
#include "compiler/ambient/air.h"
#include "compiler/ambient/cube.h"
#include "compiler/light/kept_rest.h"
#include "compiler/light/memo.h"
#include "libs/sampling/sobol.h"
#include "tests/compiler/ambient/baked_world.h"
#include "tests/support/curves.h"
#include <numbers>

namespace kiln {
namespace {

using test::bake;
using test::Baked;

Ambient ambient_of(Baked& b, const AmbientOptions& options = {}) {
    auto ambient = place_ambient(b.bsp, b.csg.planes, b.surfaces, b.lights, *b.field, options, b.context);
    EXPECT_TRUE(ambient);
    validate(*ambient);
    return std::move(*ambient);
}

// Everything emits 1 - rho and reflects rho: radiance 1 everywhere, so every face of every cube is pi.
TEST(AmbientBaked, Furnace) {
    test::WorldBuilder w;
    const MaterialId m = w.material("furnace", 0, {0.5f, 0.5f, 0.5f}, {0.5f, 0.5f, 0.5f});
    w.room({0, 0, 0}, {320, 256, 128}, 16, m);
    w.box({96, 96, 0}, {160, 144, 64}, Contents::solid, {0}, m);
    w.box({200, 40, 0}, {232, 72, 100}, Contents::detail, {0}, m);
    w.point_entity("info_player_start", {40, 40, 40});
    const auto baked = bake(w);
    const Ambient ambient = ambient_of(*baked);
    ASSERT_FALSE(ambient.cubes.empty());
    double worst = 0;
    for (const AmbientCube& cube : ambient.cubes) {
        EXPECT_EQ(cube.invalid_share, 0);
        for (const Rgb& e : cube.irradiance)
            for (std::size_t c = 0; c < 3; ++c) worst = std::max(worst, std::abs(e[c] / std::numbers::pi - 1));
    }
    RecordProperty("worst", std::to_string(worst));
    EXPECT_LT(worst, 0.005);
}

// A lit and a dark room, sealed from each other: not a photon in the dark one, wherever the lattice lies.
TEST(AmbientBaked, DarkRoomStaysBlack) {
    test::WorldBuilder w;
    w.room({0, 0, 0}, {528, 256, 128});
    w.box({256, 0, 0}, {264, 256, 128});
    w.point_entity("info_player_start", {40, 40, 40});
    w.point_entity("info_player_start", {400, 40, 40});
    w.point_entity("light", {100, 100, 90}, {{"_light", "255 255 255 300"}});
    const auto baked = bake(w);
    for (const double offset : {0.0, 5.0 / 16, 0.6}) {
        AmbientOptions options;
        options.lattice_offset = offset;
        const Ambient ambient = ambient_of(*baked, options);
        std::size_t lit = 0;
        for (double x = 1; x < 528; x += 9)
            for (double y = 1; y < 256; y += 23)
                for (double z = 1; z < 128; z += 21) {
                    if (x > 255 && x < 265) continue;
                    const auto cube = ambient_at(ambient, {x, y, z});
                    ASSERT_TRUE(cube) << x << ' ' << y << ' ' << z;
                    double level = 0;
                    for (const Rgb& e : *cube) level += std::abs(mean(e));
                    if (x > 260) {
                        EXPECT_EQ(level, 0) << x << ' ' << y << ' ' << z;
                        EXPECT_TRUE(ambient_lights_at(ambient, {x, y, z}).empty());
                    } else {
                        lit += level > 0;
                    }
                }
        EXPECT_GT(lit, 1000u);
    }
}

// Entity lights as the cubes count them are the light stage's own.
TEST(AmbientBaked, DirectLightIsThatOfTheLightStage) {
    test::WorldBuilder w;
    w.room({0, 0, 0}, {400, 300, 200});
    w.box({180, 100, 0}, {190, 200, 150});
    w.point_entity("info_player_start", {40, 40, 40});
    w.point_entity("light", {100, 100, 90}, {{"_light", "255 200 150 300"}});
    w.point_entity("light", {350, 250, 90}, {{"_light", "100 200 255 200"}, {"_quadratic_attn", "1"}});
    w.point_entity("light_spot", {200, 50, 190}, {{"_light", "255 255 255 500"}, {"pitch", "-90"}, {"_cone", "60"}, {"_inner_cone", "30"}});
    for (const MapFormat format : {MapFormat::vmf, MapFormat::quake_standard}) {
        w.world.format = format;
        const auto baked = bake(w);
        const ambient::Air air = ambient::air_of(baked->bsp, baked->csg.planes, baked->surfaces, baked->lights, *baked->field);
        ASSERT_EQ(air.light_count, baked->lights.size());
        ASSERT_GE(air.light_count, 3u);
        for (const Vec3 p : {Vec3{50, 60, 70}, Vec3{300, 150, 20}, Vec3{210, 60, 40}, Vec3{120, 150, 10}}) {
            ambient::Cube6 mine{}, theirs{};
            for (std::uint32_t l = 0; l < air.light_count; ++l)
                if (const auto direct = air.direct(l, p); direct && air.light_clear(l, p))
                    ambient::add(mine, direct->direction, direct->irradiance);
            baked->field->arriving_direct(p, {}, 1, [&](Vec3 d, Rgbd weight) { ambient::add(theirs, d, weight); });
            using namespace ambient; // operators of Cube6
            const Cube6 difference = mine - theirs;
            EXPECT_LE(dot(difference, difference), 1e-12 * dot(theirs, theirs) + 1e-20) << p.x << ' ' << int(format);
        }
    }
}

// Nothing stands inside a detail brush, which the tree does not know.
TEST(AmbientBaked, NoCubeInsideDetail) {
    test::WorldBuilder w;
    w.room({0, 0, 0}, {512, 512, 256});
    w.box({100, 100, 0}, {300, 300, 200}, Contents::detail);
    w.point_entity("info_player_start", {40, 40, 40});
    w.point_entity("light", {400, 400, 200}, {{"_light", "255 255 255 300"}});
    const auto baked = bake(w);
    const Ambient ambient = ambient_of(*baked);
    ASSERT_FALSE(ambient.cubes.empty());
    for (const AmbientCube& c : ambient.cubes)
        EXPECT_FALSE(c.position.x > 100 && c.position.x < 300 && c.position.y > 100 && c.position.y < 300 && c.position.z < 200);
}

// A hollow beneath terrain is nowhere anybody is: it gets few cells, however large, and what is above all the answers.
TEST(AmbientBaked, FewCellsBeneathTerrain) {
    test::WorldBuilder w;
    const MaterialId grey = w.material("grey", 0, {0.5f, 0.5f, 0.5f});
    w.room({0, 0, 0}, {1536, 1536, 1280}, 16, grey);
    for (const bool right : {false, true})
        test::displaced_box(w, {right ? 768. : 0., 0, 880}, {right ? 1536. : 768., 1536, 896}, 3, [](double x, double y) { return test::hills(x / 3, y / 3); }, grey, 64);
    for (WorldSide& s : w.world.sides) s.lightmap_scale = 64;
    w.point_entity("info_player_start", {700, 700, 1100});
    w.point_entity("light", {700, 700, 1200}, {{"_light", "255 255 255 900"}});
    const auto b = test::bake(w);
    const Ambient ambient = ambient_of(*b, {.error_percent = 50});
    std::size_t beneath = 0;
    for (const AmbientCell& c : ambient.cells) beneath += c.lo.z + c.size < 840;
    EXPECT_LT(beneath, 500u); // of the finest 24 x 24 x 13
    const Sobol points(3);
    for (std::uint32_t i = 0; i < 2048; ++i) {
        const Vec3 p{1 + 1534 * points(i, 0), 1 + 1534 * points(i, 1), 950 + 300 * points(i, 2)};
        EXPECT_TRUE(ambient_at(ambient, p).has_value()) << p.x << ' ' << p.y << ' ' << p.z;
    }
}

// A floor goes on from a lit room into a dark one. At its rim and at the foot of the wall, lookups read texels that no face covers: these have nothing from beyond the wall.
TEST(FieldBaked, NoLightIsShownAtTheFootOfAWall) {
    for (const double thick : {1.0, 6.0, 16.0, 24.0, 40.0}) { // luxels under the last are covered whole; those of the first lie on both sides
        test::WorldBuilder w;
        const MaterialId grey = w.material("grey", 0, {0.5f, 0.5f, 0.5f});
        w.room({0, 0, 0}, {256, 128, 96}, 16, grey);
        w.box({120, 0, 0}, {120 + thick, 80, 96}, Contents::solid, {0}, grey);
        w.point_entity("info_player_start", {40, 40, 40});
        w.point_entity("light", {60, 24, 60}, {{"_light", "255 255 255 200"}});
        const auto baked = bake(w);
        const auto shown = [&](double x, double y) { return static_cast<double>(baked->field->radiance({x, y, 10}, {0, 0, -1}).x); };
        const double foot = 120 + thick + 0.5;
        const double inside = shown(foot + 16, 24), lit = shown(112, 24);
        EXPECT_GT(lit, 8 * inside);
        for (const double y : {0.5, 4.0, 24.0, 40.0}) EXPECT_LT(shown(foot, y), 1.6 * inside) << thick << ": " << y;
    }
}

// What rays met in an earlier world is looked up again under other lights, and the cubes are those of a lattice that knows no other.
TEST(AmbientBaked, ARebuiltLatticeIsThatOfACleanOne) {
    struct Edit {
        const char* name;
        Vec3 lamp{60, 60, 100};
        const char* light = "255 255 255 200";
        Rgb panel{4, 4, 3}, wall{0.5f, 0.4f, 0.3f};
    };
    const auto world = [](const Edit& e, bool glazed) {
        test::WorldBuilder w;
        const MaterialId wall = w.material("wall", 0, e.wall), panel = w.material("panel", 0, {0.2f, 0.2f, 0.2f}, e.panel);
        w.room({0, 0, 0}, {320, 192, 128}, 16, wall);
        w.box({152, 0, 0}, {168, 64, 128}, Contents::solid, {0}, wall), w.box({152, 128, 0}, {168, 192, 128}, Contents::solid, {0}, wall);
        w.box({240, 80, 120}, {272, 112, 128}, Contents::solid, {0}, panel);
        if (glazed) {
            const MaterialId glass = w.material("glass", kTranslucent, {0.2f, 0.3f, 0.2f});
            w.world.materials[glass.at()].alpha = 0.5f;
            w.box({158, 64, 0}, {162, 128, 128}, Contents::detail, {0}, glass);
        }
        w.point_entity("info_player_start", {40, 40, 40});
        w.point_entity("light", e.lamp, {{"_light", e.light}});
        return bake(w);
    };
    std::vector<Edit> edits{{.name = "nothing"}};
    edits.push_back({.name = "brighter", .light = "255 255 255 260"});
    edits.push_back({.name = "moved", .lamp = {90, 130, 60}});
    edits.push_back({.name = "panel", .panel = {1, 4, 3}});
    edits.push_back({.name = "panel out", .panel = {}});
    edits.push_back({.name = "walls", .wall = {0.3f, 0.4f, 0.5f}});
    edits.push_back({.name = "as it was"});
    edits.push_back({.name = "brighter again", .light = "255 255 255 260"});
    const Edit shining{.name = ""}, dull{.name = "", .panel = {}}; // without emitters a path depends on nothing but the lamps around
    for (const auto& [glazed, base] : {std::pair{false, shining}, {false, dull}, {true, shining}, {true, dull}}) {
        const auto first = world(base, glazed);
        EXPECT_EQ(first->field->scene().has_panes(), glazed);
        const auto cubes = [&](Baked& b, Memo* memo) {
            const auto made = place_ambient(b.bsp, b.csg.planes, b.surfaces, b.lights, *b.field, {}, b.context, memo);
            EXPECT_TRUE(made);
            return to_bytes(*made);
        };
        Memo kept;
        EXPECT_EQ(cubes(*first, &kept), cubes(*first, nullptr));
        const std::size_t all = kept.size();
        kept = from_bytes<Memo>(to_bytes(kept));
        Memo chain = kept;
        for (Edit e : edits) {
            const bool dark = base.panel == Rgb{};
            if (dark && !(e.panel == shining.panel)) continue;
            if (dark) e.panel = {};
            const auto edited = world(e, glazed);
            const Bytes clean = cubes(*edited, nullptr);
            Memo memo = kept;
            EXPECT_EQ(cubes(*edited, &memo), clean) << e.name;
            EXPECT_EQ(cubes(*edited, &chain), clean) << e.name << ", after those before";
            if (std::string(e.name) == "nothing") {
                EXPECT_EQ(memo.found(), all);
                for (const Memo::Table& t : memo.tables()) EXPECT_FALSE(t.changed);
            }
        }
    }
}

// What rays were added up to is taken over where nothing that they read has changed, and made anew where something has: also when the light of before is back.
TEST(FieldBaked, SumsAreTakenOverWhereNothingTheyReadHasChanged) {
    const auto world = [](const char* there) {
        test::WorldBuilder w;
        const MaterialId wall = w.material("wall", 0, {0.5f, 0.4f, 0.3f});
        w.room({0, 0, 0}, {192, 192, 128}, 16, wall), w.room({400, 0, 0}, {592, 192, 128}, 16, wall);
        w.point_entity("info_player_start", {40, 40, 40}), w.point_entity("info_player_start", {440, 40, 40});
        w.point_entity("light", {60, 60, 100}, {{"_light", "255 255 255 100"}}), w.point_entity("light", {460, 60, 100}, {{"_light", there}});
        return bake(w);
    };
    const Vec3 here{130, 100, 30}, beside_a_wall{4, 100, 30}, there{530, 100, 30};
    Memo memo;
    const auto sums = [&](const Baked& b, Memo* kept, std::array<int, 3>& made) {
        if (kept) kept->begin();
        const KeptRest rest(*b.field, kept);
        std::array<Rgbd, 3> out;
        for (std::size_t i = 0; i < out.size(); ++i)
            out[i] = rest.sum<Rgbd>(std::array{here, beside_a_wall, there}[i], {}, 64, 5, 0, [&](const KeptRest::Arrivals& arrivals) {
                Rgbd sum;
                const auto add = [&](Vec3, Rgbd weight) { sum += weight; };
                arrivals(add, add);
                return ++made[i], sum;
            });
        if (kept) kept->end();
        return out;
    };
    const auto first = world("255 255 255 100"), second = world("255 255 255 300");
    struct Run {
        const Baked& baked;
        bool first, edited;
    };
    for (const Run& run : {Run{*first, true, false}, Run{*first, false, false}, Run{*second, false, true}, Run{*second, false, false}, Run{*first, false, true}, Run{*second, false, true}}) {
        std::array<int, 3> made{}, all{};
        const auto kept = sums(run.baked, &memo, made);
        EXPECT_EQ(kept, sums(run.baked, nullptr, all));
        EXPECT_EQ(all, (std::array{1, 1, 1}));
        EXPECT_EQ(made[0], int{run.first});
        if (!run.edited) { EXPECT_EQ(made[1], int{run.first}); } // beside a wall any lamp may count whose light would come so far
        EXPECT_EQ(made[2], int{run.first || run.edited});
        EXPECT_GT(max_component(kept[2]), 0);
        memo = from_bytes<Memo>(to_bytes(memo));
    }
}

} // namespace
} // namespace kiln

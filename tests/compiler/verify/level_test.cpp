// A level that holds together passes; one column changed, and the check that is about it says so.
#include "compiler/verify/verify.h"
#include "formats/level/level_writer.h"
#include "tests/formats/level/forge.h"
#include "tests/formats/level/sample_level.h"
#include <barrier>
#include <functional>
#include <random>
#include <thread>

namespace kiln {
namespace {

using level::LevelContent;

// The room of the loader's tests with brushes for its walls, two clusters and the portal between them.
LevelContent room() {
    LevelContent c = level::test::constant_room({0.5f, 0.5f, 0.5f});
    std::vector<std::uint32_t> outer; // planes at +-144, facing out
    for (std::size_t axis = 0; axis < 3; ++axis)
        for (const int sign : {1, -1}) outer.push_back(level::test::add_axial_plane(c, axis, sign * 144) + (sign > 0 ? 0u : 1u));
    for (std::uint32_t w = 0; w < 6; ++w) {
        level::Brush b;
        b.contents = 1;
        b.planes = outer;
        b.planes.push_back(c.faces[w].plane); // the wall is behind the face
        c.brushes.push_back(b);
    }
    for (std::size_t i = 1; i < 7; ++i) {
        c.leaves[i].brushes = {0, 1, 2, 3, 4, 5};
        c.leaves[i].lo = {-144, -144, -144}, c.leaves[i].hi = {144, 144, 144};
    }
    // The air is divided at x = 0: leaf 0 in front, leaf 7 behind.
    const std::uint32_t middle = level::test::add_axial_plane(c, 0, 0);
    c.nodes[5].child[0] = 6;
    c.nodes.push_back({middle, {-1, -8}, {-128, -128, -128}, {128, 128, 128}});
    c.leaves.push_back(c.leaves[0]);
    c.leaves[7].cluster = 1;
    c.leaves[0].lo[0] = 0, c.leaves[7].hi[0] = 0;
    c.leaves[0].faces = {0, 2, 3, 4, 5}, c.leaves[7].faces = {1, 2, 3, 4, 5}; // faces 0 and 1: x = 128, x = -128
    c.portals.push_back({{0, 7}, middle, {{0, -128, -128}, {0, 128, -128}, {0, 128, 128}, {0, -128, 128}}});
    c.cluster_count = 2, c.vis_rows = {3, 3};
    level::LocalLight light;
    light.intensity = {1, 1, 1};
    c.lights.push_back(light);
    std::array<std::array<level::Float3, 6>, 8> corners{};
    level::test::add_air(c, corners);
    level::test::add_probe(c, 8, 2, [](std::uint32_t, int, double, double) { return level::Float3{1, 1, 1}; });
    return c;
}

std::string text_of(const Checker& checker) {
    std::string text;
    for (const Check& c : checker.checks())
        for (const Finding& f : c.findings) text += c.code + ": " + f.message + "\n";
    return text;
}
std::uint64_t failed(const Checker& checker, std::string_view code) {
    for (const Check& c : checker.checks())
        if (c.code == code) return c.failed;
    ADD_FAILURE() << "no check " << code << "\n" << text_of(checker);
    return 0;
}
Checker verify(const std::vector<std::uint8_t>& bytes) {
    Checker checker = Checker::collecting(5);
    verify_level(bytes, "room.kiln", {.points = 2000, .seed = 1}, checker);
    return checker;
}

TEST(VerifyLevel, ACleanLevelPassesEveryCheckAndEveryCheckLooksAtSomething) {
    for (const bool strip : {false, true}) {
        const Checker checker = verify(level::write_level(room(), {.strip = strip}));
        EXPECT_EQ(checker.failures(), 0u) << text_of(checker);
        for (const Check& c : checker.checks()) EXPECT_GT(c.checked, 0u) << c.code;
    }
}

TEST(VerifyLevel, AnyByteChangedIsSeen) {
    const std::vector<std::uint8_t> good = level::write_level(room());
    for (std::size_t i = 0; i < good.size(); i += 97) {
        std::vector<std::uint8_t> bad = good;
        bad[i] ^= 0x10;
        const Checker checker = verify(bad);
        EXPECT_TRUE(checker.failures() > 0 || good[i] == 0) << i; // between lumps lie zeros that nothing stands for
    }
    EXPECT_GT(verify({}).failures(), 0u);
    EXPECT_GT(verify({'K', 'I', 'L', 'N'}).failures(), 0u);
}

struct Mutation {
    const char* name;
    const char* code;
    std::function<void(LevelContent&)> change;
};
void PrintTo(const Mutation& m, std::ostream* out) { *out << m.name; }
class LevelMutations : public ::testing::TestWithParam<Mutation> {};

TEST_P(LevelMutations, AreSeenByTheCheckThatIsAboutThem) {
    LevelContent c = room();
    GetParam().change(c);
    const Checker checker = verify(level::write_level(c));
    EXPECT_GT(failed(checker, GetParam().code), 0u) << text_of(checker);
}

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
const Mutation kMutations[] = {
    {"PlaneNotUnit", "level-planes", [](LevelContent& c) { c.planes[0].normal = {2, 0, 0}, c.planes[1].normal = {-2, 0, 0}; }},
    {"PlaneNotItsIntegers", "level-planes", [](LevelContent& c) { c.planes[0].distance += 1, c.planes[1].distance -= 1; }},
    {"LeafReachedTwice", "level-tree", [](LevelContent& c) { c.nodes[6].child[1] = -1; }},
    {"NodeBoundsGrow", "level-tree", [](LevelContent& c) { c.nodes[3].hi = {500, 500, 500}; }},
    {"SolidWithCluster", "level-leaves", [](LevelContent& c) { c.leaves[3].cluster = 0; }},
    {"LeafListsAFarFace", "level-leaves", [](LevelContent& c) { c.leaves[7].faces = {0, 1, 2, 3, 4, 5}; }},
    {"FaceInNoLeaf", "level-leaves", [](LevelContent& c) { c.leaves[0].faces = {2, 3, 4, 5}; }},
    {"PortalTurned", "level-portals", [](LevelContent& c) { std::ranges::reverse(c.portals[0].winding); }},
    {"PortalOffItsPlane", "level-portals", [](LevelContent& c) { c.portals[0].winding[1][0] = 1; }},
    {"PortalBeyondItsLeaf", "level-portals", [](LevelContent& c) { c.portals[0].winding[1][1] = 140; }},
    {"VisOneSided", "level-vis", [](LevelContent& c) { c.vis_rows = {3, 2}; }},
    {"VisBlind", "level-vis", [](LevelContent& c) { c.vis_rows = {1, 2}; }},
    {"LeafContents", "level-points", [](LevelContent& c) { c.leaves[2].contents = 0; }},
    {"LeafForgetsABrush", "level-points", [](LevelContent& c) { c.leaves[1].brushes = {1, 2, 3, 4, 5}; }},
    {"FaceTurned", "level-faces", [](LevelContent& c) { for (float& x : c.faces[0].normal) x = -x; }},
    {"TangentSkew", "level-faces", [](LevelContent& c) { c.faces[0].tangent = c.faces[0].normal; }},
    {"CornerOffItsFace", "level-mesh", [](LevelContent& c) { c.positions[0][0] += 3; }},
    {"TriangleTurned", "level-mesh", [](LevelContent& c) { std::swap(c.triangles[0][0], c.triangles[0][1]); }},
    {"MaterialWithoutSense", "level-materials", [](LevelContent& c) { c.materials[0].reflectance = {1.5f, 0, 0}; }},
    {"ChartSkew", "level-charts", [](LevelContent& c) { c.charts[0].t = c.charts[0].s; }},
    {"ChartElsewhere", "level-charts", [](LevelContent& c) { for (double& x : c.charts[2].origin) x += 64; }},
    {"LightNowhere", "level-lights", [](LevelContent& c) { c.lights[0].position[0] = std::numeric_limits<double>::infinity(); }},
    {"CubeNowhere", "level-cubes", [](LevelContent& c) { c.cubes.cubes[0].position[0] = kNan; }},
    {"CellWithoutSize", "level-cubes", [](LevelContent& c) { c.cubes.cells[0].size = 0; }},
    {"ProbeOutOfItsBox", "level-probes", [](LevelContent& c) { c.probes[0].boxed = true, c.probes[0].box_lo = {1, 1, 1}, c.probes[0].box_hi = {2, 2, 2}; }},
    {"ModelOfNoEntity", "level-entities", [](LevelContent& c) { c.model_count = 2; }},
};
INSTANTIATE_TEST_SUITE_P(OneAtATime, LevelMutations, ::testing::ValuesIn(kMutations), [](const auto& test) { return std::string(test.param.name); });

// All ways to trace, by several threads at a time from the first use of the level on, say what one alone says.
TEST(VerifyLevel, TracesOfSeveralThreadsAreThoseOfOne) {
    LevelContent c = room();
    c.model_count = 2;
    level::test::add_brush(c), level::test::add_brush(c, 1, 1); // 32 wide, with a bevel; a model of the same shape
    level::Displacement d;
    d.base = {level::Double3{-64, -64, 0}, {64, -64, 0}, {64, 64, 0}, {-64, 64, 0}};
    for (int i = 0; i < 25; ++i)
        d.positions.push_back({32.f * static_cast<float>(i % 5) - 64, 32.f * static_cast<float>(i / 5) - 64, i % 2 ? 40.f : 24.f}), d.alphas.push_back(0);
    d.triangle_tags.assign(32, 9);
    level::CurvedPatch p;
    p.columns = p.rows = 3;
    for (int i = 0; i < 9; ++i) p.positions.push_back({32.f * static_cast<float>(i % 3), 32.f * static_cast<float>(i / 3), i == 4 ? -40.f : -64.f}), p.uv.push_back({0, 0});
    c.displacements = {d}, c.patches = {p};
    const std::vector<std::uint8_t> bytes = level::write_level(c);

    struct Answer {
        std::vector<double> numbers;
        bool operator==(const Answer&) const = default;
    };
    constexpr int rounds = 400;
    const auto trace_all = [](const kiln_level* l, int first) { // all questions, from the `first` on around
        std::vector<Answer> answers(rounds);
        for (int k = 0; k < rounds; ++k) {
            const int i = (first + k) % rounds;
            std::mt19937_64 random(static_cast<unsigned>(i));
            const auto number = [&](double most) { return most * (static_cast<double>(random() >> 11) / 4503599627370496.0 - 1); };
            const double size = i % 3 == 0 ? 0 : 1 + i % 7, mins[3] = {-size, -size, -size}, maxs[3] = {size, size, size};
            const double start[3] = {number(120), number(120), number(120)}, end[3] = {number(120), number(120), number(120)}, origin[3] = {number(40), number(40), 0};
            kiln_pose pose{{0, 0, 0}, {number(40), 0, 0}, {}};
            const double angles[3] = {number(90), number(180), 0};
            kiln_turn_from_angles(angles, pose.turn);
            kiln_trace t[3] = {};
            const kiln_status told[3] = {kiln_trace_box(l, start, end, mins, maxs, KILN_MASK_PLAYERS, &t[0]), kiln_trace_model(l, 1, origin, start, end, mins, maxs, KILN_MASK_PLAYERS, &t[1]),
                                         kiln_trace_posed_model(l, 1, &pose, start, end, mins, maxs, KILN_MASK_PLAYERS, &t[2])};
            std::vector<double>& n = answers[static_cast<std::size_t>(i)].numbers;
            for (int way = 0; way < 3; ++way) {
                const kiln_trace& x = t[way];
                n.insert(n.end(), {static_cast<double>(told[way]), x.fraction, x.end[0], x.end[1], x.end[2], x.normal[0], x.normal[1], x.normal[2], x.distance});
                for (const std::uint32_t v : {x.contents, x.brush, x.side, x.start_solid, x.all_solid, x.displacement, x.patch, x.triangle, x.tag}) n.push_back(v);
            }
            std::uint32_t contents = 0;
            n.push_back(kiln_point_contents(l, start, &contents)), n.push_back(contents);
        }
        return answers;
    };
    const auto open = [&] {
        kiln_level* l = nullptr;
        EXPECT_EQ(kiln_level_open_memory(bytes.data(), bytes.size(), &l), KILN_OK);
        return std::unique_ptr<kiln_level, decltype(&kiln_level_close)>(l, kiln_level_close);
    };
    const auto alone = open();
    const std::vector<Answer> expected = trace_all(alone.get(), 0);
    std::size_t brushes = 0, sheets = 0, curves = 0, models = 0, free = 0;
    for (const Answer& a : expected) {
        for (const int way : {0, 18, 36}) ASSERT_EQ(a.numbers[static_cast<std::size_t>(way)], KILN_OK);
        brushes += a.numbers[10] != KILN_NO_INDEX, sheets += a.numbers[14] != KILN_NO_INDEX, curves += a.numbers[15] != KILN_NO_INDEX, models += a.numbers[36 + 10] != KILN_NO_INDEX;
        free += a.numbers[1] == 1;
    }
    for (const std::size_t met : {brushes, sheets, curves, models, free}) EXPECT_GT(met, 10u); // each kind of thing is met
    for (int round = 0; round < 3; ++round) {
        const auto shared = open(); // what is decoded at first use is decoded under them
        constexpr int count = 4;
        std::array<std::vector<Answer>, count> found;
        std::barrier together(count);
        {
            std::vector<std::jthread> threads;
            for (int t = 0; t < count; ++t)
                threads.emplace_back([&, t] {
                    together.arrive_and_wait();
                    found[static_cast<std::size_t>(t)] = trace_all(shared.get(), t * rounds / count);
                });
        }
        for (const auto& f : found) EXPECT_TRUE(f == expected);
    }
}

TEST(VerifyLevel, NegativeIrradianceIsSeen) { // which halfs can hold
    LevelContent c = room();
    c.flat[40] = {-1, 0, 0};
    const Checker checker = verify(level::write_level(c, {.rgb9e5 = false}));
    EXPECT_EQ(failed(checker, "level-texels"), 1u) << text_of(checker);
}

TEST(VerifyLevel, ChartsThatOverlapAreSeen) {
    const LevelContent content = room();
    level::test::Forge forge(level::write_level(content, {.share_texels = false}));
    const std::size_t n = content.charts.size();
    // Columns before page_x: 9 doubles, luxel size, width, height, directional, smooth, page.
    auto& bytes = forge["CHRT"].bytes;
    std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(n * (9 * 8 + 6 * 4)), n * 8, 0); // page_x and page_y
    EXPECT_EQ(failed(verify(forge.bytes()), "level-charts-apart"), 0u); // all of one size, on one place: they share it
    bytes[n * (9 * 8 + 6 * 4) + 1] = 1; // the second one a texel aside
    const Checker checker = verify(forge.bytes());
    EXPECT_GT(failed(checker, "level-charts-apart"), 0u) << text_of(checker);
}

} // namespace
} // namespace kiln

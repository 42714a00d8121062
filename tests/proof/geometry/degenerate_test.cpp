// Input at the edge of what is a map, as text: what the compiler answers (exit code, diagnostic, line) and what is left of
// the geometry. Each row is a room with one oddity in it; where the odd brush is left out, all else is as if it had never
// been there, exactly.
#include "tests/proof/geometry/laws.h"
#include "tests/proof/geometry/pipeline.h"
#include "tests/proof/geometry/scenes.h"
#include "tests/proof/geometry/shape.h"
#include "tests/support/program.h"
#include <chrono>
#include <gmock/gmock.h>

namespace kiln::proof {
namespace {

using test::box;
using test::entity;

std::string room() { return test::room(256, 256, 128); }
std::string map_with(const std::string& brushes) {
    return test::world(room() + brushes) + entity("info_player_start", 32, 32, 24) + entity("light", 200, 200, 100);
}
std::vector<std::string> rows_of(const std::string& brush) { // the rows between the braces
    std::vector<std::string> rows;
    std::istringstream in(brush);
    for (std::string row; std::getline(in, row);)
        if (row[0] == '(') rows.push_back(row + "\n");
    return rows;
}
std::string brush_of(const std::vector<std::string>& rows) {
    std::string text = "{\n";
    for (const std::string& r : rows) text += r;
    return text + "}\n";
}
std::vector<std::string> block() { return rows_of(box(64, 64, 0, 128, 128, 64)); }

int exit_code(const Geometry& g) {
    if (g.fault) return static_cast<int>(g.fault->exit);
    return g.leak ? static_cast<int>(Exit::geometry) : 0;
}
// The program itself says the same.
void expect_program_says(const std::string& text, int code, const std::string& diagnostic) {
    const test::Workplace w;
    const test::Outcome o =
        w.run({"build", w.write("odd.map", text), "-o", w.path("odd.kiln"), "--stop-after", "surfaces", "--threads", "1"});
    EXPECT_EQ(o.code, code) << o.said;
    EXPECT_THAT(o.said, testing::HasSubstr("[" + diagnostic + "]"));
}
std::optional<std::uint64_t> any(const Fragment& f) { return static_cast<std::uint64_t>(f.behind); }
Form seen(const Geometry& g) { return form_of(g.csg, g.bsp, {}, any); }

// The odd brush is named and left out; the rest is the plain room.
struct LeftOut {
    const char* name;
    std::string brush;
    const char* code;
};
void PrintTo(const LeftOut& c, std::ostream* out) { *out << c.name; }

std::vector<LeftOut> left_out() {
    std::vector<std::string> three = block(), five = block(), line = block(), flat = block(), open_line = block(), nan = block();
    three.resize(3);
    five.resize(5);
    line[2] = "( 0 0 0 ) ( 1 1 1 ) ( 2 2 2 ) wall 0 0 0 1 1\n";
    open_line.resize(4);
    open_line[2] = line[2];
    flat[5] = "( 64 64 0 ) ( 64 65 0 ) ( 65 64 0 ) wall 0 0 0 1 1\n"; // the floor of the block, facing up
    const std::vector<std::string> sheet{"( 64 64 0 ) ( 65 64 0 ) ( 64 65 0 ) wall 0 0 0 1 1\n", flat[5],
                                         "( 0 0 0 ) ( 0 0 0 ) ( 0 0 0 ) wall 0 0 0 1 1\n",
                                         "( 0 0 0 ) ( 0 0 0 ) ( 0 0 0 ) wall 0 0 0 1 1\n"};
    nan[1].replace(2, nan[1].find(' ', 2) - 2, "nan");
    return {{"ThreePlanes", brush_of(three), "brush-unbounded"},
            {"FivePlanes", brush_of(five), "brush-unbounded"},
            {"CollinearPoints", brush_of(line), "plane-collinear"},
            {"CollinearAndUnbounded", brush_of(open_line), "plane-collinear"},
            {"ZeroThickness", brush_of(flat), "brush-empty"},
            {"TwoPlanesAndTwoNullPlanes", brush_of(sheet), "plane-collinear"},
            {"InsideOut", box(128, 128, 64, 64, 64, 0), "brush-empty"},
            {"NotANumber", brush_of(nan), "coordinate-not-a-number"},
            {"ABillionUnits", box(-1e9, -1e9, -1e9 - 64, 1e9, 1e9, -1e9), "coordinate-out-of-range"}};
}

class LeavesOut : public testing::TestWithParam<LeftOut> {};
TEST_P(LeavesOut, TheBrushAndNothingElse) {
    const std::string text = map_with(GetParam().brush);
    const Geometry plain = run_text(map_with(""), "odd.map"), odd = run_text(text, "odd.map");
    ASSERT_FALSE(odd.fault);
    EXPECT_EQ(exit_code(odd), 0);
    const Diagnostic* d = odd.first(GetParam().code);
    ASSERT_TRUE(d);
    EXPECT_EQ(d->severity, Severity::error);
    EXPECT_EQ(d->where.brush, 6);
    EXPECT_GE(d->where.line, 51); // where the seventh brush begins
    EXPECT_LE(d->where.line, 58);
    EXPECT_TRUE(seen(plain) == seen(odd));
    EXPECT_EQ(inside_volumes(plain.bsp), inside_volumes(odd.bsp));
    expect_program_says(text, 0, GetParam().code);
}
INSTANTIATE_TEST_SUITE_P(Degenerate, LeavesOut, testing::ValuesIn(left_out()), [](const auto& c) { return c.param.name; });

// No map at all, or none that can be built: nothing is written.
TEST(Degenerate, FilesThatAreNoMap) {
    const std::string whole = map_with("");
    std::string garbage(4096, '\0');
    for (std::size_t i = 0; i < garbage.size(); ++i) garbage[i] = static_cast<char>(i * 2654435761u >> 11);
    struct Row {
        std::string text;
        int code;
        const char* diagnostic;
    };
    for (const Row& r : {Row{"", 3, "empty-file"}, Row{garbage, 3, "not-text"}, Row{whole.substr(0, whole.size() / 2), 3, "unbalanced-braces"},
                         Row{whole.substr(0, whole.size() - 2), 3, "unbalanced-braces"},
                         Row{test::world("") + entity("light", 0, 0, 0), 4, "no-world-brushes"},
                         Row{test::world(brush_of({block()[0], block()[1], block()[2]})), 4, "nothing-to-compile"}}) {
        SCOPED_TRACE(r.diagnostic);
        const Geometry g = run_text(r.text, "odd.map");
        ASSERT_TRUE(g.fault);
        EXPECT_EQ(exit_code(g), r.code);
        EXPECT_TRUE(g.fault->diagnostic.code == r.diagnostic || g.count(r.diagnostic)) << to_text(g.fault->diagnostic);
        expect_program_says(r.text, r.code, r.diagnostic);
    }
}

// Odd but sound: the brush is there, whole.
TEST(Degenerate, BrushesThatStay) {
    struct Row {
        const char* name;
        std::string brush;
        const char* code; // a warning or note; "" none
        double added;     // to the visible area of the room
    };
    std::vector<std::string> twice = block();
    twice.push_back(twice[1]);
    std::string zero_scale = box(64, 64, 0, 128, 128, 64), missing = box(64, 64, 0, 128, 128, 64, "no/such/texture");
    for (std::size_t at; (at = zero_scale.find("0 0 0 1 1")) != std::string::npos;) zero_scale.replace(at, 9, "0 0 0 0 0");
    const double faces = 4 * 64 * 64; // the four sides: the top makes up for the floor under it
    for (const Row& r :
         {Row{"duplicate plane", brush_of(twice), "plane-duplicate", faces}, Row{"zero scale", zero_scale, "texture-scale-zero", faces},
          Row{"missing texture", missing, "material-unknown", faces},
          // Two sides 64 x 64 and two ends, 0.001 wide (0.0009765625 on the grid).
          Row{"sliver", box(64, 64, 0, 64.001, 128, 64), "", 2 * 64 * 64 + 2 * 64 * 0.001},
          Row{"0.001 above the floor", box(64, 64, 0.0625, 128, 128, 64), "", 4 * 64 * 63.9375 + 2 * 64 * 64}}) {
        SCOPED_TRACE(r.name);
        const Geometry plain = run_text(map_with(""), "odd.map"), odd = run_text(map_with(r.brush), "odd.map");
        ASSERT_FALSE(odd.fault);
        EXPECT_EQ(exit_code(odd), 0);
        EXPECT_EQ(odd.csg.report.invalid_brushes, 0u);
        EXPECT_TRUE(!*r.code || odd.count(r.code) > 0) << r.code;
        double area = 0;
        for (const auto& [g, sign] : {std::pair(&plain, -1), std::pair(&odd, 1)})
            for (const VisibleFragment& v : g->bsp.visible) area += sign * polygon_area(points(g->bsp.planes, v.polygon));
        EXPECT_NEAR(area, r.added, 0.02);
        EXPECT_EQ(unmatched_hull_edges(odd.surfaces), 0u);
    }
}

TEST(Degenerate, KeysOf300Characters) {
    std::string text = map_with("");
    text.insert(text.find('\n') + 1, "\"" + std::string(300, 'k') + "\" \"" + std::string(300, 'v') + "\"\n");
    const Geometry g = run_text(text, "odd.map");
    EXPECT_EQ(exit_code(g), 0);
    EXPECT_EQ(g.world.entities[0].get(std::string(300, 'k')), std::string(300, 'v'));
}

TEST(Degenerate, ALeakIsFour) {
    std::string brushes = room();
    brushes.erase(brushes.rfind("{\n"));
    const std::string text = test::world(brushes) + entity("light", 32, 32, 24);
    const Geometry g = run_text(text, "odd.map");
    ASSERT_TRUE(g.leak);
    EXPECT_NEAR(g.leak->hole.y, 256, 16);
    expect_program_says(text, 4, "leak");
}

TEST(Degenerate, TheOnlyEntityAtZero) {
    const std::string hull = box(-80, -80, -80, 80, 80, -64) + box(-80, -80, 64, 80, 80, 80) + box(-80, -80, -64, -64, 80, 64) +
                             box(64, -80, -64, 80, 80, 64) + box(-64, -80, -64, 64, -64, 64) + box(-64, 64, -64, 64, 80, 64);
    const Geometry g = run_text(test::world(hull) + entity("info_player_start", 0, 0, 0), "odd.map");
    EXPECT_EQ(exit_code(g), 0);
    EXPECT_EQ(g.count("no-entity-inside"), 0u);
    EXPECT_EQ(g.bsp.cluster_count, 1u);
    EXPECT_EQ(g.surfaces.faces.size(), 6u);
}

// Sixty overlapping boxes off the grid: an exact union, quickly (8 s for others; 0.03 here).
TEST(Degenerate, SixtyOverlappingBoxes) {
    Dice dice(1);
    std::string brushes;
    for (int i = 0; i < 60; ++i) {
        const Vec3 p = dice.point(100), s{dice.uniform(20, 150), dice.uniform(20, 150), dice.uniform(20, 150)};
        brushes += box(p.x + dice.uniform(0, 1), p.y + dice.uniform(0, 1), p.z + dice.uniform(0, 1), p.x + s.x, p.y + s.y, p.z + s.z);
    }
    const std::clock_t start = std::clock();
    const Geometry g = run_text(test::world(brushes), "odd.map");
    const double cpu_s = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    ASSERT_FALSE(g.fault);
    EXPECT_EQ(g.csg.report.invalid_brushes, 0u);
    for (const Findings& f : {closure(g.world, g.csg), volumes(g.csg, g.bsp), points_in_leaves(g.world, g.csg, g.bsp, 5000, 1)})
        EXPECT_TRUE(f.ok()) << f;
    EXPECT_LT(cpu_s, 2.0); // ten times what is measured: guards the order of magnitude alone
}

// ---- planes that are almost one, many sides, the rim of the world ----

// A tile whose top is 1e-7 from parallel to the one beside it, and tops 1e-7 apart: they become one, nothing is lost.
TEST(Numbers, PlanesTenMillionthsApart) {
    WorldBuilder w;
    w.box({0, 0, 0}, {64, 64, 16});
    w.box({64, 0, 0}, {128, 64, 16 + 1e-7});
    auto sides = WorldBuilder::box_sides({128, 0, 0}, {192, 64, 16});
    sides[5] = {Vec3{128, 0, 16}, {128, 64, 16}, {192, 0, 16 + 64e-7}};
    w.brush(sides);
    RunOptions options;
    options.bsp.fill = false;
    const Geometry g = run(w.world, options);
    ASSERT_FALSE(g.fault);
    EXPECT_EQ(g.csg.report.invalid_brushes, 0u);
    for (const BrushPolytope& b : g.csg.brushes) EXPECT_EQ(b.bounds.hi.z, 16);
    EXPECT_EQ(g.csg.fragments.size(), 14u);
    EXPECT_LT(g.csg.report.largest_rounding, 1e-5);
}
// On the grid nothing is rounded: two steps of 2^-10 side by side on a slope of 1e-7 stay two planes without merging.
TEST(Numbers, PlanesOfAlmostOneSlopeStayTwoWithoutMerging) {
    WorldBuilder w;
    for (const double h : {0.0, 0x1p-10}) {
        auto sides = WorldBuilder::box_sides({-8192, h == 0 ? 0.0 : 64.0, 0}, {8192, h == 0 ? 64.0 : 128.0, 16});
        sides[5] = {Vec3{-8192, 0, 16}, {-8192, 64, 16}, {8192, 0, 16 + h}};
        w.brush(sides);
    }
    RunOptions options;
    options.bsp.fill = false, options.csg.plane_merge_distance = 0;
    const Geometry g = run(w.world, options);
    ASSERT_FALSE(g.fault);
    EXPECT_DOUBLE_EQ(g.csg.brushes[1].bounds.hi.z, 16 + 0x1p-10);
    EXPECT_EQ(g.csg.brushes[0].bounds.hi.z, 16);
    // The step between them is a triangle that ends in a point: the face of the higher, as long and as thin as it is.
    EXPECT_EQ(slivers(g.csg, 0x1p-9).count, 1u);
    for (const Findings& f : {closure(g.world, g.csg), volumes(g.csg, g.bsp), portals(g.csg, g.bsp), brush_lists(g.world, g.csg, g.bsp)})
        EXPECT_TRUE(f.ok()) << f;
}

TEST(Numbers, ManySidedBrushes) {
    for (const int n : {64, 144})
        for (const double far : {0.0, 131072.0 - 1024}) {
            WorldBuilder w;
            std::vector<Vec2> ring;
            for (int i = 0; i < n; ++i) {
                const double t = 2 * std::numbers::pi * (i + 0.3) / n;
                ring.push_back({far + std::round(std::cos(t) * 1e6) / 1e3, std::round(std::sin(t) * 1e6) / 1e3});
            }
            w.prism(ring, 0, 256);
            w.room({far - 1020, -1020, 0}, {far + 1008, 1020, 256});
            w.point_entity("light", {far - 1015, -1015, 128});
            const Geometry g = run(with_large_luxels(w.world));
            ASSERT_FALSE(g.fault);
            EXPECT_FALSE(g.leak);
            EXPECT_EQ(g.csg.brushes[0].faces.size(), static_cast<std::size_t>(n + 2));
            std::size_t flanks = 0;
            for (const Face& f : g.surfaces.faces) flanks += std::abs(f.normal.z) < 0.5 && f.side.at() < static_cast<std::size_t>(n + 2);
            EXPECT_EQ(flanks, static_cast<std::size_t>(n)); // one face each
            EXPECT_EQ(unmatched_hull_edges(g.surfaces), 0u);
            EXPECT_TRUE(volumes(g.csg, g.bsp).ok());
        }
}

TEST(Numbers, TheRimOfTheWorld) {
    WorldBuilder w;
    const double l = 131072; // readers take no more
    w.box({-l, -l, -l}, {l, l, -l + 16});
    w.box({-l, -l, l - 16}, {l, l, l});
    w.box({-l, -l, -l + 16}, {-l + 16, l, l - 16});
    w.box({l - 16, -l, -l + 16}, {l, l, l - 16});
    w.box({-l + 16, -l, -l + 16}, {l - 16, -l + 16, l - 16});
    w.box({-l + 16, l - 16, -l + 16}, {l - 16, l, l - 16});
    w.tetrahedron({Vec3{l - 16, l - 16, -l + 16}, {l - 116 + 0x1p-10, l - 16, -l + 16}, {l - 16, l - 116, -l + 16}, {l - 16, l - 16, -l + 116}});
    w.point_entity("light", {0, 0, 0});
    const Geometry g = run(with_large_luxels(w.world));
    ASSERT_FALSE(g.fault);
    EXPECT_FALSE(g.leak);
    EXPECT_EQ(g.csg.report.invalid_brushes, 0u);
    EXPECT_EQ(g.csg.report.rounded_sides, 0u);
    EXPECT_EQ(unmatched_hull_edges(g.surfaces), 0u);
    for (const Findings& f : {closure(g.world, g.csg), volumes(g.csg, g.bsp), points_in_leaves(g.world, g.csg, g.bsp, 2000, 1)})
        EXPECT_TRUE(f.ok()) << f;
}

// ---- the precision classes of another compiler's regression maps ----

Geometry other_map(const char* name) {
    const auto path = shared_map(name);
    if (!path) return {};
    Context context;
    auto world = load_world(*path, context);
    return world ? run(*world) : Geometry{};
}
#define SKIP_WITHOUT(g, name) \
    if ((g).stage.empty()) GTEST_SKIP() << name << " is not here"

// What holds of each: nothing invalid, nothing moved, sealed without help, a closed hull, every law.
void expect_sound(const Geometry& g) {
    ASSERT_FALSE(g.fault);
    EXPECT_FALSE(g.leak);
    EXPECT_EQ(g.csg.report.invalid_brushes, 0u);
    EXPECT_EQ(g.csg.report.merged_planes, 0u);
    EXPECT_EQ(g.csg.report.rounded_sides, 0u);
    EXPECT_EQ(g.count("micro-gap"), 0u);
    EXPECT_EQ(unmatched_hull_edges(g.surfaces), 0u);
    for (const Findings& f : {closure(g.world, g.csg), volumes(g.csg, g.bsp), points_in_leaves(g.world, g.csg, g.bsp, 2000, 1)})
        EXPECT_TRUE(f.ok()) << f;
}
double face_area(const Geometry& g, std::uint32_t side) {
    double area = 0;
    for (const Face& f : g.surfaces.faces)
        if (f.side.value == side) area += f.area;
    return area;
}

TEST(Precision, BaseWinding) { // planes at many angles: the first polygon of a plane is as exact as the last
    const Geometry g = other_map("netradiant-regression/base_winding.map");
    SKIP_WITHOUT(g, "base_winding");
    expect_sound(g);
    for (const BrushPolytope& b : g.csg.brushes)
        for (const PlanePolygon& f : b.faces)
            for (const Vec3& p : points(g.csg.planes, f))
                EXPECT_LT(std::abs(dot(g.csg.planes.normal(f.support), p) - g.csg.planes.distance(f.support)), 1e-10);
}

TEST(Precision, CoarseSnapNormal) { // bricks a quarter degree off the axes: not snapped, and touching
    const Geometry g = other_map("netradiant-regression/coarse_snap_normal.map");
    SKIP_WITHOUT(g, "coarse_snap_normal");
    expect_sound(g);
    std::size_t almost_axial = 0;
    for (const BrushPolytope& b : g.csg.brushes)
        for (const PlanePolygon& f : b.faces) {
            const Vec3 n = g.csg.planes.normal(f.support);
            const double most = std::max({std::abs(n.x), std::abs(n.y), std::abs(n.z)});
            almost_axial += most < 1 && most > std::cos(0.3 * std::numbers::pi / 180);
        }
    EXPECT_GT(almost_axial, 0u);
    EXPECT_GT(thinnest_leaf(g.bsp), 0.25);
}
// Drawn for this test: two bricks that touch in a plane a quarter degree off the axis.
TEST(Precision, BricksAQuarterDegreeOffTheAxis) {
    WorldBuilder w;
    const auto brick = [&](double y0, double y1) { // planes y = y0 + x / 256, y = y1 + x / 256
        auto s = WorldBuilder::box_sides({0, y0, 0}, {256, y1, 64});
        s[2] = {Vec3{0, y0, 0}, {0, y0, 64}, {256, y0 + 1, 0}};
        s[3] = {Vec3{0, y1, 0}, {256, y1 + 1, 0}, {0, y1, 64}};
        w.brush(s);
    };
    brick(0, 32), brick(32, 64);
    RunOptions options;
    options.bsp.fill = false;
    const Geometry g = run(w.world, options);
    EXPECT_EQ(g.csg.report.merged_planes, 0u);
    EXPECT_EQ(g.csg.fragments.size(), 10u);
    EXPECT_DOUBLE_EQ(g.csg.brushes[1].bounds.hi.y, 65);
}

TEST(Precision, DegenerateWindings) { // edges and tips under a tenth of a unit stay
    const Geometry g = other_map("netradiant-regression/degenerate_winding.map");
    SKIP_WITHOUT(g, "degenerate_winding");
    expect_sound(g);
    const Geometry wedge = other_map("netradiant-regression/degenerate_winding2.map");
    expect_sound(wedge);
    EXPECT_EQ(wedge.csg.brushes[0].faces.size() + wedge.csg.report.redundant_sides, 7u);
    EXPECT_GE(wedge.csg.brushes[0].faces.size(), 5u);
}
// Drawn for this test: a wedge whose tip is cut off 1/64 from its edge by two small planes: all seven sides have area.
TEST(Precision, AWedgeWithATipCutOff) {
    WorldBuilder w;
    const double t = 1.0 / 64;
    const std::vector<SidePoints> sides{
        {Vec3{8, 0, 0}, {8, 0, 8}, {8, 64, 0}},                       // back
        {Vec3{0, 0, 0}, {1, 0, 0}, {0, 1, 0}},                        // bottom
        {Vec3{0, 0, 0}, {0, 64, 0}, {8, 0, 1}},                       // top: z = x / 8
        {Vec3{0, 0, 0}, {0, 0, 8}, {8, 0, 0}},                        // ends
        {Vec3{0, 64, 0}, {8, 64, 0}, {0, 64, 8}},
        {Vec3{t, 0, 0}, {t, 64, 0}, {t + t / 2, 0, t / 8}},           // x >= t at the bottom, sloping in
        {Vec3{2 * t, 0, t / 4}, {t + t / 2, 0, t / 8}, {2 * t, 64, t / 4}}, // redundant or not: through the same tip
    };
    w.brush(sides);
    RunOptions options;
    options.bsp.fill = false;
    const Geometry g = run(w.world, options);
    ASSERT_FALSE(g.fault);
    EXPECT_TRUE(g.csg.brushes[0].valid);
    EXPECT_GE(g.csg.brushes[0].faces.size(), 6u);
    EXPECT_TRUE(closure(g.world, g.csg).ok());
    EXPECT_GE(g.csg.brushes[0].bounds.lo.x, t);
}

TEST(Precision, DisappearingSliver) { // a long thin triangle that must not vanish: side 2 of brush 0, 67 x 130 x 768
    const Geometry g = other_map("netradiant-regression/disappearing_sliver.map");
    SKIP_WITHOUT(g, "disappearing_sliver");
    ASSERT_FALSE(g.fault);
    EXPECT_FALSE(g.leak);
    const Vec3 p{67, -1022, 0}, q{88, -892, -768}, r{134, -1015, 0};
    EXPECT_NEAR(face_area(g, 2), length(cross(q - p, r - p)) / 2, 1e-6);
    EXPECT_EQ(unmatched_hull_edges(g.surfaces), 0u);
}
TEST(Precision, ALongThinTriangleStays) {
    WorldBuilder w;
    w.room({0, -64, -64}, {4096, 64, 64});
    w.tetrahedron({Vec3{16, 0, 0}, {4080, 0, 0.0625}, {16, 0.0625, 0}, {16, 0, -32}});
    w.point_entity("light", {2000, 50, 50});
    const Geometry g = run(w.world);
    ASSERT_FALSE(g.fault);
    double most = 0;
    std::size_t faces = 0;
    for (const Face& f : g.surfaces.faces)
        if (f.side.at() >= 36) ++faces, most = std::max(most, f.area);
    EXPECT_EQ(faces, 4u);
    EXPECT_NEAR(most, 4064 * 32 / 2, 4);
    EXPECT_EQ(unmatched_hull_edges(g.surfaces), 0u);
}

TEST(Precision, DuplicatePlane) { // handled once, and told
    const Geometry g = other_map("netradiant-regression/duplicate_plane.map");
    SKIP_WITHOUT(g, "duplicate_plane");
    expect_sound(g);
    EXPECT_EQ(g.count("plane-duplicate"), 1u);
    EXPECT_EQ(g.csg.brushes[0].faces.size(), 4u);
}

TEST(Precision, PlaneAliasing) { // parallel planes under 0.01 apart: no face is eaten
    const Geometry g = other_map("netradiant-regression/plane_aliasing.map");
    SKIP_WITHOUT(g, "plane_aliasing");
    expect_sound(g);
    for (std::size_t b = 0; b < 2; ++b) EXPECT_EQ(g.csg.brushes[b].faces.size(), g.world.brushes[b].side_count);
}
TEST(Precision, ParallelPlanesFarApartAlongThemselves) {
    // One slope twice, 0.008 apart where the one is continued over the other: two steps 128 units from each other.
    WorldBuilder w;
    for (const double at : {0.0, 256.0}) {
        auto s = WorldBuilder::box_sides({at, 0, 0}, {at + 128, 128, 64});
        const double z = at / 128 + (at > 0 ? 0.0078125 : 0);
        s[5] = {Vec3{at, 0, 60 + z}, {at, 128, 60 + z}, {at + 128, 0, 61 + z}};
        w.brush(s);
    }
    RunOptions options;
    options.bsp.fill = false;
    const Geometry g = run(w.world, options);
    ASSERT_FALSE(g.fault);
    for (const BrushPolytope& b : g.csg.brushes) EXPECT_EQ(b.faces.size(), 6u);
    EXPECT_EQ(g.csg.fragments.size(), 12u);
}

// Two triangles that share an edge share its end points: the same numbers in the same places of the table.
TEST(Precision, SparklySeam) {
    const Geometry g = other_map("netradiant-regression/sparkly_seam.map");
    SKIP_WITHOUT(g, "sparkly_seam");
    ASSERT_FALSE(g.fault);
    EXPECT_FALSE(g.leak);
    const auto corner = [&](Vec3 p) {
        std::size_t count = 0;
        for (const Vec3& q : g.surfaces.positions) count += length(q - p) < 0.25;
        return count;
    };
    EXPECT_EQ(corner({6784, 15936, -1792}), 1u);
    EXPECT_EQ(corner({6144, 15958, -1471}), 1u);
    EXPECT_EQ(g.count("micro-gap"), 0u);
    EXPECT_EQ(unmatched_hull_edges(g.surfaces), 0u);
}

// A brush 0.1 x 0.1 x 8 in a room: as small as it is, it is there. (The map writes brushDef rows.)
TEST(Precision, TinyStructuralBrush) {
    const Geometry read = other_map("netradiant-regression/tiny_structural_brush.map");
    const Geometry drawn =
        run_text(map_with(box(128, 128, 0, 128.1, 128.1, 8)), "tiny.map");
    ASSERT_FALSE(drawn.fault);
    EXPECT_FALSE(drawn.leak);
    EXPECT_EQ(drawn.csg.brushes[6].faces.size(), 6u);
    std::size_t faces = 0;
    for (const Face& f : drawn.surfaces.faces) faces += f.area < 1;
    EXPECT_EQ(faces, 5u); // four flanks and the top; it stands on the floor
    EXPECT_EQ(unmatched_hull_edges(drawn.surfaces), 0u);
    if (!read.stage.empty() && !read.fault) {
        EXPECT_EQ(read.csg.report.invalid_brushes, 0u);
        EXPECT_EQ(read.csg.brushes[0].faces.size(), 6u);
        EXPECT_FALSE(read.leak);
    }
}

} // namespace
} // namespace kiln::proof

#include "compiler/assemble/cordon.h"
#include "compiler/csg/csg.h"
#include "tests/compiler/assemble/files.h"

namespace kiln::test {
namespace {

Document map_with(const std::string& text, std::vector<Box3> boxes, bool active = true) {
    Document d = assembled(text, {});
    for (const Box3& b : boxes) {
        DocCordon c;
        c.line = 5, c.active = active, c.box = b;
        d.cordons.push_back(c);
    }
    return d;
}
Box3 box(Vec3 lo, Vec3 hi) { return {lo, hi}; }

const std::string kMap = vmf_world(vmf_box({-8, -8, -8}, {8, 8, 8}, 1) + vmf_box({100, 0, 0}, {164, 8, 8}, 10) + vmf_box({-200, -200, -200}, {200, 200, -190}, 20)) +
                         vmf_entity("light", {{"origin", "0 0 40"}}) + vmf_entity("light", {{"origin", "150 0 40"}}) + vmf_entity("func_wall", {}, {}, vmf_box({120, 0, 0}, {130, 1, 1}, 30)) +
                         vmf_entity("func_detail", {{"origin", "150 0 0"}}, {}, vmf_box({0, 0, 9}, {1, 1, 10}, 40)) + vmf_entity("logic_auto", {});

TEST(Cordons, LeaveOutWhatIsOutsideAndCloseTheBox) {
    Document d = map_with(kMap, {box({-64, -64, -64}, {64, 64, 64})});
    Context context;
    assemble_detail::cut_to_cordons(d, context);
    // The box in the middle and six walls; the slab lies below, the far box aside.
    EXPECT_EQ(d.entities[0].brushes.size(), 1u + 6u);
    EXPECT_EQ(d.entities.size(), 1u + 3u); // world, one light, the detail brush, the entity that is nowhere
    EXPECT_EQ(entity(d, "light").get("origin"), "0 0 40");
    EXPECT_NO_THROW(entity(d, "func_detail"));
    EXPECT_NO_THROW(entity(d, "logic_auto"));
    const Diagnostic& note = first(context, "cordon");
    EXPECT_EQ(note.severity, Severity::note);
    EXPECT_NE(note.message.find("3 brushes and 2 entities"), std::string::npos) << note.message;
}

// Volume of the walls, and whether they overlap: the sum of the brushes' volumes is that of their union.
double wall_volume(const Document& d) {
    double sum = 0;
    for (const DocBrush& b : d.entities[0].brushes) {
        if (b.sides[0].material != "tools/toolsskybox") continue;
        Box3 extent;
        for (const DocSide& s : b.sides)
            for (const auto& p : s.points) extent.add(vec(p));
        const Vec3 size = extent.size();
        sum += size.x * size.y * size.z;
    }
    return sum;
}

TEST(Cordons, TheWallsAreAClosedShell) {
    Document d = map_with(vmf_world(vmf_box({-8, -8, -8}, {8, 8, 8}, 1)), {box({-64, -64, -64}, {64, 64, 64})});
    Context context;
    assemble_detail::cut_to_cordons(d, context);
    EXPECT_NEAR(wall_volume(d), 160.0 * 160 * 160 - 128.0 * 128 * 128, 1e-6);
    MaterialDatabase materials;
    const Result<World> world = build_world(d, materials, {}, context);
    ASSERT_TRUE(world);
    const Result<Csg> csg = build_csg(*world, {}, context);
    ASSERT_TRUE(csg);
    EXPECT_EQ(csg->report.invalid_brushes, 0u);
    double volume = 0; // of the union
    for (const Fragment& f : csg->fragments) {
        const std::vector<Vec3> p = points(csg->planes, f.polygon);
        for (std::size_t i = 1; i + 1 < p.size(); ++i) volume += dot(cross(p[i] - p[0], p[i + 1] - p[0]), p[0]) / 6;
    }
    EXPECT_NEAR(volume, 160.0 * 160 * 160 - 128.0 * 128 * 128 + 16 * 16 * 16, 1e-6);
}

TEST(Cordons, BoxesThatMeetAreOneRoom) {
    // Two boxes side by side, and one of the inactive kind. No wall may stand in either box.
    const Box3 a = box({-64, -64, -64}, {0, 64, 64}), b = box({0, -32, -32}, {64, 32, 32});
    Document d = map_with(vmf_world(vmf_box({-8, -8, -8}, {8, 8, 8}, 1)), {a, b});
    Context context;
    assemble_detail::cut_to_cordons(d, context);
    for (const DocBrush& brush : d.entities[0].brushes) {
        if (brush.sides[0].material != "tools/toolsskybox") continue;
        Box3 e;
        for (const DocSide& s : brush.sides)
            for (const auto& p : s.points) e.add(vec(p));
        for (const Box3& room : {a, b}) {
            bool inside = true;
            for (std::size_t k = 0; k < 3; ++k) inside = inside && e.lo[k] < room.hi[k] && e.hi[k] > room.lo[k];
            EXPECT_FALSE(inside);
        }
    }
}

TEST(Cordons, ABrushTouchesByItsShapeNotByItsBox) {
    // A thin slanted slab whose bounding box covers the cordon, but which passes it by.
    const Files files{{"slab.vmf", vmf_world(vmf_box({-300, -300, 100}, {300, 300, 104}, 1))}};
    Document d = assembled(vmf_world(vmf_box({-8, -8, -8}, {8, 8, 8}, 50)) + vmf_entity("func_instance", {{"file", "slab.vmf"}, {"angles", "45 0 0"}}), files);
    d.cordons.push_back({1, "", true, box({-64, -64, -64}, {64, 64, 64})});
    Context context;
    assemble_detail::cut_to_cordons(d, context);
    EXPECT_EQ(d.entities[0].brushes.size(), 1u + 6u);
}

// A map with one displacement within and one outside: what is left is sound, and each side has its own.
TEST(Cordons, DisplacementsGoWithTheirSides) {
    std::string rows, ways;
    for (int i = 0; i < 5; ++i) rows += fmt::format("\"row{}\" \"1 1 1 1 1\"\n", i), ways += fmt::format("\"row{}\" \"0 0 1 0 0 1 0 0 1 0 0 1 0 0 1\"\n", i);
    const auto hill = [&](double x, int id, double elevation) {
        std::string solid = vmf_box({x, 20, 0}, {x + 8, 28, 8}, id);
        return solid.insert(solid.rfind("}\n}\n"), fmt::format("dispinfo\n{{\n\"power\" \"2\"\n\"startposition\" \"[{} 20 8]\"\n\"elevation\" \"{}\"\nnormals\n{{\n{}}}\ndistances\n{{\n{}}}\n}}\n", x, elevation, ways, rows));
    };
    Document d = map_with(vmf_world(hill(300, 1, 5) + hill(0, 11, 7) + hill(600, 21, 9)), {box({-64, -64, -64}, {64, 64, 64})});
    ASSERT_EQ(d.displacements.size(), 3u);
    Context context;
    assemble_detail::cut_to_cordons(d, context);
    ASSERT_EQ(d.displacements.size(), 1u);
    EXPECT_EQ(d.displacements[0].elevation, 7);
    int carried = 0;
    for (const DocBrush& b : d.entities[0].brushes)
        for (const DocSide& s : b.sides)
            carried += s.displacement == 0 ? 1 : s.displacement < 0 ? 0 : 100;
    EXPECT_EQ(carried, 1);
}

TEST(Cordons, WallsStandWithinTheLargestCoordinate) {
    Document d = map_with(vmf_world(vmf_box({-8, -8, -8}, {8, 8, 8}, 1)), {box({-1e9, -64, -64}, {1e9, 64, 64})});
    Context context;
    assemble_detail::cut_to_cordons(d, context);
    EXPECT_EQ(count(context, "cordon-large"), 1u);
    EXPECT_EQ(d.entities[0].brushes.size(), 1u + 6u);
    for (const DocBrush& b : d.entities[0].brushes)
        for (const DocSide& s : b.sides)
            for (const auto& p : s.points)
                for (const Decimal& x : p) EXPECT_LE(std::abs(x.to_double()), kLargestCoordinate);
}

TEST(Cordons, NoneActive) {
    Document d = map_with(kMap, {box({-64, -64, -64}, {64, 64, 64})}, false);
    const std::size_t before = d.entities[0].brushes.size();
    Context context;
    assemble_detail::cut_to_cordons(d, context);
    EXPECT_EQ(count(context, "cordon-none"), 1u);
    EXPECT_EQ(d.entities[0].brushes.size(), before);
}

} // namespace
} // namespace kiln::test

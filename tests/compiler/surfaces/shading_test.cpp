// Tangent frames and smoothing.
#include "compiler/surfaces/faces.h"
#include "tests/compiler/surfaces/build.h"
#include <numbers>

namespace kiln {
namespace {

using namespace test;

TEST(Surfaces, TangentFollowsTheTexture) {
    const Vec3 up{0, 0, 1};
    Frame f;
    // Hammer's floor: u east, v south (down in the image).
    ASSERT_TRUE(tangent_frame({{1, 0, 0}, {0, -1, 0}}, up, f));
    EXPECT_EQ(f.t, (Vec3{1, 0, 0}));
    EXPECT_EQ(f.b, (Vec3{0, -1, 0}));
    // Mirrored in u, by axis or by scale: t turns round, b stays.
    for (const DocTexture& m : {DocTexture{{-1, 0, 0}, {0, -1, 0}}, DocTexture{{1, 0, 0}, {0, -1, 0}, 0, 0, -0.25, 0.25}}) {
        Frame g;
        ASSERT_TRUE(tangent_frame(m, up, g));
        EXPECT_EQ(g.t, (Vec3{-1, 0, 0}));
        EXPECT_EQ(g.b, (Vec3{0, -1, 0}));
        EXPECT_LT(dot(cross(g.t, g.b), up) * dot(cross(f.t, f.b), up), 0);
    }
    // Sheared axes: t keeps u, b is square to it on the side of v.
    ASSERT_TRUE(tangent_frame({{1, 0, 0}, {0.9, -0.1, 0}}, up, f));
    EXPECT_EQ(f.b, (Vec3{0, -1, 0}));
    // Axes out of the plane are projected.
    const Vec3 slope = normalize(Vec3{0, 1, 1});
    ASSERT_TRUE(tangent_frame({{1, 0, 0}, {0, -1, 0}}, slope, f));
    EXPECT_NEAR(length(f.b - normalize(Vec3{0, -1, 1})), 0, 1e-12);
}

TEST(Surfaces, DegenerateAxesGiveAFrameAndAWarning) {
    const Vec3 up{0, 0, 1};
    Frame f;
    EXPECT_FALSE(tangent_frame({{1, 0, 0}, {2, 0, 0}}, up, f));
    EXPECT_FALSE(tangent_frame({{0, 0, 1}, {0, -1, 0}}, up, f)); // edge-on
    EXPECT_FALSE(tangent_frame({{0, 0, 0}, {0, -1, 0}}, up, f));
    EXPECT_NEAR(dot(cross(f.t, f.b), up), 1, 1e-12);

    WorldBuilder b;
    sealed_room(b, {0, 0, 0}, {64, 64, 64});
    for (WorldSide& side : b.world.sides) side.texture.v_axis = side.texture.u_axis;
    const Built built = build(b.world);
    EXPECT_EQ(std::ranges::count(built.diagnostics, "texture-axes-degenerate", &Diagnostic::code), 6);
}

// A ridge of two slopes of 45 degrees: along the ridge, the smooth normal is the mean, straight up.
class Ridge : public ::testing::Test {
protected:
    WorldBuilder b;
    BrushId ridge;
    void SetUp() override {
        sealed_room(b, {0, 0, 0}, {256, 256, 256});
        const Vec3 p[2] = {{64, 64, 0}, {192, 64, 0}};
        const std::vector<SidePoints> sides{
            {p[0], Vec3{64, 192, 0}, Vec3{128, 64, 64}},       // slope to -x
            {Vec3{128, 64, 64}, Vec3{128, 192, 64}, p[1]},     // slope to +x
            {p[0], p[1], Vec3{64, 192, 0}},                    // floor
            {p[0], Vec3{128, 64, 64}, p[1]},                   // -y
            {Vec3{64, 192, 0}, Vec3{192, 192, 0}, Vec3{128, 192, 64}}, // +y
        };
        ridge = b.brush(sides);
    }
    WorldSide& side(std::size_t i) { return b.world.sides[b.world.brushes[ridge.at()].first_side + i]; }
    // Corner normals of the slopes at the ridge.
    std::vector<Vec3> at_ridge(const Surfaces& s, double x) const {
        std::vector<Vec3> found;
        for (std::size_t t = 0; t < s.triangles.size(); ++t) {
            const Vec3 n = s.faces[s.triangle_face[t].at()].normal;
            if (std::abs(n.z - std::numbers::sqrt2 / 2) > 1e-9 || n.x * x < 0) continue;
            for (std::size_t c = 0; c < 3; ++c)
                if (s.positions[s.triangles[t][c]].z == 64) found.push_back(Vec3(s.corner_normals[t][c]));
        }
        return found;
    }
};

TEST_F(Ridge, FlatWithoutGroups) {
    const Surfaces s = build(b.world, false, 1, {.smoothing_angle_deg = 0}).surfaces;
    const std::vector<Vec3> n = at_ridge(s, 1);
    ASSERT_FALSE(n.empty());
    for (const Vec3& v : n) EXPECT_NEAR(length(v - normalize(Vec3{1, 0, 1})), 0, 1e-6);
    for (const Chart& c : s.charts) EXPECT_FALSE(c.smooth);
    EXPECT_TRUE(s.seams.empty());
}

TEST_F(Ridge, SmoothWhereGroupsShareABit) {
    side(0).smoothing_groups = 0b0110, side(1).smoothing_groups = 0b0100, side(3).smoothing_groups = 0b1000;
    const Surfaces s = build(b.world).surfaces;
    for (const double x : {-1.0, 1.0}) {
        const std::vector<Vec3> n = at_ridge(s, x);
        ASSERT_FALSE(n.empty());
        for (const Vec3& v : n) EXPECT_NEAR(length(v - Vec3{0, 0, 1}), 0, 1e-6);
    }
    EXPECT_EQ(std::ranges::count(s.charts, true, &Chart::smooth), 2);
    ASSERT_EQ(s.seams.size(), 1u); // the ridge
    EXPECT_NE(s.seams[0].chart_a, s.seams[0].chart_b);
    EXPECT_NEAR(length(s.positions[s.seams[0].from] - s.positions[s.seams[0].to]), 128, 1e-9);
}

TEST_F(Ridge, FlatWhereGroupsDiffer) {
    side(0).smoothing_groups = 0b0010, side(1).smoothing_groups = 0b0100;
    const Surfaces s = build(b.world).surfaces;
    EXPECT_EQ(std::ranges::count(s.charts, true, &Chart::smooth), 0);
}

TEST_F(Ridge, CommonBitsOfTheUpperEightAreHardEdges) {
    for (const std::uint32_t bit : {0x01000000u, 0x80000000u}) {
        side(0).smoothing_groups = side(1).smoothing_groups = 0b0100 | bit;
        EXPECT_EQ(std::ranges::count(build(b.world).surfaces.charts, true, &Chart::smooth), 0);
        side(1).smoothing_groups = 0b0100; // not common
        EXPECT_EQ(std::ranges::count(build(b.world).surfaces.charts, true, &Chart::smooth), 2);
    }
    side(0).smoothing_groups = side(1).smoothing_groups = 0x00800000u; // the highest soft one
    EXPECT_EQ(std::ranges::count(build(b.world).surfaces.charts, true, &Chart::smooth), 2);
}

TEST_F(Ridge, WithoutGroupsAVmfSmoothsUpTo45Degrees) {
    // The ridge folds by 90; slopes and floor meet at 45, which is just allowed.
    EXPECT_EQ(std::ranges::count(build(b.world).surfaces.charts, true, &Chart::smooth), 3);
    EXPECT_EQ(std::ranges::count(build(b.world, false, 1, {.smoothing_angle_deg = 44.9}).surfaces.charts, true, &Chart::smooth), 0);
    side(0).smoothing_groups = 1; // groups on one side only: hard
    EXPECT_EQ(std::ranges::count(build(b.world).surfaces.charts, true, &Chart::smooth), 2);
    b.world.format = MapFormat::quake_valve220;
    EXPECT_EQ(std::ranges::count(build(b.world).surfaces.charts, true, &Chart::smooth), 0);
}

TEST_F(Ridge, GroovesHaveAnAngleOfTheirOwn) {
    const SurfacesOptions none{.smoothing_angle_deg = 0};
    std::vector<DocKey>& keys = b.world.entities[0].keys;
    keys.push_back({"_phong_angle", "91", 1});
    keys.push_back({"_phong_angle_concave", "1", 1});
    const Surfaces s = build(b.world, false, 1, none).surfaces;
    for (const Vec3& v : at_ridge(s, 1)) EXPECT_NEAR(v.x, 0, 1e-6); // the ridge is convex: smooth still
    // The slopes meet the floor in grooves of 45 degrees: hard now; without the key the floor bends there.
    keys.back().value = "0";
    const Surfaces soft = build(b.world, false, 1, none).surfaces;
    const auto bent_floor = [](const Surfaces& x) {
        std::size_t n = 0;
        for (std::size_t t = 0; t < x.triangles.size(); ++t)
            for (std::size_t c = 0; c < 3; ++c) {
                const Vec3 p = x.positions[x.triangles[t][c]];
                n += x.faces[x.triangle_face[t].at()].normal == Vec3{0, 0, 1} && p.z == 0 && (p.x == 64 || p.x == 192) && x.corner_normals[t][c] != Vec3f{0, 0, 1};
            }
        return n;
    };
    EXPECT_EQ(bent_floor(s), 0u);
    EXPECT_GT(bent_floor(soft), 0u);
}

TEST_F(Ridge, PhongGroupsStayApart) {
    const SurfacesOptions none{.smoothing_angle_deg = 0};
    WorldEntity group = b.world.entities[0];
    group.keys = {{"classname", "func_group", 1}, {"_phong_angle", "50", 1}};
    group.model = {};
    b.world.entities.push_back(group);
    b.world.brushes[ridge.at()].entity = id<EntityId>(b.world.entities.size() - 1);
    b.world.entities[0].keys.push_back({"_phong_angle", "50", 1});
    EXPECT_EQ(std::ranges::count(build(b.world, false, 1, none).surfaces.charts, true, &Chart::smooth), 3);
    b.world.entities.back().keys.push_back({"_phong_group", "7", 1});
    EXPECT_EQ(std::ranges::count(build(b.world, false, 1, none).surfaces.charts, true, &Chart::smooth), 0);
    b.world.entities[0].keys.push_back({"_phong_group", "7", 1});
    EXPECT_EQ(std::ranges::count(build(b.world, false, 1, none).surfaces.charts, true, &Chart::smooth), 3);
}

// Quake 2: the value of a row is the number of its group, not a set of bits; the usual angle unless a key says more.
TEST_F(Ridge, ValuesOfQuake2RowsAreGroups) {
    b.world.format = MapFormat::quake_valve220;
    const auto smooth = [&] {
        const std::vector<Vec3> normals = at_ridge(build(b.world).surfaces, 1);
        EXPECT_FALSE(normals.empty());
        return std::ranges::all_of(normals, [](Vec3 n) { return std::abs(n.x) < 1e-6; });
    };
    side(0).smoothing_groups = 3, side(1).smoothing_groups = 3;
    EXPECT_FALSE(smooth()); // the ridge folds by 90, the usual angle is 89
    b.world.entities[0].keys.push_back({"_phong_angle", "91", 1});
    EXPECT_TRUE(smooth());
    side(1).smoothing_groups = 1; // shares a bit, is another group
    EXPECT_FALSE(smooth());
    side(0).smoothing_groups = 0x01000001, side(1).smoothing_groups = 0x01000001; // hard edges are a matter of VMF
    EXPECT_TRUE(smooth());
    side(0).smoothing_groups = 0; // the key alone, and a group
    EXPECT_FALSE(smooth());
    b.world.entities[0].keys.push_back({"_phong_group", "5", 1}); // of the brush's entity: wins over rows
    EXPECT_TRUE(smooth());
}

TEST_F(Ridge, PhongKeysSmoothUpToTheirAngle) {
    b.world.entities[0].keys.push_back({"_phong_angle", "89", 1}); // the ridge folds by 90
    EXPECT_EQ(std::ranges::count(build(b.world).surfaces.charts, true, &Chart::smooth), 3); // slopes with the floor: 45
    b.world.entities[0].keys.back().value = "91";
    for (const Vec3& v : at_ridge(build(b.world).surfaces, 1)) EXPECT_NEAR(v.x, 0, 1e-6); // the gable takes part too
}

} // namespace
} // namespace kiln

// Overlays and decals on faces: areas and texture coordinates in closed form.
#include "tests/compiler/surfaces/build.h"
#include <random>

namespace kiln {
namespace {

using namespace test;

Vec3 area_vector(const Surfaces& s, const OverlayFragment& f) {
    const OverlayPoint* p = &s.overlay_points[f.first_point];
    Vec3 twice;
    for (std::uint32_t i = 1; i + 1 < f.point_count; ++i) twice += cross(p[i].position - p[0].position, p[i + 1].position - p[0].position);
    return twice * 0.5;
}
double area(const Surfaces& s, std::uint32_t overlay = 0) {
    double sum = 0;
    for (const OverlayFragment& f : s.overlay_fragments)
        if (f.overlay == overlay) sum += dot(area_vector(s, f), s.faces[f.face.at()].normal); // turned the wrong way it would count negative
    return sum;
}

class OnTheFloor : public ::testing::Test {
protected:
    WorldBuilder b;
    SideId floor;
    void SetUp() override {
        const std::vector<BrushId> walls = b.room({0, 0, 0}, {256, 256, 128});
        b.point_entity("info_player_start", {20, 20, 100});
        floor = side(walls[4], 5);
    }
    SideId side(BrushId brush, std::uint32_t i) const { return {b.world.brushes[brush.at()].first_side + i}; }
    WorldOverlay& add(Vec3 origin, std::array<Vec2, 4> corners, std::vector<SideId> sides) {
        WorldOverlay o;
        o.entity = b.point_entity("info_overlay", origin);
        o.material = {0}, o.origin = origin, o.corners = corners, o.sides = std::move(sides);
        b.world.overlays.push_back(o);
        return b.world.overlays.back();
    }
    static std::array<Vec2, 4> square(double half) { return {Vec2{-half, -half}, {-half, half}, {half, half}, {half, -half}}; }
};

TEST_F(OnTheFloor, WhollyOnOneFaceItHasTheAreaOfItsQuad) {
    std::mt19937_64 rng(1);
    const auto real = [&](double lo, double hi) { return lo + (hi - lo) * static_cast<double>(rng() >> 11) * 0x1p-53; };
    std::vector<double> wanted;
    for (int i = 0; i < 40; ++i) {
        const double angle = real(0, 6.3), a = real(4, 60), c = real(4, 60);
        WorldOverlay& o = add({real(100, 150), real(100, 150), real(-5, 5)}, {Vec2{-a, -c}, {-a, c}, {a, c}, {a, -c}}, {floor});
        o.u = {std::cos(angle), std::sin(angle), 0}, o.v = {-std::sin(angle), std::cos(angle), 0};
        o.uv_range = {0, 2, 1, 0};
        wanted.push_back(4 * a * c);
    }
    const Built built = build(b.world);
    EXPECT_FALSE(built.reported("overlay-nowhere"));
    for (std::uint32_t i = 0; i < 40; ++i) EXPECT_NEAR(area(built.surfaces, i), wanted[i], 1e-8 * wanted[i]);
    for (const OverlayFragment& f : built.surfaces.overlay_fragments) {
        const WorldOverlay& o = b.world.overlays[f.overlay];
        for (std::uint32_t k = f.first_point; k < f.first_point + f.point_count; ++k) {
            const OverlayPoint& p = built.surfaces.overlay_points[k];
            EXPECT_EQ(p.position.z, 0);
            // By hand: u from 0 to 2 along the first axis, v from 1 to 0 along the second.
            const Vec3 d = p.position - o.origin;
            EXPECT_NEAR(p.uv.x, 2 * (dot(d, o.u) - o.corners[0].x) / (o.corners[2].x - o.corners[0].x), 1e-9);
            EXPECT_NEAR(p.uv.y, 1 - (dot(d, o.v) - o.corners[0].y) / (o.corners[2].y - o.corners[0].y), 1e-9);
        }
    }
}

TEST_F(OnTheFloor, ATiltedOneCoversItsShadow) {
    WorldOverlay& o = add({128, 128, 30}, square(16), {floor});
    o.u = {0.8, 0, 0.6}, o.normal = {-0.6, 0, 0.8}; // swept along its normal it meets the floor at an angle
    EXPECT_NEAR(area(build(b.world).surfaces), 32 * 32 / 0.8, 1e-9);
}

TEST_F(OnTheFloor, AnObliqueBasisIsTakenAsItIs) {
    WorldOverlay& o = add({128, 128, 0}, square(16), {floor});
    o.v = normalize(Vec3{1, 1, 0}); // a parallelogram
    EXPECT_NEAR(area(build(b.world).surfaces), 32 * 32 * std::sqrt(0.5), 1e-9);
}

TEST_F(OnTheFloor, WhatHangsOverIsCutOff) {
    add({0, 128, 0}, square(16), {floor});
    add({0, 0, 0}, square(16), {floor});
    const Built built = build(b.world);
    EXPECT_NEAR(area(built.surfaces, 0), 32 * 32 / 2, 1e-9);
    EXPECT_NEAR(area(built.surfaces, 1), 32 * 32 / 4, 1e-9);
}

TEST_F(OnTheFloor, WhatStandsOnTheFaceIsLeftOut) {
    b.box({120, 120, 0}, {136, 136, 32}); // a pillar, so that the floor has a hole
    add({128, 128, 0}, square(32), {floor});
    EXPECT_NEAR(area(build(b.world).surfaces), 64 * 64 - 16 * 16, 1e-9);
}

TEST_F(OnTheFloor, ItGoesOnAcrossTheSidesItNames) {
    const BrushId slab = b.box({128, 0, 0}, {256, 256, 8}); // a step
    add({128, 128, 0}, square(32), {floor});
    add({128, 128, 0}, square(32), {floor, side(slab, 5)});
    add({128, 128, 0}, square(32), {side(slab, 5), side(slab, 0)}); // the riser looks sideways: nothing of it
    const Surfaces s = build(b.world).surfaces;
    EXPECT_NEAR(area(s, 0), 32 * 64, 1e-9);
    EXPECT_NEAR(area(s, 1), 64 * 64, 1e-9);
    EXPECT_NEAR(area(s, 2), 32 * 64, 1e-9);
}

TEST_F(OnTheFloor, AQuadThatIsNoParallelogramKeepsItsCorners) {
    const std::array<Vec2, 4> trapezoid{Vec2{-30, -20}, {-10, 20}, {10, 20}, {30, -20}};
    const std::array<Vec2, 4> dart{Vec2{-30, -20}, {0, -10}, {30, -20}, {0, 30}}; // not convex at the second corner
    const std::array<Vec2, 4> backwards{trapezoid[3], trapezoid[2], trapezoid[1], trapezoid[0]};
    for (const auto& corners : {trapezoid, dart, backwards}) add({128, 128, 0}, corners, {floor});
    const Surfaces s = build(b.world).surfaces;
    EXPECT_NEAR(area(s, 0), 40 * (60 + 20) / 2.0, 1e-9);
    EXPECT_NEAR(area(s, 1), 60 * 50 / 2.0 - 60 * 10 / 2.0, 1e-9);
    EXPECT_NEAR(area(s, 2), area(s, 0), 1e-9);
    const Vec2 uv[4] = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
    for (const OverlayFragment& f : s.overlay_fragments)
        for (std::uint32_t k = f.first_point; k < f.first_point + f.point_count; ++k)
            for (std::size_t c = 0; c < 4; ++c) {
                const OverlayPoint& p = s.overlay_points[k];
                const Vec2 at = b.world.overlays[f.overlay].corners[c];
                if (length(p.position - Vec3{128 + at.x, 128 + at.y, 0}) > 1e-9) continue;
                EXPECT_NEAR(p.uv.x, uv[c].x, 1e-9);
                EXPECT_NEAR(p.uv.y, uv[c].y, 1e-9);
            }
}

TEST_F(OnTheFloor, WhatHitsNothingIsToldAtItsEntity) {
    const BrushId buried = b.box({-10, -10, -10}, {-8, -8, -8}); // inside a wall
    add({128, 128, 0}, square(8), {});
    add({128, 500, 0}, square(8), {floor});
    add({-9, -9, -8}, square(8), {side(buried, 5)});
    add({128, 128, 0}, {Vec2{0, 0}, {1, 0}, {2, 0}, {3, 0}}, {floor});
    const Built built = build(b.world);
    EXPECT_TRUE(built.surfaces.overlay_fragments.empty());
    std::size_t told = 0;
    for (const Diagnostic& d : built.diagnostics) {
        if (d.code != "overlay-nowhere") continue;
        EXPECT_EQ(d.severity, Severity::warning);
        EXPECT_EQ(d.where.line, b.world.entities[b.world.overlays[told].entity.at()].line);
        ++told;
    }
    EXPECT_EQ(told, 4u);
}

TEST_F(OnTheFloor, OneThatLooksTheWrongWayStillLiesOnTheSidesItNames) {
    const BrushId shelf = b.box({64, 64, 32}, {192, 192, 40});
    add({128, 128, 0}, square(8), {floor}).normal = {0, 0, -1};
    add({128, 128, 36}, square(8), {side(shelf, 5), side(shelf, 4)}).normal = {0, 0, -1}; // above and below: the one it looks along
    const Surfaces s = build(b.world).surfaces;
    EXPECT_NEAR(area(s, 0), 16 * 16, 1e-9);
    EXPECT_NEAR(area(s, 1), 16 * 16, 1e-9);
    for (const OverlayFragment& f : s.overlay_fragments) {
        if (f.overlay != 1) continue;
        EXPECT_EQ(s.faces[f.face.at()].normal, (Vec3{0, 0, -1}));
    }
}

TEST_F(OnTheFloor, PiecesOfNeighboursMeetToTheLastBit) {
    b.box({120, 120, 0}, {136, 136, 32});
    WorldOverlay& o = add({128, 128, 0}, square(50), {floor});
    o.u = {std::cos(0.3), std::sin(0.3), 0}, o.v = {-std::sin(0.3), std::cos(0.3), 0};
    const Surfaces s = build(b.world).surfaces;
    // Every edge inside the overlay is there once each way; the others make up its outline and that of the hole.
    std::vector<std::array<double, 4>> edges;
    for (const OverlayFragment& f : s.overlay_fragments)
        for (std::uint32_t i = 0; i < f.point_count; ++i) {
            const Vec3 p = s.overlay_points[f.first_point + i].position, q = s.overlay_points[f.first_point + (i + 1) % f.point_count].position;
            edges.push_back({p.x, p.y, q.x, q.y});
        }
    double outline = 0;
    for (const auto& e : edges)
        if (std::ranges::find(edges, std::array{e[2], e[3], e[0], e[1]}) == edges.end()) outline += std::hypot(e[2] - e[0], e[3] - e[1]);
    EXPECT_NEAR(outline, 4 * 100 + 4 * 16, 1e-8);
}

class Decals : public OnTheFloor {
protected:
    WorldOverlay& decal(Vec3 origin, double width, double height) {
        WorldOverlay& o = add(origin, {Vec2{-width / 2, -height / 2}, {-width / 2, height / 2}, {width / 2, height / 2}, {width / 2, -height / 2}}, {});
        o.kind = WorldOverlay::decal;
        return o;
    }
};

TEST_F(Decals, LieOnTheNearestFaceTheirRightWayUp) {
    decal({2, 128, 64}, 32, 16);      // the wall x = 0, seen looking to -x: right is +y
    decal({128, 128, 0}, 32, 16);     // exactly on the floor
    decal({128, 128, 127}, 32, 16);   // the ceiling
    decal({250, 128, -0.01}, 4, 4);   // hardly inside the floor
    const Built built = build(b.world);
    const Surfaces& s = built.surfaces;
    EXPECT_FALSE(built.reported("overlay-nowhere"));
    EXPECT_NEAR(area(s, 0), 32 * 16, 1e-9);
    EXPECT_NEAR(area(s, 1), 32 * 16, 1e-9);
    EXPECT_NEAR(area(s, 2), 32 * 16, 1e-9);
    EXPECT_NEAR(area(s, 3), 4 * 4, 1e-9);
    for (const OverlayFragment& f : s.overlay_fragments)
        for (std::uint32_t k = f.first_point; k < f.first_point + f.point_count; ++k) {
            const auto& [p, uv] = s.overlay_points[k];
            if (f.overlay == 0) {
                EXPECT_EQ(p.x, 0);
                EXPECT_NEAR(uv.x, (p.y - 112) / 32, 1e-9);
                EXPECT_NEAR(uv.y, (72 - p.z) / 16, 1e-9); // v runs down
            } else if (f.overlay == 1) {
                EXPECT_NEAR(uv.x, (p.x - 112) / 32, 1e-9);
                EXPECT_NEAR(uv.y, (136 - p.y) / 16, 1e-9);
            }
        }
}

TEST_F(Decals, AreCutAtCornersAndStayOnTheirWall) {
    decal({1, 4, 64}, 32, 16); // four units from the corner
    const Surfaces s = build(b.world).surfaces;
    EXPECT_NEAR(area(s), (16 + 4) * 16, 1e-9);
    for (const OverlayFragment& f : s.overlay_fragments) EXPECT_EQ(s.faces[f.face.at()].normal, (Vec3{1, 0, 0}));
}

TEST_F(Decals, ReachAcrossShallowStepsButNotDeepOnes) {
    b.box({0, 128, 0}, {2, 256, 128}); // a panel two units thick
    b.box({0, 0, 0}, {6, 64, 128});    // and one of six
    decal({1, 120, 64}, 32, 16);       // half on the wall, half on the panel: 16 wide each but for the offset
    decal({1, 72, 64}, 32, 16);
    const Surfaces s = build(b.world).surfaces;
    EXPECT_NEAR(area(s, 0), 32 * 16, 1e-9);
    EXPECT_NEAR(area(s, 1), (32 - 8) * 16, 1e-9);
}

TEST_F(Decals, FarFromEverythingAreTold) {
    decal({128, 128, 64}, 32, 16);
    decal({128, 128, 9}, 32, 16);
    const Built built = build(b.world);
    EXPECT_EQ(std::ranges::count(built.diagnostics, "overlay-nowhere", &Diagnostic::code), 2);
}

} // namespace
} // namespace kiln

// Displacements and patches: shapes, seams, luxels, what is seen of them.
#include "compiler/surfaces/curves.h"
#include "libs/core/hash.h"
#include "tests/compiler/surfaces/build.h"
#include "tests/support/curves.h"
#include <numbers>
#include <random>
#include <set>

namespace kiln {
namespace {

using test::build;
using test::WorldBuilder;

std::vector<std::array<std::uint32_t, 2>> open_edges(const Surfaces& s) {
    std::set<std::array<std::uint32_t, 2>> all;
    for (std::size_t t = 0; t < s.triangles.size(); ++t)
        for (std::size_t c = 0; c < 3 && s.faces[s.triangle_face[t].at()].curved(); ++c)
            EXPECT_TRUE(all.insert({s.triangles[t][c], s.triangles[t][(c + 1) % 3]}).second);
    std::vector<std::array<std::uint32_t, 2>> open;
    for (const auto& [a, b] : all)
        if (!all.contains({b, a})) open.push_back({a, b});
    return open;
}

double curve_area(const Surfaces& s) {
    double sum = 0;
    for (const Face& f : s.faces) sum += f.curved() ? f.area : 0;
    return sum;
}
double seen_area(const Surfaces& s) { // of curves, map units squared
    double sum = 0;
    for (const LuxelPiece& p : s.pieces) {
        if (!s.faces[p.face.at()].curved()) continue;
        double area = 0;
        const PiecePoints v = points_of(s, p);
        for (std::size_t i = 1; i + 1 < v.size(); ++i) area += cross(v[i] - v[0], v[i + 1] - v[0]) / 2;
        sum += area * luxel_area(s, p.face);
    }
    return sum;
}

// No luxel edge is longer on the surface than a luxel: along the rows and columns of the grid everywhere.
void expect_no_stretch(const Surfaces& s) {
    const std::uint32_t first = s.faces[s.first_curved_face].first_triangle;
    for (std::size_t t = first; t < s.triangles.size(); ++t) {
        const Face& f = s.faces[s.triangle_face[t].at()];
        if (!f.chart.valid()) continue;
        const double size = s.charts[f.chart.at()].luxel_size;
        for (std::size_t c = 0; c < 3; ++c) {
            const Vec2 d = s.curve_corners[t - first][(c + 1) % 3].luxel - s.curve_corners[t - first][c].luxel;
            if (d.x != 0 && d.y != 0) continue; // a diagonal
            const double world = length(s.positions[s.triangles[t][(c + 1) % 3]] - s.positions[s.triangles[t][c]]);
            EXPECT_LE(world, size * (std::abs(d.x) + std::abs(d.y)) * (1 + 1e-9));
        }
    }
}

TEST(Displacements, TerrainOfMixedPowersIsOpenAtItsOuterBorderOnly) {
    WorldBuilder b;
    test::sealed_room(b, {0, 0, -128}, {512, 512, 256});
    test::mixed_terrain(b, 0, test::hills);
    const test::Built built = build(b.world);
    const Surfaces& s = built.surfaces;
    ASSERT_EQ(s.curves.size(), 5u);
    const auto edges = open_edges(s);
    const auto outer = [&](std::uint32_t p) {
        const Vec3 v = s.positions[p];
        return v.x == 0 || v.y == 0 || v.x == 512 || v.y == 512;
    };
    for (const auto& [p, q] : edges) EXPECT_TRUE(outer(p) && outer(q)) << s.positions[p].x << ' ' << s.positions[p].y;
    // Around: 16 + 4 along y = 0, 4 + 4 along x = 512, 4 + 8 + 8 along y = 512, 8 + 16 along x = 0.
    EXPECT_EQ(edges.size(), 72u);
    EXPECT_EQ(unmatched_curve_edges(s, {0}, Curve::displacement), 72u);
    EXPECT_TRUE(built.reported("displacements-sewn")); // finer vertices went onto the coarser edges
    EXPECT_FALSE(built.reported("displacements-apart"));
    expect_no_stretch(s);
    EXPECT_NEAR(seen_area(s), curve_area(s), 1e-6 * curve_area(s));
}

TEST(Displacements, VerticesAreWhereTheMapSays) {
    WorldBuilder b;
    test::sealed_room(b, {0, 0, -128}, {512, 512, 256});
    test::displaced_box(b, {64, 64, -16}, {192, 320, 0}, 3, test::hills);
    DocDisplacement& d = b.world.displacements[0].grid;
    d.elevation = 5;
    d.offsets.assign(81, {0, 0, 0});
    d.offsets[10] = {3, -2, 1};
    const test::Built built = build(b.world);
    const Surfaces& s = built.surfaces;
    const Curve& curve = s.curves.at(0);
    for (std::uint32_t r = 0; r < 9; ++r)
        for (std::uint32_t c = 0; c < 9; ++c) {
            Vec3 p{64 + 16.0 * c, 64 + 32.0 * r, 5};
            p.z += test::hills(p.x, p.y);
            if (r * 9 + c == 10) p += Vec3{3, -2, 1};
            EXPECT_LT(length(s.positions[curve.grid[r * 9 + c]] - p), 1e-9) << r << ' ' << c;
        }
    // Even quads are cut from (r, c) to (r + 1, c + 1), odd ones the other way: all diagonals join even corners.
    std::set<std::array<std::uint32_t, 2>> edges;
    for (std::size_t t = 0; t < s.triangles.size(); ++t)
        for (std::size_t k = 0; k < 3; ++k) edges.insert({s.triangles[t][k], s.triangles[t][(k + 1) % 3]});
    const auto joined = [&](std::uint32_t p, std::uint32_t q) { return edges.contains({curve.grid[p], curve.grid[q]}); };
    for (std::uint32_t r = 0; r < 8; ++r)
        for (std::uint32_t c = 0; c < 8; ++c) {
            EXPECT_EQ(joined(r * 9 + c, r * 9 + c + 10), (r + c) % 2 == 0);
            EXPECT_EQ(joined(r * 9 + c + 1, r * 9 + c + 9), (r + c) % 2 == 1);
        }
}

// A start position at another corner turns the grid with it.
TEST(Displacements, TheGridBeginsAtTheStart) {
    for (const auto& [start, along, across] : {std::tuple{Vec3{64, 64, 0}, Vec3{1, 0, 0}, Vec3{0, 1, 0}}, {Vec3{192, 64, 0}, Vec3{0, 1, 0}, Vec3{-1, 0, 0}},
                                               {Vec3{192, 192, 0}, Vec3{-1, 0, 0}, Vec3{0, -1, 0}}, {Vec3{64, 192, 0}, Vec3{0, -1, 0}, Vec3{1, 0, 0}}}) {
        WorldBuilder b;
        test::sealed_room(b, {0, 0, -128}, {256, 256, 256});
        test::displaced_box(b, {64, 64, -16}, {192, 192, 0}, 2, [](double, double) { return 0; });
        b.world.displacements[0].grid.start = start;
        const test::Built built = build(b.world);
        const Curve& curve = built.surfaces.curves.at(0);
        for (std::uint32_t r = 0; r < 5; ++r)
            for (std::uint32_t c = 0; c < 5; ++c)
                EXPECT_LT(length(built.surfaces.positions[curve.grid[r * 5 + c]] - (start + along * (32.0 * c) + across * (32.0 * r))), 1e-9);
    }
}

TEST(Displacements, ABrushWithOneSealsNothingAndIsInNoLeaf) {
    WorldBuilder b;
    test::sealed_room(b, {0, 0, 0}, {256, 256, 256});
    test::displaced_box(b, {64, 64, 64}, {192, 192, 80}, 2, [](double, double) { return 8; });
    const test::Built built = build(b.world);
    const auto brush = id<BrushId>(b.world.brushes.size() - 1);
    for (const Fragment& f : built.csg.fragments) EXPECT_NE(f.brush, brush);
    for (const BspLeaf& l : built.bsp.leaves) EXPECT_TRUE(std::ranges::find(l.brushes, brush) == l.brushes.end());
    EXPECT_EQ(built.bsp.cluster_count, 1u);
    for (const Face& f : built.surfaces.faces)
        EXPECT_TRUE(f.curved() || f.side.value < b.world.brushes[brush.at()].first_side);
}

// A flat grid is one face of one plane, and its luxels are those of a flat wall.
TEST(Displacements, AFlatOneIsOneFace) {
    WorldBuilder b;
    test::sealed_room(b, {0, 0, 0}, {256, 256, 256});
    test::displaced_box(b, {32, 32, 16}, {160, 224, 32}, 4, [](double, double) { return 3; });
    const test::Built built = build(b.world);
    const Surfaces& s = built.surfaces;
    ASSERT_EQ(s.curves.at(0).face_count, 1u);
    EXPECT_NEAR(s.faces.back().area, 128 * 192, 1e-6);
    const Chart& chart = s.charts[s.faces.back().chart.at()];
    EXPECT_EQ(chart.width, 128u / 16 + 2);
    EXPECT_EQ(chart.height, 192u / 16 + 2);
    EXPECT_FALSE(chart.smooth);
}

// The original sizes lightmaps by the flat base: a cliff gets a few luxels drawn out over all of it.
TEST(Displacements, ACliffGetsLuxelsByItsSurface) {
    WorldBuilder b;
    test::sealed_room(b, {0, 0, 0}, {256, 256, 1024});
    test::displaced_box(b, {64, 64, 16}, {128, 128, 32}, 3, [](double x, double) { return x > 96 ? 640 : 0; });
    const test::Built built = build(b.world);
    const Surfaces& s = built.surfaces;
    expect_no_stretch(s);
    const double area = curve_area(s);
    EXPECT_GT(area, 640 * 64);
    std::size_t luxels = 0;
    for (const Luxel& l : s.luxels) luxels += s.charts[l.chart.at()].curved();
    EXPECT_GE(static_cast<double>(luxels), area / (16 * 16));
    EXPECT_LE(static_cast<double>(luxels), 1.5 * area / (16 * 16)); // nor many more
}

TEST(Displacements, WhatIsBuriedGetsNoLuxels) {
    WorldBuilder b;
    test::sealed_room(b, {0, 0, 0}, {256, 256, 256});
    // Half of the slope lies under the floor; a detail block stands on the other.
    test::displaced_box(b, {0, 0, -8}, {256, 256, 0}, 3, [](double x, double) { return x - 128; });
    const test::Built bare = build(b.world);
    EXPECT_NEAR(seen_area(bare.surfaces), curve_area(bare.surfaces) / 2, 1e-6 * curve_area(bare.surfaces));
    EXPECT_FALSE(bare.reported("curve-faces-hidden")); // it is one face, and half of it shows
    b.box({192, 0, 0}, {256, 256, 200}, Contents::detail);
    const test::Built covered = build(b.world);
    EXPECT_NEAR(seen_area(covered.surfaces), curve_area(covered.surfaces) / 4, 1e-6 * curve_area(covered.surfaces));
    for (const Face& f : covered.surfaces.faces)
        EXPECT_FALSE(f.curved() && f.drawn && f.clusters.empty());
}

TEST(Displacements, FacesWhollyBuriedAreCountedAndNotDrawn) {
    WorldBuilder b;
    test::sealed_room(b, {0, 0, 0}, {256, 256, 256});
    test::displaced_box(b, {0, 0, -8}, {256, 256, 0}, 2, [](double x, double y) { return x < 128 ? -10 + x / 16 : 10 + y * x / 2000; });
    const test::Built built = build(b.world);
    ASSERT_TRUE(built.reported("curve-faces-hidden"));
    for (const Face& f : built.surfaces.faces)
        EXPECT_TRUE(!f.curved() || f.drawn == (f.bounds.hi.z > 0));
}

TEST(Displacements, NeighboursShadeTheirBorderAlike) {
    WorldBuilder b;
    test::sealed_room(b, {0, 0, -128}, {512, 512, 256});
    test::mixed_terrain(b, 0, test::hills);
    const test::Built built = build(b.world);
    const Surfaces& s = built.surfaces;
    std::map<std::uint32_t, Vec3f> normal;
    for (std::size_t t = 0; t < s.triangles.size(); ++t)
        if (s.faces[s.triangle_face[t].at()].curved())
            for (std::size_t c = 0; c < 3; ++c) {
                const auto [it, fresh] = normal.try_emplace(s.triangles[t][c], s.corner_normals[t][c]);
                EXPECT_TRUE(fresh || length(it->second - s.corner_normals[t][c]) < 1e-6f);
            }
}

TEST(Displacements, WhatCannotBeIsReportedWhereItStands) {
    WorldBuilder b;
    test::sealed_room(b, {0, 0, 0}, {256, 256, 256});
    const std::array<Vec2, 5> pentagon{Vec2{64, 64}, {128, 48}, {192, 64}, {192, 192}, {64, 192}};
    const BrushId brush = b.prism(pentagon, 16, 32);
    WorldBrush& w = b.world.brushes[brush.at()];
    w.displaced = true, w.contents = Contents::empty;
    b.world.sides[w.first_side].displacement = 0;
    WorldDisplacement d;
    d.side = {w.first_side}, d.grid.power = 2;
    b.world.displacements.push_back(d);
    const test::Built built = build(b.world);
    ASSERT_TRUE(built.reported("displacement-base"));
    EXPECT_TRUE(built.surfaces.curves.empty());
    const auto at = std::ranges::find(built.diagnostics, "displacement-base", &Diagnostic::code);
    EXPECT_EQ(at->where.line, b.world.sides[w.first_side].line);
}

TEST(Displacements, TheSameForAnyNumberOfThreads) {
    WorldBuilder b;
    test::sealed_room(b, {0, 0, -128}, {512, 512, 256});
    test::mixed_terrain(b, 0, test::hills);
    const Hash one = hash_of(build(b.world, false, 1).surfaces);
    EXPECT_EQ(one, hash_of(build(b.world, false, 2).surfaces));
    EXPECT_EQ(one, hash_of(build(b.world, false, 7).surfaces));
}

// Neighbours that lie apart on purpose stay apart, and are told.
TEST(Displacements, GapsOfTheMapStay) {
    WorldBuilder b;
    test::sealed_room(b, {0, 0, -128}, {512, 512, 256});
    test::displaced_box(b, {0, 0, -16}, {256, 256, 0}, 3, [](double, double) { return 0; });
    test::displaced_box(b, {256, 0, -16}, {512, 256, 0}, 3, [](double, double y) { return y > 100 ? 7 : 0; });
    const test::Built built = build(b.world);
    EXPECT_TRUE(built.reported("displacements-apart"));
    EXPECT_EQ(open_edges(built.surfaces).size(), 64u - 2 * 3); // eight a side; the three up to y = 96 are joined
}

// ---- Patches

Vec3 random_point(std::mt19937& random, double size) {
    const auto real = [&] { return size * (random() / 4294967296.0 - 0.5); };
    return {real(), real(), real()};
}

double distance_to_triangle(Vec3 p, Vec3 a, Vec3 b, Vec3 c) {
    double best = 1e300;
    const Vec3 n = cross(b - a, c - a);
    const double nn = dot(n, n);
    if (nn > 0 && dot(cross(b - a, p - a), n) >= 0 && dot(cross(c - b, p - b), n) >= 0 && dot(cross(a - c, p - c), n) >= 0)
        best = std::abs(dot(p - a, n)) / std::sqrt(nn);
    for (const auto& [u, v] : {std::pair{a, b}, {b, c}, {c, a}}) {
        const Vec3 d = v - u;
        const double t = std::clamp(dot(p - u, d) / std::max(1e-300, dot(d, d)), 0.0, 1.0);
        best = std::min(best, length(p - (u + d * t)));
    }
    return best;
}

TEST(Patches, AreNowhereFartherFromTheirTrianglesThanAsked) {
    std::mt19937 random{7};
    for (int k = 0; k < 20; ++k) {
        BezierPiece piece;
        for (auto& row : piece.point)
            for (Vec3& p : row) p = random_point(random, 128);
        for (const double flatness : {4.0, 1.0}) {
            const auto [n, m] = bezier_divisions(piece, flatness);
            ASSERT_LE(n * m, 64u * 64u);
            const auto at = [&](double t, double u) { return bezier_point(piece, t, 1 - t, u, 1 - u); };
            for (int i = 0; i < 300; ++i) {
                const double t = random() / 4294967296.0, u = random() / 4294967296.0;
                const double c = std::floor(t * n), r = std::floor(u * m);
                const Vec3 p00 = at(c / n, r / m), p10 = at((c + 1) / n, r / m), p11 = at((c + 1) / n, (r + 1) / m), p01 = at(c / n, (r + 1) / m);
                const bool even = static_cast<int>(c + r) % 2 == 0;
                const Vec3 p = at(t, u);
                const double d = even ? std::min(distance_to_triangle(p, p00, p10, p11), distance_to_triangle(p, p00, p11, p01))
                                      : std::min(distance_to_triangle(p, p00, p10, p01), distance_to_triangle(p, p10, p11, p01));
                ASSERT_LE(d, flatness);
            }
        }
    }
    // A flat one is not divided, however its control points lie in the plane along straight rows.
    BezierPiece plane;
    for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 3; ++c) plane.point[r][c] = {32.0 * static_cast<double>(c), (20.0 + 8.0 * static_cast<double>(c)) * static_cast<double>(r), 5};
    EXPECT_EQ(bezier_divisions(plane, 0.5), (std::array<std::uint32_t, 2>{1, 1}));
}

// Two patches with one border in common, written in opposite directions and along different axes of their grids.
TEST(Patches, ThatShareABorderCurveShareItsVertices) {
    WorldBuilder b;
    test::sealed_room(b, {-256, -256, -256}, {256, 256, 256});
    const std::array<Vec3, 5> border{Vec3{-64, 0, 0}, {-40, 10, 50}, {0, 0, 0}, {30, -20, -60}, {64, 0, 10}};
    test::patch(b, 5, 3, [&](std::uint32_t c, std::uint32_t r) { return border[c] + Vec3{0, 60.0 * r, r == 1 ? 40.0 : 0}; });
    // The second runs the other way, with the border along its rows; strongly bent, so that alone it would be finer.
    test::patch(b, 3, 5, [&](std::uint32_t c, std::uint32_t r) { return border[r] + Vec3{0, -50.0 * c, c == 1 ? 300.0 * (r % 2) : 0}; });
    const test::Built built = build(b.world);
    const Surfaces& s = built.surfaces;
    ASSERT_EQ(s.curves.size(), 2u);
    const std::set<std::uint32_t> first(s.curves[0].grid.begin(), s.curves[0].grid.end());
    std::size_t shared = 0;
    for (const std::uint32_t p : s.curves[1].grid) shared += first.contains(p);
    EXPECT_EQ(shared, s.curves[0].columns);
    EXPECT_EQ(shared, s.curves[1].rows);
    EXPECT_EQ(open_edges(s).size(), 2 * (s.curves[0].columns - 1 + s.curves[0].rows - 1) + 2 * (s.curves[1].columns - 1 + s.curves[1].rows - 1) -
                                        2 * (shared - 1));
    expect_no_stretch(s);
}

// Two small ones along a side of a large one, two more meeting around its corner: their corners lie in its borders, and
// one of its quads (it is flat: there is one) is cut along both.
TEST(Patches, ThatShareAPartOfABorderShareTheirCorners) {
    WorldBuilder b;
    test::sealed_room(b, {-256, -256, -256}, {256, 256, 256});
    const auto flat = [&](double x, double y, double wide, double high) {
        test::patch(b, 3, 3, [&](std::uint32_t c, std::uint32_t r) { return Vec3{x + wide * c / 2, y + high * r / 2, 4e-6 * (b.world.patches.size() % 3)}; });
    };
    flat(0, 0, 128, 128);
    flat(0, -32, 48, 32), flat(48, -32, 80, 32);   // below
    flat(128, 0, 32, 100), flat(128, 100, 32, 28); // to the right
    const test::Built built = build(b.world);
    const Surfaces& s = built.surfaces;
    EXPECT_TRUE(built.reported("patch-points-rounded"));
    ASSERT_EQ(s.curves.size(), 5u);
    std::size_t large = 0;
    for (std::uint32_t f = s.curves[0].first_face; f < s.curves[0].first_face + s.curves[0].face_count; ++f) large += s.faces[f].triangle_count;
    EXPECT_EQ(large, 4u);
    EXPECT_NEAR(curve_area(s), 128 * 128 + 128 * 32 + 128 * 32, 1e-9);
    EXPECT_NEAR(seen_area(s), curve_area(s), 1e-6 * curve_area(s));
    for (const auto& [p, q] : open_edges(s)) { // those around all five only
        const Vec3 m = (s.positions[p] + s.positions[q]) * 0.5;
        EXPECT_TRUE(m.x == 0 || m.y == 128 || m.y == -32 || m.x == 160 || (m.x == 128 && m.y < 0) || (m.x > 128 && m.y == 0)) << m.x << ' ' << m.y;
    }
    expect_no_stretch(s);
}

TEST(Patches, ATubeIsOpenAtItsRimsAndLooksOut) {
    WorldBuilder b;
    test::sealed_room(b, {-256, -256, 0}, {256, 256, 256});
    constexpr std::array<Vec2, 9> kRing{Vec2{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}, {1, 0}};
    test::patch(b, 9, 3, [&](std::uint32_t c, std::uint32_t r) { return Vec3{64 * kRing[c].x, 64 * kRing[c].y, 32 + 64.0 * r}; });
    const test::Built built = build(b.world);
    const Surfaces& s = built.surfaces;
    ASSERT_EQ(s.curves.size(), 1u);
    const auto around = s.curves[0].columns - 1;
    EXPECT_EQ(open_edges(s).size(), 2 * around);
    EXPECT_EQ(s.curves[0].rows, 2u); // straight: not divided
    double volume = 0;
    for (const Face& f : s.faces) {
        if (!f.curved()) continue;
        EXPECT_GT(dot(f.normal, Vec3{f.bounds.center().x, f.bounds.center().y, 0}), 0); // columns x rows is the front
        EXPECT_NEAR(f.normal.z, 0, 1e-12);
        volume += f.distance * f.area / 2; // of the section, times the height
    }
    // Parabolas instead of quarter circles: each quarter of the section has an area of 5/6 r^2; within the flatness.
    EXPECT_NEAR(volume / 128, 4 * 64 * 64 * (5.0 / 6), 2 * 0.5 * 4 * 90);
    for (std::size_t t = 0; t < s.triangles.size(); ++t) // its own seam is smooth
        for (const Vec3f& n : s.corner_normals[t]) EXPECT_TRUE(!s.faces[s.triangle_face[t].at()].curved() || std::abs(n.z) < 1e-6f);
}

TEST(Patches, WithoutAreaAreReportedAndLeftOut) {
    WorldBuilder b;
    test::sealed_room(b, {-256, -256, 0}, {256, 256, 256});
    test::patch(b, 3, 3, [](std::uint32_t c, std::uint32_t r) { return Vec3{10.0 * (c + r), 0, 64}; });
    const test::Built built = build(b.world);
    EXPECT_TRUE(built.reported("patch-degenerate"));
    EXPECT_TRUE(built.surfaces.curves.empty());
}

TEST(Patches, TextureRunsFromCornerToCorner) {
    WorldBuilder b;
    test::sealed_room(b, {-256, -256, 0}, {256, 256, 256});
    test::patch(b, 3, 3, [](std::uint32_t c, std::uint32_t r) { return Vec3{64.0 * c, 64.0 * r, c == 1 ? 128.0 : 64}; });
    const test::Built built = build(b.world);
    const Curve& curve = built.surfaces.curves.at(0);
    EXPECT_EQ(curve.uv.front(), (Vec2{0, 0}));
    EXPECT_EQ(curve.uv.back(), (Vec2{1, 1}));
    for (std::uint32_t c = 0; c < curve.columns; ++c) EXPECT_NEAR(curve.uv[c].x, static_cast<double>(c) / (curve.columns - 1), 1e-12);
}

} // namespace
} // namespace kiln

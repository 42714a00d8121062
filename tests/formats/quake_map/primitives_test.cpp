// Radiant's primitives and QuArK's texture comments: brushDef, brushDef3, patchDef2, patchDef3, //TX1.
#include "formats/quake_map/projection.h"
#include "formats/quake_map/quake_map.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <numbers>
#include <random>

namespace kiln {
namespace {

Result<Document> read(const std::string& text, Context& context) {
    return read_quake_map({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "t.map", context);
}
std::string world(const std::string& inside) {
    return "{\n\"classname\" \"worldspawn\"\n" + inside + "}\n";
}
std::string primitive(const std::string& name, const std::string& inside) {
    return "{\n" + name + "\n{\n" + inside + "}\n}\n";
}
double u_of(const DocTexture& t, Vec3 p) { return dot(p, t.u_axis) / t.u_scale + t.u_shift; }
double v_of(const DocTexture& t, Vec3 p) { return dot(p, t.v_axis) / t.v_scale + t.v_shift; }

// Radiant's axis base for the six axial normals and one slope, written out by hand from its definition: x turned to the
// normal about y, then z; u where y comes to lie, v against where z does.
TEST(Primitives, AxisBaseOfKnownNormals) {
    const double h = std::numbers::sqrt2 / 2;
    const struct {
        Vec3 normal, u, v;
    } cases[] = {
        {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}},   {{0, 0, -1}, {0, 1, 0}, {-1, 0, 0}}, {{1, 0, 0}, {0, 1, 0}, {0, 0, -1}},
        {{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}}, {{0, 1, 0}, {-1, 0, 0}, {0, 0, -1}}, {{0, -1, 0}, {1, 0, 0}, {0, 0, -1}},
        {{1, 0, 1}, {0, 1, 0}, {h, 0, -h}},  {{0, -1, 1}, {1, 0, 0}, {0, -h, -h}}, {{1, 1, 0}, {-h, h, 0}, {0, 0, -1}},
        {{1e-8, 0, 1}, {0, 1, 0}, {1, 0, 0}}, // all but axial is axial
    };
    for (const auto& k : cases) {
        DocTexture t;
        ASSERT_TRUE(quake::project_primitive(t, k.normal * 4096, {{{1, 0, 0}, {0, 1, 0}}}));
        EXPECT_TRUE(t.in_repeats);
        EXPECT_LT(length(t.u_axis - k.u), 1e-14) << k.normal.x << " " << k.normal.y << " " << k.normal.z;
        EXPECT_LT(length(t.v_axis - k.v), 1e-14) << k.normal.x << " " << k.normal.y << " " << k.normal.z;
        EXPECT_EQ(t.u_scale, 1);
        EXPECT_EQ(t.v_scale, 1);
    }
}

// Base axes lie in the face, at right angles, u level; the matrix is applied to coordinates along them.
TEST(Primitives, MatrixMapsTheFaceToRepeats) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> d(-1, 1);
    for (int i = 0; i < 1000; ++i) {
        const Vec3 n{d(random), d(random), d(random)};
        DocTexture base, t;
        ASSERT_TRUE(quake::project_primitive(base, n, {{{1, 0, 0}, {0, 1, 0}}}));
        EXPECT_NEAR(dot(base.u_axis, base.v_axis), 0, 1e-14);
        EXPECT_NEAR(dot(base.u_axis, n), 0, 1e-14);
        EXPECT_NEAR(dot(base.v_axis, n), 0, 1e-14);
        EXPECT_EQ(base.u_axis.z, 0);
        EXPECT_LE(base.v_axis.z, 0);
        const quake::TextureMatrix m = {{{d(random), d(random), d(random)}, {d(random), d(random), d(random)}}};
        ASSERT_TRUE(quake::project_primitive(t, n, m));
        const Vec3 p{d(random) * 512, d(random) * 512, d(random) * 512};
        const double x = dot(p, base.u_axis), y = dot(p, base.v_axis);
        EXPECT_NEAR(u_of(t, p), m[0][0] * x + m[0][1] * y + m[0][2], 1e-9);
        EXPECT_NEAR(v_of(t, p), m[1][0] * x + m[1][1] * y + m[1][2], 1e-9);
    }
}

TEST(Primitives, BrushDefKeepsItsPoints) {
    Context c;
    const Result<Document> d = read(
        world("// brush 0\n" + primitive("brushDef", "( 1280 0 256.5 ) ( 1280 -256 256.5 ) ( 768 0 256.5 ) ( ( 0.0078125 0 0.25 ) ( 0 0.00390625 -2 ) ) base/x 134217728 4 7\n"
                                                     "(0 0 0)(64 0 0)(0 64 0)((0.5 0 0)(0 0.5 0))\"with space\"\n") +
              "{\n( 0 0 0 ) ( 0 64 0 ) ( 64 0 0 ) a 0 0 0 1 1\n}\n"),
        c);
    ASSERT_TRUE(d) << to_text(d.fault().diagnostic);
    EXPECT_TRUE(c.diagnostics().empty()) << to_text(c.diagnostics()[0]);
    EXPECT_EQ(d->format, MapFormat::quake_mixed);
    ASSERT_EQ(d->entities[0].brushes.size(), 2u);
    const DocBrush& b = d->entities[0].brushes[0];
    ASSERT_EQ(b.sides.size(), 2u);
    EXPECT_EQ(b.sides[0].line, 7);
    EXPECT_EQ(b.sides[0].points[1][1].to_double(), -256);
    EXPECT_EQ(b.sides[0].points[2][2].mantissa, 2565);
    EXPECT_EQ(b.sides[0].material, "base/x");
    EXPECT_EQ(b.sides[0].contents, 134217728);
    EXPECT_EQ(b.sides[0].surface_flags, 4);
    EXPECT_EQ(b.sides[0].value, 7);
    const DocTexture& t = b.sides[0].texture; // of a face that looks up: u along y, v along x
    EXPECT_EQ(u_of(t, {0, 128, 0}), 1.25);
    EXPECT_EQ(v_of(t, {256, 0, 0}), -1);
    EXPECT_EQ(b.sides[1].material, "with space");
    EXPECT_FALSE(b.sides[1].has_content_flags);
    EXPECT_FALSE(d->entities[0].brushes[1].sides[0].texture.in_repeats);
}

TEST(Primitives, SingularMatricesAreTold) {
    Context c;
    const Result<Document> d = read(world(primitive("brushDef", "( 0 0 0 ) ( 0 64 0 ) ( 64 0 0 ) ( ( 1 2 0 ) ( 2 4 0 ) ) x 0 0 0\n"
                                                                "( 0 0 0 ) ( 0 64 0 ) ( 64 0 0 ) ( ( 0 0 0 ) ( 0 nan 0 ) ) x 0 0 0\n")), c);
    ASSERT_TRUE(d);
    EXPECT_EQ(std::ranges::count(c.diagnostics(), "texture-matrix-singular", &Diagnostic::code), 2);
    EXPECT_EQ(d->entities[0].brushes[0].sides[0].texture.u_scale, 64);
}

// Axial planes come out as the text has them, to the last of twelve decimals.
TEST(Primitives, AxialPlanesAreExact) {
    const struct {
        const char* plane;
        std::size_t axis;
        Decimal at;
        Vec3 outward;
    } cases[] = {
        {"( 0 0 1 -64 )", 2, {64, 0, true}, {0, 0, 1}},
        {"( 0 0 -1 -64 )", 2, {-64, 0, true}, {0, 0, -1}},
        {"( 1 0 0 100.3 )", 0, {-1003, -1, true}, {1, 0, 0}},
        {"( -1 -0 0 4096.000000123456 )", 0, {4096000000123456, -12, true}, {-1, 0, 0}},
        {"( 0 1 0 -131072 )", 1, {131072, 0, true}, {0, 1, 0}},
        {"( 0 -2 0 0.5 )", 1, {25, -2, true}, {0, -1, 0}},
        {"( 0 0 1 0 )", 2, {}, {0, 0, 1}},
    };
    for (const auto& k : cases) {
        Context c;
        const Result<Document> d = read(world(primitive("brushDef3", std::string(k.plane) + " ( ( 1 0 0 ) ( 0 1 0 ) ) \"x\" 0 0 0\n")), c);
        ASSERT_TRUE(d);
        ASSERT_TRUE(c.diagnostics().empty()) << to_text(c.diagnostics()[0]);
        const auto& points = d->entities[0].brushes[0].sides[0].points;
        for (const auto& p : points) {
            EXPECT_EQ(p[k.axis].mantissa, k.at.mantissa) << k.plane;
            EXPECT_EQ(p[k.axis].exponent, k.at.exponent) << k.plane;
        }
        EXPECT_EQ(normalize(quake::normal_of(points)), k.outward) << k.plane;
    }
}

// Any plane: over 4096 units about the point nearest to the origin the three points are true to 1e-6, and face outward.
TEST(Primitives, PlanesOfFourNumbersAreTrue) {
    std::mt19937 random(6);
    std::uniform_real_distribution<double> d(-1, 1);
    for (int i = 0; i < 2000; ++i) {
        Vec3 n = normalize(Vec3{d(random), d(random), i % 5 ? d(random) : 0});
        const double far = d(random) * (i % 2 ? 512 : 60000), size = i % 3 ? 1 : 1000;
        std::array<Decimal, 4> plane;
        const std::array<double, 4> numbers = {n.x * size, n.y * size, n.z * size, -far * size};
        for (std::size_t k = 0; k < 4; ++k) plane[k] = *parse_decimal(fmt::format("{:.12f}", numbers[k]));
        // What the text says, after its rounding:
        Vec3 stated{plane[0].to_double(), plane[1].to_double(), plane[2].to_double()};
        const double length_of = length(stated), distance = -plane[3].to_double() / length_of;
        stated = stated / length_of;
        const Vec3 shift = i % 7 ? Vec3{} : Vec3{16, -8.5, 1024};
        const auto points = quake::points_of_plane(plane, shift);
        ASSERT_TRUE(points);
        const Vec3 made = normalize(quake::normal_of(*points));
        const Vec3 p0{(*points)[0][0].to_double(), (*points)[0][1].to_double(), (*points)[0][2].to_double()};
        EXPECT_GT(dot(made, stated), 0.999999);
        const Vec3 foot = stated * distance + shift, u = normalize(cross(stated, Vec3{0.3, 0.5, 0.8})), v = cross(stated, u);
        for (int k = 0; k < 8; ++k) {
            const double angle = k * std::numbers::pi / 4;
            const Vec3 p = foot + (u * std::cos(angle) + v * std::sin(angle)) * 4096;
            EXPECT_LT(std::abs(dot(p - p0, made)), 1e-6) << i;
        }
    }
}

// The same slope as an editor would write it from points: exact on the grid although the normal is not.
TEST(Primitives, DiagonalsKeepWholeCoordinates) {
    Context c;
    const Result<Document> d = read(world(primitive("brushDef3", "( 0.70710678118654757 0 0.70710678118654757 -0 ) ( ( 1 0 0 ) ( 0 1 0 ) ) \"x\" 0 0 0\n")), c);
    ASSERT_TRUE(d);
    for (const auto& p : d->entities[0].brushes[0].sides[0].points)
        for (const Decimal& x : p) EXPECT_TRUE(x.on_grid(0)) << x.to_double();
}

// Planes of an entity are relative to its origin, points and textures are not; worldspawn has no origin.
TEST(Primitives, PlanesOfEntitiesMoveWithTheirOrigin) {
    const std::string plane = primitive("brushDef3", "\"key\" \"value\"\n( 0 0 1 -64 ) ( ( 0.5 0 3 ) ( 0 0.25 0 ) ) \"x\" 0 0 0\n"), points =
                      primitive("brushDef", "( 0 0 64 ) ( 0 64 64 ) ( 64 0 64 ) ( ( 0.5 0 3 ) ( 0 0.25 0 ) ) x 0 0 0\n");
    Context c;
    const Result<Document> d = read("Version 2\n{\n\"classname\" \"worldspawn\"\n\"origin\" \"1 2 3\"\n" + plane + "}\n{\n\"classname\" \"func_static\"\n\"origin\" \"10 20 30.25\"\n" +
                                        plane + points + "}\n",
                                    c);
    ASSERT_TRUE(d) << to_text(d.fault().diagnostic);
    EXPECT_TRUE(c.diagnostics().empty());
    const auto height = [&](std::size_t e, std::size_t b) { return d->entities[e].brushes[b].sides[0].points[0][2].to_double(); };
    EXPECT_EQ(height(0, 0), 64);
    EXPECT_EQ(height(1, 0), 94.25);
    EXPECT_EQ(height(1, 1), 64);
    EXPECT_EQ(u_of(d->entities[1].brushes[0].sides[0].texture, {0, 8, 0}), 7);
}

TEST(Primitives, FaultyRowsLeaveTheirBrushOut) {
    const struct {
        std::string name, row, code;
    } cases[] = {
        {"brushDef3", "( 0 0 0 -64 ) ( ( 1 0 0 ) ( 0 1 0 ) ) x", "plane-invalid"},
        {"brushDef3", "( 0 0 1 1e7 ) ( ( 1 0 0 ) ( 0 1 0 ) ) x", "plane-invalid"},
        {"brushDef3", "( 1e-300 0 0 64 ) ( ( 1 0 0 ) ( 0 1 0 ) ) x", "plane-invalid"},
        {"brushDef3", "( 1e400 0 1 64 ) ( ( 1 0 0 ) ( 0 1 0 ) ) x", "plane-invalid"},
        {"brushDef3", "( 0 nan 1 64 ) ( ( 1 0 0 ) ( 0 1 0 ) ) x", "coordinate-not-a-number"},
        {"brushDef3", "( 0 0 1 ) ( ( 1 0 0 ) ( 0 1 0 ) ) x", "row-unreadable"},
        {"brushDef", "( 0 0 0 ) ( 0 64 0 ) ( 64 0 0 ) ( ( 1 0 ) ( 0 1 0 ) ) x", "row-unreadable"},
        {"brushDef", "( 0 0 0 ) ( 0 64 0 ) ( 64 0 0 ) x 0 0 0 1 1", "row-unreadable"},
        {"brushDef", "( 0 0 0 ) ( 0 64 0 ) ( 64 0 2e5 ) ( ( 1 0 0 ) ( 0 1 0 ) ) x", "coordinate-out-of-range"},
    };
    for (const auto& k : cases) {
        Context c;
        const Result<Document> d = read(world(primitive(k.name, k.row + " 0 0 0\n") + primitive("brushDef3", "( 0 0 1 -64 ) ( ( 1 0 0 ) ( 0 1 0 ) ) ok\n")), c);
        ASSERT_TRUE(d) << k.row << to_text(d.fault().diagnostic);
        ASSERT_EQ(c.diagnostics().size(), 1u) << k.row;
        EXPECT_EQ(c.diagnostics()[0].code, k.code) << k.row;
        EXPECT_EQ(c.diagnostics()[0].where, (SourceLocation{"t.map", 6, 0, 0, 0})) << k.row;
        ASSERT_EQ(d->entities[0].brushes.size(), 1u) << k.row;
        EXPECT_EQ(d->entities[0].brushes[0].id, 1);
    }
}

std::string patch_points(int columns, int rows) {
    std::string out = "(\n";
    for (int c = 0; c < columns; ++c) {
        out += "( ";
        for (int r = 0; r < rows; ++r) out += fmt::format("( {} {} {}.5 {} -{} ) ", c * 16, r * 32, c * r, c / 2.0, r / 4.0);
        out += ")\n";
    }
    return out + ")\n";
}

TEST(Primitives, PatchesComeWhole) {
    Context c;
    const Result<Document> d =
        read(world("{\n( 0 0 0 ) ( 0 64 0 ) ( 64 0 0 ) a 0 0 0 1 1\n}\n" + primitive("patchDef2", "base/curve\n( 3 5 134217728 2 9 )\n" + patch_points(3, 5)) +
                   primitive("patchDef3", "\"textures/with space\"\n(7 3 4 6 1 0 0)\n" + patch_points(7, 3) + "\"key\" \"}\"\n")),
             c);
    ASSERT_TRUE(d) << to_text(d.fault().diagnostic);
    EXPECT_TRUE(c.diagnostics().empty()) << to_text(c.diagnostics()[0]);
    ASSERT_EQ(d->entities[0].brushes.size(), 1u);
    ASSERT_EQ(d->entities[0].patches.size(), 2u);
    const DocPatch& p = d->entities[0].patches[0];
    EXPECT_EQ(p.line, 7);
    EXPECT_EQ(p.id, 1);
    EXPECT_EQ(p.material, "base/curve");
    EXPECT_EQ(p.columns, 3u);
    EXPECT_EQ(p.rows, 5u);
    EXPECT_EQ(p.contents, 134217728);
    EXPECT_EQ(p.surface_flags, 2);
    EXPECT_EQ(p.value, 9);
    EXPECT_EQ(p.subdivisions, (std::array<std::uint32_t, 2>{0, 0}));
    ASSERT_EQ(p.points.size(), 15u);
    ASSERT_EQ(p.uv.size(), 15u);
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 5; ++row) {
            EXPECT_EQ(p.points[static_cast<std::size_t>(column * 5 + row)], (Vec3{column * 16.0, row * 32.0, column * row + 0.5}));
            EXPECT_EQ(p.uv[static_cast<std::size_t>(column * 5 + row)], (Vec2{column / 2.0, -row / 4.0}));
        }
    const DocPatch& q = d->entities[0].patches[1];
    EXPECT_EQ(q.material, "textures/with space");
    EXPECT_EQ(q.columns, 7u);
    EXPECT_EQ(q.subdivisions, (std::array<std::uint32_t, 2>{4, 6}));
    EXPECT_EQ(q.contents, 1);
    EXPECT_EQ(q.points.size(), 21u);
}

TEST(Primitives, FaultyPatchesAreToldAndLeftOut) {
    const struct {
        std::string text, code;
    } cases[] = {
        {"x\n( 4 3 0 0 0 )\n" + patch_points(4, 3), "patch-size-invalid"},
        {"x\n( 1 3 0 0 0 )\n" + patch_points(1, 3), "patch-size-invalid"},
        {"x\n( 4000000001 3 0 0 0 )\n(\n)\n", "patch-size-invalid"},
        {"x\n( -3 3 0 0 0 )\n(\n)\n", "patch-unreadable"},
        {"x\n( 3 3 0 0 )\n" + patch_points(3, 3), "patch-unreadable"},
        {"x\n( 3 3 0 0 0 )\n" + patch_points(2, 3), "patch-unreadable"},
        {"x\n( 3 3 0 0 0 )\n" + patch_points(3, 4), "patch-unreadable"},
        {"x\n( 3 3 0 0 0 )\n(\n( ( 0 0 nan 0 0 ) ) )\n", "patch-unreadable"},
        {"x\n( 3 3 0 0 0 )\n(\n( ( 0 0 1e6 0 0 ) ) )\n", "patch-unreadable"},
        {"x\n( 3 3 0 0 0 )\n(\n( ( 0 0 0 0 ) ) )\n", "patch-unreadable"},
        {"\n", "patch-unreadable"},
    };
    for (const auto& k : cases) {
        Context c;
        const Result<Document> d = read(world(primitive("patchDef2", k.text) + primitive("patchDef2", "x\n( 3 3 0 0 0 )\n" + patch_points(3, 3))), c);
        ASSERT_TRUE(d) << k.text << to_text(d.fault().diagnostic);
        ASSERT_EQ(d->entities[0].patches.size(), 1u) << k.text;
        EXPECT_EQ(d->entities[0].patches[0].id, 1);
        ASSERT_EQ(c.diagnostics().size(), 1u) << k.text;
        EXPECT_EQ(c.diagnostics()[0].code, k.code) << k.text;
        EXPECT_EQ(c.diagnostics()[0].severity, Severity::error);
        EXPECT_EQ(c.diagnostics()[0].where.brush, 0);
    }
}

// The three points of a row are the origin of its texture, 128 texels along and 128 texels up.
TEST(Primitives, QuarkPointsAreTheTexture) {
    for (const bool first : {true, false}) {
        const char* tag = first ? "//TX1" : "//TX2";
        for (const char* flags : {"", "1 2 3 "}) {
            Context c;
            const Result<Document> d = read(world(fmt::format("{{\n( 16 32 8 ) ( 16 96 8 ) ( 272 40 8 ) a 1 2 45 3 4 {}{}\n( 0 0 0 ) ( 0 64 0 ) ( 64 0 0 ) a 1 2 0 1 1\n}}\n", flags, tag)), c);
            ASSERT_TRUE(d);
            EXPECT_TRUE(c.diagnostics().empty());
            const DocSide& s = d->entities[0].brushes[0].sides[0];
            const Vec3 origin{16, 32, 8}, second{16, 96, 8}, third{272, 40, 8};
            const Vec3 along = first ? third : second, up = first ? second : third;
            EXPECT_NEAR(u_of(s.texture, origin), 0, 1e-10);
            EXPECT_NEAR(v_of(s.texture, origin), 0, 1e-10);
            EXPECT_NEAR(u_of(s.texture, along), 128, 1e-10);
            EXPECT_NEAR(v_of(s.texture, along), 0, 1e-10);
            EXPECT_NEAR(u_of(s.texture, up), 0, 1e-10);
            EXPECT_NEAR(v_of(s.texture, up), -128, 1e-10);
            EXPECT_EQ(s.texture.u_axis.z, 0); // across the face nothing changes
            EXPECT_EQ(s.has_content_flags, *flags != '\0');
            EXPECT_EQ(d->entities[0].brushes[0].sides[1].texture.u_shift, 1); // the comment belongs to its own row
        }
    }
}

} // namespace
} // namespace kiln

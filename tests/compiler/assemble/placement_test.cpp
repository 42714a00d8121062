#include "compiler/assemble/placement.h"
#include "tests/compiler/assemble/files.h"
#include <set>

namespace kiln::test {
namespace {

using namespace assemble_detail;

// Quarter turns by hand: roll about x, then pitch about y, then yaw about z, each right-handed.
Vec3 turned(Vec3 v, int pitch, int yaw, int roll) {
    for (int i = 0; i < roll; ++i) v = {v.x, -v.z, v.y};
    for (int i = 0; i < pitch; ++i) v = {v.z, v.y, -v.x};
    for (int i = 0; i < yaw; ++i) v = {-v.y, v.x, v.z};
    return v;
}

TEST(Decimals, SumsAndProductsAreExact) {
    const auto d = [](const char* text) { return *parse_decimal(text); };
    EXPECT_EQ(to_text(sum(d("0.1"), d("0.2"))), "0.3");
    EXPECT_EQ(to_text(sum(d("-0.001"), d("1000"))), "999.999");
    EXPECT_EQ(to_text(sum(d("131072"), d("0.0000000001"))), "131072.0000000001");
    EXPECT_EQ(to_text(sum(d("5"), d("-5"))), "0");
    EXPECT_EQ(to_text(product(d("1.5"), d("-0.3"))), "-0.45");
    EXPECT_EQ(to_text(d("1200")), "1200");
    EXPECT_FALSE(sum(d("100000000000000000"), d("0.001")).exact);
    EXPECT_TRUE(sum(d("131071.9999"), d("0.0001")).exact);
    EXPECT_EQ(to_text(rounded_decimal(-0.25)), "-0.25");
}

TEST(Angles, TheSourceConvention) {
    // A positive pitch looks down, yaw turns left, roll lifts the left side.
    EXPECT_EQ((matrix_of_angles({90, 0, 0}) * Vec3{1, 0, 0}), (Vec3{0, 0, -1}));
    EXPECT_EQ((matrix_of_angles({0, 90, 0}) * Vec3{1, 0, 0}), (Vec3{0, 1, 0}));
    EXPECT_EQ((matrix_of_angles({0, 0, 90}) * Vec3{0, 1, 0}), (Vec3{0, 0, 1}));
}

TEST(Angles, ComeBackFromTheirMatrix) {
    for (int p = -80; p <= 80; p += 40)
        for (int y = -170; y <= 180; y += 50)
            for (int r = -170; r <= 180; r += 70) {
                const Vec3 a = angles_of_matrix(matrix_of_angles({double(p), double(y), double(r)}));
                EXPECT_NEAR(a.x, p, 1e-9);
                EXPECT_NEAR(a.y, y, 1e-9);
                EXPECT_NEAR(a.z, r, 1e-9);
            }
    // Straight up and down: some angles of the same rotation.
    for (const double p : {90.0, -90.0})
        for (const double y : {0.0, 30.0}) {
            const Matrix m = matrix_of_angles({p, y, 20}), n = matrix_of_angles(angles_of_matrix(m));
            for (std::size_t i = 0; i < 3; ++i) EXPECT_LT(length(m[i] - n[i]), 1e-12);
        }
}

TEST(Placement, TwentyFourRotationsAreExact) {
    std::set<std::array<int, 9>> different;
    for (int p = 0; p < 4; ++p)
        for (int y = 0; y < 4; ++y)
            for (int r = 0; r < 4; ++r) {
                Placement place;
                place.rotation = matrix_of_angles({p * 90.0 - 360, y * 90.0 + 720, r * -270.0});
                place.origin = {*parse_decimal("0.1"), *parse_decimal("-1000.03"), *parse_decimal("7")};
                ASSERT_TRUE(place.quarter_turns());
                std::array<int, 9> m{};
                for (std::size_t i = 0; i < 9; ++i) m[i] = static_cast<int>(place.rotation[i / 3][i % 3]);
                different.insert(m);
                const DecimalPoint q = place.point({*parse_decimal("16384.123456789"), *parse_decimal("-0.7"), *parse_decimal("3")});
                const Vec3 hand = turned({16384.123456789, -0.7, 3}, p, y, r) + Vec3{0.1, -1000.03, 7};
                for (std::size_t k = 0; k < 3; ++k) {
                    EXPECT_TRUE(q[k].exact);
                    EXPECT_NEAR(q[k].to_double(), hand[k], 1e-10);
                }
                // Back again, to the digit.
                Placement back;
                back.rotation = transposed(place.rotation);
                const DecimalPoint at{sum(q[0], *parse_decimal("-0.1")), sum(q[1], *parse_decimal("1000.03")), sum(q[2], *parse_decimal("-7"))};
                EXPECT_EQ(to_text(back.point(at)[0]), "16384.123456789");
                EXPECT_EQ(to_text(back.point(at)[1]), "-0.7");
            }
    EXPECT_EQ(different.size(), 24u);
}

TEST(Placement, OtherAnglesKeepPlanesTrue) {
    // Points one unit apart, of a face that reaches across the map: rounding them must not tilt it.
    Placement place;
    place.rotation = matrix_of_angles({13, 37.5, 71});
    place.origin = {*parse_decimal("12000"), *parse_decimal("-9000"), *parse_decimal("4000")};
    std::array<Vec3, 3> p;
    const char* texts[3][3] = {{"100", "200", "300"}, {"101", "200", "300"}, {"100", "201", "300"}};
    for (std::size_t i = 0; i < 3; ++i) p[i] = to_vec(place.point({*parse_decimal(texts[i][0]), *parse_decimal(texts[i][1]), *parse_decimal(texts[i][2])}));
    const Vec3 n = normalize(cross(p[1] - p[0], p[2] - p[0]));
    EXPECT_LT(std::fabs(dot(n, place.point(Vec3{-16000, 16000, 300}) - p[0])), 1e-4);
}

TEST(Placement, ADisplacementGoesWhereItsInstanceTurns) {
    // The law: every vertex of the placed grid is the placed vertex of the grid. (The original compiler leaves the
    // directions as they were.)
    DocDisplacement d;
    d.power = 2;
    d.start = {-64, -64, 8};
    for (int i = 0; i < 25; ++i) {
        d.normals.push_back(normalize(Vec3{0.1 * i, 0.3, 1}));
        d.distances.push_back(3.0 * i - 20);
        d.offsets.push_back({i * 0.5, -1, i % 3 * 1.0});
        d.offset_normals.push_back({0, 0, 1});
    }
    const auto vertex = [](const DocDisplacement& g, Vec3 base, std::size_t i) { return base + g.normals[i] * g.distances[i] + g.offsets[i]; };
    for (const Vec3 angles : {Vec3{0, 90, 0}, Vec3{90, 180, 270}, Vec3{12, 34, 56}})
        for (const char* scale : {"1", "2.5"}) {
            Placement place;
            place.rotation = matrix_of_angles(angles);
            place.origin = {*parse_decimal("5"), *parse_decimal("6"), *parse_decimal("-7")};
            place.scale.fill(*parse_decimal(scale));
            DocDisplacement moved = d;
            assemble_detail::place(moved, place);
            EXPECT_LT(length(moved.start - place.point(d.start)), 1e-12);
            for (std::size_t i = 0; i < 25; ++i) {
                const Vec3 base = d.start + Vec3{double(i % 5) * 32, double(i / 5) * 32, 0};
                EXPECT_LT(length(vertex(moved, place.point(base), i) - place.point(vertex(d, base, i))), 1e-9);
                EXPECT_NEAR(length(moved.normals[i]), 1, 1e-12);
                EXPECT_LT(length(moved.offset_normals[i] - place.direction({0, 0, 1})), 1e-12);
            }
        }
}

} // namespace
} // namespace kiln::test

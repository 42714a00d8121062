// Form factors of each method against closed forms, and where the rules of old are known to fail.
#include "compiler/light/rivals/rivals.h"
#include <gtest/gtest.h>

using namespace kiln;
using namespace kiln::rivals;

namespace {
using Polygon = std::vector<Vec3>;
// Facing down, over the origin.
Polygon ceiling(double x0, double x1, double y0, double y1, double z) { return {{x0, y0, z}, {x0, y1, z}, {x1, y1, z}, {x1, y0, z}}; }
// A wall in the plane x = 0 that faces +x.
Polygon wall(double y0, double y1, double z0, double z1) { return {{0, y0, z0}, {0, y1, z0}, {0, y1, z1}, {0, y0, z1}}; }
constexpr Vec3 kUp{0, 0, 1};
double relative(double got, double exact) { return got / exact - 1; }
} // namespace

// Pixels are weighted by their exact factors, so their sum is 1 at any resolution; the top's share is the factor of a
// square of side 2 at height 1. Counting pixels would give it a third.
TEST(RivalHemicube, WeightsSumToOne) {
    for (const std::uint32_t r : {2u, 8u, 16u, 64u}) {
        const auto pixels = hemicube_pixels(r);
        EXPECT_EQ(pixels.size(), 3 * r * r);
        double sum = 0, top = 0, count = 0;
        for (const HemicubePixel& p : pixels) {
            EXPECT_GT(p.weight, 0);
            EXPECT_GT(p.direction.z, 0);
            sum += p.weight;
            const bool is_top = p.direction.z >= std::max(std::abs(p.direction.x), std::abs(p.direction.y));
            if (is_top) top += p.weight, ++count;
        }
        EXPECT_NEAR(sum, 1, 1e-12);
        EXPECT_NEAR(top, 0.5541264240, 1e-9);
        EXPECT_DOUBLE_EQ(count / static_cast<double>(pixels.size()), 1.0 / 3);
    }
}

TEST(RivalMatrix, CorrectedFactorIsExact) {
    const MatrixRule rule = MatrixRule::corrected;
    EXPECT_NEAR(matrix_factor(rule, {}, kUp, ceiling(0, 1, 0, 1, 1)), 0.1385316060, 1e-9);
    EXPECT_NEAR(matrix_factor(rule, {}, kUp, ceiling(-1, 1, -1, 1, 1)), 0.5541264240, 1e-9);
    EXPECT_NEAR(matrix_factor(rule, {}, kUp, ceiling(-0.5, 0.5, -0.5, 0.5, 1)), 0.2394564705, 1e-9);
    EXPECT_NEAR(matrix_factor(rule, {1, 0, 0}, kUp, wall(0, 1, 0, 1)), 0.0557341970, 1e-9);
    // Half of it below the horizon; unclipped it would be 0.
    EXPECT_NEAR(matrix_factor(rule, {1, 0, 0}, kUp, wall(-0.5, 0.5, -0.5, 0.5)), 0.0278553824, 1e-9);
}

// The asin of the published rule folds edge angles beyond 90 degrees back: factors near a long edge come out up to a
// thousand times too small. Values of a separate computation.
TEST(RivalMatrix, AsinFoldsWideAngles) {
    struct Case { Vec3 x; Polygon polygon; double exact, folded; };
    for (const Case& c : {Case{{}, ceiling(-1.5, 1.5, -0.5, 0.5, 1), 0.408164, 0.325670}, Case{{}, ceiling(-4, 4, -0.5, 0.5, 1), 0.444149, 0.152130},
                          Case{{0.1, 0, 0}, wall(-0.5, 0.5, 0, 1), 0.422545, 0.048211}, Case{{0.1, 0, 0}, wall(-2, 2, 0, 1), 0.449094, 0.001154}}) {
        EXPECT_NEAR(matrix_factor(MatrixRule::corrected, c.x, kUp, c.polygon), c.exact, 2e-6);
        EXPECT_NEAR(matrix_factor(MatrixRule::vrad, c.x, kUp, c.polygon), c.folded, 2e-6);
    }
}

// The rule of middles on two unit squares that share an edge, n patches a side: the whole factor gets better, that of the
// pair which touches never does.
TEST(RivalMatrix, MiddlesFailWhereSquaresTouch) {
    constexpr double kExact = 0.2000437761;
    const double whole[] = {0.318310, 0.264046, 0.232992, 0.216744};
    const double whole_near[] = {0.190136, 0.198039, 0.200146, 0.200397};
    int n = 1;
    for (const std::size_t row : {0u, 1u, 2u, 3u}) {
        double sum = 0, sum_near = 0;
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n; ++j)
                for (int k = 0; k < n; ++k)
                    for (int l = 0; l < n; ++l) {
                        const double h = 1.0 / n;
                        const Vec3 x{(i + 0.5) * h, (j + 0.5) * h, 0};
                        const Polygon p = wall(k * h, (k + 1) * h, l * h, (l + 1) * h);
                        sum += matrix_factor(MatrixRule::centre, x, kUp, p) * h * h;
                        sum_near += matrix_factor(MatrixRule::corrected, x, kUp, p) * h * h;
                    }
        EXPECT_NEAR(sum, whole[row], 1e-6);
        EXPECT_NEAR(sum_near, whole_near[row], 1e-6);
        const double h = 1.0 / n;
        EXPECT_NEAR(relative(matrix_factor(MatrixRule::centre, {h / 2, h / 2, 0}, kUp, wall(0, h, 0, h)), kExact), 0.591, 0.001) << n;
        EXPECT_NEAR(relative(matrix_factor(MatrixRule::corrected, {h / 2, h / 2, 0}, kUp, wall(0, h, 0, h)), kExact), -0.050, 0.001) << n;
        n *= 2;
    }
}

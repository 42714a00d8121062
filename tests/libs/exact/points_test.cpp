#include "libs/exact/points.h"
#include "rational.h"
#include <gtest/gtest.h>

namespace kiln::test {
namespace {

struct Met {
    PlaneTriple planes;
    RationalPoint x;
};

// Three random planes of any magnitude, and companions that share two of them: points on one line.
TEST(Points, OrderAndTurnAgreeWithRationalArithmetic) {
    std::mt19937_64 rng(7);
    int zeros = 0, asked = 0;
    for (const std::int64_t range : {std::int64_t{4}, std::int64_t{4096}, std::int64_t{1} << 20, kMaxGridCoordinate}) {
        PlaneTable t;
        std::vector<PlaneId> ids;
        for (int i = 0; i < 9; ++i) ids.push_back(random_plane(t, rng, range));
        std::vector<Met> points;
        for (std::size_t i = 0; i < 9; ++i) {
            const PlaneTriple triple{ids[i < 5 ? 0 : 2], ids[i < 5 ? 1 : i - 2], ids[(i + 3) % 9]};
            if (triple[0] == triple[1] || triple[1] == triple[2] || triple[0] == triple[2]) continue;
            if (const auto x = solve(t, triple[0], triple[1], triple[2])) points.push_back({triple, *x});
        }
        for (const Met& a : points)
            for (const Met& b : points) {
                for (std::size_t k = 0; k < 3; ++k)
                    ASSERT_EQ(compare_along(t, a.planes, b.planes, k), Rational(a.x[k] - b.x[k]).sign());
                for (const Met& c : points)
                    for (std::size_t u = 0; u < 3; ++u) {
                        const std::size_t v = (u + 1) % 3;
                        const Rational s = (b.x[u] - a.x[u]) * (c.x[v] - a.x[v]) - (b.x[v] - a.x[v]) * (c.x[u] - a.x[u]);
                        ASSERT_EQ(turn(t, a.planes, b.planes, c.planes, u, v), s.sign());
                        ASSERT_EQ(turn(t, a.planes, b.planes, c.planes, v, u), -s.sign());
                        zeros += s == 0, ++asked;
                    }
            }
    }
    EXPECT_GT(asked, 1000);
    EXPECT_GT(zeros, asked / 20); // three on the line of two shared planes
}

} // namespace
} // namespace kiln::test

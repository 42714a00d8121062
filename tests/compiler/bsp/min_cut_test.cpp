#include "compiler/bsp/min_cut.h"
#include <bit>
#include <gtest/gtest.h>

#include <random>

namespace kiln::bsp {
namespace {

struct Edge {
    std::uint32_t a, b;
    int capacity;
};

double cost(const std::vector<Edge>& edges, std::uint32_t side) {
    double sum = 0;
    for (const Edge& e : edges)
        if ((side >> e.a & 1) != (side >> e.b & 1)) sum += e.capacity;
    return sum;
}

// Against every way to divide the nodes: the least cost, and of all divisions of that cost the smallest source side.
TEST(MinCut, IsTheLeastOfAllDivisions) {
    std::mt19937 random(5);
    for (int round = 0; round < 200; ++round) {
        const std::uint32_t nodes = 4 + random() % 6;
        std::vector<Edge> edges;
        for (std::uint32_t i = 0; i < 2 * nodes; ++i) {
            const std::uint32_t a = random() % nodes, b = random() % nodes;
            if (a != b) edges.push_back({a, b, 1 + static_cast<int>(random() % 5)});
        }
        const std::uint32_t from = 0, from_too = 1, to = nodes - 1;
        MinCut cut(nodes);
        for (std::uint32_t i = 0; i < edges.size(); ++i) cut.connect(edges[i].a, edges[i].b, edges[i].capacity, i);
        cut.source(from), cut.source(from_too), cut.sink(to);
        const auto found = cut.run(1'000'000);
        ASSERT_TRUE(found);
        double least = 1e30;
        std::uint32_t best = 0;
        for (std::uint32_t side = 0; side < 1u << nodes; ++side) {
            if (!(side >> from & 1) || !(side >> from_too & 1) || side >> to & 1) continue;
            const double c = cost(edges, side);
            if (c < least || (c == least && std::popcount(side) < std::popcount(best))) least = c, best = side;
        }
        std::vector<std::uint32_t> expected;
        for (std::uint32_t i = 0; i < edges.size(); ++i)
            if ((best >> edges[i].a & 1) != (best >> edges[i].b & 1)) expected.push_back(i);
        EXPECT_EQ(*found, expected) << "round " << round;
    }
}

TEST(MinCut, GivesUpWhenTold) {
    MinCut cut(100);
    for (std::uint32_t i = 0; i < 99; ++i) cut.connect(i, i + 1, 1, i);
    cut.source(0), cut.sink(99);
    EXPECT_FALSE(cut.run(50));
}

} // namespace
} // namespace kiln::bsp

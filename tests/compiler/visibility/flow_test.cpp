// The flow of one way, put down and divided.
#include "compiler/visibility/flow.h"
#include "tests/compiler/visibility/grid_map.h"
#include <gtest/gtest.h>
#include <numeric>
#include <random>

namespace kiln {
namespace {

using namespace vis;

struct Map {
    DirectedPortals portals;
    Exits exits;
    Windows windows;
    Context context;
    std::function<bool()> stop = [] { return false; };
    SparseRows reach;
    Passages passages;
    FlowInput input{&portals, &exits, &windows, &reach, &passages, 1e-3, &stop};
    explicit Map(const test::GridMap& map)
        : portals(directed_portals(map.portals)), exits(exits_of(portals, map.cluster_count)), windows(portals), reach(flood(portals, exits, 0, stop, context)), passages(portals, exits, reach, 1e-3, std::size_t{1} << 30, stop, context) {}
};
test::GridMap random_map(std::mt19937& random) {
    std::vector<std::string> rows(9, std::string(9, '.'));
    for (std::string& row : rows)
        for (char& cell : row)
            if (random() % 10 < 3) cell = '#';
    return test::grid_map(rows);
}
// Some cells and those beside them are one cluster: no longer convex, a chain may come back into it.
test::GridMap joined(test::GridMap map, std::mt19937& random) {
    std::vector<std::uint32_t> into(map.cluster_count);
    std::iota(into.begin(), into.end(), 0u);
    const auto root = [&](std::uint32_t c) {
        while (into[c] != c) c = into[c];
        return c;
    };
    for (const VisPortal& p : map.portals)
        if (random() % 10 < 4) into[root(p.cluster_front)] = root(p.cluster_back);
    for (VisPortal& p : map.portals) p.cluster_front = root(p.cluster_front), p.cluster_back = root(p.cluster_back);
    std::erase_if(map.portals, [](const VisPortal& p) { return p.cluster_front == p.cluster_back; });
    return map;
}
// Every chain leads from the way to what it was added for, each portal of it out of the cluster the one before leads to.
void expect_chains(const Map& m, std::uint32_t way, const FlowFound& found) {
    for (const Chains* chains : {&found.witnesses, &found.lines})
        for (std::size_t i = 0; i < chains->size(); ++i) {
            const auto chain = (*chains)[i];
            ASSERT_GE(chain.size(), 2u);
            EXPECT_EQ(chain[0], way);
            for (std::size_t k = 1; k < chain.size(); ++k) EXPECT_EQ(m.portals.ways[chain[k]].from, m.portals.ways[chain[k - 1]].to);
        }
}

// Put down after a few steps, again and again, and each time shared out among parts that know nothing of each other:
// together they find what one finds that goes through.
TEST(Flow, PartsFindWhatTheWholeFinds) {
    std::mt19937 random(5);
    std::size_t divided = 0;
    for (int trial = 0; trial < 24; ++trial) {
        const test::GridMap grid = random_map(random);
        const Map m(trial % 2 ? joined(grid, random) : grid);
        for (std::uint32_t way = 0; way < m.portals.ways.size(); ++way) {
            std::vector<std::uint64_t> whole(m.reach.words(), 0);
            FlowFound all;
            ASSERT_EQ(Flow(m.input, way, whole.data()).go(0, whole.data(), all), FlowEnd::done);
            expect_chains(m, way, all);
            for (const std::uint64_t steps : {1, 3, 20})
                for (const std::size_t parts : {1, 2, 5}) {
                    std::vector<std::uint64_t> together(m.reach.words(), 0);
                    std::vector<std::pair<Flow, std::vector<std::uint64_t>>> flows{{Flow(m.input, way, together.data()), together}};
                    while (!flows.empty()) {
                        auto [flow, seen] = std::move(flows.back());
                        flows.pop_back();
                        FlowFound found;
                        const FlowEnd end = flow.go(steps, seen.data(), found);
                        expect_chains(m, way, found);
                        for (std::size_t w = 0; w < seen.size(); ++w) together[w] |= seen[w];
                        if (end == FlowEnd::done) continue;
                        ASSERT_EQ(end, FlowEnd::over_budget);
                        EXPECT_EQ(found.steps, steps);
                        const std::vector<Flow::Branch> left = flow.left();
                        const std::size_t count = std::min(parts, left.size());
                        divided += count > 1;
                        for (std::size_t k = 0; k < count; ++k) flows.emplace_back(flow.part(std::span(left).subspan(k * left.size() / count, (k + 1) * left.size() / count - k * left.size() / count)), seen);
                    }
                    ASSERT_EQ(together, whole) << trial << " " << way << " " << steps << " " << parts;
                }
        }
    }
    EXPECT_GT(divided, 1000u);
}

// The steps in which it is gone through do not change what is found, nor how many there are.
TEST(Flow, PutDownAndTakenUpAgainItIsTheSame) {
    std::mt19937 random(6);
    const Map m(random_map(random));
    for (std::uint32_t way = 0; way < m.portals.ways.size(); ++way) {
        std::vector<std::uint64_t> whole(m.reach.words(), 0), seen = whole;
        FlowFound all, found;
        Flow(m.input, way, whole.data()).go(0, whole.data(), all);
        Flow flow(m.input, way, seen.data());
        while (flow.go(2, seen.data(), found) == FlowEnd::over_budget) {}
        EXPECT_EQ(seen, whole);
        EXPECT_EQ(found.steps, all.steps);
        ASSERT_EQ(found.witnesses.size(), all.witnesses.size());
        for (std::size_t i = 0; i < all.witnesses.size(); ++i) EXPECT_TRUE(std::ranges::equal(found.witnesses[i], all.witnesses[i]));
    }
}

} // namespace
} // namespace kiln

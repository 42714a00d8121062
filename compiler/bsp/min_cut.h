// Private to bsp: minimum cut of an undirected graph, E. Dinic 1970. Capacities are areas, counted in whole
// 1/1024 square units so that the flow is exact and the cut the same everywhere.
#pragma once
#include <cstdint>
#include <optional>
#include <vector>

namespace kiln::bsp {

class MinCut {
public:
    explicit MinCut(std::size_t nodes) : edges_of_(nodes + 2) {}
    void connect(std::uint32_t a, std::uint32_t b, double capacity, std::uint32_t tag);
    void source(std::uint32_t node);
    void sink(std::uint32_t node);
    // Tags of the cut edges, ascending: of all cuts of least capacity the one nearest to the sources. No node may
    // be source and sink. Nothing where that takes more than `budget` steps along edges.
    std::optional<std::vector<std::uint32_t>> run(std::uint64_t budget);

private:
    struct Edge { // its reverse is edge ^ 1
        std::uint32_t to;
        std::int64_t left;
        std::uint32_t tag;
    };
    std::vector<Edge> edges_;
    std::vector<std::vector<std::uint32_t>> edges_of_; // the last two nodes: source, sink
    std::vector<int> level_;
    std::vector<std::size_t> next_;
    std::uint32_t s() const { return static_cast<std::uint32_t>(edges_of_.size() - 2); }
    std::uint32_t t() const { return static_cast<std::uint32_t>(edges_of_.size() - 1); }
    void add(std::uint32_t a, std::uint32_t b, std::int64_t forth, std::int64_t back, std::uint32_t tag);
    bool levels();
    void block();
    std::uint64_t steps_ = 0, budget_ = 0;
};

} // namespace kiln::bsp

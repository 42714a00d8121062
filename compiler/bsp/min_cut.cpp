#include "compiler/bsp/min_cut.h"
#include <algorithm>
#include <cmath>

namespace kiln::bsp {
namespace {
constexpr std::int64_t kEndless = std::int64_t{1} << 60;
constexpr std::uint32_t kNoTag = UINT32_MAX;
} // namespace

void MinCut::add(std::uint32_t a, std::uint32_t b, std::int64_t forth, std::int64_t back, std::uint32_t tag) {
    edges_of_[a].push_back(static_cast<std::uint32_t>(edges_.size()));
    edges_.push_back({b, forth, tag});
    edges_of_[b].push_back(static_cast<std::uint32_t>(edges_.size()));
    edges_.push_back({a, back, tag});
}

void MinCut::connect(std::uint32_t a, std::uint32_t b, double capacity, std::uint32_t tag) {
    const auto c = static_cast<std::int64_t>(std::clamp(capacity * 1024, 1.0, 0x1p50));
    add(a, b, c, c, tag);
}
void MinCut::source(std::uint32_t node) { add(s(), node, kEndless, 0, kNoTag); }
void MinCut::sink(std::uint32_t node) { add(node, t(), kEndless, 0, kNoTag); }

bool MinCut::levels() {
    level_.assign(edges_of_.size(), -1);
    level_[s()] = 0;
    steps_ += edges_.size();
    std::vector<std::uint32_t> queue{s()};
    for (std::size_t i = 0; i < queue.size(); ++i)
        for (const std::uint32_t e : edges_of_[queue[i]])
            if (edges_[e].left > 0 && level_[edges_[e].to] < 0)
                level_[edges_[e].to] = level_[queue[i]] + 1, queue.push_back(edges_[e].to);
    return level_[t()] >= 0;
}

// Paths of the level graph until none is left, walked without recursion: the graph may be as deep as the map has
// leaves. After a path the walk goes on from the first edge that it filled, not from the source.
void MinCut::block() {
    std::vector<std::uint32_t> path;
    std::uint32_t at = s();
    while (steps_ <= budget_) {
        if (at == t()) {
            std::int64_t flow = kEndless;
            for (const std::uint32_t e : path) flow = std::min(flow, edges_[e].left);
            std::size_t keep = path.size();
            for (std::size_t i = path.size(); i-- > 0;) {
                edges_[path[i]].left -= flow, edges_[path[i] ^ 1].left += flow;
                if (edges_[path[i]].left == 0) keep = i;
            }
            steps_ += path.size();
            at = edges_[path[keep] ^ 1].to;
            path.resize(keep);
        }
        bool stepped = false;
        for (std::size_t& i = next_[at]; i < edges_of_[at].size(); ++i) {
            ++steps_;
            const Edge& e = edges_[edges_of_[at][i]];
            if (e.left > 0 && level_[e.to] == level_[at] + 1) {
                path.push_back(edges_of_[at][i]);
                at = e.to;
                stepped = true;
                break;
            }
        }
        if (stepped) continue;
        if (path.empty()) return;
        level_[at] = -1; // dead end
        at = edges_[path.back() ^ 1].to;
        path.pop_back();
    }
}

std::optional<std::vector<std::uint32_t>> MinCut::run(std::uint64_t budget) {
    budget_ = budget;
    while (levels()) {
        next_.assign(edges_of_.size(), 0);
        block();
        if (steps_ > budget_) return std::nullopt;
    }
    std::vector<std::uint32_t> cut; // level_ >= 0: still reached from the sources
    for (std::uint32_t n = 0; n < edges_of_.size(); ++n)
        for (const std::uint32_t e : edges_of_[n])
            if (edges_[e].tag != kNoTag && level_[n] >= 0 && level_[edges_[e].to] < 0) cut.push_back(edges_[e].tag);
    std::ranges::sort(cut);
    return cut;
}

} // namespace kiln::bsp

#include "compiler/visibility/merge.h"
#include "compiler/visibility/directed.h"
#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>
#include <tuple>

namespace kiln {

using namespace vis;

namespace {

using Pairs = std::span<const std::array<std::uint32_t, 2>>;

// Rows stay rows over the clusters of before: a group's members are all in a row or none is, and the leaves in it can be counted.
class Groups {
public:
    Groups(const Visibility& v, std::span<const std::uint32_t> leaves, Pairs neighbours, Pairs apart, double percent)
        : leaves_(leaves), rows_(v.cluster_count, v.cluster_count), of_(v.cluster_count), members_(v.cluster_count), next_(v.cluster_count), apart_(v.cluster_count), version_(v.cluster_count, 0) {
        rows_.data() = v.rows;
        std::iota(of_.begin(), of_.end(), 0u);
        for (std::uint32_t c = 0; c < v.cluster_count; ++c) {
            members_[c] = {c}, size_.push_back(leaves[c]), seen_.push_back(0);
            each(rows_.row(c), nullptr, [&](std::uint32_t x) { seen_[c] += leaves[x]; });
            most_.push_back(std::floor(static_cast<double>(seen_[c]) * (1 + percent / 100)));
        }
        for (const auto& [a, b] : neighbours)
            if (a != b && v.sees(a, b)) next_[a].push_back(b), next_[b].push_back(a);
        for (const auto& [a, b] : apart) apart_[a].push_back(b);
        for (std::uint32_t c = 0; c < v.cluster_count; ++c) offer_all(c);
    }
    double mean_seen() const {
        std::uint64_t pairs = 0, leaves = 0;
        for (std::uint32_t c = 0; c < of_.size(); ++c)
            if (of_[c] == c) pairs += size_[c] * seen_[c], leaves += size_[c];
        return leaves ? static_cast<double>(pairs) / static_cast<double>(leaves) : 0;
    }
    void join_all(const Context& context) {
        while (!offers_.empty()) {
            context.check_cancelled();
            const Offer best = offers_.top();
            offers_.pop();
            if (of_[best.a] != best.a || of_[best.b] != best.b || best.version != version_[best.a] + version_[best.b]) continue;
            const std::uint64_t now = cost(best.a, best.b); // rows grow by joins elsewhere
            if (now > best.cost) offers_.push({now, best.a, best.b, best.version});
            else if (within_bound(best.a, best.b)) join(best.a, best.b);
        }
    }
    MergedClusters result(const Visibility& v) const {
        MergedClusters out;
        out.of.resize(of_.size());
        std::vector<std::uint32_t> roots;
        for (std::uint32_t c = 0; c < of_.size(); ++c) // in order of their first members, which are the roots
            if (of_[c] == c) {
                for (const std::uint32_t m : members_[c]) out.of[m] = static_cast<std::uint32_t>(roots.size());
                roots.push_back(c);
            }
        Visibility& to = out.visibility;
        to.cluster_count = static_cast<std::uint32_t>(roots.size()), to.loose = v.loose, to.steps = v.steps;
        to.rows.assign(to.words_per_row() * roots.size(), 0);
        for (std::size_t r = 0; r < roots.size(); ++r)
            each(rows_.row(roots[r]), nullptr, [&](std::uint32_t x) { set_bit(to.rows.data() + r * to.words_per_row(), out.of[x]); });
        if (!v.shut.empty()) to.shut.assign(to.rows.size(), 0);
        for (std::uint32_t c = 0; c < of_.size() && !v.shut.empty(); ++c)
            each(v.shut.data() + c * v.words_per_row(), nullptr, [&](std::uint32_t x) { set_bit(to.shut.data() + out.of[c] * to.words_per_row(), out.of[x]); });
        return out;
    }

private:
    struct Offer {
        std::uint64_t cost;
        std::uint32_t a, b, version;
        bool operator<(const Offer& o) const { return std::tie(cost, a, b) > std::tie(o.cost, o.a, o.b); } // the least first
    };
    std::span<const std::uint32_t> leaves_;
    BitRows rows_;
    std::vector<std::uint32_t> of_; // itself: it is a group, named for its first member
    std::vector<std::vector<std::uint32_t>> members_, next_, apart_;
    std::vector<std::uint32_t> version_; // how often it has grown: offers of before are void
    std::vector<std::uint64_t> size_, seen_; // leaves in it and in its row
    std::vector<double> most_;               // leaves that its row may come to
    std::priority_queue<Offer> offers_;

    // Of the bits of `row` that are not in `without`.
    template <class F> void each(const std::uint64_t* row, const std::uint64_t* without, F&& f) const {
        for (std::size_t w = 0; w < rows_.words(); ++w) each_bit(w, row[w] & ~(without ? without[w] : 0), f);
    }
    std::uint64_t gain(std::uint32_t a, std::uint32_t b) const { // leaves that b sees and a does not
        std::uint64_t n = 0;
        each(rows_.row(b), rows_.row(a), [&](std::uint32_t x) { n += leaves_[x]; });
        return n;
    }
    std::uint64_t cost(std::uint32_t a, std::uint32_t b) const { return size_[a] * gain(a, b) + size_[b] * gain(b, a); } // half the pairs it adds
    void offer_all(std::uint32_t c) {
        std::ranges::sort(next_[c]);
        next_[c].erase(std::unique(next_[c].begin(), next_[c].end()), next_[c].end());
        for (const std::uint32_t other : next_[c]) offers_.push({cost(c, other), std::min(c, other), std::max(c, other), version_[c] + version_[other]});
    }
    bool within_bound(std::uint32_t a, std::uint32_t b) const {
        bool within = true;
        for (const auto& [one, other] : {std::pair{a, b}, std::pair{b, a}})
            for (const std::uint32_t m : members_[one])
                for (const std::uint32_t x : apart_[m]) within = within && of_[x] != other;
        for (const auto& [to, from] : {std::pair{a, b}, std::pair{b, a}}) {
            within = within && static_cast<double>(seen_[to] + gain(to, from)) <= most_[to];
            each(rows_.row(from), rows_.row(to), [&](std::uint32_t x) { // those see all of both then
                if (of_[x] == x) within = within && static_cast<double>(seen_[x] + size_[to]) <= most_[x];
            });
        }
        return within;
    }
    void join(std::uint32_t a, std::uint32_t b) {
        for (const auto& [to, from] : {std::pair{a, b}, std::pair{b, a}})
            each(rows_.row(from), rows_.row(to), [&](std::uint32_t x) {
                if (of_[x] != x) return;
                seen_[x] += size_[to];
                for (const std::uint32_t m : members_[to]) set_bit(rows_.row(x), m);
            });
        seen_[a] += gain(a, b);
        for (std::size_t w = 0; w < rows_.words(); ++w) rows_.row(a)[w] |= rows_.row(b)[w];
        for (const std::uint32_t m : members_[b]) of_[m] = a;
        members_[a].insert(members_[a].end(), members_[b].begin(), members_[b].end()), members_[b] = {};
        next_[a].insert(next_[a].end(), next_[b].begin(), next_[b].end()), next_[b] = {};
        size_[a] += size_[b], most_[a] = std::min(most_[a], most_[b]), ++version_[a];
        for (std::uint32_t& c : next_[a]) c = of_[c];
        std::erase(next_[a], a);
        offer_all(a);
    }
};

} // namespace

MergedClusters merge_clusters(const Visibility& v, std::span<const std::uint32_t> leaves, Pairs neighbours, Pairs apart, double percent, Context& context) {
    Groups groups(v, leaves, neighbours, apart, percent);
    const double before = groups.mean_seen();
    groups.join_all(context);
    MergedClusters out = groups.result(v);
    out.mean_before = before, out.mean_after = groups.mean_seen();
    return out;
}

MergedClusters merge_clusters(const Visibility& v, const Bsp& bsp, double percent, Context& context) {
    std::vector<std::uint32_t> leaves(bsp.cluster_count, 0);
    for (const BspLeaf& l : bsp.leaves)
        if (l.cluster.valid()) ++leaves[l.cluster.at()];
    std::vector<std::array<std::uint32_t, 2>> neighbours, apart;
    for (const BspPortal& p : bsp.portals) {
        const BspLeaf &front = bsp.leaves[p.leaf_front.at()], &back = bsp.leaves[p.leaf_back.at()];
        if (!front.cluster.valid() || !back.cluster.valid() || front.area != back.area || front.contents != back.contents) continue;
        if (p.hint) apart.push_back({front.cluster.value, back.cluster.value});
        else if (leaves[front.cluster.at()] == 1 && leaves[back.cluster.at()] == 1) neighbours.push_back({front.cluster.value, back.cluster.value});
    }
    return merge_clusters(v, leaves, neighbours, apart, percent, context);
}

} // namespace kiln

#include "compiler/visibility/visibility.h"
#include "compiler/visibility/flow.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <fmt/format.h>
#include <numeric>

namespace kiln {

std::vector<VisPortal> vis_portals(const Bsp& bsp) {
    std::vector<VisPortal> out;
    for (const BspPortal& p : bsp.portals) {
        const ClusterId front = bsp.leaves[p.leaf_front.at()].cluster, back = bsp.leaves[p.leaf_back.at()].cluster;
        if (!front.valid() || !back.valid() || front == back) continue;
        out.push_back({front.value, back.value, p.winding});
    }
    return out;
}

namespace {

using namespace vis;

// A wave takes this share of what is finished: fewer waves leave threads less idle, smaller ones know more.
constexpr std::size_t kFirstWave = 32, kWaveShare = 16;

Visibility rows_of(std::span<const Directed> portals, const Exits& exits, const BitRows& seen,
                   std::uint32_t cluster_count, Context& context) {
    Visibility v;
    v.cluster_count = cluster_count;
    const std::size_t words = v.words_per_row();
    v.rows.assign(words * cluster_count, 0);
    parallel_for(context, cluster_count, [&](std::size_t c) {
        std::uint64_t* row = v.rows.data() + c * words;
        set_bit(row, c);
        std::vector<std::uint64_t> all(seen.words(), 0);
        for (const std::uint32_t p : exits.of(static_cast<std::uint32_t>(c))) {
            set_bit(all.data(), p);
            for (std::size_t w = 0; w < seen.words(); ++w) all[w] |= seen.row(p)[w];
        }
        for (std::size_t w = 0; w < all.size(); ++w)
            for (std::uint64_t bits = all[w]; bits; bits &= bits - 1)
                set_bit(row, portals[w * 64 + static_cast<std::size_t>(std::countr_zero(bits))].to);
    });
    const std::vector<std::uint64_t> directed = v.rows;
    for (std::size_t c = 0; c < cluster_count; ++c)
        for (std::size_t w = 0; w < words; ++w)
            for (std::uint64_t bits = directed[c * words + w]; bits; bits &= bits - 1)
                set_bit(v.rows.data() + (w * 64 + static_cast<std::size_t>(std::countr_zero(bits))) * words, c);
    return v;
}

} // namespace

Result<Visibility> compute_visibility(std::span<const VisPortal> map_portals, std::uint32_t cluster_count,
                                      const VisibilityOptions& options, Context& context) {
    for (std::size_t i = 0; i < map_portals.size(); ++i) {
        const VisPortal& p = map_portals[i];
        if (p.cluster_front >= cluster_count || p.cluster_back >= cluster_count)
            return fault(Exit::input, "portal-cluster",
                         fmt::format("portal {} joins clusters {} and {}, but there are {}", i, p.cluster_front,
                                     p.cluster_back, cluster_count));
        for (const Vec3& w : p.winding)
            if (!std::isfinite(w.x) || !std::isfinite(w.y) || !std::isfinite(w.z))
                return fault(Exit::input, "portal-winding", fmt::format("portal {} has a point that is no number", i));
        if (p.winding.empty())
            return fault(Exit::input, "portal-winding", fmt::format("portal {} has no points", i));
    }
    const std::vector<Directed> portals = directed_portals(map_portals);
    const Exits exits = exits_of(portals, cluster_count);
    BitRows reach = flood(portals, exits, context);
    if (options.fast) return rows_of(portals, exits, reach, cluster_count, context);

    const std::size_t words = reach.words();
    std::vector<std::uint32_t> open(portals.size()), wave;
    std::iota(open.begin(), open.end(), 0u);
    std::vector<std::size_t> count(portals.size());
    std::vector<std::uint64_t> wave_rows;
    std::vector<std::uint8_t> over(portals.size(), 0);
    const FlowInput input{portals, &exits, &reach, options.epsilon, options.step_budget};
    while (!open.empty()) {
        context.check_cancelled();
        for (const std::uint32_t p : open) count[p] = count_bits(reach.row(p), words);
        std::sort(open.begin(), open.end(), [&](std::uint32_t a, std::uint32_t b) {
            return count[a] != count[b] ? count[a] < count[b] : a < b;
        });
        const std::size_t finished = portals.size() - open.size();
        const std::size_t size = std::min(open.size(), std::max(kFirstWave, finished / kWaveShare));
        wave.assign(open.begin(), open.begin() + static_cast<std::ptrdiff_t>(size));
        open.erase(open.begin(), open.begin() + static_cast<std::ptrdiff_t>(size));
        // `reach` stands still while the wave runs: each portal sees what the waves before it left, whoever is quicker.
        wave_rows.assign(size * words, 0);
        parallel_for(context, size, [&](std::size_t i) {
            std::uint64_t steps = 0;
            if (!flow(input, wave[i], wave_rows.data() + i * words, &steps)) {
                over[wave[i]] = 1;
                std::copy_n(reach.row(wave[i]), words, wave_rows.data() + i * words);
            }
        });
        for (std::size_t i = 0; i < size; ++i) std::copy_n(wave_rows.data() + i * words, words, reach.row(wave[i]));
        // p sees q exactly if q, looked through backwards, sees p backwards: what p does not see need not look for p.
        parallel_for(context, open.size(), [&](std::size_t k) {
            std::uint64_t* row = reach.row(open[k]);
            for (const std::uint32_t p : wave)
                if (!get_bit(reach.row(p), reversed(open[k]))) clear_bit(row, reversed(p));
        });
        context.say("vis", static_cast<double>(finished + size) / static_cast<double>(portals.size()));
    }
    Visibility v = rows_of(portals, exits, reach, cluster_count, context);
    v.portals_over_budget = static_cast<std::uint32_t>(std::count(over.begin(), over.end(), 1));
    return v;
}

void check_invariants(const Visibility& v, Checker& checker) {
    Check& rows = checker.add("vis-rows");
    const std::size_t words = v.words_per_row();
    if (!rows.expect(v.rows.size() == words * v.cluster_count, [&] { return Finding{{}, "the table does not fit its clusters"}; })) return;
    for (std::uint32_t a = 0; a < v.cluster_count; ++a) {
        rows.expect(v.sees(a, a), [&] { return Finding{{}, fmt::format("cluster {} does not see itself", a)}; });
        for (std::uint32_t b = 0; b < v.cluster_count; ++b)
            rows.expect(v.sees(a, b) == v.sees(b, a), [&] { return Finding{{}, fmt::format("clusters {} and {} do not see each other alike", a, b)}; });
        if (v.cluster_count % 64)
            rows.expect(v.rows[a * words + words - 1] >> (v.cluster_count % 64) == 0, [&] { return Finding{{}, fmt::format("the row of cluster {} has bits beyond the last cluster", a)}; });
    }
}

void validate(const Visibility& v) {
    Checker checker;
    check_invariants(v, checker);
}

} // namespace kiln

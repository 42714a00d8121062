#include "compiler/visibility/visibility.h"
#include "compiler/visibility/flow.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <chrono>
#include <ctime>
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
constexpr std::size_t kFirstWave = 32, kWaveShare = 32;
constexpr std::size_t kMostPassages = std::size_t{1} << 30; // bytes

double thread_seconds() { // CPU time of this thread
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

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

namespace {

std::optional<Fault> unusable(std::span<const VisPortal> portals, std::uint32_t cluster_count) {
    for (std::size_t i = 0; i < portals.size(); ++i) {
        const VisPortal& p = portals[i];
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
    return std::nullopt;
}

// The flow of all ways, wave by wave.
class Flows {
public:
    Flows(std::span<const Directed> portals, const Exits& exits, BitRows& reach, const VisibilityOptions& options, const VisibilityRun& run, VisibilityProgress& state, Context& context)
        : portals_(portals), exits_(exits), reach_(reach), options_(options), run_(run), state_(state), context_(context),
          stop_([this] { return context_.cancelled() || late(); }) {}

    // False: time was up.
    bool run() {
        const bool resumed = state_.begun && state_.reach.size() == reach_.data().size() && state_.loose.size() == portals_.size();
        if (!resumed) {
            state_ = {};
            state_.open.resize(portals_.size());
            std::iota(state_.open.begin(), state_.open.end(), 0u);
            state_.loose.assign(portals_.size(), 0);
        }
        if (late()) return false;
        const Passages passages(portals_, exits_, reach_, options_.epsilon, kMostPassages, stop_, context_);
        passages.tighten(portals_, exits_, reach_, context_);
        if (late()) return false; // of a start that was not finished nothing is kept: passages would not be the same later
        known_ = options_.rays ? proven(portals_, exits_, reach_, options_.rays, context_) : BitRows(portals_.size(), portals_.size());
        if (resumed) {
            reach_.data() = state_.reach;
            std::vector<std::uint8_t> finished(portals_.size(), 1);
            for (const auto* list : {&state_.open, &state_.put_off})
                for (const std::uint32_t p : *list) finished.at(p) = 0;
            for (std::uint32_t p = 0; p < portals_.size(); ++p)
                if (finished[p] && !state_.loose[p]) claim(p);
        }
        const FlowInput input{portals_, &exits_, &reach_, &passages, options_.epsilon, &stop_};
        try {
            for (;;) {
                if (state_.open.empty() && !again()) break;
                if (late() || !wave(input)) return keep(false);
            }
        } catch (const Cancelled&) {
            keep(false);
            throw;
        }
        return keep(true);
    }

private:
    std::span<const Directed> portals_;
    const Exits& exits_;
    BitRows& reach_;
    BitRows known_; // what a way sees, whatever its flow would say
    const VisibilityOptions& options_;
    const VisibilityRun& run_;
    VisibilityProgress& state_;
    Context& context_;
    std::function<bool()> stop_;
    std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();

    bool late() const { return run_.seconds > 0 && std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count() > run_.seconds; }
    bool keep(bool whole) {
        state_.begun = true;
        if (run_.progress) state_.reach = reach_.data();
        return whole;
    }
    // p sees q: q looked through backwards sees p backwards, and need not search for it.
    void claim(std::uint32_t p) {
        const std::uint64_t* row = reach_.row(p);
        for (std::size_t w = 0; w < reach_.words(); ++w)
            for (std::uint64_t bits = row[w]; bits; bits &= bits - 1)
                set_bit(known_.row(reversed(static_cast<std::uint32_t>(w * 64 + static_cast<std::size_t>(std::countr_zero(bits))))), reversed(p));
    }
    std::uint64_t left() const { return options_.total_budget > state_.steps ? options_.total_budget - state_.steps : 0; }
    // Those that had no luck with their share of the budget try with a larger one, while that is worth a try.
    bool again() {
        if (state_.put_off.empty()) return false;
        const std::uint64_t share = left() / state_.put_off.size();
        if (share < 2 * state_.share || share == 0) {
            for (const std::uint32_t p : state_.put_off) state_.loose[p] = 1;
            state_.put_off.clear();
            return false;
        }
        state_.open = std::exchange(state_.put_off, {});
        return true;
    }
    bool wave(const FlowInput& input) {
        context_.check_cancelled();
        std::vector<std::uint32_t>& open = state_.open;
        const std::size_t words = reach_.words();
        std::vector<std::size_t> count(portals_.size());
        for (const std::uint32_t p : open) count[p] = count_bits(reach_.row(p), words);
        std::ranges::sort(open, [&](std::uint32_t a, std::uint32_t b) { return count[a] != count[b] ? count[a] < count[b] : a < b; });
        const std::size_t finished = portals_.size() - open.size();
        const std::size_t size = std::min(open.size(), std::max(kFirstWave, finished / kWaveShare));
        const std::vector<std::uint32_t> wave(open.begin(), open.begin() + static_cast<std::ptrdiff_t>(size));
        // Its share of what is left of the budget of all, four times an even one: most need less.
        std::uint64_t share = 0;
        if (options_.total_budget) share = std::max<std::uint64_t>(1, left() / std::max<std::size_t>(1, (open.size() + state_.put_off.size()) / 4));
        const std::uint64_t budget = !share ? options_.step_budget : options_.step_budget ? std::min(share, options_.step_budget) : share;
        // `reach` stands still while the wave runs: each way sees what the waves before it left, whoever is quicker.
        std::vector<std::uint64_t> rows(size * words, 0), steps(size, 0);
        std::vector<FlowEnd> ends(size, FlowEnd::stopped);
        std::vector<double> seconds(size, 0);
        parallel_for(context_, size, [&](std::size_t i) {
            const auto begin = thread_seconds();
            std::uint64_t* row = rows.data() + i * words;
            for (std::size_t w = 0; w < words; ++w) row[w] = known_.row(wave[i])[w] & reach_.row(wave[i])[w];
            ends[i] = flow(input, wave[i], budget, row, &steps[i]);
            seconds[i] = thread_seconds() - begin;
        });
        if (std::ranges::find(ends, FlowEnd::stopped) != ends.end()) return context_.check_cancelled(), false; // as if it had not begun
        if (run_.waves) run_.waves->push_back(std::move(seconds));
        open.erase(open.begin(), open.begin() + static_cast<std::ptrdiff_t>(size));
        std::vector<std::uint32_t> done;
        for (std::size_t i = 0; i < size; ++i) {
            const std::uint32_t p = wave[i];
            state_.steps += steps[i];
            if (ends[i] == FlowEnd::done) {
                std::copy_n(rows.data() + i * words, words, reach_.row(p));
                done.push_back(p);
            } else if (share && (!options_.step_budget || share < options_.step_budget)) {
                state_.put_off.push_back(p);
                state_.share = std::max(state_.share, share);
            } else {
                state_.loose[p] = 1;
            }
        }
        for (const std::uint32_t p : done) claim(p);
        // p sees q exactly if q, looked through backwards, sees p backwards: what p does not see need not look for p.
        const auto strike = [&](const std::vector<std::uint32_t>& list) {
            parallel_for(context_, list.size(), [&](std::size_t k) {
                std::uint64_t* row = reach_.row(list[k]);
                for (const std::uint32_t p : done)
                    if (!get_bit(reach_.row(p), reversed(list[k]))) clear_bit(row, reversed(p));
            });
        };
        strike(open), strike(state_.put_off);
        context_.say("vis", static_cast<double>(finished + size) / static_cast<double>(portals_.size()));
        return true;
    }
};

} // namespace

Result<Visibility> compute_visibility(std::span<const VisPortal> map_portals, std::uint32_t cluster_count,
                                      const VisibilityOptions& options, Context& context, const VisibilityRun& run) {
    if (auto wrong = unusable(map_portals, cluster_count)) return *wrong;
    if (run.stopped) *run.stopped = false;
    const std::vector<Directed> portals = directed_portals(map_portals);
    const Exits exits = exits_of(portals, cluster_count);
    BitRows reach = flood(portals, exits, options.radius, context);
    VisibilityProgress own;
    VisibilityProgress& state = run.progress ? *run.progress : own;
    bool whole = true;
    if (!options.fast) whole = Flows(portals, exits, reach, options, run, state, context).run();
    Visibility v = rows_of(portals, exits, reach, cluster_count, context);
    if (options.fast) return v;
    v.steps = state.steps;
    std::vector<std::uint8_t> loose(map_portals.size(), 0);
    for (std::size_t p = 0; p < portals.size(); ++p) loose[p / 2] |= state.loose[p];
    for (const auto* list : {&state.open, &state.put_off})
        for (const std::uint32_t p : *list) loose[p / 2] = 1;
    for (std::uint32_t p = 0; p < loose.size(); ++p)
        if (loose[p]) v.loose.push_back(p);
    if (run.stopped) *run.stopped = !whole;
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

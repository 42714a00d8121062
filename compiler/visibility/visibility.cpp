#include "compiler/visibility/visibility.h"
#include "compiler/visibility/flow.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <atomic>
#include <chrono>
#include <ctime>
#include <deque>
#include <fmt/format.h>
#include <mutex>
#include <numeric>
#include <utility>

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
constexpr std::size_t kFirstWave = 128, kWaveShare = 16;
// A flow is put down after this share of all steps so far, and goes on in so many parts: for 32 threads and more.
constexpr std::uint64_t kLeastSteps = 256, kStepsShare = 512;
constexpr std::size_t kParts = 64;
constexpr std::size_t kMostPassages = std::size_t{1} << 30; // bytes

double thread_seconds() { // CPU time of this thread
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

Visibility rows_of(std::span<const Directed> portals, const Exits& exits, const SparseRows& seen,
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
            seen.each_word(p, [&](std::size_t w, std::uint64_t bits) { all[w] |= bits; });
        }
        for (std::size_t w = 0; w < all.size(); ++w) each_bit(w, all[w], [&](std::uint32_t p) { set_bit(row, portals[p].to); });
    });
    const std::vector<std::uint64_t> directed = v.rows;
    for (std::size_t c = 0; c < cluster_count; ++c)
        for (std::size_t w = 0; w < words; ++w) each_bit(w, directed[c * words + w], [&](std::uint32_t to) { set_bit(v.rows.data() + to * words, c); });
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

// The flow of all ways, wave by wave, down to the largest set of pairs each of which a chain or a line still leads to when all the
// others are struck. That set is one and the same in whatever order it is come to: NOTES.md.
class Flows {
public:
    Flows(const DirectedPortals& portals, const Exits& exits, SparseRows& reach, const VisibilityOptions& options, const VisibilityRun& run, VisibilityProgress& state, const std::function<bool()>& stop, Context& context)
        : portals_(portals.ways), directed_(portals), exits_(exits), reach_(reach), options_(options), run_(run), state_(state), stop_(stop), context_(context), windows_(portals), words_(reach.words()) {}

    // False: time was up.
    bool run() {
        const std::size_t n = portals_.size();
        bool resumed = false;
        if (state_.begun) {
            // Its own parts: where time was up in the flood, rows have others.
            SparseRows kept(std::make_shared<const RowLayout>(n, n, state_.blocks));
            resumed = state_.reach.size() == kept.data().size() && state_.proven.size() == kept.data().size() && state_.loose.size() == n;
            if (resumed) reach_ = std::move(kept);
        }
        if (!resumed) {
            state_ = {};
            state_.open.resize(n);
            std::iota(state_.open.begin(), state_.open.end(), 0u);
            state_.loose.assign(n, 0);
        }
        if (resumed) reach_.data() = state_.reach; // passages then lack what it lacks, and are held against it only together with it
        if (late()) return false;
        const Passages passages(directed_, exits_, reach_, options_.epsilon, kMostPassages, stop_, context_);
        if (!resumed) passages.tighten(portals_, exits_, reach_, stop_, context_);
        // Of a start that was not finished nothing is kept: passages and lines would not be the same later.
        if (late()) return false;
        if (resumed) {
            known_ = SparseRows(reach_.layout());
            known_.data() = std::move(state_.proven);
        } else {
            known_ = options_.rays ? proven(directed_, exits_, windows_, reach_, options_.rays, stop_, context_) : SparseRows(reach_.layout());
            if (late()) return false;
        }
        set_ranks();
        count_.resize(n);
        for (std::size_t p = 0; p < n; ++p) count_[p] = count_bits(reach_.kept(p).data(), reach_.kept(p).size());
        const FlowInput input{&directed_, &exits_, &windows_, &reach_, &passages, options_.epsilon, &stop_};
        try {
            for (;;) {
                bool going = true;
                if (!state_.open.empty() || more()) going = !late() && wave(input);
                else if (!find_again()) break;
                else going = !late() && once_more(input);
                if (!going) return keep(false);
            }
        } catch (const Cancelled&) {
            keep(false);
            throw;
        }
        return keep(true);
    }

private:
    std::span<const Directed> portals_;
    const DirectedPortals& directed_;
    const Exits& exits_;
    SparseRows& reach_;
    SparseRows known_; // what a way sees, whatever its flow would say
    const VisibilityOptions& options_;
    const VisibilityRun& run_;
    VisibilityProgress& state_;
    const std::function<bool()>& stop_;
    Context& context_;
    const Windows windows_;
    const std::size_t words_;
    std::vector<std::uint32_t> rank_;
    std::vector<std::size_t> count_; // bits of the rows of reach_

    bool late() const {
        context_.check_cancelled();
        return stop_();
    }
    bool keep(bool whole) {
        state_.begun = true;
        if (run_.progress) state_.blocks = reach_.layout()->there(), state_.reach = reach_.data(), state_.proven = known_.data();
        return whole;
    }
    // Each pair is searched for from one of its ends, the one that lies first in a direction that is no axis: a way then looks for
    // nothing behind it, where whole branches end at once, and no pair's end depends on the rest of the map.
    void set_ranks() {
        const std::size_t portals = portals_.size() / 2;
        std::vector<std::uint32_t> order(portals);
        std::iota(order.begin(), order.end(), 0u);
        std::ranges::stable_sort(order, {}, [&](std::uint32_t i) { return dot(Vec3{1, 0.7, 0.3}, portals_[2 * i].center); });
        rank_.resize(portals);
        for (std::uint32_t k = 0; k < portals; ++k) rank_[order[k]] = k;
    }
    void not_searched(std::uint32_t p, std::uint64_t* row) const {
        const std::uint32_t mine = rank_[p / 2];
        const Row known = known_.row(p);
        reach_.each_word(p, [&](std::size_t w, std::uint64_t may) {
            if (!may) return;
            std::uint64_t others = 0;
            const std::size_t first = w * 32, count = std::min<std::size_t>(32, rank_.size() - first);
            for (std::size_t k = 0; k < count; ++k) others |= static_cast<std::uint64_t>(rank_[first + k] < mine ? 3 : 0) << (2 * k);
            row[w] = (known.word(w) | others) & may;
        });
    }
    std::uint64_t left() const { return options_.total_budget > state_.steps ? options_.total_budget - state_.steps : 0; }
    // Those that had no luck with their share of the budget try with a larger one, while that is worth a try.
    bool more() {
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
    // p does not see q: q looked through backwards does not see p backwards.
    void strike(std::uint32_t p, std::uint32_t q) {
        for (const auto& [a, b] : {std::pair{p, q}, std::pair{reversed(q), reversed(p)}})
            if (reach_.row(a).has(b)) reach_.row(a).clear(b), --count_[a];
    }
    void note(std::uint32_t p, std::uint32_t q) {
        if (std::uint64_t* word = known_.row(p).place(q)) std::atomic_ref(*word).fetch_or(std::uint64_t{1} << (q % 64), std::memory_order_relaxed);
    }
    // Along a line each portal sees all later ones, and backwards. A line is one, however the search went on.
    void learn(const std::vector<FlowFound>& found) {
        Context whole = context_; // all or nothing: what is kept of a run that is cancelled must not depend on when
        whole.stop = nullptr;
        parallel_for(whole, found.size(), [&](std::size_t f) {
            const Chains& lines = found[f].lines;
            for (std::size_t i = 0; i < lines.size(); ++i)
                for (std::size_t a = 0; a < lines[i].size(); ++a)
                    for (std::size_t b = a + 1; b < lines[i].size(); ++b) note(lines[i][a], lines[i][b]), note(reversed(lines[i][b]), reversed(lines[i][a]));
        });
    }
    void remember(const Chains& witnesses) {
        for (std::size_t i = 0; i < witnesses.size(); ++i) {
            state_.witnesses.push_back(static_cast<std::uint32_t>(witnesses[i].size()));
            state_.witnesses.insert(state_.witnesses.end(), witnesses[i].begin(), witnesses[i].end());
        }
    }
    void strike_unseen(std::uint32_t p, const std::uint64_t* seen) {
        reach_.each_word(p, [&](std::size_t w, std::uint64_t bits) { each_bit(w, bits & ~seen[w], [&](std::uint32_t q) { strike(p, q); }); });
    }

    // The flows of some ways, all from what is known before the first of them: whoever is quicker. A flow that goes on for long is put down
    // and divided, so that no thread has to wait for one; its parts learn of each other when all of them are done or put
    // down. How many threads there are plays no part in it. False: stopped, and none of the flows counts.
    struct Results {
        std::vector<std::uint64_t> rows; // what is seen; on the way in: what need not be searched for
        std::vector<FlowFound> found;
        std::vector<FlowEnd> ends;
    };
    struct Begun {
        Flow flow;
        std::vector<Flow::Branch> left;
    };
    struct Part {
        std::shared_ptr<const Begun> begun; // null: from its beginning
        std::size_t first = 0, count = 0;   // of the branches left there
        std::uint64_t steps = 0;            // at most
        std::vector<std::uint64_t> seen{};
        FlowFound found{};
        std::shared_ptr<const Begun> put_down{}; // null: done
        double seconds = 0;
    };
    struct Search {
        std::vector<Part> parts;
        std::atomic<std::size_t> running;
        std::vector<std::vector<double>> rounds; // seconds
    };
    bool flows(const FlowInput& input, std::span<const std::uint32_t> ways, std::uint64_t budget, Results& r) {
        r.found.assign(ways.size(), {});
        r.ends.assign(ways.size(), FlowEnd::done);
        // A run that goes on from what another left has the same.
        const std::uint64_t pace = std::max(kLeastSteps, state_.steps / kStepsShare), first = budget ? std::min(budget, pace) : pace;
        std::vector<Search> searches(ways.size());
        const auto row = [&](std::size_t way) { return std::span(r.rows).subspan(way * words_, words_); };
        struct Task {
            std::size_t way, part;
        };
        std::deque<Task> waiting; // the longest first, by whoever is free: threads then end together
        for (std::size_t i = ways.size(); i-- > 0;) {
            searches[i].parts.push_back({.begun = nullptr, .steps = first});
            searches[i].running = 1;
            waiting.push_back({i, 0});
        }
        std::mutex gate; // of `waiting`
        std::atomic<bool> stopped{false};
        parallel_tasks(context_, ways.size(), [&](const std::function<void(std::size_t)>& more) {
            Task task{};
            {
                const std::lock_guard lock(gate);
                task = waiting.front();
                waiting.pop_front();
            }
            const auto [way, i] = task;
            if (stopped || stop_()) {
                stopped = true;
                return;
            }
            if (!go_on(input, ways[way], row(way), searches[way].parts[i])) stopped = true;
            if (--searches[way].running || stopped) return;
            r.ends[way] = gather(row(way), searches[way], r.found[way], budget, pace);
            const std::size_t parts = searches[way].parts.size();
            searches[way].running = parts;
            {
                const std::lock_guard lock(gate);
                for (std::size_t k = parts; k-- > 0;) waiting.push_front({way, k});
            }
            more(parts);
        });
        if (stopped) return context_.check_cancelled(), false;
        if (run_.waves) {
            VisibilityRun::WaveTimes& times = run_.waves->emplace_back();
            for (std::size_t i = ways.size(); i-- > 0;) times.push_back(std::move(searches[i].rounds));
        }
        learn(r.found);
        return true;
    }
    // False: stopped.
    bool go_on(const FlowInput& input, std::uint32_t way, std::span<const std::uint64_t> row, Part& part) const {
        const double begin = thread_seconds();
        part.seen.assign(row.begin(), row.end());
        Flow flow = part.begun ? part.begun->flow.part(std::span(part.begun->left).subspan(part.first, part.count)) : Flow(input, way, part.seen.data());
        const FlowEnd end = flow.go(part.steps, part.seen.data(), part.found);
        if (end == FlowEnd::over_budget) {
            std::vector<Flow::Branch> left = flow.left();
            if (!left.empty()) part.put_down = std::make_shared<Begun>(std::move(flow), std::move(left));
        }
        part.seconds = thread_seconds() - begin;
        return end != FlowEnd::stopped;
    }
    // What the parts of a search have found, one after the other, and the parts that it goes on with.
    FlowEnd gather(std::span<std::uint64_t> row, Search& search, FlowFound& found, std::uint64_t budget, std::uint64_t pace) const {
        std::vector<double>& seconds = search.rounds.emplace_back();
        std::size_t open = 0;
        for (const Part& part : search.parts) {
            seconds.push_back(part.seconds);
            found.steps += part.found.steps;
            for (std::size_t c = 0; c < part.found.lines.size(); ++c) found.lines.add(part.found.lines[c]), set_bit(row.data(), part.found.lines[c].back());
            for (std::size_t c = 0; c < part.found.witnesses.size(); ++c) { // unless another part has come to it as well
                const auto chain = part.found.witnesses[c];
                if (!get_bit(row.data(), chain.back())) found.witnesses.add(chain), set_bit(row.data(), chain.back());
            }
            open += part.put_down != nullptr;
        }
        std::vector<Part> next;
        const std::uint64_t left = budget > found.steps ? budget - found.steps : 0;
        if (open && budget && left < open) return search.parts.clear(), FlowEnd::over_budget;
        for (const Part& part : search.parts) {
            if (!part.put_down) continue;
            const std::size_t branches = part.put_down->left.size(), count = std::min({(kParts + open - 1) / open, branches, budget ? static_cast<std::size_t>(left) / open : branches});
            for (std::size_t k = 0; k < count; ++k) next.push_back({.begun = part.put_down, .first = k * branches / count, .count = (k + 1) * branches / count - k * branches / count});
        }
        for (Part& part : next) part.steps = budget ? std::min(pace, left / next.size()) : pace;
        search.parts = std::move(next);
        return FlowEnd::done;
    }

    bool wave(const FlowInput& input) {
        std::vector<std::uint32_t>& open = state_.open;
        std::ranges::sort(open, [&](std::uint32_t a, std::uint32_t b) { return count_[a] != count_[b] ? count_[a] < count_[b] : a < b; });
        const std::size_t finished = portals_.size() - open.size();
        const std::size_t size = std::min(open.size(), std::max(kFirstWave, finished / kWaveShare));
        const std::vector<std::uint32_t> wave(open.begin(), open.begin() + static_cast<std::ptrdiff_t>(size));
        // Its share of what is left of the budget of all, four times an even one: most need less.
        std::uint64_t share = 0;
        if (options_.total_budget) share = std::max<std::uint64_t>(1, left() / std::max<std::size_t>(1, (open.size() + state_.put_off.size()) / 4));
        const std::uint64_t budget = !share ? options_.step_budget : options_.step_budget ? std::min(share, options_.step_budget) : share;
        Results r;
        r.rows.resize(size * words_);
        parallel_for(context_, size, [&](std::size_t i) { not_searched(wave[i], r.rows.data() + i * words_); });
        if (!flows(input, wave, budget, r)) return false;
        open.erase(open.begin(), open.begin() + static_cast<std::ptrdiff_t>(size));
        for (std::size_t i = 0; i < size; ++i) {
            const std::uint32_t p = wave[i];
            state_.steps += r.found[i].steps;
            if (r.ends[i] == FlowEnd::done) {
                strike_unseen(p, r.rows.data() + i * words_);
                remember(r.found[i].witnesses);
            } else if (share && (!options_.step_budget || share < options_.step_budget)) {
                state_.put_off.push_back(p);
                state_.share = std::max(state_.share, share);
            } else {
                state_.loose[p] = 1;
            }
        }
        context_.say("vis", static_cast<double>(finished + size) / static_cast<double>(portals_.size()));
        return true;
    }

    // Of those that no line proves: is the chain still one that holds, or did a way done later strike what it goes through?
    bool holds(std::span<const std::uint32_t> chain) const {
        if (known_.row(chain.front()).has(chain.back())) return true;
        for (std::size_t a = 0; a < chain.size(); ++a)
            for (std::size_t b = a + 1; b < chain.size(); ++b)
                if (!reach_.row(chain[a]).has(chain[b])) return false;
        return true;
    }
    template <class F> void each_witness(F&& f) const {
        for (std::size_t i = 0; i < state_.witnesses.size(); i += 1 + state_.witnesses[i]) f(std::span{state_.witnesses}.subspan(i + 1, state_.witnesses[i]));
    }
    bool find_again() {
        std::vector<std::uint8_t> is(portals_.size(), 0);
        std::vector<std::span<const std::uint32_t>> chains;
        each_witness([&](std::span<const std::uint32_t> chain) { chains.push_back(chain); });
        constexpr std::size_t kPart = 256;
        parallel_for(context_, (chains.size() + kPart - 1) / kPart, [&](std::size_t part) {
            for (std::size_t i = part * kPart; i < std::min(chains.size(), (part + 1) * kPart); ++i) {
                const auto chain = chains[i];
                if (!state_.loose[chain.front()] && reach_.row(chain.front()).has(chain.back()) && !holds(chain)) std::atomic_ref(is[chain.front()]).store(1, std::memory_order_relaxed);
            }
        });
        state_.again.clear();
        for (std::uint32_t p = 0; p < portals_.size(); ++p)
            if (is[p]) state_.again.push_back(p);
        return !state_.again.empty();
    }
    // Those ways look for another chain to what they have lost the chain to.
    bool once_more(const FlowInput& input) {
        const std::vector<std::uint32_t>& ways = state_.again;
        std::vector<std::uint32_t> at(portals_.size(), 0);
        Results r;
        r.rows.resize(ways.size() * words_);
        for (std::uint32_t i = 0; i < ways.size(); ++i) reach_.each_word(ways[i], [&](std::size_t w, std::uint64_t bits) { r.rows[i * words_ + w] = bits; }), at[ways[i]] = i;
        std::vector<std::uint32_t> kept;
        each_witness([&](std::span<const std::uint32_t> chain) {
            if (!reach_.row(chain.front()).has(chain.back())) return;
            if (state_.loose[chain.front()] || holds(chain)) kept.push_back(static_cast<std::uint32_t>(chain.size())), kept.insert(kept.end(), chain.begin(), chain.end());
            else clear_bit(r.rows.data() + at[chain.front()] * words_, chain.back());
        });
        const std::uint64_t budget = options_.total_budget ? std::max<std::uint64_t>(1, options_.step_budget ? std::min(options_.step_budget, left()) : left()) : options_.step_budget;
        if (!flows(input, ways, budget, r)) return false;
        state_.witnesses = std::move(kept);
        for (std::size_t i = 0; i < ways.size(); ++i) {
            state_.steps += r.found[i].steps;
            if (r.ends[i] != FlowEnd::done) state_.loose[ways[i]] = 1;
            else strike_unseen(ways[i], r.rows.data() + i * words_), remember(r.found[i].witnesses);
        }
        state_.again.clear();
        return true;
    }
};

} // namespace

Result<Visibility> compute_visibility(std::span<const VisPortal> map_portals, std::uint32_t cluster_count,
                                      const VisibilityOptions& options, Context& context, const VisibilityRun& run) {
    if (auto wrong = unusable(map_portals, cluster_count)) return *wrong;
    const auto begin = std::chrono::steady_clock::now();
    const std::function<bool()> stop = [&] {
        return context.cancelled() || (run.seconds > 0 && std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() > run.seconds);
    };
    const DirectedPortals portals = directed_portals(map_portals);
    const Exits exits = exits_of(portals, cluster_count);
    SparseRows reach = flood(portals, exits, options.radius, stop, context);
    VisibilityProgress own;
    VisibilityProgress& state = run.progress ? *run.progress : own;
    bool whole = true;
    if (!options.fast) whole = Flows(portals, exits, reach, options, run, state, stop, context).run();
    else whole = !stop();
    context.check_cancelled();
    if (run.stopped) *run.stopped = !whole;
    Visibility v = rows_of(portals, exits, reach, cluster_count, context);
    if (options.fast) {
        if (!whole) v.loose.resize(map_portals.size()), std::iota(v.loose.begin(), v.loose.end(), 0u);
        return v;
    }
    v.steps = state.steps;
    std::vector<std::uint8_t> loose(map_portals.size(), 0);
    for (std::size_t p = 0; p < portals.ways.size(); ++p) loose[p / 2] |= state.loose[p];
    for (const auto* list : {&state.open, &state.put_off, &state.again})
        for (const std::uint32_t p : *list) loose[p / 2] = 1;
    for (std::uint32_t p = 0; p < loose.size(); ++p)
        if (loose[p]) v.loose.push_back(p);
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
    if (v.shut.empty() || !rows.expect(v.shut.size() == v.rows.size(), [&] { return Finding{{}, "the table of shut area portals does not fit its clusters"}; })) return;
    for (std::uint32_t a = 0; a < v.cluster_count; ++a) {
        rows.expect(v.sees_shut(a, a), [&] { return Finding{{}, fmt::format("cluster {} does not see itself while area portals are shut", a)}; });
        for (std::size_t w = 0; w < words; ++w)
            rows.expect(!(v.shut[a * words + w] & ~v.rows[a * words + w]), [&] { return Finding{{}, fmt::format("cluster {} sees more while area portals are shut than when they are open", a)}; });
    }
}

void validate(const Visibility& v) {
    Checker checker;
    check_invariants(v, checker);
}

} // namespace kiln

#include "compiler/visibility/flow.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <utility>

namespace kiln::vis {

Polygon::Polygon(std::span<const Vec3> points) {
    n_ = static_cast<std::uint32_t>(points.size());
    grow(padded(n_));
    for (std::uint32_t i = 0; i < padded(n_); ++i) {
        const Vec3& p = points[i < n_ ? i : 0];
        x()[i] = p.x, x()[room_ + i] = p.y, x()[2 * room_ + i] = p.z;
    }
}
void Polygon::grow(std::uint32_t room) { // what is in it is lost
    room_ = padded(room);
    data_.resize(3 * std::size_t{room_});
}
void Polygon::assign(const PointsView& from) {
    n_ = from.n;
    const std::uint32_t all = padded(n_);
    if (room_ < all) grow(std::max(all, 16u));
    std::copy_n(from.x, all, x()), std::copy_n(from.y, all, x() + room_), std::copy_n(from.z, all, x() + 2 * room_);
}
std::vector<Vec3> Polygon::points() const {
    std::vector<Vec3> out(n_);
    const PointsView v = view();
    for (std::uint32_t i = 0; i < n_; ++i) out[i] = {v.x[i], v.y[i], v.z[i]};
    return out;
}
bool Polygon::clip(const PointsView& in, const PlanesView& planes, const double* sphere, double open, double noise, Polygon& scratch) {
    for (std::uint32_t room = std::max(16u, padded(2 * in.n + 8));; room *= 2) {
        if (room_ < room) grow(room);
        if (scratch.room_ < room) scratch.grow(room);
        PointsOut a = out(), b = scratch.out();
        const double* const mine = a.x;
        switch (kernels().clip(in, planes, sphere, open, noise, a, b)) {
        case Clip::nothing: return false;
        case Clip::whole: assign(in); return true;
        case Clip::cut:
            if (a.x != mine) std::swap(data_, scratch.data_), std::swap(room_, scratch.room_);
            n_ = a.n;
            return true;
        case Clip::no_room: break;
        }
    }
}

void Planes::separate(const PointsView& source, const Directed& of_source, const PointsView& pass, const Directed& of_pass, const Rounding& rounding) {
    if (const std::uint32_t room = padded(source.n + pass.n); room_ < room) {
        room_ = std::max(room, 16u);
        data_.resize(4 * std::size_t{room_});
    }
    // Without a plane the sines are not known, no number says so: then no plane is taken.
    const Vec3 none{NAN, NAN, NAN}, s = of_source.has_plane ? of_source.plane.normal : none, p = of_pass.has_plane ? of_pass.plane.normal : none;
    const double there[6] = {s.x, s.y, s.z, p.x, p.y, p.z}, back[6] = {p.x, p.y, p.z, s.x, s.y, s.z};
    PlanesOut out{data_.data(), data_.data() + room_, data_.data() + 2 * room_, data_.data() + 3 * room_, 0};
    kernels().separators(source, pass, there, false, rounding.noise, rounding.error, kInside, out);
    kernels().separators(pass, source, back, true, rounding.noise, rounding.error, kInside, out);
    n_ = out.n;
}

OnePlane::OnePlane(const Plane& p, bool turned) {
    const double sign = turned ? -1 : 1;
    for (std::size_t k = 0; k < 4; ++k) {
        x[k] = k ? 0 : sign * p.normal.x, y[k] = k ? 0 : sign * p.normal.y, z[k] = k ? 0 : sign * p.normal.z;
        d[k] = k ? -HUGE_VAL : sign * p.distance;
    }
}

namespace {

constexpr std::uint32_t kLines = 4; // tried through a chain that the flow has found

bool has(const std::vector<Bits>& list, std::uint32_t i) {
    const auto at = std::ranges::lower_bound(list, i / 64, {}, &Bits::word);
    return at != list.end() && at->word == i / 64 && (at->bits >> (i % 64) & 1);
}

// What of a list lies in two rows and was not seen; how much of it.
std::size_t still_wanted(std::span<const Bits> list, Row a, Row b, const std::uint64_t* seen, Bits* out) {
    std::size_t n = 0;
    for (const Bits& from : list) {
        out[n] = {from.word, from.bits & a.word(from.word) & b.word(from.word) & ~seen[from.word]};
        n += out[n].bits != 0;
    }
    return n;
}

bool hidden(const Directed& portal, const Planes& planes, double noise) { return kernels().hidden(portal.shape, portal.sphere, planes.view(), noise); }

// May the chain go on to q, as far as sets and planes of all its frames tell? For what was seen already when these were made.
bool excluded(const std::deque<Frame>& frames, std::size_t depth, const Directed& portal, std::uint32_t q, double noise) {
    for (std::size_t d = 0; d <= depth; ++d)
        if (!frames[d].reach.has(q) || (frames[d].passage.data && !frames[d].passage.has(q))) return true;
    for (std::size_t d = depth; d > 0; --d)
        if (hidden(portal, frames[d].separators, noise)) return true;
    return false;
}

// The part of q that lies in front of where a line comes from, and the part of a source (of `from`) behind q; false: none.
bool in_front(const Directed& from, const Directed& q, double epsilon, double noise, Polygon& pass, Polygon& scratch) {
    if (from.has_plane) return pass.clip(q.shape, OnePlane(from.plane).view(), q.sphere, epsilon, noise, scratch);
    pass.assign(q.shape);
    return true;
}
bool behind(const Directed& q, const Directed& from, const PointsView& source, double epsilon, double noise, Polygon& out, Polygon& scratch) {
    if (q.has_plane) return out.clip(source, OnePlane(q.plane, true).view(), from.sphere, epsilon, noise, scratch);
    out.assign(source);
    return true;
}

// Strikes what lies behind one of the planes. Most branches end here, long before a chain of portals has been tried for each
// of these.
std::uint64_t not_hidden(std::span<const Directed> portals, const Planes& planes, std::size_t word, std::uint64_t all, double noise) {
    for (std::uint64_t bits = all; bits; bits &= bits - 1)
        if (const auto i = static_cast<std::size_t>(std::countr_zero(bits)); hidden(portals[word * 64 + i], planes, noise)) all &= ~(std::uint64_t{1} << i);
    return all;
}

// Does some line lead through all portals of the chain? Tried from the middle of what is left of the first to the middle of what
// is left of the last, and about there.
bool line_through(const FlowInput& in, std::span<const std::uint32_t> chain, const Polygon& source, const Polygon& pass) {
    const auto point = [](const PointsView& v, std::uint32_t favourite) { // its middle, or nearer to one of its points
        Vec3 sum{};
        for (std::uint32_t i = 0; i < v.n; ++i) sum += Vec3{v.x[i], v.y[i], v.z[i]};
        sum = sum * (1.0 / v.n);
        if (favourite == 0) return sum;
        const std::uint32_t i = (favourite - 1) % v.n;
        return sum + (Vec3{v.x[i], v.y[i], v.z[i]} - sum) * 0.75;
    };
    for (std::uint32_t k = 0; k < kLines; ++k) {
        const Vec3 from = point(source.view(), k), way = point(pass.view(), k ? k * 3 + 1 : 0) - from;
        if (in.windows->line(chain, from, way)) return true;
    }
    return false;
}

} // namespace

Passages::Passages(const DirectedPortals& of, const Exits& exits, const SparseRows& reach, double epsilon, std::size_t most, const std::function<bool()>& stop, Context& context) : first_(of.ways.size(), kNone) {
    const std::span<const Directed> portals = of.ways;
    const double noise = of.rounding.noise;
    std::vector<std::uint32_t> order(portals.size());
    std::iota(order.begin(), order.end(), 0u);
    std::ranges::stable_sort(order, {}, [&](std::uint32_t p) { return exits.of(portals[p].to).size(); });
    std::vector<std::uint32_t> like;
    std::size_t bytes = 0;
    for (const std::uint32_t p : order) {
        const std::size_t more = exits.of(portals[p].to).size();
        bytes += more * reach.layout()->words(p) * sizeof(std::uint64_t);
        if (bytes > most) break;
        first_[p] = like.size(), like.insert(like.end(), more, p);
    }
    rows_ = SparseRows(reach.layout(), like.size(), [&](std::size_t r) { return like[r]; });
    parallel_for(context, portals.size(), [&](std::size_t p) {
        if (first_[p] == kNone) return;
        const auto out = exits.of(portals[p].to);
        Polygon source, pass, scratch;
        Planes planes;
        for (std::size_t k = 0; k < out.size(); ++k) {
            const std::uint32_t q = out[k];
            if (!reach.row(p).has(q)) continue;
            const auto row = rows_.row(first_[p] + k);
            reach.each_word(p, [&](std::size_t w, std::uint64_t bits) {
                if (bits &= reach.row(q).word(w)) *row.place(w * 64) = bits;
            });
            if (stop() || !in_front(portals[p], portals[q], epsilon, noise, pass, scratch) || !behind(portals[q], portals[p], portals[p].shape, epsilon, noise, source, scratch)) continue;
            planes.separate(source.view(), portals[p], pass.view(), portals[q], of.rounding);
            rows_.each_word(first_[p] + k, [&](std::size_t w, std::uint64_t bits) {
                if (bits) *row.place(w * 64) = not_hidden(portals, planes, w, bits, noise);
            });
        }
    });
}

void Passages::tighten(std::span<const Directed> portals, const Exits& exits, SparseRows& reach, const std::function<bool()>& stop, Context& context) const {
    const std::size_t n = portals.size();
    std::vector<std::vector<std::uint32_t>> entries(exits.first.size() - 1); // ways into each cluster
    for (std::uint32_t p = 0; p < n; ++p) entries[portals[p].to].push_back(p);
    std::vector<std::uint32_t> todo(n);
    std::iota(todo.begin(), todo.end(), 0u);
    std::vector<std::uint8_t> changed(n);
    while (!todo.empty() && !stop()) {
        SparseRows struck(reach.layout(), todo.size(), [&](std::size_t i) { return todo[i]; });
        // Along a chain each portal is behind the passage before it.
        parallel_for(context, todo.size(), [&](std::size_t i) {
            const std::uint32_t p = todo[i];
            const auto row = struck.row(i);
            const Row old = reach.row(p);
            const auto out = exits.of(portals[p].to);
            std::ranges::copy(reach.kept(p), row.data);
            for (std::size_t k = 0; k < out.size(); ++k) {
                if (!old.has(out[k])) continue;
                row.clear(out[k]);
                const Row next = reach.row(out[k]), both = of(p, k); // seen through the next portal, and through the two
                for (std::size_t b = 0; b < reach.blocks(); ++b) {
                    if (!row.slot[b] || !next.slot[b]) continue;
                    std::uint64_t* left = row.data + row.slot[b] * kBlockWords;
                    const std::uint64_t *one = next.data + next.slot[b] * kBlockWords, *two = both.data ? both.data + both.slot[b] * kBlockWords : one;
                    for (std::size_t w = 0; w < kBlockWords; ++w) left[w] &= ~(one[w] & two[w]);
                }
            }
        });
        // p sees q exactly if q, looked through backwards, sees p backwards.
        std::ranges::fill(changed, std::uint8_t{0});
        const auto strike = [&](std::uint32_t a, std::uint32_t b) {
            std::atomic_ref(*reach.row(a).place(b)).fetch_and(~(std::uint64_t{1} << (b % 64)), std::memory_order_relaxed);
            std::atomic_ref(changed[a]).store(1, std::memory_order_relaxed);
        };
        parallel_for(context, todo.size(), [&](std::size_t i) {
            const std::uint32_t p = todo[i];
            struck.each_word(i, [&](std::size_t w, std::uint64_t bits) { each_bit(w, bits, [&](std::uint32_t q) { strike(p, q), strike(reversed(q), reversed(p)); }); });
        });
        // Whose row changed, and who looks through them, may have more to strike.
        std::vector<std::uint8_t> again(n, 0);
        for (std::uint32_t p = 0; p < n; ++p)
            if (changed[p]) {
                again[p] = 1;
                for (const std::uint32_t before : entries[portals[p].from])
                    if (before != reversed(p)) again[before] = 1;
            }
        todo.clear();
        for (std::uint32_t p = 0; p < n; ++p)
            if (again[p]) todo.push_back(p);
    }
}

Flow::Flow(const FlowInput& input, std::uint32_t p, const std::uint64_t* seen) : in_(&input), base_(p), frames_(1), chain_{p}, on_chain_(input.reach->words(), 0) {
    frames_[0].portal = p;
    frames_[0].end = static_cast<std::uint32_t>(input.exits->of(input.portals->ways[p].to).size());
    frames_[0].source.assign(input.portals->ways[p].shape);
    frames_[0].reach = input.reach->row(p);
    input.reach->each_word(p, [&](std::size_t w, std::uint64_t bits) {
        if (bits &= ~seen[w]) frames_[0].wanted.push_back({static_cast<std::uint32_t>(w), bits});
    });
    set_bit(on_chain_.data(), p);
}

std::vector<Flow::Branch> Flow::left() const {
    std::vector<Branch> out;
    std::vector<std::uint64_t> on = on_chain_; // as it is when the flow has come back to that depth
    for (std::size_t d = depth_ + 1; d-- > 0; clear_bit(on.data(), chain_[d])) {
        const Frame& f = frames_[d];
        const auto exits = in_->exits->of(in_->portals->ways[f.portal].to);
        for (std::uint32_t k = f.next; k < f.end; ++k) {
            const Row reach = in_->reach->row(exits[k]), passage = in_->passages->of(f.portal, k);
            if (get_bit(on.data(), exits[k])) continue;
            if (has(f.wanted, exits[k]) || std::ranges::any_of(f.wanted, [&](const Bits& some) { return some.bits & reach.word(some.word) & (passage.data ? passage : reach).word(some.word); }))
                out.push_back({static_cast<std::uint32_t>(d), k});
        }
    }
    return out;
}
Flow Flow::part(std::span<const Branch> branches) const {
    Flow out;
    out.in_ = in_, out.base_ = base_, out.depth_ = branches.front().depth;
    out.chain_.assign(chain_.begin(), chain_.begin() + static_cast<std::ptrdiff_t>(out.depth_ + 1));
    out.on_chain_.resize(on_chain_.size());
    for (const std::uint32_t p : out.chain_) set_bit(out.on_chain_.data(), p);
    out.frames_.assign(frames_.begin(), frames_.begin() + static_cast<std::ptrdiff_t>(out.depth_ + 1));
    for (Frame& f : out.frames_) f.next = f.end = 0;
    for (const Branch& branch : branches) {
        Frame& f = out.frames_[branch.depth];
        if (f.end == 0) f.next = branch.exit;
        f.end = branch.exit + 1;
    }
    return out;
}

FlowEnd Flow::go(std::uint64_t steps, std::uint64_t* seen, FlowFound& found, SightChain* chain) {
    const FlowInput& in = *in_;
    const std::span<const Directed> portals = in.portals->ways;
    const Rounding& rounding = in.portals->rounding;
    const double noise = rounding.noise;
    const Directed& b = portals[base_];
    const std::uint64_t end = steps ? found.steps + steps : UINT64_MAX;
    Polygon scratch, other;
    Planes back;
    for (;;) {
        Frame& f = frames_[depth_];
        const auto exits = in.exits->of(portals[f.portal].to);
        if (f.next == f.end) {
            clear_bit(on_chain_.data(), f.portal);
            if (depth_ == 0) return FlowEnd::done;
            --depth_, chain_.pop_back();
            continue;
        }
        const std::size_t way = f.next;
        const std::uint32_t q = exits[way];
        ++f.next;
        if (get_bit(on_chain_.data(), q)) continue; // a line crosses no portal twice
        const bool known = get_bit(seen, q);
        if (!known && !has(f.wanted, q)) continue;
        if (frames_.size() <= depth_ + 1) frames_.emplace_back();
        Frame& g = frames_[depth_ + 1];
        g.reach = in.reach->row(q);
        g.passage = in.passages->of(f.portal, way);
        g.wanted.resize(f.wanted.size());
        g.wanted.resize(still_wanted(f.wanted, g.reach, g.passage.data ? g.passage : g.reach, seen, g.wanted.data()));
        if (g.wanted.empty() && known) continue;
        if (found.steps >= end) return --f.next, FlowEnd::over_budget;
        if ((++found.steps & 255) == 0 && (*in.stop)()) return FlowEnd::stopped;
        // What was seen already when the planes of the chain were tried is tried against them only now, when it matters:
        // a chain must be the same whatever was known beforehand.
        if (known && excluded(frames_, depth_, portals[q], q, noise)) continue;

        const Directed& t = portals[q];
        if (!in_front(b, t, in.epsilon, noise, g.pass, scratch)) continue;
        if (!behind(t, b, f.source.view(), in.epsilon, noise, g.source, scratch)) continue;
        if (depth_ > 0) {
            if (!other.clip(g.pass.view(), f.separators.view(), t.sphere, in.epsilon, noise, scratch)) continue;
            std::swap(g.pass, other);
            // Looking back from q through the portal before it, only a part of the source may be left.
            back.separate(g.pass.view(), t, f.pass.view(), portals[f.portal], rounding);
            if (!other.clip(g.source.view(), back.view(), b.sphere, in.epsilon, noise, scratch)) continue;
            std::swap(g.source, other);
        }
        chain_.push_back(q);
        if (!known) {
            set_bit(seen, q);
            if (chain) {
                chain->portals = chain_;
                chain->source = g.source.points(), chain->pass = g.pass.points();
                return FlowEnd::done;
            }
            (line_through(in, chain_, g.source, g.pass) ? found.lines : found.witnesses).add(chain_);
        }
        if (!g.wanted.empty()) {
            g.separators.separate(g.source.view(), b, g.pass.view(), t, rounding);
            if (depth_ > 0 || !g.passage.data) { // else struck by these very planes
                for (Bits& some : g.wanted) some.bits = not_hidden(portals, g.separators, some.word, some.bits, noise);
                std::erase_if(g.wanted, [](const Bits& some) { return some.bits == 0; });
            }
        }
        if (g.wanted.empty()) {
            chain_.pop_back();
            continue;
        }
        g.portal = q;
        g.next = 0, g.end = static_cast<std::uint32_t>(in.exits->of(t.to).size());
        set_bit(on_chain_.data(), q);
        ++depth_;
    }
}

} // namespace kiln::vis

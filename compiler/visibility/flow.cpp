#include "compiler/visibility/flow.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <deque>
#include <numeric>

namespace kiln::vis {

bool clip(const std::vector<Vec3>& in, const Plane& plane, double open, std::vector<Vec3>& out) {
    const std::size_t n = in.size();
    bool front = false, cut = false;
    for (const Vec3& p : in) {
        const double d = plane.at(p);
        front |= d > kNoise;
        cut |= d < -open;
    }
    if (!front) return false;
    if (!cut) {
        out = in;
        return true;
    }
    out.clear();
    Vec3 a = in[n - 1];
    double da = plane.at(a) + open;
    for (const Vec3& b : in) {
        const double db = plane.at(b) + open;
        if ((da < 0) != (db < 0)) out.push_back(a + (b - a) * (da / (da - db)));
        if (db >= 0) out.push_back(b);
        a = b, da = db;
    }
    return true;
}

namespace {

// Planes through an edge of `a` that touch `b`, `a` behind and `b` in front (or flipped: the other way round).
void edge_separators(const std::vector<Vec3>& a, const std::vector<Vec3>& b, bool flipped, std::vector<Plane>& out) {
    Vec3 inside{};
    for (const Vec3& p : a) inside += p;
    inside *= 1.0 / static_cast<double>(a.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
        const Vec3 p = a[i], edge = a[i + 1 == a.size() ? 0 : i + 1] - p;
        // Seen along the edge, the plane is a line that turns round p away from `a` until all of b is in front.
        const Vec3 toward = cross(inside - p, edge); // n = cross(edge, v - p) has `inside` behind if toward * (v - p) < 0
        Vec3 n{};
        bool have = false;
        for (const Vec3& v : b) {
            if (have && dot(n, v - p) >= 0) continue;
            n = cross(edge, v - p);
            if (dot(toward, v - p) > 0) n = -n;
            have = true;
        }
        const double size2 = dot(n, n);
        if (!(size2 > 1e-8 * dot(edge, edge))) continue; // the touched point nearly on the edge's line: ill-conditioned
        n = n * (1 / std::sqrt(size2));
        const double d = dot(n, p);
        const auto behind = [&](const Vec3& v) { return dot(n, v) - d < -kNoise; };
        const auto in_front = [&](const Vec3& v) { return dot(n, v) - d > kNoise; };
        if (std::any_of(b.begin(), b.end(), behind) || std::any_of(a.begin(), a.end(), in_front)) continue;
        out.push_back(flipped ? Plane{-n, -d} : Plane{n, d});
    }
}

// Some bits of a row, those of no bit left out.
struct Bits {
    std::uint32_t word = 0;
    std::uint64_t bits = 0;
};
bool has(const std::vector<Bits>& list, std::uint32_t i) {
    const auto at = std::ranges::lower_bound(list, i / 64, {}, &Bits::word);
    return at != list.end() && at->word == i / 64 && (at->bits >> (i % 64) & 1);
}

struct Frame {
    std::uint32_t portal = 0;             // the one entered last
    std::uint32_t next = 0;               // which exit of its cluster comes next
    const std::uint64_t* reach = nullptr; // what may be seen behind it, as far as sets tell that are known beforehand
    const std::uint64_t* passage = nullptr;
    std::vector<Vec3> source, pass;       // the base portal's has no pass and no separators
    std::vector<Plane> separators;        // of (source, pass)
    std::vector<Bits> wanted;             // what may be seen from here on, was not seen yet and lies behind no plane of the chain
};

bool hidden(const Directed& portal, const std::vector<Plane>& planes) {
    for (const Plane& s : planes) {
        const double d = s.at(portal.center);
        if (d > kNoise) continue;
        if (d < -portal.radius) return true;
        if (std::none_of(portal.points.begin(), portal.points.end(), [&](const Vec3& p) { return s.at(p) > kNoise; })) return true;
    }
    return false;
}

// May the chain go on to q, as far as sets and planes of all its frames tell? For what was seen already when these were made.
bool excluded(const std::deque<Frame>& frames, std::size_t depth, const Directed& portal, std::uint32_t q) {
    for (std::size_t d = 0; d <= depth; ++d)
        if (!get_bit(frames[d].reach, q) || (frames[d].passage && !get_bit(frames[d].passage, q))) return true;
    for (std::size_t d = depth; d > 0; --d)
        if (hidden(portal, frames[d].separators)) return true;
    return false;
}

// The parts of two windings that a line forward through both can use, as far as their own planes tell; false: none.
bool between(const Directed& p, const Directed& q, double epsilon, std::vector<Vec3>& source, std::vector<Vec3>& pass) {
    if (!p.has_plane) pass = *q.winding;
    else if (!clip(*q.winding, p.plane, epsilon, pass)) return false;
    if (!q.has_plane) source = *p.winding;
    else if (!clip(*p.winding, {-q.plane.normal, -q.plane.distance}, epsilon, source)) return false;
    return true;
}

// Strikes what lies behind one of the planes. Most branches end here, long before a chain of portals has been tried for each
// of these.
std::uint64_t not_hidden(std::span<const Directed> portals, const std::vector<Plane>& planes, std::size_t word, std::uint64_t all) {
    for (std::uint64_t bits = all; bits; bits &= bits - 1)
        if (const auto i = static_cast<std::size_t>(std::countr_zero(bits)); hidden(portals[word * 64 + i], planes)) all &= ~(std::uint64_t{1} << i);
    return all;
}

} // namespace

void separators(const std::vector<Vec3>& source, const std::vector<Vec3>& pass, std::vector<Plane>& out) {
    out.clear();
    edge_separators(source, pass, false, out);
    edge_separators(pass, source, true, out);
}

Passages::Passages(std::span<const Directed> portals, const Exits& exits, const BitRows& reach, double epsilon, std::size_t most, const std::function<bool()>& stop, Context& context) : first_(portals.size(), kNone) {
    const std::size_t words = reach.words();
    std::vector<std::uint32_t> order(portals.size());
    std::iota(order.begin(), order.end(), 0u);
    std::ranges::stable_sort(order, {}, [&](std::uint32_t p) { return exits.of(portals[p].to).size(); });
    std::size_t rows = 0;
    for (const std::uint32_t p : order) {
        const std::size_t more = exits.of(portals[p].to).size();
        if ((rows + more) * words * sizeof(std::uint64_t) > most) break;
        first_[p] = rows, rows += more;
    }
    rows_ = BitRows(rows, portals.size());
    parallel_for(context, portals.size(), [&](std::size_t p) {
        if (first_[p] == kNone) return;
        const auto out = exits.of(portals[p].to);
        std::vector<Vec3> source, pass;
        std::vector<Plane> planes;
        for (std::size_t k = 0; k < out.size(); ++k) {
            const std::uint32_t q = out[k];
            if (!get_bit(reach.row(p), q)) continue;
            std::uint64_t* row = rows_.row(first_[p] + k);
            for (std::size_t w = 0; w < words; ++w) row[w] = reach.row(p)[w] & reach.row(q)[w];
            if ((stop && stop()) || !between(portals[p], portals[q], epsilon, source, pass)) continue;
            separators(source, pass, planes);
            for (std::size_t w = 0; w < words; ++w)
                if (row[w]) row[w] = not_hidden(portals, planes, w, row[w]);
        }
    });
}

void Passages::tighten(std::span<const Directed> portals, const Exits& exits, BitRows& reach, Context& context) const {
    const std::size_t words = reach.words();
    for (bool changed = true; changed;) {
        BitRows next(portals.size(), portals.size());
        // Along a chain each portal is behind the passage before it.
        parallel_for(context, portals.size(), [&](std::size_t p) {
            std::uint64_t* row = next.row(p);
            const std::uint64_t* old = reach.row(p);
            const auto out = exits.of(portals[p].to);
            for (std::size_t k = 0; k < out.size(); ++k) {
                if (!get_bit(old, out[k])) continue;
                set_bit(row, out[k]);
                const std::uint64_t* passage = of(static_cast<std::uint32_t>(p), k);
                const std::uint64_t* beyond = reach.row(out[k]);
                for (std::size_t w = 0; w < words; ++w) row[w] |= old[w] & beyond[w] & (passage ? passage[w] : ~std::uint64_t{0});
            }
        });
        // p sees q exactly if q, looked through backwards, sees p backwards.
        std::vector<std::uint8_t> differs(portals.size(), 0);
        parallel_for(context, portals.size(), [&](std::size_t p) {
            std::uint64_t* row = reach.row(p);
            for (std::size_t w = 0; w < words; ++w)
                for (std::uint64_t bits = row[w]; bits; bits &= bits - 1) {
                    const auto q = static_cast<std::uint32_t>(w * 64 + static_cast<std::size_t>(std::countr_zero(bits)));
                    if (!get_bit(next.row(p), q) || !get_bit(next.row(reversed(q)), reversed(static_cast<std::uint32_t>(p)))) clear_bit(row, q), differs[p] = 1;
                }
        });
        changed = std::ranges::count(differs, 1) > static_cast<std::ptrdiff_t>(portals.size() / 8); // the last few are not worth a round
    }
}

FlowEnd flow(const FlowInput& in, std::uint32_t base, std::uint64_t step_budget, std::uint64_t* seen, std::uint64_t* steps, SightChain* chain) {
    const std::size_t words = in.reach->words();
    const Directed& b = in.portals[base];
    std::deque<Frame> frames(1); // a deque: frames stay where they are while deeper ones come
    std::vector<std::uint8_t> on_chain(in.portals.size(), 0);
    std::vector<Vec3> scratch;
    std::vector<Plane> back;

    frames[0].portal = base;
    frames[0].source = *b.winding;
    frames[0].reach = in.reach->row(base);
    for (std::size_t w = 0; w < words; ++w)
        if (const std::uint64_t bits = frames[0].reach[w] & ~seen[w]) frames[0].wanted.push_back({static_cast<std::uint32_t>(w), bits});
    on_chain[base] = 1;
    std::size_t depth = 0;
    for (;;) {
        Frame& f = frames[depth];
        const auto exits = in.exits->of(in.portals[f.portal].to);
        if (f.next == exits.size()) {
            on_chain[f.portal] = 0;
            if (depth == 0) return FlowEnd::done;
            --depth;
            continue;
        }
        const std::size_t way = f.next++;
        const std::uint32_t q = exits[way];
        if (on_chain[q]) continue; // a line crosses no portal twice
        const bool known = get_bit(seen, q);
        if (!known && !has(f.wanted, q)) continue;
        if (frames.size() <= depth + 1) frames.emplace_back();
        Frame& g = frames[depth + 1];
        g.reach = in.reach->row(q);
        g.passage = in.passages->of(f.portal, way);
        g.wanted.clear();
        for (const Bits& from : f.wanted)
            if (std::uint64_t bits = from.bits & g.reach[from.word] & ~seen[from.word]) {
                if (g.passage) bits &= g.passage[from.word];
                if (bits) g.wanted.push_back({from.word, bits});
            }
        if (g.wanted.empty() && known) continue;
        if ((++*steps & 255) == 0 && (*in.stop)()) return FlowEnd::stopped;
        if (step_budget && *steps >= step_budget) return FlowEnd::over_budget;
        // What was seen already when the planes of the chain were tried is tried against them only now, when it matters:
        // a chain must be the same whatever was known beforehand.
        if (known && excluded(frames, depth, in.portals[q], q)) continue;

        const Directed& t = in.portals[q];
        // q in front of where we look from, and the source behind q.
        if (b.has_plane) {
            if (!clip(*t.winding, b.plane, in.epsilon, g.pass)) continue;
        } else {
            g.pass = *t.winding;
        }
        g.source = f.source;
        if (t.has_plane) {
            if (!clip(g.source, {-t.plane.normal, -t.plane.distance}, in.epsilon, scratch)) continue;
            std::swap(g.source, scratch);
        }
        if (depth > 0) {
            bool visible = true;
            for (const Plane& s : f.separators) {
                if (s.at(t.center) > t.radius) continue;
                if (!(visible = clip(g.pass, s, in.epsilon, scratch))) break;
                std::swap(g.pass, scratch);
            }
            if (!visible) continue;
            // Looking back from q through the portal before it, only a part of the source may be left.
            separators(g.pass, f.pass, back);
            for (const Plane& s : back) {
                if (!(visible = clip(g.source, s, in.epsilon, scratch))) break;
                std::swap(g.source, scratch);
            }
            if (!visible) continue;
        }
        if (!known) {
            set_bit(seen, q);
            if (chain) {
                for (std::size_t d = 0; d <= depth; ++d) chain->portals.push_back(frames[d].portal);
                chain->portals.push_back(q);
                chain->source = g.source, chain->pass = g.pass;
                return FlowEnd::done;
            }
        }
        if (g.wanted.empty()) continue;
        separators(g.source, g.pass, g.separators);
        if (depth > 0 || !g.passage) { // else struck by these very planes
            for (Bits& some : g.wanted) some.bits = not_hidden(in.portals, g.separators, some.word, some.bits);
            std::erase_if(g.wanted, [](const Bits& some) { return some.bits == 0; });
            if (g.wanted.empty()) continue;
        }
        g.portal = q;
        g.next = 0;
        on_chain[q] = 1;
        ++depth;
    }
}

} // namespace kiln::vis

#include "compiler/visibility/flow.h"
#include <algorithm>
#include <deque>

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
        n = n / std::sqrt(size2);
        const double d = dot(n, p);
        bool separates = true;
        for (const Vec3& v : b)
            if (dot(n, v) - d < -kNoise) separates = false;
        for (const Vec3& v : a)
            if (dot(n, v) - d > kNoise) separates = false;
        if (!separates) continue;
        out.push_back(flipped ? Plane{-n, -d} : Plane{n, d});
    }
}

struct Frame {
    std::uint32_t portal = 0;             // the one entered last
    std::uint32_t next = 0;               // which exit of its cluster comes next
    std::vector<Vec3> source, pass;       // the base portal's has no pass and no separators
    std::vector<Plane> separators;        // of (source, pass)
    std::vector<std::uint64_t> might;     // what may still be seen from here on
};

bool hidden(const Directed& portal, const std::vector<Plane>& planes) {
    for (const Plane& s : planes) {
        const double d = s.at(portal.center);
        if (d > kNoise) continue;
        if (d < -portal.radius) return true;
        bool front = false;
        for (const Vec3& p : *portal.winding) front |= s.at(p) > kNoise;
        if (!front) return true;
    }
    return false;
}

// Strikes what is not seen yet and lies behind a separating plane from `might`; true if something new is left there.
// Most branches end here, long before a chain of portals has been tried for each of these.
bool strike_hidden(std::span<const Directed> portals, const std::vector<Plane>& planes, const std::uint64_t* seen,
                   std::size_t words, std::vector<std::uint64_t>& might) {
    bool left = false;
    for (std::size_t w = 0; w < words; ++w)
        for (std::uint64_t bits = might[w] & ~seen[w]; bits; bits &= bits - 1) {
            const std::size_t r = w * 64 + static_cast<std::size_t>(std::countr_zero(bits));
            if (hidden(portals[r], planes)) clear_bit(might.data(), r);
            else left = true;
        }
    return left;
}

} // namespace

void separators(const std::vector<Vec3>& source, const std::vector<Vec3>& pass, std::vector<Plane>& out) {
    out.clear();
    edge_separators(source, pass, false, out);
    edge_separators(pass, source, true, out);
}

bool flow(const FlowInput& in, std::uint32_t base, std::uint64_t* seen, std::uint64_t* steps) {
    const std::size_t words = in.reach->words();
    const Directed& b = in.portals[base];
    std::deque<Frame> frames(1); // a deque: frames stay where they are while deeper ones come
    std::vector<std::uint8_t> on_chain(in.portals.size(), 0);
    std::vector<Vec3> scratch;
    std::vector<Plane> back;

    frames[0].portal = base;
    frames[0].source = *b.winding;
    frames[0].might.assign(in.reach->row(base), in.reach->row(base) + words);
    on_chain[base] = 1;
    std::size_t depth = 0;
    for (;;) {
        Frame& f = frames[depth];
        const auto exits = in.exits->of(in.portals[f.portal].to);
        if (f.next == exits.size()) {
            on_chain[f.portal] = 0;
            if (depth == 0) return true;
            --depth;
            continue;
        }
        const std::uint32_t q = exits[f.next++];
        if (!get_bit(f.might.data(), q) || on_chain[q]) continue; // a line crosses no portal twice
        if (frames.size() <= depth + 1) frames.emplace_back();
        Frame& g = frames[depth + 1];
        g.might.resize(words);
        const std::uint64_t* reach = in.reach->row(q);
        std::uint64_t more = 0;
        for (std::size_t w = 0; w < words; ++w) {
            g.might[w] = f.might[w] & reach[w];
            more |= g.might[w] & ~seen[w];
        }
        if (!more && get_bit(seen, q)) continue;
        if (++*steps == in.step_budget) return false;

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
        set_bit(seen, q);
        if (!more) continue;
        separators(g.source, g.pass, g.separators);
        if (!strike_hidden(in.portals, g.separators, seen, words, g.might)) continue;
        g.portal = q;
        g.next = 0;
        on_chain[q] = 1;
        ++depth;
    }
}

} // namespace kiln::vis

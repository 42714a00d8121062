// Lines of sight found by trying: what they prove, the flow need not search for.
#include "compiler/visibility/proven.h"
#include "libs/parallel/parallel.h"
#include "libs/sampling/maps.h"
#include "libs/sampling/sobol.h"
#include <atomic>
#include <cmath>

namespace kiln::vis {
Windows::Windows(const DirectedPortals& portals) : noise_(portals.rounding.noise) {
    for (const Directed& p : portals.ways) {
        Window window{p.plane, static_cast<std::uint32_t>(edges_.size()), 0, p.to};
        const std::size_t n = p.has_plane ? p.winding->size() : 0;
        for (std::size_t i = 0; i < n; ++i) {
            const Vec3 a = (*p.winding)[i], b = (*p.winding)[(i + 1) % n];
            Vec3 in = cross(p.plane.normal, b - a);
            if (dot(in, p.center - a) < 0) in = -in;
            if (const double size = length(in); size > 0) in = in / size;
            edges_.push_back({in, dot(in, a) + kInside});
        }
        window.last = static_cast<std::uint32_t>(edges_.size());
        of_.push_back(window);
    }
}
bool Windows::line(std::span<const std::uint32_t> chain, Vec3 from, Vec3 way) const {
    double last = -HUGE_VAL, slow = HUGE_VAL; // of the portal before it
    for (const std::uint32_t p : chain) {
        const double speed = dot(plane(p).normal, way);
        if (!(speed > 0)) return false;
        const double t = -plane(p).at(from) / speed;
        if (!((t - last) * std::min(speed, slow) > noise_) || !hold(p, from + way * t)) return false;
        last = t, slow = speed;
    }
    return true;
}

Vec3 point_in(const std::vector<Vec3>& w, Random& random) {
    double whole = 0;
    for (std::size_t i = 1; i + 1 < w.size(); ++i) whole += length(cross(w[i] - w[0], w[i + 1] - w[0]));
    double at = random() * whole;
    std::size_t k = 1;
    for (; k + 2 < w.size(); ++k) {
        const double size = length(cross(w[k] - w[0], w[k + 1] - w[0]));
        if (at < size) break;
        at -= size;
    }
    const double u = random(), v = random();
    if (w.size() < 3) return w[0];
    const Vec2 t = uniform_triangle({u, v});
    return w[0] * (1 - t.x - t.y) + w[k] * t.x + w[k + 1] * t.y;
}

namespace {

constexpr std::size_t kMarked = 12;

// Somewhere in it, not evenly.
Vec3 any_point_in(std::span<const Vec3> w, Random& random) {
    if (w.size() < 3) return w[0];
    const std::size_t k = 1 + std::min(w.size() - 3, static_cast<std::size_t>(random() * static_cast<double>(w.size() - 2)));
    const double u = random(), v = random();
    const Vec2 t = uniform_triangle({u, v});
    return w[0] * (1 - t.x - t.y) + w[k] * t.x + w[k + 1] * t.y;
}

} // namespace

SparseRows proven(const DirectedPortals& of, const Exits& exits, const Windows& windows, const SparseRows& reach, std::uint32_t rays, const std::function<bool()>& stop, Context& context) {
    const std::span<const Directed> portals = of.ways;
    const std::size_t n = portals.size(), words = reach.words();
    SparseRows known(reach.layout());
    const auto mark = [&](std::uint32_t a, std::uint32_t b) {
        const std::uint64_t bit = std::uint64_t{1} << (b % 64);
        if (!(reach.row(a).word(b / 64) & bit)) return;
        const std::atomic_ref word(*known.row(a).place(b));
        if (!(word.load(std::memory_order_relaxed) & bit)) word.fetch_or(bit, std::memory_order_relaxed);
    };
    parallel_for(context, n, [&](std::size_t i) {
        const auto p = static_cast<std::uint32_t>(i);
        if (stop()) return;
        std::vector<std::uint32_t> open; // what may be seen from here, and no line of this portal has reached yet
        reach.each_word(p, [&](std::size_t w, std::uint64_t bits) { each_bit(w, bits, [&](std::uint32_t q) { open.push_back(q); }); });
        std::vector<std::uint64_t> mine(words, 0);
        Random random(p);
        std::vector<std::uint32_t> chain;
        for (std::uint32_t ray = 0; ray < rays && !open.empty(); ++ray) {
            const auto k = static_cast<std::size_t>(random() * static_cast<double>(open.size()));
            const std::uint32_t target = open[k];
            if (get_bit(mine.data(), target)) {
                open[k] = open.back(), open.pop_back();
                continue;
            }
            const Vec3 from = any_point_in(portals[p].points, random), way = any_point_in(portals[target].points, random) - from;
            const double start = dot(windows.plane(p).normal, way);
            if (!windows.hold(p, from) || !(start > 0)) continue;
            chain.assign(1, p);
            double at = 0, slow = start; // of `way`; along the normal of the last
            for (std::uint32_t last = p; chain.size() <= n;) {
                double nearest = HUGE_VAL, its = 0;
                auto next = static_cast<std::uint32_t>(n);
                for (const std::uint32_t q : exits.of(windows.to(last))) {
                    const double speed = dot(windows.plane(q).normal, way);
                    if (!(speed > 0)) continue; // the way back among them
                    const double t = -windows.plane(q).at(from) / speed;
                    if (!((t - at) * std::min(speed, slow) > windows.noise()) || t >= nearest || !windows.hold(q, from + way * t)) continue;
                    nearest = t, next = q, its = speed;
                }
                if (next == n) break;
                chain.push_back(next), set_bit(mine.data(), next);
                last = next, at = nearest, slow = its;
            }
            // Along a line each portal sees all later ones, and backwards. Of a long one what its first see will do.
            for (std::size_t a = 0; a < std::min(chain.size(), kMarked); ++a)
                for (std::size_t b = a + 1; b < chain.size(); ++b) mark(chain[a], chain[b]), mark(reversed(chain[b]), reversed(chain[a]));
        }
    });
    return known;
}

} // namespace kiln::vis

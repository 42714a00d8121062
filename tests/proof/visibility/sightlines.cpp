#include "tests/proof/visibility/sightlines.h"
#include "libs/parallel/parallel.h"
#include "libs/sampling/maps.h"
#include "libs/sampling/sobol.h"
#include <algorithm>
#include <atomic>
#include <mutex>

namespace kiln::proof {
namespace {

constexpr double kGraze = 1e-6, kStart = 1e-4; // map units
constexpr double kInPlane = 1e-7;              // and nearer than this to a plane all along, a line runs in it, between two leaves
constexpr std::uint64_t kBlock = 4096;         // rays that share a generator
constexpr std::size_t kMisses = 16;

struct Passed {
    std::uint32_t cluster = 0;
    double at = 0; // a parameter within
};

// The tree as a line wants it: small nodes close together, the clusters of the leaves.
class Tree {
public:
    explicit Tree(const Bsp& bsp) {
        for (const BspNode& n : bsp.nodes) nodes_.push_back({n.normal, n.distance, {n.child[0], n.child[1]}});
        for (const BspLeaf& l : bsp.leaves) clusters_.push_back(l.cluster.value);
    }
    struct Part {
        std::int32_t node;
        double begin, end;
    };
    // Clusters from `from` on along the unit vector `way`, up to where something is solid; `sign` turns the parameters.
    void walk(Vec3 from, Vec3 way, double length, double sign, std::vector<Part>& stack, std::vector<Passed>& out) const {
        stack.assign(1, {nodes_.empty() ? -1 : 0, 0, length});
        while (!stack.empty()) {
            Part p = stack.back();
            stack.pop_back();
            while (p.node >= 0) {
                const Node& n = nodes_[static_cast<std::size_t>(p.node)];
                const double base = dot(n.normal, from) - n.distance, speed = dot(n.normal, way);
                const double d0 = base + speed * p.begin, d1 = base + speed * p.end;
                if (std::max(std::abs(d0), std::abs(d1)) < kInPlane) return;
                if (std::min(d0, d1) >= 0) p.node = n.child[0];
                else if (std::max(d0, d1) <= 0) p.node = n.child[1];
                else {
                    const double x = std::clamp(p.begin + (p.end - p.begin) * (d0 / (d0 - d1)), p.begin, p.end);
                    stack.push_back({n.child[d0 < 0 ? 0 : 1], x, p.end});
                    p = {n.child[d0 < 0 ? 1 : 0], p.begin, x};
                }
            }
            const std::uint32_t cluster = clusters_[static_cast<std::size_t>(-(p.node + 1))];
            if (cluster == ClusterId{}.value || p.end - p.begin < kGraze) return;
            out.push_back({cluster, sign * (p.begin + p.end) / 2});
        }
    }

private:
    struct Node {
        Vec3 normal;
        double distance = 0;
        std::int32_t child[2] = {};
    };
    std::vector<Node> nodes_;
    std::vector<std::uint32_t> clusters_;
};

class Lines {
public:
    Lines(const Bsp& bsp, std::span<const VisPortal> portals, const Visibility& v) : portals_(portals), v_(v) {
        for (const BspLeaf& l : bsp.leaves)
            if (l.cluster.valid()) open_.push_back(&l), all_.add(l.bounds);
        length_ = open_.empty() ? 0 : kiln::length(all_.hi - all_.lo) + 1;
    }
    bool any() const { return !open_.empty(); }
    // How far a line goes before it leaves the box of all open leaves: outside of it, where a world leaks, the tree still names
    // leaves, but no portal leads there.
    double length(Vec3 from, Vec3 way) const {
        double end = length_;
        for (std::size_t k = 0; k < 3; ++k) {
            if (from[k] <= all_.lo[k] || from[k] >= all_.hi[k]) return 0;
            if (way[k] != 0) end = std::min(end, ((way[k] > 0 ? all_.hi[k] : all_.lo[k]) - from[k]) / way[k]);
        }
        return end;
    }

    // False: this time none.
    bool draw(std::uint64_t ray, Random& random, Vec3& from, Vec3& way) const {
        const double u = random(), v = random();
        way = uniform_sphere({u, v});
        if (ray % 3 == 0 || portals_.empty()) {
            const Box3& box = pick(open_, random)->bounds;
            for (std::size_t k = 0; k < 3; ++k) from[k] = box.lo[k] + (box.hi[k] - box.lo[k]) * random();
        } else if (const VisPortal& p = portals_[index(portals_.size(), random)]; ray % 3 == 1) {
            from = inside(p.winding, random);
        } else {
            from = near_edge(p.winding, random);
            for (int tries = 0; tries < 8; ++tries) {
                const VisPortal& q = portals_[index(portals_.size(), random)];
                if (&q == &p || !(v_.sees(p.cluster_front, q.cluster_back) || v_.sees(p.cluster_back, q.cluster_front))) continue;
                const Vec3 to = near_edge(q.winding, random) - from;
                if (!(kiln::length(to) > kStart)) return false;
                way = normalize(to);
                break;
            }
        }
        from = from + way * kStart; // off the portal's plane
        return true;
    }

private:
    std::span<const VisPortal> portals_;
    const Visibility& v_;
    std::vector<const BspLeaf*> open_;
    Box3 all_;
    double length_ = 0;

    static std::size_t index(std::size_t n, Random& random) { return std::min(n - 1, static_cast<std::size_t>(random() * static_cast<double>(n))); }
    template <class T> static T pick(const std::vector<T>& from, Random& random) { return from[index(from.size(), random)]; }
    static Vec3 inside(const std::vector<Vec3>& w, Random& random) {
        Vec3 sum{};
        double weight = 0;
        for (const Vec3& p : w) {
            const double x = -std::log(1 - random());
            sum += p * x, weight += x;
        }
        return sum / weight;
    }
    static Vec3 near_edge(const std::vector<Vec3>& w, Random& random) {
        const std::size_t i = index(w.size(), random);
        const double along = random(), in = std::exp(-12 * random()); // of the way to a point inside
        const Vec3 edge = w[i] + (w[(i + 1) % w.size()] - w[i]) * along;
        return edge + (inside(w, random) - edge) * in;
    }
};

} // namespace

Sightlines find_sightlines(const Bsp& bsp, std::span<const VisPortal> portals, const Visibility& v, std::uint64_t rays, std::uint64_t seed, Context& context) {
    Sightlines result;
    const Lines lines(bsp, portals, v);
    const Tree tree(bsp);
    const std::size_t words = v.words_per_row();
    std::vector<std::uint64_t> proven(v.rows.size(), 0);
    for (std::uint32_t c = 0; c < v.cluster_count; ++c) proven[c * words + c / 64] |= std::uint64_t{1} << (c % 64);
    std::atomic<std::uint64_t> checked{0}, missing{0};
    std::mutex guard;
    if (lines.any())
        parallel_for(context, (rays + kBlock - 1) / kBlock, [&](std::size_t block) {
            Random random(mix(seed, block));
            std::vector<Passed> line, back;
            std::vector<Tree::Part> stack;
            std::uint64_t pairs = 0;
            for (std::uint64_t i = block * kBlock; i < std::min(rays, (block + 1) * kBlock); ++i) {
                Vec3 from, way;
                if (!lines.draw(i, random, from, way)) continue;
                line.clear(), back.clear();
                tree.walk(from, -way, lines.length(from, -way), -1, stack, back);
                if (back.empty()) continue; // begins in something solid, or at a border
                std::reverse(back.begin(), back.end());
                line.swap(back);
                const std::size_t before = line.size();
                tree.walk(from, way, lines.length(from, way), 1, stack, line);
                if (line.size() == before) continue;
                for (std::size_t a = 0; a < line.size(); ++a)
                    for (std::size_t b = a + 1; b < line.size(); ++b) {
                        const std::uint32_t p = line[a].cluster, q = line[b].cluster;
                        ++pairs;
                        if (std::atomic_ref(proven[p * words + q / 64]).load(std::memory_order_relaxed) >> (q % 64) & 1) continue; // looked up before
                        if (v.sees(p, q) && v.sees(q, p)) {
                            for (const auto& [x, y] : {std::pair{p, q}, std::pair{q, p}}) {
                                std::atomic_ref word(proven[x * words + y / 64]);
                                const std::uint64_t bit = std::uint64_t{1} << (y % 64);
                                if (!(word.load(std::memory_order_relaxed) & bit)) word.fetch_or(bit, std::memory_order_relaxed);
                            }
                            continue;
                        }
                        missing.fetch_add(1);
                        const std::lock_guard lock(guard);
                        if (result.misses.size() < kMisses) result.misses.push_back({p, q, from + way * line[a].at, from + way * line[b].at});
                    }
            }
            checked.fetch_add(pairs);
        });
    result.rays = rays, result.pairs_checked = checked, result.missing = missing;
    for (const std::uint64_t w : v.rows) result.seen += static_cast<std::uint64_t>(std::popcount(w));
    for (const std::uint64_t w : proven) result.proven += static_cast<std::uint64_t>(std::popcount(w));
    return result;
}

} // namespace kiln::proof

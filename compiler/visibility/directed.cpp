#include "compiler/visibility/directed.h"
#include "libs/parallel/parallel.h"
#include <algorithm>

namespace kiln::vis {

std::vector<Directed> directed_portals(std::span<const VisPortal> portals) {
    std::vector<Directed> out(portals.size() * 2);
    for (std::size_t i = 0; i < portals.size(); ++i) {
        const std::vector<Vec3>& w = portals[i].winding;
        Vec3 center{}, area{};
        for (const Vec3& p : w) center += p;
        center *= 1.0 / static_cast<double>(std::max<std::size_t>(w.size(), 1));
        for (std::size_t k = 0; k < w.size(); ++k) area += cross(w[k] - center, w[(k + 1) % w.size()] - center);
        double radius = 0;
        for (const Vec3& p : w) radius = std::max(radius, length(p - center));
        const double size = length(area);
        const bool has_plane = size > kNoise * radius && size > 0;
        const Vec3 n = has_plane ? area / size : Vec3{};
        for (std::uint32_t back = 0; back < 2; ++back) {
            Directed& d = out[2 * i + back];
            d.winding = &w, d.points = w;
            d.plane.normal = back ? n : -n; // the winding's normal looks to the front cluster
            d.plane.distance = dot(d.plane.normal, center);
            d.has_plane = has_plane;
            d.from = back ? portals[i].cluster_back : portals[i].cluster_front;
            d.to = back ? portals[i].cluster_front : portals[i].cluster_back;
            d.center = center;
            d.radius = radius;
        }
    }
    return out;
}

Exits exits_of(std::span<const Directed> portals, std::uint32_t cluster_count) {
    Exits e;
    e.first.assign(cluster_count + 1, 0);
    for (const Directed& p : portals) ++e.first[p.from + 1];
    for (std::size_t c = 0; c < cluster_count; ++c) e.first[c + 1] += e.first[c];
    e.portal.resize(portals.size());
    std::vector<std::uint32_t> next(e.first.begin(), e.first.end() - 1);
    for (std::uint32_t p = 0; p < portals.size(); ++p) e.portal[next[portals[p].from]++] = p;
    return e;
}

namespace {

// Some point of `what` lies on the given side of the plane of `of`.
bool reaches_front(const Directed& of, const Directed& what) {
    if (!of.has_plane) return true;
    const double d = of.plane.at(what.center);
    if (d > kNoise) return true;
    if (d < -what.radius) return false;
    for (const Vec3& p : what.points)
        if (of.plane.at(p) > kNoise) return true;
    return false;
}
bool reaches_back(const Directed& of, const Directed& what) {
    if (!of.has_plane) return true;
    const double d = of.plane.at(what.center);
    if (d < -kNoise) return true;
    if (d > what.radius) return false;
    for (const Vec3& p : what.points)
        if (of.plane.at(p) < -kNoise) return true;
    return false;
}

// Least distance of two boxes: nothing of the one is nearer to anything of the other.
double distance(const Box3& a, const Box3& b) {
    Vec3 gap;
    for (std::size_t k = 0; k < 3; ++k) gap[k] = std::max({0.0, a.lo[k] - b.hi[k], b.lo[k] - a.hi[k]});
    return length(gap);
}

} // namespace

BitRows flood(std::span<const Directed> portals, const Exits& exits, double radius, Context& context) {
    const std::size_t n = portals.size();
    BitRows base(n, n), reach(n, n);
    std::vector<Box3> boxes(radius > 0 ? n : 0);
    for (std::size_t p = 0; p < boxes.size(); ++p)
        for (const Vec3& v : portals[p].points) boxes[p].add(v);
    parallel_for(context, n, [&](std::size_t p) {
        std::uint64_t* row = base.row(p);
        for (std::size_t q = 0; q < n; ++q)
            if (q / 2 != p / 2 && !(radius > 0 && distance(boxes[p], boxes[q]) > radius) && reaches_front(portals[p], portals[q]) && reaches_back(portals[q], portals[p]))
                set_bit(row, q);
    });
    parallel_for(context, n, [&](std::size_t p) {
        const std::uint64_t* front = base.row(p);
        std::uint64_t* row = reach.row(p);
        std::vector<std::uint32_t> open{static_cast<std::uint32_t>(p)};
        while (!open.empty()) {
            const std::uint32_t last = open.back();
            open.pop_back();
            const std::uint64_t* next = base.row(last);
            for (const std::uint32_t q : exits.of(portals[last].to))
                if (get_bit(front, q) && get_bit(next, q) && !get_bit(row, q)) set_bit(row, q), open.push_back(q);
        }
    });
    return reach;
}

} // namespace kiln::vis

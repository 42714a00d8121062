// Lines through portals. Private to compiler/visibility.
#pragma once
#include "compiler/visibility/directed.h"

namespace kiln {
class Random;
}

namespace kiln::vis {

// What a crossing asks of a portal, close together in memory.
class Windows {
public:
    explicit Windows(const DirectedPortals& portals);
    const Plane& plane(std::uint32_t p) const { return of_[p].plane; }
    std::uint32_t to(std::uint32_t p) const { return of_[p].to; }
    double noise() const { return noise_; }
    // Of a point in the plane of the portal: does it lie kInside within? Never, where the winding has no area.
    bool hold(std::uint32_t p, Vec3 x) const {
        const Window& w = of_[p];
        for (std::uint32_t i = w.first; i < w.last; ++i)
            if (edges_[i].at(x) < 0) return false;
        return w.first < w.last;
    }
    // Does the line pass forward through all of these, one after the other, as lines of sight do (directed.h)?
    bool line(std::span<const std::uint32_t> chain, Vec3 from, Vec3 way) const;

private:
    struct Window {
        Plane plane;
        std::uint32_t first = 0, last = 0, to = 0;
    };
    std::vector<Window> of_;
    std::vector<Plane> edges_; // normals in the portal's plane, looking in
    double noise_;
};

// What random lines prove of what `reach` holds: from portal to portal through the clusters, `rays` a way, aimed at that. Of what
// they prove the bits of `reach` are marked.
SparseRows proven(const DirectedPortals& portals, const Exits& exits, const Windows& windows, const SparseRows& reach, std::uint32_t rays, const std::function<bool()>& stop, Context& context);

Vec3 point_in(const std::vector<Vec3>& winding, Random& random); // uniform over it

} // namespace kiln::vis

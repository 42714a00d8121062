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
    // Of a point in the plane of the portal: does it lie inside by more than rounding? Never, where the winding has no area.
    bool hold(std::uint32_t p, Vec3 x) const;
    // Does the line pass forward through all of these, one after the other, as lines of sight do (directed.h)?
    bool line(std::span<const std::uint32_t> chain, Vec3 from, Vec3 way) const;

private:
    struct Edge {
        Vec3 normal; // in the portal's plane, looking in
        double distance = 0;
    };
    std::vector<Edge> edges_;
    std::vector<Plane> planes_;
    std::vector<std::uint32_t> first_;
    double noise_;
};

// What random lines prove of what `reach` holds: from portal to portal through the clusters, `rays` a way, aimed at that. Of what
// they prove the bits of `reach` are marked.
BitRows proven(const DirectedPortals& portals, const Exits& exits, const Windows& windows, const BitRows& reach, std::uint32_t rays, const std::function<bool()>& stop, Context& context);

Vec3 point_in(const std::vector<Vec3>& winding, Random& random); // uniform over it

} // namespace kiln::vis

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
    explicit Windows(std::span<const Directed> portals);
    // Of a point in the plane of the portal: does it lie inside by more than rounding? Never, where the winding has no area.
    bool hold(std::uint32_t p, Vec3 x) const;

private:
    struct Edge {
        Vec3 normal; // in the portal's plane, looking in
        double distance = 0;
    };
    std::vector<Edge> edges_;
    std::vector<std::uint32_t> first_;
};

Vec3 point_in(const std::vector<Vec3>& winding, Random& random); // uniform over it

} // namespace kiln::vis

// Seams: maps of surfaces that go on from one chart to another, and how differently a run time shows both sides of the edge.
#pragma once
#include "tests/support/world_builder.h"
#include "compiler/light/light.h"
#include <functional>
#include <string>
#include <vector>

namespace kiln::proof {

struct SeamMap {
    std::string name;
    test::WorldBuilder builder;
    std::vector<Light> lights;
    SurfacesOptions surfaces;
    std::function<bool(Vec3)> apart; // what stands on the edge there parts its sides; none: nowhere
    std::function<bool(Vec3)> dark;  // no light comes there; none: everywhere some does
};
// Coplanar, folded and curved ones; built anew.
std::vector<SeamMap> seam_maps();

struct SeamsFound {
    bool compiled = true;
    std::size_t points = 0;
    // Differences of what both sides show, over their mean (at least 2 % of the mean of all light): flat, and for normals that lean by up
    // to 30 degrees, the worst channel.
    double flat_p99 = 0, flat_most = 0, leaning_p99 = 0, leaning_most = 0;
    double dark = 0; // shown where no light comes, over the brightest luxel
    std::string where; // of the most
    std::size_t texels_baked = 0, texels = 0; // before and after coarser grids were chosen
};
// Through a level file and its loader, coarser grids (compiler/density) as a build chooses them; luxel_error: percent, 0: none. Points are taken from the mesh, three to a luxel, and 1/1024 unit off the edge.
SeamsFound find_seams_shown(SeamMap map, double error_percent, RnmEncoding encoding = RnmEncoding::dot, int threads = 1,
                            double luxel_error = -1);

} // namespace kiln::proof

// Liquid volumes: what hangs together under one surface.
//
// A pool is not what is connected: two basins at different heights may be joined by a pipe. So the surfaces are taken from
// the lowest up, each filling what it reaches without rising above its own height.
#include "compiler/bsp/build.h"
#include <algorithm>
#include <cmath>
#include <map>

namespace kiln::bsp {
namespace {

bool is_liquid(Contents c) { return c == Contents::water || c == Contents::slime || c == Contents::lava; }

struct Surface { // of one leaf, towards what is not the same liquid above it
    double z = 0;
    std::uint32_t leaf = 0;
    double area = 0;
    MaterialId material;
};

// The material on top of the liquid's brush in a leaf: the face in the plane of the surface, else the one that looks up most.
MaterialId top_material(const World& world, const Csg& csg, const PlaneTable& planes, const BspLeaf& leaf, PlaneId up) {
    MaterialId best;
    double most = -2;
    for (const BrushId b : leaf.brushes) {
        if (world.brushes[b.at()].contents != leaf.contents) continue;
        const BrushPolytope& brush = csg.brushes[b.at()];
        for (std::size_t f = 0; f < brush.faces.size(); ++f) {
            const MaterialId m = world.sides[brush.sides[f].at()].material;
            const double score = brush.faces[f].support == up ? 2 : planes.normal(brush.faces[f].support).z;
            if (score > most) most = score, best = m;
        }
    }
    return best;
}

} // namespace

void find_waters(const World& world, const Csg& csg, Bsp& bsp) {
    constexpr double kUpwards = 0.7; // a steeper boundary is a side of the liquid
    bsp.leaf_water.assign(bsp.leaves.size(), UINT32_MAX);
    const auto wet = [&](LeafId l) { return is_liquid(bsp.leaves[l.at()].contents) && bsp.leaves[l.at()].cluster.valid(); };
    std::vector<std::vector<std::uint32_t>> portals_of(bsp.leaves.size());
    std::vector<Surface> surfaces;
    for (std::uint32_t p = 0; p < bsp.portals.size(); ++p) {
        const BspPortal& portal = bsp.portals[p];
        const Vec3 n = bsp.planes.normal(portal.plane);
        for (const bool back : {false, true}) {
            const LeafId in = back ? portal.leaf_back : portal.leaf_front, out = back ? portal.leaf_front : portal.leaf_back;
            if (!wet(in)) continue;
            portals_of[in.at()].push_back(p);
            if (bsp.leaves[in.at()].contents == bsp.leaves[out.at()].contents || (back ? n.z : -n.z) < kUpwards) continue;
            double z = -HUGE_VAL;
            for (const Vec3& v : portal.winding) z = std::max(z, v.z);
            surfaces.push_back({z, in.value, area(portal.winding),
                                top_material(world, csg, bsp.planes, bsp.leaves[in.at()], back ? portal.plane : flipped(portal.plane))});
        }
    }
    std::ranges::sort(surfaces, {}, [](const Surface& s) { return std::tuple(s.z, s.leaf); });
    const auto fill = [&](std::uint32_t from, std::uint32_t number, double below) {
        WaterVolume& water = bsp.waters[number];
        std::vector<std::uint32_t> stack{from};
        bsp.leaf_water[from] = number;
        while (!stack.empty()) {
            const std::uint32_t at = stack.back();
            stack.pop_back();
            water.min_z = std::min(water.min_z, bsp.leaves[at].bounds.lo.z);
            if (!water.has_surface) water.surface_z = std::max(water.surface_z, bsp.leaves[at].bounds.hi.z);
            for (const std::uint32_t p : portals_of[at]) {
                const BspPortal& portal = bsp.portals[p];
                const std::uint32_t next = portal.leaf_front.value == at ? portal.leaf_back.value : portal.leaf_front.value;
                if (!wet(id<LeafId>(next)) || bsp.leaf_water[next] != UINT32_MAX || bsp.leaves[next].contents != water.contents) continue;
                if (bsp.leaves[next].bounds.hi.z > below) continue;
                bsp.leaf_water[next] = number;
                stack.push_back(next);
            }
        }
    };
    const auto add = [&](std::uint32_t leaf, bool has_surface, double z) {
        bsp.waters.push_back({bsp.leaves[leaf].contents, z, bsp.leaves[leaf].bounds.lo.z, has_surface, {}});
        return static_cast<std::uint32_t>(bsp.waters.size() - 1);
    };
    for (const Surface& s : surfaces)
        if (bsp.leaf_water[s.leaf] == UINT32_MAX) fill(s.leaf, add(s.leaf, true, s.z), s.z);
    for (std::uint32_t l = 0; l < bsp.leaves.size(); ++l)
        if (wet(id<LeafId>(l)) && bsp.leaf_water[l] == UINT32_MAX) {
            const std::uint32_t number = add(l, false, bsp.leaves[l].bounds.hi.z);
            fill(l, number, HUGE_VAL);
            bsp.waters[number].material = top_material(world, csg, bsp.planes, bsp.leaves[l], {});
        }
    std::vector<std::map<MaterialId, double>> areas(bsp.waters.size());
    for (const Surface& s : surfaces)
        if (s.material.valid()) areas[bsp.leaf_water[s.leaf]][s.material] += s.area;
    for (std::size_t w = 0; w < areas.size(); ++w) {
        double most = 0;
        for (const auto& [material, size] : areas[w])
            if (size > most) most = size, bsp.waters[w].material = material;
    }
}

} // namespace kiln::bsp

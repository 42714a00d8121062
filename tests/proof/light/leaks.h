// Leaks of light: maps of a bright place and a sealed dark one, and what of the bright one's light shows in the dark.
#pragma once
#include "tests/support/world_builder.h"
#include <functional>
#include <string>
#include <vector>

namespace kiln::proof {

struct LeakMap {
    std::string name;
    test::WorldBuilder builder;
    std::vector<Vec3> lamps;                // in the bright air
    std::function<bool(Vec3)> dark, bright; // strictly inside the one air, the other
};
// Over 60 maps, built anew: thin walls upright, turned and in fans, closets, corners, slabs, terrain, patches, detail, grates, doors.
std::vector<LeakMap> leak_maps();

struct LeakFound { // light there over that of the brightest luxel of the bright air
    double shown = 0;   // by a bilinear lookup of the atlas, anywhere on a face
    double luxel = 0;   // what was baked at a luxel all of whose footprint is in the dark
    double patch = 0;   // radiosity, over pi times the brightest reflected radiance
    double cube = 0;    // as a run time mixes ambient cubes, anywhere in the air
    std::size_t looked = 0; // lookups in the dark
    std::string where, cube_where; // of the most that is shown, of the brightest cube
    double worst() const { return std::max({shown, luxel, patch, cube}); }
    bool compiled = true;
};
LeakFound find_leaks(LeakMap map, double luxel_size, double error_percent);

} // namespace kiln::proof

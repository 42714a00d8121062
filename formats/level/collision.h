// SPDX-License-Identifier: MIT
// Brushes as traces want them: all planes of one in a row, its box, which brushes belong to a model; and curves. Private.
#pragma once
#include "formats/level/curve_collision.h"
#include <cstdint>
#include <vector>

struct kiln_level;

namespace kiln::level {

struct Collision {
    struct Plane {
        double normal[3], distance;
        std::uint32_t side; // into the brushes' planes; KILN_NO_INDEX: a bevel
    };
    struct Brush {
        double lo[3], hi[3]; // infinite where the level has no bevels
        std::uint32_t first_plane, plane_count;
        std::uint32_t model;
        std::uint32_t contents; // KILN_CONTENTS_ bit
        std::uint32_t stops;    // KILN_FOR_ bits
    };
    std::vector<Plane> planes;
    std::vector<Brush> brushes;
    std::vector<std::uint32_t> of_model; // all brushes, by model
    std::vector<std::uint32_t> unlisted; // of the world, in no leaf's list: triggers and their like
    Curves curves;
    std::size_t depth = 0; // of the tree, in nodes
    bool has_bevels = false;
};
Collision make_collision(const kiln_level& level); // throws Failure, Damaged

} // namespace kiln::level

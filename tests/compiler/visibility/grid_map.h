// Worlds of square cells, one wall height: small enough that rays tell the truth about who sees whom.
#pragma once
#include "compiler/visibility/visibility.h"
#include <random>
#include <string>
#include <vector>

namespace kiln::test {

struct GridMap {
    int width = 0, height = 0;
    std::vector<int> cluster; // per cell, row by row; -1: solid
    std::uint32_t cluster_count = 0;
    std::vector<VisPortal> portals;
    int at(int x, int y) const {
        return x < 0 || y < 0 || x >= width || y >= height ? -1 : cluster[static_cast<std::size_t>(y * width + x)];
    }
};

// Rows of text: '#' solid, anything else open; the first row is y = 0. With `runs`, open cells that follow each other in
// a row are one cluster, else each is its own. `turn` rotates the map about an odd axis, so that nothing is axial.
GridMap grid_map(const std::vector<std::string>& rows, bool runs = false, bool turn = false, double cell = 64);
std::vector<std::string> random_rows(std::mt19937& random, int width, int height, double solid_share);
// Rooms of 5 x 5 cells with walls between, a door in each wall, and blocks of clutter.
std::vector<std::string> rooms(std::mt19937& random, int across, int down);

// Pairs of clusters joined by an open segment between random points, `rays` tried; row-major cluster_count^2.
std::vector<char> proven_pairs(const GridMap& map, std::mt19937& random, int rays);

} // namespace kiln::test

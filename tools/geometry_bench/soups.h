// Levels of any size made of numbers alone, as the text of .map files: what the benchmark compiles.
#pragma once
#include <cstdint>
#include <string>

namespace kiln::bench {

enum class Soup : std::uint8_t {
    boxes,   // axis-aligned boxes on whole units, thrown into a sealed hall; about as many overlaps a box whatever the count
    turned,  // the same, all of it turned about two axes by odd angles, points rounded to 1/1024 unit
    tumbled, // the same with an orientation of its own for each box
    city,    // pillars of differing heights on a lattice, floor and sky a slab for each block: long lines of sight
    tiles,   // a floor of tiles whose tops a tool has spoiled by a few thousandths, under a hall: one sheet that returns to the grid
};
constexpr const char* kSoupNames[] = {"boxes", "turned", "tumbled", "city", "tiles"};

// About `brushes` brushes (city, tiles: the nearest square), a light and a player start. The same text each time.
std::string make_map(Soup soup, std::size_t brushes);

} // namespace kiln::bench

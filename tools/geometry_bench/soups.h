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
};
constexpr const char* kSoupNames[] = {"boxes", "turned", "tumbled", "city"};

// About `brushes` brushes (city: the nearest square of blocks), a light and a player start. The same text each time.
std::string make_map(Soup soup, std::size_t brushes);

} // namespace kiln::bench

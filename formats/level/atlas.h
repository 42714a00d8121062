// SPDX-License-Identifier: MIT
// Rectangles onto atlas pages: skyline packing, tallest first. Deterministic.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

namespace kiln::level {

struct AtlasRect { std::uint32_t width = 0, height = 0; };
struct AtlasPlace { std::uint32_t page = 0, x = 0, y = 0; };
struct Atlas {
    std::vector<AtlasPlace> places; // parallel to the rectangles
    std::vector<AtlasRect> pages;   // sizes, cut to what is used (multiples of 4)
};
// Pages are at most page_size on a side; a rectangle larger than that gets a page of its own size.
Atlas pack_atlas(std::span<const AtlasRect> rects, std::uint32_t page_size);

} // namespace kiln::level

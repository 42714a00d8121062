// SPDX-License-Identifier: MIT
#include "formats/level/atlas.h"
#include <algorithm>
#include <cmath>
#include <numeric>

namespace kiln::level {
namespace {

// The upper outline of what a page holds, as steps from left to right.
class Skyline {
public:
    Skyline(std::uint32_t width, std::uint32_t height) : width_(width), height_(height), steps_{{0, 0}} {}
    std::uint32_t used_width() const { return used_width_; }
    std::uint32_t used_height() const { return used_height_; }

    // Lowest place, leftmost among equals.
    bool place(AtlasRect r, std::uint32_t* x, std::uint32_t* y) {
        std::size_t best = steps_.size();
        std::uint32_t best_y = 0;
        for (std::size_t i = 0; i < steps_.size() && steps_[i].x + r.width <= width_; ++i) {
            std::uint32_t top = 0;
            for (std::size_t j = i; j < steps_.size() && steps_[j].x < steps_[i].x + r.width; ++j)
                top = std::max(top, steps_[j].y);
            if (top + r.height > height_) continue;
            if (best == steps_.size() || top < best_y) best = i, best_y = top;
        }
        if (best == steps_.size()) return false;
        *x = steps_[best].x, *y = best_y;
        raise(best, r.width, best_y + r.height);
        used_width_ = std::max(used_width_, *x + r.width);
        used_height_ = std::max(used_height_, *y + r.height);
        return true;
    }

private:
    struct Step { std::uint32_t x, y; };
    std::uint32_t width_, height_, used_width_ = 0, used_height_ = 0;
    std::vector<Step> steps_;

    void raise(std::size_t i, std::uint32_t width, std::uint32_t top) {
        const std::uint32_t x = steps_[i].x, end = x + width;
        std::size_t j = i;
        std::uint32_t last = 0; // height where the new step ends
        while (j < steps_.size() && steps_[j].x < end) last = steps_[j++].y;
        const bool reaches_next = (j < steps_.size() ? steps_[j].x : width_) == end;
        std::vector<Step> with{{x, top}};
        if (!reaches_next) with.push_back({end, last});
        steps_.erase(steps_.begin() + static_cast<std::ptrdiff_t>(i), steps_.begin() + static_cast<std::ptrdiff_t>(j));
        steps_.insert(steps_.begin() + static_cast<std::ptrdiff_t>(i), with.begin(), with.end());
    }
};

std::uint32_t rounded_up(std::uint32_t n) { return (n + 3) / 4 * 4; }

} // namespace

Atlas pack_atlas(std::span<const AtlasRect> rects, std::uint32_t page_size) {
    Atlas atlas;
    atlas.places.resize(rects.size());
    std::vector<std::uint32_t> order(rects.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
        if (rects[a].height != rects[b].height) return rects[a].height > rects[b].height;
        if (rects[a].width != rects[b].width) return rects[a].width > rects[b].width;
        return a < b;
    });

    // A page just wide enough that all might fit on one square page, within the limit.
    std::uint64_t area = 0;
    std::uint32_t widest = 1;
    for (const AtlasRect r : rects)
        if (r.width <= page_size && r.height <= page_size)
            area += std::uint64_t{r.width} * r.height, widest = std::max(widest, r.width);
    const auto side = static_cast<std::uint32_t>(std::ceil(std::sqrt(static_cast<double>(area) * 1.08)));
    const std::uint32_t width = std::min(page_size, rounded_up(std::max(widest, side)));

    std::vector<Skyline> pages;
    std::vector<std::uint32_t> number; // of the page in the atlas
    for (const std::uint32_t i : order) {
        const AtlasRect r = rects[i];
        AtlasPlace& place = atlas.places[i];
        if (r.width > page_size || r.height > page_size) {
            place.page = static_cast<std::uint32_t>(atlas.pages.size());
            atlas.pages.push_back(r);
            continue;
        }
        std::size_t p = 0;
        while (p < pages.size() && !pages[p].place(r, &place.x, &place.y)) ++p;
        if (p == pages.size()) {
            pages.emplace_back(width, page_size);
            number.push_back(static_cast<std::uint32_t>(atlas.pages.size()));
            atlas.pages.push_back({});
            pages.back().place(r, &place.x, &place.y);
        }
        place.page = number[p];
    }
    for (std::size_t p = 0; p < pages.size(); ++p)
        atlas.pages[number[p]] = {rounded_up(pages[p].used_width()), rounded_up(pages[p].used_height())};
    return atlas;
}

} // namespace kiln::level

#include "formats/level/atlas.h"
#include <algorithm>
#include <gtest/gtest.h>
#include <random>

namespace kiln::level {
namespace {

void expect_disjoint(const std::vector<AtlasRect>& rects, const Atlas& atlas) {
    std::vector<std::vector<char>> taken;
    for (const AtlasRect p : atlas.pages) taken.emplace_back(std::size_t{p.width} * p.height, 0);
    for (std::size_t i = 0; i < rects.size(); ++i) {
        const AtlasPlace at = atlas.places[i];
        ASSERT_LT(at.page, atlas.pages.size());
        const AtlasRect page = atlas.pages[at.page];
        ASSERT_LE(at.x + rects[i].width, page.width);
        ASSERT_LE(at.y + rects[i].height, page.height);
        for (std::uint32_t y = 0; y < rects[i].height; ++y)
            for (std::uint32_t x = 0; x < rects[i].width; ++x)
                ASSERT_FALSE(taken[at.page][std::size_t{at.y + y} * page.width + at.x + x]++) << "rectangle " << i;
    }
}

std::vector<AtlasRect> random_rects(std::uint32_t seed, int n) {
    std::mt19937 random(seed);
    std::vector<AtlasRect> rects;
    for (int i = 0; i < n; ++i) {
        const std::uint32_t most = random() % 10 ? 24 : 120;
        rects.push_back({3 + static_cast<std::uint32_t>(random()) % most, 3 + static_cast<std::uint32_t>(random()) % most});
    }
    return rects;
}

} // namespace

TEST(LevelAtlas, RectanglesDoNotOverlap) {
    for (std::uint32_t seed = 1; seed < 6; ++seed) {
        const auto rects = random_rects(seed, 700);
        for (const std::uint32_t page : {128u, 256u, 1024u}) expect_disjoint(rects, pack_atlas(rects, page));
    }
}

TEST(LevelAtlas, FillsMostOfAPage) {
    const auto rects = random_rects(9, 2000);
    const Atlas atlas = pack_atlas(rects, 4096);
    ASSERT_EQ(atlas.pages.size(), 1u);
    double used = 0;
    for (const AtlasRect r : rects) used += double(r.width) * r.height;
    EXPECT_GT(used / (double(atlas.pages[0].width) * atlas.pages[0].height), 0.85);
}

TEST(LevelAtlas, LargeRectanglesGetTheirOwnPage) {
    const std::vector<AtlasRect> rects{{4, 4}, {300, 20}, {8, 2000}, {4, 4}};
    const Atlas atlas = pack_atlas(rects, 256);
    expect_disjoint(rects, atlas);
    EXPECT_EQ(atlas.pages.size(), 3u);
    EXPECT_EQ(atlas.places[0].page, atlas.places[3].page);
}

TEST(LevelAtlas, NothingGivesNothing) { EXPECT_TRUE(pack_atlas({}, 1024).pages.empty()); }

} // namespace kiln::level

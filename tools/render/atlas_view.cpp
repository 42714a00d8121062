#include "tools/render/colours.h"
#include "tools/render/parts.h"
#include "tools/render/render.h"
#include <optional>

namespace kiln {
namespace {

constexpr int kGap = 4; // pixels between pages

Result<kiln_page> page_of(const kiln_level* level, std::uint32_t number) {
    kiln_page page{};
    const kiln_status status = kiln_level_page(level, number, &page);
    if (status == KILN_BAD_ARGUMENT)
        return fault(Exit::usage, "no-such-page", "the atlas has no page " + std::to_string(number));
    if (status != KILN_OK) return damaged("lightmap", status);
    return page;
}

Rgb texel(const kiln_level* level, std::uint32_t page, std::uint32_t layer, int x, int y) {
    float rgb[3] = {};
    kiln_level_page_texel(level, page, layer, static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y), rgb);
    return {rgb[0], rgb[1], rgb[2]};
}

Image beneath_each_other(const std::vector<Image>& pages) {
    int width = 1, height = 0;
    for (const Image& p : pages) width = std::max(width, p.width), height += p.height + (height ? kGap : 0);
    Image out(width, std::max(1, height), 3);
    int top = 0;
    for (const Image& p : pages) {
        for (int y = 0; y < p.height; ++y)
            for (int x = 0; x < p.width; ++x)
                for (int c = 0; c < 3; ++c) out.at(x, top + y, c) = p.at(x, y, c);
        top += p.height + kGap;
    }
    return out;
}

template <class Make> Result<Image> all_pages(const kiln_level* level, const Make& make) {
    kiln_info info{};
    kiln_level_info(level, &info);
    if (info.charts && !kiln_level_charts(level, nullptr)) return damaged("chart table");
    std::vector<Image> pages;
    std::uint64_t samples = 0;
    for (std::uint32_t p = 0; p < info.pages; ++p) {
        Result<Image> page = make(p);
        if (!page) return page.fault();
        samples += page->pixels.size();
        if (samples > kMaxImageSamples / 2)
            return fault(Exit::limit, "picture-too-large", "the atlas is too large for one picture; ask for single pages");
        pages.push_back(std::move(*page));
    }
    return beneath_each_other(pages);
}

void put(Image& image, int x, int y, Rgb colour) {
    for (int c = 0; c < 3; ++c) image.at(x, y, c) = colour[static_cast<std::size_t>(c)];
}

} // namespace

Result<Image> render_atlas_page(const kiln_level* level, std::uint32_t number, int layer) {
    const Result<kiln_page> page = page_of(level, number);
    if (!page) return page.fault();
    kiln_info info{};
    kiln_level_info(level, &info);
    if (layer < -1 || layer > 2) return fault(Exit::usage, "no-such-layer", "atlas layers are 0, 1, 2, and -1: flat");
    Image out(static_cast<int>(page->width), static_cast<int>(page->height), 3);
    for (int y = 0; y < out.height; ++y)
        for (int x = 0; x < out.width; ++x) {
            Rgb v{};
            if (page->layers == 1) {
                v = texel(level, number, 0, x, y);
            } else if (layer >= 0) {
                v = texel(level, number, static_cast<std::uint32_t>(layer), x, y);
            } else if (page->layers == 4) {
                v = texel(level, number, 3, x, y);
            } else {
                for (std::uint32_t k = 0; k < 3; ++k) v += texel(level, number, k, x, y);
                v = v * (info.rnm_encoding == KILN_RNM_SQ ? 1.0f / 3 : 0.577350269f);
            }
            put(out, x, y, v);
        }
    return out;
}

Result<Image> render_atlas(const kiln_level* level, int layer) {
    return all_pages(level, [&](std::uint32_t p) { return render_atlas_page(level, p, layer); });
}

Result<Image> render_false_colour(const kiln_level* level, FalseColour kind) {
    return all_pages(level, [&](std::uint32_t p) -> Result<Image> {
        kiln_page page{};
        if (const kiln_status s = kiln_level_page_info(level, p, &page); s != KILN_OK) return damaged("chart table", s);
        Image out(static_cast<int>(page.width), static_cast<int>(page.height), 3);
        if (kind == FalseColour::luxel_density) {
            for (const kiln_chart& c : part(level, kiln_level_charts)) {
                if (c.page != p) continue;
                for (std::uint32_t y = 0; y < c.height; ++y)
                    for (std::uint32_t x = 0; x < c.width; ++x)
                        put(out, static_cast<int>(c.page_x + x), static_cast<int>(c.page_y + y),
                            luxel_colour(texel_size(c)) * ((x + y) & 1 ? 1.0f : 0.8f));
            }
            return out;
        }
        const std::size_t n = std::size_t{page.width} * page.height;
        std::vector<std::uint8_t> valid(n);
        std::vector<float> error(n);
        if (const kiln_status s = kiln_level_page_quality(level, p, valid.data(), error.data()); s != KILN_OK)
            return damaged("texel quality (stripped levels have none)", s);
        for (std::size_t i = 0; i < n; ++i) {
            const int x = static_cast<int>(i % page.width), y = static_cast<int>(i / page.width);
            put(out, x, y, kind == FalseColour::validity ? validity_colour(valid[i])
                           : valid[i] == 1               ? error_colour(error[i])
                                                         : Rgb{});
        }
        return out;
    });
}

} // namespace kiln

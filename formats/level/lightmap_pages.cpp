// SPDX-License-Identifier: MIT
// Flat charts and directional charts go to pages of their own, so that a flat page costs one layer. Of a dot or sq
// page the flat value is left out: (l0 + l1 + l2)/sqrt(3), or the mean, gives it back. Neither formula does so for
// the tilted encoding, whose pages therefore carry it as a fourth layer. Charts whose texels are stored as the same bytes share one place.
#include "formats/level/lightmap_pages.h"
#include "formats/level/atlas.h"
#include "formats/level/numbers.h"
#include <map>

namespace kiln::level {
namespace {

// A power of two that brings the largest magnitude of a page into the format; 1 but for extreme light.
float page_scale(float largest) {
    float scale = 1;
    while (largest / scale > 60000.0f) scale *= 2;
    return scale;
}

struct PageWriter {
    const LevelContent& content;
    LightmapPages& out;

    Float3 value(std::uint32_t chart, std::size_t texel, std::uint32_t layer) const {
        if (!content.charts[chart].directional || layer == 3) return content.flat[content.chart_first_texel[chart] + texel];
        return content.rnm[content.chart_first_rnm[chart] + texel][layer];
    }

    void write(std::uint32_t page, const std::vector<std::uint32_t>& charts) {
        PageInfo& info = out.pages[page];
        float largest = 0;
        for (const std::uint32_t c : charts) {
            const std::size_t n = std::size_t{content.charts[c].width} * content.charts[c].height;
            for (std::uint32_t layer = 0; layer < info.layers; ++layer)
                for (std::size_t i = 0; i < n; ++i)
                    for (const float v : value(c, i, layer))
                        if (std::abs(v) <= 3e38f) largest = std::max(largest, std::abs(v));
        }
        info.scale = page_scale(largest);
        const std::size_t size = texel_size(info.format);
        Blob& texels = out.texels[page];
        texels.assign(page_size(info), 0);
        const bool quality = !content.valid.empty() || !content.texel_error.empty();
        Blob& q = out.quality[page];
        const std::size_t page_texels = std::size_t{info.width} * info.height;
        if (quality) q.assign(2 * page_texels, 0);
        for (const std::uint32_t c : charts) {
            const kiln_chart& chart = out.charts[c];
            const bool shared = out.same_as[c] != c; // its texels are there; of what is known of them, the worst holds for both
            for (std::uint32_t y = 0; y < chart.height; ++y)
                for (std::uint32_t x = 0; x < chart.width; ++x) {
                    const std::size_t from = std::size_t{y} * chart.width + x;
                    const std::size_t to = std::size_t{chart.page_y + y} * info.width + chart.page_x + x;
                    for (std::uint32_t layer = 0; layer < info.layers && !shared; ++layer)
                        put(texels.data() + (layer * page_texels + to) * size, value(c, from, layer), info);
                    if (!quality) continue;
                    const std::size_t all = content.chart_first_texel[c] + from;
                    if (!content.valid.empty() && (q[to] == 0 || content.valid[all] == 1)) q[to] = content.valid[all];
                    if (!content.texel_error.empty()) q[page_texels + to] = std::max(q[page_texels + to], error_code(content.texel_error[all]));
                }
        }
    }

    // A chart's texels as they would be stored on a page of their own.
    Blob stored(std::uint32_t c, std::uint32_t layers, std::uint32_t format) const {
        const std::size_t n = std::size_t{content.charts[c].width} * content.charts[c].height;
        PageInfo info{content.charts[c].width, content.charts[c].height, layers, format, 1.0f};
        float largest = 0;
        for (std::uint32_t layer = 0; layer < layers; ++layer)
            for (std::size_t i = 0; i < n; ++i)
                for (const float v : value(c, i, layer))
                    if (std::abs(v) <= 3e38f) largest = std::max(largest, std::abs(v));
        info.scale = page_scale(largest);
        Blob out(page_size(info) + 12);
        std::memcpy(out.data(), &info.width, 4), std::memcpy(out.data() + 4, &info.height, 4), std::memcpy(out.data() + 8, &info.scale, 4);
        for (std::uint32_t layer = 0; layer < layers; ++layer)
            for (std::size_t i = 0; i < n; ++i) put(out.data() + 12 + (layer * n + i) * texel_size(format), value(c, i, layer), info);
        return out;
    }

    static void put(std::uint8_t* at, Float3 value, const PageInfo& info) {
        for (float& v : value) v /= info.scale;
        if (info.format == KILN_TEXEL_RGB9E5) {
            const std::uint32_t packed = rgb9e5_from_float(value);
            std::memcpy(at, &packed, 4);
        } else {
            for (std::size_t c = 0; c < 3; ++c) {
                const std::uint16_t h = half_from_float(value[c]);
                std::memcpy(at + 2 * c, &h, 2);
            }
        }
    }
};

template <class A> void copy(A& to, const auto& from) { std::copy(from.begin(), from.end(), to); }

} // namespace

LightmapPages make_pages(const LevelContent& content, const WriteOptions& options) {
    LightmapPages out;
    const std::size_t n = content.charts.size();
    if (content.chart_first_texel.size() != n || content.chart_first_rnm.size() != n)
        throw std::invalid_argument("charts and their texel ranges have different lengths");
    for (const auto* per_texel : {&content.valid})
        if (!per_texel->empty() && per_texel->size() != content.flat.size())
            throw std::invalid_argument("validity is not per texel");
    if (!content.texel_error.empty() && content.texel_error.size() != content.flat.size())
        throw std::invalid_argument("texel error is not per texel");
    for (std::size_t i = 0; i < n; ++i) {
        const ChartInfo& c = content.charts[i];
        const std::uint64_t texels = std::uint64_t{c.width} * c.height;
        if (texels == 0 || c.width > kMaxPageEdge || c.height > kMaxPageEdge)
            throw std::invalid_argument("chart " + std::to_string(i) + " has an impossible size");
        if (content.chart_first_texel[i] + texels > content.flat.size())
            throw std::invalid_argument("chart " + std::to_string(i) + " reaches past the texels");
        if (c.directional && content.chart_first_rnm[i] + texels > content.rnm.size())
            throw std::invalid_argument("chart " + std::to_string(i) + " reaches past the directional texels");
        kiln_chart k{};
        copy(k.origin, c.origin), copy(k.s, c.s), copy(k.t, c.t);
        copy(k.tangent, c.tangent), copy(k.bitangent, c.bitangent), copy(k.normal, c.normal);
        k.luxel_size = c.luxel_size, k.width = c.width, k.height = c.height;
        k.directional = c.directional, k.smooth = c.smooth, k.error = c.error;
        out.charts.push_back(k);
    }

    out.same_as.resize(n);
    for (std::uint32_t i = 0; i < n; ++i) out.same_as[i] = i;
    for (const bool directional : {false, true}) {
        const bool non_negative = !directional || content.rnm_encoding == KILN_RNM_SQ;
        const std::uint32_t layers = !directional ? 1u : content.rnm_encoding == KILN_RNM_TILTED ? 4u : 3u;
        const std::uint32_t format = options.rgb9e5 && non_negative ? KILN_TEXEL_RGB9E5 : KILN_TEXEL_HALF3;
        PageWriter writer{content, out};
        std::vector<std::uint32_t> members, of_kind; // those that need a place of their own; all
        std::vector<AtlasRect> rects;
        std::map<Blob, std::uint32_t> known;
        for (std::uint32_t i = 0; i < n; ++i) {
            if (content.charts[i].directional != directional) continue;
            of_kind.push_back(i);
            if (options.share_texels) {
                const auto [at, first_of_them] = known.try_emplace(writer.stored(i, layers, format), i);
                out.same_as[i] = at->second;
                if (!first_of_them) continue;
            }
            members.push_back(i), rects.push_back({content.charts[i].width, content.charts[i].height});
        }
        known.clear();
        const Atlas atlas = pack_atlas(rects, options.page_size);
        const auto first = static_cast<std::uint32_t>(out.pages.size());
        std::vector<std::vector<std::uint32_t>> on_page(atlas.pages.size());
        for (std::size_t i = 0; i < members.size(); ++i) {
            kiln_chart& c = out.charts[members[i]];
            c.page = first + atlas.places[i].page, c.page_x = atlas.places[i].x, c.page_y = atlas.places[i].y;
        }
        for (const std::uint32_t i : of_kind) {
            kiln_chart& c = out.charts[i];
            const kiln_chart& place = out.charts[out.same_as[i]];
            c.page = place.page, c.page_x = place.page_x, c.page_y = place.page_y;
            on_page[c.page - first].push_back(i);
        }
        for (const AtlasRect r : atlas.pages) out.pages.push_back({r.width, r.height, layers, format, 1.0f});
        out.texels.resize(out.pages.size()), out.quality.resize(out.pages.size());
        for (std::size_t p = 0; p < on_page.size(); ++p)
            writer.write(first + static_cast<std::uint32_t>(p), on_page[p]);
    }
    return out;
}

} // namespace kiln::level

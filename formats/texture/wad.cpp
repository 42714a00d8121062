#include "formats/texture/wad.h"
#include "formats/texture/little_endian.h"
#include "libs/image/image.h"
#include <algorithm>
#include <array>
#include <cstring>
#include <fmt/format.h>
#include <map>
#include <tuple>

namespace kiln {
namespace {

constexpr std::size_t kHeader = 12, kEntry = 32, kMiptex = 40, kPalette = 768;
constexpr int kMostSize = 16384; // texels along a side, as of material files
constexpr std::uint8_t kMiptexOfQuake = 0x44, kMiptexOfHalfLife = 0x43;
constexpr std::size_t kHole = 255; // palette index that is a hole in textures whose name begins with {

using texture::u32;
std::string name_at(std::span<const std::uint8_t> b, std::size_t at) { // 16 bytes, ended by a zero where it is shorter
    const auto* first = reinterpret_cast<const char*>(b.data() + at);
    return {first, strnlen(first, 16)};
}

TexelPicture with_holes(std::span<const std::uint8_t> texels, std::span<const std::uint8_t> palette, int width, int height) {
    TexelPicture out{width, height, {}};
    out.rgba.reserve(4 * texels.size());
    for (const std::uint8_t t : texels) {
        for (std::size_t c = 0; c < 3; ++c) out.rgba.push_back(palette.empty() ? std::uint8_t{0} : palette[3 * std::size_t{t} + c]);
        out.rgba.push_back(t == kHole ? 0 : 255);
    }
    return out;
}

std::optional<Rgbd> mean_colour(std::span<const std::uint8_t> texels, std::span<const std::uint8_t> palette, bool holes) {
    std::array<std::uint64_t, 256> count{};
    for (const std::uint8_t t : texels) ++count[t];
    if (holes) count[kHole] = 0;
    Rgbd sum{};
    double weight = 0;
    for (std::size_t i = 0; i < 256; ++i) {
        const auto linear = [&](std::size_t c) { return static_cast<double>(linear_from_srgb(static_cast<float>(palette[3 * i + c]) / 255.0f)); };
        const auto n = static_cast<double>(count[i]);
        if (n > 0) sum += n * Rgbd{linear(0), linear(1), linear(2)}, weight += n;
    }
    return weight > 0 ? std::optional(sum / weight) : std::nullopt;
}

} // namespace

Result<Wad> read_wad(std::span<const std::uint8_t> bytes, std::span<const std::uint8_t> palette, const std::string& file, const WantedTexture& wanted, Context& context) {
    const auto no = [&](std::string message) { return fault(Exit::input, "texture-unreadable", std::move(message), {.file = file}); };
    if (bytes.size() < kHeader || (std::memcmp(bytes.data(), "WAD2", 4) != 0 && std::memcmp(bytes.data(), "WAD3", 4) != 0))
        return no("this is no WAD2 or WAD3 archive");
    Wad out;
    out.own_palettes = bytes[3] == '3';
    const std::size_t count = u32(bytes, 4), directory = u32(bytes, 8);
    if (directory > bytes.size() || count > (bytes.size() - directory) / kEntry)
        return no(fmt::format("its directory of {} entries lies beyond the end of the file", count));
    std::map<std::tuple<std::size_t, std::size_t, bool>, std::optional<Rgbd>> means;
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t entry = directory + i * kEntry;
        if (bytes[entry + 12] != (out.own_palettes ? kMiptexOfHalfLife : kMiptexOfQuake)) continue;
        const std::string listed = name_at(bytes, entry + 16);
        if (!listed.empty() && !wanted(listed)) continue; // the same name stands in the texture
        const auto left_out = [&](const char* why) {
            context.report(Severity::warning, "texture-unreadable", fmt::format("the texture '{}' {}; it is left out", listed, why), {.file = file});
        };
        const std::size_t at = u32(bytes, entry), stored = u32(bytes, entry + 4);
        if (bytes[entry + 13] != 0) {
            left_out("is compressed, which no game can read");
            continue;
        }
        if (at > bytes.size() || stored > bytes.size() - at || stored < kMiptex) {
            left_out("lies beyond the end of the file");
            continue;
        }
        const std::span<const std::uint8_t> miptex = bytes.subspan(at, stored);
        const std::uint32_t width = u32(miptex, 16), height = u32(miptex, 20);
        if (width == 0 || height == 0 || width > kMostSize || height > kMostSize) {
            left_out("has an impossible size");
            continue;
        }
        WadTexture texture{name_at(miptex, 0), static_cast<int>(width), static_cast<int>(height), std::nullopt, {}};
        if (texture.name.empty()) texture.name = listed;
        if (!wanted(texture.name)) continue;
        const std::size_t texels = std::size_t{width} * height, first = u32(miptex, 24);
        if (first > miptex.size() || texels > miptex.size() - first) {
            left_out("is cut short");
            continue;
        }
        std::span<const std::uint8_t> colours = palette;
        if (out.own_palettes) { // after the smallest of four sizes, behind its own count
            const std::size_t after = std::size_t{u32(miptex, 36)} + std::size_t{width / 8} * (height / 8) + 2;
            colours = after <= miptex.size() && kPalette <= miptex.size() - after ? miptex.subspan(after, kPalette) : std::span<const std::uint8_t>();
        }
        // Entries may share what they name.
        const auto [known, fresh] = means.try_emplace({at, stored, texture.name.starts_with('{')});
        if (fresh && colours.size() >= kPalette) {
            context.check_cancelled();
            known->second = mean_colour(miptex.subspan(first, texels), colours, texture.name.starts_with('{'));
        }
        texture.mean = known->second;
        if (texture.name.starts_with('{'))
            texture.holed = with_holes(miptex.subspan(first, texels), colours.size() >= kPalette ? colours : std::span<const std::uint8_t>(), texture.width, texture.height);
        out.textures.push_back(std::move(texture));
    }
    return out;
}

} // namespace kiln

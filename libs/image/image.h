// Images in memory and as PNG, EXR and TGA bytes.
//
// Space    pixels are float, row-major from the top left, channels interleaved; linear light unless a function is
//          told otherwise. 1 channel: grey, 2: grey + alpha, 3: RGB, 4: RGBA; EXR takes any number with names.
// Errors   readers take bytes, trust no length in them, and give a Fault (Exit::input) for whatever they cannot read
#pragma once
#include "libs/core/archive.h"
#include "libs/core/result.h"
#include <span>
#include <string>
#include <vector>

namespace kiln {

struct Image {
    int width = 0, height = 0, channels = 0;
    std::vector<float> pixels;      // width * height * channels
    std::vector<std::string> names; // of the channels; empty: Y, YA, RGB, RGBA by their number

    Image() = default;
    Image(int w, int h, int c, float value = 0);
    float& at(int x, int y, int c) { return pixels[index(x, y, c)]; }
    float at(int x, int y, int c) const { return pixels[index(x, y, c)]; }
    template <class A> void fields(A& a) { a(width, height, channels, pixels, names); }

private:
    std::size_t index(int x, int y, int c) const {
        return (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) *
                   static_cast<std::size_t>(channels) +
               static_cast<std::size_t>(c);
    }
};

// How stored integers relate to light: colours are sRGB, normal maps and masks are linear. Alpha is always linear.
enum class Transfer : std::uint8_t { linear, srgb };
float srgb_from_linear(float linear); // IEC 61966-2-1, for values in [0,1]
float linear_from_srgb(float srgb);

// PNG: 1 to 4 channels, values clamped to [0,1] (NaN: 0), 8 or 16 bits. Palettes and low depths are expanded on reading.
Result<Bytes> encode_png(const Image& image, Transfer transfer = Transfer::srgb, int bits = 8);
Result<Image> decode_png(std::span<const std::uint8_t> bytes, Transfer transfer = Transfer::srgb);

// EXR: scan lines, one part; half (saturating at 65504) or float samples, always linear.
enum class ExrCompression : std::uint8_t { piz, zip, none };
struct ExrOptions {
    bool half = true;
    ExrCompression compression = ExrCompression::piz;
};
Result<Bytes> encode_exr(const Image& image, const ExrOptions& options = {});
// Channels come in the order R G B A (or Y A) where the file has exactly those, else by name.
Result<Image> decode_exr(std::span<const std::uint8_t> bytes);

Result<Image> decode_tga(std::span<const std::uint8_t> bytes, Transfer transfer = Transfer::srgb);

// Files. The reader is chosen by content (TGA, which has no magic number, by the name's ending).
Result<Image> read_image(const std::string& path, Transfer transfer = Transfer::srgb);
Result<bool> write_png(const std::string& path, const Image& image, Transfer transfer = Transfer::srgb, int bits = 8);
Result<bool> write_exr(const std::string& path, const Image& image, const ExrOptions& options = {});
Result<Image> read_png(const std::string& path, Transfer transfer = Transfer::srgb);
Result<Image> read_exr(const std::string& path);

// No image of ours comes near these; a file that claims more is damaged or hostile.
constexpr int kMaxImageEdge = 32768;
constexpr std::size_t kMaxImageSamples = std::size_t{1} << 28; // width * height * channels: 1 GiB of floats

} // namespace kiln

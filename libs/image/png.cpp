// libpng reports errors by longjmp: the functions that call setjmp own nothing with a destructor; what must be
// freed lives with their callers.
#include "libs/image/image.h"
#include "libs/image/quantise.h"
#include <algorithm>
#include <csetjmp>
#include <cstring>
#include <fmt/format.h>
#include <png.h>

namespace kiln {
namespace {

struct PngRead {
    std::span<const std::uint8_t> left;
    char message[160] = {};
    png_uint_32 width = 0, height = 0;
    int channels = 0, bits = 0;
    Bytes rows;
    std::vector<png_bytep> row_pointers;
};

void on_error(png_structp png, png_const_charp text) {
    auto* message = static_cast<char*>(png_get_error_ptr(png));
    std::strncpy(message, text, 159);
    png_longjmp(png, 1);
}
void on_warning(png_structp, png_const_charp) {} // harmless oddities of a file: nothing a user should act on

void on_read(png_structp png, png_bytep out, png_size_t size) {
    auto* state = static_cast<PngRead*>(png_get_io_ptr(png));
    if (size > state->left.size()) png_error(png, "the file ends early");
    std::memcpy(out, state->left.data(), size);
    state->left = state->left.subspan(size);
}

bool read_head(png_structp png, png_infop info, PngRead& state) {
    if (setjmp(png_jmpbuf(png))) return false;
    png_set_read_fn(png, &state, on_read);
    png_set_user_limits(png, kMaxImageEdge, kMaxImageEdge);
    png_set_chunk_malloc_max(png, 16u << 20);
    png_read_info(png, info);
    png_set_expand(png); // palette, low depths and tRNS to full channels
    png_set_swap(png);   // 16 bits: little-endian as we are
    png_set_interlace_handling(png);
    png_read_update_info(png, info);
    state.width = png_get_image_width(png, info);
    state.height = png_get_image_height(png, info);
    state.channels = png_get_channels(png, info);
    state.bits = png_get_bit_depth(png, info);
    return true;
}

bool read_rows(png_structp png, PngRead& state) {
    if (setjmp(png_jmpbuf(png))) return false;
    png_read_image(png, state.row_pointers.data());
    png_read_end(png, nullptr);
    return true;
}

struct PngWrite {
    Bytes bytes;
    char message[160] = {};
};

void on_write(png_structp png, png_bytep data, png_size_t size) {
    auto& bytes = static_cast<PngWrite*>(png_get_io_ptr(png))->bytes;
    bytes.insert(bytes.end(), data, data + size);
}
void on_flush(png_structp) {}

bool write_rows(png_structp png, png_infop info, PngWrite& state, const Image& image, Transfer transfer, int bits,
                std::vector<png_bytep>& rows) {
    if (setjmp(png_jmpbuf(png))) return false;
    static constexpr int kColorType[] = {0, PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB,
                                         PNG_COLOR_TYPE_RGB_ALPHA};
    png_set_write_fn(png, &state, on_write, on_flush);
    png_set_IHDR(png, info, static_cast<png_uint_32>(image.width), static_cast<png_uint_32>(image.height), bits,
                 kColorType[image.channels], PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    if (transfer == Transfer::srgb) png_set_sRGB(png, info, PNG_sRGB_INTENT_RELATIVE);
    png_write_info(png, info);
    if (bits == 16) png_set_swap(png);
    png_write_image(png, rows.data());
    png_write_end(png, info);
    return true;
}

} // namespace

Result<Image> decode_png(std::span<const std::uint8_t> bytes, Transfer transfer) {
    PngRead state;
    state.left = bytes;
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, state.message, on_error, on_warning);
    png_infop info = png ? png_create_info_struct(png) : nullptr;
    const auto done = [&] { png_destroy_read_struct(&png, &info, nullptr); };
    const auto broken = [&](const std::string& what) {
        done();
        return fault(Exit::input, "png-broken", what);
    };
    if (!info) return broken("libpng cannot be started");
    if (!read_head(png, info, state)) return broken(fmt::format("PNG cannot be read: {}", state.message));

    const std::size_t row = png_get_rowbytes(png, info);
    const std::size_t samples = std::size_t{state.width} * state.height * static_cast<std::size_t>(state.channels);
    // Deflate expands at most 1032-fold: a head that promises more than its bytes can hold is a lie.
    if (samples > kMaxImageSamples || std::size_t{state.width} * state.height / 8 > bytes.size() * 1032)
        return broken(fmt::format("PNG claims {} x {} texels, more than its {} bytes can hold", state.width,
                                  state.height, bytes.size()));
    state.rows.resize(row * state.height);
    for (std::size_t y = 0; y < state.height; ++y) state.row_pointers.push_back(state.rows.data() + y * row);
    if (!read_rows(png, state)) return broken(fmt::format("PNG cannot be read: {}", state.message));
    done();

    Image image(static_cast<int>(state.width), static_cast<int>(state.height), state.channels);
    const unsigned top = state.bits == 16 ? 65535u : 255u;
    const std::vector<float> color = detail::value_table(transfer == Transfer::srgb, top);
    const std::vector<float> alpha = detail::value_table(false, top);
    std::size_t i = 0;
    for (std::size_t y = 0; y < state.height; ++y) {
        const std::uint8_t* in = state.rows.data() + y * row;
        for (std::size_t x = 0; x < state.width; ++x)
            for (int c = 0; c < state.channels; ++c, ++i) {
                std::uint16_t v = *in;
                if (state.bits == 16) std::memcpy(&v, in, 2);
                in += state.bits / 8;
                image.pixels[i] = (detail::is_alpha(c, state.channels) ? alpha : color)[v];
            }
    }
    return image;
}

Result<Bytes> encode_png(const Image& image, Transfer transfer, int bits) {
    if (image.width < 1 || image.height < 1 || image.width > kMaxImageEdge || image.height > kMaxImageEdge ||
        image.channels < 1 || image.channels > 4 || (bits != 8 && bits != 16))
        return fault(Exit::limit, "png-shape",
                     fmt::format("no PNG can hold {} x {} texels of {} channels at {} bits", image.width, image.height,
                                 image.channels, bits));
    const std::size_t sample = static_cast<std::size_t>(bits) / 8;
    Bytes data(image.pixels.size() * sample);
    const unsigned top = bits == 16 ? 65535u : 255u;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        const int c = static_cast<int>(i % static_cast<std::size_t>(image.channels));
        const bool srgb = transfer == Transfer::srgb && !detail::is_alpha(c, image.channels);
        const auto v = static_cast<std::uint16_t>(detail::quantise(image.pixels[i], srgb, top));
        std::memcpy(&data[i * sample], &v, sample); // little-endian: the low byte first
    }
    std::vector<png_bytep> rows;
    const std::size_t row = data.size() / static_cast<std::size_t>(image.height);
    for (std::size_t y = 0; y < static_cast<std::size_t>(image.height); ++y) rows.push_back(data.data() + y * row);

    PngWrite state;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, state.message, on_error, on_warning);
    png_infop info = png ? png_create_info_struct(png) : nullptr;
    const bool ok = info && write_rows(png, info, state, image, transfer, bits, rows);
    png_destroy_write_struct(&png, &info);
    if (!ok) return fault(Exit::internal, "png-write", fmt::format("PNG cannot be made: {}", state.message));
    return std::move(state.bytes);
}

} // namespace kiln

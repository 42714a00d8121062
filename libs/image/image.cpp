#include "libs/image/image.h"
#include "libs/core/check.h"
#include "libs/core/file.h"
#include <cmath>
#include <cstring>

namespace kiln {

Image::Image(int w, int h, int c, float value) : width(w), height(h), channels(c) {
    KILN_CHECK(w >= 0 && h >= 0 && c >= 0);
    pixels.assign(static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * static_cast<std::size_t>(c), value);
}

float srgb_from_linear(float v) {
    return v <= 0.0031308f ? 12.92f * v : 1.055f * std::pow(v, 1.0f / 2.4f) - 0.055f;
}

float linear_from_srgb(float v) {
    return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f);
}

namespace {

Result<Image> at_path(Result<Image> image, const std::string& path) {
    if (image) return image;
    Fault f = image.fault();
    f.diagnostic.where.file = path;
    return f;
}

Result<bool> write_encoded(const std::string& path, const Result<Bytes>& bytes) {
    if (bytes) return write_file(path, *bytes);
    Fault f = bytes.fault();
    f.diagnostic.where.file = path;
    return f;
}

bool starts_with(const Bytes& bytes, std::initializer_list<std::uint8_t> magic) {
    return bytes.size() >= magic.size() && std::equal(magic.begin(), magic.end(), bytes.begin());
}

bool ends_in_tga(const std::string& path) {
    if (path.size() < 4) return false;
    const char* tail = path.c_str() + path.size() - 4;
    return tail[0] == '.' && (tail[1] | 32) == 't' && (tail[2] | 32) == 'g' && (tail[3] | 32) == 'a';
}

} // namespace

Result<Image> read_image(const std::string& path, Transfer transfer) {
    const Result<Bytes> bytes = read_file(path);
    if (!bytes) return bytes.fault();
    if (starts_with(*bytes, {0x89, 'P', 'N', 'G'})) return at_path(decode_png(*bytes, transfer), path);
    if (starts_with(*bytes, {0x76, 0x2f, 0x31, 0x01})) return at_path(decode_exr(*bytes), path);
    if (ends_in_tga(path)) return at_path(decode_tga(*bytes, transfer), path);
    return fault(Exit::input, "image-format", "is neither PNG, EXR nor TGA", {.file = path});
}

Result<Image> read_png(const std::string& path, Transfer transfer) {
    const Result<Bytes> bytes = read_file(path);
    if (!bytes) return bytes.fault();
    return at_path(decode_png(*bytes, transfer), path);
}

Result<Image> read_exr(const std::string& path) {
    const Result<Bytes> bytes = read_file(path);
    if (!bytes) return bytes.fault();
    return at_path(decode_exr(*bytes), path);
}

Result<bool> write_png(const std::string& path, const Image& image, Transfer transfer, int bits) {
    return write_encoded(path, encode_png(image, transfer, bits));
}

Result<bool> write_exr(const std::string& path, const Image& image, const ExrOptions& options) {
    return write_encoded(path, encode_exr(image, options));
}

} // namespace kiln

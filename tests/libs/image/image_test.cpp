#include "libs/image/image.h"
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <gtest/gtest.h>
#include <limits>
#include <random>
#include <unistd.h>

namespace kiln {
namespace {

Image noise(int width, int height, int channels, float low, float high) {
    Image image(width, height, channels);
    std::mt19937 random(7);
    for (float& v : image.pixels)
        v = low + (high - low) * static_cast<float>(random() >> 8) / static_cast<float>(1 << 24);
    return image;
}

float worst(const Image& a, const Image& b) {
    EXPECT_EQ(a.width, b.width);
    EXPECT_EQ(a.height, b.height);
    EXPECT_EQ(a.channels, b.channels);
    float w = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i) w = std::max(w, std::abs(a.pixels[i] - b.pixels.at(i)));
    return w;
}

TEST(image, srgb_curve_meets_the_standard) {
    EXPECT_FLOAT_EQ(srgb_from_linear(0.0f), 0.0f);
    EXPECT_NEAR(srgb_from_linear(1.0f), 1.0f, 1e-6);
    EXPECT_NEAR(srgb_from_linear(0.214041f), 0.5f, 1e-5); // mid grey of IEC 61966-2-1
    for (int i = 0; i <= 255; ++i)
        EXPECT_NEAR(srgb_from_linear(linear_from_srgb(static_cast<float>(i) / 255)), static_cast<float>(i) / 255, 1e-6);
}

TEST(image, png_keeps_values_to_half_a_step) {
    for (int channels = 1; channels <= 4; ++channels)
        for (const int bits : {8, 16}) {
            const Image image = noise(17, 9, channels, 0, 1);
            const Result<Bytes> bytes = encode_png(image, Transfer::linear, bits);
            ASSERT_TRUE(bytes);
            const Result<Image> back = decode_png(*bytes, Transfer::linear);
            ASSERT_TRUE(back) << back.fault().diagnostic.message;
            EXPECT_LE(worst(image, *back), 0.5001f / (bits == 8 ? 255 : 65535)) << channels << " " << bits;
        }
}

// What came out of a PNG goes back into it unchanged, sRGB or not: files do not drift.
TEST(image, png_round_trips_exactly_once_quantised) {
    for (const Transfer transfer : {Transfer::linear, Transfer::srgb}) {
        const Result<Bytes> once = encode_png(noise(16, 16, 4, -0.2f, 1.2f), transfer);
        ASSERT_TRUE(once);
        const Result<Image> image = decode_png(*once, transfer);
        ASSERT_TRUE(image);
        const Result<Bytes> twice = encode_png(*image, transfer);
        ASSERT_TRUE(twice);
        EXPECT_EQ(*once, *twice);
    }
}

TEST(image, png_leaves_alpha_linear_and_clamps) {
    Image image(2, 1, 4, 0.5f);
    image.at(1, 0, 0) = 7;
    image.at(1, 0, 1) = -1;
    image.at(1, 0, 2) = std::numeric_limits<float>::quiet_NaN();
    const Result<Bytes> bytes = encode_png(image);
    ASSERT_TRUE(bytes);
    const Result<Image> raw = decode_png(*bytes, Transfer::linear);
    ASSERT_TRUE(raw);
    EXPECT_NEAR(raw->at(0, 0, 0), 188 / 255.0, 1e-6); // sRGB of 0.5
    EXPECT_NEAR(raw->at(0, 0, 3), 128 / 255.0, 1e-6);
    EXPECT_EQ(raw->at(1, 0, 0), 1);
    EXPECT_EQ(raw->at(1, 0, 1), 0);
    EXPECT_EQ(raw->at(1, 0, 2), 0);
}

TEST(image, exr_float_is_exact_and_half_is_half) {
    for (const ExrCompression compression : {ExrCompression::piz, ExrCompression::zip, ExrCompression::none})
        for (int channels = 1; channels <= 4; ++channels) {
            const Image image = noise(33, 21, channels, -4, 1000);
            const Result<Bytes> bytes = encode_exr(image, {.half = false, .compression = compression});
            ASSERT_TRUE(bytes);
            const Result<Image> back = decode_exr(*bytes);
            ASSERT_TRUE(back) << back.fault().diagnostic.message;
            EXPECT_EQ(worst(image, *back), 0);
            EXPECT_TRUE(back->names.empty());
            const Result<Image> halved = decode_exr(*encode_exr(image, {.half = true, .compression = compression}));
            ASSERT_TRUE(halved);
            for (std::size_t i = 0; i < image.pixels.size(); ++i)
                EXPECT_NEAR(halved->pixels[i], image.pixels[i], std::abs(image.pixels[i]) / 2048 + 1e-7);
        }
}

TEST(image, exr_keeps_named_channels_and_saturates_halves) {
    Image image = noise(5, 4, 6, 0, 1);
    image.names = {"b0.R", "b0.G", "b1.R", "b1.G", "error", "validity"};
    image.at(2, 2, 4) = 1e9f;
    const Result<Image> back = decode_exr(*encode_exr(image));
    ASSERT_TRUE(back);
    ASSERT_EQ(back->names.size(), 6u); // by name: b0.G b0.R b1.G b1.R error validity
    EXPECT_EQ(back->names[0], "b0.G");
    EXPECT_NEAR(back->at(3, 1, 0), image.at(3, 1, 1), 1e-3);
    EXPECT_EQ(back->at(2, 2, 4), 65504);
}

TEST(image, every_truncation_and_flipped_bit_is_a_fault_or_an_image) {
    const Image image = noise(24, 16, 3, 0, 1);
    Bytes tga(18);
    tga[2] = 10, tga[12] = 24, tga[14] = 16, tga[16] = 24; // run-length RGB
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 4; ++k) tga.push_back(k ? 200 : 0xFF); // 3 runs of 128 texels
    struct Case {
        Bytes bytes;
        Result<Image> (*decode)(std::span<const std::uint8_t>);
        bool strict; // a shorter file is always noticed
    };
    const Case cases[] = {
        {*encode_png(image), [](std::span<const std::uint8_t> b) { return decode_png(b); }, true},
        {*encode_exr(image), [](std::span<const std::uint8_t> b) { return decode_exr(b); }, true},
        {tga, [](std::span<const std::uint8_t> b) { return decode_tga(b); }, false}};
    for (const Case& c : cases) {
        ASSERT_TRUE(c.decode(c.bytes));
        for (std::size_t size = 0; size < c.bytes.size(); ++size) {
            const Result<Image> r = c.decode(std::span(c.bytes).first(size));
            if (c.strict) { EXPECT_FALSE(r) << size; }
        }
        std::mt19937 random(1);
        for (int i = 0; i < 2000; ++i) {
            Bytes bad = c.bytes;
            for (int k = 0; k < 3; ++k) bad[random() % bad.size()] ^= static_cast<std::uint8_t>(1u << (random() % 8));
            const Result<Image> r = c.decode(bad);
            if (r) {
                EXPECT_EQ(r->pixels.size(), static_cast<std::size_t>(r->width) * static_cast<std::size_t>(r->height) *
                                                static_cast<std::size_t>(r->channels));
            }
        }
    }
}

// A head that claims 32768 x 32768 texels in a file of 60 bytes must not cost gigabytes.
TEST(image, claims_beyond_the_bytes_are_refused) {
    Bytes png = *encode_png(Image(2, 2, 1));
    png[16] = 0, png[17] = 0, png[18] = 0x80, png[19] = 0; // width
    png[20] = 0, png[21] = 0, png[22] = 0x80, png[23] = 0; // height; the CRC is wrong now, too: either is a fault
    EXPECT_FALSE(decode_png(png));
    Bytes exr = *encode_exr(Image(2, 2, 3));
    const std::string name = "dataWindow";
    const auto at = std::search(exr.begin(), exr.end(), name.begin(), name.end());
    ASSERT_NE(at, exr.end());
    const std::size_t box = static_cast<std::size_t>(at - exr.begin()) + 11 + 6 + 4; // name, "box2i", size
    for (const std::uint8_t high : {0x00, 0x7f, 0xff}) {
        Bytes bad = exr;
        bad[box + 11] = 0, bad[box + 10] = 1, bad[box + 15] = high, bad[box + 14] = 1;
        EXPECT_FALSE(decode_exr(bad));
    }
}

TEST(image, unusable_shapes_and_missing_files_are_faults) {
    EXPECT_FALSE(encode_png(Image()));
    EXPECT_FALSE(encode_png(Image(4, 4, 5)));
    EXPECT_FALSE(encode_png(Image(4, 4, 3), Transfer::srgb, 12));
    EXPECT_FALSE(encode_exr(Image(4, 4, 5)));
    EXPECT_FALSE(read_image("/nowhere/at/all.png"));
    const std::string path = (std::filesystem::temp_directory_path() / ("kiln_image_" + std::to_string(getpid()))).string();
    ASSERT_TRUE(write_png(path, Image(3, 3, 3, 0.25f)));
    const Result<Image> back = read_image(path);
    ASSERT_TRUE(back);
    EXPECT_NEAR(back->at(1, 1, 1), 0.25f, 0.003f);
    EXPECT_FALSE(read_exr(path));
    std::filesystem::remove(path);
    EXPECT_FALSE(write_png("/nowhere/at/all.png", Image(3, 3, 3)));
}

} // namespace
} // namespace kiln

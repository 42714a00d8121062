#include "libs/image/image.h"
#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfOutputFile.h>
#include <stdexcept>

namespace kiln {
namespace {

class BytesIn : public Imf::IStream {
public:
    explicit BytesIn(std::span<const std::uint8_t> bytes) : Imf::IStream("bytes"), bytes_(bytes) {}
    bool read(char c[], int n) override {
        if (n < 0 || static_cast<std::size_t>(n) > bytes_.size() - at_) throw std::runtime_error("the file ends early");
        std::memcpy(c, bytes_.data() + at_, static_cast<std::size_t>(n));
        at_ += static_cast<std::size_t>(n);
        return at_ < bytes_.size();
    }
    std::uint64_t tellg() override { return at_; }
    void seekg(std::uint64_t to) override {
        if (to > bytes_.size()) throw std::runtime_error("an offset points past the end of the file");
        at_ = to;
    }
    void clear() override {}

private:
    std::span<const std::uint8_t> bytes_;
    std::size_t at_ = 0;
};

class BytesOut : public Imf::OStream {
public:
    BytesOut() : Imf::OStream("bytes") {}
    Bytes bytes;
    void write(const char c[], int n) override {
        const std::size_t end = at_ + static_cast<std::size_t>(n);
        if (end > bytes.size()) bytes.resize(end);
        std::memcpy(bytes.data() + at_, c, static_cast<std::size_t>(n));
        at_ = end;
    }
    std::uint64_t tellp() override { return at_; }
    void seekp(std::uint64_t to) override { at_ = to; }

private:
    std::size_t at_ = 0;
};

std::vector<std::string> usual_names(int channels) {
    switch (channels) {
    case 1: return {"Y"};
    case 2: return {"Y", "A"};
    case 3: return {"R", "G", "B"};
    case 4: return {"R", "G", "B", "A"};
    }
    return {};
}

// The head of the file alone: sizes must be known to be sane before the library allocates by them.
void check_head(std::span<const std::uint8_t> bytes) {
    BytesIn in(bytes);
    std::array<char, 8> start{};
    in.read(start.data(), 8);
    std::int32_t magic = 0, version = 0;
    std::memcpy(&magic, start.data(), 4);
    std::memcpy(&version, start.data() + 4, 4);
    if (magic != 20000630) throw std::runtime_error("no EXR magic number");
    if (version & 0x1800) throw std::runtime_error("files of several parts or deep data are not read");
    Imf::Header header;
    header.readFrom(in, version);
    const auto w = header.dataWindow();
    const std::int64_t width = std::int64_t{w.max.x} - w.min.x + 1, height = std::int64_t{w.max.y} - w.min.y + 1;
    std::int64_t channels = 0;
    for (auto c = header.channels().begin(); c != header.channels().end(); ++c) {
        if (c.channel().xSampling != 1 || c.channel().ySampling != 1)
            throw std::runtime_error("subsampled channels are not read");
        ++channels;
    }
    // A block holds at most 256 lines and costs at least the 8 bytes of its place in the file.
    if (width < 1 || height < 1 || width > kMaxImageEdge || height > kMaxImageEdge || channels < 1 ||
        width * height * channels > static_cast<std::int64_t>(kMaxImageSamples) ||
        (!header.hasTileDescription() && height > static_cast<std::int64_t>(bytes.size()) / 8 * 256))
        throw std::runtime_error(fmt::format("the data window claims {} x {} texels of {} channels", width, height,
                                             channels));
    if (std::abs(std::int64_t{w.min.x}) > (1 << 24) || std::abs(std::int64_t{w.min.y}) > (1 << 24))
        throw std::runtime_error("the data window lies too far out");
}

} // namespace

Result<Image> decode_exr(std::span<const std::uint8_t> bytes) {
    try {
        check_head(bytes);
        BytesIn in(bytes);
        Imf::InputFile file(in, /*numThreads=*/0);
        const auto window = file.header().dataWindow();
        Image image;
        for (auto c = file.header().channels().begin(); c != file.header().channels().end(); ++c)
            image.names.emplace_back(c.name()); // sorted by name
        image.channels = static_cast<int>(image.names.size());
        std::vector<std::string> usual = usual_names(image.channels), sorted = usual;
        std::sort(sorted.begin(), sorted.end());
        const bool is_usual = !usual.empty() && sorted == image.names;
        if (is_usual) image.names = usual;
        image.width = window.max.x - window.min.x + 1;
        image.height = window.max.y - window.min.y + 1;
        const auto channels = static_cast<std::size_t>(image.channels), width = static_cast<std::size_t>(image.width);
        image.pixels.resize(width * static_cast<std::size_t>(image.height) * channels);
        Imf::FrameBuffer frame;
        for (std::size_t c = 0; c < channels; ++c)
            frame.insert(image.names[c],
                         Imf::Slice::Make(Imf::FLOAT, image.pixels.data() + c, window, channels * sizeof(float),
                                          width * channels * sizeof(float)));
        file.setFrameBuffer(frame);
        file.readPixels(window.min.y, window.max.y);
        if (is_usual) image.names.clear();
        return image;
    } catch (const std::exception& e) {
        return fault(Exit::input, "exr-broken", fmt::format("EXR cannot be read: {}", e.what()));
    }
}

Result<Bytes> encode_exr(const Image& image, const ExrOptions& options) {
    const std::vector<std::string> names = image.names.empty() ? usual_names(image.channels) : image.names;
    if (image.width < 1 || image.height < 1 || image.width > kMaxImageEdge || image.height > kMaxImageEdge ||
        names.empty() || names.size() != static_cast<std::size_t>(image.channels))
        return fault(Exit::limit, "exr-shape",
                     fmt::format("no EXR is made of {} x {} texels of {} channels with {} names", image.width,
                                 image.height, image.channels, names.size()));
    try {
        const std::size_t channels = names.size(), width = static_cast<std::size_t>(image.width);
        Imf::Header header(image.width, image.height);
        header.compression() = options.compression == ExrCompression::piz   ? Imf::PIZ_COMPRESSION
                               : options.compression == ExrCompression::zip ? Imf::ZIP_COMPRESSION
                                                                            : Imf::NO_COMPRESSION;
        const Imf::PixelType type = options.half ? Imf::HALF : Imf::FLOAT;
        std::vector<half> halves;
        if (options.half) {
            halves.resize(image.pixels.size());
            // Saturated, not infinite: one lamp seen directly must not poison what is filtered from the file.
            for (std::size_t i = 0; i < halves.size(); ++i)
                halves[i] = half(std::clamp(image.pixels[i], -65504.0f, 65504.0f));
        }
        Imf::FrameBuffer frame;
        const std::size_t sample = options.half ? sizeof(half) : sizeof(float);
        const char* base = options.half ? reinterpret_cast<const char*>(halves.data())
                                        : reinterpret_cast<const char*>(image.pixels.data());
        for (std::size_t c = 0; c < channels; ++c) {
            header.channels().insert(names[c], Imf::Channel(type));
            frame.insert(names[c], Imf::Slice(type, const_cast<char*>(base) + c * sample, channels * sample,
                                              width * channels * sample)); // only read from
        }
        BytesOut out;
        {
            Imf::OutputFile file(out, header, /*numThreads=*/0);
            file.setFrameBuffer(frame);
            file.writePixels(image.height);
        } // the destructor writes the line offsets
        return std::move(out.bytes);
    } catch (const std::exception& e) {
        return fault(Exit::internal, "exr-write", fmt::format("EXR cannot be made: {}", e.what()));
    }
}

} // namespace kiln

#include "tools/render/textures.h"
#include <filesystem>

namespace kiln {
namespace {

Image with_four_channels(const Image& in) {
    Image out(in.width, in.height, 4, 1.0f);
    for (int y = 0; y < in.height; ++y)
        for (int x = 0; x < in.width; ++x) {
            for (int c = 0; c < 3; ++c) out.at(x, y, c) = in.at(x, y, in.channels < 3 ? 0 : c);
            if (in.channels == 2 || in.channels == 4) out.at(x, y, 3) = in.at(x, y, in.channels - 1);
        }
    return out;
}

Image halved(const Image& in) {
    Image out(std::max(1, in.width / 2), std::max(1, in.height / 2), 4);
    for (int y = 0; y < out.height; ++y)
        for (int x = 0; x < out.width; ++x)
            for (int c = 0; c < 4; ++c) {
                float sum = 0;
                for (int k = 0; k < 4; ++k)
                    sum += in.at(std::min(in.width - 1, 2 * x + (k & 1)), std::min(in.height - 1, 2 * y + (k >> 1)), c);
                out.at(x, y, c) = sum / 4;
            }
    return out;
}

std::array<float, 4> bilinear(const Image& image, double u, double v) {
    const double x = (u - std::floor(u)) * image.width - 0.5, y = (v - std::floor(v)) * image.height - 0.5;
    const double fx = std::floor(x), fy = std::floor(y);
    std::array<float, 4> sum{};
    for (int j = 0; j < 2; ++j)
        for (int i = 0; i < 2; ++i) {
            const int px = (static_cast<int>(fx) + i + image.width) % image.width;
            const int py = (static_cast<int>(fy) + j + image.height) % image.height;
            const double w = (i ? x - fx : 1 - (x - fx)) * (j ? y - fy : 1 - (y - fy));
            for (std::size_t c = 0; c < 4; ++c) sum[c] += static_cast<float>(w) * image.at(px, py, static_cast<int>(c));
        }
    return sum;
}

} // namespace

Texture::Texture(Image image) {
    mips_.push_back(with_four_channels(image));
    while (mips_.back().width > 1 || mips_.back().height > 1) mips_.push_back(halved(mips_.back()));
}

std::array<float, 4> Texture::at(double u, double v, double footprint_u, double footprint_v) const {
    if (!(std::abs(u) < 1e9 && std::abs(v) < 1e9)) u = v = 0;
    const double texels = std::max(footprint_u * mips_[0].width, footprint_v * mips_[0].height);
    const double last = static_cast<double>(mips_.size() - 1);
    const double level = texels > 1 ? std::min(last, std::log2(texels)) : 0;
    const auto first = static_cast<std::size_t>(level);
    const auto blend = static_cast<float>(level - static_cast<double>(first));
    std::array<float, 4> out = bilinear(mips_[first], u, v);
    if (blend > 0) {
        const auto next = bilinear(mips_[first + 1], u, v);
        for (std::size_t c = 0; c < 4; ++c) out[c] += blend * (next[c] - out[c]);
    }
    return out;
}

Texture load_texture(const std::string& name, Transfer transfer, const std::vector<std::string>& directories,
                     Context& context) {
    namespace fs = std::filesystem;
    if (name.empty()) return {};
    std::vector<std::string> spellings{name};
    const std::size_t slash = name.find_last_of("/\\");
    if (slash != std::string::npos) spellings.push_back(name.substr(slash + 1));
    for (std::size_t i = 0, n = spellings.size(); i < n; ++i)
        for (const char* ending : {".png", ".tga"}) spellings.push_back(spellings[i] + ending);
    for (const std::string& directory : directories)
        for (const std::string& spelling : spellings) {
            const fs::path path = fs::path(directory) / spelling;
            std::error_code error;
            if (!fs::is_regular_file(path, error)) continue;
            Result<Image> image = read_image(path.string(), transfer);
            if (image && image->width > 0 && image->height > 0) return Texture(std::move(*image));
            context.report(Severity::note, "texture-not-readable",
                           name + ": " + (image ? "empty image" : image.fault().diagnostic.message));
            return {};
        }
    context.report(Severity::note, "texture-not-found", name + ": not in the texture directories; its reflectance is shown");
    return {};
}

} // namespace kiln

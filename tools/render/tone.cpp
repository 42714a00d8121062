#include "tools/render/render.h"

namespace kiln {
namespace {
double luminance(const Image& image, std::size_t pixel) {
    const float* p = image.pixels.data() + pixel * static_cast<std::size_t>(image.channels);
    return 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2];
}
} // namespace

double auto_exposure(const Image& radiance) {
    const std::size_t n = static_cast<std::size_t>(radiance.width) * static_cast<std::size_t>(radiance.height);
    if (n == 0 || radiance.channels < 3) return 1;
    std::vector<double> values;
    double logs = 0;
    for (std::size_t i = 0; i < n; ++i)
        if (const double l = luminance(radiance, i); l > 1e-9 && l < 1e9) values.push_back(l), logs += std::log(l);
    if (values.empty()) return 1;
    const double middle = std::exp(logs / static_cast<double>(values.size()));
    const auto bright = values.begin() + static_cast<std::ptrdiff_t>(values.size() * 95 / 100);
    std::nth_element(values.begin(), bright, values.end());
    // A dark picture with a bright window is not pulled up until the window is all white, nor the other way about.
    const double by_bright = 1.2 / *bright;
    return std::clamp(0.18 / middle, by_bright * 0.35, by_bright * 1.5);
}

Image tone_mapped(const Image& radiance, double exposure) {
    if (!(exposure > 0)) exposure = auto_exposure(radiance);
    Image out = radiance;
    for (float& v : out.pixels) {
        const double x = std::max(0.0, static_cast<double>(v) * exposure);
        v = static_cast<float>(std::clamp(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0));
    }
    return out;
}

} // namespace kiln

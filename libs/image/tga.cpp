#include "libs/image/image.h"
#include "libs/image/quantise.h"
#include <fmt/format.h>
#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_TGA
#define STBI_NO_STDIO
#define STBI_MAX_DIMENSIONS 32768
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_image.h>
#pragma GCC diagnostic pop

namespace kiln {

Result<Image> decode_tga(std::span<const std::uint8_t> bytes, Transfer transfer) {
    int width = 0, height = 0, channels = 0;
    const auto broken = [&](const char* what) {
        return fault(Exit::input, "tga-broken", fmt::format("TGA cannot be read: {}", what ? what : "unknown reason"));
    };
    const int size = static_cast<int>(std::min<std::size_t>(bytes.size(), 1u << 30));
    if (!stbi_info_from_memory(bytes.data(), size, &width, &height, &channels)) return broken(stbi_failure_reason());
    // Run lengths expand a packet of at least 2 bytes to at most 128 texels.
    if (width < 1 || height < 1 ||
        static_cast<std::size_t>(width) * static_cast<std::size_t>(height) > bytes.size() * 128)
        return broken("the head claims more texels than its bytes can hold");
    stbi_uc* data = stbi_load_from_memory(bytes.data(), size, &width, &height, &channels, 0);
    if (!data) return broken(stbi_failure_reason());
    Image image(width, height, channels);
    const std::vector<float> color = detail::value_table(transfer == Transfer::srgb, 255);
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        const int c = static_cast<int>(i % static_cast<std::size_t>(channels));
        image.pixels[i] = detail::is_alpha(c, channels) ? static_cast<float>(data[i]) / 255 : color[data[i]];
    }
    stbi_image_free(data);
    return image;
}

} // namespace kiln

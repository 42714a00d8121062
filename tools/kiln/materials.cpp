#include "tools/kiln/materials.h"
#include "libs/image/image.h"
#include <filesystem>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace kiln {
namespace {

// Diffuse reflectance of a texture: the mean of its linear colours where it is opaque. Real surfaces stay below 0.9.
Rgbd mean_colour(const Image& image) {
    Rgbd sum{};
    double weight = 0;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const bool colour = image.channels >= 3;
            const double a = image.channels % 2 == 0 ? image.at(x, y, image.channels - 1) : 1;
            sum += a * Rgbd{image.at(x, y, 0), image.at(x, y, colour ? 1 : 0), image.at(x, y, colour ? 2 : 0)};
            weight += a;
        }
    return weight > 0 ? sum / weight : Rgbd{0.5, 0.5, 0.5};
}

// File names cannot hold what liquids and masked textures begin with; TrenchBroom and the WAD tools write `#` or nothing.
bool named_in(const std::string& map_text, const std::string& name) { return map_text.find(name) != std::string::npos; }

} // namespace

Result<TextFile> materials_of_textures(const std::string& folder, const Bytes& map, Context& context) {
    namespace fs = std::filesystem;
    std::error_code error;
    if (!fs::is_directory(folder, error))
        return fault(Exit::input, "cannot-read", "the texture folder is not a folder", {.file = folder});
    const std::string text = lower_case(std::string(map.begin(), map.end()));
    std::vector<std::string> files; // sorted: directories come in any order
    for (auto it = fs::recursive_directory_iterator(folder, fs::directory_options::skip_permission_denied, error);
         !error && it != fs::recursive_directory_iterator(); it.increment(error))
        if (it->is_regular_file(error) && lower_case(it->path().extension().string()) == ".png") files.push_back(it->path().string());
    std::sort(files.begin(), files.end());

    nlohmann::ordered_json rules = nlohmann::ordered_json::object();
    for (const std::string& file : files) {
        const std::string relative = fs::relative(file, folder).replace_extension().generic_string();
        const std::string base = fs::path(file).stem().string();
        std::string name = named_in(text, lower_case(relative)) ? relative : base;
        if (name.starts_with('#')) name[0] = '*';
        if (!named_in(text, lower_case(name))) continue;
        const auto image = read_image(file);
        if (!image) {
            context.report(Severity::warning, "texture-unreadable", image.fault().diagnostic.message, {.file = file});
            continue;
        }
        const Rgbd c = mean_colour(*image);
        const auto limited = [](double v) { return std::min(v, 0.9); };
        rules[name] = {{"size", {image->width, image->height}}, {"reflectance", {limited(c.x), limited(c.y), limited(c.z)}},
                       {"albedo_map", fs::relative(file, folder).generic_string()}};
    }
    const std::string json = nlohmann::ordered_json{{"materials", rules}}.dump(1, ' ', false, nlohmann::json::error_handler_t::replace);
    return TextFile{folder + "/", Bytes(json.begin(), json.end())};
}

} // namespace kiln

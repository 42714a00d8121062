#include "tools/kiln/materials.h"
#include "formats/texture/vmt.h"
#include "formats/texture/vtf.h"
#include "formats/texture/wad.h"
#include "libs/core/file.h"
#include "libs/image/image.h"
#include "tools/kiln/map_files.h"
#include <algorithm>
#include <filesystem>
#include <fstream>
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

using Json = nlohmann::ordered_json;

// What light has to know of a texture's holes and colours (formats/material/FORMAT.md), no larger than that allows; nothing: it has none, and is
// not `thin` for another reason.
std::optional<Json> opacity_map_of(const TexelPicture& picture, bool thin) {
    if (picture.empty()) return std::nullopt;
    bool holes = false;
    for (std::size_t i = 3; i < picture.rgba.size() && !holes; i += 4) holes = picture.rgba[i] < 255;
    if (!holes && !thin) return std::nullopt;
    std::array<double, 256> linear{};
    for (std::size_t i = 0; i < 256; ++i) linear[i] = static_cast<double>(linear_from_srgb(static_cast<float>(i) / 255));
    std::uint8_t most = 0; // of what lets light through: the brightest is clear
    for (std::size_t i = 0; i < picture.rgba.size(); i += 4)
        if (picture.rgba[i + 3] < 255 || !holes) most = std::max({most, picture.rgba[i], picture.rgba[i + 1], picture.rgba[i + 2]});
    const int by = (std::max(picture.width, picture.height) + kMostOpacitySize - 1) / kMostOpacitySize;
    const int w = (picture.width + by - 1) / by, h = (picture.height + by - 1) / by;
    Bytes opacity, tint;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x) {
            double n = 0, a = 0, through = 0;
            Rgbd colour;
            for (int j = y * by; j < std::min(picture.height, (y + 1) * by); ++j)
                for (int i = x * by; i < std::min(picture.width, (x + 1) * by); ++i) {
                    const std::uint8_t* t = &picture.rgba[4 * (static_cast<std::size_t>(j) * static_cast<std::size_t>(picture.width) + static_cast<std::size_t>(i))];
                    const double share = holes ? 1 - t[3] / 255.0 : 1;
                    n += 1, a += t[3], through += share;
                    for (std::size_t c = 0; c < 3; ++c) colour[c] += share * (most > 0 ? linear[t[c]] / linear[most] : 1);
                }
            opacity.push_back(static_cast<std::uint8_t>(std::lround(a / n)));
            for (std::size_t c = 0; c < 3; ++c) tint.push_back(through > 0 ? static_cast<std::uint8_t>(std::lround(255 * std::min(1.0, colour[c] / through))) : std::uint8_t{0});
        }
    return Json{{"size", {w, h}}, {"opacity", base64(opacity)}, {"tint", base64(tint)}};
}
TexelPicture picture_of(const Image& image) {
    TexelPicture out{image.width, image.height, {}};
    if (image.width <= 0 || image.height <= 0) return out;
    const bool colour = image.channels >= 3, alpha = image.channels % 2 == 0;
    const auto byte = [](float v) { return static_cast<std::uint8_t>(std::lround(255 * std::clamp(v, 0.0f, 1.0f))); };
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            for (const int c : {0, colour ? 1 : 0, colour ? 2 : 0}) out.rgba.push_back(byte(srgb_from_linear(std::clamp(image.at(x, y, c), 0.0f, 1.0f))));
            out.rgba.push_back(alpha ? byte(image.at(x, y, image.channels - 1)) : 255);
        }
    return out;
}

constexpr double kMostMean = 0.9; // of images: real surfaces stay below
Json reflectance(const Rgbd& c, double most) { return {std::min(c.x, most), std::min(c.y, most), std::min(c.z, most)}; }

TextFile material_file(const std::string& name, const Json& rules) {
    const std::string json = Json{{"materials", rules}}.dump(1, ' ', false, Json::error_handler_t::replace);
    return TextFile{name, Bytes(json.begin(), json.end())};
}
std::string with_slashes(std::string path) {
    std::ranges::replace(path, '\\', '/');
    return path;
}

// ---- Materials of Source

Result<Vmt> read_vmt_file(const std::string& file) {
    const auto bytes = read_file(file);
    if (!bytes) return bytes.fault();
    return read_vmt({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, file);
}
// Of a patch: the keys of what it patches, its own after them. `game`: the folder that holds materials/.
Result<Vmt> read_patched(const std::string& file, const std::filesystem::path& game, Context& context) {
    auto vmt = read_vmt_file(file);
    constexpr int kMostPatches = 8; // a patch of a patch is rare; one of itself never ends
    for (int i = 0; vmt && !vmt->include.empty(); ++i) {
        const auto patched = file_on_disk((game / with_slashes(vmt->include)).string());
        if (!patched || i == kMostPatches) {
            context.report(Severity::warning, "texture-unreadable",
                           fmt::format("it patches '{}', which {}; only its own keys count", vmt->include, patched ? "comes back to itself" : "is not there"), {.file = file});
            break;
        }
        auto below = read_vmt_file(*patched);
        if (!below) return below;
        below->keys.insert(below->keys.end(), vmt->keys.begin(), vmt->keys.end());
        vmt = std::move(below);
    }
    return vmt;
}
std::optional<std::string> vtf_file(const std::string& materials, const std::string& texture) {
    return file_on_disk(materials + "/" + with_slashes(texture) + (lower_case(texture).ends_with(".vtf") ? "" : ".vtf"));
}
std::optional<VtfHead> read_vtf_file(const std::string& materials, const std::string& texture, Context& context) {
    const auto file = vtf_file(materials, texture);
    if (!file) return std::nullopt;
    Bytes head(kVtfHeadBytes); // textures are large, their heads are not
    std::ifstream in(*file, std::ios::binary);
    in.read(reinterpret_cast<char*>(head.data()), static_cast<std::streamsize>(head.size()));
    head.resize(static_cast<std::size_t>(in.gcount()));
    const auto read = read_vtf_head(head, *file);
    if (read) return *read;
    context.report(Severity::warning, "texture-unreadable", read.fault().diagnostic.message, {.file = *file});
    return std::nullopt;
}
std::optional<Rgbd> three_numbers(const std::string& text) { // "[r g b]" of 0..1, "{r g b}" of 0..255
    const bool bytes = text.starts_with('{');
    std::string plain = text;
    std::ranges::replace_if(plain, [](char c) { return c == '[' || c == ']' || c == '{' || c == '}'; }, ' ');
    bool complete = false;
    const std::vector<double> n = parse_numbers(plain, &complete);
    if (!complete || (n.size() != 3 && n.size() != 1)) return std::nullopt;
    const auto at = [&](std::size_t i) { return std::clamp(n[n.size() == 3 ? i : 0] / (bytes ? 255 : 1), 0.0, 1.0); };
    return Rgbd{at(0), at(1), at(2)};
}

Json rule_of(const Vmt& vmt, const std::string& materials, Context& context) {
    Json rule = Json::object();
    constexpr double kMostReflectivity = 0.99; // as its maker says, but light must end some day
    if (const std::string* base = vmt.find("$basetexture"))
        if (const auto head = read_vtf_file(materials, *base, context))
            rule["size"] = {head->width, head->height}, rule["reflectance"] = reflectance(head->reflectivity, kMostReflectivity);
    if (const std::string* own = vmt.find("$reflectivity"))
        if (const auto c = three_numbers(*own)) rule["reflectance"] = reflectance(*c, kMostReflectivity);
    for (const char* key : {"$normalmap", "$bumpmap"})
        if (const std::string* map = vmt.find(key); map && !map->empty()) rule["normal_map"] = with_slashes(*map) + ".vtf";
    if (const std::string* map = vmt.find("$envmap"); map && lower_case(*map) == "env_cubemap") {
        const std::string* tint = vmt.find("$envmaptint");
        const auto c = tint ? three_numbers(*tint) : std::nullopt;
        rule["env_map"] = c ? (c->x + c->y + c->z) / 3 : 1;
    }
    static constexpr std::pair<const char*, const char*> kFlags[] = {
        {"$translucent", "translucent"}, {"$additive", "translucent"}, {"$alphatest", "alpha_tested"}, {"$nocull", "two_sided"},
        {"%compilesky", "sky"}, {"%compile2dsky", "sky"}, {"%compilehint", "hint"}, {"%compileskip", "skip"}, {"%compileorigin", "origin"},
        {"%compilenodraw", "nodraw"}, {"%compiletrigger", "trigger"}, {"%compiledetail", "detail"}, {"%compileinvisible", "invisible"},
        {"%compileclip", "clip"}, {"%playerclip", "stops_players"}, {"%compileplayercontrolclip", "stops_players"}, {"%compilenpcclip", "stops_npcs"},
        {"%compileblocklos", "stops_sight"}, {"%compilewater", "water"}, {"%compileslime", "slime"}, {"%compilenonsolid", "non_solid"},
        {"%compilenolight", "no_light"}, {"%compilepassbullets", "alpha_tested"}};
    for (const auto& [key, flag] : kFlags)
        if (vmt.is_set(key)) rule[flag] = true;
    if (vmt.is_set("%compileslime")) rule["water"] = true; // which liquid is one flag, that it is one another
    if (vmt.is_set("%compileblocklos")) rule["clip"] = true;
    if (const std::string* alpha = vmt.find("$alpha")) {
        bool complete = false;
        const std::vector<double> n = parse_numbers(*alpha, &complete);
        if (n.size() == 1 && n[0] < 1) rule["alpha"] = std::clamp(n[0], 0.0, 1.0);
    }
    if (const std::string* reference = vmt.find("$alphatestreference"); reference && vmt.is_set("$alphatest")) {
        bool complete = false;
        const std::vector<double> n = parse_numbers(*reference, &complete);
        if (n.size() == 1 && n[0] > 0) rule["alpha_test"] = std::clamp(n[0], 0.0, 1.0);
    }
    // What is added to what is behind hides none of it.
    const bool thin = rule.contains("alpha");
    if (const std::string* base = vmt.find("$basetexture"); base && !vmt.is_set("$additive") && (thin || vmt.is_set("$translucent") || vmt.is_set("$alphatest")))
        if (const auto file = vtf_file(materials, *base)) {
            const auto bytes = read_file(*file);
            const auto picture = bytes ? read_vtf_picture(*bytes, *file) : Result<TexelPicture>(TexelPicture{});
            if (!picture) context.report(Severity::warning, "texture-unreadable", picture.fault().diagnostic.message, {.file = *file});
            else if (auto map = opacity_map_of(*picture, thin)) rule["opacity_map"] = *std::move(map);
        }
    return rule;
}

} // namespace

Result<TextFile> materials_of_textures(const std::string& folder, const Bytes& map, Context& context) {
    namespace fs = std::filesystem;
    std::error_code error;
    if (!fs::is_directory(folder, error))
        return fault(Exit::input, "cannot-read", "the texture folder is not a folder", {.file = folder});
    const std::string text = lower_case(std::string(map.begin(), map.end()));
    std::vector<std::string> files; // sorted: directories come in any order
    for (auto it = fs::recursive_directory_iterator(folder, fs::directory_options::skip_permission_denied, error);
         !error && it != fs::recursive_directory_iterator(); it.increment(error)) {
        const std::string ending = lower_case(it->path().extension().string());
        if (it->is_regular_file(error) && (ending == ".png" || ending == ".vmt")) files.push_back(it->path().string());
    }
    std::sort(files.begin(), files.end());

    Json rules = Json::object();
    for (const std::string& file : files) {
        const bool vmt_file = lower_case(fs::path(file).extension().string()) == ".vmt";
        const std::string relative = fs::relative(file, folder).replace_extension().generic_string();
        const std::string base = fs::path(file).stem().string();
        std::string name = vmt_file || named_in(text, lower_case(relative)) ? relative : base;
        if (name.starts_with('#')) name[0] = '*';
        if (!named_in(text, lower_case(name))) continue;
        const auto unreadable = [&](const Fault& f) {
            context.report(Severity::warning, "texture-unreadable", f.diagnostic.message, {file, f.diagnostic.where.line});
        };
        Json& rule = rules[name];
        if (rule.is_null()) rule = Json::object();
        if (vmt_file) {
            const auto vmt = read_patched(file, fs::path(folder).parent_path(), context);
            if (vmt) rule.update(rule_of(*vmt, folder, context));
            else unreadable(vmt.fault());
            continue;
        }
        const auto image = read_image(file);
        if (!image) {
            unreadable(image.fault());
            continue;
        }
        rule.update(Json{{"size", {image->width, image->height}}, {"reflectance", reflectance(mean_colour(*image), kMostMean)},
                         {"albedo_map", fs::relative(file, folder).generic_string()}});
        if (image->channels % 2 == 0)
            if (auto opacity = opacity_map_of(picture_of(*image), false)) rule["opacity_map"] = *std::move(opacity);
    }
    for (auto it = rules.begin(); it != rules.end();) it = it->empty() ? rules.erase(it) : std::next(it); // nothing is known of those
    return material_file(folder + "/", rules);
}

Result<TextFile> materials_of_wad(const std::string& wad, const std::string& game_dir, const Bytes& map, Context& context) {
    namespace fs = std::filesystem;
    const auto bytes = read_file(wad);
    if (!bytes) return bytes.fault();
    Bytes palette;
    const std::string beside = fs::path(wad).parent_path().string();
    const std::string folder = beside.empty() ? "." : beside;
    for (const std::string& candidate : {game_dir.empty() ? std::string() : game_dir + "/gfx/palette.lmp", folder + "/palette.lmp", folder + "/gfx/palette.lmp", folder + "/../gfx/palette.lmp"}) {
        const auto found = candidate.empty() ? std::nullopt : file_on_disk(candidate);
        if (!found) continue;
        auto read = read_file(*found);
        if (read && read->size() >= 768) {
            palette = *std::move(read);
            break;
        }
    }
    const std::string text = lower_case(std::string(map.begin(), map.end()));
    const auto read = read_wad(*bytes, palette, wad, [&](const std::string& name) { return named_in(text, lower_case(name)); }, context);
    if (!read) return read.fault();
    if (!read->own_palettes && palette.empty())
        context.report(Severity::note, "wad-palette", "there is no gfx/palette.lmp in the game folder nor beside this archive: the sizes of its textures are known, their colours are not", {.file = wad});
    Json rules = Json::object();
    for (const WadTexture& t : read->textures) {
        Json rule = {{"size", {t.width, t.height}}};
        if (t.mean) rule["reflectance"] = reflectance(*t.mean, kMostMean);
        if (auto opacity = opacity_map_of(t.holed, false)) rule["opacity_map"] = *std::move(opacity);
        rules[t.name] = rule;
    }
    return material_file(wad, rules);
}

std::optional<TextFile> opacity_maps_of(const TextFile& materials, Context& context) {
    namespace fs = std::filesystem;
    const Json json = Json::parse(materials.bytes.begin(), materials.bytes.end(), nullptr, false, true);
    if (!json.is_object() || !json.contains("materials") || !json["materials"].is_object()) return std::nullopt; // its reader tells
    Json rules = Json::object();
    for (const auto& [name, rule] : json["materials"].items()) {
        if (!rule.is_object()) continue;
        const auto is_text = [&](const char* key) { return rule.contains(key) && rule[key].is_string(); };
        const auto set = [&](const char* flag) {
            if (rule.contains(flag) && rule[flag].is_boolean() && rule[flag].get<bool>()) return true;
            return rule.contains("flags") && rule["flags"].is_array() && std::ranges::any_of(rule["flags"], [&](const Json& f) { return f.is_string() && equal_ignoring_case(f.get<std::string>(), flag); });
        };
        const bool thin = rule.contains("alpha") && rule["alpha"].is_number() && rule["alpha"].get<double>() < 1;
        const bool own = is_text("opacity_map");
        if (!own && !(is_text("albedo_map") && !rule.contains("opacity_map") && (thin || rule.contains("alpha_test") || set("translucent") || set("alpha_tested") || set("alpha_test")))) continue;
        const std::string stated = rule[own ? "opacity_map" : "albedo_map"].get<std::string>();
        const auto file = file_on_disk((fs::path(materials.name).parent_path() / with_slashes(stated)).string());
        const auto no = [&](const std::string& why) {
            context.report(Severity::warning, "texture-unreadable", fmt::format("the opacity of the material '{}' is not known: {}", name, why), {.file = file ? *file : materials.name});
        };
        if (!file) {
            if (own) no(fmt::format("'{}' is not there", stated)); // albedo maps need not be there for anything else
            continue;
        }
        Image image;
        if (auto read = read_image(*file); read) {
            image = *std::move(read);
        } else {
            no(read.fault().diagnostic.message);
            continue;
        }
        if (own && image.channels % 2 == 1) { // a mask: how bright it is
            Image mask(image.width, image.height, 2, 1);
            for (int y = 0; y < image.height; ++y)
                for (int x = 0; x < image.width; ++x) mask.at(x, y, 1) = srgb_from_linear(image.at(x, y, 0));
            image = std::move(mask);
        }
        if (auto map = opacity_map_of(picture_of(image), thin)) {
            if (own && image.channels == 2) map->erase("tint");
            rules[name]["opacity_map"] = *std::move(map);
        }
    }
    if (rules.empty()) return std::nullopt;
    return material_file(materials.name, rules);
}

std::vector<std::string> wads_of_map(const Document& document, const std::string& game_dir, Context& context) {
    namespace fs = std::filesystem;
    std::vector<std::string> out;
    if (document.entities.empty()) return out;
    const DocKey* key = find_key(document.entities[0].keys, "wad");
    if (!key) key = find_key(document.entities[0].keys, "_wad");
    if (!key) return out;
    const std::string list = with_slashes(key->value);
    std::vector<fs::path> folders{fs::path(document.file).parent_path()};
    if (!game_dir.empty()) folders.emplace_back(game_dir);
    std::string missing;
    for (std::size_t at = 0; at <= list.size();) {
        const std::size_t end = std::min(list.find(';', at), list.size());
        std::string wanted = list.substr(at, end - at);
        at = end + 1;
        while (!wanted.empty() && wanted.front() == ' ') wanted.erase(0, 1);
        while (!wanted.empty() && wanted.back() == ' ') wanted.pop_back();
        if (wanted.empty() || wanted.find('\0') != std::string::npos) continue;
        const fs::path path(wanted);
        std::vector<fs::path> candidates;
        if (path.is_absolute()) candidates.push_back(path);
        for (const fs::path& name : {path.is_absolute() ? path.filename() : path, path.filename()})
            for (const fs::path& folder : folders)
                for (const fs::path& in : {folder, folder / "wads"}) candidates.push_back(in / name);
        std::optional<std::string> found;
        for (const fs::path& c : candidates)
            if (found = file_on_disk(c.string()); found) break;
        if (!found) missing += (missing.empty() ? "" : ", ") + wanted;
        else if (std::ranges::find(out, *found) == out.end()) out.push_back(*found);
    }
    if (!missing.empty())
        context.report(Severity::note, "wad-missing",
                       fmt::format("not found: {}; what is in there keeps the usual size and colour (--wad FILE, --game-dir DIR)", missing),
                       {document.file, key->line, document.entities[0].id});
    return out;
}

} // namespace kiln

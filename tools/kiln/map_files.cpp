#include "tools/kiln/map_files.h"
#include "libs/core/file.h"
#include <algorithm>
#include <filesystem>
#include <fmt/format.h>

namespace kiln {
namespace {

namespace fs = std::filesystem;

// `path` as it is spelled on disk, or nothing. Folder by folder, so that each part may differ in case.
std::optional<fs::path> on_disk(const fs::path& path) {
    std::error_code ignored;
    if (fs::is_regular_file(path, ignored)) return path;
    fs::path found = path.root_path();
    for (const fs::path& part : path.relative_path()) {
        const fs::path exact = found.empty() ? part : found / part;
        if (part == "." || part == ".." || fs::exists(exact, ignored)) {
            found = exact;
            continue;
        }
        std::vector<std::string> fitting; // sorted: folders list their files in any order
        for (auto it = fs::directory_iterator(found.empty() ? fs::path(".") : found, fs::directory_options::skip_permission_denied, ignored);
             !ignored && it != fs::directory_iterator(); it.increment(ignored))
            if (equal_ignoring_case(it->path().filename().string(), part.string())) fitting.push_back(it->path().filename().string());
        if (fitting.empty()) return std::nullopt;
        found /= *std::ranges::min_element(fitting);
    }
    return fs::is_regular_file(found, ignored) ? std::optional(found) : std::nullopt;
}

void add_once(std::vector<fs::path>& list, fs::path path) {
    path = path.lexically_normal();
    if (std::ranges::find(list, path) == list.end()) list.push_back(std::move(path));
}

} // namespace

std::optional<std::string> file_on_disk(const std::string& path) {
    const std::optional<fs::path> found = on_disk(fs::path(path).lexically_normal());
    return found ? std::optional(found->string()) : std::nullopt;
}

OpenMap map_opener(const std::string& main_map, const std::vector<std::string>& instance_paths) {
    return [=](const std::string& wanted, const std::string& from) -> Result<TextFile> {
        std::string spelled = wanted;
        std::ranges::replace(spelled, '\\', '/');
        const fs::path name(spelled);
        if (spelled.empty() || spelled.find('\0') != std::string::npos) return fault(Exit::input, "cannot-read", "it has no name");

        std::vector<fs::path> candidates;
        const auto add = [&](const fs::path& folder) {
            add_once(candidates, folder / name);
            for (const char* ending : {".vmf", ".map"}) {
                fs::path ended = folder / name;
                ended += ending;
                add_once(candidates, std::move(ended));
            }
        };
        if (name.is_absolute()) {
            add("");
        } else {
            add(fs::path(from).parent_path());
            const fs::path main_folder = fs::path(main_map).parent_path();
            add(main_folder);
            std::error_code ignored;
            for (fs::path up = fs::absolute(main_folder.empty() ? "." : main_folder, ignored).lexically_normal(); up.has_relative_path(); up = up.parent_path())
                if (equal_ignoring_case(up.filename().string(), "maps") || equal_ignoring_case(up.filename().string(), "mapsrc")) add(up);
            for (const std::string& folder : instance_paths) add(folder);
        }
        std::string tried;
        for (const fs::path& candidate : candidates) {
            const std::optional<fs::path> found = on_disk(candidate);
            if (!found) {
                tried += (tried.empty() ? "" : ", ") + candidate.string();
                continue;
            }
            Result<Bytes> bytes = read_file(found->string());
            if (!bytes) return bytes.fault();
            return TextFile{found->string(), *std::move(bytes)};
        }
        return fault(Exit::input, "cannot-read", fmt::format("not found; tried {}", tried));
    };
}

} // namespace kiln

#include "formats/vmf/manifest.h"
#include "formats/document/side_text.h"

namespace kiln {
namespace {

struct Word {
    std::string_view text;
    char bracket = 0; // '{' or '}' outside of quotes
    int line = 0;
};

// Words of the text of key values; `//` begins a comment, quotes hold no escapes and end with their line.
std::vector<Word> words_of(std::string_view text) {
    std::vector<Word> words;
    int line = 1;
    for (std::size_t i = 0; i < text.size();) {
        const char c = text[i];
        if (c == '\n') ++line;
        if (c == ' ' || (c >= '\t' && c <= '\r')) {
            ++i;
        } else if (c == '/' && text.substr(i).starts_with("//")) {
            i = std::min(text.find('\n', i), text.size());
        } else if (c == '{' || c == '}') {
            words.push_back({text.substr(i++, 1), c, line});
        } else if (c == '"') {
            const std::size_t end = std::min(text.find_first_of("\"\n", i + 1), text.size());
            words.push_back({text.substr(i + 1, end - i - 1), 0, line});
            i = end < text.size() && text[end] == '"' ? end + 1 : end;
        } else {
            const std::size_t end = std::min(text.find_first_of(" \t\r\n\v\f{}\"", i), text.size());
            words.push_back({text.substr(i, end - i), 0, line});
            i = end;
        }
    }
    return words;
}

std::string_view text_of(std::span<const std::uint8_t> bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }

} // namespace

bool is_manifest(std::span<const std::uint8_t> bytes) {
    std::string_view text = text_of(bytes);
    if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    // The first blocks tell; a map's world may be long, so not all of the text is looked at.
    constexpr std::size_t kHead = 4096;
    const std::vector<Word> words = words_of(text.substr(0, kHead));
    int depth = 0;
    bool in_manifest = false;
    for (std::size_t i = 0; i < words.size(); ++i) {
        if (words[i].bracket == '}') --depth;
        if (words[i].bracket != '{') continue;
        const std::string_view name = i > 0 ? words[i - 1].text : "";
        if (depth == 0 && equal_ignoring_case(name, "world")) return false;
        if (depth == 0) in_manifest = equal_ignoring_case(name, "manifest");
        if (equal_ignoring_case(name, "maps") && (depth == 0 || (depth == 1 && in_manifest))) return true;
        ++depth;
    }
    return false;
}

Result<std::vector<ManifestMap>> read_manifest(std::span<const std::uint8_t> bytes, const std::string& file, Context& context) {
    std::string_view text = text_of(bytes);
    if (std::optional<Fault> no = reject_non_text(text, file)) return *no;
    std::vector<ManifestMap> maps;
    std::vector<std::string> blocks; // names of those that are open
    const std::vector<Word> words = words_of(text);
    const auto in_map = [&] {
        return blocks.size() >= 2 && equal_ignoring_case(blocks.back(), "vmf") && equal_ignoring_case(blocks[blocks.size() - 2], "maps");
    };
    for (std::size_t i = 0; i < words.size(); ++i) {
        if (words[i].bracket == '{') {
            blocks.emplace_back(i > 0 && !words[i - 1].bracket ? words[i - 1].text : "");
            if (in_map()) maps.push_back({.line = words[i].line});
        } else if (words[i].bracket == '}') {
            if (blocks.empty()) return fault(Exit::input, "unbalanced-braces", "a closing brace without an opening one", {file, words[i].line});
            blocks.pop_back();
        } else if (i + 1 < words.size() && !words[i + 1].bracket) {
            const std::string_view key = words[i].text, value = words[++i].text;
            if (!in_map()) continue;
            if (equal_ignoring_case(key, "name")) maps.back().name = value;
            if (equal_ignoring_case(key, "file")) maps.back().file = value, maps.back().line = words[i].line;
            if (equal_ignoring_case(key, "isprimary")) maps.back().primary = value == "1";
        }
    }
    if (!blocks.empty()) return fault(Exit::input, "unbalanced-braces", "the file ends inside a block: is it truncated?", {file, words.back().line});
    std::erase_if(maps, [&](const ManifestMap& m) {
        if (m.file.empty()) context.report(Severity::warning, "manifest-map-unnamed", "a map of the manifest has no File; it is left out", {file, m.line});
        return m.file.empty();
    });
    if (maps.empty()) return fault(Exit::input, "manifest-empty", "the manifest names no maps", {file, 1});
    return maps;
}

} // namespace kiln

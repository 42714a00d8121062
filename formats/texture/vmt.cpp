#include "formats/texture/vmt.h"
#include "formats/document/document.h"
#include "formats/vmf/scanner.h"
#include <charconv>

namespace kiln {

const std::string* Vmt::find(std::string_view key) const {
    for (auto it = keys.rbegin(); it != keys.rend(); ++it)
        if (it->first == key) return &it->second;
    return nullptr;
}
bool Vmt::is_set(std::string_view key) const {
    const std::string* value = find(key);
    if (!value) return false;
    double number = 0;
    std::from_chars(value->data(), value->data() + value->size(), number);
    return number != 0;
}

Result<Vmt> read_vmt(std::string_view text, const std::string& file) {
    using vmf::TokenKind;
    if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    vmf::Scanner scanner(text);
    Vmt out;
    vmf::Token token = scanner.next();
    const auto no = [&](const char* message) { return fault(Exit::input, "texture-unreadable", message, {file, token.line}); };
    if (token.kind != TokenKind::word) return no("a material begins with the name of its shader");
    out.shader = lower_case(token.text);
    token = scanner.next();
    if (token.kind != TokenKind::open) return no("the name of a shader is followed by a block");
    const bool patch = out.shader == "patch";
    // Blocks whose keys count: the shader's own, and of a patch those of insert and replace.
    int depth = 1, passed_from = 0; // passed over from this depth on; 0: nothing is
    std::string key;
    bool has_key = false;
    for (token = scanner.next(); token.kind != TokenKind::end && depth > 0; token = scanner.next()) {
        if (token.kind == TokenKind::close) {
            if (passed_from == depth) passed_from = 0;
            --depth, has_key = false;
        } else if (token.kind == TokenKind::open) {
            ++depth;
            const bool counts = patch && depth == 2 && (key == "insert" || key == "replace");
            if (passed_from == 0 && !(has_key && counts)) passed_from = depth;
            has_key = false;
        } else if (!has_key) {
            if (token.text.starts_with('[')) continue; // a condition, [$X360], behind the pair before
            key = lower_case(token.text), has_key = true;
        } else {
            has_key = false;
            if (passed_from > 0) continue;
            if (patch && depth == 1 && key == "include") out.include = token.text;
            else out.keys.emplace_back(key, std::string(token.text));
        }
    }
    return out;
}

} // namespace kiln

#include "formats/texture/vmt.h"
#include "formats/document/document.h"
#include "formats/vmf/scanner.h"
#include <algorithm>
#include <charconv>

namespace kiln {
namespace {

// "[$X360]", "[!$PS3 && $WIN32]": what stands behind a pair or a block's name. A vector as a value has no $.
bool begins_condition(std::string_view token) { return token.starts_with("[$") || token.starts_with("[!"); }
bool holds(std::string_view condition) { // on a desktop computer; of what is not known here, yes
    const std::string text = lower_case(condition.substr(1, condition.find(']') - 1));
    const auto term = [](std::string_view t) {
        bool yes = true;
        while (!t.empty() && (t.front() == '!' || t.front() == ' ')) yes = t.front() == '!' ? !yes : yes, t.remove_prefix(1);
        while (!t.empty() && t.back() == ' ') t.remove_suffix(1);
        for (const std::string_view console : {"$x360", "$xbox", "$ps3", "$gameconsole", "$linux", "$osx", "$posix", "$deck"})
            if (t == console) return !yes;
        for (const std::string_view here : {"$win32", "$win64", "$windows", "$pc", "$desktop"})
            if (t == here) return yes;
        return true;
    };
    const auto split = [](std::string_view all, std::string_view at, const auto& each) {
        for (std::size_t from = 0; from <= all.size();) {
            const std::size_t to = std::min(all.find(at, from), all.size());
            each(all.substr(from, to - from));
            from = to + at.size();
        }
    };
    bool any = false;
    split(text, "||", [&](std::string_view part) {
        bool all = true;
        split(part, "&&", [&](std::string_view t) { all = all && term(t); });
        any = any || all;
    });
    return any;
}

} // namespace

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
    bool has_key = false, block_holds = true;
    enum { none, pair, include } before = none; // what a condition would be of
    for (token = scanner.next(); token.kind != TokenKind::end && depth > 0; token = scanner.next()) {
        if (token.kind == TokenKind::close) {
            if (passed_from == depth) passed_from = 0;
            --depth, has_key = false, before = none;
        } else if (token.kind == TokenKind::open) {
            ++depth;
            const bool counts = block_holds && patch && depth == 2 && (key == "insert" || key == "replace");
            if (passed_from == 0 && !(has_key && counts)) passed_from = depth;
            has_key = false, before = none;
        } else if (begins_condition(token.text)) {
            std::string condition(token.text);
            while (condition.find(']') == std::string::npos) { // words end at spaces
                token = scanner.next();
                if (token.kind != TokenKind::word) break;
                condition += token.text;
            }
            if (token.kind == TokenKind::end) break;
            const bool yes = holds(condition);
            if (has_key) block_holds = yes; // of the block that begins
            else if (before == pair && !yes) out.keys.pop_back();
            else if (before == include && !yes) out.include.clear();
            before = none;
            if (token.kind == TokenKind::open || token.kind == TokenKind::close) return no("a condition has no end");
        } else if (!has_key) {
            key = lower_case(token.text), has_key = block_holds = true, before = none;
        } else {
            has_key = false;
            if (passed_from > 0) continue;
            if (patch && depth == 1 && key == "include") out.include = token.text, before = include;
            else out.keys.emplace_back(key, std::string(token.text)), before = pair;
        }
    }
    return out;
}

} // namespace kiln

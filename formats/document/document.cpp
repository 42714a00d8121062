#include "formats/document/document.h"

namespace kiln {
namespace {

constexpr bool is_space(char c) {
    return c == ' ' || (c >= '\t' && c <= '\r');
}
constexpr char lower(char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
}

} // namespace

bool equal_ignoring_case(std::string_view a, std::string_view b) {
    if (a.size() != b.size()) return false;
    for (std::size_t i = 0; i < a.size(); ++i)
        if (lower(a[i]) != lower(b[i])) return false;
    return true;
}

std::string lower_case(std::string_view text) {
    std::string out(text);
    for (char& c : out) c = lower(c);
    return out;
}

std::vector<double> parse_numbers(std::string_view text, bool* complete) {
    std::vector<double> numbers;
    bool all = true;
    for (std::size_t at = 0; all;) {
        while (at < text.size() && is_space(text[at])) ++at;
        if (at == text.size()) break;
        std::size_t end = at;
        while (end < text.size() && !is_space(text[end])) ++end;
        const std::optional<double> value = parse_number(text.substr(at, end - at));
        if (value)
            numbers.push_back(*value);
        else
            all = false;
        at = end;
    }
    if (complete) *complete = all;
    return numbers;
}

const DocKey* DocEntity::find(std::string_view key) const {
    return find_key(keys, key);
}
std::string_view DocEntity::get(std::string_view key, std::string_view otherwise) const {
    const DocKey* found = find(key);
    return found ? std::string_view(found->value) : otherwise;
}
double DocEntity::number(std::string_view key, double otherwise) const {
    return key_number(keys, key, otherwise);
}
Vec3 DocEntity::vector(std::string_view key, Vec3 otherwise) const {
    return key_vector(keys, key, otherwise);
}

const DocKey* find_key(const std::vector<DocKey>& keys, std::string_view key) {
    for (const DocKey& k : keys)
        if (equal_ignoring_case(k.key, key)) return &k;
    return nullptr;
}
double key_number(const std::vector<DocKey>& keys, std::string_view key, double otherwise) {
    const DocKey* found = find_key(keys, key);
    return found ? parse_number(found->value).value_or(otherwise) : otherwise;
}
Vec3 key_vector(const std::vector<DocKey>& keys, std::string_view key, Vec3 otherwise) {
    const DocKey* found = find_key(keys, key);
    if (!found) return otherwise;
    bool complete = false;
    const std::vector<double> n = parse_numbers(found->value, &complete);
    if (!complete || n.size() != 3) return otherwise;
    return {n[0], n[1], n[2]};
}

} // namespace kiln

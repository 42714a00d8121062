#include "formats/material/rules.h"

namespace kiln {
namespace {

// A set "[...]" at `at`: where it ends, and whether `c` is in it; npos: no closing bracket.
std::size_t match_set(std::string_view p, std::size_t at, char c, bool& in) {
    std::size_t i = at + 1;
    const bool negated = i < p.size() && (p[i] == '!' || p[i] == '^');
    if (negated) ++i;
    bool found = false;
    for (bool first = true; i < p.size() && (first || p[i] != ']'); first = false) {
        const char low = p[i++];
        char high = low;
        if (i + 1 < p.size() && p[i] == '-' && p[i + 1] != ']') high = p[i + 1], i += 2;
        const auto u = [](char x) { return static_cast<unsigned char>(x); };
        if (u(low) <= u(c) && u(c) <= u(high)) found = true;
    }
    if (i >= p.size()) return std::string_view::npos;
    in = found != negated;
    return i + 1;
}

} // namespace

bool is_glob(std::string_view pattern) {
    return pattern.find_first_of("*?[") != std::string_view::npos;
}

bool glob_match(std::string_view p, std::string_view t) {
    // One level of backtracking suffices: a later star makes every earlier choice as good as any other.
    std::size_t pi = 0, ti = 0, star = std::string_view::npos, star_t = 0;
    while (ti < t.size()) {
        std::size_t next = pi + 1;
        bool one = false;
        if (pi < p.size() && p[pi] == '*') {
            star = pi++, star_t = ti;
            continue;
        }
        if (pi < p.size()) {
            if (p[pi] == '?') {
                one = true;
            } else if (p[pi] == '[') {
                bool in = false;
                const std::size_t end = match_set(p, pi, t[ti], in);
                one = end == std::string_view::npos ? t[ti] == '[' : in;
                if (end != std::string_view::npos) next = end;
            } else {
                one = p[pi] == t[ti];
            }
        }
        if (one) {
            pi = next, ++ti;
        } else if (star != std::string_view::npos) {
            pi = star + 1, ti = ++star_t;
        } else {
            return false;
        }
    }
    while (pi < p.size() && p[pi] == '*') ++pi;
    return pi == p.size();
}

} // namespace kiln

#include "formats/material/lights_rad.h"
#include "formats/document/document.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace kiln {
namespace {

std::string_view next_word(std::string_view& line) {
    const auto blank = [](char c) { return c == ' ' || (c >= '\t' && c <= '\r'); };
    std::size_t first = 0;
    while (first < line.size() && blank(line[first])) ++first;
    std::size_t end = first;
    while (end < line.size() && !blank(line[end])) ++end;
    const std::string_view word = line.substr(first, end - first);
    line.remove_prefix(end);
    return word;
}

} // namespace

std::vector<MaterialRule> rules_of_lights_rad(std::string_view text, const std::string& file, Context& context) {
    // `ldr:` lines hold only where nothing else does, `hdr:` lines before all others: three passes of rules, the
    // later wins.
    std::array<std::vector<MaterialRule>, 3> passes;
    int number = 0, ignored = 0, ignored_line = 0;
    while (!text.empty()) {
        const std::size_t end = std::min(text.find('\n'), text.size());
        std::string_view line = text.substr(0, end);
        text.remove_prefix(std::min(end + 1, text.size()));
        ++number;
        for (const std::string_view comment : {"//", "#", ";"})
            if (const std::size_t at = line.find(comment); at != std::string_view::npos) line = line.substr(0, at);
        std::string_view name = next_word(line);
        if (name.empty()) continue;
        if (equal_ignoring_case(name, "noshadow") || equal_ignoring_case(name, "forcetextureshadow")) {
            if (ignored++ == 0) ignored_line = number;
            continue;
        }
        std::size_t pass = 1;
        const auto prefix = [&](std::string_view p) {
            if (!equal_ignoring_case(name.substr(0, p.size()), p)) return false;
            name.remove_prefix(p.size());
            if (name.empty()) name = next_word(line);
            return true;
        };
        if (prefix("hdr:"))
            pass = 2;
        else if (prefix("ldr:"))
            pass = 0;
        bool complete = false;
        const std::vector<double> v = parse_numbers(line, &complete);
        if (name.empty() || !complete || v.size() < 1) {
            context.report(Severity::warning, "lights-rad-line",
                           "a line should be: name red green blue [brightness]; it is ignored", {file, number});
            continue;
        }
        const auto channel = [&](std::size_t i) { return v[v.size() >= 3 ? i : 0]; };
        const double scale = v.size() >= 4 ? v[3] / 255 : v.size() == 2 ? v[1] / 255 : 1;
        Rgb emission;
        for (std::size_t i = 0; i < 3; ++i)
            emission[i] =
                static_cast<float>(std::clamp(std::pow(std::max(0.0, channel(i)) / 255, 2.2) * scale, 0.0, 1e9));
        MaterialRule rule;
        rule.pattern = name;
        rule.lower = lower_case(name);
        rule.emission = emission;
        passes[pass].push_back(std::move(rule));
    }
    if (ignored > 0)
        context.report(Severity::warning, "lights-rad-not-handled",
                       fmt::format("{} noshadow/forcetextureshadow lines are not handled yet", ignored),
                       {file, ignored_line});
    std::vector<MaterialRule> rules;
    for (auto& pass : passes)
        for (MaterialRule& rule : pass) rules.push_back(std::move(rule));
    return rules;
}

} // namespace kiln

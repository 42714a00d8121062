#include "compiler/world/side_list.h"
#include <algorithm>
#include <charconv>
#include <fmt/format.h>
#include <numeric>

namespace kiln {
namespace {

bool parts_words(char c) { return c == ' ' || (c >= '\t' && c <= '\r') || c == ',' || c == ';'; }

} // namespace

SideNames::SideNames(const World& world) {
    if (world.format != MapFormat::vmf) return;
    std::vector<Row> rows;
    rows.reserve(world.sides.size());
    for (const WorldBrush& b : world.brushes)
        for (std::uint32_t s = b.first_side; s < b.first_side + b.side_count; ++s) rows.push_back({b.file, world.sides[s].id});
    std::vector<std::uint32_t> order(rows.size());
    std::iota(order.begin(), order.end(), 0u);
    std::ranges::stable_sort(order, {}, [&](std::uint32_t s) { return rows[s]; }); // sides stand brush by brush: row s is side s
    for (const std::uint32_t s : order) rows_.push_back(rows[s]), sides_.push_back(id<SideId>(s));
}

std::span<const SideId> SideNames::find(std::uint16_t file, int id) const {
    const auto [first, last] = std::ranges::equal_range(rows_, Row{file, id});
    return std::span(sides_).subspan(static_cast<std::size_t>(first - rows_.begin()), static_cast<std::size_t>(last - first));
}

std::vector<SideId> resolve_side_list(const SideNames& names, std::string_view list, std::uint16_t file,
                                      const SourceLocation& where, Context& context) {
    constexpr std::size_t kShown = 8;
    std::vector<SideId> found;
    std::size_t words = 0, missing = 0;
    std::string shown;
    for (std::size_t at = 0; at < list.size();) {
        while (at < list.size() && parts_words(list[at])) ++at;
        std::size_t end = at;
        while (end < list.size() && !parts_words(list[end])) ++end;
        if (end == at) break;
        const std::string_view word = list.substr(at, end - at);
        at = end;
        ++words;
        int number = 0;
        const auto [stop, ec] = std::from_chars(word.data(), word.data() + word.size(), number);
        const bool is_id = ec == std::errc{} && stop == word.data() + word.size();
        const std::span<const SideId> sides = is_id ? names.find(file, number) : std::span<const SideId>{};
        found.insert(found.end(), sides.begin(), sides.end());
        if (!sides.empty()) continue;
        if (++missing <= kShown) {
            if (missing > 1) shown += ", ";
            for (const char c : word.substr(0, 20)) shown += c > 32 && c < 127 ? c : '?';
        }
    }
    std::ranges::sort(found);
    found.erase(std::unique(found.begin(), found.end()), found.end());
    if (missing > 0)
        context.report(Severity::warning, "side-missing",
                       fmt::format("{} of the {} sides it names are not in the map: {}{}", missing, words, shown,
                                   missing > kShown ? ", ..." : ""),
                       where);
    return found;
}

std::vector<SideId> resolve_side_list(const World& world, std::string_view list, std::uint16_t file,
                                      const SourceLocation& where, Context& context) {
    return resolve_side_list(SideNames(world), list, file, where, context);
}

std::vector<SideId> resolve_side_list(const World& world, const SideNames& names, EntityId entity, std::string_view key,
                                      Context& context) {
    const WorldEntity& e = world.entities[entity.at()];
    const DocKey* found = find_key(e.keys, key);
    if (!found) return {};
    SourceLocation where = world.location(entity);
    if (found->line > 0) where.line = found->line;
    return resolve_side_list(names, found->value, e.file, where, context);
}

} // namespace kiln

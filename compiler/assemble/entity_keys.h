// Private: which keys of an entity say where it is, which way it points, what it is called and what it calls others.
// A built-in table by key and class takes the place of an FGD: no game data is needed. The table is in NOTES.md.
#pragma once
#include "compiler/assemble/placement.h"
#include "libs/core/context.h"
#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <set>

namespace kiln::assemble_detail {

// Moves and turns what the keys say. `where`: of the entity, for what cannot be told by its keys.
void place_keys(DocEntity& entity, const Placement& placement, const SourceLocation& where, Context& context);

// Ids of sides and navigation nodes in the keys, by the old id; one that is not in the map gets a new one too, by `fresh`,
// so that it does not come to mean somebody else's.
struct FreshIds {
    int next = 1;
    std::vector<int> taken; // sorted: what is not to come again once the largest number has been reached
    int operator()() {
        if (next == INT32_MAX) next = 1, again_ = true;
        while (again_ && std::ranges::binary_search(taken, next)) ++next;
        return next++;
    }

private:
    bool again_ = false;
};
struct IdMap {
    std::map<int, int> ids;
    FreshIds* fresh = nullptr;
    int operator()(int old) {
        const auto it = ids.find(old);
        return it != ids.end() ? it->second : ids.emplace(old, (*fresh)()).first->second;
    }
};
void renumber_sides(DocEntity& entity, IdMap& ids);
void renumber_nodes(DocEntity& entity, IdMap& ids);
bool holds_entity_name(std::string_view key); // but outputs

// An output `target,input,parameter,delay,times`, separated by commas or by byte 0x1B.
struct Output {
    std::vector<std::string> fields;
    char separator = ',';
    static Output parse(std::string_view value);
    std::string text() const;
};

enum class FixupStyle : std::uint8_t { prefix, postfix, none };
struct NameFixup {
    FixupStyle style = FixupStyle::prefix;
    std::string instance;                  // its name
    std::set<std::string> names, classes;  // of the entities in the instance, lower case

    std::string operator()(std::string_view name) const; // "a" -> "instance-a"; "@a" and "!a" stay
};
void fix_names(DocEntity& entity, const NameFixup& fix);

// `$variable` -> text in keys, values and outputs; longest variable first, ASCII case ignored.
using Replacements = std::vector<std::pair<std::string, std::string>>;
constexpr std::size_t kMostReplaced = std::size_t{1} << 16;
// Nothing: it would be longer than kMostReplaced.
std::optional<std::string> replaced(std::string_view text, const Replacements& replacements);

std::string number_text(double x); // at most six decimals, no exponent, no negative zero

} // namespace kiln::assemble_detail

// Side lists: the `sides` keys of VMF entities (env_cubemap, info_overlay, info_no_dynamic_shadow, ...), which name brush
// sides by the ids that the editor gave them.
#pragma once
#include "compiler/world/world.h"
#include <span>
#include <string_view>

namespace kiln {

// Sides by the id their file gives them. Build it once and ask it often. Only sides of VMF files have ids; those of
// other maps are never found.
class SideNames {
public:
    explicit SideNames(const World& world);
    // All sides of that id in the file (index for World::name_of), ascending: where ids were copied, all are meant.
    std::span<const SideId> find(std::uint16_t file, int id) const;

private:
    struct Row {
        std::uint16_t file;
        int id;
        friend auto operator<=>(const Row&, const Row&) = default;
    };
    std::vector<Row> rows_;     // sorted
    std::vector<SideId> sides_; // parallel
};

// `list`: ids apart by white space, commas or semicolons, as the file `where` lies in (index `file`) writes them. Ascending, each side once.
// Errors   side-missing (warning at `where`): ids that no side of the file has, and words that are no ids; one message
//          a list
std::vector<SideId> resolve_side_list(const SideNames& names, std::string_view list, std::uint16_t file,
                                      const SourceLocation& where, Context& context);
std::vector<SideId> resolve_side_list(const World& world, std::string_view list, std::uint16_t file,
                                      const SourceLocation& where, Context& context);
// The list under `key` of an entity; empty where there is no such key.
std::vector<SideId> resolve_side_list(const World& world, const SideNames& names, EntityId entity, std::string_view key,
                                      Context& context);

} // namespace kiln

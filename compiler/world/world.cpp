#include "compiler/world/world.h"
#include "libs/core/check.h"
#include <algorithm>

namespace kiln {

std::string_view WorldEntity::get(std::string_view key, std::string_view otherwise) const {
    const DocKey* found = find_key(keys, key);
    return found ? std::string_view(found->value) : otherwise;
}
double WorldEntity::number(std::string_view key, double otherwise) const {
    return key_number(keys, key, otherwise);
}
Vec3 WorldEntity::vector(std::string_view key, Vec3 otherwise) const {
    return key_vector(keys, key, otherwise);
}

SourceLocation World::location(EntityId entity) const {
    if (entity.at() >= entities.size()) return {file};
    const WorldEntity& e = entities[entity.at()];
    return {name_of(e.file), e.line, e.id};
}
SourceLocation World::location(BrushId brush) const {
    if (brush.at() >= brushes.size()) return {file};
    const WorldBrush& b = brushes[brush.at()];
    return {name_of(b.file), b.line, entities[b.entity.at()].id, b.id};
}
SourceLocation World::location(SideId side) const {
    if (side.at() >= sides.size()) return {file};
    const auto after = std::upper_bound(brushes.begin(), brushes.end(), side.value,
                                        [](std::uint32_t s, const WorldBrush& b) { return s < b.first_side; });
    SourceLocation where = location(id<BrushId>(static_cast<std::size_t>(after - brushes.begin()) - 1));
    where.line = sides[side.at()].line;
    where.side = sides[side.at()].id;
    return where;
}

SourceLocation World::location(const WorldPatch& patch) const {
    return {name_of(patch.file), patch.grid.line, entities[patch.entity.at()].id, patch.grid.id};
}

void validate(const World& world) {
    KILN_CHECK(!world.entities.empty());
    KILN_CHECK(!world.entities[0].model.valid() || world.entities[0].model.value == 0);
    std::uint32_t next_side = 0;
    for (const WorldBrush& b : world.brushes) {
        KILN_CHECK_OP(b.first_side, ==, next_side); // sides stand brush by brush, without gaps
        KILN_CHECK_OP(b.side_count, >, 0u);
        next_side += b.side_count;
        KILN_CHECK_OP(b.model.value, <, world.model_count);
        KILN_CHECK_OP(b.entity.at(), <, world.entities.size());
        KILN_CHECK((b.contents == Contents::empty) == b.displaced);
        KILN_CHECK(!b.model.value || world.entities[b.entity.at()].model == b.model);
    }
    KILN_CHECK_OP(next_side, ==, world.sides.size());
    for (const WorldSide& s : world.sides) {
        KILN_CHECK_OP(s.material.at(), <, world.materials.size());
        KILN_CHECK(s.lightmap_scale > 0);
        KILN_CHECK(s.texture.u_scale != 0 && s.texture.v_scale != 0);
    }
    for (std::size_t d = 0; d < world.displacements.size(); ++d)
        KILN_CHECK_OP(world.sides.at(world.displacements[d].side.at()).displacement, ==, static_cast<std::int32_t>(d));
    for (const WorldPatch& p : world.patches) {
        KILN_CHECK_OP(p.material.at(), <, world.materials.size());
        KILN_CHECK_OP(p.entity.at(), <, world.entities.size());
        KILN_CHECK_OP(p.model.value, <, world.model_count);
        KILN_CHECK_OP(p.grid.points.size(), ==, std::size_t{p.grid.columns} * p.grid.rows);
    }
    std::uint32_t models = 1;
    for (std::size_t e = 1; e < world.entities.size(); ++e)
        if (world.entities[e].model.valid()) KILN_CHECK_OP(world.entities[e].model.value, ==, models++);
    KILN_CHECK_OP(models, ==, world.model_count);
}

} // namespace kiln

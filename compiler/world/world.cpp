#include "compiler/world/world.h"
#include <algorithm>
#include <fmt/format.h>

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
BrushId World::brush_of(SideId side) const {
    const auto after = std::ranges::upper_bound(brushes, side.value, {}, &WorldBrush::first_side);
    return id<BrushId>(static_cast<std::size_t>(after - brushes.begin()) - 1);
}
SourceLocation World::location(SideId side) const {
    if (side.at() >= sides.size()) return {file};
    SourceLocation where = location(brush_of(side));
    where.line = sides[side.at()].line;
    where.side = sides[side.at()].id;
    return where;
}

SourceLocation World::location(const WorldPatch& patch) const {
    return {name_of(patch.file), patch.grid.line, entities[patch.entity.at()].id, patch.grid.id};
}

void check_invariants(const World& world, Checker& checker) {
    Check &entities = checker.add("world-entities"), &brushes = checker.add("world-brushes"), &sides = checker.add("world-sides");
    if (!entities.expect(!world.entities.empty(), [&] { return Finding{{world.file}, "there is no worldspawn"}; })) return;
    entities.expect(!world.entities[0].model.valid() || world.entities[0].model.value == 0,
                    [&] { return Finding{world.location(EntityId{0}), "the worldspawn is not model 0"}; });
    std::uint32_t next_side = 0;
    for (std::size_t i = 0; i < world.brushes.size(); ++i) {
        const WorldBrush& b = world.brushes[i];
        if (!brushes.expect(b.entity.at() < world.entities.size(), [&] { return Finding{{world.name_of(0), b.line}, fmt::format("brush {} names entity {} of {}", i, b.entity.value, world.entities.size())}; }))
            continue;
        const auto tell = [&](std::string what) { return [&, what] { return Finding{world.location(id<BrushId>(i)), what}; }; };
        brushes.expect(b.first_side == next_side, tell(fmt::format("its sides begin at {}, not at {}", b.first_side, next_side))); // brush by brush, without gaps
        brushes.expect(b.side_count > 0, tell("it has no sides"));
        next_side = b.first_side + b.side_count;
        brushes.expect(b.model.value < world.model_count, tell(fmt::format("it names model {} of {}", b.model.value, world.model_count)));
        brushes.expect((b.contents == Contents::empty) == b.displaced, tell("displaced brushes are empty, no others"));
        brushes.expect(!b.model.value || world.entities[b.entity.at()].model == b.model, tell("its model is not that of its entity"));
    }
    brushes.expect(next_side == world.sides.size(), [&] { return Finding{{world.file}, fmt::format("{} sides belong to brushes, there are {}", next_side, world.sides.size())}; });
    if (!brushes.ok()) return; // places of sides are found through brushes
    for (std::size_t i = 0; i < world.sides.size(); ++i) {
        const WorldSide& s = world.sides[i];
        const auto tell = [&](const char* what) { return [&, what] { return Finding{world.location(id<SideId>(i)), what}; }; };
        sides.expect(s.material.at() < world.materials.size(), tell("it names a material that does not exist"));
        sides.expect(s.lightmap_scale > 0, tell("its luxel size is not positive"));
        sides.expect(s.texture.u_scale != 0 && s.texture.v_scale != 0, tell("its texture scale is 0"));
    }
    Check &displacements = checker.add("world-displacements"), &patches = checker.add("world-patches");
    for (std::size_t d = 0; d < world.displacements.size(); ++d) {
        const SideId side = world.displacements[d].side;
        displacements.expect(side.at() < world.sides.size() && world.sides[side.at()].displacement == static_cast<std::int32_t>(d),
                             [&] { return Finding{world.location(side), fmt::format("displacement {} and its side do not name each other", d)}; });
    }
    for (const WorldPatch& p : world.patches)
        patches.expect(p.material.at() < world.materials.size() && p.entity.at() < world.entities.size() && p.model.value < world.model_count &&
                           p.grid.points.size() == std::size_t{p.grid.columns} * p.grid.rows,
                       [&] { return Finding{{world.name_of(p.file), p.grid.line}, "a patch names what does not exist, or its points do not fit its size"}; });
    std::uint32_t models = 1;
    for (std::size_t e = 1; e < world.entities.size(); ++e)
        if (const ModelId m = world.entities[e].model; m.valid()) {
            entities.expect(m.value == models, [&] { return Finding{world.location(id<EntityId>(e)), fmt::format("its model is {}, in entity order it would be {}", m.value, models)}; });
            ++models;
        }
    entities.expect(models == world.model_count, [&] { return Finding{{world.file}, fmt::format("{} entities have models, {} are stated", models, world.model_count)}; });
}

void validate(const World& world) {
    Checker checker;
    check_invariants(world, checker);
}

} // namespace kiln

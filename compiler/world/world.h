// World: the document interpreted. Brushes with their role, brush models, point entities, materials.
//
// In       document, material database
// Out      tables below; ids index them; nothing geometric has been computed yet
// Errors   no entities (fault, exit 3), no brush in the world (fault, exit 4); unusable keys (diagnostics);
//          what is not compiled yet: one warning each kind, with its count and first place
#pragma once
#include "formats/document/document.h"
#include "formats/material/material.h"
#include "libs/core/context.h"
#include "libs/core/index.h"
#include <vector>

namespace kiln {

using EntityId = Index<struct EntityTag>;
using ModelId = Index<struct ModelTag>; // 0: the world; others: brush entities
using BrushId = Index<struct BrushTag>;
using SideId = Index<struct SideTag>;
using MaterialId = Index<struct MaterialTag>;

// What fills a brush, strongest first: where brushes overlap, the stronger owns the space and, of equal
// strength, the one earlier in the file owns a shared face. Detail never seals, never splits the tree.
enum class Contents : std::uint8_t {
    empty = 0,
    solid,  // structural: seals, splits, hides
    detail, // solid that does not seal
    window, // translucent, alpha-tested or non-solid but drawn (both kinds of sides against air); never seals
    water,
    slime,
    lava,
    area_portal,
    hint,
    clip,
    trigger, // never make faces. clip with casts_light_shadow: a light blocker
};

struct WorldSide {
    std::array<std::array<Decimal, 3>, 3> points{};
    MaterialId material;
    DocTexture texture;
    double lightmap_scale = 16; // world units per luxel, after all keys
    std::uint32_t smoothing_groups = 0;
    bool displacement = false;
    int line = 0, id = -1; // of the map file
    template <class A> void fields(A& a) {
        a(points, material, texture, lightmap_scale, smoothing_groups, displacement, line, id);
    }
};

struct WorldBrush {
    std::uint32_t first_side = 0, side_count = 0;
    Contents contents = Contents::solid;
    ModelId model;                  // 0: world
    EntityId entity;                // it was written in (func_detail, func_group keep theirs)
    bool casts_light_shadow = true; // brush entities: only by key (vrad_brush_cast_shadows, _shadow)
    bool draws = true;              // false: no face of it is drawn (tool brushes)
    bool collides = true;           // false: players pass (illusionary, liquids, triggers)
    int line = 0, id = -1;
    template <class A> void fields(A& a) {
        a(first_side, side_count, contents, model, entity, casts_light_shadow, draws, collides, line, id);
    }
};

struct WorldEntity {
    std::vector<DocKey> keys;
    ModelId model; // of a brush entity; none: point entity or merged into the world
    Vec3 origin{};
    bool has_origin = false;
    int line = 0, id = -1;
    template <class A> void fields(A& a) { a(keys, model, origin, has_origin, line, id); }
    std::string_view get(std::string_view key, std::string_view otherwise = {}) const;
    double number(std::string_view key, double otherwise) const;
    Vec3 vector(std::string_view key, Vec3 otherwise) const;
};

struct World {
    std::string file;
    MapFormat format = MapFormat::vmf;
    std::vector<Material> materials; // a name may stand twice: rows of Quake 2 add flags of their own
    std::vector<WorldSide> sides;
    std::vector<WorldBrush> brushes;   // in file order
    std::vector<WorldEntity> entities; // 0: worldspawn
    std::uint32_t model_count = 1;
    template <class A> void fields(A& a) { a(file, format, materials, sides, brushes, entities, model_count); }

    SourceLocation location(BrushId brush) const;
    SourceLocation location(SideId side) const; // O(log brushes)
    SourceLocation location(EntityId entity) const;
};

struct WorldOptions {
    double lightmap_scale = 16; // where neither side, entity nor worldspawn says (world units per luxel)
    template <class A> void fields(A& a) { a(lightmap_scale); }
};
Result<World> build_world(const Document& document, MaterialDatabase& materials, const WorldOptions& options,
                          Context& context);
void validate(const World& world);

} // namespace kiln

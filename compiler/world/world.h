// World: the document interpreted. Brushes with their role, brush models, point entities, materials.
//
// In       document, material database
// Out      tables below; ids index them; nothing geometric has been computed yet
// Errors   no entities (fault, exit 3), no brush in the world (fault, exit 4); unusable keys (diagnostics);
//          what is not compiled yet: one warning each kind, with its count and first place
#pragma once
#include "formats/document/document.h"
#include "formats/material/material.h"
#include "libs/core/checker.h"
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
    grate,   // alpha-tested: drawn from both kinds of sides, solid to players, not to bullets; never seals, hides nothing
    occluder,    // func_occluder: polygons for the run time, no faces, no contents
    vis_cluster, // func_viscluster: leaves in it share a cluster; no faces, no contents
};
constexpr std::size_t kContentsCount = 14;
// Numbers are those of the level file and do not tell strength; strength() of csg.h does.
// Hides what is behind it, whether it seals or not.
inline bool opaque(Contents c) { return c == Contents::solid || c == Contents::detail; }

// What a brush stops, beside light: bits of WorldBrush::blocks.
enum BlocksBit : std::uint8_t { kBlocksPlayers = 1, kBlocksNpcs = 2, kBlocksBullets = 4, kBlocksSight = 8, kBlocksAll = 15 };

struct WorldSide {
    std::array<std::array<Decimal, 3>, 3> points{};
    MaterialId material;
    DocTexture texture;
    double lightmap_scale = 16; // world units per luxel, after all keys
    std::uint32_t smoothing_groups = 0;
    std::int32_t displacement = -1;  // index into World::displacements; -1: none
    bool no_dynamic_shadow = false;  // info_no_dynamic_shadow names it
    int line = 0, id = -1;           // of the map file
    std::vector<Vec3> editor_vertices; // as the editor saw the face, rounded; empty: not given
    template <class A> void fields(A& a) {
        a(points, material, texture, lightmap_scale, smoothing_groups, displacement, no_dynamic_shadow, line, id, editor_vertices);
    }
};

struct WorldBrush {
    std::uint32_t first_side = 0, side_count = 0;
    Contents contents = Contents::solid;
    ModelId model;                  // 0: world
    EntityId entity;                // it was written in (func_detail, func_group keep theirs)
    bool casts_light_shadow = true; // brush entities: only by key (vrad_brush_cast_shadows, _shadow)
    bool draws = true;              // false: no face of it is drawn (tool brushes)
    bool collides = true;           // players do not pass: blocks & kBlocksPlayers
    std::uint8_t blocks = kBlocksAll; // BlocksBit
    bool displaced = false;         // some side carries a displacement: the brush itself is `empty` and draws nothing
    std::uint16_t file = 0;         // index for World::name_of
    int line = 0, id = -1;
    template <class A> void fields(A& a) {
        a(first_side, side_count, contents, model, entity, casts_light_shadow, draws, collides, blocks, displaced, file, line, id);
    }
};

struct WorldDisplacement {
    SideId side; // its base face: a quad of a brush of the world
    DocDisplacement grid;
    template <class A> void fields(A& a) { a(side, grid); }
};

struct WorldPatch { // a curved surface; blocks light and is drawn like a detail brush's side, never seals
    EntityId entity;
    ModelId model;
    MaterialId material;
    double lightmap_scale = 16;
    std::uint16_t file = 0;
    DocPatch grid;
    template <class A> void fields(A& a) { a(entity, model, material, lightmap_scale, file, grid); }
};

// A picture laid over faces: info_overlay (a quad of its own on named sides) and infodecal (a square at a point).
struct WorldOverlay {
    enum Kind : std::uint8_t { overlay, decal };
    Kind kind = overlay;
    EntityId entity;
    MaterialId material;
    Vec3 origin{}, u{1, 0, 0}, v{0, 1, 0}, normal{0, 0, 1}; // BasisOrigin, BasisU, BasisV, BasisNormal; unit, map space
    std::array<Vec2, 4> corners{};                          // uv0..uv3: map units along u and v
    std::array<double, 4> uv_range{0, 1, 0, 1};             // StartU, EndU, StartV, EndV
    int render_order = 0;
    double fade_min = -1, fade_max = -1;                    // map units; < 0: none
    std::vector<SideId> sides;                              // ascending; a decal's are found by the surfaces stage
    template <class A> void fields(A& a) {
        a(kind, entity, material, origin, u, v, normal, corners, uv_range, render_order, fade_min, fade_max, sides);
    }
};

struct WorldEntity {
    std::vector<DocKey> keys;
    ModelId model; // of a brush entity; none: point entity or merged into the world
    Vec3 origin{};
    bool has_origin = false;
    std::uint16_t file = 0; // index for World::name_of
    int line = 0, id = -1;
    template <class A> void fields(A& a) { a(keys, model, origin, has_origin, file, line, id); }
    std::string_view get(std::string_view key, std::string_view otherwise = {}) const;
    double number(std::string_view key, double otherwise) const;
    Vec3 vector(std::string_view key, Vec3 otherwise) const;
};

struct World {
    std::string file;
    std::vector<std::string> included; // other files: instances, prefabs
    MapFormat format = MapFormat::vmf;
    std::vector<Material> materials; // a name may stand twice: rows of Quake 2 add flags of their own
    std::vector<WorldSide> sides;
    std::vector<WorldBrush> brushes;   // in file order
    std::vector<WorldEntity> entities; // 0: worldspawn
    std::vector<WorldDisplacement> displacements; // in file order
    std::vector<WorldPatch> patches;              // in file order
    std::vector<WorldOverlay> overlays;           // in entity order
    std::uint32_t model_count = 1;
    template <class A> void fields(A& a) {
        a(file, included, format, materials, sides, brushes, entities, displacements, patches, overlays, model_count);
    }

    const std::string& name_of(std::uint16_t index) const { return index == 0 ? file : included[index - 1u]; }
    BrushId brush_of(SideId side) const; // O(log brushes)
    SourceLocation location(BrushId brush) const;
    SourceLocation location(SideId side) const;
    SourceLocation location(EntityId entity) const;
    SourceLocation location(const WorldPatch& patch) const;
};

// Repeats of the material's texture at a point, v down.
inline Vec2 texture_uv(const DocTexture& t, const Material& m, Vec3 point) {
    return {(dot(point, t.u_axis) / t.u_scale + t.u_shift) / std::max(1, m.width), (dot(point, t.v_axis) / t.v_scale + t.v_shift) / std::max(1, m.height)};
}

struct WorldOptions {
    double lightmap_scale = 16; // where neither side, entity nor worldspawn says (world units per luxel)
    template <class A> void fields(A& a) { a(lightmap_scale); }
};
Result<World> build_world(const Document& document, MaterialDatabase& materials, const WorldOptions& options,
                          Context& context);
void validate(const World& world);
void check_invariants(const World& world, Checker& checker); // the same, for all who want to know more than the first that fails

} // namespace kiln

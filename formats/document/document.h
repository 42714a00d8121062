// What a map file says, before anyone interprets it: entities, brushes and sides in file order with their
// places, every key in order with duplicates kept. Both readers (vmf, quake_map) give this one structure.
//
// Space    world, map units, right-handed, +z up; plane points as the file gives them
#pragma once
#include "formats/document/decimal.h"
#include "libs/core/result.h"
#include "libs/math/vec.h"
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace kiln {

enum class MapFormat : std::uint8_t { vmf, quake_standard, quake_valve220, quake_mixed };

struct DocKey {
    std::string key, value; // bytes as in the file (any encoding); no escapes interpreted
    int line = 0;
    bool output = false; // VMF: of a `connections` block
    template <class A> void fields(A& a) { a(key, value, line, output); }
};

// Texture projection of a side, all formats brought to one form: texel = dot(p, axis) / scale + shift,
// in texels of the material (u right, v down).
struct DocTexture {
    Vec3 u_axis{1, 0, 0}, v_axis{0, -1, 0};
    double u_shift = 0, v_shift = 0, u_scale = 1, v_scale = 1;
    // brushDef, brushDef3: the formula gives repeats of the texture, not texels; the world stage, which knows the size
    // of materials, brings it to texels.
    bool in_repeats = false;
    template <class A> void fields(A& a) { a(u_axis, v_axis, u_shift, v_shift, u_scale, v_scale, in_repeats); }
};

// VMF `dispinfo`: (2^power + 1)^2 vertices, row by row from the corner of the face nearest to `start`; in a row towards
// the next corner. Arrays are empty where the file has none, else complete. Vertex v lies at
//   base(v) + normals[v] * distances[v] + offsets[v] + elevation * (normal of the base face)
struct DocDisplacement {
    int line = 0;
    int power = 0;        // 2..4; 0: unreadable, the reader has told
    Vec3 start{};         // map units
    double elevation = 0; // map units
    std::uint32_t flags = 0; // of the file: 2 no physics, 4 no hull, 8 no ray collision
    std::vector<Vec3> normals, offsets, offset_normals;
    std::vector<double> distances, alphas;       // map units; 0..255
    std::vector<std::uint16_t> triangle_tags;    // 2 * 4^power
    std::vector<std::array<double, 4>> multiblend, alphablend;
    std::vector<std::array<Vec3, 4>> multiblend_colors;
    std::vector<std::int64_t> allowed_vertices;  // ten words of 32 bits
    template <class A> void fields(A& a) {
        a(line, power, start, elevation, flags, normals, offsets, offset_normals, distances, alphas, triangle_tags, multiblend,
          alphablend, multiblend_colors, allowed_vertices);
    }
};

// Quake 3 patchDef2/patchDef3: a grid of control points, odd both ways; biquadratic Bezier pieces share borders.
struct DocPatch {
    int line = 0;
    int id = -1; // ordinal among brushes and patches of the entity
    std::string material;
    std::uint32_t columns = 0, rows = 0;  // control points; columns is the first number of the file
    std::vector<Vec3> points;             // map units; column by column, as the file has them: [column * rows + row]
    std::vector<Vec2> uv;                 // repeats of the texture
    std::int64_t contents = 0, surface_flags = 0, value = 0;
    std::array<std::uint32_t, 2> subdivisions{}; // patchDef3: fixed; 0: none stated
    template <class A> void fields(A& a) {
        a(line, id, material, columns, rows, points, uv, contents, surface_flags, value, subdivisions);
    }
};

struct DocSide {
    int line = 0;
    int id = -1;                                    // VMF side id; else ordinal in the brush
    std::array<std::array<Decimal, 3>, 3> points{}; // clockwise seen from outside, as both families write them
    std::string material;                           // as spelled
    DocTexture texture;
    double lightmap_scale = 0; // world units per luxel; 0: not given
    std::uint32_t smoothing_groups = 0;
    std::int64_t contents = 0, surface_flags = 0, value = 0; // Quake 2/3 rows or VMF `contents`/`flags`
    bool has_content_flags = false;
    std::int32_t displacement = -1; // index into Document::displacements; -1: none
    std::vector<Vec3> vertices;     // VMF `vertices_plus`: the face as the editor saw it, rounded; empty: not given
    std::vector<DocKey> extra; // keys of a VMF side that have no field here
    template <class A> void fields(A& a) {
        a(line, id, points, material, texture, lightmap_scale, smoothing_groups, contents, surface_flags, value,
          has_content_flags, displacement, vertices, extra);
    }
};

struct DocBrush {
    int line = 0;
    int id = -1; // VMF solid id; else ordinal in the entity
    std::uint16_t file = 0; // index for Document::name_of
    std::vector<DocSide> sides;
    template <class A> void fields(A& a) { a(line, id, file, sides); }
};

struct DocEntity {
    int line = 0;
    int id = -1;              // VMF entity id; else ordinal in the file (worldspawn 0)
    std::vector<DocKey> keys; // in order, duplicates kept; VMF connections appended as output keys
    std::uint16_t file = 0; // index for Document::name_of
    std::vector<DocBrush> brushes;
    std::vector<DocPatch> patches;
    std::uint32_t skipped_primitives = 0; // met but not read (each kind has a diagnostic)
    template <class A> void fields(A& a) { a(line, id, keys, file, brushes, patches, skipped_primitives); }

    // Value of the first key of that name (ASCII case-insensitive), or nullptr.
    const DocKey* find(std::string_view key) const;
    std::string_view get(std::string_view key, std::string_view otherwise = {}) const;
    double number(std::string_view key, double otherwise) const; // otherwise: absent or not a number
    // "x y z"; otherwise where absent or malformed.
    Vec3 vector(std::string_view key, Vec3 otherwise) const;
};

// VMF `cordon`: a box outside of which an editor does not compile.
struct DocCordon {
    int line = 0;
    std::string name;
    bool active = false;
    Box3 box; // map units
    template <class A> void fields(A& a) { a(line, name, active, box); }
};

struct Document {
    std::string file; // the name diagnostics show
    std::vector<std::string> included; // other files that entities and brushes came from: instances, prefabs
    MapFormat format = MapFormat::vmf;
    std::vector<DocEntity> entities; // 0: worldspawn (VMF `world`); may be empty
    std::vector<DocDisplacement> displacements;
    std::vector<DocCordon> cordons;
    template <class A> void fields(A& a) { a(file, included, format, entities, displacements, cordons); }

    const std::string& name_of(std::uint16_t index) const { return index == 0 ? file : included[index - 1u]; }
};

// The largest coordinate that is read: beyond it a brush is left out with an error. It is 8 times the world of
// the original compilers, and leaves integer plane arithmetic its head room.
constexpr double kLargestCoordinate = 131072; // map units

// Finite number with white space around it allowed; nothing for anything else. Values of keys go through these.
std::optional<double> parse_number(std::string_view text);
// White-space separated numbers up to the first word that is none; `complete` tells whether that was the end.
std::vector<double> parse_numbers(std::string_view text, bool* complete = nullptr);

// The lookups of DocEntity on a bare list of keys.
const DocKey* find_key(const std::vector<DocKey>& keys, std::string_view key);
double key_number(const std::vector<DocKey>& keys, std::string_view key, double otherwise);
Vec3 key_vector(const std::vector<DocKey>& keys, std::string_view key, Vec3 otherwise);

bool equal_ignoring_case(std::string_view a, std::string_view b); // ASCII only
std::string lower_case(std::string_view text);                    // ASCII only

} // namespace kiln

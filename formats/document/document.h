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
    template <class A> void fields(A& a) { a(key, value, line); }
};

// Texture projection of a side, all formats brought to one form: texel = dot(p, axis) / scale + shift,
// in texels of the material (u right, v down).
struct DocTexture {
    Vec3 u_axis{1, 0, 0}, v_axis{0, -1, 0};
    double u_shift = 0, v_shift = 0, u_scale = 1, v_scale = 1;
    template <class A> void fields(A& a) { a(u_axis, v_axis, u_shift, v_shift, u_scale, v_scale); }
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
    bool displacement = false; // VMF dispinfo present (not interpreted yet)
    std::vector<DocKey> extra; // keys of a VMF side that have no field here
    template <class A> void fields(A& a) {
        a(line, id, points, material, texture, lightmap_scale, smoothing_groups, contents, surface_flags, value,
          has_content_flags, displacement, extra);
    }
};

struct DocBrush {
    int line = 0;
    int id = -1; // VMF solid id; else ordinal in the entity
    std::vector<DocSide> sides;
    template <class A> void fields(A& a) { a(line, id, sides); }
};

struct DocEntity {
    int line = 0;
    int id = -1;              // VMF entity id; else ordinal in the file (worldspawn 0)
    std::vector<DocKey> keys; // in order, duplicates kept; VMF connections appended as output keys
    std::vector<DocBrush> brushes;
    std::uint32_t skipped_patches = 0; // patchDef2/brushDef primitives met but not read (each has a diagnostic)
    template <class A> void fields(A& a) { a(line, id, keys, brushes, skipped_patches); }

    // Value of the first key of that name (ASCII case-insensitive), or nullptr.
    const DocKey* find(std::string_view key) const;
    std::string_view get(std::string_view key, std::string_view otherwise = {}) const;
    double number(std::string_view key, double otherwise) const; // otherwise: absent or not a number
    // "x y z"; otherwise where absent or malformed.
    Vec3 vector(std::string_view key, Vec3 otherwise) const;
};

struct Document {
    std::string file; // the name diagnostics show
    MapFormat format = MapFormat::vmf;
    std::vector<DocEntity> entities; // 0: worldspawn (VMF `world`); may be empty
    template <class A> void fields(A& a) { a(file, format, entities); }
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

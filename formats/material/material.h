// Materials: what a texture name means. A database of JSON files (exact names and globs, later files and
// later rules win, exact beats glob), over built-in knowledge of Source, Quake and Half-Life tool names.
// What a file states wins over what a name implies (a SKY4 with `emission` and no `sky` flag is an
// ordinary emitter). Unknown names get defaults and one warning each. Format: FORMAT.md.
#pragma once
#include "libs/core/archive.h"
#include "libs/core/context.h"
#include "libs/core/result.h"
#include "libs/math/vec.h"
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace kiln {

// What a brush side of this material does; several may be set.
enum MaterialFlag : std::uint32_t {
    kSky = 1u << 0,     // light of sun and sky enters; not drawn, not lit
    kNoDraw = 1u << 1,  // seals and blocks, no face
    kSkip = 1u << 2,    // no face, never a splitter
    kHint = 1u << 3,    // splitter for visibility, no contents
    kClip = 1u << 4,    // player/NPC clip: collision only
    kTrigger = 1u << 5, // no face, no contents
    kOrigin = 1u << 6,  // origin brush of an entity
    kAreaPortal = 1u << 7,
    kWater = 1u << 8,         // liquid contents (water, slime, lava, teleport)
    kTranslucent = 1u << 9,   // window: drawn, does not hide what is behind
    kDetail = 1u << 10,       // brush becomes detail
    kLightBlocker = 1u << 11, // blocks light, not drawn
    kInvisible = 1u << 12,    // solid for players, not drawn, lets light through
    kNoLight = 1u << 13,      // drawn without lightmap (liquids of Quake, unlit shaders)
    kNonSolid = 1u << 14,     // drawn, no contents
    kTwoSided = 1u << 15,
    kLava = 1u << 16, // with kWater: which liquid
    kSlime = 1u << 17,
    kAlphaTested = 1u << 18, // grate: drawn with holes, seen through, seals nothing
    // With kClip or kInvisible: what exactly is stopped. None of them: players and NPCs.
    kStopsPlayers = 1u << 19,
    kStopsNpcs = 1u << 20,
    kStopsBullets = 1u << 21,
    kStopsSight = 1u << 22, // of NPCs
};

// How much of a texture is there, texel by texel, row by row from the top left.
struct OpacityMap {
    int width = 0, height = 0;
    Bytes opacity; // 255: all of it
    Bytes tint;    // linear RGB of what thin parts let through; empty: as the material says
    bool empty() const { return opacity.empty(); }
    template <class A> void fields(A& a) { a(width, height, opacity, tint); }
    bool operator==(const OpacityMap&) const = default;
};
constexpr int kMostOpacitySize = 1024; // texels along a side
// As text in material files, and back; nothing: it is no such text.
std::string base64(const Bytes& bytes);
std::optional<Bytes> bytes_of_base64(std::string_view text);

struct Material {
    std::string name;                   // as spelled by the map
    Rgb reflectance{0.5f, 0.5f, 0.5f};  // diffuse, linear, 0..0.99
    Rgb emission{0, 0, 0};              // emitted radiance, linear, one-sided Lambertian
    float alpha = 1;                    // opacity, 0..1
    float env_map = 0;                  // share of a cubemap's specular reflection, 0: none
    float roughness = 0.3f;             // of that reflection
    std::uint32_t flags = 0;            // MaterialFlag
    std::string normal_map, albedo_map; // file names relative to the material file, or empty
    double normal_cone_deg = 30;        // 95th percentile tilt of the normal map
    int width = 64, height = 64;        // texels, for texture coordinates
    bool known = false;                 // false: defaults were used
    bool alpha_stated = false;          // a rule, or the map, says `alpha`
    OpacityMap opacity_map;             // of what is translucent or alpha-tested, where one is known
    float alpha_test = 0.5f;            // from this opacity on a texel of an alpha-tested material is there
    std::optional<Rgb> tint;            // of the light that comes through; none: the colour of the texture
    template <class A> void fields(A& a) {
        a(name, reflectance, emission, alpha, env_map, roughness, flags, normal_map, albedo_map, normal_cone_deg,
          width, height, known, alpha_stated, opacity_map, alpha_test, tint);
    }
};

class MaterialDatabase {
public:
    MaterialDatabase();
    ~MaterialDatabase();
    MaterialDatabase(MaterialDatabase&&) noexcept;
    MaterialDatabase& operator=(MaterialDatabase&&) noexcept;
    // Adds the rules of a JSON text; `file` names it in diagnostics and is the base of map file names.
    Result<bool> add_json(std::string_view text, const std::string& file, Context& context);
    // Adds `name r g b [scale]` lines of a lights.rad: emission of materials by name.
    void add_lights_rad(std::string_view text, const std::string& file, Context& context);
    // Directory of the file that states the normal and albedo maps of this name ("" : none does, or the working
    // directory). Kept out of Material so that a level does not depend on where its files lie.
    std::string map_directory(std::string_view name) const;
    // Never fails; reports one warning for each name met for the first time that nothing knows.
    Material find(std::string_view name, Context& context, const SourceLocation& where = {});

    // The same database again gives the same bytes: for the key of the stage cache.
    Bytes content() const;

private:
    struct Rules;
    std::unique_ptr<Rules> rules_;
};

} // namespace kiln

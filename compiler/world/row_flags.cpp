#include "compiler/world/row_flags.h"
#include <numbers>

namespace kiln {
namespace {

// Public constants of the Quake 2 map format; projectile clip, no water jump and alpha test are of its re-release.
enum ContentsBit : std::int64_t {
    kC_solid = 0x1,
    kC_window = 0x2,
    kC_aux = 0x4,
    kC_lava = 0x8,
    kC_slime = 0x10,
    kC_water = 0x20,
    kC_mist = 0x40,
    kC_no_waterjump = 0x2000,
    kC_projectile_clip = 0x4000,
    kC_area_portal = 0x8000,
    kC_player_clip = 0x10000,
    kC_monster_clip = 0x20000,
    kC_currents = 0xFC0000, // 0, 90, 180, 270 degrees, up, down
    kC_origin = 0x1000000,
    kC_monster = 0x2000000,
    kC_dead_monster = 0x4000000,
    kC_detail = 0x8000000,
    kC_translucent = 0x10000000,
    kC_ladder = 0x20000000,
};
constexpr std::int64_t kC_liquid = kC_lava | kC_slime | kC_water;
constexpr std::int64_t kC_visible = kC_solid | kC_window | kC_aux | kC_liquid | kC_mist;
constexpr std::int64_t kC_known = kC_visible | kC_no_waterjump | kC_projectile_clip | kC_area_portal | kC_player_clip | kC_monster_clip |
                                  kC_currents | kC_origin | kC_monster | kC_dead_monster | kC_detail | kC_translucent | kC_ladder;
enum SurfaceBit : std::int64_t {
    kS_light = 0x1,
    kS_slick = 0x2,
    kS_sky = 0x4,
    kS_warp = 0x8,
    kS_trans33 = 0x10,
    kS_trans66 = 0x20,
    kS_flowing = 0x40,
    kS_nodraw = 0x80,
    kS_hint = 0x100,
    kS_skip = 0x200,
    kS_alpha_test = 0x2000000,
    kS_n64 = 0xF0000000, // scrolling and mirrored textures of the re-release
};
constexpr std::int64_t kS_known = kS_light | kS_slick | kS_sky | kS_warp | kS_trans33 | kS_trans66 | kS_flowing | kS_nodraw | kS_hint |
                                  kS_skip | kS_alpha_test | kS_n64;

} // namespace

bool means_quake3(const Document& document) {
    if (document.format == MapFormat::vmf) return false;
    for (const DocEntity& e : document.entities) {
        if (e.skipped_primitives > 0 || !e.patches.empty()) return true;
        for (const DocBrush& b : e.brushes)
            for (const DocSide& s : b.sides)
                if (equal_ignoring_case(std::string_view(s.material).substr(0, 7), "common/") ||
                    equal_ignoring_case(std::string_view(s.material).substr(0, 9), "textures/"))
                    return true;
    }
    return false;
}

Material with_row_flags(Material m, const DocSide& side, MapFormat format, bool quake3) {
    if (!side.has_content_flags) return m;
    const std::int64_t c = side.contents, s = side.surface_flags;
    if (c & kC_detail) m.flags |= kDetail;
    // A VMF states contents by materials; of its own keys only the detail bit is the same everywhere.
    if (quake3 || format == MapFormat::vmf) return m;

    constexpr std::uint32_t kLiquid = kWater | kLava | kSlime;
    if (c & kC_liquid) {
        m.flags &= ~kLiquid;
        m.flags |= kWater | (c & kC_lava ? kLava : c & kC_slime ? kSlime : 0u);
    } else if (c & kC_solid) {
        m.flags &= ~kLiquid;
    }
    if (!(c & kC_solid) && (c & kC_mist)) m.flags |= kNonSolid | kTranslucent;
    if (!(c & kC_solid) && (c & kC_aux)) m.flags |= kNonSolid; // drawn, and nothing else
    if (c & kC_area_portal) m.flags |= kAreaPortal;
    if (!(c & kC_visible)) { // a wall that is clip besides is a wall
        if (c & kC_player_clip) m.flags |= kClip | kStopsPlayers;
        if (c & kC_monster_clip) m.flags |= kClip | kStopsNpcs;
        if (c & kC_projectile_clip) m.flags |= kClip | kStopsBullets;
    }
    if (c & kC_origin) m.flags |= kOrigin;
    if (s & kS_sky) m.flags |= kSky;
    if (s & kS_nodraw) m.flags |= kNoDraw;
    if (s & kS_hint) m.flags |= kHint;
    if (s & kS_skip) m.flags |= c & kC_solid ? kNoDraw : kSkip; // solid and skip: a wall that is not drawn
    if (((c & kC_window) && !(c & kC_solid)) || (s & (kS_trans33 | kS_trans66))) m.flags |= kTranslucent;
    if (s & kS_alpha_test) m.flags |= kAlphaTested;
    if (s & kS_trans33) m.alpha = 1.0f / 3;
    if (s & kS_trans66) m.alpha = 2.0f / 3;
    m.alpha_stated |= (s & (kS_trans33 | kS_trans66)) != 0;
    if (s & kS_warp) m.flags |= kNoLight;
    // `value` of a light surface is its radiosity in units of 255; radiance of a Lambertian emitter is that / pi.
    if ((s & kS_light) && side.value > 0 && m.emission == Rgb{}) {
        const float radiance = static_cast<float>(static_cast<double>(side.value) / 255 / std::numbers::pi);
        m.emission = {radiance, radiance, radiance};
    }
    return m;
}

std::uint32_t phong_group_of_row(const DocSide& side) {
    return side.surface_flags & kS_light || side.value <= 0 || side.value > INT32_MAX ? 0 : static_cast<std::uint32_t>(side.value);
}

UnknownBits unknown_row_bits(const DocSide& side, MapFormat format, bool quake3) {
    if (!side.has_content_flags || quake3 || format == MapFormat::vmf) return {};
    return {side.contents & ~kC_known, side.surface_flags & 0xFFFFFFFF & ~kS_known};
}

} // namespace kiln

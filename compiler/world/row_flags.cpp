#include "compiler/world/row_flags.h"
#include <numbers>

namespace kiln {
namespace {

// Public constants of the Quake 2 map format.
enum ContentsBit : std::int64_t {
    kC_solid = 0x1,
    kC_window = 0x2,
    kC_lava = 0x8,
    kC_slime = 0x10,
    kC_water = 0x20,
    kC_mist = 0x40,
    kC_area_portal = 0x8000,
    kC_player_clip = 0x10000,
    kC_monster_clip = 0x20000,
    kC_origin = 0x1000000,
    kC_detail = 0x8000000,
};
enum SurfaceBit : std::int64_t {
    kS_light = 0x1,
    kS_sky = 0x4,
    kS_warp = 0x8,
    kS_trans33 = 0x10,
    kS_trans66 = 0x20,
    kS_nodraw = 0x80,
    kS_hint = 0x100,
    kS_skip = 0x200,
};

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
    if (c & (kC_lava | kC_slime | kC_water)) {
        m.flags &= ~kLiquid;
        m.flags |= kWater | (c & kC_lava ? kLava : c & kC_slime ? kSlime : 0u);
    } else if (c & kC_solid) {
        m.flags &= ~kLiquid;
    }
    if (c & kC_mist) m.flags |= kNonSolid | kTranslucent;
    if (c & kC_area_portal) m.flags |= kAreaPortal;
    if (c & (kC_player_clip | kC_monster_clip)) m.flags |= kClip;
    if (c & kC_origin) m.flags |= kOrigin;
    if (s & kS_sky) m.flags |= kSky;
    if (s & kS_nodraw) m.flags |= kNoDraw;
    if (s & kS_hint) m.flags |= kHint;
    if (s & kS_skip) m.flags |= c & kC_solid ? kNoDraw : kSkip; // solid and skip: a wall that is not drawn
    if ((c & kC_window) || (s & (kS_trans33 | kS_trans66))) m.flags |= kTranslucent;
    if (s & kS_trans33) m.alpha = 1.0f / 3;
    if (s & kS_trans66) m.alpha = 2.0f / 3;
    if (s & kS_warp) m.flags |= kNoLight;
    // `value` of a light surface is its radiosity in units of 255; radiance of a Lambertian emitter is that / pi.
    if ((s & kS_light) && side.value > 0 && m.emission == Rgb{}) {
        const float radiance = static_cast<float>(static_cast<double>(side.value) / 255 / std::numbers::pi);
        m.emission = {radiance, radiance, radiance};
    }
    return m;
}

} // namespace kiln

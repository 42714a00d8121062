#include "compiler/world/contents.h"
#include <array>

namespace kiln {
namespace {

enum class SideKind : std::uint8_t {
    ordinary,
    sky,
    nodraw,
    translucent,
    non_solid,
    liquid,
    area_portal,
    hint,
    trigger,
    clip,
    invisible,
    blocker,
    skip,
    count
};

// Several flags on one side: the first of these rows that holds.
SideKind kind_of_side(std::uint32_t f) {
    constexpr std::pair<std::uint32_t, SideKind> kRows[] = {
        {kAreaPortal, SideKind::area_portal},
        {kHint, SideKind::hint},
        {kSky, SideKind::sky},
        {kWater, SideKind::liquid},
        {kTrigger, SideKind::trigger},
        {kClip, SideKind::clip},
        {kInvisible, SideKind::invisible},
        {kLightBlocker, SideKind::blocker},
        {kSkip, SideKind::skip},
        {kNoDraw, SideKind::nodraw},
        {kNonSolid, SideKind::non_solid},
        {kTranslucent, SideKind::translucent},
    };
    for (const auto& [flag, kind] : kRows)
        if (f & flag) return kind;
    return SideKind::ordinary;
}

} // namespace

BrushKind kind_of_brush(std::span<const std::uint32_t> flags) {
    std::array<int, static_cast<std::size_t>(SideKind::count)> n{};
    std::uint32_t any = 0;
    for (const std::uint32_t f : flags) {
        ++n[static_cast<std::size_t>(kind_of_side(f))];
        any |= f;
    }
    const auto has = [&](SideKind k) { return n[static_cast<std::size_t>(k)] > 0; };

    BrushKind kind;
    const auto hidden = [&](Contents c) {
        kind.contents = c;
        kind.draws = kind.collides = kind.blocks_light = false;
        return kind;
    };
    if (any & kOrigin) {
        kind.origin = true;
        return hidden(Contents::trigger);
    }
    const bool walls = has(SideKind::ordinary) || has(SideKind::sky);
    if (has(SideKind::hint)) return hidden(Contents::hint);
    if (has(SideKind::area_portal) && !walls) return hidden(Contents::area_portal);
    if (has(SideKind::liquid) && !walls) {
        kind.contents = any & kLava ? Contents::lava : any & kSlime ? Contents::slime : Contents::water;
        kind.collides = false;
        kind.blocks_light = false;
        return kind;
    }
    kind.mixed = has(SideKind::liquid);
    // One translucent side is enough, as in the compilers the maps were made for: such a brush seals nothing
    // and hides nothing behind it.
    if (has(SideKind::translucent) && !has(SideKind::sky)) {
        kind.contents = Contents::window;
        kind.blocks_light = has(SideKind::ordinary);
        return kind;
    }
    if (has(SideKind::non_solid) && !walls) {
        kind.contents = Contents::window;
        kind.collides = false;
        return kind;
    }
    if (walls || has(SideKind::nodraw) || has(SideKind::liquid)) {
        kind.contents = any & kDetail ? Contents::detail : Contents::solid;
        return kind;
    }
    // Nothing but tools is left.
    if (has(SideKind::blocker)) {
        hidden(Contents::clip);
        kind.blocks_light = true;
        return kind;
    }
    if (has(SideKind::clip) || has(SideKind::invisible)) {
        hidden(Contents::clip);
        kind.collides = true;
        return kind;
    }
    return hidden(Contents::trigger);
}

} // namespace kiln

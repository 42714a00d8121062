#include "compiler/world/contents.h"
#include <array>

namespace kiln {
namespace {

enum class SideKind : std::uint8_t {
    ordinary,
    sky,
    nodraw,
    translucent,
    alpha_tested,
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
        {kAlphaTested, SideKind::alpha_tested},
    };
    for (const auto& [flag, kind] : kRows)
        if (f & flag) return kind;
    return SideKind::ordinary;
}

} // namespace

std::uint8_t blocks_of(Contents contents, MapFormat format) {
    switch (contents) {
    case Contents::solid:
    case Contents::detail: return kBlocksAll;
    case Contents::window: return kBlocksPlayers | kBlocksNpcs | kBlocksBullets;
    // Bullets pass the grates of Source; the older games know no wall that they pass.
    case Contents::grate: return kBlocksPlayers | kBlocksNpcs | (format == MapFormat::vmf ? 0 : kBlocksBullets);
    default: return 0;
    }
}

BrushKind kind_of_brush(std::span<const std::uint32_t> flags, MapFormat format) {
    std::array<int, static_cast<std::size_t>(SideKind::count)> n{};
    std::uint32_t any = 0;
    std::uint8_t stops = 0; // clips of several kinds on one brush: all of them
    for (const std::uint32_t f : flags) {
        const SideKind kind = kind_of_side(f);
        ++n[static_cast<std::size_t>(kind)];
        any |= f;
        if (kind != SideKind::clip && kind != SideKind::invisible) continue;
        std::uint8_t side = 0;
        if (f & kStopsPlayers) side |= kBlocksPlayers;
        if (f & kStopsNpcs) side |= kBlocksNpcs;
        if (f & kStopsBullets) side |= kBlocksBullets;
        if (f & kStopsSight) side |= kBlocksSight;
        stops |= side ? side : kBlocksPlayers | kBlocksNpcs;
    }
    const auto has = [&](SideKind k) { return n[static_cast<std::size_t>(k)] > 0; };

    BrushKind kind;
    const auto hidden = [&](Contents c) {
        kind.contents = c;
        kind.draws = kind.blocks_light = false;
        kind.blocks = 0;
        return kind;
    };
    const auto drawn = [&](Contents c) {
        kind.contents = c;
        kind.blocks = blocks_of(c, format);
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
        kind.blocks_light = false;
        return drawn(any & kLava ? Contents::lava : any & kSlime ? Contents::slime : Contents::water);
    }
    kind.mixed = has(SideKind::liquid);
    // One translucent side is enough, as in the compilers the maps were made for: such a brush seals nothing
    // and hides nothing behind it.
    if ((has(SideKind::translucent) || has(SideKind::alpha_tested)) && !has(SideKind::sky)) {
        kind.blocks_light = has(SideKind::ordinary);
        return drawn(has(SideKind::translucent) ? Contents::window : Contents::grate);
    }
    if (has(SideKind::non_solid) && !walls) {
        drawn(Contents::window);
        kind.blocks = 0;
        return kind;
    }
    if (walls || has(SideKind::nodraw) || has(SideKind::liquid)) return drawn(any & kDetail ? Contents::detail : Contents::solid);
    // Nothing but tools is left.
    if (has(SideKind::clip) || has(SideKind::invisible)) {
        hidden(Contents::clip);
        kind.blocks = stops;
        kind.blocks_light = has(SideKind::blocker);
        return kind;
    }
    if (has(SideKind::blocker)) {
        hidden(Contents::clip);
        kind.blocks = kBlocksSight; // opaque to NPCs as to light
        kind.blocks_light = true;
        return kind;
    }
    return hidden(Contents::trigger);
}

} // namespace kiln

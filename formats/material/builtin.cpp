// What names imply in Source, Quake, Quake 2, Quake 3 and Half-Life, gathered from the public documentation of
// their editors. Names are compared in lower case.
#include "formats/document/document.h"
#include "formats/material/rules.h"
#include <algorithm>
#include <utility>

namespace kiln {
namespace {

struct Named {
    std::string_view name;
    std::uint32_t flags;
};

// Behind "tools/tools"; the longest prefix that fits holds ("nodraw_portal" is "nodraw").
constexpr Named kSourceTools[] = {
    {"nodraw", kNoDraw},
    {"skybox", kSky},
    {"skybox2d", kSky},
    {"skyfog", kNoDraw},
    {"skip", kSkip},
    {"hint", kHint},
    {"clip", kClip},
    {"playerclip", kClip | kStopsPlayers},
    {"npcclip", kClip | kStopsNpcs},
    {"controlclip", kTrigger}, // of vehicles, grenades and drones: volumes for the game, which stop nobody else
    {"grenadeclip", kTrigger},
    {"droneclip", kTrigger},
    {"trigger", kTrigger},
    {"origin", kOrigin},
    {"areaportal", kAreaPortal},
    {"blocklight", kLightBlocker},
    {"block_light", kLightBlocker},
    {"invisible", kInvisible}, // and invisibleladder, invisiblemetal: bullets pass
    {"invisdisplacement", kInvisible},
    {"blockbullets", kInvisible | kStopsPlayers | kStopsNpcs | kStopsBullets}, // despite its name: all but sight
    {"blockbomb", kTrigger},
    {"block_los", kClip | kStopsSight},
    {"blocklos", kClip | kStopsSight},
    {"blocksight", kClip | kStopsSight},
    {"black", kNoLight},
    {"white", kNoLight},
    {"fog", kTrigger},
    {"occluder", kTrigger},
    {"dotted", kNoDraw},
    {"solidblock", kNoDraw},
    {"cubemap", kTrigger},
};

// The whole name, or what stands behind the last slash of one ("e1u1/clip", "common/clip").
constexpr Named kQuakeTools[] = {
    {"clip", kClip},
    {"hint", kHint},
    {"hintskip", kSkip},
    {"skip", kNoDraw}, // in Quake a solid brush that is not drawn
    {"trigger", kTrigger},
    {"aaatrigger", kTrigger},
    {"origin", kOrigin},
    {"null", kNoDraw},
    {"nodraw", kNoDraw},
    {"caulk", kNoDraw},
    {"bevel", kSkip},
    {"clipbevel", kClip},
    {"clipbevelbrush", kClip},
    {"cliphull1", kClip},
    {"cliphull2", kClip},
    {"cliphull3", kClip},
    {"noclip", kInvisible},
    {"solidhint", kNoDraw},
    {"splitface", kSkip},
    {"boundingbox", kTrigger},
    {"contentempty", kTrigger},
    {"contentwater", kWater | kNoDraw},
    {"contentsky", kSky},
    {"areaportal", kAreaPortal},
    {"weapclip", kClip | kStopsPlayers | kStopsNpcs | kStopsBullets}, // Quake 3: a clip that shots hit too
    {"playerclip", kClip | kStopsPlayers},
    {"full_clip", kClip | kStopsPlayers | kStopsNpcs | kStopsBullets},
    {"fullclip", kClip | kStopsPlayers | kStopsNpcs | kStopsBullets},
    {"botclip", kClip | kStopsNpcs},
    {"monsterclip", kClip | kStopsNpcs},
    {"missileclip", kClip | kStopsBullets},
    {"missilclip", kClip | kStopsBullets},
    {"metalclip", kClip | kStopsPlayers},
    {"clip_mon", kClip | kStopsNpcs},
    {"region", kTrigger},
    {"antiregion", kTrigger},
    {"clusterportal", kTrigger},
    {"donotenter", kTrigger},
    {"antiportal", kTrigger},
    {"lightgrid", kTrigger},
    {"nodrawnonsolid", kTrigger},
    {"invisible", kInvisible},
};

// Does `name` begin with `stem`, and does the stem end there (a digit, an underscore or the end follows)?
bool has_stem(std::string_view name, std::string_view stem) {
    if (!name.starts_with(stem)) return false;
    const char next = name.size() > stem.size() ? name[stem.size()] : '_';
    return next == '_' || (next >= '0' && next <= '9');
}

std::uint32_t liquid(std::string_view name) {
    const auto says = [&](std::string_view word) { return name.find(word) != std::string_view::npos; };
    return kWater | kNoLight | (says("lava") ? kLava : says("slime") ? kSlime : 0u);
}

std::optional<ImpliedMaterial> source_tool(std::string_view name) {
    const Named* best = nullptr;
    for (const Named& n : kSourceTools)
        if (name.starts_with(n.name) && (!best || n.name.size() > best->name.size())) best = &n;
    if (!best) return std::nullopt;
    ImpliedMaterial m{best->flags, std::nullopt};
    if (best->name == "black") m.reflectance = Rgb{0, 0, 0};
    if (best->name == "white") m.reflectance = Rgb{0.99f, 0.99f, 0.99f};
    return m;
}

} // namespace

std::optional<ImpliedMaterial> implied_by_name(std::string_view spelled) {
    std::string lower = lower_case(spelled);
    std::replace(lower.begin(), lower.end(), '\\', '/');
    std::string_view name = lower;
    if (name.starts_with("textures/")) name.remove_prefix(9);
    if (name.empty() || name == "__tb_empty") return ImpliedMaterial{};

    if (name.starts_with("tools/tools")) return source_tool(name.substr(11));
    if (name == "tools/climb" || name == "tools/climb_alpha") return ImpliedMaterial{kClip, std::nullopt};

    const std::size_t slash = name.rfind('/');
    const std::string_view base = slash == std::string_view::npos ? name : name.substr(slash + 1);
    if (name == "common/nodraw") return ImpliedMaterial{kTrigger, std::nullopt}; // Quake 3: neither seen nor solid
    if (name == "common/skip") return ImpliedMaterial{kSkip, std::nullopt};
    for (const Named& n : kQuakeTools)
        if (base == n.name) return ImpliedMaterial{n.flags, std::nullopt};

    // Liquids: `*` of Quake, `!` of Half-Life; `#` where `*` cannot stand in a file name.
    const char first = base.empty() ? '\0' : base[0];
    if (first == '*' || first == '!' || first == '#') {
        const bool skip = base.ends_with("skip"); // "*waterskip": the volume without its surface
        return ImpliedMaterial{liquid(base) | (skip ? std::uint32_t{kNoDraw} : 0u), std::nullopt};
    }
    if (slash == std::string_view::npos) {
        if (name.starts_with("sky")) return ImpliedMaterial{kSky, std::nullopt};
        if (first == '{') return ImpliedMaterial{kAlphaTested, std::nullopt};
        return std::nullopt;
    }

    // Names with a folder: Quake 2 and 3, Source.
    const std::string_view folder = name.substr(0, name.find('/'));
    const bool quake2 = folder.size() == 4 && folder[0] == 'e' && folder[2] == 'u'; // e1u1 ... e4u3
    if (folder == "skies" || (has_stem(base, "sky") && folder != "models"))
        return ImpliedMaterial{kSky, std::nullopt};
    if (folder == "liquids") return ImpliedMaterial{liquid(base), std::nullopt};
    if (quake2)
        for (const std::string_view stem : {"water", "lava", "slime", "brwater", "brlava", "brslime"})
            if (has_stem(base, stem)) return ImpliedMaterial{liquid(base), std::nullopt};
    // Source water materials; signs and stains named after water lie in other folders.
    if ((folder == "nature" || folder == "water") && has_stem(base, "water"))
        return ImpliedMaterial{kWater | kNoLight, std::nullopt};
    if (folder == "nature" && (has_stem(base, "slime") || has_stem(base, "toxicslime")))
        return ImpliedMaterial{kWater | kSlime | kNoLight, std::nullopt};
    if (first == '{') return ImpliedMaterial{kAlphaTested, std::nullopt};
    return std::nullopt;
}

} // namespace kiln

#include "tools/kiln/known_words.h"
#include "formats/document/document.h"
#include <algorithm>
#include <cstdlib>
#include <fmt/format.h>
#include <span>
#include <sstream>

namespace kiln {
namespace {

enum class Fate : std::uint8_t {
    becomes, // `text` in its place, before what it takes along
    ignored, // the build goes on without; `text` says why, where there is anything to say
    refused, // another result was asked for than there would be; `text` says what to do
};
using enum Fate;

struct Known {
    const char* word; // lower case: those tools do not tell case apart
    Fate fate;
    const char* text;
    int numbers = 0;   // up to so many numbers behind it belong to it ...
    bool name = false; // ... or the next word, whatever it is
};

constexpr const char* kProps = "models (.mdl) are not read: props keep their place in the level, get no light and cast no shadow";
constexpr const char* kExact = "nothing is lost or rounded, so there is nothing to switch off";
constexpr const char* kAdaptive = "sampling follows --error";
constexpr const char* kHdr = "light is always stored in high dynamic range";
constexpr const char* kWhole = "a level is one file and is always made whole; --cache DIR keeps the stages that did not change";
constexpr const char* kInspect = "see `kiln dump` and `kiln export`, which show every stage";
constexpr const char* kMaterials = "say it in a material file (--materials): formats/material/FORMAT.md";
constexpr const char* kFaces = "faces of one surface are merged into regions with charts of any size; nothing divides them";
constexpr const char* kTree = "the tree has no such choice: how planes are chosen depends on the map alone";
constexpr const char* kPatches = "patches are divided as --error asks";
constexpr const char* kNoEffect = "light is solved, not touched up afterwards; corners darken by themselves";

constexpr Known kKnown[] = {
    // All tools
    {"-game", becomes, "--game-dir", 0, true},
    {"-vproject", becomes, "--game-dir", 0, true},
    {"-gamedir", becomes, "--game-dir", 0, true},
    {"-basedir", becomes, "--game-dir", 0, true},
    {"-wadpath", becomes, "--game-dir", 0, true}, // where archives are looked for that the map names
    {"-threads", becomes, "--threads", 1},
    {"-noverbose", becomes, "--quiet"},
    {"-quiet", becomes, "--quiet"},
    {"-v", ignored, ""},
    {"-verbose", ignored, ""},
    {"-low", ignored, ""},
    {"-nopercent", ignored, ""},
    {"-nocolor", ignored, ""},
    {"-novconfig", ignored, ""},
    {"-allowdebug", ignored, ""},
    {"-steam", ignored, ""},
    {"-fullminidumps", ignored, ""},
    {"-stoponexit", ignored, ""},
    {"-nolog", ignored, ""},
    {"-mpi", ignored, "the build runs on one machine, on all its cores"},
    {"-insert_search_path", refused, "use --game-dir DIR or --textures DIR; instances are looked for in --instance-path DIR", 0, true},
    {"-onlyents", refused, kWhole},
    // vbsp, qbsp
    {"-leaktest", ignored, "a leak always ends the build (see --allow-leaks)"},
    {"-noleaktest", becomes, "--allow-leaks"},
    {"-leakdist", ignored, "points of a .pts are 4 units apart", 1},
    {"-luxelscale", ignored, "is not supported: use --luxel UNITS", 1},
    {"-minluxelscale", ignored, "is not supported: use --luxel UNITS", 1},
    {"-bumpall", becomes, "--directional all"},
    {"-micro", ignored, "no brush is dropped for being small (--micro-gap is about leaks)", 1},
    {"-microvolume", ignored, "no brush is dropped for being small (--micro-gap is about leaks)", 1},
    {"-epsilon", ignored, "no tolerance decides; see --plane-merge for planes that nearly coincide", 1},
    {"-notjunc", ignored, "T-junctions are always closed: each vertex goes into every edge that it lies on"},
    {"-tjunc", ignored, "T-junctions are always closed: each vertex goes into every edge that it lies on", 0, true},
    {"-allowdetailcracks", ignored, "T-junctions are always closed: each vertex goes into every edge that it lies on"},
    {"-noweld", ignored, kExact},
    {"-noshare", ignored, kExact},
    {"-noprune", ignored, kExact},
    {"-noopt", ignored, kExact},
    {"-snapaxial", ignored, "planes are exact; see --plane-merge for those that nearly coincide"},
    {"-nocsg", ignored, "parts of faces inside other brushes are always removed"},
    {"-chop", ignored, "parts of faces inside other brushes are always removed (qbsp), and patches are divided as --error asks (vrad)", 1},
    {"-nochop", ignored, "parts of faces inside other brushes are always removed"},
    {"-nomerge", ignored, kFaces},
    {"-nomergewater", ignored, kFaces},
    {"-nosubdiv", ignored, kFaces},
    {"-subdivide", ignored, kFaces, 1},
    {"-forcegoodtree", ignored, kTree},
    {"-maxnodesize", ignored, kTree, 1},
    {"-midsplitsurffraction", ignored, kTree, 1},
    {"-noclip", ignored, "there are no clip hulls: one set of brushes serves boxes of any size"},
    {"-verboseentities", ignored, "`kiln dump document` lists them"},
    {"-lightifmissing", ignored, "materials that are not found are lit"},
    {"-novirtualmesh", ignored, "displacements collide as they are drawn"},
    {"-tmpin", ignored, ""},
    {"-tmpout", ignored, ""},
    {"-xbox", ignored, ""},
    {"-dxlevel", ignored, "mindxlevel and maxdxlevel belong to graphics cards long gone: all entities are kept", 1},
    {"-keepstalezip", ignored, kWhole},
    {"-bsp2", ignored, "there is one level format: formats/level/FORMAT.md"},
    {"-2psb", ignored, "there is one level format: formats/level/FORMAT.md"},
    {"-hlbsp", refused, "there is one level format: formats/level/FORMAT.md"},
    {"-q2bsp", refused, "there is one level format: formats/level/FORMAT.md"},
    {"-nodetail", refused, "leave them out in the editor: what is hidden in a VMF does not compile"},
    {"-omitdetail", refused, "leave them out in the editor: what is hidden in a VMF does not compile"},
    {"-fulldetail", refused, "make them structural in the editor"},
    {"-nowater", refused, "leave it out in the editor: what is hidden in a VMF does not compile"},
    {"-transwater", ignored, "water is seen through always"},
    {"-notranswater", refused, "water is seen through always"},
    {"-nofill", refused, "use --allow-leaks for a world that leaks; of one that is sealed the outside is removed"},
    {"-outsidefill", ignored, ""},
    {"-block", refused, "use --cordon to build a part of a VMF", 2},
    {"-blocks", refused, "use --cordon to build a part of a VMF", 4},
    {"-add", refused, "write a manifest (.vmm) of both maps", 0, true},
    {"-embed", refused, "a level holds no files of others", 0, true},
    {"-onlyprops", refused, kWhole},
    {"-replacematerials", refused, kMaterials},
    {"-nodrawtriggers", refused, kMaterials},
    {"-forceskyvis", refused, "a room with a sky_camera is one cluster; divide it where that is too coarse"},
    {"-glview", refused, kInspect},
    {"-objexport", refused, kInspect},
    {"-dumpstaticprop", refused, kInspect},
    {"-dumpcollide", refused, kInspect},
    {"-debugleak", refused, kInspect},
    // vvis, vis
    {"-fast", becomes, "--draft --fast-vis"},
    {"-nosort", ignored, ""},
    {"-nostate", ignored, ""},
    {"-noautoupdate", ignored, ""},
    {"-level", ignored, "there is one way, and --fast-vis", 1},
    {"-radius_override", becomes, "--vis-radius", 1},
    {"-visdist", becomes, "--vis-radius", 1},
    {"-trace", refused, "use `kiln trace A B MAP`", 2},
    // vrad, light
    {"-final", becomes, "--final"},
    {"-smooth", becomes, "--smooth", 1},
    {"-lights", becomes, "--lights", 0, true},
    {"-world_units_per_luxel", becomes, "--luxel", 1},
    {"-bounce", ignored, "all bounces are always solved", 1},
    {"-hdr", ignored, kHdr},
    {"-ldr", ignored, kHdr},
    {"-both", ignored, kHdr},
    {"-extra", ignored, kAdaptive},
    {"-extra4", ignored, kAdaptive},
    {"-extrasky", ignored, kAdaptive, 1},
    {"-noextra", ignored, kAdaptive},
    {"-fastambient", ignored, "the error of ambient cubes is asked for with --ambient-error"},
    {"-emissivequality", ignored, kAdaptive, 0, true},
    {"-gate", ignored, "no light is cut off for being faint", 1},
    {"-visapprox", ignored, "every ray is traced", 0, true},
    {"-centersamples", ignored, "luxels are integrated over what they cover of the surface"},
    {"-luxeldensity", ignored, "is not supported: use --luxel UNITS", 1},
    {"-maxchop", ignored, kPatches, 1},
    {"-dispchop", ignored, kPatches, 1},
    {"-disppatchradius", ignored, kPatches, 1},
    {"-maxdispsamplesize", ignored, kPatches, 1},
    {"-largedispsampleradius", ignored, kPatches},
    {"-soft", ignored, kNoEffect, 1},
    {"-dirt", ignored, kNoEffect, 1},
    {"-lit", ignored, kHdr},
    {"-lux", ignored, "see --directional"},
    {"-textureshadows", ignored, "glass and grates always take their share of light, by alpha and opacity maps (formats/material/FORMAT.md)"},
    {"-staticproplighting", ignored, kProps},
    {"-staticproppolys", ignored, kProps},
    {"-staticpropnormals", ignored, kProps},
    {"-staticpropbounce", ignored, kProps, 1},
    {"-nossprops", ignored, kProps},
    {"-onlystaticprops", refused, kProps},
    {"-softsun", refused, "give the light_environment a SunSpreadAngle", 1},
    {"-bouncescale", refused, "light is solved as it is; make materials brighter: reflectance in a material file", 1},
    {"-gamma", refused, "light is stored linear; whoever draws it chooses", 1},
    {"-range", refused, "light is stored linear; whoever draws it chooses", 1},
    {"-nodetaillight", refused, kWhole},
    {"-onlydetail", refused, kWhole},
    {"-dlightmap", refused, "use `kiln image LEVEL` for its atlas pages"},
    {"-debugextra", refused, "use `kiln image LEVEL` for its atlas pages"},
    {"-rederrors", ignored, "the level stores the error of each luxel"},
    {"-dump", refused, kInspect},
    {"-dumpnormals", refused, kInspect},
    {"-dumptrace", refused, kInspect},
    {"-dumppropmaps", refused, kProps},
    {"-loghash", ignored, ""},
};

const Known* find(const std::string& word) {
    const auto it = std::ranges::find(kKnown, lower_case(word), [](const Known& k) { return std::string(k.word); });
    return it == std::end(kKnown) ? nullptr : it;
}
bool is_number(const char* word) {
    char* end = nullptr;
    std::strtod(word, &end);
    return end != word && *end == 0;
}
// What is said of a word, after its name.
std::string said(const Known& k) {
    const std::string text = k.text;
    return text.starts_with("is not ") ? k.word + (" " + text) : fmt::format("{}: {}", k.word, text);
}

} // namespace

Result<std::vector<std::string>> translate_known_words(int argc, char** argv, std::vector<std::string>& notes) {
    std::vector<std::string> words;
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        const Known* known = find(word);
        if (!known) {
            // The reader of options would take the rest of the word as what belongs to the letter, and write a file "nlyents".
            if (word.size() > 2 && word[0] == '-' && (word[1] == 'o' || word[1] == 'q' || word[1] == 'h')) {
                if (word[2] != '=') return fault(Exit::usage, "usage", fmt::format("no option {} (a file to write is given as `-o FILE` or `-o=FILE`)", word));
                words.push_back(word.substr(0, 2)), words.push_back(word.substr(3));
                continue;
            }
            words.push_back(word);
            continue;
        }
        if (known->fate == refused) return fault(Exit::usage, "usage", "there is no " + said(*known));
        if (known->fate == becomes) {
            std::istringstream ours(known->text);
            for (std::string w; ours >> w;) words.push_back(w);
        } else if (*known->text) {
            notes.push_back(said(*known));
        }
        const auto take = [&] {
            ++i;
            if (known->fate == becomes) words.emplace_back(argv[i]);
        };
        if (known->name && i + 1 < argc) take();
        for (int k = 0; k < known->numbers && i + 1 < argc && is_number(argv[i + 1]); ++k) take();
    }
    return words;
}

std::string explain_words() {
    std::string out;
    for (const Known& k : kKnown)
        out += fmt::format("{:<24} {}{}\n", k.word, k.fate == becomes ? "is " : k.fate == refused ? "(refused) " : "(ignored) ", k.text);
    return out;
}

} // namespace kiln

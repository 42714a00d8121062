// The whole way from map text to level file: compile.cpp shows it on one screen, a line a stage.
//
// Every stage is a pure function of its inputs and options, so its result is kept in the store under the hash of
// exactly those and the stage's version; a stage whose key is found is not run again. Diagnostics are kept with the
// result, so that a warm build reports what the cold one did.
#pragma once
#include "compiler/assemble/assemble.h"
#include "compiler/density/density.h"
#include "compiler/pack/pack.h"
#include "libs/store/store.h"
#include <functional>
#include <optional>
#include <string_view>

namespace kiln {

inline constexpr const char* kVersion = "kiln 0.1.0"; // in what is written; stored results carry their stage's version too

enum class Stage : std::uint8_t { read, world, csg, bsp, surfaces, visibility, light, ambient, probes, density, pack };
constexpr std::array<const char*, 11> kStageNames = {"read",       "world", "csg",     "bsp",    "surfaces",
                                                     "visibility", "light", "ambient", "probes", "density", "pack"};

constexpr std::optional<Stage> stage_named(std::string_view name) {
    for (std::size_t i = 0; i < kStageNames.size(); ++i)
        if (name == kStageNames[i]) return static_cast<Stage>(i);
    return std::nullopt;
}

struct CompileOptions {
    WorldOptions world;
    CsgOptions csg;
    BspOptions bsp;
    VisibilityOptions visibility;
    SurfacesOptions surfaces;
    LightOptions light;
    AmbientOptions ambient;
    ProbesOptions probes;
    int zstd_level = 9;
    bool strip = false;
    AssembleOptions assemble;
    DensityOptions density;
    double vis_merge = -1; // percent more leaves that a leaf may see where clusters are joined; below 0: none are
    template <class A> void fields(A& a) {
        a(world, csg, bsp, visibility, surfaces, light, ambient, probes, zstd_level, strip, assemble, density, vis_merge);
    }
};
std::string options_json(const CompileOptions& options); // stable text, recorded in the level

struct CompileInput {
    TextFile map;
    std::vector<TextFile> materials; // JSON, in order of precedence: later wins
    std::vector<TextFile> lights_rad;
    OpenMap open; // other maps that the map names; absent: none can be read
};

struct StageReport {
    std::string name;
    double wall_s = 0, cpu_s = 0, peak_rss_mb = 0;
    bool cached = false;
};

// Results as far as they were made: all up to and including the stage that was asked for.
struct Compiled {
    Document document;
    World world;
    Csg csg;
    Bsp bsp;
    std::optional<Leak> leak; // the first of
    std::vector<Leak> leaks;
    std::vector<VisPortal> portals;
    Visibility visibility;
    std::optional<MergedClusters> merged; // where asked for: as the level has them; all else here is numbered as before
    bool visibility_stopped = false; // time was up: unfinished portals keep loose sets
    Surfaces surfaces;
    std::vector<Light> lights;
    Lighting lighting;
    Ambient ambient;
    Probes probes;
    Density density;
    Bytes level;
    std::vector<StageReport> stages;
};

struct CompileRun { // what cannot change the result
    const ContentStore* store = nullptr;
    Stage last = Stage::pack;
    // 0: no limit. Where it ends the flow early the result is looser, is not kept as the stage's, and the next run goes on
    // from there.
    double visibility_seconds = 0;
    std::function<void(const StageReport&)> stage_done;
    bool keeps() const { return store && store->enabled(); }
};

// Fills `out` stage by stage. A fault ends it: leak (unless allowed), unreadable map, nothing to compile, cancelled.
Result<bool> compile(const CompileInput& input, const CompileOptions& options, const CompileRun& run, Context& context,
                     Compiled& out);

} // namespace kiln

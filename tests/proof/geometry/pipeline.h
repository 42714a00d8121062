// From map text or a world to the last geometric stage, each stage validated, for proofs about all of them together.
#pragma once
#include "compiler/surfaces/surfaces.h"
#include "libs/core/context.h"
#include <optional>
#include <string>
#include <string_view>

namespace kiln::proof {

struct Geometry {
    World world;
    Csg csg;
    Bsp bsp;                 // filled; of a world that leaks as the compiler makes it then: not filled
    std::optional<Leak> leak;
    Surfaces surfaces;
    std::vector<Diagnostic> diagnostics;
    std::optional<Fault> fault; // what ended it
    std::string stage;          // the last that was done: "", "read", "world", "csg", "bsp", "surfaces"

    std::size_t count(std::string_view code) const;
    const Diagnostic* first(std::string_view code) const;
};

struct RunOptions {
    CsgOptions csg;
    BspOptions bsp;
    std::string last = "surfaces"; // csg, bsp, surfaces
    int threads = 1;
};

Geometry run(World world, const RunOptions& options = {});
// By the first word: VMF or Quake-family text.
Geometry run_text(std::string_view text, const std::string& name, const RunOptions& options = {});

// Path of a map of other people, or nothing where they are not at hand.
std::optional<std::string> shared_map(const std::string& name);
std::vector<std::string> shared_maps(); // all of them, sorted
std::optional<World> load_world(const std::string& path, Context& context);

} // namespace kiln::proof

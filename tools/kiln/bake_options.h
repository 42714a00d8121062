// The options of everything that compiles a map: one table for build, dump, image, gather and reference.
#pragma once
#include "compiler/compile.h"
#include "tools/kiln/console.h"
#include <CLI/CLI.hpp>
#include <memory>

namespace kiln {

struct BakeOptions {
    std::string map, cache, log_format = "text", encoding = "dot", directional = "needed";
    std::vector<std::string> materials, textures, lights_rad;
    std::string game_dir;
    std::vector<std::string> instance_paths, wads;
    CompileOptions compile;
    bool draft = false, final = false, error_given = false;
    double ambient_error = 0, luxel_error = -1; // < 0: follows --error
    double vis_budget = 0;
    int threads = 0; // 0: all
    bool quiet = false, werror = false;

    void add_to(CLI::App& command);
    // Carries the switches over into `compile` and the console; call once after parsing.
    void settle(Console& console);
    int thread_count() const;
};

// Reads the map and what lies beside it: NAME.materials.json, lights.rad, NAME.rad, textures; instances are found later.
Result<CompileInput> read_input(const BakeOptions& options, Context& context);

// Compiles up to `last`, printing as it goes. The exit code is 0 or that of the fault (already printed).
int compile_map(const BakeOptions& options, Console& console, Context& context, Stage last, Compiled& out);

std::string stem_of(const std::string& path); // without folder's change, without extension

} // namespace kiln

// The commands. Each adds its options to its CLI11 command and gives a function that runs it to an exit code.
#pragma once
#include "tools/kiln/bake_options.h"
#include <functional>

namespace kiln {

using Command = std::function<int()>;
Command build_command(CLI::App& app);
Command info_command(CLI::App& app);
Command dump_command(CLI::App& app);
Command vis_command(CLI::App& app);
Command trace_command(CLI::App& app);
Command image_command(CLI::App& app);
Command verify_command(CLI::App& app);
Command export_command(CLI::App& app);
Command sample_command(CLI::App& app);
Command gather_command(CLI::App& app);
Command reference_command(CLI::App& app);
Command explain_command(CLI::App& app);
Command bench_command(CLI::App& app);
Command bench_stability_command(CLI::App& bench); // a command of bench; below 0: another one was called

} // namespace kiln

// A level file in memory, opened by the run-time loader.
#pragma once
#include "formats/level/kiln_level.h"
#include "libs/core/result.h"
#include <memory>
#include <string>

namespace kiln {

struct LevelFile {
    Bytes bytes; // borrowed by `level`
    std::unique_ptr<kiln_level, decltype(&kiln_level_close)> level{nullptr, kiln_level_close};
};
bool is_level(const Bytes& bytes); // by its first four bytes
Result<LevelFile> open_level(const std::string& path); // Exit::input: cannot be read, or is no level

} // namespace kiln

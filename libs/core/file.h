// Whole files in and out. Writing is all or nothing: a temporary name beside the target, synced, then renamed.
#pragma once
#include "libs/core/archive.h"
#include "libs/core/result.h"
#include <span>
#include <string>

namespace kiln {

Result<Bytes> read_file(const std::string& path);               // Exit::input where it cannot be read
Result<bool> write_file(const std::string& path, std::span<const std::uint8_t> bytes); // Exit::io
Result<bool> write_file(const std::string& path, const std::string& text);

} // namespace kiln

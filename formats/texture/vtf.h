// The head of a Valve texture (.vtf): its size, and the mean colour that its maker worked out.
//
// Errors   texture-unreadable: no such file, or cut short. Format: FORMAT.md
#pragma once
#include "libs/core/result.h"
#include "libs/math/vec.h"
#include <cstdint>
#include <span>
#include <string>

namespace kiln {

struct VtfHead {
    int width = 0, height = 0;
    Rgbd reflectivity{}; // linear; held to 0..1
};
Result<VtfHead> read_vtf_head(std::span<const std::uint8_t> bytes, const std::string& file);
constexpr std::size_t kVtfHeadBytes = 64; // all that is looked at

} // namespace kiln

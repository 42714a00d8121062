// SPDX-License-Identifier: MIT
// Charts onto atlas pages: places, texels in the stored formats, quality planes. Private to the writer.
#pragma once
#include "formats/level/level_writer.h"
#include "formats/level/tables.h"

namespace kiln::level {

struct LightmapPages {
    std::vector<kiln_chart> charts;
    std::vector<std::uint32_t> same_as; // per chart: the first that has its texels; itself
    std::vector<PageInfo> pages;
    std::vector<Blob> texels;  // per page, run-time order
    std::vector<Blob> quality; // per page: validity, then error codes; empty where the content has none
};
LightmapPages make_pages(const LevelContent& content, const WriteOptions& options);

} // namespace kiln::level

// Portal files (.prt) and leak trails (.pts, .lin): what other compilers and editors read. Format: FORMAT.md.
//
// In/Out   values and bytes; windings counter-clockwise seen from cluster `front` (the text has them clockwise)
// Errors   portal-file-* : located by line; nothing is allocated on the word of a count in the file
#pragma once
#include "libs/core/archive.h"
#include "libs/core/result.h"
#include "libs/math/vec.h"
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace kiln {

struct FilePortal {
    std::uint32_t front = 0, back = 0; // clusters; the first one named is the one the winding faces
    std::vector<Vec3> winding;         // map units
    bool hint = false;                 // the "h" of some dialects' portal lines
    friend bool operator==(const FilePortal&, const FilePortal&) = default;
};

struct PortalFile {
    std::uint32_t cluster_count = 0;
    std::vector<FilePortal> portals;
    // Cluster of each leaf, where the file tells them apart (PRT2, PRT1-AM); else empty: leaf i is cluster i.
    std::vector<std::uint32_t> leaf_cluster;
    friend bool operator==(const PortalFile&, const PortalFile&) = default;
};

Result<PortalFile> read_portal_file(std::span<const std::uint8_t> bytes, const std::string& file);
// PRT1, or PRT2 where leaf_cluster is given.
std::string write_portal_file(const PortalFile& file);

// Leak trails, from the entity to the void. Quake's engines draw a dot at each point, so .pts gets points at most
// `spacing` map units apart; editors join them by lines either way. .lin has the corners alone, the void's end first.
std::string write_pts(std::span<const Vec3> path, double spacing = 4);
std::string write_lin(std::span<const Vec3> path);
Result<std::vector<Vec3>> read_trail(std::span<const std::uint8_t> bytes, const std::string& file);

} // namespace kiln

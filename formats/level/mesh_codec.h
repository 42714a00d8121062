// SPDX-License-Identifier: MIT
// The render mesh as bytes: Draco edgebreaker over integer positions, verified, with a plain form to fall back on.
//
// In       a mesh on an integer grid: positions all different, each used, numbered by first use in the triangles;
//          no triangle names a vertex twice
// Out      bytes from which decode_mesh gives exactly that mesh, triangle order and first corners included
#pragma once
#include "formats/level/wire.h"

namespace kiln::level {

struct GridMesh {
    std::vector<std::array<std::int32_t, 3>> positions;
    std::vector<std::array<std::uint32_t, 3>> triangles;
    friend bool operator==(const GridMesh&, const GridMesh&) = default;
};
enum class MeshCodec : std::uint8_t { plain = 0, draco = 1 };

Blob encode_mesh(const GridMesh& mesh, MeshCodec wanted = MeshCodec::draco);
// Throws Damaged. Nothing is allocated beyond what the counts (which the caller has bounded) ask for.
GridMesh decode_mesh(std::span<const std::uint8_t> bytes, std::uint32_t vertex_count, std::uint32_t triangle_count);

} // namespace kiln::level

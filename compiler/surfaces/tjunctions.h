// Corners of one region that lie on the edge of another become vertices of that edge, so that neighbouring faces
// share every vertex along their common border.
#pragma once
#include "compiler/surfaces/regions.h"
#include "libs/core/context.h"

namespace kiln {

struct FaceOutlines {
    PlaneId plane;
    std::vector<Outline>* loops;
};
// Inserts into each loop's edges every vertex of any of the loops that lies strictly on them; exact.
void insert_tjunctions(const VertexTable& vertices, std::span<const FaceOutlines> faces, Context& context);

} // namespace kiln

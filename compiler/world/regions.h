// Private to world: region brushes of .map files, with which a designer compiles a part of his level.
//
// A brush painted with `region` all over: only what touches its box is compiled, and the box gets walls. One painted
// with `antiregion`: what touches its box is left out. As in ericw-tools; there a second region brush is an error,
// here the regions' boxes join into one.
#pragma once
#include "formats/document/document.h"
#include "libs/core/context.h"
#include <optional>

namespace kiln {

struct Regions {
    std::optional<Box3> box;
    std::vector<Box3> without;
    std::vector<DocBrush> walls; // around the box, for the world
    bool any() const { return box || !without.empty(); }
    bool keeps(const Box3& box) const;
    bool keeps(Vec3 point) const;
};
// `omitted`: entities that are not compiled anyway.
Regions find_regions(const Document& document, const std::vector<std::uint8_t>& omitted, Context& context);
bool is_region_brush(const DocBrush& brush);

} // namespace kiln

// Private: faces as the planes make them against faces as the editor saw them.
#pragma once
#include "compiler/csg/csg.h"

namespace kiln::csg_detail {

// Of the sides whose corners the file gives (VMF `vertices_plus`), those that lie elsewhere: the planes were misread, or
// somebody edited one without the other. Counts go to csg.report; one note names the worst (editor-vertices-differ).
void compare_with_editor(const World& world, Csg& csg, Context& context);

} // namespace kiln::csg_detail

// Lines of a lights.rad. Private to the folder.
#pragma once
#include "formats/material/rules.h"

namespace kiln {
std::vector<MaterialRule> rules_of_lights_rad(std::string_view text, const std::string& file, Context& context);
}

// Rules out of JSON text. Private to the folder.
#pragma once
#include "formats/material/rules.h"

namespace kiln {
Result<std::vector<MaterialRule>> rules_of_json(std::string_view text, const std::string& file, Context& context);
}

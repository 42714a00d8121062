// Words of the command lines of vbsp, vvis, vrad, qbsp, vis and light: what each becomes here, or what takes its place.
#pragma once
#include "libs/core/result.h"
#include <string>
#include <vector>

namespace kiln {

// The command line in our own words; what is to be said of them goes to `notes`. A fault where a word asks for what there is not.
Result<std::vector<std::string>> translate_known_words(int argc, char** argv, std::vector<std::string>& notes);

std::string explain_words(); // all of them, one a line

} // namespace kiln

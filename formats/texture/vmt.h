// Valve material files (.vmt): the keys of a shader.
//
// Out      the shader's name and its keys, lower case, in order; of a "patch" those of its `insert` and `replace` blocks, and
//          the file it patches. Blocks for other hardware, proxies and the like are passed over
//          too; so are pairs and blocks with a condition that does not hold on a desktop computer ([$X360], [!$WIN32])
// Errors   texture-unreadable: no block, or a condition without an end (a fault). Text that ends early gives what was there
#pragma once
#include "libs/core/result.h"
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace kiln {

struct Vmt {
    std::string shader;  // lower case
    std::string include; // of a patch: the file whose keys these replace, as spelled ("materials/...vmt"); or empty
    std::vector<std::pair<std::string, std::string>> keys;

    const std::string* find(std::string_view lower_key) const; // the last one
    bool is_set(std::string_view lower_key) const;             // a number that is not 0
};
Result<Vmt> read_vmt(std::string_view text, const std::string& file);

} // namespace kiln

#include "tools/kiln/level_file.h"
#include "libs/core/file.h"

namespace kiln {

bool is_level(const Bytes& bytes) { return bytes.size() >= 4 && std::equal(bytes.begin(), bytes.begin() + 4, "KILN"); }

Result<LevelFile> open_level(const std::string& path) {
    auto bytes = read_file(path);
    if (!bytes) return bytes.fault();
    LevelFile file;
    file.bytes = *std::move(bytes);
    kiln_level* raw = nullptr;
    if (const kiln_status s = kiln_level_open_memory(file.bytes.data(), file.bytes.size(), &raw); s != KILN_OK)
        return fault(Exit::input, "not-a-level", kiln_status_text(s), {.file = path});
    file.level.reset(raw);
    return file;
}

} // namespace kiln

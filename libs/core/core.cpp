#include "libs/core/check.h"
#include "libs/core/context.h"
#include "libs/core/hash.h"
#include "libs/core/result.h"
#include <fmt/format.h>
#include <xxhash.h>

namespace kiln {

const char* to_text(Severity severity) {
    switch (severity) {
    case Severity::note: return "note";
    case Severity::warning: return "warning";
    case Severity::error: return "error";
    }
    return "?";
}

std::string to_text(const Diagnostic& d) {
    std::string text;
    if (!d.where.file.empty()) text += d.where.file + ":";
    if (d.where.line > 0) text += fmt::format("{}:", d.where.line);
    if (!text.empty()) text += " ";
    text += to_text(d.severity);
    text += ": ";
    std::string place;
    const auto add = [&](const char* what, int id) {
        if (id >= 0) place += fmt::format("{}{} {}", place.empty() ? "" : ", ", what, id);
    };
    add("entity", d.where.entity);
    add("brush", d.where.brush);
    add("side", d.where.side);
    if (!place.empty()) text += place + ": ";
    return text + d.message + " [" + d.code + "]";
}

void check_failed(const char* file, int line, const std::string& what) {
    throw InternalError(fmt::format("{}:{}: internal check failed: {}", file, line, what));
}

Hash hash_bytes(std::span<const std::uint8_t> bytes) {
    const XXH128_hash_t h = XXH3_128bits(bytes.data(), bytes.size());
    return {h.low64, h.high64};
}

std::string to_hex(Hash hash) { return fmt::format("{:016x}{:016x}", hash.high, hash.low); }

} // namespace kiln

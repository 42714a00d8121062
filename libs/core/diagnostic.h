// Faults of a map are data: what was found, where, and how grave it is.
#pragma once
#include "libs/core/archive.h"
#include <cstdint>
#include <string>
#include <vector>

namespace kiln {

enum class Severity : std::uint8_t { note, warning, error };

// Ids are those written in the map file where it has ids (VMF), else the ordinal in the file; -1: none.
struct SourceLocation {
    std::string file;
    int line = 0, entity = -1, brush = -1, side = -1;
    template <class A> void fields(A& a) { a(file, line, entity, brush, side); }
    friend bool operator==(const SourceLocation&, const SourceLocation&) = default;
};

struct Diagnostic {
    Severity severity = Severity::error;
    std::string code; // kebab-case and stable: tests and `kiln explain` go by it
    SourceLocation where;
    std::string message; // what was found and, if known, what to do
    template <class A> void fields(A& a) { a(severity, code, where, message); }
};

// "maps/x.vmf:214: error: entity 0, brush 37, side 4: message [code]"
std::string to_text(const Diagnostic& diagnostic);
const char* to_text(Severity severity);

// Exit codes of the command line; a Fault carries the one it leads to.
enum class Exit : std::uint8_t {
    ok = 0,
    internal = 1,
    usage = 2,
    input = 3,     // cannot be read or parsed
    geometry = 4,  // leak, nothing valid to compile
    limit = 5,     // a limit or budget was exceeded
    quality = 6,   // a quality gate failed
    cancelled = 7,
    io = 8,
};

} // namespace kiln

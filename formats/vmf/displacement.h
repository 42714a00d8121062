// `dispinfo` of a side: its text while the block is open, and what it says. Private to the reader.
#pragma once
#include "formats/document/document.h"
#include "libs/core/context.h"
#include <optional>
#include <string_view>
#include <vector>

namespace kiln::vmf {

// Rows wait for the end of the block: only the power tells how long they ought to be, and it may come last.
struct DisplacementText {
    enum Array : std::uint8_t {
        normals, distances, offsets, offset_normals, alphas, triangle_tags, multiblend, alphablend,
        color_0, color_1, color_2, color_3, allowed_verts, other
    };
    struct Value {
        std::string_view text;
        int line = 0; // 0: the file does not say
    };
    struct Row {
        Array array = other;
        std::string_view name;
        Value value;
    };
    int line = 0;
    Value power, start, elevation, flags;
    Array open_array = other;
    std::vector<Row> rows;

    void begin(int at_line);
    void open(std::string_view block); // of the arrays
    void key(std::string_view name, std::string_view value, int at_line); // beside the arrays
    void row(std::string_view name, std::string_view value, int at_line); // inside one
};

// Nothing: it cannot be used (reported as an error; the face stays flat). Rows that are missing or broken become zeros with
// a warning. `where` is the side.
std::optional<DocDisplacement> read_displacement(const DisplacementText& text, const SourceLocation& where, Context& context);

} // namespace kiln::vmf

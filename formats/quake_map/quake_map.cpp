#include "formats/quake_map/quake_map.h"
#include "formats/document/side_text.h"
#include "formats/quake_map/row.h"
#include "formats/quake_map/scanner.h"
#include <algorithm>
#include <set>
#include <fmt/format.h>

namespace kiln {
namespace {

// Enough to see what is wrong; a file that is no map at all would else fill the screen.
constexpr int kMostSyntaxErrors = 50;

struct Reader {
    quake::Scanner scanner;
    std::string file;
    Context& context;
    Document document;
    std::optional<Fault> fatal = std::nullopt;
    int syntax_errors = 0;
    std::set<std::string> told = {}; // kinds of primitives already reported
    std::size_t standard_rows = 0, valve_rows = 0, primitive_rows = 0;
    SourceLocation row_place = {file}; // of the row that is read: one string for all rows
    int rows_of_brush = 0; // read so far, of the brush that is open
    int unquoted = 0, unquoted_line = 0, unquoted_entity = 0;
    int stray_brushes = 0, stray_line = 0; // brushes that stand outside any entity
    bool ended = false;                    // the end of the file was met inside a block

    void syntax(const char* code, std::string message, SourceLocation where) {
        ++syntax_errors;
        if (!fatal)
            fatal = fault(Exit::input, code, std::move(message), std::move(where));
        else
            context.report(Severity::error, code, std::move(message), std::move(where));
    }
    void unexpected(const char* wanted, int entity) {
        const char c = scanner.peek();
        syntax("syntax", fmt::format("{} should stand here, not '{}'", wanted, shown({&c, 1})),
               {file, scanner.line(), entity});
        scanner.skip_line();
    }
    void truncated(int opened, int entity, int brush) {
        ended = true;
        syntax("unbalanced-braces",
               fmt::format("the file ends inside the block opened in line {}: is it truncated?", opened),
               {file, opened, entity, brush});
    }

    // After an opening brace: over everything up to its closing one.
    void skip_block(int entity, int brush) {
        const int opened = scanner.line();
        for (int depth = 1; depth > 0;) {
            const char c = scanner.peek();
            if (c == '\0') return truncated(opened, entity, brush);
            if (c == '"') {
                scanner.take();
                std::string_view ignored;
                scanner.string(ignored);
            } else if (c == '{' || c == '}') {
                scanner.take();
                depth += c == '{' ? 1 : -1;
            } else {
                if (scanner.word(quake::kBlank | quake::kBrace | quake::kQuote).empty()) scanner.take();
            }
        }
    }

    // A word where a row should be: the name of a primitive, and its block.
    void read_primitive(std::string_view name, DocEntity& entity, DocBrush& brush, bool& good) {
        const SourceLocation where{file, scanner.line(), entity.id, brush.id};
        if (scanner.peek() != '{') {
            unexpected("the opening brace of a primitive", entity.id);
            good = false;
            return;
        }
        scanner.take();
        const auto is = [&](std::string_view n) { return equal_ignoring_case(name, n); };
        if (is("brushDef") || is("brushDef2") || is("brushDef3")) {
            read_primitive_rows(!is("brushDef"), entity, brush, good);
        } else if (is("patchDef2") || is("patchDef3")) {
            DocPatch patch;
            patch.line = where.line;
            patch.id = brush.id;
            if (quake::read_patch(scanner, patch, is("patchDef3"), where, context)) entity.patches.push_back(std::move(patch));
            skip_block(entity.id, brush.id); // keys of an editor, or what is left of a patch that cannot be read
        } else {
            // Hundreds of them are one thing to know; the world stage tells their number.
            const bool known = lower_case(name).ends_with("terraindef") || lower_case(name).ends_with("terraindef3");
            if (told.insert(std::string(name)).second)
                context.report(known ? Severity::note : Severity::warning, known ? "primitive-not-handled" : "primitive-unknown",
                               fmt::format("the primitive '{}' is not read; it is left out, as are all others like it", shown(name)), where);
            ++entity.skipped_primitives;
            skip_block(entity.id, brush.id);
        }
    }
    void read_primitive_rows(bool by_equation, DocEntity& entity, DocBrush& brush, bool& good) {
        const int opened = scanner.line();
        // Planes given by numbers are relative to their entity's origin, points are not. The world has none.
        Vec3 origin;
        if (by_equation && !equal_ignoring_case(entity.get("classname"), "worldspawn")) origin = entity.vector("origin", {});
        for (;;) {
            const char c = scanner.peek();
            if (c == '\0') return truncated(opened, entity.id, brush.id);
            if (syntax_errors >= kMostSyntaxErrors) return;
            if (c == '}') return scanner.take();
            if (c == '(') {
                DocSide side = begin_side(entity, brush);
                if (quake::read_primitive_row(scanner, side, by_equation, origin, row_place, context)) {
                    ++primitive_rows;
                    brush.sides.push_back(std::move(side));
                } else {
                    good = false;
                }
            } else if (c == '"') { // keys of an editor
                scanner.take();
                std::string_view ignored;
                if (!scanner.string(ignored)) syntax("string-unterminated", "a string has no closing quote", {file, scanner.line(), entity.id, brush.id});
            } else if (c == '{') {
                block_in_brush(entity, brush);
                if (ended) return;
            } else {
                unexpected("a row of a brush", entity.id);
                good = false;
            }
        }
    }
    void block_in_brush(const DocEntity& entity, const DocBrush& brush) {
        syntax("unbalanced-braces", fmt::format("a block opens inside the brush of line {}: is a brace missing?", brush.line),
               {file, scanner.line(), entity.id, brush.id});
        scanner.take();
        skip_block(entity.id, brush.id);
    }
    DocSide begin_side(const DocEntity& entity, DocBrush& brush) {
        DocSide side;
        side.line = scanner.line();
        side.id = rows_of_brush++;
        row_place.line = side.line, row_place.entity = entity.id, row_place.brush = brush.id, row_place.side = side.id;
        if (brush.sides.empty()) brush.sides.reserve(6); // as most have
        return side;
    }

    // After the opening brace of a brush.
    void read_brush(DocEntity& entity, int ordinal) {
        DocBrush brush;
        brush.line = scanner.line();
        brush.id = ordinal;
        bool good = true, primitive = false;
        rows_of_brush = 0;
        for (;;) {
            const char c = scanner.peek();
            if (c == '\0') return truncated(brush.line, entity.id, ordinal);
            if (syntax_errors >= kMostSyntaxErrors) return;
            if (c == '}') {
                scanner.take();
                break;
            }
            if (c == '(') {
                DocSide side = begin_side(entity, brush);
                quake::RowFormat format = quake::RowFormat::standard;
                if (quake::read_row(scanner, side, format, row_place, context)) {
                    ++(format == quake::RowFormat::standard ? standard_rows : valve_rows);
                    brush.sides.push_back(std::move(side));
                } else {
                    good = false;
                }
                continue;
            }
            if (c == '{') {
                block_in_brush(entity, brush);
                if (ended) return;
                continue;
            }
            const std::string_view word = scanner.word(quake::kBlank | quake::kRound | quake::kBrace | quake::kQuote);
            if (word.empty()) {
                unexpected("a row of a brush", entity.id);
                good = false;
                continue;
            }
            primitive = true;
            read_primitive(word, entity, brush, good);
            if (ended) return;
        }
        if (!good || (primitive && brush.sides.empty())) return;
        if (brush.sides.empty()) {
            context.report(Severity::error, "brush-without-sides", "a brush has no sides; it is left out",
                           {file, brush.line, entity.id, ordinal});
            return;
        }
        entity.brushes.push_back(std::move(brush));
    }

    // A word of a key or value, quoted or bare, on the present line; false: there is none.
    bool read_word(std::string_view& out, int entity) {
        const char c = scanner.peek_on_line();
        const int line = scanner.line();
        if (c == '"') {
            scanner.take();
            if (!scanner.string(out)) syntax("string-unterminated", "a string has no closing quote", {file, line, entity});
            return true;
        }
        if (c == '\n') return false;
        out = scanner.word(quake::kBlank | quake::kRound | quake::kBrace | quake::kQuote);
        if (out.empty()) return false;
        if (unquoted++ == 0) unquoted_line = line, unquoted_entity = entity;
        return true;
    }

    // After the opening brace of an entity.
    void read_entity(int ordinal) {
        DocEntity entity;
        entity.line = scanner.line();
        entity.id = ordinal;
        int brushes = 0;
        bool stray = false;
        for (;;) {
            const char c = scanner.peek();
            const int line = scanner.line();
            if (c == '\0') {
                truncated(entity.line, ordinal, -1);
                break;
            }
            if (syntax_errors >= kMostSyntaxErrors) return;
            if (c == '}') {
                scanner.take();
                break;
            }
            if (c == '{') {
                scanner.take();
                read_brush(entity, brushes++);
                if (ended) break;
            } else if (c == '(' && entity.keys.empty()) { // a brush where an entity should be
                stray = true;
                scanner.skip_line();
            } else {
                std::string_view name, value;
                const int errors = syntax_errors;
                if (!read_word(name, ordinal)) {
                    unexpected("a key or a brush", ordinal);
                } else if (errors == syntax_errors && !read_word(value, ordinal)) {
                    syntax("syntax", fmt::format("the key '{}' has no value", shown(name)), {file, line, ordinal});
                    scanner.skip_line();
                } else if (errors == syntax_errors) {
                    entity.keys.push_back({std::string(name), std::string(value), line, false});
                }
            }
        }
        if (!stray) {
            document.entities.push_back(std::move(entity));
        } else if (stray_brushes++ == 0) {
            stray_line = entity.line;
        }
    }

    // "Version 2", the first line of Doom 3's files.
    void skip_version() {
        quake::Scanner ahead = scanner;
        ahead.peek();
        if (!equal_ignoring_case(ahead.word(quake::kBlank | quake::kBrace), "version") || ahead.peek_on_line() == '\n') return;
        if (read_integer(ahead.word(quake::kBlank | quake::kBrace))) scanner = ahead;
    }

    void run() {
        skip_version();
        for (int ordinal = 0;;) {
            const char c = scanner.peek();
            if (c == '\0') break;
            if (syntax_errors >= kMostSyntaxErrors) {
                context.report(Severity::error, "too-many-errors", "too many errors; reading stops here",
                               {file, scanner.line()});
                return;
            }
            if (c == '{') {
                scanner.take();
                read_entity(ordinal++);
            } else if (c == '}') {
                syntax("unbalanced-braces", "a closing brace without an opening one", {file, scanner.line()});
                scanner.take();
            } else {
                unexpected("the opening brace of an entity", -1);
            }
        }
        if (unquoted > 0)
            context.report(Severity::warning, "key-unquoted", fmt::format("{} keys or values stand without quotes; each is read as one word", unquoted),
                           {file, unquoted_line, unquoted_entity});
        if (stray_brushes > 0)
            syntax("brush-without-entity",
                   fmt::format("{} brushes stand outside any entity: this is a list of brushes, not a map",
                               stray_brushes),
                   {file, stray_line});
    }
};

} // namespace

Result<Document> read_quake_map(std::span<const std::uint8_t> bytes, const std::string& file, Context& context) {
    std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (std::optional<Fault> no = reject_non_text(text, file)) return *no;
    std::string unified;
    unify_line_breaks(text, unified);
    Reader reader{quake::Scanner(text), file, context, {}};
    reader.run();
    if (reader.fatal) return *reader.fatal;
    Document document = std::move(reader.document);
    document.file = file;
    const int kinds = (reader.standard_rows > 0) + (reader.valve_rows > 0) + (reader.primitive_rows > 0);
    document.format = kinds > 1               ? MapFormat::quake_mixed
                      : reader.valve_rows > 0 ? MapFormat::quake_valve220
                                              : MapFormat::quake_standard; // brushDef too: it has no value of its own
    // Worldspawn comes first in every file an editor writes; one that was moved is found.
    auto world = document.entities.begin();
    while (world != document.entities.end() && !equal_ignoring_case(world->get("classname"), "worldspawn")) ++world;
    if (world == document.entities.end())
        return fault(Exit::input, "no-worldspawn", "the file has no worldspawn entity", {file, 1});
    std::rotate(document.entities.begin(), world, world + 1);
    return document;
}

} // namespace kiln

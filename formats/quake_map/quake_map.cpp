#include "formats/quake_map/quake_map.h"
#include "formats/document/side_text.h"
#include "formats/quake_map/row.h"
#include "formats/quake_map/scanner.h"
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
    std::size_t standard_rows = 0, valve_rows = 0;
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
                if (scanner.word("{}\"").empty()) scanner.take();
            }
        }
    }

    // After the opening brace of a brush.
    void read_brush(DocEntity& entity, int ordinal) {
        DocBrush brush;
        brush.line = scanner.line();
        brush.id = ordinal;
        bool good = true, primitive = false;
        int rows = 0;
        for (;;) {
            const char c = scanner.peek();
            if (c == '\0') return truncated(brush.line, entity.id, ordinal);
            if (syntax_errors >= kMostSyntaxErrors) return;
            if (c == '}') {
                scanner.take();
                break;
            }
            if (c == '(') {
                DocSide side;
                side.line = scanner.line();
                side.id = rows++;
                quake::RowFormat format = quake::RowFormat::standard;
                if (quake::read_row(scanner, side, format, {file, side.line, entity.id, ordinal, side.id},
                                    context)) {
                    ++(format == quake::RowFormat::standard ? standard_rows : valve_rows);
                    brush.sides.push_back(std::move(side));
                } else {
                    good = false;
                }
                continue;
            }
            if (c == '{') {
                scanner.take();
                skip_block(entity.id, ordinal);
                if (ended) return;
                continue;
            }
            const std::string_view word = scanner.word("(){}\"");
            const SourceLocation where{file, scanner.line(), entity.id, ordinal};
            if (word.empty()) {
                unexpected("a row of a brush", entity.id);
                good = false;
                continue;
            }
            const bool known = word.starts_with("patchDef") || word.starts_with("brushDef");
            // Hundreds of patches are one thing to know; the world stage tells their number.
            if (told.insert(std::string(word)).second)
                context.report(known ? Severity::note : Severity::warning,
                               known ? "primitive-not-handled" : "primitive-unknown",
                               fmt::format("the primitive '{}' is not read yet; it is left out, as are all others like it", shown(word)),
                               where);
            ++entity.skipped_primitives;
            primitive = true;
            // Its block is the next '{', met above; what else follows on the line belongs to it.
        }
        if (primitive || !good) return;
        if (brush.sides.empty()) {
            context.report(Severity::error, "brush-without-sides", "a brush has no sides; it is left out",
                           {file, brush.line, entity.id, ordinal});
            return;
        }
        entity.brushes.push_back(std::move(brush));
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
            } else if (c == '"') {
                scanner.take();
                DocKey key;
                key.line = line;
                std::string_view text;
                if (!scanner.string(text)) {
                    syntax("string-unterminated", "a string has no closing quote", {file, line, ordinal});
                    continue;
                }
                key.key = text;
                if (scanner.peek_on_line() != '"') {
                    syntax("syntax", fmt::format("the key '{}' has no value", shown(key.key)),
                           {file, line, ordinal});
                    scanner.skip_line();
                    continue;
                }
                scanner.take();
                if (!scanner.string(text))
                    syntax("string-unterminated", "a string has no closing quote", {file, line, ordinal});
                key.value = text;
                entity.keys.push_back(std::move(key));
            } else if (c == '(' && entity.keys.empty()) { // a brush where an entity should be
                stray = true;
                scanner.skip_line();
            } else {
                unexpected("a key or a brush", ordinal);
            }
        }
        if (!stray) {
            document.entities.push_back(std::move(entity));
        } else if (stray_brushes++ == 0) {
            stray_line = entity.line;
        }
    }

    void run() {
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
    Reader reader{quake::Scanner(text), file, context, {}};
    reader.run();
    if (reader.fatal) return *reader.fatal;
    Document document = std::move(reader.document);
    document.file = file;
    document.format = reader.valve_rows == 0      ? MapFormat::quake_standard
                      : reader.standard_rows == 0 ? MapFormat::quake_valve220
                                                  : MapFormat::quake_mixed;
    // Worldspawn comes first in every file an editor writes; one that was moved is found.
    auto world = document.entities.begin();
    while (world != document.entities.end() && !equal_ignoring_case(world->get("classname"), "worldspawn")) ++world;
    if (world == document.entities.end())
        return fault(Exit::input, "no-worldspawn", "the file has no worldspawn entity", {file, 1});
    std::rotate(document.entities.begin(), world, world + 1);
    return document;
}

} // namespace kiln

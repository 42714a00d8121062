#include "formats/vmf/vmf.h"
#include "formats/document/side_text.h"
#include "formats/vmf/side.h"
#include <charconv>
#include <fmt/format.h>

namespace kiln {
namespace {

enum class TokenKind { word, open, close, end };
struct Token {
    TokenKind kind = TokenKind::end;
    std::string_view text;
    int line = 1;
    bool unterminated = false; // a string that its line's end cut off
};

class Scanner {
public:
    explicit Scanner(std::string_view text) : text_(text) {}

    Token next() {
        skip_blanks();
        Token token{TokenKind::end, {}, line_, false};
        if (at_ == text_.size()) return token;
        const char c = text_[at_];
        if (c == '{' || c == '}') {
            token.kind = c == '{' ? TokenKind::open : TokenKind::close;
            token.text = text_.substr(at_++, 1);
        } else if (c == '"') {
            // Strings hold no escapes. A line break ends one that was not closed: the rest of the file can then
            // still be read, and the fault is told where it is.
            const std::size_t stop = text_.find_first_of("\"\n", ++at_);
            const std::size_t end = stop == std::string_view::npos ? text_.size() : stop;
            token.kind = TokenKind::word;
            token.text = text_.substr(at_, end - at_);
            token.unterminated = end == text_.size() || text_[end] == '\n';
            at_ = token.unterminated ? end : end + 1;
        } else {
            const std::size_t stop = text_.find_first_of(" \t\r\n\v\f{}\"", at_);
            const std::size_t end = stop == std::string_view::npos ? text_.size() : stop;
            token.kind = TokenKind::word;
            token.text = text_.substr(at_, end - at_);
            at_ = end;
        }
        return token;
    }

private:
    std::string_view text_;
    std::size_t at_ = 0;
    int line_ = 1;

    void skip_blanks() {
        for (; at_ < text_.size(); ++at_) {
            const char c = text_[at_];
            if (c == '\n') {
                ++line_;
            } else if (c == '/' && at_ + 1 < text_.size() && text_[at_ + 1] == '/') {
                while (at_ < text_.size() && text_[at_] != '\n') ++at_;
                --at_; // the loop steps on to the line break
            } else if (!(c == ' ' || (c >= '\t' && c <= '\r'))) {
                return;
            }
        }
    }
};

int id_of(std::string_view value, int otherwise) {
    int id = otherwise;
    std::from_chars(value.data(), value.data() + value.size(), id);
    return id;
}

// Blocks that mean something here; all others, `hidden` among them, are skipped with all they hold.
enum class Block : std::uint8_t { file, world, entity, connections, solid, side, displacement, skipped };

struct Reader {
    std::string file;
    Context& context;
    Document document;
    std::vector<DocEntity> entities; // but world
    DocEntity world, entity;
    DocBrush brush;
    DocSide side;
    bool has_world = false, brush_good = true, side_has_plane = false;
    std::optional<Fault> fatal;
    int syntax_errors = 0;

    Reader(const std::string& name, Context& c) : file(name), context(c) { document.file = name; }

    // Enough to see what is wrong; a file that is no map at all would else fill the screen.
    static constexpr int kMostSyntaxErrors = 50;

    SourceLocation here(int line) const { return {file, line, current().id, brush.id, side.id}; }
    DocEntity& current() { return in_world ? world : entity; }
    const DocEntity& current() const { return in_world ? world : entity; }
    bool in_world = false;

    void syntax(const char* code, std::string message, int line) {
        ++syntax_errors;
        if (!fatal)
            fatal = fault(Exit::input, code, std::move(message), here(line));
        else
            context.report(Severity::error, code, std::move(message), here(line));
    }

    Block open(Block parent, std::string_view name, int line) {
        const auto is = [&](std::string_view n) { return equal_ignoring_case(name, n); };
        switch (parent) {
        case Block::file:
            if (is("world")) {
                if (has_world)
                    context.report(Severity::warning, "second-world",
                                   "a second world block; its brushes and keys join the first", {file, line});
                in_world = true;
                if (!has_world) world.line = line;
                has_world = true;
                return Block::world;
            }
            if (is("entity")) {
                in_world = false;
                entity = {};
                entity.line = line;
                return Block::entity;
            }
            return Block::skipped;
        case Block::world:
        case Block::entity:
            if (is("solid")) {
                brush = {};
                brush.line = line;
                brush_good = true;
                return Block::solid;
            }
            return is("connections") ? Block::connections : Block::skipped;
        case Block::solid:
            if (!is("side")) return Block::skipped;
            side = {};
            side.line = line;
            side_has_plane = false;
            return Block::side;
        case Block::side:
            if (!is("dispinfo")) return Block::skipped;
            side.displacement = static_cast<std::int32_t>(document.displacements.size());
            document.displacements.push_back({.line = line});
            return Block::displacement;
        default:
            return Block::skipped;
        }
    }

    void key(Block block, std::string_view name, std::string_view value, int line) {
        switch (block) {
        case Block::world:
        case Block::entity: {
            DocEntity& e = current();
            if (equal_ignoring_case(name, "id") && e.id < 0)
                e.id = id_of(value, -1);
            else
                e.keys.push_back({std::string(name), std::string(value), line, false});
            break;
        }
        case Block::connections:
            current().keys.push_back({std::string(name), std::string(value), line, true});
            break;
        case Block::solid:
            if (equal_ignoring_case(name, "id")) brush.id = id_of(value, -1);
            break;
        case Block::side:
            if (equal_ignoring_case(name, "id")) {
                side.id = id_of(value, -1);
                break;
            }
            if (equal_ignoring_case(name, "plane")) side_has_plane = true;
            if (!vmf::set_side_key(side, name, value, here(line), context)) brush_good = false;
            break;
        default:
            break;
        }
    }

    void close(Block block, int line) {
        switch (block) {
        case Block::side:
            if (!side_has_plane) {
                context.report(Severity::error, "plane-missing", "a side has no plane; the brush is left out",
                               here(side.line));
                brush_good = false;
            }
            mend_texture_scale(side.texture, here(side.line), context);
            brush.sides.push_back(std::move(side));
            side = {};
            break;
        case Block::solid:
            if (brush.sides.empty() && brush_good) {
                context.report(Severity::error, "brush-without-sides", "a solid has no sides; it is left out",
                               here(brush.line));
                brush_good = false;
            }
            if (brush_good) current().brushes.push_back(std::move(brush));
            brush = {};
            break;
        case Block::entity:
            entities.push_back(std::move(entity));
            entity = {};
            break;
        case Block::world:
            in_world = false;
            break;
        default:
            break;
        }
        (void)line;
    }

    void run(std::string_view text) {
        Scanner scanner(text);
        std::vector<std::pair<Block, int>> stack{{Block::file, 1}}; // with the line each was opened in
        Token name;                                                 // a word that waits for its value or its block
        bool named = false;
        for (;;) {
            const Token token = scanner.next();
            if (token.unterminated) syntax("string-unterminated", "a string has no closing quote", token.line);
            if (syntax_errors >= kMostSyntaxErrors) {
                context.report(Severity::error, "too-many-errors", "too many errors; reading stops here",
                               {file, token.line});
                return;
            }
            const Block block = stack.back().first;
            if (token.kind == TokenKind::word) {
                if (!named) {
                    name = token;
                    named = true;
                    continue;
                }
                if (block == Block::file)
                    syntax("syntax", fmt::format("'{}' stands where a block should begin", shown(token.text)),
                           token.line);
                else
                    key(block, name.text, token.text, name.line);
                named = false;
                continue;
            }
            if (token.kind == TokenKind::open) {
                if (!named) syntax("syntax", "a block without a name", token.line);
                stack.emplace_back(named ? open(block, name.text, name.line) : Block::skipped, token.line);
                named = false;
                continue;
            }
            if (named) {
                syntax("syntax", fmt::format("'{}' has neither value nor block", shown(name.text)), name.line);
                named = false;
            }
            if (token.kind == TokenKind::end) break;
            if (stack.size() == 1) {
                syntax("unbalanced-braces", "a closing brace without an opening one", token.line);
                continue;
            }
            close(block, token.line);
            stack.pop_back();
        }
        if (stack.size() > 1)
            syntax("unbalanced-braces",
                   fmt::format("the file ends inside the block opened in line {}: is it truncated?",
                               stack.back().second),
                   stack.back().second);
        if (!has_world && !fatal)
            fatal = fault(Exit::input, "no-world", "the file has no world block: it is no VMF map", {file, 1});
    }
};

} // namespace

Result<Document> read_vmf(std::span<const std::uint8_t> bytes, const std::string& file, Context& context) {
    std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (std::optional<Fault> no = reject_non_text(text, file)) return *no;
    Reader reader(file, context);
    reader.run(text);
    if (reader.fatal) return *reader.fatal;
    Document document = std::move(reader.document);
    document.format = MapFormat::vmf;
    document.entities.reserve(reader.entities.size() + 1);
    document.entities.push_back(std::move(reader.world));
    for (DocEntity& e : reader.entities) document.entities.push_back(std::move(e));
    return document;
}

} // namespace kiln

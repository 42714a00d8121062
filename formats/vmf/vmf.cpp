#include "formats/vmf/vmf.h"
#include "formats/document/side_text.h"
#include "formats/vmf/displacement.h"
#include "formats/vmf/scanner.h"
#include "formats/vmf/side.h"
#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>

namespace kiln {
namespace {

using vmf::Scanner;
using vmf::Token;
using vmf::TokenKind;

int id_of(std::string_view value, int otherwise) {
    int id = otherwise;
    std::from_chars(value.data(), value.data() + value.size(), id);
    return id;
}

// Blocks that mean something here; all others are skipped with all they hold, and so is what is `hidden`, counted.
enum class Block : std::uint8_t {
    file, world, entity, connections, solid, side, vertices, displacement, displacement_rows, hidden, cordons, cordon, cordon_box, skipped
};

struct Reader {
    std::string file;
    Context& context;
    Document document;
    std::vector<DocEntity> entities; // but world
    DocEntity world, entity;
    DocBrush brush;
    DocSide side;
    vmf::DisplacementText displacement; // of `side`
    bool has_displacement = false, vertices_good = true;
    std::vector<DocCordon> cordons; // of the block that is open
    DocCordon cordon;               // its name and state; a box each time one closes
    DocKey mins, maxs;              // of the cordon's box that is open
    bool cordons_active = true, one_cordon = false;
    int hidden_entities = 0, hidden_solids = 0, hidden_line = 0;
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
        const Block block = block_in(parent, name, line);
        if (block == Block::skipped && parent != Block::skipped)
            for (const std::string_view known : {"world", "entity", "solid", "side", "dispinfo"})
                if (equal_ignoring_case(name, known) && !(parent == Block::side && has_displacement) && parent != Block::hidden)
                    context.report(Severity::warning, "block-misplaced",
                                   fmt::format("a block '{}' stands inside a block that holds none; it is left out", known), here(line));
        return block;
    }
    Block block_in(Block parent, std::string_view name, int line) {
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
            if (is("hidden")) return Block::hidden;
            if (is("cordons") || is("cordon")) { // one box of its own before Hammer had several
                cordons.clear();
                cordons_active = true;
                one_cordon = is("cordon");
                return one_cordon ? begin_cordon(line) : Block::cordons;
            }
            return Block::skipped;
        case Block::hidden:
            if (is("hidden")) return Block::hidden;
            if (!is("entity") && !is("solid")) return Block::skipped;
            if (hidden_line == 0) hidden_line = line;
            ++(is("entity") ? hidden_entities : hidden_solids);
            return is("entity") ? Block::hidden : Block::skipped; // what is hidden in it is hidden twice, yet one brush
        case Block::cordons:
            return is("cordon") ? begin_cordon(line) : Block::skipped;
        case Block::cordon:
            if (!is("box")) return Block::skipped;
            mins = maxs = {};
            return Block::cordon_box;
        case Block::world:
        case Block::entity:
            if (is("solid")) {
                brush = {};
                brush.line = line;
                brush_good = true;
                return Block::solid;
            }
            if (is("hidden")) return Block::hidden;
            return is("connections") ? Block::connections : Block::skipped;
        case Block::solid:
            if (!is("side")) return Block::skipped;
            side = {};
            side.line = line;
            side_has_plane = has_displacement = false;
            return Block::side;
        case Block::side:
            if (is("vertices_plus")) {
                side.vertices.clear();
                vertices_good = true;
                return Block::vertices;
            }
            if (!is("dispinfo")) return Block::skipped;
            if (has_displacement) {
                context.report(Severity::warning, "displacement-second", "a second dispinfo of one side; it is ignored", here(line));
                return Block::skipped;
            }
            has_displacement = true;
            displacement.begin(line);
            return Block::displacement;
        case Block::displacement:
            displacement.open(name);
            return Block::displacement_rows;
        default:
            return Block::skipped;
        }
    }

    Block begin_cordon(int line) {
        cordon = {};
        cordon.line = line;
        cordon.active = true;
        mins = maxs = {};
        return Block::cordon;
    }
    void close_box() {
        std::array<double, 3> lo{}, hi{};
        const bool good = read_numbers(mins.value, lo) && read_numbers(maxs.value, hi) && lo[0] <= hi[0] && lo[1] <= hi[1] && lo[2] <= hi[2];
        if (!good) {
            context.report(Severity::warning, "cordon-invalid",
                           fmt::format("the box of a cordon, '{}' to '{}', is not two points, the lower first; it is ignored", shown(mins.value),
                                       shown(maxs.value)),
                           {file, mins.line ? mins.line : cordon.line});
            return;
        }
        const auto kept = [](double x) { return std::clamp(x, -kLargestCoordinate, kLargestCoordinate); }; // there is nothing beyond
        cordon.box = {{kept(lo[0]), kept(lo[1]), kept(lo[2])}, {kept(hi[0]), kept(hi[1]), kept(hi[2])}};
        cordons.push_back(cordon);
    }
    void close_cordons() {
        for (DocCordon& c : cordons) {
            c.active = c.active && cordons_active;
            document.cordons.push_back(std::move(c));
        }
        cordons.clear();
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
        case Block::vertices: {
            std::array<double, 3> v{};
            const auto near = [](double x) { return std::abs(x) <= kLargestCoordinate; };
            if (vertices_good && !(read_numbers(value, v) && std::ranges::all_of(v, near))) {
                vertices_good = false;
                context.report(Severity::warning, "vertices-plus-invalid",
                               fmt::format("the vertex '{}' is not three numbers that can be used; the vertices_plus of the side are ignored", shown(value)), here(line));
            }
            side.vertices.push_back({v[0], v[1], v[2]});
            break;
        }
        case Block::displacement:
            displacement.key(name, value, line);
            break;
        case Block::displacement_rows:
            displacement.row(name, value, line);
            break;
        case Block::cordons:
            if (equal_ignoring_case(name, "active")) cordons_active = read_integer(value).value_or(0) != 0;
            break;
        case Block::cordon:
        case Block::cordon_box:
            if (equal_ignoring_case(name, "name")) cordon.name = value;
            if (equal_ignoring_case(name, "active")) cordon.active = read_integer(value).value_or(0) != 0;
            if (equal_ignoring_case(name, "mins")) mins = {"mins", std::string(value), line};
            if (equal_ignoring_case(name, "maxs")) maxs = {"maxs", std::string(value), line};
            break;
        default:
            break;
        }
    }

    void close(Block block) {
        switch (block) {
        case Block::vertices:
            if (!vertices_good) side.vertices.clear();
            break;
        case Block::displacement:
            side.displacement = static_cast<std::int32_t>(document.displacements.size());
            document.displacements.push_back(vmf::read_displacement(displacement, here(displacement.line), context).value_or(DocDisplacement{.line = displacement.line}));
            break;
        case Block::cordon_box:
            close_box();
            break;
        case Block::cordon:
            if (!one_cordon) break;
            close_box();
            close_cordons();
            break;
        case Block::cordons:
            close_cordons();
            break;
        case Block::side:
            if (!side_has_plane) {
                context.report(Severity::error, "plane-missing", "a side has no plane; the brush is left out",
                               here(side.line));
                brush_good = false;
            }
            if (side.material.empty()) check_material(side, here(side.line), context);
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
            close(block);
            stack.pop_back();
        }
        if (stack.size() > 1)
            syntax("unbalanced-braces",
                   fmt::format("the file ends inside the block opened in line {}: is it truncated?",
                               stack.back().second),
                   stack.back().second);
        if (hidden_line > 0)
            context.report(Severity::note, "hidden-skipped",
                           fmt::format("{} entities and {} solids are hidden in the editor and left out, as its own compiler does",
                                       hidden_entities, hidden_solids),
                           {file, hidden_line});
        if (!has_world && !fatal)
            fatal = fault(Exit::input, "no-world", "the file has no world block: it is no VMF map", {file, 1});
    }
};

} // namespace

Result<Document> read_vmf(std::span<const std::uint8_t> bytes, const std::string& file, Context& context) {
    std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (std::optional<Fault> no = reject_non_text(text, file)) return *no;
    std::string unified;
    unify_line_breaks(text, unified);
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

#include "formats/quake_map/row.h"
#include "formats/document/side_text.h"
#include <cmath>
#include <fmt/format.h>

namespace kiln::quake {
namespace {

struct RowReader {
    Scanner& scanner;
    Context& context;
    const SourceLocation& where;
    const char* fault = "row-unreadable"; // code of what does not fit the grammar
    const char* left_out = "brush";

    bool unexpected(const char* wanted) {
        const char c = scanner.peek();
        std::string found = c == '\0' ? "the end of the file" : fmt::format("'{}'", shown({&c, 1}));
        SourceLocation at = where;
        at.line = scanner.line();
        context.report(Severity::error, fault,
                       fmt::format("{} should stand here, not {}; the {} is left out", wanted, found, left_out), at);
        if (c != '{' && c != '}') scanner.skip_line(); // braces still close what they close
        return false;
    }
    bool take(char c) {
        if (scanner.peek() != c) {
            const char wanted[] = {'\'', c, '\'', '\0'};
            return unexpected(wanted);
        }
        scanner.take();
        return true;
    }
    bool number(double& out, const char* what) {
        scanner.peek();
        const std::string_view word = scanner.word(kAnyBracket);
        if (word.empty()) return unexpected(what);
        const std::optional<double> value = parse_number(word);
        const bool good = value && std::abs(*value) <= kLargestTextureNumber;
        if (!good)
            context.report(Severity::warning, "texture-number-unreadable",
                           fmt::format("'{}' is no number that can be used ({}); 0 is used", shown(word), what), where);
        out = good ? *value : 0;
        return true;
    }
    bool point(std::array<Decimal, 3>& p) {
        if (!take('(')) return false;
        for (Decimal& coordinate : p) {
            scanner.peek();
            const std::string_view word = scanner.word(kAnyBracket);
            if (word.empty()) return unexpected("a coordinate");
            if (!read_coordinate(word, coordinate, where, context)) {
                scanner.skip_line();
                return false;
            }
        }
        return take(')');
    }
    bool axis(Vec3& a, double& shift) {
        return take('[') && number(a.x, "texture axis") && number(a.y, "texture axis") &&
               number(a.z, "texture axis") && number(shift, "texture shift") && take(']');
    }
    // Texture names may hold any bracket ("{fence", "[x"), so white space alone ends them.
    bool material(std::string& out) {
        std::string_view name;
        const char first = scanner.peek();
        if (first == '\0' || first == '}') return unexpected("a texture name");
        if (first == '"') {
            scanner.take();
            if (!scanner.string(name)) return unexpected("the closing quote of a texture name");
        } else {
            name = scanner.word(kBlank);
        }
        out = name;
        return true;
    }
    bool material(DocSide& side) {
        if (!material(side.material)) return false;
        check_material(side, where, context);
        return true;
    }
    bool matrix(TextureMatrix& m) {
        if (!take('(')) return false;
        for (auto& row : m) {
            if (!take('(')) return false;
            for (double& x : row)
                if (!number(x, "texture matrix")) return false;
            if (!take(')')) return false;
        }
        return take(')');
    }
    bool equation(std::array<Decimal, 4>& plane) {
        if (!take('(')) return false;
        for (Decimal& x : plane) {
            scanner.peek();
            const std::string_view word = scanner.word(kAnyBracket);
            if (word.empty()) return unexpected("a number of a plane");
            const std::optional<Decimal> value = parse_decimal(word);
            if (!value) {
                context.report(Severity::error, "coordinate-not-a-number",
                               fmt::format("'{}' in a plane is not a finite number; the brush is left out", shown(word)), where);
                scanner.skip_line();
                return false;
            }
            x = *value;
        }
        return take(')');
    }
    // Contents, flags and value of Quake 2 and 3; the one light number of Hexen II; whatever others append.
    void trailing(DocSide& side) {
        std::array<std::int64_t, 3> numbers{};
        std::size_t count = 0;
        for (;;) {
            const char c = scanner.peek_on_line();
            if (c == '\n' || c == '(' || c == '}' || c == '{') break;
            const std::string_view word = scanner.word(kBlank | kRound | kBrace);
            const std::optional<std::int64_t> value = read_integer(word);
            if (!value) {
                context.report(Severity::warning, "row-extra-words",
                               fmt::format("what follows '{}' in the row is not known", shown(word)), where);
                scanner.skip_line();
                break;
            }
            if (count < 3) numbers[count] = *value;
            ++count;
        }
        if (count < 3) return;
        side.contents = numbers[0], side.surface_flags = numbers[1], side.value = numbers[2];
        side.has_content_flags = true;
    }
    bool count(std::uint32_t& out, const char* what) {
        scanner.peek();
        const std::string_view word = scanner.word(kAnyBracket);
        const std::optional<std::int64_t> value = read_integer(word);
        if (!value || *value < 0 || *value > UINT32_MAX) return unexpected(what);
        out = static_cast<std::uint32_t>(*value);
        return true;
    }
    bool integer(std::int64_t& out, const char* what) {
        scanner.peek();
        const std::optional<std::int64_t> value = read_integer(scanner.word(kAnyBracket));
        if (!value) return unexpected(what);
        out = *value;
        return true;
    }
};

} // namespace

bool read_row(Scanner& scanner, DocSide& side, RowFormat& format, const SourceLocation& where, Context& context) {
    RowReader r{scanner, context, where};
    for (auto& p : side.points)
        if (!r.point(p)) return false;
    if (!r.material(side)) return false;

    DocTexture& t = side.texture;
    if (scanner.peek() == '[') {
        format = RowFormat::valve220;
        double rotation = 0; // the axes say it already
        if (!r.axis(t.u_axis, t.u_shift) || !r.axis(t.v_axis, t.v_shift) || !r.number(rotation, "rotation") ||
            !r.number(t.u_scale, "texture scale") || !r.number(t.v_scale, "texture scale"))
            return false;
        mend_texture_scale(t, where, context);
        r.trailing(side);
        return true;
    }
    format = RowFormat::standard;
    double rotation = 0;
    if (!r.number(t.u_shift, "texture shift") || !r.number(t.v_shift, "texture shift") ||
        !r.number(rotation, "rotation") || !r.number(t.u_scale, "texture scale") ||
        !r.number(t.v_scale, "texture scale"))
        return false;
    project_standard(t, normal_of(side.points), rotation);
    mend_texture_scale(t, where, context);
    const std::size_t numbers_end = scanner.position();
    r.trailing(side);
    const std::string_view comment = scanner.comment_since(numbers_end);
    if (comment.starts_with("//TX1") || comment.starts_with("//TX2")) project_quark(t, side.points, comment[4] == '1');
    return true;
}

bool read_primitive_row(Scanner& scanner, DocSide& side, bool by_equation, Vec3 origin, const SourceLocation& where, Context& context) {
    RowReader r{scanner, context, where};
    Vec3 normal;
    if (by_equation) {
        std::array<Decimal, 4> plane;
        if (!r.equation(plane)) return false;
        const std::optional<PlanePoints> points = points_of_plane(plane, origin);
        if (!points) {
            context.report(Severity::error, "plane-invalid",
                           fmt::format("the plane ( {} {} {} {} ) has no direction or lies beyond {} map units; the brush is left out", plane[0].to_double(),
                                       plane[1].to_double(), plane[2].to_double(), plane[3].to_double(), kLargestCoordinate),
                           where);
            scanner.skip_line();
            return false;
        }
        side.points = *points;
        normal = {plane[0].to_double(), plane[1].to_double(), plane[2].to_double()};
    } else {
        for (auto& p : side.points)
            if (!r.point(p)) return false;
        normal = normal_of(side.points);
    }
    TextureMatrix matrix{};
    if (!r.matrix(matrix) || !r.material(side)) return false;
    if (!project_primitive(side.texture, normal, matrix))
        context.report(Severity::warning, "texture-matrix-singular",
                       "the texture matrix takes the face to a line or a point; one repeat in 64 units is used", where);
    r.trailing(side);
    return true;
}

bool read_patch(Scanner& scanner, DocPatch& patch, bool fixed, const SourceLocation& where, Context& context) {
    constexpr std::uint32_t kMostPoints = 1023; // one way: 32 times what the games take
    RowReader r{scanner, context, where, "patch-unreadable", "patch"};
    if (!r.material(patch.material) || !r.take('(') || !r.count(patch.columns, "the width of a patch") || !r.count(patch.rows, "the height of a patch")) return false;
    if (fixed && (!r.count(patch.subdivisions[0], "a number of subdivisions") || !r.count(patch.subdivisions[1], "a number of subdivisions"))) return false;
    if (!r.integer(patch.contents, "contents") || !r.integer(patch.surface_flags, "flags") || !r.integer(patch.value, "value") || !r.take(')')) return false;
    const auto good = [](std::uint32_t n) { return n >= 3 && n <= kMostPoints && n % 2 == 1; };
    if (!good(patch.columns) || !good(patch.rows)) {
        context.report(Severity::error, "patch-size-invalid",
                       fmt::format("a patch of {} by {} control points: both must be odd, from 3 to {}; it is left out", patch.columns, patch.rows, kMostPoints), where);
        return false;
    }
    if (!r.take('(')) return false;
    for (std::uint32_t column = 0; column < patch.columns; ++column) {
        if (!r.take('(')) return false;
        for (std::uint32_t row = 0; row < patch.rows; ++row) {
            if (!r.take('(')) return false;
            std::array<double, 5> n{};
            for (double& x : n) {
                scanner.peek();
                const std::string_view word = scanner.word(kAnyBracket);
                const std::optional<double> value = parse_number(word);
                const bool coordinate = &x < &n[3];
                if (!value || std::abs(*value) > (coordinate ? kLargestCoordinate : kLargestTextureNumber)) {
                    if (word.empty()) return r.unexpected("a number of a control point");
                    SourceLocation at = where;
                    at.line = scanner.line();
                    context.report(Severity::error, "patch-unreadable",
                                   fmt::format("'{}' of a control point is no number that can be used; the patch is left out", shown(word)), at);
                    return false;
                }
                x = *value;
            }
            if (!r.take(')')) return false;
            patch.points.push_back({n[0], n[1], n[2]});
            patch.uv.push_back({n[3], n[4]});
        }
        if (!r.take(')')) return false;
    }
    return r.take(')');
}

} // namespace kiln::quake

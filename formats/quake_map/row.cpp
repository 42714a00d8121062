#include "formats/quake_map/row.h"
#include "formats/document/side_text.h"
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace kiln::quake {
namespace {

// Words inside a row end at brackets: ")(" and "]1" need no white space between.
constexpr std::string_view kBrackets = "()[]{}";

struct RowReader {
    Scanner& scanner;
    Context& context;
    const SourceLocation& where;

    bool unexpected(const char* wanted) {
        const char c = scanner.peek();
        std::string found = c == '\0' ? "the end of the file" : fmt::format("'{}'", shown({&c, 1}));
        SourceLocation at = where;
        at.line = scanner.line();
        context.report(Severity::error, "row-unreadable",
                       fmt::format("{} should stand here, not {}; the brush is left out", wanted, found), at);
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
        const std::string_view word = scanner.word(kBrackets);
        const std::optional<double> value = parse_number(word);
        if (word.empty()) return unexpected(what);
        if (!value)
            context.report(Severity::warning, "texture-number-unreadable",
                           fmt::format("'{}' is no finite number ({}); 0 is used", shown(word), what), where);
        out = value.value_or(0);
        return true;
    }
    bool point(std::array<Decimal, 3>& p) {
        if (!take('(')) return false;
        for (Decimal& coordinate : p) {
            scanner.peek();
            const std::string_view word = scanner.word(kBrackets);
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
    // Contents, flags and value of Quake 2 and 3; the one light number of Hexen II; whatever others append.
    void trailing(DocSide& side) {
        std::array<std::int64_t, 3> numbers{};
        std::size_t count = 0;
        for (;;) {
            const char c = scanner.peek_on_line();
            if (c == '\n' || c == '(' || c == '}' || c == '{') break;
            const std::string_view word = scanner.word("(){}");
            const std::optional<double> value = parse_number(word);
            if (!value || std::abs(*value) > 9e15) {
                context.report(Severity::warning, "row-extra-words",
                               fmt::format("what follows '{}' in the row is not known", shown(word)), where);
                scanner.skip_line();
                break;
            }
            if (count < 3) numbers[count] = static_cast<std::int64_t>(*value);
            ++count;
        }
        if (count < 3) return;
        side.contents = numbers[0], side.surface_flags = numbers[1], side.value = numbers[2];
        side.has_content_flags = true;
    }
};

Vec3 rounded(const std::array<Decimal, 3>& p) {
    return {p[0].to_double(), p[1].to_double(), p[2].to_double()};
}

} // namespace

void project_standard(DocTexture& texture, Vec3 normal, double rotation_deg) {
    // Nearest axis by the largest component; at equal ones z goes before x before y, as in the table of the
    // original. The normal comes unnormalised from exact points, so that 45 degrees are a tie exactly; the
    // tolerance is for points that an editor has rounded.
    constexpr double kTie = 1 + 1e-9;
    const double x = std::abs(normal.x), y = std::abs(normal.y), z = std::abs(normal.z);
    const int axis = z * kTie >= x && z * kTie >= y ? 2 : x * kTie >= y ? 0 : 1;
    const std::size_t u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2; // the two axes the texture lies along
    double s = 0, c = 1;
    const double turn = std::fmod(rotation_deg, 360.0);
    if (turn != 0) {
        const double quarters = turn / 90;
        if (quarters == std::floor(quarters)) { // quarter turns stay axis-parallel to the last bit
            constexpr std::array<double, 4> kSin = {0, 1, 0, -1};
            const std::size_t q = static_cast<std::size_t>(static_cast<int>(quarters) & 3);
            s = kSin[q], c = kSin[(q + 1) & 3];
        } else {
            s = std::sin(turn * std::numbers::pi / 180), c = std::cos(turn * std::numbers::pi / 180);
        }
    }
    // Unrotated: u along +u, v along -v. Both turn by the same angle.
    texture.u_axis = texture.v_axis = {};
    texture.u_axis[u] = c, texture.u_axis[v] = s;
    texture.v_axis[u] = s, texture.v_axis[v] = -c;
}

bool read_row(Scanner& scanner, DocSide& side, RowFormat& format, const SourceLocation& where, Context& context) {
    RowReader r{scanner, context, where};
    for (auto& p : side.points)
        if (!r.point(p)) return false;

    // Texture names may hold any bracket ("{fence", "[x"), so white space alone ends them.
    std::string_view name;
    const char first = scanner.peek();
    if (first == '\0' || first == '}') return r.unexpected("a texture name");
    if (first == '"') {
        scanner.take();
        if (!scanner.string(name)) return r.unexpected("the closing quote of a texture name");
    } else {
        name = scanner.word("");
    }
    side.material = name;

    DocTexture& t = side.texture;
    if (scanner.peek() == '[') {
        format = RowFormat::valve220;
        double rotation = 0; // the axes say it already
        if (!r.axis(t.u_axis, t.u_shift) || !r.axis(t.v_axis, t.v_shift) || !r.number(rotation, "rotation") ||
            !r.number(t.u_scale, "texture scale") || !r.number(t.v_scale, "texture scale"))
            return false;
    } else {
        format = RowFormat::standard;
        double rotation = 0;
        if (!r.number(t.u_shift, "texture shift") || !r.number(t.v_shift, "texture shift") ||
            !r.number(rotation, "rotation") || !r.number(t.u_scale, "texture scale") ||
            !r.number(t.v_scale, "texture scale"))
            return false;
        const Vec3 p0 = rounded(side.points[0]);
        project_standard(t, cross(rounded(side.points[1]) - p0, rounded(side.points[2]) - p0), rotation);
    }
    mend_texture_scale(t, where, context);
    r.trailing(side);
    return true;
}

} // namespace kiln::quake

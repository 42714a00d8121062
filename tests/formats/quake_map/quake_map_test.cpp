#include "formats/quake_map/quake_map.h"
#include "formats/quake_map/projection.h"
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <iterator>
#include <numbers>
#include <random>
#include <string>

using namespace std::string_literals;

namespace kiln {
namespace {

Result<Document> read(const std::string& text, Context& context) {
    return read_quake_map({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "t.map", context);
}
std::size_t count(const Context& c, const std::string& code) {
    return static_cast<std::size_t>(std::ranges::count(c.diagnostics(), code, &Diagnostic::code));
}
const std::string kPoints = "( 0 0 0 ) ( 0 64 0 ) ( 64 0 0 ) ";
std::string world(const std::string& inside) {
    return "{\n\"classname\" \"worldspawn\"\n" + inside + "}\n";
}
std::string brush(const std::string& rows) {
    return "{\n" + rows + "}\n";
}

const DocSide& only_side(const Result<Document>& d) {
    return d->entities.at(0).brushes.at(0).sides.at(0);
}

TEST(QuakeMap, ReadsAllRowLayouts) {
    const struct {
        std::string row, material;
        MapFormat format;
        bool flags;
    } cases[] = {
        {kPoints + "WALL1 1 2 0 0.5 -1\n", "WALL1", MapFormat::quake_standard, false},
        {kPoints + "+0slip [ 1 0 0 1 ] [ 0 -1 0 2 ] 0 0.5 -1\n", "+0slip", MapFormat::quake_valve220, false},
        {"(0 0 0)(0 64 0)(64 0 0)*water [1 0 0 1][0 -1 0 2]0 0.5 -1 32 8 5\r\n", "*water",
         MapFormat::quake_valve220, true},
        {kPoints + "\"with space\" 1 2 0 0.5 -1\n", "with space", MapFormat::quake_standard, false},
        {kPoints + "{fence 1 2 0 0.5 -1 32 8 5\n", "{fence", MapFormat::quake_standard, true},
        {kPoints + "hexen2 1 2 0 0.5 -1 -1\n", "hexen2", MapFormat::quake_standard, false},
        {kPoints + "e1u1/floor 1 2 0 5e-1 -1.000 32 8 5 // TX1\n", "e1u1/floor", MapFormat::quake_standard, true},
        {"( -0 0 0 )\n( 0 64 0 )\n( 64 0 0 )\nbroken/over 1\n2 0 0.5 -1\n", "broken/over",
         MapFormat::quake_standard, false},
    };
    for (const auto& k : cases) {
        Context c;
        const Result<Document> d = read(world(brush(k.row)), c);
        ASSERT_TRUE(d) << k.row << to_text(d.fault().diagnostic);
        EXPECT_TRUE(c.diagnostics().empty()) << k.row << to_text(c.diagnostics()[0]);
        EXPECT_EQ(d->format, k.format);
        const DocSide& s = only_side(d);
        EXPECT_EQ(s.material, k.material);
        EXPECT_EQ(s.points[1][1].to_double(), 64);
        EXPECT_EQ(s.texture.u_axis, (Vec3{1, 0, 0})) << k.row;
        EXPECT_EQ(s.texture.v_axis, (Vec3{0, -1, 0})) << k.row;
        EXPECT_EQ(s.texture.u_shift, 1);
        EXPECT_EQ(s.texture.v_shift, 2);
        EXPECT_EQ(s.texture.u_scale, 0.5);
        EXPECT_EQ(s.texture.v_scale, -1);
        EXPECT_EQ(s.has_content_flags, k.flags) << k.row;
        if (k.flags) {
            EXPECT_EQ(s.contents, 32);
            EXPECT_EQ(s.surface_flags, 8);
            EXPECT_EQ(s.value, 5);
        }
    }
}

TEST(QuakeMap, FormatsMayMixInOneFile) {
    Context c;
    const Result<Document> d =
        read(world(brush(kPoints + "a 0 0 0 1 1\n" + kPoints + "b [ 0 1 0 0 ] [ 0 0 -1 0 ] 0 1 1\n")), c);
    ASSERT_TRUE(d);
    EXPECT_EQ(d->format, MapFormat::quake_mixed);
    EXPECT_EQ(d->entities[0].brushes[0].sides[1].texture.u_axis, (Vec3{0, 1, 0}));
}

TEST(QuakeMap, CommentsStringsAndPlaces) {
    Context c;
    const Result<Document> d =
        read("// Game: Quake\r\n; QuArK\r\n// entity 0\r\n{\r\n \"classname\" \"worldspawn\"\r\n"
             "\"message\" \"say \\\"hi\\\" // no comment ; none\"\r\n\"wad\" \"C:\\dir\\\"\r\n"
             "; Brush 0\r\n{\r\n" +
                 kPoints + "a 0 0 0 1 1\r\n}\r\n}\r\n{\"classname\"\"light\"\"classname\"\t\"again\"}",
             c);
    ASSERT_TRUE(d) << to_text(d.fault().diagnostic);
    EXPECT_TRUE(c.diagnostics().empty());
    EXPECT_EQ(d->entities[0].get("message"), "say \\\"hi\\\" // no comment ; none");
    EXPECT_EQ(d->entities[0].get("wad"), "C:\\dir\\");
    EXPECT_EQ(only_side(d).line, 10);
    ASSERT_EQ(d->entities.size(), 2u);
    EXPECT_EQ(d->entities[1].keys.size(), 2u);
    EXPECT_EQ(d->entities[1].line, 13);
    EXPECT_EQ(d->entities[1].id, 1);
}

// The classic projection: which axes for which way a side faces.
TEST(QuakeMap, StandardProjectionChoosesTheNearestAxisPlane) {
    const struct {
        Vec3 normal, u, v;
    } cases[] = {
        {{0, 0, 1}, {1, 0, 0}, {0, -1, 0}}, {{0, 0, -1}, {1, 0, 0}, {0, -1, 0}},
        {{1, 0, 0}, {0, 1, 0}, {0, 0, -1}}, {{-1, 0, 0}, {0, 1, 0}, {0, 0, -1}},
        {{0, 1, 0}, {1, 0, 0}, {0, 0, -1}}, {{0, -1, 0}, {1, 0, 0}, {0, 0, -1}},
        {{1, 0, 1}, {1, 0, 0}, {0, -1, 0}}, {{1, 1, 0}, {0, 1, 0}, {0, 0, -1}},
        {{3, 4, 2}, {1, 0, 0}, {0, 0, -1}}, {{1, 1, 1}, {1, 0, 0}, {0, -1, 0}},
    };
    for (const auto& k : cases) {
        DocTexture t;
        quake::project_standard(t, k.normal * 4096, 0);
        EXPECT_EQ(t.u_axis, k.u);
        EXPECT_EQ(t.v_axis, k.v);
    }
}

TEST(QuakeMap, StandardRotationTurnsBothAxesInTheirPlane) {
    const struct {
        double angle;
        Vec3 u, v;
    } exact[] = {
        {90, {0, 1, 0}, {1, 0, 0}},    {180, {-1, 0, 0}, {0, 1, 0}}, {270, {0, -1, 0}, {-1, 0, 0}},
        {-90, {0, -1, 0}, {-1, 0, 0}}, {360, {1, 0, 0}, {0, -1, 0}}, {450, {0, 1, 0}, {1, 0, 0}},
    };
    for (const auto& k : exact) {
        DocTexture t;
        quake::project_standard(t, {0, 0, 1}, k.angle);
        EXPECT_EQ(t.u_axis, k.u) << k.angle;
        EXPECT_EQ(t.v_axis, k.v) << k.angle;
    }
    for (double angle = -720; angle < 720; angle += 13.7)
        for (const Vec3 n : {Vec3{0, 0, 1}, Vec3{1, 0, 0}, Vec3{0, -1, 0}}) {
            DocTexture t, zero;
            quake::project_standard(t, n, angle);
            quake::project_standard(zero, n, 0);
            EXPECT_NEAR(length(t.u_axis), 1, 1e-12);
            EXPECT_NEAR(dot(t.u_axis, t.v_axis), 0, 1e-12);
            EXPECT_NEAR(dot(t.u_axis, n), 0, 1e-12);
            EXPECT_NEAR(dot(t.u_axis, zero.u_axis), std::cos(angle * std::numbers::pi / 180), 1e-9);
            EXPECT_NEAR(dot(t.v_axis, zero.v_axis), std::cos(angle * std::numbers::pi / 180), 1e-9);
        }
}

TEST(QuakeMap, UnknownPrimitivesAreSkippedAndTold) {
    Context c;
    const Result<Document> d = read(world("{\nterrainDef\n{\nTERRAIN\n3 3 0 0 64\n{ a }\n}\n}\n{\nterrainDef\n{\n}\n}\n"
                                          "{\nmesh\n{\n( 0 0 0 ) x\n}\n}\n" +
                                          brush(kPoints + "a 0 0 0 1 1\n")),
                                    c);
    ASSERT_TRUE(d);
    EXPECT_EQ(d->entities[0].skipped_primitives, 3u);
    ASSERT_EQ(d->entities[0].brushes.size(), 1u);
    EXPECT_EQ(d->entities[0].brushes[0].id, 3); // ordinals count what was skipped
    ASSERT_EQ(c.diagnostics().size(), 2u);      // one a kind
    EXPECT_EQ(c.diagnostics()[0].code, "primitive-not-handled");
    EXPECT_EQ(c.diagnostics()[0].where, (SourceLocation{"t.map", 4, 0, 0}));
    EXPECT_EQ(c.diagnostics()[1].code, "primitive-unknown");
    EXPECT_EQ(c.diagnostics()[1].severity, Severity::warning);
}

TEST(QuakeMap, FaultyRowsLeaveTheirBrushOutAndAreAllTold) {
    const struct {
        std::string row, code;
    } cases[] = {
        {"( 0 0 0 ) ( 0 64 0 ) ( 64 0 nan ) a 0 0 0 1 1\n", "coordinate-not-a-number"},
        {"( 0 0 0 ) ( 0 64 0 ) ( 64 0 1e9 ) a 0 0 0 1 1\n", "coordinate-out-of-range"},
        {"( 0 0 0 ) ( 0 64 0 ) ( 64 0 ) a 0 0 0 1 1\n", "row-unreadable"},
        {"( 0 0 0 ) ( 0 64 0 ) a 0 0 0 1 1\n", "row-unreadable"},
        {kPoints + "a [ 1 0 0 0 [ 0 1 0 0 ] 0 1 1\n", "row-unreadable"},
        {kPoints + "a 0 0\n", "row-unreadable"},
        {"", "brush-without-sides"},
    };
    std::string all;
    for (const auto& k : cases) all += brush(kPoints + "fine 0 0 0 1 1\n" + k.row);
    all += "{\n}\n" + brush(kPoints + "last 0 0 0 1 1\n");
    Context c;
    const Result<Document> d = read(world(all), c);
    ASSERT_TRUE(d) << to_text(d.fault().diagnostic);
    ASSERT_EQ(d->entities[0].brushes.size(), 2u); // that without a faulty row, and the last
    EXPECT_EQ(d->entities[0].brushes[1].sides[0].material, "last");
    for (const auto& k : cases) EXPECT_GE(count(c, k.code), 1u) << k.code;
    EXPECT_EQ(count(c, "row-unreadable"), 4u);
    for (const Diagnostic& x : c.diagnostics()) {
        EXPECT_EQ(x.severity, Severity::error);
        EXPECT_GT(x.where.line, 0);
        EXPECT_GE(x.where.brush, 0);
    }
}

TEST(QuakeMap, ZeroTextureScaleIsOne) {
    Context c;
    const Result<Document> d = read(world(brush(kPoints + "a 0 0 0 0 2\n")), c);
    ASSERT_TRUE(d);
    EXPECT_EQ(only_side(d).texture.u_scale, 1);
    EXPECT_EQ(only_side(d).texture.v_scale, 2);
    EXPECT_EQ(count(c, "texture-scale-zero"), 1u);
}

TEST(QuakeMap, BadFilesGiveLocatedFaults) {
    const std::string good = brush(kPoints + "a 0 0 0 1 1\n");
    const struct {
        std::string text, code;
        int line;
    } cases[] = {
        {"", "empty-file", 1},
        {std::string("IBSP\0\0", 6) + "x", "not-text", 1},
        {"\n\nhello\n", "syntax", 3},
        {good + good, "brush-without-entity", 1},
        {"// only a comment\n", "no-worldspawn", 1},
        {"{\n\"classname\" \"light\"\n}\n", "no-worldspawn", 1},
        {"{\n\"classname\" \"worldspawn\"\n", "unbalanced-braces", 1},
        {"{\n\"classname\" \"worldspawn\"\n{\n" + kPoints + "a 0 0 0 1 1\n", "unbalanced-braces", 3},
        {world(good) + "}\n", "unbalanced-braces", 7},
        {"{\n\"classname\" \"worldspawn\n}\n", "string-unterminated", 2},
        {"{\n\"classname\"\n\"worldspawn\"\n}\n", "syntax", 2},
        {"{\n\"classname\" \"worldspawn\"\n{\n" + kPoints + "a 0 0 0 1 1\n" + good + "}\n}\n", "unbalanced-braces", 5}, // a brace is missing
        {world("{\nbrushDef\n{\n{ }\n}\n}\n"), "unbalanced-braces", 6},
        {world("{\nbrushDef\n}\n"), "syntax", 5},
        {"{\nclassname\n}\n", "syntax", 2},
        {"{\nclassname worldspawn x\n}\n", "syntax", 2},
        {std::string("\xFF\xFE{\0", 4), "not-text", 1},
        {"{\n\"classname\" \"world\0spawn\"\n}\n"s, "not-text", 2},
        {std::string(200000, '{'), "unbalanced-braces", 1},
    };
    for (const auto& k : cases) {
        Context c;
        const Result<Document> d = read(k.text, c);
        ASSERT_FALSE(d) << k.text;
        EXPECT_EQ(d.fault().exit, Exit::input);
        EXPECT_EQ(d.fault().diagnostic.code, k.code) << k.text;
        EXPECT_EQ(d.fault().diagnostic.where.line, k.line) << k.text;
    }
}

// Unusual text: what is read, and the code where something is amiss.
TEST(QuakeMap, UnusualText) {
    const std::string good = world(brush(kPoints + "a 0 0 0 1 1\n"));
    std::string cr = "// Game: Quake\n" + good, crlf;
    for (char& ch : cr) ch = ch == '\n' ? '\r' : ch;
    for (const char ch : good) crlf += ch == '\n' ? "\r\n" : std::string(1, ch);
    const auto row = [](const std::string& points) { return world(brush(points + " a 0 0 0 1 1\n")); };
    const struct {
        std::string text, code; // "": nothing to tell
        std::size_t brushes;
    } cases[] = {
        {good, "", 1},
        {cr, "", 1},
        {crlf, "", 1},
        {"\xEF\xBB\xBF" + good, "", 1},
        {good + std::string(5, '\0'), "", 1},
        {"\t\v\f" + good + "\n\n; the end", "", 1},
        {"Version 2\n" + good, "", 1},
        {row("( +0 -0 .0 ) ( 0. 64.000 0e0 ) ( 6.4e1 0 0 )"), "", 1},
        {row("(0 0 0)(0 64 0)(64 0 1e-400)"), "", 1},
        {world("\"" + std::string(300, 'k') + "\" \"" + std::string(3000000, 'v') + "\"\n"), "", 0},
        {"{\nclassname worldspawn\n}\n", "key-unquoted", 0},
        {"{\n\"classname\" worldspawn // a comment\nlight \"300\"}\n", "key-unquoted", 0},
        {row("( 0 0 0 ) ( 0 64 0 ) ( 64 0 1e400 )"), "coordinate-out-of-range", 0},
        {row("( 0 0 0 ) ( 0 64 0 ) ( 64 0 0x10 )"), "coordinate-not-a-number", 0},
        {row("( 0 0 0 ) ( 0 64 0 ) ( 64 0 -nan )"), "coordinate-not-a-number", 0},
        {row("( 0 0 0 ) ( 0 64 0 ) ( 64 0 1,5 )"), "coordinate-not-a-number", 0},
        {world(brush(kPoints + "a 0 0 0 nan 1\n")), "texture-number-unreadable", 1},
        {world(brush(kPoints + "a 0 1e31 0 1 1\n")), "texture-number-unreadable", 1},
        {world(brush(kPoints + "a 0 0 0 1e-31 1\n")), "texture-scale-zero", 1},
        {world(brush(kPoints + "\"\" 0 0 0 1 1\n")), "material-missing", 1},
        {world(brush(kPoints + "a 0 0 0 1 1 0 0 0 what is this\n")), "row-extra-words", 1},
    };
    for (const auto& k : cases) {
        Context c;
        const Result<Document> d = read(k.text, c);
        ASSERT_TRUE(d) << k.text.substr(0, 200) << to_text(d.fault().diagnostic);
        EXPECT_EQ(d->entities[0].get("classname"), "worldspawn");
        EXPECT_EQ(d->entities[0].brushes.size(), k.brushes) << k.text.substr(0, 200);
        if (k.code.empty()) {
            ASSERT_TRUE(c.diagnostics().empty()) << k.text.substr(0, 200) << to_text(c.diagnostics()[0]);
            continue;
        }
        ASSERT_FALSE(c.diagnostics().empty()) << k.text;
        EXPECT_EQ(c.diagnostics()[0].code, k.code);
        EXPECT_GT(c.diagnostics()[0].where.line, 1);
    }
}

TEST(QuakeMap, AMillionEntities) {
    std::string text = world(brush(kPoints + "a 0 0 0 1 1\n"));
    for (int i = 0; i < 1000000; ++i) text += "{\"classname\" \"light\"}\n";
    Context c;
    const Result<Document> d = read(text, c);
    ASSERT_TRUE(d);
    EXPECT_EQ(d->entities.size(), 1000001u);
    EXPECT_EQ(d->entities.back().line, 1000006);
}

TEST(QuakeMap, DamagedFilesNeverCrash) {
    const std::string text =
        world(brush(kPoints + "a 0 0 0 1 1\n" + kPoints + "{b [ 1 0 0 0 ] [ 0 1 0 0 ] 0 1 1 0 4 0\n") +
              "{\npatchDef2\n{\ncommon/x\n( 3 3 0 0 0 )\n(\n( ( 0 0 0 0 0 ) ( 0 1 0 0 1 ) ( 0 2 0 0 2 ) )\n( ( 1 0 0 0 0 ) ( 1 1 0 0 1 ) ( 1 2 0 0 2 ) )\n"
              "( ( 2 0 0 0 0 ) ( 2 1 0 0 1 ) ( 2 2 0 0 2 ) )\n)\n}\n}\n"
              "{\nbrushDef3\n{\n( 0 0.6 0.8 -64 ) ( ( 0.5 0 0 ) ( 0 0.5 0 ) ) \"x y\" 0 0 0\n}\n}\n"
              "{\nbrushDef\n{\n" + kPoints + "( ( 0.5 0 0 ) ( 0 0.5 0 ) ) common/x 0 0 0\n}\n}\n") +
        "{\n\"classname\" \"light\"\n\"message\" \"\\\"x\\\"\"\n; quark\n}\n";
    const auto check = [](const std::string& t) {
        Context c;
        const Result<Document> d = read(t, c);
        if (!d) {
            EXPECT_EQ(d.fault().exit, Exit::input);
            return;
        }
        ASSERT_FALSE(d->entities.empty());
        for (const DocEntity& e : d->entities)
            for (const DocBrush& b : e.brushes) ASSERT_FALSE(b.sides.empty());
    };
    for (std::size_t n = 0; n < text.size(); ++n) check(text.substr(0, n));
    std::mt19937 random(4);
    const std::string nasty("\"{}()[]\n\r \t-+.e0/\\\x1B\xFF\0;", 23);
    for (int i = 0; i < 20000; ++i) {
        std::string t = text;
        for (unsigned k = random() % 4 + 1; k > 0; --k) {
            const std::size_t at = random() % t.size();
            switch (random() % 3) {
            case 0:
                t[at] = nasty[random() % nasty.size()];
                break;
            case 1:
                t.erase(at, random() % 20);
                break;
            default:
                t.insert(at, t.substr(random() % t.size(), random() % 30));
                break;
            }
            if (t.empty()) t = "x";
        }
        check(t);
    }
}

TEST(QuakeMap, RealMaps) {
    const std::filesystem::path root = std::filesystem::path(KILN_SOURCE_DIR) / ".." / "shared" / "maps";
    if (!std::filesystem::exists(root)) GTEST_SKIP() << "no real maps at " << root;
    int files = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
        if (entry.path().extension() != ".map") continue;
        ++files;
        std::ifstream stream(entry.path(), std::ios::binary);
        const std::string text((std::istreambuf_iterator<char>(stream)), {});
        const std::string name = entry.path().filename();
        Context c;
        const Result<Document> d = read(text, c);
        if (name == "curvetut-crash.map" || name == "weirdcurvemerge.map") { // bare lists of brushes
            ASSERT_FALSE(d) << name;
            EXPECT_EQ(d.fault().diagnostic.code, "brush-without-entity");
            continue;
        }
        ASSERT_TRUE(d) << name << to_text(d.fault().diagnostic);
        for (const Diagnostic& x : c.diagnostics()) ADD_FAILURE() << to_text(x);
        std::size_t brushes = 0, patches = 0;
        for (const DocEntity& e : d->entities) {
            brushes += e.brushes.size();
            patches += e.patches.size();
            EXPECT_EQ(e.skipped_primitives, 0u);
        }
        if (name == "spirit3ctfduel1.map") {
            EXPECT_EQ(patches, 402u);
        }
        if (name == "tiny_structural_brush.map") {
            EXPECT_EQ(brushes, 7u);
        }
        if (name == "e1m1.map") {
            EXPECT_EQ(brushes, 1257u);
        }
        if (name == "start.map") {
            EXPECT_EQ(brushes, 1274u);
        }
        if (name == "mixedFormats.map") {
            EXPECT_EQ(d->format, MapFormat::quake_mixed);
        }
    }
    EXPECT_GT(files, 80);
}

} // namespace
} // namespace kiln

#include "formats/vmf/vmf.h"
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <iterator>
#include <random>

namespace kiln {
namespace {

std::span<const std::uint8_t> bytes_of(const std::string& text) {
    return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}
Result<Document> read(const std::string& text, Context& context) {
    return read_vmf(bytes_of(text), "t.vmf", context);
}

std::string side(const std::string& plane, const std::string& more = "") {
    return "side { \"id\" \"7\" \"plane\" \"" + plane + "\" \"material\" \"DEV/A\" " + more + " }\n";
}
const std::string kPlane = "(0 0 0) (0 64 0) (64 0 0)";
std::string solid(const std::string& sides, int number = 2) {
    return "solid { \"id\" \"" + std::to_string(number) + "\"\n" + sides + "}\n";
}
std::string world(const std::string& inside) {
    return "world { \"id\" \"1\" \"classname\" \"worldspawn\"\n" + inside + "}\n";
}

std::size_t count(const Context& c, const std::string& code) {
    return static_cast<std::size_t>(std::ranges::count(c.diagnostics(), code, &Diagnostic::code));
}

TEST(Vmf, ReadsWorldEntitiesSidesAndPlaces) {
    const std::string text =
        "versioninfo\r\n{\r\n\t\"formatversion\" \"100\"\r\n}\r\n"
        "world\r\n{\r\n\t\"id\" \"1\"\r\n\t\"classname\" \"worldspawn\"\r\n\tsolid\r\n\t{\r\n\t\t\"id\" \"12\"\r\n"
        "\t\tside\r\n\t\t{\r\n\t\t\t\"id\" \"3\"\r\n\t\t\t\"plane\" \"(-16.5 176 136)(0 1e1 136) (0 -16 -0)\"\r\n"
        "\t\t\t\"material\" \"TOOLS/toolsnodraw\"\r\n\t\t\t\"uaxis\" \"[1 0 0 24]0.25\"\r\n"
        "\t\t\t\"vaxis\" \"[0 -1 4.00061e-005 -8] 0.5\"\r\n\t\t\t\"rotation\" \"0\"\r\n"
        "\t\t\t\"lightmapscale\" \"32\"\r\n\t\t\t\"smoothing_groups\" \"3\"\r\n\t\t\t\"mystery\" \"x\"\r\n"
        "\t\t\tvertices_plus\r\n\t\t\t{\r\n\t\t\t\t\"v\" \"1 2 3.5\"\r\n\t\t\t\t\"v\" \"-4 5 6\"\r\n\t\t\t}\r\n"
        "\t\t}\r\n\t\teditor\r\n\t\t{\r\n\t\t\t\"color\" \"0 1 2\"\r\n\t\t}\r\n\t}\r\n}\r\n"
        "entity\r\n{\r\n\t\"id\" \"44\"\r\n\t\"classname\" \"caf\xE9\"\r\n\tconnections\r\n\t{\r\n"
        "\t\t\"OnTrigger\" \"a\x1B"
        "b\x1B"
        "c\"\r\n\t\t\"OnTrigger\" \"second\"\r\n\t}\r\n}\r\n";
    Context c;
    const Result<Document> d = read(text, c);
    ASSERT_TRUE(d) << to_text(d.fault().diagnostic);
    EXPECT_TRUE(c.diagnostics().empty());
    ASSERT_EQ(d->entities.size(), 2u);
    ASSERT_EQ(d->entities[0].brushes.size(), 1u);
    const DocBrush& b = d->entities[0].brushes[0];
    EXPECT_EQ(b.id, 12);
    EXPECT_EQ(b.line, 9);
    ASSERT_EQ(b.sides.size(), 1u);
    const DocSide& s = b.sides[0];
    EXPECT_EQ(s.id, 3);
    EXPECT_EQ(s.points[0][0].to_double(), -16.5);
    EXPECT_EQ(s.points[1][1].to_double(), 10);
    EXPECT_EQ(s.points[2][2].mantissa, 0);
    EXPECT_EQ(s.material, "TOOLS/toolsnodraw");
    EXPECT_EQ(s.texture.u_shift, 24);
    EXPECT_EQ(s.texture.u_scale, 0.25);
    EXPECT_EQ(s.texture.v_axis, (Vec3{0, -1, 4.00061e-005}));
    EXPECT_EQ(s.lightmap_scale, 32);
    EXPECT_EQ(s.smoothing_groups, 3u);
    EXPECT_EQ(s.displacement, 0);
    EXPECT_EQ(s.vertices, (std::vector<Vec3>{{1, 2, 3.5}, {-4, 5, 6}}));
    ASSERT_EQ(s.extra.size(), 1u);
    EXPECT_EQ(s.extra[0].key, "mystery");
    const DocEntity& e = d->entities[1];
    EXPECT_EQ(e.id, 44);
    ASSERT_EQ(e.keys.size(), 3u);
    EXPECT_EQ(e.keys[0].value, "caf\xE9");
    EXPECT_EQ(e.keys[1].value, "a\x1B"
                               "b\x1B"
                               "c");
    EXPECT_EQ(e.keys[2].value, "second");
}

TEST(Vmf, HiddenIsSkippedEverywhere) {
    Context c;
    const Result<Document> d =
        read(world("hidden { " + solid(side(kPlane)) + " }" + solid(side(kPlane), 5)) +
                 "hidden { entity { \"classname\" \"light\" } }\n entity { \"classname\" \"x\" hidden { " +
                 solid(side(kPlane)) + "} }",
             c);
    ASSERT_TRUE(d);
    ASSERT_EQ(d->entities.size(), 2u);
    ASSERT_EQ(d->entities[0].brushes.size(), 1u);
    EXPECT_EQ(d->entities[0].brushes[0].id, 5);
    EXPECT_TRUE(d->entities[1].brushes.empty());
    ASSERT_EQ(c.diagnostics().size(), 1u); // told once, with the numbers
    EXPECT_EQ(c.diagnostics()[0].code, "hidden-skipped");
    EXPECT_EQ(c.diagnostics()[0].severity, Severity::note);
    EXPECT_TRUE(c.diagnostics()[0].message.starts_with("1 entities and 2 solids")) << c.diagnostics()[0].message;
}

// Visgroups that are switched off wrap their objects in `hidden`; the marks in `editor` alone mean nothing.
TEST(Vmf, EditorMarksHideNothing) {
    const std::string editor = "editor { \"visgroupshown\" \"0\" \"visgroupautoshown\" \"0\" }";
    Context c;
    const Result<Document> d =
        read(world("solid { \"id\" \"2\" " + side(kPlane) + editor + "}") + "entity { \"classname\" \"light\" " + editor + "}", c);
    ASSERT_TRUE(d);
    EXPECT_TRUE(c.diagnostics().empty());
    EXPECT_EQ(d->entities[0].brushes.size(), 1u);
    EXPECT_EQ(d->entities.size(), 2u);
}

TEST(Vmf, CordonsOfBothKinds) {
    const struct {
        std::string text;
        std::vector<std::pair<std::string, bool>> cordons; // name, active
    } cases[] = {
        {"cordon { \"mins\" \"(-1 -2 -3)\" \"maxs\" \"(4 5 6)\" \"active\" \"1\" }", {{"", true}}},
        {"cordon { \"mins\" \"(-1 -2 -3)\" \"maxs\" \"(4 5 6)\" \"active\" \"0\" }", {{"", false}}},
        {"cordons { \"active\" \"0\" }", {}},
        {"cordons { \"active\" \"1\" cordon { \"name\" \"a\" \"active\" \"1\" box { \"mins\" \"(-1 -2 -3)\" \"maxs\" \"(4 5 6)\" } }\n"
         "cordon { \"name\" \"b\" \"active\" \"0\" box { \"mins\" \"(-1 -2 -3)\" \"maxs\" \"(4 5 6)\" } } }",
         {{"a", true}, {"b", false}}},
        // Two boxes of one cordon; the state of them all stands last.
        {"cordons { cordon { \"name\" \"a\" \"active\" \"1\" box { \"mins\" \"(-1 -2 -3)\" \"maxs\" \"(4 5 6)\" } "
         "box { \"mins\" \"(-1 -2 -3)\" \"maxs\" \"(4 5 6)\" } } \"active\" \"0\" }",
         {{"a", false}, {"a", false}}},
    };
    for (const auto& k : cases) {
        Context c;
        const Result<Document> d = read(world("") + k.text, c);
        ASSERT_TRUE(d) << k.text;
        EXPECT_TRUE(c.diagnostics().empty()) << k.text << to_text(c.diagnostics()[0]);
        ASSERT_EQ(d->cordons.size(), k.cordons.size()) << k.text;
        for (std::size_t i = 0; i < k.cordons.size(); ++i) {
            EXPECT_EQ(std::pair(d->cordons[i].name, d->cordons[i].active), k.cordons[i]);
            EXPECT_EQ(d->cordons[i].box, (Box3{{-1, -2, -3}, {4, 5, 6}}));
        }
    }
    for (const char* text : {"cordon { }", "cordon { \"mins\" \"(1 2)\" \"maxs\" \"(4 5 6)\" }",
                             "cordons { cordon { box { \"mins\" \"(5 2 3)\" \"maxs\" \"(4 5 6)\" } } }"}) {
        Context c;
        const Result<Document> d = read(world("") + "\n" + text, c);
        ASSERT_TRUE(d);
        EXPECT_TRUE(d->cordons.empty());
        ASSERT_EQ(count(c, "cordon-invalid"), 1u) << text;
        EXPECT_EQ(c.diagnostics()[0].where.line, 4) << text;
    }
}

TEST(Vmf, VerticesPlusThatCannotBeReadAreLeftOut) {
    Context c;
    const Result<Document> d = read(world(solid(side(kPlane, "vertices_plus { \"v\" \"1 2 3\" \"v\" \"1 2e5 3\" \"v\" \"x\" }"))), c);
    ASSERT_TRUE(d);
    ASSERT_EQ(d->entities[0].brushes.size(), 1u);
    EXPECT_TRUE(d->entities[0].brushes[0].sides[0].vertices.empty());
    EXPECT_EQ(count(c, "vertices-plus-invalid"), 1u);
}

TEST(Vmf, MisplacedBlocksAreTold) {
    Context c;
    const Result<Document> d = read(world("entity { \"classname\" \"light\" }") + solid(side(kPlane)), c);
    ASSERT_TRUE(d);
    EXPECT_EQ(d->entities.size(), 1u);
    EXPECT_EQ(count(c, "block-misplaced"), 2u);
}

// Unusual text: what is read, and the code where something is amiss.
TEST(Vmf, UnusualText) {
    const std::string good = world(solid(side(kPlane)));
    std::string cr = good, crlf;
    for (char& ch : cr) ch = ch == '\n' ? '\r' : ch;
    for (const char ch : good) crlf += ch == '\n' ? "\r\n" : std::string(1, ch);
    const struct {
        std::string text, code; // "": nothing to tell, one brush
    } cases[] = {
        {good, ""},
        {cr, ""},
        {"// a comment\r" + cr, ""},
        {crlf, ""},
        {"\xEF\xBB\xBF" + good, ""},
        {good + std::string(3, '\0'), ""},
        {"\t\v\f world\t{\tsolid\t{" + side(kPlane) + "\t}\t}", ""},
        {"world { classname worldspawn solid { id 2 side { id 7 \"plane\" \"" + kPlane + "\" material DEV/A } } }", ""},
        {world(solid(side("(+0 -0 .0) (0. 64.000 0e0) (6.4e1 0 0)"))), ""},
        {world(solid(side("( 0 0 0 )( 0 64 0 )( 64 0 1e-400 )"))), ""},
        {world(solid(side(kPlane, "\"" + std::string(300, 'k') + "\" \"" + std::string(3000000, 'v') + "\""))), ""},
        {world(solid(side("(0 0 0) (0 64 0) (64 0 1e400)"))), "coordinate-out-of-range"},
        {world(solid(side("(0 0 0) (0 64 0) (64 0 0x10)"))), "coordinate-not-a-number"},
        {world(solid(side("(0 0 0) (0 64 0) (64 0 --1)"))), "coordinate-not-a-number"},
        {world(solid(side("(0 0 0) (0 64 0) (64 0 1e)"))), "coordinate-not-a-number"},
        {world(solid(side("(0 0 0) (0 64 0) (64 0 1,5)"))), "coordinate-not-a-number"},
        {world(solid(side("(0 0 0) (0 64 0) (64 0 0) 7"))), "plane-unreadable"},
        {world(solid(side(""))), "plane-unreadable"},
    };
    for (const auto& k : cases) {
        Context c;
        const Result<Document> d = read(k.text, c);
        ASSERT_TRUE(d) << k.text.substr(0, 200) << to_text(d.fault().diagnostic);
        EXPECT_EQ(d->entities[0].brushes.size(), k.code.empty() ? 1u : 0u) << k.text.substr(0, 200);
        ASSERT_EQ(c.diagnostics().size(), k.code.empty() ? 0u : 1u) << k.text.substr(0, 200);
        for (const Diagnostic& x : c.diagnostics()) {
            EXPECT_EQ(x.code, k.code);
            EXPECT_EQ(x.where, (SourceLocation{"t.vmf", 3, 1, 2, 7}));
        }
    }
}

TEST(Vmf, AMillionEntities) {
    std::string text = world(solid(side(kPlane)));
    for (int i = 0; i < 1000000; ++i) text += "entity{\"classname\" \"light\"}\n";
    Context c;
    const Result<Document> d = read(text, c);
    ASSERT_TRUE(d);
    EXPECT_EQ(d->entities.size(), 1000001u);
    EXPECT_EQ(d->entities.back().line, 1000005);
}

TEST(Vmf, WorldComesFirstWhereverItStands) {
    Context c;
    const Result<Document> d = read("entity { \"classname\" \"light\" }\n" + world(""), c);
    ASSERT_TRUE(d);
    EXPECT_EQ(d->entities[0].get("classname"), "worldspawn");
    EXPECT_EQ(d->entities[1].get("classname"), "light");
}

TEST(Vmf, FaultySidesLeaveTheirSolidOutAndAreAllTold) {
    const struct {
        std::string side, code;
    } cases[] = {
        {side("(0 0 0) (0 64 0)"), "plane-unreadable"},
        {side("(0 0 0) (0 64 nan) (64 0 0)"), "coordinate-not-a-number"},
        {side("(0 0 0) (0 64 inf) (64 0 0)"), "coordinate-not-a-number"},
        {side("(0 0 0) (0 64 1e9) (64 0 0)"), "coordinate-out-of-range"},
        {side("(0 0 0) (0 64 131072.5) (64 0 0)"), "coordinate-out-of-range"},
        {"side { \"id\" \"7\" \"material\" \"A\" }\n", "plane-missing"},
    };
    std::string all;
    for (const auto& k : cases) all += solid(k.side);
    all += solid("") + solid(side(kPlane), 9);
    Context c;
    const Result<Document> d = read(world(all), c);
    ASSERT_TRUE(d);
    ASSERT_EQ(d->entities[0].brushes.size(), 1u);
    EXPECT_EQ(d->entities[0].brushes[0].id, 9);
    for (const auto& k : cases) EXPECT_GE(count(c, k.code), 1u) << k.code;
    EXPECT_EQ(count(c, "brush-without-sides"), 1u);
    EXPECT_EQ(c.diagnostics().size(), 7u);
    for (const Diagnostic& x : c.diagnostics()) {
        EXPECT_EQ(x.severity, Severity::error);
        EXPECT_GT(x.where.line, 0);
        EXPECT_EQ(x.where.brush, 2);
        EXPECT_EQ(x.where.entity, 1);
    }
}

TEST(Vmf, TextureFaultsAreMended) {
    Context c;
    const Result<Document> d = read(
        world(solid(side(kPlane, "\"uaxis\" \"[1 0 0 0] 1e-31\" \"vaxis\" \"[0 nan 0 0] 1\" \"vaxis\" \"[0 1e31 0 0] 1\" \"lightmapscale\" \"0\" \"material\" \"\""))),
        c);
    ASSERT_TRUE(d);
    ASSERT_EQ(d->entities[0].brushes.size(), 1u);
    const DocSide& s = d->entities[0].brushes[0].sides[0];
    EXPECT_EQ(s.texture.u_scale, 1);
    EXPECT_EQ(s.lightmap_scale, 16);
    EXPECT_EQ(count(c, "texture-scale-zero"), 1u);
    EXPECT_EQ(count(c, "texture-axis-unreadable"), 2u);
    EXPECT_EQ(count(c, "material-missing"), 1u);
    EXPECT_EQ(count(c, "lightmap-scale-invalid"), 1u);
}

TEST(Vmf, BadFilesGiveLocatedFaults) {
    const struct {
        std::string text, code;
        int line;
    } cases[] = {
        {"", "empty-file", 1},
        {std::string("\x7F"
                     "ELF\0\1\2",
                     7),
         "not-text", 1},
        {"hello world", "syntax", 1},
        {"world\n{\n\"id\" \"1\"\n", "unbalanced-braces", 2},
        {"entity { \"classname\" \"light\" }", "no-world", 1},
        {world("") + "}", "unbalanced-braces", 3},
        {"world\n{\n\"id\" \"1\n}\n", "string-unterminated", 3},
        {"world { \"lonely\" }", "syntax", 1},
        {"{ }", "syntax", 1},
    };
    for (const auto& k : cases) {
        Context c;
        const Result<Document> d = read(k.text, c);
        ASSERT_FALSE(d) << k.text;
        EXPECT_EQ(d.fault().exit, Exit::input);
        EXPECT_EQ(d.fault().diagnostic.code, k.code) << k.text;
        EXPECT_EQ(d.fault().diagnostic.where.line, k.line) << k.text;
        EXPECT_EQ(d.fault().diagnostic.where.file, "t.vmf");
    }
}

TEST(Vmf, NestingAndErrorsAreBounded) {
    std::string deep;
    for (int i = 0; i < 300000; ++i) deep += "a{";
    Context c;
    EXPECT_FALSE(read(deep, c));
    Context c2;
    EXPECT_FALSE(read(std::string(300000, '{'), c2));
    EXPECT_LE(c2.diagnostics().size(), 51u);
}

// Every truncation and many single-byte changes: a document or a fault, and never a brush without sides.
TEST(Vmf, DamagedFilesNeverCrash) {
    const std::string text =
        world(solid(side(kPlane, "\"uaxis\" \"[1 0 0 0] 0.25\"") + side("(0 0 1e3) (0 -64.5 0) (64 0 0)"))) +
        "entity { \"id\" \"3\" \"classname\" \"func_detail\" connections { \"a\" \"b\" }\n" +
        solid(side(kPlane, "dispinfo { \"power\" \"2\" }")) + "} // end\n";
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
    std::mt19937 random(3);
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

// Counts that the maps' authors publish (and, for the others, that none is refused).
TEST(Vmf, RealMaps) {
    const std::filesystem::path root = std::filesystem::path(KILN_SOURCE_DIR) / ".." / "shared" / "maps";
    if (!std::filesystem::exists(root)) GTEST_SKIP() << "no real maps at " << root;
    int files = 0;
    std::size_t all_displacements = 0;
    // Lines that hold this word and nothing else.
    const auto count_lines = [](const std::string& text, std::string_view word) {
        std::size_t n = 0;
        for (std::size_t at = 0; at < text.size();) {
            const std::size_t end = std::min(text.find('\n', at), text.size());
            std::string_view line = std::string_view(text).substr(at, end - at);
            while (!line.empty() && (line.front() == '\t' || line.front() == ' ')) line.remove_prefix(1);
            while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.remove_suffix(1);
            n += line == word;
            at = end + 1;
        }
        return n;
    };
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
        if (entry.path().extension() != ".vmf") continue;
        ++files;
        std::ifstream stream(entry.path(), std::ios::binary);
        const std::string text((std::istreambuf_iterator<char>(stream)), {});
        Context c;
        const Result<Document> d = read(text, c);
        ASSERT_TRUE(d) << entry.path() << to_text(d.fault().diagnostic);
        for (const Diagnostic& x : c.diagnostics()) EXPECT_EQ(x.code, "hidden-skipped") << to_text(x);
        std::size_t brushes = 0, sides = 0, displaced = 0, with_vertices = 0;
        for (const DocEntity& e : d->entities) {
            brushes += e.brushes.size();
            for (const DocBrush& b : e.brushes) {
                sides += b.sides.size();
                for (const DocSide& s : b.sides) displaced += s.displacement >= 0, with_vertices += s.vertices.size() >= 3;
            }
        }
        EXPECT_EQ(displaced, count_lines(text, "dispinfo")) << entry.path();
        EXPECT_EQ(d->displacements.size(), displaced) << entry.path();
        EXPECT_EQ(with_vertices, count_lines(text, "vertices_plus")) << entry.path();
        all_displacements += displaced;
        for (const DocDisplacement& grid : d->displacements) {
            const std::size_t n = static_cast<std::size_t>((1 << grid.power) + 1) * static_cast<std::size_t>((1 << grid.power) + 1);
            EXPECT_EQ(grid.normals.size(), n);
            EXPECT_EQ(grid.distances.size(), n);
            EXPECT_EQ(grid.alphas.size(), n);
            EXPECT_EQ(grid.triangle_tags.size(), std::size_t{2} << (2 * grid.power));
            EXPECT_EQ(grid.allowed_vertices.size(), 10u);
        }
        const std::string name = entry.path().filename();
        if (name == "lambda_bunker_v2.vmf") {
            EXPECT_EQ(std::pair(brushes, sides), std::pair(std::size_t{377}, std::size_t{2335}));
        }
        if (name == "racetrak.vmf") {
            EXPECT_EQ(std::pair(brushes, sides), std::pair(std::size_t{286}, std::size_t{1714}));
        }
        if (name == "skybox.vmf") {
            EXPECT_EQ(std::pair(brushes, sides), std::pair(std::size_t{11}, std::size_t{66}));
        }
        if (name == "newmap.vmf") {
            EXPECT_EQ(std::pair(brushes, sides), std::pair(std::size_t{6}, std::size_t{36}));
        }
    }
    EXPECT_EQ(files, 27);
    EXPECT_EQ(all_displacements, 1049u);
}

} // namespace
} // namespace kiln

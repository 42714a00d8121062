#include "formats/document/document.h"
#include "formats/document/side_text.h"
#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <gtest/gtest.h>
#include <random>

namespace kiln {
namespace {

TEST(Document, LooksUpTheFirstKeyIgnoringCase) {
    DocEntity e;
    e.keys = {{"ClassName", "light", 1}, {"light", "300", 2}, {"classname", "other", 3}, {"origin", "1 -2 3.5", 4},
              {"bad", "1 2", 5},         {"word", "abc", 6},  {"padded", "  7 ", 7},     {"evil", "nan", 8}};
    EXPECT_EQ(e.get("classname"), "light");
    EXPECT_EQ(e.get("missing", "x"), "x");
    EXPECT_EQ(e.number("light", 0), 300);
    EXPECT_EQ(e.number("word", 5), 5);
    EXPECT_EQ(e.number("padded", 5), 7);
    EXPECT_EQ(e.number("evil", 5), 5);
    EXPECT_EQ(e.vector("origin", {}), (Vec3{1, -2, 3.5}));
    EXPECT_EQ(e.vector("bad", {9, 9, 9}), (Vec3{9, 9, 9}));
    EXPECT_EQ(e.find("missing"), nullptr);
}

TEST(Document, NumbersStopAtTheFirstWordThatIsNone) {
    bool complete = true;
    EXPECT_EQ(parse_numbers("1 2\t3 x 4", &complete), (std::vector<double>{1, 2, 3}));
    EXPECT_FALSE(complete);
    EXPECT_EQ(parse_numbers(" +1.5  -2e1 ", &complete), (std::vector<double>{1.5, -20}));
    EXPECT_TRUE(complete);
    EXPECT_TRUE(parse_numbers("", &complete).empty());
    EXPECT_TRUE(complete);
    for (const char* text : {"inf", "nan", "1e999", "+-1", "0x10"}) EXPECT_FALSE(parse_number(text)) << text;
}

// Every text that the standard library reads whole comes out as its double, however many digits it has.
TEST(Document, NumbersAreTheNearestDoubles) {
    std::mt19937_64 random(9);
    const char* formats[] = {"%.0f", "%.1f", "%.6f", "%g", "%.9g", "%.17g", "%.21g", "%.25f", "%a"};
    for (int i = 0; i < 100000; ++i) {
        double x = std::ldexp(static_cast<double>(random()) - 9e18, static_cast<int>(random() % 60) - 70);
        if (i % 50 == 0) x = std::bit_cast<double>(random());
        if (!std::isfinite(x)) continue;
        char text[800];
        std::snprintf(text, sizeof text, formats[random() % std::size(formats)], x);
        const std::optional<double> read = parse_number(text);
        if (std::strchr(text, 'x')) {
            EXPECT_FALSE(read) << text;
            continue;
        }
        ASSERT_TRUE(read) << text;
        EXPECT_EQ(std::bit_cast<std::uint64_t>(*read), std::bit_cast<std::uint64_t>(std::strtod(text, nullptr))) << text;
    }
    EXPECT_EQ(parse_number("1e-400"), 0); // too small to tell from zero
    EXPECT_TRUE(std::signbit(parse_number("-0").value()));
    for (const char* text : {"", " ", "1 2", ".", "-", "1e", "1e+", "e5", "1.2.3", "--1", "+-1", "1e999", "-inf", "0x10"}) EXPECT_FALSE(parse_number(text)) << text;
}

TEST(Document, WordsEndAtBracketsAndBlanks) {
    std::array<std::string_view, 3> words;
    EXPECT_EQ(split_words(" [a b](c\t)\r\n", words), 3u);
    EXPECT_EQ(words, (std::array<std::string_view, 3>{"a", "b", "c"}));
    EXPECT_EQ(split_words("a b c d e", words), 4u); // one more than there is room for
    EXPECT_EQ(split_words("()[]", words), 0u);
    std::array<double, 3> n{};
    EXPECT_TRUE(read_numbers("(1 -2.5 3e2)", n));
    EXPECT_EQ(n, (std::array<double, 3>{1, -2.5, 300}));
    for (const char* text : {"", "1 2", "1 2 3 4", "1 2 x", "1 2 3 x", "1 2 1e400"}) EXPECT_FALSE(read_numbers(text, n)) << text;
    EXPECT_EQ(read_integer("-3.9"), -3);
    EXPECT_FALSE(read_integer("1e17"));
}

TEST(Document, CarriageReturnsAloneAreLineBreaks) {
    std::string storage;
    for (const std::string_view kept : {"a\r\nb", "a\nb\rc", "abc"}) {
        std::string_view text = kept;
        unify_line_breaks(text, storage);
        EXPECT_EQ(text, kept);
    }
    std::string_view text = "a\rb\r";
    unify_line_breaks(text, storage);
    EXPECT_EQ(text, "a\nb\n");
}

TEST(Document, BytesComeBack) {
    Document d;
    d.file = "x.map";
    d.entities.emplace_back();
    d.entities[0].keys = {{"a", "b", 3}};
    d.entities[0].brushes.emplace_back();
    d.entities[0].brushes[0].sides.resize(2);
    d.entities[0].brushes[0].sides[1].points[2][1] = {15, -1, true};
    d.entities[0].patches.push_back({.line = 3, .id = 1, .material = "m", .columns = 3, .rows = 3, .points = {{1, 2, 3}}, .uv = {{4, 5}}});
    DocDisplacement& grid = d.displacements.emplace_back();
    grid.power = 2, grid.normals = {{0, 0, 1}}, grid.triangle_tags = {9}, grid.multiblend_colors = {{}}, grid.allowed_vertices = {-1};
    d.cordons.push_back({5, "c", true, {{0, 0, 0}, {1, 1, 1}}});
    const Bytes bytes = to_bytes(d);
    EXPECT_EQ(to_bytes(from_bytes<Document>(bytes)), bytes);
}

TEST(Document, ForeignTextIsShownHarmlessly) {
    EXPECT_EQ(shown("a\x1B[31m\xFF"), "a?[31m?");
    EXPECT_EQ(shown(std::string(100, 'x')).size(), 43u);
}

TEST(Document, BytesThatAreNoTextAreRefused) {
    for (const std::string_view bytes : {std::string_view(""), std::string_view("\0\0", 2),
                                         std::string_view("a\0b", 3), std::string_view("\xFF\xFEw\0", 4)}) {
        std::string_view text = bytes;
        const std::optional<Fault> f = reject_non_text(text, "x.vmf");
        ASSERT_TRUE(f);
        EXPECT_EQ(f->exit, Exit::input);
        EXPECT_EQ(f->diagnostic.where.file, "x.vmf");
    }
    std::string_view good("\xEF\xBB\xBFworld\0", 9);
    EXPECT_FALSE(reject_non_text(good, "x.vmf"));
    EXPECT_EQ(good, "world");
}

} // namespace
} // namespace kiln

#include "formats/document/document.h"
#include "formats/document/side_text.h"
#include <gtest/gtest.h>

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

TEST(Document, BytesComeBack) {
    Document d;
    d.file = "x.map";
    d.entities.emplace_back();
    d.entities[0].keys = {{"a", "b", 3}};
    d.entities[0].brushes.emplace_back();
    d.entities[0].brushes[0].sides.resize(2);
    d.entities[0].brushes[0].sides[1].points[2][1] = {15, -1, true};
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

// `kiln bench light` as one would type it.
#include "tests/support/program.h"

using namespace kiln::test;

namespace {
const char* kFew[] = {"--points", "20", "--truth-rounds", "1", "--truth-noise", "50", "--targets", "20", "--lit", "20"};
std::vector<std::string> words(std::initializer_list<std::string> more) {
    std::vector<std::string> w{"bench", "light"};
    w.insert(w.end(), std::begin(kFew), std::end(kFew));
    w.insert(w.end(), more);
    return w;
}
} // namespace

TEST(BenchLight, WritesTableChartAndPage) {
    const Workplace at;
    const std::string map = at.write("lit.map", lit_room());
    const Outcome o = at.run(words({map, "--methods", "kiln,hemicube", "--max-cpu", "1", "-o", at.path("out")}));
    EXPECT_EQ(o.code, 0) << o.said;
    for (const char* file : {"out/light.csv", "out/light_lit.svg", "out/light.html"}) EXPECT_TRUE(at.has(file)) << file;
    EXPECT_NE(o.out.find("hemicube"), std::string::npos);
    EXPECT_EQ(o.out.find("light-cut"), std::string::npos);
}

TEST(BenchLight, SaysWhatIsWrong) {
    const Workplace at;
    EXPECT_EQ(at.run(words({"cornell", "--methods", "lightcut"})).code, 2);
    EXPECT_EQ(at.run(words({at.path("none.map"), "-o", at.path("out")})).code, 3);
    // A scene of the list without its map is left out.
    const Outcome o = at.run(words({"tube", "--root", at.path(""), "-o", at.path("out")}));
    EXPECT_EQ(o.code, 0) << o.said;
    EXPECT_NE(o.said.find("left out"), std::string::npos);
}

// Against the stored front: what costs as much as it did passes, a front that no bake could keep to fails.
TEST(BenchLight, ShortRunHoldsAgainstTheFront) {
    const Workplace at;
    const std::string map = at.write("lit.map", lit_room()), front = at.path("front.csv");
    const auto run = [&](const char* what) { return at.run({"bench", "light", map, what, "--targets", "20", "--front", front, "-o", at.path("out")}); };
    EXPECT_EQ(run("--short").code, 3); // there is none
    EXPECT_EQ(run("--update-front").code, 0);
    ASSERT_TRUE(at.has("front.csv"));
    at.write("front.csv", std::string("scene,target_percent,error_percent,cost_million_rays\nlit,20,50,1e6\n"));
    EXPECT_EQ(run("--short").code, 0);
    at.write("front.csv", std::string("scene,target_percent,error_percent,cost_million_rays\nlit,20,50,1e-6\n"));
    const Outcome dearer = run("--short");
    EXPECT_EQ(dearer.code, 6);
    EXPECT_NE(dearer.said.find("dearer-light"), std::string::npos);
    at.write("front.csv", "scene\nlit,x\n");
    EXPECT_EQ(run("--short").code, 3);
}

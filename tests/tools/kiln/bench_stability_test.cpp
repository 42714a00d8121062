// `kiln bench stability` as one would type it.
#include "tests/support/program.h"

using namespace kiln::test;

TEST(BenchStability, WritesTableChartAndPage) {
    const Workplace at;
    const Outcome o = at.run({"bench", "stability", "F13", "--short", "--bake-only", "-o", at.path("out")});
    EXPECT_EQ(o.code, 0) << o.said;
    for (const char* file : {"out/stability_F13.csv", "out/stability_F13.svg", "out/stability.html"}) EXPECT_TRUE(at.has(file)) << file;
    EXPECT_NE(o.out.find("F13"), std::string::npos);
    EXPECT_EQ(o.out.find("plain lattice"), std::string::npos);
}

TEST(BenchStability, SaysWhatIsWrong) {
    const Workplace at;
    const Outcome o = at.run({"bench", "stability", "F15", "-o", at.path("out")});
    EXPECT_EQ(o.code, 2);
    EXPECT_NE(o.said.find("F16"), std::string::npos);
    EXPECT_EQ(at.run({"bench", "stability", "F13", "--short", "-o", at.write("file", "") + "/out"}).code, 8);
}

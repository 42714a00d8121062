#include "formats/mesh/obj.h"
#include <gtest/gtest.h>
#include <sstream>

namespace kiln {
namespace {

TEST(Obj, NumbersReadBackToTheLastBitAndVerticesAreShared) {
    const double odd = 0.1 + 0.2;
    std::vector<ObjPolygon> polygons = {
        {"a", "g 1", "wood", {{odd, -0.0, 1e-300}, {1, 0, 0}, {0, 131072.0009765625, 0}}, {{0, 0}, {1, 0}, {0, 1}}, {}},
        {"a", "g 1", "wood", {{1, 0, 0}, {odd, 0, 1e-300}, {5, 5, 5}, {6, 6, 6}}, {}, {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}}},
        {"a", "g 2", "a b\nc", {{1, 0, 0}, {odd, 0, 1e-300}, {5, 5, 5}}, {}, {}},
    };
    std::istringstream in(write_obj(polygons, "lib.mtl", "made by\na test"));
    std::vector<std::array<double, 3>> v;
    std::vector<std::string> faces, groups, materials;
    for (std::string line; std::getline(in, line);) {
        std::istringstream words(line);
        std::string key, word;
        words >> key;
        if (key == "v") {
            std::array<double, 3> p{};
            for (double& x : p) words >> word, x = std::stod(word == "1e-300" ? "1e-300" : word);
            v.push_back(p);
        } else if (key == "f") {
            faces.push_back(line);
        } else if (key == "g") {
            groups.push_back(line);
        } else if (key == "usemtl") {
            materials.push_back(line);
        } else {
            EXPECT_TRUE(key == "#" || key == "mtllib" || key == "o" || key == "vt" || key == "vn") << line;
        }
    }
    ASSERT_EQ(v.size(), 5u); // -0 and 0 are one place
    EXPECT_EQ(v[0], (std::array<double, 3>{odd, 0, 1e-300}));
    EXPECT_EQ(v[2][1], 131072.0009765625);
    EXPECT_EQ(faces, (std::vector<std::string>{"f 1/1 2/2 3/3", "f 2//1 1//1 4//1 5//1", "f 2 1 4"}));
    EXPECT_EQ(groups, (std::vector<std::string>{"g g 1", "g g 2"}));
    EXPECT_EQ(materials, (std::vector<std::string>{"usemtl wood", "usemtl a_b_c"}));
}

TEST(Obj, EachMaterialOnce) {
    EXPECT_EQ(write_mtl({{"a b", {0.5f, 0, 0.25f}, {}, 1, "x.png"}, {"a b", {}, {}, 1, ""}, {"glow", {0, 0, 0}, {2, 0, 0}, 0.5f, ""}}),
              "newmtl a_b\nKd 0.5 0 0.25\nmap_Kd x.png\n\nnewmtl glow\nKd 0 0 0\nKe 2 0 0\nd 0.5\n\n");
}

} // namespace
} // namespace kiln

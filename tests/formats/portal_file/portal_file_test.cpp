#include "formats/portal_file/portal_file.h"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <random>

namespace kiln {
namespace {

std::span<const std::uint8_t> bytes_of(const std::string& text) {
    return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}
std::string fault_of(const std::string& text) {
    const auto r = read_portal_file(bytes_of(text), "x.prt");
    return r ? "" : r.fault().diagnostic.code;
}

const PortalFile kThree{3,
                        {{0, 1, {{0, 0, 0}, {64, 0, 0}, {64, 0, 64}, {0, 0, 64}}},
                         {2, 1, {{0.125, 0, 0.1}, {1e-7, 3, 1.0 / 3}, {-1234.5, 0, 64}}}},
                        {}};

TEST(PortalFile, WritesWhatOtherToolsRead) {
    // Counter-clockwise seen from -y (cluster 0) in memory, clockwise in the text.
    EXPECT_EQ(write_portal_file({2, {{0, 1, {{0, 0, 0}, {64, 0, 0}, {64, 0, 64.5}, {0, -0.0, 64.5}}}}, {}}),
              "PRT1\n2\n1\n4 0 1 (0 0 0 ) (0 0 64.5 ) (64 0 64.5 ) (64 0 0 ) \n");
}

TEST(PortalFile, ReadsWhatItWrote) {
    PortalFile file = kThree;
    EXPECT_EQ(*read_portal_file(bytes_of(write_portal_file(file)), "x.prt"), file);
    file.leaf_cluster = {1, 0, 2, 1, 1};
    EXPECT_EQ(write_portal_file(file).substr(0, 11), "PRT2\n5\n3\n2\n");
    EXPECT_EQ(*read_portal_file(bytes_of(write_portal_file(file)), "x.prt"), file);
    file = {};
    EXPECT_EQ(*read_portal_file(bytes_of(write_portal_file(file)), "x.prt"), file);
}

TEST(PortalFile, ReadsDialects) {
    const auto am = read_portal_file(
        bytes_of("PRT1-AM\r\n2\r\n1\r\n3\r\n3 0 1 h (0 0 0) (1 0 0) (0 1e0 0 )\r\n0\r\n1\r\n1\r\n"), "x.prt");
    ASSERT_TRUE(am);
    EXPECT_EQ(am->leaf_cluster, (std::vector<std::uint32_t>{0, 1, 1}));
    EXPECT_TRUE(am->portals[0].hint);
    EXPECT_EQ(am->portals[0].winding, (std::vector<Vec3>{{0, 0, 0}, {0, 1, 0}, {1, 0, 0}}));
}

TEST(PortalFile, RefusesWithTheLine) {
    EXPECT_EQ(fault_of(""), "portal-file-magic");
    EXPECT_EQ(fault_of("PRT9\n1\n0\n"), "portal-file-magic");
    EXPECT_EQ(fault_of("PRT1\n"), "portal-file-truncated");
    EXPECT_EQ(fault_of("PRT1\n2\n4000000000\n"), "portal-file-truncated");
    EXPECT_EQ(fault_of("PRT2\n4000000000\n0\n0\n"), "portal-file-truncated");
    EXPECT_EQ(fault_of("PRT1\n2\n1\n3 0 2 (0 0 0 ) (1 0 0 ) (0 1 0 )\n"), "portal-file-cluster");
    EXPECT_EQ(fault_of("PRT1\n2\n1\n2 0 1 (0 0 0 ) (1 0 0 )\n"), "portal-file-winding");
    EXPECT_EQ(fault_of("PRT1\n2\n1\n4000000000 0 1 (0 0 0 )\n"), "portal-file-truncated");
    EXPECT_EQ(fault_of("PRT1\n2\n1\n3 0 1 (0 0 nan ) (1 0 0 ) (0 1 0 )\n"), "portal-file-syntax");
    EXPECT_EQ(fault_of("PRT1\n2\n0\nmore"), "portal-file-syntax");
    EXPECT_EQ(fault_of("PRT2\n1\n1\n0\n-1\n"), "portal-file-cluster"); // leaf 0 has no cluster
    const auto r = read_portal_file(bytes_of("PRT1\n2\n1\n3 0 1 (0 0 0 )\n(1 0 x ) (0 1 0 )\n"), "a/x.prt");
    ASSERT_FALSE(r);
    EXPECT_EQ(r.fault().diagnostic.where.line, 5);
    EXPECT_EQ(r.fault().diagnostic.where.file, "a/x.prt");
    EXPECT_EQ(r.fault().exit, Exit::input);
}

// Damaged text is refused or read; it never crashes, and what is read can be written.
TEST(PortalFile, DamagedText) {
    PortalFile file = kThree;
    file.leaf_cluster = {1, 0, 2, 1, 1};
    const std::string good = write_portal_file(file);
    std::mt19937 random(1);
    int refused = 0;
    for (int i = 0; i < 3000; ++i) {
        std::string text = good;
        for (std::size_t k = 0; k < 1 + random() % 3; ++k)
            if (random() % 4 == 0) text.resize(random() % (text.size() + 1));
            else if (!text.empty()) text[random() % text.size()] = static_cast<char>(random());
        const auto r = read_portal_file(bytes_of(text), "x.prt");
        if (r) write_portal_file(*r);
        else ++refused;
    }
    EXPECT_GT(refused, 1000);
}

TEST(Trail, PointsAreDenseAndCornersStay) {
    const std::vector<Vec3> path{{0, 0, 0}, {10, 0, 0}, {10, 0.5, 0}};
    EXPECT_EQ(write_lin(path), "10 0.5 0\n10 0 0\n0 0 0\n");
    EXPECT_EQ(write_pts(path, 5), "0 0 0\n5 0 0\n10 0 0\n10 0.5 0\n");
    EXPECT_EQ(*read_trail(bytes_of(write_lin(path)), "x.lin"), (std::vector<Vec3>{path.rbegin(), path.rend()}));
    EXPECT_EQ(write_pts({}), "");
    EXPECT_FALSE(read_trail(bytes_of("1 2"), "x.pts"));
}

} // namespace
} // namespace kiln

#include "formats/vmf/vmf.h"
#include <algorithm>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace kiln {
namespace {

// Number `i` of a row of an array, different for all, so that a wrong place shows.
double value(int array, int row, int i) {
    return array * 1000 + row * 100 + i * 0.25;
}
std::string rows(const char* name, int array, int row_count, int row_size, int left_out = -1) {
    std::string out = fmt::format("{} {{\n", name);
    for (int r = 0; r < row_count; ++r) {
        if (r == left_out) continue;
        out += fmt::format("\"row{}\" \"", r);
        for (int i = 0; i < row_size; ++i) out += fmt::format("{}{}", i ? " " : "", value(array, r, i));
        out += "\"\n";
    }
    return out + "}\n";
}
std::string tags(int power) {
    std::string out = "triangle_tags {\n";
    for (int r = 0; r < 1 << power; ++r) {
        out += fmt::format("\"row{}\" \"", r);
        for (int i = 0; i < 2 << power; ++i) out += fmt::format("{} ", r * 100 + i);
        out += "\"\n";
    }
    return out + "}\n";
}
const std::string kHead = "\"startposition\" \"[-64 8.5 1e2]\"\n\"flags\" \"6\"\n\"elevation\" \"-2.5\"\n\"subdiv\" \"1\"\n";

// One solid with one side in lines 4..; its dispinfo opens in line 9.
Result<Document> read(const std::string& info, Context& context) {
    const std::string text = "world\n{\n\"id\" \"1\"\nsolid { \"id\" \"2\"\nside {\n\"id\" \"7\"\n\"plane\" \"(0 0 0) (0 64 0) (64 0 0)\"\n"
                             "\"material\" \"DEV/A\"\ndispinfo {\n" + info + "}\n}\n}\n}\n";
    return read_vmf({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "t.vmf", context);
}
std::size_t count(const Context& c, const std::string& code) {
    return static_cast<std::size_t>(std::ranges::count(c.diagnostics(), code, &Diagnostic::code));
}

TEST(VmfDisplacement, EveryNumberComesToItsPlace) {
    for (const int power : {2, 3, 4}) {
        const int n = (1 << power) + 1;
        // The power comes last: editors write it first, but nothing says they must.
        const std::string info = kHead + rows("normals", 0, n, 3 * n) + rows("distances", 1, n, n) + rows("offsets", 2, n, 3 * n) +
                                 rows("offset_normals", 3, n, 3 * n) + rows("alphas", 4, n, n) + tags(power) +
                                 rows("multiblend", 5, n, 4 * n) + rows("alphablend", 6, n, 4 * n) + rows("multiblend_color_0", 7, n, 3 * n) +
                                 rows("multiblend_color_2", 8, n, 3 * n) + "allowed_verts { \"10\" \"-1 -1 0 3 4 5 6 7 8 4294967295\" }\n" +
                                 fmt::format("\"power\" \"{}\"\n", power);
        Context c;
        const Result<Document> d = read(info, c);
        ASSERT_TRUE(d) << to_text(d.fault().diagnostic);
        ASSERT_TRUE(c.diagnostics().empty()) << to_text(c.diagnostics()[0]);
        ASSERT_EQ(d->displacements.size(), 1u);
        EXPECT_EQ(d->entities[0].brushes[0].sides[0].displacement, 0);
        const DocDisplacement& g = d->displacements[0];
        EXPECT_EQ(g.line, 9);
        EXPECT_EQ(g.power, power);
        EXPECT_EQ(g.start, (Vec3{-64, 8.5, 100}));
        EXPECT_EQ(g.elevation, -2.5);
        EXPECT_EQ(g.flags, 6u);
        const auto vertices = static_cast<std::size_t>(n * n);
        ASSERT_EQ(g.normals.size(), vertices);
        ASSERT_EQ(g.distances.size(), vertices);
        ASSERT_EQ(g.offsets.size(), vertices);
        ASSERT_EQ(g.offset_normals.size(), vertices);
        ASSERT_EQ(g.alphas.size(), vertices);
        ASSERT_EQ(g.multiblend.size(), vertices);
        ASSERT_EQ(g.alphablend.size(), vertices);
        ASSERT_EQ(g.multiblend_colors.size(), vertices);
        for (int r = 0; r < n; ++r)
            for (int i = 0; i < n; ++i) {
                const auto v = static_cast<std::size_t>(r * n + i);
                const auto vec = [&](int array) { return Vec3{value(array, r, 3 * i), value(array, r, 3 * i + 1), value(array, r, 3 * i + 2)}; };
                EXPECT_EQ(g.normals[v], vec(0));
                EXPECT_EQ(g.distances[v], value(1, r, i));
                EXPECT_EQ(g.offsets[v], vec(2));
                EXPECT_EQ(g.offset_normals[v], vec(3));
                EXPECT_EQ(g.alphas[v], value(4, r, i));
                for (int k = 0; k < 4; ++k) {
                    EXPECT_EQ(g.multiblend[v][static_cast<std::size_t>(k)], value(5, r, 4 * i + k));
                    EXPECT_EQ(g.alphablend[v][static_cast<std::size_t>(k)], value(6, r, 4 * i + k));
                }
                EXPECT_EQ(g.multiblend_colors[v], (std::array<Vec3, 4>{vec(7), Vec3{1, 1, 1}, vec(8), Vec3{1, 1, 1}}));
            }
        ASSERT_EQ(g.triangle_tags.size(), std::size_t{2} << (2 * power));
        for (int r = 0; r < 1 << power; ++r)
            for (int i = 0; i < 2 << power; ++i) EXPECT_EQ(g.triangle_tags[static_cast<std::size_t>(r * (2 << power) + i)], r * 100 + i);
        EXPECT_EQ(g.allowed_vertices, (std::vector<std::int64_t>{-1, -1, 0, 3, 4, 5, 6, 7, 8, 4294967295}));
    }
}

TEST(VmfDisplacement, ArraysThatTheFileLacksStayEmpty) {
    Context c;
    const Result<Document> d = read(kHead + "\"power\" \"2\"\nalphas { }\noffsets\n{\n}\n" + rows("normals", 0, 5, 15), c);
    ASSERT_TRUE(d);
    EXPECT_TRUE(c.diagnostics().empty());
    ASSERT_EQ(d->displacements.size(), 1u);
    EXPECT_TRUE(d->displacements[0].alphas.empty() && d->displacements[0].offsets.empty() && d->displacements[0].distances.empty());
}

TEST(VmfDisplacement, WhatCannotBeUsedLeavesTheFaceFlat) {
    const std::string normals = rows("normals", 0, 5, 15);
    const struct {
        std::string info, code;
        int line;
    } cases[] = {
        {"\"power\" \"1\"\n" + kHead + normals, "displacement-power-invalid", 10},
        {"\"power\" \"5\"\n" + kHead + normals, "displacement-power-invalid", 10},
        {"\"power\" \"2.5\"\n" + kHead + normals, "displacement-power-invalid", 10},
        {"\"power\" \"x\"\n" + kHead + normals, "displacement-power-invalid", 10},
        {kHead + normals, "displacement-power-invalid", 9},
        {"\"power\" \"2\"\n" + normals, "displacement-start-invalid", 9},
        {"\"power\" \"2\"\n\"startposition\" \"[1 2]\"\n" + normals, "displacement-start-invalid", 11},
        {"\"power\" \"2\"\n\"startposition\" \"[1 2 1e9]\"\n" + normals, "displacement-start-invalid", 11},
        {"\"power\" \"2\"\n" + kHead, "displacement-without-normals", 9},
        {"\"power\" \"2\"\n" + kHead + "normals { }\n", "displacement-without-normals", 9},
    };
    for (const auto& k : cases) {
        Context c;
        const Result<Document> d = read(k.info, c);
        ASSERT_TRUE(d);
        ASSERT_EQ(d->entities[0].brushes.size(), 1u);
        EXPECT_EQ(d->entities[0].brushes[0].sides[0].displacement, 0);
        ASSERT_EQ(d->displacements.size(), 1u); // known to be one, so that its brush seals nothing
        EXPECT_EQ(d->displacements[0].power, 0);
        ASSERT_EQ(c.diagnostics().size(), 1u) << k.info;
        EXPECT_EQ(c.diagnostics()[0].code, k.code);
        EXPECT_EQ(c.diagnostics()[0].severity, Severity::error);
        EXPECT_EQ(c.diagnostics()[0].where, (SourceLocation{"t.vmf", k.line, 1, 2, 7})) << k.info;
    }
}

TEST(VmfDisplacement, BrokenRowsBecomeZerosWithAWarning) {
    const std::string head = "\"power\" \"2\"\n" + kHead;
    const auto with = [&](const std::string& row2) { // row 2 of distances, which the others lack
        return head + rows("normals", 0, 5, 15) + rows("distances", 1, 5, 5, 2) + "distances { " + row2 + " }\n";
    };
    const struct {
        std::string info, code;
        bool zero;
    } cases[] = {
        {with(""), "displacement-row-missing", true},
        {with("\"row2\" \"1 2 3 4\""), "displacement-row-invalid", true},
        {with("\"row2\" \"1 2 3 4 5 6\""), "displacement-row-invalid", true},
        {with("\"row2\" \"1 2 nan 4 5\""), "displacement-row-invalid", true},
        {with("\"row2\" \"1 2 3 4 2e5\""), "displacement-row-invalid", true},
        {with("\"row2\" \"1 2 3 4 5\" \"row5\" \"1 2 3 4 5\""), "displacement-row-extra", false},
        {with("\"row2\" \"1 2 3 4 5\" \"row2\" \"9 9 9 9 9\""), "displacement-row-extra", false},
        {with("\"row2\" \"1 2 3 4 5\" \"line\" \"9 9 9 9 9\""), "displacement-row-extra", false},
    };
    for (const auto& k : cases) {
        Context c;
        const Result<Document> d = read(k.info, c);
        ASSERT_TRUE(d);
        ASSERT_EQ(d->displacements.size(), 1u) << k.info;
        const std::vector<double>& distances = d->displacements[0].distances;
        ASSERT_EQ(distances.size(), 25u);
        for (int i = 0; i < 5; ++i) EXPECT_EQ(distances[static_cast<std::size_t>(10 + i)], k.zero ? 0 : i + 1) << k.info;
        EXPECT_EQ(distances[24], value(1, 4, 4));
        ASSERT_EQ(c.diagnostics().size(), 1u) << k.info;
        EXPECT_EQ(c.diagnostics()[0].code, k.code);
        EXPECT_EQ(c.diagnostics()[0].severity, Severity::warning);
        EXPECT_EQ(c.diagnostics()[0].where.brush, 2);
        EXPECT_EQ(c.diagnostics()[0].where.side, 7);
        EXPECT_GT(c.diagnostics()[0].where.line, 9);
    }
    Context c;
    const Result<Document> d = read(head + rows("normals", 0, 5, 15) + "triangle_tags { \"row0\" \"0 1 2 3 4 5 6 -1\" \"row1\" \"0 1 2 3 4 5 6 7\" }\n"
                                    "\"elevation\" \"high\"\nallowed_verts { \"10\" \"1 2\" }\n", c);
    ASSERT_TRUE(d);
    ASSERT_EQ(d->displacements.size(), 1u);
    EXPECT_EQ(d->displacements[0].triangle_tags[7], 0);
    EXPECT_EQ(d->displacements[0].triangle_tags[15], 7);
    EXPECT_TRUE(d->displacements[0].allowed_vertices.empty());
    EXPECT_EQ(count(c, "displacement-row-invalid"), 2u);
    EXPECT_EQ(count(c, "displacement-row-missing"), 1u);
    EXPECT_EQ(count(c, "displacement-number-invalid"), 1u);
}

TEST(VmfDisplacement, ASecondOneOfASideIsToldAndIgnored) {
    Context c;
    const Result<Document> d = read("\"power\" \"2\"\n" + kHead + rows("normals", 0, 5, 15) + "}\ndispinfo { \"power\" \"3\"\n", c);
    ASSERT_TRUE(d);
    ASSERT_EQ(d->displacements.size(), 1u);
    EXPECT_EQ(d->displacements[0].power, 2);
    ASSERT_EQ(c.diagnostics().size(), 1u);
    EXPECT_EQ(c.diagnostics()[0].code, "displacement-second");
}

} // namespace
} // namespace kiln

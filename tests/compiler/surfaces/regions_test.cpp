// Exact vertices, unions and triangulations on planes made by hand.
#include "compiler/surfaces/regions.h"
#include "compiler/surfaces/tjunctions.h"
#include <gtest/gtest.h>

namespace kiln {
namespace {

class Regions : public ::testing::Test {
protected:
    PlaneTable table;
    PlaneId plane(std::int64_t a, std::int64_t b, std::int64_t c, std::int64_t d) {
        ExactPlane p;
        p.a = a, p.b = b, p.c = c, p.d = d;
        return table.add(p);
    }
    // [x0, x1] x [y0, y1] on z = 0, seen from above.
    PlanePolygon rectangle(std::int64_t x0, std::int64_t y0, std::int64_t x1, std::int64_t y1) {
        return {plane(0, 0, 1, 0), {plane(0, -1, 0, -y0), plane(1, 0, 0, x1), plane(0, 1, 0, y1), plane(-1, 0, 0, -x0)}};
    }
};

double area(const VertexTable& v, const std::vector<std::array<VertexId, 3>>& triangles) {
    double sum = 0;
    for (const auto& t : triangles) {
        const double a = 0.5 * cross(v.position(t[1]) - v.position(t[0]), v.position(t[2]) - v.position(t[0])).z;
        EXPECT_GT(a, 0);
        sum += a;
    }
    return sum;
}

Polygons all_of(VertexTable& v, const std::vector<PlanePolygon>& polygons) {
    Polygons all;
    for (const PlanePolygon& p : polygons) v.add(p, all);
    return all;
}
std::vector<std::vector<Outline>> outlines_of(VertexTable& v, const std::vector<PlanePolygon>& polygons) {
    std::vector<std::vector<Outline>> outlines;
    for (const PlanePolygon& p : polygons) {
        Polygons one;
        v.add(p, one);
        outlines.push_back({{one.vertices, one.lines}});
    }
    return outlines;
}

// By edges, and the same by the library's union.
std::vector<Region> merge(const VertexTable& v, const PlanePolygon& first, const Polygons& polygons) {
    const auto by_edges = merge_by_edges(v, first.support, polygons), by_union = merge_by_union(v, first.support, polygons);
    if (!by_edges || !by_union) throw std::runtime_error("not merged");
    EXPECT_EQ(by_edges->size(), by_union->size());
    for (std::size_t i = 0; i < std::min(by_edges->size(), by_union->size()); ++i) {
        EXPECT_EQ((*by_edges)[i].members, (*by_union)[i].members);
        EXPECT_EQ((*by_edges)[i].loops.size(), (*by_union)[i].loops.size());
        for (std::size_t k = 0; k < std::min((*by_edges)[i].loops.size(), (*by_union)[i].loops.size()); ++k)
            EXPECT_EQ((*by_edges)[i].loops[k].vertices, (*by_union)[i].loops[k].vertices);
    }
    return *by_edges;
}

TEST_F(Regions, OneVertexFromManyPlanes) {
    const PlaneId z = plane(0, 0, 1, 0), x = plane(1, 0, 0, 5), y = plane(0, 1, 0, 7), d = plane(1, 1, 0, 12), e = plane(3, -2, 9, 1);
    VertexTable v(table);
    const VertexId a = v.add(z, x, y);
    EXPECT_EQ(v.add(z, d, x), a);
    EXPECT_EQ(v.add(flipped(y), z, flipped(d)), a);
    EXPECT_EQ(v.add(e, y, x), a); // 15 - 14 + 0 = 1: that plane too
    EXPECT_NE(v.add(plane(0, 0, 1, 1), x, y), a);
    EXPECT_EQ(v.position(a), (Vec3{5, 7, 0}));
}

// Points on the line x = y = 3 z, all with denominators of three.
TEST_F(Regions, BetweenIsExactWithThirds) {
    const PlaneId p = plane(1, -1, 0, 0), q = plane(1, 0, -3, 0), off = plane(1, 0, -3, 1);
    std::vector<PlaneId> across;
    for (const std::int64_t d : {1, 4, 5}) across.push_back(plane(3, 0, 0, d)); // x = 1/3, 4/3, 5/3
    VertexTable v(table);
    const VertexId a = v.add(p, q, across[0]), m = v.add(p, q, across[1]), b = v.add(p, q, across[2]), o = v.add(p, off, across[1]);
    EXPECT_TRUE(v.between(a, b, m, p, q));
    EXPECT_TRUE(v.between(b, a, m, p, q));
    EXPECT_FALSE(v.between(a, m, b, p, q));
    EXPECT_FALSE(v.between(a, b, a, p, q));
    EXPECT_FALSE(v.between(a, b, o, p, q));
    const Projection axes{0, 1};
    EXPECT_EQ(v.turn(a, b, m, axes), 0);
    EXPECT_EQ(v.turn(a, b, o, axes), v.turn(b, o, a, axes));
    EXPECT_EQ(v.turn(a, b, o, axes), -v.turn(b, a, o, axes));
    EXPECT_LT(v.compare(a, m, 0), 0);
    EXPECT_EQ(v.compare(m, m, 0), 0);
}

TEST_F(Regions, LShapeOfThreeRectangles) {
    const std::vector<PlanePolygon> parts{rectangle(0, 0, 10, 10), rectangle(10, 0, 20, 4), rectangle(10, 4, 20, 10), rectangle(0, 10, 5, 20)};
    VertexTable v(table);
    const std::vector<Region> r = merge(v, parts[0], all_of(v, parts));
    ASSERT_EQ(r.size(), 1u);
    ASSERT_EQ(r[0].loops.size(), 1u);
    EXPECT_EQ(r[0].loops[0].vertices.size(), 6u);
    EXPECT_EQ(r[0].members, (std::vector<std::uint32_t>{0, 1, 2, 3}));
    const auto triangles = triangulate(v, parts[0].support, r[0].loops);
    EXPECT_EQ(triangles.size(), 4u);
    EXPECT_EQ(area(v, triangles), 250);
}

TEST_F(Regions, RingAndIslandAndCornerTouch) {
    const std::vector<PlanePolygon> parts{
        rectangle(0, 0, 30, 10), rectangle(0, 20, 30, 30), rectangle(0, 10, 10, 20), rectangle(20, 10, 30, 20), // ring
        rectangle(14, 14, 16, 16),                                                                             // in its hole
        rectangle(30, 30, 40, 40),                                                                             // at its corner
    };
    VertexTable v(table);
    const std::vector<Region> r = merge(v, parts[0], all_of(v, parts));
    ASSERT_EQ(r.size(), 3u);
    EXPECT_EQ(r[0].members, (std::vector<std::uint32_t>{0, 1, 2, 3}));
    EXPECT_EQ(r[1].members, (std::vector<std::uint32_t>{4}));
    EXPECT_EQ(r[2].members, (std::vector<std::uint32_t>{5}));
    EXPECT_EQ(r[0].loops.size(), 2u);
    EXPECT_EQ(area(v, triangulate(v, parts[0].support, r[0].loops)), 800);
    EXPECT_EQ(area(v, triangulate(v, parts[0].support, r[1].loops)), 4);
}

// Two holes that meet in a corner: the boundary passes that vertex twice.
TEST_F(Regions, HolesThatTouch) {
    std::vector<PlanePolygon> parts;
    for (std::int64_t i = 0; i < 4; ++i)
        for (std::int64_t j = 0; j < 4; ++j)
            if (!(i == 1 && j == 1) && !(i == 2 && j == 2)) parts.push_back(rectangle(i * 8, j * 8, i * 8 + 8, j * 8 + 8));
    VertexTable v(table);
    const std::vector<Region> r = merge(v, parts[0], all_of(v, parts));
    ASSERT_EQ(r.size(), 1u);
    EXPECT_EQ(area(v, triangulate(v, parts[0].support, r[0].loops)), 14 * 64);
}

TEST_F(Regions, TJunctionsGoIntoEveryEdgeTheyLieOn) {
    const PlanePolygon big = rectangle(0, 0, 100, 100), a = rectangle(100, 10, 110, 20), b = rectangle(100, 20, 110, 55);
    VertexTable v(table);
    std::vector<std::vector<Outline>> loops = outlines_of(v, {big, a, b});
    std::vector<FaceOutlines> all;
    for (auto& l : loops) all.push_back({big.support, &l});
    Context context;
    insert_tjunctions(v, all, context);
    ASSERT_EQ(loops[0][0].vertices.size(), 7u);
    EXPECT_EQ(loops[0][0].lines.size(), 7u);
    EXPECT_EQ(loops[1][0].vertices.size(), 4u);
    EXPECT_EQ(loops[2][0].vertices.size(), 4u);
    std::vector<double> right; // up the edge x = 100
    for (const VertexId w : loops[0][0].vertices)
        if (v.position(w).x == 100) right.push_back(v.position(w).y);
    EXPECT_EQ(right, (std::vector<double>{0, 10, 20, 55, 100}));
    const auto triangles = triangulate(v, big.support, loops[0]);
    EXPECT_EQ(triangles.size(), 5u);
    EXPECT_EQ(area(v, triangles), 10000);
}

// A long wall seen at a shallow angle, its T-junctions with denominators of thousands.
TEST_F(Regions, TJunctionsOnSlantedEdges) {
    const PlaneId z = plane(0, 0, 1, 0), slope = plane(-331, 977, 0, 0), left = plane(-1, 0, 0, 0), right = plane(1, 0, 0, 3000), bottom = plane(0, -1, 0, 500);
    const PlanePolygon below{z, {bottom, right, slope, left}};
    std::vector<PlanePolygon> above;
    std::vector<PlaneId> cuts{left};
    for (std::int64_t k = 1; k < 8; ++k) cuts.push_back(plane(1, 0, 0, 371 * k));
    cuts.push_back(right);
    const PlaneId top = plane(0, 1, 0, 2000);
    for (std::size_t k = 0; k + 1 < cuts.size(); ++k)
        above.push_back({z, {flipped(slope), cuts[k + 1], top, k ? flipped(cuts[k]) : left}});
    VertexTable v(table);
    above.push_back(below);
    std::vector<std::vector<Outline>> loops = outlines_of(v, above);
    std::vector<FaceOutlines> all;
    for (auto& l : loops) all.push_back({z, &l});
    Context context;
    insert_tjunctions(v, all, context);
    EXPECT_EQ(loops.back()[0].vertices.size(), 4u + 7u);
    const auto triangles = triangulate(v, z, loops.back());
    EXPECT_EQ(triangles.size(), 9u);
    EXPECT_NEAR(area(v, triangles), 500 * 3000. + 0.5 * 3000 * 3000 * 331 / 977, 1e-6);
}

} // namespace
} // namespace kiln

// Displacements and patches by hand, into worlds of WorldBuilder.
#pragma once
#include "tests/support/world_builder.h"
#include <functional>

namespace kiln::test {

// A box whose top is displaced: over the point (x, y) of its top by height(x, y), straight up.
inline SideId displaced_box(WorldBuilder& b, Vec3 lo, Vec3 hi, int power, const std::function<double(double, double)>& height,
                            MaterialId m = {0}, double luxel = 16) {
    const BrushId brush = b.box(lo, hi, Contents::solid, {0}, m);
    WorldBrush& w = b.world.brushes[brush.at()];
    const SideId side{w.first_side + 5}; // +z
    w.displaced = true, w.contents = Contents::empty;
    WorldDisplacement d;
    d.side = side;
    d.grid.power = power, d.grid.start = {lo.x, lo.y, hi.z}, d.grid.line = b.world.sides[side.at()].line;
    const int n = 1 << power;
    for (int r = 0; r <= n; ++r)
        for (int c = 0; c <= n; ++c) {
            const double x = lo.x + (hi.x - lo.x) * c / n, y = lo.y + (hi.y - lo.y) * r / n;
            d.grid.normals.push_back({0, 0, 1});
            d.grid.distances.push_back(height(x, y));
            d.grid.alphas.push_back(255.0 * c / n);
        }
    b.world.sides[side.at()].displacement = static_cast<std::int32_t>(b.world.displacements.size());
    b.world.sides[side.at()].lightmap_scale = luxel;
    b.world.displacements.push_back(d);
    return side;
}

// A terrain of five displacements over [0,512] x [0,512]: unequal powers, and two half-edge neighbours at one edge.
inline void mixed_terrain(WorldBuilder& b, double top, const std::function<double(double, double)>& height, MaterialId m = {0},
                          double luxel = 16) {
    const double lo = top - 16;
    displaced_box(b, {0, 0, lo}, {256, 256, top}, 4, height, m, luxel);
    displaced_box(b, {256, 0, lo}, {512, 256, top}, 2, height, m, luxel);
    displaced_box(b, {0, 256, lo}, {256, 512, top}, 3, height, m, luxel);
    displaced_box(b, {256, 256, lo}, {384, 512, top}, 3, height, m, luxel);
    displaced_box(b, {384, 256, lo}, {512, 512, top}, 2, height, m, luxel);
}
inline double hills(double x, double y) { return 30 * std::sin(x / 60) * std::cos(y / 45) + 20 * std::sin((x + y) / 37); }

// Control points of a closed row of four pieces, all but round, counter-clockwise seen from above: the front of a patch of it is outside.
inline constexpr std::array<Vec2, 9> kRing{Vec2{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}, {1, 0}};

// Control points point(column, row), both from 0.
inline void patch(WorldBuilder& b, std::uint32_t columns, std::uint32_t rows, const std::function<Vec3(std::uint32_t, std::uint32_t)>& point,
                  MaterialId m = {0}, double luxel = 16) {
    WorldPatch p;
    p.entity = EntityId{0}, p.model = ModelId{0}, p.material = m, p.lightmap_scale = luxel;
    p.grid.columns = columns, p.grid.rows = rows, p.grid.line = 1000 + static_cast<int>(b.world.patches.size());
    p.grid.id = static_cast<int>(b.world.patches.size());
    for (std::uint32_t c = 0; c < columns; ++c)
        for (std::uint32_t r = 0; r < rows; ++r) {
            p.grid.points.push_back(point(c, r));
            p.grid.uv.push_back({static_cast<double>(c) / (columns - 1), static_cast<double>(r) / (rows - 1)});
        }
    b.world.patches.push_back(p);
}

} // namespace kiln::test

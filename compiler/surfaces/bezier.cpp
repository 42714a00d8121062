// Patches: biquadratic Bezier pieces divided until they are flat.
//
// Source   the bound: D. Filip, R. Magedson, R. Markot, "Surface algorithms using bounds on derivatives", CAGD 3, 1986
#include "compiler/surfaces/curves.h"
#include "libs/core/check.h"
#include "libs/core/union_find.h"
#include <algorithm>
#include <bit>
#include <cmath>
#include <fmt/format.h>
#include <unordered_map>

namespace kiln {
namespace {

constexpr std::uint32_t kMostDivisions = 64; // of one piece, one way

using Key = std::array<std::uint64_t, 3>;
Key key_of(Vec3 p) { return {std::bit_cast<std::uint64_t>(p.x), std::bit_cast<std::uint64_t>(p.y), std::bit_cast<std::uint64_t>(p.z)}; }

constexpr double kGrid = 1024; // points a map unit

// Symmetric in (a, t) and (c, s) to the last bit, so that a border has the same points from both its ends.
template <class T> T quadratic(T a, T b, T c, double t, double s) { // s = 1 - t
    return (a * (s * s) + c * (t * t)) + b * (2 * s * t);
}

// All nine control points in one plane, as far as doubles can tell.
bool flat(const BezierPiece& piece) {
    double size = 0;
    Vec3 n;
    const Vec3 o = piece.point[0][0];
    for (const auto& row : piece.point)
        for (const Vec3 p : row) size = std::max(size, length(p - o));
    double best = 0;
    for (const auto& row : piece.point)
        for (const Vec3 p : row)
            for (const Vec3 q : {piece.point[0][2], piece.point[2][0], piece.point[2][2], piece.point[1][1]})
                if (const Vec3 c = cross(p - o, q - o); length(c) > best) best = length(c), n = c / best;
    if (!(best > 0)) return true;
    constexpr double kRounding = 1e-9; // of the size
    for (const auto& row : piece.point)
        for (const Vec3 p : row)
            if (std::abs(dot(p - o, n)) > kRounding * size) return false;
    return true;
}

class Tessellation {
public:
    Tessellation(const World& world, double flatness) : world_(world), flatness_(flatness) {}
    std::size_t capped = 0;
    std::uint32_t capped_patch = 0;

    // How often the strips of pieces are divided. Strips whose borders run along one curve are divided alike, all the
    // way through every patch they meet.
    void divide() {
        first_strip_.push_back(0);
        for (const WorldPatch& p : world_.patches)
            first_strip_.push_back(first_strip_.back() + (p.grid.columns - 1) / 2 + (p.grid.rows - 1) / 2);
        divisions_.assign(first_strip_.back(), 1);
        UnionFind alike(divisions_.size());
        std::map<std::tuple<ModelId, Key, Key, Key>, std::uint32_t> borders;
        for (std::uint32_t p = 0; p < world_.patches.size(); ++p) {
            const DocPatch& g = world_.patches[p].grid;
            const std::uint32_t wide = (g.columns - 1) / 2, high = (g.rows - 1) / 2;
            const auto border = [&](std::uint32_t strip, std::array<std::uint32_t, 3> columns, std::array<std::uint32_t, 3> rows) {
                std::array<Key, 3> k;
                for (std::size_t i = 0; i < 3; ++i) k[i] = key_of(point(g, columns[i], rows[i]));
                if (k[0] == k[2] && k[0] == k[1]) return; // a pole is no curve
                if (k[2] < k[0]) std::swap(k[0], k[2]);
                const auto [it, fresh] = borders.try_emplace({world_.patches[p].model, k[0], k[1], k[2]}, strip);
                if (!fresh) alike.join(it->second, strip);
            };
            for (std::uint32_t j = 0; j < high; ++j)
                for (std::uint32_t i = 0; i < wide; ++i) {
                    const auto [along, across] = needed(p, piece(g, i, j));
                    std::uint32_t &a = divisions_[first_strip_[p] + i], &b = divisions_[first_strip_[p] + wide + j];
                    a = std::max(a, along), b = std::max(b, across);
                }
            for (std::uint32_t i = 0; i < wide; ++i)
                for (const std::uint32_t row : {0u, g.rows - 1}) border(first_strip_[p] + i, {2 * i, 2 * i + 1, 2 * i + 2}, {row, row, row});
            for (std::uint32_t j = 0; j < high; ++j)
                for (const std::uint32_t column : {0u, g.columns - 1})
                    border(first_strip_[p] + wide + j, {column, column, column}, {2 * j, 2 * j + 1, 2 * j + 2});
        }
        std::vector<std::uint32_t> most(divisions_.size(), 1);
        for (std::uint32_t s = 0; s < divisions_.size(); ++s) most[alike.find(s)] = std::max(most[alike.find(s)], divisions_[s]);
        for (std::uint32_t s = 0; s < divisions_.size(); ++s) divisions_[s] = most[alike.find(s)];
    }

    double move(std::uint32_t p, std::uint32_t column, std::uint32_t row) const { // of a control point, map units
        const DocPatch& g = world_.patches[p].grid;
        return length(point(g, column, row) - g.points[std::size_t{column} * g.rows + row]);
    }
    CurveGrid grid(std::uint32_t p, CurveGrids& out) {
        const WorldPatch& patch = world_.patches[p];
        const DocPatch& g = patch.grid;
        const std::uint32_t wide = (g.columns - 1) / 2, high = (g.rows - 1) / 2;
        struct Stop { // of a row or column of the grid
            std::uint32_t piece;
            double t, rest;
        };
        const auto stops = [&](std::uint32_t first, std::uint32_t count) {
            std::vector<Stop> list;
            for (std::uint32_t i = 0; i < count; ++i) {
                const std::uint32_t n = divisions_[first_strip_[p] + first + i];
                for (std::uint32_t k = i == 0 ? 0 : 1; k <= n; ++k)
                    list.push_back({i, static_cast<double>(k) / n, static_cast<double>(n - k) / n});
            }
            return list;
        };
        const std::vector<Stop> along = stops(0, wide), across = stops(wide, high);
        CurveGrid grid;
        grid.kind = Curve::patch, grid.source = p, grid.material = patch.material, grid.model = patch.model;
        grid.luxel_size = patch.lightmap_scale;
        grid.columns = static_cast<std::uint32_t>(along.size()), grid.rows = static_cast<std::uint32_t>(across.size());
        for (const Stop& y : across)
            for (const Stop& x : along) {
                const Vec3 v = bezier_point(piece(g, x.piece, y.piece), x.t, x.rest, y.t, y.rest) + Vec3{0, 0, 0};
                const auto [it, fresh] = vertex_.try_emplace({patch.model.value, key_of(v)}, static_cast<std::uint32_t>(out.positions.size()));
                if (fresh) out.positions.push_back(v);
                grid.vertices.push_back(it->second);
                std::array<Vec2, 3> row;
                for (std::uint32_t k = 0; k < 3; ++k) {
                    const auto uv = [&](std::uint32_t c) { return g.uv[std::size_t{2 * x.piece + c} * g.rows + 2 * y.piece + k]; };
                    row[k] = quadratic(uv(0), uv(1), uv(2), x.t, x.rest);
                }
                grid.uv.push_back(quadratic(row[0], row[1], row[2], y.t, y.rest));
                grid.alpha.push_back(0);
            }
        return grid;
    }

private:
    const World& world_;
    double flatness_;
    std::vector<std::uint32_t> first_strip_, divisions_; // per patch: its columns of pieces, then its rows
    struct Hash {
        std::size_t operator()(const std::pair<std::uint32_t, Key>& k) const {
            std::uint64_t h = k.first;
            for (const std::uint64_t v : k.second) h = (h ^ v) * 0x9E3779B97F4A7C15ull, h ^= h >> 29;
            return h;
        }
    };
    std::unordered_map<std::pair<std::uint32_t, Key>, std::uint32_t, Hash> vertex_;

    // On a grid as fine as the one that planes of brushes are rounded to: editors write 48.000008 for 48.
    static Vec3 point(const DocPatch& g, std::uint32_t column, std::uint32_t row) {
        const Vec3 p = g.points[std::size_t{column} * g.rows + row];
        return Vec3{std::nearbyint(p.x * kGrid), std::nearbyint(p.y * kGrid), std::nearbyint(p.z * kGrid)} / kGrid + Vec3{0, 0, 0}; // no negative zeros
    }
    static BezierPiece piece(const DocPatch& g, std::uint32_t i, std::uint32_t j) {
        BezierPiece b;
        for (std::uint32_t r = 0; r < 3; ++r)
            for (std::uint32_t c = 0; c < 3; ++c) b.point[r][c] = point(g, 2 * i + c, 2 * j + r);
        return b;
    }
    std::array<std::uint32_t, 2> needed(std::uint32_t p, const BezierPiece& b) {
        const auto& fixed = world_.patches[p].grid.subdivisions;
        if (fixed[0] > 0 && fixed[1] > 0) return {std::min(fixed[0], kMostDivisions), std::min(fixed[1], kMostDivisions)};
        std::array<std::uint32_t, 2> n = bezier_divisions(b, flatness_);
        if (n[0] > kMostDivisions || n[1] > kMostDivisions) ++capped, capped_patch = p;
        return {std::min(n[0], kMostDivisions), std::min(n[1], kMostDivisions)};
    }
};

} // namespace

Vec3 bezier_point(const BezierPiece& b, double t, double rest, double u, double u_rest) {
    std::array<Vec3, 3> row;
    for (std::size_t r = 0; r < 3; ++r) row[r] = quadratic(b.point[r][0], b.point[r][1], b.point[r][2], t, rest);
    return quadratic(row[0], row[1], row[2], u, u_rest);
}

// Over right triangles with legs h and k in the parameters, a surface is nowhere farther from its linear interpolant
// than (h^2 |S_tt| + 2 h k |S_tu| + k^2 |S_uu|) / 8 with the largest of each derivative. S_tt is twice the second
// difference of a row, which is largest in a row of the control net; S_tu is four times the mixed difference, largest in
// a corner cell. Of a piece that lies in one plane only the borders can be off, and they know no mixed term.
std::array<std::uint32_t, 2> bezier_divisions(const BezierPiece& b, double flatness) {
    double tt = 0, tu = 0, uu = 0;
    const auto& p = b.point;
    for (std::size_t i = 0; i < 3; ++i) {
        tt = std::max(tt, 2 * length(p[i][0] - p[i][1] * 2.0 + p[i][2]));
        uu = std::max(uu, 2 * length(p[0][i] - p[1][i] * 2.0 + p[2][i]));
    }
    if (!flat(b))
        for (std::size_t r = 0; r < 2; ++r)
            for (std::size_t c = 0; c < 2; ++c) tu = std::max(tu, 4 * length(p[r][c] - p[r][c + 1] - p[r + 1][c] + p[r + 1][c + 1]));
    constexpr std::uint32_t kEnd = 1u << 16;
    std::array<std::uint32_t, 2> n{1, 1};
    const auto bound = [&] {
        const double h = 1.0 / n[0], k = 1.0 / n[1];
        return (h * h * tt + 2 * h * k * tu + k * k * uu) / 8;
    };
    while (bound() > flatness && n[0] < kEnd && n[1] < kEnd) { // the way that brings more
        const double h = 1.0 / n[0], k = 1.0 / n[1], along = h * h * tt, across = k * k * uu;
        if (along >= across) n[0] *= 2;
        if (along <= across) n[1] *= 2;
    }
    return n;
}

void add_patches(const World& world, double flatness, CurveGrids& out, Context& context) {
    if (world.patches.empty()) return;
    Tessellation tessellation(world, std::max(flatness, 1e-3));
    tessellation.divide();
    if (tessellation.capped > 0)
        context.report(Severity::warning, "curve-too-fine",
                       fmt::format("{} pieces of patches would need more than {} parts a side to be flat within {} map units", tessellation.capped,
                                   kMostDivisions, flatness),
                       world.location(world.patches[tessellation.capped_patch]));
    std::size_t moved = 0;
    double largest = 0;
    std::uint32_t furthest = 0;
    for (std::uint32_t p = 0; p < world.patches.size(); ++p)
        for (std::uint32_t c = 0; c < world.patches[p].grid.columns; ++c)
            for (std::uint32_t r = 0; r < world.patches[p].grid.rows; ++r) {
                const double move = tessellation.move(p, c, r);
                moved += move > 0;
                if (move > largest) largest = move, furthest = p;
            }
    if (moved > 0)
        context.report(Severity::note, "patch-points-rounded",
                       fmt::format("{} control points of patches were rounded to 1/{} unit; the largest move is {:.2g} units", moved, kGrid, largest),
                       world.location(world.patches[furthest]));
    for (std::uint32_t p = 0; p < world.patches.size(); ++p) {
        context.check_cancelled();
        out.grids.push_back(tessellation.grid(p, out));
    }
}

} // namespace kiln

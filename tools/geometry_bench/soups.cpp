#include "tools/geometry_bench/soups.h"
#include "libs/core/hash.h"
#include "libs/math/vec.h"
#include <cmath>
#include <fmt/format.h>
#include <iterator>
#include <numbers>

namespace kiln::bench {
namespace {

class Random {
public:
    explicit Random(std::uint64_t seed) : seed_(seed) {}
    double unit() { return static_cast<double>(mix(seed_, ++count_) >> 11) * 0x1p-53; }
    double whole(double lo, double hi) { return std::floor(lo + unit() * (hi - lo + 1)); }

private:
    std::uint64_t seed_, count_ = 0;
};

struct Turn { // columns: where the axes go
    Vec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
    Vec3 operator()(Vec3 p) const { return x * p.x + y * p.y + z * p.z; }
};
Turn turn_about(Vec3 axis, double angle_rad) {
    const Vec3 n = normalize(axis);
    const double c = std::cos(angle_rad), s = std::sin(angle_rad);
    const auto go = [&](Vec3 v) { return v * c + cross(n, v) * s + n * (dot(n, v) * (1 - c)); };
    return {go({1, 0, 0}), go({0, 1, 0}), go({0, 0, 1})};
}
Turn operator*(const Turn& a, const Turn& b) { return {a(b.x), a(b.y), a(b.z)}; }

class MapText {
public:
    MapText() { text_ = "{\n\"classname\" \"worldspawn\"\n"; }
    Turn turn;           // of everything
    bool rounded = false; // points to 1/1024
    double spoil = 0;     // points of tops are off by so much, up or down

    // A box about `center`, turned by `own` about it.
    void box(Vec3 lo, Vec3 hi, const Turn& own = {}, const char* texture = "wall") {
        const Vec3 center = (lo + hi) * 0.5, half = (hi - lo) * 0.5;
        text_ += "{\n";
        for (std::size_t axis = 0; axis < 3; ++axis)
            for (const double sign : {-1.0, 1.0}) {
                Vec3 corner{}, u{}, v{};
                corner[axis] = sign * half[axis];
                const std::size_t a = (axis + 1) % 3, b = (axis + 2) % 3;
                corner[a] = -half[a], corner[b] = -half[b];
                u[a] = 2 * half[a], v[b] = 2 * half[b];
                // Clockwise seen from outside.
                const Vec3 p[3] = {corner, corner + (sign > 0 ? v : u), corner + (sign > 0 ? u : v)};
                for (const Vec3& q : p) {
                    const bool off = spoil > 0 && axis == 2 && sign > 0;
                    point(turn(center + own(q)) + Vec3{0, 0, off ? spoil * (random_.whole(0, 1) * 2 - 1) * random_.whole(1, 3) : 0});
                }
                text_ += texture;
                text_ += " 0 0 0 1 1\n";
            }
        text_ += "}\n";
        ++brushes;
    }
    // Six slabs around the inside of a box.
    void hall(Vec3 lo, Vec3 hi, double thick) {
        const Vec3 t{thick, thick, thick};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            Vec3 a = lo - t, b = hi + t;
            b[axis] = lo[axis];
            box(a, b);
            b[axis] = hi[axis] + thick, a[axis] = hi[axis];
            box(a, b);
        }
    }
    std::string finish(Vec3 player) {
        const Vec3 p = turn(player);
        fmt::format_to(std::back_inserter(text_), "}}\n{{\n\"classname\" \"info_player_start\"\n\"origin\" \"{:.3f} {:.3f} {:.3f}\"\n}}\n", p.x, p.y, p.z);
        return std::move(text_);
    }
    std::size_t brushes = 0;

private:
    std::string text_;
    Random random_{3};
    void point(Vec3 p) {
        if (rounded)
            for (std::size_t i = 0; i < 3; ++i) p[i] = std::round(p[i] * 1024) / 1024;
        fmt::format_to(std::back_inserter(text_), "( {} {} {} ) ", p.x, p.y, p.z);
    }
};

std::string make_soup(Soup soup, std::size_t brushes) {
    // A box a cell of 96 units on average, of 24 to 120 units a side: each overlaps a few others, as in levels.
    constexpr double kCell = 96, kLeast = 24, kMost = 120;
    Random random(1);
    MapText map;
    if (soup == Soup::turned) map.turn = turn_about({0, 0, 1}, 17 * std::numbers::pi / 180) * turn_about({1, 0, 0}, 11 * std::numbers::pi / 180);
    map.rounded = soup != Soup::boxes;
    const double side = std::ceil(kCell * std::cbrt(static_cast<double>(brushes)) / 2) * 2;
    const Vec3 hi{side / 2, side / 2, side / 2}, lo = -hi;
    map.hall(lo - Vec3{64, 64, 64}, hi + Vec3{64, 64, 64}, 16); // a way around everything: nothing is shut in by chance alone
    while (map.brushes < brushes) {
        Vec3 at, size;
        for (std::size_t i = 0; i < 3; ++i) size[i] = random.whole(kLeast, kMost), at[i] = random.whole(lo[i], hi[i] - size[i]);
        Turn own;
        if (soup == Soup::tumbled) {
            const Vec3 axis{random.unit() - 0.5, random.unit() - 0.5, random.unit() - 0.5};
            own = turn_about(axis, random.unit() * std::numbers::pi);
            size = size * 0.75; // corners reach farther: about as many meetings
        }
        map.box(at, at + size, own);
    }
    return map.finish(hi + Vec3{40, 40, 40});
}

std::string make_city(std::size_t brushes) {
    constexpr double kBlock = 256, kHouse = 160, kHigh = 2048;
    Random random(2);
    MapText map;
    // A block has a house of two boxes, a floor and a lid.
    const auto n = std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(std::sqrt((static_cast<double>(brushes) - 4) / 4))));
    const double side = kBlock * static_cast<double>(n);
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = 0; j < n; ++j) {
            const Vec3 at{kBlock * static_cast<double>(i), kBlock * static_cast<double>(j), 0};
            const double edge = (kBlock - kHouse) / 2, height = random.whole(8, 60) * 32, inset = random.whole(1, 4) * 16;
            map.box(at + Vec3{0, 0, -16}, at + Vec3{kBlock, kBlock, 0});
            map.box(at + Vec3{0, 0, kHigh}, at + Vec3{kBlock, kBlock, kHigh + 16});
            map.box(at + Vec3{edge, edge, 0}, at + Vec3{kBlock - edge, kBlock - edge, height});
            map.box(at + Vec3{edge + inset, edge + inset, height}, at + Vec3{kBlock - edge - inset, kBlock - edge - inset, height + 64});
        }
    for (const bool far : {false, true}) {
        const double a = far ? side : -16, b = far ? side + 16 : 0;
        map.box({a, -16, -16}, {b, side + 16, kHigh + 16});
        map.box({-16, a, -16}, {side + 16, b, kHigh + 16});
    }
    return map.finish({16, 16, 40});
}

std::string make_tiles(std::size_t brushes) {
    constexpr double kTile = 16, kHigh = 256;
    MapText map;
    const auto n = std::max<std::size_t>(2, static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(brushes) - 6))));
    map.spoil = 0.001;
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = 0; j < n; ++j) {
            const Vec3 at{kTile * static_cast<double>(i), kTile * static_cast<double>(j), 0};
            map.box(at + Vec3{0, 0, -16}, at + Vec3{kTile, kTile, 0});
        }
    map.spoil = 0;
    const double side = kTile * static_cast<double>(n);
    map.hall({0, 0, -16}, {side, side, kHigh}, 16);
    return map.finish({16, 16, 40});
}

} // namespace

std::string make_map(Soup soup, std::size_t brushes) {
    if (soup == Soup::city) return make_city(brushes);
    return soup == Soup::tiles ? make_tiles(brushes) : make_soup(soup, brushes);
}

} // namespace kiln::bench

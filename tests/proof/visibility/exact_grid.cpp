#include "tests/proof/visibility/exact_grid.h"
#include <algorithm>

namespace kiln::proof {
namespace {

struct Point {
    long x = 0, y = 0;
    friend bool operator==(Point, Point) = default;
};
long turn(Point a, Point b, Point c) { return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x); }
bool on_segment(Point p, Point a, Point b) { // ends included
    return turn(a, b, p) == 0 && std::min(a.x, b.x) <= p.x && p.x <= std::max(a.x, b.x) && std::min(a.y, b.y) <= p.y && p.y <= std::max(a.y, b.y);
}
int sign(long v) { return (v > 0) - (v < 0); }
bool segments_meet(Point a, Point b, Point c, Point d) {
    if (sign(turn(a, b, c)) * sign(turn(a, b, d)) < 0 && sign(turn(c, d, a)) * sign(turn(c, d, b)) < 0) return true;
    return on_segment(c, a, b) || on_segment(d, a, b) || on_segment(a, c, d) || on_segment(b, c, d);
}
bool in_triangle(Point p, Point a, Point b, Point c) {
    const int u = sign(turn(a, b, p)), v = sign(turn(b, c, p)), w = sign(turn(c, a, p));
    if (turn(a, b, c) == 0) return on_segment(p, a, b) || on_segment(p, b, c) || on_segment(p, c, a);
    return (u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0);
}

using Points = std::vector<Point>;
// Does adding p to `own` keep it parted from `other`? Everything without p is known to be.
bool still_parted(const Points& own, Point p, const Points& other) {
    for (std::size_t i = 0; i < other.size(); ++i) {
        if (other[i] == p) return false;
        for (std::size_t k = i + 1; k < other.size(); ++k) {
            if (on_segment(p, other[i], other[k])) return false;
            for (std::size_t m = k + 1; m < other.size(); ++m)
                if (in_triangle(p, other[i], other[k], other[m])) return false;
            for (const Point q : own)
                if (segments_meet(p, q, other[i], other[k])) return false;
        }
        for (std::size_t k = 0; k < own.size(); ++k) {
            if (on_segment(other[i], p, own[k])) return false;
            for (std::size_t m = k + 1; m < own.size(); ++m)
                if (in_triangle(other[i], p, own[k], own[m])) return false;
        }
    }
    return true;
}

struct Search {
    const test::GridMap& map;
    std::vector<char>& seen;
    int dx, dy, start; // the quadrant
    Points left, right;

    void go(int x, int y) {
        const int here = map.at(x, y);
        seen[static_cast<std::size_t>(start) * map.cluster_count + static_cast<std::size_t>(here)] = 1;
        for (const bool across : {true, false}) {
            const int nx = x + (across ? dx : 0), ny = y + (across ? 0 : dy);
            if (map.at(nx, ny) < 0) continue;
            Point a, b; // of the edge crossed
            if (across) a = {x + (dx > 0), y}, b = {x + (dx > 0), y + 1};
            else a = {x, y + (dy > 0)}, b = {x + 1, y + (dy > 0)};
            // Left of the way (dx, dy) is where the end lies farther along (-dy, dx).
            if (-dy * a.x + dx * a.y < -dy * b.x + dx * b.y) std::swap(a, b);
            const auto known = [](const Points& points, Point p) { return std::ranges::find(points, p) != points.end(); };
            const bool new_left = !known(left, a), new_right = !known(right, b);
            if (new_left && !still_parted(left, a, right)) continue;
            if (new_left) left.push_back(a);
            const bool parted = !new_right || still_parted(right, b, left);
            if (parted) {
                if (new_right) right.push_back(b);
                go(nx, ny);
                if (new_right) right.pop_back();
            }
            if (new_left) left.pop_back();
        }
    }
};

} // namespace

std::vector<char> exact_pairs(const test::GridMap& map) {
    std::vector<char> seen(std::size_t{map.cluster_count} * map.cluster_count, 0);
    for (int y = 0; y < map.height; ++y)
        for (int x = 0; x < map.width; ++x)
            if (map.at(x, y) >= 0)
                for (const int dx : {1, -1})
                    for (const int dy : {1, -1}) Search{map, seen, dx, dy, map.at(x, y), {}, {}}.go(x, y);
    return seen;
}

} // namespace kiln::proof

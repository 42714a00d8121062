// What the air of one cell sees: which corners from where, and, where a wall crosses the cell, planes inside the wall
// that part its sides. Where walls meet in an edge no plane may have one side's air alone on it, so the planes make a tree.
#pragma once
#include "compiler/ambient/air.h"

namespace kiln::ambient {

struct Side {                              // a part of a cell's air, or, with `behind`, a plane more on the way to parts
    std::vector<std::uint32_t> samples;    // indices, ascending; none where `behind` leads on
    std::uint8_t common = 0, any = 0;      // corners seen from all, from some of them
    bool has_plane = false;
    Vec3 normal{};
    double distance = 0;
    std::uint32_t beyond = 0;              // with a plane: the side for dot(normal, p) > distance; a later one
    std::uint32_t behind = 0;              // the side for all else; 0: this one
};
struct Sides {
    std::vector<Side> sides;               // the first one has them all
    std::uint64_t rays = 0;
    bool single_valued() const;            // every side sees its corners as one, and some corner at all
};

// Where a point belongs, in Sides::sides or in what was made of them.
template <class T> std::uint32_t side_at(const std::vector<T>& sides, Vec3 p) {
    std::uint32_t at = 0;
    while (sides[at].has_plane) {
        const std::uint32_t next = dot(sides[at].normal, p) > sides[at].distance ? sides[at].beyond : sides[at].behind;
        if (next == 0) break;
        at = next;
    }
    return at;
}

// Pairs of points that do not see each other.
class Blocked {
public:
    // `points`: those it knows, and more after these. Which rays that cost is returned.
    std::uint64_t grow(const Air& air, const std::vector<Vec3>& points);
    bool operator()(std::size_t i, std::size_t j) const { return i > j ? rows_[i][j] : rows_[j][i]; } // i and j differ
    std::size_t among(const std::vector<std::uint32_t>& set) const;

private:
    std::vector<std::vector<char>> rows_; // of each point, those before it
};

// `sees[i]`: corners (bits) that points[i] sees. At most `most` sides. `blocked`: of the first points, from an earlier call; of all of them where it was needed.
Sides separate(const Air& air, const std::vector<Vec3>& points, const std::vector<std::uint8_t>& sees, std::size_t most, Blocked& blocked);

} // namespace kiln::ambient

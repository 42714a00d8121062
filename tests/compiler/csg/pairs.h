// Two boxes of any two kinds of brushes in three positions, and what must come of them by the definition of contents:
// computed cell by cell from points just off each face, without a line of the CSG.
#pragma once
#include "tests/support/world_builder.h"
#include <map>
#include <string>

namespace kiln::test {

struct PairKind {
    const char* name;
    Contents contents;
    std::uint32_t flags = 0; // of its material
    int rank = -1;           // strength, 0 the strongest; -1: fills nothing
};
// In order of strength; the two solids are equals.
inline constexpr PairKind kPairKinds[] = {
    {"solid", Contents::solid, 0, 0},
    {"sky", Contents::solid, kSky, 0},
    {"detail", Contents::detail, 0, 1},
    {"window", Contents::window, kTranslucent, 2},
    {"grate", Contents::grate, kAlphaTested, 3},
    {"lava", Contents::lava, kWater | kLava | kNoLight, 4},
    {"slime", Contents::slime, kWater | kSlime | kNoLight, 5},
    {"water", Contents::water, kWater | kNoLight, 6},
    {"player clip", Contents::clip, kClip | kStopsPlayers},
    {"area portal", Contents::area_portal, kAreaPortal},
    {"hint", Contents::hint, kHint},
};
enum class Position { half, containing, abutting };
inline constexpr Position kPositions[] = {Position::half, Position::containing, Position::abutting};

struct PairBoxes {
    Box3 a, b; // no two of their planes coincide, but for the pair that abuts
};
inline PairBoxes boxes_of(Position position) {
    const Box3 a{{0, 0, 0}, {64, 64, 64}};
    switch (position) {
    case Position::half: return {a, {{32, 8, 16}, {96, 56, 48}}};
    case Position::containing: return {a, {{16, 8, 24}, {48, 56, 40}}};
    default: return {a, {{64, 8, 16}, {128, 56, 48}}};
    }
}
inline bool holds(const Box3& box, Vec3 p) {
    for (std::size_t k = 0; k < 3; ++k)
        if (p[k] <= box.lo[k] || p[k] >= box.hi[k]) return false;
    return true;
}

// Area by (brush 0 or 1, axis * 2 + high side, contents in front).
using FaceAreas = std::map<std::array<int, 3>, double>;

inline FaceAreas expected_areas(const PairKind& first, const PairKind& second, Position position) {
    const auto [a, b] = boxes_of(position);
    const Box3 boxes[2] = {a, b};
    const PairKind kinds[2] = {first, second};
    FaceAreas areas;
    for (int self = 0; self < 2; ++self) {
        const PairKind &kind = kinds[self], &other = kinds[1 - self];
        const Box3 &box = boxes[self], &theirs = boxes[1 - self];
        if (kind.contents == Contents::clip) continue;
        for (std::size_t axis = 0; axis < 3; ++axis)
            for (int high = 0; high < 2; ++high) {
                const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
                constexpr double kCell = 8; // divides all coordinates
                for (double i = box.lo[u]; i < box.hi[u]; i += kCell)
                    for (double j = box.lo[v]; j < box.hi[v]; j += kCell) {
                        Vec3 off; // just in front of the middle of a cell of the face
                        off[axis] = high ? box.hi[axis] + 0.5 : box.lo[axis] - 0.5;
                        off[u] = i + kCell / 2, off[v] = j + kCell / 2;
                        int front = static_cast<int>(Contents::empty);
                        if (kind.rank >= 0 && other.rank >= 0 && holds(theirs, off)) {
                            if (other.rank <= kind.rank) continue; // taken away
                            front = static_cast<int>(other.contents);
                        }
                        areas[{self, static_cast<int>(axis) * 2 + high, front}] += kCell * kCell;
                    }
            }
    }
    return areas;
}

// Brush 0 and 1 of the result are `first` and `second`, whichever was written first in the file.
inline World pair_world(const PairKind& first, const PairKind& second, Position position, bool swapped, Vec3 shift = {},
                        std::array<BrushId, 2>* ids = nullptr, WorldBuilder builder = {}) {
    auto [a, b] = boxes_of(position);
    for (Box3* box : {&a, &b}) box->lo += shift, box->hi += shift;
    std::array<BrushId, 2> out;
    const auto add = [&](const PairKind& k, const Box3& box, std::size_t i) {
        const MaterialId m = builder.material(k.name, k.flags);
        out[i] = builder.box(box.lo, box.hi, k.contents, {0}, m);
    };
    if (swapped) add(second, b, 1);
    add(first, a, 0);
    if (!swapped) add(second, b, 1);
    if (ids) *ids = out;
    return builder.world;
}

} // namespace kiln::test

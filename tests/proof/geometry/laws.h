// What must hold of any world, as code: each law returns what it found wrong, in words, and how much it looked at.
// The same functions run on small scenes in the suite and on whole maps in `prove`.
#pragma once
#include "compiler/bsp/bsp.h"
#include "tests/proof/geometry/field.h"
#include <functional>
#include <iosfwd>
#include <map>
#include <optional>
#include <string>

namespace kiln::proof {

struct Findings {
    std::vector<std::string> wrong; // at most kMost are spelled out
    std::size_t count = 0;          // of things wrong
    std::size_t checked = 0;
    static constexpr std::size_t kMost = 8;
    void add(std::string what) {
        if (count++ < kMost) wrong.push_back(std::move(what));
    }
    bool ok() const { return count == 0; }
};
std::ostream& operator<<(std::ostream& out, const Findings& f); // for test messages

// The area vectors of the structural solids' boundary sum to zero, exactly, for each model; and each brush's own do.
Findings closure(const World& world, const Csg& csg);

// Leaves tile the world's box and the solid ones fill exactly the union of the structural brushes: volumes, exactly.
// `bsp`: as built, filled or not.
Findings volumes(const Csg& csg, const Bsp& bsp);

// Random grid points: each lies in exactly one leaf (or on a boundary: left out), the one that the tree leads to, which
// has the contents of the strongest brush there and lists every brush that holds the point.
Findings points_in_leaves(const World& world, const Csg& csg, const Bsp& bsp, std::size_t count, std::uint64_t seed);

// `bsp` not filled: each portal lies in the boundary of its two leaves on opposite sides; and face by face the boundary
// of each open leaf is made up of portals and of the union's boundary, exactly.
Findings portals(const Csg& csg, const Bsp& bsp);

// `bsp` filled: inside, what bounds an open leaf is portals, the union's boundary and closed gaps; here in sum over the
// whole inside: the area vectors of all that closes it vanish, exactly.
Findings inside_is_closed(const World& world, const Csg& csg, const Bsp& bsp);

// Leaf -> brush lists are exactly the brushes with volume in the leaf.
Findings brush_lists(const World& world, const Csg& csg, const Bsp& bsp);

// A grid-preserving motion: x'[k] = sign[k] * x[axis[k]] + shift[k].
struct Motion {
    std::array<std::size_t, 3> axis{0, 1, 2};
    std::array<int, 3> sign{1, 1, 1};
    std::array<std::int64_t, 3> shift{}; // map units
    bool mirrors() const;
};
World moved(const World& world, const Motion& motion);
World shuffled(const World& world, std::uint64_t seed); // brushes in another order

// Regions of planes in a form that does not depend on how they are cut up: per class and oriented plane the corners of
// their boundary, each on its line. Two sets of polygons that cover the same region of each plane have equal forms.
struct Corner {
    std::uint64_t key = 0;           // class
    F3 normal;                       // the oriented plane: normal divided by d, or by its first part that is not 0
    F d;
    int facing = 0;                  // sign of that divisor
    std::array<F, 6> line;           // Pluecker, its first part that is not 0 made 1
    F3 point;
    std::int64_t jumps = 0;
    friend auto operator<=>(const Corner&, const Corner&) = default;
};
using Form = std::vector<Corner>; // sorted, jumps never 0
// `key` of each fragment, visible part: e.g. its contents; fragments for which it gives nothing are left out.
Form form_of(const Csg& csg, const Motion& motion, const std::function<std::optional<std::uint64_t>(const Fragment&)>& key);
Form form_of(const Csg& csg, const Bsp& bsp, const Motion& motion,
             const std::function<std::optional<std::uint64_t>(const Fragment&)>& key); // visible parts
// Volume of the leaves inside, by contents: six times it, exactly. Signed by the motion's handedness: always positive.
std::map<int, F> inside_volumes(const Bsp& bsp);

} // namespace kiln::proof

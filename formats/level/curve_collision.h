// SPDX-License-Identifier: MIT
// Displacements and curved patches as traces want them: their triangles under a tree of boxes for each model. Private.
//
// A grid is its own hierarchy: halved along its longer side down to two by two quads, with boxes put together on the way
// back. Only over whole curves a tree is built by sorting, so that the first trace of a large level is not slow.
#pragma once
#include "formats/level/kiln_level.h"
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

struct kiln_level;

namespace kiln::level {

struct Curves {
    struct Curve {
        std::uint32_t displacement, patch; // one of them is KILN_NO_INDEX
        std::uint32_t contents;            // KILN_CONTENTS_ bit; 0: it stops nothing
        std::uint32_t stops;               // KILN_FOR_ bits
        bool for_boxes, for_rays;
        std::uint32_t columns, rows;       // of vertices; at least two
        std::uint32_t first_vertex, first_quad;
    };
    struct Node {
        float lo[3], hi[3];
        std::uint32_t curve; // of a leaf: up to 2 x 2 quads from quad `at` on; KILN_NO_INDEX: no leaf, but
        std::uint32_t at;    // the second child; the first is the next node
    };
    struct Triangle {
        const float* corner[3];
    };
    std::vector<Curve> curves; // displacements, then patches, without those that stop nothing
    std::vector<std::array<float, 3>> vertices;
    std::vector<Node> nodes;
    std::map<std::uint32_t, std::uint32_t> root_of_model; // nodes; only of models with curves

    // Triangle 2q + k of quad q = row * (columns - 1) + column: the one at the quad's first column, then the one at its
    // second. Turned as the drawn ones are. The diagonal joins the corners whose row + column is even.
    Triangle triangle(const Curve& c, std::uint32_t quad, std::uint32_t k) const {
        const std::uint32_t row = quad / (c.columns - 1), column = quad % (c.columns - 1);
        const auto corner = [&](std::uint32_t r, std::uint32_t s) {
            return vertices[std::size_t{c.first_vertex} + std::size_t{row + r} * c.columns + column + s].data();
        };
        if ((row + column) % 2 == 0) return k == 0 ? Triangle{{corner(0, 0), corner(1, 1), corner(1, 0)}} : Triangle{{corner(0, 0), corner(0, 1), corner(1, 1)}};
        return k == 0 ? Triangle{{corner(0, 0), corner(0, 1), corner(1, 0)}} : Triangle{{corner(0, 1), corner(1, 1), corner(1, 0)}};
    }
};
Curves make_curves(const kiln_level& level); // throws Failure, Damaged

// A box on its way: [start + t way + lo, start + t way + hi], t from 0 to 1.
struct Way {
    double start[3], way[3], lo[3], hi[3];

    // The stretch up to `last` in which the box overlaps another one; false: none.
    bool meets(const auto* box_lo, const auto* box_hi, double last, double& from) const {
        from = 0;
        double to = last;
        for (std::size_t k = 0; k < 3; ++k) {
            const double below = box_lo[k] - hi[k] - start[k], above = box_hi[k] - lo[k] - start[k];
            if (way[k] == 0) {
                if (below > 0 || above < 0) return false;
                continue;
            }
            const double a = below / way[k], b = above / way[k];
            from = std::max(from, std::min(a, b)), to = std::min(to, std::max(a, b));
            if (from > to) return false;
        }
        return true;
    }
};

// Calls visit(curve, quad) for all quads of the leaves that the box comes by, near leaves first, up to last() of the way,
// which may become less at each visit.
template <class Last, class Visit> void walk_curves(const Curves& c, std::uint32_t model, const Way& way, const Last& last, const Visit& visit) {
    const auto found = c.root_of_model.find(model);
    if (found == c.root_of_model.end()) return;
    const std::uint32_t root = found->second;
    struct Frame {
        std::uint32_t node;
        double from;
    };
    // Curves, then the rows and columns of a grid are halved: all of them together have fewer than 2^32 vertices.
    std::array<Frame, 72> stack;
    std::size_t size = 0;
    const auto push = [&](const Frame& f) { stack[size++] = f; };
    const auto meets = [&](std::uint32_t n, double& from) { return way.meets(c.nodes[n].lo, c.nodes[n].hi, last(), from); };
    Frame f{root, 0};
    if (meets(root, f.from)) push(f);
    while (size > 0) {
        f = stack[--size];
        if (f.from > last()) continue;
        const Curves::Node& n = c.nodes[f.node];
        if (n.curve == KILN_NO_INDEX) {
            Frame a{f.node + 1, 0}, b{n.at, 0};
            const bool in_a = meets(a.node, a.from), in_b = meets(b.node, b.from);
            const bool a_first = a.from <= b.from;
            if (in_b && a_first) push(b);
            if (in_a) push(a);
            if (in_b && !a_first) push(b);
            continue;
        }
        const Curves::Curve& curve = c.curves[n.curve];
        const std::uint32_t across = curve.columns - 1, row = n.at / across, column = n.at % across;
        for (std::uint32_t r = row; r < std::min(row + 2, curve.rows - 1); ++r)
            for (std::uint32_t s = column; s < std::min(column + 2, across); ++s) visit(curve, r * across + s);
    }
}

} // namespace kiln::level

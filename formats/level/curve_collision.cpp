// SPDX-License-Identifier: MIT
// What of displacements and patches stops whom, and the trees over their grids.
#include "formats/level/curve_collision.h"
#include "formats/level/level_state.h"
#include <cmath>
#include <limits>

namespace kiln::level {

namespace {

struct Stops {
    std::uint32_t contents, who;
};

// As the compiler tells brushes by their sides (compiler/world/contents.cpp), from one side: a sheet has but one
// material. What fills a space (liquids, triggers) has no meaning for a sheet, which encloses none: it stops nothing.
Stops stops_of_material(std::uint32_t flags, bool displacement) {
    const auto has = [&](std::uint32_t bit) { return (flags >> bit & 1) != 0; }; // bits: FORMAT.md
    constexpr std::uint32_t kPlayers = KILN_FOR_PLAYERS, kNpcs = KILN_FOR_NPCS, kBullets = KILN_FOR_BULLETS, kSight = KILN_FOR_SIGHT;
    const Stops wall{static_cast<std::uint32_t>(has(10) ? KILN_CONTENTS_DETAIL : KILN_CONTENTS_SOLID), kPlayers | kNpcs | kBullets | kSight};
    if (has(6) || has(7) || has(3)) return {0, 0}; // origin, area portal, hint
    if (has(0)) return wall;                       // sky
    if (has(8) || has(5)) return {0, 0};           // liquid, trigger
    if (has(4) || has(12)) {                       // clip, invisible
        const std::uint32_t who = (has(19) ? kPlayers : 0) | (has(20) ? kNpcs : 0) | (has(21) ? kBullets : 0) | (has(22) ? kSight : 0);
        return {KILN_CONTENTS_CLIP, who ? who : kPlayers | kNpcs};
    }
    if (has(11)) return {KILN_CONTENTS_CLIP, kSight}; // light blocker
    if (has(2)) return {0, 0};                        // skip
    if (has(1)) return wall;                          // nodraw
    if (has(14)) return {KILN_CONTENTS_WINDOW, 0};    // non-solid
    if (has(9)) return {KILN_CONTENTS_WINDOW, kPlayers | kNpcs | kBullets};
    // Bullets pass the grates of Source, where displacements come from, not those of the older games.
    if (has(18)) return {KILN_CONTENTS_GRATE, kPlayers | kNpcs | (displacement ? 0 : kBullets)};
    return wall;
}

class TreeBuilder {
public:
    explicit TreeBuilder(Curves& out) : out_(out) {}

    void add_curve(Curves::Curve c, std::uint32_t model, const auto& vertex) { // vertex(i): of its grid
        if (c.columns < 2 || c.rows < 2 || c.contents == 0) return;
        const std::uint64_t vertices = std::uint64_t{c.columns} * c.rows, quads = std::uint64_t{c.columns - 1} * (c.rows - 1);
        require(out_.vertices.size() + vertices < UINT32_MAX && quads_ + quads < UINT32_MAX, "more vertices of curves than an index can name");
        c.first_vertex = static_cast<std::uint32_t>(out_.vertices.size()), c.first_quad = quads_;
        quads_ += static_cast<std::uint32_t>(quads);
        Box box;
        for (std::uint32_t i = 0; i < vertices; ++i) {
            const float* p = vertex(i);
            out_.vertices.push_back({p[0], p[1], p[2]});
            box.add(p, p);
        }
        of_model_[model].push_back(static_cast<std::uint32_t>(out_.curves.size()));
        boxes_.push_back(box);
        out_.curves.push_back(c);
    }

    void build() {
        for (auto& [model, curves] : of_model_) {
            out_.root_of_model[model] = static_cast<std::uint32_t>(out_.nodes.size());
            add_tree(curves);
        }
    }

private:
    struct Box {
        static constexpr float kFar = std::numeric_limits<float>::infinity();
        float lo[3] = {kFar, kFar, kFar}, hi[3] = {-kFar, -kFar, -kFar};
        void add(const float* l, const float* h) {
            for (std::size_t k = 0; k < 3; ++k) lo[k] = std::min(lo[k], l[k]), hi[k] = std::max(hi[k], h[k]);
        }
        double middle(std::size_t k) const { return double{lo[k]} + hi[k]; }
    };
    struct Grid { // quads of one curve
        std::uint32_t curve, row, column, rows, columns;
    };

    std::uint32_t add_node(std::uint32_t curve, std::uint32_t at) {
        require(out_.nodes.size() < UINT32_MAX, "more boxes of curves than an index can name");
        out_.nodes.push_back({{}, {}, curve, at});
        return static_cast<std::uint32_t>(out_.nodes.size() - 1);
    }
    Box close(std::uint32_t node, const Box& box) {
        std::copy(box.lo, box.lo + 3, out_.nodes[node].lo), std::copy(box.hi, box.hi + 3, out_.nodes[node].hi);
        return box;
    }
    Box close(std::uint32_t node, Box a, const auto& second) {
        out_.nodes[node].at = static_cast<std::uint32_t>(out_.nodes.size());
        const Box b = second();
        a.add(b.lo, b.hi);
        return close(node, a);
    }

    Box add_tree(std::span<std::uint32_t> curves) {
        if (curves.size() == 1) {
            const Curves::Curve& c = out_.curves[curves[0]];
            return add_grid({curves[0], 0, 0, c.rows - 1, c.columns - 1});
        }
        Box centres;
        for (const std::uint32_t c : curves) {
            float p[3];
            for (std::size_t k = 0; k < 3; ++k) p[k] = static_cast<float>(boxes_[c].middle(k));
            centres.add(p, p);
        }
        std::size_t axis = 0;
        for (std::size_t k = 1; k < 3; ++k)
            if (centres.hi[k] - centres.lo[k] > centres.hi[axis] - centres.lo[axis]) axis = k;
        const std::size_t half = curves.size() / 2;
        std::nth_element(curves.begin(), curves.begin() + static_cast<std::ptrdiff_t>(half), curves.end(), [&](std::uint32_t a, std::uint32_t b) {
            const double x = boxes_[a].middle(axis), y = boxes_[b].middle(axis);
            return x != y ? x < y : a < b;
        });
        const std::uint32_t node = add_node(KILN_NO_INDEX, 0);
        const Box first = add_tree(curves.first(half));
        return close(node, first, [&] { return add_tree(curves.subspan(half)); });
    }

    Box add_grid(const Grid& g) {
        const Curves::Curve& c = out_.curves[g.curve];
        if (g.rows <= 2 && g.columns <= 2) {
            Box box;
            for (std::uint32_t r = g.row; r <= g.row + g.rows; ++r)
                for (std::uint32_t s = g.column; s <= g.column + g.columns; ++s) {
                    const float* p = out_.vertices[std::size_t{c.first_vertex} + std::size_t{r} * c.columns + s].data();
                    box.add(p, p);
                }
            return close(add_node(g.curve, g.row * (c.columns - 1) + g.column), box);
        }
        // Cut at even places, so that leaves are two wide save at the end.
        Grid a = g, b = g;
        if (g.rows >= g.columns) a.rows = (g.rows / 2 + 1) & ~1u, b.row += a.rows, b.rows -= a.rows;
        else a.columns = (g.columns / 2 + 1) & ~1u, b.column += a.columns, b.columns -= a.columns;
        const std::uint32_t node = add_node(KILN_NO_INDEX, 0);
        const Box first = add_grid(a);
        return close(node, first, [&] { return add_grid(b); });
    }

    Curves& out_;
    std::vector<Box> boxes_;                                     // of the curves
    std::map<std::uint32_t, std::vector<std::uint32_t>> of_model_; // curves
    std::uint32_t quads_ = 0;
};

} // namespace

Curves make_curves(const kiln_level& level) {
    Curves out;
    const auto part = [&](const auto* value, std::uint32_t lump) {
        if (value) return value;
        const kiln_status status = level.fault_of(lump);
        throw Failure{status, kiln_status_text(status)};
    };
    const bool displaced = level.find(fourcc("DISP")) != level.entries.size(), patched = level.find(fourcc("CURV")) != level.entries.size();
    if (!displaced && !patched) return out;
    const Materials& materials = *part(level.get_materials(), fourcc("MATL"));
    TreeBuilder builder(out);
    if (displaced) {
        const Displacements& table = *part(level.get_displacements(), fourcc("DISP"));
        for (std::uint32_t i = 0; i < table.rows.size(); ++i) {
            const kiln_displacement& d = table.rows[i];
            const Stops stops = stops_of_material(materials.rows[d.material].flags, true);
            const std::uint32_t side = (1u << d.power) + 1;
            constexpr std::uint32_t kNoHull = 4, kNoRay = 8;
            builder.add_curve({i, KILN_NO_INDEX, stops.contents, stops.who, !(d.flags & kNoHull), !(d.flags & kNoRay), side, side, 0, 0}, d.model,
                              [&](std::uint32_t v) { return table.vertices[std::size_t{d.first_vertex} + v].xyz_alpha; });
        }
    }
    if (patched) {
        const CurvedPatches& table = *part(level.get_curved_patches(), fourcc("CURV"));
        for (std::uint32_t i = 0; i < table.rows.size(); ++i) {
            const kiln_curved_patch& p = table.rows[i];
            const Stops stops = stops_of_material(materials.rows[p.material].flags, false);
            builder.add_curve({KILN_NO_INDEX, i, stops.contents, stops.who, true, true, p.columns, p.rows, 0, 0}, p.model,
                              [&](std::uint32_t v) { return table.vertices[std::size_t{p.first_vertex} + v].xyz_uv; });
        }
    }
    builder.build();
    return out;
}

} // namespace kiln::level

#include "compiler/world/regions.h"
#include "compiler/world/brush_box.h"
#include <algorithm>
#include <fmt/format.h>

namespace kiln {
namespace {

constexpr double kWall = 16; // map units, thickness of the walls around a region

bool painted(const DocBrush& brush, std::string_view name) {
    return !brush.sides.empty() && std::ranges::all_of(brush.sides, [&](const DocSide& s) {
        const std::string_view m = s.material;
        const std::size_t slash = m.find_last_of("/\\");
        return equal_ignoring_case(slash == std::string_view::npos ? m : m.substr(slash + 1), name);
    });
}

bool overlap_inside(const Box3& a, const Box3& b) {
    for (std::size_t k = 0; k < 3; ++k)
        if (a.lo[k] >= b.hi[k] || b.lo[k] >= a.hi[k]) return false;
    return true;
}
bool holds(const Box3& a, Vec3 p) {
    for (std::size_t k = 0; k < 3; ++k)
        if (p[k] < a.lo[k] || p[k] > a.hi[k]) return false;
    return true;
}

DocBrush box_brush(const Box3& box, const DocBrush& like) {
    DocBrush brush{like.line, like.id, like.file, {}};
    for (std::size_t k = 0; k < 3; ++k)
        for (const bool high : {false, true}) {
            const std::size_t u = (k + 1) % 3, v = (k + 2) % 3;
            std::array<Vec3, 3> p{box.lo, box.lo, box.lo};
            for (Vec3& x : p) x[k] = high ? box.hi[k] : box.lo[k];
            p[high ? 2 : 1][u] += 1, p[high ? 1 : 2][v] += 1; // clockwise seen from outside
            DocSide side;
            side.line = like.sides[0].line, side.id = static_cast<int>(brush.sides.size());
            side.material = "skip"; // solid, not drawn
            for (std::size_t i = 0; i < 3; ++i)
                for (std::size_t j = 0; j < 3; ++j) side.points[i][j] = *parse_decimal(fmt::format("{}", p[i][j]));
            side.texture.u_axis = k == 0 ? Vec3{0, 1, 0} : Vec3{1, 0, 0};
            side.texture.v_axis = k == 2 ? Vec3{0, -1, 0} : Vec3{0, 0, -1};
            brush.sides.push_back(std::move(side));
        }
    return brush;
}

} // namespace

bool is_region_brush(const DocBrush& brush) { return painted(brush, "region") || painted(brush, "antiregion"); }

bool Regions::keeps(const Box3& b) const {
    if (box && !overlap(*box, b)) return false;
    return std::ranges::none_of(without, [&](const Box3& w) { return overlap_inside(w, b); });
}
bool Regions::keeps(Vec3 point) const {
    if (box && !holds(*box, point)) return false;
    return std::ranges::none_of(without, [&](const Box3& w) { return holds(w, point); });
}

Regions find_regions(const Document& document, const std::vector<std::uint8_t>& omitted, Context& context) {
    Regions regions;
    if (document.format == MapFormat::vmf) return regions; // Hammer has cordons
    const DocBrush* first = nullptr;
    for (std::size_t e = 0; e < document.entities.size(); ++e) {
        if (omitted[e]) continue;
        for (const DocBrush& b : document.entities[e].brushes) {
            const bool is_region = painted(b, "region");
            if (!is_region && !painted(b, "antiregion")) continue;
            const Box3 box = box_of(b);
            if (box.empty()) continue; // the CSG stage says what is wrong with it
            if (!is_region) {
                regions.without.push_back(box);
                continue;
            }
            if (!regions.box) regions.box = box, first = &b;
            else {
                regions.box->add(box);
                context.report(Severity::warning, "second-region", "there is another region brush; what touches the box around all of them is compiled",
                               {document.name_of(b.file), b.line, document.entities[e].id, b.id});
            }
        }
    }
    if (!regions.box) return regions;
    const Box3 in = *regions.box;
    for (std::size_t k = 0; k < 3; ++k)
        for (const bool high : {false, true}) {
            Box3 wall = in;
            for (std::size_t j = 0; j < k; ++j) wall.lo[j] -= kWall, wall.hi[j] += kWall; // the walls abut, none overlaps another
            (high ? wall.lo : wall.hi)[k] = high ? in.hi[k] : in.lo[k];
            (high ? wall.hi : wall.lo)[k] = high ? in.hi[k] + kWall : in.lo[k] - kWall;
            regions.walls.push_back(box_brush(wall, *first));
        }
    return regions;
}

} // namespace kiln

#include "compiler/surfaces/corner_cells.h"
#include "compiler/surfaces/curves.h"
#include <algorithm>

namespace kiln {
namespace {

// Map units: of the border's line and from its ends. What the text of a map says of one place differs by less; the
// grid that planes are rounded to is as fine.
constexpr double kTouch = 1.0 / 1024;

// The places of a grid around its border, counter-clockwise seen from the front.
std::vector<std::uint32_t> border_of(const CurveGrid& g) {
    std::vector<std::uint32_t> places;
    for (std::uint32_t c = 0; c + 1 < g.columns; ++c) places.push_back(g.at(0, c));
    for (std::uint32_t r = 0; r + 1 < g.rows; ++r) places.push_back(g.at(r, g.columns - 1));
    for (std::uint32_t c = g.columns - 1; c > 0; --c) places.push_back(g.at(g.rows - 1, c));
    for (std::uint32_t r = g.rows - 1; r > 0; --r) places.push_back(g.at(r, 0));
    return places;
}

} // namespace

void add_touching(CurveGrids& grids) {
    std::map<std::pair<std::uint32_t, int>, std::vector<std::uint32_t>> groups; // by model and kind: they share no vertices
    for (std::uint32_t i = 0; i < grids.grids.size(); ++i) groups[{grids.grids[i].model.value, grids.grids[i].kind}].push_back(i);
    for (const auto& [key, members] : groups) {
        if (members.size() < 2) continue;
        std::vector<std::uint32_t> on_borders;
        for (const std::uint32_t i : members)
            for (const std::uint32_t place : border_of(grids.grids[i])) on_borders.push_back(grids.grids[i].vertices[place]);
        std::ranges::sort(on_borders);
        on_borders.erase(std::unique(on_borders.begin(), on_borders.end()), on_borders.end());
        const CornerCells<std::uint32_t> cells(on_borders, [&](std::uint32_t v) { return grids.positions[v]; });
        for (const std::uint32_t i : members) {
            CurveGrid& g = grids.grids[i];
            const std::vector<std::uint32_t> places = border_of(g);
            std::vector<std::uint32_t> own(g.vertices);
            std::ranges::sort(own);
            for (std::size_t k = 0; k < places.size(); ++k) {
                const std::uint32_t from = places[k], to = places[(k + 1) % places.size()];
                const Vec3 a = grids.positions[g.vertices[from]], d = grids.positions[g.vertices[to]] - a;
                const double size = length(d);
                if (!(size > 2 * kTouch)) continue;
                std::vector<CurveGrid::Guest> found;
                cells.along(a, a + d, kTouch, [&](std::uint32_t v, Vec3 p) {
                    const double along = dot(p - a, d) / size;
                    if (along < kTouch || along > size - kTouch || std::ranges::binary_search(own, v)) return;
                    if (length(p - a - d * (along / size)) <= kTouch) found.push_back({along / size, v});
                });
                if (found.empty()) continue;
                std::vector<CurveGrid::Guest>& guests = g.guests[{from, to}];
                guests.insert(guests.end(), found.begin(), found.end());
                std::ranges::sort(guests, [](const auto& x, const auto& y) { return std::tie(x.at, x.vertex) < std::tie(y.at, y.vertex); });
                std::vector<CurveGrid::Guest> once; // what was sewn already; two vertices at one place would only make slivers
                for (const CurveGrid::Guest& guest : guests)
                    if (std::ranges::find(once, guest.vertex, &CurveGrid::Guest::vertex) == once.end() && (once.empty() || guest.at > once.back().at)) once.push_back(guest);
                guests.swap(once);
            }
        }
    }
}

} // namespace kiln

// What the readers give: ids, counts and numbers.
#include "compiler/verify/verify.h"
#include <fmt/format.h>
#include <set>

namespace kiln {
namespace {

bool finite(Vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

class Reader {
public:
    Reader(const Document& document, Checker& checker) : d(document), checker_(checker) {}
    void check() {
        Check &ids = checker_.add("document-ids"), &brushes = checker_.add("document-brushes"), &sides = checker_.add("document-sides"),
              &patches = checker_.add("document-patches");
        std::set<std::pair<std::uint16_t, int>> entity_ids;
        std::vector<int> displaced(d.displacements.size());
        std::vector<SourceLocation> carrier(d.displacements.size(), SourceLocation{d.file});
        for (const DocEntity& e : d.entities) {
            const SourceLocation where{e.file <= d.included.size() ? d.name_of(e.file) : d.file, e.line, e.id};
            // The world counts for itself, and copies of what an instance holds keep the ids of its file.
            if (e.file == 0 && &e != &d.entities[0])
                ids.expect(entity_ids.insert({e.file, e.id}).second, [&] { return Finding{where, "another entity has the same id"}; });
            ids.expect(e.file <= d.included.size(), [&] { return Finding{where, "it comes from a file that is not known"}; });
            std::set<int> ordinals;
            for (const DocBrush& b : e.brushes) {
                SourceLocation at = where;
                at.brush = b.id, at.line = b.line;
                if (d.format != MapFormat::vmf && b.file == 0) brushes.expect(ordinals.insert(b.id).second, [&] { return Finding{at, "another brush of the entity has the same number"}; });
                brushes.expect(!b.sides.empty(), [&] { return Finding{at, "a brush without sides"}; });
                brushes.expect(b.line > 0, [&] { return Finding{at, "a brush without a line"}; });
                for (const DocSide& s : b.sides) {
                    at.line = s.line, at.side = s.id;
                    const auto tell = [&](const char* what) { return [&, what] { return Finding{at, what}; }; };
                    bool in_range = true;
                    for (const auto& p : s.points)
                        for (const Decimal& x : p) in_range = in_range && std::abs(x.to_double()) <= kLargestCoordinate;
                    sides.expect(in_range, tell("a plane point out of range"));
                    const DocTexture& t = s.texture;
                    sides.expect(finite(t.u_axis) && finite(t.v_axis) && std::isfinite(t.u_shift) && std::isfinite(t.v_shift) && std::isfinite(t.u_scale) &&
                                     std::isfinite(t.v_scale) && t.u_scale != 0 && t.v_scale != 0,
                                 tell("a texture projection that is none"));
                    sides.expect(!s.material.empty(), tell("a side without a material"));
                    if (s.displacement == -1) continue;
                    if (sides.expect(s.displacement >= 0 && static_cast<std::size_t>(s.displacement) < displaced.size(), tell("it names a displacement that does not exist")))
                        ++displaced[static_cast<std::size_t>(s.displacement)], carrier[static_cast<std::size_t>(s.displacement)] = at;
                }
            }
            for (const DocPatch& p : e.patches) {
                SourceLocation at = where;
                at.brush = p.id, at.line = p.line;
                patches.expect(p.columns >= 3 && p.rows >= 3 && p.columns % 2 == 1 && p.rows % 2 == 1, [&] { return Finding{at, "a patch needs odd counts of control points, from 3"}; });
                patches.expect(p.points.size() == std::size_t{p.columns} * p.rows && p.uv.size() == p.points.size(), [&] { return Finding{at, "a patch's tables do not fit its size"}; });
                patches.expect(std::ranges::all_of(p.points, finite), [&] { return Finding{at, "a control point is no number"}; });
            }
        }
        Check& grids = checker_.add("document-displacements");
        for (std::size_t i = 0; i < d.displacements.size(); ++i) {
            const DocDisplacement& g = d.displacements[i];
            SourceLocation at = carrier[i];
            at.line = g.line;
            grids.expect(displaced[i] == 1, [&] { return Finding{at, fmt::format("{} sides carry the displacement", displaced[i])}; });
            if (g.power == 0) continue; // nothing could be read of it, and the reader said so
            if (!grids.expect(g.power >= 2 && g.power <= 4, [&] { return Finding{at, fmt::format("its power is {}", g.power)}; })) continue;
            const std::size_t edge = (std::size_t{1} << g.power) + 1, n = edge * edge;
            const auto fits = [&](const auto& table, std::size_t count) { return table.empty() || table.size() == count; };
            grids.expect(fits(g.normals, n) && fits(g.distances, n) && fits(g.offsets, n) && fits(g.offset_normals, n) && fits(g.alphas, n) && fits(g.multiblend, n) &&
                             fits(g.alphablend, n) && fits(g.triangle_tags, 2 * (edge - 1) * (edge - 1)),
                         [&] { return Finding{at, "a table of it does not fit its power"}; });
        }
    }

private:
    const Document& d;
    Checker& checker_;
};

} // namespace

void verify_document(const Document& document, Checker& checker) { Reader(document, checker).check(); }
void verify_world(const World& world, Checker& checker) { check_invariants(world, checker); }

} // namespace kiln

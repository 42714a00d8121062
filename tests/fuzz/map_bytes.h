// What every run of map bytes must hold, whatever they are: a fault or a document that keeps its promises, and a world of it
// that keeps its own. Shared by the fuzz targets and the replay of what they once found.
#pragma once
#include "compiler/world/world.h"
#include "formats/quake_map/quake_map.h"
#include "formats/vmf/vmf.h"
#include "libs/core/check.h"
#include <cmath>

namespace kiln::fuzz {

inline bool finite(Vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

inline void check_diagnostic(const Diagnostic& d, const std::string& file) {
    KILN_CHECK(!d.code.empty() && !d.message.empty());
    KILN_CHECK(d.where.file == file);
    KILN_CHECK(d.where.line > 0);
    for (const char c : d.message) KILN_CHECK(c >= ' ' && c < 127); // fit for a terminal
}

inline void check_document(const Document& document) {
    KILN_CHECK(!document.entities.empty());
    std::size_t displaced = 0;
    for (const DocEntity& e : document.entities) {
        for (const DocKey& k : e.keys) KILN_CHECK(k.line > 0);
        for (const DocBrush& b : e.brushes) {
            KILN_CHECK(!b.sides.empty() && b.line > 0);
            for (const DocSide& s : b.sides) {
                for (const auto& p : s.points)
                    for (const Decimal& x : p) KILN_CHECK(std::abs(x.to_double()) <= kLargestCoordinate);
                const DocTexture& t = s.texture;
                KILN_CHECK(finite(t.u_axis) && finite(t.v_axis) && std::isfinite(t.u_shift) && std::isfinite(t.v_shift));
                KILN_CHECK(std::isfinite(t.u_scale) && std::isfinite(t.v_scale) && t.u_scale != 0 && t.v_scale != 0);
                KILN_CHECK(s.lightmap_scale >= 0);
                for (const Vec3& v : s.vertices) KILN_CHECK(finite(v));
                if (s.displacement < 0) continue;
                ++displaced;
                KILN_CHECK_OP(static_cast<std::size_t>(s.displacement), <, document.displacements.size());
            }
        }
        for (const DocPatch& p : e.patches) {
            KILN_CHECK(p.columns % 2 == 1 && p.rows % 2 == 1 && p.columns >= 3 && p.rows >= 3);
            KILN_CHECK_OP(p.points.size(), ==, std::size_t{p.columns} * p.rows);
            KILN_CHECK_OP(p.uv.size(), ==, p.points.size());
            for (const Vec3& v : p.points) KILN_CHECK(finite(v));
        }
    }
    KILN_CHECK_OP(displaced, <=, document.displacements.size());
    for (const DocDisplacement& d : document.displacements) {
        KILN_CHECK(d.power >= 2 && d.power <= 4 && finite(d.start));
        const std::size_t side = (std::size_t{1} << d.power) + 1;
        const auto complete = [&](const auto& array) { return array.empty() || array.size() == side * side; };
        KILN_CHECK_OP(d.normals.size(), ==, side * side);
        KILN_CHECK(complete(d.offsets) && complete(d.offset_normals) && complete(d.distances) && complete(d.alphas));
        KILN_CHECK(complete(d.multiblend) && complete(d.alphablend) && complete(d.multiblend_colors));
        KILN_CHECK(d.triangle_tags.empty() || d.triangle_tags.size() == 2 * (side - 1) * (side - 1));
        KILN_CHECK(d.allowed_vertices.empty() || d.allowed_vertices.size() == 10);
    }
    for (const DocCordon& c : document.cordons) KILN_CHECK(finite(c.box.lo) && finite(c.box.hi) && !c.box.empty());
}

using ReadMap = Result<Document> (*)(std::span<const std::uint8_t>, const std::string&, Context&);

inline void run(ReadMap read, std::span<const std::uint8_t> bytes) {
    static const std::string file = "fuzzed";
    Context context;
    const Result<Document> document = read(bytes, file, context);
    for (const Diagnostic& d : context.diagnostics()) check_diagnostic(d, file);
    if (!document) {
        KILN_CHECK(document.fault().exit == Exit::input);
        check_diagnostic(document.fault().diagnostic, file);
        return;
    }
    check_document(*document);
    MaterialDatabase materials;
    const Result<World> world = build_world(*document, materials, {}, context);
    for (const Diagnostic& d : context.diagnostics()) KILN_CHECK(!d.code.empty() && !d.message.empty());
    if (world) validate(*world);
}

} // namespace kiln::fuzz

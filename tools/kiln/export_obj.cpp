#include "compiler/surfaces/curves.h"
#include "formats/level/kiln_level.hpp"
#include "tools/kiln/export.h"
#include <fmt/format.h>

namespace kiln {
namespace {

ObjMaterial obj_material(const std::string& name, Vec3f reflectance, Vec3f emission, float alpha, const std::string& map) { return {name, reflectance, emission, alpha, map}; }

class OfMap {
public:
    explicit OfMap(const Compiled& compiled) : c(compiled) {
        for (const Material& m : c.world.materials) out.materials.push_back(obj_material(m.name, m.reflectance, m.emission, m.alpha, m.albedo_map));
    }
    ObjExport out;

    ObjExport brushes(double curve_flatness) {
        for (std::size_t b = 0; b < c.csg.brushes.size(); ++b)
            for (std::size_t f = 0; f < c.csg.brushes[b].faces.size(); ++f) add(c.csg.brushes[b].sides[f], points(c.csg.planes, c.csg.brushes[b].faces[f]));
        add_patches(curve_flatness);
        return std::move(out);
    }
    ObjExport fragments() {
        for (const Fragment& f : c.csg.fragments) add(f.side, points(c.csg.planes, f.polygon), f.covered ? " covered" : "");
        return std::move(out);
    }
    ObjExport leaves() {
        const auto polytopes = leaf_polytopes(c.bsp);
        for (std::size_t l = 0; l < polytopes.size(); ++l) {
            const BspLeaf& leaf = c.bsp.leaves[l];
            if (!leaf.cluster.valid()) continue;
            for (const PlanePolygon& f : polytopes[l])
                out.polygons.push_back({"leaves", fmt::format("leaf_{} cluster_{} area_{}", l, leaf.cluster.value, leaf.area), "leaf", points(c.bsp.planes, flipped(f)), {}, {}});
        }
        return std::move(out);
    }
    ObjExport portals() {
        for (std::size_t i = 0; i < c.bsp.portals.size(); ++i) {
            const BspPortal& p = c.bsp.portals[i];
            out.polygons.push_back({"portals", fmt::format("portal_{} leaf_{} leaf_{}", i, p.leaf_front.value, p.leaf_back.value), "portal", p.winding, {}, {}});
        }
        return std::move(out);
    }
    ObjExport visible() {
        for (const VisibleFragment& v : c.bsp.visible) add(c.csg.fragments[v.fragment].side, points(c.bsp.planes, v.polygon), fmt::format(" leaf_{}", v.leaf.value));
        return std::move(out);
    }
    ObjExport gaps() {
        for (const ClosedGap& g : c.bsp.closed) add(g.side, points(c.bsp.planes, g.polygon), fmt::format(" leaf_{}", g.leaf.value));
        return std::move(out);
    }
    ObjExport overlays() {
        for (const OverlayFragment& f : c.surfaces.overlay_fragments) {
            const WorldOverlay& o = c.world.overlays[f.overlay];
            ObjPolygon p;
            p.object = object(o.entity), p.group = fmt::format("overlay_{} face_{}", f.overlay, f.face.value), p.material = c.world.materials[o.material.at()].name;
            for (std::uint32_t k = f.first_point; k < f.first_point + f.point_count; ++k)
                p.points.push_back(c.surfaces.overlay_points[k].position), p.uv.push_back({c.surfaces.overlay_points[k].uv.x, 1 - c.surfaces.overlay_points[k].uv.y});
            out.polygons.push_back(std::move(p));
        }
        return std::move(out);
    }
    ObjExport faces() {
        each_triangle([&](std::size_t f, std::size_t t_number, ObjPolygon& p) {
            const Face& face = c.surfaces.faces[f];
            const SourceLocation at = location_of(c.world, c.surfaces, id<FaceId>(f));
            p.group = fmt::format("face_{} brush_{} side_{}", f, at.brush, at.side);
            if (face.curved()) {
                for (const CurveCorner& k : c.surfaces.corners_of(t_number)) p.uv.push_back({k.uv.x, -k.uv.y});
                return;
            }
            for (const Vec3& x : p.points) {
                const Vec2 uv = texture_uv(c.world.sides[face.side.at()].texture, c.world.materials[face.material.at()], x);
                p.uv.push_back({uv.x, -uv.y});
            }
        });
        return std::move(out);
    }
    ObjExport charts() {
        each_triangle([&](std::size_t f, std::size_t t, ObjPolygon& p) {
            const Face& face = c.surfaces.faces[f];
            if (!face.chart.valid()) {
                p.points.clear();
                return;
            }
            const Chart& h = c.surfaces.charts[face.chart.at()];
            for (std::size_t k = 0; k < 3; ++k) {
                const Vec2 l = face.curved() ? c.surfaces.corners_of(t)[k].luxel : luxel_from_world(c.surfaces, id<FaceId>(f), p.points[k]);
                p.uv.push_back({l.x / h.width, 1 - l.y / h.height});
            }
            p.group = fmt::format("chart_{}", face.chart.value);
        });
        return std::move(out);
    }

private:
    const Compiled& c;

    std::string object(EntityId e) const {
        if (!e.valid()) return "none";
        return fmt::format("entity_{}_{}", c.world.entities[e.at()].id, c.world.entities[e.at()].get("classname", "none"));
    }
    EntityId entity_of(const Face& face) const {
        return face.side.valid() || !face.curved() ? entity_of(face.side) : c.world.patches[c.surfaces.curves[face.curve].source].entity;
    }
    EntityId entity_of(SideId side) const { return c.world.brushes[c.world.brush_of(side).at()].entity; }
    void add(SideId side, std::vector<Vec3> polygon, const std::string& more = "") {
        const SourceLocation at = c.world.location(side);
        out.polygons.push_back({object(entity_of(side)), fmt::format("brush_{} side_{}{}", at.brush, at.side, more), c.world.materials[c.world.sides[side.at()].material.at()].name,
                                std::move(polygon), {}, {}});
    }
    void add_patches(double flatness) { // divided as its faces will be
        CurveGrids curves;
        Context unheard; // a build says what there is to say of them
        kiln::add_patches(c.world, flatness, curves, unheard);
        for (const CurveGrid& g : curves.grids) {
            const WorldPatch& patch = c.world.patches[g.source];
            for (std::uint32_t row = 0; row + 1 < g.rows; ++row)
                for (std::uint32_t column = 0; column + 1 < g.columns; ++column) {
                    ObjPolygon p;
                    p.object = object(patch.entity), p.group = fmt::format("patch_{}", c.world.location(patch).brush), p.material = c.world.materials[g.material.at()].name;
                    for (const std::uint32_t k : {g.at(row, column), g.at(row, column + 1), g.at(row + 1, column + 1), g.at(row + 1, column)})
                        p.points.push_back(curves.positions[g.vertices[k]]), p.uv.push_back({g.uv[k].x, -g.uv[k].y});
                    out.polygons.push_back(std::move(p));
                }
        }
    }
    template <class Fill> void each_triangle(Fill&& fill) {
        const Surfaces& s = c.surfaces;
        for (std::size_t t = 0; t < s.triangles.size(); ++t) {
            const std::size_t f = s.triangle_face[t].at();
            ObjPolygon p;
            p.object = object(entity_of(s.faces[f])), p.material = c.world.materials[s.faces[f].material.at()].name;
            for (std::size_t k = 0; k < 3; ++k) p.points.push_back(s.positions[s.triangles[t][k]]), p.normals.push_back(Vec3(s.corner_normals[t][k]));
            fill(f, t, p);
            if (!p.points.empty()) out.polygons.push_back(std::move(p));
        }
    }
};

class OfLevel {
public:
    explicit OfLevel(const kiln_level* level) : l(level) {
        std::size_t n = 0;
        const kiln_material* m = kiln_level_materials(l, &n);
        for (std::size_t i = 0; i < n; ++i)
            out.materials.push_back(obj_material(m[i].name, {m[i].reflectance[0], m[i].reflectance[1], m[i].reflectance[2]}, {m[i].emission[0], m[i].emission[1], m[i].emission[2]}, m[i].alpha, m[i].albedo_map));
    }
    ObjExport out;

    ObjExport portals() {
        std::size_t n = 0, points = 0;
        const kiln_portal* p = kiln_level_portals(l, &n);
        const float* x = kiln_level_portal_points(l, &points);
        for (std::size_t i = 0; i < n; ++i) {
            ObjPolygon q{"portals", fmt::format("portal_{} leaf_{} leaf_{}", i, p[i].leaf[0], p[i].leaf[1]), "portal", {}, {}, {}};
            for (std::size_t k = p[i].first_point; k < std::size_t{p[i].first_point} + p[i].point_count; ++k) q.points.push_back({x[3 * k], x[3 * k + 1], x[3 * k + 2]});
            out.polygons.push_back(std::move(q));
        }
        return std::move(out);
    }
    ObjExport overlays() {
        std::size_t n = 0;
        const kiln_overlay* o = kiln_level_overlays(l, &n);
        const kiln_overlay_fragment* f = kiln_level_overlay_fragments(l, nullptr);
        const kiln_overlay_point* x = kiln_level_overlay_points(l, nullptr);
        for (std::size_t i = 0; i < n; ++i)
            for (std::size_t k = o[i].first_fragment; k < std::size_t{o[i].first_fragment} + o[i].fragment_count; ++k) {
                ObjPolygon p;
                p.object = "overlays", p.group = fmt::format("overlay_{} face_{}", i, f[k].face), p.material = out.materials[o[i].material].name;
                for (std::size_t q = f[k].first_point; q < std::size_t{f[k].first_point} + f[k].point_count; ++q)
                    p.points.push_back({x[q].position[0], x[q].position[1], x[q].position[2]}), p.uv.push_back({x[q].uv[0], 1 - x[q].uv[1]});
                out.polygons.push_back(std::move(p));
            }
        return std::move(out);
    }
    ObjExport faces() { return triangles(false); }
    ObjExport charts() { return triangles(true); }

private:
    const kiln_level* l;

    ObjExport triangles(bool of_charts) {
        const LevelMesh mesh(l);
        for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) {
            const kiln_face& face = mesh.faces[f];
            if (of_charts && face.chart == KILN_NO_INDEX) continue;
            kiln_source source{-1, -1, -1, 0};
            kiln_level_face_source(l, f, &source); // stripped: unknown
            for (std::uint32_t t = 0; t < face.triangle_count; ++t) {
                ObjPolygon p;
                p.object = fmt::format("model_{}", face.model), p.material = out.materials[face.material].name;
                p.group = of_charts ? fmt::format("chart_{}", face.chart) : fmt::format("face_{} brush_{} side_{}", f, source.brush, source.side);
                for (const LevelMesh::Corner& c : mesh.corners(f, t)) {
                    p.points.push_back(c.position), p.normals.push_back(Vec3(c.normal));
                    if (of_charts) p.uv.push_back({c.luxel.x / mesh.charts[face.chart].width, 1 - c.luxel.y / mesh.charts[face.chart].height});
                    else p.uv.push_back({c.uv.x, -c.uv.y});
                }
                out.polygons.push_back(std::move(p));
            }
        }
        return std::move(out);
    }
};

constexpr ObjStage kStages[] = {
    {"brushes", Stage::csg, [](const Compiled& c, const SurfacesOptions& o) { return OfMap(c).brushes(o.curve_flatness); }, nullptr},
    {"fragments", Stage::csg, [](const Compiled& c, const SurfacesOptions&) { return OfMap(c).fragments(); }, nullptr},
    {"leaves", Stage::bsp, [](const Compiled& c, const SurfacesOptions&) { return OfMap(c).leaves(); }, nullptr},
    {"portals", Stage::bsp, [](const Compiled& c, const SurfacesOptions&) { return OfMap(c).portals(); }, [](const kiln_level* l) { return OfLevel(l).portals(); }},
    {"visible", Stage::bsp, [](const Compiled& c, const SurfacesOptions&) { return OfMap(c).visible(); }, nullptr},
    {"gaps", Stage::bsp, [](const Compiled& c, const SurfacesOptions&) { return OfMap(c).gaps(); }, nullptr},
    {"overlays", Stage::surfaces, [](const Compiled& c, const SurfacesOptions&) { return OfMap(c).overlays(); }, [](const kiln_level* l) { return OfLevel(l).overlays(); }},
    {"faces", Stage::surfaces, [](const Compiled& c, const SurfacesOptions&) { return OfMap(c).faces(); }, [](const kiln_level* l) { return OfLevel(l).faces(); }},
    {"charts", Stage::surfaces, [](const Compiled& c, const SurfacesOptions&) { return OfMap(c).charts(); }, [](const kiln_level* l) { return OfLevel(l).charts(); }},
};

} // namespace

LevelMesh::LevelMesh(const kiln_level* level) : level_(level) {
    kiln_info info{};
    kiln_level_info(level, &info);
    step_ = std::ldexp(1.0, -static_cast<int>(info.position_grid_bits));
    std::size_t n = 0;
    const kiln_face* f = kiln_level_faces(level, &n);
    faces = {f, n};
    charts = kiln_level_charts(level, nullptr);
    grid_ = kiln_level_grid_positions(level, nullptr), triangles_ = kiln_level_triangles(level, nullptr), normals_ = kiln_level_corner_normals(level, nullptr);
}
std::array<LevelMesh::Corner, 3> LevelMesh::corners(std::uint32_t f, std::uint32_t triangle) const {
    const kiln_face& face = faces[f];
    const kiln_curve_corner* curve = kiln_level_curve_corners(level_, f, nullptr);
    std::array<Corner, 3> out;
    for (std::size_t k = 0; k < 3; ++k) {
        Corner& c = out[k];
        const std::size_t at = 3 * (std::size_t{face.first_triangle} + triangle) + k;
        const std::int32_t* g = grid_ + 3 * std::size_t{triangles_[at]};
        c.position = Vec3{static_cast<double>(g[0]), static_cast<double>(g[1]), static_cast<double>(g[2])} * step_;
        c.normal = {normals_[3 * at], normals_[3 * at + 1], normals_[3 * at + 2]};
        if (curve) {
            const kiln_curve_corner& bend = curve[3 * std::size_t{triangle} + k];
            c.uv = {bend.uv[0], bend.uv[1]}, c.luxel = {bend.luxel[0], bend.luxel[1]};
            continue;
        }
        const double x[3] = {c.position.x, c.position.y, c.position.z};
        double uv[2] = {};
        kiln_level_texture_uv(level_, f, x, uv);
        c.uv = {uv[0], uv[1]};
        if (face.chart == KILN_NO_INDEX) continue;
        const kiln_chart& h = charts[face.chart];
        const Vec3 d = c.position - Vec3{h.origin[0], h.origin[1], h.origin[2]};
        c.luxel = {dot(d, Vec3{h.s[0], h.s[1], h.s[2]}) / h.luxel_size, dot(d, Vec3{h.t[0], h.t[1], h.t[2]}) / h.luxel_size};
    }
    return out;
}

std::span<const ObjStage> obj_stages() { return kStages; }

} // namespace kiln

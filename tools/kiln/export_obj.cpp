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

    ObjExport brushes() {
        for (std::size_t b = 0; b < c.csg.brushes.size(); ++b)
            for (std::size_t f = 0; f < c.csg.brushes[b].faces.size(); ++f) add(c.csg.brushes[b].sides[f], points(c.csg.planes, c.csg.brushes[b].faces[f]));
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
    ObjExport faces() {
        each_triangle([&](std::size_t f, std::size_t t_number, ObjPolygon& p) {
            const Face& face = c.surfaces.faces[f];
            const SourceLocation at = location_of(c.world, c.surfaces, id<FaceId>(f));
            p.group = fmt::format("face_{} brush_{} side_{}", f, at.brush, at.side);
            if (face.curved()) {
                for (const CurveCorner& k : curve_corners(t_number)) p.uv.push_back({k.uv.x, -k.uv.y});
                return;
            }
            const Material& m = c.world.materials[face.material.at()];
            const DocTexture& t = c.world.sides[face.side.at()].texture;
            for (const Vec3& x : p.points) p.uv.push_back({(dot(x, t.u_axis) / t.u_scale + t.u_shift) / m.width, -(dot(x, t.v_axis) / t.v_scale + t.v_shift) / m.height});
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
                const Vec2 l = face.curved() ? curve_corners(t)[k].luxel : luxel_from_world(c.surfaces, id<FaceId>(f), p.points[k]);
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
    const std::array<CurveCorner, 3>& curve_corners(std::size_t triangle) const {
        return c.surfaces.curve_corners[triangle - c.surfaces.faces[c.surfaces.first_curved_face].first_triangle];
    }
    EntityId entity_of(const Face& face) const {
        return face.side.valid() || !face.curved() ? entity_of(face.side) : c.world.patches[c.surfaces.curves[face.curve].source].entity;
    }
    EntityId entity_of(SideId side) const {
        const auto after = std::ranges::upper_bound(c.world.brushes, side.value, {}, &WorldBrush::first_side);
        return std::prev(after)->entity;
    }
    void add(SideId side, std::vector<Vec3> polygon, const char* more = "") {
        const SourceLocation at = c.world.location(side);
        out.polygons.push_back({object(entity_of(side)), fmt::format("brush_{} side_{}{}", at.brush, at.side, more), c.world.materials[c.world.sides[side.at()].material.at()].name,
                                std::move(polygon), {}, {}});
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
    ObjExport faces() { return triangles(false); }
    ObjExport charts() { return triangles(true); }

private:
    const kiln_level* l;

    ObjExport triangles(bool of_charts) {
        kiln_info info{};
        kiln_level_info(l, &info);
        std::size_t n = 0;
        const kiln_face* faces = kiln_level_faces(l, &n);
        const std::int32_t* grid = kiln_level_grid_positions(l, nullptr);
        const std::uint32_t* corners = kiln_level_triangles(l, nullptr);
        const float* normals = kiln_level_corner_normals(l, nullptr);
        const kiln_chart* charts = kiln_level_charts(l, nullptr);
        for (std::uint32_t f = 0; f < n; ++f) {
            if (of_charts && faces[f].chart == KILN_NO_INDEX) continue;
            kiln_source source{-1, -1, -1, 0};
            kiln_level_face_source(l, f, &source); // stripped: unknown
            const kiln_curve_corner* curve = kiln_level_curve_corners(l, f, nullptr);
            for (std::size_t t = faces[f].first_triangle; t < std::size_t{faces[f].first_triangle} + faces[f].triangle_count; ++t) {
                ObjPolygon p;
                p.object = fmt::format("model_{}", faces[f].model), p.material = out.materials[faces[f].material].name;
                p.group = of_charts ? fmt::format("chart_{}", faces[f].chart) : fmt::format("face_{} brush_{} side_{}", f, source.brush, source.side);
                for (std::size_t k = 0; k < 3; ++k) {
                    const std::int32_t* g = grid + 3 * std::size_t{corners[3 * t + k]};
                    const Vec3 x = Vec3{static_cast<double>(g[0]), static_cast<double>(g[1]), static_cast<double>(g[2])} * std::ldexp(1.0, -static_cast<int>(info.position_grid_bits));
                    p.points.push_back(x);
                    const float* m = normals + 9 * t + 3 * k;
                    p.normals.push_back({m[0], m[1], m[2]});
                    double uv[2] = {};
                    if (curve) {
                        const kiln_curve_corner& at = curve[3 * (t - faces[f].first_triangle) + k];
                        if (of_charts) uv[0] = at.luxel[0] / charts[faces[f].chart].width, uv[1] = at.luxel[1] / charts[faces[f].chart].height - 1;
                        else uv[0] = at.uv[0], uv[1] = at.uv[1];
                    } else if (of_charts) {
                        const kiln_chart& c = charts[faces[f].chart];
                        const Vec3 d = x - Vec3{c.origin[0], c.origin[1], c.origin[2]};
                        uv[0] = dot(d, Vec3{c.s[0], c.s[1], c.s[2]}) / c.luxel_size / c.width, uv[1] = dot(d, Vec3{c.t[0], c.t[1], c.t[2]}) / c.luxel_size / c.height - 1;
                    } else {
                        const double at[3] = {x.x, x.y, x.z};
                        kiln_level_texture_uv(l, f, at, uv);
                    }
                    p.uv.push_back({uv[0], -uv[1]});
                }
                out.polygons.push_back(std::move(p));
            }
        }
        return std::move(out);
    }
};

constexpr ObjStage kStages[] = {
    {"brushes", Stage::csg, [](const Compiled& c) { return OfMap(c).brushes(); }, nullptr},
    {"fragments", Stage::csg, [](const Compiled& c) { return OfMap(c).fragments(); }, nullptr},
    {"leaves", Stage::bsp, [](const Compiled& c) { return OfMap(c).leaves(); }, nullptr},
    {"portals", Stage::bsp, [](const Compiled& c) { return OfMap(c).portals(); }, [](const kiln_level* l) { return OfLevel(l).portals(); }},
    {"faces", Stage::surfaces, [](const Compiled& c) { return OfMap(c).faces(); }, [](const kiln_level* l) { return OfLevel(l).faces(); }},
    {"charts", Stage::surfaces, [](const Compiled& c) { return OfMap(c).charts(); }, [](const kiln_level* l) { return OfLevel(l).charts(); }},
};

} // namespace

std::span<const ObjStage> obj_stages() { return kStages; }

} // namespace kiln

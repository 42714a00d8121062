// Rows of what geometry is made of, beside the ones of dump.cpp.
#include "compiler/pack/pack.h"
#include "tools/kiln/dump_rows.h"
#include <fmt/format.h>
#include <map>

namespace kiln {
namespace {

Json source(const SourceLocation& at) { return {at.entity, at.brush, at.side}; }

Rows dump_brushes(const Compiled& c) {
    Rows rows;
    for (std::size_t b = 0; b < c.csg.brushes.size(); ++b) {
        const BrushPolytope& p = c.csg.brushes[b];
        const WorldBrush& w = c.world.brushes[b];
        Json faces = Json::array();
        for (std::size_t f = 0; f < p.faces.size(); ++f) faces.push_back({{"side", c.world.sides[p.sides[f].at()].id}, {"winding", list(points(c.csg.planes, p.faces[f]))}});
        rows.push_back({{"brush", w.id}, {"index", b}, {"file", file_of(c.world, c.world.location(id<BrushId>(b)))}, {"line", w.line}, {"entity", c.world.entities[w.entity.at()].id}, {"contents", name(w.contents)}, {"model", to_json(w.model)},
                        {"valid", p.valid}, {"bounds", to_json(p.bounds)}, {"faces", faces}});
    }
    return rows;
}
Rows dump_sides(const Compiled& c) {
    Rows rows;
    std::map<std::uint32_t, PlaneId> planes; // of sides that bound their brush
    for (const BrushPolytope& p : c.csg.brushes)
        for (std::size_t f = 0; f < p.faces.size(); ++f) planes[p.sides[f].value] = p.faces[f].support;
    for (std::uint32_t s = 0; s < c.world.sides.size(); ++s) {
        const WorldSide& w = c.world.sides[s];
        const auto it = planes.find(s);
        const bool bounds = it != planes.end();
        rows.push_back({{"source", source(c.world.location(SideId{s}))}, {"index", s}, {"file", file_of(c.world, c.world.location(SideId{s}))}, {"line", w.line}, {"material", c.world.materials[w.material.at()].name},
                        {"normal", bounds ? to_json(c.csg.planes.normal(it->second)) : Json()}, {"distance", bounds ? Json(c.csg.planes.distance(it->second)) : Json()},
                        {"lightmap_scale", w.lightmap_scale}, {"smoothing", w.smoothing_groups}, {"u_axis", to_json(w.texture.u_axis)}, {"v_axis", to_json(w.texture.v_axis)},
                        {"shift", {w.texture.u_shift, w.texture.v_shift}}, {"scale", {w.texture.u_scale, w.texture.v_scale}}, {"no_dynamic_shadow", w.no_dynamic_shadow}});
    }
    return rows;
}
Rows dump_moves(const Compiled& c) {
    const CsgReport& r = c.csg.report;
    return {{{"grid_bits", r.grid_bits}, {"rounded_sides", r.rounded_sides}, {"largest_rounding", r.largest_rounding}, {"moved_sides", r.merged_planes}, {"largest_move", r.largest_move},
             {"kept_brushes", r.kept_brushes}, {"redundant_sides", r.redundant_sides}, {"invalid_brushes", r.invalid_brushes}}};
}
Rows dump_leaves(const Compiled& c) {
    // Faces by cluster: known where surfaces were made.
    std::vector<std::vector<std::uint32_t>> faces(c.bsp.cluster_count), portals(c.bsp.leaves.size());
    for (std::uint32_t f = 0; f < c.surfaces.faces.size(); ++f)
        for (const ClusterId k : c.surfaces.faces[f].clusters) faces[k.at()].push_back(f);
    for (std::uint32_t p = 0; p < c.bsp.portals.size(); ++p) portals[c.bsp.portals[p].leaf_front.at()].push_back(p), portals[c.bsp.portals[p].leaf_back.at()].push_back(p);
    Rows rows;
    for (std::size_t i = 0; i < c.bsp.leaves.size(); ++i) {
        const BspLeaf& l = c.bsp.leaves[i];
        Json brushes = Json::array();
        for (const BrushId b : l.brushes) brushes.push_back(c.world.brushes[b.at()].id);
        rows.push_back({{"leaf", i}, {"contents", name(l.contents)}, {"outside", l.outside}, {"bounds", to_json(l.bounds)}, {"cluster", to_json(l.cluster)}, {"area", l.area},
                        {"brushes", brushes}, {"faces", l.cluster.valid() ? list(faces[l.cluster.at()]) : Json::array()}, {"portals", list(portals[i])}});
    }
    return rows;
}
Rows dump_clusters(const Compiled& c) {
    std::vector<Json> leaves(c.bsp.cluster_count, Json::array());
    std::vector<Box3> bounds(c.bsp.cluster_count);
    std::vector<std::map<std::uint32_t, int>> neighbours(c.bsp.cluster_count);
    for (std::size_t l = 0; l < c.bsp.leaves.size(); ++l)
        if (const ClusterId k = c.bsp.leaves[l].cluster; k.valid()) leaves[k.at()].push_back(l), bounds[k.at()].add(c.bsp.leaves[l].bounds);
    for (const VisPortal& p : c.portals) ++neighbours[p.cluster_front][p.cluster_back], ++neighbours[p.cluster_back][p.cluster_front];
    Rows rows;
    for (std::size_t k = 0; k < leaves.size(); ++k) {
        Json next = Json::array();
        for (const auto& [n, count] : neighbours[k]) next.push_back(n);
        rows.push_back({{"cluster", k}, {"bounds", to_json(bounds[k])}, {"leaves", leaves[k]}, {"neighbours", next}});
    }
    return rows;
}
Rows dump_areas(const Compiled& c) {
    std::vector<Box3> bounds(c.bsp.area_count + 1);
    std::vector<std::size_t> leaves(c.bsp.area_count + 1);
    std::vector<std::map<std::uint32_t, int>> next(c.bsp.area_count + 1); // through the leaves of area portals
    std::map<LeafId, std::map<std::uint32_t, int>> beside;
    for (const BspLeaf& l : c.bsp.leaves)
        if (l.cluster.valid()) ++leaves[l.area], bounds[l.area].add(l.bounds);
    for (const BspPortal& p : c.bsp.portals) {
        const std::uint32_t a = c.bsp.leaves[p.leaf_front.at()].area, b = c.bsp.leaves[p.leaf_back.at()].area;
        if (a && !b) ++beside[p.leaf_back][a];
        if (b && !a) ++beside[p.leaf_front][b];
    }
    for (const auto& [leaf, areas] : beside)
        for (const auto& [a, x] : areas)
            for (const auto& [b, y] : areas)
                if (a != b) ++next[a][b];
    Rows rows;
    for (std::uint32_t a = 1; a <= c.bsp.area_count; ++a) {
        Json through = Json::array();
        for (const auto& [b, count] : next[a]) through.push_back(b);
        rows.push_back({{"area", a}, {"bounds", to_json(bounds[a])}, {"leaves", leaves[a]}, {"area_portals_to", through}});
    }
    return rows;
}
Rows dump_leak(const Compiled& c) {
    Rows rows; // none: sealed
    const auto ids = [&](const std::vector<BrushId>& brushes) {
        Json j = Json::array();
        for (const BrushId b : brushes) j.push_back(c.world.location(b).brush);
        return j;
    };
    const auto places = [&](const std::vector<BrushId>& brushes) { // for editors to jump to
        Json j = Json::array();
        for (const BrushId b : brushes) {
            const SourceLocation at = c.world.location(b);
            j.push_back(fmt::format("{}:{}", name_beside(c.world.file, at.file), at.line));
        }
        return j;
    };
    for (std::size_t i = 0; i < c.leaks.size(); ++i) {
        const Leak& leak = c.leaks[i];
        const SourceLocation at = leak.entity.valid() ? c.world.location(leak.entity) : SourceLocation{};
        Json what = Json::array();
        for (const BrushId b : leak.passes) what.push_back(name_of_unsealing(c.world, b));
        rows.push_back({{"leak", i + 1}, {"entity", at.entity}, {"file", file_of(c.world, at)}, {"line", at.line}, {"in_void", leak.area == 0}, {"hole", to_json(leak.hole)}, {"width", leak.width},
                        {"area", leak.area}, {"length", leak.length}, {"near", ids(leak.near)}, {"near_at", places(leak.near)}, {"passes", ids(leak.passes)}, {"passes_at", places(leak.passes)},
                        {"passes_what", what}, {"path", list(leak.path)}});
    }
    for (const AreaPortal& p : c.bsp.area_portals) { // that part nothing: the way around
        if (p.leak.empty()) continue;
        const SourceLocation at = c.world.location(p.brush);
        rows.push_back({{"area_portal", at.brush}, {"entity", at.entity}, {"file", file_of(c.world, at)}, {"line", at.line}, {"areas", p.areas},
                        {"from", to_json(p.leak.front())}, {"to", to_json(p.leak.back())}, {"length", path_length(p.leak)}, {"path", list(p.leak)}});
    }
    return rows;
}
Rows dump_gaps(const Compiled& c) {
    Rows rows;
    for (const ClosedGap& g : c.bsp.closed) rows.push_back({{"side", source(c.world.location(g.side))}, {"file", file_of(c.world, c.world.location(g.side))}, {"winding", list(points(c.bsp.planes, g.polygon))}, {"leaf", to_json(g.leaf)}});
    return rows;
}
Rows dump_visible(const Compiled& c) {
    Rows rows;
    for (const VisibleFragment& v : c.bsp.visible) {
        const Fragment& f = c.csg.fragments[v.fragment];
        rows.push_back({{"side", source(c.world.location(f.side))}, {"file", file_of(c.world, c.world.location(f.side))}, {"behind", name(f.behind)}, {"front", name(f.front)}, {"winding", list(points(c.bsp.planes, v.polygon))}, {"fragment", v.fragment}, {"leaf", to_json(v.leaf)}});
    }
    return rows;
}
Rows dump_vertices(const Compiled& c) {
    Rows rows;
    for (std::size_t i = 0; i < c.surfaces.positions.size(); ++i) rows.push_back({{"vertex", i}, {"position", to_json(c.surfaces.positions[i])}});
    return rows;
}
Rows dump_triangles(const Compiled& c) {
    Rows rows;
    for (std::size_t t = 0; t < c.surfaces.triangles.size(); ++t) {
        Json corners = Json::array(), normals = Json::array();
        for (std::size_t k = 0; k < 3; ++k) corners.push_back(to_json(c.surfaces.positions[c.surfaces.triangles[t][k]])), normals.push_back(to_json(c.surfaces.corner_normals[t][k]));
        const FaceId f = c.surfaces.triangle_face[t];
        rows.push_back({{"triangle", t}, {"face", to_json(f)}, {"vertices", c.surfaces.triangles[t]}, {"source", source(location_of(c.world, c.surfaces, f))}, {"file", file_of(c.world, location_of(c.world, c.surfaces, f))}, {"corners", corners}, {"normals", normals}});
    }
    return rows;
}
Rows dump_luxels(const Compiled& c) {
    Rows rows;
    for (const Luxel& l : c.surfaces.luxels)
        rows.push_back({{"chart", to_json(l.chart)}, {"at", {l.x, l.y}}, {"face", to_json(l.face)}, {"area", l.area}, {"centroid", to_json(centroid_of(c.surfaces, l))}, {"pieces", l.piece_count}});
    return rows;
}
Rows dump_seams(const Compiled& c) {
    Rows rows;
    for (const Seam& s : c.surfaces.seams)
        rows.push_back({{"charts", {s.chart_a.value, s.chart_b.value}}, {"from", to_json(c.surfaces.positions[s.from])}, {"to", to_json(c.surfaces.positions[s.to])}});
    return rows;
}
Rows dump_displacements(const Compiled& c) {
    Rows rows;
    for (const WorldDisplacement& d : c.world.displacements) {
        const DocDisplacement& g = d.grid;
        rows.push_back({{"side", source(c.world.location(d.side))}, {"file", file_of(c.world, c.world.location(d.side))}, {"line", g.line}, {"power", g.power}, {"start", to_json(g.start)}, {"elevation", g.elevation}, {"flags", g.flags},
                        {"normals", list(g.normals)}, {"distances", list(g.distances)}, {"offsets", list(g.offsets)}, {"alphas", list(g.alphas)}});
    }
    return rows;
}
Rows dump_patch_grids(const Compiled& c) {
    Rows rows;
    for (const WorldPatch& p : c.world.patches)
        rows.push_back({{"entity", c.world.entities[p.entity.at()].id}, {"patch", p.grid.id}, {"file", file_of(c.world, c.world.location(p))}, {"line", p.grid.line}, {"material", c.world.materials[p.material.at()].name}, {"model", to_json(p.model)},
                        {"size", {p.grid.columns, p.grid.rows}}, {"subdivisions", p.grid.subdivisions}, {"points", list(p.grid.points)}, {"uv", list(p.grid.uv)}});
    return rows;
}
Rows dump_waters(const Compiled& c) {
    Rows rows;
    for (std::size_t i = 0; i < c.bsp.waters.size(); ++i) {
        const WaterVolume& w = c.bsp.waters[i];
        rows.push_back({{"water", i}, {"contents", name(w.contents)}, {"surface_z", w.surface_z}, {"min_z", w.min_z}, {"has_surface", w.has_surface},
                        {"material", w.material.valid() ? Json(c.world.materials[w.material.at()].name) : Json()}, {"leaves", std::ranges::count(c.bsp.leaf_water, i)}});
    }
    return rows;
}
Rows dump_area_portals(const Compiled& c) {
    Rows rows;
    for (const AreaPortal& p : c.bsp.area_portals) {
        const SourceLocation at = c.world.location(p.brush);
        rows.push_back({{"entity", at.entity}, {"brush", at.brush}, {"file", file_of(c.world, at)}, {"line", at.line}, {"areas", p.areas}, {"winding", list(p.winding)}});
    }
    return rows;
}
Rows dump_occluders(const Compiled& c) {
    Rows rows;
    for (const Occluder& o : c.bsp.occluders) {
        Json polygons = Json::array();
        for (const std::uint32_t f : o.fragments) polygons.push_back(list(points(c.csg.planes, c.csg.fragments[f].polygon)));
        rows.push_back({{"entity", c.world.location(o.entity).entity}, {"file", file_of(c.world, c.world.location(o.entity))}, {"line", c.world.location(o.entity).line}, {"area", o.area}, {"polygons", polygons}});
    }
    return rows;
}
Rows dump_cordons(const Compiled& c) {
    Rows rows;
    for (const DocCordon& k : c.document.cordons) rows.push_back({{"cordon", k.name}, {"line", k.line}, {"active", k.active}, {"box", to_json(k.box)}});
    return rows;
}

constexpr Artefact kGeometryArtefacts[] = {
    {"cordons", Stage::read, dump_cordons, "line"},
    {"displacements", Stage::world, dump_displacements, "line"},
    {"patch_grids", Stage::world, dump_patch_grids, "line"},
    {"brushes", Stage::csg, dump_brushes, "index line"},
    {"sides", Stage::csg, dump_sides, "index line"},
    {"moves", Stage::csg, dump_moves},
    {"leaves", Stage::surfaces, dump_leaves, "leaf cluster area faces portals"},
    {"clusters", Stage::bsp, dump_clusters, "cluster leaves neighbours"},
    {"areas", Stage::bsp, dump_areas, "area area_portals_to"},
    {"waters", Stage::bsp, dump_waters, "water"},
    {"area_portals", Stage::bsp, dump_area_portals, "line areas"},
    {"occluders", Stage::bsp, dump_occluders, "line area"},
    {"leak", Stage::bsp, dump_leak, "leak line near_at passes_at passes_what areas"},
    {"gaps", Stage::bsp, dump_gaps, "leaf"},
    {"visible", Stage::bsp, dump_visible, "fragment leaf"},
    {"vertices", Stage::surfaces, dump_vertices, "vertex"},
    {"triangles", Stage::surfaces, dump_triangles, "triangle face vertices"},
    {"luxels", Stage::surfaces, dump_luxels, "chart face"},
    {"seams", Stage::surfaces, dump_seams, "charts"},
};

} // namespace

std::span<const Artefact> geometry_artefacts() { return kGeometryArtefacts; }

} // namespace kiln

// Rows of what is in a level file, through its loader.
#include "formats/level/kiln_level.hpp"
#include "tools/kiln/dump_rows.h"
#include <cmath>
#include <map>
#include <set>

namespace kiln {
namespace {

template <class T, std::size_t N> Json row(const T (&v)[N]) {
    Json j = Json::array();
    for (const T x : v) j.push_back(x);
    return j;
}
Json index(std::uint32_t i) { return i == KILN_NO_INDEX ? Json() : Json(i); }
template <class T> std::span<const T> rows_of(const kiln_level* l, const T* (*get)(const kiln_level*, size_t*), std::size_t width = 1) {
    std::size_t n = 0;
    const T* p = get(l, &n);
    return p ? std::span<const T>(p, n * width) : std::span<const T>();
}
template <class T> Json part(std::span<const T> all, std::size_t first, std::size_t count) {
    Json j = Json::array();
    for (const T& x : all.subspan(first, count)) j.push_back(x);
    return j;
}
Json tuples(std::span<const float> all, std::size_t width, std::size_t first, std::size_t count) { // a row for each
    Json j = Json::array();
    for (std::size_t k = first; k < first + count; ++k) j.push_back(part(all, width * k, width));
    return j;
}
Json points(std::span<const float> all, std::size_t first, std::size_t count) { return tuples(all, 3, first, count); }

kiln_source source_of(const kiln_level* l, kiln_status (*get)(const kiln_level*, std::uint32_t, kiln_source*), std::uint32_t i) {
    kiln_source s{-1, -1, -1, 0}; // stripped: unknown
    get(l, i, &s);
    return s;
}

Json material_name(const kiln_level* l, std::uint32_t i) {
    const auto m = rows_of(l, kiln_level_materials);
    return i < m.size() ? Json(m[i].name) : Json();
}

Json file_of(const kiln_level* l, kiln_status (*get)(const kiln_level*, std::uint32_t, const char**), std::uint32_t i) {
    const char* file = ""; // stripped, or of the map itself
    get(l, i, &file);
    return *file ? Json(file) : Json();
}

// An entity by what the map calls it, as rows of brushes and faces do.
Json with_entity(const kiln_level* l, std::uint32_t e, Json row) {
    const kiln_source s = source_of(l, kiln_level_entity_source, e);
    row["entity"] = s.entity, row["file"] = file_of(l, kiln_level_entity_file, e), row["line"] = s.line;
    return row;
}

Rows dump_planes(const kiln_level* l) {
    Rows rows;
    const auto p = rows_of(l, kiln_level_planes);
    for (std::size_t i = 0; i < p.size(); ++i) rows.push_back({{"plane", i}, {"normal", row(p[i].normal)}, {"distance", p[i].distance}, {"exact_normal", row(p[i].exact_normal)}});
    return rows;
}
Rows dump_nodes(const kiln_level* l) {
    Rows rows;
    const auto n = rows_of(l, kiln_level_nodes);
    for (std::size_t i = 0; i < n.size(); ++i) rows.push_back({{"node", i}, {"plane", n[i].plane}, {"child", row(n[i].child)}, {"lo", row(n[i].lo)}, {"hi", row(n[i].hi)}});
    return rows;
}
Rows dump_leaves(const kiln_level* l) {
    Rows rows;
    const auto leaf = rows_of(l, kiln_level_leaves);
    const auto brushes = rows_of(l, kiln_level_leaf_brushes), faces = rows_of(l, kiln_level_leaf_faces);
    const auto away = rows_of(l, kiln_level_leaf_water_distances);
    for (std::size_t i = 0; i < leaf.size(); ++i)
        rows.push_back({{"leaf", i}, {"water_distance", i < away.size() && std::isfinite(away[i]) ? Json(away[i]) : Json()}, {"contents", name(static_cast<Contents>(leaf[i].contents))}, {"lo", row(leaf[i].lo)}, {"hi", row(leaf[i].hi)}, {"cluster", leaf[i].cluster}, {"area", leaf[i].area},
                        {"probe", index(leaf[i].probe)}, {"brushes", part(brushes, leaf[i].first_brush, leaf[i].brush_count)}, {"faces", part(faces, leaf[i].first_face, leaf[i].face_count)}});
    return rows;
}
Rows dump_portals(const kiln_level* l) {
    Rows rows;
    const auto p = rows_of(l, kiln_level_portals);
    const auto x = rows_of(l, kiln_level_portal_points, 3);
    for (std::size_t i = 0; i < p.size(); ++i) rows.push_back({{"portal", i}, {"leaf", row(p[i].leaf)}, {"plane", p[i].plane}, {"winding", points(x, p[i].first_point, p[i].point_count)}});
    return rows;
}
Rows dump_vis(const kiln_level* l) {
    kiln_info info{};
    kiln_level_info(l, &info);
    bool doors = false; // is anything stored of shut area portals?
    for (std::size_t i = 0; i < kiln_level_lump_count(l); ++i) {
        kiln_lump lump{};
        doors = doors || (kiln_level_lump(l, i, &lump) == KILN_OK && std::string_view(lump.name) == "VISS");
    }
    std::vector<std::uint64_t> shut_row((std::size_t{info.clusters} + 63) / 64);
    Rows rows;
    for (std::int32_t a = 0; a < static_cast<std::int32_t>(info.clusters); ++a) {
        Json seen = Json::array();
        for (std::int32_t b = 0; b < static_cast<std::int32_t>(info.clusters); ++b)
            if (kiln_level_cluster_visible(l, a, b) == 1) seen.push_back(b);
        rows.push_back({{"cluster", a}, {"count", seen.size()}, {"sees", seen}});
        if (!doors || kiln_level_read_shut_row(l, a, shut_row.data(), shut_row.size()) != KILN_OK) continue;
        Json shut = Json::array();
        for (std::uint32_t b = 0; b < info.clusters; ++b)
            if (shut_row[b / 64] >> (b % 64) & 1) shut.push_back(b);
        rows.back()["shut"] = std::move(shut);
    }
    return rows;
}
Rows dump_brushes(const kiln_level* l) {
    Rows rows;
    const auto b = rows_of(l, kiln_level_brushes);
    const auto planes = rows_of(l, kiln_level_brush_planes);
    const auto table = rows_of(l, kiln_level_planes);
    for (std::uint32_t i = 0; i < b.size(); ++i) {
        const kiln_source s = source_of(l, kiln_level_brush_source, i);
        Json sides = Json::array();
        for (const std::uint32_t p : planes.subspan(b[i].first_plane, b[i].plane_count)) sides.push_back({table[p].normal[0], table[p].normal[1], table[p].normal[2], table[p].distance});
        rows.push_back({{"brush", s.brush}, {"index", i}, {"entity", s.entity}, {"file", file_of(l, kiln_level_brush_file, i)}, {"line", s.line}, {"contents", name(static_cast<Contents>(b[i].contents))}, {"model", b[i].model}, {"planes", sides}});
    }
    return rows;
}
Rows dump_materials(const kiln_level* l) {
    Rows rows;
    const auto m = rows_of(l, kiln_level_materials);
    for (std::size_t i = 0; i < m.size(); ++i)
        rows.push_back({{"material", m[i].name}, {"index", i}, {"reflectance", row(m[i].reflectance)}, {"emission", row(m[i].emission)}, {"alpha", m[i].alpha}, {"env_map", m[i].env_map},
                        {"roughness", m[i].roughness}, {"flags", m[i].flags}, {"size", {m[i].width, m[i].height}}, {"albedo_map", m[i].albedo_map}, {"normal_map", m[i].normal_map}});
    return rows;
}
Rows dump_faces(const kiln_level* l) {
    Rows rows;
    const auto f = rows_of(l, kiln_level_faces);
    const auto m = rows_of(l, kiln_level_materials);
    const auto planes = rows_of(l, kiln_level_planes);
    for (std::uint32_t i = 0; i < f.size(); ++i) {
        const kiln_source s = source_of(l, kiln_level_face_source, i);
        rows.push_back({{"face", i}, {"entity", s.entity}, {"brush", s.brush}, {"side", s.side}, {"file", file_of(l, kiln_level_face_file, i)}, {"line", s.line}, {"material", m[f[i].material].name}, {"model", f[i].model}, {"normal", row(planes[f[i].plane].normal)},
                        {"distance", planes[f[i].plane].distance}, {"flags", f[i].flags}, {"triangles", f[i].triangle_count}, {"tangent", row(f[i].tangent)}, {"bitangent", row(f[i].bitangent)},
                        {"chart", index(f[i].chart)}, {"probe", index(f[i].probe)}});
    }
    return rows;
}
Rows dump_vertices(const kiln_level* l) {
    kiln_info info{};
    kiln_level_info(l, &info);
    Rows rows;
    const auto g = rows_of(l, kiln_level_grid_positions, 3);
    const double step = std::ldexp(1.0, -static_cast<int>(info.position_grid_bits));
    for (std::size_t i = 0; i < g.size() / 3; ++i) rows.push_back({{"vertex", i}, {"position", {g[3 * i] * step, g[3 * i + 1] * step, g[3 * i + 2] * step}}});
    return rows;
}
Rows dump_triangles(const kiln_level* l) {
    Rows rows;
    const auto t = rows_of(l, kiln_level_triangles, 3);
    const auto n = rows_of(l, kiln_level_corner_normals, 9);
    const auto f = rows_of(l, kiln_level_faces);
    for (std::size_t face = 0; face < f.size(); ++face)
        for (std::size_t k = f[face].first_triangle; k < std::size_t{f[face].first_triangle} + f[face].triangle_count; ++k)
            rows.push_back({{"triangle", k}, {"face", face}, {"vertices", part(t, 3 * k, 3)}, {"normals", points(n, 3 * k, 3)}});
    return rows;
}
double texel_edge(const double* axis, float luxel_size) { // map units
    return static_cast<double>(luxel_size) / std::sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
}
Rows dump_charts(const kiln_level* l) {
    Rows rows;
    const auto c = rows_of(l, kiln_level_charts);
    for (std::size_t i = 0; i < c.size(); ++i)
        rows.push_back({{"chart", i}, {"origin", row(c[i].origin)}, {"s", row(c[i].s)}, {"t", row(c[i].t)}, {"luxel_size", c[i].luxel_size}, {"texel", {texel_edge(c[i].s, c[i].luxel_size), texel_edge(c[i].t, c[i].luxel_size)}}, {"size", {c[i].width, c[i].height}},
                        {"directional", c[i].directional}, {"smooth", c[i].smooth}, {"error", c[i].error}, {"page", c[i].page}, {"at", {c[i].page_x, c[i].page_y}}});
    return rows;
}
Rows dump_pages(const kiln_level* l) {
    kiln_info info{};
    kiln_level_info(l, &info);
    Rows rows;
    for (std::uint32_t p = 0; p < info.pages; ++p) {
        kiln_page page{};
        kiln_level_page_info(l, p, &page);
        rows.push_back({{"page", p}, {"size", {page.width, page.height}}, {"layers", page.layers}, {"format", page.format}, {"scale", page.scale}});
    }
    return rows;
}
Rows dump_lights(const kiln_level* l) {
    Rows rows;
    const auto e = rows_of(l, kiln_level_lights);
    for (std::size_t i = 0; i < e.size(); ++i)
        rows.push_back({{"light", i}, {"kind", kLightKindNames[e[i].kind % 4]}, {"position", row(e[i].position)}, {"direction", row(e[i].direction)}, {"intensity", row(e[i].intensity)}, {"falloff", e[i].falloff},
                        {"constant", e[i].constant_attn}, {"linear", e[i].linear_attn}, {"quadratic", e[i].quadratic_attn}, {"range", e[i].range}, {"cos_inner", e[i].cos_inner}, {"cos_outer", e[i].cos_outer},
                        {"exponent", e[i].exponent}, {"style", e[i].style}});
    return rows;
}
Rows dump_cubes(const kiln_level* l) {
    Rows rows;
    const auto c = rows_of(l, kiln_level_cubes);
    const auto lights = rows_of(l, kiln_level_cube_lights);
    for (std::size_t i = 0; i < c.size(); ++i) {
        Json faces = Json::array();
        for (const auto& f : c[i].irradiance) faces.push_back(row(f));
        rows.push_back({{"cube", i}, {"position", row(c[i].position)}, {"irradiance", faces}, {"lights", part(lights, c[i].first_light, c[i].light_count)}});
    }
    return rows;
}
Rows dump_probes(const kiln_level* l) {
    Rows rows;
    const auto p = rows_of(l, kiln_level_probes);
    for (std::size_t i = 0; i < p.size(); ++i)
        rows.push_back({{"probe", i}, {"position", row(p[i].position)}, {"entity", p[i].entity}, {"size", p[i].size}, {"mips", p[i].mips}, {"box", p[i].boxed ? Json{row(p[i].box_lo), row(p[i].box_hi)} : Json()}});
    return rows;
}
Rows dump_entities(const kiln_level* l) {
    kiln_info info{};
    kiln_level_info(l, &info);
    Rows rows;
    for (std::uint32_t e = 0; e < info.entities; ++e) {
        const kiln_source s = source_of(l, kiln_level_entity_source, e);
        Json keys = Json::array();
        for (std::size_t k = 0; k < kiln_level_entity_key_count(l, e); ++k) {
            const char *key = "", *value = "";
            if (kiln_level_entity_key(l, e, k, &key, &value) == KILN_OK) keys.push_back({key, value});
        }
        rows.push_back({{"entity", s.entity}, {"index", e}, {"file", file_of(l, kiln_level_entity_file, e)}, {"line", s.line}, {"model", kiln_level_entity_model(l, e)}, {"keys", keys}});
    }
    return rows;
}

Rows dump_bevels(const kiln_level* l) {
    Rows rows;
    const auto b = rows_of(l, kiln_level_brushes);
    for (std::uint32_t i = 0; i < b.size(); ++i) {
        std::size_t n = 0;
        const kiln_bevel* bevel = kiln_level_brush_bevels(l, i, &n);
        const kiln_source s = source_of(l, kiln_level_brush_source, i);
        for (std::size_t k = 0; k < n; ++k)
            rows.push_back({{"brush", s.brush}, {"index", i}, {"entity", s.entity}, {"file", file_of(l, kiln_level_brush_file, i)}, {"line", s.line}, {"normal", row(bevel[k].normal)}, {"distance", bevel[k].distance}});
    }
    return rows;
}
Rows dump_areas(const kiln_level* l) {
    struct Area {
        std::size_t leaves = 0;
        std::set<std::int32_t> clusters;
        Json next = Json::array();
    };
    std::map<std::int64_t, Area> areas;
    for (const kiln_leaf& leaf : rows_of(l, kiln_level_leaves))
        if (leaf.cluster >= 0) ++areas[leaf.area].leaves, areas[leaf.area].clusters.insert(leaf.cluster);
    const auto doors = rows_of(l, kiln_level_area_portals);
    for (std::size_t i = 0; i < doors.size(); ++i)
        for (std::size_t k = 0; k < 2; ++k)
            if (doors[i].area[0] != doors[i].area[1]) areas[doors[i].area[k]].next.push_back({{"area", doors[i].area[1 - k]}, {"area_portal", i}});
    Rows rows;
    for (const auto& [a, area] : areas) rows.push_back({{"area", a}, {"leaves", area.leaves}, {"clusters", area.clusters.size()}, {"area_portals_to", area.next}});
    return rows;
}
Rows dump_area_portals(const kiln_level* l) {
    Rows rows;
    const auto p = rows_of(l, kiln_level_area_portals);
    const auto x = rows_of(l, kiln_level_area_portal_points, 3);
    for (std::size_t i = 0; i < p.size(); ++i)
        rows.push_back(with_entity(l, static_cast<std::uint32_t>(p[i].entity), {{"area_portal", i}, {"brush", source_of(l, kiln_level_brush_source, p[i].brush).brush},
                                   {"areas", row(p[i].area)}, {"winding", points(x, p[i].first_point, p[i].point_count)}}));
    return rows;
}
Rows dump_waters(const kiln_level* l) {
    Rows rows;
    const auto w = rows_of(l, kiln_level_waters);
    std::vector<std::size_t> leaves(w.size());
    for (const std::uint32_t of_leaf : rows_of(l, kiln_level_leaf_waters))
        if (of_leaf < w.size()) ++leaves[of_leaf];
    for (std::size_t i = 0; i < w.size(); ++i)
        rows.push_back({{"water", i}, {"contents", name(static_cast<Contents>(w[i].contents))}, {"surface_z", w[i].has_surface ? Json(w[i].surface_z) : Json()}, {"highest_z", w[i].surface_z}, {"min_z", w[i].min_z},
                        {"material", material_name(l, w[i].material)}, {"leaves", leaves[i]}});
    return rows;
}
Rows dump_occluders(const kiln_level* l) {
    Rows rows;
    const auto o = rows_of(l, kiln_level_occluders);
    const auto p = rows_of(l, kiln_level_occluder_polygons);
    const auto x = rows_of(l, kiln_level_occluder_points, 3);
    for (std::size_t i = 0; i < o.size(); ++i) {
        Json polygons = Json::array();
        for (const kiln_occluder_polygon& q : p.subspan(o[i].first_polygon, o[i].polygon_count)) polygons.push_back(points(x, q.first_point, q.point_count));
        rows.push_back(with_entity(l, static_cast<std::uint32_t>(o[i].entity), {{"occluder", i}, {"area", o[i].area}, {"polygons", polygons}}));
    }
    return rows;
}
Rows dump_overlays(const kiln_level* l) {
    Rows rows;
    const auto o = rows_of(l, kiln_level_overlays);
    const auto f = rows_of(l, kiln_level_overlay_fragments);
    const auto x = rows_of(l, kiln_level_overlay_points);
    for (std::size_t i = 0; i < o.size(); ++i) {
        Json fragments = Json::array();
        for (const kiln_overlay_fragment& part_of : f.subspan(o[i].first_fragment, o[i].fragment_count)) {
            Json corners = Json::array();
            for (const kiln_overlay_point& q : x.subspan(part_of.first_point, part_of.point_count)) corners.push_back({{"position", row(q.position)}, {"uv", row(q.uv)}});
            fragments.push_back({{"face", part_of.face}, {"points", corners}});
        }
        rows.push_back(with_entity(l, static_cast<std::uint32_t>(o[i].entity),
                                   {{"overlay", i}, {"kind", o[i].kind ? "decal" : "overlay"}, {"material", material_name(l, o[i].material)},
                                    {"render_order", o[i].render_order}, {"fade", {o[i].fade_min, o[i].fade_max}}, {"fragments", fragments}}));
    }
    return rows;
}
Rows dump_displacements(const kiln_level* l) {
    Rows rows;
    const auto d = rows_of(l, kiln_level_displacements);
    const auto x = rows_of(l, kiln_level_displacement_vertices, 4), blends = rows_of(l, kiln_level_displacement_blends, 4);
    const auto tags = rows_of(l, kiln_level_displacement_tags);
    for (std::uint32_t i = 0; i < d.size(); ++i) {
        const kiln_source at = source_of(l, kiln_level_displacement_source, i);
        rows.push_back({{"displacement", i}, {"brush", at.brush}, {"side", at.side}, {"file", file_of(l, kiln_level_displacement_file, i)}, {"line", at.line},
                        {"face", index(d[i].face)}, {"model", d[i].model}, {"material", material_name(l, d[i].material)}, {"power", d[i].power},
                        {"flags", d[i].flags}, {"base", row(d[i].base)}, {"vertices", tuples(x, 4, d[i].first_vertex, d[i].vertex_count)}, {"blends", tuples(blends, 4, d[i].first_blend, d[i].blend_count)}, {"tags", part(tags, d[i].first_tag, d[i].tag_count)}});
    }
    return rows;
}
Rows dump_patch_grids(const kiln_level* l) {
    Rows rows;
    const auto p = rows_of(l, kiln_level_curved_patches);
    const auto x = rows_of(l, kiln_level_patch_vertices, 5);
    for (std::uint32_t i = 0; i < p.size(); ++i) {
        const kiln_source at = source_of(l, kiln_level_patch_source, i);
        rows.push_back({{"patch_grid", i}, {"entity", at.entity}, {"patch", at.brush}, {"file", file_of(l, kiln_level_patch_file, i)}, {"line", at.line},
                        {"face", index(p[i].face)}, {"model", p[i].model}, {"material", material_name(l, p[i].material)},
                        {"columns", p[i].columns}, {"rows", p[i].rows}, {"vertices", tuples(x, 5, p[i].first_vertex, p[i].vertex_count)}});
    }
    return rows;
}

constexpr LevelArtefact kLevelArtefacts[] = {
    {"planes", dump_planes, "plane"},       {"nodes", dump_nodes, "node plane child"},
    {"leaves", dump_leaves, "leaf cluster area probe brushes faces"}, {"portals", dump_portals, "portal leaf plane"},
    {"vis", dump_vis},                      {"brushes", dump_brushes, "index line"},
    {"materials", dump_materials, "index"}, {"faces", dump_faces, "face line chart probe"},
    {"vertices", dump_vertices, "vertex"},  {"triangles", dump_triangles, "triangle face vertices"},
    {"charts", dump_charts, "chart page at"}, {"pages", dump_pages},
    {"lights", dump_lights, "light"},       {"cubes", dump_cubes, "cube lights"},
    {"probes", dump_probes, "probe entity"}, {"entities", dump_entities, "index line"},
    {"bevels", dump_bevels, "index line"},  {"areas", dump_areas, "area area_portals_to"},
    {"area_portals", dump_area_portals, "area_portal areas line"}, {"waters", dump_waters, "water"},
    {"occluders", dump_occluders, "occluder area line"}, {"overlays", dump_overlays, "overlay fragments line"},
    {"displacements", dump_displacements, "displacement face line"}, {"patch_grids", dump_patch_grids, "patch_grid face line"},
};

} // namespace

std::span<const LevelArtefact> level_artefacts() { return kLevelArtefacts; }

} // namespace kiln

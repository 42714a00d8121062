// dump: any artefact of the way from map to level as rows; one row a line in text, an array of objects in JSON. Rows
// stand in the order of their ids and numbers are printed shortest-exact, so dumps of equal artefacts are equal.
#include "compiler/pack/pack.h"
#include "libs/core/file.h"
#include "tools/kiln/commands.h"
#include "tools/kiln/dump_rows.h"
#include "tools/kiln/foreign_portals.h"
#include "tools/kiln/level_file.h"
#include <fmt/format.h>
#include <set>

namespace kiln {
namespace {

constexpr const char* kContents[] = {"empty", "solid", "detail", "window", "water", "slime", "lava", "area_portal", "hint", "clip", "trigger", "grate", "occluder", "vis_cluster"};
static_assert(std::size(kContents) == kContentsCount);

Rows dump_document(const Compiled& c) {
    Rows rows;
    const auto file = [&](std::uint16_t i) { return i ? Json(name_beside(c.document.file, c.document.name_of(i))) : Json(); };
    for (const DocEntity& e : c.document.entities) {
        Json keys = Json::array();
        for (const DocKey& k : e.keys) keys.push_back({k.key, k.value});
        rows.push_back({{"entity", e.id}, {"file", file(e.file)}, {"line", e.line}, {"keys", keys}, {"brushes", e.brushes.size()}});
        for (const DocBrush& b : e.brushes) {
            rows.push_back({{"brush", b.id}, {"file", file(b.file)}, {"line", b.line}, {"sides", b.sides.size()}});
            for (const DocSide& s : b.sides) {
                Json points = Json::array();
                for (const auto& p : s.points) points.push_back({p[0].to_double(), p[1].to_double(), p[2].to_double()});
                rows.push_back({{"side", s.id}, {"file", file(b.file)}, {"line", s.line}, {"material", s.material}, {"points", points}, {"u_axis", to_json(s.texture.u_axis)},
                                {"v_axis", to_json(s.texture.v_axis)}, {"shift", {s.texture.u_shift, s.texture.v_shift}},
                                {"scale", {s.texture.u_scale, s.texture.v_scale}}, {"lightmap_scale", s.lightmap_scale}, {"smoothing", s.smoothing_groups}});
            }
        }
    }
    return rows;
}
Rows dump_world(const Compiled& c) {
    Rows rows;
    for (std::size_t i = 0; i < c.world.materials.size(); ++i) {
        const Material& m = c.world.materials[i];
        rows.push_back({{"material", i}, {"name", m.name}, {"known", m.known}, {"reflectance", to_json(m.reflectance)}, {"emission", to_json(m.emission)},
                        {"flags", m.flags}, {"size", {m.width, m.height}}, {"normal_map", m.normal_map}, {"albedo_map", m.albedo_map},
                        {"alpha", m.alpha_stated || m.alpha < 1 ? Json(m.alpha) : Json()}, {"opacity_map", m.opacity_map.empty() ? Json() : Json({m.opacity_map.width, m.opacity_map.height})}});
    }
    for (std::size_t i = 0; i < c.world.brushes.size(); ++i) {
        const WorldBrush& b = c.world.brushes[i];
        rows.push_back({{"brush", i}, {"id", b.id}, {"file", file_of(c.world, c.world.location(id<BrushId>(i)))}, {"line", b.line}, {"contents", name(b.contents)}, {"model", to_json(b.model)}, {"entity", to_json(b.entity)},
                        {"sides", b.side_count}, {"draws", b.draws}, {"casts_light_shadow", b.casts_light_shadow}});
    }
    for (std::size_t i = 0; i < c.world.entities.size(); ++i) {
        const WorldEntity& e = c.world.entities[i];
        rows.push_back({{"entity", i}, {"id", e.id}, {"file", file_of(c.world, c.world.location(id<EntityId>(i)))}, {"line", e.line}, {"classname", e.get("classname")}, {"model", to_json(e.model)},
                        {"origin", e.has_origin ? to_json(e.origin) : Json()}});
    }
    return rows;
}
Rows dump_csg(const Compiled& c) {
    Rows rows;
    for (std::size_t i = 0; i < c.csg.fragments.size(); ++i) {
        const Fragment& f = c.csg.fragments[i];
        rows.push_back({{"fragment", i}, {"side", to_json(f.side)}, {"brush", to_json(f.brush)}, {"source", {c.world.location(f.side).entity, c.world.location(f.side).brush, c.world.location(f.side).side}}, {"file", file_of(c.world, c.world.location(f.side))}, {"model", to_json(f.model)}, {"behind", name(f.behind)},
                        {"front", name(f.front)}, {"points", list(points(c.csg.planes, f.polygon))}});
    }
    return rows;
}
Rows dump_bsp(const Compiled& c) {
    Rows rows;
    for (std::size_t i = 0; i < c.bsp.nodes.size(); ++i) {
        const BspNode& n = c.bsp.nodes[i];
        rows.push_back({{"node", i}, {"normal", to_json(c.bsp.planes.normal(n.plane))}, {"distance", c.bsp.planes.distance(n.plane)}, {"child", {n.child[0], n.child[1]}}});
    }
    for (std::size_t i = 0; i < c.bsp.leaves.size(); ++i) {
        const BspLeaf& l = c.bsp.leaves[i];
        rows.push_back({{"leaf", i}, {"contents", name(l.contents)}, {"cluster", to_json(l.cluster)}, {"outside", l.outside}, {"area", l.area},
                        {"bounds", to_json(l.bounds)}, {"brushes", list(l.brushes)}});
    }
    return rows;
}
Rows dump_portals(const Compiled& c) {
    Rows rows;
    for (std::size_t i = 0; i < c.portals.size(); ++i)
        rows.push_back({{"portal", i}, {"front", c.portals[i].cluster_front}, {"back", c.portals[i].cluster_back}, {"winding", list(c.portals[i].winding)}});
    return rows;
}
Rows dump_faces(const Compiled& c) {
    Rows rows;
    for (std::size_t i = 0; i < c.surfaces.faces.size(); ++i) {
        const Face& f = c.surfaces.faces[i];
        const SourceLocation at = location_of(c.world, c.surfaces, id<FaceId>(i));
        rows.push_back({{"face", i}, {"material", c.world.materials[f.material.at()].name}, {"model", to_json(f.model)}, {"chart", to_json(f.chart)},
                        {"normal", to_json(f.normal)}, {"distance", f.distance}, {"area", f.area}, {"triangles", f.triangle_count}, {"drawn", f.drawn},
                        {"sky", f.sky}, {"blocks_light", f.blocks_light}, {"tangent", to_json(f.tangent.t)}, {"bitangent", to_json(f.tangent.b)},
                        {"clusters", list(f.clusters)}, {"brush", at.brush}, {"side", at.side}, {"file", file_of(c.world, at)}, {"line", at.line}});
        if (f.curved()) rows.back()["curve"] = f.curve;
    }
    return rows;
}
Rows dump_curves(const Compiled& c) {
    Rows rows;
    for (std::size_t i = 0; i < c.surfaces.curves.size(); ++i) {
        const Curve& k = c.surfaces.curves[i];
        const SourceLocation at = location_of(c.world, c.surfaces, {k.first_face});
        Json grid = Json::array();
        for (const std::uint32_t p : k.grid) grid.push_back(to_json(c.surfaces.positions[p]));
        rows.push_back({{"curve", i}, {"kind", k.kind == Curve::displacement ? "displacement" : "patch"}, {"source", k.source},
                        {"columns", k.columns}, {"rows", k.rows}, {"first_face", k.first_face}, {"faces", k.face_count},
                        {"brush", at.brush}, {"side", at.side}, {"file", file_of(c.world, at)}, {"line", at.line}, {"vertices", grid}});
    }
    return rows;
}
Rows dump_charts(const Compiled& c) {
    Rows rows;
    for (std::size_t i = 0; i < c.surfaces.charts.size(); ++i) {
        const Chart& h = c.surfaces.charts[i];
        rows.push_back({{"chart", i}, {"origin", to_json(h.origin)}, {"s", to_json(h.s)}, {"t", to_json(h.t)}, {"luxel_size", h.luxel_size},
                        {"size", {h.width, h.height}}, {"first_texel", h.first_texel}, {"faces", list(h.faces)}, {"smooth", h.smooth}});
    }
    return rows;
}
Rows dump_overlays(const Compiled& c) {
    Rows rows;
    std::vector<std::pair<std::size_t, double>> parts(c.world.overlays.size()); // count, area
    for (const OverlayFragment& f : c.surfaces.overlay_fragments) {
        Vec3 twice;
        const OverlayPoint* p = &c.surfaces.overlay_points[f.first_point];
        for (std::uint32_t i = 1; i + 1 < f.point_count; ++i) twice += cross(p[i].position - p[0].position, p[i + 1].position - p[0].position);
        parts[f.overlay].first++, parts[f.overlay].second += length(twice) / 2;
    }
    for (std::size_t i = 0; i < c.world.overlays.size(); ++i) {
        const WorldOverlay& o = c.world.overlays[i];
        Json corners = Json::array();
        for (const Vec2 v : o.corners) corners.push_back({v.x, v.y});
        rows.push_back({{"overlay", i}, {"kind", o.kind == WorldOverlay::decal ? "decal" : "overlay"}, {"material", c.world.materials[o.material.at()].name},
                        {"entity", to_json(o.entity)}, {"file", file_of(c.world, c.world.location(o.entity))}, {"line", c.world.location(o.entity).line}, {"origin", to_json(o.origin)},
                        {"u", to_json(o.u)}, {"v", to_json(o.v)}, {"normal", to_json(o.normal)}, {"corners", corners}, {"uv_range", o.uv_range}, {"render_order", o.render_order},
                        {"fade", {o.fade_min, o.fade_max}}, {"sides", list(o.sides)}, {"fragments", parts[i].first}, {"area", parts[i].second}});
    }
    for (std::size_t i = 0; i < c.surfaces.overlay_fragments.size(); ++i) {
        const OverlayFragment& f = c.surfaces.overlay_fragments[i];
        Json points = Json::array();
        for (std::uint32_t k = f.first_point; k < f.first_point + f.point_count; ++k) {
            const OverlayPoint& p = c.surfaces.overlay_points[k];
            points.push_back({p.position.x, p.position.y, p.position.z, p.uv.x, p.uv.y});
        }
        rows.push_back({{"fragment", i}, {"overlay", f.overlay}, {"face", to_json(f.face)}, {"points", points}});
    }
    return rows;
}
Rows dump_lights(const Compiled& c) {
    Rows rows;
    for (std::size_t i = 0; i < c.lights.size(); ++i) {
        const Light& l = c.lights[i];
        rows.push_back({{"light", i}, {"kind", kLightKindNames[static_cast<std::size_t>(l.kind)]}, {"entity", to_json(l.entity)}, {"position", to_json(l.position)}, {"direction", to_json(l.direction)},
                        {"intensity", to_json(l.intensity)}, {"constant", l.constant}, {"linear", l.linear}, {"quadratic", l.quadratic}, {"range", l.range},
                        {"cos_inner", l.cos_inner}, {"cos_outer", l.cos_outer}, {"exponent", l.exponent}, {"style", l.style}});
    }
    return rows;
}
Rows dump_patches(const Compiled& c) {
    Rows rows;
    for (std::size_t i = 0; i < c.lighting.patches.size(); ++i) {
        const Patch& p = c.lighting.patches[i];
        rows.push_back({{"patch", i}, {"face", to_json(p.face)}, {"centroid", to_json(p.centroid)}, {"area", p.area}, {"reflectance", to_json(p.reflectance)},
                        {"emission", to_json(p.emission)}, {"radiosity", to_json(c.lighting.radiosity[i])}});
    }
    return rows;
}
Rows dump_cubes(const Compiled& c) {
    Rows rows;
    for (std::size_t i = 0; i < c.ambient.cubes.size(); ++i) {
        const AmbientCube& a = c.ambient.cubes[i];
        Json faces = Json::array();
        for (const Rgb& rgb : a.irradiance) faces.push_back(to_json(rgb));
        rows.push_back({{"cube", i}, {"position", to_json(a.position)}, {"irradiance", faces}, {"local_lights", list(a.local_lights)}, {"invalid_share", a.invalid_share}});
    }
    return rows;
}
Rows dump_probes(const Compiled& c) {
    Rows rows;
    for (std::size_t i = 0; i < c.probes.probes.size(); ++i) {
        const Probe& p = c.probes.probes[i];
        Rgbd sum{};
        const std::size_t top = std::size_t{6} * p.size * p.size;
        for (std::size_t k = 0; k < top; ++k) sum += Rgbd(p.texels[k]);
        rows.push_back({{"probe", i}, {"position", to_json(p.position)}, {"entity", to_json(p.entity)}, {"size", p.size}, {"mips", p.mips},
                        {"mean", to_json(sum / std::max<double>(1, static_cast<double>(top)))}, {"box", p.boxed ? to_json(p.box) : Json()},
                        {"faces", std::count(c.probes.face_probe.begin(), c.probes.face_probe.end(), i)}});
    }
    return rows;
}

Rows dump_vis(const Compiled& c) { return vis_rows(c.merged ? c.merged->visibility : c.visibility); }

constexpr Artefact kMapArtefacts[] = {
    {"document", Stage::read, dump_document, "line"}, {"world", Stage::world, dump_world, "material brush entity line"}, {"fragments", Stage::csg, dump_csg, "fragment side brush"},
    {"bsp", Stage::bsp, dump_bsp, "node leaf child cluster area brushes"}, {"portals", Stage::bsp, dump_portals, "portal front back"}, {"vis", Stage::visibility, dump_vis},
    {"faces", Stage::surfaces, dump_faces, "face chart clusters line"}, {"charts", Stage::surfaces, dump_charts, "chart first_texel faces"}, {"curves", Stage::surfaces, dump_curves, "curve source first_face line"}, {"overlays", Stage::surfaces, dump_overlays, "overlay fragment face line"}, {"lights", Stage::light, dump_lights, "light entity"},
    {"patches", Stage::light, dump_patches, "patch face"}, {"cubes", Stage::ambient, dump_cubes, "cube local_lights"}, {"probes", Stage::probes, dump_probes, "probe entity"},
};
std::vector<Artefact> artefacts() {
    std::vector<Artefact> all(std::begin(kMapArtefacts), std::end(kMapArtefacts));
    all.insert(all.end(), geometry_artefacts().begin(), geometry_artefacts().end());
    return all;
}

std::string dump_text(const Json& j) { return j.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace); }

std::string as_text(const Rows& rows) {
    std::string out;
    for (const Json& row : rows) {
        bool first = true;
        for (const auto& [key, value] : row.items()) {
            out += fmt::format("{}{} {}", first ? "" : "  ", key, dump_text(value));
            first = false;
        }
        out += '\n';
    }
    return out;
}
std::string as_json(const Rows& rows) {
    std::string out = "[\n";
    for (std::size_t i = 0; i < rows.size(); ++i) out += dump_text(rows[i]) + (i + 1 < rows.size() ? ",\n" : "\n");
    return out + "]\n";
}

// Keeps the rows of which each filter holds: KEY=VALUE as the text shows it, quotes left out.
void filter(Rows& rows, const std::vector<std::string>& filters) {
    std::erase_if(rows, [&](const Json& row) {
        return !std::ranges::all_of(filters, [&](const std::string& f) {
            const std::string key = f.substr(0, f.find('=')), value = f.substr(std::min(f.size(), key.size() + 1));
            const auto it = row.find(key);
            return it != row.end() && (it->is_string() ? it->get<std::string>() == value : dump_text(*it) == value);
        });
    });
}

// So that a change shows where it is and nowhere else: without running numbers, in the order of the text.
void settle_for_diff(Rows& rows, const std::string& running) {
    std::set<std::string> names;
    for (std::size_t at = 0; at < running.size();) {
        const std::size_t end = std::min(running.find(' ', at), running.size());
        names.insert(running.substr(at, end - at));
        at = end + 1;
    }
    for (Json& row : rows) {
        Json kept = Json::object();
        for (const auto& [key, value] : row.items())
            if (!names.contains(key)) kept[key] = value;
        row = std::move(kept);
    }
    std::ranges::stable_sort(rows, {}, [](const Json& row) { return dump_text(row); });
}

} // namespace

Json file_of(const World& world, const SourceLocation& at) { return at.file == world.file || at.file.empty() ? Json() : Json(name_beside(world.file, at.file)); }
const char* name(Contents c) { return kContents[static_cast<std::size_t>(c) % std::size(kContents)]; }

Command dump_command(CLI::App& app) {
    struct Options { BakeOptions bake; std::string artefact, output; std::vector<std::string> filters; bool json = false, for_diff = false; };
    auto o = std::make_shared<Options>();
    std::vector<std::string> names;
    std::string of_maps, of_levels;
    for (const Artefact& a : artefacts()) names.emplace_back(a.name), of_maps += std::string(of_maps.empty() ? "" : ", ") + a.name;
    for (const LevelArtefact& a : level_artefacts()) names.emplace_back(a.name), of_levels += std::string(of_levels.empty() ? "" : ", ") + a.name;
    app.add_option("artefact", o->artefact, "What to dump (below)")->required()->check([names](const std::string& word) {
        return std::ranges::find(names, word) != names.end() ? std::string() : "no artefact " + word + "; `kiln dump --help` lists all";
    });
    o->bake.add_to(app);
    app.get_option("map")->description("The map (.vmf, .vmm, .map), or a level file; for vis also a portal file (.prt)");
    app.add_option("-o,--output", o->output, "File (default: standard output)")->type_name("FILE");
    app.add_flag("--json", o->json, "JSON: an array, one row a line");
    app.add_option("--filter", o->filters, "Only rows with this value, as the text shows it; several: all must hold")->type_name("KEY=VALUE")->check([](const std::string& f) {
        return f.find('=') != std::string::npos && f[0] != '=' ? std::string() : "a filter is KEY=VALUE";
    });
    app.add_flag("--for-diff", o->for_diff, "Leave out running numbers and line numbers and sort the rows: a change shows where it is and nowhere else");
    app.footer("examples:\n  kiln dump faces maps/atrium/atrium.vmf --filter brush=12\n  kiln dump vis m.map --json -o vis.json\n"
               "  diff <(kiln dump faces old.vmf --for-diff) <(kiln dump faces new.vmf --for-diff)\n"
               "of a map: " + of_maps + "\nof a level: " + of_levels + "\nDumps are stable: equal artefacts give equal bytes.");
    return [o]() -> int {
        Console console;
        o->bake.settle(console);
        Context context = console.make_context(o->bake.thread_count());
        if (same_file(o->output, o->bake.map)) return console.fail(fault(Exit::usage, "usage", "the output is the input itself", {.file = o->output}));
        const auto bytes = read_file(o->bake.map);
        if (!bytes) return console.fail(bytes.fault());
        Rows rows;
        std::string running;
        const auto missing = [&](const char* what) {
            return console.fail(fault(Exit::usage, "usage", fmt::format("{} has no {}; `kiln dump --help` lists what there is", what, o->artefact), {.file = o->bake.map}));
        };
        if (is_level(*bytes)) {
            const auto wanted = std::ranges::find(level_artefacts(), o->artefact, [](const LevelArtefact& a) { return std::string(a.name); });
            if (wanted == level_artefacts().end()) return missing("a level");
            const auto file = open_level(o->bake.map);
            if (!file) return console.fail(file.fault());
            const char* what = "";
            if (const kiln_status s = kiln_level_check(file->level.get(), &what); s != KILN_OK)
                return console.fail(fault(Exit::input, "level-damaged", fmt::format("{}: {}", kiln_status_text(s), what), {.file = o->bake.map}));
            rows = wanted->rows(file->level.get()), running = wanted->running;
        } else if (is_portal_file(*bytes)) {
            if (o->artefact != "vis") return missing("a portal file");
            const auto file = read_foreign_portals(*bytes, o->bake.map, context);
            if (!file) return console.print_new(context), console.fail(file.fault());
            VisibilityOptions sight = o->bake.compile.visibility;
            sight.radius = std::max(sight.radius, 0.0);
            auto computed = compute_visibility(file->given.portals, file->cluster_count, sight, context, {.seconds = o->bake.vis_budget});
            console.print_new(context);
            if (!computed) return console.fail(computed.fault());
            Compiled c;
            c.visibility = *std::move(computed);
            c.merged = merge_foreign(c.visibility, *file, o->bake.compile.vis_merge, context);
            rows = dump_vis(c);
        } else {
            const std::vector<Artefact> all = artefacts();
            const auto wanted = std::ranges::find(all, o->artefact, [](const Artefact& a) { return std::string(a.name); });
            if (wanted == all.end()) return missing("a map");
            if (o->artefact == "leak") o->bake.compile.bsp.allow_leaks = true;
            Compiled c;
            if (const int code = compile_map(o->bake, console, context, wanted->stage, c); code != 0) return code;
            rows = wanted->rows(c), running = wanted->running;
        }
        filter(rows, o->filters);
        if (o->for_diff) settle_for_diff(rows, running);
        const std::string text = o->json ? as_json(rows) : as_text(rows);
        if (o->output.empty()) {
            if (const int code = print_output(text); code != 0) return code;
        } else if (const auto written = write_file(o->output, text); !written) {
            return console.fail(written.fault());
        }
        return console.verdict(context);
    };
}

} // namespace kiln

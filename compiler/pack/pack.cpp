#include "compiler/pack/pack.h"
#include "compiler/collision/collision.h"
#include "compiler/pack/water_distance.h"
#include "libs/core/check.h"
#include <algorithm>
#include <charconv>
#include <filesystem>

namespace kiln {
namespace {

level::Float3 floats(Vec3 v) { return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)}; }
level::Float3 floats(Rgb v) { return {v.x, v.y, v.z}; }
level::Double3 doubles(Vec3 v) { return {v.x, v.y, v.z}; }

// Boxes are conservative: a box in floats must not lie inside the one in doubles.
level::Float3 floats_below(Vec3 v) {
    level::Float3 out = floats(v);
    for (std::size_t i = 0; i < 3; ++i)
        if (out[i] > v[i]) out[i] = std::nextafter(out[i], -INFINITY);
    return out;
}
level::Float3 floats_above(Vec3 v) {
    level::Float3 out = floats(v);
    for (std::size_t i = 0; i < 3; ++i)
        if (out[i] < v[i]) out[i] = std::nextafter(out[i], INFINITY);
    return out;
}

std::string number(double value) { // shortest that reads back the same
    char text[40];
    return std::isfinite(value) ? std::string(text, std::to_chars(text, text + sizeof text, value).ptr) : "null";
}
std::string error_json(const ErrorReport& e, const Density* density) {
    return "{\"target\":" + number(e.target) + ",\"estimate\":" + number(e.estimate) + ",\"low\":" + number(e.low) +
           ",\"high\":" + number(e.high) + ",\"noise\":" + number(e.noise) + ",\"patch_bias\":" + number(e.patch_bias) +
           ",\"iteration\":" + number(e.iteration) + ",\"shortcuts\":" + number(e.shortcuts) + ",\"solution\":" + number(e.solution) + ",\"representation\":" + number(e.representation) +
           (density && density->shown.places > 0 ? ",\"shown\":" + number(density->shown.percent) + ",\"shown_high\":" + number(density->shown.high) + ",\"shown_p95\":" + number(density->shown.p95) : "") + "}";
}

bool coarse(const PackInput& in) { return in.density && !in.density->grids.empty(); }

void add_planes(const PlaneTable& table, level::LevelContent& out) {
    out.plane_grid_bits = static_cast<std::uint32_t>(table.grid_bits);
    for (std::size_t i = 0; i < table.planes.size(); ++i) {
        const ExactPlane& e = table.planes[i];
        level::Plane p;
        // Both faces of a plane from the even one, so that they are each other's negation to the last bit.
        const auto even = id<PlaneId>(i & ~std::size_t{1});
        const double sign = i & 1 ? -1 : 1;
        p.normal = doubles(table.normal(even) * sign), p.distance = table.distance(even) * sign;
        p.exact = {e.a, e.b, e.c};
        p.exact_d_high = static_cast<std::int64_t>(e.d >> 64), p.exact_d_low = static_cast<std::uint64_t>(e.d);
        out.planes.push_back(p);
    }
}

bool shown(const Face& f) { return f.drawn || f.sky; }

// Which face of the level each face is in. All that is shown of a curve is one; what is not is in none (UINT32_MAX).
std::vector<std::uint32_t> level_faces(const Surfaces& s) {
    std::vector<std::uint32_t> out;
    std::uint32_t next = 0, last_curve = UINT32_MAX;
    for (const Face& f : s.faces) {
        if (!f.curved()) out.push_back(next++);
        else if (!shown(f)) out.push_back(UINT32_MAX);
        else if (f.curve == last_curve) out.push_back(next - 1);
        else out.push_back(next++), last_curve = f.curve;
    }
    return out;
}

void add_tree(const PackInput& in, const std::vector<std::uint32_t>& level_brush, level::LevelContent& out) {
    for (const BspNode& n : in.bsp.nodes)
        out.nodes.push_back({n.plane.value, n.child, floats_below(n.bounds.lo), floats_above(n.bounds.hi)});
    std::vector<std::vector<std::uint32_t>> leaves_of(in.bsp.cluster_count);
    for (std::size_t i = 0; i < in.bsp.leaves.size(); ++i) {
        const BspLeaf& l = in.bsp.leaves[i];
        level::Leaf leaf;
        leaf.contents = static_cast<std::uint8_t>(l.contents);
        leaf.cluster = !l.cluster.valid() ? -1 : static_cast<std::int32_t>(in.merged ? in.merged->of[l.cluster.at()] : l.cluster.value);
        leaf.area = l.area;
        leaf.probe = i < in.probes.leaf_probe.size() ? in.probes.leaf_probe[i] : UINT32_MAX;
        leaf.lo = floats_below(l.bounds.lo), leaf.hi = floats_above(l.bounds.hi);
        for (const BrushId b : l.brushes)
            if (level_brush[b.at()] != UINT32_MAX) leaf.brushes.push_back(level_brush[b.at()]);
        if (l.cluster.valid()) leaves_of[l.cluster.at()].push_back(static_cast<std::uint32_t>(i));
        out.leaves.push_back(std::move(leaf));
    }
    const std::vector<std::uint32_t> level_face = level_faces(in.surfaces);
    for (std::size_t f = 0; f < in.surfaces.faces.size(); ++f) {
        const Face& face = in.surfaces.faces[f];
        if (!face.drawn && !face.sky) continue;
        for (const ClusterId c : face.clusters)
            for (const std::uint32_t l : leaves_of[c.at()]) // by face: each list comes out sorted
                if (out.leaves[l].faces.empty() || out.leaves[l].faces.back() != level_face[f]) out.leaves[l].faces.push_back(level_face[f]);
    }
    for (const BspPortal& p : in.bsp.portals) {
        level::Portal portal;
        portal.leaf = {static_cast<std::int32_t>(p.leaf_front.value), static_cast<std::int32_t>(p.leaf_back.value)};
        portal.plane = p.plane.value;
        for (const Vec3 x : p.winding) portal.winding.push_back(floats(x));
        out.portals.push_back(std::move(portal));
    }
    const Visibility& seen = in.merged ? in.merged->visibility : in.visibility; // lists of faces stay those of the leaves alone
    out.cluster_count = seen.cluster_count;
    out.vis_rows = seen.rows;
    out.shut_rows = seen.shut;
}

// Numbered as World::name_of does.
void add_files(const World& world, level::LevelContent& out) {
    for (const std::string& name : world.included) out.source_files.push_back(name_beside(world.file, name));
}

// Which brush of the level each brush of the world is; UINT32_MAX: it was invalid and left out.
std::vector<std::uint32_t> add_brushes(const PackInput& in, const CollisionBrushes& collision, level::LevelContent& out) {
    std::vector<std::uint32_t> number(in.world.brushes.size(), UINT32_MAX);
    for (std::size_t i = 0; i < in.world.brushes.size(); ++i) {
        const WorldBrush& b = in.world.brushes[i];
        const BrushPolytope& polytope = in.csg.brushes[i];
        if (!polytope.valid || b.displaced) continue; // of those the displacement is what things collide with
        const SourceLocation where = in.world.location(id<BrushId>(i));
        level::Brush brush;
        brush.model = b.model.valid() ? b.model.value : 0;
        brush.contents = static_cast<std::uint8_t>(b.contents);
        brush.blocks = b.blocks;
        brush.source_entity = where.entity, brush.source_id = b.id, brush.source_line = b.line;
        brush.source_file = b.file;
        for (std::size_t k = 0; k < polytope.faces.size(); ++k) {
            brush.planes.push_back(polytope.faces[k].support.value);
            brush.source_sides.push_back(in.world.sides[polytope.sides[k].at()].id);
        }
        for (std::uint32_t k = collision.first_bevel[i]; k < collision.first_bevel[i + 1]; ++k)
            brush.bevels.push_back({doubles(collision.bevels[k].normal), collision.bevels[k].distance});
        number[i] = static_cast<std::uint32_t>(out.brushes.size());
        out.brushes.push_back(std::move(brush));
    }
    return number;
}

void add_faces(const PackInput& in, level::LevelContent& out) {
    for (const Vec3 p : in.surfaces.positions) out.positions.push_back(doubles(p));
    for (std::size_t i = 0; i < in.surfaces.faces.size() && !in.surfaces.faces[i].curved(); ++i) {
        const Face& f = in.surfaces.faces[i];
        const SourceLocation where = in.world.location(f.side);
        const DocTexture& texture = in.world.sides[f.side.at()].texture;
        level::FaceInfo face;
        face.material = f.material.value, face.model = f.model.valid() ? f.model.value : 0, face.plane = f.plane.value;
        face.chart = f.chart.value;
        face.probe = i < in.probes.face_probe.size() ? in.probes.face_probe[i] : UINT32_MAX;
        face.drawn = f.drawn, face.sky = f.sky, face.two_sided = f.two_sided, face.blocks_light = f.blocks_light;
        face.no_dynamic_shadow = in.world.sides[f.side.at()].no_dynamic_shadow;
        face.tangent = floats(f.tangent.t), face.bitangent = floats(f.tangent.b), face.normal = floats(f.normal);
        face.u_axis = doubles(texture.u_axis), face.v_axis = doubles(texture.v_axis);
        face.u_scale = texture.u_scale, face.v_scale = texture.v_scale;
        face.u_shift = texture.u_shift, face.v_shift = texture.v_shift;
        face.source_entity = where.entity, face.source_brush = where.brush;
        face.source_side = where.side, face.source_line = where.line;
        face.source_file = file_of(in.world, in.surfaces, id<FaceId>(i));
        face.first_triangle = static_cast<std::uint32_t>(out.triangles.size());
        if (f.drawn || f.sky) { // what only blocks light is of no use at run time
            face.triangle_count = f.triangle_count;
            for (std::size_t t = f.first_triangle; t < std::size_t{f.first_triangle} + f.triangle_count; ++t) {
                out.triangles.push_back(in.surfaces.triangles[t]);
                const auto& n = in.surfaces.corner_normals[t];
                out.corner_normals.push_back({level::Float3{n[0].x, n[0].y, n[0].z}, level::Float3{n[1].x, n[1].y, n[1].z},
                                              level::Float3{n[2].x, n[2].y, n[2].z}});
            }
        }
        out.faces.push_back(face);
    }
}

void add_spaces(const PackInput& in, const std::vector<std::uint32_t>& level_brush, level::LevelContent& out) {
    const auto winding = [](std::span<const Vec3> points) {
        std::vector<level::Float3> floats_of;
        for (const Vec3& p : points) floats_of.push_back(floats(p));
        return floats_of;
    };
    for (const AreaPortal& p : in.bsp.area_portals)
        out.area_portals.push_back({static_cast<std::int32_t>(in.world.brushes[p.brush.at()].entity.value), level_brush[p.brush.at()], p.areas, winding(p.winding)});
    for (const Occluder& o : in.bsp.occluders) {
        level::OccluderInfo occluder{static_cast<std::int32_t>(o.entity.value), o.area, {}};
        for (const std::uint32_t f : o.fragments) occluder.polygons.push_back(winding(points(in.csg.planes, in.csg.fragments[f].polygon)));
        out.occluders.push_back(std::move(occluder));
    }
    for (const WaterVolume& w : in.bsp.waters)
        out.waters.push_back({static_cast<std::uint8_t>(w.contents), static_cast<float>(w.surface_z), static_cast<float>(w.min_z), w.has_surface, w.material.value});
    if (out.waters.empty()) return;
    out.leaf_water = in.bsp.leaf_water;
    out.leaf_water_distance = leaf_water_distances(in.bsp, in.visibility);
}

std::array<float, 2> floats(Vec2 v) { return {static_cast<float>(v.x), static_cast<float>(v.y)}; }

// A face of what is shown of a curve, with its grid for collision.
void add_curve(const PackInput& in, const Curve& curve, level::LevelContent& out) {
    const Surfaces& s = in.surfaces;
    level::FaceInfo face;
    face.curved = true, face.drawn = face.blocks_light = false;
    face.first_triangle = static_cast<std::uint32_t>(out.triangles.size());
    const Face* largest = nullptr;
    for (std::uint32_t i = curve.first_face; i < curve.first_face + curve.face_count; ++i) {
        const Face& f = s.faces[i];
        if (!shown(f)) continue;
        face.drawn = face.drawn || f.drawn, face.sky = face.sky || f.sky;
        face.two_sided = f.two_sided, face.blocks_light = f.blocks_light;
        if (f.chart.valid()) face.chart = f.chart.value;
        if (!largest || f.area > largest->area) {
            largest = &f;
            face.probe = i < in.probes.face_probe.size() ? in.probes.face_probe[i] : UINT32_MAX;
        }
        for (std::uint32_t t = f.first_triangle; t < f.first_triangle + f.triangle_count; ++t) {
            out.triangles.push_back(s.triangles[t]);
            std::array<level::Float3, 3> normals;
            std::array<level::CurveCorner, 3> corners;
            for (std::size_t c = 0; c < 3; ++c) {
                const Vec3f n = s.corner_normals[t][c];
                const CurveCorner& from = s.corners_of(t)[c];
                normals[c] = {n.x, n.y, n.z};
                const Vec2 texel = f.chart.valid() && coarse(in) ? texel_from_luxel(in.density->grids[f.chart.at()], from.luxel) : from.luxel;
                corners[c] = {floats(texel), floats(from.uv), static_cast<float>(from.alpha)};
            }
            out.corner_normals.push_back(normals), out.curve_corners.push_back(corners);
        }
    }
    face.triangle_count = static_cast<std::uint32_t>(out.triangles.size()) - face.first_triangle;
    const Face& any = largest ? *largest : s.faces[curve.first_face];
    const SourceLocation where = location_of(in.world, s, {curve.first_face});
    face.material = any.material.value, face.model = any.model.valid() ? any.model.value : 0;
    face.source_entity = where.entity, face.source_brush = where.brush, face.source_side = where.side, face.source_line = where.line;
    face.source_file = file_of(in.world, s, {curve.first_face});
    const Chart* chart = face.chart != UINT32_MAX ? &s.charts[face.chart] : nullptr;
    const Frame frame = chart ? chart->frame : any.tangent;
    face.tangent = floats(frame.t), face.bitangent = floats(frame.b), face.normal = floats(frame.n);
    // No axes hold on all of it; those of its base or its largest part come nearest.
    if (any.side.valid()) {
        const DocTexture& texture = in.world.sides[any.side.at()].texture;
        face.u_axis = doubles(texture.u_axis), face.v_axis = doubles(texture.v_axis);
        face.u_scale = texture.u_scale, face.v_scale = texture.v_scale;
        face.u_shift = texture.u_shift, face.v_shift = texture.v_shift;
    } else {
        face.u_axis = doubles(any.tangent.t), face.v_axis = doubles(any.tangent.b);
    }
    std::vector<level::Float3> grid;
    for (const std::uint32_t p : curve.grid) grid.push_back(floats(s.positions[p]));
    const std::uint32_t number = largest ? static_cast<std::uint32_t>(out.faces.size()) : UINT32_MAX;
    if (curve.kind == Curve::displacement) {
        const WorldDisplacement& from = in.world.displacements[curve.source];
        level::Displacement d;
        d.face = number, d.model = face.model, d.material = face.material;
        face.plane = d.plane = curve.base_plane.value;
        d.power = static_cast<std::uint32_t>(from.grid.power), d.flags = from.grid.flags;
        for (std::size_t k = 0; k < 4; ++k) d.base[k] = doubles(curve.base[k]);
        d.positions = std::move(grid);
        for (std::size_t v = 0; v < d.positions.size(); ++v)
            d.alphas.push_back(from.grid.alphas.empty() ? 0 : static_cast<float>(std::clamp(from.grid.alphas[v] / 255, 0.0, 1.0)));
        for (const auto& weights : from.grid.multiblend)
            d.multiblend.push_back({static_cast<float>(weights[0]), static_cast<float>(weights[1]), static_cast<float>(weights[2]),
                                    static_cast<float>(weights[3])});
        d.triangle_tags = from.grid.triangle_tags;
        d.source_entity = where.entity, d.source_brush = where.brush, d.source_side = where.side, d.source_line = where.line;
        d.source_file = face.source_file;
        out.displacements.push_back(std::move(d));
    } else {
        level::CurvedPatch p;
        p.face = number, p.model = face.model, p.material = face.material;
        p.columns = curve.columns, p.rows = curve.rows;
        p.positions = std::move(grid);
        for (const Vec2 uv : curve.uv) p.uv.push_back(floats(uv));
        p.source_entity = where.entity, p.source_patch = where.brush, p.source_line = where.line;
        p.source_file = face.source_file;
        out.patches.push_back(std::move(p));
    }
    if (largest) out.faces.push_back(face);
}

void add_charts(const PackInput& in, level::LevelContent& out) {
    const Lighting& light = in.lighting;
    const bool baked = !light.flat.empty() || in.surfaces.texel_count == 0;
    for (std::size_t i = 0; i < in.surfaces.charts.size(); ++i) {
        const Chart& c = in.surfaces.charts[i];
        level::ChartInfo chart;
        chart.origin = doubles(c.origin), chart.s = doubles(c.s), chart.t = doubles(c.t);
        chart.luxel_size = static_cast<float>(c.luxel_size);
        chart.width = c.width, chart.height = c.height;
        chart.directional = i < light.rnm_first.size() && light.rnm_first[i] != UINT32_MAX;
        chart.smooth = c.smooth;
        chart.tangent = floats(c.frame.t), chart.bitangent = floats(c.frame.b), chart.normal = floats(c.frame.n);
        const std::size_t texels = std::size_t{c.width} * c.height;
        double sum = 0, known = 0;
        if (!light.texel_error.empty())
            for (std::size_t t = c.first_texel; t < c.first_texel + texels; ++t)
                if (light.texel_error[t] > 0) sum += light.texel_error[t], ++known;
        chart.error = known > 0 ? static_cast<float>(sum / known) : 0.0f;
        std::uint32_t first_texel = c.first_texel, first_rnm = chart.directional ? light.rnm_first[i] : UINT32_MAX;
        if (coarse(in)) {
            const ChartGrid& g = in.density->grids[i];
            const Vec3 origin = c.origin - (c.s * (g.shift.x / g.scale.x) + c.t * (g.shift.y / g.scale.y)) * c.luxel_size;
            chart.origin = doubles(origin), chart.s = doubles(c.s * g.scale.x), chart.t = doubles(c.t * g.scale.y);
            chart.width = g.width, chart.height = g.height;
            first_texel = g.first_texel, first_rnm = g.first_rnm;
        }
        out.charts.push_back(chart);
        out.chart_first_texel.push_back(first_texel);
        out.chart_first_rnm.push_back(first_rnm);
    }
    KILN_CHECK(baked);
    const auto texels = [&](const auto& from) { // of Lighting or of Density
        for (const Rgb& v : from.flat) out.flat.push_back(floats(v));
        out.valid = from.valid, out.texel_error = from.texel_error;
        out.rnm.reserve(from.rnm.size());
        for (const auto& v : from.rnm) out.rnm.push_back({floats(v[0]), floats(v[1]), floats(v[2])});
    };
    if (coarse(in)) texels(*in.density);
    else texels(light);
}

void add_lights(const PackInput& in, level::LevelContent& out) {
    for (const Light& l : in.lights) {
        level::LocalLight light;
        light.kind = static_cast<std::uint8_t>(l.kind), light.falloff = static_cast<std::uint8_t>(l.falloff);
        light.position = doubles(l.position), light.direction = doubles(l.direction);
        light.intensity = floats(l.intensity);
        light.constant = l.constant, light.linear = l.linear, light.quadratic = l.quadratic;
        light.range = l.range, light.fade_start = l.fade_start, light.fade_end = l.fade_end;
        light.cos_inner = l.cos_inner, light.cos_outer = l.cos_outer, light.exponent = l.exponent;
        light.angular_radius_rad = l.angular_radius_rad, light.angle_scale = l.angle_scale;
        light.style = l.style;
        if (l.entity.valid()) {
            light.entity = in.world.entities[l.entity.at()].id;
            light.line = in.world.entities[l.entity.at()].line;
            light.source_file = in.world.entities[l.entity.at()].file;
        }
        out.lights.push_back(light);
    }
    const Ambient& a = in.ambient;
    out.cubes.origin = doubles(a.origin), out.cubes.root_size = a.root_size, out.cubes.root_count = a.root_count;
    out.cubes.tree = a.tree;
    for (const AmbientCell& c : a.cells)
        out.cubes.cells.push_back({floats(c.lo), c.size, c.cubes, c.mask, floats(c.plane_normal), c.plane_distance, c.beyond, c.behind});
    for (const AmbientCube& c : a.cubes) {
        level::Cube cube;
        cube.position = floats(c.position);
        for (std::size_t f = 0; f < 6; ++f) cube.irradiance[f] = floats(c.irradiance[f]);
        cube.local_lights = c.local_lights;
        out.cubes.cubes.push_back(std::move(cube));
    }
    for (const Probe& p : in.probes.probes) {
        level::ProbeInfo probe;
        probe.position = floats(p.position);
        probe.entity = p.entity.valid() ? static_cast<std::int32_t>(p.entity.value) : -1;
        probe.size = p.size, probe.mips = p.mips, probe.boxed = p.boxed;
        if (p.boxed) probe.box_lo = floats(p.box.lo), probe.box_hi = floats(p.box.hi);
        for (const Rgb& t : p.texels) probe.texels.push_back(floats(t));
        out.probes.push_back(std::move(probe));
    }
}

void add_overlays(const PackInput& in, level::LevelContent& out) {
    for (const WorldOverlay& o : in.world.overlays) {
        level::OverlayInfo info;
        info.kind = static_cast<std::uint32_t>(o.kind), info.material = o.material.value;
        info.entity = o.entity.valid() ? static_cast<std::int32_t>(o.entity.value) : -1;
        info.render_order = o.render_order;
        info.fade_min = static_cast<float>(o.fade_min), info.fade_max = static_cast<float>(o.fade_max);
        out.overlays.push_back(std::move(info));
    }
    const std::vector<std::uint32_t> level_face = level_faces(in.surfaces);
    for (const OverlayFragment& f : in.surfaces.overlay_fragments) {
        level::OverlayPiece piece;
        piece.face = level_face[f.face.at()];
        for (std::size_t i = f.first_point; i < std::size_t{f.first_point} + f.point_count; ++i) {
            const OverlayPoint& p = in.surfaces.overlay_points[i];
            piece.points.push_back(floats(p.position));
            piece.uv.push_back({static_cast<float>(p.uv.x), static_cast<float>(p.uv.y)});
        }
        out.overlays[f.overlay].pieces.push_back(std::move(piece));
    }
}

} // namespace

level::LevelContent level_content(const PackInput& in, Context& context) {
    level::LevelContent out;
    const std::size_t slash = in.world.file.find_last_of("/\\");
    out.source_name = slash == std::string::npos ? in.world.file : in.world.file.substr(slash + 1);
    out.compiler_version = in.version, out.options_json = in.options_json, out.input_hash = in.input_hash;
    out.error_json = error_json(in.lighting.error, in.density);
    out.rnm_encoding = static_cast<std::uint8_t>(in.lighting.encoding);
    out.model_count = std::max(1u, in.world.model_count);
    add_files(in.world, out);
    add_planes(in.csg.planes, out);
    const std::vector<std::uint32_t> level_brush = add_brushes(in, build_collision(in.csg, context), out);
    add_tree(in, level_brush, out);
    add_spaces(in, level_brush, out);
    for (const Material& m : in.world.materials) {
        level::MaterialInfo material;
        material.name = m.name, material.albedo_map = m.albedo_map, material.normal_map = m.normal_map;
        material.reflectance = floats(m.reflectance), material.emission = floats(m.emission);
        material.alpha = m.alpha, material.env_map = m.env_map, material.roughness = m.roughness;
        material.flags = m.flags;
        material.width = static_cast<std::uint32_t>(std::max(0, m.width));
        material.height = static_cast<std::uint32_t>(std::max(0, m.height));
        out.materials.push_back(std::move(material));
    }
    add_faces(in, out);
    for (const Curve& curve : in.surfaces.curves) add_curve(in, curve, out);
    add_charts(in, out);
    add_lights(in, out);
    add_overlays(in, out);
    for (const WorldEntity& e : in.world.entities) {
        level::EntityInfo entity;
        for (const DocKey& k : e.keys) entity.keys.emplace_back(k.key, k.value);
        entity.model = e.model.valid() ? static_cast<std::int32_t>(e.model.value) : -1;
        entity.source_id = e.id, entity.source_line = e.line;
        entity.source_file = e.file;
        out.entities.push_back(std::move(entity));
    }
    return out;
}

std::string name_beside(const std::string& map, const std::string& file) {
    const std::filesystem::path path = std::filesystem::path(file).lexically_normal(), directory = std::filesystem::path(map).parent_path().lexically_normal();
    const std::filesystem::path beside = path.lexically_relative(directory.empty() ? "." : directory);
    return (beside.empty() ? path.filename() : beside).generic_string();
}

Bytes pack(const PackInput& input, const level::WriteOptions& options, Context& context) {
    context.check_cancelled();
    try {
        return level::write_level(level_content(input, context), options);
    } catch (const std::invalid_argument& e) { // our own tables contradict each other
        throw InternalError(std::string("pack: ") + e.what());
    }
}

} // namespace kiln

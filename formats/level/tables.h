// SPDX-License-Identifier: MIT
// The tables of the file as the run time sees them, each with its columns stated once for writer and reader
// (`io`) and its invariants as code (`check`, which throws Damaged). Private to this folder; FORMAT.md in words.
#pragma once
#include "formats/level/kiln_level.h"
#include "formats/level/wire.h"
#include <climits>
#include <cmath>

namespace kiln::level {

constexpr std::uint32_t fourcc(const char (&s)[5]) {
    return static_cast<std::uint32_t>(static_cast<unsigned char>(s[0])) |
           static_cast<std::uint32_t>(static_cast<unsigned char>(s[1])) << 8 |
           static_cast<std::uint32_t>(static_cast<unsigned char>(s[2])) << 16 |
           static_cast<std::uint32_t>(static_cast<unsigned char>(s[3])) << 24;
}

// ---- Frame of the file

constexpr std::uint32_t kMagic = fourcc("KILN");
constexpr std::size_t kHeaderSize = 32, kEntrySize = 48, kAlignment = 16;
constexpr std::uint64_t kMaxRawSize = std::uint64_t{1} << 31; // of one lump
// zstd cannot shrink more than a 128 KiB block to 3 bytes and some; a lump that claims more is a lie.
constexpr std::uint64_t kMaxRatio = 48 * 1024;
constexpr std::uint32_t kMaxPageEdge = 16384;

struct Entry {
    std::uint32_t id = 0, index = 0;
    std::uint32_t version = 1, codec = 0;
    std::uint64_t offset = 0, stored_size = 0, raw_size = 0, checksum = 0;
};

inline void require(bool condition, const char* what) {
    if (!condition) throw Damaged(what);
}
inline void require_index(std::uint32_t i, std::uint32_t count, const char* what) { require(i < count, what); }
inline void require_optional(std::uint32_t i, std::uint32_t count, const char* what) {
    require(i == KILN_NO_INDEX || i < count, what);
}

// Fills `first` members from `count` members; the sum.
template <class Row>
std::size_t prefix(std::vector<Row>& rows, std::uint32_t Row::*first, std::uint32_t Row::*count) {
    std::uint64_t sum = 0;
    for (Row& row : rows) {
        require(sum <= UINT32_MAX, "more list entries than an index can name");
        row.*first = static_cast<std::uint32_t>(sum);
        sum += row.*count;
    }
    require(sum <= UINT32_MAX, "more list entries than an index can name");
    return sum;
}

// ---- HEAD: counts and choices that other lumps are checked against

struct Head {
    kiln_info info{};
    template <class Io> void io(Io& io) {
        kiln_info& i = info;
        for (std::uint32_t* v : {&i.rnm_encoding, &i.position_grid_bits, &i.plane_grid_bits, &i.stripped, &i.planes,
                                 &i.nodes, &i.leaves, &i.clusters, &i.portals, &i.brushes, &i.materials, &i.models,
                                 &i.vertices, &i.triangles, &i.faces, &i.charts, &i.pages, &i.lights, &i.cubes,
                                 &i.cube_cells, &i.probes, &i.entities, &i.degenerate_triangles})
            io.scalar(*v);
        io.scalar(i.texels);
    }
    void check() const {
        require(info.rnm_encoding <= KILN_RNM_TILTED, "unknown directional encoding");
        require(info.position_grid_bits <= 24 && info.plane_grid_bits <= 62, "impossible grid");
    }
};

// ---- Geometry

struct Planes {
    std::vector<kiln_plane> rows;
    template <class Io> void io(Io& io, const kiln_info& info, bool reading) {
        std::uint8_t paired = reading ? 0 : is_paired(rows) ? 1 : 0; // only even planes are written
        std::uint8_t exact = info.stripped ? 0 : 1;
        io.scalar(paired), io.scalar(exact);
        require(!paired || info.planes % 2 == 0, "odd number of paired planes");
        const std::size_t n = paired ? info.planes / 2 : info.planes;
        std::vector<kiln_plane> half;
        if (!reading && paired)
            for (std::size_t i = 0; i < rows.size(); i += 2) half.push_back(rows[i]);
        std::vector<kiln_plane>& stored = paired ? half : rows;
        using P = kiln_plane;
        io.rows(stored, n, &P::normal, &P::distance);
        if (exact) io.rows(stored, n, &P::exact_normal, &P::exact_d_high, &P::exact_d_low);
        if (reading && paired) {
            rows.reserve(info.planes);
            for (const P& p : half) rows.push_back(p), rows.push_back(flip(p));
        }
    }
    static kiln_plane flip(const kiln_plane& p) {
        kiln_plane f{};
        for (int i = 0; i < 3; ++i) f.normal[i] = 0.0 - p.normal[i], f.exact_normal[i] = negate(p.exact_normal[i]);
        f.distance = 0.0 - p.distance;
        f.exact_d_low = 0 - p.exact_d_low;
        f.exact_d_high = static_cast<std::int64_t>(~static_cast<std::uint64_t>(p.exact_d_high) +
                                                   (p.exact_d_low == 0 ? 1 : 0));
        return f;
    }
    static std::int64_t negate(std::int64_t v) {
        return static_cast<std::int64_t>(0 - static_cast<std::uint64_t>(v));
    }
    static bool is_paired(const std::vector<kiln_plane>& rows) {
        if (rows.size() % 2) return false;
        for (std::size_t i = 0; i < rows.size(); i += 2) {
            const kiln_plane f = flip(rows[i]), &g = rows[i + 1];
            bool same = f.distance == g.distance && f.exact_d_high == g.exact_d_high && f.exact_d_low == g.exact_d_low;
            for (int k = 0; k < 3; ++k)
                same = same && f.normal[k] == g.normal[k] && f.exact_normal[k] == g.exact_normal[k];
            if (!same) return false;
        }
        return true;
    }
};

struct Nodes {
    std::vector<kiln_node> rows;
    template <class Io> void io(Io& io, const kiln_info& info, bool) {
        using N = kiln_node;
        io.rows(rows, info.nodes, &N::plane, &N::child, &N::lo, &N::hi);
    }
    void check(const kiln_info& info) const {
        for (const kiln_node& n : rows) {
            require_index(n.plane, info.planes, "a node names a plane that is not there");
            for (const std::int32_t c : n.child)
                require(c >= 0 ? static_cast<std::uint32_t>(c) < info.nodes
                               : static_cast<std::uint32_t>(-(c + 1)) < info.leaves,
                        "a node names a child that is not there");
        }
    }
};

struct Leaves {
    std::vector<kiln_leaf> rows;
    std::vector<std::uint32_t> brushes, faces;
    template <class Io> void io(Io& io, const kiln_info& info, bool) {
        using L = kiln_leaf;
        io.rows(rows, info.leaves, &L::contents, &L::cluster, &L::area, &L::probe, &L::lo, &L::hi, &L::brush_count,
                &L::face_count);
        const std::size_t b = prefix(rows, &L::first_brush, &L::brush_count);
        const std::size_t f = prefix(rows, &L::first_face, &L::face_count);
        io.column(brushes, b), io.column(faces, f);
    }
    void check(const kiln_info& info) const {
        for (const kiln_leaf& l : rows) {
            require(l.cluster >= -1 && l.cluster < static_cast<std::int64_t>(info.clusters),
                    "a leaf names a cluster that is not there");
            require_optional(l.probe, info.probes, "a leaf names a probe that is not there");
        }
        for (const std::uint32_t b : brushes) require_index(b, info.brushes, "a leaf names a brush that is not there");
        for (const std::uint32_t f : faces) require_index(f, info.faces, "a leaf names a face that is not there");
    }
};

struct Portals {
    struct Point { float xyz[3]; };
    std::vector<kiln_portal> rows;
    std::vector<Point> points;
    template <class Io> void io(Io& io, const kiln_info& info, bool) {
        using P = kiln_portal;
        io.rows(rows, info.portals, &P::leaf, &P::plane, &P::point_count);
        io.rows(points, prefix(rows, &P::first_point, &P::point_count), &Point::xyz);
    }
    void check(const kiln_info& info) const {
        for (const kiln_portal& p : rows) {
            require_index(p.plane, info.planes, "a portal names a plane that is not there");
            for (const std::int32_t l : p.leaf)
                require(l >= 0 && static_cast<std::uint32_t>(l) < info.leaves,
                        "a portal names a leaf that is not there");
        }
    }
};

struct Brushes {
    std::vector<kiln_brush> rows;
    std::vector<std::uint32_t> planes;
    template <class Io> void io(Io& io, const kiln_info& info, bool) {
        using B = kiln_brush;
        io.rows(rows, info.brushes, &B::model, &B::contents, &B::plane_count);
        io.column(planes, prefix(rows, &B::first_plane, &B::plane_count));
    }
    void check(const kiln_info& info) const {
        for (const kiln_brush& b : rows) require_index(b.model, info.models, "a brush names a model that is not there");
        for (const std::uint32_t p : planes) require_index(p, info.planes, "a brush names a plane that is not there");
    }
};

struct Materials {
    std::vector<kiln_material> rows;
    std::vector<std::string> names, albedo_maps, normal_maps;
    template <class Io> void io(Io& io, const kiln_info& info, bool reading) {
        using M = kiln_material;
        io.rows(rows, info.materials, &M::reflectance, &M::emission, &M::alpha, &M::env_map, &M::roughness, &M::flags,
                &M::width, &M::height);
        io.strings(names, info.materials), io.strings(albedo_maps, info.materials);
        io.strings(normal_maps, info.materials);
        if (reading)
            for (std::size_t i = 0; i < rows.size(); ++i)
                rows[i].name = names[i].c_str(), rows[i].albedo_map = albedo_maps[i].c_str(),
                rows[i].normal_map = normal_maps[i].c_str();
    }
    void check(const kiln_info&) const {}
};

struct Faces {
    std::vector<kiln_face> rows;
    template <class Io> void io(Io& io, const kiln_info& info, bool) {
        using F = kiln_face;
        io.rows(rows, info.faces, &F::material, &F::model, &F::plane, &F::chart, &F::probe, &F::triangle_count,
                &F::flags, &F::tangent, &F::bitangent, &F::normal, &F::u_axis, &F::v_axis, &F::u_scale, &F::v_scale,
                &F::u_shift, &F::v_shift);
        require(prefix(rows, &F::first_triangle, &F::triangle_count) == info.triangles,
                "the faces own another number of triangles than there are");
    }
    void check(const kiln_info& info) const {
        for (const kiln_face& f : rows) {
            require_index(f.material, info.materials, "a face names a material that is not there");
            require_index(f.model, info.models, "a face names a model that is not there");
            require_index(f.plane, info.planes, "a face names a plane that is not there");
            require_optional(f.chart, info.charts, "a face names a chart that is not there");
            require_optional(f.probe, info.probes, "a face names a probe that is not there");
        }
    }
};

// ---- Areas, occluders, water; what brushes and faces are besides. Lumps of their own, there only if they say something.

struct Point3 { float xyz[3]; };

struct AreaPortals {
    std::vector<kiln_area_portal> rows;
    std::vector<Point3> points;
    template <class Io> void io(Io& io, const kiln_info&, bool) {
        using P = kiln_area_portal;
        std::uint32_t n = static_cast<std::uint32_t>(rows.size());
        io.scalar(n);
        io.rows(rows, n, &P::entity, &P::brush, &P::area, &P::point_count);
        io.rows(points, prefix(rows, &P::first_point, &P::point_count), &Point3::xyz);
    }
    void check(const kiln_info& info) const {
        for (const kiln_area_portal& p : rows) {
            require(p.entity >= 0 && static_cast<std::uint32_t>(p.entity) < info.entities, "an area portal names an entity that is not there");
            require_index(p.brush, info.brushes, "an area portal names a brush that is not there");
            require(p.area[0] <= p.area[1] && p.area[1] <= info.leaves, "an area portal has impossible areas");
        }
    }
};

struct Occluders {
    std::vector<kiln_occluder> rows;
    std::vector<kiln_occluder_polygon> polygons;
    std::vector<Point3> points;
    template <class Io> void io(Io& io, const kiln_info&, bool) {
        using O = kiln_occluder;
        using P = kiln_occluder_polygon;
        std::uint32_t n = static_cast<std::uint32_t>(rows.size());
        io.scalar(n);
        io.rows(rows, n, &O::entity, &O::area, &O::polygon_count);
        io.rows(polygons, prefix(rows, &O::first_polygon, &O::polygon_count), &P::point_count);
        io.rows(points, prefix(polygons, &P::first_point, &P::point_count), &Point3::xyz);
    }
    void check(const kiln_info& info) const {
        for (const kiln_occluder& o : rows) {
            require(o.entity >= 0 && static_cast<std::uint32_t>(o.entity) < info.entities, "an occluder names an entity that is not there");
            require(o.area <= info.leaves, "an occluder has an impossible area");
        }
        for (const kiln_occluder_polygon& p : polygons) require(p.point_count >= 3, "an occluder's polygon has no area");
    }
};

struct Waters {
    std::vector<kiln_water> rows;
    std::vector<std::uint32_t> of_leaf;
    template <class Io> void io(Io& io, const kiln_info& info, bool) {
        using W = kiln_water;
        std::uint32_t n = static_cast<std::uint32_t>(rows.size());
        io.scalar(n);
        io.rows(rows, n, &W::contents, &W::surface_z, &W::min_z, &W::has_surface, &W::material);
        io.column(of_leaf, info.leaves);
    }
    void check(const kiln_info& info) const {
        for (const kiln_water& w : rows) {
            require(w.has_surface <= 1, "a water volume has an impossible surface");
            require_optional(w.material, info.materials, "a water volume names a material that is not there");
        }
        for (const std::uint32_t w : of_leaf)
            require(w == KILN_NO_INDEX || w < rows.size(), "a leaf names a water volume that is not there");
    }
};

struct WaterDistances {
    std::vector<float> of_leaf;
    template <class Io> void io(Io& io, const kiln_info& info, bool) { io.column(of_leaf, info.leaves); }
    void check(const kiln_info&) const {
        for (const float d : of_leaf) require(d >= 0, "a leaf has an impossible distance to water");
    }
};

struct BrushBlocks {
    std::vector<std::uint8_t> bits;
    template <class Io> void io(Io& io, const kiln_info& info, bool) { io.column(bits, info.brushes); }
};
struct CubeBehind {
    std::vector<std::uint32_t> cells; // per cell: the one behind its wall; KILN_NO_INDEX: itself
    template <class Io> void io(Io& io, const kiln_info& info, bool) { io.column(cells, info.cube_cells); }
    void check(const kiln_info& info) const {
        for (std::size_t k = 0; k < cells.size(); ++k)
            require(cells[k] == KILN_NO_INDEX || (cells[k] > k && cells[k] < info.cube_cells), "a cell names a part behind its wall that is not there");
    }
};
struct FaceShadows {
    std::vector<std::uint8_t> bits; // 1: no dynamic shadows
    template <class Io> void io(Io& io, const kiln_info& info, bool) { io.column(bits, info.faces); }
};

// ---- Curves. These lumps are only there where a level has what they hold; they state their own counts.

struct CurveCorners { // of all triangles of faces with KILN_FACE_CURVED, in order
    std::vector<kiln_curve_corner> rows;
    std::vector<std::uint32_t> first; // per face, from the reader: first corner; KILN_NO_INDEX
    template <class Io> void io(Io& io, const kiln_info&, bool) {
        auto n = static_cast<std::uint32_t>(rows.size());
        io.scalar(n);
        using C = kiln_curve_corner;
        io.rows(rows, n, &C::luxel, &C::uv, &C::alpha);
    }
    void check(const kiln_info&) const {}
};

constexpr std::uint32_t displacement_vertices(std::uint32_t power) { return ((1u << power) + 1) * ((1u << power) + 1); }
constexpr float kMostCoordinate = 1 << 24; // map units: of what can be met by a trace, and of traces
template <std::size_t N> bool is_place(const float (&v)[N]) { // the first three
    return std::fabs(v[0]) <= kMostCoordinate && std::fabs(v[1]) <= kMostCoordinate && std::fabs(v[2]) <= kMostCoordinate;
}

struct Displacements {
    struct Vertex { float xyz_alpha[4]; };
    struct Blend { float weight[4]; };
    std::vector<kiln_displacement> rows;
    std::vector<Vertex> vertices;
    std::vector<Blend> blends;
    std::vector<std::uint16_t> tags;
    template <class Io> void io(Io& io, const kiln_info&, bool) {
        auto n = static_cast<std::uint32_t>(rows.size());
        io.scalar(n);
        using D = kiln_displacement;
        io.rows(rows, n, &D::face, &D::model, &D::material, &D::plane, &D::power, &D::flags, &D::base, &D::vertex_count,
                &D::blend_count, &D::tag_count);
        io.rows(vertices, prefix(rows, &D::first_vertex, &D::vertex_count), &Vertex::xyz_alpha);
        io.rows(blends, prefix(rows, &D::first_blend, &D::blend_count), &Blend::weight);
        io.column(tags, prefix(rows, &D::first_tag, &D::tag_count));
    }
    void check(const kiln_info& info) const {
        for (const kiln_displacement& d : rows) {
            require_optional(d.face, info.faces, "a displacement names a face that is not there");
            require_index(d.model, info.models, "a displacement names a model that is not there");
            require_index(d.material, info.materials, "a displacement names a material that is not there");
            require_index(d.plane, info.planes, "a displacement names a plane that is not there");
            require(d.power >= 2 && d.power <= 4, "impossible power of a displacement");
            require(d.vertex_count == displacement_vertices(d.power), "a displacement has another number of vertices than its power says");
            require(d.blend_count == 0 || d.blend_count == d.vertex_count, "a displacement has another number of weights than of vertices");
            require(d.tag_count == 0 || d.tag_count == 2u << (2 * d.power), "a displacement has another number of tags than of triangles");
        }
        for (const Vertex& v : vertices) require(is_place(v.xyz_alpha), "a displacement has a vertex that is no place");
    }
};

struct CurvedPatches {
    struct Vertex { float xyz_uv[5]; };
    std::vector<kiln_curved_patch> rows;
    std::vector<Vertex> vertices;
    template <class Io> void io(Io& io, const kiln_info&, bool) {
        auto n = static_cast<std::uint32_t>(rows.size());
        io.scalar(n);
        using P = kiln_curved_patch;
        io.rows(rows, n, &P::face, &P::model, &P::material, &P::columns, &P::rows, &P::vertex_count);
        io.rows(vertices, prefix(rows, &P::first_vertex, &P::vertex_count), &Vertex::xyz_uv);
    }
    void check(const kiln_info& info) const {
        for (const kiln_curved_patch& p : rows) {
            require_optional(p.face, info.faces, "a patch names a face that is not there");
            require_index(p.model, info.models, "a patch names a model that is not there");
            require_index(p.material, info.materials, "a patch names a material that is not there");
            require(std::uint64_t{p.columns} * p.rows == p.vertex_count, "a patch has another number of vertices than its size says");
        }
        for (const Vertex& v : vertices) require(is_place(v.xyz_uv), "a patch has a vertex that is no place");
    }
};
struct CurveSources { // provenance
    std::vector<kiln_source> displacements, patches;
    template <class Io> void io(Io& io, const kiln_info&, bool) {
        using S = kiln_source;
        auto d = static_cast<std::uint32_t>(displacements.size()), p = static_cast<std::uint32_t>(patches.size());
        io.scalar(d), io.scalar(p);
        io.rows(displacements, d, &S::entity, &S::brush, &S::side, &S::line);
        io.rows(patches, p, &S::entity, &S::brush, &S::line);
        for (S& s : patches) s.side = -1;
    }
    void check(const kiln_info&) const {}
};

// ---- Lightmaps

struct PageInfo { std::uint32_t width, height, layers, format; float scale; };
inline std::size_t texel_size(std::uint32_t format) { return format == KILN_TEXEL_RGB9E5 ? 4 : 6; }
inline std::uint64_t page_size(const PageInfo& p) {
    return std::uint64_t{p.width} * p.height * p.layers * texel_size(p.format);
}

struct Charts {
    std::vector<kiln_chart> rows;
    std::vector<PageInfo> pages;
    template <class Io> void io(Io& io, const kiln_info& info, bool) {
        using C = kiln_chart;
        using P = PageInfo;
        io.rows(rows, info.charts, &C::origin, &C::s, &C::t, &C::luxel_size, &C::width, &C::height, &C::directional,
                &C::smooth, &C::page, &C::page_x, &C::page_y, &C::tangent, &C::bitangent, &C::normal, &C::error);
        io.rows(pages, info.pages, &P::width, &P::height, &P::layers, &P::format, &P::scale);
    }
    void check(const kiln_info& info) const {
        const std::uint32_t directional_layers = info.rnm_encoding == KILN_RNM_TILTED ? 4 : 3;
        for (const PageInfo& p : pages) {
            require(p.width > 0 && p.height > 0 && p.width <= kMaxPageEdge && p.height <= kMaxPageEdge,
                    "impossible size of an atlas page");
            require(p.layers == 1 || p.layers == directional_layers, "impossible number of layers");
            require(p.format <= KILN_TEXEL_RGB9E5, "unknown texel format");
        }
        for (const kiln_chart& c : rows) {
            require_index(c.page, info.pages, "a chart names a page that is not there");
            const PageInfo& p = pages[c.page];
            require(c.width > 0 && c.height > 0 && c.width <= p.width && c.height <= p.height &&
                        c.page_x <= p.width - c.width && c.page_y <= p.height - c.height,
                    "a chart reaches over its page");
            require(c.directional <= 1 && (c.directional ? directional_layers : 1) == p.layers,
                    "a chart is on a page of another kind");
            require(c.luxel_size > 0, "a chart has no luxel size");
        }
    }
};

// ---- Light in the air

struct Lights {
    std::vector<kiln_light> rows;
    template <class Io> void io(Io& io, const kiln_info& info, bool) {
        using L = kiln_light;
        io.rows(rows, info.lights, &L::kind, &L::falloff, &L::position, &L::direction, &L::intensity, &L::constant_attn,
                &L::linear_attn, &L::quadratic_attn, &L::range, &L::fade_start, &L::fade_end, &L::cos_inner,
                &L::cos_outer, &L::exponent, &L::angular_radius_rad, &L::angle_scale, &L::style);
    }
    void check(const kiln_info&) const {}
};

struct Cubes {
    kiln_cube_tree tree{}; // nodes, node_count: set by the reader
    std::vector<std::int32_t> nodes;
    std::vector<kiln_cube_cell> cells;
    std::vector<kiln_cube> cubes;
    std::vector<std::uint32_t> lights;
    struct Halfs { std::uint16_t v[18]; };
    float scale = 1; // irradiance = half * scale
    std::vector<Halfs> halfs;
    template <class Io> void io(Io& io, const kiln_info& info, bool) {
        for (double& v : tree.origin) io.scalar(v);
        io.scalar(tree.root_size), io.scalar(scale);
        for (std::uint32_t& v : tree.root_count) io.scalar(v);
        std::uint32_t n = static_cast<std::uint32_t>(nodes.size());
        io.scalar(n);
        io.column(nodes, n);
        using C = kiln_cube_cell;
        io.rows(cells, info.cube_cells, &C::lo, &C::size, &C::cubes, &C::mask, &C::plane_normal,
                &C::plane_distance, &C::beyond);
        io.rows(cubes, info.cubes, &kiln_cube::position, &kiln_cube::light_count);
        io.rows(halfs, info.cubes, &Halfs::v);
        io.column(lights, prefix(cubes, &kiln_cube::first_light, &kiln_cube::light_count));
    }
    void check(const kiln_info& info) const {
        const std::uint64_t roots =
            std::uint64_t{tree.root_count[0]} * tree.root_count[1]; // two factors cannot overflow 64 bits
        require(roots <= nodes.size() && roots * tree.root_count[2] <= nodes.size(), "the cube tree has lost its roots");
        for (const std::int32_t v : nodes) {
            if (v == INT32_MIN) continue;
            if (v >= 0)
                require(static_cast<std::uint64_t>(v) + 8 <= nodes.size(), "a cube node names children not there");
            else
                require_index(static_cast<std::uint32_t>(-(v + 1)), info.cube_cells,
                              "a cube node names a cell that is not there");
        }
        for (std::size_t k = 0; k < cells.size(); ++k) {
            const kiln_cube_cell& c = cells[k];
            for (std::size_t i = 0; i < 8; ++i)
                require(c.mask >> i & 1 ? c.cubes[i] < info.cubes : c.cubes[i] == KILN_NO_INDEX,
                        "a cell names a cube that is not there");
            require(c.mask < 256, "a cell has more than eight corners");
            require(c.beyond == KILN_NO_INDEX || (c.beyond > k && c.beyond < info.cube_cells),
                    "a cell names a part of it that is not there");
        }
        for (const std::uint32_t l : lights) require_index(l, info.lights, "a cube names a light that is not there");
    }
};

constexpr std::uint32_t kMaxProbeSize = 4096;
inline std::uint64_t probe_texels(const kiln_probe& p) {
    std::uint64_t sum = 0;
    for (std::uint32_t m = 0; m < p.mips; ++m) sum += 6ull * (p.size >> m) * (p.size >> m);
    return sum;
}
struct ProbeTable {
    std::vector<kiln_probe> rows;
    std::vector<float> scales;
    template <class Io> void io(Io& io, const kiln_info& info, bool) {
        using P = kiln_probe;
        io.rows(rows, info.probes, &P::position, &P::entity, &P::size, &P::mips, &P::boxed, &P::box_lo, &P::box_hi);
        io.column(scales, info.probes);
    }
    void check(const kiln_info&) const {
        for (const kiln_probe& p : rows)
            require(p.size > 0 && p.size <= kMaxProbeSize && p.mips > 0 && p.mips <= 13 && (p.size >> (p.mips - 1)) > 0,
                    "impossible size of a cubemap");
    }
};

// ---- Collision

// Kept apart from the brushes' own planes: readers that know of none still read those.
struct Bevels {
    struct Range { std::uint32_t first, count; };
    std::vector<Range> rows; // per brush
    std::vector<kiln_bevel> bevels;
    template <class Io> void io(Io& io, const kiln_info& info, bool) {
        io.rows(rows, info.brushes, &Range::count);
        io.rows(bevels, prefix(rows, &Range::first, &Range::count), &kiln_bevel::normal, &kiln_bevel::distance);
    }
    void check(const kiln_info&) const {
        for (const kiln_bevel& b : bevels) {
            const double square = b.normal[0] * b.normal[0] + b.normal[1] * b.normal[1] + b.normal[2] * b.normal[2];
            require(square > 0.999 && square < 1.001 && b.distance > -1e300 && b.distance < 1e300, "a bevel is no plane");
        }
    }
};

// ---- Overlays and decals

struct Overlays {
    std::vector<kiln_overlay> rows;
    std::vector<kiln_overlay_fragment> fragments;
    std::vector<kiln_overlay_point> points;
    template <class Io> void io(Io& io, const kiln_info&, bool) {
        using O = kiln_overlay;
        std::uint32_t n = static_cast<std::uint32_t>(rows.size());
        io.scalar(n);
        io.rows(rows, n, &O::kind, &O::material, &O::entity, &O::render_order, &O::fade_min, &O::fade_max, &O::fragment_count);
        using F = kiln_overlay_fragment;
        io.rows(fragments, prefix(rows, &O::first_fragment, &O::fragment_count), &F::face, &F::point_count);
        using P = kiln_overlay_point;
        io.rows(points, prefix(fragments, &F::first_point, &F::point_count), &P::position, &P::uv);
    }
    void check(const kiln_info& info) const {
        for (const kiln_overlay& o : rows) {
            require_index(o.material, info.materials, "an overlay names a material that is not there");
            require(o.entity >= -1 && o.entity < static_cast<std::int64_t>(info.entities), "an overlay names an entity that is not there");
        }
        for (const kiln_overlay_fragment& f : fragments) {
            require_index(f.face, info.faces, "a part of an overlay names a face that is not there");
            require(f.point_count >= 3, "a part of an overlay has less than three corners");
        }
    }
};

// ---- Entities, provenance

struct EntityRow { std::uint32_t first_key, key_count; std::int32_t model; };
struct Entities {
    std::vector<EntityRow> rows;
    std::vector<std::string> keys, values;
    template <class Io> void io(Io& io, const kiln_info& info, bool) {
        io.rows(rows, info.entities, &EntityRow::key_count, &EntityRow::model);
        const std::size_t n = prefix(rows, &EntityRow::first_key, &EntityRow::key_count);
        io.strings(keys, n), io.strings(values, n);
    }
    void check(const kiln_info& info) const {
        for (const EntityRow& e : rows)
            require(e.model >= -1 && e.model < static_cast<std::int64_t>(info.models),
                    "an entity names a model that is not there");
    }
};

struct Provenance {
    std::vector<kiln_source> faces, brushes, entities, lights;
    std::vector<std::int32_t> brush_sides; // parallel to Brushes::planes
    template <class Io> void io(Io& io, const kiln_info& info, bool) {
        using S = kiln_source;
        io.rows(faces, info.faces, &S::entity, &S::brush, &S::side, &S::line);
        io.rows(brushes, info.brushes, &S::entity, &S::brush, &S::line);
        io.rows(entities, info.entities, &S::entity, &S::line);
        io.rows(lights, info.lights, &S::entity, &S::line);
        std::uint32_t n = static_cast<std::uint32_t>(brush_sides.size());
        io.scalar(n);
        io.column(brush_sides, n);
        for (S& s : brushes) s.side = -1;
        for (S& s : entities) s.brush = s.side = -1;
        for (S& s : lights) s.brush = s.side = -1;
    }
    void check(const kiln_info&) const {}
};

struct SourceFiles { // of Provenance and CurveSources; 0: the map, else names[i - 1]
    std::vector<std::string> names;
    std::vector<std::uint32_t> faces, brushes, entities, lights, displacements, patches;
    template <class Io> void io(Io& io, const kiln_info& info, bool) {
        auto n = static_cast<std::uint32_t>(names.size()), d = static_cast<std::uint32_t>(displacements.size()), p = static_cast<std::uint32_t>(patches.size());
        io.scalar(n), io.scalar(d), io.scalar(p);
        io.strings(names, n);
        io.column(faces, info.faces), io.column(brushes, info.brushes), io.column(entities, info.entities), io.column(lights, info.lights);
        io.column(displacements, d), io.column(patches, p);
    }
    void check(const kiln_info&) const {
        for (const auto* list : {&faces, &brushes, &entities, &lights, &displacements, &patches})
            for (const std::uint32_t f : *list) require(f <= names.size(), "something is of a file that is not named");
    }
};

} // namespace kiln::level

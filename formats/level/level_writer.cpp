// SPDX-License-Identifier: MIT
// LevelContent to the run-time tables, the tables to lumps, the lumps to one file.
#include "formats/level/level_writer.h"
#include "formats/level/lightmap_codec.h"
#include "formats/level/lightmap_pages.h"
#include "formats/level/mesh_codec.h"
#include "formats/level/numbers.h"
#include "formats/level/tables.h"
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <xxhash.h>
#include <zstd.h>

namespace kiln::level {
namespace {

// ---- File frame

struct ContextFree {
    void operator()(ZSTD_CCtx* c) const { ZSTD_freeCCtx(c); }
};

class LumpFile {
public:
    explicit LumpFile(const WriteOptions& options) : zstd_(ZSTD_createCCtx()), options_(options) {
        if (!zstd_) throw std::bad_alloc();
        ZSTD_CCtx_setParameter(zstd_.get(), ZSTD_c_compressionLevel, options.zstd_level);
        ZSTD_CCtx_setParameter(zstd_.get(), ZSTD_c_contentSizeFlag, 1);
    }
    Blob compress(std::span<const std::uint8_t> raw) {
        if (!options_.known) return pack(raw);
        const std::uint64_t how = ZSTD_versionNumber() * 256u + static_cast<std::uint64_t>(options_.zstd_level + 128);
        return options_.known(XXH3_64bits_withSeed(raw.data(), raw.size(), how) + raw.size(), [&] { return pack(raw); });
    }
    Blob pack(std::span<const std::uint8_t> raw) {
        Blob out(ZSTD_compressBound(raw.size()));
        const std::size_t size = ZSTD_compress2(zstd_.get(), out.data(), out.size(), raw.data(), raw.size());
        if (ZSTD_isError(size)) throw std::runtime_error(std::string("zstd: ") + ZSTD_getErrorName(size));
        out.resize(size);
        return out;
    }
    void add(const char (&id)[5], Blob raw, std::uint32_t index = 0, bool pack = true) {
        if (raw.size() > kMaxRawSize) throw std::invalid_argument(std::string(id) + " is over 2 GiB");
        Entry e;
        e.id = fourcc(id), e.index = index, e.raw_size = raw.size();
        Blob packed = pack ? compress(raw) : Blob();
        const bool smaller = pack && packed.size() < raw.size();
        e.codec = smaller ? KILN_CODEC_ZSTD : KILN_CODEC_NONE;
        lumps_.push_back(smaller ? std::move(packed) : std::move(raw));
        e.stored_size = lumps_.back().size();
        e.checksum = XXH3_64bits(lumps_.back().data(), lumps_.back().size());
        entries_.push_back(e);
    }
    Blob finish() {
        std::uint64_t at = aligned(kHeaderSize + entries_.size() * kEntrySize);
        for (Entry& e : entries_) e.offset = at, at = aligned(at + e.stored_size);
        Put directory;
        for (const Entry& e : entries_) {
            directory.value(e.id), directory.value(e.index);
            directory.value(static_cast<std::uint16_t>(e.version)), directory.value(static_cast<std::uint16_t>(e.codec));
            directory.value(std::uint32_t{0});
            directory.value(e.offset), directory.value(e.stored_size), directory.value(e.raw_size);
            directory.value(e.checksum);
        }
        Put file;
        file.value(kMagic), file.value(std::uint32_t{KILN_FORMAT_VERSION});
        file.value(static_cast<std::uint32_t>(entries_.size())), file.value(std::uint32_t{0});
        file.value(at);
        XXH3_state_t* state = XXH3_createState();
        if (!state) throw std::bad_alloc();
        XXH3_64bits_reset(state);
        XXH3_64bits_update(state, file.bytes.data(), file.bytes.size());
        XXH3_64bits_update(state, directory.bytes.data(), directory.bytes.size());
        file.value(static_cast<std::uint64_t>(XXH3_64bits_digest(state)));
        XXH3_freeState(state);
        file.raw(directory.bytes);
        for (std::size_t i = 0; i < entries_.size(); ++i) {
            file.bytes.resize(entries_[i].offset);
            file.raw(lumps_[i]);
        }
        file.bytes.resize(at);
        return std::move(file.bytes);
    }

private:
    std::unique_ptr<ZSTD_CCtx, ContextFree> zstd_;
    const WriteOptions& options_;
    std::vector<Entry> entries_;
    std::vector<Blob> lumps_;
    static std::uint64_t aligned(std::uint64_t n) { return (n + kAlignment - 1) / kAlignment * kAlignment; }
};

// ---- META

// A JSON string. Bytes that are no UTF-8 (map files have them) are taken as Latin-1.
std::string json_text(const std::string& text) {
    std::string out = "\"";
    const auto continues = [&](std::size_t i) { return i < text.size() && (text[i] & 0xC0) == 0x80; };
    for (std::size_t i = 0; i < text.size(); ++i) {
        const auto c = static_cast<unsigned char>(text[i]);
        if (c == '"' || c == '\\') {
            out += '\\', out += text[i];
        } else if (c < 0x20 || c == 0x7f) {
            constexpr const char* hex = "0123456789abcdef";
            out += "\\u00", out += hex[c >> 4], out += hex[c & 15];
        } else if (c < 0x80) {
            out += text[i];
        } else {
            const std::size_t length = c >= 0xC2 && c < 0xE0 ? 2 : c >= 0xE0 && c < 0xF0 ? 3 : c >= 0xF0 && c < 0xF5 ? 4 : 0;
            bool good = length > 0;
            for (std::size_t k = 1; k < length; ++k) good = good && continues(i + k);
            if (good) {
                out.append(text, i, length), i += length - 1;
            } else {
                out += static_cast<char>(0xC0 | c >> 6), out += static_cast<char>(0x80 | (c & 0x3F));
            }
        }
    }
    return out + '"';
}

Blob meta(const LevelContent& c, const WriteOptions& options) {
    std::string text = "{\"format\":" + std::to_string(KILN_FORMAT_VERSION);
    text += ",\"compiler\":" + json_text(c.compiler_version);
    text += ",\"source\":" + json_text(options.strip ? "" : c.source_name);
    text += ",\"input_hash\":" + json_text(c.input_hash);
    text += ",\"options\":" + (c.options_json.empty() ? "{}" : c.options_json);
    text += ",\"error\":" + (c.error_json.empty() ? "{}" : c.error_json) + "}";
    return Blob(text.begin(), text.end());
}

// ---- Content to tables

template <class T, std::size_t N> void copy(T (&to)[N], const std::array<T, N>& from) {
    std::copy(from.begin(), from.end(), to);
}
template <std::size_t N> void copy_tidy(double (&to)[N], const std::array<double, N>& from) {
    for (std::size_t i = 0; i < N; ++i) to[i] = from[i] + 0.0; // no negative zeros
}
std::uint32_t count(std::size_t n) {
    if (n >= UINT32_MAX) throw std::invalid_argument("more than 2^32 rows in a table");
    return static_cast<std::uint32_t>(n);
}

Planes planes_of(const LevelContent& content) {
    Planes out;
    for (const Plane& p : content.planes) {
        kiln_plane k{};
        copy_tidy(k.normal, p.normal), copy(k.exact_normal, p.exact);
        k.distance = p.distance + 0.0, k.exact_d_high = p.exact_d_high, k.exact_d_low = p.exact_d_low;
        out.rows.push_back(k);
    }
    return out;
}
Nodes nodes_of(const LevelContent& content) {
    Nodes out;
    for (const Node& n : content.nodes) {
        kiln_node k{};
        k.plane = n.plane;
        copy(k.child, n.child), copy(k.lo, n.lo), copy(k.hi, n.hi);
        out.rows.push_back(k);
    }
    return out;
}
Leaves leaves_of(const LevelContent& content) {
    Leaves out;
    for (const Leaf& l : content.leaves) {
        kiln_leaf k{};
        k.contents = l.contents, k.cluster = l.cluster, k.area = l.area, k.probe = l.probe;
        copy(k.lo, l.lo), copy(k.hi, l.hi);
        k.brush_count = count(l.brushes.size()), k.face_count = count(l.faces.size());
        out.brushes.insert(out.brushes.end(), l.brushes.begin(), l.brushes.end());
        out.faces.insert(out.faces.end(), l.faces.begin(), l.faces.end());
        out.rows.push_back(k);
    }
    return out;
}
Portals portals_of(const LevelContent& content) {
    Portals out;
    for (const Portal& p : content.portals) {
        kiln_portal k{};
        copy(k.leaf, p.leaf);
        k.plane = p.plane, k.point_count = count(p.winding.size());
        for (const Float3& x : p.winding) out.points.push_back({{x[0], x[1], x[2]}});
        out.rows.push_back(k);
    }
    return out;
}
Brushes brushes_of(const LevelContent& content) {
    Brushes out;
    for (const Brush& b : content.brushes) {
        kiln_brush k{};
        k.model = b.model, k.contents = b.contents, k.plane_count = count(b.planes.size());
        out.planes.insert(out.planes.end(), b.planes.begin(), b.planes.end());
        out.rows.push_back(k);
    }
    return out;
}
Bevels bevels_of(const LevelContent& content) {
    Bevels out;
    for (const Brush& b : content.brushes) {
        out.rows.push_back({count(out.bevels.size()), count(b.bevels.size())});
        for (const Bevel& from : b.bevels) {
            kiln_bevel k{};
            copy_tidy(k.normal, from.normal), k.distance = from.distance + 0.0;
            out.bevels.push_back(k);
        }
    }
    return out;
}
Materials materials_of(const LevelContent& content) {
    Materials out;
    for (const MaterialInfo& m : content.materials) {
        kiln_material k{};
        copy(k.reflectance, m.reflectance), copy(k.emission, m.emission);
        k.alpha = m.alpha, k.env_map = m.env_map, k.roughness = m.roughness;
        k.flags = m.flags, k.width = m.width, k.height = m.height;
        out.rows.push_back(k);
        out.names.push_back(m.name), out.albedo_maps.push_back(m.albedo_map), out.normal_maps.push_back(m.normal_map);
    }
    return out;
}
Lights lights_of(const LevelContent& content) {
    Lights out;
    for (const LocalLight& l : content.lights) {
        kiln_light k{};
        k.kind = l.kind, k.falloff = l.falloff, k.style = l.style;
        copy(k.position, l.position), copy(k.direction, l.direction), copy(k.intensity, l.intensity);
        k.constant_attn = l.constant, k.linear_attn = l.linear, k.quadratic_attn = l.quadratic;
        k.range = l.range, k.fade_start = l.fade_start, k.fade_end = l.fade_end;
        k.cos_inner = l.cos_inner, k.cos_outer = l.cos_outer, k.exponent = l.exponent;
        k.angular_radius_rad = l.angular_radius_rad, k.angle_scale = l.angle_scale;
        out.rows.push_back(k);
    }
    return out;
}
Cubes cubes_of(const LevelContent& content) {
    const CubeGrid& grid = content.cubes;
    Cubes out;
    copy(out.tree.origin, grid.origin), copy(out.tree.root_count, grid.root_count);
    out.tree.root_size = grid.root_size;
    out.nodes = grid.tree;
    for (const CubeCell& c : grid.cells) {
        kiln_cube_cell k{};
        copy(k.lo, c.lo), copy(k.cubes, c.cubes), copy(k.plane_normal, c.plane_normal);
        k.size = c.size, k.mask = c.mask, k.plane_distance = c.plane_distance, k.beyond = c.beyond;
        out.cells.push_back(k);
    }
    float largest = 0;
    for (const Cube& c : grid.cubes)
        for (const Float3& e : c.irradiance)
            for (const float v : e)
                if (std::abs(v) <= 3e38f) largest = std::max(largest, std::abs(v));
    while (largest / out.scale > 60000.0f) out.scale *= 2;
    for (const Cube& c : grid.cubes) {
        kiln_cube k{};
        copy(k.position, c.position);
        k.light_count = count(c.local_lights.size());
        out.lights.insert(out.lights.end(), c.local_lights.begin(), c.local_lights.end());
        Cubes::Halfs h{};
        for (std::size_t i = 0; i < 18; ++i) h.v[i] = half_from_float(c.irradiance[i / 3][i % 3] / out.scale);
        out.cubes.push_back(k), out.halfs.push_back(h);
    }
    return out;
}
Entities entities_of(const LevelContent& content) {
    Entities out;
    for (const EntityInfo& e : content.entities) {
        out.rows.push_back({0, count(e.keys.size()), e.model});
        for (const auto& [key, value] : e.keys) out.keys.push_back(key), out.values.push_back(value);
    }
    return out;
}
Overlays overlays_of(const LevelContent& content) {
    Overlays out;
    for (const OverlayInfo& o : content.overlays) {
        kiln_overlay k{};
        k.kind = o.kind, k.material = o.material, k.entity = o.entity, k.render_order = o.render_order;
        k.fade_min = o.fade_min, k.fade_max = o.fade_max;
        k.fragment_count = static_cast<std::uint32_t>(o.pieces.size());
        out.rows.push_back(k);
        for (const OverlayPiece& p : o.pieces) {
            if (p.uv.size() != p.points.size()) throw std::invalid_argument("a part of an overlay has another number of texture coordinates than corners");
            out.fragments.push_back({p.face, 0, static_cast<std::uint32_t>(p.points.size())});
            for (std::size_t i = 0; i < p.points.size(); ++i) {
                kiln_overlay_point point{};
                copy(point.position, p.points[i]), copy(point.uv, p.uv[i]);
                out.points.push_back(point);
            }
        }
    }
    return out;
}

Provenance provenance_of(const LevelContent& content) {
    Provenance out;
    for (const FaceInfo& f : content.faces)
        out.faces.push_back({f.source_entity, f.source_brush, f.source_side, f.source_line});
    for (const Brush& b : content.brushes) {
        out.brushes.push_back({b.source_entity, b.source_id, -1, b.source_line});
        for (std::size_t i = 0; i < b.planes.size(); ++i)
            out.brush_sides.push_back(i < b.source_sides.size() ? b.source_sides[i] : -1);
    }
    for (const EntityInfo& e : content.entities) out.entities.push_back({e.source_id, -1, -1, e.source_line});
    for (const LocalLight& l : content.lights) out.lights.push_back({l.entity, -1, -1, l.line});
    return out;
}

SourceFiles source_files_of(const LevelContent& content) {
    SourceFiles out;
    out.names = content.source_files;
    for (const FaceInfo& f : content.faces) out.faces.push_back(f.source_file);
    for (const Brush& b : content.brushes) out.brushes.push_back(b.source_file);
    for (const EntityInfo& e : content.entities) out.entities.push_back(e.source_file);
    for (const LocalLight& l : content.lights) out.lights.push_back(l.source_file);
    for (const Displacement& d : content.displacements) out.displacements.push_back(d.source_file);
    for (const CurvedPatch& p : content.patches) out.patches.push_back(p.source_file);
    return out;
}

// ---- Areas, occluders, water, bits

template <class Row> std::uint32_t add_points(std::vector<Row>& points, const std::vector<Float3>& polygon) {
    for (const Float3& p : polygon) points.push_back({{p[0], p[1], p[2]}});
    return count(polygon.size());
}
AreaPortals area_portals_of(const LevelContent& content) {
    AreaPortals out;
    for (const AreaPortalInfo& p : content.area_portals) {
        kiln_area_portal k{};
        k.entity = p.entity, k.brush = p.brush;
        copy(k.area, p.area);
        k.point_count = add_points(out.points, p.polygon);
        out.rows.push_back(k);
    }
    return out;
}
Occluders occluders_of(const LevelContent& content) {
    Occluders out;
    for (const OccluderInfo& o : content.occluders) {
        out.rows.push_back({o.entity, o.area, 0, count(o.polygons.size())});
        for (const auto& polygon : o.polygons) out.polygons.push_back({0, add_points(out.points, polygon)});
    }
    return out;
}
Waters waters_of(const LevelContent& content) {
    Waters out;
    for (const WaterInfo& w : content.waters) out.rows.push_back({w.contents, w.surface_z, w.min_z, w.has_surface, w.material});
    out.of_leaf = content.leaf_water;
    return out;
}

// ---- Displacements, patches

Displacements displacements_of(const LevelContent& content) {
    Displacements out;
    for (const Displacement& d : content.displacements) {
        if (d.alphas.size() != d.positions.size()) throw std::invalid_argument("a displacement has no alpha for each vertex");
        kiln_displacement k{};
        k.face = d.face, k.model = d.model, k.material = d.material, k.plane = d.plane, k.power = d.power, k.flags = d.flags;
        for (std::size_t i = 0; i < 12; ++i) k.base[i] = d.base[i / 3][i % 3] + 0.0;
        k.vertex_count = count(d.positions.size()), k.blend_count = count(d.multiblend.size()), k.tag_count = count(d.triangle_tags.size());
        for (std::size_t i = 0; i < d.positions.size(); ++i)
            out.vertices.push_back({{d.positions[i][0], d.positions[i][1], d.positions[i][2], d.alphas[i]}});
        for (const auto& b : d.multiblend) out.blends.push_back({{b[0], b[1], b[2], b[3]}});
        out.tags.insert(out.tags.end(), d.triangle_tags.begin(), d.triangle_tags.end());
        out.rows.push_back(k);
    }
    return out;
}
CurvedPatches curved_patches_of(const LevelContent& content) {
    CurvedPatches out;
    for (const CurvedPatch& p : content.patches) {
        if (p.uv.size() != p.positions.size()) throw std::invalid_argument("a patch has no texture coordinates for each vertex");
        kiln_curved_patch k{};
        k.face = p.face, k.model = p.model, k.material = p.material, k.columns = p.columns, k.rows = p.rows;
        k.vertex_count = count(p.positions.size());
        for (std::size_t i = 0; i < p.positions.size(); ++i)
            out.vertices.push_back({{p.positions[i][0], p.positions[i][1], p.positions[i][2], p.uv[i][0], p.uv[i][1]}});
        out.rows.push_back(k);
    }
    return out;
}
CurveSources curve_sources_of(const LevelContent& content) {
    CurveSources out;
    for (const Displacement& d : content.displacements) out.displacements.push_back({d.source_entity, d.source_brush, d.source_side, d.source_line});
    for (const CurvedPatch& p : content.patches) out.patches.push_back({p.source_entity, p.source_patch, -1, p.source_line});
    return out;
}

// ---- Mesh

// The finest grid allowed, or the coarsest on which every position already lies: fewer bits, fewer bytes.
std::uint32_t grid_bits_of(const LevelContent& content, int finest) {
    double largest = 1;
    for (const Double3& p : content.positions)
        for (const double v : p) {
            if (!(std::abs(v) < 1e9)) throw std::invalid_argument("a position is out of bounds");
            largest = std::max(largest, std::abs(v));
        }
    finest = std::clamp(finest, 0, 16);
    while (finest > 0 && std::ldexp(largest, finest) >= 1 << 28) --finest; // Draco predicts in 32 bits
    const auto exact_at = [&](int bits) {
        for (const Double3& p : content.positions)
            for (const double v : p)
                if (std::ldexp(v, bits) != std::nearbyint(std::ldexp(v, bits))) return false;
        return true;
    };
    for (int bits = 0; bits < finest; ++bits)
        if (exact_at(bits)) return static_cast<std::uint32_t>(bits);
    return static_cast<std::uint32_t>(finest);
}

struct MeshTables {
    GridMesh mesh;
    std::uint32_t degenerate = 0;
    Faces faces;
    Put normals; // NRML
    CurveCorners corners;
};

MeshTables mesh_of(const LevelContent& content, std::uint32_t bits) {
    MeshTables out;
    if (content.corner_normals.size() != content.triangles.size())
        throw std::invalid_argument("corner normals are not per triangle");
    std::vector<std::array<std::int32_t, 3>> grid;
    for (const Double3& p : content.positions) {
        std::array<std::int32_t, 3> g{};
        for (std::size_t k = 0; k < 3; ++k)
            g[k] = static_cast<std::int32_t>(std::llround(std::ldexp(p[k], static_cast<int>(bits))));
        grid.push_back(g);
    }
    std::map<std::array<std::int32_t, 3>, std::uint32_t> number; // vertices weld where the grid makes them one
    std::vector<std::uint8_t> smooth;                            // per face: normals are stored
    std::vector<std::array<std::int16_t, 2>> octs;
    std::size_t next = 0, next_curved = 0;
    for (std::size_t f = 0; f < content.faces.size(); ++f) {
        const FaceInfo& face = content.faces[f];
        if (face.triangle_count && face.first_triangle != next)
            throw std::invalid_argument("face " + std::to_string(f) + " does not follow the triangles of the one before");
        next += face.triangle_count;
        if (next > content.triangles.size()) throw std::invalid_argument("faces own more triangles than there are");
        kiln_face k{};
        k.material = face.material, k.model = face.model, k.plane = face.plane, k.chart = face.chart;
        k.probe = face.probe;
        for (const auto& [set, flag] : {std::pair{face.drawn, KILN_FACE_DRAWN}, {face.sky, KILN_FACE_SKY},
                                        {face.two_sided, KILN_FACE_TWO_SIDED}, {face.blocks_light, KILN_FACE_BLOCKS_LIGHT},
                                        {face.curved, KILN_FACE_CURVED}})
            if (set) k.flags |= static_cast<std::uint32_t>(flag);
        copy(k.tangent, face.tangent), copy(k.bitangent, face.bitangent), copy(k.normal, face.normal);
        copy(k.u_axis, face.u_axis), copy(k.v_axis, face.v_axis);
        k.u_scale = face.u_scale, k.v_scale = face.v_scale, k.u_shift = face.u_shift, k.v_shift = face.v_shift;
        const auto flat = oct_from_normal(face.normal);
        const std::size_t first_oct = octs.size();
        bool is_smooth = false;
        for (std::size_t t = next - face.triangle_count; t < next; ++t) {
            const auto& from = content.triangles[t];
            const std::array<CurveCorner, 3>* corners = nullptr;
            if (face.curved) {
                if (next_curved >= content.curve_corners.size()) throw std::invalid_argument("a curved triangle has no corners");
                corners = &content.curve_corners[next_curved++];
            }
            for (const std::uint32_t v : from)
                if (v >= grid.size()) throw std::invalid_argument("a triangle names a vertex that is not there");
            if (grid[from[0]] == grid[from[1]] || grid[from[1]] == grid[from[2]] || grid[from[2]] == grid[from[0]]) {
                ++out.degenerate; // an edge became a point: without area, and its neighbours close over it
                continue;
            }
            std::array<std::uint32_t, 3> to{};
            for (std::size_t c = 0; c < 3; ++c) {
                const auto [it, fresh] = number.try_emplace(grid[from[c]], count(out.mesh.positions.size()));
                if (fresh) out.mesh.positions.push_back(grid[from[c]]);
                to[c] = it->second;
                octs.push_back(oct_from_normal(content.corner_normals[t][c]));
                is_smooth = is_smooth || octs.back() != flat;
            }
            if (corners)
                for (const CurveCorner& c : *corners)
                    out.corners.rows.push_back({{c.luxel[0], c.luxel[1]}, {c.uv[0], c.uv[1]}, c.alpha});
            out.mesh.triangles.push_back(to);
            ++k.triangle_count;
        }
        if (!is_smooth) octs.resize(first_oct);
        smooth.push_back(is_smooth);
        out.faces.rows.push_back(k);
    }
    if (next != content.triangles.size()) throw std::invalid_argument("triangles that no face owns");
    if (next_curved != content.curve_corners.size()) throw std::invalid_argument("corners that no curved face owns");
    out.normals.column(smooth, smooth.size());
    for (std::size_t k = 0; k < 2; ++k)
        out.normals.planes<std::int16_t>(octs.size(), [&](std::size_t i) { return octs[i][k]; });
    return out;
}

// ---- Visibility: rows that are equal are stored once; blocks of rows are zstd frames of their own, so that one row
// can be had without the others.
Blob vis_lump(std::size_t clusters, const std::vector<std::uint64_t>& rows, LumpFile& file) {
    constexpr std::size_t kBlockBytes = 64 * 1024;
    const std::size_t words = (clusters + 63) / 64;
    if (rows.size() != words * clusters)
        throw std::invalid_argument("visibility rows do not fit the number of clusters");
    std::map<std::vector<std::uint64_t>, std::uint32_t> known;
    std::vector<std::uint32_t> row_of;
    Put unique;
    for (std::size_t c = 0; c < clusters; ++c) {
        const auto begin = rows.begin() + static_cast<std::ptrdiff_t>(c * words);
        const std::vector<std::uint64_t> row(begin, begin + static_cast<std::ptrdiff_t>(words));
        const auto [it, fresh] = known.try_emplace(row, count(known.size()));
        if (fresh)
            for (const std::uint64_t w : row) unique.value(w);
        row_of.push_back(it->second);
    }
    const std::size_t block_rows = std::max<std::size_t>(1, kBlockBytes / std::max<std::size_t>(1, words * 8));
    Put blocks;
    std::vector<std::uint32_t> sizes;
    for (std::size_t row = 0; row < known.size(); row += block_rows) {
        const std::size_t n = std::min(block_rows, known.size() - row);
        const Blob packed = file.compress(std::span(unique.bytes).subspan(row * words * 8, n * words * 8));
        sizes.push_back(count(packed.size()));
        blocks.raw(packed);
    }
    Put out;
    out.value(count(known.size())), out.value(count(block_rows));
    out.column(row_of, row_of.size()), out.column(sizes, sizes.size());
    out.raw(blocks.bytes);
    return std::move(out.bytes);
}

template <class Table> Blob lump(Table table, const kiln_info& info) {
    Put out;
    table.io(out, info, false);
    if constexpr (requires { table.check(info); }) table.check(info);
    return std::move(out.bytes);
}

std::vector<std::uint8_t> write(const LevelContent& content, const WriteOptions& options) {
    const std::uint32_t bits = grid_bits_of(content, options.position_grid_bits);
    const MeshTables mesh = mesh_of(content, bits);
    LightmapPages lightmaps = make_pages(content, options);

    Head head;
    kiln_info& info = head.info;
    info.rnm_encoding = content.rnm_encoding;
    info.position_grid_bits = bits, info.plane_grid_bits = content.plane_grid_bits;
    info.stripped = options.strip;
    info.planes = count(content.planes.size()), info.nodes = count(content.nodes.size());
    info.leaves = count(content.leaves.size()), info.clusters = content.cluster_count;
    info.portals = count(content.portals.size()), info.brushes = count(content.brushes.size());
    info.materials = count(content.materials.size()), info.models = content.model_count;
    info.vertices = count(mesh.mesh.positions.size()), info.triangles = count(mesh.mesh.triangles.size());
    info.faces = count(content.faces.size()), info.charts = count(content.charts.size());
    info.pages = count(lightmaps.pages.size()), info.lights = count(content.lights.size());
    info.cubes = count(content.cubes.cubes.size()), info.cube_cells = count(content.cubes.cells.size());
    info.probes = count(content.probes.size()), info.entities = count(content.entities.size());
    info.degenerate_triangles = mesh.degenerate;
    for (const ChartInfo& c : content.charts) info.texels += std::uint64_t{c.width} * c.height;
    head.check();

    LumpFile file(options);
    Put head_bytes;
    head.io(head_bytes);
    file.add("HEAD", std::move(head_bytes.bytes));
    file.add("META", meta(content, options));
    file.add("PLNS", lump(planes_of(content), info));
    file.add("NODE", lump(nodes_of(content), info));
    file.add("LEAF", lump(leaves_of(content), info));
    file.add("VISR", vis_lump(content.cluster_count, content.vis_rows, file), 0, false);
    if (!content.shut_rows.empty()) file.add("VISS", vis_lump(content.cluster_count, content.shut_rows, file), 0, false);
    file.add("PRTL", lump(portals_of(content), info));
    file.add("BRSH", lump(brushes_of(content), info));
    file.add("MATL", lump(materials_of(content), info));
    file.add("FACE", lump(mesh.faces, info));
    file.add("MESH", encode_mesh(mesh.mesh));
    file.add("NRML", mesh.normals.bytes);
    if (!mesh.corners.rows.empty()) file.add("CRNR", lump(mesh.corners, info));
    if (!content.displacements.empty()) file.add("DISP", lump(displacements_of(content), info));
    if (!content.patches.empty()) file.add("CURV", lump(curved_patches_of(content), info));
    file.add("CHRT", lump(Charts{lightmaps.charts, lightmaps.pages}, info));
    for (std::uint32_t p = 0; p < info.pages; ++p) {
        const PageInfo& page = lightmaps.pages[p];
        file.add("LMPG", encode_texels(lightmaps.texels[p].data(), page.width, std::uint64_t{page.height} * page.layers, page.format), p);
        if (!options.strip && !lightmaps.quality[p].empty()) file.add("LMQA", std::move(lightmaps.quality[p]), p);
    }
    file.add("LITE", lump(lights_of(content), info));
    file.add("CUBE", lump(cubes_of(content), info));
    ProbeTable probes;
    std::vector<Blob> probe_blobs;
    for (std::size_t i = 0; i < content.probes.size(); ++i) {
        const ProbeInfo& p = content.probes[i];
        kiln_probe k{};
        copy(k.position, p.position), copy(k.box_lo, p.box_lo), copy(k.box_hi, p.box_hi);
        k.entity = p.entity, k.size = p.size, k.mips = p.mips, k.boxed = p.boxed;
        if (p.mips > 13 || p.texels.size() != probe_texels(k))
            throw std::invalid_argument("cubemap " + std::to_string(i) + " has another number of texels than its size says");
        float largest = 0, scale = 1;
        for (const Float3& t : p.texels)
            for (const float v : t)
                if (v <= 3e38f) largest = std::max(largest, v);
        while (largest / scale > 60000.0f) scale *= 2;
        Blob texels(p.texels.size() * 4);
        for (std::size_t t = 0; t < p.texels.size(); ++t) {
            const Float3& v = p.texels[t];
            const std::uint32_t packed = rgb9e5_from_float({v[0] / scale, v[1] / scale, v[2] / scale});
            std::memcpy(texels.data() + 4 * t, &packed, 4);
        }
        probes.rows.push_back(k), probes.scales.push_back(scale);
        probe_blobs.push_back(encode_texels(texels.data(), p.texels.size(), 1, KILN_TEXEL_RGB9E5));
    }
    file.add("PROB", lump(probes, info));
    for (std::uint32_t i = 0; i < info.probes; ++i) file.add("PRBT", std::move(probe_blobs[i]), i);
    file.add("ENTS", lump(entities_of(content), info));
    file.add("BEVL", lump(bevels_of(content), info));
    if (!options.strip) file.add("PROV", lump(provenance_of(content), info));
    if (!content.area_portals.empty()) file.add("AREA", lump(area_portals_of(content), info));
    if (!content.occluders.empty()) file.add("OCCL", lump(occluders_of(content), info));
    if (!content.waters.empty()) file.add("WATR", lump(waters_of(content), info));
    if (!content.leaf_water_distance.empty()) file.add("LWTR", lump(WaterDistances{content.leaf_water_distance}, info));
    if (!options.strip && !content.source_files.empty()) file.add("FILE", lump(source_files_of(content), info));
    BrushBlocks blocks;
    for (const Brush& b : content.brushes) blocks.bits.push_back(b.blocks);
    if (!blocks.bits.empty()) file.add("BBLK", lump(blocks, info));
    CubeBehind behind;
    for (const CubeCell& c : content.cubes.cells) behind.cells.push_back(c.behind);
    if (std::ranges::any_of(behind.cells, [](std::uint32_t c) { return c != KILN_NO_INDEX; })) file.add("CUBB", lump(behind, info));
    FaceShadows shadows;
    for (const FaceInfo& f : content.faces) shadows.bits.push_back(f.no_dynamic_shadow);
    if (std::ranges::find(shadows.bits, 1) != shadows.bits.end()) file.add("FSHD", lump(shadows, info));
    if (!options.strip && content.displacements.size() + content.patches.size() > 0)
        file.add("PRVC", lump(curve_sources_of(content), info));
    if (!content.overlays.empty()) file.add("OVLY", lump(overlays_of(content), info));
    return file.finish();
}

} // namespace

std::vector<std::uint8_t> write_level(const LevelContent& content, const WriteOptions& options) {
    try {
        return write(content, options);
    } catch (const Damaged& e) { // the reader's checks, run on our own tables
        throw std::invalid_argument(e.what());
    }
}

} // namespace kiln::level

// SPDX-License-Identifier: MIT
// Opening a level, its directory, and decoding its lumps.
#include "formats/level/level_state.h"
#include "formats/level/lightmap_codec.h"
#include "formats/level/numbers.h"
#include <cmath>
#include <xxhash.h>
#include <zstd.h>

using namespace kiln::level;

namespace kiln::level {

Blob decompress(std::span<const std::uint8_t> stored, std::uint64_t raw_size) {
    if (raw_size > kMaxRawSize) throw Failure{KILN_TOO_LARGE, "a lump claims more than 2 GiB"};
    if (raw_size / kMaxRatio > stored.size()) throw Damaged("a lump claims more than compression can hold");
    if (ZSTD_getFrameContentSize(stored.data(), stored.size()) != raw_size ||
        ZSTD_findFrameCompressedSize(stored.data(), stored.size()) != stored.size())
        throw Damaged("a compressed lump has another size than the directory says");
    Blob raw(raw_size);
    const std::size_t size = ZSTD_decompress(raw.data(), raw.size(), stored.data(), stored.size());
    if (ZSTD_isError(size) || size != raw_size) throw Damaged("a compressed lump is damaged");
    return raw;
}

namespace {

// Directory and HEAD; throws.
void open(kiln_level& level) {
    const auto bytes = level.bytes;
    if (bytes.size() < 4) throw Failure{KILN_NOT_A_LEVEL, "too short"};
    Get header(bytes);
    if (header.value<std::uint32_t>() != kMagic) throw Failure{KILN_NOT_A_LEVEL, "no KILN at the start"};
    if (bytes.size() < kHeaderSize) throw Damaged("the file ends in its header");
    if (header.value<std::uint32_t>() != KILN_FORMAT_VERSION)
        throw Failure{KILN_UNSUPPORTED, "another version of the format"};
    const auto count = header.value<std::uint32_t>();
    header.value<std::uint32_t>(); // reserved
    const auto file_size = header.value<std::uint64_t>();
    const auto hash = header.value<std::uint64_t>();
    if (file_size != bytes.size()) throw Damaged("the file has another length than it says");
    if (count > (bytes.size() - kHeaderSize) / kEntrySize) throw Damaged("the directory is longer than the file");
    struct Free {
        void operator()(XXH3_state_t* s) const { XXH3_freeState(s); }
    };
    const std::unique_ptr<XXH3_state_t, Free> state(XXH3_createState());
    if (!state) throw std::bad_alloc();
    XXH3_64bits_reset(state.get());
    XXH3_64bits_update(state.get(), bytes.data(), kHeaderSize - 8);
    XXH3_64bits_update(state.get(), bytes.data() + kHeaderSize, count * kEntrySize);
    if (XXH3_64bits_digest(state.get()) != hash) throw Damaged("the directory does not match its checksum");

    Get directory(bytes.subspan(kHeaderSize, count * kEntrySize));
    for (std::uint32_t i = 0; i < count; ++i) {
        Entry e;
        e.id = directory.value<std::uint32_t>(), e.index = directory.value<std::uint32_t>();
        e.version = directory.value<std::uint16_t>(), e.codec = directory.value<std::uint16_t>();
        directory.value<std::uint32_t>(); // reserved
        e.offset = directory.value<std::uint64_t>(), e.stored_size = directory.value<std::uint64_t>();
        e.raw_size = directory.value<std::uint64_t>(), e.checksum = directory.value<std::uint64_t>();
        if (e.offset > bytes.size() || e.stored_size > bytes.size() - e.offset)
            throw Damaged("a lump reaches past the end of the file");
        if (!level.at.emplace(std::pair{e.id, e.index}, level.entries.size()).second)
            throw Damaged("the same lump is there twice");
        level.entries.push_back(e);
    }
    level.blobs = std::make_unique<Lazy<Blob>[]>(level.entries.size());

    const Blob raw = level.fetch(fourcc("HEAD"), 0);
    Get in(raw);
    Head head;
    head.io(in);
    in.end();
    head.check();
    level.info = head.info;
}

template <class Table> void load(const kiln_level& level, std::uint32_t id, Table& table) {
    const Blob raw = level.fetch(id, 0);
    Get in(raw);
    table.io(in, level.info, true);
    in.end();
    if constexpr (requires { table.check(level.info); }) table.check(level.info);
}

} // namespace
} // namespace kiln::level

std::size_t kiln_level::find(std::uint32_t id, std::uint32_t index) const {
    const auto it = at.find({id, index});
    return it == at.end() ? entries.size() : it->second;
}

std::span<const std::uint8_t> kiln_level::verified(std::size_t entry) const {
    const Entry& e = entries[entry];
    const auto stored = bytes.subspan(e.offset, e.stored_size);
    if (XXH3_64bits(stored.data(), stored.size()) != e.checksum) throw Damaged("a lump does not match its checksum");
    return stored;
}

Blob kiln_level::fetch(std::size_t entry) const {
    const Entry& e = entries[entry];
    if (e.version != 1) throw Failure{KILN_UNSUPPORTED, "a lump of another version"};
    if (e.codec > KILN_CODEC_ZSTD) throw Failure{KILN_UNSUPPORTED, "a lump in an unknown codec"};
    const auto stored = verified(entry);
    if (e.codec == KILN_CODEC_ZSTD) return decompress(stored, e.raw_size);
    if (e.raw_size != e.stored_size) throw Damaged("a plain lump has two sizes");
    return Blob(stored.begin(), stored.end());
}
Blob kiln_level::fetch(std::uint32_t id, std::uint32_t index) const {
    const std::size_t entry = find(id, index);
    if (entry == entries.size()) throw Failure{KILN_MISSING, "the file has no such lump"};
    return fetch(entry);
}

// ---- Parts

#define KILN_TABLE(type, member, id)                                                                               \
    const type* kiln_level::get_##member() const {                                                                 \
        return member.get([&](type& table) { load(*this, fourcc(id), table); });                                   \
    }
KILN_TABLE(Planes, planes, "PLNS")
KILN_TABLE(Nodes, nodes, "NODE")
KILN_TABLE(Leaves, leaves, "LEAF")
KILN_TABLE(Portals, portals, "PRTL")
KILN_TABLE(Brushes, brushes, "BRSH")
KILN_TABLE(Faces, faces, "FACE")
KILN_TABLE(Charts, charts, "CHRT")
KILN_TABLE(Lights, lights, "LITE")
KILN_TABLE(ProbeTable, probes, "PROB")
KILN_TABLE(Entities, entities, "ENTS")
KILN_TABLE(Provenance, provenance, "PROV")
KILN_TABLE(Materials, materials, "MATL")
KILN_TABLE(Bevels, bevels, "BEVL")
KILN_TABLE(AreaPortals, area_portals, "AREA")
KILN_TABLE(Occluders, occluders, "OCCL")
KILN_TABLE(Waters, waters, "WATR")
KILN_TABLE(WaterDistances, water_distances, "LWTR")
KILN_TABLE(SourceFiles, source_files, "FILE")
KILN_TABLE(BrushBlocks, brush_blocks, "BBLK")
KILN_TABLE(CubeBehind, cube_behind, "CUBB")
KILN_TABLE(FaceShadows, face_shadows, "FSHD")
KILN_TABLE(Displacements, displacements, "DISP")
KILN_TABLE(CurvedPatches, curved_patches, "CURV")
KILN_TABLE(CurveSources, curve_sources, "PRVC")
KILN_TABLE(Overlays, overlays, "OVLY")
#undef KILN_TABLE

const CurveCorners* kiln_level::get_curve_corners() const {
    return curve_corners.get([&](CurveCorners& table) {
        const Faces* owners = get_faces();
        if (!owners) throw Failure{faces.status(), faces.what()};
        load(*this, fourcc("CRNR"), table);
        table.first.assign(owners->rows.size(), KILN_NO_INDEX);
        std::uint64_t next = 0;
        for (std::size_t f = 0; f < owners->rows.size(); ++f) {
            if (!(owners->rows[f].flags & KILN_FACE_CURVED)) continue;
            table.first[f] = static_cast<std::uint32_t>(std::min<std::uint64_t>(next, KILN_NO_INDEX));
            next += std::uint64_t{3} * owners->rows[f].triangle_count;
        }
        require(next == table.rows.size(), "curved faces have another number of corners than there are");
    });
}

const std::string* kiln_level::get_meta() const {
    return meta.get([&](std::string& text) {
        const Blob raw = fetch(fourcc("META"), 0);
        text.assign(raw.begin(), raw.end());
    });
}

const Cubes* kiln_level::get_cubes() const {
    return cubes.get([&](Cubes& table) {
        load(*this, fourcc("CUBE"), table);
        for (std::size_t i = 0; i < table.cubes.size(); ++i)
            for (std::size_t k = 0; k < 18; ++k)
                table.cubes[i].irradiance[k / 3][k % 3] = float_from_half(table.halfs[i].v[k]) * table.scale;
        table.halfs = {};
        table.tree.nodes = table.nodes.data(), table.tree.node_count = table.nodes.size();
    });
}

const Collision* kiln_level::get_collision() const {
    return collision.get([&](Collision& out) { out = make_collision(*this); });
}

namespace {

void load_rows(const kiln_level& level, std::uint32_t id, Visibility& v) {
    const std::size_t entry = level.find(id);
    if (entry == level.entries.size()) throw Failure{KILN_MISSING, "the file has no such lump"};
    const Entry& e = level.entries[entry];
    if (e.version != 1 || e.codec != KILN_CODEC_NONE) throw Failure{KILN_UNSUPPORTED, "unknown visibility lump"};
    Get in(level.verified(entry));
    v.words = (level.info.clusters + std::size_t{63}) / 64;
    v.unique = in.value<std::uint32_t>(), v.block_rows = in.value<std::uint32_t>();
    require(v.unique <= level.info.clusters && v.block_rows > 0, "impossible number of visibility rows");
    require(level.info.clusters == 0 || v.unique > 0, "clusters without visibility rows");
    in.column(v.row_of, level.info.clusters);
    for (const std::uint32_t r : v.row_of) require_index(r, v.unique, "a cluster names a row that is not there");
    const std::size_t blocks = (std::size_t{v.unique} + v.block_rows - 1) / v.block_rows;
    std::vector<std::uint32_t> sizes;
    in.column(sizes, blocks);
    for (std::size_t b = 0; b < blocks; ++b) v.blocks.push_back(in.raw(sizes[b]));
    in.end();
}

void decode_rows(const Visibility* v, const Lazy<Visibility>& lazy, std::vector<std::uint64_t>& rows) {
    if (!v) throw Failure{lazy.status(), lazy.what()};
    if (std::uint64_t{v->unique} * v->words * 8 > kMaxRawSize) throw Failure{KILN_TOO_LARGE, "visibility rows over 2 GiB"};
    for (std::size_t b = 0; b < v->blocks.size(); ++b) {
        const std::size_t n = std::min<std::size_t>(v->block_rows, v->unique - b * v->block_rows) * v->words;
        const Blob raw = decompress(v->blocks[b], n * 8);
        const std::size_t to = rows.size();
        rows.resize(to + n);
        if (n) std::memcpy(rows.data() + to, raw.data(), raw.size());
    }
}

} // namespace

const Visibility* kiln_level::get_visibility() const {
    return visibility.get([&](Visibility& v) { load_rows(*this, fourcc("VISR"), v); });
}
const std::vector<std::uint64_t>* kiln_level::get_vis_rows() const {
    return vis_rows.get([&](std::vector<std::uint64_t>& rows) { decode_rows(get_visibility(), visibility, rows); });
}
const Visibility* kiln_level::get_shut_visibility() const {
    return shut_visibility.get([&](Visibility& v) { load_rows(*this, fourcc("VISS"), v); });
}
const std::vector<std::uint64_t>* kiln_level::get_shut_rows() const {
    return shut_rows.get([&](std::vector<std::uint64_t>& rows) { decode_rows(get_shut_visibility(), shut_visibility, rows); });
}

const Mesh* kiln_level::get_mesh() const {
    return mesh.get([&](Mesh& out) {
        const Blob raw = fetch(fourcc("MESH"), 0);
        const GridMesh decoded = decode_mesh(raw, info.vertices, info.triangles);
        const double step = std::ldexp(1.0, -static_cast<int>(info.position_grid_bits));
        for (const auto& p : decoded.positions)
            for (const std::int32_t v : p) out.grid.push_back(v), out.positions.push_back(static_cast<float>(v * step));
        for (const auto& t : decoded.triangles)
            for (const std::uint32_t v : t) out.triangles.push_back(v);
    });
}

const std::vector<float>* kiln_level::get_normals() const {
    return normals.get([&](std::vector<float>& out) {
        const Faces* table = get_faces();
        if (!table) throw Failure{faces.status(), faces.what()};
        const Blob raw = fetch(fourcc("NRML"), 0);
        Get in(raw);
        std::vector<std::uint8_t> smooth;
        in.column(smooth, table->rows.size());
        std::size_t corners = 0;
        for (std::size_t f = 0; f < smooth.size(); ++f)
            if (smooth[f]) corners += std::size_t{3} * table->rows[f].triangle_count;
        std::vector<std::int16_t> x, y;
        in.column(x, corners), in.column(y, corners);
        in.end();
        // Flat faces take nine floats a triangle that no byte of this lump stands for: the mesh must vouch for them.
        if (!get_mesh()) throw Failure{mesh.status(), mesh.what()};
        out.reserve(std::size_t{9} * info.triangles);
        std::size_t at_corner = 0;
        for (std::size_t f = 0; f < smooth.size(); ++f)
            for (std::size_t c = 0; c < std::size_t{3} * table->rows[f].triangle_count; ++c) {
                const float* flat = table->rows[f].normal;
                std::array<float, 3> n{flat[0], flat[1], flat[2]};
                if (smooth[f]) n = normal_from_oct(x[at_corner], y[at_corner]), ++at_corner;
                out.insert(out.end(), n.begin(), n.end());
            }
    });
}

const Blob* kiln_level::get_page(std::uint32_t page) const {
    const Charts* table = get_charts();
    const std::size_t entry = find(fourcc("LMPG"), page);
    if (!table || page >= table->pages.size() || entry == entries.size()) return nullptr;
    return blobs[entry].get([&](Blob& texels) {
        const PageInfo& p = table->pages[page];
        require(entries[entry].raw_size == page_size(p), "an atlas page has another size than its table says");
        const Blob raw = fetch(entry);
        texels = decode_texels(raw.data(), p.width, std::uint64_t{p.height} * p.layers, p.format);
    });
}
const Blob* kiln_level::get_quality(std::uint32_t page) const {
    const Charts* table = get_charts();
    const std::size_t entry = find(fourcc("LMQA"), page);
    if (!table || page >= table->pages.size() || entry == entries.size()) return nullptr;
    return blobs[entry].get([&](Blob& planes_of_bytes) {
        const PageInfo& p = table->pages[page];
        require(entries[entry].raw_size == std::uint64_t{2} * p.width * p.height,
                "a quality page has another size than its table says");
        planes_of_bytes = fetch(entry);
    });
}
const Blob* kiln_level::get_probe(std::uint32_t probe) const {
    const ProbeTable* table = get_probes();
    const std::size_t entry = find(fourcc("PRBT"), probe);
    if (!table || probe >= table->rows.size() || entry == entries.size()) return nullptr;
    return blobs[entry].get([&](Blob& texels) {
        const std::uint64_t n = probe_texels(table->rows[probe]);
        require(entries[entry].raw_size == n * 4, "a cubemap has another size than its table says");
        const Blob raw = fetch(entry);
        texels = decode_texels(raw.data(), n, 1, KILN_TEXEL_RGB9E5);
    });
}

kiln_status kiln_level::fault_of(std::uint32_t id, std::uint32_t index) const {
    const std::size_t entry = find(id, index);
    if (entry == entries.size()) return KILN_MISSING;
    const kiln_status status = kiln_level_load(this, entry, nullptr);
    return status == KILN_OK ? KILN_DAMAGED : status;
}

// ---- C interface: opening and the directory

extern "C" {

const char* kiln_status_text(kiln_status status) {
    switch (status) {
    case KILN_OK: return "ok";
    case KILN_NONE: return "nothing is stored for this";
    case KILN_BAD_ARGUMENT: return "bad argument";
    case KILN_NOT_A_LEVEL: return "not a Kiln level";
    case KILN_UNSUPPORTED: return "a version or codec this library does not know";
    case KILN_DAMAGED: return "damaged";
    case KILN_TOO_LARGE: return "claims more memory than the limits allow";
    case KILN_NO_MEMORY: return "out of memory";
    case KILN_MISSING: return "the level has no such part";
    }
    return "unknown status";
}

kiln_status kiln_level_open_memory(const void* bytes, size_t size, kiln_level** out) {
    if (!out) return KILN_BAD_ARGUMENT;
    *out = nullptr;
    if (!bytes) return KILN_BAD_ARGUMENT;
    try {
        auto level = std::make_unique<kiln_level>();
        level->bytes = {static_cast<const std::uint8_t*>(bytes), size};
        open(*level);
        *out = level.release();
        return KILN_OK;
    } catch (const Failure& f) {
        return f.status;
    } catch (const std::bad_alloc&) {
        return KILN_NO_MEMORY;
    } catch (const std::exception&) {
        return KILN_DAMAGED;
    }
}

void kiln_level_close(kiln_level* level) { delete level; }

size_t kiln_level_lump_count(const kiln_level* level) { return level ? level->entries.size() : 0; }

kiln_status kiln_level_lump(const kiln_level* level, size_t i, kiln_lump* lump) {
    if (!level || !lump || i >= level->entries.size()) return KILN_BAD_ARGUMENT;
    const Entry& e = level->entries[i];
    for (unsigned k = 0; k < 4; ++k) {
        const auto c = static_cast<char>(e.id >> (8 * k) & 0xff);
        lump->name[k] = c >= ' ' && c <= '~' ? c : '?';
    }
    lump->name[4] = 0;
    lump->index = e.index, lump->version = e.version, lump->codec = e.codec;
    lump->offset = e.offset, lump->stored_size = e.stored_size, lump->raw_size = e.raw_size;
    lump->checksum = e.checksum;
    return KILN_OK;
}

kiln_status kiln_level_load(const kiln_level* level, size_t i, const char** what) {
    const char* unused = nullptr;
    const char*& text = what ? *what : unused;
    text = "";
    if (!level || i >= level->entries.size()) return text = "bad argument", KILN_BAD_ARGUMENT;
    const Entry& e = level->entries[i];
    const auto tell = [&](const auto& lazy, const void* value) {
        if (!value) text = lazy.what();
        return value ? KILN_OK : lazy.status();
    };
    // Pages and cubemaps depend on their table.
    const auto tell_blob = [&](const auto& table, const void* table_value, bool in_table, const void* value) {
        if (!table_value) return tell(table, nullptr);
        if (!in_table) return KILN_OK; // more than the table speaks of: as good as unknown
        return tell(level->blobs[i], value);
    };
    if (e.index == 0) {
        switch (e.id) {
        case fourcc("HEAD"): return KILN_OK;
        case fourcc("META"): return tell(level->meta, level->get_meta());
        case fourcc("PLNS"): return tell(level->planes, level->get_planes());
        case fourcc("NODE"): return tell(level->nodes, level->get_nodes());
        case fourcc("LEAF"): return tell(level->leaves, level->get_leaves());
        case fourcc("VISR"): return tell(level->vis_rows, level->get_vis_rows());
        case fourcc("VISS"): return tell(level->shut_rows, level->get_shut_rows());
        case fourcc("PRTL"): return tell(level->portals, level->get_portals());
        case fourcc("BRSH"): return tell(level->brushes, level->get_brushes());
        case fourcc("MATL"): return tell(level->materials, level->get_materials());
        case fourcc("FACE"): return tell(level->faces, level->get_faces());
        case fourcc("MESH"): return tell(level->mesh, level->get_mesh());
        case fourcc("NRML"): return tell(level->normals, level->get_normals());
        case fourcc("CHRT"): return tell(level->charts, level->get_charts());
        case fourcc("LITE"): return tell(level->lights, level->get_lights());
        case fourcc("CUBE"): return tell(level->cubes, level->get_cubes());
        case fourcc("PROB"): return tell(level->probes, level->get_probes());
        case fourcc("ENTS"): return tell(level->entities, level->get_entities());
        case fourcc("PROV"): return tell(level->provenance, level->get_provenance());
        case fourcc("BEVL"): return tell(level->bevels, level->get_bevels());
        case fourcc("AREA"): return tell(level->area_portals, level->get_area_portals());
        case fourcc("OCCL"): return tell(level->occluders, level->get_occluders());
        case fourcc("WATR"): return tell(level->waters, level->get_waters());
        case fourcc("LWTR"): return tell(level->water_distances, level->get_water_distances());
        case fourcc("FILE"): return tell(level->source_files, level->get_source_files());
        case fourcc("BBLK"): return tell(level->brush_blocks, level->get_brush_blocks());
        case fourcc("CUBB"): return tell(level->cube_behind, level->get_cube_behind());
        case fourcc("FSHD"): return tell(level->face_shadows, level->get_face_shadows());
        case fourcc("CRNR"): return tell(level->curve_corners, level->get_curve_corners());
        case fourcc("DISP"): return tell(level->displacements, level->get_displacements());
        case fourcc("CURV"): return tell(level->curved_patches, level->get_curved_patches());
        case fourcc("PRVC"): return tell(level->curve_sources, level->get_curve_sources());
        case fourcc("OVLY"): return tell(level->overlays, level->get_overlays());
        default: break;
        }
    }
    const bool page = e.index < level->info.pages, probe = e.index < level->info.probes;
    switch (e.id) {
    case fourcc("LMPG"): return tell_blob(level->charts, level->get_charts(), page, level->get_page(e.index));
    case fourcc("LMQA"): return tell_blob(level->charts, level->get_charts(), page, level->get_quality(e.index));
    case fourcc("PRBT"): return tell_blob(level->probes, level->get_probes(), probe, level->get_probe(e.index));
    default: break;
    }
    try {
        level->verified(i);
        return KILN_OK;
    } catch (const Damaged&) {
        return text = "an unknown lump does not match its checksum", KILN_DAMAGED;
    }
}

kiln_status kiln_level_check(const kiln_level* level, const char** what) {
    if (what) *what = "";
    if (!level) return KILN_BAD_ARGUMENT;
    for (std::size_t i = 0; i < level->entries.size(); ++i)
        if (const kiln_status status = kiln_level_load(level, i, what); status != KILN_OK) return status;
    return KILN_OK;
}

kiln_status kiln_level_info(const kiln_level* level, kiln_info* info) {
    if (!level || !info) return KILN_BAD_ARGUMENT;
    *info = level->info;
    return KILN_OK;
}

const char* kiln_level_meta_json(const kiln_level* level, size_t* length) {
    const std::string* text = level ? level->get_meta() : nullptr;
    if (length) *length = text ? text->size() : 0;
    return text ? text->c_str() : nullptr;
}

float kiln_half_to_float(uint16_t half) { return float_from_half(half); }
void kiln_rgb9e5_to_float(uint32_t packed, float rgb[3]) {
    const auto v = float_from_rgb9e5(packed);
    for (std::size_t i = 0; i < 3; ++i) rgb[i] = v[i];
}

} // extern "C"

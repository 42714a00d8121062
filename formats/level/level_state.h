// SPDX-License-Identifier: MIT
// What an open level is inside: the directory, and each part decoded at its first use, once. Private.
#pragma once
#include "formats/level/collision.h"
#include "formats/level/mesh_codec.h"
#include "formats/level/tables.h"
#include <map>
#include <memory>
#include <mutex>
#include <new>

namespace kiln::level {

struct Failure {
    kiln_status status;
    std::string what;
};

// A value made at most once, whichever thread comes first; a failure is kept as well.
template <class T> class Lazy {
public:
    template <class Make> const T* get(const Make& make) {
        std::call_once(once_, [&] {
            try {
                make(value_);
                status_ = KILN_OK;
                return;
            } catch (const Failure& f) {
                status_ = f.status, what_ = f.what;
            } catch (const std::bad_alloc&) {
                status_ = KILN_NO_MEMORY;
            } catch (const std::exception& e) { // Damaged, and what a library throws at bytes it cannot take
                status_ = KILN_DAMAGED, what_ = e.what();
            }
            value_ = T{};
        });
        return status_ == KILN_OK ? &value_ : nullptr;
    }
    kiln_status status() const { return status_; } // after get()
    const char* what() const { return what_.empty() ? kiln_status_text(status_) : what_.c_str(); }

private:
    std::once_flag once_;
    kiln_status status_ = KILN_OK;
    std::string what_;
    T value_{};
};

struct Mesh {
    std::vector<std::int32_t> grid;
    std::vector<float> positions;
    std::vector<std::uint32_t> triangles;
};
struct Visibility {
    std::size_t words = 0;
    std::uint32_t block_rows = 1;
    std::vector<std::uint32_t> row_of;        // per cluster: which unique row
    std::uint32_t unique = 0;
    std::vector<std::span<const std::uint8_t>> blocks; // in the file's bytes
};

} // namespace kiln::level

struct kiln_level {
    template <class T> using Lazy = kiln::level::Lazy<T>;

    std::span<const std::uint8_t> bytes;
    std::vector<kiln::level::Entry> entries;
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> at; // (id, index) to entry
    kiln_info info{};

    mutable Lazy<std::string> meta;
    mutable Lazy<kiln::level::Planes> planes;
    mutable Lazy<kiln::level::Nodes> nodes;
    mutable Lazy<kiln::level::Leaves> leaves;
    mutable Lazy<kiln::level::Visibility> visibility;
    mutable Lazy<std::vector<std::uint64_t>> vis_rows; // unique rows, decoded
    mutable Lazy<kiln::level::Visibility> shut_visibility; // while area portals are shut
    mutable Lazy<std::vector<std::uint64_t>> shut_rows;
    mutable Lazy<kiln::level::Portals> portals;
    mutable Lazy<kiln::level::Brushes> brushes;
    mutable Lazy<kiln::level::Materials> materials;
    mutable Lazy<kiln::level::Faces> faces;
    mutable Lazy<kiln::level::Mesh> mesh;
    mutable Lazy<std::vector<float>> normals;
    mutable Lazy<kiln::level::Charts> charts;
    mutable Lazy<kiln::level::Lights> lights;
    mutable Lazy<kiln::level::Cubes> cubes;
    mutable Lazy<kiln::level::ProbeTable> probes;
    mutable Lazy<kiln::level::Entities> entities;
    mutable Lazy<kiln::level::Provenance> provenance;
    mutable Lazy<kiln::level::Bevels> bevels;
    mutable Lazy<kiln::level::Collision> collision; // made of planes, brushes, bevels, nodes and leaves
    mutable Lazy<kiln::level::AreaPortals> area_portals;
    mutable Lazy<kiln::level::Occluders> occluders;
    mutable Lazy<kiln::level::Waters> waters;
    mutable Lazy<kiln::level::WaterDistances> water_distances;
    mutable Lazy<kiln::level::SourceFiles> source_files;
    mutable Lazy<kiln::level::BrushBlocks> brush_blocks;
    mutable Lazy<kiln::level::CubeBehind> cube_behind;
    mutable Lazy<kiln::level::FaceShadows> face_shadows;
    mutable Lazy<kiln::level::CurveCorners> curve_corners;
    mutable Lazy<kiln::level::Displacements> displacements;
    mutable Lazy<kiln::level::CurvedPatches> curved_patches;
    mutable Lazy<kiln::level::CurveSources> curve_sources;
    mutable Lazy<kiln::level::Overlays> overlays;
    std::unique_ptr<Lazy<kiln::level::Blob>[]> blobs; // per entry: LMPG, LMQA, PRBT

    // Null where the part is missing or damaged.
    const std::string* get_meta() const;
    const kiln::level::Planes* get_planes() const;
    const kiln::level::Nodes* get_nodes() const;
    const kiln::level::Leaves* get_leaves() const;
    const kiln::level::Visibility* get_visibility() const;
    const std::vector<std::uint64_t>* get_vis_rows() const;
    const kiln::level::Visibility* get_shut_visibility() const;
    const std::vector<std::uint64_t>* get_shut_rows() const;
    const kiln::level::Portals* get_portals() const;
    const kiln::level::Brushes* get_brushes() const;
    const kiln::level::Materials* get_materials() const;
    const kiln::level::Faces* get_faces() const;
    const kiln::level::Mesh* get_mesh() const;
    const std::vector<float>* get_normals() const;
    const kiln::level::Charts* get_charts() const;
    const kiln::level::Lights* get_lights() const;
    const kiln::level::Cubes* get_cubes() const;
    const kiln::level::ProbeTable* get_probes() const;
    const kiln::level::Entities* get_entities() const;
    const kiln::level::Provenance* get_provenance() const;
    const kiln::level::Bevels* get_bevels() const;
    const kiln::level::Collision* get_collision() const;
    const kiln::level::AreaPortals* get_area_portals() const;
    const kiln::level::Occluders* get_occluders() const;
    const kiln::level::Waters* get_waters() const;
    const kiln::level::WaterDistances* get_water_distances() const;
    const kiln::level::SourceFiles* get_source_files() const;
    const kiln::level::BrushBlocks* get_brush_blocks() const;
    const kiln::level::CubeBehind* get_cube_behind() const;
    const kiln::level::FaceShadows* get_face_shadows() const;
    const kiln::level::CurveCorners* get_curve_corners() const;
    const kiln::level::Displacements* get_displacements() const;
    const kiln::level::CurvedPatches* get_curved_patches() const;
    const kiln::level::CurveSources* get_curve_sources() const;
    const kiln::level::Overlays* get_overlays() const;
    const kiln::level::Blob* get_page(std::uint32_t page) const;    // run-time texels
    const kiln::level::Blob* get_quality(std::uint32_t page) const; // validity, then error codes
    const kiln::level::Blob* get_probe(std::uint32_t probe) const;

    std::size_t find(std::uint32_t id, std::uint32_t index = 0) const; // entry, or entries.size()
    kiln::level::Blob fetch(std::size_t entry) const;                  // verified and decompressed; throws
    kiln::level::Blob fetch(std::uint32_t id, std::uint32_t index) const;
    std::span<const std::uint8_t> verified(std::size_t entry) const;
    // Why a part that some function needs is not there; KILN_DAMAGED where only its lump knows more.
    kiln_status fault_of(std::uint32_t id, std::uint32_t index = 0) const;
};

namespace kiln::level {
// zstd, checked: exactly raw_size bytes come out. Throws Damaged.
Blob decompress(std::span<const std::uint8_t> stored, std::uint64_t raw_size);
} // namespace kiln::level

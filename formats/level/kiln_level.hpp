// SPDX-License-Identifier: MIT
// A thin C++20 face of kiln_level.h: an owner, and arrays as spans. Header only.
#pragma once
#include "formats/level/kiln_level.h"
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <array>

namespace kiln::level {

struct LevelError : std::runtime_error {
    kiln_status status;
    explicit LevelError(kiln_status s) : std::runtime_error(kiln_status_text(s)), status(s) {}
};

class Level {
public:
    // The bytes are borrowed and must outlive the level. Throws LevelError.
    explicit Level(std::span<const std::uint8_t> bytes) {
        kiln_level* raw = nullptr;
        if (const kiln_status s = kiln_level_open_memory(bytes.data(), bytes.size(), &raw); s != KILN_OK)
            throw LevelError(s);
        level_.reset(raw);
    }
    const kiln_level* get() const { return level_.get(); }
    kiln_info info() const {
        kiln_info i{};
        kiln_level_info(get(), &i);
        return i;
    }
    std::string_view meta_json() const {
        size_t n = 0;
        const char* text = kiln_level_meta_json(get(), &n);
        return text ? std::string_view(text, n) : std::string_view();
    }
    std::span<const kiln_plane> planes() const { return rows(kiln_level_planes); }
    std::span<const kiln_node> nodes() const { return rows(kiln_level_nodes); }
    std::span<const kiln_leaf> leaves() const { return rows(kiln_level_leaves); }
    std::span<const std::uint32_t> leaf_brushes() const { return rows(kiln_level_leaf_brushes); }
    std::span<const std::uint32_t> leaf_faces() const { return rows(kiln_level_leaf_faces); }
    std::span<const kiln_portal> portals() const { return rows(kiln_level_portals); }
    std::span<const float> portal_points() const { return rows(kiln_level_portal_points, 3); }
    std::span<const kiln_brush> brushes() const { return rows(kiln_level_brushes); }
    std::span<const std::uint32_t> brush_planes() const { return rows(kiln_level_brush_planes); }
    std::span<const kiln_material> materials() const { return rows(kiln_level_materials); }
    std::span<const kiln_face> faces() const { return rows(kiln_level_faces); }
    std::span<const kiln_chart> charts() const { return rows(kiln_level_charts); }
    std::span<const std::int32_t> grid_positions() const { return rows(kiln_level_grid_positions, 3); }
    std::span<const float> positions() const { return rows(kiln_level_positions, 3); }
    std::span<const std::uint32_t> triangles() const { return rows(kiln_level_triangles, 3); }
    std::span<const float> corner_normals() const { return rows(kiln_level_corner_normals, 9); }
    std::span<const kiln_area_portal> area_portals() const { return rows(kiln_level_area_portals); }
    std::span<const float> area_portal_points() const { return rows(kiln_level_area_portal_points, 3); }
    std::span<const kiln_occluder> occluders() const { return rows(kiln_level_occluders); }
    std::span<const kiln_occluder_polygon> occluder_polygons() const { return rows(kiln_level_occluder_polygons); }
    std::span<const float> occluder_points() const { return rows(kiln_level_occluder_points, 3); }
    std::span<const kiln_water> waters() const { return rows(kiln_level_waters); }
    std::span<const std::uint32_t> leaf_waters() const { return rows(kiln_level_leaf_waters); }
    std::span<const float> leaf_water_distances() const { return rows(kiln_level_leaf_water_distances); }
    std::span<const std::uint8_t> brush_blocks() const { return rows(kiln_level_brush_blocks); }
    std::span<const std::uint8_t> face_no_dynamic_shadow() const { return rows(kiln_level_face_no_dynamic_shadow); }
    std::span<const kiln_light> lights() const { return rows(kiln_level_lights); }
    std::span<const kiln_cube> cubes() const { return rows(kiln_level_cubes); }
    std::span<const kiln_cube_cell> cube_cells() const { return rows(kiln_level_cube_cells); }
    std::span<const std::uint32_t> cube_behind() const { return rows(kiln_level_cube_behind); }
    std::span<const std::uint32_t> cube_lights() const { return rows(kiln_level_cube_lights); }
    std::span<const kiln_probe> probes() const { return rows(kiln_level_probes); }
    std::span<const kiln_overlay> overlays() const { return rows(kiln_level_overlays); }
    std::span<const kiln_overlay_fragment> overlay_fragments() const { return rows(kiln_level_overlay_fragments); }
    std::span<const kiln_overlay_point> overlay_points() const { return rows(kiln_level_overlay_points); }

    std::uint32_t find_leaf(const std::array<double, 3>& point) const {
        return kiln_level_find_leaf(get(), point.data());
    }
    // Nothing where the face has no lightmap. Throws LevelError for a damaged one.
    std::optional<std::array<float, 3>> irradiance(std::uint32_t face, const std::array<double, 3>& point,
                                                   const std::array<float, 3>& world_normal) const {
        std::array<float, 3> rgb{};
        const kiln_status s = kiln_level_eval_rnm(get(), face, point.data(), world_normal.data(), rgb.data());
        if (s == KILN_NONE) return std::nullopt;
        if (s != KILN_OK) throw LevelError(s);
        return rgb;
    }

private:
    struct Close {
        void operator()(kiln_level* l) const { kiln_level_close(l); }
    };
    std::unique_ptr<kiln_level, Close> level_;
    template <class T> std::span<const T> rows(const T* (*function)(const kiln_level*, size_t*), size_t each = 1) const {
        size_t n = 0;
        const T* data = function(get(), &n);
        return {data, data ? n * each : 0};
    }
};

} // namespace kiln::level

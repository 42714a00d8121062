// SPDX-License-Identifier: MIT
// Writer of the level file: LevelContent, all that a level holds, to bytes. The layout is FORMAT.md; the reader is
// kiln_level.h (C) with kiln_level.hpp (C++). Knows nothing of the compiler.
//
// In       tables below; indices must be in range (std::invalid_argument names the first that is not)
// Out      the file's bytes, a function of content and options alone
// Space    world, map units, +z up; linear RGB; irradiance E without albedo and without 1/pi
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace kiln::level {

using Float3 = std::array<float, 3>;
using Double3 = std::array<double, 3>;

struct Plane { // dot(normal, x) = distance; exactly: exact . (x * 2^plane_grid_bits) = d
    Double3 normal{};
    double distance = 0;
    std::array<std::int64_t, 3> exact{};
    std::int64_t exact_d_high = 0; // d = high * 2^64 + low
    std::uint64_t exact_d_low = 0;
};
struct Node {
    std::uint32_t plane = 0;
    std::array<std::int32_t, 2> child{}; // front, behind; < 0: leaf -(child + 1)
    Float3 lo{}, hi{};
};
struct Leaf {
    std::uint8_t contents = 0;
    std::int32_t cluster = -1;
    std::uint32_t area = 0, probe = UINT32_MAX;
    Float3 lo{}, hi{};
    std::vector<std::uint32_t> brushes, faces;
};
struct Portal {
    std::array<std::int32_t, 2> leaf{};
    std::uint32_t plane = 0;
    std::vector<Float3> winding;
};
struct Bevel { // supports a brush: dot(normal, x) <= distance on all of it
    Double3 normal{};
    double distance = 0;
};
struct Brush { // inside = behind all planes
    std::uint32_t model = 0;
    std::uint8_t contents = 0;
    std::vector<std::uint32_t> planes;
    std::int32_t source_entity = -1, source_id = -1, source_line = 0;
    std::vector<std::int32_t> source_sides; // parallel to planes
    std::uint32_t source_file = 0;          // into LevelContent::source_files
    std::vector<Bevel> bevels;              // what it lacks for swept boxes: axial ones -x +x -y +y -z +z, then those of edges
    std::uint8_t blocks = 15; // 1 players, 2 NPCs, 4 bullets, 8 sight
};
struct MaterialInfo {
    std::string name, albedo_map, normal_map;
    Float3 reflectance{}, emission{};
    float alpha = 1, env_map = 0, roughness = 0.3f;
    std::uint32_t flags = 0, width = 64, height = 64;
};
struct FaceInfo {
    std::uint32_t material = 0, model = 0, plane = 0, chart = UINT32_MAX, probe = UINT32_MAX;
    std::uint32_t first_triangle = 0, triangle_count = 0; // faces own consecutive runs, in order
    bool drawn = true, sky = false, two_sided = false, blocks_light = true;
    Float3 tangent{}, bitangent{}, normal{};
    Double3 u_axis{}, v_axis{}; // texel = dot(x, axis) / scale + shift
    double u_scale = 1, v_scale = 1, u_shift = 0, v_shift = 0;
    bool curved = false; // its triangles lie in many planes; their corners are in LevelContent::curve_corners
    std::int32_t source_entity = -1, source_brush = -1, source_side = -1, source_line = 0;
    bool no_dynamic_shadow = false;
    std::uint32_t source_file = 0;
};
struct ChartInfo {
    Double3 origin{}, s{}, t{}; // s, t at right angles; shorter than 1 where texels are larger than luxel_size
    float luxel_size = 16;
    std::uint32_t width = 0, height = 0; // texels with gutter
    bool directional = false, smooth = false;
    Float3 tangent{}, bitangent{}, normal{}; // RNM frame
    float error = 0;                         // estimated relative error, 0: unknown
};
struct LocalLight {
    std::uint8_t kind = 0, falloff = 0;
    Double3 position{}, direction{};
    Float3 intensity{};
    double constant = 0, linear = 0, quadratic = 1, range = 0, fade_start = 0, fade_end = 0;
    double cos_inner = 1, cos_outer = 1, exponent = 1, angular_radius_rad = 0, angle_scale = 1;
    std::uint32_t style = 0;
    std::int32_t entity = -1, line = 0; // provenance
    std::uint32_t source_file = 0;
};
struct Cube {
    Float3 position{};
    std::array<Float3, 6> irradiance{};
    std::vector<std::uint32_t> local_lights;
};
struct CubeCell {
    Float3 lo{};
    float size = 0;
    std::array<std::uint32_t, 8> cubes{};
    std::uint8_t mask = 0;
    Float3 plane_normal{}; // with `beyond`: a wall through the cell
    double plane_distance = 0;
    std::uint32_t beyond = UINT32_MAX; // a later cell, for dot(plane_normal, p) > plane_distance
    std::uint32_t behind = UINT32_MAX; // with `beyond`: a later cell, for all else; none: this one
};
struct CubeGrid {
    Double3 origin{};
    float root_size = 0;
    std::array<std::uint32_t, 3> root_count{};
    std::vector<std::int32_t> tree;
    std::vector<CubeCell> cells;
    std::vector<Cube> cubes;
};
struct ProbeInfo {
    Float3 position{};
    std::int32_t entity = -1;
    std::uint32_t size = 0, mips = 0;
    bool boxed = false;
    Float3 box_lo{}, box_hi{};
    std::vector<Float3> texels; // mip, face, row, column
};
struct OverlayPiece { // convex, in the plane of its face, counter-clockwise seen from the front
    std::uint32_t face = 0;
    std::vector<Float3> points;
    std::vector<std::array<float, 2>> uv; // parallel; 0..1 is once the whole picture, v down
};
struct OverlayInfo {
    std::uint32_t kind = 0; // 0 overlay, 1 decal
    std::uint32_t material = 0;
    std::int32_t entity = -1, render_order = 0;
    float fade_min = -1, fade_max = -1; // map units; < 0: none
    std::vector<OverlayPiece> pieces;
};
struct EntityInfo {
    std::vector<std::pair<std::string, std::string>> keys;
    std::int32_t model = -1, source_id = -1, source_line = 0;
    std::uint32_t source_file = 0;
};
struct AreaPortalInfo {
    std::int32_t entity = -1;
    std::uint32_t brush = 0;
    std::array<std::uint32_t, 2> area{}; // ascending
    std::vector<Float3> polygon;         // counter-clockwise seen from area[0]
};
struct OccluderInfo {
    std::int32_t entity = -1;
    std::uint32_t area = 0;
    std::vector<std::vector<Float3>> polygons;
};
struct WaterInfo {
    std::uint8_t contents = 4;
    float surface_z = 0, min_z = 0;
    bool has_surface = true;
    std::uint32_t material = UINT32_MAX;
};

struct CurveCorner { // of a triangle of a curved face
    std::array<float, 2> luxel{}, uv{}; // luxel coordinates in the face's chart; repeats of the texture, v down
    float alpha = 0;                    // 0..1
};
struct Displacement { // (2^power + 1)^2 vertices, row by row
    std::uint32_t face = UINT32_MAX, model = 0, material = 0, plane = 0; // plane: of the base side
    std::uint32_t power = 2, flags = 0;                                  // flags: 2 no physics, 4 no hull, 8 no ray collision
    std::array<Double3, 4> base{};                                       // corners; vertex 0 is over the first, rows run towards the second
    std::vector<Float3> positions;
    std::vector<float> alphas;                      // 0..1; as many
    std::vector<std::array<float, 4>> multiblend;   // as many, or none
    std::vector<std::uint16_t> triangle_tags;       // 2 * 4^power, or none
    std::int32_t source_entity = -1, source_brush = -1, source_side = -1, source_line = 0;
    std::uint32_t source_file = 0;
};
struct CurvedPatch { // columns * rows vertices, row by row
    std::uint32_t face = UINT32_MAX, model = 0, material = 0, columns = 0, rows = 0;
    std::vector<Float3> positions;
    std::vector<std::array<float, 2>> uv;
    std::int32_t source_entity = -1, source_patch = -1, source_line = 0;
    std::uint32_t source_file = 0;
};

struct LevelContent {
    std::string source_name, compiler_version, options_json, input_hash, error_json; // no times, no paths
    std::uint8_t rnm_encoding = 0; // 0 dot, 1 sq, 2 tilted
    std::uint32_t plane_grid_bits = 0;
    std::vector<Plane> planes; // id ^ 1 faces the other way
    std::vector<Node> nodes;
    std::vector<Leaf> leaves;
    std::uint32_t cluster_count = 0;
    std::vector<std::uint64_t> vis_rows; // cluster_count * ceil(cluster_count/64)
    std::vector<std::uint64_t> shut_rows; // the same while area portals are shut; empty: none parts areas
    std::vector<Portal> portals;
    std::vector<Brush> brushes;
    std::uint32_t model_count = 1;
    std::vector<MaterialInfo> materials;
    std::vector<Double3> positions;
    std::vector<std::array<std::uint32_t, 3>> triangles; // grouped by face
    std::vector<std::array<Float3, 3>> corner_normals;
    std::vector<FaceInfo> faces;
    std::vector<std::array<CurveCorner, 3>> curve_corners; // of the triangles of curved faces, in their order
    std::vector<Displacement> displacements;
    std::vector<CurvedPatch> patches;
    std::vector<ChartInfo> charts;
    std::vector<std::uint32_t> chart_first_texel; // into flat, valid, texel_error
    std::vector<Float3> flat;                     // per texel
    std::vector<std::uint8_t> valid;              // per texel, or empty
    std::vector<float> texel_error;               // per texel, or empty
    std::vector<std::uint32_t> chart_first_rnm;   // into rnm; UINT32_MAX where flat only
    std::vector<std::array<Float3, 3>> rnm;
    std::vector<LocalLight> lights;
    CubeGrid cubes;
    std::vector<ProbeInfo> probes;
    std::vector<EntityInfo> entities;
    std::vector<AreaPortalInfo> area_portals;
    std::vector<OccluderInfo> occluders;
    std::vector<WaterInfo> waters;
    std::vector<std::uint32_t> leaf_water; // per leaf, UINT32_MAX: dry; may be empty where there is no water
    std::vector<float> leaf_water_distance; // per leaf, map units; infinite: sees none. Empty where there is no water
    std::vector<std::string> source_files;  // files that source_file 1, 2, ... are; 0 is the map itself
    std::vector<OverlayInfo> overlays;
};

struct WriteOptions {
    int zstd_level = 9;
    bool strip = false;         // drop provenance, texel quality, exact plane integers and the source's name
    int position_grid_bits = 8; // at most: mesh vertices are rounded to 2^-bits map units; fewer where exact
    bool rgb9e5 = true;         // flat and sq pages in 4 bytes a texel (0.2 % of the largest channel), else halfs
    std::uint32_t page_size = 1024; // largest width and height of an atlas page; a chart larger than this gets its own
    bool share_texels = true;   // charts of the same texels lie on one place
    // What make() gives, or what it gave for this key in an earlier write: of the same bytes, packed by the same version of the same library at the same
    // level. None: always made.
    std::function<std::vector<std::uint8_t>(std::uint64_t key, const std::function<std::vector<std::uint8_t>()>& make)> known = {};
};
// Throws std::invalid_argument where content contradicts itself, std::runtime_error where an encoder fails.
std::vector<std::uint8_t> write_level(const LevelContent& content, const WriteOptions& options = {});

} // namespace kiln::level

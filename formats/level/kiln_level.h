/* SPDX-License-Identifier: MIT
 *
 * Run-time loader of Kiln level files (.kiln), a C11 interface. The layout of the file is FORMAT.md.
 *
 * Space     world: right-handed, +z up, map units. Colours: linear RGB.
 * Memory    the bytes given to kiln_level_open_memory are borrowed (they may be a mapped file) and must outlive
 *           the level; everything the level hands out lives until kiln_level_close.
 * Loading   opening reads the directory only. Each lump is verified and decoded at its first use, once.
 * Threads   after opening, every function may be called from any number of threads at a time, except close.
 * Trust     none in the file: every length and index is checked before it is used. A damaged lump makes the
 *           functions that need it return an error, NULL or KILN_NO_INDEX; the other lumps stay usable.
 */
#ifndef KILN_LEVEL_H
#define KILN_LEVEL_H
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define KILN_NO_INDEX UINT32_MAX
#define KILN_FORMAT_VERSION 1

typedef struct kiln_level kiln_level;

typedef enum kiln_status {
    KILN_OK = 0,
    KILN_NONE = 1,         /* nothing is stored for what was asked; not a fault */
    KILN_BAD_ARGUMENT = 2, /* an index past the end, a null pointer */
    KILN_NOT_A_LEVEL = 3,  /* no "KILN" at the start */
    KILN_UNSUPPORTED = 4,  /* a version or codec this library does not know */
    KILN_DAMAGED = 5,      /* truncated, wrong checksum, or a length or index that cannot be */
    KILN_TOO_LARGE = 6,    /* claims more memory than the limits allow */
    KILN_NO_MEMORY = 7,
    KILN_MISSING = 8       /* the file has no such lump (it may have been stripped) */
} kiln_status;
const char* kiln_status_text(kiln_status status);

kiln_status kiln_level_open_memory(const void* bytes, size_t size, kiln_level** level);
void kiln_level_close(kiln_level* level); /* NULL is fine */

/* ---- Directory ------------------------------------------------------------------------------------------- */

typedef enum kiln_codec { KILN_CODEC_NONE = 0, KILN_CODEC_ZSTD = 1 } kiln_codec;
typedef struct kiln_lump {
    char name[5];   /* four characters and NUL */
    uint32_t index; /* number among lumps of that name (pages, probes) */
    uint32_t version, codec;
    uint64_t offset, stored_size, raw_size;
    uint64_t checksum; /* XXH3-64 of the stored bytes */
} kiln_lump;
size_t kiln_level_lump_count(const kiln_level* level);
kiln_status kiln_level_lump(const kiln_level* level, size_t i, kiln_lump* lump);
/* Verifies and decodes lump i now. `what` (may be NULL) gets a sentence about a fault, else "". Unknown lumps are
 * checked against their checksum only. */
kiln_status kiln_level_load(const kiln_level* level, size_t i, const char** what);
/* Loads all lumps; the first fault, or KILN_OK. */
kiln_status kiln_level_check(const kiln_level* level, const char** what);

typedef enum kiln_rnm_encoding { KILN_RNM_DOT = 0, KILN_RNM_SQ = 1, KILN_RNM_TILTED = 2 } kiln_rnm_encoding;
typedef struct kiln_info {
    uint32_t rnm_encoding;       /* kiln_rnm_encoding */
    uint32_t position_grid_bits; /* mesh vertices are multiples of 2^-bits map units */
    uint32_t plane_grid_bits;    /* exact planes hold over coordinates times 2^bits */
    uint32_t stripped;           /* 1: no provenance, no texel quality */
    uint32_t planes, nodes, leaves, clusters, portals, brushes, materials, models;
    uint32_t vertices, triangles, faces, charts, pages, lights, cubes, cube_cells, probes, entities;
    uint32_t degenerate_triangles; /* of no area on the position grid; left out by the writer */
    uint64_t texels;               /* of all charts, gutters included */
} kiln_info;
kiln_status kiln_level_info(const kiln_level* level, kiln_info* info);
/* JSON text: source, compiler version, options, input hash, error estimate. NUL-terminated; NULL: missing. */
const char* kiln_level_meta_json(const kiln_level* level, size_t* length);

/* ---- Geometry -------------------------------------------------------------------------------------------- */

typedef struct kiln_plane { /* id ^ 1 is the same plane facing the other way */
    double normal[3];        /* unit */
    double distance;         /* dot(normal, x) = distance, map units */
    int64_t exact_normal[3]; /* integers a, b, c of a*x + b*y + c*z = d, x in map units * 2^plane_grid_bits */
    int64_t exact_d_high;    /* d = high * 2^64 + low */
    uint64_t exact_d_low;
} kiln_plane;
typedef struct kiln_node {
    uint32_t plane;
    int32_t child[2]; /* front, behind; >= 0: node; < 0: leaf -(child + 1) */
    float lo[3], hi[3];
} kiln_node;
typedef struct kiln_leaf {
    uint32_t contents; /* 0 empty, 1 solid, 4 water, 5 slime, 6 lava; others: FORMAT.md */
    int32_t cluster;   /* -1: solid or outside */
    uint32_t area, probe; /* probe: KILN_NO_INDEX where none */
    float lo[3], hi[3];
    uint32_t first_brush, brush_count; /* into kiln_level_leaf_brushes */
    uint32_t first_face, face_count;   /* into kiln_level_leaf_faces */
} kiln_leaf;
typedef struct kiln_portal {
    int32_t leaf[2]; /* the plane's front looks to leaf[0]; counter-clockwise seen from there */
    uint32_t plane;
    uint32_t first_point, point_count; /* into kiln_level_portal_points, three floats each */
} kiln_portal;
typedef struct kiln_brush { /* inside = behind all its planes */
    uint32_t model, contents;
    uint32_t first_plane, plane_count; /* into kiln_level_brush_planes */
} kiln_brush;
typedef struct kiln_material {
    const char* name;
    const char* albedo_map; /* file name or "" */
    const char* normal_map;
    float reflectance[3], emission[3]; /* emission: radiance */
    float alpha, env_map, roughness;   /* env_map: share of the cubemap's reflection */
    uint32_t flags;                    /* FORMAT.md */
    uint32_t width, height;            /* texels, for texture coordinates */
} kiln_material;

/* A curved face (a displacement, a patch) is a grid of triangles in many planes: its normal and tangents are those on
 * the whole, its plane is that of its base side (of a patch: none of its own), its texture axes and its chart's axes hold
 * nowhere exactly. kiln_level_curve_corners says what holds at the corners of its triangles. */
enum { KILN_FACE_DRAWN = 1, KILN_FACE_SKY = 2, KILN_FACE_TWO_SIDED = 4, KILN_FACE_BLOCKS_LIGHT = 8, KILN_FACE_CURVED = 16 };
typedef struct kiln_face {
    uint32_t material, model, plane;
    uint32_t chart, probe;                    /* KILN_NO_INDEX: none */
    uint32_t first_triangle, triangle_count;
    uint32_t flags;
    float tangent[3], bitangent[3], normal[3]; /* of its texture; the bitangent keeps mirroring */
    double u_axis[3], v_axis[3], u_scale, v_scale, u_shift, v_shift; /* texel = dot(x, axis) / scale + shift */
} kiln_face;
/* A luxel grid; texel (i,j) is centred at luxel coordinate (i + .5, j + .5). Where light varies little it is coarser than the map
 * asks for, along each axis by itself: s and t are at right angles, and shorter than 1 by as much. No place of a face reads
 * a texel beyond the grid. Charts of the same texels may share them: they have the same page, page_x and page_y. */
typedef struct kiln_chart {
    double origin[3], s[3], t[3]; /* luxel coordinates of x: dot(x - origin, s) / luxel_size, the same with t;
                                     not of curved faces. A texel is luxel_size / |s| map units wide */
    float luxel_size;             /* map units: the finest, as the map asks for */
    uint32_t width, height;       /* texels, gutter included */
    uint32_t directional;         /* 1: three layers; 0: irradiance for the flat normal only */
    uint32_t smooth;              /* 1: the RNM frame follows the interpolated normal, see FORMAT.md */
    uint32_t page, page_x, page_y;
    float tangent[3], bitangent[3], normal[3]; /* RNM frame */
    float error;                  /* estimated relative error of the bake, 0: unknown */
} kiln_chart;

typedef struct kiln_curve_corner { /* of a triangle of a curved face; linear in between */
    float luxel[2];                /* luxel coordinates in the face's chart */
    float uv[2];                   /* texture coordinates (1 = one repetition, v down) */
    float alpha;                   /* 0..1, of a displacement's blend */
} kiln_curve_corner;
/* A displacement: (2^power + 1)^2 vertices, row by row from the base corner 0; in a row towards base corner 1, rows
 * towards base corner 3 (counter-clockwise seen from the front). Quad (row, column) is two triangles; the diagonal joins
 * the corners whose row + column is even. Neighbours share border vertices to the last bit where they are as fine; a
 * finer one has further vertices on the edges of the coarser one. Its brush is not among the brushes: this grid is what
 * things collide with. Triangle 2 * (row * 2^power + column) + k, k = 0: the one of the quad that has both its corners of
 * `column`; k = 1: both of `column` + 1. */
typedef struct kiln_displacement {
    uint32_t face;                  /* KILN_NO_INDEX: not drawn */
    uint32_t model, material, plane; /* plane: of the base side */
    uint32_t power;                 /* 2..4 */
    uint32_t flags;                 /* of the map: 2 no physics, 4 no hull collision, 8 no ray collision */
    double base[12];                /* four corners */
    uint32_t first_vertex, vertex_count; /* into kiln_level_displacement_vertices */
    uint32_t first_blend, blend_count;   /* into kiln_level_displacement_blends; as many as vertices or none */
    uint32_t first_tag, tag_count;       /* into kiln_level_displacement_tags; of each triangle, or none */
} kiln_displacement;
typedef struct kiln_curved_patch { /* columns * rows vertices, row by row; cross(along a row, from row to row): front */
    uint32_t face;                 /* KILN_NO_INDEX: not drawn */
    uint32_t model, material, columns, rows;
    uint32_t first_vertex, vertex_count; /* into kiln_level_patch_vertices */
} kiln_curved_patch;

const kiln_plane* kiln_level_planes(const kiln_level* level, size_t* count);
const kiln_node* kiln_level_nodes(const kiln_level* level, size_t* count);
const kiln_leaf* kiln_level_leaves(const kiln_level* level, size_t* count);
const uint32_t* kiln_level_leaf_brushes(const kiln_level* level, size_t* count);
const uint32_t* kiln_level_leaf_faces(const kiln_level* level, size_t* count);
const kiln_portal* kiln_level_portals(const kiln_level* level, size_t* count);
const float* kiln_level_portal_points(const kiln_level* level, size_t* point_count);
const kiln_brush* kiln_level_brushes(const kiln_level* level, size_t* count);
const uint32_t* kiln_level_brush_planes(const kiln_level* level, size_t* count);
const kiln_material* kiln_level_materials(const kiln_level* level, size_t* count);
const kiln_face* kiln_level_faces(const kiln_level* level, size_t* count);
const kiln_chart* kiln_level_charts(const kiln_level* level, size_t* count);
/* The render mesh: vertices shared between faces. Triangles are counter-clockwise from the front, grouped by face. */
const int32_t* kiln_level_grid_positions(const kiln_level* level, size_t* vertex_count); /* * 2^-position_grid_bits */
const float* kiln_level_positions(const kiln_level* level, size_t* vertex_count);
const uint32_t* kiln_level_triangles(const kiln_level* level, size_t* triangle_count);
const float* kiln_level_corner_normals(const kiln_level* level, size_t* triangle_count); /* nine floats each */

/* ---- What the game does with space: area portals, occluders, water. Each NULL and 0 where the level has none. */

typedef struct kiln_area_portal { /* one func_areaportal brush */
    int32_t entity;
    uint32_t brush;
    uint32_t area[2];                  /* ascending; equal or 0: it parts no two areas and is to be treated as open */
    uint32_t first_point, point_count; /* into kiln_level_area_portal_points: convex, counter-clockwise seen from area[0] */
} kiln_area_portal;
typedef struct kiln_occluder { /* one func_occluder: what lies behind one of its polygons is hidden */
    int32_t entity;
    uint32_t area; /* that holds it; 0: none, or several */
    uint32_t first_polygon, polygon_count;
} kiln_occluder;
typedef struct kiln_occluder_polygon { /* convex, counter-clockwise seen from its front: from there it hides what lies behind */
    uint32_t first_point, point_count;
} kiln_occluder_polygon;
typedef struct kiln_water { /* liquid that hangs together under one surface */
    uint32_t contents;       /* 4 water, 5 slime, 6 lava */
    float surface_z, min_z;
    uint32_t has_surface;    /* 0: it fills its room; surface_z is its highest point */
    uint32_t material;       /* of the surface; KILN_NO_INDEX: none */
} kiln_water;
const kiln_area_portal* kiln_level_area_portals(const kiln_level* level, size_t* count);
const float* kiln_level_area_portal_points(const kiln_level* level, size_t* point_count); /* three floats each */
const kiln_occluder* kiln_level_occluders(const kiln_level* level, size_t* count);
const kiln_occluder_polygon* kiln_level_occluder_polygons(const kiln_level* level, size_t* count);
const float* kiln_level_occluder_points(const kiln_level* level, size_t* point_count);
const kiln_water* kiln_level_waters(const kiln_level* level, size_t* count);
const uint32_t* kiln_level_leaf_waters(const kiln_level* level, size_t* leaf_count); /* per leaf; KILN_NO_INDEX: dry */
/* Per leaf: map units from its box to the nearest surface of a liquid that may be seen from its cluster (of both, the boxes:
 * never more than the true distance); 0 in the liquid and at its surface, INFINITY where none may be seen, so that whether a
 * leaf sees any needs no look at the PVS. NULL where the level has no liquid, or is of an older compiler. */
const float* kiln_level_leaf_water_distances(const kiln_level* level, size_t* leaf_count);
/* Per brush, what it stops: 1 players, 2 NPCs, 4 bullets, 8 sight. NULL in levels of older compilers. */
enum { KILN_BLOCKS_PLAYERS = 1, KILN_BLOCKS_NPCS = 2, KILN_BLOCKS_BULLETS = 4, KILN_BLOCKS_SIGHT = 8 };
const uint8_t* kiln_level_brush_blocks(const kiln_level* level, size_t* count);
/* Per face, 1: shadows of moving things do not fall on it. NULL: on no face so. */
const uint8_t* kiln_level_face_no_dynamic_shadow(const kiln_level* level, size_t* count);
/* Displacements and patches; NULL with a count of 0 where the level has none. */
const kiln_displacement* kiln_level_displacements(const kiln_level* level, size_t* count);
const float* kiln_level_displacement_vertices(const kiln_level* level, size_t* count);  /* x y z alpha each */
const float* kiln_level_displacement_blends(const kiln_level* level, size_t* count);    /* four weights each */
const uint16_t* kiln_level_displacement_tags(const kiln_level* level, size_t* count);
const kiln_curved_patch* kiln_level_curved_patches(const kiln_level* level, size_t* count);
const float* kiln_level_patch_vertices(const kiln_level* level, size_t* count); /* x y z u v each */
/* Corners of the triangles of a curved face, three each; NULL: the face is not curved, or they are missing. */
const kiln_curve_corner* kiln_level_curve_corners(const kiln_level* level, uint32_t face, size_t* triangle_count);
/* Which triangle of a face a point lies on, with the weights of its corners (they sum to 1): of a curved face the
 * nearest one (all are looked at), else the one it is least outside of. KILN_NO_INDEX: none has area. */
uint32_t kiln_level_triangle_at(const kiln_level* level, uint32_t face, const double point[3], double weights[3]);

/* Which leaf holds a point (on a plane: the front one); KILN_NO_INDEX where there is no tree. */
uint32_t kiln_level_find_leaf(const kiln_level* level, const double point[3]);
/* One bit a cluster, 64 a word; NULL for clusters that are none. The row stays valid until close. */
const uint64_t* kiln_level_pvs_row(const kiln_level* level, int32_t cluster, size_t* words);
/* The same into the caller's memory, decompressing one block of rows only. */
kiln_status kiln_level_read_pvs_row(const kiln_level* level, int32_t cluster, uint64_t* row, size_t words);
/* The same while all area portals around the cluster's area are shut: clusters of that area, and the leaves of those portals.
 * Held in the PVS row. The PVS row itself for clusters in no area or in several, and in levels without area portals or of older
 * compilers. */
kiln_status kiln_level_read_shut_row(const kiln_level* level, int32_t cluster, uint64_t* row, size_t words);
/* The same with some open, a byte for each of kiln_level_area_portals, 0: shut: the shut row while none that leads out of the
 * cluster's area is open, else what of the PVS row lies in areas that open ones lead to, one after the other. */
kiln_status kiln_level_read_door_row(const kiln_level* level, int32_t cluster, const uint8_t* open, uint64_t* row, size_t words);
/* Potentially audible: what is seen by something that the cluster sees, its own PVS included. Put together from the
 * rows of the PVS; nothing more is stored. */
kiln_status kiln_level_read_pas_row(const kiln_level* level, int32_t cluster, uint64_t* row, size_t words);
int kiln_level_cluster_visible(const kiln_level* level, int32_t from, int32_t to); /* 1, 0; -1 as one: 0 */
/* Texture coordinates (1 = one repetition of the image, v down). */
kiln_status kiln_level_texture_uv(const kiln_level* level, uint32_t face, const double point[3], double uv[2]);
/* Interpolated normal of the face's mesh at a point on it. */
kiln_status kiln_level_shading_normal(const kiln_level* level, uint32_t face, const double point[3],
                                      float normal[3]);
/* Tangent frame (t, b, n) of a face around a shading normal: Gram-Schmidt of the face's own, mirroring kept. */
kiln_status kiln_level_tangent_frame(const kiln_level* level, uint32_t face, const float shading_normal[3],
                                     float t[3], float b[3], float n[3]);
/* The same at a point: on curved faces the tangents are those of the triangle there, along its texture coordinates. */
kiln_status kiln_level_tangent_frame_at(const kiln_level* level, uint32_t face, const double point[3],
                                        const float shading_normal[3], float t[3], float b[3], float n[3]);

/* ---- Collision -------------------------------------------------------------------------------------------- */

/* What a brush lacks, beside its own planes, for boxes to be swept against it: planes that touch it in a corner or along
 * an edge. Every own plane and bevel moved outwards by the reach of a box, sum of |normal[k]| * half size [k], bounds
 * exactly the places where the box meets the brush. Axial ones come first, in the order -x +x -y +y -z +z; with the brush's
 * own there is one each way. Then those of edges. NULL where there are none (a box) or the level has none. */
typedef struct kiln_bevel {
    double normal[3]; /* unit */
    double distance;  /* dot(normal, x) <= distance on all of the brush */
} kiln_bevel;
const kiln_bevel* kiln_level_brush_bevels(const kiln_level* level, uint32_t brush, size_t* count);

/* What a trace looks for: the brushes of some contents and, where any KILN_FOR_ bit is set, of those only the ones that
 * stop one of these (kiln_level_brush_blocks; of levels without, what their contents usually stop). Displacements and patches
 * are looked for as a brush of their material would be: solid, detail, window, grate or clip. Those of liquids, triggers and
 * the like stop nothing: a sheet holds no space. */
enum {
    KILN_CONTENTS_SOLID = 1 << 1,
    KILN_CONTENTS_DETAIL = 1 << 2, /* solid that does not seal */
    KILN_CONTENTS_WINDOW = 1 << 3,
    KILN_CONTENTS_WATER = 1 << 4,
    KILN_CONTENTS_SLIME = 1 << 5,
    KILN_CONTENTS_LAVA = 1 << 6,
    KILN_CONTENTS_AREA_PORTAL = 1 << 7,
    KILN_CONTENTS_HINT = 1 << 8,
    KILN_CONTENTS_CLIP = 1 << 9,
    KILN_CONTENTS_TRIGGER = 1 << 10,
    KILN_CONTENTS_GRATE = 1 << 11,

    KILN_FOR_PLAYERS = 1 << 24, /* KILN_BLOCKS_PLAYERS << 24 */
    KILN_FOR_NPCS = 1 << 25,
    KILN_FOR_BULLETS = 1 << 26,
    KILN_FOR_SIGHT = 1 << 27,

    KILN_MASK_LIQUID = KILN_CONTENTS_WATER | KILN_CONTENTS_SLIME | KILN_CONTENTS_LAVA,
    KILN_MASK_HARD = KILN_CONTENTS_SOLID | KILN_CONTENTS_DETAIL | KILN_CONTENTS_WINDOW | KILN_CONTENTS_GRATE | KILN_CONTENTS_CLIP,
    KILN_MASK_PLAYERS = KILN_MASK_HARD | KILN_FOR_PLAYERS,
    KILN_MASK_NPCS = KILN_MASK_HARD | KILN_FOR_NPCS,
    KILN_MASK_BULLETS = KILN_MASK_HARD | KILN_FOR_BULLETS,
    KILN_MASK_SIGHT = KILN_MASK_HARD | KILN_FOR_SIGHT
};

/* A box that stops keeps this far from the plane it met, map units, or where it was if that was nearer. */
#define KILN_TRACE_DISTANCE 0.03125

typedef struct kiln_trace {
    double fraction;      /* of the way that is free: 0..1; 1: nothing is in the way */
    double end[3];        /* start + fraction * (end - start); exactly `end` where fraction is 1, `start` where it is 0 */
    double normal[3];     /* of the plane that stopped it, unit, away from the brush; zeros where none did */
    double distance;      /* of that plane of the brush (not moved by the box): dot(normal, x) = distance */
    uint32_t contents;    /* KILN_CONTENTS_ bit of `brush`, `displacement` or `patch`; 0: none */
    uint32_t brush;       /* that stopped it, else one it started in; KILN_NO_INDEX: none, or one of the next */
    uint32_t side;        /* the own plane of the brush, into kiln_level_brush_planes; KILN_NO_INDEX: a bevel, or none */
    uint32_t start_solid; /* 1: it starts inside a brush. The trace lets it out and stops at others; or across a sheet, below */
    uint32_t all_solid;   /* 1: it starts and ends inside one brush; fraction is 0 */
    uint32_t displacement; /* that stopped it, else one it started across; KILN_NO_INDEX: none */
    uint32_t patch;        /* the same */
    uint32_t triangle;     /* of it, numbered as those of displacements; KILN_NO_INDEX: none */
    uint32_t tag;          /* of that triangle; 0: none */
} kiln_trace;

/* Moves the box [x + mins, x + maxs], x from `start` to `end`, through the world. A ray is a box of no size.
 *
 * It stops before the first brush or sheet in its way, KILN_TRACE_DISTANCE from the plane met, measured along that plane's
 * normal; boxes that pass a brush without coming nearer than half of that are not stopped by it, so that sliding along a
 * surface, as a box does after its motion was clipped to `normal`, goes on however many steps it takes. Neither tunnels:
 * the whole way is swept, whatever its length. Of brushes met at once the lowest counts, then displacements, then patches.
 * Placed by hand, a box may touch a brush, or reach 1/1024 of a unit into it: it may slide along or leave, and is stopped
 * at once where it moves closer.
 *
 * Displacements and patches are sheets of triangles that stop from both sides, by the same distances; `normal` looks to the
 * side the box is on. A displacement's flags 4 and 8 leave it out for boxes and rays. A sheet has no inside: a box that
 * starts across one (more than 1/1024 deep) has start_solid set and may move along the triangle or away, to the side its
 * centre is on; into it or through, it is stopped at once, fraction 0 and normal to that side, all_solid 0, so that it slides
 * out and never falls through. all_solid is set where it does not move at all.
 *
 * KILN_BAD_ARGUMENT: a coordinate beyond +-2^24 or not a number, mins > maxs. KILN_MISSING: the level has no bevels (it
 * was written before there were any) and the box has a size. */
kiln_status kiln_trace_box(const kiln_level* level, const double start[3], const double end[3], const double mins[3],
                           const double maxs[3], uint32_t mask, kiln_trace* trace);
/* The same against the brushes of one model alone, moved to `origin` (zeros: where it was drawn; 0: the world's
 * model, without its tree). Where it has turned as well: kiln_trace_posed_model. Brushes of triggers are looked for with
 * KILN_CONTENTS_TRIGGER. */
kiln_status kiln_trace_model(const kiln_level* level, uint32_t model, const double origin[3], const double start[3],
                             const double end[3], const double mins[3], const double maxs[3], uint32_t mask,
                             kiln_trace* trace);
/* KILN_CONTENTS_ bits of all brushes of the world that hold the point, faces included; 0: air, or the void. Sheets hold none. */
kiln_status kiln_point_contents(const kiln_level* level, const double point[3], uint32_t* contents);
kiln_status kiln_model_point_contents(const kiln_level* level, uint32_t model, const double origin[3],
                                      const double point[3], uint32_t* contents);

/* Where a model stands that has turned: what was drawn at x is at origin + pivot + turn (x - pivot). */
typedef struct kiln_pose {
    double pivot[3];   /* what it turns about, where that was drawn: the entity's key "origin" (of an origin brush, its middle) */
    double origin[3];  /* how far it has moved besides; zeros: not at all */
    double turn[3][3]; /* turn[k]: where the k-th axis points now; unit, at right angles, not mirrored */
} kiln_pose;
/* The turn of an `angles` key, degrees: pitch (forward goes down), yaw (forward goes left), roll (left goes up). */
void kiln_turn_from_angles(const double angles[3], double turn[3][3]);
/* kiln_trace_model against the model in its pose. The box stays upright and the result is exact for it as well: what the box
 * and a turned brush need to be kept apart (the brush's sides, the box's, each edge of one along each of the other) is
 * worked out as it goes, which takes some ten times as long a brush. `side` is KILN_NO_INDEX for all but the brush's own.
 * KILN_BAD_ARGUMENT too where `turn` is no rotation. */
kiln_status kiln_trace_posed_model(const kiln_level* level, uint32_t model, const kiln_pose* pose, const double start[3],
                                   const double end[3], const double mins[3], const double maxs[3], uint32_t mask,
                                   kiln_trace* trace);
kiln_status kiln_posed_model_point_contents(const kiln_level* level, uint32_t model, const kiln_pose* pose,
                                            const double point[3], uint32_t* contents);

/* ---- Overlays and decals: pictures laid over faces -------------------------------------------------------- */

typedef struct kiln_overlay {
    uint32_t kind; /* 0 overlay (info_overlay), 1 decal */
    uint32_t material;
    int32_t entity;             /* it was drawn as; -1: unknown */
    int32_t render_order;       /* higher ones lie on lower ones */
    float fade_min, fade_max;   /* map units from the eye; < 0: never fades */
    uint32_t first_fragment, fragment_count; /* into kiln_level_overlay_fragments; 0: it hits no face */
} kiln_overlay;
typedef struct kiln_overlay_fragment { /* convex, in the plane of its face, counter-clockwise seen from the front */
    uint32_t face;                     /* its lightmap, model and clusters are the fragment's */
    uint32_t first_point, point_count; /* into kiln_level_overlay_points; at least three */
} kiln_overlay_fragment;
typedef struct kiln_overlay_point {
    float position[3];
    float uv[2]; /* 0..1 is once the whole picture of the material, v down */
} kiln_overlay_point;
const kiln_overlay* kiln_level_overlays(const kiln_level* level, size_t* count);
const kiln_overlay_fragment* kiln_level_overlay_fragments(const kiln_level* level, size_t* count);
const kiln_overlay_point* kiln_level_overlay_points(const kiln_level* level, size_t* count);

/* ---- Light on surfaces: irradiance E; a diffuse surface shows albedo / pi * E ------------------------------- */

typedef enum kiln_texel_format { KILN_TEXEL_HALF3 = 0, KILN_TEXEL_RGB9E5 = 1 } kiln_texel_format;
typedef struct kiln_page {
    uint32_t width, height, layers; /* layers: 1 flat; 3 RNM; 4 RNM and flat (tilted encoding) */
    uint32_t format;                /* kiln_texel_format */
    float scale;                    /* value = texel * scale */
    const void* texels;             /* layer, row, column; three halfs or one word each; NULL: not loaded */
    size_t size;                    /* bytes */
} kiln_page;
kiln_status kiln_level_page_info(const kiln_level* level, uint32_t page, kiln_page* info); /* texels stay NULL */
kiln_status kiln_level_page(const kiln_level* level, uint32_t page, kiln_page* out);
/* One texel of a layer, decoded. */
kiln_status kiln_level_page_texel(const kiln_level* level, uint32_t page, uint32_t layer, uint32_t x, uint32_t y,
                                  float rgb[3]);
/* Validity (0 outside any face, 1 baked, 2 filled from neighbours) and relative standard error of each texel of a
 * page, row by row; either may be NULL. KILN_MISSING where the level was stripped. */
kiln_status kiln_level_page_quality(const kiln_level* level, uint32_t page, uint8_t* valid, float* error);

/* Irradiance for the flat normal, bilinear. KILN_NONE: the face has no lightmap. */
kiln_status kiln_level_eval_flat(const kiln_level* level, uint32_t face, const double point[3], float rgb[3]);
/* Irradiance for a normal in world space by the run-time formula of the level's encoding. */
kiln_status kiln_level_eval_rnm(const kiln_level* level, uint32_t face, const double point[3],
                                const float world_normal[3], float rgb[3]);
/* The same with the normal in the tangent frame (what a normal map stores). */
kiln_status kiln_level_eval_rnm_local(const kiln_level* level, uint32_t face, const double point[3],
                                      const float local_normal[3], float rgb[3]);
/* The same at luxel coordinates of a chart. */
kiln_status kiln_level_eval_rnm_luxel(const kiln_level* level, uint32_t chart, double s, double t,
                                      const float local_normal[3], float rgb[3]);
/* Irradiance for the flat normal at luxel coordinates of a chart. */
kiln_status kiln_level_eval_flat_luxel(const kiln_level* level, uint32_t chart, double s, double t, float rgb[3]);
/* Luxel coordinates of a point on a face. KILN_NONE: the face has no lightmap. */
kiln_status kiln_level_luxel_at(const kiln_level* level, uint32_t face, const double point[3], double st[2]);
/* The formula alone: three stored vectors and a unit normal in the tangent frame. */
void kiln_rnm_formula(kiln_rnm_encoding encoding, const float stored[3][3], const float local_normal[3],
                      float rgb[3]);

/* ---- Light in the air ------------------------------------------------------------------------------------ */

typedef struct kiln_light {
    uint32_t kind;    /* 0 point, 1 spot, 2 sun, 3 sky */
    uint32_t falloff; /* 0: 1/(constant + linear d + quadratic d^2); 1: max(0, 1 - d/range); 2: none */
    double position[3], direction[3];
    float intensity[3];
    double constant_attn, linear_attn, quadratic_attn, range, fade_start, fade_end;
    double cos_inner, cos_outer, exponent;
    double angular_radius_rad; /* sun: of its disc */
    double angle_scale;        /* cos -> 1 - scale + scale * cos */
    uint32_t style;
} kiln_light;
typedef struct kiln_cube {
    float position[3];
    float irradiance[6][3];            /* +x -x +y -y +z -z */
    uint32_t first_light, light_count; /* into kiln_level_cube_lights: lights that are not in the cube */
} kiln_cube;
typedef struct kiln_cube_cell {
    float lo[3], size;
    uint32_t cubes[8]; /* corner x + 2y + 4z; KILN_NO_INDEX: none */
    uint32_t mask;     /* bit c: the cell's air may use corner c */
    float plane_normal[3]; /* a wall through the cell: */
    double plane_distance;
    uint32_t beyond;   /* the cell for dot(plane_normal, p) > plane_distance; KILN_NO_INDEX: this one is all. For all else
                        * see kiln_level_cube_behind */
} kiln_cube_cell;
typedef struct kiln_cube_tree {
    double origin[3];
    float root_size;
    uint32_t root_count[3];
    const int32_t* nodes; /* roots first, x fastest; >= 0: first of 8 children; < 0: -(cell + 1); INT32_MIN: no air */
    size_t node_count;
} kiln_cube_tree;
typedef struct kiln_light_weight { uint32_t light; float weight; } kiln_light_weight;

const kiln_light* kiln_level_lights(const kiln_level* level, size_t* count);
const kiln_cube* kiln_level_cubes(const kiln_level* level, size_t* count);
const kiln_cube_cell* kiln_level_cube_cells(const kiln_level* level, size_t* count);
/* Per cell: with `beyond`, the cell for dot(plane_normal, p) <= plane_distance, which may have a wall of its own;
 * KILN_NO_INDEX: this one. NULL: of every cell this one, as in levels of older compilers. Who does not ask gets a cell of
 * the same place, but where several walls meet perhaps the light of another side of them. */
const uint32_t* kiln_level_cube_behind(const kiln_level* level, size_t* cell_count);
const uint32_t* kiln_level_cube_lights(const kiln_level* level, size_t* count);
kiln_status kiln_level_cube_tree(const kiln_level* level, kiln_cube_tree* tree);
/* Ambient cube at a point: usable corners of its cell, trilinear. KILN_NONE: no air there. */
kiln_status kiln_level_ambient(const kiln_level* level, const double point[3], float rgb[6][3]);
/* Irradiance at a point for a unit normal: max(0, sum of n_a^2 c[a, n_a < 0]). */
kiln_status kiln_level_ambient_eval(const kiln_level* level, const double point[3], const float normal[3],
                                    float rgb[3]);
/* Lights to add to the cube of a point, each with its share 0..1; at most `capacity` are written, *count is how many
 * there are (never more than 8 * the most lights of a cube). */
kiln_status kiln_level_ambient_lights(const kiln_level* level, const double point[3], kiln_light_weight* out,
                                      size_t capacity, size_t* count);

/* ---- Reflections ----------------------------------------------------------------------------------------- */

typedef struct kiln_probe {
    float position[3];
    int32_t entity;      /* -1: the level's default probe */
    uint32_t size, mips; /* texels along an edge of mip 0; mip m is filtered for roughness m / (mips - 1) */
    uint32_t boxed;      /* 1: box_lo, box_hi is its parallax box */
    float box_lo[3], box_hi[3];
} kiln_probe;
const kiln_probe* kiln_level_probes(const kiln_level* level, size_t* count);
/* RGB9E5 texels, value = decoded * *scale: mip, face (+x -x +y -y +z -z), row, column. */
const uint32_t* kiln_level_probe_texels(const kiln_level* level, uint32_t probe, size_t* count, float* scale);
uint32_t kiln_level_nearest_cubemap(const kiln_level* level, const double point[3]); /* of its leaf, else by distance */
/* Linear radiance, filtered across edges and between mips. The direction need not be unit. */
kiln_status kiln_level_sample_cubemap(const kiln_level* level, uint32_t probe, const float direction[3],
                                      float roughness, float rgb[3]);
/* The direction in which a probe with a box shows what a ray from `point` along `direction` would meet. */
kiln_status kiln_level_parallax_direction(const kiln_level* level, uint32_t probe, const double point[3],
                                          const float direction[3], float corrected[3]);
/* Orientation of the six faces; u right, v down, in [-1,1]; the direction is not normalised. */
void kiln_cube_direction(int face, float u, float v, float direction[3]);

/* ---- Entities and where things came from ------------------------------------------------------------------ */

size_t kiln_level_entity_key_count(const kiln_level* level, uint32_t entity);
kiln_status kiln_level_entity_key(const kiln_level* level, uint32_t entity, size_t i, const char** key,
                                  const char** value);
/* First value of a key (exact spelling); NULL where there is none. */
const char* kiln_level_entity_value(const kiln_level* level, uint32_t entity, const char* key);
int32_t kiln_level_entity_model(const kiln_level* level, uint32_t entity); /* -1: none */

typedef struct kiln_source { int32_t entity, brush, side, line; } kiln_source; /* ids of the map file; -1, 0: unknown */
/* KILN_MISSING where the level was stripped. */
kiln_status kiln_level_face_source(const kiln_level* level, uint32_t face, kiln_source* source);
kiln_status kiln_level_brush_source(const kiln_level* level, uint32_t brush, kiln_source* source);
kiln_status kiln_level_brush_side_source(const kiln_level* level, uint32_t brush_plane, int32_t* side);
kiln_status kiln_level_displacement_source(const kiln_level* level, uint32_t displacement, kiln_source* source);
kiln_status kiln_level_patch_source(const kiln_level* level, uint32_t patch, kiln_source* source); /* brush: its id */
kiln_status kiln_level_entity_source(const kiln_level* level, uint32_t entity, kiln_source* source);
kiln_status kiln_level_light_source(const kiln_level* level, uint32_t light, kiln_source* source);
/* The file those ids and lines are of, relative to the map's directory: "" for the map itself (`source` of the meta JSON), else an
 * instance's, a prefab's. KILN_MISSING where the level was stripped. */
kiln_status kiln_level_face_file(const kiln_level* level, uint32_t face, const char** file);
kiln_status kiln_level_brush_file(const kiln_level* level, uint32_t brush, const char** file);
kiln_status kiln_level_entity_file(const kiln_level* level, uint32_t entity, const char** file);
kiln_status kiln_level_light_file(const kiln_level* level, uint32_t light, const char** file);
kiln_status kiln_level_displacement_file(const kiln_level* level, uint32_t displacement, const char** file);
kiln_status kiln_level_patch_file(const kiln_level* level, uint32_t patch, const char** file);

/* ---- Number formats -------------------------------------------------------------------------------------- */
float kiln_half_to_float(uint16_t half);
void kiln_rgb9e5_to_float(uint32_t packed, float rgb[3]);

#ifdef __cplusplus
}
#endif
#endif

/* The header is C: this file is compiled as C11 and uses the library as an engine in C would. */
#include "formats/level/kiln_level.h"
#include <string.h>

/* 0: all as expected; otherwise the line. */
int kiln_c_api_test(const void* bytes, size_t size) {
    kiln_level* level = NULL;
    if (kiln_level_open_memory(bytes, size, &level) != KILN_OK) return __LINE__;
    if (kiln_level_check(level, NULL) != KILN_OK) return __LINE__;
    kiln_info info;
    if (kiln_level_info(level, &info) != KILN_OK || info.faces != 6) return __LINE__;
    size_t count = 0;
    const kiln_face* faces = kiln_level_faces(level, &count);
    if (!faces || count != 6 || faces[5].triangle_count != 2) return __LINE__;
    const kiln_material* materials = kiln_level_materials(level, &count);
    if (!materials || strcmp(materials[0].name, "white") != 0) return __LINE__;
    const double point[3] = {0, 0, -128};
    const float up[3] = {0, 0, 1};
    float rgb[3];
    if (kiln_level_eval_rnm(level, 5, point, up, rgb) != KILN_OK) return __LINE__;
    if (rgb[0] < 0.99f || rgb[0] > 1.01f) return __LINE__;
    const double air[3] = {1, 2, 3};
    if (kiln_level_find_leaf(level, air) != 0) return __LINE__;
    if (!kiln_level_cluster_visible(level, 0, 0)) return __LINE__;
    /* An empty room: its walls are leaves without brushes. */
    kiln_trace trace;
    const double end[3] = {50, 2, 3}, mins[3] = {-16, -16, 0}, maxs[3] = {16, 16, 72};
    if (kiln_trace_box(level, air, end, mins, maxs, KILN_MASK_PLAYERS, &trace) != KILN_OK) return __LINE__;
    if (trace.fraction != 1 || trace.brush != KILN_NO_INDEX || trace.end[0] != 50) return __LINE__;
    uint32_t contents = 1;
    if (kiln_point_contents(level, air, &contents) != KILN_OK || contents != 0) return __LINE__;
    if (!kiln_level_meta_json(level, NULL)) return __LINE__;
    if (strcmp(kiln_level_entity_value(level, 0, "classname"), "worldspawn") != 0) return __LINE__;
    kiln_level_close(level);
    kiln_level_close(NULL);
    return 0;
}

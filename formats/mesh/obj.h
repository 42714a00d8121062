// Wavefront OBJ, written. Polygons of any number of corners, named groups, materials by name.
//
// In       tables below
// Out      text; coordinates shortest round-trip, so that reading gives the same doubles
#pragma once
#include "libs/math/vec.h"
#include <array>
#include <map>
#include <string>
#include <vector>

namespace kiln {

struct ObjPolygon {
    std::string object, group, material; // written where they change; blanks become underscores. Groups may be several
                                         // names apart by a blank
    std::vector<Vec3> points;            // counter-clockwise from the front; equal points share a vertex of the file
    std::vector<Vec2> uv;                // empty, or one a point; v up, as OBJ has it
    std::vector<Vec3> normals;           // empty, or one a point
};
struct ObjMaterial {
    std::string name;
    Vec3f diffuse{0.5f, 0.5f, 0.5f}, emission{};
    float alpha = 1;
    std::string diffuse_map;
};
// `library`: the file name of the materials; empty: none is named.
std::string write_obj(const std::vector<ObjPolygon>& polygons, const std::string& library, const std::string& comment);
std::string write_mtl(const std::vector<ObjMaterial>& materials); // one a name; the first wins

} // namespace kiln

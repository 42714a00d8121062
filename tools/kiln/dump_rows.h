// Rows of `kiln dump`: an artefact as a list of objects, in the order of its ids; of a map's way, or of a level file.
#pragma once
#include "compiler/compile.h"
#include "formats/level/kiln_level.h"
#include <nlohmann/json.hpp>

namespace kiln {

using Json = nlohmann::ordered_json;
using Rows = std::vector<Json>;

template <class T> Json to_json(const Vec3T<T>& v) { return {v.x, v.y, v.z}; }
inline Json to_json(const Vec2& v) { return {v.x, v.y}; }
inline Json to_json(const Box3& b) { return b.empty() ? Json() : Json{to_json(b.lo), to_json(b.hi)}; }
template <class Tag> Json to_json(Index<Tag> i) { return i.valid() ? Json(i.value) : Json(); }
template <class T> Json list(const std::vector<T>& values) {
    Json j = Json::array();
    for (const T& v : values) {
        if constexpr (std::is_arithmetic_v<T>)
            j.push_back(v);
        else
            j.push_back(to_json(v));
    }
    return j;
}
const char* name(Contents contents);
// Null: the map itself. Others, of instances and prefabs, by where they lie beside it, as in a level.
Json file_of(const World& world, const SourceLocation& at);

Rows vis_rows(const Visibility& visibility); // vis.cpp: of each cluster what it sees, and while area portals are shut

struct Artefact {
    const char* name;
    Stage stage;
    Rows (*rows)(const Compiled&);
    // Keys whose numbers shift when something else changes, apart by blanks: left out by --for-diff.
    const char* running = "";
};
std::span<const Artefact> geometry_artefacts(); // dump_geometry.cpp

struct LevelArtefact {
    const char* name;
    Rows (*rows)(const kiln_level*);
    const char* running = "";
};
std::span<const LevelArtefact> level_artefacts(); // dump_level.cpp

} // namespace kiln

#include "formats/mesh/obj.h"
#include <charconv>
#include <cstring>
#include <set>

namespace kiln {
namespace {

template <class T> void number(std::string& out, T value) {
    char text[40];
    out += ' ';
    out.append(text, std::to_chars(text, text + sizeof text, value == 0 ? T(0) : value).ptr); // no -0: it would be another vertex
}
std::string word(const std::string& name, bool keep_blanks = false) {
    std::string out = name.empty() ? "none" : name;
    for (char& c : out)
        if (static_cast<unsigned char>(c) < 33 && !(keep_blanks && c == ' ')) c = '_';
    return out;
}

// Lines of one kind, each value once, numbered from 1.
template <std::size_t N> class Lines {
public:
    explicit Lines(const char* keyword) : keyword_(keyword) {}
    std::string text;
    std::size_t add(std::array<double, N> value) {
        for (double& x : value) x = x == 0 ? 0.0 : x;
        const auto [it, fresh] = index_.emplace(value, index_.size() + 1);
        if (fresh) {
            text += keyword_;
            for (const double x : value) number(text, x);
            text += '\n';
        }
        return it->second;
    }

private:
    const char* keyword_;
    std::map<std::array<double, N>, std::size_t> index_;
};

} // namespace

std::string write_obj(const std::vector<ObjPolygon>& polygons, const std::string& library, const std::string& comment) {
    Lines<3> points("v"), normals("vn");
    Lines<2> uvs("vt");
    std::string faces;
    const ObjPolygon* last = nullptr;
    for (const ObjPolygon& p : polygons) {
        if (!p.object.empty() && (!last || p.object != last->object)) faces += "o " + word(p.object) + "\n";
        if (!last || p.group != last->group || p.object != last->object) faces += "g " + word(p.group, true) + "\n";
        if (!last || p.material != last->material) faces += "usemtl " + word(p.material) + "\n";
        last = &p;
        faces += 'f';
        for (std::size_t i = 0; i < p.points.size(); ++i) {
            faces += ' ' + std::to_string(points.add({p.points[i].x, p.points[i].y, p.points[i].z}));
            if (p.uv.empty() && p.normals.empty()) continue;
            faces += '/';
            if (!p.uv.empty()) faces += std::to_string(uvs.add({p.uv[i].x, p.uv[i].y}));
            if (!p.normals.empty()) faces += '/' + std::to_string(normals.add({p.normals[i].x, p.normals[i].y, p.normals[i].z}));
        }
        faces += '\n';
    }
    return "# " + word(comment, true) + "\n" + (library.empty() ? "" : "mtllib " + word(library) + "\n") + points.text + uvs.text + normals.text + faces;
}

std::string write_mtl(const std::vector<ObjMaterial>& materials) {
    std::string out;
    std::set<std::string> seen;
    for (const ObjMaterial& m : materials) {
        if (!seen.insert(word(m.name)).second) continue;
        out += "newmtl " + word(m.name) + "\n";
        const auto colour = [&](const char* keyword, Vec3f c) {
            out += keyword;
            for (std::size_t k = 0; k < 3; ++k) number(out, c[k]);
            out += '\n';
        };
        colour("Kd", m.diffuse);
        if (max_component(m.emission) > 0) colour("Ke", m.emission);
        if (m.alpha < 1) out += "d", number(out, m.alpha), out += '\n';
        if (!m.diffuse_map.empty()) out += "map_Kd " + m.diffuse_map + "\n";
        out += '\n';
    }
    return out;
}

} // namespace kiln

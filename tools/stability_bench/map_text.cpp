#include "tools/stability_bench/map_text.h"
#include <cmath>
#include <fmt/format.h>

namespace kiln::bench {
namespace {

std::string number(double x) { // no exponents, ten decimals at most
    std::string s = fmt::format("{:.10f}", x);
    s.erase(s.find_last_not_of('0') + 1);
    if (s.back() == '.') s.pop_back();
    return s == "-0" ? "0" : s;
}
std::string numbers(Vec3 p) { return fmt::format("{} {} {}", number(p.x), number(p.y), number(p.z)); }

std::array<std::array<Vec3, 3>, 6> box_sides(Vec3 lo, Vec3 hi) {
    return {{
        {Vec3{lo.x, lo.y, lo.z}, {lo.x, hi.y, lo.z}, {lo.x, lo.y, hi.z}},
        {Vec3{hi.x, lo.y, lo.z}, {hi.x, lo.y, hi.z}, {hi.x, hi.y, lo.z}},
        {Vec3{lo.x, lo.y, lo.z}, {lo.x, lo.y, hi.z}, {hi.x, lo.y, lo.z}},
        {Vec3{lo.x, hi.y, lo.z}, {hi.x, hi.y, lo.z}, {lo.x, hi.y, hi.z}},
        {Vec3{lo.x, lo.y, lo.z}, {hi.x, lo.y, lo.z}, {lo.x, hi.y, lo.z}},
        {Vec3{lo.x, lo.y, hi.z}, {lo.x, hi.y, hi.z}, {hi.x, lo.y, hi.z}},
    }};
}

} // namespace

std::string MapText::material(const std::string& name, double reflectance, double emission) {
    if (!materials_.empty()) materials_ += ",\n";
    materials_ += fmt::format("\"{0}\": {{\"reflectance\": [{1:.9g}, {1:.9g}, {1:.9g}], \"emission\": [{2:.9g}, {2:.9g}, {2:.9g}]}}", name, reflectance, emission);
    return name;
}

void MapText::brush(std::span<const MapSide> sides, bool detail) {
    std::string solid = fmt::format("solid\n{{\n\"id\" \"{}\"\n", id_++);
    for (const MapSide& s : sides) {
        const Vec3 n = cross(s.points[2] - s.points[0], s.points[1] - s.points[0]);
        // Projected along the axis nearest to the normal, before it is turned: a turned map has the turned luxels.
        Vec3 u{1, 0, 0}, v{0, 0, -1};
        if (std::fabs(n.z) >= std::fabs(n.x) && std::fabs(n.z) >= std::fabs(n.y)) v = {0, -1, 0};
        else if (std::fabs(n.x) >= std::fabs(n.y)) u = {0, 1, 0};
        solid += fmt::format("side\n{{\n\"id\" \"{}\"\n\"plane\" \"({}) ({}) ({})\"\n\"material\" \"{}\"\n\"uaxis\" \"[{} 0] 0.25\"\n\"vaxis\" \"[{} 0] 0.25\"\n\"lightmapscale\" \"{}\"\n\"smoothing_groups\" \"{}\"\n}}\n",
                             id_++, numbers(placing.at(s.points[0])), numbers(placing.at(s.points[1])), numbers(placing.at(s.points[2])), s.material, numbers(placing.turned(u)), numbers(placing.turned(v)),
                             number(luxel * placing.scale), s.smoothing);
    }
    solid += "}\n";
    if (detail) entities_ += fmt::format("entity\n{{\n\"id\" \"{}\"\n\"classname\" \"func_detail\"\n{}}}\n", id_++, solid);
    else solids_ += solid;
}

void MapText::box(Vec3 lo, Vec3 hi, const std::array<std::string, 6>& materials, bool detail) {
    const auto points = box_sides(lo, hi);
    std::vector<MapSide> sides;
    for (std::size_t i = 0; i < 6; ++i) sides.push_back({points[i], materials[i]});
    brush(sides, detail);
}

void MapText::room(Vec3 lo, Vec3 hi, const std::array<std::string, 6>& inside, double thickness) {
    const Vec3 t{thickness, thickness, thickness};
    for (std::size_t k = 0; k < 3; ++k)
        for (const bool high : {false, true}) {
            Vec3 a = lo - t, b = hi + t;
            for (std::size_t j = 0; j < k; ++j) a[j] = lo[j], b[j] = hi[j]; // they abut
            (high ? a : b)[k] = high ? hi[k] : lo[k];
            box(a, b, inside[2 * k + high]);
        }
}

void MapText::hull(std::span<const Vec3> p, const std::string& material, bool detail) {
    std::vector<MapSide> sides;
    const std::size_t n = p.size();
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = i + 1; j < n; ++j)
            for (std::size_t k = j + 1; k < n; ++k) {
                const Vec3 normal = cross(p[j] - p[i], p[k] - p[i]);
                int side = 0;
                bool outer = true;
                for (std::size_t l = 0; l < n && outer; ++l) {
                    if (l == i || l == j || l == k) continue;
                    const int s = dot(normal, p[l] - p[i]) > 0 ? 1 : -1;
                    outer = side == 0 || s == side;
                    side = s;
                }
                if (!outer) continue;
                // Clockwise seen from outside: the rest lies where the cross product of the first two edges points.
                if (side > 0) sides.push_back({{p[i], p[j], p[k]}, material});
                else sides.push_back({{p[i], p[k], p[j]}, material});
            }
    brush(sides, detail);
}

void MapText::entity(const std::string& classname, Vec3 origin, const std::vector<std::pair<std::string, std::string>>& keys) {
    entities_ += fmt::format("entity\n{{\n\"id\" \"{}\"\n\"classname\" \"{}\"\n\"origin\" \"{}\"\n", id_++, classname, numbers(placing.at(origin)));
    for (const auto& [k, v] : keys) entities_ += fmt::format("\"{}\" \"{}\"\n", k, v);
    entities_ += "}\n";
}

CompileInput MapText::input() const {
    const auto bytes = [](const std::string& s) { return Bytes(s.begin(), s.end()); };
    CompileInput in;
    in.map = {"made.vmf", bytes(fmt::format("world\n{{\n\"id\" \"0\"\n\"classname\" \"worldspawn\"\n{}}}\n{}", solids_, entities_))};
    in.materials = {{"made.json", bytes(fmt::format("{{\"materials\": {{\n{}\n}}}}\n", materials_))}};
    return in;
}

Placing turned_about(Vec3 a, double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    Placing p;
    for (Vec3& e : p.axes) e = e * c + cross(a, e) * s + a * (dot(a, e) * (1 - c));
    return p;
}

} // namespace kiln::bench

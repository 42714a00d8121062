// Maps made in code, as the text of a VMF: they go through the same reader and stages as maps of files.
#pragma once
#include "compiler/compile.h"
#include <array>
#include <span>
#include <string>
#include <vector>

namespace kiln::bench {

// Where the map stands: world = offset + scale * (x.x * axes[0] + x.y * axes[1] + x.z * axes[2]).
struct Placing {
    std::array<Vec3, 3> axes{Vec3{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}; // orthonormal, right-handed
    double scale = 1;
    Vec3 offset{};
    Vec3 turned(Vec3 v) const { return axes[0] * v.x + axes[1] * v.y + axes[2] * v.z; }
    Vec3 at(Vec3 x) const { return turned(x) * scale + offset; }
    Vec3 back(Vec3 x) const {
        const Vec3 d = (x - offset) / scale;
        return {dot(d, axes[0]), dot(d, axes[1]), dot(d, axes[2])};
    }
};

struct MapSide {
    std::array<Vec3, 3> points; // clockwise seen from outside
    std::string material;
    std::uint32_t smoothing = 0; // groups
};

class MapText {
public:
    double luxel = 16; // of the brushes that come next
    Placing placing;   // of what comes next

    std::string material(const std::string& name, double reflectance, double emission = 0); // its name
    void brush(std::span<const MapSide> sides, bool detail = false);
    // Materials in the order -x +x -y +y -z +z.
    void box(Vec3 lo, Vec3 hi, const std::array<std::string, 6>& materials, bool detail = false);
    void box(Vec3 lo, Vec3 hi, const std::string& material, bool detail = false) { box(lo, hi, {material, material, material, material, material, material}, detail); }
    // Six walls about the open box; what they show inside, same order.
    void room(Vec3 lo, Vec3 hi, const std::array<std::string, 6>& inside, double thickness = 16);
    void room(Vec3 lo, Vec3 hi, const std::string& m, double thickness = 16) { room(lo, hi, {m, m, m, m, m, m}, thickness); }
    // The convex hull of points in general position: fine for a few of them.
    void hull(std::span<const Vec3> points, const std::string& material, bool detail = false);
    void entity(const std::string& classname, Vec3 origin, const std::vector<std::pair<std::string, std::string>>& keys = {});
    CompileInput input() const;

private:
    std::string materials_, solids_, entities_;
    int id_ = 1;
};
inline const std::string kSkyMaterial = "tools/toolsskybox";
// A quarter turn and others about an axis through the origin, right-handed.
Placing turned_about(Vec3 unit_axis, double angle_rad);

} // namespace kiln::bench

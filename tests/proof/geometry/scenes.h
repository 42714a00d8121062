// Scenes for the proofs: random brushes of all kinds, rooms, and copies of worlds turned by odd angles.
#pragma once
#include "tests/support/world_builder.h"
#include <numbers>
#include <random>

namespace kiln::proof {

using test::SidePoints;
using test::WorldBuilder;

class Dice {
public:
    explicit Dice(std::uint64_t seed) : random_(seed) {}
    double uniform(double lo, double hi) { return lo + (hi - lo) * (static_cast<double>(random_() >> 11) * 0x1p-53); }
    double on_grid(double lo, double hi, int bits) { return std::ldexp(std::round(std::ldexp(uniform(lo, hi), bits)), -bits); }
    Vec3 point(double range, int bits = 0) { return {on_grid(-range, range, bits), on_grid(-range, range, bits), on_grid(-range, range, bits)}; }
    std::uint64_t below(std::uint64_t n) { return random_() % n; }

private:
    std::mt19937_64 random_;
};

// Boxes, tetrahedra and prisms of three to seven sides, points on the 2^-bits grid; coarse steps make faces, edges and
// corners coincide.
struct SoupOptions {
    int bits = 0;
    double range = 100, size = 60;
    bool mixed = false; // contents of all kinds, not only structural
};
inline World soup(std::uint64_t seed, int count, const SoupOptions& o = {}) {
    Dice dice(seed);
    WorldBuilder w;
    const Contents kinds[] = {Contents::solid,  Contents::solid, Contents::solid, Contents::detail,     Contents::window,
                              Contents::grate, Contents::water, Contents::lava,  Contents::area_portal, Contents::clip};
    for (int i = 0; i < count; ++i) {
        const Contents contents = o.mixed ? kinds[dice.below(std::size(kinds))] : Contents::solid;
        const Vec3 at = dice.point(o.range, o.bits);
        const auto kind = dice.below(5);
        if (kind < 3) {
            const auto size = [&] { return std::max(std::ldexp(1.0, -o.bits), dice.on_grid(1, o.size, o.bits)); };
            w.box(at, at + Vec3{size(), size(), size()}, contents);
        } else if (kind == 3) {
            for (;;) {
                std::array<Vec3, 4> p;
                for (Vec3& v : p) v = at + dice.point(o.size, o.bits);
                if (std::fabs(dot(cross(p[1] - p[0], p[2] - p[0]), p[3] - p[0])) < 1) continue;
                w.tetrahedron(p, contents);
                break;
            }
        } else {
            const auto n = 3 + dice.below(5);
            std::vector<Vec2> base;
            const double r = std::max(4.0, o.size / 2), turn = dice.uniform(0, 1);
            for (std::uint64_t k = 0; k < n; ++k) {
                const double t = 2 * std::numbers::pi * (static_cast<double>(k) + turn) / static_cast<double>(n);
                base.push_back({at.x + std::round(r * std::cos(t)), at.y + std::round(r * std::sin(t))});
            }
            w.prism(base, at.z, at.z + 40, contents);
        }
    }
    return w.world;
}

// Large luxels, for tests that look at faces alone: a huge wall has millions of the usual size.
inline World with_large_luxels(World world) {
    for (WorldSide& s : world.sides) s.lightmap_scale = 1024;
    return world;
}

// Turned about z, then x, then each plane point put on the multiples of `step`: as an editor would that saves so.
inline World turned(const World& world, double step, double about_z = 0.3217, double about_x = 1.1234) {
    World result = world;
    const double cz = std::cos(about_z), sz = std::sin(about_z), cx = std::cos(about_x), sx = std::sin(about_x);
    const auto turn = [&](Vec3 p) {
        p = {cz * p.x - sz * p.y, sz * p.x + cz * p.y, p.z};
        return Vec3{p.x, cx * p.y - sx * p.z, sx * p.y + cx * p.z};
    };
    for (WorldSide& side : result.sides) {
        for (auto& point : side.points) {
            const Vec3 p = turn({point[0].to_double(), point[1].to_double(), point[2].to_double()});
            for (std::size_t k = 0; k < 3; ++k) point[k] = test::decimal(std::round(p[k] / step) * step);
        }
        side.editor_vertices.clear();
    }
    for (WorldEntity& e : result.entities) e.origin = turn(e.origin);
    return result;
}

} // namespace kiln::proof

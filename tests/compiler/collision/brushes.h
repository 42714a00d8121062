// Convex brushes for the laws of collision.
#pragma once
#include "tests/compiler/csg/measure.h"

namespace kiln::test {

// Some random half-spaces about a point, with or without a box around them; corners lie wherever the planes meet.
inline void random_hull(WorldBuilder& w, std::mt19937_64& rng, Vec3 at, double size, int bits = 3, Contents contents = Contents::solid,
                        ModelId model = {0}) {
    std::vector<SidePoints> sides;
    const auto add = [&](Vec3 n, double reach) {
        const Frame f = frame_around(normalize(n));
        const Vec3 p = at + normalize(n) * reach;
        SidePoints s{p, p + f.b * size, p + f.t * size}; // clockwise seen from outside
        for (Vec3& v : s)
            for (std::size_t k = 0; k < 3; ++k) v[k] = on_grid(v[k], bits);
        sides.push_back(s);
    };
    const bool boxed = rng() % 3 != 0;
    for (int slot = 0; slot < 6; ++slot) { // far out where not boxed: they only close it
        Vec3 n{};
        n[static_cast<std::size_t>(slot / 2)] = slot % 2 ? 1 : -1;
        if (!boxed) n = n + Vec3{uniform(rng, -.3, .3), uniform(rng, -.3, .3), uniform(rng, -.3, .3)};
        add(n, uniform(rng, 0.3, 1) * size);
    }
    for (std::uint64_t extra = rng() % 9; extra-- > 0;) {
        Vec3 n{uniform(rng, -1, 1), uniform(rng, -1, 1), uniform(rng, -1, 1)};
        if (rng() % 4 == 0) n[rng() % 3] = 0;
        if (length(n) > 0.1) add(n, uniform(rng, 0.4, 0.9) * size);
    }
    w.brush(sides, contents, model);
}

} // namespace kiln::test

// Places where cubes may stand: lattice corners, shared by the cells that meet there, moved out of solid where half a
// cell suffices; and places of a cell's own air, for cells that see no corner.
#pragma once
#include "compiler/ambient/cube.h"
#include <unordered_map>

namespace kiln::ambient {

using Grid = std::array<std::int32_t, 3>; // lattice coordinates, in finest cells
struct GridHash {
    std::size_t operator()(const Grid& g) const noexcept {
        std::uint64_t h = 0;
        for (const std::int32_t v : g) h = (h ^ std::uint32_t(v)) * 0x9E3779B97F4A7C15ull, h ^= h >> 29;
        return h;
    }
};

struct Site {
    Vec3 position;
    std::uint64_t seed = 0;
    bool usable = false;     // in the air, and no ray met a back face
    float invalid_share = 0; // back-face share at the place taken
    bool lit = false;
    Gathered gathered;
    std::vector<LitBy> lights;    // that reach it, strongest first, those behind panes last
    std::uint64_t rays = 0;
    Cube6 shown{};                // gathered + all lights but the local ones
    std::size_t locals(const AmbientOptions& o) const {
        std::size_t n = 0;
        while (n < lights.size() && n < o.local_lights && !lights[n].filtered) ++n;
        return n;
    }
    bool local(std::uint32_t light, const AmbientOptions& o) const {
        for (std::size_t i = 0; i < locals(o); ++i)
            if (lights[i].light == light) return true;
        return false;
    }
    void compose(const AmbientOptions& o); // fills `shown`
};

// Finds the usable place of a corner, at most `reach` from where the lattice has it.
void settle(const Air& air, double reach, Site& site);
// Does a place see faces from behind, as no usable place does? Adds the rays it takes.
bool sees_backs(const Air& air, Vec3 p, std::uint64_t& rays);
void light_up(const Air& air, const AmbientOptions& options, Site& site);

} // namespace kiln::ambient

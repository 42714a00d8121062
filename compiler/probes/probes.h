// Probes: env_cubemap entities rendered from the baked light, prefiltered for roughness, with a parallax box each and
// an assignment of faces and leaves. A default probe where there is none and reflective material exists.
//
// In       world, bsp, surfaces, light field
// Out      linear HDR radiance, face order +x -x +y -y +z -z; texel (i,j) of face f (i to the right, j down, row j
//          first) lies in the direction cube_direction(f, u, v), u = 2(i+.5)/n-1, v = 2(j+.5)/n-1. Axes are the
//          world's; the layout is that of OpenGL and Direct3D cubemaps:
//
//              face   direction            face   direction
//              0 +x   ( 1, -v, -u)         1 -x   (-1, -v,  u)
//              2 +y   ( u,  1,  v)         3 -y   ( u, -1, -v)
//              4 +z   ( u, -v,  1)         5 -z   (-u, -v, -1)
//
//          mip m is size >> m texels wide and filtered by GGX (n = v = r) for roughness r = m / (mips - 1),
//          alpha = r^2; mip 0 is the rendered cube. The last mip is 4 texels wide (all that is there below size 8).
// Run time parallax: with `boxed`, a reflection r (unit) at x meets the box at x + t r,
//          t = min over axes of max((hi - x) / r, (lo - x) / r); look up x + t r - position.
// Errors   an env_cubemap in solid or with a malformed key: located warning
// Source   J. Krivanek, M. Colbert, "Real-time shading with filtered importance sampling", EGSR 2008
#pragma once
#include "compiler/light/field.h"

namespace kiln {

class Memo;

struct ProbesOptions {
    std::uint32_t default_size = 64;   // texels along an edge; entity key cubemapsize: n -> 2^(n-1), 0: default
    std::uint32_t prefilter_samples = 64; // per texel
    std::uint64_t seed = 1;
    std::uint32_t supersample = 2;     // rays per texel and axis: 2 is four rays a texel
    template <class A> void fields(A& a) { a(default_size, prefilter_samples, seed, supersample); }
};
struct Probe {
    Vec3 position;
    EntityId entity;                 // none: default probe
    std::uint32_t size = 0, mips = 0;
    std::vector<Rgb> texels;         // mip-major, then face, then row: sum over mips of 6*(size>>m)^2
    bool boxed = false;              // parallax box accepted
    Box3 box;                        // map units
    template <class A> void fields(A& a) { a(position, entity, size, mips, texels, boxed, box); }
};
struct Probes {
    std::vector<Probe> probes;
    std::vector<std::uint32_t> face_probe; // per face; UINT32_MAX: none
    std::vector<std::uint32_t> leaf_probe; // per BSP leaf; UINT32_MAX: none
    template <class A> void fields(A& a) { a(probes, face_probe, leaf_probe); }
};
Result<Probes> bake_probes(const World& world, const Bsp& bsp, const PlaneTable& planes, const Surfaces& surfaces,
                           const LightField& field, const ProbesOptions& options, Context& context, Memo* memo = nullptr);
void validate(const Probes& probes);
Vec3 cube_direction(int face, double u, double v);          // u, v in [-1,1]; not normalised
void cube_texel(Vec3 direction, int* face, double* u, double* v); // inverse of cube_direction
// Where to look a reflection up in a probe with a box: direction from the probe's position, not normalised.
Vec3 parallax_direction(const Probe& probe, Vec3 point, Vec3 unit_direction);

} // namespace kiln

// The other known ways to bake, on the scene code of the bake itself: what the chart of `kiln bench light` compares it
// with at the same luxels. Nothing here takes part in a build.
//
// In       a scene (world, surfaces, lights) and receivers: luxels, or points with a normal
// Out      per receiver the irradiance along four directions, by one of four methods; what it cost in rays and bytes
// Errors   none: a setting that would need more memory than it allows is answered by `refused`
// Source   of each method: at its function; where it breaks and why, with the tests that say so: NOTES.md
#pragma once
#include "compiler/light/field.h"
#include "compiler/light/patches.h"

namespace kiln::rivals {

// Integrals of L(w) max(0, w.d) over the hemisphere above the surface: d the shading normal, then its three tilted
// basis vectors in the order of kernels.h. What `bake_light` stores with RnmEncoding::tilted.
using Irradiance = std::array<Rgbd, 4>;

struct Receiver {
    Vec3 point, normal;              // on the surface; geometric
    std::array<Vec3, 4> directions;  // unit
    std::uint32_t luxel = UINT32_MAX; // none: a point
    Footprint footprint;             // of the luxel; empty: the point alone
};

// What all methods ask: the tracer, the emitters, light entities. Refers to what it was made from.
class Scene {
public:
    Scene(const World& world, const Surfaces& surfaces, const std::vector<Light>& lights);
    const World& world;
    const Surfaces& surfaces;
    const std::vector<Light>& lights;
    const LightField& field() const { return *field_; } // knows nothing baked
    const TraceScene& trace() const { return field_->scene(); }
    const PieceEdges& edges() const { return edges_; }

private:
    Bsp bsp_;
    PlaneTable planes_;
    Lighting nothing_baked_;
    std::unique_ptr<LightField> field_;
    PieceEdges edges_;
};

Receiver receiver_at(Vec3 point, Vec3 normal, Vec3 tangent);
// The luxels that show light: of a material that reflects, on flat faces, and not looking into something solid.
std::vector<std::uint32_t> shown_luxels(const Scene& scene, Context& context);
std::vector<Receiver> receivers_of(const Scene& scene, std::span<const std::uint32_t> luxels);

struct Cost {
    std::uint64_t rays = 0;
    std::uint64_t bytes = 0; // of the tables it keeps; not of the scene
};

class Method {
public:
    virtual ~Method() = default;
    // The same for any number of threads.
    virtual std::vector<Irradiance> light(std::span<const Receiver> receivers, Context& context) = 0;
    virtual Cost cost() const = 0; // so far
    virtual std::string refused() const { return {}; } // why it cannot answer; light() then gives zeros
};

// Unbiased paths with next-event estimation and the balance heuristic (E. Veach 1997), over the luxel's footprint: the
// code of `reference`, one Sobol sequence a receiver.
struct PathSettings {
    std::uint32_t paths = 1024; // per receiver
    std::uint64_t seed = 1;
};
std::unique_ptr<Method> path_tracing(const Scene& scene, const PathSettings& settings);

// Classic radiosity: a matrix of factors between uniform patches, each pair joined by one ray from middle to middle;
// luxels interpolate between patches (C. Goral et al. 1984; the rules of vrad by their public description).
//   centre     cos cos A / (pi r^2) always
//   vrad       near pairs (0.04 pi r^2 < A) by the contour integral, with edge angles by asin and no horizon; a row that
//              sums to more than 1 is scaled down; basis vectors by the quotient of cosines towards the middle; lamps by
//              the centre rule
//   corrected  the same contour with atan2, clipped at the horizon, along each basis vector by itself, for lamps too;
//              the ray aims at the middle of what is above the horizon; rows stay as they are
enum class MatrixRule : std::uint8_t { centre, vrad, corrected };
struct MatrixSettings {
    double patch_size = 32; // map units
    MatrixRule rule = MatrixRule::corrected;
    std::uint64_t most_bytes = std::uint64_t{1} << 30;
};
std::unique_ptr<Method> matrix_radiosity(const Scene& scene, const MatrixSettings& settings, Context& context);
// The unoccluded factor from x to a convex polygon along n by each rule.
double matrix_factor(MatrixRule rule, Vec3 x, Vec3 n, std::span<const Vec3> convex);

// Hemicubes (M. Cohen and D. Greenberg 1985): one at the middle of every patch for the bounces, four at every luxel, along
// the normal and each basis vector, for what is stored. A pixel is a ray through its middle.
struct HemicubeSettings {
    double patch_size = 32;        // map units
    std::uint32_t resolution = 32; // pixels along an edge of the top; even
};
std::unique_ptr<Method> hemicube_radiosity(const Scene& scene, const HemicubeSettings& settings, Context& context);
struct HemicubePixel {
    Vec3 direction;    // unit, around +z
    double weight = 0; // its form factor, exact; all of them sum to 1
};
std::vector<HemicubePixel> hemicube_pixels(std::uint32_t resolution);

// Virtual lights on lamps and where light bounces, and for each luxel a cut through a tree over them, refined where the
// bound on a node's error exceeds a share of the total (A. Keller 1997; B. Walter et al., "Lightcuts", 2005).
struct ManyLightSettings {
    std::uint32_t lights = 4096; // bounces begin at so many points; lamps get a quarter as many
    double error = 0.02;         // of the total, a node; 0: every light
    std::uint64_t seed = 1;
};
std::unique_ptr<Method> many_light_cut(const Scene& scene, const ManyLightSettings& settings, Context& context);

} // namespace kiln::rivals

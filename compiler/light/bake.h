// The working state of one bake; private to this folder. The steps stand in the order they are taken.
#pragma once
#include "compiler/light/emitters.h"
#include "compiler/light/kernels.h"
#include "compiler/light/patches.h"
#include <atomic>

namespace kiln {

// Codes in hit lists beside patch numbers.
constexpr std::uint32_t kHitEscaped = UINT32_MAX, kHitBack = UINT32_MAX - 1, kHitBlack = UINT32_MAX - 2;
constexpr std::uint32_t kHitEmitter = 1u << 31; // | emitter: shines but is no patch (sky)
constexpr bool is_patch(std::uint32_t hit) { return hit < kHitEmitter; }

// Reflected radiance at hits: luxel by luxel where a texel belongs to one patch, else by patch.
struct ReflectedLight {
    std::vector<Rgb> texel, patch;
};

// A light that is sampled explicitly for the luxels of a patch; all others it sees stay in the gathered rays.
struct LightRef {
    std::uint32_t light = 0;  // emitter, or light entity
    bool is_emitter = false;
    std::uint8_t samples = 1; // to start with
};
// In full view of the patch: one sample shows it. Seen by some test rays: a shadow edge crosses the patch. Seen by none:
// a few, and more where one gets through.
constexpr std::uint8_t kClear = 1, kPenumbra = 255, kUnlikely = 2;

struct HitCounts {
    std::uint64_t rays = 0, escaped = 0, back = 0;
    HitCounts& operator+=(const HitCounts& o) {
        rays += o.rays, escaped += o.escaped, back += o.back;
        return *this;
    }
};

struct Quality { // what the error target buys; tuned in NOTES.md
    double patch_size = 32;          // map units
    std::uint32_t row_rays = 256;    // per patch
    std::uint32_t visibility_rays = 16; // per patch and candidate light
    std::uint32_t direct_samples = 16;  // per luxel and light, at most
    double promotion = 0.005;        // an emitter whose predicted noise exceeds this share of E is sampled explicitly
    double light_cutoff = 1e-3;      // entity lights below this share of E are left out
    std::uint32_t least_rays = 32, most_rays = 4096, pilot_rays = 64; // per luxel
    double iteration = 1e-3;         // bound on the relative iteration error
    static Quality of(const LightOptions& options);
};

// Directions on the primary square: concentric disc, then density (2 a z + 1 - a) / (2 pi). a = 1: cosine. Kernels
// that do not fall with the cosine want a < 1, or light at grazing angles gets unbounded weight.
struct HemisphereMap {
    double a = 1;
    Vec3 direction(Vec2 square) const;
    double density(double z) const { return (2 * a * z + 1 - a) * 0.15915494309189535; }
    // Where a cosine-distributed point of the square would have to lie for this map to give the same direction.
    Vec2 from_cosine(Vec2 square) const;
};

// 16 x 16 histogram on the primary square, mixed with a uniform share so that nothing can be missed.
class Guide {
public:
    static constexpr int kSide = 16;
    static constexpr double kUniformShare = 0.35;
    void clear();
    void add(Vec2 square, double light);
    void build(); // blurs, normalises, mixes
    Vec2 sample(Vec2 u, double* density) const; // density: of the primary square, >= kUniformShare

private:
    std::array<double, kSide * kSide> cell_{};
    std::array<double, kSide + 1> marginal_{};
    std::array<std::array<double, kSide + 1>, kSide> row_{};
    bool uniform_ = true;
};

struct LuxelGather {
    KernelSum sum;
    double variance = 0; // of the mean flat value, from quarters of the sequence (an upper bound)
    HitCounts hits;
};

class Bake {
public:
    Bake(const World& world, const Surfaces& surfaces, const std::vector<Light>& lights, const LightOptions& options,
         Context& context);
    Lighting run();

private:
    struct Rows { // merged hit lists: F_ij for reflecting patches j
        std::vector<std::uint64_t> first;
        std::vector<std::uint32_t> patch;
        std::vector<float> weight;
    };
    // rows.cpp
    void trace_rows();
    Rows merge_rows() const;
    std::vector<Rgbd> gathered_emission(bool only_unlisted) const;
    std::vector<Rgbd> solve(const Rows& rows, const std::vector<Rgbd>& direct, std::uint32_t* iterations,
                            double* residual);
    // direct.cpp
    void choose_lights(const std::vector<Rgbd>& irradiance);
    bool listed(std::uint32_t patch, std::uint32_t emitter) const;
    void direct_at(const Footprint& footprint, Vec3 normal, std::uint32_t patch, std::uint64_t seed,
                   const LuxelKernel& kernel, KernelSum* sum, std::uint64_t* rays) const;
    void luxel_direct();
    std::vector<Rgbd> patch_direct();
    // gather.cpp
    void patch_guide(std::uint32_t patch, const HemisphereMap& map, Guide* guide) const;
    // `coarse`: the same rays looked up in another solution, for the estimate of its difference.
    LuxelGather gather(std::uint32_t luxel, const Guide& guide, const HemisphereMap& map, std::uint32_t rays,
                       std::uint64_t seed, const ReflectedLight* coarse = nullptr, Rgbd* coarse_flat = nullptr) const;
    struct PilotResult {
        double noise = 0, bias = 0;       // rRMSE
        double noise_se = 0, bias_se = 0; // standard errors of the mean squares
        double mean = 0;                  // of the displayed irradiance, for the floor
    };
    PilotResult pilot(std::uint32_t rays, std::uint32_t one_in);
    void gather_all();
    // bake.cpp
    LuxelKernel kernel_of(std::uint32_t luxel) const;
    Footprint footprint_of_patch(std::uint32_t patch) const;
    Footprint footprint_of_luxel(std::uint32_t luxel) const;
    std::uint64_t seed_at(Vec3 point, std::uint64_t pass) const;
    Vec3 luxel_centroid(const Luxel& luxel) const;
    ReflectedLight reflected_light(const std::vector<Rgbd>& rest, const std::vector<Rgbd>& total) const;
    ReflectedLight coarse_light(const std::vector<Rgbd>& rest, const std::vector<Rgbd>& total) const;
    void fill();
    HemisphereMap map_of(std::uint32_t luxel) const;

    const World& world_;
    const Surfaces& surfaces_;
    const std::vector<Light>& lights_;
    const LightOptions& options_;
    Context& context_;
    Quality quality_;
    TraceScene scene_;
    LuxelIndex index_;
    EmitterSet emitters_;
    PieceEdges edges_;
    PatchTable patches_;
    std::vector<std::uint32_t> patch_emitter_;      // per patch; UINT32_MAX: none
    std::vector<std::uint32_t> hits_;               // row_rays per patch, in ray order
    std::vector<std::uint64_t> list_first_;         // per patch into lists_
    std::vector<LightRef> lists_;
    std::vector<std::uint32_t> luxel_patch_;        // per luxel: the patch of most of its footprint
    std::vector<std::uint32_t> patch_luxel_first_, patch_luxels_; // luxels by that patch
    std::vector<KernelSum> direct_;                 // per luxel
    std::vector<std::shared_ptr<const ConeTable>> cones_; // per chart; none: flat only
    ReflectedLight reflected_;
    ReflectedLight coarse_;                         // the same averaged over patches of twice the size
    std::uint32_t gather_rays_ = 64;
    HitCounts counts_;
    std::atomic<std::uint64_t> shadow_rays_{0};
    Lighting out_;
};

// What leaves a hit by reflection.
Rgbd reflected_radiance(const Surfaces& surfaces, const LuxelIndex& index, const PatchTable& patches,
                        const ReflectedLight& light, const SceneHit& hit);
Rgbd sky_radiance(const std::vector<Light>& lights);
// The shading normal at a point of a face.
Vec3 shading_normal(const Surfaces& surfaces, FaceId face, Vec3 point);
Frame shading_frame(const Frame& chart, Vec3 normal);

} // namespace kiln

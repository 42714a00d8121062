// Light: all bounces on patches, then direct light and a guided final gather at every luxel, projected on the
// kernels of the encoding.
//
// In       world, bsp, surfaces, lights; `seen`: which clusters may see which, from rows that know no limit of distance. Without it every light
//          is tried everywhere
// Out      per texel irradiance-like values (E without albedo, without 1/pi), patch radiosity, error estimate
// Errors   none of its own: a world without charts gives empty tables
// Source   C. Goral et al., "Modeling the Interaction of Light Between Diffuse Surfaces", SIGGRAPH 1984; rows by
// rays and the
//          guided gather, with their measurements and limits: NOTES.md
#pragma once
#include "compiler/light/lights.h"
#include "compiler/surfaces/surfaces.h"

namespace kiln {

enum class RnmEncoding : std::uint8_t { dot, sq, tilted };
enum class Directional : std::uint8_t { needed, all, none };

struct LightOptions {
    double error_percent = 5; // target rRMSE of displayed irradiance
    RnmEncoding encoding = RnmEncoding::dot;
    Directional directional = Directional::needed; // needed: where a material has a normal map
    double error_floor = 0.02;                     // of the scene mean, in rRMSE
    std::uint64_t seed = 1;
    bool match_seams = true; // texels that seams read are fitted (seams.h); without it a luxel is the mean of its part of a face
    template <class A> void fields(A& a) { a(error_percent, encoding, directional, error_floor, seed, match_seams); }
};

struct Patch {
    FaceId face;
    Vec3 centroid;
    double area = 0;           // map units squared
    Rgb reflectance, emission; // emission: radiosity emitted M = pi * material.emission
    template <class A> void fields(A& a) { a(face, centroid, area, reflectance, emission); }
};

struct ErrorReport {                                    // percent, rRMSE of displayed irradiance
    // The estimate is as often too low as too high; the true error is below `high` in at least 95 of 100 bakes, and above `low` in as many.
    double target = 0, estimate = 0, low = 0, high = 0;
    double noise = 0, patch_bias = 0, iteration = 0;
    double shortcuts = 0;      // of what is not looked at closely: lights that test rays agreed on, light of walls close by
    double solution = 0;       // of the noise in the bounces, which all luxels share
    double representation = 0; // of the RNM encoding: the format's, not the bake's
    template <class A> void fields(A& a) {
        a(target, estimate, low, high, noise, patch_bias, iteration, shortcuts, solution, representation);
    }
};

// A light entity and the irradiance that it brings to the luxels of a patch, in the mean; 0 where there are none.
struct LightBrings {
    static constexpr bool kRawBytes = true;
    std::uint32_t light = 0;
    float irradiance = 0; // mean of the channels
};

struct Visibility;
struct LightMemo; // of an earlier bake of the same geometry (memo.h): taken over where it holds, and replaced by this one's

struct Lighting {
    RnmEncoding encoding = RnmEncoding::dot;
    std::vector<Patch> patches;
    std::vector<Rgb> radiosity; // per patch: B, all bounces, emission included
    // Patch lookup (patches.h): per texel, UINT32_MAX none, UINT32_MAX - 1 several: then by piece; faces without a
    // chart have one patch or none.
    std::vector<std::uint32_t> patch_index, piece_patch, face_patch;
    // Per patch the entities that light any of its luxels, ascending, or, where it has none, all that may light it: from the first of `brought` on, and one more. Empty: not known.
    std::vector<std::uint32_t> first_brought;
    std::vector<LightBrings> brought;
    std::vector<Rgb> flat;           // per texel: irradiance for the flat (shading) normal; gutter filled
    std::vector<std::uint8_t> valid; // per texel: 0 outside any face, 1 baked, 2 filled from neighbours
    std::vector<std::uint8_t> chart_directional; // per chart
    std::vector<std::uint32_t> rnm_first;        // per chart: first entry in rnm, or UINT32_MAX
    std::vector<std::array<Rgb, 3>> rnm;         // per texel of directional charts
    std::vector<float> texel_error;              // per texel: estimated relative standard error, 0 where unknown
    ErrorReport error;
    std::uint64_t rays = 0, escaped_rays = 0, back_face_rays = 0;
    std::uint32_t iterations = 0;
    std::uint32_t gather_rays = 0; // per luxel, mean
    template <class A> void fields(A& a) {
        a(encoding, patches, radiosity, patch_index, piece_patch, face_patch, first_brought, brought, flat, valid, chart_directional,
          rnm_first, rnm, texel_error, error, rays, escaped_rays, back_face_rays, iterations, gather_rays);
    }
};
Result<Lighting> bake_light(const World& world, const Bsp& bsp, const PlaneTable& planes, const Surfaces& surfaces,
                            const std::vector<Light>& lights, const LightOptions& options, Context& context,
                            LightMemo* memo = nullptr, const Visibility* seen = nullptr);
// The level below which errors are not relative any more: a share of the mean, in powers of two. It is a matter of taste, and a lamp
// more somewhere must not decide anew everywhere.
inline double error_floor(double share, double mean) {
    return share * mean > 0 ? std::exp2(std::round(std::log2(share * mean))) : 0;
}
// Of the luxels, by their area; 0 where there are none.
double mean_irradiance(const Surfaces& surfaces, const Lighting& lighting);
void validate(const Lighting& lighting, const Surfaces& surfaces);

} // namespace kiln

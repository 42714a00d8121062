// One path tracer for two uses: the truth (`reference`), and the first few units around a point, where a lightmap
// is too coarse to say what a surface close by sends.
#pragma once
#include "compiler/light/field_data.h"
#include "libs/sampling/maps.h"
#include <numbers>

namespace kiln {

struct PathTracer {
    const LightField::Data& d;
    std::uint64_t* rays = nullptr; // counts them, where it is given
    Looked* looked = nullptr;      // notes what paths with an end depend on

    void count() const {
        if (rays) ++*rays;
    }

    double density_of(const Choice& choice, std::uint32_t e, Vec3 d_to, double cosine) const { // solid angle
        const double p = choice.total() > 0 ? choice.probability(e) : 0;
        return p * dot(d_to, d_to) / (d.emitters.emitters[e].area * cosine);
    }
    // One explicit sample of an emitter: direction and radiance over density, weighted against `other` (density of
    // the bundle in that direction).
    template <class Other>
    bool emitter_sample(const Choice& choice, Vec3 x, Vec3 n, double pick, Vec2 u, const Other& other, Vec3* way,
                        Rgbd* weight) const {
        if (!(choice.total() > 0)) return false;
        const std::uint32_t e = choice.pick(pick);
        const Emitter& emitter = d.emitters.emitters[e];
        const Vec3 y = d.emitters.point_on(e, u), to = y - x;
        const double r = length(to);
        if (!(r > 0)) return false;
        *way = to / r;
        const double cosine = -dot(*way, emitter.normal);
        if (cosine <= 1e-12 || (!(n == Vec3{}) && dot(*way, n) <= 0)) return false;
        count();
        const Rgbd through = d.scene.transmitted({.from = x, .to = y + emitter.normal * d.scene.push_off()}).share;
        if (!(max_component(through) > 0)) return false;
        const double p = density_of(choice, e, to, cosine);
        *weight = through * emitter.radiance / (p + other(*way));
        return true;
    }
    // Irradiance from entities at a surface vertex.
    Rgbd entity(const Light& light, Vec3 x, Vec3 n, Random& random) const {
        LightSample s;
        const double a = random(), b = random();
        if (!sample_light(light, x, n, {a, b}, &s)) return {};
        count();
        const Rgbd through = d.scene.transmitted(ray_to(s, x)).share;
        if (!(max_component(through) > 0)) return {};
        return through * (s.weight * dot(s.direction, n) + s.ambient);
    }
    // From those that light the patch of a piece close by; kNoPiece: from all.
    static constexpr std::uint32_t kNoPiece = UINT32_MAX;
    Rgbd entities(std::uint32_t piece, Vec3 x, Vec3 n, Random& random) const;
    // Radiance that a bundle of the given density (of solid angle) meets in the direction `way` from x; what shines is weighted
    // against the explicit samples of `choice` by the balance heuristic.
    // Every pane on the way gives its share.
    Rgbd met(const Choice& choice, Vec3 x, Vec3 way, double density, Random& random) const;
    // Radiance reflected at `hit` towards where the ray came from. With `end`: a vertex further than a luxel or two
    // from the one before, or where light is even, takes what the bake stored there, and the path ends. That is left out of the radiance.
    struct End {
        std::uint32_t place = FieldBundle::kBlack; // none
        Rgbd share;
    };
    Rgbd reflected(SceneHit hit, Vec3 came, Random& random, End* end = nullptr) const;
};

} // namespace kiln

// Emitters: faces that shine, lamps and sky, and points on them for where a cosine bundle would find them badly.
//
// The unoccluded contribution of an emitter is exact (Lambert's formula, clipped at the horizon); only visibility
// is sampled. An emitter that is large against its distance is bisected until its parts are not.
#pragma once
#include "compiler/light/field.h"
#include "compiler/light/lambert.h"
#include "libs/sampling/maps.h"
#include "libs/sampling/sobol.h"
#include <numbers>

namespace kiln {

struct Emitter {
    FaceId face;
    Rgbd radiance;
    Vec3 normal;
    double distance = 0; // of its plane
    Vec3 center;         // of the bounding ball
    double radius = 0, area = 0;
    std::uint32_t first_triangle = 0, triangle_count = 0; // into EmitterSet::triangles
    std::uint32_t first_edge = 0, edge_count = 0;         // boundary, directed
    bool sky = false;
};

struct EmitterTriangle {
    Vec3 a, b, c;
    double cumulative = 0; // area of the emitter's triangles up to and with this one
};

class EmitterSet {
public:
    // `sky`: radiance of the dome; faces that are sky emit it.
    EmitterSet(const World& world, const Surfaces& surfaces, Rgbd sky);
    std::vector<Emitter> emitters;
    std::vector<EmitterTriangle> triangles;
    std::vector<std::array<Vec3, 2>> edges;
    std::vector<std::uint32_t> of_face; // per face; UINT32_MAX: does not emit

    // Never less than the unoccluded form factor from x (normal n; zero: solid angle over pi instead), cheap.
    double bound(std::uint32_t emitter, Vec3 x, Vec3 n) const;
    // The unoccluded form factor itself, clipped at the horizon of x and 0 behind the emitter; for a zero normal
    // the solid angle over pi.
    double form_factor(std::uint32_t emitter, Vec3 x, Vec3 n) const;

    // Points to test for visibility, of what lies above the horizon. Calls visit(point on the emitter, flux): unit direction
    // times the solid angle that the point stands for.
    //   Arrival::each    every point for itself: right on the average (of small parts within 0.1 %), whatever is done with the directions.
    //   Arrival::whole   for all points together, in full view: shifted so that over each part of the emitter they add up to the
    //                    exact integral of the direction. Every kernel that is linear in the direction, as the cosine to any normal that
    //                    sees all of the part, comes out exact, others to second order of the part's size.
    // `samples`: at least this many points in all (power of two), indices first..first+samples of `points`,
    // dimensions (2,3). `share_limit`: parts below this form factor are not split further.
    // Share: what parts count by, for samples and for being split: their form factor, or, for kernels that do not fall with the
    // cosine to n, their solid angle: what is low over the horizon of n stands high over that of a tilted normal.
    enum class Arrival { each, whole };
    enum class Share { cosine, solid };
    template <class Visit>
    void sample(std::uint32_t emitter, Vec3 x, Vec3 n, std::uint32_t first, std::uint32_t samples,
                const Sobol& points, double share_limit, Arrival arrival, Share share, const Visit& visit) const;

    // The same, every point for itself, with just so many of them (64 at most; fewer by rounding alone): a large emitter has more parts than are worth rays, so they are evenly spaced
    // by the parts' shares, from `offset` (0..1) on, and parts in between have none.
    template <class Visit>
    void sample_few(std::uint32_t emitter, Vec3 x, Vec3 n, std::uint32_t first, std::uint32_t samples, double offset,
                    const Sobol& points, double share_limit, Share share, const Visit& visit) const;

    // So far away and so high above the horizon of x that it need not be split.
    bool is_far(std::uint32_t emitter, Vec3 x, Vec3 n) const {
        const Emitter& e = emitters[emitter];
        const Vec3 to = e.center - x;
        return dot(to, to) > 9 * e.radius * e.radius && (n == Vec3{} || dot(n, to) > e.radius);
    }
    Vec3 point_on(std::uint32_t emitter, Vec2 u) const; // uniform by area

private:
    static constexpr std::uint32_t kMostPoints = 64; // of one part
    static constexpr double kWide = 0.01;            // longest side against distance, squared: from here on a part is drawn from by solid angle
    struct Part {
        std::array<Vec3, 3> corner;
        std::array<Vec3, 3> edge{}; // lambert_edge from each corner to the next; where only solid angles count they are not needed
        double factor = 0;          // form factor, or solid angle over pi
        Vec3 doubled_flux() const { return edge[0] + edge[1] + edge[2]; }
        Vec3 middle() const { return (corner[0] + corner[1] + corner[2]) / 3.0; }
        std::pair<std::size_t, double> longest_side() const { // from which corner; squared
            std::pair<std::size_t, double> longest{0, 0.0};
            for (std::size_t i = 0; i < 3; ++i) {
                const Vec3 side = corner[(i + 1) % 3] - corner[i];
                if (dot(side, side) > longest.second) longest = {i, dot(side, side)};
            }
            return longest;
        }
    };
    // Everything of one call of `sample`.
    struct Sampling {
        const Emitter& e;
        Vec3 x, n; // n: zero where parts count by solid angle
        std::uint32_t first;
        const Sobol& points;
        Arrival arrival;
        double total = 0, share_limit = 0; // of all parts
        std::uint32_t serial = 0;
        bool by_angle() const { return n == Vec3{}; }
        bool needs_edges() const { return !by_angle() || arrival == Arrival::whole; }
        double factor_of(const Part& part) const { return std::abs(dot(n, part.doubled_flux())) / (2 * std::numbers::pi); }
    };
    static Part whole_part(const Sampling& s, const std::array<Vec3, 3>& corner);
    template <class Leaf> void each_part(Sampling& s, std::uint32_t emitter, Vec3 n, std::uint32_t samples, double share_limit, const Leaf& leaf) const;
    template <class Leaf> static void split(const Sampling& s, const Part& part, int depth, const Leaf& leaf);
    template <class Visit> static void visit_part(Sampling& s, const Part& part, std::uint32_t count, const Visit& visit);
    template <class Visit> void visit_far(std::uint32_t emitter, Vec3 x, std::uint32_t first, std::uint32_t samples, const Sobol& points, Arrival arrival, const Visit& visit) const;
    template <std::size_t Most, class Place, class Solid, class Doubled, class Visit>
    static void visit_points(const Emitter& e, Vec3 x, std::uint32_t count, Arrival arrival, const Place& place, const Solid& solid_angle,
                             const Doubled& doubled_flux, const Visit& visit);
};

// A choice by weight: of an emitter at one point, of a light.
struct Choice {
    std::vector<double> cumulative;
    void clear() { cumulative.clear(); }
    void add(double weight) { cumulative.push_back(total() + weight); }
    double total() const { return cumulative.empty() ? 0 : cumulative.back(); }
    double weight(std::uint32_t i) const { return cumulative[i] - (i ? cumulative[i - 1] : 0); }
    void build(const EmitterSet& set, Vec3 x, Vec3 n) {
        build(set, x, n, [](const Emitter&) { return true; });
    }
    // The rest is left to the rays that go on.
    void build(const EmitterSet& set, Vec3 x, Vec3 n, const auto& worth) {
        clear();
        for (std::uint32_t i = 0; i < set.emitters.size(); ++i) add(worth(set.emitters[i]) ? mean(set.emitters[i].radiance) * set.bound(i, x, n) : 0);
    }
    double probability(std::uint32_t i) const { return weight(i) / total(); }
    std::uint32_t pick(double u) const {
        const auto at = std::upper_bound(cumulative.begin(), cumulative.end(), u * total());
        return static_cast<std::uint32_t>(
            std::min<std::ptrdiff_t>(at - cumulative.begin(), static_cast<std::ptrdiff_t>(cumulative.size()) - 1));
    }
};

// One of some lights at a place: by what they bring to luxels around it, in part by what they could bring there, which may be 0. By that alone a wall of light just around
// the corner was drawn for a sun that made all the light, and the sun, when it was drawn, stood for twenty.
void choose_by_light(std::span<const double> brought, std::span<const double> could, Choice* choice);

double triangle_form_factor(Vec3 x, Vec3 n, const std::array<Vec3, 3>& triangle);

template <class Visit>
void EmitterSet::sample(std::uint32_t index, Vec3 x, Vec3 n, std::uint32_t first, std::uint32_t samples,
                        const Sobol& points, double share_limit, Arrival arrival, Share share, const Visit& visit) const {
    const Emitter& e = emitters[index];
    if (dot(e.normal, x) - e.distance <= 0) return;
    if (is_far(index, x, n)) return visit_far(index, x, first, samples, points, arrival, visit);
    Sampling s{e, x, share == Share::solid ? Vec3{} : n, first, points, arrival};
    // Parts get samples by their share.
    each_part(s, index, n, samples, share_limit, [&](const Part& part) {
        visit_part(s, part, static_cast<std::uint32_t>(std::clamp(std::ceil(samples / s.total * part.factor), 1.0, 1.0 * kMostPoints)), visit);
    });
}

template <class Visit>
void EmitterSet::sample_few(std::uint32_t index, Vec3 x, Vec3 n, std::uint32_t first, std::uint32_t samples, double offset,
                            const Sobol& points, double share_limit, Share share, const Visit& visit) const {
    const Emitter& e = emitters[index];
    if (dot(e.normal, x) - e.distance <= 0) return;
    samples = std::min(samples, kMostPoints);
    if (is_far(index, x, n)) return visit_far(index, x, first, samples, points, Arrival::each, visit);
    Sampling s{e, x, share == Share::solid ? Vec3{} : n, first, points, Arrival::each};
    double before = 0; // share of the parts so far, in points
    std::uint32_t taken = 0;
    each_part(s, index, n, samples, share_limit, [&](const Part& part) {
        const double points_due = samples / s.total * part.factor;
        before += points_due;
        std::uint32_t count = 0;
        while (taken + count < samples && taken + count + offset < before) ++count;
        taken += count;
        if (count) visit_part(s, part, count, [&](Vec3 y, Vec3 flux) { visit(y, flux * (count / points_due)); });
    });
}

// So far away that it is one part.
template <class Visit>
void EmitterSet::visit_far(std::uint32_t index, Vec3 x, std::uint32_t first, std::uint32_t samples, const Sobol& points, Arrival arrival, const Visit& visit) const {
    const Emitter& e = emitters[index];
    const auto doubled = [&] {
        Vec3 flux;
        for (std::uint32_t i = 0; i < e.edge_count; ++i) flux += lambert_edge(x, edges[e.first_edge + i][0], edges[e.first_edge + i][1]);
        return flux;
    };
    samples = std::min(samples, kMostPoints);
    if (arrival == Arrival::whole && samples == 1) { // the exact integral, whatever the point
        Vec3 exact = doubled() * 0.5;
        if (dot(exact, e.normal) > 0) exact = -exact;
        if (exact != Vec3{}) visit(point_on(index, points.pair(first, 2)), exact);
        return;
    }
    visit_points<kMostPoints>(e, x, samples, arrival, [&](std::uint32_t i) { return point_on(index, points.pair(first + i, 2)); },
                 [&](double all) { return all * e.area / samples; }, doubled, visit);
}

// n: of the horizon; zero: none.
template <class Leaf>
void EmitterSet::each_part(Sampling& s, std::uint32_t index, Vec3 n, std::uint32_t samples, double share_limit, const Leaf& leaf) const {
    const Emitter& e = emitters[index];
    // Cut at the horizon first: a point drawn below it would throw away what the part above it sends.
    std::array<Part, 8> few;
    std::vector<Part> many;
    std::span<Part> parts = few;
    if (2 * e.triangle_count > few.size()) many.resize(2 * e.triangle_count), parts = many;
    std::size_t part_count = 0;
    for (std::uint32_t t = 0; t < e.triangle_count; ++t) {
        const EmitterTriangle& tri = triangles[e.first_triangle + t];
        const std::array<Vec3, 3> whole{tri.a, tri.b, tri.c};
        std::array<Vec3, 4> above{tri.a, tri.b, tri.c};
        std::size_t count = n == Vec3{} ? 3 : 0;
        if (!count) clip_to_horizon(s.x, n, whole, [&](Vec3 p) { above[count++] = p; });
        for (std::size_t i = 1; i + 1 < count; ++i) s.total += (parts[part_count++] = whole_part(s, {above[0], above[i], above[i + 1]})).factor;
    }
    if (!(s.total > 0)) return;
    s.share_limit = std::max(share_limit, 0.5 * s.total / std::max(samples, 8u)); // what has little share is not split for long
    for (const Part& part : parts.first(part_count)) split(s, part, 0, leaf);
}

// Along one great circle edges add up, and what two halves have in common goes one way in one and back in the other: of six edges two are new.
template <class Leaf> void EmitterSet::split(const Sampling& s, const Part& part, int depth, const Leaf& leaf) {
    if (!(part.factor > 0)) return;
    const Vec3 x = s.x;
    const std::array<Vec3, 3>& corner = part.corner;
    const auto [longest, width2] = part.longest_side();
    const Vec3 mid = part.middle() - x;
    // Longest side against the distance of the middle: 1 keeps the kernel within a few per cent over the part.
    if (depth < 12 && part.factor > s.share_limit && width2 > dot(mid, mid)) {
        const std::size_t i = longest, j = (i + 1) % 3, k = (i + 2) % 3;
        const Vec3 m = (corner[i] + corner[j]) * 0.5;
        Part one{{corner[i], m, corner[k]}}, other{{m, corner[j], corner[k]}};
        if (s.needs_edges()) {
            const Vec3 half = lambert_edge(x, corner[i], m), across = lambert_edge(x, m, corner[k]);
            one.edge = {half, across, part.edge[k]}, other.edge = {part.edge[i] - half, part.edge[j], -across};
        }
        if (s.by_angle()) one.factor = triangle_form_factor(x, {}, one.corner), other.factor = part.factor - one.factor;
        else one.factor = s.factor_of(one), other.factor = s.factor_of(other);
        split(s, one, depth + 1, leaf);
        split(s, other, depth + 1, leaf);
        return;
    }
    leaf(part);
}

template <class Visit> void EmitterSet::visit_part(Sampling& s, const Part& part, std::uint32_t count, const Visit& visit) {
    const Vec3 x = s.x;
    const std::array<Vec3, 3>& corner = part.corner;
    // Parts share one point set, shifted (Cranley-Patterson) by the part's number.
    const double shift_u = s.serial * 0.7548776662466927, shift_v = s.serial * 0.5698402909980532;
    ++s.serial;
    const auto shifted = [&](std::uint32_t i) {
        const Vec2 u = s.points.pair(s.first + i, 2);
        return Vec2{u.x + shift_u - std::floor(u.x + shift_u), u.y + shift_v - std::floor(u.y + shift_v)};
    };
    // Drawn by area and scaled to the solid angle of the part, few points bring up to 4 % too little: those near and those far, under
    // other angles, stand for as much each.
    const Vec3 mid = part.middle() - x;
    if (s.arrival == Arrival::each && part.longest_side().second > kWide * dot(mid, mid)) {
        const SphericalTriangle seen(corner[0] - x, corner[1] - x, corner[2] - x);
        const double height = dot(s.e.normal, corner[0] - x);
        for (std::uint32_t i = 0; i < count; ++i) {
            const Vec3 d = seen.direction(shifted(i));
            if (const double along = dot(s.e.normal, d); along < 0) visit(x + d * (height / along), d * (seen.solid_angle() / count));
        }
        return;
    }
    const auto place = [&](std::uint32_t i) {
        const Vec2 u = shifted(i);
        const double r = std::sqrt(u.x), wb = r * (1 - u.y), wc = r * u.y;
        return corner[0] + (corner[1] - corner[0]) * wb + (corner[2] - corner[0]) * wc;
    };
    visit_points<kMostPoints>(s.e, x, count, s.arrival, place, [&](double) { return solid_angle(x, corner[0], corner[1], corner[2]); }, [&] { return part.doubled_flux(); }, visit);
}

// `solid_angle`: of the whole, given the sum of cosine / r^2 over the points. `doubled_flux`: twice the integral of the
// direction, but for the sign.
template <std::size_t Most, class Place, class Solid, class Doubled, class Visit>
void EmitterSet::visit_points(const Emitter& e, Vec3 x, std::uint32_t count, Arrival arrival, const Place& place, const Solid& solid_angle,
                              const Doubled& doubled_flux, const Visit& visit) {
    if (Most > 1 && count == 1) return visit_points<1>(e, x, 1, arrival, place, solid_angle, doubled_flux, visit); // most calls: without 4 KB set to zero
    std::array<Vec3, Most> ys, fluxes;
    std::array<double, Most> solid{};
    Vec3 sum;
    double all = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
        ys[i] = place(i);
        const Vec3 d = ys[i] - x;
        const double r2 = dot(d, d), r = std::sqrt(r2);
        solid[i] = std::max(0.0, -dot(d, e.normal)) / (r2 * r);
        fluxes[i] = d * (solid[i] / r);
        sum += fluxes[i], all += solid[i];
    }
    if (!(all > 0)) return; // only by rounding: it is seen edge on
    double scale = solid_angle(all) / all;
    Vec3 missing;
    if (arrival == Arrival::whole) {
        Vec3 exact = doubled_flux() * 0.5;
        if (dot(exact, e.normal) > 0) exact = -exact; // it is seen from in front
        scale = length(exact) / length(sum);
        missing = (exact - sum * scale) / all;
    }
    for (std::uint32_t i = 0; i < count; ++i)
        if (solid[i] > 0) visit(ys[i], fluxes[i] * scale + missing * solid[i]);
}

// What one light entity sends to x: `weight` is irradiance on a plane facing `direction`. False: nothing.
// Sun: `u` chooses a direction within its disc. Visibility is not asked.
struct LightSample {
    Vec3 direction; // unit, from x to the light
    Rgbd weight;    // times cosine: irradiance
    Rgbd ambient;   // Quake's anglescale: the part that does not fall with the cosine (arrives along the normal)
    Vec3 position;  // point and spot
    bool distant = false; // sun: visible where a ray reaches the sky
};
bool sample_light(const Light& light, Vec3 x, Vec3 n, Vec2 u, LightSample* out);
// From x towards it. `place`: width of what x stands for, on a surface of that normal; `disc`: of what the sample stands for, of a sun.
inline LightRay ray_to(const LightSample& s, Vec3 x, double place = 0, Vec3 normal = {}, double disc = 0) {
    return {x, s.distant ? s.direction : s.position, s.distant, {.start = place, .end = s.distant ? disc : 0, .start_normal = normal}};
}
// Width of one of `samples` parts of a sun's disc, a unit of way.
inline double part_of_disc(const Light& light, double samples) {
    return light.kind == LightKind::sun ? std::sqrt(std::numbers::pi / samples) * light.angular_radius_rad : 0;
}
// Does x see the light itself, of a sun its middle, be it through panes?
inline bool sees(const TraceScene& scene, Vec3 x, const Light& light) {
    return light.kind == LightKind::sun ? scene.reaches_sky(x, -light.direction) : !scene.occluded(x, light.position);
}
// An upper bound of the mean irradiance it can bring to a ball around x.
double light_bound(const Light& light, Vec3 x, double radius);

} // namespace kiln

// Ambient cubes and probes: what stands in the air.
#include "compiler/ambient/ambient.h"
#include "compiler/probes/probes.h"
#include "tools/stability_bench/sweeps.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>
#include <stdexcept>

namespace kiln::bench {
namespace {

constexpr double kPi = std::numbers::pi;
const std::vector<Light> kNoLights;

// The other way: a plain lattice of cubes, trilinear, nothing asked about walls.
class PlainLattice {
public:
    PlainLattice(const LightField& field, Box3 box, double size, double offset) : size_(size) {
        for (std::size_t a = 0; a < 3; ++a) {
            lo_[a] = std::floor(box.lo[a] / size - offset) * size + offset * size;
            n_[a] = static_cast<std::size_t>(std::ceil((box.hi[a] - lo_[a]) / size)) + 1;
        }
        for (std::size_t k = 0; k < n_[2]; ++k)
            for (std::size_t j = 0; j < n_[1]; ++j)
                for (std::size_t i = 0; i < n_[0]; ++i) {
                    const Vec3 at = lo_ + Vec3{static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)} * size_;
                    double up = 0;
                    field.arriving(at, {}, 256, 1, [&](Vec3 d, Rgbd w) { up += mean(w) * cube_kernel(d.z); });
                    cubes_.push_back(up);
                }
    }
    double at(Vec3 p) const { // of the face that looks up
        const Vec3 u = (p - lo_) / size_;
        std::array<std::size_t, 3> c{};
        Vec3 f;
        for (std::size_t a = 0; a < 3; ++a) c[a] = std::min(n_[a] - 2, static_cast<std::size_t>(std::max(0.0, u[a]))), f[a] = u[a] - static_cast<double>(c[a]);
        double sum = 0;
        for (std::size_t corner = 0; corner < 8; ++corner) {
            double w = 1;
            std::array<std::size_t, 3> at{};
            for (std::size_t a = 0; a < 3; ++a) at[a] = c[a] + (corner >> a & 1), w *= corner >> a & 1 ? f[a] : 1 - f[a];
            sum += w * cubes_[(at[2] * n_[1] + at[1]) * n_[0] + at[0]];
        }
        return sum;
    }

private:
    Vec3 lo_;
    double size_;
    std::array<std::size_t, 3> n_{};
    std::vector<double> cubes_; // +z
};

} // namespace

// A furnace of radiance 1 and, behind a sealed wall, a dark room: cubes are pi before the wall and 0 behind.
void sweep_ambient_lattice(SweepReport& r, const SweepSettings& s, Context& context) {
    Panel dip{"before the wall: difference from pi", {}, {"offset of the lattice, cells", false}, {"worst |E / pi - 1|", true, 1e-8}, {}};
    Panel leak{"behind the wall", {}, {"offset of the lattice, cells", false}, {"most E / pi", true, 1e-12}, {}};
    std::size_t without = 0;
    for (const double thickness : values_of(s, {16, 0.125}, {0.125})) {
        MapText map;
        const std::string even = map.material("even", 0.5, 0.5), grey = map.material("grey", 0.5);
        const double w = 192, x = w + thickness;
        for (const auto& [x0, x1, m] : {std::tuple{0.0, w, even}, std::tuple{x, x + w, grey}}) {
            map.box({x0, -16, -16}, {x1, 144, 0}, m), map.box({x0, -16, 128}, {x1, 144, 144}, m);
            map.box({x0, -16, 0}, {x1, 0, 128}, m), map.box({x0, 128, 0}, {x1, 144, 128}, m);
        }
        map.box({-16, -16, -16}, {0, 144, 144}, even), map.box({x + w, -16, -16}, {x + w + 16, 144, 144}, grey);
        map.box({w, -16, -16}, {x, 144, 144}, {even, grey, grey, grey, grey, grey});
        map.entity("info_player_start", {32, 32, 32}), map.entity("info_player_start", {x + 32, 32, 32});
        const auto c = built(map, context);
        const Lighting l = baked(*c, kNoLights, {.error_percent = 2}, context);
        const LightField field(c->world, c->bsp, c->bsp.planes, c->surfaces, kNoLights, l);
        std::vector<Vec3> points;
        for (std::uint64_t k = 0; k < 600; ++k) {
            const bool behind = k % 2;
            // Every third one close to the wall.
            const double d = k % 3 == 0 ? 0.01 + 0.5 * uniform(k, 1) : (w - 1) * uniform(k, 1) + 0.5;
            points.push_back({behind ? x + d : w - d, 0.5 + 127 * uniform(k, 2), 0.5 + 127 * uniform(k, 3)});
        }
        for (const double offset : values_of(s, {0, 0.125, 0.25, 0.3125, 0.375, 0.5, 0.625, 0.75, 0.875, 0.999}, {0, 0.5})) {
            const auto measure = [&](const std::string& name, std::size_t look, const std::function<std::optional<double>(Vec3, bool)>& ask) { // worst of the faces
                double most_dip = 0, most_leak = 0;
                for (std::size_t k = 0; k < points.size(); ++k) {
                    const bool behind = k % 2;
                    const auto e = ask(points[k], behind);
                    if (!e) ++without;
                    else if (behind) most_leak = std::max(most_leak, std::abs(*e) / kPi);
                    else most_dip = std::max(most_dip, std::abs(*e / kPi - 1));
                }
                add_point(dip, name, look, offset, most_dip), add_point(leak, name, look, offset, most_leak);
            };
            const auto ambient = place_ambient(c->bsp, c->bsp.planes, c->surfaces, kNoLights, field, {.lattice_offset = offset}, context);
            if (!ambient) throw std::runtime_error(ambient.fault().diagnostic.message);
            measure(fmt::format("kiln, wall of {:g}", thickness), thickness > 1 ? 1 : 0, [&](Vec3 p, bool behind) -> std::optional<double> {
                const auto cube = ambient_at(*ambient, p);
                if (!cube) return std::nullopt;
                double worst = behind ? 0 : kPi;
                for (const Rgb& e : *cube)
                    for (std::size_t k = 0; k < 3; ++k) {
                        const double v = static_cast<double>(e[k]);
                        if (std::abs(v - (behind ? 0 : kPi)) > std::abs(worst - (behind ? 0 : kPi))) worst = v;
                    }
                return worst;
            });
            if (!s.rivals) continue;
            const PlainLattice plain(field, {{0, 0, 0}, {x + w, 128, 128}}, 64, offset);
            measure(fmt::format("plain lattice, wall of {:g}", thickness), thickness > 1 ? 3 : 2, [&](Vec3 p, bool) -> std::optional<double> { return plain.at(p); });
        }
    }
    r.notes.push_back(fmt::format("Points in the air without an answer: {}.", without));
    r.panels = {dip, leak};
}

// A row of sealed closets that branch off nothing, a probe in each, many of them close to a wall; then a corridor that forks,
// where a face must take a probe it sees if it sees any.
void sweep_probes(SweepReport& r, const SweepSettings& s, Context& context) {
    Panel closets{"sealed closets: faces with a probe from behind a wall", {}, {"walls, map units"}, {"share of faces", true, 1e-3}, {}};
    Panel fork{"a corridor that forks: faces that see a probe and take one they do not", {}, {"walls, map units"}, {"share of faces", true, 1e-3}, {}};
    Panel mirror{"probes of a mirror room of radiance 1", {}, {"texels along an edge"}, {"worst |radiance - 1|, percent", true, 1e-4}, {}};
    const auto probes_of = [&](const Compiled& c, const LightField& field) {
        auto p = bake_probes(c.world, c.bsp, c.bsp.planes, c.surfaces, field, {.default_size = 4, .prefilter_samples = 16}, context);
        (void)context.take_diagnostics();
        if (!p) throw std::runtime_error(p.fault().diagnostic.message);
        validate(*p);
        return std::move(*p);
    };
    const auto nearest = [](const std::vector<Vec3>& probes, const Face& f) { // in front of the face, by distance; else the nearest
        std::size_t best = probes.size();
        for (const bool only_in_front : {true, false})
            for (std::size_t k = 0; k < probes.size() && (only_in_front || best == probes.size()); ++k) {
                if (only_in_front && dot(f.normal, probes[k]) <= f.distance) continue;
                if (best == probes.size() || length(probes[k] - f.bounds.center()) < length(probes[best] - f.bounds.center())) best = k;
            }
        return best;
    };
    for (const double t : values_of(s, {64, 16, 4, 1, 0.25, 0.0625}, {16, 0.0625})) {
        {
            // Wide and narrow ones in turn: a wide one's probe stands in a corner, further from most of its faces than the narrow
            // neighbour's, which stands at the wall between them.
            MapText map;
            map.luxel = 32;
            const std::string grey = map.material("grey", 0.5, 0.1);
            std::vector<double> begins;
            std::vector<Vec3> at;
            double end = 0;
            for (int k = 0; k < 6; ++k) {
                const double wide = k % 2 ? 48 : 192;
                if (k) map.box({end - t, 0, 0}, {end, 128, 96}, grey);
                begins.push_back(end);
                at.push_back(k % 2 ? Vec3{end + 4, 64, 16} : Vec3{end + 8, 8, 88});
                map.entity("info_player_start", {end + 24, 32, 16}), map.entity("env_cubemap", at.back(), {{"cubemapsize", "3"}});
                end += wide + t;
            }
            map.room({0, 0, 0}, {end - t, 128, 96}, grey);
            const auto c = built(map, context);
            const Lighting l = baked(*c, kNoLights, {.error_percent = 20}, context);
            const LightField field(c->world, c->bsp, c->bsp.planes, c->surfaces, kNoLights, l);
            const Probes probes = probes_of(*c, field);
            const auto closet_of = [&](Vec3 p) { return std::ranges::upper_bound(begins, p.x + t / 2) - begins.begin(); };
            double wrong = 0, wrong_nearest = 0, faces = 0;
            for (std::size_t f = 0; f < c->surfaces.faces.size(); ++f) {
                const Face& face = c->surfaces.faces[f];
                if (!face.drawn) continue;
                const auto own = closet_of(face.bounds.center() + face.normal * (t / 4));
                ++faces;
                const std::uint32_t p = probes.face_probe[f];
                wrong += p == UINT32_MAX || closet_of(probes.probes[p].position) != own;
                wrong_nearest += closet_of(at[nearest(at, face)]) != own;
            }
            add_point(closets, "kiln", 0, t, wrong / faces);
            if (s.rivals) add_point(closets, "nearest in front", 3, t, wrong_nearest / faces);
        }
        {
            // A trunk along x that meets a bar along y; a block of thickness t screens one arm.
            MapText map;
            map.luxel = 32;
            const std::string grey = map.material("grey", 0.5, 0.1);
            map.room({0, 0, 0}, {512, 512, 96}, grey);
            const double x = 384;
            map.box({0, 0, 0}, {x, 208, 96}, grey), map.box({0, 304, 0}, {x, 512, 96}, grey);
            map.box({x + 16, 160, 0}, {512, 160 + t, 96}, grey); // a gap of 16 joins the arms
            const std::vector<Vec3> at{{64, 256, 48}, {448, 164 + t, 48}, {448, 440, 48}, {400, 8, 80}};
            map.entity("info_player_start", {32, 256, 16});
            for (const Vec3 p : at) map.entity("env_cubemap", p, {{"cubemapsize", "3"}});
            const auto c = built(map, context);
            const Lighting l = baked(*c, kNoLights, {.error_percent = 20}, context);
            const LightField field(c->world, c->bsp, c->bsp.planes, c->surfaces, kNoLights, l);
            const Probes probes = probes_of(*c, field);
            double wrong = 0, wrong_nearest = 0, faces = 0;
            for (std::size_t f = 0; f < c->surfaces.faces.size(); ++f) {
                const Face& face = c->surfaces.faces[f];
                if (!face.drawn) continue;
                // From points all over it.
                const auto seen = [&](Vec3 probe) {
                    for (std::uint32_t k = 0; k < face.triangle_count; ++k) {
                        const auto& tri = c->surfaces.triangles[face.first_triangle + k];
                        const Vec3 a = c->surfaces.positions[tri[0]], b = c->surfaces.positions[tri[1]], d = c->surfaces.positions[tri[2]];
                        for (std::uint64_t i = 0; i < 16; ++i) {
                            double u = uniform(f, k, i), v = uniform(f, k, i + 100);
                            if (u + v > 1) u = 1 - u, v = 1 - v;
                            const Vec3 from = a + (b - a) * u + (d - a) * v + face.normal * field.scene().push_off();
                            if (dot(face.normal, probe - from) > 0 && !field.scene().occluded(from, probe)) return true;
                        }
                    }
                    return false;
                };
                bool any = false;
                for (const Vec3 p : at) any |= seen(p);
                if (!any) continue;
                ++faces;
                const std::uint32_t p = probes.face_probe[f];
                wrong += p == UINT32_MAX || !seen(probes.probes[p].position);
                wrong_nearest += !seen(at[nearest(at, face)]);
            }
            add_point(fork, "kiln", 0, t, wrong / faces);
            if (s.rivals) add_point(fork, "nearest in front", 3, t, wrong_nearest / faces);
        }
    }
    for (const double n : values_of(s, {3, 4, 5, 6, 7}, {4})) { // cubemapsize n: 2^(n - 1) texels
        MapText map;
        const std::string even = map.material("even", 0.5, 0.5);
        map.room({0, 0, 0}, {256, 192, 128}, even);
        map.entity("info_player_start", {32, 32, 32});
        map.entity("env_cubemap", {60, 100, 50}, {{"cubemapsize", fmt::format("{:g}", n)}});
        const auto c = built(map, context);
        const Lighting l = baked(*c, kNoLights, {}, context);
        const LightField field(c->world, c->bsp, c->bsp.planes, c->surfaces, kNoLights, l);
        double worst = 0;
        const Probes all = probes_of(*c, field);
        for (const Probe& p : all.probes)
            for (const Rgb& e : p.texels)
                for (std::size_t k = 0; k < 3; ++k) worst = std::max(worst, 100 * std::abs(static_cast<double>(e[k]) - 1));
        add_point(mirror, "kiln", 0, std::pow(2, n - 1), worst);
    }
    r.panels = {closets, fork, mirror};
}

} // namespace kiln::bench

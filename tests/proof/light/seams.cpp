#include "tests/proof/light/seams.h"
#include "compiler/pack/pack.h"
#include "formats/level/kiln_level.hpp"
#include "libs/core/check.h"
#include "tests/support/curves.h"
#include <fmt/format.h>
#include <map>
#include <numbers>

namespace kiln::proof {
namespace {

using test::WorldBuilder;
constexpr double kPi = std::numbers::pi;

Light lamp(Vec3 at, Rgb intensity) {
    Light l;
    l.position = at, l.intensity = intensity;
    return l;
}
// A room with two lamps, one of them coloured, and a pillar for a hard shadow.
SeamMap room(std::string name, bool pillar = true) {
    SeamMap m;
    m.name = std::move(name);
    m.builder.world.materials[0].reflectance = {0.6f, 0.5f, 0.4f};
    m.builder.room({0, 0, -64}, {512, 512, 192}, 16);
    m.builder.point_entity("info_player_start", {256, 256, 150});
    if (pillar) m.builder.box({196, 190, -64}, {212, 206, 120});
    m.lights = {lamp({120, 140, 150}, {9000, 8000, 6000}), lamp({430, 330, 100}, {1000, 2500, 6000})};
    return m;
}
WorldSide& side(SeamMap& m, BrushId b, std::size_t i) { return m.builder.world.sides[m.builder.world.brushes[b.at()].first_side + i]; }

// A convex block with these corners: faces by three of them each, whichever way round.
BrushId block(WorldBuilder& b, const std::vector<std::array<Vec3, 3>>& faces, Vec3 inside, ModelId model = {0}) {
    std::vector<test::SidePoints> sides;
    for (test::SidePoints f : faces) {
        if (dot(cross(f[2] - f[0], f[1] - f[0]), inside - f[0]) > 0) std::swap(f[1], f[2]);
        sides.push_back(f);
    }
    return b.brush(sides, Contents::solid, model);
}
void turn(WorldSide& s, double degrees) {
    const double a = degrees * kPi / 180;
    const Vec3 u = s.texture.u_axis, v = s.texture.v_axis;
    s.texture.u_axis = u * std::cos(a) + v * std::sin(a), s.texture.v_axis = v * std::cos(a) - u * std::sin(a);
}

// Two blocks side by side that are one floor, with other luxels, textures turned against each other, or both.
SeamMap floor_of_two(double luxel_a, double luxel_b, double degrees, double edge, double slant) {
    SeamMap m = room(fmt::format("floor, luxels {}|{}, turned {}, edge at {}{}", luxel_a, luxel_b, degrees, edge, slant != 0 ? fmt::format(" slant {}", slant) : ""));
    const std::vector<Vec2> left{{0, 0}, {edge, 0}, {edge + slant, 512}, {0, 512}}, right{{edge, 0}, {512, 0}, {512, 512}, {edge + slant, 512}};
    const BrushId a = m.builder.prism(left, -64, 0), b = m.builder.prism(right, -64, 0);
    side(m, a, 0).lightmap_scale = luxel_a, side(m, b, 0).lightmap_scale = luxel_b;
    turn(side(m, b, 0), degrees);
    return m;
}

// Two slopes that meet in a smooth ridge (height > 0) or groove.
SeamMap fold(double height, double luxel_a, double luxel_b, double degrees) {
    SeamMap m = room(fmt::format("{} of {}, luxels {}|{}, turned {}", height > 0 ? "ridge" : "groove", std::abs(height), luxel_a, luxel_b, degrees), height > 0);
    const double rim = height > 0 ? 0 : -height, mid = height > 0 ? height : 0;
    for (const bool right : {false, true}) {
        const double x0 = right ? 256 : 60, x1 = right ? 452 : 256, z0 = right ? mid : rim, z1 = right ? rim : mid;
        const BrushId b = block(m.builder,
                                {{Vec3{x0, 0, z0}, {x0, 512, z0}, {x1, 0, z1}}, {Vec3{0, 0, -64}, {64, 0, -64}, {0, 64, -64}}, {Vec3{x0, 0, 0}, {x0, 64, 0}, {x0, 0, 64}},
                                 {Vec3{x1, 0, 0}, {x1, 64, 0}, {x1, 0, 64}}, {Vec3{0, 0, 0}, {64, 0, 0}, {0, 0, 64}}, {Vec3{0, 512, 0}, {64, 512, 0}, {0, 512, 64}}},
                                {(x0 + x1) / 2, 256, -40});
        side(m, b, 0).lightmap_scale = right ? luxel_b : luxel_a;
        side(m, b, 0).smoothing_groups = 1;
        if (right) turn(side(m, b, 0), degrees);
    }
    return m;
}

SeamMap column(int sides, double radius, double luxel) {
    SeamMap m = room(fmt::format("column of {} sides, luxels {}", sides, luxel), false);
    std::vector<Vec2> base;
    for (int i = 0; i < sides; ++i) base.push_back({256 + radius * std::cos(2 * kPi * (i + 0.2) / sides), 256 + radius * std::sin(2 * kPi * (i + 0.2) / sides)});
    const BrushId b = m.builder.prism(base, -64, 192);
    for (int i = 0; i < sides; ++i) side(m, b, 2 + static_cast<std::size_t>(i)).smoothing_groups = 1, side(m, b, 2 + static_cast<std::size_t>(i)).lightmap_scale = luxel;
    return m;
}

SeamMap terrain(double luxel, double height) {
    SeamMap m = room(fmt::format("terrain of five, hills of {}, luxels {}", height, luxel));
    test::mixed_terrain(m.builder, 0, [=](double x, double y) { return height / 50 * test::hills(x, y); }, {0}, luxel);
    // It runs into the walls of the room and the pillar, whose light ends there.
    m.apart = [](Vec3 p) {
        return std::min({p.x, p.y, 512 - p.x, 512 - p.y}) < 1e-3 || std::max({196 - p.x, p.x - 212, 190 - p.y, p.y - 206}) < 1e-3;
    };
    return m;
}

SeamMap curves(double luxel_a, double luxel_b) { // a wave of two patches, through which the pillar comes: its sides are dark below it
    SeamMap m = room(fmt::format("two patches, luxels {}|{}", luxel_a, luxel_b));
    const auto wave = [](double x) { return 30 * std::sin(x / 70); };
    test::patch(m.builder, 5, 5, [&](std::uint32_t c, std::uint32_t r) { return Vec3{40 + 50.0 * c, 60 + 90.0 * r, wave(40 + 50.0 * c)}; }, {0}, luxel_a);
    test::patch(m.builder, 5, 5, [&](std::uint32_t c, std::uint32_t r) { return Vec3{240 + 50.0 * c, 60 + 90.0 * r, c == 1 ? 2 * wave(240) - wave(190) : wave(240 + 50.0 * c)}; }, {0}, luxel_b);
    m.apart = [](Vec3 p) {
        const auto side = [](double v, double lo, double hi) { return std::min(std::abs(v - lo), std::abs(v - hi)) < 1e-6; };
        return (side(p.x, 196, 212) && p.y > 189 && p.y < 207) || (side(p.y, 190, 206) && p.x > 195 && p.x < 213);
    };
    return m;
}

SeamMap tube(double luxel) {
    SeamMap m = room(fmt::format("tube of one patch, luxels {}", luxel), false);
    test::patch(m.builder, 9, 3, [&](std::uint32_t c, std::uint32_t r) { return Vec3{256 + 80 * test::kRing[c].x, 256 + 80 * test::kRing[c].y, -20 + 90.0 * r}; }, {0}, luxel);
    return m;
}

SeamMap door(double thickness, double offset) { // stands on the edge of two floors; one side is dark
    SeamMap m = floor_of_two(16, 10, 30, 256, 0);
    m.name = fmt::format("door of {} on the edge of two floors, {} off", thickness, offset);
    m.builder.box({256 + offset - thickness / 2, 0, 0}, {256 + offset + thickness / 2, 512, 192}, Contents::solid, m.builder.model("func_door"));
    m.apart = [](Vec3 p) { return std::abs(p.x - 256) < 1 && p.z < 1; };
    // Of the floors: a wall's luxels, one face on both sides, are another matter.
    m.dark = [=](Vec3 p) { return p.x > 256 + offset + thickness / 2 && p.z < 0.1 && p.y > 0.1 && p.y < 511.9; };
    // The walls are one face on both sides of the door: what their luxels there gather may not come back.
    for (Material& k : m.builder.world.materials) k.reflectance = {};
    m.lights.resize(1);
    return m;
}

// A wall thinner than a luxel parts floor and ceiling as far as it goes, and the charts of both sides go on past its end. There, within a luxel, they
// cannot show the same: what is read at the end of the wall is read at its foot too.
SeamMap wall_end(double thickness, double at, double length) {
    SeamMap m = room(fmt::format("wall of {} at {} that ends after {}", thickness, at, length), false);
    m.builder.box({at, 0, -64}, {at + thickness, length, 192});
    m.apart = [=](Vec3 p) { return std::max({at - p.x, p.x - at - thickness, std::abs(p.y - length)}) < 16; };
    return m;
}

// An edge of the mesh across which a surface goes on in another chart, or elsewhere in its own.
struct Edge {
    std::array<FaceId, 2> face;
    Vec3 from, to, n0, n1;
    std::array<double, 2> luxels{}; // its length on both sides
};
std::vector<Edge> edges_of(const Surfaces& s) {
    std::map<std::array<std::uint32_t, 2>, std::vector<std::array<std::uint32_t, 2>>> by_edge; // directed: triangle, corner
    for (std::uint32_t t = 0; t < s.triangles.size(); ++t)
        for (std::uint32_t c = 0; c < 3; ++c) by_edge[{s.triangles[t][c], s.triangles[t][(c + 1) % 3]}].push_back({t, c});
    std::vector<Edge> out;
    for (const auto& [ends, sides] : by_edge) {
        const auto other = by_edge.find({ends[1], ends[0]});
        if (ends[0] > ends[1] || other == by_edge.end() || sides.size() != 1 || other->second.size() != 1) continue;
        const auto [t, c] = sides[0];
        const auto [u, d] = other->second[0];
        const FaceId a = s.triangle_face[t], b = s.triangle_face[u];
        const Face &f = s.faces[a.at()], &g = s.faces[b.at()];
        if (!f.chart.valid() || !g.chart.valid() || f.curved() != g.curved()) continue;
        if (s.corner_normals[t][c] != s.corner_normals[u][(d + 1) % 3] || s.corner_normals[t][(c + 1) % 3] != s.corner_normals[u][d]) continue;
        const Vec3 p = s.positions[ends[0]], q = s.positions[ends[1]];
        const auto at = [&](FaceId x, Vec3 v) { return luxel_from_world(s, x, v); };
        const auto apart = [](Vec2 v, Vec2 w) { return std::hypot(v.x - w.x, v.y - w.y); };
        if (f.chart == g.chart && apart(at(a, p), at(b, p)) < 1e-6) continue;
        out.push_back({{a, b}, p, q, static_cast<Vec3>(s.corner_normals[t][c]), static_cast<Vec3>(s.corner_normals[t][(c + 1) % 3]),
                       {apart(at(a, p), at(a, q)), apart(at(b, p), at(b, q))}});
    }
    return out;
}

// What of the faces is which face of the level: all of a curve is one.
std::vector<std::uint32_t> level_faces(const Surfaces& s) {
    std::vector<std::uint32_t> out;
    std::uint32_t next = 0, last = UINT32_MAX;
    for (const Face& f : s.faces) {
        if (!f.curved()) out.push_back(next++);
        else if (!f.drawn && !f.sky) out.push_back(UINT32_MAX);
        else if (f.curve == last) out.push_back(next - 1);
        else out.push_back(next++), last = f.curve;
    }
    return out;
}

} // namespace

std::vector<SeamMap> seam_maps() {
    std::vector<SeamMap> maps;
    maps.push_back(floor_of_two(16, 10, 0, 256, 0));
    maps.push_back(floor_of_two(16, 16, 30, 256, 0));
    maps.push_back(floor_of_two(16, 6.5, 45, 250.3125, 77));
    maps.push_back(floor_of_two(32, 4, 0, 264, 0));
    maps.push_back(floor_of_two(8, 8, 90, 251.5, -33));
    maps.push_back(fold(60, 16, 16, 0));
    maps.push_back(fold(100, 16, 9, 20));
    maps.push_back(fold(-50, 16, 16, 0));
    maps.push_back(column(12, 60, 8));
    maps.push_back(terrain(16, 50));
    maps.push_back(terrain(7, 20));
    maps.push_back(curves(16, 16));
    maps.push_back(curves(8, 12));
    maps.push_back(tube(12));
    maps.push_back(door(8, 0));
    maps.push_back(door(0.25, 0));
    maps.push_back(door(1, 0.25));
    maps.push_back(wall_end(1, 256, 320));
    maps.push_back(wall_end(3, 251.5, 397));
    maps.push_back(wall_end(12, 250, 300));
    return maps;
}

SeamsFound find_seams_shown(SeamMap m, double error_percent, RnmEncoding encoding, int threads, double luxel_error) {
    World& world = m.builder.world;
    Context context;
    context.threads = threads;
    SeamsFound out;
    auto csg = build_csg(world, {}, context);
    if (!csg) return out.compiled = false, out;
    auto bsp = build_bsp(world, *csg, {}, context);
    if (!bsp) return out.compiled = false, out;
    auto built = build_surfaces(world, *csg, *bsp, m.surfaces, context);
    if (!built) return out.compiled = false, out;
    const Surfaces& s = *built;
    auto baked = bake_light(world, *bsp, bsp->planes, s, m.lights, {.error_percent = error_percent, .encoding = encoding, .directional = Directional::all}, context);
    if (!baked) return out.compiled = false, out;
    Visibility visibility;
    visibility.cluster_count = bsp->cluster_count;
    visibility.rows.assign(std::size_t{bsp->cluster_count} * ((bsp->cluster_count + 63) / 64), ~std::uint64_t{0});
    auto density = level_texels(s, *baked, {.error_percent = luxel_error < 0 ? error_percent / 2 : luxel_error}, context);
    if (!density) return out.compiled = false, out;
    out.texels_baked = s.texel_count, out.texels = density->grids.empty() ? s.texel_count : density->flat.size();
    const Bytes bytes = pack({world, *csg, *bsp, visibility, s, m.lights, *baked, {}, {}, "{}", "", "", &*density}, {.zstd_level = 1}, context);
    const level::Level level(bytes);

    const double floor = 0.02 * mean_irradiance(s, *baked);
    const std::vector<std::uint32_t> numbers = level_faces(s);
    const auto shown = [&](FaceId face, Vec3 p, const Vec3* normal) {
        const double at[3] = {p.x, p.y, p.z};
        float rgb[3] = {};
        if (normal) {
            const float n[3] = {static_cast<float>(normal->x), static_cast<float>(normal->y), static_cast<float>(normal->z)};
            KILN_CHECK(kiln_level_eval_rnm(level.get(), numbers[face.at()], at, n, rgb) == KILN_OK);
        } else {
            KILN_CHECK(kiln_level_eval_flat(level.get(), numbers[face.at()], at, rgb) == KILN_OK);
        }
        return Rgbd{rgb[0], rgb[1], rgb[2]};
    };
    if (m.dark) {
        double brightest = 0;
        for (const Rgb& e : baked->flat) brightest = std::max(brightest, static_cast<double>(max_component(e)));
        for (const Luxel& l : s.luxels)
            for (std::uint32_t k = 0; k < l.piece_count; ++k)
                for (const Vec2 v : points_of(s, s.pieces[l.first_piece + k])) {
                    const Vec2 c = centroid_of(s, l);
                    const FaceId face = s.pieces[l.first_piece + k].face;
                    const Vec3 p = world_from_luxel(s, face, v + (c - v) * 1e-3);
                    if (m.dark(p + s.faces[face.at()].normal * 0.01)) out.dark = std::max(out.dark, max_component(shown(face, p, nullptr)) / brightest);
                }
    }
    std::vector<double> flat, leaning;
    for (const Edge& e : edges_of(s)) {
        const auto count = static_cast<int>(std::ceil(3 * std::max(e.luxels[0], e.luxels[1])));
        std::array<Vec3, 2> in;
        for (std::size_t k = 0; k < 2; ++k) in[k] = normalize(cross(s.faces[e.face[k].at()].normal, e.to - e.from)) * (k ? -1.0 / 1024 : 1.0 / 1024);
        for (int i = 0; i < count; ++i) {
            const double at = (i + 0.37) / count;
            const Vec3 p = e.from + (e.to - e.from) * at;
            if (m.apart && m.apart(p)) continue;
            ++out.points;
            const Vec3 n = normalize(e.n0 + (e.n1 - e.n0) * at);
            const Frame around = frame_around(n);
            const auto differ = [&](const Vec3* normal) {
                const Rgbd a = shown(e.face[0], p + in[0], normal), b = shown(e.face[1], p + in[1], normal);
                double worst = 0;
                for (std::size_t c = 0; c < 3; ++c) worst = std::max(worst, std::abs(a[c] - b[c]) / std::max(0.5 * (a[c] + b[c]), floor));
                return worst;
            };
            flat.push_back(differ(nullptr));
            if (out.flat_most < flat.back()) out.flat_most = flat.back(), out.where = fmt::format("{:.2f} {:.2f} {:.2f}", p.x, p.y, p.z);
            for (int k = 0; k < 4; ++k) {
                const double tilt = (k % 2 ? 30 : 20) * kPi / 180, phi = 1 + k * kPi / 2;
                const Vec3 lean = around.world({std::sin(tilt) * std::cos(phi), std::sin(tilt) * std::sin(phi), std::cos(tilt)});
                leaning.push_back(differ(&lean));
                out.leaning_most = std::max(out.leaning_most, leaning.back());
            }
        }
    }
    const auto p99 = [](std::vector<double>& v) {
        if (v.empty()) return 0.0;
        const auto at = v.begin() + static_cast<std::ptrdiff_t>(0.99 * static_cast<double>(v.size() - 1));
        std::nth_element(v.begin(), at, v.end());
        return *at;
    };
    out.flat_p99 = p99(flat), out.leaning_p99 = p99(leaning);
    return out;
}

} // namespace kiln::proof

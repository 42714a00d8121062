// What must stay dark, and meshes that must hold water.
#include "libs/sampling/maps.h"
#include "libs/parallel/parallel.h"
#include "tools/stability_bench/sweeps.h"
#include <algorithm>
#include <map>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace kiln::bench {
namespace {

const std::vector<Light> kNoLights; // scenes keep a reference

// Most light in the dark over the mean in the bright.
double leaked(std::span<const Spot> spots, std::span<const double> got, const std::function<bool(Vec3)>& dark) {
    double most = 0, sum = 0, area = 0;
    for (std::size_t i = 0; i < spots.size(); ++i) {
        if (dark(spots[i].point)) most = std::max(most, std::abs(got[i]));
        else sum += got[i] * spots[i].area, area += spots[i].area;
    }
    return sum > 0 ? most / (sum / area) : 0;
}

} // namespace

// One floor and one ceiling run through under a sealed wall; a lamp on one side.
void sweep_wall_thickness(SweepReport& r, const SweepSettings& s, Context& context) {
    for (const double luxel : values_of(s, {4, 16, 64}, {16})) {
        Panel panel{fmt::format("luxels and patches of {:g}", luxel), {}, {"wall, map units"}, {"most behind the wall / mean before it", true, 1e-12}, {{1e-6, "1e-6"}}};
        for (const double thickness : values_of(s, {64, 16, 4, 1, 0.25, 0.0625}, {16, 0.0625})) {
            std::map<std::string, std::pair<std::size_t, double>> most;
            for (std::uint64_t k = 0; k < (s.quick ? 2u : 5u); ++k) {
                const double at = 120 + std::round(16 * 40 * uniform(k, 7)) / 16;
                MapText map;
                map.luxel = luxel;
                const std::string grey = map.material("grey", 0.8), lit = map.material("lamp", 0, 50);
                map.room({0, 0, 0}, {320, 128, 96}, grey);
                map.box({at, 0, 0}, {at + thickness, 128, 96}, grey);
                map.box({32, 40, 88}, {72, 80, 96}, {grey, grey, grey, grey, lit, grey});
                map.entity("info_player_start", {16, 16, 32}), map.entity("info_player_start", {300, 64, 32});
                const auto c = built(map, context);
                const auto spots = spots_of(c->surfaces);
                const auto dark = [&](Vec3 p) { return p.x >= at + thickness - 1e-6; };
                const auto put = [&](const std::string& name, std::size_t look, const std::vector<double>& got) {
                    if (got.empty()) return;
                    auto& [l, m] = most[name];
                    l = look, m = std::max(m, leaked(spots, got, dark));
                };
                put("kiln", 0, irradiance_of(c->surfaces, baked(*c, {}, {}, context), spots));
                if (s.rivals && luxel >= 16 && k < 2)
                    for (const Rival& rival : all_rivals(luxel, 16, 1024, 64)) put(rival.name, rival.look, irradiance_of(rival, *c, {}, spots, context));
            }
            add_point(panel, "kiln", 0, thickness, most["kiln"].second);
            for (const auto& [name, value] : most)
                if (name != "kiln") add_point(panel, name, value.first, thickness, value.second);
        }
        r.panels.push_back(panel);
    }
}

// A box of six brushes that touch, in a room whose walls all shine; the whole map moved, up to where maps end: 2^17 units.
void sweep_dark_box(SweepReport& r, const SweepSettings& s, Context& context) {
    for (const double thickness : values_of(s, {4, 0.25}, {0.25})) {
        Panel panel{fmt::format("walls of {:g}", thickness), {}, {"offset from the origin, map units", true, 1}, {"most inside / mean outside", true, 1e-12}, {}};
        for (const double offset : values_of(s, {0, 256, 4096, 16384, 65536, 130900}, {0, 130900})) {
            MapText map;
            const std::string grey = map.material("grey", 0.8), lit = map.material("lit", 0.5, 5);
            map.placing.offset = {offset, offset * 0.75 + 0.5, -offset + 0.25};
            map.room({0, 0, 0}, {128, 128, 96}, lit);
            map.room({41.3125, 37.6875, 21.125}, {83.875, 90.1875, 61.6875}, grey, thickness);
            map.entity("info_player_start", {16, 16, 16}), map.entity("info_player_start", {60, 60, 40});
            const auto c = built(map, context);
            const auto spots = spots_of(c->surfaces);
            const auto inside = [&](Vec3 world) {
                const Vec3 p = map.placing.back(world);
                return p.x > 41.3 && p.x < 83.9 && p.y > 37.6 && p.y < 90.2 && p.z > 21.1 && p.z < 61.7;
            };
            // At the faces of the box's outside p is outside by its thickness.
            const Lighting l = baked(*c, {}, {}, context);
            add_point(panel, "kiln", 0, offset, leaked(spots, irradiance_of(c->surfaces, l, spots), inside));
            if (l.escaped_rays + l.back_face_rays) r.notes.push_back(fmt::format("Walls of {:g} at {:g}: {} rays escaped, {} met backs.", thickness, offset, l.escaped_rays, l.back_face_rays));
            for (const Rival& rival : s.rivals ? all_rivals(16, 16, 1024, 64) : std::vector<Rival>{}) {
                const auto got = irradiance_of(rival, *c, kNoLights, spots, context);
                if (!got.empty()) add_point(panel, rival.name, rival.look, offset, leaked(spots, got, inside));
            }
        }
        r.panels.push_back(panel);
    }
}

namespace {

// A box whose floor is a fan about its middle, `blades` to each wall, turned out of the axes. Corners of the fan lie inside
// the long lower edges of the walls.
struct Fan {
    std::vector<Vec2> rim; // in order, corners of the box included
    Placing placing;
    static constexpr double kHalf = 100, kHeight = 93.75, kGrid = 25.0 / 64;
    // `exact`: corners turned by (3, 4, 5) about z and then about x lie on 1/64 unit again, so that what touches touches. Else
    // each is rounded for itself, by the map in its tenth decimal and by the compiler to 1/1024 unit.
    Fan(std::size_t blades, bool exact) {
        if (exact) placing.axes = {Vec3{0.6, 0.64, 0.48}, {-0.8, 0.48, 0.36}, {0, -0.6, 0.8}};
        else placing = turned_about(normalize(Vec3{1, 2, 3}), 0.7);
        placing.offset = {331.6875, -57.3125, 12.25};
        const auto grid = [](double x) { return std::round(x / kGrid) * kGrid; };
        const Vec2 corners[] = {{-kHalf, -kHalf}, {kHalf, -kHalf}, {kHalf, kHalf}, {-kHalf, kHalf}};
        for (std::size_t side = 0; side < 4; ++side) {
            const Vec2 a = corners[side], b = corners[(side + 1) % 4];
            rim.push_back(a);
            for (std::size_t i = 1; i < blades; ++i) {
                const Vec2 p = a + (b - a) * ((static_cast<double>(i) + 0.6 * (uniform(side, i) - 0.5)) / static_cast<double>(blades));
                rim.push_back({grid(p.x), grid(p.y)});
            }
        }
    }
    Vec3 floor(std::size_t i) const { return {rim[i % rim.size()].x, rim[i % rim.size()].y, 0}; }
};

// The same box as a plain mesh. `shared`: walls have the fan's corners on their lower edges; else they are whole rectangles, as drawn.
Surfaces plain_mesh(const Fan& fan, bool shared) {
    Surfaces s;
    std::map<std::array<double, 3>, std::uint32_t> known;
    const auto corner = [&](Vec3 p) {
        const auto [at, fresh] = known.emplace(std::array{p.x, p.y, p.z}, static_cast<std::uint32_t>(s.positions.size()));
        if (fresh) s.positions.push_back(fan.placing.at(p));
        return at->second;
    };
    const auto face = [&](const std::vector<std::array<Vec3, 3>>& triangles) {
        Face f;
        const auto& t = triangles[0];
        f.normal = fan.placing.turned(normalize(cross(t[1] - t[0], t[2] - t[0])));
        f.distance = dot(f.normal, fan.placing.at(t[0]));
        f.material = MaterialId{0}, f.model = ModelId{0};
        f.first_triangle = static_cast<std::uint32_t>(s.triangles.size()), f.triangle_count = static_cast<std::uint32_t>(triangles.size());
        for (const auto& [a, b, c] : triangles) {
            s.triangles.push_back({corner(a), corner(b), corner(c)});
            s.triangle_face.push_back(id<FaceId>(s.faces.size()));
            s.corner_normals.push_back({static_cast<Vec3f>(f.normal), static_cast<Vec3f>(f.normal), static_cast<Vec3f>(f.normal)});
        }
        s.faces.push_back(f);
    };
    for (std::size_t i = 0; i < fan.rim.size(); ++i) face({{Vec3{0, 0, 0}, fan.floor(i), fan.floor(i + 1)}});
    const double h = Fan::kHalf, z = Fan::kHeight;
    const Vec3 c[] = {{-h, -h, 0}, {h, -h, 0}, {h, h, 0}, {-h, h, 0}}, up{0, 0, z};
    const std::size_t blades = fan.rim.size() / 4;
    for (std::size_t i = 0; i < 4; ++i) {
        const Vec3 a = c[i], b = c[(i + 1) % 4];
        std::vector<std::array<Vec3, 3>> wall{{b, a + up, b + up}};
        for (std::size_t k = 0; k < blades && shared; ++k) wall.push_back({fan.floor(i * blades + k + 1), fan.floor(i * blades + k), a + up});
        if (!shared) wall.push_back({b, a, a + up});
        face(wall);
    }
    face({{c[3] + up, c[2] + up, c[1] + up}, {c[3] + up, c[1] + up, c[0] + up}});
    return s;
}

// As it would be with positions in single precision, 2^15 units from the origin.
Surfaces in_single_precision(Surfaces s) {
    const Vec3 far{32768, -32768, 32768};
    for (Vec3& p : s.positions)
        for (std::size_t a = 0; a < 3; ++a) p[a] = static_cast<double>(static_cast<float>(p[a] + far[a])) - far[a];
    for (std::size_t f = 0; f < s.faces.size(); ++f) { // what is hit is told by the face's plane: a little beside its corners now
        Face& face = s.faces[f];
        face.distance = dot(face.normal, s.positions[s.triangles[face.first_triangle][0]]);
    }
    return s;
}

// Rays from inside at corners or edges of the mesh. What meets nothing or a back has left the box.
double leaks_of(const World& world, const Surfaces& s, const Fan& fan, bool corners, std::uint64_t rays, Context& context) {
    const TraceScene scene(world, s);
    constexpr std::uint64_t kChunk = 4096;
    std::vector<std::uint64_t> lost((rays + kChunk - 1) / kChunk);
    parallel_for(context, lost.size(), [&](std::size_t chunk) {
        Random random(chunk);
        const auto inner = [&](double half) { return (2 * random() - 1) * half; };
        for (std::uint64_t k = 0; k < kChunk; ++k) {
            const double x = inner(0.8 * Fan::kHalf), y = inner(0.8 * Fan::kHalf);
            const Vec3 from = fan.placing.at({x, y, (0.2 + 0.6 * random()) * Fan::kHeight});
            const auto& t = s.triangles[std::min(s.triangles.size() - 1, static_cast<std::size_t>(random() * static_cast<double>(s.triangles.size())))];
            const auto e = std::min<std::size_t>(2, static_cast<std::size_t>(random() * 3));
            const double along = corners ? 0 : random();
            const Vec3 to = s.positions[t[e]] * (1 - along) + s.positions[t[(e + 1) % 3]] * along;
            const auto hit = scene.closest(from, normalize(to - from));
            lost[chunk] += !hit || hit->back;
        }
    });
    std::uint64_t sum = 0;
    for (const std::uint64_t l : lost) sum += l;
    return static_cast<double>(sum);
}

} // namespace

void sweep_fans(SweepReport& r, const SweepSettings& s, Context& context) {
    Panel edges{"rays aimed at shared edges, from inside", {}, {"blades to a wall"}, {"rays that got out, of a million", true, 0.01}, {}}, corners = edges;
    corners.title = "rays aimed at shared corners, from inside";
    const double rays = s.quick ? 1 << 17 : 10e6 / 8;
    for (const bool exact : {true, false})
    for (const double blades : values_of(s, {3, 10, 30, 100}, {30})) {
        const Fan fan(static_cast<std::size_t>(blades), exact);
        MapText map;
        map.luxel = 64;
        map.placing = fan.placing;
        const std::string grey = map.material("grey", 0.5);
        const double h = Fan::kHalf, z = Fan::kHeight;
        for (std::size_t i = 0; i < fan.rim.size(); ++i) { // wedges under the floor, tops flush
            const Vec3 a = fan.floor(i), b = fan.floor(i + 1), o{}, down{0, 0, -40 * Fan::kGrid};
            const Vec3 centre = (a + b) * (1.0 / 3) + down * 0.5;
            std::vector<MapSide> sides;
            const auto side = [&](std::array<Vec3, 3> t) {
                if (dot(cross(t[2] - t[0], t[1] - t[0]), t[0] - centre) < 0) std::swap(t[1], t[2]);
                sides.push_back({t, grey});
            };
            side({o, a, b}), side({o + down, a + down, b + down}), side({o, a, a + down}), side({o, b, b + down}), side({a, b, a + down});
            map.brush(sides);
        }
        const double t = 40 * Fan::kGrid; // of walls
        map.box({-h - t, -h - t, -t}, {-h, h + t, z}, grey), map.box({h, -h - t, -t}, {h + t, h + t, z}, grey);
        map.box({-h, -h - t, -t}, {h, -h, z}, grey), map.box({-h, h, -t}, {h, h + t, z}, grey);
        map.box({-h - t, -h - t, z}, {h + t, h + t, z + t}, grey);
        map.entity("info_player_start", {0, 0, 40});
        const auto c = built(map, context);
        const auto count = static_cast<std::uint64_t>(rays);
        for (const bool at_corners : {false, true}) {
            Panel& panel = at_corners ? corners : edges;
            add_point(panel, exact ? "kiln" : "kiln, corners rounded", exact ? 0 : 1, blades, leaks_of(c->world, c->surfaces, fan, at_corners, count, context) / rays * 1e6);
            if (exact) continue;
            add_point(panel, "plain mesh, corners shared, single precision", 3, blades, leaks_of(c->world, in_single_precision(plain_mesh(fan, true)), fan, at_corners, count, context) / rays * 1e6);
            add_point(panel, "polygons as drawn, single precision", 2, blades, leaks_of(c->world, in_single_precision(plain_mesh(fan, false)), fan, at_corners, count, context) / rays * 1e6);
        }
    }
    r.notes.push_back(fmt::format("{:.2g} rays a point. Plain meshes: 2^15 units from the origin, in the same tracer; as drawn, walls lack the corners that the floor's fan has on their edges. Corners rounded: the blades are turned by an odd angle, each corner rounded for itself, so that they no longer touch; what is left between them is thinner than single precision.", rays));
    r.panels = {edges, corners};
}

} // namespace kiln::bench

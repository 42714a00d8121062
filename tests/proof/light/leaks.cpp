#include "tests/proof/light/leaks.h"
#include "compiler/ambient/ambient.h"
#include "compiler/light/field.h"
#include "compiler/light/patches.h"
#include "compiler/light/shown.h"
#include "libs/sampling/sobol.h"
#include "tests/support/curves.h"
#include <fmt/format.h>
#include <numbers>

namespace kiln::proof {
namespace {

using test::WorldBuilder;

constexpr double kInside = 1.0 / 512;           // map units from the border of an air; the thinnest wall is 1/16
const Vec3 kLo{0, 0, 0}, kHi{192, 128, 96};     // the room that most maps divide
constexpr double kShell = 16;                   // thickness of its walls; what divides it reaches 8 into them

std::function<bool(Vec3)> within(Vec3 lo, Vec3 hi) {
    return [=](Vec3 p) {
        for (std::size_t k = 0; k < 3; ++k)
            if (p[k] < lo[k] + kInside || p[k] > hi[k] - kInside) return false;
        return true;
    };
}
// On one side of a plane and in the room.
std::function<bool(Vec3)> beyond(Vec3 n, double d) {
    return [=, room = within(kLo, kHi)](Vec3 p) { return room(p) && dot(p, n) > d + kInside; };
}

LeakMap plain(std::string name) {
    LeakMap m;
    m.name = std::move(name);
    m.builder.room(kLo, kHi, kShell);
    return m;
}
// Reached, or it would be filled in.
void reach(LeakMap& m, Vec3 p) { m.builder.point_entity("info_player_start", p); }

// A slab with faces dot(n, x) = d and d + thickness through the whole room, from `lo` to `hi` in z; n has no z.
void slab(WorldBuilder& b, Vec3 n, double d, double thickness, Contents contents, double lo, double hi) {
    const Vec3 u{-n.y, n.x, 0};
    const auto at = [&](double a, double w, double z) { return n * a + u * w + Vec3{0, 0, z}; };
    const double reach = 400;
    // Ends are those of the room's shell, half way in: axis-aligned, so that no end shows.
    std::vector<test::SidePoints> sides{
        {Vec3{0, 0, hi}, {0, 64, hi}, {64, 0, hi}},
        {Vec3{0, 0, lo}, {64, 0, lo}, {0, 64, lo}},
        {at(d + thickness, 0, 0), at(d + thickness, 0, 64), at(d + thickness, reach, 0)},
        {at(d, 0, 0), at(d, reach, 0), at(d, 0, 64)},
        {Vec3{-8, 0, 0}, {-8, 64, 0}, {-8, 0, 64}},
        {Vec3{kHi.x + 8, 0, 0}, {kHi.x + 8, 0, 64}, {kHi.x + 8, 64, 0}},
        {Vec3{0, -8, 0}, {0, -8, 64}, {64, -8, 0}},
        {Vec3{0, kHi.y + 8, 0}, {64, kHi.y + 8, 0}, {0, kHi.y + 8, 64}},
    };
    b.brush(sides, contents);
}

LeakMap wall(double thickness, double at, double degrees, Contents contents) {
    LeakMap m = plain(fmt::format("{} wall of {} at {}{}", contents == Contents::detail ? "detail" : "solid", thickness, at,
                                  degrees != 0 ? fmt::format(" turned by {}", degrees) : ""));
    const double a = degrees * std::numbers::pi / 180;
    const Vec3 n{std::cos(a), std::sin(a), 0};
    const double d = dot(n, Vec3{at, 64, 0});
    slab(m.builder, n, d, thickness, contents, -8, kHi.z + 8);
    // The planes as they were written: rounded to ten decimals.
    m.dark = beyond(n, d + thickness);
    m.bright = beyond(-n, -d);
    reach(m, {16, 64, 48}), reach(m, {176, 64, 48});
    m.lamps = {{20, 40, 60}, {40, 100, 20}};
    return m;
}

LeakMap closet(double thickness, Vec3 lo, Vec3 hi) {
    LeakMap m = plain(fmt::format("closet with walls of {} at {} {} {}", thickness, lo.x, lo.y, lo.z));
    const Vec3 t{thickness, thickness, thickness};
    m.builder.room(lo, hi, thickness);
    reach(m, (lo + hi) * 0.5), reach(m, {8, 8, 8});
    m.dark = within(lo, hi);
    m.bright = [in = within(kLo, kHi), lo = lo - t, hi = hi + t](Vec3 p) {
        bool out = false;
        for (std::size_t k = 0; k < 3; ++k) out |= p[k] < lo[k] - kInside || p[k] > hi[k] + kInside;
        return out && in(p);
    };
    m.lamps = {{16, 16, 80}, {176, 112, 80}, {176, 16, 60}};
    return m;
}

// A closet in the corner of the room: two walls that meet in an edge, wherever in a luxel that is, under a lid.
LeakMap corner(double thickness, double x, double y, double z) {
    LeakMap m = plain(fmt::format("corner of {} at {} {} {}", thickness, x, y, z));
    m.builder.box({x, y, -8}, {x + thickness, kHi.y + 8, z + thickness});
    m.builder.box({x + thickness, y, -8}, {kHi.x + 8, y + thickness, z + thickness});
    m.builder.box({x + thickness, y + thickness, z}, {kHi.x + 8, kHi.y + 8, z + thickness});
    m.dark = within({x + thickness, y + thickness, 0}, {kHi.x, kHi.y, z});
    m.bright = [in = within(kLo, kHi), x, y, z, thickness](Vec3 p) {
        return in(p) && (p.x < x - kInside || p.y < y - kInside || p.z > z + thickness + kInside);
    };
    reach(m, {kHi.x - 4, kHi.y - 4, 4}), reach(m, {16, 16, 48});
    m.lamps = {{16, 16, 40}, {16, 112, 30}, {170, 16, 30}, {150, 100, 90}};
    return m;
}

// Walls that meet in one upright edge, every other place between them lit.
LeakMap fan(int walls, double thickness, Vec2 at) {
    LeakMap m = plain(fmt::format("fan of {} walls of {} at {} {}", walls, thickness, at.x, at.y));
    std::vector<Vec3> ways;
    for (int i = 0; i < walls; ++i) {
        const double a = 2 * std::numbers::pi * (i + 0.13) / walls;
        const Vec3 way{std::cos(a), std::sin(a), 0}, side{-way.y, way.x, 0};
        ways.push_back(way);
        const Vec3 from{at.x, at.y, 0}, to = from + way * 110, w = side * (thickness / 2);
        const auto flat = [](Vec3 p) { return Vec2{p.x, p.y}; };
        // A wedge at its end, so that all edges are one.
        const std::vector<Vec2> base{flat(from), flat(from + way * 8 - w), flat(to - w), flat(to + w), flat(from + way * 8 + w)};
        m.builder.prism(base, -8, kHi.z + 8);
    }
    const auto sector = [ways, at, thickness](Vec3 p) { // or -1: in a wall, or at its face
        const Vec3 d{p.x - at.x, p.y - at.y, 0};
        for (const Vec3& w : ways)
            if (dot(d, w) > 0 && std::abs(cross(w, d).z) < thickness / 2 + 2 * kInside) return -1;
        for (std::size_t i = 0; i < ways.size(); ++i)
            if (cross(ways[i], d).z > 0 && cross(d, ways[(i + 1) % ways.size()]).z > 0) return static_cast<int>(i);
        return -1;
    };
    m.dark = [sector, in = within({at.x - 90, at.y - 90, 0}, {at.x + 90, at.y + 90, kHi.z})](Vec3 p) { return in(p) && sector(p) == 1; };
    m.bright = [sector, in = within(kLo, kHi)](Vec3 p) { return in(p) && sector(p) != 1 && sector(p) >= 0; };
    m.builder.room({at.x - 90, at.y - 90, 0}, {at.x + 90, at.y + 90, kHi.z}, 40);
    for (int i = 0; i < walls; ++i) {
        const double a = 2 * std::numbers::pi * (i + 0.63) / walls;
        const Vec3 p{at.x + 50 * std::cos(a), at.y + 50 * std::sin(a), 48};
        reach(m, p);
        if (i != 1) m.lamps.push_back(p);
    }
    return m;
}

LeakMap floors(double thickness, double z, bool dark_above) {
    LeakMap m = plain(fmt::format("dark {} a slab of {} at {}", dark_above ? "above" : "below", thickness, z));
    m.builder.box({-8, -8, z}, {kHi.x + 8, kHi.y + 8, z + thickness});
    const auto above = within({0, 0, z + thickness}, kHi), below = within({0, 0, 0}, {kHi.x, kHi.y, z});
    m.dark = dark_above ? above : below, m.bright = dark_above ? below : above;
    reach(m, {20, 20, z - 10}), reach(m, {20, 20, z + thickness + 10});
    m.lamps = {{30, 30, dark_above ? z - 12 : z + thickness + 12}, {150, 90, dark_above ? z - 8 : z + thickness + 8}};
    return m;
}

// Two sheets of terrain back to back, on end, displaced by bumps: nothing solid between.
LeakMap terrain_wall(double thickness, double at, double bump) {
    LeakMap m = plain(fmt::format("terrain on end, {} thick at {}, bumps of {}", thickness, at, bump));
    const auto height = [=](double y, double z) { return bump * std::sin(y / 17) * std::cos(z / 13); };
    WorldBuilder& b = m.builder;
    for (const bool high : {false, true}) {
        const Vec3 lo{high ? at + thickness / 2 - 4 : at - thickness / 2, -8, -8}, hi{high ? at + thickness / 2 : at - thickness / 2 + 4, kHi.y + 8, kHi.z + 8};
        const BrushId brush = b.box(lo, hi);
        WorldBrush& w = b.world.brushes[brush.at()];
        const SideId side{w.first_side + (high ? 1u : 0u)};
        w.displaced = true, w.contents = Contents::empty;
        WorldDisplacement d;
        const double x = high ? hi.x : lo.x;
        // Columns along y, rows along z (high) or the other way round, so that the front is outwards.
        d.side = side;
        d.grid.power = 4, d.grid.start = {x, lo.y, lo.z}, d.grid.line = b.world.sides[side.at()].line;
        for (int r = 0; r <= 16; ++r)
            for (int c = 0; c <= 16; ++c) {
                const double s = (high ? c : r) / 16.0, t = (high ? r : c) / 16.0;
                d.grid.normals.push_back({1, 0, 0});
                d.grid.distances.push_back(height(lo.y + (hi.y - lo.y) * s, lo.z + (hi.z - lo.z) * t));
                d.grid.alphas.push_back(0);
            }
        b.world.sides[side.at()].displacement = static_cast<std::int32_t>(b.world.displacements.size());
        b.world.displacements.push_back(d);
    }
    const double most = std::abs(bump) + thickness;
    m.dark = within({at + most, 0, 0}, kHi), m.bright = within(kLo, {at - most, kHi.y, kHi.z});
    reach(m, {16, 64, 48}), reach(m, {176, 64, 48});
    m.lamps = {{20, 40, 60}, {40, 100, 20}};
    return m;
}

// A sheet of patches from floor to ceiling, bent by `bump`, nothing solid beside it; its front to the bright room or to the dark one.
LeakMap patch_wall(double at, double bump, bool front_to_dark) {
    LeakMap m = plain(fmt::format("patches from wall to wall at {}, bent by {}, front to the {} room", at, bump, front_to_dark ? "dark" : "bright"));
    const auto point = [=](std::uint32_t column, std::uint32_t row) {
        const double y = kHi.y * (front_to_dark ? column : 4 - column) / 4;
        return Vec3{at + (column == 1 ? bump : column == 3 ? -bump : 0), y, kHi.z * row / 2};
    };
    test::patch(m.builder, 5, 3, point);
    const double most = std::abs(bump) + 0.25;
    m.dark = within({at + most, 0, 0}, kHi), m.bright = within(kLo, {at - most, kHi.y, kHi.z});
    reach(m, {16, 64, 48}), reach(m, {176, 64, 48});
    m.lamps = {{20, 40, 60}, {40, 100, 20}};
    return m;
}

// A round shaft of patches that look inwards, dark within: from floor to ceiling, or up to `top` under a lid.
LeakMap patch_column(double radius, double top) {
    LeakMap m = plain(fmt::format("patches round a shaft of {}, {} high", radius, top));
    const Vec3 centre{110.3125, 60.6875, 0};
    test::patch(m.builder, 9, 3, [&](std::uint32_t column, std::uint32_t row) {
        const Vec2 at = test::kRing[8 - column] * radius;
        return centre + Vec3{at.x, at.y, top * row / 2};
    });
    if (top < kHi.z) m.builder.box({centre.x - radius - 8, centre.y - radius - 8, top}, {centre.x + radius + 8, centre.y + radius + 8, top + 1});
    const auto from_centre = [=](Vec3 p) { return std::hypot(p.x - centre.x, p.y - centre.y); };
    // Chords lie within the curve, by less than a unit.
    m.dark = [=, in = within(kLo, {kHi.x, kHi.y, top})](Vec3 p) { return in(p) && from_centre(p) < radius - 1; };
    m.bright = [=, in = within(kLo, kHi)](Vec3 p) { return in(p) && from_centre(p) > 1.5 * radius; };
    reach(m, {16, 64, 48}), reach(m, centre + Vec3{0, 0, top / 2});
    m.lamps = {{20, 40, 60}, {170, 100, 20}};
    return m;
}

// A wall with a doorway and what fills it, flush or thinner: a door of its own model, or a brush drawn as a grate without a hole.
LeakMap door(double wall_thickness, double door_thickness, double at, bool grate = false) {
    LeakMap m = plain(fmt::format("{} of {} in a wall of {} at {}", grate ? "grate" : "door", door_thickness, wall_thickness, at));
    WorldBuilder& b = m.builder;
    const double x0 = at, x1 = at + wall_thickness;
    b.box({x0, -8, -8}, {x1, 40, kHi.z + 8});
    b.box({x0, 88, -8}, {x1, kHi.y + 8, kHi.z + 8});
    b.box({x0, 40, 72}, {x1, 88, kHi.z + 8});
    const double d0 = (x0 + x1 - door_thickness) / 2, d1 = d0 + door_thickness;
    if (grate) {
        const MaterialId opaque = b.material("grate", kAlphaTested);
        b.world.materials[opaque.at()].alpha_stated = true;
        b.box({d0, 40, 0}, {d1, 88, 72}, Contents::grate, {0}, opaque);
    } else {
        b.box({d0, 40, 0}, {d1, 88, 72}, Contents::solid, b.model("func_door"));
    }
    const double jamb = (wall_thickness - door_thickness) / 2;
    m.dark = [in = within({x1, 0, 0}, kHi), way = within({d1, 40, 0}, {x1 + 1, 88, 72}), jamb](Vec3 p) { return in(p) || (jamb > 0 && way(p)); };
    m.bright = within(kLo, {x0, kHi.y, kHi.z});
    reach(m, {16, 64, 48}), reach(m, {176, 64, 48});
    m.lamps = {{20, 40, 60}, {40, 100, 20}};
    return m;
}

} // namespace

std::vector<LeakMap> leak_maps() {
    std::vector<LeakMap> maps;
    int k = 0;
    for (const Contents contents : {Contents::solid, Contents::detail})
        for (const double t : {16.0, 8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125, 0.0625}) maps.push_back(wall(t, 96 + 2.6875 * (k++ % 7), 0, contents));
    for (const double degrees : {5.0, 17.0, 45.0})
        for (const double t : {8.0, 0.5, 0.0625}) maps.push_back(wall(t, 90.3125, degrees, degrees == 17 ? Contents::detail : Contents::solid));
    for (const double t : {8.0, 1.0, 0.25, 0.0625}) maps.push_back(closet(t, {61.375, 37.6875, 21.125}, {123.875, 90.25, 61.6875}));
    maps.push_back(closet(0.0625, {64, 32, 0.0625}, {128, 96, 48}));
    for (const double t : {4.0, 0.5, 0.0625}) maps.push_back(corner(t, 110.4375, 50.8125, 40.1875));
    for (const int walls : {3, 5, 7}) maps.push_back(fan(walls, walls == 5 ? 0.0625 : 0.5, {96.3125, 64.4375}));
    for (const double t : {4.0, 0.5, 0.0625}) maps.push_back(floors(t, 44.3125, t != 4)), maps.push_back(floors(t, 44.3125, t == 4));
    maps.push_back(terrain_wall(0.25, 93.6875, 0));
    maps.push_back(terrain_wall(4, 93.6875, 0));
    maps.push_back(terrain_wall(0.25, 93.6875, 6));
    maps.push_back(terrain_wall(2, 97.4375, 3));
    for (const bool front_to_dark : {false, true}) maps.push_back(patch_wall(93.6875, 0, front_to_dark)), maps.push_back(patch_wall(97.4375, 20, front_to_dark));
    maps.push_back(patch_column(24, kHi.z));
    maps.push_back(patch_column(6, 48));
    for (const double thickness : {8.0, 1.0, 0.25}) maps.push_back(door(8, thickness, 93.6875, true));
    maps.push_back(door(0.25, 0.25, 97.4375, true));
    maps.push_back(door(8, 8, 93.6875));
    maps.push_back(door(16, 2, 93.6875));
    maps.push_back(door(1, 1, 97.4375));
    maps.push_back(door(0.25, 0.25, 97.4375));
    return maps;
}

LeakFound find_leaks(LeakMap m, double luxel_size, double error_percent) {
    World& world = m.builder.world;
    for (WorldSide& s : world.sides) s.lightmap_scale = luxel_size;
    world.materials[0].reflectance = {0.8f, 0.8f, 0.8f};
    Context context;
    context.threads = 1;
    LeakFound out;
    std::vector<Light> lights;
    for (const Vec3 at : m.lamps) {
        Light l;
        l.position = at, l.intensity = {4000, 4000, 4000};
        lights.push_back(l);
    }
    auto csg = build_csg(world, {}, context);
    if (!csg) return out.compiled = false, out;
    auto bsp = build_bsp(world, *csg, {}, context);
    if (!bsp) return out.compiled = false, out;
    auto built = build_surfaces(world, *csg, *bsp, {}, context);
    if (!built) return out.compiled = false, out;
    const Surfaces& s = *built;
    auto baked = bake_light(world, *bsp, bsp->planes, s, lights, {.error_percent = error_percent, .directional = Directional::all}, context);
    if (!baked) return out.compiled = false, out;
    const Lighting& l = *baked;
    const auto texels = fit_shown(s, l, context); // what a level holds
    if (!texels) return out.compiled = false, out;
    const auto most = [](const Rgb& e) { return static_cast<double>(max_component(e)); };
    const auto place = [&](FaceId f, Vec2 at) { return world_from_luxel(s, f, at); };

    double brightest = 0;
    for (const Luxel& x : s.luxels) {
        const Chart& c = s.charts[x.chart.at()];
        if (m.bright(place(x.face, centroid_of(s, x)) + s.faces[x.face.at()].normal * (4 * kInside)))
            brightest = std::max(brightest, most(l.flat[c.texel(x.x, x.y)]));
    }
    // What a run time shows at a place: four texels of every layer, whatever they are, held within the chart.
    const auto shown = [&](const Chart& c, std::size_t chart, Vec2 at) {
        const auto hold = [](double x, std::uint32_t size) { return std::clamp(x - 0.5, 0.0, size - 1.0); };
        const double x = hold(at.x, c.width), y = hold(at.y, c.height);
        const double x0 = std::floor(x), y0 = std::floor(y);
        std::array<Rgb, 4> sum{};
        for (int k = 0; k < 4; ++k) {
            const double u = std::min(x0 + k % 2, c.width - 1.0), v = std::min(y0 + k / 2, c.height - 1.0);
            const double w = (k % 2 ? x - x0 : 1 - x + x0) * (k / 2 ? y - y0 : 1 - y + y0);
            const auto t = static_cast<std::size_t>(v) * c.width + static_cast<std::size_t>(u);
            sum[0] = sum[0] + texels->flat[c.first_texel + t] * static_cast<float>(w);
            if (l.rnm_first[chart] != UINT32_MAX)
                for (std::size_t i = 0; i < 3; ++i) sum[i + 1] = sum[i + 1] + texels->rnm[l.rnm_first[chart] + t][i] * static_cast<float>(w);
        }
        double value = 0;
        for (const Rgb& e : sum)
            for (std::size_t i = 0; i < 3; ++i) value = std::max(value, std::abs(static_cast<double>(e[i])));
        return value;
    };
    // The middle of what is bent, or goes round something, lies off it: a patch is dark where all its parts are.
    std::vector<char> part_dark(l.patches.size(), 0), part_bright(l.patches.size(), 0);
    for (const Luxel& x : s.luxels) {
        const Chart& c = s.charts[x.chart.at()];
        bool all_dark = true;
        for (std::uint32_t k = 0; k < x.piece_count; ++k) {
            const LuxelPiece& piece = s.pieces[x.first_piece + k];
            const PiecePoints p = points_of(s, piece);
            Vec2 middle;
            for (const Vec2 v : p) middle = middle + v * (1.0 / static_cast<double>(p.size()));
            const std::uint32_t of_texel = l.patch_index[texel_of(s, x)], patch = of_texel == kMixedPatch ? l.piece_patch[x.first_piece + k] : of_texel;
            if (patch < l.patches.size()) (m.dark(place(piece.face, middle) + s.faces[piece.face.at()].normal * (2 * kInside)) ? part_dark : part_bright)[patch] = 1;
            for (std::size_t i = 0; i < p.size(); ++i)
                for (const Vec2 v : {p[i], (p[i] + p[(i + 1) % p.size()]) * 0.5})
                    for (const double in : {1e-4, 0.03, 0.5, 1.0}) {
                        const Vec2 at = v + (middle - v) * in;
                        const Vec3 air = place(piece.face, at) + s.faces[piece.face.at()].normal * (2 * kInside);
                        if (!m.dark(air)) {
                            all_dark = false;
                            continue;
                        }
                        ++out.looked;
                        const double value = shown(c, x.chart.at(), at) / brightest;
                        if (value <= out.shown) continue;
                        out.shown = value;
                        out.where = fmt::format("{:.3f} {:.3f} {:.3f} facing {:.2f} {:.2f} {:.2f}, luxel of {:.4f}", air.x, air.y, air.z,
                                                s.faces[piece.face.at()].normal.x, s.faces[piece.face.at()].normal.y,
                                                s.faces[piece.face.at()].normal.z, x.area);
                    }
        }
        if (all_dark) out.luxel = std::max(out.luxel, most(l.flat[c.texel(x.x, x.y)]) / brightest);
    }
    for (std::size_t p = 0; p < l.patches.size(); ++p)
        if (part_dark[p] && !part_bright[p]) out.patch = std::max(out.patch, most(l.radiosity[p]) / brightest);

    const LightField field(world, *bsp, bsp->planes, s, lights, l);
    auto ambient = place_ambient(*bsp, bsp->planes, s, lights, field, {.error_percent = 30, .local_lights = 0, .rays = 32}, context);
    if (!ambient) return out.compiled = false, out;
    const auto look = [&](const std::array<Rgb, 6>& cube, const char* what, Vec3 at) {
        double value = 0;
        for (const Rgb& e : cube) value = std::max(value, most(e) / brightest);
        if (value > out.cube) out.cube = value, out.cube_where = fmt::format("{} at {:.3f} {:.3f} {:.3f}", what, at.x, at.y, at.z);
    };
    for (const AmbientCube& cube : ambient->cubes)
        if (m.dark(cube.position)) look(cube.irradiance, "a cube", cube.position);
    const Sobol points(17);
    for (std::uint32_t i = 0; i < 4096; ++i) {
        const Vec3 at{kLo.x + (kHi.x - kLo.x) * points(i, 0), kLo.y + (kHi.y - kLo.y) * points(i, 1), kLo.z + (kHi.z - kLo.z) * points(i, 2)};
        if (!m.dark(at)) continue;
        if (const auto cube = ambient_at(*ambient, at)) look(*cube, "a mix of cubes", at);
    }
    return out;
}

} // namespace kiln::proof

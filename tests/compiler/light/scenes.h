// Scenes of the light tests.
#pragma once
#include "compiler/light/field.h"
#include "tests/support/surfaces_builder.h"

namespace kiln::test {

inline std::array<MaterialId, 6> all(MaterialId m) {
    return {m, m, m, m, m, m};
}

// Everything emits and reflects: L = e / (1 - rho) everywhere, whatever the shape.
inline SurfacesBuilder furnace(Rgb rho = {0.6f, 0.4f, 0.2f}, Rgb emission = {0.4f, 0.6f, 0.8f}, double luxel = 16) {
    SurfacesBuilder b;
    const MaterialId m = b.material(rho, emission);
    b.room({{0, 0, 0}, {160, 128, 96}}, all(m), {.luxel = luxel}, {{{}, {}, {}, {}, {Rect{32, 32, 80, 64}}, {}}});
    auto block = all(m);
    block[4] = MaterialId{};
    b.block({{32, 32, 0}, {80, 64, 40}}, block, {.luxel = luxel});
    return b;
}

// The two rooms of the design study: 40 units a metre, a lamp in the first, a doorway to the second. The wall that
// stands on the floor cuts it.
inline SurfacesBuilder two_rooms(double luxel = 10, bool sill = false) { // sill: the floor of the doorway is a face of its own
    SurfacesBuilder b;
    const auto grey = [&](float r) { return b.material({r, r, r}); };
    const MaterialId floor = grey(0.5f), ceiling = grey(0.7f), x = grey(0.6f), y0 = grey(0.4f), y1 = grey(0.7f);
    const MaterialId wall = grey(0.6f), block = grey(0.5f), lamp = b.material({0, 0, 0}, {20, 20, 20});
    const FaceOptions o{.luxel = luxel};
    // Partition x in [180, 190], doorway y in [120, 180], z < 100.
    std::array<std::vector<Rect>, 6> holes;
    holes[2] = {Rect{0, 180, 160, 190}}; // y = 0: along z, x
    holes[3] = holes[2];
    holes[4] = {Rect{180, 0, 190, 120}, Rect{180, 180, 190, 320}, Rect{60, 200, 120, 260}}; // along x, y
    holes[5] = {Rect{180, 0, 190, 320}, Rect{60, 60, 100, 100}};
    if (sill) {
        holes[4].push_back(Rect{180, 120, 190, 180});
        b.rect({180, 120, 0}, {10, 0, 0}, {0, 60, 0}, floor, o);
    }
    b.room({{0, 0, 0}, {320, 320, 160}}, {x, x, y0, y1, floor, ceiling}, o, holes);
    for (const double side : {180.0, 190.0}) {
        const Vec3 corner{side, 0, 0};
        const std::vector<Rect> door{Rect{120, 0, 180, 100}}, door_t{Rect{0, 120, 100, 180}};
        if (side > 185)
            b.rect(corner, {0, 320, 0}, {0, 0, 160}, wall, o, door);
        else
            b.rect(corner, {0, 0, 160}, {0, 320, 0}, wall, o, door_t);
    }
    b.rect({180, 120, 0}, {0, 0, 100}, {10, 0, 0}, wall, o); // jambs
    b.rect({180, 180, 0}, {10, 0, 0}, {0, 0, 100}, wall, o);
    b.rect({180, 120, 100}, {0, 60, 0}, {10, 0, 0}, wall, o); // lintel
    auto sides = all(block);
    sides[4] = MaterialId{};
    b.block({{60, 200, 0}, {120, 260, 60}}, sides, o);
    b.rect({60, 60, 160}, {0, 40, 0}, {40, 0, 0}, lamp, o); // lamp, facing down
    return b;
}

// A room, black or grey, under a hole of 48 units in its ceiling, a unit thick, and a box of large faces above its roof, of what `above` makes for its walls and then for its ceiling: of
// each, nearly all is hidden from below.
constexpr Rect kHole{104, 104, 152, 152};
constexpr double kCeiling = 128, kRoof = 129;
inline SurfacesBuilder room_under_a_hole(const std::function<MaterialId(SurfacesBuilder&)>& above, FaceOptions options, float grey = 0) {
    SurfacesBuilder b;
    const MaterialId walls = b.material({grey, grey, grey});
    b.room({{0, 0, 0}, {256, 256, kCeiling}}, all(walls), {.luxel = 16}, {{{}, {}, {}, {}, {}, {kHole}}});
    b.rect({-512, -512, kRoof}, {1280, 0, 0}, {0, 1280, 0}, walls, {.luxel = 64}, {Rect{kHole.x0 + 512, kHole.y0 + 512, kHole.x1 + 512, kHole.y1 + 512}});
    std::array<MaterialId, 6> sides = all(above(b));
    sides[4] = MaterialId{}, sides[5] = above(b);
    b.room({{-512, -512, kRoof}, {768, 768, 640}}, sides, options);
    const std::array<Vec3, 4> rim{Vec3{kHole.x0, kHole.y0, kCeiling}, {kHole.x1, kHole.y0, kCeiling}, {kHole.x1, kHole.y1, kCeiling}, {kHole.x0, kHole.y1, kCeiling}};
    for (std::size_t i = 0; i < 4; ++i) b.rect(rim[(i + 1) % 4], rim[i] - rim[(i + 1) % 4], {0, 0, kRoof - kCeiling}, walls, {.chart = false});
    return b;
}

// A shaft of 16 x 128 units, 96 deep, in the floor of a room.
inline SurfacesBuilder shaft_beside_a_room() {
    SurfacesBuilder b;
    const MaterialId walls = b.material({0.6f, 0.6f, 0.6f});
    constexpr Rect kMouth{120, 64, 136, 192};
    b.room({{0, 0, 0}, {256, 256, 128}}, all(walls), {.luxel = 16}, {{{}, {}, {}, {}, {kMouth}, {}}});
    std::array<MaterialId, 6> sides = all(walls);
    sides[5] = MaterialId{};
    b.room({{kMouth.x0, kMouth.y0, -96}, {kMouth.x1, kMouth.y1, 0}}, sides, {.luxel = 8});
    return b;
}

inline MaterialId glass(SurfacesBuilder& b, float alpha, Rgb reflectance = {}, std::optional<Rgb> tint = {}, Rgb emission = {}) {
    const MaterialId id = b.material(reflectance, emission, kTranslucent);
    Material& m = b.world.materials[id.at()];
    m.alpha = alpha, m.alpha_stated = true, m.tint = tint;
    return id;
}
// Texels of 0 and 255, two by two.
inline MaterialId checkers(SurfacesBuilder& b, int texel_size, Rgb reflectance = {}) {
    const MaterialId id = b.material(reflectance, {}, kAlphaTested);
    Material& m = b.world.materials[id.at()];
    m.opacity_map = {2, 2, {255, 0, 0, 255}, {}};
    m.width = m.height = 2 * texel_size; // a texel a unit
    return id;
}

inline Decimal whole(double x) { return {static_cast<std::int64_t>(x), 0}; }
inline std::array<std::array<Decimal, 3>, 3> points(Vec3 a, Vec3 b, Vec3 c) {
    return {{{whole(a.x), whole(a.y), whole(a.z)}, {whole(b.x), whole(b.y), whole(b.z)}, {whole(c.x), whole(c.y), whole(c.z)}}};
}
// A face of a brush of `thickness` whose other side is the same or, where it has no thickness, is not drawn.
inline FaceId pane(SurfacesBuilder& b, Vec3 corner, Vec3 u, Vec3 v, MaterialId m, double thickness = 0, double luxel = 16, DocTexture texture = {}) {
    const MaterialId undrawn = b.material({}, {}, kNoDraw);
    const Vec3 n = normalize(cross(u, v)), other = corner - n * std::max(1.0, thickness);
    WorldBrush brush;
    brush.first_side = static_cast<std::uint32_t>(b.world.sides.size()), brush.side_count = 2, brush.contents = Contents::window;
    brush.model = ModelId{0};
    b.world.brushes.push_back(brush);
    const std::size_t side = b.world.sides.size();
    b.world.sides.resize(side + 2);
    b.world.sides[side].points = points(corner, corner + u, corner + v), b.world.sides[side + 1].points = points(other, other + v, other + u);
    b.world.sides[side].material = m, b.world.sides[side + 1].material = thickness > 0 ? m : undrawn;
    b.world.sides[side].texture = b.world.sides[side + 1].texture = texture;
    const FaceOptions options{.luxel = luxel, .blocks_light = false};
    const FaceId face = b.rect(corner, u, v, m, options);
    b.surfaces.faces[face.at()].side = SideId{static_cast<std::uint32_t>(side)};
    if (thickness > 0) b.surfaces.faces[b.rect(other, v, u, m, options).at()].side = SideId{static_cast<std::uint32_t>(side + 1)};
    return face;
}

inline Vec3 center_of(const Surfaces& s, const Luxel& l) {
    const Chart& c = s.charts[l.chart.at()];
    const Vec2 at = centroid_of(s, l);
    return c.origin + (c.s * at.x + c.t * at.y) * c.luxel_size;
}
inline Light point_light(Vec3 at, Rgb intensity) {
    Light l;
    l.position = at, l.intensity = intensity;
    return l;
}

// A long black hall, and in the middle of one of its ends a square of 64 units that reflects: seen from the other end under less than a hundredth of a cell of a guide.
constexpr double kHallLength = 6144;
inline SurfacesBuilder lit_square_down_a_hall() {
    SurfacesBuilder b;
    const MaterialId black = b.material({}), grey = b.material({0.5f, 0.5f, 0.5f});
    auto sides = all(black);
    sides[0] = sides[1] = MaterialId{};
    b.room({{0, 0, 0}, {kHallLength, 512, 256}}, sides, {.chart = false});
    b.rect({0, 0, 0}, {0, 512, 0}, {0, 0, 256}, black, {.luxel = 64}, {Rect{224, 96, 288, 160}});
    b.rect({kHallLength, 0, 0}, {0, 0, 256}, {0, 512, 0}, black, {.luxel = 64});
    b.rect({0, 224, 96}, {0, 64, 0}, {0, 0, 64}, grey, {.luxel = 16});
    return b;
}
inline Light lamp_of_the_hall(float intensity) { // shines on that end alone
    Light lamp = point_light({96, 256, 128}, {intensity, intensity, intensity});
    lamp.kind = LightKind::spot, lamp.direction = {-1, 0, 0}, lamp.cos_inner = lamp.cos_outer = 0.5;
    return lamp;
}

struct Baked {
    SurfacesBuilder scene;
    std::vector<Light> lights;
    Bsp bsp;
    PlaneTable planes;
    Lighting lighting;
    Context context;
    std::unique_ptr<LightField> field;
};
inline std::unique_ptr<Baked> bake(SurfacesBuilder scene, LightOptions options = {}, std::vector<Light> lights = {},
                                   int threads = 1) {
    auto b = std::make_unique<Baked>();
    b->scene = std::move(scene);
    b->lights = std::move(lights);
    b->context.threads = threads;
    Result<Lighting> r =
        bake_light(b->scene.world, b->bsp, b->planes, b->scene.surfaces, b->lights, options, b->context);
    if (!r) return nullptr;
    b->lighting = std::move(*r);
    validate(b->lighting, b->scene.surfaces);
    b->field =
        std::make_unique<LightField>(b->scene.world, b->bsp, b->planes, b->scene.surfaces, b->lights, b->lighting);
    return b;
}

// By rays of the field from a point.
inline Rgbd irradiance(const LightField& field, Vec3 p, Vec3 n, std::uint32_t rays, std::uint64_t seed = 1) {
    Rgbd e;
    field.arriving(p, n, rays, seed, [&](Vec3 d, Rgbd w) { e += w * std::max(0.0, dot(d, n)); });
    return e;
}

} // namespace kiln::test

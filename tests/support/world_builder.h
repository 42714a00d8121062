// Worlds by hand for tests: boxes, hulls by planes, rooms. Coordinates have up to ten decimals (none from 1e8 on).
#pragma once
#include "compiler/world/world.h"
#include <cmath>
#include <initializer_list>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace kiln::test {

inline Decimal decimal(double x) {
    const bool small = std::fabs(x) < 1e8;
    Decimal d{static_cast<std::int64_t>(std::llround(small ? x * 1e10 : x)), small ? -10 : 0, true};
    if (d.mantissa == 0) return {};
    while (d.mantissa % 10 == 0) d.mantissa /= 10, ++d.exponent;
    return d;
}

// Points clockwise seen from outside, as map files write them.
using SidePoints = std::array<Vec3, 3>;

class WorldBuilder {
public:
    World world;

    WorldBuilder() {
        world.file = "test.map";
        material("wall");
        WorldEntity worldspawn;
        worldspawn.keys = {{"classname", "worldspawn", 1}};
        worldspawn.model = ModelId{0};
        worldspawn.line = 1, worldspawn.id = 0;
        world.entities.push_back(worldspawn);
    }

    MaterialId material(const std::string& name, std::uint32_t flags = 0, Rgb reflectance = {0.5f, 0.5f, 0.5f},
                        Rgb emission = {}) {
        Material m;
        m.name = name, m.flags = flags, m.reflectance = reflectance, m.emission = emission, m.known = true;
        world.materials.push_back(m);
        return id<MaterialId>(world.materials.size() - 1);
    }

    // Sides by three points each. Everything else here ends in this one.
    BrushId brush(std::span<const SidePoints> sides, Contents contents = Contents::solid, ModelId model = {0},
                  MaterialId m = {0}) {
        WorldBrush b;
        b.first_side = static_cast<std::uint32_t>(world.sides.size());
        b.side_count = static_cast<std::uint32_t>(sides.size());
        b.contents = contents, b.model = model;
        b.entity = id<EntityId>(model.value == 0 ? 0 : entity_of_model_[model.value - 1].value);
        b.line = ++line_, b.id = static_cast<int>(world.brushes.size());
        b.draws = contents != Contents::area_portal && contents != Contents::hint && contents != Contents::clip &&
                  contents != Contents::trigger;
        for (std::size_t i = 0; i < sides.size(); ++i) {
            WorldSide s;
            for (std::size_t p = 0; p < 3; ++p)
                for (std::size_t k = 0; k < 3; ++k) s.points[p][k] = decimal(sides[i][p][k]);
            s.material = m;
            s.texture = texture_for(sides[i]);
            s.line = ++line_, s.id = static_cast<int>(i);
            world.sides.push_back(s);
        }
        world.brushes.push_back(b);
        return id<BrushId>(world.brushes.size() - 1);
    }

    BrushId box(Vec3 lo, Vec3 hi, Contents contents = Contents::solid, ModelId model = {0}, MaterialId m = {0}) {
        return brush(box_sides(lo, hi), contents, model, m);
    }

    // Convex hull between a polygon (counter-clockwise seen from above, points in z = lo) and its copy at `height`.
    BrushId prism(std::span<const Vec2> base, double lo, double hi, Contents contents = Contents::solid,
                  ModelId model = {0}, MaterialId m = {0}) {
        std::vector<SidePoints> sides{
            {Vec3{0, 0, hi}, {0, 64, hi}, {64, 0, hi}},
            {Vec3{0, 0, lo}, {64, 0, lo}, {0, 64, lo}},
        };
        for (std::size_t i = 0; i < base.size(); ++i) {
            const Vec2 p = base[i], q = base[(i + 1) % base.size()];
            sides.push_back({Vec3{p.x, p.y, hi}, {q.x, q.y, hi}, {q.x, q.y, lo}});
        }
        return brush(sides, contents, model, m);
    }

    // Tetrahedron from four points in general position, any order.
    BrushId tetrahedron(std::array<Vec3, 4> p, Contents contents = Contents::solid, ModelId model = {0}) {
        std::vector<SidePoints> sides;
        for (std::size_t i = 0; i < 4; ++i) {
            SidePoints s{p[(i + 1) % 4], p[(i + 2) % 4], p[(i + 3) % 4]};
            const Vec3 n = cross(s[2] - s[0], s[1] - s[0]);
            if (dot(n, p[i] - s[0]) > 0) std::swap(s[1], s[2]);
            sides.push_back(s);
        }
        return brush(sides, contents, model);
    }

    // Six walls around the open box [lo, hi]; sides towards the inside get `m`. Order: -x +x -y +y -z +z.
    std::vector<BrushId> room(Vec3 lo, Vec3 hi, double thickness = 16, MaterialId m = {0}) {
        std::vector<BrushId> walls;
        const Vec3 t{thickness, thickness, thickness};
        for (std::size_t k = 0; k < 3; ++k)
            for (const bool high : {false, true}) {
                Vec3 a = lo - t, b = hi + t;
                for (std::size_t j = 0; j < k; ++j) a[j] = lo[j], b[j] = hi[j]; // walls abut, they do not overlap
                (high ? a : b)[k] = high ? hi[k] : lo[k];
                walls.push_back(box(a, b, Contents::solid, {0}, m));
            }
        return walls;
    }

    EntityId point_entity(const std::string& classname, Vec3 origin,
                          std::initializer_list<std::pair<std::string, std::string>> keys = {}) {
        WorldEntity e;
        e.line = ++line_, e.id = static_cast<int>(world.entities.size());
        e.keys.push_back({"classname", classname, e.line});
        e.keys.push_back({"origin",
                          std::to_string(origin.x) + " " + std::to_string(origin.y) + " " + std::to_string(origin.z),
                          e.line});
        for (const auto& [k, v] : keys) e.keys.push_back({k, v, e.line});
        e.origin = origin, e.has_origin = true;
        world.entities.push_back(e);
        return id<EntityId>(world.entities.size() - 1);
    }

    // A brush entity; give its model to box() and brush().
    ModelId model(const std::string& classname) {
        WorldEntity e;
        e.line = ++line_, e.id = static_cast<int>(world.entities.size());
        e.keys.push_back({"classname", classname, e.line});
        e.model = ModelId{world.model_count++};
        entity_of_model_.push_back(id<EntityId>(world.entities.size()));
        world.entities.push_back(e);
        return e.model;
    }

    static std::vector<SidePoints> box_sides(Vec3 lo, Vec3 hi) {
        return {
            {Vec3{lo.x, lo.y, lo.z}, {lo.x, hi.y, lo.z}, {lo.x, lo.y, hi.z}}, // -x
            {Vec3{hi.x, lo.y, lo.z}, {hi.x, lo.y, hi.z}, {hi.x, hi.y, lo.z}}, // +x
            {Vec3{lo.x, lo.y, lo.z}, {lo.x, lo.y, hi.z}, {hi.x, lo.y, lo.z}}, // -y
            {Vec3{lo.x, hi.y, lo.z}, {hi.x, hi.y, lo.z}, {lo.x, hi.y, hi.z}}, // +y
            {Vec3{lo.x, lo.y, lo.z}, {hi.x, lo.y, lo.z}, {lo.x, hi.y, lo.z}}, // -z
            {Vec3{lo.x, lo.y, hi.z}, {lo.x, hi.y, hi.z}, {hi.x, lo.y, hi.z}}, // +z
        };
    }
    // The world's own face-aligned projection, scale 1.
    static DocTexture texture_for(const SidePoints& p) {
        const Vec3 n = cross(p[2] - p[0], p[1] - p[0]);
        DocTexture t;
        if (std::fabs(n.z) >= std::fabs(n.x) && std::fabs(n.z) >= std::fabs(n.y)) t.u_axis = {1, 0, 0}, t.v_axis = {0, -1, 0};
        else if (std::fabs(n.x) >= std::fabs(n.y)) t.u_axis = {0, 1, 0}, t.v_axis = {0, 0, -1};
        else t.u_axis = {1, 0, 0}, t.v_axis = {0, 0, -1};
        return t;
    }

private:
    int line_ = 1;
    std::vector<EntityId> entity_of_model_;
};

} // namespace kiln::test

#include "compiler/light/emitters.h"
#include "compiler/light/lambert.h"
#include "libs/sampling/maps.h"
#include <map>
#include <numbers>

namespace kiln {
namespace {
constexpr double kPi = std::numbers::pi;
}

EmitterSet::EmitterSet(const World& world, const Surfaces& s, Rgbd sky) : of_face(s.faces.size(), UINT32_MAX) {
    for (std::size_t f = 0; f < s.faces.size(); ++f) {
        const Face& face = s.faces[f];
        Emitter e;
        e.radiance = face.sky ? sky : static_cast<Rgbd>(world.materials[face.material.at()].emission);
        if (!(max_component(e.radiance) > 0) || (!face.drawn && !face.sky)) continue;
        e.face = id<FaceId>(f), e.sky = face.sky;
        e.normal = face.normal;
        e.distance = face.distance;
        e.first_triangle = static_cast<std::uint32_t>(triangles.size());
        Box3 box;
        std::map<std::array<std::uint32_t, 2>, int> directed;
        for (std::uint32_t t = 0; t < face.triangle_count; ++t) {
            const auto& v = s.triangles[face.first_triangle + t];
            const Vec3 a = s.positions[v[0]], b = s.positions[v[1]], c = s.positions[v[2]];
            const double area = length(cross(b - a, c - a)) / 2;
            for (std::size_t i = 0; i < 3; ++i) ++directed[{v[i], v[(i + 1) % 3]}];
            if (!(area > 0)) continue;
            e.area += area;
            triangles.push_back({a, b, c, e.area});
            box.add(a), box.add(b), box.add(c);
        }
        e.triangle_count = static_cast<std::uint32_t>(triangles.size()) - e.first_triangle;
        if (!e.triangle_count) continue;
        e.first_edge = static_cast<std::uint32_t>(edges.size());
        for (const auto& [edge, count] : directed)
            if (!directed.contains({edge[1], edge[0]}))
                edges.push_back({s.positions[edge[0]], s.positions[edge[1]]});
        e.edge_count = static_cast<std::uint32_t>(edges.size()) - e.first_edge;
        e.center = box.center();
        for (std::uint32_t t = 0; t < e.triangle_count; ++t) {
            const EmitterTriangle& tri = triangles[e.first_triangle + t];
            for (const Vec3 p : {tri.a, tri.b, tri.c}) e.radius = std::max(e.radius, length(p - e.center));
        }
        of_face[f] = static_cast<std::uint32_t>(emitters.size());
        emitters.push_back(e);
    }
}

double EmitterSet::bound(std::uint32_t index, Vec3 x, Vec3 n) const {
    const Emitter& e = emitters[index];
    const double height = dot(e.normal, x) - e.distance;
    if (height <= 0) return 0;
    const Vec3 to = e.center - x;
    const double up = n == Vec3{} ? 1e30 : dot(n, to) + e.radius;
    if (up <= 0) return 0;
    const double d = length(to), near = std::max(d - e.radius, height);
    // cos at the receiver <= up / near, cos at the emitter <= height / near
    const double c1 = std::min(1.0, up / near), c2 = std::min(1.0, height / near);
    return std::min(n == Vec3{} ? 4.0 : 1.0, e.area * c1 * c2 / (kPi * near * near));
}

double triangle_form_factor(Vec3 x, Vec3 n, const std::array<Vec3, 3>& t) {
    if (n == Vec3{}) return solid_angle(x, t[0], t[1], t[2]) / kPi;
    return lambert_form_factor(x, n, t);
}

EmitterSet::Part EmitterSet::whole_part(const Sampling& s, const std::array<Vec3, 3>& corner) {
    Part part{corner};
    if (s.needs_edges())
        for (std::size_t i = 0; i < 3; ++i) part.edge[i] = lambert_edge(s.x, corner[i], corner[(i + 1) % 3]);
    part.factor = s.by_angle() ? triangle_form_factor(s.x, {}, corner) : s.factor_of(part);
    return part;
}

double EmitterSet::form_factor(std::uint32_t index, Vec3 x, Vec3 n) const {
    const Emitter& e = emitters[index];
    if (dot(e.normal, x) - e.distance <= 0) return 0;
    double sum = 0;
    if (!(n == Vec3{}) && dot(n, e.center - x) > e.radius) {
        for (std::uint32_t i = 0; i < e.edge_count; ++i)
            sum += dot(n, lambert_edge(x, edges[e.first_edge + i][0], edges[e.first_edge + i][1]));
        return std::abs(sum) / (2 * kPi);
    }
    for (std::uint32_t t = 0; t < e.triangle_count; ++t) {
        const EmitterTriangle& tri = triangles[e.first_triangle + t];
        sum += triangle_form_factor(x, n, {tri.a, tri.b, tri.c});
    }
    return sum;
}

Vec3 EmitterSet::point_on(std::uint32_t index, Vec2 u) const {
    const Emitter& e = emitters[index];
    const auto first = triangles.begin() + e.first_triangle, last = first + e.triangle_count;
    const double wanted = u.x * e.area;
    const auto t = std::lower_bound(first, last - 1, wanted,
                                    [](const EmitterTriangle& a, double x) { return a.cumulative <= x; });
    const double before = t == first ? 0 : (t - 1)->cumulative;
    u.x = std::clamp((wanted - before) / (t->cumulative - before), 0.0, 1.0);
    const Vec2 w = uniform_triangle(u);
    return t->a + (t->b - t->a) * w.x + (t->c - t->a) * w.y;
}

void choose_by_light(std::span<const double> brought, std::span<const double> could, Choice* choice) {
    constexpr double kKnownShare = 0.75;
    double all_could = 0, all_brought = 0;
    for (std::size_t k = 0; k < could.size(); ++k)
        if (could[k] > 0) all_could += could[k], all_brought += brought[k];
    choice->clear();
    for (std::size_t k = 0; k < could.size(); ++k) {
        const double by_bound = all_could > 0 ? could[k] / all_could : 0;
        choice->add(all_brought > 0 && could[k] > 0 ? (1 - kKnownShare) * by_bound + kKnownShare * brought[k] / all_brought : by_bound);
    }
}

bool sample_light(const Light& light, Vec3 x, Vec3 n, Vec2 u, LightSample* out) {
    const Rgbd intensity = static_cast<Rgbd>(light.intensity);
    double strength = 1;
    if (light.kind == LightKind::sky) return false;
    if (light.kind == LightKind::sun) {
        out->distant = true;
        out->direction = -light.direction;
        if (light.angular_radius_rad > 0) {
            const double half = std::min(light.angular_radius_rad, kPi / 2);
            out->direction = frame_around(out->direction).world(uniform_cap(u, std::cos(half)));
        }
    } else {
        out->distant = false;
        out->position = light.position;
        const Vec3 d = light.position - x;
        const double distance = length(d);
        if (!(distance > 0)) return false;
        out->direction = d / distance;
        strength = light.attenuation(distance);
        if (light.kind == LightKind::spot) strength *= light.cone(-out->direction);
    }
    if (!(strength > 0)) return false;
    if (!(n == Vec3{}) && dot(out->direction, n) <= 0) return false;
    const double scale = std::clamp(light.angle_scale, 0.0, 1.0);
    out->weight = intensity * (strength * scale);
    out->ambient = intensity * (strength * (1 - scale));
    return true;
}

double light_bound(const Light& light, Vec3 x, double radius) {
    const double i = mean(static_cast<Rgbd>(light.intensity));
    if (light.kind == LightKind::sky) return 0;
    if (light.kind == LightKind::sun) return i;
    return i * light.attenuation(std::max(0.0, length(light.position - x) - radius));
}

} // namespace kiln

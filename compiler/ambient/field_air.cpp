// The air of a baked map: open leaves of the BSP, rays of the light's scene, light of its field.
#include "compiler/ambient/air.h"
#include "compiler/csg/box_tree.h"
#include "compiler/light/emitters.h"
#include "compiler/light/kept_rest.h"
#include <bit>
#include <numbers>

namespace kiln::ambient {

namespace {

bool is_air(const BspLeaf& leaf) { return leaf.cluster.valid() && !leaf.outside && leaf.contents != Contents::solid; }

// Leaves whose half-spaces the box may meet: conservative, each plane tested by itself.
void leaves_in(const Bsp& bsp, const PlaneTable& planes, const Box3& box, std::vector<std::uint32_t>& out) {
    std::vector<std::int32_t> stack{bsp.nodes.empty() ? -1 : 0};
    const Vec3 center = box.center(), half = box.size() * 0.5;
    while (!stack.empty()) {
        const std::int32_t at = stack.back();
        stack.pop_back();
        if (at < 0) {
            out.push_back(static_cast<std::uint32_t>(-(at + 1)));
            continue;
        }
        const BspNode& node = bsp.nodes[static_cast<std::size_t>(at)];
        const Vec3 n = planes.normal(node.plane);
        const double d = dot(n, center) - planes.distance(node.plane);
        const double reach = std::abs(n.x) * half.x + std::abs(n.y) * half.y + std::abs(n.z) * half.z;
        if (d >= -reach) stack.push_back(node.child[0]);
        if (d <= reach) stack.push_back(node.child[1]);
    }
    std::sort(out.begin(), out.end());
}

// The light of a field at points.
class Rest {
public:
    Rest(const LightField& field, Memo* memo) : rest_(field, memo) {}

    // Light arriving from the whole sphere, less the error that its bundle of rays makes of uniform light. The same bundle in an empty
    // universe of radiance 1 has a known answer, so it serves as a control: what is left of it is subtracted, as much of it as the bundle's
    // mean radiance. In a furnace the cube is exact; elsewhere it is less noisy (measured: 128 rays made 4.6 % of pi at worst without this).
    Cube6 operator()(Vec3 point, std::uint32_t rays, std::uint64_t seed) const {
        return rest_.sum<Cube6>(point, {}, rays, seed, 0, [](const KeptRest::Arrivals& arrivals) {
            thread_local std::vector<FieldEmitters::Arriving> of_ray;
            of_ray.clear();
            Cube6 cube{};
            Rgbd sum{};
            arrivals([&](Vec3 direction, Rgbd weight) { add(cube, direction, weight); }, [&](Vec3 direction, Rgbd weight) { of_ray.push_back({direction, weight}), sum += weight; });
            const Rgbd mean_radiance = sum / (4 * std::numbers::pi), each = sum / static_cast<double>(of_ray.size());
            if (!(max_component(mean_radiance) > 0)) return cube;
            for (const FieldEmitters::Arriving& a : of_ray) add(cube, a.direction, a.weight - each);
            // Uniform light itself, of which six axes make every integral of degree up to three exact.
            for (std::size_t a = 0; a < 6; ++a) {
                Vec3 axis{};
                axis[a / 2] = a % 2 ? -1 : 1;
                add(cube, axis, mean_radiance * (4 * std::numbers::pi / 6));
            }
            return cube;
        });
    }

private:
    KeptRest rest_;
};

// Places beside the triangles that block light: whatever air a wall cuts off lies at its faces.
class FacePlaces {
public:
    explicit FacePlaces(const Surfaces& surfaces) : surfaces_(surfaces) {
        std::vector<Box3> boxes;
        for (std::uint32_t t = 0; t < surfaces.triangles.size(); ++t) {
            const Face& face = surfaces.faces[surfaces.triangle_face[t].at()];
            if (!face.blocks_light && !face.sky) continue;
            Box3& box = boxes.emplace_back();
            for (const std::uint32_t v : surfaces.triangles[t]) box.add(surfaces.positions[v]);
            triangles_.push_back(t);
        }
        tree_.emplace(boxes);
    }
    std::vector<Vec3> in(const Box3& box, const std::vector<HalfSpace>& within) const {
        constexpr double kOff = 1.0 / 128;   // map units off the face: below any wall, above the rounding of rays
        constexpr double kInset = 1.0 / 64;  // share of the way from a corner to the middle
        // Map units across: of narrower parts, in the groove of two walls say, the place may lie behind the next wall, and
        // nothing that is lit by cubes has room there.
        constexpr double kNarrow = 1.0 / 8;
        std::vector<std::uint32_t> near;
        tree_->query(box, near);
        std::vector<Vec3> places, part, spare;
        for (const std::uint32_t i : near) {
            part.clear();
            for (const std::uint32_t v : surfaces_.triangles[triangles_[i]]) part.push_back(surfaces_.positions[v]);
            const auto keep = [&](const auto& inside) { // at least 0 there
                spare.clear();
                for (std::size_t k = 0; k < part.size(); ++k) {
                    const Vec3 p = part[k], q = part[(k + 1) % part.size()];
                    const double dp = inside(p), dq = inside(q);
                    if (dp >= 0) spare.push_back(p);
                    if ((dp > 0 && dq < 0) || (dp < 0 && dq > 0)) spare.push_back(p + (q - p) * (dp / (dp - dq)));
                }
                part.swap(spare);
            };
            for (std::size_t a = 0; a < 3; ++a)
                keep([&](Vec3 p) { return p[a] - box.lo[a]; }), keep([&](Vec3 p) { return box.hi[a] - p[a]; });
            for (const HalfSpace& h : within) keep([&](Vec3 p) { return h.distance - dot(h.normal, p); });
            if (part.size() < 3) continue;
            Vec3 middle;
            for (const Vec3& p : part) middle += p / double(part.size());
            Vec3 area;
            double reach = 0;
            for (std::size_t k = 0; k < part.size(); ++k)
                area += cross(part[k] - middle, part[(k + 1) % part.size()] - middle) * 0.5, reach = std::max(reach, length(part[k] - middle));
            if (!(length(area) > kNarrow * reach)) continue;
            const Face& face = surfaces_.faces[surfaces_.triangle_face[triangles_[i]].at()];
            // What has an open border may have air behind it.
            for (const double side : {1.0, -1.0}) {
                if (side < 0 && !face.curved() && !face.two_sided) continue;
                const Vec3 off = face.normal * (kOff * side);
                places.push_back(middle + off);
                for (const Vec3& p : part) places.push_back(p + (middle - p) * kInset + off);
            }
        }
        return places;
    }

private:
    const Surfaces& surfaces_;
    std::vector<std::uint32_t> triangles_;
    std::optional<csg_detail::BoxTree> tree_;
};

} // namespace

Air air_of(const Bsp& bsp, const PlaneTable& planes, const Surfaces& surfaces, const std::vector<Light>& lights,
           const LightField& field, Memo* memo) {
    const TraceScene& scene = field.scene();
    Air air;
    air.memo = memo;
    for (const BspLeaf& leaf : bsp.leaves)
        if (is_air(leaf) && !leaf.bounds.empty()) air.bounds.add(leaf.bounds);
    if (!air.bounds.empty() && !bsp.bounds.empty()) // what leaks is open without end
        for (std::size_t a = 0; a < 3; ++a) {
            air.bounds.lo[a] = std::max(air.bounds.lo[a], bsp.bounds.lo[a]);
            air.bounds.hi[a] = std::min(air.bounds.hi[a], bsp.bounds.hi[a]);
        }
    air.parts = [&bsp, &planes](const Box3& box) {
        std::vector<std::uint32_t> leaves;
        leaves_in(bsp, planes, box, leaves);
        std::vector<AirPart> parts;
        for (const std::uint32_t l : leaves) {
            const BspLeaf& leaf = bsp.leaves[l];
            if (!is_air(leaf)) continue;
            AirPart part{l, leaf.bounds};
            bool thick = !part.bounds.empty();
            for (std::size_t a = 0; a < 3; ++a) {
                part.bounds.lo[a] = std::max(part.bounds.lo[a], box.lo[a]);
                part.bounds.hi[a] = std::min(part.bounds.hi[a], box.hi[a]);
                thick = thick && part.bounds.hi[a] - part.bounds.lo[a] > 1e-6;
            }
            if (thick) parts.push_back(part);
        }
        return parts;
    };
    const auto air_hit = [&surfaces](const std::optional<SceneHit>& hit, Vec3 direction) -> std::optional<AirHit> {
        if (!hit) return std::nullopt;
        AirHit out{hit->distance, {}, hit->back};
        if (hit->face.valid()) {
            const Face& face = surfaces.faces[hit->face.at()];
            out.normal = hit->back ? -face.normal : face.normal;
            out.back = hit->back && !face.two_sided;
        } else {
            out.normal = -direction;
        }
        return out;
    };
    air.closest = [&scene, air_hit](Vec3 origin, Vec3 direction) { return air_hit(scene.closest(origin, direction), direction); };
    air.closest_of_many = [&scene, air_hit](Vec3 origin, std::span<const Vec3> directions, std::span<std::optional<AirHit>> hits) {
        thread_local std::vector<Vec3> origins;
        thread_local std::vector<std::optional<SceneHit>> met;
        origins.assign(directions.size(), origin), met.resize(directions.size());
        scene.closest(origins, directions, met);
        for (std::size_t i = 0; i < met.size(); ++i) hits[i] = air_hit(met[i], directions[i]);
    };
    // Neither detail brushes nor terrain show in the tree: where a leaf holds brushes, and in all maps with terrain, most of a few rays must meet fronts.
    const bool terrain = std::ranges::any_of(surfaces.curves, [](const Curve& c) { return c.kind == Curve::displacement; });
    air.leaf_of = [&bsp, &planes, terrain, closest = air.closest_of_many](Vec3 point) {
        const LeafId leaf = leaf_at(bsp, planes, point);
        if (!leaf.valid() || !is_air(bsp.leaves[leaf.at()])) return kNoLeaf;
        if (terrain || !bsp.leaves[leaf.at()].brushes.empty()) {
            static const std::array<Vec3, 4> kWays{normalize(Vec3{0.48, 0.6, 0.64}), normalize(Vec3{-0.6, -0.64, 0.48}), normalize(Vec3{0.64, -0.48, -0.6}), normalize(Vec3{-0.52, 0.24, -0.82})};
            std::array<std::optional<AirHit>, 4> hits;
            closest(point, kWays, hits);
            if (std::ranges::count_if(hits, [](const auto& hit) { return hit && hit->back; }) >= 2) return kNoLeaf;
        }
        return leaf.value;
    };
    air.beside_faces = [places = std::make_shared<const FacePlaces>(surfaces)](const Box3& box, const std::vector<HalfSpace>& within) { return places->in(box, within); };
    air.clear = [&scene](Vec3 from, Vec3 to) { return !scene.occluded(from, to); };
    air.hidden = [&scene](std::span<const Vec3> from, std::span<const Vec3> to, std::span<std::uint8_t> hidden) { scene.occluded(from, to, hidden); };
    air.rest = [rest = std::make_shared<const Rest>(field, memo)](Vec3 point, std::uint32_t rays, std::uint64_t seed) { return (*rest)(point, rays, seed); };
    air.light_count = static_cast<std::uint32_t>(lights.size());
    air.each_light = [&field](Vec3 point, const std::function<void(std::uint32_t)>& visit) { field.each_light(point, visit); };
    air.direct = [&lights](std::uint32_t l, Vec3 point) -> std::optional<DirectLight> {
        const Light& light = lights[l];
        if (light.kind == LightKind::sky) return std::nullopt; // comes with the rest
        if (light.kind == LightKind::sun) return DirectLight{-light.direction, Rgbd(light.intensity)};
        const Vec3 to = light.position - point;
        const double d = length(to);
        if (!(d > 0)) return std::nullopt;
        const double e = light.attenuation(d) * light.cone(to / -d);
        if (!(e > 0)) return std::nullopt;
        return DirectLight{to / d, Rgbd(light.intensity) * e};
    };
    air.comes_from = [&lights](std::uint32_t l) {
        const bool sun = lights[l].kind == LightKind::sun;
        const Vec3 from = sun ? lights[l].direction : lights[l].position;
        return mix(std::uint64_t{sun}, std::bit_cast<std::uint64_t>(from.x), std::bit_cast<std::uint64_t>(from.y), std::bit_cast<std::uint64_t>(from.z));
    };
    air.light_clear = [&lights, &scene](std::uint32_t l, Vec3 point) {
        return sees(scene, point, lights[l]);
    };
    constexpr double kWide = 32; // map units: as what a cube lights, which holes smaller than that do not pattern
    if (scene.has_panes())
        air.light_through = [&lights, &scene](std::uint32_t l, Vec3 point) {
            const bool sun = lights[l].kind == LightKind::sun;
            return scene.transmitted({point, sun ? -lights[l].direction : lights[l].position, sun, {.start = kWide}}).share;
        };
    return air;
}

} // namespace kiln::ambient

namespace kiln {

Result<Ambient> place_ambient(const Bsp& bsp, const PlaneTable& planes, const Surfaces& surfaces,
                              const std::vector<Light>& lights, const LightField& field, const AmbientOptions& options,
                              Context& context, Memo* memo) {
    if (memo) memo->begin();
    const ambient::Air air = ambient::air_of(bsp, planes, surfaces, lights, field, memo);
    auto made = ambient::build_lattice(air, options, context);
    if (memo) memo->end();
    return made;
}

} // namespace kiln

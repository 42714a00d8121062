#include "compiler/light/halving.h"
#include "compiler/light/path_tracer.h"
#include "compiler/light/rivals/parts.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <numbers>
#include <queue>

namespace kiln::rivals {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr std::uint32_t kLampSamples = 8; // of the lamps' light where a virtual light begins
constexpr int kMostBounces = 256;

// A small disc of the given area that shines by the cosine. What it sends is L A cos' cos / (r^2 + A/pi), the factor
// of a disc on its axis: the clamping of this method. It loses light within some disc radii, and nothing far off.
struct VirtualLight {
    Vec3 point, normal;
    Rgbd intensity; // radiance times area
    double area = 0;
};

struct Node {
    Box3 box;
    Vec3 axis;                   // of the cone of normals
    double cos_half = 1, sin_half = 0;
    Rgbd intensity;
    double least_area = 0;
    std::uint32_t light = 0;     // that stands for all of them
    std::uint32_t left = 0, right = 0; // 0: a leaf
};

class Cut final : public Method {
public:
    Cut(const Scene& scene, const ManyLightSettings& settings, Context& context) : scene_(scene), settings_(settings) {
        place(context);
        if (!lights_.empty()) {
            std::vector<std::uint32_t> order(lights_.size());
            for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
            Box3 all;
            for (const VirtualLight& l : lights_) all.add(l.point);
            normal_scale_ = normal_scale(all);
            nodes_.reserve(2 * lights_.size());
            build(order);
        }
    }

    std::vector<Irradiance> light(std::span<const Receiver> receivers, Context& context) override {
        std::vector<Irradiance> out(receivers.size());
        parallel_for(context, "light cuts", receivers.size(), [&](std::size_t i) { out[i] = at(receivers[i]); });
        return out;
    }
    Cost cost() const override { return {rays_, lights_.size() * sizeof(VirtualLight) + nodes_.size() * sizeof(Node)}; }

private:
    void place(Context& context) {
        const LightField::Data& d = scene_.field().data();
        const Surfaces& s = scene_.surfaces;
        // Lamps and sky: points by flux, at least one each.
        double flux = 0;
        for (const Emitter& e : d.emitters.emitters) flux += mean(e.radiance) * e.area;
        for (std::uint32_t e = 0; e < d.emitters.emitters.size(); ++e) {
            const Emitter& emitter = d.emitters.emitters[e];
            const double share = mean(emitter.radiance) * emitter.area / flux;
            const auto count = static_cast<std::uint32_t>(std::max(1.0, std::round(share * settings_.lights / 4)));
            const Sobol points(mix(seed_at(emitter.center, settings_.seed), std::uint64_t{51}));
            for (std::uint32_t i = 0; i < count; ++i)
                lights_.push_back({d.emitters.point_on(e, points.pair(i, 0)), emitter.normal, emitter.radiance * (emitter.area / count), emitter.area / count});
        }
        // Where light bounces first: points by area on all that reflects, with the direct light there.
        std::vector<std::uint32_t> triangles;
        std::vector<double> cumulative;
        double area = 0;
        for (std::uint32_t t = 0; t < s.triangles.size(); ++t) {
            const Face& face = s.faces[s.triangle_face[t].at()];
            if (!face.drawn || face.sky || !(max_component(scene_.world.materials[face.material.at()].reflectance) > 0)) continue;
            const auto& v = s.triangles[t];
            area += length(cross(s.positions[v[1]] - s.positions[v[0]], s.positions[v[2]] - s.positions[v[0]])) / 2;
            triangles.push_back(t), cumulative.push_back(area);
        }
        if (!(area > 0)) return;
        const double each = area / settings_.lights;
        std::vector<std::vector<VirtualLight>> found(settings_.lights);
        const Sobol where(mix(settings_.seed, std::uint64_t{52}));
        parallel_for(context, "virtual lights", settings_.lights, [&](std::size_t i) {
            const auto index = static_cast<std::uint32_t>(i);
            std::uint64_t rays = 0;
            const PathTracer tracer{d, &rays};
            const Vec2 u = where.pair(index, 0);
            const auto at = static_cast<std::size_t>(std::ranges::lower_bound(cumulative.begin(), cumulative.end() - 1, u.x * area) - cumulative.begin());
            const double before = at ? cumulative[at - 1] : 0;
            const Vec2 w = uniform_triangle({std::clamp((u.x * area - before) / (cumulative[at] - before), 0.0, 1.0), u.y});
            const auto& v = s.triangles[triangles[at]];
            const Vec3 a = s.positions[v[0]], b = s.positions[v[1]], c = s.positions[v[2]];
            const Face* face = &s.faces[s.triangle_face[triangles[at]].at()];
            Vec3 point = a + (b - a) * w.x + (c - a) * w.y, normal = face->normal;
            Vec3 x = point + normal * d.scene.push_off();
            // Direct light there.
            const std::uint64_t seed = mix(settings_.seed, i, std::uint64_t{53});
            Random random(seed);
            Rgbd direct = entities_at(scene_, point, normal, {normal, normal, normal, normal}, seed, rays_)[0];
            Choice choice;
            choice.build(d.emitters, x, normal);
            const Sobol points(seed);
            for (std::uint32_t k = 0; k < kLampSamples; ++k) {
                Vec3 way;
                Rgbd weight;
                if (tracer.emitter_sample(choice, x, normal, points(k, 4), points.pair(k, 2), [](Vec3) { return 0.0; }, &way, &weight))
                    direct += weight * (dot(way, normal) / kLampSamples);
            }
            const auto reflectance = [&] {
                Rgbd rho = static_cast<Rgbd>(scene_.world.materials[face->material.at()].reflectance);
                for (std::size_t k = 0; k < 3; ++k) rho[k] = std::clamp(rho[k], 0.0, 0.99);
                return rho;
            };
            Rgbd power = reflectance() * direct * each;
            // From here on by chance: what leaves arrives somewhere, with all its power.
            for (int bounce = 0; bounce < kMostBounces && max_component(power) > 0; ++bounce) {
                found[i].push_back({point, normal, power * (1 / kPi), each});
                if (bounce > 0) {
                    const double survive = std::min(0.95, max_component(reflectance()));
                    if (!(random() < survive)) break;
                    power *= 1 / survive;
                }
                const double p = random(), q = random();
                const Vec3 way = frame_around(normal).world(cosine_hemisphere({p, q}));
                ++rays;
                const auto hit = d.scene.closest(x, way);
                if (!hit || hit->back || hit->sky) break;
                face = &s.faces[hit->face.at()];
                if (!face->drawn) break;
                normal = dot(face->normal, way) > 0 ? -face->normal : face->normal;
                point = hit->position, x = point + normal * d.scene.push_off();
                power = power * reflectance();
            }
            rays_.fetch_add(rays, std::memory_order_relaxed);
        });
        for (const auto& list : found) lights_.insert(lights_.end(), list.begin(), list.end());
    }

    // The node before its children.
    std::uint32_t build(std::span<std::uint32_t> part) {
        const auto id = static_cast<std::uint32_t>(nodes_.size());
        nodes_.emplace_back();
        Node node;
        if (part.size() == 1) {
            const VirtualLight& l = lights_[part[0]];
            node.box.add(l.point);
            node.axis = l.normal, node.intensity = l.intensity, node.least_area = l.area, node.light = part[0];
            nodes_[id] = node;
            return id;
        }
        const auto halves = halved(part, [&](std::uint32_t i, std::size_t k) { return k < 3 ? lights_[i].point[k] : lights_[i].normal[k - 3] * normal_scale_; });
        node.left = build(halves[0]), node.right = build(halves[1]);
        const Node &a = nodes_[node.left], &b = nodes_[node.right];
        node.box = a.box, node.box.add(b.box);
        node.intensity = a.intensity + b.intensity;
        node.least_area = std::min(a.least_area, b.least_area);
        // One of the two, by chance and intensity.
        const double share = mean(a.intensity) / mean(node.intensity);
        node.light = Random(mix(settings_.seed, a.light, b.light))() < share ? a.light : b.light;
        node.axis = normalize(a.axis + b.axis);
        double cosine = length(a.axis + b.axis) > 1e-9 ? 1 : -1;
        for (const std::uint32_t i : part) cosine = std::min(cosine, dot(node.axis, lights_[i].normal));
        node.cos_half = std::clamp(cosine, -1.0, 1.0), node.sin_half = std::sqrt(1 - node.cos_half * node.cos_half);
        nodes_[id] = node;
        return id;
    }

    // No light of the node can send more than its share of this, along any of the directions.
    double bound(const Node& node, const Receiver& r) const {
        double near2 = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            const double d = std::max({node.box.lo[k] - r.point[k], 0.0, r.point[k] - node.box.hi[k]});
            near2 += d * d;
        }
        const auto furthest = [&](Vec3 n) { // of the box along n, seen from the receiver
            double sum = 0;
            for (std::size_t k = 0; k < 3; ++k) sum += n[k] * ((n[k] > 0 ? node.box.hi[k] : node.box.lo[k]) - r.point[k]);
            return sum;
        };
        if (furthest(r.normal) <= 0) return 0;
        const double near = std::sqrt(near2);
        double here = 0;
        for (const Vec3 d : r.directions) here = std::max(here, near > 0 ? furthest(d) / near : 1);
        here = std::min(here, 1.0);
        if (!(here > 0)) return 0;
        double there = 1;
        if (near > 0) { // angle between the axis and the way here, less half the cone
            const double along = furthest(-node.axis);
            const Vec3 far{std::max(std::abs(node.box.lo.x - r.point.x), std::abs(node.box.hi.x - r.point.x)),
                           std::max(std::abs(node.box.lo.y - r.point.y), std::abs(node.box.hi.y - r.point.y)),
                           std::max(std::abs(node.box.lo.z - r.point.z), std::abs(node.box.hi.z - r.point.z))};
            const double c = std::clamp(along > 0 ? along / near : along / length(far), -1.0, 1.0);
            if (c < node.cos_half) there = c * node.cos_half + std::sqrt(1 - c * c) * node.sin_half;
        }
        return mean(node.intensity) * here * std::max(0.0, there) / (near2 + node.least_area / kPi);
    }

    Irradiance at(const Receiver& r) {
        Irradiance sum = entities_at(scene_, r.point, r.normal, r.directions, seed_at(r.point, 7), rays_);
        if (nodes_.empty()) return sum;
        std::uint64_t rays = 0;
        const double off = scene_.trace().push_off();
        const Vec3 x = r.point + r.normal * off;
        // What one unit of intensity of a light brings.
        const auto sent = [&](std::uint32_t light) {
            std::array<double, 4> f{};
            const VirtualLight& l = lights_[light];
            const Vec3 to = l.point - x;
            const double r2 = dot(to, to), there = -dot(to, l.normal);
            if (!(there > 0) || !(dot(to, r.normal) > 0)) return f;
            ++rays;
            if (scene_.trace().occluded(x, l.point + l.normal * off)) return f;
            for (std::size_t k = 0; k < 4; ++k) f[k] = std::max(0.0, dot(to, r.directions[k])) * there / (r2 * (r2 + l.area / kPi));
            return f;
        };
        struct Item {
            double bound;
            std::uint32_t node;
            std::array<double, 4> factor;
            bool operator<(const Item& o) const { return bound < o.bound || (bound == o.bound && node > o.node); }
        };
        thread_local std::vector<Item> heap;
        heap.clear();
        const auto put = [&](std::uint32_t node, const std::array<double, 4>& factor) {
            for (std::size_t k = 0; k < 4; ++k) sum[k] += nodes_[node].intensity * factor[k];
            if (!nodes_[node].left) return; // exact but for its one ray
            heap.push_back({bound(nodes_[node], r), node, factor});
            std::push_heap(heap.begin(), heap.end());
        };
        put(0, sent(nodes_[0].light));
        while (!heap.empty()) {
            const double total = mean(sum[0] + sum[1] + sum[2] + sum[3]) / 4;
            if (!(heap.front().bound > settings_.error * total)) break;
            std::pop_heap(heap.begin(), heap.end());
            const Item item = heap.back();
            heap.pop_back();
            const Node& node = nodes_[item.node];
            for (std::size_t k = 0; k < 4; ++k) sum[k] += node.intensity * -item.factor[k];
            for (const std::uint32_t child : {node.left, node.right}) put(child, nodes_[child].light == node.light ? item.factor : sent(nodes_[child].light));
        }
        rays_.fetch_add(rays, std::memory_order_relaxed);
        for (Rgbd& e : sum)
            for (std::size_t c = 0; c < 3; ++c) e[c] = std::max(0.0, e[c]); // rounding of what was taken out again
        return sum;
    }

    const Scene& scene_;
    const ManyLightSettings settings_;
    std::vector<VirtualLight> lights_;
    std::vector<Node> nodes_;
    double normal_scale_ = 0;
    std::atomic<std::uint64_t> rays_{0};
};

} // namespace

std::unique_ptr<Method> many_light_cut(const Scene& scene, const ManyLightSettings& settings, Context& context) {
    return std::make_unique<Cut>(scene, settings, context);
}

} // namespace kiln::rivals

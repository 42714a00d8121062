#include "compiler/light/path_tracer.h"
#include "compiler/light/rivals/parts.h"
#include "libs/parallel/parallel.h"

namespace kiln::rivals {
namespace {

constexpr HemisphereMap kFirstMap{0.6}; // as the reference: tilted directions want light near the horizon too
constexpr std::uint32_t kMostPoints = 16; // of a footprint
constexpr std::uint32_t kPathsAPlace = 16; // at least: all light entities are asked once for each place

class PathTracing final : public Method {
public:
    PathTracing(const Scene& scene, const PathSettings& settings) : scene_(scene), settings_(settings) {}

    std::vector<Irradiance> light(std::span<const Receiver> receivers, Context& context) override {
        std::vector<Irradiance> out(receivers.size());
        parallel_for(context, "path tracing", receivers.size(), [&](std::size_t i) { out[i] = at(receivers[i]); });
        return out;
    }
    Cost cost() const override { return {rays_, 0}; }

private:
    Irradiance at(const Receiver& r) {
        const LightField::Data& d = scene_.field().data();
        std::uint64_t rays = 0;
        const PathTracer tracer{d, &rays};
        const std::uint64_t seed = seed_at(r.point, settings_.seed);
        const std::uint32_t paths = std::max(settings_.paths, 1u);
        const std::uint32_t places = r.footprint.empty() ? 1 : std::clamp(paths / kPathsAPlace, 1u, kMostPoints);
        const Sobol where(mix(seed, std::uint64_t{40})), points(mix(seed, std::uint64_t{41}));
        const Frame frame = frame_around(r.normal);
        std::array<Vec3, kMostPoints> x;
        std::array<Choice, kMostPoints> choice;
        Irradiance sum{};
        for (std::uint32_t p = 0; p < places; ++p) {
            const Vec3 place = r.footprint.empty() ? r.point : r.footprint.sample(where.pair(p, 0)).position;
            x[p] = place + r.normal * d.scene.push_off();
            choice[p].build(d.emitters, x[p], r.normal);
            const Irradiance entities = entities_at(scene_, place, r.normal, r.directions, mix(seed, p, std::uint64_t{42}), rays_);
            for (std::size_t k = 0; k < 4; ++k) sum[k] += entities[k] / places;
        }
        const double share = 1.0 / paths;
        const auto density = [&](Vec3 w) { return dot(w, r.normal) > 0 ? kFirstMap.density(dot(w, r.normal)) : 0.0; };
        for (std::uint32_t i = 0; i < paths; ++i) {
            // Blocks of the sequence, not every 16th of it: those share their leading digits, so that each place would see
            // one direction.
            const auto p = static_cast<std::uint32_t>(std::uint64_t{i} * places / paths);
            Random random(mix(seed, i, std::uint64_t{43}));
            Vec3 way;
            Rgbd weight;
            if (tracer.emitter_sample(choice[p], x[p], r.normal, points(i, 4), points.pair(i, 2), density, &way, &weight)) add(sum, r.directions, way, weight * share);
            const Vec3 direction = frame.world(kFirstMap.direction(points.pair(i, 0)));
            const double q = density(direction);
            if (!(q > 0)) continue;
            add(sum, r.directions, direction, tracer.met(choice[p], x[p], direction, q, random) * (share / q));
        }
        rays_.fetch_add(rays, std::memory_order_relaxed);
        return sum;
    }

    const Scene& scene_;
    const PathSettings settings_;
    std::atomic<std::uint64_t> rays_{0};
};

} // namespace

std::unique_ptr<Method> path_tracing(const Scene& scene, const PathSettings& settings) {
    return std::make_unique<PathTracing>(scene, settings);
}

} // namespace kiln::rivals

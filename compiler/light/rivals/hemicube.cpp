#include "compiler/light/lambert.h"
#include "compiler/light/rivals/parts.h"
#include "libs/parallel/parallel.h"
#include <numbers>

namespace kiln::rivals {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr std::uint32_t kNothing = UINT32_MAX; // a pixel that shows no patch

class Hemicube final : public Method {
public:
    Hemicube(const Scene& scene, const HemicubeSettings& settings, Context& context)
        : scene_(scene), pixels_(hemicube_pixels(settings.resolution)), set_(uniform_patches(scene, settings.patch_size)) {
        const LightField::Data& d = scene_.field().data();
        const std::size_t n = set_.elements.size();
        std::vector<Row> rows(n);
        std::vector<Rgbd> direct(n);
        parallel_for(context, "hemicubes", n, [&](std::size_t i) {
            const Element& e = set_.elements[i];
            if (!(max_component(set_.reflectance[i]) > 0)) return;
            direct[i] = entities_at(scene_, e.point, e.normal, set_.directions[i], seed_at(e.point, 7), rays_)[0];
            std::vector<std::pair<std::uint32_t, double>> items;
            render(e.point, e.normal, e.normal, [&](const HemicubePixel& pixel, Vec3 way, const std::optional<SceneHit>& hit) {
                direct[i] += emitted(d, hit, way) * (kPi * pixel.weight);
                const std::uint32_t j = patch_of(hit);
                if (j != kNothing && max_component(set_.reflectance[j]) > 0) items.emplace_back(j, pixel.weight);
            });
            std::ranges::stable_sort(items, {}, &std::pair<std::uint32_t, double>::first);
            for (std::size_t k = 0; k < items.size();) {
                double sum = 0;
                const std::uint32_t j = items[k].first;
                for (; k < items.size() && items[k].first == j; ++k) sum += items[k].second;
                rows[i].patch.push_back(j), rows[i].factor.push_back(static_cast<float>(sum));
            }
        });
        const std::vector<Rgbd> h = solve_rows(rows, direct, set_.reflectance, context);
        for (std::size_t i = 0; i < n; ++i) radiance_.push_back(set_.reflectance[i] * h[i] * (1 / kPi));
        bytes_ = set_.bytes() + n * (sizeof(Rgbd) + sizeof(Row)) + pixels_.size() * sizeof(HemicubePixel);
        for (const Row& r : rows) bytes_ += r.patch.size() * 8;
    }

    std::vector<Irradiance> light(std::span<const Receiver> receivers, Context& context) override {
        const LightField::Data& d = scene_.field().data();
        std::vector<Irradiance> out(receivers.size());
        parallel_for(context, "hemicubes at luxels", receivers.size(), [&](std::size_t i) {
            const Receiver& r = receivers[i];
            out[i] = entities_at(scene_, r.point, r.normal, r.directions, seed_at(r.point, 7), rays_);
            for (std::size_t k = 0; k < 4; ++k)
                render(r.point, r.normal, r.directions[k], [&](const HemicubePixel& pixel, Vec3 way, const std::optional<SceneHit>& hit) {
                    Rgbd radiance = emitted(d, hit, way);
                    if (const std::uint32_t j = patch_of(hit); j != kNothing) radiance += radiance_[j];
                    out[i][k] += radiance * (kPi * pixel.weight);
                });
        });
        return out;
    }
    Cost cost() const override { return {rays_, bytes_}; }

private:
    // Pixels around `axis` whose rays leave the surface: the rest shows the surface itself.
    template <class Visit> void render(Vec3 x, Vec3 n, Vec3 axis, const Visit& visit) {
        const Frame frame = frame_around(axis);
        const Vec3 from = x + n * scene_.trace().push_off();
        thread_local std::vector<Vec3> origins, ways;
        thread_local std::vector<std::uint32_t> which;
        thread_local std::vector<std::optional<SceneHit>> hits;
        ways.clear(), which.clear();
        for (std::uint32_t p = 0; p < pixels_.size(); ++p) {
            const Vec3 way = frame.world(pixels_[p].direction);
            if (dot(way, n) > 0) ways.push_back(way), which.push_back(p);
        }
        origins.assign(ways.size(), from), hits.resize(ways.size());
        scene_.trace().closest(origins, ways, hits);
        rays_.fetch_add(ways.size(), std::memory_order_relaxed);
        for (std::size_t i = 0; i < ways.size(); ++i) visit(pixels_[which[i]], ways[i], hits[i]);
    }
    static Rgbd emitted(const LightField::Data& d, const std::optional<SceneHit>& hit, Vec3 way) {
        if (!hit) return d.sky;
        if (hit->back) return {};
        const std::uint32_t e = d.emitter(*hit, way);
        return e == UINT32_MAX ? Rgbd{} : d.emitters.emitters[e].radiance;
    }
    std::uint32_t patch_of(const std::optional<SceneHit>& hit) const {
        if (!hit || hit->back) return kNothing;
        const PatchTable& t = set_.table;
        const std::uint32_t p = patch_at(scene_.field().data().index, t.texel_patch, t.piece_patch, t.face_patch, hit->face, hit->position);
        return p == kNoPatch ? kNothing : p;
    }

    const Scene& scene_;
    const std::vector<HemicubePixel> pixels_;
    PatchSet set_;
    std::vector<Rgbd> radiance_; // per patch: reflected
    std::uint64_t bytes_ = 0;
    std::atomic<std::uint64_t> rays_{0};
};

} // namespace

std::vector<HemicubePixel> hemicube_pixels(std::uint32_t resolution) {
    const std::uint32_t half = std::max(1u, (resolution + 1) / 2);
    const int r = static_cast<int>(half);
    std::vector<HemicubePixel> out;
    // A pixel spans [i, i+1] x [j, j+1] / half of the plane corner + s u + t v at distance 1.
    const auto pixel = [&](Vec3 corner, Vec3 u, Vec3 v, int i, int j) {
        const auto at = [&](double s, double t) { return corner + u * (s / half) + v * (t / half); };
        const std::array<Vec3, 4> quad{at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)};
        out.push_back({normalize(at(i + 0.5, j + 0.5)), lambert_form_factor({}, {0, 0, 1}, quad)});
    };
    for (int j = -r; j < r; ++j)
        for (int i = -r; i < r; ++i) pixel({0, 0, 1}, {1, 0, 0}, {0, 1, 0}, i, j);
    const std::array<std::array<Vec3, 2>, 4> sides{{{Vec3{1, 0, 0}, Vec3{0, 1, 0}}, {Vec3{-1, 0, 0}, Vec3{0, -1, 0}}, {Vec3{0, 1, 0}, Vec3{-1, 0, 0}}, {Vec3{0, -1, 0}, Vec3{1, 0, 0}}}};
    for (const auto& [corner, u] : sides)
        for (int j = 0; j < r; ++j)
            for (int i = -r; i < r; ++i) pixel(corner, u, {0, 0, 1}, i, j);
    return out;
}

std::unique_ptr<Method> hemicube_radiosity(const Scene& scene, const HemicubeSettings& settings, Context& context) {
    return std::make_unique<Hemicube>(scene, settings, context);
}

} // namespace kiln::rivals

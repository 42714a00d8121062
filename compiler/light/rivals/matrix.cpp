// Matrix radiosity. The rules differ in how a pair of patches exchanges light; visibility is one ray a pair for all.
#include "compiler/light/lambert.h"
#include "compiler/light/rivals/parts.h"
#include "libs/parallel/parallel.h"
#include <fmt/format.h>
#include <numbers>

namespace kiln::rivals {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kNear = 0.04 * kPi;   // a pair is near where kNear r^2 < area: "five times"
constexpr double kFacing = 0.01;       // map units: vrad's middles must stand so far in front of each other's planes
constexpr double kLeastFactor = 1e-7 / kPi; // smaller ones are dropped

// Edge angles by asin, which folds those beyond a right angle back; nothing is clipped.
double folded_contour(Vec3 x, Vec3 n, std::span<const Vec3> polygon) {
    double sum = 0;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
        const Vec3 u = normalize(polygon[i] - x), v = normalize(polygon[i + 1 == polygon.size() ? 0 : i + 1] - x), w = cross(u, v);
        const double s = length(w);
        if (s > 0) sum += std::asin(std::min(1.0, s)) / s * dot(w, n);
    }
    return std::max(0.0, -sum / (2 * kPi)); // polygons face x, so that they run clockwise around it
}

double point_factor(Vec3 x, Vec3 d, const Element& e) {
    const Vec3 to = e.point - x;
    const double r2 = dot(to, to);
    return std::max(0.0, dot(to, d)) * std::max(0.0, -dot(to, e.normal)) * e.area / (kPi * r2 * r2);
}

using Factors = std::array<double, 4>;

class Matrix final : public Method {
public:
    Matrix(const Scene& scene, const MatrixSettings& settings, Context& context) : scene_(scene), settings_(settings), set_(uniform_patches(scene, settings.patch_size)) {
        const std::size_t n = set_.elements.size();
        bytes_ = set_.bytes();
        if (const std::uint64_t bits = n * n / 16; bits + bytes_ > settings_.most_bytes) {
            refused_ = fmt::format("{} patches: their pairs alone take {} MB", n, bits >> 20);
            return;
        }
        make_rows(context);
        if (!refused_.empty()) return;
        // Light at the patches: lamps, entities, then all bounces.
        std::vector<Rgbd> direct(n);
        parallel_for(context, n, [&](std::size_t i) {
            direct[i] = direct_at(set_.elements[i].point, set_.elements[i].normal, set_.directions[i])[0];
        });
        const std::vector<Rgbd> h = solve_rows(rows_, direct, set_.reflectance, context);
        radiance_.resize(n);
        for (std::size_t i = 0; i < n; ++i) radiance_[i] = set_.reflectance[i] * h[i] * (1 / kPi);
        // The same exchange once more, along all four directions.
        indirect_.resize(n);
        parallel_for(context, n, [&](std::size_t i) {
            for (std::size_t k = 0; k < rows_[i].patch.size(); ++k) {
                const std::uint32_t j = rows_[i].patch[k];
                const Factors f = factors(set_.elements[i].point, set_.elements[i].normal, set_.directions[i], set_.elements[j]);
                // Rows that were scaled down are scaled here too.
                const double scale = f[0] > 0 && settings_.rule == MatrixRule::vrad ? static_cast<double>(rows_[i].factor[k]) / f[0] : 1;
                for (std::size_t d = 0; d < 4; ++d) indirect_[i][d] += radiance_[j] * (kPi * f[d] * scale);
            }
        });
    }

    std::vector<Irradiance> light(std::span<const Receiver> receivers, Context& context) override {
        std::vector<Irradiance> out(receivers.size());
        if (!refused_.empty()) return out;
        parallel_for(context, "matrix radiosity", receivers.size(), [&](std::size_t i) {
            const Receiver& r = receivers[i];
            out[i] = direct_at(r.point, r.normal, r.directions);
            const Irradiance rest = r.luxel == UINT32_MAX ? gather(r) : interpolate(r);
            for (std::size_t d = 0; d < 4; ++d) out[i][d] += rest[d];
        });
        return out;
    }
    Cost cost() const override { return {rays_, bytes_}; }
    std::string refused() const override { return refused_; }

private:
    bool is_near(Vec3 x, const Element& e) const {
        const Vec3 to = e.point - x;
        return settings_.rule != MatrixRule::centre && kNear * dot(to, to) < e.area;
    }
    // Unoccluded factors along four directions; `aim`: where the ray of the pair goes.
    Factors factors(Vec3 x, Vec3 n, const std::array<Vec3, 4>& directions, const Element& e, Vec3* aim = nullptr) const {
        Factors f{};
        if (aim) *aim = e.point;
        if (dot(e.normal, x - e.point) <= 0) return f; // it faces away
        if (settings_.rule == MatrixRule::corrected && is_near(x, e)) {
            thread_local Polygon above;
            Vec3 moment;
            double all = 0;
            for (const Polygon& part : e.parts) {
                above.clear();
                clip_to_horizon(x, n, part, [&](Vec3 p) { above.push_back(p); });
                if (above.size() < 3) continue;
                double a = 0;
                moment += moment_of(above, &a), all += a;
                for (std::size_t d = 0; d < 4; ++d) f[d] += lambert_form_factor(x, directions[d], above);
            }
            if (aim && all > 0 && all < e.area * (1 - 1e-9)) *aim = moment / all;
            return f;
        }
        const Vec3 to = e.point - x;
        if (dot(to, n) <= 0) return f;
        if (settings_.rule == MatrixRule::vrad) {
            const double cosine = dot(to, n);
            if (cosine < kFacing || -dot(to, e.normal) < kFacing) return f;
            double flat = 0;
            if (is_near(x, e))
                for (const Polygon& part : e.parts) flat += folded_contour(x, n, part);
            else
                flat = point_factor(x, n, e);
            for (std::size_t d = 0; d < 4; ++d) f[d] = flat * std::max(0.0, dot(to, directions[d])) / cosine;
            return f;
        }
        for (std::size_t d = 0; d < 4; ++d) f[d] = point_factor(x, directions[d], e);
        return f;
    }
    double flat_factor(std::size_t i, std::size_t j, Vec3* aim) const {
        const Vec3 n = set_.elements[i].normal;
        return factors(set_.elements[i].point, n, {n, n, n, n}, set_.elements[j], aim)[0];
    }
    bool sees(Vec3 x, Vec3 n, Vec3 y, Vec3 m) {
        rays_.fetch_add(1, std::memory_order_relaxed);
        const double off = scene_.trace().push_off();
        return !scene_.trace().occluded(x + n * off, y + m * off);
    }

    void make_rows(Context& context) {
        const std::size_t n = set_.elements.size();
        // One ray serves both directions of a pair: row i keeps the answers for j > i.
        std::vector<std::vector<std::uint64_t>> seen(n);
        parallel_for(context, "matrix: pairs", n, [&](std::size_t i) {
            const Element& a = set_.elements[i];
            std::vector<std::uint64_t> bits((n - i + 63) / 64);
            std::uint64_t rays = 0;
            const double off = scene_.trace().push_off();
            for (std::size_t j = i + 1; j < n; ++j) {
                const Element& b = set_.elements[j];
                const Vec3 to = b.point - a.point;
                if (!(dot(to, a.normal) > 0) || !(dot(to, b.normal) < 0)) continue;
                ++rays;
                if (!scene_.trace().occluded(a.point + a.normal * off, b.point + b.normal * off)) bits[(j - i) / 64] |= std::uint64_t{1} << ((j - i) % 64);
            }
            seen[i] = std::move(bits);
            rays_.fetch_add(rays, std::memory_order_relaxed);
        });
        rows_.resize(n);
        std::atomic<std::uint64_t> links{0};
        parallel_for(context, "matrix: factors", n, [&](std::size_t i) {
            if (links * 8 + bytes_ > settings_.most_bytes) return;
            const Element& a = set_.elements[i];
            Row& row = rows_[i];
            double sum = 0;
            for (std::size_t j = 0; j < n; ++j) {
                if (i == j || !(max_component(set_.reflectance[j]) > 0)) continue;
                const std::size_t lo = std::min(i, j), hi = std::max(i, j);
                const Element& b = set_.elements[j];
                const bool joined = (seen[lo][(hi - lo) / 64] >> ((hi - lo) % 64)) & 1;
                // A near patch cut by the horizon has a ray of its own, at what is above.
                if (!joined && !(settings_.rule == MatrixRule::corrected && is_near(a.point, b))) continue;
                Vec3 aim;
                const double f = flat_factor(i, j, &aim);
                if (!(f > kLeastFactor)) continue;
                if (aim == b.point ? !joined : !sees(a.point, a.normal, aim, b.normal)) continue;
                row.patch.push_back(static_cast<std::uint32_t>(j)), row.factor.push_back(static_cast<float>(f));
                sum += f;
            }
            if (settings_.rule == MatrixRule::vrad && sum > 1)
                for (float& f : row.factor) f = static_cast<float>(f / sum);
            row.patch.shrink_to_fit(), row.factor.shrink_to_fit();
            links += row.patch.size();
        });
        bytes_ += links * 8 + n * n / 16;
        if (bytes_ > settings_.most_bytes) refused_ = fmt::format("{} patches: their links take more than {} MB", n, settings_.most_bytes >> 20), rows_.clear();
    }

    Irradiance direct_at(Vec3 x, Vec3 n, const std::array<Vec3, 4>& directions) {
        Irradiance sum = entities_at(scene_, x, n, directions, seed_at(x, 7), rays_);
        for (const PatchSet::Lamp& lamp : set_.lamps) {
            Factors f{};
            Vec3 aim = lamp.element.point;
            if (settings_.rule == MatrixRule::vrad) { // lamps send from their middle, however near
                if (dot(aim - x, n) > 0)
                    for (std::size_t d = 0; d < 4; ++d) f[d] = point_factor(x, directions[d], lamp.element);
            } else {
                f = factors(x, n, directions, lamp.element, &aim);
            }
            if (!(std::max({f[0], f[1], f[2], f[3]}) > 0) || !sees(x, n, aim, lamp.element.normal)) continue;
            for (std::size_t d = 0; d < 4; ++d) sum[d] += lamp.radiance * (kPi * f[d]);
        }
        return sum;
    }
    // A point that is no luxel: all patches, a ray each.
    Irradiance gather(const Receiver& r) {
        Irradiance sum{};
        for (std::size_t j = 0; j < set_.elements.size(); ++j) {
            if (!(max_component(radiance_[j]) > 0)) continue;
            Vec3 aim;
            const Factors f = factors(r.point, r.normal, r.directions, set_.elements[j], &aim);
            if (!(std::max({f[0], f[1], f[2], f[3]}) > 0) || !sees(r.point, r.normal, aim, set_.elements[j].normal)) continue;
            for (std::size_t d = 0; d < 4; ++d) sum[d] += radiance_[j] * (kPi * f[d]);
        }
        return sum;
    }
    // Linear between the middles of the patches about a luxel that lie in its chart; beyond the outermost, constant.
    Irradiance interpolate(const Receiver& r) const {
        const std::uint32_t own = set_.luxel_patch[r.luxel];
        Irradiance sum{};
        if (own == kNoPatch) return sum;
        const Surfaces& s = scene_.surfaces;
        const Luxel& luxel = s.luxels[r.luxel];
        const Chart& chart = s.charts[luxel.chart.at()];
        if (chart.smooth || settings_.patch_size <= chart.luxel_size) return indirect_[own]; // frames differ; or nothing to do
        double all = 0;
        const double size = std::exp2(std::floor(std::log2(settings_.patch_size / chart.luxel_size) + 1e-9)) * chart.luxel_size;
        const int reach = static_cast<int>(size / chart.luxel_size);
        std::vector<std::uint32_t> about{own};
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx) {
                const int x = luxel.x + dx * reach, y = luxel.y + dy * reach;
                if ((!dx && !dy) || x < 0 || y < 0 || x >= static_cast<int>(chart.width) || y >= static_cast<int>(chart.height)) continue;
                const std::uint32_t p = set_.table.texel_patch[chart.texel(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y))];
                if (p < kMixedPatch && std::ranges::find(about, p) == about.end()) about.push_back(p);
            }
        for (const std::uint32_t p : about) {
            const Vec3 d = set_.elements[p].point - r.point;
            const double w = std::max(0.0, 1 - std::abs(dot(d, chart.s)) / size) * std::max(0.0, 1 - std::abs(dot(d, chart.t)) / size);
            if (!(w > 0)) continue;
            all += w;
            for (std::size_t k = 0; k < 4; ++k) sum[k] += indirect_[p][k] * w;
        }
        if (!(all > 0)) return indirect_[own];
        for (Rgbd& e : sum) e = e / all;
        return sum;
    }

    const Scene& scene_;
    const MatrixSettings settings_;
    PatchSet set_;
    std::vector<Row> rows_;
    std::vector<Rgbd> radiance_;       // per patch: reflected
    std::vector<Irradiance> indirect_; // per patch
    std::string refused_;
    std::uint64_t bytes_ = 0;
    std::atomic<std::uint64_t> rays_{0};
};

} // namespace

double matrix_factor(MatrixRule rule, Vec3 x, Vec3 n, std::span<const Vec3> convex) {
    Element e;
    e.parts = {Polygon(convex.begin(), convex.end())};
    Vec3 normal;
    for (std::size_t i = 1; i + 1 < convex.size(); ++i) normal += cross(convex[i] - convex[0], convex[i + 1] - convex[0]);
    double area = 0;
    e.point = moment_of(e.parts[0], &area) / (length(normal) / 2);
    e.area = length(normal) / 2, e.normal = normalize(normal);
    if (rule == MatrixRule::centre || !(kNear * dot(e.point - x, e.point - x) < e.area)) return point_factor(x, n, e);
    return rule == MatrixRule::vrad ? folded_contour(x, n, e.parts[0]) : lambert_form_factor(x, n, e.parts[0]);
}

std::unique_ptr<Method> matrix_radiosity(const Scene& scene, const MatrixSettings& settings, Context& context) {
    return std::make_unique<Matrix>(scene, settings, context);
}

} // namespace kiln::rivals

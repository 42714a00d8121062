#include "compiler/density/shown_error.h"
#include "compiler/light/bake.h"
#include "compiler/light/kept_rest.h"
#include "compiler/light/seams.h"
#include "libs/parallel/parallel.h"
#include "libs/sampling/maps.h"
#include "libs/sampling/sobol.h"
#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

namespace kiln {
namespace {

using Shown = std::array<Rgbd, 4>; // as LuxelKernel::shown
constexpr std::size_t kAnswers = 3;

struct Place {
    std::uint32_t luxel = 0;
    FaceId face;
    Vec3 position;
};

struct Answer {
    std::size_t normals = 0; // 0: buried
    Shown shown;
    std::array<Shown, kAnswers> light;
};

class Asking {
public:
    Asking(const World& world, const Surfaces& s, const Lighting& light, const Density& texels, const LightField& field, const ShownErrorOptions& options, Memo* memo)
        : s_(s), corner_(least_corner(s)), light_(light), texels_(texels), field_(field), memo_(memo), rest_(field, memo), options_(options), cones_(cone_tables(world, s, directional_of(light), light.encoding)) {}

    // By area, one in each of equal strata.
    std::vector<Place> places() const {
        std::vector<std::uint32_t> candidates;
        std::vector<double> cumulative;
        double area = 0;
        for (std::uint32_t l = 0; l < s_.luxels.size(); ++l) {
            const Luxel& luxel = s_.luxels[l];
            if (light_.valid[texel_of(s_, luxel)] != 1) continue;
            candidates.push_back(l), cumulative.push_back(area += luxel.area * luxel_area(s_, luxel.face));
        }
        const auto count = static_cast<std::uint32_t>(std::min<std::size_t>(options_.places, candidates.size()));
        std::vector<Place> out;
        Random random(mix(options_.seed, std::uint64_t{91}));
        for (std::uint32_t i = 0; i < count && area > 0; ++i) {
            const auto at = std::ranges::lower_bound(cumulative.begin(), cumulative.end() - 1, area * (i + random()) / count) - cumulative.begin();
            const Vec2 u{random(), random()};
            if (const auto place = place_in(candidates[static_cast<std::size_t>(at)], u)) out.push_back(*place);
        }
        return out;
    }

    // Lamps, whose light is as good as exact, are asked once.
    Answer answer(const Place& place) const {
        const LuxelKernel kernel{light_frame(s_, place.face, place.position), light_.encoding, cones_[s_.luxels[place.luxel].chart.at()].get()};
        const ShownTexels read = filtered_at(s_, light_, texels_, place.face, place.position);
        Answer out;
        out.normals = kernel.shown_count();
        out.shown = LuxelKernel::displayed(kernel.shown(read.flat, read.rnm));
        const Vec3 n = s_.faces[place.face.at()].normal;
        const auto seed = [&](std::uint64_t what) { return mix_place(place.position - corner_, options_.seed, 92 + what); };
        const std::uint64_t of_kernel = hash_of(kernel).low;
        KernelSum lamps;
        field_.arriving_direct(place.position, n, seed(0), [&](Vec3 direction, Rgbd weight) { kernel.add(lamps, direction, weight); });
        for (std::size_t k = 0; k < kAnswers; ++k) {
            KernelSum sum = rest_.sum<KernelSum>(place.position, n, options_.rays, seed(k), of_kernel, [&](const KeptRest::Arrivals& arrivals) {
                KernelSum rest;
                const auto add = [&](Vec3 direction, Rgbd weight) { kernel.add(rest, direction, weight); };
                arrivals(add, add);
                return rest;
            });
            out.light[k] = LuxelKernel::displayed(kernel.shown(sum += lamps));
        }
        return out;
    }
    // In something solid that does not cut the face, a brush model or terrain: nobody looks at it.
    bool buried(const Place& place) const {
        constexpr std::uint32_t kRays = 16; // half of them, as for luxels
        const std::uint64_t stream = mix_place(place.position - corner_, options_.seed, std::uint64_t{90});
        const auto bits = [](double x) { return std::bit_cast<std::uint64_t>(x); };
        const std::uint64_t key = mix(stream, place.face.value, bits(place.position.x), bits(place.position.y), bits(place.position.z)); // a stream is that of all places within 1/64 unit
        return known_or<bool>(memo_, key, [&] {
            const Vec3 n = s_.faces[place.face.at()].normal, from = place.position + n * field_.scene().push_off();
            const Frame frame = frame_around(n);
            const Sobol points(stream);
            std::uint32_t back = 0;
            for (std::uint32_t i = 0; i < kRays; ++i) {
                const auto hit = field_.scene().closest(from, frame.world(cosine_hemisphere(points.pair(i, 0))));
                back += hit && hit->back;
            }
            return 2 * back > kRays;
        });
    }

private:
    const Surfaces& s_;
    const Vec3 corner_;
    const Lighting& light_;
    const Density& texels_;
    const LightField& field_;
    Memo* memo_;
    const KeptRest rest_;
    const ShownErrorOptions& options_;
    std::vector<std::shared_ptr<const ConeTable>> cones_;

    static Directional directional_of(const Lighting& light) {
        if (std::ranges::all_of(light.chart_directional, [](std::uint8_t d) { return d != 0; })) return Directional::all;
        return std::ranges::none_of(light.chart_directional, [](std::uint8_t d) { return d != 0; }) ? Directional::none : Directional::needed;
    }
    std::optional<Place> place_in(std::uint32_t l, Vec2 u) const {
        const Luxel& luxel = s_.luxels[l];
        double all = 0;
        std::vector<Footprint> pieces;
        for (std::uint32_t k = 0; k < luxel.piece_count; ++k) {
            pieces.emplace_back(kBakeMargin * field_.scene().push_off()).add_piece(s_, s_.pieces[luxel.first_piece + k]);
            all += pieces.back().area();
        }
        double at = u.x * all;
        for (std::uint32_t k = 0; k < luxel.piece_count; ++k) {
            const double area = pieces[k].area();
            if (!(area > 0)) continue;
            if (at < area || k + 1 == luxel.piece_count) return Place{l, s_.pieces[luxel.first_piece + k].face, pieces[k].sample({std::min(at / area, 1 - 1e-12), u.y}).position};
            at -= area;
        }
        return std::nullopt;
    }
};

double mean_of(std::span<const double> values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

} // namespace

double most_mean_square(std::span<const double> square) {
    const Bounds b = bounds_of_mean(square, std::vector<double>(square.size(), 1), 0);
    return mean_of(square) + std::max(b.above, b.below); // a stroke that speaks for less speaks for more as well
}

ShownTexels filtered_at(const Surfaces& s, const Lighting& light, const Density& texels, FaceId face, Vec3 point) {
    const ChartId chart = s.faces[face.at()].chart;
    const Chart& c = s.charts[chart.at()];
    const bool own = texels.grids.empty();
    ChartGrid grid;
    if (own) grid.width = c.width, grid.height = c.height, grid.first_texel = c.first_texel, grid.first_rnm = light.rnm_first[chart.at()];
    else grid = texels.grids[chart.at()];
    const Bilinear read = bilinear_at(grid.width, grid.height, texel_from_luxel(grid, luxel_from_world(s, face, point)));
    ShownTexels out;
    for (std::size_t k = 0; k < 4; ++k) {
        out.flat += static_cast<Rgbd>((own ? light.flat : texels.flat)[grid.first_texel + read.texel[k]]) * read.weight[k];
        for (std::size_t i = 0; grid.first_rnm != UINT32_MAX && i < 3; ++i)
            out.rnm[i] += static_cast<Rgbd>((own ? light.rnm : texels.rnm)[grid.first_rnm + read.texel[k]][i]) * read.weight[k];
    }
    return out;
}

Result<ShownError> shown_error(const World& world, const Surfaces& surfaces, const Lighting& lighting, const Density& texels, const LightField& field,
                               const ShownErrorOptions& options, Context& context, Memo* memo) {
    try {
        if (memo) memo->begin();
        const Asking asking(world, surfaces, lighting, texels, field, options, memo);
        const std::vector<Place> places = asking.places();
        std::vector<Answer> answers(places.size());
        parallel_for(context, "what is shown", places.size(), [&](std::size_t i) {
            if (!asking.buried(places[i])) answers[i] = asking.answer(places[i]);
        });
        if (memo) memo->end();
        const auto middle = [](const Answer& a, std::size_t normal) { return (a.light[0][normal] + a.light[1][normal] + a.light[2][normal]) * (1.0 / kAnswers); };
        ShownError out;
        out.places = static_cast<std::uint32_t>(std::ranges::count_if(answers, [](const Answer& a) { return a.normals > 0; }));
        double most = 0;
        std::vector<double> relative;
        for (std::size_t normal = 0; normal < 4; ++normal) {
            std::vector<double> square;
            Rgbd level;
            for (const Answer& a : answers)
                if (normal < a.normals) level += middle(a, normal), square.push_back(0);
            if (square.empty()) continue;
            level = level / static_cast<double>(square.size());
            std::size_t at = 0;
            for (const Answer& a : answers) {
                if (normal >= a.normals) continue;
                double& sum = square[at++];
                if (normal == 0) {
                    const Rgbd light = middle(a, 0);
                    const double scale = std::max(mean(light), options.error_floor * mean(level));
                    relative.push_back(scale > 0 ? std::abs(mean(a.shown[0]) - mean(light)) / scale : 0);
                }
                for (std::size_t c = 0; c < 3; ++c)
                    for (std::size_t k = 0; k < kAnswers; ++k) { // against each by the other two
                        const auto away = [&](std::size_t i) { return a.shown[normal][c] - a.light[(k + i) % kAnswers][normal][c]; };
                        const double scale = std::max(a.light[k][normal][c], options.error_floor * level[c]);
                        if (scale > 0) sum += away(1) * away(2) / (3 * kAnswers * scale * scale);
                    }
            }
            out.percent = std::max(out.percent, 100 * std::sqrt(std::max(0.0, mean_of(square))));
            most = std::max(most, most_mean_square(square));
        }
        out.high = 100 * std::sqrt(std::max(0.0, most));
        std::ranges::sort(relative);
        if (!relative.empty()) out.p95 = 100 * relative[relative.size() * 95 / 100];
        return out;
    } catch (const Cancelled&) {
        return fault(Exit::cancelled, "cancelled", "stopped while looking at what is shown");
    }
}

} // namespace kiln

#include "compiler/density/density.h"
#include "compiler/density/chart_fit.h"
#include "compiler/light/seams.h"
#include "compiler/light/shown.h"
#include "libs/core/check.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <cmath>
#include <mutex>
#include <numeric>
#include <optional>

namespace kiln {
namespace {

// Along an edge at which another chart goes on, both sides together may come apart by twice this.
constexpr double kSeamPercent = 0.15;

constexpr double kDark = 1e-6; // the floor of a scene without light

class Coarsening {
public:
    Coarsening(const Surfaces& s, const Lighting& light, const DensityOptions& options)
        : s_(s), light_(light), share_(options.error_percent / 100), floor_(std::max(error_floor(options.error_floor, mean_irradiance(s, light)), kDark)), seams_(seam_lines(s)), first_luxel_(s.charts.size() + 1) {
        for (const Luxel& l : s.luxels) ++first_luxel_[l.chart.at() + 1];
        std::partial_sum(first_luxel_.begin(), first_luxel_.end(), first_luxel_.begin());
    }
    // `from`: the light that a chart's texels are made from, by fit(chart), where no earlier run has made a grid of it.
    using Fit = std::function<void(std::size_t chart)>;
    Density run(Context& context, Memo* memo, const Lighting& from, const Fit& fit) const;

private:
    const Surfaces& s_;
    const Lighting& light_;
    double share_, floor_;
    std::vector<std::vector<SeamLine>> seams_;
    std::vector<std::uint32_t> first_luxel_; // per chart, and one more

    bool directional(std::size_t chart) const { return light_.rnm_first[chart] != UINT32_MAX; }
    struct Made {
        ChartGrid grid;
        std::vector<Rgb> flat;
        std::vector<std::array<Rgb, 3>> rnm;
        std::vector<std::uint8_t> valid;
        std::vector<float> error;
        double square = 0, weight = 0;
        template <class A> void fields(A& a) { a(grid, flat, rnm, valid, error, square, weight); }
    };
    std::uint64_t key(const Lighting& from, std::size_t chart) const;
    Made make(std::size_t chart) const;
    void note_quality(const ChartFit& fit, std::size_t chart, Made& out) const;
    ChartLight light_of(std::size_t chart) const;
    void fill(ChartLight& out, const Chart& chart) const;
    void cover(ChartLight& out, std::size_t chart) const;
    std::vector<std::uint8_t> along_seams(const ChartLight& light, std::size_t chart) const;
    void doubt(const ChartLight& light, std::size_t chart, std::vector<float>& noise, std::vector<float>& guess) const;
    void allow(ChartLight& out, std::size_t chart) const;
};

// Texels that are of no face, and that no face reads, are only where a fit begins: from what lies next to them, ring by ring.
void Coarsening::fill(ChartLight& out, const Chart& chart) const {
    std::vector<std::uint8_t> known(light_.valid.begin() + chart.first_texel, light_.valid.begin() + chart.first_texel + static_cast<std::ptrdiff_t>(chart.width) * chart.height);
    const auto w = static_cast<int>(out.width), h = static_cast<int>(out.height);
    std::vector<std::uint32_t> ring;
    for (std::uint32_t t = 0; t < known.size(); ++t)
        if (known[t]) ring.push_back(t);
    while (!ring.empty()) {
        std::vector<std::uint32_t> next;
        for (const std::uint32_t t : ring)
            for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
                const int x = static_cast<int>(t) % w + dx, y = static_cast<int>(t) / w + dy;
                if (x < 0 || y < 0 || x >= w || y >= h) continue;
                const auto to = static_cast<std::uint32_t>(y * w + x);
                if (std::exchange(known[to], std::uint8_t{1})) continue;
                std::copy_n(out.texels.begin() + static_cast<std::ptrdiff_t>(t * out.channels), out.channels, out.texels.begin() + static_cast<std::ptrdiff_t>(to * out.channels));
                next.push_back(to);
            }
        ring = std::move(next);
    }
}

void Coarsening::cover(ChartLight& out, std::size_t chart) const {
    constexpr double kTouch = 1e-6; // luxels: less than that into a quad is not in it
    const std::int64_t across = 2 * std::int64_t{out.width}, down = 2 * std::int64_t{out.height};
    out.covered.assign(static_cast<std::size_t>(across * down), 0);
    // A grid reaches as far as the quads do, be they lit or not.
    out.from = {out.width + 0.0, out.height + 0.0}, out.to = {0, 0};
    for (std::uint32_t l = first_luxel_[chart]; l < first_luxel_[chart + 1]; ++l) {
        const Luxel& luxel = s_.luxels[l];
        // Neither baked nor filled: more than two luxels deep in what is solid, and black for want of light to fill it with.
        const bool known = light_.valid[texel_of(s_, luxel)] != 0;
        for (std::uint32_t k = 0; k < luxel.piece_count; ++k) {
            Box3 box;
            for (const Vec2 p : points_of(s_, s_.pieces[luxel.first_piece + k])) box.add(Vec3{p.x, p.y, 0});
            const auto first = [](double v) { return std::max<std::int64_t>(0, static_cast<std::int64_t>(std::floor(2 * v + kTouch))); };
            const auto end = [](double v, std::int64_t most) { return std::min(most, static_cast<std::int64_t>(std::ceil(2 * v - kTouch))); };
            const std::int64_t x0 = first(box.lo.x), y0 = first(box.lo.y), x1 = end(box.hi.x, across), y1 = end(box.hi.y, down);
            if (x0 >= x1 || y0 >= y1) continue;
            out.from = {std::min(out.from.x, 0.5 * static_cast<double>(x0)), std::min(out.from.y, 0.5 * static_cast<double>(y0))};
            out.to = {std::max(out.to.x, 0.5 * static_cast<double>(x1)), std::max(out.to.y, 0.5 * static_cast<double>(y1))};
            for (std::int64_t y = y0; known && y < y1; ++y)
                for (std::int64_t x = x0; x < x1; ++x) out.covered[static_cast<std::size_t>(y * across + x)] = 1;
        }
    }
}

// Half luxels whose corners an edge with another chart comes by.
std::vector<std::uint8_t> Coarsening::along_seams(const ChartLight& light, std::size_t chart) const {
    constexpr double kNear = 1e-3; // luxels
    const std::uint32_t vx = light.vertices_x(), vy = light.vertices_y();
    std::vector<std::uint8_t> out(std::size_t{vx} * vy);
    for (const SeamLine& line : seams_[chart])
        walk(line, [&](Vec2 p) {
            for (const double dy : {-kNear, kNear})
                for (const double dx : {-kNear, kNear}) {
                    const auto x = static_cast<std::size_t>(std::clamp(2 * (p.x + dx), 0.0, vx - 2.0)), y = static_cast<std::size_t>(std::clamp(2 * (p.y + dy), 0.0, vy - 2.0));
                    for (const std::size_t v : {y * vx + x, y * vx + x + 1, (y + 1) * vx + x, (y + 1) * vx + x + 1}) out[v] = 1;
                }
        });
    return out;
}

// Of each texel: the noise of it, relative, and for what no luxel was baked for, how far the value it was given is from
// the one that goes straight on from the luxels beside it.
void Coarsening::doubt(const ChartLight& light, std::size_t chart, std::vector<float>& noise, std::vector<float>& guess) const {
    constexpr float kMost = 0.25f; // of the light
    const Chart& c = s_.charts[chart];
    const auto w = static_cast<int>(c.width), h = static_cast<int>(c.height);
    const auto baked = [&](int x, int y) { return x >= 0 && y >= 0 && x < w && y < h && light_.valid[c.first_texel + static_cast<std::uint32_t>(y * w + x)] == 1; };
    noise.assign(std::size_t{c.width} * c.height, 0), guess.assign(3 * noise.size(), 0);
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x) {
            const auto t = static_cast<std::size_t>(y * w + x);
            if (baked(x, y)) {
                noise[t] = light_.texel_error[c.first_texel + t];
                continue;
            }
            float error = 0, weight = 0;
            std::array<float, 12> on{};
            for (int dy = -1; dy <= 1; ++dy)
                for (int dx = -1; dx <= 1; ++dx) {
                    if (!baked(x + dx, y + dy)) continue;
                    const float share = dx && dy ? 0.5f : 1.0f;
                    const auto next = static_cast<std::size_t>((y + dy) * w + x + dx), beyond = baked(x + 2 * dx, y + 2 * dy) ? static_cast<std::size_t>((y + 2 * dy) * w + x + 2 * dx) : next;
                    for (std::size_t k = 0; k < light.channels; ++k) on[k] += share * (2 * light.texels[next * light.channels + k] - light.texels[beyond * light.channels + k]);
                    error += share * light_.texel_error[c.first_texel + next], weight += share;
                }
            if (!(weight > 0)) continue;
            noise[t] = error / weight;
            for (std::size_t k = 0; k < light.channels; ++k) {
                float& g = guess[3 * t + k % 3];
                g = std::max(g, std::min(std::abs(on[k] / weight - light.texels[t * light.channels + k]), kMost * std::max(light_.flat[c.first_texel + t][k % 3], static_cast<float>(floor_))));
            }
        }
}

void Coarsening::allow(ChartLight& out, std::size_t chart) const {
    constexpr double kSpreads = 4; // of noise: one luxel in 16,000 is off by more
    const std::uint32_t vx = out.vertices_x(), vy = out.vertices_y(), first = s_.charts[chart].first_texel;
    const std::size_t size = std::size_t{vx} * vy * 3;
    out.allowed.assign(size, 0), out.noise.assign(size, 0), out.guess.assign(size, 0), out.scale.assign(size, 0);
    const std::vector<std::uint8_t> seam = along_seams(out, chart);
    std::vector<float> noise, guess;
    doubt(out, chart, noise, guess);
    const auto floor = static_cast<float>(floor_);
    for (std::uint32_t j = 0; j < vy; ++j)
        for (std::uint32_t i = 0; i < vx; ++i) {
            const Bilinear b = bilinear_at(s_.charts[chart], {0.5 * i, 0.5 * j});
            const std::size_t v = std::size_t{j} * vx + i;
            for (std::size_t c = 0; c < 3; ++c) {
                double flat = 0, spread = 0, apart = 0;
                for (std::size_t k = 0; k < 4; ++k) {
                    const double e = light_.flat[b.texel[k]][c];
                    flat += b.weight[k] * e, spread += b.weight[k] * std::min(e * noise[b.texel[k] - first], 2 * share_ * std::max(e, floor_)), apart += b.weight[k] * guess[3 * (b.texel[k] - first) + c];
                }
                out.scale[3 * v + c] = static_cast<float>(flat);
                if (!seam[v]) out.noise[3 * v + c] = static_cast<float>(kSpreads * spread), out.guess[3 * v + c] = static_cast<float>(apart);
            }
        }
    // Within a quad that gets darker than the floor the floor decides: so the bound holds between its corners too.
    std::vector<std::uint8_t> dark(size);
    for (std::uint32_t y = 0; y + 1 < vy; ++y)
        for (std::uint32_t x = 0; x + 1 < vx; ++x) {
            if (!out.covered[std::size_t{y} * (vx - 1) + x]) continue;
            const std::size_t v = std::size_t{y} * vx + x;
            for (std::size_t c = 0; c < 3; ++c) {
                bool any = false;
                for (const std::size_t k : {v, v + 1, v + vx, v + vx + 1}) any |= out.scale[3 * k + c] < floor;
                if (!any) continue;
                for (const std::size_t k : {v, v + 1, v + vx, v + vx + 1}) dark[3 * k + c] = 1;
            }
        }
    for (std::size_t k = 0; k < size; ++k) {
        const float least = dark[k] ? floor : std::max(out.scale[k], floor);
        out.allowed[k] = static_cast<float>(seam[k / 3] ? std::min(share_, kSeamPercent / 100) : share_) * least;
        out.scale[k] = std::max(out.scale[k], floor);
    }
}

ChartLight Coarsening::light_of(std::size_t chart) const {
    const Chart& c = s_.charts[chart];
    ChartLight out;
    out.width = c.width, out.height = c.height;
    const bool dot = light_.encoding == RnmEncoding::dot, tilted = light_.encoding == RnmEncoding::tilted;
    out.channels = !directional(chart) ? 3 : tilted ? 12 : 9;
    out.shown_by = directional(chart) && (dot || tilted) ? ShownBy::length : ShownBy::each;
    out.signed_values = directional(chart) && dot;
    const std::size_t texels = std::size_t{c.width} * c.height;
    out.texels.resize(texels * out.channels);
    for (std::size_t t = 0; t < texels; ++t) {
        float* to = &out.texels[t * out.channels];
        if (directional(chart))
            for (const Rgb& v : light_.rnm[light_.rnm_first[chart] + t])
                for (std::size_t k = 0; k < 3; ++k) *to++ = v[k];
        if (out.channels != 9)
            for (std::size_t k = 0; k < 3; ++k) *to++ = light_.flat[c.first_texel + t][k];
    }
    fill(out, c);
    cover(out, chart);
    allow(out, chart);
    return out;
}

// What is known of a grid's texels: of the luxels that each stands for, by the share that it has in showing them.
void Coarsening::note_quality(const ChartFit& fit, std::size_t chart, Made& out) const {
    const Chart& c = s_.charts[chart];
    const std::size_t n = std::size_t{fit.width} * fit.height;
    std::vector<double> error(n), known(n), baked(n);
    for (std::uint32_t l = first_luxel_[chart]; l < first_luxel_[chart + 1]; ++l) {
        const Luxel& luxel = s_.luxels[l];
        const std::uint32_t texel = c.texel(luxel.x, luxel.y);
        const Bilinear b = bilinear_at(fit.width, fit.height, {(luxel.x + 0.5) * fit.scale.x + fit.shift.x, (luxel.y + 0.5) * fit.scale.y + fit.shift.y});
        for (std::size_t k = 0; k < 4; ++k) {
            const double share = b.weight[k] * luxel.area;
            if (light_.valid[texel] == 1) baked[b.texel[k]] += share;
            if (light_.texel_error[texel] > 0) error[b.texel[k]] += share * light_.texel_error[texel], known[b.texel[k]] += share;
        }
    }
    for (std::size_t t = 0; t < n; ++t) {
        out.valid.push_back(baked[t] > 0 ? 1 : 2);
        out.error.push_back(known[t] > 0 ? static_cast<float>(error[t] / known[t]) : 0.0f);
    }
}

Coarsening::Made Coarsening::make(std::size_t chart) const {
    Made out;
    const Chart& c = s_.charts[chart];
    const ChartLight light = light_of(chart);
    std::optional<ChartFit> fit;
    if (light.from.x < light.to.x) fit = coarsest_fit(light);
    if (!fit) { // as it came
        const std::size_t n = std::size_t{c.width} * c.height;
        out.grid.width = c.width, out.grid.height = c.height;
        const auto copy = [&](const auto& from, std::size_t first, auto& to) { to.assign(from.begin() + static_cast<std::ptrdiff_t>(first), from.begin() + static_cast<std::ptrdiff_t>(first + n)); };
        copy(light_.flat, c.first_texel, out.flat), copy(light_.valid, c.first_texel, out.valid), copy(light_.texel_error, c.first_texel, out.error);
        if (directional(chart)) copy(light_.rnm, light_.rnm_first[chart], out.rnm);
        out.weight = static_cast<double>(std::ranges::count(light.covered, 1)) * 12;
        return out;
    }
    out.grid = {fit->scale, fit->shift, fit->width, fit->height, 0, UINT32_MAX};
    const std::size_t n = std::size_t{fit->width} * fit->height;
    for (std::size_t t = 0; t < n; ++t) {
        const float* from = &fit->texels[t * light.channels];
        const auto colour = [&](std::size_t k) { return Rgb{from[3 * k], from[3 * k + 1], from[3 * k + 2]}; };
        if (directional(chart)) out.rnm.push_back({colour(0), colour(1), colour(2)});
        if (light.channels != 9) {
            out.flat.push_back(colour(light.channels / 3 - 1));
        } else {
            const Rgb sum = colour(0) + colour(1) + colour(2);
            const float share = light_.encoding == RnmEncoding::sq ? 1.0f / 3 : 0.577350269189626f;
            out.flat.push_back({std::max(0.0f, sum.x * share), std::max(0.0f, sum.y * share), std::max(0.0f, sum.z * share)});
        }
    }
    note_quality(*fit, chart, out);
    out.square = fit->square, out.weight = fit->weight;
    return out;
}

// Of all that a chart's grid is made from.
std::uint64_t Coarsening::key(const Lighting& from, std::size_t chart) const {
    const Chart& c = s_.charts[chart];
    const std::size_t n = std::size_t{c.width} * c.height;
    ByteWriter w;
    w(chart, share_, floor_, light_.encoding, directional(chart));
    const auto texels = [&](const auto& of, std::size_t first) { w.raw(&of[first], n * sizeof of[first]); };
    texels(from.flat, c.first_texel), texels(from.valid, c.first_texel), texels(from.texel_error, c.first_texel);
    if (directional(chart)) texels(from.rnm, from.rnm_first[chart]);
    if (!from.patch_index.empty()) texels(from.patch_index, c.first_texel);
    for (std::uint32_t l = first_luxel_[chart]; l < first_luxel_[chart + 1] && !from.piece_patch.empty(); ++l)
        if (const Luxel& luxel = s_.luxels[l]; luxel.piece_count > 1) w.raw(&from.piece_patch[luxel.first_piece], luxel.piece_count * sizeof(std::uint32_t));
    return hash_bytes(w.bytes).low;
}

Density Coarsening::run(Context& context, Memo* memo, const Lighting& from, const Fit& fit) const {
    std::vector<Made> made(s_.charts.size());
    parallel_for(context, "density", made.size(), [&](std::size_t chart) {
        const std::uint64_t of = memo ? key(from, chart) : 0;
        if (const auto kept = memo ? memo->find(of, {}) : std::nullopt) {
            made[chart] = from_bytes<Made>(*kept);
            return;
        }
        fit(chart);
        made[chart] = make(chart);
        if (memo) memo->keep(of, {}, {}, to_bytes(made[chart]));
    });
    Density out;
    double square = 0, weight = 0;
    for (std::size_t c = 0; c < made.size(); ++c) {
        Made& m = made[c];
        m.grid.first_texel = static_cast<std::uint32_t>(out.flat.size());
        if (directional(c)) m.grid.first_rnm = static_cast<std::uint32_t>(out.rnm.size());
        out.grids.push_back(m.grid);
        out.flat.insert(out.flat.end(), m.flat.begin(), m.flat.end()), out.valid.insert(out.valid.end(), m.valid.begin(), m.valid.end());
        out.texel_error.insert(out.texel_error.end(), m.error.begin(), m.error.end()), out.rnm.insert(out.rnm.end(), m.rnm.begin(), m.rnm.end());
        const double luxel = s_.charts[c].luxel_size * s_.charts[c].luxel_size;
        square += m.square * luxel, weight += m.weight * luxel;
        m = {};
    }
    out.mean_change = weight > 0 ? 100 * std::sqrt(square / weight) : 0;
    return out;
}

// `shown`: of `from`, chart by chart as fit() makes it.
Result<Density> coarsened(const Surfaces& surfaces, const Lighting& shown, const Lighting& from, const DensityOptions& options, Context& context, Memo* memo, const std::function<void(std::size_t)>& fit) {
    try {
        if (memo) memo->begin();
        Density out = Coarsening(surfaces, shown, options).run(context, memo, from, fit);
        if (memo) memo->end();
        return out;
    } catch (const Cancelled&) {
        return fault(Exit::cancelled, "cancelled", "stopped while choosing luxels");
    }
}

} // namespace

Result<Density> coarsen(const Surfaces& surfaces, const Lighting& lighting, const DensityOptions& options, Context& context, Memo* memo) {
    if (!(options.error_percent > 0)) return Density{};
    return coarsened(surfaces, lighting, lighting, options, context, memo, [](std::size_t) {});
}

Result<Density> level_texels(const Surfaces& surfaces, const Lighting& lighting, const DensityOptions& options, Context& context, Memo* memo) {
    if (!(options.error_percent > 0)) return Density{};
    Lighting shown = ShownFit::begun(lighting);
    std::optional<ShownFit> fitting; // where some chart is not known
    std::once_flag once;
    return coarsened(surfaces, shown, lighting, options, context, memo, [&](std::size_t chart) {
        std::call_once(once, [&] { fitting.emplace(surfaces, lighting); });
        fitting->fit(chart, shown);
    });
}

void validate(const Density& d, const Surfaces& s, const Lighting& light) {
    if (d.grids.empty()) return;
    KILN_CHECK_OP(d.grids.size(), ==, s.charts.size());
    KILN_CHECK_OP(d.valid.size(), ==, d.flat.size());
    KILN_CHECK_OP(d.texel_error.size(), ==, d.flat.size());
    std::size_t texels = 0, rnm = 0;
    for (std::size_t c = 0; c < d.grids.size(); ++c) {
        const ChartGrid& g = d.grids[c];
        const std::size_t n = std::size_t{g.width} * g.height;
        KILN_CHECK(n > 0 && g.scale.x > 0 && g.scale.y > 0);
        KILN_CHECK_OP(n, <=, std::size_t{s.charts[c].width} * s.charts[c].height);
        KILN_CHECK_OP(g.first_texel, ==, texels);
        texels += n;
        KILN_CHECK_OP(g.first_rnm != UINT32_MAX, ==, light.rnm_first[c] != UINT32_MAX);
        if (g.first_rnm == UINT32_MAX) continue;
        KILN_CHECK_OP(g.first_rnm, ==, rnm);
        rnm += n;
    }
    KILN_CHECK_OP(texels, ==, d.flat.size());
    KILN_CHECK_OP(rnm, ==, d.rnm.size());
    for (const Rgb& e : d.flat)
        for (std::size_t c = 0; c < 3; ++c) KILN_CHECK(std::isfinite(e[c]) && e[c] >= 0);
    for (const auto& v : d.rnm)
        for (const Rgb& e : v)
            for (std::size_t c = 0; c < 3; ++c) KILN_CHECK(std::isfinite(e[c]));
}

} // namespace kiln

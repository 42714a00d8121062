#include "compiler/light/shown.h"
#include "compiler/light/kernels.h"
#include "compiler/light/patches.h"
#include "compiler/light/seams.h"
#include "libs/parallel/parallel.h"

namespace kiln {
namespace {

constexpr double kWhole = 0.99; // of a luxel: a footprint that is all of its square
constexpr double kMostAtRims = 0.5;
constexpr double kFlattened = 0.125; // of a second difference, by the mean over a luxel of what is bilinear

using Values = std::array<Rgbd, 4>; // flat, and the three of directional light

} // namespace

class ShownFit::Fitting {
public:
    Fitting(const Surfaces& s, const Lighting& light) : s_(s), light_(light), index_(s), seams_(seam_lines(s)) {
        const std::vector<std::uint32_t> patch = patches_of_luxels(s, light.piece_patch);
        beside_ = luxels_beside(s, piece_adjacency(s), light.piece_patch, patch);
    }

    void fit(std::size_t chart, Lighting& out) const {
        const Chart& c = s_.charts[chart];
        const std::vector<std::uint8_t> fixed = read_by_seams(chart);
        for (std::uint32_t y = 0; y < c.height; ++y)
            for (std::uint32_t x = 0; x < c.width; ++x) {
                const std::uint32_t texel = c.texel(x, y);
                if (fixed[y * c.width + x] || !light_.valid[texel]) continue;
                const bool luxel = index_.luxel_of(texel) != UINT32_MAX;
                if (luxel != (light_.valid[texel] == 1)) continue; // a luxel in a door or a solid, filled: its own pieces read it
                // A luxel that lies in part on its face is the mean of that part, but is shown at the middle of its square.
                std::optional<Values> v;
                if (!luxel) v = beyond_rim(chart, x, y);
                else if (whole(texel)) v = curved(chart, texel);
                else if (goes_on_all_around(chart, texel)) v = straight_on(chart, texel, {x + 0.5, y + 0.5});
                if (!v) continue;
                out.flat[texel] = static_cast<Rgb>((*v)[0]);
                if (!directional(chart)) continue;
                for (std::size_t k = 0; k < 3; ++k) out.rnm[light_.rnm_first[chart] + (texel - c.first_texel)][k] = static_cast<Rgb>((*v)[k + 1]);
            }
    }

private:
    const Surfaces& s_;
    const Lighting& light_;
    LuxelIndex index_;
    std::vector<std::uint8_t> beside_;    // per luxel
    std::vector<std::vector<SeamLine>> seams_;

    bool directional(std::size_t chart) const { return light_.rnm_first[chart] != UINT32_MAX; }
    Values values(std::size_t chart, std::uint32_t texel) const {
        Values v{static_cast<Rgbd>(light_.flat[texel])};
        for (std::size_t k = 0; directional(chart) && k < 3; ++k) v[k + 1] = static_cast<Rgbd>(light_.rnm[light_.rnm_first[chart] + (texel - s_.charts[chart].first_texel)][k]);
        return v;
    }
    static std::uint32_t step(const Chart& c, std::uint32_t texel, std::size_t side) {
        return static_cast<std::uint32_t>(static_cast<std::int64_t>(texel) + kBeside[side][0] + kBeside[side][1] * static_cast<std::int64_t>(c.width));
    }
    bool whole(std::uint32_t texel) const { return s_.luxels[index_.luxel_of(texel)].area > kWhole; }
    // The baked luxel beside a texel that goes on from it.
    std::optional<std::uint32_t> next(const Chart& c, std::uint32_t texel, std::size_t side) const {
        if (index_.luxel_of(texel) == UINT32_MAX || !(beside_[index_.luxel_of(texel)] >> side & 1)) return std::nullopt;
        const std::uint32_t to = step(c, texel, side);
        return light_.valid[to] == 1 && index_.luxel_of(to) != UINT32_MAX ? std::optional(to) : std::nullopt;
    }

    // What a value's noise and limits go by: coefficients of `dot` and `sq` may be near 0 in bright light.
    double scale(const Values& v, std::size_t k, std::size_t c) const { return light_.encoding == RnmEncoding::tilted ? std::abs(v[k][c]) : v[0][c]; }

    std::vector<std::uint8_t> read_by_seams(std::size_t chart) const {
        const Chart& c = s_.charts[chart];
        std::vector<std::uint8_t> out(std::size_t{c.width} * c.height);
        for (const SeamLine& line : seams_[chart])
            walk(line, [&](Vec2 at) {
                for (const std::uint32_t t : bilinear_at(c, at).texel) out[t - c.first_texel] = 1;
            });
        return out;
    }

    // v + change, as far as `most(k, colour)` lets each value go down and up. `gain`: variance of the change over that of a luxel. Only what is more than noise does as a rule
    // counts: bends are followed, noise is hardly made larger.
    template <class Most> Values held(std::uint32_t texel, const Values& v, const Values& change, double gain, bool leaning, const Most& most) const {
        Values out = v;
        const double error = std::sqrt(gain) * static_cast<double>(light_.texel_error[texel]);
        for (std::size_t k = 0; k < (leaning ? 4 : 1); ++k)
            for (std::size_t c = 0; c < 3; ++c) {
                const double noise = error * scale(v, k, c), by = change[k][c] - std::clamp(change[k][c], -noise, noise);
                const std::array<double, 2> room = most(k, c);
                out[k][c] += std::clamp(by, -room[0], room[1]);
            }
        if (leaning) {
            std::array<Rgbd, 3> rnm{out[1], out[2], out[3]};
            follow_flat(light_.encoding, out[0], rnm);
            std::ranges::copy(rnm, out.begin() + 1);
        }
        return out;
    }

    // In the midst of others: what filtering flattens of the bend of the light, an eighth of it along each axis.
    std::optional<Values> curved(std::size_t chart, std::uint32_t texel) const {
        const Chart& c = s_.charts[chart];
        const std::size_t count = directional(chart) ? 4 : 1;
        const Values v = values(chart, texel);
        Values change{}, low = v, high = v;
        double own = 0, others = 0; // weights, and squares of weights
        for (std::size_t axis = 0; axis < 2; ++axis) {
            const auto a = next(c, texel, 2 * axis), b = next(c, texel, 2 * axis + 1);
            const bool both = a && b && whole(*a) && whole(*b); // the middle of what lies in part on its face is not one luxel away
            if (both) own += 2 * kFlattened, others += 2 * kFlattened * kFlattened;
            for (const auto& t : {a, b}) {
                if (!t) continue;
                const Values w = values(chart, *t);
                for (std::size_t k = 0; k < count; ++k) {
                    if (both) change[k] += (v[k] - w[k]) * kFlattened;
                    for (std::size_t q = 0; q < 3; ++q) low[k][q] = std::min(low[k][q], w[k][q]), high[k][q] = std::max(high[k][q], w[k][q]);
                }
            }
        }
        return held(texel, v, change, own * own + others, directional(chart), [&](std::size_t k, std::size_t q) { return std::array{v[k][q] - low[k][q], high[k][q] - v[k][q]}; });
    }

    // Do all baked luxels around it go on from it? What does not may lie behind a wall, and is shown this texel as well.
    bool goes_on_all_around(std::size_t chart, std::uint32_t texel) const {
        const Chart& c = s_.charts[chart];
        const auto x = static_cast<std::int64_t>((texel - c.first_texel) % c.width), y = static_cast<std::int64_t>((texel - c.first_texel) / c.width);
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx) {
                const std::int64_t u = x + dx, v = y + dy;
                if ((!dx && !dy) || u < 0 || v < 0 || u >= c.width || v >= c.height) continue;
                const auto at = static_cast<std::uint32_t>(c.texel(u, v));
                if (light_.valid[at] != 1) continue;
                bool reached = false;
                for (std::size_t k = 0; k < kBeside.size() && !reached; ++k) {
                    const auto first = next(c, texel, k);
                    reached = first && *first == at;
                    for (std::size_t q = 0; first && q < kBeside.size() && !reached; ++q) reached = next(c, *first, q) == at;
                }
                if (!reached) return false;
            }
        return true;
    }

    // From the middle of what a luxel lies on to a place about a luxel away, straight on from the luxels inwards of it along both axes.
    std::optional<Values> straight_on(std::size_t chart, std::uint32_t texel, Vec2 to) const {
        constexpr double kOff = 0.02, kApart = 0.3; // luxels: what is nearer makes no difference, and tells of no slope
        const auto cut = [&](std::uint32_t t) { return light_.patch_index[t] == kMixedPatch; }; // by something that stands there
        if (cut(texel)) return std::nullopt;
        const Chart& c = s_.charts[chart];
        const Vec2 middle = centroid_of(s_, s_.luxels[index_.luxel_of(texel)]);
        const Values v = values(chart, texel);
        // Along each axis a luxel inwards; the way there is put together from the ways from these.
        const Vec2 off = to - middle;
        std::array<std::optional<std::uint32_t>, 2> inwards;
        std::array<Vec2, 2> way;
        for (std::size_t axis = 0; axis < 2; ++axis) {
            const double along = axis ? off.y : off.x;
            if (std::abs(along) < kOff) continue;
            const auto t = next(c, texel, 2 * axis + (along > 0 ? 1 : 0));
            if (!t || cut(*t)) continue;
            const Vec2 from = middle - centroid_of(s_, s_.luxels[index_.luxel_of(*t)]);
            if (std::abs(axis ? from.y : from.x) < kApart) continue;
            inwards[axis] = t, way[axis] = from;
        }
        std::array<double, 2> share{inwards[0] ? off.x / way[0].x : 0, inwards[1] ? off.y / way[1].y : 0};
        if (inwards[0] && inwards[1]) {
            const double det = cross(way[0], way[1]);
            if (std::abs(det) < kApart * kApart) return std::nullopt;
            share = {cross(off, way[1]) / det, cross(way[0], off) / det};
        }
        Values change{};
        double own = 0, others = 0;
        for (std::size_t axis = 0; axis < 2; ++axis) {
            if (!inwards[axis]) continue;
            const Values w = values(chart, *inwards[axis]);
            own += share[axis], others += share[axis] * share[axis];
            for (std::size_t k = 0; k < 4; ++k) change[k] += (v[k] - w[k]) * share[axis];
        }
        return held(texel, v, change, own * own + others, directional(chart), [&](std::size_t k, std::size_t q) {
            const double most = kMostAtRims * scale(v, k, q);
            return std::array{most, most};
        });
    }

    // A texel of no face, beside one luxel alone: straight on from that.
    std::optional<Values> beyond_rim(std::size_t chart, std::uint32_t x, std::uint32_t y) const {
        const Chart& c = s_.charts[chart];
        const auto baked = [&](int dx, int dy) {
            const std::int64_t u = std::int64_t{x} + dx, v = std::int64_t{y} + dy;
            return u >= 0 && v >= 0 && u < c.width && v < c.height && light_.valid[c.texel(static_cast<std::uint32_t>(u), static_cast<std::uint32_t>(v))] == 1;
        };
        std::optional<std::size_t> side;
        for (std::size_t k = 0; k < kBeside.size(); ++k) {
            if (!baked(kBeside[k][0], kBeside[k][1])) continue;
            if (side) return std::nullopt;
            side = k;
        }
        if (!side) return std::nullopt;
        const std::uint32_t texel = c.texel(x, y), rim = step(c, texel, *side);
        // Faces across its corners read it as well: only where they go on from that luxel.
        for (int dy = -1; dy <= 1; dy += 2)
            for (int dx = -1; dx <= 1; dx += 2) {
                if (!baked(dx, dy)) continue;
                const std::array<int, 2> to{dx - kBeside[*side][0], dy - kBeside[*side][1]};
                const auto along = std::ranges::find(kBeside, to);
                if (along == kBeside.end() || !next(c, rim, static_cast<std::size_t>(along - kBeside.begin()))) return std::nullopt;
            }
        return straight_on(chart, rim, {x + 0.5, y + 0.5});
    }
};

ShownFit::ShownFit(const Surfaces& surfaces, const Lighting& lighting) : fitting_(std::make_unique<const Fitting>(surfaces, lighting)) {}
ShownFit::~ShownFit() = default;

Lighting ShownFit::begun(const Lighting& lighting) {
    Lighting out;
    out.encoding = lighting.encoding;
    out.flat = lighting.flat, out.valid = lighting.valid, out.texel_error = lighting.texel_error;
    out.chart_directional = lighting.chart_directional, out.rnm_first = lighting.rnm_first, out.rnm = lighting.rnm;
    return out;
}

void ShownFit::fit(std::size_t chart, Lighting& out) const {
    fitting_->fit(chart, out);
}

Result<Lighting> fit_shown(const Surfaces& surfaces, const Lighting& lighting, Context& context) {
    try {
        Lighting out = ShownFit::begun(lighting);
        const ShownFit fitting(surfaces, lighting);
        parallel_for(context, surfaces.charts.size(), [&](std::size_t chart) { fitting.fit(chart, out); });
        return out;
    } catch (const Cancelled&) {
        return fault(Exit::cancelled, "cancelled", "stopped while fitting luxels");
    }
}

} // namespace kiln

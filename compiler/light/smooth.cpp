// What neighbouring luxels tell of each other's gathered light.
//
// In       of each luxel what its rays gathered, and how noisy that is
// Out      the same, what stands out of its neighbours by noise spread over these, drawn towards the plane through them, as far as they lie on one but for their noise
// Source   C. Stein, "Inadmissibility of the usual estimator for the mean of a multivariate normal distribution", 1956; B. Efron and C. Morris,
//          "Limiting the risk of Bayes and empirical Bayes estimators", J. American Statistical Association 67 (1972): NOTES.md
#include "compiler/light/bake.h"
#include "libs/parallel/parallel.h"

namespace kiln {
namespace {

constexpr int kReach = 3;          // luxels; windows of 3, 5 and 7 are tried
constexpr int kSpikeReach = 2;     // luxels around one that tell a spike, and that it is spread over
constexpr int kSpikesRead = kReach + 1 + kSpikeReach; // of what is in a window, the mean of noise beside it; of either, spikes that reach it, and of those, others beside
constexpr int kReads = kSpikesRead + kSpikeReach;     // and what tells them
constexpr std::uint32_t kBlock = 4;                       // texels: a memo's keys go by blocks of so many a side
constexpr int kSide = 2 * kReach + 1;
constexpr double kFarthest = 3; // standard deviations of the noise that a luxel is moved at most
static_assert(kSpikeReach <= kReach);
constexpr std::size_t kCells = kSide * kSide;
constexpr std::size_t cell(int dx, int dy) {
    return static_cast<std::size_t>((dy + kReach) * kSide + dx + kReach);
}
constexpr double falls_off(int dx, int dy, int reach) { // the weight of a luxel in a window
    if (dx < -reach || dx > reach || dy < -reach || dy > reach) return 0;
    return std::max(0.0, 1 - (dx * dx + dy * dy) / ((reach + 1.0) * (reach + 1.0)));
}
struct Step { // from the luxel in the middle of a window
    int x = 0, y = 0;
};
// Of what can be gone over from one luxel to the next: open(step) has a bit for each of kBeside that goes on from there. The order in which it is come to; returns how much.
template <class Open> constexpr std::size_t flood(int reach, const Open& open, std::array<Step, kCells>& out) {
    std::array<bool, kCells> there{};
    there[cell(0, 0)] = true, out[0] = {};
    std::size_t count = 1;
    for (std::size_t i = 0; i < count; ++i) {
        const unsigned on = open(out[i]);
        for (std::size_t s = 0; s < kBeside.size(); ++s) {
            const Step to{out[i].x + kBeside[s][0], out[i].y + kBeside[s][1]};
            if (!(on >> s & 1) || to.x < -reach || to.x > reach || to.y < -reach || to.y > reach || there[cell(to.x, to.y)]) continue;
            there[cell(to.x, to.y)] = true, out[count++] = to;
        }
    }
    return count;
}
// Most windows are whole.
struct Whole {
    std::array<Step, kCells> step{};
    std::array<unsigned, kCells> on{}; // what must go on from each for that
    std::size_t count = 0;
    explicit constexpr Whole(int reach) : count(flood(reach, [](Step) { return 15u; }, step)) {
        for (std::size_t i = 0; i < count; ++i)
            for (std::size_t s = 0; s < kBeside.size(); ++s)
                if (const int x = step[i].x + kBeside[s][0], y = step[i].y + kBeside[s][1]; x >= -reach && x <= reach && y >= -reach && y <= reach) on[i] |= 1u << s;
    }
};
constexpr std::array<Whole, kReach + 1> kWhole{Whole(0), Whole(1), Whole(2), Whole(3)};

// A plane over a window, fitted by weighted least squares, two numbers at a time.
using Pair = double __attribute__((vector_size(16)));
using Products = std::array<Pair, 3>; // of x and y: 1, x, y, xx, xy, yy
constexpr Products products(Step at) {
    const double x = at.x, y = at.y;
    return {Pair{1, x}, Pair{y, x * x}, Pair{x * y, y * y}};
}
std::array<double, 6> apart(const Products& p) {
    return {p[0][0], p[0][1], p[1][0], p[1][1], p[2][0], p[2][1]};
}
struct Cell {
    Products products;
    std::array<double, kReach + 1> weight; // in a window of that reach
};
constexpr std::array<Cell, kCells> kCellTable = [] {
    std::array<Cell, kCells> out{};
    for (int y = -kReach; y <= kReach; ++y)
        for (int x = -kReach; x <= kReach; ++x) {
            Cell& c = out[cell(x, y)];
            c.products = products({x, y});
            for (int r = 0; r <= kReach; ++r) c.weight[static_cast<std::size_t>(r)] = falls_off(x, y, r);
        }
    return out;
}();
// The luxels of a window that tell a plane over a reach, their weights k, and sums of k and of k^2 times products of their places.
struct Weights {
    std::size_t count;
    std::array<std::uint8_t, kCells> at; // in the window
    std::array<double, kCells> k;
    Products m, m2;
    void fill(int reach, std::span<const Step> window) {
        count = 0, m = {}, m2 = {};
        for (std::size_t i = 0; i < window.size(); ++i) {
            const Cell& c = kCellTable[cell(window[i].x, window[i].y)];
            const double weight = c.weight[static_cast<std::size_t>(reach)];
            if (!(weight > 0)) continue;
            for (std::size_t j = 0; j < 3; ++j) m[j] += weight * c.products[j], m2[j] += weight * weight * c.products[j];
            at[count] = static_cast<std::uint8_t>(i), k[count++] = weight;
        }
    }
    static const std::array<Weights, kReach + 1>& whole() {
        static const std::array<Weights, kReach + 1> all = [] {
            std::array<Weights, kReach + 1> out;
            for (int r = 0; r <= kReach; ++r) out[static_cast<std::size_t>(r)].fill(r, std::span(kWhole[kReach].step).first(kWhole[kReach].count));
            return out;
        }();
        return all;
    }
};
// Sums of weights times values, times x, times y; of their squares times the noise times products of places.
template <std::size_t kPairs> struct Fit {
    Products noisy{};
    std::array<std::array<Pair, kPairs>, 3> b{};
    std::array<Pair, kPairs> square{};
    double noise = 0;
    void add(double k, Step at, const std::array<Pair, kPairs>& v, double variance) {
        const Products& p = kCellTable[cell(at.x, at.y)].products;
        const double x = p[0][1], y = p[1][0];
        for (std::size_t i = 0; i < 3; ++i) noisy[i] += k * k * variance * p[i];
        for (std::size_t j = 0; j < kPairs; ++j) {
            const Pair kv = k * v[j];
            b[0][j] += kv, b[1][j] += kv * x, b[2][j] += kv * y, square[j] += kv * v[j];
        }
        noise += k * variance;
    }
};
double form(const std::array<double, 6>& m, const std::array<double, 3>& a, const std::array<double, 3>& b) { // a' M b
    return a[0] * (m[0] * b[0] + m[1] * b[1] + m[2] * b[2]) + a[1] * (m[1] * b[0] + m[3] * b[1] + m[4] * b[2]) + a[2] * (m[2] * b[0] + m[4] * b[1] + m[5] * b[2]);
}
// False: all in a row.
bool inverse(const std::array<double, 6>& m, std::array<double, 6>& out) {
    const double c00 = m[3] * m[5] - m[4] * m[4], c01 = m[2] * m[4] - m[1] * m[5], c02 = m[1] * m[4] - m[2] * m[3];
    const double det = m[0] * c00 + m[1] * c01 + m[2] * c02;
    if (!(det > 1e-9 * m[0] * m[3] * m[5])) return false;
    out = {c00 / det, c01 / det, c02 / det, (m[0] * m[5] - m[2] * m[2]) / det, (m[1] * m[2] - m[0] * m[4]) / det, (m[0] * m[3] - m[1] * m[1]) / det};
    return true;
}

// The luxels around one.
class Neighbourhood {
public:
    // left_to_rays: per patch. Of the luxels in `read` alone it is told what lies beside them.
    Neighbourhood(const Surfaces& surfaces, const std::vector<std::uint32_t>& patch, const std::vector<std::uint8_t>& beside, const std::vector<std::uint8_t>& gathered,
                  const std::vector<std::uint64_t>& left_to_rays, const std::vector<std::uint8_t>& read)
        : surfaces_(surfaces), at_texel_(surfaces.texel_count, UINT32_MAX), on_(surfaces.texel_count) {
        for (std::uint32_t l = 0; l < surfaces.luxels.size(); ++l)
            if (gathered[l]) at_texel_[texel_of(surfaces, surfaces.luxels[l])] = l;
        for (std::uint32_t l = 0; l < surfaces.luxels.size(); ++l)
            for (std::size_t s = 0; read[l] && gathered[l] && s < kBeside.size(); ++s)
                if (const std::uint32_t q = beside[l] >> s & 1 ? near(l, kBeside[s][0], kBeside[s][1]) : UINT32_MAX; q != UINT32_MAX && left_to_rays[patch[q]] == left_to_rays[patch[l]])
                    on_[texel_of(surfaces, surfaces.luxels[l])] |= static_cast<std::uint8_t>(1u << s);
    }
    // The luxel that many luxels away; UINT32_MAX where none is.
    std::uint32_t near(std::uint32_t l, int dx, int dy) const {
        const Chart& chart = surfaces_.charts[surfaces_.luxels[l].chart.at()];
        const int x = surfaces_.luxels[l].x + dx, y = surfaces_.luxels[l].y + dy;
        if (x < 0 || y < 0 || x >= static_cast<int>(chart.width) || y >= static_cast<int>(chart.height)) return UINT32_MAX;
        return at_texel_[chart.texel(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y))];
    }
    // visit(luxel) for those beside one that the same light is left to, where no wall stands between.
    template <class Visit> void each_beside(std::uint32_t l, const Visit& visit) const {
        const std::uint8_t on = on_[texel_of(surfaces_, surfaces_.luxels[l])];
        for (std::size_t s = 0; s < kBeside.size(); ++s)
            if (on >> s & 1) visit(near(l, kBeside[s][0], kBeside[s][1]));
    }
    // What is come to so from luxel to luxel; itself first.
    struct Window {
        std::array<std::uint32_t, kCells> luxel;
        std::span<const Step> step;
        std::array<Step, kCells> own;
        bool whole = false;
    };
    void window(std::uint32_t l, int reach, Window& out) const {
        const Luxel& luxel = surfaces_.luxels[l];
        const Chart& chart = surfaces_.charts[luxel.chart.at()];
        const auto middle = static_cast<std::ptrdiff_t>(texel_of(surfaces_, luxel)), width = static_cast<std::ptrdiff_t>(chart.width);
        const auto texel = [&](Step s) { return static_cast<std::size_t>(middle + s.y * width + s.x); };
        const Whole& whole = kWhole[static_cast<std::size_t>(reach)];
        out.whole = luxel.x >= reach && luxel.y >= reach && luxel.x + reach < static_cast<int>(chart.width) && luxel.y + reach < static_cast<int>(chart.height);
        for (std::size_t i = 0; out.whole && i < whole.count; ++i) out.whole = (on_[texel(whole.step[i])] & whole.on[i]) == whole.on[i];
        out.step = out.whole ? std::span(whole.step).first(whole.count) : std::span(out.own).first(flood(reach, [&](Step s) { return on_[texel(s)]; }, out.own));
        for (std::size_t i = 0; i < out.step.size(); ++i) out.luxel[i] = at_texel_[texel(out.step[i])];
    }

private:
    const Surfaces& surfaces_;
    std::vector<std::uint32_t> at_texel_;
    std::vector<std::uint8_t> on_; // per texel, a bit for each of kBeside
};

// What luminance v of a luxel is too much, given that around it and the standard deviation that its own rays tell: a spike (a firefly), which few of its rays have brought
// from a small bright spot that those of the luxels around have missed. Those must agree, and its own rays not, by as much: a luxel that is bright in truth is so to most of its rays.
template <class V> double excess_of_spike(const Neighbourhood::Window& window, const V& v, double noise) {
    constexpr std::size_t kFewest = 8;
    constexpr double kStandsOut = 3 * 1.4826; // median absolute deviations of the others: three standard deviations, were these normal
    constexpr double kRaysApart = 3;          // standard deviations of its own rays: one that brought all is 1.35 of them, three that did so alike are 4
    const std::size_t others = window.step.size() - 1;
    if (others < kFewest) return 0;
    std::array<double, kCells> light, away;
    for (std::size_t i = 0; i < others; ++i) light[i] = v(window.luxel[i + 1]);
    const auto median = [others](std::array<double, kCells>& of) {
        const auto middle = of.begin() + static_cast<std::ptrdiff_t>(others / 2);
        std::nth_element(of.begin(), middle, of.begin() + static_cast<std::ptrdiff_t>(others));
        return *middle;
    };
    const double middle = median(light), excess = v(window.luxel[0]) - middle;
    std::size_t alike = 0;
    for (std::size_t i = 0; i < others; ++i) away[i] = std::abs(light[i] - middle), alike += static_cast<std::size_t>(light[i] > middle + excess / 2);
    return 6 * alike <= others && excess > kStandsOut * median(away) && excess < kRaysApart * noise ? excess : 0;
}

// Some of the luxels, and a value for each of them.
struct Slots {
    std::vector<std::uint32_t> of; // per luxel; UINT32_MAX: none
    std::uint32_t count = 0;
};
template <class T> class OfSome {
public:
    explicit OfSome(const Slots& slots, const T& value = {}) : slots_(slots), value_(slots.count, value) {}
    T& operator[](std::uint32_t l) { return value_[slots_.of[l]]; }
    const T& operator[](std::uint32_t l) const { return value_[slots_.of[l]]; }

private:
    const Slots& slots_;
    std::vector<T> value_;
};

// What luxels gathered, each of these spikes spread over the window around it: the power stays.
class Calmed {
public:
    Calmed(const Surfaces& surfaces, const Neighbourhood& around, const std::vector<float>& spike, std::span<const std::uint32_t> spikes, const std::vector<StoredSum>& gathered, const OfSome<double>& variance,
           const Slots& slots)
        : own_variance(variance), brought_variance(slots), gathered_(gathered), at_(slots, UINT32_MAX) {
        for (const std::uint32_t l : spikes) spread(surfaces, around, spike, variance, l);
    }
    bool touched(std::uint32_t l) const { return at_[l] != UINT32_MAX; }
    KernelSum sum(std::uint32_t l) const { return touched(l) ? spread_[at_[l]] : gathered_[l].sum(); }
    OfSome<double> own_variance, brought_variance; // summed over the normals: of its own rays, less its spike; by spikes

private:
    void spread(const Surfaces& surfaces, const Neighbourhood& around, const std::vector<float>& spike, const OfSome<double>& variance, std::uint32_t l) {
        Neighbourhood::Window window;
        around.window(l, kSpikeReach, window);
        double noise = 0, count = 0;
        for (std::size_t i = 1; i < window.step.size(); ++i)
            if (!(spike[window.luxel[i]] > 0)) noise += variance[window.luxel[i]], ++count;
        own_variance[l] = count > 0 ? noise / count : 0;
        const auto area = [&](std::uint32_t q) { return surfaces.luxels[q].area * luxel_area(surfaces, surfaces.luxels[q].face); };
        const auto weight = [&](std::size_t i) { return falls_off(window.step[i].x, window.step[i].y, kSpikeReach); };
        double all = 0;
        for (std::size_t i = 0; i < window.step.size(); ++i) all += weight(i) * area(window.luxel[i]);
        for (std::size_t i = 0; i < window.step.size(); ++i) {
            const std::uint32_t q = window.luxel[i];
            if (!touched(q)) at_[q] = static_cast<std::uint32_t>(spread_.size()), spread_.push_back(gathered_[q].sum());
            const double much = static_cast<double>(spike[l]), share = much * weight(i) * area(l) / all;
            KernelSum part = gathered_[l].sum();
            spread_[at_[q]] += part *= i == 0 ? share - much : share;
            brought_variance[q] += share * share * variance[l];
        }
    }
    const std::vector<StoredSum>& gathered_;
    OfSome<std::uint32_t> at_; // of a luxel that a spike has reached, in spread_
    std::vector<KernelSum> spread_;
};

// What spikes bring from elsewhere is no variance of the luxel's own rays: more of these would not help.
float share_left(double left, double of) {
    return of > left ? static_cast<float>(left / of) : 1;
}

constexpr float kNotAsked = -1; // of a spike: whether there is one is not known

struct Smoothed { // what a memo keeps of a luxel
    static constexpr bool kRawBytes = true;
    StoredSum sum;
    float left = 1, spread_variance = 0;
};

} // namespace

void Bake::each_gathered(const std::function<void(std::uint32_t)>& body) {
    constexpr std::size_t kPart = 256;
    const std::size_t luxels = surfaces_.luxels.size();
    parallel_for(context_, (luxels + kPart - 1) / kPart, [&](std::size_t part) {
        for (std::size_t l = part * kPart; l < std::min(luxels, (part + 1) * kPart); ++l)
            if (gathered_there_[l]) body(static_cast<std::uint32_t>(l));
    });
}

KernelSum Bake::light_of(std::uint32_t l) const {
    KernelSum sum = direct_[l];
    return sum += smoothed_[l].sum();
}

// What is handed on of each luxel.
void Bake::store_luxels() {
    each_gathered([&](std::uint32_t l) {
        const Luxel& luxel = surfaces_.luxels[l];
        const Chart& chart = surfaces_.charts[luxel.chart.at()];
        const std::uint32_t texel = texel_of(surfaces_, luxel);
        const LuxelKernel kernel = kernel_of(l);
        const KernelSum sum = light_of(l);
        out_.flat[texel] = static_cast<Rgb>(sum.flat);
        out_.valid[texel] = 1;
        const std::array<Rgbd, 4> shown = kernel.shown(sum);
        double error = 0;
        for (std::size_t j = 0; j < kernel.shown_count(); ++j)
            if (const double e = mean(shown[j]); e > 0) error = std::max(error, kQuarterSpread * std::sqrt(gathered_variance_[l][j] * static_cast<double>(left_[l]) + static_cast<double>(spread_variance_[l]) / static_cast<double>(kernel.shown_count())) / e); // at most
        out_.texel_error[texel] = static_cast<float>(error);
        if (kernel.cone) out_.rnm[out_.rnm_first[luxel.chart.at()] + (texel - chart.first_texel)] = kernel.finish(sum);
    });
}

// Luxels no further from one of these than `reach`, in their chart, along either axis.
std::vector<std::uint8_t> Bake::luxels_within(int reach, const std::function<bool(std::uint32_t)>& these) const {
    const std::vector<Luxel>& luxels = surfaces_.luxels;
    std::vector<std::uint8_t> out(luxels.size());
    std::vector<std::uint8_t> there, across;
    for (std::uint32_t first = 0, end = 0; first < luxels.size(); first = end) {
        bool any = false;
        while (end < luxels.size() && luxels[end].chart == luxels[first].chart) out[end] = these(end), any = any || out[end], ++end;
        if (!any) continue;
        const Chart& chart = surfaces_.charts[luxels[first].chart.at()];
        const int w = static_cast<int>(chart.width), h = static_cast<int>(chart.height);
        const auto at = [&](int x, int y) { return static_cast<std::size_t>(y * w + x); };
        there.assign(at(0, h), 0), across.assign(at(0, h), 0);
        for (std::size_t l = first; l < end; ++l) there[at(luxels[l].x, luxels[l].y)] |= out[l];
        for (int y = 0; y < h; ++y) { // one side after the other
            int left = 0;             // how far it goes on
            for (int x = -reach; x < w; ++x) {
                if (x + reach < w && there[at(x + reach, y)]) left = 2 * reach + 1;
                if (x >= 0 && left > 0) across[at(x, y)] = 1;
                left = std::max(0, left - 1);
            }
        }
        for (int x = 0; x < w; ++x) {
            int left = 0;
            for (int y = -reach; y < h; ++y) {
                if (y + reach < h && across[at(x, y + reach)]) left = 2 * reach + 1;
                if (y >= 0) there[at(x, y)] = left > 0;
                left = std::max(0, left - 1);
            }
        }
        for (std::size_t l = first; l < end; ++l) out[l] = there[at(luxels[l].x, luxels[l].y)];
    }
    return out;
}

namespace {

// Hashes of what the luxels of each block of texels of each chart gathered.
class Blocks {
public:
    // of(luxel), in the charts that are asked for.
    template <class Of> Blocks(const Surfaces& surfaces, const std::vector<std::uint8_t>& charts, const Of& of) : surfaces_(surfaces) {
        std::size_t count = 0;
        for (const Chart& c : surfaces.charts) first_.push_back(count), count += std::size_t{across(c)} * ((c.height + kBlock - 1) / kBlock);
        hash_.resize(count);
        for (std::uint32_t l = 0; l < surfaces.luxels.size(); ++l) {
            const Luxel& luxel = surfaces.luxels[l];
            if (!charts[luxel.chart.at()]) continue;
            std::uint64_t& hash = hash_[at(luxel.chart, luxel.x / kBlock, luxel.y / kBlock)];
            hash = chained(hash, of(l));
        }
    }
    // Of all that lie within `reach` of the luxels.
    std::uint64_t within(std::span<const std::uint32_t> luxels, int reach) const {
        const Luxel& any = surfaces_.luxels[luxels[0]];
        int x0 = any.x, x1 = x0, y0 = any.y, y1 = y0;
        for (const std::uint32_t l : luxels) {
            const Luxel& luxel = surfaces_.luxels[l];
            x0 = std::min<int>(x0, luxel.x), x1 = std::max<int>(x1, luxel.x), y0 = std::min<int>(y0, luxel.y), y1 = std::max<int>(y1, luxel.y);
        }
        const Chart& chart = surfaces_.charts[any.chart.at()];
        const auto block = [&](int texel, std::uint32_t size) { return static_cast<std::uint32_t>(std::clamp(texel, 0, static_cast<int>(size) - 1)) / kBlock; };
        std::uint64_t sum = 0;
        for (std::uint32_t y = block(y0 - reach, chart.height); y <= block(y1 + reach, chart.height); ++y)
            for (std::uint32_t x = block(x0 - reach, chart.width); x <= block(x1 + reach, chart.width); ++x) sum = chained(sum, hash_[at(any.chart, x, y)]);
        return mix(sum);
    }

private:
    static std::uint32_t across(const Chart& c) { return (c.width + kBlock - 1) / kBlock; }
    std::size_t at(ChartId chart, std::uint32_t x, std::uint32_t y) const { return first_[chart.at()] + std::size_t{y} * across(surfaces_.charts[chart.at()]) + x; }
    const Surfaces& surfaces_;
    std::vector<std::size_t> first_; // per chart
    std::vector<std::uint64_t> hash_;
};

} // namespace

void Bake::smooth() {
    const std::size_t luxels = surfaces_.luxels.size(), n = patches_.patches.size();
    // Where nothing within reach was gathered anew, all is as it was. (Lists change only where patches are done again.)
    const std::vector<std::uint8_t> stirred = luxels_within(kReads, [&](std::uint32_t l) { return luxel_patch_[l] != kNoPatch && new_[luxel_patch_[l]]; });
    new_.assign(n, 0);
    smoothed_.resize(luxels), left_.resize(luxels, 1), spike_.resize(luxels, kNotAsked), spread_variance_.resize(luxels);
    std::vector<std::uint8_t> charts(surfaces_.charts.size()); // in which something is
    for (std::size_t l = 0; l < luxels; ++l)
        if (stirred[l]) left_[l] = 1, spike_[l] = kNotAsked, charts[surfaces_.luxels[l].chart.at()] = 1;
    // What was left to the rays of a patch: light of an emitter with rays of its own is not in what they gathered.
    std::vector<std::uint64_t> left_to_rays(n);
    for (std::size_t p = 0; p < n; ++p)
        for (const LightRef& ref : lists_[p])
            if (ref.is_emitter) left_to_rays[p] = mix(left_to_rays[p], ref.light + 1);
    // What the luxels of a patch come to is a function of what those within reach gathered, and of which light was left to their rays.
    constexpr std::size_t kPart = 64;
    std::vector<std::uint64_t> keys(n);
    std::vector<std::uint8_t> asked(n); // patches whose luxels are drawn anew
    stirred_.assign(n, 0);
    {
        std::optional<Blocks> blocks;
        if (memo_)
            blocks.emplace(surfaces_, charts, [&](std::uint32_t l) {
                const std::uint32_t p = luxel_patch_[l];
                return gathered_there_[l] ? chained(gathered_hash_[p], left_to_rays[p]) : 0;
            });
        parallel_for(context_, slots_of(n, kPart), [&](std::size_t part) {
            for (auto p = static_cast<std::uint32_t>(part * kPart); p < std::min(n, (part + 1) * kPart); ++p) {
                const std::span<const std::uint32_t> all = luxels_of(p);
                if (std::ranges::none_of(all, [&](std::uint32_t l) { return stirred[l] && gathered_there_[l]; })) continue;
                stirred_[p] = 1;
                if (memo_) keys[p] = key_of(p, mix(table_.low, p, blocks->within(all, kReads)));
                const auto kept = memo_ ? memo_->smooth.find(keys[p], {}) : std::nullopt;
                if (!kept) {
                    asked[p] = 1;
                    continue;
                }
                thread_local std::vector<Smoothed> now;
                read_whole(*kept, now);
                for (std::size_t k = 0; k < all.size(); ++k)
                    if (gathered_there_[all[k]]) smoothed_[all[k]] = now[k].sum, left_[all[k]] = now[k].left, spread_variance_[all[k]] = now[k].spread_variance;
            }
        });
    }
    const auto drawn = [&](std::uint32_t l) { return luxel_patch_[l] != kNoPatch && asked[luxel_patch_[l]]; };
    if (std::ranges::none_of(asked, [](std::uint8_t a) { return a; })) return;
    const std::vector<std::uint8_t> read = luxels_within(kReads, drawn), spikes_read = luxels_within(kSpikesRead, drawn);
    const Neighbourhood around(surfaces_, luxel_patch_, beside_, gathered_there_, left_to_rays, read);
    Slots slots{std::vector<std::uint32_t>(luxels, UINT32_MAX)};
    for (std::size_t l = 0; l < luxels; ++l)
        if (read[l] && gathered_there_[l]) slots.of[l] = slots.count++;
    // Luminance of what is shown; its variance, summed over the normals, as its own rays tell it.
    OfSome<std::array<double, 4>> shown(slots);
    OfSome<double> own_variance(slots);
    each_gathered([&](std::uint32_t l) {
        if (!read[l]) return;
        const LuxelKernel kernel = kernel_of(l);
        const std::array<Rgbd, 4> all = kernel.shown(gathered_[l].sum());
        for (std::size_t j = 0; j < kernel.shown_count(); ++j) shown[l][j] = mean(all[j]), own_variance[l] += gathered_variance_[l][j];
    });
    // Spikes are no less light for standing out, but as likely that of all around: they are spread, none is lost.
    each_gathered([&](std::uint32_t l) {
        if (!spikes_read[l] || spike_[l] != kNotAsked) return;
        spike_[l] = 0;
        int darker = 0, beside = 0;
        around.each_beside(l, [&](std::uint32_t q) { ++beside, darker += shown[q][0] < shown[l][0]; });
        if (2 * darker <= beside) return; // most are not worth a closer look
        Neighbourhood::Window window;
        around.window(l, kSpikeReach, window);
        spike_[l] = static_cast<float>(excess_of_spike(window, [&](std::uint32_t q) { return shown[q][0]; }, std::sqrt(gathered_variance_[l][0])) / shown[l][0]);
    });
    std::vector<std::uint32_t> spikes;
    for (std::uint32_t l = 0; l < luxels; ++l)
        if (spikes_read[l] && gathered_there_[l] && spike_[l] > 0) spikes.push_back(l);
    const Calmed calm(surfaces_, around, spike_, spikes, gathered_, own_variance, slots);
    // Variance as the luxels around tell it, too: by its own alone a luxel that has met a bright spot would be moved far down, one that has missed it not at all up.
    OfSome<double> variance(slots), of_rays(slots); // with spikes spread; as gathered
    each_gathered([&](std::uint32_t l) {
        if (!read[l]) return;
        if (calm.touched(l)) {
            const LuxelKernel kernel = kernel_of(l);
            const std::array<Rgbd, 4> all = kernel.shown(calm.sum(l));
            for (std::size_t j = 0; j < kernel.shown_count(); ++j) shown[l][j] = mean(all[j]);
        }
        double sum = 0, rays = 0, count = 0;
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx)
                if (const std::uint32_t q = around.near(l, dx, dy); q != UINT32_MAX && read[q] && luxel_patch_[q] == luxel_patch_[l]) sum += calm.own_variance[q] + calm.brought_variance[q], rays += own_variance[q], ++count;
        variance[l] = sum / count, of_rays[l] = rays / count;
    });
    const auto draw = [&]<std::size_t kValues>(std::uint32_t l, KernelSum& light) {
        // Where nothing was met, by its rays or a spike's, light is none, not little.
        const bool dark = !(shown[l][0] > 0 || shown[l][1] > 0 || shown[l][2] > 0 || shown[l][3] > 0);
        if (dark || !(variance[l] > 0)) return;
        Neighbourhood::Window window;
        around.window(l, kReach, window);
        std::array<Weights, kReach + 1> cut; // of a window that is not whole
        for (int r = 1; !window.whole && r <= kReach; ++r) cut[static_cast<std::size_t>(r)].fill(r, window.step);
        const std::array<Weights, kReach + 1>& weights = window.whole ? Weights::whole() : cut;
        constexpr std::size_t kPairs = (kValues + 1) / 2;
        std::array<std::array<Pair, kPairs>, kCells> values; // less its own: what they have in common costs digits
        for (std::size_t i = 0; i < window.step.size(); ++i)
            for (std::size_t j = 0; j < kPairs; ++j) values[i][j] = Pair{shown[window.luxel[i]][2 * j] - shown[l][2 * j], shown[window.luxel[i]][2 * j + 1] - shown[l][2 * j + 1]};
        // Of the windows that which leaves least of the error; how far towards its plane.
        double best = variance[l], share = 0;
        std::array<double, 3> row{}; // of the inverse: what weighted places add to the plane at the luxel
        int reach = 0;
        for (int r = 1; r <= kReach; ++r) {
            const Weights& w = weights[static_cast<std::size_t>(r)];
            const std::array<double, 6> m = apart(w.m), m2 = apart(w.m2);
            std::array<double, 6> i{};
            if (!inverse(m, i)) continue;
            const double free = m[0] - (i[0] * m2[0] + i[3] * m2[3] + i[5] * m2[5] + 2 * (i[1] * m2[1] + i[2] * m2[2] + i[4] * m2[4]));
            const double own = i[0]; // share of the luxel's own value in the plane
            if (!(free > 0.5) || !(own < 0.99)) continue;
            Fit<kPairs> f;
            for (std::size_t at = 0; at < w.count; ++at) f.add(w.k[at], window.step[w.at[at]], values[w.at[at]], variance[window.luxel[w.at[at]]]);
            double residuals = 0;
            for (std::size_t j = 0; j < kValues; ++j) {
                const std::array<double, 3> b{f.b[0][j / 2][j % 2], f.b[1][j / 2][j % 2], f.b[2][j / 2][j % 2]};
                residuals += f.square[j / 2][j % 2] - form(i, b, b);
            }
            const double structure = std::max(0.0, residuals / free - f.noise / m[0]); // what of them is no noise
            const std::array<double, 3> to{i[0], i[1], i[2]};
            const double own_noise = variance[l], of_plane = form(apart(f.noisy), to, to);
            const double u = std::clamp(own_noise * (1 - own) / (own_noise * (1 - 2 * own) + of_plane + structure), 0.0, 1.0);
            const double risk = own_noise * ((1 - u) * (1 - u) + 2 * u * (1 - u) * own) + u * u * (of_plane + structure);
            if (!(risk < best)) continue;
            best = risk, share = u, reach = r, row = to;
        }
        if (!reach) return;
        KernelSum plane;
        std::array<Pair, kPairs> moved{};
        const Weights& w = weights[static_cast<std::size_t>(reach)];
        for (std::size_t at = 0; at < w.count; ++at) {
            const std::size_t i = w.at[at];
            const double a = w.k[at] * (row[0] + row[1] * window.step[i].x + row[2] * window.step[i].y);
            KernelSum part = calm.sum(window.luxel[i]);
            plane += part *= a;
            for (std::size_t j = 0; j < kPairs; ++j) moved[j] += a * values[i][j];
        }
        if (!(plane.flat[0] >= 0 && plane.flat[1] >= 0 && plane.flat[2] >= 0)) return;
        double far = 0;
        for (const Pair& by : moved) far += by[0] * by[0] + by[1] * by[1];
        if (const double most = kFarthest * std::sqrt(variance[l]), way = share * std::sqrt(far); way > most) share *= most / way;
        light *= 1 - share;
        light += plane *= share;
        left_[l] = share_left(best, of_rays[l]);
    };
    parallel_for(context_, slots_of(n, kPart), [&](std::size_t part) {
        for (auto p = static_cast<std::uint32_t>(part * kPart); p < std::min(n, (part + 1) * kPart); ++p) {
            if (!asked[p]) continue;
            const std::span<const std::uint32_t> all = luxels_of(p);
            std::vector<Smoothed> now(all.size());
            for (std::size_t k = 0; k < all.size(); ++k) {
                const std::uint32_t l = all[k];
                if (!gathered_there_[l]) continue;
                KernelSum light = calm.sum(l);
                left_[l] = share_left(variance[l], of_rays[l]);
                if (cones_[surfaces_.luxels[l].chart.at()]) draw.template operator()<4>(l, light);
                else draw.template operator()<1>(l, light);
                now[k] = {StoredSum(light), left_[l], static_cast<float>(calm.brought_variance[l])};
                smoothed_[l] = now[k].sum, spread_variance_[l] = now[k].spread_variance;
            }
            if (memo_) memo_->smooth.keep(keys[p], {}, {}, to_bytes(now));
        }
    });
}

} // namespace kiln

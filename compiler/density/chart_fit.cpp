#include "compiler/density/chart_fit.h"
#include "libs/core/check.h"
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

namespace kiln {
namespace {

constexpr double kFarOff = 2; // times what is allowed: how much more does not matter

// ---- One axis of a grid

// A grid along one axis of the chart: n texels over [from, to], the outer ones centred at its ends.
struct Axis {
    std::uint32_t n = 1;
    double scale = 1, shift = 0; // texel coordinate = luxel coordinate * scale + shift
};
Axis axis_of(std::uint32_t n, double from, double to) {
    // Of one texel all places are its middle: within what the texture units of GPUs tell apart (1/256 texel), whose filter
    // would mix in a neighbour on the page otherwise.
    constexpr double kOneTexel = 1.0 / 1024;
    const double extent = std::max(to - from, 1e-3);
    Axis a;
    a.n = n;
    a.scale = n == 1 ? kOneTexel / extent : (n - 1) / extent;
    a.shift = n == 1 ? 0.5 - a.scale * 0.5 * (from + to) : 0.5 - a.scale * from;
    return a;
}
// What a lookup at a luxel coordinate reads along one axis: texel, the next, and the weight of the next.
struct Read {
    std::uint32_t at = 0, next = 0;
    double weight = 0;
};
Read read_at(double texel, std::uint32_t size) {
    const double v = std::clamp(texel - 0.5, 0.0, size - 1.0);
    Read r;
    r.at = static_cast<std::uint32_t>(v), r.next = std::min(r.at + 1, size - 1), r.weight = v - r.at;
    return r;
}
// At each half luxel along it.
std::vector<Read> reads_at_half(std::uint32_t vertices, const Axis& a) {
    std::vector<Read> out;
    for (std::uint32_t i = 0; i < vertices; ++i) out.push_back(read_at(0.5 * i * a.scale + a.shift, a.n));
    return out;
}

// ---- The light at the half luxels

// Of all channels: bilinear between texels.
template <std::size_t kChannels, class T> void lookup(const T* texels, std::size_t width, const Read& x, const Read& y, double* out) {
    const T *p = texels + (y.at * width + x.at) * kChannels, *q = texels + (y.at * width + x.next) * kChannels,
                *r = texels + (y.next * width + x.at) * kChannels, *s = texels + (y.next * width + x.next) * kChannels;
    const double a = (1 - x.weight) * (1 - y.weight), b = x.weight * (1 - y.weight), c = (1 - x.weight) * y.weight, d = x.weight * y.weight;
    for (std::size_t k = 0; k < kChannels; ++k) out[k] = a * p[k] + b * q[k] + c * r[k] + d * s[k];
}

// The number of channels is known to the compiler: they are the innermost loop of everything.
template <std::size_t kChannels> class Fitting {
public:
    explicit Fitting(const ChartLight& light) : l_(light), vx_(light.vertices_x()), vy_(light.vertices_y()), used_(std::size_t{vx_} * vy_), shown_(std::size_t{vx_} * vy_ * kChannels) {
        KILN_CHECK(light.channels == kChannels);
        for (std::uint32_t j = 0; j < vy_ - 1; ++j)
            for (std::uint32_t i = 0; i < vx_ - 1; ++i)
                if (quad(i, j))
                    for (const std::size_t v : {vertex(i, j), vertex(i + 1, j), vertex(i, j + 1), vertex(i + 1, j + 1)}) ++used_[v];
        may_ = l_.allowed, black_.assign(used_.size(), 0);
        for (std::size_t k = 0; k < may_.size(); ++k) may_[k] += l_.noise[k] + l_.guess[k];
        std::array<double, kChannels> value{};
        for (std::uint32_t j = 0; j < vy_; ++j)
            for (std::uint32_t i = 0; i < vx_; ++i) {
                if (!used_[vertex(i, j)]) continue;
                lookup<kChannels>(l_.texels.data(), l_.width, read_at(0.5 * i, l_.width), read_at(0.5 * j, l_.height), value.data());
                bool black = true;
                for (std::size_t k = 0; k < kChannels; ++k) shown_[vertex(i, j) * kChannels + k] = static_cast<float>(value[k]), black = black && value[k] == 0;
                if (!black) continue;
                // No light comes there, and none will: least squares and a bound alone would let a little through.
                black_[vertex(i, j)] = 1;
                for (std::size_t c = 0; c < 3; ++c) may_[3 * vertex(i, j) + c] = 1e-3f * l_.allowed[3 * vertex(i, j) + c];
            }
    }
    std::optional<ChartFit> coarsest();

private:
    const ChartLight& l_;
    std::uint32_t vx_, vy_;
    std::vector<std::uint8_t> used_; // per vertex: covered quads around it
    std::vector<float> shown_;       // per used vertex and channel
    std::vector<float> may_;         // per vertex, r g b: by how much it may be off, noise included
    std::vector<std::uint8_t> black_; // per vertex: nothing is shown there

    std::size_t vertex(std::uint32_t i, std::uint32_t j) const { return std::size_t{j} * vx_ + i; }
    bool quad(std::uint32_t i, std::uint32_t j) const { return l_.covered[std::size_t{j} * (vx_ - 1) + i]; }
    bool possible(int axis, const Axis& grid) const;
    std::vector<Axis> axes(int axis) const;
    double best_possible(const Axis& x, const Axis& y) const;
    ChartFit fit(const Axis& x, const Axis& y) const;
    double worst(ChartFit& fit) const;
    double worst_of_blocks(const ChartFit& fit) const;
    double change(const double* full, const double* coarse, std::size_t colour) const;
    // By how much a colour may be off at a place of a quad, tx and ty of the way to the next vertices.
    double may_at(std::uint32_t i, std::uint32_t j, double tx, double ty, std::size_t colour) const {
        const std::uint32_t x = std::min(i + 1, vx_ - 1), y = std::min(j + 1, vy_ - 1);
        const auto may = [&](std::uint32_t a, std::uint32_t b) { return static_cast<double>(may_[3 * vertex(a, b) + colour]); };
        return (may(i, j) * (1 - tx) + may(x, j) * tx) * (1 - ty) + (may(i, y) * (1 - tx) + may(x, y) * tx) * ty;
    }
};

// Whether a grid of n texels along one axis could do, with any number along the other. Along a line between two of its centres what
// it shows is linear: of three places there the middle one may be off the line of the others by what is allowed there and no more.
template <std::size_t kChannels> bool Fitting<kChannels>::possible(int axis, const Axis& a) const {
    const std::uint32_t count = axis ? vy_ : vx_, rows = axis ? vx_ : vy_, n = a.n;
    std::vector<std::int64_t> cell(count); // of each vertex: the first and the last cell are drawn out
    std::vector<std::uint8_t> on_line(count); // it also ends the cell before
    for (std::uint32_t i = 0; i < count; ++i) {
        const double at = 0.5 * i * a.scale + a.shift - 0.5;
        cell[i] = n == 1 ? 0 : std::clamp<std::int64_t>(static_cast<std::int64_t>(std::floor(at + 1e-9)), 0, n - 2);
        on_line[i] = n > 1 && std::abs(at - std::round(at)) < 1e-9 && at > 0.5;
    }
    const auto at = [&](std::uint32_t i, std::uint32_t row) { return axis ? vertex(row, i) : vertex(i, row); };
    const auto joined = [&](std::uint32_t i, std::uint32_t row) { // vertex i and i + 1
        if (axis) return (row > 0 && quad(row - 1, i)) || (row + 1 < vx_ && quad(row, i));
        return (row > 0 && quad(i, row - 1)) || (row + 1 < vy_ && quad(i, row));
    };
    for (std::uint32_t row = 0; row < rows; ++row)
        for (std::uint32_t i = 0; i + 1 < count;) {
            if (!used_[at(i, row)] || !joined(i, row)) {
                ++i;
                continue;
            }
            std::uint32_t end = i; // the last of the run within the cell
            while (end + 1 < count && joined(end, row) && (cell[end + 1] == cell[i] || on_line[end + 1])) {
                ++end;
                if (cell[end] != cell[i]) break;
            }
            if (end == i) {
                ++i;
                continue;
            }
            const std::size_t p = at(i, row), q = at(end, row);
            for (std::size_t k = 0; k < kChannels; ++k) {
                const std::size_t c = k % 3;
                const float fp = shown_[p * kChannels + k], fq = shown_[q * kChannels + k], ap = may_[3 * p + c], aq = may_[3 * q + c];
                if (n == 1) {
                    float most = -1e30f, least = 1e30f;
                    for (std::uint32_t m = i; m <= end; ++m) {
                        const std::size_t v = at(m, row);
                        most = std::max(most, shown_[v * kChannels + k] - may_[3 * v + c]), least = std::min(least, shown_[v * kChannels + k] + may_[3 * v + c]);
                    }
                    if (most > least * (least > 0 ? 1.000001f : 0.999999f)) return false;
                    continue;
                }
                for (std::uint32_t m = i + 1; m < end; ++m) {
                    const std::size_t v = at(m, row);
                    const float t = static_cast<float>(m - i) / static_cast<float>(end - i);
                    const float off = std::abs(shown_[v * kChannels + k] - (fp + (fq - fp) * t)), may = may_[3 * v + c] + ap + (aq - ap) * t;
                    if (off > may * 1.00001f) return false;
                }
            }
            i = end;
        }
    return true;
}

// What is to be tried along an axis: all small numbers of texels, then steps of about a sixth, and the luxels as they are.
template <std::size_t kChannels> std::vector<Axis> Fitting<kChannels>::axes(int axis) const {
    const double from = axis ? l_.from.y : l_.from.x, to = axis ? l_.to.y : l_.to.x;
    const std::uint32_t luxels = axis ? l_.height : l_.width, most = std::max(2u, static_cast<std::uint32_t>(to - from) + 1);
    std::vector<Axis> out;
    for (std::uint32_t n = 1; n <= most && n < luxels; n = std::max(n + 1, static_cast<std::uint32_t>(n * 7 / 6)))
        if (const Axis a = axis_of(n, from, to); possible(axis, a)) out.push_back(a);
    out.push_back({luxels, 1, 0});
    return out;
}

// A bound from below: no texels of such a grid bring the largest change over what is allowed under it. The grid through what is shown at its own centres
// is off by no more than any other is at a place and at the centres around it together.
template <std::size_t kChannels> double Fitting<kChannels>::best_possible(const Axis& ax, const Axis& ay) const {
    if (ax.n == 1 || ay.n == 1) return 0; // all places are the middle of one texel, not its centre alone
    const std::size_t n = std::size_t{ax.n} * ay.n;
    std::vector<double> full(n * kChannels), may(n * 3);
    std::vector<std::uint8_t> bound(n); // a face shows the centre
    for (std::uint32_t j = 0; j < ay.n; ++j)
        for (std::uint32_t i = 0; i < ax.n; ++i) {
            const double u = std::clamp((i + 0.5 - ax.shift) / ax.scale, 0.0, l_.width + 0.0), v = std::clamp((j + 0.5 - ay.shift) / ay.scale, 0.0, l_.height + 0.0);
            const std::size_t t = std::size_t{j} * ax.n + i;
            const auto qx = std::min(static_cast<std::uint32_t>(2 * u), vx_ - 2), qy = std::min(static_cast<std::uint32_t>(2 * v), vy_ - 2);
            if (!quad(qx, qy)) continue;
            bound[t] = 1;
            lookup<kChannels>(l_.texels.data(), l_.width, read_at(u, l_.width), read_at(v, l_.height), &full[t * kChannels]);
            for (std::size_t c = 0; c < 3; ++c) may[3 * t + c] = may_at(qx, qy, 2 * u - qx, 2 * v - qy, c);
        }
    double most = 0;
    std::array<double, kChannels> here{}, between{};
    const std::vector<Read> across = reads_at_half(vx_, ax), down = reads_at_half(vy_, ay);
    for (std::uint32_t j = 0; j < vy_; ++j) {
        for (std::uint32_t i = 0; i < vx_; ++i) {
            if (!used_[vertex(i, j)]) continue;
            const Read &x = across[i], &y = down[j];
            const std::array<std::size_t, 4> t{std::size_t{y.at} * ax.n + x.at, std::size_t{y.at} * ax.n + x.next, std::size_t{y.next} * ax.n + x.at, std::size_t{y.next} * ax.n + x.next};
            if (!bound[t[0]] || !bound[t[1]] || !bound[t[2]] || !bound[t[3]]) continue;
            lookup<kChannels>(full.data(), ax.n, x, y, between.data());
            for (std::size_t k = 0; k < kChannels; ++k) here[k] = shown_[vertex(i, j) * kChannels + k];
            const std::array<double, 4> w{(1 - x.weight) * (1 - y.weight), x.weight * (1 - y.weight), (1 - x.weight) * y.weight, x.weight * y.weight};
            for (std::size_t c = 0; c < 3; ++c) {
                double allowed = may_[3 * vertex(i, j) + c];
                for (std::size_t k = 0; k < 4; ++k) allowed += w[k] * may[3 * t[k] + c];
                most = std::max(most, change(here.data(), between.data(), c) / allowed);
            }
            if (most > kFarOff) return most;
        }
    }
    return most;
}

template <std::size_t kChannels> ChartFit Fitting<kChannels>::fit(const Axis& ax, const Axis& ay) const {
    constexpr double kKeep = 1e-6; // of the weight of an ordinary texel, for what no face decides
    constexpr int kMostSteps = 60;
    constexpr double kSmall = 1e-3; // of the first residual: whether it will do is measured afterwards
    const std::size_t n = std::size_t{ax.n} * ay.n;
    const std::vector<Read> x = reads_at_half(vx_, ax), y = reads_at_half(vy_, ay);

    ChartFit out;
    out.width = ax.n, out.height = ay.n;
    out.scale = {ax.scale, ay.scale}, out.shift = {ax.shift, ay.shift};
    out.read.assign(n, 0);
    // Begin with what is shown at the centres.
    std::vector<double> texel(n * kChannels);
    for (std::uint32_t j = 0; j < ay.n; ++j)
        for (std::uint32_t i = 0; i < ax.n; ++i)
            lookup<kChannels>(l_.texels.data(), l_.width, read_at((i + 0.5 - ax.shift) / ax.scale, l_.width), read_at((j + 0.5 - ay.shift) / ay.scale, l_.height),
                   &texel[(std::size_t{j} * ax.n + i) * kChannels]);
    // What shows black is black.
    std::vector<std::uint8_t> held(n);
    for (std::uint32_t j = 0; j < vy_; ++j)
        for (std::uint32_t i = 0; i < vx_; ++i) {
            if (!black_[vertex(i, j)]) continue;
            for (const auto& [row, wy] : {std::pair{y[j].at, 1 - y[j].weight}, {y[j].next, y[j].weight}})
                for (const auto& [column, wx] : {std::pair{x[i].at, 1 - x[i].weight}, {x[i].next, x[i].weight}})
                    if (wx > 0 && wy > 0) held[std::size_t{row} * ax.n + column] = 1;
        }
    for (std::size_t t = 0; t < n; ++t)
        if (held[t]) std::fill_n(texel.begin() + static_cast<std::ptrdiff_t>(t * kChannels), kChannels, 0.0);
    // The normal equations: of each texel and the eight around it, [texel * 9 + 3 * (dy + 1) + dx + 1].
    std::vector<double> matrix(n * 9), residual(n * kChannels);
    double total = 0;
    std::array<double, kChannels> off{};
    for (std::uint32_t j = 0; j < vy_; ++j)
        for (std::uint32_t i = 0; i < vx_; ++i) {
            const std::size_t v = vertex(i, j);
            if (!used_[v]) continue;
            const double allowed = (static_cast<double>(may_[3 * v]) + may_[3 * v + 1] + may_[3 * v + 2]) / 3;
            const double weight = used_[v] / (allowed * allowed);
            total += weight;
            for (std::size_t k = 0; k < kChannels; ++k) off[k] = shown_[v * kChannels + k];
            const Read &rx = x[i], &ry = y[j];
            const std::array<std::size_t, 4> t{std::size_t{ry.at} * ax.n + rx.at, std::size_t{ry.at} * ax.n + rx.next, std::size_t{ry.next} * ax.n + rx.at, std::size_t{ry.next} * ax.n + rx.next};
            const std::array<double, 4> w{(1 - rx.weight) * (1 - ry.weight), rx.weight * (1 - ry.weight), (1 - rx.weight) * ry.weight, rx.weight * ry.weight};
            for (std::size_t a = 0; a < 4; ++a) {
                if (!(w[a] > 0)) continue;
                for (std::size_t k = 0; k < kChannels; ++k) off[k] -= w[a] * texel[t[a] * kChannels + k];
            }
            for (std::size_t a = 0; a < 4; ++a) {
                if (!(w[a] > 0)) continue;
                out.read[t[a]] = 1;
                for (std::size_t b = 0; b < 4; ++b) {
                    if (!(w[b] > 0)) continue;
                    const int dx = static_cast<int>(b % 2) - static_cast<int>(a % 2), dy = static_cast<int>(b / 2) - static_cast<int>(a / 2);
                    matrix[t[a] * 9 + static_cast<std::size_t>(3 * (dy + 1) + dx + 1)] += weight * w[a] * w[b];
                }
                for (std::size_t k = 0; k < kChannels; ++k) residual[t[a] * kChannels + k] += weight * w[a] * off[k];
            }
        }
    for (std::size_t t = 0; t < n; ++t) {
        matrix[t * 9 + 4] += kKeep * (total > 0 ? total : 1) / static_cast<double>(n);
        for (std::size_t k = 0; held[t] && k < kChannels; ++k) residual[t * kChannels + k] = 0;
    }

    // Conjugate gradients, preconditioned by the diagonal, all channels side by side.
    const std::size_t size = n * kChannels;
    std::vector<double> change(size), step(size), image(size);
    std::array<double, kChannels> rho{}, stop{}, sum{};
    const auto scaled = [&](std::size_t t, std::size_t k) { return residual[t * kChannels + k] / matrix[t * 9 + 4]; };
    for (std::size_t t = 0; t < n; ++t)
        for (std::size_t k = 0; k < kChannels; ++k) step[t * kChannels + k] = scaled(t, k), rho[k] += residual[t * kChannels + k] * scaled(t, k);
    for (std::size_t k = 0; k < kChannels; ++k) stop[k] = rho[k] * kSmall * kSmall;
    for (int round = 0; round < kMostSteps; ++round) {
        bool more = false;
        for (std::size_t k = 0; k < kChannels; ++k) more |= rho[k] > stop[k] && rho[k] > 0;
        if (!more) break;
        sum = {};
        for (std::uint32_t j = 0; j < ay.n; ++j)
            for (std::uint32_t i = 0; i < ax.n; ++i) {
                const std::size_t t = std::size_t{j} * ax.n + i;
                std::array<double, kChannels> s{};
                for (int dy = -1; dy <= 1; ++dy)
                    for (int dx = -1; dx <= 1; ++dx) {
                        const double m = matrix[t * 9 + static_cast<std::size_t>(3 * (dy + 1) + dx + 1)];
                        if (m == 0) continue;
                        const double* p = &step[(static_cast<std::size_t>(static_cast<std::int64_t>(j) + dy) * ax.n + static_cast<std::size_t>(static_cast<std::int64_t>(i) + dx)) * kChannels];
                        for (std::size_t k = 0; k < kChannels; ++k) s[k] += m * p[k];
                    }
                for (std::size_t k = 0; k < kChannels; ++k) image[t * kChannels + k] = s[k], sum[k] += s[k] * step[t * kChannels + k];
            }
        std::array<double, kChannels> a{}, next{};
        for (std::size_t k = 0; k < kChannels; ++k) a[k] = sum[k] > 0 ? rho[k] / sum[k] : 0;
        for (std::size_t t = 0; t < n; ++t)
            for (std::size_t k = 0; k < kChannels; ++k) {
                const std::size_t at = t * kChannels + k;
                if (held[t]) continue;
                change[at] += a[k] * step[at], residual[at] -= a[k] * image[at];
                next[k] += residual[at] * scaled(t, k);
            }
        for (std::size_t k = 0; k < kChannels; ++k) a[k] = rho[k] > 0 ? next[k] / rho[k] : 0, rho[k] = next[k];
        for (std::size_t t = 0; t < n; ++t)
            for (std::size_t k = 0; k < kChannels; ++k) step[t * kChannels + k] = scaled(t, k) + a[k] * step[t * kChannels + k];
    }
    out.texels.resize(size);
    for (std::size_t at = 0; at < size; ++at) {
        const double v = texel[at] + change[at];
        out.texels[at] = static_cast<float>(l_.signed_values ? v : std::max(0.0, v));
    }
    return out;
}

// How far apart two sets of stored values are in what is shown of one colour.
template <std::size_t kChannels> double Fitting<kChannels>::change(const double* full, const double* coarse, std::size_t colour) const {
    double out = 0;
    if (l_.shown_by == ShownBy::each) {
        for (std::size_t k = colour; k < kChannels; k += 3) out = std::max(out, std::abs(full[k] - coarse[k]));
        return out;
    }
    for (std::size_t k = colour; k < 9; k += 3) out += (full[k] - coarse[k]) * (full[k] - coarse[k]);
    out = std::sqrt(out);
    for (std::size_t k = 9 + colour; k < kChannels; k += 3) out = std::max(out, std::abs(full[k] - coarse[k]));
    return out;
}

// What is noise in one luxel is none in the mean of many: of blocks of 2 x 2 luxels, 4 x 4 and so on the mean may be off by so much less.
template <std::size_t kChannels> double Fitting<kChannels>::worst_of_blocks(const ChartFit& f) const {
    struct Block {
        std::array<double, kChannels> full{}, coarse{};
        std::array<double, 3> bound{}, noise{};
        double luxels = 0;
    };
    std::uint32_t w = (l_.width + 1) / 2, h = (l_.height + 1) / 2;
    std::vector<Block> blocks(std::size_t{w} * h);
    std::array<double, kChannels> value{};
    for (std::uint32_t y = 0; y < l_.height; ++y) {
        const Read ry = read_at((y + 0.5) * f.scale.y + f.shift.y, f.height);
        for (std::uint32_t x = 0; x < l_.width; ++x) {
            const std::size_t v = vertex(2 * x + 1, 2 * y + 1);
            if (!used_[v]) continue;
            Block& b = blocks[std::size_t{y / 2} * w + x / 2];
            lookup<kChannels>(f.texels.data(), f.width, read_at((x + 0.5) * f.scale.x + f.shift.x, f.width), ry, value.data());
            for (std::size_t k = 0; k < kChannels; ++k) b.full[k] += static_cast<double>(shown_[v * kChannels + k]), b.coarse[k] += value[k];
            for (std::size_t c = 0; c < 3; ++c) b.bound[c] += static_cast<double>(l_.allowed[3 * v + c]) + static_cast<double>(l_.guess[3 * v + c]), b.noise[c] += static_cast<double>(l_.noise[3 * v + c]);
            ++b.luxels;
        }
    }
    double most = 0;
    while (true) {
        for (const Block& b : blocks)
            for (std::size_t c = 0; c < 3 && b.luxels > 0; ++c)
                most = std::max(most, change(b.full.data(), b.coarse.data(), c) / (b.bound[c] + b.noise[c] / std::sqrt(b.luxels)));
        if (w == 1 && h == 1) return most;
        const std::uint32_t half_w = (w + 1) / 2, half_h = (h + 1) / 2;
        std::vector<Block> larger(std::size_t{half_w} * half_h);
        for (std::uint32_t y = 0; y < h; ++y)
            for (std::uint32_t x = 0; x < w; ++x) {
                const Block& from = blocks[std::size_t{y} * w + x];
                Block& to = larger[std::size_t{y / 2} * half_w + x / 2];
                for (std::size_t k = 0; k < kChannels; ++k) to.full[k] += from.full[k], to.coarse[k] += from.coarse[k];
                for (std::size_t c = 0; c < 3; ++c) to.bound[c] += from.bound[c], to.noise[c] += from.noise[c];
                to.luxels += from.luxels;
            }
        blocks = std::move(larger), w = half_w, h = half_h;
    }
}

// The largest change over what is allowed. Both reconstructions are bilinear between the lines through the centres of either, so is
// what is allowed: the corners of those rectangles are the worst places. Those at half luxels first, which cost least and mostly say enough: what does not do there is not looked at further.
template <std::size_t kChannels> double Fitting<kChannels>::worst(ChartFit& f) const {
    const std::vector<Read> across = reads_at_half(vx_, {f.width, f.scale.x, f.shift.x}), down = reads_at_half(vy_, {f.height, f.scale.y, f.shift.y});
    double most = 0;
    f.square = f.weight = 0;
    std::array<double, kChannels> full{}, coarse{};
    for (std::uint32_t j = 0; j < vy_; ++j)
        for (std::uint32_t i = 0; i < vx_; ++i) {
            const std::size_t v = vertex(i, j);
            if (!used_[v]) continue;
            std::copy_n(shown_.begin() + static_cast<std::ptrdiff_t>(v * kChannels), kChannels, full.begin());
            lookup<kChannels>(f.texels.data(), f.width, across[i], down[j], coarse.data());
            for (std::size_t c = 0; c < 3; ++c) {
                const double off = change(full.data(), coarse.data(), c), relative = off / static_cast<double>(l_.scale[3 * v + c]), weight = used_[v];
                most = std::max(most, off / static_cast<double>(may_[3 * v + c]));
                f.square += weight * relative * relative, f.weight += weight;
            }
            if (most > kFarOff) return most;
        }
    if (most > 1) return most;

    struct Line {
        double at = 0;          // luxel coordinate
        std::uint32_t half = 0; // the vertex at or before it
    };
    const auto lines = [](std::uint32_t vertices, std::uint32_t n, double scale, double shift) {
        std::vector<Line> out;
        for (std::uint32_t i = 0; i < vertices; ++i) out.push_back({0.5 * i, i});
        for (std::uint32_t t = 0; n > 1 && t < n; ++t) {
            const double at = (t + 0.5 - shift) / scale;
            if (at > 0 && at < 0.5 * (vertices - 1) && std::abs(at * 2 - std::round(at * 2)) > 1e-9) out.push_back({at, static_cast<std::uint32_t>(at * 2)});
        }
        std::ranges::sort(out, {}, &Line::at);
        return out;
    };
    const std::vector<Line> xs = lines(vx_, f.width, f.scale.x, f.shift.x), ys = lines(vy_, f.height, f.scale.y, f.shift.y);
    const auto reads = [](const std::vector<Line>& all, double scale, double shift, std::uint32_t n) {
        std::vector<Read> out;
        for (const Line& l : all) out.push_back(read_at(l.at * scale + shift, n));
        return out;
    };
    const std::vector<Read> full_x = reads(xs, 1, 0, l_.width), full_y = reads(ys, 1, 0, l_.height), x = reads(xs, f.scale.x, f.shift.x, f.width), y = reads(ys, f.scale.y, f.shift.y, f.height);
    for (std::size_t j = 0; j < ys.size(); ++j)
        for (std::size_t i = 0; i < xs.size(); ++i) {
            const bool on_x = xs[i].at == 0.5 * xs[i].half, on_y = ys[j].at == 0.5 * ys[j].half;
            if (on_x && on_y) continue;
            // Of the quads that the place is in or at the border of, is one covered?
            const std::uint32_t hx = xs[i].half, hy = ys[j].half;
            bool here = false;
            for (std::uint32_t qy = hy - (on_y && hy > 0 ? 1 : 0); qy <= hy && qy + 1 < vy_; ++qy)
                for (std::uint32_t qx = hx - (on_x && hx > 0 ? 1 : 0); qx <= hx && qx + 1 < vx_; ++qx) here |= quad(qx, qy);
            if (!here) continue;
            lookup<kChannels>(l_.texels.data(), l_.width, full_x[i], full_y[j], full.data());
            lookup<kChannels>(f.texels.data(), f.width, x[i], y[j], coarse.data());
            for (std::size_t c = 0; c < 3; ++c)
                most = std::max(most, change(full.data(), coarse.data(), c) / may_at(hx, hy, 2 * xs[i].at - hx, 2 * ys[j].at - hy, c));
            if (most > kFarOff) return most;
        }
    return most;
}

// The fewest texels found to do. The smallest sizes are tried one by one: most charts need no more, and where two or three texels lie along an axis decides more
// than how many they are. Beyond, one that fails speaks for those below it with half its texels or less, and the next to be tried is the one that leaves
// fewest either way: a large chart needs dozens of fits, not hundreds.
template <std::size_t kChannels> std::optional<ChartFit> Fitting<kChannels>::coarsest() {
    constexpr int kOneByOne = 6;
    constexpr double kSpeaksFor = 0.5;  // of its texels
    constexpr std::size_t kLookAt = 64; // sizes, of those left
    struct Size {
        const Axis *x, *y;
        std::size_t texels() const { return std::size_t{x->n} * y->n; }
    };
    const std::vector<Axis> across = axes(0), down = axes(1);
    std::vector<Size> left;
    for (const Axis& x : across)
        for (const Axis& y : down)
            if (Size s{&x, &y}; s.texels() < std::size_t{l_.width} * l_.height) left.push_back(s);
    std::ranges::sort(left, {}, [](const Size& s) { return std::pair(s.texels(), s.x->n); });
    const auto power = [](const Axis& a) { return a.scale == 1 && a.shift == 0 ? HUGE_VAL : a.n; }; // nothing is lost along it
    const auto below = [power](const Size& o, const Size& s, double times) { return power(*o.x) <= power(*s.x) * times && power(*o.y) <= power(*s.y) * times; };
    const auto spoken_for = [&](const Size& o, const Size& s) { return static_cast<double>(o.texels()) <= kSpeaksFor * static_cast<double>(s.texels()) && below(o, s, 1); };
    std::optional<ChartFit> best;
    for (int tries = 0; !left.empty(); ++tries) {
        std::size_t next = 0, most = 0;
        if (tries >= kOneByOne)
            for (std::size_t i = 0; i < left.size(); i += (left.size() + kLookAt - 1) / kLookAt) {
                const auto fails = 1 + std::ranges::count_if(std::span(left).first(i), [&](const Size& o) { return spoken_for(o, left[i]); });
                if (const std::size_t gone = std::min(static_cast<std::size_t>(fails), left.size() - i); gone > most) next = i, most = gone;
            }
        const Size s = left[next];
        ChartFit f;
        double ratio = best_possible(*s.x, *s.y);
        if (ratio <= 1.00001) {
            f = fit(*s.x, *s.y);
            ratio = worst(f);
            if (ratio <= 1) ratio = worst_of_blocks(f);
        }
        if (ratio <= 1) {
            best = std::move(f), left.resize(next);
            continue;
        }
        left.erase(left.begin() + static_cast<std::ptrdiff_t>(next));
        const bool far_off = ratio > kFarOff; // a few more will not do either
        std::erase_if(left, [&](const Size& o) { return spoken_for(o, s) || (far_off && below(o, s, 1.25)); });
    }
    return best;
}

} // namespace

std::optional<ChartFit> coarsest_fit(const ChartLight& light) {
    if (light.channels == 3) return Fitting<3>(light).coarsest();
    if (light.channels == 9) return Fitting<9>(light).coarsest();
    return Fitting<12>(light).coarsest();
}

} // namespace kiln

#include "compiler/density/chart_fit.h"
#include "libs/core/check.h"
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

namespace kiln {
namespace {

constexpr float kFarOff = 2; // times what is allowed: how much more does not matter

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

// Red, green and blue side by side in a register, and nothing.
struct Colour {
    using Pack [[gnu::vector_size(16)]] = float;
    Pack v{};
    Colour() = default;
    Colour(Pack pack) : v(pack) {}
    explicit Colour(float all) : v{all, all, all, 0} {}
    explicit Colour(const float* rgb) : v{rgb[0], rgb[1], rgb[2], 0} {}
    float operator[](std::size_t c) const { return v[c]; }
    Colour& operator+=(Colour o) { return v += o.v, *this; }
};
Colour operator+(Colour a, Colour b) { return a.v + b.v; }
Colour operator-(Colour a, Colour b) { return a.v - b.v; }
Colour operator*(Colour a, Colour b) { return a.v * b.v; }
Colour operator*(Colour a, float s) { return a.v * s; }
Colour larger(Colour a, Colour b) { return a.v > b.v ? a.v : b.v; }
Colour smaller(Colour a, Colour b) { return a.v < b.v ? a.v : b.v; }
Colour size(Colour a) { return larger(a, -a.v); }
float largest(Colour a) { return std::max({a[0], a[1], a[2]}); }

// All that is stored of a texel: a colour, or those along the basis vectors, and flat light too under the tilted encoding.
template <std::size_t kColours> struct Values {
    std::array<Colour, kColours> of{};
    Values& add(const Values& o, float weight) {
        for (std::size_t k = 0; k < kColours; ++k) of[k] += o.of[k] * weight;
        return *this;
    }
};
// Bilinear between four of a grid.
template <class V> V lookup(const std::vector<V>& grid, std::size_t width, const Read& x, const Read& y) {
    const std::size_t p = y.at * width, q = y.next * width;
    V out{};
    out.add(grid[p + x.at], static_cast<float>((1 - x.weight) * (1 - y.weight))).add(grid[p + x.next], static_cast<float>(x.weight * (1 - y.weight)));
    return out.add(grid[q + x.at], static_cast<float>((1 - x.weight) * y.weight)).add(grid[q + x.next], static_cast<float>(x.weight * y.weight));
}
// A row of values between two of a grid, and a value between two of a row: what a row of places has in common is worked out once.
template <class V> void row_between(const std::vector<V>& grid, std::size_t width, const Read& y, std::vector<V>& row) {
    const std::size_t p = y.at * width, q = y.next * width;
    const auto a = static_cast<float>(1 - y.weight), b = static_cast<float>(y.weight);
    row.assign(width, {});
    for (std::size_t i = 0; i < width; ++i) row[i].add(grid[p + i], a).add(grid[q + i], b);
}
template <class V> V between(const std::vector<V>& row, const Read& x) {
    V out{};
    return out.add(row[x.at], static_cast<float>(1 - x.weight)).add(row[x.next], static_cast<float>(x.weight));
}

// The number of colours is known to the compiler: they are the innermost loop of everything. Floats do: what a fit comes to is measured afterwards.
template <std::size_t kColours> class Fitting {
public:
    using Value = Values<kColours>;
    explicit Fitting(const ChartLight& light) : l_(light), vx_(light.vertices_x()), vy_(light.vertices_y()), used_(std::size_t{vx_} * vy_), shown_(used_.size()) {
        KILN_CHECK(light.channels == 3 * kColours);
        for (std::uint32_t j = 0; j < vy_ - 1; ++j)
            for (std::uint32_t i = 0; i < vx_ - 1; ++i)
                if (quad(i, j))
                    for (const std::size_t v : {vertex(i, j), vertex(i + 1, j), vertex(i, j + 1), vertex(i + 1, j + 1)}) ++used_[v];
        for (std::size_t t = 0; t < std::size_t{l_.width} * l_.height; ++t) {
            Value& value = texels_.emplace_back();
            for (std::size_t k = 0; k < kColours; ++k) value.of[k] = Colour(&l_.texels[(t * kColours + k) * 3]);
        }
        black_.assign(used_.size(), 0);
        std::vector<Value> row;
        const std::vector<Read> across = reads_at_half(vx_, {l_.width, 1, 0});
        for (std::uint32_t j = 0; j < vy_; ++j) {
            row_between(texels_, l_.width, read_at(0.5 * j, l_.height), row);
            for (std::uint32_t i = 0; i < vx_; ++i) {
                const std::size_t v = vertex(i, j);
                const Colour allowed(&l_.allowed[3 * v]);
                may_.push_back(allowed + Colour(&l_.noise[3 * v]) + Colour(&l_.guess[3 * v]));
                if (!used_[v]) continue;
                shown_[v] = between(row, across[i]);
                Colour most;
                for (const Colour& c : shown_[v].of) most = larger(most, size(c));
                if (largest(most) > 0) continue;
                // No light comes there, and none will: least squares and a bound alone would let a little through.
                black_[v] = 1, may_[v] = allowed * 1e-3f;
            }
        }
        weigh();
    }
    std::optional<ChartFit> coarsest();

private:
    const ChartLight& l_;
    std::uint32_t vx_, vy_;
    std::vector<Value> texels_;
    // Per vertex:
    std::vector<std::uint8_t> used_;  // covered quads around it
    std::vector<Value> shown_;        // where used
    std::vector<Colour> may_;         // by how much it may be off, noise included
    std::vector<std::uint8_t> black_; // nothing is shown there
    std::vector<float> weight_;       // in least squares, 0 where not used
    double all_weights_ = 0;

    std::size_t vertex(std::uint32_t i, std::uint32_t j) const { return std::size_t{j} * vx_ + i; }
    bool quad(std::uint32_t i, std::uint32_t j) const { return l_.covered[std::size_t{j} * (vx_ - 1) + i]; }
    bool possible(int axis, const Axis& grid) const;
    bool level(std::uint32_t first, std::uint32_t last, const auto& at) const;
    bool straight(std::uint32_t first, std::uint32_t last, const auto& at) const;
    std::vector<Axis> axes(int axis) const;
    double best_possible(const Axis& x, const Axis& y) const;
    ChartFit fit(const Axis& x, const Axis& y) const;
    std::vector<Value> values(const ChartFit& fit) const;
    double worst(const ChartFit& fit) const;
    double worst_of_blocks(const ChartFit& fit) const;
    void measure(ChartFit& fit) const;
    void weigh();
    Colour squares(const Value& off) const;
    // What is shown at a vertex less what a grid shows there: each(vertex, difference), row by row; done(): after each row, whether to stop.
    void each_off(const ChartFit& fit, const auto& each, const auto& done) const;
    // By how much it may be off at a place of a quad, tx and ty of the way to the next vertices.
    Colour may_at(std::uint32_t i, std::uint32_t j, double tx, double ty) const {
        const std::uint32_t x = std::min(i + 1, vx_ - 1), y = std::min(j + 1, vy_ - 1);
        const auto sx = static_cast<float>(tx), sy = static_cast<float>(ty);
        return (may_[vertex(i, j)] * (1 - sx) + may_[vertex(x, j)] * sx) * (1 - sy) + (may_[vertex(i, y)] * (1 - sx) + may_[vertex(x, y)] * sx) * sy;
    }
};
template <class V> V difference(const V& a, const V& b) {
    V out = a;
    return out.add(b, -1);
}

// Whether one value could do for all vertices of a run.
template <std::size_t kColours> bool Fitting<kColours>::level(std::uint32_t first, std::uint32_t last, const auto& at) const {
    Value most, least;
    most.of.fill(Colour(-1e30f)), least.of.fill(Colour(1e30f));
    for (std::uint32_t m = first; m <= last; ++m)
        for (std::size_t k = 0; k < kColours; ++k)
            most.of[k] = larger(most.of[k], shown_[at(m)].of[k] - may_[at(m)]), least.of[k] = smaller(least.of[k], shown_[at(m)].of[k] + may_[at(m)]);
    bool out = true;
    for (std::size_t k = 0; k < kColours; ++k) out &= largest(most.of[k] - least.of[k] - size(least.of[k]) * 1e-6f) <= 0;
    return out;
}

// Whether those within a run could lie on a line between two values near those of its ends.
template <std::size_t kColours> bool Fitting<kColours>::straight(std::uint32_t first, std::uint32_t last, const auto& at) const {
    const Value p = shown_[at(first)], rise = difference(shown_[at(last)], p);
    const Colour here = may_[at(first)], on = may_[at(last)] - here;
    for (std::uint32_t m = first + 1; m < last; ++m) {
        const float t = static_cast<float>(m - first) / static_cast<float>(last - first);
        Colour off;
        for (std::size_t k = 0; k < kColours; ++k) off = larger(off, size(shown_[at(m)].of[k] - p.of[k] - rise.of[k] * t));
        if (largest(off - (may_[at(m)] + here + on * t) * 1.00001f) > 0) return false;
    }
    return true;
}

// Whether a grid of n texels along one axis could do, with any number along the other. Along a line between two of its centres what
// it shows is linear: of three places there the middle one may be off the line of the others by what is allowed there and no more.
template <std::size_t kColours> bool Fitting<kColours>::possible(int axis, const Axis& a) const {
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
            if (!(n == 1 ? level(i, end, [&](std::uint32_t m) { return at(m, row); }) : straight(i, end, [&](std::uint32_t m) { return at(m, row); }))) return false;
            i = end;
        }
    return true;
}

// What is to be tried along an axis: all small numbers of texels, then steps of about a sixth, and the luxels as they are.
template <std::size_t kColours> std::vector<Axis> Fitting<kColours>::axes(int axis) const {
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
template <std::size_t kColours> double Fitting<kColours>::best_possible(const Axis& ax, const Axis& ay) const {
    if (ax.n == 1 || ay.n == 1) return 0; // all places are the middle of one texel, not its centre alone
    const std::size_t n = std::size_t{ax.n} * ay.n;
    using Centre = Values<kColours + 1>; // the last: what is allowed there
    std::vector<Centre> full(n);
    std::vector<std::uint8_t> bound(n); // a face shows the centre
    for (std::uint32_t j = 0; j < ay.n; ++j)
        for (std::uint32_t i = 0; i < ax.n; ++i) {
            const double u = std::clamp((i + 0.5 - ax.shift) / ax.scale, 0.0, l_.width + 0.0), v = std::clamp((j + 0.5 - ay.shift) / ay.scale, 0.0, l_.height + 0.0);
            const std::size_t t = std::size_t{j} * ax.n + i;
            const auto qx = std::min(static_cast<std::uint32_t>(2 * u), vx_ - 2), qy = std::min(static_cast<std::uint32_t>(2 * v), vy_ - 2);
            if (!quad(qx, qy)) continue;
            bound[t] = 1;
            const Value value = lookup(texels_, l_.width, read_at(u, l_.width), read_at(v, l_.height));
            std::ranges::copy(value.of, full[t].of.begin()), full[t].of.back() = may_at(qx, qy, 2 * u - qx, 2 * v - qy);
        }
    float most = 0; // squares
    const std::vector<Read> across = reads_at_half(vx_, ax), down = reads_at_half(vy_, ay);
    std::vector<Centre> row;
    for (std::uint32_t j = 0; j < vy_ && most <= kFarOff * kFarOff; ++j) {
        const Read& y = down[j];
        row_between(full, ax.n, y, row);
        const auto bound_at = [&](std::size_t i) { return bound[y.at * ax.n + i] && bound[y.next * ax.n + i]; };
        for (std::uint32_t i = 0; i < vx_; ++i) {
            const std::size_t v = vertex(i, j);
            if (!used_[v] || !bound_at(across[i].at) || !bound_at(across[i].next)) continue;
            const Centre there = between(row, across[i]);
            Value off = shown_[v];
            for (std::size_t k = 0; k < kColours; ++k) off.of[k] = off.of[k] - there.of[k];
            const Colour square = squares(off), allowed = may_[v] + there.of.back(), allowed2 = allowed * allowed;
            for (std::size_t c = 0; c < 3; ++c)
                if (square[c] > most * allowed2[c]) most = square[c] / allowed2[c];
        }
    }
    return std::sqrt(most);
}

// Of each vertex in least squares: by the area of the quads around it and what may change there. In units of the largest, which floats hold.
template <std::size_t kColours> void Fitting<kColours>::weigh() {
    weight_.assign(used_.size(), 0);
    std::vector<double> weight(used_.size());
    double most = 0;
    for (std::size_t v = 0; v < used_.size(); ++v) {
        if (!used_[v]) continue;
        const double allowed = (static_cast<double>(may_[v][0]) + static_cast<double>(may_[v][1]) + static_cast<double>(may_[v][2])) / 3;
        weight[v] = used_[v] / (allowed * allowed), most = std::max(most, weight[v]);
    }
    for (std::size_t v = 0; v < used_.size(); ++v)
        if (used_[v]) weight_[v] = static_cast<float>(weight[v] / most), all_weights_ += weight[v] / most;
}

template <std::size_t kColours> ChartFit Fitting<kColours>::fit(const Axis& ax, const Axis& ay) const {
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
    std::vector<Value> texel(n);
    for (std::uint32_t j = 0; j < ay.n; ++j)
        for (std::uint32_t i = 0; i < ax.n; ++i)
            texel[std::size_t{j} * ax.n + i] = lookup(texels_, l_.width, read_at((i + 0.5 - ax.shift) / ax.scale, l_.width), read_at((j + 0.5 - ay.shift) / ay.scale, l_.height));
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
        if (held[t]) texel[t] = {};
    // The normal equations: of each texel and the eight around it, [texel * 9 + 3 * (dy + 1) + dx + 1]. A row of vertices at a time, which all read the
    // same two rows of texels: summed up along it first, texel by texel of an axis.
    std::vector<float> matrix(n * 9);
    std::vector<Value> residual(n);
    struct Column { // of texels: sums over the row's vertices of weights times products of what they read of this one and of the next
        float own = 0, beside = 0;
        bool read = false;
        Value right;
    };
    std::vector<Column> columns;
    std::vector<Value> row;
    for (std::uint32_t j = 0; j < vy_; ++j) {
        columns.assign(ax.n, {});
        row_between(texel, ax.n, y[j], row);
        for (std::uint32_t i = 0; i < vx_; ++i) {
            const std::size_t v = vertex(i, j);
            if (!used_[v]) continue;
            const Value left = difference(shown_[v], between(row, x[i]));
            const auto b = static_cast<float>(x[i].weight), a = static_cast<float>(1 - x[i].weight), wa = weight_[v] * a, wb = weight_[v] * b;
            Column &here = columns[x[i].at], &next = columns[x[i].next];
            here.own += wa * a, here.beside += wa * b, here.read |= x[i].weight < 1, here.right.add(left, wa);
            if (x[i].weight > 0) next.own += wb * b, next.read = true, next.right.add(left, wb);
        }
        const std::array<std::size_t, 2> rows{y[j].at, y[j].next};
        const std::array<float, 2> of{static_cast<float>(1 - y[j].weight), static_cast<float>(y[j].weight)};
        for (std::size_t r = 0; r < 2; ++r) {
            if (!(r ? y[j].weight > 0 : y[j].weight < 1)) continue;
            for (std::uint32_t i = 0; i < ax.n; ++i) {
                if (!columns[i].read) continue;
                const std::size_t t = rows[r] * ax.n + i;
                out.read[t] = 1, residual[t].add(columns[i].right, of[r]);
                for (std::size_t q = 0; q < 2; ++q) { // texels of the same row, and of the other one
                    const float both = of[r] * of[q];
                    float* m = &matrix[t * 9 + 3 * (1 + q - r) + 1];
                    m[0] += both * columns[i].own, m[1] += both * columns[i].beside;
                    if (i > 0) m[-1] += both * columns[i - 1].beside;
                }
            }
        }
    }
    for (std::size_t t = 0; t < n; ++t) {
        matrix[t * 9 + 4] += static_cast<float>(kKeep * (all_weights_ > 0 ? all_weights_ : 1) / static_cast<double>(n));
        if (held[t]) residual[t] = {};
    }

    // Conjugate gradients, preconditioned by the diagonal, all values side by side. Steps with a rim of texels that are none around them.
    const std::size_t pitch = std::size_t{ax.n} + 2;
    std::vector<Value> change(n), step(pitch * (std::size_t{ay.n} + 2)), image(n);
    const auto step_at = [&](std::uint32_t i, std::uint32_t j) -> Value& { return step[(j + 1) * pitch + i + 1]; };
    using Sums = std::array<std::array<double, 3>, kColours>; // added up row by row
    const auto add_up = [&](const auto& of) {
        Sums all{};
        for (std::uint32_t j = 0; j < ay.n; ++j) {
            Value sums;
            for (std::uint32_t i = 0; i < ax.n; ++i) of(i, j, std::size_t{j} * ax.n + i, sums);
            for (std::size_t k = 0; k < kColours; ++k)
                for (std::size_t c = 0; c < 3; ++c) all[k][c] += static_cast<double>(sums.of[k][c]);
        }
        return all;
    };
    const auto quotient = [](const Sums& above, const Sums& below) {
        Value shares;
        for (std::size_t k = 0; k < kColours; ++k)
            for (std::size_t c = 0; c < 3; ++c) shares.of[k].v[c] = below[k][c] > 0 ? static_cast<float>(above[k][c] / below[k][c]) : 0;
        return shares;
    };
    // Goes so much of the last steps' way, takes what that makes off what is left, and says how much is.
    const auto go = [&](const Value& along) {
        return add_up([&](std::uint32_t i, std::uint32_t j, std::size_t t, Value& sums) {
            const float share = 1 / matrix[t * 9 + 4];
            const Value& s = step_at(i, j);
            for (std::size_t k = 0; k < kColours; ++k) {
                if (!held[t]) change[t].of[k] += along.of[k] * s.of[k], residual[t].of[k] = residual[t].of[k] - along.of[k] * image[t].of[k];
                sums.of[k] += residual[t].of[k] * residual[t].of[k] * share;
            }
        });
    };
    Sums left = go({});
    const Sums first = left;
    Value of_last; // of the last steps in the next ones
    for (int round = 0; round < kMostSteps; ++round) {
        bool more = false;
        for (std::size_t k = 0; k < kColours; ++k)
            for (std::size_t c = 0; c < 3; ++c) more |= left[k][c] > first[k][c] * kSmall * kSmall;
        if (!more) break;
        for (std::uint32_t j = 0; j < ay.n; ++j)
            for (std::uint32_t i = 0; i < ax.n; ++i) {
                const std::size_t t = std::size_t{j} * ax.n + i;
                Value& s = step_at(i, j);
                for (std::size_t k = 0; k < kColours; ++k) s.of[k] = residual[t].of[k] * (1 / matrix[t * 9 + 4]) + of_last.of[k] * s.of[k];
            }
        const Sums along = add_up([&](std::uint32_t i, std::uint32_t j, std::size_t t, Value& sums) {
            const float* m = &matrix[t * 9];
            const Value* s = &step[j * pitch + i];
            Value here;
            for (std::size_t dy = 0; dy < 3; ++dy)
                for (std::size_t dx = 0; dx < 3; ++dx) here.add(s[dy * pitch + dx], m[3 * dy + dx]);
            image[t] = here;
            for (std::size_t k = 0; k < kColours; ++k) sums.of[k] += here.of[k] * s[pitch + 1].of[k];
        });
        const Sums before = std::exchange(left, go(quotient(left, along)));
        of_last = quotient(left, before);
    }
    for (std::size_t t = 0; t < n; ++t)
        for (std::size_t k = 0; k < kColours; ++k)
            for (std::size_t c = 0; c < 3; ++c) {
                const float v = texel[t].of[k][c] + change[t].of[k][c];
                out.texels.push_back(l_.signed_values ? v : std::max(0.0f, v));
            }
    return out;
}

// Of the difference of two sets of stored values: how far apart they are in what is shown, of each colour, squared.
template <std::size_t kColours> Colour Fitting<kColours>::squares(const Value& off) const {
    Colour out;
    for (std::size_t k = 0; k < kColours; ++k) {
        const Colour square = off.of[k] * off.of[k];
        out = l_.shown_by == ShownBy::length && k < 3 ? out + square : larger(out, square);
    }
    return out;
}

template <std::size_t kColours> std::vector<Values<kColours>> Fitting<kColours>::values(const ChartFit& f) const {
    std::vector<Value> out(f.texels.size() / (3 * kColours));
    for (std::size_t at = 0; at < out.size() * kColours; ++at) out[at / kColours].of[at % kColours] = Colour(&f.texels[at * 3]);
    return out;
}

template <std::size_t kColours> void Fitting<kColours>::each_off(const ChartFit& f, const auto& each, const auto& done) const {
    const std::vector<Read> across = reads_at_half(vx_, {f.width, f.scale.x, f.shift.x}), down = reads_at_half(vy_, {f.height, f.scale.y, f.shift.y});
    const std::vector<Value> texels = values(f);
    std::vector<Value> row;
    for (std::uint32_t j = 0; j < vy_ && !done(); ++j) {
        row_between(texels, f.width, down[j], row);
        for (std::uint32_t i = 0; i < vx_; ++i)
            if (const std::size_t v = vertex(i, j); used_[v]) each(v, difference(shown_[v], between(row, across[i])));
    }
}

// What is noise in one luxel is none in the mean of many: of blocks of 2 x 2 luxels, 4 x 4 and so on the mean may be off by so much less.
template <std::size_t kColours> double Fitting<kColours>::worst_of_blocks(const ChartFit& f) const {
    struct Block {
        Value off;
        Colour bound, noise;
        float luxels = 0;
        void add(const Block& o) { off.add(o.off, 1), bound += o.bound, noise += o.noise, luxels += o.luxels; }
    };
    std::uint32_t w = (l_.width + 1) / 2, h = (l_.height + 1) / 2;
    std::vector<Block> blocks(std::size_t{w} * h);
    each_off(f, [&](std::size_t v, const Value& off) {
        const std::size_t i = v % vx_, j = v / vx_;
        if (i % 2 == 0 || j % 2 == 0) return; // no middle of a luxel
        blocks[(j / 4) * w + i / 4].add({off, Colour(&l_.allowed[3 * v]) + Colour(&l_.guess[3 * v]), Colour(&l_.noise[3 * v]), 1});
    }, [] { return false; });
    float most = 0;
    while (true) {
        for (const Block& b : blocks) {
            if (!(b.luxels > 0)) continue;
            const Colour square = squares(b.off), may = b.bound + b.noise * (1 / std::sqrt(b.luxels));
            for (std::size_t c = 0; c < 3; ++c) most = std::max(most, std::sqrt(square[c]) / may[c]);
        }
        if (w == 1 && h == 1) return most;
        const std::uint32_t half_w = (w + 1) / 2, half_h = (h + 1) / 2;
        std::vector<Block> larger(std::size_t{half_w} * half_h);
        for (std::uint32_t y = 0; y < h; ++y)
            for (std::uint32_t x = 0; x < w; ++x) larger[std::size_t{y / 2} * half_w + x / 2].add(blocks[std::size_t{y} * w + x]);
        blocks = std::move(larger), w = half_w, h = half_h;
    }
}

// The largest change over what is allowed. Both reconstructions are bilinear between the lines through the centres of either, so is
// what is allowed: the corners of those rectangles are the worst places. Those at half luxels first, which cost least and mostly say enough: what does not do there is not looked at further.
template <std::size_t kColours> double Fitting<kColours>::worst(const ChartFit& f) const {
    float most = 0; // squares
    each_off(f, [&](std::size_t v, const Value& off) {
        const Colour square = squares(off), may2 = may_[v] * may_[v];
        for (std::size_t c = 0; c < 3; ++c)
            if (square[c] > most * may2[c]) most = square[c] / may2[c];
    }, [&] { return most > kFarOff * kFarOff; });
    if (most > 1) return std::sqrt(most);

    const std::vector<Value> texels = values(f);
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
            const Value full = lookup(texels_, l_.width, full_x[i], full_y[j]), coarse = lookup(texels, f.width, x[i], y[j]);
            const Colour square = squares(difference(full, coarse)), may = may_at(hx, hy, 2 * xs[i].at - hx, 2 * ys[j].at - hy);
            for (std::size_t c = 0; c < 3; ++c) most = std::max(most, square[c] / (may[c] * may[c]));
            if (most > kFarOff * kFarOff) return std::sqrt(most);
        }
    return std::sqrt(most);
}

// Of a fit that does: the change at the half luxels over the scale, squared.
template <std::size_t kColours> void Fitting<kColours>::measure(ChartFit& f) const {
    each_off(f, [&](std::size_t v, const Value& off) {
        const Colour square = squares(off);
        for (std::size_t c = 0; c < 3; ++c) {
            const double scale = l_.scale[3 * v + c];
            f.square += used_[v] * static_cast<double>(square[c]) / (scale * scale), f.weight += used_[v];
        }
    }, [] { return false; });
}

// The fewest texels found to do. The smallest sizes are tried one by one: most charts need no more, and where two or three texels lie along an axis decides more
// than how many they are. Beyond, one that fails speaks for those below it with half its texels or less, and the next to be tried is the one that leaves
// fewest either way: a large chart needs dozens of fits, not hundreds.
template <std::size_t kColours> std::optional<ChartFit> Fitting<kColours>::coarsest() {
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
    if (best) measure(*best);
    return best;
}

} // namespace

std::optional<ChartFit> coarsest_fit(const ChartLight& light) {
    if (light.channels == 3) return Fitting<1>(light).coarsest();
    if (light.channels == 9) return Fitting<3>(light).coarsest();
    return Fitting<4>(light).coarsest();
}

} // namespace kiln

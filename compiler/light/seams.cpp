#include "compiler/light/seams.h"
#include "compiler/light/bake.h"
#include "libs/core/check.h"
#include "libs/core/union_find.h"
#include "libs/parallel/parallel.h"
#include <Eigen/SparseCholesky>
#include <cmath>
#include <memory>
#include <mutex>
#include <optional>
#include <tuple>
#include <utility>

namespace kiln {

Bilinear bilinear_at(std::uint32_t width, std::uint32_t height, Vec2 place) {
    Bilinear out;
    std::array<std::uint32_t, 2> x{}, y{};
    const auto axis = [](double v, std::uint32_t size, std::array<std::uint32_t, 2>& at) {
        v = std::clamp(v - 0.5, 0.0, size - 1.0);
        at[0] = static_cast<std::uint32_t>(v), at[1] = std::min(at[0] + 1, size - 1);
        return v - at[0];
    };
    const double u = axis(place.x, width, x), v = axis(place.y, height, y);
    for (std::size_t k = 0; k < 4; ++k) {
        out.texel[k] = y[k / 2] * width + x[k % 2];
        out.weight[k] = (k % 2 ? u : 1 - u) * (k / 2 ? v : 1 - v);
    }
    return out;
}
Bilinear bilinear_at(const Chart& c, Vec2 luxel) {
    Bilinear out = bilinear_at(c.width, c.height, luxel);
    for (std::uint32_t& t : out.texel) t += c.first_texel;
    return out;
}

namespace {

// A triangle's side of a seam: its edge from corner e to corner e + 1.
struct Side {
    std::uint32_t triangle = 0;
    std::size_t edge = 0;
};

// The two triangles of each seam: of the charts it names, along its edge in opposite directions, with the same normals there.
std::vector<std::array<Side, 2>> sides_of_seams(const Surfaces& s) {
    const auto key = [](std::uint32_t a, std::uint32_t b) { return std::uint64_t{std::min(a, b)} << 32 | std::max(a, b); };
    std::vector<std::uint64_t> wanted;
    for (const Seam& seam : s.seams) wanted.push_back(key(seam.from, seam.to));
    std::ranges::sort(wanted);
    std::vector<std::pair<std::uint64_t, Side>> found; // by edge, then in the order of the triangles
    for (std::uint32_t t = 0; t < s.triangles.size(); ++t)
        for (std::size_t e = 0; e < 3; ++e)
            if (const std::uint64_t k = key(s.triangles[t][e], s.triangles[t][(e + 1) % 3]); std::ranges::binary_search(wanted, k)) found.push_back({k, {t, e}});
    std::ranges::stable_sort(found, {}, [](const auto& f) { return f.first; });

    constexpr std::uint32_t kNone = UINT32_MAX;
    std::vector<std::array<Side, 2>> out;
    for (const Seam& seam : s.seams) {
        std::array<Side, 2> sides{{{kNone, 0}, {kNone, 0}}};
        const auto at = std::ranges::equal_range(found, key(seam.from, seam.to), {}, [](const auto& f) { return f.first; });
        for (const auto& [k, a] : at)
            for (const auto& [l, b] : at) {
                if (sides[0].triangle != kNone || a.triangle == b.triangle) continue;
                if (s.faces[s.triangle_face[a.triangle].at()].chart != seam.chart_a || s.faces[s.triangle_face[b.triangle].at()].chart != seam.chart_b) continue;
                const auto corner = [&](const Side& side, std::size_t i) { return (side.edge + i) % 3; };
                if (s.triangles[a.triangle][corner(a, 0)] != s.triangles[b.triangle][corner(b, 1)]) continue;
                if (s.corner_normals[a.triangle][corner(a, 0)] != s.corner_normals[b.triangle][corner(b, 1)] ||
                    s.corner_normals[a.triangle][corner(a, 1)] != s.corner_normals[b.triangle][corner(b, 0)]) continue;
                sides = {a, b};
            }
        out.push_back(sides);
    }
    return out;
}

// Luxel coordinates of the corners of a triangle of a face with a chart.
std::array<Vec2, 3> corners_of(const Surfaces& s, std::size_t triangle) {
    const FaceId face = s.triangle_face[triangle];
    std::array<Vec2, 3> out;
    for (std::size_t k = 0; k < 3; ++k)
        out[k] = s.faces[face.at()].curved() ? s.corners_of(triangle)[k].luxel : luxel_from_world(s, face, s.positions[s.triangles[triangle][k]]);
    return out;
}

} // namespace

std::vector<std::vector<SeamLine>> seam_lines(const Surfaces& s) {
    std::vector<std::vector<SeamLine>> out(s.charts.size());
    using Key = std::pair<std::uint64_t, ChartId>;
    std::vector<Key> wanted;
    const auto edge = [](std::uint32_t a, std::uint32_t b) { return std::uint64_t{std::min(a, b)} << 32 | std::max(a, b); };
    for (const Seam& seam : s.seams)
        for (const ChartId c : {seam.chart_a, seam.chart_b}) wanted.emplace_back(edge(seam.from, seam.to), c);
    std::ranges::sort(wanted);
    for (std::size_t t = 0; t < s.triangles.size(); ++t) {
        const ChartId chart = s.faces[s.triangle_face[t].at()].chart;
        if (!chart.valid()) continue;
        for (std::size_t k = 0; k < 3; ++k)
            if (std::ranges::binary_search(wanted, Key{edge(s.triangles[t][k], s.triangles[t][(k + 1) % 3]), chart})) {
                const std::array<Vec2, 3> corner = corners_of(s, t);
                out[chart.at()].push_back({corner[k], corner[(k + 1) % 3]});
            }
    }
    return out;
}

namespace {

// A point of an edge between two charts, seen from both.
struct SeamPoint {
    Vec3 position, normal; // the shading normal that both sides have there
    Vec3 along;            // unit, of the edge
    std::array<FaceId, 2> face;
    std::array<Vec3, 2> inwards; // unit, across the edge in each face
    std::array<Vec2, 2> luxel;
    std::array<Frame, 2> frame; // that each side's directional light is read in
    // Beside the end of a wall: a side reads what lies round it, and so would show that at the foot of the wall. What both sides show here cannot be the same.
    bool torn = false;
};
// The same as its number on a seam.
struct SeamPlace {
    static constexpr bool kRawBytes = true;
    std::uint32_t seam = 0, number = 0, torn = 0;
};

// Points along all seams, so many to a luxel of the finer side.
class SeamPoints {
public:
    SeamPoints(const Surfaces& surfaces, const LuxelIndex& index, double density) : s_(surfaces), index_(index), density_(density), sides_(sides_of_seams(surfaces)) {}
    // Those where light may go from one side to the other: the surfaces of one mesh go on, both are baked there, and nothing stands on the edge. In the order of the seams.
    // A function of geometry and of where anything was baked.
    std::vector<SeamPlace> open(const std::vector<std::uint8_t>& valid, const TraceScene& scene, Context& context) const;
    SeamPoint at(const SeamPlace& place) const { return point(*edge(place.seam), place.number, place.torn); }
    const Chart& chart_of(const SeamPoint& p, std::size_t k) const { return s_.charts[s_.faces[p.face[k].at()].chart.at()]; }

private:
    struct Edge {
        std::array<FaceId, 2> face;
        std::array<const Chart*, 2> chart{};
        std::array<std::array<Vec2, 2>, 2> ends{}; // of each side, in luxels: at the edge's two ends
        std::array<Vec3, 2> inwards;
        Vec3 from, to, normal_from, normal_to;
        std::uint32_t points = 0;
    };
    std::optional<Edge> edge(std::size_t seam) const; // none: no two triangles meet there
    SeamPoint point(const Edge& edge, std::uint32_t number, bool torn) const;
    bool goes_on(const SeamPoint& point, const std::vector<std::uint8_t>& valid, const TraceScene& scene) const;
    bool torn(const SeamPoint& point, std::size_t k, const std::vector<std::uint8_t>& valid, const TraceScene& scene) const;
    double half_luxel(FaceId face) const { return 0.5 * std::sqrt(luxel_area(s_, face)); }

    static constexpr double kHeight = 0.125; // map units over the surfaces, for what stands on them; doors of maps hang no higher over a floor
    static constexpr double kInside = 1e-3;  // luxels
    const Surfaces& s_;
    const LuxelIndex& index_;
    const double density_;
    const std::vector<std::array<Side, 2>> sides_;
};

std::optional<SeamPoints::Edge> SeamPoints::edge(std::size_t seam) const {
    const Side& first = sides_[seam][0];
    if (first.triangle == UINT32_MAX) return std::nullopt;
    const std::size_t second = (first.edge + 1) % 3;
    Edge out;
    out.from = s_.positions[s_.triangles[first.triangle][first.edge]], out.to = s_.positions[s_.triangles[first.triangle][second]];
    out.normal_from = static_cast<Vec3>(s_.corner_normals[first.triangle][first.edge]), out.normal_to = static_cast<Vec3>(s_.corner_normals[first.triangle][second]);
    if (!(length(out.to - out.from) > 0)) return std::nullopt;
    double luxels = 0;
    for (std::size_t k = 0; k < 2; ++k) {
        const FaceId face = out.face[k] = s_.triangle_face[sides_[seam][k].triangle];
        out.chart[k] = &s_.charts[s_.faces[face.at()].chart.at()];
        out.ends[k] = {luxel_from_world(s_, face, out.from), luxel_from_world(s_, face, out.to)};
        out.inwards[k] = normalize(cross(s_.faces[face.at()].normal, out.to - out.from)) * (k == 0 ? 1.0 : -1.0);
        const Vec2 along = out.ends[k][1] - out.ends[k][0];
        luxels = std::max(luxels, std::hypot(along.x, along.y));
    }
    out.points = static_cast<std::uint32_t>(std::max(1.0, std::ceil(density_ * luxels)));
    return out;
}

SeamPoint SeamPoints::point(const Edge& e, std::uint32_t number, bool torn) const {
    const double at = (number + 0.5) / e.points;
    SeamPoint out;
    out.face = e.face, out.torn = torn;
    out.position = e.from + (e.to - e.from) * at, out.along = normalize(e.to - e.from), out.inwards = e.inwards;
    const Vec3 n = e.normal_from + (e.normal_to - e.normal_from) * at;
    out.normal = length(n) > 1e-6 ? normalize(n) : s_.faces[e.face[0].at()].normal;
    for (std::size_t k = 0; k < 2; ++k) {
        out.luxel[k] = e.ends[k][0] + (e.ends[k][1] - e.ends[k][0]) * at;
        out.frame[k] = light_frame(*e.chart[k], s_.faces[e.face[k].at()], out.normal);
    }
    return out;
}

bool SeamPoints::goes_on(const SeamPoint& p, const std::vector<std::uint8_t>& valid, const TraceScene& scene) const {
    for (std::size_t k = 0; k < 2; ++k) {
        const Face& f = s_.faces[p.face[k].at()];
        const Chart& chart = chart_of(p, k);
        // Baked there: a luxel that lies in what is solid, or in a door, is filled in.
        const double reach = half_luxel(p.face[k]);
        const Vec2 within = luxel_from_world(s_, p.face[k], p.position + p.inwards[k] * (2 * kInside * reach));
        const auto x = static_cast<std::uint32_t>(std::clamp(within.x, 0.0, chart.width - 1.0)), y = static_cast<std::uint32_t>(std::clamp(within.y, 0.0, chart.height - 1.0));
        if (valid[chart.texel(x, y)] != 1) return false;
        // Walls of this mesh end it, and so are no seam. What stands on it without cutting it does so here: brush models, terrain.
        const std::optional<SceneHit> hit = scene.closest(p.position + p.normal * kHeight, p.inwards[k], reach);
        if (!hit) continue;
        const Face& by = s_.faces[hit->face.at()];
        if (by.model != f.model || by.curved() != f.curved() || hit->back) return false;
    }
    return true;
}

// Of side k: what it reads from beyond the edge is behind what ends there, as seen from where else it is read. That is a luxel of its own round the end of a wall, or a
// texel of the gutter that would stand for one of the other side's.
bool SeamPoints::torn(const SeamPoint& point, std::size_t k, const std::vector<std::uint8_t>& valid, const TraceScene& scene) const {
    const Face &own = s_.faces[point.face[k].at()], &other = s_.faces[point.face[1 - k].at()];
    if (own.curved() || own.plane != other.plane) return false;
    const double reach = half_luxel(point.face[k]);
    const Chart& c = chart_of(point, k);
    const Bilinear read = bilinear_at(c, point.luxel[k]);
    const auto baked = [&](std::uint32_t texel) { // its middle
        const std::uint32_t l = valid[texel] == 1 ? index_.luxel_of(texel) : UINT32_MAX;
        return l == UINT32_MAX ? std::nullopt : std::optional(world_from_luxel(s_, s_.luxels[l].face, centroid_of(s_, s_.luxels[l])));
    };
    const Vec3 up = own.normal * kHeight;
    for (std::size_t i = 0; i < 4; ++i) {
        if (!(read.weight[i] > 0)) continue;
        if (const auto to = baked(read.texel[i])) {
            if (dot(*to - point.position, point.inwards[k]) <= -kInside * reach && scene.occluded(point.position + point.inwards[1 - k] * (kInside * reach) + up, *to + up)) return true;
            continue;
        }
        const std::uint32_t at = read.texel[i] - c.first_texel;
        const Vec2 there = luxel_from_world(s_, point.face[1 - k], world_from_luxel(s_, point.face[k], {at % c.width + 0.5, at / c.width + 0.5}));
        const Chart& d = s_.charts[other.chart.at()];
        if (!(there.x >= 0 && there.y >= 0 && there.x < d.width && there.y < d.height)) continue;
        const auto to = baked(d.texel(static_cast<std::uint32_t>(there.x), static_cast<std::uint32_t>(there.y)));
        for (std::size_t q = 0; to && q < 4; ++q)
            if (const auto from = read.weight[q] > 0 ? baked(read.texel[q]) : std::nullopt; from && scene.occluded(*from + up, *to + up)) return true;
    }
    return false;
}

std::vector<SeamPlace> SeamPoints::open(const std::vector<std::uint8_t>& valid, const TraceScene& scene, Context& context) const {
    std::vector<std::vector<SeamPlace>> places(sides_.size());
    parallel_for(context, sides_.size(), [&](std::size_t i) {
        const std::optional<Edge> e = edge(i);
        for (std::uint32_t j = 0; e && j < e->points; ++j)
            if (const SeamPoint p = point(*e, j, false); goes_on(p, valid, scene))
                places[i].push_back({static_cast<std::uint32_t>(i), j, torn(p, 0, valid, scene) || torn(p, 1, valid, scene)});
    });
    return joined(places);
}

// What a row of the fit asks: the sum of weight * texel, both sides together, to be 0.
struct Row {
    static constexpr std::size_t kMost = 24; // texels of both sides, three values each
    std::array<std::uint32_t, kMost> unknown{};
    std::array<double, kMost> weight{};
    std::size_t count = 0;
    void add(std::uint32_t u, double w) {
        for (std::size_t i = 0; i < count; ++i)
            if (unknown[i] == u) { // a chart that meets itself
                weight[i] += w;
                return;
            }
        unknown[count] = u, weight[count] = w, ++count;
    }
};

// Minimises  sum of rows (sum of weight * x)^2 + sum of keep * (x - start)^2, where asked with x >= 0, one colour: its normal equations,
// by a sparse Cholesky factorisation. Values that would fall below 0 are held there and the others solved for again.
class Fit {
public:
    std::vector<Row> rows;
    std::vector<double> keep; // per unknown, above 0
    bool non_negative = true;

    // From its own solution once more: what holding to the values leaves of a mismatch shrinks by the same factor again, where the
    // texels can follow at all. Where the equations cannot be solved the values stay.
    std::vector<double> solve(const std::vector<double>& start) { return nearest(nearest(start)); }

private:
    using Matrix = Eigen::SparseMatrix<double>;
    using Factors = Eigen::SimplicialLLT<Matrix>;
    std::unique_ptr<Factors> free_; // with none held; the same for all colours

    // None: too ill-conditioned.
    std::unique_ptr<Factors> factors(const std::vector<bool>& held) const {
        const std::size_t n = keep.size();
        std::vector<std::uint32_t> first(n + 1), where; // rows that an unknown is in
        for (const Row& row : rows)
            for (std::size_t i = 0; i < row.count; ++i) ++first[row.unknown[i] + 1];
        for (std::size_t i = 0; i < n; ++i) first[i + 1] += first[i];
        where.resize(first[n]);
        std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
        for (std::uint32_t r = 0; r < rows.size(); ++r)
            for (std::size_t i = 0; i < rows[r].count; ++i) where[next[rows[r].unknown[i]]++] = r;
        // The lower half, column by column.
        std::vector<int> begin{0}, at;
        std::vector<double> value, column(n);
        std::vector<std::uint32_t> touched;
        for (std::uint32_t j = 0; j < n; ++j) {
            touched.assign(1, j), column[j] = held[j] ? 1 : keep[j];
            for (std::uint32_t k = first[j]; k < first[j + 1] && !held[j]; ++k) {
                const Row& row = rows[where[k]];
                const auto own = static_cast<std::size_t>(std::ranges::find(row.unknown, j) - row.unknown.begin());
                for (std::size_t i = 0; i < row.count; ++i) {
                    const std::uint32_t u = row.unknown[i];
                    if (u < j || held[u]) continue;
                    if (column[u] == 0) touched.push_back(u);
                    column[u] += row.weight[i] * row.weight[own];
                }
            }
            std::ranges::sort(touched);
            const auto same = std::ranges::unique(touched); // what came to 0 on the way was noted again
            touched.erase(same.begin(), same.end());
            for (const std::uint32_t u : touched) at.push_back(static_cast<int>(u)), value.push_back(std::exchange(column[u], 0));
            begin.push_back(static_cast<int>(at.size()));
        }
        const auto side = static_cast<Eigen::Index>(n);
        const Eigen::Map<const Matrix> normal(side, side, static_cast<Eigen::Index>(at.size()), begin.data(), at.data(), value.data());
        auto out = std::make_unique<Factors>(Matrix(normal));
        return out->info() == Eigen::Success ? std::move(out) : nullptr;
    }

    std::vector<double> nearest(const std::vector<double>& start) {
        constexpr int kHolds = 8;
        const std::size_t n = start.size();
        std::vector<bool> held(n);
        if (!free_) free_ = factors(held);
        std::unique_ptr<Factors> some;
        std::vector<double> x = start;
        for (int round = 0; round < kHolds; ++round) {
            if (round) some = factors(held);
            const Factors* use = round ? some.get() : free_.get();
            if (!use) return start;
            Eigen::VectorXd wanted(static_cast<Eigen::Index>(n));
            for (std::size_t i = 0; i < n; ++i) wanted[static_cast<Eigen::Index>(i)] = held[i] ? 0 : keep[i] * start[i];
            const Eigen::VectorXd got = use->solve(wanted);
            if (!got.allFinite()) return start;
            bool more = false;
            for (std::size_t i = 0; i < n; ++i) {
                x[i] = got[static_cast<Eigen::Index>(i)];
                if (non_negative && !held[i] && x[i] < 0) held[i] = more = true, x[i] = 0;
            }
            if (!more) break;
        }
        return x;
    }
};

// How much a texel holds to its value, against rows of weight 1, all relative to the light there.
constexpr double kKeepBaked = 2e-3;  // of a whole luxel as exact as most
constexpr double kKeepFilled = 3e-4; // of a texel that no face covers: it was made up
constexpr double kOrdinaryNoise = 0.02;
constexpr double kLean = 0.5;        // sine of the angle by which the normals lean that directional light is compared for
constexpr double kDensity = 8;       // points a luxel
constexpr double kCancelled = 1e-3;  // of what is summed along a normal, taking each part as positive: less than that of it is left by chance

struct Texel {
    Rgbd flat;
    std::array<Rgbd, 3> rnm{};
};

// The part of a match whose points read common texels.
struct Part {
    std::vector<SeamPoint> points;
    std::vector<std::array<Bilinear, 2>> reads; // of each point
    std::vector<std::uint32_t> texels;          // all that are read, ascending
    std::vector<ChartId> charts;                // of each
    std::vector<Texel> value;                   // of each
    std::vector<std::uint32_t> beyond;          // texels that are read of what lies on the other side
    std::size_t index(std::uint32_t texel) const { return static_cast<std::size_t>(std::ranges::lower_bound(texels, texel) - texels.begin()); }
};
// What its texels hold then: flat light; where they have it directional light after it.
struct Matched {
    std::vector<std::uint32_t> texels;
    std::vector<Rgb> light;
    template <class A> void fields(A& a) { a(texels, light); }
};

class Matching {
public:
    Matching(const Surfaces& surfaces, double floor, Lighting& lighting) : s_(surfaces), floor_(floor), light_(lighting), index_(surfaces) {}
    void run(const TraceScene& scene, Context& context, Memo* memo);

private:
    const Surfaces& s_;
    const double floor_;
    Lighting& light_;
    const LuxelIndex index_;

    bool directional(ChartId chart) const { return light_.rnm_first[chart.at()] != UINT32_MAX; }
    const Chart& chart_of(const SeamPoint& p, std::size_t k) const { return s_.charts[s_.faces[p.face[k].at()].chart.at()]; }
    ChartId chart_at(std::uint32_t texel) const { // charts lie one after the other
        return id<ChartId>(static_cast<std::size_t>(std::ranges::upper_bound(s_.charts, texel, {}, &Chart::first_texel) - s_.charts.begin() - 1));
    }
    Texel baked(ChartId chart, std::uint32_t texel) const {
        Texel out{static_cast<Rgbd>(light_.flat[texel])};
        if (directional(chart))
            for (std::size_t i = 0; i < 3; ++i) out.rnm[i] = static_cast<Rgbd>(light_.rnm[light_.rnm_first[chart.at()] + (texel - s_.charts[chart.at()].first_texel)][i]);
        return out;
    }
    const Luxel* baked_luxel(std::uint32_t texel) const { // none: filled in
        const std::uint32_t l = index_.luxel_of(texel);
        return light_.valid[texel] == 1 && l != UINT32_MAX ? &s_.luxels[l] : nullptr;
    }
    double keep(std::uint32_t texel) const {
        const double v = std::max(static_cast<double>(mean(light_.flat[texel])), floor_);
        const Luxel* luxel = baked_luxel(texel);
        if (!luxel) return kKeepFilled / (v * v);
        const double noise = light_.texel_error[texel] / kOrdinaryNoise;
        return std::max(kKeepFilled, kKeepBaked * std::min(1.0f, luxel->area) / (1 + noise * noise)) / (v * v);
    }
    std::vector<std::vector<SeamPlace>> apart(const SeamPoints& points, const TraceScene& scene, Context& context) const;
    std::vector<std::uint64_t> texel_states(Context& context) const;
    Matched match(const SeamPoints& points, std::span<const SeamPlace> places, std::vector<std::uint32_t>* read) const;
    void prepare(Part& part) const;
    void go_on(Part& part) const;
    void fit_flat(Part& part) const;
    void fit_directional(Part& part) const;
};

void Matching::prepare(Part& part) const {
    std::vector<std::pair<std::uint32_t, ChartId>> texels;
    for (const SeamPoint& p : part.points) {
        part.reads.emplace_back();
        for (std::size_t k = 0; k < 2; ++k) {
            const Bilinear& b = part.reads.back()[k] = bilinear_at(chart_of(p, k), p.luxel[k]);
            for (std::size_t i = 0; i < 4; ++i)
                if (b.weight[i] > 0) texels.emplace_back(b.texel[i], s_.faces[p.face[k].at()].chart);
        }
    }
    std::ranges::sort(texels, {}, [](const auto& t) { return t.first; });
    texels.erase(std::unique(texels.begin(), texels.end()), texels.end());
    for (const auto& [texel, chart] : texels) part.texels.push_back(texel), part.charts.push_back(chart), part.value.push_back(baked(chart, texel));
}

// What a texel would hold if the surface did not end at the edge: the mean over all of its square, what lies beyond the edge taken
// from there. A luxel in part on the face holds the mean of that part only, and the gutter what stands beside it; both are
// wrong by the light's slope over half a luxel, which is most of what shows at a seam. The other side's own such texels are
// found in the same way, so it is done a few times.
void Matching::go_on(Part& part) const {
    constexpr int kRounds = 4, kAcross = 4; // places along a square's side
    struct Place {                          // beyond the edge: where on the other side
        std::size_t texel = 0, point = 0, side = 0;
        Bilinear read;
        double weight = 0;
        std::array<std::size_t, 4> value{}; // of what is read: in part.value, and after its end in `beyond`
    };
    std::vector<std::pair<std::uint32_t, std::uint32_t>> by_texel; // texel, 2 point + side
    for (std::uint32_t j = 0; j < part.points.size(); ++j)
        for (std::uint32_t k = 0; k < 2 && !part.points[j].torn; ++k)
            for (std::size_t i = 0; i < 4; ++i)
                if (part.reads[j][k].weight[i] > 0) by_texel.emplace_back(part.reads[j][k].texel[i], 2 * j + k);
    std::ranges::sort(by_texel);
    const std::vector<Texel> start = part.value;
    std::vector<Place> places;
    std::vector<double> own(part.texels.size(), 1); // share of what the texel keeps of its own
    for (std::size_t t = 0; t < part.texels.size(); ++t) {
        const std::uint32_t texel = part.texels[t];
        const Luxel* luxel = baked_luxel(texel);
        if (luxel && luxel->area > 0.999f) continue;
        const Chart& chart = s_.charts[part.charts[t].at()];
        const std::uint32_t at = texel - chart.first_texel;
        const auto seen = std::ranges::equal_range(by_texel, texel, {}, [](const auto& x) { return x.first; });
        if (seen.empty()) continue; // by places that are torn alone
        const std::size_t first = places.size();
        for (int q = 0; q < kAcross * kAcross; ++q) {
            const Vec2 place{at % chart.width + (q % kAcross + 0.5) / kAcross, at / chart.width + (q / kAcross + 0.5) / kAcross};
            bool here = false;
            for (std::uint32_t k = 0; luxel && k < luxel->piece_count && !here; ++k) {
                const PiecePoints polygon = points_of(s_, s_.pieces[luxel->first_piece + k]);
                here = true;
                for (std::size_t i = 0; i < polygon.size() && here; ++i) here = cross(polygon[(i + 1) % polygon.size()] - polygon[i], place - polygon[i]) >= 0;
            }
            if (here) continue;
            std::uint32_t nearest = 0;
            double least = 1e30;
            for (const auto& [x, code] : seen) {
                const Vec2 d = place - part.points[code / 2].luxel[code % 2];
                if (dot(d, d) < least) least = dot(d, d), nearest = code;
            }
            // Unfolded about the edge there.
            const std::size_t k = nearest % 2;
            const SeamPoint& p = part.points[nearest / 2];
            const Vec3 away = world_from_luxel(s_, p.face[k], place) - p.position;
            const double beyond = -dot(away, p.inwards[k]);
            if (beyond <= 0) continue; // off the face elsewhere
            const Vec2 other = luxel_from_world(s_, p.face[1 - k], p.position + p.along * dot(away, p.along) + p.inwards[1 - k] * beyond);
            const Chart& c = chart_of(p, 1 - k);
            if (!(other.x >= 0 && other.y >= 0 && other.x < c.width && other.y < c.height)) continue;
            if (light_.valid[c.texel(static_cast<std::uint32_t>(other.x), static_cast<std::uint32_t>(other.y))] != 1) continue;
            places.push_back({t, nearest / 2, k, bilinear_at(c, other), 0});
        }
        const auto found = static_cast<double>(places.size() - first);
        if (!(found > 0)) continue;
        own[t] = luxel ? luxel->area : 0;
        for (std::size_t i = first; i < places.size(); ++i) places[i].weight = (1 - own[t]) / found;
    }
    std::vector<Texel> beyond; // what is read of no texel of the part
    for (Place& place : places)
        for (std::size_t i = 0; i < 4; ++i) {
            if (!(place.read.weight[i] > 0)) continue;
            std::size_t& at = place.value[i] = part.index(place.read.texel[i]);
            if (at < part.texels.size() && part.texels[at] == place.read.texel[i]) continue;
            at = part.texels.size() + beyond.size();
            part.beyond.push_back(place.read.texel[i]);
            beyond.push_back(baked(s_.faces[part.points[place.point].face[1 - place.side].at()].chart, place.read.texel[i]));
        }
    const auto linear = [&](const std::array<Rgbd, 3>& stored, Vec3 n) { // rnm_evaluate, below 0 too
        if (light_.encoding == RnmEncoding::sq) {
            const std::array<Rgb, 3> rounded{static_cast<Rgb>(stored[0]), static_cast<Rgb>(stored[1]), static_cast<Rgb>(stored[2])};
            return rnm_evaluate(light_.encoding, rounded, n);
        }
        Rgbd e;
        for (std::size_t i = 0; i < 3; ++i) e += stored[i] * dot(kRnmBasis[i], n);
        return e;
    };
    for (int round = 0; round < kRounds; ++round) {
        std::vector<Texel> next = start;
        for (std::size_t t = 0; t < next.size(); ++t) {
            next[t].flat *= own[t];
            for (Rgbd& r : next[t].rnm) r *= own[t];
        }
        for (const Place& place : places) {
            const SeamPoint& p = part.points[place.point];
            const ChartId chart = s_.faces[p.face[1 - place.side].at()].chart;
            const bool ways = directional(part.charts[place.texel]);
            Texel sum;
            for (std::size_t i = 0; i < 4; ++i) {
                if (!(place.read.weight[i] > 0)) continue;
                const std::size_t at = place.value[i];
                const Texel& v = at < part.value.size() ? part.value[at] : beyond[at - part.value.size()];
                sum.flat += v.flat * place.read.weight[i];
                for (std::size_t m = 0; ways && m < 3; ++m) sum.rnm[m] += v.rnm[m] * place.read.weight[i];
            }
            Texel& to = next[place.texel];
            to.flat += sum.flat * place.weight;
            if (!ways) continue;
            for (std::size_t m = 0; m < 3; ++m) // along the basis of this side
                to.rnm[m] += (directional(chart) ? linear(sum.rnm, p.frame[1 - place.side].local(p.frame[place.side].world(kRnmBasis[m]))) : start[place.texel].rnm[m]) * place.weight;
        }
        part.value = std::move(next);
    }
}

void Matching::fit_flat(Part& part) const {
    Fit fit;
    for (const std::uint32_t t : part.texels) fit.keep.push_back(keep(t));
    for (std::size_t j = 0; j < part.points.size(); ++j) {
        if (part.points[j].torn) continue;
        const std::array<Bilinear, 2>& read = part.reads[j];
        Row row;
        double shown = 0;
        for (std::size_t k = 0; k < 2; ++k)
            for (std::size_t i = 0; i < 4; ++i) {
                if (!(read[k].weight[i] > 0)) continue;
                const std::size_t u = part.index(read[k].texel[i]);
                row.add(static_cast<std::uint32_t>(u), k ? -read[k].weight[i] : read[k].weight[i]);
                shown += 0.5 * read[k].weight[i] * mean(part.value[u].flat);
            }
        for (double& w : row.weight) w /= std::max(shown, floor_);
        fit.rows.push_back(row);
    }
    std::vector<double> start(part.texels.size());
    for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t i = 0; i < start.size(); ++i) start[i] = part.value[i].flat[c];
        const std::vector<double> x = fit.solve(start);
        for (std::size_t i = 0; i < start.size(); ++i) part.value[i].flat[c] = x[i];
    }
}

// What both sides show for three leaning normals of the world. Where the flat light is the same on both sides too that is one
// condition more than there are numbers to a texel, and `follow_flat` makes them follow it.
void Matching::fit_directional(Part& part) const {
    Fit fit;
    fit.non_negative = light_.encoding != RnmEncoding::dot;
    for (const std::uint32_t t : part.texels) fit.keep.insert(fit.keep.end(), 3, keep(t));
    for (std::size_t j = 0; j < part.points.size(); ++j) {
        const SeamPoint& p = part.points[j];
        if (p.torn || !directional(s_.faces[p.face[0].at()].chart) || !directional(s_.faces[p.face[1].at()].chart)) continue;
        const Frame common{p.frame[0].t, cross(p.normal, p.frame[0].t), p.normal};
        for (int normal = 0; normal < 3; ++normal) {
            const double turn = 2 * std::numbers::pi * normal / 3;
            const Vec3 n = common.world({kLean * std::cos(turn), kLean * std::sin(turn), std::sqrt(1 - kLean * kLean)});
            Row row;
            double shown = 0, read = 0;
            for (std::size_t k = 0; k < 2; ++k)
                for (std::size_t m = 0; m < 3; ++m) {
                    std::array<Rgb, 3> one{};
                    one[m] = {1, 1, 1};
                    const double share = rnm_evaluate(light_.encoding, one, p.frame[k].local(n)).x;
                    for (std::size_t i = 0; i < 4; ++i) {
                        if (!(part.reads[j][k].weight[i] > 0)) continue;
                        const double weight = part.reads[j][k].weight[i] * share;
                        const std::size_t u = part.index(part.reads[j][k].texel[i]);
                        row.add(static_cast<std::uint32_t>(3 * u + m), k ? -weight : weight);
                        shown += 0.5 * weight * mean(part.value[u].rnm[m]), read += 0.5 * std::abs(weight * mean(part.value[u].rnm[m]));
                    }
                }
            // Along normals away from the light its parts nearly cancel: what is left of them is no measure.
            for (double& w : row.weight) w /= std::max({shown, kCancelled * read, floor_});
            fit.rows.push_back(row);
        }
    }
    if (fit.rows.empty()) return;
    std::vector<double> start(3 * part.texels.size());
    for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t i = 0; i < start.size(); ++i) start[i] = part.value[i / 3].rnm[i % 3][c];
        const std::vector<double> x = fit.solve(start);
        for (std::size_t i = 0; i < start.size(); ++i) part.value[i / 3].rnm[i % 3][c] = x[i];
    }
}

// Points that read a common texel are fitted together; the others need not wait for each other.
std::vector<std::vector<SeamPlace>> Matching::apart(const SeamPoints& points, const TraceScene& scene, Context& context) const {
    const std::vector<SeamPlace> places = points.open(light_.valid, scene, context);
    UnionFind together(s_.texel_count);
    std::vector<std::uint32_t> any(places.size(), UINT32_MAX);
    for (std::size_t j = 0; j < places.size(); ++j) {
        const SeamPoint point = points.at(places[j]);
        for (std::size_t k = 0; k < 2; ++k) {
            const Bilinear read = bilinear_at(chart_of(point, k), point.luxel[k]);
            for (std::size_t i = 0; i < 4; ++i) {
                if (!(read.weight[i] > 0)) continue;
                if (any[j] == UINT32_MAX) any[j] = read.texel[i];
                together.join(any[j], read.texel[i]);
            }
        }
    }
    std::vector<std::pair<std::uint32_t, std::uint32_t>> order; // smallest texel of the set, point
    for (std::uint32_t j = 0; j < places.size(); ++j) order.emplace_back(together.find(any[j]), j);
    std::ranges::sort(order);
    std::vector<std::vector<SeamPlace>> parts;
    for (std::size_t i = 0; i < order.size(); ++i) {
        if (i == 0 || order[i].first != order[i - 1].first) parts.emplace_back();
        parts.back().push_back(places[order[i].second]);
    }
    return parts;
}

// All that a fit reads of a texel that depends on light.
std::vector<std::uint64_t> Matching::texel_states(Context& context) const {
    std::vector<std::uint64_t> out(s_.texel_count);
    parallel_chunks(context, s_.charts.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t c = begin; c < end; ++c) {
            const Chart& chart = s_.charts[c];
            const std::uint32_t first = light_.rnm_first[c], count = chart.width * chart.height;
            for (std::uint32_t t = 0; t < count; ++t) {
                const std::size_t texel = chart.first_texel + t;
                std::uint64_t sum = chained(std::uint64_t{std::bit_cast<std::uint32_t>(light_.texel_error[texel])}, light_.flat[texel]);
                for (std::size_t i = 0; first != UINT32_MAX && i < 3; ++i) sum = chained(sum, light_.rnm[first + t][i]);
                out[texel] = mix(sum);
            }
        }
    });
    return out;
}

// `read`: all texels that it is made from.
Matched Matching::match(const SeamPoints& points, std::span<const SeamPlace> places, std::vector<std::uint32_t>* read) const {
    Part part;
    for (const SeamPlace& place : places) part.points.push_back(points.at(place));
    prepare(part);
    go_on(part);
    fit_flat(part);
    fit_directional(part);
    Matched out{part.texels, {}};
    for (std::size_t t = 0; t < part.texels.size(); ++t) {
        out.light.push_back(static_cast<Rgb>(part.value[t].flat));
        if (!directional(part.charts[t])) continue;
        follow_flat(light_.encoding, part.value[t].flat, part.value[t].rnm);
        for (const Rgbd& along : part.value[t].rnm) out.light.push_back(static_cast<Rgb>(along));
    }
    *read = part.texels;
    read->insert(read->end(), part.beyond.begin(), part.beyond.end());
    return out;
}

void Matching::run(const TraceScene& scene, Context& context, Memo* memo) {
    std::optional<SeamPoints> made; // where the memo does not have all
    std::once_flag once;
    const auto points = [&]() -> const SeamPoints& {
        std::call_once(once, [&] { made.emplace(s_, index_, kDensity); });
        return *made;
    };
    const std::uint64_t key = memo ? mix(hash_of(scene.instruction_set()).low, KeyOf::seams, static_cast<std::uint64_t>(light_.encoding), hash_bytes(raw_bytes(s_.luxels)).low, hash_bytes(raw_bytes(light_.valid)).low, std::bit_cast<std::uint64_t>(kDensity)) : 0;
    const auto parts = known_or<std::vector<std::vector<SeamPlace>>>(memo, key, [&] { return apart(points(), scene, context); });
    const std::vector<std::uint64_t> states = memo ? texel_states(context) : std::vector<std::uint64_t>{};
    // All from what was baked; nothing is written before all are done, for they look beyond their own texels.
    std::vector<Matched> matched(parts.size());
    parallel_for(context, "light: seams", parts.size(), [&](std::size_t i) {
        const std::uint64_t of_part = memo ? key_at(i, parts.size(), mix(key, KeyOf::matched, i, std::bit_cast<std::uint64_t>(floor_))) : 0;
        if (const auto kept = memo ? memo->find(of_part, states) : std::nullopt) {
            read_whole(*kept, matched[i]);
            return;
        }
        std::vector<std::uint32_t> read;
        matched[i] = match(points(), parts[i], &read);
        if (memo) memo->keep(of_part, states, read, to_bytes(matched[i]));
    });
    for (const Matched& part : matched) {
        auto light = part.light.begin();
        for (const std::uint32_t texel : part.texels) {
            light_.flat[texel] = *light++;
            const ChartId chart = chart_at(texel);
            if (!directional(chart)) continue;
            auto& stored = light_.rnm[light_.rnm_first[chart.at()] + (texel - s_.charts[chart.at()].first_texel)];
            for (std::size_t m = 0; m < 3; ++m) stored[m] = *light++;
        }
    }
}

} // namespace

void match_seams(const Surfaces& surfaces, const TraceScene& scene, double floor_share, Lighting* lighting, Context& context, Memo* memo) {
    if (surfaces.seams.empty()) return;
    const double level = mean_irradiance(surfaces, *lighting);
    if (!(level > 0)) return; // all dark
    Matching(surfaces, error_floor(floor_share, level), *lighting).run(scene, context, memo);
}

} // namespace kiln

#include "compiler/surfaces/luxels.h"
#include "libs/core/check.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <cmath>
#include <tuple>

namespace kiln {
namespace {

constexpr double kSliver = 1e-9;  // luxels squared: what is smaller gives no samples
constexpr double kWhole = 1e-7;   // a face that covers a texel up to this share covers it

using Polygon = std::vector<Vec2>;

// Keeps what lies at or beyond (keep > 0) or at or below (keep < 0) the line coordinate[axis] = at.
void clip(const Polygon& in, int axis, double at, double keep, Polygon& out) {
    out.clear();
    const auto coordinate = [axis](Vec2 p) { return axis ? p.y : p.x; };
    for (std::size_t i = 0; i < in.size(); ++i) {
        const Vec2 a = in[i], b = in[i + 1 == in.size() ? 0 : i + 1];
        const double da = (coordinate(a) - at) * keep, db = (coordinate(b) - at) * keep;
        if (da >= 0) out.push_back(a);
        if ((da > 0 && db < 0) || (da < 0 && db > 0)) {
            // From the inner end, so that both halves of a cut get the same point.
            const Vec2 p = da > 0 ? a : b, q = da > 0 ? b : a;
            const double dp = std::abs(da > 0 ? da : db), dq = std::abs(da > 0 ? db : da);
            Vec2 x = p + (q - p) * (dp / (dp + dq));
            (axis ? x.y : x.x) = at;
            out.push_back(x);
        }
    }
}

struct Moments {
    double area = 0;
    Vec2 first; // area times centroid
};
Moments moments(const Vec2* p, std::size_t n) {
    Moments m;
    for (std::size_t i = 1; i + 1 < n; ++i) {
        const double a = 0.5 * cross(p[i] - p[0], p[i + 1] - p[0]);
        m.area += a;
        m.first = m.first + (p[0] + p[i] + p[i + 1]) * (a / 3);
    }
    return m;
}

struct Part { // of a texel
    std::uint32_t texel; // y * width + x
    FaceId face;
    double area;
    Vec2 first_moment;
    std::uint32_t first_point, point_count; // 0 points: the whole square
};

struct ChartLuxels {
    std::vector<Luxel> luxels;
    std::vector<LuxelPiece> pieces;
    std::vector<Vec2> points;
};

class Cutter {
public:
    explicit Cutter(const Chart& chart) : chart_(chart) {}
    std::vector<Part> parts;
    std::vector<Vec2> points;

    void add(FaceId face, Polygon polygon) {
        double lo = 1e300, hi = -1e300;
        for (const Vec2& p : polygon) lo = std::min(lo, p.y), hi = std::max(hi, p.y);
        rest_ = std::move(polygon);
        for (double y = std::floor(lo); y < hi && rest_.size() >= 3; ++y) {
            clip(rest_, 1, y + 1, -1, row_);
            clip(rest_, 1, y + 1, +1, spare_);
            std::swap(rest_, spare_);
            if (row_.size() >= 3) add_row(face, y);
        }
    }

private:
    const Chart& chart_;
    Polygon rest_, row_, cell_, spare_;

    void add_row(FaceId face, double y) {
        double lo = 1e300, hi = -1e300;             // in x
        double bottom[2] = {1e300, -1e300}, top[2] = {1e300, -1e300}; // extent on the two row lines
        for (const Vec2& p : row_) {
            lo = std::min(lo, p.x), hi = std::max(hi, p.x);
            if (p.y == y) bottom[0] = std::min(bottom[0], p.x), bottom[1] = std::max(bottom[1], p.x);
            if (p.y == y + 1) top[0] = std::min(top[0], p.x), top[1] = std::max(top[1], p.x);
        }
        // Convex: a square whose four corners are inside is inside.
        const double whole_from = std::max(bottom[0], top[0]), whole_to = std::min(bottom[1], top[1]);
        for (double x = std::floor(lo); x < hi; ++x) {
            if (x >= whole_from && x + 1 <= whole_to) {
                parts.push_back({texel(x, y), face, 1, {x + 0.5, y + 0.5}, 0, 0});
                continue;
            }
            clip(row_, 0, x, +1, spare_);
            clip(spare_, 0, x + 1, -1, cell_);
            if (cell_.size() < 3) continue;
            const Moments m = moments(cell_.data(), cell_.size());
            if (m.area < kSliver) continue;
            parts.push_back({texel(x, y), face, m.area, m.first, static_cast<std::uint32_t>(points.size()),
                             static_cast<std::uint32_t>(cell_.size())});
            points.insert(points.end(), cell_.begin(), cell_.end());
        }
    }
    std::uint32_t texel(double x, double y) const {
        KILN_CHECK(x >= 1 && y >= 1 && x < chart_.width - 1 && y < chart_.height - 1);
        return static_cast<std::uint32_t>(y) * chart_.width + static_cast<std::uint32_t>(x);
    }
};

// On lattice lines where rounding left it beside one.
Vec2 snapped(Vec2 p, const Chart& chart) {
    constexpr double kOnLine = 1e-7; // luxels
    const auto snap = [](double x, double last) {
        const double r = std::round(x);
        return std::clamp(std::abs(x - r) < kOnLine ? r : x, 1.0, last);
    };
    return {snap(p.x, chart.width - 1.0), snap(p.y, chart.height - 1.0)};
}

ChartLuxels cut_chart(const Surfaces& s, ChartId chart_id, const std::vector<FaceDraft>& drafts, const VertexTable& vertices) {
    const Chart& chart = s.charts[chart_id.at()];
    Cutter cutter(chart);
    for (const FaceId face : chart.faces) {
        for (const std::vector<Vec2>& seen : drafts[face.at()].seen) {
            Polygon polygon;
            for (const Vec2 v : seen) {
                const Vec2 p = snapped(v, chart);
                if (polygon.empty() || !(polygon.back() == p)) polygon.push_back(p);
            }
            if (polygon.size() >= 3) cutter.add(face, std::move(polygon));
        }
        for (const Loop& loop : drafts[face.at()].convex) {
            Polygon polygon;
            for (const VertexId v : loop) {
                const Vec2 p = snapped(luxel_from_world(s, face, vertices.position(v)), chart);
                if (polygon.empty() || !(polygon.back() == p)) polygon.push_back(p);
            }
            cutter.add(face, std::move(polygon));
        }
    }
    std::vector<Part>& parts = cutter.parts;
    std::ranges::stable_sort(parts, {}, [](const Part& p) { return std::tuple(p.texel, p.face); });

    ChartLuxels out;
    for (std::size_t first = 0, last; first < parts.size(); first = last) {
        Luxel luxel;
        luxel.chart = chart_id;
        luxel.x = static_cast<std::uint16_t>(parts[first].texel % chart.width);
        luxel.y = static_cast<std::uint16_t>(parts[first].texel / chart.width);
        luxel.first_piece = static_cast<std::uint32_t>(out.pieces.size());
        const Vec2 corner{static_cast<double>(luxel.x), static_cast<double>(luxel.y)};
        double area = 0, most = -1;
        Vec2 moment;
        for (last = first; last < parts.size() && parts[last].texel == parts[first].texel;) {
            const FaceId face = parts[last].face;
            const std::size_t from = last;
            double share = 0;
            for (; last < parts.size() && parts[last].texel == parts[first].texel && parts[last].face == face; ++last) {
                share += parts[last].area;
                moment = moment + parts[last].first_moment;
            }
            area += share;
            if (share > most) most = share, luxel.face = face;
            const auto piece = [&](const auto& polygon) {
                out.pieces.push_back({face, static_cast<std::uint32_t>(out.points.size()), static_cast<std::uint32_t>(polygon.size())});
                out.points.insert(out.points.end(), polygon.begin(), polygon.end());
            };
            if (share > 1 - kWhole) {
                piece(std::array<Vec2, 4>{corner, corner + Vec2{1, 0}, corner + Vec2{1, 1}, corner + Vec2{0, 1}});
            } else {
                for (std::size_t i = from; i < last; ++i)
                    piece(std::span<const Vec2>(cutter.points).subspan(parts[i].first_point, parts[i].point_count));
            }
        }
        luxel.area = static_cast<float>(area);
        luxel.centroid = moment * (1 / area);
        luxel.piece_count = static_cast<std::uint32_t>(out.pieces.size()) - luxel.first_piece;
        out.luxels.push_back(luxel);
    }
    return out;
}

} // namespace

void make_luxels(Surfaces& s, const std::vector<FaceDraft>& drafts, const VertexTable& vertices, Context& context) {
    std::vector<ChartLuxels> slots(s.charts.size());
    parallel_for(context, slots.size(), [&](std::size_t c) { slots[c] = cut_chart(s, id<ChartId>(c), drafts, vertices); });
    std::size_t luxels = 0, pieces = 0, points = 0;
    for (const ChartLuxels& slot : slots) luxels += slot.luxels.size(), pieces += slot.pieces.size(), points += slot.points.size();
    KILN_CHECK_OP(points, <, std::size_t{UINT32_MAX});
    s.luxels.reserve(luxels), s.pieces.reserve(pieces), s.piece_points.reserve(points);
    for (const ChartLuxels& slot : slots) {
        const auto first_piece = static_cast<std::uint32_t>(s.pieces.size()), first_point = static_cast<std::uint32_t>(s.piece_points.size());
        for (Luxel luxel : slot.luxels) luxel.first_piece += first_piece, s.luxels.push_back(luxel);
        for (LuxelPiece piece : slot.pieces) piece.first_point += first_point, s.pieces.push_back(piece);
        s.piece_points.insert(s.piece_points.end(), slot.points.begin(), slot.points.end());
    }
}

} // namespace kiln

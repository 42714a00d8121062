#include "compiler/surfaces/luxels.h"
#include "libs/core/check.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <cmath>
#include <span>
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
    std::uint32_t polygon;
    double area;
    Vec2 first_moment;
    std::uint32_t first_point, point_count; // 0 points: the whole square
};
struct Whole { // squares of one row, all of them in one polygon
    std::uint32_t first, last; // texels
    std::uint32_t polygon;
};

struct Luxels { // of some charts
    std::vector<Luxel> luxels;
    std::vector<LuxelPiece> pieces;
    std::vector<Vec2> points, centroids;
};

// Cuts polygons by the lattice of a chart, one after another.
class Cutter {
public:
    void begin(const Chart& chart) {
        chart_ = &chart;
        parts_.clear(), whole_.clear(), points_.clear(), face_of_.clear();
    }
    // `polygon` may be changed.
    void add(FaceId face, Polygon& polygon) {
        face_of_.push_back(face);
        if (add_rectangle(polygon)) return;
        double lo = 1e300, hi = -1e300;
        for (const Vec2& p : polygon) lo = std::min(lo, p.y), hi = std::max(hi, p.y);
        std::swap(rest_, polygon);
        for (double y = std::floor(lo); y < hi && rest_.size() >= 3; ++y) {
            clip(rest_, 1, y + 1, -1, row_);
            clip(rest_, 1, y + 1, +1, spare_);
            std::swap(rest_, spare_);
            if (row_.size() >= 3) add_row(y);
        }
    }
    void finish(ChartId chart, Luxels& out);

private:
    const Chart* chart_ = nullptr;
    std::vector<FaceId> face_of_; // of the polygons, ascending
    std::vector<Part> parts_, here_;
    std::vector<Whole> whole_, open_;
    std::vector<Vec2> points_;
    Polygon rest_, row_, cell_, spare_;

    std::uint32_t polygon() const { return static_cast<std::uint32_t>(face_of_.size()) - 1; }
    std::uint32_t texel(double x, double y) const {
        KILN_CHECK(x >= 1 && y >= 1 && x < chart_->width - 1 && y < chart_->height - 1);
        return static_cast<std::uint32_t>(y) * chart_->width + static_cast<std::uint32_t>(x);
    }
    // `kept`: those of the points that the piece keeps.
    void add_part(double x, double y, std::span<const Vec2> cell, std::span<const Vec2> kept) {
        const Moments m = moments(cell.data(), cell.size());
        if (m.area < kSliver) return;
        parts_.push_back({texel(x, y), polygon(), m.area, m.first, static_cast<std::uint32_t>(points_.size()), static_cast<std::uint32_t>(kept.size())});
        points_.insert(points_.end(), kept.begin(), kept.end());
    }

    void add_row(double y) {
        double lo = 1e300, hi = -1e300;             // in x
        double bottom[2] = {1e300, -1e300}, top[2] = {1e300, -1e300}; // extent on the two row lines
        for (const Vec2& p : row_) {
            lo = std::min(lo, p.x), hi = std::max(hi, p.x);
            if (p.y == y) bottom[0] = std::min(bottom[0], p.x), bottom[1] = std::max(bottom[1], p.x);
            if (p.y == y + 1) top[0] = std::min(top[0], p.x), top[1] = std::max(top[1], p.x);
        }
        // Convex: a square whose four corners are inside is inside.
        const double from = std::ceil(std::max(bottom[0], top[0])), to = std::floor(std::min(bottom[1], top[1]));
        if (from < to) whole_.push_back({texel(from, y), texel(to - 1, y), polygon()});
        for (double x = std::floor(lo); x < hi; ++x) {
            if (x == from && from < to) {
                x = to - 1;
                continue;
            }
            clip(row_, 0, x, +1, spare_);
            clip(spare_, 0, x + 1, -1, cell_);
            if (cell_.size() >= 3) add_part(x, y, cell_, cell_);
        }
    }

    // The same for what most polygons are, a rectangle along the lattice: every cell of it is one too, known at once.
    // `first`: which corner it begins with, 0: least x and y, then counter-clockwise; what is cut off moves it on as in clip.
    bool add_rectangle(const Polygon& p) {
        if (p.size() != 4) return false;
        std::uint32_t first = 0;
        while (first < 3 && !(p[(4 - first) % 4].x <= p[(6 - first) % 4].x && p[(4 - first) % 4].y <= p[(6 - first) % 4].y)) ++first;
        const Vec2 lo = p[(4 - first) % 4], hi = p[(6 - first) % 4], right = p[(5 - first) % 4], left = p[(7 - first) % 4];
        if (!(lo.x < hi.x && lo.y < hi.y && right.x == hi.x && right.y == lo.y && left.x == lo.x && left.y == hi.y)) return false;
        const double from = std::ceil(lo.x), to = std::floor(hi.x);
        for (double y = std::floor(lo.y); y < hi.y; ++y) {
            const double y0 = std::max(lo.y, y), y1 = std::min(hi.y, y + 1);
            std::uint32_t row_first = first;
            if (hi.y > y + 1) row_first = first == 2 ? 3 : first;
            if (first == 0) first = 1; // of the rest
            const bool full = y0 == y && y1 == y + 1 && from < to;
            if (full) whole_.push_back({texel(from, y), texel(to - 1, y), polygon()});
            for (double x = std::floor(lo.x); x < hi.x; ++x) {
                if (full && x == from) {
                    x = to - 1;
                    continue;
                }
                const double x0 = std::max(lo.x, x), x1 = std::min(hi.x, x + 1);
                std::uint32_t cell_first = row_first;
                if (lo.x < x && cell_first == 3) cell_first = 0;
                if (hi.x > x + 1 && cell_first == 1) cell_first = 2;
                const std::array<Vec2, 4> corners{{{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}}};
                std::array<Vec2, 4> cell;
                for (std::size_t i = 0; i < 4; ++i) cell[i] = corners[(cell_first + i) % 4];
                add_part(x, y, cell, std::array<Vec2, 2>{cell[0], cell[2]});
            }
        }
        return true;
    }

    void add_luxel(Luxels& out, ChartId chart, std::span<const Part> parts) const;
};

// Of one texel, ordered by polygon.
void Cutter::add_luxel(Luxels& out, ChartId chart, std::span<const Part> parts) const {
    Luxel luxel;
    luxel.chart = chart;
    luxel.x = static_cast<std::uint16_t>(parts[0].texel % chart_->width);
    luxel.y = static_cast<std::uint16_t>(parts[0].texel / chart_->width);
    luxel.first_piece = static_cast<std::uint32_t>(out.pieces.size());
    double area = 0, most = -1;
    Vec2 moment;
    for (std::size_t last = 0; last < parts.size();) {
        const FaceId face = face_of_[parts[last].polygon];
        const std::size_t from = last;
        double share = 0;
        for (; last < parts.size() && face_of_[parts[last].polygon] == face; ++last) {
            share += parts[last].area;
            moment = moment + parts[last].first_moment;
        }
        area += share;
        if (share > most) most = share, luxel.face = face;
        if (share > 1 - kWhole) {
            out.pieces.push_back(square_piece(face, luxel.x, luxel.y));
        } else {
            for (const Part& part : parts.subspan(from, last - from)) {
                out.pieces.push_back({face, static_cast<std::uint32_t>(out.points.size()), part.point_count});
                const auto points = std::span<const Vec2>(points_).subspan(part.first_point, part.point_count);
                out.points.insert(out.points.end(), points.begin(), points.end());
            }
        }
    }
    luxel.area = static_cast<float>(area);
    luxel.piece_count = static_cast<std::uint32_t>(out.pieces.size()) - luxel.first_piece;
    if (const Vec2 centroid = moment * (1 / area); centroid != Vec2{luxel.x + 0.5, luxel.y + 0.5}) {
        luxel.centroid = static_cast<std::uint32_t>(out.centroids.size());
        out.centroids.push_back(centroid);
    }
    out.luxels.push_back(luxel);
}

// The texels in order. Where nothing but whole squares of one polygon is, there is nothing to weigh up.
void Cutter::finish(ChartId chart, Luxels& out) {
    const auto by_part = [](const Part& p) { return std::tuple(p.texel, p.polygon); };
    const auto by_whole = [](const Whole& w) { return std::tuple(w.first, w.polygon); };
    if (!std::ranges::is_sorted(parts_, {}, by_part)) std::ranges::sort(parts_, {}, by_part);
    if (!std::ranges::is_sorted(whole_, {}, by_whole)) std::ranges::sort(whole_, {}, by_whole);
    constexpr std::uint32_t kNone = UINT32_MAX;
    std::uint32_t at = 0;
    std::size_t next_part = 0, next_whole = 0;
    const auto part_at = [&] { return next_part < parts_.size() ? parts_[next_part].texel : kNone; };
    const auto whole_at = [&] { return next_whole < whole_.size() ? whole_[next_whole].first : kNone; };
    open_.clear();
    for (;;) {
        std::erase_if(open_, [&](const Whole& w) { return w.last < at; });
        if (open_.empty()) at = std::min(part_at(), whole_at());
        if (at == kNone) break;
        while (whole_at() == at) open_.push_back(whole_[next_whole++]);
        if (open_.size() == 1 && part_at() != at) {
            const std::uint32_t end = std::min({open_[0].last + 1, part_at(), whole_at()});
            const FaceId face = face_of_[open_[0].polygon];
            std::uint32_t x = at % chart_->width;
            const std::uint32_t y = at / chart_->width;
            for (; at < end; ++at, ++x) {
                out.luxels.push_back({chart, static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y), face, 1, static_cast<std::uint32_t>(out.pieces.size()), 1});
                out.pieces.push_back(square_piece(face, x, y));
            }
            continue;
        }
        const std::size_t first_part = next_part;
        while (part_at() == at) ++next_part;
        std::span<const Part> parts(parts_.data() + first_part, next_part - first_part);
        if (!open_.empty()) { // rounding laid a sliver over a whole square
            here_.assign(parts.begin(), parts.end());
            const Vec2 corner{static_cast<double>(at % chart_->width), static_cast<double>(at / chart_->width)};
            for (const Whole& w : open_) here_.push_back({at, w.polygon, 1, corner + Vec2{0.5, 0.5}, 0, 0});
            std::ranges::sort(here_, {}, &Part::polygon);
            parts = here_;
        }
        add_luxel(out, chart, parts);
        ++at;
    }
}

// On lattice lines where rounding left it beside one.
Vec2 snapped(Vec2 p, const Chart& chart) {
    constexpr double kOnLine = 1e-7; // luxels
    const auto snap = [](double x, double last) {
        const double r = std::round(x);
        return std::clamp(std::abs(x - r) < kOnLine ? r : x, 1.0, last);
    };
    return {snap(p.x, chart.width - 1.0), snap(p.y, chart.height - 1.0)};
}

void cut_chart(const Surfaces& s, ChartId chart_id, const std::vector<FaceDraft>& drafts, const VertexTable& vertices, Cutter& cutter, Luxels& out) {
    const Chart& chart = s.charts[chart_id.at()];
    cutter.begin(chart);
    Polygon polygon;
    const auto add_point = [&](Vec2 at) {
        const Vec2 p = snapped(at, chart);
        if (polygon.empty() || !(polygon.back() == p)) polygon.push_back(p);
    };
    for (const FaceId face : chart.faces) {
        for (const std::vector<Vec2>& seen : drafts[face.at()].seen) {
            polygon.clear();
            for (const Vec2 v : seen) add_point(v);
            if (polygon.size() >= 3) cutter.add(face, polygon);
        }
        for (const Loop& loop : drafts[face.at()].convex) {
            polygon.clear();
            for (const VertexId v : loop) add_point(luxel_from_world(s, face, vertices.position(v)));
            cutter.add(face, polygon);
        }
    }
    cutter.finish(chart_id, out);
}

// Room for `more`. The share of all that is done tells how much there will be: doubling would hold half as much again.
template <class T> void make_room(std::vector<T>& table, std::size_t more, double done) {
    constexpr double kSlack = 1.03; // the charts to come may be fuller
    const std::size_t size = table.size() + more;
    if (size > table.capacity()) table.reserve(std::max(size, static_cast<std::size_t>(static_cast<double>(size) / done * kSlack)));
}

} // namespace

void make_luxels(Surfaces& s, const std::vector<FaceDraft>& drafts, const VertexTable& vertices, Context& context) {
    // Charts are cut some at a time, so that no luxel has to be kept twice for long.
    constexpr std::uint32_t kChunkTexels = 1 << 14; // of charts that share a slot
    constexpr std::size_t kSlots = 64;
    std::vector<Luxels> slots(kSlots);
    for (std::size_t chart = 0; chart < s.charts.size();) {
        std::vector<std::size_t> first{chart};
        while (chart < s.charts.size() && first.size() <= kSlots) {
            std::uint32_t texels = 0;
            for (; chart < s.charts.size() && texels < kChunkTexels; ++chart) texels += s.charts[chart].width * s.charts[chart].height;
            first.push_back(chart);
        }
        parallel_for(context, first.size() - 1, [&](std::size_t i) {
            Cutter cutter;
            for (std::size_t c = first[i]; c < first[i + 1]; ++c) cut_chart(s, id<ChartId>(c), drafts, vertices, cutter, slots[i]);
        });
        std::size_t luxels = 0, pieces = 0, points = 0, centroids = 0;
        for (const Luxels& slot : slots) luxels += slot.luxels.size(), pieces += slot.pieces.size(), points += slot.points.size(), centroids += slot.centroids.size();
        KILN_CHECK_OP(s.piece_points.size() + points, <, std::size_t{UINT32_MAX});
        const double done = (chart < s.charts.size() ? s.charts[chart].first_texel : s.texel_count) / static_cast<double>(s.texel_count);
        make_room(s.luxels, luxels, done), make_room(s.pieces, pieces, done);
        make_room(s.piece_points, points, done), make_room(s.centroids, centroids, done);
        for (Luxels& slot : slots) {
            const auto first_piece = static_cast<std::uint32_t>(s.pieces.size()), first_point = static_cast<std::uint32_t>(s.piece_points.size()),
                       first_centroid = static_cast<std::uint32_t>(s.centroids.size());
            for (Luxel luxel : slot.luxels) {
                luxel.first_piece += first_piece;
                if (luxel.centroid != UINT32_MAX) luxel.centroid += first_centroid;
                s.luxels.push_back(luxel);
            }
            for (LuxelPiece piece : slot.pieces) {
                if (!piece.square()) piece.first_point += first_point;
                s.pieces.push_back(piece);
            }
            s.piece_points.insert(s.piece_points.end(), slot.points.begin(), slot.points.end());
            s.centroids.insert(s.centroids.end(), slot.centroids.begin(), slot.centroids.end());
            slot.luxels.clear(), slot.pieces.clear(), slot.points.clear(), slot.centroids.clear();
        }
    }
}

} // namespace kiln

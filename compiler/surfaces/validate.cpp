#include "compiler/surfaces/charts.h"
#include "compiler/surfaces/surfaces.h"
#include "libs/core/check.h"
#include <algorithm>
#include <cmath>
#include <tuple>

namespace kiln {
namespace {

constexpr double kUnit = 1e-9;      // deviation of a double unit vector
constexpr double kUnitFloat = 1e-5; // and of a float one

void check_frame(const Frame& f, Vec3 n) {
    KILN_CHECK(std::abs(length(f.t) - 1) < kUnit && std::abs(length(f.b) - 1) < kUnit && f.n == n);
    KILN_CHECK(std::abs(dot(f.t, f.b)) < kUnit && std::abs(dot(f.t, n)) < kUnit && std::abs(dot(f.b, n)) < kUnit);
}

void check_faces(const Surfaces& s) {
    KILN_CHECK_OP(s.triangle_face.size(), ==, s.triangles.size());
    KILN_CHECK_OP(s.corner_normals.size(), ==, s.triangles.size());
    std::uint32_t next = 0;
    for (std::size_t f = 0; f < s.faces.size(); ++f) {
        const Face& face = s.faces[f];
        KILN_CHECK_OP(face.first_triangle, ==, next);
        next += face.triangle_count;
        KILN_CHECK_OP(next, <=, s.triangles.size());
        KILN_CHECK(std::abs(length(face.normal) - 1) < kUnit);
        check_frame(face.tangent, face.normal);
        KILN_CHECK(std::ranges::is_sorted(face.clusters));
        KILN_CHECK(!face.chart.valid() || (face.chart.at() < s.charts.size() && face.drawn));
        double area = 0, largest = 0;
        for (std::uint32_t t = face.first_triangle; t < next; ++t) {
            KILN_CHECK(s.triangle_face[t] == id<FaceId>(f));
            for (const std::uint32_t p : s.triangles[t]) KILN_CHECK_OP(p, <, s.positions.size());
            const Vec3 a = s.positions[s.triangles[t][0]], b = s.positions[s.triangles[t][1]], c = s.positions[s.triangles[t][2]];
            largest = std::max({largest, length(b - a), length(c - b)});
            const double signed_area = 0.5 * dot(cross(b - a, c - a), face.normal);
            KILN_CHECK_OP(signed_area, >=, -1e-7 * std::max(1.0, largest)); // rounding may fold what has no area
            area += signed_area;
            for (const Vec3f& n : s.corner_normals[t]) KILN_CHECK(std::abs(length(n) - 1) < kUnitFloat);
        }
        KILN_CHECK_OP(std::abs(area - face.area), <=, 1e-6 * face.area + 1e-7 * std::max(1.0, largest));
    }
    KILN_CHECK_OP(next, ==, s.triangles.size());
}

void check_overlays(const Surfaces& s) {
    std::uint32_t next = 0;
    const OverlayFragment* last = nullptr;
    for (const OverlayFragment& f : s.overlay_fragments) {
        KILN_CHECK_OP(f.first_point, ==, next);
        KILN_CHECK_OP(f.point_count, >=, 3u);
        next += f.point_count;
        KILN_CHECK_OP(f.face.at(), <, s.faces.size());
        KILN_CHECK(s.faces[f.face.at()].drawn);
        KILN_CHECK(!last || std::tuple(last->overlay, last->face) <= std::tuple(f.overlay, f.face));
        last = &f;
    }
    KILN_CHECK_OP(next, ==, s.overlay_points.size());
}

void check_charts(const Surfaces& s) {
    std::uint64_t texels = 0;
    for (std::size_t c = 0; c < s.charts.size(); ++c) {
        const Chart& chart = s.charts[c];
        KILN_CHECK_OP(chart.first_texel, ==, texels);
        texels += std::uint64_t{chart.width} * chart.height;
        KILN_CHECK(chart.width >= 3 && chart.height >= 3 && chart.width <= kMaxChartTexels && chart.height <= kMaxChartTexels);
        KILN_CHECK(!chart.faces.empty() && chart.luxel_size > 0);
        KILN_CHECK(length(cross(chart.s, chart.t) - chart.n) < kUnit);
        check_frame(chart.frame, chart.n);
        for (const FaceId f : chart.faces) KILN_CHECK(s.faces[f.at()].chart == id<ChartId>(c));
    }
    KILN_CHECK_OP(texels, ==, s.texel_count);
    for (const Seam& e : s.seams) {
        KILN_CHECK(e.chart_a < e.chart_b && e.chart_b.at() < s.charts.size());
        KILN_CHECK(e.from < s.positions.size() && e.to < s.positions.size());
    }
}

void check_luxels(const Surfaces& s) {
    std::vector<double> covered(s.charts.size(), 0.0);
    std::uint32_t next_piece = 0, next_point = 0;
    for (std::size_t i = 0; i < s.luxels.size(); ++i) {
        const Luxel& l = s.luxels[i];
        const Chart& chart = s.charts.at(l.chart.at());
        if (i > 0) {
            const Luxel& k = s.luxels[i - 1];
            KILN_CHECK(std::tuple(k.chart, k.y, k.x) < std::tuple(l.chart, l.y, l.x));
        }
        KILN_CHECK(l.x >= 1 && l.y >= 1 && l.x < chart.width - 1 && l.y < chart.height - 1); // never in the gutter
        KILN_CHECK(l.area > 0 && l.area < 1 + 1e-5f && l.piece_count > 0);
        constexpr double kSlack = 1e-6;
        KILN_CHECK(l.centroid.x > l.x - kSlack && l.centroid.x < l.x + 1 + kSlack && l.centroid.y > l.y - kSlack && l.centroid.y < l.y + 1 + kSlack);
        KILN_CHECK_OP(l.first_piece, ==, next_piece);
        next_piece += l.piece_count;
        double area = 0;
        for (std::uint32_t p = l.first_piece; p < next_piece; ++p) {
            const LuxelPiece& piece = s.pieces.at(p);
            KILN_CHECK(s.faces.at(piece.face.at()).chart == l.chart);
            KILN_CHECK_OP(piece.first_point, ==, next_point);
            KILN_CHECK_OP(piece.point_count, >=, 3u);
            next_point += piece.point_count;
            const Vec2 p0 = s.piece_points.at(piece.first_point);
            for (std::uint32_t k = 1; k + 1 < piece.point_count; ++k)
                area += 0.5 * cross(s.piece_points.at(piece.first_point + k) - p0, s.piece_points.at(piece.first_point + k + 1) - p0);
        }
        KILN_CHECK_OP(std::abs(area - l.area), <, 1e-6);
        covered[l.chart.at()] += l.area;
    }
    KILN_CHECK_OP(next_piece, ==, s.pieces.size());
    KILN_CHECK_OP(next_point, ==, s.piece_points.size());
    for (std::size_t c = 0; c < s.charts.size(); ++c) {
        const Chart& chart = s.charts[c];
        double area = 0;
        const double squared = chart.luxel_size * chart.luxel_size, reach = chart.width + chart.height;
        if (chart.curved()) continue; // check_curves
        for (const FaceId f : chart.faces) area += s.faces[f.at()].area;
        KILN_CHECK_OP(std::abs(covered[c] * squared - area), <=, 1e-6 * area + 1e-7 * squared * reach);
    }
}

void check_curves(const Surfaces& s) {
    std::size_t next = std::min<std::size_t>(s.first_curved_face, s.faces.size()), corner = 0;
    for (std::size_t f = 0; f < next; ++f) KILN_CHECK(!s.faces[f].curved() && s.faces[f].plane.valid());
    KILN_CHECK_OP(s.luxel_maps.size(), ==, s.faces.size() - next);
    std::vector<double> covered(s.faces.size(), 0.0); // map units squared
    for (const LuxelPiece& piece : s.pieces) {
        if (!s.faces[piece.face.at()].curved()) continue;
        double area = 0;
        const Vec2 p0 = s.piece_points[piece.first_point];
        for (std::uint32_t k = 1; k + 1 < piece.point_count; ++k)
            area += 0.5 * cross(s.piece_points[piece.first_point + k] - p0, s.piece_points[piece.first_point + k + 1] - p0);
        covered[piece.face.at()] += area * luxel_area(s, piece.face);
    }
    for (std::size_t c = 0; c < s.curves.size(); ++c) {
        const Curve& curve = s.curves[c];
        KILN_CHECK_OP(curve.first_face, ==, next);
        KILN_CHECK_OP(curve.grid.size(), ==, std::size_t{curve.columns} * curve.rows);
        KILN_CHECK_OP(curve.uv.size(), ==, curve.grid.size());
        for (const std::uint32_t p : curve.grid) KILN_CHECK_OP(p, <, s.positions.size());
        next += curve.face_count;
        for (std::size_t f = curve.first_face; f < next; ++f) {
            const Face& face = s.faces[f];
            KILN_CHECK_OP(face.curve, ==, c);
            KILN_CHECK(!face.hull && !face.plane.valid());
            if (face.chart.valid()) KILN_CHECK_OP(s.charts[face.chart.at()].curve, ==, c);
            for (std::uint32_t t = face.first_triangle; t < face.first_triangle + face.triangle_count; ++t, ++corner) {
                const auto& corners = s.curve_corners.at(corner);
                if (!face.chart.valid()) continue;
                const Chart& chart = s.charts[face.chart.at()];
                for (std::size_t k = 0; k < 3; ++k) {
                    const Vec3 p = s.positions[s.triangles[t][k]];
                    const Vec2 l = corners[k].luxel;
                    constexpr double kRounding = 1e-6; // map units, luxels: the map is of doubles
                    KILN_CHECK(l.x > 1 - kRounding && l.y > 1 - kRounding && l.x < chart.width - 1 + kRounding && l.y < chart.height - 1 + kRounding);
                    KILN_CHECK_OP(length(world_from_luxel(s, id<FaceId>(f), l) - p), <, kRounding);
                }
            }
            KILN_CHECK_OP(covered[f], <=, face.area * (1 + 1e-5) + 1e-6);
        }
    }
    KILN_CHECK_OP(next, ==, s.faces.size());
    KILN_CHECK_OP(corner, ==, s.curve_corners.size());
}

} // namespace

void validate(const Surfaces& surfaces) {
    check_faces(surfaces);
    check_charts(surfaces);
    check_luxels(surfaces);
    check_overlays(surfaces);
    check_curves(surfaces);
}

std::size_t unmatched_curve_edges(const Surfaces& s, ModelId model, Curve::Kind kind) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> forward, backward, open;
    for (std::size_t t = 0; t < s.triangles.size(); ++t) {
        const Face& face = s.faces[s.triangle_face[t].at()];
        if (!face.curved() || face.model != model || s.curves[face.curve].kind != kind) continue;
        for (std::size_t c = 0; c < 3; ++c) {
            const std::uint32_t a = s.triangles[t][c], b = s.triangles[t][(c + 1) % 3];
            forward.emplace_back(a, b), backward.emplace_back(b, a);
        }
    }
    std::ranges::sort(forward);
    std::ranges::sort(backward);
    std::ranges::set_difference(forward, backward, std::back_inserter(open));
    return open.size();
}

std::size_t unmatched_hull_edges(const Surfaces& s, ModelId model) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> forward, backward;
    for (std::size_t t = 0; t < s.triangles.size(); ++t) {
        const Face& face = s.faces[s.triangle_face[t].at()];
        if (!face.hull || face.model != model) continue;
        for (std::size_t c = 0; c < 3; ++c) {
            const std::uint32_t a = s.triangles[t][c], b = s.triangles[t][(c + 1) % 3];
            forward.emplace_back(a, b), backward.emplace_back(b, a);
        }
    }
    std::ranges::sort(forward);
    std::ranges::sort(backward);
    std::vector<std::pair<std::uint32_t, std::uint32_t>> open;
    std::ranges::set_difference(forward, backward, std::back_inserter(open));
    return open.size();
}

} // namespace kiln

#include "compiler/surfaces/charts.h"
#include "compiler/surfaces/surfaces.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <tuple>

namespace kiln {
namespace {

constexpr double kUnit = 1e-9;      // deviation of a double unit vector
constexpr double kUnitFloat = 1e-5; // and of a float one

class Reader { // of the tables, with the places of what is found
public:
    Reader(const Surfaces& surfaces, const World* world, Checker& checker) : s(surfaces), world_(world), checker_(checker) {}

    void check() {
        if (!check_faces() || !check_charts()) return; // what reads indices needs them sound
        check_overlays();
        if (check_luxels()) check_curves();
    }

private:
    const Surfaces& s;
    const World* world_;
    Checker& checker_;

    SourceLocation side(SideId id) const { return world_ ? world_->location(id) : SourceLocation{}; }
    static bool is_frame(const Frame& f, Vec3 n) {
        return std::abs(length(f.t) - 1) < kUnit && std::abs(length(f.b) - 1) < kUnit && f.n == n && std::abs(dot(f.t, f.b)) < kUnit &&
               std::abs(dot(f.t, n)) < kUnit && std::abs(dot(f.b, n)) < kUnit;
    }

    bool check_faces() {
        Check &faces = checker_.add("faces"), &triangles = checker_.add("triangles");
        triangles.expect(s.triangle_face.size() == s.triangles.size() && s.corner_normals.size() == s.triangles.size(),
                         [&] { return Finding{side({}), "the tables of triangles differ in length"}; });
        for (std::size_t t = 0; t < s.triangles.size(); ++t)
            triangles.expect(std::ranges::all_of(s.triangles[t], [&](std::uint32_t p) { return p < s.positions.size(); }),
                             [&] { return Finding{side({}), fmt::format("triangle {} names a position that does not exist", t)}; });
        if (!triangles.ok()) return false;
        std::uint64_t next = 0;
        for (std::size_t f = 0; f < s.faces.size(); ++f) {
            const Face& face = s.faces[f];
            const auto tell = [&](const char* what) { return [&, what] { return Finding{side(face.side), fmt::format("face {}: {}", f, what)}; }; };
            if (!faces.expect(face.first_triangle == next && next + face.triangle_count <= s.triangles.size(), tell("its triangles do not follow those of the face before"))) return false;
            next += face.triangle_count;
            faces.expect(std::abs(length(face.normal) - 1) < kUnit, tell("its normal is not unit"));
            faces.expect(is_frame(face.tangent, face.normal), tell("its tangent frame is not orthonormal"));
            faces.expect(std::ranges::is_sorted(face.clusters), tell("its clusters are not sorted"));
            faces.expect(!face.chart.valid() || (face.chart.at() < s.charts.size() && face.drawn), tell("its chart does not exist, or it has one and is not drawn"));
            double area = 0, largest = 0;
            for (std::uint32_t t = face.first_triangle; t < next; ++t) {
                triangles.expect(s.triangle_face[t] == id<FaceId>(f), tell("a triangle of it belongs to another face"));
                const Vec3 a = s.positions[s.triangles[t][0]], b = s.positions[s.triangles[t][1]], c = s.positions[s.triangles[t][2]];
                largest = std::max({largest, length(b - a), length(c - b)});
                const double signed_area = 0.5 * dot(cross(b - a, c - a), face.normal);
                triangles.expect(signed_area >= -1e-7 * std::max(1.0, largest), tell("a triangle faces the wrong way")); // rounding may fold what has no area
                area += signed_area;
                for (const Vec3f& n : s.corner_normals[t]) triangles.expect(std::abs(length(n) - 1) < kUnitFloat, tell("a corner normal is not unit"));
            }
            faces.expect(std::abs(area - face.area) <= 1e-6 * face.area + 1e-7 * std::max(1.0, largest), tell("its triangles do not add up to its area"));
        }
        faces.expect(next == s.triangles.size(), [&] { return Finding{side({}), "some triangles belong to no face"}; });
        return faces.ok() && triangles.ok();
    }

    bool check_charts() {
        Check &charts = checker_.add("charts"), &seams = checker_.add("seams");
        std::uint64_t texels = 0;
        for (std::size_t c = 0; c < s.charts.size(); ++c) {
            const Chart& chart = s.charts[c];
            const auto tell = [&](const char* what) {
                return [&, what] {
                    const bool named = !chart.faces.empty() && chart.faces[0].at() < s.faces.size();
                    return Finding{side(named ? s.faces[chart.faces[0].at()].side : SideId{}), fmt::format("chart {}: {}", c, what)};
                };
            };
            charts.expect(chart.first_texel == texels, tell("its texels do not follow those of the chart before"));
            texels += std::uint64_t{chart.width} * chart.height;
            charts.expect(chart.width >= 3 && chart.height >= 3 && chart.width <= kMaxChartTexels && chart.height <= kMaxChartTexels, tell("its size cannot be"));
            charts.expect(!chart.faces.empty() && chart.luxel_size > 0, tell("it has no faces, or luxels of no size"));
            charts.expect(length(cross(chart.s, chart.t) - chart.n) < kUnit, tell("its axes are not orthonormal"));
            charts.expect(is_frame(chart.frame, chart.n), tell("its tangent frame is not orthonormal"));
            for (const FaceId f : chart.faces)
                charts.expect(f.at() < s.faces.size() && s.faces[f.at()].chart == id<ChartId>(c), tell("it lists a face that has another chart"));
        }
        charts.expect(texels == s.texel_count, [&] { return Finding{side({}), fmt::format("the charts have {} texels, {} are stated", texels, s.texel_count)}; });
        for (const Seam& e : s.seams)
            seams.expect(e.chart_a <= e.chart_b && e.chart_b.at() < s.charts.size() && e.from < s.positions.size() && e.to < s.positions.size(),
                         [&] { return Finding{side({}), fmt::format("a seam between charts {} and {} names what does not exist", e.chart_a.value, e.chart_b.value)}; });
        return charts.ok();
    }

    bool check_luxels() {
        Check &luxels = checker_.add("luxels"), &cover = checker_.add("luxel-cover");
        std::vector<double> covered(s.charts.size(), 0.0);
        std::uint64_t next_piece = 0, next_point = 0, next_centroid = 0;
        for (std::size_t i = 0; i < s.luxels.size(); ++i) {
            const Luxel& l = s.luxels[i];
            const auto tell = [&](const char* what) {
                return [&, what] { return Finding{side(l.face.at() < s.faces.size() ? s.faces[l.face.at()].side : SideId{}), fmt::format("luxel {} {} of chart {}: {}", l.x, l.y, l.chart.value, what)}; };
            };
            if (!luxels.expect(l.chart.at() < s.charts.size() && l.face.at() < s.faces.size(), tell("its chart or face does not exist"))) return false;
            const Chart& chart = s.charts[l.chart.at()];
            if (i > 0) {
                const Luxel& k = s.luxels[i - 1];
                luxels.expect(std::tuple(k.chart, k.y, k.x) < std::tuple(l.chart, l.y, l.x), tell("it is not in order"));
            }
            luxels.expect(l.x >= 1 && l.y >= 1 && l.x < chart.width - 1 && l.y < chart.height - 1, tell("it lies in the gutter"));
            luxels.expect(l.area > 0 && l.area < 1 + 1e-5f && l.piece_count > 0, tell("its footprint has no area, or more than a texel"));
            constexpr double kSlack = 1e-6;
            if (l.centroid != UINT32_MAX && !luxels.expect(l.centroid == next_centroid++ && l.centroid < s.centroids.size(), tell("its centroid does not follow that of a luxel before"))) return false;
            const Vec2 centroid = centroid_of(s, l);
            luxels.expect(centroid.x > l.x - kSlack && centroid.x < l.x + 1 + kSlack && centroid.y > l.y - kSlack && centroid.y < l.y + 1 + kSlack, tell("its centroid lies outside its square"));
            if (!luxels.expect(l.first_piece == next_piece && next_piece + l.piece_count <= s.pieces.size(), tell("its pieces do not follow those of the luxel before"))) return false;
            next_piece += l.piece_count;
            double area = 0;
            for (std::uint64_t p = l.first_piece; p < next_piece; ++p) {
                const LuxelPiece& piece = s.pieces[p];
                luxels.expect(piece.face.at() < s.faces.size() && s.faces[piece.face.at()].chart == l.chart, tell("a piece is of a face of another chart"));
                if (!piece.square() &&
                    !luxels.expect(piece.first_point == next_point && piece.point_count >= 2 && next_point + piece.point_count <= s.piece_points.size(), tell("the points of a piece do not follow those of the piece before")))
                    return false;
                next_point += piece.point_count;
                const PiecePoints q = points_of(s, piece);
                bool within = true;
                for (std::size_t k = 0; k < q.size(); ++k)
                    within = within && q[k].x > l.x - kSlack && q[k].x < l.x + 1 + kSlack && q[k].y > l.y - kSlack && q[k].y < l.y + 1 + kSlack;
                luxels.expect(within, tell("a piece reaches out of its square"));
                for (std::size_t k = 1; k + 1 < q.size(); ++k) area += 0.5 * cross(q[k] - q[0], q[k + 1] - q[0]);
            }
            luxels.expect(std::abs(area - l.area) < 1e-6, tell("its pieces do not add up to its area"));
            covered[l.chart.at()] += l.area;
        }
        luxels.expect(next_piece == s.pieces.size() && next_point == s.piece_points.size() && next_centroid == s.centroids.size(), [&] { return Finding{side({}), "some pieces or centroids belong to no luxel"}; });
        for (std::size_t c = 0; c < s.charts.size(); ++c) {
            const Chart& chart = s.charts[c];
            if (chart.curved()) continue; // check_curves
            double area = 0;
            for (const FaceId f : chart.faces) area += s.faces[f.at()].area;
            const double squared = chart.luxel_size * chart.luxel_size, reach = chart.width + chart.height;
            cover.expect(std::abs(covered[c] * squared - area) <= 1e-6 * area + 1e-7 * squared * reach, [&] {
                return Finding{side(s.faces[chart.faces[0].at()].side), fmt::format("chart {}: its luxels cover {} square units, its faces are {}", c, covered[c] * squared, area)};
            });
        }
        return luxels.ok();
    }

    void check_overlays() {
        Check& overlays = checker_.add("overlays");
        std::uint32_t next = 0;
        const OverlayFragment* last = nullptr;
        for (std::size_t i = 0; i < s.overlay_fragments.size(); ++i) {
            const OverlayFragment& f = s.overlay_fragments[i];
            const auto tell = [&](const char* what) {
                return [&, what] { return Finding{side(f.face.at() < s.faces.size() ? s.faces[f.face.at()].side : SideId{}), fmt::format("part {} of overlay {}: {}", i, f.overlay, what)}; };
            };
            overlays.expect(f.first_point == next && f.point_count >= 3, tell("its points do not follow those of the part before, or are less than three"));
            next += f.point_count;
            if (overlays.expect(f.face.at() < s.faces.size(), tell("its face does not exist"))) overlays.expect(s.faces[f.face.at()].drawn, tell("its face is not drawn"));
            overlays.expect(!last || std::tuple(last->overlay, last->face) <= std::tuple(f.overlay, f.face), tell("it is not in order"));
            last = &f;
        }
        overlays.expect(next == s.overlay_points.size(), [&] { return Finding{side({}), "some points belong to no part of an overlay"}; });
    }

    void check_curves() {
        Check &curves = checker_.add("curves"), &cover = checker_.add("curve-luxels");
        std::size_t next = std::min<std::size_t>(s.first_curved_face, s.faces.size()), corner = 0;
        for (std::size_t f = 0; f < next; ++f)
            curves.expect(!s.faces[f].curved() && s.faces[f].plane.valid(), [&] { return Finding{side(s.faces[f].side), fmt::format("face {} stands among those of brushes, but is of a curve or has no plane", f)}; });
        if (!curves.expect(s.luxel_maps.size() == s.faces.size() - next, [&] { return Finding{side({}), "the luxel maps are not as many as curved faces"}; })) return;
        std::vector<double> covered(s.faces.size(), 0.0); // map units squared
        for (const LuxelPiece& piece : s.pieces) {
            if (!s.faces[piece.face.at()].curved()) continue;
            double area = 0;
            const PiecePoints p = points_of(s, piece);
            for (std::size_t k = 1; k + 1 < p.size(); ++k) area += 0.5 * cross(p[k] - p[0], p[k + 1] - p[0]);
            covered[piece.face.at()] += area * luxel_area(s, piece.face);
        }
        for (std::size_t c = 0; c < s.curves.size(); ++c) {
            const Curve& curve = s.curves[c];
            const auto tell = [&](const char* what) { return [&, what] { return Finding{curve_place(c), fmt::format("curve {}: {}", c, what)}; }; };
            if (!curves.expect(curve.first_face == next && next + curve.face_count <= s.faces.size(), tell("its faces do not follow those of the curve before"))) return;
            curves.expect(curve.grid.size() == std::size_t{curve.columns} * curve.rows && curve.uv.size() == curve.grid.size(), tell("its tables do not fit its size"));
            curves.expect(std::ranges::all_of(curve.grid, [&](std::uint32_t p) { return p < s.positions.size(); }), tell("a vertex of its grid does not exist"));
            next += curve.face_count;
            for (std::size_t f = curve.first_face; f < next; ++f) {
                const Face& face = s.faces[f];
                curves.expect(face.curve == c && !face.hull && !face.plane.valid(), tell("a face of it is of another curve, part of a hull, or has an exact plane"));
                curves.expect(!face.chart.valid() || s.charts[face.chart.at()].curve == c, tell("a face of it has the chart of something else"));
                for (std::uint32_t t = face.first_triangle; t < face.first_triangle + face.triangle_count; ++t, ++corner) {
                    if (!curves.expect(corner < s.curve_corners.size(), tell("a triangle of it has no corners of a curve"))) return;
                    if (!face.chart.valid()) continue;
                    const Chart& chart = s.charts[face.chart.at()];
                    for (std::size_t k = 0; k < 3; ++k) {
                        const Vec2 l = s.curve_corners[corner][k].luxel;
                        constexpr double kRounding = 1e-6; // map units, luxels: the map is of doubles
                        cover.expect(l.x > 1 - kRounding && l.y > 1 - kRounding && l.x < chart.width - 1 + kRounding && l.y < chart.height - 1 + kRounding, tell("a corner lies outside its chart"));
                        cover.expect(length(world_from_luxel(s, id<FaceId>(f), l) - s.positions[s.triangles[t][k]]) < kRounding, tell("the luxel coordinates of a corner lead elsewhere"));
                    }
                }
                cover.expect(covered[f] <= face.area * (1 + 1e-5) + 1e-6, tell("its luxels cover more than a face has"));
            }
        }
        curves.expect(next == s.faces.size() && corner == s.curve_corners.size(), [&] { return Finding{side({}), "some curved faces or corners belong to no curve"}; });
    }
    SourceLocation curve_place(std::size_t c) const {
        const Curve& curve = s.curves[c];
        return world_ && curve.first_face < s.faces.size() ? location_of(*world_, s, id<FaceId>(curve.first_face)) : SourceLocation{};
    }
};

} // namespace

void check_invariants(const Surfaces& surfaces, const World* world, Checker& checker) { Reader(surfaces, world, checker).check(); }

void validate(const Surfaces& surfaces) {
    Checker checker;
    check_invariants(surfaces, nullptr, checker);
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

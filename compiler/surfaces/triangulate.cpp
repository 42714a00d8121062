// Constrained Delaunay triangulation by CGAL. The library sees rounded points, but every question it asks about them is
// answered for the exact ones.
#include "compiler/surfaces/regions.h"
#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>
#include <cmath>

namespace kiln {
namespace {

using Base = CGAL::Exact_predicates_inexact_constructions_kernel;

struct FacePoint : Base::Point_2 {
    FacePoint() = default;
    FacePoint(double x, double y, VertexId v, PlaneId before, PlaneId after)
        : Base::Point_2(x, y), vertex(v), lines{before.value | 1u, after.value | 1u} {}
    VertexId vertex;
    std::array<std::uint32_t, 2> lines{}; // the edges that meet here: planes without facing
};

struct Question {
    const VertexTable* vertices;
    Projection axes;
};

bool share_line(const FacePoint& a, const FacePoint& b, const FacePoint& c) {
    for (const std::uint32_t line : a.lines)
        if ((line == b.lines[0] || line == b.lines[1]) && (line == c.lines[0] || line == c.lines[1])) return true;
    return false;
}

class ExactTraits : public Base {
public:
    using Point_2 = FacePoint;
    ExactTraits() = default;
    explicit ExactTraits(Question q) : q_(q) {}

    struct Construct_point_2 {
        const FacePoint& operator()(const FacePoint& p) const { return p; }
    };
    struct Orientation_2 : Question {
        CGAL::Orientation operator()(const FacePoint& a, const FacePoint& b, const FacePoint& c) const {
            if (share_line(a, b, c)) return CGAL::COLLINEAR; // T-junctions: the greater part of what is zero
            return static_cast<CGAL::Orientation>(vertices->turn(a.vertex, b.vertex, c.vertex, axes));
        }
    };
    struct Compare_x_2 : Question {
        CGAL::Comparison_result operator()(const FacePoint& a, const FacePoint& b) const {
            return static_cast<CGAL::Comparison_result>(vertices->compare(a.vertex, b.vertex, axes.u));
        }
    };
    struct Compare_y_2 : Question {
        CGAL::Comparison_result operator()(const FacePoint& a, const FacePoint& b) const {
            return static_cast<CGAL::Comparison_result>(vertices->compare(a.vertex, b.vertex, axes.v));
        }
    };
    struct Less_x_2 : Question {
        bool operator()(const FacePoint& a, const FacePoint& b) const { return vertices->compare(a.vertex, b.vertex, axes.u) < 0; }
    };
    struct Less_y_2 : Question {
        bool operator()(const FacePoint& a, const FacePoint& b) const { return vertices->compare(a.vertex, b.vertex, axes.v) < 0; }
    };
    // Which diagonal of a quadrilateral: any is right, so "on the circle" stands for all that rounding leaves open. Every
    // flip then is one that the exact points ask for, and flipping comes to an end.
    struct Side_of_oriented_circle_2 : Question {
        CGAL::Oriented_side operator()(const FacePoint& a, const FacePoint& b, const FacePoint& c, const FacePoint& d) const {
            const double r = 4 * vertices->rounding(); // of a difference
            const double ax = a.x() - d.x(), ay = a.y() - d.y(), bx = b.x() - d.x(), by = b.y() - d.y(), cx = c.x() - d.x(), cy = c.y() - d.y();
            const double a2 = ax * ax + ay * ay, b2 = bx * bx + by * by, c2 = cx * cx + cy * cy;
            const double value = a2 * (bx * cy - by * cx) + b2 * (cx * ay - cy * ax) + c2 * (ax * by - ay * bx);
            // With every length at most m: each of twelve products of four is off by 4 m^3 r and by some roundings of m^4.
            const double m = std::sqrt(std::max({a2, b2, c2})) + r;
            const double bound = 64 * m * m * m * r + m * m * m * m * 0x1p-46;
            return value > bound ? CGAL::ON_POSITIVE_SIDE : value < -bound ? CGAL::ON_NEGATIVE_SIDE : CGAL::ON_ORIENTED_BOUNDARY;
        }
    };
    Construct_point_2 construct_point_2_object() const { return {}; }
    Orientation_2 orientation_2_object() const { return {q_}; }
    Compare_x_2 compare_x_2_object() const { return {q_}; }
    Compare_y_2 compare_y_2_object() const { return {q_}; }
    Less_x_2 less_x_2_object() const { return {q_}; }
    Less_y_2 less_y_2_object() const { return {q_}; }
    Side_of_oriented_circle_2 side_of_oriented_circle_2_object() const { return {q_}; }

private:
    Question q_{};
};

using VertexBase = CGAL::Triangulation_vertex_base_2<ExactTraits>;
using FaceBase = CGAL::Triangulation_face_base_with_info_2<int, ExactTraits, CGAL::Constrained_triangulation_face_base_2<ExactTraits>>;
using Structure = CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>;
using Triangulation = CGAL::Constrained_Delaunay_triangulation_2<ExactTraits, Structure, CGAL::No_constraint_intersection_tag>;

std::vector<std::array<VertexId, 3>> triangulate_all(const VertexTable& vertices, Projection axes, const std::vector<Outline>& loops) {
    Triangulation cdt{ExactTraits(Question{&vertices, axes})};
    for (const Outline& loop : loops) {
        const std::size_t n = loop.vertices.size();
        std::vector<Triangulation::Vertex_handle> handles;
        handles.reserve(n);
        Triangulation::Face_handle hint;
        for (std::size_t i = 0; i < n; ++i) {
            const Vec3 p = vertices.position(loop.vertices[i]);
            handles.push_back(cdt.insert(FacePoint(p[axes.u], p[axes.v], loop.vertices[i], loop.lines[i == 0 ? n - 1 : i - 1], loop.lines[i]), hint));
            hint = handles.back()->face();
        }
        for (std::size_t i = 0; i < n; ++i) cdt.insert_constraint(handles[i], handles[i + 1 == n ? 0 : i + 1]);
    }
    // Inside: an odd number of constraints away from infinity.
    for (auto f = cdt.all_faces_begin(); f != cdt.all_faces_end(); ++f) f->info() = -1;
    std::vector<Triangulation::Face_handle> todo{cdt.infinite_face()};
    cdt.infinite_face()->info() = 0;
    while (!todo.empty()) {
        const auto f = todo.back();
        todo.pop_back();
        for (int i = 0; i < 3; ++i) {
            const auto g = f->neighbor(i);
            if (g->info() >= 0) continue;
            g->info() = f->info() ^ (f->is_constrained(i) ? 1 : 0);
            todo.push_back(g);
        }
    }
    std::vector<std::array<VertexId, 3>> triangles;
    for (auto f = cdt.finite_faces_begin(); f != cdt.finite_faces_end(); ++f)
        if (f->info() == 1) triangles.push_back({f->vertex(0)->point().vertex, f->vertex(1)->point().vertex, f->vertex(2)->point().vertex});
    return triangles;
}

} // namespace

std::vector<std::array<VertexId, 3>> triangulate(const VertexTable& vertices, PlaneId plane, const std::vector<Outline>& loops) {
    const Loop& first = loops[0].vertices;
    if (loops.size() == 1 && first.size() == 3) return {{first[0], first[1], first[2]}};
    try {
        return triangulate_all(vertices, project_along(vertices.planes(), plane), loops);
    } catch (const std::exception&) { // the library's refusal
        return {};
    }
}

} // namespace kiln

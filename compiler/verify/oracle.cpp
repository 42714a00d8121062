#include "compiler/verify/oracle.h"
#include <fmt/format.h>

namespace kiln::verify {

Vec3 RandomPoints::in(std::span<const Vec3> convex) {
    // Exponential weights of the corners: uniform over a triangle, inside of any polygon.
    Vec3 sum;
    double total = 0;
    for (const Vec3& v : convex) {
        const double w = -std::log(1 - unit()) + 1e-3;
        sum += v * w, total += w;
    }
    return sum / total;
}

BoxGrid::BoxGrid(std::vector<Box3> boxes) : boxes_(std::move(boxes)) {
    std::size_t used = 0;
    for (const Box3& b : boxes_)
        if (!b.empty()) all_.add(b), ++used;
    if (!used) {
        cells_.resize(1);
        return;
    }
    // About a cell a box, cubes as far as the shape allows.
    const Vec3 s = all_.size();
    const double edge = std::cbrt(std::max({s.x, 1.0}) * std::max(s.y, 1.0) * std::max(s.z, 1.0) / static_cast<double>(used));
    for (std::size_t k = 0; k < 3; ++k) count_[k] = std::clamp<std::size_t>(static_cast<std::size_t>(s[k] / edge), 1, 256);
    cells_.resize(count_[0] * count_[1] * count_[2]);
    for (std::uint32_t b = 0; b < boxes_.size(); ++b) {
        if (boxes_[b].empty()) continue;
        const Vec3 margin{1, 1, 1};
        const Vec3 lo = boxes_[b].lo - margin, hi = boxes_[b].hi + margin;
        for (std::size_t z = index(lo, 2); z <= index(hi, 2); ++z)
            for (std::size_t y = index(lo, 1); y <= index(hi, 1); ++y)
                for (std::size_t x = index(lo, 0); x <= index(hi, 0); ++x) cells_[(z * count_[1] + y) * count_[0] + x].push_back(b);
    }
}
std::size_t BoxGrid::index(Vec3 p, std::size_t axis) const {
    const double size = all_.hi[axis] - all_.lo[axis];
    const double share = size > 0 ? (p[axis] - all_.lo[axis]) / size : 0;
    return static_cast<std::size_t>(std::clamp(share * static_cast<double>(count_[axis]), 0.0, static_cast<double>(count_[axis] - 1)));
}
const std::vector<std::uint32_t>& BoxGrid::cell(Vec3 p) const { return cells_[(index(p, 2) * count_[1] + index(p, 1)) * count_[0] + index(p, 0)]; }

namespace {
std::vector<Box3> boxes_of(const Csg& csg) {
    std::vector<Box3> boxes(csg.brushes.size());
    for (std::size_t b = 0; b < boxes.size(); ++b)
        if (csg.brushes[b].valid) boxes[b] = csg.brushes[b].bounds;
    return boxes;
}
} // namespace

Brushes::Brushes(const World& world, const Csg& csg) : faces_(world.brushes.size()), grid_(boxes_of(csg)) {
    for (std::size_t b = 0; b < csg.brushes.size(); ++b)
        for (const PlanePolygon& f : csg.brushes[b].faces) faces_[b].push_back({csg.planes.normal(f.support), csg.planes.distance(f.support)});
}
double Brushes::depth(std::uint32_t brush, Vec3 p) const {
    double d = -1e30;
    for (const HalfSpace& f : faces_[brush]) d = std::max(d, dot(f.normal, p) - f.distance);
    return d;
}

std::string at(Vec3 p) { return fmt::format("({:.6g} {:.6g} {:.6g})", p.x, p.y, p.z); }

double area(std::span<const Vec3> p) {
    Vec3 sum;
    for (std::size_t i = 1; i + 1 < p.size(); ++i) sum += cross(p[i] - p[0], p[i + 1] - p[0]);
    return length(sum) / 2;
}

} // namespace kiln::verify

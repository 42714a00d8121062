// Private to verify: brute force over brushes, random points that are the same everywhere, and where boxes are.
#pragma once
#include "compiler/csg/csg.h"
#include "libs/sampling/sobol.h"
#include <span>

namespace kiln::verify {

// Points where the checks want them: the same on every platform.
class RandomPoints {
public:
    explicit RandomPoints(std::uint64_t seed) : unit_(seed) {}
    double unit() { return unit_(); } // [0, 1)
    std::size_t below(std::size_t n) { return static_cast<std::size_t>(unit() * static_cast<double>(n)); }
    Vec3 in(const Box3& box) {
        const Vec3 s = box.size();
        const double x = unit(), y = unit(), z = unit();
        return {box.lo.x + x * s.x, box.lo.y + y * s.y, box.lo.z + z * s.z};
    }
    Vec3 in(std::span<const Vec3> convex); // within a convex polygon, nowhere near its corners alone

private:
    kiln::Random unit_;
};

// Boxes by place: all that hold a point.
class BoxGrid {
public:
    explicit BoxGrid(std::vector<Box3> boxes);
    template <class Visit> void at(Vec3 p, double margin, Visit&& visit) const { // ascending
        const auto test = [&](std::uint32_t b) {
            const Box3& box = boxes_[b];
            for (std::size_t k = 0; k < 3; ++k)
                if (p[k] < box.lo[k] - margin || p[k] > box.hi[k] + margin) return;
            visit(b);
        };
        for (const std::uint32_t b : cell(p)) test(b);
    }

private:
    std::vector<Box3> boxes_;
    Box3 all_;
    std::array<std::size_t, 3> count_{1, 1, 1};
    std::vector<std::vector<std::uint32_t>> cells_; // each box with a margin of a unit
    std::size_t index(Vec3 p, std::size_t axis) const;
    const std::vector<std::uint32_t>& cell(Vec3 p) const;
};

// Every valid brush as half-spaces in doubles, independent of fragments and tree.
class Brushes {
public:
    Brushes(const World& world, const Csg& csg);
    // The largest signed distance to a face: negative inside, a lower bound of the distance outside.
    double depth(std::uint32_t brush, Vec3 p) const;
    // Those near the point.
    template <class Visit> void near(Vec3 p, Visit&& visit) const { grid_.at(p, kNear, visit); }
    static constexpr double kNear = 0.25; // map units

private:
    struct HalfSpace {
        Vec3 normal;
        double distance;
    };
    std::vector<std::vector<HalfSpace>> faces_;
    BoxGrid grid_;
};

std::string at(Vec3 p); // "(1 2.5 -3)"
double area(std::span<const Vec3> polygon);

} // namespace kiln::verify

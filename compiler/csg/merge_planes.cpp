// Greedy, simplest plane first: each plane claims the faces around its own faces that lie within the tolerance of
// it, then the faces around those, and so on. A face is claimed once and its distance is always measured from where
// the map put it, so chains of almost equal planes cannot drag a face further than the tolerance.
#include "compiler/csg/merge_planes.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <cmath>

namespace kiln::csg_detail {
namespace {

// Sine of the angle beyond which two planes are two by design: a face of a map unit's width whose edges are each off
// by 1/64 tilts by 1/32.
constexpr double kMaxTilt = 1.0 / 32;

struct Face {
    std::uint32_t brush = 0;
    SideId side;
    PlaneId plane;
    Box3 box;
    std::vector<Vec3> points;
    double area = 0;
};

struct Measure { // distances from a plane, computed about a point near the face
    Vec3 normal;
    double distance;
    bool within(double limit, const std::vector<Vec3>& points) const {
        for (const Vec3& p : points)
            if (!(std::fabs(dot(normal, p) - distance) <= limit)) return false;
        return true;
    }
    double over(const std::vector<Vec3>& points) const {
        double largest = 0;
        for (const Vec3& p : points) largest = std::max(largest, std::fabs(dot(normal, p) - distance));
        return largest;
    }
};

double area_of(const std::vector<Vec3>& p) {
    Vec3 sum{};
    for (std::size_t i = 1; i + 1 < p.size(); ++i) sum += cross(p[i] - p[0], p[i + 1] - p[0]);
    return length(sum) / 2;
}

bool is_axial(const ExactPlane& p) { return (p.a != 0) + (p.b != 0) + (p.c != 0) == 1; }

} // namespace

std::vector<MergedSide> merge_planes(const PlaneTable& planes, const std::vector<BrushPolytope>& brushes,
                                     const std::vector<std::vector<std::uint32_t>>& near,
                                     const std::vector<char>& integral, double tolerance, Context& context) {
    std::vector<MergedSide> result(integral.size());
    std::vector<Face> faces;
    std::vector<std::uint32_t> first_face(brushes.size() + 1, 0);
    for (std::size_t b = 0; b < brushes.size(); ++b) {
        for (std::size_t f = 0; f < brushes[b].faces.size(); ++f) {
            Face face;
            face.brush = static_cast<std::uint32_t>(b), face.side = brushes[b].sides[f];
            face.plane = brushes[b].faces[f].support;
            result[face.side.at()].plane = face.plane;
            faces.push_back(std::move(face));
        }
        first_face[b + 1] = static_cast<std::uint32_t>(faces.size());
    }
    if (tolerance <= 0 || faces.empty()) return result;
    parallel_for(context, brushes.size(), [&](std::size_t b) {
        for (std::size_t f = 0; f < brushes[b].faces.size(); ++f) {
            Face& face = faces[first_face[b] + f];
            face.points = points(planes, brushes[b].faces[f]);
            for (const Vec3& p : face.points) face.box.add(p);
            face.area = area_of(face.points);
        }
    });

    // Neighbours from which a face could be claimed: near, almost parallel, and close over one of the two. (Two faces
    // claimed by one plane are each within the tolerance of it over themselves.) Few, or none in a map on a grid.
    constexpr double kClose = 4;
    std::vector<Measure> measure(planes.planes.size());
    for (std::size_t p = 0; p < measure.size(); ++p)
        measure[p] = {planes.normal(id<PlaneId>(p)), planes.distance(id<PlaneId>(p))};
    const auto near_plane = [&](const Face& face, PlaneId target) {
        const Measure &own = measure[face.plane.at()], &other = measure[target.at()];
        const Vec3 sine = cross(own.normal, other.normal);
        return dot(sine, sine) <= kMaxTilt * kMaxTilt && other.within(tolerance, face.points);
    };
    const Vec3 margin{kMergeReach, kMergeReach, kMergeReach};
    struct Slab { // what settles almost every pair, close together in memory
        Vec3 normal, center;
        double distance;
        bool may_be_near(const Slab& other, double limit) const {
            return std::fabs(dot(normal, other.center) - distance) <= limit ||
                   std::fabs(dot(other.normal, center) - other.distance) <= limit;
        }
    };
    std::vector<Slab> slabs(faces.size());
    for (std::size_t i = 0; i < faces.size(); ++i) {
        const Measure& m = measure[faces[i].plane.at()];
        Vec3 center{}; // a convex combination of corners all within the limit is within it
        for (const Vec3& p : faces[i].points) center += p;
        slabs[i] = {m.normal, center / static_cast<double>(faces[i].points.size()), m.distance};
    }
    const double limit = kClose * tolerance;
    std::vector<std::vector<std::uint32_t>> later(faces.size()); // neighbours in brushes further on in the file
    parallel_for(context, brushes.size(), [&](std::size_t b) {
        for (const std::uint32_t other : near[b]) {
            if (other <= b) continue;
            const Box3 box{brushes[other].bounds.lo - margin, brushes[other].bounds.hi + margin};
            for (std::uint32_t i = first_face[b]; i < first_face[b + 1]; ++i) {
                if (!overlap(faces[i].box, box)) continue;
                const Box3 around{faces[i].box.lo - margin, faces[i].box.hi + margin};
                for (std::uint32_t j = first_face[other]; j < first_face[other + 1]; ++j) {
                    if (!slabs[i].may_be_near(slabs[j], 1.001 * limit) || // the centres are rounded
                        (faces[i].plane.value ^ faces[j].plane.value) <= 1 || !overlap(faces[j].box, around))
                        continue;
                    const Vec3 sine = cross(slabs[i].normal, slabs[j].normal);
                    if (dot(sine, sine) <= kMaxTilt * kMaxTilt &&
                        (measure[faces[i].plane.at()].within(limit, faces[j].points) ||
                         measure[faces[j].plane.at()].within(limit, faces[i].points)))
                        later[i].push_back(j);
                }
            }
        }
    });
    std::vector<std::vector<std::uint32_t>> neighbours = later;
    for (std::uint32_t i = 0; i < faces.size(); ++i)
        for (const std::uint32_t j : later[i]) neighbours[j].push_back(i);

    // Planes by simplicity. Flipped planes count as one.
    struct Candidate {
        int rank = 3;
        double area = 0;
        std::uint32_t plane = 0; // id / 2
        std::vector<std::uint32_t> faces;
    };
    std::vector<Candidate> candidates(planes.planes.size() / 2);
    bool any = false;
    for (std::size_t i = 0; i < faces.size(); ++i) {
        Candidate& c = candidates[faces[i].plane.value / 2];
        const ExactPlane& p = planes.planes[faces[i].plane.at()];
        const bool whole = integral[faces[i].side.at()];
        c.rank = std::min(c.rank, is_axial(p) ? (whole ? 0 : 1) : (whole ? 2 : 3));
        c.area += faces[i].area;
        c.faces.push_back(static_cast<std::uint32_t>(i));
        for (const std::uint32_t j : neighbours[i])
            any = any || near_plane(faces[j], faces[i].plane);
    }
    if (!any) return result;
    for (std::size_t p = 0; p < candidates.size(); ++p) candidates[p].plane = static_cast<std::uint32_t>(p);
    std::erase_if(candidates, [](const Candidate& c) { return c.faces.empty(); });
    std::sort(candidates.begin(), candidates.end(), [](const Candidate& x, const Candidate& y) {
        if (x.rank != y.rank) return x.rank < y.rank;
        if (x.area != y.area) return x.area > y.area;
        return x.plane < y.plane;
    });

    std::vector<char> claimed(faces.size(), 0);
    std::vector<std::uint32_t> queue;
    for (const Candidate& c : candidates) {
        queue.clear();
        for (const std::uint32_t i : c.faces)
            if (!claimed[i]) claimed[i] = 1, queue.push_back(i);
        if (queue.empty()) continue; // all of its faces lie on simpler planes now
        for (std::size_t at = 0; at < queue.size(); ++at) {
            for (const std::uint32_t j : neighbours[queue[at]]) {
                if (claimed[j] || faces[j].plane.value / 2 == c.plane) continue;
                const PlaneId plane{c.plane * 2};
                if (!near_plane(faces[j], plane)) continue;
                // A thin brush must not get the same plane on two sides.
                bool taken = false;
                for (std::uint32_t k = first_face[faces[j].brush]; k < first_face[faces[j].brush + 1]; ++k)
                    taken = taken || (k != j && result[faces[k].side.at()].plane.value / 2 == c.plane);
                if (taken) continue;
                claimed[j] = 1;
                const bool same = dot(measure[plane.at()].normal, measure[faces[j].plane.at()].normal) > 0;
                result[faces[j].side.at()] = {same ? plane : flipped(plane), measure[plane.at()].over(faces[j].points)};
                queue.push_back(j);
            }
        }
    }
    return result;
}

} // namespace kiln::csg_detail

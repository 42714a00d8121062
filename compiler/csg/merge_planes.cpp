// Greedy, simplest plane first: each plane claims the faces around its own faces that lie within the tolerance of
// it, then the faces around those, and so on. A face is claimed once and its distance is always measured from where
// the map put it, so chains of almost equal planes cannot drag a face further than the tolerance.
#include "compiler/csg/merge_planes.h"
#include "compiler/csg/input_planes.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <cmath>
#include <set>

namespace kiln::csg_detail {
namespace {

// Sine of the angle beyond which two planes are two by design: a face two map units wide whose edges are off by 1/32
// both ways tilts by 1/32.
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

// Of the corners only the coordinates along `axes` are asked to be whole; along the others the plane runs on, so that
// they do not matter.
std::optional<ExactPlane> on_whole_units(const std::vector<Vec3>& corners, Vec3 normal, std::array<bool, 3> axes, int grid_bits, double tolerance) {
    std::vector<Vec3> whole(corners.size());
    for (std::size_t i = 0; i < corners.size(); ++i)
        for (std::size_t k = 0; k < 3; ++k) {
            if (!axes[k]) continue;
            whole[i][k] = std::round(corners[i][k]);
            if (std::fabs(corners[i][k] - whole[i][k]) > tolerance) return std::nullopt;
        }
    // Two or three corners and the directions in which the plane runs on span it.
    std::array<Vec3, 3> spanning;
    const std::array<std::size_t, 3> far = far_apart(whole);
    for (std::size_t i = 0; i < 3; ++i) spanning[i] = whole[far[i]];
    std::size_t next = static_cast<std::size_t>(std::ranges::count(axes, true));
    for (std::size_t k = 0; k < 3; ++k)
        if (!axes[k]) spanning[next] = spanning[0], spanning[next++][k] += 1024;
    const std::optional<ExactPlane> plane = plane_facing(spanning, normal, grid_bits);
    const auto on_it = [&](const Vec3& p) { return height_over(*plane, snap(p, grid_bits)) == 0; };
    return plane && std::ranges::all_of(whole, on_it) ? plane : std::nullopt;
}

// The simplest first: along two axes, along the one it is nearest to, along none.
std::optional<ExactPlane> on_whole_units(const std::vector<Vec3>& corners, Vec3 normal, int grid_bits, double tolerance) {
    std::array<std::size_t, 3> by_size{0, 1, 2}; // the axes, the one most across the plane first
    std::ranges::sort(by_size, [&](std::size_t i, std::size_t j) { return std::fabs(normal[i]) > std::fabs(normal[j]); });
    std::array<bool, 3> axes{};
    for (const std::size_t k : by_size) {
        axes[k] = true;
        const std::optional<ExactPlane> plane = on_whole_units(corners, normal, axes, grid_bits, tolerance);
        if (plane) return plane;
    }
    return std::nullopt;
}

} // namespace

std::vector<PlaneId> planes_on_whole_units(PlaneTable& planes, const std::vector<BrushPolytope>& brushes,
                                           const std::vector<char>& rounded, double tolerance, Context& context) {
    std::vector<PlaneId> result(rounded.size());
    if (tolerance <= 0 || std::ranges::find(rounded, 1) == rounded.end()) return result;
    std::vector<std::optional<ExactPlane>> found(rounded.size());
    parallel_for(context, brushes.size(), [&](std::size_t b) {
        for (std::size_t f = 0; f < brushes[b].faces.size(); ++f)
            if (const std::size_t s = brushes[b].sides[f].at(); rounded[s])
                found[s] = on_whole_units(points(planes, brushes[b].faces[f]), planes.normal(brushes[b].faces[f].support),
                                          planes.grid_bits, tolerance);
    });
    for (std::size_t s = 0; s < found.size(); ++s)
        if (found[s]) result[s] = planes.add(*found[s]);
    return result;
}

std::vector<MergedSide> merge_planes(const PlaneTable& planes, const std::vector<BrushPolytope>& brushes,
                                     const std::vector<std::vector<std::uint32_t>>& near, const std::vector<char>& integral,
                                     const std::vector<PlaneId>& whole, double tolerance, Context& context) {
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
        std::vector<std::uint32_t> faces;   // that lie in it
        std::vector<std::uint32_t> claimed; // that would if their corners were where they were drawn
    };
    std::vector<Candidate> candidates(planes.planes.size() / 2);
    bool any = false;
    for (std::size_t i = 0; i < faces.size(); ++i) {
        Candidate& c = candidates[faces[i].plane.value / 2];
        const ExactPlane& p = planes.planes[faces[i].plane.at()];
        const bool on_units = integral[faces[i].side.at()];
        c.rank = std::min(c.rank, is_axial(p) ? (on_units ? 0 : 1) : (on_units ? 2 : 3));
        c.area += faces[i].area;
        c.faces.push_back(static_cast<std::uint32_t>(i));
        for (const std::uint32_t j : neighbours[i])
            any = any || near_plane(faces[j], faces[i].plane);
    }
    // Faces that touch in all but one plane are a sheet: it goes where it was drawn as a whole, or not at all, lest that
    // tear what fits.
    std::vector<std::uint32_t> sheet;
    std::vector<char> in_sheet(faces.size(), 0);
    std::set<std::pair<std::uint32_t, std::uint32_t>> stays; // planes (id / 2) and faces of sheets that do not all go there
    const Vec3 touch = Vec3{1, 1, 1} * (kClose * tolerance);
    std::set<std::pair<std::uint32_t, std::uint32_t>> moves; // and of those that do
    const auto goes = [&](std::uint32_t face, PlaneId drawn) { return near_plane(faces[face], drawn) && !stays.contains({drawn.value / 2, face}); };
    // Adds those that touch the face; false: one of them does not go to `drawn`.
    const auto spread = [&](const Face& face, PlaneId drawn) {
        const Box3 around{face.box.lo - touch, face.box.hi + touch};
        for (const std::uint32_t b : near[face.brush]) {
            if (!overlap(brushes[b].bounds, around)) continue;
            for (std::uint32_t j = first_face[b]; j < first_face[b + 1]; ++j) {
                if (in_sheet[j] || !overlap(faces[j].box, around) || !(near_plane(faces[j], face.plane) || near_plane(face, faces[j].plane))) continue;
                sheet.push_back(j), in_sheet[j] = 1;
                if (!goes(j, drawn)) return false;
            }
        }
        return true;
    };
    for (std::uint32_t i = 0; i < faces.size(); ++i) {
        const PlaneId drawn = whole[faces[i].side.at()];
        if (!drawn.valid() || drawn == faces[i].plane || moves.contains({drawn.value / 2, i})) continue;
        if (i % 256 == 0) context.check_cancelled();
        sheet.assign(1, i), in_sheet[i] = 1;
        bool all = near_plane(faces[i], drawn);
        for (std::size_t at = 0; all && at < sheet.size(); ++at) all = spread(faces[sheet[at]], drawn);
        for (const std::uint32_t j : sheet) {
            in_sheet[j] = 0;
            (all ? moves : stays).insert({drawn.value / 2, j});
        }
        if (!all) continue;
        Candidate& d = candidates[drawn.value / 2];
        d.rank = std::min(d.rank, is_axial(planes.planes[drawn.at()]) ? 0 : 2);
        d.claimed.insert(d.claimed.end(), sheet.begin(), sheet.end());
        any = true;
    }
    if (!any) return result;
    for (Candidate& d : candidates) {
        std::ranges::sort(d.claimed);
        d.claimed.erase(std::unique(d.claimed.begin(), d.claimed.end()), d.claimed.end());
        for (const std::uint32_t i : d.claimed) d.area += faces[i].area;
    }
    for (std::size_t p = 0; p < candidates.size(); ++p) candidates[p].plane = static_cast<std::uint32_t>(p);
    std::erase_if(candidates, [](const Candidate& c) { return c.faces.empty() && c.claimed.empty(); });
    std::sort(candidates.begin(), candidates.end(), [](const Candidate& x, const Candidate& y) {
        if (x.rank != y.rank) return x.rank < y.rank;
        if (x.area != y.area) return x.area > y.area;
        return x.plane < y.plane;
    });

    std::vector<char> claimed(faces.size(), 0);
    std::vector<std::uint32_t> queue;
    for (const Candidate& c : candidates) {
        queue.clear();
        const auto claim = [&](std::uint32_t j) {
            const PlaneId plane{c.plane * 2};
            if (claimed[j] || faces[j].plane.value / 2 == c.plane || !near_plane(faces[j], plane)) return;
            // A thin brush must not get the same plane on two sides.
            for (std::uint32_t k = first_face[faces[j].brush]; k < first_face[faces[j].brush + 1]; ++k)
                if (k != j && result[faces[k].side.at()].plane.value / 2 == c.plane) return;
            claimed[j] = 1;
            const bool same = dot(measure[plane.at()].normal, measure[faces[j].plane.at()].normal) > 0;
            result[faces[j].side.at()] = {same ? plane : flipped(plane), measure[plane.at()].over(faces[j].points)};
            queue.push_back(j);
        };
        for (const std::uint32_t i : c.faces)
            if (!claimed[i]) claimed[i] = 1, queue.push_back(i);
        for (const std::uint32_t i : c.claimed) claim(i);
        // An empty queue: all of its faces lie on simpler planes now.
        for (std::size_t at = 0; at < queue.size(); ++at)
            for (const std::uint32_t j : neighbours[queue[at]]) claim(j);
    }
    return result;
}

} // namespace kiln::csg_detail

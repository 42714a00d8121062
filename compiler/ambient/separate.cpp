#include "compiler/ambient/separate.h"
#include "libs/core/check.h"
#include <tuple>

namespace kiln::ambient {

namespace {

struct Plane {
    Vec3 normal;
    double distance = 0;
};

// The plane in the middle of the wall that a meets on its way to b: as far from the air on both sides as can be.
std::optional<Plane> wall_between(const Air& air, Vec3 a, Vec3 b) {
    constexpr double kInto = 1e-3, kMostHalf = 8; // map units
    const Vec3 way = b - a;
    const double far = length(way);
    if (!(far > 0)) return std::nullopt;
    const auto hit = air.closest(a, way / far);
    if (!hit || hit->distance > far) return std::nullopt;
    const Vec3 into = -hit->normal;
    const Vec3 start = a + way * (hit->distance / far) + into * kInto;
    const auto out = air.closest(start, into);
    const double half = out && out->back ? std::min(out->distance / 2, kMostHalf) : 0;
    return Plane{hit->normal, dot(hit->normal, start + into * half)};
}

Side side_of(std::vector<std::uint32_t> samples, const std::vector<std::uint8_t>& sees) {
    Side side;
    side.common = 0xFF;
    for (const std::uint32_t s : samples) side.common &= sees[s], side.any |= sees[s];
    if (samples.empty()) side.common = 0;
    side.samples = std::move(samples);
    return side;
}

struct Part { // of the points, in a tree of planes
    std::vector<std::uint32_t> samples;
    std::size_t crossings = 0; // pairs that do not see each other
    std::uint8_t common = 0;   // corners that all see
    bool whole = false;        // not to be parted
    std::optional<Plane> plane;
    std::size_t behind = 0, beyond = 0; // parts
};

} // namespace

std::uint64_t Blocked::grow(const Air& air, const std::vector<Vec3>& points) {
    KILN_CHECK_OP(rows_.size(), <=, points.size());
    std::uint64_t rays = 0;
    std::vector<std::uint8_t> clear;
    for (std::size_t i = rows_.size(); i < points.size(); ++i) {
        air.clear_each(std::span(points).first(i), std::vector<Vec3>(i, points[i]), clear);
        std::vector<char>& row = rows_.emplace_back(i);
        for (std::size_t j = 0; j < i; ++j) row[j] = !clear[j];
        rays += i;
    }
    return rays;
}

std::size_t Blocked::among(const std::vector<std::uint32_t>& set) const {
    std::size_t n = 0;
    for (std::size_t i = 0; i < set.size(); ++i)
        for (std::size_t j = i + 1; j < set.size(); ++j) n += (*this)(set[i], set[j]);
    return n;
}

bool Sides::single_valued() const {
    for (const Side& side : sides)
        if (!side.behind && (side.common == 0 || side.common != side.any)) return false;
    return true;
}

Sides separate(const Air& air, const std::vector<Vec3>& points, const std::vector<std::uint8_t>& sees,
               std::size_t most, Blocked& blocked) {
    Sides result;
    const auto judge = [&](Part& part) {
        const Side side = side_of(part.samples, sees);
        part.common = side.common, part.whole = side.common && side.common == side.any;
    };
    Part all;
    for (std::size_t i = 0; i < points.size(); ++i) all.samples.push_back(static_cast<std::uint32_t>(i));
    const Side whole = side_of(all.samples, sees);
    if (whole.common == whole.any || most <= 1) {
        result.sides.push_back(whole);
        return result;
    }
    result.rays = blocked.grow(air, points);
    all.crossings = blocked.among(all.samples);
    judge(all);
    constexpr std::size_t kForCorners = 8; // sides, with more of which no more corners are worth having
    std::vector<Part> parts{std::move(all)};
    for (std::size_t leaves = 1; leaves < most;) {
        // Those first whose points see no corner in common: there light may leak. The others only get corners more.
        std::size_t worst = parts.size();
        for (std::size_t i = 0; i < parts.size(); ++i) {
            const Part& p = parts[i];
            if (p.plane || p.whole || p.crossings == 0 || (p.common && leaves >= kForCorners)) continue;
            if (worst == parts.size() || std::tuple(p.common == 0, p.crossings) > std::tuple(parts[worst].common == 0, parts[worst].crossings)) worst = i;
        }
        if (worst == parts.size()) break;
        const std::vector<std::uint32_t> left = parts[worst].samples;
        // Candidate walls: between each point and the nearest one it does not see. The best leaves the fewest pairs on
        // one side that do not see each other; the side that is peeled off is the more whole of the two.
        std::size_t best_score = parts[worst].crossings;
        std::optional<Plane> best;
        Part best_behind, best_beyond;
        std::vector<Plane> tried;
        for (const std::uint32_t i : left) {
            std::optional<std::uint32_t> nearest;
            double least = 1e300;
            for (const std::uint32_t j : left) {
                const Vec3 way = points[j] - points[i];
                if (i != j && blocked(i, j) && dot(way, way) < least) least = dot(way, way), nearest = j;
            }
            if (!nearest) continue;
            result.rays += 2;
            auto plane = wall_between(air, points[i], points[*nearest]);
            if (!plane) continue;
            const bool known = std::any_of(tried.begin(), tried.end(), [&](const Plane& t) {
                const double same = dot(t.normal, plane->normal);
                return std::abs(same) > 0.999 && std::abs(t.distance - same * plane->distance) < 0.01;
            });
            if (known) continue;
            tried.push_back(*plane);
            Part behind, beyond;
            for (const std::uint32_t s : left)
                (dot(plane->normal, points[s]) <= plane->distance ? behind : beyond).samples.push_back(s);
            if (behind.samples.empty() || beyond.samples.empty()) continue;
            behind.crossings = blocked.among(behind.samples), beyond.crossings = blocked.among(beyond.samples);
            if (beyond.crossings < behind.crossings) {
                plane->normal = -plane->normal, plane->distance = -plane->distance;
                std::swap(behind, beyond);
            }
            if (behind.crossings + beyond.crossings < best_score) {
                best_score = behind.crossings + beyond.crossings;
                best = plane, best_behind = std::move(behind), best_beyond = std::move(beyond);
            }
        }
        if (!best) {
            parts[worst].whole = true;
            continue;
        }
        parts[worst].plane = best, parts[worst].behind = parts.size(), parts[worst].beyond = parts.size() + 1;
        judge(best_behind), judge(best_beyond);
        parts.push_back(std::move(best_behind)), parts.push_back(std::move(best_beyond));
        ++leaves;
    }
    // Each plane before what it leads to.
    const auto lay_out = [&](const auto& self, std::size_t p) -> std::uint32_t {
        const auto at = static_cast<std::uint32_t>(result.sides.size());
        const Part& part = parts[p];
        if (!part.plane) {
            result.sides.push_back(side_of(part.samples, sees));
            return at;
        }
        const bool ends = !parts[part.behind].plane;
        result.sides.push_back(ends ? side_of(parts[part.behind].samples, sees) : Side{});
        if (!ends) {
            const std::uint32_t behind = self(self, part.behind);
            result.sides[at].behind = behind;
        }
        const std::uint32_t beyond = self(self, part.beyond);
        Side& side = result.sides[at];
        side.has_plane = true, side.normal = part.plane->normal, side.distance = part.plane->distance, side.beyond = beyond;
        return at;
    };
    lay_out(lay_out, 0);
    return result;
}

} // namespace kiln::ambient

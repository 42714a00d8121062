#include "compiler/ambient/sites.h"

namespace kiln::ambient {

namespace {

constexpr std::size_t kProbeRays = 48;      // one back face among them is more than 1 %
constexpr double kTolerated = 0.01;         // share of back faces
constexpr double kClearance = 2;            // map units a cube keeps from walls, where there is room

struct Look {
    double back_share = 1, nearest = 1e30;
    Vec3 nearest_normal{};
    Vec3 free{};                             // mean free direction, towards the open
    std::vector<std::pair<double, Vec3>> exits; // back faces met: distance, direction
};

Look look(const Air& air, Vec3 p, double reach, std::uint64_t& rays) {
    static const std::vector<Vec3> kDirections = spread_directions(kProbeRays);
    Look seen;
    std::size_t back = 0;
    std::array<std::optional<AirHit>, kProbeRays> hits;
    air.closest_each(p, kDirections, hits);
    rays += kProbeRays;
    for (std::size_t i = 0; i < kProbeRays; ++i) {
        const Vec3 d = kDirections[i];
        const auto& hit = hits[i];
        if (hit && hit->back) {
            ++back;
            seen.exits.emplace_back(hit->distance, d);
            continue;
        }
        const double distance = hit ? hit->distance : 1e30;
        seen.free += d * std::min(distance, reach);
        if (distance < seen.nearest) seen.nearest = distance, seen.nearest_normal = hit->normal;
    }
    seen.back_share = double(back) / double(kProbeRays);
    std::sort(seen.exits.begin(), seen.exits.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    return seen;
}

} // namespace

bool sees_backs(const Air& air, Vec3 p, std::uint64_t& rays) {
    return look(air, p, 0, rays).back_share > kTolerated;
}

void settle(const Air& air, double reach, Site& site) {
    const Vec3 wanted = site.position;
    const auto take = [&](Vec3 p) {
        if (air.leaf_of(p) == kNoLeaf) return false;
        Look seen = look(air, p, reach, site.rays);
        if (seen.back_share > kTolerated) return false;
        if (seen.nearest < kClearance) { // step off the wall, if that keeps it valid and in reach
            const Vec3 off = p + seen.nearest_normal * (kClearance - seen.nearest);
            if (length(off - wanted) <= reach && air.leaf_of(off) != kNoLeaf && air.clear(p, off)) {
                const Look from_off = look(air, off, reach, site.rays);
                if (from_off.back_share <= kTolerated) p = off, seen = from_off;
            }
        }
        site.position = p, site.usable = true;
        site.invalid_share = static_cast<float>(seen.back_share);
        return true;
    };
    if (take(wanted)) return;
    const Look seen = look(air, wanted, reach, site.rays);
    // Out through the nearest faces met from behind, then along the mean free direction.
    for (std::size_t i = 0; i < std::min<std::size_t>(seen.exits.size(), 4); ++i)
        if (const double step = seen.exits[i].first + kClearance; step <= reach && take(wanted + seen.exits[i].second * step))
            return;
    if (length(seen.free) > 0)
        for (const double share : {0.0625, 0.25, 0.5, 1.0})
            if (take(wanted + normalize(seen.free) * (reach * share))) return;
    // Neither told the way (no face within a solid leaf): straight along the axes.
    for (const double share : {0.125, 0.5, 1.0})
        for (std::size_t a = 0; a < 6; ++a) {
            Vec3 p = wanted;
            p[a / 2] += (a % 2 ? -reach : reach) * share;
            if (take(p)) return;
        }
}

void light_up(const Air& air, const AmbientOptions& options, Site& site) {
    gather(air, site.position, options.rays, site.seed, site.gathered);
    site.rays += options.rays;
    const Cube6 mean_cube = site.gathered.mean();
    double level = 0;
    for (const Rgbd& e : mean_cube) level += mean(e) / 6;
    site.lights = reaching_lights(air, site.position, site.seed, level, site.rays);
    site.lit = true;
    site.compose(options);
}

void Site::compose(const AmbientOptions& options) {
    shown = gathered.mean();
    for (std::size_t i = locals(options); i < lights.size(); ++i)
        add(shown, lights[i].direct.direction, lights[i].direct.irradiance);
}

} // namespace kiln::ambient

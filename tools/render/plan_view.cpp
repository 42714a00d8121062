// The BSP cut at a height: each leaf is a convex polygon, got by clipping the level's rectangle down the tree.
#include "tools/render/colours.h"
#include "tools/render/parts.h"
#include "tools/render/render.h"
#include <cstring>

namespace kiln {
namespace {

using Polygon = std::vector<Vec2>;

// The part where dot(normal, (x, y, z)) - distance has the sign wanted; touching counts to both.
Polygon clip(const Polygon& polygon, const kiln_plane& plane, double z, double sign) {
    Polygon out;
    const auto side = [&](Vec2 p) {
        return sign * (plane.normal[0] * p.x + plane.normal[1] * p.y + plane.normal[2] * z - plane.distance);
    };
    for (std::size_t i = 0; i < polygon.size(); ++i) {
        const Vec2 a = polygon[i], b = polygon[(i + 1) % polygon.size()];
        const double da = side(a), db = side(b);
        if (da >= 0) out.push_back(a);
        if ((da > 0 && db < 0) || (da < 0 && db > 0)) out.push_back(a + (b - a) * (da / (da - db)));
    }
    return out;
}

class Plan {
public:
    Plan(Vec2 lo, Vec2 hi, int width)
        : lo_(lo), scale_(width / (hi.x - lo.x)),
          image_(width, std::clamp(static_cast<int>(std::ceil((hi.y - lo.y) * scale_)), 1, 8192), 3, 0.012f) {}
    Image take() { return std::move(image_); }

    void fill(const Polygon& polygon, Rgb colour) {
        if (polygon.size() < 3) return;
        double top = 1e30, bottom = -1e30;
        Polygon p;
        for (const Vec2 v : polygon) p.push_back(pixel(v)), top = std::min(top, p.back().y), bottom = std::max(bottom, p.back().y);
        const int first = std::max(0, static_cast<int>(std::floor(top))), last = std::min(image_.height - 1, static_cast<int>(std::ceil(bottom)));
        for (int y = first; y <= last; ++y) {
            double left = 1e30, right = -1e30;
            for (std::size_t i = 0; i < p.size(); ++i) {
                const Vec2 a = p[i], b = p[(i + 1) % p.size()];
                const double yc = y + 0.5;
                if ((a.y <= yc) == (b.y <= yc)) continue;
                const double x = a.x + (b.x - a.x) * (yc - a.y) / (b.y - a.y);
                left = std::min(left, x), right = std::max(right, x);
            }
            for (int x = std::max(0, static_cast<int>(std::ceil(left - 0.5))); x < image_.width && x + 0.5 < right; ++x)
                dot_at(x, y, colour, 1);
        }
    }
    void outline(const Polygon& polygon, Rgb colour) {
        for (std::size_t i = 0; i < polygon.size(); ++i) line(polygon[i], polygon[(i + 1) % polygon.size()], colour, 0.5f);
    }
    void line(Vec2 from, Vec2 to, Rgb colour, float strength, int thick = 0) {
        const Vec2 a = pixel(from), b = pixel(to);
        const int steps = static_cast<int>(std::clamp(std::max(std::abs(b.x - a.x), std::abs(b.y - a.y)), 0.0, 20000.0)) + 1;
        for (int i = 0; i <= steps; ++i) {
            const Vec2 p = a + (b - a) * (static_cast<double>(i) / steps);
            for (int dy = 0; dy <= thick; ++dy)
                for (int dx = 0; dx <= thick; ++dx)
                    dot_at(static_cast<int>(std::floor(p.x)) + dx, static_cast<int>(std::floor(p.y)) + dy, colour, strength);
        }
    }
    void disc(Vec2 at, double radius, Rgb colour) {
        const Vec2 p = pixel(at);
        if (!(std::abs(p.x) < 1e6 && std::abs(p.y) < 1e6)) return;
        const int r = static_cast<int>(std::ceil(radius));
        for (int dy = -r; dy <= r; ++dy)
            for (int dx = -r; dx <= r; ++dx)
                if (dx * dx + dy * dy <= radius * radius)
                    dot_at(static_cast<int>(p.x) + dx, static_cast<int>(p.y) + dy, colour, 1);
    }

private:
    Vec2 lo_;
    double scale_;
    Image image_;
    Vec2 pixel(Vec2 v) const { return {(v.x - lo_.x) * scale_, image_.height - (v.y - lo_.y) * scale_}; } // north up
    void dot_at(int x, int y, Rgb colour, float strength) {
        if (x < 0 || y < 0 || x >= image_.width || y >= image_.height) return;
        for (int c = 0; c < 3; ++c)
            image_.at(x, y, c) += strength * (colour[static_cast<std::size_t>(c)] - image_.at(x, y, c));
    }
};

} // namespace

Result<Image> render_plan(const kiln_level* level, double z, const PlanOptions& options) {
    kiln_info info{};
    kiln_level_info(level, &info);
    const auto planes = part(level, kiln_level_planes);
    const auto nodes = part(level, kiln_level_nodes);
    const auto leaves = part(level, kiln_level_leaves);
    if (planes.size() != info.planes || nodes.size() != info.nodes || leaves.size() != info.leaves) return damaged("tree");
    if (options.width < 1 || options.width > kMaxImageEdge)
        return fault(Exit::usage, "bad-picture-size", "a picture is 1 to 32768 pixels wide");

    Vec2 lo{1e30, 1e30}, hi{-1e30, -1e30}; // of all there is to see, with a margin
    for (const kiln_leaf& l : leaves) {
        if (l.cluster < 0 || !(l.lo[0] > -1e6f && l.hi[0] < 1e6f && l.lo[1] > -1e6f && l.hi[1] < 1e6f)) continue;
        lo = {std::min<double>(lo.x, l.lo[0]), std::min<double>(lo.y, l.lo[1])};
        hi = {std::max<double>(hi.x, l.hi[0]), std::max<double>(hi.y, l.hi[1])};
    }
    if (!(lo.x < hi.x && lo.y < hi.y)) lo = {-512, -512}, hi = {512, 512};
    const Vec2 margin = (hi - lo) * 0.04 + Vec2{8, 8};
    lo = lo - margin, hi = hi + margin;
    Plan plan(lo, hi, options.width);

    struct Visit { std::int32_t at; Polygon polygon; };
    std::vector<Visit> todo;
    todo.push_back({nodes.empty() ? -1 : 0, {lo, {hi.x, lo.y}, hi, {lo.x, hi.y}}});
    std::vector<std::pair<std::uint32_t, Polygon>> cut; // open leaves, drawn after the solid ones
    for (std::size_t steps = 0; !todo.empty() && steps <= 2 * nodes.size() + 1; ++steps) {
        Visit v = std::move(todo.back());
        todo.pop_back();
        if (v.polygon.size() < 3) continue;
        if (v.at < 0) {
            const auto leaf = static_cast<std::uint32_t>(-(v.at + 1));
            if (leaf >= leaves.size()) continue;
            if (leaves[leaf].cluster >= 0) cut.emplace_back(leaf, std::move(v.polygon));
            else plan.fill(v.polygon, leaves[leaf].contents == 0 ? Rgb{0.012f, 0.012f, 0.016f} : Rgb{0.035f, 0.035f, 0.04f});
            continue;
        }
        const kiln_node& n = nodes[static_cast<std::size_t>(v.at)];
        todo.push_back({n.child[1], clip(v.polygon, planes[n.plane], z, -1)});
        todo.push_back({n.child[0], clip(v.polygon, planes[n.plane], z, 1)});
    }
    std::vector<std::uint64_t> seen((info.clusters + std::size_t{63}) / 64), heard(seen.size());
    if (options.vis_from >= 0 && (kiln_level_read_pvs_row(level, options.vis_from, seen.data(), seen.size()) != KILN_OK || kiln_level_read_pas_row(level, options.vis_from, heard.data(), heard.size()) != KILN_OK))
        return damaged("visibility");
    const auto has = [](const std::vector<std::uint64_t>& row, std::int32_t c) { return static_cast<std::size_t>(c) / 64 < row.size() && (row[static_cast<std::size_t>(c) / 64] >> (c % 64) & 1); };
    for (const auto& [leaf, polygon] : cut) {
        if (const std::int32_t cluster = leaves[leaf].cluster; options.vis_from >= 0) {
            plan.fill(polygon, cluster == options.vis_from ? Rgb{0.9f, 0.75f, 0.1f} : has(seen, cluster) ? Rgb{0.1f, 0.5f, 0.15f} : has(heard, cluster) ? Rgb{0.06f, 0.12f, 0.3f} : Rgb{0.1f, 0.1f, 0.1f});
            continue;
        }
        const Rgb c = name_colour(static_cast<std::uint64_t>(leaves[leaf].cluster)) * 0.55f;
        const bool liquid = leaves[leaf].contents >= 4 && leaves[leaf].contents <= 6;
        plan.fill(polygon, liquid ? c * Rgb{0.4f, 0.6f, 1.6f} : c);
    }
    for (const auto& [leaf, polygon] : cut) plan.outline(polygon, {0, 0, 0});

    if (options.portals) {
        const auto portals = part(level, kiln_level_portals);
        const auto points = part(level, kiln_level_portal_points, 3);
        if (portals.size() != info.portals) return damaged("portals");
        for (const kiln_portal& p : portals) {
            std::vector<Vec2> crossings;
            for (std::uint32_t i = 0; i < p.point_count; ++i) {
                const float* a = &points[3 * (std::size_t{p.first_point} + i)];
                const float* b = &points[3 * (std::size_t{p.first_point} + (i + 1) % p.point_count)];
                if ((a[2] <= z) == (b[2] <= z)) continue;
                const double f = (z - a[2]) / (static_cast<double>(b[2]) - a[2]);
                crossings.push_back({a[0] + f * (static_cast<double>(b[0]) - a[0]), a[1] + f * (static_cast<double>(b[1]) - a[1])});
            }
            if (crossings.size() >= 2) plan.line(crossings.front(), crossings.back(), {1, 1, 1}, 0.8f, 1);
        }
    }
    if (options.entities) {
        const double r = std::max(2.0, options.width / 340.0);
        for (const kiln_light& l : part(level, kiln_level_lights))
            if (l.kind <= 1) plan.disc({l.position[0], l.position[1]}, r, {1, 0.8f, 0.1f});
        for (const kiln_probe& p : part(level, kiln_level_probes))
            plan.disc({p.position[0], p.position[1]}, r + 1, {0.1f, 0.8f, 1});
        for (std::uint32_t e = 0; e < info.entities; ++e) {
            const char* name = kiln_level_entity_value(level, e, "classname");
            if (!name || std::strncmp(name, "info_player", 11) != 0) continue;
            double at[3] = {};
            const char* origin = kiln_level_entity_value(level, e, "origin");
            char* end = nullptr;
            for (int i = 0; origin && i < 3; ++i) at[i] = std::strtod(origin, &end), origin = end;
            plan.disc({at[0], at[1]}, r + 1, {0.9f, 0.1f, 0.6f});
        }
    }
    return plan.take();
}

} // namespace kiln

#include "compiler/surfaces/overlays.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <span>
#include <tuple>

namespace kiln {
namespace {

constexpr double kDecalReach = 8;  // map units between a decal's origin and the face it is meant for: the engine looks 5 along each axis
constexpr double kDecalDepth = 4;  // map units to either side of that face's plane
constexpr double kDecalFacing = 0.70710678118654752; // cosine: faces turned away further are another wall
constexpr double kSmallest = 1e-6; // map units squared: triangles that the sheet only touches leave less, and nothing to see

// A convex sheet in the overlay's own coordinates x = origin + a u + b v + c normal, with texture coordinates linear in a and b.
struct Sheet {
    std::vector<Vec2> outline;       // counter-clockwise in (a, b)
    Vec2 at{}, uv_at{}, uv_a{}, uv_b{}; // uv = uv_at + (a - at.x) uv_a + (b - at.y) uv_b
};

struct Projector {
    Vec3 origin, a, b, c; // coordinates of x: dot(x - origin, a), ...
    double depth = 1e300; // |c| of what is cut
    std::vector<Sheet> sheets;
};

double area_of(Vec2 p, Vec2 q, Vec2 r) { return cross(q - p, r - p) / 2; }

// Linear texture coordinates through three corners; nothing where they lie in one line.
std::optional<Sheet> sheet_through(std::span<const Vec2> corners, std::array<std::size_t, 3> c, const std::array<Vec2, 4>& p, const std::array<Vec2, 4>& uv) {
    const Vec2 e = p[c[1]] - p[c[0]], f = p[c[2]] - p[c[0]];
    const double det = cross(e, f);
    if (det == 0) return std::nullopt;
    Sheet s;
    s.outline.assign(corners.begin(), corners.end());
    if (det < 0) std::ranges::reverse(s.outline);
    const Vec2 g = uv[c[1]] - uv[c[0]], h = uv[c[2]] - uv[c[0]];
    s.at = p[c[0]], s.uv_at = uv[c[0]];
    s.uv_a = (g * f.y - h * e.y) * (1 / det);
    s.uv_b = (h * e.x - g * f.x) * (1 / det);
    return s;
}

std::vector<Sheet> sheets_of(const std::array<Vec2, 4>& p, const std::array<double, 4>& range) {
    const auto [u0, u1, v0, v1] = range;
    const std::array<Vec2, 4> uv{Vec2{u0, v0}, {u0, v1}, {u1, v1}, {u1, v0}};
    std::vector<Sheet> sheets;
    const auto add = [&](std::span<const Vec2> corners, std::array<std::size_t, 3> c) {
        if (auto s = sheet_through(corners, c, p, uv)) sheets.push_back(*std::move(s));
    };
    const Vec2 skew = p[0] - p[1] + p[2] - p[3];
    const double size = std::sqrt(dot(p[2] - p[0], p[2] - p[0]));
    constexpr double kSkew = 1e-5; // of the diagonal: what rounding in the text leaves
    if (std::sqrt(dot(skew, skew)) <= kSkew * size) {
        add(p, {0, 1, 2});
        return sheets;
    }
    // Along the diagonal that leaves two triangles of one orientation; a convex quad has the choice and takes the first.
    const bool first = area_of(p[0], p[1], p[2]) * area_of(p[0], p[2], p[3]) >= 0;
    using Triangle = std::array<std::size_t, 3>;
    for (const Triangle& c : {first ? Triangle{0, 1, 2} : Triangle{1, 2, 3}, first ? Triangle{0, 2, 3} : Triangle{1, 3, 0}})
        add(std::array{p[c[0]], p[c[1]], p[c[2]]}, c);
    return sheets;
}

struct Corner {
    Vec3 position, local; // map units; (a, b, c)
};

// The part of a convex polygon where `distance` is not negative.
template <class Distance> std::vector<Corner> cut(const std::vector<Corner>& polygon, Distance&& distance) {
    std::vector<Corner> out;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
        const Corner &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
        const double da = distance(a.local), db = distance(b.local);
        if (da >= 0) out.push_back(a);
        if ((da < 0 && db > 0) || (da > 0 && db < 0)) {
            // From the same end in both triangles of an edge, so that they agree to the last bit.
            const auto key = [](const Corner& c) { return std::tuple(c.position.x, c.position.y, c.position.z); };
            const bool swapped = key(b) < key(a);
            const Corner &p = swapped ? b : a, &q = swapped ? a : b;
            const double dp = swapped ? db : da, dq = swapped ? da : db, t = dp / (dp - dq);
            out.push_back({p.position + (q.position - p.position) * t, p.local + (q.local - p.local) * t});
        }
    }
    return out;
}

double area_of(const std::vector<Corner>& polygon) {
    Vec3 twice;
    for (std::size_t i = 1; i + 1 < polygon.size(); ++i)
        twice += cross(polygon[i].position - polygon[0].position, polygon[i + 1].position - polygon[0].position);
    return length(twice) / 2;
}

Vec3 normal_of(const Surfaces& s, std::uint32_t t) {
    const auto& tri = s.triangles[t];
    return normalize(cross(s.positions[tri[1]] - s.positions[tri[0]], s.positions[tri[2]] - s.positions[tri[0]]));
}

double distance_to_triangle(Vec3 p, Vec3 a, Vec3 b, Vec3 c) {
    const auto to_edge = [&](Vec3 q, Vec3 r) {
        const Vec3 e = r - q;
        const double l = dot(e, e);
        return length(p - (q + e * (l > 0 ? std::clamp(dot(p - q, e) / l, 0.0, 1.0) : 0.0)));
    };
    const Vec3 n = cross(b - a, c - a);
    if (dot(cross(b - a, p - a), n) >= 0 && dot(cross(c - b, p - b), n) >= 0 && dot(cross(a - c, p - c), n) >= 0 && length(n) > 0)
        return std::fabs(dot(p - a, normalize(n)));
    return std::min({to_edge(a, b), to_edge(b, c), to_edge(c, a)});
}

class Cutter {
public:
    Cutter(Surfaces& s, const World& world, Context& context) : s_(s), world_(world), context_(context) {
        for (std::size_t f = 0; f < s.faces.size(); ++f) {
            const Face& face = s.faces[f];
            if (!face.drawn || face.sky || face.triangle_count == 0) continue;
            drawn_.push_back(id<FaceId>(f));
            Box3 box; // of its triangles: a displaced face leaves the plane its bounds are of
            for (std::uint32_t t = face.first_triangle; t < face.first_triangle + face.triangle_count; ++t)
                for (const std::uint32_t p : s.triangles[t]) box.add(s.positions[p]);
            boxes_.push_back(box);
            by_side_.emplace_back(face.side, id<FaceId>(f));
        }
        std::ranges::sort(by_side_);
    }

    void run() {
        for (std::size_t i = 0; i < world_.overlays.size(); ++i) {
            context_.check_cancelled();
            const WorldOverlay& o = world_.overlays[i];
            const std::size_t before = s_.overlay_fragments.size();
            const char* why = o.kind == WorldOverlay::decal ? add_decal(i, o) : add_overlay(i, o);
            if (s_.overlay_fragments.size() == before)
                context_.report(Severity::warning, "overlay-nowhere",
                                fmt::format("{} '{}' shows nowhere: {}", o.kind == WorldOverlay::decal ? "the decal" : "the overlay",
                                            world_.materials[o.material.at()].name, why),
                                world_.location(o.entity));
        }
    }

private:
    Surfaces& s_;
    const World& world_;
    Context& context_;
    std::vector<FaceId> drawn_; // ascending
    std::vector<Box3> boxes_;   // parallel
    std::vector<std::pair<SideId, FaceId>> by_side_;

    const char* add_overlay(std::size_t index, const WorldOverlay& o) {
        if (o.sides.empty()) return "it names no side of the map";
        Projector projector;
        projector.origin = o.origin;
        // Rows of the inverse of (u, v, normal): editors round them, so they need not be orthogonal.
        const double volume = dot(cross(o.u, o.v), o.normal);
        projector.a = cross(o.v, o.normal) / volume, projector.b = cross(o.normal, o.u) / volume, projector.c = cross(o.u, o.v) / volume;
        projector.sheets = sheets_of(o.corners, o.uv_range);
        if (projector.sheets.empty()) return "its corners lie in one line";
        std::vector<FaceId> faces;
        for (const SideId side : o.sides)
            for (auto it = std::ranges::lower_bound(by_side_, std::pair(side, FaceId{0})); it != by_side_.end() && it->first == side; ++it)
                faces.push_back(it->second);
        if (faces.empty()) return "no face of its sides is drawn";
        std::ranges::sort(faces);
        faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
        const std::size_t before = s_.overlay_fragments.size();
        for (const FaceId f : faces) cut_face(static_cast<std::uint32_t>(index), f, projector, o.normal, 0);
        // Brushes get mirrored under their overlays; the sides are named all the same.
        if (s_.overlay_fragments.size() == before)
            for (const FaceId f : faces) cut_face(static_cast<std::uint32_t>(index), f, projector, -o.normal, 0);
        return "the faces of its sides lie beside it";
    }

    const char* add_decal(std::size_t index, const WorldOverlay& o) {
        // The nearest triangle; of equally near ones that whose front the decal is in, then the first.
        struct Nearest {
            double distance = kDecalReach;
            bool behind = true;
            FaceId face;
            Vec3 normal, point;
        } nearest;
        for (std::size_t i = 0; i < drawn_.size(); ++i) {
            Box3 reach = boxes_[i];
            for (std::size_t k = 0; k < 3; ++k) reach.lo[k] -= kDecalReach, reach.hi[k] += kDecalReach;
            if (!overlap(reach, Box3{o.origin, o.origin})) continue;
            const Face& face = s_.faces[drawn_[i].at()];
            for (std::uint32_t t = face.first_triangle; t < face.first_triangle + face.triangle_count; ++t) {
                const auto& tri = s_.triangles[t];
                const Vec3 n = normal_of(s_, t);
                const double distance = distance_to_triangle(o.origin, s_.positions[tri[0]], s_.positions[tri[1]], s_.positions[tri[2]]);
                const double height = dot(n, o.origin - s_.positions[tri[0]]);
                const bool behind = height < 0;
                if (std::tuple(distance, behind, drawn_[i]) >= std::tuple(nearest.distance, nearest.behind, nearest.face)) continue;
                nearest = {distance, behind, drawn_[i], n, o.origin - n * height};
            }
        }
        if (!nearest.face.valid()) return "no drawn face is within 8 units of it";
        const Vec3 n = nearest.normal;
        Projector projector;
        projector.origin = nearest.point;
        projector.c = n;
        // On walls v runs straight down; on floors and ceilings u runs along x.
        if (std::fabs(n.z) > kDecalFacing) {
            projector.b = normalize(cross(Vec3{1, 0, 0}, n));
            projector.a = normalize(cross(n, projector.b));
        } else {
            projector.a = normalize(cross(n, Vec3{0, 0, -1}));
            projector.b = normalize(cross(projector.a, n));
        }
        projector.depth = kDecalDepth;
        projector.sheets = sheets_of(o.corners, o.uv_range);
        double radius = kDecalDepth;
        for (const Vec2 c : o.corners) radius = std::max(radius, std::sqrt(dot(c, c) + kDecalDepth * kDecalDepth));
        Box3 box{nearest.point, nearest.point};
        for (std::size_t k = 0; k < 3; ++k) box.lo[k] -= radius, box.hi[k] += radius;
        const ModelId model = s_.faces[nearest.face.at()].model;
        for (std::size_t i = 0; i < drawn_.size(); ++i)
            if (s_.faces[drawn_[i].at()].model == model && overlap(box, boxes_[i])) cut_face(static_cast<std::uint32_t>(index), drawn_[i], projector, n, kDecalFacing);
        return "its picture has no size";
    }

    // Triangles that look along `towards`, by more than the cosine `facing`.
    void cut_face(std::uint32_t overlay, FaceId f, const Projector& projector, Vec3 towards, double facing) {
        const Face& face = s_.faces[f.at()];
        for (std::uint32_t t = face.first_triangle; t < face.first_triangle + face.triangle_count; ++t) {
            const Vec3 n = normal_of(s_, t);
            if (!(dot(n, towards) > facing)) continue;
            std::vector<Corner> triangle;
            for (const std::uint32_t p : s_.triangles[t]) {
                const Vec3 x = s_.positions[p], d = x - projector.origin;
                triangle.push_back({x, {dot(d, projector.a), dot(d, projector.b), dot(d, projector.c)}});
            }
            for (const Sheet& sheet : projector.sheets) add_part(overlay, f, triangle, projector, sheet);
        }
    }

    void add_part(std::uint32_t overlay, FaceId f, std::vector<Corner> part, const Projector& projector, const Sheet& sheet) {
        for (std::size_t i = 0; i < sheet.outline.size() && !part.empty(); ++i) {
            const Vec2 p = sheet.outline[i], e = sheet.outline[(i + 1) % sheet.outline.size()] - p;
            part = cut(part, [&](Vec3 x) { return cross(e, Vec2{x.x, x.y} - p); });
        }
        part = cut(part, [&](Vec3 x) { return projector.depth - x.z; });
        part = cut(part, [&](Vec3 x) { return projector.depth + x.z; });
        std::vector<Corner> clean;
        for (const Corner& c : part)
            if (clean.empty() || clean.back().position != c.position) clean.push_back(c);
        while (clean.size() > 1 && clean.back().position == clean.front().position) clean.pop_back();
        if (clean.size() < 3 || area_of(clean) < kSmallest) return;
        s_.overlay_fragments.push_back({overlay, f, static_cast<std::uint32_t>(s_.overlay_points.size()), static_cast<std::uint32_t>(clean.size())});
        for (const Corner& c : clean) {
            const double a = c.local.x - sheet.at.x, b = c.local.y - sheet.at.y;
            s_.overlay_points.push_back({c.position, sheet.uv_at + sheet.uv_a * a + sheet.uv_b * b});
        }
    }
};

} // namespace

void add_overlays(Surfaces& s, const World& world, Context& context) {
    if (world.overlays.empty()) return;
    Cutter(s, world, context).run();
}

} // namespace kiln

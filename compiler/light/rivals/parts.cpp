// Patches as those methods want them: flat, with a middle that lies on the surface, in few convex parts.
#include "compiler/light/rivals/parts.h"
#include "compiler/light/jacobi.h"
#include <map>
#include <numbers>

namespace kiln::rivals {
namespace {

constexpr std::size_t kMostLampParts = 1024; // of all emitters without a chart: a sky may be vast

struct LuxelRect {
    double x0, y0, x1, y1;
};
// Rectangles that share a whole side become one, first along x, then along y; the order of the input decides ties.
void merge(std::vector<LuxelRect>& rects) {
    for (const bool along_x : {true, false}) {
        std::ranges::sort(rects, {}, [&](const LuxelRect& r) {
            return along_x ? std::array{r.y0, r.y1, r.x0, r.x1} : std::array{r.x0, r.x1, r.y0, r.y1};
        });
        std::vector<LuxelRect> out;
        for (const LuxelRect& r : rects) {
            if (!out.empty()) {
                LuxelRect& last = out.back();
                if (along_x && last.y0 == r.y0 && last.y1 == r.y1 && last.x1 == r.x0) {
                    last.x1 = r.x1;
                    continue;
                }
                if (!along_x && last.x0 == r.x0 && last.x1 == r.x1 && last.y1 == r.y0) {
                    last.y1 = r.y1;
                    continue;
                }
            }
            out.push_back(r);
        }
        rects = std::move(out);
    }
}

bool holds(const Polygon& p, Vec3 n, Vec3 x) {
    for (std::size_t i = 0; i < p.size(); ++i)
        if (dot(cross(p[(i + 1) % p.size()] - p[i], x - p[i]), n) < 0) return false;
    return true;
}

// The middle of all parts, or of the part nearest to it where it lies outside of all.
Element element_of(std::vector<Polygon> parts, Vec3 normal) {
    Element e;
    e.normal = normal;
    Vec3 sum;
    std::vector<Vec3> middles;
    for (const Polygon& p : parts) {
        double a = 0;
        const Vec3 moment = moment_of(p, &a);
        e.area += a, sum += moment;
        middles.push_back(a > 0 ? moment / a : p[0]);
    }
    e.point = e.area > 0 ? sum / e.area : parts.at(0).at(0);
    const Vec3 wanted = e.point;
    double best = 1e300;
    for (std::size_t i = 0; i < parts.size(); ++i) {
        if (holds(parts[i], normal, wanted)) {
            e.point = wanted;
            break;
        }
        const Vec3 d = middles[i] - wanted;
        if (dot(d, d) < best) best = dot(d, d), e.point = middles[i];
    }
    e.parts = std::move(parts);
    return e;
}

std::vector<Polygon> parts_of_patch(const Surfaces& s, const PatchTable& table, std::size_t patch) {
    std::map<std::uint32_t, std::vector<LuxelRect>> rects; // by face
    std::vector<Polygon> parts;
    for (std::uint32_t k = table.first_piece[patch]; k < table.first_piece[patch + 1]; ++k) {
        const LuxelPiece& piece = s.pieces[table.pieces[k]];
        const PiecePoints points = points_of(s, piece);
        if (points.size() == 4) {
            LuxelRect r{points[0].x, points[0].y, points[0].x, points[0].y};
            for (const Vec2 p : points) r.x0 = std::min(r.x0, p.x), r.y0 = std::min(r.y0, p.y), r.x1 = std::max(r.x1, p.x), r.y1 = std::max(r.y1, p.y);
            bool straight = true;
            for (const Vec2 p : points) straight &= (p.x == r.x0 || p.x == r.x1) && (p.y == r.y0 || p.y == r.y1);
            if (straight) {
                rects[piece.face.value].push_back(r);
                continue;
            }
        }
        Polygon polygon;
        for (const Vec2 p : points) polygon.push_back(world_from_luxel(s, piece.face, p));
        parts.push_back(std::move(polygon));
    }
    for (auto& [face, list] : rects) {
        merge(list);
        const FaceId f{face};
        for (const LuxelRect& r : list)
            parts.push_back({world_from_luxel(s, f, {r.x0, r.y0}), world_from_luxel(s, f, {r.x1, r.y0}), world_from_luxel(s, f, {r.x1, r.y1}),
                             world_from_luxel(s, f, {r.x0, r.y1})});
    }
    if (table.first_piece[patch] == table.first_piece[patch + 1]) { // a face without a chart
        const Face& face = s.faces[table.patches[patch].face.at()];
        for (std::uint32_t t = face.first_triangle; t < face.first_triangle + face.triangle_count; ++t) {
            const auto& v = s.triangles[t];
            parts.push_back({s.positions[v[0]], s.positions[v[1]], s.positions[v[2]]});
        }
    }
    // The lattice may be mirrored against the world.
    const Vec3 n = s.faces[table.patches[patch].face.at()].normal;
    for (Polygon& p : parts)
        if (p.size() > 2 && dot(cross(p[1] - p[0], p[2] - p[0]), n) < 0) std::reverse(p.begin(), p.end());
    return parts;
}

void bisect(const Polygon& triangle, double size, std::vector<Polygon>& out) {
    std::size_t longest = 0;
    const auto edge = [&](std::size_t i) { return length(triangle[(i + 1) % 3] - triangle[i]); };
    for (std::size_t i = 1; i < 3; ++i)
        if (edge(i) > edge(longest)) longest = i;
    if (!(edge(longest) > 1.5 * size)) return out.push_back(triangle); // the diagonal of a square is no reason
    const Vec3 a = triangle[longest], b = triangle[(longest + 1) % 3], c = triangle[(longest + 2) % 3], m = (a + b) * 0.5;
    bisect({a, m, c}, size, out), bisect({m, b, c}, size, out);
}

} // namespace

Vec3 moment_of(const Polygon& p, double* area) {
    Vec3 sum;
    *area = 0;
    for (std::size_t i = 1; i + 1 < p.size(); ++i) {
        const double a = length(cross(p[i] - p[0], p[i + 1] - p[0])) / 2;
        sum += (p[0] + p[i] + p[i + 1]) * (a / 3), *area += a;
    }
    return sum;
}

std::uint64_t PatchSet::bytes() const {
    std::uint64_t sum = table.piece_patch.size() * 4 + table.texel_patch.size() * 4 + luxel_patch.size() * 4;
    for (const Element& e : elements) {
        sum += sizeof(Element) + sizeof(Rgbd) + sizeof(std::array<Vec3, 4>);
        for (const Polygon& p : e.parts) sum += p.size() * sizeof(Vec3);
    }
    return sum;
}

PatchSet uniform_patches(const Scene& scene, double size) {
    const Surfaces& s = scene.surfaces;
    PatchSet set;
    set.table = build_patches(scene.world, s, scene.edges(), size);
    const EmitterSet& emitters = scene.field().data().emitters;
    std::vector<std::uint8_t> covered(emitters.emitters.size());
    for (std::size_t p = 0; p < set.table.patches.size(); ++p) {
        const Patch& patch = set.table.patches[p];
        const Vec3 normal = s.faces[patch.face.at()].normal;
        set.elements.push_back(element_of(parts_of_patch(s, set.table, p), normal));
        set.directions.push_back(directions_at(scene, patch.face, set.elements.back().point));
        set.reflectance.push_back(static_cast<Rgbd>(patch.reflectance));
        const std::uint32_t emitter = emitters.of_face[patch.face.at()];
        if (emitter != UINT32_MAX && s.faces[patch.face.at()].chart.valid()) {
            set.lamps.push_back({set.elements.back(), emitters.emitters[emitter].radiance});
            covered[emitter] = 1;
        }
    }
    // The rest, sky above all: triangles, coarser until they are not too many.
    for (double h = size;; h *= 2) {
        std::vector<PatchSet::Lamp> rest;
        for (std::size_t e = 0; e < covered.size(); ++e) {
            if (covered[e]) continue;
            const Emitter& emitter = emitters.emitters[e];
            for (std::uint32_t t = 0; t < emitter.triangle_count; ++t) {
                const EmitterTriangle& tri = emitters.triangles[emitter.first_triangle + t];
                std::vector<Polygon> parts;
                bisect({tri.a, tri.b, tri.c}, h, parts);
                for (Polygon& p : parts) rest.push_back({element_of({std::move(p)}, emitter.normal), emitter.radiance});
                if (rest.size() > kMostLampParts && h < 1e6) break;
            }
        }
        if (rest.size() > kMostLampParts && h < 1e6) continue;
        set.lamps.insert(set.lamps.end(), std::make_move_iterator(rest.begin()), std::make_move_iterator(rest.end()));
        break;
    }
    set.luxel_patch.assign(s.luxels.size(), kNoPatch);
    for (std::size_t i = 0; i < s.luxels.size(); ++i) {
        double most = -1;
        for (std::uint32_t k = 0; k < s.luxels[i].piece_count; ++k) {
            const std::uint32_t piece = s.luxels[i].first_piece + k;
            const double a = polygon_area(points_of(s, s.pieces[piece]));
            if (a > most) most = a, set.luxel_patch[i] = set.table.piece_patch[piece];
        }
    }
    return set;
}

std::vector<Rgbd> solve_rows(const std::vector<Row>& rows, const std::vector<Rgbd>& direct, const std::vector<Rgbd>& reflectance, Context& context) {
    const auto add_row = [&](std::size_t p, const std::vector<Rgbd>& b, Rgbd& sum) {
        for (std::size_t k = 0; k < rows[p].patch.size(); ++k) sum += b[rows[p].patch[k]] * static_cast<double>(rows[p].factor[k]);
    };
    return solve_bounces(direct, reflectance, 1e-4, context, add_row, 1e30).irradiance;
}

Irradiance entities_at(const Scene& scene, Vec3 point, Vec3 normal, const std::array<Vec3, 4>& directions, std::uint64_t seed, std::atomic<std::uint64_t>& rays) {
    Irradiance sum{};
    std::uint64_t arrived = 0;
    scene.field().arriving_direct(point, normal, seed, [&](Vec3 way, Rgbd weight) { add(sum, directions, way, weight), ++arrived; });
    rays.fetch_add(std::max<std::uint64_t>(arrived, scene.lights.size()), std::memory_order_relaxed);
    return sum;
}


} // namespace kiln::rivals

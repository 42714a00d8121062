// Surfaces made directly from polygons, for tests of what comes after them: no map, no CSG, no BSP.
#pragma once
#include "compiler/surfaces/surfaces.h"
#include <map>
#include <span>
#include <vector>

namespace kiln::test {

struct FaceOptions {
    double luxel = 16;
    bool chart = true, drawn = true, blocks_light = true, sky = false;
};

struct Rect {
    double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
}; // along the two edges of a rectangle, map units

class SurfacesBuilder {
public:
    World world;
    Surfaces surfaces;

    SurfacesBuilder() { world.entities.resize(1); }

    MaterialId material(Rgb reflectance, Rgb emission = {}, std::uint32_t flags = 0) {
        Material m;
        m.name = "m" + std::to_string(world.materials.size());
        m.reflectance = reflectance, m.emission = emission, m.flags = flags, m.known = true;
        world.materials.push_back(m);
        return id<MaterialId>(world.materials.size() - 1);
    }

    // One face of convex polygons in one plane that do not overlap, counter-clockwise seen from the front.
    FaceId face(const std::vector<std::vector<Vec3>>& polygons, MaterialId material, FaceOptions options = {}) {
        Face f;
        const std::vector<Vec3>& first = polygons.at(0);
        f.normal = normalize(cross(first[1] - first[0], first[2] - first[0]));
        f.distance = dot(f.normal, first[0]);
        f.material = material;
        f.model = ModelId{0};
        f.tangent.n = f.normal;
        f.tangent.t = normalize(first[1] - first[0]);
        f.tangent.b = cross(f.normal, f.tangent.t);
        f.drawn = options.drawn, f.blocks_light = options.blocks_light, f.sky = options.sky;
        f.first_triangle = static_cast<std::uint32_t>(surfaces.triangles.size());
        const FaceId face_id = id<FaceId>(surfaces.faces.size());
        for (const auto& polygon : polygons) {
            std::vector<std::uint32_t> index;
            for (const Vec3 p : polygon) index.push_back(vertex(p)), f.bounds.add(p);
            for (std::size_t i = 1; i + 1 < index.size(); ++i) {
                surfaces.triangles.push_back({index[0], index[i], index[i + 1]});
                surfaces.triangle_face.push_back(face_id);
                const Vec3f n = static_cast<Vec3f>(f.normal);
                surfaces.corner_normals.push_back({n, n, n});
                f.area += length(cross(polygon[i] - polygon[0], polygon[i + 1] - polygon[0])) / 2;
            }
        }
        f.triangle_count = static_cast<std::uint32_t>(surfaces.triangles.size()) - f.first_triangle;
        if (options.chart && options.drawn && !options.sky) f.chart = chart(f, face_id, polygons, options.luxel);
        surfaces.faces.push_back(f);
        return face_id;
    }

    // Rectangle corner + [0,1] u + [0,1] v, facing cross(u, v), less `holes` (measured along u and v).
    FaceId rect(Vec3 corner, Vec3 u, Vec3 v, MaterialId material, FaceOptions options = {},
                std::vector<Rect> holes = {}) {
        const double w = length(u), h = length(v);
        const Vec3 a = u / w, b = v / h;
        std::vector<double> xs{0, w}, ys{0, h};
        for (const Rect& r : holes) xs.insert(xs.end(), {r.x0, r.x1}), ys.insert(ys.end(), {r.y0, r.y1});
        const auto tidy = [](std::vector<double>& x) {
            std::sort(x.begin(), x.end());
            x.erase(std::unique(x.begin(), x.end()), x.end());
        };
        tidy(xs), tidy(ys);
        std::vector<std::vector<Vec3>> polygons;
        for (std::size_t i = 0; i + 1 < xs.size(); ++i)
            for (std::size_t j = 0; j + 1 < ys.size(); ++j) {
                const double x = (xs[i] + xs[i + 1]) / 2, y = (ys[j] + ys[j + 1]) / 2;
                bool hole = false;
                for (const Rect& r : holes) hole |= x > r.x0 && x < r.x1 && y > r.y0 && y < r.y1;
                if (hole) continue;
                const auto at = [&](double p, double q) { return corner + a * p + b * q; };
                polygons.push_back(
                    {at(xs[i], ys[j]), at(xs[i + 1], ys[j]), at(xs[i + 1], ys[j + 1]), at(xs[i], ys[j + 1])});
            }
        return face(polygons, material, options);
    }

    // The inside of a box, materials in the order -x +x -y +y -z +z; `holes` per side, measured from the box's low
    // corner along the two other axes in cyclic order (x: y,z; y: z,x; z: x,y).
    void room(Box3 box, const std::array<MaterialId, 6>& materials, FaceOptions options = {},
              std::array<std::vector<Rect>, 6> holes = {}) {
        sides(box, materials, options, holes, true);
    }
    void block(Box3 box, const std::array<MaterialId, 6>& materials, FaceOptions options = {},
               std::array<std::vector<Rect>, 6> holes = {}) {
        sides(box, materials, options, holes, false);
    }

private:
    std::map<std::array<double, 3>, std::uint32_t> vertices_;

    std::uint32_t vertex(Vec3 p) {
        const auto [at, fresh] =
            vertices_.emplace(std::array{p.x, p.y, p.z}, static_cast<std::uint32_t>(surfaces.positions.size()));
        if (fresh) surfaces.positions.push_back(p);
        return at->second;
    }

    void sides(Box3 box, const std::array<MaterialId, 6>& materials, FaceOptions options,
               const std::array<std::vector<Rect>, 6>& holes, bool inward) {
        const Vec3 d = box.size();
        for (std::size_t axis = 0; axis < 3; ++axis)
            for (std::size_t side = 0; side < 2; ++side) {
                const MaterialId m = materials[axis * 2 + side];
                if (!m.valid()) continue;
                const std::size_t p = (axis + 1) % 3, q = (axis + 2) % 3;
                Vec3 u, v, corner = box.lo;
                u[p] = d[p], v[q] = d[q];
                corner[axis] = side ? box.hi[axis] : box.lo[axis];
                std::vector<Rect> cut = holes[axis * 2 + side];
                if ((side == 0) == inward) {
                    rect(corner, u, v, m, options, cut); // cross(u, v) = +axis
                } else {
                    for (Rect& r : cut) std::swap(r.x0, r.y0), std::swap(r.x1, r.y1);
                    rect(corner, v, u, m, options, cut);
                }
            }
    }

    static std::vector<Vec2> clip(const std::vector<Vec2>& in, Vec2 n, double d) { // keeps dot(n, p) >= d
        std::vector<Vec2> out;
        for (std::size_t i = 0; i < in.size(); ++i) {
            const Vec2 a = in[i], b = in[(i + 1) % in.size()];
            const double da = dot(n, a) - d, db = dot(n, b) - d;
            if (da >= 0) out.push_back(a);
            if ((da > 0 && db < 0) || (da < 0 && db > 0)) out.push_back(a + (b - a) * (da / (da - db)));
        }
        return out;
    }

    ChartId chart(const Face& f, FaceId face_id, const std::vector<std::vector<Vec3>>& polygons, double luxel) {
        Chart c;
        c.s = f.tangent.t, c.t = f.tangent.b, c.n = f.normal, c.frame = f.tangent;
        c.luxel_size = luxel;
        double s0 = 1e30, s1 = -1e30, t0 = 1e30, t1 = -1e30;
        for (const auto& polygon : polygons)
            for (const Vec3 p : polygon)
                s0 = std::min(s0, dot(p, c.s)), s1 = std::max(s1, dot(p, c.s)), t0 = std::min(t0, dot(p, c.t)),
                t1 = std::max(t1, dot(p, c.t));
        const double i0 = std::floor(s0 / luxel + 1e-9) - 1, j0 = std::floor(t0 / luxel + 1e-9) - 1;
        c.width = static_cast<std::uint32_t>(std::ceil(s1 / luxel - 1e-9) - i0) + 1;
        c.height = static_cast<std::uint32_t>(std::ceil(t1 / luxel - 1e-9) - j0) + 1;
        c.origin = c.s * (i0 * luxel) + c.t * (j0 * luxel) + c.n * f.distance;
        c.first_texel = surfaces.texel_count;
        c.faces = {face_id};
        surfaces.texel_count += c.width * c.height;
        const ChartId chart_id = id<ChartId>(surfaces.charts.size());
        for (std::uint32_t y = 0; y < c.height; ++y)
            for (std::uint32_t x = 0; x < c.width; ++x) {
                Luxel l;
                l.chart = chart_id, l.face = face_id;
                l.x = static_cast<std::uint16_t>(x), l.y = static_cast<std::uint16_t>(y);
                l.first_piece = static_cast<std::uint32_t>(surfaces.pieces.size());
                Vec2 moment;
                double area = 0;
                for (const auto& polygon : polygons) {
                    std::vector<Vec2> p;
                    for (const Vec3 v : polygon) {
                        const auto snap = [](double a) {
                            return std::abs(a - std::round(a)) < 1e-9 ? std::round(a) : a;
                        };
                        p.push_back({snap(dot(v, c.s) / luxel - i0), snap(dot(v, c.t) / luxel - j0)});
                    }
                    p = clip(p, {1, 0}, x), p = clip(p, {-1, 0}, -(x + 1.0));
                    p = clip(p, {0, 1}, y), p = clip(p, {0, -1}, -(y + 1.0));
                    double a = 0;
                    for (std::size_t i = 1; i + 1 < p.size(); ++i) {
                        const double w = cross(p[i] - p[0], p[i + 1] - p[0]) / 2;
                        a += w, moment = moment + (p[0] + p[i] + p[i + 1]) * (w / 3);
                    }
                    if (a < 1e-9) continue;
                    area += a;
                    surfaces.pieces.push_back({face_id, static_cast<std::uint32_t>(surfaces.piece_points.size()),
                                               static_cast<std::uint32_t>(p.size())});
                    surfaces.piece_points.insert(surfaces.piece_points.end(), p.begin(), p.end());
                    ++l.piece_count;
                }
                if (!l.piece_count) continue;
                l.area = static_cast<float>(area), l.centroid = static_cast<std::uint32_t>(surfaces.centroids.size());
                surfaces.centroids.push_back(moment * (1 / area));
                surfaces.luxels.push_back(l);
            }
        surfaces.charts.push_back(c);
        return chart_id;
    }
};

} // namespace kiln::test

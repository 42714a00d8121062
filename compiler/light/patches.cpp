#include "compiler/light/patches.h"
#include "libs/core/check.h"
#include "libs/core/each_once.h"
#include "libs/sampling/maps.h"
#include "libs/core/union_find.h"
#include "libs/parallel/parallel.h"
#include <map>
#include <numbers>
#include <unordered_map>

namespace kiln {
namespace {

constexpr double kTouch = 1e-5;        // luxel units: coordinates of neighbouring pieces are rounded separately
constexpr double kShortestEdge = 1e-3; // luxel units: contact shorter than this carries no light worth joining for
constexpr double kInset = 1 - 0x1p-9;  // footprint cells shrink to this share of themselves

bool whole(const Surfaces& s, const Luxel& l) {
    return l.piece_count == 1 && l.area > 1 - 1e-6f && points_of(s, s.pieces[l.first_piece]).size() == 4;
}

// Do two convex polygons share a stretch of edge?
bool share_edge(const PiecePoints& a, const PiecePoints& b) {
    for (std::size_t i = 0; i < a.size(); ++i) {
        const Vec2 p = a[i], d = a[(i + 1) % a.size()] - p;
        const double len = std::sqrt(dot(d, d));
        if (len < kShortestEdge) continue;
        const Vec2 u = d * (1 / len);
        for (std::size_t j = 0; j < b.size(); ++j) {
            const Vec2 q = b[j] - p, r = b[(j + 1) % b.size()] - p;
            if (std::abs(cross(u, q)) > kTouch || std::abs(cross(u, r)) > kTouch) continue;
            const double lo = std::max(0.0, std::min(dot(u, q), dot(u, r)));
            const double hi = std::min(len, std::max(dot(u, q), dot(u, r)));
            if (hi - lo > kShortestEdge) return true;
        }
    }
    return false;
}

} // namespace

double polygon_area(const PiecePoints& p) {
    double sum = 0;
    for (std::size_t i = 1; i + 1 < p.size(); ++i) sum += cross(p[i] - p[0], p[i + 1] - p[0]);
    return std::abs(sum) / 2;
}

LuxelIndex::LuxelIndex(const Surfaces& surfaces)
    : surfaces_(surfaces), texel_luxel_(surfaces.texel_count, UINT32_MAX) {
    for (std::size_t i = 0; i < surfaces.luxels.size(); ++i) texel_luxel_[texel_of(surfaces, surfaces.luxels[i])] = static_cast<std::uint32_t>(i);
    lattice_.resize(surfaces.faces.size());
    for (std::uint32_t f = 0; f < lattice_.size(); ++f) {
        const Face& face = surfaces.faces[f];
        if (!face.chart.valid()) continue;
        const Chart& c = surfaces.charts[face.chart.at()];
        lattice_[f] = {c.origin, c.s, c.t, c.luxel_size, c.luxel_size, c.first_texel, c.width, c.height};
        if (!face.curved()) continue;
        const LuxelMap& map = surfaces.luxel_map({f});
        lattice_[f].origin = map.origin, lattice_[f].s = map.s, lattice_[f].t = map.t, lattice_[f].unit = 1;
    }
}

std::uint32_t LuxelIndex::piece_at(FaceId face, Vec3 point) const {
    const Chart& c = surfaces_.charts[surfaces_.faces[face.at()].chart.at()];
    const Vec2 p = luxel_from_world(surfaces_, face, point);
    const std::uint32_t texel = texel_at(face, point) - c.first_texel;
    const int x0 = static_cast<int>(texel % c.width), y0 = static_cast<int>(texel / c.width);
    std::uint32_t best = UINT32_MAX;
    double best_out = 1e30; // how far the point is outside the piece
    const auto look = [&](int x, int y) {
        if (x < 0 || y < 0 || x >= static_cast<int>(c.width) || y >= static_cast<int>(c.height)) return;
        const std::uint32_t l =
            texel_luxel_[c.texel(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y))];
        if (l == UINT32_MAX) return;
        const Luxel& luxel = surfaces_.luxels[l];
        for (std::uint32_t k = 0; k < luxel.piece_count; ++k) {
            const LuxelPiece& piece = surfaces_.pieces[luxel.first_piece + k];
            double out = piece.face == face ? 0 : 100; // another face only where this one has nothing near
            double worst = 0;
            const PiecePoints v = points_of(surfaces_, piece);
            for (std::size_t i = 0; i < v.size(); ++i) {
                const Vec2 a = v[i], e = v[(i + 1) % v.size()] - a;
                const double len = std::sqrt(dot(e, e));
                if (len > 0) worst = std::max(worst, cross(p - a, e) / len);
            }
            out += worst;
            if (out < best_out) best_out = out, best = luxel.first_piece + k;
        }
    };
    look(x0, y0);
    if (best_out > 1e-3)
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx)
                if (dx || dy) look(x0 + dx, y0 + dy);
    return best;
}

std::uint32_t patch_at(const LuxelIndex& index, std::span<const std::uint32_t> texel_patch, std::span<const std::uint32_t> piece_patch,
                       std::span<const std::uint32_t> face_patch, FaceId face, Vec3 point) {
    const std::uint32_t texel = index.texel_at(face, point);
    if (texel == UINT32_MAX) return face_patch[face.at()];
    const std::uint32_t patch = texel_patch[texel];
    if (patch < kMixedPatch) return patch;
    const std::uint32_t piece = index.piece_at(face, point);
    return piece == UINT32_MAX ? kNoPatch : piece_patch[piece];
}

PieceEdges piece_adjacency(const Surfaces& s) {
    PieceEdges edges;
    const LuxelIndex index(s);
    const auto between = [&](const Luxel& a, const Luxel& b) {
        const bool plain = whole(s, a) && whole(s, b);
        for (std::uint32_t i = 0; i < a.piece_count; ++i)
            for (std::uint32_t j = 0; j < b.piece_count; ++j)
                if (plain || share_edge(points_of(s, s.pieces[a.first_piece + i]),
                                        points_of(s, s.pieces[b.first_piece + j]))) {
                    const std::uint32_t p = a.first_piece + i, q = b.first_piece + j;
                    edges.push_back({std::min(p, q), std::max(p, q)});
                }
    };
    for (const Luxel& l : s.luxels) {
        const Chart& c = s.charts[l.chart.at()];
        for (std::uint32_t i = 0; i < l.piece_count; ++i)
            for (std::uint32_t j = i + 1; j < l.piece_count; ++j)
                if (share_edge(points_of(s, s.pieces[l.first_piece + i]),
                               points_of(s, s.pieces[l.first_piece + j])))
                    edges.push_back({l.first_piece + i, l.first_piece + j});
        const std::uint32_t texel = c.texel(l.x, l.y);
        if (l.x + 1u < c.width && index.luxel_of(texel + 1) != UINT32_MAX)
            between(l, s.luxels[index.luxel_of(texel + 1)]);
        if (l.y + 1u < c.height && index.luxel_of(texel + c.width) != UINT32_MAX)
            between(l, s.luxels[index.luxel_of(texel + c.width)]);
    }
    std::sort(edges.begin(), edges.end());
    return edges;
}

PatchTable build_patches(const World& world, const Surfaces& s, const PieceEdges& edges, double h) {
    PatchTable out;
    const std::size_t piece_count = s.pieces.size();
    const Vec3 corner = least_corner(s);
    // The cell of each piece: block of luxels, and what must not be mixed in it.
    struct Key {
        std::uint64_t block = 0;
        std::uint64_t group = 0;
        bool operator==(const Key&) const = default;
    };
    std::vector<Key> key(piece_count);
    std::vector<double> area(piece_count), cell(piece_count);
    std::vector<std::uint32_t> piece_luxel(piece_count);
    const auto emits = [&](FaceId f) {
        return max_component(world.materials[s.faces[f.at()].material.at()].emission) > 0;
    };
    for (std::size_t i = 0; i < s.luxels.size(); ++i) {
        const Luxel& l = s.luxels[i];
        const Chart& c = s.charts[l.chart.at()];
        const int shift = std::clamp(static_cast<int>(std::floor(std::log2(h / c.luxel_size) + 1e-9)), 0, 12);
        // Blocks are counted from the corner of the map, one lattice for all of it that moves with it: an edit that leaves the corner moves none. The lattice of a curve
        // is its own.
        const auto block = [&](Vec3 axis, std::uint32_t at) {
            constexpr double kRounding = 1e-4; // luxels: what lies on a line of the lattice is beyond it, wherever the map stands
            const double from = c.curved() ? 0 : std::floor(dot(c.origin - corner, axis) / c.luxel_size + kRounding);
            return static_cast<std::uint64_t>((static_cast<long long>(from) + at + (1ll << 40)) >> shift) & 0xFFFFu;
        };
        for (std::uint32_t k = 0; k < l.piece_count; ++k) {
            const std::uint32_t p = l.first_piece + k;
            const FaceId face = s.pieces[p].face;
            key[p].block = (static_cast<std::uint64_t>(l.chart.value) << 32) |
                           (block(c.t, l.y) << 16) | block(c.s, l.x);
            // Faces of one material may share a patch, except lamps: each is an emitter of its own.
            key[p].group = emits(face) ? (1ull << 32) + face.value : s.faces[face.at()].material.value;
            area[p] = polygon_area(points_of(s, s.pieces[p])) * luxel_area(s, face);
            cell[p] = c.luxel_size * c.luxel_size * static_cast<double>(1u << (2 * shift));
            piece_luxel[p] = static_cast<std::uint32_t>(i);
        }
    }
    UnionFind sets(piece_count);
    for (const auto& [a, b] : edges)
        if (key[a] == key[b]) sets.join(a, b);
    // Slivers join their largest neighbour: a bundle of rays for an area that holds no energy is wasted. One pass,
    // smallest first, over the neighbours as they were.
    {
        std::vector<double> total(piece_count, 0);
        for (std::uint32_t p = 0; p < piece_count; ++p) total[sets.find(p)] += area[p];
        std::vector<std::uint32_t> best(piece_count, UINT32_MAX);
        for (const auto& [a, b] : edges) {
            if (key[a].group != key[b].group) continue;
            const std::uint32_t ra = sets.find(a), rb = sets.find(b);
            if (ra == rb) continue;
            const auto offer = [&](std::uint32_t small, std::uint32_t other) {
                if (total[small] > 0.08 * cell[small] || total[other] < total[small]) return;
                if (best[small] == UINT32_MAX || total[other] > total[best[small]] ||
                    (total[other] == total[best[small]] && other < best[small]))
                    best[small] = other;
            };
            offer(ra, rb), offer(rb, ra);
        }
        for (std::uint32_t p = 0; p < piece_count; ++p)
            if (best[p] != UINT32_MAX) sets.join(p, best[p]);
    }
    // Patches in the order of their first piece.
    out.piece_patch.assign(piece_count, kNoPatch);
    std::vector<std::uint32_t> of_root(piece_count, kNoPatch);
    std::vector<std::vector<std::uint32_t>> members;
    for (std::uint32_t p = 0; p < piece_count; ++p) {
        const std::uint32_t root = sets.find(p);
        if (of_root[root] == kNoPatch)
            of_root[root] = static_cast<std::uint32_t>(members.size()), members.emplace_back();
        out.piece_patch[p] = of_root[root];
        members[of_root[root]].push_back(p);
    }
    const auto patch_of_face = [&](FaceId f) {
        const Face& face = s.faces[f.at()];
        const Material& m = world.materials[face.material.at()];
        Patch patch;
        patch.face = f;
        if (face.drawn && !face.sky) patch.reflectance = m.reflectance;
        for (std::size_t c = 0; c < 3; ++c) patch.reflectance[c] = std::clamp(patch.reflectance[c], 0.0f, 0.99f);
        if (!face.sky) patch.emission = m.emission * static_cast<float>(std::numbers::pi);
        return patch;
    };
    for (const auto& list : members) {
        double most = 0, sum = 0;
        Vec3 moment;
        FaceId face = s.pieces[list[0]].face;
        for (const std::uint32_t p : list) {
            const LuxelPiece& piece = s.pieces[p];
            Vec2 mid;
            const PiecePoints points = points_of(s, piece);
            for (const Vec2 v : points) mid = mid + v;
            mid = mid * (1.0 / static_cast<double>(points.size()));
            moment += world_from_luxel(s, piece.face, mid) * area[p];
            sum += area[p];
            if (area[p] > most) most = area[p], face = piece.face;
        }
        Patch patch = patch_of_face(face);
        patch.area = sum;
        patch.centroid = sum > 0 ? moment / sum : Vec3{};
        out.first_piece.push_back(static_cast<std::uint32_t>(out.pieces.size()));
        out.pieces.insert(out.pieces.end(), list.begin(), list.end());
        out.patches.push_back(patch);
    }
    out.face_patch.assign(s.faces.size(), kNoPatch);
    for (std::size_t f = 0; f < s.faces.size(); ++f) {
        const Face& face = s.faces[f];
        if (face.chart.valid() || face.sky) continue;
        Patch patch = patch_of_face(id<FaceId>(f));
        if (max_component(patch.reflectance) == 0 && max_component(patch.emission) == 0) continue;
        Vec3 moment;
        for (std::uint32_t t = 0; t < face.triangle_count; ++t) {
            const auto& v = s.triangles[face.first_triangle + t];
            const Vec3 a = s.positions[v[0]], b = s.positions[v[1]], c = s.positions[v[2]];
            const double w = length(cross(b - a, c - a)) / 2;
            patch.area += w, moment += (a + b + c) * (w / 3);
        }
        if (!(patch.area > 0)) continue;
        patch.centroid = moment / patch.area;
        out.face_patch[f] = static_cast<std::uint32_t>(out.patches.size());
        out.first_piece.push_back(static_cast<std::uint32_t>(out.pieces.size()));
        out.patches.push_back(patch);
    }
    out.first_piece.push_back(static_cast<std::uint32_t>(out.pieces.size()));
    out.texel_patch.assign(s.texel_count, kNoPatch);
    for (const Luxel& l : s.luxels) {
        std::uint32_t& patch = out.texel_patch[texel_of(s, l)];
        for (std::uint32_t k = 0; k < l.piece_count; ++k) {
            const std::uint32_t q = out.piece_patch[l.first_piece + k];
            patch = k == 0 || patch == q ? q : kMixedPatch;
        }
    }
    return out;
}

std::vector<std::uint32_t> patches_of_luxels(const Surfaces& surfaces, std::span<const std::uint32_t> piece_patch) {
    std::vector<std::uint32_t> out(surfaces.luxels.size(), kNoPatch);
    for (std::size_t l = 0; l < out.size(); ++l) {
        const Luxel& luxel = surfaces.luxels[l];
        if (luxel.piece_count == 1) { // nearly all
            out[l] = piece_patch[luxel.first_piece];
            continue;
        }
        std::map<std::uint32_t, double> area;
        double most = -1;
        for (std::uint32_t piece = luxel.first_piece; piece < luxel.first_piece + luxel.piece_count; ++piece) {
            const double a = polygon_area(points_of(surfaces, surfaces.pieces[piece]));
            const std::uint32_t patch = piece_patch[piece];
            if ((area[patch] += a) > most) most = area[patch], out[l] = patch;
        }
    }
    return out;
}

std::vector<std::uint8_t> luxels_beside(const Surfaces& surfaces, const PieceEdges& edges, std::span<const std::uint32_t> piece_patch, std::span<const std::uint32_t> luxel_patch) {
    std::vector<std::uint8_t> out(surfaces.luxels.size());
    std::vector<std::uint32_t> luxel_of(surfaces.pieces.size(), UINT32_MAX);
    for (std::uint32_t l = 0; l < surfaces.luxels.size(); ++l)
        for (std::uint32_t k = surfaces.luxels[l].first_piece; k < surfaces.luxels[l].first_piece + surfaces.luxels[l].piece_count; ++k)
            if (piece_patch[k] == luxel_patch[l]) luxel_of[k] = l;
    for (const auto& [a, b] : edges) {
        const std::uint32_t p = luxel_of[a], q = luxel_of[b];
        if (p == UINT32_MAX || q == UINT32_MAX || surfaces.luxels[p].chart != surfaces.luxels[q].chart) continue;
        const Luxel &one = surfaces.luxels[p], &other = surfaces.luxels[q];
        for (std::size_t s = 0; s < kBeside.size(); ++s)
            if (other.x == one.x + kBeside[s][0] && other.y == one.y + kBeside[s][1]) out[p] |= static_cast<std::uint8_t>(1u << s), out[q] |= static_cast<std::uint8_t>(1u << (s ^ 1));
    }
    return out;
}

TouchingPatches touching_patches(const PieceEdges& edges, const PatchTable& table) {
    TouchingPatches pairs;
    for (const auto& [a, b] : edges)
        if (const std::uint32_t p = table.piece_patch[a], q = table.piece_patch[b]; p != q) pairs.push_back({std::min(p, q), std::max(p, q)});
    return each_once(std::move(pairs));
}

Grouped neighbours_of(const TouchingPatches& touching, std::size_t patches) {
    return Grouped(patches, [&](const auto& add) { // ascending, as the pairs are
        for (const auto& [p, q] : touching) add(p, q), add(q, p);
    });
}

std::vector<Rgbd> values_at_luxels(const Surfaces& s, const Grouped& neighbours, const Grouped& luxels, const std::vector<Rgbd>& values, Context& context) {
    constexpr double kRidge = 1e-3; // along which no neighbour lies, nothing is known
    constexpr std::size_t kChunk = 256;
    const std::size_t n = luxels.size();
    const auto place = [&](std::size_t l) { // chart coordinates, map units
        const Luxel& luxel = s.luxels[l];
        const Vec2 c = centroid_of(s, luxel);
        return c * s.charts[luxel.chart.at()].luxel_size;
    };
    std::vector<Vec2> center(n);
    std::vector<double> area(n);
    parallel_chunks(context, n, kChunk, [&](std::size_t begin, std::size_t end) {
        for (std::size_t p = begin; p < end; ++p) {
            for (const std::uint32_t l : luxels[p]) {
                const double a = s.luxels[l].area;
                center[p] = center[p] + place(l) * a, area[p] += a;
            }
            if (area[p] > 0) center[p] = center[p] * (1 / area[p]);
        }
    });
    std::vector<Rgbd> out(s.luxels.size());
    parallel_chunks(context, n, kChunk, [&](std::size_t begin, std::size_t end) {
        std::vector<Vec2> places;
        for (std::size_t p = begin; p < end; ++p) {
            double xx = 0, xy = 0, yy = 0;
            Rgbd x, y, most; // most: by which a neighbour differs
            for (const std::uint32_t q : neighbours[p]) {
                if (!(area[p] > 0 && area[q] > 0)) continue;
                const Vec2 d = center[q] - center[p];
                const double r2 = dot(d, d);
                if (!(r2 > 0)) continue;
                const Rgbd change = values[q] - values[p];
                const double w = std::min(area[p], area[q]) / (r2 * r2); // a sliver beside it says little
                xx += w * d.x * d.x, xy += w * d.x * d.y, yy += w * d.y * d.y;
                x += change * (w * d.x), y += change * (w * d.y);
                for (std::size_t c = 0; c < 3; ++c) most[c] = std::max(most[c], std::abs(change[c]));
            }
            const double ridge = kRidge * (xx + yy), along_xx = xx + ridge, along_yy = yy + ridge, det = along_xx * along_yy - xy * xy;
            if (!(det > 0)) {
                for (const std::uint32_t l : luxels[p]) out[l] = values[p];
                continue;
            }
            const Rgbd along_x = (x * along_yy - y * xy) / det, along_y = (y * along_xx - x * xy) / det;
            places.clear();
            Rgbd reach, share{1, 1, 1};
            for (const std::uint32_t l : luxels[p]) {
                const Vec2 d = places.emplace_back(place(l) - center[p]);
                for (std::size_t c = 0; c < 3; ++c) reach[c] = std::max(reach[c], std::abs(along_x[c] * d.x + along_y[c] * d.y));
            }
            for (std::size_t c = 0; c < 3; ++c)
                if (const double least = std::min(most[c], std::max(values[p][c], 0.0)); reach[c] > least) share[c] = least / reach[c];
            for (std::size_t k = 0; k < places.size(); ++k)
                for (std::size_t c = 0; c < 3; ++c) out[luxels[p][k]][c] = values[p][c] + share[c] * (along_x[c] * places[k].x + along_y[c] * places[k].y);
        }
    });
    return out;
}

void Footprint::add(Vec3 corner, Vec3 u, Vec3 v, Vec3 normal, bool parallelogram) {
    const double a = length(cross(u, v)) * (parallelogram ? 1 : 0.5);
    if (!(a > 0)) return;
    bent_ = bent_ || (!cells_.empty() && normal != cells_[0].normal);
    const double lu = length(u), lv = length(v), sum = area() + a;
    if (parallelogram) {
        const double su = std::clamp(1 - 2 * margin_ * lv / a, 0.0, kInset),
                     sv = std::clamp(1 - 2 * margin_ * lu / a, 0.0, kInset);
        cells_.push_back({corner + (u * (1 - su) + v * (1 - sv)) * 0.5, u * su, v * sv, normal, sum, true});
    } else {
        // Towards the centre of the inscribed circle, where all three sides are left behind at the same pace.
        const double lw = length(v - u), around = lu + lv + lw;
        const Vec3 center = corner + (u * lv + v * lu) / around;
        const double s = std::clamp(1 - margin_ * around / (2 * a), 0.0, kInset);
        cells_.push_back({center + (corner - center) * s, u * s, v * s, normal, sum, false});
    }
}

void Footprint::add_piece(const Surfaces& s, const LuxelPiece& piece) {
    const PiecePoints v = points_of(s, piece);
    const auto at = [&](std::size_t i) { return world_from_luxel(s, piece.face, v[i]); };
    const Vec3 n = s.faces[piece.face.at()].normal;
    if (v.size() == 4) {
        const Vec2 skew = v[0] + v[2] - v[1] - v[3];
        if (dot(skew, skew) < 1e-12) return add(at(0), at(1) - at(0), at(3) - at(0), n, true);
    }
    for (std::size_t i = 1; i + 1 < v.size(); ++i) add(at(0), at(i) - at(0), at(i + 1) - at(0), n, false);
}

void Footprint::add_triangle(Vec3 a, Vec3 b, Vec3 c, Vec3 normal) {
    add(a, b - a, c - a, normal, false);
}

Vec3 Footprint::centroid() const {
    Vec3 sum;
    double before = 0;
    for (const Cell& c : cells_) {
        sum += (c.corner + (c.u + c.v) * (c.parallelogram ? 0.5 : 1.0 / 3)) * (c.cumulative - before);
        before = c.cumulative;
    }
    return sum / area();
}

Footprint::Point Footprint::sample_cells(Vec2 u) const {
    const double wanted = u.x * area();
    const auto cell = std::lower_bound(cells_.begin(), cells_.end() - 1, wanted,
                                       [](const Cell& c, double x) { return c.cumulative <= x; });
    const double before = cell == cells_.begin() ? 0 : (cell - 1)->cumulative;
    u.x = std::clamp((wanted - before) / (cell->cumulative - before), 0.0, 1.0);
    if (cell->parallelogram) return {cell->corner + cell->u * u.x + cell->v * u.y, cell->normal};
    const Vec2 w = uniform_triangle(u);
    return {cell->corner + cell->u * w.x + cell->v * w.y, cell->normal};
}

} // namespace kiln

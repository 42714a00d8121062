// A level file as its run time sees it: through the loader alone.
#include "compiler/verify/oracle.h"
#include "compiler/verify/verify.h"
#include "formats/level/kiln_level.hpp"
#include <bit>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <set>

namespace kiln {
namespace {

using namespace verify;

constexpr double kFloat = 0x1p-23;

Vec3 vec(const double* v) { return {v[0], v[1], v[2]}; }
Vec3 vec(const float* v) { return {v[0], v[1], v[2]}; }
bool finite(Vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }
double reach(Vec3 v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

class Reader {
public:
    Reader(const level::Level& level, std::string name, const VerifyOptions& options, Checker& checker)
        : l(level), name_(std::move(name)), options_(options), checker_(checker), info_(level.info()) {}

    void check() {
        if (!lumps()) return; // what is damaged reads as empty
        planes(), tree(), portals(), vis(), points();
        faces(), charts(), pages();
        light(), entities();
    }

private:
    const level::Level& l;
    std::string name_;
    const VerifyOptions& options_;
    Checker& checker_;
    kiln_info info_;

    Finding found(std::string what) const { return {{name_}, std::move(what)}; }
    Finding of_face(std::size_t f, std::string what) const {
        kiln_source s{};
        SourceLocation where{name_};
        if (kiln_level_face_source(l.get(), static_cast<std::uint32_t>(f), &s) == KILN_OK) where.entity = s.entity, where.brush = s.brush, where.side = s.side;
        return {where, fmt::format("face {}: {}", f, what)};
    }

    bool lumps() {
        Check& lumps = checker_.add("level-lumps");
        for (std::size_t i = 0; i < kiln_level_lump_count(l.get()); ++i) {
            kiln_lump lump{};
            kiln_level_lump(l.get(), i, &lump);
            const char* what = "";
            const kiln_status s = kiln_level_load(l.get(), i, &what);
            lumps.expect(s == KILN_OK, [&] { return found(fmt::format("lump {} {}: {}: {}", lump.name, lump.index, kiln_status_text(s), what)); });
        }
        lumps.expect(nlohmann::json::accept(l.meta_json()), [&] { return found("lump META is not JSON"); });
        return lumps.ok();
    }

    void planes() {
        Check& planes = checker_.add("level-planes");
        const auto p = l.planes();
        planes.expect(p.size() % 2 == 0, [&] { return found("the planes have no pairs"); });
        for (std::size_t i = 0; i < p.size(); ++i) {
            const Vec3 n = vec(p[i].normal);
            planes.expect(std::abs(length(n) - 1) < 1e-12 && std::isfinite(p[i].distance), [&] { return found(fmt::format("the normal of plane {} is not unit", i)); });
            const Vec3 exact{static_cast<double>(p[i].exact_normal[0]), static_cast<double>(p[i].exact_normal[1]), static_cast<double>(p[i].exact_normal[2])};
            if (length(exact) > 0) { // not stripped
                const auto d = static_cast<double>(static_cast<__int128>(p[i].exact_d_high) << 64 | static_cast<__int128>(p[i].exact_d_low));
                planes.expect(length(exact / length(exact) - n) < 1e-12 &&
                                  std::abs(std::ldexp(d, -static_cast<int>(info_.plane_grid_bits)) / length(exact) - p[i].distance) <= 1e-9 * (1 + std::abs(p[i].distance)),
                              [&] { return found(fmt::format("plane {} is not its integers", i)); });
            }
            if (i % 2 == 0) continue;
            planes.expect(vec(p[i - 1].normal) == -n && p[i - 1].distance == -p[i].distance, [&] { return found(fmt::format("plane {} is not the other side of plane {}", i, i - 1)); });
        }
    }

    bool box_holds(const float* lo, const float* hi, Vec3 p) const {
        for (std::size_t k = 0; k < 3; ++k) {
            const double slack = 4 * kFloat * (1 + std::abs(p[k]));
            if (p[k] < lo[k] - slack || p[k] > hi[k] + slack) return false;
        }
        return true;
    }

    void tree() {
        Check &tree = checker_.add("level-tree"), &leaves = checker_.add("level-leaves");
        const auto nodes = l.nodes();
        const auto leaf = l.leaves();
        tree.expect(leaf.size() == nodes.size() + 1 || (leaf.empty() && nodes.empty()), [&] { return found(fmt::format("{} nodes part {} leaves", nodes.size(), leaf.size())); });
        std::vector<int> node_seen(nodes.size()), leaf_seen(leaf.size());
        if (!nodes.empty()) ++node_seen[0];
        else if (!leaf.empty()) ++leaf_seen[0];
        for (std::size_t n = 0; n < nodes.size(); ++n)
            for (const std::int32_t c : nodes[n].child) {
                const auto child = static_cast<std::size_t>(c >= 0 ? c : -(c + 1));
                if (!tree.expect(child < (c >= 0 ? nodes.size() : leaf.size()), [&] { return found(fmt::format("node {} has no child {}", n, c)); })) continue;
                ++(c >= 0 ? node_seen : leaf_seen)[child];
                if (c < 0) continue;
                bool within = true;
                for (std::size_t k = 0; k < 3; ++k) within = within && nodes[child].lo[k] >= nodes[n].lo[k] && nodes[child].hi[k] <= nodes[n].hi[k];
                tree.expect(within, [&] { return found(fmt::format("the bounds of node {} reach out of those of node {}", child, n)); });
            }
        for (std::size_t n = 0; n < node_seen.size(); ++n) tree.expect(node_seen[n] == 1, [&] { return found(fmt::format("node {} is reached {} times", n, node_seen[n])); });
        for (std::size_t n = 0; n < leaf_seen.size(); ++n) tree.expect(leaf_seen[n] == 1, [&] { return found(fmt::format("leaf {} is reached {} times", n, leaf_seen[n])); });

        const auto brushes = l.leaf_brushes(), leaf_faces = l.leaf_faces();
        std::vector<char> shown(l.faces().size());
        std::vector<Box3> bounds = face_bounds();
        for (std::size_t i = 0; i < leaf.size(); ++i) {
            const kiln_leaf& f = leaf[i];
            const auto tell = [&](const char* what) { return [&, what] { return found(fmt::format("leaf {}: {}", i, what)); }; };
            leaves.expect(f.contents != 1 || f.cluster < 0, tell("it is solid and has a cluster"));
            leaves.expect(f.lo[0] <= f.hi[0] && f.lo[1] <= f.hi[1] && f.lo[2] <= f.hi[2], tell("its bounds are empty"));
            const auto b = brushes.subspan(f.first_brush, f.brush_count), s = leaf_faces.subspan(f.first_face, f.face_count);
            leaves.expect(std::ranges::is_sorted(b) && std::ranges::is_sorted(s), tell("its lists are not sorted"));
            leaves.expect(s.empty() || f.cluster >= 0, tell("it lists faces, but is no open leaf inside"));
            for (const std::uint32_t face : s) {
                shown[face] = 1;
                const Box3& box = bounds[face];
                bool meets = !box.empty();
                for (std::size_t k = 0; k < 3; ++k) {
                    const double slack = grid() + 4 * kFloat * (1 + std::abs(f.lo[k]) + std::abs(f.hi[k]));
                    meets = meets && box.lo[k] <= f.hi[k] + slack && box.hi[k] >= f.lo[k] - slack;
                }
                leaves.expect(meets, [&] { return of_face(face, fmt::format("leaf {} lists it, but does not reach it", i)); });
            }
        }
        if (leaf.empty()) return;
        for (std::size_t f = 0; f < shown.size(); ++f)
            if (const kiln_face& face = l.faces()[f]; face.model == 0 && (face.flags & KILN_FACE_DRAWN) && face.triangle_count)
                leaves.expect(shown[f] != 0, [&] { return of_face(f, "it is drawn, but no leaf lists it"); });
    }
    double grid() const { return std::ldexp(1.0, -static_cast<int>(info_.position_grid_bits)); }
    Vec3 position(std::uint32_t v) const {
        const auto p = l.grid_positions();
        return Vec3{static_cast<double>(p[3 * v]), static_cast<double>(p[3 * v + 1]), static_cast<double>(p[3 * v + 2])} * grid();
    }
    std::vector<Box3> face_bounds() const {
        std::vector<Box3> bounds(l.faces().size());
        const auto t = l.triangles();
        for (std::size_t f = 0; f < bounds.size(); ++f)
            for (std::size_t k = 3 * std::size_t{l.faces()[f].first_triangle}; k < 3 * (std::size_t{l.faces()[f].first_triangle} + l.faces()[f].triangle_count); ++k) bounds[f].add(position(t[k]));
        return bounds;
    }

    void portals() {
        Check& portals = checker_.add("level-portals");
        const auto p = l.portals();
        const auto leaf = l.leaves();
        const auto planes = l.planes();
        for (std::size_t i = 0; i < p.size(); ++i) {
            std::vector<Vec3> w;
            for (std::uint32_t k = 0; k < p[i].point_count; ++k) w.push_back(vec(&l.portal_points()[3 * (std::size_t{p[i].first_point} + k)]));
            const auto tell = [&](std::string what) { return [&, what] { return found(fmt::format("portal {} at {}: {}", i, w.empty() ? "nowhere" : at(w[0]), what)); }; };
            if (!portals.expect(w.size() >= 3 && area(w) > 0, tell("it has no area"))) continue;
            const kiln_plane& plane = planes[p[i].plane];
            const Vec3 n = vec(plane.normal);
            bool flat = true, left = true;
            for (std::size_t k = 0; k < w.size(); ++k) {
                const Vec3 a = w[k], b = w[(k + 1) % w.size()], c = w[(k + 2) % w.size()];
                const double slack = 8 * kFloat * (1 + reach(a));
                flat = flat && std::abs(dot(n, a) - plane.distance) <= slack;
                left = left && dot(cross(b - a, c - b), n) >= -slack * (length(b - a) + length(c - b));
            }
            portals.expect(flat, tell("its points do not lie in its plane"));
            portals.expect(left, tell("it is not convex and counter-clockwise"));
            portals.expect(p[i].leaf[0] != p[i].leaf[1], tell("it joins a leaf with itself"));
            for (const std::int32_t side : p[i].leaf) {
                const kiln_leaf& f = leaf[static_cast<std::size_t>(side)];
                portals.expect(f.cluster >= 0, tell(fmt::format("leaf {} has no cluster", side)));
                portals.expect(std::ranges::all_of(w, [&](Vec3 x) { return box_holds(f.lo, f.hi, x); }), tell(fmt::format("it reaches out of leaf {}", side)));
            }
        }
    }

    void vis() {
        Check& vis = checker_.add("level-vis");
        const auto clusters = static_cast<std::int32_t>(info_.clusters);
        std::vector<const std::uint64_t*> rows;
        std::size_t words = 0;
        for (std::int32_t c = 0; c < clusters; ++c) rows.push_back(kiln_level_pvs_row(l.get(), c, &words));
        const auto sees = [&](std::size_t a, std::size_t b) { return (rows[a][b / 64] >> (b % 64) & 1) != 0; };
        for (std::size_t a = 0; a < rows.size(); ++a) {
            if (!vis.expect(rows[a] != nullptr, [&] { return found(fmt::format("cluster {} has no row", a)); })) return;
            vis.expect(sees(a, a), [&] { return found(fmt::format("cluster {} does not see itself", a)); });
        }
        for (std::size_t a = 0; a < rows.size(); ++a)
            for (std::size_t w = 0; w < words; ++w)
                for (std::uint64_t bits = rows[a][w]; bits; bits &= bits - 1) {
                    const std::size_t b = w * 64 + static_cast<std::size_t>(std::countr_zero(bits));
                    vis.expect(b < rows.size() && sees(b, a), [&] { return found(fmt::format("cluster {} sees {}, which does not see it", a, b)); });
                }
        for (const kiln_portal& p : l.portals()) {
            const std::int32_t a = l.leaves()[static_cast<std::size_t>(p.leaf[0])].cluster, b = l.leaves()[static_cast<std::size_t>(p.leaf[1])].cluster;
            if (a >= 0 && b >= 0)
                vis.expect(sees(static_cast<std::size_t>(a), static_cast<std::size_t>(b)), [&] { return found(fmt::format("clusters {} and {} share a portal, but do not see each other", a, b)); });
        }
        std::vector<std::uint64_t> shut(words);
        for (std::int32_t c = 0; c < clusters; ++c) {
            if (!vis.expect(kiln_level_read_shut_row(l.get(), c, shut.data(), words) == KILN_OK, [&] { return found(fmt::format("cluster {} has no row for shut area portals", c)); })) return;
            bool held = shut[static_cast<std::size_t>(c) / 64] >> (c % 64) & 1;
            for (std::size_t w = 0; w < words; ++w) held = held && !(shut[w] & ~rows[static_cast<std::size_t>(c)][w]);
            vis.expect(held, [&] { return found(fmt::format("cluster {} sees more while area portals are shut than when they are open, or not itself", c)); });
        }
    }

    // Solid leaves are where structural brushes are, and leaves list the brushes in them.
    void points() {
        Check& points = checker_.add("level-points");
        const auto leaf = l.leaves();
        const auto brushes = l.brushes();
        if (leaf.empty() || brushes.empty()) return;
        Box3 all;
        for (const kiln_leaf& f : leaf) all.add(vec(f.lo)), all.add(vec(f.hi));
        RandomPoints random(options_.seed);
        const auto depth = [&](const kiln_brush& b, Vec3 p) {
            double d = -1e30;
            for (std::uint32_t k = 0; k < b.plane_count; ++k) {
                const kiln_plane& plane = l.planes()[l.brush_planes()[b.first_plane + k]];
                d = std::max(d, dot(vec(plane.normal), p) - plane.distance);
            }
            return d;
        };
        for (std::size_t i = 0; i < options_.points; ++i) {
            const Vec3 p = random.in(all);
            const double xyz[3] = {p.x, p.y, p.z};
            const std::uint32_t at_leaf = kiln_level_find_leaf(l.get(), xyz);
            if (!points.expect(at_leaf < leaf.size(), [&] { return found(fmt::format("no leaf holds {}", at(p))); })) continue;
            const auto listed = l.leaf_brushes().subspan(leaf[at_leaf].first_brush, leaf[at_leaf].brush_count);
            bool solid = false, doubtful = false;
            std::optional<std::size_t> missing;
            for (std::size_t b = 0; b < brushes.size(); ++b) {
                if (brushes[b].model != 0 || brushes[b].plane_count == 0) continue;
                const double d = depth(brushes[b], p);
                doubtful = doubtful || std::abs(d) < 1e-3;
                if (d >= 0) continue;
                solid = solid || brushes[b].contents == 1;
                if ((brushes[b].contents == 1 || brushes[b].contents == 2) && !std::ranges::binary_search(listed, static_cast<std::uint32_t>(b))) missing = b;
            }
            if (doubtful) continue;
            points.expect(solid == (leaf[at_leaf].contents == 1), [&] { return found(fmt::format("at {} leaf {} has contents {}, the brushes say it {} solid", at(p), at_leaf, leaf[at_leaf].contents, solid ? "is" : "is not")); });
            points.expect(!missing, [&] { return found(fmt::format("brush {} holds {}, but leaf {} there does not list it", *missing, at(p), at_leaf)); });
        }
    }

    void faces() {
        Check &faces = checker_.add("level-faces"), &mesh = checker_.add("level-mesh");
        const auto f = l.faces();
        const auto t = l.triangles();
        const auto normals = l.corner_normals();
        std::size_t next = 0;
        for (std::size_t i = 0; i < f.size(); ++i) {
            const auto tell = [&](const char* what) { return [&, what] { return of_face(i, what); }; };
            const Vec3 n = vec(f[i].normal), tangent = vec(f[i].tangent), bitangent = vec(f[i].bitangent);
            const kiln_plane& plane = l.planes()[f[i].plane];
            const bool curved = (f[i].flags & KILN_FACE_CURVED) != 0; // many planes: what follows from one does not hold
            faces.expect(curved || length(vec(plane.normal) - n) < 1e-5, tell("its normal is not that of its plane"));
            faces.expect(std::abs(length(tangent) - 1) < 1e-5 && std::abs(length(bitangent) - 1) < 1e-5 && std::abs(dot(tangent, n)) < 1e-5 && std::abs(dot(bitangent, n)) < 1e-5 &&
                             std::abs(dot(tangent, bitangent)) < 1e-5,
                         tell("its tangent frame is not orthonormal"));
            faces.expect(finite(vec(f[i].u_axis)) && finite(vec(f[i].v_axis)) && std::isfinite(f[i].u_shift) && std::isfinite(f[i].v_shift) && f[i].u_scale != 0 && f[i].v_scale != 0,
                         tell("its texture projection is none"));
            faces.expect(f[i].first_triangle == next, tell("its triangles do not follow those of the face before"));
            next = std::size_t{f[i].first_triangle} + f[i].triangle_count;
            for (std::size_t k = f[i].first_triangle; k < next; ++k) {
                Vec3 p[3];
                bool flat = true, unit = true;
                for (std::size_t c = 0; c < 3; ++c) {
                    p[c] = position(t[3 * k + c]);
                    flat = flat && std::abs(dot(vec(plane.normal), p[c]) - plane.distance) <= 0.9 * grid() + 1e-9 * (1 + reach(p[c]));
                    unit = unit && std::abs(length(vec(&normals[9 * k + 3 * c])) - 1) < 1e-3;
                }
                mesh.expect(flat || curved, tell("a corner of it does not lie in its plane"));
                mesh.expect(unit, tell("a corner normal of it is not unit"));
                // Rounding to the grid may fold slivers.
                mesh.expect(curved || dot(cross(p[1] - p[0], p[2] - p[0]), vec(plane.normal)) >= -2 * grid() * (length(p[1] - p[0]) + length(p[2] - p[0])), tell("a triangle of it faces the wrong way"));
            }
        }
        mesh.expect(next == t.size() / 3, [&] { return found("some triangles belong to no face"); });
        Check& materials = checker_.add("level-materials");
        for (const kiln_material& m : l.materials()) {
            const Vec3 r = vec(m.reflectance), e = vec(m.emission);
            materials.expect(finite(r) && finite(e) && std::min({r.x, r.y, r.z, e.x, e.y, e.z}) >= 0 && std::max({r.x, r.y, r.z}) <= 1 && m.width > 0 && m.height > 0,
                             [&] { return found(fmt::format("material {}: reflectance within 0..1, emission from 0, a size", m.name)); });
        }
    }

    void charts() {
        Check &charts = checker_.add("level-charts"), &apart = checker_.add("level-charts-apart");
        const auto c = l.charts();
        std::set<std::array<std::uint32_t, 5>> places;
        std::vector<std::vector<char>> taken(info_.pages);
        std::vector<kiln_page> pages(info_.pages);
        for (std::uint32_t p = 0; p < info_.pages; ++p) {
            kiln_level_page_info(l.get(), p, &pages[p]);
            taken[p].resize(std::size_t{pages[p].width} * pages[p].height);
        }
        for (std::size_t i = 0; i < c.size(); ++i) {
            const auto tell = [&](const char* what) { return [&, what] { return found(fmt::format("chart {}: {}", i, what)); }; };
            if (!charts.expect(c[i].page < pages.size(), tell("its page does not exist"))) continue;
            const kiln_page& page = pages[c[i].page];
            const bool fits = std::uint64_t{c[i].page_x} + c[i].width <= page.width && std::uint64_t{c[i].page_y} + c[i].height <= page.height;
            const double across = length(vec(c[i].s)), down = length(vec(c[i].t));
            charts.expect(c[i].luxel_size > 0 && across > 0 && down > 0 && std::abs(dot(vec(c[i].s), vec(c[i].t))) < 1e-9 * across * down, tell("its axes are not at right angles"));
            charts.expect((page.layers >= 3) == (c[i].directional != 0), tell("its page has not the layers it needs"));
            if (!apart.expect(fits, tell("it reaches out of its page"))) continue;
            if (!places.insert({c[i].page, c[i].page_x, c[i].page_y, c[i].width, c[i].height}).second) continue; // the very same texels
            bool free = true;
            for (std::size_t y = c[i].page_y; y < std::size_t{c[i].page_y} + c[i].height; ++y)
                for (std::size_t x = c[i].page_x; x < std::size_t{c[i].page_x} + c[i].width; ++x) free = !std::exchange(taken[c[i].page][y * page.width + x], 1) && free;
            apart.expect(free, tell("it overlaps another on its page"));
        }
        const auto t = l.triangles();
        for (std::size_t f = 0; f < l.faces().size(); ++f) {
            const kiln_face& face = l.faces()[f];
            if (face.chart == KILN_NO_INDEX) continue;
            const kiln_chart& chart = c[face.chart];
            // Filtering reads a half texel around.
            const double across = length(vec(chart.s)), down = length(vec(chart.t)), slack_s = grid() * across / chart.luxel_size + 1e-3, slack_t = grid() * down / chart.luxel_size + 1e-3;
            const auto inside = [&](double at_s, double at_t) { return at_s >= 0.5 - slack_s && at_t >= 0.5 - slack_t && at_s <= chart.width - 0.5 + slack_s && at_t <= chart.height - 0.5 + slack_t; };
            bool within = true;
            if (face.flags & KILN_FACE_CURVED) {
                std::size_t n = 0;
                const kiln_curve_corner* corners = kiln_level_curve_corners(l.get(), static_cast<std::uint32_t>(f), &n);
                charts.expect(corners && n == face.triangle_count, [&] { return of_face(f, "it is curved, but its triangles have no corners of a curve"); });
                for (std::size_t k = 0; corners && k < 3 * n; ++k)
                    within = within && inside(corners[k].luxel[0], corners[k].luxel[1]);
                charts.expect(within, [&] { return of_face(f, fmt::format("it reaches out of chart {}", face.chart)); });
                continue;
            }
            for (std::size_t k = 3 * std::size_t{face.first_triangle}; k < 3 * (std::size_t{face.first_triangle} + face.triangle_count); ++k) {
                const Vec3 x = position(t[k]) - vec(chart.origin);
                within = within && inside(dot(x, vec(chart.s)) / chart.luxel_size, dot(x, vec(chart.t)) / chart.luxel_size);
            }
            charts.expect(within, [&] { return of_face(f, fmt::format("it reaches out of chart {}", face.chart)); });
        }
    }

    void pages() {
        Check& texels = checker_.add("level-texels");
        for (std::uint32_t p = 0; p < info_.pages; ++p) {
            kiln_page page{};
            if (!texels.expect(kiln_level_page(l.get(), p, &page) == KILN_OK, [&] { return found(fmt::format("page {} cannot be read", p)); })) continue;
            for (std::uint32_t layer = 0; layer < page.layers; ++layer)
                for (std::uint32_t y = 0; y < page.height; ++y)
                    for (std::uint32_t x = 0; x < page.width; ++x) {
                        float rgb[3];
                        kiln_level_page_texel(l.get(), p, layer, x, y, rgb);
                        const bool flat = page.layers == 1 || layer == 3;
                        texels.expect(finite(vec(rgb)) && (!flat || std::min({rgb[0], rgb[1], rgb[2]}) >= 0), [&] { return found(fmt::format("texel {} {} of layer {} of page {} is {} {} {}", x, y, layer, p, rgb[0], rgb[1], rgb[2])); });
                    }
        }
    }

    void light() {
        Check &lights = checker_.add("level-lights"), &cubes = checker_.add("level-cubes"), &probes = checker_.add("level-probes");
        for (std::size_t i = 0; i < l.lights().size(); ++i) {
            const kiln_light& e = l.lights()[i];
            lights.expect(e.kind <= 3 && finite(vec(e.position)) && finite(vec(e.intensity)) && (e.kind == 0 || e.kind == 3 || std::abs(length(vec(e.direction)) - 1) < 1e-6),
                          [&] { return found(fmt::format("light {} has no place, strength or direction", i)); });
        }
        for (std::size_t i = 0; i < l.cubes().size(); ++i) {
            const kiln_cube& c = l.cubes()[i];
            bool good = finite(vec(c.position));
            for (const auto& rgb : c.irradiance) good = good && finite(vec(rgb)); // a direction may be below 0: it corrects its neighbours
            cubes.expect(good, [&] { return found(fmt::format("cube {} at {} is not finite", i, at(vec(c.position)))); });
        }
        for (std::size_t i = 0; i < l.cube_cells().size(); ++i) {
            const kiln_cube_cell& c = l.cube_cells()[i];
            bool good = c.size > 0 && c.mask <= 255;
            for (std::size_t k = 0; k < 8; ++k) good = good && (!(c.mask >> k & 1) || c.cubes[k] < l.cubes().size());
            cubes.expect(good, [&] { return found(fmt::format("cell {} uses a corner that has no cube", i)); });
        }
        for (std::size_t i = 0; i < l.probes().size(); ++i) {
            const kiln_probe& p = l.probes()[i];
            std::size_t count = 0;
            float scale = 0;
            const std::uint32_t* texels = kiln_level_probe_texels(l.get(), static_cast<std::uint32_t>(i), &count, &scale);
            probes.expect(texels && count > 0 && std::isfinite(scale) && scale > 0 && finite(vec(p.position)), [&] { return found(fmt::format("probe {} has no picture or no place", i)); });
            if (p.boxed) {
                bool inside = true;
                for (std::size_t k = 0; k < 3; ++k) inside = inside && p.box_lo[k] < p.box_hi[k] && p.position[k] >= p.box_lo[k] && p.position[k] <= p.box_hi[k];
                probes.expect(inside, [&] { return found(fmt::format("probe {} stands outside its box", i)); });
            }
        }
    }

    void entities() {
        Check& entities = checker_.add("level-entities");
        std::vector<int> owners(info_.models);
        for (std::uint32_t e = 0; e < info_.entities; ++e) {
            const std::int32_t m = kiln_level_entity_model(l.get(), e);
            if (m >= 0 && entities.expect(static_cast<std::uint32_t>(m) < info_.models, [&] { return found(fmt::format("entity {} has model {} of {}", e, m, info_.models)); })) ++owners[static_cast<std::size_t>(m)];
        }
        for (std::size_t m = 1; m < owners.size(); ++m) entities.expect(owners[m] == 1, [&] { return found(fmt::format("{} entities have model {}", owners[m], m)); });
    }
};

} // namespace

void verify_level(std::span<const std::uint8_t> bytes, const std::string& name, const VerifyOptions& options, Checker& checker) {
    try {
        const level::Level level(bytes);
        Reader(level, name, options, checker).check();
    } catch (const level::LevelError& e) {
        checker.add("level-lumps").expect(false, [&] { return Finding{{name}, e.what()}; });
    }
}

} // namespace kiln

// Level contents made for tests: a box room whose every value is known, and a wild mixture of everything.
#pragma once
#include "formats/level/level_writer.h"
#include <cmath>
#include <random>

namespace kiln::level::test {

constexpr double kPi = 3.14159265358979323846;

inline Float3 f3(Double3 v) {
    return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}
inline Double3 cross(Double3 a, Double3 b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Pairs (2i, 2i + 1) facing both ways: x = d, y = d, z = d.
inline std::uint32_t add_axial_plane(LevelContent& c, std::size_t axis, std::int64_t d) {
    for (const int sign : {1, -1}) {
        Plane p;
        p.normal[axis] = sign, p.distance = sign * static_cast<double>(d), p.exact[axis] = sign;
        const __int128 wide = static_cast<__int128>(sign) * d;
        p.exact_d_high = static_cast<std::int64_t>(wide >> 64), p.exact_d_low = static_cast<std::uint64_t>(wide);
        c.planes.push_back(p);
    }
    return static_cast<std::uint32_t>(c.planes.size() - 2);
}

// The inside of a cube of half edge 128: six faces of 16 x 16 luxels (and gutter), irradiance `value(face, x, y)`.
// Leaf 0: the air; leaves 1..6: solid around. One cluster.
template <class Value> LevelContent room(std::uint8_t encoding, bool directional, const Value& value) {
    LevelContent c;
    c.source_name = "room.map", c.compiler_version = "test", c.rnm_encoding = encoding;
    c.options_json = "{\"a\":1}", c.input_hash = "0123", c.error_json = "{\"estimate\":1.5}";
    c.materials.push_back({.name = "white", .albedo_map = "", .normal_map = "", .reflectance = {0.5f, 0.25f, 0.75f}});
    constexpr double r = 128;
    constexpr std::uint32_t size = 18;
    for (std::size_t axis = 0; axis < 3; ++axis)
        for (const int sign : {1, -1}) {
            const std::uint32_t plane = add_axial_plane(c, axis, sign * 128); // x = +-128
            Double3 n{}, s{}, t{};
            n[axis] = -sign, s[(axis + 1) % 3] = 1;
            t = cross(n, s);
            FaceInfo f;
            f.plane = plane + (sign > 0 ? 1u : 0u); // faces the air
            f.chart = static_cast<std::uint32_t>(c.charts.size());
            f.first_triangle = static_cast<std::uint32_t>(c.triangles.size()), f.triangle_count = 2;
            f.normal = f3(n), f.tangent = f3(s), f.bitangent = f3(t);
            f.u_axis = s, f.v_axis = t;
            const auto corner = [&](int a, int b) {
                Double3 p{};
                for (std::size_t k = 0; k < 3; ++k) p[k] = r * (-n[k] + a * s[k] + b * t[k]);
                for (std::uint32_t i = 0; i < c.positions.size(); ++i)
                    if (c.positions[i] == p) return i;
                c.positions.push_back(p);
                return static_cast<std::uint32_t>(c.positions.size() - 1);
            };
            const std::uint32_t q[4] = {corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)};
            c.triangles.push_back({q[0], q[1], q[2]}), c.triangles.push_back({q[0], q[2], q[3]});
            for (int k = 0; k < 2; ++k) c.corner_normals.push_back({f.normal, f.normal, f.normal});
            c.faces.push_back(f);
            ChartInfo chart;
            for (std::size_t k = 0; k < 3; ++k) chart.origin[k] = -r * n[k] - (r + 16) * (s[k] + t[k]);
            chart.s = s, chart.t = t, chart.width = chart.height = size, chart.directional = directional;
            chart.tangent = f.tangent, chart.bitangent = f.bitangent, chart.normal = f.normal;
            c.charts.push_back(chart);
            c.chart_first_texel.push_back(static_cast<std::uint32_t>(c.flat.size()));
            c.chart_first_rnm.push_back(directional ? static_cast<std::uint32_t>(c.rnm.size()) : UINT32_MAX);
            for (std::uint32_t y = 0; y < size; ++y)
                for (std::uint32_t x = 0; x < size; ++x) {
                    const std::array<Float3, 4> v = value(c.charts.size() - 1, x, y); // flat, l0, l1, l2
                    c.flat.push_back(v[0]);
                    if (directional) c.rnm.push_back({v[1], v[2], v[3]});
                    c.valid.push_back(x == 0 || y == 0 || x + 1 == size || y + 1 == size ? 2 : 1);
                    c.texel_error.push_back(0.01f);
                }
        }
    // Tree: outside of each wall in turn is solid, what remains is the room. Plane 2i + (i odd) faces the air.
    for (std::uint32_t i = 0; i < 6; ++i) {
        const std::uint32_t plane = c.faces[i].plane;
        Node n;
        n.plane = plane;
        n.child = {i == 5 ? -1 : static_cast<std::int32_t>(i + 1), -static_cast<std::int32_t>(i + 2)};
        n.lo = {-129, -129, -129}, n.hi = {129, 129, 129};
        c.nodes.push_back(n);
    }
    c.leaves.resize(7);
    c.leaves[0].cluster = 0, c.leaves[0].area = 1;
    c.leaves[0].lo = {-128, -128, -128}, c.leaves[0].hi = {128, 128, 128};
    c.leaves[0].faces = {0, 1, 2, 3, 4, 5};
    for (std::size_t i = 1; i < 7; ++i) c.leaves[i].contents = 1;
    c.cluster_count = 1, c.vis_rows = {1};
    c.entities.push_back({.keys = {{"classname", "worldspawn"}, {"message", "a \"room\"\\ \xff"}}, .model = 0, .source_line = 1});
    return c;
}
// A cube [-16, 16]^3 in the middle of the room, with a bevel at its edge x = y = 16.
inline void add_brush(LevelContent& c, std::uint8_t contents = 1, std::uint32_t model = 0) {
    Brush b;
    b.contents = contents, b.model = model;
    for (std::size_t axis = 0; axis < 3; ++axis)
        for (const int sign : {1, -1}) b.planes.push_back(add_axial_plane(c, axis, sign * 16) + (sign < 0 ? 1u : 0u)), b.source_sides.push_back(0);
    b.bevels.push_back({{std::sqrt(0.5), std::sqrt(0.5), 0}, 32 * std::sqrt(0.5)});
    if (model == 0) c.leaves[0].brushes.push_back(static_cast<std::uint32_t>(c.brushes.size()));
    c.brushes.push_back(b);
}
inline LevelContent constant_room(Float3 e, bool directional = false) {
    return room(0, directional, [&](std::size_t, std::uint32_t, std::uint32_t) {
        const float s = 1 / std::sqrt(3.0f);
        const Float3 l{e[0] * s, e[1] * s, e[2] * s};
        return std::array<Float3, 4>{e, l, l, l};
    });
}

// Cubes on the corners of one root cell that spans the room, and a probe whose texels tell their direction.
inline void add_air(LevelContent& c, const std::array<std::array<Float3, 6>, 8>& corners, std::uint8_t mask = 255) {
    c.cubes = {};
    c.cubes.origin = {-128, -128, -128}, c.cubes.root_size = 256, c.cubes.root_count = {1, 1, 1};
    c.cubes.tree = {-1};
    CubeCell cell;
    cell.lo = {-128, -128, -128}, cell.size = 256, cell.mask = mask;
    for (std::uint32_t i = 0; i < 8; ++i) {
        if (!(mask >> i & 1)) {
            cell.cubes[i] = UINT32_MAX;
            continue;
        }
        cell.cubes[i] = static_cast<std::uint32_t>(c.cubes.cubes.size());
        Cube cube;
        cube.position = {i & 1 ? 128.f : -128.f, i & 2 ? 128.f : -128.f, i & 4 ? 128.f : -128.f};
        cube.irradiance = corners[i];
        c.cubes.cubes.push_back(cube);
    }
    c.cubes.cells = {cell};
}
template <class Value> void add_probe(LevelContent& c, std::uint32_t size, std::uint32_t mips, const Value& value) {
    ProbeInfo p;
    p.size = size, p.mips = mips;
    for (std::uint32_t m = 0; m < mips; ++m)
        for (int face = 0; face < 6; ++face)
            for (std::uint32_t y = 0; y < size >> m; ++y)
                for (std::uint32_t x = 0; x < size >> m; ++x)
                    p.texels.push_back(value(m, face, (2 * (x + 0.5) / (size >> m)) - 1, (2 * (y + 0.5) / (size >> m)) - 1));
    c.probes.push_back(std::move(p));
}

// Everything at once, with no geometric sense but with valid indices. `size` scales all counts.
inline LevelContent mixture(std::uint64_t seed, std::uint32_t size = 20, std::uint8_t encoding = 0) {
    std::mt19937_64 random(seed);
    const auto below = [&](std::uint32_t n) { return static_cast<std::uint32_t>(random() % n); };
    const auto real = [&](double lo, double hi) {
        return lo + (hi - lo) * static_cast<double>(random() >> 11) * 0x1p-53;
    };
    const auto vec = [&](double r) { return Double3{real(-r, r), real(-r, r), real(-r, r)}; };
    LevelContent c;
    c.source_name = "mixture.vmf", c.compiler_version = "0.1 \x01", c.rnm_encoding = encoding;
    c.plane_grid_bits = 6, c.cluster_count = 3 * size, c.model_count = 3;
    for (std::uint32_t i = 0; i < 2 * size; ++i) {
        Plane p;
        p.normal = vec(1), p.distance = real(-4096, 4096);
        for (auto& e : p.exact) e = static_cast<std::int64_t>(random());
        p.exact_d_high = static_cast<std::int64_t>(random() >> 20), p.exact_d_low = i % 5 ? random() : 0;
        Plane q;
        for (std::size_t k = 0; k < 3; ++k) q.normal[k] = -p.normal[k], q.exact[k] = -p.exact[k];
        q.distance = -p.distance;
        const __int128 d = -((static_cast<__int128>(p.exact_d_high) << 64) + p.exact_d_low);
        q.exact_d_high = static_cast<std::int64_t>(d >> 64), q.exact_d_low = static_cast<std::uint64_t>(d);
        c.planes.push_back(p), c.planes.push_back(q);
    }
    const auto planes = static_cast<std::uint32_t>(c.planes.size());
    const std::uint32_t leaves = 4 * size, faces = 5 * size, brushes = 2 * size, charts = 3 * size, probes = 2, lights = 6;
    for (std::uint32_t i = 0; i < 3 * size; ++i)
        c.nodes.push_back({below(planes), {-static_cast<std::int32_t>(below(leaves)) - 1, static_cast<std::int32_t>(below(3 * size))}, f3(vec(9)), f3(vec(9))});
    for (std::uint32_t i = 0; i < leaves; ++i) {
        Leaf l;
        l.contents = static_cast<std::uint8_t>(below(8)), l.cluster = static_cast<std::int32_t>(below(c.cluster_count + 1)) - 1;
        l.area = below(4), l.probe = below(3) ? below(probes) : UINT32_MAX, l.lo = f3(vec(9)), l.hi = f3(vec(9));
        for (std::uint32_t k = below(5); k-- > 0;) l.brushes.push_back(below(brushes));
        for (std::uint32_t k = below(5); k-- > 0;) l.faces.push_back(below(faces));
        c.leaves.push_back(l);
    }
    const std::size_t words = (c.cluster_count + 63) / 64;
    for (std::uint32_t i = 0; i < c.cluster_count; ++i)
        for (std::size_t w = 0; w < words; ++w)
            c.vis_rows.push_back(i % 4 == 3 ? c.vis_rows[w] : random() & random()); // each fourth: that of cluster 0
    for (std::uint32_t i = 0; i < 2 * size; ++i) {
        Portal p;
        p.leaf = {static_cast<std::int32_t>(below(leaves)), static_cast<std::int32_t>(below(leaves))}, p.plane = below(planes);
        for (std::uint32_t k = 3 + below(4); k-- > 0;) p.winding.push_back(f3(vec(1000)));
        c.portals.push_back(p);
    }
    for (std::uint32_t i = 0; i < brushes; ++i) {
        Brush b;
        b.model = below(3), b.contents = static_cast<std::uint8_t>(below(11)), b.source_id = static_cast<std::int32_t>(i) + 7;
        b.source_entity = 2, b.source_line = static_cast<std::int32_t>(below(1000));
        for (std::uint32_t k = 4 + below(4); k-- > 0;) b.planes.push_back(below(planes)), b.source_sides.push_back(static_cast<std::int32_t>(below(99)));
        for (std::size_t slot = 0; slot < 6 && i % 3; ++slot) {
            Bevel bevel;
            bevel.normal[slot / 2] = slot % 2 ? 1 : -1, bevel.distance = 0.125 * i + static_cast<double>(slot);
            b.bevels.push_back(bevel);
        }
        if (i % 4 == 0) b.bevels.push_back({{0.6, 0, -0.8}, -9.5 - i});
        c.brushes.push_back(b);
    }
    for (std::uint32_t i = 0; i < 4; ++i) {
        MaterialInfo m;
        m.name = "mat/" + std::to_string(i), m.albedo_map = i % 2 ? "x.png" : "", m.normal_map = i % 3 ? "" : "n.png";
        m.reflectance = f3(vec(1)), m.emission = f3(vec(3)), m.alpha = 0.5f, m.env_map = 0.25f, m.flags = below(65536);
        m.width = 1 + below(256), m.height = 1 + below(256);
        c.materials.push_back(m);
    }
    // A bumpy sheet of size x size quads, dealt out to the faces in runs; off the position grid here and there.
    for (std::uint32_t y = 0; y <= size; ++y)
        for (std::uint32_t x = 0; x <= size; ++x)
            c.positions.push_back({16.0 * x, 16.0 * y, below(3) ? 8.0 * below(4) : real(0, 32)});
    std::vector<std::array<std::uint32_t, 3>> sheet;
    for (std::uint32_t y = 0; y < size; ++y)
        for (std::uint32_t x = 0; x < size; ++x) {
            const std::uint32_t a = y * (size + 1) + x, b = a + 1, d = a + size + 1, e = d + 1;
            sheet.push_back({a, b, e}), sheet.push_back({e, d, a});
        }
    for (std::uint32_t i = 0; i < faces; ++i) {
        FaceInfo f;
        f.material = below(4), f.model = below(3), f.plane = below(planes);
        f.chart = i < charts ? i : UINT32_MAX, f.probe = below(3) ? below(probes) : UINT32_MAX;
        const std::size_t begin = sheet.size() * i / faces, end = sheet.size() * (i + 1) / faces;
        f.first_triangle = static_cast<std::uint32_t>(begin), f.triangle_count = static_cast<std::uint32_t>(end - begin);
        f.drawn = below(5) != 0, f.sky = below(5) == 0, f.two_sided = below(5) == 0;
        f.normal = {0, 0, 1}, f.tangent = {1, 0, 0}, f.bitangent = {0, below(2) ? 1.f : -1.f, 0};
        f.u_axis = vec(1), f.v_axis = vec(1), f.u_scale = 0.25, f.v_scale = -0.5, f.u_shift = real(0, 64), f.v_shift = real(0, 64);
        f.source_entity = 1, f.source_brush = static_cast<std::int32_t>(below(50)), f.source_side = static_cast<std::int32_t>(i);
        f.source_line = static_cast<std::int32_t>(below(5000));
        for (std::size_t t = begin; t < end; ++t) {
            c.triangles.push_back(sheet[t]);
            Double3 n{real(-.5, .5), real(-.5, .5), 1};
            const double l = std::sqrt(n[0] * n[0] + n[1] * n[1] + 1);
            for (double& v : n) v /= l;
            c.corner_normals.push_back(i % 2 ? std::array<Float3, 3>{f.normal, f.normal, f.normal} : std::array<Float3, 3>{f3(n), f.normal, f3(n)});
        }
        c.faces.push_back(f);
    }
    for (std::uint32_t i = 0; i < charts; ++i) {
        ChartInfo k;
        k.origin = vec(100), k.s = {1, 0, 0}, k.t = {0, 1, 0}, k.luxel_size = static_cast<float>(1 + below(32));
        k.width = 3 + below(20), k.height = 3 + below(20), k.directional = below(2) == 0, k.smooth = below(3) == 0;
        k.tangent = {1, 0, 0}, k.bitangent = {0, 1, 0}, k.normal = {0, 0, 1}, k.error = 0.03f;
        c.chart_first_texel.push_back(static_cast<std::uint32_t>(c.flat.size()));
        c.chart_first_rnm.push_back(k.directional ? static_cast<std::uint32_t>(c.rnm.size()) : UINT32_MAX);
        for (std::uint32_t t = 0; t < k.width * k.height; ++t) {
            const Float3 e = {static_cast<float>(real(0, 3)), static_cast<float>(real(0, 1)), static_cast<float>(real(0, 300))};
            c.flat.push_back(e), c.valid.push_back(static_cast<std::uint8_t>(below(3))), c.texel_error.push_back(static_cast<float>(real(0, 0.1)));
            if (!k.directional) continue;
            const float low = encoding == 1 ? 0 : -2;
            std::array<Float3, 3> l;
            for (auto& v : l) v = {static_cast<float>(real(low, 3)), static_cast<float>(real(low, 3)), static_cast<float>(real(low, 3))};
            c.rnm.push_back(l);
        }
        c.charts.push_back(k);
    }
    for (std::uint32_t i = 0; i < lights; ++i) {
        LocalLight l;
        l.kind = static_cast<std::uint8_t>(below(4)), l.falloff = static_cast<std::uint8_t>(below(3)), l.position = vec(500), l.direction = vec(1);
        l.intensity = f3(vec(100)), l.range = real(0, 500), l.fade_end = 3, l.exponent = 2, l.style = below(30), l.entity = 5, l.line = 9;
        l.angular_radius_rad = 0.1, l.angle_scale = 0.5, l.cos_inner = 0.9, l.cos_outer = 0.8, l.constant = 1, l.linear = 2;
        c.lights.push_back(l);
    }
    std::array<std::array<Float3, 6>, 8> corners{};
    for (auto& corner : corners)
        for (auto& face : corner) face = f3(vec(2));
    add_air(c, corners);
    for (Cube& cube : c.cubes.cubes)
        for (std::uint32_t k = below(3); k-- > 0;) cube.local_lights.push_back(below(lights));
    for (std::uint32_t i = 0; i < probes; ++i) {
        add_probe(c, 8, 3, [&](std::uint32_t, int, double, double) { return Float3{static_cast<float>(real(0, 5)), static_cast<float>(real(0, 5)), static_cast<float>(real(0, 5))}; });
        c.probes.back().position = f3(vec(100)), c.probes.back().boxed = true, c.probes.back().box_lo = {-1, -2, -3}, c.probes.back().box_hi = {4, 5, 6};
        c.probes.back().entity = static_cast<std::int32_t>(i);
    }
    for (std::uint32_t i = 0; i < size; ++i) {
        EntityInfo e;
        e.model = static_cast<std::int32_t>(below(4)) - 1, e.source_id = static_cast<std::int32_t>(i), e.source_line = 3;
        for (std::uint32_t k = below(4); k-- > 0;) e.keys.emplace_back("key" + std::to_string(below(3)), std::to_string(random()));
        c.entities.push_back(e);
    }
    return c;
}

} // namespace kiln::level::test

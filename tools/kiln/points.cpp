// sample, gather, reference: light at given points, three ways, in one table format.
//
// In   rows kind,id,px,py,pz,nx,ny,nz,tx,ty,tz: kind `s` on a surface (unit normal n, unit tangent t, b = n x t), `f`
//      free in the air; map units
// Out  rows kind,id,dir,r,g,b,se_r,se_g,se_b: dir n, b1, b2, b3 for surface points, the six axes for free ones;
//      irradiance along dir, one sigma standard errors
#include "compiler/light/field.h"
#include "formats/level/kiln_level.h"
#include "libs/core/file.h"
#include "libs/parallel/parallel.h"
#include "tools/kiln/commands.h"
#include "tools/kiln/level_file.h"
#include <charconv>
#include <fmt/format.h>
#include <memory>

namespace kiln {
namespace {

constexpr double kFarthest = 1e6; // map units: beyond any world

struct Point {
    bool surface = false;
    std::string id;
    Vec3 position, normal, tangent;
};

std::vector<std::string> split(std::string_view line, char separator) {
    std::vector<std::string> parts;
    for (std::size_t begin = 0;;) {
        const std::size_t end = line.find(separator, begin);
        parts.emplace_back(line.substr(begin, end - begin));
        if (end == std::string_view::npos) return parts;
        begin = end + 1;
    }
}

Result<std::vector<Point>> read_points(const std::string& path) {
    const auto bytes = read_file(path);
    if (!bytes) return bytes.fault();
    const std::string text(bytes->begin(), bytes->end());
    std::vector<Point> points;
    int number = 0;
    bool header = true;
    for (std::string line : split(text, '\n')) {
        ++number;
        if (!line.empty() && line.back() == '\r') line.pop_back();
        if (line.empty() || line[0] == '#') continue;
        if (std::exchange(header, false)) {
            if (!line.starts_with("kind,id,px,py,pz"))
                return fault(Exit::input, "points-header", "the first row must be kind,id,px,py,pz,nx,ny,nz,tx,ty,tz", {.file = path, .line = number});
            continue;
        }
        const auto parts = split(line, ',');
        const auto bad = [&](const char* what) { return fault(Exit::input, "points-row", what, {.file = path, .line = number}); };
        if (parts.size() < 5 || (parts[0] != "s" && parts[0] != "f")) return bad("a row is s or f, an id, and numbers");
        Point p{parts[0] == "s", parts[1], {}, {}, {}};
        if (p.surface && parts.size() < 11) return bad("a surface row needs a position, a normal and a tangent");
        double v[9] = {};
        for (std::size_t i = 0; i < (p.surface ? 9u : 3u); ++i) {
            const std::string& word = parts[i + 2];
            const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), v[i]);
            if (error != std::errc() || end != word.data() + word.size() || !(std::abs(v[i]) <= kFarthest)) return bad("not a number within a million map units");
        }
        p.position = {v[0], v[1], v[2]}, p.normal = normalize(Vec3{v[3], v[4], v[5]}), p.tangent = normalize(Vec3{v[6], v[7], v[8]});
        if (p.surface && !(length(p.normal) > 0.5 && length(cross(p.normal, p.tangent)) > 0.5)) return bad("normal and tangent must span a frame");
        points.push_back(std::move(p));
    }
    return points;
}

struct Direction {
    const char* name;
    Vec3 world;
};
std::vector<Direction> directions(const Point& p) {
    if (!p.surface)
        return {{"+x", {1, 0, 0}}, {"-x", {-1, 0, 0}}, {"+y", {0, 1, 0}}, {"-y", {0, -1, 0}}, {"+z", {0, 0, 1}}, {"-z", {0, 0, -1}}};
    const Frame f{p.tangent, cross(p.normal, p.tangent), p.normal};
    const double a = 1 / std::sqrt(6.0), b = 1 / std::sqrt(2.0), c = 1 / std::sqrt(3.0);
    return {{"n", p.normal}, {"b1", f.world({-a, b, c})}, {"b2", f.world({-a, -b, c})}, {"b3", f.world({std::sqrt(2.0 / 3), 0, c})}};
}

constexpr std::uint32_t kMostRays = 1u << 20; // of a replicate

using Row = std::pair<Rgbd, Rgbd>; // value, standard error
std::string table(const std::vector<Point>& points, const std::vector<std::vector<Row>>& rows) {
    std::string out = "kind,id,dir,r,g,b,se_r,se_g,se_b\n";
    for (std::size_t i = 0; i < points.size(); ++i) {
        const auto dirs = directions(points[i]);
        for (std::size_t k = 0; k < rows[i].size(); ++k) {
            const auto& [v, e] = rows[i][k];
            out += fmt::format("{},{},{},{:.6g},{:.6g},{:.6g},{:.3g},{:.3g},{:.3g}\n", points[i].surface ? "s" : "f", points[i].id, dirs[k].name,
                               v.x, v.y, v.z, e.x, e.y, e.z);
        }
    }
    return out;
}
int write_table(Console& console, const std::string& output, const std::string& text) {
    if (output.empty()) return print_output(text);
    const auto written = write_file(output, text);
    return written ? 0 : console.fail(written.fault());
}

struct PointOptions {
    BakeOptions bake;
    std::string points, output;
    std::uint64_t rays = 0;
    std::uint32_t replicates = 4;
};

// Mean and standard error over independently scrambled replicates.
template <class Estimate> std::vector<Row> replicate(const Point& p, std::uint32_t count, Estimate&& estimate) {
    const auto dirs = directions(p);
    std::vector<Rgbd> sum(dirs.size()), square(dirs.size());
    for (std::uint32_t r = 0; r < count; ++r) {
        std::vector<Rgbd> value(dirs.size());
        estimate(r, [&](Vec3 w, Rgbd weight) {
            for (std::size_t k = 0; k < dirs.size(); ++k) value[k] += weight * std::max(0.0, dot(w, dirs[k].world));
        });
        for (std::size_t k = 0; k < dirs.size(); ++k) sum[k] += value[k], square[k] += value[k] * value[k];
    }
    std::vector<Row> rows(dirs.size());
    const double n = count;
    for (std::size_t k = 0; k < dirs.size(); ++k) {
        const Rgbd m = sum[k] / n;
        Rgbd e{};
        for (std::size_t c = 0; c < 3 && count > 1; ++c) e[c] = std::sqrt(std::max(0.0, square[k][c] / n - m[c] * m[c]) / (n - 1));
        rows[k] = {m, e};
    }
    return rows;
}

// Where a point lies within a hair of a surface, rays start off it.
Vec3 off_surface(const Point& p) { return p.surface ? p.position + p.normal * 0.02 : p.position; }

int run_points(PointOptions& o, bool reference) {
    Console console;
    o.bake.settle(console);
    Context context = console.make_context(o.bake.thread_count());
    const auto points = read_points(o.points);
    if (!points) return console.fail(points.fault());
    if (same_file(o.output, o.bake.map) || same_file(o.output, o.points))
        return console.fail(fault(Exit::usage, "usage", "the output is one of the inputs", {.file = o.output}));
    Compiled c;
    if (reference) o.bake.compile.light.error_percent = 100; // its patches are not read
    if (const int code = compile_map(o.bake, console, context, Stage::light, c); code != 0) return code;
    const LightField field(c.world, c.bsp, c.bsp.planes, c.surfaces, c.lights, c.lighting);
    std::vector<std::vector<Row>> rows(points->size());
    const std::uint32_t replicates = o.replicates;
    const double error = o.bake.compile.light.error_percent;
    std::uint32_t rays = 64; // noise of a bundle falls about as N^-0.7: 1024 rays at 5 %
    while (rays < kMostRays && (o.rays ? std::uint64_t{rays} * replicates < o.rays : std::pow(rays, 0.7) < 128 * 5 / error / 2)) rays *= 2;
    parallel_for(context, reference ? "path tracing" : "gathering", points->size(), [&](std::size_t i) {
        const Point& p = (*points)[i];
        const Vec3 normal = p.surface ? p.normal : Vec3{};
        rows[i] = replicate(p, replicates, [&](std::uint32_t r, const Arrival& arrival) {
            const std::uint64_t seed = mix(i, r, 7u);
            if (reference)
                reference_arriving(field, off_surface(p), normal, rays, seed, arrival);
            else
                field.arriving(off_surface(p), normal, rays, seed, arrival);
        });
    });
    if (const int code = write_table(console, o.output, table(*points, rows)); code != 0) return code;
    console.say(fmt::format("{} points, {} x {} rays each", points->size(), replicates, rays));
    return console.verdict(context);
}

Command points_command(CLI::App& app, bool reference) {
    auto o = std::make_shared<PointOptions>();
    o->bake.add_to(app);
    app.add_option("--points", o->points, "CSV of points: kind,id,px,py,pz,nx,ny,nz,tx,ty,tz")->required()->type_name("FILE");
    app.add_option("-o,--output", o->output, "CSV of results (default: standard output)")->type_name("FILE");
    app.add_option("--rays", o->rays, reference ? "Paths at a point, of all replicates (default 16384)" : "Rays at a point (default: by --error)")->check(CLI::Range(1, 1 << 30))->type_name("N");
    app.add_option("--replicates", o->replicates, reference ? "Independent repetitions for the standard errors (default 16)" : "Independent repetitions for the standard errors (default 4)")
        ->check(CLI::Range(2, 1024))->type_name("N");
    if (reference) o->rays = 16384, o->replicates = 16;
    return [o, reference] { return run_points(*o, reference); };
}

// The drawn face under a surface point: nearest plane facing along the normal whose triangle holds the point.
std::uint32_t face_under(const kiln_level* level, const Point& p) {
    std::size_t vertices = 0, triangle_count = 0, face_count = 0;
    const float* positions = kiln_level_positions(level, &vertices);
    const std::uint32_t* triangles = kiln_level_triangles(level, &triangle_count);
    const kiln_face* faces = kiln_level_faces(level, &face_count);
    std::uint32_t best = KILN_NO_INDEX;
    double best_distance = 1.0; // map units: further off, the point is on no surface of this level
    for (std::uint32_t f = 0; f < face_count; ++f) {
        const kiln_face& face = faces[f];
        const Vec3 n{face.normal[0], face.normal[1], face.normal[2]};
        if (face.chart == KILN_NO_INDEX || dot(n, p.normal) < 0.99) continue;
        for (std::uint32_t t = face.first_triangle; t < face.first_triangle + face.triangle_count; ++t) {
            std::array<Vec3, 3> q;
            for (std::size_t k = 0; k < 3; ++k) {
                const float* v = positions + std::size_t{triangles[3 * t + k]} * 3;
                q[k] = {v[0], v[1], v[2]};
            }
            const double height = std::abs(dot(n, p.position - q[0]));
            if (height >= best_distance) continue;
            bool inside = true;
            for (std::size_t k = 0; k < 3; ++k) inside &= dot(cross(q[(k + 1) % 3] - q[k], p.position - q[k]), n) > -1e-3 * length(q[(k + 1) % 3] - q[k]);
            if (inside) best = f, best_distance = height;
        }
    }
    return best;
}

} // namespace

Command sample_command(CLI::App& app) {
    struct Options { std::string level, points, output; };
    auto o = std::make_shared<Options>();
    app.add_option("level", o->level, "The level file")->required();
    app.add_option("--points", o->points, "CSV of points: kind,id,px,py,pz,nx,ny,nz,tx,ty,tz")->required()->type_name("FILE");
    app.add_option("-o,--output", o->output, "CSV of results (default: standard output)")->type_name("FILE");
    app.footer("Surface points: the lightmap by the run-time formula for n, b1, b2, b3; free points: the ambient cube along the axes, without\nthe local lights listed with it. These are what the formats can represent: n is the irradiance itself, the others approximate it.\n"
               "example: kiln sample cornell.kiln --points cornell.points.csv");
    return [o]() -> int {
        Console console;
        const auto file = open_level(o->level);
        if (!file) return console.fail(file.fault());
        const auto& level = file->level;
        const auto points = read_points(o->points);
        if (!points) return console.fail(points.fault());
        if (same_file(o->output, o->level) || same_file(o->output, o->points))
            return console.fail(fault(Exit::usage, "usage", "the output is one of the inputs", {.file = o->output}));
        const char* what = "";
        if (const kiln_status s = kiln_level_check(level.get(), &what); s != KILN_OK)
            return console.fail(fault(Exit::input, "level-damaged", fmt::format("{}: {}", kiln_status_text(s), what), {.file = o->level}));
        std::vector<std::vector<Row>> rows(points->size());
        std::size_t missed = 0;
        for (std::size_t i = 0; i < points->size(); ++i) {
            const Point& p = (*points)[i];
            const double at[3] = {p.position.x, p.position.y, p.position.z};
            const std::uint32_t face = p.surface ? face_under(level.get(), p) : KILN_NO_INDEX;
            for (const Direction& d : directions(p)) {
                const float n[3] = {static_cast<float>(d.world.x), static_cast<float>(d.world.y), static_cast<float>(d.world.z)};
                float rgb[3] = {};
                const kiln_status s = p.surface ? kiln_level_eval_rnm(level.get(), face, at, n, rgb) : kiln_level_ambient_eval(level.get(), at, n, rgb);
                if (s != KILN_OK && s != KILN_NONE && s != KILN_BAD_ARGUMENT)
                    return console.fail(fault(Exit::input, "level-damaged", kiln_status_text(s), {.file = o->level}));
                if (s != KILN_OK) ++missed;
                rows[i].push_back({{rgb[0], rgb[1], rgb[2]}, {}});
            }
        }
        if (missed) console.say(fmt::format("{} values are stored nowhere and read as 0", missed));
        return write_table(console, o->output, table(*points, rows));
    };
}

Command gather_command(CLI::App& app) {
    app.footer("example: kiln gather cornell.vmf --points cornell.points.csv --error 2 -o got.csv");
    return points_command(app, false);
}
Command reference_command(CLI::App& app) {
    app.footer("example: kiln reference cornell.vmf --points cornell.points.csv --rays 65536 -o truth.csv");
    return points_command(app, true);
}

} // namespace kiln
